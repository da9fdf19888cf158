"""The whole arm: identification, excitation, wearing and deployment on virtual arms, compared with tools that labs use.

The arms are those of the rig `able-arm`: cables with load friction that differs by direction, springs and gaps,
Stribeck friction, ripple, misaligned axes, drives and encoders with noise and delay. The identification knows none
of these effects and uses a drawing whose bodies weigh 12 % too little. Plant and model share the equations of
rigid bodies, and of friction those that a family has. Torques are validated on held-out motion of recorded people
in a robot of this kind, followed by the arm's own loops. Without these recordings, generated reaching replaces them,
and rows state this.

Gravity's error is the largest one over 500 postures within the stops, over the largest torque. Lifting and
lowering lose different shares of the load. Like a wrong gain, this is a factor on the torque of a joint; a weighed
payload of 1.5 kg identifies it. Results with stated gains are reported for comparison.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pellucid.arm.fit.fit_tree import fit_tree, heldout_errors
from pellucid.arm.fit.tree_estimate import TreeEstimate
from pellucid.arm.protocols.tree_fourier import optimised_tree_fourier, random_tree_fourier, shrink_within_limits
from pellucid.arm.study.tree_excitation import tree_information
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.tree_stability import (
    DRAWN_LIMBS,
    LinearShares,
    TreeCoupling,
    gravity_slope,
    linear_law,
)
from pellucid.numerics.protocols.step_by_step import step_by_step
from pellucid.study.results import ResultRow
from pellucid_lab.arm.card_law import card_of, identified, motions_of, sensor_points
from pellucid_lab.arm.free_shoulder import compare_shoulders
from pellucid_lab.arm.human_motion import JOINTS
from pellucid_lab.arm.protocol import ArmTrial, limits_of
from pellucid_lab.arm.rig import ArmRig, able_arm, drawn_arms
from pellucid_lab.arm.single_faults import KINDS, ONSET_S, WATCH_S, ArmFaultTrial, fault_trials
from pellucid_lab.arm.tree_margins import at_joints, least_margins, margins_over, passivity
from pellucid_lab.arm.wearer import CUFF_CONSTANTS, HANDLE_AT, HANDLE_CUFF, UPPER_CUFF, UPPER_CUFF_AT, Person
from pellucid_lab.arm.worn_trial import motion_of
from pellucid_lab.papers.able.arm_identification import (
    LOAD_FRICTION_FAMILY,
    IdentifiedArm,
    directional_many,
    draw_test_motions,
    identified_many,
)
from pellucid_lab.papers.able.arm_worn import BEST_LAW, LAWS, PUBLISHED_LAW, arms_worn, wearers_of
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

from ._parts import run_parts

FAULTY = sized(4, smallest=1)
"""Drawn arms that have single faults: as many as joints, so that every fault is every joint's once."""
ARMS = sized(5, smallest=1)
"""Number of sampled arms in addition to the rig itself."""
SEEDS = sized(3, smallest=1)
"""Seeds with which the rig itself is recorded."""
JOINT_COUNTS = sized((1, 2, 3, 4), smallest=(1, 2))
"""Numbers of joints that move where sets by directions are compared with one body."""
FUNDAMENTAL, HARMONICS, PERIODS = 0.1, 5, 4  # of the motions compared
RANDOM = sized(3, smallest=1)  # random motions that an optimised one is compared with
SHORTER = {"angles": 10, "hold": 1.0, "velocities": 5, "slow": 2, "sweep": 25.0}  # than published: holds tell gravity


def rows(arms: int = ARMS, seeds: int = SEEDS) -> Iterator[ResultRow]:
    """Every figure."""
    rig = able_arm()
    drawn = drawn_arms(rig, arms)
    found = identified_many([*((rig, s) for s in range(1, seeds + 1)), *((one, 1) for one in drawn)])
    places = [(rig, 1, n) for n in JOINT_COUNTS]
    yield from run_parts("arm", {
        "identified arms": lambda: identified_rows(found),
        "directional arms": lambda: directional_rows(dict(zip(JOINT_COUNTS, directional_many(places), strict=True))),
        "excitations": lambda: excitation_rows(rig),
        "margins": lambda: margin_rows(found[0].best),
        "worn arms": lambda: worn_rows(drawn),
        "faults": lambda: fault_rows(drawn[:FAULTY]),
        "shoulder": lambda: shoulder_rows(rig),
        "speeds": speed_rows,
    })  # fmt: skip


def row(name: str, value: float | None, unit: str, note: str, split: str = "simulated") -> ResultRow:
    """Return a result row of the arm."""
    return ResultRow(f"arm.{name}", None if value is None else float(value), unit, "evidence", split, None, note)


