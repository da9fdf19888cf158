"""A page of any content, and the figures of a joint whose friction depends on direction."""

import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import numpy as np
import pytest

from pellucid.joint.slider.study import direction_figures as figures
from pellucid.study.drawing.drawing import draw
from pellucid.study.drawing.style import COLOURS
from pellucid.study.pages.forest import Row, Table
from pellucid.study.pages.page import Page, Section, Tile, write_page
from pellucid_lab.papers.able import ratio_figures

MODELS = ("without", "directional", "directional and load")
RIGS = ("exact gears", "worn gears", "as on the bench", "no direction at all")
PROTOCOLS = ("sweep",) * 6 + ("constant",) * 6 + ("slow",) * 6


def trials(seed: int = 3) -> dict[str, np.ndarray]:
    """Errors of three models over eighteen made-up trials [A]."""
    rng = np.random.default_rng(seed)
    base = rng.uniform(0.7, 1.5, 18)
    return {m: base * f * rng.uniform(0.85, 1.15, 18) for m, f in zip(MODELS, (1.0, 0.42, 0.29), strict=True)}


def made() -> dict[str, tuple]:
    """Every figure's function with made-up arguments, by the figure's name."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 20.0, 0.002)
    angle = np.radians(45.0) * np.sin(0.6 * time)
    speed = 0.6 * np.radians(45.0) * np.cos(0.6 * time)
    load = 1.9 * np.sin(angle + 0.4)
    current = load + 0.5 * np.sign(speed) * (1.0 + 0.3 * np.abs(load)) + 0.06 * rng.standard_normal(len(time))
    predictions = {
        MODELS[0]: load + 0.1 * speed,
        MODELS[1]: load + 0.55 * np.sign(speed),
        MODELS[2]: load + 0.5 * np.sign(speed) * (1.0 + 0.29 * np.abs(load)),
    }
    degrees = np.linspace(-60.0, 60.0, 25)
    gravity = 4.1 * np.sin(np.radians(degrees) + 0.15)
    slider = np.linspace(0.0, 0.12, 5)
    inertia = 0.021 + 2.1 * (0.11 + slider) ** 2
    torque = np.linspace(-6.0, 6.0, 41)
    amplitude = np.array([10.0, 20.0, 30.0, 45.0, 60.0])
    errors = trials()
    return {
        "paired-errors": (figures.paired_errors, errors, PROTOCOLS),
        "current": (
            figures.current_trace, time, current, predictions, speed, "measured",
            "Motor current in one trial: measured and modelled.",
        ),
        "gravity": (
            figures.gravity_by_direction,
            degrees,
            {
                "up": gravity + 0.7 + 0.12 * np.abs(gravity),
                "down": gravity - 0.7 - 0.10 * np.abs(gravity),
                "static": gravity + 0.25 * rng.standard_normal(25),
                "consistent": 1.01 * gravity,
                "truth": gravity,
            },
            "Gravity torque against the joint's angle, by the way it was found.",
        ),
        "inertia": (
            figures.inertia_by_slider,
            slider,
            {"one at a time": inertia * rng.uniform(0.93, 1.07, 5), "consistent": 1.01 * inertia},
            "Inertia about the joint's axis against the slider's position.",
        ),
        "friction-load": (
            figures.friction_by_load,
            torque,
            {
                "symmetric": np.full(41, 0.6),
                "load": 0.42 + 0.11 * np.abs(torque),
                "truth": 0.4 + np.where(torque > 0.0, 0.14, 0.09) * np.abs(torque),
            },
            "Friction torque against the load that the drive transmits, by model.",
        ),
        "error-by-trial": (
            figures.error_by_trial,
            [f"{p} {1 + k % 6}" for k, p in enumerate(PROTOCOLS)],
            errors,
        ),
        "ratio-by-rig": (
            ratio_figures.ratio_by_rig,
            RIGS,
            np.array([3.1, 2.4, 3.3, 1.02]),
            np.array([2.8, 2.2, 2.9, 0.98]),
            np.array([3.5, 2.7, 3.9, 1.05]),
            3.4,
        ),
        "ratio-by-friction": (
            ratio_figures.ratio_by_friction,
            np.linspace(0.0, 0.3, 7),
            np.linspace(1.0, 3.9, 7),
            3.4,
            "Load friction, share of the load",
        ),
        "cycle-energy": (
            ratio_figures.cycle_energy,
            amplitude,
            {"without": 0.021 * amplitude, "directional": 0.011 * amplitude, "consistent": 0.0 * amplitude},
            "Net energy of one closed cycle against its amplitude.",
        ),
    }


def page() -> Page:
    """Every figure, a table and some text that must not become markup."""
    drawings = tuple(draw(*arguments) for arguments in made().values())
    table = Table(
        ("Model", "Mean error (A)", "Ratio"),
        (Row(("without", "1.07", "1.0")), Row(("directional and load", "0.31", "3.4"), strong=True)),
        frozenset({1, 2}),
        "Over eighteen trials.",
    )
    return Page(
        "An elbow that knows its direction",
        "Made-up numbers",
        "With friction of its own in each direction the current is predicted 3.4 times better.",
        (
            Tile("Ratio", "3.4", "", "median of 18 trials"),
            Tile("Error without", "1.07", "A", "mean absolute"),
            Tile("Error with", "0.31", "A", "mean absolute"),
        ),
        (
            Section("current", "Current", ("One <b>trial</b> & its models.",), (table,), drawings[:2], ("A note.",)),
            Section("models", "Models", drawings=drawings[2:5]),
            Section("ratios", "Ratios", ("How far it carries.", "And where not."), drawings=drawings[5:]),
        ),
        "Made by a test.",
    )


class Reader(HTMLParser):
    """Ids, references, figures and text of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.ids, self.inside, self.outside, self.alternatives, self.words = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.ids += [found["id"]] if "id" in found else []
        for name in ("href", "xlink:href", "src"):
            value = found.get(name) or ""
            if value.startswith("#"):
                self.inside.append(value[1:])
            elif value and not value.startswith("data:"):
                self.outside.append(value)
        self.inside += re.findall(r"url\(#([^)]+)\)", " ".join(v or "" for v in found.values()))
        if found.get("role") == "img":
            self.alternatives.append(found.get("aria-label") or "")

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_page(tmp_path_factory.mktemp("page") / "new" / "folder", page(), with_pdf=True)


