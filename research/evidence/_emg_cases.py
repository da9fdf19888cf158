"""Cases on which the choice of an estimator is tested: public recordings of people, some fitted and others held out.

Every case names its data set, the trials that are fitted, the trials that are held out, and the joint. Trials are made
as `calibrate` makes them. Nothing of the held-out trials reaches a fit or a choice.

``python -m research.evidence._emg_cases`` ranks the methods on all cases and writes the ranking that ``pellucid
reproduce hill`` shows.
"""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.stats import t as student
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from pellucid import PellucidError
from pellucid.emg.estimators.condition_choice import (
    find_extrapolator,
    is_candidate,
    predict_without_each_test,
    recommend,
    run_condition_tests,
)
from pellucid.emg.estimators.cross_validation import score
from pellucid.emg.estimators.emg_session import FittedSession
from pellucid.emg.estimators.emg_worth import EmgWorth, worth_on_recording
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES, STACKED, named_family
from pellucid.emg.estimators.torque_map import fit_torque_map
from pellucid.emg.estimators.torque_trial import MOTION_LOWPASS_HZ, FeatureSet, TorqueTrial, compute_features
from pellucid.emg.signals.emg_chain import emg_chain
from pellucid.emg.study.emg_torque.relative_envelopes import find_maxima, relative_envelopes
from pellucid.emg.study.emg_torque.trial_sources import leg_extension_trials, moment_trials
from pellucid.files.recording import Recording
from pellucid.models.anthropometry import shank_length, winter
from pellucid.numerics.filters import central_difference, zero_phase_lowpass
from pellucid.study.datasets import init
from pellucid.study.datasets.registry import path as data_set
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import ResultRow
from pellucid.study.study import STUDY_FILE, Study
from pellucid_lab.papers.hill.real_people import RANKING_FILE, RankedError, RankedMethod, write_ranking
from research.benchmarks._size import is_smallest
from research.benchmarks._walking import DATASET as WALKING

ISOMETRIC_PEOPLE = ("ID1", "ID2", "ID3")
"""People whose isometric extension and flexion of the knee are divided into fitted and held-out quarters."""
QUARTER_COUNT = 4
"""Number of parts of a hold."""
STANDING_PEOPLE = ("1N", "3N", "4N")
"""People who extend a leg from sitting, which is fitted, and bend it standing, which is held out."""
MEAN_BODY = (70.0, 1.7)
"""Mass [kg] and height [m] of a person without a stated body, as `calibrate` assumes."""
MAX_EXCESS = 0.1
"""Share by which the named estimator's error may exceed the best one's."""
KEPT_RATE_HZ = 100.0
"""Rate to which raw recordings are thinned [Hz]."""


@dataclass(frozen=True, eq=False)
class Fold:
    """Trials that are fitted, and trials that are held out."""

    fitted: tuple[TorqueTrial, ...]
    held: tuple[TorqueTrial, ...]


@dataclass(frozen=True, eq=False)
class Case:
    """One case: a data set, its trials in one fold or in several, and a joint."""

    name: str
    dataset: str
    joint: str
    folds: tuple[Fold, ...] = field(repr=False)

    @property
    def words(self) -> str:
        """Data set, fitted trials, held-out trials and joint."""
        parts = [
            f"{', '.join(t.name for t in fold.fitted[:4])}{' ...' if len(fold.fitted) > 4 else ''} -> "
            f"{', '.join(t.name for t in fold.held)}"
            for fold in self.folds
        ]
        return f"{self.dataset}, {self.joint}: {'; '.join(parts)}"


@dataclass(frozen=True, eq=False)
class Outcome:
    """Errors of one fold: the recommended estimator, every candidate, and the ridge regressions on angles."""

    named: str  # Recommended estimator
    errors: np.ndarray  # Its errors on the held-out trials, shape (n,)
    rivals: dict[str, np.ndarray]  # Errors of every candidate and of the plain regressions, shape (n,) each
    published: dict[str, np.ndarray]  # Errors of reconstructions of published methods, shape (n,) each
    worth: tuple[tuple[EmgWorth, float], ...]  # What EMG is worth, with R² beyond the better plain ridge, by trial


