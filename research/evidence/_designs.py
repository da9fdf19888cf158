"""Simulated studies of ordered sessions and of people who differ: false "transparent", and power.

- Periods: AB/BA in balance, the second session differs by up to two margins, the mean of changes is at the margin.
- Unbalanced orders: 12 of 14 people have control first, with the same periods.
- Carry-over: the effect of a session with the robot on the next one hides the change, by the largest declared amount.
- Shares: people's changes have mean 0 and a standard deviation of one margin, so that a third of them lie beyond it.
- Power: normal people without change, of 12 to 400; steps of two people; with and without a period's effect.

Each study is decided by `are_transparent`, whose parts are those of `certificate`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import stats

from pellucid.people.equivalence import DEFAULT_CARRY_OVER, Margin
from pellucid.people.movement_indices import SimulatedStudies, are_transparent
from pellucid.people.movement_noise import MovementNoise
from pellucid.people.session_periods import SessionPeriods
from pellucid.study.results import ResultRow

SEED = 20261129
"""Seed of every random draw."""

MARGIN = Margin.of_ratio(0.10)
"""Margin of the simulated studies: 10 % of the control condition."""

PERIOD_SHARES = (-2.0, -1.0, 0.0, 1.0, 2.0)
"""Effects of one more period, as shares of the margin."""

NOISE_STUDY_COUNT = 4000
"""Largest number of studies of a cell with noise of movements, each of which draws pivots."""

SHARED_PEOPLE = (12, 13, 14, 16, 18, 20, 24, 30, 40, 58, 59, 60, 80, 120, 250, 400)
"""Numbers of participants of the simulated studies of shares."""

STEP_PEOPLE = (*range(12, 34), 40, 42, 57, 58, 59, 60, 61, 62)
"""Numbers of participants of which the steps in power are computed."""

STEP_SPREADS = (0.1, 1.0 / 3.0, 0.5)
"""Standard deviations of people's changes, as shares of the margin, of which the steps in power are computed."""


def _shapes() -> dict:
    def lognormal(sigma: float):
        mean = float(np.exp(0.5 * sigma**2))
        sd = mean * float(np.sqrt(np.exp(sigma**2) - 1.0))
        return lambda rng, size: (np.exp(sigma * rng.standard_normal(size)) - mean) / sd

    return {
        "normal": lambda rng, size: rng.standard_normal(size),
        "heavy_tailed": lambda rng, size: rng.standard_t(3, size) / np.sqrt(3.0),
        "lognormal_06": lognormal(0.6),
        "lognormal_1": lognormal(1.0),
        "exponential": lambda rng, size: rng.exponential(size=size) - 1.0,
    }


SHAPES = _shapes()
"""Distributions of people's changes about 0 with a standard deviation of 1 and the long tail upwards, if any."""


def orders(people: int, control_first: int) -> np.ndarray:
    """Return by how many periods the robot came after control, (n,): 1 for those who had control first."""
    return np.where(np.arange(people) < control_first, 1.0, -1.0)


def transparent_share(
    people: int, studies: int, *, at: float, spread: float, shape: str = "normal", later: np.ndarray | None = None,
    period: float = 0.0, carry_over: float = 0.0, largest_carry_over: float = DEFAULT_CARRY_OVER,
) -> float:  # fmt: skip
    """Return the share of studies that are certified, in %.

    `at`, `spread`, `period` and `carry_over` are shares of the margin: the mean change, people's standard deviation,
    the effect of one more period, and what a session with the robot leaves for the next one.
    """
    key = [SEED, people, list(SHAPES).index(shape), *(round(1e3 * (x + 9.0)) for x in (at, spread, period, carry_over))]
    changes = MARGIN.high * (at + spread * SHAPES[shape](np.random.default_rng(key), (studies, people)))
    sessions = None
    if later is not None:
        # Control measured after the robot is raised by the carry-over, which lowers the change.
        changes = changes + MARGIN.high * (period * later - carry_over * (later < 0.0))
        sessions = SessionPeriods.of_two(later)
    drawn = SimulatedStudies(changes[:, :, None], sessions)
    return 100.0 * float(np.mean(are_transparent(drawn, [MARGIN], largest_carry_over=largest_carry_over)))


