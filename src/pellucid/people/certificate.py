r"""Certificate of transparency: test whether all end points lie within their margins.

"Transparent" is claimed only if every end point lies within its margin: this is an intersection-union test.
Its level is that of each end point [1]_, so that no level is divided by the number of end points; many end points cost
power. "Not transparent" is claimed if one end point lies beyond its margin. It is also claimed if more people lie far
beyond the margin than a transparent robot may have. One of several tests may succeed by chance; therefore Holm's
correction applies to the p-values of these claims. Otherwise the study is undecided, and the certificate reports the
number of participants that would decide it.

The claim is about an *estimand*, stated before the data: the mean of people's changes or their pseudo-median. If
sessions have an order, the estimate is free of the effects of their periods. The claim then holds for every carry-over
up to a declared one (`session_periods`). A mean may be small although one person is slowed by half. Therefore two
shares are tested in addition: people within the margin, and people far beyond it (`share_of_people`).

A change may have another cause than the condition: movements that were still changing, slow movements without a value,
or the period of differences that are known by bounds alone. Each such cause is a `Doubt`. It is tested, and the change
without it is compared with the margin too. If the doubt matters and the change without it leads to another result, the
end point is undecided. A doubt can thus only withdraw a claim, never make one. Some doubts always matter, because a
small study may not show their effect.

`decide` executes an `Analysis`. Recordings, tables and arrays hand it what they know of people's changes.

.. [1] R. L. Berger, J. C. Hsu, "Bioequivalence trials, intersection-union tests and equivalence confidence sets", Stat.
   Sci. 11, 1996.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from .._errors import PellucidError
from .._tabular import data_frame, html_table, text_table
from ..numerics.block_test import holm
from .analysis import ESTIMAND_METHODS, Analysis, EndPoint, Estimand
from .certificate_text import (
    change_text,
    interval_level,
    interval_with_unit,
    margin_text,
    p_text,
    people_text,
    tipping_text,
    undecided_reason,
)
from .comparison import signed_rank
from .curves import CurveComparison
from .equivalence import (
    BEYOND_MARGIN,
    DEFAULT_CARRY_OVER,
    UNDECIDED,
    WITHIN_MARGIN,
    Equivalence,
    Margin,
    Method,
    equivalence,
)
from .movement_noise import MovementNoise
from .session_periods import SessionPeriods
from .share_of_people import DEFAULT_RULE, SHOWN, ShareRule, ShareTest

PASS = "transparent"
"""Verdict if every end point lies within its margin."""

FAIL = "not transparent"
"""Verdict if at least one end point lies beyond its margin, after the correction of Holm."""

CANNOT_SAY = "cannot say"
"""Verdict if the data support neither of the other two."""


@dataclass(frozen=True)
class Doubt:
    """Another possible cause of a change, and the equivalence test of the end point without that cause."""

    what: str  # cause: `PERIOD_DOUBT` or another of the constants below
    p_value: float  # p value of the test that the cause has no effect
    without: Equivalence  # test of the end point with the effect of the cause removed
    always: bool = False  # True: both tests must agree even if the cause is not significant

    def weighs(self, alpha: float) -> bool:
        """Return whether the doubt counts: its p value is at most `alpha`, or it counts always."""
        return self.always or self.p_value <= alpha


@dataclass(frozen=True, repr=False)
class Certificate:
    """Result of the joint test of all end points under one condition."""

    end_points: Mapping[str, Equivalence]
    beyond: Mapping[str, float]  # p values of "beyond the margin" by end point, corrected after Holm
    alpha: float
    doubts: Mapping[str, tuple[Doubt, ...]] = field(default_factory=dict)  # doubts by end point
    curves: Mapping[str, CurveComparison] = field(default_factory=dict)  # curves with margins, judged as end points
    rule: ShareRule = DEFAULT_RULE  # shares of people that must be shown
    post_hoc: tuple[str, ...] = ()  # in what the analysis deviates from the registered one, in words
    points: Mapping[str, EndPoint] = field(default_factory=dict)  # end points as they were stated
    far: Mapping[str, float] = field(default_factory=dict)  # p values of "too many people far beyond", after Holm

    @property
    def statement(self) -> str:
        """Return the verdict, with "post hoc" if the analysis is not the registered one."""
        return f"{self.verdict} (post hoc)" if self.post_hoc else self.verdict

    @property
    def p_value(self) -> float:
        """Return the p-value of the claim that all end points lie within their margins: the largest single one."""
        return max(each.p_within for each in self._all.values())

    @property
    def _all(self) -> dict[str, Equivalence | CurveComparison]:
        return {**self.end_points, **self.curves}

    @property
    def verdict(self) -> str:
        """``"transparent"``, ``"not transparent"`` or ``"cannot say"``."""
        said = [self.said_of(name) for name in self._all]
        if BEYOND_MARGIN in said:
            return FAIL
        return PASS if set(said) == {WITHIN_MARGIN} else CANNOT_SAY

    def tested(self, name: str) -> str:
        """Return ``"within"``, ``"beyond"`` (corrected after Holm) or ``"undecided"`` by the test of one end point."""
        if self._all[name].p_within <= self.alpha:
            return WITHIN_MARGIN
        return BEYOND_MARGIN if self.p_beyond(name) <= self.alpha else UNDECIDED

    def p_beyond(self, name: str) -> float:
        """Return the p value, after Holm, that an end point or too many people's changes lie beyond the margin."""
        return min(self.beyond[name], self.far.get(name, 1.0))

    def contradicted(self, name: str) -> tuple[Doubt, ...]:
        """Return the doubts that count and that contradict the test of an end point.

        Their level is shared among the end points: each kind of doubt arises by chance in at most alpha of studies.
        """
        said = self.tested(name)
        own = self.doubts.get(name, ()) if said != UNDECIDED else ()
        level = self.alpha / len(self.end_points)
        return tuple(doubt for doubt in own if doubt.weighs(level) and not self._says_without(doubt, said))

    def _says_without(self, doubt: Doubt, said: str) -> bool:
        """Return whether the change without a cause says the same: of people whose changes are bounds, shares too."""
        without = doubt.without
        if without.verdict != said:
            return False
        return said != WITHIN_MARGIN or not without.bounded or without.shows_people(self.rule)

    def share_test(self, name: str) -> ShareTest | None:
        """Return the tests of the shares of people of an end point; None of a curve."""
        return self.end_points[name].share_test(self.rule) if name in self.end_points else None

    def point(self, name: str) -> EndPoint:
        """Return an end point as stated; an unstated one is in the unit of its differences."""
        own = self.points.get(name)
        return EndPoint(name, "rad", "", self.end_points[name].margin, False) if own is None else own

    def reason(self, name: str) -> str:
        """Return why nothing is claimed of an end point; "" where it is within or beyond its margin."""
        if self.said_of(name) != UNDECIDED:
            return ""
        doubts = [f"not shown {DOUBT_DESCRIPTIONS[doubt.what]}" for doubt in self.contradicted(name)]
        if doubts or name not in self.end_points:
            return ", ".join(doubts)
        return f"undecided: {undecided_reason(self.point(name), self.end_points[name], self.rule)}"

    def is_decided_by_people(self, name: str) -> bool:
        """Return whether the number of people far beyond its margin puts an end point there, and not its interval.

        Where Holm's correction leaves it undecided, it is said of the end point tested alone.
        """
        if name not in self.end_points or self.beyond[name] <= self.alpha:
            return False
        test = self.end_points[name]
        is_alone = test.verdict == BEYOND_MARGIN and test.p_beyond > self.alpha
        return is_alone or self.far.get(name, 1.0) <= self.alpha

    def far_note(self, name: str) -> str:
        """Return in brackets how many people lie far beyond, where that alone makes an end point "beyond"; else ""."""
        if not self.is_decided_by_people(name):
            return ""
        shares = self.end_points[name].share_test(self.rule)
        return f" ({shares.far} of {shares.people} people by more than {shares.rule.far_margins:g} margins)"

    def assumption(self) -> str:
        """Return the largest carry-over that is assumed, in a sentence; "" where sessions have no order."""
        ordered = [test for test in self.end_points.values() if test.sessions is not None]
        if not ordered:
            return ""
        return f"assumed: a carry-over between sessions of at most {ordered[0].largest_carry_over:g} margins"

    def to_frame(self):
        """Return one row for each end point as a data frame; needs pandas."""
        rows = self._rows()
        return data_frame({name: [row[name] for row in rows] for name in rows[0]} if rows else {})

    def _rows(self) -> list[dict[str, Any]]:
        made = []
        for name, test in self.end_points.items():
            point, shares = self.point(name), test.share_test(self.rule)
            low, high = (point.shown(end) for end in test.interval)
            made.append({
                "index": name, "change": point.shown(test.estimate), "low": low, "high": high, "unit": point.unit,
                "margin_low": point.shown(test.margin.low), "margin_high": point.shown(test.margin.high),
                "p_within": test.p_within, "p_beyond": self.beyond[name], "p_far": self.far.get(name, 1.0),
                "people": shares.people,
                "people_within": shares.within, "least_share_within": shares.least_within,
                "most_share_far": shares.most_far, "tipping_point": self.tipping_point(name),
                "largest_carry_over": test.largest_carry_over, "said": self.said_of(name), "reason": self.reason(name),
            })  # fmt: skip
        return made

    def _table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        head = ("index", "change", f"{interval_level(self.alpha)} interval", "margin", "p within", "result",
                "people", "tipping point")  # fmt: skip
        rows = []
        for name, test in self.end_points.items():
            point = self.point(name)
            rows.append((
                name, change_text(point, test), interval_with_unit(point, test),
                margin_text(point, test), p_text(test.p_within), self.said_of(name),
                people_text(test.share_test(self.rule)), tipping_text(self.tipping_point(name), test),
            ))  # fmt: skip
        return head, rows

    def _facts(self) -> tuple[str, ...]:
        reasons = [f"{name}, {reason}" for name in self._all if (reason := self.reason(name))]
        apart = f"post hoc, not as registered: {'; '.join(self.post_hoc)}" if self.post_hoc else ""
        return tuple(fact for fact in (*reasons, self.assumption(), apart) if fact)

    def __repr__(self) -> str:
        return "\n".join((self.statement, text_table(*self._table()), *self._facts()))

    def _repr_html_(self) -> str:
        return html_table(f"Certificate: {self.statement}", *self._table(), self._facts())

    def people_answer(self, name: str) -> str:
        """Return ``"shown"``, ``"not shown"`` or ``"too few"``: are the shares of people of an end point shown?

        A curve has no shares, and is said to be shown.
        """
        shares = self.share_test(name)
        return SHOWN if shares is None else shares.answer

    def lacks_people(self, name: str) -> bool:
        """Return whether an end point tested within fails to show the shares of people."""
        own = self.end_points.get(name)
        return own is not None and self.tested(name) == WITHIN_MARGIN and not own.shows_people(self.rule)

    def tipping_point(self, name: str) -> float | None:
        """Return the carry-over, in half-widths of its margin, that overturns the verdict of an end point.

        None if none would: the verdict is "undecided", or nobody's sessions are ordered.
        """
        if name not in self.end_points or self.said_of(name) == UNDECIDED:
            return None
        return self.end_points[name].tipping_point(self.rule)

    def said_of(self, name: str) -> str:
        """Return the result of one end point's test.

        A doubt that contradicts it and shares of people that are not shown each make it ``"undecided"``.
        """
        taken = self.contradicted(name) or self.lacks_people(name)
        return UNDECIDED if taken else self.tested(name)


