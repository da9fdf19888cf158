"""Sources of the lengths, moment arms and constants of a trial's muscles, and the EMG that drives each muscle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..models.hill import HillMuscle
from ..models.muscle_geometry import muscle_table
from ..models.muscle_polynomial import MusclePolynomial

FIBRE_DAMPING = 0.05
"""Damping of every muscle fibre, in F_0 over v_max l_o.

Published models have 0.01 to 0.1. The value was chosen by cross-validation within fitted trials of walking.
"""

MUSCLE_BY_CHANNEL_ALIAS: Mapping[str, str] = {
    "biceps_femoris": "biceps_femoris_long",
    "lateral_hamstring": "biceps_femoris_long",
    "medial_hamstring": "semitendinosus",
    "gastrocnemius": "gastrocnemius_medialis",
}
"""Muscle under an electrode, by the more general name that an EMG channel may have."""

COMPANION_MUSCLES: Mapping[str, tuple[str, ...]] = {
    "vastus_intermedius": ("vastus_lateralis", "vastus_medialis"),
    "vastus_medialis": ("vastus_lateralis",),
    "vastus_lateralis": ("vastus_medialis",),
    "semitendinosus": ("semimembranosus",),
    "semimembranosus": ("semitendinosus",),
    "biceps_femoris_short": ("biceps_femoris_long",),
    "gastrocnemius_lateralis": ("gastrocnemius_medialis",),
    "gastrocnemius_medialis": ("gastrocnemius_lateralis",),
}
"""Neighbours in the same group, by muscle. Their mean EMG stands in for a muscle without an electrode."""

SEATED_POSTURE_RAD = {"hip": np.radians(85.0), "ankle": 0.0}
"""Angles of joints that were not recorded, for a sitting person [rad], in the geometry's signs."""

STANDING_POSTURE_RAD = {"hip": 0.0, "ankle": 0.0}
"""Angles of joints that were not recorded, for a standing person [rad], in the geometry's signs."""


@dataclass(frozen=True, eq=False)
class MuscleSource:
    """Constants and geometry of the muscles across a joint."""

    constants: Mapping[str, HillMuscle]  # Anatomical constants by muscle
    # Length [m], rate [m/s] and moment arm [m] by muscle, shape (n,) each, if the study has them; empty: from angles
    recorded: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=dict, repr=False)
    # Lengths as functions of the study's angles, by muscle, of the study's own model; empty: those of the leg model
    polynomials: Mapping[str, MusclePolynomial] = field(default_factory=dict, repr=False)
    sign: float = 1.0  # -1 if the study's knee angle grows with flexion: the geometry's grows with extension
    # Angles of joints that the trial lacks [rad]
    posture: Mapping[str, float] = field(default_factory=lambda: dict(STANDING_POSTURE_RAD))
    # Whether envelopes are relative to a maximal contraction; False: to the largest one seen, maybe at little effort
    maximal: bool = True
    relative: bool = True  # Whether envelopes are relative at all, and not in V

    def crossing(self, joint: str) -> tuple[str, ...]:
        """Return the names of the muscles across a joint."""
        if self.recorded:
            return tuple(self.recorded)
        paths = self.polynomials or muscle_table().geometry
        return tuple(name for name, path in paths.items() if joint in path.angles)

    def driven(self, joint: str, envelopes: Mapping[str, np.ndarray]) -> dict[str, tuple[str, ...]]:
        """Return the muscles across a joint that some EMG drives, each with the channels whose mean drives it."""
        channels = {MUSCLE_BY_CHANNEL_ALIAS.get(name, name): name for name in envelopes}
        found = {}
        for muscle in self.crossing(joint):
            if muscle not in self.constants:
                continue
            own = (muscle,) if muscle in channels else COMPANION_MUSCLES.get(muscle, ())
            present = tuple(channels[m] for m in own if m in channels)
            if present:
                found[muscle] = present
        return found

    def path(
        self, muscle: str, joint: str, angles: Mapping[str, np.ndarray], rates: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return length [m], rate [m/s] and moment arm [m] of `muscle`, each of shape (n,).

        `angles` [rad] and `rates` [rad/s] by joint are in the study's signs. The arm about `joint` is positive if the
        muscle pulls along the study's positive angle.
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
