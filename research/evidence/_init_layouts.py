"""Results of `init --from --yes` on real layouts: channels, roles and units compared with hand-written templates.

The truth of a layout is its template in the package, or, of the layouts without one, what its README says. A channel is
right if study.toml gives its column that role and that unit. A fact that no file states, such as a load cell's unit or
a
missing clock's rate, cannot be right: such a channel counts as right only if its line says ASKED, and these are counted
apart. A wrong unit is one in silence if its line is not marked.

Further layouts come from a separate generator (`tests/unit/made_layouts.py`): joints simulated in plain NumPy, not by
the core. They have their own rows, since the rules of inference were corrected on them, as on the public ones.
"""

from __future__ import annotations

import importlib.util
import os
import re
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pellucid.files.stated_units import split_unit
from pellucid.start.given_files import read_given
from pellucid.start.proposal import Proposal
from pellucid.start.propose_study import propose_study
from pellucid.start.study_text import study_text
from pellucid.study.datasets.registry import template
from pellucid.study.results import ResultRow
from pellucid.units import to_si_factor

UNIT_TOLERANCE = 1e-6
"""Units are equal if their factors to SI are within this of each other, relative."""


@dataclass(frozen=True)
class TrueChannel:
    """What a column is."""

    column: str
    role: str | None  # role, as `role_of` gives it; None if any name will do
    factor: float | None  # SI per stored number; None if it is not judged
    offset_unit: str = ""  # dimension, as an SI text
    is_unknowable: bool = False  # whether no file states the unit, or the rate


@dataclass(frozen=True)
class TrueLayout:
    """A layout with its files and what they hold."""

    name: str
    files: tuple[Path, ...]
    channels: tuple[TrueChannel, ...]


@dataclass
class LayoutScore:
    """How a proposal compares with the truth of a layout."""

    name: str
    right: int = 0
    count: int = 0
    asked: int = 0  # right ones whose fact no file states, which was asked
    silent: list[str] = field(default_factory=list)  # channels with a wrong unit without a mark
    wrong: list[str] = field(default_factory=list)
    questions: int = 0

    @property
    def is_right(self) -> bool:
        """Whether all channels of the layout are right."""
        return self.count > 0 and self.right == self.count


def role_of(channel: str) -> str:
    """Return the part of a channel's name that says its role: of an IMU its side and quantity and axis."""
    parts = channel.split(".")
    if len(parts) >= 3 and parts[-2] in ("acceleration", "angular_velocity", "orientation", "magnetic_field"):
        return ".".join(parts[-3:])
    return parts[0]


def flat_channels(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, Mapping[str, object]]]:
    """Yield the channels of a table of study.toml by their dotted names."""
    for key, value in table.items():
        if not isinstance(value, Mapping):
            continue
        if {"column", "rate", "value"} & set(value):
            yield f"{prefix}{key}", value
        else:
            yield from flat_channels(value, f"{prefix}{key}.")


def true_channels(text: str, unknowable: Sequence[str] = ()) -> tuple[TrueChannel, ...]:
    """Return the channels of a template; those named in `unknowable` have a fact that no file states."""
    study = tomllib.loads(text)
    tables = [study["channels"], *(stream["channels"] for stream in study.get("streams", {}).values())]
    found = []
    for table in tables:
        for name, entry in flat_channels(table):
            column = f"rate {entry['rate']}" if "rate" in entry else str(entry["column"])
            factor = (
                None if "rate" in entry else to_si_factor(str(entry["unit"]), None)[0] * float(entry.get("scale", 1.0))
            )
            found.append(TrueChannel(column, role_of(name), factor, is_unknowable=role_of(name) in unknowable))
    return tuple(found)


def score(layout: TrueLayout) -> tuple[LayoutScore, Proposal]:
    """Return how the proposal for a layout's files compares with its truth."""
    given = read_given(layout.files)
    proposal = propose_study(given, "proposed")
    used = (table for r in proposal.recordings for table in (r.table, *r.streams.values()))
    text = study_text(proposal, {id(table): f"recordings/{table.path.name}" for table in used})
    found = proposed_channels(text)
    result = LayoutScore(layout.name, questions=len(proposal.asked))
    for true in layout.channels:
        result.count += 1
        if true.column.startswith("rate "):
            _score_rate(true, found, result)
            continue
        # A unit in the header does not belong to the name of a column.
        candidates = [entry for entry in found if split_unit(entry[1])[0] == split_unit(true.column)[0]]
        roles = [entry for entry in candidates if true.role is None or entry[0] == true.role]
        if not roles and true.is_unknowable and any(entry[3] == "ASKED" for entry in candidates):
            result.right += 1
            result.asked += 1
            continue
        if not roles:
            got = ", ".join(entry[0] for entry in candidates) or "nothing"
            result.wrong.append(f"{true.column}: {got} for {true.role}")
            continue
        fitting = [e for e in roles if true.factor is None or abs(e[2] / true.factor - 1.0) < UNIT_TOLERANCE]
        marked = [e for e in roles if e[3]]
        if fitting and not true.is_unknowable:
            result.right += 1
        elif true.is_unknowable and (fitting or any(e[3] == "ASKED" for e in roles)):
            result.right += 1
            result.asked += 1
        else:
            result.wrong.append(f"{true.column}: {roles[0][4]} for a factor of {true.factor:g}")
            if not marked:
                result.silent.append(true.column)
    return result, proposal


