"""Detection and benefit of presliding friction on simulated benches, with LuGre, and on real machines.

20 benches are drawn with every constant of the joint between half and one and a half times the rig's own, and record
small slow reversals, three files of 20 s around two angles each, of which one is held out. Their travels are 0, 0.3, 1
and 3 mrad; the model that slips at once, and the load, come from the same files. Two kinds of plant:

- the bench's own, whose contacts are the ones that are then looked for: plant and model share their equations there,
  but for friction that rises towards rest, differs by direction and by load, cogging, and the instruments' noise;
- a joint that obeys LuGre, integrated here in plain NumPy. It has no travel. Its bristles, of the length
  l = F_c / sigma_0, come nearest in the sense of least squares, over a reversal from slip, to a travel of 1.39 l: this
  was fixed before anything was identified on it.

What counts as found, and the search, were settled on benches drawn with another seed (99). The error is the root mean
square over benches, one whose travel is not found counted as wrong by all of it.

On real recordings, families are fitted and validated as in their studies, with and without the travel, which is found
from the fitted ones alone: by the search that a study makes, and by simulating those recordings from their command. The
ModExo's public recordings hold no friction to look at: their torque is a number in its software, which renders an
inertia, a damper and a spring, and no family of friction simulates what was recorded at 20 Hz.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from math import pi
from pathlib import Path

import numpy as np

from pellucid import _core
from pellucid.joint.fit.friction_solver import solve_family
from pellucid.joint.fit.presliding import Presliding, estimate_presliding
from pellucid.joint.fit.replay import Machine, simulate_recording
from pellucid.joint.study.aligned_motions import align_recordings
from pellucid.joint.study.solve_joint import machine_of
from pellucid.models.joint import JointModel, joint_model
from pellucid.numerics.motion import Filtering, Motion, motion_of
from pellucid.numerics.protocols.excitation import reversals
from pellucid.numerics.regression import stack
from pellucid.study.datasets.init import init
from pellucid.study.recorded_motions import drive_model, motions_of
from pellucid.study.results import ResultRow
from pellucid_lab.bench.rig import REVERSAL_STROKES, BenchRig
from pellucid_lab.noise import draw_noise
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

from .coverage import drawn_benches

BENCH_COUNT = sized(20, smallest=1)
"""Number of drawn benches."""

BENCH_SEED = 20261122
"""Seed that draws the benches."""

PRESLIDING_TRAVELS_RAD = sized((0.0, 3e-4, 1e-3, 3e-3), smallest=(0.0, 1e-3))
"""Presliding travels of the simulated benches [rad]."""

TRAVEL_OVER_BRISTLE_LENGTH = 1.39
"""Presliding travel over the length of a LuGre bristle, with which both models agree best over a reversal from slip."""

FILE_COUNT = 3
"""Number of recordings of a bench; the last one is held out."""

RECORDING_DURATION_S = sized(20.0, smallest=10.0)
"""Duration of a recording [s]."""

SAMPLING_RATE_HZ = 1000.0
"""Sampling rate and control rate [Hz]."""

FILTERING = Filtering(20.0, 4, 25, 0.0, 100)
"""Filters of the identification."""

SUBSTEP_COUNT = 4
"""Number of simulation steps in a control period."""

DEAD_BAND_RAD_S = 0.02
"""Speed below which samples are excluded from the fit in slip alone [rad/s]."""

BAM_FAMILIES = sized(("symmetric", "directional", "load", "stribeck", "combined"), smallest=("symmetric", "load"))
"""Friction families that are tried on the recorded servo."""

BAM_TRAVELS_RAD = (0.0, *np.geomspace(1e-3, 8e-2, sized(14, smallest=2)))
"""Presliding travels that are tried on the recorded servo [rad]."""


def rows(benches: int = BENCH_COUNT) -> Iterator[ResultRow]:
    """Every figure."""
    drawn = drawn_benches(benches, BENCH_SEED)
    for lugre in (False, True):
        for travel in PRESLIDING_TRAVELS_RAD[1 if lugre else 0 :]:
            played = (lugre_joints if lugre else own_joints)(drawn, travel)
            found = ordered_results(
                [(identified, rig, *p, i) for i, (rig, p) in enumerate(zip(drawn, played, strict=True))]
            )
            yield from _travel_rows(found, travel, lugre) if travel else _slip_rows(found)
    yield from bam_rows()
    yield _row(
        "real.modexo.openloop.change", None, "%", "not evaluated: the torque is a number in its software", "heldout"
    )
    if find_spec(f"{__package__}._laws_below_slip") is not None:
        yield from import_module("._laws_below_slip", __package__).rows()


def _row(name: str, value: float | None, unit: str, note: str, split: str = "simulated") -> ResultRow:
    return ResultRow(f"friction.{name}", None if value is None else float(value), unit, "evidence", split, None, note)


# --- drawn benches --------------------------------------------------------------------------------------------------


Played = tuple[np.ndarray, np.ndarray]
"""Position [rad] and command [A] of a bench's files, each (files, n)."""


