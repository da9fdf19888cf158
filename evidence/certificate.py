"""How often does the certificate say "transparent" of a condition that is not, and how often of one that is?

The studies are virtual: participants in two conditions, five amplitudes in two directions, ten movements each, and four
end points (duration, peak velocity, EMG, torque of the robot on the person). Every person has an own level and an own
change between conditions, and movements scatter. What a study says comes from `certificate` on the participants' values
alone. Spreads are those of the virtual people's study (changes of 4 to 12 % between people).

- At the margin: the true change of one end point is its margin and the others' is none, or all are at their margins.
  Changes are normal, heavy-tailed (Student's t with 3 degrees of freedom) or skewed (two lognormals, an exponential).
- The signed-rank test is about the pseudo-median, which is the median of means of two people. In the rows `mean` the
  mean of skewed changes is at the margin instead, with the long tail beyond it. Then the pseudo-median lies within the
  margin, and the test says so more often than its level.
- Where it is true: participants planned for 90 % by `find_equivalence_participants`, then studies drawn another way.
- From a pilot of eight people: the same plan depends on what these eight were like; the rows tell its spread.
- Looks: three, alpha spent after O'Brien and Fleming; a study ends with its first "transparent".
- The rival is what papers do: "no significant difference" taken for none.
- What else acts, and movements in place of participants' values: `_doubted.py`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from benchmarks._size import sized
from scipy.special import log_ndtr

from pellucid._processes import ordered_results
from pellucid.assessment.certificate import PASS, certificate
from pellucid.assessment.equivalence import Margin
from pellucid.assessment.equivalence_power import equivalence_power, find_equivalence_participants
from pellucid.assessment.group_sequential import looks
from pellucid.assessment.signed_rank import signed_rank
from pellucid.studies.results import ResultRow

from . import _doubted

STUDY_COUNT = sized(2000, smallest=8)
"""Number of simulated studies of each case."""

SEED = 20261122
"""Seed of every random draw."""

PILOT_COUNT = sized(60, smallest=2)
"""Number of pilot studies, of eight people each, from which studies are planned."""

PLANNED_STUDY_COUNT = sized(400, smallest=20)
"""Number of simulated studies behind the plan of each pilot, and behind the power found with it."""

PEOPLE_COUNTS = (6, 8, 12, 20)
"""Numbers of participants of the simulated studies."""

MARGIN_SHARES = {"duration": 0.10, "vmax": 0.10, "emg": 0.20, "torque": 0.25}
"""Margin of each end point, as a share of the control condition."""

CHANGE_LOG_SD = {"duration": 0.05, "vmax": 0.05, "emg": 0.10, "torque": 0.12}
"""Standard deviation of people's changes of each end point, in logarithms."""

END_POINT_CORRELATION = 0.3
"""Correlation of a person's changes between two end points."""

CELL_COUNT = 10
"""Number of cells of a study: amplitudes in both directions."""

REPEAT_COUNT = 10
"""Number of movements in each cell."""

MOVEMENT_LOG_SD = 0.12
"""Standard deviation of a person's movements, in logarithms."""

LOOK_SHARES = (0.5, 0.75, 1.0)
"""Shares of the participants after which a sequential study is analysed."""

MARGINS = {name: Margin.of_ratio(share) for name, share in MARGIN_SHARES.items()}
"""Margin of each end point."""


@dataclass(frozen=True)
class Skew:
    """A skewed distribution of people's changes, as a function of a standard normal."""

    words: str
    made: Callable[[np.ndarray], np.ndarray]
    mean: float
    sd: float

    @property
    def pseudo_median(self) -> float:
        """The median of means of two, from a million drawn pairs."""
        drawn = self.made(np.random.default_rng(7).standard_normal((2, 1_000_000)))
        return float(np.median(drawn.mean(axis=0)))


def _lognormal(sigma: float) -> Skew:
    sd = float(np.sqrt((np.exp(sigma**2) - 1.0) * np.exp(sigma**2)))
    return Skew(f"lognormal of sigma {sigma:g}", lambda z: np.exp(sigma * z), float(np.exp(0.5 * sigma**2)), sd)


SKEWED_SHAPES = {
    "skewed": _lognormal(0.6),
    "exponential": Skew("exponential", lambda z: -log_ndtr(-z), 1.0, 1.0),
    "lognormal_1": _lognormal(1.0),
}
"""Skewed distributions of people's changes by name, the least skewed first."""

CENTRES = {name: {"pseudo_median": skew.pseudo_median, "mean": skew.mean} for name, skew in SKEWED_SHAPES.items()}
"""Pseudo-median and mean of each skewed distribution; either can be placed at the margin."""

SYMMETRIC_SHAPES = ("normal", "heavy_tailed")
"""Names of the symmetric distributions of people's changes."""

SHAPES_OF_CHANGES = (*SYMMETRIC_SHAPES, *SKEWED_SHAPES)
"""Names of all distributions of people's changes; their order seeds the draws."""


