"""What certificates and tables say must follow from one test: change, interval, p, people, carry-over and reason."""

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.people.certificate import learning_doubt
from pellucid.people.equivalence import equivalence
from pellucid.people.margin import Margin
from pellucid.people.movement_noise import MovementNoise

ORDERED = {"control": "free", "design": "AB/BA", "period": "period", "margins": {"duration": "10 %"}}


def crossover(change=0.0, *, people=16, between=0.03, movements=8, noise=0.05, seed=0):
    """Return a table of movements of a balanced cross-over study; `change` is that of logarithms."""
    rng = np.random.default_rng(seed)
    found = {"participant": [], "condition": [], "period": [], "duration": [], "vmax": []}
    for p in range(people):
        own = change + between * rng.standard_normal()
        for period, condition in enumerate(("free", "worn") if p % 2 else ("worn", "free"), start=1):
            times = np.exp(noise * rng.standard_normal(movements) + own * (condition == "worn"))
            found["participant"] += [f"P{p}"] * movements
            found["condition"] += [condition] * movements
            found["period"] += [period] * movements
            found["duration"] += times.tolist()
            found["vmax"] += (90.0 / times).tolist()
    return found


@pytest.mark.parametrize("seed", range(12))
def test_interval_and_p_of_a_table_never_disagree(seed):
    change = np.random.default_rng([5, seed]).uniform(0.0, 0.04)
    found = pl.assess(crossover(change, seed=seed), analysis=ORDERED)
    for row in found._rows():
        assert (row["p"] < 0.05) == (row["low"] > 0.0 or row["high"] < 0.0), row


def test_a_table_tells_changes_as_its_certificate_does():
    found = pl.assess(crossover(), analysis=ORDERED)
    own = found.certificates["worn"].end_points["duration"]
    row = next(row for row in found._rows() if row["index"] == "duration")
    assert row["unit"] == "%"
    assert row["change"] == pytest.approx(100.0 * np.expm1(own.estimate))
    assert "changes without % are in the unit of their column" in repr(found)


def test_a_transparent_table_says_what_its_claim_rests_on():
    said = repr(pl.assess(crossover(), analysis=ORDERED))
    assert "90 % interval" in said
    assert " of 16 within: at least" in said
    assert "carry-over between sessions of at most 0.25 margins; more than" in said


def test_a_certificate_prints_its_verdict_and_reason():
    good = pl.certify(crossover(), analysis=ORDERED)
    assert repr(good).startswith("transparent\nindex ")
    assert "assumed: a carry-over" in repr(good)
    few = pl.certify(crossover(people=8), analysis=ORDERED)
    assert "duration, undecided: too few participants: 8 took part" in repr(few)
    assert few.reason("duration") in few._repr_html_()
    assert good.reason("duration") == ""


def test_a_certificate_of_differences_is_told_in_their_unit():
    free = np.random.default_rng(0).normal(1.0, 0.1, 16)
    found = pl.certify({"jerk": (free, free + 0.01)}, {"jerk": 0.2}, relative=False)
    (row,) = found._rows()
    assert (row["change"], row["margin_high"], row["unit"]) == (pytest.approx(0.01), pytest.approx(0.2), "")


def test_a_frame_has_a_row_for_each_end_point():
    pytest.importorskip("pandas")
    frame = pl.certify(crossover(), analysis=ORDERED).to_frame()
    assert list(frame["said"]) == ["within"]
    assert frame["tipping_point"][0] > 0.25


def test_a_negative_value_of_a_relative_end_point_is_refused_with_its_row():
    table = crossover()
    table["duration"][5] = -0.3
    with pytest.raises(PellucidError, match=r"column duration, row 5 \(P0, worn\): found -0.3, expected no negative"):
        pl.assess(table, analysis=ORDERED)


def test_a_duration_of_zero_is_a_missing_value_and_is_refused():
    table = crossover()
    table["duration"][5] = 0.0
    with pytest.raises(PellucidError, match=r"row 5 \(P0, worn\): found 0, expected a positive value: .* has NaN"):
        pl.assess(table, analysis=ORDERED)


def test_a_spread_that_is_a_percentage_without_its_sign_is_refused():
    with pytest.raises(PellucidError, match=r'found 4.*expected a share such as 0.04, or a percentage such as "4 %"'):
        pl.plan(ORDERED, people=16, sd=4, studies=50)


SLOWED = np.array([0.61, 0.82, 1.31, 0.83, 2.28, 0.88])
"""Changes of six people in logarithms, each far beyond a margin of 10 %."""


def certified(changes):
    return pl.certify({"duration": (np.ones(len(changes)), np.exp(changes))}, {"duration": 0.10})


def test_people_who_all_lie_far_beyond_are_enough_for_not_transparent():
    found = certified(SLOWED)
    assert found.beyond["duration"] > 0.05 > found.far["duration"]
    assert found.verdict == "not transparent"


def test_few_people_far_beyond_and_people_on_both_sides_decide_nothing():
    assert certified(SLOWED[:4]).verdict == "cannot say"
    assert certified(SLOWED * np.array([1, -1, 1, -1, 1, -1])).verdict == "cannot say"


def test_movements_that_carry_half_of_people_far_beyond_do_not_condemn_a_robot():
    said = []
    for seed in range(40):
        rng = np.random.default_rng([9, seed])
        times = np.exp(rng.standard_normal((8, 2, 2)))
        table = {
            "participant": np.repeat([f"P{k}" for k in range(8)], 4).tolist(),
            "condition": ["free", "free", "worn", "worn"] * 8,
            "duration": times.ravel(),
        }
        said.append(pl.assess(table, control="free", margins={"duration": 0.10}).certificates["worn"].verdict)
    assert said.count("not transparent") <= 2


def test_a_margin_shows_what_the_carry_over_leaves_of_it():
    found = pl.certify(crossover(), analysis=ORDERED)
    own = found.end_points["duration"]
    left = 100.0 * np.expm1(own.margin.high - own.allowance)
    assert f"-9.1 to +10.0 % (-7.9 to +{left:.1f} after carry-over)" in repr(found).replace("-8.0", "-7.9")


def test_chance_of_learning_does_not_withdraw_a_claim_about_people_far_beyond():
    rng = np.random.default_rng(2)
    own = np.where(np.arange(60) % 4 == 0, 0.34, 0.0) + 0.02 * rng.standard_normal(60)
    test = equivalence(own, Margin.of_ratio(0.10), noise=MovementNoise(0.02**2, 100.0))
    assert test.verdict == "beyond"
    doubt = learning_doubt(0.02 + 0.05 * rng.standard_normal(60), own + 0.02 * rng.standard_normal(60), test)
    assert doubt.without.verdict == "beyond"


def test_an_impossible_margin_is_named_as_it_was_stated():
    with pytest.raises(PellucidError, match=r"0\.1 to -0\.1, expected a low end below a high one"):
        pl.assess(crossover(), analysis={**ORDERED, "margins": {"duration": (0.1, -0.1)}})


def test_infinite_values_and_words_are_refused():
    table = crossover()
    table["duration"][3] = np.inf
    with pytest.raises(PellucidError, match=r"row 3 \(P0, worn\): found inf"):
        pl.assess(table, analysis=ORDERED)
    with pytest.raises(PellucidError, match="no two arrays of numbers"):
        pl.certify({"duration": (["a", "b"], ["c", "d"])}, {"duration": 0.1})
