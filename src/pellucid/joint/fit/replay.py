r"""Simulations of recorded motions and predictions of their effort, with a conformal prediction band.

A simulation runs in its machine's closed loop or from the command alone.

The half width of the band is a quantile [1]_ of the absolute errors on blocks of the fitted recordings, each predicted
from all the others [2]_. Autocorrelated samples count once in two correlation times. With m independent samples, the
quantile at :math:`(1 + 1/m)` times the level covers the next sample with at least that level, whatever the errors'
distribution, as long as it does not change.

Held-out recordings are not used for the band; its coverage of them is a test. Its coverage of the fitted recordings is
measured by cross-validation: each block is compared with a band made from the other blocks.

.. [1] H. Papadopoulos, K. Proedrou, V. Vovk, A. Gammerman, "Inductive confidence machines for regression", ECML 2002.
.. [2] V. Vovk, "Cross-conformal predictors", Ann. Math. Artif. Intell. 74, 2015.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...models.simulate import JointTrace, LoopSetting, simulate
from ...numerics.motion import Motion, differentiate
from ...numerics.regression import Stack, predict_effort_rows, regression_rows
from ...numerics.uncertainty import block_length, correlation_time, degrees_of_freedom, student_to_normal_ratio
from .discrepancy import neglected_columns
from .joint_estimate import JointEstimate, joint_states

if TYPE_CHECKING:
    from ...numerics.posterior.posterior import Posterior

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
        presliding_travel=travel or motion.filtering.presliding_travel,
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
    model: JointModel,
    values: np.ndarray,
    motion: Motion,
    machine: Machine,
    *,
    closed: bool,
    travel: float = 0.0,
    trace: JointTrace | None = None,
) -> Simulation:
    """Simulate one `motion` of a `machine` and compare it with the recording, both filtered alike.

    The joint is a `model` at `values`, (p,), in `closed` loop or driven by the recorded command. It has true stiction,
    or friction that builds up over a `travel` [rad or m]. `trace` is the simulation if another step made it.
    """
    if trace is None:
        trace = replay(model, values, motion, machine, closed=closed, travel=travel)
    if not (is_bounded(trace.acceleration) and is_bounded(trace.effort)):
        raise IdentificationError(
            f"recording '{motion.recording}': the simulated joint diverges; check the sign and unit of the effort"
        )
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
    """Return 100 ||x - x_m|| / ||x|| [%], the literature's relative error; infinite for a signal at rest."""
    size = float(np.linalg.norm(measured))
    return 100.0 * float(np.linalg.norm(measured - modelled)) / size if size > 0.0 else float("inf")


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
        time, position, velocity, acceleration, effort = _joined_states(parts)
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


def _joined_states(parts: Sequence[Motion]) -> np.ndarray:
    """Return the states of consecutive motions, (5, m), which predictions of all models share."""
    if len(parts) == 1:
        return parts[0].state_columns
    kept, names = vars(parts[0]), tuple(map(id, parts))
    if kept.get("_joined_states", (None,))[0] != names:
        joined = np.hstack([m.state_columns for m in parts])
        kept["_joined_states"] = names, joined
        ends = np.cumsum([m.state_columns.shape[1] for m in parts])
        for motion, columns in zip(parts, np.split(joined, ends[:-1], axis=1), strict=True):
            vars(motion)["state_columns"] = columns
    return kept["_joined_states"][1]


def pool_errors(predictions: Sequence[Prediction], split: str) -> tuple[float, float]:
    """Return the effort error [%] and R2 over all samples of one split; nan and nan if it is empty."""
    chosen = [p for p in predictions if p.split == split]
    if not chosen:
        return float("nan"), float("nan")
    effort = np.concatenate([p.effort for p in chosen])
    modelled = np.concatenate([p.predicted for p in chosen])
    return relative_error(effort, modelled), r_squared(effort, modelled)


MIN_CONDITION_SAMPLES = 30
"""Smallest number of samples for which the coverage under a condition is reported."""

MAX_BLOCKS = 50
"""Largest number of blocks in cross-validation. Longer recordings get longer blocks."""


@dataclass(frozen=True)
class ConditionCoverage:
    """Cross-validated coverage of a band under one condition."""

    kind: str  # "direction", "speed", "position" or "recording"
    condition: str  # "slow", "positive", ..., or the recording's name
    coverage: float  # share of samples inside the band
    samples: int  # number of samples under this condition