def rows(studies: int = STUDY_COUNT) -> Iterator[ResultRow]:
    """Every figure."""
    yield from false_rows(studies)
    for n in (5, 6, 8):
        note = f"the rival: signed ranks at 5 % find no difference in any end point, {n} people, one at its margin"
        yield _row(f"certificate.false_transparent.no_difference_found.{n}", 100.0 * rival(n, studies), "%", note)
    yield _row(
        "certificate.false_transparent.three_looks", 100.0 * sequential(studies), "%", "12 people at the end, ranks"
    )
    yield from power_rows(studies)
    for name, share, note in _doubted.rows(ordered_results(_doubted.jobs(studies))):
        yield _row(f"certificate.{name}", 100.0 * share, "%", note)


def false_rows(studies: int) -> Iterator[ResultRow]:
    """How often "transparent" is said at the margin, by shape of people's changes and by what is at the margin."""
    cases = [("pseudo_median", shape, which, n, "signed_rank")
             for n in PEOPLE_COUNTS for shape in SHAPES_OF_CHANGES for which in ("one", "all")]  # fmt: skip
    cases.append(("pseudo_median", "normal", "one", 12, "t"))
    cases += [("mean", shape, which, n, "signed_rank")
              for n in PEOPLE_COUNTS for shape in SKEWED_SHAPES for which in ("one", "all")]  # fmt: skip
    cases += [("mean", shape, "one", 12, "t") for shape in SKEWED_SHAPES]
    jobs = [(false_transparent, shape, which, n, method, studies, centre) for centre, shape, which, n, method in cases]
    found = dict(zip(cases, ordered_results(jobs), strict=True))
    head = "certificate.false_transparent"
    for (centre, shape, which, n, method), share in found.items():
        if which == "one":
            name = ".".join([head, *(["mean"] if centre == "mean" else []), shape, str(n)])
            at = "the mean of one end point at its margin" if centre == "mean" else "one end point at its margin"
            words = SKEWED_SHAPES[shape].words if shape in SKEWED_SHAPES else shape
            note = f"{studies} studies of {n} people, {words}, {at}, {method}"
            yield _row(name + ("" if method == "signed_rank" else f".{method}"), 100.0 * share, "%", note)

    def largest(centre: str, *shapes: str) -> tuple[float, str]:
        own = {case: share for case, share in found.items() if case[0] == centre and case[1] in shapes}
        return 100.0 * max(own.values()), f"the most of {len(own)} kinds of study, {studies} each"

    every = 100.0 * max(found.values()), f"the most of {len(found)} kinds of study, {studies} each"
    people = f"one or all end points at the margin, {PEOPLE_COUNTS[0]} to {PEOPLE_COUNTS[-1]} people"
    for name, (value, note), words in (
        ("", every, f"{people}; symmetric changes, and skewed ones with pseudo-median or mean at the margin"),
        (".symmetric", largest("pseudo_median", *SYMMETRIC_SHAPES), f"{people}; symmetric changes"),
        (".skewed", largest("pseudo_median", *SKEWED_SHAPES),
         f"{people}; pseudo-median of skewed changes at the margin"),
        (".mean", largest("mean", *SKEWED_SHAPES), f"{people}; mean of skewed changes at the margin"),
        *((f".mean.{shape}", largest("mean", shape), f"{people}; mean at the margin, {SKEWED_SHAPES[shape].words}")
          for shape in SKEWED_SHAPES),
    ):  # fmt: skip
        yield _row(head + name, value, "%", f"{note}: {words}")


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(name, float(value), unit, "evidence", "simulated", None, note)


def changes(shape: str, n: int, rng: np.random.Generator, centre: str = "pseudo_median") -> np.ndarray:
    """People's standardised true changes about their `centre`, (n, end points); the long tail of a skew is positive."""
    m = len(MARGIN_SHARES)
    common, own = rng.standard_normal((n, 1)), rng.standard_normal((n, m))
    z = np.sqrt(END_POINT_CORRELATION) * common + np.sqrt(1.0 - END_POINT_CORRELATION) * own
    if shape == "heavy_tailed":  # t with 3 degrees, scaled to a standard deviation of 1
        return z / np.sqrt(rng.chisquare(3, (n, 1)) / 3.0) / np.sqrt(3.0)
    if shape in SKEWED_SHAPES:
        return (SKEWED_SHAPES[shape].made(z) - CENTRES[shape][centre]) / SKEWED_SHAPES[shape].sd
    return z


def participants(
    shape: str, n: int, true: np.ndarray, rng: np.random.Generator, centre: str = "pseudo_median"
) -> np.ndarray:
    """Differences that a study of `n` people sees, (n, end points), of true middle changes `true`.

    A mean at the margin has the long tail beyond it, at the lower margin too: the worse of both ways."""
    outward = np.where(true < 0.0, -1.0, 1.0) if centre == "mean" else 1.0
    people = true + np.array(list(CHANGE_LOG_SD.values())) * outward * changes(shape, n, rng, centre)
    # Means over repeats of each cell, in both conditions, then over cells: the logarithm of a ratio.
    scatter = MOVEMENT_LOG_SD * np.sqrt(2.0 / REPEAT_COUNT) * rng.standard_normal((n, CELL_COUNT, len(true)))
    return people + scatter.mean(axis=1)


