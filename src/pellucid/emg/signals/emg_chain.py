"""From raw EMG to an envelope: chains of stages, applied without delay, causally, or sample by sample.

A chain says what is done in which order and nothing of the rate: that comes with the samples. Filters are second-order
sections throughout; the direct form of order 4 loses its accuracy where the cut-off is a thousandth of the rate.

What a chain guarantees:

- An envelope is never negative. A low-pass of rectified samples undershoots behind a burst, and is cut off at 0.
- A part of a recording (`inside`) is filtered together with the samples on either side of it, as far as the filters
  remember, and cut out afterwards: its ends are as good as its middle.
- Where a file begins or ends, filters that run both ways see the samples mirrored there, for as long as they take to
  settle. Rectified samples are mirrored as they are, which keeps their level; raw ones about the last sample.

Delay of a causal EMG chain, computed from its filters' coefficients.

EMG over an array to envelopes, by one of the published chains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ... import _core
from ..._errors import RecordingError
from ...numerics.arguments import with_checked_arguments
from ...numerics.low_pass import butterworth_band, settled


@dataclass(frozen=True)
class ChainDelay:
    """Parts of a causal chain's delay."""

    carrier: float  # delay of the filters before rectification, at the carrier's frequency [s]
    envelope: float  # delay of the filters after rectification, for slow changes [s]
    advance: float  # time by which EMG is shifted on purpose [s]

    @property
    def filters(self) -> float:
        """Delay of all filters [s]."""
        return self.carrier + self.envelope


def group_delay(sos: np.ndarray, frequency: float, fs: float) -> float:
    """Return the group delay of second-order sections at one frequency [s], in closed form.

    Each polynomial p(z) = p0 + p1/z + p2/z² has the delay Re(sum k pk z^-k / sum pk z^-k); a numerator counts, a
    denominator counts against.

    `sos` (k, 6); `frequency`, `fs` [Hz]; gives [s].
    """
    powers = np.exp(-2j * np.pi * frequency / fs * np.arange(3))
    steps = np.arange(3)

    def delay(p: np.ndarray) -> float:
        return float(np.real(np.sum(steps * p * powers) / np.sum(p * powers)))

    return sum(delay(row[:3]) - delay(row[3:]) for row in np.asarray(sos)) / fs


FILTER_STAGES = ("notch", "highpass", "lowpass", "bandpass")
"""Stages that are linear filters."""

STAGE_KINDS = (*FILTER_STAGES, "centre", "rectify", "rms", "normalise", "advance")

SETTLED_SHARE = 1e-4
"""Share of a filter's impulse response that is left when the filter counts as settled."""


@dataclass(frozen=True)
class Stage:
    """One step of a chain."""

    # ``"notch"``, ``"highpass"``, ``"lowpass"`` or ``"bandpass"`` (Butterworth but for the notch); ``"centre"`` (less
    # the mean), ``"rectify"`` (full wave), ``"rms"`` (root mean square of a window), ``"normalise"`` (by the largest
    # value) or ``"advance"`` (each sample is compared with a motion that comes later)
    kind: str
    cutoff: tuple[float, ...] = ()  # -3 dB frequencies of one pass, or the notch's centre [Hz]
    order: int = 2  # order of one pass, as filter design functions take it: a band-pass then has twice as many poles
    quality: float = 30.0  # quality factor of the notch: centre frequency divided by width
    seconds: float = 0.0  # shift to match the motion that follows, or length of the window of ``"rms"`` [s]

    def __post_init__(self):
        expected = {"notch": 1, "highpass": 1, "lowpass": 1, "bandpass": 2}.get(self.kind, 0)
        if self.kind not in STAGE_KINDS:
            raise RecordingError(f"EMG chain: found the stage {self.kind!r}, expected one of {', '.join(STAGE_KINDS)}")
        if (
            len(self.cutoff) != expected
            or any(c <= 0.0 for c in self.cutoff)
            or list(self.cutoff) != sorted(set(self.cutoff))
        ):
            raise RecordingError(
                f"EMG chain, {self.kind}: found the cut-offs {list(self.cutoff)}, expected {expected}, above 0, rising"
            )
        if self.seconds < 0.0 or self.order < 1:
            raise RecordingError(
                f"EMG chain, {self.kind}: found {self.seconds:g} s and order {self.order}, expected at least 0 and 1"
            )

    def sections(self, fs: float) -> np.ndarray:
        """Second-order sections at a rate of `fs` [Hz]; shape (k, 6), none for what is no filter."""
        return _sections(self, fs).copy()

    def settling(self, fs: float) -> int:
        """Samples at `fs` [Hz] until the filter's impulse response has settled, by its slowest pole; 0 of no filter."""
        return settling_samples(self.sections(fs))


