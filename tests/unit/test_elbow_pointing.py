"""People who point: how long they take, what they learn, and what an experiment with them gives."""

import hashlib
import tomllib
import weakref
from importlib.resources import files

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import StudyError
from pellucid._processes import processes
from pellucid.models.anthropometry import forearm
from pellucid_lab.pointing.load_learning import load_regressor, update_expected_load
from pellucid_lab.pointing.movement_choice import preferred_duration, utility
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import PointingRig, elbow_participants
from pellucid_lab.pointing.session import Unpowered, simulate_session, standstill_speed
from pellucid_lab.shipped_rigs import shipped_rig
from pellucid_lab.simulate import simulate
from pellucid_lab.study import record_in_memory, write_full_study, write_study

RIG = elbow_participants()
FROZEN = "412a5375a3b93d67"
"""Of the tables that say who people are and how they move, as they were before any robot was strapped on."""


def test_people_are_as_they_were_before_a_robot_was_strapped_on():
    tables = ("people", "arm", "muscles", "vision", "planning", "choice", "learning")
    shipped = tomllib.loads(shipped_rig("elbow-participants"))
    text = repr([(name, sorted(shipped[name].items())) for name in tables])
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == FROZEN


def test_nobody_knows_the_condition():
    text = (files("pellucid_lab") / "rigs" / "elbow-participants.toml").read_text(encoding="utf-8")
    values = [line.split("#")[0] for line in text.splitlines()]
    assert not any(name in line for line in values for name in ("FC", "CLPC", "Ctrl", "condition"))


def test_six_people_are_like_those_of_the_paper():
    people = draw_people(RIG, np.random.default_rng(3))
    assert sorted(p.sex for p in people) == ["female"] * 3 + ["male"] * 3
    for key in ("age", "height", "mass"):
        drawn = [getattr(p, key) for p in people]
        mean, spread = RIG["people"][key]
        assert np.mean(drawn) == pytest.approx(mean, rel=1e-9)
        assert np.std(drawn, ddof=1) == pytest.approx(spread, rel=1e-9)


def test_a_forearm_by_winter():
    segment = forearm(63.5, 1.755)
    assert segment.mass == pytest.approx(1.397)
    assert segment.inertia == pytest.approx(1.397 * 0.827**2 * (0.146 * 1.755) ** 2, rel=2e-3)


def test_chosen_durations_are_the_best_and_grow_with_amplitude_and_load():
    choice, width = RIG["choice"], 0.05
    arm = (0.06, 0.1, 0.0)
    times = [preferred_duration(np.deg2rad(a), arm, 12.0, choice, width) for a in (12, 24, 36, 48, 60)]
    assert np.all(np.diff(times) > 0.02)
    for a, best in zip((12, 60), (times[0], times[-1]), strict=True):
        around = utility(best * np.array([0.95, 1.0, 1.05]), np.deg2rad(a), arm, 12.0, choice, width)
        assert around[1] == around.max()
    free = preferred_duration(0.6, arm, 12.0, choice, width)
    for load in ((0.03, 0.0, 0.0), (0.0, 0.3, 0.0)):
        loaded = tuple(x + y for x, y in zip(arm, load, strict=True))
        assert preferred_duration(0.6, loaded, 12.0, choice, width) > 1.02 * free
    # A constant resistance costs the same work at every pace: it must not make people hurry.
    assert preferred_duration(0.6, (0.06, 0.1, 0.5), 12.0, choice, width) > 0.99 * free
    brisk = preferred_duration(0.6, arm, 40.0, choice, width)
    assert brisk < times[2]


def test_a_load_is_learnt_movement_by_movement(rng):
    t = np.linspace(0, 2, 200)
    q, v, a = 1.2 + 0.5 * np.sin(3 * t), 1.5 * np.cos(3 * t), -4.5 * np.sin(3 * t)
    columns = load_regressor(q, v, a, 0.05)
    truth = np.array([0.02, 0.05, 0.3, 0.2, -0.1])
    expected, errors = np.zeros(5), []
    for _ in range(12):
        expected = update_expected_load(expected, columns, columns @ truth, RIG["learning"])
        errors.append(np.sqrt(np.mean((columns @ (expected - truth)) ** 2)))
    assert np.all(np.diff(errors) < 0)
    assert errors[-1] < 0.1 * np.sqrt(np.mean((columns @ truth) ** 2))
    assert np.array_equal(update_expected_load(np.zeros(5), columns, np.zeros(200), RIG["learning"]), np.zeros(5))