PLAIN_PENALTIES = tuple(np.geomspace(0.01, 1000.0, 6))
"""Candidate penalties of the plain ridge regression."""

PUBLISHED_METHODS = tuple(
    name for name, family in ESTIMATOR_FAMILIES.items() if family.reconstruction and not family.sees_measured_torque
)
"""Reconstructions of published methods, which are ranked and never recommended."""

PLAIN_RIDGES = {"plain ridge on angles": False, "plain ridge on angles and rates": True}
"""Plain quadratic ridge regressions of scikit-learn, and whether they see the angles' rates."""


def plain_ridge(fold: Fold, velocities: bool) -> dict[str, np.ndarray]:
    """Return the torque of each held-out trial by a quadratic ridge regression of scikit-learn on angles alone."""
    seen = FeatureSet(neighbours=True, velocities=velocities, muscles=False)
    x = np.vstack([compute_features(t, seen).x for t in fold.fitted])
    model = make_pipeline(
        StandardScaler(), PolynomialFeatures(2, include_bias=False), StandardScaler(), RidgeCV(PLAIN_PENALTIES)
    ).fit(x, np.concatenate([t.torque for t in fold.fitted]))
    return {t.name: model.predict(compute_features(t, seen).x) for t in fold.held}


def evaluate(fold: Fold) -> Outcome:
    """Fit every candidate, name an estimator by the fitted trials alone, and compare it with all on the held-out."""
    tests, predicted = {}, {t.name: {} for t in fold.held}
    for name in (*filter(is_candidate, ESTIMATOR_FAMILIES), *PUBLISHED_METHODS):
        try:
            fit = fit_torque_map(list(fold.fitted), name)
        except PellucidError:  # No geometry of these muscles
            continue
        if is_candidate(name):
            tests[name] = run_condition_tests(fit, fold.fitted)
        for t in fold.held:
            predicted[t.name][name] = fit.predict(t)
    chosen, beyond = recommend(tests), find_extrapolator(tests)
    bare = recommend({name: each for name, each in tests.items() if not ESTIMATOR_FAMILIES[name].muscles})
    session = FittedSession.from_trials(list(fold.fitted))
    plain = {name: plain_ridge(fold, velocities) for name, velocities in PLAIN_RIDGES.items()}
    errors, worth, names = [], [], []
    for t in fold.held:
        own, is_valid = predicted[t.name], session.compare(t).is_valid
        alone = not is_valid and beyond is not None
        names.append(beyond if alone else chosen.name)
        made = own[beyond] if alone else chosen.predict(own)
        errors.append(made - t.torque)
        if is_valid:
            others = predict_without_each_test(chosen, bare, own)
            gained = worth_on_recording(t.torque, made, bare.predict(own), t.fs, other_choices=others)
            best = max(score(t.torque, each[t.name]).r2 for each in plain.values())
            worth.append((gained, score(t.torque, made).r2 - best))
    missed = {
        name: np.concatenate([predicted[t.name][name] - t.torque for t in fold.held])
        for name in predicted[fold.held[0].name]
    }
    rivals = {name: missed[name] for name in tests}
    rivals |= {name: np.concatenate([each[t.name] - t.torque for t in fold.held]) for name, each in plain.items()}
    words = ", ".join(dict.fromkeys(names))
    if STACKED in names:
        words += f" ({', '.join(f'{w:.2f} {n}' for n, w in chosen.weights.items())})"
    published = {name: missed[name] for name in PUBLISHED_METHODS if name in missed}
    return Outcome(words, np.concatenate(errors), rivals, published, tuple(worth))


def row(name: str, value: float | None, unit: str, note: str, split: str = "heldout") -> ResultRow:
    """Return a row of evidence on EMG."""
    return ResultRow(f"emg.{name}", None if value is None else float(value), unit, "evidence", split, None, note)


