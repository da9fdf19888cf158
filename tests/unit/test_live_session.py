"""A session without a browser: its plan, its tasks, what is judged and what is refused."""

import itertools
import json
from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np
import pytest
from stand_in_engine import Clock, StandInEngine

from pellucid._errors import StudyError
from pellucid.live.session import live_session
from pellucid.live.session.live_session import ARMED_PHASES, OPERATOR_AWAY_S, SAVING_LIMIT_S, LiveSession, Phase
from pellucid.live.session.recorded_trial import study_with
from pellucid.live.session.run_session import SHIPPED_SESSIONS, choose_participant, start_session_study
from pellucid.live.session.running_task import RunningHolding, Sensed
from pellucid.live.session.trial_plan import PlannedTrial, balanced_orders, condition_order, plan_trials
from pellucid.study.instruments_table import HoldingTask
from pellucid.study.procedures.registry import asked, open_study

STEP_S = 0.05


class Inline:
    """An executor that does its work at once."""

    def submit(self, function, *arguments):
        made = Future()
        try:
            made.set_result(function(*arguments))
        except Exception as error:
            made.set_exception(error)
        return made


def session_of(folder, session="elbow", participant="P1", unattended=False, clock=None, **engine):
    if not (folder / "study.toml").exists():
        start_session_study(folder, session, "made")
    study = open_study(folder)
    who, plan, left = choose_participant(study, participant)
    clock = Clock() if clock is None else clock
    muscles = tuple(name.removeprefix("emg.") for name in study.config.streams["emg"].channels if name != "time")
    made = StandInEngine(clock, muscles=muscles, **engine)
    finished = []
    session = LiveSession(
        study, made, left, who, executor=Inline(), finish=lambda study: (finished.append(study), (None, ["done"]))[1],
        total=len(plan), unattended=unattended, clock=clock,
    )  # fmt: skip
    session.finished_with = finished
    return session, made, clock


def run_until(session, clock, done, longest=400.0):
    end = clock.now + longest
    while not done():
        assert clock.now < end, f"not done after {longest} s: {session.phase}, {session.faults}"
        clock.now += STEP_S
        session.step()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_balanced_orders_are_balanced(count):
    rows = balanced_orders(count)
    assert all(sorted(row) == list(range(count)) for row in rows)
    places = np.zeros((count, count))
    follows = np.zeros((count, count))
    for row in rows:
        for place, each in enumerate(row):
            places[place, each] += 1
        for one, other in itertools.pairwise(row):
            follows[one, other] += 1
    assert np.ptp(places) == 0
    assert np.ptp(follows[~np.eye(count, dtype=bool)]) == 0 if count > 1 else True


def test_the_seed_decides_the_plan(tmp_path):
    start_session_study(tmp_path / "s", "able-elbow", "made")
    config = open_study(tmp_path / "s").config
    people = list(config.participants)
    plans = [plan_trials(config.session, people, person) for person in people]
    again = [plan_trials(config.session, people, person) for person in people]
    assert plans == again
    assert {len(plan) for plan in plans} == {8}
    # The published protocol: 10 movements up and 10 down, at each of 5 amplitudes, in each of 4 conditions.
    assert sum(len(trial.targets) for trial in plans[0]) == 400
    firsts = [condition_order(config.session, place) for place in range(4)]
    assert len({order[0] for order in firsts}) == 4
    other = config.session.model_copy(update={"seed": 2})
    assert [plan_trials(other, people, person) for person in people] != plans


def test_a_session_runs_from_consent_to_evaluation(tmp_path):
    session, engine, clock = session_of(tmp_path / "s", unattended=True)
    run_until(session, clock, lambda: session.phase == Phase.finished)
    study = open_study(tmp_path / "s")
    assert [entry.condition for entry in study.config.recordings] == [trial.condition for trial in session.plan]
    assert [entry.period for entry in study.config.recordings] == [1, 2, 3]
    recording = study.recordings()[0]
    steps = np.flatnonzero(np.diff(recording["target"]))
    assert len(steps) == 6
    assert {"consent", "cue", "action"} <= {kind for _, kind, _ in engine.events}
    assert session.finished_with
    assert engine.state == "disarmed"
    shown = {each["words"]: each["values"] for each in session.indices}
    assert set(shown["Median duration"]) == {"Ctrl", "FC", "CLPC"}
    assert {verdict.said for verdict in session.verdicts} == {"cannot say yet"}


