"""Every law of the core's list: described, stepped in Python, worn in the lab, exported; the same bits everywhere."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import pellucid as pl
from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS, ControlLaw, fuzz
from pellucid.controllers.export.c_folder import write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.controllers.export.replay_vector import (
    INIT_EVENT,
    MEMORY_EVENT,
    POWER_ON_EVENT,
    STOP_EVENT,
    SUPERVISOR_VARIANTS,
    replay_vector,
)
from pellucid.models.card import CardParameter, ModelCard
from pellucid.models.fields import model_fields
from pellucid.models.simulate import substeps_for
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants

NUMBERS = Path(__file__).parents[1] / "core" / "law_numbers.hpp"
TYPICAL = {
    name: float(value) for name, value in re.findall(r'\{"(\w+)", ([-\d.]+)\}', NUMBERS.read_text(encoding="utf-8"))
}
FAULTS, MODES = _core.FAULTS, _core.MODES
compiled = pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is missing")


def typical(name):
    """A law with sensible numbers: typical where the tests of the core know one, its default elsewhere."""
    values = LAWS[name].defaults
    return ControlLaw(name, values | {key: TYPICAL[key] for key in values if key in TYPICAL})


@pytest.mark.parametrize("name", LAWS)
def test_every_number_is_described(name):
    for field in LAWS[name].fields:
        assert field.sentence
        assert field.unit() == field.unit("rotary", "N*m") != ""
        assert field.lower <= field.default <= field.upper or field.default == 0.0  # which must be set


@compiled
@pytest.mark.parametrize("name", LAWS)
def test_python_answers_bit_by_bit_as_c(name, tmp_path):
    law = typical(name)
    values = ControllerValues(name, law.values, {}, ("a.json",), {})
    folder = write_c_folder("bench", values, tmp_path / "c")
    recorded = re.findall(r"\{ 0x(\w{8})u, (\d+)u\}", (folder / "test" / "vector_outputs.h").read_text())
    steps = replay_vector(values).steps
    assert len(steps) == len(recorded) > 400
    variants = [values.supervised.changed(**changes) for changes in SUPERVISOR_VARIANTS.values()]
    running, faults, moved, lost, number = None, set(), 0, False, values.supervised
    for row, (bits, said) in zip(steps, recorded, strict=True):
        if row.before >= POWER_ON_EVENT:
            number = variants[row.before - POWER_ON_EVENT]
            running, lost = number.start(single=True), False
        elif row.before == STOP_EVENT:
            running.stop()
        elif row.before == INIT_EVENT:
            running.configure(number.parameters, number.supervisor)
        lost = lost or row.before == MEMORY_EVENT  # this machine's memory keeps its bits
        faults.add(FAULTS[int(said) & 0xFF])
        if lost:
            continue
        first = row.read[0]
        drive = float(np.float32(running.effort) + np.float32(row.drive))
        back = [
            (drive, first.sequence, first.time, bool(first.valid)),
            (0.0, first.sequence, first.time, bool(first.valid)),
        ]
        read = [(float(s.value), s.sequence & 0xFFFFFFFF, s.time, bool(s.valid)) for s in row.read]
        effort = np.float32(running.step_samples(row.now, read + back, running.challenge if row.token else 0))
        assert f"{effort.view(np.uint32):08x}" == bits
        assert int(said) == FAULTS.index(running.fault) | MODES.index(running.mode) << 8 | running.enable << 16
        moved += effort != 0.0
    assert moved > 100
    # What no input of this law can show is left out: an estimator that is slow to believe a jump has no velocity, and
    # an effort that changes fast enough hides that the drive's does not. A probe learns for longer than a vector lasts,
    # and a mean rate is judged over more periods.
    unseen = {
        "configuration",
        "not_started",
        "velocity",
        "drive_sign",
        "drive_stuck",
        "unanswered",
        "late_answer",
        "rate",
    }
    shown_by = {"interaction": ("force_sensor", "unexplained_energy"), "muscle": ("muscle",)}
    unseen |= {fault for sensor, faults in shown_by.items() if sensor not in law.sensors for fault in faults}
    assert set(FAULTS) - faults <= unseen


@pytest.mark.parametrize("name", LAWS)
def test_it_is_worn_in_the_lab(name):
    law, rig = typical(name), elbow_participants()
    person, robot = draw_people(rig, np.random.default_rng(1), count=1)[0], rig.robot
    here = rig["pointing"]["reference"]
    arm = _core.WornElbow(
        person.vector(rig), np.zeros(5), position0=here, robot=robot.plant(person.slider(rig)), strap=rig.strap,
        drive=[robot.gain, robot["motor"]["current_limit"], 0.0, 0.0, robot.quantum], law=name,
        law_parameters=law.parameters, emg_gains=[1.0, 1.0], substeps=substeps_for(rig.period),
    )  # fmt: skip
    moved = arm.move(
        target=here, amplitude=0.05, duration=0.8, reaction=0.2, load=np.zeros(5), tolerance=0.0, hold=1e9,
        noise=np.zeros((300, 5)), longest=300, sensor_error=np.zeros(300), emg=True,
    )  # fmt: skip
    assert np.abs(moved[5]).max() > 0.01
    assert np.all(np.isfinite(moved))


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("name", LAWS)
def test_nothing_unsafe_comes_out_of_nonsense(name, single):
    found = fuzz(typical(name), 50_000, seed=3, single=single)
    assert (found.unsafe, found.faults > 5, found.slowest <= 1) == (0, True, True)


def test_a_run_is_its_steps():
    law, other = typical("transparent"), typical("transparent")
    t = 1e-3 * np.arange(400)
    q, felt = 1.2 + 0.3 * np.sin(5 * t), 0.2 * np.cos(5 * t)
    efforts = law.run(t, q, felt)
    assert list(efforts) == [other.step(*now) for now in zip(t, q, felt, strict=True)]
    assert np.abs(efforts).max() > 1.0
    law.reset()
    assert law.fault == "none"


def test_what_is_no_law_is_refused():
    with pytest.raises(PellucidError, match="found no number, or one too many, for bandwidth"):
        ControlLaw("joint", {k: v for k, v in LAWS["joint"].defaults.items() if k != "bandwidth"})
    with pytest.raises(PellucidError, match='found the controller "pid", expected one of compensation'):
        pl.controller(None, "pid")
    with pytest.raises(PellucidError, match="found NoneType, expected what `identify` found of a joint, its"):
        pl.controller(None)
    with pytest.raises(TypeError, match=r"samples, expected at most \d+, one for each sensor"):
        typical("joint").step(0.0, 1.0, 2.0)


def test_units_follow_the_joint():
    inertia, viscous = (next(f for f in model_fields("joint") if f.name == n) for n in ("inertia", "viscous_positive"))
    assert [inertia.unit(), inertia.unit("prismatic", "N"), inertia.unit("rotary", "A")] == [
        "kg*m^2", "kg", "A*s^2/rad",
    ]  # fmt: skip
    assert [viscous.unit(), viscous.unit("prismatic", "N"), viscous.unit("prismatic", "V")] == [
        "N*m*s/rad", "N*s/m", "V*s/m",
    ]  # fmt: skip


def test_compensation_is_a_controller_by_name():
    body = {"inertia": 0.05, "gravity": 1.5, "offset": 0.1, "coulomb": 0.3, "viscous": 0.08}
    card = ModelCard(
        study="", family="symmetric", method="ls", motion="rotary", effort_unit="N*m", lifts="",
        parameters=tuple(CardParameter(n, "1", v, 0.0, (v, v)) for n, v in body.items()), covariance=(), known={},
        velocity_range=4.0, drive={}, heldout_effort_error=None, processing="", confidence=0.95, checksums={},
        pellucid="",
    )  # fmt: skip
    limits = pl.Limits(effort=5.0, rate=500.0, velocity=10.0, position=(-2.0, 2.0))
    law = pl.controller(card, "compensation", limits=limits)
    assert law.run(1e-3 * np.arange(100), np.full(100, 0.5))[-1] == pytest.approx(1.5 * np.sin(0.5) + 0.1, abs=1e-9)
    assert pl.controller(card).values["effort_limit"] == pytest.approx(1.6 + 0.8 * (0.3 + 4.0 * 0.08))
    with pytest.raises(PellucidError, match="found the card of a joint, expected one of a joint with a carriage"):
        pl.controller(card, "transparent")
