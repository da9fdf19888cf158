"""The test vector of an exported co-simulation unit, played through FMPy and compared with the C export's answers."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import pellucid
from pellucid.controllers.export.fmu import FMI_VERSIONS, read_inside
from pellucid.controllers.export.replay_vector import (
    INIT_EVENT,
    MEMORY_EVENT,
    POWER_ON_EVENT,
    STOP_EVENT,
    SUPERVISOR_VARIANTS,
)
from pellucid.study.results import ResultRow

LAWS = ("fc", "transparent", "clpc", "pcfr")
"""Controllers of the elbow that are exported."""

FLIPPED_BYTE = 8 + 8 + 40 // 8
"""Byte of the unit's state with the bit that the vector's fault in the memory flips: bit 40 of the second word of the
context's storage, which follows two words of 32 bits."""

_ROW = re.compile(r"^ +\{(\d+)u, (\d)u, 0x(\w+)u, (-?\d+), \{(.*)\}\},?$", re.MULTILINE)
_SAMPLE = re.compile(r"\{0x(\w+)u, (\d+)u, (-?\d+), (\d)u\}")
_OUTPUT = re.compile(r"^ +\{ *0x(\w+)u, (\d+)u\}", re.MULTILINE)


@dataclass(frozen=True)
class Replayed:
    """Result of a replay."""

    steps: int
    wrong: int  # steps with another effort, fault, mode or enable
    step_s: float  # mean time of a step of the unit, through FMPy [s]


class PlayedUnit:
    """A unit of either version of FMI in this process, whose variables are set and read by their names."""

    def __init__(self, path: Path):
        from fmpy import extract, instantiate_fmu, read_model_description

        self.described = read_model_description(str(path))
        self.folder = extract(str(path))
        self.unit = instantiate_fmu(self.folder, self.described, "CoSimulation")
        self.variables = {v.name: v for v in self.described.modelVariables}
        self.is_fmi2 = self.described.fmiVersion == "2.0"
        self.seconds = 0.0

    def close(self) -> None:
        """Free the unit and its folder."""
        self.unit.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def put(self, name: str, value: float | int | bool) -> None:
        """Set a variable; the names are those of FMI 3.0."""
        if self.is_fmi2 and name.endswith("_us"):
            name, value = name.removesuffix("_us"), value / 1e6
        variable = self.variables[name]
        if variable.type == "Integer":  # the same 32 bits
            value = int(np.uint32(value).view(np.int32))
        getattr(self.unit, f"set{variable.type}")([variable.valueReference], [value])

    def get(self, name: str) -> float | int | bool:
        """Return the value of a variable."""
        variable = self.variables[name]
        kind = {"Enumeration": "Integer" if self.is_fmi2 else "Int64"}.get(variable.type, variable.type)
        (value,) = getattr(self.unit, f"get{kind}")([variable.valueReference])
        return int(np.int32(value).view(np.uint32)) if variable.type == "Integer" else value

    def power_on(self, **numbers: float) -> None:
        """Start again with the identified numbers and these ones instead, with stamps that are given."""
        self.unit.reset()
        self.put("stamps_given", True)
        for name, value in numbers.items():
            single = float(np.nan_to_num(np.float32(value)))
            self.put(f"config.{name}", single)
        if self.is_fmi2:
            self.unit.setupExperiment(startTime=0.0)
            self.unit.enterInitializationMode()
        else:
            self.unit.enterInitializationMode(startTime=0.0)
        self.unit.exitInitializationMode()

    def flip(self) -> None:
        """Flip the vector's bit of the memory."""
        names = ("serializeFMUstate", "deSerializeFMUstate") if self.is_fmi2 else (
            "serializeFMUState", "deserializeFMUState")  # fmt: skip
        save, load = (getattr(self.unit, name) for name in names)
        state = self.unit.getFMUState()
        changed = bytearray(save(state))
        changed[FLIPPED_BYTE] ^= 1
        state = load(bytes(changed), state)
        self.unit.setFMUState(state)
        self.unit.freeFMUState(state)

    def step(self) -> None:
        """One step, of one millisecond."""
        start = time.perf_counter()
        self.unit.doStep(0.0, 1e-3)
        self.seconds += time.perf_counter() - start