def test_without_a_robot_people_arrive_and_hold():
    rng = np.random.default_rng(4)
    session = simulate_session(RIG, draw_people(RIG, rng)[0], "Ctrl", None, rng, np.deg2rad([24, 60]))
    assert [round(np.rad2deg(m.amplitude)) for m in session.movements] == [24, -24, 60, -60]
    for m in session.movements:
        hold = session.signals["position"][m.end - 1900 : m.end]
        assert np.abs(hold - m.target).max() < RIG["pointing"]["tolerance"]
        assert not np.any(m.expected)
    assert not np.any(session.signals["interaction"])
    assert session.signals["flexor"].min() > 0.0
    assert session.signals["flexor"].max() < 0.5


def test_a_robot_without_power_is_felt_and_its_weight_learnt():
    rng = np.random.default_rng(5)
    person = draw_people(RIG, rng)[1]
    session = simulate_session(RIG, person, "off", Unpowered(), rng, np.deg2rad([36, 36, 36, 36, 36, 36]))
    weight = RIG.robot.gravity(person.slider(RIG))[0]
    learnt_weight = session.movements[-1].expected[3]
    assert 0.6 * weight < learnt_weight < 1.4 * weight
    assert np.abs(session.signals["interaction"]).max() > 1.5
    assert standstill_speed(RIG, person, Unpowered()) < 0.01


def test_the_same_seed_gives_the_same_session():
    def held():
        rng = np.random.default_rng(6)
        return simulate_session(RIG, draw_people(RIG, rng)[0], "x", Unpowered(), rng, np.deg2rad([12.0]))

    first, second = held(), held()
    for name, samples in first.signals.items():
        assert np.array_equal(samples, second.signals[name])


LAWS = {"Ctrl": None, "off": lambda person, place: Unpowered()}


@pytest.fixture(scope="module")
def short():
    """An experiment of two people and ten movements a condition."""
    text = (files("pellucid_lab") / "rigs" / "elbow-participants.toml").read_text(encoding="utf-8")
    text = text.replace("repetitions = 10 ", "repetitions = 1 ").replace("count = 6\n", "count = 2\n")
    return PointingRig.parse(text, "short")


def test_recordings_of_an_experiment_are_what_its_study_says(short):
    rig = short.under(LAWS)
    config, recordings, taken = record_in_memory(rig, rig.trials(7), seed=7)
    sessions = [one.inside for one in taken]
    assert {(r.participant, r.condition) for r in recordings} == {(p, c) for p in ("P1", "P2") for c in ("Ctrl", "off")}
    assert config.assessment.agonists == ("biceps", "brachioradialis")
    for r in recordings:
        assert ("position" in r) == (r.condition == "off") == ("interaction" in r)
        assert set(r.streams["emg"].channels) == {"time", *(f"emg.{m}" for m in short["emg"]["muscles"])}
        assert len(np.unique(r["target"])) == 6
        wrist = r.optical.markers["wrist"] - r.optical.markers["elbow"]
        angle = np.arctan2(wrist[:, 0], -wrist[:, 2])
        true = sessions[[(s.person.name, s.condition) for s in sessions].index((r.participant, r.condition))]
        assert abs(angle[-1] - true.signals["position"][-1]) < 0.01


def test_each_recording_is_released_before_the_next_one_is_made(short):
    """A study of any number of recordings needs the memory of one."""
    rig = short.changed({"pointing.block": 5}).under(LAWS)
    stored, alive = [], []

    def store(name, streams):
        alive.append([name for name, table in stored if table() is not None])
        stored.extend((name, weakref.ref(table)) for table in streams.values())
        return {stream: table.emptied for stream, table in streams.items()}

    made = list(rig.record_all(rig.trials(7), 7, store=store, then=lambda taken: taken.noted))
    assert [name for one in made for name in one.files] == list(dict.fromkeys(name for name, _ in stored))
    assert len(alive) == 8
    assert not any(alive)


def test_threads_change_nothing_and_of_a_session_stays_what_is_asked_for(short):
    rig = short.under(LAWS)
    _, one, sessions = record_in_memory(rig, rig.trials(7), seed=7)
    _, two, faults = record_in_memory(rig, rig.trials(7), seed=7, threads=2, keep=lambda taken: taken.inside.fault)
    assert [fault.inside for fault in faults] == [session.inside.fault for session in sessions]
    assert [r.name for r in one] == [r.name for r in two]
    for a, b in zip(one, two, strict=True):
        for x, y in ((a, b), (a.streams["emg"], b.streams["emg"])):
            assert all(np.array_equal(x[name], y[name]) for name in x.channels)
            assert not any(x[name].flags.writeable for name in x.channels)