def case_rows(ranking: Path | None = None) -> Iterator[ResultRow]:
    """Yield the error of the named estimator over that of the best, by case, and what EMG is said to be worth.

    The ranking of all methods is also written to the file `ranking` if it is given.
    """
    ratios, worth, errors = {}, [], {}
    with tempfile.TemporaryDirectory() as folder:
        for case in emg_cases(Path(folder)):
            found = [evaluate(fold) for fold in case.folds]
            rmse, published = (
                common_errors([getattr(each, kind) for each in found]) for kind in ("rivals", "published")
            )
            best = min(rmse, key=rmse.get)
            named = root_mean_square([each.errors for each in found])
            ratios[case.name] = named / rmse[best]
            errors[case.name] = {NAMED: named, **rmse, **published}
            plain = min(rmse[name] for name in PLAIN_RIDGES)
            words = (
                f"{'; '.join(dict.fromkeys(each.named for each in found))}: {named:.3g}; best {best}: "
                f"{rmse[best]:.3g}; "
                f"plain ridge on angles: {plain:.3g} {case.folds[0].held[0].unit}; {case.words}"
            )
            yield row(f"choice.case.{case.name}", ratios[case.name], "1", words)
            worth += [pair for each in found for pair in each.worth]
    ranked = rank_methods(errors)
    yield from ranking_rows(ranked)
    if ranking is not None:
        write_ranking(ranked, ranking)
    said = "cases: named estimator over the best of all candidates and of scikit-learn's quadratic ridge on angles"
    yield row("choice.cases", len(ratios), "1", said)
    within = sum(ratio <= 1.0 + MAX_EXCESS for ratio in ratios.values())
    yield row("choice.within_10_percent", within, "1", f"of {len(ratios)} {said}")
    answers = Counter(each.answer for each, _ in worth)
    contradicted = sum(
        (each.answer == "worth it" and beyond <= 0.0) or (each.answer == "not worth it" and beyond >= each.margin)
        for each, beyond in worth
    )
    words = "; ".join(f"{answer}: {count}" for answer, count in answers.most_common())
    yield row(
        "worth.contradicted", contradicted, "1",
        f"of {len(worth)} held-out recordings like the fitted ones ({words}): said to be worth it where a plain "
        "quadratic ridge on angles errs no more, or not to be where it errs more by the margin",
    )  # fmt: skip


NAMED = "named"
"""Name of what `calibrate` recommends, in the ranking."""


def rank_methods(errors: Mapping[str, Mapping[str, float]]) -> list[RankedMethod]:
    """Return the methods that fit most cases in common, the best first, from errors by case and method."""
    names = list(dict.fromkeys(name for own in errors.values() for name in own))
    common = [own for own in errors.values() if all(name in own for name in names)]

    def words(name: str) -> str:
        if name == NAMED:
            return "recommended estimator of pellucid calibrate"
        return f"{name}, scikit-learn" if name in PLAIN_RIDGES else named_family(name).description

    ranked = [
        RankedMethod(
            name.replace(" ", "_"), words(name), _rank(name, common),
            _rank(name, list(errors.values())) if all(name in own for own in errors.values()) else None,
        )
        for name in names
    ]  # fmt: skip
    return sorted(ranked, key=lambda each: each.common.ratio)


def _rank(name: str, cases: Sequence[Mapping[str, float]]) -> RankedError:
    """Return a method's error over that of the best method of each case, from errors by method."""
    logs = np.log([own[name] / min(own.values()) for own in cases])
    count = len(logs)
    half = student.ppf(0.975, count - 1) * np.std(logs, ddof=1) / np.sqrt(count) if count > 1 else np.inf
    mean = float(np.mean(logs))
    return RankedError(float(np.exp(mean)), float(np.exp(mean - half)), float(np.exp(mean + half)), count)


def ranking_rows(ranked: Sequence[RankedMethod]) -> Iterator[ResultRow]:
    """Yield every method's error over the best one's on real people, best first."""
    for each in ranked:
        for ending, found in (("", each.common), (".all", each.every)):
            if found is not None:
                words = (
                    f"{each.words}: 95 % interval {found.low:.2f} to {found.high:.2f}; error over that of the best "
                    f"method of each case, geometric mean over {found.cases} cases of real people"
                )
                yield row(f"ranking.{each.name}{ending}", found.ratio, "1", words)


def common_errors(folds: Sequence[Mapping[str, np.ndarray]]) -> dict[str, float]:
    """Return the error of each method that every fold has, from its errors by name, shape (n,) each."""
    common = [name for name in folds[0] if all(name in fold for fold in folds)]
    return {name: root_mean_square([fold[name] for fold in folds]) for name in common}


