"""Periods, carry-over and learning: taken out of the change, declared, and doubted; against least squares."""

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.people.certificate import PASS, Doubt, certificate, certificate_from_tests
from pellucid.people.equivalence import Margin, equivalence
from pellucid.people.mixed_model import thirds
from pellucid.people.movement_indices import SimulatedStudies, are_transparent
from pellucid.people.session_periods import SessionPeriods, adjustment

WIDE = Margin.either_way(1.0)
WILLIAMS = np.array([(0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1)])


def test_two_orders_are_the_mean_of_both_sequences_means(rng):
    """Hills and Armitage: twelve of fourteen have control first, and the period lowers their change."""
    later = np.where(np.arange(14) < 12, 1.0, -1.0)
    d = 0.1 - 0.08 * later + rng.normal(0.0, 0.02, 14)
    found = equivalence(d, WIDE, sessions=SessionPeriods.of_two(later))
    assert found.estimate == pytest.approx(0.5 * (d[:12].mean() + d[12:].mean()))
    assert abs(found.estimate - 0.1) < 0.03 < abs(d.mean() - 0.1)
    # Its error is that of least squares with an intercept and the period.
    design = np.column_stack([np.ones(14), later])
    rest = np.linalg.lstsq(design, d, rcond=None)[1][0]
    error = np.sqrt(rest / 12 * np.linalg.inv(design.T @ design)[0, 0])
    wide = found.fit.widened(found.differences)
    assert wide.std(ddof=1) / np.sqrt(14) == pytest.approx(error, rel=1e-9)


def test_a_balanced_period_costs_no_power(rng):
    later = np.where(np.arange(20) < 10, 1.0, -1.0)
    drawn = 0.4 * rng.standard_normal((2000, 20))
    sessions = SessionPeriods.of_two(later)
    said = [
        are_transparent(SimulatedStudies((drawn + period * later)[:, :, None], sessions), [WIDE])
        for period in (0.0, 1.5)
    ]
    assert said[0].mean() > 0.9
    np.testing.assert_array_equal(*said)


def test_periods_of_a_williams_design_are_those_of_statsmodels(rng):
    api = pytest.importorskip("statsmodels.api")
    periods = np.argsort(np.tile(WILLIAMS, (3, 1))[:11], axis=1) + 1
    d = rng.normal(0.1, 0.05, 11)
    found = equivalence(d, WIDE, method="t", sessions=SessionPeriods.of_conditions(periods, 0, 1))
    columns = [(periods[:, 1] == p) * 1.0 - (periods[:, 0] == p) for p in (2, 3, 4)]
    line = api.OLS(d, api.add_constant(np.column_stack(columns))).fit()
    assert found.estimate == pytest.approx(line.params[0])
    assert found.fit.degrees == line.df_resid
    wide = found.fit.widened(found.differences)
    assert wide.std(ddof=1) / np.sqrt(11) == pytest.approx(line.bse[0])


def test_an_order_that_is_the_same_for_all_changes_nothing(rng):
    d = rng.normal(0.0, 0.1, 12)
    same = SessionPeriods.of_two(np.ones(12))
    assert adjustment(12, same).is_plain
    assert equivalence(d, WIDE, sessions=same).interval == equivalence(d, WIDE).interval


def test_a_carry_over_up_to_the_declared_one_is_allowed_for():
    later = np.array([1.0, -1.0] * 6)
    d = 0.7 + np.random.default_rng(6).normal(0.0, 0.05, 12)
    sessions = SessionPeriods.of_two(later)
    assert adjustment(12, sessions).carry_over_share == pytest.approx(0.5)
    none, some, much = (equivalence(d, WIDE, sessions=sessions, largest_carry_over=c) for c in (0.0, 0.25, 1.0))
    assert none.p_within < some.p_within <= 0.05 < much.p_within
    assert none.interval == some.interval
    # Of four conditions one person in four has the control after the robot.
    williams = SessionPeriods.of_conditions(np.argsort(np.tile(WILLIAMS, (3, 1)), axis=1), 0, 1)
    assert adjustment(12, williams).carry_over_share == pytest.approx(0.25)


