"""A torque sensor that ends below the torque that acts, told from a drive that reaches its limit."""

import numpy as np
import pytest

import pellucid as pl
from pellucid.files.defects.sensor_range import agrees_at_limit, sensor_ends

RATE_HZ = 250.0
INERTIA, WEIGHT, VISCOUS, COULOMB = 0.054, 2.0, 0.1, 0.2
LARGEST = 3.2  # about what the motion needs [N*m]


def swing(rng, *, weight=WEIGHT, seconds=24.0):
    """Time, angle and torque of a joint that is moved by sines."""
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    waves = ((0.6, 0.23), (0.4, 0.61), (0.3, 1.3), (0.15, 2.1))
    phases = rng.uniform(0.0, 6.28, 4)
    q = sum(a * np.sin(2.0 * np.pi * f * t + phase) for (a, f), phase in zip(waves, phases, strict=True))
    v = np.gradient(q, t)
    torque = INERTIA * np.gradient(v, t) + weight * np.sin(q) + VISCOUS * v + COULOMB * np.tanh(v / 0.01)
    return t, np.round(q / 1e-4) * 1e-4, torque


def limited(rng, limit):
    """Time, angle and torque of a joint whose drive follows the same motion, as far as its limit lets it."""
    t, wanted, _ = swing(rng)
    return follow(t, wanted, limit)


def follow(t, wanted, limit, *, gains=(40.0, 3.0), coulomb=COULOMB):
    """Time, angle and torque of a joint whose drive follows a motion as far as its limit lets it."""
    speed, q, v, dt = np.gradient(wanted, t), wanted[0], 0.0, 1.0 / (10.0 * RATE_HZ)
    rows = []
    for to, pace in zip(wanted, speed, strict=True):
        torque = float(np.clip(gains[0] * (to - q) + gains[1] * (pace - v), -limit, limit))
        rows.append((q, torque))
        for _ in range(10):
            v += dt * (torque - WEIGHT * np.sin(q) - VISCOUS * v - coulomb * np.tanh(v / 0.01)) / INERTIA
            q += dt * v
    angle, torque = np.array(rows).T
    return t, np.round(angle / 1e-4) * 1e-4, torque


def soft(torque, end, sharpness):
    """A sensor whose range ends gradually."""
    x = torque / end
    return end * x / (1.0 + np.abs(x) ** sharpness) ** (1.0 / sharpness)


SENSORS = {
    "both ends": lambda torque, noise: np.clip(torque + noise, -0.7 * LARGEST, 0.7 * LARGEST),
    "far below": lambda torque, noise: np.clip(torque + noise, -0.5 * LARGEST, 0.5 * LARGEST),
    "one end": lambda torque, noise: np.minimum(torque + noise, 0.7 * LARGEST),
    "the lower end": lambda torque, noise: np.maximum(torque + noise, -0.7 * LARGEST),
    "noise on the plateau": lambda torque, noise: np.clip(torque, -0.7 * LARGEST, 0.7 * LARGEST) + 3.0 * noise,
    "a soft end": lambda torque, noise: soft(torque, 0.7 * LARGEST, 8) + noise,
    "a softer end": lambda torque, noise: soft(torque, 0.7 * LARGEST, 4) + noise,
}


@pytest.mark.parametrize("name", SENSORS)
def test_the_motion_shows_that_a_sensor_ends(name):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        _, q, torque = swing(rng)
        recorded = SENSORS[name](torque, 0.01 * rng.standard_normal(len(torque)))
        ends = sensor_ends(recorded, [q], RATE_HZ)
        signs = {"one end": [1.0], "the lower end": [-1.0]}.get(name, [1.0, -1.0])
        assert [np.sign(end.value) for end in ends] == signs
        assert not agrees_at_limit(recorded, [q], RATE_HZ)
        for end in ends:
            true = float(np.max(np.sign(end.value) * torque))
            assert abs(end.predicted) == pytest.approx(true, rel=0.12)
            beyond = np.sign(end.value) * torque > 1.1 * abs(end.value)
            cut = np.zeros(len(torque), bool)
            for first, last in end.runs:
                cut[first : last + 1] = True
            assert np.mean(cut[beyond]) > (0.8 if name == "a softer end" else 0.95)


@pytest.mark.parametrize("limit", [1.8, 2.2, 2.6, 3.0])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_drive_at_its_limit_is_no_sensor_at_its_end(limit, noise):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        _, q, torque = limited(rng, limit)
        assert np.mean(np.abs(torque) >= limit) > 0.005
        recorded = torque + noise * rng.standard_normal(len(torque))
        assert not sensor_ends(recorded, [q], RATE_HZ)
        assert agrees_at_limit(recorded, [q], RATE_HZ)


def test_a_torque_that_no_sensor_cuts_has_no_end():
    for seed in range(4):
        rng = np.random.default_rng(seed)
        _, q, torque = swing(rng)
        assert not sensor_ends(torque + 0.01 * rng.standard_normal(len(torque)), [q], RATE_HZ)
        # Physics that the regression lacks: load friction, friction that falls from rest, and a person who pushes.
        v = np.gradient(q) * RATE_HZ
        for other in (
            0.15 * np.abs(torque) * np.tanh(v / 0.01),
            0.3 * np.exp(-np.abs(v) / 0.3) * np.tanh(v / 0.01),
            -0.08 * v * np.abs(v),
            1.0 * np.sin(1.7 * np.arange(len(q)) / RATE_HZ) ** 3,
        ):
            assert not sensor_ends(torque + other, [q], RATE_HZ)


