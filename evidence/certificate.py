"""Does "transparent" mean it? How often it is said at the margin, and how often as planned where it is true.

Virtual studies: participants in two conditions, five amplitudes in two directions, ten movements each, four end points
(duration, peak velocity, EMG and torque of the robot on the person) with a person's own level, a person's own change
between conditions, and the scatter of movements; what a study says comes from `certificate` on the participants' values
alone. Spreads are those of the virtual people's study (changes of 4 to 12 % between people).

- At the margin: one end point's true change is its margin and the others' is none, or all are at theirs. Changes are
  normal, heavy-tailed (Student's t with 3 degrees), or skewed; the margin is that of their middle (pseudo-median).
- Where it is true: participants planned for 90 % by `equivalence_needed`, then 2,000 studies drawn another way.
- From a pilot of eight people the same plan hangs on what these eight were like: its spread is told.
- Looks: three, alpha spent after O'Brien and Fleming; a study ends with its first "transparent".
- The rival is what papers do: "no significant difference" taken for none.
- What else acts, and movements in place of participants' values: `_doubted.py`.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from pellucid._processes import in_order
from pellucid.assessment.certificate import PASS, certificate
from pellucid.assessment.equivalence import Margin
from pellucid.assessment.equivalence_power import equivalence_needed, equivalence_power
from pellucid.assessment.group_sequential import looks
from pellucid.assessment.signed_rank import signed_rank
from pellucid.recordings.results import ResultRow

from . import _doubted

STUDIES, SEED = 2000, 20261122
END_POINTS = {"duration": 0.10, "vmax": 0.10, "emg": 0.20, "torque": 0.25}
"""Margins, as shares of control."""
SPREAD = {"duration": 0.05, "vmax": 0.05, "emg": 0.10, "torque": 0.12}
"""Standard deviation of people's changes, of logarithms."""
SHARED = 0.3
"""Correlation of a person's changes over end points."""
CELLS, REPEATS, SCATTER = 10, 10, 0.12
"""Amplitudes in both directions, movements of each, and their scatter (of logarithms)."""
LOOKS = (0.5, 0.75, 1.0)

MARGINS = {name: Margin.of_ratio(share) for name, share in END_POINTS.items()}
SHAPES = ("normal", "heavy_tailed", "skewed")


def rows(studies: int = STUDIES) -> Iterator[ResultRow]:
    """Every figure."""
    jobs = [
        (false_transparent, shape, which, n, method, studies)
        for n in (6, 8, 12, 20)
        for shape in SHAPES
        for which in ("one", "all")
        for method in ("signed_rank",)
    ]
    jobs += [(false_transparent, "normal", "one", 12, "t", studies)]
    shares = in_order(jobs)
    for (_, shape, which, n, method, _), share in zip(jobs, shares, strict=True):
        if which == "one":
            name = f"certificate.false_transparent.{shape}.{n}" + ("" if method == "signed_rank" else f".{method}")
            yield _row(
                name, 100.0 * share, "%", f"{studies} studies of {n} people, one end point at its margin, {method}"
            )
    symmetric = [s for (_, shape, *_), s in zip(jobs, shares, strict=True) if shape != "skewed"]
    note = (
        f"most of {len(symmetric)} kinds of study, {studies} each: one or all end points at the margin, 6 to 20 people"
    )
    yield _row("certificate.false_transparent", 100.0 * max(symmetric), "%", note)
    skewed = [s for (_, shape, *_), s in zip(jobs, shares, strict=True) if shape == "skewed"]
    yield _row("certificate.false_transparent.skewed", 100.0 * max(skewed), "%", "where ranks are not exact")
    for n in (5, 6, 8):
        note = f"the rival: signed ranks at 5 % find no difference in any end point, {n} people, one at its margin"
        yield _row(f"certificate.false_transparent.no_difference_found.{n}", 100.0 * rival(n, studies), "%", note)
    yield _row(
        "certificate.false_transparent.three_looks", 100.0 * sequential(studies), "%", "12 people at the end, ranks"
    )
    yield from power_rows(studies)
    for name, share, note in _doubted.rows(in_order(_doubted.jobs(studies))):
        yield _row(f"certificate.{name}", 100.0 * share, "%", note)


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(name, float(value), unit, "evidence", "simulated", None, note)


