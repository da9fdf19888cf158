"""Studies written as files and assessed by the command line: correctness of the decision for known changes.

People point to targets in two conditions; in one of them each person's peak velocity changes by a random factor.
Each study is written as CSV files with its study.toml and handed to ``pellucid assess`` as a user would; its result is
read from results.json. Movements have minimum jerk, so that only the random factor changes.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from typer.testing import CliRunner

import pellucid as pl
from pellucid.people.certificate import Certificate
from pellucid.people.equivalence import Margin
from pellucid.people.movement_indices import SimulatedStudies, are_transparent
from pellucid.people.session_periods import SessionPeriods
from pellucid.people.survival import looks
from pellucid.study.procedures.registry import open_study
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

SEED = 20261127
"""Seed of every random draw."""

STUDY_COUNT = sized(2, smallest=1)
"""Number of studies of each case."""

DOOR_STUDY_COUNT = sized(100, smallest=2)
"""Number of studies that are certified by every function that certifies."""

PEOPLE_COUNT = 16
"""Number of participants of a study."""

AMPLITUDE = float(np.radians(30.0))
"""Amplitude of every movement [rad]."""

MARGIN = Margin.of_ratio(0.10)
"""Margin of the peak velocity."""

LOOK_SHARES = (0.6, 0.8, 1.0)
"""Shares of the planned participants at the looks of a sequential study."""

CASES = ("plain", "at_margin", "missing_few", "missing_many", "periods", "look", "lost_people", "one_slowed",
         "hidden_by_period", "last_look")  # fmt: skip
"""What is done to the studies of a case.

