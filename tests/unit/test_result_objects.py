"""Results in a notebook: one line as their repr, every figure as a data frame, the report's own picture."""

from importlib import import_module
from pkgutil import walk_packages

import numpy as np
import pytest

import pellucid as pl
import pellucid_lab as lab
from pellucid.study.procedures.result import Result


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results") / "joint"
    pl.init(folder, rig="bench-joint")
    return pl.identify(pl.simulate(folder, seed=1).study, families=["symmetric", "directional"])


def test_a_result_is_one_line(found):
    assert repr(found) == f"<JointResult of joint: {found.headline}>"
    assert "<table" in found._repr_html_()


def test_no_result_prints_its_arrays():
    for room in (pl, lab):
        for module in walk_packages(room.__path__, f"{room.__name__}."):
            import_module(module.name)
    kinds, left = [], [Result]
    while left:
        kind = left.pop()
        kinds += [kind] if kind.__module__.startswith(("pellucid.", "pellucid_lab.")) else []
        left += kind.__subclasses__()
    assert len(kinds) > 10
    assert all("__repr__" not in vars(kind) for kind in kinds if kind is not Result)


def test_every_figure_is_in_a_data_frame(found):
    frame = found.to_frame()
    assert list(frame.columns) == ["id", "value", "unit", "split", "note"]
    assert len(frame) == len(found.rows)
    inertia = frame.set_index("id").loc["joint.symmetric.inertia"]
    assert inertia["unit"] == "kg*m^2"
    assert np.isfinite(inertia["value"])


def test_the_chosen_parameters_are_drawn(found):
    assert found.plot().axes
