"""Printed numbers keep their digits; a published model is evaluated as printed; what can exist is not complained of."""

import json

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.models.joint import GRAVITY
from pellucid.units import to_si_factor
from pellucid_lab.papers.able.card import published_card, write_published_card
from pellucid_lab.papers.able.coherence import (
    implied_friction,
    inconsistencies,
    positive_inertia_range,
)
from pellucid_lab.papers.able.elbow import DirectionSet, PublishedElbow, able_elbow, published_angle
from pellucid_lab.papers.paired_test import paired_test
from pellucid_lab.papers.printed import Printed, papers, printed


def coherent(**changed) -> PublishedElbow:
    """A forearm of 1.2 kg with a slider of 0.5 kg, the same both ways but for friction."""
    shared = {"m_x_slope": 0.5, "m_x_offset": 0.2, "m_y": 0.01}
    moving = shared | {"viscous": 0.1, "inertia": (0.06, 0.1, 0.5)}
    sets = {
        "down": moving | {"coulomb": 0.3},
        "static": shared | {"adherence": 0.4},
        "up": moving | {"coulomb": 0.2},
    }
    for where, cells in changed.items():
        sets[where] = sets[where] | cells
    return PublishedElbow("an elbow that can exist", {name: DirectionSet(**cells) for name, cells in sets.items()})


# ------------------------------------------------------------------------------------------------ printed numbers


def test_digits_are_kept():
    able = printed("able")
    mean = able.tables["duration"]["fc"]["mean"]
    assert (mean.value, mean.half_unit, mean.unit) == (0.98, pytest.approx(0.0005), "s")
    assert able.values["paired_p"].half_unit == pytest.approx(5e-9)
    assert able["sweep_duration"] == 25.0
    assert [a.value for a in able.values["amplitudes"]] == [12, 24, 36, 48, 60]
    with pytest.raises(KeyError, match="list of 5"):
        able["amplitudes"]


def test_every_unit_is_one_and_every_number_says_where_it_stands():
    for name in papers():
        paper = printed(name)
        numbers = [n for v in paper.values.values() for n in (v if isinstance(v, tuple) else (v,))]
        numbers += [cell for table in paper.tables.values() for row in table.rows.values() for cell in row.values()]
        assert len(numbers) > 90
        for number in numbers:
            to_si_factor(number.unit, None)
            assert number.where.startswith(("Table ", "Section", "eq. ", "Fig. ", "Abstract"))


def test_a_number_agrees_with_what_rounds_to_it():
    number = Printed(0.037, 0.0005, "1", "here")
    assert number.agrees(0.0366)
    assert number.agrees(0.0375)
    assert not number.agrees(0.0376)


def test_an_unknown_paper_names_the_known():
    with pytest.raises(PellucidError, match="able"):
        printed("nobody")


# ----------------------------------------------------------------------------------------------- the elbow as printed


def test_the_elbow_is_equation_3():
    elbow, x, q, v, a = able_elbow(), 0.1, 0.4, -0.7, 2.0
    by_hand = (
        9.80665 * ((0.98 * x - 0.45) * np.cos(q) - 0.13 * np.sin(q))
        + 0.018 * v
        - 0.047
        + (-0.0019 - 0.043 * x - 0.081 * x**2) * a
    )
    assert elbow.torque("down", x, q, v, a) == pytest.approx(by_hand, rel=1e-12)
    at_rest = 9.80665 * ((0.46 * x - 0.19) * np.cos(q) - 0.069 * np.sin(q)) - 0.12
    assert elbow.torque("static", x, q, 0.0, 0.0) == pytest.approx(at_rest, rel=1e-12)
    assert elbow.current(3.0, torque_constant=0.05, reduction=30.0) == pytest.approx(2.0)


def test_shapes_follow_the_arguments():
    elbow = able_elbow()
    assert elbow.gravity("up", np.zeros((3, 1)), np.zeros(5)).shape == (3, 5)
    assert elbow.friction("static", np.zeros(4)).shape == (4,)
    assert elbow.torque("up", 0.1, np.zeros(4), np.ones(4), np.ones(4)).shape == (4,)


