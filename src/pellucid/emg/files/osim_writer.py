"""Write an OpenSim model with changed constants of some muscles, and every other byte unchanged."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.parsers import expat

from ..._atomic import write_bytes_atomically
from ..._errors import RecordingError
from ..._given import read_given, visible_text
from .muscle_remark import MuscleRemark, osim_numbers, without_remark
from .osim import read_model

_RENAMED_ELEMENTS = {"pennation_angle": "pennation_angle_at_optimal"}
"""Present name of each element that was renamed in OpenSim 3."""


def write_osim(path: Path, source: Path, remark: MuscleRemark) -> Path:
    """Write a copy of the model `source` with calibrated muscles, completely or not at all."""
    known = read_model(source)  # raises an error if the file is not a model
    lacking = [name for name in remark.names.values() if name not in known]
    if lacking:
        raise RecordingError(
            f"{source.name}: found the muscles {', '.join(list(known)[:40])}, expected "
            f"{', '.join(map(visible_text, lacking))} too: say what the model calls the study's muscles in "
            "[emg_torque] muscle_names"
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
