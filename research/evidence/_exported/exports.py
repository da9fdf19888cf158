"""Exports of the documented path, compiled by their own Makefile and linked with the foreign plant."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import pellucid
from pellucid.controllers.control_law import LAWS as LAW_KINDS
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.export.c_folder import numbers_in, write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues, protect_wearer
from pellucid.controllers.export.export import values_for
from pellucid.controllers.instruments import Instruments
from pellucid_lab.safety.worn_robot import LAWS

from .leg_logs import DRIVE_LIMIT_NM as LEG_DRIVE_LIMIT_NM
from .leg_logs import write_leg_logs

HERE = Path(__file__).parent
"""Folder of the plant's source."""

NO_LIMIT = 1e30
"""A number from here on stands for no limit: a float has no larger ones to spare."""

PARTICIPANT_NAME = "P1"
"""Participant of the elbow's study, whose mass and height the laws led by EMG take."""

PARTICIPANT_MASS_KG = 64.0
"""Mass of that participant."""

PARTICIPANT_HEIGHT_M = 1.75
"""Height of that participant."""

ELBOW_DRIVE_LIMIT_NM = 13.44
"""Largest effort of the elbow's drive: 8 A, 0.06 N m/A and a ratio of 28, as its study states them."""

FORCE_SENSOR_RANGE_NM = 25.0
"""Range of the elbow's force sensor."""

UNMEASURED = Instruments(drive_limit=ELBOW_DRIVE_LIMIT_NM)
"""Instruments of an export whose study states the drive and no instruments: a probe asks the drive."""

TO_AND_FRO = replace(UNMEASURED, shaking=False)
"""The same where the study states that wearers go back and forth: no check for sustained oscillation."""

BLIND = replace(TO_AND_FRO, probe=False)
"""The same where a probe was refused, too: `--no-probe --unmeasured`."""

DRIVE_MEASURED = Instruments(drive=True, drive_limit=ELBOW_DRIVE_LIMIT_NM, force_range=FORCE_SENSOR_RANGE_NM)
"""Instruments of an elbow whose drive measures its current by a sensor that it does not regulate on."""

MEASURED_TO_AND_FRO = replace(DRIVE_MEASURED, shaking=False)
"""The same where the study states that wearers go back and forth."""

MEASURED_AND_PROBED = replace(DRIVE_MEASURED, probe=True)
"""Instruments of an elbow whose drive measures its current, and which probes."""

INSTRUMENT_SETS: Mapping[str, Instruments] = {
    "unmeasured": UNMEASURED, "drive_measured": DRIVE_MEASURED, "blind": BLIND,
    "drive_measured_and_probe": MEASURED_AND_PROBED, "to_and_fro": TO_AND_FRO,
    "drive_measured_to_and_fro": MEASURED_TO_AND_FRO,
}  # fmt: skip
"""Instruments by the name that the rows have."""

RIG_EXPORTS: Mapping[str, tuple[str, ...]] = {
    "able-elbow": (), "bench-joint": (), "knee-orthosis": ("--participant", "S1"),
}  # fmt: skip
"""Options of the default export of each virtual rig with one joint."""

DATASET_EXPORTS: tuple[str, ...] = ("bam_servo", "emps", "bam_xl330", "sydney_pendulum")
"""Data sets with one joint that have a default export; only the first comes with Pellucid."""

LEG = "worn-leg"
"""Name of the study of a heavy hip robot, which begins with log files."""

LIMBS: Mapping[str, str] = {"able-elbow": "forearm", "knee-orthosis": "shank", LEG: "leg"}
"""Limbs of those who wear the robots of studies; every other law of `LAWS` is the elbow's."""

LEG_LOG_SEED = 20261101
"""Seed of the logs from which the leg is identified."""

MEMORY_MAP_SOURCE = """// Where parts of this controller lie: the one file that knows the core, and no plant.
#include "exported_law.hpp"
#include "pellucid_constants.h"

#include <pellucid/{header}>
#include <pellucid/supervisor.hpp>

namespace foreign {{
const pellucid_config& exported_config() {{ return pellucid_identified; }}
MemoryMap memory_map() {{
  static pellucid::Supervised<pellucid::{type}<float>> s;
  const auto at = [](const void* part) {{
    return static_cast<std::size_t>(static_cast<const char*>(part) - reinterpret_cast<const char*>(&s));
  }};
  return {{at(&s.controller.law), sizeof s.controller.law, at(&s.supervisor), sizeof s.supervisor,
          at(&s.state.doing.word), at(&s.controller.state), at(&s.state.test.middle)}};
}}
}}  // namespace foreign
"""
"""Source of the link between one export and the plant."""


