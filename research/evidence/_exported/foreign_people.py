"""Draws of foreign plants, instruments and wearers about what an export says of its robot."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pellucid.controllers.supervised import PROBE_ANSWER_NAMES
from pellucid.models.anthropometry import Segment, forearm

from .exports import ELBOW_DRIVE_LIMIT_NM, LEG_DRIVE_LIMIT_NM, PARTICIPANT_HEIGHT_M, PARTICIPANT_MASS_KG, ExportedLaw

INTERFACE_TEXT = (Path(__file__).parent / "foreign_wearer.hpp").read_text(encoding="utf-8")
"""Text of the header that names the numbers of a run and of its results."""


def _names(macro: str) -> tuple[str, ...]:
    body = re.search(rf"#define {macro}\(X\)(.*?)\n\n", INTERFACE_TEXT, re.S).group(1)
    return tuple(re.findall(r"X\((\w+)", body))


RUN_FIELDS: tuple[str, ...] = _names("FOREIGN_FIELDS")
"""Names of a run's numbers, in the program's order."""

RESULT_FIELDS: tuple[str, ...] = _names("FOREIGN_RESULTS")
"""Names of a result's numbers, in the program's order."""

ALARM_FIELDS: tuple[str, ...] = _names("FOREIGN_ALARMS")
"""Names of an alarm's numbers, in the program's order."""

FAULT_NAMES: tuple[str, ...] = _names("FOREIGN_FAULTS")
"""Names of the faults, in the program's order; the first is none."""

TRACE_FIELDS: tuple[str, ...] = _names("FOREIGN_TRACE")
"""Names of a traced period's numbers, in the program's order."""

PLANT_FACTORS = (0.7, 1.4)
"""Smallest and largest ratio of a foreign plant's inertia, friction and gravity to the identified card's [1]."""

CENTRE_ANGLE_RAD = 0.1
"""Largest angle between the true centre of mass and the card's."""

RIGID_SHARE = 0.3
"""Share of plants whose transmission is rigid [1]."""

ROTOR_SHARES = (0.1, 0.3)
"""Share of the inertia in front of a flexible transmission: the elbow's rotor has a sixth [1]."""

RESONANCES_HZ = (25.0, 70.0)
"""Lowest and highest resonance of a flexible transmission: on this elbow cables of 75 to 2800 N m/rad."""

BACKLASH_RAD = 0.002
"""Largest backlash of a flexible transmission."""

STATIC_RATIOS = (1.0, 1.4)
"""Friction at rest over sliding friction [1]; catalogues of screws and harmonic drives have up to 1.5."""

STRIBECK_SPEEDS = (0.03, 0.2)
"""Speeds at which the rise of friction towards rest has halved [rad/s]."""

BRISTLE_TRAVELS_RAD = (3e-4, 3e-3)
"""Ways over which friction builds up: gears lose 1 to 10 minutes of arc."""

MAX_BRISTLE_RATE = 1200.0
"""Largest natural frequency of the robot on its bristles that the integration bears [rad/s]."""

DRIVE_LAGS_S = (0.3e-3, 1.5e-3)
"""Time constants of a current loop: bandwidths of 100 to 500 Hz."""

RIPPLE_SHARE = 0.004
"""Largest amplitude of the torque ripple over the robot's torque scale [1]: cogging of 0.7 mN m at a ratio of 28."""

GAIN_ERROR = 0.05
"""Largest relative error of the gain of a force sensor, of a drive's measurement and of EMG [1]."""

OFFSET_SHARE = 0.01
"""Largest offset of these measurements over the effort limit [1]."""

SENSOR_LAGS_S = (0.3e-3, 2.0e-3)
"""Shortest and longest lag of these measurements."""

FORCE_NOISE_SHARE = 0.003
"""Standard deviation of the force sensor's noise over the effort limit [1]: 0.03 N m of 10, as the elbow's rig has."""

CURRENT_NOISE_SHARE = 0.01
"""Standard deviation of the noise of a drive's measurement over the effort limit [1], as `lab.drive_reading` has it."""

QUANTUM_SHARE = 0.002
"""Quantum of these measurements over the effort limit [1]: ten bits."""

ENCODER_QUANTA_RAD = (3e-5, 1.6e-4)
"""Smallest and largest quantum of the encoder: half to three times the elbow's."""

ENCODER_NOISE_RAD = 5e-5
"""Largest standard deviation of the encoder's noise. With the quantum it stays within the 0.4 mrad that are assumed."""

EMG_LAGS_S = (0.03, 0.06)
"""Time constants of the envelope of EMG: low-pass filters of 3 to 5 Hz."""

