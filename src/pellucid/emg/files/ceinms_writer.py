"""Write calibrated muscles as a CEINMS subject: their constants, the joints that they move and their excitations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from ..._atomic import write_text_atomically
from ..models.hill import HillData, HillModel, HillMuscle
from .muscle_remark import MuscleRemark, subject_numbers

CURVE_LENGTHS = np.round(np.arange(0.0, 2.01, 0.05), 2)
"""Fibre lengths at which a subject's curves are sampled, in optimal fibre lengths l_o."""

CURVE_VELOCITIES = np.round(np.arange(-1.0, 1.01, 0.05), 2)
"""Fibre velocities at which a subject's curves are sampled, in v_max l_o."""


def write_subject(path: Path, remark: MuscleRemark, joints: Mapping[str, Sequence[str]]) -> Path:
    """Write a subject, completely or not at all. `joints` holds the muscles that move each joint, by the study's
    names."""
    muscles = remark.muscles.muscles
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<subject>", " <muscleDefault>"]
    lines += [
        f"  <percentageChange>{_mean(muscles, 'optimal_length_shift')!r}</percentageChange>",
        f"  <damping>{_mean(muscles, 'damping')!r}</damping>",
    ]
    for name, (x, y) in mean_curves(muscles).items():
        points = [
            f"<{tag}>{' '.join(repr(float(v)) for v in row)}</{tag}>" for tag, row in (("xPoints", x), ("yPoints", y))
        ]
        lines += ["  <Curve>", f"   <name>{name}</name>", *(f"   {p}" for p in points), "  </Curve>"]
    lines += [" </muscleDefault>", " <muscles>"]
    for muscle in muscles:
        numbers = subject_numbers(muscle, remark.period)
        lines += ["  <muscle>", f"   <name>{escape(remark.names[muscle.name])}</name>"]
        lines += [f"   <{key}>{value!r}</{key}>" for key, value in numbers.items()]
        lines += ["  </muscle>"]
    lines += [" </muscles>", " <DoFs>"]
    for joint, members in joints.items():
        lines += _sequence("DoF", joint, [remark.names[m] for m in members])
    lines += [" </DoFs>", " <Channels>"]
    channels = dict.fromkeys(c for m in muscles for c in remark.muscles.driven[m.name])
    for channel in channels:
        driven = [remark.names[m.name] for m in muscles if channel in remark.muscles.driven[m.name]]
        lines += _sequence("Channel", channel, driven)
    lines += [" </Channels>", remark.text(), "</subject>"]
    return write_text_atomically(path, "\n".join(lines) + "\n")


def _sequence(tag: str, name: str, muscles: Sequence[str]) -> list[str]:
    said = escape(" ".join(muscles))
    return [
        f"  <{tag}>", f"   <name>{escape(name)}</name>", f"   <muscleSequence>{said}</muscleSequence>", f"  </{tag}>"
    ]  # fmt: skip


def _mean(muscles: Sequence[HillMuscle], quantity: str) -> float:
    values = [getattr(m, quantity) for m in muscles]
    return float(values[0] if len(set(values)) == 1 else np.mean(values))


def mean_curves(muscles: Sequence[HillMuscle]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the points of the core's own curves for the mean muscle, since a subject has one curve for all muscles."""
    shaped = ("force_length_width", "passive_scale", "curvature", "eccentric_force", "passive_strain", "passive_shape")
    mean_muscle = HillMuscle("mean", 1.0, 0.0, 1.0, **{q: _mean(muscles, q) for q in shaped})
    # Without tendon, pennation, damping and time, a muscle's force consists of its curves alone.
    model = HillModel([replace(mean_muscle, shape=0.0, delay=0.0, optimal_length_shift=0.0)])

    def force(excitation: float, length: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        n = len(length)
        starts = tuple(range(n))  # every sample is a simulation of its own, which starts at rest
        data = HillData(
            np.full((1, n), excitation), length[None], 10.0 * velocity[None], np.ones((1, n)), 1.0, starts
        )  # fmt: skip
        return model.states(data)["force"][0]

    still = np.zeros_like(CURVE_LENGTHS)
    passive = force(0.0, CURVE_LENGTHS, still)
    active = force(1.0, CURVE_LENGTHS, still) - passive
    fast = force(1.0, np.ones_like(CURVE_VELOCITIES), CURVE_VELOCITIES)
    return {
        "activeForceLength": _with_far_points(CURVE_LENGTHS, active, (0.0, 0.0)),
        "passiveForceLength": _with_far_points(CURVE_LENGTHS, passive, (0.0, float(passive[-1]))),
        "forceVelocity": _with_far_points(CURVE_VELOCITIES, fast, (0.0, float(fast[-1]))),
    }


def _with_far_points(x: np.ndarray, y: np.ndarray, ends: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve with one more point far out on either side, so that no program extrapolates the spline."""
    return np.concatenate(([-5.0], x, [5.0])), np.concatenate((ends[:1], y, ends[1:]))