def references(rig: BenchRig, seed: int) -> np.ndarray:
    """The reversals that a bench is asked for, (files, n) [rad]."""
    rng = np.random.default_rng([BENCH_SEED, seed])
    low, high = rig["motion_range"]["low"], rig["motion_range"]["high"]
    angles = low + (high - low) * rng.uniform(0.15, 0.85, (FILE_COUNT, 2))
    strokes = {"duration": RECORDING_DURATION_S, "fs": SAMPLING_RATE_HZ, **REVERSAL_STROKES}
    return np.array([reversals(centres=each, **strokes) for each in angles])


def own_joints(rigs: Sequence[BenchRig], travel: float) -> list[Played]:
    """Benches as they are, with a `travel` [rad]."""
    made = []
    for i, rig in enumerate(rigs):
        drive, loop, asked = rig["drive"], rig["loop"], references(rig, i)
        position, _, _, command, *_ = _core.simulate_batch(
            np.tile(rig.vector, (FILE_COUNT, 1)), reference=asked, period=1.0 / SAMPLING_RATE_HZ,
            substeps=SUBSTEP_COUNT, gain=rig.gain, limit=drive["current_limit"],
            ripple_amplitude=drive["ripple_amplitude"], stiction=True,
            ripple_wave_number=drive["ripple_wave_number"], loop=loop["kind"], kp=loop["kp"], kv=loop["kv"],
            velocity_span=loop["velocity_span"], position0=asked[:, 0].copy(), presliding_travel=travel,
        )  # fmt: skip
        made.append((position, command))
    return made


def lugre_joints(rigs: Sequence[BenchRig], travel: float) -> list[Played]:
    """The same benches with LuGre's friction: z' = v - |v| z k / level, f = k z + d exp(-(v / 0.02)^2) z' + F_v v. The
    bristle's stiffness k is the Coulomb level over its length, its damping d a third of critical."""
    asked = np.array([references(rig, i) for i, rig in enumerate(rigs)])  # (rigs, files, n)
    joint, drive, loop = ({key: np.array([[rig[table][key]] for rig in rigs]) for key, _ in rigs[0][table].items()
                           if table != "loop" or key != "kind"} for table in ("joint", "drive", "loop"))  # fmt: skip
    gain, inertia = np.array([[rig.gain] for rig in rigs]), joint["inertia"]
    stiffness = 0.5 * (joint["coulomb_positive"] + joint["coulomb_negative"]) * TRAVEL_OVER_BRISTLE_LENGTH / travel
    damping, h = 2.0 / 3.0 * np.sqrt(stiffness * inertia), 1.0 / SAMPLING_RATE_HZ / SUBSTEP_COUNT
    span = int(loop["velocity_span"][0, 0])
    q, v, z = asked[..., 0].copy(), np.zeros(asked.shape[:2]), np.zeros(asked.shape[:2])
    past = [q] * (span + 1)
    positions, commands = np.empty_like(asked), np.empty_like(asked)
    for k in range(asked.shape[2]):
        past = [*past[1:], q]
        wanted = loop["kv"] * (loop["kp"] * (asked[..., k] - q) - (past[-1] - past[0]) * (SAMPLING_RATE_HZ / span))
        command = np.clip(wanted, -drive["current_limit"], drive["current_limit"])
        positions[..., k], commands[..., k] = q, command
        # Gravity and cogging hardly change within a period.
        weight = joint["gravity_sine"] * np.sin(q) + joint["gravity_cosine"] * np.cos(q)
        ripple = drive["ripple_amplitude"] * np.sin(drive["ripple_wave_number"] * q)
        free = gain * command + ripple - joint["offset"] - weight
        for _ in range(SUBSTEP_COUNT):
            up = v > 0.0
            level = np.where(up, joint["coulomb_positive"], joint["coulomb_negative"])
            level = level + joint["stribeck"] * np.exp(-np.square(v / joint["stribeck_velocity"]))
            alpha = np.where(weight * v > 0.0, joint["load_motoring"], joint["load_generating"])
            level = level + alpha * np.abs(weight)
            # Exact while v and the level stay: a fast joint runs through many lengths in a substep.
            end = np.sign(v) * level / stiffness
            after = end + (z - end) * np.exp(-np.abs(v) * h * stiffness / level)
            after = np.where(v == 0.0, z, after)
            bristle = damping * np.exp(-np.square(v / 0.02)) * (after - z) / h
            z = after
            slope = np.where(up, joint["viscous_positive"], joint["viscous_negative"])
            v = v + h / inertia * (free - stiffness * z - bristle - slope * v)
            q = q + h * v
    return list(zip(positions, commands, strict=True))


