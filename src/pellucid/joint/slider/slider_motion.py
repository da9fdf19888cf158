"""Recordings of a joint with a carriage made ready: filtered once at full rate, then few enough samples to be quick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ... import _core
from ..._errors import RecordingError
from ...files.recording import Recording
from ...models.estimates import Parameter
from ...numerics.filters import runs, sliding_mean, zero_phase_lowpass
from ...numerics.motion import JudgedData

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
    def time(self) -> np.ndarray:
        """Time of the kept samples, shape (n,) [s]."""
        return np.arange(len(self.position)) / self.fs

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


LOWPASS_HZ = 15.0
"""Cut-off of the low-pass on position and effort. A joint breaks away within a tenth of a second."""

TURN_BAND_RAD = 12e-3
"""Range of motion on either side of a reversal that is used. The largest travel is less than half of it."""

MIN_TRAVEL_RAD = 2e-5
"""Smallest travel that is tried, below the resolution of most encoders."""

MAX_TRAVEL_RAD = 4.8e-3
"""Largest travel that is tried."""

TRAVEL_CANDIDATE_COUNT = 25
"""Number of travels that are tried before the search is refined."""

KEPT_BAND_SHARE = 0.6
"""Last share of the band before a reversal that is fitted. Before it, some contacts are not yet dragged along."""

MIN_TURN_COUNT = 6
"""Smallest number of reversals, from which the median has a 95 % interval."""


def find_turns(position: np.ndarray) -> list[tuple[int, int, int]]:
    """Find the reversals of a motion, shape (n,) [rad], that move by more than the band on either side.

    Each is given by three samples: start of the band, turning point, end of the band. The first reversal is excluded,
    because the deflection of the contacts before it is unknown.
    """
    found, far, up = [], 0, None
    for k, here in enumerate(position):
        if up is None:
            if abs(here - position[0]) > TURN_BAND_RAD:
                far, up = k, here > position[0]
        elif (here > position[far]) == up:
            far = k
        elif abs(here - position[far]) > TURN_BAND_RAD:
            before = np.flatnonzero(np.abs(position[:far] - position[far]) > TURN_BAND_RAD)
            if len(before):
                found.append((int(before[-1]), far, k))
            far, up = k, not up
    return found[1:]


def travel_of_turn(position: np.ndarray, velocity: np.ndarray, effort: np.ndarray, turn: int) -> float:
    """Return the travel that explains one reversal best [rad].

    `position`, `velocity` and `effort`, each of shape (n,), are the samples around it, and `turn` is its sample.
    """
    kept = (np.abs(position - position[turn]) < KEPT_BAND_SHARE * TURN_BAND_RAD) | (np.arange(len(position)) > turn)
    plain = np.column_stack([np.ones(len(position)), position - position[turn], velocity])

    def left(travel: float) -> float:
        s = _core.presliding(travel, position)
        columns = np.column_stack([plain, np.maximum(s, 0.0), np.minimum(s, 0.0)])[kept]
        return float(np.sum((effort[kept] - columns @ np.linalg.lstsq(columns, effort[kept], rcond=None)[0]) ** 2))

    from scipy.optimize import minimize_scalar

    tried = np.geomspace(MIN_TRAVEL_RAD, MAX_TRAVEL_RAD, TRAVEL_CANDIDATE_COUNT)
    best = int(np.argmin([left(x) for x in tried]))
    ends = np.log(tried[[max(best - 1, 0), min(best + 1, TRAVEL_CANDIDATE_COUNT - 1)]])
    return float(np.exp(minimize_scalar(lambda x: left(np.exp(x)), bounds=tuple(ends), method="bounded").x))


def presliding_travel(recorded: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> Parameter | None:
    """Estimate the presliding travel from slow reversals; None if there are too few of them.

    Each recording is a position [rad] and an effort, both of shape (n,), with their rate [Hz].
    """
    found = []
    for position, effort, fs in recorded:
        thin = max(int(fs / (13.0 * LOWPASS_HZ)), 1)
        q, tau = (zero_phase_lowpass(x, LOWPASS_HZ, 2, fs)[::thin] for x in (position, effort))
        velocity = np.gradient(q) * (fs / thin)
        for first, turn, last in find_turns(q):
            part = slice(first, last)
            found.append(travel_of_turn(q[part], velocity[part], tau[part], turn - first))
    if len(found) < MIN_TURN_COUNT:
        return None
    low, high = _median_interval(np.sort(found))
    value = float(np.median(found))
    # A card's interval is symmetric. The wider half of the interval is used, so that no law underestimates the travel.
    error = max(high - value, value - low) / 1.959964
    return Parameter("presliding_travel", "rad", value, error, at_bound=value < 2.0 * MIN_TRAVEL_RAD)


def _median_interval(ordered: np.ndarray) -> tuple[float, float]:
    """Return the distribution-free 95 % interval of the median of `ordered`, from order statistics."""
    from scipy.stats import binom

    n = len(ordered)
    k = int(binom.ppf(0.025, n, 0.5))
    return float(ordered[max(k - 1, 0)]), float(ordered[min(n - k, n - 1)])
