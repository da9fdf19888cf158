"""The bodies, joints and friction of a card as simulators describe them, and their text as MJCF and URDF.

A joint of one coordinate does not tell how its inertia divides between the link and the rotor. Half of it becomes the
link's, with the mass and the centre of mass that its gravity asks for, and half the armature. URDF has no armature, so
that there all of it is the link's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from ... import _core
from ..._errors import PellucidError
from ..._given import visible_text
from ...models.card import ModelCard
from ...models.friction_terms import COULOMB_FRICTION, TERMS, VISCOUS_FRICTION
from ...models.joint import GRAVITY, NAMES, SYMBOLS_BY_NAME
from ...models.kinematic_tree import TRIANGLE_MARGIN
from ...models.tree_card import COLUMNS, TreeCard
from ...study.study_file import JointLimits

FRICTION_FIELDS = tuple(
    name for name in COLUMNS["joints"] if name not in ("offset", "velocity_width", "presliding_travel")
)
"""Friction coefficients of a joint that the file of ranges states, by the core's names."""

SHAPING_FIELDS = frozenset(term.name for term in TERMS if term.shapes)
"""Those of them that shape a curve of friction: a joint's and its drive's do not add up."""

SINGLE_JOINT = "joint"
"""Kind of a model that has one joint."""

LINK_SHARE = 0.5
"""Share of a single joint's inertia that its link gets in MJCF. The joint's own motion cannot show the true one."""

MIN_MASS = 1e-6
"""Mass of a link that has none [kg]: MuJoCo refuses a moving body of mass 0."""

MIN_INERTIA = 1e-9
"""Smallest moment of inertia about the centre of mass [kg m^2], for the same reason."""

PRINCIPAL_TOLERANCE = 1e-9
"""Two principal moments of inertia may fall short of the third by this share of it, which is rounding."""


@dataclass(frozen=True)
class SimulatorBody:
    """A link and the joint that moves it against its parent."""

    name: str
    parent: int  # index of the link that carries it, -1 for the base
    kind: str  # "hinge", "slide" or "fixed"
    joint: str  # name of the joint
    place: tuple[float, float, float]  # origin of the joint in the parent's frame [m]
    turn: tuple[float, float, float]  # roll, pitch and yaw about the parent's fixed axes [rad]
    axis: tuple[float, float, float]
    armature: float  # inertia of the rotor at the joint [kg m^2; kg]
    mass: float
    centre: tuple[float, float, float]  # centre of mass in the link's frame [m]
    inertia: np.ndarray  # about the centre of mass, shape (3, 3) [kg m^2]
    friction: Mapping[str, float]  # `FRICTION_FIELDS`, SI
    offset: float = 0.0  # constant effort that the joint asks for [N m; N]
    stiffness: float = 0.0  # of a spring beside the drive, slack at 0 but for the offset [N m/rad; N/m]
    gain: float = 1.0  # effort per unit of command
    back_emf: float = 0.0  # effort per velocity that the drive takes away [N m s/rad; N s/m]
    limits: tuple[float, float] | None = None  # positions [rad; m]
    effort: float | None = None  # largest effort of the drive [N m; N]
    velocity: float | None = None  # largest velocity [rad/s; m/s]


@dataclass(frozen=True)
class SimulatorModel:
    """A robot for a simulator, and the intervals of what was identified of it."""

    name: str
    gravity: tuple[float, float, float]
    bodies: tuple[SimulatorBody, ...]
    kind: str  # `SINGLE_JOINT`, or "tree" for several joints
    parameters: tuple[dict[str, Any], ...]  # name, unit, value, low, high and what it sets
    covariance: tuple[tuple[float, ...], ...]  # in the order of the parameters, SI
    confidence: float
    notes: tuple[str, ...]
    purpose: str = ""  # what the numbers were chosen for, "torque" or "simulation"; empty where nothing was chosen

    @property
    def moving(self) -> tuple[SimulatorBody, ...]:
        """Links with a joint that moves, in the order of the coordinates."""
        return tuple(body for body in self.bodies if body.kind != "fixed")


