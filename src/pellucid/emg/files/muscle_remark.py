"""Store calibrated muscles as a remark in the XML file of another program, and read them from it again.

The other program's format has no place for some of the numbers. The remark holds every number, so that the muscles are
restored to the bit. If a number in the file's own elements was changed afterwards, the changed number counts.

Write an OpenSim model with changed constants of some muscles, and every other byte unchanged.

Write calibrated muscles as a CEINMS subject: their constants, the joints that they move and their excitations.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import escape

import numpy as np

from ..._atomic import write_bytes_atomically, write_text_atomically
from ..._errors import PellucidError, RecordingError
from ..._given import read_given, visible_text
from ...models.parameter_card import ParameterCard
from ..models.hill import HillData, HillModel, HillMuscle
from ..models.muscle import CARD_KIND, CalibratedMuscles, calibrated_muscles
from .muscle_constants import MuscleConstants, SubjectMuscle, read_model, read_subject, require_physical

REMARK_START = "pellucid calibrated muscles "
"""Every remark begins with this text, which a table in JSON follows."""

_REMARK_PATTERN = re.compile(rb"\s*<!-- " + REMARK_START.encode() + rb"(\{[^<>]*\}) -->")

MIN_SHAPE_FACTOR = 1e-4
"""Smallest magnitude of a shape factor A that is written into a CEINMS subject, because CEINMS divides by e^A - 1."""


@dataclass(frozen=True)
class MuscleRemark:
    """Calibrated muscles, with their names in the file."""

    muscles: CalibratedMuscles
    names: Mapping[str, str]  # name of each muscle in the file, by the study's name
    period: float = 0.0  # period of the recursion of a CEINMS subject [s]
    study: str = ""  # name of the study that was exported; empty in files of earlier versions

    def text(self) -> str:
        """Return the remark as XML."""
        table = {"names": dict(self.names), "period": self.period, "settings": self.muscles.settings()}
        said = json.dumps({**table, "study": self.study})
        # Two hyphens would end the remark, and tags in it would confuse programs that search for tags.
        for plain, escaped in (("--", "-\\u002d"), ("<", "\\u003c"), (">", "\\u003e")):
            said = said.replace(plain, escaped)
        return f"<!-- {REMARK_START}{said} -->"


def without_remark(content: bytes) -> bytes:
    """Return a file's content without the remark of an earlier export."""
    return _REMARK_PATTERN.sub(b"", content)


def osim_numbers(muscle: HillMuscle) -> dict[str, float]:
    """Return the elements of a muscle in an OpenSim model and their values, SI."""
    return {
        "max_isometric_force": muscle.strength * muscle.max_isometric_force,
        "optimal_fiber_length": muscle.optimal_fibre_length,
        "tendon_slack_length": muscle.tendon_slack_length,
        "pennation_angle_at_optimal": muscle.pennation,
        "max_contraction_velocity": muscle.max_velocity,
    }


def subject_numbers(muscle: HillMuscle, period: float) -> dict[str, float]:
    """Return the elements of a muscle in a CEINMS subject and their values, in the subject's order and units.

    `period` is that of the subject's recursion [s].
    """
    twitch = [-math.exp(-period / t) if t > 0.0 else 0.0 for t in (muscle.time_constant_1, muscle.time_constant_2)]
    return {
        "C1": twitch[0],
        "C2": twitch[1],
        "shapeFactor": max(-muscle.shape, MIN_SHAPE_FACTOR),
        "optimalFiberLength": muscle.optimal_fibre_length,
        "pennationAngle": math.degrees(muscle.pennation),
        "tendonSlackLength": muscle.tendon_slack_length,
        "maxIsometricForce": muscle.max_isometric_force,
        "strengthCoefficient": muscle.strength,
    }


def read_calibrated(path: Path) -> CalibratedMuscles:
    """Return the muscles of an exported ``.osim`` or CEINMS ``.xml``, with numbers that were changed in the file
    since."""
    path = Path(path)
    subject = path.suffix.lower() == ".xml"
    constants = read_subject(path).muscles if subject else read_model(path)
    remark = _read_remark(path)
    changed = []
    for muscle in remark.muscles.muscles:
        name = remark.names.get(muscle.name, muscle.name)
        if name not in constants:
            raise RecordingError(
                f"{path.name}: found no muscle {visible_text(name)}, expected it, as the remark in the file has it"
            )
        found = constants[name]
        if isinstance(found, SubjectMuscle):
            changed.append(_with_subject_numbers(muscle, found, remark.period))
        else:
            changed.append(_with_model_numbers(muscle, found))
    return replace(remark.muscles, muscles=tuple(changed))


