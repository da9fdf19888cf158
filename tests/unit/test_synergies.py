"""Muscle synergies: known ones are found again, their number is, and bad input is named."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import IdentificationError, PellucidError
from pellucid.emg.estimators.synergies import (
    Synergies,
    SynergyCount,
    chance_similarity,
    common_number,
    count_synergies,
    find_synergies,
    similarity,
    solve_non_negative,
)
from pellucid.emg.estimators.synergies import synergies as array_synergies
from pellucid.emg.study.muscle_channels import MuscleEnvelopes
from pellucid.emg.study.synergies.find_synergies import divide_by_own_maximum
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, report, synergies

MUSCLES = ("a", "b", "c", "d", "e", "f", "g")
TIME = np.arange(0.0, 20.0, 0.02)
WEIGHTS = np.array([[1, 0.8, 0.1, 0, 0, 0.3, 0], [0, 0.1, 1, 0.7, 0.2, 0, 0.4], [0.2, 0, 0, 0.3, 1, 0.9, 0.6]])
STUDY = """
name = "groups"
[rig]
joint = "leg"
motion = "rotary"
lifts = "flexion"
[participants.P1]
[participants.P2]
[channels]
time = {{ column = "time", unit = "s" }}
{channels}
[synergies]
chain = "none"
{more}
{recordings}
"""


def envelopes(seed: int, weights=WEIGHTS, noise: float = 0.03) -> np.ndarray:
    rng = np.random.default_rng(seed)
    phases = 2.0 * np.pi * np.arange(len(weights)) / len(weights)
    cycle = 2.0 * np.pi * TIME[:, None] * rng.uniform(0.9, 1.1) + phases
    size = np.repeat(rng.uniform(0.7, 1.0, (20, len(weights))), 50, axis=0)
    active = size * np.clip(np.sin(cycle), 0.0, None) ** 2
    return np.clip(active @ weights + noise * rng.standard_normal((len(TIME), weights.shape[1])), 0.0, None)


def study(folder, *, muscles=MUSCLES, more="most = 3", people=("P1", "P2"), change=lambda x: x):
    folder.mkdir()
    recordings = []
    for i, person in enumerate(people):
        for j, use in enumerate(("fit", "validate")):
            name = f"{person}_{use}"
            x = change(envelopes(10 * i + j))[:, : len(muscles)]
            np.savetxt(
                folder / f"{name}.csv", np.column_stack([TIME, x]), delimiter=",", header=",".join(("time", *muscles)),
                comments="", fmt="%.6g",
            )  # fmt: skip
            recordings.append(
                f'[[recordings]]\nname = "{name}"\nfile = "{name}.csv"\nuse = "{use}"\nparticipant = "{person}"\n'
            )
    channels = "\n".join(f'emg.{m} = {{ column = "{m}", unit = "1" }}' for m in muscles)
    text = STUDY.format(channels=channels, more=more, recordings="\n".join(recordings))
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return open_study(folder)


def test_known_synergies_are_found_again():
    found = find_synergies(envelopes(1), MUSCLES, 3)
    alike, order = similarity(Synergies(MUSCLES, WEIGHTS), found)
    assert alike > 0.98
    assert sorted(order.tolist()) == [0, 1, 2]
    assert alike > chance_similarity(Synergies(MUSCLES, WEIGHTS), found)


def test_other_weights_are_not_alike():
    other = np.random.default_rng(3).permuted(WEIGHTS, axis=1)
    one, two = find_synergies(envelopes(1), MUSCLES, 3), find_synergies(envelopes(2, other), MUSCLES, 3)
    assert similarity(one, two)[0] < chance_similarity(one, two) + 0.05


@pytest.mark.parametrize("heldout", [None, envelopes(5)])
def test_their_number_is_found_by_what_was_not_fitted(heldout):
    count = count_synergies(envelopes(1), TIME, MUSCLES, heldout, most=5)
    assert count.best == 3
    assert count.interval == (3, 3)
    assert count.predicting == 3
    assert count.heldout[2] > 0.95
    assert count.left_out[2] > 0.9
    assert count.shuffled[2] < count.heldout[2] - 0.1


def test_the_number_is_the_smallest_within_one_standard_error_and_its_interval_covers_other_choices():
    errors = np.array([[0.9, 0.30, 0.29, 0.4], [0.8, 0.28, 0.31, 0.4], [0.9, 0.31, 0.26, 0.5], [0.9, 0.25, 0.27, 0.4]])
    flat = np.ones(4)
    count = SynergyCount(np.arange(1, 5), flat, flat, flat, flat, flat, errors)
    assert count.best == 2
    assert count.interval[0] == 2
    assert count.interval[1] >= 3
    assert replace(count, errors=errors[:, [0, 3, 2, 1]]).best == 3
    assert "2 synergies (2 to" in count.sentence(2)


def test_stretches_of_one_steady_movement_have_one_number():
    """A quiet muscle, and one with noise of its own, move a threshold on every muscle's variance, and not this."""
    rng = np.random.default_rng(4)
    whole = np.concatenate([envelopes(seed, noise=0.06) for seed in range(3)])
    whole[:, 3] += 0.25 * np.abs(np.convolve(rng.standard_normal(len(whole)), np.full(15, 1.0 / 4.0), "same"))
    numbers = [len(array_synergies(part, fs=50.0)) for part in np.split(whole, 6)]
    assert max(numbers) - min(numbers) <= 1