def root_mean_square(errors: Sequence[np.ndarray]) -> float:
    """Return the root mean square of the errors of several folds, each fold weighted equally."""
    return float(np.sqrt(np.mean([np.mean(e**2) for e in errors])))


def make_fold(fitted: Sequence[TorqueTrial], held: Sequence[TorqueTrial]) -> Fold:
    """Return a fold whose trials are marked as fitted or held out."""
    return Fold(
        tuple(replace(t, heldout=False) for t in fitted), tuple(replace(t, heldout=True) for t in held)
    )


def emg_cases(folder: Path) -> Iterator[Case]:
    """Yield every case whose data set is present; studies are made in `folder`."""
    if is_smallest():
        yield nmsm_case(folder / "nmsm")
        return
    yield from walking_cases(folder / "walking")
    yield from lifting_cases(folder / "lifting")
    yield nmsm_case(folder / "nmsm")
    yield from isometric_cases(folder / "isometric")
    yield standing_case(folder / "standing")


def study_with(folder: Path, dataset: str, recordings: Sequence[tuple[str, str, str, str]]) -> Study:
    """Return a study of walking whose recordings are (name, prefix of the files, use, window)."""
    study = init(folder, dataset=dataset)
    for file in data_set(dataset).glob("run81_*.sto"):
        shutil.copyfile(file, study.folder / "recordings" / file.name)
    path = study.folder / STUDY_FILE
    head = path.read_text(encoding="utf-8").partition("[[recordings]]")[0]
    parts = [
        f'[[recordings]]\nname = "{name}"\nfile = "recordings/{prefix}ik.sto"\nstreams = {{ emg = '
        f'"recordings/{prefix}emgFilt.sto", moments = "recordings/{prefix}id.sto" }}\nprotocol = "walking"\n'
        f'use = "{use}"\n{window}\n'
        for name, prefix, use, window in recordings
    ]
    path.write_text(head + "\n".join(parts), encoding="utf-8")
    return open_study(study.folder)


def walking_cases(folder: Path) -> Iterator[Case]:
    """Yield knee and ankle: within walking at 3.6 km/h, from it to running at 8.1 km/h, and back."""
    inside = study_with(
        folder / "inside", WALKING,
        [("walk36_19_to_24_s", "", "fit", 'window = ["19 s", "24 s"]'),
         ("walk36_24_to_60_s", "", "validate", 'window = ["24 s", "60 s"]')],
    )  # fmt: skip
    across = study_with(
        folder / "across", WALKING, [("walk36", "", "fit", ""), ("run81", "run81_", "validate", "")]
    )
    for joint in ("knee", "ankle"):
        fitted, held = moment_trials(inside, joint)
        yield Case(f"walk36.{joint}", WALKING, joint, (make_fold([fitted], [held]),))
        walk, run = moment_trials(across, joint)
        yield Case(f"walk36_to_run81.{joint}", WALKING, joint, (make_fold([walk], [run]),))
        yield Case(f"run81_to_walk36.{joint}", WALKING, joint, (make_fold([run], [walk]),))


def lifting_cases(folder: Path) -> Iterator[Case]:
    """Yield the trunk: from 5 kg to 15 kg, and from squatting to stooping."""
    trials = {t.name: t for t in moment_trials(init(folder, dataset="lumbar_lifting"), "trunk")}
    for name, held in (("load", "squat_15_kg"), ("kind", "stoop_5_kg")):
        fitted = [t for n, t in trials.items() if n != held]
        yield Case(f"lifting.{name}", "lumbar_lifting", "trunk", (make_fold(fitted, [trials[held]]),))


def nmsm_case(folder: Path) -> Case:
    """Return the knee in walking and crouching, each trial held out in turn."""
    trials = moment_trials(init(folder, dataset="nmsm_knee_emg"), "knee")
    folds = tuple(make_fold([t for t in trials if t is not held], [held]) for held in trials)
    return Case("nmsm", "nmsm_knee_emg", "knee", folds)


