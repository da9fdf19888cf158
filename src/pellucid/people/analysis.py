"""The analysis of a certificate: everything that is stated before the data are seen, in one object.

`certify`, `assess` (tables and studies), `plan`, the running verdict of a live session and the ranking of controllers
all execute an `Analysis`. It comes from a file ``analysis.toml``, from the table ``[assessment]`` of study.toml, from a
mapping, or from the keywords of a function. ``pellucid plan`` writes the file. A certificate under another analysis is
*post hoc*, and says so.

A design says how sessions were ordered. ``"AB/BA"`` and ``"Williams"`` require the period of every session, and the
effect of the period is taken out of the change. ``"parallel sessions"`` have no order. Without a design the periods
count wherever they are stated.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from inspect import signature
from json import dumps
from math import inf
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from .._errors import PellucidError, StudyError
from .._given import parse_toml, read_given
from ..units import COORDINATES_BY_UNIT, parse_quantity
from .equivalence import DEFAULT_CARRY_OVER, Method
from .indices import INDICES, Index, PercentOf, Worse, indices_along
from .margin import Margin
from .session_periods import SessionPeriods
from .share_of_people import DEFAULT_RULE, ShareRule
from .survival import looks

Estimand = Literal["mean", "pseudo-median", "mean and people"]

ESTIMAND_METHODS: dict[Estimand, Method] = {
    "mean": "skew_robust",
    "pseudo-median": "signed_rank",
    "mean and people": "skew_robust",
}
"""Test of each estimand."""

Design = Literal["", "parallel sessions", "AB/BA", "Williams"]

DEFAULT_MAX_LEFT_OUT = 0.10
"""Largest share of a condition's movements, or of participants, that may be lost, unless a study states another."""

ANALYSIS_FILE = "analysis.toml"
"""Name of the registered analysis in a study's folder."""

MARGIN_SETTINGS = ("estimand", "people", "people_level", "largest_carry_over")
"""Keys of [assessment.margins] in study.toml that are no indices."""

MOVEMENT_SETTINGS = {"lowpass": "Hz", "order": "1", "threshold": "1"}
"""Settings by which movements are found in recordings, with their units."""

StatedMargin = str | float | tuple[float, float]


@dataclass(frozen=True)
class EndPoint:
    """One index with its stated margin."""

    name: str  # name of the index in the catalogue
    along: str  # unit of the coordinate of movement, "rad" or "m"
    stated: str  # margin as stated
    margin: Margin  # margin for logarithms of ratios if `ratio`, else in the index's unit
    ratio: bool  # whether the margin is relative to control

    @property
    def index(self) -> Index:
        """Entry of the catalogue for this coordinate."""
        return indices_along(COORDINATES_BY_UNIT[self.along])[self.name]

    @property
    def catalogued(self) -> Index | None:
        """Entry of the catalogue; None for a column of a table that the catalogue does not know."""
        return indices_along(COORDINATES_BY_UNIT[self.along]).get(self.name)

    def differences(self, own: np.ndarray, control: np.ndarray | None) -> np.ndarray:
        """Return each participant's difference that is compared with the margin, (n,)."""
        if control is None:
            return own
        return np.log(own / control) if self.ratio else own - control

    def shown(self, value: float) -> float:
        """Convert a difference for display: to %, or to the unit of tables."""
        if self.ratio:
            return 100.0 * float(np.expm1(value))
        index = self.catalogued
        return value if index is None else (100.0 if index.over_control else index.shown[0]) * value

    @property
    def logs(self) -> bool:
        """Whether movements are compared by logarithms, as participants are by ratios."""
        return self.ratio or self.index.over_control

    @property
    def unit(self) -> str:
        """Unit of `shown`."""
        index = self.catalogued
        if self.ratio or (index is not None and index.over_control):
            return "%"
        return "" if index is None else index.change_unit


