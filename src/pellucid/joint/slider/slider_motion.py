"""Recordings of a joint with a carriage made ready: filtered once at full rate, then few enough samples to be quick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import RecordingError
from ...files.recording import Recording
from ...numerics.filters import runs, sliding_mean, zero_phase_lowpass
from ...numerics.judged import JudgedData

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
