"""An OpenSim model with the constants of some muscles set, every other byte as it was."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.parsers import expat

from .._atomic import write_bytes_atomically
from .._errors import RecordingError
from .._given import read_given, seen
from .muscle_remark import MuscleRemark, osim_numbers, without_remark
from .readers.osim import read_model

_OLD = {"pennation_angle": "pennation_angle_at_optimal"}
"""What elements were called before OpenSim 3."""


def write_osim(path: Path, source: Path, remark: MuscleRemark) -> Path:
    """Write a copy of the model `source` with calibrated muscles in it, whole or not at all."""
    known = read_model(source)  # which also refuses what is not one
    lacking = [name for name in remark.names.values() if name not in known]
    if lacking:
        raise RecordingError(
            f"{source.name}: found the muscles {', '.join(list(known)[:40])}, expected {', '.join(map(seen, lacking))} "
            "too: say what the model calls the study's muscles in [emg_torque] muscle_names"
        )
    content = without_remark(read_given(source))
    wanted = {remark.names[m.name]: osim_numbers(m) for m in remark.muscles.muscles}
    for start, end, number in sorted(_places(source, content, wanted), reverse=True):
        if float(content[start:end]) != number:  # else it keeps its text
            content = content[:start] + repr(number).encode() + content[end:]
    at = content.rindex(b"</OpenSimDocument")
    return write_bytes_atomically(path, content[:at] + f"{remark.text()}\n".encode() + content[at:])


def _places(source: Path, content: bytes, wanted: Mapping[str, Mapping[str, float]]) -> list[tuple[int, int, float]]:
    """Where the text of each element lies, and the number that belongs there."""
    found: list[tuple[int, int, float]] = []
    above: list[tuple[str, str]] = []
    # A frame or a marker may be called as a muscle is: what holds no force is none.
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
        key = _OLD.get(tag, tag)
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
