"""Torque maps: ridge in closed form, features, folds that do not leak, selection within what is fitted."""

import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from made_muscles import trial as muscle_trial

from pellucid._errors import IdentificationError, RecordingError
from pellucid.emg.estimators import adaptive_correction, torque_map
from pellucid.emg.estimators.condition_choice import Examination
from pellucid.emg.estimators.cross_validation import block_folds, grouped_folds, score
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES
from pellucid.emg.estimators.families.family import Family
from pellucid.emg.estimators.feature_scale import smooth, smoothing_delay
from pellucid.emg.estimators.ridge import Ridge
from pellucid.emg.estimators.torque_map import (
    MAP_FITTING,
    MapJob,
    cross_validate_torque_maps,
    fit_torque_map,
    fit_torque_maps,
)
from pellucid.emg.estimators.torque_trial import (
    ENVELOPE_LAGS_S,
    FeatureSet,
    MovedBody,
    TorqueTrial,
    compute_features,
    human_torque,
    list_feature_sets,
)

FS = 100.0


def slow(n: int, rng: np.random.Generator, width: int = 51) -> np.ndarray:
    """A smooth random signal: neighbouring samples are almost the same."""
    window = np.hanning(width)
    return np.convolve(rng.standard_normal(n + width - 1), window / np.linalg.norm(window), mode="valid")


def trial(name: str, seed: int, *, n: int = 400, late: int = 0, noise: float = 0.05, **changes) -> TorqueTrial:
    """Torque of a flexor less an extensor, `late` samples after their EMG, plus gravity."""
    rng = np.random.default_rng(seed)
    flexor, extensor = (np.abs(slow(n + 20, rng)) for _ in range(2))
    angle = 0.5 * slow(n, rng)
    pull = (10.0 * flexor - 8.0 * extensor)[20 - late : 20 - late + n]
    torque = pull + 5.0 * np.sin(angle) + noise * rng.standard_normal(n)
    made = TorqueTrial(
        name, "knee", np.arange(n) / FS, {"flexor": flexor[20:], "extensor": extensor[20:]}, {"knee": angle}, torque,
        group=name,
    )  # fmt: skip
    return replace(made, **changes)


@pytest.mark.parametrize("alpha", [0.0, 1e-2, 1.0, 300.0])
def test_ridge_is_scikit_learns(alpha):
    from sklearn.linear_model import Ridge as Reference
    from sklearn.preprocessing import StandardScaler

    rng = np.random.default_rng(0)
    x, new = (rng.standard_normal((n, 6)) * np.array([1e-4, 1, 30, 1, 1, 2]) + 3.0 for n in (200, 50))
    y = x @ np.array([2e4, 1.0, 0.1, 0.0, -3.0, 1.0]) + rng.standard_normal(200)
    scaler = StandardScaler().fit(x)
    reference = Reference(alpha).fit(scaler.transform(x), y)
    assert Ridge(alpha).fit(x, y).predict(new) == pytest.approx(reference.predict(scaler.transform(new)), rel=1e-10)


@pytest.mark.parametrize("penalties", [(0.0, 1e-2, 300.0), (1e-2, 300.0)])
@pytest.mark.parametrize("features", [5, 90])
def test_ridges_that_share_their_work_are_the_same(penalties, features):
    rng = np.random.default_rng(2)
    x, y, new = rng.standard_normal((60, features)), rng.standard_normal(60), rng.standard_normal((7, features))
    x[:, 4] = x[:, 3]  # which says nothing more
    shared = Ridge(products=(0, 1)).predict_each(x, y, penalties, new)
    for alpha, each in zip(penalties, shared, strict=True):
        expected = Ridge(alpha, (0, 1)).fit(x, y).predict(new)
        np.testing.assert_allclose(each, expected, rtol=1e-10, atol=1e-10)


def test_ridge_bears_constant_and_repeated_features():
    rng = np.random.default_rng(1)
    a = rng.standard_normal(100)
    x = np.c_[a, a, np.ones(100)]
    assert Ridge(0.0).fit(x, 3.0 * a + 2.0).predict(x) == pytest.approx(3.0 * a + 2.0, abs=1e-10)


