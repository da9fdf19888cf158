"""Printed numbers keep their digits; a published model is evaluated as printed; what can exist is not complained of."""

import json

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.models.joint import GRAVITY
from pellucid.papers.able import moving_average
from pellucid.papers.able.card import published_card, read_published_card, write_published_card
from pellucid.papers.able.coherence import (
    implied_friction,
    inconsistencies,
    least_mass,
    positive_inertia_range,
)
from pellucid.papers.able.elbow import DirectionSet, PublishedElbow, able_elbow, direction_of, published_angle
from pellucid.papers.able.parameter_count import chain_parameters, coupled_parameters, listed_sets
from pellucid.papers.paired_test import paired_test
from pellucid.papers.printed import Printed, papers, printed
from pellucid.papers.sd_bounds import sd_bounds
from pellucid.units import to_si_factor


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


def test_the_switch_has_no_band():
    assert [direction_of(v) for v in (-1e-300, 0.0, 1e-300)] == ["down", "static", "up"]


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
    assert np.all(least_mass(coherent(), "up", np.linspace(0.0, 0.3, 7)) < 1.2)
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


def test_a_card_comes_back_and_says_what_is_wrong(tmp_path):
    path = tmp_path / "elbow.json"
    write_published_card(path, able_elbow())
    assert read_published_card(path) == able_elbow()
    table = json.loads(path.read_text(encoding="utf-8"))
    assert table["kind"] == "as_published"
    assert {w["subject"] for w in table["warnings"]} == {i.subject for i in inconsistencies(able_elbow())}
    assert "torque constant" in table["missing"]
    assert published_card(coherent())["warnings"] == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "no such card"),
        ("{", "not a card"),
        ('{"format": 1}', "kind"),
        ('{"kind": "as_published", "format": 2}', "format 2"),
        ('{"kind": "as_published", "format": 1, "source": "s", "directions": {}}', "down"),
        ('{"kind": "as_published", "format": 1, "source": "s", "directions": {"down": {"mass": 1}}}', "unknown mass"),
    ],
)
def test_other_files_are_refused(tmp_path, text, said):
    path = tmp_path / "card.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(PellucidError, match=said):
        read_published_card(path)


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


@pytest.mark.parametrize("n", [3, 4, 5, 6])
def test_sd_bounds_hold_samples_and_are_reached(n):
    """Samples with the same mean, minimum, median and maximum as another: none lies outside, some come close."""
    rng = np.random.default_rng(n)
    x = np.sort(rng.uniform(0.0, 1.0, n))
    known = {"mean": x.mean(), "low": x[0], "median": np.median(x), "high": x[-1]}
    least, most = sd_bounds(n, **known)
    assert least - 1e-6 <= x.std(ddof=1) <= most + 1e-6
    # Directions that keep all four statistics, from the sample on, as far as the order allows.
    forms = np.zeros((4, n))
    forms[0], forms[1, 0], forms[2, -1] = 1.0, 1.0, 1.0
    forms[3, (n - 1) // 2] += 0.5
    forms[3, n // 2] += 0.5
    _, s, vt = np.linalg.svd(forms)
    free = vt[np.sum(s > 1e-12) :]
    seen = [x.std(ddof=1)]
    for _ in range(20_000 if len(free) else 0):
        y = x + rng.normal(0.0, 0.3, len(free)) @ free
        if np.all(np.diff(y) >= 0.0):
            seen.append(y.std(ddof=1))
    assert least - 1e-6 <= min(seen)
    assert max(seen) <= most + 1e-6
    if len(free):
        assert len(seen) > 20
    assert min(seen) - least < 0.02
    assert most - max(seen) < 0.02


def test_sd_bounds_by_hand():
    """0, a, 0.5, b, 1 with a + b = 1: evenly squeezed to the middle, or thrown to the ends."""
    least, most = sd_bounds(5, mean=0.5, low=0.0, median=0.5, high=1.0)
    assert least == pytest.approx(np.sqrt(0.5 / 4.0), abs=1e-6)
    assert most == pytest.approx(np.sqrt(1.0 / 4.0), abs=1e-6)
    _, most = sd_bounds(5, mean=0.5, low=0.0, median=0.5, high=1.0, ddof=0)
    assert most == pytest.approx(np.sqrt(1.0 / 5.0), abs=1e-6)
    wider = sd_bounds(5, mean=0.5, low=0.0, median=0.5, high=1.0, half_unit=0.01)
    assert wider[0] < least
    assert wider[1] > np.sqrt(1.0 / 4.0)


def test_sd_bounds_refuse_what_cannot_be():
    with pytest.raises(PellucidError, match="no 6 values"):
        sd_bounds(6, mean=0.9, low=0.0, median=0.1, high=1.0)
    with pytest.raises(PellucidError, match="3 to 8"):
        sd_bounds(40, mean=0.5, low=0.0, median=0.5, high=1.0)


@pytest.mark.parametrize("joints", [1, 2, 3, 5, 7])
def test_parameter_counts_are_those_of_a_list(joints):
    chain = [set(range(i)) for i in range(joints)]
    full = [set(range(joints)) - {i} for i in range(joints)]
    assert chain_parameters(joints, 9) == 9 * listed_sets(chain)
    assert coupled_parameters(joints, 9) == 9 * listed_sets(full)


def test_parameter_counts_refuse_nothing_to_count():
    with pytest.raises(PellucidError, match="at least 1"):
        chain_parameters(0, 9)


@pytest.mark.parametrize(("n", "fs", "frequency"), [(100, 1000.0, 3.0), (40, 179.0, 1.1)])
def test_a_moving_average_by_averaging(n, fs, frequency):
    time = np.arange(20_000) / fs
    averaged = np.convolve(np.exp(2j * np.pi * frequency * time), np.full(n, 1.0 / n), mode="valid")
    assert np.abs(averaged) == pytest.approx(moving_average.gain(n, fs, frequency), rel=1e-9)
    late = -np.angle(averaged[0] / np.exp(2j * np.pi * frequency * time[n - 1])) / (2.0 * np.pi * frequency)
    assert late == pytest.approx(moving_average.delay(n, fs), rel=1e-9)
    assert moving_average.gain(n, fs, moving_average.cutoff(n, fs)) == pytest.approx(np.sqrt(0.5), rel=1e-9)
    with pytest.raises(PellucidError, match="no cutoff"):
        moving_average.cutoff(1, fs)
