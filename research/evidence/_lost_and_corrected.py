"""Rates of false "transparent" in studies with lost long movements, and with backward corrections caused by the robot.

- Losses: a table of movements in which the robot's longest have no value; the true change includes them. People's mean
  change is at its margin, and `pl.assess` reads the table.
- Corrections backwards: people's angles are simulated and measured by `pl.movement_indices`; studies are sampled from
these
  people and decided by `are_transparent`. The true mean change of the time to rest, from the angle without noise and
  filter, is at its margin. Primary movements are as fast as without the robot, or faster.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import pellucid as pl
from pellucid.people.certificate import PASS
from pellucid.people.equivalence import Margin
from pellucid.people.movement_indices import SimulatedStudies, are_transparent
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

SEED = 20261202
"""Seed of every random draw."""

LOSS_STUDY_COUNT = sized(10_000, smallest=8)
"""Number of simulated studies of each share of losses."""

BLOCK = sized(500, smallest=4)
"""Number of studies of one job."""

POOL_PEOPLE = sized(200, smallest=6)
"""Number of people whose angles are made and measured for each kind of correction."""

MARGIN_RATIO = 0.10
"""Margin of the time to rest, as a share of control."""

MARGIN = Margin.of_ratio(MARGIN_RATIO)
"""The same in logarithms."""

LOSS_CASES = ((0.09, 0.12), (0.3, 0.12), (0.09, 0.4))
"""Shares of the robot's movements that are lost, the longest ones, and standard deviations of a person's movements in
logarithms: just fewer than an assessment allows, more, and just fewer of movements that vary much."""

PEOPLE = 12
"""Number of people of each study with losses."""

MOVEMENTS = 5
"""Number of movements of a person and condition in a study with losses."""

CORRECTED_MOVEMENTS = 20
"""Number of movements of a person and condition whose angle is made."""

MOVEMENT_LOG_SD = 0.12
"""Standard deviation of a person's movements with corrections, in logarithms."""

CORRECTION_CASES = {
    "as fast": "primary movements as fast as without the robot",
    "faster": "primary movements faster, and all of them corrected",
    "removed": "primary movements slower, and corrections gone",
}
"""What the robot does to movements, in words."""

RATE = 100.0
"""Sampling rate of the angles [Hz]."""


def rows(studies: int) -> Iterator[tuple[str, float, str, str]]:
    """Name, value, unit and note of each figure; `studies` of each case of corrections."""
    blocks = range(0, LOSS_STUDY_COUNT, BLOCK)
    jobs = [(transparent_count, *case, first) for case in LOSS_CASES for first in blocks]
    said = np.reshape(ordered_results(jobs), (len(LOSS_CASES), -1)).sum(axis=1)
    cells = {f"{100.0 * share:g} % (SD {100.0 * spread:g} %)": 100.0 * n / (len(blocks) * BLOCK)
             for (share, spread), n in zip(LOSS_CASES, said.tolist(), strict=True)}  # fmt: skip
    worst = max(cells, key=cells.__getitem__)
    note = f"the longest movements are lost, the worst of {', '.join(cells)}: {worst}; {LOSS_STUDY_COUNT} studies each"
    yield "losses.false_transparent", cells[worst], "%", note
    pools = ordered_results([(measured_changes, case) for case in CORRECTION_CASES])
    found = []
    for case, (true, seen) in zip(CORRECTION_CASES, pools, strict=True):
        for n in (12, 20):
            rng = np.random.default_rng([SEED, 3, n])
            drawn = seen[rng.integers(len(seen), size=(studies, n))] - true.mean()
            # Everybody's change is moved by one and the same amount, so that the true mean is at a margin.
            for side, mean in (("upper", MARGIN.high), ("lower", MARGIN.low)):
                said_so = are_transparent(SimulatedStudies((drawn + mean)[:, :, None]), [MARGIN])
                words = f"{n} people, {CORRECTION_CASES[case]}, mean at the {side} margin"
                found.append((100.0 * float(np.mean(said_so)), words))
    yield "backward_corrections.false_transparent", max(found)[0], "%", f"the worst of {len(found)}: {max(found)[1]}"
    true, seen = (100.0 * np.expm1(each.mean()) for each in pools[0])
    yield "backward_corrections.true_change", true, "%", "mean change of the time to rest, from angles without noise"
    yield "backward_corrections.seen_change", seen, "%", "the same by pl.movement_indices, from sampled, noisy angles"