def test_products_of_features():
    rng = np.random.default_rng(2)
    x = rng.standard_normal((200, 3))
    y = x[:, 0] * x[:, 1] + x[:, 1] ** 2 - x[:, 2]
    assert Ridge(0.0, products=(0, 1)).fit(x, y).predict(x) == pytest.approx(y, abs=1e-10)
    assert score(y, Ridge(0.0).fit(x, y).predict(x)).r2 < 0.6
    with pytest.raises(IdentificationError, match="penalty -1"):
        Ridge(-1.0).fit(x, y)


def test_scores():
    y = np.array([0.0, 1.0, 2.0, 3.0])
    assert score(y, y).r2 == 1.0
    assert score(y, np.full(4, 1.5)).r2 == 0.0
    assert score(y, y + 2.0).rmse == 2.0


def test_smoothing_is_50_ms_and_says_its_delay():
    ramp = np.arange(1000.0) / 500.0
    assert smooth(ramp, 0.05, 500.0)[100:-100] == pytest.approx(ramp[100:-100])
    late = smooth(ramp, 0.05, 500.0, causal=True)[100:-100]
    assert smoothing_delay(0.05, 500.0) == 0.024
    assert late == pytest.approx(ramp[100:-100] - 0.024)


def test_features_know_only_the_past():
    one = trial(
        "a", 1, angles={"knee": slow(400, np.random.default_rng(5)), "hip": slow(400, np.random.default_rng(6))}
    )
    full = FeatureSet(neighbours=True, velocities=True, accelerations=True, lags=ENVELOPE_LAGS_S)
    seen = compute_features(one, full, causal=True)
    assert seen.names[:2] == ("emg.flexor", "emg.flexor 50 ms ago")
    assert [seen.names[i] for i in seen.motion][:4] == ["angle.knee", "velocity.knee", "acceleration.knee", "angle.hip"]
    changed = replace(
        one,
        envelopes={m: np.where(np.arange(400) < 200, x, -x) for m, x in one.envelopes.items()},
        angles={j: np.where(np.arange(400) < 200, x, -x) for j, x in one.angles.items()},
    )
    after = compute_features(changed, full, causal=True)
    assert np.array_equal(seen.x[:200], after.x[:200])
    assert not np.array_equal(seen.x[200:], after.x[200:])
    lagged = seen.x[:, 1]
    assert np.array_equal(lagged[5:], one.envelopes["flexor"][:-5])


def test_torque_is_no_feature():
    one = trial("a", 1)
    other = replace(one, torque=one.torque[::-1].copy())
    for chosen in list_feature_sets(neighbours=False):
        assert np.array_equal(compute_features(one, chosen).x, compute_features(other, chosen).x)


def test_blocks_cover_everything_once_and_keep_their_distance():
    time = np.arange(500) / FS
    folds = block_folds(time, 5, 0.2)
    assert np.array_equal(np.concatenate([evaluated for _, evaluated in folds]), np.arange(500))
    for fitted, evaluated in folds:
        assert np.abs(time[fitted][:, None] - time[evaluated]).min() > 0.2
    with pytest.raises(IdentificationError, match="gaps of 10 s"):
        block_folds(time, 5, 10.0)


def test_groups_are_left_out_whole():
    groups = np.array(["a", "a", "b", "c", "b"])
    assert [evaluated.tolist() for _, evaluated in grouped_folds(groups)] == [[0, 1], [2, 4], [3]]
    with pytest.raises(IdentificationError, match="found 1 group"):
        grouped_folds(["a", "a"])


def copies(seed: int, groups: int) -> list[TorqueTrial]:
    """Torque that has nothing to do with what is seen; both are smooth, so that neighbours are near-copies."""
    found = []
    for i in range(groups):
        rng = np.random.default_rng(seed + i)
        emg, angles = {m: slow(400, rng, 151) for m in "abcd"}, {"knee": slow(400, rng, 151)}
        time, torque = np.arange(400) / FS, 10.0 * slow(400, rng, 151)
        found.append(TorqueTrial(f"r{i}", "knee", time, emg, angles, torque, group=f"r{i}"))
    return found


