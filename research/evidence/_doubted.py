"""Simulated studies with another cause than the condition: results of the certificate and of reference methods.

- Movements, some of them missing, analysed by the mixed model.
- A period's effect that hides a change at the margin, because more people began with control than with the robot.
- A change that grows during the session, so that its mean lies within the margin and its end does not.
- Slow movements without a value, and movements that are cut off before they settle.
- Curves that touch their margin at one time.
"""

from collections.abc import Iterator

import numpy as np

from pellucid.people.certificate import PASS, Doubt, certificate_from_tests
from pellucid.people.comparison import signed_rank
from pellucid.people.curves import compare_curves
from pellucid.people.design_columns import MovementDuration
from pellucid.people.equivalence import Margin, equivalence
from pellucid.people.mixed_model import mixed_model, thirds
from pellucid.people.power import lasting_bounds
from pellucid.people.session_periods import SessionPeriods

SEED = 20261123
"""Seed of every random draw."""

CHANGE_MARGIN = Margin.of_ratio(0.10)
"""Margin within which a change counts as transparent: 10 % of the control condition."""

PEOPLE_COUNT = 20
"""Number of participants of a simulated study."""

CHANGE_LOG_SD = 0.05
"""Standard deviation of people's changes, in logarithms."""

MOVEMENT_LOG_SD = 0.12
"""Standard deviation of a person's movements, in logarithms."""


def by_model(people: int, spread: float, studies: int, change: float = CHANGE_MARGIN.high) -> tuple[float, float]:
    """Share of studies in which a mixed model says "within", and in which it has no answer: 8 movements of a person and
    condition, of two amplitudes, a fifth of them missing."""
    rng = np.random.default_rng([SEED, people, round(1e3 * spread), round(1e3 * change)])
    within = silent = 0
    who, under = np.repeat(np.arange(people), 16), np.tile(np.repeat([False, True], 8), people)
    far, trial = np.tile([0.0, 1.0], 8 * people), np.tile(np.arange(8.0), 2 * people)
    for _ in range(studies):
        own = change + spread * rng.standard_normal(people)
        level = 0.2 * rng.standard_normal(people)
        y = level[who] + own[who] * under + 0.3 * far + MOVEMENT_LOG_SD * rng.standard_normal(len(who))
        kept = rng.uniform(size=len(who)) > 0.2
        covariates = {"amplitude": far, "amplitude x condition": (far - 0.5) * (under - 0.5), "trial": trial}
        found = mixed_model(y[kept], who[kept], under[kept], {n: each[kept] for n, each in covariates.items()})
        within += found.equivalence(CHANGE_MARGIN).verdict == "within"
        silent += bool(found.trouble)
    return within / studies, silent / studies


def of_period(studies: int, change: float, per_period: float, first: int) -> tuple[float, float]:
    """Share that says "transparent" with the period reckoned with, and without: so many people had control `first`."""
    rng = np.random.default_rng([SEED, first, round(1e3 * change), round(1e3 * abs(per_period))])
    later = np.where(np.arange(PEOPLE_COUNT) < first, 1.0, -1.0)
    said = plain = 0
    for _ in range(studies):
        d = change + per_period * later + CHANGE_LOG_SD * rng.standard_normal(PEOPLE_COUNT)
        own = equivalence(d, CHANGE_MARGIN)
        reckoned = equivalence(d, CHANGE_MARGIN, sessions=SessionPeriods.of_two(later))
        said += certificate_from_tests({"duration": reckoned}, 0.05).verdict == PASS
        plain += own.verdict == "within"
    return said / studies, plain / studies


def of_learning(studies: int, mean: float, end: float) -> tuple[float, float]:
    """Share that says "transparent" with learning looked for, and without: the change goes from one end to the other
    about its mean, `end` in the last third; 30 movements of each condition."""
    rng = np.random.default_rng([SEED, 4, round(1e3 * end)])
    # Of a straight line the last third lies two thirds of the way from the middle to the end.
    course = mean + (end - mean) * 1.5 * np.linspace(-1.0, 1.0, 30)
    said = plain = 0
    for _ in range(studies):
        own = CHANGE_LOG_SD * rng.standard_normal(PEOPLE_COUNT)
        base = MOVEMENT_LOG_SD * rng.standard_normal((PEOPLE_COUNT, 30))
        robot = own[:, None] + course + MOVEMENT_LOG_SD * rng.standard_normal((PEOPLE_COUNT, 30))
        d = robot.mean(axis=1) - base.mean(axis=1)
        parts = [[thirds(row, [0] * 30) for row in each] for each in (base, robot)]
        drift, late = (np.array([[getattr(t, what) for t in each] for each in parts]) for what in ("drift", "last"))
        p = signed_rank(drift[1] - drift[0]).p_value
        test = equivalence(d, CHANGE_MARGIN)
        doubt = Doubt("learning", p, equivalence(d + late[1] - late[0], CHANGE_MARGIN))
        said += certificate_from_tests({"duration": test}, 0.05, {"duration": (doubt,)}).verdict == PASS
        plain += test.verdict == "within"
    return said / studies, plain / studies