def test_every_kind_of_task_runs_and_is_recorded_with_the_estimate_of_the_torque(tmp_path):
    session, engine, clock = session_of(tmp_path / "s", "knee", unattended=True)
    run_until(session, clock, lambda: session.phase == Phase.finished)
    study = open_study(tmp_path / "s")
    protocols = [entry.protocol for entry in study.config.recordings]
    assert protocols == ["mvc"] * 2 + ["held_angle"] * 4 + ["followed_angle"]
    assert [entry.use for entry in study.config.recordings] == ["fit"] * 4 + ["validate"] * 3
    held = study.recording("P1_03_held_worn")
    assert held["command"].max() == pytest.approx(10.0, abs=0.01)
    assert held["command"].min() == pytest.approx(-10.0, abs=0.01)
    assert session.levels.levels.keys() == {"rectus_femoris", "vastus_lateralis", "vastus_medialis", "biceps_femoris",
                                            "semitendinosus", "gastrocnemius_medial", "gastrocnemius_lateral",
                                            "tibialis_anterior"}  # fmt: skip
    assert session.estimator.error < 0.5 * session.estimator.error_of_mean
    found = np.array(engine.estimates)
    known = np.isfinite(found[:, 1])
    assert known.sum() > 100
    assert np.all(found[known, 2] > 0.0)
    assert np.isnan(found[~known, 2]).all()


def started(tmp_path, **options):
    session, engine, clock = session_of(tmp_path / "s", **options)
    session.page_opened("participant")
    session.page_opened("operator")
    session.step()
    assert session.act("participant", "consent") == ""
    assert session.act("participant", "ready") == ""
    assert session.act("operator", "start") == ""
    run_until(session, clock, lambda: session.phase == Phase.running and session.attempt.task.begun is not None)
    clock.now += 1.0
    return session, engine, clock


def test_a_bad_trial_is_to_be_repeated_and_says_why(tmp_path):
    session, engine, clock = started(tmp_path)
    engine.freeze = True
    run_until(session, clock, lambda: session.phase == Phase.judged)
    assert "movements" in session.reason
    assert session.act("operator", "repeat") == ""
    engine.freeze = False
    assert session.act("operator", "start") == ""
    run_until(session, clock, lambda: session.phase == Phase.judged)
    assert session.reason == ""
    assert session.act("operator", "accept") == ""
    (entry,) = open_study(tmp_path / "s").config.recordings
    assert entry.file.endswith("_attempt2.xdf")
    assert len(list((tmp_path / "s" / "recordings").glob("*.xdf"))) == 2


def run_knee_trial(tmp_path, late):
    session, _engine, clock = started(tmp_path, session="knee", late=late)
    run_until(session, clock, lambda: session.phase == Phase.judged)
    return session


def test_late_cycles_cut_a_trial_and_lose_none(tmp_path):
    """A gap of some cycles: `calibrate` uses both sides of it, and the page says so."""
    session = run_knee_trial(tmp_path, (400, 4))
    told = session.operator_state()["judged"]
    assert (told["reason"], told["used_by"]) == ("", ["calibrate"])
    assert any("a gap of" in fault["text"] and "cut out" in fault["text"] for fault in told["faults"])
    session.act("operator", "accept")
    taken = asked(session.study, "emg_torque")[0].taken(session.study)
    assert {r.trial for r in taken.recordings()} == {session.plan[0].name}
    assert len(taken.recordings()) > 1


def test_a_trial_that_calibrate_leaves_out_is_to_be_repeated(tmp_path):
    """What `calibrate` would say of the trial is said after it, by the same function."""
    session = run_knee_trial(tmp_path, (100, 4))  # no piece of a second is left
    study = study_with(session.study, session.trial, session.attempt.file)
    (left_out,) = asked(study, "emg_torque")[0].unfit(study).values()
    told = session.operator_state()["judged"]
    assert told["used_by"] == []
    assert told["reason"] == session.reason == left_out.message
    assert "the recording is excluded" in told["reason"]


