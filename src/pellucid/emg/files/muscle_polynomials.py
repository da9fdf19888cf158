"""Lengths of a model's muscles as polynomials of a study's angles, fitted to an OpenSim model once and kept in a file.

The file is ``muscle_geometry.json``. A person can read it, and it states its error against the model. It may be named
as ``muscle_file`` if the model itself is not at hand.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ..._errors import PellucidError, RecordingError
from ..._given import read_given, visible_text
from ..models.muscle_geometry import MusclePolynomial, PolynomialError, fit_muscle_polynomial
from .muscle_constants import MuscleConstants, read_model, require_physical
from .osim_paths import MuscleModel, read_paths

FORMAT_VERSION = 1
"""Version of the file's format."""

KIND = "muscle_geometry"
"""Value of "kind" in the file."""

POLYNOMIAL_FILE = "muscle_geometry.json"
"""Name of the file in the study's folder."""

FORMULA_TEXT = (
    "length of muscle and tendon [m] = sum of coefficients * product of ((angle - middle) / half)^power, angles [rad] "
    "in the study's signs; moment arm [m] = -d length / d angle, positive where the muscle pulls along the angle; "
    "beyond middle +- half the length is extrapolated linearly"
)
"""Explanation of the polynomials for a person who reads the file."""

MAX_TERM_COUNT = 5_000
"""A polynomial in a file has at most this many terms, so that no file fills the memory."""

_CONSTANT_FIELDS = ("largest_force", "optimal_fibre_length", "tendon_slack_length", "pennation")
_ERROR_KEY = "error_of_poses_not_fitted [m]"


@dataclass(frozen=True, eq=False)
class ModelMuscles:
    """Muscles of a model over the joints of a study."""

    source: str  # name of the model's file
    checksum: str  # SHA-256 of the model's file, hexadecimal
    coordinates: Mapping[str, str]  # the model's coordinate of each joint; a minus sign if it has the opposite sense
    held: Mapping[str, float]  # default values of the model's coordinates that the study does not have [rad; m]
    named: Mapping[str, str]  # the model's name of each muscle that was asked for; empty for all muscles
    constants: Mapping[str, MuscleConstants]  # constants by the study's names
    polynomials: Mapping[str, MusclePolynomial]  # lengths by the study's names
    # Muscles that cross these joints, and why they are not here
    refused: Mapping[str, str] = field(default_factory=dict)

    @property
    def signs(self) -> dict[str, float]:
        """Sign of each joint's angle against the model's coordinate: 1.0 or -1.0."""
        return {joint: -1.0 if name.startswith("-") else 1.0 for joint, name in self.coordinates.items()}


def model_muscles(path: Path, checksum: str, coordinates: Mapping[str, str], names: Mapping[str, str]) -> ModelMuscles:
    """Fit the muscles of an OpenSim model over the joints of `coordinates`.

    `names` gives the model's name of each of the study's muscles; if it is empty, all muscles that cross a joint are
    fitted.
    """
    model, constants = read_paths(path), read_model(path)
    for joint, name in coordinates.items():
        _require_coordinate(model, joint, name.removeprefix("-"))
    own = dict(names) or {name: name for name in model.muscles}
    made: dict[str, MusclePolynomial] = {}
    refused: dict[str, str] = {}
    held: dict[str, float] = {}
    for ours, theirs in own.items():
        try:
            polynomial, others = _fit_polynomial(model, ours, theirs, coordinates)
        except PellucidError as error:
            if names:
                raise RecordingError(f"{path.name}, {error}") from None
            refused[ours] = str(error)
            continue
        if polynomial is not None:
            made[ours] = polynomial
            held |= {name: model.skeleton.coordinates[name].default for name in others}
    if not made:
        raise RecordingError(
            f"{path.name}: found no muscle across {', '.join(coordinates.values())}, expected some of "
            f"{', '.join(list(own.values())[:20])}"
        )
    kept = {ours: constants[own[ours]] for ours in made}
    return ModelMuscles(path.name, checksum, dict(coordinates), held, dict(names), kept, made, refused)


def _require_coordinate(model: MuscleModel, joint: str, name: str) -> None:
    known = [n for n in model.skeleton.coordinates if n not in model.skeleton.couplings]
    if name not in known:
        raise RecordingError(
            f'{model.path.name}: found no coordinate "{visible_text(name)}" of joint {joint} that moves freely, '
            f"expected one of {', '.join(known[:40])}: say it in [emg_torque.coordinates]"
        )