@dataclass(frozen=True, kw_only=True)
class Analysis:
    """An analysis as it is stated before the data are seen.

    Attributes
    ----------
    margins : mapping of str to str, float or tuple of float
        By index the largest change that does not matter: ``"10 %"`` of control, ``"2 deg"``, a share such as 0.1, or
        the lowest and highest change.
    control : str
        Condition with which the others are compared.
    design : {"", "parallel sessions", "AB/BA", "Williams"}
        How the sessions of a participant are ordered; "" if it is not stated.
    estimand : {"mean", "pseudo-median", "mean and people"}
        Quantity of people's changes that must lie within the margins.
    people : float or None
        Share of people in (0, 1) who must be shown to lie within, for ``"mean and people"``.
    people_level : float
        Level of the tests of both shares of people.
    false_transparent : float
        Level of the whole study, in (0, 0.5).
    largest_carry_over : float
        Largest effect of one session on the next, in margins, for which the verdict holds.
    washout : str
        Pause between two sessions, such as ``"30 min"``. It is printed; nothing is computed from it.
    exclusions : tuple of str
        Rules by which people or movements are excluded, in words.
    excluded : mapping of str to str
        Participants who were excluded, with the reason. They count as lost: excluding people cannot make a claim.
    max_left_out : float
        Largest share of a condition's movements, or of participants, that may be lost, in [0, 1].
    looks : tuple of float
        Rising shares of the planned participants at which the data are analysed; empty if only at the end.
    look : int or None
        Which of the `looks` this is, from 1.
    curves : mapping of str to str
        Margins of whole curves, for recordings.
    movements : mapping of str to float
        How movements are found in recordings: ``lowpass`` [Hz], ``order`` and ``threshold``.
    participant, condition : str
        Columns of a table that identify a row.
    period, sequence : str
        Columns that say when conditions came: the number of the session, or each participant's conditions in order,
        such as ``"free robot"`` or ``"AB"`` (A is control). By default a column named period or order.
    factors : tuple of str or None
        Columns that say which movements are alike; None: those of the design.
    relative : bool
        Whether margins that are numbers are shares of control; otherwise they are in the index's unit.

    Examples
    --------
    >>> stated = Analysis(control="free", margins={"duration": "10 %"}, design="AB/BA")
    >>> stated.alpha, stated.method, round(stated.end_points()["duration"].margin.high, 4)
    (0.05, 'skew_robust', 0.0953)
    >>> Analysis.of({"control": "free", "margins": {"duration": "10 %"}}).deviations(stated)
    ('design: registered AB/BA, analysed none',)
    """

    margins: Mapping[str, StatedMargin] = field(default_factory=dict)
    control: str = ""
    design: Design = ""
    estimand: Estimand = "mean"
    people: float | None = None
    people_level: float = DEFAULT_RULE.alpha
    false_transparent: float = 0.05
    largest_carry_over: float = DEFAULT_CARRY_OVER
    washout: str = ""
    exclusions: tuple[str, ...] = ()
    excluded: Mapping[str, str] = field(default_factory=dict)
    max_left_out: float = DEFAULT_MAX_LEFT_OUT
    looks: tuple[float, ...] = ()
    look: int | None = None
    curves: Mapping[str, str] = field(default_factory=dict)
    movements: Mapping[str, float] = field(default_factory=dict)
    participant: str = "participant"
    condition: str = "condition"
    period: str = ""
    sequence: str = ""
    factors: tuple[str, ...] | None = None
    relative: bool = True
    where: str = field(default="analysis", compare=False)  # what messages begin with

    def __post_init__(self) -> None:
        def found(name: str, expected: str) -> PellucidError:
            return PellucidError(f"{self.where}: found {name} = {getattr(self, name)!r}, expected {expected}")

        if self.design not in get_args(Design):
            raise found("design", "parallel sessions, AB/BA or Williams")
        if not 0.0 < self.false_transparent < 0.5:
            raise found("false_transparent", "a level between 0 and 0.5")
        if not 0.0 <= self.max_left_out <= 1.0:
            raise found("max_left_out", "a share from 0 to 1")
        if not 0.0 <= self.largest_carry_over < inf:
            raise found("largest_carry_over", "a number of margins, 0 or more")
        if self.look is not None and not 1 <= self.look <= len(self.looks):
            raise self._no_look()
        if self.period and self.sequence:
            raise found("sequence", "a column of periods or one of sequences, not both")
        _ = self.rule
        if self.looks:
            looks(self.looks, self.false_transparent)

    @property
    def alpha(self) -> float:
        """Level of each one-sided test: `false_transparent`, or what is spent at this look."""
        if not self.looks:
            return self.false_transparent
        if self.look is None:
            raise self._no_look()
        return looks(self.looks, self.false_transparent).level[self.look - 1]

    def _no_look(self) -> PellucidError:
        return PellucidError(f"{self.where}: found look = {self.look}, expected one of looks = {list(self.looks)}")

    @property
    def rule(self) -> ShareRule:
        """Shares of people that must be shown, and the level of their tests."""
        return share_rule(self.where, self.estimand, self.people, self.people_level)

    @property
    def method(self) -> Method:
        """Test of the estimand."""
        return ESTIMAND_METHODS[self.estimand]

    @property
    def is_ordered(self) -> bool:
        """Whether the analysis says that sessions come in an order."""
        return self.design in ("AB/BA", "Williams") or bool(self.period or self.sequence)

    def end_points(self, indices: Mapping[str, Index] | None = None) -> dict[str, EndPoint]:
        """Return the end points with their margins.

        `indices` are those that recordings can give; an unknown name is then refused. Without them the margins are
        those of a table's columns, of which the catalogue knows some.
        """
        made = {}
        for name, stated in self.margins.items():
            where = "[assessment.margins]" if self.where == "[assessment]" else f"{self.where}, margins,"
            where = f"{where} {name}"
            if indices is not None and name not in indices:
                raise StudyError(f"{where}: found no index of this name, expected one of {', '.join(indices)}")
            index = INDICES.get(name) if indices is None else indices[name]
            if isinstance(stated, str):
                made[name] = _stated_in_words(name, stated, index, where, of_recordings=indices is not None)
            else:
                margin = margin_of(name, stated, self.relative)
                along = "rad" if index is None else index.along
                made[name] = EndPoint(name, along, f"{stated}", margin, self.relative)
        return made

    def sessions(
        self, periods: Mapping[tuple[str, str], float], participants: Sequence[str], conditions: Sequence[str],
        compared: str,
    ) -> SessionPeriods | None:  # fmt: skip
        """Return when `participants` had the compared condition and control; None without an order.

        `periods` holds the mean period by participant and condition, empty if it is not stated. `conditions` lists all
        conditions, control first. Periods that the design does not allow raise an error.
        """
        lacking = [person for person in participants if any((person, c) not in periods for c in conditions)]
        known = not lacking
        orders = [tuple(periods[person, c] for c in conditions) for person in participants] if known else []
        if self.design == "parallel sessions":
            if any(len(set(order)) > 1 for order in orders):
                raise PellucidError(
                    f"{self.where}: found conditions in different periods, expected none with design = "
                    '"parallel sessions"; "AB/BA" or "Williams" take the effect of the period out'
                )
            return None
        if self.design:
            self._require_orders(lacking, orders, participants, conditions)
        if not known:
            return None
        return SessionPeriods.of_conditions(np.array(orders, float), 0, list(conditions).index(compared))

    def _require_orders(
        self, lacking: Sequence[str], orders: Sequence[tuple[float, ...]], participants: Sequence[str],
        conditions: Sequence[str],
    ) -> None:  # fmt: skip
        where = f'{self.where}, design = "{self.design}"'
        count = len(conditions)
        if (self.design == "AB/BA") != (count == 2):
            expected = "two" if self.design == "AB/BA" else "three or more"
            raise PellucidError(f"{where}: found {count} conditions ({', '.join(conditions)}), expected {expected}")
        if lacking:
            raise PellucidError(
                f"{where}: found participants without a stated period ({', '.join(lacking[:3])}"
                f"{', ...' * (len(lacking) > 3)}), expected one for every session: state period = 1, 2, ... in "
                "[[recordings]], or name the column of periods in the analysis"
            )
        for person, order in zip(participants, orders, strict=True):
            if len(set(order)) < count:
                raise PellucidError(f"{where}: found two conditions of {person} in one period, expected one each")
        if len({tuple(np.argsort(order)) for order in orders}) < 2:
            raise PellucidError(
                f"{where}: found the same order of conditions for all participants, expected different orders"
            )

    def deviations(self, registered: Analysis) -> tuple[str, ...]:
        """Return in what this analysis deviates from a `registered` one, in words; empty if in nothing."""
        found = []
        for name in REGISTERED_FIELDS:
            own, other = getattr(self, name), getattr(registered, name)
            if isinstance(other, Mapping):
                # How movements are found counts where it was registered.
                keys = other if name == "movements" else dict.fromkeys((*other, *own))
                found += [_deviation(f"{name}.{key}", own.get(key), other.get(key))
                          for key in keys if _plain(own.get(key)) != _plain(other.get(key))]  # fmt: skip
            elif _plain(own) != _plain(other):
                found.append(_deviation(name, own, other))
        return tuple(found)

    def to_toml(self) -> str:
        """Return the text of ``analysis.toml``: everything that is registered, defaults included."""
        lines, tables = [], []
        for name in REGISTERED_FIELDS:
            value = getattr(self, name)
            if isinstance(value, Mapping):
                if value:
                    tables += ["", f"[{name}]", *(f"{_key(key)} = {_toml(each)}" for key, each in value.items())]
            elif value not in (None, ""):
                lines.append(f"{name} = {_toml(value)}")
        return "\n".join([*lines, *tables, ""])

    @classmethod
    def of(cls, given: Analysis | Mapping[str, Any] | str | os.PathLike[str], where: str = "analysis") -> Analysis:
        """Return an analysis from an object, a mapping, or a file: ``analysis.toml``, or study.toml with [assessment].

        `where` begins the messages about a mapping.

        Raises
        ------
        PellucidError
            If a key or a value is none that is known, or the file cannot be read.
        """
        if isinstance(given, Analysis):
            return given
        if isinstance(given, Mapping):
            return _of_mapping(given, where)
        if not isinstance(given, (str, os.PathLike)):
            raise PellucidError(
                f"analysis: found a value of type {type(given).__name__}, expected an Analysis, a mapping or a file"
            )
        path = Path(given)
        path = path / ANALYSIS_FILE if path.is_dir() else path
        try:
            table = parse_toml(read_given(path).decode("utf-8"), path.name)
        except (OSError, UnicodeDecodeError) as error:
            raise PellucidError(f"{path.name}: found no readable file ({error}), expected an analysis") from None
        return _of_mapping(table, path.name)


