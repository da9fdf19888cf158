"""Calibration of a study, from its files to figures and page: moments from elsewhere, and steps against an orthosis."""

import re
from dataclasses import replace
from math import prod
from types import SimpleNamespace

import numpy as np
import pytest
from made_emg import FS, raw_emg
from scipy import signal

import pellucid
from pellucid._errors import IdentificationError, PellucidError, RecordingError
from pellucid.controllers.export.export_answer import export_answer
from pellucid.emg.estimators.condition_choice import ConditionTestErrors, run_condition_tests
from pellucid.emg.estimators.cross_validation import Score
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES, STACKED
from pellucid.emg.estimators.live_torque import LiveTorque
from pellucid.emg.estimators.muscle_trials import count_warm_up_samples
from pellucid.emg.estimators.torque_map import CrossValidated, fit_torque_map
from pellucid.emg.estimators.torque_trial import MovedBody, compute_features
from pellucid.emg.study.emg_torque import calibrate as module
from pellucid.emg.study.emg_torque.calibration_page import coverage_text, page
from pellucid.emg.study.emg_torque.estimator_cards import PRODUCT_SEPARATOR
from pellucid.emg.study.emg_torque.live_scores import export_qualifier, limits_of, read_live_scores
from pellucid.emg.study.emg_torque.torque_findings import (
    EstimatorEvaluation,
    TorqueTrace,
    find_worth,
    recommend_by_fold,
    recommend_estimator,
)
from pellucid.emg.study.emg_torque.trial_sources import moment_trials, moved_body, step_trials
from pellucid.emg.study.estimator_folder import describe_card
from pellucid.models.card import CardParameter
from pellucid.models.parameter_card import ParameterCard, read_parameter_card, write_parameter_card
from pellucid.orthosis.strap.orthosis_alone import strapped_torque
from pellucid.orthosis.strap.strap_model import StrapModel
from pellucid.study.exporter import ExportRequest
from pellucid.study.pages.page import write_page
from pellucid.study.procedures.complete_answer import complete_answer
from pellucid.study.procedures.registry import asked, open_study
from pellucid.study.procedures.result import Result
from pellucid.study.procedures.run import calibrate

MOMENTS = """
name = "leg"
[rig]
joint = "leg"
motion = "rotary"
[channels]
time = { column = "time", unit = "s" }
angle.hip = { column = "hip", unit = "deg" }
angle.knee = { column = "knee", unit = "deg" }
[streams.emg.channels]
time = { column = "time", unit = "s" }
emg.flexor = { column = "flexor", unit = "1" }
emg.extensor = { column = "extensor", unit = "1" }
[streams.moments.channels]
time = { column = "time", unit = "s" }
moment.knee = { column = "moment", unit = "N*m" }
[emg_torque]
joints = ["knee"]
chain = "none"
reference_lowpass = "6 Hz"
"""
WINDOW = """
[[recordings]]
name = "{name}"
file = "recordings/angles.csv"
streams = {{ emg = "recordings/emg.csv", moments = "recordings/moments.csv" }}
use = "{use}"
window = ["{start} s", "{end} s"]
"""
STEPS = """
name = "orthosis"
[rig]
joint = "knee"
motion = "rotary"
[participants.S1]
[channels]
time = { column = "time", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "torque", unit = "N*m" }
[streams.emg.channels]
time = { column = "time", unit = "s" }
emg.extensor = { column = "RF", unit = "uV" }
emg.flexor = { column = "LH", unit = "uV" }
[emg_torque]
joints = ["knee"]
chain = "knee"
"""


def table(path, **columns):
    np.savetxt(
        path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="", fmt="%.6g"
    )


def leg(folder, windows=(("fitted", "fit", 0, 5), ("judged", "validate", 5, 9), ("rest", "validate", 9, 12))):
    """Twelve seconds of a leg whose moment is the muscles' pull and gravity."""
    (folder / "recordings").mkdir(parents=True)
    t = np.arange(1200) / 100.0
    rng = np.random.default_rng(8)
    smooth = signal.butter(2, 2.0, fs=100.0, output="sos")
    a, b, hip, knee = (signal.sosfiltfilt(smooth, rng.standard_normal(1200)) for _ in range(4))
    flexor, extensor = (0.1 + 0.8 * np.abs(x) / np.abs(x).max() for x in (a, b))
    moment = 30.0 * flexor - 25.0 * extensor + 5.0 * np.sin(knee) + 0.5 * rng.standard_normal(1200)
    table(folder / "recordings" / "angles.csv", time=t, hip=np.degrees(hip), knee=np.degrees(knee))
    table(folder / "recordings" / "emg.csv", time=t, flexor=flexor, extensor=extensor)
    table(folder / "recordings" / "moments.csv", time=t, moment=moment)
    text = MOMENTS + "".join(WINDOW.format(name=n, use=u, start=s, end=e) for n, u, s, e in windows)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return open_study(folder)