def certificate(
    differences: Mapping[str, np.ndarray],
    margins: Mapping[str, Margin],
    *,
    alpha: float = 0.05,
    estimand: Estimand = "mean",
    people: float | None = None,
    people_level: float = DEFAULT_RULE.alpha,
    sessions: SessionPeriods | None = None,
    largest_carry_over: float = DEFAULT_CARRY_OVER,
    method: Method | None = None,
) -> Certificate:
    """Test end points together.

    Parameters
    ----------
    differences : mapping of str to ndarray, shape (n,)
        One difference for each participant by end point, in the unit of its margin.
    margins : mapping of str to Margin
        Margin of each end point.
    alpha : float
        Probability of a false "transparent" about the estimand.
    estimand : str
        ``"mean"`` of the differences, whatever their skewness; ``"pseudo-median"``, which assumes that their
        distribution is symmetric; or ``"mean and people"``, the mean with another share of `people` than 75 %.
    people : float, optional
        Share of people in (0, 1) who must be shown to lie within, for ``"mean and people"``.
    people_level : float
        Level of the tests on both shares of people.
    sessions : SessionPeriods, optional
        Periods in which participants had both conditions.
    largest_carry_over : float
        Largest carry-over between sessions for which the verdict holds, in half-widths of each margin.
    method : str, optional
        Test that replaces the estimand's: ``"t"``, which exceeds its level for skewed differences.

    Returns
    -------
    Certificate

    Raises
    ------
    PellucidError
        If there is no end point, one has no margin or no differences, or `people` and `estimand` do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(3)
    >>> changes = {"duration": rng.normal(0.0, 0.03, 16), "vmax": rng.normal(0.02, 0.03, 16)}
    >>> certificate(changes, dict.fromkeys(changes, Margin.of_ratio(0.10))).verdict
    'transparent'
    """
    if not margins:
        raise PellucidError("certificate: found no margin, expected one for each end point")
    lacking = [name for name in margins if name not in differences]
    if lacking:
        raise PellucidError(
            f"certificate: found values of {', '.join(differences) or 'nothing'}, expected those of "
            f"{', '.join(lacking)} too"
        )
    stated = Analysis(
        estimand=estimand,
        people=people,
        people_level=people_level,
        false_transparent=alpha,
        largest_carry_over=largest_carry_over,
        where="certificate",
    )
    changes = {name: PeoplesChanges(margin, differences[name], sessions=sessions) for name, margin in margins.items()}
    return decide(stated, changes, method=method)


