"""Export an identified study's controller as C for a microcontroller, its model for simulators, or its muscles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ...models.cards import LibraryCard
from ...numerics.arguments import with_checked_arguments
from ...study.exporter import ExportRequest, find_exporter
from ...study.procedures.registry import as_study
from ...study.study import Study
from .controller_exporter import LawExporter
from .controller_values import ControllerValues
from .simulator_folder import export_library_card


@with_checked_arguments
def export(
    study: Study | LibraryCard,
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
    probe: bool | None = None,
    unmeasured: bool = False,
    fmi: int | None = None,
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
    study : Study or LibraryCard
        Identified study, or a card of `pellucid.cards` for a simulator.
    to : str
        ``"c"``; ``"fmu"`` for a co-simulation unit and ``"ros2_control"`` for a ROS 2 package of a law of one joint;
        ``"mjcf"`` or ``"urdf"`` for a model of the joint or robot in simulators; ``"isaaclab"`` or ``"mjx"`` for its
        actuators with ranges; ``"osim"`` for a copy of the study's OpenSim model with the calibrated constants;
        ``"ceinms"`` for a CEINMS subject.
    out : Path or None
        Folder to create, or for muscles also a file; for a unit the file NAME.fmu. None for a place in the study's
        folder: ``controller`` for C, ``controller.fmu``, ``subject`` for muscles, and else a folder named like `to`.
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
    probe : bool or None
        Whether a wave of effort asks drive and encoder while a law of one joint runs, so that a drive that does
        not measure its effort is watched too. None: as the study's instruments say; where they say nothing, it asks if
        the drive is not measured.
    unmeasured : bool
        Whether a law may be written whose drive is neither measured nor asked. Many of its faults are then not found.
    fmi : int or None
        Version of FMI of a unit, 3 or 2; None for 3.
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
        If `to` is not known, a card is missing, outside or stale, the study has no controller that can be exported,
        the folder holds another one, or the drive is neither measured nor can be asked, without `unmeasured`.

    Examples
    --------
    Export the controller of an identified study:

    >>> import pellucid as pl
    >>> folder = pl.export(pl.open("my-elbow"))
    >>> folder.name
    'controller'
    """
    if isinstance(study, LibraryCard):
        return export_library_card(study, to, out)
    study = as_study(study, "export")
    if accept_stale:
        study = replace(study, accept_stale=True)
    request = ExportRequest(
        study, to, out, card=card, slider=slider, participant=participant, controller=controller, exponents=exponents,
        load=load, held=held, period=period, probe=probe, unmeasured=unmeasured, fmi=fmi,
        allow_outside=allow_outside, overwrite=overwrite,
    )  # fmt: skip
    return find_exporter(request).export(request)


def values_for(study: Study, **options: object) -> ControllerValues:
    """Return the numbers of the law that `export` writes with these options."""
    request = ExportRequest(study, **options)  # type: ignore[arg-type]
    exporter = find_exporter(request, LawExporter)
    assert isinstance(exporter, LawExporter)
    return exporter.values(request)
