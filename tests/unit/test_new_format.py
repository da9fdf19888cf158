"""A new file format is one new file: a copy of the package with it opens a study's recordings."""

import numpy as np
import pytest
from copied_package import copied_package, run_copied

READER = '''"""Lines of the angle and the torque, one sample each, after the rate in the first."""

import numpy as np

from ._columns import Columns

ENDINGS = (".rig",)


def read(path):
    """Columns t, q and tau, each shape (n,)."""
    rate, *rows = path.read_text(encoding="utf-8").splitlines()
    values = np.array([row.split(";") for row in rows], float)
    return Columns(path, {"t": np.arange(len(values)) / float(rate), "q": values[:, 0], "tau": values[:, 1]})
'''
STUDY = """
name = "arm"
[rig]
joint = "elbow"
motion = "rotary"
[rig.drive]
kind = "torque"
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "tau", unit = "N*m" }
[[recordings]]
name = "one"
file = "one.rig"
[[recordings]]
name = "two"
file = "two.rig"
use = "validate"
"""
SCRIPT = """
import sys
import pellucid as pl
study = pl.open(sys.argv[1])
print(len(pl.read(study.folder / "one.rig")["tau"]), end=" ")
pl.check(study)
print(pl.identify(study)["inertia"].value)
"""


@pytest.mark.nightly
@pytest.mark.slow
def test_a_format_is_one_file(tmp_path, rng):
    copy = copied_package(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in copy.rglob("*") if path.is_file()}
    (copy / "files" / "readers" / "rig.py").write_text(READER, encoding="utf-8")
    t = np.arange(10000) / 250.0
    folder = tmp_path / "arm"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    for name, phase in (("one", 0.0), ("two", 1.0)):
        parts = [(0.5, 0.13, phase), (0.3, 0.47, 1.0), (0.15, 1.1, 2.0)]
        q = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in parts)
        v = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + p) for a, f, p in parts)
        acc = -sum(a * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * t + p) for a, f, p in parts)
        tau = 0.2 * acc + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.1 * v + 0.01 * rng.standard_normal(len(t))
        rows = "\n".join(f"{a:.9f};{b:.9f}" for a, b in zip(q, tau, strict=True))
        (folder / f"{name}.rig").write_text(f"250\n{rows}\n", encoding="utf-8")
    touched = [path for path in copy.rglob("*") if path.is_file() and before.get(path) != path.stat().st_mtime_ns]
    assert [path.name for path in touched] == ["rig.py"]
    run = run_copied(copy.parent, SCRIPT, folder)
    assert run.returncode == 0, run.stderr
    count, inertia = run.stdout.split()
    assert count == "10000"
    assert abs(float(inertia) / 0.2 - 1.0) < 0.02