@dataclass(frozen=True)
class ExportedLaw:
    """One exported folder, compiled and linked with the foreign plant."""

    name: str  # the controller's name, or the study's
    instruments: str  # name in `INSTRUMENT_SETS`
    program: Path  # the compiled program
    numbers: Mapping[str, float]  # every number that pellucid_constants.h has, SI
    identified: Mapping[str, float]  # numbers of the robot as its card has them, without a margin, SI
    uses: frozenset[str]  # optional sensors that the law makes use of
    limb: str  # "forearm", "shank" or "leg" of the wearer; "" for a machine that nobody wears
    motion: str  # "rotary" or "prismatic"
    spring: bool  # whether the drive acts through a spring

    @property
    def worn(self) -> bool:
        """Whether somebody wears the machine."""
        return self.limb != ""

    @property
    def stops_oscillation(self) -> bool:
        """Whether the supervisor takes the power off a joint that goes back and forth."""
        return self.numbers["shaking_limit"] < NO_LIMIT


def command(*words: str | Path, folder: Path) -> None:
    """Run a command of Pellucid as the documents have it."""
    code = "import sys; from pellucid.cli import main; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", code, *map(str, words)], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        raise AssertionError(f"pellucid {' '.join(map(str, words))}: {done.stderr[-400:]}")


def rig_study(rig: str, folder: Path) -> Path:
    """Return a study of a virtual rig that was simulated and identified by the documented commands."""
    command("init", rig, "--rig", rig, folder=folder)
    command("simulate", rig, folder=folder)
    study_file = folder / rig / "study.toml"
    if rig == "able-elbow":
        text = study_file.read_text(encoding="utf-8")
        person = f'mass = "{PARTICIPANT_MASS_KG} kg"\nheight = "{PARTICIPANT_HEIGHT_M} m"'
        text = text.replace("[channels]", f"[participants.{PARTICIPANT_NAME}]\n{person}\n\n[channels]", 1)
        study_file.write_text(text, encoding="utf-8")
    command("identify", rig, folder=folder)
    return folder / rig


def dataset_study(name: str, folder: Path) -> Path:
    """Return a study of a public data set that was identified by the documented commands."""
    command("init", name, "--dataset", name, folder=folder)
    command("identify", name, folder=folder)
    return folder / name


def leg_study(folder: Path) -> Path:
    """Return a study of a heavy hip robot that was proposed from files and identified by the documented commands."""
    command("init", LEG, "--from", *write_leg_logs(folder / "leg-logs", LEG_LOG_SEED), folder=folder)
    command("identify", LEG, folder=folder)
    return folder / LEG


