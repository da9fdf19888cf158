"""Onsets of muscles: known ones are found with honest intervals, and bad input is named."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

import pellucid as pl
from pellucid._errors import RecordingError
from pellucid.emg.signals.emg_onset import Burst, ChangePoint, activations, teager_kaiser
from pellucid.emg.study.onset.find_onsets import MuscleBursts, _sought_muscles
from pellucid.emg.study.onset.onset_page import MARKER_SIZES, marker_size
from pellucid.emg.study.onset.onset_table import OnsetTable
from pellucid.study.answer import AnswerPart, reason_of_parts
from pellucid.study.drawing.style import FIGURE_WIDTH
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, onset, report
from pellucid_lab.emg_synthesis import motor_unit_noise

FS = 1500.0
TABLE = {"band": (10.0, 450.0), "median_frequency": 90.0}
STUDY = """
name = "bursts"
[rig]
joint = "knee"
motion = "rotary"
lifts = "flexion"
[channels]
time = {{ column = "time", unit = "s" }}
emg.vastus = {{ column = "vastus", unit = "{unit}" }}
emg.biceps = {{ column = "biceps", unit = "{unit}" }}
[onset]
{more}
[[recordings]]
name = "trial"
file = "trial.csv"
"""


def emg(seed: int, onsets, rise: float, strength: float = 12.0, seconds: float = 5.0):
    """Raw EMG [V] whose activity begins at known times and lasts 0.7 s, rising over `rise` [s]."""
    rng, time = np.random.default_rng(seed), np.arange(round(seconds * FS)) / FS
    amplitude = np.zeros(len(time))
    for begin in onsets:
        up, down = (time - begin) / max(rise, 1e-6), (begin + 0.7 - time) / max(rise, 1e-6)
        amplitude = np.maximum(amplitude, np.clip(np.minimum(up, down), 0.0, 1.0))
    noise = motor_unit_noise(len(time), 1, FS, TABLE, rng)[0]
    return time, 5e-6 * (strength * amplitude * noise + rng.standard_normal(len(time)))


def study(folder, *, unit="V", more="", change=lambda x: x):
    folder.mkdir()
    time, vastus = emg(1, (1.2, 3.1), 0.03)
    _, biceps = emg(2, (1.5,), 0.03)
    columns = np.column_stack([time, change(vastus), biceps])
    np.savetxt(folder / "trial.csv", columns, delimiter=",", header="time,vastus,biceps", comments="", fmt="%.9g")
    (folder / "study.toml").write_text(STUDY.format(unit=unit, more=more), encoding="utf-8")
    return open_study(folder)


@pytest.mark.parametrize(("rise", "within"), [(0.0, 0.004), (0.05, 0.01), (0.12, 0.02)])
def test_known_onsets_are_found_and_their_intervals_hold(rise, within):
    errors, held, thresholds = [], [], []
    for seed in range(12):
        true = (1.1 + 0.01 * seed, 3.0)
        found = activations(*emg(seed, true, rise))
        assert len(found.bursts) == 2
        for begin, burst in zip(true, found.bursts, strict=True):
            errors.append(burst.onset.time - begin)
            thresholds.append(burst.crossed - begin)
            held += [burst.onset.low <= begin <= burst.onset.high, burst.end.low <= begin + 0.7 <= burst.end.high]
    assert np.sqrt(np.mean(np.square(errors))) < within
    assert np.sqrt(np.mean(np.square(errors))) < np.sqrt(np.mean(np.square(thresholds)))
    assert np.mean(held) >= 0.8


def test_energy_of_a_sine_is_its_amplitude_and_frequency_squared():
    n = np.arange(200)
    assert teager_kaiser(2.0 * np.sin(0.3 * n)) == pytest.approx(4.0 * np.sin(0.3) ** 2)


def test_activity_at_the_start_has_no_onset():
    found = activations(*emg(3, (-0.3, 2.0), 0.02))
    assert [burst.seen for burst in found.bursts] == [False, True]


def test_rest_may_be_named():
    time, x = emg(4, (1.5,), 0.02)
    assert activations(time, x, rest=(0.2, 1.0)).rest == pytest.approx((0.2, 1.0), abs=2e-3)
    with pytest.raises(RecordingError, match="0 samples of rest between 7 and 8 s"):
        activations(time, x, rest=(7.0, 8.0))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t, x: (t, np.where(np.arange(len(x)) == 50, np.nan, x)), "1 missing samples"),
        (lambda t, x: (t, np.abs(x)), "expected raw EMG"),
        (lambda t, x: (t[::4], x[::4]), "expected raw EMG at more than 600 Hz"),
        (lambda t, x: (t[:900], x[:900]), "expected at least 1 s"),
        (lambda t, x: (t, 1e-5 * np.random.default_rng(0).standard_normal(len(x))), "with rest and with activity"),
        (lambda t, x: (t, np.where((t > 2.0) & (t < 2.4), x, 0.0)), "no signal during rest"),
    ],
)
def test_what_shows_no_onset_is_refused(change, said):
    with pytest.raises(RecordingError, match=said):
        activations(*change(*emg(5, (2.0,), 0.02)))


def test_a_study_has_its_bursts_and_their_page(tmp_path):
    opened = study(tmp_path / "bursts")
    assert not check(opened)
    found = onset(opened)
    rows = {row.id: row.value for row in found.rows}
    assert rows["bursts.trial.vastus.bursts"] == 2
    assert rows["bursts.trial.vastus.first_onset"] == pytest.approx(1.2, abs=0.02)
    assert rows["bursts.trial.biceps.first_onset"] == pytest.approx(1.5, abs=0.02)
    found.save(opened)
    assert len((opened.folder / "tables" / "onsets.csv").read_text().splitlines()) == 4
    page = report(opened, found).read_text()
    assert all(part in page for part in ("bursts_1", "When muscles become active"))


def test_a_check_searches_no_onset(tmp_path, monkeypatch):
    def search(*arguments, **options):
        raise AssertionError("it searched the onsets")

    monkeypatch.setattr("pellucid.emg.study.onset.find_onsets.activations", search)
    assert not check(study(tmp_path / "bursts"))


def test_a_stated_envelope_beside_raw_emg_is_not_searched_unless_it_is_named():
    stream = SimpleNamespace(
        channels={"emg.vastus": SimpleNamespace(unit="V"), "emg.gastrocnemius": SimpleNamespace(unit="1")}
    )
    assert _sought_muscles(stream, OnsetTable()) == ("vastus",)
    assert _sought_muscles(stream, OnsetTable(muscles=("gastrocnemius",))) == ("gastrocnemius",)
    both = ("vastus", "gastrocnemius")
    assert _sought_muscles(stream, OnsetTable(muscles=both)) == both


def test_an_envelope_is_refused(tmp_path):
    opened = study(tmp_path / "bursts", unit="1", change=np.abs)
    with pytest.raises(RecordingError, match=r"channel emg\.vastus: found the unit 1, expected raw EMG in V"):
        onset(opened)
    assert "refuse" in {fault.severity for fault in check(opened)}


def test_a_muscle_without_rest_is_named_and_left_out(tmp_path):
    rng = np.random.default_rng(6)
    opened = study(tmp_path / "bursts", change=lambda x: 4e-5 * rng.standard_normal(len(x)))
    assert [fault.severity for fault in check(opened)] == ["note"]
    found = onset(opened)
    assert any("emg.vastus" in v.said and "no onset is reported" in v.said for v in found.verdicts)
    assert next(row for row in found.rows if row.id == "bursts.trial.vastus.bursts").value is None


def test_a_muscle_that_is_not_there_is_named(tmp_path):
    opened = study(tmp_path / "bursts", more='muscles = ["soleus"]')
    with pytest.raises(RecordingError, match="found EMG of vastus, biceps, expected soleus too"):
        onset(opened)


def test_activity_too_short_for_a_burst_is_no_burst():
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 6.0, 1e-3)
    samples = 1e-5 * rng.standard_normal(len(time))
    for start in np.arange(1.0, 5.5, 0.5):
        samples[(time >= start) & (time < start + 0.06)] *= 8.0
    found = activations(time, samples, shortest=1.0)
    assert found.bursts == ()
    assert found.active == 0.0


def recruited(seed: int, rise: float, strength: float):
    """Raw EMG [V] of 60 motor units that are recruited over `rise` [s] from 1.5 s on, small ones first."""
    rng, time = np.random.default_rng(seed), np.arange(round(4.0 * FS)) / FS
    x = np.zeros(len(time) + 100)
    for place in np.arange(60) / 60.0:
        width = rng.uniform(0.002, 0.004)
        at = np.arange(-4.0 * width, 4.0 * width, 1.0 / FS) / width
        potential = np.exp(2.0 * place) * at * np.exp(-(at**2))
        fires = begin = 1.5 + rise * place
        while fires < 3.2:
            first = int(fires * FS)
            x[first : first + len(at)] += potential
            fires += rng.normal(1.0, 0.15) / (8.0 + 12.0 * min(1.0, (fires - begin) / rise))
    x = x[: len(time)]
    return time, 1e-5 * (strength * x / x[(time > 2.2) & (time < 3.0)].std() + rng.standard_normal(len(time)))


def test_slow_recruitment_is_within_the_interval():
    """The first motor units lie below the amplifier's noise; intervals were too narrow, and late by 0.1 s."""
    found = [activations(*recruited(seed, 0.3, 4.0)).bursts[0].onset for seed in range(40, 48)]
    assert sum(each.low <= 1.5 <= each.high for each in found) >= 7
    assert np.median([each.high - each.low for each in found]) < 0.5


