"""Model cards of a robot of several joints: one model of it as a JSON file that can be read, reloaded and deployed."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core, _given
from .._atomic import write_text_atomically
from .._errors import PellucidError
from .card import CARD_FORMAT, CardParameter, named, read_table
from .card_schema import MAX_CARD_NUMBER, fields_of, require_between, require_sound
from .fields import model_fields
from .kinematic_tree import MAX_LINKS

JOINT_EFFORT_UNITS = ("N*m", "N", "A", "V")
"""Units that a joint's effort may have: its own, or its drive's where the gain is not known."""

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "links": _core.LINK_PARAMETER_NAMES,
    "joints": _core.TREE_JOINT_PARAMETER_NAMES,
    "motors": _core.TREE_MOTOR_PARAMETER_NAMES,
}
"""What the core calls the numbers of each row; a file has rows as objects with these names."""

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class JointRange:
    """What a joint may do, and what it did while it was identified; None where nothing is said."""

    low: float | None = None  # lower limit of position, from study.toml or the robot's file [rad; m]
    high: float | None = None
    velocity: float | None = None  # Largest allowed [rad/s; m/s]
    effort: float | None = None  # Largest allowed [N m; N]
    seen_low: float | None = None  # lowest position while fitting; outside the model extrapolates [rad; m]
    seen_high: float | None = None
    seen_velocity: float | None = None  # Largest while fitting [rad/s; m/s]

    def span(self, motion: str) -> tuple[float, float]:
        """Return the lowest and highest position from which postures are drawn [rad; m].

        Both limits count, else what was seen, else half a turn either way of a joint that turns (`motion` "r").
        """
        turn = math.pi if motion == "r" else 0.0
        for low, high in ((self.low, self.high), (self.seen_low, self.seen_high)):
            if low is not None and high is not None:
                return low, high
        return -turn, turn


@dataclass(frozen=True)
class Ripple:
    """Effort of a joint's drive that goes round with it: `cosine` cos(order q) + `sine` sin(order q) [N m; N]."""

    joint: str
    order: float  # Periods in a turn of the joint
    cosine: float
    sine: float


@dataclass(frozen=True)
class TreeCard:
    """An identified robot of several joints: everything that a law, a lab or a comparison needs of it.

    Rows of `links`, `joints` and `motors` are the core's (`_core.LINK_PARAMETER_NAMES`,
    `_core.TREE_JOINT_PARAMETER_NAMES`, `_core.TREE_MOTOR_PARAMETER_NAMES`); joints and motors are in the order of the
    coordinates. Where inertias are no body's (`consistent` is False) single numbers of a link mean nothing, their
    combinations do.
    """

    study: str
    family: str  # kind of model: "base", "best", "consistent"
    method: str  # The same in words
    names: tuple[str, ...]  # names of the m joints that move
    bodies: tuple[str, ...]  # names of the l links, each after the one that carries it
    links: Rows  # (l, 22)
    gravity: tuple[float, float, float]  # In the base's frame [m/s^2]
    joints: Rows  # (m, 12)
    turns: Rows  # (m, m): turn of motor i by joint k, gears taken out
    motors: Rows  # (m, 11); () where each motor turns with its own joint alone
    gains: tuple[float, ...]  # (m,) effort at the joint, gears taken out, per unit of the drive
    gains_known: tuple[bool, ...]  # (m,) where not, effort is in the drive's unit
    drive_units: tuple[str, ...]  # (m,)
    effort_units: tuple[str, ...]  # (m,)
    ranges: tuple[JointRange, ...]  # (m,)
    families: tuple[tuple[str, ...], ...]  # (m,) friction terms of each joint
    consistent: bool  # Whether every link's inertia is that of a body
    parameters: tuple[CardParameter, ...]  # Those that were estimated; base combinations by name
    covariance: Rows  # In the order of the parameters, SI; () where none was estimated
    heldout_error: tuple[float | None, ...]  # (m,) effort error on what was not fitted [%]; () without any
    processing: str
    confidence: float  # confidence level of the intervals
    notes: tuple[str, ...]
    checksums: Mapping[str, str]  # SHA-256 of the files it came from, by recording
    pellucid: str  # Version that wrote it
    ripples: tuple[Ripple, ...] = ()
    known: Mapping[str, float] = field(default_factory=dict)  # Numbers fixed beforehand: the maker's, a payload's
    statistical: Rows = ()  # What of the covariance coloured residuals alone make
    made_from: Mapping[str, str] = field(default_factory=dict)  # Checksums of what it was made from, by name
    kind: str = field(default="tree")
    format: int = field(default=CARD_FORMAT)

    @property
    def values(self) -> np.ndarray:
        """Parameter values, shape (p,), SI."""
        return np.array([p.value for p in self.parameters])

    @property
    def motion(self) -> str:
        """One letter for each joint, "r" if it turns and "p" if it slides. Compared robots must have the same."""
        return "".join("rp"[int(row[1]) == 2] for row in self.links if row[1])

    @property
    def effort_unit(self) -> str:
        """Effort units of the joints, each once."""
        return " ".join(dict.fromkeys(self.effort_units))

    @property
    def velocity_width(self) -> np.ndarray:
        """Velocity over which friction changes its sign, (m,) [rad/s; m/s]."""
        return np.array(self.joints)[:, COLUMNS["joints"].index("velocity_width")]

    @cached_property
    def joint_columns(self) -> dict[str, np.ndarray]:
        """Numbers of the core's joints by name, each (m,), SI."""
        return dict(zip(COLUMNS["joints"], np.array(self.joints).T, strict=True))

    @cached_property
    def tree(self) -> _core.KinematicTree:
        """The links in the core."""
        return _core.KinematicTree(np.array(self.links), np.array(self.gravity))

    def driven(self, period: float, substeps: int = 4) -> _core.DrivenTree:
        """The whole in the core, under motors that hold their effort for a `period` [s]."""
        coupled = {"turns": np.array(self.turns), "motors": np.array(self.motors)} if self.motors else {}
        return _core.DrivenTree(
            np.array(self.links), np.array(self.gravity), np.array(self.joints), period=period, substeps=substeps,
            **coupled,
        )  # fmt: skip

    def __getitem__(self, name: str) -> CardParameter:
        return named(self.parameters, name, "this card")


