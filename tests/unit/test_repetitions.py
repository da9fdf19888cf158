"""Repetitions are found from an angle, whatever its sign, its zero and the rest between them."""

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.emg.signals.repetitions import find_repetitions
from pellucid.study import datasets

FS = 100.0


def movement(count=4, *, rest=1.2, excursion=-1.0, pause=1.0, last=True, rng=None):
    """Rises and falls of 1 s each with a hold of 0.5 s, and pauses between; the last one may not come back."""
    time = np.arange(round(FS)) / FS
    rise = 10 * time**3 - 15 * time**4 + 6 * time**5
    one = np.concatenate([rise, np.ones(round(0.5 * FS)), rise[::-1], np.zeros(round(pause * FS))])
    parts = [np.zeros(round(pause * FS))] + [one] * count
    if not last:
        parts.append(rise)
    angle = rest + excursion * np.concatenate(parts)
    return angle if rng is None else angle + 0.005 * rng.standard_normal(len(angle))


@pytest.mark.parametrize("excursion", [-1.0, 0.6])
@pytest.mark.parametrize("pause", [0.1, 2.0])
def test_each_is_found_once(excursion, pause, rng):
    angle = movement(excursion=excursion, pause=pause, rng=rng)
    found = find_repetitions(angle, FS)
    assert len(found) == 4
    assert found.rest == pytest.approx(1.2, abs=0.03)
    assert found.unfinished is None
    for i, repetition in enumerate(found.each):
        middle = (pause + i * (2.5 + pause) + 1.25) * FS
        assert abs(repetition.turn - middle) < 0.4 * FS
        assert repetition.excursion == pytest.approx(excursion, abs=0.05)
        if i:
            # In the middle of the pause.
            assert abs(repetition.start - (middle - 1.25 * FS - 0.5 * pause * FS)) < 0.15 * FS
    assert [r.start for r in found.each[1:]] == [r.end for r in found.each[:-1]]
    labels = found.labels(len(angle))
    assert set(labels) == {0, 1, 2, 3}
    assert np.all(np.diff(labels) >= 0)


def test_what_did_not_come_back_is_none_of_them(rng):
    angle = movement(3, last=False, rng=rng)
    found = find_repetitions(angle, FS)
    assert len(found) == 3
    assert found.unfinished.stop == len(angle)
    assert found.unfinished.start == found.each[-1].end
    assert set(found.labels(len(angle))) == {-1, 0, 1, 2}


def test_a_recording_that_begins_away_from_rest():
    angle = movement(3)[round(1.8 * FS) :]
    # It begins at the far end, which is not the rest.
    named = find_repetitions(angle, FS, rest="high")
    assert len(named) == 2
    assert named.rest == pytest.approx(1.2, abs=0.02)
    assert find_repetitions(angle, FS).rest == pytest.approx(0.2, abs=0.02)


def test_small_wobbles_are_no_repetitions(rng):
    angle = movement(2, rng=rng)
    angle[50:150] -= 0.3 * np.sin(np.linspace(0.0, np.pi, 100)) ** 2
    assert len(find_repetitions(angle, FS)) == 2


def test_what_is_no_movement_is_told():
    with pytest.raises(RecordingError, match=r"one.txt: found a range of 0.*deg, expected at least 15 deg"):
        find_repetitions(np.full(500, 0.3), FS, where="one.txt")
    with pytest.raises(RecordingError, match="found no movement that leaves"):
        find_repetitions(movement(0, last=False), FS)
    with pytest.raises(RecordingError, match=r"found 1 missing samples .NaN., the first at index 7"):
        find_repetitions(np.where(np.arange(500) == 7, np.nan, movement(1)[np.arange(500) % 400]), FS)


def test_people_s_leg_extensions(data_folder, tmp_path):
    study = datasets.init(tmp_path / "study", dataset="uci_lower_limb")
    # Counted on a plot of the angle.
    counted = {"1N": 4, "3N": 4, "4N": 4, "5N": 4, "6N": 6, "7N": 5, "8N": 4}
    counted |= {"1N_standing": 4, "3N_standing": 4, "4N_standing": 4}
    for recording in study.recordings():
        angle = recording["angle.knee"]
        found = find_repetitions(angle, recording.fs)
        assert len(found) == counted[recording.name], recording.name
        assert found.unfinished is None
        # From sitting a leg extends, standing it flexes, by about as much each time.
        sign = -1.0 if recording.protocol == "leg_extension" else 1.0
        excursions = np.degrees([sign * each.excursion for each in found.each])
        assert excursions.min() > 40.0
        assert np.ptp(excursions) < 0.25 * excursions.mean()
        apart = np.diff([each.turn for each in found.each]) / recording.fs
        assert np.all((apart > 1.5) & (apart < 6.0))