def rows(studies: int) -> Iterator[ResultRow]:
    """Every figure."""

    def row(name: str, value: float, unit: str, note: str) -> ResultRow:
        return ResultRow(f"certificate.{name}", float(value), unit, "evidence", "simulated", None, note)

    yield row("studies_per_cell", studies, "1", "simulated studies of each cell")
    for name, cells in _false_cells(studies).items():
        value, words = max(cells)
        yield row(f"{name}.false_transparent", value, "%", f"the worst of {len(cells)} cells: {words}")
    shared = [(transparent_share(n, studies, at=0.0, spread=1.0), f"{n} people") for n in SHARED_PEOPLE]
    note = f"a third of people beyond the margin, the worst of {len(shared)} numbers of people: {max(shared)[1]}"
    yield row("share.false_transparent", max(shared)[0], "%", note)
    yield from (row(*each) for each in _noise_rows(min(studies, NOISE_STUDY_COUNT)))
    for words, spread in (("power", 1.0 / 3.0), ("power.half", 0.5)):
        for n in (12, 20, 60, 400):
            value = transparent_share(n, studies, at=0.0, spread=spread)
            yield row(f"{words}.n{n}", value, "%", f"{n} normal people, no change, sd {spread:.2g} of the margin")
    lost = []
    for n in (12, 20, 60):
        for spread in (1.0 / 3.0, 0.5):
            plain, moved = (
                transparent_share(n, studies, at=0.0, spread=spread, later=orders(n, n // 2), period=period)
                for period in (0.0, 1.5)
            )
            lost.append((plain - moved, f"{n} people, sd {spread:.2g} of the margin: {plain:.1f} and {moved:.1f} %"))
    note = f"by a period's effect of 1.5 margins, the largest: {max(lost)[1]}"
    yield row("power.period_loss", max(lost)[0], "%", note)
    steps = []
    for spread in STEP_SPREADS:
        found = {n: transparent_share(n, studies, at=0.0, spread=spread) for n in STEP_PEOPLE}
        steps += [(abs(found[n + 2] - found[n]), f"{n} to {n + 2} people, sd {spread:.2g}")
                  for n in found if n + 2 in found]  # fmt: skip
    yield row("power.largest_step", max(steps)[0], "%", f"of {len(steps)} steps of two people: {max(steps)[1]}")


def _noisy_share(people: int, studies: int, of_people: float, noise: float, *, group: float = 0.0, told: bool = True):
    """Return the share of studies that are certified, in %, where movements add noise to people's changes.

    `of_people` and `noise` are standard deviations over the margin. A share `group` of the people is slowed by a little
    more than the margin, and the others by nothing. The noise is estimated in each study from its movements, if `told`.
    """
    rng = np.random.default_rng([SEED, people, *(round(1e3 * x) for x in (of_people, noise, group))])
    size, degrees = MARGIN.high, 2.0 * people
    changes = of_people * rng.standard_normal((studies, people)) + 1.1 * (rng.uniform(size=(studies, people)) < group)
    seen = size * (changes + noise * rng.standard_normal((studies, people)))
    estimate = (size * noise) ** 2 * rng.chisquare(degrees, studies) / degrees
    known = (MovementNoise(estimate, degrees),) if told else ()
    return 100.0 * float(np.mean(are_transparent(SimulatedStudies(seen[:, :, None], noise=known), [MARGIN])))


def _noise_rows(studies: int) -> Iterator[tuple[str, float, str, str]]:
    """Return what happens where people's changes are known by few movements only."""
    limit = float(1.0 / stats.norm.isf(0.125))
    sizes = [(n, noise) for n in (12, 16, 24) for noise in (0.3, 0.5, 0.7)]
    for name, of_people, group, words in (
        ("share.noise.false_transparent", limit, 0.0, "a quarter of normal people lie beyond"),
        ("share.noise.far_from_normal", 0.05, 0.3, "30 % of people lie at 1.1 margins and 70 % at 0, the worst for it"),
    ):
        value, n, noise = max((_noisy_share(n, studies, of_people, s, group=group), n, s) for n, s in sizes)
        plain = max(_noisy_share(n, studies, of_people, s, group=group, told=False) for n, s in sizes)
        where = f"the worst of {len(sizes)} cells: {n} people, noise {noise:g} of the margin"
        yield name, value, "%", f"{words}; {where}; noise counted as people: {plain:.1f} %"
    for n in (16, 24):
        plain, own = (_noisy_share(n, studies, 1.0 / 3.0, 0.5, told=told) for told in (False, True))
        yield f"power.noise.n{n}", own, "%", f"sd 0.33, noise 0.5 of the margin; noise counted as people: {plain:.1f} %"


def _false_cells(studies: int) -> dict[str, list[tuple[float, str]]]:
    """Return the rates of false claims of ordered sessions, with the words of their cells, by row."""
    cells: dict[str, list[tuple[float, str]]] = {"period": [], "unbalanced": [], "carry_over_declared": []}
    for shape in SHAPES:
        for side in (1.0, -1.0):
            for period in PERIOD_SHARES:
                # Without an allowance for a carry-over, which would hide errors of the period's estimate.
                own = {"spread": side / 3.0, "at": side, "shape": shape, "period": period, "largest_carry_over": 0.0}
                for n in (12, 20):
                    value = transparent_share(n, studies, later=orders(n, n // 2), **own)
                    words = f"{shape}, {n} people, period {period:g}, mean at {side:g} margins"
                    cells["period"].append((value, words))
                value = transparent_share(14, studies, later=orders(14, 12), **own)
                cells["unbalanced"].append((value, f"{shape}, 12 of 14, period {period:g}, mean at {side:g} margins"))
            for n in (14, 20, 30):
                own = {"spread": side / 3.0, "at": side, "shape": shape}
                value = transparent_share(
                    n, studies, later=orders(n, n // 2), carry_over=side * DEFAULT_CARRY_OVER, **own
                )
                cells["carry_over_declared"].append((value, f"{shape}, {n} people, mean at {side:g} margins"))
    return cells
