"""Laws of a worn elbow robot: from cards alone, as published, and within their limits whatever comes in."""

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.elbow_laws import (
    full_compensation,
    partial_compensation,
    position_control,
)
from pellucid.controllers.transparent_laws import (
    breakaway,
    sensitivity_amplification,
    transparent,
    with_disturbance_observer,
    with_dither,
    with_emg,
    with_force_sensor,
    with_oscillator,
    zero_impedance,
)
from pellucid.models.anthropometry import forearm
from pellucid.models.card import CardParameter
from pellucid.models.joint import GRAVITY
from pellucid.models.slider_joint import DirectionalSliderModel, SliderCard, SliderJointModel

UP = {"moment_slope": 0.55, "moment": 0.13, "cross_moment": 0.027, "coulomb": 0.3, "viscous": 0.06, "a0": 0.036,
      "a1": -0.01, "a2": 0.54}  # fmt: skip
DOWN = UP | {"moment_slope": 0.43, "moment": 0.11, "coulomb": 0.25, "viscous": 0.04}
LOAD = {"inertia": 0.032, "carriage_moment": -0.004, "carriage_mass": 0.48, "gravity": 1.15, "gravity_cosine": 0.26,
        "coulomb_positive": 0.26, "coulomb_negative": 0.21, "viscous_positive": 0.05, "viscous_negative": 0.04,
        "load_motoring": 0.13, "load_generating": 0.11}  # fmt: skip
PLACE = 0.2


def card(family, values, known=None, travel=2e-5):
    parameters = tuple(CardParameter(n, "1", v, 0.05 * abs(v), (0.9 * v, 1.1 * v)) for n, v in values.items())
    k = len(parameters)
    return SliderCard(
        study="x", family=family, method="", motion="rotary", effort_unit="N*m", lifts="flexion",
        parameters=parameters, covariance=tuple((0.0,) * k for _ in range(k)), known=known or {}, rail=(0.12, 0.27),
        drive={"gain": 1.68}, heldout_error=None, residual_sd=0.1, processing="", confidence=0.95, notes=(),
        checksums={}, pellucid="",
        presliding_travel=None if travel is None else CardParameter(
            "presliding_travel", "rad", travel, 0.1 * travel, (0.8 * travel, 1.2 * travel)
        ),
    )  # fmt: skip


POOLED = card("pooled", UP)
BOTH = card("dissociated", {f"{k}_up": v for k, v in UP.items()} | {f"{k}_down": v for k, v in DOWN.items()})
KNOWN = {"carriage_mass": 0.48}
COHERENT = card("load", {name: LOAD[name] for name in SliderJointModel("load", KNOWN).names}, KNOWN)


LIMB = forearm(63.5, 1.755)


def laws():
    """Every controller, and everything at once."""
    cards = {"pooled": POOLED, "dissociated": BOTH, "load": COHERENT}
    made = {}
    for name, one in ELBOW_CONTROLLERS.items():
        made[name] = one.build(cards[one.method], PLACE, **({"limb": LIMB} if one.wearer else {}))
    everything = with_dither(with_emg(with_oscillator(with_force_sensor(transparent(COHERENT, PLACE))), LIMB))
    return made | {"everything": with_disturbance_observer(everything)}


def test_published_terms_are_those_of_the_card():
    law = full_compensation(BOTH, PLACE, exponents=(-1.0, -1.9))
    model = BOTH.model()
    assert isinstance(model, DirectionalSliderModel)
    assert law.values["gravity_sine_up"] == pytest.approx(GRAVITY * (0.55 * PLACE + 0.13))
    assert law.values["inertia_down"] == pytest.approx(model.inertia("down", PLACE))
    assert (law.values["exponent_up"], law.values["exponent_down"]) == (-1.0, -1.9)
    without = partial_compensation(BOTH, PLACE)
    assert [without.values[k] for k in ("coulomb_up", "viscous_up", "coulomb_down", "viscous_down")] == [0.0] * 4
    assert without.values["gravity_sine_down"] == law.values["gravity_sine_down"]


def test_what_is_compensated_of_friction_is_the_lower_end_of_its_interval():
    values = transparent(COHERENT, PLACE).values
    assert values["coulomb_positive"] == pytest.approx(0.9 * LOAD["coulomb_positive"])
    assert values["load_motoring"] == pytest.approx(0.9 * LOAD["load_motoring"])
    assert values["gravity_sine"] == pytest.approx(LOAD["gravity"] + GRAVITY * 0.48 * PLACE)


def test_amplification_is_a_share():
    values = sensitivity_amplification(COHERENT, PLACE, amplification=4.0).values
    assert values["friction_share"] == values["inertia_share"] == 0.75
    with pytest.raises(PellucidError, match="expected 1 or more"):
        sensitivity_amplification(COHERENT, PLACE, amplification=0.5)


