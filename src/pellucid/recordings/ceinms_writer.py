"""Calibrated muscles as a CEINMS subject: muscles with their constants, what moves each joint, what excites them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from .._atomic import write_text_atomically
from ..models.hill import HillData, HillModel, HillMuscle
from .muscle_remark import MuscleRemark, subject_numbers

LENGTHS = np.round(np.arange(0.0, 2.01, 0.05), 2)
VELOCITIES = np.round(np.arange(-1.0, 1.01, 0.05), 2)
"""At which the curves of a subject are given: lengths in l_o, velocities in v_max l_o."""


def write_subject(path: Path, remark: MuscleRemark, joints: Mapping[str, Sequence[str]]) -> Path:
    """Write a subject, whole or not at all; `joints`: the muscles that move each, by the study's names."""
    muscles = remark.muscles.muscles
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<subject>", " <muscleDefault>"]
    lines += [
        f"  <percentageChange>{_mean(muscles, 'optimal_length_shift')!r}</percentageChange>",
        f"  <damping>{_mean(muscles, 'damping')!r}</damping>",
    ]
    for name, (x, y) in curves(muscles).items():
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
    for joint, own in joints.items():
        lines += _sequence("DoF", joint, [remark.names[m] for m in own])
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


def curves(muscles: Sequence[HillMuscle]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Points of the core's own curves, of the muscles' mean: a subject has one of each for all."""
    shaped = ("force_length_width", "passive_scale", "curvature", "eccentric_force", "passive_strain", "passive_shape")
    alike = HillMuscle("mean", 1.0, 0.0, 1.0, **{q: _mean(muscles, q) for q in shaped})
    # Bare of tendon, pennation, damping and time, a muscle's force is its curves.
    model = HillModel([replace(alike, shape=0.0, delay=0.0, optimal_length_shift=0.0)])

    def force(excitation: float, length: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        n = len(length)
        starts = tuple(range(n))  # each sample at rest in itself
        data = HillData(
            np.full((1, n), excitation), length[None], 10.0 * velocity[None], np.ones((1, n)), 1.0, starts
        )  # fmt: skip
        return model.states(data)["force"][0]

    still = np.zeros_like(LENGTHS)
    passive = force(0.0, LENGTHS, still)
    active = force(1.0, LENGTHS, still) - passive
    fast = force(1.0, np.ones_like(VELOCITIES), VELOCITIES)
    return {
        "activeForceLength": _wide(LENGTHS, active, (0.0, 0.0)),
        "passiveForceLength": _wide(LENGTHS, passive, (0.0, float(passive[-1]))),
        "forceVelocity": _wide(VELOCITIES, fast, (0.0, float(fast[-1]))),
    }


def _wide(x: np.ndarray, y: np.ndarray, ends: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """With a point far out on either side, so that nobody extrapolates a spline."""
    return np.concatenate(([-5.0], x, [5.0])), np.concatenate((ends[:1], y, ends[1:]))
