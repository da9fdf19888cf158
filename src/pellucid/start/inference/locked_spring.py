"""Find a spring on the bench: its output is locked, its motor is pushed against it, and the effort is recorded.

Two angles show it where one of them hardly moves and the effort follows their difference, better than one of them. One
angle shows it where the effort follows it and no weight can be the cause: its inertia would be larger, or it would be
too heavy.

Find recordings that hold postures: they weigh the joint by gravity alone, without friction's sign or inertia.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...files.name_evidence import read_name
from ...numerics.filters import central_difference, zero_phase_lowpass
from ...numerics.spring_evidence import SpringEvidence, spring_evidence
from ...units import to_si_factor
from .assign_roles import DRIVE_QUANTITIES, ColumnRole, TableRoles
from .motion_efforts import running_mean
from .processing_choice import choose_processing


@dataclass(frozen=True)
class SpringLimits:
    """When recordings are of a spring on the bench, and when they hold postures."""

    # The output is locked if its range is at most this share of the motor's; the lock gives a little.
    max_locked_share: float = 0.1
    # The locked end gives if its angle lowers the unexplained share of the effort to this share of it.
    max_share_of_one_angle: float = 0.9
    # A weight of so many N*m at 90 deg is more than a wearable robot or its wearer has at one joint [N*m/rad].
    min_stiffness_nm_per_rad: float = 500.0
    # Shorter recordings are not examined.
    min_rows: int = 200
    # At most this many rows of a recording are examined.
    max_rows: int = 60_000
    # An angle's range lies between these percentiles, so that single outliers do not widen it.
    range_percentiles: tuple[float, ...] = (0.5, 99.5)
    # A posture counts if it is held for at least this long [s].
    min_hold_s: float = 0.5
    # A joint is still below this share of its largest speed.
    still_speed_share: float = 0.02
    # A recording holds postures if it rests at least in so many places.
    min_posture_count: int = 3
    # A recording holds postures if it is still for at least this share of its time.
    min_still_share: float = 0.5
    # Postures are different ones if they lie apart by at least this share of the range.
    min_posture_distance_share: float = 0.05


SPRING_LIMITS = SpringLimits()

MAX_DEFLECTION_RAD = float(np.radians(5.0))
"""Largest travel within which stiffness alone distinguishes a spring from the gravity of a joint [rad]."""


@dataclass(frozen=True)
class LockedSpring:
    """A spring on the bench, by its columns."""

    driven: str  # column of the angle of the driven end
    locked: str | None  # column of the angle of the locked end, None without one
    why: str  # reason, for a comment in study.toml
    sign: int = 1  # -1 if the effort pulls against driven minus locked

    @property
    def columns(self) -> tuple[str, str | None, int]:
        """The columns and the sign, which recordings of one bench have in common."""
        return self.driven, self.locked, self.sign


def spring_of_tables(
    roles: TableRoles, tables: Sequence[Mapping[str, np.ndarray]], effort: ColumnRole
) -> LockedSpring | None:
    """Return the spring that every table of a layout shows, by their columns of shape (n,); None if one does not."""
    if roles.rate is None or len(roles.joints) > 2:
        return None
    if roles.joints and sum(r.quantity in DRIVE_QUANTITIES and not r.is_command for r in roles.roles) > 1:
        return None
    main = next((r for r in roles.roles if r.quantity in ("position", "angle") and not r.is_command), None)
    if main is None or main.keys or main.unit == "counts":
        return None
    names = [main.column] + [r.column for r in roles.roles if _is_further_angle(r, main)]
    slides = main.unit_is_certain and main.is_length
    factor = to_si_factor(main.unit, None)[0] if main.unit_is_certain and not slides else None
    is_torque = effort.quantity == "torque" and effort.unit in ("N*m", "Nm")
    found: list[LockedSpring] = []
    for table in tables:
        own = find_locked_spring(
            {name: table[name] for name in names if name in table},
            table[effort.column],
            roles.rate,
            radians_per_unit=factor,
            is_torque=is_torque,
            slides=slides,
        )
        if own is None or (found and own.columns != found[0].columns):
            return None
        found.append(own)
    return found[0] if found else None


def _is_further_angle(role: ColumnRole, main: ColumnRole) -> bool:
    """Whether a column holds another measured angle in the unit of the main one."""
    if role is main or role.is_command:
        return False
    evidence, own = read_name(role.column), read_name(main.column)
    return evidence.quantity == "position" and not evidence.is_command and evidence.unit == own.unit


def with_locked_spring(roles: TableRoles, spring: LockedSpring) -> TableRoles:
    """Return roles in which the position is the spring's deflection, and no column belongs to a joint of several."""
    made = []
    for role in roles.roles:
        if role.column == spring.locked:
            why = f'the locked end of the spring, from which "{spring.driven}" is measured'
            role = replace(role, quantity=None, label="", why=why)
        elif role.column == spring.driven:
            keys = dict(role.keys) | ({"minus": spring.locked} if spring.locked else {})
            keys |= {"sign": -1} if spring.sign < 0 else {}
            role = replace(role, quantity="position", label="", why=spring.why, is_certain=True, keys=keys)
        elif role.label in roles.joints:
            role = replace(role, label="")
        made.append(role)
    return replace(roles, roles=tuple(made), joints=())


