"""Rewrite the variables that acquisition programs store apart as one matrix with names, units and a rate.

- LabChart: one row ``data`` of all channels and blocks, with ``datastart``, ``dataend``, ``titles`` and ``samplerate``;
- Spike2: a struct for each channel with ``title``, ``interval``, ``start``, ``units`` and ``values``;
- AcqKnowledge: ``data`` with ``labels``, ``units`` and the interval ``isi`` in ``isi_units``;
- openhdemg: ``RAW_SIGNAL``, ``REF_SIGNAL`` and ``FSAMP``, each a text in JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..stated_units import unit_from_text
from ._signals import Stated, text_of, texts_of

INTERVAL_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
"""Units of an interval between samples [s]."""


def plain_signals(content: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the variables of a file of one of these programs as labelled matrices; None of any other file."""
    for rewrite in (_labchart, _acqknowledge, _spike2, _openhdemg):
        if (made := rewrite(content)) is not None:
            return made
    return None


def _labchart(content: Mapping[str, Any]) -> Mapping[str, Any] | None:
    if not {"data", "datastart", "dataend", "titles", "samplerate"} <= set(content):
        return None
    data, names = np.ravel(content["data"]), texts_of(content["titles"])
    first, last, rates = (np.asarray(content[key], float) for key in ("datastart", "dataend", "samplerate"))
    if not names or data.dtype.kind not in "fiu" or any(x.size % len(names) for x in (first, last, rates)):
        return None
    first, last, rates = (x.reshape(len(names), -1) for x in (first, last, rates))
    units = texts_of(content.get("unittext"))
    places = np.asarray(content.get("unittextmap", np.zeros(first.shape)), float).reshape(len(names), -1)
    blocks = {}
    for block in range(first.shape[1]):
        channels = []
        for i, name in enumerate(names):
            start, stop = int(first[i, block]) - 1, int(last[i, block])
            if not 0 <= start < stop <= len(data):
                continue  # a channel that was off
            place = int(places[i, min(block, places.shape[1] - 1)]) - 1
            unit = units[place] if 0 <= place < len(units) else ""
            rate = float(rates[i, min(block, rates.shape[1] - 1)])
            channels.append((name, unit, rate, 0.0, _scaled(content, data[start:stop], i, block)))
        if channels:
            blocks[f"block_{block + 1}"] = _by_rate(channels)
    return next(iter(blocks.values())) if len(blocks) == 1 else blocks or None


def _scaled(content: Mapping[str, Any], samples: np.ndarray, channel: int, block: int) -> np.ndarray:
    """Return samples, (n,), that LabChart stored as integers, in their unit."""
    if samples.dtype.kind == "f" or not {"scaleunits", "scaleoffset"} <= set(content):
        return samples.astype(float)
    scale, offset = (np.atleast_2d(np.asarray(content[key], float)) for key in ("scaleunits", "scaleoffset"))
    at = min(channel, len(scale) - 1), min(block, scale.shape[1] - 1)
    return (samples.astype(float) + offset[at]) * scale[at]


def _acqknowledge(content: Mapping[str, Any]) -> Mapping[str, Any] | None:
    if not {"data", "isi", "labels"} <= set(content) or np.size(content["isi"]) != 1:
        return None
    data, names, units = np.asarray(content["data"]), texts_of(content["labels"]), texts_of(content.get("units"))
    size = INTERVAL_UNITS.get(unit_from_text(text_of(content.get("isi_units", "ms"))) or "")
    step = float(np.ravel(content["isi"])[0]) * (size or np.nan)
    data = data.reshape(len(data), -1) if data.ndim else data
    if data.ndim != 2 or data.dtype.kind not in "fiu" or data.shape[1] != len(names) or not step > 0.0:
        return None
    return {"fs": 1.0 / step, "data": Stated(data, names, units)}


def _spike2(content: Mapping[str, Any]) -> Mapping[str, Any] | None:
    structs = [value for value in content.values() if isinstance(value, Mapping) and "title" in value]
    waves = [each for each in structs if {"interval", "values"} <= set(each) and np.size(each["interval"]) == 1]
    if not waves or len(structs) < len(content):
        return None
    channels = []
    for i, each in enumerate(waves):
        samples, step = np.ravel(np.asarray(each["values"], float)), float(np.ravel(each["interval"])[0])
        if not step > 0.0:
            return None
        start = float(np.ravel(each["start"])[0]) if np.size(each.get("start", ())) == 1 else 0.0
        name, unit = text_of(each["title"]) or f"channel {i + 1}", text_of(each.get("units"))
        channels.append((name, unit, 1.0 / step, start, samples))
    return _by_rate(channels)


def _openhdemg(content: Mapping[str, Any]) -> Mapping[str, Any] | None:
    if not {"RAW_SIGNAL", "FSAMP"} <= set(content):
        return None
    rate, emg = _from_json(content["FSAMP"]), _frame(content["RAW_SIGNAL"])
    if emg is None or not isinstance(rate, (int, float)) or not rate > 0.0:
        return None
    names = tuple(f"electrode {i + 1}" for i in range(emg.shape[1]))
    made: dict[str, Any] = {"fs": float(rate), "EMG": Stated(emg, names) if len(names) > 1 else emg[:, 0]}
    force = _frame(content.get("REF_SIGNAL"))
    if force is not None and len(force) == len(emg):
        made["force"] = force[:, 0] if force.shape[1] == 1 else force
    return made


def _from_json(value: Any) -> Any:
    """Return a value that a text in JSON holds; any other value as it is."""
    try:
        return json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return None


def _frame(value: Any) -> np.ndarray | None:
    """Return a data frame of pandas in JSON as an array, (n, columns); None if it is none."""
    found = _from_json(value)
    if isinstance(found, Mapping):
        rows = found.get("data")
        columns = [[*each.values()] for each in found.values() if isinstance(each, Mapping)]
        found = rows if rows is not None else np.transpose(columns) if columns else None
    try:
        made = np.asarray(found, float)
    except (TypeError, ValueError):
        return None
    return made.reshape(len(made), -1) if made.ndim and made.size > 1 else None


def _by_rate(channels: Iterable[tuple[str, str, float, float, np.ndarray]]) -> Mapping[str, Any]:
    """Return channels, each with name, unit, rate [Hz], start [s] and samples, (n,), with one matrix for each clock."""
    clocks: dict[tuple[float, float, int], list[tuple[str, str, np.ndarray]]] = {}
    for name, unit, rate, start, samples in channels:
        clocks.setdefault((rate, start, len(samples)), []).append((name, unit, samples))
    made = {
        f"{rate:g} Hz": _with_times(own, start + np.arange(length) / rate)
        for (rate, start, length), own in clocks.items()
    }
    return next(iter(made.values())) if len(made) == 1 else made


def _with_times(channels: Sequence[tuple[str, str, np.ndarray]], time: np.ndarray) -> Mapping[str, Any]:
    """Return channels of one clock, each with name, unit and samples, (n,), with their times, (n,) [s]."""
    names, units, samples = zip(*channels, strict=True)
    if len(names) == 1:
        return {"time": time, "units": units, names[0]: samples[0]}
    return {"time": time, "data": Stated(np.column_stack(samples), names, units)}
