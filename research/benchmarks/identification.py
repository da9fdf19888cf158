"""Time of an identification: Pellucid and the same method in plain NumPy and SciPy, on the EMPS recording.

Two methods are compared with code that a user would write: filtered least squares with NumPy, and the fit of the
simulated closed loop with SciPy's least squares and finite differences, around a plant compiled by Numba. Without Numba
the second reference is skipped. Without the recording (``PELLUCID_DATA``) that of a virtual joint replaces it. Compared
runs are interleaved; figures are medians.
"""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import optimize, signal

from pellucid._errors import DatasetError
from pellucid.joint.fit.estimators import solve_output_error
from pellucid.joint.fit.friction_solver import solve_family
from pellucid.joint.fit.replay import SIGN_SMOOTHING_SHARE
from pellucid.joint.study.aligned_motions import aligned_motions
from pellucid.joint.study.solve_joint import machine_of
from pellucid.models.joint import joint_model
from pellucid.models.simulate import substeps_for
from pellucid.numerics.regression import stack
from pellucid.study.datasets import init, names
from pellucid.study.recorded_motions import drive_model
from pellucid.study.study import Study
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study

from ._peers import peer
from ._size import sized

REPEAT_COUNT = sized(7, smallest=1)
"""Number of runs of each call that are timed."""


def study_at(folder: Path) -> Study:
    """The first public joint that is here, or a virtual one."""
    try:
        return init(folder / "study", dataset=names()[0])
    except DatasetError:
        return write_study(folder / "study", bench_joint(), name="virtual", seed=1)


def plain_least_squares(study: Study) -> np.ndarray:
    """Filter, differentiate, decimate, solve: as one would write it with NumPy and SciPy."""
    p, gain = study.processing, drive_model(study.rig).gain
    rows, targets = [], []
    for recording in study.recordings("fit"):
        fs = recording.fs
        b, a = signal.butter(p.order, p.lowpass, fs=fs)
        q = signal.filtfilt(b, a, recording["position"])
        v = np.gradient(q, 1.0 / fs)
        command = recording["voltage"] if "voltage" in recording else recording["current"]
        effort = signal.filtfilt(b, a, gain * command)
        columns = [np.gradient(v, 1.0 / fs), v, np.sign(v), np.ones_like(v)]
        if study.model.gravity != "none":
            columns.append(np.sin(q))
        inner = slice(p.trim, len(q) - p.trim)
        block = np.column_stack([*columns, effort])[inner]
        block = signal.decimate(block, p.decimate, axis=0, zero_phase=True)
        rows.append(block[:, :-1])
        targets.append(block[:, -1])
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=None)[0]


def plain_simulation() -> Callable | None:
    """The closed loop with smooth friction, compiled by Numba; None where Numba is not installed."""
    numba = peer("identification", "numba")
    if numba is None:
        return None

    @numba.njit
    def run(values, reference, period, substeps, kp, kv, limit, span, gain, width, q, v, out):
        inertia, viscous, coulomb, offset, gravity = values
        history = np.full(span + 1, q)
        h = period / substeps
        for k in range(reference.size):
            history[1:] = history[:-1].copy()
            history[0] = q
            speed = (history[0] - history[span]) / (span * period)
            u = kv * (kp * (reference[k] - q) - speed)
            u = min(max(u, -limit), limit)
            out[k] = gain * u
            for _ in range(substeps):
                a = gain * u - offset - viscous * v - coulomb * math.tanh(v / width) - gravity * math.sin(q)
                v += h * a / inertia
                q += h * v

    return run


def plain_output_error(study: Study, start: np.ndarray, run: Callable) -> np.ndarray:
    """Fit the simulated effort with SciPy's least squares and finite differences."""
    loop, gain = study.rig.loop, drive_model(study.rig).gain
    made = aligned_motions(study, "fit")

    def residual(scaled: np.ndarray) -> np.ndarray:
        values = np.append(scaled * start, np.zeros(5 - len(start)))
        parts = []
        for m in made:
            out = np.empty(len(m.time))
            width = SIGN_SMOOTHING_SHARE * float(np.abs(m.velocity).max())
            period = 1.0 / m.fs
            settings = (loop.kp, loop.kv, loop.limit, loop.velocity_span, gain, width)
            run(values, m.reference, period, substeps_for(period), *settings, *m.initial, out)
            parts.append(signal.decimate((out - m.effort)[m.inner], m.filtering.decimate, zero_phase=True))
        return np.concatenate(parts)

    return optimize.least_squares(residual, np.ones(len(start)), x_scale="jac", xtol=1e-6, max_nfev=40).x * start


def interleaved(*calls: Callable[[], object]) -> list[list[float]]:
    """Wall seconds of each call, one after another, `REPEAT_COUNT` times, after one round that does not count."""
    taken: list[list[float]] = [[] for _ in calls]
    for repeat in range(REPEAT_COUNT + 1):
        for seconds, call in zip(taken, calls, strict=True):
            start = time.perf_counter()
            call()
            if repeat:
                seconds.append(time.perf_counter() - start)
    return taken


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    with tempfile.TemporaryDirectory() as folder:
        study = study_at(Path(folder))
        study.recordings()
        model = joint_model(
            "symmetric",
            motion=study.rig.motion,
            effort_unit=drive_model(study.rig).effort_unit,
            gravity=study.model.gravity,
        )

        def least_squares() -> np.ndarray:
            return solve_family(model, stack(aligned_motions(study, "fit"))).values

        data, machine = stack(aligned_motions(study, "fit")), machine_of(study.rig)
        first = solve_family(model, data)
        order = [model.names.index(n) for n in ("inertia", "viscous", "coulomb", "offset")]
        order += [model.names.index("gravity")] if "gravity" in model.names else []
        compiled = plain_simulation()
        ours, theirs = interleaved(least_squares, lambda: plain_least_squares(study))
        rows = beside(f"{study.name}: least squares", ours, theirs, "NumPy and SciPy")

        def output_error() -> np.ndarray:
            return solve_output_error(model, data, machine, first).values[order]

        name = f"{study.name}: output error"
        if compiled is None:
            return [*rows, _row(name, *interleaved(output_error), "s", "Pellucid")]

        def plain() -> np.ndarray:
            return plain_output_error(study, first.values[order], compiled)

        rows += beside(name, *interleaved(output_error, plain), "SciPy least_squares, finite differences, Numba plant")
        apart = float(np.max(np.abs(output_error() / plain() - 1.0)))
    return [*rows, {"name": f"{name}, largest difference", "value": apart, "unit": "1", "note": "of any parameter"}]


def beside(name: str, ours: list[float], theirs: list[float], note: str) -> list[dict]:
    """Rows of what Pellucid and the plain method took [s], and of their ratio pair by pair."""
    ratio = [y / x for x, y in zip(ours, theirs, strict=True)]
    return [
        _row(name, ours, "s", "Pellucid"),
        _row(f"{name}, plain", theirs, "s", note),
        _row(f"{name}, plain over Pellucid", ratio, "1", "pair by pair"),
    ]


def _row(name: str, values: list[float], unit: str, note: str) -> dict:
    spread = f"{note}; {min(values):.3g} to {max(values):.3g} in {len(values)} runs"
    return {"name": name, "value": statistics.median(values), "unit": unit, "note": spread}
