"""Further wearers of the virtual orthosis, drawn at random: somebody to choose a controller on, others to score it on.

Each is a body, a strap, muscles, electrodes and habits of their own, in an orthosis whose friction is its own as well.
The rig's three subjects lie within these ranges.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pellucid.models.anthropometry import shank_length, winter

from .rig import KneeRig
from .subject import EXTENSOR_MUSCLE, FLEXOR_MUSCLE

BODY_RANGES: Mapping[str, tuple[float, float]] = {
    "age": (20.0, 60.0),
    "mass_index": (18.5, 25.0),  # kg/m^2
    "shank_share": (0.255, 0.310),  # length from knee to heel over the height
    "ahead": (0.035, 0.060),  # rad
    "friction": (0.10, 0.26),  # viscous friction of the knee [N*m*s/rad]
}
"""Smallest and largest value of each number of a sampled body; values are uniform between them.

Heights are normal: 1.64 m with a standard deviation of 0.05 m for women, 1.77 m with 0.06 m for men."""

LIMB_RELATIVE_SD: Mapping[str, float] = {"mass": 0.05, "centre": 0.04, "gyration": 0.05}
"""Standard deviation of a limb's numbers over those of Winter's tables [1], as among the rig's own subjects."""

FITTED_RANGES: Mapping[str, tuple[float, float]] = {
    "stiffness": (12.0, 28.0),  # N*m/rad
    "damping": (0.024, 0.036),  # s: of the stiffness
    "extensor": (1.9, 2.9),  # N*m per kg of weight
    "flexor": (0.95, 1.40),
    "emg_gain": (2.2e-4, 5.6e-4),  # V RMS at full excitation
}
"""Smallest and largest value of a drawn strap, of strength and of EMG gains; values are log-uniform between them."""

FACTOR_RANGES: Mapping[str, tuple[float, float]] = {
    "actuator.coulomb_positive": (0.8, 1.25),
    "actuator.coulomb_negative": (0.8, 1.25),
    "actuator.viscous_positive": (0.8, 1.25),
    "actuator.viscous_negative": (0.8, 1.25),
    "actuator.stribeck": (0.7, 1.4),
    "orthosis.bearing_coulomb": (0.5, 2.0),
    "orthosis.bearing_viscous": (0.5, 2.0),
    "emg.crosstalk": (0.3, 2.0),
    "emg.hum": (0.3, 3.0),
    "emg.artefact": (0.3, 3.0),
    "muscles.delay": (0.67, 1.33),
    "muscles.slowing": (0.5, 1.5),
    "muscles.angle_slope": (0.5, 1.5),
    "wearer.cocontraction": (0.6, 1.5),
    "wearer.stiffness": (0.7, 1.3),
    "wearer.damping": (0.7, 1.3),
    "wearer.resistance": (0.6, 1.3),
}
"""Smallest and largest factor on the rig's own constants; factors are log-uniform between them."""

STRAP_EFFECT_RANGES: Mapping[str, tuple[float, float]] = {
    "hardening": (0.08, 0.25),  # rad: 17 to 52 mm at the cuff
    "slack": (0.01, 0.05),  # rad: 2 to 10 mm
    "relaxing_stiffness": (0.15, 0.60),  # share of the stiffness
    "relaxation_time": (0.5, 5.0),  # s
    "hold": (3.0, 8.0),  # N*m
    "mobility": (5e-5, 5e-4),  # rad/(N*m*s)
}
"""Smallest and largest value of what a strap has beyond a spring and a damper; values are log-uniform between them."""


def drawn_strap(rig: KneeRig, stiffness: float, seed: int) -> dict[str, float]:
    """What sets a strap of a `stiffness` [N*m/rad] apart from a spring and a damper, drawn of what `rig` has: without
    slack, say, if its straps are `strapped` without."""
    rng, usual = np.random.default_rng([seed, 0x5]), rig.constants.strap
    drawn = {name: float(np.exp(rng.uniform(*np.log(ends)))) for name, ends in STRAP_EFFECT_RANGES.items()}
    drawn["relaxing_stiffness"] *= stiffness
    across, along = usual.askew_spread * np.clip(rng.standard_normal(2), -2.0, 2.0)
    has = {name: value for name, value in drawn.items() if usual[name]}
    return {**has, "across": float(across), "along": float(along)}


def drawn_rig(rig: KneeRig, seed: int) -> KneeRig:
    """The orthosis with another friction, and ``D<seed>`` its single wearer, drawn; the rest as in `rig`."""
    rng = np.random.default_rng([seed, 0xD])
    body = {name: float(rng.uniform(*ends)) for name, ends in BODY_RANGES.items()}
    fitted = {
        name: float(np.exp(rng.uniform(*np.log(ends)))) for name, ends in FITTED_RANGES.items() if name != "emg_gain"
    }
    gains = np.exp(rng.uniform(*np.log(FITTED_RANGES["emg_gain"]), 2)).tolist()
    factors = {path: float(np.exp(rng.uniform(*np.log(ends)))) for path, ends in FACTOR_RANGES.items()}
    off = {name: 1.0 + sd * float(rng.standard_normal()) for name, sd in LIMB_RELATIVE_SD.items()}
    sex = "female" if rng.random() < 0.5 else "male"
    height = float(rng.normal(1.64, 0.05) if sex == "female" else rng.normal(1.77, 0.06))
    weight = body["mass_index"] * height**2
    measured = body["shank_share"] * height
    # As the rig's own: half-way between the measured length and the tables'.
    shares = winter(weight, 0.5 * (measured + shank_length(height)))
    subject = {
        "sex": sex,
        "age": int(body["age"]),
        "weight": weight,
        "height": height,
        "shank_length": measured,
        "limb": {
            "mass": shares.mass * off["mass"],
            "centre": shares.centre * off["centre"],
            "gyration": float(np.sqrt(shares.inertia / shares.mass - shares.centre**2)) * off["gyration"],
            "ahead": body["ahead"],
            "viscous": body["friction"],
        },
        "strap": {
            "stiffness": fitted["stiffness"],
            "damping": fitted["damping"] * fitted["stiffness"],
            **drawn_strap(rig, fitted["stiffness"], seed),
        },
        "strength": {EXTENSOR_MUSCLE: fitted["extensor"] * weight, FLEXOR_MUSCLE: fitted["flexor"] * weight},
        "emg_gain": dict(zip((EXTENSOR_MUSCLE, FLEXOR_MUSCLE), gains, strict=True)),
    }
    values: dict[str, object] = {path: factor * _constant(rig, path) for path, factor in factors.items()}
    muscles = rig.constants.muscles
    # People plan as early as their own muscles are late.
    values["wearer.foresight"] = rig.constants.wearer.foresight + values["muscles.delay"] - muscles.delay
    made = rig.changed(values, f"{rig.name}-{seed}")
    return made.changed({"subjects": {f"D{seed}": subject}})


def _constant(rig: KneeRig, path: str) -> float:
    """Return the constant with a dotted path."""
    table, key = path.split(".")
    return rig[table][key]