def identified(rig: BenchRig, positions: np.ndarray, commands: np.ndarray, seed: int) -> Presliding:
    """What a bench's files say of its travel, as its instruments write them; the last of them is held out."""
    rng, drive, encoder = np.random.default_rng([BENCH_SEED, seed, 1]), rig["drive"], rig["encoder"]
    quantum, time = 2.0 * pi / encoder["counts_per_turn"], np.arange(positions.shape[1]) / SAMPLING_RATE_HZ
    motions = []
    for i, (position, command) in enumerate(zip(positions, commands, strict=True)):
        read = np.round(position / quantum) * quantum + encoder["noise"] * rng.standard_normal(len(position))
        sensed = draw_noise(
            (1, len(time)), drive["current_noise"], drive["current_noise_memory"], SAMPLING_RATE_HZ, rng
        )[0]
        current = 0.5 * (command + np.concatenate([command[:1], command[:-1]])) + sensed
        split = "heldout" if i == FILE_COUNT - 1 else "fitted"
        motions.append(motion_of(time, read, rig.gain * current, FILTERING, split=split))
    fitted, held = motions[:-1], motions[-1:]
    model = joint_model("combined", motion="rotary", effort_unit="N*m", gravity="sine", velocity_range=1.0)
    slipping = stack([replace(m, filtering=replace(m.filtering, dead_band=DEAD_BAND_RAD_S)) for m in fitted])
    return estimate_presliding(model, solve_family(model, slipping).values, fitted, held)


def _travel_rows(found: Sequence[Presliding], travel: float, lugre: bool) -> Iterator[ResultRow]:
    said = f"{len(found)} drawn benches with {1e3 * travel:g} mrad"
    said += ", whose friction is LuGre's" if lugre else ", whose contacts are the model's"
    head = "presliding" + (".lugre" if lugre else "")
    end = "" if travel == 1e-3 else f".{1e3 * travel:g}mrad"
    measured = [f.travel for f in found if f.travel is not None]
    error = np.array([1.0 if f.travel is None else f.travel.value / travel - 1.0 for f in found])
    yield _row(f"{head}.travel_error{end}", 100.0 * np.sqrt(np.mean(error**2)), "%", f"root mean square; {said}")
    yield _row(f"{head}.travel_error.worst{end}", 100.0 * np.max(np.abs(error)), "%", said)
    yield _row(f"{head}.travel_bias{end}", 100.0 * np.mean(error), "%", said)
    yield _row(f"{head}.found{end}", 100.0 * len(measured) / len(found), "%", said)
    held = [abs(p.value - travel) <= 1.959964 * p.standard_error for p in measured]
    yield _row(f"{head}.coverage{end}", 100.0 * np.mean(held) if held else None, "%", f"95 % intervals; {said}")
    half = [1.959964 * p.standard_error / travel for p in measured]
    yield _row(f"{head}.half_width{end}", 100.0 * np.median(half) if half else None, "%", f"median; {said}")
    before, after = (np.sqrt(np.mean(np.square([getattr(f, n) for f in found]))) for n in ("slips", "gives"))
    words = f"held-out effort, slow samples too, against friction that slips at once; {said}"
    yield _row(f"{head}.effort_error_change{end}", 100.0 * (after / before - 1.0), "%", words)


