"""Studies whose held-out files hold something else, and the numbers that a procedure found of the fitted ones.

Every fitted number (cards, rows of fitted data, exported constants) must stay as it is, to the last bit, whatever the
held-out files hold: they may reach errors and the verdict on the prediction alone.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from pellucid.files.optical import OpticalRecording
from pellucid.files.recording import Channel, Recording
from pellucid.study import recording_steps
from pellucid.study.procedures.result import _write as write_card_of_any_kind
from pellucid.study.procedures.run import check, run
from pellucid.study.study import Study

EFFORT_CHANNELS = ("current", "voltage", "torque", "force", "duty", "effort", "command", "moment")
"""First parts of the names of channels that hold an effort, or what asks for one."""

POSITION_CHANNELS = ("position", "motor_position", "angle", "reference", "displacement")
"""First parts of the names of channels that hold a place or an angle."""

VELOCITY_CHANNELS = ("velocity",)
"""First parts of the names of channels that hold a velocity."""

JUDGED_ONLY_KEYS = ("heldout", "checksum", "pellucid", "judged", "validation")
"""Keys of cards whose names begin so may depend on held-out recordings."""

Channels = dict[str, Channel]


def _with(channels: Channels, prefixes: tuple[str, ...], change: Callable[[np.ndarray], np.ndarray]) -> Channels:
    """Return the channels with a change of those whose names begin with one of `prefixes`."""
    return {
        name: replace(c, samples=change(c.samples)) if name.partition(".")[0] in prefixes else c
        for name, c in channels.items()
    }


def with_another_machine(channels: Channels) -> Channels:
    """Return the recording of a machine with other inertia, weight and friction that does another motion."""
    # It moves through eight tenths of the way, a quarter slower, and its effort has another size and another offset.
    n = len(channels["time"].samples)
    at = np.linspace(0.0, 0.8 * (n - 1), n)

    def slower(x: np.ndarray) -> np.ndarray:
        return np.interp(at, np.arange(n), x)

    others = tuple({name.partition(".")[0] for name in channels} - {"time", "enabled"})
    moved = _with(channels, others, slower)
    small = _with(moved, POSITION_CHANNELS, lambda x: x[0] + 0.8 * (x - x[0]))
    slow = _with(small, VELOCITY_CHANNELS, lambda x: 0.8 * 0.8 * x)
    return _with(slow, EFFORT_CHANNELS, lambda x: 0.6 * x + 0.05 * float(np.ptp(x)))


def with_threefold_effort(channels: Channels) -> Channels:
    """Return the recording with three times the effort, or three times the EMG where no effort was recorded.

    A duty is a share of the supply, of which `check` accepts no threefold: it becomes a third.
    """
    kinds = {name.partition(".")[0] for name in channels}
    what = EFFORT_CHANNELS if kinds & set(EFFORT_CHANNELS) else ("emg",)
    shares = _with(channels, ("duty",), lambda x: x / 3.0)
    return _with(shares, tuple(kind for kind in what if kind != "duty"), lambda x: 3.0 * x)


def with_reversed_time(channels: Channels) -> Channels:
    """Return the recording backwards."""
    others = tuple({name.partition(".")[0] for name in channels} - {"time"})
    # What moves backwards has the other velocity.
    backwards = _with(channels, others, lambda x: x[::-1].copy())
    return _with(backwards, VELOCITY_CHANNELS, lambda x: -x)


def with_shifted_position(channels: Channels) -> Channels:
    """Return the recording with positions that lie a tenth of their range away; EMG where there is no position."""
    kinds = {name.partition(".")[0] for name in channels}
    what = POSITION_CHANNELS if kinds & set(POSITION_CHANNELS) else ("emg",)
    return _with(channels, what, lambda x: x + 0.1 * float(np.ptp(x)))


REPLACEMENTS: Mapping[str, Callable[[Channels], Channels]] = {
    "another machine": with_another_machine,
    "effort times three": with_threefold_effort,
    "time reversed": with_reversed_time,
    "position shifted": with_shifted_position,
}
"""What held-out files are replaced by, by name."""


@dataclass(frozen=True, eq=False)
class ReplacedStudy(Study):
    """A study with other contents in every held-out file, including the files of its streams."""

    change: Callable[[Channels], Channels] = with_reversed_time

    def recordings(self, use: str | None = None, **options: Any) -> tuple[Recording, ...]:
        """Return the recordings, with changed contents of held-out files."""
        super().recordings("fit")
        with _changed_channels(self.change):
            super().recordings("validate")
        return super().recordings(use, **options)

    def recording(self, name: str) -> Recording:
        """Return one recording by its name."""
        self.recordings()
        return super().recording(name)


@contextmanager
def _changed_channels(change: Callable[[Channels], Channels]) -> Iterator[None]:
    """Have every file that is read meanwhile hold changed channels, as if it had been written so."""
    read, read_optical = recording_steps.make_channels, recording_steps.read_optical

    def changed(*arguments: Any) -> Channels:
        made = change(read(*arguments))
        for channel in made.values():
            channel.samples.flags.writeable = False
        return made

    def changed_optical(*arguments: Any) -> OpticalRecording:
        found = read_optical(*arguments)
        if change is not with_reversed_time:
            return found
        return replace(found, markers={name: points[::-1].copy() for name, points in found.markers.items()})

    with (
        mock.patch.object(recording_steps, "make_channels", changed),
        mock.patch.object(recording_steps, "read_optical", changed_optical),
    ):
        yield


def with_replaced_files(study: Study, change: Callable[[Channels], Channels]) -> ReplacedStudy:
    """Return a study of the same folder in which held-out files are changed."""
    return ReplacedStudy(study.folder, study.config, out=study.out, allow_outside=study.allow_outside, change=change)


def opened_again(study: Study) -> Study:
    """Return the study as it is, with nothing read yet."""
    return Study(study.folder, study.config, out=study.out, allow_outside=study.allow_outside)


def fitted_numbers(result: Any) -> dict[str, float | None]:
    """Return every number of a result's cards and of its rows of fitted data, by its place."""
    found: dict[str, float | None] = {}
    for row in result.rows:
        if row.split == "fitted" and not row.id.endswith(".seconds"):
            found[f"row {row.id}"] = row.value
    with tempfile.TemporaryDirectory() as folder:
        for name, card in result.cards.items():
            path = Path(folder) / "card.json"
            write_card_of_any_kind(path, card)
            found |= dict(_numbers(f"card {name}", json.loads(path.read_text(encoding="utf-8"))))
    return found


