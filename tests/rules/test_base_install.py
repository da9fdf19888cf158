"""What an installation without extras must be able to do: everything imports without the extras' packages."""

import subprocess
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from pellucid import _core

ROOT = Path(__file__).parents[2]
BLOCKED = ("pyarrow", "h5py", "pandas", "statsmodels", "dask", "distributed", "emcee", "SALib", "mujoco", "pinocchio",
           "numba", "opensim", "mcap", "rosbags", "matio", "mne")  # fmt: skip
"""Packages of extras, which the base installation lacks."""

COMPILED = ("ezc3d", "vqf")
"""Packages of the base that are not installed where they have no wheel."""

MAX_BASE_BYTES = 350e6
"""Largest size of an installation without extras, its dependencies included."""

BEFORE = f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {BLOCKED + COMPILED!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
"""
"""Program lines after which the packages are as good as not installed."""

EVERY_MODULE = """
import importlib, pkgutil
import pellucid
for module in pkgutil.walk_packages(pellucid.__path__, "pellucid."):
    importlib.import_module(module.name)
"""

ARRAY_FUNCTIONS = """
import numpy as np
import pellucid as pl
t, rng = np.arange(0.0, 10.0, 1e-3), np.random.default_rng(1)
w1, w2 = 0.8 * np.pi, 2.2 * np.pi
q = 0.5 * np.sin(w1 * t) + 0.2 * np.sin(w2 * t)
v = 0.5 * w1 * np.cos(w1 * t) + 0.2 * w2 * np.cos(w2 * t)
a = -0.5 * w1**2 * np.sin(w1 * t) - 0.2 * w2**2 * np.sin(w2 * t)
effort = 0.05 * a + 1.5 * np.sin(q) + 0.08 * v + 0.3 * np.sign(v)
fit = pl.fit_joint(t, q, effort, friction="symmetric", lowpass=20.0, decimate=10)
assert repr(fit)
assert fit._repr_html_()
assert fit.plot() is not None
active = (t % 2.0) > 1.0
emg = {name: rng.standard_normal(t.size) * (0.02 + size * active) for name, size in (("a", 1.0), ("b", 0.4))}
envelope = {name: np.convolve(np.abs(x), np.ones(100) / 100, "same") for name, x in emg.items()}
assert pl.onset(emg["a"], fs=1000.0) is not None
assert pl.cocontraction(envelope["a"], envelope["b"], fs=1000.0) is not None
assert pl.synergies(envelope, fs=1000.0) is not None
"""

TEXT_TABLE = """
import tempfile
from pathlib import Path
import numpy as np
import pellucid as pl
samples = np.random.default_rng(1).standard_normal((20_000, 3))
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder, "long.csv")
    path.write_text("t,q,tau\\n" + "".join(f"{a!r},{b!r},{c!r}\\n" for a, b, c in samples.tolist()))
    columns = pl.read(path)
assert np.array_equal(np.stack([columns[name] for name in ("t", "q", "tau")], axis=1), samples)
"""

MISSING = """
from pathlib import Path
import numpy as np
import pytest
import pellucid as pl
from pellucid._tabular import data_frame
from pellucid.files.readers import c3d, hdf5, parquet
from pellucid.numerics.posterior.ensemble import require_sampler
from pellucid.orthosis.imu.imu_angle import Inertial, orientation
still = np.tile([0.0, 0.0, 9.81], (100, 1))
imu = Inertial(np.arange(100) / 100.0, 0.0 * still, still)
for ask, package in (
    (lambda: data_frame({"a": [1]}), '"pandas>='),
    (require_sampler, '"emcee>='),
    (lambda: parquet.read(Path("a.parquet")), '"pyarrow>='),
    (lambda: hdf5.read(Path("a.h5")), '"pyarrow>=[0-9.]+" "h5py>='),
    (lambda: c3d.read(Path("a.c3d")), "ezc3d "),
    (lambda: orientation(imu), "vqf "),
):
    with pytest.raises(pl.PellucidError, match=f"expected it: pip install {package}"):
        ask()
assert orientation(imu, "madgwick").shape == (100, 4)
"""


@pytest.mark.parametrize(
    "script", [EVERY_MODULE, ARRAY_FUNCTIONS, TEXT_TABLE, MISSING], ids=["modules", "arrays", "text", "missing"]
)
def test_no_extra_is_needed(script):
    done = subprocess.run([sys.executable, "-c", BEFORE + script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_no_package_of_an_extra_is_a_dependency():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert not [line for line in project["dependencies"] if line.lower().startswith(tuple(map(str.lower, BLOCKED)))]


def required_distributions(requirements: list[str]) -> set[str]:
    """Return the names of the distributions that `requirements` bring, with what those require."""
    found: set[str] = set()
    waiting = [Requirement(line) for line in requirements]
    while waiting:
        each = waiting.pop()
        if each.name.lower() in found or (each.marker and not each.marker.evaluate({"extra": ""})):
            continue
        found.add(each.name.lower())
        waiting += map(Requirement, distribution(each.name).requires or ())
    return found


def test_the_base_installation_is_small():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = required_distributions(project["dependencies"])
    files = [each.locate() for name in names for each in distribution(name).files or ()]
    files += [*(ROOT / "src/pellucid").rglob("*"), *Path(_core.__file__).parent.rglob("*")]
    size = sum(Path(file).stat().st_size for file in files if Path(file).is_file() and Path(file).suffix != ".pyc")
    assert size < MAX_BASE_BYTES, f"{1e-6 * size:.0f} MB"
