"""Raw EMG of motor units, and what spoils it in laboratories.

A muscle is a pool of motor units: small ones are recruited first, each fires irregularly, and each discharge adds a
potential of its own shape. The amplifier adds noise with a little flicker, and the converter rounds. The causes of
spoilings are made as they arise: a heart's complexes with their irregular rhythm, cables that swing and settle, mains
with harmonics whose level wanders, packets that a radio loses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy import signal

MUSCLES = (
    "vastus_lateralis", "rectus_femoris", "biceps_femoris", "semitendinosus", "tibialis_anterior",
    "gastrocnemius_medialis", "soleus", "vastus_medialis",
)  # fmt: skip
"""Muscles of the leg, in the words of study.toml."""

WORK = {
    "vastus_lateralis": (0.06, 0.09, 160.0), "rectus_femoris": (0.10, 0.08, 90.0),
    "biceps_femoris": (0.92, 0.08, 130.0), "semitendinosus": (0.90, 0.09, 150.0),
    "tibialis_anterior": (0.62, 0.13, 170.0), "gastrocnemius_medialis": (0.40, 0.10, 210.0),
    "soleus": (0.38, 0.12, 120.0), "vastus_medialis": (0.07, 0.08, 140.0),
}  # fmt: skip
"""Middle and half width of the burst in a stride, as shares of it, and the RMS at its height [µV]."""

UNIT_COUNT = 45
"""Motor units of a muscle."""


@dataclass(frozen=True)
class EmgRecording:
    """Raw EMG of several muscles in volts, with what is known of it."""

    time: np.ndarray  # Times at which samples were taken, (n,) [s]
    emg: np.ndarray  # (n, channels) [V], or envelopes in maxima
    muscles: tuple[str, ...]
    rate: float  # Hz
    unit: str = "V"  # Unit of the samples: "V", or "1" of envelopes
    stated_factor: float = 1.0  # By how much the unit that the file states is wrong
    onsets: tuple[tuple[float, ...], ...] = field(default=())  # When each muscle began, of recordings with rests [s]


def walking_emg(
    rng: np.random.Generator,
    rate: float,
    seconds: float,
    muscles: tuple[str, ...],
    pace_s: float = 1.1,
    person: int = 0,
) -> EmgRecording:
    """Return EMG of a person who walks: strides differ in length, timing and strength.

    A `person` has the same motor units and electrodes in every recording.
    """
    body = np.random.default_rng([person, 7])
    n = round(seconds * rate)
    t = np.arange(n) / rate
    strides = np.cumsum(pace_s * (1.0 + 0.03 * rng.standard_normal(round(seconds / pace_s) + 4))) - 1.5 * pace_s
    columns = []
    for muscle in muscles:
        middle, half, height = WORK[muscle]
        drive = 0.02 * np.ones(n)
        for first, last in pairwise(strides):
            at = first + (middle + 0.012 * rng.standard_normal()) * (last - first)
            wide = half * (last - first)
            size = np.exp(0.15 * rng.standard_normal())
            drive += size * np.clip(1.3 * np.cos(0.5 * np.pi * np.clip((t - at) / (1.3 * wide), -1.0, 1.0)) ** 2, 0, 1)
        gain = body.uniform(0.6, 1.6)
        raw = 1e-6 * height * gain * muscle_signal(rng, drive, rate, body=body)
        columns.append(raw + body.uniform(1.2e-6, 3.5e-6) * amplifier_noise(rng, n, rate))
    return EmgRecording(t, np.column_stack(columns), muscles, rate)


def repeated_emg(rng: np.random.Generator, rate: float, seconds: float, muscles: tuple[str, ...]) -> EmgRecording:
    """Return EMG of contractions with rests between them, with the times at which they began."""
    n = round(seconds * rate)
    t = np.arange(n) / rate
    columns, onsets = [], []
    for muscle in muscles:
        drive, begun, at = np.zeros(n), [], rng.uniform(1.0, 1.6)
        while at + 1.6 < seconds:
            rise, last = rng.uniform(0.04, 0.2), rng.uniform(0.7, 1.1)
            drive += np.clip((t - at) / rise, 0.0, 1.0) * np.clip((at + last - t) / 0.1, 0.0, 1.0)
            begun.append(float(at))
            at += last + rng.uniform(0.8, 1.6)
        discharges: list[int] = []
        raw = muscle_signal(rng, drive, rate, discharges)
        columns.append(1e-6 * WORK[muscle][2] * raw + 2e-6 * amplifier_noise(rng, n, rate))
        fired = np.sort(discharges) / rate
        # The first discharge begins a contraction; its potential reaches the electrode within a millisecond or two.
        onsets.append(tuple(float(fired[np.searchsorted(fired, at - 0.05)]) for at in begun))
    return EmgRecording(t, np.column_stack(columns), muscles, rate, onsets=tuple(onsets))


def maximal_emg(rng: np.random.Generator, rate: float, seconds: float, muscles: tuple[str, ...]) -> EmgRecording:
    """Return EMG of one contraction as strong as possible of all muscles, held for seconds."""
    n = round(seconds * rate)
    t = np.arange(n) / rate
    drive = np.clip((t - 0.2 * seconds) / 0.6, 0.0, 1.0) * np.clip((0.8 * seconds - t) / 0.3, 0.0, 1.0)
    columns = [
        3e-6 * WORK[m][2] * muscle_signal(rng, drive * rng.uniform(0.9, 1.0), rate)
        + 2e-6 * amplifier_noise(rng, n, rate)
        for m in muscles
    ]
    return EmgRecording(t, np.column_stack(columns), muscles, rate)


def muscle_signal(
    rng: np.random.Generator,
    drive: np.ndarray,
    rate: float,
    discharges: list[int] | None = None,
    body: np.random.Generator | None = None,
) -> np.ndarray:
    """Return the sum of the potentials of motor units that a drive, (n,), excites: RMS 1 where the drive is 1.

    `discharges` is filled with the samples at which units fire. `body` draws the potentials, where they are a person's.
    """
    n = len(drive)
    impulses = np.zeros(n)
    made = np.zeros(n)
    step = 1.0 / rate
    power = 0.0
    for k in range(UNIT_COUNT):
        place = k / UNIT_COUNT
        threshold = 0.9 * place**1.5 + 0.01
        size = np.exp(2.2 * place)
        peak_rate = 26.0 - 8.0 * place
        excess = np.clip(drive - threshold, 0.0, None)
        frequency = np.where(excess > 0.0, 8.0 + (peak_rate - 8.0) * np.clip(excess / 0.6, 0.0, 1.0), 0.0)
        phase = np.cumsum(frequency) * step + rng.uniform()
        # Discharges are a renewal process: each comes when the summed rate reaches the next drawn interval.
        intervals = np.clip(1.0 + 0.18 * rng.standard_normal(int(phase[-1]) + 3), 0.4, 1.8)
        at = np.searchsorted(phase, np.cumsum(intervals))
        # The phase at which a unit begins is that of a discharge before the recording.
        at = at[at > 0]
        impulses[:] = 0.0
        impulses[at[at < n]] = 1.0
        if discharges is not None:
            discharges += at[at < n].tolist()
        shape = _potential(rng if body is None else body, rate, size)
        made += signal.oaconvolve(impulses, shape, "full")[:n]
        power += (8.0 + (peak_rate - 8.0) * min((1.0 - threshold) / 0.6, 1.0)) * float(np.sum(shape**2)) * step
    return made / np.sqrt(power)


def _potential(rng: np.random.Generator, rate: float, size: float) -> np.ndarray:
    """Return the potential of a motor unit at a bipolar electrode: fibres conduct, and the electrode subtracts."""
    velocity, spread = rng.uniform(3.4, 4.8), rng.uniform(0.002, 0.006)  # m/s, m
    distance = 0.02  # m, between the electrodes' centres
    t = np.arange(-0.006, 0.016, 1.0 / rate)

    def passing(place: float) -> np.ndarray:
        z = (velocity * t - place) / (spread + 0.002)
        return (1.0 - z**2) * np.exp(-0.5 * z**2)

    return size * rng.uniform(0.6, 1.4) * (passing(0.0) - passing(distance)) * rng.choice([-1.0, 1.0])


def amplifier_noise(rng: np.random.Generator, n: int, rate: float) -> np.ndarray:
    """Return an amplifier's and electrode's noise, (n,), of about RMS 1: white, a little flicker, high-passed."""
    white = rng.standard_normal(n)
    flicker = signal.lfilter([0.05], [1.0, -0.97], rng.standard_normal(n))
    passed = signal.sosfilt(signal.butter(1, 10.0, "highpass", fs=rate, output="sos"), white + flicker)
    return passed


# --- what spoils it --------------------------------------------------------------------------------------------------


def hold_packets(recording: EmgRecording, rng: np.random.Generator, channel: int, value: str) -> EmgRecording:
    """Lose a radio's packets of one channel for 0.1 to 0.6 s: its last value, zeros or missing samples stay."""
    emg = recording.emg.copy()
    n = len(emg)
    for _ in range(int(rng.integers(1, 4))):
        first = int(rng.uniform(0.15, 0.8) * n)
        last = first + int(rng.uniform(0.1, 0.6) * recording.rate)
        emg[first:last, channel] = {"held": emg[first, channel], "zero": 0.0, "missing": np.nan}[value]
    return replace(recording, emg=emg)


