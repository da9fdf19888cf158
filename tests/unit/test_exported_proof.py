"""The proof on exported controllers: its plant keeps energy, its wearer arrives, its bounds can fail."""

from __future__ import annotations

import shutil
from dataclasses import replace
from functools import cached_property

import numpy as np
import pytest
from research.evidence import _exported
from research.evidence._exported import exports, foreign_people, motion_bounds, trials
from research.evidence._supervisor_page import fault_figures
from test_export_elbow import CARDS, STUDY

import pellucid
from pellucid.controllers.export.c_folder import write_c_folder
from pellucid.controllers.export.export import values_for
from pellucid.models.card import CardParameter, write_card
from pellucid.models.slider_joint import SliderCard

SEED = 20261119
"""Seed of the plants here: one on which thresholds may be chosen."""

pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is not installed"
)


class MadeExports(exports.Exports):
    """Exports of a study whose cards were written down, so that no recording need be simulated."""

    def __init__(self, folder, made):
        super().__init__(folder)
        self.elbow = made

    @cached_property
    def elbow_constants(self):
        out = write_c_folder("elbow", values_for(pellucid.open(self.elbow)), self.folder / "default")
        return (out / "pellucid_constants.h").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Exports of the study of test_export_elbow, compiled once."""
    folder = tmp_path_factory.mktemp("exported")
    made = folder / "study"
    for name in ("recordings", "models"):
        (made / name).mkdir(parents=True)
    (made / "recordings" / "a.csv").write_text("t,q,u\n0,0,0\n", encoding="utf-8")
    (made / "study.toml").write_text(STUDY, encoding="utf-8")
    for family, values in CARDS.items():
        card = SliderCard(
            study="bench", family=family, method="", motion="rotary", effort_unit="N*m", lifts="flexion",
            parameters=tuple(CardParameter(n, "1", v, 0.0, (v, v)) for n, v in values.items()), covariance=(),
            known={"carriage_mass": 0.48} if family == "load" else {}, rail=(0.12, 0.27), drive={"gain": 1.0},
            heldout_error=None, residual_sd=0.0, processing="", confidence=0.95, notes=(), checksums={}, pellucid="0",
            presliding_travel=CardParameter("presliding_travel", "rad", 3e-4, 2e-5, (2.6e-4, 3.4e-4)),
        )  # fmt: skip
        write_card(made / "models" / f"slider.{family}.json", card)
    return MadeExports(folder, made)


@pytest.fixture(scope="module")
def transparent(store):
    return store.law("transparent", "blind")


@pytest.fixture(scope="module")
def measured(store):
    return store.law("transparent", "drive_measured")


def test_what_was_identified_is_read_beside_what_is_carried():
    text = (
        "    8.8e+00f, /* coulomb_positive [N]: identified as 21.0242, 18.8 to 23.2; 8.8 is carried */\n"
        "    3.40282347e+38f, /* position_max [m]: none known: set yours */\n"
    )
    numbers, identified = exports.read_constants(text)
    assert numbers == {"coulomb_positive": 8.8, "position_max": np.inf}
    assert identified["coulomb_positive"] == 21.0242


@pytest.mark.parametrize("index", range(4))
def test_the_plant_keeps_its_energy_without_friction_and_power(transparent, index):
    run = foreign_people.draw_run(transparent, index, SEED) | {
        "kind": -1.0, "passive": 1.0, "seconds": 4.0, "stop_low": -1e6, "stop_high": 1e6, "start_position": 1.2,
    }  # fmt: skip
    result = trials.play(transparent, [run])[0].result
    swung = run["limb_gravity"] + np.hypot(run["gravity_sine"], run["gravity_cosine"])
    assert abs(result["energy_end"] - result["energy_start"]) < 0.02 * swung


def test_wearers_arrive_where_they_want_to_be(transparent):
    lives = [trials.live(transparent, index, SEED, 20.0, mishaps=False) for index in range(4)]
    assert all(life.started < 2.0 for life in lives)
    assert all(life.alarms == () for life in lives)
    assert max(life.reached for life in lives) < 0.05
    still = trials.live(transparent, 0, SEED, 20.0, mishaps=False, servo_stiffness=0.5, learning_time=1e3)
    assert still.reached > 2.0 * lives[0].reached


def test_equal_seeds_give_equal_results(transparent):
    kinds = ("encoder_nan", "drive_dead")
    first, second = (trials.try_faults(transparent, 1, SEED, kinds) for _ in range(2))
    assert repr(first) == repr(second)
    assert repr(trials.try_faults(transparent, 1, SEED + 1, kinds)) != repr(first)


def test_faults_that_the_drive_measures_are_found_and_bounded(measured):
    kinds = ("drive_reversed", "drive_triple", "drive_stuck", "drive_dead", "encoder_nan", "task_hangs", "mode_memory")
    found = trials.try_faults(measured, 0, SEED, kinds)
    assert [trial.kind for trial in found] == list(kinds)
    assert all(trial.is_found and not trial.early for trial in found)
    assert max(trial.found for trial in found) < 0.3
    assert max(trial.excess for trial in found) < 0.3
    by_kind = {trial.kind: trial for trial in found}
    assert by_kind["encoder_nan"].fault == "not_finite"
    assert by_kind["task_hangs"].fault == "watchdog"
    assert by_kind["mode_memory"].fault == "integrity"


GROUP_BOUNDS = {"sensor": (0.01, 1e-3), "drive": (0.3, 0.1), "clock": (0.02, 1e-3), "software": (0.2, 1e-3)}
"""Longest time until found [s] and largest excess [J] of the worst fault of each group, where the drive is measured."""

SEEN_LATE = ("encoder_frozen", "encoder_half_two", "drive_late", "drive_holds")
"""Faults that do nothing for as long as a wearer rests."""


@pytest.mark.parametrize("group", GROUP_BOUNDS)
def test_the_worst_fault_of_a_group_is_found_in_time_and_bounded(measured, group):
    kinds = {kind.name for kind in trials.KINDS.values() if kind.group == group and not kind.hidden} - {*SEEN_LATE}
    found = [t for index in range(3) for t in trials.try_faults(measured, index, SEED, sorted(kinds))]
    assert len(found) >= 9
    assert all(trial.is_found and not trial.early for trial in found)
    longest, most = GROUP_BOUNDS[group]
    # A wrong gain at the start is told by up to five waves, each after a rest.
    running, starting = ([t for t in found if trials.KINDS[t.kind].at_start == starts] for starts in (False, True))
    assert max(trial.found for trial in running) < longest
    assert max(trial.excess for trial in running) < most
    assert max((trial.excess for trial in starting), default=0.0) < 5 * 0.15


def test_a_measured_drive_that_answers_late_is_found(measured):
    late = [t for index in range(8) for t in trials.try_faults(measured, index, SEED, ("drive_late",))]
    assert all(trial.is_found and trial.fault in ("drive_effort", "drive_stuck") for trial in late)
    assert max(trial.excess for trial in late) < 0.1
    lives = [trials.live(measured, index, SEED, 60.0, reaching=1.0) for index in range(2)]
    assert not any(life.false_alarms for life in lives)


def test_a_commissioned_probe_finds_what_begins_before_its_first_movement(store):
    """Probes that were not commissioned miss some: rows `safety.exported.probe_uncommissioned` of the proof."""
    probed = store.law("transparent", "unmeasured")
    kinds = _exported.PROBED_KINDS
    known = [t for index in range(3) for t in trials.try_faults(probed, index, SEED, kinds)]
    assert all(trial.is_found and not trial.early for trial in known)
    assert max(t.excess for t in known) < 5.0
    assert max(t.found for t in known) < 3.0
    lives = [trials.live(probed, index, SEED, 60.0, reaching=1.0) for index in range(2)]
    assert not any(life.false_alarms for life in lives)


def test_without_the_drives_measurement_the_same_faults_give_more(transparent, measured):
    kinds = ("drive_reversed", "drive_triple", "drive_stuck")
    blind = [t for index in range(3) for t in trials.try_faults(transparent, index, SEED, kinds)]
    seeing = [t for index in range(3) for t in trials.try_faults(measured, index, SEED, kinds)]
    assert all(trial.did_something for trial in blind)
    assert max(t.excess for t in blind) > 1.0 > 4.0 * max(t.excess for t in seeing)
    shares = [_exported.found_share(made) for made in (blind, seeing)]
    assert shares[0] < shares[1] == 100.0


def test_a_memory_fault_hits_the_block_that_it_names(transparent):
    kinds = ("law_memory", "supervisor_memory")
    found = [t for index in range(4) for t in trials.try_faults(transparent, index, SEED, kinds)]
    assert all(t.is_found for t in found)
    by_law, by_supervisor = ({t.fault for t in found if t.kind == kind} for kind in kinds)
    assert by_law == {"integrity"}
    # A bound of the encoder's range, of its jumps or of a push that lost a bit speaks before the checksum does.
    assert "integrity" in by_supervisor <= {"integrity", "not_started", "range", "push", "jump"}


def test_an_alarm_is_wanted_only_for_what_truly_happened():
    run = {"velocity_limit": 8.0, "range_low": 0.0, "range_high": 2.3, "wearer_push": 8.0, "wearer_torque": 2.0}
    usual = {"event": "reach", "speed": 3.0, "lowest": 0.5, "highest": 1.5, "push": 4.0, "lasting": 1.0}
    assert trials.wanted_reason(run, **usual) == ""
    assert "velocity" in trials.wanted_reason(run, **usual | {"speed": 8.1})
    assert "range" in trials.wanted_reason(run, **usual | {"lowest": -0.01})
    assert "range" in trials.wanted_reason(run, **usual | {"highest": 2.31})
    assert trials.wanted_reason(run, **usual | {"push": 9.0}) == ""
    assert "momentary" in trials.wanted_reason(run, **usual | {"push": 9.0, "event": "spasm"})
    assert "lasting" in trials.wanted_reason(run, **usual | {"lasting": 2.5, "event": "impact"})
    assert trials.wanted_reason(run, **usual | {"lasting": 2.5}) == ""


def test_rows_and_figures_say_what_they_assume(measured, transparent):
    kinds = ("encoder_frozen", "drive_dead", "drive_sine", "wearer_spasm", "encoder_drift")
    blind, seeing = (tuple(trials.try_faults(law, 0, SEED, kinds)) for law in (transparent, measured))
    rows = {row.id: row for row in _exported.fault_rows("unmeasured", blind)}
    assert rows["safety.exported.unmeasured.worst_excess_energy"].unit == "J"
    assert "drive_dead" in rows["safety.exported.unmeasured.found_of_all"].note
    counted = [trial.kind for trial in _exported.shown(blind)]
    assert counted == ["encoder_frozen", "drive_dead"]
    sines = {row.id: row.value for row in _exported.shaking_rows(blind)}
    assert sines["safety.exported.unmeasured.shaking.worst_excess_energy"] > 0.0
    figures = list(fault_figures("unmeasured", blind, trials.KINDS)) + list(
        fault_figures("drive_measured", seeing, trials.KINDS)
    )
    assert {figure.fault for figure in figures if figure.hidden} == {"encoder_drift"}
    assert [figure.amplitude for figure in figures if figure.fault == "drive_sine"] == 2 * [*trials.SINE_AMPLITUDES_NM]


def test_starts_are_refused_only_without_a_reason(transparent):
    lives = trials.try_starts(transparent, 2, 2, SEED)
    assert len(lives) == 4
    assert not any(map(_exported.is_refused, lives))
    assert _exported.is_refused(replace(lives[0], started=float("nan")))
    rows = {row.id: row.value for row in _exported.start_rows({"transparent": lives})}
    assert rows["safety.default_exports.tried"] == 1
    assert rows["safety.default_exports.starts_refused"] == 0


# --- an added sine ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sensing(store):
    """A law that hears a force sensor, as `export` writes it by default."""
    return store.law("disturbance_observer", "blind")


def test_a_force_sensor_bounds_what_a_drive_adds(sensing, transparent):
    found = [t for index in range(3) for t in trials.try_faults(sensing, index, SEED, ("drive_sine",))]
    blind = [t for index in range(3) for t in trials.try_faults(transparent, index, SEED, ("drive_sine",))]
    assert "unexplained_energy" in {trial.fault for trial in found}
    assert not any(trial.early for trial in (*found, *blind))
    assert max(t.excess for t in found) < 5.0 < max(t.excess for t in blind)
    rows = {row.id: row for row in _exported.sine_set_rows({"force_sensor": found, "encoder_alone": blind})}
    name = "safety.exported.added_sine"
    assert rows[f"{name}.force_sensor.worst_excess_energy"].value == max(t.excess for t in found)
    assert rows[f"{name}.encoder_alone.worst_excess_energy"].value == max(t.excess for t in blind)
    assert rows[f"{name}.force_sensor.found"].value > rows[f"{name}.encoder_alone.found"].value


def test_healthy_wearers_do_not_use_the_energy_that_a_drive_may_add(sensing):
    lives = [trials.live(sensing, index, SEED, 60.0) for index in range(2)]
    assert all(life.running > 0.8 * 60.0 / 3600.0 for life in lives)
    assert "unexplained_energy" not in {alarm.fault for life in lives for alarm in life.alarms}


def test_what_a_drive_adds_is_bounded_unless_the_study_states_that_wearers_go_to_and_fro(store):
    exports = [store.law("transparent", name) for name in ("unmeasured", "to_and_fro")]
    assert [law.stops_oscillation for law in exports] == [True, False]
    sines = [trials.try_faults(law, 0, SEED, ("drive_sine",)) for law in exports]
    assert ["shaking" in {trial.fault for trial in each} for each in sines] == [True, False]
    assert not store.law("disturbance_observer", "unmeasured").stops_oscillation


def test_a_trace_shows_the_torque_that_nobody_explains(transparent):
    """What model and command do not explain, of a motion that is made up, behind the observer's lag."""
    numbers = transparent.numbers | {"body_offset": 0.25, "body_square_root": 0.1}
    law, step = replace(transparent, numbers=numbers), 0.002
    time = step * np.arange(4000)
    position, given = 1.0 + 0.3 * np.sin(3.0 * time), 2.0 * (time > 4.0)
    velocity, acceleration = np.diff(position, prepend=1.0) / step, -2.7 * np.sin(3.0 * time)
    weight = numbers["body_gravity_sine"] * np.sin(position) + numbers["body_gravity_cosine"] * np.cos(position) + 0.25
    level = numbers["body_coulomb"] + numbers["body_load"] * np.abs(weight)
    friction = level * np.clip(velocity / 0.1, -1.0, 1.0) + numbers["body_viscous"] * velocity
    friction += 0.1 * np.sign(velocity) * np.sqrt(np.abs(velocity))
    effort = numbers["body_inertia"] * acceleration + weight + friction - given
    trace = np.column_stack((position, effort, time > 1.0, np.where(time > 4.0, time - 4.0, -1.0), 0.0 * time))
    seen = motion_bounds.seen_motion(law, trace, 0.001)
    assert len(seen.torque) == np.sum(time > 1.0)
    np.testing.assert_allclose(seen.torque[500:1400], 0.0, atol=0.02)
    np.testing.assert_allclose(seen.torque[1700:], 2.0, atol=0.02)
    assert seen.fault.sum() == np.sum(time > 4.0)


