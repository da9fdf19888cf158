"""Evidence for the check of a running estimator, and for the processing of raw EMG to an envelope.

Recordings are public ones of a person who walks and runs. Channels are changed by gains outside the fitted seconds,
and the estimators run sample by sample, as on a robot. The torque error of a change is that of the same estimator
without a check, so that the required detections do not depend on the check. Thresholds of the check follow from the
acceptable torque error and were fixed before these changes were sampled.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np

from pellucid.controllers.export.replay_vector import ReplayVector
from pellucid.emg.estimators.cross_validation import score
from pellucid.emg.estimators.emg_session import FittedSession, add_channel_watch
from pellucid.emg.estimators.live_torque import LiveTorque
from pellucid.emg.estimators.torque_map import fit_torque_map
from pellucid.emg.estimators.torque_trial import TorqueTrial
from pellucid.emg.models.emg_estimator import EmgEstimatorCard
from pellucid.emg.models.muscle import CalibratedMuscles
from pellucid.emg.signals.emg_chain import emg_chain
from pellucid.emg.signals.emg_quality import find_hum
from pellucid.emg.study.emg_torque.estimator_cards import estimator_cards, map_estimator, muscle_estimator
from pellucid.emg.study.emg_torque.torque_findings import CalibrationFindings
from pellucid.emg.study.emg_torque.trial_sources import moment_trials
from pellucid.files.recording import Channel, Recording
from pellucid.study.results import ResultRow
from pellucid.study.study import Study
from research.benchmarks._size import sized

from ._emg_cases import WALKING, row, study_with

SEED = 20261126
SPOILT_COUNT = sized(300, smallest=6)
"""Number of drawn spoilings."""
GAINS = (1.5, 2.0, 2.6, 4.0)
"""Gains of a channel that is spoilt."""
WATCHED_S = 10.0
"""Time before each spoiling, and within which it must be named [s]."""
COSTLY_LOSS = 0.2
"""Loss of R² from which a change must be named."""
WARPS = (0.8, 1.25)
"""Factors by which the time of walking is stretched for further speeds."""
FITTED_S = 5.0
"""Time of each speed that is fitted [s]."""
EDGE_COUNT = sized(60, smallest=4)
"""Number of drawn pieces of raw EMG whose envelopes are compared at their edges."""
EDGE_S = 0.25
"""Stretch at either end of a piece that counts as its edge [s]."""
RAW_RATE_HZ = 2000.0
"""Sampling rate of made raw EMG [Hz]."""


def part_of(trial: TorqueTrial, rows: slice) -> TorqueTrial:
    """Return some samples of a trial."""
    return replace(
        trial, time=trial.time[rows], torque=trial.torque[rows], lead={},
        envelopes={m: x[rows] for m, x in trial.envelopes.items()},
        angles={j: q[rows] for j, q in trial.angles.items()},
    )  # fmt: skip


def run_card(card: EmgEstimatorCard, trial: TorqueTrial) -> tuple[np.ndarray, list[set[str]], list[str]]:
    """Return the torque of a card's first joint, (n,) [N m], and in each step the changed channels and the fault."""
    live = LiveTorque(card)
    emg = {c.name: trial.envelopes[c.name] for c in card.channels}
    angles = {a: trial.angles[a] for a in card.angles}
    torque, changed, faults = np.zeros(len(trial)), [], []
    for i in range(len(trial)):
        made = live.step(1.0 + i * card.period, {m: x[i] for m, x in emg.items()}, {a: q[i] for a, q in angles.items()})
        torque[i] = made.torque[card.joints[0].name]
        changed.append(set(made.changed))
        faults.append(made.fault)
    return torque, changed, faults


