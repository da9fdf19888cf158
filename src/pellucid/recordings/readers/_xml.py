"""XML of others: no entities, which unfold without end, and no deeper or larger than a model of muscles is."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from ..._errors import PellucidError, RecordingError
from ..._given import read_given

DEEPEST, MOST = 100, 1_000_000
"""Elements within each other, and in all."""


def read_xml(path: Path) -> ElementTree.Element:
    """The root of a file's tree."""
    path = Path(path)
    try:
        content = read_given(path)
    except FileNotFoundError:
        raise RecordingError(f"{path}: not readable: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: not readable: {error}") from error
    try:
        _require_plain(path, content)
        return ElementTree.fromstring(content)
    except PellucidError:
        raise
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise RecordingError(f"{path.name}: not readable as XML, truncated or damaged: {error}") from error


def _require_plain(path: Path, content: bytes) -> None:
    """Walk through the file without building anything, and refuse what would unfold."""
    depth = count = 0

    def refuse(*declared: object) -> None:
        raise RecordingError(f"{path.name}: found a document type, which may unfold without end, expected none")

    def start(name: str, attributes: dict) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > DEEPEST or count > MOST:
            raise RecordingError(
                f"{path.name}: found {count} elements, {depth} within each other, expected at most {MOST} and {DEEPEST}"
            )

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(content, True)
