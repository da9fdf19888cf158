"""What tests share: a seeded generator, the public recordings, and a small study made up on the spot."""

from __future__ import annotations

import gc
import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from shared_compiler import install_stand_ins

from pellucid.study.procedures.registry import open_study
from pellucid.study.study import Study
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study

pytest_plugins = ["real_time"]

NEARBY = Path(__file__).parents[1].parent / "shared" / "data"

# What a test that was skipped lacks, by words of its reason, and how to have it run.
LACKED = {
    "the public recordings": (
        ("public recordings", "is not here", "not on this machine", "could not be downloaded"),
        "set PELLUCID_DATA to a folder that has them, or: pellucid datasets fetch NAME (pellucid datasets list: names)",
    ),
    "a browser": (("no browser",), "apt-get install chromium"),
    "a compiler, or a microcontroller's and its emulator": (
        ("not installed",),
        "apt-get install build-essential gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm",
    ),
}


def skipped_lines(reasons: list[str]) -> list[str]:
    """One line for each thing that skipped tests lack; other reasons with their count."""
    lacked = Counter()
    for reason in reasons:
        plain = reason.removeprefix("Skipped: ")
        lacked[next((what for what, (words, _) in LACKED.items() if any(w in plain for w in words)), plain)] += 1
    lines = [
        f"{lacked.pop(what)} skipped for want of {what}. To have them run: {how}"
        for what, (_, how) in LACKED.items()
        if what in lacked
    ]
    return lines + [f"{count} skipped: {reason}" for reason, count in lacked.items()]


def pytest_collection(session):
    # Collecting makes over a million objects that stay: the garbage collector would search all of them again and again,
    # which takes a quarter of the time that collecting takes.
    gc.disable()


def pytest_collection_finish(session):
    gc.freeze()
    gc.enable()


def pytest_terminal_summary(terminalreporter):
    skipped = [report.longrepr for report in terminalreporter.stats.get("skipped", ())]
    for line in skipped_lines([each[2] if isinstance(each, tuple) else str(each) for each in skipped]):
        terminalreporter.write_line(line)


@pytest.fixture(scope="session", autouse=True)
def own_settings(tmp_path_factory) -> None:
    """The settings of the tests, and of every command that they start; nobody's own."""
    os.environ["PELLUCID_SETTINGS"] = str(tmp_path_factory.mktemp("settings"))


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory) -> None:
    """Compilers that compile no export of the same content twice, in all processes of this run of the tests."""
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own
    install_stand_ins(own / "compilers", shared / "compiled")
    os.environ["PATH"] = os.pathsep.join((str(own / "compilers"), os.environ["PATH"]))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260115)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder with the public recordings, PELLUCID_DATA set to it."""
    folder = Path(os.environ.get("PELLUCID_DATA", NEARBY))
    if not folder.is_dir():
        pytest.skip(f"no public recordings: neither PELLUCID_DATA nor {NEARBY.name} beside the checkout is there")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PELLUCID_DATA", str(folder))
        yield folder


STUDY = """\
name = "bench"

[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"

[rig.drive]
kind = "current"
torque_constant = "2 N*m/A"

[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
current = { column = "i", unit = "A" }

[processing]
lowpass = "20 Hz"
decimate = 5
trim = 20

[[recordings]]
name = "sweep"
file = "recordings/sweep.csv"
protocol = "multisine"
use = "fit"
"""


def swing(n: int = 2000, fs: float = 200.0) -> dict[str, np.ndarray]:
    """A pendulum of 0.05 kg*m^2 and 1.5 N*m, driven through three sines: columns t, q, i."""
    t = np.arange(n) / fs
    parts = [(0.5, 0.4, 0.0), (0.3, 1.1, 0.7), (0.1, 2.3, 1.9)]
    q, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
    for amplitude, frequency, phase in parts:
        w = 2 * np.pi * frequency
        q += amplitude * np.sin(w * t + phase)
        v += amplitude * w * np.cos(w * t + phase)
        a -= amplitude * w**2 * np.sin(w * t + phase)
    torque = 0.05 * a + 1.5 * np.sin(q) + 0.1 * v + 0.2 * np.tanh(v / 0.05)
    return {"t": t, "q": q, "i": torque / 2.0}


@pytest.fixture
def make_study(tmp_path):
    """Write a study: `columns` of its one CSV, and pairs of texts to replace in its study.toml."""

    def make(columns: dict[str, np.ndarray] | None = None, *changes: tuple[str, str], append: str = "") -> Study:
        columns = swing() if columns is None else columns
        text = STUDY
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        folder = tmp_path / "bench"
        (folder / "recordings").mkdir(parents=True, exist_ok=True)
        (folder / "study.toml").write_text(text + append, encoding="utf-8")
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
        (folder / "recordings" / "sweep.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return open_study(folder)

    make.swing = swing
    return make


@pytest.fixture(scope="session")
def emps_study(data_folder, tmp_path_factory) -> Study:
    from pellucid.study.datasets import init

    return init(tmp_path_factory.mktemp("emps") / "emps", dataset="emps")


@pytest.fixture(scope="session")
def emps_fit(emps_study):
    """The EMPS benchmark identified, once for all tests that judge it."""
    from pellucid.study.procedures.run import identify

    return identify(emps_study, families=["symmetric", "directional"])


@pytest.fixture(scope="session")
def emps_data(emps_study):
    """The symmetric model, and the EMPS recording to fit, reduced."""
    from pellucid.joint.study.aligned_motions import aligned_motions
    from pellucid.models.joint import joint_model
    from pellucid.numerics.regression import stack

    model = joint_model("symmetric", motion="prismatic", effort_unit="N", gravity="none")
    return model, stack(aligned_motions(emps_study, "fit"))


@pytest.fixture(scope="session")
def bench_samples(tmp_path_factory):
    """Time, position and current of one recording of a virtual joint."""
    rig = bench_joint()
    study = write_study(tmp_path_factory.mktemp("bench") / "b", rig, name="b", seed=2, trials=rig.trials(2)[:1])
    (recording,) = study.recordings()
    return {"time": recording.time, "q": recording["position"], "i": recording["current"]}