@lru_cache(maxsize=64)
def _sections(stage: Stage, fs: float) -> np.ndarray:
    if stage.kind == "notch":
        return scipy.signal.tf2sos(*scipy.signal.iirnotch(stage.cutoff[0], stage.quality, fs=fs))
    if stage.kind == "bandpass":
        return butterworth_band(stage.order, *(2.0 * edge / fs for edge in stage.cutoff))
    if stage.kind in FILTER_STAGES:
        return scipy.signal.butter(stage.order, stage.cutoff[0], stage.kind, fs=fs, output="sos")
    return np.empty((0, 6))


@dataclass(frozen=True)
class EmgChain:
    """Stages in the order in which samples pass them."""

    name: str
    stages: tuple[Stage, ...]
    source: str = ""  # Where it was published, and what had to be decided where that is silent

    def with_mains(self, mains: float) -> EmgChain:
        """Return the same chain with a notch at the frequency of the `mains` [Hz], at its beginning."""
        notch = next((s for s in self.stages if s.kind == "notch"), Stage("notch", (float(mains),)))
        others = tuple(s for s in self.stages if s.kind != "notch")
        return replace(self, stages=(replace(notch, cutoff=(float(mains),)), *others))

    def with_band(self, low: float, high: float) -> EmgChain:
        """Return the same chain with another band of raw EMG, from `low` to `high` [Hz].

        It takes the place of the chain's band-pass or high-pass, and keeps its order.
        """
        place = next(i for i, stage in enumerate(self.stages) if stage.kind in ("bandpass", "highpass"))
        band = Stage("bandpass", (float(low), float(high)), order=self.stages[place].order)
        return replace(self, stages=(*self.stages[:place], band, *self.stages[place + 1 :]))

    def with_lowpass(self, cutoff: float | None = None, order: int | None = None) -> EmgChain:
        """Return the same chain with another low-pass, `cutoff` [Hz]; a chain without one needs the `cutoff`."""
        old = next((stage for stage in self.stages if stage.kind == "lowpass"), None)
        if old is None and cutoff is None:
            raise RecordingError(f"EMG chain {self.name}: found no low-pass, expected one to change")
        cutoffs = old.cutoff if old is not None and cutoff is None else (float(cutoff or 0.0),)
        return self._with_smoothing(Stage("lowpass", cutoffs, order=order or (old.order if old is not None else 2)))

    def with_rms_window(self, seconds: float) -> EmgChain:
        """Return the same chain with the root mean square of a window of `seconds` [s] instead of its low-pass."""
        if not seconds > 0.0:
            raise RecordingError(f"EMG chain {self.name}: found an RMS window of {seconds:g} s, expected more than 0")
        return self._with_smoothing(Stage("rms", seconds=float(seconds)))

    def _with_smoothing(self, smoothing: Stage) -> EmgChain:
        """Return the same chain with one stage between rectification and scale."""
        stages = [stage for stage in self.stages if stage.kind not in ("lowpass", "rms")]
        place = [stage.kind for stage in stages].index("rectify") + 1
        return replace(self, stages=(*stages[:place], smoothing, *stages[place:]))

    def settling(self, fs: float) -> int:
        """Samples at `fs` [Hz] by which the whole chain remembers or waits."""
        return sum(stage.settling(fs) + round(stage.seconds * fs) for stage in self.stages)

    def zero_phase(
        self, samples: np.ndarray, fs: float, *, maximum: float | None = None, inside: slice | None = None
    ) -> np.ndarray:
        """Envelope for analysis: every filter runs forwards and backwards, so that nothing is late. `samples` (n,)
        [V]; `fs` [Hz]; gives (n,), or the part `inside`, filtered with what lies around it."""
        return self._of_part([samples], fs, maximum, inside, causal=False)[0]

    def zero_phase_each(self, samples: Mapping[str, np.ndarray], fs: float, inside: slice) -> dict[str, np.ndarray]:
        """Return `zero_phase` of the part `inside` of each signal, (n,), by name; together they take less time."""
        self.require_rate(fs)
        reach, made = self.settling(fs), {}
        groups: dict[tuple[int, int], list[str]] = {}
        for name, x in samples.items():
            try:
                self._checked(x[inside], fs)
            except RecordingError as error:
                raise RecordingError(f"{name}: {error}") from None
            part = with_surroundings(x, inside, reach)
            groups.setdefault((part.start, part.stop), []).append(name)
        for names in groups.values():
            found = self._of_part([samples[name] for name in names], fs, None, inside, causal=False)
            made |= zip(names, found, strict=True)
        return {name: made[name] for name in samples}

    def causal(
        self, samples: np.ndarray, fs: float, *, maximum: float | None = None, inside: slice | None = None
    ) -> np.ndarray:
        """Envelope as it is had in real time: late by what `delay` says, from filters at rest. `samples` (n,) [V];
        `fs` [Hz]; gives (n,), or the part `inside`, filtered with what comes before it."""
        return self._of_part([samples], fs, maximum, inside, causal=True)[0]

    def _of_part(
        self, rows: list[np.ndarray], fs: float, maximum: float | None, inside: slice | None, *, causal: bool
    ) -> list[np.ndarray]:
        """Filter signals, (n,) each, or their part `inside`, around which they lack the same samples."""
        if inside is None:
            return self._run([self._checked(x, fs) for x in rows], fs, maximum, causal=causal)
        self.require_rate(fs)
        part = with_surroundings(rows[0], inside, self.settling(fs), later=not causal)
        rows = [self._checked(x[part], fs) for x in rows]
        own = slice(inside.start - part.start, inside.stop - part.start)
        if maximum is not None or causal or not any(stage.kind == "normalise" for stage in self.stages):
            return [x[own] for x in self._run(rows, fs, maximum, causal=causal)]
        # The largest value is that of the part itself.
        made = self._run(rows, fs, 1.0, causal=False)
        return [self._plain(Stage("normalise"), x[own], fs, None, causal=False) for x in made]

    def _run(self, rows: list[np.ndarray], fs: float, maximum: float | None, *, causal: bool) -> list[np.ndarray]:
        """Pass signals, (n,), through all stages: filters forwards, and backwards too if not `causal`."""
        rectified = False
        for stage in self.stages:
            rectified = rectified or stage.kind == "rectify"
            if stage.kind not in FILTER_STAGES:
                rows = [self._plain(stage, x, fs, maximum, causal=causal) for x in rows]
                continue
            rows = (
                [scipy.signal.sosfilt(stage.sections(fs), x) for x in rows]
                if causal
                else self._both_ways(stage, rows, fs, rectified)
            )
            rows = [np.maximum(x, 0.0) for x in rows] if rectified else rows
        return rows

    def _both_ways(self, stage: Stage, rows: list[np.ndarray], fs: float, rectified: bool) -> list[np.ndarray]:
        """Filter signals, (n,), forwards and backwards, mirrored at both ends for as long as the filter settles."""
        sos = stage.sections(fs)
        fewest = 3 * (2 * len(sos) + 1)
        if len(rows[0]) <= fewest:
            raise RecordingError(
                f"EMG chain {self.name}: found {len(rows[0])} samples, expected more than {fewest} for the "
                f"{stage.kind} of order {stage.order} run both ways"
            )
        padding = min(stage.settling(fs), len(rows[0]) - 1)
        if rectified:
            return [scipy.signal.sosfiltfilt(sos, x, padtype="even", padlen=padding) for x in rows]
        return [*np.ascontiguousarray(_core.zero_phase(sos, settled(sos), np.column_stack(rows), padding).T)]

    def stream(self, fs: float, *, maximum: float | None = None) -> EmgStream:
        """The causal chain for samples that come one after another. `fs` [Hz]."""
        self.require_rate(fs)
        self._require_maximum(maximum, causal=True)
        return EmgStream(self, fs, maximum)

    def delay(self, fs: float, *, carrier: float = 100.0) -> ChainDelay:
        """By how much the causal chain is late, from its filters' coefficients. `fs` [Hz]; `carrier` [Hz]."""
        self.require_rate(fs)
        rectified = self._rectified_at()
        before = sum(group_delay(s.sections(fs), carrier, fs) for s in self.stages[:rectified])
        after = sum(group_delay(s.sections(fs), 0.0, fs) for s in self.stages[rectified:])
        after += sum(0.5 * s.seconds for s in self.stages if s.kind == "rms")
        return ChainDelay(before, after, sum(s.seconds for s in self.stages if s.kind == "advance"))

    def require_rate(self, fs: float, where: str = "") -> None:
        """Do nothing for a rate that the chain's filters fit into. `fs` [Hz]."""
        highest = max((c for stage in self.stages for c in stage.cutoff), default=0.0)
        if not (np.isfinite(fs) and fs > 2.0 * highest):
            raise RecordingError(
                f"{where or f'EMG chain {self.name}'}: found a rate of {fs:g} Hz, expected more than {2 * highest:g} "
                f'Hz: the chain "{self.name}" filters at {highest:g} Hz'
            )

    def _rectified_at(self) -> int:
        return next((i for i, stage in enumerate(self.stages) if stage.kind == "rectify"), len(self.stages))

    def _checked(self, samples: np.ndarray, fs: float) -> np.ndarray:
        self.require_rate(fs)
        x = np.asarray(samples, dtype=np.float64)
        if x.ndim != 1 or len(x) < 2:
            raise RecordingError(f"EMG chain {self.name}: found shape {x.shape}, expected (n,) with at least 2 samples")
        missing = np.flatnonzero(~np.isfinite(x))
        if missing.size:
            raise RecordingError(
                f"EMG chain {self.name}: found {missing.size} missing samples (NaN), the first at index {missing[0]}, "
                "expected a number in every sample"
            )
        return x

    def _require_maximum(self, maximum: float | None, *, causal: bool) -> None:
        relative = any(stage.kind == "normalise" for stage in self.stages)
        if relative and causal and maximum is None:
            raise RecordingError(
                f"EMG chain {self.name}: found no maximum, expected the largest envelope of a maximal contraction: a "
                "causal chain cannot know what is still to come"
            )
        if maximum is not None and not (np.isfinite(maximum) and maximum > 0.0):
            raise RecordingError(f"EMG chain {self.name}: found the maximum {maximum:g}, expected a number above 0")

    def _plain(self, stage: Stage, x: np.ndarray, fs: float, maximum: float | None, *, causal: bool) -> np.ndarray:
        if stage.kind == "rectify":
            return np.abs(x)
        if stage.kind == "centre":
            # A causal chain's band-pass has left no mean; that of samples still to come is not known.
            return x if causal else x - x.mean()
        if stage.kind == "rms":
            return _window_rms(x, max(1, round(stage.seconds * fs)), causal=causal)
        if stage.kind == "advance":
            late = min(round(stage.seconds * fs), len(x))
            return np.concatenate((np.zeros(late), x[: len(x) - late]))
        self._require_maximum(maximum, causal=causal)
        top = float(np.max(x)) if maximum is None else maximum
        if not top > 0.0:
            raise RecordingError(f"EMG chain {self.name}: found no sample above 0, expected activity to make relative")
        return x / top


