"""The compensator of a worn orthosis from the cards that `identify` writes: whose, and with which actuator."""

from math import nan

import numpy as np
import pytest

import pellucid
from pellucid._errors import PellucidError
from pellucid.controllers import worn as worn_design
from pellucid.controllers.control_law import LAWS
from pellucid.models.card import CardParameter
from pellucid.models.parameter_card import ParameterCard, write_parameter_card
from pellucid.orthosis.study import worn_values as module
from pellucid.orthosis.study.coupling.cards import PARAMETER_UNITS
from pellucid.orthosis.study.worn_values import worn_values

STUDY = """
name = "knee"
[rig]
joint = "knee"
motion = "rotary"
lifts = "flexion"
limits = { position_min = "-5 deg", effort = "8 N*m" }
[coupling]
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "u", unit = "N*m" }
[processing]
lowpass = "20 Hz"
[[recordings]]
name = "a"
file = "recordings/a.csv"
use = "fit"
"""

CARDS = {
    "orthosis": ("orthosis", {"inertia": 0.048, "damping": 0.009, "gravity": 1.56, "coulomb": 0.011}),
    "S1.limb": ("limb", {"inertia": 0.29, "damping": 0.0, "gravity": 8.0}),
    "S1.coupling": ("coupling", {"stiffness": 14.0, "damping": 0.42}),
    "S2.limb": ("limb", {"inertia": 0.5, "damping": 0.0, "gravity": 12.0}),
    "S2.coupling": ("coupling", {"stiffness": 24.0, "damping": 0.73}),
}
ACTUATOR = {
    "actuator_frequency": 200.0, "actuator_damping": 0.7, "delay": 0.002, "actuator_inertia": 0.055,
    "actuator_viscous": 0.1, "actuator_coulomb": 2.6, "actuator_leak": 1.8,
}  # fmt: skip


@pytest.fixture
def study(tmp_path, monkeypatch):
    """An orthosis and two wearers that were identified, on disk; the actuator is given, one strap is uncertain."""
    (tmp_path / "recordings").mkdir()
    rows = "".join(f"{0.002 * i:.3f},{np.sin(0.01 * i):.6f},0\n" for i in range(50))
    (tmp_path / "recordings" / "a.csv").write_text("t,q,u\n" + rows, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "models").mkdir()
    for name, (kind, values) in CARDS.items():
        made = tuple(CardParameter(n, "1", v, 0.05 * v, (0.9 * v, 1.1 * v)) for n, v in values.items())
        write_parameter_card(tmp_path / "models" / f"{name}.json", ParameterCard(kind, "knee", name, made))
    monkeypatch.setattr(module, "_actuator", lambda study: (ACTUATOR, 0.002))
    monkeypatch.setattr(worn_design, "STRAP_FACTORS", (0.9,))
    return pellucid.open(tmp_path)


def test_numbers_are_the_wearers_and_say_where_they_come_from(study):
    values = worn_values(study, participant="S1")
    n = values.numbers
    assert set(n) == set(LAWS["worn"].parameters)
    assert (n["limb_inertia"], n["strap_stiffness"], n["orthosis_inertia"]) == (0.29, 14.0, 0.048)
    assert n["period"] == 0.002
    assert n["effort_limit"] == 8.0
    assert n["position_min"] == pytest.approx(np.radians(-5))
    assert "identified, 12.6 to 15.4" in values.remarks["strap_stiffness"]
    assert any("states no stops" in note for note in values.notes)
    assert worn_values(study, participant="S2").numbers["strap_stiffness"] == 24.0


def test_one_wearer_must_be_meant(study):
    with pytest.raises(PellucidError, match="found the participant none, expected one of S1, S2"):
        pellucid.export(study)
    with pytest.raises(PellucidError, match="found the participant 'S3', expected one of S1, S2"):
        pellucid.export(study, participant="S3")
    with pytest.raises(PellucidError, match="found slider, expected none: a worn orthosis has one"):
        pellucid.export(study, participant="S1", slider=0.1)
    with pytest.raises(PellucidError, match="found load, held, expected none"):
        pellucid.export(study, participant="S1", load=(1.0, 0.2), held=(0.5, 0.3))
    (study.models_dir / "S1.limb.json").unlink()
    with pytest.raises(PellucidError, match="no such model card"):
        pellucid.export(study, participant="S1")


def test_the_actuator_must_have_been_recorded(study, monkeypatch):
    monkeypatch.undo()
    with pytest.raises(PellucidError, match='found no recording of protocol "sine_tracking" with command, torque'):
        worn_values(study, participant="S1")


def test_what_identify_wrote_of_the_actuator_is_not_identified_again(study, monkeypatch):
    monkeypatch.undo()
    found = {**ACTUATOR, "spring_stiffness": 105.0, "actuator_fit": 0.9}
    found.pop("delay")
    parameters = tuple(CardParameter(n, PARAMETER_UNITS[n], x, nan, (nan, nan)) for n, x in found.items())
    card = ParameterCard("actuator", "knee", "actuator", parameters, settings={"period": 0.002})
    write_parameter_card(study.models_dir / "actuator.json", card)

    def recordings(*_):
        raise AssertionError("recordings are read again")

    monkeypatch.setattr(type(study), "recordings", recordings)
    actuator, period = module._actuator(study)
    assert (actuator, period) == ({**ACTUATOR, "delay": 0.002}, 0.002)
    assert worn_values(study, participant="S1").numbers