EMG_NOISE = 0.5
"""Standard deviation of EMG's multiplicative noise before its envelope [1], some 6 % behind it."""

CUFF_STIFFNESSES = (60.0, 250.0)
"""Stiffness of both cuffs together [N m/rad]: 1 to 4 kN/m of padded skin at 0.24 m."""

CUFF_SLACK_RAD = 0.008
"""Largest slack of a cuff: two millimetres of play at 0.24 m."""

CUFF_HARDENINGS_RAD = (0.05, 0.12)
"""Deflections at which a cuff's stiffness has doubled: 12 to 29 mm at 0.24 m."""

SERVO_STIFFNESSES = (6.0, 120.0)
"""Stiffness of a wearer's arm [N m/rad], from a relaxed one to one that co-contracts with all its force."""

TREMOR_NM = 0.6
"""Largest amplitude of the tremor."""

TREMOR_HZ = (4.0, 10.0)
"""Lowest and highest frequency of the tremor."""

LIMB_ERROR = 0.15
"""Largest relative error of a limb that a law knows by mass and height [1]."""

MEAN_BRACE_INTERVAL_S = 11.0
"""Mean time between sudden stops, as the lab's worn robots have it."""

MEAN_IMPACT_INTERVAL_S = 40.0
"""Mean time between two times at which the moving arm hits something hard."""

MEAN_LOAD_INTERVAL_S = 40.0
"""Mean time between loads that are picked up."""

LOAD_MASSES_KG = (0.3, 2.0)
"""Smallest and largest load: a cup, and two bottles."""

LOAD_LEVER_M = 0.3
"""Distance of a load in the hand from the elbow."""

MEAN_SPASM_INTERVAL_S = 120.0
"""Mean time between spasms of a wearer who has them; half of all wearers have none."""

SPASM_TORQUES_NM = (4.0, 15.0)
"""Largest torque of a wearer's spasms; each has 0.3 to 1 of it."""

MEAN_DOFF_INTERVAL_S = 240.0
"""Mean time between two times at which the robot is taken off and put on again while its law runs."""

TARGET_MARGIN_RAD = 0.2
"""Distance of the targets from the position limits."""

UNBOUNDED_RANGE_RAD = 1.0
"""Half of the range of targets for a machine without position limits."""

WORN_SPEED_SHARE = 0.55
"""Largest planned speed of a reach over the velocity limit [1]."""

WORN_SPEED_RAD_S = 4.4
"""Largest planned speed of a reach in any robot, as fast as people point."""

GUIDED_SPEED_RAD_S = 2.5
"""Largest planned speed of a machine that a hand guides; at most 0.3 of its velocity limit."""

DURATIONS_S = (0.45, 1.4)
"""Shortest and longest planned duration of a reach, as the lab's worn robots have them."""

GUIDED_DURATIONS_S = (0.9, 2.5)
"""The same for a machine that a hand guides."""

LEG_STRENGTH = 4.5
"""Strength of a hip, its straps and what hits its leg, relative to an elbow's [1]: muscles of 180 to 270 N m."""

LEG_STIFFNESSES = (60.0, 540.0)
"""Stiffness of a wearer's hip [N m/rad], from a relaxed one to one that co-contracts with all its force."""

LEG_DURATIONS_S = (0.7, 2.0)
"""Shortest and longest planned duration of a leg's movement: walking swings the hip by 0.7 rad in 0.4 to 0.6 s."""

LEG_MASS_SHARE, LEG_LENGTH_SHARE, LEG_CENTRE, LEG_GYRATION = 0.161, 0.53, 0.447, 0.56
"""Mass of a whole leg over the body's, its length over the height, and its centre of mass and radius of gyration from
the hip over its length [1]. D. A. Winter, "Biomechanics and Motor Control of Human Movement", 4th ed., table 4.1."""

LEG_QUANTA_RAD = (1e-4, 3.84e-4)
"""Smallest and largest quantum of a leg's encoder: 16 to 14 bits a turn."""

SPRING_GAINS = (0.6, 1.0)
"""Proportional gains of the torque loop about a spring [1]; the knee orthosis has 0.8."""

SPRING_STIFFNESS = 170.0
"""Stiffness of the knee orthosis's spring, as its actuator's card has it [N m/rad]."""

SPRING_FIELDS = tuple(name for name in RUN_FIELDS if name.startswith("spring_"))
"""Numbers of a run that describe a drive behind a spring."""

PRISMATIC_SCALE_S = 1.0 / 6.0
"""Length that stands for a radian where a machine slides, over its velocity limit [s]."""