def transparent_count(share: float, spread: float, first: int) -> int:
    """Return how many of a block of studies are called transparent, of whose robot's movements a `share` is lost.

    `spread` is the standard deviation of a person's movements, in logarithms.
    """
    rng = np.random.default_rng([SEED, 1, round(1e3 * share), round(1e3 * spread), first])
    who = np.repeat(np.arange(PEOPLE), 2 * MOVEMENTS).tolist()
    what = ["free"] * MOVEMENTS + ["robot"] * MOVEMENTS
    said = 0
    for _ in range(BLOCK):
        own = MARGIN.high * (1.0 + rng.standard_normal((PEOPLE, 1)) / 3.0)
        z = spread * rng.standard_normal((PEOPLE, 2 * MOVEMENTS))
        pace = 0.15 * rng.standard_normal((PEOPLE, 1))
        times = np.exp(pace + z + own * (np.arange(2 * MOVEMENTS) >= MOVEMENTS))
        robot = z[:, MOVEMENTS:]
        robot_times = times[:, MOVEMENTS:]
        robot_times[robot > np.quantile(robot, 1.0 - share)] = np.nan
        table = {"participant": who, "condition": what * PEOPLE, "duration": times.ravel()}
        found = pl.assess(table, control="free", margins={"duration": MARGIN_RATIO})
        said += found.certificates["robot"].verdict == PASS
    return said


def measured_changes(case: str) -> tuple[np.ndarray, np.ndarray]:
    """Return people's true and measured changes of the time to rest, (n,) each, in logarithms."""
    rng = np.random.default_rng([SEED, 2, list(CORRECTION_CASES).index(case)])
    true, seen = [], []
    for _ in range(POOL_PEOPLE):
        pace = 0.7 * np.exp(0.15 * rng.standard_normal())
        own = []
        for robot in (False, True):
            factor = {"as fast": 1.0, "faster": 0.75, "removed": 1.3}[case] if robot else 1.0
            own.append(_times_to_rest(pace * factor, robot != (case == "removed"), rng))
        ratios = [np.log(np.median(a) / np.median(b)) for a, b in zip(own[1], own[0], strict=True)]
        true.append(ratios[0])
        seen.append(ratios[1])
    return np.array(true), np.array(seen)


def _times_to_rest(pace: float, corrected: bool, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return true and measured times to rest of movements [s], all or none of them `corrected` after an overshoot."""
    duration = pace * np.exp(MOVEMENT_LOG_SD * rng.standard_normal(CORRECTED_MOVEMENTS))
    overshoot = corrected * rng.uniform(0.08, 0.18, CORRECTED_MOVEMENTS)
    pause, later = rng.uniform(0.06, 0.18, CORRECTED_MOVEMENTS), rng.uniform(0.45, 0.65, CORRECTED_MOVEMENTS) * duration
    begins = 1.0 + 3.5 * np.arange(CORRECTED_MOVEMENTS)
    time = np.arange(0.0, begins[-1] + 3.5, 1.0 / RATE)
    angle, target, true = np.zeros(len(time)), np.zeros(len(time)), []
    fine = np.arange(0.0, 3.0, 1e-3)
    for k, start in enumerate(begins):
        size = np.radians(40.0) * (1.0 if k % 2 == 0 else -1.0)
        parts = [(start, duration[k], size * (1.0 + overshoot[k]))]
        parts.append((start + duration[k] + pause[k], later[k], -size * overshoot[k]))
        alone = np.zeros(len(fine))
        for at, lasts, height in parts:
            angle += height * _minimum_jerk((time - at) / lasts)
            alone += height * _minimum_jerk((fine + start - at) / lasts)
        speed = np.abs(np.diff(alone))
        moving = np.flatnonzero(speed > 0.05 * speed.max())
        true.append(1e-3 * (moving[-1] - moving[0]))
        target[time >= start - 0.25] += size
    angle += np.radians(0.02) * rng.standard_normal(len(time))
    return np.array(true), pl.movement_indices(time, angle, target=target)["duration"]


def _minimum_jerk(s: np.ndarray) -> np.ndarray:
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
