"""The laws of a worn elbow robot, exported: the same bits here and there, the printed law, nonsense does no harm."""

import shutil
import subprocess

import numpy as np
import pytest
from exported import Loaded, nonsense, written

import pellucid
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.elbow_laws import PUBLISHED_EXPONENTS
from pellucid.controllers.export.elbow_values import elbow_values, lowest_resonance
from pellucid.controllers.export.microcontroller import measure, missing_tools
from pellucid.models.anthropometry import forearm
from pellucid.models.card import CardParameter, write_card
from pellucid.models.slider_joint import SliderCard, read_slider_card
from pellucid_lab.pointing.conditions import controller_builder
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants

compiled = pytest.mark.skipif(
    not all(map(shutil.which, ("make", "cc", "c++", "nm"))), reason="make, cc, c++ or nm is not installed"
)
on_m4 = pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")

STUDY = """
name = "bench"
[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"
limits = { position_min = "-10 deg", position_max = "130 deg", effort = "6 N*m" }
[rig.slider]
low = "0.12 m"
high = "0.27 m"
[rig.drive]
kind = "torque"
[participants.P1]
mass = "63 kg"
height = "1.75 m"
[participants.P2]
mass = "70 kg"
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

BODY = {
    "inertia": 0.032, "carriage_moment": -0.0045, "gravity": 1.15, "gravity_cosine": 0.26,
    "coulomb_positive": 0.26, "coulomb_negative": 0.21, "viscous_positive": 0.05, "viscous_negative": 0.04,
}  # fmt: skip
ONE_WAY = {
    "moment_slope": 0.48, "moment": 0.12, "cross_moment": 0.026, "coulomb": 0.25, "viscous": 0.05,
    "a0": 0.032, "a1": -0.009, "a2": 0.48,
}  # fmt: skip
CARDS = {
    "pooled": ONE_WAY,
    "dissociated": {f"{name}_{way}": value for way in ("up", "down") for name, value in ONE_WAY.items()},
    "load": BODY | {"load_motoring": 0.13, "load_generating": 0.11},
}


@pytest.fixture
def study(tmp_path):
    """A joint with a carriage that was identified, on disk."""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "a.csv").write_text("t,q,u\n0,0,0\n", encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "models").mkdir()
    for family, values in CARDS.items():
        made = tuple(CardParameter(n, "1", v, 0.0, (v, v)) for n, v in values.items())
        known = {"carriage_mass": 0.48} if family == "load" else {}
        card = SliderCard(
            study="bench", family=family, method="", motion="rotary", effort_unit="N*m", lifts="flexion",
            parameters=made, covariance=(), known=known, rail=(0.12, 0.27), drive={"gain": 1.0}, heldout_error=None,
            residual_sd=0.0, processing="", confidence=0.95, notes=(), checksums={}, pellucid="0",
            presliding_travel=CardParameter("presliding_travel", "rad", 3e-4, 2e-5, (2.6e-4, 3.4e-4)),
        )  # fmt: skip
        write_card(tmp_path / "models" / f"slider.{family}.json", card)
    return pellucid.open(tmp_path)


def worn_by(controller):
    """What `export` must be told beyond the controller's name."""
    return {"participant": "P1"} if ELBOW_CONTROLLERS[controller].wearer else {}


COMPILED_QUICKLY = ("clpc", "fc", "force_sensor")
"""One controller of each kind of law: others share its code and differ in their numbers."""


def one_of_each_kind():
    """All controllers; those are nightly whose code is another's, so that only their constants differ."""
    return [
        pytest.param(name, marks=() if name in COMPILED_QUICKLY else pytest.mark.nightly) for name in ELBOW_CONTROLLERS
    ]


def test_one_law_of_each_kind_is_compiled_every_time(study):
    kinds = {name: elbow_values(study, name, **worn_by(name)).law for name in ELBOW_CONTROLLERS}
    assert {kinds[name] for name in COMPILED_QUICKLY} == set(kinds.values())
    assert len(COMPILED_QUICKLY) == len(set(kinds.values()))


