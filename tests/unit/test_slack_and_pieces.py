"""A slack strap's zero torque is no defect, and a recording with a cut is used on both sides of it."""

from dataclasses import replace
from pathlib import Path

import made_pointing
import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.emg.domain import MIN_PIECE_S
from pellucid.files.cut import Cut
from pellucid.files.defects import clipped, dropouts, gaps
from pellucid.files.defects.watched import WatchedRecording
from pellucid.files.pieces import pieces_between_cuts
from pellucid.files.recording import Channel, Recording, make_cut
from pellucid.study.procedures.procedure import Procedure
from pellucid.study.procedures.result import Result
from pellucid.study.procedures.run import _run

FS = 500.0


def recorded(name="trial", time=None, streams=None, **channels):
    time = np.arange(len(next(iter(channels.values())))) / FS if time is None else time
    made = {"time": Channel("time", time, "s", "t")}
    made |= {each.replace("__", "."): Channel(each, x, "1", each) for each, x in channels.items()}
    return Recording(name, Path("trial.xdf"), "", "fit", made, streams=streams or {})


def strap(twist, stiffness=120.0, slack=0.02):
    return stiffness * np.sign(twist) * np.maximum(np.abs(twist) - slack, 0.0)


def lost(watched):
    return [cut for kind in (dropouts, clipped) for cut in kind.find(watched)]


@pytest.mark.parametrize("channel", ["interaction", "moment__knee", "torque"])
@pytest.mark.parametrize("one_sided", [False, True])
def test_zero_torque_inside_the_slack_is_no_dropout(channel, one_sided):
    t = np.arange(0.0, 20.0, 1 / FS)
    # Loaded nearly always, and twice for 0.15 s unloaded: long runs of one value in a channel that else never rests.
    twist = 0.07 + 0.01 * np.sin(9.0 * t) + 0.003 * np.sin(31.0 * t)
    for at in (6.0, 13.5):
        twist -= 0.062 * np.exp(-(((t - at) / 0.08) ** 2))
    torque = strap(twist)
    if not one_sided:
        torque *= np.sign(np.sin(0.3 * t) + 1e-9)
    assert (torque == 0.0).sum() > 30
    recording = recorded(**{channel: torque, "position": 0.4 * np.sin(2.0 * t)})
    watched = WatchedRecording(recording, (channel.replace("__", "."), "position"))
    assert lost(watched) == []


def test_a_lost_torque_is_still_a_dropout():
    t = np.arange(0.0, 20.0, 1 / FS)
    torque = 6.0 + np.sin(9.0 * t) + 0.01 * np.random.default_rng(1).standard_normal(len(t))
    torque[3000:3060] = 0.0
    torque[1000] = -2.0  # so that zero is no extreme
    (cut,) = list(dropouts.find(WatchedRecording(recorded(interaction=torque), ("interaction",))))
    assert (cut.first, cut.last) == (3000, 3059)


def with_gap(at, missing, n=5000):
    keep = np.r_[0:at, at + missing : n]
    time = np.arange(n)[keep] / FS
    whole = recorded(time=time, position=np.sin(time))
    (cut,) = gaps.find(WatchedRecording(whole, ("position",)))
    return replace(whole, cuts=(cut,))


@pytest.mark.parametrize("missing", [5, 10, 200])
def test_both_sides_of_a_gap_are_pieces(missing):
    recording = with_gap(2000, missing)
    one, two = pieces_between_cuts(recording, MIN_PIECE_S)
    assert (one.name, two.name, one.trial, two.trial) == ("trial.1", "trial.2", "trial", "trial")
    assert (len(one), len(two)) == (2000, 3000 - missing)
    assert np.r_[one.time, two.time] == pytest.approx(recording.time)
    assert (one.cuts, two.cuts) == ((), ())
    assert np.diff(one.time).max() < 1.5 / FS


def test_a_whole_recording_stays_as_it_is_and_short_pieces_are_left_out():
    whole = recorded(position=np.zeros(2000))
    assert pieces_between_cuts(whole, MIN_PIECE_S) == (whole,)
    recording = with_gap(300, 10)
    (kept,) = pieces_between_cuts(recording, MIN_PIECE_S)
    assert kept.time[0] == pytest.approx(310 / FS)
    assert len(pieces_between_cuts(recording, 0.0)) == 2


def test_a_piece_keeps_the_stream_around_it_and_never_its_cut():
    emg_time = np.arange(0.0, 10.0, 1 / 2000)
    emg = recorded("trial.emg", time=emg_time, emg__a=np.sin(emg_time))
    cut = make_cut(emg, "spike", "emg.a", first=12000, last=12040, found="a spike")
    broken = replace(emg, cuts=(cut,))
    gapped = replace(with_gap(1000, 7), streams={"emg": broken})
    one, two, three = pieces_between_cuts(gapped, 0.5)
    for piece in (one, two, three):
        stream = piece.streams["emg"]
        assert stream.cuts == ()
        assert stream.time[0] <= piece.time[0] + 1 / 2000
        assert stream.time[-1] >= piece.time[-1] - 1 / 2000
    # The robot's gap breaks no filter of the EMG; the EMG's own spike does.
    assert two.streams["emg"].time[0] == 0.0
    assert two.streams["emg"].time[-1] == pytest.approx(emg_time[11999])
    assert three.streams["emg"].time[0] == pytest.approx(emg_time[12041])


def test_overlapping_cuts_make_no_piece_between_them():
    recording = recorded(position=np.zeros(3000))
    cuts = tuple(
        Cut("spike", "position", a / FS, (b + 1) / FS, a, b, "a spike") for a, b in ((1000, 1500), (1200, 1300))
    )
    one, two = pieces_between_cuts(replace(recording, cuts=cuts), MIN_PIECE_S)
    assert (len(one), len(two)) == (1000, 1499)
    with pytest.raises(RecordingError):
        one["missing"]


class Counting(Procedure):
    """A procedure that needs whole recordings, and tells how many it was given."""

    name, command, whole = "counting", "count", True

    def faults(self, study, table):
        return []

    def run(self, study, table, *tell, **options):
        headline = f"{len(study.recordings())} recordings were counted."
        return Result(study=study.name, headline=headline, tables=(), verdicts=(), rows=(), cards={}, checksums={})

    def page(self, study, found):
        raise NotImplementedError


def test_an_answer_says_how_many_of_the_trials_were_used(tmp_path):
    study = made_pointing.study(tmp_path / "people", participants=2)
    every = len(study.recordings())
    assert _run(Counting(), study, None).headline == f"{every} recordings were counted."
    for recording in study.recordings()[:3]:
        cut = Cut("gap", "time", 1.0, 1.0, 50, 49, "a gap")
        study.kept.recordings[recording.name] = replace(recording, cuts=(cut,))
    found = _run(Counting(), study, None)
    assert found.headline == f"{every - 3} recordings were counted."
    assert found.answer.basis.sentence.startswith(f"Based on {every - 3} of {every} recordings")
    assert [v.kind for v in found.verdicts if "is excluded" in v.text] == ["warning"] * 3
