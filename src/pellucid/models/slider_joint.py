r"""A joint whose moving link carries a free carriage: one physically coherent body, friction that never drives.

With the carriage's marker at x along the link, every term is affine or quadratic in x with one and the same mass:

.. math::
   J(x) &= J_0 + 2 h x + m x^2 \\
   g_s(x) &= G_0 + m g x, \qquad g_c = G_c \\
   \tau &= y + f(\dot q, y), \qquad y = J(x)\ddot q + g_s(x)\sin q + g_c\cos q

so that a torque is linear in (J_0, h, m, G_0, G_c) and the frictions, but for friction that depends on the load y. The
direction of motion appears in the friction alone.

The published model of an elbow with a carriage: one set of every parameter for each direction of motion.

.. math::
   \tau = g\,[(s_1 x + s_0)\sin q + c\cos q] + \nu\dot q + (a_0 + a_1 x + a_2 x^2)\ddot q + sign(\dot q)\,\tau_{dry}

with its own s, c, nu, a and tau_dry while the joint goes up and while it goes down [1]_, eqs. 3 and 4. Here q = 0 hangs
(the paper's is horizontal: its cosine is our sine). Nothing ties the sets to each other or to a body that could exist.

Model cards of a joint with a carriage: one method's model as a JSON file that can be read, reloaded and compared.

.. [1] D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb
   exoskeleton", Robotica 39, 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from .._errors import PellucidError
from .card import CARD_FORMAT, Card, CardParameter, read_table
from .filtered_dynamics import BODY_TERMS, SlidingMotion, filtered_effort, filtered_jacobian, filtered_rows, regressor
from .joint import GRAVITY, NAMES, PARAMETER_INDEX, SYMBOLS_BY_NAME

UNITS: Mapping[str, str] = {
    "moment_slope": "kg",
    "moment": "kg*m",
    "cross_moment": "kg*m",
    "coulomb": "N*m",
    "viscous": "N*m*s/rad",
    "a0": "kg*m^2",
    "a1": "kg*m",
    "a2": "kg",
}
"""Parameters of one set, in the order of every array, and their units."""

GRAVITY_TERMS = slice(0, 3)
"""Places of the gravity parameters in a set."""

FRICTION_TERMS = slice(3, 5)
"""Places of the friction parameters in a set."""

INERTIA_TERMS = slice(5, 8)
"""Places of the inertia parameters in a set."""

VELOCITY_WIDTH = 0.01  # rad/s: of the smooth sign, a twentieth of the slowest commanded velocity


def selection(slider: float) -> np.ndarray:
    """Matrix, (13, 8), with core vector = selection @ one set, the carriage at `slider` [m]."""
    one = {
        "moment_slope": {"gravity_sine": GRAVITY * slider},
        "moment": {"gravity_sine": GRAVITY},
        "cross_moment": {"gravity_cosine": GRAVITY},
        "coulomb": {"coulomb_positive": 1.0, "coulomb_negative": 1.0},
        "viscous": {"viscous_positive": 1.0, "viscous_negative": 1.0},
        "a0": {"inertia": 1.0},
        "a1": {"inertia": slider},
        "a2": {"inertia": slider**2},
    }
    matrix = np.zeros((len(NAMES), len(UNITS)))
    for column, name in enumerate(UNITS):
        for target, gain in one[name].items():
            matrix[PARAMETER_INDEX[target], column] = gain
    return matrix


def columns(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, slider: float) -> np.ndarray:
    """Torque per unit of each parameter, (n, 8), SI, along `position`, `velocity` and `acceleration`, (n,), with the
    carriage at `slider` [m]."""
    chosen = selection(slider)
    terms = tuple(np.flatnonzero(chosen.any(axis=1)).tolist())
    return regressor(position, velocity, acceleration, terms, VELOCITY_WIDTH) @ chosen[list(terms)]


@dataclass(frozen=True)
class DirectionalSliderModel:
    """Two sets of parameters, or twice the same."""

    up: np.ndarray  # up, down: (8,) While the velocity is positive (lifts) and negative; SI, in the order of `UNITS`
    down: np.ndarray

    def torque(self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, slider: float) -> np.ndarray:
        """Torque at the joint, shape (n,) [N*m]; it jumps where the velocity changes sign. `position`, `velocity`,
        `acceleration` (n,) [rad], [rad/s], [rad/s^2]; `slider` [m]; gives (n,)."""
        terms = columns(position, velocity, acceleration, slider)
        return np.where(velocity > 0.0, terms @ self.up, terms @ self.down)

    def gravity(self, direction: str, slider: np.ndarray | float, position: np.ndarray) -> np.ndarray:
        """The set's gravity torque. `slider`, `position` [m], [rad]; gives [N*m]."""
        s1, s0, c = (self.up if direction == "up" else self.down)[GRAVITY_TERMS]
        return GRAVITY * ((s1 * slider + s0) * np.sin(position) + c * np.cos(position))

    def inertia(self, direction: str, slider: np.ndarray) -> np.ndarray:
        """The set's J(x) [kg*m^2] at x [m]; `direction` is "up" or "down"."""
        a0, a1, a2 = (self.up if direction == "up" else self.down)[INERTIA_TERMS]
        return a0 + a1 * slider + a2 * slider**2