def joint_simulator_model(card: ModelCard, limits: JointLimits) -> SimulatorModel:
    """Return the model of a single joint; `limits` are the study's."""
    expected = "N" if card.motion == "prismatic" else "N*m"
    if card.effort_unit != expected:
        raise PellucidError(
            f"found an effort in {card.effort_unit}, expected one in {expected}: a simulator needs the drive's "
            "constant, [rig.drive] torque_constant"
        )
    vector = dict(zip(NAMES, card.model().vector(card.values).tolist(), strict=True))
    mass, centre, inertia, armature = single_body(
        vector["inertia"], vector["gravity_sine"], vector["gravity_cosine"], slides=card.motion == "prismatic"
    )
    stops = (limits.position_min, limits.position_max)
    body = SimulatorBody(
        name="link", parent=-1, kind="slide" if card.motion == "prismatic" else "hinge", joint=card.joint,
        place=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0),
        axis=(1.0, 0.0, 0.0) if card.motion == "prismatic" else (0.0, 1.0, 0.0),
        armature=armature, mass=mass, centre=centre, inertia=inertia,
        friction={name: vector[name] for name in FRICTION_FIELDS}, offset=vector["offset"],
        stiffness=vector["parallel_stiffness"],
        gain=card.drive.get("gain", 1.0), back_emf=card.drive.get("back_emf", 0.0),
        limits=None if stops[0] is None or stops[1] is None else (stops[0], stops[1]), effort=limits.effort,
        velocity=limits.velocity,
    )  # fmt: skip
    parameters = tuple(
        {
            "name": p.name, "unit": p.unit, "value": p.value, "low": p.interval[0], "high": p.interval[1],
            "joint": card.joint, "sets": list(SYMBOLS_BY_NAME[p.name].targets),
            "lowest": SYMBOLS_BY_NAME[p.name].lower if math.isfinite(SYMBOLS_BY_NAME[p.name].lower) else None,
        }
        for p in card.parameters
    )  # fmt: skip
    return SimulatorModel(
        card.study, (0.0, 0.0, -GRAVITY), (body,), SINGLE_JOINT, parameters, card.covariance, card.confidence,
        (f"Joint {card.joint} of {card.study}, family {card.family}, by {card.method}.",
         "The motion of a single joint does not identify the inertia of link and rotor separately."),
        card.purpose,
    )  # fmt: skip


def single_body(
    inertia: float, gravity_sine: float, gravity_cosine: float, *, slides: bool, share: float = LINK_SHARE
) -> tuple[float, tuple[float, float, float], np.ndarray, float]:
    """Return mass, centre, inertia about it and armature of a link that turns about y (or slides along x).

    Together they have the `inertia` [kg m^2; kg] and the gravity torque sine and cosine [N m] of a joint; the link has
    this `share` of the inertia.
    """
    if slides:
        return share * inertia, (0.0, 0.0, 0.0), MIN_INERTIA * np.eye(3), (1.0 - share) * inertia
    own, weight = share * inertia, math.hypot(gravity_sine, gravity_cosine)
    # A mass at this distance has half of the link's inertia; the other half is about its centre.
    distance = 0.5 * own * GRAVITY / weight if weight > 0.0 else 0.0
    mass = weight / (GRAVITY * distance) if distance > 0.0 else max(own, MIN_MASS)
    about = own - mass * distance**2
    centre = (-gravity_cosine / (mass * GRAVITY), 0.0, -gravity_sine / (mass * GRAVITY))
    return mass, centre, np.diag([about, about, about]), inertia - own


