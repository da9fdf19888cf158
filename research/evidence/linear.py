"""Separation of noise and distortion on systems where both are known, compared with the coherence.

Three systems under random-phase multisines: a Wiener-Hammerstein system (a filter, a saturating curve, a filter) whose
coloured noise is about as strong as its distortion; the virtual bench joint under its own controller, with friction,
stiction and sensors, where distortion is far above noise; and the same joint with the current's noise twenty times as
large, which no loop feeds back. True values are simulated separately, with other seeds: distortion as the
variance over hundreds of realisations without noise, noise as the variance over repeated noise at one realisation, both
about the best linear approximation of those hundreds.

Ratios are of sums over groups of neighbouring lines. The reference method is Welch's: 1 minus the
coherence is the unexplained share, without its kind. A linear system shows the false alarm rate for distortion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, csd, lfilter, welch

from pellucid.numerics.protocols.excitation import RandomPhaseMultisine, random_phase_multisine
from pellucid.orthosis.transfer.best_linear_approximation import BestLinearApproximation, best_linear_approximation
from pellucid.study.results import ResultRow
from pellucid_lab.bench.rig import bench_joint
from research.benchmarks._size import sized

EXPERIMENT_COUNT = sized(20, smallest=1)
"""Number of experiments on each nonlinear system; their seeds are 1 to this number."""

REALISATION_COUNT = 7
"""Number of realisations of the multisine in an experiment."""

TRUE_REALISATION_COUNT = sized(300, smallest=4)
"""Number of realisations from which the true response is computed."""

TRUE_REPETITION_COUNT = sized(60, smallest=4)
"""Number of repetitions from which the true noise is computed."""

TRUE_SEED = 20261122
"""Seed of the truth, which is no seed of an experiment."""

LINEAR_EXPERIMENT_COUNT = sized(200, smallest=2)
"""Number of experiments on a linear system."""

LINE_GROUP_COUNT = 3
"""Number of groups of neighbouring lines over which a variance is averaged."""

NOISE_FACTOR = 20.0
"""Factor on the instruments' noise of the noisy joint."""

VARIANCE_TOLERANCE_FACTOR = 1.5
"""Factor within which an estimated variance counts as correct."""

Signals = tuple[np.ndarray, np.ndarray]
"""Input and output of a reference that is played again and again with new noise, each (repetitions, n)."""


@dataclass(frozen=True)
class System:
    """What is identified: its motion of a seed and so many realisations, and what instruments read of a reference."""

    name: str
    said: str
    motion: Callable[[int, int], RandomPhaseMultisine]
    play: Callable[[np.ndarray, int, bool, np.random.Generator], Signals]  # With noise or without
    closed: bool


def rows(experiments: int = EXPERIMENT_COUNT, realisations: int = TRUE_REALISATION_COUNT) -> Iterator[ResultRow]:
    """Every figure."""
    noise, distortion, joined = [], [], []
    for system in (wiener_hammerstein(), joint("joint", 1.0), joint("noisy_joint", NOISE_FACTOR)):
        true_noise, true_distortion = truth(system, realisations)
        ratios = np.array([judged(system, seed + 1, true_noise, true_distortion) for seed in range(experiments)])
        for kind, each, kept in (("noise", ratios[:, 0], noise), ("nonlinear", ratios[:, 1], distortion)):
            kept.append(each)
            yield _row(f"{system.name}.{kind}_variance.ratio", worst_median(each), f"{_spread(each)}; {system.said}")
        joined.append(ratios[:, 2])
        yield _row(
            f"{system.name}.coherence.ratio", worst_median(ratios[:, 2]),
            f"Welch's unexplained output over the true noise; {_spread(ratios[:, 2])}; {system.said}",
        )  # fmt: skip
        level = float(np.sum(true_distortion) / np.sum(true_noise))
        yield _row(f"{system.name}.distortion_to_noise", level, f"truth; {system.said}")
    for kind, each in (("noise", noise), ("nonlinear", distortion)):
        every = np.concatenate(each, axis=1)
        within = f"{_spread(every)}; {experiments} experiments of {REALISATION_COUNT} realisations on three systems"
        yield _row(f"{kind}_variance.ratio", worst_median(every), f"estimated over true, {within}")
        share = np.mean(np.abs(np.log(np.maximum(every, 1e-12))) <= np.log(VARIANCE_TOLERANCE_FACTOR))
        yield _row(
            f"{kind}_variance.within",
            100.0 * share,
            f"of single groups within a factor {VARIANCE_TOLERANCE_FACTOR:g}",
            "%",
        )
    every = np.concatenate(joined, axis=1)
    yield _row(
        "coherence.ratio", worst_median(every), f"reference method: unexplained over true noise, {_spread(every)}"
    )
    p = np.array([linear_p(seed) for seed in range(LINEAR_EXPERIMENT_COUNT)])
    yield _row(
        "size",
        100.0 * np.mean(p < 0.05),
        f"p < 0.05 in {LINEAR_EXPERIMENT_COUNT} linear systems in coloured noise",
        "%",
    )


