"""Coverage of intervals on virtual elbows and benches richer than any model, and comparison with the bootstrap on real
data.

120 elbows are drawn from the ranges of the rig's own file, each recorded with two noises while it follows constant
velocities and the swept sine, and identified as one coherent body with friction by load. On every one are a gap, a
spring, ripple, viscosity that declines, friction that falls from rest and changes along the travel, and a load's share
that grows towards rest; the model has none of these. Targets are the rig's, not what an estimator tends to:

- inertia: of forearm and carriage and rotor about the axis, the carriage's marker at the axis, as in the model;
- gravity: of the torque's part in sin q, there too;
- load friction: the share of the load that is lost at steady speed, averaged over the time that the joint moves while
  the motor drives (or is driven by) the load: `load_motoring` (or `load_generating`) of the rig times 1 + `load_rise`
  exp(-(v/v_s)^2) at each sample's speed. A joint has one such share at each speed; over the protocol it has this mean.

40 benches are drawn with every constant of the joint within half of that of the rig's own file, every other one with
ripple, and identified as their studies ask, by the best of five families. No known weight is attached to them:
targets are the rig's inertia, gravity in sin q, and the mean of the shares of the load lost in lifting and lowering.

Joints that other programs simulate (`_foreign_plants.py`: MuJoCo's hinge and tendon with its own friction, Pinocchio's
arm with a LuGre bristle whose level grows with the load) are identified as a study does by default, but for the other
estimators. Counted are inertia, gravity, viscous, Coulomb and load friction of the family that is chosen. Load friction
is counted where that family has it. How narrow intervals are where the model holds: on joints with dry and viscous
friction (`_foreign_joint.py`), their half-width over that of exact least squares, which knows every sample of the true
motion, the noise of the torque sensor, and that there is nothing else. No estimator from an encoder can be narrower.

The method was chosen on elbows and benches drawn with other seeds (4242, 777; 7, 31), and on joints and plants of the
seeds 5 and 11. A refused interval counts as
refused and no more.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import pellucid as pl
from pellucid.joint.fit.unknown_payload import SteadyStates
from pellucid.joint.slider.markers import slider_geometry
from pellucid.joint.slider.slider_fit import FIRST_LOAD_COEFFICIENT, STEP_PROTOCOLS, SliderMotion, fit_coherent
from pellucid.joint.slider.study.recorded_slider import slider_motions
from pellucid.models.estimates import Parameter
from pellucid.models.friction_terms import is_friction
from pellucid.models.slider_joint import SliderJointModel
from pellucid.study.datasets.init import init
from pellucid.study.results import ResultRow
from pellucid_lab.bench.rig import BenchRig, bench_joint
from pellucid_lab.elbow.protocol import trials
from pellucid_lab.elbow.rig import ElbowRig, able_elbow, drawn_rigs
from pellucid_lab.processes import ordered_results
from pellucid_lab.study import record_in_memory, write_study
from research.benchmarks._size import sized

from ._foreign_joint import ForeignJoint, drawn_joint, recorded, written
from ._foreign_plants import drawn_plants, record_plant

RIG_COUNT = sized(120, smallest=1)
"""Number of drawn elbows."""

SEEDS = sized((1, 2), smallest=(1,))
"""Seeds of the noise with which each elbow is recorded."""

BENCH_COUNT = sized(40, smallest=1)
"""Number of drawn benches."""

BENCH_SEED = 20261121
"""Seed that draws the benches."""

FOREIGN_COUNT = sized(60, smallest=2)
"""Number of joints that other programs simulate."""

FOREIGN_SEED = 20261127
"""Seed that draws them."""

CLEAN_COUNT = sized(20, smallest=2)
"""Number of joints with dry and viscous friction alone."""

CLEAN_SEED = 20261128
"""Seed that draws them."""

DATA_SETS = sized(("emps", "sydney_pendulum", "bam_xl330", "modexo_joint"), smallest=("sydney_pendulum",))
"""Public data sets whose recordings are identified one by one."""

NORMAL_QUANTILE_97_5 = 1.959964
"""Normal quantile of 97.5 %: an interval of 95 % reaches this many standard errors to either side."""

POOLED_PARAMETERS = {
    "inertia": ("inertia",),
    "gravity": ("gravity",),
    "load_friction": ("load_motoring", "load_generating"),
}
"""Parameters whose coverage is counted together, by the name of the row."""

FOREIGN_PARAMETERS = ("inertia", "gravity", "viscous", "coulomb", "load")
"""First words of the names of parameters whose coverage is counted on foreign plants; targets have these names."""

Pairs = list[tuple[Parameter, float]]
"""Parameters, each with its target."""


@dataclass(frozen=True)
class Elbow:
    """One identification of a simulated elbow: parameters, their targets, and what would be compensated."""

    parameters: dict[str, Parameter]
    targets: dict[str, float]
    exceeds: bool  # Whether what is carried exceeds the true friction somewhere
    carried: float  # Mean share of the true friction that is carried


def rows(
    rigs: int = RIG_COUNT,
    benches: int = BENCH_COUNT,
    data_sets: tuple[str, ...] = DATA_SETS,
    foreign: int = FOREIGN_COUNT,
    clean: int = CLEAN_COUNT,
) -> Iterator[ResultRow]:
    """Every figure."""
    yield from foreign_rows(foreign)
    yield from clean_rows(clean)
    jobs = [(identified, rig, seed) for rig in drawn_rigs(able_elbow(), rigs) for seed in SEEDS]
    yield from elbow_rows(ordered_results(jobs))
    jobs = [(bench_identified, rig, i + 1) for i, rig in enumerate(drawn_benches(benches))]
    yield from bench_rows(ordered_results(jobs))
    yield from real_rows(data_sets)


def _row(name: str, value: float, unit: str, note: str, split: str = "simulated") -> ResultRow:
    return ResultRow(name, float(value), unit, "evidence", split, None, note)


# --- drawn elbows ---------------------------------------------------------------------------------------------------


def identified(rig: ElbowRig, seed: int) -> Elbow:
    """Record a rig and identify it, in memory."""
    made = tuple(t for t in trials(rig) if t.protocol in STEP_PROTOCOLS and t.use == "fit")
    config, recordings, _ = record_in_memory(rig, made, seed=seed)
    motions = slider_motions(recordings, config, slider_geometry(recordings))
    slider, mass = config.rig.slider, config.rig.moving_mass
    rail = (slider.low, slider.high)
    plain = fit_coherent(SliderJointModel("consistent"), motions, rail=rail, mass=mass)
    model = SliderJointModel("load", {"carriage_mass": slider.mass})
    first = dict(zip(plain.model.names, plain.values, strict=True))
    start = np.array([first.get(n, FIRST_LOAD_COEFFICIENT) for n in model.names])
    found = fit_coherent(model, motions, rail=rail, mass=mass, start=start)
    parameters = {p.name: p for p in found.parameters}
    exceeds, share = compensated(rig, motions, parameters)
    return Elbow(parameters, targets(rig, motions), exceeds, share)


def _moving(rig: ElbowRig, motions: tuple[SliderMotion, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and load of every sample in which the joint moves, (n,) [rad/s], [N*m]."""
    loads = []
    for m in motions:
        sine, cosine = rig.gravity(m.slider)
        load = rig.inertia(m.slider) * m.acceleration + sine * np.sin(m.position) + cosine * np.cos(m.position)
        loads.append(load[m.scored])
    return np.concatenate([m.velocity[m.scored] for m in motions]), np.concatenate(loads)