def _fit_polynomial(
    model: MuscleModel, ours: str, theirs: str, coordinates: Mapping[str, str]
) -> tuple[MusclePolynomial | None, list[str]]:
    """Fit one muscle over the joints that it crosses; return it with the other coordinates that move it.

    The muscle is None if it crosses none of the joints.
    """
    muscle_path = model.muscle(theirs)
    moving = muscle_path.coordinates(model.skeleton)
    plain = {joint: name.removeprefix("-") for joint, name in coordinates.items()}
    joints = [joint for joint, name in plain.items() if name in moving]
    if not joints:
        return None, []
    sign = {joint: -1.0 if coordinates[joint].startswith("-") else 1.0 for joint in joints}
    ranges = {}
    for joint in joints:
        found = model.skeleton.coordinates[plain[joint]]
        ends = [sign[joint] * min(max(end, -math.pi), math.pi) for end in (found.lower, found.upper)]
        if not abs(ends[1] - ends[0]) > 1e-3:
            raise RecordingError(f"coordinate {plain[joint]}: found the range {ends}, expected increasing limits")
        ranges[joint] = (min(ends), max(ends))

    def path(angles: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        q = {plain[joint]: sign[joint] * angles[joint] for joint in joints}
        length, arms = muscle_path.length(model.skeleton, q, [plain[joint] for joint in joints])
        return length, arms * np.array([[sign[joint]] for joint in joints])

    others = [name for name in moving if name not in plain.values()]
    return fit_muscle_polynomial(ours, ranges, path), others


def write_polynomials(path: Path, muscles: ModelMuscles) -> Path:
    """Write muscles into a file, completely or not at all."""
    rows = {
        name: {
            "name_in_the_model": muscles.constants[name].name,
            **{key: getattr(muscles.constants[name], key) for key in _CONSTANT_FIELDS},
            "angles": list(p.angles), "middle": list(p.middle), "half": list(p.half),
            _ERROR_KEY: {key: float(f"{value:.3g}") for key, value in asdict(p.error).items()},
            "powers": p.powers.tolist(), "coefficients": p.coefficients.tolist(),
        }
        for name, p in muscles.polynomials.items()
    }  # fmt: skip
    head = {
        "format": FORMAT_VERSION, "kind": KIND, "what": FORMULA_TEXT, "source": muscles.source,
        "sha256": muscles.checksum,
        "coordinates": dict(muscles.coordinates), "held": dict(muscles.held),
        "named": dict(muscles.named), "refused": dict(muscles.refused),
    }  # fmt: skip
    lines = [f" {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}," for key, value in head.items()]
    body = [f"  {json.dumps(name)}: {json.dumps(row, ensure_ascii=False)}" for name, row in rows.items()]
    return write_text_atomically(path, "\n".join(["{", *lines, ' "muscles": {', ",\n".join(body), " }", "}"]) + "\n")


def read_polynomials(path: Path) -> ModelMuscles:
    """Read muscles from a file that `write_polynomials` wrote."""
    path = Path(path)
    try:
        table = json.loads(read_given(path).decode("utf-8"))
    except OSError as error:
        raise RecordingError(f"{path}: not readable: {error}") from error
    except PellucidError:
        raise
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{path.name}: not readable as JSON, truncated or damaged: {error}") from None
    if not isinstance(table, dict) or table.get("kind") != KIND or table.get("format") != FORMAT_VERSION:
        raise RecordingError(
            f'{path.name}: found no "kind": "{KIND}" of format {FORMAT_VERSION}, expected what calibrate writes'
        )
    try:
        constants, made = {}, {}
        for name, row in table["muscles"].items():
            where = f"{path.name}, muscle {visible_text(str(name))[:100]}"
            constants[name] = require_physical(
                path, MuscleConstants(str(row["name_in_the_model"]), *(float(row[key]) for key in _CONSTANT_FIELDS))
            )
            made[name] = _read_polynomial(where, str(name), row)
        return ModelMuscles(
            str(table["source"]), str(table["sha256"]), _strings(table["coordinates"]),
            {str(k): float(v) for k, v in table["held"].items()}, _strings(table["named"]),
            constants, made, _strings(table["refused"]),
        )  # fmt: skip
    except PellucidError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordingError(f"{path.name}: found no whole {KIND}: {error!r}, expected what calibrate writes") from None


def _strings(table: Mapping) -> dict[str, str]:
    return {str(key): str(value) for key, value in table.items()}


def _read_polynomial(where: str, name: str, row: Mapping) -> MusclePolynomial:
    angles = tuple(map(str, row["angles"]))
    middle, half = (tuple(map(float, row[key])) for key in ("middle", "half"))
    powers, coefficients = np.array(row["powers"], int), np.array(row["coefficients"], float)
    whole = (
        0 < len(angles) == len(middle) == len(half)
        and powers.shape == (len(coefficients), len(angles))
        and len(coefficients) <= MAX_TERM_COUNT
        and powers.min(initial=0) >= 0
        and powers.max(initial=0) <= max(20, MAX_TERM_COUNT // 100)
    )
    if not whole:
        raise RecordingError(
            f"{where}: found {len(coefficients)} coefficients and powers of shape {powers.shape} over "
            f"{len(angles)} angles, expected one row of powers each, at most {MAX_TERM_COUNT}"
        )
    finite = np.isfinite([*middle, *half, *coefficients]).all()
    if not finite or min(half) <= 0.0 or np.abs(coefficients).max() > 1e3 or max(map(abs, middle)) > 10.0:
        raise RecordingError(f"{where}: found numbers that no muscle has, expected lengths [m] and angles [rad]")
    return MusclePolynomial(
        name,
        angles,
        middle,
        half,
        powers,
        coefficients,
        PolynomialError(**{k: float(v) for k, v in row[_ERROR_KEY].items()}),
    )