@pytest.mark.parametrize("name", ["boost", "bagging", "tree"])
def test_an_unrelated_torque_is_not_predicted(name):
    """Of samples drawn at random, a tree finds the neighbour it was fitted to; of whole trials or blocks it cannot."""
    trials = copies(40, 3)
    x = np.vstack([compute_features(t, FeatureSet()).x for t in trials])
    y = np.concatenate([t.torque for t in trials])
    shuffled = np.random.default_rng(0).permutation(len(y))
    leaky, family = np.empty(len(y)), ESTIMATOR_FAMILIES[f"{name}_published"]
    for evaluated in np.array_split(shuffled, 5):
        fitted = np.setdiff1d(shuffled, evaluated)
        leaky[evaluated] = family.make(family.settings[0], None).fit(x[fitted], y[fitted]).predict(x[evaluated])
    assert score(y, leaky).r2 > 0.5
    plain = f"{name}_published"
    assert cross_validate_torque_maps(trials, [plain])[plain].score.r2 < 0.1
    assert fit_torque_map(trials[:1], plain).choice.score.r2 < 0.1


def test_choices_do_not_see_what_is_judged(monkeypatch):
    """A spoiled repetition changes nothing in the map that judges it."""
    trials = [trial(f"r{i}", i) for i in range(3)]
    spoiled = [*trials[:2], replace(trials[2], torque=-5.0 * trials[2].torque)]
    before, after = (cross_validate_torque_maps(t, ["ridge"])["ridge"] for t in (trials, spoiled))
    assert np.array_equal(before.predicted["r2"], after.predicted["r2"])
    assert not np.array_equal(before.predicted["r0"], after.predicted["r0"])


@pytest.mark.parametrize("name", ["boost_published", "bagging_published", "ridge", "linear"])
def test_a_torque_that_follows_emg_is_predicted(name):
    found = cross_validate_torque_maps([trial(f"r{i}", i, n=600) for i in range(3)], [name])[name]
    assert found.score.r2 > (0.98 if name in ("ridge", "linear") else 0.75)
    assert set(found.by_trial) == set(found.predicted) == {"r0", "r1", "r2"}
    assert len(found.choices) == 3


def test_lags_are_chosen_where_force_follows_late():
    trials = [trial(f"r{i}", i, late=10) for i in range(3)]
    found = cross_validate_torque_maps(trials, ["ridge", "ridge_lags"])
    assert found["ridge_lags"].score.rmse < 0.5 * found["ridge"].score.rmse


def test_one_recording_is_chosen_on_in_blocks():
    found = fit_torque_map([trial("a", 3, n=800)], "ridge")
    assert found.choice.score.r2 > 0.98
    assert len(found.choice.tried) == len(ESTIMATOR_FAMILIES["ridge"].settings) * 3
    assert max(ENVELOPE_LAGS_S) < MAP_FITTING.fold_gap_s
    unseen = trial("b", 77)
    assert score(unseen.torque, found.predict(unseen)).r2 > 0.98


@pytest.mark.nightly
@pytest.mark.slow
def test_maps_are_the_same_whoever_fits_them(monkeypatch):
    monkeypatch.setattr(torque_map, "MAP_FITTING", replace(MAP_FITTING, min_parallel_samples=0))
    seen, told = trial("b", 4), []
    jobs = [MapJob([trial("a", 3)], name, causal) for name in ("linear", "mbp", "tree") for causal in (False, True)]
    maps = fit_torque_maps(jobs, lambda i, share: told.append(i), workers=2)
    assert sorted(told) == list(range(len(jobs)))
    for (trials, name, causal, _), (made, _) in zip(jobs, maps, strict=True):
        assert (made.name, made.causal) == (name, causal)
        alone = fit_torque_map(trials, name, causal=causal)
        assert alone.choice.words == made.choice.words
        np.testing.assert_array_equal(made.predict(seen), alone.predict(seen))


def test_a_family_is_one_entry(monkeypatch):
    class Mean:
        def fit(self, x, y):
            self.mean = y.mean()
            return self

        def predict(self, x):
            return np.full(len(x), self.mean)

    monkeypatch.setitem(ESTIMATOR_FAMILIES, "mean", Family("the mean", lambda settings, seen: Mean()))
    found = cross_validate_torque_maps([trial(f"r{i}", i) for i in range(3)], ["mean"])["mean"]
    assert found.score.r2 == pytest.approx(0.0, abs=0.1)


