"""Control laws of all joints of a robot, built from its card alone.

`full_compensation` compensates identified gravity and friction. `carried` compensates less friction, so that no joint
is driven. `transparent` also compensates a share of inertia, limited by each joint's energy. `with_force_sensor`,
`with_emg` and `with_dither` extend it. `instruments` of each joint state the sensors of the supervisor: measured
drives, second encoders. Incomplete cards are rejected with the reason, such as efforts in the unit of the drive or an
unknown speed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import _core
from .._errors import PellucidError
from ..models.anthropometry import Segment
from ..models.fields import largest_friction, model_fields
from ..models.tree_card import COLUMNS, TreeCard
from .control_law import Limits, gate_values
from .controller import require_inertia_margin, supported_inertia_share
from .instruments import Instruments
from .joint_compensation import DEFAULT_PERIOD_S, EFFORT_RISE_S, WIDTH_SHARE
from .supervised import (
    DRIVE_DELAY_S,
    ENERGY_BUDGET_POWER_SHARE,
    ENERGY_STORE_SPEED_SHARE,
    HOLD_DAMPING_SHARE,
    MAX_TEST_WORK_RATIO,
    MIN_DRIVEN_INERTIA_SHARE,
    SENSOR_QUIET_S,
    TEST_REST_S,
    WEARER_ACCELERATION_TIMES_S,
    WEARER_TORQUE_SHARE,
    commissioned_bounds,
    drive_watch,
    encoder_watch,
    start_up_wave,
)
from .transparent_laws import DITHER_TRAVEL

MOST_LINKS = 12
"""Largest number of links of a law."""

POSTURE_COUNT = 400
"""Number of postures drawn within the joints' ranges, to find the largest weight and the smallest inertia."""

POSTURE_SEED = 20261122
"""Seed of these postures."""

MIN_INERTIA = 1e-6
"""Smallest inertia of a joint that thresholds are made of, where the card has none [kg m^2 or kg]."""

MOST_INERTIA_SHARE = 0.4
"""Largest share of inertia that `transparent` takes by itself [1]."""

STORE_SPEED_OF_OWN = 2.0
"""Speed up to which the energy observer allows a joint's own inertia to be accelerated at once [rad/s or m/s]."""

WEARER_PUSH_SHARE = 0.8
"""Largest momentary torque of a wearer, as a share of the joint's limit of effort [1]."""

RINGING_LIMIT_SHARE = 0.115
"""Largest mean effort at frequencies above those of human motion, as a share of the joint's limit of effort [1]."""

FORCE_FRICTION_SHARE = 0.5
"""Largest lasting difference between force sensors and the momentum observer, as a share of the joint's friction at
rest under its largest weight [1]. The uncertainty of friction at each moment is added."""

FORCE_EFFORT_SHARE = 0.02
"""Share of the joint's limit of effort that is added for a sensor's offset [1]."""

FORCE_BURST_SHARE = 0.15
"""Largest instantaneous difference, as a share of the joint's limit of effort, in addition to friction [1]."""

FORCE_LOUDNESS = 0.0
"""Largest sum over joints of excess force readings, in units of each joint's friction at rest [1]."""


def _defaults(model: str) -> dict[str, float]:
    return {field.name: field.default for field in model_fields(model)}


@dataclass(frozen=True)
class Reach:
    """What a robot's joints ask and do within their ranges: (m,) each, SI."""

    weight: np.ndarray  # Largest |gravity| [N m; N]
    friction: np.ndarray  # At known speed, under that weight
    inertia: np.ndarray  # Smallest of the joint alone, others held [kg m^2; kg]
    speed: np.ndarray  # Largest while fitting, else what is allowed [rad/s; m/s]
    end_speed: float  # Largest speed of the end point with every joint at that speed [m/s]
    resting: np.ndarray  # Friction at rest under that weight [N m; N]
    heaviest: np.ndarray  # Largest inertia of the joint alone, others held [kg m^2; kg]
    coupled: np.ndarray  # Largest with all joints accelerated alike, whichever way [kg m^2; kg]


