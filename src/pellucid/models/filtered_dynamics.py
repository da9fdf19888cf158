r"""The core's inverse dynamics along a motion that passed a filter, its effort filtered as the measured effort was.

Terms smooth in filtered states are filtered already; what jumps with the sign of velocity is not, and passes the
motion's own low-pass. Where friction gives before it slips a motion has a `direction` that takes the sign's place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

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

SHAPE_TERMS = tuple(i for i in CURVED_TERMS if CORE_FIELDS[_NAMES[i]].resists is None)
"""Those of them that shape a curve; effort is proportional to each of the others."""

CURVE_TERMS = tuple(i for i in CURVED_TERMS if i not in SHAPE_TERMS + LOADED_TERMS)
"""Those of them that velocity alone bends."""

BODY_TERMS = SMOOTH_TERMS[:4]
"""Smooth terms that no direction of motion changes."""

_WIDTH = _NAMES.index("velocity_width")
_LOAD_UNIT = 0.5  # within the bounds of a coefficient of the load


class FilteredMotion(Protocol):
    """States of a joint, each (n,), SI, through one low-pass; `smooth` is that low-pass, of (n,) or (n, k)."""

    @property
    def count(self) -> int:
        """Number of samples n."""

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

    Both are weighted sums of the same columns, which are filtered again only where they change: with the shape of a
    curve, or with the ratios within the body that loads it.
    """
    by = np.column_stack([vector, selection])
    jumping = tuple(i for i in SMOOTH_TERMS + JUMPING_TERMS if i not in smooth)
    parts = [(_Columns(jumping, _only(vector, [_WIDTH])), by[list(jumping)])]
    if by[list(CURVED_TERMS)].any():
        used = np.any(by, axis=1)
        parts += [*_curve_parts(by, used), *_load_parts(by, used)]
    rows = _smooth_rows(motion)[:, : len(smooth)] @ by[list(smooth)]
    for columns, (_, weights) in zip(_filtered_columns(motion, [each for each, _ in parts]), parts, strict=True):
        rows += columns @ weights
    return rows[:, 0], rows[:, 1:]


class _Columns(NamedTuple):
    """Effort per unit of core parameters `terms` at a core `vector`, (k,); if `loaded`, the friction of that effort."""

    terms: tuple[int, ...]
    vector: np.ndarray
    loaded: bool = False


def _only(vector: np.ndarray, terms: Sequence[int]) -> np.ndarray:
    """Return a core vector, (k,), with 0 for all but some terms."""
    left = np.zeros(len(vector))
    left[terms] = vector[terms]
    return left


def _curve_parts(by: np.ndarray, used: np.ndarray) -> Iterator[tuple[_Columns, np.ndarray]]:
    """Yield the columns of friction that bends with the velocity alone, with their weights.

    `by`, (k, 1 + p), is the core's vector and its derivative by the free values; `used` marks its rows that are not 0.
    """
    curves = [i for i in CURVE_TERMS if used[i]]
    shapes = [i for i in SHAPE_TERMS if used[i] and by[i, 1:].any()]
    if curves or shapes:
        # A derivative by a shape depends on the height of its curve; nothing else here does.
        weights = by[curves + shapes]
        weights[len(curves) :, 0] = 0.0
        heights = curves if shapes else []
        yield _Columns((*curves, *shapes), _only(by[:, 0], [_WIDTH, *SHAPE_TERMS, *heights])), weights


def _load_parts(by: np.ndarray, used: np.ndarray) -> Iterator[tuple[_Columns, np.ndarray]]:
    """Yield the columns of friction that is proportional to the load, with their weights, by its coefficients.

    The load is the sum of its derivatives by the body, each times its parameter; so is the friction.
    """
    body, groups = [i for i in BODY_TERMS if used[i]], dict[bytes, list[int]]()
    for i in LOADED_TERMS:
        if used[i] and body:
            groups.setdefault(by[i].tobytes(), []).append(i)  # those that are always equal have the same columns
    for group in groups.values():
        vector = _only(by[:, 0], [_WIDTH, *body])
        vector[body] /= max(np.abs(vector[body]).max(), np.finfo(float).tiny)
        vector[group] = _LOAD_UNIT
        share = by[group[0]] / _LOAD_UNIT
        weights = share[0] * by[body]
        weights[:, 1:] += by[body, :1] * share[1:]
        yield _Columns(tuple(body), vector, loaded=True), weights