def orthosis(folder, *, cards=True, spoil=None):
    """A wearer who holds an orthosis's torque at three angles, three times."""
    (folder / "recordings").mkdir(parents=True)
    rng = np.random.default_rng(9)
    t, fast = np.arange(3000) / 500.0, np.arange(int(6 * FS)) / FS
    # A study begins with the orthosis alone, on which nobody's EMG is.
    table(folder / "recordings" / "bench.csv", time=t, q=np.sin(t), torque=np.cos(t))
    text = STEPS + '[[recordings]]\nname = "bench"\nfile = "recordings/bench.csv"\nprotocol = "response"\n'
    for angle in (0, 45, 90):
        for repetition in (1, 2, 3):
            name = f"S1_torque_{angle}_{repetition}"
            q = np.radians(angle) + 0.02 * np.sin(3.0 * t)
            own = -5.0 * np.floor(t / 2.0)  # the wearer answers with 0, 5, 10 N m
            wearer = 12.0 * np.sin(q) - own
            pull = np.interp(fast, t, np.maximum(wearer, 0.0))
            table(folder / "recordings" / f"{name}.csv", time=t, q=q, torque=own)
            emg = {"LH": raw_emg(2e-6 + 8e-6 * pull, rng), "RF": raw_emg(np.full(len(fast), 3e-6), rng)}
            if spoil == name:
                emg["LH"] = np.zeros(len(fast))
            table(folder / "recordings" / f"{name}_emg.csv", time=fast, **{m: 1e6 * x for m, x in emg.items()})
            text += f'[[recordings]]\nname = "{name}"\nfile = "recordings/{name}.csv"\nprotocol = "torque_steps"\n'
            text += f'participant = "S1"\nstreams = {{ emg = "recordings/{name}_emg.csv" }}\n'
    (folder / "study.toml").write_text(text, encoding="utf-8")
    study = open_study(folder)
    if cards:
        study.models_dir.mkdir()
        for kind, name, gravity in (("orthosis", "orthosis", 4.0), ("limb", "S1.limb", 8.0)):
            parameter = CardParameter(
                f"{kind}_gravity", "N*m", gravity, 0.01, (gravity - 0.02, gravity + 0.02), False, True
            )
            card = ParameterCard(kind, "orthosis", name, (parameter,), settings={"participant": "S1"})
            write_parameter_card(study.models_dir / f"{name}.json", card)
    return study


@pytest.fixture
def quick(monkeypatch):
    """Estimators that take no time."""
    monkeypatch.setattr(module, "REPORTED_ESTIMATORS", ("ridge", "tree", "motion"))
    monkeypatch.setattr(module, "CAUSAL_ESTIMATORS", ("ridge", "motion"))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """The leg's study, what was found of it, and the shares of work that were told meanwhile."""
    study, said = leg(tmp_path_factory.mktemp("calibrated") / "leg"), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "REPORTED_ESTIMATORS", ("ridge", "tree", "motion"))
        patch.setattr(module, "CAUSAL_ESTIMATORS", ("ridge", "motion"))
        found = calibrate(study, lambda text, share: said.append(share))
    return study, found, said


def test_moments_are_judged_on_what_was_held_out(calibrated):
    study, found, said = calibrated
    rows = {row.id: row for row in found.rows}
    assert {"leg.knee.ridge.r2", "leg.knee.ridge.rmse", "leg.knee.ridge.r2.rest", "leg.knee.ridge.causal.r2"} <= set(
        rows
    )
    assert rows["leg.knee.ridge.r2"].value > 0.9 > rows["leg.knee.motion.r2"].value
    assert {row.command for row in found.rows} == {"calibrate"}
    assert rows["leg.knee.ridge.r2"].split == "heldout"
    assert rows["leg.knee.ridge.r2.cross_validated"].split == "fitted"
    assert rows["leg.knee.ridge.rmse"].unit == "N*m"
    assert 0.0 <= min(said) <= max(said) <= 1.0
    assert [trace.recording for trace in found.traces] == ["judged", "rest"]
    # How well torque is estimated comes first, then whether EMG adds to angles.
    assert found.headline.startswith("knee: RMS error ")
    assert ' EMG improves on joint angles alone for knee on recording "judged"' in found.headline
    assert found.answer.verdict == "yes"
    assert [part.verdict for part in found.answer.parts] == ["yes"] * 3
    assert {number.unit for number in found.answer.numbers} == {"N*m", "1"}
    assert " with ridge regression" in found.headline
    # Every recording that judges is told of, not the first alone.
    assert "on the 2 held-out recordings" in found.headline
    ridge = [rows[f"leg.knee.ridge.r2{tail}"].value for tail in ("", ".rest")]
    assert all(f"(R² {r2:.3f})" in found.headline for r2 in ridge)
    # What is exported is causal, and has figures of its own.
    export = next(step for step in found.answer.next if step.name == "export")
    assert export.command.endswith("--card emg_knee_ridge.json")
    causal = [rows[f"leg.knee.ridge.causal.r2{tail}"].value for tail in ("", ".rest")]
    assert all(f"R² {r2:.3f} on" in export.text or f"and {r2:.3f} on" in export.text for r2 in causal)
    assert "which runs offline only" in export.text
    bare = [rows[f"leg.knee.motion.causal.r2{tail}"].value for tail in ("", ".rest")]
    assert f"(angles alone, also causal: {bare[0]:.3f} and {bare[1]:.3f})" in export.text
    # Every error is compared with the same one without EMG, that of the answer.
    (chosen,) = found.chosen
    alone = {each.recording: each.score for each in chosen.bare}
    for where, bare in alone.items():
        table = next(t for t in found.tables if t.title == f"Torque from EMG: knee, {where}")
        assert all(ratio == pytest.approx(error / bare.rmse) for _, error, _, ratio, _ in table.rows)
    errors = {name: card.cross_validated_rmse for name, card in found.cards.items() if name in found.live}
    assert f"{min(errors, key=errors.get)}.json" in export.command
    missed = rows["leg.emg_knee_ridge.unwatched_exchanges"]
    assert missed.value == len(found.cards["emg_knee_ridge"].watch.alike)
    assert missed.note
    # A recording with the name of a state is not read as one.
    assert 'on recording "rest"' in found.headline
    assert "judged on" not in " ".join(v.text for v in found.verdicts)
    worth_tile, tile = page(study, found).tiles
    assert worth_tile.what == "Gain in R² from EMG"
    assert (tile.what, "rest " in tile.more) == ("Torque error, knee, judged", True)