def changes(shape: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """People's standardised true changes about their middle, (n, end points)."""
    m = len(END_POINTS)
    common, own = rng.standard_normal((n, 1)), rng.standard_normal((n, m))
    z = np.sqrt(SHARED) * common + np.sqrt(1.0 - SHARED) * own
    if shape == "heavy_tailed":  # t with 3 degrees, scaled to a standard deviation of 1
        return z / np.sqrt(rng.chisquare(3, (n, 1)) / 3.0) / np.sqrt(3.0)
    if shape == "skewed":  # lognormal of sigma 0.6 less its pseudo-median, scaled to 1
        made = np.exp(0.6 * z)
        return (made - PSEUDO_MEDIAN) / np.sqrt((np.exp(0.36) - 1.0) * np.exp(0.36))
    return z


def _pseudo_median() -> float:
    """Of a lognormal of sigma 0.6: the median of means of two."""
    drawn = np.exp(0.6 * np.random.default_rng(7).standard_normal((2, 1_000_000)))
    return float(np.median(drawn.mean(axis=0)))


PSEUDO_MEDIAN = _pseudo_median()


def participants(shape: str, n: int, true: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Differences that a study of `n` people sees, (n, end points), of true middle changes `true`."""
    people = true + np.array(list(SPREAD.values())) * changes(shape, n, rng)
    # Means over repeats of each cell, in both conditions, then over cells: the logarithm of a ratio.
    scatter = SCATTER * np.sqrt(2.0 / REPEATS) * rng.standard_normal((n, CELLS, len(true)))
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


def false_transparent(shape: str, which: str, n: int, method: str, studies: int) -> float:
    """Share of studies that say "transparent" at the margin."""
    rng = np.random.default_rng([SEED, n, SHAPES.index(shape), which == "all"])
    return float(np.mean([says(participants(shape, n, at_margin(which, i), rng), method) for i in range(studies)]))


def rival(n: int, studies: int) -> float:
    """Share of the same studies of `n` people in which no signed-rank test finds a difference."""
    rng = np.random.default_rng([SEED, n, 0, 0])
    drawn = (participants("normal", n, at_margin("one", i), rng) for i in range(studies))
    return float(np.mean([all(signed_rank(each).p_value > 0.05 for each in seen.T) for seen in drawn]))


def sequential(studies: int) -> float:
    """Share that say "transparent" at one of three looks."""
    rng, plan = np.random.default_rng([SEED, 3]), looks(LOOKS, 0.05)
    said = 0
    for i in range(studies):
        seen = participants("normal", 12, at_margin("one", i), rng)
        said += any(says(seen[: round(12 * s)], alpha=level) for s, level in zip(LOOKS, plan.level, strict=True))
    return said / studies


def seen_covariance() -> np.ndarray:
    """Of the differences that studies see."""
    spread = np.array(list(SPREAD.values()))
    own = np.outer(spread, spread) * (SHARED + (1.0 - SHARED) * np.eye(len(spread)))
    return own + np.eye(len(spread)) * SCATTER**2 * 2.0 / (REPEATS * CELLS)


def realised(n: int, true: tuple[float, ...], studies: int) -> float:
    """Share of studies of `n` people that say "transparent" where changes are `true`."""
    rng = np.random.default_rng([SEED, n, 99])
    return float(np.mean([says(participants("normal", n, np.array(true), rng)) for _ in range(studies)]))


def power_rows(studies: int) -> Iterator[ResultRow]:
    """Planned and found power."""
    margins, covariance = list(MARGINS.values()), seen_covariance()
    worst = 0.0
    for words, true in (("none", np.zeros(4)), ("a_third", np.array([m.high / 3.0 for m in margins]))):
        n = equivalence_needed(covariance, margins, change=true, studies=studies)
        planned = equivalence_power(covariance, margins, (n,), change=true, studies=4 * studies).power[0]
        found = realised(n, tuple(true), studies)
        worst = max(worst, abs(found - planned), key=abs)
        yield _row(f"certificate.needed.{words}", n, "1", f"people for 90 %, true changes: {words} of the margins")
        yield _row(f"certificate.power.{words}", 100.0 * found, "%", f"found with {n}, planned {100 * planned:.1f} %")
    yield _row(
        "certificate.power_error", 100.0 * worst, "%", f"found less planned, the larger of two, {studies} studies"
    )
    rng = np.random.default_rng([SEED, 8])
    pilots = [np.cov(participants("normal", 8, np.zeros(4), rng), rowvar=False) for _ in range(60)]
    plan = partial(equivalence_needed, studies=400)
    sizes = [plan(each, margins) or 128 for each in pilots]
    unique = {n: realised(n, (0.0,) * 4, 400) for n in sorted(set(sizes))}
    found = np.array([unique[n] for n in sizes])
    for quantile in (10, 50, 90):
        value = 100.0 * float(np.quantile(found, quantile / 100.0))
        yield _row(f"certificate.power.from_pilot.q{quantile}", value, "%", "planned for 90 % from a pilot of 8 people")