def _jumps(motion: FilteredMotion, wanted: Sequence[_Columns]) -> np.ndarray:
    """Return columns side by side along a motion, (n, k), before the low-pass."""
    terms = tuple(i for each in wanted for i in each.terms)
    velocity = _friction_velocity(motion)
    unloaded = [each.vector for each in wanted if not each.loaded]
    if unloaded:
        # One call gives all, for the body's columns without load depend on no vector, nor do those before the last.
        # Friction alone depends on the velocity alone: a stored motion need not read the others.
        has_body = any(i in BODY_TERMS for i in terms)
        states = (motion.position, velocity, motion.acceleration) if has_body else (velocity,) * 3
        columns = _core.inverse_dynamics_jacobian(unloaded[-1], *states, np.array(terms, int))[1]
    else:
        columns = _body_regressor(motion, terms)
    end = 0
    for each in wanted:
        first, end = end, end + len(each.terms)
        if each.loaded:
            own = columns[:, first:end]
            # Friction is proportional to the load's size, whose derivative by the load is its sign.
            side = np.sign(own @ each.vector[list(each.terms)])
            rubbing = side * _core.friction(each.vector, velocity, side)
            for column in own.T:  # one by one, for so few side by side take ten times as long
                column *= rubbing
    return _given_way(columns, motion)


def _filtered_columns(motion: FilteredMotion, wanted: Sequence[_Columns]) -> list[np.ndarray]:
    """Return columns at the rows that a regression uses, each (m, k); the last of a kind are kept with the motion."""
    kept = vars(motion).setdefault("_filtered_columns", {})
    kinds = [(each.terms, (each.vector != 0.0).tobytes()) for each in wanted]
    made = {kind: kept[kind] for kind in kinds if kind in kept}
    new = [i for i, kind in enumerate(kinds) if kind not in made or not np.array_equal(made[kind][0], wanted[i].vector)]
    if new:
        filtered, end = motion.rows(motion.smooth(_jumps(motion, [wanted[i] for i in new]))), 0
        for i in new:
            first, end = end, end + len(wanted[i].terms)
            made[kinds[i]] = wanted[i].vector, filtered[:, first:end]
            # What the sign of the velocity alone decides is kept, however long a motion is; it must not hold the rest.
            if i == 0 or motion.count <= MAX_CACHED_SAMPLES:
                kept[kinds[i]] = wanted[i].vector, np.array(made[kinds[i]][1])
    return [made[kind][1] for kind in kinds]


def _smooth_rows(motion: FilteredMotion) -> np.ndarray:
    """Return the regressor of `SMOOTH_TERMS`, (m, 7), at the rows that a regression uses.

    Motions that differ in their direction of friction share it.
    """
    kept = _smooth_kept(motion)
    if "smooth_rows" not in kept:
        kept["smooth_rows"] = motion.rows(_smooth_regressor(motion))
    return kept["smooth_rows"]


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
    if motion.count > MAX_CACHED_SAMPLES:
        return regressor(motion.position, motion.velocity, motion.acceleration, terms)
    return _smooth_regressor(motion)[:, [SMOOTH_TERMS.index(i) for i in terms]]


def _smooth_regressor(motion: FilteredMotion) -> np.ndarray:
    """The regressor of `SMOOTH_TERMS`, (n, 7), kept with a motion that is not long: it depends on no parameter."""
    kept = _smooth_kept(motion)
    if "smooth_regressor" in kept:
        return kept["smooth_regressor"]
    made = regressor(motion.position, motion.velocity, motion.acceleration, SMOOTH_TERMS)
    if motion.count <= MAX_CACHED_SAMPLES:
        kept["smooth_regressor"] = made
    return made