@compiled
@pytest.mark.parametrize("controller", one_of_each_kind())
def test_each_compiles_without_a_warning_and_needs_no_heap(study, controller):
    folder = pellucid.export(study, controller=controller, **worn_by(controller))
    subprocess.run(["make", "-s", "check"], cwd=folder, check=True, capture_output=True)
    listed = subprocess.run(["nm", "-u", "build/controller.o"], cwd=folder, capture_output=True, text=True, check=True)
    allowed = {"memcpy", "memmove", "memset", "sqrtf", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    assert {line.split()[-1] for line in listed.stdout.splitlines()} <= allowed


@compiled
@on_m4
@pytest.mark.parametrize(
    "controller",
    ["clpc", *(pytest.param(n, marks=pytest.mark.nightly) for n in (*COMPILED_QUICKLY[1:], "emg", "oscillator"))],
)
def test_a_cortex_m4_answers_bit_by_bit_as_the_host(study, controller):
    found = measure(pellucid.export(study, controller=controller, **worn_by(controller)))
    assert found.wrong == 0
    assert found.steps > 500
    assert 100 < found.instructions <= found.most < 5000


@compiled
@pytest.mark.parametrize("controller", ["clpc", "fc", "force_sensor", "oscillator"])
def test_nonsense_does_no_harm(study, controller, rng):
    values = elbow_values(study, controller)
    nonsense(Loaded(written(values, study.folder / "controller"), values), rng, 10_000)


@compiled
@pytest.mark.parametrize("speed", [0.8, -0.8])
def test_what_full_compensation_gives_is_the_printed_law(study, speed):
    """Against figure 5 and equation 8 in double precision, at a steady speed."""
    values = elbow_values(study, "fc")
    robot = Loaded(written(values, study.folder / "controller"), values)
    assert robot.init() == 0
    for i in range(500):
        q = 1.0 + speed * 1e-3 * (i - 250)
        out = robot.step(q)
    n, way = values.numbers, "up" if speed > 0 else "down"
    inertia = np.clip(n[f"inertia_{way}"] * abs(speed) ** n[f"exponent_{way}"], 0.0, n["inertia_limit"])
    weight = n[f"gravity_sine_{way}"] * np.sin(q) + n[f"gravity_cosine_{way}"] * np.cos(q)
    expected = weight + n[f"viscous_{way}"] * speed + np.sign(speed) * (n[f"coulomb_{way}"] + inertia)
    assert out.fault == 0
    assert abs(expected) > 1.0
    assert out.effort == pytest.approx(expected, abs=2e-3)


def test_every_number_of_a_law_is_there_and_the_study_limits_it(study):
    for controller in ELBOW_CONTROLLERS:
        values = elbow_values(study, controller, **worn_by(controller))
        assert set(values.remarks) == set(values.numbers)
        assert set(values.numbers) == set(LAWS[values.law].parameters)
        assert values.numbers["effort_limit"] == 6.0
        assert values.numbers["position_max"] == pytest.approx(2.2689, abs=1e-4)
        assert values.numbers["velocity_limit"] == 8.0


def test_what_cannot_be_exported_is_told(study):
    with pytest.raises(PellucidError, match='found the controller "pid", expected one of clpc, pcfr, fc'):
        pellucid.export(study, controller="pid")
    with pytest.raises(PellucidError, match=r"found the carriage at 0.5 m, expected 0.12 to 0.27 m"):
        pellucid.export(study, controller="fc", slider=0.5)
    for given, said in (
        ({"controller": "emg"}, "found the participant none, expected one of .participants.: P1, P2"),
        ({"controller": "emg", "participant": "P2"}, "lacks height"),
        ({"controller": "clpc", "participant": "P1"}, "does not depend on the wearer"),
        ({"controller": "clpc", "exponents": (0.0, 0.0)}, 'only "fc" and "pcfr" have them'),
        ({"exponents": (0.0, 0.0)}, "found exponents without a controller"),
        ({"controller": "fc", "exponents": (5.0, float("nan"))}, "found exponents 5 and nan, expected -10 to 10"),
        ({"controller": "clpc", "card": "slider.load.json"}, "found a card and a controller"),
    ):
        with pytest.raises(PellucidError, match=said):
            pellucid.export(study, **given)
    (study.models_dir / "slider.pooled.json").unlink()
    with pytest.raises(PellucidError, match="no such model card"):
        pellucid.export(study, controller="clpc")


def test_a_law_of_torques_wants_a_card_of_torques(study):
    path = study.models_dir / "slider.load.json"
    path.write_text(path.read_text(encoding="utf-8").replace('"N*m"', '"A"', 1), encoding="utf-8")
    with pytest.raises(PellucidError, match=r"found efforts in A, expected N\*m"):
        pellucid.export(study, controller="transparent")


def test_a_weight_beyond_the_effort_limit_is_told(study):
    told = "cannot hold the joint everywhere**: the weight that it has to hold is up to"
    light, heavy = elbow_values(study, "transparent"), elbow_values(study, "transparent", load=(5.0, 0.3))
    assert not any(told in note for note in light.all_notes)
    assert heavy.all_notes[0].count(told) == 1


def test_the_exponents_are_told_to_be_another_robots_until_they_are_given(study):
    plain, own = elbow_values(study, "fc"), elbow_values(study, "pcfr", exponents=(0.5, -0.5))
    assert (plain.numbers["exponent_up"], plain.numbers["exponent_down"]) == PUBLISHED_EXPONENTS
    assert (own.numbers["exponent_up"], own.numbers["exponent_down"]) == (0.5, -0.5)
    assert any("another robot" in note for note in plain.notes)
    assert not any("another robot" in note for note in own.notes)


def with_resonance(study, said):
    """Return a study whose drive has a lowest resonance."""
    path = study.folder / "study.toml"
    text = path.read_text(encoding="utf-8")
    text = "".join(line for line in text.splitlines(keepends=True) if "lowest_resonance" not in line)
    path.write_text(text.replace('kind = "torque"', f'kind = "torque"\nlowest_resonance = "{said}"'), encoding="utf-8")
    return pellucid.open(study.folder)


def test_a_force_sensors_gain_is_lowered_unless_the_transmission_is_stiff(study):
    """With more a rotor that swings against its joint rang on six of 300 foreign plants."""
    for controller in ("force_sensor", "residual", "zero_impedance"):
        values = elbow_values(study, controller, **worn_by(controller))
        assert values.numbers["proportional"] == 0.5
        assert sum("lowest_resonance" in note for note in values.notes) == 1
    plain = elbow_values(study, "force_sensor").numbers
    heard, unheard = elbow_values(study, "disturbance_observer"), elbow_values(study, "transparent")
    assert heard.numbers["proportional"] == unheard.numbers["proportional"] == 0.0
    assert not any("lowest_resonance" in note for note in (*heard.notes, *unheard.notes))
    assert heard.numbers["disturbance_share"] == pytest.approx(1 / 3)
    assert sum("disturbance observer" in note and "load" in note for note in heard.notes) == 1
    assert elbow_values(with_resonance(study, "44 Hz"), "force_sensor").numbers == plain
    stiff = elbow_values(with_resonance(study, "45 Hz"), "force_sensor")
    assert stiff.numbers["proportional"] == 1.5
    assert stiff.numbers["energy_store"] == pytest.approx(1.4 * plain["energy_store"])
    assert not any("lowest_resonance" in note for note in stiff.notes)


@pytest.mark.parametrize("stated", [None, "60 Hz"])
def test_what_is_exported_is_what_virtual_people_wear(study, stated):
    """The same numbers under the same name for every law, but for the limits that the study sets."""
    if stated is not None:
        study = with_resonance(study, stated)
    person = draw_people(elbow_participants(), np.random.default_rng(1), count=1)[0]
    cards = {c.method: read_slider_card(study.models_dir / c.card) for c in ELBOW_CONTROLLERS.values()}
    for controller, named in ELBOW_CONTROLLERS.items():
        there = elbow_values(study, controller, slider=0.2, **worn_by(controller)).numbers
        built = controller_builder(cards, controller, lowest_resonance=lowest_resonance(study))
        law = built(person, 0.2)
        here = law.values
        differ = {name for name in here if here[name] != there[name]}
        limb = {"limb_inertia", "limb_gravity"} if named.wearer else set()
        limb |= {"gravity_sine"} if law.supported else set()  # a share of the limb's weight, of two people
        assert differ <= {"effort_limit", "position_min", "position_max", "stop_margin"} | limb
    emg = elbow_values(study, "emg", participant="P1").numbers
    assert emg["limb_gravity"] == pytest.approx(forearm(63.0, 1.75).gravity())
    assert emg["emg_share"] > 0.0


def test_a_readmes_loop_fills_only_the_optional_inputs_that_are_used(study, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda tool: None)
    readme = (pellucid.export(study, controller="force_sensor") / "README.md").read_text(encoding="utf-8")
    assert "Optional inputs that the controller uses: interaction. The others stay not valid" in readme
    assert "input.interaction = " in readme
    assert "input.muscle = " not in readme
    assert "; optional, not used by this controller |" in readme
