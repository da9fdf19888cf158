"""Names of curves, numbers and axes of every figure stand where nothing crosses them, and colours are as captions say.
"""

import ast
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import pellucid
from pellucid.arm.study.tree_figures import MODEL_ROLES, error_dots
from pellucid.emg.study.onset.onset_page import burst_traces
from pellucid.orthosis.study.transfer_function.transfer_page import answer_figure, followed_phase
from pellucid.study.drawing.drawing import Drawing, Head, draw, heads, key, measured_and_predicted, one_panel
from pellucid.study.drawing.style import COLOURS, FIGURE_WIDTH, colour
from pellucid.study.pages.forest import Estimate, forest_panel

ENTRIES = [("measured", colour("measured")), ("predicted (dashed)", colour("heldout")), ("mean", colour("muted"))]


def boxes(figure, texts):
    """The drawn rectangles of texts, in pixels."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    return [text.get_window_extent(renderer) for text in texts]


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("head", ["", "joint", "a recording with a very long name of its own"])
def test_a_key_is_above_its_panel_and_touches_nothing(columns, head):
    """A key's white boxes lay on shaded stretches, bands and curves, and its words touched."""

    def make() -> Drawing:
        figure = Figure(figsize=(FIGURE_WIDTH, 3.0), layout="constrained")
        axes = figure.subplots(1, columns, squeeze=False)[0]
        for axis in axes:
            axis.plot([0.0, 1.0], [0.0, 1.0])
        if head:
            heads(list(axes), [Head(head, "held out, error 12.3 %", colour("muted"))] * columns)
        key(axes[0], ENTRIES)
        return Drawing("keyed", figure, "")

    figure = draw(make).figure
    axis = figure.axes[0]
    drawn = boxes(figure, axis.texts)
    panel = axis.get_window_extent()
    assert all(box.y0 >= panel.y1 for box in drawn)
    assert all(box.y1 <= figure.bbox.y1 for box in drawn)
    assert all(text.get_bbox_patch() is None for text in axis.texts)
    for i, one in enumerate(drawn):
        assert not any(one.x0 < other.x1 and other.x0 < one.x1 and one.y0 < other.y1 - 1.0 and other.y0 < one.y1 - 1.0
                       for other in drawn[i + 1 :])  # fmt: skip


def test_a_prediction_is_seen_where_it_equals_what_was_measured():
    _, axis = one_panel(3.0)
    time = np.linspace(0.0, 1.0, 50)
    measured_and_predicted(axis, time, np.sin(time), np.sin(time), colour("heldout"))
    below, above = axis.lines
    assert above.get_zorder() >= below.get_zorder()
    assert below.get_linewidth() >= 2.0 * above.get_linewidth()
    assert above.is_dashed()
    assert not below.is_dashed()


def test_what_was_measured_has_the_colour_that_captions_name():
    """Captions said black, and the curve was drawn half transparent: grey."""
    found = []
    for file in Path(pellucid.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and ast.unparse(node.func) == "line"):
                continue
            given = {k.arg: ast.unparse(k.value) for k in node.keywords}
            if given.get("color") == "colour('measured')" and "alpha" in given:
                found.append(f"{file.name}:{node.lineno}")
    assert not found


@pytest.mark.parametrize("value", [4e9, 2.5e-7])
def test_powers_of_ten_are_beside_their_numbers(value):
    """Matplotlib wrote "1e9" above the axis, on the panel's name."""

    def make() -> Drawing:
        figure, axis = one_panel(3.0)
        axis.plot([0.0, 1.0], [0.0, value])
        return Drawing("large", figure, "")

    axis = draw(make).figure.axes[0]
    boxes(axis.figure, [])
    assert axis.yaxis.get_offset_text().get_text() == ""
    labels = [label.get_text() for label in axis.get_yticklabels()]
    exponent = "10⁹" if value > 1.0 else "10⁻⁷"
    assert all(label.endswith(exponent) for label in labels if float(label.split("×")[0].replace("−", "-")))


