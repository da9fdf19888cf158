"""The virtual knee orthosis: what its wearers do, what its instruments see, and that files and memory hold the same."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import StudyError
from pellucid.models.joint import GRAVITY
from pellucid_lab.init import start_study
from pellucid_lab.knee.drawn import STRAP_EFFECT_RANGES, drawn_rig, drawn_strap
from pellucid_lab.knee.instruments import draw_mounting, rotation, take_imu
from pellucid_lab.knee.protocol import (
    Faults,
    KneeTrial,
    bench_trials,
    imu_trial,
    mvc_trial,
    relaxed_trial,
    sine,
    swing_trial,
    torque_trial,
)
from pellucid_lab.knee.rig import KneeRig, knee_orthosis
from pellucid_lab.knee.trial import run_trial
from pellucid_lab.known_rigs import rig_text
from pellucid_lab.simulate import simulate
from pellucid_lab.strap_options import STRAP_OPTIONS, without_strap_options
from pellucid_lab.study import record_in_memory, write_study

RIG = knee_orthosis()
SUBJECTS = RIG.subjects
S1 = SUBJECTS["S1"]
PLAIN = RIG.strapped(without_strap_options())
"""Whose straps are springs with dampers."""


def take(trial, seed=1, rig=RIG, **settings):
    return run_trial(rig, trial, rng=np.random.default_rng(seed), **settings)


class Zero:
    """Zero-impedance mode, and what it was told."""

    def __init__(self):
        self.calls = []

    def step(self, time, position, torque, emg):
        self.calls.append((time, position, torque, tuple(emg)))
        return 0.0


# ---- wearers ----


@pytest.mark.parametrize("name", SUBJECTS)
def test_mismatch_in_zero_impedance_mode(name):
    """5 to 18 degrees, as the thesis's 0.088 to 0.307 rad; the limb swings over the range it was meant to."""
    taken = take(swing_trial(RIG, "x", SUBJECTS[name], duration=30.0))
    moving = slice(1000, None)
    assert 0.088 < np.std(taken.truth.mismatch[moving]) < 0.307
    assert 0.15 < np.std(taken.truth.limb_position[moving]) < 0.4
    assert not taken.command.any()
    q = taken.truth.limb_position[moving]
    power, f = np.abs(np.fft.rfft(q - np.mean(q))) ** 2, np.fft.rfftfreq(len(q), 2e-3)
    assert 0.5 < np.sum(f * power) / np.sum(power) < 1.0
    assert np.sum(power[(f > 0.4) & (f < 1.15)]) > 0.8 * np.sum(power)


def test_the_limb_does_not_follow_from_the_orthosis_alone():
    """The mismatch is what the strap's torque says, slip aside; so it can be found, and it is not noise."""
    truth = take(swing_trial(PLAIN, "x", PLAIN.subjects["S1"], duration=20.0), rig=PLAIN).truth
    rate = truth.limb_velocity - truth.orthosis_velocity
    torque = S1.strap["stiffness"] * truth.mismatch + S1.strap["damping"] * rate
    np.testing.assert_allclose(truth.strap_torque, torque, atol=1e-9)


def test_a_strap_is_that_of_the_core():
    truth = take(swing_trial(RIG, "x", S1, duration=20.0)).truth
    strap = [
        {**dict.fromkeys(_core.STRAP_PARAMETER_NAMES, 0.0), **{f"strap_{k}": v for k, v in RIG.strap_of(S1).items()}}[n]
        for n in _core.STRAP_PARAMETER_NAMES
    ]
    motion = truth.orthosis_position, truth.orthosis_velocity, truth.limb_position, truth.limb_velocity
    _, torque, slip = _core.strap_torque(strap, *motion, period=RIG.period)
    # The plant's substeps are ten times as fine.
    np.testing.assert_allclose(truth.strap_torque, torque, atol=0.01 * np.ptp(torque))
    np.testing.assert_allclose(truth.slip, slip, atol=0.05 * np.max(np.abs(slip)))