def worst_median(ratios: np.ndarray) -> float:
    """Return the median over experiments of the group of lines, (e, g), that is furthest from 1."""
    medians = np.median(ratios, axis=0)
    return float(medians[np.argmax(np.abs(np.log(np.maximum(medians, 1e-12))))])


def _spread(ratios: np.ndarray) -> str:
    return (
        f"worst of {ratios.shape[1]} groups' medians; median of all {np.median(ratios):.3g}, single groups "
        f"{ratios.min():.3g} to {ratios.max():.3g}"
    )


def _row(name: str, value: float, note: str, unit: str = "1") -> ResultRow:
    return ResultRow(f"linear.{name}", float(value), unit, "evidence", "simulated", None, note)


# --- systems --------------------------------------------------------------------------------------------------------


def wiener_hammerstein() -> System:
    """Two filters about a curve that saturates, and noise of a third."""
    rate = 500.0
    before, after = butter(2, 30.0, fs=rate), butter(2, 60.0, fs=rate)

    def motion(seed: int, realisations: int) -> RandomPhaseMultisine:
        return random_phase_multisine(
            rate, low=0.5, high=40.0, resolution=0.5, rms=1.0, realisations=realisations, periods=3, seed=seed
        )

    def play(reference: np.ndarray, repetitions: int, noisy: bool, rng: np.random.Generator) -> Signals:
        clean = lfilter(*after, np.tanh(0.8 * lfilter(*before, reference)))
        noise = lfilter([0.05], [1.0, -0.9], rng.standard_normal((repetitions, len(reference))), axis=1)
        return np.tile(reference, (repetitions, 1)), clean + noisy * noise

    return System("wiener_hammerstein", "filter, tanh, filter, coloured noise; open loop", motion, play, False)


def joint(name: str, louder: float) -> System:
    """The bench joint as its rig file asks for a first look, its current's noise so much `louder`."""
    rig = bench_joint()
    rig = rig.changed({"drive.current_noise": louder * rig["drive"]["current_noise"]})
    silent = rig.changed({"drive.current_noise": 0.0, "encoder.noise": 0.0})
    keys = ("low", "high", "resolution", "rms", "peak", "fall", "lines", "periods", "settle")
    said = {key: rig["multisine"][key] for key in keys}

    def motion(seed: int, realisations: int) -> RandomPhaseMultisine:
        # Lines that are left out are drawn once: truth is of the same ones.
        made = random_phase_multisine(rig.rate, **said, realisations=1, seed=TRUE_SEED)
        phases = np.random.default_rng([seed, 5]).uniform(0.0, 2.0 * np.pi, (realisations, len(made.lines)))
        return RandomPhaseMultisine(
            made.rate, made.samples, made.lines, made.amplitude, phases, made.periods, made.settle
        )

    def play(reference: np.ndarray, repetitions: int, noisy: bool, rng: np.random.Generator) -> Signals:
        read = (rig if noisy else silent).play(reference, repetitions, rng)
        return read["current"], read["position"]

    text = f"bench joint in its loop, friction with stiction, current's noise times {louder:g}"
    return System(name, text, motion, play, True)


# --- truth and judgement --------------------------------------------------------------------------------------------


def _lines(motion: RandomPhaseMultisine, signal: np.ndarray) -> np.ndarray:
    """Spectra at excited lines of each settled period, (repetitions, periods, k)."""
    periods = signal[:, motion.settle * motion.samples :].reshape(len(signal), motion.periods, motion.samples)
    return np.fft.rfft(periods)[:, :, motion.lines] / motion.samples