def keywords_beside(function: Callable[..., object], given: Mapping[str, object]) -> list[str]:
    """Return the names of those keywords `given` that are not the defaults of a `function`."""
    defaults = {name: each.default for name, each in signature(function).parameters.items()}
    said = {name: own for name, own in given.items() if own is not None}
    return [name for name, own in said.items() if defaults[name] is None or own != defaults[name]]


REGISTERED_FIELDS = (
    "control", "design", "washout", "estimand", "people", "people_level", "false_transparent", "largest_carry_over",
    "max_left_out", "looks", "exclusions", "margins", "curves", "movements",
)  # fmt: skip
"""Fields that are registered. The others name columns, the present look, and people who were excluded."""


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_size(value: object) -> bool:
    return _is_text(value) or _is_number(value)


def _is_margin(value: object) -> bool:
    return _is_size(value) or (isinstance(value, (list, tuple)) and len(value) == 2 and all(map(_is_number, value)))


def _is_table(value: object, is_kind: Callable[[object], bool]) -> bool:
    return isinstance(value, Mapping) and all(_is_text(key) and is_kind(each) for key, each in value.items())


def _is_list(value: object, is_kind: Callable[[object], bool]) -> bool:
    return isinstance(value, (list, tuple)) and all(map(is_kind, value))