def test_torque_comes_after_emg():
    """By the electromechanical delay: pure delay and activation together, 52 ms."""
    truth = take(swing_trial(RIG, "x", S1, duration=40.0)).truth
    flexor, torque = truth.excitation[1000:, 0], truth.muscle_torque[1000:]
    scores = [np.corrcoef(flexor[: -lag or None], torque[lag:])[0, 1] for lag in range(60)]
    assert 2.0 * np.argmax(scores) == pytest.approx(52.0, abs=12.0)


def test_torque_is_not_in_proportion_to_excitation():
    """A map without error would leave nothing to find."""
    truth = take(torque_trial(RIG, "x", S1, np.radians(45))).truth
    a, b = truth.excitation[:-26].T
    design = np.column_stack([a, b, np.ones_like(a)])
    left = truth.muscle_torque[26:] - design @ np.linalg.lstsq(design, truth.muscle_torque[26:], rcond=None)[0]
    assert 0.1 < np.std(left) < 0.4 * np.std(truth.muscle_torque)


def test_relaxed_means_relaxed():
    still = take(relaxed_trial(RIG, "x", S1))
    helping = take(relaxed_trial(RIG, "x", S1, helps=True))
    assert np.abs(np.mean(still.truth.muscle_torque)) < 0.1
    assert np.mean(helping.truth.muscle_torque) > 1.0
    assert np.std(helping.emg[:, 1]) > 2.0 * np.std(still.emg[:, 1])
    assert np.std(still.truth.mismatch) < 0.005


@pytest.mark.parametrize("name", SUBJECTS)
@pytest.mark.parametrize("angle", [0, 45, 90])
def test_angles_are_held_against_torques(name, angle):
    taken = take(torque_trial(RIG, "x", SUBJECTS[name], np.radians(angle)))
    assert np.std(taken.truth.limb_position) < 0.25
    for at, torque in ((8.0, 5.0), (13.0, 10.0), (23.0, -5.0), (28.0, -10.0)):
        window = (taken.time > at) & (taken.time < at + 2.0)
        # Within what friction leaves behind the torque loop's gain: 4.2 / 1.8, less what its integral has taken.
        assert np.mean(taken.torque[window]) == pytest.approx(torque, abs=1.5)


def test_torque_in_holds_balances_gravity_and_orthosis():
    """Mean over a settled step: the muscles carry the limb, the orthosis's weight and what it pushes."""
    straight = RIG.strapped(without_strap_options("askew"))
    taken = take(torque_trial(straight, "x", straight.subjects["S1"], np.radians(60)), rig=straight)
    window = (taken.time > 8.0) & (taken.time < 10.0)
    truth = taken.truth
    q_k, q_e = truth.limb_position[window], truth.orthosis_position[window]
    weight = S1.gravity * np.sin(q_k - S1.limb["ahead"]) + RIG.orthosis_gravity[0] * np.sin(q_e)
    pushed = np.mean(truth.spring_torque[window])
    assert np.mean(truth.muscle_torque[window]) == pytest.approx(np.mean(weight) - pushed, abs=0.15)


def test_mvc_is_the_largest_emg():
    mvc = take(mvc_trial(RIG, "x", S1))
    held = take(torque_trial(RIG, "x", S1, np.radians(90)))
    assert (np.std(mvc.emg, axis=0) > 2.0 * np.std(held.emg, axis=0)).all()
    assert np.ptp(mvc.truth.limb_position) < 1e-5


def test_pace_and_amplitude_can_be_asked_for():
    taken = take(swing_trial(RIG, "x", S1, duration=20.0, frequency=(0.7, 0.7), amplitude=(0.3, 0.3)))
    q = taken.truth.limb_position[2000:]
    spectrum = np.abs(np.fft.rfft(q - np.mean(q)))
    assert np.argmax(spectrum) / (len(q) * 2e-3) == pytest.approx(0.7, abs=0.07)


# ---- the orthosis ----


def test_position_loop_follows_sines_and_stays_within_its_torque():
    for frequency in (0.3, 1.0):
        trial = KneeTrial("x", "sine_tracking", reference=sine(RIG, frequency, 1.0, 10.0))
        taken = take(trial)
        assert np.std(taken.position - trial.reference) < 0.25
        assert np.max(np.abs(taken.position[500:])) > 0.75
        assert np.max(np.abs(taken.torque)) < 6.0
        assert taken.emg is None
        assert taken.imu is None