@dataclass(frozen=True)
class TreeLaw:
    """A control law of several joints with its parameters, by name and joint, as the builders of this file return.

    Attributes
    ----------
    card : TreeCard
        Whose robot it is.
    kind : str
        What it is, in a word.
    joints : mapping of str to float, one for each joint
        What of each is lost, as the law has it: the card's, with a smooth sign.
    shares : mapping of str to float, one for each joint
        What is done there; the names are those of ``model_fields("tree_law_joint")``.
    whole : mapping of str to float
        What is done with all.
    watches : mapping of str to float, one for each joint
        What the supervisor watches there.
    whole_watch : mapping of str to float
        And of all.
    instruments : Instruments, one for each joint
        What the robot measures there.
    """

    card: TreeCard
    kind: str
    joints: tuple[Mapping[str, float], ...]
    shares: tuple[Mapping[str, float], ...]
    whole: Mapping[str, float]
    watches: tuple[Mapping[str, float], ...]
    whole_watch: Mapping[str, float]
    instruments: tuple[Instruments, ...]

    @cached_property
    def numbers(self) -> dict[str, np.ndarray]:
        """Arguments of the core, by name."""
        made = {
            "links": np.array(self.card.links),
            "gravity": np.array(self.card.gravity),
            "joints": _rows(self.joints, COLUMNS["joints"]),
            "shares": _rows(self.shares, tuple(_defaults("tree_law_joint"))),
            "whole": _rows((self.whole,), tuple(_defaults("tree_law_whole")))[0],
        }
        if self.card.motors:
            motors, width = np.array(self.card.motors), COLUMNS["motors"].index("velocity_width")
            motors[:, width] = [joint["velocity_width"] for joint in self.joints]
            made |= {"turns": np.array(self.card.turns), "motors": motors}
        return made

    def start(self, *, single: bool = False) -> _core.TreeLaw:
        """Return an instance at rest, behind its front; `single` in float32, as on a microcontroller."""
        return _core.TreeLaw(**self.numbers, single=single)

    def supervised(self, *, single: bool = False, commanded: bool = False) -> _core.SupervisedTreeLaw:
        """Return an instance with its supervisor; `commanded`: efforts are given in each step instead of computed."""
        return _core.SupervisedTreeLaw(
            **self.numbers,
            watches=_rows(self.watches, tuple(_defaults("tree_watch_joint"))),
            whole_watch=_rows((self.whole_watch,), tuple(_defaults("tree_watch_whole")))[0],
            single=single,
            commanded=commanded,
        )

    def changed(self, joint: str | None = None, **values: float) -> TreeLaw:
        """The same with some numbers of one joint, of every joint or of the whole changed, SI."""
        known = (*self.shares[0], *self.whole)
        unknown = [name for name in values if name not in known]
        if unknown:
            raise PellucidError(
                f"law of several joints: found no parameter {', '.join(unknown)}, expected any of {', '.join(known)}"
            )
        if joint is not None and joint not in self.card.names:
            raise PellucidError(f"found the joint {joint!r}, expected one of {', '.join(self.card.names)}")
        shares = tuple(
            {**share, **{k: float(x) for k, x in values.items() if k in share}} if joint in (None, name) else share
            for name, share in zip(self.card.names, self.shares, strict=True)
        )
        whole = {**self.whole, **{k: float(x) for k, x in values.items() if k in self.whole}}
        return replace(self, shares=shares, whole=whole)


def full_compensation(card: TreeCard, **settings) -> TreeLaw:
    """Return the compensation of identified gravity and friction, as published, which is the baseline of the others.

    `settings` as of `carried`.
    """
    return replace(carried(card, friction_share=1.0, **settings), kind="full")