def walking_cards(study: Study) -> dict[str, tuple[EmgEstimatorCard, TorqueTrial, TorqueTrial]]:
    """Return each card of knee and ankle with its fitted trial and the one that was not fitted."""
    found, trials = CalibrationFindings(), {}
    for joint in ("knee", "ankle"):
        fitted, *held = moment_trials(study, joint, causal=True)
        trials[joint] = fitted, held[-1]
        for name in ("ridge", "hill"):
            found.causal[joint, name] = fit_torque_map([fitted], name, causal=True)
    return {name: (card, *trials[card.joints[0].name]) for name, card in estimator_cards(study, found).items()}


def session_rows(study: Study) -> Iterator[ResultRow]:
    """Yield the share of costly changes that is named in time, of others that are, and of fitted trials that pass."""
    cards, rng = walking_cards(study), np.random.default_rng(SEED)
    yield from fitted_rows(study, cards)
    costly, in_time, named_late, wrong, alone = 0, 0, [], 0, 0
    r2: dict[str, list[float]] = {"before": [], "spoilt": [], "watched": []}
    for _ in range(SPOILT_COUNT):
        card, _, rest = cards[str(rng.choice(list(cards)))]
        start = round(WATCHED_S * rest.fs)
        first = int(rng.integers(0, len(rest) - 2 * start))
        piece, bare = part_of(rest, slice(first, first + 2 * start)), replace(card, watch=None)
        muscle = str(rng.choice([c.name for c in card.channels]))
        gain = np.where(np.arange(len(piece)) < start, 1.0, float(rng.choice(GAINS)))
        spoilt = replace(piece, envelopes={**piece.envelopes, muscle: gain * piece.envelopes[muscle]})
        watched, changed, _ = run_card(card, spoilt)
        after = slice(start, None)
        found = {"before": run_card(bare, piece)[0], "spoilt": run_card(bare, spoilt)[0], "watched": watched}
        each = {name: score(piece.torque[after], torque[after]).r2 for name, torque in found.items()}
        wrong += len(set().union(*changed) - {muscle}) + any(muscle in names for names in changed[:start])
        alone += len(card.channels)
        if each["before"] - each["spoilt"] > COSTLY_LOSS:
            costly += 1
            when = next((i for i, names in enumerate(changed[start:]) if muscle in names), None)
            in_time += when is not None
            named_late += [] if when is None else [when / rest.fs]
            for name, value in each.items():
                r2[name].append(value)
    said = (
        f"{SPOILT_COUNT} drawn gains of {', '.join(f'{g:g}' for g in GAINS)} on one channel of {len(cards)} cards, "
        f"after {WATCHED_S:g} s of walking, sample by sample"
    )
    share = 100.0 * in_time / costly if costly else None
    words = f"of {costly} that cost more than {COSTLY_LOSS:g} of R², within {WATCHED_S:g} s; {said}"
    yield row("session.named_in_time", share, "%", words)
    yield row("session.wrongly_named", 100.0 * wrong / alone, "%", f"channels that were as they had been; {said}")
    if costly:
        yield row("session.seconds", np.median(named_late), "s", f"median until a costly change is named; {said}")
        for name, words in (
            ("before", "nothing spoilt"), ("spoilt", "spoilt and not watched"), ("watched", "spoilt and watched")
        ):  # fmt: skip
            yield row(
                f"session.r2.{name}", np.median(r2[name]), "1", f"median over the costly changes, {words}; {said}"
            )


def fitted_rows(study: Study, cards: dict) -> Iterator[ResultRow]:
    """Yield the share of fitted trials that pass their own comparison and watch, at one, two and three speeds."""
    passed = []
    for card, fitted, _ in cards.values():
        _, changed, faults = run_card(card, fitted)
        passed.append(not set().union(*changed) and "unlike" not in faults)
    fitted, _, rest = moment_trials(study, "ankle", causal=True)
    speeds = [fitted, *(warped(part_of(rest, slice(round(FITTED_S * rest.fs))), factor) for factor in WARPS)]
    for count in (1, 2, 3):
        trials = speeds[:count]
        session = FittedSession.from_trials(trials)
        passed += [not session.compare(t).changes and session.compare(t).is_valid for t in trials]
        ridge = fit_torque_map(trials, "ridge", causal=True)
        card = add_channel_watch(map_estimator(study, "emg_ankle_ridge", ridge, trials), {"ankle": trials})
        for trial in trials:
            _, changed, faults = run_card(card, trial)
            passed.append(not set().union(*changed) and "unlike" not in faults)
    words = (
        f"{len(passed)} comparisons and watches of fitted trials at one to three speeds: walking, {WARPS} of its time"
    )
    yield row("session.fitted_trials_pass", 100.0 * np.mean(passed), "%", words, "fitted")