def test_what_cannot_be_fitted_is_refused():
    with pytest.raises(IdentificationError, match="found no trial"):
        fit_torque_map([], "ridge")
    with pytest.raises(IdentificationError, match="held-out trial x"):
        fit_torque_map([trial("x", 0, heldout=True)], "ridge")
    with pytest.raises(IdentificationError, match="found the estimator 'net', expected one of boost"):
        fit_torque_map([trial("x", 0)], "net")
    with pytest.raises(IdentificationError, match="found 2 groups"):
        cross_validate_torque_maps([trial("x", 0), trial("y", 1)])


def test_a_trial_with_a_hole_or_a_wrong_length_is_refused():
    one = trial("a", 0)
    hole = one.torque.copy()
    hole[9] = np.nan
    with pytest.raises(RecordingError, match=r"channel torque: found missing samples .* index 9"):
        replace(one, torque=hole)
    with pytest.raises(RecordingError, match=r"channel emg.flexor: found shape \(9,\)"):
        replace(one, envelopes={"flexor": np.ones(9)})
    with pytest.raises(RecordingError, match="expected the knee's own"):
        replace(one, angles={"hip": one.angles["knee"]})


def test_the_wearer_counteracts_and_carries_what_both_weigh():
    """Against plain equations of motion, with signs: still at 0, the wearer's torque is minus the orthosis's."""
    t = np.arange(2000) / 500.0
    body = MovedBody(10.0, 0.3, 0.5) + MovedBody(3.0, 0.1, 0.2)
    held = human_torque(np.zeros(2000), np.full(2000, 5.0), body, lowpass=6.0, fs=500.0)
    assert held == pytest.approx(-5.0, abs=1e-9)
    q, v, a = 0.4 * np.sin(3.0 * t), 1.2 * np.cos(3.0 * t), -3.6 * np.sin(3.0 * t)
    orthosis = 2.0 * np.sin(2.0 * t)
    found = human_torque(q, orthosis, body, lowpass=6.0, fs=500.0)
    expected = 0.4 * a + 0.7 * v + 13.0 * np.sin(q) - orthosis
    assert found[300:-300] == pytest.approx(expected[300:-300], abs=0.02)


def test_bodies_that_hang_at_angles_of_their_own():
    shank, orthosis = MovedBody(8.0, zero=0.1), MovedBody(4.0, zero=-0.2, offset=0.5)
    q = np.full(100, 0.7)
    found = human_torque(q, np.full(100, 2.5), shank + orthosis, lowpass=6.0, fs=500.0)
    assert found == pytest.approx(8.0 * np.sin(0.6) + 4.0 * np.sin(0.9) - 2.0, abs=1e-9)


def test_an_estimator_that_corrects_another_takes_over_its_fit(monkeypatch):
    trials, calls = [muscle_trial(seconds=2.0)], []
    alone = fit_torque_map(trials, "nmcoa")
    fit_hill = adaptive_correction.fit_hill
    monkeypatch.setattr(adaptive_correction, "fit_hill", lambda *a, **k: calls.append(k["name"]) or fit_hill(*a, **k))
    jobs = [MapJob(trials, "nmcoa"), MapJob(trials, "nmco"), MapJob(trials, "nmcoa")]
    (first, _), (base, _), (corrected, _) = fit_torque_maps(jobs)
    assert sorted(calls) == ["nmco", "nmcoa"]
    assert corrected.base is base
    for each in (first, corrected):
        assert np.array_equal(each.predict(trials[0]), alone.predict(trials[0]))


def test_a_process_that_fits_maps_imports_nothing_of_studies():
    jobs = [MapJob([muscle_trial(seconds=2.0)], "ridge", False, Examination((), False))]
    code = "import pickle, sys; pickle.load(sys.stdin.buffer); print(*(m for m in sys.modules if '.study' in m))"
    made = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps((torque_map._run_jobs, jobs)), capture_output=True, check=True
    )
    assert made.stdout.strip() == b""