BODY_UNITS = {
    "inertia": "kg*m^2",
    "carriage_moment": "kg*m",
    "carriage_mass": "kg",
    "gravity": "N*m",
    "gravity_cosine": "N*m",
}
"""Parameters of the moving body, and their units."""

DIRECTIONAL_TERMS = ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative")
"""Friction terms of both families, for either direction of motion."""

FRICTION_FAMILIES: Mapping[str, tuple[str, ...]] = {
    "consistent": DIRECTIONAL_TERMS,
    "load": (*DIRECTIONAL_TERMS, "load_motoring", "load_generating"),
}
"""Friction terms of each family; all are kept from becoming negative."""


@dataclass(frozen=True)
class SliderJointModel:
    """A family of the joint with a carriage."""

    family: str
    # Parameters that are known beforehand, SI: a weighed carriage's `carriage_mass`
    known: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self):
        if self.family not in FRICTION_FAMILIES:
            raise ValueError(f"unknown family {self.family!r}; known: {', '.join(FRICTION_FAMILIES)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Free parameters, in the order of every array and covariance."""
        friction = FRICTION_FAMILIES[self.family]
        if self.family == "load" and "carriage_mass" not in self.known:
            # Nothing else has a known weight, and then only the sum of both shares shows.
            friction = (*friction[:-2], "load_friction")
        return tuple(n for n in (*BODY_UNITS, *friction) if n not in self.known)

    def unit(self, name: str) -> str:
        """SI unit of a parameter, as plain text."""
        return BODY_UNITS[name] if name in BODY_UNITS else SYMBOLS_BY_NAME[name].unit()

    @property
    def linear(self) -> bool:
        """Whether torque is linear in every free parameter."""
        return self.family == "consistent"

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Physical lower and upper bounds of the free parameters, each shape (p,), SI."""
        free = {"carriage_moment", "gravity", "gravity_cosine"}
        lower = np.array([-np.inf if n in free else 0.0 for n in self.names])
        symbols = [SYMBOLS_BY_NAME.get(n) for n in self.names]
        upper = np.array([np.inf if s is None or s.linear else s.upper for s in symbols])
        return lower, upper

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"family '{self.family}'"

    def effort(self, values: np.ndarray, motion: SlidingMotion) -> np.ndarray:
        """Torque, (n,) [N*m], of free `values`, (p,), with the carriage where the `motion` has it, friction filtered as
        the measured torque was."""
        return filtered_effort(self.vector(values, motion.slider, VELOCITY_WIDTH), motion, BODY_TERMS)

    def jacobian(self, values: np.ndarray, motion: SlidingMotion) -> tuple[np.ndarray, np.ndarray]:
        """The same, and its derivative by the free `values`, (n, p)."""
        vector = self.vector(values, motion.slider, VELOCITY_WIDTH)
        return filtered_jacobian(vector, self.selection(motion.slider), motion, BODY_TERMS)

    def rows(self, values: np.ndarray, motion: SlidingMotion) -> tuple[np.ndarray, np.ndarray]:
        """Effort, (m,), and derivative, (m, p), at the rows that a regression uses, sooner than by `jacobian`."""
        vector = self.vector(values, motion.slider, VELOCITY_WIDTH)
        return filtered_rows(vector, self.selection(motion.slider), motion, BODY_TERMS)

    def selection(self, slider: float) -> np.ndarray:
        """Matrix S(x), shape (13, p), with core vector = S(x) @ values + known(x). `slider` [m]; gives (13, p)."""
        return _columns(self.names, slider)

    def vector(self, values: np.ndarray, slider: float, velocity_width: float = 0.0) -> np.ndarray:
        """The core's joint parameters, shape (13,), SI. `values` (p,); `slider` [m]; `velocity_width` [rad/s]; gives
        (13,)."""
        vector = self.selection(slider) @ np.asarray(values, float)
        for name, value in self.known.items():
            vector += value * _column(name, slider)
        vector[PARAMETER_INDEX["velocity_width"]] = velocity_width
        return vector

    def value(self, values: np.ndarray, name: str) -> float:
        """A parameter by its name, free or known."""
        return float(self.known[name]) if name in self.known else float(values[self.names.index(name)])

    def inertia(self, values: np.ndarray, slider: np.ndarray) -> np.ndarray:
        """J(x) [kg*m^2] for x of any shape [m]."""
        j, h, m = (self.value(values, n) for n in ("inertia", "carriage_moment", "carriage_mass"))
        return j + 2.0 * h * slider + m * slider**2

    def gravity(self, values: np.ndarray, slider: np.ndarray | float, position: np.ndarray) -> np.ndarray:
        """Gravity torque. `values` (p,); `slider`, `position` [m], [rad]; gives [N*m]."""
        g, c, m = (self.value(values, n) for n in ("gravity", "gravity_cosine", "carriage_mass"))
        return (g + GRAVITY * m * slider) * np.sin(position) + c * np.cos(position)

    def gaps(self, values: np.ndarray, rail: tuple[float, float], mass: float | None) -> np.ndarray:
        r"""Conditions of physical consistency; all are >= 0 for a body that could exist.

        The carriage alone has :math:`J_0 m \ge h^2`; the whole body, of mass at most M, the planar pseudo-inertia
        condition :math:`J(x) \ge (g_s(x)^2 + g_c^2) / (M g^2)` at every x of the rail.

        `values` (p,); `rail` [m]; `mass` [kg]; gives (1,).
        """
        room, size = self._conditions(values, rail, mass)
        return room / (size + 1e-12)

    def room(self, values: np.ndarray, rail: tuple[float, float], mass: float | None) -> np.ndarray:
        """The conditions of `gaps` undivided: smooth, and of any size where a body is far from possible. `values`
        (p,); `rail` [m]; `mass` [kg]; gives (k,)."""
        return self._conditions(values, rail, mass)[0]

    def _conditions(
        self, values: np.ndarray, rail: tuple[float, float], mass: float | None
    ) -> tuple[np.ndarray, np.ndarray]:
        j, h, m = (self.value(values, n) for n in ("inertia", "carriage_moment", "carriage_mass"))
        room, size = [j * m - h * h], [abs(j * m) + h * h]
        if mass is not None:
            x = np.linspace(rail[0], rail[1], 5)
            g, c = self.value(values, "gravity"), self.value(values, "gravity_cosine")
            least = ((g + GRAVITY * m * x) ** 2 + c**2) / (mass * GRAVITY**2)
            inertia = self.inertia(values, x)
            room += list(inertia - least)
            size += list(np.abs(inertia) + least)
        return np.array(room), np.array(size)


@lru_cache(maxsize=256)
def _columns(names: tuple[str, ...], slider: float) -> np.ndarray:
    """What one unit of each parameter adds to the core's vector, shape (13, p), read-only."""
    made = np.column_stack([_column(name, slider) for name in names])
    made.setflags(write=False)
    return made


def _column(name: str, slider: float) -> np.ndarray:
    """What one unit of a parameter adds to the core's vector, shape (13,)."""
    column = np.zeros(len(NAMES))
    if name == "carriage_moment":
        column[PARAMETER_INDEX["inertia"]] = 2.0 * slider
    elif name == "carriage_mass":
        column[PARAMETER_INDEX["inertia"]] = slider**2
        column[PARAMETER_INDEX["gravity_sine"]] = GRAVITY * slider
    else:
        for target in SYMBOLS_BY_NAME[name].targets:
            column[PARAMETER_INDEX[target]] = 1.0
    return column


SET_SIZE = 8  # parameters of one direction


@dataclass(frozen=True)
class SliderCard(Card):
    """An identified joint with a carriage: what `Card` says, and these.

    `family` is the method that identified it; `method` says it in words.
    """

    rail: tuple[float, float]  # Ends of the rail, from the axis [m]: beyond them the model is a guess
    drive: Mapping[str, float]  # `gain`, torque at the joint per ampere [N*m/A]
    heldout_error: float | None  # Mean absolute current error over the trials held out [A]
    residual_sd: float  # [N*m]
    processing: str
    confidence: float  # confidence level of the intervals
    notes: tuple[str, ...]
    checksums: Mapping[str, str]  # SHA-256 of the files it came from, by recording
    pellucid: str  # Version that wrote it
    joint: str = "joint"  # What study.toml calls it
    # Way from rest over which friction builds up before it slips [rad]; None where no recording showed it
    presliding_travel: CardParameter | None = None
    kind: str = field(default="slider")
    format: int = field(default=CARD_FORMAT)

    def stated_numbers(self) -> dict[str, float]:
        """See `Card.stated_numbers`."""
        return {**self.known, **self.drive}

    def model(self) -> DirectionalSliderModel | SliderJointModel:
        """The model whose free parameters the card's are; a directional one holds its values itself."""
        if self.family in FRICTION_FAMILIES:
            return SliderJointModel(self.family, dict(self.known))
        return DirectionalSliderModel(up=self.values[:SET_SIZE], down=self.values[-SET_SIZE:])


def read_slider_card(path: Path) -> SliderCard:
    """Read a card."""
    table = read_table(path)
    if table.get("kind") != "slider":
        raise PellucidError(
            f"{path}: not the model card of a joint with a carriage, expected models/slider.*.json of a study"
        )
    card = SliderCard.from_table(table, path)
    found = len(card.parameters)
    try:
        low, high = card.rail
        if not 0.0 <= low < high <= 10.0:
            raise ValueError(f"rail: found {low:g} m to {high:g} m, expected two places on a segment")
        if card.presliding_travel is not None and not 0.0 <= card.presliding_travel.value <= 0.1:
            found_travel = card.presliding_travel.value
            raise ValueError(f"presliding_travel: found {found_travel:g} rad, expected 0 to 0.1")
        # A directional model has a set of parameters for each direction.
        model = card.model() if card.family in FRICTION_FAMILIES else None
        names = model.names if isinstance(model, SliderJointModel) else None
        if names is None and found not in (SET_SIZE, 2 * SET_SIZE):
            raise ValueError(f"found {found} parameters, expected {SET_SIZE} or {2 * SET_SIZE}")
        if names is not None and tuple(p.name for p in card.parameters) != tuple(names):
            raise ValueError(f"found {found} parameters, expected {', '.join(names)}")
    except ValueError as error:
        raise PellucidError(f"{path}: not a card that can be used: {error}") from None
    return card
