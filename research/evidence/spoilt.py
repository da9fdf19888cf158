"""Recordings with typical laboratory faults: stability of estimates, and correct detection of the cause.

Clean recordings of two real pendulums, a virtual joint, an exoskeleton's joint and a muscle are spoilt in one way at a
time. Parameters are to stay within 2 % of the clean fit's, or within one standard error where that is more; a message
that the clean recording does not cause must name the cause, and no other cause. Rejection counts as correct only for a
wrong sign, a wrong unit, and clipped or copied recordings.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from pellucid._errors import PellucidError
from pellucid.files import channels_toml, write_csv
from pellucid.files.recording import Channel
from pellucid.start_study import init as rig_files
from pellucid.study.datasets import init
from pellucid.study.procedures.registry import asked, open_study
from pellucid.study.procedures.run import calibrate, check, identify
from pellucid.study.results import ResultRow
from pellucid.study.study import Study
from pellucid_lab.simulate import simulate
from research.benchmarks._size import sized

SEED = 20261122
"""Seed of every random draw."""

PARAMETER_TOLERANCE_SHARE = 0.02
"""Relative error up to which a parameter counts as not affected."""

CASE_COUNT = sized(None, smallest=2)
"""Number of cases that are tried on each recording; None for all."""

Columns = dict[str, np.ndarray]

CAUSE_PATTERNS = {
    "spike": r"spikes?|outliers?|jump(s|ed)?|glitch(es)?",
    "gap": r"gaps?",
    "missing": r"NaN|missing",
    "rest": r"dropouts?|constant|frozen|stuck",
    "jitter": r"jitters?|irregular",
    "truncated": r"truncated|cut off|incomplete",
    "sign": r"sign|reversed",
    "unit": r"units?|mm|looks like degrees",
    "clipped": r"clip(s|ped|ping)?|saturat(ed|es|ion)",
    "copy": r"same|duplicate|identical|twice",
    "late": r"delay(s|ed)?|lags?|late",
    "contradiction": r"contradicts?|disagrees? with|differ between",
    "zero": r"zero of the angle|encoder's zero",
    "rollover": r"rolls? over|wrap(s|ped)?",
}
"""Regular expression for the words with which a message names each cause."""


@dataclass(frozen=True)
class Base:
    """A clean recording, and the study.toml around it."""

    name: str
    text: str  # All but [channels] and [[recordings]]
    channels: dict[str, Channel]
    others: tuple[dict[str, Channel], ...] = ()  # Fitted with it, and never spoilt
    drive: str = ""
    entry: str = ""  # More of its [[recordings]]

    def columns(self) -> Columns:
        """Its samples, to be spoilt."""
        return {name: channel.samples.copy() for name, channel in self.channels.items()}

    @property
    def moving(self) -> int:
        """A sample after two fifths in which it moves fast."""
        time, position = self.channels["time"].samples, self.channels["position"].samples
        speed = np.abs(np.gradient(position, time))
        # And where the drive works: what is lost of nothing does not show.
        work = speed * np.abs(self.channels[self.drive].samples)
        middle = slice(int(0.4 * len(time)), int(0.8 * len(time)))
        return middle.start + int(np.argmax(work[middle]))


@dataclass(frozen=True)
class Case:
    """One way of spoiling a recording."""

    cause: str
    spoil: Callable[[Base, Columns], Columns] | None = None
    refusable: bool = False
    may_name: tuple[str, ...] = ()  # Other causes that are there, too
    text: Callable[[str], str] | None = None  # Of the file
    everywhere: bool = False  # In what is fitted with it, too
    apart: bool = False  # The drive in a file of its own, on a clock that is 0.35 s ahead
    append: str = ""  # To study.toml
    change: Callable[[str], str] | None = None  # Of study.toml


def _at(
    channel: str, length: float, value: Callable[[np.ndarray, float], object]
) -> Callable[[Base, Columns], Columns]:
    """A channel spoilt for so many samples, or seconds where `length` is no whole number, while it moves."""

    def spoil(base: Base, columns: Columns) -> Columns:
        name = base.drive if channel == "drive" else channel
        time, k = columns["time"], base.moving
        n = int(length) if length == int(length) else max(round(length / np.median(np.diff(time))), 25)
        x, part = columns[name], slice(k, k + n)
        x[part] = value(x[part], float(np.ptp(x)))
        return columns

    return spoil


def _without(seconds: float) -> Callable[[Base, Columns], Columns]:
    def spoil(base: Base, columns: Columns) -> Columns:
        time, k = columns["time"], base.moving
        kept = (time <= time[k]) | (time > time[k] + seconds)
        return {name: x[kept] for name, x in columns.items()}

    return spoil


def _stamps(base: Base, columns: Columns) -> Columns:
    step = float(np.median(np.diff(columns["time"])))
    late = np.random.default_rng(SEED).uniform(-0.3, 0.3, len(columns["time"])) * step
    return columns | {"time": columns["time"] + late}


def _uneven(base: Base, columns: Columns) -> Columns:
    time = _stamps(base, columns)["time"]
    # A body moves smoothly between samples; a drive may step.
    taken = {name: np.interp(time, columns["time"], x) for name, x in columns.items()}
    taken["position"] = CubicSpline(columns["time"], columns["position"])(time)
    if base.drive == "voltage":
        taken["voltage"] = columns["voltage"][np.maximum(np.searchsorted(columns["time"], time, side="right") - 1, 0)]
    return taken | {"time": time}


def _clip(base: Base, columns: Columns) -> Columns:
    x = columns[base.drive]
    top = 0.5 * np.abs(x).max()
    return columns | {base.drive: np.clip(x, -top, top)}


def _scaled(channel: str, factor: float, offset: float = 0.0) -> Callable[[Base, Columns], Columns]:
    def spoil(base: Base, columns: Columns) -> Columns:
        name = base.drive if channel == "drive" else channel
        return columns | {name: factor * columns[name] + offset}

    return spoil


def _late(base: Base, columns: Columns) -> Columns:
    time, x = columns["time"], columns[base.drive]
    return columns | {base.drive: np.interp(time - 0.02, time, x)}


COPIED_ENTRY = '\n[[recordings]]\nname = "b"\nfile = "copy.csv"\nuse = "validate"\n'
"""Entry of study.toml that uses a copy of a fitted recording to validate."""

JOINT_CASES = {
    "spike": Case("spike", _at("position", 1, lambda x, span: x + 0.3 * span)),
    "two-sample spike": Case("spike", _at("position", 2, lambda x, span: x - 0.2 * span)),
    "spike of the drive": Case("spike", _at("drive", 1, lambda x, span: x + 100.0 * span)),
    "gap of 30 ms": Case("gap", _without(0.03)),
    "gap of 0.5 s": Case("gap", _without(0.5)),
    "40 NaN": Case("missing", _at("drive", 40, lambda x, span: np.nan)),
    "dropout": Case("rest", _at("drive", 0.13, lambda x, span: 0.0)),
    "frozen encoder": Case("rest", _at("position", 0.21, lambda x, span: x[0])),
    "stamps jitter": Case("jitter", _stamps),
    "uneven samples": Case("jitter", _uneven),
    "cut in a row": Case("truncated", text=lambda text: text[: int(0.98 * len(text))]),
    "sign": Case("sign", _scaled("drive", -1.0), refusable=True, everywhere=True, may_name=("clipped",)),
    "degrees": Case("unit", _scaled("position", 180.0 / np.pi), refusable=True, everywhere=True),
    "clipped": Case("clipped", _clip, refusable=True),
    "copied": Case("copy", refusable=True, append=COPIED_ENTRY),
}
"""Defects of a recorded joint."""

FURTHER_CASES = {
    "drive in another file": Case("", apart=True),
    "zero off by 15 degrees": Case("zero", _scaled("position", 1.0, np.radians(15.0))),
    "drive late by 20 ms": Case("late", _late),
    "rolls over": Case("rollover", lambda base, c: c | {"position": c["position"] % (2.0 * np.pi)}, refusable=True),
    "rolls over, as stated": Case(
        "",
        lambda base, c: c | {"position": c["position"] % (2.0 * np.pi)},
        change=lambda text: text.replace(
            'column = "position", unit = "rad"', 'column = "position", unit = "rad", wrap = "360 deg"'
        ),
    ),
}
"""Further defects, which are tried on one data set only."""


def _head(study: Study) -> str:
    """What a study says before its recordings, without [channels], its notes and what it knows of a controller."""
    text = (study.folder / "study.toml").read_text(encoding="utf-8")
    text = text[: text.index("[[recordings]]")] if "[[recordings]]" in text else text
    for table in ("channels", "rig.loop"):
        text = re.sub(rf"^\[{re.escape(table)}\][^\n]*\n(?:(?!\[)[^\n]*\n)*", "", text, flags=re.MULTILINE)
    return text


def _bases(folder: Path) -> Iterator[tuple[Base, dict[str, Case]]]:
    """Clean recordings, and what is done to each."""
    study = init(folder / "sydney", dataset="sydney_pendulum")
    first, last = study.recordings()
    sydney = Base("sydney", _head(study), dict(first.channels), drive="voltage")
    # Its voltage rests and steps by design: nothing tells such a rest from one that was lost or clipped.
    steps = {name: case for name, case in JOINT_CASES.items() if name not in ("dropout", "clipped")}
    yield sydney, {**steps, **FURTHER_CASES}
    yield (
        Base("sydney.two", _head(study), dict(first.channels), (dict(last.channels),), "voltage"),
        {"contradicting": Case("contradiction", _scaled("drive", 1.7))},
    )
    study = init(folder / "bam", dataset="bam_xl330")
    one, two = study.recordings("fit")[:2]
    bam = {n: one.channels[n] for n in ("time", "position", "duty", "enabled")}
    yield Base("bam", _head(study), bam, ({n: two.channels[n] for n in bam},), "duty"), JOINT_CASES
    rig_files(folder / "bench", rig="bench-joint")
    simulate(folder / "bench", SEED)
    study = open_study(folder / "bench")
    shown = {n: study.recording("multisine").channels[n] for n in ("time", "position", "current")}
    yield Base("bench", _head(study), shown, drive="current"), JOINT_CASES
    point = {n: study.recording("point_to_point").channels[n] for n in shown}
    pair = {"contradicting": Case("contradiction", _scaled("drive", 1.7))}
    yield Base("bench.two", _head(study), shown, (point,), "current"), pair
    study = init(folder / "modexo", dataset="modexo_joint")
    made = study.recording("i_05_b_1_k_20_T_50")
    few = {
        "spike": Case("spike", _at("position", 1, lambda x, span: x + span), may_name=("gap",)),
        "4 NaN": Case("missing", _at("torque", 4, lambda x, span: np.nan), may_name=("gap",)),
    }
    modexo = Base("modexo", _head(study), dict(made.channels), drive="torque")
    yield modexo, few


def _channels(base: Base, case: Case) -> dict[str, Channel]:
    columns = case.spoil(base, base.columns()) if case.spoil else base.columns()
    return {n: Channel(n, x, base.channels[n].unit, n) for n, x in columns.items()}


def _write(folder: Path, base: Base, case: Case) -> Study:
    folder.mkdir()
    channels = _channels(base, case)
    path = write_csv(folder / "a.csv", channels)
    if case.text:
        path.write_text(case.text(path.read_text(encoding="utf-8")), encoding="utf-8")
    (folder / "copy.csv").write_bytes(path.read_bytes())
    table = channels_toml(base.channels)
    if any(channel.name == base.drive for channel in base.channels.values()) and base.drive == "voltage":
        table = table.replace('unit = "V"', 'unit = "V", clip = "accept"') if case.cause != "clipped" else table
    entries = f'[[recordings]]\nname = "a"\nfile = "a.csv"\n{base.entry}'
    for i, other in enumerate(base.others):
        write_csv(
            folder / f"other{i}.csv", _channels(replace(base, channels=other), case if case.everywhere else Case(""))
        )
        entries += f'\n[[recordings]]\nname = "other{i}"\nfile = "other{i}.csv"\n'
    if case.apart:
        drive = {"time": channels["time"], base.drive: channels[base.drive]}
        later = replace(drive["time"], samples=drive["time"].samples + 0.35)
        write_csv(folder / "drive.csv", drive | {"time": later})
        write_csv(folder / "a.csv", {n: c for n, c in channels.items() if n != base.drive})
        table = channels_toml({n: c for n, c in channels.items() if n != base.drive})
        table += "[streams.drive]\njoin = true\n" + channels_toml(drive).replace(
            "[channels]", "[streams.drive.channels]"
        )
        entries = entries.replace('file = "a.csv"', 'file = "a.csv"\nstreams = { drive = "drive.csv" }')
    text = base.text + table + entries + case.append
    (folder / "study.toml").write_text(case.change(text) if case.change else text, encoding="utf-8")
    return open_study(folder)


def _tried(study: Study) -> tuple[dict[str, tuple[float, float]], list[str]]:
    """Parameters with their standard errors, none where it is refused, and everything that is said."""
    said: list[str] = []
    try:
        faults = check(study)
        said += [fault.message for fault in faults]
        if any(fault.severity == "refuse" for fault in faults):
            return {}, said
        if asked(study)[0].name == "joint":
            result = identify(study, families=["symmetric"], thorough=False)
        else:
            result = identify(study) if asked(study)[0].command == "identify" else calibrate(study)
    except PellucidError as error:
        return {}, [*said, *str(error).splitlines()]
    said += [result.headline, *(verdict.text for verdict in result.verdicts)]
    return {
        n: (p.value, p.standard_error) for n, p in result.estimates.items() if "." not in n and p.identifiable
    }, said


def _words(line: str) -> str:
    """A line without its numbers."""
    return re.sub(r"[-+]?\d[\d.e+-]*", "#", line)


def _named(said: list[str], quiet: set[str]) -> set[str]:
    """Causes in lines that are not said of the clean recording."""
    lines = [line for line in said if _words(line) not in quiet]
    return {
        cause for cause, words in CAUSE_PATTERNS.items() if any(re.search(rf"\b({words})\b", x, re.I) for x in lines)
    }


def rows() -> Iterator[ResultRow]:
    """How many cases came out wrong, and what came of each."""
    total = wrong = 0
    made: list[ResultRow] = []

    def row(name: str, value: float | None, unit: str, note: str) -> ResultRow:
        return ResultRow(f"spoilt.{name}", value, unit, "evidence", "fitted", None, note)

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for base, cases in _bases(folder):
            clean, quiet = _tried(_write(folder / f"case{total}.{base.name}", base, Case("")))
            for name, case in list(cases.items())[:CASE_COUNT]:
                values, said = _tried(_write(folder / f"case{total}.{base.name}.x", base, case))
                causes = _named(said, {_words(line) for line in quiet})
                shared = [n for n in clean if n in values]
                off = max((abs(values[n][0] - clean[n][0]) / abs(clean[n][0]) for n in shared), default=np.nan)
                near = bool(shared) and all(
                    abs(values[n][0] - clean[n][0]) <= max(PARAMETER_TOLERANCE_SHARE * abs(clean[n][0]), clean[n][1])
                    for n in shared
                )
                named = not case.cause or case.cause in causes
                false = causes - {case.cause, *case.may_name}
                ok = named and not false and (near if values else case.refusable)
                # What no cut mends, and only a person can set right, is to be said.
                ok = ok or (case.cause in ("contradiction", "zero") and named and not false)
                total, wrong = total + 1, wrong + (not ok)
                note = "; ".join(
                    [
                        "as wanted" if ok else "WRONG",
                        "fitted" if values else "refused",
                        "cause named" if named else "cause not named",
                        *([f"also named: {', '.join(sorted(false))}"] if false else []),
                    ]
                )
                made.append(row(f"{base.name}.{name.replace(' ', '_')}", 100.0 * off if values else None, "%", note))
    yield row(
        "cases", float(total), "1", "one defect at a time, in recordings of two pendulums, a virtual joint and more"
    )
    yield row(
        "wrong", float(wrong), "1", "off by more than 2 % and a standard error, cause not named, or one that is not"
    )
    yield from made
