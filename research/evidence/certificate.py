"""Rates of "transparent" by the certificate for conditions that are not transparent, and for those that are.

The studies are virtual, drawn and decided by thousands at once with `are_transparent`, whose parts are those that
`pellucid assess` calls; `_certified_files.py` shows on studies made of files that the command line decides alike.

- Cells: people's changes are normal, heavy-tailed (Student's t with 3 degrees of freedom), lognormal with sigma 0.6 and
  1, exponential, or one person in five is slowed and the others are not; 6, 8, 12 and 20 people; the mean of changes is
  at the upper or at the lower margin with the long tail beyond it; with and without stated periods, which have an
  effect of their own and of which one order has two people more. Every cell has people's standard deviation at a third
  of the margin; of "one in five slowed" this is the standard deviation of the others, and the slowed are five margins
  away, so that the mean is at the margin.
- The normal and the lognormal of sigma 1 are also what the test was calibrated with (other seeds); that a cell of these
  holds its level shows no more than that the calculation is right. The other shapes, those under `outside`, and other
  spreads were not used.
- Reference methods are Student's t, the bootstrap-t, and signed ranks, which are about the pseudo-median, in the same
studies.
- Power is compared with a plan that draws from a large pilot of the same people, with all that is active.
- Other causes, and movements instead of participants' values: `_doubted.py`; losses and corrections backwards:
  `_lost_and_corrected.py`; studies by a generator that knows nothing of the analysis: `_challenge.py`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from pellucid.people.certificate import CANNOT_SAY, ESTIMAND_METHODS, Estimand, certificate
from pellucid.people.comparison import signed_rank
from pellucid.people.equivalence import Margin, Method
from pellucid.people.movement_indices import SimulatedStudies, are_transparent
from pellucid.people.power import Active, equivalence_power, find_equivalence_participants
from pellucid.people.session_periods import SessionPeriods
from pellucid.people.share_of_people import HIDDEN_SHARE, MIN_PEOPLE
from pellucid.people.survival import looks
from pellucid.study.results import ResultRow
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

from . import _certified_files, _challenge, _designs, _doubted, _lost_and_corrected

STUDY_COUNT = sized(20_000, smallest=40)
"""Number of simulated studies of each cell."""

DOUBTED_STUDY_COUNT = sized(400, smallest=8)
"""Number of simulated studies, one by one, of each case of `_doubted`."""

RIVAL_STUDY_COUNT = sized(2000, smallest=20)
"""Number of simulated studies of each cell of a reference method that resamples."""

PILOT_COUNT = sized(60, smallest=2)
"""Number of pilot studies, of twelve people each, from which studies are planned."""

SEED = 20261126
"""Seed of every random draw."""

PEOPLE_COUNTS = (6, 8, 12, 20)
"""Numbers of participants of the simulated studies."""

MARGIN = Margin.of_ratio(0.10)
"""Margin of the cells: 10 % of the control condition."""

SPREAD_SHARE = 1.0 / 3.0
"""Standard deviation of people's changes in the cells, as a share of the margin."""

OTHER_SPREAD_SHARES = (0.1, 1.0 / 6.0, 0.5, 1.0)
"""Further standard deviations of people's changes, as shares of the margin."""

SLOWED_SHARE = 0.2
"""Share of people who are slowed in the cells "one in five slowed"."""

PERIOD_SHARE = -0.2
"""Effect of a period in the cells with periods, as a share of the margin: it hides a part of the change."""

PILOT_PEOPLE = 20_000
"""Number of people of the large pilot from which power is planned in each cell."""

MOVEMENTS = 60
"""Number of movements of a person and condition, in which learning is looked for."""

MOVEMENT_LOG_SD = 0.12
"""Standard deviation of a person's movements, in logarithms."""

LOOK_SHARES = (0.6, 0.8, 1.0)
"""Shares of twenty participants after which a sequential study is analysed."""

