"""Units as headers state them: every spelling binds, and one that is not known is never taken for SI."""

import numpy as np
import pytest

import pellucid as pl
from pellucid.files.log import log_of
from pellucid.files.name_evidence import motor_voltages, read_name
from pellucid.files.quantity import quantity_of
from pellucid.files.readers.read import read_columns
from pellucid.files.stated_units import split_unit, unit_from_text
from pellucid.start.given_files import read_given
from pellucid.start.inference.assign_roles import TableHints, assign_roles
from pellucid.start.propose_study import propose_study
from pellucid.units import to_si_factor


def swing(seed=0, seconds=20.0, rate=200.0):
    """Return time [s], angle [rad], speed [rad/s] and torque [N*m] of a hanging joint."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    q = 0.5 * np.sin(2 * np.pi * 0.31 * t) + 0.3 * np.sin(2 * np.pi * 0.73 * t + 1.0)
    v = np.gradient(q, t)
    tau = 0.05 * np.gradient(v, t) + 2.0 * np.sin(q) + 0.1 * v + 0.3 * np.tanh(v / 0.01)
    return t, q, v, tau + 0.01 * rng.standard_normal(t.size)


def write(path, heads, columns):
    rows = "\n".join(",".join(f"{x:.6f}" for x in row) for row in zip(*columns, strict=True))
    path.write_text(",".join(f'"{head}"' if "," in head else head for head in heads) + f"\n{rows}\n", encoding="utf-8")
    return path


SPELLINGS = {
    "N*mm": ["Nmm", "N*mm", "N·mm", "N⋅mm", "N-mm", "N mm", "N.mm", "NMM", "N mm"],
    "N*m": ["Nm", "N*m", "N·m", "N.m", "N-m", "N m", "nm", "newton meters", "Newton-metres"],
    "mN*m": ["mNm", "mN*m", "mN·m", "mN.m", "mN-m", "mN m"],
    "cN*m": ["Ncm", "N*cm", "N·cm"],
    "lbf*inch": ["lbf·in", "lb-in", "in-lb", "lbf*in"],
    "kgf*cm": ["kgf·cm", "kg·cm", "kg-cm"],
    "deg/s": ["deg/s", "°/s", "dps", "deg s-1", "deg·s⁻¹", "deg/sec", "degrees per second"],
    "rad/s": ["rad/s", "rad s^-1", "rad/sec", "rad·s⁻¹"],
    "rpm": ["rpm", "RPM", "1/min", "U/min", "rev/min", "min⁻¹", "turns/min", "r/min"],
    "turn/s": ["turns/s", "rps", "rev/s"],
    "deg": ["deg", "°", "Degrees", "º"],
    "turn": ["turn", "turns", "rev"],
    "rad/s^2": ["rad/s^2", "rad/s²", "rad/s2", "rad/s/s", "rad s-2"],
    "uV": ["uV", "µV", "μV", "microvolts"],
    "mA": ["mA", "milliamps"],
    "ms": ["ms", "msec", "milliseconds"],
    "degF": ["°F", "degF"],
    "counts": ["counts", "ticks", "inc", "pulse", "pulses"],
}


@pytest.mark.parametrize(("unit", "text"), [(unit, text) for unit, texts in SPELLINGS.items() for text in texts])
def test_each_spelling_of_a_unit_is_the_same_unit(unit, text):
    found = unit_from_text(text)
    assert found is not None
    assert to_si_factor(found, None) == pytest.approx(to_si_factor(unit, None))


@pytest.mark.parametrize("text", ["torque", "left", "x", "foo", "", "measured", "N*foo", "rad/fortnight", "t", "a"])
def test_words_are_no_units(text):
    assert unit_from_text(text) is None


@pytest.mark.parametrize(
    ("name", "bare", "unit"),
    [
        ("tau [Nmm]", "tau", "N*mm"), ("tau (N*mm)", "tau", "N*mm"), ("tau_Nmm", "tau", "N*mm"),
        ("tau{mNm}", "tau", "mN*m"), ("tau_N_mm", "tau", "N*mm"), ("tau-Nmm", "tau", "N*mm"),
        ("tau Nmm", "tau", "N*mm"),
        ("tau / Nmm", "tau", "N*mm"), ("tau in Nmm", "tau", "N*mm"), ("tau, N*mm", "tau", "N*mm"),
        ("RT VLO, uV", "RT VLO", "uV"), ("t,s", "t", "s"), ("torqueNm", "torque", "N*m"),
        ("kneeAngleDeg", "kneeAngle", "deg"),
        ("tau [Nmm].2", "tau.2", "N*mm"), ("tau (Nmm) filtered", "tau filtered", "N*mm"),
        ("tau_Nmm_filtered", "tau_filtered", "N*mm"), ("q_deg_cmd", "q_cmd", "deg"), ("vel_deg_s", "vel", "deg/s"),
        ("omega_rad_per_s", "omega", "rad/s"), ("speed_rpm", "speed", "rpm"), ("pos_turns", "pos", "turn"),
        ("Force N", "Force", "N"), ("Current A", "Current", "A"), ("Moment (Nm/kg)", "Moment", "N*m/kg"),
        ("torque [%]", "torque", "%"), ("Sensor A", "Sensor A", None), ("position[0]", "position[0]", None),
        ("Torque (measured)", "Torque (measured)", None), ("LoadCell ()", "LoadCell", None),
        ("/joint_states/knee/position", "/joint_states/knee/position", None), ("deg", "deg", None),
        ("torque_percent_rated", "torque", "%"), ("Moment in Prozent", "Moment", "%"),
        ("TorqueActual_permille", "TorqueActual", "permille"), ("torque_lbft", "torque", "lbf*foot"),
        ("torque_ozin", "torque", "ozf*inch"), ("torque_kgcm", "torque", "kgf*cm"), ("torque_dNm", "torque", "dN*m"),
        ("angle_gon", "angle", "gon"), ("knee_gon", "knee_gon", None), ("angle_cdeg", "angle", "cdeg"),
        ("q_millirad", "q", "mrad"), ("Winkel_Grad", "Winkel", "deg"), ("angle_arcmin", "angle", "arcmin"),
        ("sample count", "sample count", None), ("min", "min", None), ("rms", "rms", None),
    ],
)  # fmt: skip
def test_a_name_states_its_unit_in_many_ways(name, bare, unit):
    assert split_unit(name) == (bare, unit)


@pytest.mark.parametrize(
    ("name", "scale", "unit"),
    [("pos_0.1deg", 0.1, "deg"), ("current 0.01A", 0.01, "A"), ("axis_2.5", 1.0, None)],
)
def test_a_name_states_how_many_of_a_unit_a_number_is(name, scale, unit):
    found = read_name(name)
    assert (found.scale, found.unit) == (scale, unit)


@pytest.mark.parametrize("name", ["torque_Nm_x10", "Torque_Nm*100", "angle_x100", "TorqueNmX100"])
def test_a_multiple_that_may_be_of_the_unit_or_of_the_number_is_no_known_unit(name):
    found = read_name(name)
    assert found.unit is None
    assert found.unknown_unit


@pytest.mark.parametrize(
    "head", ["tau [Nmm]", "tau (N*mm)", "tau_Nmm", "tau (N·mm)", "tau_Nmm_meas", "torque, N-mm", "tau / N.mm", "tauNmm"]
)
def test_a_stated_torque_is_proposed_in_its_unit(tmp_path, head):
    t, q, _, tau = swing()
    path = write(tmp_path / "log.csv", ["time [s]", "q [rad]", head], [t, q, 1e3 * tau])
    proposal = propose_study(read_given([path]), "made")
    (role,) = [r for r in proposal.main.channels if r.quantity == "torque"]
    assert (role.unit, role.unit_is_certain) == ("N*mm", True)


@pytest.mark.parametrize(
    ("head", "scale", "quantity", "unit"),
    [
        ("speed (rpm)", 30 / np.pi, "velocity", "rpm"), ("omega_dps", 180 / np.pi, "velocity", "deg/s"),
        ("vel [turns/s]", 0.5 / np.pi, "velocity", "turn/s"), ("gyro [deg/s]", 180 / np.pi, "velocity", "deg/s"),
    ],
)  # fmt: skip
def test_a_stated_speed_is_proposed_in_its_unit(tmp_path, head, scale, quantity, unit):
    t, q, v, tau = swing()
    path = write(tmp_path / "log.csv", ["time [s]", "q [rad]", head, "tau [Nm]"], [t, q, scale * v, tau])
    roles = {r.column: r for r in propose_study(read_given([path]), "made").main.channels}
    assert (roles[head].quantity, roles[head].unit) == (quantity, unit)


def test_numbers_do_not_overrule_the_unit_of_an_accelerometer():
    """Readings as long as gravity in m/s^2 stay in the unit that their names state."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 20.0, 0.01)
    angle = 0.8 * np.sin(2 * np.pi * 0.4 * t)
    axes = [9.81 * np.sin(angle), 9.81 * np.cos(angle), 0.5 * np.sin(3 * t)]
    noisy = [x + 0.02 * rng.standard_normal(t.size) for x in axes]
    columns = {f"acc_{axis} [ft/s^2]": x for axis, x in zip("xyz", noisy, strict=True)}
    found = assign_roles({"time [s]": t, **columns}, TableHints())
    units = {r.unit for r in found.roles if r.quantity}
    assert units == {"foot/s^2"}