def write_tree_card(path: Path, card: TreeCard) -> Path:
    """Write a card as JSON, atomically; a list of numbers stays on its line."""
    table = asdict(card)
    for key, columns in COLUMNS.items():
        table[key] = [dict(zip(columns, map(float, row), strict=True)) for row in getattr(card, key)]
    return write_text_atomically(path, _text(table) + "\n")


def read_tree_card(path: Path) -> TreeCard:
    """Read a card."""
    table = read_table(path)
    if table.get("kind") != "tree":
        raise PellucidError(
            f"{path}: not the model card of a robot of several joints, expected models/tree.*.json of a study"
        )
    try:
        rows = {key: _rows(key, table.get(key), columns) for key, columns in COLUMNS.items()}
        card = TreeCard(**fields_of(TreeCard, {**table, **rows}))
        _require_tree(card)
    except ValueError as error:
        raise PellucidError(f"{path}: not a card that can be used: {error}") from None
    require_sound(path, card)
    return card


def _rows(key: str, given: Any, columns: tuple[str, ...]) -> list[list[float]]:
    """Rows in the core's order; a number that a file does not have is the core's default."""
    if not isinstance(given, list) or len(given) > MAX_LINKS:
        raise ValueError(
            f"{key}: found {_given.visible_text(repr(given))[:100]}, expected a list of at most {MAX_LINKS}"
        )
    made = []
    for i, row in enumerate(given):
        if not isinstance(row, Mapping):
            raise ValueError(f"{key}[{i}]: found {_given.visible_text(repr(row))[:100]}, expected an object")
        unknown = sorted(set(row) - set(columns))
        if unknown:
            raise ValueError(
                f"{key}[{i}]: found the unknown key {_given.visible_text(repr(unknown[0]))[:100]}, expected "
                f"{', '.join(columns)}"
            )
        bounds = _bounds(key)
        numbers = [row.get(name, bounds[name][2]) for name in columns]
        for name, x in zip(columns, numbers, strict=True):
            if isinstance(x, bool) or not isinstance(x, (int, float)):
                raise ValueError(f"{key}[{i}].{name}: found {_given.visible_text(repr(x))[:100]}, expected a number")
            require_between(f"{key}[{i}].{name}", x, *bounds[name][:2])
        made.append(numbers)
    return made