def isometric_cases(folder: Path) -> Iterator[Case]:
    """Yield knee torque in holds: the second and fourth quarter of three people's, by the first and third.

    Extension and flexion were recorded by one load cell, in recordings of their own; flexion has the negative sign.
    """
    recordings = {r.name: r for r in init(folder, dataset="elderly_isometric").recordings()}
    for person in ISOMETRIC_PEOPLE:
        quarters: dict[int, list[TorqueTrial]] = {i: [] for i in range(QUARTER_COUNT)}
        for task, sign in (("extension", 1.0), ("flexion", -1.0)):
            for i, quarter in enumerate(hold_quarters(recordings[f"{person}_knee_{task}"], task, sign)):
                quarters[i].append(quarter)
        top = {
            muscle: max(float(t.envelopes[muscle].max()) for i in (0, 2) for t in quarters[i])
            for muscle in quarters[0][0].envelopes
        }
        scaled = {
            i: [replace(t, envelopes={m: x / top[m] for m, x in t.envelopes.items()}) for t in own]
            for i, own in quarters.items()
        }
        fold = make_fold([*scaled[0], *scaled[2]], [*scaled[1], *scaled[3]])
        yield Case(f"isometric.{person}", "elderly_isometric", "knee", (fold,))


def hold_quarters(whole: Recording, task: str, sign: float) -> Iterator[TorqueTrial]:
    """Yield the quarters of a hold, each filtered alone; the joint does not move."""
    raw = {n.removeprefix("emg."): c.samples for n, c in whole.channels.items() if n.startswith("emg.")}
    every, chain, count = round(whole.fs / KEPT_RATE_HZ), emg_chain("hill"), len(whole) // QUARTER_COUNT
    for i in range(QUARTER_COUNT):
        part = slice(i * count, (i + 1) * count)
        force = zero_phase_lowpass(whole["force"][part], MOTION_LOWPASS_HZ, 4, whole.fs)[::every]
        envelopes = {m: chain.zero_phase(x[part], whole.fs, maximum=1.0)[::every] for m, x in raw.items()}
        yield TorqueTrial(
            f"{whole.participant} {task}, quarter {i + 1}", "knee", whole.time[part][::every], envelopes,
            {"knee": np.zeros(len(force))}, sign * force, group=f"quarter {i + 1}", unit="N",
        )  # fmt: skip


def standing_case(folder: Path) -> Case:
    """Return the knee extended from sitting, which is fitted, and bent standing, which is held out."""
    study = init(folder, dataset="uci_lower_limb")
    return Case(
        "sen_to_pie", "uci_lower_limb", "knee",
        tuple(
            make_fold(leg_extension_trials(study, person)[0], [standing_trial(study, person)])
            for person in STANDING_PEOPLE
        ),
    )  # fmt: skip


def standing_trial(study: Study, person: str) -> TorqueTrial:
    """Return a person's knee flexion standing; its torque is the formula that the leg's extension has, from hanging."""
    own = [r for r in study.recordings() if r.participant == person]
    standing = next(r for r in own if r.protocol == "knee_flexion_standing")
    top = find_maxima(study, person, [r for r in own if r.protocol == "leg_extension"])
    leg, fs = winter(MEAN_BODY[0], shank_length(MEAN_BODY[1])), standing.fs
    sign = 1.0 if study.config.rig.lifts == "flexion" else -1.0
    angle = sign * zero_phase_lowpass(standing["angle.knee"], MOTION_LOWPASS_HZ, 4, fs)
    flexion = angle - float(np.quantile(angle, 0.05))
    acceleration = central_difference(central_difference(flexion, fs), fs)
    torque = sign * (leg.inertia * acceleration + leg.gravity() * np.sin(flexion))
    every = round(fs / KEPT_RATE_HZ)
    envelopes = relative_envelopes(study, standing, top, causal=False)
    fitted = leg_extension_trials(study, person)[0][0]
    return TorqueTrial(
        standing.name, "knee", standing.time[::every], {m: x[::every] for m, x in envelopes.items()},
        {"knee": sign * flexion[::every]}, torque[::every], muscles=fitted.muscles,
    )  # fmt: skip


if __name__ == "__main__":
    for each in case_rows(RANKING_FILE):
        print(f"{each.id}: {each.value:.4g} {each.unit}; {each.note}")