def test_what_a_bound_leaves():
    fault = np.array([False, False, True, True, True])
    seen = motion_bounds.SeenMotion(0.1, np.zeros(5), np.zeros(5), fault, np.array([0.0, 0.0, 1.0, 2.0, 3.0]))
    assert motion_bounds.energy_left(np.array([9.0, 0.0, 0.5, 2.0, 0.0]), seen, 1.0) == 2.0
    assert motion_bounds.energy_left(np.array([9.0, 0.0, 0.5, 1.0, 1.0]), seen, 1.0) == 3.0
    np.testing.assert_allclose(motion_bounds.forget(np.ones(3), 1.0, 0.5), [0.5, 0.75, 0.875])
    np.testing.assert_allclose(motion_bounds.follow(np.ones(3), 1.0, 0.5), [0.5, 0.75, 0.875])
    ways = motion_bounds.to_and_fro(np.array([1.0, 1.0, -1.0]), 0.05)
    np.testing.assert_allclose(ways, [0.0, 0.0, 0.375])


def test_bounds_without_a_force_sensor_leave_more_than_the_bar(transparent, monkeypatch):
    monkeypatch.setattr(motion_bounds, "PLANT_COUNT", 2)
    monkeypatch.setattr(motion_bounds, "LIFE_S", 60.0)
    made = motion_bounds.measure_bounds((transparent,), SEED)
    assert [bound.name for bound in made] == list(motion_bounds.BOUNDED)
    assert all(bound.needed > 0.0 and bound.left.shape == (6,) for bound in made)
    assert min(bound.left.max() for bound in made) > motion_bounds.BAR_J
    assert all(0.0 <= bound.stopped <= 1.0 and bound.bar < bound.needed for bound in made)