def warped(trial: TorqueTrial, factor: float) -> TorqueTrial:
    """Return a trial whose time runs slower by a factor, at the same sampling rate."""
    old = factor * (trial.time - trial.time[0])
    new = np.arange(0.0, old[-1], 1.0 / trial.fs)

    def again(x: np.ndarray) -> np.ndarray:
        return np.interp(new, old, x)

    return replace(
        trial, name=f"{trial.name}_{factor:g}", group=f"{factor:g}", time=new, torque=again(trial.torque), lead={},
        envelopes={m: again(x) for m, x in trial.envelopes.items()}, heldout=False,
        angles={j: again(q) for j, q in trial.angles.items()},
    )  # fmt: skip


# --- seven moved electrodes, on three sessions and two joints ---------------------------------------------------------

MOVED = ("gain 0.4", "gain 1.6", "gain 2.6", "offset", "dead", "missing", "exchanged")
"""What happens to an electrode."""
OFFSET_SHARE = 0.3
"""Offset of a moved electrode, as a share of the largest usual envelope."""
MOVED_CHANNELS = sized(2, smallest=1)
"""Number of channels of each card that are moved: those on which the torque depends most."""
BEFORE_S, AFTER_S = 8.0, sized(16.0, smallest=4.0)
"""Time before and after an electrode moves [s]."""
NAMED_WITHIN_S = 2.0
"""Time within which a costly change is to be named [s]."""
LIVE_COSTLY_LOSS = 0.1
"""Loss of R² from which a change must be named."""
ERROR_WINDOW_S = 2.0
"""Time over which the torque's error is a root mean square [s]."""
MAX_VALID_RATIO = 1.5
"""Error over the calibrated error above which a torque that counts as valid is wrong."""


def live_sessions(folder: Path) -> Iterator[tuple[str, EmgEstimatorCard, TorqueTrial]]:
    """Yield the muscles' card and a stretch that was not fitted: walking, another speed of walking, and running."""
    made = study_with(folder, WALKING, [("walk36", "", "fit", ""), ("run81", "run81_", "fit", "")])
    length = BEFORE_S + AFTER_S
    for joint in ("knee", "ankle"):
        walk, run = moment_trials(made, joint, causal=True)

        def cut(trial: TorqueTrial, start: float, end: float) -> TorqueTrial:
            return part_of(trial, slice(round(start * trial.fs), round(end * trial.fs)))

        speeds = [cut(walk, 10.0, 18.0), *(warped(cut(walk, 18.0 + 7.0 * i, 25.0 + 7.0 * i), f) for i, f in
                                           enumerate(WARPS))]  # fmt: skip
        for session, fitted, held in (
            ("walking", [cut(walk, 19.0, 24.0)], cut(walk, 24.0, 24.0 + length)),
            ("another speed", speeds, cut(warped(cut(walk, 32.0, 60.0), 1.12), 0.0, length)),
            ("running", [cut(run, 5.0, 15.0)], cut(run, 15.0, 15.0 + length)),
        ):
            fit = fit_torque_map(fitted, "hill", causal=True)
            muscles = CalibratedMuscles(fit.fit.muscles, fit.driven, {joint: fit.fit.passive}, fit.effort)
            card = muscle_estimator(made, f"emg_{joint}_hill", muscles, {joint: fitted})
            yield f"{session}, {joint}", add_channel_watch(card, {joint: fitted}), held