def targets(rig: ElbowRig, motions: tuple[SliderMotion, ...]) -> dict[str, float]:
    """What the parameters should be, SI."""
    transmission = rig["transmission"]
    velocity, load = _moving(rig, motions)
    rise = 1.0 + transmission["load_rise"] * np.exp(-((velocity / transmission["stribeck_velocity"]) ** 2))
    driven = velocity * load > 0.0
    return {
        "inertia": rig.inertia(0.0),
        "gravity": rig.gravity(0.0)[0],
        "load_motoring": transmission["load_motoring"] * float(rise[driven].mean()),
        "load_generating": transmission["load_generating"] * float(rise[~driven].mean()),
    }


def compensated(
    rig: ElbowRig, motions: tuple[SliderMotion, ...], parameters: dict[str, Parameter]
) -> tuple[bool, float]:
    """Whether what is carried exceeds the rig's friction anywhere in the range of speeds and loads; the mean share."""
    steady = SteadyStates.within(*_moving(rig, motions))
    names = [n for n in parameters if is_friction(n)]
    carried = steady.terms(names) @ np.array([parameters[n].carried for n in names])
    true = np.abs(rig.friction(steady.velocity, steady.load))
    return bool(np.any(carried > true)), float(np.mean(carried / true))


def elbow_rows(found: list[Elbow]) -> Iterator[ResultRow]:
    """Coverage, width and refusals of each quantity, the worst of them, and what would be deployed."""
    said = f"{len(found)} identifications of simulated elbows with unmodelled physics"
    pairs = {
        name: [(e.parameters[n], e.targets[n]) for e in found for n in members]
        for name, members in POOLED_PARAMETERS.items()
    }
    yield from _coverage_rows(pairs, "coverage.misspecified", "coverage.width_over_rmse", said)
    words = "compensated friction above the true one somewhere in the range of speeds and loads"
    yield _row("deployed.exceeds_truth", 100.0 * float(np.mean([e.exceeds for e in found])), "%", f"{words}; {said}")
    share = 100.0 * float(np.median([e.carried for e in found]))
    yield _row("deployed.compensated_share", share, "%", f"of the true friction, mean over the range, median; {said}")