def _read_remark(path: Path) -> MuscleRemark:
    found = _REMARK_PATTERN.findall(read_given(path))
    if len(found) != 1:
        raise RecordingError(
            f"{path.name}: found {len(found)} remarks of calibrated muscles, expected the one of an export"
        )
    try:
        table = json.loads(found[0])
        settings = {str(k): v if isinstance(v, str) else float(v) for k, v in table["settings"].items()}
        numbers = [v for v in settings.values() if isinstance(v, float)]
        if not all(map(math.isfinite, numbers)):
            raise ValueError("a number is not finite")
        muscles = calibrated_muscles(ParameterCard(CARD_KIND, "", path.stem, (), settings=settings))
        names = {str(k): str(v) for k, v in table["names"].items()}
        period, study = float(table["period"]), str(table.get("study", ""))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        said = error if isinstance(error, PellucidError) else repr(error)
        raise RecordingError(
            f"{path.name}: found a damaged remark of calibrated muscles ({said}), export again"
        ) from None
    for m in muscles.muscles:
        require_physical(
            path,
            MuscleConstants(m.name, m.max_isometric_force, m.optimal_fibre_length, m.tendon_slack_length, m.pennation),
        )
    return MuscleRemark(muscles, names, period, study)


def exported_study(path: Path) -> str | None:
    """Return the name of the study whose muscles an exported file has; None if no export with a name wrote it."""
    try:
        return _read_remark(path).study or None
    except PellucidError:
        return None


def _with_model_numbers(muscle: HillMuscle, found: MuscleConstants) -> HillMuscle:
    written = osim_numbers(muscle)
    return _with_changed_numbers(
        muscle,
        max_isometric_force=(found.largest_force, written["max_isometric_force"], lambda x: x / muscle.strength),
        optimal_fibre_length=(found.optimal_fibre_length, written["optimal_fiber_length"], float),
        tendon_slack_length=(found.tendon_slack_length, written["tendon_slack_length"], float),
        pennation=(found.pennation, written["pennation_angle_at_optimal"], float),
    )


def _with_subject_numbers(muscle: HillMuscle, found: SubjectMuscle, period: float) -> HillMuscle:
    written = subject_numbers(muscle, period)

    def constant(c: float) -> float:
        return -period / math.log(-c) if c < 0.0 else 0.0

    return _with_changed_numbers(
        muscle,
        time_constant_1=(found.twitch[0], written["C1"], constant),
        time_constant_2=(found.twitch[1], written["C2"], constant),
        shape=(found.shape, written["shapeFactor"], lambda x: -abs(x)),
        optimal_fibre_length=(found.optimal_fibre_length, written["optimalFiberLength"], float),
        pennation=(found.pennation, math.radians(written["pennationAngle"]), float),
        tendon_slack_length=(found.tendon_slack_length, written["tendonSlackLength"], float),
        max_isometric_force=(found.largest_force, written["maxIsometricForce"], float),
        strength=(found.strength, written["strengthCoefficient"], float),
    )


def _with_changed_numbers(muscle: HillMuscle, **numbers) -> HillMuscle:
    """Return the muscle with the `numbers` that were changed in the file after it was written.

    Each number is given as its value in the file now, the value that was written, and the conversion to the muscle's
    own quantity.
    """
    return replace(muscle, **{key: back(now) for key, (now, written, back) in numbers.items() if now != written})


_RENAMED_ELEMENTS = {"pennation_angle": "pennation_angle_at_optimal"}
"""Present name of each element that was renamed in OpenSim 3."""


def write_osim(path: Path, source: Path, remark: MuscleRemark) -> Path:
    """Write a copy of the model `source` with calibrated muscles, completely or not at all."""
    known = read_model(source)  # raises an error if the file is not a model
    lacking = [name for name in remark.names.values() if name not in known]
    if lacking:
        raise RecordingError(
            f"{source.name}: found the muscles {', '.join(list(known)[:40])}, expected "
            f"{', '.join(map(visible_text, lacking))} too: state the model's names of the study's muscles "
            "in [emg_torque] muscle_names"
        )
    content = without_remark(read_given(source))
    wanted = {remark.names[m.name]: osim_numbers(m) for m in remark.muscles.muscles}
    for start, end, number in sorted(_element_places(source, content, wanted), reverse=True):
        if float(content[start:end]) != number:  # an equal number keeps its text
            content = content[:start] + repr(number).encode() + content[end:]
    at = content.rindex(b"</OpenSimDocument")
    return write_bytes_atomically(path, content[:at] + f"{remark.text()}\n".encode() + content[at:])


def _element_places(
    source: Path, content: bytes, wanted: Mapping[str, Mapping[str, float]]
) -> list[tuple[int, int, float]]:
    """Return the start and end of each element's text in the file [bytes], and the number to write there."""
    found: list[tuple[int, int, float]] = []
    above: list[tuple[str, str]] = []
    # A frame or a marker may have a muscle's name. Only an element with a force is a muscle.
    pending: dict[int, list[tuple[str, int, int, float]]] = {}

    def start(tag: str, attributes: Mapping[str, str]) -> None:
        above.append((tag, attributes.get("name", "")))
        pending[len(above)] = []

    def end(tag: str) -> None:
        depth = len(above)
        own = pending.pop(depth)
        if any(key == "max_isometric_force" for key, *_ in own):
            found.extend((first, last, number) for _, first, last, number in own)
        above.pop()
        numbers = wanted.get(above[-1][1], {}) if above else {}
        key = _RENAMED_ELEMENTS.get(tag, tag)
        if key in numbers:
            last = parser.CurrentByteIndex
            first = content.rfind(b">", 0, last) + 1
            pending[depth - 1].append((key, first, last, numbers[key]))

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        content.decode("utf-8")
        parser.Parse(content, True)
    except (UnicodeDecodeError, expat.ExpatError) as error:
        raise RecordingError(f"{source.name}: not readable as XML in UTF-8: {error}") from None
    return found