@pytest.mark.parametrize("head", ["tau [foo]", "tau (N*foo)", "torque [Newtonfoot]"])
def test_an_unknown_unit_is_refused_and_never_taken_for_si(tmp_path, head):
    t, q, _, tau = swing()
    path = write(tmp_path / "log.csv", ["time [s]", "q [rad]", head], [t, q, 1e3 * tau])
    with pytest.raises(pl.PellucidError, match="found the unknown unit") as refused:
        pl.init(tmp_path / "study", files=[path])
    assert f'log.csv: column "{head}"' in str(refused.value)
    made = pl.init(tmp_path / "answered", files=[path], answers={"effort": "torque in N*mm"})
    assert 'unit = "N*mm"' in made.study_file.read_text()


def test_an_unknown_unit_of_a_row_of_units_and_of_a_file_is_kept_as_unknown(tmp_path):
    t, q, _, tau = swing()
    path = write(tmp_path / "log.csv", ["time", "q", "tau"], [t, q, tau])
    head, rest = path.read_text().split("\n", 1)
    path.write_text(f"{head}\ns,rad,foo\n{rest}")
    assert pl.read(path).units == {"time": "s", "q": "rad", "tau": "foo"}
    with pytest.raises(pl.PellucidError, match=r'log\.csv: column "tau": found the unknown unit "foo"'):
        pl.init(tmp_path / "study", files=[path])