def test_numbers_of_a_forest_are_beside_it():
    """A number stood on the line through zero or on another interval."""
    figure, axis = one_panel(3.0)
    estimates = [Estimate("one", 3.1, -40.0, 75.0, text="+3.1"), Estimate("two", 258.0, np.nan, np.nan, text="≥ +258")]
    forest_panel(axis, estimates, "Change (%)")
    panel = axis.get_window_extent()
    assert all(box.x0 > panel.x1 for box in boxes(figure, axis.texts))


def test_each_model_of_an_arm_has_its_own_colour_and_height():
    tones = [COLOURS[role] for role in MODEL_ROLES.values()]
    assert len(set(tones)) == len(tones)
    assert sum(role in {"muted", "symmetric", "measured", "faint"} for role in MODEL_ROLES.values()) == 1
    _, axis = one_panel(3.0)
    roles = {model: role for model, role in MODEL_ROLES.items()}
    error_dots(axis, ["joint_1", "joint_2"], {model: [5.0, 5.0] for model in roles}, roles)
    heights = [dots.get_ydata()[0] for dots in axis.lines if dots.get_marker() == "o"]
    assert len(set(heights)) == len(roles)
    assert max(heights) - min(heights) < 1.0


def test_a_measured_phase_follows_a_delay_and_skips_noise():
    """Noise at high frequencies added turns, and the measured phase left the fitted one by hundreds of degrees."""
    rng = np.random.default_rng(0)
    expected = -np.linspace(0.0, 3.0 * np.pi, 300)
    gain = np.where(np.arange(300) < 200, 1.0, 0.01)
    noise = 0.05 * (rng.standard_normal(300) + 1j * rng.standard_normal(300))
    sure, angle = followed_phase(gain * np.exp(1j * expected) + noise, np.full(300, 0.15))
    assert sure[:200].all()
    assert sure[200:].mean() < 0.1
    np.testing.assert_allclose(angle[:200], expected[:200], atol=0.3)


def response(fit):
    time = np.linspace(0.0, 1.0, 50)
    return SimpleNamespace(fit=fit, time=time, measured=np.sin(time), simulated=0.9 * np.sin(time))


def test_the_answer_of_transfer_functions_shows_the_worst_and_the_median_response():
    """The answer was No because of three recordings, and the figure showed one that fits by 93 %."""
    held = {"first": response(93.0), "second": response(18.5), "third": response(84.8)}
    found = SimpleNamespace(heldout=held, single={}, units=("N*m", "rad"), channels=("torque", "position"))
    drawing = draw(answer_figure, found)
    texts = [" ".join(text.get_text() for text in axis.texts) for axis in drawing.figure.axes]
    assert "second" in texts[0]
    assert "worst of 3: fit 18.5 %" in texts[0]
    assert "third" in texts[1]
    assert "median of 3: fit 84.8 %" in texts[1]
    assert "held-out" in drawing.caption


def test_a_single_response_is_not_ranked():
    fits = {"only": SimpleNamespace(responses=[response(70.0)])}
    found = SimpleNamespace(heldout={}, single=fits, units=("N*m", "rad"), channels=("torque", "position"))
    drawing = draw(answer_figure, found)
    assert len(drawing.figure.axes) == 1
    assert "worst" not in drawing.svg
    assert "fitted" in drawing.caption


def test_onsets_and_ends_are_told_apart_by_place_shape_and_colour():
    """Onset and end had one colour, and their intervals lay on each other."""

    def point(at):
        return SimpleNamespace(time=at, low=at - 0.1, high=at + 0.1)

    time = np.linspace(0.0, 2.0, 200)
    burst = SimpleNamespace(onset=point(0.5), end=point(0.65))
    muscle = SimpleNamespace(
        muscle="biceps", time=time, samples=1e-4 * np.sin(90.0 * time), bursts=[burst], rest=(0.0, 0.2)
    )
    axis = draw(burst_traces, [muscle], "bursts", "").figure.axes[0]
    marks = [mark for mark in axis.lines if mark.get_marker() in {"v", "^"}]
    assert len({mark.get_color() for mark in marks}) == len({mark.get_marker() for mark in marks}) == 2
    whole, onset, end = sorted((box.get_y(), box.get_y() + box.get_height()) for box in axis.patches)
    assert {whole, onset, end} == {(0.0, 0.5), (0.0, 1.0), (0.5, 1.0)}