def _score_rate(true: TrueChannel, found: Sequence[tuple[str, str, float, str, str]], result: LayoutScore) -> None:
    rates = [entry for entry in found if entry[0] == "time" and entry[1].startswith("rate ")]
    if not rates:
        result.wrong.append(f"{true.column}: no rate")
        return
    wanted = to_si_rate(true.column.removeprefix("rate "))
    fits = any(abs(to_si_rate(e[1].removeprefix("rate ")) / wanted - 1.0) < 1e-3 for e in rates)
    if fits and not true.is_unknowable:
        result.right += 1
    elif true.is_unknowable and all(e[3] == "ASKED" for e in rates):
        result.right += 1
        result.asked += 1
    else:
        result.wrong.append(f"{true.column}: {rates[0][1]}")
        if not any(e[3] for e in rates):
            result.silent.append("time")


def to_si_rate(text: str) -> float:
    """Return a rate such as "5 kHz" [Hz]."""
    number, _, unit = text.partition(" ")
    return float(number) * to_si_factor(unit, "Hz")[0]


def proposed_channels(text: str) -> list[tuple[str, str, float, str, str]]:
    """Return the channels of a proposed study.toml: role, column, SI per number, mark, and unit."""
    study = tomllib.loads(text)
    marks: dict[tuple[str, str], str] = {}
    for line in text.splitlines():
        match = re.match(r"(?:channels\.)?([\w.\"-]+) = (\{.*\})(?:  # (\w+):)?", line)
        if match:
            table = tomllib.loads(f"x = {match[2]}")["x"]
            column = f"rate {table['rate']}" if "rate" in table else str(table.get("column"))
            marks[match[1].replace('"', ""), column] = match[3] if match[3] in ("GUESS", "ASKED") else ""
    tables = [study["channels"], *(stream["channels"] for stream in study.get("streams", {}).values())]
    tables += [recording.get("channels", {}) for recording in study.get("recordings", [])]
    found = []
    for table in tables:
        for name, entry in flat_channels(table):
            if "unit" not in entry and "rate" not in entry:
                continue
            column = f"rate {entry['rate']}" if "rate" in entry else str(entry["column"])
            factor = (
                1.0 if "rate" in entry else to_si_factor(str(entry["unit"]), None)[0] * float(entry.get("scale", 1.0))
            )
            mark = marks.get((name, column), "")
            found.append((role_of(name), column, factor, mark, str(entry.get("unit", ""))))
    return found


def shared_layouts(data: Path) -> list[TrueLayout]:
    """Return the public layouts that are on this machine, below the folder `data`."""
    templates = {
        "emps": ("emps", "*.mat", ()),
        "sydney_pendulum": ("sydney_pendulum", "*.mat", ()),
        "bam_xl330": ("bam_xl330_pendulum", "2026*.json", ("duty",)),
        "dfjimu_two_imu_joint": ("dfjimu_two_imu_joint", "*.mat", ()),
        "lower_limb_walking": ("lower_limb_walking", "*.sto", ()),
        "modexo_joint": ("modexo_joint", "20170816-stepTorqueSoftware*.csv", ("torque", "position")),
        "nmsm_knee_emg": ("nmsm_knee_emg", "*Data", ()),
        "rat_soleus_hill": ("rat_soleus_hill", "*.dat", ()),
        # Its README alone says that currents are torques; a lab has the robot's file beside the recordings.
        "staubli_tx40": ("staubli_tx40", "*.[cu][sr][vd]*", ("time", "torque")),
        "uci_lower_limb": ("uci_lower_limb", "[0-9]*.txt", ()),
        "ur10e": ("ur10e", "*.csv", ()),
    }
    found = []
    for name, (folder, pattern, unknowable) in templates.items():
        files = tuple(sorted((data / folder).glob(pattern)))
        if files:
            found.append(TrueLayout(name, files, true_channels(template(name).read_text(encoding="utf-8"), unknowable)))
    return [*found, *_read_layouts(data)]


