"""EMG files in vendors' layouts, clean and spoilt, through every door of the product.

Two files of each layout are made from motor units (`_emg_signals.py`) and written by hand (`_emg_layouts.py`). `init`
names rate and muscles of each. Each file is then spoilt in every way that its layout can hold, and `audit` and
`emg_quality` examine every one, `check` a few of each layout in turn. A maximal contraction and a second recording of
the same session, where a spoiling needs one, are written in the same layout.

The layouts and checks were looked at on the seeds of `TUNED_SEED`; the figures are of `SEED`.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import pellucid as pl
from pellucid._errors import UnfitRecordingError
from pellucid.emg.signals.emg_findings import FINDING_KINDS
from pellucid.emg.signals.emg_onset import activations
from pellucid.emg.signals.emg_quality import FINDING_FAULTS
from pellucid.files.readers import read_columns
from pellucid.start.given_files import read_given
from pellucid.start.init_from_files import ProposedStudy, make_study, propose_with_answers
from pellucid.study.datasets.registry import path as data_set
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

from ._emg_layouts import LAYOUTS, EmgLayout
from ._emg_signals import MUSCLES, EmgRecording, maximal_emg, repeated_emg, spoil, walking_emg

TUNED_SEED = 20261
"""Seed of the files that were looked at."""

SEED = 71_552_009
"""Seed of the files whose figures are reported."""

FILES_PER_LAYOUT = sized(2, smallest=1)
USED_LAYOUTS = sized(LAYOUTS, smallest=LAYOUTS[:2])
SPOILINGS = tuple(kind for kind in FINDING_KINDS if kind != "envelope")
"""Kinds of findings that spoil raw EMG; an envelope is no spoilt recording but another signal."""
CHECKED_SPOILINGS = 1
"""Spoilings of each file, by turns, that `check` examines too."""

RATES_HZ = (1000.0, 2000.0, 1925.926, 2148.148)
WHOLE_RATES = ("edf", "edf_two_rates", "bdf", "bdf_two_rates", "bids", "opensignals", "cometa_c3d", "c3d_markers",
               "c3d_emg_labels")  # fmt: skip
"""Layouts that hold whole rates alone."""

SECONDS = 10.0
ONSET_RECORDINGS = sized(20, smallest=1)
ONSET_SPOILINGS = ("motion", "heartbeat", "mvc_artefact", "mains", "dropout", "saturation")
RATE_TOLERANCE = 5e-3

Named = frozenset[tuple[int, str]]
"""Number of the channel, -1 for the clock, and kind of each finding."""


@dataclass
class FileScore:
    """What the doors say of the files of one seed."""

    files: int = 0
    opened: list[bool] = field(default_factory=list)
    right: list[bool] = field(default_factory=list)
    clean: list[bool] = field(default_factory=list)
    named: dict[str, list[bool]] = field(default_factory=dict)
    differ: int = 0
    compared: int = 0
    complaints: list[str] = field(default_factory=list)

    def add(self, other: FileScore) -> None:
        """Add what the doors say of other files."""
        self.files += other.files
        self.differ += other.differ
        self.compared += other.compared
        for name in ("opened", "right", "clean", "complaints"):
            getattr(self, name).extend(getattr(other, name))
        for kind, each in other.named.items():
            self.named.setdefault(kind, []).extend(each)


def files_rows() -> Iterator[ResultRow]:
    """Yield the figures of files, of onsets under spoilings, and of the number of synergies."""
    score = judge_files(SEED)

    def row(name: str, value: float, unit: str, note: str) -> ResultRow:
        return ResultRow(f"emg.files.{name}", value, unit, "evidence", "heldout", None, note)

    said = f"{len(USED_LAYOUTS)} layouts, seed {SEED}"
    yield row("count", score.files, "1", f"EMG files of {said}")
    words = f"of clean and spoilt files, read or refused in words; {said}"
    yield row("opened_or_refused", _percent(score.opened), "%", words)
    words = f"files of which init finds rate, every muscle, side and unit; {said}"
    yield row("right", _percent(score.right), "%", words)
    every = [one for each in score.named.values() for one in each]
    yield row("spoiling_named", _percent(every), "%", f"of {len(every)} spoilt files, in audit; {said}")
    for kind, each in score.named.items():
        yield row(f"spoiling_named.{kind}", _percent(each), "%", f"of {len(each)} files")
    yield row("clean_sound", _percent(score.clean), "%", f"clean files without a finding, in audit; {said}")
    words = f"of {score.compared} files, audit, check or emg_quality name other channels or kinds than the others"
    yield row("doors_differ", score.differ, "1", words)
    yield from spoilt_onset_rows()
    yield from spread_rows()


def _percent(each: Sequence[bool]) -> float:
    return 100.0 * float(np.mean(each)) if each else float("nan")


# --- files -----------------------------------------------------------------------------------------------------------


def judge_files(seed: int, layouts: Sequence[EmgLayout] = USED_LAYOUTS, per: int = FILES_PER_LAYOUT) -> FileScore:
    """Return what the doors say of the files of a seed."""
    used = [(i, layout.name) for i, layout in enumerate(LAYOUTS) if layout in layouts]
    tasks = [(name, i * per + k, seed) for i, name in used for k in range(per)]
    score = FileScore()
    with ProcessPoolExecutor(max_workers=os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for each in pool.map(_judged_alone, tasks):
            score.add(each)
    return score


def _judged_alone(task: tuple[str, int, int]) -> FileScore:
    """Return what the doors say of one file and its spoilings."""
    name, number, seed = task
    score = FileScore()
    layout = next(each for each in LAYOUTS if each.name == name)
    with tempfile.TemporaryDirectory() as folder:
        _judge_file(score, layout, number, seed, Path(folder) / f"{name}_{number}")
    return score


def _judge_file(score: FileScore, layout: EmgLayout, number: int, seed: int, folder: Path) -> None:
    rng = np.random.default_rng([seed, number])
    rate = float(rng.choice(RATES_HZ[:2] if layout.name in WHOLE_RATES else RATES_HZ))
    muscles = tuple(rng.permutation(MUSCLES)[: int(rng.integers(4, 7))].tolist())
    person = int(rng.integers(1 << 30))
    clean = walking_emg(rng, rate, SECONDS, muscles, rng.uniform(0.95, 1.3), person)
    later = np.random.default_rng([seed, number, 1])
    second = walking_emg(later, rate, SECONDS, muscles, rng.uniform(0.95, 1.3), person)
    score.files += 1
    path = layout.written(folder / "clean", "walk01", clean)
    found = _audited(score, [path], layout, clean, f"{layout.name} clean")
    score.clean.append(found == frozenset())
    if found:
        score.complaints.append(f"{layout.name} {number} clean: {sorted(found)}")
    score.right.append(_is_right(score, folder / "study", path, layout, clean))
    kinds = [kind for kind in SPOILINGS if layout.fits(kind, number)]
    for j, kind in enumerate(kinds):
        base = maximal_emg(rng, rate, 6.0, muscles) if kind == "mvc_artefact" else second
        spoilt, channels = spoil(base, kind, rng, number)
        truth = frozenset((c, kind) for c in channels) or frozenset({(-1, kind)})
        stem = "mvc01" if kind == "mvc_artefact" else "walk02"
        paths = [layout.written(folder / kind, stem, spoilt)]
        beside = [clean] if kind == "exchanged" else []
        # A maximal contraction and an exchange need a recording of movement beside them.
        if kind in ("mvc_artefact", "exchanged"):
            paths = [layout.written(folder / kind, "walk01", clean), *paths]
        found = _audited(score, paths, layout, spoilt, f"{layout.name} {kind}")
        is_named = found is not None and truth <= found
        score.named.setdefault(kind, []).append(is_named)
        if not is_named:
            score.complaints.append(f"{layout.name} {number} {kind}: {sorted(truth)} for {sorted(found or ())}")
        if found is None:
            continue
        by_array = _by_array(spoilt, beside)
        said = {"audit": found, "emg_quality": by_array}
        if (j - number) % len(kinds) < CHECKED_SPOILINGS:
            said["check"] = _checked(score, folder / f"study_{kind}", paths, layout, spoilt)
        score.compared += 1
        if len({*said.values()}) > 1:
            score.differ += 1
            words = "; ".join(f"{door} {sorted(each or ())}" for door, each in said.items())
            score.complaints.append(f"{layout.name} {number} {kind}: doors differ: {words}")


def _audited(
    score: FileScore, paths: Sequence[Path], layout: EmgLayout, recording: EmgRecording, what: str
) -> Named | None:
    """Return the findings of EMG's kinds that `audit` has of the last of some files; None if it refuses them."""
    try:
        found = pl.audit(paths)
    except pl.PellucidError as error:
        score.opened.append(bool(str(error).strip()))
        score.complaints.append(f"{what}: refused: {error}")
        return None
    except Exception as error:  # a crash is what is counted
        score.opened.append(False)
        score.complaints.append(f"{what}: {type(error).__name__}: {error}")
        return None
    score.opened.append(True)
    named = set()
    emg = [v for v in found.verdicts if v.holds.startswith("emg")]
    for verdict in found.verdicts:
        own = [f for name, f in verdict.findings if Path(name).name == paths[-1].name or len(paths) == 1]
        index = emg.index(verdict) if verdict in emg else -1
        is_clock = verdict.holds.startswith("time") or verdict.channel == "time"
        kinds = {f.kind for f in own} & set(FINDING_KINDS)
        named |= {(index, kind) for kind in kinds if index >= 0 or (kind == "clock" and is_clock)}
    return frozenset(named)


