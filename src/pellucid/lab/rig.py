"""What a virtual rig is: it knows its trials, records one as a lab would, says its study, and tells its truth.

A kind of rig is one file, ``lab/<folder>/rig.py``, with a class that derives from `Rig`, and one file of constants in
``lab/rigs``. `known_rigs` finds both; everything else is shared: files, studies, recordings in memory, the commands.
"""

from __future__ import annotations

import tomllib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from .._errors import StudyError
from .recorded_table import MAIN_STREAM, MARKER_STREAM, Column, StoredTable, file_name

Outcome = TypeVar("Outcome")
Tell = Callable[[str, float], None]

BENCH = "bench-joint"
"""Kind of a rig file that names none."""

KINDS: dict[str, type[Rig]] = {}
"""Every kind of rig that was defined so far."""


@dataclass(frozen=True)
class Trial:
    """One trial of a rig's protocol."""

    name: str
    protocol: str | None = None  # As in study.toml
    use: str = "fit"
    participant: str | None = None  # participant, condition: Who, and under which condition
    condition: str | None = None
    # (n,) What is to be followed, one sample per period, where something is; which quantity, the rig's own trials say
    reference: np.ndarray | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Taken:
    """What a trial left: files as the instruments wrote them, and the truth beside them."""

    trial: Trial
    # By recording, then by stream: "main", "markers", or a stream of study.toml. One recording of the trial's name, or
    # several where pauses divide it
    files: Mapping[str, Mapping[str, StoredTable]] = field(repr=False)
    # What its entry in study.toml says beyond what follows from trial and files
    entry: Mapping[str, Any] = field(default_factory=dict)
    truth: Mapping[str, Any] = field(default_factory=dict)  # In few numbers, SI
    inside: Any = field(default=None, repr=False)  # Every sample of what no instrument shows, as the rig gives it

    @property
    def duration(self) -> float:
        """How long its recordings are [s]."""
        total = 0.0
        for streams in self.files.values():
            clock = streams[MAIN_STREAM].columns[0]
            time = clock.scale * streams[MAIN_STREAM].values[:, 0] * (1e-3 if clock.unit == "ms" else 1.0)
            total += float(time[-1] - time[0]) * len(time) / (len(time) - 1)
        return total

    @property
    def noted(self) -> Taken:
        """The same without a sample, for those who keep thousands."""
        files = {name: {s: stored.emptied for s, stored in own.items()} for name, own in self.files.items()}
        return replace(self, files=files, inside=None)

    def entries(self, common: Sequence[Column]) -> list[dict[str, Any]]:
        """Entries of its recordings in study.toml, beside whose ``[channels]`` of `common` columns each has its own."""
        made, known = [], {column.channel for column in common}
        for name, streams in self.files.items():
            entry: dict[str, Any] = {"name": name, "file": file_name(name, MAIN_STREAM)}
            if MARKER_STREAM in streams:
                entry["optical"] = file_name(name, MARKER_STREAM)
            beside = {
                stream: file_name(name, stream) for stream in streams if stream not in (MAIN_STREAM, MARKER_STREAM)
            }
            if beside:
                entry["streams"] = beside
            said = {key: getattr(self.trial, key) for key in ("protocol", "use", "participant", "condition")}
            entry |= {key: value for key, value in said.items() if value is not None}
            own = {c.channel: c.spec for c in streams[MAIN_STREAM].columns if c.channel not in known}
            own |= self.entry.get("channels", {})
            made.append(entry | self.entry | ({"channels": own} if own else {}))
        return made


