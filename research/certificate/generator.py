"""Studies of the challenge: tables of movements, and recordings with their study.toml; the truth is kept apart.

Nothing here imports Pellucid, and nothing was adapted to what its analysis does: the generator was written from the
literature on movements, before its author had read the code that it examines.

- A movement is a primary submovement of minimum jerk (Flash and Hogan 1985). Some are followed, after the time in which
  an error is seen, by a corrective submovement (Meyer et al. 1988): forwards after an undershoot, backwards after an
  overshoot.
- Times grow with amplitude after Fitts (1954). A person's times are lognormal.
- Time to rest is from the first motion to the end of the last submovement. The truth about a study is the mean over the
  population of the ratio of people's median times to rest, and the shares of people within and far beyond the margin.
- Practice falls off as an exponential (Heathcote et al. 2000). Sessions have an effect of their order, and the robot
  leaves an effect in the session that follows it (Jones and Kenward 2014).
- Long movements are lost: their markers are hidden, or the next target comes before they end.
- Signals have white noise, a tremor of 9 Hz and the encoder's steps.
"""

from __future__ import annotations

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .scenarios import MARGIN, SCENARIOS, Scenario

SEED = 20261201
"""Seed of every random draw."""

SEAL = "edceb6b85ead31eeed7bffb4eef0ded73c0b46392387e748c2cd3f4378023120"
"""Digest of all truths (`seal`), stated before any study was assessed."""

STUDY_COUNT = 200
"""Number of studies of the challenge: of the eight of each scenario two are recordings, the others tables."""

PEOPLE_RANGE = (12, 24)
"""Smallest and largest number of participants."""

AMPLITUDES = (20.0, 35.0, 50.0)
"""Amplitudes of the movements [deg]."""

REPETITIONS = 2
"""Movements of each amplitude and direction in a session with recordings; tables have four times as many."""

RATE = 100.0
"""Sampling rate of the recordings [Hz]."""

POPULATION = 2000
"""Number of people of whom the truth is computed."""

FAR_BEYOND = 3.0
"""Distance, in margins, from which a person counts as far beyond."""

LEAST_WITHIN, MOST_FAR = 0.75, 0.05
"""Shares of people within the margin and far beyond it that a transparent robot has at least and at most."""


@dataclass(frozen=True)
class Truth:
    """What is true of a study and is not told to the analysis."""

    study: str
    scenario: str
    kind: str  # "table" or "recordings"
    people: int
    change: float  # mean over the population of the logarithm of the ratio of times to rest
    change_at_end: float  # the same at the end of a session
    within: float  # share of the population within the margin
    far: float  # share beyond three margins
    transparent: bool


@dataclass(frozen=True)
class _Movements:
    """Movements of people (rows) in a session: amplitudes with their direction [deg], parts of their times [s]."""

    amplitude: np.ndarray
    primary: np.ndarray
    pause: np.ndarray
    correction: np.ndarray  # duration, 0 where there is none
    error: np.ndarray  # share of the amplitude that the primary submovement goes beyond its target

    @property
    def to_rest(self) -> np.ndarray:
        return self.primary + self.pause + self.correction


@dataclass(frozen=True)
class _Drawn:
    """What is the same for everybody in one study."""

    scenario: Scenario
    sign: float
    shape: str
    people: int
    period: float
    scatter: float  # standard deviation of one person's times, in logarithms
    level: float  # typical time of the middle amplitude [s]
    repetitions: int


