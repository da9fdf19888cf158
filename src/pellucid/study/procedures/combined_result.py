"""Results of several procedures of one study as one result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

from ...models.parameter import rank_verdicts
from .result import Result

if TYPE_CHECKING:
    from ..study import Study


@dataclass(frozen=True, kw_only=True, repr=False)
class CombinedResult(Result):
    """Results of several procedures of one study.

    Attributes
    ----------
    parts : tuple of Result
        One of each procedure, in the order in which the report shows them.
    """

    parts: tuple[Result, ...] = field(repr=False)

    @classmethod
    def from_parts(cls, parts: Sequence[Result]) -> Self:
        """Return one result of all `parts`, which are of one study."""
        first = parts[0]
        return cls(
            study=first.study,
            headline=" ".join(f"{part.headline.rstrip('.')}." for part in parts),
            tables=tuple(table for part in parts for table in part.tables),
            verdicts=rank_verdicts(tuple(verdict for part in parts for verdict in part.verdicts)),
            rows=tuple(row for part in parts for row in part.rows),
            cards={name: card for part in parts for name, card in part.cards.items()},
            checksums={name: checksum for part in parts for name, checksum in part.checksums.items()},
            confidence=first.confidence,
            procedure=" and ".join(part.procedure for part in parts),
            command=" and ".join(dict.fromkeys(part.command for part in parts)),
            parts=tuple(parts),
        )

    @property
    def each(self) -> tuple[Result, ...]:
        """Results of the single procedures."""
        return self.parts

    @property
    def prose(self) -> str:
        """Sentences of all parts for a paper."""
        return "\n\n".join(part.prose for part in self.parts if part.prose)

    def written(self, study: Study) -> str:
        """Return the places of all files that the parts write, in words."""
        return "; ".join(dict.fromkeys(part.written(study) for part in self.parts))
