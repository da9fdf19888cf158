"""Exporters of products in C, which run with a period.

Exporters of the controllers of one joint, and of a robot of several joints.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import ClassVar, cast

from ..._errors import PellucidError
from ...study.answer import Answer, Step
from ...study.exporter import HEADER_FOLDER, OUTPUT_FILE, Exporter, ExportRequest
from ...study.procedures.procedure import typed_commands
from ...study.procedures.registry import asked
from ...study.study import Study
from ...study.study_file import RigJoint
from ..joint_compensation import DEFAULT_PERIOD_S
from ..study.rig_instruments import rig_instruments
from ..supervisor_faults import describe_drive_watch
from .c_folder import (
    INCIDENT_TEMPLATE_FOLDERS,
    TEMPLATE_FOLDERS,
    mark_own_folder,
    read_constants,
    read_effort_unit,
    read_owner,
    require_own_folder,
    template_path,
    write_c_folder,
)
from .controller_values import ControllerValues, joint_values, largest_weight, protect_wearer, tree_values
from .elbow_values import elbow_values
from .fmu import FMI_VERSIONS, describe_unit, read_unit_constants, read_unit_effort_unit, require_own_file, write_fmu
from .ros2_package import C_FOLDER, describe_package, package_name, package_paths, write_ros2_package
from .tree_folder import write_tree_folder

MAX_PERIOD_S = 0.1
"""Largest accepted period of a controller [s]."""


@dataclass(frozen=True)
class LawTarget:
    """What a law of one joint can be written as: its place by default, how it is written, and its description."""

    default_place: str  # in the study's folder
    write: Callable[[ExportRequest, ControllerValues, Path, dict[str, str]], Path]
    read_constants: Callable[[Path], dict[str, float]]  # numbers of the law and the supervisor in what was written
    read_effort_unit: Callable[[Path], str]  # unit of those of them that are efforts
    describe: Callable[[Path], str] | None = None  # None for C, which `pellucid export` measures


def _write_c(request: ExportRequest, law: ControllerValues, out: Path, owner: dict[str, str]) -> Path:
    with own_folder(out, owner, overwrite=request.overwrite):
        return write_c_folder(request.study.name, law, out)


def _write_fmu(request: ExportRequest, law: ControllerValues, out: Path, owner: dict[str, str]) -> Path:
    fmi = FMI_VERSIONS[0] if request.fmi is None else request.fmi
    if fmi not in FMI_VERSIONS:
        raise PellucidError(f"export of {request.study.name}: found fmi = {fmi}, expected 3 or 2")
    require_own_file(out, owner, overwrite=request.overwrite)
    return write_fmu(request.study.name, law, out, name=owner["controller"], owner=owner, fmi=fmi)


def _write_ros2(request: ExportRequest, law: ControllerValues, out: Path, owner: dict[str, str]) -> Path:
    controller, joint = owner["controller"], request.study.rig.joint
    paths = [C_FOLDER, *package_paths(package_name(controller)).values()]
    with own_folder(out, owner, paths, overwrite=request.overwrite):
        return write_ros2_package(request.study.name, law, out, controller=controller, joint=joint)


LAW_TARGETS: Mapping[str, LawTarget] = {
    "c": LawTarget("controller", _write_c, read_constants, read_effort_unit),
    "fmu": LawTarget("controller.fmu", _write_fmu, read_unit_constants, read_unit_effort_unit, describe_unit),
    "ros2_control": LawTarget(
        "ros2_control", _write_ros2, lambda place: read_constants(place / C_FOLDER),
        lambda place: read_effort_unit(place / C_FOLDER), describe_package,
    ),
}
"""What a law of one joint can be written as, by the value of `to`."""


class ControllerExporter(Exporter):
    """A product in C, which runs with a period."""

    kinds: ClassVar[tuple[str, ...]] = tuple(LAW_TARGETS)
    written: ClassVar[tuple[str, ...]] = ("c",)  # those of them that this product can be written as
    question: ClassVar[str] = "Can this controller be exported, and what does it protect from?"

    def place(self, request: ExportRequest) -> str:
        """Return how an error message names a request."""
        return f"export of {request.study.name}"

    def require_options(self, request: ExportRequest) -> None:
        """Raise a PellucidError for an impossible period too."""
        period = request.period
        if period is not None and not 0.0 < period <= MAX_PERIOD_S:
            raise PellucidError(f"export: found a period of {period:g} s, expected one above 0 and up to 0.1 s")
        if request.to not in self.written:
            raise PellucidError(
                f'export of {request.study.name}: found to = "{request.to}", expected "c": only a law of one joint is '
                f"written as {request.to}"
            )
        if request.fmi is not None and request.to != "fmu":
            raise PellucidError(f'export of {request.study.name}: found fmi, expected none: it belongs to to = "fmu"')
        super().require_options(request)

    def next_step(self, request: ExportRequest, place: Path) -> Step:
        """Return what to do with what was written: compile it, where this machine could."""
        text = f"Read {place / 'README.md'}"
        if not (place / OUTPUT_FILE).is_file():
            return Step(f"{text}. Not compiled: that needs make, a C and a C++ compiler")
        return Step(f"{text}, then compile and test it", line=f"make -C {quote(str(place))} check")

    def written_cards(self, place: Path) -> tuple[str, ...]:
        """Return the file names of the cards that a folder was exported from; empty if it does not name them."""
        return tuple(filter(None, (read_owner(place) or {}).get("cards", "").split(", ")))

    def folder(self, request: ExportRequest) -> Path:
        """Return the folder to write to."""
        return request.study.place("controller") if request.out is None else Path(request.out)


class LawExporter(ControllerExporter):
    """A control law of one joint."""

    written: ClassVar[tuple[str, ...]] = tuple(LAW_TARGETS)
    default_name: ClassVar[str]
    """Name of the law if the request names none."""

    named_by_cards: ClassVar[bool] = False
    """Whether the cards name the wearer."""

    @abstractmethod
    def values(self, request: ExportRequest) -> ControllerValues:
        """Return the numbers of the law."""

    def require_options(self, request: ExportRequest) -> None:
        """Raise a PellucidError too if the study identifies nothing that a law could be made of."""
        super().require_options(request)
        study = request.study
        if not asked(study, "identify"):
            others = tuple(dict.fromkeys(procedure.command for procedure in asked(study)))
            raise PellucidError(
                f"export of {study.name}: found no [rig.drive], expected the study of a joint or of an orthosis; "
                f"for this one there is: {typed_commands(others, study.folder)}"
            )

    def make_answer(self, request: ExportRequest, place: Path) -> Answer:
        """Return the answer, with what the supervisor of the written law detects of a drive's faults."""
        target = LAW_TARGETS[request.to]
        numbers = target.read_constants(place)
        is_measured, probes = numbers["drive_expected"] == 1.0, numbers["probe_effort"] > 0.0
        watch = describe_drive_watch(numbers, target.read_effort_unit(place))
        doubts = (
            "" if is_measured or probes else "limited fault detection",
            "cannot hold the joint everywhere" if largest_weight(numbers) > numbers["effort_limit"] else "",
        )
        qualifier = ", ".join(filter(None, doubts))
        return replace(super().make_answer(request, place), said=watch.said, details=watch.details, qualifier=qualifier)

    def next_step(self, request: ExportRequest, place: Path) -> Step:
        """Return what to do with what was written; the file of a unit holds its README."""
        describe = LAW_TARGETS[request.to].describe
        return super().next_step(request, place) if describe is None else Step(describe(place))

    def export(self, request: ExportRequest) -> Path:
        """Write the law as what the request asks for."""
        study, target = request.study, LAW_TARGETS[request.to]
        out = study.place(target.default_place) if request.out is None else Path(request.out)
        law = protect_wearer(
            self.values(request), probe=request.probe, unmeasured=request.unmeasured, place=f"export of {study.name}"
        )
        named = request.controller or self.default_name
        wearer = None if self.named_by_cards else request.participant
        return target.write(request, law, out, owner_of(study, named, law.cards, participant=wearer))


