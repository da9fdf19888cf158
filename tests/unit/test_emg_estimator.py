"""The calibrated estimator as a card: steps live what batches predicted, survives what goes wrong, leaves the PC."""

import shutil
from dataclasses import replace
from types import SimpleNamespace

import made_muscles as made
import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.export.c_folder import check_on_host
from pellucid.controllers.export.microcontroller import measure, missing_tools
from pellucid.emg.estimators.live_torque import LiveTorque
from pellucid.emg.estimators.torque_map import fit_torque_map
from pellucid.emg.models.emg_estimator import read_estimator_card, write_estimator_card
from pellucid.emg.models.muscle_geometry import fit_muscle_surface, muscle_table, sampled_surface, surface_from_geometry
from pellucid.emg.study.emg_torque import estimator_cards
from pellucid.emg.study.emg_torque.torque_findings import CalibrationFindings
from pellucid.emg.study.estimator_folder import chosen_card, estimator_vector, write_estimator_folder

COMPILERS = pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is missing")


def study(chain="none"):
    return SimpleNamespace(
        name="made",
        table=lambda kind: kind(chain=chain, emg="emg", joints=("knee",), normalise="none"),
        recordings=lambda use=None: [],
    )


@pytest.fixture(scope="module")
def calibrated():
    """Causal maps of made walking, and the trial that they did not see."""
    fitted = [made.trial("a", seed=1, seconds=6.0), made.trial("b", seed=2, seconds=6.0)]
    return (
        {name: fit_torque_map(fitted, name, causal=True) for name in ("hill", "ridge")},
        made.trial("c", seed=3),
        fitted,
    )


@pytest.fixture(scope="module")
def cards(calibrated):
    maps, judged, fitted = calibrated
    found = CalibrationFindings()
    found.causal.update({("knee", name): fit for name, fit in maps.items()})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            estimator_cards, "moment_trials", lambda study, joint, causal: [*fitted, replace(judged, heldout=True)]
        )
        made_of = estimator_cards.estimator_cards(study(), found)
    return {name: replace(card, checksums={"a": "0" * 64}) for name, card in made_of.items()}


def given(card, trial):
    emg = {c.name: trial.envelopes[c.name] for c in card.channels}
    return 5.0 + card.period * np.arange(len(trial)), emg, {a: trial.angles[a] for a in card.angles}


def test_live_is_the_batch(cards, calibrated):
    maps, judged, _ = calibrated
    for name, limit in (("hill", 1e-9), ("ridge", 1e-12)):
        card = cards[f"emg_knee_{name}"]
        live = LiveTorque(card).run(*given(card, judged))["knee"]
        batch = maps[name].predict(judged)
        # The table of paths has knots rounded to 1e-9 rad; a card's grid is even.
        assert np.max(np.abs(live - batch)) < limit * np.max(np.abs(batch))


def test_live_is_the_batch_on_the_same_paths(cards, calibrated):
    maps, judged, _ = calibrated
    card = cards["emg_knee_hill"]
    sos = butter(2, card.motion_lowpass, fs=1 / card.period, output="sos")
    smooth = {a: sosfilt(sos, q - q[0]) + q[0] for a, q in judged.angles.items()}
    rates = {a: np.diff(q, prepend=q[0]) / card.period for a, q in smooth.items()}
    recorded = {}
    for muscle in card.muscles:
        length, slope, _ = muscle.surface.path(judged.angles)
        recorded[muscle.name] = length, sum(slope[a] * rates[a] for a in slope), -slope["knee"]
    batch = maps["hill"].predict(replace(judged, muscles=replace(judged.muscles, recorded=recorded)))
    live = LiveTorque(card).run(*given(card, judged))["knee"]
    assert np.max(np.abs(live - batch)) < 1e-12 * np.max(np.abs(batch))


def test_steps_by_name_and_unit(cards, calibrated):
    card, judged = cards["emg_knee_hill"], calibrated[1]
    time, emg, angles = given(card, judged)
    whole = LiveTorque(card).run(time, emg, angles)["knee"]
    live = LiveTorque(card, angle_unit="deg")
    for k in range(60):
        one = live.step(time[k], {c: x[k] for c, x in emg.items()}, {a: np.degrees(q[k]) for a, q in angles.items()})
        assert one.torque["knee"] == pytest.approx(whole[k], rel=1e-9)
    assert one.valid
    assert one.fault == "none"
    assert set(live.activations) == {m.name for m in card.muscles}
    short, slope = live.stiffness()
    assert short.shape == slope.shape == (1, 1)
    live.reset()
    assert live.step(time[0], {c: x[0] for c, x in emg.items()}, {a: 0.0 for a in angles}).fault == "restarted"