STEP_RATE_HZ = 6000.0
"""Smallest rate of the integration."""


def draw_run(law: ExportedLaw, index: int, seed: int) -> dict[str, float]:
    """Draw a plant, its instruments and its wearer: equal for all laws of a robot, but for scales of limits.

    Returns every number of a run by name, without mishaps and without a fault.
    """
    rng = np.random.default_rng([seed, index])
    known, numbers = law.identified, law.numbers

    def between(bounds: tuple[float, float]) -> float:
        return float(rng.uniform(*bounds))

    def spread(largest: float) -> float:
        return float(rng.uniform(-largest, largest))

    effort, speed, period = numbers["effort_limit"], numbers["velocity_limit"], numbers["period"]
    length = PRISMATIC_SCALE_S * speed if law.motion == "prismatic" else 1.0
    elbow, leg = law.limb == "forearm", law.limb == "leg"
    strength, drive_strength = (LEG_STRENGTH, LEG_DRIVE_LIMIT_NM / ELBOW_DRIVE_LIMIT_NM) if leg else (1.0, 1.0)
    torque_scale = 10.0 if elbow else effort
    # A knee's law names its orthosis otherwise.
    inertia = known.get("inertia", known.get("orthosis_inertia", 0.0)) * between(PLANT_FACTORS)
    turned, heavier = spread(CENTRE_ANGLE_RAD), between(PLANT_FACTORS)
    sine = known.get("gravity_sine", known.get("orthosis_gravity", 0.0))
    cosine = known.get("gravity_cosine", 0.0)
    gravity = (heavier * (sine * np.cos(turned) - cosine * np.sin(turned)),
               heavier * (sine * np.sin(turned) + cosine * np.cos(turned)))  # fmt: skip
    dry, rough = between(PLANT_FACTORS), between(PLANT_FACTORS)
    positive = dry * (1.0 + spread(0.15)) * max(known.get("coulomb_positive", known.get("coulomb", 0.0)), 0.0)
    negative = dry * (1.0 + spread(0.15)) * max(known.get("coulomb_negative", known.get("coulomb", 0.0)), 0.0)
    load = dry * 0.5 * (known.get("load_motoring", 0.0) + known.get("load_generating", 0.0))
    viscous = rough * max(known.get("viscous_positive", known.get("orthosis_viscous", 0.0)), 0.0)
    rotor = 0.0 if rng.random() < RIGID_SHARE or law.spring else between(ROTOR_SHARES)
    resonance = 2.0 * np.pi * between(RESONANCES_HZ)
    reduced = inertia * rotor * (1.0 - rotor)
    travel = length * float(np.exp(rng.uniform(*np.log(BRISTLE_TRAVELS_RAD))))
    moving = rotor * inertia if rotor > 0.0 else inertia
    level = 0.5 * (positive + negative) + load * float(np.hypot(*gravity))
    low, high = numbers["position_min"], numbers["position_max"]
    bounded = bool(np.isfinite(low) and np.isfinite(high))
    targets = (low + TARGET_MARGIN_RAD, high - TARGET_MARGIN_RAD) if bounded else (-length, length)
    durations = LEG_DURATIONS_S if leg else DURATIONS_S if law.worn else GUIDED_DURATIONS_S
    mass, height = between((50.0, 95.0)), between((1.55, 1.92))
    if "muscle" in law.uses and elbow:
        mass, height = PARTICIPANT_MASS_KG, PARTICIPANT_HEIGHT_M
    body = whole_leg(mass, height) if leg else forearm(mass, height)
    limb_inertia, limb_gravity = body.inertia * (1.0 + spread(LIMB_ERROR)), body.gravity() * (1.0 + spread(LIMB_ERROR))
    if law.spring:
        limb_inertia = known["limb_inertia"] * (1.0 + spread(LIMB_ERROR))
        limb_gravity = known["limb_gravity"] * (1.0 + spread(LIMB_ERROR))
    cuffs = known["strap_stiffness"] * between(PLANT_FACTORS) if law.spring else strength * between(CUFF_STIFFNESSES)
    upper = between((0.3, 0.7))
    stiffness = float(np.exp(rng.uniform(*np.log(LEG_STIFFNESSES if leg else SERVO_STIFFNESSES))))
    damping = max(2.0 * between((0.3, 0.8)) * np.sqrt(stiffness * (limb_inertia + inertia)), 0.4 * strength)
    stop_stiffness = inertia * (2.0 * np.pi * 20.0) ** 2
    hand = max(inertia * (2.0 * np.pi * 2.5) ** 2, 3.0 * float(np.hypot(*gravity)) / length, 5.0 * level / length)
    seconds_of_step = period / np.ceil(period * STEP_RATE_HZ)
    made = {
        "period": period,
        "substeps": round(period / seconds_of_step),
        "effort_limit": effort,
        "velocity_limit": speed,
        "range_low": finite(numbers["range_min"]),
        "range_high": finite(numbers["range_max"]),
        "wearer_push": finite(numbers["wearer_push"]),
        "wearer_torque": finite(numbers["wearer_torque"]),
        "inertia": inertia,
        "rotor_share": rotor,
        "transmission_stiffness": reduced * resonance**2,
        "transmission_damping": 2.0 * between((0.05, 0.2)) * reduced * resonance,
        "backlash": length * between((0.0, BACKLASH_RAD)),
        "gravity_sine": gravity[0],
        "gravity_cosine": gravity[1],
        "offset": known.get("offset", 0.0),
        "friction_positive": positive,
        "friction_negative": negative,
        "static_ratio": between(STATIC_RATIOS),
        "stribeck_velocity": length * between(STRIBECK_SPEEDS),
        "bristle_stiffness": min(level / travel, moving * MAX_BRISTLE_RATE**2),
        "bristle_damping": between((0.2, 0.7)),
        "load_friction": load,
        "viscous": viscous,
        "thinning_velocity": length * between((5.0, 30.0)),
        "stop_low": low - 0.1 if bounded else -1e6,
        "stop_high": high + 0.1 if bounded else 1e6,
        "stop_stiffness": stop_stiffness,
        "stop_damping": 1.2 * np.sqrt(stop_stiffness * inertia),
        "drive_lag": between(DRIVE_LAGS_S),
        "dead_cycles": float(rng.integers(0, 2)),
        "drive_limit": drive_strength * ELBOW_DRIVE_LIMIT_NM if elbow or leg else (4.0 if law.spring else 1.5) * effort,
        "ripple": RIPPLE_SHARE * torque_scale * between((0.0, 1.0)),
        "ripple_waves": 28.0 / length,
        **(spring_drive(known, rng) if law.spring else dict.fromkeys(SPRING_FIELDS, 0.0)),
        "encoder_quantum": length * between(LEG_QUANTA_RAD if leg else ENCODER_QUANTA_RAD),
        "encoder_noise": length * between((0.0, ENCODER_NOISE_RAD)),
        **sensor_errors("force", rng, effort, FORCE_NOISE_SHARE),
        **sensor_errors("current", rng, effort, CURRENT_NOISE_SHARE),
        "emg_flexor_gain": 1.0 + spread(GAIN_ERROR),
        "emg_extensor_gain": 1.0 + spread(GAIN_ERROR),
        "emg_offset": spread(OFFSET_SHARE) * effort,
        "emg_lag": between(EMG_LAGS_S),
        "emg_noise": EMG_NOISE,
        "emg_quantum": QUANTUM_SHARE * effort,
        "strength": strength,
        "drive_strength": drive_strength,
        "worn": float(law.worn),
        "upper_cuff_stiffness": upper * cuffs,
        "upper_cuff_slack": between((0.0, CUFF_SLACK_RAD)),
        "upper_cuff_offset": spread(0.5 * CUFF_SLACK_RAD),
        "lower_cuff_stiffness": (1.0 - upper) * cuffs,
        "lower_cuff_slack": between((0.0, CUFF_SLACK_RAD)),
        "lower_cuff_offset": spread(0.5 * CUFF_SLACK_RAD),
        "cuff_hardening": between(CUFF_HARDENINGS_RAD),
        "cuff_damping": between((0.005, 0.02)),
        "limb_inertia": limb_inertia,
        "limb_gravity": limb_gravity,
        "limb_damping": strength * between((0.05, 0.2)),
        "servo_stiffness": stiffness,
        "servo_damping": damping,
        "reflex_stiffness": min(0.2 * stiffness, 3.0 * strength) * between((0.0, 1.0)),
        "reflex_damping": strength * between((0.0, 0.15)),
        "reflex_delay": between((0.03, 0.06)),
        "activation_lag": between((0.03, 0.05)),
        "learning_time": between((1.0, 4.0)),
        "anticipation": between((0.85, 1.1)),
        "muscle_limit": strength * between((40.0, 60.0)),
        "tremor_amplitude": strength * between((0.0, TREMOR_NM)) if law.worn else 0.0,
        "tremor_frequency": between(TREMOR_HZ),
        "target_low": targets[0],
        "target_high": targets[1],
        "fastest_duration": durations[0],
        "slowest_duration": durations[1],
        "longest_pause": 1.2,
        "speed_share": min(WORN_SPEED_SHARE, WORN_SPEED_RAD_S / speed)
        if law.worn
        else min(0.3, GUIDED_SPEED_RAD_S * length / speed),
        "brace_interval": 0.0,
        "impact_interval": 0.0,
        "load_interval": 0.0,
        "load_mass": between(LOAD_MASSES_KG),
        "load_lever": LEG_LENGTH_SHARE * height if leg else LOAD_LEVER_M,
        "spasm_interval": 0.0,
        "spasm_torque": strength * between(SPASM_TORQUES_NM),
        "doff_interval": 0.0,
        "hand_stiffness": hand,
        "hand_damping": 1.4 * np.sqrt(hand * inertia),
        "start_position": between(targets),
        "seconds": 10.0,
        "seed": float(1000 * (seed % 1_000_000) + index),
        "kind": 0.0,
        "onset": 0.0,
        "fault_seed": 0.0,
        "amplitude": 0.0,
        "test_least": 0.0,
        "test_most": 0.0,
        "probe_travel": 0.0,
        "probe_scale": 0.0,
        "reaching": float(law.stops_oscillation),
        "clock_jitter": 0.0,
        "clock_start": 0.0,
        "clock_bits": 0.0,
        "probe_answer_error": 0.0,
        **dict.fromkeys(PROBE_ANSWER_NAMES, 0.0),
        "traced": 0.0,
        "passive": 0.0,
    }
    if set(made) != set(RUN_FIELDS):
        raise AssertionError(f"a run: found {sorted(set(made) ^ set(RUN_FIELDS))} in one of both lists alone")
    return made