_SIZE = 'a number, or a text such as "10 %"', lambda x: x is None or _is_size(x)
_TEXTS = "a table of texts", lambda x: _is_table(x, _is_text)

_KINDS: Mapping[str, tuple[str, Callable[[Any], bool]]] = {
    **dict.fromkeys(("people", "people_level", "false_transparent", "largest_carry_over", "max_left_out"), _SIZE),
    **dict.fromkeys(("curves", "excluded"), _TEXTS),
    "margins": ('a table of margins such as "10 %"', lambda x: _is_table(x, _is_margin)),
    "movements": ("a table of settings", lambda x: _is_table(x, _is_size)),
    "exclusions": ("a list of texts", lambda x: _is_list(x, _is_text)),
    "factors": ("a list of texts", lambda x: x is None or _is_list(x, _is_text)),
    "looks": ("a list of numbers", lambda x: _is_list(x, _is_number)),
    "look": ("a whole number", lambda x: x is None or (_is_number(x) and x == int(x))),
    "relative": ("true or false", lambda x: isinstance(x, bool)),
}
"""What a value must be, by field; every other field is a text."""


def _of_mapping(given: Mapping[str, Any], where: str) -> Analysis:
    """Return the analysis of a mapping; of study.toml's tables only what an analysis states."""
    names = [each.name for each in fields(Analysis) if each.name != "where"]
    table = dict(given)
    if isinstance(given.get("assessment"), Mapping):
        own = given["assessment"]
        table = {name: value for name, value in own.items() if name in names and name != "order"}
        table["movements"] = {name: own[name] for name in MOVEMENT_SETTINGS if name in own}
        where = f"{where} [assessment]"
    strangers = [name for name in table if name not in names]
    if strangers:
        raise PellucidError(f"{where}: found {', '.join(strangers)}, expected {', '.join(names)}")
    for name, value in table.items():
        expected, is_kind = _KINDS.get(name, ("a text", lambda x: isinstance(x, str)))
        if not is_kind(value):
            raise PellucidError(f"{where}: found {name} = {value!r}, expected {expected}")
    margins = table.get("margins", {})
    for name in MARGIN_SETTINGS:
        if name in margins:
            table.setdefault(name, margins[name])
    table["margins"] = {
        name: tuple(each) if isinstance(each, list) else each
        for name, each in margins.items()
        if name not in MARGIN_SETTINGS
    }
    for name in ("people", "people_level", "false_transparent", "largest_carry_over", "max_left_out"):
        if table.get(name) is not None:
            table[name] = parse_quantity(table[name], "1", f"{where} {name}")
    table["movements"] = {
        name: parse_quantity(value, (MOVEMENT_SETTINGS[name] if isinstance(value, str) else "1"), f"{where} {name}")
        if name in MOVEMENT_SETTINGS else value
        for name, value in table.get("movements", {}).items()
    }  # fmt: skip
    for name in ("exclusions", "looks", "factors"):
        if isinstance(table.get(name), list):
            table[name] = tuple(table[name])
    return Analysis(**table, where=where)


