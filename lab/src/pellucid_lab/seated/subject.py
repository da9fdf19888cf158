"""Somebody who sits in the virtual shank exoskeleton: body, muscles and nerves, drawn from the rig file's ranges."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import brentq

from pellucid.emg.models.hill import HillMuscle
from pellucid.emg.models.muscle_geometry import muscle_table
from pellucid.models.anthropometry import shank_length, winter

from .machine import SeatedMachine
from .muscles import VirtualMuscle, torque_at_rest


@dataclass(frozen=True)
class SeatedSubject:
    """Somebody who sits in the exoskeleton, SI."""

    name: str
    sex: str
    age: float  # age, height, weight, frequency: [years], [m], [kg], of their swings [Hz]
    height: float
    weight: float
    frequency: float
    # moment, inertia, ahead, viscous: Of shank and foot: mass times distance of the centre [kg m], about the knee [kg
    # m^2], by how much the centre is in front of the shank [rad], [N m s/rad]
    moment: float
    inertia: float
    ahead: float
    viscous: float
    stiffness: float  # stiffness of the shells on the limb [N m/rad]
    rest: float  # angle of the knee at which the shank is vertical [rad]
    hip: float  # angle of the hip [rad]
    extensors: tuple[VirtualMuscle, ...] = field(repr=False)
    flexors: tuple[VirtualMuscle, ...] = field(repr=False)
    activation_time: float  # activation time of all muscles [s]
    deactivation_time: float  # deactivation time of all muscles [s]
    delay: float  # delay from EMG to force of all muscles [s]
    shape: float  # shape factor between EMG and activation of all muscles [1]
    cocontraction: float  # torque of co-contraction [N m]
    belief: float  # relative error of the inertia and weight that the person expects of the limb [1]
    maximal: float  # largest excitation that the person reaches, as a share of full excitation [1]
    emg_gain: tuple[float, ...]  # RMS of each electrode at full excitation, and of cross-talk alone [V]

    @property
    def muscles(self) -> tuple[VirtualMuscle, ...]:
        """Extensors, then flexors."""
        return (*self.extensors, *self.flexors)


def subjects(rig: SeatedMachine) -> dict[str, SeatedSubject]:
    """Everybody in a rig, by name."""
    return {name: draw_subject(rig, name) for name in rig.constants.subjects}


def draw_subject(rig: SeatedMachine, name: str) -> SeatedSubject:
    """What a subject is: the rig file's own numbers, and those drawn from its ranges; the same at every call."""
    constants = rig.constants
    stated, limb, muscles, wearer = constants.subjects[name], constants.limb, constants.muscles, constants.wearer
    body, nerves, strange = np.random.default_rng([rig.constants.difference.seed, *name.encode()]).spawn(3)

    def within(rng: np.random.Generator, limits: tuple[float, float]) -> float:
        return float(rng.uniform(*limits))

    usual = winter(stated.weight, shank_length(stated.height))
    gyration = np.sqrt(usual.inertia / usual.mass - usual.centre**2)
    mass, centre, gyration = (
        float(value * (1.0 + limb.spread * body.standard_normal())) for value in (usual.mass, usual.centre, gyration)
    )
    rest, hip = within(body, rig.constants.posture.rest), within(body, rig.constants.posture.hip)
    size = stated.height / muscles.model_height
    force = (stated.weight / muscles.model_mass) ** (2.0 / 3.0)
    strain, shift = within(strange, muscles.tendon_strain), within(strange, muscles.length_shift)
    extensors = [_muscle(rig, m, strange, size, force, strain, shift) for m in muscles.extensors]
    flexors = [_muscle(rig, m, strange, size, force, strain, shift) for m in muscles.flexors]
    wanted = within(strange, muscles.passive_at_rest)
    emg = rig.constants.emg
    gains = [emg.gain[m] for m in emg.muscles] + list(emg.leak_gain)
    return SeatedSubject(
        name=name,
        sex=stated.sex,
        age=stated.age,
        height=stated.height,
        weight=stated.weight,
        frequency=stated.frequency,
        moment=mass * centre,
        inertia=mass * (centre**2 + gyration**2),
        ahead=within(body, limb.ahead),
        viscous=within(body, limb.viscous),
        stiffness=within(body, rig.constants.shells.stiffness),
        rest=rest,
        hip=hip,
        extensors=tuple(_with_passive(extensors, wanted, hip, rest)),
        flexors=tuple(_changed(m, passive_scale=muscles.passive_flexors) for m in flexors),
        activation_time=within(nerves, muscles.activation_time),
        deactivation_time=within(nerves, muscles.deactivation_time),
        delay=within(nerves, muscles.delay),
        shape=within(nerves, muscles.shape),
        cocontraction=within(nerves, wearer.cocontraction),
        belief=float(wearer.belief * nerves.standard_normal()),
        maximal=within(nerves, wearer.maximal),
        emg_gain=tuple(float(g * np.exp(emg.gain_spread * nerves.standard_normal())) for g in gains),
    )


