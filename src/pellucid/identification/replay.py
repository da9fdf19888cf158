"""A recorded motion played again by an identified joint: in the machine's own closed loop, or from the command alone."""

from __future__ import annotations

import numpy as np

from ..models.joint import JointModel
from ..models.simulate import Drive, LoopSetting, Trace, simulate
from ..recordings.study_file import Rig
from ..signals.effort import drive_model
from ..signals.motion import Motion
from .fit import Simulation

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
        model.vector(values, velocity_width=width),
        motion.reference if closed else motion.command,
        1.0 / motion.fs,
        loop=loop_setting(rig) if closed else LoopSetting(),
        drive=Drive(drive.gain, drive.back_emf),
        injected=motion.injected if closed else None,
        position0=float(motion.raw_position[0]),
        velocity0=0.0 if closed else float(motion.velocity[0]),
        stiction=not differentiate,
        active=active,
    )
    if trace.jacobians is None:
        return trace
    chained = {name: jacobian @ spread[active] for name, jacobian in trace.jacobians.items()}
    return Trace(
        trace.position, trace.velocity, trace.acceleration, trace.command, trace.effort, trace.measured_position, chained
    )


def simulation_of(model: JointModel, values: np.ndarray, motion: Motion, rig: Rig, *, closed: bool) -> Simulation:
    """Simulate one motion with true stiction and compare: simulated signals as they are, measured ones filtered.

    Parameters
    ----------
    model : JointModel
    values : ndarray, shape (p,)
    motion : Motion
    rig : Rig
    closed : bool

    Returns
    -------
    Simulation
    """
    trace = replay(model, values, motion, rig, closed=closed)
    inner = motion.inner
    measured = {n: getattr(motion, n)[inner] for n in ("position", "velocity", "acceleration", "effort")}
    simulated = {n: getattr(trace, n)[inner] for n in measured}
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
