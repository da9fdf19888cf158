"""Independence from held-out data, and correctness of choices, delays and weights on machines simulated without
Pellucid.

Held-out files: for studies of every procedure that fits anything, the contents of the held-out files are replaced: by
another machine's recording, by three times the effort, by reversed time and by shifted positions. Every number of the
cards and of the rows of fitted data is compared to the last bit; so are the constants of exports, which are made of
cards alone. A refusal by `check` or by the procedure counts as a failure.

Families, delays and payloads: joints are drawn over the sizes of wearable robots and simulated by a plain integrator
with friction of its own (`_foreign_joint.py`). Their recordings are identified by default settings.

- family overfit: joints with dry and viscous friction alone, for which a richer family is named;
- false delays: recordings whose torque and position are synchronous, for which a delay is found;
- gravity with payload: largest error of the joint's own gravity torque where one recording has a stated payload.

What was chosen on other draws: nothing; thresholds are those of the study file and of `numerics/delay.py`.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import pellucid as pl
from pellucid.joint.study.aligned_motions import find_alignments
from pellucid.study.datasets.init import init
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import ResultRow
from pellucid.study.study import Study
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.elbow.protocol import trials as elbow_trials
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.knee.protocol import bench_trials, imu_trial, mvc_trial, relaxed_trial, swing_trial, torque_trial
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.processes import ordered_results
from pellucid_lab.seated.rig import load_seated_rig
from pellucid_lab.study import write_study
from research.benchmarks._size import is_smallest, sized

from . import _spoilt_recordings
from ._foreign_joint import ForeignJoint, drawn_joint, recorded, written
from ._replaced import REPLACEMENTS, Replacement, compare_replacements

FAMILY_JOINTS = sized(100, smallest=2)
"""Number of simulated joints with plain friction."""

DELAY_DRAWS = sized(200, smallest=2)
"""Number of recordings with synchronous channels."""

PAYLOAD_JOINTS = sized(12, smallest=1)
"""Number of simulated joints with a payload."""

JOINT_SEED = 20261126
"""Seed that draws the joints."""

BATCH_SIZE = 50
"""Number of joints that are integrated side by side."""


@dataclass(frozen=True)
class JudgedCase:
    """A study, one procedure of it, and what to run it with."""

    procedure: str
    data: str  # rig or data set, in words
    make: Callable[[Path], Study]
    options: dict[str, Any]
    replacements: tuple[str, ...] = tuple(REPLACEMENTS)


def rows(joints: int = FAMILY_JOINTS, draws: int = DELAY_DRAWS, loaded: int = PAYLOAD_JOINTS) -> Iterator[ResultRow]:
    """Every figure."""
    yield from judged_rows(judged_cases())
    yield from foreign_rows(joints, draws, loaded)
    yield from _spoilt_recordings.rows()


def _row(name: str, value: float, unit: str, note: str, split: str = "simulated") -> ResultRow:
    return ResultRow(f"truth.{name}", float(value), unit, "evidence", split, None, note)


# --- held-out files -------------------------------------------------------------------------------------------------


def judged_cases() -> list[JudgedCase]:
    """Return a case for every procedure that fits anything, on virtual rigs, and on public data where they are here."""
    thorough = {"joint": {"thorough": not is_smallest()}}
    made = [
        JudgedCase("joint", "bench-joint", _bench, thorough),
        JudgedCase("slider", "able-elbow", _elbow, {}),
        JudgedCase("transfer_function", "drawn joint", _linear_joint, {}),
        JudgedCase("loaded_swing", "knee-seated", _seated, {}),
    ]
    if not is_smallest():
        made.append(JudgedCase("coupling", "knee-orthosis", _orthosis, {}))
    public = [
        JudgedCase("isolated_muscle", "rat_soleus_hill", _public("rat_soleus_hill"), {}),
        JudgedCase("synergies", "lower_limb_walking", _public("lower_limb_walking", SYNERGIES), {}),
        JudgedCase("cocontraction", "lower_limb_walking", _public("lower_limb_walking", COCONTRACTION), {}),
    ]
    if not is_smallest():
        public += [
            JudgedCase("joint", "emps", _public("emps"), thorough),
            JudgedCase("joint", "sydney_pendulum", _public("sydney_pendulum"), thorough),
            JudgedCase("joint", "bam_xl330", _public("bam_xl330"), thorough),
            JudgedCase("tree", "ur10e", _public("ur10e"), {}),
            JudgedCase("emg_torque", "lower_limb_walking", _public("lower_limb_walking"), {}),
            JudgedCase("activations", "lower_limb_walking", _public("lower_limb_walking", ACTIVATIONS), {}),
        ]
    return made + public


SYNERGIES = '[synergies]\nchain = "none"\n'
COCONTRACTION = '[cocontraction]\nchain = "none"\npairs = [["tibialis_anterior", "soleus"]]\n'
ACTIVATIONS = "[activations]\n"


def _bench(folder: Path) -> Study:
    rig = bench_joint()
    return write_study(folder, rig, name="bench", seed=1, threads=1)


def _elbow(folder: Path) -> Study:
    kept = [t for t in elbow_trials(able_elbow()) if re.fullmatch(r"(constant|sweep|static)_[136]", t.name)]
    kept += [t for t in elbow_trials(able_elbow()) if t.name == "unseen_constant_2"]
    return write_study(folder, able_elbow(), name="elbow", seed=1, trials=kept, threads=1)


def _seated(folder: Path) -> Study:
    return write_study(folder, load_seated_rig(), name="seated", seed=1, threads=1)


def _orthosis(folder: Path) -> Study:
    rig = knee_orthosis()
    s1 = rig.subjects["S1"]
    alone = [t for t in bench_trials(rig) if t.name in ("gravity", "response_03", "response_10", "response_check_07")]
    worn = [
        imu_trial(rig, "S1_imu", "S1"),
        relaxed_trial(rig, "S1_relaxed_1", s1),
        relaxed_trial(rig, "S1_relaxed_2", s1),
        mvc_trial(rig, "S1_mvc", s1),
        torque_trial(rig, "S1_torque_30_1", s1, float(np.radians(30.0))),
        torque_trial(rig, "S1_torque_60_1", s1, float(np.radians(60.0))),
    ]
    uses = enumerate(("fit", "fit", "validate"), 1)
    swings = [swing_trial(rig, f"S1_swing_{i}", s1, duration=24.0, use=use) for i, use in uses]
    return write_study(folder, rig, name="knee", seed=1, trials=[*alone, *worn, *swings], threads=1)


def _linear_joint(folder: Path) -> Study:
    """Write two recordings of a joint under torque steps, with a table [transfer_function]."""
    rng = np.random.default_rng(JOINT_SEED)
    more = '[transfer_function]\ninput = "torque"\noutput = "position"\npoles = 2\n'
    joint = replace(drawn_joint(rng), coulomb=0.01)
    first, second = recorded([joint, joint], rng, 30.0)
    return written(folder, {"a": ("fit", first), "b": ("validate", second)}, more)


def _public(name: str, more: str = "") -> Callable[[Path], Study]:
    def make(folder: Path) -> Study:
        init(folder, name)
        text = (folder / "study.toml").read_text(encoding="utf-8")
        head, mark, tail = text.partition("[[recordings]]")
        (folder / "study.toml").write_text(f"{head}{more}\n{mark}{tail}", encoding="utf-8")
        return open_study(folder)

    return make


def judged_rows(cases: list[JudgedCase]) -> Iterator[ResultRow]:
    """Count fitted numbers that moved and studies that were refused, over every case and replacement."""
    moved, refused, procedures = 0, 0, set()
    for case in cases:
        found = _compared(case)
        procedures.add(case.procedure)
        numbers = sorted({place for each in found for place in each.moved})
        reasons = [f"{each.name}: {each.refused[:120]}" for each in found if each.refused]
        moved, refused = moved + len(numbers), refused + len(reasons)
        note = f"of {case.procedure} on {case.data}, {len(found)} replacements"
        yield _row(
            f"judged.{case.procedure}.{case.data.replace(' ', '_')}.moved", len(numbers), "1",
            f"{note}{': ' if numbers else ''}{', '.join(numbers[:3])}",
        )  # fmt: skip
        yield _row(
            f"judged.{case.procedure}.{case.data.replace(' ', '_')}.refused", len(reasons), "1",
            f"{note}{': ' if reasons else ''}{'; '.join(reasons[:2])}",
        )  # fmt: skip
    said = f"{len(cases)} studies, {len(REPLACEMENTS)} replacements of their held-out files"
    yield _row("fitted_numbers_moved_by_judged_data", moved, "1", f"numbers of cards and fitted rows; {said}")
    yield _row("judged_data_refused", refused, "1", f"refusals by check or by a procedure; {said}")
    yield _row("procedures_tried", len(procedures), "1", ", ".join(sorted(procedures)))


def _compared(case: JudgedCase) -> list[Replacement]:
    with tempfile.TemporaryDirectory() as folder:
        study = case.make(Path(folder) / "study")
        return compare_replacements(study, case.replacements, procedure=case.procedure, **case.options)


# --- machines that nothing of Pellucid simulates --------------------------------------------------------------------


def foreign_rows(joints: int, draws: int, loaded: int) -> Iterator[ResultRow]:
    """Count richer families and false delays, and measure gravity with a stated payload."""
    rng = np.random.default_rng(JOINT_SEED)
    plain = [drawn_joint(rng) for _ in range(joints)]
    tables = _recorded_in_batches(plain, rng)
    richer = ordered_results([(best_family, table) for table in tables])
    named = sorted({name for name in richer if name != "symmetric"})
    note = f"{joints} simulated joints with dry and viscous friction{': ' if named else ''}{', '.join(named)}"
    yield _row("family_overfit", 100.0 * np.mean([name != "symmetric" for name in richer]), "%", note)
    bending = [replace(drawn_joint(rng), bristle=float(rng.uniform(100.0, 1000.0)) * (i % 2)) for i in range(draws)]
    bending = [replace(j, bristle=j.bristle * j.coulomb, load=0.05 * (i % 3)) for i, j in enumerate(bending)]
    late = ordered_results([(found_delay, table) for table in _recorded_in_batches(bending, rng)])
    wrong = [x for x in late if x]
    note = f"{draws} recordings with synchronous channels, every other joint with a LuGre bristle"
    note += f"; found {', '.join(f'{1e3 * x:.1f} ms' for x in wrong[:6])}" if wrong else ""
    yield _row("false_delays", 100.0 * len(wrong) / draws, "%", note)
    errors = ordered_results([(gravity_error, *pair) for pair in _with_payloads(loaded, rng)])
    note = f"largest error of gravity over {loaded} simulated joints, one recording of each with a stated payload"
    yield _row("gravity_with_payload", max(errors), "%", f"{note}; median {np.median(errors):.2g} %")


def _recorded_in_batches(joints: list[ForeignJoint], rng: np.random.Generator) -> list[np.ndarray]:
    made: list[np.ndarray] = []
    for first in range(0, len(joints), BATCH_SIZE):
        made += recorded(joints[first : first + BATCH_SIZE], rng)
    return made


def best_family(table: np.ndarray) -> str:
    """Return the family that is named of one recording, among those that a study has by default."""
    with tempfile.TemporaryDirectory() as folder:
        # The other estimators take no part in the choice of a family.
        return pl.identify(written(Path(folder) / "s", {"a": ("fit", table)}), thorough=False).best


def found_delay(table: np.ndarray) -> float:
    """Return the time by which the torque of one recording is moved [s]; 0 if it is not."""
    with tempfile.TemporaryDirectory() as folder:
        found = find_alignments(written(Path(folder) / "s", {"a": ("fit", table)}))
        return float(sum(abs(each.moved) for each in found))


def _with_payloads(count: int, rng: np.random.Generator) -> list[tuple[ForeignJoint, np.ndarray, np.ndarray, str]]:
    joints = [drawn_joint(rng) for _ in range(count)]
    distance = [float(rng.uniform(0.15, 0.4)) for _ in joints]
    mass = [0.5 * j.gravity / (9.80665 * d) for j, d in zip(joints, distance, strict=True)]
    heavy = [j.with_payload(m, d) for j, m, d in zip(joints, mass, distance, strict=True)]
    empty, loaded = recorded(joints, rng), recorded(heavy, rng)
    said = [f'payload = {{ mass = "{m} kg", distance = "{d} m" }}' for m, d in zip(mass, distance, strict=True)]
    return list(zip(joints, empty, loaded, said, strict=True))


def gravity_error(joint: ForeignJoint, empty: np.ndarray, loaded: np.ndarray, payload: str) -> float:
    """Return the error of a joint's gravity [%], from a recording without and one with a payload."""
    with tempfile.TemporaryDirectory() as folder:
        recordings = {"empty": ("fit", empty), "loaded": (f"fit\n{payload}", loaded)}
        found = pl.identify(written(Path(folder) / "s", recordings))
        return 100.0 * abs(found["gravity"].value / joint.gravity - 1.0)