def test_an_estimator_that_is_no_better_than_angles_is_not_recommended_for_export(calibrated):
    _, found, _ = calibrated
    assert found.answer.qualifier == ""
    name = "emg_knee_ridge"
    poor = replace(found, live={name: tuple(replace(s, r2=0.79, angles_r2=0.8) for s in found.live[name])})
    answer = module.calibration_answer(poor)
    assert answer.qualifier == "offline; exports: R² below 0.8, no better than angles alone"
    assert "export" not in {step.name for step in answer.next}
    assert answer.next[0].text.startswith(f"Do not rely on the causal estimator of knee ({name}.json): R² below 0.8, ")
    # One recording on which EMG adds nothing is not enough.
    first, second = found.live[name]
    assert limits_of((replace(first, r2=0.9, angles_r2=0.91), replace(second, r2=0.9, angles_r2=0.7))) == ()
    limits = {"knee": ("R² below 0.8",), "ankle": ()}
    assert export_qualifier(limits) == "offline; exports: R² below 0.8 for knee"


def test_where_no_recording_is_held_out_the_next_step_is_to_hold_one_out(tmp_path, quick):
    """`report` said to calibrate a study that was calibrated, and `export` said so too."""
    study = leg(tmp_path, [(name, "fit", start, start + 4) for name, start in (("a", 0), ("b", 4), ("c", 8))])
    found = calibrate(study)
    for answer in (found.answer, module.calibration_answer(replace(found, chosen=tuple(
        replace(c, judged=(replace(c.judged[0], score=Score(1.0, 0.1)),)) for c in found.chosen
    )))):  # fmt: skip
        assert module.HOLD_OUT_STEP.text in [step.text for step in answer.next]
    with pytest.raises(PellucidError, match=r'set one recording to use = "validate".*, then use: pellucid calibrate'):
        pellucid.export(study)


def test_the_watch_of_each_card_is_scored_on_held_out_recordings(calibrated):
    study, found, _ = calibrated
    rows = {row.id: row for row in found.rows}
    for score in found.live["emg_knee_ridge"]:
        row = rows[f"leg.emg_knee_ridge.valid_time.knee.{score.recording}"]
        assert (row.value, row.split) == (score.valid_time, "heldout")
        (trial,) = (t for t in moment_trials(study, "knee", causal=True) if t.name == score.recording)
        live = LiveTorque(found.cards["emg_knee_ridge"])
        made = [
            live.step(1.0 + i * live.period, {m: x[i] for m, x in trial.envelopes.items()},
                      {a: trial.angles[a][i] for a in live.card.angles}).valid
            for i in range(len(trial))
        ]  # fmt: skip
        assert np.mean(made) == score.valid_time
    assert read_live_scores("leg", "emg_knee_ridge", found.rows) == found.live["emg_knee_ridge"]
    (table,) = (t for t in found.tables if t.title.startswith("Cards to export"))
    assert [row[0] for row in table.rows] == ["emg_knee_ridge.json"] * 2