def test_muscles_count_alike_in_arrays_as_in_studies():
    plain = envelopes(2)
    sizes = np.array([1.0, 1e-3, 1.0, 50.0, 1.0, 1.0, 0.1])
    one, other = (array_synergies(x, fs=50.0) for x in (plain, sizes * plain))
    assert len(one) == len(other) == 3
    assert other.weights == pytest.approx(one.weights, abs=1e-6)


def test_a_muscle_that_hardly_works_beside_its_maximal_contraction_counts_as_the_others():
    loud = {"a": np.array([0.1, 0.8]), "b": np.array([0.01, 0.02])}
    quiet = {"a": np.array([0.4, 0.2]), "b": np.array([0.005, 0.04])}
    made = [
        MuscleEnvelopes(name, "P1", None, heldout, "", np.array([0.0, 0.1]), each)
        for name, heldout, each in (("fitted", False, loud), ("judged", True, quiet))
    ]
    fitted, judged = divide_by_own_maximum(made)
    assert fitted.envelopes["b"].tolist() == [0.5, 1.0]
    assert judged.envelopes["b"].tolist() == [0.25, 2.0]
    (alone,) = divide_by_own_maximum(made[1:])
    assert alone.envelopes["b"].tolist() == [0.125, 1.0]


def test_a_muscle_left_out_is_told_from_the_others():
    found, new = find_synergies(envelopes(1), MUSCLES, 3), envelopes(7)
    assert np.corrcoef(found.predict_muscle(new, 2), new[:, 2])[0, 1] > 0.95
    assert np.array_equal(found.predict_muscle(new, 2), found.predict_muscle(np.where(np.arange(7) == 2, 0.0, new), 2))


def test_non_negative_least_squares_are_those_of_scipy():
    from scipy.optimize import nnls

    rng = np.random.default_rng(0)
    a, b = rng.random((8, 4)), rng.standard_normal((8, 30)) + 0.5
    assert solve_non_negative(a, b) == pytest.approx(np.column_stack([nnls(a, x)[0] for x in b.T]), abs=1e-5)


@pytest.mark.parametrize(
    ("change", "muscles", "said"),
    [
        (lambda x: x[:, :2], ("a", "b"), "found 2 muscles"),
        (
            lambda x: np.where(np.arange(x.size).reshape(x.shape) == 66, np.nan, x),
            MUSCLES,
            r"d: found missing samples \(NaN\)",
        ),
        (lambda x: x - 0.5, MUSCLES, "none below 0: rectify"),
        (lambda x: x * (np.arange(7) != 4), MUSCLES, "e: found no activity at all"),
    ],
)
def test_what_cannot_be_factored_is_refused(change, muscles, said):
    with pytest.raises(IdentificationError, match=said):
        find_synergies(change(envelopes(1)), muscles, 2)
    with pytest.raises(IdentificationError, match="expected 1 to 7"):
        find_synergies(envelopes(1), MUSCLES, 9)


def count_of(best, seed, sure=True):
    """Return a count that chooses `best` on every block, or on half of them only one more."""
    rng = np.random.default_rng(seed)
    numbers = np.arange(1, 7)
    errors = np.abs(numbers - best) + 0.01 * rng.standard_normal((5, 6))
    if not sure:
        errors[::2] = np.abs(numbers - best - 1) + 0.01 * rng.standard_normal((3, 6))
    plain = np.zeros(6)
    return SynergyCount(numbers, plain, plain, plain, plain, plain, errors)


def test_the_common_number_has_an_interval_over_people():
    alike = common_number([[count_of(4, seed)] for seed in range(8)])
    assert (alike.number, alike.interval, alike.people) == (4, (4, 4), 8)
    differing = common_number([[count_of(best, best)] for best in (2, 3, 4, 5, 5, 6)])
    assert differing.interval[0] < differing.number <= differing.interval[1]
    assert differing.interval[1] - differing.interval[0] >= 2


@pytest.mark.nightly
def test_people_share_them(tmp_path):
    opened = study(tmp_path / "groups", more="most = 3")
    assert not check(opened)
    found = synergies(opened)
    rows = {row.id: row.value for row in found.rows}
    assert rows["groups.P1.synergies.number"] == rows["groups.P2.synergies.number"] == 3
    assert rows["groups.synergies.number"] == rows["groups.synergies.number.low"] == 3
    assert rows["groups.synergies.alike.P1.P2.cosine"] > 0.98
    page = report(opened, found).read_text()
    assert all(part in page for part in ("synergy_count_1", "synergies_2", "Similarity of synergies"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"muscles": MUSCLES[:2]}, "found 2 muscles"),
        ({"more": "number = 9"}, "found 9, expected at most 7"),
        ({"more": 'muscles = ["a", "b", "z"]'}, "expected z too"),
        ({"change": lambda x: x - 0.5}, "below 0"),
    ],
)
def test_a_study_that_cannot_be_answered_is_refused(tmp_path, options, said):
    opened = study(tmp_path / "groups", people=("P1",), **options)
    with pytest.raises(PellucidError, match=said):
        synergies(opened)