def tree_simulator_model(card: TreeCard) -> SimulatorModel:
    """Return the model of a robot of several joints, with the limits that its card states."""
    if not card.consistent:
        raise PellucidError(
            "found physically inconsistent inertias, expected consistent ones, which simulators require. Use the "
            "consistent card: --card tree.consistent.json"
        )
    if card.motors and np.abs(np.array(card.turns) - np.eye(len(card.turns))).max() > 0.0:
        raise PellucidError(
            "found motors that turn with several joints, expected a separate motor for each joint: neither MJCF nor "
            "URDF represents friction of a motor separately from that of its joint"
        )
    wrong = [unit for unit in card.effort_units if unit not in ("N*m", "N")]
    if wrong:
        raise PellucidError(f"found an effort in {wrong[0]}, expected N*m or N: a simulator needs the drives' gains")
    columns, bodies, at = dict(zip(_core.LINK_PARAMETER_NAMES, np.array(card.links).T, strict=True)), [], 0
    motors = dict(zip(COLUMNS["motors"], np.array(card.motors).T, strict=True)) if card.motors else {}
    for i, name in enumerate(card.bodies):
        row = {key: float(column[i]) for key, column in columns.items()}
        kind = ("fixed", "hinge", "slide")[int(row["joint"])]
        mass = max(row["mass"], MIN_MASS)
        centre = np.array([row["moment_x"], row["moment_y"], row["moment_z"]]) / mass
        upper = [row[f"inertia_{pair}"] for pair in ("xx", "xy", "xz", "yy", "yz", "zz")]
        about = np.zeros((3, 3))
        about[np.triu_indices(3)] = upper
        about = about + np.triu(about, 1).T - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        moving, joint = kind != "fixed", card.names[at] if kind != "fixed" else f"{name}_fixed"
        own = {key: float(column[at]) for key, column in card.joint_columns.items()} if moving else {}
        drive = {key: float(column[at]) for key, column in motors.items()} if moving else {}
        span = card.ranges[at] if moving else None
        bodies.append(SimulatorBody(
            name=name, parent=int(row["parent"]) - 1, kind=kind, joint=joint, place=(row["x"], row["y"], row["z"]),
            turn=(row["roll"], row["pitch"], row["yaw"]), axis=(row["axis_x"], row["axis_y"], row["axis_z"]),
            armature=(row["rotor_inertia"] + drive.get("motor_inertia", 0.0)) if moving else 0.0, mass=mass,
            centre=(float(centre[0]), float(centre[1]), float(centre[2])), inertia=about,
            friction={key: own.get(key, 0.0) + (drive.get(key, 0.0) if key not in SHAPING_FIELDS else 0.0)
                      for key in FRICTION_FIELDS},
            offset=own.get("offset", 0.0), gain=1.0,
            limits=None if span is None or span.low is None or span.high is None else (span.low, span.high),
            effort=None if span is None else span.effort, velocity=None if span is None else span.velocity,
        ))  # fmt: skip
        at += moving
    joints = {f"{joint}.{field}": (joint, field) for joint in card.names for field in FRICTION_FIELDS}
    tied = {term.name: list(term.targets) for term in (COULOMB_FRICTION, VISCOUS_FRICTION)}
    parameters = []
    for p in card.parameters:
        joint, field = joints.get(p.name, ("", ""))
        if not joint and p.name.rpartition(".")[0] in card.names and p.name.rpartition(".")[2] in tied:
            joint, _, field = p.name.rpartition(".")
        sets = tied.get(field, [field] if field else [])
        parameters.append({
            "name": p.name, "unit": p.unit, "value": p.value, "low": p.interval[0], "high": p.interval[1],
            "joint": joint, "sets": sets, "lowest": 0.0 if sets else None,
        })  # fmt: skip
    notes = [f"Robot of {card.study}, {card.method}."]
    if card.ripples:
        notes.append("Ripple of the drives is not in this model.")
    return SimulatorModel(card.study, card.gravity, tuple(bodies), "tree", tuple(parameters), card.covariance,
                          card.confidence, tuple(notes))  # fmt: skip