def test_an_export_says_how_accurate_it_is_and_what_it_is_not(calibrated, tmp_path):
    study, found, _ = calibrated
    found.save(study)
    place = pellucid.export(study, "c", tmp_path / "c")
    answer, readme = export_answer(study, "c", place), (place / "README.md").read_text(encoding="utf-8")
    for score in found.live["emg_knee_ridge"]:
        assert f"{score.r2:.3f} on recording \"{score.recording}\"" in answer.said
        assert f"{score.angles_r2:.3f}" in answer.said
        assert f"{100 * score.valid_time:.0f} %" in answer.said
    asked_for = ExportRequest(study)
    assert all(sentence in readme for sentence in describe_card(asked_for, "emg_knee_ridge"))
    assert "Estimates torque of knee from past samples (ridge regression, emg_knee_ridge.json)." in readme
    assert f"R² {found.chosen[0].judged[0].score.r2:.3f} for knee in `calibrate` belongs to ridge regression" in readme
    assert answer.qualifier == ""
    study.card("emg_ankle_hill.json").write_text("{}")
    assert "Other exports: `--card emg_ankle_hill.json`." in describe_card(asked_for, "emg_knee_ridge")
    study.card("emg_ankle_hill.json").unlink()
    # The figures of a card from elsewhere are not those of the study's card of that name.
    other = tmp_path / "emg_knee_ridge.json"
    other.write_bytes(study.card(other.name).read_bytes())
    place = pellucid.export(study, "c", tmp_path / "other", card=str(other), allow_outside=True)
    assert "Its error on held-out recordings is not known" in (place / "README.md").read_text(encoding="utf-8")
    assert "is not known" in export_answer(study, "c", place, card=str(other)).said


def test_short_gaps_of_angles_are_interpolated_and_longer_ones_end_a_piece(tmp_path):
    # A computer that stalls for some milliseconds writes such files.
    made = {}
    for name, missing in (("whole", 0), ("short", 3), ("long", 8)):
        folder = leg(tmp_path / name).folder
        t, angles = np.arange(6000) / 500.0, folder / "recordings" / "angles.csv"
        slow = np.genfromtxt(angles, delimiter=",", names=True)
        kept = np.delete(np.arange(6000), np.arange(1000, 1000 + missing))
        table(angles, time=t[kept], **{n: np.interp(t, slow["time"], slow[n])[kept] for n in ("hip", "knee")})
        study = open_study(folder)
        taken = asked(study, "emg_torque")[0].taken(study)
        made[name] = moment_trials(taken, "knee")
    names = {name: [trial.name for trial in trials] for name, trials in made.items()}
    assert names["whole"] == names["short"] == ["fitted", "judged", "rest"]
    assert names["long"] == ["fitted.1", "fitted.2", "judged", "rest"]
    assert [trial.recording for trial in made["long"]] == ["fitted", "fitted", "judged", "rest"]
    whole, short = made["whole"][0], made["short"][0]
    assert np.ptp(np.diff(short.time)) < 1e-9
    assert np.abs(np.interp(whole.time, short.time, short.angles["knee"]) - whole.angles["knee"]).max() < 2e-3


def alike_errors(*rmse):
    """Test errors of an estimator that errs by the same amount in every sample of a test."""
    errors = tuple(np.full(9, each) for each in rmse)
    return ConditionTestErrors(("fast", "slow"), rmse, 1.0, errors=errors, band_errors=errors)


def told(estimator, rmse, recording="a", tests=None, what="knee"):
    examined = None if tests is None else alike_errors(*tests)
    return EstimatorEvaluation(what, estimator, False, recording, Score(rmse, 0.5), None, "", examined=examined)


def test_the_first_named_is_chosen_over_the_same_samples_and_by_nothing_that_judges():
    found = [told("boost", 1.0, tests=(3.0, 3.1)), told("ridge", 2.0, tests=(1.0, 1.1)),
             told("boost", 1.0, "b", (3.0, 3.1)), told("ridge", 9.0, "b", (1.0, 1.1)),
             told("nmcoa", 0.1), told("motion", 0.1), told("motion", 0.2, "b")]  # fmt: skip
    chosen = recommend_estimator(found, "knee")
    # The worst of what judged comes first, and angles alone beside it.
    assert [(e.estimator, e.recording) for e in chosen.judged] == [("ridge", "b"), ("ridge", "a")]
    assert [e.score.rmse for e in chosen.bare] == [0.2, 0.1]
    # What is told the torque is no peer, however small its error.
    assert ESTIMATOR_FAMILIES["nmcoa"].sees_measured_torque
    assert "no peer" in ESTIMATOR_FAMILIES["nmcoa"].description
    assert sum(family.sees_measured_torque for family in ESTIMATOR_FAMILIES.values()) == 1


def weighed_case():
    """Muscles and ridge regression that err alike and apart in the tests, and their torque on two recordings."""
    rng, time = np.random.default_rng(3), np.linspace(0.0, 4.0, 400)
    errors = {name: tuple(rng.standard_normal((3, 400))) for name in ("hill", "ridge")}
    tests = {n: ConditionTestErrors(("a", "b", "c"), (1.0,) * 3, 1.0, 3, errors=e, band_errors=e)
             for n, e in errors.items()}  # fmt: skip
    traces, found = [], []
    for recording in ("like", "unlike"):
        predicted = {n: np.sin(time) + rng.standard_normal(400) for n in tests}
        traces.append(TorqueTrace("knee", recording, time, np.sin(time), predicted, {}))
        found += [replace(told(n, 1.0, recording), examined=tests[n]) for n in tests]
    return found, traces