def says(seen: np.ndarray, method: str = "signed_rank", alpha: float = 0.05) -> bool:
    """Whether a study says "transparent"."""
    return certificate(dict(zip(MARGINS, seen.T, strict=True)), MARGINS, method=method, alpha=alpha).verdict == PASS


def at_margin(which: str, i: int) -> np.ndarray:
    """True changes of study `i`: one end point after the other at its margin, upwards and downwards, or all."""
    ends = np.array([margin.high for margin in MARGINS.values()])
    if which == "all":
        return ends
    return np.where(np.arange(len(ends)) == i % len(ends), ends * (1 if i // len(ends) % 2 else -1), 0.0)


def false_transparent(
    shape: str, which: str, n: int, method: str, studies: int, centre: str = "pseudo_median"
) -> float:
    """Share of studies that say "transparent" where the `centre` of changes is at the margin."""
    rng = np.random.default_rng(
        [SEED, n, SHAPES_OF_CHANGES.index(shape), which == "all", *([1] if centre == "mean" else [])]
    )
    drawn = (participants(shape, n, at_margin(which, i), rng, centre) for i in range(studies))
    return float(np.mean([says(seen, method) for seen in drawn]))


def rival(n: int, studies: int) -> float:
    """Share of the same studies of `n` people in which no signed-rank test finds a difference."""
    rng = np.random.default_rng([SEED, n, 0, 0])
    drawn = (participants("normal", n, at_margin("one", i), rng) for i in range(studies))
    return float(np.mean([all(signed_rank(each).p_value > 0.05 for each in seen.T) for seen in drawn]))


def sequential(studies: int) -> float:
    """Share that say "transparent" at one of three looks."""
    rng, plan = np.random.default_rng([SEED, 3]), looks(LOOK_SHARES, 0.05)
    said = 0
    for i in range(studies):
        seen = participants("normal", 12, at_margin("one", i), rng)
        said += any(says(seen[: round(12 * s)], alpha=level) for s, level in zip(LOOK_SHARES, plan.level, strict=True))
    return said / studies


def seen_covariance() -> np.ndarray:
    """Of the differences that studies see."""
    spread = np.array(list(CHANGE_LOG_SD.values()))
    own = np.outer(spread, spread) * (END_POINT_CORRELATION + (1.0 - END_POINT_CORRELATION) * np.eye(len(spread)))
    return own + np.eye(len(spread)) * MOVEMENT_LOG_SD**2 * 2.0 / (REPEAT_COUNT * CELL_COUNT)


def realised(n: int, true: tuple[float, ...], studies: int) -> float:
    """Share of studies of `n` people that say "transparent" where changes are `true`."""
    rng = np.random.default_rng([SEED, n, 99])
    return float(np.mean([says(participants("normal", n, np.array(true), rng)) for _ in range(studies)]))


def power_rows(studies: int) -> Iterator[ResultRow]:
    """Planned and found power."""
    margins, covariance = list(MARGINS.values()), seen_covariance()
    worst = 0.0
    for words, true in (("none", np.zeros(4)), ("a_third", np.array([m.high / 3.0 for m in margins]))):
        n = find_equivalence_participants(covariance, margins, change=true, studies=studies)
        planned = equivalence_power(covariance, margins, (n,), change=true, studies=4 * studies).power[0]
        found = realised(n, tuple(true), studies)
        worst = max(worst, abs(found - planned), key=abs)
        yield _row(f"certificate.needed.{words}", n, "1", f"people for 90 %, true changes: {words} of the margins")
        yield _row(f"certificate.power.{words}", 100.0 * found, "%", f"found with {n}, planned {100 * planned:.1f} %")
    yield _row(
        "certificate.power_error", 100.0 * worst, "%", f"found less planned, the larger of two, {studies} studies"
    )
    rng = np.random.default_rng([SEED, 8])
    pilots = [np.cov(participants("normal", 8, np.zeros(4), rng), rowvar=False) for _ in range(PILOT_COUNT)]
    plan = partial(find_equivalence_participants, studies=PLANNED_STUDY_COUNT)
    sizes = [plan(each, margins) or 128 for each in pilots]
    unique = {n: realised(n, (0.0,) * 4, PLANNED_STUDY_COUNT) for n in sorted(set(sizes))}
    found = np.array([unique[n] for n in sizes])
    for quantile in (10, 50, 90):
        value = 100.0 * float(np.quantile(found, quantile / 100.0))
        yield _row(f"certificate.power.from_pilot.q{quantile}", value, "%", "planned for 90 % from a pilot of 8 people")