def carried(
    card: TreeCard,
    *,
    friction_share: float = 0.8,
    limits: Sequence[Limits] | None = None,
    period: float = DEFAULT_PERIOD_S,
    end: str | None = None,
    end_point: tuple[float, float, float] = (0.0, 0.0, 0.0),
    wearer: Sequence[float] | None = None,
    instruments: Instruments | Sequence[Instruments] | None = None,
    start_up: bool = False,
) -> TreeLaw:
    """Weight of every joint, and a share of its friction, so that nothing is driven.

    `limits` of each joint replace those that the card suggests; `period` in [s]; `end` names the body that bears the
    end point, or it is the last; `end_point` lies in it [m]; `wearer` is the most that people give each joint at once
    beyond friction [N m; N], or it follows from limits and inertia. `instruments` are those of every joint, or one for
    each; `start_up` asks for a wave of effort that tests polarity and gain of one joint after the other.
    """
    _require_efforts(card)
    if len(card.links) > MOST_LINKS:
        raise PellucidError(f"model card '{card.family}': found {len(card.links)} links, expected at most {MOST_LINKS}")
    end = card.bodies[-1] if end is None else end
    if end not in card.bodies:
        raise PellucidError(f"found the body {end!r}, expected one of {', '.join(card.bodies)}")
    link = card.bodies.index(end)
    reach = reach_of(card, link, end_point)
    limits = suggested_limits(card, reach) if limits is None else tuple(limits)
    if len(limits) != len(card.names):
        raise PellucidError(f"limits: found {len(limits)}, expected {len(card.names)}, one for each joint")
    measured = instruments_of(card, instruments)
    joints = tuple(
        dict(zip(COLUMNS["joints"], map(float, row), strict=True)) | {"velocity_width": WIDTH_SHARE * speed}
        for row, speed in zip(card.joints, reach.speed, strict=True)
    )
    share = _defaults("tree_law_joint") | {
        "gravity_share": 1.0, "friction_share": friction_share, "bandwidth": min(100.0, 0.5 / period),
        "innovation_gate": math.inf,
    }  # fmt: skip
    shares = tuple(share | gate_values(one, period) for one in limits)
    whole = _defaults("tree_law_whole") | {
        "observer_bandwidth": min(30.0, 0.2 / period),
        "power_limit": float(sum(one.effort * one.velocity for one in limits) / 2.0),
        "speed_limit": 1.5 * reach.end_speed if reach.end_speed > 0.0 else math.inf,
        "end_link": link + 1.0, **dict(zip(("end_x", "end_y", "end_z"), map(float, end_point), strict=True)),
    }  # fmt: skip
    whole_watch = _defaults("tree_watch_whole") | {
        "raw_power_limit": whole["power_limit"], "raw_end_speed_limit": whole["speed_limit"], "degrades": 1.0,
        "trusts_motion": float(all(one.drive and one.joint_encoder for one in measured)),
        "wrench_quiet_samples": max(2.0, round(SENSOR_QUIET_S / period)),
    }  # fmt: skip
    watches = tuple(_watch(one, reach, k, period, measured[k], start_up) for k, one in enumerate(limits))
    if wearer is not None:
        watches = tuple({**w, "outside_limit": float(x)} for w, x in zip(watches, wearer, strict=True))
    return TreeLaw(card, "carried", joints, shares, whole, watches, whole_watch, measured)


def instruments_of(card: TreeCard, instruments: Instruments | Sequence[Instruments] | None) -> tuple[Instruments, ...]:
    """Return the instruments of each joint of a card: one for all, one for each, or none beyond the encoders."""
    if instruments is None or isinstance(instruments, Instruments):
        return (instruments or Instruments(),) * len(card.names)
    if len(instruments) != len(card.names):
        raise PellucidError(f"instruments: found {len(instruments)}, expected {len(card.names)}, one for each joint")
    return tuple(instruments)


def transparent(
    card: TreeCard,
    *,
    friction_share: float = 0.95,
    inertia_share: float | None = None,
    acceleration: float = 25.0,
    check_margin: bool = True,
    **settings,
) -> TreeLaw:
    """Return the compensation of gravity, friction and a share of inertia, limited by each joint's energy.

    It needs no force sensor. `inertia_share` of None is the largest up to `MOST_INERTIA_SHARE` with a sufficient margin
    over sampled bodies, postures and cuffs; a share with too small a margin is rejected, unless `check_margin` is
    False. `acceleration` [rad/s^2 or m/s^2]; `settings` as of `carried`.
    """
    law = carried(card, friction_share=friction_share, **settings)
    reach, share = reach_of(card), law.shares[0]
    asked = {"friction_share": friction_share, "bandwidth": share["bandwidth"], "period": share["period"]}
    width = WIDTH_SHARE * reach.speed
    if inertia_share is None:
        inertia_share = supported_inertia_share(card, width, most=MOST_INERTIA_SHARE, **asked)
    elif check_margin and inertia_share > 0.0:
        require_inertia_margin(card, width, share=inertia_share, **asked)
    shares = tuple(
        {**share, "inertia_share": inertia_share, "acceleration_limit": acceleration,
         "energy_store": 0.5 * float(inertia) * STORE_SPEED_OF_OWN**2}
        for share, inertia in zip(law.shares, reach.inertia, strict=True)
    )  # fmt: skip
    return replace(law, kind="transparent", shares=shares)