def test_a_channel_that_a_study_can_do_without_is_left_out_if_its_unit_is_unknown(tmp_path):
    t, q, v, tau = swing()
    path = write(tmp_path / "log.csv", ["time [s]", "q [rad]", "velocity [foo]", "tau [Nm]"], [t, q, v, tau])
    text = pl.init(tmp_path / "study", files=[path]).study_file.read_text()
    assert 'velocity [foo]: the file states the unknown unit "foo"' in text


def test_a_remark_in_brackets_is_no_unit():
    for name in ("Torque (measured)", "angle [x]", "EMG (left)", "q[3]", "force (load cell 2)", "speed (filtered)"):
        assert read_name(name).unknown_unit is None, name
    assert read_name("Present Velocity (0.229 foo/min)").unknown_unit == "0.229 foo/min"


def test_a_unit_with_a_number_says_how_much_a_stored_number_is():
    for name, scale, unit in (
        ("Present Velocity (0.229 rev/min)", 0.229, "rpm"), ("angle [0.1 deg]", 0.1, "deg"), ("load [0.1 %]", 0.1, "%"),
    ):  # fmt: skip
        found = read_name(name)
        assert (found.scale, found.unit, found.unknown_unit) == (scale, unit, None)


ORDINARY_NAMES = {
    "theta": "position", "theta_dot": "velocity", "thetaDot": "velocity", "theta_ddot": "acceleration", "q": "position",
    "q_dot": "velocity", "qd": "velocity", "dq": "velocity", "ddq": "acceleration", "d_theta": "velocity",
    "i_q": "current", "iq": "current", "i_q_measured": "current", "motor_current": "current", "tau": "torque",
    "tau_m": "torque", "effort": "torque", "trq": "torque", "Drehmoment": "torque", "Winkel": "position",
    "Drehzahl": "velocity", "joint_pos": "position", "joint_vel": "velocity", "omega": "velocity", "speed": "velocity",
    "encoder": "position", "angle": "position", "load_cell": "force", "force": "force", "pwm": "duty", "duty": "duty",
    "voltage": "voltage", "u": "voltage", "temperature": "temperature", "emg_vl": "emg", "knee_theta_dot": "velocity",
    "torque_cmd": "torque", "pos_ref": "position", "present_position": "position", "goal_position": "position",
    "L1_T12_Lat_Bending": "", "i_phase_u": "current", "i_alpha": "current", "v_phase_u": "voltage", "id": "",
}  # fmt: skip