class EmgStream:
    """A causal chain at work: state is kept from sample to sample, in the core's filters.

    `EmgChain.stream` makes it. A sample that is not a number passes through, and the filters start again at rest.
    """

    def __init__(self, chain: EmgChain, fs: float, maximum: float | None):
        self._steps: list = []
        for i, stage in enumerate(chain.stages):
            if stage.kind in FILTER_STAGES:
                self._steps.append(_core.Biquads(stage.sections(fs)))
                if any(earlier.kind == "rectify" for earlier in chain.stages[:i]):
                    # An envelope has no undershoot of a low-pass; NaN stays.
                    self._steps.append(lambda x: np.maximum(x, 0.0))
            elif stage.kind == "rms":
                self._steps.append(_WindowRms(max(1, round(stage.seconds * fs))))
            elif stage.kind == "advance":
                self._steps.append(_Wait(round(stage.seconds * fs)))
            elif stage.kind == "rectify":
                self._steps.append(np.abs)
            elif stage.kind == "normalise" and maximum is not None:  # `EmgChain.stream` requires it
                self._steps.append(lambda x: x / maximum)

    def filter(self, samples: np.ndarray) -> np.ndarray:
        """Envelope of the samples that come next. `samples` (n,) [V]; gives (n,)."""
        x = np.asarray(samples, dtype=np.float64)
        for step in self._steps:
            x = step(x) if callable(step) else step.filter(x)
        return np.asarray(x)

    def step(self, sample: float) -> float:
        """Envelope of one sample."""
        return float(self.filter(np.array([sample]))[0])

    def reset(self) -> None:
        """Back to filters at rest."""
        for step in self._steps:
            if hasattr(step, "reset"):
                step.reset()


