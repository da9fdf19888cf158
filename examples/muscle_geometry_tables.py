"""Make the package's table of muscle geometry again from OpenSim's gait2392 model (needs ``pip install opensim``).

    python examples/muscle_geometry_tables.py gait2392_thelen2003muscle.osim table.json

Every muscle's length is sampled over the angles of the joints that it crosses and fitted with a tensor product of
cubic splines; angles that the table does not have (hip adduction and rotation, subtalar) are 0.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline

COORDINATES = {"hip": "hip_flexion_r", "knee": "knee_angle_r", "ankle": "ankle_angle_r"}
RANGES = {"hip": (-30.0, 120.0, 15.0), "knee": (-120.0, 10.0, 5.0), "ankle": (-50.0, 40.0, 15.0)}
"""Of each angle: first, last, distance of knots [deg]."""
STEPS = {"hip": 2.5, "knee": 1.0, "ankle": 2.5}
"""Between samples [deg]."""
MUSCLES = {
    "rectus_femoris": ("rect_fem_r", ("hip", "knee")),
    "vastus_medialis": ("vas_med_r", ("knee",)),
    "vastus_intermedius": ("vas_int_r", ("knee",)),
    "vastus_lateralis": ("vas_lat_r", ("knee",)),
    "biceps_femoris_long": ("bifemlh_r", ("hip", "knee")),
    "biceps_femoris_short": ("bifemsh_r", ("knee",)),
    "semimembranosus": ("semimem_r", ("hip", "knee")),
    "semitendinosus": ("semiten_r", ("hip", "knee")),
    "sartorius": ("sar_r", ("hip", "knee")),
    "gracilis": ("grac_r", ("hip", "knee")),
    "tensor_fasciae_latae": ("tfl_r", ("hip", "knee")),
    "gastrocnemius_medialis": ("med_gas_r", ("knee", "ankle")),
    "gastrocnemius_lateralis": ("lat_gas_r", ("knee", "ankle")),
    "soleus": ("soleus_r", ("ankle",)),
    "tibialis_anterior": ("tib_ant_r", ("ankle",)),
}
SOURCE = (
    "OpenSim gait2392_thelen2003muscle.osim, github.com/opensim-org/opensim-models at commit "
    "20a888b9655e73fb84963d6e03eee3752cf6074b"
)
LICENCE = (
    "Creative Commons Attribution 3.0 (CC BY 3.0), https://creativecommons.org/licenses/by/3.0/. Model by S. L. Delp, "
    "J. P. Loan, M. G. Hoy, F. E. Zajac, E. L. Topp, J. M. Rosen, D. G. Thelen, F. C. Anderson, A. Seth. Changed: "
    "lengths were sampled and fitted with splines."
)
CITATION = (
    "Delp et al., IEEE Trans. Biomed. Eng. 37, 757-767, 1990; Yamaguchi and Zajac, J. Biomech. 22, 1-10, 1989; "
    "Anderson and Pandy, Comput. Methods Biomech. Biomed. Eng. 2, 201-231, 1999."
)


def knots(angle: str) -> np.ndarray:
    """Of a cubic spline over an angle's range [rad]."""
    first, last, distance = RANGES[angle]
    inner = np.arange(first + distance, last - 0.5 * distance, distance)
    return np.deg2rad(np.concatenate([[first] * 4, inner, [last] * 4]))


def samples(angle: str) -> np.ndarray:
    """Where an angle is sampled [rad]."""
    first, last, _ = RANGES[angle]
    return np.deg2rad(np.arange(first, last + 1e-9, STEPS[angle]))


def main(model_path: str, out: str) -> None:
    import opensim

    opensim.Logger.setLevelString("error")
    model = opensim.Model(model_path)
    state = model.initSystem()
    coordinates, muscles = model.getCoordinateSet(), model.getMuscles()
    table = {"source": SOURCE, "licence": LICENCE, "citation": CITATION, "muscles": {}}
    for name, (label, angles) in MUSCLES.items():
        for i in range(coordinates.getSize()):
            coordinates.get(i).setValue(state, 0.0, False)
        axes = [samples(a) for a in angles]
        lengths = np.empty([len(a) for a in axes])
        for index in np.ndindex(lengths.shape):
            for angle, axis, i in zip(angles, axes, index, strict=True):
                coordinates.get(COORDINATES[angle]).setValue(state, float(axis[i]), False)
            model.realizePosition(state)
            lengths[index] = muscles.get(label).getLength(state)
        fitted = lengths
        for k, angle in enumerate(angles):
            basis = BSpline.design_matrix(axes[k], knots(angle), 3).toarray()
            fitted = np.moveaxis(np.tensordot(np.linalg.pinv(basis), fitted, (1, k)), 0, k)
        again = fitted
        for k, angle in enumerate(angles):
            basis = BSpline.design_matrix(axes[k], knots(angle), 3).toarray()
            again = np.moveaxis(np.tensordot(basis, again, (1, k)), 0, k)
        muscle = muscles.get(label)
        print(f"{name}: {1e3 * np.abs(again - lengths).max():.3f} mm at most")
        table["muscles"][name] = {
            "label": label,
            "max_isometric_force": muscle.getMaxIsometricForce(),
            "optimal_fibre_length": muscle.getOptimalFiberLength(),
            "tendon_slack_length": muscle.getTendonSlackLength(),
            "pennation": muscle.getPennationAngleAtOptimalFiberLength(),
            "angles": list(angles),
            "knots": [knots(a).round(9).tolist() for a in angles],
            "coefficients": fitted.round(7).tolist(),
        }
    lines = ["{"]
    lines += [f" {json.dumps(k)}: {json.dumps(table[k])}," for k in ("source", "licence", "citation")]
    rows = [f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in table["muscles"].items()]
    lines += [' "muscles": {', ",\n".join(rows), " }", "}"]
    Path(out).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
