r"""Fit a joint with a carriage: filtered motions, the published three steps, one physically consistent body.

Recordings are filtered once at full rate, then thinned. Slow reversals show the presliding travel.

Each step of the published identification of an elbow with a carriage is linear in what it fits [1]_:

1. held still: gravity and what sticks;
2. constant velocities: gravity again, dry and viscous friction;
3. the swept sine, minus the torque that step 2 explains: inertia.

With a set of parameters for each direction, every column appears twice, masked by the sign of velocity. Both sides of
each regression pass the same zero-phase filter, unlike the paper's moving averages (docs/errata.md, A12).

The coherent body is fitted with bounded parameters, its pseudo-inertia and load-dependent friction.

.. [1] D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb
   exoskeleton", Robotica 39, 2021, section 3.3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ... import _core
from ..._errors import IdentificationError, RecordingError
from ..._processes import with_one_blas_thread
from ...files.recording import Recording
from ...models.card import named
from ...models.estimates import Parameter, Verdict
from ...models.friction_terms import is_friction
from ...models.joint import GRAVITY
from ...models.slider_joint import (
    FRICTION_TERMS,
    GRAVITY_TERMS,
    INERTIA_TERMS,
    UNITS,
    DirectionalSliderModel,
    SliderJointModel,
    columns,
)
from ...numerics.filters import runs, sliding_mean, zero_phase_lowpass
from ...numerics.motion import JudgedData
from ...numerics.regression import (
    Stack,
    least_squares_within,
    make_parameters,
    nearest_feasible,
    regression_rows,
    require_full_rank,
    snap_to_bounds,
    solve,
    stack,
)
from ...numerics.searches.scalar_search import minimise_on_interval
from ...numerics.uncertainty import sandwich_covariance
from ..fit.discrepancy import collect_states, estimate_discrepancy
from .axis_offset import AxisOffset
from .markers import Geometry

SAMPLES_PER_LOWPASS_PERIOD = 20.0
"""Samples kept per period of the low-pass's cut-off. The signal between them is interpolated to 1e-4."""

SLIDING_MEAN_CUTOFF = 0.443
"""Frequency at which a sliding mean of n samples passes -3 dB, times n, over the sampling rate [1]."""

REGRESSION_STRIDE = 5
"""One kept sample in this many enters a regression, because the filter makes neighbours nearly equal."""

MAX_HOLD_SPEED = 0.01
"""A slower joint holds its position [rad/s]."""

MIN_HOLD_S = 2.0
"""Shorter rests are not used as holds."""

SETTLED_HOLD_SHARE = 0.6
"""Last share of a hold that is averaged, after the joint has settled."""


@dataclass(frozen=True)
class TravelSearch:
    """Settings of the search for the presliding travel in slow reversals."""

    # Cut-off of the low-pass on position and effort. A joint breaks away within a tenth of a second.
    lowpass_hz: float = 15.0
    # Range of motion on either side of a reversal that is used. The largest travel is less than half of it.
    turn_band_rad: float = 12e-3
    min_travel_rad: float = 2e-5  # Smallest travel that is tried, below the resolution of most encoders
    max_travel_rad: float = 4.8e-3  # Largest travel that is tried
    candidate_count: int = 25  # Number of travels that are tried before the search is refined
    # Last share of the band before a reversal that is fitted. Before it, some contacts are not yet dragged along.
    kept_band_share: float = 0.6
    min_turn_count: int = 6  # Smallest number of reversals, from which the median has a 95 % interval


TRAVEL_SEARCH = TravelSearch()


