"""Figures of a slider joint, of a leg in its orthosis and of people move as they were recorded, and rest in print."""

from types import SimpleNamespace

import numpy as np
import pytest

from pellucid.joint.slider.study import slider_page as moving_slider_figures
from pellucid.orthosis.strap.wearer_coupling import EvaluatedSwing
from pellucid.orthosis.study.coupling.coupling_page import PAGE_SETTINGS, mismatch_figure
from pellucid.people.study.assessment_figures import FRAME_COUNT, _moving_limbs, tones
from pellucid.people.study.assessment_result import Profile
from pellucid.study.drawing.drawing import draw
from pellucid.study.drawing.style import colour
from pellucid.study.pages.moving import MovingDrawing

TIME = np.arange(0.0, 20.0, 0.05)
SWUNG = 0.7 + 0.6 * np.sin(2.0 * TIME)


def length(points):
    return np.linalg.norm(points[:, 1] - points[:, 0], axis=-1)


def angle(points):
    way = points[:, 1] - points[:, 0]
    return np.arctan2(way[:, 0], -way[:, 1])


def test_the_leg_turns_in_its_orthosis_as_the_imu_saw_it():
    seen = 0.08 * np.sin(2.0 * TIME + 1.0)
    swing = EvaluatedSwing(
        "swing_1", "heldout", TIME, seen, {"orthosis": 0.95 * seen}, {"orthosis": 95.0}, 98.0, None, seen,
        position=SWUNG,
    )  # fmt: skip
    drawing = draw(mismatch_figure, "S1", swing)
    assert isinstance(drawing, MovingDrawing)
    orthosis, leg = drawing.ways["orthosis"].points, drawing.ways["leg"].points
    assert np.ptp(length(orthosis)) < 1e-9
    shown = np.abs(TIME - 0.5 * TIME[-1]) <= 6.0
    # A bending knee takes the foot to the back, here to the left.
    assert -angle(orthosis).min() == pytest.approx(SWUNG[shown].max(), abs=0.03)
    drawn = PAGE_SETTINGS.mismatch_magnification * 0.08
    assert np.abs(angle(leg) - angle(orthosis)).max() == pytest.approx(drawn, rel=0.05)
    assert drawing.svg.count("<animate") == 3
    assert "prefers-reduced-motion: reduce), print" in drawing.svg


def test_the_joint_turns_with_its_carriage_at_its_place(monkeypatch):
    monkeypatch.setattr(moving_slider_figures, "predicted", lambda factor, motion: factor * motion.effort)

    def motion(name, split, place):
        return SimpleNamespace(
            recording=name, protocol="constant_velocity", split=split, slider=place, time=TIME, effort=np.sin(TIME),
            position=SWUNG, scored=np.abs(np.cos(2.0 * TIME)) > 0.1,
        )  # fmt: skip

    motions = [motion("fitted", "fitted", 0.3), motion("unseen", "heldout", 0.2)]

    class Fit(dict):
        gain = 2.0
        evaluated_split = "heldout"

        def evaluated(self, method):
            return [SimpleNamespace(current=(1.0 - self[method]) * scale) for scale in (0.1, 0.2)]

    fit = Fit(load=0.9, pooled=0.7)
    fit.motions = motions
    names = {"by load": "load", "one set": "pooled"}
    roles = {"by load": "fitted", "one set": "stribeck"}
    drawing = draw(moving_slider_figures.moving_slider, fit, names, roles, "simulated")
    assert "measured" not in drawing.svg
    assert "its current, simulated, and as each model predicts it" in drawing.caption
    link, carriage = drawing.ways["link"].points, drawing.ways["carriage"].points
    assert angle(link).max() == pytest.approx(SWUNG.max(), abs=0.03)
    middle = np.linalg.norm(carriage.mean(axis=1), axis=-1)
    np.testing.assert_allclose(middle, 0.85 * 0.2 / 0.3, rtol=1e-9)
    assert "held out" in drawing.svg
    assert drawing.svg.count("<animate") == 3
    # The models that the question compares have a column of errors each, under their names.
    labels = drawing.figure.axes[2].get_xticklabels()
    assert [label.get_text() for label in labels] == list(names)
    assert [label.get_color() for label in labels] == [colour(roles[words]) for words in names]


def test_a_limb_for_each_condition_moves_as_people_did_on_average():
    def profile(condition, reached):
        ramp = np.clip(TIME[:40] / TIME[30], 0.0, 1.0)
        return Profile(condition, TIME[:40], reached * ramp, ramp, ramp)

    from matplotlib.figure import Figure

    axis = Figure().subplots()
    ways, seconds = _moving_limbs(axis, [profile("Ctrl", 0.8), profile("fc", 0.6)], tones(("Ctrl", "fc")))
    assert seconds > TIME[39]
    for name, reached in (("limb-0", 0.8), ("limb-1", 0.6)):
        points = ways[name].points
        assert points.shape == (FRAME_COUNT, 2, 2)
        way = points[:, 1] - points[:, 0]
        turned = np.arctan2(way[:, 1], way[:, 0])
        assert turned[-1] - turned[0] == pytest.approx(reached, abs=1e-9)