@pytest.mark.parametrize("kind", ["motion", "heartbeat"])
def test_an_artefact_at_an_onset_is_named_with_its_stretch(kind):
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 12.0, 5e-4)
    sos = signal.butter(2, [25.0, 350.0], "bandpass", fs=2000.0, output="sos")
    effort = np.where((t > 5.0) & (t < 6.5), 8e-5, 0.0)
    emg = effort * signal.sosfilt(sos, rng.standard_normal(len(t))) + 1e-5 * rng.standard_normal(len(t))
    assert pl.onset(emg, rate=2000.0).doubtful == ()
    if kind == "motion":
        emg += 5e-4 * np.exp(-(((t - 4.8) / 0.08) ** 2)) * np.sin(2 * np.pi * 6.0 * (t - 4.8))
    else:
        for at in 0.4 + np.cumsum(0.85 + 0.03 * rng.standard_normal(12)):
            emg += 4e-4 * (np.exp(-(((t - at) / 0.012) ** 2)) - 0.3 * np.exp(-(((t - at - 0.03) / 0.012) ** 2)))
    named = [one for one in pl.onset(emg, rate=2000.0).doubtful if one.kind == kind]
    assert any(one.start <= 5.0 <= one.end + 0.3 for one in named)


def test_lost_samples_are_no_rest_and_hum_makes_onsets_doubtful():
    time, x = emg(5, (1.2, 3.1), 0.03)
    gone = np.where((time > 4.1) & (time < 4.8), 0.0, x)
    found = activations(time, gone)
    assert len(found.bursts) == 2
    assert not 4.0 < found.rest[0] < 4.8
    humming = activations(time, x + 3e-5 * np.sin(2.0 * np.pi * 50.0 * time))
    assert {one.kind for one in humming.doubtful} == {"mains"}