def owner_of(study: Study, controller: str, cards: Sequence[str], *, participant: str | None = None) -> dict[str, str]:
    """Return what marks an export of this controller as its own."""
    return {
        "controller": controller,
        "participant": participant or "",
        "study": study.name,
        "cards": ", ".join(cards),
    }


C_PATHS = (*map(template_path, (*TEMPLATE_FOLDERS, *INCIDENT_TEMPLATE_FOLDERS)), HEADER_FOLDER)
"""Paths of the files and folders of a controller in C."""


@contextmanager
def own_folder(
    place: Path, owner: dict[str, str], paths: Iterable[str] = C_PATHS, *, overwrite: bool
) -> Iterator[None]:
    """Refuse a folder that holds another controller or other files, and mark it after this controller is written.

    `paths` are those of the files that are written.
    """
    require_own_folder(place, owner, {Path(path).parts[0] for path in paths}, overwrite=overwrite)
    yield
    mark_own_folder(place, owner)


class JointExporter(LawExporter):
    """Compensation of one joint, with or without a carriage."""

    order: ClassVar[int] = 40
    default_name: ClassVar[str] = "compensation"

    def values(self, request: ExportRequest) -> ControllerValues:
        """Return the numbers of the law."""
        study, period = request.study, request.period
        if request.controller not in (None, "compensation"):
            if request.card is not None:
                raise PellucidError(f"export of {study.name}: found a card and a controller, expected one of them")
            return elbow_values(
                study, request.controller, slider=request.slider, participant=request.participant,
                exponents=request.exponents, load=request.load, held=request.held, period=period,
            )  # fmt: skip
        if request.participant is not None:
            raise PellucidError(f"export of {study.name}: found a participant, expected none: the joint is not worn")
        if request.exponents is not None:
            raise PellucidError(f"export of {study.name}: found exponents without a controller, expected fc or pcfr")
        if request.load is not None or request.held is not None:
            raise PellucidError(
                f"export of {study.name}: found a load without a controller, expected one that carries a body"
            )
        given = {} if period is None else {"period": period}
        return joint_values(
            study, card=request.card, slider=request.slider, allow_outside=request.allow_outside, **given
        )


