"""Where the axis and the carriage are, from made-up markers of which all is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.files import Channel, OpticalRecording, Recording
from pellucid.joint.slider.markers import clock_offset, geometry_faults, slider_geometry

FS, ROBOT_FS = 179.0, 500.0
NOISE = 0.0003
ORIGIN = np.array([0.41, -0.23, 1.09])
AXIS = np.array([0.15, 0.96, 0.12]) / np.linalg.norm([0.15, 0.96, 0.12])
DOWN = np.array([0.0, 0.0, -1.0])
HEIGHT = 0.034
LINK = {"R1": (0.06, 0.03, 0.02), "R2": (0.31, 0.03, 0.02), "R3": (0.2, -0.04, -0.03)}


def swing(t):
    return 1.1 + 0.6 * np.sin(2 * np.pi * 0.31 * t) + 0.25 * np.sin(2 * np.pi * 0.83 * t + 1.0)


def holds(t):
    """Eight angles held for 6 s each, with moves of 1 s between."""
    levels = np.array([0.4, 0.7, 1.0, 1.3, 1.6, 1.9, 1.2, 0.6, 0.4])
    i = np.minimum((t // 7).astype(int), 7)
    s = np.clip(t - 7 * i - 6, 0, 1)
    return levels[i] + (levels[i + 1] - levels[i]) * (10 * s**3 - 15 * s**4 + 6 * s**5)


def frozen(t):
    return np.full_like(t, 0.8)


def lab_frame():
    x0 = DOWN - (DOWN @ AXIS) * AXIS
    x0 /= np.linalg.norm(x0)
    return np.array([x0, np.cross(AXIS, x0), AXIS])


def trial(
    name="one",
    angle=swing,
    *,
    x=0.15,
    seconds=20.0,
    delay=0.08,
    drift=0.0,
    noise=NOISE,
    lost=(),
    ruler=None,
    seed=3,
):
    """A recording, and its motion capture whose clock reads (1 + drift) t + delay at robot time t."""
    rng = np.random.default_rng([seed, *name.encode()])
    robot = np.arange(round(seconds * ROBOT_FS)) / ROBOT_FS
    encoder = np.round(angle(robot) * 20000) / 20000
    n = round((seconds + 0.2) * FS)
    optical = np.arange(n) / FS
    q = angle((optical - delay) / (1.0 + drift))
    frame, markers = lab_frame(), {}
    for marker, (along, across, aside) in {"C": (x, HEIGHT, 0.0), **LINK}.items():
        c, s = np.cos(q), np.sin(q)
        plane = np.column_stack([along * c - across * s, along * s + across * c, np.full(n, aside)])
        markers[marker] = ORIGIN + plane @ frame + noise * rng.standard_normal((n, 3))
    for part in lost:
        markers["C"][part] = np.nan
    channels = {"time": Channel("time", robot, "s", "t"), "position": Channel("position", encoder, "rad", "q")}
    seen = OpticalRecording(Path(f"{name}_markers.csv"), "", optical, markers, DOWN, "C")
    return Recording(name, Path(f"{name}.csv"), "", "fit", channels, optical=seen, slider=ruler)


def with_markers(recording, change):
    markers = {m: p.copy() for m, p in recording.optical.markers.items()}
    change(markers)
    return replace(recording, optical=replace(recording.optical, markers=markers))


def by_clock(recording):
    optical = recording.optical
    return clock_offset(recording.time, recording["position"], optical.time, optical.markers)


def off_axis(point):
    away = point - ORIGIN
    return np.linalg.norm(away - (away @ AXIS) * AXIS)


@pytest.mark.parametrize("delay", [0.08, -0.11, 0.0, 0.2])
@pytest.mark.parametrize(("angle", "seconds"), [(swing, 20.0), (holds, 56.0)])
def test_clocks_are_aligned(angle, seconds, delay):
    found = by_clock(trial(angle=angle, seconds=seconds, delay=delay))
    assert found.identifiable
    assert found.delay == pytest.approx(delay, abs=1e-3)
    assert found.delay == pytest.approx(delay, abs=5 * found.delay_se + 1e-5)
    assert 1e-6 < found.delay_se < 3e-4


def test_a_drift_is_told_where_the_recording_is_long():
    long = by_clock(trial(seconds=150.0, drift=30e-6))
    assert long.delay == pytest.approx(0.08, abs=5e-4)
    assert long.drift == pytest.approx(30e-6, abs=3e-6)
    short = by_clock(trial(seconds=4.0, drift=30e-6))
    assert short.drift == 0.0
    assert short.delay == pytest.approx(0.08, abs=1e-3)


def test_standard_errors_hold_the_truth():
    errors = []
    for seed in range(40):
        recording = trial(seed=seed, seconds=6.0)
        found = slider_geometry([recording])
        one = found.placements[0]
        errors.append(
            [
                (one.delay - 0.08) / one.delay_se,
                (one.slider - 0.15) / one.slider_se,
                (one.height - HEIGHT) / one.height_se,
                off_axis(found.origin) / found.origin_se,
                np.linalg.norm(np.cross(found.axis, AXIS)) / found.axis_se,
            ]
        )
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    # One for a single direction, the root of two for the distance in a plane.
    assert (rms > 0.6).all(), rms
    assert (rms < 1.7).all(), rms


def test_all_is_found_at_once():
    recordings = [
        trial("swing", x=0.12, drift=30e-6, lost=[slice(500, 590)]),
        trial("holds", holds, x=0.2, seconds=56.0, delay=0.071, lost=[slice(10, 40), slice(900, 1000)]),
        trial("long", x=0.24, seconds=60.0, delay=-0.03, drift=-30e-6),
    ]
    geometry = slider_geometry(recordings)
    assert geometry.carriage == "C"
    assert geometry.axis == pytest.approx(AXIS, abs=2e-4)
    assert off_axis(geometry.origin) < 0.0005
    assert geometry.origin == pytest.approx(ORIGIN, abs=0.0005)
    assert geometry.residual == pytest.approx(NOISE, rel=0.1)
    assert [p.recording for p in geometry.placements] == ["swing", "holds", "long"]
    for placement, x, delay in zip(geometry.placements, (0.12, 0.2, 0.24), (0.08, 0.071, -0.03), strict=True):
        assert placement.aligned
        assert placement.slider == pytest.approx(x, abs=0.0003)
        assert placement.height == pytest.approx(HEIGHT, abs=0.0003)
        assert placement.slider_se < 1e-4
        assert placement.delay == pytest.approx(delay, abs=1e-3)
        assert set(placement.residuals) == {"C", "R1", "R2", "R3"}
        assert max(placement.residuals.values()) < 1.3 * NOISE
        assert placement.moved == {}
    holding = geometry["holds"]
    assert holding.lost == 130
    assert holding.longest_loss == pytest.approx(100 / FS)
    assert holding.frames < len(recordings[1].optical) - 130
    assert geometry_faults(geometry, (0.1, 0.25))[0].kind == "clock"
    with pytest.raises(RecordingError, match=r'for recording "other", expected one of swing, holds, long'):
        geometry["other"]


def test_the_lab_s_frame_changes_nothing_but_origin_and_axis(rng):
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    shift = np.array([3.0, -5.0, 2.0])
    here = [trial("a", x=0.12), trial("b", holds, seconds=56.0, lost=[slice(200, 300)])]
    there = [
        replace(
            r,
            optical=replace(
                r.optical, markers={m: p @ turn.T + shift for m, p in r.optical.markers.items()}, down=turn @ DOWN
            ),
        )
        for r in here
    ]
    one, other = slider_geometry(here), slider_geometry(there)
    assert other.origin == pytest.approx(turn @ one.origin + shift, abs=1e-8)
    assert other.axis == pytest.approx(turn @ one.axis, abs=1e-8)
    assert (other.residual, other.origin_se, other.axis_se) == pytest.approx(
        (one.residual, one.origin_se, one.axis_se), rel=1e-5
    )
    for p, q in zip(one.placements, other.placements, strict=True):
        assert (q.slider, q.height, q.delay, q.drift) == pytest.approx((p.slider, p.height, p.delay, p.drift), abs=1e-8)
        assert (q.frames, q.lost, q.longest_loss) == (p.frames, p.lost, p.longest_loss)


def test_a_frozen_joint_is_not_aligned_and_says_so():
    geometry = slider_geometry([trial("moving", delay=0.06), trial("still", frozen, x=0.2)])
    still = geometry["still"]
    assert not still.aligned
    assert still.reason == "the joint turns by 0 rad, expected at least 0.1 rad"
    assert still.delay == pytest.approx(0.06, abs=1e-3)  # the other recording's
    assert still.delay_se == np.inf
    assert still.slider == pytest.approx(0.2, abs=0.0003)
    (note,) = [f for f in geometry_faults(geometry) if "still" in f.file]
    assert (note.severity, note.kind) == ("note", "clock")
    assert "no delay: the joint turns by 0 rad" in note.found
    with pytest.raises(RecordingError, match=r"no recording in which the joint turns by 0.1 rad and a marker with it"):
        slider_geometry([trial("still", frozen)])


def test_a_delay_beyond_the_search_is_not_aligned():
    found = by_clock(trial(delay=0.6))
    assert not found.identifiable
    assert found.reason.startswith("no delay within 0.25 s")


def test_a_fast_oscillation_is_not_taken_half_a_period_off():
    def fast(t):
        return 1.0 + 0.2 * np.sin(2 * np.pi * 2.2 * t)

    geometry = slider_geometry([trial("a"), trial("b"), trial("fast", fast, delay=0.1)])
    assert geometry["fast"].delay == pytest.approx(0.1, abs=1e-3)
    assert geometry["fast"].slider == pytest.approx(0.15, abs=0.0003)


def test_markers_that_swap_within_a_recording_are_named():
    def swap(markers):
        markers["C"][1500:], markers["R3"][1500:] = markers["R3"][1500:].copy(), markers["C"][1500:].copy()

    geometry = slider_geometry([trial("a"), trial("b"), with_markers(trial("bad"), swap)])
    bad = geometry["bad"]
    assert bad.residuals["C"] > 0.01
    assert bad.residuals["R1"] < 0.0005
    assert off_axis(geometry.origin) < 0.0005
    assert geometry["a"].slider == pytest.approx(0.15, abs=0.0003)
    faults = [f for f in geometry_faults(geometry) if f.kind == "marker"]
    assert (faults[0].severity, faults[0].file, faults[0].channel) == ("refuse", "bad_markers.csv", "C")
    assert "mm rms off a rotation about the axis" in faults[0].found
    assert {f.channel for f in faults} == {"C", "R3"}


def test_markers_that_bear_each_other_s_name_are_named():
    def swap(markers):
        markers["C"], markers["R3"] = markers["R3"], markers["C"]

    good = [trial(f"g{i}", x=0.1 + 0.03 * i) for i in range(4)]
    geometry = slider_geometry([*good, with_markers(trial("bad", x=0.1), swap)])
    assert set(geometry["bad"].moved) == {"C", "R3"}
    assert all(p.moved == {} for p in geometry.placements[:-1])
    (fault, other) = [f for f in geometry_faults(geometry) if f.kind == "marker"]
    assert (fault.severity, fault.channel) == ("refuse", "C")
    assert fault.message.startswith("bad_markers.csv (recording bad), marker C: found it where another marker sits")
    assert (other.severity, other.channel) == ("note", "R3")


def test_a_marker_fixed_to_the_room_spoils_nothing(rng):
    def fix(markers):
        markers["R1"] = np.array([1.0, 2.0, 0.5]) + NOISE * rng.standard_normal(markers["R1"].shape)

    geometry = slider_geometry([with_markers(trial(), fix)])
    assert geometry.placements[0].slider == pytest.approx(0.15, abs=0.0003)
    assert off_axis(geometry.origin) < 0.0005
    assert "R1" in {f.channel for f in geometry_faults(geometry) if f.kind == "marker"}


def test_the_carriage_s_marker_alone_is_enough():
    def only(markers):
        for marker in LINK:
            markers[marker][:] = np.nan

    geometry = slider_geometry([with_markers(trial(), only)])
    assert geometry.placements[0].slider == pytest.approx(0.15, abs=0.0003)
    assert set(geometry.placements[0].residuals) == {"C"}


def test_a_ruler_stands_in_for_a_motion_capture():
    ruled = replace(trial("ruled", ruler=0.19), optical=None)
    geometry = slider_geometry([trial("seen"), ruled])
    assert geometry["ruled"].slider == 0.19
    assert geometry["ruled"].height == pytest.approx(HEIGHT, abs=0.0003)
    assert not geometry["ruled"].optical
    assert [f.file for f in geometry_faults(geometry)] == ["seen_markers.csv"]
    alone = slider_geometry([ruled])
    assert alone.placements[0].slider == 0.19
    assert np.isnan(alone.origin).all()
    assert geometry_faults(alone) == []
    with pytest.raises(
        RecordingError, match=r"ruled.csv \(recording ruled\): found no place of the carriage, expected"
    ):
        slider_geometry([replace(ruled, slider=None)])


def test_a_ruler_that_disagrees_is_noted():
    (fault,) = [f for f in geometry_faults(slider_geometry([trial(ruler=0.16)])) if f.kind == "place"]
    assert (fault.severity, fault.channel) == ("note", "C")
    assert fault.expected == "160.0 mm as the ruler says"
    assert fault.found.startswith("the carriage at 150.")


def test_a_place_beyond_the_rail_is_refused():
    geometry = slider_geometry([trial(x=0.3)])
    fault = geometry_faults(geometry, (0.1, 0.25))[0]
    assert (fault.severity, fault.kind) == ("refuse", "place")
    assert fault.expected == "100 mm to 250 mm as [rig.slider] says"


def test_a_delay_is_told_with_its_sign():
    (late,) = geometry_faults(slider_geometry([trial()]))
    assert late.message.startswith(
        "one_markers.csv (recording one), time: found events 80.0 ms later on the optical clock than on the robot's"
    )
    assert "corrected, expected clocks that agree" in late.message
    (early,) = geometry_faults(slider_geometry([trial(delay=-0.08)]))
    assert "events 80.0 ms earlier" in early.found
    assert geometry_faults(slider_geometry([trial(delay=0.001)])) == []


@pytest.mark.parametrize("lost", [slice(150, None), slice(None)])
def test_a_marker_lost_too_often(lost):
    with pytest.raises(RecordingError) as error:
        slider_geometry([trial("a"), trial("bad", lost=[lost])])
    assert str(error.value).startswith("bad_markers.csv (recording bad), marker C: found it in ")
    assert str(error.value).endswith(" of 3616 frames while the robot recorded, expected at least 904")


def test_a_carriage_s_marker_that_is_not_there():
    with pytest.raises(
        RecordingError, match=r"found the markers C, R1, R2, R3, expected D, the carriage's, among them"
    ):
        slider_geometry([trial()], "D")


def test_an_axis_along_gravity_hangs_nowhere():
    recording = trial()
    upright = replace(recording, optical=replace(recording.optical, down=AXIS))
    with pytest.raises(RecordingError, match=r"within .* degrees of \[optical\] down, expected a more horizontal one"):
        slider_geometry([upright])