SLOWED_BY = float(np.log(1.6))
"""Change of the one slowed person, who takes 60 % longer."""


@dataclass(frozen=True)
class Shape:
    """A distribution of people's changes about a mean of 0 with a long tail upwards, if it has one."""

    words: str
    draw: Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]
    by_others: bool = False  # whether the spread is that of the people who are not slowed


def _lognormal(sigma: float) -> Shape:
    mean = float(np.exp(0.5 * sigma**2))
    sd = mean * float(np.sqrt(np.exp(sigma**2) - 1.0))
    return Shape(f"lognormal of sigma {sigma:g}", lambda rng, n: (np.exp(sigma * rng.standard_normal(n)) - mean) / sd)


def _gamma(k: float) -> Shape:
    return Shape(f"gamma of shape {k:g}", lambda rng, n: (rng.gamma(k, size=n) - k) / np.sqrt(k))


def _slowed(share: float, distance: float) -> Shape:
    """Return people of whom a `share` is slowed by a `distance` in standard deviations of the others."""
    return Shape(
        f"a share of {share:g} slowed by {distance:g} standard deviations of the others",
        lambda rng, n: rng.standard_normal(n) + distance * ((rng.uniform(size=n) < share) - share),
        by_others=True,
    )


SHAPES = {
    "normal": Shape("normal", lambda rng, n: rng.standard_normal(n)),
    "heavy_tailed": Shape("t with 3 degrees of freedom", lambda rng, n: rng.standard_t(3, n) / np.sqrt(3.0)),
    "lognormal_06": _lognormal(0.6),
    "lognormal_1": _lognormal(1.0),
    "exponential": Shape("exponential", lambda rng, n: -log_ndtr(-rng.standard_normal(n)) - 1.0),
    "one_in_five_slowed": _slowed(SLOWED_SHARE, 1.0 / SLOWED_SHARE / SPREAD_SHARE),
}
"""Distributions of people's changes in the cells."""

OUTSIDE_SHAPES = {
    "gamma_05": _gamma(0.5),
    "lognormal_12": _lognormal(1.2),
    "one_in_three_slowed": _slowed(1.0 / 3.0, 9.0),
    "one_in_ten_slowed": _slowed(0.1, 30.0),
}
"""Distributions with which nothing was calibrated; the last two exceed what the test promises."""


def rows(studies: int = STUDY_COUNT) -> Iterator[ResultRow]:
    """Every figure."""
    yield from cell_rows(studies)
    yield from spread_rows(studies)
    yield from rival_rows(studies)
    yield from one_slowed_rows()
    yield from power_rows(studies)
    yield from pilot_rows(studies)
    yield from pseudo_median_rows(studies)
    share = sequential(studies)
    yield _row("certificate.false_transparent.three_looks", 100.0 * share, "%", "looks at 12, 16, 20; lognormal_1")
    yield from _designs.rows(studies)
    yield from (
        _row(f"certificate.{name}", value, unit, note)
        for part in (
            _certified_files.rows(), _certified_files.door_rows(), _lost_and_corrected.rows(studies), _challenge.rows()
        )
        for name, value, unit, note in part
    )  # fmt: skip
    for name, share, note in _doubted.rows(ordered_results(_doubted.jobs(DOUBTED_STUDY_COUNT))):
        yield _row(f"certificate.{name}", 100.0 * share, "%", note)


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(name, float(value), unit, "evidence", "simulated", None, note)


