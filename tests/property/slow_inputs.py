"""Small files that may make a parser slow or large: skeletons of files whose gap is filled with one pattern."""

from __future__ import annotations

FILLERS = (
    " ", "\t", ";", ",", "[", "(", '"', "'", "#", "=", ":", "a", "1", ".", "-", "a.", "a .", '"".', "{", "<a>", "<a/>",
    "\n", "\r", "a:b\n", "[a]\n", "[[a]]\n", "a=1\n", "[ ", "1 ", "a,", "1,", "\\", "@", "a@", "é", "1e", "&amp;",
    "{a=", '{"a":', "[],", '"a":1,', " #", " ;", '" ', "\x00", "_",
)  # fmt: skip
"""Patterns that fill the gap of a skeleton."""

TABLE = "time,q\n" + "".join(f"{0.01 * i:.2f},{i}\n" for i in range(40))
STORAGE = "name\nversion=1\n%s\nendheader\ntime\tq\n" + "".join(f"{0.01 * i:.2f}\t{i}\n" for i in range(40))

RECORDINGS = {
    "head.csv": "%s\n" + TABLE,
    "name.csv": "time,q %s x\n" + "".join(f"{0.01 * i:.2f},{i}\n" for i in range(40)),
    "fact.csv": "# rate: %sx\n" + TABLE,
    "cell.csv": TABLE + "0.40,%s\n0.41,1\n",
    "end.csv": TABLE + "0.40,%s",
    "head.dat": "# %s\n" + TABLE.replace(",", " "),
    "row.txt": TABLE.replace(",", "\t") + "%s",
    "head.sto": STORAGE,
    "value.sto": "name\nnRows=2%sx\nendheader\ntime\tq\n0\t1\n1\t2\n",
    "title.mot": "%s\nnRows=2\nnColumns=2\nendheader\ntime\tq\n0\t1\n1\t2\n",
    "label.sto": "name\nendheader\ntime\tq%s\n0\t1\n1\t2\n",
    "head.trc": "PathFileType\t4\t(X/Y/Z)\t%s\nDataRate\n100\nFrame#\tTime\tm\n\t\tX1\tY1\tZ1\n\n1\t0.0\t1\t2\t3\n",
    "tree.json": '{"t": [0, 1, 2], "a": %s',
    "whole.json": "%s",
}
"""Skeletons of recordings by their files' names."""

STUDY = 'name = "a"\n[rig]\njoint = "elbow"\nmotion = "rotary"\n[rig.drive]\nkind = "torque"\n[channels]\n'

STUDIES = {
    "key": STUDY + "%sa = 1\n",
    "value": STUDY + "a = %s\n",
    "text": STUDY + 'a = "%s"\n',
    "quantity": STUDY.replace("[channels]", 'limit = "1 %sx"\n[channels]'),
    "table": STUDY + "[%sa]\n",
    "notes": STUDY + 'a = """\n[%s\n"""\n[unknown]\nb = 1\n',
    "end": STUDY + "%s",
}
"""Skeletons of study.toml."""

ROBOTS = {
    "name": '<robot name="%s"><link name="a"/></robot>',
    "inside": '<robot name="r"><link name="a"/>%s</robot>',
    "number": '<robot name="r"><link name="a"><inertial><mass value="%s"/></inertial></link></robot>',
}
"""Skeletons of robots' files."""

CARDS = {"value": '{"format": 1, "joint": %s}', "text": '{"format": 1, "joint": "%s"}', "whole": "%s"}
"""Skeletons of cards."""


def filled(skeleton: str, filler: str, size: int) -> bytes:
    """Return a skeleton whose gap is filled up to a size [B]."""
    return skeleton.replace("%s", filler * max(1, size // len(filler))).encode()