# --- identified -----------------------------------------------------------------------------------------------------


def identified_rows(found: Sequence[IdentifiedArm]) -> Iterator[ResultRow]:
    """Gravity, bodies that can exist, and torque of each joint on people's motion."""
    of_rig = [f for f in found if f.rig == found[0].rig]
    said = f"{len(found)} identifications: the rig with {len(of_rig)} seeds, the others drawn"
    gravity = [f.gravity["consistent"] for f in found]
    yield row("gravity_error", np.median(gravity), "%", f"median over postures' largest; known payload; {said}")
    yield row("gravity_error.worst", np.max(gravity), "%", said)
    yield row("gravity_error.rig", np.max([f.gravity["consistent"] for f in of_rig]), "%", "the rig's worst seed")
    stated = [f.gravity["load_stated_gains"] for f in found]
    yield row(
        "gravity_error.stated_gains", np.median(stated), "%", f"no payload: a joint's gain is taken as stated; {said}"
    )
    yield row("gravity_error.stated_gains.worst", np.max(stated), "%", said)
    plain = [f.gravity["plain"] for f in found]
    yield row("gravity_error.plain", np.median(plain), "%", f"no load friction, no payload (reference); {said}")
    share = 100.0 * np.mean([f.least_eigenvalue >= 0.0 for f in found])
    yield row("consistent", share, "%", f"every link's pseudo-inertia at least 0; {said}")
    for name in ("plain", "load", "best", "consistent"):
        errors = np.array([f.errors[name] for f in found])
        words = (
            f"on motions of {found[0].judged}, never fitted; {found[0].parameters[name]} parameters on the rig; {said}"
        )
        for k, joint in enumerate(JOINTS):
            yield row(
                f"torque_error.{name}.joint_{k + 1}", np.median(errors[:, k]), "%", f"{joint}; {words}", "heldout"
            )
        yield row(f"torque_error.{name}.mean", np.median(errors.mean(axis=1)), "%", words, "heldout")


def directional_rows(by_count: dict) -> Iterator[ResultRow]:
    """Yield errors of directional parameter sets and of one body, for each number of joints."""
    names = {
        "one body, load friction": "load", "one body, plain friction": "plain", "sets, own": "sets_own",
        "sets, one side": "sets_printed", "sets, all": "sets_errata",
    }  # fmt: skip
    for count, compared in by_count.items():
        for one in compared:
            head = f"directional.n{count}.{names[one.model]}"
            words = f"{one.model}, {count} joints move; the rig, on motions never fitted"
            yield row(f"{head}.parameters", one.parameters, "1", f"{one.sets} sets, {one.visited} visited; {words}")
            yield row(f"{head}.error", one.mean, "%", f"mean over joints; {words}", "heldout")
            for k, error in enumerate(one.error):
                yield row(f"{head}.error.joint_{len(JOINTS) - count + k + 1}", error, "%", words, "heldout")
            yield row(f"{head}.condition", one.condition, "1", f"median over sets; {words}")
            yield row(f"{head}.creates_energy", one.creates, "%", f"of 200 closed paths; {words}")


# --- excitation -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Asked:
    """A motion recorded on the virtual arm and what came of it."""

    duration: float  # s
    errors: np.ndarray  # standard errors of the parameters, by name in order
    names: tuple[str, ...]
    torque: float  # error on people's motion, mean over joints [%]


def asked(rig: ArmRig, name: str, seed: int) -> Asked:
    """One motion: optimised, random, or step by step."""
    limits, rate = limits_of(rig), rig["sampling"]["rate"]
    rng = np.random.default_rng([seed, 61])
    if name == "step_by_step":
        path = step_by_step(limits, rate, **SHORTER).position
    else:
        if name == "optimised":
            information = tree_information(rig.robot, limits)
            series = optimised_tree_fourier(
                information, limits, rng, fundamental=FUNDAMENTAL, harmonics=HARMONICS
            ).series
        else:
            series = shrink_within_limits(
                random_tree_fourier(limits, rng, fundamental=FUNDAMENTAL, harmonics=HARMONICS), limits
            )
        path = series.motion(np.arange(round(PERIODS * series.period * rate)) / rate)[0]
    trial = ArmTrial(name, name, "fit", reference=path, slider=rig["slider"]["clamped"])
    fitted = motions_of(rig, [trial], seed)
    estimate = fit_tree(rig.robot, fitted, (LOAD_FRICTION_FAMILY,) * len(JOINTS), name=name)
    judged = motions_of(rig, draw_test_motions(rig, 1)[1], 1000 + seed)
    spread = np.sqrt(np.diag(estimate.covariance))
    return Asked(len(path) / rate, spread, tuple(estimate.parameters), float(heldout_errors(estimate, judged).mean()))