def test_a_stop_ends_the_trial_and_a_reset_lets_it_begin_again(tmp_path):
    session, _engine, clock = started(tmp_path)
    assert session.act("participant", "stop") == ""
    run_until(session, clock, lambda: session.phase == Phase.judged, 3.0)
    assert "stopped" in session.reason
    assert session.act("operator", "repeat") == ""
    assert "reset" in session.act("operator", "start")
    session.act("operator", "reset")
    run_until(session, clock, lambda: session.operator_state()["engine"]["state"]["name"] == "disarmed", 3.0)
    assert session.act("operator", "start") == ""
    run_until(session, clock, lambda: session.phase == Phase.running)


def test_a_page_that_closes_ends_the_trial(tmp_path):
    session, engine, clock = started(tmp_path)
    session.page_closed("participant")
    run_until(session, clock, lambda: session.phase == Phase.judged, 3.0)
    assert "participant's page was closed" in session.reason
    assert "not open" in (session.act("operator", "repeat") or session.act("operator", "start"))
    session.page_opened("participant")
    session.act("operator", "start")
    run_until(session, clock, lambda: session.phase == Phase.running)
    clock.now += 1.0
    session.page_closed("operator")
    run_until(session, clock, lambda: session.phase == Phase.judged, 5.0)
    assert session.reason == "no operator's page was open"
    assert engine.state == "disarmed"


def test_a_stop_without_a_law_is_to_be_reset_too(tmp_path):
    session, engine, clock = started(tmp_path)
    run_until(session, clock, lambda: session.phase == Phase.judged)
    assert session.act("participant", "stop") == ""
    engine.state = "disarmed"  # there was no law that could have been stopped
    session.step()
    assert session.operator_state()["stopped"]
    assert session.participant_state()["stopped"]
    session.act("operator", "repeat")
    assert "reset" in session.act("operator", "start")
    assert session.act("operator", "reset") == ""
    run_until(session, clock, lambda: not session.is_stopped, 1.0)
    assert "no stop to reset" in session.act("operator", "reset")
    assert session.act("operator", "start") == ""


def test_no_law_is_armed_outside_a_trial(tmp_path):
    session, engine, _ = started(tmp_path)
    attempt = session.attempt
    engine.recorded = lambda path: False
    for phase in [phase for phase in Phase if phase not in ARMED_PHASES]:
        session.phase, session.attempt, session.rest_until = phase, attempt, session.clock() + 60.0
        attempt.ended, session._job = session.clock(), Future()  # a check that is not done yet
        engine.state = "running"  # whoever armed it
        session.step()
        assert (session.phase, engine.state) == (phase, "disarmed")


@pytest.mark.parametrize("seed", [1, 2])
def test_whatever_happens_a_law_runs_only_in_a_trial_with_an_operator_and_a_recorder(tmp_path, seed):
    rng = np.random.default_rng(seed)
    session, engine, clock = session_of(tmp_path / "s")
    engine.heals = False
    roles = ("operator", "participant")
    gone_at, ran = clock.now, 0

    def toggle(role):
        nonlocal gone_at
        is_open = session.pages[role] > 0
        (session.page_closed if is_open else session.page_opened)(role)
        gone_at = clock.now if is_open and role == "operator" else gone_at

    def spoil(state):
        engine.state = state if engine.state in ("running", "disarmed") else engine.state

    def mend():
        engine.alive["recorder"] = True
        engine.state = "disarmed" if engine.state == "silent" else engine.state

    toggle("operator"), toggle("participant")
    actions = ["start"] * 4 + ["repeat", "reset"] * 3 + ["skip_rest", "torque", "end_trial", "stop"]
    session.act("participant", "consent"), session.act("participant", "ready")
    for _ in range(800):
        chance = rng.random()
        if chance < 0.25:
            role = str(rng.choice(roles, p=[0.9, 0.1]))
            assert isinstance(session.act(role, str(rng.choice(actions)), float(rng.normal())), str)
        elif chance < 0.27 or (chance < 0.4 and min(session.pages.values()) == 0):
            toggle(str(rng.choice(roles)))
        elif chance < 0.28:
            spoil(str(rng.choice(["silent", "stopped"])))
        elif chance < 0.29:
            engine.alive["recorder"] = False
        elif chance < 0.5:
            mend()
        clock.now += 0.1
        session.step()
        json.dumps(session.operator_state(), allow_nan=False), json.dumps(session.participant_state(), allow_nan=False)
        if engine.state == "running":
            ran += session.phase == Phase.running
            assert session.phase in ARMED_PHASES
            assert engine.alive["recorder"]
            assert session.pages["operator"] or clock.now - gone_at <= OPERATOR_AWAY_S + 1e-9
            assert not session.is_stopped
    assert ran > 20