def mjcf_text(model: SimulatorModel, *, timestep: float = 0.001) -> str:
    """Return the model as MJCF, in which each joint has its armature, damping and friction."""
    require_bodies(model)
    lines = [
        "<!--", *(f"  {visible_text(note).replace('--', '- -')}" for note in model.notes),
        "  frictionloss and damping are the friction common to both directions; friction.py adds the dependence on",
        "  direction, load and speed. ranges.json has the interval of every parameter.", "-->",
        f"<mujoco model={_name(model.name)}>",
        '  <compiler angle="radian" autolimits="true" inertiafromgeom="false"/>',
        f'  <option timestep="{timestep:g}" integrator="implicitfast" gravity="{_numbers(model.gravity)}">',
        '    <flag contact="disable"/>', "  </option>",
        # A stiffer friction constraint than MuJoCo's default, so that friction has its level at small speeds too.
        '  <default><joint solreffriction="0.002 1" solimpfriction="0.99 0.999 0.001 0.5 2"/></default>',
        "  <worldbody>", *_mjcf_bodies(model, -1, "    "), "  </worldbody>", "  <actuator>",
    ]  # fmt: skip
    for body in model.moving:
        # The command is the drive's: its gain gives the effort, its back-EMF takes some of it away.
        lines.append(
            f"    <general name={_name(body.joint)} joint={_name(body.joint)} gainprm={_text(body.gain)} "
            f'biastype="affine" biasprm="0 0 {-body.back_emf!r}"'
            + (f' forcerange="{_numbers((-body.effort, body.effort))}"' if body.effort else "")
            + "/>"
        )
        if body.offset:
            lines.append(
                f'    <general name={_name(body.joint + "_offset")} joint={_name(body.joint)} gainprm="0" '
                f'biastype="affine" biasprm="{-body.offset!r} 0 0"/>'
            )
    return "\n".join([*lines, "  </actuator>", "</mujoco>"]) + "\n"


def _mjcf_bodies(model: SimulatorModel, parent: int, indent: str) -> list[str]:
    """Return the lines of the links that a link carries, and of all that these carry."""
    lines = []
    for i, body in enumerate(model.bodies):
        if body.parent != parent:
            continue
        turn = _numbers(_quaternion(body.turn))
        lines.append(f'{indent}<body name={_name(body.name)} pos="{_numbers(body.place)}" quat="{turn}">')
        if body.kind != "fixed":
            loss, damping = plain_friction(body.friction)
            lines.append(
                f'{indent}  <joint name={_name(body.joint)} type="{body.kind}" axis="{_numbers(body.axis)}" '
                f'armature="{body.armature!r}" damping="{damping!r}" frictionloss="{loss!r}"'
                + (f' stiffness="{body.stiffness!r}"' if body.stiffness else "")
                + (f' range="{_numbers(body.limits)}"' if body.limits else "")
                + "/>"
            )
        moments = _sound_inertia(body.inertia)
        full = (moments[0, 0], moments[1, 1], moments[2, 2], moments[0, 1], moments[0, 2], moments[1, 2])
        lines.append(
            f'{indent}  <inertial pos="{_numbers(body.centre)}" mass="{body.mass!r}" fullinertia="{_numbers(full)}"/>'
        )
        lines += [*_mjcf_bodies(model, i, f"{indent}  "), f"{indent}</body>"]
    return lines


def urdf_text(model: SimulatorModel) -> str:
    """Return the model as URDF, in which each joint has its damping and friction, and a single joint's link its whole
    inertia; armatures of several joints are in ranges.json."""
    require_bodies(model)
    lines = [
        '<?xml version="1.0"?>', "<!--", *(f"  {visible_text(note).replace('--', '- -')}" for note in model.notes),
        "  ranges.json has armatures, which URDF has no place for, and the interval of every number.", "-->",
        f"<robot name={_name(model.name)}>", '  <link name="base"/>',
    ]  # fmt: skip
    for body in model.bodies:
        mass, centre, inertia = body.mass, body.centre, body.inertia
        if model.kind == SINGLE_JOINT:
            # The link of a single joint has the whole inertia.
            whole = body.armature / (1.0 - LINK_SHARE)
            weight_x, weight_z = -mass * GRAVITY * centre[2], -mass * GRAVITY * centre[0]
            mass, centre, inertia, _ = single_body(whole, weight_x, weight_z, slides=body.kind == "slide", share=1.0)
        inertia = _sound_inertia(inertia)
        pairs = ((pair, "xyz".index(pair[0]), "xyz".index(pair[1])) for pair in ("xx", "xy", "xz", "yy", "yz", "zz"))
        upper = " ".join(f'i{pair}="{float(inertia[row, column])!r}"' for pair, row, column in pairs)
        parent = "base" if body.parent < 0 else model.bodies[body.parent].name
        lines += [
            f"  <link name={_name(body.name)}>", "    <inertial>",
            f'      <origin xyz="{_numbers(centre)}" rpy="0 0 0"/>', f'      <mass value="{mass!r}"/>',
            f"      <inertia {upper}/>", "    </inertial>", "  </link>",
        ]  # fmt: skip
        kind = {"fixed": "fixed", "slide": "prismatic", "hinge": "revolute" if body.limits else "continuous"}[body.kind]
        lines += [
            f'  <joint name={_name(body.joint)} type="{kind}">',
            f'    <origin xyz="{_numbers(body.place)}" rpy="{_numbers(body.turn)}"/>',
            f'    <parent link={_name(parent)}/>', f'    <child link={_name(body.name)}/>',
        ]  # fmt: skip
        if kind != "fixed":
            loss, damping = plain_friction(body.friction)
            low, high = body.limits or (-1e9, 1e9)
            ends = f'lower="{low!r}" upper="{high!r}" ' if kind != "continuous" else ""
            lines += [
                f'    <axis xyz="{_numbers(body.axis)}"/>',
                f'    <limit {ends}effort="{body.effort or 1e9!r}" velocity="{body.velocity or 1e9!r}"/>',
                f'    <dynamics damping="{damping!r}" friction="{loss!r}"/>',
            ]
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>"]) + "\n"


