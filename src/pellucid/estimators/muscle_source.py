"""Where lengths, moment arms and constants of a trial's muscles come from, and which EMG drives each muscle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..models.hill import HillMuscle
from ..models.muscle_geometry import muscle_table
from ..models.muscle_polynomial import MusclePolynomial

FIBRE_DAMPING = 0.05
"""Of every fibre, in F_0 over v_max l_o; published models have 0.01 to 0.1. Chosen within what is fitted of walking."""

ALIASES: Mapping[str, str] = {
    "biceps_femoris": "biceps_femoris_long",
    "lateral_hamstring": "biceps_femoris_long",
    "medial_hamstring": "semitendinosus",
    "gastrocnemius": "gastrocnemius_medialis",
}
"""What EMG channels may call a muscle, and the muscle under such an electrode."""

COMPANIONS: Mapping[str, tuple[str, ...]] = {
    "vastus_intermedius": ("vastus_lateralis", "vastus_medialis"),
    "vastus_medialis": ("vastus_lateralis",),
    "vastus_lateralis": ("vastus_medialis",),
    "semitendinosus": ("semimembranosus",),
    "semimembranosus": ("semitendinosus",),
    "biceps_femoris_short": ("biceps_femoris_long",),
    "gastrocnemius_lateralis": ("gastrocnemius_medialis",),
    "gastrocnemius_medialis": ("gastrocnemius_lateralis",),
}
"""Whose EMG, their mean, stands in for a muscle that no electrode is on: neighbours of the same group."""

SEATED = {"hip": np.radians(85.0), "ankle": 0.0}
"""Angles of joints that were not recorded, of someone sitting [rad], in the geometry's signs."""

STANDING = {"hip": 0.0, "ankle": 0.0}
"""The same, of someone standing."""


@dataclass(frozen=True, eq=False)
class MuscleSource:
    """What is known of the muscles across a joint."""

    constants: Mapping[str, HillMuscle]  # Anatomical values, by muscle
    # (n,) Length [m], rate [m/s] and moment arm [m] by muscle, where the study has them; empty: from the angles
    recorded: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=dict, repr=False)
    # Lengths over angles in the study's signs, by muscle, of the study's own model; empty: of the leg's
    polynomials: Mapping[str, MusclePolynomial] = field(default_factory=dict, repr=False)
    sign: float = 1.0  # -1 where the study's knee angle grows with flexion: the geometry's grows with extension
    # Angles of joints that the trial lacks [rad]
    posture: Mapping[str, float] = field(default_factory=lambda: dict(STANDING))
    # Whether envelopes are relative to a maximal contraction; False: to the largest seen, which may be little effort
    maximal: bool = True
    relative: bool = True  # Whether they are relative at all

    def crossing(self, joint: str) -> tuple[str, ...]:
        """Muscles across a joint."""
        if self.recorded:
            return tuple(self.recorded)
        paths = self.polynomials or muscle_table().geometry
        return tuple(name for name, path in paths.items() if joint in path.angles)

    def driven(self, joint: str, envelopes: Mapping[str, np.ndarray]) -> dict[str, tuple[str, ...]]:
        """Muscles across a joint that some EMG drives, each with the channels whose mean it is."""
        channels = {ALIASES.get(name, name): name for name in envelopes}
        found = {}
        for muscle in self.crossing(joint):
            if muscle not in self.constants:
                continue
            own = (muscle,) if muscle in channels else COMPANIONS.get(muscle, ())
            present = tuple(channels[m] for m in own if m in channels)
            if present:
                found[muscle] = present
        return found

    def path(
        self, muscle: str, joint: str, angles: Mapping[str, np.ndarray], rates: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Length [m], rate [m/s] and moment arm [m] of `muscle`, each of shape (n,), from `angles` and `rates` in the
        study's signs; the arm about `joint` is positive where the muscle pulls along the study's positive angle.
        """
        if muscle in self.recorded:
            return self.recorded[muscle]
        geometry, count = (self.polynomials or muscle_table().geometry)[muscle], len(next(iter(angles.values())))
        turned = self.sign if not self.polynomials else 1.0
        signs = {name: turned if name == "knee" else 1.0 for name in geometry.angles}
        q = {
            name: signs[name] * angles[name] if name in angles else np.full(count, self.posture.get(name, 0.0))
            for name in geometry.angles
        }
        v = {name: signs[name] * rates[name] if name in rates else np.zeros(count) for name in geometry.angles}
        return geometry.length(q), geometry.rate(q, v), signs.get(joint, 1.0) * geometry.moment_arm(joint, q)
