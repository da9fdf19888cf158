"""Straps between a limb and an orthosis, simulated without Pellucid.

A limb is moved by its wearer, and a strap pulls an orthosis along. Both bodies are integrated by the midpoint rule at
4 kHz. Six kinds of strap have equations of their own:

- plain: a spring and a damper;
- hardening: a spring whose force is a hyperbolic sine of the stretch;
- slack: two cuffs with a gap between them, which only push;
- maxwell: parallel to the spring, a spring in series with a dashpot;
- friction: parallel to the spring, rubbing cloth, as a Dahl bristle [1]_;
- tissue: in series with the spring, a compressed layer, which stiffens as it becomes thinner.

Encoders, the torque sensor and an IMU on a swaying thigh have noise. The orthosis's constants are handed over with
drawn errors. Pellucid's strap (``strap.hpp``), rigs and filters take no part. Where its models are nearest to these
equations: a spring and a damper are the same in both, a standard linear solid too; friction there is an elastic-plastic
element of a fitted way and here a bristle of Dahl, tissue there a logarithm and here a hyperbola.

.. [1] P. R. Dahl, "A solid friction model", Aerospace Corporation TOR-0158(3107-18)-1, 1968.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellucid.orthosis.strap.strap_model import Orthosis, StrappedSwing

FEATURES_BY_KIND = {
    "plain": (),
    "hardening": ("hardening",),
    "slack": ("slack",),
    "maxwell": ("relaxing",),
    "friction": ("friction",),
    "tissue": ("tissue",),
}
"""Features that each kind of strap has, by the names of the models."""

STEP_S = 2.5e-4
"""Step of the integrator [s]."""

RECORDING_STEPS = 8
"""Steps of the integrator between two samples of the controller: 500 Hz."""

TRIAL_S = 40.0
"""Duration of a trial [s]."""

IMU_PERIOD_S = 0.02
"""Time between two samples of the IMU [s]."""

ORTHOSIS_INERTIA = 0.075
"""Inertia of the orthosis [kg*m^2]."""

ORTHOSIS_VISCOUS = 0.02
"""Viscous friction of the orthosis [N*m*s/rad]."""

ORTHOSIS_GRAVITY = 1.56
"""Gravity torque of the orthosis at 90 degrees [N*m]."""

ORTHOSIS_COULOMB = 0.03
"""Dry friction of the orthosis [N*m]."""

CONSTANT_ERRORS = (0.01, 0.1, 0.005, 0.1)
"""Relative standard errors with which the orthosis's constants are handed over."""

LIMB_INERTIA = 0.35
"""Inertia of the limb [kg*m^2]."""

LIMB_STIFFNESS = 90.0
"""Stiffness with which the wearer moves the limb [N*m/rad]."""

LIMB_DAMPING = 5.0
"""Damping with which the wearer moves the limb [N*m*s/rad]."""

HELD_ANGLES_RAD = (0.5, 1.0)
"""Angles of the trials in which torques are held [rad]."""

HELD_TORQUES = (1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0)
"""Torques that are held one after the other [N*m]."""

BRISTLE_RAD = 3e-3
"""Way over which friction builds up [rad]."""


@dataclass(frozen=True)
class ForeignStrap:
    """A drawn strap: its kind and the constants of that kind."""

    kind: str
    stiffness: float
    damping: float
    hardening: float = 0.0  # stretch at which the sine's argument is 1 [rad]
    gap: float = 0.0  # [rad]
    branch: float = 0.0  # stiffness of the Maxwell branch [N*m/rad]
    relaxation: float = 1.0  # its time constant [s]
    friction: float = 0.0  # level [N*m]
    thickness: float = 0.0  # of the layer [rad]; 0: none
    firmness: float = 1.0  # torque under which half of the layer is left [N*m]