def of_failures(studies: int, cap: float | None) -> tuple[float, float]:
    """Return the share of "transparent" by the certificate and by the reference method, with a true change at the
    margin.

    Values are medians of 12 movements. The slowest fifth of the robot's movements has no value, or all are cut off at
    `cap` times control's median [1]. The reference method ignores missing movements, or uses observed parts as whole
    ones.
    """
    rng = np.random.default_rng([SEED, 5, cap is None])
    who = [f"P{i}" for i in range(PEOPLE_COUNT)]

    def change(own: np.ndarray, base: np.ndarray) -> np.ndarray:
        return np.log(own / base)

    said = plain = 0
    for _ in range(studies):
        seen, naive, failed = [], [], []
        for i, person in enumerate(who):
            pace, own = 0.15 * rng.standard_normal(), CHANGE_MARGIN.high + CHANGE_LOG_SD * rng.standard_normal()
            for condition, more in (("Ctrl", 0.0), ("FC", own)):
                seconds = np.exp(pace + more + 0.25 * rng.standard_normal(12))
                slow = np.exp(pace + more + 0.25 * 0.8416) if cap is None else cap * np.exp(pace)
                for s in seconds:
                    hidden = condition == "FC" and s > slow
                    shown = min(s, slow) if hidden else s
                    if cap is None and hidden:
                        failed.append(MovementDuration(who[i], condition, (None, "up"), float("inf"), False))
                    else:
                        seen.append(MovementDuration(person, condition, (None, "up"), shown, not hidden))
                        naive.append(MovementDuration(person, condition, (None, "up"), shown, True))
        setting = who, ("Ctrl", "FC"), "Ctrl", "FC", change
        low, high = lasting_bounds(seen, *setting)
        test = equivalence(low, CHANGE_MARGIN, upper=high, method="signed_rank")
        doubts = {}
        if failed:
            low, high = lasting_bounds(seen + failed, *setting)
            counted = equivalence(low, CHANGE_MARGIN, upper=high, method="signed_rank")
            doubts["duration"] = (Doubt("left out", 0.0, counted, always=True),)
        said += certificate_from_tests({"duration": test}, 0.05, doubts).verdict == PASS
        low, _ = lasting_bounds(naive, *setting)
        plain += equivalence(low, CHANGE_MARGIN, method="signed_rank").verdict == "within"
    return said / studies, plain / studies


def of_curves(studies: int, people: int) -> float:
    """Share of curves found within all along whose mean touches the margin at one time."""
    rng = np.random.default_rng([SEED, 6, people])
    window = np.hanning(21) / np.linalg.norm(np.hanning(21))
    bump = np.exp(-0.5 * ((np.arange(61) - 30.0) / 6.0) ** 2)
    within = 0
    for _ in range(studies):
        noise = np.array([np.convolve(row, window, "valid") for row in rng.standard_normal((people, 81))])
        within += compare_curves(0.15 * noise + bump, Margin.either_way(1.0)).verdict == "within"
    return within / studies


def jobs(studies: int) -> list[tuple]:
    """For `ordered_results`, in the order in which `rows` reads them."""
    few, third = studies // 8, CHANGE_MARGIN.high / 3.0
    return [
        (by_model, 8, CHANGE_LOG_SD, studies // 2), (by_model, 16, CHANGE_LOG_SD, few), (by_model, 8, 0.0, few),
        (by_model, 12, CHANGE_LOG_SD, few, third),
        (of_period, studies, CHANGE_MARGIN.high, -0.4 * CHANGE_MARGIN.high, 15), (of_period, studies, third, 0.0, 10),
        (of_learning, studies, 0.6 * CHANGE_MARGIN.high, 1.3 * CHANGE_MARGIN.high),
        (of_learning, studies, third, third),
        (of_failures, studies // 2, None), (of_failures, studies // 2, 1.08),
        (of_curves, studies, 6),
    ]  # fmt: skip


def rows(found: list) -> Iterator[tuple[str, float, str]]:
    """Name, % and note of what `jobs` found."""
    model, more, none, powered, period, balanced, growing, steady, failed, cut, curves = found
    at = "one end point at its margin"
    yield "false_transparent.mixed_model.8", model[0], f"8 people, a fifth of 16 movements missing, {at}"
    yield "false_transparent.mixed_model.16", more[0], f"16 people, {at}"
    yield "false_transparent.mixed_model.alike", none[0], f"8 people who all change alike, {at}"
    yield "mixed_model.no_answer", max(each[1] for each in (model, more, none, powered)), "did not come to rest"
    yield "power.mixed_model", powered[0], "12 people, changes a third of the margin"
    yield "false_transparent.period", period[0], f"15 of 20 began with control, a period hides 0.4 of the margin, {at}"
    yield "false_transparent.period.not_reckoned_with", period[1], "reference method: the mean alone, the same studies"
    yield "power.order_stated", balanced[0], "20 people, orders in balance, changes a third of the margin"
    yield "power.order_not_stated", balanced[1], "the same studies without their order"
    yield "false_transparent.learning", growing[0], "the last third 1.3 margins from control, the mean 0.6, 20 people"
    yield "false_transparent.learning.not_looked_for", growing[1], "reference method: the mean alone, the same studies"
    yield "power.learning_looked_for", steady[0], "no trend, changes a third of the margin"
    yield "power.learning_not_looked_for", steady[1], "the same studies"
    yield "false_transparent.failed_targets", failed[0], f"the slowest fifth gave no movement, {at}"
    yield (
        "false_transparent.failed_targets.left_out",
        failed[1],
        "reference method: targets without a movement are excluded",
    )
    yield "false_transparent.cut_off", cut[0], f"movements cut off at 1.08 of control's median, {at}"
    yield "false_transparent.cut_off.taken_as_seen", cut[1], "reference method: observed parts count as whole movements"
    yield "false_transparent.curve", curves, "6 people, the curve touches its margin at one time"
