"""`fit_joint` on arrays decides what `pellucid identify` decides on files with the same samples."""


import numpy as np
import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid import _core
from pellucid.cli import app
from pellucid.study.results import read_rows

LATE_SAMPLES = 3
RATE = 200.0
BODY = {
    "inertia": 0.05, "gravity_sine": 1.5, "coulomb_positive": 0.3, "coulomb_negative": 0.3, "viscous_positive": 0.08,
    "viscous_negative": 0.08, "load_motoring": 0.12, "load_generating": 0.12,
}  # fmt: skip
STUDY = """\
name = "arrays"

[rig]
joint = "elbow"
motion = "rotary"

[rig.drive]
kind = "torque"

[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "deg" }
torque = { column = "u", unit = "N*m" }

[processing]
lowpass = "10 Hz"
decimate = 5
trim = 40

[[recordings]]
name = "one"
file = "one.csv"

[[recordings]]
name = "two"
file = "two.csv"

[[recordings]]
name = "three"
file = "three.csv"
use = "validate"
"""
PROCESSING = {"lowpass": "10 Hz", "decimate": 5, "units": {"position": "deg"}}


def recording(seed: int) -> dict[str, np.ndarray]:
    """Columns of a joint with load friction that follows sines, whose effort comes late; position in degrees."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 30.0, 1.0 / RATE)
    w = 2.0 * np.pi * np.array([0.13, 0.47, 1.1])
    phase = t[:, None] * w + rng.uniform(0.0, 2.0 * np.pi, 3)
    size = np.array([0.6, 0.3, 0.15])
    q, v, a = np.sin(phase) @ size, np.cos(phase) @ (size * w), -np.sin(phase) @ (size * w**2)
    vector = np.array([BODY.get(name, 0.0) for name in _core.PARAMETER_NAMES])
    effort = np.roll(_core.inverse_dynamics(vector, q, v, a), LATE_SAMPLES)
    effort[:LATE_SAMPLES] = effort[LATE_SAMPLES]
    return {"time": t, "position": np.degrees(q), "effort": effort + 0.01 * rng.standard_normal(len(t))}


@pytest.fixture(scope="module")
def recordings():
    return [recording(seed) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def identified(recordings, tmp_path_factory):
    """The study of the same recordings as files, its rows of results.json by id, and the result of `identify`."""
    folder = tmp_path_factory.mktemp("parity") / "arrays"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY)
    for name, columns in zip(("one", "two", "three"), recordings, strict=True):
        rows = zip(*(x.tolist() for x in columns.values()), strict=True)
        (folder / f"{name}.csv").write_text("t,q,u\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows))
    done = CliRunner().invoke(app, ["identify", str(folder)])
    assert done.exit_code == 0, done.output
    rows = read_rows(folder / "results.json")
    return {row.id: row.value for row in rows}, pl.identify(pl.open(folder))


@pytest.fixture(scope="module")
def fit(recordings):
    one, two, three = recordings
    named = {"one": one, "two": two}
    return pl.fit_joint(named, held_out=[{**three, "name": "three"}], friction="auto", **PROCESSING)


def test_the_command_and_the_function_find_the_same(identified, fit):
    rows, result = identified
    headline = [name for name in fit if f"arrays.headline.{name}" in rows]
    assert headline == list(fit)
    for name, parameter in fit.items():
        assert parameter.value == pytest.approx(rows[f"arrays.headline.{name}"], rel=1e-9, abs=1e-12)
        assert parameter.interval() == pytest.approx(result[name].interval(), rel=1e-9, abs=1e-12)
    assert fit.heldout_effort_error == pytest.approx(rows["arrays.headline.heldout.effort_error"], rel=1e-9)
    assert fit.heldout_r2 == pytest.approx(result.headlined.heldout_r2, rel=1e-9)
    assert fit.family == result.best == "load"
    assert fit.method == result.headlined.estimate.method
    for family, each in fit.families.items():
        assert each.heldout_effort_error == pytest.approx(rows[f"arrays.{family}.heldout.effort_error"])


def test_the_delay_is_corrected_alike(identified, fit):
    assert fit.delay == pytest.approx(LATE_SAMPLES / RATE, abs=2e-3)
    _, result = identified
    late = [v.text for v in result.verdicts if v.finding == "late_drive"]
    assert late == [v.text for v in fit.verdicts if v.finding == "late_drive"]
    assert len(late) == 1


def test_the_verdicts_are_the_same(identified, fit):
    _, result = identified
    assert [(v.kind, v.finding, v.text, v.do) for v in fit.verdicts] == [
        (v.kind, v.finding, v.text, v.do) for v in result.verdicts
    ]


def test_a_score_is_the_held_out_error(fit, recordings):
    score = fit.score(*recordings[2].values())
    assert score.effort_error == pytest.approx(fit.heldout_effort_error, rel=1e-12)
    assert score.r2 == pytest.approx(fit.heldout_r2, rel=1e-12)
    assert 0.8 < score.coverage <= 1.0
    assert fit.score(recordings).effort_error < 5.0
    with pytest.raises(pl.PellucidError, match=r"score: .*found a magnitude of"):
        fit.score({**recordings[2], "position": 3000.0 * recordings[2]["position"]})


def test_two_recordings_of_one_name_are_refused(recordings):
    with pytest.raises(pl.PellucidError, match="found the name 'swing' twice"):
        pl.fit_joint([{**each, "name": "swing"} for each in recordings], **PROCESSING)


@pytest.mark.parametrize(
    ("given", "held_out"),
    [
        (lambda r: ([{**x, "name": n} for n, x in zip(("one", "two", "three"), r, strict=True)],), -1),
        (lambda r: tuple([x[k] for x in r] for k in ("time", "position", "effort")), [2]),
        (lambda r: (dict(zip(("one", "two", "three"), r, strict=True)),), "three"),
        (lambda r: (dict(zip(("one", "two", "three"), r, strict=True)),), 0.34),
        (lambda r: tuple([x[k] for x in r[:2]] for k in ("time", "position", "effort")), "further"),
    ],
)
def test_recordings_may_be_given_in_several_ways(fit, recordings, given, held_out):
    held_out = tuple(recordings[2].values()) if held_out == "further" else held_out
    again = pl.fit_joint(*given(recordings), held_out=held_out, friction=["load"], **PROCESSING)
    assert again.array == pytest.approx(fit.array, rel=1e-12)
    assert again.heldout_effort_error == pytest.approx(fit.heldout_effort_error, rel=1e-12)


def test_data_frames_are_recordings(fit, recordings):
    pandas = pytest.importorskip("pandas")
    frames = [pandas.DataFrame({**columns, "comment": "none"}) for columns in recordings]
    again = pl.fit_joint(frames, held_out=2, friction="load", **PROCESSING)
    assert again.array == pytest.approx(fit.array, rel=1e-12)


def test_a_share_of_one_recording_is_a_window_at_its_end(recordings):
    fit = pl.fit_joint(*recordings[0].values(), held_out=0.25, **PROCESSING)
    assert [(r.name, len(r)) for r in fit.study.recordings()] == [("fitted", 4500), ("held_out", 1500)]
    assert np.isfinite(fit.heldout_effort_error)


def test_the_simulated_motion_is_the_recorded_one(recordings):
    from pellucid.models.simulate import LoopSetting, simulate

    fit = pl.fit_joint(*recordings[0].values(), friction="load", **PROCESSING)
    t = np.arange(0.0, 4.0, 1e-3)
    effort = 2.0 * np.sin(2.0 * t)
    vector = np.array([BODY.get(name, 0.0) for name in _core.PARAMETER_NAMES])
    truth = simulate(vector, effort, 1e-3, loop=LoopSetting(), position0=0.2, velocity0=0.0)
    made = fit.simulate(t, effort, position="11.459155902616466 deg")
    assert np.abs(made.position - truth.position).max() < 0.05 * np.ptp(truth.position)
    assert made.velocity.shape == made.acceleration.shape == t.shape


def test_a_held_out_recording_decides_nothing(fit, recordings):
    odd = {**recordings[2], "effort": 1.7 * recordings[2]["effort"], "name": "three"}
    again = pl.fit_joint({"one": recordings[0], "two": recordings[1]}, held_out=[odd], friction="load", **PROCESSING)
    assert np.array_equal(again.array, fit.array)
    assert again.heldout_effort_error > 20.0
    assert any(v.kind == "wrong" for v in again.verdicts)


def test_a_card_has_the_held_out_error(fit):
    assert fit.card("elbow").heldout_effort_error == fit.heldout_effort_error
    assert fit.card("elbow").study == "elbow"
