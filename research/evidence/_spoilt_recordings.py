"""Sixteen more ways of spoiling recordings: each must be named, or leave what is found right; none may be silent.

The joint is integrated here with bristle friction and a torque loop, and the arm of two links by its own equations of
motion, so that nothing of the package simulates what it identifies. The arm shares the package's rigid bodies and its
shape of friction. A case is right if inertia, weight and friction stay within `PARAMETER_TOLERANCE_SHARE` of the sound
recordings' fit, or within two standard errors; it is named if a message that the sound recordings do not cause has the
case's words. A case that is neither is silent.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pellucid._errors import PellucidError
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

SEED = 281126
"""Seed of every random draw. No threshold was set on it."""

PARAMETER_TOLERANCE_SHARE = 0.05
"""Relative change of inertia, weight and friction up to which a fit counts as right."""

CASE_COUNT = sized(None, smallest=2)
"""Number of cases that are tried; None for all."""

RATE = 250.0
"""Sampling rate of the joint's recordings [Hz]."""

DURATION_S = 20.0
"""Duration of a recording [s]."""

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Machine:
    """A joint with bristle friction."""

    inertia: float = 0.06  # [kg m^2]
    weight: float = 1.6  # [N m]
    level: float = 0.15  # level of friction [N m]
    viscous: float = 0.08  # [N m s/rad]


def _noise(rng: np.random.Generator, x: np.ndarray, share: float) -> np.ndarray:
    return x + share * x.std() * rng.standard_normal(len(x))


def _path(kind: int, t: np.ndarray) -> np.ndarray:
    """Return the path that a recording follows: sums of sines with other frequencies for each kind."""
    sizes, rates = (0.55, 0.3, 0.12), np.array((0.31, 0.83, 1.9)) * (1.0 + 0.13 * kind)
    return sum(
        a * np.sin(2.0 * np.pi * f * t + 1.3 * kind + k) for k, (a, f) in enumerate(zip(sizes, rates, strict=True))
    )


def record(
    rng: np.random.Generator,
    path: Callable[[np.ndarray], np.ndarray],
    machine: Machine = Machine(),
    *,
    rate: float = RATE,
    friction: Callable[[float], float] = lambda time: 1.0,
) -> Columns:
    """Return time, position, torque and its command of a joint that follows a path."""
    t = np.arange(int(DURATION_S * rate)) / rate
    wanted = path(t)
    speed = np.gradient(wanted, t)
    substeps = int(np.ceil(5000.0 / rate))
    step = 1.0 / (rate * substeps)
    q, v, z, torque = float(wanted[0]), float(speed[0]), 0.0, 0.0
    made = np.empty((len(t), 3))
    for k in range(len(t)):
        asked = 40.0 * (wanted[k] - q) + 3.0 * (speed[k] - v) + machine.weight * np.sin(q)
        made[k] = q, torque, asked
        level = machine.level * friction(float(t[k]))
        for _ in range(substeps):
            torque += step / 0.002 * (asked - torque)
            z += step * (v - 300.0 * abs(v) * z)
            drag = level * 300.0 * z + machine.viscous * v
            v += step * (torque - drag - machine.weight * np.sin(q)) / machine.inertia
            q += step * v
    q = np.round(made[:, 0] / (2.0 * np.pi / 65536.0)) * (2.0 * np.pi / 65536.0)
    return {"t": t, "q": q, "u": _noise(rng, made[:, 1], 0.02), "c": made[:, 2]}


JOINT_STUDY = """\
name = "joint"

[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"

[rig.drive]
kind = "torque"

[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "u", unit = "N*m" }
"""

PROCESSING = """
[processing]
lowpass = "10 Hz"
decimate = 5
trim = 30
dead_band = "0.05 rad/s"

[model]
gravity = "sine"
"""


@dataclass(frozen=True)
class Case:
    """One way of spoiling a study of a joint."""

    words: str  # regular expression of what names it
    spoil: Callable[[np.random.Generator, list[Columns]], list[Columns]]
    channels: str = ""  # more lines of [channels]
    truth: Machine = field(default_factory=Machine)
    must_be_right: bool = False  # nothing is wrong: a refusal or an alarm is a failure, however it is worded


