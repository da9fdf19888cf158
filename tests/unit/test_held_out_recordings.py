"""Recordings with ``use = "validate"`` reach no fit and no scale: a spoilt one changes no fitted value."""

from dataclasses import replace

import numpy as np
import pytest
from test_cocontraction import STUDY, TIME
from test_identify_coupling import BENCH, RIG, WORN, swings
from test_markers import frozen, trial

from pellucid._errors import RecordingError
from pellucid.joint.slider.markers import slider_geometry
from pellucid.orthosis.study.coupling.identify_coupling import identify_worn
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import cocontraction
from pellucid_lab.study import record_in_memory


def held_out(recording):
    """Return the recording as a held-out one whose every effort and envelope is three times too large."""
    channels = {
        name: replace(channel, samples=3.0 * channel.samples) if name in ("command", "effort", "torque") else channel
        for name, channel in recording.channels.items()
    }
    streams = {
        key: replace(
            stream,
            use="validate",
            channels={
                name: replace(channel, samples=3.0 * channel.samples) if name.startswith("emg.") else channel
                for name, channel in stream.channels.items()
            },
        )
        for key, stream in recording.streams.items()
    }
    return replace(recording, name=f"{recording.name}_held_out", use="validate", channels=channels, streams=streams)


def figures(parameter):
    """Return what two parameters are compared by: a missing influence is NaN, which equals nothing."""
    return parameter.value, parameter.standard_error


@pytest.mark.nightly
def test_no_stage_of_a_worn_orthosis_is_fitted_to_held_out_recordings():
    config, recordings, _ = record_in_memory(RIG, [*BENCH, *WORN, *swings()], seed=5)
    stages = [r for r in recordings if r.protocol not in ("free_swing", "sine_tracking")]
    assert {r.protocol for r in stages} == {"gravity_holds", "imu_on_orthosis", "relaxed_holds", "mvc", "torque_steps"}
    alone = identify_worn(config, recordings)
    spoilt = identify_worn(config, [*recordings, *map(held_out, stages)])
    assert figures(spoilt.orthosis.gravity.gravity) == figures(alone.orthosis.gravity.gravity)
    one, other = alone.wearers["S1"], spoilt.wearers["S1"]
    assert other.calibration.sd == one.calibration.sd
    assert figures(other.limb.gravity) == figures(one.limb.gravity)
    assert figures(other.coupling.orthosis_side.stiffness) == figures(one.coupling.orthosis_side.stiffness)
    assert {row.id: row.value for row in spoilt.rows} == pytest.approx(
        {row.id: row.value for row in alone.rows}, nan_ok=True, rel=0.0, abs=0.0
    )


def pair_of_envelopes(folder, use, *, maximal=False):
    """Write a study of two envelopes with a second recording in which both are four times as large."""
    folder.mkdir()
    wave = 0.5 + 0.5 * np.sin(2.0 * np.pi * TIME)
    for name, scale in (("walk", 0.25), ("run", 1.0)):
        table = np.column_stack([TIME, scale * wave, 0.5 * scale * (1.0 - wave)])
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="time,tibialis,soleus", comments="")
    protocol = 'protocol = "mvc"\n' if maximal else ""
    text = f'{STUDY}[[recordings]]\nname = "run"\nfile = "run.csv"\nuse = "{use}"\n{protocol}'
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return {row.id: row.value for row in cocontraction(open_study(folder)).rows if ".walk." in row.id}


@pytest.mark.parametrize("maximal", [False, True])
def test_envelopes_are_not_scaled_by_held_out_recordings(tmp_path, maximal):
    alone = open_study(_only_walk(tmp_path / "alone"))
    expected = {row.id: row.value for row in cocontraction(alone).rows if ".walk." in row.id}
    assert pair_of_envelopes(tmp_path / "held_out", "validate", maximal=maximal) == expected
    assert pair_of_envelopes(tmp_path / "fitted", "fit", maximal=maximal) != expected


def _only_walk(folder):
    pair_of_envelopes(folder, "fit")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder


def test_envelopes_of_held_out_recordings_alone_have_no_scale(tmp_path):
    folder = _only_walk(tmp_path / "pair")
    (folder / "study.toml").write_text(f'{STUDY}use = "validate"\n', encoding="utf-8")
    with pytest.raises(RecordingError, match='found only recordings with use = "validate", expected one with'):
        cocontraction(open_study(folder))


def test_the_axis_of_a_joint_with_a_carriage_is_not_found_from_held_out_recordings():
    fitted = [trial("a", delay=0.05), trial("b", x=0.2, delay=0.06), trial("still", frozen, x=0.24)]
    shaken = trial("shaken", delay=0.2)
    markers = {
        name: points + 0.03 * np.random.default_rng(3).standard_normal(points.shape)
        for name, points in shaken.optical.markers.items()
    }
    shaken = replace(shaken, use="validate", optical=replace(shaken.optical, markers=markers))
    alone, spoilt = slider_geometry(fitted), slider_geometry([shaken, *fitted])
    assert np.array_equal(spoilt.axis, alone.axis)
    assert np.array_equal(spoilt.origin, alone.origin)
    for name in ("a", "b", "still"):
        assert spoilt[name].slider == alone[name].slider
        assert spoilt[name].delay == alone[name].delay