def moved(envelopes: dict[str, np.ndarray], muscle: str, other: str, kind: str, top: float) -> dict[str, np.ndarray]:
    """Return envelopes, shape (n,) each, with one electrode moved, or two exchanged; `top` is its largest usual one."""
    x = envelopes[muscle]
    if kind.startswith("gain"):
        return {muscle: float(kind.split()[1]) * x}
    if kind == "exchanged":
        return {muscle: envelopes[other], other: x}
    return {muscle: {"offset": x + OFFSET_SHARE * top, "dead": 0.0 * x, "missing": np.full_like(x, np.nan)}[kind]}


def run_live(
    card: EmgEstimatorCard, trial: TorqueTrial
) -> tuple[np.ndarray, np.ndarray, list[set[str]], np.ndarray, np.ndarray]:
    """Return the torque, (n,) [N m], whether it counts as valid, (n,), and the channels that are named, by step.

    Return also the half width of its interval, (n,) [N m], NaN without one, and of the interval as calibrated.
    """
    live = LiveTorque(card)
    emg = {c.name: trial.envelopes[c.name] for c in card.channels}
    angles = {a: trial.angles[a] for a in card.angles}
    torque, valid, named = np.zeros(len(trial)), np.zeros(len(trial), bool), []
    wide, usual = np.full((2, len(trial)), np.nan)
    for i in range(len(trial)):
        made = live.step(1.0 + i * card.period, {m: x[i] for m, x in emg.items()}, {a: q[i] for a, q in angles.items()})
        torque[i], valid[i] = made.torque[card.joints[0].name], made.valid
        named.append({*made.changed, *made.lost})
        if made.half_width:
            wide[i] = made.half_width[card.joints[0].name]
            usual[i] = wide[i] / made.widening
    return torque, valid, named, wide, usual


def trailing_error(torque: np.ndarray, trial: TorqueTrial) -> np.ndarray:
    """Return the root mean square error over the last `ERROR_WINDOW_S`, shape (n,) [N m]."""
    total = np.concatenate([[0.0], np.cumsum((torque - trial.torque) ** 2)])
    end = np.arange(1, len(torque) + 1)
    start = np.maximum(end - round(ERROR_WINDOW_S * trial.fs), 0)
    return np.sqrt((total[end] - total[start]) / (end - start))


