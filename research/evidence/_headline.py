"""Is the headline the model that predicts best, and are its intervals as narrow as its errors allow?

100 joints that Pellucid does not simulate are recorded twice: the first recording is fitted, the second held out. They
are joints of MuJoCo and Pinocchio (`_foreign_plants.py`) and of a plain integrator (`_foreign_joint.py`), with dry
friction or LuGre's. Each is identified as a study is by default, by all families and estimators.

- coverage and width: 95 % intervals of the headline that contain the true value; the median half-width over the median
  error, both as shares of the true value. For an exact interval of a normal error this is 2.9;
- clean width: `coverage.clean.width_over_exact`, on joints with dry and viscous friction alone;
- excess: held-out error of the headline's effort over that of the best of all computed models.

The same ratio is measured on the public data sets as their studies hold recordings out. With purpose "simulation" the
headline's free simulation of held-out recordings, over the horizon by which it was chosen, is compared with that by
least squares of the same family. Held-out recordings choose nothing here: they tell which choice would have been best.

The method was chosen on joints of the seed 91.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import pellucid as pl
from pellucid.joint.fit.estimators import SolvedMethod
from pellucid.joint.fit.headline_choice import simulated_errors
from pellucid.joint.fit.joint_estimate import JointEstimate
from pellucid.joint.fit.replay import pool_errors, predict
from pellucid.joint.study.aligned_motions import aligned_motions
from pellucid.joint.study.joint_result import JointResult
from pellucid.joint.study.solve_joint import machine_of
from pellucid.models.estimates import Parameter
from pellucid.numerics.motion import Motion
from pellucid.numerics.regression import Solution
from pellucid.study.datasets.init import init
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import ResultRow
from pellucid.study.study import Study
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

from ._foreign_joint import ForeignJoint, drawn_joint, recorded, written
from ._foreign_plants import drawn_plants, record_plant
from .coverage import CLEAN_COUNT, NORMAL_QUANTILE_97_5, clean_rows

PLANT_COUNT = sized(30, smallest=2)
"""Number of joints that MuJoCo and Pinocchio simulate."""

PLAIN_COUNT = sized(35, smallest=1)
"""Number of joints of the plain integrator with dry friction, and number of those with LuGre's."""

SEED = 20261203
"""Seed that draws the joints."""

DATA_SETS = sized(("emps", "sydney_pendulum", "bam_xl330", "bam_servo"), smallest=("bam_servo",))
"""Public data sets of one joint."""

COVERED_PARAMETERS = ("inertia", "gravity", "coulomb", "viscous")
"""First words of the parameters whose coverage and width are measured."""


@dataclass(frozen=True)
class Judged:
    """The headline of one study compared with all computed models on held-out recordings."""

    effort_ratio: float  # its error of the effort over the smallest one
    simulation_ratio: float  # its error of the simulated position over that of least squares of its family
    parameters: tuple[Parameter, ...]
    words: str


def headline_rows(plants: int = PLANT_COUNT, plain: int = PLAIN_COUNT, clean: int = CLEAN_COUNT) -> Iterator[ResultRow]:
    """Every figure."""
    yield from public_rows()
    yield from simulated_rows(plants, plain)
    for row in clean_rows(clean):
        if row.id == "coverage.clean.width_over_exact":
            yield replace(row, id="identification.clean.width_over_exact")


def _row(name: str, value: float, unit: str, note: str, split: str) -> ResultRow:
    return ResultRow(f"identification.{name}", float(value), unit, "evidence", split, None, note)


# --- public data sets -----------------------------------------------------------------------------------------------


def public_rows() -> Iterator[ResultRow]:
    """Held-out errors of the headline over those of the best model, and of least squares in simulation."""
    by_effort = {name: public_headline(name, "torque") for name in DATA_SETS}
    ratios = {name: each.effort_ratio for name, each in by_effort.items()}
    said = ", ".join(f"{name} {ratio:.3f} ({by_effort[name].words})" for name, ratio in ratios.items())
    note = f"held-out error of the effort over the best of all computed models; {said}"
    yield _row("headline.effort.median_over_best", np.median(list(ratios.values())), "1", note, "heldout")
    yield _row("headline.effort.worst_over_best", max(ratios.values()), "1", note, "heldout")
    by_motion = {name: public_headline(name, "simulation") for name in DATA_SETS}
    said = ", ".join(f"{name} {each.simulation_ratio:.3f} ({each.words})" for name, each in by_motion.items())
    note = f"held-out error of free simulation over that by least squares of the same family; {said}"
    worst = max(each.simulation_ratio for each in by_motion.values())
    yield _row("headline.simulation.over_least_squares.worst", worst, "1", note, "heldout")


def public_headline(name: str, purpose: str) -> Judged:
    """Return the headline of a public data set for a purpose."""
    with tempfile.TemporaryDirectory() as folder:
        path = init(Path(folder) / "study", name).folder / "study.toml"
        text = path.read_text(encoding="utf-8").replace('purpose = "torque"', "")
        path.write_text(text.replace("[model]", f'[model]\npurpose = "{purpose}"', 1), encoding="utf-8")
        study = open_study(path.parent)
        return judged(study, pl.identify(study))