def draw_studies(
    shape: Shape, n: int, studies: int, *, side: str = "upper", periods: bool = False, at: float = 1.0,
    spread: float = SPREAD_SHARE, seed: int = 0,
) -> SimulatedStudies:  # fmt: skip
    """Draw studies of `n` people whose mean change is `at` times the margin, with the long tail beyond it."""
    rng = np.random.default_rng([SEED, seed, n, side == "upper", periods, round(1e3 * at), round(1e3 * spread)])
    changes = MARGIN.high * (at + spread * shape.draw(rng, (studies, n)))
    sessions = None
    if periods:
        later = np.where(np.arange(n) < n // 2 + 1, 1.0, -1.0)
        changes = changes + PERIOD_SHARE * MARGIN.high * later
        sessions = SessionPeriods.of_two(later)
    sign = 1.0 if side == "upper" else -1.0
    return SimulatedStudies(sign * changes[:, :, None], sessions)


def false_share(shape: Shape, n: int, studies: int, *, method: Method | None = None, **drawn) -> float:
    """Return the share of studies that are certified although their mean is at the margin."""
    own: Method = "skew_robust" if method is None else method
    return float(np.mean(are_transparent(draw_studies(shape, n, studies, **drawn), [MARGIN], method=own)))


def cell_rows(studies: int) -> Iterator[ResultRow]:
    """Rate of false claims in each of the 96 cells, and its largest value."""
    found: dict[str, float] = {}
    silent = 0
    for name, shape in SHAPES.items():
        for n in PEOPLE_COUNTS:
            for side in ("upper", "lower"):
                for periods in (False, True):
                    cell = f"{name}.{n}.{side}" + (".periods" if periods else "")
                    found[cell] = 100.0 * false_share(shape, n, studies, side=side, periods=periods)
                    note = f"{studies} studies, {shape.words}, mean at the {side} margin"
                    if n < MIN_PEOPLE:
                        silent += 1
                        hidden = 100.0 * (1.0 - HIDDEN_SHARE) ** n
                        note = f"cannot say: a fifth of people is missing from {hidden:.0f} % of studies, in any test"
                    yield _row(f"certificate.false_transparent.{cell}", found[cell], "%", note)
    worst = max(found, key=lambda cell: found[cell])
    yield _row("certificate.cells", len(found), "1", f"{studies} studies each; {silent} of them cannot say")
    yield _row("certificate.false_transparent.worst_cell", found[worst], "%", f"of {len(found)} cells: {worst}")


def spread_rows(studies: int) -> Iterator[ResultRow]:
    """Rate of false claims with other spreads and with shapes beyond those of the cells, the worst of several."""
    for name, shape in SHAPES.items():
        if not shape.by_others:
            values = {(n, s): 100.0 * false_share(shape, n, studies, spread=s)
                      for n in (12, 20) for s in OTHER_SPREAD_SHARES}  # fmt: skip
            at = max(values, key=lambda case: values[case])
            note = f"the worst of {len(values)}: {at[0]} people, standard deviation {at[1]:.2g} of the margin"
            yield _row(f"certificate.false_transparent.other_spreads.{name}", values[at], "%", note)
    for n in (12, 13, 14, 20):
        own = _slowed(SLOWED_SHARE, 50.0)
        value = 100.0 * false_share(own, n, studies, spread=0.1)
        note = f"{n} people who are alike but for the slowed: {100.0 * 0.8**n:.1f} % of studies see none of them"
        yield _row(f"certificate.false_transparent.one_in_five_slowed.others_alike.{n}", value, "%", note)
    for name, shape in OUTSIDE_SHAPES.items():
        for n in (12, 20):
            spread = 1.0 / 3.0
            value = 100.0 * false_share(shape, n, studies, spread=spread)
            yield _row(f"certificate.false_transparent.outside.{name}.{n}", value, "%", f"{n} people, {shape.words}")


def rival_rows(studies: int) -> Iterator[ResultRow]:
    """Rate of false claims of other tests in the same studies, and of "no significant difference"."""
    for name in ("lognormal_1", "exponential", "one_in_five_slowed"):
        for n in PEOPLE_COUNTS:
            words = f"reference method, {n} people, {SHAPES[name].words}, mean at the margin"
            for method in ("t", "signed_rank"):
                value = 100.0 * false_share(SHAPES[name], n, studies, method=method)
                yield _row(f"certificate.rival.{method}.{name}.{n}", value, "%", words)
            drawn = draw_studies(SHAPES[name], n, RIVAL_STUDY_COUNT).changes[:, :, 0]
            value = 100.0 * float(np.mean(_bootstrap_t_within(drawn)))
            yield _row(f"certificate.rival.bootstrap_t.{name}.{n}", value, "%", words)
    for n in (6, 12):
        drawn = draw_studies(SHAPES["normal"], n, RIVAL_STUDY_COUNT, spread=0.52).changes[:, :, 0]
        value = 100.0 * float(np.mean([signed_rank(each).p_value > 0.05 for each in drawn]))
        words = f"reference method: signed ranks at 5 % find no difference, {n} people, their mean at the margin"
        yield _row(f"certificate.rival.no_difference_found.{n}", value, "%", words)


def _bootstrap_t_within(differences: np.ndarray, resamples: int = 499) -> np.ndarray:
    """Return whether bootstrap-t intervals of confidence 90 % lie within the margin; (k, n) differences, (k,) bool."""
    rng, n = np.random.default_rng([SEED, 11]), differences.shape[1]
    said = []
    for d in differences:
        drawn = d[rng.integers(n, size=(resamples, n))]
        error = drawn.std(axis=1, ddof=1) / np.sqrt(n)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(error > 0.0, (drawn.mean(axis=1) - d.mean()) / error, 0.0)
        low, high = np.quantile(t, (0.05, 0.95))
        own = d.std(ddof=1) / np.sqrt(n)
        said.append(d.mean() - high * own >= MARGIN.low and d.mean() - low * own <= MARGIN.high)
    return np.array(said)


def one_slowed_rows(studies: int = sized(200, smallest=5)) -> Iterator[ResultRow]:
    """How many studies are certified in which one person is slowed by 60 % and nobody else is."""
    rng, said, of = np.random.default_rng([SEED, 21]), 0, 0
    for n in (12, 20, 30):
        for _ in range(studies):
            seen = np.append(0.01 * rng.standard_normal(n - 1), SLOWED_BY)
            for estimand in ESTIMAND_METHODS:
                people = 0.5 if estimand == "mean and people" else None
                found = certificate({"d": seen}, {"d": MARGIN}, estimand=estimand, people=people)
                said, of = said + (found.verdict != CANNOT_SAY), of + 1
    note = f"of {of} certificates of 12 to 30 people, every estimand"
    yield _row("certificate.one_slowed_person.certified", said, "1", note)


def power_rows(studies: int) -> Iterator[ResultRow]:
    """Power where nothing changes or a third of the margin, against plans with all that is active."""
    value = 100.0 * float(np.mean(are_transparent(draw_studies(SHAPES["normal"], 12, studies, at=0.0), [MARGIN])))
    yield _row("certificate.normal_12.certified", value, "%", "12 normal people without change, sd a third of margin")
    worst, at = 0.0, ""
    for name, shape in SHAPES.items():
        pilot = MARGIN.high * SPREAD_SHARE * shape.draw(np.random.default_rng([SEED, 31]), (PILOT_PEOPLE, 1))
        for n in PEOPLE_COUNTS:
            for change in (0.0, 1.0 / 3.0):
                for active in (Active(), Active(order=True, learning=True)):
                    options = {"change": [change * MARGIN.high], "pilot": pilot, "active": active}
                    planned = equivalence_power(np.eye(1), [MARGIN], (n,), studies=studies, **options).power[0]
                    found = _realised(shape, n, change, active, studies)
                    if abs(found - planned) > abs(worst):
                        worst, at = found - planned, f"{name}, {n} people, true change {change:.2g} of the margin"
                    if n >= MIN_PEOPLE and change == 0.0:
                        what = "everything_active" if active.order else "test_alone"
                        yield _row(f"certificate.power.{name}.{n}.{what}", 100.0 * found, "%",
                                   f"planned {100.0 * planned:.1f} %, no true change")  # fmt: skip
    note = f"found less planned, the largest of {len(SHAPES) * len(PEOPLE_COUNTS) * 4}, absolute value: {at}"
    yield _row("certificate.power_error.worst_cell", 100.0 * abs(worst), "%", note)


def _realised(shape: Shape, n: int, change: float, active: Active, studies: int) -> float:
    """Return the share certified of studies drawn with movements, levels and orders of their own."""
    drawn = draw_studies(shape, n, studies, at=change, seed=7)
    if active.order:
        rng = np.random.default_rng([SEED, 8, n])
        d = drawn.changes
        parts = MOVEMENT_LOG_SD * np.sqrt(2.0 * 3.0 / MOVEMENTS) * rng.standard_normal((3, *d.shape))
        later = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
        d = d + MARGIN.high * later[:, None]  # a period has an effect of one margin, which no plan knows
        sessions = SessionPeriods.of_two(later)
        drawn = SimulatedStudies(d, sessions, parts[2] - parts[0], parts[2] - parts.mean(axis=0))
    return float(np.mean(are_transparent(drawn, [MARGIN], method=ESTIMAND_METHODS[active.estimand])))


def pilot_rows(studies: int) -> Iterator[ResultRow]:
    """Power of studies planned for 90 % from a pilot of twelve people: normal, and of skewed people their own."""
    for name, own in (("normal", False), ("lognormal_1", True)):
        rng, shape, found = np.random.default_rng([SEED, 41]), SHAPES[name], []
        for _ in range(PILOT_COUNT):
            pilot = MARGIN.high * SPREAD_SHARE * shape.draw(rng, (12, 1))
            options = {"pilot": pilot} if own else {}
            covariance = np.atleast_2d(np.cov(pilot.T))
            n = find_equivalence_participants(covariance, [MARGIN], studies=400, **options) or 128
            found.append(_realised(shape, n, 0.0, Active(), sized(2000, smallest=40)))
        for quantile in (10, 50, 90):
            value = 100.0 * float(np.quantile(found, quantile / 100.0))
            words = f"planned for 90 % from a pilot of 12 {shape.words} people"
            yield _row(f"certificate.power.from_pilot.{name}.q{quantile}", value, "%", words)


def pseudo_median_rows(studies: int) -> Iterator[ResultRow]:
    """Rate of false claims about the pseudo-median where it is at the margin."""
    estimand: Estimand = "pseudo-median"
    worst = 0.0
    for name in ("normal", "heavy_tailed", "lognormal_06", "lognormal_1"):
        pairs = SHAPES[name].draw(np.random.default_rng(7), (2, 1_000_000)).mean(axis=0)
        middle = SPREAD_SHARE * float(np.median(pairs))
        for n in PEOPLE_COUNTS:
            drawn = draw_studies(SHAPES[name], n, studies, at=1.0 - middle)
            value = 100.0 * float(np.mean(are_transparent(drawn, [MARGIN], method=ESTIMAND_METHODS[estimand])))
            worst = max(worst, value) if name in ("normal", "heavy_tailed") else worst
            yield _row(f"certificate.false_transparent.pseudo_median.{name}.{n}", value, "%", SHAPES[name].words)
    yield _row("certificate.false_transparent.pseudo_median.symmetric", worst, "%", "the worst of symmetric shapes")


def sequential(studies: int) -> float:
    """Return the share of studies that are certified at one of three looks although their mean is at the margin."""
    drawn, plan = draw_studies(SHAPES["lognormal_1"], 20, studies), looks(LOOK_SHARES, 0.05)
    said = np.zeros(studies, bool)
    for share, level in zip(LOOK_SHARES, plan.level, strict=True):
        seen = SimulatedStudies(drawn.changes[:, : round(20 * share)])
        said |= are_transparent(seen, [MARGIN], alpha=level)
    return float(said.mean())