def test_a_motor_s_voltages_are_told_by_its_currents(tmp_path):
    """v_q was listed as a velocity and v_alpha as an acceleration, beside i_q."""
    rng = np.random.default_rng(1)
    names = ("t", "theta", "i_q", "v_q", "v_alpha", "q_d")
    path = tmp_path / "log.csv"
    rows = np.column_stack([np.arange(200) * 0.01, *rng.standard_normal((len(names) - 1, 200))])
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="")
    columns = dict(zip(names, rows.T, strict=True))
    kinds = {channel.name: channel.quantity.kind for channel in log_of(read_columns(path)).channels}
    assert (kinds["v_q"], kinds["v_alpha"]) == ("voltage", "voltage")
    assert kinds["q_d"] == read_name("q_d").quantity
    roles = {role.column: role.quantity for role in assign_roles(columns).roles}
    assert roles["v_q"] in ("voltage", None)
    assert motor_voltages(["t", "q_d", "v_d"]) == frozenset()


@pytest.mark.parametrize(("name", "quantity"), ORDINARY_NAMES.items())
def test_init_and_audit_read_a_name_alike(name, quantity):
    assert (read_name(name).quantity or "") == quantity
    assert quantity_of(name).kind == quantity


def test_the_load_of_a_computer_is_no_force_and_an_axis_has_its_sensor():
    assert read_name("cpu_load").quantity == "state"
    assert (read_name("imu_ax").quantity, read_name("imu_ax").axis) == ("linear_acceleration", "x")
    assert read_name("load_kg").quantity == "force"


@pytest.mark.parametrize(
    ("text", "names", "units"),
    [
        ("# Time (s),Angle (gon),Torque (Nm)\n", ["Time (s)", "Angle (gon)", "Torque (Nm)"], {}),
        ("# Load cell test\n  mSec   TORQUE   POS (ANAT)\n         FT-LBS   DEGREES\n",
         ["mSec", "TORQUE", "POS (ANAT)"], {"TORQUE": "foot*lbf", "POS (ANAT)": "deg"}),
    ],
)  # fmt: skip
def test_names_in_a_comment_and_over_a_row_of_units_are_read(tmp_path, text, names, units):
    separator = "," if "," in text else "   "
    rows = "\n".join(separator.join(f"{value:.2f}" for value in (10 * k, -25.5 + k, 84.6 - k)) for k in range(40))
    path = tmp_path / "log.txt"
    path.write_text(f"{text}{rows}\n")
    found = read_columns(path)
    assert list(found.values) == names
    assert dict(found.units) == units


def test_a_share_of_a_rated_torque_asks_for_that_torque_alone(tmp_path):
    t, q, _, tau = swing()
    path = write(tmp_path / "log.csv", ["time [s]", "q [rad]", "torque_percent_rated"], [t, q, 100.0 * tau / 48.0])
    keys = [question.key for question in propose_study(read_given([path]), "made").asked]
    assert "rated" in keys
    assert "drive_constant" not in keys
