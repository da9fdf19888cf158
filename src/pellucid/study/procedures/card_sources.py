"""Inputs of a model card, and a check of whether they are still those of the study, so that no stale card is used."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from ..._errors import PellucidError
from ..._printed_command import printed_command
from ...models.estimates import rank_verdicts
from ..study import INSTRUMENTS_KEY, STUDY_FILE, checksum, without_keys
from .result import fingerprint

if TYPE_CHECKING:
    from ..study import Study
    from .procedure import Procedure
    from .result import Result

ResultT = TypeVar("ResultT", bound="Result")
"""Kind of result."""

PROCEDURE_KEY = "procedure"
"""Key of a card's sources that names the procedure which made it; every other key names a table or a file."""

UNUSED_TABLES = frozenset({"name", "citation", "notes", "assumed", "simulated", "digitised", "worn"})
"""Parts of study.toml that no identification uses."""


class CardWithSources(Protocol):
    """Fields that every kind of card has."""

    @property
    def study(self) -> str:
        """Name of the study that it was made in."""

    @property
    def checksums(self) -> Mapping[str, str]:
        """SHA-256 of the recordings that it was made from."""

    @property
    def made_from(self) -> Mapping[str, str]:
        """Checksums of all inputs, by name; empty for an old card."""


Made = TypeVar("Made", bound=CardWithSources)


def card_sources(study: Study, procedure: Procedure) -> dict[str, str]:
    """Return the checksums of all inputs of a card of `procedure`, by their names in messages.

    Inputs are the parsed tables of study.toml, recordings, and other cards. Tables of other commands' procedures are
    excluded. So are the instruments of a joint, and its limits if the procedure does not use them: a controller's
    limits and instruments may be stated after its model was identified.
    """
    from .registry import ALL_PROCEDURES

    stated = study.config.model_fields_set  # the tables of other procedures are not imported
    others = {
        each.name for each in ALL_PROCEDURES
        if each.name in stated and each.command != procedure.command and each.table is not None
    }  # fmt: skip
    used = study.config.model_dump(exclude_defaults=True, exclude=UNUSED_TABLES | others, warnings=False)
    unused = (INSTRUMENTS_KEY,) if procedure.uses_limits else (INSTRUMENTS_KEY, "limits")
    used["rig"] = without_keys(used["rig"], *unused)
    found = {PROCEDURE_KEY: procedure.name}
    for name, table in sorted(used.items()):
        text = json.dumps(table, sort_keys=True, default=str)
        found[f"{STUDY_FILE} [{name}]"] = sha256(text.encode()).hexdigest()
    # Cards may be rewritten while a study is open, so their checksums are not cached; recordings are read once.
    found |= {_called(study, path): study.digest(path) for path in study.files()}
    return found | {_called(study, path): _checksum(path) for path in procedure.inputs(study)}


def require_fresh(study: Study, path: Path, card: Made) -> Made:
    """Return a card if its inputs are still those of the study, or if stale cards are accepted.

    Otherwise raise a PellucidError that names the changes.
    """
    if study.accept_stale:
        return card
    from .registry import ALL_PROCEDURES

    name = card.made_from.get(PROCEDURE_KEY, "")
    procedure = next((each for each in ALL_PROCEDURES if each.name == name), None)
    command = "identify" if procedure is None else procedure.command
    if not card.made_from:
        if not _has_other_recordings(study, card):
            return card
        problem = "found an outdated card: its recordings have changed or were replaced"
    elif procedure is None:
        problem = f'found a card of the unknown procedure "{name}", expected one of this study as it is now'
    else:
        changed = list(_changes(card.made_from, card_sources(_read_anew(study), procedure)))
        if not changed:
            return card
        whose = "" if card.study == study.name else f" of the study {card.study}"
        problem = f"found an outdated card{whose}: {', '.join(changed)} changed since it was made"
    raise PellucidError(
        f"{path}: {problem}; {command} again: {printed_command(command, study.folder)} (or use it as it is with "
        "--accept-stale, accept_stale=True)"
    )


def source_notes(name: str, card: CardWithSources) -> tuple[str, ...]:
    """Return what must be told of a card that does not say what it was made from, such as one that was written by an
    earlier version or by hand."""
    if card.made_from:
        return ()
    return (f"{name} does not state its sources, so that changes of study.toml since then cannot be detected.",)


def _has_other_recordings(study: Study, card: CardWithSources) -> bool:
    """Return whether an old card names recordings by their checksums that are not those of the study."""
    try:
        known = {checksum(path) for path in study.files()}
    except PellucidError:
        return False  # without the recordings nothing can be compared
    return not {each for each in card.checksums.values() if each} <= known


def _changes(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    """Yield the names of inputs that differ, with a remark on those that are missing or new."""
    for name in (*before, *(name for name in now if name not in before)):
        if before.get(name) != now.get(name):
            end = " (new)" if name not in before else " (gone)" if name not in now else ""
            yield name + end


def _read_anew(study: Study) -> Study:
    """Return the study without cached checksums, because a file may have changed since it was read."""
    return replace(study, kept=replace(study.kept, digests={}))


def _called(study: Study, path: Path) -> str:
    if path.parent in (study.models_dir, study.folder / "models"):
        return f"models/{path.name}"  # wherever results are written to
    # A file may lie outside the study's folder.
    return Path(os.path.relpath(path, study.folder)).as_posix()


def _checksum(path: Path) -> str:
    return checksum(path) if path.is_file() else ""


def found_by(procedure: Procedure, study: Study, result: ResultT) -> ResultT:
    """Add to a result and its cards their inputs and procedure, and sort its verdicts, worst first."""
    sources = card_sources(study, procedure) if result.cards else {}
    return replace(
        result,
        cards={name: replace(card, made_from=sources) for name, card in result.cards.items()},
        verdicts=rank_verdicts(result.verdicts),
        procedure=procedure.name,
        command=procedure.command,
        made_from=fingerprint(study, procedure),
    )
