"""Made-up EMG: noise whose amplitude is known, as recordings."""

from pathlib import Path

import numpy as np
from scipy import signal

from pellucid.files.recording import Channel, Recording

FS = 2048.0


def raw_emg(amplitude: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Noise in the band of surface EMG, its amplitude as given [V]."""
    noise = signal.sosfilt(
        signal.butter(2, (30.0, 300.0), "bandpass", fs=FS, output="sos"), rng.standard_normal(len(amplitude))
    )
    return amplitude * noise / noise.std()


def emg_recording(name: str = "trial", unit: str = "V", fs: float = FS, **muscles: np.ndarray) -> Recording:
    """A recording with one channel for each muscle."""
    n = len(next(iter(muscles.values())))
    channels = {"time": Channel("time", np.arange(n) / fs, "s", "t")}
    channels |= {f"emg.{m}": Channel(f"emg.{m}", x, unit, m) for m, x in muscles.items()}
    return Recording(name=name, path=Path(f"{name}.csv"), checksum="0" * 64, use="fit", channels=channels)
