"""Which module identifies what a table of study.toml asks for."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from .._errors import IdentificationError
from ..recordings.quality import Fault
from ..recordings.study import Study
from .result import Findings

_MODULES = {
    "transfer_function": "transfer_function.identify_transfer",
    "hinge": "hinge.identify_hinge",
    "coupling": "coupling.identify_coupling",
    "loaded_swing": "loaded_swing.identify_loaded_swing",
}  # each has a function of its own name, and `faults`


def run_procedure(study: Study, *, on_progress: Callable[[str, float], None] | None = None) -> Findings:
    """Identify what the study's table asks for.

    Parameters
    ----------
    study : Study
        Its study.toml has such a table, or asks only for a torque from EMG or an assessment.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Findings

    Raises
    ------
    RecordingError
        If a recording is not fit to identify from.
    IdentificationError
        If the recordings cannot carry the model, or nothing is asked of them that `identify` does.
    """
    asked = study.config.procedure
    if asked is None:
        raise IdentificationError(
            f"{study.folder}: study.toml has no [rig.drive] and asks for nothing that identify does; use: pellucid "
            f"{study.config.beyond_identify} {study.folder}"
        )
    name = _MODULES[asked]
    return getattr(import_module(f".{name}", __package__), name.partition(".")[2])(study, on_progress=on_progress)


def procedure_faults(study: Study) -> list[Fault]:
    """What is wrong with the recordings, for what the study's table asks of them.

    Parameters
    ----------
    study : Study
        Its study.toml has such a table.

    Returns
    -------
    list of Fault

    Raises
    ------
    RecordingError
        If a file cannot be read at all.
    """
    return import_module(f".{_MODULES[study.config.procedure]}", __package__).faults(study)