def truth(system: System, realisations: int) -> tuple[np.ndarray, np.ndarray]:
    """Variances of noise and of distortion at excited lines, (k,), of one period and realisation."""
    motion, rng = system.motion(TRUE_SEED, realisations), np.random.default_rng(TRUE_SEED)
    spectra, references = [], []
    for m in range(realisations):
        reference = motion.reference(m)
        u, y = system.play(reference, 1, False, rng)
        # The last period: what a start leaves has died away.
        spectra.append([_lines(motion, u)[0, -1], _lines(motion, y)[0, -1]])
        references.append(_lines(motion, reference[None])[0, -1])
    u, y = np.moveaxis(np.array(spectra), 1, 0)
    r = np.conj(np.array(references))
    response = np.sum(y * r, axis=0) / np.sum(u * r, axis=0)
    distortion = np.sum(np.abs(y - response * u) ** 2, axis=0) / (realisations - 1)
    noise = []
    for m in range(min(8, realisations)):
        u, y = system.play(motion.reference(m), TRUE_REPETITION_COUNT, True, rng)
        missed = _lines(motion, y) - response * _lines(motion, u)
        noise.append(np.mean(np.abs(missed - missed.mean(axis=0)) ** 2, axis=(0, 1)))
    return np.mean(noise, axis=0) * TRUE_REPETITION_COUNT / (TRUE_REPETITION_COUNT - 1), distortion


def judged(system: System, seed: int, noise: np.ndarray, distortion: np.ndarray) -> list[np.ndarray]:
    """Return noise, distortion and the reference method's level of one experiment relative to the true ones, by
    group.
    """
    motion, rng = system.motion(seed, REALISATION_COUNT), np.random.default_rng([seed, 1])
    played = [(motion.reference(m), *system.play(motion.reference(m), 1, True, rng)) for m in range(REALISATION_COUNT)]
    begin = motion.settle * motion.samples
    r, u, y = (np.array([np.ravel(each[i])[begin:] for each in played]) for i in range(3))
    found = best_linear_approximation(
        u, y, motion.rate, samples=motion.samples, references=r if system.closed else None
    )
    if not np.array_equal(found.line, motion.lines):
        raise RuntimeError(f"{system.name}: other lines found than excited")
    rival = _unexplained(found, motion, u, y)
    # Those of the truth, by frequency: where left-out lines differ, levels between lines are what they are beside them.
    place = system.motion(TRUE_SEED, 1).lines
    noise, distortion = (np.exp(np.interp(found.line, place, np.log(x))) for x in (noise, distortion))
    groups = np.array_split(np.arange(len(found.line)), LINE_GROUP_COUNT)

    def over(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
        return np.array([estimated[g].sum() / true[g].sum() for g in groups])

    return [over(found.noise_variance, noise), over(found.nonlinear_variance, distortion), over(rival, noise)]


def _unexplained(
    found: BestLinearApproximation, motion: RandomPhaseMultisine, u: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Welch's estimate of a period's unexplained variance at lines, (k,): Hann windows of a period, half overlapped."""
    how = {"fs": motion.rate, "nperseg": motion.samples}
    power = [np.mean(welch(x, **how)[1], axis=0) for x in (u, y)]
    cross = np.mean(csd(u, y, **how)[1], axis=0)
    left = power[1] * (1.0 - np.abs(cross) ** 2 / (power[0] * power[1]))
    return 0.5 * left[found.line] * motion.rate / motion.samples


def linear_p(seed: int) -> float:
    """The p value of a linear system in coloured noise."""
    motion = random_phase_multisine(
        200.0, low=0.5, high=20.0, resolution=0.5, rms=1.0, realisations=4, periods=3, settle=0, seed=TRUE_SEED + seed
    )
    u = np.array([motion.reference(m) for m in range(4)])
    rng = np.random.default_rng([TRUE_SEED, seed])
    noise = lfilter([0.2], [1.0, -0.9], rng.standard_normal(u.shape), axis=1)
    y = lfilter([0.05, 0.1], [1.0, -1.6, 0.75], u, axis=1) + noise
    return best_linear_approximation(u, y, 200.0, samples=motion.samples).p_value
