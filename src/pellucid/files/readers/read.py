"""Choose the reader for a file. Each module of this package that names file endings is a reader.

Such a module has ``ENDINGS``, a tuple of file endings with their dot, and ``read(path)``, which returns `Columns`.
If several modules read one ending, those with ``recognises(path)`` are asked first; they look at the file's content.
A module may use a library that a damaged file can crash, or that unpacks data. It names such libraries in ``APART``,
and then runs in a process of its own; a function ``extra_libraries(path)`` may name more that one file needs. A module
that reads a truncated file to its last complete row has ``lost_end(path)``, which says what is missing. Another
package brings such a module as an entry point of ``pellucid.readers``.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

from ..._errors import DamagedRowsWarning, PellucidError, PluginError, RecordingError, TruncatedFileWarning
from ..._given import require_path
from ..._plugins import load_plugins, require_attributes
from ..name_evidence import words_of
from ..stated_units import unit_from_text
from ._caps import require_few_columns, require_file_size, require_short_names
from ._columns import Columns
from ._publishers import with_own_rows
from ._runs import with_own_runs
from ._split_stamps import with_whole_stamps
from ._unread_formats import UNREAD_FORMATS

MAX_SNIFFED_BYTES = 4096
"""Number of first bytes that identify the format of a file with an unknown ending."""


DESCRIBING_STEMS = frozenset({"readme", "license", "licence", "notice", "citation", "changelog", "attribution"})
"""Words of names of files that describe recordings, such as ORIGINAL_README.txt."""

MIN_SNIFFED_NUMBERS = 8
"""A file with an unknown ending is a table of text if its beginning holds at least so many numbers."""


@cache
def readers_by_ending() -> dict[str, tuple[ModuleType, ...]]:
    """Return the readers for each file ending; those that look at the content come first."""
    found: dict[str, list[ModuleType]] = {}
    own = [
        import_module(f".{info.name}", __package__)
        for info in iter_modules([str(Path(__file__).parent)])
        if not info.name.startswith("_") and info.name != Path(__file__).stem
    ]
    plugins = load_plugins("pellucid.readers")
    for plugin in plugins:
        require_attributes(plugin, "pellucid.readers", "ENDINGS", "read")
    # A module of this package without ENDINGS reads files of models, not recordings.
    for module in (*own, *(plugin.value for plugin in plugins)):
        for ending in getattr(module, "ENDINGS", ()):
            _require_choice(ending, module, found.get(ending, []))
            found.setdefault(ending, []).append(module)
    return {
        ending: tuple(sorted(modules, key=lambda m: not hasattr(m, "recognises"))) for ending, modules in found.items()
    }


def _require_choice(ending: str, module: ModuleType, others: Sequence[ModuleType]) -> None:
    """PluginError if neither a reader nor another one of the same ending looks at the content of a file."""
    undecided = [other for other in others if not hasattr(other, "recognises")]
    if undecided and not hasattr(module, "recognises"):
        raise PluginError(
            f'{module.__name__}: found the ending "{ending}", which {undecided[0].__name__} reads too; expected a '
            "function recognises(path) that looks at the content"
        )


def _is_text(path: Path) -> bool:
    """Whether a file's beginning is text with numbers in it, as a table's is, and no source, page or model."""
    with path.open("rb") as file:
        head = file.read(MAX_SNIFFED_BYTES)
    if not head.strip() or b"\0" in head or head.lstrip()[:1] in (b"<", b"{", b"["):
        return False
    text = head.decode("utf-8", errors="replace")
    words = text.split()
    numbers = sum(any(c.isdigit() for c in word) for word in words)
    return numbers >= MIN_SNIFFED_NUMBERS and 2 * numbers >= len(words) and text.count("\ufffd") < 0.02 * len(text)


def needs_process(path: Path) -> bool:
    """Return whether a file of this ending may be read in a process of its own, which takes long to start."""
    return any(hasattr(reader, "APART") for reader in readers_by_ending().get(path.suffix.lower(), ()))


def read_columns(path: str | os.PathLike) -> Columns:
    """Return the columns of a file, as `read` does, without a warning about a truncated one."""
    path = require_path(path, "read: path")
    if not path.is_file():
        raise RecordingError(f"{path}: no such file")
    require_file_size(path)
    readers = readers_by_ending().get(path.suffix.lower())
    if readers is None and path.suffix.lower() in UNREAD_FORMATS:
        kind, instead = UNREAD_FORMATS[path.suffix.lower()]
        raise RecordingError(
            f'{path.name}: found the ending "{path.suffix}", {kind}, which Pellucid does not read; export instead '
            f"{instead}"
        )
    if readers is None and _is_text(path):
        # A log may have any ending, or none.
        readers = tuple(readers_by_ending()[".dat"])
    if readers is None:
        raise RecordingError(
            f'{path.name}: found the ending "{path.suffix}", expected one of {", ".join(sorted(readers_by_ending()))}'
        )
    try:
        reader = next((r for r in readers[:-1] if r.recognises(path)), readers[-1])
        if hasattr(reader, "APART"):
            from ._apart import read_apart

            columns = read_apart(reader.__name__, path)
        else:
            columns = reader.read(path)
    except PellucidError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: not readable: {error}") from error
    except Exception as error:  # parsing unexpected bytes may raise anything
        raise RecordingError(f"{path.name}: not readable, truncated or damaged: {error!r}") from error
    require_few_columns(path, len(columns.values))
    require_short_names(path, columns.values)
    columns = with_own_runs(with_own_rows(with_whole_stamps(columns)))
    if any(unit_from_text(unit) not in (None, unit) for unit in columns.units.values()):
        columns = replace(columns, units={name: unit_from_text(u) or u for name, u in columns.units.items()})
    if all(isinstance(value, str) for value in columns.values.values()):
        first = next((f'; column "{name}": {text}' for name, text in columns.values.items()), "")
        raise RecordingError(f"{path.name}: found no numeric column{first}")
    lost = reader.lost_end(path) if hasattr(reader, "lost_end") else ""
    return replace(columns, lost=lost) if lost else columns


def describes_files(path: Path) -> bool:
    """Return whether a file describes recordings, by the first or the last word of its name."""
    words = words_of(path.stem)
    return bool(DESCRIBING_STEMS.intersection((*words[:1], *words[-1:])))


def find_lost_end(path: Path) -> str:
    """Return what a file lacks at its end because its writer was stopped; "" for a whole file, and for other formats.

    Such a file is read to its last complete row or chunk. Readers of formats whose files can be read so have a function
    of the name ``lost_end``.
    """
    of_text = readers_by_ending()[".dat"]
    readers = [r for r in readers_by_ending().get(path.suffix.lower(), of_text) if not hasattr(r, "recognises")]
    return next((r.lost_end(path) for r in readers if hasattr(r, "lost_end")), "")


def read(path: str | os.PathLike) -> Columns:
    """Read every numeric column of a recording, in the file's own units.

    Parameters
    ----------
    path : path-like
        File whose ending states its format: text (``.csv``, ``.tsv``, ``.txt``, ``.dat``), LabVIEW (``.lvm``),
        workbooks (``.xlsx``, ``.xlsm``, ``.ods``), ``.mat``, JSON (``.json``, ``.jsonl``, ``.ndjson``), HDF5 (``.h5``,
        ``.hdf5``, ``.hdf``), NumPy (``.npz``, ``.npy``), ``.parquet``, ``.feather``, OpenSim (``.sto``, ``.mot``),
        motion capture (``.c3d``, ``.trc``), amplifiers (``.edf``, ``.bdf``), ``.xdf``, robots' logs (``.mcap``,
        ``.bag``, ``.db3``). A text table may have any other ending, or none.

    Returns
    -------
    Columns
        A mapping: ``columns["name"]`` is an array of shape (n,), and ``in``, ``len``, iteration and ``to_frame()`` work
        as one expects. Streams of one file may differ in n.

    Raises
    ------
    RecordingError
        If the file is missing, empty, damaged, of a format that is not read, or holds no numbers. The message says
        what to export instead, or which extra to install.

    Warns
    -----
    DamagedRowsWarning
        If single rows of a text table do not have the columns of the others, or hold NUL bytes. They are excluded.
    TruncatedFileWarning
        If the writer of a text table or an XDF file was stopped. Everything up to the last complete row or chunk is
        read, and the warning names what is missing. A truncated file of another format is an error.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import pellucid as pl
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "swing.csv")
    ...     _ = path.write_text("t [s],q\\n0.0,0.10\\n0.1,0.12\\n")
    ...     columns = pl.read(path)
    >>> columns.names
    ('t [s]', 'q')
    >>> columns["q"]
    array([0.1 , 0.12])
    >>> columns["t"]
    array([0. , 0.1])
    >>> "q" in columns, len(columns), list(columns)
    (True, 2, ['t [s]', 'q'])
    """
    columns = read_columns(path)
    if columns.damaged:
        warnings.warn(
            f"{Path(path).name}: excluded {columns.damaged}; every other row was read", DamagedRowsWarning, stacklevel=2
        )
    if columns.lost:
        warnings.warn(
            f"{Path(path).name}: the file is truncated: found {columns.lost}; everything before it was read",
            TruncatedFileWarning,
            stacklevel=2,
        )
    return columns
