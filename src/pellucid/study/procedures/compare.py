"""Compare two model cards of a joint, parameter by parameter, with the uncertainty of both."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import chdtrc, ndtr

from ..._errors import IdentificationError, PellucidError
from ...models.card import Card, read_card
from ...models.estimates import Verdict
from ...models.slider_joint import read_slider_card
from ...models.tree_card import TreeCard, read_tree_card
from ...numerics.arguments import with_checked_arguments
from ...numerics.block_test import holm
from ..study import STUDY_FILE
from .card_sources import require_fresh
from .registry import open_study

DETECTABLE_STANDARD_ERRORS = 2.8
"""Size of a detectable change in standard errors. It is found in 80 % of comparisons at the 5 % level."""


@dataclass(frozen=True)
class ComparedParameter:
    """Comparison of one parameter of two cards."""

    name: str
    unit: str
    a: float  # value on the first card
    b: float  # value on the second card
    standard_error: float  # standard error of the difference
    z: float  # difference divided by its standard error
    p_value: float  # p value with Holm's adjustment
    changed: bool  # whether the change is significant


@dataclass(frozen=True)
class Comparison:
    """Comparison of two cards."""

    family: str
    rows: tuple[ComparedParameter, ...]  # parameters in the cards' order
    statistic: float  # statistic of the joint test over all parameters
    p_value: float  # p value of the joint test
    verdicts: tuple[Verdict, ...]  # results in plain sentences


@with_checked_arguments
def compare(
    a: Path | str,
    b: Path | str,
    *,
    family: str | None = None,
    level: float = 0.95,
    allow_outside: bool = False,
    accept_stale: bool = False,
) -> Comparison:
    """Compare two studies of the same joint, or two model cards.

    Parameters
    ----------
    a, b : path
        Study folders that were identified, or model cards.
    family : str, optional
        Friction family to compare; by default the first card's best one, if both studies have it.
    level : float
        Confidence level of the tests, over all parameters together.
    allow_outside : bool
        Whether recordings of the studies may lie outside their folders.
    accept_stale : bool
        Whether stale cards, made from an earlier state of the study, are compared. A card that is named itself is
        compared as it is.

    Returns
    -------
    Comparison

    Raises
    ------
    IdentificationError
        If the two cards are not of the same kind of joint, drive unit and family.
    PellucidError
        If a card is missing, unreadable or stale.

    Examples
    --------
    Two studies that were identified; here one with itself:

    >>> import pellucid as pl
    >>> compared = pl.compare("my-elbow", "my-elbow")
    >>> any(parameter.changed for parameter in compared.rows)
    False
    """
    one = _fresh_card(Path(a), family, allow_outside, accept_stale)
    two = _fresh_card(Path(b), family or one.family, allow_outside, accept_stale)
    for what in ("names", "motion", "effort_unit", "family"):
        first, second = (getattr(card, what, None) for card in (one, two))
        if first != second:
            raise IdentificationError(
                f"{a} and {b} cannot be compared: {what.replace('_', ' ')} is {first!r} in the first and {second!r} in "
                "the second"
            )
    shared = [p.name for p in one.parameters if p.name in {q.name for q in two.parameters}]
    if not shared:
        raise IdentificationError(f"{a} and {b} share no parameter")
    difference = np.array([two[n].value - one[n].value for n in shared])
    covariance = _part(one, shared) + _part(two, shared)
    sd = np.sqrt(np.diag(covariance))
    z = np.divide(difference, sd, out=np.zeros_like(difference), where=sd > 0.0)
    p = holm(2.0 * ndtr(-np.abs(z)))
    rows = tuple(
        ComparedParameter(n, one[n].unit, one[n].value, two[n].value, float(s), float(zi), pi, pi < 1.0 - level)
        for n, s, zi, pi in zip(shared, sd, z, p, strict=True)
    )
    free = sd > 0.0
    statistic = float(difference[free] @ np.linalg.pinv(covariance[np.ix_(free, free)]) @ difference[free])
    joint_p = float(chdtrc(max(int(free.sum()), 1), statistic))
    return Comparison(one.family, rows, statistic, joint_p, _sentences(rows, joint_p))


def _fresh_card(path: Path, family: str | None, allow_outside: bool, accept_stale: bool) -> Card | TreeCard:
    """Return the card of a study, if the study still is what it was made from, or the card of that path."""
    card = _card(path, family)
    if not (path / STUDY_FILE).is_file():
        return card
    study = open_study(path, allow_outside=allow_outside, accept_stale=accept_stale)
    return require_fresh(study, path / "models", card)


def _card(path: Path, family: str | None) -> Card | TreeCard:
    if path.is_file() and path.name.startswith("tree."):
        return read_tree_card(path)
    # Base parameters with plain friction are the same in every study of a robot.
    tree = path / "models" / f"tree.{family or 'base'}.json"
    if tree.is_file():
        return read_tree_card(tree)
    if path.is_file():
        return read_slider_card(path) if path.name.startswith("slider.") else read_card(path)
    slider = path / "models" / f"slider.{family or 'load'}.json"
    if slider.is_file():
        return read_slider_card(slider)
    several = [each.name for each in sorted((path / "models").glob("joint_*.json")) if each.name.count(".") == 1]
    if several:
        raise PellucidError(
            f"{path}: found the cards of several joints ({', '.join(several)}), expected one: name the cards of a "
            f"joint in both studies, such as {path / 'models' / several[0]}"
        )
    # The chosen estimators may differ, so least-squares estimates are compared.
    family = family or read_card(path / "models" / "joint.json").family
    return read_card(path / "models" / f"joint.{family}.json")


def _part(card: Card | TreeCard, names: list[str]) -> np.ndarray:
    index = [i for n in names for i, p in enumerate(card.parameters) if p.name == n]
    # Effects that the model neglects are the same on both cards and cause no change, so they are not counted.
    return np.array(card.statistical or card.covariance)[np.ix_(index, index)]


def _sentences(rows: tuple[ComparedParameter, ...], p_value: float) -> tuple[Verdict, ...]:
    changed = [r for r in rows if r.changed]
    if not changed:
        shares = {
            r.name: 100.0 * DETECTABLE_STANDARD_ERRORS * r.standard_error / abs(r.a)
            for r in rows
            if r.a and r.standard_error
        }
        visible = ", ".join(f"{n.replace('_', ' ')} {s:.2g} %" for n, s in shares.items() if s < 100.0)
        small = f" Changes that would have shown: {visible}." if visible else ""
        return (Verdict("good", f"No parameter changed beyond its uncertainty (joint p = {p_value:.2g}).{small}"),)
    return tuple(
        Verdict(
            "warning",
            f"{r.name.replace('_', ' ')} changed from {r.a:.4g} to {r.b:.4g} {r.unit} "
            f"({100.0 * (r.b - r.a) / abs(r.a):+.3g} %, p = {r.p_value:.1g}).",
        )
        for r in changed
    )