def test_workers_of_an_executor_write_the_same_files(short, tmp_path):
    rig = short.under(LAWS)
    _, duration = write_full_study(tmp_path / "here", rig, name="short", seed=7)
    with processes(2) as executor:
        _, other = write_full_study(tmp_path / "there", rig, name="short", seed=7, executor=executor)
    assert duration == other > 0.0
    names = sorted(path.relative_to(tmp_path / "here") for path in (tmp_path / "here").rglob("*") if path.is_file())
    assert len(names) > 10
    for name in names:
        if not name.name.startswith("."):
            assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes(), name


def test_files_and_memory_hold_the_same(short, tmp_path):
    rig = short.under(LAWS)
    study = write_study(tmp_path, rig, name="short", seed=7)
    config, recordings, _ = record_in_memory(rig, rig.trials(7), seed=7)
    assert config.model_copy(update={"name": "short"}) == study.config
    for memory, file in zip(recordings, study.recordings(), strict=True):
        assert (memory.name, memory.participant, memory.condition) == (file.name, file.participant, file.condition)
        for a, b in ((memory, file), (memory.streams["emg"], file.streams["emg"])):
            assert list(a.channels) == list(b.channels)
            # Half of the last digit that the file has.
            digits = {"position": 5e-7, "target": 5e-7, "interaction": 5e-5}
            for name in b.channels:
                np.testing.assert_allclose(a[name], b[name], rtol=0.0, atol=1.01 * digits.get(name, 1e-15))
        np.testing.assert_allclose(memory.optical.time, file.optical.time, rtol=0.0, atol=5.01e-6)
        for marker, points in file.optical.markers.items():
            np.testing.assert_allclose(memory.optical.markers[marker], points, rtol=0.0, atol=1e-12)


def test_people_wear_the_controllers_that_are_named(tmp_path):
    text = (files("pellucid_lab") / "rigs" / "elbow-participants.toml").read_text(encoding="utf-8")
    text = text.replace("count = 6", "count = 2").replace("repetitions = 10", "repetitions = 1")
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "rig.toml").write_text(text, encoding="utf-8")
    made = simulate(tmp_path, controllers=["force_sensor", "clpc"])
    assert [r.condition for r in made.study.recordings()] == ["Ctrl"] * 2 + ["force_sensor"] * 2 + ["clpc"] * 2
    with pytest.raises(StudyError, match='found no controller "fcc", expected some of clpc, pcfr, fc'):
        simulate(tmp_path, controllers=["fcc"])
    with pytest.raises(StudyError, match="found a controller twice"):
        simulate(tmp_path, controllers=["clpc", "clpc"])
    (tmp_path / "lab" / "rig.toml").write_text(
        (files("pellucid_lab") / "rigs" / "able-elbow.toml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    with pytest.raises(StudyError, match="found controllers clpc, expected them with people who wear them"):
        simulate(tmp_path, controllers=["clpc"])


def test_a_file_that_lacks_something_is_told():
    text = (files("pellucid_lab") / "rigs" / "elbow-participants.toml").read_text(encoding="utf-8")
    with pytest.raises(StudyError, match=r"\[planning\] lacks reach$"):
        PointingRig.parse(text.replace("\nreach = ", "\nreeach = "), "x")
    with pytest.raises(StudyError, match="found kind = 'x'"):
        PointingRig.parse('kind = "x"', "x")


@pytest.mark.parametrize(
    ("change", "told"),
    [({"longest": 0}, "longest"), ({"noise": np.zeros((3, 4))}, "noise"), ({"duration": 0.0}, "duration")],
)
def test_the_core_refuses_what_makes_no_sense(change, told):
    person = draw_people(RIG, np.random.default_rng(8))[0]
    arm = _core.WornElbow(
        person.vector(RIG), np.zeros(5), position0=1.0, strap=RIG.strap, drive=[1, 1, 0, 0, 0], emg_gains=[1, 1],
        substeps=4,
    )  # fmt: skip
    arguments = dict(target=1.2, amplitude=0.2, duration=0.6, reaction=0.2, load=np.zeros(5), tolerance=0.1, hold=0.1,
                     noise=np.zeros((10, 5)), longest=10)  # fmt: skip
    assert len(arm.move(**arguments)[0]) == 10
    with pytest.raises(ValueError, match=told):
        arm.move(**(arguments | change))
