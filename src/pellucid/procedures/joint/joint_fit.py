"""Everything `identify` found on one joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...fit.joint.friction_family import FamilyFit
from ...fit.parameter import Parameter, Verdict


@dataclass(frozen=True)
class JointFit:
    """Everything `identify` found on one joint.

    Parameters
    ----------
    study : str
        The study's name, first part of every figure id.
    motion, effort_unit, lifts : str
    families : mapping of str to FamilyFit
        In the order they were asked for.
    best : str
        The family with the smallest held-out effort error (fitted error where nothing is held out).
    drive_constant : Parameter, optional
        From recordings with a known payload.
    verdicts : tuple of Verdict
    filter_note : str
        The processing, as one line: it stands beside every figure.
    checksums : mapping of str to str
        SHA-256 of every recording's file, by recording.
    """

    study: str
    motion: str
    effort_unit: str
    lifts: str
    families: Mapping[str, FamilyFit]
    best: str
    verdicts: tuple[Verdict, ...]
    filter_note: str
    checksums: Mapping[str, str]
    drive_constant: Parameter | None = None

    def __getitem__(self, name: str) -> Parameter:
        """A parameter of the best family."""
        return self.families[self.best][name]