def _by_array(recording: EmgRecording, beside: Sequence[EmgRecording]) -> Named:
    """Return the findings of `emg_quality` on the samples themselves."""
    more = {} if not beside else {"reference": beside[0].emg}
    found = pl.emg_quality(
        recording.emg * recording.stated_factor, rate=recording.rate, unit=recording.unit, time=recording.time, **more
    )
    return frozenset((one.channel if isinstance(one.channel, int) else -1, one.kind) for one in found)


CHECK_KINDS = {kind: name for name, (_, kind, _) in FINDING_FAULTS.items()} | {
    "mains_hum": "mains", "missing_samples": "dropout", "gap": "clock",
}  # fmt: skip
"""Kinds of faults of `check`, with the kind of the finding behind each."""


EXCLUDED_WORDS = {"time step": "clock", "gap": "clock"}
"""Words of the fault that excludes a recording for its clock, with the kind of the finding behind it."""


def _checked(
    score: FileScore, folder: Path, paths: Sequence[Path], layout: EmgLayout, recording: EmgRecording
) -> Named | None:
    """Return the findings of the last of some files that `check` has in the study that `init` makes of them."""
    names = [f"{m}_{side}".strip("_") for m, side in layout.muscles(recording)]
    try:
        faults = made_study(folder, paths).faults
    except UnfitRecordingError as error:
        faults = error.faults
    except pl.PellucidError as error:
        score.complaints.append(f"{layout.name}: init refused: {error}")
        return None
    found = set()
    for fault in faults:
        if Path(fault.file).name != paths[-1].name:
            continue
        words = (kind for word, kind in EXCLUDED_WORDS.items() if word in fault.message)
        kind = next(words, "") if fault.kind == "left_out" else CHECK_KINDS.get(fault.kind, fault.kind)
        muscle = fault.channel.removeprefix("emg.")
        if kind in FINDING_KINDS:
            found.add((names.index(muscle) if muscle in names else -1, kind))
    return frozenset(found)


