"""Colours stay apart for who lacks one kind of cone, and what is written in them can be read."""

import itertools

import numpy as np
import pytest
from research.evidence._page_colours import colour_distance, contrast, delta_e

from pellucid.study.drawing.style import COLOURS

SERIES = ("measured", "fitted", "heldout", "good", "wrong", "symmetric", "directional", "load", "stribeck", "combined",
          "root")  # fmt: skip
MIN_DISTANCE, MIN_CONTRAST = 10.0, 4.5


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_any_two_series_stay_apart(dark):
    for one, other in itertools.combinations(SERIES, 2):
        assert colour_distance(COLOURS[one][dark], COLOURS[other][dark]) >= MIN_DISTANCE, (one, other)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["paper", "panel"])
def test_text_can_be_read(dark, ground):
    roles = ("ink", "muted") if ground == "panel" else ("ink", "muted", *SERIES)
    for role in roles:
        assert contrast(COLOURS[role][dark], COLOURS[ground][dark]) >= MIN_CONTRAST, role


@pytest.mark.parametrize(
    ("first", "second", "distance"),
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0000),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_distances_are_those_of_sharma_wu_and_dalal(first, second, distance):
    assert float(delta_e(np.array(first), np.array(second))) == pytest.approx(distance, abs=1e-4)


def test_black_on_white_has_the_largest_contrast():
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