@pytest.mark.parametrize("hertz", [0.05, 0.08, 0.1, 0.2, 0.5])
@pytest.mark.parametrize("amplitude", [0.9, 1.1])
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_a_flat_top_of_gravity_in_a_slow_sine_is_no_end(hertz, amplitude, noise):
    t = np.arange(0.0, 4.0 / hertz if hertz < 0.2 else 20.0, 1.0 / RATE_HZ)
    _, q, torque = follow(
        t, amplitude * np.sin(2.0 * np.pi * hertz * t), 9.0, gains=(18.0, 1.2), coulomb=0.35
    )
    recorded = torque + noise * np.random.default_rng(1).standard_normal(len(torque))
    assert not sensor_ends(recorded, [q], RATE_HZ)
    if hertz < 0.5:
        end = 0.7 * np.quantile(np.abs(recorded), 0.998)
        assert sensor_ends(np.clip(recorded, -end, end), [q], RATE_HZ)


def test_several_joints_explain_an_effort_together():
    rng = np.random.default_rng(1)
    _, q, torque = swing(rng)
    _, other, _ = swing(rng)
    coupled = torque + 0.03 * np.gradient(np.gradient(other)) * RATE_HZ**2
    end = 0.7 * float(np.abs(coupled).max())
    assert sensor_ends(np.clip(coupled, -end, end), [q, other], RATE_HZ)
    assert not sensor_ends(coupled, [q, other], RATE_HZ)


def proposed(tmp_path, make, *, header="tau [N*m]"):
    files = []
    for seed in range(2):
        path = tmp_path / f"swing_{seed}.csv"
        np.savetxt(
            path, np.column_stack(make(np.random.default_rng(seed))), delimiter=",", comments="", fmt="%.6f",
            header=f"time [s],q [rad],{header}",
        )  # fmt: skip
        files.append(path)
    made = pl.init(tmp_path / "study", files=files, answers={"angle_zero": "yes"})
    return pl.open(made.folder), made.study_file.read_text()


def clipped(name):
    def make(rng):
        t, q, torque = swing(rng)
        return t, q, SENSORS[name](torque, 0.01 * rng.standard_normal(len(t)))

    return make


def test_a_clipped_torque_is_left_out_and_the_inertia_is_right(tmp_path):
    study, text = proposed(tmp_path, clipped("far below"))
    assert "limit =" not in text
    faults = [fault for fault in pl.check(study) if fault.kind == "sensor_range" and fault.severity == "warn"]
    assert {fault.channel for fault in faults} == {"torque"}
    assert "beyond the end of the sensor's range at" in faults[0].message
    found = pl.identify(study, families=["symmetric"], thorough=False)
    low, high = found["inertia"].interval()
    assert low < INERTIA < high
    assert found["inertia"].value == pytest.approx(INERTIA, rel=0.1)
    assert any(v.kind == "warning" and "beyond the end of the sensor's range" in v.text for v in found.verdicts)


def test_a_stated_limit_or_an_accepted_clip_hides_no_sensor(tmp_path):
    study, text = proposed(tmp_path, clipped("both ends"))
    line = next(line for line in text.splitlines() if line.startswith("torque ="))
    stated = text.replace('kind = "torque"', f'kind = "torque"\nlimit = "{0.7 * LARGEST} N*m"')
    (study.folder / "study.toml").write_text(stated)
    cut = {c.kind for r in pl.open(study.folder).recordings() for c in r.cuts}
    assert cut == {"sensor_range"}
    accepted = text.replace(line, line.replace(" }", ', clip = "accept" }', 1))
    (study.folder / "study.toml").write_text(accepted)
    again = pl.open(study.folder)
    assert not [c for r in again.recordings() for c in r.cuts]
    (first, *_) = [fault for fault in pl.check(again) if fault.kind == "sensor_range"]
    assert "they are fitted because" in first.message


def test_an_effort_that_was_asked_for_no_further_is_no_sensors_end(tmp_path):
    """Somebody moves the joint with the drive: the command stops at the same value as the record."""
    study, text = proposed(tmp_path, clipped("both ends"))
    commanded = 'desired_torque = { column = "tau [N*m]", unit = "N*m" }'
    line = next(line for line in text.splitlines() if line.startswith("torque ="))
    (study.folder / "study.toml").write_text(text.replace(line, f"{line}\n{commanded}"))
    assert not [c for r in pl.open(study.folder).recordings() for c in r.cuts if c.kind == "sensor_range"]


def test_a_drive_at_its_limit_is_proposed_as_limited_and_nothing_is_cut(tmp_path):
    study, text = proposed(tmp_path, lambda rng: limited(rng, 2.4))
    assert 'limit = "2.4 N*m"' in text
    assert not [c for r in study.recordings() for c in r.cuts]
    assert not [fault for fault in pl.check(study) if fault.kind == "sensor_range"]


def test_an_audit_calls_such_a_torque_clipped_and_such_a_drive_saturated(tmp_path):
    for make, kind in ((clipped("both ends"), "clipped"), (lambda rng: limited(rng, 2.4), "saturated")):
        path = tmp_path / f"{kind}.csv"
        np.savetxt(
            path, np.column_stack(make(np.random.default_rng(1))), delimiter=",", comments="", fmt="%.6f",
            header="time [s],position [rad],measured torque [N*m]",
        )  # fmt: skip
        (verdict,) = [v.verdict for v in pl.audit(path).verdicts if "torque" in v.channel]
        assert verdict == kind