def test_missed_onsets_are_counted_by_cause_the_most_frequent_first(tmp_path):
    """The reason named four of a hundred channels, and the next step counted 12 of 39 envelopes."""
    opened = study(tmp_path / "s", change=lambda x: 2e-5 + np.abs(x))
    answer = onset(opened).answer
    assert answer.reason == "1 not found: vastus in trial: an envelope, not raw EMG"
    assert answer.next[0].text.endswith("state unit 1 for them in study.toml: vastus (1 recording)")
    parts = [AnswerPart(f"channel {i}", "no", ("too weak", "too short")[i % 3 == 0]) for i in range(9)]
    assert reason_of_parts(parts) == "too weak (6); too short (3)"
    assert reason_of_parts(parts[:2]) == "channel 0: too short; channel 1: too weak"


def test_the_interval_that_an_answer_gives_is_that_of_first_onsets(tmp_path):
    """"±40 ms" was of all bursts, beside a table of first onsets with ±105 ms."""
    result = onset(study(tmp_path / "s"))
    firsts = [row.value for row in result.rows if row.id.endswith("first_onset")]
    (half,) = (each.value for each in result.answer.numbers if each.unit == "ms")
    assert half == pytest.approx(np.median([row[4] for row in result.tables[0].rows]))
    assert len(firsts) == 2
    assert result.answer.said == (
        f"The first onset was found in 2 of 2 EMG channels (1 recording), to ±{half:.0f} ms (half-width of its 95 % "
        "interval, median)."
    )


def test_muscles_without_an_onset_are_named_in_the_step(tmp_path):
    """The step spoke of "the muscles named below"."""
    step, _, again = onset(study(tmp_path / "s", change=lambda x: 5e-6 * np.sin(np.arange(len(x))))).answer.next
    assert again.command == f"pellucid emg onset {tmp_path / 's'}"
    assert step.text.startswith("Attach the electrodes of vastus (1 recording) again, and record half a second of rest")


def test_triangles_of_neighbouring_bursts_do_not_overlap():
    def bursts(*times):
        points = [(ChangePoint(t, t, t), ChangePoint(t + 0.02, t, t)) for t in times]
        own = tuple(Burst(begin, end, begin.time, 1.0) for begin, end in points)
        return MuscleBursts("r", "m", own, (0.0, 0.5), 1.0, 0.5, np.array([0.0, 10.0]), np.zeros(2))

    assert marker_size(bursts(1.0, 5.0)) == MARKER_SIZES[1]
    near = marker_size(bursts(1.0, 1.05, 5.0))
    assert MARKER_SIZES[0] < near < MARKER_SIZES[1]
    assert near == pytest.approx(0.05 * 72.0 * FIGURE_WIDTH * 0.9 / 10.0)