def test_what_is_lost_is_named_and_bounded(cards, calibrated):
    card, judged = cards["emg_knee_hill"], calibrated[1]
    time, emg, angles = given(card, judged)
    live, gone = LiveTorque(card), card.channels[0].name
    said = []
    for k in range(40):
        heard = {c: x[k] for c, x in emg.items() if c != gone or k < 10}
        said.append(live.step(time[k], heard, {a: q[k] for a, q in angles.items()}))
    assert said[12].valid
    assert (said[-1].fault, said[-1].lost, said[-1].valid) == ("channel", (gone,), False)
    now = {c: x[40] for c, x in emg.items()}
    for k in range(40, 50):
        blind = live.step(time[k], now, {"hip": 0.1, "knee": np.nan})
    assert (blind.fault, blind.blind, blind.torque["knee"]) == ("angle", ("knee",), 0.0)
    assert live.step(time[50], {**now, gone: 1e9}, {a: q[50] for a, q in angles.items()}).above == (gone,)
    assert live.step(time[50], now, {a: q[50] for a, q in angles.items()}).fault == "time"
    with pytest.raises(PellucidError, match="EMG: found tongue, expected some of"):
        live.step(time[51], {"tongue": 0.1}, {})
    with pytest.raises(PellucidError, match="time: found nan s"):
        live.step(np.nan, now, {})
    with pytest.raises(PellucidError, match="expected envelopes with every step"):
        live.listen({gone: np.zeros(3)})


def test_a_card_is_read_as_it_was_written(cards, tmp_path):
    for name, card in cards.items():
        path = write_estimator_card(tmp_path / f"{name}.json", card)
        assert read_estimator_card(path) == card
        assert max(map(len, path.read_text().splitlines())) < 40_000
    text = path.read_text()
    for old, new, message in (
        ('"kind": "emg_estimator"', '"kind": "muscles"', "not the card of an estimator"),
        ('"first": "angle.knee"', '"first": "angle.tail"', r"found angle\.tail"),
        ('"period": 0.01', '"period": -1.0', "period"),
    ):
        assert old in text
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(PellucidError, match=message):
            read_estimator_card(path)


def test_another_period_gives_the_same_torque_but_for_its_filter(cards, calibrated):
    card, judged = cards["emg_knee_hill"], calibrated[1]
    time, emg, angles = given(card, judged)
    slow = LiveTorque(card).run(time, emg, angles)["knee"]
    fine = time[0] + 0.002 * np.arange(5 * len(time) - 4)
    made_finer = [{k: np.interp(fine, time, x) for k, x in of.items()} for of in (emg, angles)]
    fast = LiveTorque(card, period=0.002).run(fine, *made_finer)["knee"][::5]
    assert np.sqrt(np.mean((fast - slow)[50:] ** 2)) < 0.08 * np.std(slow)


def test_surfaces():
    geometry = muscle_table().geometry["rectus_femoris"]
    rng = np.random.default_rng(2)
    angles = {"hip": rng.uniform(-0.8, 2.3, 300), "knee": rng.uniform(-2.3, 0.3, 300)}  # beyond the table too
    length, slope, bend = surface_from_geometry(geometry, {"knee": -1.0}).path({**angles, "knee": -angles["knee"]})
    assert np.allclose(length, geometry.length(angles), atol=1e-9)
    assert np.allclose(slope["knee"], geometry.moment_arm("knee", angles), atol=1e-8)
    assert np.allclose(slope["hip"], -geometry.moment_arm("hip", angles), atol=1e-8)
    assert bend["hip", "knee"].tolist() == bend["knee", "hip"].tolist()
    held = surface_from_geometry(geometry).held({"hip": 0.2})
    assert np.allclose(held.path({"knee": angles["knee"]})[0], geometry.length({**angles, "hip": np.full(300, 0.2)}))
    through = sampled_surface(geometry, ["knee"], {"hip": 0.2})
    inside = {"knee": rng.uniform(*geometry.range("knee"), 300), "hip": np.full(300, 0.2)}
    assert np.allclose(through.path(inside)[0], geometry.length(inside), atol=2e-4)
    moved = {"hip": 0.4 * np.sin(np.arange(400) / 20), "knee": -0.6 + 0.5 * np.sin(np.arange(400) / 31)}
    found, missed, arm = fit_muscle_surface(
        geometry.length(moved), moved, {"knee": geometry.moment_arm("knee", moved)}
    )  # fmt: skip
    assert [a.angle for a in found.axes] == ["knee", "hip"]
    assert missed < 1e-3
    assert arm < 2e-3
    with pytest.raises(ValueError, match="expected one or two joints with angles"):
        fit_muscle_surface(length, angles, {})