Movements are missing for one person or for all; periods are stated, and more people have control first; a sequential
study is at its second or its last look; some people lack a condition; one person is slowed; or nearly everybody has
control first, and an effect of the period hides a change that is at the margin."""

FIRST_COUNTS = {"periods": 10, "hidden_by_period": 13}
"""Number of participants who have control first, in the cases with periods."""

PERIOD_EFFECTS = {"periods": -0.01, "hidden_by_period": -0.03}
"""Change of a participant who has the robot in the second period, in logarithms; the opposite in the first."""

LOOKS = {"look": 2, "last_look": 3}
"""Look at which a sequential study is, from 1."""


def rows() -> Iterator[tuple[str, float, str, str]]:
    """Name, value, unit and note of each figure."""
    wrong, of = 0, 0
    for case in CASES:
        said = []
        for i in range(STUDY_COUNT):
            expected, verdict = _assessed(case, i)
            said.append(verdict)
            wrong, of = wrong + (verdict != expected), of + 1
        share = 100.0 * np.mean([each == 1.0 for each in said])
        yield f"command_line.{case}.certified", share, "%", f"of {STUDY_COUNT} studies made of files"
    yield "command_line.studies", of, "1", ", ".join(CASES)
    yield "command_line.wrong", wrong, "1", "studies in which the command line decides otherwise than drawn changes ask"


def _assessed(case: str, i: int) -> tuple[float, float]:
    """Return the expected and the found verdict: 1 for transparent, 0.5 for "cannot say"."""
    rng = np.random.default_rng([SEED, CASES.index(case), i])
    centre = MARGIN.high if case in ("at_margin", "hidden_by_period") else 0.0
    changes = centre + 0.02 * rng.standard_normal(PEOPLE_COUNT)
    if case == "one_slowed":
        changes[3] = np.log(1.6)
    first = np.arange(PEOPLE_COUNT) < FIRST_COUNTS.get(case, 0)
    later = np.where(first, 1.0, -1.0)
    changes = changes + PERIOD_EFFECTS.get(case, 0.0) * later
    paces = 0.1 * rng.standard_normal(PEOPLE_COUNT)  # logarithms
    with TemporaryDirectory() as place:
        folder = Path(place)
        _write_study(folder, case, changes, first, paces)
        from pellucid.cli import app

        done = CliRunner().invoke(app, ["assess", str(folder)])
        if done.exit_code > 1:  # 1: nothing can be said
            raise RuntimeError(f"pellucid assess failed on a study of the case {case}: {done.output[-2000:]}")
        found = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    verdict = next(row["value"] for row in found["figures"] if row["id"].endswith("certificate.robot.transparent"))
    if case in ("missing_many", "lost_people"):
        return 0.5, verdict
    alpha = looks(LOOK_SHARES, 0.05).level[LOOKS[case] - 1] if case in LOOKS else 0.05
    sessions = SessionPeriods.of_two(later) if case in FIRST_COUNTS else None
    drawn = SimulatedStudies(changes[None, :, None], sessions)
    return (1.0 if are_transparent(drawn, [MARGIN], alpha=alpha)[0] else 0.5), verdict


def door_rows() -> Iterator[tuple[str, float, str, str]]:
    """Name, value, unit and note: do all doors certify the same of the same data?

    Of movements: the command, a study, and a table in `pl.assess` and in `pl.certify`. Of people's means, which do not
    tell the noise of movements: a table in `pl.assess`, and arrays in `pl.certify`. The command's figures are read from
    its results.json.
    """
    apart = [not each for each in ordered_results([(_doors_agree, i) for i in range(DOOR_STUDY_COUNT)])]
    yield "doors.studies", len(apart), "1", "studies made of files, a half of them with ordered sessions"
    note = "studies in which estimate, interval, p, shares or verdict differ between doors"
    yield "doors.differences", sum(apart), "1", note


def _doors_agree(i: int) -> bool:
    rng = np.random.default_rng([SEED, 77, i])
    people, ordered = 12 + i % 5, i % 2 == 0
    changes = MARGIN.high * (rng.uniform(-1.2, 1.2) + rng.uniform(0.1, 0.6) * rng.standard_normal(people))
    first = np.arange(people) < people // 2 + 2
    later = np.where(first, 1.0, -1.0)
    changes = changes + ordered * 0.5 * MARGIN.high * later
    with TemporaryDirectory() as place:
        folder = Path(place)
        case = "periods" if ordered else "plain"
        _write_study(folder, case, changes, first, 0.1 * rng.standard_normal(people), movements=4)
        whole = pl.assess(open_study(folder), studies=5)
        by_command = _figures_of_command(folder)
    table = whole.assessed["vmax"].table
    rows = {
        "participant": [m.participant for m in whole.measured], "condition": [m.condition for m in whole.measured],
        "direction": [m.cell[1] for m in whole.measured], "vmax": [m.values["vmax"] for m in whole.measured],
    }  # fmt: skip
    if ordered:
        place_of = {f"P{k}": {"free": 1 if first[k] else 2, "robot": 2 if first[k] else 1} for k in range(people)}
        rows["period"] = [place_of[p][c] for p, c in zip(rows["participant"], rows["condition"], strict=True)]
    stated = {"control": "free", "factors": ["direction"], "margins": {"vmax": "10 %"}}
    if ordered:
        stated |= {"design": "AB/BA", "period": "period"}
    by_table = pl.assess(rows, control="free", factors=["direction"], margins={"vmax": 0.10})
    of_movements = [whole.certified[0].certificate, by_table.certificates["robot"], pl.certify(rows, analysis=stated)]
    numbers = [by_command[1:], *map(_numbers_of, of_movements)]
    own = later[[int(person[1:]) for person in table.participants]] if ordered else None
    by_arrays = pl.certify({"vmax": (table.column("free"), table.column("robot"))}, {"vmax": 0.10}, later=own)
    means = {
        "participant": [*table.participants] * 2, "condition": ["free"] * people + ["robot"] * people,
        "vmax": [*table.column("free"), *table.column("robot")],
    }  # fmt: skip
    if ordered:
        means["period"] = [place_of[p][c] for p, c in zip(means["participant"], means["condition"], strict=True)]
    of_people = [by_arrays, pl.assess(means, control="free", margins={"vmax": 0.10}).certificates["robot"]]
    return (
        all(np.allclose(each, numbers[0], rtol=1e-9) for each in numbers)
        and {each.verdict for each in of_movements} == {by_command[0]}
        and np.allclose(*map(_numbers_of, of_people), rtol=1e-9)
        and of_people[0].verdict == of_people[1].verdict
    )


def _figures_of_command(folder: Path) -> tuple:
    """Return the verdict of ``pellucid assess`` on a study, and its numbers in the order of `_numbers_of`."""
    from pellucid.cli import app

    done = CliRunner().invoke(app, ["assess", str(folder), "--studies", "100"])
    if done.exit_code > 1:
        raise RuntimeError(f"pellucid assess failed on a study: {done.output[-2000:]}")
    figures = json.loads((folder / "results.json").read_text(encoding="utf-8"))["figures"]
    rows = {row["id"].partition(".certificate.robot.")[2]: row for row in figures}
    value = {name: row["value"] for name, row in rows.items() if name}
    logs = [float(np.log1p(value[f"vmax.{name}"] / 100.0)) for name in ("change", "low", "high")]
    shares = [value[f"vmax.{name}"] / 100.0 for name in ("share_within", "share_far")]
    return rows["transparent"]["note"], *logs, value["vmax.p_within"], value["vmax.p_beyond"], *shares


def _numbers_of(found: Certificate) -> tuple[float, ...]:
    own, shares = found.end_points["vmax"], found.share_test("vmax")
    assert shares is not None
    return (own.estimate, *own.interval, own.p_within, own.p_beyond, shares.least_within, shares.most_far)


def _write_study(
    folder: Path, case: str, changes: np.ndarray, first: np.ndarray, paces: np.ndarray, movements: int = 10
) -> None:
    told = ['name = "made"', "[rig]", 'joint = "elbow"', 'motion = "rotary"', 'lifts = "flexion"', "[channels]"]
    told += [f'{c} = {{ column = "{c}", unit = "{u}" }}' for c, u in
             (("time", "s"), ("position", "rad"), ("target", "rad"))]  # fmt: skip
    # Other filters and thresholds change no certificate, and take most of the time.
    told += ["[assessment]", 'control = "free"', 'cutoffs = ["3 Hz"]', "thresholds = [0.05]"]
    told += [f"looks = {list(LOOK_SHARES)}", f"look = {LOOKS[case]}"] if case in LOOKS else []
    told += ["[assessment.margins]", 'vmax = "10 %"']
    for i, change in enumerate(changes):
        told += [f"[participants.P{i}]", 'mass = "70 kg"']
        pace = float(np.exp(paces[i]))
        for condition, factor in (("free", 1.0), ("robot", float(np.exp(change)))):
            if case == "lost_people" and i < 4 and condition == "robot":
                continue
            few = case == "missing_few" and i == 2 and condition == "robot"
            gaps = 1 if few else 3 if case == "missing_many" and condition == "robot" else 0
            name = f"P{i}_{condition}"
            _write_recording(folder / f"{name}.csv", 1.2 / pace / factor, gaps, movements)
            told += ["[[recordings]]", f'name = "{name}"', f'file = "{name}.csv"', f'participant = "P{i}"']
            told += [f'condition = "{condition}"']
            if case in FIRST_COUNTS:
                told.append(f"period = {1 if (condition == 'free') == first[i] else 2}")
    (folder / "study.toml").write_text("\n".join(told) + "\n", encoding="utf-8")


def _write_recording(path: Path, duration: float, gaps: int, movements: int = 10, rate: float = 100.0) -> None:
    """Write movements of minimum jerk between two targets; the angle is missing in the first `gaps` of them."""
    pause = 1.0
    time = np.arange(0.0, pause + movements * (duration + 0.3 + pause), 1.0 / rate)
    angle, target = np.zeros(len(time)), np.zeros(len(time))
    for k in range(movements):
        start, sign = pause + k * (duration + 0.3 + pause), 1.0 if k % 2 == 0 else -1.0
        s = np.clip((time - start - 0.3) / duration, 0.0, 1.0)
        angle += sign * AMPLITUDE * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        target[time >= start] += sign * AMPLITUDE
        if k < gaps:
            inside = (time > start + 0.3 + 0.3 * duration) & (time < start + 0.3 + 0.7 * duration)
            angle[inside] = np.nan
    with path.open("w", encoding="utf-8") as file:
        file.write("time,position,target\n")
        for row in zip(time, angle, target, strict=True):
            file.write(",".join("" if np.isnan(x) else f"{x:.6g}" for x in row) + "\n")