def find_locked_spring(
    angles: Mapping[str, np.ndarray],
    effort: np.ndarray,
    rate: float,
    *,
    radians_per_unit: float | None,
    is_torque: bool,
    slides: bool = False,
) -> LockedSpring | None:
    """Return the spring that angles, shape (n,) each in one unit, and an effort, shape (n,), show; None without one.

    Parameters
    ----------
    angles : mapping of str to ndarray
        Measured angles or lengths by column, the main one first.
    effort : ndarray
        Measured effort.
    rate : float
        Sampling rate [Hz].
    radians_per_unit : float or None
        Size of an angle's unit; None where it is not known.
    is_torque : bool
        Whether the effort is a torque in N*m.
    slides : bool
        Whether the angles are lengths, which no weight's effort follows.
    """
    if len(effort) < SPRING_LIMITS.min_rows:
        return None
    rows = slice(0, SPRING_LIMITS.max_rows)
    taken = {name: x[rows] for name, x in angles.items()}
    spans = {name: _span(x) for name, x in taken.items()}
    for driven, moved in taken.items():
        for locked, still in taken.items():
            if locked == driven or not 0.0 <= spans[locked] <= SPRING_LIMITS.max_locked_share * spans[driven]:
                continue
            for sign in (1, -1):
                found = _evidence(sign * (moved - still), effort[rows], rate)
                if found is None or not found.follows:
                    continue
                is_told = found.is_no_weight or _is_stiff(found, radians_per_unit, is_torque)
                if is_told or _gives(found, _evidence(sign * moved, effort[rows], rate)):
                    against = "" if sign > 0 else ", with opposite sign"
                    why = f'"{locked}" is locked, and the effort follows "{driven}" minus "{locked}"{against}'
                    return LockedSpring(driven, locked, f"{why}: {_said(found)}", sign)
    if not taken:
        return None
    driven = next(iter(taken))
    found = _evidence(taken[driven], effort[rows], rate)
    if found is None or not found.follows:
        return None
    if slides or found.is_no_weight:
        why = f'the effort is proportional to "{driven}" and shows no inertia: {_said(found)}'
        return LockedSpring(driven, None, why)
    if not _is_stiff(found, radians_per_unit, is_torque):
        return None
    why = f'the effort is proportional to "{driven}" and too stiff for gravity: {_said(found)}'
    return LockedSpring(driven, None, why)


def _is_stiff(found: SpringEvidence, radians_per_unit: float | None, is_torque: bool) -> bool:
    """Return whether no joint weighs as much as the slope says."""
    if radians_per_unit is None or not is_torque or found.travel * radians_per_unit > MAX_DEFLECTION_RAD:
        return False
    return found.stiffness / radians_per_unit >= SPRING_LIMITS.min_stiffness_nm_per_rad


def _gives(found: SpringEvidence, alone: SpringEvidence | None) -> bool:
    """Return whether the locked end gives: the difference of both angles explains the effort better than one alone.

    The noise of an angle that has nothing to do with the joint only adds to what is unexplained.
    """
    if alone is None:
        return False
    return found.unexplained_share <= SPRING_LIMITS.max_share_of_one_angle * alone.unexplained_share


def _said(found: SpringEvidence) -> str:
    return f"a spring explains {100.0 * (1.0 - found.unexplained_share):.1f} % of the effort"


def _span(x: np.ndarray) -> float:
    known = x[np.isfinite(x)]
    return float(np.ptp(np.percentile(known, SPRING_LIMITS.range_percentiles))) if len(known) else float("nan")


def _evidence(deflection: np.ndarray, effort: np.ndarray, rate: float) -> SpringEvidence | None:
    known = np.isfinite(deflection) & np.isfinite(effort)
    if known.sum() < SPRING_LIMITS.min_rows or np.ptp(deflection[known]) == 0.0:
        return None
    place = np.arange(len(deflection))
    q, y = (np.interp(place, place[known], x[known]) for x in (deflection, effort))
    lowpass = choose_processing(q, rate).lowpass
    q, y = (zero_phase_lowpass(x, lowpass, 4, rate) for x in (q, y))
    v = central_difference(q, rate)
    edge = min(round(rate / lowpass), len(q) // 10)
    inner = slice(edge, len(q) - edge)
    return spring_evidence(q[inner], v[inner], central_difference(v, rate)[inner], y[inner])


@dataclass(frozen=True)
class HeldPostures:
    """Postures that a recording holds."""

    positions: tuple[float, ...]  # mean positions of the holds, in the column's unit
    still_share: float  # share of the time in which the joint is still

    @property
    def is_static(self) -> bool:
        """Whether the recording is one of postures."""
        is_still = self.still_share >= SPRING_LIMITS.min_still_share
        return is_still and len(self.positions) >= SPRING_LIMITS.min_posture_count


def find_postures(position: np.ndarray, rate: float) -> HeldPostures:
    """Return the different postures that positions, shape (n,), sampled at `rate` [Hz], hold."""
    smooth = running_mean(position, max(1, round(0.05 * rate)))
    speed = np.abs(np.gradient(smooth)) * rate
    still = speed < SPRING_LIMITS.still_speed_share * max(float(np.quantile(speed, 0.995)), 1e-12)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], still, [False])).astype(int)))
    spans = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= SPRING_LIMITS.min_hold_s * rate]
    apart, distinct = SPRING_LIMITS.min_posture_distance_share * float(np.ptp(smooth)), list[float]()
    for a, b in spans:
        place = float(np.mean(smooth[a:b]))
        if all(abs(place - other) > apart for other in distinct):
            distinct.append(place)
    return HeldPostures(tuple(distinct), float(np.mean(still)))