def _numbers(place: str, value: Any) -> Iterator[tuple[str, float | None]]:
    if isinstance(value, dict):
        for key, each in value.items():
            if not str(key).startswith(JUDGED_ONLY_KEYS):
                yield from _numbers(f"{place}.{key}", each)
    elif isinstance(value, list):
        for i, each in enumerate(value):
            yield from _numbers(f"{place}[{i}]", each)
    elif isinstance(value, int | float) or value is None:
        yield place, value


@dataclass(frozen=True)
class Replacement:
    """What became of a procedure's fitted numbers when held-out files were replaced."""

    name: str  # what they were replaced by
    moved: tuple[str, ...]  # places of the numbers that moved, appeared or vanished
    refused: str = ""  # why `check` or the procedure refused the study; empty if neither did


def compare_replacements(
    study: Study, names: tuple[str, ...] = tuple(REPLACEMENTS), procedure: str | None = None, **options: Any
) -> list[Replacement]:
    """Run a study's procedures with each replacement of its held-out files, and compare the fitted numbers.

    All procedures are run, or one by its name. `options` are those of the procedures by name.
    """
    expected, made = fitted_numbers(run(opened_again(study), procedure, **options)), []
    for name in names:
        other = with_replaced_files(study, REPLACEMENTS[name])
        try:
            refused = [f.message for f in check(other) if f.severity == "refuse"]
            found = fitted_numbers(run(with_replaced_files(study, REPLACEMENTS[name]), procedure, **options))
        except Exception as error:  # whatever stops it counts as a refusal, and is told
            made.append(Replacement(name, (), f"{type(error).__name__}: {error}"))
            continue
        moved = [k for k in expected.keys() | found.keys() if not _is_same(expected.get(k, "?"), found.get(k, "?"))]
        made.append(Replacement(name, tuple(sorted(moved)), "; ".join(refused)))
    return made


def _is_same(one: Any, other: Any) -> bool:
    return one == other or (isinstance(one, float) and isinstance(other, float) and one != one and other != other)
