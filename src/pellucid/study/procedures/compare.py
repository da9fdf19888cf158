"""Compare two model cards of a joint, parameter by parameter, with the uncertainty of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import chdtrc, ndtr, ndtri

from ..._errors import IdentificationError, PellucidError
from ..._printed_command import printed_command
from ...models.card import Card, read_card
from ...models.estimates import Verdict
from ...models.slider_joint import read_slider_card
from ...models.tree_card import TreeCard, read_tree_card
from ...numerics.arguments import with_checked_arguments
from ...numerics.block_test import holm
from ..answer import Answer, AnswerNumber, AnswerPart, AnswerVerdict, Basis, Step, begun
from ..study import STUDY_FILE, Study
from .card_sources import require_fresh
from .registry import asked, open_study

DETECTABLE_STANDARD_ERRORS = 2.8
"""Size of a detectable change in standard errors. It is found in 80 % of comparisons at the 5 % level."""

CHANGE_QUESTION = "Did the joint change from A to B?"
"""Question that a comparison answers."""

COMPARED_ESTIMATES = "what each model was fitted to"
"""Data that compared parameters were computed on."""

MAX_UNSEEN_CHANGE = 0.5
"""A comparison that would have missed this change of every parameter, as a share, cannot say that nothing changed."""


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
    interval: tuple[float, float] = (np.nan, np.nan)  # of the difference; excludes zero where the change is significant

    @property
    def sentence(self) -> str:
        """The change with its interval, in words."""
        share = f", {100.0 * (self.b - self.a) / abs(self.a):+.3g} %" if self.a else ""
        low, high = self.interval
        return (
            f"{self.name.replace('_', ' ')} changed from {self.a:.4g} to {self.b:.4g} {self.unit}{share} "
            f"(difference {low:.3g} to {high:.3g} {self.unit}, p = {self.p_value:.1g})"
        )

    @property
    def detectable(self) -> float:
        """Smallest change that would have been found in 80 % of comparisons, as a share of the first value."""
        known = self.a and self.standard_error
        return DETECTABLE_STANDARD_ERRORS * self.standard_error / abs(self.a) if known else np.inf


@dataclass(frozen=True)
class Comparison:
    """Comparison of two cards."""

    family: str
    rows: tuple[ComparedParameter, ...]  # parameters in the cards' order
    statistic: float  # statistic of the joint test over all parameters
    p_value: float  # p value of the joint test
    verdicts: tuple[Verdict, ...]  # results in plain sentences
    answer: Answer  # whether the joint changed, with what a command shows of it


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
    studies = [_study_of(Path(each), allow_outside, accept_stale) for each in (a, b)]
    one = _fresh_card(Path(a), family, studies[0])
    two = _fresh_card(Path(b), family or one.family, studies[1])
    for what in ("names", "motion", "effort_unit", "family"):
        first, second = (getattr(card, what, None) for card in (one, two))
        if first != second:
            raise IdentificationError(
                f"{a} and {b} cannot be compared: {what.replace('_', ' ')} is {first!r} in the first and {second!r} in "
                "the second; identify both alike"
            )
    shared = [p.name for p in one.parameters if p.name in {q.name for q in two.parameters}]
    if not shared:
        raise IdentificationError(
            f"{a} and {b} share no parameter, expected at least one: identify both with the same friction family, "
            "--family"
        )
    difference = np.array([two[n].value - one[n].value for n in shared])
    covariance = _part(one, shared) + _part(two, shared)
    sd = np.sqrt(np.diag(covariance))
    z = np.divide(difference, sd, out=np.zeros_like(difference), where=sd > 0.0)
    p = holm(2.0 * ndtr(-np.abs(z)))
    half_widths = _half_widths(sd, z, np.asarray(p), level)
    rows = tuple(
        ComparedParameter(
            n, one[n].unit, one[n].value, two[n].value, float(s), float(zi), pi, pi < 1.0 - level, (d - half, d + half)
        )
        for n, s, zi, pi, d, half in zip(
            shared, sd, z, p, difference.tolist(), half_widths.tolist(), strict=True
        )
    )
    free = sd > 0.0
    statistic = float(difference[free] @ np.linalg.pinv(covariance[np.ix_(free, free)]) @ difference[free])
    joint_p = float(chdtrc(max(int(free.sum()), 1), statistic))
    answer = _answer(rows, joint_p, level, (str(a), str(b)), _basis(studies))
    return Comparison(one.family, rows, statistic, joint_p, (_verdict(answer),), answer)


def _half_widths(sd: np.ndarray, z: np.ndarray, p: np.ndarray, level: float) -> np.ndarray:
    """Return half widths of intervals that exclude zero exactly where Holm's test finds a change, shape (n,).

    The test of a parameter multiplies its p value by a factor; its interval has the level that the factor leaves.
    """
    alone = 2.0 * ndtr(-np.abs(z))
    factors = np.divide(p, alone, out=np.full_like(sd, len(sd)), where=alone > 0.0)
    return sd * -ndtri(0.5 * (1.0 - level) / np.maximum(factors, 1.0))


def _study_of(path: Path, allow_outside: bool, accept_stale: bool) -> Study | None:
    """Return the study of a folder, or the one in whose folder a card stands; None without one."""
    folder = next((each for each in (path, path.parent.parent) if (each / STUDY_FILE).is_file()), None)
    return None if folder is None else open_study(folder, allow_outside=allow_outside, accept_stale=accept_stale)


def _fresh_card(path: Path, family: str | None, study: Study | None) -> Card | TreeCard:
    """Return the card of a study, if the study still is what it was made from, or the card of that path."""
    if study is not None:
        _require_joint_cards(path, study)
    card = _card(path, family)
    if study is None or not (path / STUDY_FILE).is_file():
        return card
    return require_fresh(study, path / "models", card)


def _require_joint_cards(path: Path, study: Study) -> None:
    """Raise a PellucidError if a study identifies no joint, so that no command makes a card to compare."""
    procedures = asked(study)
    if (path / STUDY_FILE).is_file() and not any(procedure.makes_joint_cards for procedure in procedures):
        names = ", ".join(procedure.name.replace("_", " ") for procedure in procedures)
        raise PellucidError(
            f"{path}: found a study of {names}, expected one that identifies a joint or a robot: `compare` compares "
            f"their parameters. Pages of both studies show the figures side by side: {printed_command('report', path)}"
        )


def _basis(studies: Sequence[Study | None]) -> Basis:
    """Return the basis of a comparison: two cards, and what the studies that they stand in state of their origin."""
    simulated = {None if each is None else each.config.simulated for each in studies}
    worn = any(each is not None and each.config.worn for each in studies)
    known = simulated.pop() if len(simulated) == 1 else None
    return Basis(2, 2, "model card", COMPARED_ESTIMATES, is_simulated=known, is_worn=worn)


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


def _answer(
    rows: tuple[ComparedParameter, ...], p_value: float, level: float, compared: tuple[str, str], basis: Basis
) -> Answer:
    """Return whether the joint changed between two cards.

    Where no single parameter did, the answer is no if a change of `MAX_UNSEEN_CHANGE` would have shown in some
    parameter, and if the parameters did not change together.
    """
    changed = [row for row in rows if row.changed]
    seen = [row for row in rows if row.detectable < 1.0]
    joint = f"joint p = {p_value:.2g}"
    reason = ""
    verdict: AnswerVerdict = "yes"
    if changed:
        said = f"{'; '.join(row.sentence for row in changed)}"
    else:
        visible = ", ".join(f"{row.name.replace('_', ' ')} {100.0 * row.detectable:.2g} %" for row in seen)
        small = f". Smallest detectable changes: {visible}" if visible else ""
        said = f"No parameter changed beyond its uncertainty ({joint}){small}"
        verdict, reason = "no", "no parameter changed beyond its uncertainty"
        if p_value < 1.0 - level:
            verdict, reason = "cannot say", f"the parameters changed together ({joint}), and none alone"
        elif not any(row.detectable < MAX_UNSEEN_CHANGE for row in seen):
            bound = f"{100.0 * MAX_UNSEEN_CHANGE:g} %"
            verdict, reason = "cannot say", f"the smallest detectable change of every parameter exceeds {bound}"
    parts = tuple(_part_of(row) for row in rows)
    numbers = tuple(
        AnswerNumber(f"change of {row.name.replace('_', ' ')}", row.b - row.a, row.unit, row.interval)
        for row in (changed or rows)
    )
    if verdict == "cannot say":
        step = Step("Record longer and over a larger range, identify again, then compare", line=_typed(compared))
    else:
        step = Step("Draw the page of the later one", line=printed_command("report", compared[1]))
        step = step if (Path(compared[1]) / STUDY_FILE).is_file() else Step("Compare again", line=_typed(compared))
    return Answer(CHANGE_QUESTION, verdict, said, reason, parts, numbers, basis, next=(step,))


def _typed(compared: tuple[str, str]) -> str:
    return printed_command("compare", *compared)


def _part_of(row: ComparedParameter) -> AnswerPart:
    """Return whether one parameter changed."""
    if row.changed:
        return AnswerPart(row.name, "yes", row.sentence)
    if row.detectable < MAX_UNSEEN_CHANGE:
        return AnswerPart(row.name, "no", f"a change of {100.0 * row.detectable:.2g} % would have been detected")
    return AnswerPart(row.name, "cannot say", "its uncertainty is too large to detect changes")


def _verdict(answer: Answer) -> Verdict:
    """Return the answer as a finding."""
    return Verdict("warning" if answer.verdict == "yes" else "good" if answer.verdict == "no" else "note",
                   begun(answer.said))  # fmt: skip
