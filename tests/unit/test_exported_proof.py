"""The proof on exported controllers: its plant keeps energy, its wearer arrives, its bounds can fail."""

from __future__ import annotations

import shutil
from dataclasses import replace
from functools import cached_property

import numpy as np
import pytest
from evidence import _exported
from evidence._exported import exports, foreign_people, table, trials
from test_export_elbow import CARDS, STUDY

import pellucid
from pellucid.deployment.c_folder import write_c_folder
from pellucid.deployment.export import values_for
from pellucid.models.card import CardParameter, write_card
from pellucid.models.slider_card import SliderCard

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
    return store.law("transparent", "unmeasured")


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
    # A bound of the encoder's range that lost a bit speaks before the checksum does.
    assert "integrity" in by_supervisor <= {"integrity", "not_started", "range"}


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


def test_rows_and_tables_say_what_they_assume(measured, transparent):
    kinds = ("encoder_frozen", "drive_dead", "drive_sine", "wearer_spasm", "encoder_drift")
    blind, seeing = (tuple(trials.try_faults(law, 0, SEED, kinds)) for law in (transparent, measured))
    rows = {row.id: row for row in _exported.fault_rows("unmeasured", blind)}
    assert rows["safety.exported.unmeasured.worst_excess_energy"].unit == "J"
    assert "drive_dead" in rows["safety.exported.unmeasured.found_of_all"].note
    counted = [trial.kind for trial in _exported.shown(blind)]
    assert counted == ["encoder_frozen", "drive_dead"]
    sines = {row.id: row.value for row in _exported.sine_rows(blind)}
    assert sines["safety.exported.added_sine.worst_excess_energy"] > 0.0
    lines = list(table.table_lines({"unmeasured": blind, "drive_measured": seeing}))
    assert any("as exported by default" in line for line in lines)
    assert any(line.startswith("| `encoder_drift` *") for line in lines)


def test_starts_are_refused_only_without_a_reason(transparent):
    lives = trials.try_starts(transparent, 2, 2, SEED)
    assert len(lives) == 4
    assert not any(map(_exported.is_refused, lives))
    assert _exported.is_refused(replace(lives[0], started=float("nan")))
    rows = {row.id: row.value for row in _exported.start_rows({"transparent": lives})}
    assert rows["safety.default_exports.tried"] == 1
    assert rows["safety.default_exports.starts_refused"] == 0
