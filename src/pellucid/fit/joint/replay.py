"""A recorded motion played again by an identified joint: in its machine's closed loop, or from the command alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...models.simulate import LoopSetting, Trace, simulate
from ...recordings.study_file import Processing, Rig
from ...signals.effort import drive_model
from ...signals.motion import Motion, differentiate, lowpassed
from ..parameter import Simulation

SIGNALS = ("position", "velocity", "acceleration", "effort")
SMOOTHING = 0.01  # width of the smooth sign of velocity, as a share of a recording's largest speed


def loop_setting(rig: Rig) -> LoopSetting:
    """The rig's controller as the core takes it; kind "none" where the rig states no controller."""
    loop = rig.loop
    if loop is None:
        return LoopSetting()
    gains = (loop.kp or 0.0, loop.ki or 0.0, loop.kd or 0.0, loop.kv or 0.0)
    return LoopSetting(loop.kind, *gains, loop.limit or 0.0, loop.velocity_span)


def can_close(rig: Rig, motion: Motion) -> bool:
    """Whether the recording can be simulated in closed loop: a known controller and a recorded reference."""
    return rig.loop is not None and motion.reference is not None


def replay(
    model: JointModel,
    values: np.ndarray,
    motion: Motion,
    rig: Rig,
    *,
    closed: bool,
    differentiate: bool = False,
) -> Trace:
    """Simulate one motion from its measured initial state.

    Parameters
    ----------
    model : JointModel
    values : ndarray, shape (p,)
    motion : Motion
    rig : Rig
    closed : bool
        With the machine's controller following the recorded reference, or from the recorded command.
    differentiate : bool
        Smooth friction, and Jacobians with respect to the free values, (n, p).

    Returns
    -------
    Trace
    """
    drive = drive_model(rig)
    width = SMOOTHING * float(np.abs(motion.velocity).max()) if differentiate else 0.0
    spread = model.spread()
    active = np.flatnonzero(spread.any(axis=1)) if differentiate else None
    trace = simulate(
        model.loaded(model.vector(values, velocity_width=width), *motion.payload),
        motion.reference if closed else motion.command,
        1.0 / motion.fs,
        loop=loop_setting(rig) if closed else LoopSetting(),
        gain=drive.gain,
        back_emf=drive.back_emf,
        injected=motion.injected if closed else None,
        position0=motion.initial[0],
        velocity0=motion.initial[1],
        stiction=not differentiate,
        active=active,
    )
    if trace.jacobians is None:
        return trace
    chained = {name: jacobian @ spread[active] for name, jacobian in trace.jacobians.items()}
    return replace(trace, jacobians=chained)


def simulation_of(
    model: JointModel, values: np.ndarray, motion: Motion, rig: Rig, processing: Processing, *, closed: bool
) -> Simulation:
    """Simulate one motion with true stiction and compare, with measured and simulated signals filtered alike.

    Parameters
    ----------
    model : JointModel
    values : ndarray, shape (p,)
    motion : Motion
    rig : Rig
    processing : Processing
    closed : bool

    Returns
    -------
    Simulation

    Raises
    ------
    IdentificationError
        If the simulation diverges.
    """
    trace = replay(model, values, motion, rig, closed=closed)
    if not (np.all(np.isfinite(trace.acceleration)) and np.all(np.isfinite(trace.effort))):
        raise IdentificationError(f"recording '{motion.recording}': the simulated joint diverges")
    inner = motion.inner
    made = (*differentiate(trace.position, motion.fs, processing), lowpassed(trace.effort, motion.fs, processing))
    measured = {n: getattr(motion, n)[inner] for n in SIGNALS}
    simulated = {n: x[inner] for n, x in zip(SIGNALS, made, strict=True)}
    errors = {n: relative_error(measured[n], simulated[n]) for n in measured}
    difference = measured["position"] - simulated["position"]
    return Simulation(
        recording=motion.recording,
        split=motion.split,
        mode="closed_loop" if closed else "openloop",
        time=motion.time[inner],
        measured=measured,
        simulated=simulated,
        errors=errors,
        rmse=float(np.sqrt(np.mean(difference**2))),
        mean_absolute_error=float(np.mean(np.abs(difference))),
    )


def relative_error(measured: np.ndarray, modelled: np.ndarray) -> float:
    """100 ||x - x_m|| / ||x|| [%], the literature's relative error."""
    return float(100.0 * np.linalg.norm(measured - modelled) / np.linalg.norm(measured))