def whole_leg(mass: float, height: float) -> Segment:
    """Return a straight leg about the hip of a person with a `mass` [kg] and a `height` [m]."""
    length = LEG_LENGTH_SHARE * height
    own = LEG_MASS_SHARE * mass
    return Segment(own, LEG_CENTRE * length, own * (LEG_GYRATION * length) ** 2)


def spring_drive(known: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Draw a drive that acts through a spring, about the impedance that its torque loop is `known` to leave."""
    gain = float(rng.uniform(*SPRING_GAINS))
    stiffness = SPRING_STIFFNESS * float(rng.uniform(*PLANT_FACTORS))
    inertia = known["actuator_inertia"] * float(rng.uniform(*PLANT_FACTORS)) * (1.0 + gain)
    damping = float(rng.uniform(0.15, 0.3))
    return {
        "spring_stiffness": stiffness,
        "spring_inertia": inertia,
        "spring_friction": known["actuator_coulomb"] * float(rng.uniform(*PLANT_FACTORS)) * (1.0 + gain),
        "spring_viscous": known["actuator_viscous"] * float(rng.uniform(*PLANT_FACTORS)) * (1.0 + gain),
        "spring_gain": gain,
        "spring_integral": known["actuator_leak"] * (1.0 + gain),
        "spring_rate_gain": 2.0 * damping * float(np.sqrt((1.0 + gain) * inertia / stiffness)),
    }


def finite(value: float) -> float:
    """Return a number, and a large one for none."""
    return float(np.clip(value, -1e9, 1e9))


def sensor_errors(name: str, rng: np.random.Generator, limit: float, noise: float) -> Mapping[str, float]:
    """Draw the errors of a sensor of effort; `noise` is a share of the `limit` [N m]."""
    return {
        f"{name}_gain": 1.0 + float(rng.uniform(-GAIN_ERROR, GAIN_ERROR)),
        f"{name}_offset": limit * float(rng.uniform(-OFFSET_SHARE, OFFSET_SHARE)),
        f"{name}_lag": float(rng.uniform(*SENSOR_LAGS_S)),
        f"{name}_noise": limit * noise,
        f"{name}_quantum": limit * QUANTUM_SHARE,
    }


def with_mishaps(run: Mapping[str, float], seed: int, index: int) -> dict[str, float]:
    """Return a run whose wearer stops suddenly, hits things, picks up loads, has spasms, and takes the robot off."""
    spastic = np.random.default_rng([seed, index, 7]).random() < 0.5
    return {
        **run,
        "brace_interval": MEAN_BRACE_INTERVAL_S,
        "impact_interval": MEAN_IMPACT_INTERVAL_S,
        "load_interval": MEAN_LOAD_INTERVAL_S,
        "spasm_interval": MEAN_SPASM_INTERVAL_S if spastic else 0.0,
        "doff_interval": MEAN_DOFF_INTERVAL_S,
    }