def test_gravity_is_in_the_holds():
    taken = take(bench_trials(RIG)[0])
    end = np.abs(np.diff(taken.truth.orthosis_position, append=0.0)) == 0.0
    q, torque = taken.position[end], taken.torque[end]
    design = np.column_stack([np.sin(q), np.cos(q)])
    sine_, _ = np.linalg.lstsq(design, torque, rcond=None)[0]
    assert sine_ == pytest.approx(RIG.orthosis_gravity[0], rel=0.01)


def test_a_wearer_without_a_strap_feels_nothing():
    rig = RIG.strapped(dict.fromkeys(("stiffness", "damping", "relaxing_stiffness"), 0.0))
    truth = take(swing_trial(rig, "x", rig.subjects["S1"], duration=5.0), rig=rig).truth
    assert not truth.strap_torque.any()


# ---- controllers ----


def test_a_controller_is_told_what_instruments_say():
    controller = Zero()
    taken = take(swing_trial(RIG, "x", S1, duration=4.0), controller=controller)
    times, positions, torques, emg = zip(*controller.calls, strict=True)
    np.testing.assert_array_equal(times, taken.time)
    np.testing.assert_array_equal(positions, taken.position)
    np.testing.assert_array_equal(torques, taken.torque)
    assert emg[0] == ()
    assert {len(samples) for samples in emg[1:]} == {4, 5}
    samples = np.array([sample for samples in emg for sample in samples])
    np.testing.assert_allclose(samples, taken.emg_quantum * taken.emg[: len(samples)], atol=1e-12)
    assert len(taken.emg) - len(samples) in (4, 5)


def test_a_controller_that_asks_for_nothing_is_zero_impedance_mode():
    trial = swing_trial(RIG, "x", S1, duration=4.0)
    alone, controlled = take(trial), take(trial, controller=Zero())
    np.testing.assert_array_equal(alone.truth.limb_position, controlled.truth.limb_position)
    np.testing.assert_array_equal(alone.emg, controlled.emg)


def test_a_controller_can_carry_the_orthosis():
    class Carry:
        def step(self, time, position, torque, emg):
            return RIG.orthosis_gravity[0] * float(np.sin(position))

    trial = replace(torque_trial(RIG, "x", S1, np.radians(60)), reference=np.zeros(6000), imu=None)
    light = take(trial, controller=Carry()).truth
    heavy = take(trial).truth
    assert abs(np.mean(light.strap_torque[1000:])) < 0.3 * abs(np.mean(heavy.strap_torque[1000:]))


# ---- instruments ----


def test_imu_senses_what_the_arc_makes():
    """Against positions differentiated in the laboratory's frame."""
    still = RIG.changed(

        {f"imu.{name}": 0.0 for name in (
            "accelerometer_noise", "gyroscope_noise", "magnetometer_noise", "gyroscope_drift", "disturbance", "sway",
            "jitter", "remounting", "accelerometer_bias", "gyroscope_bias", "magnetometer_bias", "clock_drift",
        )} | {"imu.quanta": [1e-12, 1e-12, 1e-18]},
    )  # fmt: skip
    t = 2e-3 * np.arange(5000)
    angle, velocity = 0.6 + 0.5 * np.sin(4 * t), 2.0 * np.cos(4 * t)
    rng = np.random.default_rng(1)
    imu = take_imu(still, S1, angle, velocity, draw_mounting(still, rng), rng)
    at = imu.clock_offset + imu.time
    mount = rotation(still["imu"]["mounting"])
    along, across = 0.86 * S1.shank_length, 0.045

    def axes(s):
        """Along and across the segment in the laboratory: x towards where the heel swings, z up."""
        q = 0.6 + 0.5 * np.sin(4 * s)
        return np.array([np.sin(q), -np.cos(q)]), np.array([np.cos(q), np.sin(q)])

    def place(s):
        u, w = axes(s)
        return along * u + across * w

    h = 1e-4
    for k in range(5, 150, 20):
        second = (place(at[k] + h) - 2 * place(at[k]) + place(at[k] - h)) / h**2
        force = second + np.array([0.0, GRAVITY])
        u, w = axes(at[k])
        sensed = mount.T @ imu.acceleration[k]
        assert sensed == pytest.approx([force @ u, force @ w, 0.0], abs=2e-3)
        assert mount.T @ imu.angular_velocity[k] == pytest.approx([0.0, 0.0, 2.0 * np.cos(4 * at[k])], abs=1e-3)
        field = mount.T @ imu.magnetic_field[k]
        assert np.linalg.norm(field) == pytest.approx(still["imu"]["field"], rel=1e-6)
        down = field[0] * -u[1] + field[1] * -w[1]
        assert down == pytest.approx(still["imu"]["field"] * np.sin(still["imu"]["dip"]), rel=1e-4)


