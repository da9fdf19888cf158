"""Read XML files from strangers safely: without entities, which may expand without end, and within bounds of size."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from ..._errors import PellucidError, RecordingError
from ..._given import read_given

MAX_XML_DEPTH = 100
"""Elements may be nested this deep; no model of muscles comes near it."""

MAX_XML_ELEMENTS = 1_000_000
"""A file has at most this many elements; no model of muscles comes near it."""


def read_xml(path: Path) -> ElementTree.Element:
    """Return the root element of a file."""
    path = Path(path)
    try:
        content = read_given(path)
    except FileNotFoundError:
        raise RecordingError(f"{path}: not readable: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: not readable: {error}") from error
    return parse_small_xml(path, content)


def parse_small_xml(path: Path, content: bytes) -> ElementTree.Element:
    """Return the root element of a text in XML, of a file or in one."""
    try:
        _require_plain(path, content)
        return ElementTree.fromstring(content)
    except PellucidError:
        raise
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise RecordingError(f"{path.name}: not readable as XML, truncated or damaged: {error}") from error


def _require_plain(path: Path, content: bytes) -> None:
    """Parse the file without building a tree, and refuse a document type, deep nesting and too many elements."""
    depth = count = 0

    def refuse(*declared: object) -> None:
        raise RecordingError(f"{path.name}: found a document type, expected none: it can expand without limit")

    def start(name: str, attributes: dict) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > MAX_XML_DEPTH or count > MAX_XML_ELEMENTS:
            raise RecordingError(
                f"{path.name}: found {count} elements, {depth} within each other, expected at most {MAX_XML_ELEMENTS} "
                f"and {MAX_XML_DEPTH}"
            )

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(content, True)