@dataclass(frozen=True)
class PredictiveBand:
    """A prediction band of constant width, with its cross-validated coverage."""

    half_width: float  # half the width of the band, in the effort's unit
    by_recording: dict[str, float]  # coverage of each recording from which the band was made
    conditions: tuple[ConditionCoverage, ...] = ()  # coverage by condition


def conformal_half_width(errors: np.ndarray, level: float, independent: float) -> float:
    """Return the quantile of absolute `errors`, (n,), that covers the next error with probability `level`.

    `independent` is the effective number of independent errors.
    """
    return float(np.quantile(errors, _quantile_level(level, independent), method="higher"))


def _quantile_level(level: float, independent: float) -> float:
    """Return the level of the quantile that covers with probability `level`, from `independent` samples."""
    return min(1.0, level * (1.0 + 1.0 / max(independent, 1.0)))


def make_predictive_band(
    predictions: Sequence[Prediction], crossed: Sequence[np.ndarray], level: float
) -> PredictiveBand | None:
    """Make a band from `crossed` residuals of the fitted recordings, whose `predictions` say when they moved how.

    `crossed` has one array for each stretch, in their order. Returns None if there is none.
    """
    own = [p for p in predictions if p.split == "fitted"]
    errors = _residuals_by_recording(own, crossed)
    if not errors or not sum(map(len, errors)):
        return None
    lengths = [len(e) for e in errors]
    together = np.concatenate(errors)
    time = correlation_time(together, lengths)
    size, block = np.abs(together), max(block_length(time, len(together)), len(together) // MAX_BLOCKS)
    # No block spans two recordings.
    owner = np.concatenate([np.full(n, i) for i, n in enumerate(lengths)])
    before = np.cumsum([0, *(-(-n // block) for n in lengths)])
    blocks = np.concatenate([first + np.arange(n) // block for first, n in zip(before, lengths, strict=False)])
    order = np.argsort(size)  # sorted once: the errors without one block are sorted too
    ordered, owned = size[order], blocks[order].astype(np.uint16)  # few and short numbers are sorted fastest
    grouped = np.argsort(owned, kind="stable")  # places of each block among the sorted errors, in order
    ends = np.searchsorted(owned[grouped], np.arange(blocks.max() + 2))
    worth = len(size) / max(2.0 * time, 1.0)
    inside = np.empty(len(size), bool)
    for b in range(blocks.max() + 1):
        mine = grouped[ends[b] : ends[b + 1]]
        rest = len(size) - len(mine) or len(size)
        share = _quantile_level(level, worth * rest / len(size))
        place = int(np.ceil(share * (rest - 1)))  # among the errors without this block
        if rest < len(size):
            place += int(np.searchsorted(mine - np.arange(len(mine)), place, side="right"))
        inside[order[mine]] = ordered[mine] <= ordered[place]
    by_recording = {p.recording: float(inside[owner == i].mean()) for i, p in enumerate(own)}
    return PredictiveBand(
        conformal_half_width(size, level, worth),
        by_recording,
        tuple(_coverage_by_condition(own, inside)),
    )


def apply_band(predictions: Sequence[Prediction], band: PredictiveBand) -> tuple[Prediction, ...]:
    """Return the predictions with the band's half width and coverage.

    The coverage of recordings from which the band was made is cross-validated.
    """
    return tuple(
        replace(
            p,
            half_width=band.half_width,
            coverage=band.by_recording.get(
                "" if p.split == "heldout" else p.recording,
                float(np.mean(np.abs(p.residual) <= band.half_width)),
            ),
        )
        for p in predictions
    )


def _residuals_by_recording(own: Sequence[Prediction], crossed: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the cross-validated residuals as one array for each recording.

    If their number does not match, the fitted residuals are returned instead.
    """
    total = np.concatenate(crossed) if crossed else np.zeros(0)
    if len(total) != sum(len(p.effort) for p in own):
        return [p.residual for p in own]
    return np.split(total, np.cumsum([len(p.effort) for p in own])[:-1])


def _coverage_by_condition(own: Sequence[Prediction], inside: np.ndarray) -> Iterator[ConditionCoverage]:
    """Yield the coverage by direction, speed, position and recording; `inside`, (n,), marks the covered samples."""
    velocity, position = (np.concatenate([getattr(p, n) for p in own]) for n in ("velocity", "position"))
    kinds: list[tuple[str, np.ndarray, tuple[str, ...]]] = [
        ("direction", (velocity > 0.0).astype(int), ("negative", "positive"))
    ]
    for kind, values, thirds in (
        ("speed", np.abs(velocity), ("slow", "middle", "fast")),
        ("position", position, ("low", "middle", "high")),
    ):
        kinds.append((kind, np.searchsorted(np.quantile(values, [1.0 / 3.0, 2.0 / 3.0]), values), thirds))
    owner = np.repeat(np.arange(len(own)), [len(p.effort) for p in own])
    for kind, label, words in (*kinds, ("recording", owner, tuple(p.recording for p in own))):
        for i, word in enumerate(words):
            mine = label == i
            if mine.sum() >= MIN_CONDITION_SAMPLES:
                yield ConditionCoverage(kind, word, float(inside[mine].mean()), int(mine.sum()))


PRIOR_EFFORT_SPREAD = 10.0
"""Prior standard deviation of the effort that one parameter produces, divided by the recorded effort."""

MAX_NONLINEAR_SAMPLES = 200_000
"""A nonlinear family is sampled only up to this many samples: reweighting computes every sample for every draw."""


def joint_posterior(estimate: JointEstimate, data: Stack[Motion], **sampling) -> Posterior:
    """Return the posterior of a least-squares `estimate`, from the rows that it was fitted to.

    `sampling` is passed on to `drawn`.
    """
    from ...numerics.posterior.posterior import LinearisedModel, Noise, Prior, summary

    model, values, lengths = estimate.model, estimate.array, data.lengths
    samples = sum(len(m.effort) for m in data.motions)
    if not model.linear and samples > MAX_NONLINEAR_SAMPLES:
        raise IdentificationError(
            f"{samples} samples were fitted, expected at most {MAX_NONLINEAR_SAMPLES}: a posterior is for small data, "
            f"and {model.family} friction is not linear in its parameters"
        )
    jacobian, effort = regression_rows(model, values, data)
    residual = data.target - effort
    # All columns share one s here, which that of the turning would set for all friction.
    states = replace(joint_states(model, data, values), turning=None)
    statistical = estimate.statistical
    if estimate.discrepancy is not None:
        statistical = statistical + estimate.discrepancy.explained
    lacks = neglected_columns(model.names, values, jacobian, residual, states, statistical)
    if lacks is None:
        raise IdentificationError(
            "found too few samples in motion or no residual, expected enough of both to estimate the noise: record "
            "longer, or lower dead_band"
        )
    # Parameters are scaled to the effort that they produce.
    free, scale = np.flatnonzero(lacks.free), lacks.scale
    lower, upper = (bound[free] * scale for bound in model.bounds())
    weak = np.full(len(free), PRIOR_EFFORT_SPREAD * float(np.linalg.norm(data.target)))
    prior = Prior(lower, upper, np.zeros(len(free)), weak)
    freedom = degrees_of_freedom(block_length(correlation_time(residual, lengths), len(residual)), len(residual))
    # The degrees of freedom already widen the tails here, so the factor in the variance is taken out.
    noise = Noise(lacks.noise / student_to_normal_ratio(freedom) ** 2, freedom)
    straight = LinearisedModel(
        values[free] * scale, lacks.own, lacks.target, lacks.columns, np.ones(len(lacks.words)), lacks.tied
    )

    def left_over(place: np.ndarray) -> np.ndarray:
        at = values.copy()
        at[free] = place / scale
        return (data.target - np.concatenate([predict_effort_rows(model, at, m) for m in data.motions]))[lacks.rows]

    covariance = estimate.covariance[np.ix_(free, free)] * np.outer(scale, scale)
    bent = None if model.linear else left_over
    found = straight.draws(straight.likelihood(prior, noise), covariance, bent, **sampling)
    names = [model.names[i] for i in free]
    title = f"Posterior of a joint with {model.family} friction"
    units = [model.unit(name) for name in names]
    return summary(names, units, found, prior, scale=scale, level=estimate.confidence, title=title)