def subject_truth(s: SeatedSubject) -> dict[str, object]:
    """What is true of a subject, SI."""
    return {
        "moment": s.moment,
        "inertia": s.inertia,
        "rest": s.rest,
        "hip": s.hip,
        "delay": s.delay,
        "activation_time": s.activation_time,
        "deactivation_time": s.deactivation_time,
        "shape": s.shape,
        "muscles": {
            m.name: {
                "optimal_fibre_length": m.constants.optimal_fibre_length,
                "tendon_slack_length": m.constants.tendon_slack_length,
                "max_isometric_force": m.constants.max_isometric_force,
                "pennation": m.constants.pennation,
                "max_velocity": m.constants.max_velocity,
                "force_length_width": m.constants.force_length_width,
                "passive_scale": m.constants.passive_scale,
                "tendon_strain": m.tendon_strain,
                "moment_arm_factor": m.arm,
                "share": m.share,
            }
            for m in s.muscles
        },
    }


def _muscle(
    rig: SeatedMachine, name: str, rng: np.random.Generator, size: float, force: float, strain: float, shift: float
) -> VirtualMuscle:
    """A muscle with every constant off by a drawn share of either sign."""
    muscles, off = rig.constants.muscles, rig.constants.difference
    usual = muscle_table().constants[name]

    def error() -> float:
        return float(rng.choice([-1.0, 1.0]) * rng.uniform(off.low, off.high))

    fibre = size * usual.optimal_fibre_length
    constants = HillMuscle(
        name,
        optimal_fibre_length=fibre * (1.0 + error()),
        tendon_slack_length=size * usual.tendon_slack_length + fibre * error(),
        max_isometric_force=force * usual.max_isometric_force * (1.0 + error()),
        pennation=usual.pennation * (1.0 + error()),
        optimal_length_shift=shift,
        max_velocity=usual.max_velocity * (1.0 + error()),
        force_length_width=usual.force_length_width * (1.0 + error()),
        damping=muscles.fibre_damping,
        passive_strain=muscles.passive_strain,
    )
    return VirtualMuscle(constants, strain, muscles.sharing[name] * (1.0 + error()), size, 1.0 + error())


def _changed(muscle: VirtualMuscle, **values: float) -> VirtualMuscle:
    return replace(muscle, constants=replace(muscle.constants, **values))


def _with_passive(group: list[VirtualMuscle], wanted: float, hip: float, rest: float) -> list[VirtualMuscle]:
    """The extensors with the passive force that pulls `wanted` [N m] where the shank hangs."""

    def excess(scale: float) -> float:
        return torque_at_rest([_changed(m, passive_scale=scale) for m in group], 0.0, hip, rest) - wanted

    low, high = 1e-4, 1.0
    if excess(high) < 0.0:
        return [_changed(m, passive_scale=high) for m in group]
    scale = brentq(excess, low, high, xtol=1e-6) if excess(low) < 0.0 else low
    return [_changed(m, passive_scale=scale) for m in group]