def excitation_rows(rig: ArmRig) -> Iterator[ResultRow]:
    """Yield interval widths of optimised motions, of random ones within the same limits, and of one joint after
    another.
    """
    jobs = [(asked, rig, "step_by_step", 1), (asked, rig, "optimised", 1), (asked, rig, "optimised", 2)]
    jobs += [(asked, rig, "random", 10 + i) for i in range(RANDOM)]
    steps, *others = ordered_results(jobs)
    best, random = others[:2], others[2:]

    def over(one: Asked, other: Asked) -> np.ndarray:
        """Ratios of standard errors where both are known."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = one.errors / other.errors
        return ratio[np.isfinite(ratio) & (ratio > 0.0)]

    said = f"virtual arm, load friction fitted, {best[0].duration:.0f} s, optimised with two seeds"
    ratios = [np.exp(np.mean(np.log(over(b, r)))) for b in best for r in random]
    words = f"geometric mean over parameters, median over {len(random)} random motions within the same limits; {said}"
    yield row("excitation.interval.over_random", np.median(ratios), "1", words)
    yield row(
        "excitation.interval.over_random.worst", np.max(ratios), "1", f"of each optimised and random motion; {said}"
    )
    yield row(
        "excitation.torque_error.optimised",
        np.mean([b.torque for b in best]),
        "%",
        f"people's motion; {said}",
        "heldout",
    )
    yield row(
        "excitation.torque_error.random",
        np.median([r.torque for r in random]),
        "%",
        f"people's motion; {said}",
        "heldout",
    )
    yield row("excitation.torque_error.step_by_step", steps.torque, "%",
              f"people's motion, {steps.duration:.0f} s, with shorter holds than published", "heldout")  # fmt: skip
    need = [b.duration * np.exp(2.0 * np.mean(np.log(over(b, steps)))) for b in best]
    yield row("excitation.seconds.step_by_step", steps.duration, "s", "one joint after the other, then pairs")
    yield row("excitation.seconds.same_interval", np.mean(need), "s",
              "of optimised motion for the intervals of step by step, in the geometric mean; they shrink as the root "
              "of time")  # fmt: skip


# --- margins --------------------------------------------------------------------------------------------------------

PERIOD, DRIVE = 1e-3, 1.0 / 0.0008  # s, rad/s: the rig's current loop
POSTURES = {
    "down": (0.1, 0.1, 0.0, 0.4),
    "forward": (0.4, 0.9, 0.2, 1.2),
    "up": (1.1, 1.2, 0.6, 1.9),
}  # rad
SHARES = {
    "full": LinearShares(1.0, 1.0),
    "transparent": LinearShares(1.0, 0.95, 0.4, bandwidth=50.0),
    "force_sensors": LinearShares(1.0, 0.8, proportional=2.0, lowpass=15.0, drift=0.1),
}  # as the laws that are worn
WIDTH = 0.05  # of the largest speed, over which a law's friction turns


def worn_about(estimate: TreeEstimate, person: Person, posture: Sequence[float]) -> TreeCoupling:
    """Return an identified robot and its wearer about a posture, with stiff cables."""
    import pellucid._core as core

    robot = core.KinematicTree(estimate.links(), np.array(estimate.robot.tree.gravity))
    q, limb = np.array(posture, float), person.tree.core
    column = {name: estimate.joints()[:, i] for i, name in enumerate(core.TREE_JOINT_PARAMETER_NAMES)}
    weight = np.abs(robot.gravity(q))
    load = 0.5 * (column["load_motoring"] + column["load_generating"]) * weight
    points = ((2, (0.0, 0.0, -UPPER_CUFF_AT * person.upper_arm), UPPER_CUFF),
              (3, (0.0, 0.0, -HANDLE_AT * person.forearm), HANDLE_CUFF))  # fmt: skip
    cuffs = [(link, at, CUFF_CONSTANTS[name]) for link, at, name in points]
    springs = [(link, at, (*cuff.stiffness, *(cuff.turning_stiffness,) * 3)) for link, at, cuff in cuffs]
    dampers = [(link, at, (*cuff.damping, *(cuff.turning_damping,) * 3)) for link, at, cuff in cuffs]
    return TreeCoupling(
        mass=robot.mass_matrix(q),
        viscous=0.5 * (column["viscous_positive"] + column["viscous_negative"]),
        slope=gravity_slope(robot, q),
        coulomb=0.5 * (column["coulomb_positive"] + column["coulomb_negative"]) + load,
        limb_mass=limb.mass_matrix(q) + 1e-4 * np.eye(len(q)),
        limb_viscous=np.full(len(q), 0.1),
        limb_slope=gravity_slope(limb, q),
        cuff_stiffness=at_joints(robot, q, springs),
        cuff_damping=at_joints(robot, q, dampers),
        drive_frequency=np.full(len(q), DRIVE),
        drive_damping=np.ones(len(q)),
        delay=PERIOD,
    )


def margin_rows(estimate: TreeEstimate) -> Iterator[ResultRow]:
    """Yield the smallest margins of each law over postures and limbs, joint by joint and together."""
    person = Person("wearer")
    couplings = {name: worn_about(estimate, person, at) for name, at in POSTURES.items()}
    width = WIDTH * np.array([2.0, 2.2, 3.5, 3.5])
    limbs = f"{len(DRAWN_LIMBS[::2])} limbs from limp to tense"
    said = f"linear, {len(couplings)} postures, {limbs}, at 0.5 rad/s; cables stiff"
    for law, shares in SHARES.items():
        controllers = {name: linear_law(one, shares, PERIOD, width=width, speed=0.5) for name, one in couplings.items()}
        found = list(margins_over(couplings, controllers, PERIOD, limbs=DRAWN_LIMBS[::2], speed=0.5))
        least = least_margins(found)
        yield row(f"stability.{law}.stable", 100.0 * np.mean([f.margins.stable for f in found]), "%", said)
        for k, joint in enumerate(JOINTS):
            yield row(f"stability.{law}.gain.joint_{k + 1}", _known(least.gain_db[k]), "dB", f"{joint}; least; {said}")
            yield row(
                f"stability.{law}.delay.joint_{k + 1}", _known(1e3 * least.delay[k]), "ms", f"{joint}; least; {said}"
            )
        yield row(f"stability.{law}.gain", _known(least.gain_together_db), "dB", f"all at once, least; {said}")
        yield row(f"stability.{law}.delay", _known(1e3 * least.delay_together), "ms", f"all at once, least; {said}")
        short = [passivity(couplings[name], controllers[name], PERIOD, speed=0.5) for name in couplings]
        yield row(f"stability.{law}.damping_needed", max(p.shortage for p in short), "N*m*s/rad",
                  "that a wearer must bring at each joint for any passive limb; 0: passive up to 50 Hz")  # fmt: skip
        yield row(f"stability.{law}.passive_below", _known(min(p.below for p in short)), "Hz", "none: up to 50 Hz")


def _known(value: float) -> float | None:
    """None beyond the search's end."""
    return float(value) if np.isfinite(value) else None