@dataclass(frozen=True)
class SliderMotion:
    """One recording with the carriage at one place."""

    recording: str  # recording, protocol, split: "fitted" or "heldout"
    protocol: str
    split: str
    slider: float  # x, the marker's distance along the link [m]
    fs: float  # Rate of the kept samples [Hz]
    # position, velocity, acceleration, effort: (n,) Low-passed alike; SI, effort [N*m] at the joint
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    lowpass: float  # lowpass, order: Of the filter [Hz]
    order: int
    # (n,) Samples faster than the dead band, the borders left out: those a model of a moving joint speaks of
    scored: np.ndarray
    # Kept samples of the sliding mean that effort went through; None: the low-pass
    effort_mean: int | None = None

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.position)

    @property
    def time(self) -> np.ndarray:
        """Time of the kept samples, shape (n,) [s]."""
        return np.arange(self.count) / self.fs

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """The samples, (n,) or (n, k), that a regression uses."""
        return samples[np.flatnonzero(self.scored)[::REGRESSION_STRIDE]]

    def smooth(self, samples: np.ndarray, share: float = 1.0) -> np.ndarray:
        """The low-pass that effort went through, for what a model makes of the sign of velocity; (n,) or (n, k).

        The cut-off is `share` times that of the motion; a sliding mean is over 1 / `share` times as many samples.
        """
        if self.effort_mean is not None:
            return sliding_mean(samples, round(self.effort_mean / share))
        return zero_phase_lowpass(samples, share * self.lowpass, self.order, self.fs)

    def holds(self) -> list[slice]:
        """Settled parts of the stretches in which the joint holds still."""
        found = []
        for rest in runs(np.abs(self.velocity) < MAX_HOLD_SPEED):
            length = rest.stop - rest.start
            if length >= MIN_HOLD_S * self.fs:
                found.append(slice(rest.stop - int(SETTLED_HOLD_SHARE * length), rest.stop))
        return found


class JudgedSliderMotion(SliderMotion, JudgedData):
    """A held-out recording: errors and the verdict on the prediction may depend on it, and nothing else."""


def slider_motion(
    recording: Recording,
    effort: np.ndarray,
    slider: float,
    *,
    lowpass: float,
    order: int,
    dead_band: float,
    trim: int,
    recorded_velocity: bool = False,
    sliding_means: tuple[int, int] | None = None,
) -> SliderMotion:
    """Return a recording low-passed at full rate with one zero-phase filter, thinned, and differentiated.

    `effort` (n,) is the joint's [N m]; `slider` the carriage's place [m]; `lowpass` a cut-off [Hz]; `dead_band` a speed
    below which samples are not scored [rad/s]; `trim` samples at either end are not scored either.

    With `sliding_means`, numbers of samples, effort goes through a centred mean of the first and position (and a
    recorded velocity) through one of the second instead. Two filters on one equation delay nothing, but one side loses
    more than the other.
    """
    fs = recording.fs
    cutoff = lowpass if sliding_means is None else SLIDING_MEAN_CUTOFF * fs / max(sliding_means)
    recorded = (recording["velocity"],) if recorded_velocity else ()
    thin = max(int(fs / (SAMPLES_PER_LOWPASS_PERIOD * cutoff)), 1)
    if sliding_means is not None:
        thin = max(min(thin, int(min(sliding_means) / SAMPLES_PER_LOWPASS_PERIOD)), 1)
    samples, rate = np.column_stack([recording["position"], effort, *recorded]), fs / thin
    spans = [span for span in recording.spans if span.stop - span.start >= 60 * thin]
    if not spans:
        raise RecordingError(
            f"{recording.path}: {len(recording)} samples ({len(recording) / fs:.3g} s); expected at least "
            f"{60 * thin / fs:.3g} s without a cut with a low-pass of {cutoff:g} Hz"
        )

    def filtered_span(part: np.ndarray) -> np.ndarray:
        if sliding_means is None:
            return zero_phase_lowpass(part, cutoff, order, fs)
        of_effort, of_motion = sliding_means
        made = sliding_mean(part, of_motion)
        made[:, 1] = sliding_mean(part[:, 1], of_effort)
        return made

    try:
        filtered = [filtered_span(samples[span])[::thin] for span in spans]
    except ValueError as error:
        raise RecordingError(f"{recording.path}: {error}") from None
    both = np.concatenate(filtered)
    rates = [part[:, 2] if recorded else derivative(part[:, 0], rate) for part in filtered]
    velocity, acceleration = np.concatenate(rates), np.concatenate([derivative(part, rate) for part in rates])
    scored = np.abs(velocity) > dead_band
    border, joint = round(trim / thin), 0
    scored[:border] = False
    scored[len(scored) - border :] = False
    for part in filtered[:-1]:
        joint += len(part)
        # What a model makes of velocity's sign is filtered over the joint: as long as a filter remembers is not scored.
        memory = max(border, round(rate / cutoff))
        scored[max(joint - memory, 0) : joint + memory] = False
    return (SliderMotion if recording.use == "fit" else JudgedSliderMotion)(
        recording=recording.name,
        protocol=recording.protocol or "",
        split="fitted" if recording.use == "fit" else "heldout",
        slider=slider,
        fs=rate,
        position=both[:, 0],
        velocity=velocity,
        acceleration=acceleration,
        effort=both[:, 1],
        lowpass=cutoff,
        order=order,
        scored=scored,
        effort_mean=None if sliding_means is None else max(round(sliding_means[0] / thin), 1),
    )