def with_force_sensor(
    law: TreeLaw,
    *,
    body: str | None = None,
    point: tuple[float, float, float] = (0.0, 0.0, 0.0),
    proportional: float = 2.0,
    lowpass: float = 15.0,
    drift: float = 0.1,
    limit_share: float = 0.2,
    at_joints: Sequence[str] | None = None,
) -> TreeLaw:
    """Return the law with control of the interaction torque to zero, from force sensors.

    The sensors are at joints, or one is on a `body`, at a `point` in it [m], whose force and moment the Jacobian
    converts to joint torques. `lowpass`, `drift` [rad/s]; `limit_share` of each joint's limit of effort may be fed
    back. `at_joints` names the joints that have a sensor; None: all of them, or none if there is a body. The supervisor
    compares the sensors with the momentum observer.
    """
    if body is not None and body not in law.card.bodies:
        raise PellucidError(f"found the body {body!r}, expected one of {', '.join(law.card.bodies)}")
    shares = tuple(
        {**share, "proportional": proportional, "sensor_lowpass": lowpass, "sensor_drift": drift,
         "feedback_limit": limit_share * share["effort_limit"],
         "energy_store": share["energy_store"] * (2.0 + proportional)}
        for share in law.shares
    )  # fmt: skip
    place = {} if body is None else {"sensor_link": law.card.bodies.index(body) + 1.0}
    place |= dict(zip(("sensor_x", "sensor_y", "sensor_z"), map(float, point), strict=True))
    sensing = (law.card.names if body is None else ()) if at_joints is None else tuple(at_joints)
    unknown = [name for name in sensing if name not in law.card.names]
    if unknown:
        raise PellucidError(f"found the joint {unknown[0]!r}, expected one of {', '.join(law.card.names)}")
    friction, quiet = reach_of(law.card).resting, law.whole_watch["wrench_quiet_samples"]
    watches = tuple(
        {**watch, "force_expected": float(name in sensing), "force_range": own.force_range,
         "force_quiet_samples": quiet,
         "force_tolerance": FORCE_FRICTION_SHARE * float(rests) + FORCE_EFFORT_SHARE * share["effort_limit"],
         "force_burst": FORCE_BURST_SHARE * share["effort_limit"],
         "force_scale": float(rests) if rests > 0.0 else math.inf}
        for name, watch, share, own, rests in zip(
            law.card.names, law.watches, law.shares, law.instruments, friction, strict=True
        )
    )  # fmt: skip
    whole_watch = {**law.whole_watch, "wrench_expected": float(body is not None), "force_excess": FORCE_LOUDNESS}
    return replace(
        law, kind=f"{law.kind} with a force sensor", shares=shares, whole={**law.whole, **place}, watches=watches,
        whole_watch=whole_watch,
    )  # fmt: skip