def _coverage_rows(pairs: dict[str, Pairs], head: str, wide: str, said: str) -> Iterator[ResultRow]:
    """Yield coverage, share not identifiable and width of each quantity's intervals, and the worst of all."""
    worst: dict[str, list[float]] = {"held": [], "statistical": [], "width": [], "refused": []}
    for name, every in pairs.items():
        read = [(p, t) for p, t in every if p.trusted]
        error = np.array([(p.value - t) / abs(t) for p, t in read])
        half, plain = (
            NORMAL_QUANTILE_97_5 * np.array([e / abs(t) for e, (_, t) in zip(errors, read, strict=True)])
            for errors in ([p.standard_error for p, _ in read], [p.statistical_error for p, _ in read])
        )
        rmse = float(np.sqrt(np.mean(error**2)))
        figures = {
            "held": 100.0 * float(np.mean(np.abs(error) <= half)),
            "statistical": 100.0 * float(np.mean(np.abs(error) <= plain)),
            "width": float(np.median(half)) / rmse,
            "refused": 100.0 * (1.0 - len(read) / len(every)),
        }
        for key, value in figures.items():
            worst[key].append(value)
        own = f"{head}.{name}"
        yield _row(own, figures["held"], "%", f"coverage of the target by 95 % intervals; {said}")
        yield _row(f"{own}.statistical", figures["statistical"], "%", f"of coloured residuals alone; {said}")
        yield _row(f"{own}.refused", figures["refused"], "%", f"intervals refused in words; {said}")
        yield _row(f"{own}.bias", 100.0 * float(np.mean(error)), "%", f"mean error of the estimate; {said}")
        yield _row(f"{own}.rmse", 100.0 * rmse, "%", f"root mean square error of the estimate; {said}")
        yield _row(f"{wide}.{name}", figures["width"], "1", f"median half-width; {said}")
    yield _row(f"{head}.lowest", min(worst["held"]), "%", f"of {', '.join(pairs)}; {said}")
    yield _row(f"{head}.statistical.lowest", min(worst["statistical"]), "%", "coloured residuals alone")
    yield _row(f"{wide}.highest", max(worst["width"]), "1", "median half-width over the error of the rigs")
    yield _row(f"{head}.refused.highest", max(worst["refused"]), "%", "refused, not printed")


# --- drawn benches --------------------------------------------------------------------------------------------------


def drawn_benches(count: int, seed: int = BENCH_SEED) -> list[BenchRig]:
    """Benches with every constant of the joint, the ripple and the noise of the current between half and one and a half
    times the rig's own; every other one without ripple."""
    rng, rig, made = np.random.default_rng(seed), bench_joint(), []
    for i in range(count):
        paths = [("joint", name) for name, value in rig["joint"].items() if value]
        paths += [("drive", "ripple_amplitude"), ("drive", "current_noise")]
        values = {f"{table}.{name}": rig[table][name] * float(rng.uniform(0.5, 1.5)) for table, name in paths}
        made.append(rig.changed(values | ({"drive.ripple_amplitude": 0.0} if i % 2 else {}), f"bench-{i + 1}"))
    return made


