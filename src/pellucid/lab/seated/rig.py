"""A virtual shank exoskeleton on a frame and those who sit in it: its rig file."""

from __future__ import annotations

from dataclasses import dataclass

from ..._errors import StudyError
from ...models.joint import GRAVITY
from ...models.muscle_geometry import muscle_table
from ..rig_file import Rig, checked_tables, shipped_rig

KIND = "knee-seated"

NEEDED = {
    "exoskeleton": ("mass", "centre", "inertia"),
    "actuator": ("inertia", "torque_limit", "coulomb_positive", "coulomb_negative", "viscous", "rest_speed",
                 "load_loss", "cogging", "cogging_wave_number", "constant_error"),
    "position_loop": ("kp", "kd", "velocity_span"),
    "instruments": ("rate", "encoder", "torque_noise", "substeps"),
    "shells": ("stiffness", "damping"),
    "limb": ("spread", "ahead", "viscous"),
    "posture": ("rest", "hip", "goniometer"),
    "difference": ("low", "high", "seed"),
    "muscles": ("model_height", "model_mass", "extensors", "flexors", "sharing", "unseen", "unseen_memory",
                "tendon_strain", "passive_strain", "passive_at_rest", "passive_flexors", "fibre_damping",
                "length_shift", "activation_time", "deactivation_time", "delay", "shape", "variability",
                "variability_memory"),
    "wearer": ("cocontraction", "belief", "friction_belief", "reflex_delay", "activation_foresight", "weakening",
               "stiffness", "damping", "spontaneous", "spontaneous_memory", "maximal"),
    "swing": ("forward", "backward", "pace", "memory", "duration"),
    "loaded": ("amplitude", "duration", "reach", "peak_torque", "excitation_seed"),
    "mvc": ("angle", "yield", "duration"),
    "emg": ("muscles", "leaking", "leak_gain", "rate", "band", "median_frequency", "baseline", "hum", "hum_frequency",
            "harmonics", "artefact", "artefact_band", "crosstalk", "gain_spread", "gain", "quantum", "full_range",
            "clock_drift"),
    "subjects.*": ("sex", "age", "height", "weight", "frequency"),
}  # fmt: skip
"""What a rig file must say, table by table, and of each of its subjects."""


@dataclass(frozen=True)
class SeatedRig(Rig):
    """The virtual exoskeleton and its wearers: the tables of a file like ``lab/rigs/knee-seated.toml``."""

    @property
    def period(self) -> float:
        """Of controller and recording [s]."""
        return 1.0 / self["instruments"]["rate"]

    @property
    def exoskeleton_gravity(self) -> tuple[float, float]:
        """Factors of sine and cosine of the position [N m]."""
        part = self["exoskeleton"]
        return GRAVITY * part["mass"] * part["centre"][0], GRAVITY * part["mass"] * part["centre"][1]

    @property
    def exoskeleton_inertia(self) -> float:
        """Of shank part and rotor about the joint [kg m^2]."""
        return self["exoskeleton"]["inertia"] + self["actuator"]["inertia"]


def parse_seated_rig(text: str, name: str) -> SeatedRig:
    """The rig a file describes.

    Parameters
    ----------
    text : str
        TOML.
    name : str
        For messages, and of the rig.

    Returns
    -------
    SeatedRig

    Raises
    ------
    StudyError
        If it is not TOML, not of a seated knee, or something is missing.
    """
    tables = checked_tables(text, name, KIND, NEEDED)
    known = muscle_table().geometry
    strange = [m for m in (*tables["muscles"]["extensors"], *tables["muscles"]["flexors"]) if m not in known]
    if strange:
        raise StudyError(f"rig {name}: [muscles] found {', '.join(strange)}, expected muscles of {', '.join(known)}")
    return SeatedRig(name, tables)


def load_seated_rig(name: str = KIND) -> SeatedRig:
    """The rig that comes with the package.

    Parameters
    ----------
    name : str

    Returns
    -------
    SeatedRig
    """
    return parse_seated_rig(shipped_rig(name), name)