def test_a_weighted_mean_is_evaluated_on_every_recording_that_is_like_the_fitted_ones():
    found, traces = weighed_case()
    chosen = recommend_estimator(found, "knee", traces, refused={"unlike"})
    judged = {e.recording: e for e in chosen.judged}
    assert judged["unlike"].estimator == "hill"
    assert judged["like"].estimator == STACKED
    assert judged["like"].family.description == "weighted mean of estimators"
    made = chosen.weights.predict(traces[0].predicted)
    assert traces[0].predicted[STACKED] == pytest.approx(made)
    assert judged["like"].score.rmse == pytest.approx(np.sqrt(np.mean((made - traces[0].reference) ** 2)))
    assert judged["like"].score.rmse < 0.85
    assert STACKED not in traces[1].predicted
    # The band of fitted movements does not hold for a recording that is unlike them.
    assert [set(trace.half_width) for trace in traces] == [{STACKED}, set()]
    assert "on recordings unlike the fitted ones by muscles of Hill's type" in chosen.words
    # A mean names what it is of, also where there is little room.
    assert all(f"{100.0 * weight:.0f} %" in chosen.brief for weight in chosen.weights.weights.values())


def test_the_effect_of_rescale_on_the_best_repaired_estimator_is_on_the_terminal():
    poor, good = (Score(1.0, r2) for r2 in (0.3, 0.9))
    whole = replace(told("hill", 1.0, "moved"), score=good, as_recorded=good, repaired=())
    ridge = replace(told("ridge", 1.0, "moved"), score=replace(good, r2=0.8), as_recorded=poor, repaired=("soleus",))
    first, each = module._repair_tables([whole, ridge])
    assert first.rows == (("knee, moved", "ridge regression", 0.3, 0.8, "soleus"),)
    assert (first.max_brief_rows > 0, each.max_brief_rows) == (True, 0)
    assert len(module._repair_tables([whole])) == 1


def test_the_worth_of_emg_has_an_interval_where_an_estimator_had_no_result_in_one_of_the_tests():
    found, traces = weighed_case()
    lost = {"hill": (np.full(400, np.nan),)}
    rmse = {"hill": (np.nan, 1.0, 1.0)}
    found = [
        replace(e, examined=replace(e.examined, rmse=rmse.get(e.estimator, e.examined.rmse),
                                    errors=(*lost.get(e.estimator, e.examined.errors[:1]), *e.examined.errors[1:])))
        for e in found
    ]  # fmt: skip
    alone = {e.recording: replace(e, estimator="motion") for e in weighed_case()[0] if e.estimator == "ridge"}
    for trace in traces:
        trace.predicted["motion"] = 0.5 * np.sin(trace.time)
    chosen = recommend_estimator([*found, *alone.values()], "knee", traces)
    one, *_ = find_worth([chosen], traces, 0.05, {})
    assert one.worth.low < one.worth.gain < one.worth.high


def test_held_out_torque_has_no_part_in_the_weights():
    found, traces = weighed_case()
    other = [replace(t, reference=t.predicted["ridge"] + 0.0) for t in weighed_case()[1]]
    first, second = (recommend_estimator(found, "knee", each) for each in (traces, other))
    assert first.weights == second.weights


def test_the_beginning_of_a_trial_names_no_estimator(tmp_path, quick):
    """A torque that nothing explains in the first samples of a trial costs every estimator the same: nothing."""
    fitted, *_ = moment_trials(leg(tmp_path / "leg"), "knee")
    n = count_warm_up_samples(fitted)
    spoilt = replace(fitted, torque=np.concatenate((np.full(n, 40.0), fitted.torque[n:])))
    fit = fit_torque_map([fitted], "ridge")
    assert fit_torque_map([spoilt], "ridge").choice.score.rmse > 1.5 * fit.choice.score.rmse
    # What names an estimator first neither fits nor judges them.
    assert run_condition_tests(fit, [spoilt]).rmse == run_condition_tests(fit, [fitted]).rmse


def test_a_recording_that_was_to_judge_and_did_not_is_told(tmp_path, quick):
    study = leg(tmp_path / "leg")
    trials = [trial for trial in moment_trials(study, "knee") if trial.name != "rest"]
    said = [v.text for v in module.calibration_verdicts(study, [told("ridge", 1.0, "judged")], trials)]
    assert next(text for text in said if "no torque was recorded there" in text).startswith("rest: ")
    said = list(module.calibration_verdicts(study, [told("ridge", 1.0, r) for r in ("judged", "rest")], trials))
    assert not any("no torque was recorded there" in v.text for v in said)