def _garbage(head: bool) -> Callable[[np.random.Generator, list[Columns]], list[Columns]]:
    def spoil(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
        count = 9
        wild = {name: 10.0 ** rng.uniform(20.0, 290.0, count) for name in files[0]}
        files[0] = {n: np.concatenate([wild[n], x] if head else [x, wild[n][::-1]]) for n, x in files[0].items()}
        return files

    return spoil


def _packets(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    for i, columns in enumerate(files):
        n = len(columns["t"])
        rows = np.sort(np.append(np.arange(n), rng.choice(n, n // 50, replace=False)))
        arrival = (rows // 6 + 1) * 6 / RATE
        within = np.arange(len(rows)) - np.searchsorted(rows // 6, rows // 6)
        files[i] = {name: x[rows] for name, x in columns.items()} | {"t": arrival + 1e-4 * within}
    return files


def _dead_torque(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    files[0]["u"][len(files[0]["u"]) // 2 :] = 0.0
    return files


def _echoed(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    for columns in files:
        late = np.roll(columns["c"], 18)
        late[:18] = late[18]
        columns["u"] = _noise(rng, late, 0.005)
    return files


def _worn(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    for columns in files:
        t = columns["t"]
        cadence = 0.95 + 0.1 * np.interp(t, np.linspace(0.0, t[-1], 9), rng.standard_normal(9))
        phase = 2.0 * np.pi * np.cumsum(cadence) / RATE
        columns["q"] = 0.4 * np.sin(phase) + 0.1 * np.sin(2.0 * phase + 1.1) + 0.03 * np.sin(3.0 * phase)
        help_up = 4.0 * np.exp(2.2 * (np.cos(phase - 2.1) - 1.0))
        columns["u"] = _noise(rng, help_up - 3.0 * np.exp(3.0 * (np.cos(phase + 1.2) - 1.0)), 0.03)
    return files


def _dwell(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    def path(t: np.ndarray) -> np.ndarray:
        k = (t / 2.0).astype(int)
        s = np.clip((t - 2.0 * k) / 0.7, 0.0, 1.0)
        places = np.array([-0.6, 0.8, -0.6, 0.8, 0.1, 0.8, -0.6, 0.4, 0.8, -0.6, 0.8, -0.6])
        return places[k] + (places[k + 1] - places[k]) * (10 * s**3 - 15 * s**4 + 6 * s**5)

    files[0] = record(rng, path)
    return files


def _tumbling(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    files[0] = record(rng, lambda t: 1.6 * t + 0.9 * np.sin(2.4 * t))
    return files


def _flicker(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    n = len(files[0]["t"])
    held = {"t": files[0]["t"], "q": 0.5 + 1e-4 * (rng.random(n) < 0.02)}
    weight = Machine().weight * np.sin(0.5)
    held |= {"u": weight + 0.01 * rng.standard_normal(n), "c": np.full(n, weight)}
    return [*files, held]


def _unstated_payload(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    loaded = Machine(inertia=Machine().inertia + 0.05, weight=Machine().weight + 1.5)
    files[2] = record(rng, lambda t: _path(2, t), loaded)
    return files


def _hot_and_cold(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    for k in (0, 1):
        files[k] = record(rng, lambda t, k=k: _path(k, t), friction=lambda time: 3.0 * np.exp(-time / 8.0) + 0.6)
    return files


def _two_machines(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    files[1] = record(rng, lambda t: _path(1, t), Machine(0.09, 2.4, 0.35, 0.2))
    return files


def _mixed_rates(rng: np.random.Generator, files: list[Columns]) -> list[Columns]:
    files[1] = record(rng, lambda t: _path(1, t), rate=500.0)
    return files


JOINT_CASES = {
    "garbage_head": Case("garbage", _garbage(head=True)),
    "garbage_tail": Case("garbage", _garbage(head=False)),
    "packet_clock_with_duplicates": Case("repeat|jitter|packet", _packets),
    "dead_torque": Case("dead|constant|the one value", _dead_torque),
    "echoed_command": Case("its own command", _echoed, 'desired_torque = { column = "c", unit = "N*m" }\n'),
    "worn_robot": Case("wear", _worn),
    "dwell": Case("rest|dwell", _dwell, must_be_right=True),
    "tumbling": Case("turns", _tumbling, must_be_right=True),
    "flicker_of_the_last_digit": Case("rest|posture|held", _flicker, must_be_right=True),
    "unstated_payload_in_one_of_five": Case(r"file2|recording r2|\br2\b", _unstated_payload),
    "hot_and_cold": Case("drift|contradict|disagree|differ|warm", _hot_and_cold),
    "two_machines": Case(r"file1|\br1\b|contradict|disagree", _two_machines),
    "mixed_rates": Case("rate", _mixed_rates, must_be_right=True),
}
"""Cases of one joint, recorded five times."""


ARM_URDF = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 -0.15"/><mass value="2.0"/>
<inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><origin xyz="0 0 -0.12"/><mass value="1.2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="50" velocity="10"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="50" velocity="10"/></joint>
</robot>
"""
"""A planar arm of two links that hang at zero, as its maker describes it."""

ARM_STUDY = """\
name = "arm"

[tree]
urdf = "arm.urdf"
velocity_width = "0.02 rad/s"

[rig]

[[rig.joints]]
name = "shoulder"
motion = "rotary"
[rig.joints.drive]
kind = "torque"

[[rig.joints]]
name = "elbow"
motion = "rotary"
[rig.joints.drive]
kind = "torque"

[channels]
time = { column = "t", unit = "s" }
position.shoulder = { column = "q1", unit = "rad" }
position.elbow = { column = "q2", unit = "rad" }
torque.shoulder = { column = "u1", unit = "N*m" }
torque.elbow = { column = "u2", unit = "N*m" }

[processing]
lowpass = "10 Hz"
decimate = 5
trim = 30
dead_band = "0.03 rad/s"
"""


def record_arm(rng: np.random.Generator, kind: int) -> Columns:
    """Return time, angles and torques of the arm along a path; the bodies are those of `ARM_URDF`, 10 % heavier."""
    t = np.arange(int(DURATION_S * RATE)) / RATE
    q = [0.8 * _path(kind, t), 0.9 * _path(kind + 3, t)]
    v, a = ([np.gradient(x, t) for x in q], [])
    a = [np.gradient(x, t) for x in v]
    m1, m2, l1, c1, c2, i1, i2, g = 2.2, 1.3, 0.3, 0.16, 0.13, 0.022, 0.012, 9.81
    cross = m2 * l1 * c2
    m12 = i2 + m2 * c2**2 + cross * np.cos(q[1])
    m11 = i1 + m1 * c1**2 + m2 * l1**2 + m12 + cross * np.cos(q[1])
    h = -cross * np.sin(q[1])
    weight = m2 * c2 * g * np.sin(q[0] + q[1])
    u1 = m11 * a[0] + m12 * a[1] + h * (2.0 * v[0] * v[1] + v[1] ** 2) + (m1 * c1 + m2 * l1) * g * np.sin(q[0]) + weight
    u2 = m12 * a[0] + (i2 + m2 * c2**2) * a[1] - h * v[0] ** 2 + weight
    u1 = u1 + 0.3 * np.tanh(v[0] / 0.02) + 0.2 * v[0]
    u2 = u2 + 0.2 * np.tanh(v[1] / 0.02) + 0.1 * v[1]
    return {"t": t, "q1": q[0], "q2": q[1], "u1": _noise(rng, u1, 0.01), "u2": _noise(rng, u2, 0.01)}


@dataclass(frozen=True)
class ArmCase:
    """One way of spoiling a study of the arm."""

    words: str  # regular expression of what names it
    spoil: Callable[[Columns], Columns]


ARM_CASES = {
    "missing_joint": ArmCase("u2|torque.elbow", lambda columns: {n: x for n, x in columns.items() if n != "u2"}),
    "wrong_gear_at_one_joint": ArmCase(
        r"gear|gain|scale|times as|factor|turns", lambda columns: columns | {"u2": 1.7 * columns["u2"]}
    ),
    "swapped_joints": ArmCase(
        r"swap|sign|oppose|other joint|turned around|exchang",
        lambda columns: columns | {"u1": columns["u2"], "u2": columns["u1"]},
    ),
}
"""Cases of an arm with two joints, recorded twice."""


def _write_arm(folder: Path, files: list[Columns]) -> Path:
    folder.mkdir(parents=True)
    (folder / "arm.urdf").write_text(ARM_URDF, encoding="utf-8")
    entries = ""
    for k, columns in enumerate(files):
        _write_table(folder / f"file{k}.csv", columns)
        entries += f'\n[[recordings]]\nname = "r{k}"\nfile = "file{k}.csv"\nuse = "{"validate" if k else "fit"}"\n'
    (folder / "study.toml").write_text(ARM_STUDY + entries, encoding="utf-8")
    return folder


def _write_table(path: Path, columns: Columns) -> None:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")


def _write_joint(folder: Path, files: list[Columns], channels: str) -> Path:
    folder.mkdir(parents=True)
    entries = ""
    for k, columns in enumerate(files):
        _write_table(folder / f"file{k}.csv", columns)
        entries += f'\n[[recordings]]\nname = "r{k}"\nfile = "file{k}.csv"\nuse = "fit"\n'
    (folder / "study.toml").write_text(JOINT_STUDY + channels + PROCESSING + entries, encoding="utf-8")
    return folder


Outcome = tuple[dict[str, tuple[float, float]], list[str], bool]
"""Parameters with their standard errors, printed messages, and whether the study was rejected."""


def _tried(folder: Path) -> Outcome:
    said: list[str] = []
    try:
        study = open_study(folder)
        faults = check(study)
        said += [fault.message for fault in faults]
        if any(fault.severity == "refuse" for fault in faults):
            return {}, said, True
        result = identify(study, families=["symmetric"], thorough=False) if study.name == "joint" else identify(study)
    except PellucidError as error:
        return {}, [*said, *str(error).splitlines()], True
    said += [result.headline, *(f"{verdict.text} {verdict.do}" for verdict in result.verdicts)]
    found = {n: (p.value, p.standard_error) for n, p in result.estimates.items() if "." not in n and p.identifiable}
    return found, said, False


def _without_numbers(line: str) -> str:
    return re.sub(r"[-+]?\d[\d.e+-]*", "#", line)


def _named(words: str, said: list[str], quiet: set[str]) -> bool:
    """Whether a line that the sound study does not have says the words."""
    return any(re.search(words, line, re.I) for line in said if _without_numbers(line) not in quiet)


def _is_right(found: dict[str, tuple[float, float]], clean: dict[str, tuple[float, float]]) -> bool:
    names = [name for name in ("inertia", "gravity", "coulomb", "viscous") if name in clean]
    return bool(names) and all(
        name in found
        and abs(found[name][0] - clean[name][0])
        <= max(PARAMETER_TOLERANCE_SHARE * abs(clean[name][0]), 2.0 * np.hypot(found[name][1], clean[name][1]))
        for name in names
    )


def rows() -> Iterator[ResultRow]:
    """How many cases were tried, how many are neither named nor right, and what came of each."""
    made: list[ResultRow] = []
    silent = 0

    def row(name: str, value: float | None, note: str) -> ResultRow:
        return ResultRow(f"truth.spoilt.{name}", value, "1", "evidence", "fitted", None, note)

    with tempfile.TemporaryDirectory() as place:
        rng = np.random.default_rng(SEED)
        sound = [record(rng, lambda t, k=k: _path(k, t)) for k in range(5)]
        clean, quiet_lines, _ = _tried(_write_joint(Path(place, "sound"), sound, ""))
        quiet = {_without_numbers(line) for line in quiet_lines}
        for name, case in list(JOINT_CASES.items())[:CASE_COUNT]:
            files = case.spoil(rng, [{n: x.copy() for n, x in columns.items()} for columns in sound])
            found, said, refused = _tried(_write_joint(Path(place, name), files, case.channels))
            named, right = _named(case.words, said, quiet), _is_right(found, clean)
            good = right if case.must_be_right else named or right
            silent += not good
            what = [
                "refused" if refused else "fitted",
                "named" if named else "not named",
                "right" if right else "not right",
            ]
            made.append(row(f"case.{name}", float(good), "; ".join(what)))
        arm = [record_arm(rng, kind) for kind in (0, 5)]
        _, quiet_lines, _ = _tried(_write_arm(Path(place, "sound_arm"), arm))
        quiet = {_without_numbers(line) for line in quiet_lines}
        for name, case in list(ARM_CASES.items())[:CASE_COUNT]:
            found, said, refused = _tried(_write_arm(Path(place, name), [case.spoil(columns) for columns in arm]))
            named = _named(case.words, said, quiet)
            silent += not named
            made.append(
                row(
                    f"case.{name}",
                    float(named),
                    f"{'refused' if refused else 'fitted'}; {'' if named else 'not '}named",
                )
            )
    yield row("count", float(len(made)), "ways of spoiling recordings, each on a joint or an arm simulated here")
    yield row("silent", float(silent), "neither named nor right")
    yield from made