def test_imu_has_a_clock_of_its_own_and_noise():
    taken = take(imu_trial(RIG, "x"))
    imu = taken.imu
    assert 0.0 < imu.clock_offset < 0.5
    assert 1.0 / np.mean(np.diff(imu.time)) == pytest.approx(20.0, rel=1e-3)
    assert (np.diff(imu.time) > 0).all()
    assert np.mean(np.linalg.norm(imu.acceleration, axis=1)) == pytest.approx(GRAVITY, abs=0.6)
    six = RIG.changed({"imu.magnetometer": False})
    assert take(imu_trial(six, "x"), rig=six).imu.magnetic_field is None


def test_encoders_have_steps():
    taken = take(swing_trial(RIG, "x", S1, duration=2.0))
    for values, quantum in ((taken.position, 9.6e-5), (taken.motor_position, 2.4e-5)):
        np.testing.assert_allclose(values / quantum, np.round(values / quantum), atol=1e-6)
    spring = RIG["spring"]
    calibrated = spring["stiffness"] * (1.0 + spring["calibration_error"])
    np.testing.assert_allclose(taken.torque, calibrated * (taken.motor_position - taken.position), atol=1e-9)


# ---- faults ----


def test_faults_are_where_they_should_be():
    def swing(**faults):
        return take(swing_trial(holds, "x", S1, duration=10.0, faults=Faults(**faults)), rig=holds)

    holds = RIG.strapped(without_strap_options("creeping"))
    usual = swing()
    silent = swing(imu_dropout=(4.0, 2.0)).imu
    assert np.max(np.diff(silent.time)) == pytest.approx(2.0, abs=0.1)
    assert np.max(np.diff(usual.imu.time)) < 0.06
    slipped = swing(slip=(5.0, 0.2)).truth
    assert slipped.slip[2500] == 0.0
    assert (slipped.slip[2502:] == 0.2).all()
    shift = np.mean(slipped.mismatch[3500:]) - np.mean(usual.truth.mismatch[3500:])
    assert shift == pytest.approx(0.2, abs=0.08)
    wrapped = swing(encoder_turn=np.pi - 0.5).position
    assert np.max(np.abs(np.diff(wrapped))) > 6.0
    np.testing.assert_allclose(
        np.unwrap(wrapped) - np.unwrap(wrapped)[0], usual.position - usual.position[0], atol=1e-9
    )
    assert 1.0 / np.mean(np.diff(swing(emg_rate=1000.0).emg_time)) == pytest.approx(1000.0)
    detached = swing(emg_detached={1: 0.0})
    assert abs(np.corrcoef(detached.emg[:, 1], usual.emg[:, 1])[0, 1]) < 0.3
    np.testing.assert_array_equal(detached.emg[:, 0], usual.emg[:, 0])
    clipped = swing(emg_clipped={1: 5e-5})
    assert np.max(np.abs(clipped.emg[:, 1])) * clipped.emg_quantum <= 5e-5
    np.testing.assert_array_equal(clipped.emg[:, 0], usual.emg[:, 0])


def test_a_strap_can_creep_and_be_slack():
    creeping = RIG.strapped({"hold": 1.0, "mobility": 0.02})
    truth = take(swing_trial(creeping, "x", creeping.subjects["S1"], duration=10.0), rig=creeping).truth
    assert np.max(np.abs(truth.slip)) > 0.02
    slack = RIG.strapped({**without_strap_options(), "slack": 0.1})
    truth = take(swing_trial(slack, "x", slack.subjects["S1"], duration=10.0), rig=slack).truth
    inside = np.abs(truth.mismatch) < 0.05
    assert np.count_nonzero(inside) > 50
    assert not truth.strap_torque[inside].any()
    assert truth.strap_torque[np.abs(truth.mismatch) > 0.15].all()