class ArmExporter(ControllerExporter):
    """A controller that carries a robot of several joints."""

    order: ClassVar[int] = 10
    unused: ClassVar[tuple[str, ...]] = ("slider", "participant", "exponents", "load", "held", "probe", "unmeasured")
    why_unused: ClassVar[str] = "this robot has several joints"

    def fits(self, request: ExportRequest) -> bool:
        """Return whether the study is of a robot of several joints."""
        return request.study.has_table("tree")

    def describe(self, request: ExportRequest, place: Path) -> str:
        """Return of which drives the supervisor compares effort and command."""
        joints = cast(tuple[RigJoint, ...], request.study.rig.joints)
        lacking = [joint.joint for joint in joints if not rig_instruments(joint).drive]
        said = f"The supervisor watches {len(joints)} joints"
        if not lacking:
            return f"{said}, and compares the measured effort of each drive with its command"
        which = "No drive is" if len(lacking) == len(joints) else f"The drives of {', '.join(lacking)} are not"
        return (
            f"{said}. {which} measured: it detects a dead, stuck, reversed or too strong drive only by the motion that "
            "the drive causes"
        )

    def export(self, request: ExportRequest) -> Path:
        """Write the folder of the controller."""
        study, out = request.study, self.folder(request)
        tree = tree_values(
            study, card=request.card, controller=request.controller,
            period=DEFAULT_PERIOD_S if request.period is None else request.period,
            allow_outside=request.allow_outside, instruments=[rig_instruments(joint) for joint in study.rig.joints],
        )  # fmt: skip
        with own_folder(out, owner_of(study, request.controller or "carried", tree.cards), overwrite=request.overwrite):
            return write_tree_folder(study.name, tree, out)
