"""The report: what it says, what it draws, and that it is one file that needs nothing else."""

import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import fabricate
import numpy as np
import pytest

from pellucid.joint.study import joint_figures as figures
from pellucid.joint.study.joint_figures import busiest, join_stretches, running_median
from pellucid.models.estimates import Parameter
from pellucid.models.friction import friction_curve
from pellucid.models.joint import joint_model
from pellucid.study.answer import Answer, Step
from pellucid.study.drawing.drawing import broken, draw, outline
from pellucid.study.drawing.style import COLOURS, css_variables
from pellucid.study.pages.quantities import (
    number,
    parameter_interval,
    percent,
    relative_sd,
    typeset_cell,
    typeset_sentence,
    unit_text,
)
from pellucid.study.procedures.run import WrittenReport
from pellucid.study.procedures.run import report as write_report

VOID = {"meta", "link", "br", "img", "input", "hr", "use", "path"}


class Page(HTMLParser):
    """Ids, references, tags that stay open, and text of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.ids, self.references, self.outside, self.open, self.words = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        if "id" in found:
            self.ids.append(found["id"])
        for name in ("href", "xlink:href", "src"):
            value = found.get(name) or ""
            if value.startswith("#"):
                self.references.append(value[1:])
            elif value and not value.startswith("data:"):
                self.outside.append(value)
        self.references += re.findall(r"url\(#([^)]+)\)", " ".join(v or "" for v in found.values()))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.fixture(scope="module")
def fit():
    return fabricate.fit()


@pytest.fixture(scope="module")
def written(fit, tmp_path_factory):
    study = fabricate.study(tmp_path_factory.mktemp("report") / "bench", fit)
    return write_report(study, fit)


@pytest.fixture(scope="module")
def page(written):
    return Page(written.read_text(encoding="utf-8"))


def test_the_page_is_whole(page):
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert set(page.references) <= set(page.ids)


def test_the_page_needs_nothing_from_outside(page, written):
    """The only files it points to are its own figures, as files to take away."""
    assert all((written.parent / name).is_file() for name in page.outside)
    text = written.read_text(encoding="utf-8")
    assert "<script" not in text
    assert "@import" not in text
    addresses = set(re.findall(r"https?://[^\"' <)]+", text))
    assert all("w3.org" in a for a in addresses), addresses
    assert len(text) < 3e6


def test_the_page_says_what_was_found(page, fit):
    best = fit.families[fit.best]
    for p in best.estimate.parameters:
        assert number(p.value, p.standard_error) in page.text
    for family in fit.families.values():
        assert family.family in page.text
        assert percent(family.heldout_effort_error) in page.text
    assert fit.filter_note in page.text
    assert all(checksum in page.text for checksum in fit.checksums.values())
    assert "least squares" in page.text
    assert "output error" in page.text
    for verdict in fit.verdicts:
        assert verdict.text in page.text  # "<b>" too: as text, never as markup


def test_figures_are_files_too(written):
    names = {p.stem for p in written.parent.glob("*.svg")}
    assert not list(written.parent.glob("*.pdf"))  # only `with_pdf` asks for them
    assert {"friction", "effort", "residuals", "whiteness", "recordings", "estimators", "heldout"} <= names
    for path in written.parent.glob("*.svg"):
        ElementTree.parse(path)


def test_the_same_fit_gives_the_same_bytes(fit, written, tmp_path):
    again = write_report(fabricate.study(tmp_path / "bench", fabricate.fit()), fit)
    # The page's commands name its folder as it was given; all else is equal.
    first, other = (str(page.parents[1]).encode() for page in (written, again))
    for one in sorted(written.parent.glob("*.*")):
        assert (again.parent / one.name).read_bytes().replace(other, first) == one.read_bytes(), one.name


@pytest.mark.parametrize(
    "options",
    [
        pytest.param({"motion": "rotary", "fitted": 2, "heldout": 3, "samples": 300}, marks=pytest.mark.nightly),
        {"heldout": 0, "samples": 400},
        pytest.param(
            {"families": ("symmetric",), "others": False, "simulated": False, "samples": 400},
            marks=pytest.mark.nightly,
        ),
        {"motion": "rotary", "effort_unit": "V", "families": ("load", "combined"), "samples": 400},
    ],
    ids=["many recordings", "nothing held out", "one family, nothing else", "per volt"],
)
def test_any_study_has_a_report(options, tmp_path):
    fit = fabricate.fit(**options)
    page = Page(write_report(fabricate.study(tmp_path / "bench", fit), fit).read_text(encoding="utf-8"))
    assert page.open == []
    assert set(page.references) <= set(page.ids)
    if options.get("motion") == "rotary":
        assert "Velocity (deg/s)" in page.text
    if options.get("heldout") == 0:
        assert "No recording was held out" in page.text
        assert "nan" not in page.text


def test_figures_break_where_samples_are_missing():
    time = np.r_[np.arange(50), np.arange(80, 130)] * 0.01
    t, v = broken(time, np.ones(100))
    assert np.flatnonzero(np.isnan(v)).tolist() == [50]
    assert len(t) == 101


def test_an_outline_keeps_peaks():
    values = np.zeros(20_000)
    values[7777], values[12345] = 5.0, -3.0
    time, kept = outline(np.arange(20_000.0), values)
    assert len(kept) < 2000
    assert kept.max() == 5.0
    assert kept.min() == -3.0
    assert np.all(np.diff(time) > 0.0)


def test_a_zoom_finds_the_event():
    time = np.arange(2000) * 0.01
    values = np.where((time > 12.0) & (time < 12.5), np.sin(40.0 * time), 0.0)
    low, high = busiest(time, values)
    assert low <= 12.25 <= high


def test_running_median_of_clusters():
    x = np.repeat([-1.0, 0.0, 1.0], 100) + 1e-3 * np.random.default_rng(0).standard_normal(300)
    centre, median = running_median(x, 2.0 * x)
    assert np.allclose(median, 2.0 * centre, atol=0.05)
    assert len(centre) <= 6


def test_stretches_join_with_a_break(fit):
    runs = [s for s in fit.families["symmetric"].simulations["ls"] if s.mode == "openloop"][:1]
    both = join_stretches(runs * 2)
    assert np.isnan(both.time).sum() == 1
    assert both.errors["position"] == pytest.approx(runs[0].errors["position"])


@pytest.mark.parametrize("family", ["symmetric", "directional", "load", "stribeck", "combined"])
def test_friction_band_is_the_delta_method(family):
    """Against the exact variance for the parameters friction is linear in, and finite everywhere."""
    model = joint_model(family, motion="rotary", effort_unit="N*m", gravity="sine")
    values = np.array([fabricate.TRUTH["rotary"][n] for n in model.names])
    covariance = np.diag((0.01 * values) ** 2)
    velocity = np.linspace(0.05, 6.0, 40)
    curve = friction_curve(model, values, covariance, velocity, load=0.0)
    assert np.all(np.isfinite(curve.standard_error))
    if family == "symmetric":
        slope = values[model.names.index("viscous")] * velocity
        level = values[model.names.index("coulomb")]
        assert np.allclose(curve.friction, level + slope, rtol=1e-9)
        assert np.allclose(curve.standard_error, 0.01 * np.hypot(level, slope), rtol=1e-6)
    if family == "load":
        heavy = friction_curve(model, values, covariance, velocity, load=0.5)
        assert np.all(heavy.friction > curve.friction)


def test_every_figure_has_colours_of_the_palette_only(fit):
    drawing = draw(figures.friction, fit)
    inline = drawing.inline()
    assert set(re.findall(r"#[0-9a-fA-F]{6}\b", inline)) == set()
    assert set(re.findall(r"var\(--(\w+)\)", inline)) <= set(COLOURS)
    assert css_variables() != css_variables(dark=True)


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (95.10894, 0.1085, "95.11"),
        (-3.1648, 0.0444, "−3.165"),
        (203.5, 22.0, "204"),
        (20393.5, 1200.0, "20400"),
        (0.00763, 0.00011, "0.00763"),
        (7.63e-8, 1.1e-9, "7.63×10⁻⁸"),
        (-0.99995974, 7e-7, "−0.99995974"),
        (0.0, 0.012, "0.000"),
        (0.0996, 0.00996, "0.100"),
        (3.14159, float("nan"), "3.142"),
        (float("nan"), 1.0, "–"),
        (float("-inf"), 1.0, "−∞"),
        (1234567.0, 0.0, "1.235×10⁶"),
    ],
)
def test_numbers_are_rounded_by_their_uncertainty(value, uncertainty, text):
    assert number(value, uncertainty) == text


@pytest.mark.parametrize(
    ("unit", "text"), [("N*m*s/rad", "N·m·s/rad"), ("kg*m^2", "kg·m²"), ("V*s^2/rad", "V·s²/rad"), ("1", "")]
)
def test_units_have_their_typography(unit, text):
    assert unit_text(unit) == text


def test_a_bound_makes_an_interval_one_sided():
    held = Parameter("viscous", "N*s/m", 0.0, 0.5, at_bound=True)
    assert parameter_interval(held, 0.95) == "0.00 to 0.98"
    assert relative_sd(held) == "–"
    assert relative_sd(Parameter("offset", "N", 1e-9, 0.5)) == "> 1000"


def test_cells_of_a_page_have_minus_signs_before_numbers_alone():
    assert typeset_cell("-5.5 to -0.2 %") == "−5.5 to −0.2 %"
    assert typeset_cell("P-1 of 2026-11-27, carry-over") == "P-1 of 2026-11-27, carry-over"
    assert typeset_cell(None) == "–"
    assert typeset_cell(-2) == "−2"


def test_prose():
    assert typeset_sentence("dead: K_value_Nm_per_rad of spring_bench") == "Dead: K_value_Nm_per_rad of spring bench"
    assert typeset_sentence("interval -0.5 to 2e-3 N*m, R2 0.9") == "Interval −0.5 to 2e-3\xa0N·m, R² 0.9"
    # What a reader copies keeps its letters.
    copied = 'answer "lever_arm=0.3 m" or write position_unit = "deg" for elbow_flexion'
    assert typeset_sentence(copied) == 'Answer "lever_arm=0.3 m" or write position_unit = "deg" for elbow flexion'
    assert (
        typeset_sentence("Estimator 'wls' disagrees on viscous_positive")
        == "Estimator weighted least squares disagrees on viscous +"
    )


def test_the_command_says_why_its_next_command_is_recommended(tmp_path):
    step = Step("Raise `people`", "check", folder="bench")
    made = WrittenReport(tmp_path / "index.html", (Answer("Is it?", "no", "It is not", next=(step,)),))
    assert made.lines[-2:] == ("Raise people.", "Next: pellucid check bench")