def test_the_tipping_point_overturns_the_verdict():
    later = np.array([1.0, -1.0] * 8)
    d = 0.3 + np.random.default_rng(8).normal(0.0, 0.1, 16)
    sessions = SessionPeriods.of_two(later)
    found = certificate({"d": d}, {"d": WIDE}, sessions=sessions)
    tip = found.tipping_point("d")
    assert found.verdict == PASS
    assert 0.25 < tip < 1.4
    for carry_over, same in ((tip - 0.01, True), (tip + 0.02, False)):
        again = certificate({"d": d}, {"d": WIDE}, sessions=sessions, largest_carry_over=carry_over)
        assert (again.verdict == PASS) == same
    assert certificate({"d": d}, {"d": WIDE}).tipping_point("d") is None


def test_arrays_and_tables_tell_the_same_adjusted_change(rng):
    later = np.where(np.arange(14) < 12, 1.0, -1.0)
    free = np.exp(rng.normal(0.0, 0.1, 14))
    worn = free * np.exp(rng.normal(0.0, 0.02, 14) + 0.08 * later)
    by_arrays = pl.certify({"duration": (free, worn)}, {"duration": 0.10}, later=later).end_points["duration"]
    rows = [
        (f"P{i}", condition, value, period)
        for i in range(14)
        for condition, value, period in (
            ("Ctrl", free[i], 1 if later[i] > 0 else 2), ("Robot", worn[i], 2 if later[i] > 0 else 1),
        )
    ]  # fmt: skip
    table = dict(zip(("participant", "condition", "duration", "period"), zip(*rows, strict=True), strict=True))
    assessed = pl.assess(table, control="Ctrl", margins={"duration": 0.10}).certificates["Robot"]
    by_table = assessed.end_points["duration"]
    assert by_table.estimate == pytest.approx(by_arrays.estimate, abs=1e-12)
    assert by_table.interval == pytest.approx(by_arrays.interval, abs=1e-12)
    assert (by_table.p_within, by_table.p_beyond) == (by_arrays.p_within, by_arrays.p_beyond)
    with pytest.raises(PellucidError, match="found later for 3 participants"):
        pl.certify({"duration": (free, worn)}, {"duration": 0.10}, later=[1.0, -1.0, 1.0])


def test_thirds_show_a_drift_and_not_the_kinds_of_movements(rng):
    cells = ["short", "long", "middle"] * 10
    height = np.array([{"short": 0.0, "long": 1.0, "middle": 0.4}[cell] for cell in cells])
    assert thirds(height, cells).drift == pytest.approx(0.0, abs=1e-12)
    assert thirds(height - 0.01 * np.arange(30), cells).drift == pytest.approx(-0.2, abs=0.01)
    assert thirds([1.0] * 8, ["a"] * 8) is None


def test_a_doubt_takes_a_claim_away_and_never_makes_one(rng):
    margin = {"duration": Margin.of_ratio(0.1)}
    plain = certificate({"duration": rng.normal(0.0, 0.02, 14)}, margin)
    far = certificate({"duration": rng.normal(0.3, 0.02, 14)}, margin)
    own, other = plain.end_points["duration"], far.end_points["duration"]
    assert plain.verdict == PASS
    for p, without, said in ((0.01, other, "undecided"), (0.01, own, "within"), (0.2, other, "within")):
        doubted = certificate_from_tests({"duration": own}, 0.05, {"duration": (Doubt("learning", p, without),)})
        assert doubted.said_of("duration") == said
    assert (
        certificate_from_tests({"duration": other}, 0.05, {"duration": (Doubt("period", 0.01, own),)}).verdict
        == "cannot say"
    )