def judged(study: Study, found: JointResult) -> Judged:
    """Compare the headline of an identified study with all computed models."""
    head = found.headlined.estimate
    held = [found.choice.direction.apply(m) for m in aligned_motions(study) if m.split == "heldout"]
    every = [e for fit in found.families.values() for e in (fit.estimate, *fit.others.values())]
    least = min(_effort_error(e, held) for e in every)
    simulated = _simulation_error(head, held, study)
    plain = _simulation_error(found.families[found.best].estimate, held, study)
    words = f"{found.best} by {head.method}"
    return Judged(_effort_error(head, held) / least, simulated / plain, head.parameters, words)


def _effort_error(estimate: JointEstimate, held: Sequence[Motion]) -> float:
    return pool_errors(predict(estimate.model, estimate.array, held, 1.0), "heldout")[0]


def _simulation_error(estimate: JointEstimate, held: Sequence[Motion], study: Study) -> float:
    """Return the RMS error of the position in free simulation over the horizon [rad or m]."""
    nothing = np.zeros((0, len(estimate.array)))
    solution = Solution(estimate.array, nothing, nothing[:, 0], nothing[:, 0], np.zeros(0, bool), 1, True)
    solved, machine = SolvedMethod(estimate.model, solution), machine_of(study.rig)
    errors = [simulated_errors(solved, {}, m, np.zeros(len(m.moving), int), machine) for m in held]
    return float(np.sqrt(np.mean(np.square(np.concatenate(errors)))))


# --- simulated joints -----------------------------------------------------------------------------------------------


def simulated_rows(plants: int, plain: int) -> Iterator[ResultRow]:
    """Yield coverage and width of intervals, and the error of the headline relative to the best model."""
    if missing := [module for module in ("mujoco", "pinocchio") if find_spec(module) is None]:
        print(f"identification.headline: joints of other programs skipped, found no {' and no '.join(missing)}")
        plants = 0
    joints, jobs = drawn_joints(plants, plain)
    found = ordered_results(jobs)
    said = f"{len(joints)} joints: {plants} of MuJoCo and Pinocchio, {plain} with dry friction, {plain} with LuGre's"
    lowest = 100.0
    for name in COVERED_PARAMETERS:
        error, half, refused = [], [], 0
        for joint, each in zip(joints, found, strict=True):
            true = getattr(joint, name)
            own = [p for p in each.parameters if p.name.partition("_")[0] == name and p.name != "gravity_cosine"]
            read = [p for p in own if p.trusted and not p.at_bound]
            refused += len(own) - len(read)
            error += [abs(p.value / true - 1.0) for p in read]
            half += [NORMAL_QUANTILE_97_5 * p.standard_error / true for p in read]
        covered = 100.0 * float(np.mean(np.less_equal(error, half)))
        lowest = min(lowest, covered)
        note = f"{len(error)} intervals, {refused} refused; median error {100.0 * np.median(error):.2g} %; {said}"
        yield _row(f"foreign.{name}.coverage", covered, "%", note, "simulated")
        width = float(np.median(half) / np.median(error))
        yield _row(f"foreign.{name}.width_over_error", width, "1", f"medians; {note}", "simulated")
    yield _row("foreign.coverage.lowest", lowest, "%", f"of {', '.join(COVERED_PARAMETERS)}; {said}", "simulated")
    excess = [100.0 * (each.effort_ratio - 1.0) for each in found]
    note = f"held-out error of the effort above the best of all computed models, at most {max(excess):.3g} %; {said}"
    yield _row("headline.simulated_joints", len(found), "1", said, "simulated")
    yield _row("headline.simulated_joints.mean_excess", np.mean(excess), "%", note, "simulated")


Job = tuple


def drawn_joints(plants: int, plain: int, seed: int = SEED) -> tuple[list[ForeignJoint], list[Job]]:
    """Return joints, and a job for each that identifies it."""
    rng = np.random.default_rng(seed)
    engines = drawn_plants(rng, plants)
    jobs: list[Job] = [(plant_headline, engine, joint, seed + i) for i, (engine, joint) in enumerate(engines)]
    dry = [drawn_joint(rng) for _ in range(plain)]
    bent = [drawn_joint(rng) for _ in range(plain)]
    bent = [replace(joint, bristle=joint.coulomb * float(rng.uniform(200.0, 1000.0))) for joint in bent]
    own = [*dry, *bent]
    first, second = recorded(own, rng), recorded(own, rng)
    jobs += [(table_headline, *tables) for tables in zip(first, second, strict=True)]
    return [*(joint for _, joint in engines), *own], jobs


def plant_headline(engine: str, joint: ForeignJoint, seed: int) -> Judged:
    """Return the headline of a plant that is recorded twice."""
    tables = [record_plant(engine, joint, np.random.default_rng([seed, i])) for i in range(2)]
    return table_headline(*tables)


def table_headline(fitted: np.ndarray, held: np.ndarray) -> Judged:
    """Return the headline of two recordings, (n, 3) each, of which the second is held out."""
    with tempfile.TemporaryDirectory() as folder:
        study = written(Path(folder) / "study", {"a": ("fit", fitted), "b": ("validate", held)})
        return judged(study, pl.identify(study))