def detach(recording: EmgRecording, rng: np.random.Generator, channel: int) -> EmgRecording:
    """Take the electrode's plug out: only the converter's noise is left."""
    emg = recording.emg.copy()
    emg[:, channel] = rng.uniform(3e-8, 1e-7) * rng.standard_normal(len(emg))
    return replace(recording, emg=emg)


def add_mains(recording: EmgRecording, rng: np.random.Generator, channel: int) -> EmgRecording:
    """Add mains of 50 or 60 Hz: odd harmonics, a frequency that the grid holds to 0.1 %, a level that wanders."""
    emg, t = recording.emg.copy(), recording.time
    mains = rng.choice([50.0, 60.0]) * (1.0 + 1e-3 * rng.uniform(-1.0, 1.0))
    level = rng.uniform(0.5, 2.0) * float(np.std(emg[:, channel]))
    wander = 1.0 + 0.15 * np.sin(2.0 * np.pi * rng.uniform(0.02, 0.1) * t + rng.uniform(0.0, 6.0))
    for harmonic, share in ((1, 1.0), (3, rng.uniform(0.1, 0.4)), (5, rng.uniform(0.02, 0.2))):
        if harmonic * mains < 0.45 * recording.rate:
            emg[:, channel] += level * share * wander * np.sin(2 * np.pi * harmonic * mains * t + rng.uniform(0, 6))
    return replace(recording, emg=emg)