@dataclass(frozen=True, eq=False)
class PeoplesChanges:
    """What is known of the changes of n people in one end point under one condition."""

    margin: Margin
    seen: np.ndarray  # (n,) changes as far as they were seen, in the unit of the margin
    bounds: tuple[np.ndarray, np.ndarray] | None = None  # (n,) each, where movements were cut off
    sessions: SessionPeriods | None = None  # when people had both conditions
    drift: np.ndarray | None = None  # (n,) change from the first to the last third of movements; None: not known
    at_end: np.ndarray | None = None  # (n,) changes with the last third in the place of all movements
    failed: tuple[np.ndarray, np.ndarray] | None = None  # bounds with failed movements counted as longer than any
    lost: LostCounts = field(default_factory=dict)
    losers: np.ndarray | None = None  # (n,) whether a person lost a movement
    # changes with the excess losses of one condition counted as extremely short and as extremely long, (n,) each
    completed: tuple[np.ndarray, np.ndarray] | None = None
    alike: bool = True  # whether movements are compared with alike ones
    noise: MovementNoise | None = None  # noise of `seen` by single movements, if there are enough to tell it

    @property
    def is_known(self) -> bool:
        """Whether every change is known, and none by bounds alone."""
        return self.bounds is None or bool((self.bounds[0] == self.bounds[1]).all())