def with_emg(law: TreeLaw, joint: str, limb: Segment, *, share: float = 0.5, viscous: float = 0.1) -> TreeLaw:
    """A law whose acceleration of one joint is led by EMG, where the wearer's `limb` is a pendulum about it: an elbow
    with the upper arm hanging, a knee. `viscous` [N m s/rad]."""
    if joint not in law.card.names:
        raise PellucidError(f"found the joint {joint!r}, expected one of {', '.join(law.card.names)}")
    k = law.card.names.index(joint)
    if law.card.motion[k] != "r":
        raise PellucidError(f"{joint}: found a prismatic joint, expected a rotary joint for a limb")
    left = (1.0 - law.shares[k]["inertia_share"]) * float(reach_of(law.card).inertia[k])
    heard = {
        "muscle_expected": 1.0, "muscle_range": law.instruments[k].emg_range,
        "muscle_quiet_samples": max(2.0, round(SENSOR_QUIET_S / law.shares[k]["period"])),
    }  # fmt: skip
    watches = tuple({**watch, **heard} if i == k else watch for i, watch in enumerate(law.watches))
    return replace(law, watches=watches).changed(
        joint, limb_inertia=limb.inertia + left, limb_gravity=limb.gravity(), limb_viscous=viscous,
        emg_limit=law.shares[k]["acceleration_limit"], emg_share=share,
    )  # fmt: skip


def with_dither(law: TreeLaw, *, share: float = 2.0, frequency: float = 1000.0) -> TreeLaw:
    """A law whose motors tremble against sticking; refused of a joint whose travel below slip was not measured, or is
    longer than dither frees a joint from. `frequency` [rad/s]."""
    reach, shares = reach_of(law.card), []
    for k, (name, joint, one) in enumerate(zip(law.card.names, law.joints, law.shares, strict=True)):
        travel = joint["presliding_travel"]
        if not travel > 0.0:
            raise PellucidError(
                f"{name}: found no presliding_travel, expected one, because the amplitude of dither depends on it. "
                "Record slow reversals, or use the controller without dither"
            )
        if travel > DITHER_TRAVEL:
            raise PellucidError(
                f"{name}: found a presliding_travel of {1e3 * travel:.2g} mrad, expected at most "
                f"{1e3 * DITHER_TRAVEL:g} for dither, which does not prevent sticking over a larger displacement"
            )
        level = float(largest_friction(model_fields("tree_joint"), joint, 0.0, float(reach.weight[k])))
        period = one["period"]
        steepest = one["rate_limit"] * period / (2.0 * math.sin(0.5 * frequency * period))
        shares.append({**one, "dither": min(share * level, steepest), "dither_frequency": frequency})
    return replace(law, kind=f"{law.kind} with dither", shares=tuple(shares))


def reach_of(card: TreeCard, link: int | None = None, point: Sequence[float] = (0.0, 0.0, 0.0)) -> Reach:
    """Weights, friction, inertias and speeds over postures drawn within the ranges of joints, the same every time."""
    tree, m = card.tree, len(card.names)
    low, high, speed = np.zeros(m), np.zeros(m), np.zeros(m)
    for k, (name, known) in enumerate(zip(card.names, card.ranges, strict=True)):
        low[k], high[k] = known.span(card.motion[k])
        found = known.seen_velocity or known.velocity
        if not found:
            raise PellucidError(
                f"model card '{card.family}': found no speed of {name}, expected seen_velocity or velocity"
            )
        speed[k] = found
    postures = np.random.default_rng(POSTURE_SEED).uniform(low, high, (POSTURE_COUNT, m))
    weight = np.abs(tree.gravity(postures)).max(axis=0)
    matrices = tree.mass_matrix(postures)
    own = np.einsum("nkk->nk", matrices)
    inertia = np.maximum(own.min(axis=0), MIN_INERTIA)
    column = card.joint_columns
    friction = largest_friction(model_fields("tree_joint"), column, speed, weight) + np.abs(column["offset"])
    jacobian = tree.jacobian(postures, len(card.links) - 1 if link is None else link, point)[:, :3]
    end_speed = float(np.linalg.norm(np.abs(jacobian) @ speed, axis=1).max())
    resting = np.asarray(largest_friction(model_fields("tree_joint"), column, 0.0, weight))
    coupled = np.abs(matrices).sum(axis=2).max(axis=0)
    return Reach(
        weight, friction, inertia, speed, end_speed, resting, np.maximum(own.max(axis=0), MIN_INERTIA), coupled
    )