def in_swing(*options):
    """Mismatch, its rate, and torque of a strap without these options, 30 s, which creeps as far as it would in ten
    minutes."""
    rig = RIG.strapped({"mobility": 0.003, **without_strap_options(*options)})
    truth = take(swing_trial(rig, "x", rig.subjects["S1"], duration=30.0), rig=rig).truth
    return truth.mismatch, truth.limb_velocity - truth.orthosis_velocity, truth.strap_torque


@pytest.mark.parametrize("option", STRAP_OPTIONS)
def test_every_option_of_a_strap_shows(option):
    """In what the best spring and damper leave of the torque."""

    def left(mismatch, rate, torque):
        basis = np.stack([mismatch, rate, np.ones(len(mismatch))], axis=1)
        return np.std(torque - basis @ np.linalg.lstsq(basis, torque)[0]) / np.std(torque)

    assert left(*in_swing()) < 1e-9
    assert left(*in_swing(*(other for other in STRAP_OPTIONS if other != option))) > 1e-3


def test_a_drawn_strap_has_what_the_rig_has_whoever_draws():
    whole, one = RIG, RIG.strapped(without_strap_options(*(o for o in STRAP_OPTIONS if o != "slack")))
    for seed in range(20):
        strap = drawn_strap(whole, 20.0, seed)
        assert all(
            low <= strap[name] <= high
            for name, (low, high) in STRAP_EFFECT_RANGES.items()
            if name != "relaxing_stiffness"
        )
        assert max(abs(strap["across"]), abs(strap["along"])) <= 0.1
        assert drawn_strap(one, 20.0, seed)["slack"] == strap["slack"]
        bare = one.strap_of(drawn_rig(one, seed).subjects[f"D{seed}"])
        assert not any(bare[name] for names in STRAP_OPTIONS.values() for name in names if name != "slack")


# ---- studies ----


def small(rig):
    """One of each kind."""
    return (
        KneeTrial("response_10", "sine_tracking", "validate", reference=sine(rig, 1.0, 1.0, 2.0)),
        imu_trial(rig, "S2_imu", "S2"),
        swing_trial(rig, "S2_swing_1", rig.subjects["S2"], use="validate", duration=4.0),
    )


def test_files_and_memory_hold_the_same(tmp_path):
    study = write_study(tmp_path, RIG, name="knee", seed=3, trials=small(RIG))
    config, recordings, taken = record_in_memory(RIG, small(RIG), seed=3)
    assert config.participants == study.config.participants
    assert config.coupling == study.config.coupling
    assert study.config.participants["S2"].shank_length == 0.55
    for from_memory, from_file in zip(recordings, study.recordings(), strict=True):
        assert from_memory.name == from_file.name
        assert from_memory.use == from_file.use
        assert from_memory.participant == from_file.participant
        assert set(from_memory.streams) == set(from_file.streams)
        pairs = [(from_memory, from_file)]
        pairs += [(from_memory.streams[name], from_file.streams[name]) for name in from_file.streams]
        for a, b in pairs:
            assert a.name == b.name
            assert set(a.channels) == set(b.channels)
            for name, channel in b.channels.items():
                assert a.channels[name].unit == channel.unit
                np.testing.assert_array_equal(a[name], b[name], err_msg=f"{b.name} {name}")
    swing = study.recording("S2_swing_1")
    assert set(swing.streams) == {"emg", "imu"}
    assert swing.streams["emg"].fs == pytest.approx(2048.0)
    np.testing.assert_allclose(swing["position"], taken[2].inside.position, atol=1e-12)
    truth = json.loads((tmp_path / "lab" / "truth.json").read_text())
    assert truth["subjects"]["S2"]["strap_stiffness"] == SUBJECTS["S2"].strap["stiffness"]
    assert truth["trials"]["S2_swing_1"]["mismatch_sd"] == pytest.approx(np.std(taken[2].inside.truth.mismatch[1000:]))