def settling_samples(sections: np.ndarray) -> int:
    """Samples until the impulse response of second-order `sections`, (k, 6), has settled, by their slowest pole."""
    slowest = max((abs(root) for section in sections for root in np.roots(section[3:])), default=0.0)
    return int(np.ceil(np.log(SETTLED_SHARE) / np.log(slowest))) if slowest > 0.0 else 0


def with_surroundings(samples: np.ndarray, inside: slice, reach: int, *, later: bool = True) -> slice:
    """Return the slice `inside` of samples, (n,), extended by at most `reach` on either side, or before it alone.

    The extension stops at a missing sample (NaN).
    """
    start, stop = inside.start, inside.stop
    first, last = max(0, start - reach), min(len(samples), stop + (reach if later else 0))
    before, after = (np.flatnonzero(~np.isfinite(x)) for x in (samples[first:start], samples[stop:last]))
    return slice(first + int(before[-1]) + 1 if before.size else first, stop + int(after[0]) if after.size else last)


def _window_rms(x: np.ndarray, count: int, *, causal: bool) -> np.ndarray:
    """Return the root mean square of a window of `count` samples about each, or of the last ones, shape (n,).

    The window is shorter at the ends of `x`; a causal one sees zeros before the first sample.
    """
    total = np.concatenate(([0.0], np.cumsum(x * x)))
    at = np.arange(len(x))
    last = np.minimum(at + 1 + (0 if causal else count // 2), len(x))
    first = np.maximum(last - count, 0) if causal else np.maximum(at + 1 + count // 2 - count, 0)
    width = count if causal else last - first
    return np.sqrt(np.maximum(total[last] - total[first], 0.0) / width)


class _Memory:
    """The last `count` samples, zeros at first."""

    def __init__(self, count: int):
        self._kept = np.zeros(count)

    def _remember(self, x: np.ndarray) -> np.ndarray:
        """Return the remembered samples with those that come next behind them."""
        both = np.concatenate((self._kept, x))
        self._kept = both[len(x) :]
        return both

    def reset(self) -> None:
        self._kept = np.zeros(len(self._kept))


class _WindowRms(_Memory):
    """The root mean square of the last samples."""

    def filter(self, x: np.ndarray) -> np.ndarray:
        return _window_rms(self._remember(x), len(self._kept), causal=True)[len(self._kept) :]


class _Wait(_Memory):
    """A delay line."""

    def filter(self, x: np.ndarray) -> np.ndarray:
        return self._remember(x)[: len(x)]


EMG_CHAINS = {
    chain.name: chain
    for chain in (
        EmgChain(
            "able",
            (
                Stage("bandpass", (20.0, 450.0), order=4),
                Stage("centre"),
                Stage("rectify"),
                Stage("normalise"),
                Stage("advance", seconds=0.1),
            ),
            "Verdel et al. 2021: band-pass of order 4 from 20 to 450 Hz, centred, rectified, relative to the maximum "
            "of the experiment. EMG leads the motion by 0.1 s, which shifts its window. Order 4 is the argument of the "
            "filter design function: the filter has eight poles.",
        ),
        EmgChain(
            "knee",
            (Stage("bandpass", (10.0, 500.0), order=2), Stage("rectify"), Stage("lowpass", (2.0,), order=2)),
            "The thesis on the knee orthosis: band-pass from 10 to 500 Hz, rectified, low-pass at 2 Hz. It states no "
            "orders; 2 is assumed for both.",
        ),
        EmgChain(
            "hill",
            (
                Stage("notch", (50.0,), quality=30.0),
                Stage("highpass", (30.0,), order=4),
                Stage("rectify"),
                Stage("lowpass", (5.0,), order=4),
                Stage("normalise"),
            ),
            "The three-step Hill identification: notch at 50 Hz, high-pass at 30 Hz, rectified, low-pass at 5 Hz, "
            "normalised. It states neither the orders nor the width of the notch; order 4 and a quality factor of 30 "
            "are assumed.",
        ),
    )
}
"""Published filter chains of the three papers; `source` states each assumption about unstated settings."""


def emg_chain(
    name: str,
    mains: float | None = None,
    *,
    band: tuple[float, float] | None = None,
    lowpass: float | None = None,
    rms_window: float | None = None,
) -> EmgChain:
    """Return one of the published chains, changed where a study says so.

    Parameters
    ----------
    name : str
        One of `EMG_CHAINS`.
    mains : float, optional
        Frequency of the notch [Hz]. By default it is the published one, or there is none.
    band : tuple of float, optional
        Lowest and highest frequency of raw EMG [Hz]; by default the published band.
    lowpass : float, optional
        Cut-off of the envelope's low-pass [Hz].
    rms_window : float, optional
        Length of a window whose root mean square is the envelope [s], instead of a low-pass.

    Returns
    -------
    EmgChain

    Raises
    ------
    RecordingError
        If there is no such chain, if cut-offs do not rise, or if both a low-pass and a window are given.

    Examples
    --------
    >>> [stage.kind for stage in emg_chain("knee", 60.0, band=(20.0, 400.0), rms_window=0.1).stages]
    ['notch', 'bandpass', 'rectify', 'rms']
    """
    if name not in EMG_CHAINS:
        raise RecordingError(f"EMG chain: found {name!r}, expected one of {', '.join(EMG_CHAINS)}")
    if lowpass is not None and rms_window is not None:
        raise RecordingError(f"EMG chain {name}: found both lowpass and rms_window, expected one of them")
    chain = EMG_CHAINS[name]
    if band is not None:
        chain = chain.with_band(*band)
    if lowpass is not None:
        chain = chain.with_lowpass(lowpass)
    if rms_window is not None:
        chain = chain.with_rms_window(rms_window)
    return chain if mains is None else chain.with_mains(mains)


@with_checked_arguments
def envelope(
    emg: ArrayLike,
    *,
    rate: float,
    chain: str | EmgChain = "able",
    maximum: ArrayLike | None = None,
    causal: bool = False,
) -> np.ndarray:
    """Envelopes of raw EMG.

    Parameters
    ----------
    emg : array_like, shape (n,) or (n, muscles)
        Raw EMG [V].
    rate : float
        Its sampling rate [Hz].
    chain : str or EmgChain
        ``"able"``: band-pass 20 to 450 Hz, rectified, relative, 0.1 s later, so that it lines up with the motion;
        ``"knee"``: band-pass 10 to 500 Hz, rectified, low-pass at 2 Hz, in V; ``"hill"``: notch at 50 Hz, high-pass at
        30 Hz, rectified, low-pass at 5 Hz, relative.
    maximum : array_like, optional
        A number, or shape (muscles,): what 1 stands for in a relative chain, the largest value of a maximal
        contraction in V. Left out, the largest of these samples, muscle by muscle.
    causal : bool
        From the past alone, as in real time, and late; otherwise every filter runs both ways. A relative chain then
        needs `maximum`: the largest value to come is not known.

    Returns
    -------
    ndarray, of the shape of `emg`
        [1] where the chain makes it relative, otherwise [V].

    Raises
    ------
    RecordingError
        If there is no such chain, a cut-off does not fit the rate, a sample is missing, there are too few, or a
        maximum is needed or none.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(0)
    >>> effort = np.clip(np.sin(np.pi * np.arange(8000) / 2000.0), 0.0, None)
    >>> emg = 1e-4 * (0.05 + effort) * rng.standard_normal(8000)
    >>> made = pl.envelope(emg, rate=2000.0, chain="hill")
    >>> made.shape, float(made.max())
    ((8000,), 1.0)
    >>> bool(np.corrcoef(made, effort)[0, 1] > 0.95)
    True
    """
    x = np.asarray(emg, dtype=np.float64)
    if x.ndim not in (1, 2) or not x.size:
        raise RecordingError(f"envelope: found EMG of shape {x.shape}, expected (n,) or (n, muscles) with samples")
    passed = emg_chain(chain) if isinstance(chain, str) else chain
    run = passed.causal if causal else passed.zero_phase
    columns = x.reshape(len(x), -1).T
    try:
        tops = [None] * len(columns) if maximum is None else np.broadcast_to(maximum, len(columns)).tolist()
    except ValueError:
        found = np.asarray(maximum).shape
        raise RecordingError(
            f"envelope: found maxima of shape {found}, expected one for each of {len(columns)} muscles"
        ) from None
    made = []
    for i, (column, top) in enumerate(zip(columns, tops, strict=True)):
        try:
            made.append(run(column, rate, maximum=top))
        except RecordingError as error:
            if x.ndim == 1:
                raise
            raise RecordingError(f"muscle {i} (column): {error}") from None
    return np.stack(made, axis=-1).reshape(x.shape)
