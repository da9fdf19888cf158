"""Logarithmic axes label their powers of ten in plain characters, not as formulas that nobody sets."""

import numpy as np
import pytest

from pellucid.study.drawing.drawing import Drawing, draw, one_panel


def power_law() -> Drawing:
    figure, axis = one_panel(3.0)
    axis.loglog(np.logspace(-1.0, 2.0, 50), np.logspace(-8.0, 9.0, 50))
    return Drawing("power", figure, "A power law.")


@pytest.mark.parametrize("label", [">0.1<", ">100<", "10⁻⁸", "10⁸"])
def test_powers_of_ten_are_readable(label: str) -> None:
    text = draw(power_law).svg
    assert "mathdefault" not in text
    assert label in text