def decide(
    analysis: Analysis,
    changes: Mapping[str, PeoplesChanges],
    *,
    lost_people: int = 0,
    curves: Mapping[str, CurveComparison] | None = None,
    lost_of_curves: Mapping[str, LostCounts] | None = None,
    registered: Analysis | None = None,
    method: Method | None = None,
    points: Mapping[str, EndPoint] | None = None,
) -> Certificate:
    """Return the certificate of one condition: the one place where an analysis is executed.

    Recordings, tables, arrays, a running session and a ranking of controllers all come here. `changes` are those of the
    people with all end points, and `lost_people` is the number of the others. Losses, periods and learning are checked
    by what `changes` say of them. With another analysis than the `registered` one the certificate is post hoc.
    `points` are the end points as they were stated, for units in reports.
    """
    alpha, used = analysis.alpha, ESTIMAND_METHODS[analysis.estimand] if method is None else method
    tests = {name: tested_changes(own, analysis, used) for name, own in changes.items()}
    doubts: dict[str, list[Doubt | None]] = {}
    for name, own in changes.items():
        doubts[name] = [period_doubt(own.seen, tests[name])]
        if own.drift is not None and own.at_end is not None:
            doubts[name].append(learning_doubt(own.drift, own.at_end, tests[name]))
        if own.failed is not None:
            doubts[name].append(failed_doubt(own.failed, tests[name]))
        # With max_left_out = 1 the conditions have different numbers of movements by design, and none was lost.
        counts = analysis.max_left_out < 1.0 and not too_many_lost(own.lost, analysis.max_left_out)
        if own.completed is not None and counts:
            doubts[name].append(uneven_losses_doubt(own.completed, tests[name]))
    with_margins = dict(curves or {})
    every: dict[str, Equivalence | CurveComparison] = {**tests, **with_margins}
    lost = {name: own.lost for name, own in changes.items()} | dict(lost_of_curves or {})
    losers = {name: own.losers for name, own in changes.items() if own.losers is not None}
    unlike = {name for name, own in changes.items() if not own.alike}
    for name, doubt in (
        *doubts_of_loss(every, lost, alpha, analysis.max_left_out, losers, unlike).items(),
        *doubts_of_lost_people(every, lost_people, alpha, analysis.max_left_out).items(),
    ):
        doubts.setdefault(name, []).append(doubt)
    known = {name: tuple(each for each in own if each is not None) for name, own in doubts.items()}
    made = certificate_from_tests(tests, alpha, known, with_margins, analysis.rule)
    post_hoc = () if registered is None else analysis.deviations(registered)
    return replace(made, post_hoc=post_hoc, points=points or {})