def _read_layouts(data: Path) -> list[TrueLayout]:
    """Return the layouts without a template, with what their READMEs say of them."""
    deg, unknown = to_si_factor("deg", "rad")[0], {"is_unknowable": True}
    emg = ["rectabd_r", "rectabd_l", "iliocost_r", "iliocost_l", "longlumb_r", "longlumb_l", "longthor_r", "longthor_l"]
    layouts = {
        "elbow_exosuit": (
            "*_threshold/P*/*.csv",
            (
                TrueChannel("rate 100 Hz", "time", None, **unknown),
                TrueChannel("Desired_Position_deg", "reference", deg),
                TrueChannel("Applied_Torque_Nm", "torque", 1.0),
                TrueChannel("Position_Error_rad", None, 1.0),
                TrueChannel("K_value_Nm_per_rad", None, 1.0),
                TrueChannel("B_value_Nm_per_rad_per_s", None, 1.0),
                TrueChannel("Feedback_Torque_Nm", None, 1.0),
            ),
        ),
        "elderly_isometric": (
            "ID [13].xlsx",
            (
                TrueChannel("rate 2000 Hz", "time", None, **unknown),
                TrueChannel("DNM.0", "force", None, **unknown),
                *(TrueChannel(f"EMG_VL.{i}", "emg", 1e-6, **unknown) for i in range(4)),
            ),
        ),
        "lumbar_lifting": (
            "*/*.sto",
            (
                TrueChannel("time", "time", 1.0),
                TrueChannel("L5_S1_Flex_Ext", "angle", 1.0),
                TrueChannel("L5_S1_Flex_Ext", "moment", 1.0),
                *(TrueChannel(name, "emg", 1.0) for name in emg),
            ),
        ),
        "human_pointing": (
            "P1_*.csv",
            (TrueChannel("Time (in s)", "time", 1.0), TrueChannel("X screen corrected (mm)", "position", 1e-3)),
        ),
        "hug_mp": (
            "S01_trajs.mat",
            (
                TrueChannel("rate 100 Hz", "time", None, **unknown),
                *(TrueChannel(f"tasks.0.0.0.{i}", None, deg) for i in range(4)),
            ),
        ),
    }
    found = []
    for name, (pattern, channels) in layouts.items():
        files = tuple(sorted((data / name).glob(pattern)))
        if files:
            found.append(TrueLayout(name, files, channels))
    return found


def rows() -> Iterator[ResultRow]:
    """Yield how many of the layouts are right, wrong units in silence, and the most questions."""
    # Libraries that run in a process of their own have as long as a busy machine needs.
    os.environ.setdefault("PELLUCID_MOST_SECONDS", "120")
    data = Path(os.environ.get("PELLUCID_DATA", ""))
    scores = [score(layout)[0] for layout in shared_layouts(data)] if data.is_dir() else []
    yield from _rows("formats.init", scores, "public recordings; truth: hand-written templates and READMEs")
    yield from _rows("formats.init.made", made_scores(), "layouts written by a generator: numbers, preambles, clocks")


def made_scores() -> list[LayoutScore]:
    """Return the scores of the layouts that the tests' generator writes."""
    place = Path(__file__).parents[2] / "tests" / "unit" / "made_layouts.py"
    spec = importlib.util.spec_from_file_location("made_layouts", place)
    if spec is None or spec.loader is None or not place.is_file():
        return []
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    scores = []
    for make in module.LAYOUTS:
        with tempfile.TemporaryDirectory() as folder:
            made = make(Path(folder))
            channels = [TrueChannel(column, role, factor) for column, (role, factor) in made.channels.items()]
            if made.rate is not None:
                channels.append(
                    TrueChannel(f"rate {made.rate:g} Hz", "time", None, is_unknowable=made.rate_is_unknowable)
                )
            scores.append(score(TrueLayout(made.name, made.files, tuple(channels)))[0])
    return scores


def _rows(prefix: str, scores: Sequence[LayoutScore], what: str) -> Iterator[ResultRow]:
    if not scores:
        yield ResultRow(f"{prefix}.layouts", 0, "1", "evidence", "heldout", note="PELLUCID_DATA names no folder")
        return
    wrong = "; ".join(f"{s.name}: {', '.join(s.wrong[:3])}" for s in scores if s.wrong)
    channels, right = sum(s.count for s in scores), sum(s.right for s in scores)
    asked = sum(s.asked for s in scores)
    silent = [f"{s.name}: {name}" for s in scores for name in s.silent]
    made = (
        ("layouts", len(scores), "1", what),
        ("right", 100.0 * sum(s.is_right for s in scores) / len(scores), "%",
            f"layouts with every channel right; not: {wrong or 'none'}"),
        ("channels", channels, "1",
            f"evaluated channels; for {asked} of them the user was asked, because no file states the fact"),
        ("channels_right", 100.0 * right / channels, "%", "channels with the right column, role and unit"),
        ("wrong_unit_in_silence", len(silent), "1", "; ".join(silent[:8]) or "none"),
        ("questions.most", max(s.questions for s in scores), "1", "most questions of a layout"),
    )  # fmt: skip
    for name, value, unit, note in made:
        yield ResultRow(f"{prefix}.{name}", value, unit, "evidence", "heldout", note=note)
