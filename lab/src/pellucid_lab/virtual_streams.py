"""Send a simulated wearer's EMG, markers and encoder as streams: `python -m pellucid_lab.virtual_streams REGION
OPTIONS`.

The process follows the engine's records and sends readings of simulated instruments: EMG whose amplitude follows the
excitations, markers at elbow and hand, and the joint's encoder, each at its own rate.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pellucid.live.intake import streaming_layer
from pellucid.live.setup import SessionProcess
from pellucid.live.shared_memory import Region

from .emg_synthesis import motor_unit_noise

EMG_RATE_HZ = 2048.0
"""Rate of the virtual EMG."""

MARKER_RATE_HZ = 100.0
"""Rate of the virtual motion capture."""

ENCODER_RATE_HZ = 500.0
"""Rate at which the encoder is sent."""

MARKER_NOISE_M = 0.0003
"""Standard deviation of a marker's coordinate [m]."""

CARRIER_S = 30.0
"""Duration of the muscles' noise before it repeats."""

POLL_S = 0.01
"""Time between two chunks."""


@dataclass(frozen=True)
class MuscleChannel:
    """One channel of EMG."""

    name: str
    share: float  # share of the flexors' excitation where positive, of the extensors' where negative [1]
    gain: float  # RMS at full excitation [V]


class EmgSource:
    """EMG of a moving wearer, sample by sample on a grid of its own."""

    def __init__(self, channels: Sequence[MuscleChannel], rate: float, table: Any, seed: int) -> None:
        rng = np.random.default_rng([seed, 29])
        count = round(CARRIER_S * rate)
        self._carrier = motor_unit_noise(count, len(channels), rate, table, rng)
        self._share = np.array([channel.share for channel in channels])
        self._gain = np.array([channel.gain for channel in channels])
        self._table = table
        self._rng = rng
        self._phase = rng.uniform(0.0, 2.0 * np.pi, len(channels))
        self.rate = rate

    def samples(self, first: int, time_s: np.ndarray, flexor: np.ndarray, extensor: np.ndarray) -> np.ndarray:
        """Return samples from number `first` on, at times [s] with excitations shape (n,) [1]: shape (n, k) [V]."""
        n = len(time_s)
        places = (first + np.arange(n)) % self._carrier.shape[1]
        excitation = np.where(self._share >= 0.0, flexor[:, None], extensor[:, None]) * np.abs(self._share)
        muscles = self._carrier[:, places].T * excitation * self._gain
        crosstalk = self._table["crosstalk"] * (muscles.sum(axis=1, keepdims=True) - muscles)
        hum = self._table["hum"] * np.sin(2.0 * np.pi * self._table["hum_frequency"] * time_s[:, None] + self._phase)
        background = self._table["baseline"] * self._rng.standard_normal(muscles.shape)
        quantum = self._table["quantum"]
        return np.round((muscles + crosstalk + hum + background) / quantum) * quantum


def _outlet(name: str, type_: str, rate: float, labels: Sequence[str], unit: str, kind: str, seed: int) -> Any:
    pylsl = streaming_layer()
    info = pylsl.StreamInfo(name, type_, len(labels), rate, kind, f"pellucid-virtual-{name}-{seed}")
    channels = info.desc().append_child("channels")
    for label in labels:
        channels.append_child("channel").append_child_value("label", label).append_child_value("unit", unit)
    return pylsl.StreamOutlet(info, max_buffered=60)


class Sender:
    """Three streams that follow the engine's records."""

    def __init__(self, region: Region, options: dict[str, Any]) -> None:
        self._region = region
        channels = [MuscleChannel(**channel) for channel in options["channels"]]
        seed = options["seed"]
        self._emg = EmgSource(channels, options["rate"], options["table"], seed)
        self._segment = float(options["segment"])
        self._rng = np.random.default_rng([seed, 30])
        names = [channel.name for channel in channels]
        self._outlets = {
            "emg": _outlet("emg", "EMG", self._emg.rate, names, "V", "float32", seed),
            "markers": _outlet(
                "markers", "MoCap", MARKER_RATE_HZ,
                [f"{point}.{axis}" for point in ("elbow", "hand") for axis in "xyz"], "m", "float32", seed,
            ),
            "encoder": _outlet("encoder", "Encoder", ENCODER_RATE_HZ, ["position"], "rad", "double64", seed),
        }  # fmt: skip
        self._rates = {"emg": self._emg.rate, "markers": MARKER_RATE_HZ, "encoder": ENCODER_RATE_HZ}
        self._next = dict.fromkeys(self._rates, -1)
        self._cursor = region.record_count
        self._kept: np.ndarray | None = None

    def step(self) -> None:
        """Send everything up to the newest record."""
        self._cursor, records, _ = self._region.records_since(self._cursor)
        if not len(records):
            return
        if self._kept is not None:
            records = np.concatenate([self._kept, records])
        self._kept = records[-1:]
        seconds = 1e-9 * records["deadline"]
        for name, rate in self._rates.items():
            first = self._next[name] if self._next[name] >= 0 else int(np.ceil(seconds[0] * rate))
            last = int(np.floor(seconds[-1] * rate))
            if last < first:
                continue
            if (last - first) / rate > 1.0:  # the engine was away: nothing was measured meanwhile
                first = last
            grid = np.arange(first, last + 1) / rate
            self._next[name] = last + 1
            self._outlets[name].push_chunk(self._made(name, first, grid, seconds, records), grid[-1])

    def _made(self, name: str, first: int, grid: np.ndarray, seconds: np.ndarray, records: np.ndarray) -> np.ndarray:
        if name == "emg":
            flexor, extensor = (np.interp(grid, seconds, records[key]) for key in ("flexor", "extensor"))
            return self._emg.samples(first, grid, flexor, extensor).astype(np.float32)
        if name == "encoder":
            return np.interp(grid, seconds, records["value"][:, 0])[:, None]
        angle = np.interp(grid, seconds, records["limb_position"])
        hand = self._segment * np.column_stack([np.sin(angle), np.zeros(len(grid)), -np.cos(angle)])
        points = np.concatenate([np.zeros((len(grid), 3)), hand], axis=1)
        return (points + MARKER_NOISE_M * self._rng.standard_normal(points.shape)).astype(np.float32)


def run(region: Path, options: dict[str, Any]) -> None:
    """Send the streams until SIGTERM."""
    ends: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: ends.append(number))
    sender, process = Sender(Region(region), options), SessionProcess()
    while not ends and not process.is_over():
        sender.step()
        time.sleep(POLL_S)


if __name__ == "__main__":
    run(Path(sys.argv[1]), json.loads(sys.argv[2]))
