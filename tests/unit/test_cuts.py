"""What is bad in a recording is left out, what is good on either side of it is used, and it is told."""

import numpy as np
import pytest

from pellucid._errors import RecordingError, StudyError
from pellucid.procedures.joint.aligned_motions import motions
from pellucid.procedures.run import check, identify
from pellucid.recordings.cut import Cut, sound_samples, spans_between

EXCLUDED = ('use = "fit"', 'use = "fit"\nexclude = [["4 s", "4.1 s"]]')


def test_what_is_left_between_cuts():
    cuts = [
        Cut("gap", "time", 4.0, 5.0, 4, 3, "a gap"),
        Cut("spike", "position", 7.0, 9.0, 7, 8, "a spike"),
        Cut("missing_samples", "current", 8.0, 10.0, 8, 9, "no number"),
    ]
    assert spans_between(12, cuts) == (slice(0, 4), slice(4, 7), slice(10, 12))
    assert np.flatnonzero(~sound_samples(12, cuts)).tolist() == [7, 8, 9]
    assert spans_between(3, ()) == (slice(0, 3),)
    assert spans_between(3, [Cut("excluded", "time", 0.0, 3.0, 0, 2, "all of it")]) == ()


def test_what_is_excluded_by_hand_takes_no_part(make_study):
    columns = make_study.swing()
    clean = identify(make_study(columns), families=["symmetric"], thorough=False)
    columns["i"] = columns["i"].copy()
    columns["i"][800:820] += 1.0
    study = make_study(columns, EXCLUDED)
    first, second = motions(study)
    assert (len(first.time), second.time[0]) == (800, 4.1)
    assert second.initial[1] != 0.0
    found = identify(study, families=["symmetric"], thorough=False)
    for name in ("inertia", "gravity", "coulomb"):
        assert found[name].value == pytest.approx(clean[name].value, rel=0.01)
    told = "found what study.toml excludes at 4 s (samples 800 to 819), cut out"
    assert any(told in verdict.text for verdict in found.verdicts)
    assert [(f.severity, f.kind) for f in check(study)] == [("cut", "excluded")]


def test_a_stretch_between_cuts_that_is_too_short_is_told(make_study):
    study = make_study(None, ('use = "fit"', 'use = "fit"\nexclude = [["4 s", "4.1 s"], ["4.2 s", "4.3 s"]]'))
    assert len(motions(study)) == 2
    (told,) = [fault for fault in check(study) if fault.kind == "short_stretch"]
    assert told.severity == "cut"
    assert "found 20 samples between cuts, from 4.1 s to 4.195 s, expected at least 190; left out" in told.message


def test_an_exclusion_that_cannot_be_meant(make_study):
    with pytest.raises(RecordingError, match=r"exclude 60 s to 70 s holds no sample, found times from 0 s to 9.995 s"):
        make_study(None, ('use = "fit"', 'use = "fit"\nexclude = [["60 s", "70 s"]]')).recordings()
    with pytest.raises(StudyError, match=r"exclude: found 3 s to 1 s, expected start before end"):
        make_study(None, ('use = "fit"', 'use = "fit"\nexclude = [["3 s", "1 s"]]'))
