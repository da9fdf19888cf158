"""Virtual rigs: each has constants, a protocol of trials, recordings as a lab would make them, a study and a truth.

A kind of rig is a class that derives from `Rig` in ``<folder>/rig.py``, and a file of constants in ``rigs``.
The class names the type of its constants, a class that derives from `RigConstants`. `known_rigs` finds class and file.
Files, studies, recordings in memory and commands are shared by all rigs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from pellucid._errors import StudyError
from pellucid._given import parse_toml

from .constants import RigConstants
from .processes import ordered_results, results_from_threads
from .recorded_table import MAIN_STREAM, MARKER_STREAM, Column, StoredTable, file_name

Outcome = TypeVar("Outcome")
Tell = Callable[[str, float], None]

Streams = Mapping[str, StoredTable]
"""Files of one recording by stream: "main", "markers", or a stream of study.toml."""

Store = Callable[[str, Streams], Streams]
"""A function that gets the name and the files of a recording as soon as it is made, and returns the files to keep."""

DEFAULT_KIND = "bench-joint"
"""Kind of a rig whose file names none."""

KINDS: dict[str, type[Rig]] = {}
"""Class of each kind of rig that has been defined."""


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
    """Result of a trial: files as the instruments wrote them, and the true values."""

    trial: Trial
    # By recording: one of the trial's name, or several where pauses divide it
    files: Mapping[str, Streams] = field(repr=False)
    # What its entry in study.toml says beyond what follows from trial and files
    entry: Mapping[str, Any] = field(default_factory=dict)
    truth: Mapping[str, Any] = field(default_factory=dict)  # In few numbers, SI
    inside: Any = field(default=None, repr=False)  # Every sample of what no instrument shows, as the rig gives it

    @property
    def noted(self) -> Taken:
        """The same without a sample, for those who keep thousands."""
        files = {name: {s: stored.emptied for s, stored in own.items()} for name, own in self.files.items()}
        return replace(self, files=files, inside=None)

    def entries(self, common: Sequence[Column]) -> list[dict[str, Any]]:
        """Return the entries of its recordings in study.toml; each adds its own channels to those of the `common`
        columns.
        """
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
            made.append(entry | dict(self.entry) | ({"channels": own} if own else {}))
        return made


@dataclass(frozen=True)
class Rig(ABC):
    """A virtual rig: its name and the constants of its file, SI.

    A class that sets `kind` is found by it. It implements `streams`, `trials`, `record` and `truth`, and extends
    `study`. ``rig["table"]`` is a table of the file.
    """

    name: str
    constants: RigConstants  # all tables of a file of ``rigs``

    kind: ClassVar[str]  # value of ``kind`` in the file
    constants_type: ClassVar[type[RigConstants]] = RigConstants  # class that reads and checks the file
    # Comments of study.toml beside a table or a key, by dotted path; ``""`` is the head of the file.
    comments: ClassVar[Mapping[str, str]] = {}
    parallel: ClassVar[bool] = False  # whether recording trials in several threads takes less time

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        if "kind" in cls.__dict__:
            KINDS[cls.kind] = cls

    def __getitem__(self, table: str) -> Any:
        """Return a table of the file, or a constant of its head."""
        return self.constants[table]

    @property
    def tables(self) -> dict[str, Any]:
        """All that the file says, as nested dictionaries."""
        return self.constants.as_tables()

    @classmethod
    def parse(cls, text: str, name: str) -> Self:
        """Return the rig that the text of a file describes."""
        return cls(name, cls.read_constants(text, name))

    @classmethod
    def read_constants(cls, text: str, name: str) -> RigConstants:
        """Return the constants of a file's text; raise a StudyError if one is missing, unknown or impossible."""
        tables = parse_tables(text, f"rig {name}")
        if tables.get("kind", DEFAULT_KIND) != cls.kind:
            raise StudyError(f"rig {name}: found kind = {tables.get('kind')!r}, expected {cls.kind!r}")
        return cls.constants_type.from_tables(tables, f"rig {name}", text)

    def changed(self, values: Mapping[str, object], name: str | None = None) -> Self:
        """Return the rig with other values of some constants, by the dotted path of each.

        Raises
        ------
        StudyError
            If a path names no constant, or a value is not of its type or out of its bounds.
        """
        return replace(self, name=name or self.name, constants=self.constants.with_values(values, f"rig {self.name}"))

    @abstractmethod
    def streams(self) -> Mapping[str, Sequence[Column]]:
        """Columns of each file of a recording: of "main", what every recording has."""

    @abstractmethod
    def trials(self, seed: int = 1) -> Sequence[Trial]:
        """The full protocol, in the order in which it is recorded; `seed` draws what of it is random."""

    @abstractmethod
    def record(self, trial: Trial, rng: np.random.Generator, controller: Any = None) -> Taken:
        """Do one trial."""

    def record_and_store(self, trial: Trial, store: Store, **drawn: Any) -> Taken:
        """Do one trial as `record` does with the arguments `drawn`; `store` gets each recording."""
        taken = self.record(trial, **drawn)
        return replace(taken, files={name: store(name, streams) for name, streams in taken.files.items()})

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
        """Yield further arguments of `record` for each of `trials`: a generator that depends on `seed` and name
        alone.
        """
        return ({"rng": np.random.default_rng([seed, 0, *trial.name.encode()])} for trial in trials)

    def record_all(
        self,
        trials: Sequence[Trial],
        seed: int,
        *,
        store: Store = lambda name, streams: streams,
        then: Callable[[Taken], Outcome] = lambda taken: taken,
        threads: int = 1,
        executor: Executor | None = None,
        on_progress: Tell | None = None,
    ) -> Iterator[Outcome]:
        """Do trials one after another, or each on a worker of an `executor`."""
        tell = on_progress or (lambda text, share: None)
        draws = self.draws(trials, seed)
        if executor is None and (threads <= 1 or not self.parallel):
            for i, (trial, drawn) in enumerate(zip(trials, draws, strict=True)):
                tell(f"recording {trial.name}", i / len(trials))
                yield self._record_one(trial, drawn, store, then)
            return
        jobs = [(self._record_one, *job, store, then) for job in zip(trials, draws, strict=True)]
        if executor is not None:
            yield from ordered_results(
                jobs, tell=lambda done, of: tell(f"recorded {done} of {of} trials", done / of), executor=executor
            )
            return
        for i, made in enumerate(results_from_threads(jobs, threads)):
            yield made
            tell(f"recorded {trials[i].name}", (i + 1) / len(trials))

    def _record_one(
        self, trial: Trial, drawn: dict[str, Any], store: Store, then: Callable[[Taken], Outcome]
    ) -> Outcome:
        return then(self.record_and_store(trial, store, **drawn))


def parse_tables(text: str, where: str) -> dict:
    """The tables of a rig's file, unchecked."""
    return parse_toml(text, where)