def _slip_rows(found: Sequence[Presliding]) -> Iterator[ResultRow]:
    said = f"{len(found)} drawn benches that slip at once"
    yield _row("presliding.false_alarms", 100.0 * np.mean([f.travel is not None for f in found]), "%", said)
    bounds = [f.below for f in found if f.below is not None]
    yield _row("presliding.bounded", 100.0 * len(bounds) / len(found), "%", f"said to be below a bound; {said}")
    yield _row("presliding.bound", 1e3 * np.median(bounds) if bounds else None, "mrad", f"median; {said}")


# --- real recordings ------------------------------------------------------------------------------------------------


def bam_rows() -> Iterator[ResultRow]:
    """A servo's position from its duty, and its effort, on held-out recordings: with the travel and without."""
    with tempfile.TemporaryDirectory() as folder:
        study = init(Path(folder) / "bam", "bam_servo")
        motions, machine = motions_of(align_recordings(study), study), machine_of(study.rig)
        unit, gravity = drive_model(study.rig).effort_unit, study.model.gravity
    fitted, held = ([m for m in motions if m.split == s] for s in ("fitted", "heldout"))
    top = max(float(np.abs(m.velocity[m.inner]).max()) for m in fitted)
    models = {f: joint_model(f, motion="rotary", effort_unit=unit, gravity=gravity, velocity_range=top)
              for f in BAM_FAMILIES}  # fmt: skip
    best = {name: _opened(m, 0.0, fitted, held, machine) for name, m in models.items()}
    family = min(best, key=lambda name: best[name][0])  # on what was fitted
    said = f"BAM servo, family {family}, the best of five where fitted"
    model = models[family]
    tried = {t: _opened(model, t, fitted, held, machine) for t in BAM_TRAVELS_RAD}
    travel = min(tried, key=lambda t: tried[t][0])
    plain, bent = tried[0.0], tried[travel]
    words = f"position from the duty alone; {said}"
    yield _row("real.bam.openloop.best_family", np.degrees(plain[1]), "deg", words, "heldout")
    yield _row("real.bam.openloop.presliding", np.degrees(bent[1]), "deg",
               f"travel {1e3 * travel:.3g} mrad by the same on the fitted ones; {words}", "heldout")  # fmt: skip
    yield _row("real.bam.openloop.change", 100.0 * (bent[1] / plain[1] - 1.0), "%", words, "heldout")
    values = solve_family(model, stack(fitted)).values
    search = estimate_presliding(model, values, fitted, held)
    words = f"slow samples too, against friction that slips at once; {said}"
    yield _row("real.bam.effort.change", 100.0 * (search.gives / search.slips - 1.0), "%", words, "heldout")
    words = f"its readings are {1e3 * search.resolution:.2g} mrad apart: {search.why}; {said}"
    yield _row("real.bam.travel_below", None if search.below is None else 1e3 * search.below, "mrad", words, "fitted")


def _opened(
    model: JointModel, travel: float, fitted: Sequence[Motion], held: Sequence[Motion], machine: Machine
) -> tuple[float, float]:
    """RMS error of the position simulated from the command [rad], on fitted and held-out recordings."""
    bent = [replace(m, direction=_core.presliding(travel, m.position) if travel else None) for m in fitted]
    values = solve_family(model, stack(bent)).values
    made = []
    for motions in (fitted, held):
        errors = [simulate_recording(model, values, m, machine, closed=False, travel=travel) for m in motions]
        difference = np.concatenate([s.measured["position"] - s.simulated["position"] for s in errors])
        made.append(float(np.sqrt(np.mean(difference**2))))
    return made[0], made[1]
