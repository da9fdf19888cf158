"""Limbs as one segment that swings about a joint: mass, centre and inertia from what a tape and a scale say.

Forearm and hand swing about the elbow by Winter's shares [1]_. For shank and foot about the knee two tables of shares
are offered: Winter's treat both as one segment between knee and ankle; de Leva's [2]_ are two segments, by sex, put
together here with the foot at a right angle to the shank.

.. [1] D. A. Winter, "Biomechanics and Motor Control of Human Movement", 4th ed., Wiley, 2009, table 4.1 and figure 4.1
   (lengths after Drillis and Contini, 1966).
.. [2] P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", Journal of Biomechanics 29(9),
   1996, table 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from .joint import GRAVITY


@dataclass(frozen=True)
class BodyShares:
    """Winter's shares of a standing height, a body's mass and a segment's length; two are others'."""

    shank_mass: float = 0.061  # Shank with foot, share of the body's mass
    shank_centre: float = 0.606  # Its centre from the knee, share of the length from knee to ankle
    shank_gyration: float = 0.416  # Its radius of gyration about that centre, share of the same length
    knee_to_ankle: float = 0.246  # Share of the standing height
    knee_to_sole: float = 0.285  # Share of the standing height: what a tape finds from the knee to the heel
    ankle_height: float = 0.039  # Share of the standing height
    elbow_to_wrist: float = 0.146  # Share of the standing height
    forearm_mass: float = 0.022  # Forearm with hand, share of the body's mass
    forearm_centre: float = 0.682  # Its centre from the elbow, share of the length from elbow to wrist
    forearm_gyration: float = 0.468  # Its radius of gyration about that centre, share of the same length
    shoulder_to_elbow: float = 0.186  # Share of the standing height
    upper_arm_mass: float = 0.028  # Share of the body's mass
    upper_arm_centre: float = 0.436  # Its centre from the shoulder, share of its length
    upper_arm_gyration: float = 0.322  # Its radius of gyration about that centre, share of its length
    # Radii of gyration of upper arm and forearm about their own long axes, shares of their lengths (de Leva, male).
    arm_gyration_along: tuple[float, float] = (0.158, 0.121)
    # Where the ankle stands over the foot, share of the foot's length from the heel: our assumption, in neither table.
    heel_to_ankle: float = 0.25


BODY_SHARES = BodyShares()


@dataclass(frozen=True)
class DeLevaShares:
    """One sex's row of de Leva's table, the shank from knee to ankle centre."""

    shank_length: float  # shank_length, foot_length: Shares of the standing height
    foot_length: float
    shank_mass: float  # shank_mass, foot_mass: Shares of the body's mass
    foot_mass: float
    shank_centre: float  # shank_centre, foot_centre: From the knee and from the heel, shares of the segment's length
    foot_centre: float
    # shank_gyration, foot_gyration: About the transverse axis through the centre, shares of the segment's length
    shank_gyration: float
    foot_gyration: float


DE_LEVA: Mapping[str, DeLevaShares] = MappingProxyType(
    {
        "female": DeLevaShares(0.4386 / 1.735, 0.2283 / 1.735, 0.0481, 0.0129, 0.4352, 0.4014, 0.263, 0.279),
        "male": DeLevaShares(0.4403 / 1.741, 0.2581 / 1.741, 0.0433, 0.0137, 0.4395, 0.4415, 0.246, 0.245),
    }
)


@dataclass(frozen=True)
class Segment:
    """A body that swings about a joint."""

    mass: float  # [kg]
    centre: float  # From the joint's axis to the centre of mass [m]
    inertia: float  # About the joint's axis [kg m^2]

    def gravity(self, acceleration: float = GRAVITY) -> float:
        """Gravity torque held out horizontally, m g l [N m], at an `acceleration` of gravity [m/s^2]."""
        return self.mass * acceleration * self.centre

    def joined(self, other: Segment) -> Segment:
        """Return this body and another about the same joint as one."""
        mass = self.mass + other.mass
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        return Segment(mass, centre, self.inertia + other.inertia)


def shank_length(height: float, *, to: str = "ankle") -> float:
    """Length of the shank where it was not measured. `height` [m]; gives [m]."""
    shares = {"ankle": BODY_SHARES.knee_to_ankle, "sole": BODY_SHARES.knee_to_sole}
    if to not in shares:
        raise ValueError(f'to: found {to!r}, expected "ankle" or "sole"')
    return shares[to] * _positive(height, "height")


def winter(mass: float, length: float) -> Segment:
    r"""Shank with foot by Winter's shares.

    .. math::
        m = 0.061\,M, \qquad l = 0.606\,L, \qquad I = m\,(0.416^2 + 0.606^2)\,L^2.

    `mass` [kg]; `length` [m].
    """
    shares = BODY_SHARES
    m, reach = shares.shank_mass * _positive(mass, "mass"), _positive(length, "length")
    return Segment(m, shares.shank_centre * reach, m * (shares.shank_gyration**2 + shares.shank_centre**2) * reach**2)


def forearm(mass: float, height: float, *, length: float | None = None) -> Segment:
    r"""Forearm with hand by Winter's shares.

    .. math::
        m = 0.022\,M, \qquad l = 0.682\,L, \qquad I = m\,(0.468^2 + 0.682^2)\,L^2.

    `mass` [kg]; `height` [m]; `length` [m].
    """
    shares = BODY_SHARES
    m = shares.forearm_mass * _positive(mass, "mass")
    reach = shares.elbow_to_wrist * _positive(height, "height") if length is None else _positive(length, "length")
    inertia = m * (shares.forearm_gyration**2 + shares.forearm_centre**2) * reach**2
    return Segment(m, shares.forearm_centre * reach, inertia)


def de_leva(mass: float, height: float, sex: str, *, length: float | None = None) -> Segment:
    """Shank and foot by de Leva's shares, the foot at a right angle. `mass` [kg]; `height` [m]; `length` [m]."""
    if sex not in DE_LEVA:
        raise ValueError(f'sex: found {sex!r}, expected "female" or "male", as the table has them')
    row, tall = DE_LEVA[sex], _positive(height, "height")
    shank = row.shank_length * tall if length is None else _positive(length, "length")
    shank_mass, foot_mass = (share * _positive(mass, "mass") for share in (row.shank_mass, row.foot_mass))
    foot = row.foot_length * tall
    down, forward = shank + 0.5 * BODY_SHARES.ankle_height * tall, (row.foot_centre - BODY_SHARES.heel_to_ankle) * foot
    total = shank_mass + foot_mass
    centre = (shank_mass * row.shank_centre * shank + foot_mass * down) / total
    inertia = shank_mass * (row.shank_gyration**2 + row.shank_centre**2) * shank**2
    inertia += foot_mass * ((row.foot_gyration * foot) ** 2 + down**2 + forward**2)
    return Segment(total, centre, inertia)