def test_where_trials_are_left_out_the_others_choose():
    names, trials = ("hill", "ridge"), [SimpleNamespace(name=n, group=n, torque=np.arange(4.0)) for n in "abc"]
    good, bad = alike_errors(1.0, 1.1), alike_errors(3.0, 3.1)
    within = {"hill": (good, bad, bad), "ridge": (bad, good, good)}
    results = {
        name: CrossValidated(Score(1.0, 0.5), {}, {t.name: t.torque for t in trials}, (), within[name])
        for name in names
    }
    own = [replace(told(n, 1.0, ""), by_trial={t.name: Score(1.0 * i, 0.5) for t in trials}, kind="trials")
           for i, n in enumerate(names)]  # fmt: skip
    chosen = recommend_by_fold(trials, results, own)
    assert chosen.by == {"a": "hill", "b": "ridge", "c": "ridge"}
    assert chosen.judged[0].score.rmse == pytest.approx(2.0 / 3.0)
    # RMSE and R² are put together in the same way, and the worst trial is named.
    assert chosen.judged[0].score.r2 == pytest.approx(np.mean([s.r2 for s in chosen.judged[0].by_trial.values()]))
    said = module._headline([chosen])
    assert ", mean over 3 held-out trials, with" in said
    assert "; the worst trial is " in said
    assert chosen.held == {"a": 1.0, "b": 1.0, "c": 1.0}


def test_a_band_says_what_it_holds():
    time = np.linspace(0.0, 4.0, 100)
    trace = TorqueTrace("knee", "a", time, np.sin(time), {"hill": np.sin(time) + 0.1 * (time > 1.0)},
                        {"hill": np.full(100, 0.05)})  # fmt: skip
    assert coverage_text(trace).startswith("; the 95 % prediction band of ")
    assert coverage_text(trace).endswith("covers 25 % of this torque")
    assert coverage_text(TorqueTrace("knee", "a", time, time, {"ridge": time})) == ""


def predict_by_card(card, values):
    """Torque by a card's terms, each a product of features; the offset is a product of none."""
    factors = {name: () if name == "offset" else name.split(" * ") for name in card.values}
    return sum(weight * np.prod([values[f] for f in factors[name]]) for name, weight in card.values.items())


def test_the_card_says_the_same_as_the_map(tmp_path, calibrated):
    study, made, _ = calibrated
    card = made.cards["torque_map_knee"]
    write_parameter_card(tmp_path / "card.json", card)
    card = read_parameter_card(tmp_path / "card.json")
    fitted, evaluated, _ = moment_trials(study, "knee")
    found = fit_torque_map([fitted], "ridge", causal=True)
    seen = compute_features(evaluated, found.choice.features, causal=True)
    expected = found.predict(evaluated)
    for i in (0, 100, 399):
        values = dict(zip(seen.names, seen.x[i], strict=True))
        terms = (card.values[name] * prod(values[factor] for factor in name.split(PRODUCT_SEPARATOR))
                 for name in card.values if name != "offset")  # fmt: skip
        assert card.values["offset"] + sum(terms) == pytest.approx(expected[i], rel=1e-9)
    assert card.settings["causal"] is True
    assert card["emg.flexor"].unit == "N*m"


def test_figures_repeat(calibrated, quick):
    study, found, _ = calibrated
    assert calibrate(study).rows == found.rows


def test_nothing_beyond_a_window_is_seen(tmp_path):
    """What is recorded outside of the fitted window changes no sample of its trial."""
    before = moment_trials(leg(tmp_path / "a"), "knee")[0]
    study = leg(tmp_path / "b")
    for name in ("moments", "emg", "angles"):
        path = study.folder / "recordings" / f"{name}.csv"
        values = np.loadtxt(path, delimiter=",", skiprows=1)
        values[500:, 1:] *= 0.5
        header = path.read_text(encoding="utf-8").splitlines()[0]
        np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.6g")
    after = moment_trials(study, "knee")[0]
    assert before.name == after.name == "fitted"
    assert np.array_equal(before.torque, after.torque)
    assert all(np.array_equal(before.envelopes[m], after.envelopes[m]) for m in before.envelopes)


def test_repetitions_do_not_hang_on_a_recordings_name(tmp_path):
    study = orthosis(tmp_path / "named", cards=False)
    body = MovedBody(12.0)
    named = [trial.group for trial in step_trials(study, "S1", body)]
    assert named == ["1", "2", "3"] * 3
    file = study.folder / "study.toml"
    text = file.read_text(encoding="utf-8")
    for i, entry in enumerate(re.findall(r'name = "(S1_torque_.*)"', text)):
        text = text.replace(f'name = "{entry}"', f'name = "trial{i}"')
    file.write_text(text, encoding="utf-8")
    assert [trial.group for trial in step_trials(open_study(study.folder), "S1", body)] == named
    # Where study.toml says which it is, so it is.
    text = re.sub(r'name = "trial(\d)"', lambda m: f"{m[0]}\nrepetition = {1 + int(m[1]) // 3}", text)
    file.write_text(text, encoding="utf-8")
    assert [trial.group for trial in step_trials(open_study(study.folder), "S1", body)] == [*"111222333"]


