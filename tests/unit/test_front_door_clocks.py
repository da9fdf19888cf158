"""Logs of dashboards, radios and drives, each of which was once read wrongly or refused."""

import numpy as np
import pytest
from test_front_door_names import controlled, proposed, swing, written

from pellucid.units import to_si_factor


def cells_of(path, head, columns, units):
    """Write rows whose cells hold units, each chosen by the number, as dashboards print them."""
    rows = [",".join(unit(x) for x, unit in zip(row, units, strict=True)) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    return path


def amperes(x):
    """Return a current as dashboards print it: small ones in milliamperes."""
    return f"{1000.0 * x:.0f} mA" if abs(x) < 1.0 else f"{x:.3f} A"


def currents_of(found):
    """Return the current of a proposal's recording [A]."""
    (role,) = (r for r in found.main.channels if r.quantity == "current")
    return found.main.tables[0].columns[role.column] * to_si_factor(role.unit, "A")[0]


def test_cells_of_one_column_may_have_units_of_several_sizes(tmp_path):
    t, _, q, tau = controlled()
    path = cells_of(
        tmp_path / "grafana.csv", "Time,angle,i_q", (t, q, tau), ("{:.2f} s".format, "{:.4f}°".format, amperes)
    )
    np.testing.assert_allclose(currents_of(proposed(path)), tau, atol=6e-4)


def test_labelled_rows_may_have_units_of_several_sizes(tmp_path):
    t, _, q, tau = controlled()
    lines = [f"t: {a:.2f} s angle: {b:.4f} deg current: {amperes(c)}" for a, b, c in zip(t, q, tau, strict=True)]
    (tmp_path / "monitor.log").write_text("\n".join(lines), encoding="utf-8")
    np.testing.assert_allclose(currents_of(proposed(tmp_path / "monitor.log")), tau, atol=6e-4)


@pytest.mark.parametrize(
    ("motor", "joint"),
    [
        ("电机位置(rad)", "关节角度(rad)"), ("モータ位置[rad]", "関節角度[rad]"), ("모터 위치(rad)", "관절 각도(rad)"),
        ("Position moteur [rad]", "Position articulation [rad]"), ("Motorwinkel [rad]", "Gelenkwinkel [rad]"),
        ("Posizione motore [rad]", "Posizione giunto [rad]"),
    ],
)  # fmt: skip
def test_the_joint_is_told_from_its_motor_in_many_languages(tmp_path, motor, joint):
    t, q, tau = swing()
    path = written(tmp_path / "drive.csv", f"time_s,{motor},{joint},torque_Nm", (t, 36.0 * q, q, tau))
    found = proposed(path)
    assert [r.column for r in found.main.channels if r.quantity == "position"] == [joint]
