"""The public recordings as studies: what their owners state of them, and no fault where there is none."""

import numpy as np
import pytest

from pellucid.emg.signals.emg_quality import inspect_emg
from pellucid.emg.study.emg_torque.study_muscles import study_muscles
from pellucid.study import datasets
from pellucid.study.procedures.registry import asked
from pellucid.study.quality import inspect

LARGE_SETS = ("elderly_isometric",)
"""Data sets whose every recording takes a quarter of a minute to read and inspect."""


@pytest.fixture(scope="module")
def studies(data_folder, tmp_path_factory):
    root = tmp_path_factory.mktemp("studies")
    return {name: datasets.init(root / name, dataset=name) for name in datasets.names()}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.nightly if n in LARGE_SETS else ()) for n in datasets.names()]
)
def test_nothing_is_refused(studies, name):
    study = studies[name]
    joint = [p.name for p in asked(study, "identify")] == ["joint"]
    faults = [f for r in study.recordings() for f in (inspect(r, study) if joint else [])]
    for recording in study.recordings():
        faults += [f for each in (recording, *recording.streams.values()) for f in inspect_emg(each)]
    assert [f.message for f in faults if f.severity == "refuse"] == []
    assert datasets.notes(name) == ()


def test_emps(studies):
    fit, validate = studies["emps"].recordings()
    assert (fit.name, fit.use, validate.name, validate.use) == ("identification", "fit", "pulses", "validate")
    assert len(fit) == len(validate) == 24841
    assert fit.fs == pytest.approx(1000.0, rel=1e-9)
    assert fit["position"].max() == pytest.approx(0.2464, abs=1e-4)
    assert {name: channel.unit for name, channel in validate.channels.items()} == {
        "time": "s",
        "position": "m",
        "reference": "m",
        "voltage": "V",
        "pulse": "V",
    }
    # Stored as unsigned bytes: 0 to 5 V, and a difference may be negative.
    assert set(np.unique(validate["pulse"])) == {0.0, 5.0}
    assert np.diff(validate["pulse"]).min() == -5.0
    assert "pulse" not in fit


def test_emps_voltage_is_what_the_stated_loop_gives(studies):
    """voltage = kv (kp (reference - position) - velocity), plus the pulse after the limit."""
    study = studies["emps"]
    loop, recording = study.rig.loop, study.recording("pulses")
    q, span = recording["position"], loop.velocity_span
    velocity = np.zeros_like(q)
    mean = (q[1:] + q[:-1]) / 2
    velocity[span:] = np.diff(mean) * recording.fs
    command = loop.kv * (loop.kp * (recording["reference"] - q) - velocity)
    command = np.clip(command, -loop.limit, loop.limit) + recording[loop.injected]
    error = recording["voltage"] - command
    assert np.std(error) < 0.25 * np.std(recording["voltage"])


def test_sydney(studies):
    first, last = studies["sydney_pendulum"].recordings()
    assert (first.use, last.use) == ("fit", "validate")
    assert len(first) + len(last) == 15570
    assert len(first) / 15570 == pytest.approx(0.6, abs=0.001)
    assert first.checksum == last.checksum
    assert first.time[-1] < last.time[0]
    assert first.fs == pytest.approx(200.0)
    assert np.degrees(first["position"].min()) == pytest.approx(-92.07, abs=0.01)
    assert (first["voltage"].min(), first["voltage"].max()) == (pytest.approx(-2.0, abs=1e-4), 5.0)
    assert studies["sydney_pendulum"].rig.drive.constant is None


def test_bam(studies):
    study = studies["bam_xl330"]
    recordings = study.recordings()
    assert len(recordings) == 8
    assert len(study.recordings("fit")) == 4
    for recording in recordings:
        # Negative duties are stored as 16 bits without a sign.
        assert np.abs(recording["duty"]).max() <= 1.0
        assert 180 < recording.fs < 290
        assert recording.enabled.all() != recording.name.startswith("lift_and_drop")
        assert recording.protocol in recording.name
    assert study.recording("sin_time_square_kp400")["duty"].min() == -1.0
    assert study.rig.drive.limit == 1.0
    # A servo's high gain follows its reference better.
    error = {
        kp: np.sqrt(np.mean((r["reference"] - r["position"]) ** 2))
        for kp in (100, 400)
        for r in [study.recording(f"sin_sin_kp{kp}")]
    }
    assert error[400] < 0.7 * error[100]