def drawn_strap(kind: str, rng: np.random.Generator) -> ForeignStrap:
    """Return a strap of a kind, with constants drawn over the sizes of cuffs and soft tissue."""
    stiffness = float(rng.uniform(13.0, 30.0))
    made: dict[str, float] = {"stiffness": stiffness, "damping": stiffness * float(rng.uniform(0.015, 0.045))}
    if kind == "hardening":
        made["hardening"] = float(rng.uniform(0.06, 0.12))
    if kind == "slack":
        made["gap"] = float(rng.uniform(0.02, 0.06))
    if kind == "maxwell":
        made |= {"branch": stiffness * float(rng.uniform(0.25, 0.6)), "relaxation": float(rng.uniform(0.5, 3.0))}
    if kind == "friction":
        made["friction"] = float(rng.uniform(0.2, 0.5))
    if kind == "tissue":
        made["thickness"] = float(rng.uniform(0.06, 0.12))
        made["firmness"] = stiffness * made["thickness"] * float(rng.uniform(0.3, 0.8))
    return ForeignStrap(kind, **made)


@dataclass(frozen=True)
class WornOrthosis:
    """Trials of one wearer: swings, trials in which torques are held, and the orthosis as it is known."""

    strap: ForeignStrap
    swings: tuple[StrappedSwing, ...]
    steps: tuple[StrappedSwing, ...]
    orthosis: Orthosis