def suggested_limits(card: TreeCard, reach: Reach) -> tuple[Limits, ...]:
    """Return limits for each joint from the card.

    By default they are the largest effort of the compensation at known speeds, 1.5 times that speed, and no stops.
    """
    made = []
    for k, known in enumerate(card.ranges):
        effort = known.effort or float(reach.weight[k] + reach.friction[k])
        if not effort > 0.0:
            raise PellucidError(f"{card.names[k]}: found neither gravity nor friction, expected an effort limit")
        stops = (-math.inf if known.low is None else known.low, math.inf if known.high is None else known.high)
        margin = 0.02 * (stops[1] - stops[0]) if math.isfinite(stops[1] - stops[0]) else 0.0
        made.append(
            Limits(effort, effort / EFFORT_RISE_S, known.velocity or 1.5 * float(reach.speed[k]), stops, margin)
        )
    return tuple(made)


def _watch(
    limits: Limits, reach: Reach, k: int, period: float, instruments: Instruments, start_up: bool
) -> dict[str, float]:
    """The supervisor's numbers of one joint, by the rules of one joint's."""
    known = _defaults("tree_watch_joint")
    effort, speed, inertia = limits.effort, limits.velocity, float(reach.inertia[k])
    speeds_up = float(reach.coupled[k]) * speed
    complete = instruments.completed(effort)
    left = max(float(reach.weight[k]) - effort, 0.0)  # weight that the law leaves to the wearer
    made = known | {
        "raw_speed_limit": speed,
        "raw_acceleration_limit": effort / (MIN_DRIVEN_INERTIA_SHARE * inertia),
        **encoder_watch(complete, *limits.position, period),
        **drive_watch(complete, effort, period),
        "drive_delay": DRIVE_DELAY_S + period if instruments.drive else math.inf,
        "push_limit": effort,
        "power_limit": effort * speed,
        "budget_store": inertia * (ENERGY_STORE_SPEED_SHARE * speed) ** 2 + float(reach.weight[k]),
        "budget_power": ENERGY_BUDGET_POWER_SHARE * effort * speed,
        "ringing_limit": RINGING_LIMIT_SHARE * effort,
        "hold_damping": HOLD_DAMPING_SHARE * inertia / period,
        "hold_limit": min(effort, 1.5 * float(reach.weight[k]) + float(reach.friction[k])),
        "outside_limit": max(WEARER_PUSH_SHARE * effort, speeds_up / WEARER_ACCELERATION_TIMES_S[1]) + left,
        "residual_slow": min(known["residual_slow"], 0.05 / period),
        "wearer_torque": max(WEARER_TORQUE_SHARE * effort, speeds_up / WEARER_ACCELERATION_TIMES_S[0]) + left,
        "test_rest": max(2.0, round(TEST_REST_S / period)),
    }
    return made | (_test(limits, reach, k, period, instruments) if start_up else {})


def _test(limits: Limits, reach: Reach, k: int, period: float, instruments: Instruments) -> dict[str, float]:
    """The wave of one joint at start-up: it moves the heaviest posture, and may do the work of the lightest."""
    heavy, light = float(reach.heaviest[k]), float(reach.inertia[k])
    wave = start_up_wave(
        heavy, float(reach.resting[k]), instruments.completed(limits.effort).encoder_resolution,
        limit=limits.effort, rate=limits.rate, period=period,
    )  # fmt: skip
    least, most = wave.least, MAX_TEST_WORK_RATIO * 2.0 * (wave.effort * wave.samples * period / math.pi) ** 2 / light
    answer = instruments.answer_to(wave.effort)
    if answer is not None:
        least, most = commissioned_bounds(answer)
    return {
        "test_effort": wave.effort,
        "test_samples": float(wave.samples),
        "test_least": least,
        "test_most": max(most, 1e-12),
    }


def _require_efforts(card: TreeCard) -> None:
    for name, unit in zip(card.names, card.effort_units, strict=True):
        if unit not in ("N*m", "N"):
            raise PellucidError(
                f"model card '{card.family}': found efforts of {name} in {unit}, expected N*m or N: a law of several "
                "joints adds them up; give the drive's gain in study.toml, or identify it with a known payload"
            )


def _rows(tables: Sequence[Mapping[str, float]], names: Sequence[str]) -> np.ndarray:
    return np.array([[table[name] for name in names] for table in tables])
