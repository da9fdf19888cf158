r"""The core's inverse dynamics along a motion that passed a filter, its effort filtered as the measured effort was.

Terms smooth in filtered states are filtered already; what jumps with the sign of velocity is not, and passes the
motion's own low-pass. Where friction gives before it slips a motion has a `direction` that takes the sign's place.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from .. import _core
from .friction_terms import CORE_FIELDS

_NAMES: tuple[str, ...] = tuple(_core.PARAMETER_NAMES)

SMOOTH_TERMS = tuple(
    _NAMES.index(name)
    for name in (
        "inertia", "gravity_sine", "gravity_cosine", "parallel_stiffness", "offset", "viscous_positive",
        "viscous_negative",
    )
)  # fmt: skip
"""Core parameters whose effort is smooth in the states; the others multiply the sign of velocity."""

MIN_SLIP_SPEED = 1e-9  # rad/s or m/s: of a direction without a velocity
MAX_CACHED_SAMPLES = 50_000  # samples of a motion whose regressor is kept

JUMPING_TERMS = tuple(_NAMES.index(name) for name in ("coulomb_positive", "coulomb_negative"))
"""Those that multiply nothing but the sign of velocity: with the smooth ones, all that are linear."""

CURVED_TERMS = tuple(
    i for i, name in enumerate(_NAMES) if i not in SMOOTH_TERMS + JUMPING_TERMS and name != "velocity_width"
)
"""All others: Stribeck's, the load's, and what a new header adds."""

LOADED_TERMS = tuple(i for i in CURVED_TERMS if (by := CORE_FIELDS[_NAMES[i]].resists) is not None and by.load > 0.0)
"""Those of them by which friction grows with the load, and so depends on the body."""

BODY_TERMS = SMOOTH_TERMS[:4]
"""Those of them that no direction of motion changes."""


class FilteredMotion(Protocol):
    """States of a joint, each (n,), SI, through one low-pass; `smooth` is that low-pass, of (n,) or (n, k)."""

    @property
    def position(self) -> np.ndarray:
        """Filtered position [rad or m]."""

    @property
    def velocity(self) -> np.ndarray:
        """Filtered velocity [rad/s or m/s]."""

    @property
    def acceleration(self) -> np.ndarray:
        """Filtered acceleration [rad/s^2 or m/s^2]."""

    def smooth(self, samples: np.ndarray) -> np.ndarray:
        """The motion's own low-pass."""

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """The samples, (n,) or (n, k), that a regression uses."""


class LoadedMotion(FilteredMotion, Protocol):
    """A filtered motion of a joint that may carry a known payload."""

    @property
    def payload(self) -> tuple[float, float]:
        """Added mass [kg] and its distance from the axis [m]."""


class SlidingMotion(FilteredMotion, Protocol):
    """A filtered motion of a joint with a carriage."""

    @property
    def slider(self) -> float:
        """Place of the carriage [m]."""


def regressor(
    position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, terms: tuple[int, ...], width: float = 0.0
) -> np.ndarray:
    """Effort per unit of core parameters that enter linearly, `terms`, (n, k), along `position`, `velocity` and
    `acceleration`, (n,); `width` of the smooth sign [velocity]."""
    vector = np.zeros(len(_NAMES))
    vector[_NAMES.index("velocity_width")] = width
    q, v, a = (np.ascontiguousarray(x, float) for x in (position, velocity, acceleration))
    return _core.inverse_dynamics_jacobian(vector, q, v, a, np.array(terms))[1]


def filtered_effort(vector: np.ndarray, motion: FilteredMotion, smooth: tuple[int, ...] = SMOOTH_TERMS) -> np.ndarray:
    """Effort, (n,), that a core `vector`, (k,), takes along a `motion`; `smooth` terms are not filtered again."""
    direct = _smooth_regressor(motion)[:, : len(smooth)] @ vector[list(smooth)]
    if _presliding_direction(motion) is not None:
        return filtered_jacobian(vector, np.zeros((len(vector), 0)), motion, smooth)[0]
    velocity = _slip_velocity(motion)
    whole = _core.inverse_dynamics(vector, motion.position, velocity, motion.acceleration)
    if velocity is motion.velocity:
        return direct + motion.smooth(whole - direct)
    smoothly = regressor(motion.position, velocity, motion.acceleration, smooth) @ vector[list(smooth)]
    return direct + motion.smooth(whole - smoothly)


def filtered_jacobian(
    vector: np.ndarray, selection: np.ndarray, motion: FilteredMotion, smooth: tuple[int, ...] = SMOOTH_TERMS
) -> tuple[np.ndarray, np.ndarray]:
    """The same with its derivative, (n, p), by p values of which `selection`, (k, p), makes the core's vector."""
    active = np.flatnonzero(selection.any(axis=1))
    velocity = _friction_velocity(motion)
    effort, jacobian = _core.inverse_dynamics_jacobian(vector, motion.position, velocity, motion.acceleration, active)
    whole = np.column_stack([effort, jacobian @ selection[active]])
    terms = list(smooth)
    made = np.column_stack([vector, selection])[terms]
    filtered = _smooth_regressor(motion)[:, : len(terms)] @ made
    if velocity is not motion.velocity:
        smoothly = regressor(motion.position, velocity, motion.acceleration, smooth) @ made
        jumps = _given_way(whole - smoothly, motion)
    else:
        jumps = whole - filtered
    kept = jumps.any(axis=0)
    filtered[:, kept] += motion.smooth(jumps[:, kept])
    return filtered[:, 0], filtered[:, 1:]