def add_heartbeat(recording: EmgRecording, rng: np.random.Generator, channel: int) -> EmgRecording:
    """Add a heart's complexes: their rhythm breathes, and the complex has its five waves."""
    emg, t = recording.emg.copy(), recording.time
    size = rng.uniform(1.0, 3.0) * float(np.quantile(np.abs(emg[:, channel]), 0.995))
    waves = ((-0.17, 0.025, 0.10), (-0.028, 0.009, -0.12), (0.0, 0.011, 1.0), (0.030, 0.010, -0.22), (0.25, 0.05, 0.2))
    usual, at = rng.uniform(0.7, 1.0), rng.uniform(0.1, 0.8)
    while at < t[-1]:
        beat = size * (1.0 + 0.05 * rng.standard_normal())
        for delay, wide, height in waves:
            emg[:, channel] += beat * height * np.exp(-0.5 * ((t - at - delay) / wide) ** 2)
        at += usual * (1.0 + 0.04 * np.sin(2.0 * np.pi * 0.25 * at) + 0.02 * rng.standard_normal())
    return replace(recording, emg=emg)


def move_cable(recording: EmgRecording, rng: np.random.Generator, channel: int) -> EmgRecording:
    """Swing a cable a few times: the electrode's voltage jumps and settles as a damped oscillation."""
    emg, t = recording.emg.copy(), recording.time
    for _ in range(int(rng.integers(2, 6))):
        at = rng.uniform(0.15, 0.85) * t[-1]
        after = np.clip(t - at, 0.0, None)
        size, swing, settle = rng.uniform(0.8e-3, 3e-3), rng.uniform(2.0, 7.0), rng.uniform(0.1, 0.3)
        emg[:, channel] += size * (1.0 - np.exp(-after / 0.02)) * np.exp(-after / settle) * np.sin(
            2.0 * np.pi * swing * after + rng.uniform(0.0, 6.0)
        )  # fmt: skip
    return replace(recording, emg=emg)