def ranges_table(model: SimulatorModel) -> dict[str, Any]:
    """Return what ``ranges.json`` says: each number with its interval, the covariance, and each joint's friction."""
    return {
        "study": model.name,
        "kind": model.kind,
        "purpose": model.purpose,
        "gravity": list(model.gravity),
        "confidence": model.confidence,
        "link_share": LINK_SHARE,
        "parameters": list(model.parameters),
        "covariance": [list(row) for row in model.covariance],
        "joints": {
            body.joint: {"armature": body.armature, "offset": body.offset, **body.friction}
            | ({"parallel_stiffness": body.stiffness} if body.stiffness else {})
            for body in model.moving
        },
    }


def plain_friction(friction: Mapping[str, float]) -> tuple[float, float]:
    """Return the level and the slope of friction that are the same both ways, which MJCF and URDF have [SI]."""
    level, slope = (
        sum(friction[name] for name in term.targets) / len(term.targets)
        for term in (COULOMB_FRICTION, VISCOUS_FRICTION)
    )
    return level, slope


def require_bodies(model: SimulatorModel) -> None:
    """Refuse a link whose inertia no body has, by name."""
    for body in model.bodies:
        moments = np.sort(np.linalg.eigvalsh(body.inertia))
        if moments[0] < -PRINCIPAL_TOLERANCE * max(moments[2], 1e-12) or (
            moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-6) + MIN_INERTIA
        ):
            raise PellucidError(
                f"link {body.name}: found the principal moments of inertia {', '.join(f'{m:.3g}' for m in moments)} "
                "kg*m^2, which no body has; expected each to be above 0 and at most the sum of the others"
            )


def _sound_inertia(inertia: np.ndarray) -> np.ndarray:
    """Return an inertia that a simulator accepts in spite of rounding, also once it has saved it itself."""
    moments, axes = np.linalg.eigh(inertia)
    moments = np.maximum(moments, MIN_INERTIA)
    short = (1.0 + TRIANGLE_MARGIN) * moments[2] - moments[0] - moments[1]
    if short > 0.0:
        moments = moments + short / (1.0 - TRIANGLE_MARGIN)
        return (axes * moments) @ axes.T
    return inertia if np.linalg.eigvalsh(inertia)[0] >= MIN_INERTIA else (axes * moments) @ axes.T


def _quaternion(turn: tuple[float, float, float]) -> tuple[float, float, float, float]:
    """Return the quaternion, w first, of roll, pitch and yaw about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = ([f(0.5 * angle) for angle in turn] for f in (math.cos, math.sin))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _numbers(values: Sequence[float]) -> str:
    """Return numbers as MJCF and URDF list them, each to its last bit."""
    return " ".join(repr(float(value)) for value in values)


def _text(value: float) -> str:
    return f'"{float(value)!r}"'


def _name(text: str) -> str:
    """Return a name as a quoted attribute."""
    return quoteattr(visible_text(text))
