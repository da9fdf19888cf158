"""Simulate recorded motions with an identified joint, in its machine's closed loop or from the command alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, fields, replace

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...models.simulate import JointTrace, LoopSetting, simulate
from ...numerics.motion import Motion, differentiate
from ...numerics.regression import predict_effort_rows

COMPARED_SIGNALS = ("position", "velocity", "acceleration", "effort")
"""Signals in which a simulation is compared with the recording."""

SIGN_SMOOTHING_SHARE = 0.01
"""Width of the smoothed sign of velocity, as a share of the recording's largest speed."""

DIVERGENCE_THRESHOLD = 1e100
"""A simulated response or derivative of this size counts as diverged. Its square is still finite."""


@dataclass(frozen=True)
class Machine:
    """Drive of a joint, effort = gain * command - back_emf * velocity, with its controller `loop`, if known."""

    gain: float = 1.0
    back_emf: float = 0.0
    loop: LoopSetting | None = None

    def can_close(self, motion: Motion) -> bool:
        """Return whether a `motion` can be simulated in closed loop: a known controller and a recorded reference."""
        return self.loop is not None and motion.reference is not None


@dataclass(frozen=True)
class Simulation:
    """A recording simulated with an identified joint.

    `mode` is "closed_loop" (the machine's own controller in the loop) or "openloop" (measured command in). `measured`
    and `simulated` map "position", "velocity", "acceleration", "effort" to arrays of shape (n,), SI; `errors` maps the
    same names to 100 ||x - x_s|| / ||x|| [%]; `rmse` is the position's, in rad or m.
    """

    recording: str
    split: str
    mode: str
    time: np.ndarray
    measured: Mapping[str, np.ndarray]
    simulated: Mapping[str, np.ndarray]
    errors: Mapping[str, float]
    rmse: float
    mean_absolute_error: float


def replay(
    model: JointModel,
    values: np.ndarray,
    motion: Motion,
    machine: Machine,
    *,
    closed: bool,
    differentiate: str = "",
    travel: float = 0.0,
) -> JointTrace:
    """Simulate one `motion` of a `machine` from its measured initial state, with a joint `model` at `values`, (p,).

    If `closed`, the machine's controller follows the recorded reference; otherwise the recorded command drives the
    joint. With a signal to `differentiate`, friction is smooth and the trace has that signal's Jacobian by the free
    values, (n, p). Friction builds up over a `travel` [rad or m].
    """
    width = SIGN_SMOOTHING_SHARE * float(np.abs(motion.velocity).max()) if differentiate else 0.0
    selection = model.selection()
    active = np.flatnonzero(selection.any(axis=1)) if differentiate else None
    loop, driven_by = (machine.loop, motion.reference) if closed else (LoopSetting(), motion.command)
    if loop is None or driven_by is None:
        missing = "a controller and a reference" if closed else "a command"
        raise IdentificationError(f"recording '{motion.recording}': expected {missing} to simulate it, found none")
    trace = simulate(
        model.loaded(model.vector(values, velocity_width=width), *motion.payload),
        driven_by,
        1.0 / motion.fs,
        loop=loop,
        gain=machine.gain,
        back_emf=machine.back_emf,
        injected=motion.injected if closed else None,
        position0=motion.initial[0],
        velocity0=motion.initial[1],
        stiction=not differentiate,
        presliding_travel=travel,
        active=active,
    )
    if trace.jacobians is None:
        return trace
    jacobian, free = trace.jacobians[differentiate], selection[active]
    # The product with a diverged Jacobian would overflow and warn, so it is not computed.
    reduced = jacobian @ free if is_bounded(jacobian) else np.full((len(jacobian), free.shape[1]), np.nan)
    return replace(trace, jacobians={differentiate: reduced})


def is_bounded(response: np.ndarray) -> bool:
    """Return whether a simulated response or its derivative is finite and has not diverged."""
    return bool(np.all(np.abs(response) < DIVERGENCE_THRESHOLD))


