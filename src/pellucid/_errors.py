"""Types of errors. Every message names the file, the channel, the finding and the expectation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any


class PellucidError(ValueError):
    """Base of every error a user can cause or meet; the command line prints it without a traceback.

    Examples
    --------
    >>> import pellucid as pl
    >>> try:
    ...     pl.identify("no-such-folder")
    ... except pl.PellucidError as error:
    ...     print("refused:", "no-such-folder" in str(error))
    refused: True
    """


class ArgumentError(PellucidError, TypeError):
    """An argument of a function has a wrong type or unit. The message names the function and the argument."""


def listed_names(names: Sequence[str], most: int) -> str:
    """Return names for a sentence, at most so many of them and the number of all others: ``a, b and 3 more``."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def missing_package(part: str, package: str, extra: str) -> PellucidError:
    """Return the error that an optional library is not installed, with the command that installs it."""
    return PellucidError(f"{part}: found no package {package}, expected it: {install_command(extra)}")


def install_command(extra: str) -> str:
    """Return the command that installs the libraries of an extra, for an installation from a clone or from a wheel."""
    from importlib.metadata import requires

    required = [line.partition(";") for line in requires("pellucid") or ()]
    libraries = [name.strip() for name, _, marker in required if re.search(rf"extra == ['\"]{extra}['\"]", marker)]
    return " ".join(["pip install", *(f'"{library}"' for library in libraries)])


def missing_compiled_package(part: str, package: str) -> PellucidError:
    """Return the error that a library is not installed, which pip would have to compile on this system."""
    return PellucidError(
        f"{part}: found no package {package}, expected it: pip install {package} (this system has no wheel of it, so "
        "that pip compiles it)"
    )


class StudyError(PellucidError):
    """A study.toml is not understood, or contradicts itself."""


class RecordingError(PellucidError):
    """A recording is missing, unreadable, or not fit to be used."""


class TruncatedFileWarning(UserWarning):
    """A file ends in the middle of a row or chunk; the part before was read."""


class DamagedRowsWarning(UserWarning):
    """Some rows of a text table are damaged and were excluded."""


class UnfitRecordingError(RecordingError):
    """Recordings were read, but `check` refuses them. The command line ends with the same status as `check`.

    `faults` are all that `check` found, as `files.fault.Fault`, where it came to its end.
    """

    def __init__(self, message: str, faults: Sequence[Any] = ()) -> None:
        super().__init__(message)
        self.faults = tuple(faults)


class DatasetError(PellucidError):
    """A public data set is unknown, or could not be found or fetched."""


class IdentificationError(PellucidError):
    """The recordings cannot carry the model that was asked for."""


class PluginError(PellucidError):
    """What another package adds cannot be loaded, or is not what its group expects."""


class MissingDistributionError(PellucidError, AttributeError):
    """A name belongs to a distribution of Pellucid that is not installed."""


LAB_DISTRIBUTION = "pellucid-lab"
"""Name of the distribution with virtual rigs and people, papers, ranking and demo."""


def missing_lab(part: str) -> MissingDistributionError:
    """Return the error that `part` needs the distribution `pellucid-lab`, with the command that installs it."""
    return MissingDistributionError(
        f"{part}: found no package {LAB_DISTRIBUTION}, expected it: pip install ./lab in the clone, "
        "or the wheel pellucid_lab-*.whl of the same version"
    )