@pytest.fixture(scope="module")
def folder(cards, tmp_path_factory):
    return write_estimator_folder("made", cards["emg_knee_hill"], tmp_path_factory.mktemp("emg") / "controller")


@COMPILERS
def test_c_answers_as_recorded_and_as_python_does(folder, cards):
    card = cards["emg_knee_hill"]
    vector = estimator_vector(card, card.period)
    assert check_on_host(folder) == (len(vector.rows), 0)
    lines = (folder / "test" / "vector_outputs.h").read_text().splitlines()
    wanted = [line.split("{")[2].split("}")[0].split(", ")[0].strip() for line in lines if line.startswith("    { ")]
    single = card.build(single=True)
    for row, bits in zip(vector.steps[: vector.motion], wanted, strict=False):
        torque, *_ = single.step(row.now, row.emg, row.angle)
        assert f"0x{int(np.float32(torque[0]).view(np.uint32)):08x}u" == bits
    said = {int(line.split("{")[1].split("u")[0]) & 0xFF for line in lines if line.startswith("    { ")}
    assert {"none", "time", "angle", "channel", "ceiling", "restarted"} <= {_core.EMG_FAULTS[i] for i in said}


@pytest.mark.nightly
@COMPILERS
@pytest.mark.skipif(bool(missing_tools()), reason="no tools for a Cortex-M4F")
def test_a_cortex_m4_answers_bit_by_bit(folder, cards, tmp_path):
    found = measure(folder)
    assert found.wrong == 0
    assert 1_000 < found.instructions < 20_000
    assert measure(write_estimator_folder("made", cards["emg_knee_ridge"], tmp_path / "ridge")).wrong == 0


@COMPILERS
def test_raw_emg_is_exported_with_its_filters(cards, tmp_path):
    before, after = (tuple(map(tuple, butter(2, at, kind, fs=1000.0, output="sos").tolist()))
                     for at, kind in (((30.0, 450.0), "bandpass"), (5.0, "lowpass")))  # fmt: skip
    card = replace(
        cards["emg_knee_hill"], chain="hill", emg_rate=1000.0, before=before, after=after,
        channels=tuple(replace(c, scale=2000.0) for c in cards["emg_knee_hill"].channels),
    )  # fmt: skip
    made_of = write_estimator_folder("made", card, tmp_path / "raw", period=0.005)
    assert check_on_host(made_of)[1] == 0
    assert "PELLUCID_RAW = 1" in (made_of / "pellucid_controller.h").read_text()
    rng, live = np.random.default_rng(1), LiveTorque(card, period=0.005)
    for k in range(60):
        live.listen({c: 1e-4 * rng.standard_normal(5) for c in live.channels})
        one = live.step(0.005 * k, {}, {"hip": 0.1, "knee": -0.5})
    assert one.valid
    assert min(live.activations.values()) > 0.0


def test_a_card_knows_its_error_in_cross_validation(cards, calibrated):
    maps, *_ = calibrated
    for name, fit in maps.items():
        assert cards[f"emg_knee_{name}"].cross_validated_rmse == fit.choice.score.rmse


def test_the_readme_names_exchanges_that_are_not_detected(cards, tmp_path):
    card = cards["emg_knee_ridge"]
    one, other = (channel.name for channel in card.channels[:2])

    def readme(*pairs):
        made_of = replace(card, watch=replace(card.watch, alike=pairs))
        return (write_estimator_folder("made", made_of, tmp_path / f"{len(pairs)}") / "README.md").read_text()

    assert f"an exchange of {one} and {other} is not detected" in readme((one, other))
    assert "an exchange of" not in readme()
    assert "A wrong gain of the whole" in readme()
    assert "pattern for the movement (`CHANNEL`" in readme()


def test_a_study_without_a_card_is_told(cards, tmp_path):
    own = study()
    own.models_dir, own.folder = tmp_path, tmp_path
    own.card = lambda name: tmp_path / name
    own.accept_stale = True  # the cards are made by hand and have no recordings here
    with pytest.raises(PellucidError, match=r"emg_knee_hill\.json.*use: pellucid calibrate"):
        chosen_card(own)
    # Without a name, the card that is better in cross-validation is exported.
    for better in cards:
        for name, card in cards.items():
            error = 1.0 if name == better else 2.0
            write_estimator_card(tmp_path / f"{name}.json", replace(card, cross_validated_rmse=error))
        assert chosen_card(own).name == better
    assert chosen_card(own, controller="ridge").name == "emg_knee_ridge"
    with pytest.raises(PellucidError, match="expected one of hill, ridge"):
        chosen_card(own, controller="fc")