def tested_changes(own: PeoplesChanges, analysis: Analysis, method: Method) -> Equivalence:
    """Return the test of one end point by a method, at the level of an analysis."""
    low, high = (own.seen, None) if own.bounds is None else own.bounds
    return equivalence(
        low,
        own.margin,
        upper=high,
        alpha=analysis.alpha,
        method=method,
        sessions=own.sessions,
        largest_carry_over=analysis.largest_carry_over,
        noise=own.noise,
    )


def certificate_from_tests(
    end_points: Mapping[str, Equivalence],
    alpha: float,
    doubts: Mapping[str, tuple[Doubt, ...]] | None = None,
    curves: Mapping[str, CurveComparison] | None = None,
    rule: ShareRule = DEFAULT_RULE,
) -> Certificate:
    """Return the certificate of end points and curves that were tested already, each at level `alpha`.

    `doubts` holds the other possible causes of each end point's change. `rule` says which shares of people must be
    shown.
    """
    every: dict[str, Equivalence | CurveComparison] = {**end_points, **(curves or {})}
    beyond = dict(zip(every, holm([each.p_beyond for each in every.values()]), strict=True))
    far = dict(zip(end_points, holm([test.p_far for test in end_points.values()]), strict=True))
    return Certificate(end_points, beyond, alpha, doubts or {}, curves or {}, rule, far=far)


PERIOD_DOUBT = "period"
"""Doubt: the period of the session may have changed an end point whose differences are known by bounds alone."""

LEARNING_DOUBT = "learning"
"""Doubt: the end point was still changing during the session."""

LEFT_OUT_DOUBT = "left out"
"""Doubt: failed movements, counted as longer than any other, would change the verdict."""

LOST_MOVEMENTS_DOUBT = "lost movements"
"""Doubt: more movements than `max_left_out` allows gave the end point no value."""

UNEVEN_LOSSES_DOUBT = "uneven losses"
"""Doubt: one condition lost more movements than the other; counted as extreme ones, they would change the verdict."""

LOST_PEOPLE_DOUBT = "lost people"
"""Doubt: more participants than `max_left_out` allows take no part."""

DOUBT_DESCRIPTIONS = {
    PERIOD_DOUBT: "after correction for the effect of the period",
    LEARNING_DOUBT: "for the last third of movements, which were still changing",
    LEFT_OUT_DOUBT: "with targets without a movement counted as never reached",
    LOST_MOVEMENTS_DOUBT: "because too many movements are missing",
    UNEVEN_LOSSES_DOUBT: "with the additional losses of one condition counted as extreme values",
    LOST_PEOPLE_DOUBT: "because too many participants are missing",
}
"""Reason, by doubt, why a claim is not made; it follows "not shown"."""

LostCounts = Mapping[str, tuple[int, int]]
"""Number of movements without a value, and of all movements, by condition."""


def period_doubt(differences: np.ndarray, test: Equivalence) -> Doubt | None:
    """Return the doubt that the period changed an end point whose differences are known by bounds alone; else None.

    `differences`, (n,), are the differences as far as they were seen; those of `test` are bounds, from which no effect
    of a period is taken out.
    """
    if not test.bounded or test.sessions is None or not np.isfinite(differences).all():
        return None
    seen = _tested_as(test, differences)
    return None if seen.fit.is_plain else Doubt(PERIOD_DOUBT, float("nan"), seen, always=True)


def _tested_as(
    test: Equivalence, differences: np.ndarray, upper: np.ndarray | None = None, noise: MovementNoise | None = None
) -> Equivalence:
    """Return the test of other `differences` (n,) with the settings of `test`."""
    same = len(differences) == test.pairs
    return equivalence(
        differences,
        test.margin,
        upper=upper,
        alpha=test.alpha,
        method=cast("Method", test.method),
        sessions=test.sessions if same else None,
        largest_carry_over=test.largest_carry_over,
        noise=noise,
    )


