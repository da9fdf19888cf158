"""Noise of single movements is no difference between people."""

import re

import numpy as np
import pytest
from scipy import stats

import pellucid as pl
from pellucid.people.margin import Margin
from pellucid.people.movement_noise import MovementNoise, movement_noise
from pellucid.people.session_periods import adjustment
from pellucid.people.share_of_people import share_p_values, share_test

MARGIN = Margin(-1.0, 1.0)


def study(rng, *, people, each, of_people, of_movement, trend=0.0):
    """Return keys and values of movements in two conditions and four cells, with a gamma-shaped noise of each."""
    keys, values = [], []
    for p in range(people):
        effect = of_people * rng.standard_normal()
        for k in range(each):
            for cell in rng.permutation(4):
                for condition in ("free", "worn"):
                    noise = of_movement * (rng.gamma(4.0) - 4.0) / 2.0
                    keys.append((f"p{p}", condition, int(cell)))
                    values.append(3.0 * cell + effect * (condition == "worn") + noise + trend * k / each)
    return keys, np.array(values)


def change_by(keys, values):
    """Return people's changes by the movements of chosen rows: means of cells, then over cells."""

    def change_of(rows):
        cells = {}
        for i in rows:
            cells.setdefault(keys[i], []).append(values[i])
        made = {}
        for person in {k[0] for k in cells}:
            shared = {c for q, s, c in cells if q == person and s == "free"} & {
                c for q, s, c in cells if q == person and s == "worn"
            }
            made[person] = np.mean([np.mean(cells[person, "worn", c]) - np.mean(cells[person, "free", c])
                                    for c in sorted(shared)])  # fmt: skip
        return made

    return change_of


@pytest.mark.parametrize(("each", "trend"), [(2, 0.0), (5, 0.0), (8, 0.0), (5, 3.0)])
def test_variance_is_that_of_repeated_studies(each, trend):
    rng = np.random.default_rng(7)
    found = []
    for _ in range(40):
        keys, values = study(rng, people=14, each=each, of_people=2.0, of_movement=1.0, trend=trend)
        people = [f"p{p}" for p in range(14)]
        found.append(movement_noise(keys, people, ("free", "worn"), change_by(keys, values)))
    expected = 2.0 / (4 * each)  # two conditions, four cells
    mean = np.mean([one.variance for one in found])
    assert mean == pytest.approx(expected, rel=0.12)
    assert np.mean([one.degrees for one in found]) > 10.0
    # The stated degrees of freedom describe how estimates scatter.
    scatter = np.var([one.variance for one in found], ddof=1) / mean**2
    assert scatter < 3.0 * 2.0 / np.mean([one.degrees for one in found])


def test_a_cell_that_lost_movements_is_left_out_of_parts():
    keys, values = study(np.random.default_rng(3), people=12, each=5, of_people=0.0, of_movement=1.0)
    kept = [i for i, (person, _, cell) in enumerate(keys) if cell or person != "p0" or i < 5]
    some, own = [keys[i] for i in kept], values[kept]
    people = [f"p{p}" for p in range(12)]
    found = movement_noise(some, people, ("free", "worn"), change_by(some, own))
    assert found is not None
    assert found.variance == pytest.approx(2.0 / 20.0, rel=0.5)


def test_single_movements_tell_no_noise():
    keys, values = study(np.random.default_rng(3), people=12, each=1, of_people=0.0, of_movement=1.0)
    assert movement_noise(keys, [f"p{p}" for p in range(12)], ("free", "worn"), change_by(keys, values)) is None


def certified(rng, n, of_people, of_noise, mean=0.0, studies=600):
    """Return the share of studies whose share of people within is shown, without and with the noise known."""
    d = mean + of_people * rng.standard_normal((studies, n)) + of_noise * rng.standard_normal((studies, n))
    degrees = 2.0 * n
    estimate = of_noise**2 * rng.chisquare(degrees, studies) / degrees
    fit = adjustment(n, None)
    without = share_p_values(d, d, MARGIN, fit)[0] <= 0.1
    known = share_p_values(d, d, MARGIN, fit, noise=MovementNoise(estimate, degrees))[0] <= 0.1
    return float(np.mean(without)), float(np.mean(known))