# --- worn -----------------------------------------------------------------------------------------------------------


FIGURES = {
    "interaction": ("N*m", "RMS of the cuffs' torque at the wearer's joints"),
    "error": ("rad", "RMS of how far the arm is off"),
    "work": ("J", "what the wearer does against the robot and is not given back"),
    "exchanged": ("J", "work to and fro"),
}


def worn_rows(arms: Sequence[ArmRig]) -> Iterator[ResultRow]:
    """What every law leaves to a wearer; ratios are of pairs, on one robot and person. Medians: interaction of a trial
    that was stopped is infinite."""
    made, motion = arms_worn(arms)
    said = f"{len(arms)} robots and people that no law was chosen on, {motion}"
    for law in LAWS:
        for figure, (unit, what) in FIGURES.items():
            yield _median(f"worn.{law}.{figure}", [getattr(one[law], figure) for one in made], unit, f"{what}; {said}")
        yield row(f"worn.{law}.faults", sum(one[law].faulted for one in made), "1", f"trials that were stopped; {said}")
        ratios = [one[law].interaction / one[PUBLISHED_LAW].interaction for one in made]
        yield _median(f"worn.{law}.over_fc", ratios, "1", f"interaction over that under full compensation; {said}")
    best = [one[BEST_LAW].interaction / one[PUBLISHED_LAW].interaction for one in made]
    yield _median("torque.best_over_fc", best, "1", f"{BEST_LAW} over full compensation; {said}")


def _median(name: str, values: Sequence[float], unit: str, note: str) -> ResultRow:
    """With the ends."""
    middle = float(np.median(values))
    said = f"median; {note}; {min(values):.3g} to {max(values):.3g}"
    return row(name, middle if np.isfinite(middle) else None, unit, said)