# --- what an export does that cannot see its drive -------------------------------------------------------------------


@pytest.fixture(scope="module")
def asked(store):
    """A law as `export` writes it by default where nothing is said of the drive."""
    return store.law("transparent", "unmeasured")


def test_a_default_export_finds_a_wrong_drive(asked):
    kinds = ("drive_reversed", "drive_triple", "drive_dead", "encoder_frozen_at_rest")
    found = [t for index in range(3) for t in trials.try_faults(asked, index, SEED, kinds)]
    assert all(trial.is_found for trial in found if trial.amplitude in (0.0, 5.0) and not trial.early)
    assert max(t.excess for t in found if t.kind != "drive_sine") < 5.0
    frozen = [t for t in found if t.kind == "encoder_frozen_at_rest"]
    assert {t.fault for t in frozen} == {"frozen"}
    assert max(t.found for t in frozen) < 2.0


def test_a_wrong_rate_is_found_and_jitter_is_none(asked):
    kinds = ("rate_half", "rate_quarter", "rate_double", "rate_twice")
    found = [t for index in range(2) for t in trials.try_faults(asked, index, SEED, kinds) if not t.early]
    assert all(trial.is_found and trial.found < 0.5 for trial in found)
    changed = {"clock_jitter": 0.2e-3, "clock_bits": 32.0, "clock_start": 2.0**32 - 20e6, "reaching": 1.0}
    lives = [trials.live(asked, index, SEED, 60.0, **changed) for index in range(2)]
    alarms = {alarm.fault for life in lives for alarm in life.alarms}
    assert not alarms & set(_exported.CLOCK_FAULTS)
    assert all(life.running > 0.8 * 60.0 / 3600.0 for life in lives)


def test_one_wrong_reading_of_the_drive_stops_nobody(measured):
    spikes = [t for index in range(12) for t in trials.try_faults(measured, index, SEED, ("current_spike",))]
    assert not [t for t in spikes if t.is_found and t.found < 0.1]