def moved_rows() -> Iterator[ResultRow]:
    """Yield how long a torque counts as valid that is wrong, how soon a costly change is named, and what is wrongly."""
    wrong_time = valid_time = wrongly = whole = costly = in_time = unspoilt_valid = unspoilt = natural = 0
    repaired: list[float] = []
    covered: dict[str, list[np.ndarray]] = {"widened": [], "as calibrated": []}
    with tempfile.TemporaryDirectory() as folder:
        for _, card, held in live_sessions(Path(folder) / "live"):
            at = round(BEFORE_S * held.fs)
            bare = replace(card, watch=None)
            weights = [w.consequence * w.square for w in card.watch.channels]
            order = [card.channels[i].name for i in np.argsort(weights)[::-1]]
            before, valid, named, *_ = run_live(card, held)
            plain = run_live(bare, held)[0]
            usual = float(np.sqrt(np.mean((plain - held.torque) ** 2)))
            own = trailing_error(plain, held)
            unspoilt_valid, unspoilt = unspoilt_valid + valid.sum(), unspoilt + len(valid)
            natural += int(np.sum(valid & (trailing_error(before, held) > MAX_VALID_RATIO * usual)))
            wrongly, whole = wrongly + sum(map(bool, named)), whole + len(named)
            for rank, muscle in enumerate(order[:MOVED_CHANNELS]):
                top, other = float(np.quantile(held.envelopes[muscle], 0.95)), order[1 - rank if rank < 2 else 0]
                for kind in MOVED:
                    spoilt = moved(held.envelopes, muscle, other, kind, top)
                    envelopes = {
                        m: np.where(np.arange(len(held)) < at, x, spoilt.get(m, x)) for m, x in held.envelopes.items()
                    }
                    trial = replace_envelopes(held, envelopes)
                    torque, valid, named, *widths = run_live(card, trial)
                    unwatched = run_live(bare, trial)[0]
                    after = slice(at, None)
                    held_by = np.isfinite(widths[0][after])
                    for each, width in zip(covered.values(), widths, strict=True):
                        each.append((np.abs(torque - held.torque) <= width)[after][held_by])
                    limit = MAX_VALID_RATIO * np.maximum(usual, own)
                    wrong = valid & (trailing_error(torque, held) > limit)
                    wrong_time, valid_time = wrong_time + int(wrong[after].sum()), valid_time + len(wrong[after])
                    wrongly += sum(bool(n - set(spoilt)) or bool(n and i < at) for i, n in enumerate(named))
                    whole += len(named)
                    spoilt_r2 = score(held.torque[after], unwatched[after]).r2
                    loss = score(held.torque[after], plain[after]).r2 - spoilt_r2
                    if loss > LIVE_COSTLY_LOSS:
                        costly += 1
                        when = next((i for i, n in enumerate(named[at:]) if n & set(spoilt)), None)
                        in_time += when is not None and when <= NAMED_WITHIN_S * held.fs
                    if kind in ("missing", "dead"):
                        repaired.append(score(held.torque[after], torque[after]).r2 - spoilt_r2)
    said = (
        f"{len(MOVED)} moved electrodes ({', '.join(MOVED)}) of {MOVED_CHANNELS} channels each, muscles of knee and "
        f"ankle in walking, at another speed and in running; {AFTER_S:g} s each"
    )
    note = (
        f"of the time after the move: valid, and the error of the last {ERROR_WINDOW_S:g} s above {MAX_VALID_RATIO:g} "
        f"times that of the same estimator with nothing moved, in the same seconds and in the mean; above "
        f"{MAX_VALID_RATIO:g} times the mean alone {100.0 * natural / unspoilt:.1f} % with nothing moved; {said}"
    )
    yield row("live.valid_but_wrong", 100.0 * wrong_time / valid_time, "%", note)
    share = 100.0 * in_time / costly if costly else None
    yield row(
        "live.named_in_2s", share, "%", f"of {costly} that cost an unwatched torque more than {LIVE_COSTLY_LOSS:g} of "
        f"R²; {said}",
    )  # fmt: skip
    yield row("live.wrongly_named_time", 100.0 * wrongly / whole, "%", f"any channel that was not moved; {said}")
    for name, each in covered.items():
        share = 100.0 * float(np.mean(np.concatenate(each)))
        words = f"samples after the move within the 90 % interval {name}, where a torque is estimated; {said}"
        yield row(f"live.interval.{name.replace(' ', '_')}.covered", share, "%", words)
    yield row("live.valid_unspoilt", 100.0 * unspoilt_valid / unspoilt, "%", "of the time with nothing moved")
    words = f"median gain in R² by the watch where an electrode is silent or dead; {said}"
    yield row("live.silent.gained_r2", float(np.median(repaired)), "1", words)


def replace_envelopes(trial: TorqueTrial, envelopes: dict[str, np.ndarray]) -> TorqueTrial:
    """Return a trial with other envelopes, which may have missing samples as a live stream has."""
    made = copy(trial)
    object.__setattr__(made, "envelopes", envelopes)
    return made