@dataclass(frozen=True)
class Rig(ABC):
    """Everything a virtual rig is made of: the tables of its file, SI.

    A class that names its `kind` is found by it; `streams`, `trials`, `record`, `study` and `truth` are its own.
    """

    name: str
    tables: Mapping[str, Mapping]  # As in a file of ``lab/rigs``

    kind: ClassVar[str]  # What the file calls itself
    # What each table of the file must say: ``""`` is its head, ``"subjects.*"`` every table below ``[subjects]``, at
    # least one
    needed: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    # Tables that may have keys beside those of the package's own rig
    free: ClassVar[tuple[str, ...]] = ()
    # What its study.toml says beside a table or a key, by dotted path; ``""`` is the head
    comments: ClassVar[Mapping[str, str]] = {}
    parallel: ClassVar[bool] = False  # Whether trials side by side in threads take less time

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        if "kind" in cls.__dict__:
            KINDS[cls.kind] = cls

    def __getitem__(self, table: str) -> Mapping:
        return self.tables[table]

    @classmethod
    def parse(cls, text: str, name: str) -> Self:
        """The rig a file describes."""
        return cls(name, cls.checked(parse_tables(text, f"rig {name}"), name))

    @classmethod
    def checked(cls, tables: dict, name: str) -> dict:
        """The tables of a rig's file, with nothing missing."""
        if tables.get("kind", BENCH) != cls.kind:
            raise StudyError(f"rig {name}: found kind = {tables.get('kind')!r}, expected {cls.kind!r}")
        for table, keys in cls.needed.items():
            family, _, every = table.partition(".")
            found = tables.get(family, {}) if table else tables
            if every and not found:
                raise StudyError(f"rig {name}: found no [{family}.NAME], expected at least one")
            entries = ((f"[{family}.{k}]", v) for k, v in found.items()) if every else [(f"[{table}]", found)]
            for title, entry in entries:
                missing = [key for key in keys if key not in entry]
                if missing:
                    raise StudyError(f"rig {name}: {title} lacks {', '.join(missing)}")
        return tables

    def changed(self, values: Mapping[str, object], name: str | None = None) -> Self:
        """The same rig with some constants changed."""
        tables = _copied(self.tables)
        for path, value in values.items():
            *parts, key = path.split(".")
            table = tables
            for part in parts:
                table = table.get(part, {})
            if key not in table:
                raise StudyError(f"rig {self.name} has no constant {path}")
            table[key] = value
        return replace(self, name=name or self.name, tables=tables)

    @abstractmethod
    def streams(self) -> Mapping[str, Sequence[Column]]:
        """Columns of each file of a recording: of "main", what every recording has."""

    @abstractmethod
    def trials(self, seed: int = 1) -> Sequence[Trial]:
        """The full protocol, in the order in which it is recorded; `seed` draws what of it is random."""

    @abstractmethod
    def record(self, trial: Trial, rng: np.random.Generator, controller: Any = None) -> Taken:
        """Do one trial."""

    @abstractmethod
    def truth(self, seed: int = 1) -> dict[str, Any]:
        """What only tests, benchmarks and papers may read, SI; `seed` as the recordings were made with."""

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """What study.toml says: here what follows from trials and files; a rig adds its own tables."""
        streams = self.streams()
        said: dict[str, Any] = {"name": self.name, "channels": {c.channel: c.spec for c in streams[MAIN_STREAM]}}
        beside = {
            stream: {"channels": {c.channel: c.spec for c in columns}}
            for stream, columns in streams.items()
            if stream not in (MAIN_STREAM, MARKER_STREAM)
        }
        if beside:
            said["streams"] = beside
        if MARKER_STREAM in streams:
            clock, *coordinates = streams[MARKER_STREAM]
            said["optical"] = {
                "time": clock.spec,
                "unit": coordinates[0].unit,
                "markers": list(dict.fromkeys(c.channel.rpartition(".")[0] for c in coordinates)),
                "down": [0, 0, -1],
            }
        said["recordings"] = [entry for taken in made for entry in taken.entries(streams[MAIN_STREAM])]
        return said

    def prepared(self, controllers: Sequence[str] | None = None, seed: int = 1) -> Self:
        """The rig with all that has to be known before its first trial."""
        if controllers:
            raise StudyError(
                f"rig {self.name}: found controllers {', '.join(controllers)}, expected them with people who wear them"
            )
        return self

    def draws(self, trials: Sequence[Trial], seed: int) -> Iterator[dict[str, Any]]:
        """What `record` takes beside each of `trials`: a generator that depends on `seed` and name alone."""
        return ({"rng": np.random.default_rng([seed, 0, *trial.name.encode()])} for trial in trials)

    def record_all(
        self,
        trials: Sequence[Trial],
        seed: int,
        *,
        then: Callable[[Taken], Outcome] = lambda taken: taken,
        threads: int = 1,
        on_progress: Tell | None = None,
    ) -> Iterator[Outcome]:
        """Do trials one after another."""
        tell = on_progress or (lambda text, share: None)

        def one(trial: Trial, drawn: dict[str, Any]) -> Outcome:
            return then(self.record(trial, **drawn))

        draws = self.draws(trials, seed)
        if threads <= 1 or not self.parallel:
            for i, (trial, drawn) in enumerate(zip(trials, draws, strict=True)):
                tell(f"recording {trial.name}", i / len(trials))
                yield one(trial, drawn)
            return
        with ThreadPoolExecutor(threads) as pool:
            for i, made in enumerate(pool.map(one, trials, draws)):
                yield made
                tell(f"recorded {trials[i].name}", (i + 1) / len(trials))


def parse_tables(text: str, where: str) -> dict:
    """The tables of a rig's file, unchecked."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{where}: not valid TOML: {error}") from error


def _copied(tables: Mapping) -> dict:
    return {key: _copied(value) if isinstance(value, Mapping) else value for key, value in tables.items()}