def test_bam_payload_is_in_the_gravity_of_a_quick_regression(studies):
    """The pendulum's 0.49 kg at 0.10 m weigh 0.481 N*m; the rod adds some."""
    study = studies["bam_xl330"]
    drive = study.rig.drive
    rows, torques = [], []
    for recording in study.recordings("fit"):
        slow = np.abs(np.gradient(recording["position"], recording.time)) < 0.5
        torque = drive.constant / drive.resistance * recording["duty"] * drive.supply
        rows.append(np.sin(recording["position"][slow]))
        torques.append(torque[slow])
    sine, torque = np.concatenate(rows), np.concatenate(torques)
    assert 0.4 < sine @ torque / (sine @ sine) < 0.7


def test_leg_extension(studies):
    study = studies["uci_lower_limb"]
    sitting = study.recordings("fit")
    assert [r.name for r in sitting] == [f"{k}N" for k in (1, 3, 4, 5, 6, 7, 8)]
    for recording in study.recordings():
        assert recording.fs == pytest.approx(1000.0)
        assert recording.participant == recording.name.removesuffix("_standing")
        for name, channel in recording.channels.items():
            assert np.isfinite(channel.samples).all(), (recording.name, name)
        # Millivolts, and one sign of the angle whatever the file's.
        assert 0.02e-3 < np.abs(recording["emg.rectus_femoris"]).max() < 5e-3
        angle = np.degrees(recording["angle.knee"])
        if recording.protocol == "leg_extension":
            assert 50.0 < angle[0] < 85.0
            assert angle.min() < 25.0
        else:
            assert angle[0] < 25.0
            assert angle.max() > 100.0
    assert len({recording.checksum for recording in study.recordings()}) == 10


def test_muscles_lengths_and_moment_arms(studies):
    """A moment arm is how much a muscle shortens for each radian; length, its rate and the arm agree."""
    for recording in studies["nmsm_knee_emg"].recordings():
        length, rate, arm = (recording.streams[name] for name in ("lengths", "lengthening", "moment_arms"))
        assert len(recording) == len(length) == len(arm) == 101
        emg = recording.streams["emg"]
        assert emg.time[0] < recording.time[0] - 0.2
        assert emg.time[-1] > recording.time[-1] + 0.2
        for muscle in ("vastus_lateralis", "vastus_medialis", "vastus_intermedius", "biceps_femoris_short"):
            found = np.gradient(length[f"length.{muscle}"], length.time)
            assert np.corrcoef(found, rate[f"lengthening.{muscle}"])[0, 1] > 0.99
            # These cross the knee alone.
            turned = -arm[f"moment_arm.knee.{muscle}"] * np.gradient(recording["angle.knee"], recording.time)
            assert np.corrcoef(found, turned)[0, 1] > 0.97
        # Flexion is positive: the quadriceps' arm is below 0, the hamstrings' above.
        assert arm["moment_arm.knee.vastus_lateralis"].max() < -0.02
        assert arm["moment_arm.knee.semimembranosus"].min() > 0.01


def test_muscles_constants(studies):
    found = study_muscles(studies["nmsm_knee_emg"])
    assert len(found) == 10
    vastus = found["vastus_lateralis"]
    assert vastus.name == "vaslat_l"
    assert vastus.largest_force == pytest.approx(5148.77, abs=0.01)
    assert vastus.optimal_fibre_length == pytest.approx(0.09456, abs=1e-5)
    assert vastus.tendon_slack_length == pytest.approx(0.20987, abs=1e-5)
    assert vastus.pennation == pytest.approx(0.25287, abs=1e-5)
    # At the recorded lengths fibres are not far from their optimum, as far as the tendon does not yield.
    for recording in studies["nmsm_knee_emg"].recordings():
        length = recording.streams["lengths"]["length.vastus_lateralis"]
        assert np.all(np.abs((length - vastus.tendon_slack_length) / vastus.optimal_fibre_length - 1.1) < 0.6)
    assert study_muscles(studies["lower_limb_walking"]) == {}