def _stated_in_words(name: str, stated: str, index: Index | None, where: str, *, of_recordings: bool) -> EndPoint:
    """Return the end point of a margin with its unit; refuse what does not fit the index."""
    share = stated.strip().endswith("%")
    if index is None and not share:
        raise PellucidError(f'{where}: found "{stated}", expected a share such as "10 %": the unit is not known')
    size = parse_quantity(stated, "1" if share or index is None else index.unit, where)
    if not size > 0.0:
        raise StudyError(f'{where}: found "{stated}", expected a size above 0')
    if index is None:
        return EndPoint(name, "rad", stated, Margin.of_ratio(size), True)
    if share and index.percent_of is PercentOf.NOTHING_AT_ALL:
        raise StudyError(f'{where}: found "{stated}", expected {index.unit}: {index.words} has no natural zero')
    if share and index.needs_robot:
        raise StudyError(f'{where}: found "{stated}", expected {index.unit}: the control condition has no value')
    # A table has values of control, of which an index over control is a ratio like any other.
    ratio = share and (index.scaled or not of_recordings)
    margin = Margin.of_ratio(size) if ratio else Margin.either_way(size)
    margin = Margin(-inf, margin.high) if index.worse is Worse.IF_MORE else margin
    return EndPoint(name, index.along, stated, margin, ratio)


