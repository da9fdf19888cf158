"""Muscle synergies, how many, and whether people and conditions share them."""

from __future__ import annotations

from pydantic import Field

from ..muscle_tables import EnvelopeTable
from ..procedure import Procedure, late


class SynergiesTable(EnvelopeTable):
    """Muscle synergies: ``[synergies]``.

    Attributes
    ----------
    number : int or None
        Of synergies; without it as few as account for 90 % of the variance of what was not fitted.
    most : int
        That are tried.
    """

    number: int | None = Field(None, ge=1, le=30)
    most: int = Field(8, ge=1, le=30)


class SynergiesProcedure(Procedure):
    """Muscle synergies."""

    name, command = "synergies", "synergies"
    table = SynergiesTable
    whole = True
    faults = late("synergies.find_synergies", "faults")
    run = late("synergies.find_synergies", "run")
    page = late("synergies.synergies_page", "page")