class Exports:
    """The elbow's laws, the leg's and the default exports of all studies, made once in a folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._made: dict[tuple[str, str], ExportedLaw] = {}

    @cached_property
    def elbow(self) -> Path:
        """Folder of the elbow's identified study."""
        return rig_study("able-elbow", self.folder)

    @cached_property
    def elbow_constants(self) -> str:
        """Text of pellucid_constants.h of the elbow's default export."""
        out = self.folder / "elbow-default"
        command("export", self.elbow, "--out", out, folder=self.folder)
        return (out / "pellucid_constants.h").read_text(encoding="utf-8")

    def law(self, name: str, instruments: str) -> ExportedLaw:
        """Return a law of `LAWS` as `export` writes it for the elbow, with instruments of `INSTRUMENT_SETS`."""
        if (name, instruments) not in self._made:
            worn_by = {}
            if name in ELBOW_CONTROLLERS and ELBOW_CONTROLLERS[name].wearer:
                worn_by["participant"] = PARTICIPANT_NAME
            values = values_for(pellucid.open(self.elbow), controller=name, **worn_by)
            values = replace(values, instruments=INSTRUMENT_SETS[instruments])
            values = protect_wearer(values, unmeasured=instruments == "blind")
            out = write_c_folder("elbow", values, self.folder / f"{name}-{instruments}")
            self._made[name, instruments] = self._compiled(name, instruments, out, values, self.elbow_constants)
        return self._made[name, instruments]

    @cached_property
    def leg_study(self) -> Path:
        """Folder of the leg's identified study."""
        return leg_study(self.folder)

    def leg(self, instruments: str) -> ExportedLaw:
        """Return the leg's law as `export` writes it by default, with instruments of `INSTRUMENT_SETS`."""
        if (LEG, instruments) not in self._made:
            values, given = values_for(pellucid.open(self.leg_study)), INSTRUMENT_SETS[instruments]
            values = replace(values, instruments=replace(given, drive_limit=LEG_DRIVE_LIMIT_NM, force_range=math.inf))
            values = protect_wearer(values)
            out = write_c_folder(LEG, values, self.folder / f"{LEG}-{instruments}")
            text = (out / "pellucid_constants.h").read_text(encoding="utf-8")
            self._made[LEG, instruments] = self._compiled(LEG, instruments, out, values, text)
        return self._made[LEG, instruments]

    def default(self, study: str) -> ExportedLaw:
        """Return the default export of a rig of `RIG_EXPORTS` or of a data set, by the documented command."""
        if (study, "default") not in self._made:
            if study == "able-elbow":
                made = self.elbow
            elif study in RIG_EXPORTS:
                made = rig_study(study, self.folder)
            else:
                made = dataset_study(study, self.folder)
            out, options = self.folder / f"{study}-default", RIG_EXPORTS.get(study, ())
            command("export", made, "--out", out, *options, folder=self.folder)
            given = {options[0].removeprefix("--"): options[1]} if options else {}
            values = values_for(pellucid.open(made), **given)
            text = (out / "pellucid_constants.h").read_text(encoding="utf-8")
            self._made[study, "default"] = self._compiled(study, "unmeasured", out, values, text)
        return self._made[study, "default"]

    def _compiled(
        self, name: str, instruments: str, folder: Path, values: ControllerValues, robot_text: str
    ) -> ExportedLaw:
        numbers, _ = read_constants((folder / "pellucid_constants.h").read_text(encoding="utf-8"))
        _, identified = read_constants(robot_text)
        kind = LAW_KINDS[values.law]
        return ExportedLaw(
            name, instruments, compile_wearer(folder, self.folder / "objects", kind.header, kind.type,
                                              tuple(sensor.name for sensor in kind.sensors)),
            numbers, identified, values.uses, LIMBS.get(name, "forearm" if name in LAWS else ""),
            motion=values.motion, spring=kind.drives_spring,
        )  # fmt: skip


def read_constants(text: str) -> tuple[dict[str, float], dict[str, float]]:
    """Return every number of a pellucid_constants.h by name, and the same with what a remark says was identified."""
    numbers = numbers_in(text, "pellucid_constants.h")
    remarks = re.findall(r"/\* (\w+) \[[^\]]*\].*?identified as (\S+),.*\*/$", text, re.M)
    return numbers, numbers | {name: float(value) for name, value in remarks}


def compile_wearer(folder: Path, objects: Path, header: str, law: str, sensors: tuple[str, ...]) -> Path:
    """Compile an exported folder by its own Makefile, and link it with the foreign plant.

    The plant is compiled once for every interface, and the controller once for every kind of law: only the constants
    differ between exports of one kind.
    """
    objects.mkdir(exist_ok=True)
    sources = b"".join((HERE / name).read_bytes() for name in ("foreign_wearer.cpp", "foreign_wearer.hpp"))
    interface = (folder / "pellucid_controller.h").read_bytes()
    code = (folder / "pellucid_controller.cpp").read_bytes() + b"".join(
        path.read_bytes() for path in sorted((folder / "include" / "pellucid").iterdir())
    )
    controller = objects / f"controller-{sha256(interface + code).hexdigest()[:16]}.o"
    if not controller.is_file():
        subprocess.run(["make", "-s", "build/controller.o"], cwd=folder, check=True, capture_output=True)
        shutil.copy(folder / "build" / "controller.o", controller)
    flags = ["-std=c++17", "-O2", "-ffp-contract=off", f"-I{HERE}", f"-I{folder}", f"-I{folder / 'include'}"]
    flags += [f"-DFOREIGN_HAS_{name.upper()}" for name in sensors]
    plant = objects / f"plant-{sha256(interface + sources).hexdigest()[:16]}.o"
    if not plant.is_file():
        subprocess.run(["c++", *flags, "-c", str(HERE / "foreign_wearer.cpp"), "-o", str(plant)], check=True)
    link = folder / "memory_map.cpp"
    link.write_text(MEMORY_MAP_SOURCE.format(header=header, type=law), encoding="utf-8")
    program = folder / "foreign_wearer"
    subprocess.run(["c++", *flags, str(link), str(plant), str(controller), "-o", str(program)], check=True)
    return program