MAX_SHARE = 1.0
"""Largest relative size that a number without a unit states: a larger number was meant in %."""


def margin_of(name: str, margin: float | tuple[float, float], relative: bool = True) -> Margin:
    """Return the margin of an index, a share or its two ends; for logarithms of ratios if `relative`.

    An index of the catalogue whose decrease is never worse has an upper end only, and one without a zero no share.
    """
    index = INDICES.get(name)
    if relative and index is not None and index.percent_of is PercentOf.NOTHING_AT_ALL:
        raise PellucidError(
            f"certify, {name}: found a share, expected a change in {index.unit}: a share needs a natural zero"
        )
    if isinstance(margin, (int, float)):
        if not margin > 0.0:
            raise PellucidError(f"certify, {name}: found the margin {margin:g}, expected one above 0")
        if relative and margin > MAX_SHARE:
            raise PellucidError(
                f"certify, {name}: found the margin {margin:g}, a change by a factor of {1.0 + margin:g}, expected a "
                f'share of at most {MAX_SHARE:g}, such as 0.1 or "10 %"'
            )
        made = Margin.of_ratio(float(margin)) if relative else Margin.either_way(float(margin))
        return Margin(-inf, made.high) if index is not None and index.worse is Worse.IF_MORE else made
    low, high = (float(end) for end in margin)
    if not low < high or (relative and not low > -1.0):
        raise PellucidError(
            f"certify, {name}: found the margin {low:g} to {high:g}, expected a low end below a high one"
        )
    return Margin(float(np.log1p(low)), float(np.log1p(high))) if relative else Margin(low, high)


def share_rule(
    where: str, estimand: str, people: float | None = None, people_level: float = DEFAULT_RULE.alpha
) -> ShareRule:
    """Return the shares of people that must be shown; refuse an unknown estimand, and a share that it does not have."""
    if estimand not in ESTIMAND_METHODS:
        raise PellucidError(f"{where}: found the estimand {estimand!r}, expected one of {', '.join(ESTIMAND_METHODS)}")
    if (people is not None) != (estimand == "mean and people"):
        raise PellucidError(
            f'{where}: found people = {people} and the estimand "{estimand}", expected a share with "mean and people" '
            "and none otherwise"
        )
    if people is not None and not 0.0 < people < 1.0:
        raise PellucidError(f"{where}: found people = {people:g}, expected a share above 0 and below 1")
    if not 0.0 < people_level < 0.5:
        raise PellucidError(f"{where}: found people_level = {people_level:g}, expected a level between 0 and 0.5")
    return replace(DEFAULT_RULE, within=DEFAULT_RULE.within if people is None else people, alpha=people_level)


def _deviation(name: str, own: object, registered: object) -> str:
    return f"{name}: registered {_words(registered)}, analysed {_words(own)}"


def _words(value: object) -> str:
    if value is None or value in ("", ()):
        return "none"
    return ", ".join(map(str, value)) if isinstance(value, (tuple, list)) else f"{value}"


def _plain(value: object) -> object:
    """Return a value as it is compared: texts without extra blanks, numbers as numbers."""
    if isinstance(value, str):
        return " ".join(value.split())
    if isinstance(value, (tuple, list)):
        return tuple(map(_plain, value))
    return float(value) if isinstance(value, (int, float)) else value


def _toml(value: object) -> str:
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return repr(value)
    return dumps(str(value), ensure_ascii=False)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else dumps(name, ensure_ascii=False)