def bench_targets(rig: BenchRig) -> dict[str, float]:
    """What the parameters of a bench should be, SI."""
    joint = rig["joint"]
    shares = joint["load_motoring"], joint["load_generating"]
    return {"inertia": joint["inertia"], "gravity": joint["gravity_sine"], "load_friction": 0.5 * sum(shares)}


def bench_identified(rig: BenchRig, seed: int) -> dict[str, tuple[Parameter, float]]:
    """Parameters of a bench's best family, as its study is identified, each with its target."""
    with tempfile.TemporaryDirectory() as folder:
        study = write_study(Path(folder) / "study", rig, name=rig.name, seed=seed, threads=1)
        result = pl.identify(study, thorough=False)
    found = {p.name: p for p in result.families[result.best].estimate.parameters}
    return {name: (found[name], target) for name, target in bench_targets(rig).items() if name in found}


def bench_rows(found: list[dict[str, tuple[Parameter, float]]]) -> Iterator[ResultRow]:
    """Coverage, width and refusals; a quantity that the best family lacks is not counted."""
    said = f"{len(found)} drawn benches, the best of five families"
    pairs = {name: [one[name] for one in found if name in one] for name in POOLED_PARAMETERS}
    yield from _coverage_rows(pairs, "coverage.bench", "coverage.bench.width_over_rmse", said)


# --- plants of other programs ----------------------------------------------------------------------------------------


def foreign_rows(count: int) -> Iterator[ResultRow]:
    """Coverage, width and refusals on joints that MuJoCo and Pinocchio simulate; nothing where one is not installed."""
    missing = [module for module in ("mujoco", "pinocchio") if find_spec(module) is None]
    if missing:
        print(f"coverage.foreign: not measured, found no {' and no '.join(missing)}")
        return
    rng = np.random.default_rng(FOREIGN_SEED)
    plants = drawn_plants(rng, count)
    jobs = [(foreign_identified, engine, joint, FOREIGN_SEED + i) for i, (engine, joint) in enumerate(plants)]
    found = ordered_results(jobs)
    pairs = {
        name: [pair for one in found for pair in one if _first_word(pair[0]) == name] for name in FOREIGN_PARAMETERS
    }
    said = f"{count} joints of MuJoCo and Pinocchio, the best of five families"
    read = {name: pairs[name] for name in pairs if any(p.trusted for p, _ in pairs[name])}
    yield from _coverage_rows(read, "coverage.foreign", "coverage.foreign.width_over_rmse", said)


def _first_word(parameter: Parameter) -> str:
    return parameter.name.partition("_")[0]


def foreign_identified(engine: str, joint: ForeignJoint, seed: int) -> Pairs:
    """Return the parameters of the best family of a plant's recording, each with its target."""
    return identified_pairs(joint, record_plant(engine, joint, np.random.default_rng(seed)))


def identified_pairs(joint: ForeignJoint, table: np.ndarray) -> Pairs:
    """Return the parameters of the best family of a recording, (n, 3), each with its target."""
    with tempfile.TemporaryDirectory() as folder:
        result = pl.identify(written(Path(folder) / "study", {"a": ("fit", table)}), thorough=False)
    # A load coefficient on its bound says that there is none, and has no interval.
    found = [p for p in result.families[result.best].estimate.parameters if not p.at_bound]
    return [(p, float(getattr(joint, _first_word(p)))) for p in found if _first_word(p) in FOREIGN_PARAMETERS]