@pytest.fixture(scope="module")
def text(written):
    return written.read_text(encoding="utf-8")


def test_the_page_and_its_figures_are_written(written, text):
    assert written.name == "index.html"
    assert {p.stem for p in written.parent.glob("*.svg")} == set(made())
    assert {p.stem for p in written.parent.glob("*.pdf")} == set(made())
    for path in written.parent.glob("*.svg"):
        ElementTree.parse(path)
    assert all(p.read_bytes().startswith(b"%PDF") for p in written.parent.glob("*.pdf"))
    assert len(list(written.parent.iterdir())) == 1 + 2 * len(made())
    assert text.count("<figure id=") == len(made())


def test_the_page_says_what_it_was_given(text):
    words = " ".join(Reader(text).words)
    for said in ("An elbow that knows", "Made-up numbers", "3.4 times better", "median of 18", "A note.", "1.07"):
        assert said in words
    assert "One <b>trial</b> & its models." in words  # as text, never as markup


def test_every_figure_has_a_text_alternative(text):
    reader = Reader(text)
    assert len(reader.alternatives) == len(made())
    assert all(len(words) > 40 for words in reader.alternatives)


def test_the_page_needs_nothing_from_outside(written, text):
    reader = Reader(text)
    assert all((written.parent / name).is_file() for name in reader.outside)
    assert set(reader.inside) <= set(reader.ids)
    assert len(reader.ids) == len(set(reader.ids))
    assert "<script" not in text
    assert all("w3.org" in a for a in re.findall(r"https?://[^\"' <)]+", text))
    assert len(text) < 3e6


def test_the_same_content_gives_the_same_bytes(written, tmp_path):
    again = write_page(tmp_path, page(), with_pdf=True)
    for one in written.parent.iterdir():
        assert (again.parent / one.name).read_bytes() == one.read_bytes(), one.name


def test_light_and_dark_share_the_report_s_look(text):
    assert "prefers-color-scheme: dark" in text
    assert COLOURS["paper"][1] in text
    assert ".tiles {" in text


@pytest.mark.parametrize("name", list(made()))
def test_figures_have_colours_of_the_palette_only(name):
    inline = draw(*made()[name]).inline()
    assert set(re.findall(r"#[0-9a-fA-F]{6}\b", inline)) == set()
    assert set(re.findall(r"var\(--(\w+)\)", inline)) <= set(COLOURS)


def test_a_model_keeps_the_colour_it_was_given():
    mine = {"mine": np.arange(3.0)}
    drawing = draw(figures.friction_by_load, np.arange(3.0), mine, "Friction.", roles={"mine": "stribeck"})
    assert COLOURS["stribeck"][0] in drawing.svg
    assert COLOURS["fitted"][0] not in drawing.svg


def test_a_figure_says_what_its_caller_says():
    drawing = draw(figures.paired_errors, {"m": np.ones(1)}, ["slow"], "mine", caption="Just so.")
    assert (drawing.name, drawing.caption) == ("mine", "Just so.")


def test_missing_trials_leave_gaps():
    errors = trials()
    errors["without"][3] = np.nan
    errors["none"] = np.full(18, np.nan)
    for make, *arguments in ((figures.paired_errors, errors, PROTOCOLS), (figures.error_by_trial, PROTOCOLS, errors)):
        assert "none" in draw(make, *arguments).svg


@pytest.mark.parametrize("twice", ["section", "figure"])
def test_names_that_clash_are_refused(twice, tmp_path):
    drawing = draw(*made()["cycle-energy"])
    one, two = ("a", "a") if twice == "section" else ("a", "b")
    sections = (Section(one, "One", drawings=(drawing,)), Section(two, "Two"))
    if twice == "figure":
        sections = (sections[0], Section("b", "Two", drawings=(drawing,)))
    with pytest.raises(ValueError, match="more than one part"):
        write_page(tmp_path, Page("t", "k", "h", sections=sections))
    assert list(tmp_path.iterdir()) == []


def test_long_names_take_more_lines_rather_than_be_cut():
    time = np.arange(50.0)
    names = [f"a model whose name is rather long, number {k}" for k in range(6)]
    drawing = draw(figures.current_trace, time, time, dict.fromkeys(names, time), time, "measured", "Motor current.")
    page = drawing.figure.bbox
    texts = [t for t in drawing.figure.axes[0].texts if t.get_text() in names]
    assert len(texts) == 6
    assert all(t.get_window_extent().x1 <= page.x1 and t.get_window_extent().y1 <= page.y1 for t in texts)