def test_angles_are_converted_at_the_boundary():
    """A forearm with its mass along itself needs no torque hanging, and most of it level."""
    elbow = coherent(static={"m_y": 0.0, "adherence": 0.0})
    position = np.array([0.0, 0.5 * np.pi, np.pi])
    torque = elbow.gravity("static", 0.0, published_angle(position))
    assert torque == pytest.approx(GRAVITY * 0.2 * np.sin(position), abs=1e-12)
    assert published_angle(0.5 * np.pi) == 0.0


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda e: e.gravity("sideways", 0.0, 0.0), "sideways.*down, static, up"),
        (lambda e: e.inertia("static", 0.0), "no inertia"),
        (lambda e: e.current(1.0, torque_constant=0.0, reduction=30.0), "must be positive"),
    ],
)
def test_the_elbow_refuses(call, said):
    with pytest.raises(PellucidError, match=said):
        call(able_elbow())


# ------------------------------------------------------------------------------------------------------- coherence


def test_a_joint_that_can_exist_is_not_complained_of():
    assert inconsistencies(coherent()) == ()
    assert positive_inertia_range(coherent(), "up") is None
    sliders = np.linspace(0.0, 0.3, 7)
    moment = coherent().first_moment("up", sliders) ** 2 + coherent().direction("up").m_y ** 2
    assert np.all(moment / coherent().inertia("up", sliders) < 1.2)
    friction = implied_friction(coherent(), np.zeros(2), np.zeros(3))
    assert friction.shape == (2, 3)
    assert friction == pytest.approx(np.full((2, 3), 0.25))


@pytest.mark.parametrize(
    ("changed", "subjects"),
    [
        ({"down": {"inertia": (-0.01, 0.1, 0.5)}}, {"inertia"}),
        ({"up": {"inertia": (0.06, 0.1, -0.5)}}, {"slider_mass"}),
        ({"static": {"adherence": -0.1}}, {"adherence"}),
        ({"static": {"m_x_offset": 0.25}}, {"rest"}),
        ({"static": {"m_x_slope": 0.4}}, {"one_mass", "rest"}),
        ({"up": {"m_y": 0.02}}, {"gravity_jump"}),
        ({"up": {"m_y": 0.2}}, {"gravity_jump", "friction_sign"}),
    ],
)
def test_each_fault_is_named_alone(changed, subjects):
    assert {i.subject for i in inconsistencies(coherent(**changed))} == subjects


# ------------------------------------------------------------------------------------------------------------ cards


def test_a_card_says_what_is_printed_and_what_is_wrong(tmp_path):
    path = tmp_path / "elbow.json"
    write_published_card(path, able_elbow())
    table = json.loads(path.read_text(encoding="utf-8"))
    assert table["kind"] == "as_published"
    assert table["directions"]["down"]["inertia"] == [-0.0019, -0.043, -0.081]
    assert {w["subject"] for w in table["warnings"]} == {i.subject for i in inconsistencies(able_elbow())}
    assert "torque constant" in table["missing"]
    assert published_card(coherent())["warnings"] == []


def test_a_card_of_an_identified_model_is_not_mistaken_for_one(tmp_path):
    from pellucid.models.card import read_card

    path = tmp_path / "elbow.json"
    write_published_card(path, able_elbow())
    with pytest.raises(PellucidError, match="not a model card"):
        read_card(path)


# ----------------------------------------------------------------------------------------------------- recomputation


def test_a_paired_test_gives_back_what_data_say():
    from scipy import stats

    rng = np.random.default_rng(2)
    a = rng.normal(1.0, 0.3, 18)
    b = 0.4 * a + rng.normal(0.2, 0.2, 18)
    t, p = stats.ttest_rel(a, b)
    found = paired_test(t, 18, means=(a.mean(), b.mean()), sds=(a.std(ddof=1), b.std(ddof=1)))
    assert found.p_value == pytest.approx(p, rel=1e-10)
    assert found.correlation == pytest.approx(np.corrcoef(a, b)[0, 1], rel=1e-10)
    assert found.sd_of_differences == pytest.approx((a - b).std(ddof=1), rel=1e-10)
    assert found.effect_size == pytest.approx((a - b).mean() / (a - b).std(ddof=1), rel=1e-10)
    assert found.unpaired_t == pytest.approx(stats.ttest_ind(a, b).statistic, rel=1e-10)
    with pytest.raises(PellucidError, match="t != 0"):
        paired_test(0.0, 18, means=(1.0, 1.0), sds=(1.0, 1.0))