def clean_rows(count: int) -> Iterator[ResultRow]:
    """Half-widths over those of exact least squares where the model holds, of each parameter, and the largest."""
    rng = np.random.default_rng(CLEAN_SEED)
    joints = [drawn_joint(rng) for _ in range(count)]
    bare = [replace(joint, position_noise=0.0, torque_noise=0.0) for joint in joints]
    seed = int(rng.integers(2**31))
    tables, motions = (recorded(every, np.random.default_rng(seed)) for every in (joints, bare))
    found = ordered_results([(identified_pairs, *pair) for pair in zip(joints, tables, strict=True)])
    ratios: dict[str, list[float]] = {name: [] for name in EXACT_PARAMETERS}
    held: dict[str, list[bool]] = {name: [] for name in EXACT_PARAMETERS}
    off: dict[str, list[float]] = {name: [] for name in EXACT_PARAMETERS}
    for joint, motion, pairs in zip(joints, motions, found, strict=True):
        exact = exact_errors(joint, motion)
        for p, target in pairs:
            if p.name in exact and p.trusted:
                ratios[p.name].append(p.standard_error / exact[p.name])
                off[p.name].append((p.value - target) / exact[p.name])
                held[p.name].append(abs(p.value - target) <= NORMAL_QUANTILE_97_5 * p.standard_error)
    said = f"{count} joints with dry and viscous friction, in noise of encoder and torque sensor"
    medians = {name: float(np.median(every)) for name, every in ratios.items() if every}
    for name, value in medians.items():
        yield _row(f"coverage.clean.width_over_exact.{name}", value, "1", f"median half-width; {said}")
        wrong = float(np.sqrt(np.mean(np.square(off[name]))))
        yield _row(f"coverage.clean.error_over_exact.{name}", wrong, "1", f"RMS error over its standard error; {said}")
        yield _row(f"coverage.clean.{name}", 100.0 * float(np.mean(held[name])), "%", f"intervals that hold; {said}")
    yield _row(
        "coverage.clean.width_over_exact", max(medians.values()), "1", f"largest of {', '.join(medians)}; {said}"
    )


EXACT_PARAMETERS = ("inertia", "gravity", "viscous", "coulomb")
"""Parameters of exact least squares; an offset is estimated with them."""


def exact_errors(joint: ForeignJoint, motion: np.ndarray) -> dict[str, float]:
    """Return the standard errors of least squares that knows the true `motion`, (n, 3), and the torque's noise."""
    time, q, _ = motion.T
    v = np.gradient(q, time)
    # Samples at the ends and within the study's dead band are left out here too.
    used = np.abs(v) > 0.05
    used[:100] = used[-100:] = False
    columns = np.column_stack([np.gradient(v, time), np.sin(q), v, np.sign(v), np.ones_like(q)])[used]
    noise = joint.torque_noise * max(joint.coulomb, 0.1 * joint.gravity)
    return dict(zip(EXACT_PARAMETERS, noise * np.sqrt(np.diag(np.linalg.inv(columns.T @ columns))), strict=False))


# --- real recordings ------------------------------------------------------------------------------------------------


def real_rows(names: tuple[str, ...]) -> Iterator[ResultRow]:
    """Half-widths over those of a moving-block bootstrap, of each data set and of all."""
    statistical: list[float] = []
    for name in names:
        ratios, full = bootstrap_ratios(name)
        statistical += ratios
        note = f"{len(ratios)} parameters off their bounds; blocks of ten correlation times, 2,000 draws"
        for end, of in (("lowest", min), ("highest", max)):
            yield _row(f"interval.statistical_over_bootstrap.{name}.{end}", of(ratios), "1", note, "fitted")
            yield _row(f"interval.full_over_bootstrap.{name}.{end}", of(full), "1", f"with misfit; {note}", "fitted")
    for end, of in (("lowest", min), ("highest", max)):
        note = f"over {', '.join(names)}; statistical part"
        yield _row(f"interval.statistical_over_bootstrap.{end}", of(statistical), "1", note, "fitted")


def bootstrap_ratios(name: str) -> tuple[list[float], list[float]]:
    """Statistical and full half-widths of a data set's chosen models over a moving-block bootstrap's."""
    with tempfile.TemporaryDirectory() as folder:
        result = pl.identify(init(Path(folder) / name, name), thorough=False)
    fits = [result.families[result.best].estimate] if hasattr(result, "families") else result.fits.values()
    statistical, full = [], []
    for p in (p for fit in fits for p in fit.parameters if not p.at_bound and p.bootstrap is not None):
        half = 0.5 * (p.bootstrap[1] - p.bootstrap[0])
        if half > 0.0:
            statistical.append(NORMAL_QUANTILE_97_5 * p.statistical_error / half)
            full.append(NORMAL_QUANTILE_97_5 * p.standard_error / half)
    return statistical, full