def derivative(samples: np.ndarray, fs: float) -> np.ndarray:
    """Derivative by central differences over five samples (error of order four), over three at the borders.
    `samples` (n,); `fs` [Hz]; gives (n,)."""
    rate = np.gradient(samples, 1.0 / fs)
    rate[2:-2] = (8.0 * (samples[3:-1] - samples[1:-3]) - (samples[4:] - samples[:-4])) * (fs / 12.0)
    return rate


def find_turns(position: np.ndarray) -> list[tuple[int, int, int]]:
    """Find the reversals of a motion, shape (n,) [rad], that move by more than the band on either side.

    Each is given by three samples: start of the band, turning point, end of the band. The first reversal is excluded,
    because the deflection of the contacts before it is unknown.
    """
    found, far, up = [], 0, None
    for k, here in enumerate(position):
        if up is None:
            if abs(here - position[0]) > TRAVEL_SEARCH.turn_band_rad:
                far, up = k, here > position[0]
        elif (here > position[far]) == up:
            far = k
        elif abs(here - position[far]) > TRAVEL_SEARCH.turn_band_rad:
            before = np.flatnonzero(np.abs(position[:far] - position[far]) > TRAVEL_SEARCH.turn_band_rad)
            if len(before):
                found.append((int(before[-1]), far, k))
            far, up = k, not up
    return found[1:]


def travel_of_turn(position: np.ndarray, velocity: np.ndarray, effort: np.ndarray, turn: int) -> float:
    """Return the travel that explains one reversal best [rad].

    `position`, `velocity` and `effort`, each of shape (n,), are the samples around it, and `turn` is its sample.
    """
    kept = (np.abs(position - position[turn]) < TRAVEL_SEARCH.kept_band_share * TRAVEL_SEARCH.turn_band_rad) | (
        np.arange(len(position)) > turn
    )
    plain = np.column_stack([np.ones(len(position)), position - position[turn], velocity])

    def left(travel: float) -> float:
        s = _core.presliding(travel, position)
        columns = np.column_stack([plain, np.maximum(s, 0.0), np.minimum(s, 0.0)])[kept]
        return float(np.sum((effort[kept] - columns @ np.linalg.lstsq(columns, effort[kept], rcond=None)[0]) ** 2))

    tried = np.geomspace(TRAVEL_SEARCH.min_travel_rad, TRAVEL_SEARCH.max_travel_rad, TRAVEL_SEARCH.candidate_count)
    best = int(np.argmin([left(x) for x in tried]))
    ends = np.log(tried[[max(best - 1, 0), min(best + 1, TRAVEL_SEARCH.candidate_count - 1)]])
    return float(np.exp(minimise_on_interval(lambda x: left(np.exp(x)), *ends)))