def record_straps(straps: list[ForeignStrap], rng: np.random.Generator) -> list[WornOrthosis]:
    """Return two swings and two trials with held torques of each strap; all are integrated side by side."""
    count = len(straps)
    wide = {
        name: np.repeat([getattr(s, name) for s in straps], 4)
        for name in ForeignStrap.__annotations__
        if name != "kind"
    }
    swings = np.tile([True, True, False, False], count)
    held_at = np.tile([0.0, 0.0, *HELD_ANGLES_RAD], count)
    frequency = rng.uniform(0.6, 1.1, 4 * count)
    size, phase = rng.uniform(0.35, 0.6, 4 * count), rng.uniform(0.0, 2.0 * np.pi, (3, 4 * count))
    hand = rng.uniform(0.2, 0.5, 4 * count)  # damping that the drive leaves [N*m*s/rad]
    hold_s = TRIAL_S / len(HELD_TORQUES)

    def wanted(t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the limb's wanted angle and speed."""
        turn = 2.0 * np.pi * frequency
        angle = turn * t + 1.5 * np.sin(0.5 * t + phase[1]) + phase[0]
        grow, growth = 1.0 + 0.3 * np.sin(0.31 * t + phase[2]), 0.093 * np.cos(0.31 * t + phase[2])
        q = 0.5 + size * grow * np.sin(angle)
        v = size * (growth * np.sin(angle) + grow * np.cos(angle) * (turn + 0.75 * np.cos(0.5 * t + phase[1])))
        return np.where(swings, q, held_at), np.where(swings, v, 0.0)

    def drive(t: float, speed: np.ndarray) -> np.ndarray:
        """Return the torque of the drive."""
        place = min(int(t / hold_s), len(HELD_TORQUES) - 1)
        before = HELD_TORQUES[place - 1] if place else 0.0
        rise = min((t - place * hold_s) / 0.3, 1.0)
        step = before + (HELD_TORQUES[place] - before) * 0.5 * (1.0 - np.cos(np.pi * rise))
        return np.where(swings, -hand * speed, step - 0.3 * speed + ORTHOSIS_GRAVITY * np.sin(held_at))

    tissue, has_gap, hardens = wide["thickness"] > 0.0, wide["gap"] > 0.0, wide["hardening"] > 0.0
    width = np.where(hardens, wide["hardening"], 1.0)
    k, d = wide["stiffness"], wide["damping"]
    thick, firm = np.where(tissue, wide["thickness"], 1.0), wide["firmness"]

    def slope(x: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        q, v, limb, speed, flow, bend, squeezed = x
        e, rate = limb - q, speed - v
        spring = k * np.where(hardens, width * np.sinh(e / width), e) + d * rate
        past = e - np.clip(e, -0.5 * wide["gap"], 0.5 * wide["gap"])
        cuff = k * past + d * rate
        spring = np.where(has_gap, np.where(past * cuff > 0.0, cuff, 0.0), spring)
        layer = firm * squeezed / np.maximum(thick - np.abs(squeezed), 1e-3 * thick)
        squeezing = np.where(tissue, (k * (e - squeezed) + d * rate - layer) / (1.1 * d), 0.0)
        pull = np.where(tissue, layer + 0.1 * d * squeezing, spring)
        pull = pull + wide["branch"] * (e - flow) + wide["friction"] * bend / BRISTLE_RAD
        torque = drive(t, v)
        rub = ORTHOSIS_COULOMB * np.tanh(v / 0.02)
        want, pace = wanted(t)
        push = LIMB_STIFFNESS * (want - limb) + LIMB_DAMPING * (pace - speed)
        return np.array([
            v, (pull + torque - ORTHOSIS_VISCOUS * v - ORTHOSIS_GRAVITY * np.sin(q) - rub) / ORTHOSIS_INERTIA,
            speed, (push - pull) / LIMB_INERTIA,
            (e - flow) / wide["relaxation"], rate - np.abs(rate) * bend / BRISTLE_RAD, squeezing,
        ]), torque  # fmt: skip

    n = round(TRIAL_S / STEP_S)
    x = np.zeros((7, 4 * count))
    x[2] = x[0] = wanted(0.0)[0]
    rows = np.empty((n // RECORDING_STEPS, 3, 4 * count))
    for i in range(n):
        t = i * STEP_S
        first, torque = slope(x, t)
        if i % RECORDING_STEPS == 0:
            rows[i // RECORDING_STEPS] = x[0], torque, x[2]
        x = x + STEP_S * slope(x + 0.5 * STEP_S * first, t + 0.5 * STEP_S)[0]
    return [_worn(straps[i], rows[:, :, 4 * i : 4 * i + 4], rng) for i in range(count)]


def _worn(strap: ForeignStrap, rows: np.ndarray, rng: np.random.Generator) -> WornOrthosis:
    time = np.arange(len(rows)) * STEP_S * RECORDING_STEPS
    trials = []
    for i in range(4):
        position = np.round(rows[:, 0, i] / 9.6e-5) * 9.6e-5
        torque = rows[:, 1, i] + 0.01 * rng.standard_normal(len(time))
        imu = np.arange(0.01 * rng.random(), time[-1], IMU_PERIOD_S)
        limb = np.interp(imu, time, rows[:, 2, i])
        trials.append((f"trial_{i}", position, torque, imu, limb + _imu_error(imu, rng)))
    errors = np.array(CONSTANT_ERRORS) * [ORTHOSIS_INERTIA, ORTHOSIS_VISCOUS, ORTHOSIS_GRAVITY, ORTHOSIS_COULOMB]
    said = np.array(
        [ORTHOSIS_INERTIA, ORTHOSIS_VISCOUS, ORTHOSIS_GRAVITY, ORTHOSIS_COULOMB]
    ) + errors * rng.standard_normal(4)
    late = rng.uniform(-0.2, 0.2)
    made = [
        StrappedSwing(name, "fitted", time, position, torque, imu - late, seen)
        for name, position, torque, imu, seen in trials
    ]
    orthosis = Orthosis(*(float(v) for v in said), covariance=np.diag(errors**2))
    return WornOrthosis(strap, tuple(made[:2]), tuple(made[2:]), orthosis)


def _imu_error(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return mounting, gain of the filter as noise that lasts 0.1 s, and a swaying thigh [rad]."""
    keep = np.exp(-IMU_PERIOD_S / 0.1)
    noise, now = np.empty(len(time)), rng.standard_normal()
    for i, push in enumerate(rng.standard_normal(len(time))):
        noise[i] = now
        now = keep * now + np.sqrt(1.0 - keep**2) * push
    sway = sum(
        rng.normal(0.0, 0.006) * np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 6.28)) for f in (0.03, 0.08, 0.15)
    )
    return 0.3 * rng.standard_normal() + 0.004 * noise + sway