def saturate(recording: EmgRecording, rng: np.random.Generator, channel: int) -> EmgRecording:
    """Set the amplifier's gain too high: values beyond its range are clipped."""
    emg = recording.emg.copy()
    end = rng.uniform(0.35, 0.6) * float(np.quantile(np.abs(emg[:, channel]), 0.999))
    emg[:, channel] = np.clip(emg[:, channel], -end, end)
    return replace(recording, emg=emg)


def exchange(recording: EmgRecording, one: int, other: int) -> EmgRecording:
    """Plug two electrodes into each other's channel."""
    emg = recording.emg.copy()
    emg[:, [one, other]] = emg[:, [other, one]]
    return replace(recording, emg=emg)


def add_peak(recording: EmgRecording, rng: np.random.Generator, channel: int) -> EmgRecording:
    """Touch a cable during a maximal contraction: one peak of about 10 ms."""
    emg, t = recording.emg.copy(), recording.time
    at, wide = rng.uniform(0.3, 0.7) * t[-1], rng.uniform(0.002, 0.004)
    height = rng.uniform(6.0, 12.0) * float(np.quantile(np.abs(emg[:, channel]), 0.99))
    z = (t - at) / wide
    emg[:, channel] += height * z * np.exp(0.5 - 0.5 * z**2)
    return replace(recording, emg=emg)


def lose_samples(recording: EmgRecording, rng: np.random.Generator) -> EmgRecording:
    """Lose stretches of all channels: times go on, samples are not there."""
    kept = np.ones(len(recording.time), bool)
    for _ in range(int(rng.integers(1, 4))):
        first = int(rng.uniform(0.1, 0.85) * len(kept))
        kept[first : first + int(rng.uniform(0.1, 0.5) * recording.rate)] = False
    return replace(recording, time=recording.time[kept], emg=recording.emg[kept])


def envelopes_of(recording: EmgRecording) -> EmgRecording:
    """Return envelopes, each divided by its own largest value in this recording."""
    sos = signal.butter(2, 6.0, fs=recording.rate, output="sos")
    high = signal.butter(4, 20.0, "highpass", fs=recording.rate, output="sos")
    made = signal.sosfiltfilt(sos, np.abs(signal.sosfiltfilt(high, recording.emg, axis=0)), axis=0)
    made = np.maximum(made, 0.0)
    return replace(recording, emg=made / made.max(axis=0), unit="1")


def misstate_unit(recording: EmgRecording, rng: np.random.Generator) -> EmgRecording:
    """State another unit than that of the samples."""
    return replace(recording, stated_factor=float(rng.choice([1e3, 1e6, 1e-6])))


def spoil(
    recording: EmgRecording, kind: str, rng: np.random.Generator, variant: int = 0
) -> tuple[EmgRecording, tuple[int, ...]]:
    """Return a recording with one spoiling, and the channels that have it."""
    channel = int(rng.integers(recording.emg.shape[1]))
    every = tuple(range(recording.emg.shape[1]))
    if kind == "dropout":
        return hold_packets(recording, rng, channel, ("held", "zero", "missing")[variant % 3]), (channel,)
    if kind == "exchanged":
        other = int((channel + 1 + rng.integers(recording.emg.shape[1] - 1)) % recording.emg.shape[1])
        return exchange(recording, channel, other), (channel, other)
    if kind == "normalised_per_trial":
        return envelopes_of(recording), every
    if kind == "unit":
        return misstate_unit(recording, rng), every
    if kind == "clock":
        return lose_samples(recording, rng), ()
    one: Mapping = {
        "dead": detach, "mains": add_mains, "heartbeat": add_heartbeat, "motion": move_cable, "saturation": saturate,
        "mvc_artefact": add_peak,
    }  # fmt: skip
    return one[kind](recording, rng, channel), (channel,)