def _bounds(key: str) -> dict[str, tuple[float, float, float]]:
    """Lower, upper and default of each of the core's numbers of a row."""
    fields = model_fields("link") if key == "links" else (*model_fields("joint"), *model_fields("presliding"))
    known = {f.name: (max(f.lower, -MAX_CARD_NUMBER), min(f.upper, MAX_CARD_NUMBER), f.default) for f in fields}
    return {name: known.get(name, (0.0, MAX_CARD_NUMBER, 0.0)) for name in COLUMNS[key]}


def _require_tree(card: TreeCard) -> None:
    """ValueError where numbers are those of no robot, or lists of several lengths."""
    moving = sum(1 for row in card.links if row[1])
    units = ("drive_units", "effort_units")
    for what in ("names", "joints", "turns", "gains", "gains_known", *units, "ranges", "families"):
        found = len(getattr(card, what))
        if found != moving:
            raise ValueError(f"{what}: found {found} entries, expected {moving}, one for each joint that moves")
    if len(card.bodies) != len(card.links):
        raise ValueError(f"bodies: found {len(card.bodies)} entries, expected {len(card.links)}, one for each link")
    for what, counts in (("motors", (0, moving)), ("heldout_error", (0, moving))):
        if len(getattr(card, what)) not in counts:
            raise ValueError(f"{what}: found {len(getattr(card, what))} entries, expected {moving} or none")
    if any(len(row) != moving for row in card.turns):
        raise ValueError(f"turns: expected rows of {moving} numbers")
    for what in ("names", "bodies"):
        _require_names(what, getattr(card, what))
    for unit in (*card.effort_units, *card.drive_units):
        if unit not in JOINT_EFFORT_UNITS:
            raise ValueError(
                f"found the unit {_given.visible_text(repr(unit))[:100]}, expected one of "
                f"{', '.join(JOINT_EFFORT_UNITS)}"
            )
    for name, gain in zip(card.names, card.gains, strict=True):
        if not 1e-9 <= abs(gain) <= MAX_CARD_NUMBER:
            raise ValueError(f"gains: found {gain:g} of {name}, expected a number that is not 0")
    for name, seen in zip(card.names, card.ranges, strict=True):
        for low, high in ((seen.low, seen.high), (seen.seen_low, seen.seen_high)):
            if low is not None and high is not None and low > high:
                raise ValueError(f"ranges: {name}: found {low:g} to {high:g}, expected the lower first")
        for x in (seen.velocity, seen.effort, seen.seen_velocity):
            if x is not None:
                require_between(f"ranges: {name}", x, 0.0, MAX_CARD_NUMBER)
    for ripple in card.ripples:
        if ripple.joint not in card.names:
            raise ValueError(
                f"ripples: found the joint {_given.visible_text(repr(ripple.joint))[:100]}, expected one of names"
            )
        for x in (ripple.order, ripple.cosine, ripple.sine):
            require_between("ripples", x, -MAX_CARD_NUMBER, MAX_CARD_NUMBER)
    for name, x in card.known.items():
        require_between(_given.visible_text(name)[:100], x, -MAX_CARD_NUMBER, MAX_CARD_NUMBER)
    card.driven(1e-3)  # links in a loop, an axis of no length, turns that hang on one another


def _require_names(what: str, texts: Iterable[str]) -> None:
    seen: set[str] = set()
    for text in texts:
        if re.fullmatch(_given.NAME_PATTERN, text) is None or text in seen:
            raise ValueError(f"{what}: found {_given.visible_text(repr(text))[:100]}, expected a name, each once")
        seen.add(text)


def _text(x: Any, indent: str = "") -> str:
    """JSON in which what holds no other list or object stays on its line."""
    parts = list(x.values()) if isinstance(x, dict) else x if isinstance(x, list | tuple) else []
    if not any(isinstance(part, dict | list | tuple) for part in parts):
        return json.dumps(x, ensure_ascii=False, allow_nan=False)
    inner = indent + " "
    heads = [f"{json.dumps(key, ensure_ascii=False)}: " for key in x] if isinstance(x, dict) else [""] * len(x)
    lines = [f"{inner}{head}{_text(part, inner)}" for head, part in zip(heads, parts, strict=True)]
    first, last = "{}" if isinstance(x, dict) else "[]"
    return "\n".join([first, ",\n".join(lines), indent + last])
