"""The recorder beside an exported controller: no answer changes, and Python reads what it writes."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exported import Loaded, Output, Sample

from pellucid.controllers.control_law import LAWS
from pellucid.controllers.export.c_folder import write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.controllers.incident import parse_incident
from pellucid.controllers.study.incident import incident

pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is not installed"
)

STATED = {"effort_limit": 10.0, "rate_limit": 500.0, "velocity_limit": 8.0, "position_min": -2.0, "position_max": 3.0}
STATED |= {"stop_margin": 0.1, "max_age": 0.005, "max_repeats": 2.0, "period": 1e-3, "velocity_width": 0.1}
STATED |= {"stribeck_velocity": 0.1, "inertia": 0.05, "gravity_sine": 1.5, "coulomb": 0.3, "viscous": 0.2}
RECORDED_LAWS = ("joint", "position_prediction", "rules", "transparent")


class Recorder(ctypes.Structure):
    """`pellucid_incident` of the header."""

    _fields_ = (("memory", ctypes.c_void_p), ("bytes", ctypes.c_uint32))


SINK = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint32)


def values_of(law: str) -> ControllerValues:
    """A law by its defaults, with limits."""
    numbers = LAWS[law].defaults | {name: value for name, value in STATED.items() if name in LAWS[law].defaults}
    return ControllerValues(law, numbers, {}, ("card.json",), {})


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return write_c_folder("bench", values_of("joint"), tmp_path_factory.mktemp("joint") / "c")


@pytest.mark.parametrize("law", ["joint", *(pytest.param(law, marks=pytest.mark.nightly) for law in RECORDED_LAWS[1:])])
def test_no_bit_of_any_answer_depends_on_the_recorder(folder, tmp_path, law):
    """`make incident` compares every answer with those that were written down without a recorder."""
    made = folder if law == "joint" else write_c_folder("bench", values_of(law), tmp_path / "c")
    run = subprocess.run(["make", "-s", "incident"], cwd=made, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    counts = {name: int(count) for name, count in map(str.split, run.stdout.splitlines())}
    assert counts["wrong"] == 0
    assert counts["stops"] > 20
    found = incident(made / "incident.bin")
    assert (made / "incident.bin").stat().st_size == counts["bytes"]
    assert found.record.law == law
    assert found.fault == "not_finite"
    assert not np.isfinite(found.record.samples["position"][found.record.stop])


def test_every_stop_of_the_vector_can_be_written(folder):
    run = subprocess.run(["make", "-s", "incident"], cwd=folder, capture_output=True, text=True, check=True)
    stops = int(dict(map(str.split, run.stdout.splitlines()))["stops"])
    found = {}
    for number in range(1, stops + 1):
        subprocess.run(["build/play_incident", "one.bin", str(number)], cwd=folder, check=True, capture_output=True)
        account = incident(folder / "one.bin")
        found[account.fault] = account.acting.name if account.acting else None
    assert found["overspeed"] == "raw_speed"
    assert found["jump"] == "raw_acceleration"
    assert found["power"] == "power"
    assert found["ringing"] == "ringing"
    assert found["shaking"] == "shaking"
    assert found["unexplained"] == "residual_lasting"
    assert found["stopped"] is None
    assert len(found) > 12


def test_a_wrong_answer_beside_the_recorder_is_found(folder, tmp_path):
    copy = tmp_path / "c"
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("build"))
    outputs = copy / "test" / "vector_outputs.h"
    text = outputs.read_text(encoding="utf-8")
    at = text.index("{ 0x", text.index("vector_outputs[")) + len("{ 0x")
    outputs.write_text(text[: at + 7] + ("0" if text[at + 7] != "0" else "1") + text[at + 8 :], encoding="utf-8")
    run = subprocess.run(["make", "-s", "incident"], cwd=copy, capture_output=True, text=True)
    assert run.returncode != 0
    assert "wrong 1" in run.stdout


@pytest.fixture(scope="module")
def library(folder) -> Loaded:
    """Controller and recorder in this process."""
    values = values_of("joint")
    loaded = Loaded(folder, values)
    options = ["-std=c++17", "-O2", "-ffp-contract=off", "-fno-exceptions", "-fno-rtti", "-shared", "-fPIC"]
    sources = [str(folder / name) for name in ("pellucid_controller.cpp", "pellucid_incident.cpp")]
    where = [f"-I{folder / 'include'}", f"-I{folder}"]
    subprocess.run(["c++", *options, *where, *sources, "-o", str(folder / "both.so")], check=True)
    loaded.core = ctypes.CDLL(str(folder / "both.so"))
    loaded.core.pellucid_incident_init.argtypes = (Recorder, ctypes.c_uint32, ctypes.c_uint32)
    loaded.core.pellucid_incident_init.restype = ctypes.c_uint32
    loaded.core.pellucid_incident_size.restype = ctypes.c_uint32
    loaded.core.pellucid_incident_is_recorded.argtypes = (Recorder,)
    loaded.core.pellucid_incident_release.argtypes = (Recorder,)
    pointers = (ctypes.c_void_p,) * 3
    loaded.core.pellucid_incident_note.argtypes = (Recorder, *pointers)
    loaded.core.pellucid_incident_write.argtypes = (Recorder, ctypes.c_void_p, SINK, ctypes.c_void_p)
    loaded.core.pellucid_incident_write.restype = ctypes.c_uint32
    return loaded


def noted(library: Loaded, recorder: Recorder, steps: int = 60, stop_at: int = 40) -> None:
    """Some periods of a motion with a recorder, stopped by hand on the way."""
    assert library.init() == 0
    for i in range(steps):
        if i == stop_at:
            library.core.pellucid_stop(library.context)
        library.now, library.count = library.now + library.period, library.count + 1
        read = library.input_type(library.now, Sample(0.1 + 1e-3 * i, library.count, library.now - 50, 1))
        output = Output()
        library.core.pellucid_step(library.context, ctypes.byref(read), ctypes.byref(output))
        library.core.pellucid_incident_note(recorder, library.context, ctypes.addressof(read), ctypes.addressof(output))


def written(library: Loaded, recorder: Recorder, most: int = 10**9) -> tuple[int, bytes]:
    """What the recorder writes to a sink that takes `most` bytes."""
    taken = bytearray()

    def take(_: int, data: ctypes.Array, count: int) -> int:
        if len(taken) + count > most:
            return 0
        taken.extend(data[:count])
        return 1

    return library.core.pellucid_incident_write(recorder, library.context, SINK(take), None), bytes(taken)


def test_any_memory_is_stayed_within(library):
    """Sizes from nothing to 40 records, at every alignment; bytes beyond stay as they were."""
    whole = library.core.pellucid_incident_size(40)
    guard = 64
    for size in (0, 8, 100, library.core.pellucid_incident_size(1) - 1, library.core.pellucid_incident_size(1), whole):
        for offset in (0, 1, 4):
            block = (ctypes.c_uint64 * (whole // 8 + 3 * guard))()
            raw = np.ctypeslib.as_array(block).view(np.uint8)
            raw[:] = 0xA5
            begin = guard + offset
            recorder = Recorder(ctypes.addressof(block) + begin, size)
            places = library.core.pellucid_incident_init(recorder, 1, 4)
            noted(library, recorder)
            assert np.all(raw[:begin] == 0xA5)
            assert np.all(raw[begin + size :] == 0xA5)
            holds = offset == 0 and size >= library.core.pellucid_incident_size(1)
            assert (places > 0) == holds
            count, data = written(library, recorder)
            if not holds:
                assert (count, data) == (0, b"")
                assert not library.core.pellucid_incident_is_recorded(recorder)
                continue
            assert count == len(data)
            found = parse_incident(data)
            assert len(found.time) == min(places, 45)
            assert found.fault[found.stop] == "stopped"


def test_memory_that_was_never_started_records_nothing(library):
    size = library.core.pellucid_incident_size(8)
    memory = (ctypes.c_uint64 * (size // 8 + 1))()
    recorder = Recorder(ctypes.addressof(memory), size)
    noted(library, recorder)
    assert bytes(memory) == bytes(len(bytes(memory)))
    assert not library.core.pellucid_incident_is_recorded(recorder)


def test_a_sink_that_refuses_is_told_and_the_record_stays(library):
    size = library.core.pellucid_incident_size(20)
    memory = (ctypes.c_uint64 * (size // 8 + 1))()
    recorder = Recorder(ctypes.addressof(memory), size)
    assert library.core.pellucid_incident_init(recorder, 1, 4) == 20
    noted(library, recorder)
    assert library.core.pellucid_incident_is_recorded(recorder)
    assert written(library, recorder, most=1000)[0] == 0
    count, data = written(library, recorder)
    assert count == len(data)
    assert parse_incident(data).stop == 15
    library.core.pellucid_incident_release(recorder)
    assert not library.core.pellucid_incident_is_recorded(recorder)


def test_the_readme_says_how(folder):
    text = (folder / "README.md").read_text(encoding="utf-8")
    assert "pellucid_incident_note(incident, &controller, &input, &output)" in text
