"""Export an identified study's controller as C for a microcontroller, its model for simulators, or its muscles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from ..._errors import PellucidError
from ..._printed_command import printed_commands
from ...arm.study.tree_table import TreeTable
from ...emg.study.emg_torque.emg_torque_table import EmgTorqueTable
from ...emg.study.estimator_folder import chosen_card, write_estimator_folder
from ...emg.study.subject import ENDINGS, export_subject
from ...orthosis.study.coupling.coupling_table import CouplingTable
from ...orthosis.study.worn_values import worn_values
from ...study.procedures.registry import asked
from ...study.study import Study
from ..joint_compensation import DEFAULT_PERIOD_S
from ..study.rig_instruments import rig_instruments
from ..unmeasured_drive import warn_of_unmeasured_drive
from .c_folder import HEADER_FOLDER, INCIDENT_TEMPLATE_FOLDERS, TEMPLATE_FOLDERS, template_path, write_c_folder
from .constants_file import read_constants
from .controller_values import ControllerValues
from .elbow_values import elbow_values
from .joint_values import joint_values
from .owned_folder import mark_own_folder, require_own_folder
from .simulator_folder import SIMULATOR_FILES, export_simulator_model
from .tree_folder import write_tree_folder
from .tree_values import tree_values

EXPORT_LANGUAGES = ("c",)
"""Programming languages in which a controller can be exported."""

MAX_PERIOD_S = 0.1
"""Largest accepted period of a controller [s]."""


def export(
    study: Study,
    to: str = "c",
    out: Path | None = None,
    *,
    card: str | None = None,
    slider: float | None = None,
    participant: str | None = None,
    controller: str | None = None,
    exponents: tuple[float, float] | None = None,
    load: tuple[float, float] | None = None,
    held: tuple[float, float] | None = None,
    period: float | None = None,
    probe: bool = False,
    allow_outside: bool = False,
    accept_stale: bool = False,
    overwrite: bool = False,
) -> Path:
    """Write the controller that the study's model cards make possible, ready to be compiled for a robot; or a person's
    calibrated muscles, for a program that knows muscles.

    A joint's card gives compensation of gravity and friction, the cards of an orthosis and its wearer the residual
    compensator of its zero-impedance mode, the card of a robot of several joints what carries all of them; each ends in
    the safety gate. A study that was calibrated gives its estimator of torque from EMG, which is no law and has none.

    Parameters
    ----------
    study : Study
        Identified study.
    to : str
        ``"c"``; ``"mjcf"`` or ``"urdf"`` for a model of the joint or robot in simulators; ``"osim"`` for a copy of
        the study's OpenSim model with the calibrated constants; ``"ceinms"`` for a CEINMS subject.
    out : Path or None
        Folder to create, or for muscles also a file; None for the folder ``controller``, ``mjcf``, ``urdf``, or
        ``subject`` for muscles, in the study's folder.
    card : str or None
        File name of a joint's or of muscles' card in the study's models folder; None for the best one, or for the one
        with most joints.
    slider : float or None
        Position of the carriage, for a joint that has one [m]; None for the middle of its rail.
    participant : str or None
        For an orthosis, the wearer whose cards are used; None if there is only one. For a controller led by EMG, the
        wearer.
    controller : str or None
        For a joint with a carriage, a name of `ELBOW_CONTROLLERS`; None for gravity and friction alone. For a robot
        with several joints ``"full"``, ``"carried"`` or ``"transparent"``; None for ``"carried"``. For torque from EMG
        ``"hill"`` or ``"ridge"``; None for muscles if there are any.
    exponents : tuple of float or None
        Exponents k of equation 8, upwards and downwards, for "fc" and "pcfr"; None for the paper's.
    load, held : tuple of float or None
        For a controller of a joint with a carriage that carries one coherent body: a load that is fastened to the
        robot, and one in the wearer's hand, each as mass [kg] and distance from the axis [m]; None for none.
    period : float or None
        Period of the controller [s]; None for 1 ms, or for that of the recordings of an orthosis, of EMG, or of a
        CEINMS subject.
    probe : bool
        Whether a small wave of effort asks drive and encoder while a law of one joint runs, so that a drive that does
        not measure its effort is watched too. The study's instruments may say so as well.
    allow_outside : bool
        Whether `card` may lie outside the study's folder.
    accept_stale : bool
        Whether a card may be exported that was made from an earlier state of the study, or from another study.
    overwrite : bool
        Whether files may be replaced that this export did not write.

    Returns
    -------
    Path
        The folder, or the file of muscles.

    Raises
    ------
    PellucidError
        If `to` is not known, a card is missing, outside or stale, the study has no controller that can be exported, or
        the folder holds another one.

    Examples
    --------
    Export the controller of an identified study:

    >>> import pellucid as pl
    >>> folder = pl.export(pl.open("my-elbow"))
    >>> folder.name
    'controller'
    """
    if accept_stale:
        study = replace(study, accept_stale=True)
    asks = probe or None
    if to in ENDINGS:
        given = {"slider": slider, "participant": participant, "controller": controller, "exponents": exponents,
                 "load": load, "held": held}  # fmt: skip
        _require_none(f"export to {to} of {study.name}", {**given, "probe": asks}, "muscles have none")
        return export_subject(study, to, out, card=card, period=period, overwrite=overwrite)
    if to in SIMULATOR_FILES:
        given = {"slider": slider, "participant": participant, "controller": controller, "exponents": exponents,
                 "load": load, "held": held, "period": period, "probe": asks}  # fmt: skip
        _require_none(f"export to {to} of {study.name}", given, "a model for simulators has none")
        return export_simulator_model(study, to, out, card=card, allow_outside=allow_outside, overwrite=overwrite)
    place = study.place("controller") if out is None else Path(out)
    if study.find_table(TreeTable) is not None:
        refused = {"slider": slider, "participant": participant, "exponents": exponents, "load": load, "held": held}
        why = "this robot has several joints"
        _require_language(study, to, period, refused={**refused, "probe": asks}, why=why)
        tree = tree_values(
            study, card=card, controller=controller, period=DEFAULT_PERIOD_S if period is None else period,
            allow_outside=allow_outside, instruments=[rig_instruments(joint) for joint in study.rig.joints],
        )  # fmt: skip
        with _own_folder(place, study, controller or "carried", tree.cards, overwrite=overwrite):
            return write_tree_folder(study.name, tree, place)
    if _exports_estimator(study, card):
        refused = {"slider": slider, "exponents": exponents, "load": load, "held": held}
        _require_language(study, to, period, refused={**refused, "probe": asks}, why="torque from EMG has none")
        found = chosen_card(
            study, card=card, controller=controller, participant=participant, allow_outside=allow_outside
        )
        with _own_folder(place, study, "torque from EMG", (f"{found.name}.json",), overwrite=overwrite):
            return write_estimator_folder(study.name, found, place, period=period)
    law_values = values_for(
        study, to, card=card, slider=slider, participant=participant, controller=controller, exponents=exponents,
        load=load, held=held, period=period, allow_outside=allow_outside,
    )  # fmt: skip
    if probe:
        law_values = replace(law_values, instruments=replace(law_values.instruments, probe=True))
        if not law_values.supervised.supervision["probe_effort"] > 0.0:
            _require_none(f"export of {study.name}", {"probe": asks}, "a law that drives a spring has none")
    worn = study.find_table(CouplingTable) is not None  # its wearer is named by the cards
    named = controller or ("residual compensator" if worn else "compensation")
    with _own_folder(
        place, study, named, law_values.cards, participant=None if worn else participant, overwrite=overwrite
    ):
        return write_c_folder(study.name, law_values, place)


def warn_of_export(folder: Path) -> str:
    """Return what the supervisor in an exported `folder` does not find without a measurement of the drive.

    The text is empty if the drive is measured, and for a folder without the supervisor of one joint.
    """
    try:
        numbers = read_constants(folder)
    except PellucidError:
        return ""
    return "" if numbers["drive_expected"] == 1.0 else warn_of_unmeasured_drive()


@contextmanager
def _own_folder(
    place: Path, study: Study, controller: str, cards: Sequence[str], *, participant: str | None = None, overwrite: bool
) -> Iterator[None]:
    """Refuse a folder that holds another controller or other files, and mark it after this controller is written."""
    owner = {
        "controller": controller,
        "participant": participant or "",
        "study": study.name,
        "cards": ", ".join(cards),
    }
    templates = (*TEMPLATE_FOLDERS, *INCIDENT_TEMPLATE_FOLDERS)
    names = {Path(template_path(name)).parts[0] for name in templates} | {Path(HEADER_FOLDER).parts[0]}
    require_own_folder(place, owner, names, overwrite=overwrite)
    yield
    mark_own_folder(place, owner)


def _exports_estimator(study: Study, card: str | None) -> bool:
    """Return whether the estimator of torque from EMG is requested: by its card, or if the study has nothing else."""
    if study.find_table(EmgTorqueTable) is None:
        return False
    return not asked(study, "identify") or (card is not None and Path(card).name.startswith("emg_"))


def _require_language(
    study: Study, to: str, period: float | None, *, refused: Mapping[str, object] | None = None, why: str = ""
) -> None:
    """Raise a PellucidError for an unknown language, an impossible period, or settings that the study cannot use."""
    if to not in EXPORT_LANGUAGES:
        known = " or ".join(f'"{each}"' for each in (*EXPORT_LANGUAGES, *ENDINGS, *SIMULATOR_FILES))
        raise PellucidError(f'export: found to = "{to}", expected {known}')
    if period is not None and not 0.0 < period <= MAX_PERIOD_S:
        raise PellucidError(f"export: found a period of {period:g} s, expected one above 0 and up to 0.1 s")
    _require_none(f"export of {study.name}", refused or {}, why)


def _require_none(where: str, refused: Mapping[str, object], why: str) -> None:
    for name, given in refused.items():
        if given is not None:
            raise PellucidError(f"{where}: found {name}, expected none: {why}")


def values_for(
    study: Study,
    to: str = "c",
    *,
    card: str | None = None,
    slider: float | None = None,
    participant: str | None = None,
    controller: str | None = None,
    exponents: tuple[float, float] | None = None,
    load: tuple[float, float] | None = None,
    held: tuple[float, float] | None = None,
    period: float | None = None,
    allow_outside: bool = False,
) -> ControllerValues:
    """Return the numbers that `export` writes."""
    _require_language(study, to, period)
    if not asked(study, "identify"):
        others = tuple(dict.fromkeys(procedure.command for procedure in asked(study)))
        raise PellucidError(
            f"export of {study.name}: found no [rig.drive], expected the study of a joint or of an orthosis; "
            f"for this one there is: {printed_commands(others, study.folder)}"
        )
    if study.find_table(CouplingTable) is not None:
        if any(given is not None for given in (card, slider, controller, exponents, load, held)):
            raise PellucidError(f"export of {study.name}: found a joint's card, carriage or controller, expected none")
        return worn_values(study, participant=participant, period=period)
    if controller is not None and controller != "compensation":
        if card is not None:
            raise PellucidError(f"export of {study.name}: found a card and a controller, expected one of them")
        given = {"slider": slider, "participant": participant, "exponents": exponents, "load": load, "held": held}
        return elbow_values(study, controller, **given, period=period)
    if participant is not None:
        raise PellucidError(f"export of {study.name}: found a participant, expected none: nobody wears this joint")
    if exponents is not None:
        raise PellucidError(f"export of {study.name}: found exponents without a controller, expected fc or pcfr")
    if load is not None or held is not None:
        raise PellucidError(
            f"export of {study.name}: found a load without a controller, expected one that carries a body"
        )
    given = {} if period is None else {"period": period}
    return joint_values(study, card=card, slider=slider, allow_outside=allow_outside, **given)