def test_steps_are_judged_repetition_by_repetition(tmp_path, quick):
    found = calibrate(orthosis(tmp_path / "orthosis"))
    rows = {row.id: row for row in found.rows}
    assert {"orthosis.emg.S1.rmse.ridge", "orthosis.emg.S1.r2.tree", "orthosis.emg.S1.rmse.ridge.causal"} <= set(rows)
    assert rows["orthosis.emg.S1.rmse.tree"].value < 2.0
    assert rows["orthosis.emg.S1.rmse.motion"].value > 2.0 * rows["orthosis.emg.S1.rmse.tree"].value
    assert any("delays EMG by 113 ms" in verdict.text for verdict in found.verdicts)


@pytest.mark.slow
def test_the_torque_of_the_wearer_goes_through_the_strap_that_has_a_card(tmp_path, quick, monkeypatch):
    monkeypatch.setattr(module, "REPORTED_ESTIMATORS", ("ridge",))
    study = orthosis(tmp_path / "orthosis")
    one = moved_body(study, "S1")
    assert isinstance(one, MovedBody)
    assert one.gravity == 12.0
    coupling, strap = ({"stiffness": 20.0, "damping": 1.0}, {"stiffness": 14.0, "damping": 0.5, "hardening": 25.0})
    said = ["modelled as one rigid body"]
    for kind, values, settings, words in (
        ("coupling", coupling, {}, "a spring and a damper"),
        ("strap", strap, {"model": "hardening"}, "strap of its model card: it hardens"),
    ):
        parameters = tuple(CardParameter(n, "1", v, 0.1, (v - 0.2, v + 0.2), False, True) for n, v in values.items())
        card = ParameterCard(kind, "orthosis", f"S1.{kind}", parameters, settings={"participant": "S1", **settings})
        write_parameter_card(study.models_dir / f"S1.{kind}.json", card)
        body = moved_body(study, "S1")
        assert np.array_equal(body.strap, StrapModel.named(settings.get("model", "kelvin_voigt")).core(values))
        assert (body.orthosis.gravity, body.limb.gravity) == (4.0, 8.0)
        said.append(words)
    trial, rigid = (step_trials(study, "S1", b)[0] for b in (body, one))
    recording = next(r for r in study.recordings() if r.name == trial.name)
    found = strapped_torque(
        recording.time, recording["position"], recording["torque"], orthosis=body.orthosis, limb=body.limb,
        strap=body.strap, lowpass=6.0,
    )  # fmt: skip
    assert np.array_equal(trial.torque, found[:: len(found) // len(trial.torque)])
    assert np.abs(trial.torque - rigid.torque).max() > 1.0
    assert any(said[-1] in verdict.text for verdict in calibrate(study).verdicts)
    for card in ("strap", "coupling"):
        (study.models_dir / f"S1.{card}.json").unlink()
        said.pop()
        assert any(said[-1] in verdict.text for verdict in calibrate(study).verdicts)


def test_the_torque_of_the_wearer_needs_cards(tmp_path, quick):
    with pytest.raises(IdentificationError, match=r"found the cards of no body, expected one of an orthosis.*identify"):
        calibrate(orthosis(tmp_path / "orthosis", cards=False))


def test_a_detached_electrode_is_refused(tmp_path, quick):
    study = orthosis(tmp_path / "orthosis", spoil="S1_torque_45_2")
    with pytest.raises(RecordingError, match=r"S1_torque_45_2_emg.csv .*channel emg.flexor: found 0 µV RMS"):
        calibrate(study)


def test_raw_emg_where_the_chain_expects_volts(tmp_path, quick):
    study = leg(tmp_path / "leg")
    path = study.folder / "study.toml"
    path.write_text(path.read_text(encoding="utf-8").replace('chain = "none"', 'chain = "knee"'), encoding="utf-8")
    with pytest.raises(
        RecordingError, match=r'emg.csv .*found the unit 1, expected V for the chain knee; use chain = "none"'
    ):
        calibrate(open_study(study.folder))


def test_emg_at_a_rate_too_low_for_the_chain(tmp_path, quick):
    study = leg(tmp_path / "leg")
    path = study.folder / "study.toml"
    text = path.read_text(encoding="utf-8").replace('chain = "none"', 'chain = "knee"')
    text = text.replace('column = "flexor", unit = "1"', 'column = "flexor", unit = "V"')
    path.write_text(
        text.replace('column = "extensor", unit = "1"', 'column = "extensor", unit = "V"'), encoding="utf-8"
    )
    with pytest.raises(
        RecordingError, match=r"emg.csv .*channel emg.flexor: found a rate of 100 Hz, expected more than 1000"
    ):
        calibrate(open_study(study.folder))


def test_an_instrument_that_stopped_early_is_refused(tmp_path, quick):
    study = leg(tmp_path / "leg")
    path = study.folder / "recordings" / "emg.csv"
    path.write_text("\n".join(path.read_text(encoding="utf-8").splitlines()[:400]) + "\n", encoding="utf-8")
    with pytest.raises(
        RecordingError, match=r"emg.csv \(recording fitted\).*found samples from 0 s to 3.98 s, expected 0 s to"
    ):
        calibrate(study)


def test_nothing_to_judge_is_refused(tmp_path, quick):
    study = leg(tmp_path / "leg", windows=(("fitted", "fit", 0, 5),))
    with pytest.raises(IdentificationError, match="found 1 recordings to fit and 0 held out"):
        calibrate(study)


def test_a_reference_torque_that_was_computed_is_not_called_measured(tmp_path, quick):
    """It said "measured" of torque that inverse dynamics gives."""
    study = leg(tmp_path / "leg")
    config = study.folder / "study.toml"
    text = config.read_text(encoding="utf-8").replace("[rig]", "simulated = false\n[rig]", 1)
    stated = '[streams.moments]\ncomputed = "torque by inverse dynamics"\n'
    text = text.replace("[streams.moments.channels]", stated + "[streams.moments.channels]")
    text = text.replace("[channels]", "[participants.P1]\n[channels]", 1)
    text = text.replace('use = "', 'participant = "P1"\nuse = "')
    config.write_text(text, encoding="utf-8")
    study = open_study(study.folder)
    said = complete_answer(study, calibrate(study)).basis.sentence
    assert "of 1 person, measured (torque by inverse dynamics); numbers are of held-out data" in said


def test_no_torque_at_all_is_refused(tmp_path, quick):
    study = leg(tmp_path / "leg")
    config = study.folder / "study.toml"
    config.write_text(config.read_text(encoding="utf-8").replace("moment.knee", "other.knee"), encoding="utf-8")
    with pytest.raises(IdentificationError, match="joint knee: found 0 recordings to fit and 0 held out"):
        calibrate(open_study(study.folder))


def test_the_page_shows_what_was_found(tmp_path, calibrated):
    study, found, _ = calibrated
    text = write_page(tmp_path / "report", page(study, found)).read_text(encoding="utf-8")
    for words in (
        "Torque from EMG: knee, judged",
        "Inputs of each estimator",
        "the weighted mean of all candidates",
        "ridge regression without EMG",
        "fig-torque_1",
        "fig-errors",
    ):
        assert words in text


def test_what_was_found_is_kept_until_something_changes(tmp_path, quick):
    study = leg(tmp_path)
    (procedure,) = asked(study, "emg_torque")
    found = calibrate(study)
    assert Result.kept(study, procedure) is None
    found.save(study)
    kept = Result.kept(open_study(tmp_path), procedure)
    for part in ("evaluated", "rows", "tables", "verdicts", "checksums"):
        assert getattr(kept, part) == getattr(found, part)
    for a, b in zip(kept.traces, found.traces, strict=True):
        np.testing.assert_array_equal(a.predicted["ridge"], b.predicted["ridge"])
    assert page(study, kept).headline == page(study, found).headline
    emg = tmp_path / "recordings" / "emg.csv"
    emg.write_text(emg.read_text().replace("0.1", "0.2"), encoding="utf-8")
    assert Result.kept(open_study(tmp_path), procedure) is None
    study.kept_path("emg_torque").write_text("{}", encoding="utf-8")
    assert Result.kept(study, procedure) is None


def test_a_map_of_more_angles_than_a_live_estimator_has_room_for_is_reported_without_a_card(tmp_path, quick):
    """Calibration ended after minutes with "no estimator that can be stepped", and nothing was reported."""
    study = leg(tmp_path / "leg")
    path, t = study.folder / "recordings" / "angles.csv", np.arange(1200) / 100.0
    hip, knee = np.loadtxt(path, delimiter=",", skiprows=1).T[1:]
    more = {f"toe_{i}": 20.0 * np.sin((1.0 + 0.2 * i) * t) for i in range(15)}
    moments = study.folder / "recordings" / "moments.csv"
    moment = np.loadtxt(moments, delimiter=",", skiprows=1).T[1]
    table(path, time=t, hip=hip, knee=knee, **more)
    table(moments, time=t, moment=moment + sum(2.0 * np.radians(x) for x in more.values()))
    text = (study.folder / "study.toml").read_text()
    lines = "".join(f'angle.{name} = {{ column = "{name}", unit = "deg" }}\n' for name in more)
    (study.folder / "study.toml").write_text(text.replace("[streams.emg.channels]", f"{lines}[streams.emg.channels]"))
    found = calibrate(open_study(study.folder))
    assert not [name for name in found.cards if name.startswith("emg_")]
    assert {each.estimator for each in found.evaluated} >= {"ridge", "tree"}
    (one,) = [v for v in found.verdicts if v.finding == "inputs_beyond_live"]
    assert "emg_knee_ridge" in one.text
    assert "expected 1 to 16; found 2 EMG channels and 17 angles" in one.text
    assert "Delete the channels angle.<joint>" in one.said
