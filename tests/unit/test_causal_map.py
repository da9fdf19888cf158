"""A causal map from raw EMG to torque: fitted on trials, kept on a card, run by the core."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import IdentificationError, PellucidError
from pellucid.emg.estimators.causal_map import CausalMap, EmgTrial, fit_causal_map
from pellucid.models.parameter_card import read_parameter_card, write_parameter_card

FS, EMG_FS, SECONDS = 500.0, 2048.0, 10.0


def trial(repetition, angle, rng, turn=0.0):
    """Two muscles that pull either way; the torque grows with the first one's envelope and the angle."""
    time, emg_time = np.arange(0.0, SECONDS, 1.0 / FS), np.arange(0.0, SECONDS, 1.0 / EMG_FS)
    level = 1.0 + 0.8 * np.sin(0.7 * emg_time)[:, None] * [1.0, -1.0]
    emg = 1e-5 * level * rng.standard_normal((len(emg_time), 2))
    pull = np.interp(time, emg_time, level[:, 1] - level[:, 0])
    position = np.full(len(time), angle) + turn * np.clip(time - 5.0, 0.0, 1.0)
    return EmgTrial(repetition, time, position, 5.0 * pull * (1.0 + angle), emg_time, emg)


@pytest.fixture(scope="module")
def trials():
    rng = np.random.default_rng(3)
    return [trial(repetition, angle, rng) for repetition in "123" for angle in (0.2, 0.8)]


@pytest.fixture(scope="module")
def found(trials):
    return fit_causal_map(trials, muscles=("rectus_femoris", "biceps_femoris"))


def test_the_core_runs_what_was_fitted(found, trials):
    """Sample by sample the core says what the map says in one go, but for the filters' start."""
    core, one = found.build(), trials[1]
    said, end = [], 0
    for t, q in zip(one.time, one.position, strict=True):
        begin, end = end, int(np.searchsorted(one.emg_time, t, side="right"))
        core.listen(one.emg[begin:end])
        said.append(core.torque(q))
    late = one.time > 2.0
    error = np.sqrt(np.mean((np.array(said) - one.torque)[late] ** 2))
    assert error < 1.3 * found.rmse
    assert found.rmse < 0.5 * np.std(one.torque)
    assert core.valid


def test_a_card_keeps_every_number(found, tmp_path):
    path = write_parameter_card(
        tmp_path / "S1.emg.json", found.card("study", "S1.emg", {"S1_steps": "ab" * 32}, participant="S1")
    )
    card = read_parameter_card(path)
    assert card["rectus_femoris * angle"].unit == "N*m/(V*rad)"
    assert card["offset"].unit == "N*m"
    again = CausalMap.from_card(card)
    assert again.muscles == found.muscles
    for name, value in found.parameters().items():
        np.testing.assert_array_equal(again.parameters()[name], value, err_msg=name)
    assert again.rmse == found.rmse


def test_another_card_is_refused(found):
    card = found.card("study", "S1.emg")
    with pytest.raises(PellucidError, match='of kind "limb", expected "causal_emg_map"'):
        CausalMap.from_card(replace(card, kind="limb"))
    with pytest.raises(PellucidError, match="found no 'corner'"):
        CausalMap.from_card(replace(card, settings={k: v for k, v in card.settings.items() if k != "corner"}))


def test_a_card_with_a_word_for_a_number_is_refused(found):
    card = found.card("study", "S1.emg")
    for name in ("fs", "floor.rectus_femoris"):
        with pytest.raises(PellucidError, match=rf"S1\.emg, {name}: found 'fast', expected a number"):
            CausalMap.from_card(replace(card, settings={**card.settings, name: "fast"}))


def test_repetitions_that_were_not_held_are_left_out(found, trials):
    again = fit_causal_map([*trials, trial("4", 0.5, np.random.default_rng(9), turn=6.0)])
    np.testing.assert_array_equal(again.weights, found.weights)
    with pytest.raises(IdentificationError, match="fewer than two repetitions"):
        fit_causal_map(trials[:2])