def test_a_tremble_is_as_strong_as_it_takes_to_break_the_robot_away():
    law = with_dither(transparent(COHERENT, PLACE), share=1.5, frequency=500.0)
    weight = np.hypot(LOAD["gravity"] + GRAVITY * 0.48 * PLACE, LOAD["gravity_cosine"])
    least = 0.9 * (LOAD["coulomb_positive"] + LOAD["load_motoring"] * weight)  # lower ends of the intervals
    assert law.values["dither"] == pytest.approx(1.5 * least, rel=1e-3)
    assert law.values["dither"] == 1.5 * breakaway(law)
    assert not law.sensed
    quick = with_dither(law, share=20.0, frequency=1000.0).values["dither"] * np.sin(np.arange(100.0))
    assert np.abs(np.diff(quick)).max() == pytest.approx(1.0, rel=1e-3)  # all that the gate's 1000 N m/s let through


def dithered(travel):
    names = SliderJointModel("load", KNOWN).names
    return ELBOW_CONTROLLERS["dithered"].build(card("load", {n: LOAD[n] for n in names}, KNOWN, travel), PLACE)


def test_dither_is_offered_where_travel_was_measured_and_is_short():
    with pytest.raises(PellucidError, match=r'found no presliding_travel.*protocol = "reversals".*transparent'):
        dithered(None)
    with pytest.raises(PellucidError, match=r"presliding_travel of 1 mrad.*expected at most 0.5"):
        dithered(1e-3)
    with pytest.raises(PellucidError, match=r"0.45 mrad \(0.36 to 0.54\)"):  # its interval reaches beyond
        dithered(4.5e-4)
    assert dithered(4e-4).values == dithered(0.0).values
    assert dithered(0.0).values["dither"] > 0.0


def test_an_observer_hears_the_sensor_as_late_as_it_is():
    law = with_disturbance_observer(transparent(COHERENT, PLACE), sensor_delay=0.004, sensor_lowpass=250.0)
    assert law.sensed
    assert law.values["disturbance_delay"] == pytest.approx(0.008)
    assert law.values["proportional"] == 0.0


def test_zero_impedance_compensates_nothing_by_model():
    law = zero_impedance(COHERENT, PLACE)
    assert [law.values[f"{what}_share"] for what in ("gravity", "friction", "inertia")] == [0.0] * 3
    assert law.sensed
    assert law.values["proportional"] > 0.0


def test_a_law_takes_the_card_it_was_made_for():
    with pytest.raises(PellucidError, match='found the model card of the family "dissociated", expected "pooled"'):
        position_control(BOTH, PLACE)
    with pytest.raises(PellucidError, match='expected "dissociated"'):
        full_compensation(POOLED, PLACE)
    with pytest.raises(PellucidError, match="expected one model for both"):
        transparent(POOLED, PLACE)
    with pytest.raises(PellucidError, match="no parameter k"):
        full_compensation(BOTH, PLACE).changed(k=1.0)


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("name", list(laws()))
def test_nothing_unsafe_comes_out_of_nonsense(name, single):
    law = laws()[name]
    assert len(law.parameters) == len(LAWS[law.kind].parameters)
    unsafe, faults, slowest, moving = _core.fuzz_law(law.kind, law.parameters, 200_000, 11, single)
    assert unsafe == 0
    assert faults > 30
    assert slowest <= 1
    assert moving > 50_000


def test_what_emg_leads_needs_a_limb():
    with pytest.raises(PellucidError, match="found no limb"):
        ELBOW_CONTROLLERS["residual"].build(COHERENT, PLACE)


def test_what_makes_no_sense_gives_nothing():
    law = transparent(COHERENT, PLACE)
    for change in ({"coulomb_positive": -0.1}, {"inertia_share": 1.2}, {"velocity_width": 0.0}, {"period": 0.0},
                   {"disturbance_share": 1.0}, {"disturbance_delay": 0.04}, {"dither_frequency": 4000.0}):  # fmt: skip
        broken = law.changed(**change)
        assert _core.fuzz_law(broken.kind, broken.parameters, 1000, 1)[3] == 0
    with pytest.raises(ValueError, match='law: found "other", expected one of'):
        _core.fuzz_law("other", [1.0], 10, 1)
    with pytest.raises(ValueError, match=r"expected \(24,\)"):
        _core.fuzz_law("directional", [1.0], 10, 1)


def test_a_step_is_timed():
    law = full_compensation(BOTH, PLACE)
    nanoseconds = _core.time_law(law.kind, law.parameters, 1000)
    assert nanoseconds.shape == (1000,)
    assert 0 < np.median(nanoseconds) < 1e5