def _drawn(scenario: Scenario, repetitions: int, rng: np.random.Generator) -> _Drawn:
    shape = scenario.people_shape
    if shape == "any":
        shape = str(rng.choice(["normal", "normal", "skewed", "heavy", "flat"]))
    # Only what slows makes movements longer; shapes of people have their long tail on that side.
    slows = scenario.lost > 0.0 or scenario.backwards or scenario.people_shape != "any" or scenario.growth > 0.0
    steps = 6 if scenario.design == "williams" else 2
    low, high = PEOPLE_RANGE
    return _Drawn(
        scenario, 1.0 if slows or rng.uniform() < 0.5 else -1.0, shape,
        int(steps * rng.integers(low // steps, high // steps + 1)),
        float(rng.uniform(-1.0, 1.0) * scenario.period), float(rng.uniform(0.08, 0.18)), float(rng.uniform(0.6, 1.0)),
        repetitions,
    )  # fmt: skip


def _effects(drawn: _Drawn, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return the robot's effects on the logarithms of people's times, (count,)."""
    z = {
        "normal": lambda: rng.standard_normal(count),
        "skewed": lambda: (
            (np.exp(0.8 * rng.standard_normal(count)) - np.exp(0.32)) / np.sqrt((np.exp(0.64) - 1.0) * np.exp(0.64))
        ),
        "heavy": lambda: rng.standard_t(4, count) / np.sqrt(2.0),
        "flat": lambda: rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), count),
        "subgroup": lambda: (_third_of(count, rng) - 1.0 / 3.0) * np.sqrt(4.5) + 0.2 * rng.standard_normal(count),
    }[drawn.shape]()
    own = drawn.scenario
    return np.log1p(MARGIN) * drawn.sign * (own.change + own.spread * z)


def _third_of(count: int, rng: np.random.Generator) -> np.ndarray:
    return (rng.uniform(size=count) < 1.0 / 3.0).astype(float)


def _session(
    drawn: _Drawn, robot: bool, levels: np.ndarray, effects: np.ndarray, offsets: np.ndarray, rng: np.random.Generator
) -> _Movements:
    """Draw one session; `offsets` are effects of periods and of carry-over on the logarithms of times."""
    own, people, unit = drawn.scenario, len(levels), np.log1p(MARGIN)
    cells = np.tile(AMPLITUDES, drawn.repetitions * 2)
    order = np.argsort(rng.uniform(size=(people, len(cells) // 2)), axis=1)
    # There and back: each amplitude is done in both directions, one after the other.
    amplitude = np.repeat(cells[: len(cells) // 2][order], 2, axis=1) * np.tile([1.0, -1.0], len(cells) // 2)
    count = amplitude.shape[1]
    done = np.arange(count) / (count - 1)
    far = np.abs(amplitude) > np.median(AMPLITUDES)
    times = np.log(drawn.level) + levels[:, None] + 0.35 * np.log2(np.abs(amplitude) / np.median(AMPLITUDES)) / 2.0
    times = times + offsets[:, None] - own.practice * unit * (1.0 - np.exp(-5.0 * done))
    if robot:
        # A third of the movements is far: slowing these alone by three times as much has the same mean.
        times = times + effects[:, None] * (3.0 * far if own.far_only else 1.0)
        times = times + drawn.sign * own.growth * unit * (2.0 * done - 1.0)
    primary = np.exp(times + drawn.scatter * rng.standard_normal((people, count)))
    corrected = rng.uniform(size=(people, count)) < own.corrected[int(robot)]
    size = rng.uniform(0.08, 0.18, (people, count))
    pause, later = rng.uniform(0.06, 0.18, (people, count)), rng.uniform(0.45, 0.65, (people, count)) * primary
    return _Movements(
        amplitude, primary, np.where(corrected, pause, 0.0), np.where(corrected, later, 0.0),
        np.where(corrected, size if own.backwards else -size, 0.0),
    )  # fmt: skip


def _truth(name: str, kind: str, drawn: _Drawn, key: list[int]) -> Truth:
    """Compute the truth from many people whose sessions have the same chance events with and without the robot."""
    rng = np.random.default_rng([*key, 1])
    levels, effects = 0.15 * rng.standard_normal(POPULATION), _effects(drawn, POPULATION, rng)
    none = np.zeros(POPULATION)
    # The same chance events in both sessions: their ratio has the robot's effect alone.
    free, worn = (
        _session(drawn, robot, levels, effects, none, np.random.default_rng([*key, 2])) for robot in (False, True)
    )
    ratio = np.log(np.median(worn.to_rest, axis=1) / np.median(free.to_rest, axis=1))
    unit, own = np.log1p(MARGIN), drawn.scenario
    if own.far_only:
        # The median of all movements would hide what happens to a third of them: amplitudes count alike.
        ratio = np.log(worn.to_rest / free.to_rest).mean(axis=1)
    # What no correction changes is known exactly: the mean effect of the population and not of these people.
    change = drawn.sign * own.change * unit + float(np.mean(ratio - effects)) * (own.corrected[0] != own.corrected[1])
    at_end = change + drawn.sign * own.growth * unit * 2.0 / 3.0
    within = float(np.mean(np.abs(ratio) < unit))
    far = float(np.mean(np.abs(ratio) > FAR_BEYOND * unit))
    # A mean at the margin is not within it.
    inside = max(abs(change), abs(at_end)) < unit * (1.0 - 1e-9)
    return Truth(name, own.name, kind, drawn.people, change, at_end, within, far,
                 bool(inside and within >= LEAST_WITHIN and far <= MOST_FAR))  # fmt: skip


def _orders(drawn: _Drawn, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return each participant's order of conditions."""
    design, n = drawn.scenario.design, drawn.people
    if design == "williams":
        six = [("free", "robot", "other"), ("robot", "other", "free"), ("other", "free", "robot"),
               ("other", "robot", "free"), ("free", "other", "robot"), ("robot", "free", "other")]  # fmt: skip
        orders = six * (n // 6)
    else:
        first = n - 2 if design == "lopsided" else n // 2
        orders = [("free", "robot")] * first + [("robot", "free")] * (n - first)
    return [orders[k] for k in rng.permutation(n)]


def _lost(drawn: _Drawn, worn: _Movements, free: _Movements, robot: bool, rng: np.random.Generator) -> np.ndarray:
    """Return which movements of a session are lost, (people, movements)."""
    own, here = drawn.scenario, worn if robot else free
    lost = rng.uniform(size=here.primary.shape) < own.lost_at_random
    if own.lost:
        far = np.abs(here.amplitude) > np.median(AMPLITUDES)
        # The task allows everybody the same time: so much that the stated share is lost with the robot.
        limit = np.quantile(worn.to_rest, 1.0 - own.lost)
        lost |= (here.to_rest > limit) & (far if own.far_only else True)
    return lost


def name_of(i: int) -> str:
    """Return the name of study number `i`."""
    return f"study_{i:03d}"


def write_study(i: int, folder: Path) -> None:
    """Write study number `i` into `folder`: a table, or recordings with a study.toml; without its truth."""
    scenario, kind, key = _which(i)
    drawn = _drawn(scenario, _repetitions(kind), np.random.default_rng([*key, 0]))
    rng = np.random.default_rng([*key, 3])
    n, unit = drawn.people, np.log1p(MARGIN)
    levels, effects, orders = 0.15 * rng.standard_normal(n), _effects(drawn, n, rng), _orders(drawn, rng)
    place = {c: np.array([order.index(c) for order in orders]) for c in orders[0]}
    after_robot = {c: np.array([place["robot"][k] + 1 == place[c][k] for k in range(n)]) for c in place}
    sessions = {}
    for condition in place:
        # What the robot leaves makes the session after it look like the robot, so that less of the change is seen.
        offsets = unit * (drawn.period * place[condition] + drawn.sign * scenario.carry_over * after_robot[condition])
        own = effects if condition == "robot" else 0.5 * _effects(drawn, n, rng)
        sessions[condition] = _session(drawn, condition != "free", levels, own, offsets, rng)
    lost = {c: _lost(drawn, sessions["robot"], sessions["free"], c == "robot", rng) if c != "other"
            else np.zeros(s.primary.shape, bool) for c, s in sessions.items()}  # fmt: skip
    ordered = scenario.design != "parallel"
    if kind == "table":
        _write_table(folder / "movements.csv", sessions, lost, place if ordered else None)
    else:
        _write_recordings(folder, drawn, sessions, lost, place if ordered else None, rng)


def truth_of(i: int) -> Truth:
    """Return the truth about study number `i`."""
    scenario, kind, key = _which(i)
    drawn = _drawn(scenario, _repetitions(kind), np.random.default_rng([*key, 0]))
    return _truth(name_of(i), kind, drawn, key)


def _which(i: int) -> tuple[Scenario, str, list[int]]:
    return SCENARIOS[i % len(SCENARIOS)], "recordings" if (i // len(SCENARIOS)) % 4 == 1 else "table", [SEED, i]


def _repetitions(kind: str) -> int:
    return REPETITIONS if kind == "recordings" else 4 * REPETITIONS


def _write_table(
    path: Path, sessions: dict[str, _Movements], lost: dict[str, np.ndarray], place: dict[str, np.ndarray] | None
) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["participant", "condition", *(["period"] if place else []), "trial", "amplitude", "direction",
                        "duration"])  # fmt: skip
        for condition, own in sessions.items():
            for k in range(len(own.primary)):
                for trial in range(own.primary.shape[1]):
                    a = own.amplitude[k, trial]
                    row = [f"P{k + 1}", condition, *([place[condition][k] + 1] if place else []), trial + 1, abs(a)]
                    time = "" if lost[condition][k, trial] else f"{own.to_rest[k, trial]:.4f}"
                    table.writerow([*row, "out" if a > 0.0 else "back", time])


def _write_recordings(
    folder: Path, drawn: _Drawn, sessions: dict[str, _Movements], lost: dict[str, np.ndarray],
    place: dict[str, np.ndarray] | None, rng: np.random.Generator,
) -> None:  # fmt: skip
    told = ['name = "challenge"', "[rig]", 'joint = "elbow"', 'motion = "rotary"', 'lifts = "flexion"', "[channels]"]
    told += [f'{c} = {{ column = "{c}", unit = "{u}" }}' for c, u in
             (("time", "s"), ("position", "deg"), ("target", "deg"))]  # fmt: skip
    told += [
        "[assessment]",
        'control = "free"',
        'cutoffs = ["3 Hz"]',
        "thresholds = [0.05]",
        "[assessment.margins]",
        f'duration_median = "{100 * MARGIN:g} %"',
    ]
    hidden = rng.uniform() < 0.5  # markers are hidden, or the next target comes too early
    for k in range(drawn.people):
        told += [f"[participants.P{k + 1}]", 'mass = "70 kg"']
        for condition, own in sessions.items():
            name = f"P{k + 1}_{condition}"
            signals = _signals(own, k, lost[condition][k], drawn.scenario.noise, hidden, rng)
            with (folder / f"{name}.csv").open("w", encoding="utf-8") as file:
                file.write("time,position,target\n")
                file.writelines(f"{t:.2f},{'' if q != q else round(q, 2)},{g:g}\n"
                                for t, q, g in zip(*(each.tolist() for each in signals), strict=True))  # fmt: skip
            told += ["[[recordings]]", f'name = "{name}"', f'file = "{name}.csv"', f'participant = "P{k + 1}"']
            told += [f'condition = "{condition}"']
            told += [f"period = {place[condition][k] + 1}"] if place else []
    (folder / "study.toml").write_text("\n".join(told) + "\n", encoding="utf-8")


def _signals(
    own: _Movements, k: int, lost: np.ndarray, noise: float, hidden: bool, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time [s], angle and target [deg] of person `k` in one session."""
    reaction, rest = rng.uniform(0.2, 0.3, len(lost)), rng.uniform(0.9, 1.3, len(lost))
    to_rest = own.to_rest[k]
    begins = 1.0 + np.cumsum(reaction + to_rest + rest) - (to_rest + rest)  # the first motion of each movement
    steps = begins - reaction
    if not hidden:
        # The target of the next movement comes before a lost one ends; the person finishes it and then goes on.
        for m in range(len(lost) - 1):
            if lost[m]:
                steps[m + 1] = begins[m] + 0.85 * to_rest[m]
    time = np.arange(0.0, begins[-1] + to_rest[-1] + rest[-1], 1.0 / RATE)
    angle, target, gone = np.zeros(len(time)), np.zeros(len(time)), np.zeros(len(time), bool)
    for m, a in enumerate(own.amplitude[k]):
        error = own.error[k, m]
        angle += a * (1.0 + error) * _minimum_jerk((time - begins[m]) / own.primary[k, m])
        if own.correction[k, m]:
            start = begins[m] + own.primary[k, m] + own.pause[k, m]
            angle -= a * error * _minimum_jerk((time - start) / own.correction[k, m])
        target[time >= steps[m]] += a
        if lost[m] and hidden:
            gone |= (time > begins[m] + 0.2 * to_rest[m]) & (time < begins[m] + 0.9 * to_rest[m])
    tremor = 0.02 * np.sin(2.0 * np.pi * (9.0 * time + rng.uniform()))
    angle = angle + tremor + 0.02 * noise * rng.standard_normal(len(time))
    angle = np.round(angle / 0.02) * 0.02
    angle[gone] = np.nan
    return time, angle, target


def _minimum_jerk(s: np.ndarray) -> np.ndarray:
    """Return the share of the way that is done after a share `s` of the time."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def seal(truths: list[Truth]) -> str:
    """Return the digest of truths, which shows that nobody changed them after verdicts were seen."""
    told = [f"{t.study},{t.scenario},{t.kind},{t.people},{t.transparent}" for t in truths]
    return hashlib.sha256("\n".join(told).encode()).hexdigest()