def presliding_travel(recorded: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> Parameter | None:
    """Estimate the presliding travel from slow reversals; None if there are too few of them.

    Each recording is a position [rad] and an effort, both of shape (n,), with their rate [Hz].
    """
    found = []
    for position, effort, fs in recorded:
        thin = max(int(fs / (13.0 * TRAVEL_SEARCH.lowpass_hz)), 1)
        q, tau = (zero_phase_lowpass(x, TRAVEL_SEARCH.lowpass_hz, 2, fs)[::thin] for x in (position, effort))
        velocity = np.gradient(q) * (fs / thin)
        for first, turn, last in find_turns(q):
            part = slice(first, last)
            found.append(travel_of_turn(q[part], velocity[part], tau[part], turn - first))
    if len(found) < TRAVEL_SEARCH.min_turn_count:
        return None
    low, high = _median_interval(np.sort(found))
    value = float(np.median(found))
    # A card's interval is symmetric. The wider half of the interval is used, so that no law underestimates the travel.
    error = max(high - value, value - low) / 1.959964
    return Parameter("presliding_travel", "rad", value, error, at_bound=value < 2.0 * TRAVEL_SEARCH.min_travel_rad)


def _median_interval(ordered: np.ndarray) -> tuple[float, float]:
    """Return the distribution-free 95 % interval of the median of `ordered`, from order statistics."""
    from scipy.stats import binom

    n = len(ordered)
    k = int(binom.ppf(0.025, n, 0.5))
    return float(ordered[max(k - 1, 0)]), float(ordered[min(n - k, n - 1)])


SLIDER_METHODS: Mapping[str, str] = {
    "pooled": "three steps, one set of parameters",
    "dissociated": "three steps, one set for each direction",
    "pooled_at_once": "all at once, one set",
    "dissociated_at_once": "all at once, one set for each direction",
    "consistent": "one coherent body, friction by direction",
    "load": "one coherent body, friction by direction and load",
}
"""Methods in the order of every table: the published model fitted in four ways, and two physically consistent
models."""


@dataclass(frozen=True)
class SliderEstimate:
    """The model of the joint that one method estimates."""

    method: str  # one of `SLIDER_METHODS`
    model: DirectionalSliderModel | SliderJointModel
    values: np.ndarray  # (p,) free parameters, SI
    parameters: tuple[Parameter, ...]  # the same parameters with their standard errors
    covariance: np.ndarray  # (p, p)
    samples: int  # number of rows of the regression
    residual_sd: float  # standard deviation of the residual [N*m]
    notes: tuple[str, ...] = ()  # sentences on active bounds
    # (p, p) part of the covariance due to coloured residuals alone; None if there is no other part
    statistical: np.ndarray | None = None

    def __getitem__(self, name: str) -> Parameter:
        return named(self.parameters, name, "this estimate")


@dataclass(frozen=True)
class TrialError:
    """Prediction errors of one method in one trial."""

    recording: str
    protocol: str
    split: str
    slider: float  # position of the carriage [m]
    current: float  # mean absolute error of the current, equation 6 [A]
    torque: float  # mean absolute error of the torque at the joint [N*m]
    torque_rms: float  # root mean square error of the torque [N*m]
    bias: float  # mean error of the torque [N*m]


@dataclass(frozen=True)
class SliderFit:
    """The identified joint with a carriage."""

    study: str
    lifts: str
    gain: float  # torque at the joint per ampere [N*m/A]
    rail: tuple[float, float]  # ends of the rail [m]
    geometry: Geometry = field(repr=False)
    static: tuple[Parameter, ...]  # gravity and mean torque of sticking, from static trials
    estimates: Mapping[str, SliderEstimate]  # estimates by method
    errors: Mapping[str, tuple[TrialError, ...]] = field(repr=False)  # errors by method, for every moving recording
    motions: tuple[SliderMotion, ...] = field(repr=False)
    verdicts: tuple[Verdict, ...]
    filter_note: str
    checksums: Mapping[str, str] = field(repr=False, default_factory=dict)
    travel: Parameter | None = None  # presliding travel; None where the recordings do not show it
    # Place of the wearer's axis beside the robot's, by recording with a free carriage
    axis_offsets: Mapping[str, AxisOffset] = field(default_factory=dict)

    def __getitem__(self, method: str) -> SliderEstimate:
        return self.estimates[method]

    @property
    def sets(self) -> DirectionalSliderModel:
        """Model of the three steps with a set of parameters for each direction."""
        model = self["dissociated"].model
        assert isinstance(model, DirectionalSliderModel)
        return model

    def body(self, method: str) -> SliderJointModel:
        """Return the model of one coherent body by a `method`."""
        model = self[method].model
        assert isinstance(model, SliderJointModel)
        return model

    @property
    def evaluated_split(self) -> str:
        """Split on which methods are evaluated: "heldout" if any held-out trial has an error, else "fitted"."""
        held = any(e.split == "heldout" and np.isfinite(e.current) for errors in self.errors.values() for e in errors)
        return "heldout" if held else "fitted"

    def evaluated(self, method: str) -> tuple[TrialError, ...]:
        """Return a method's errors in the trials of `evaluated_split`; trials without motion have none."""
        split = self.evaluated_split
        return tuple(e for e in self.errors[method] if e.split == split and np.isfinite(e.current))

    def evaluated_error(self, method: str) -> float:
        """Return the mean over those trials of the mean absolute current error [A]; NaN if there are none."""
        return float(np.mean([e.current for e in self.evaluated(method)] or [np.nan]))


STEP_PROTOCOLS = ("constant_velocity", "swept_sine")
"""Protocols that steps 2 and 3 are fitted to; the coherent body is fitted to both."""

MAX_STEADY_ACCELERATION = 0.5
"""Below this acceleration a velocity counts as constant [rad/s^2]."""

PARAMETER_NAMES = tuple(UNITS)
"""Names of the model's parameters, in its order."""

LOWER_BOUNDS = np.array([0.0 if is_friction(name) else -np.inf for name in PARAMETER_NAMES])
"""Lower bounds of the parameters: friction is not negative."""

DIRECTION_NAMES = ("up", "down")
"""Suffixes of the parameters where there is a set for each direction."""


def static_set(motions: Sequence[SliderMotion]) -> tuple[Parameter, ...]:
    """Run step 1: estimate gravity and the mean torque of sticking from the means of all holds.

    The parameters' units are [kg], [kg*m], [kg*m] and [N*m].
    """
    at = [(m, rest) for m in motions for rest in m.holds()]
    if len(at) < 8:
        raise IdentificationError(
            f"static trials: found {len(at)} holds of 2 s or more, expected at least 8 at several angles"
        )
    q = np.array([m.position[rest].mean() for m, rest in at])
    x = np.array([m.slider for m, _ in at])
    effort = np.array([m.effort[rest].mean() for m, rest in at])
    sine = GRAVITY * np.sin(q)
    w = np.column_stack([x * sine, sine, GRAVITY * np.cos(q), np.ones(len(q))])
    require_full_rank(("moment_slope", "moment", "cross_moment", "adherence"), w, "static trials")
    values = np.linalg.lstsq(w, effort, rcond=None)[0]
    rest = effort - w @ values
    covariance = sandwich_covariance(w, rest, [len(rest)])
    units = ("kg", "kg*m", "kg*m", "N*m")
    names = ("moment_slope", "moment", "cross_moment", "adherence")
    return make_parameters(names, units, values, covariance)


def three_steps(motions: Sequence[SliderMotion], *, dissociated: bool, method: str = "") -> SliderEstimate:
    """Run steps 2 and 3 of the published identification."""
    steady, swept = ([m for m in motions if m.protocol == step] for step in STEP_PROTOCOLS)
    require_both_directions(steady)
    require_places(steady)
    copies = 2 if dissociated else 1
    moving = slice(GRAVITY_TERMS.start, FRICTION_TERMS.stop)
    w, effort, lengths = _rows(steady, dissociated, lambda m: np.abs(m.acceleration) < MAX_STEADY_ACCELERATION)
    found2, cov2 = _solve(_terms(w, moving), effort, lengths, moving, "constant velocities")
    samples = len(effort)
    w, effort, lengths = _rows(swept, dissociated)
    left, inertia = effort - _terms(w, moving) @ found2, _terms(w, INERTIA_TERMS)
    found3, cov3 = _solve(inertia, left, lengths, INERTIA_TERMS, "swept sines")
    sets = [np.concatenate([a, b]) for a, b in zip(np.split(found2, copies), np.split(found3, copies), strict=True)]
    covariance = np.zeros((8 * copies, 8 * copies))
    for i in range(copies):
        for j in range(copies):
            block = covariance[8 * i : 8 * i + 8, 8 * j : 8 * j + 8]
            block[:5, :5] = cov2[5 * i : 5 * i + 5, 5 * j : 5 * j + 5]
            block[5:, 5:] = cov3[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
    return _estimate(method, sets, covariance, samples + len(left), left - inertia @ found3)


def all_at_once(motions: Sequence[SliderMotion], *, dissociated: bool, method: str = "") -> SliderEstimate:
    """Fit the same model in one regression over motions that excite all of its terms."""
    require_both_directions(motions)
    require_places(motions)
    copies = 2 if dissociated else 1
    w, effort, lengths = _rows(motions, dissociated)
    values, covariance = _solve(w, effort, lengths, slice(0, len(PARAMETER_NAMES)), "all at once")
    return _estimate(method, np.split(values, copies), covariance, len(effort), effort - w @ values)


def require_both_directions(motions: Sequence[SliderMotion]) -> None:
    """Refuse motions that do not move in both directions."""
    if not motions:
        raise IdentificationError(
            'no recording of protocol "constant_velocity" or "swept_sine" is marked use = "fit"; the three steps need '
            "both"
        )
    up = sum(int(np.sum(m.scored & (m.velocity > 0.0))) for m in motions)
    down = sum(int(np.sum(m.scored & (m.velocity < 0.0))) for m in motions)
    if min(up, down) < 0.1 * max(up, down, 1):
        missing = "downward (negative)" if down < up else "upward (positive)"
        names = ", ".join(m.recording for m in motions[:3]) + (", ..." if len(motions) > 3 else "")
        raise IdentificationError(
            f"{names}: found {up} samples moving up and {down} moving down, expected both directions; "
            f"the {missing} one is missing, or the position's sign changes between recordings"
        )


def require_places(motions: Sequence[SliderMotion], least: float = 0.02) -> None:
    """Refuse carriage positions that do not separate the terms in x and x squared; `least` is their range [m]."""
    places = np.array([m.slider for m in motions])
    distinct = np.unique(np.round(places / 0.005)).size
    if distinct < 3 or np.ptp(places) < least:
        raise IdentificationError(
            f"slider positions do not vary: found {distinct} within {1e3 * np.ptp(places):.3g} mm "
            f"({', '.join(m.recording for m in motions[:3])}, ...), expected at least 3 over {1e3 * least:g} mm or more"
        )


def directional_columns(motion: SliderMotion) -> np.ndarray:
    """Return the torque per unit of each parameter of the up set, then of the down set, shape (n, 16).

    The states are already filtered, so terms that are smooth in them are not filtered again. Only the terms that jump
    with the direction pass the filter of the effort. Equal sets for both directions give the model without directions.
    """
    whole = columns(motion.position, motion.velocity, motion.acceleration, motion.slider)
    jumps = motion.smooth(whole * np.where(motion.velocity > 0.0, 1.0, -1.0)[:, None])
    whole[:, 3] = motion.smooth(whole[:, 3])  # dry friction jumps in both sets
    return 0.5 * np.column_stack([whole + jumps, whole - jumps])


def _rows(motions, dissociated, also=None) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Return the filtered regressor of one or two sets, the effort, and the number of samples of each motion."""
    w, y, lengths = [], [], []
    for m in motions:
        filtered = directional_columns(m)
        if not dissociated:
            filtered = np.add(*np.split(filtered, 2, axis=1))
        at = np.flatnonzero(m.scored if also is None else m.scored & also(m))[::REGRESSION_STRIDE]
        w.append(filtered[at])
        y.append(m.effort[at])
        lengths.append(len(at))
    return np.concatenate(w), np.concatenate(y), lengths


def _terms(w: np.ndarray, terms: slice) -> np.ndarray:
    """Return the columns of some parameters, from every set."""
    sets = np.split(w, w.shape[1] // len(PARAMETER_NAMES), axis=1)
    return np.hstack([part[:, terms] for part in sets])


def _solve(w: np.ndarray, y: np.ndarray, lengths: list[int], terms: slice, where: str) -> tuple[np.ndarray, np.ndarray]:
    copies = w.shape[1] // (terms.stop - terms.start)
    names = [name + suffix for suffix in _suffixes(copies) for name in PARAMETER_NAMES[terms]]
    require_full_rank(names, w, where)
    lower, upper = np.tile(LOWER_BOUNDS[terms], copies), np.full(w.shape[1], np.inf)
    values = least_squares_within(w, y, lower, upper)
    return values, sandwich_covariance(w, y - w @ values, lengths)


def _suffixes(copies: int) -> tuple[str, ...]:
    """Return the suffixes of the parameters' names: the direction, if there is a set for each."""
    return tuple(f"_{d}" for d in DIRECTION_NAMES) if copies == 2 else ("",)


def _estimate(method, sets, covariance, samples, residual) -> SliderEstimate:
    model = DirectionalSliderModel(up=sets[0], down=sets[-1])
    values = np.concatenate(sets)
    suffixes = _suffixes(len(sets))
    names = [name + suffix for suffix in suffixes for name in PARAMETER_NAMES]
    near = 1e-3 * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    held = values - np.tile(LOWER_BOUNDS, len(sets)) <= near
    notes = [f"{name} is held at its physical bound, 0" for name, bound in zip(names, held, strict=True) if bound]
    for direction, values_ in zip(suffixes, sets, strict=True):
        if values_[7] < 0.0:
            notes.append(f"a2{direction} is negative: no mass has such an inertia")
    return SliderEstimate(
        method=method,
        model=model,
        values=values,
        parameters=make_parameters(names, list(UNITS.values()) * len(sets), values, covariance, held),
        covariance=covariance,
        samples=samples,
        residual_sd=float(np.std(residual)),
        notes=tuple(notes),
    )


FIRST_LOAD_COEFFICIENT = 0.05
"""First value of the load-friction coefficients in the search."""

MAX_RELINEARISATIONS = 12
"""Largest number of relinearisations under the consistency conditions."""


@with_one_blas_thread
def fit_coherent(
    model: SliderJointModel,
    motions: Sequence[SliderMotion],
    *,
    rail: tuple[float, float],
    mass: float | None = None,
    start: np.ndarray | None = None,
) -> SliderEstimate:
    """Fit a `model` to `motions` by bounded least squares.

    If no body could have the estimated inertia and gravity, the nearest consistent parameters are taken: for a carriage
    on a `rail` [m] and a mass of at most `mass` [kg]. `start`, shape (p,), is the first value of a nonlinear family.
    """

    require_both_directions(motions)
    require_places(motions)
    if start is None:
        start = np.array(
            [FIRST_LOAD_COEFFICIENT if n.startswith("load") else 0.1 if n == "inertia" else 0.0 for n in model.names]
        )
    data = stack(motions)
    found = solve(model, data, start=start)
    values, held, notes = found.values, found.at_bound, []
    if np.min(model.gaps(values, rail, mass)) < 0.0:
        values = _nearest_possible_body(model, values, data, rail, mass)
        notes.append("inertia and gravity are held where a body of these masses can have them")
    w, residual = found.jacobian, found.residual
    if notes or held.any():  # the values are not those of the search's last step
        w, effort = regression_rows(model, values, data)
        residual = data.target - effort
    if notes:
        held = snap_to_bounds(values, *model.bounds(), w, residual)[1]
    statistical = sandwich_covariance(w, residual, data.lengths)
    slowest = min(float(np.abs(m.velocity[m.scored]).min(initial=np.inf)) for m in data.motions)

    def load(motion: SliderMotion, position: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        slider = np.asarray(motion.slider)
        return model.inertia(values, slider) * acceleration + model.gravity(values, slider, position)

    states = collect_states(data, True, load, slowest)
    lacking = estimate_discrepancy(model.names, values, w, residual, states, statistical)
    covariance = statistical + lacking.covariance
    units = [model.unit(n) for n in model.names]
    parameters = make_parameters(
        model.names, units, values, covariance, held, statistical=statistical, causes=lacking.causes
    )
    notes += [
        f"{n} is held at its physical bound, {v:.3g}" for n, v, h in zip(model.names, values, held, strict=True) if h
    ]
    return SliderEstimate(
        method=model.family,
        model=model,
        values=values,
        parameters=tuple(replace(p, carried=lacking.carried.get(p.name)) for p in parameters),
        covariance=covariance,
        samples=len(residual),
        residual_sd=float(np.std(residual)),
        notes=tuple(notes),
        statistical=statistical,
    )


def _nearest_possible_body(
    model: SliderJointModel,
    values: np.ndarray,
    data: Stack[SliderMotion],
    rail: tuple[float, float],
    mass: float | None,
) -> np.ndarray:
    """Return the nearest consistent parameters, in the metric of the residuals."""

    lower, upper = model.bounds()
    best = None
    for _ in range(1 if model.linear else MAX_RELINEARISATIONS):
        w, effort = regression_rows(model, values, data)
        inside = _consistent_start(model, np.clip(values, lower, upper), rail, mass)
        unit = model.inertia(inside, np.array(rail)).max()
        found, said = nearest_feasible(
            w,
            data.target - effort,
            values,
            (lower, upper),
            partial(_scaled_room, model, rail, mass, unit),
            inside,
        )
        if np.min(model.gaps(found, rail, mass)) < -1e-6:
            raise IdentificationError(
                f"no possible body found near these recordings ({said}): check the signs of position and current, and "
                "the mass"
            )
        if best is None:
            best, least = found, _misfit(model, found, data)
        else:
            step, misfit = 1.0, _misfit(model, found, data)
            while misfit > least and step > 1e-3:  # consistent bodies form a convex set, so shorter steps stay in it
                step *= 0.5
                misfit = _misfit(model, best + step * (found - best), data)
            if misfit >= least:
                break
            best, least = best + step * (found - best), misfit
        values = best
    return values


def _scaled_room(
    model: SliderJointModel, rail: tuple[float, float], mass: float | None, unit: float, values: np.ndarray
) -> np.ndarray:
    """Return the conditions of consistency, divided by the inertia `unit`, (k,)."""
    return model.room(values, rail, mass) / unit


def _misfit(model: SliderJointModel, values: np.ndarray, data: Stack[SliderMotion]) -> float:
    effort = data.reduced([model.effort(values, m) for m in data.motions])
    return float(np.sum((data.target - effort) ** 2))


def _consistent_start(
    model: SliderJointModel, values: np.ndarray, rail: tuple[float, float], mass: float | None
) -> np.ndarray:
    """Return a consistent starting point: the values with more inertia and at least some mass of the carriage."""
    values = values.copy()
    if "carriage_mass" in model.names:
        at = model.names.index("carriage_mass")
        values[at] = max(values[at], 0.05)
    at = model.names.index("inertia")
    values[at] = max(values[at], 1e-4)
    while np.min(model.gaps(values, rail, mass)) < 0.0 and values[at] < 1e6:
        values[at] *= 1.5
    return values
