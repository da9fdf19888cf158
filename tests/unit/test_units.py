"""Quantities as people write them."""

import math
import subprocess
import sys

import pytest

from pellucid import units
from pellucid._errors import StudyError
from pellucid.units import parse_quantity, si_text, to_si_factor


@pytest.mark.parametrize(
    ("text", "expected", "value"),
    [
        ("0.060 N*m/A", "N*m/A", 0.060),
        ("60 mN*m/A", "N*m/A", 0.060),
        ("35.15065188248547 N/V", "N/V", 35.15065188248547),
        ("500 mA", "A", 0.5),
        ("180 deg", "rad", math.pi),
        ("-3 °", "rad", -math.pi / 60),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("1 turn", "rad", 2 * math.pi),
        ("90 deg/s", "rad/s", math.pi / 2),
        ("2 N*m*s/rad", "N*m*s/rad", 2.0),
        ("3 kg*m^2", "kg*m^2", 3.0),
        ("5 g", "kg", 0.005),
        ("10 %", "1", 0.1),
        ("3", "1", 3.0),
        (3, "1", 3.0),
        ("1e3 Hz", "Hz", 1000.0),
        ("2 1/s", "Hz", 2.0),
        ("250 µV", "V", 250e-6),
        ("4.017 ohm", "ohm", 4.017),
        ("4 Ω", "ohm", 4.0),
        ("3 Nm", "N*m", 3.0),
        ("12 cm", "m", 0.12),
        ("20 ms", "s", 0.02),
        ("25 degC", "K", 298.15),
        ("7 counts", "count", 7.0),
    ],
)
def test_a_quantity_becomes_si(text, expected, value):
    assert parse_quantity(text, expected, "x") == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "expected", "message"),
    [
        ("0.060", "N*m/A", '[rig] k: found "0.060" without a unit, expected e.g. "0.060 N*m/A"'),
        (100, "Hz", '[rig] k: found 100 without a unit, expected e.g. "100 Hz"'),
        ("500 mA", "V", '[rig] k: found the unit "mA", expected "V"'),
        ("90 deg", "m", '[rig] k: found the unit "deg", expected "m"'),
        ("90 m", "rad", '[rig] k: found the unit "m", expected "rad"'),
        ("0.5", "rad", 'without a unit, expected e.g. "0.5 rad"'),
        ("10 rad/s", "Hz", 'found the unit "rad/s", expected "Hz"'),
        ("60 rmp", "rad/s", 'found the unknown unit "rmp"; the nearest known one is "rpm"'),
        ("9 counts", "rad", "counts need a scale"),
        ("fast", "rad/s", 'found "fast", which starts with no number'),
        ("nan m", "m", "expected a finite number"),
        ("inf m", "m", "expected a finite number"),
        (True, "1", "found True, expected a quantity"),
        ("3 m + 2", "m", "unknown unit"),
        ("3 __import__", "m", "unknown unit"),
        ("2 N", ("N*m", "kg*m^2"), 'expected "N*m" or "kg*m^2"'),
    ],
)
def test_a_wrong_quantity_says_what_was_found_and_expected(text, expected, message):
    with pytest.raises(StudyError) as error:
        parse_quantity(text, expected, "[rig] k")
    assert message in str(error.value)
    assert str(error.value).startswith("[rig] k: ")


def test_an_absent_unit_is_refused():
    for absent in ("", " "):
        with pytest.raises(StudyError, match="no unit found"):
            to_si_factor(absent, "rad")


def test_factor_and_offset():
    assert to_si_factor("deg", "rad") == (pytest.approx(math.pi / 180), 0.0)
    factor, offset = to_si_factor("degC", "K")
    assert (factor, offset) == (pytest.approx(1.0), 273.15)


@pytest.mark.parametrize(
    ("unit", "text"),
    [("mV", "V"), ("deg/s", "rad/s"), ("mN*m", "N*m"), ("%", "1"), ("kg*m^2/s", "kg*m^2/s"), ("m^2", "m^2")],
)
def test_the_si_text_of_a_unit(unit, text):
    assert si_text(unit) == text
    assert to_si_factor(si_text(unit), text)[0] == 1.0


def test_pint_is_loaded_with_the_first_unit_only():
    code = "import sys, pellucid.units; assert 'pint' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_texts_in_si_are_what_pint_says_of_them_and_need_no_pint():
    parsed = [units._parse(text, "") for text in units._SI_TEXTS]
    assert all(factor == 1.0 and zero == 0.0 for factor, zero, _ in parsed)
    assert len({dimension for *_, dimension in parsed}) == len(parsed)
    for unit, (factor, text) in units._COMMON_UNITS.items():
        assert units._parse(unit, "") == (factor, 0.0, units._parse(text, "")[2])
    code = (
        "import sys; from pellucid.units import parse_quantity as p, si_text; p('60 N*m', 'N*m', ''); si_text('rad/s');"
        "p('3 deg', 'rad', ''); p('5 ms', ('s', 'm'), '')"
    )
    run = subprocess.run(
        [sys.executable, "-c", f"{code}; print('pint' in sys.modules)"], capture_output=True, text=True
    )
    assert run.stdout.strip() == "False", run.stderr


def test_an_acceleration_in_g_is_in_gravities_and_a_mass_in_g_in_grams():
    assert to_si_factor("g", "m/s^2") == (9.80665, 0.0)
    assert to_si_factor("g", "kg") == (1e-3, 0.0)
    with pytest.raises(StudyError):
        to_si_factor("g", "rad")