def test_a_law_without_a_recorder_is_disarmed_and_a_file_that_is_never_whole_ends(tmp_path):
    session, engine, clock = started(tmp_path)
    engine.heals, engine.alive["recorder"] = False, False
    session.step()
    assert (session.phase, engine.state) == (Phase.saving, "disarmed")
    run_until(session, clock, lambda: session.phase == Phase.judged, SAVING_LIMIT_S + 2.0)
    assert session.reason == "the recorder has ended: No space left on device"
    assert "not complete: the recorder has ended: No space left on device" in session.attempt.judged.reason
    assert engine.given_up == [session.attempt.file]
    assert engine.restarts > 1
    assert [fault.text for fault in session.faults].count("the recorder has ended: No space left on device") == 1
    assert session.act("operator", "repeat") == ""
    assert "No space left on device" in session.act("operator", "start")
    assert session.operator_state()["recorder"] == "has ended: No space left on device"
    engine.alive["recorder"] = True
    session.step()
    assert session.act("operator", "start") == ""


def test_a_session_without_a_person_ends_when_nothing_can_be_recorded(tmp_path):
    session, engine, clock = session_of(tmp_path / "s", unattended=True)
    engine.heals, engine.alive["recorder"] = False, False
    run_until(session, clock, lambda: session.phase == Phase.finished)
    assert not open_study(tmp_path / "s").config.recordings