def faulted(rig: ArmRig, person: Person, first: int) -> dict[str, list[ArmFaultTrial]]:
    """Single faults on one robot and person under the published law and the best, joints in turn from the `first`."""
    card, motion, points = card_of(rig, identified(rig)), motion_of(person, rig, repetition=3), sensor_points(person)
    laws = {name: LAWS[name](card, instruments=Instruments(drive=True)) for name in (PUBLISHED_LAW, BEST_LAW)}
    felt = {PUBLISHED_LAW: None, BEST_LAW: points}
    return {name: list(fault_trials(rig, person, law, motion, felt[name], first=first)) for name, law in laws.items()}


def fault_rows(arms: Sequence[ArmRig]) -> Iterator[ResultRow]:
    """Single faults until the supervisor has stopped the arm, and after, when its weight is theirs."""
    wearers, motion = wearers_of(arms)
    jobs = [(faulted, rig, person, k) for k, (rig, person) in enumerate(zip(arms, wearers, strict=True))]
    made = ordered_results(jobs)
    said = f"{len(arms)} robots and people, {motion}; {WATCH_S:g} s from the onset, {ONSET_S:g} s after the start"
    every: list[ArmFaultTrial] = []
    for law in (PUBLISHED_LAW, BEST_LAW):
        trials = [trial for one in made for trial in one[law]]
        every += trials
        for fault, kind in KINDS.items():
            of = [trial for trial in trials if trial.fault == fault]
            if not of:
                continue
            found = [1e3 * t.found for t in of if np.isfinite(t.found)]
            when = f", at the latest after {max(found):.0f} ms" if found else ""
            words = f"{kind['sentence']}; found in {len(found)} of {len(of)}{when}; largest; {said}"
            head = f"single_fault.{law}.{fault}"
            yield row(
                f"{head}.excess",
                max(t.excess for t in of),
                "J",
                f"positive work on the limb beyond that without the fault; {words}",
            )
            yield row(
                f"{head}.peak",
                max(t.peak for t in of),
                "N*m",
                f"at one of the wearer's joints, {max(t.healthy_peak for t in of):.2g} without; {words}",
            )
    silent = [t for t in every if not np.isfinite(t.found)]
    yield row("single_fault.worst_excess", max(t.excess for t in every), "J", f"{len(every)} trials; {said}")
    yield row("single_fault.worst_peak", max(t.peak for t in every), "N*m", f"{len(every)} trials; {said}")
    yield row("single_fault.not_found.excess", max((t.excess for t in silent), default=0.0), "J",
              f"largest of {len(silent)} trials in which nothing was found; {said}")  # fmt: skip
    yield row("single_fault.early", sum(t.found < 0.0 for t in every), "1", f"stopped before there was a fault; {said}")


def shoulder_rows(rig: ArmRig) -> Iterator[ResultRow]:
    """The published laws of the elbow while the shoulder is held, free, or moved by its wearer."""
    for one in compare_shoulders(rig, Person("wearer")):
        head, words = f"shoulder.{one.law}.{one.shoulder}", f"{one.law} drives the elbow; shoulder {one.shoulder}"
        yield row(f"{head}.elbow_torque", one.elbow_interaction, "N*m", f"RMS at the wearer's elbow; {words}")
        yield row(f"{head}.elbow_error", np.degrees(one.elbow_error), "deg", f"RMS; {words}")
        yield row(f"{head}.shoulder_peak", np.degrees(one.shoulder_peak), "deg", f"largest way it was moved; {words}")


# --- speed ----------------------------------------------------------------------------------------------------------


def speed_rows() -> Iterator[ResultRow]:
    """Ratios to Pinocchio in one run, a control step of four joints, and the same step on a microcontroller."""
    from research.benchmarks import arm

    for name, value in arm.over_pinocchio().items():
        words = (
            "called from Python on 45,000 samples; bodies alike" if "once" not in name else "all samples in one call"
        )
        yield row(f"{name}.over_pinocchio", value, "1", words)
    steps = {one["name"].removeprefix(f"{arm.STEP_ROW}: ").removesuffix(", step"): one for one in arm.step_rows()}
    for name, one in steps.items():
        yield row(f"step.{name}", one["value"], "us", one["note"])
    yield row("step", max(one["value"] for one in steps.values()), "us", "the slowest of these laws")
    exported = arm.export_rows()
    for one in exported:
        law, _, figure = one["name"].removeprefix(f"{arm.EXPORT_ROW}: ").partition(", ")
        if figure != "wrong":
            yield row(f"export.{law}.instructions", one["value"], "1", one["note"])
    wrong = [one["value"] for one in exported if one["name"].endswith("wrong")]
    said = "steps that differ in any bit between PC and Cortex-M4F, of all laws" if wrong else "tools are missing"
    yield row("export.wrong_bits", sum(wrong) if wrong else None, "1", said)