@pytest.mark.parametrize("n", [12, 24])
@pytest.mark.parametrize(("mean", "of_noise"), [(0.0, 0.3), (0.0, 0.7), (0.5, 0.5)])
def test_level_holds_where_a_quarter_of_people_lies_beyond(n, mean, of_noise):
    # A quarter of normal people lies beyond +-1.
    low, high = 0.1, 2.0
    for _ in range(60):
        of_people = 0.5 * (low + high)
        beyond = stats.norm.sf((1.0 - mean) / of_people) + stats.norm.cdf((-1.0 - mean) / of_people)
        low, high = (of_people, high) if beyond < 0.25 else (low, of_people)
    _, shown = certified(np.random.default_rng(11), n, of_people, of_noise, mean)
    assert shown < 0.1 + 3.0 * np.sqrt(0.09 / 600)


def test_noise_of_movements_costs_less_power_than_counting_it_as_people():
    without, known = certified(np.random.default_rng(5), 16, 0.35, 0.7)
    assert without < 0.35
    assert known > without + 0.2


@pytest.mark.parametrize("n", [20, 80])
def test_bound_and_p_value_agree(n):
    rng = np.random.default_rng(2)
    for k in range(12):
        d = (0.3 + 0.05 * k) * rng.standard_normal(n) + 0.5 * rng.standard_normal(n)
        found = share_test(d, d, MARGIN, adjustment(n, None), noise=MovementNoise(0.25, 2.0 * n))
        assert (found.least_within >= found.rule.within) == (found.p_within <= found.rule.alpha)


def table_of(rng, *, people, each, of_people, of_movement):
    keys, values = study(rng, people=people, each=each, of_people=of_people, of_movement=of_movement)
    return {
        "participant": [k[0] for k in keys], "condition": [k[1] for k in keys], "target": [f"t{k[2]}" for k in keys],
        "duration": list(np.exp(0.1 * np.array(values))),
    }  # fmt: skip


def test_table_of_noisy_movements_is_certified_and_says_so():
    table = table_of(np.random.default_rng(8), people=24, each=5, of_people=0.2, of_movement=2.2)
    found = pl.assess(table, control="free", margins={"duration": 0.1}).certificates["worn"]
    shares = found.share_test("duration")
    assert found.verdict == "transparent"
    assert 0.6 < shares.noise_share <= 1.0
    assert "noise of single movements" in shares.noise_note
    means = {
        key: [np.mean([v for p, c, v in zip(table["participant"], table["condition"], table["duration"], strict=True)
                       if (p, c) == (f"p{k}", key)]) for k in range(24)]
        for key in ("free", "worn")
    }  # fmt: skip
    assert pl.certify({"duration": (means["free"], means["worn"])}, {"duration": 0.1}).verdict == "cannot say"


def test_people_who_differ_are_not_taken_for_noise():
    table = table_of(np.random.default_rng(4), people=24, each=5, of_people=1.1, of_movement=1.0)
    found = pl.assess(table, control="free", margins={"duration": 0.1}).certificates["worn"]
    assert found.verdict == "cannot say"
    assert found.share_test("duration").noise_share < 0.4


def test_plan_knows_the_noise_of_movements():
    stated = {"margins": {"duration": "10 %"}}
    plain, told = (pl.plan(stated, people=20, sd="7.5 %", noise_share=share, studies=400) for share in (0.0, 0.7))
    assert told > plain + 0.2
    with pytest.raises(pl.PellucidError, match="noise_share"):
        pl.plan(stated, people=20, sd="5 %", noise_share=1.2)


def test_a_margin_in_percent_is_no_share():
    free = np.linspace(0.9, 1.1, 16)
    with pytest.raises(pl.PellucidError, match=r'such as 0\.1 or "10 %"'):
        pl.certify({"duration": (free, 2.0 * free)}, {"duration": 10})


def test_the_interval_that_is_told_is_the_one_that_decides():
    """With a carry-over the test's interval is wider; the sentence said that the narrow one reached past the margin."""
    rng = np.random.default_rng(3)
    change = 0.055 + 0.03 * rng.standard_normal(16)
    people = [f"p{k}" for k in range(16)]
    table = {
        "participant": people * 2, "condition": ["free"] * 16 + ["worn"] * 16,
        "period": [1 + k % 2 for k in range(16)] + [2 - k % 2 for k in range(16)],
        "duration": [*np.ones(16), *np.exp(change)],
    }  # fmt: skip
    stated = {"control": "free", "design": "AB/BA", "period": "period", "margins": {"duration": "10 %"},
              "largest_carry_over": 0.5}  # fmt: skip
    said = str(pl.assess(table, analysis=stated))
    ends = [float(x) for x in re.search(r"margins, ([-+][\d.]+) to ([-+][\d.]+) %, extends", said).groups()]
    assert ends[0] <= -9.1 or ends[1] >= 10.0