CURVE_LENGTHS = np.round(np.arange(0.0, 2.01, 0.05), 2)
"""Fibre lengths at which a subject's curves are sampled, in optimal fibre lengths l_o."""

CURVE_VELOCITIES = np.round(np.arange(-1.0, 1.01, 0.05), 2)
"""Fibre velocities at which a subject's curves are sampled, in v_max l_o."""


def write_subject(path: Path, remark: MuscleRemark, joints: Mapping[str, Sequence[str]]) -> Path:
    """Write a subject, completely or not at all. `joints` holds the muscles that move each joint, by the study's
    names."""
    muscles = remark.muscles.muscles
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<subject>", " <muscleDefault>"]
    lines += [
        f"  <percentageChange>{_mean(muscles, 'optimal_length_shift')!r}</percentageChange>",
        f"  <damping>{_mean(muscles, 'damping')!r}</damping>",
    ]
    for name, (x, y) in mean_curves(muscles).items():
        points = [
            f"<{tag}>{' '.join(repr(float(v)) for v in row)}</{tag}>" for tag, row in (("xPoints", x), ("yPoints", y))
        ]
        lines += ["  <Curve>", f"   <name>{name}</name>", *(f"   {p}" for p in points), "  </Curve>"]
    lines += [" </muscleDefault>", " <muscles>"]
    for muscle in muscles:
        numbers = subject_numbers(muscle, remark.period)
        lines += ["  <muscle>", f"   <name>{escape(remark.names[muscle.name])}</name>"]
        lines += [f"   <{key}>{value!r}</{key}>" for key, value in numbers.items()]
        lines += ["  </muscle>"]
    lines += [" </muscles>", " <DoFs>"]
    for joint, members in joints.items():
        lines += _sequence("DoF", joint, [remark.names[m] for m in members])
    lines += [" </DoFs>", " <Channels>"]
    channels = dict.fromkeys(c for m in muscles for c in remark.muscles.driven[m.name])
    for channel in channels:
        driven = [remark.names[m.name] for m in muscles if channel in remark.muscles.driven[m.name]]
        lines += _sequence("Channel", channel, driven)
    lines += [" </Channels>", remark.text(), "</subject>"]
    return write_text_atomically(path, "\n".join(lines) + "\n")


def _sequence(tag: str, name: str, muscles: Sequence[str]) -> list[str]:
    said = escape(" ".join(muscles))
    return [
        f"  <{tag}>", f"   <name>{escape(name)}</name>", f"   <muscleSequence>{said}</muscleSequence>", f"  </{tag}>"
    ]  # fmt: skip


def _mean(muscles: Sequence[HillMuscle], quantity: str) -> float:
    values = [getattr(m, quantity) for m in muscles]
    return float(values[0] if len(set(values)) == 1 else np.mean(values))


def mean_curves(muscles: Sequence[HillMuscle]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the points of the core's own curves for the mean muscle, since a subject has one curve for all muscles."""
    shaped = ("force_length_width", "passive_scale", "curvature", "eccentric_force", "passive_strain", "passive_shape")
    mean_muscle = HillMuscle("mean", 1.0, 0.0, 1.0, **{q: _mean(muscles, q) for q in shaped})
    # Without tendon, pennation, damping and time, a muscle's force consists of its curves alone.
    model = HillModel([replace(mean_muscle, shape=0.0, delay=0.0, optimal_length_shift=0.0)])

    def force(excitation: float, length: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        n = len(length)
        starts = tuple(range(n))  # every sample is a simulation of its own, which starts at rest
        data = HillData(
            np.full((1, n), excitation), length[None], 10.0 * velocity[None], np.ones((1, n)), 1.0, starts
        )  # fmt: skip
        return model.states(data)["force"][0]

    still = np.zeros_like(CURVE_LENGTHS)
    passive = force(0.0, CURVE_LENGTHS, still)
    active = force(1.0, CURVE_LENGTHS, still) - passive
    fast = force(1.0, np.ones_like(CURVE_VELOCITIES), CURVE_VELOCITIES)
    return {
        "activeForceLength": _with_far_points(CURVE_LENGTHS, active, (0.0, 0.0)),
        "passiveForceLength": _with_far_points(CURVE_LENGTHS, passive, (0.0, float(passive[-1]))),
        "forceVelocity": _with_far_points(CURVE_VELOCITIES, fast, (0.0, float(fast[-1]))),
    }


def _with_far_points(x: np.ndarray, y: np.ndarray, ends: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve with one more point far out on either side, so that no program extrapolates the spline."""
    return np.concatenate(([-5.0], x, [5.0])), np.concatenate((ends[:1], y, ends[1:]))