def replay(path: Path) -> Replayed:
    """Play the vector that the unit at `path` contains, and count the steps that differ from the recorded outputs."""
    steps = list(_ROW.finditer(read_inside(path, "resources/test/vector_inputs.h").decode()))
    outputs = read_inside(path, "resources/test/vector_outputs.h").decode()
    recorded = [(int(bits, 16), int(said)) for bits, said in _OUTPUT.findall(outputs)]
    played = PlayedUnit(path)
    try:
        wrong = sum(answer != known for answer, known in zip(_answers(played, steps), recorded, strict=True))
        return Replayed(len(steps), wrong, played.seconds / len(steps))
    finally:
        played.close()


def _answers(played: PlayedUnit, rows: list[re.Match]) -> Iterator[tuple[int, int]]:
    """Yield the bits of the effort, and the fault, mode and enable in a byte each, of every step."""
    names = list(dict.fromkeys(name.split(".")[0] for name in played.variables if name.endswith(".value")))
    *sensors, _, _ = names
    variants = list(SUPERVISOR_VARIANTS.values())
    effort, challenge = np.float32(0.0), 0
    for row in rows:
        before, token, drive, now = int(row[1]), int(row[2]), _float(row[3]), int(row[4])
        given = [(_float(x), int(n), int(t), v != "0") for x, n, t, v in _SAMPLE.findall(row[5])]
        if before >= POWER_ON_EVENT:
            played.power_on(**variants[before - POWER_ON_EVENT])
            effort, challenge = np.float32(0.0), 0
        if before == MEMORY_EVENT:
            played.flip()
        played.put("stop", before == STOP_EVENT)
        played.put("init", before == INIT_EVENT)
        first = given[0][1:]
        samples = dict(zip(sensors, given, strict=True))
        samples |= {"drive": (effort + drive, *first), "joint": (np.float32(0.0), *first)}
        for name, (value, sequence, stamp, valid) in samples.items():
            played.put(f"{name}.value", float(value))
            played.put(f"{name}.sequence", sequence)
            played.put(f"{name}.time_us", stamp)
            played.put(f"{name}.valid", valid)
        played.put("now_us", now)
        played.put("token", challenge if token else 0)
        played.step()
        effort, challenge = np.float32(played.get("effort")), played.get("challenge")
        said = played.get("fault") | played.get("mode") << 8 | int(played.get("enable")) << 16
        yield int(effort.view(np.uint32)), said


def rows(elbow: Path, scratch: Path) -> Iterator[ResultRow]:
    """Problems that FMPy finds, steps that differ, size and time of a step, of every law as each version of FMI."""
    from fmpy.validation import validate_fmu

    problems, wrong, sizes, times = [], 0, [], []
    for law in LAWS:
        for fmi in FMI_VERSIONS:
            path = scratch / f"{law}_{fmi}.fmu"
            pellucid.export(pellucid.open(elbow), "fmu", path, controller=law, fmi=fmi)
            problems += validate_fmu(str(path))
            played = replay(path)
            wrong += played.wrong
            sizes.append(path.stat().st_size)
            times.append(played.step_s)
    note = f"units for co-simulation of {', '.join(LAWS)}, FMI {' and '.join(map(str, FMI_VERSIONS))}"
    yield ResultRow("exports.fmu.errors", float(len(problems)), "1", "evidence", "simulated", None,
                    f"problems that FMPy finds in {note}: {'; '.join(problems) or 'none'}")  # fmt: skip
    yield ResultRow("exports.fmu.wrong_bits", float(wrong), "1", "evidence", "simulated", None,
                    f"steps of the test vector that differ from the C export, {note}")  # fmt: skip
    yield ResultRow("exports.fmu.laws", float(len(LAWS)), "1", "evidence", "simulated", None, note)
    yield ResultRow("exports.fmu.versions", float(len(FMI_VERSIONS)), "1", "evidence", "simulated", None, note)
    yield ResultRow("exports.fmu.size", max(sizes) / 1e3, "kB", "evidence", "simulated", None,
                    f"the largest, with sources and test vector, {note}")  # fmt: skip
    yield ResultRow("exports.fmu.step", 1e6 * max(times), "us", "evidence", "simulated", None,
                    f"mean time of a step, the slowest, with the time of the call from Python, {note}")  # fmt: skip


def _float(bits: str) -> np.float32:
    return np.uint32(int(bits, 16)).view(np.float32)