def test_the_truth_is_not_in_the_study(tmp_path):
    write_study(tmp_path, RIG, name="knee", seed=3, trials=small(RIG))
    text = (tmp_path / "study.toml").read_text()
    for value in (S1.strap["stiffness"], S1.limb["mass"], S1.limb["centre"], RIG["orthosis"]["inertia"]):
        assert str(value) not in text
    assert "S1_swing" not in text


def test_a_trial_depends_on_seed_and_name_alone():
    every = {one.trial.name: one.inside for one in RIG.record_all(small(RIG), 5)}
    (alone,) = (one.inside for one in RIG.record_all(small(RIG)[2:], 5))
    np.testing.assert_array_equal(alone.emg, every["S2_swing_1"].emg)
    np.testing.assert_array_equal(alone.imu.acceleration, every["S2_swing_1"].imu.acceleration)
    (other,) = (one.inside for one in RIG.record_all(small(RIG)[2:], 6))
    assert not np.array_equal(other.position, alone.position)


def test_six_axes_have_no_magnetic_channels():
    six = RIG.changed({"imu.magnetometer": False})
    config, recordings, _ = record_in_memory(six, small(six)[1:2], seed=1)
    assert config.coupling.magnetometer is False
    assert not [name for name in recordings[0].streams["imu"].channels if "magnetic" in name]


def test_the_protocol_is_that_of_the_five_experiments():
    made = {trial.name: trial for trial in RIG.trials()}
    assert {"gravity", "response_03", "response_check_10", "S1_imu", "S3_relaxed_3", "S2_mvc"} <= set(made)
    assert sum(name.startswith("S1_torque_") for name in made) == 18
    assert {made[f"S2_swing_{i}"].use for i in (1, 2)} == {"fit"}
    assert made["S2_swing_3"].use == "validate"
    for name, trial in made.items():
        assert (trial.wearer is not None) == (name.startswith("S") and not name.endswith("_imu"))
        assert trial.participant == (name[:2] if name.startswith("S") else None)
        if name.startswith("response"):
            assert len(trial.reference) * RIG.period >= 35.0
    assert made["S1_relaxed_1"].link == "plate"


def test_init_and_simulate(tmp_path, monkeypatch):
    """The whole path on a short protocol."""
    monkeypatch.setattr(KneeRig, "trials", lambda rig, seed: small(rig))
    start_study(tmp_path / "knee", "knee-orthosis")
    done = simulate(tmp_path / "knee", seed=2)
    assert done.recordings == 3
    assert done.study.name == "knee"
    assert done.joint_time == pytest.approx(sum(len(t.reference) for t in small(RIG)) * 2e-3)


# ---- the rig ----


def test_limbs_are_people_and_not_tables():
    """Mass, centre and gyration within reach of Winter's, and none of them equal."""
    for subject in SUBJECTS.values():
        share = subject.limb["mass"] / (0.061 * subject.weight)
        length = 0.5 * (subject.shank_length + 0.246 * subject.height)
        centre = subject.limb["centre"] / (0.606 * length)
        gyration = subject.limb["gyration"] / (0.416 * length)
        for ratio in (share, centre, gyration):
            assert 0.001 < abs(ratio - 1.0) < 0.15


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("kind = ", "kind ="[:-1] + " "), "not valid TOML"),
        (lambda text: text.replace('"knee-orthosis"', '"knee"'), "found kind = 'knee'"),
        (lambda text: text.replace("tremor = ", "tremour = "), "[wearer] lacks tremor"),
        (lambda text: text.replace("shank_length = 0.55", ""), "[subjects.S2] lacks shank_length"),
        (lambda text: text[: text.index("[subjects.S1]")], "at least one"),
    ],
)
def test_a_rig_that_is_not_one(change, said):
    with pytest.raises(StudyError) as raised:
        KneeRig.parse(change(rig_text("knee-orthosis")), "mine")
    assert said in str(raised.value)
    assert "mine" in str(raised.value)


def test_an_unknown_constant_is_refused():
    with pytest.raises(StudyError, match=r"no constant strap\.colour"):
        RIG.changed({"strap.colour": 1.0})