def rod(mass: float, length: float) -> Segment:
    """A uniform rod that turns about one end: the thesis's picture of the orthosis's lower shaft (its equation 3.1).
    `mass` [kg]; `length` [m]."""
    m, reach = _positive(mass, "mass"), _positive(length, "length")
    return Segment(m, 0.5 * reach, m * reach**2 / 3.0)


def point_mass(mass: float, distance: float) -> Segment:
    """A load that is small against its distance from the axis. `mass` [kg]; `distance` [m]."""
    m, reach = _positive(mass, "mass"), _positive(distance, "distance")
    return Segment(m, reach, m * reach**2)


def _positive(value: float, name: str) -> float:
    if not value > 0.0:
        raise ValueError(f"{name}: found {value!r}, expected a positive number in SI")
    return float(value)


def known_segments(
    mass: float | None, height: float | None = None, sex: str | None = None, length: float | None = None
) -> dict[str, Segment]:
    """What tables of shares say of shank and foot of somebody of so much `mass` [kg], `height` [m], `sex`, and shank
    `length` [m], as far as known: "winter", "published" by the measured length, "de_leva"; nothing without a mass."""
    if mass is None:
        return {}
    found = {}
    if height is not None:
        found["winter"] = winter(mass, shank_length(height))
    if length is not None:
        found["published"] = winter(mass, length)
    if height is not None and sex is not None:
        found["de_leva"] = de_leva(mass, height, sex)
    return found