def failed_doubt(bounds: tuple[np.ndarray, np.ndarray], test: Equivalence) -> Doubt:
    """Return the doubt that failed movements, counted as longer than any other, change the verdict."""
    return Doubt(LEFT_OUT_DOUBT, float("nan"), _tested_as(test, *bounds), always=True)


def uneven_losses_doubt(completed: tuple[np.ndarray, np.ndarray], test: Equivalence) -> Doubt | None:
    """Return the doubt that the movements that one condition lost more than the other were extreme ones.

    `completed` are people's changes, (n,) each, with these movements counted as beyond the smallest and as beyond the
    largest that were seen. A claim of "beyond" is not affected: it stands for the movements that were seen.
    """
    if test.p_within > test.alpha:
        return None
    worst = max((_tested_as(test, changes) for changes in completed), key=lambda each: each.p_within)
    return Doubt(UNEVEN_LOSSES_DOUBT, float("nan"), worst, always=True)


def learning_doubt(drift: np.ndarray, at_end: np.ndarray, test: Equivalence) -> Doubt:
    """Return the doubt that movements were still changing.

    `drift`, (n,), is each person's change from the first to the last third; `at_end`, (n,), the differences with the
    last third in the place of all; `test` that of the end point.
    """
    # A third of the movements has three times the noise of all.
    noise = None if test.noise is None else replace(test.noise, variance=3.0 * test.noise.variance)
    return Doubt(LEARNING_DOUBT, signed_rank(drift).p_value, _tested_as(test, at_end, noise=noise))


def too_many_lost(lost: LostCounts, max_share: float) -> dict[str, tuple[int, int]]:
    """Return the conditions that lost more than a share `max_share` of their movements, with both counts."""
    return {condition: (gone, of) for condition, (gone, of) in lost.items() if gone > max_share * of}


def doubts_of_loss(
    tests: Mapping[str, Equivalence | CurveComparison], lost: Mapping[str, LostCounts], alpha: float, max_share: float,
    losers: Mapping[str, np.ndarray], unlike: Set[str] = frozenset(),
) -> dict[str, Doubt]:  # fmt: skip
    """Return a doubt for each end point within its margin of which too many movements were lost.

    Nothing is known of the changes of people who lost movements (`losers`). Signed ranks of the others may still show
    the pseudo-median to lie within; a mean has no bound then. A claim of "beyond" is not affected where the movements
    that are left are compared with alike ones; of end points whose movements are `unlike` it is doubted, too.
    """
    made = {}
    for name, test in tests.items():
        if (test.p_within <= alpha or name in unlike) and too_many_lost(lost.get(name, {}), max_share):
            bounded = _without_knowing(test, losers.get(name))
            made[name] = Doubt(LOST_MOVEMENTS_DOUBT, float("nan"), bounded, always=True)
    return made


def doubts_of_lost_people(
    tests: Mapping[str, Equivalence | CurveComparison], count: int, alpha: float, max_share: float
) -> dict[str, Doubt]:
    """Return a doubt for each end point within its margin if a `count` of participants, too many, take no part."""
    made = {}
    for name, test in tests.items():
        n = len(test.differences) if isinstance(test, Equivalence) else 0
        if test.p_within <= alpha and count > max_share * (n + count):
            hidden = np.concatenate([np.zeros(n, bool), np.ones(count, bool)]) if n else None
            bounded = _without_knowing(test, hidden)
            made[name] = Doubt(LOST_PEOPLE_DOUBT, float("nan"), bounded, always=True)
    return made


def _without_knowing(test: Equivalence | CurveComparison, hidden: np.ndarray | None) -> Equivalence:
    """Return the test with the differences of `hidden` people unknown; of a curve nothing is known then."""
    if hidden is None or not isinstance(test, Equivalence):
        return equivalence(np.full(2, -np.inf), Margin.either_way(1.0), upper=np.full(2, np.inf), alpha=test.alpha)
    more = np.zeros(len(hidden) - len(test.differences))
    low = np.where(hidden, -np.inf, np.concatenate([test.differences, more]))
    high = np.where(hidden, np.inf, np.concatenate([test.highest, more]))
    return _tested_as(test, low, high)