def wrong_floats(card: EmgEstimatorCard, vector: ReplayVector, listing: str) -> tuple[int, int]:
    """Return in how many steps exported C answers otherwise than the core in float, and in how many a channel changed.

    `listing` is the header with the answers that the exported C gave to the test vector.
    """
    rows = re.findall(r"\{ (\d+)u, \{ ([^}]*) \} \}", listing)
    core, wrong, changed = card.build(single=True), 0, 0
    for step, (said, bits) in zip(vector.steps, rows, strict=True):
        if step.before:
            core.reset()
        torque, fault, *_ = core.step(step.now, step.emg, step.angle)
        numbers = [int(x.rstrip("u"), 16) for x in bits.split(", ")]
        own = np.float32([*torque, core.widening]).view(np.uint32).tolist()
        wrong += int(said) & 0xFF != fault or own != [*numbers[: len(torque)], numbers[-1]]
        changed += core.changed != 0
    return wrong, changed


# --- raw EMG on its way to an envelope -------------------------------------------------------------------------------


def made_raw(seconds: float, rng: np.random.Generator) -> np.ndarray:
    """Return band-limited noise with bursts, as raw EMG has them, (n,) [V]."""
    from scipy.signal import butter, sosfilt

    n = round(seconds * RAW_RATE_HZ)
    noise = sosfilt(butter(2, (30.0, 300.0), "bandpass", fs=RAW_RATE_HZ, output="sos"), rng.standard_normal(n))
    time = np.arange(n) / RAW_RATE_HZ
    level = 0.05 + np.maximum(0.0, np.sin(2.0 * np.pi * time / rng.uniform(0.8, 2.0) + rng.uniform(0.0, 6.0))) ** 2
    return 1e-4 * level * noise


def raw_rows() -> Iterator[ResultRow]:
    """Yield the error of envelopes at the edges of a file, mains found, and the memory that ten minutes take."""
    rng, chain, errors = np.random.default_rng(SEED + 1), emg_chain("hill"), []
    edge = round(EDGE_S * RAW_RATE_HZ)
    for _ in range(EDGE_COUNT):
        raw = made_raw(12.0, rng)
        inside = slice(*(np.array([3, 9]) * int(RAW_RATE_HZ)))
        whole, alone = chain.zero_phase(raw, RAW_RATE_HZ)[inside], chain.zero_phase(raw[inside], RAW_RATE_HZ)
        apart = np.abs(whole - alone)
        errors.append(max(apart[:edge].mean(), apart[-edge:].mean()) / whole.max())
    words = f"median of {EDGE_COUNT} pieces of made EMG: mean error of the worse edge of {EDGE_S:g} s over the maximum"
    yield row("envelope.edge_error", 100.0 * np.median(errors), "%", words, "simulated")
    found = []
    for mains in (50.0, 60.0):
        for _ in range(EDGE_COUNT):
            raw = made_raw(6.0, rng)
            hum = rng.uniform(0.5, 2.0) * np.std(raw) * np.sin(2.0 * np.pi * mains * np.arange(len(raw)) / RAW_RATE_HZ)
            found.append(find_hum([recording_of(raw + hum)]) == mains)
    words = f"{len(found)} made recordings with half to twice as much hum as EMG, at 50 or 60 Hz"
    yield row("mains.found", 100.0 * np.mean(found), "%", words, "simulated")
    script = (
        "import resource, numpy as np\n"
        "from pellucid.emg.signals.emg_chain import emg_chain\n"
        "x = 1e-4 * np.random.default_rng(1).standard_normal(int(640 * 2000))\n"
        "for _ in range(4): emg_chain('hill').zero_phase(x, 2000.0)\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    words = "of the whole process, largest: four channels of 640 s at 2 kHz in turn"
    yield row("raw_640s.memory", float(done.stdout), "MB", words, "simulated")


def recording_of(raw: np.ndarray) -> Recording:
    """Return a recording with one channel of raw EMG."""
    time = Channel("time", np.arange(len(raw)) / RAW_RATE_HZ, "s", "time")
    channels = {"time": time, "emg.soleus": Channel("emg.soleus", raw, "V", "soleus")}
    return Recording("made", Path("made.csv"), "", "fit", channels)
