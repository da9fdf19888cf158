"""The virtual shank exoskeleton: who sits in it, balance of its truth, files as in memory, steps 1 and 2."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import IdentificationError, StudyError
from pellucid.emg.models.muscle_geometry import muscle_table
from pellucid.models.joint import GRAVITY
from pellucid.orthosis.study.loaded_swing.identify_loaded_swing import identify_swings
from pellucid.orthosis.study.loaded_swing.loaded_swing_page import _panels
from pellucid_lab.known_rigs import rig_text
from pellucid_lab.seated import swing_design
from pellucid_lab.seated.muscles import torque_at_rest
from pellucid_lab.seated.protocol import seated_trials
from pellucid_lab.seated.rig import SeatedRig, load_seated_rig
from pellucid_lab.seated.subject import subjects
from pellucid_lab.study import record_in_memory, write_study

pytestmark = pytest.mark.slow

RIG = load_seated_rig()


@pytest.fixture(scope="module")
def made():
    with pytest.MonkeyPatch.context() as patch:
        # Fewer limits of the acceleration are tried for the swing that shows inertia: it takes most of the time.
        patch.setattr(swing_design, "_ACCELERATION_LIMIT_COUNT", 3)
        return seated_trials(RIG, ("S4",))


@pytest.fixture(scope="module")
def taken(made):
    return record_in_memory(RIG, made, seed=1)


@pytest.fixture(scope="module")
def identified(taken):
    config, recordings, _ = taken
    return identify_swings(config, recordings)


def test_the_subjects_are_as_old_tall_and_heavy_as_the_papers():
    for key, scale, mean, sd in (
        ("age", 1, 23.875, 0.8345),
        ("height", 100, 173.875, 5.693),
        ("weight", 1, 65.5, 7.0912),
    ):
        values = scale * np.array([s[key] for s in RIG["subjects"].values()], float)
        assert values.mean() == pytest.approx(mean, abs=1e-9), key
        assert values.std(ddof=1) == pytest.approx(sd, abs=5e-4), key


def test_muscles_differ_from_the_anatomical_model_by_5_to_15_percent():
    for s in subjects(RIG).values():
        for m in s.muscles:
            usual = muscle_table().constants[m.name]
            off = [
                m.constants.optimal_fibre_length / (m.size * usual.optimal_fibre_length) - 1.0,
                m.constants.max_velocity / usual.max_velocity - 1.0,
                m.constants.force_length_width / usual.force_length_width - 1.0,
                m.arm - 1.0,
            ]
            assert np.all(np.abs(np.abs(off) - 0.10) <= 0.05 + 1e-12), (s.name, m.name)
        # Young adults extend with 80 to 250 N m where the shank hangs.
        assert 80.0 < torque_at_rest(s.extensors, 1.0, s.hip, s.rest) < 250.0


def test_the_truth_balances(taken):
    """Shank: inertia times acceleration is what muscles, shells, weight and tissue give."""
    subject = subjects(RIG)["S4"]
    one = next(t for t in taken[2] if t.trial.name == "S4_swing_1").inside.truth
    acceleration = np.gradient(one.velocity, RIG.period)
    weight = GRAVITY * subject.moment * np.sin(one.position - subject.ahead)
    given = one.muscle_torque + one.shell_torque - weight - subject.viscous * one.velocity
    left = (subject.inertia * acceleration - given)[50:-50]
    # The shells' own swing of 50 Hz is not resolved at 500 Hz.
    smooth = np.convolve(left, np.ones(25) / 25, mode="valid")
    assert np.sqrt(np.mean(smooth**2)) < 0.05 * np.std(one.muscle_torque)


def test_a_subject_swings_both_ways_as_fast_as_asked(taken):
    truth = next(t for t in taken[2] if t.trial.name == "S4_swing_1").inside.truth
    turned = truth.position - truth.position.mean()
    crossings = np.sum((turned[1:] >= 0.0) & (turned[:-1] < 0.0))
    assert crossings / (len(turned) * RIG.period) == pytest.approx(RIG["subjects"]["S4"]["frequency"], rel=0.1)
    assert truth.muscle_torque.max() > 3.0
    assert truth.muscle_torque.min() < -1.0
    assert truth.excitation[:, 3].max() > 0.01  # the intermedius acts, and no channel shows it
    assert "emg.vastus_intermedius" not in next(r for r in taken[1] if r.name == "S4_swing_1").streams["emg"].channels


def test_files_hold_what_memory_holds(taken, made, tmp_path):
    short = [t for t in made if t.name in ("empty_two_sines", "S4_mvc")]
    study = write_study(tmp_path, RIG, name="seat", seed=1, trials=short)
    for read in study.recordings():
        kept = next(r for r in taken[1] if r.name == read.name)
        assert np.array_equal(read["position"], kept["position"])
        assert np.array_equal(read["torque"], kept["torque"])
    mvc = next(r for r in study.recordings() if r.name == "S4_mvc")
    assert np.array_equal(mvc["angle.knee"], next(r for r in taken[1] if r.name == "S4_mvc")["angle.knee"])


def test_steps_1_and_2_find_the_leg(identified):
    found = identified
    subject = subjects(RIG)["S4"]
    assert found.empty.inertia.value == pytest.approx(RIG.exoskeleton_inertia, rel=0.05)
    assert found.legs["S4"].inertia.value == pytest.approx(subject.inertia, rel=0.1)
    assert found.legs["S4"].weight_moment.value > subject.moment
    assert {card.kind for card in found.cards.values()} == {"orthosis", "limb"}


def test_whose_leg_it_is_does_not_hang_on_a_recordings_name(taken, identified):
    config, recordings, _ = taken
    found = identified
    renamed = identify_swings(config, [replace(r, name=f"trial_{i}") for i, r in enumerate(recordings)])
    assert [*renamed.cards["S4.limb"].checksums.values()] == [*found.cards["S4.limb"].checksums.values()]
    bodies = {who for made in (found, renamed) for who in made.wearers.values()}
    assert bodies == {None, "S4"}
    # A leg weighs more than the exoskeleton: against the exoskeleton alone its torque is missed by far.
    for drawn in _panels(renamed):
        measured, fitted = drawn.lines["measured"], drawn.lines["fitted"]
        assert np.std(measured - fitted) < 0.3 * np.std(measured), drawn.rest


def test_cards_and_rows_of_swings_say_what_was_found(taken):
    config, recordings, _ = taken
    wide = config.loaded_swing.model_copy(update={"confidence": 0.5})
    found = identify_swings(config.model_copy(update={"loaded_swing": wide}), recordings)
    leg, limb = found.legs["S4"], found.cards["S4.limb"]
    both = (found.empty.covariance + leg.loaded.covariance)[:2, :2]
    assert np.array(limb.covariance) == pytest.approx(both[::-1, ::-1] * np.outer([GRAVITY, 1.0], [GRAVITY, 1.0]))
    correlation = limb.covariance[0][1] / np.sqrt(limb.covariance[0][0] * limb.covariance[1][1])
    assert abs(correlation) > 0.1
    for card in found.cards.values():
        spread = [p.standard_error for p in card.parameters]
        assert np.sqrt(np.diag(card.covariance)) == pytest.approx(spread)
        low, high = card.parameters[0].interval
        assert high - low == pytest.approx(2.0 * 0.6745 * spread[0], rel=1e-3)
    rows = {row.id.split(".", 1)[1]: row for row in found.rows}
    assert rows["S4.p"].note == f"+- {0.6745 * leg.inertia.standard_error:.3g}"
    assert all(len(row.data_checksum) == 64 for row in found.rows)
    # A leg by difference comes from both bodies' recordings, its residual from its own.
    assert len({rows[name].data_checksum for name in ("S4.p", "S4.residual", "exoskeleton.p")}) == 3


def test_without_the_exoskeleton_alone_there_is_no_leg(taken):
    config, recordings, _ = taken
    with pytest.raises(IdentificationError, match="empty_swing"):
        identify_swings(config, [r for r in recordings if r.protocol != "empty_swing"])


def test_the_papers_swing_alone_is_told_to_say_little_of_inertia(taken):
    config, recordings, _ = taken
    found = identify_swings(config, [r for r in recordings if not r.name.endswith("rich")])
    leg = found.legs["S4"]
    assert leg.inertia.standard_error > 0.05 * leg.inertia.value


def test_a_rig_that_lacks_something_is_refused():
    text = rig_text("knee-seated").replace("reflex_delay = ", "reflex = ")
    with pytest.raises(StudyError, match=r"wearer.*reflex_delay"):
        SeatedRig.parse(text, "mine")
    with pytest.raises(StudyError, match="knee-seated"):
        SeatedRig.parse('kind = "other"\n', "mine")
