"""Joint with a carriage: time of its identification compared with SciPy, and speed of the virtual elbow.

The fit of friction by load is compared with what a user would write: the same model in vectorised NumPy, the same
filtered rows, SciPy's least squares with forward differences. Compared runs are interleaved; figures are medians.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np
from scipy import optimize

from pellucid.joint.slider.markers import slider_geometry
from pellucid.joint.slider.slider_fit import (
    FIRST_LOAD_COEFFICIENT,
    REGRESSION_STRIDE,
    SliderMotion,
    fit_coherent,
    three_steps,
)
from pellucid.joint.slider.study.identify_slider import STEP_PROTOCOLS, fit_slider
from pellucid.joint.slider.study.recorded_slider import slider_motions
from pellucid.models.joint import GRAVITY
from pellucid.models.slider_joint import VELOCITY_WIDTH, SliderJointModel
from pellucid_lab.elbow.instruments import play, read_all
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.study import record_in_memory

from ._size import sized
from .identification import _row, interleaved

REPEAT_COUNT = sized(5, smallest=1)
"""Number of runs of each fit."""


def plain_fit(motions: list[SliderMotion], mass: float, start: np.ndarray, bounds: tuple) -> np.ndarray:
    """Inertia, moment, gravity, frictions by direction and by load, with NumPy and SciPy alone."""
    target = np.concatenate([m.effort[np.flatnonzero(m.scored)[::REGRESSION_STRIDE]] for m in motions])
    known = [
        (m, m.slider, np.sin(m.position), np.cos(m.position), np.tanh(m.velocity / VELOCITY_WIDTH), m.velocity > 0.0)
        for m in motions
    ]

    def residual(p: np.ndarray) -> np.ndarray:
        parts = []
        for m, x, sin, cos, sign, up in known:
            body = (p[0] + 2.0 * p[1] * x + mass * x * x) * m.acceleration
            body = body + (p[2] + GRAVITY * mass * x) * sin + p[3] * cos
            share = np.where(body * sign > 0.0, p[8], p[9])
            dry = np.where(up, p[4], p[5]) + share * np.abs(body)
            made = body + m.smooth(dry * sign + np.where(up, p[6], p[7]) * m.velocity)
            parts.append(made[np.flatnonzero(m.scored)[::REGRESSION_STRIDE]])
        return np.concatenate(parts) - target

    return optimize.least_squares(
        residual, start, jac="2-point", bounds=bounds, x_scale="jac", xtol=1e-9, ftol=1e-12, gtol=1e-13, max_nfev=60
    ).x


def seconds(call: Callable[[], object]) -> list[float]:
    """Wall seconds of a call, `REPEAT_COUNT` times, after one that does not count."""
    taken = []
    for repeat in range(REPEAT_COUNT + 1):
        start = time.perf_counter()
        call()
        if repeat:
            taken.append(time.perf_counter() - start)
    return taken


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    rig = able_elbow()
    protocol = rig.trials()
    config, recordings, taken = record_in_memory(rig, protocol, seed=1, threads=2)
    played = sum(len(one.inside.time) for one in taken) / rig["sampling"]["rate"]
    note = f"{len(protocol)} recordings, {played:.0f} s of motion"
    geometry = slider_geometry(recordings)
    motions = slider_motions(recordings, config, geometry)
    steps = [m for m in motions if m.split == "fitted" and m.protocol in STEP_PROTOCOLS]
    mass, rail = config.rig.slider.mass, (config.rig.slider.low, config.rig.slider.high)
    model = SliderJointModel("load", {"carriage_mass": mass})
    start = np.array([FIRST_LOAD_COEFFICIENT if n.startswith("load") else 0.1 for n in model.names])
    lower, upper = model.bounds()
    rows = [
        _row("elbow: identification, six models", seconds(lambda: fit_slider(config, recordings)), "s", note),
        _row("elbow: of it, finding the carriage", seconds(lambda: slider_geometry(recordings)), "s", "markers"),
        _row(
            "elbow: of it, filtering",
            seconds(lambda: slider_motions(recordings, config, geometry)),
            "s",
            "every recording at full rate",
        ),
        _row(
            "elbow: of it, three steps, two sets",
            seconds(lambda: three_steps(steps, dissociated=True)),
            "s",
            f"{len(steps)} recordings",
        ),
    ]
    ours, theirs = interleaved(
        lambda: fit_coherent(model, steps, rail=rail, mass=config.rig.moving_mass, start=start),
        lambda: plain_fit(steps, mass, start, (lower, upper)),
    )
    found = fit_coherent(model, steps, rail=rail, mass=config.rig.moving_mass, start=start).values
    apart = np.max(np.abs(plain_fit(steps, mass, start, (lower, upper)) / found - 1.0))
    ratio = [b / a for a, b in zip(ours, theirs, strict=True)]
    rows += [
        _row("elbow: friction by load", ours, "s", "Pellucid, covariance included"),
        _row("elbow: friction by load, plain", theirs, "s", "SciPy least_squares, forward differences, NumPy model"),
        _row("elbow: friction by load, plain over Pellucid", ratio, "1", "pair by pair"),
        {
            "name": "friction by load, SciPy over ours",
            "value": statistics.median(theirs) / statistics.median(ours),
            "unit": "1",
            "note": "plain over Pellucid",
        },
        {
            "name": "elbow: friction by load, largest difference",
            "value": float(apart),
            "unit": "1",
            "note": "of any parameter",
        },
    ]
    same = [t for t in protocol if t.reference is protocol[6].reference]
    span = sum(len(t.reference) for t in same) / rig["sampling"]["rate"]
    noise = np.random.default_rng(1).standard_normal((len(same), len(same[0].reference)))
    for threads in (1, 2):
        taken_here = seconds(lambda n=threads: play(rig, same[0].loop, same, noise, threads=n))
        rate = [span / s for s in taken_here]
        rows.append(_row(f"elbow: plant, {threads} thread{'s' * (threads > 1)}", rate, "s/s", f"{len(same)} at once"))
    for threads in (1, 2):
        taken_here = seconds(lambda n=threads: read_all(rig, protocol, np.random.default_rng(1), threads=n))
        rate = [played / s for s in taken_here]
        rows.append(
            _row(f"elbow: recorded, {threads} thread{'s' * (threads > 1)}", rate, "s/s", "with current and cameras")
        )
    return rows