def filtered_rows(
    vector: np.ndarray, selection: np.ndarray, motion: FilteredMotion, smooth: tuple[int, ...] = SMOOTH_TERMS
) -> tuple[np.ndarray, np.ndarray]:
    """Return effort (m,) and derivative (m, p) of `filtered_jacobian` at the rows of a regression.

    Linear terms are filtered once and kept with the motion; only nonlinear terms are filtered again.
    """
    jumping = tuple(i for i in SMOOTH_TERMS + JUMPING_TERMS if i not in smooth)
    terms = [*smooth, *jumping]
    width = float(vector[_NAMES.index("velocity_width")])
    linear = np.hstack([_smooth_rows(motion)[:, : len(smooth)], _jumping_rows(motion, jumping, width)])
    effort, rows = linear @ vector[terms], linear @ selection[terms]
    curved = list(CURVED_TERMS)
    if not (vector[curved].any() or selection[curved].any()):
        return effort, rows
    # What bends, with the body on which it depends: less the body itself, all of it jumps with the velocity.
    loaded = list(LOADED_TERMS)
    bodies = BODY_TERMS if vector[loaded].any() or selection[loaded].any() else ()
    bent = vector.copy()
    bent[[i for i in terms if i not in bodies]] = 0.0
    candidates = np.array([*bodies, *curved])
    active = candidates[selection[candidates].any(axis=1)]
    states = motion.position, _friction_velocity(motion), motion.acceleration
    whole, jacobian = _core.inverse_dynamics_jacobian(bent, *states, active)
    chosen = np.flatnonzero(selection[active].any(axis=0))
    made = np.zeros((len(active), 1 + len(chosen)))
    made[:, 1:] = selection[np.ix_(active, chosen)]
    jumps = jacobian @ made
    jumps[:, 0] = whole
    less = np.column_stack([bent, selection[:, chosen]])
    body = tuple(i for i in bodies if less[i].any())
    if body:
        jumps -= _body_regressor(motion, body) @ less[list(body)]
    added = motion.rows(motion.smooth(_given_way(jumps, motion)))
    rows[:, chosen] += added[:, 1:]
    return effort + added[:, 0], rows


def _smooth_rows(motion: FilteredMotion) -> np.ndarray:
    """Return the regressor of `SMOOTH_TERMS`, (m, 7), at the rows that a regression uses.

    Motions that differ in their direction of friction share it.
    """
    kept = _smooth_kept(motion)
    if "smooth_rows" not in kept:
        kept["smooth_rows"] = motion.rows(_smooth_regressor(motion))
    return kept["smooth_rows"]


def _jumping_rows(motion: FilteredMotion, terms: tuple[int, ...], width: float) -> np.ndarray:
    """Return the filtered regressor of linear `terms` that jump with the velocity, (m, k), at those rows.

    It is kept with the motion, for it depends on no parameter but the `width` of the smooth sign [velocity].
    """
    kept = vars(motion).setdefault("_jumping_rows", {})
    if (terms, width) not in kept:
        columns = regressor(motion.position, _friction_velocity(motion), motion.acceleration, terms, width)
        kept[terms, width] = motion.rows(motion.smooth(_given_way(columns, motion)))
    return kept[terms, width]


def share_smooth_regressor(motion: FilteredMotion, other: FilteredMotion) -> None:
    """Let two motions keep their smooth regressor together, which differ in their direction of friction alone."""
    vars(other)["_smooth_kept"] = _smooth_kept(motion)


def _smooth_kept(motion: FilteredMotion) -> dict[str, np.ndarray]:
    """Return what is kept with a motion of its smooth regressor, by name."""
    return vars(motion).setdefault("_smooth_kept", {})


def _slip_velocity(motion: FilteredMotion) -> np.ndarray:
    """Return the velocity, (n,), whose sign is that of friction."""
    slip = getattr(motion, "slip_velocity", None)
    return motion.velocity if slip is None else slip


def _presliding_direction(motion: FilteredMotion) -> np.ndarray | None:
    """Return what takes the place of the sign of velocity where friction gives before it slips, (n,); else None."""
    return getattr(motion, "direction", None)


def _friction_velocity(motion: FilteredMotion) -> np.ndarray:
    """Return the velocity, (n,), at which friction jumps: with presliding, as it slips in that direction."""
    direction = _presliding_direction(motion)
    if direction is None:
        return _slip_velocity(motion)
    return np.copysign(np.maximum(np.abs(motion.velocity), MIN_SLIP_SPEED), direction)


def _given_way(jumps: np.ndarray, motion: FilteredMotion) -> np.ndarray:
    """Return friction that jumps, (n, k), as far as it has built up along a motion."""
    direction = _presliding_direction(motion)
    return jumps if direction is None else np.abs(direction)[:, None] * jumps


def _body_regressor(motion: FilteredMotion, terms: tuple[int, ...]) -> np.ndarray:
    """Return the regressor of some of the `BODY_TERMS`, (n, k)."""
    if len(motion.position) > MAX_CACHED_SAMPLES:
        return regressor(motion.position, motion.velocity, motion.acceleration, terms)
    return _smooth_regressor(motion)[:, [SMOOTH_TERMS.index(i) for i in terms]]


def _smooth_regressor(motion: FilteredMotion) -> np.ndarray:
    """The regressor of `SMOOTH_TERMS`, (n, 7), kept with a motion that is not long: it depends on no parameter."""
    kept = _smooth_kept(motion)
    if "smooth_regressor" in kept:
        return kept["smooth_regressor"]
    made = regressor(motion.position, motion.velocity, motion.acceleration, SMOOTH_TERMS)
    if len(motion.position) <= MAX_CACHED_SAMPLES:
        kept["smooth_regressor"] = made
    return made