def simulate_recording(
    model: JointModel, values: np.ndarray, motion: Motion, machine: Machine, *, closed: bool, travel: float = 0.0
) -> Simulation:
    """Simulate one `motion` of a `machine` and compare it with the recording, both filtered alike.

    The joint is a `model` at `values`, (p,), in `closed` loop or driven by the recorded command. It has true stiction,
    or friction that builds up over a `travel` [rad or m].
    """
    trace = replay(model, values, motion, machine, closed=closed, travel=travel)
    if not (is_bounded(trace.acceleration) and is_bounded(trace.effort)):
        raise IdentificationError(f"recording '{motion.recording}': the simulated joint diverges")
    inner = motion.inner
    made = (*differentiate(trace.position, motion.fs, motion.filtering), motion.smooth(trace.effort))
    measured = {n: getattr(motion, n)[inner] for n in COMPARED_SIGNALS}
    simulated = {n: x[inner] for n, x in zip(COMPARED_SIGNALS, made, strict=True)}
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
    """Return 100 ||x - x_m|| / ||x|| [%], the literature's relative error."""
    return float(100.0 * np.linalg.norm(measured - modelled) / np.linalg.norm(measured))


@dataclass(frozen=True)
class Prediction:
    """The effort a model predicts for a recording, after the same filter on both sides; scored samples only.

    `position`, `velocity`, `acceleration`, `load`, `effort`, `predicted`: shape (n,), SI; `effort_error` [%] is
    100 ||tau - tau_hat|| / ||tau||; `coverage` is the share of samples inside the prediction interval `half_width`.
    """

    recording: str
    split: str
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    load: np.ndarray
    effort: np.ndarray
    predicted: np.ndarray
    effort_error: float
    r2: float
    half_width: float
    coverage: float

    def part(self, most: int) -> Prediction:
        """Return an excerpt of at most `most` consecutive samples from the middle of the recording."""
        n = len(self.time)
        if n <= most:
            return self
        middle = slice((n - most) // 2, (n - most) // 2 + most)
        return replace(self, **{f.name: getattr(self, f.name)[middle].copy() for f in fields(self) if _is_signal(f)})

    @property
    def residual(self) -> np.ndarray:
        """Measured minus predicted effort, shape (n,), in the effort's unit."""
        return self.effort - self.predicted


def _is_signal(field: Field) -> bool:
    """Return whether a field of `Prediction` holds one number per sample."""
    return field.type == "np.ndarray"


def r_squared(measured: np.ndarray, modelled: np.ndarray) -> float:
    """Return the coefficient of determination, 1 - ||x - x_m||^2 / ||x - mean(x)||^2; nan for a constant x."""
    spread = float(np.sum((measured - measured.mean()) ** 2))
    return float(1.0 - np.sum((measured - modelled) ** 2) / spread) if spread else float("nan")


def predict(
    model: JointModel,
    values: np.ndarray,
    motions: Sequence[Motion],
    half_width: float,
    known: Mapping[int, np.ndarray] | None = None,
) -> tuple[Prediction, ...]:
    """Predict the effort of every motion in its scored samples.

    `values` has shape (p,). `known` has the modelled effort, (m,), of some motions by their `id`, if it was computed
    before.
    """
    known = known or {}
    bare = model.vector(values)
    whole: dict[str, list[Motion]] = {}
    for motion in motions:
        whole.setdefault(motion.recording, []).append(motion)
    made = []
    for name, parts in whole.items():
        columns = [m.state_columns for m in parts]
        time, position, velocity, acceleration, effort = columns[0] if len(parts) == 1 else np.hstack(columns)
        if len(effort) == 0:
            continue
        found = [known[id(m)] if id(m) in known else predict_effort_rows(model, values, m) for m in parts]
        modelled = np.concatenate(found)
        loads = [_core.load(model.loaded(bare, *m.payload), *m.states[:, [1, 3]].T) for m in parts]
        made.append(
            Prediction(
                recording=name,
                split=parts[0].split,
                time=time,
                position=position,
                velocity=velocity,
                acceleration=acceleration,
                load=np.concatenate(loads),
                effort=effort,
                predicted=modelled,
                effort_error=relative_error(effort, modelled),
                r2=r_squared(effort, modelled),
                half_width=half_width,
                coverage=float(np.mean(np.abs(effort - modelled) <= half_width)),
            )
        )
    return tuple(made)


def pool_errors(predictions: Sequence[Prediction], split: str) -> tuple[float, float]:
    """Return the effort error [%] and R2 over all samples of one split; nan and nan if it is empty."""
    chosen = [p for p in predictions if p.split == split]
    if not chosen:
        return float("nan"), float("nan")
    effort = np.concatenate([p.effort for p in chosen])
    modelled = np.concatenate([p.predicted for p in chosen])
    return relative_error(effort, modelled), r_squared(effort, modelled)