def test_a_session_without_a_person_ends_when_no_trial_can_be_kept(tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(live_session, "add_to_study", fail)
    session, _engine, clock = session_of(tmp_path / "s", unattended=True)
    run_until(session, clock, lambda: session.phase == Phase.finished)
    assert not open_study(tmp_path / "s").config.recordings


def test_a_disk_that_is_full_when_a_trial_is_kept_is_told(tmp_path, monkeypatch):
    session, _engine, clock = started(tmp_path)
    run_until(session, clock, lambda: session.phase == Phase.judged)

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(live_session, "add_to_study", fail)
    assert "No space left on device" in session.act("operator", "accept")
    assert session.phase == Phase.judged
    monkeypatch.undo()
    assert session.act("operator", "accept") == ""


def test_a_disk_without_room_ends_a_trial_and_lets_none_begin(tmp_path, monkeypatch):
    session, _engine, clock = started(tmp_path)
    run_until(session, clock, lambda: session.phase == Phase.running)
    monkeypatch.setattr(live_session.shutil, "disk_usage", lambda folder: SimpleNamespace(free=50e6))
    run_until(session, clock, lambda: session.phase not in ARMED_PHASES)
    assert not session._armed
    assert "the disk has 50 MB free and needs" in session._obstacle(clock.now)
    monkeypatch.undo()
    run_until(session, clock, lambda: not session._obstacle(clock.now))


def test_a_participant_cannot_do_what_an_operator_does(tmp_path):
    session, _engine, _clock = session_of(tmp_path / "s")
    for action in ("start", "accept", "torque", "finish", "step", "_start"):
        assert "expected one of" in session.act("participant", action)
    assert session.phase != Phase.waiting


def test_the_slider_stays_within_its_limit(tmp_path):
    session, engine, clock = started(tmp_path, session="knee")
    assert "only while an angle is held" in session.act("operator", "torque", 3.0)
    run_until(session, clock, lambda: session.phase == Phase.judged)
    session.act("operator", "accept")
    while session.trial.task.kind != "holding":
        if session.phase == "instructions":
            session.act("participant", "ready")
        session.act("operator", "start")
        run_until(session, clock, lambda: session.phase == Phase.judged)
        session.act("operator", "accept")
    if session.phase == "rest":
        session.act("operator", "skip_rest")
        session.step()
    session.act("participant", "ready")
    session.act("operator", "start")
    run_until(session, clock, lambda: session.phase == Phase.running and session.attempt.task.index >= 0)
    assert "expected a number" in session.act("operator", "torque", float("nan"))
    session.act("operator", "torque", 99.0)
    assert session.slider == 10.0
    clock.now += STEP_S
    session.step()
    assert engine.torque == pytest.approx(5.0 * STEP_S)  # on the way, at the default rate
    assert session.slider == engine.torque  # the page shows what is commanded


def test_the_torque_follows_the_slider_at_the_stated_rate():
    task = HoldingTask(name="held", kind="holding", angles=("45 deg",), torques=("0 N*m", "0 N*m"), duration="4 s")
    trial = PlannedTrial(1, "P1", "worn", "torque", task, 1, 1, "fit", (0.785,))
    holding = RunningHolding(trial, lead_in=0.0)
    asked = []
    for time in np.arange(0.0, 8.0, 0.1):
        holding.step(Sensed(float(time), 0.785))
        asked += [(time, ask.values[0]) for ask in holding.take()[1] if ask.kind == "torque"]
        if time > 0.95 and holding.by_hand is None and time < 1.05:
            holding.set_by_hand(6.0, 5.0)
    times, torques = np.array(asked).T
    assert torques.max() == pytest.approx(6.0)
    assert np.abs(np.diff(torques)).max() == pytest.approx(0.5)  # 5 N m/s in 0.1 s
    assert times[torques == torques.max()][0] == pytest.approx(2.2, abs=0.11)
    assert torques[-1] == 0.0  # back on the plan, which asks for nothing in its second step
    assert times[-1] == pytest.approx(5.2, abs=0.21)


def test_a_trial_needs_the_streams_that_the_study_names(tmp_path):
    session, engine, clock = session_of(tmp_path / "s")
    session.page_opened("participant")
    engine.silent["markers"] = 60.0
    session.step()
    session.act("participant", "consent")
    session.act("participant", "ready")
    assert session.act("operator", "start") == "the stream markers is not received, but [session] streams requires it"
    assert session.operator_state()["missing_streams"] == ("markers",)
    engine.silent["markers"] = 0.0
    clock.now += 1.0
    session.step()
    assert session.act("operator", "start") == ""
    run_until(session, clock, lambda: session.phase == Phase.running)
    clock.now += 1.0
    engine.silent["emg"] = 2.5
    run_until(session, clock, lambda: session.phase == Phase.judged)
    assert session.reason == "the stream emg stopped sending during the trial"


def test_what_happens_to_a_clock_is_told_while_it_happens(tmp_path):
    session, engine, clock = started(tmp_path)
    engine.clocks["emg"].jumps, engine.clocks["emg"].lost, engine.clocks["encoder"].batches = 1, 20, 3
    clock.now += 1.0
    session.step()
    told = [fault.text for fault in session.faults]
    assert "the clock of the stream emg jumped, 1 times so far" in told
    assert "the stream emg lost 20 samples" in told
    assert "the stream encoder sends batches of samples with the same time" in told
    clock.now += 1.0
    session.step()
    assert [fault.text for fault in session.faults] == told  # each once


def test_a_session_goes_on_where_it_was_left(tmp_path):
    session, _, clock = session_of(tmp_path / "s", unattended=True)
    run_until(session, clock, lambda: session.index == 1)
    again, _, clock = session_of(tmp_path / "s", unattended=True)
    assert [trial.number for trial in again.plan] == [2, 3]
    run_until(again, clock, lambda: again.phase == Phase.finished)
    with pytest.raises(StudyError, match="found all trials of P1 recorded"):
        choose_participant(open_study(tmp_path / "s"), "P1")
    assert choose_participant(open_study(tmp_path / "s"), None)[0] == "P2"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('kind = "pointing"', 'kind = "jumping"'), 'expected "pointing", "tracking", "holding" or "contraction"'),
        (('start = "60 deg"', 'start = "60 kg"'), "start"),
        (("trials = 1 ", "trails = 1 "), "trails"),
        (('name = "pointing"', 'name = "pointing"\nconditions = ["FCC"]'), 'found the condition "FCC"'),
        (('order = "balanced"', 'order = "sorted"'), "order"),
    ],
)
def test_a_wrong_session_says_what_is_wrong(tmp_path, change, said):
    path = start_session_study(tmp_path / "s", "elbow", "made")
    text = path.read_text(encoding="utf-8")
    assert change[0] in text
    path.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(StudyError) as raised:
        open_study(tmp_path / "s")
    assert said in str(raised.value)
    assert "study.toml" in str(raised.value)


@pytest.mark.parametrize("session", SHIPPED_SESSIONS)
def test_every_session_that_ships_is_a_study(tmp_path, session):
    start_session_study(tmp_path / "s", session, f"my-{session}")
    config = open_study(tmp_path / "s").config
    assert plan_trials(config.session, list(config.participants), "P1")