def made_study(folder: Path, paths: Sequence[Path]) -> ProposedStudy:
    """Return the study that `init --from` makes of files, without its page."""
    proposal = propose_with_answers(read_given(paths), folder.name)
    return make_study(folder, proposal, with_page=False, page_folder=folder.with_name(f"{folder.name}_page"))


def _is_right(score: FileScore, folder: Path, path: Path, layout: EmgLayout, recording: EmgRecording) -> bool:
    """Return whether the study that `init` makes has each muscle with its side in volts, at the file's rate."""
    try:
        made_study(folder, [path])
    except pl.PellucidError as error:
        score.complaints.append(f"{layout.name}: init refused: {error}")
        return False
    wanted = {f"emg.{m}_{side}".strip("_") for m, side in layout.muscles(recording)}
    rates, got, sizes = set(), set(), []
    for each in open_study(folder).recordings():
        for stream in (each, *each.streams.values()):
            channels = {n: c for n, c in stream.channels.items() if n.startswith("emg.")}
            got |= set(channels)
            rates |= {float(stream.fs)} if channels else set()
            sizes += [float(np.std(c.samples)) if c.unit == "V" else float("nan") for c in channels.values()]
    usual = np.std(recording.emg, axis=0)
    is_sized = bool(sizes) and bool(0.3 * usual.min() < min(sizes) and max(sizes) < 3.0 * usual.max())
    is_timed = bool(rates) and all(abs(r / recording.rate - 1.0) < RATE_TOLERANCE for r in rates)
    if not (is_sized and is_timed and got == wanted):
        score.complaints.append(
            f"{layout.name} init: rates {rates} for {recording.rate:g}, size {is_sized}, {sorted(got - wanted)} for "
            f"{sorted(wanted - got)}"
        )
    return is_sized and is_timed and got == wanted


# --- onsets ----------------------------------------------------------------------------------------------------------


