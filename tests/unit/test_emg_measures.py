"""Measures of EMG from arrays: a delay that was put in is found, maxima scale, moments are held against each other."""

import numpy as np
import pytest

import pellucid as pl

FS = 100.0


def effort(time: np.ndarray) -> np.ndarray:
    """Bursts of effort, alike in no two seconds [1]."""
    return np.clip(np.sin(4.4 * time) + 0.4 * np.sin(1.95 * time + 1.0), 0.0, None)


@pytest.mark.parametrize("delay", [-0.04, 0.0, 0.063, 0.12])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_delay_that_was_put_in_lies_in_its_interval(delay, sign):
    rng, time, held = np.random.default_rng(3), np.arange(0.0, 30.0, 1.0 / FS), []
    for _ in range(8):
        envelope = effort(time) + 0.1 * rng.standard_normal(time.size)
        torque = sign * 30.0 * effort(time - delay) + 3.0 * rng.standard_normal(time.size)
        found = pl.electromechanical_delay(envelope, torque, fs=FS)
        assert found.value == pytest.approx(delay, abs=0.01)
        held.append(found.interval[0] <= delay <= found.interval[1])
    assert np.mean(held) >= 0.75


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda x, y: (x, y[:-1]), r"found shapes \(2000,\) and \(1999,\)"),
        (lambda x, y: (x[:500], y[:500]), "found 5 s of envelope and torque, expected at least 10 s"),
        (lambda x, y: (np.where(np.arange(len(x)) == 7, np.nan, x), y), "1 missing samples .* first at 0.07 s"),
        (lambda x, y: (x, np.random.default_rng(1).standard_normal(len(y))), "the delay is not identifiable"),
    ],
)
def test_what_shows_no_delay_is_refused(change, said):
    time = np.arange(2000) / FS
    with pytest.raises(pl.PellucidError, match=said):
        pl.electromechanical_delay(*change(effort(time), effort(time - 0.05)), fs=FS)


def test_a_maximal_contraction_scales_envelopes_of_each_muscle():
    rng = np.random.default_rng(0)
    first, second = (1e-4 * rng.standard_normal((6000, 2)) * gains for gains in ([1.0, 0.2], [0.5, 0.8]))
    top = pl.maximal_envelope([first, second[:5000]], rate=2000.0, chain="hill")
    alone = [pl.maximal_envelope([each], rate=2000.0, chain="hill") for each in (first, second[:5000])]
    np.testing.assert_array_equal(top, [alone[0][0], alone[1][1]])
    own = pl.envelope(first, rate=2000.0, chain="hill", maximum=top)
    assert own[:, 0].max() == pytest.approx(1.0)
    assert own[:, 1].max() < 0.5


def test_contractions_that_make_no_scale_are_refused():
    x = np.random.default_rng(0).standard_normal((6000, 2))
    with pytest.raises(pl.PellucidError, match="found the chain knee, expected one whose envelopes are relative"):
        pl.maximal_envelope([x], rate=2000.0, chain="knee")
    with pytest.raises(pl.PellucidError, match="found contractions of 1 and 2 muscles"):
        pl.maximal_envelope([x, x[:, 0]], rate=2000.0, chain="hill")
    with pytest.raises(pl.PellucidError, match="found 6000 contractions"):
        pl.maximal_envelope(x[:, 0], rate=2000.0, chain="hill")


def test_moments_of_opposed_groups_give_the_index_of_their_sizes():
    time = np.arange(0.0, 20.0, 1.0 / FS)
    flexion, extension = 40.0 * effort(time), -25.0 * effort(time + 0.2)
    found = pl.cocontraction(flexion, extension, fs=FS, moments=True)
    sizes = pl.cocontraction(flexion, -extension, fs=FS)
    assert found.common.value == pytest.approx(sizes.common.value)
    assert found.weighed.value <= 200.0
    swapped = pl.cocontraction(extension, flexion, fs=FS, moments=True)
    assert swapped.common.value == pytest.approx(found.common.value)
    with pytest.raises(pl.PellucidError, match="expected one group's at or above 0 and the other's at or below"):
        pl.cocontraction(flexion, -extension, fs=FS, moments=True)
    with pytest.raises(pl.PellucidError, match="missing samples"):
        pl.cocontraction(np.where(time == 0.0, np.nan, flexion), extension, fs=FS, moments=True)