def spoilt_onset_rows(seed: int = SEED) -> Iterator[ResultRow]:
    """Yield the share of onsets that an interval covers or a stretch names, under each spoiling."""
    lowest = []
    for kind in ONSET_SPOILINGS:
        rng = np.random.default_rng([seed, ONSET_SPOILINGS.index(kind)])
        held: list[bool] = []
        for variant in range(ONSET_RECORDINGS):
            clean = repeated_emg(rng, 2000.0, 12.0, (str(rng.choice(MUSCLES)),))
            # An onset is not looked for where samples are missing: the function refuses them in words.
            spoilt, _ = spoil(clean, kind, rng, variant % 2)
            held += _onsets_held(spoilt)
        lowest.append(_percent(held))
        note = f"of {len(held)} onsets and extra bursts, covered by a 95 % interval, named or refused; seed {seed}"
        name = f"emg.onset.spoilt.covered_or_named.{kind}"
        yield ResultRow(name, lowest[-1], "%", "evidence", "heldout", None, note)
    note = f"lowest of {len(lowest)} spoilings"
    yield ResultRow(
        "emg.onset.spoilt.covered_or_named.lowest", min(lowest), "%", "evidence", "heldout", None, note
    )  # fmt: skip


def _onsets_held(recording: EmgRecording) -> list[bool]:
    """Return, of each true onset and each burst where no muscle worked, whether it is covered or named."""
    try:
        found = activations(recording.time, recording.emg[:, 0])
    except pl.PellucidError:
        # Hum that hides the contrast of rest and activity is refused in words, and no onset is stated.
        return [True] * len(recording.onsets[0])

    def is_named(at: float) -> bool:
        return any(one.start - 0.1 <= at <= one.end + 0.1 for one in found.doubtful)

    held = []
    for onset in recording.onsets[0]:
        held.append(any(b.onset.low <= onset <= b.onset.high for b in found.bursts) or is_named(onset))
    for burst in found.bursts:
        is_true = any(burst.onset.time < onset + 1.2 and burst.end.time > onset for onset in recording.onsets[0])
        if not is_true:
            held.append(is_named(burst.onset.time))
    return held


# --- synergies -------------------------------------------------------------------------------------------------------

STRETCHES = 6


def spread_rows(seed: int = SEED) -> Iterator[ResultRow]:
    """Yield how far the number of synergies of stretches of one steady walk lies from the most frequent one."""
    distances = {}
    for name, envelopes, rate in steady_walks(seed):
        numbers = stretch_numbers(envelopes, rate)
        usual = max(dict.fromkeys(numbers), key=numbers.count)
        distances[name] = max(abs(n - usual) for n in numbers)
        note = f"{STRETCHES} stretches: {', '.join(map(str, numbers))}"
        yield ResultRow(f"emg.synergies.spread.{name}", distances[name], "1", "evidence", "heldout", None, note)
    note = "largest distance from the most frequent number, of all walks"
    yield ResultRow("emg.synergies.spread", max(distances.values()), "1", "evidence", "heldout", None, note)


def steady_walks(seed: int) -> Iterator[tuple[str, dict[str, np.ndarray], float]]:
    """Yield envelopes of a person who really walks and of one of motor units, with their rate [Hz]."""
    from scipy import signal

    table = read_columns(data_set("lower_limb_walking") / "emgFilt.sto").values
    time = np.asarray(table["time"])
    every = max(1, round(0.01 / float(np.median(np.diff(time)))))
    real = {n: np.maximum(np.asarray(x)[::every], 0.0) for n, x in table.items() if n != "time"}
    yield "real", {n: x for n, x in real.items() if x.max() > 0.0}, 1.0 / float(np.median(np.diff(time[::every])))
    rng = np.random.default_rng([seed, 99])
    walk = walking_emg(rng, 1000.0, sized(66.0, smallest=24.0), MUSCLES)
    low, high = (signal.butter(2, *each, fs=1000.0, output="sos") for each in ((6.0,), (20.0, "highpass")))
    made = signal.sosfiltfilt(low, np.abs(signal.sosfiltfilt(high, walk.emg, axis=0)), axis=0)[::10]
    yield "motor_units", {m: np.maximum(x, 0.0) for m, x in zip(MUSCLES, made.T, strict=True)}, 100.0


def stretch_numbers(envelopes: dict[str, np.ndarray], rate: float) -> list[int]:
    """Return the number of synergies in each of some stretches of equal length, as `synergies` states it."""
    n = len(next(iter(envelopes.values())))
    edges = np.linspace(0, n, STRETCHES + 1).astype(int)
    return [len(pl.synergies({m: x[a:b] for m, x in envelopes.items()}, fs=rate)) for a, b in pairwise(edges)]
