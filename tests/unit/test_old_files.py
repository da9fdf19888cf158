"""Studies, rigs, cards and results written by the commit 5239fe4 are read, compared, exported and drawn."""

import json
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import pellucid
from pellucid.models.card import read_card
from pellucid.models.parameter_card import read_parameter_card
from pellucid.models.slider_joint import read_slider_card
from pellucid.study.results import read_rows
from pellucid_lab.simulate import simulate

pytestmark = pytest.mark.slow

OLD = Path(__file__).parents[1] / "data" / "5239fe4" / "commands"
STUDIES = sorted(path.parent.name for path in OLD.glob("*/study.toml"))
CARDS = sorted(str(path.relative_to(OLD)) for path in OLD.glob("*/models/*.json"))
RIGS = sorted(path.stem for path in (OLD / "rigs").glob("*.toml"))


@pytest.fixture
def old(tmp_path):
    """A copy of an old study's folder, opened."""
    return lambda name: pellucid.open(shutil.copytree(OLD / name, tmp_path / name))


def read(path):
    if path.name.startswith("slider."):
        return read_slider_card(path)
    return read_card(path) if path.name.startswith("joint") else read_parameter_card(path)


def numbers(table):
    """As an array; null is NaN."""
    return np.array(table, dtype=float)


def test_every_kind_of_study_is_there():
    assert STUDIES == ["bench", "emps", "hill", "knee", "leg", "slider"]
    assert len(RIGS) == 5
    assert len(CARDS) == 14


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_opens(old, name):
    study = old(name)
    assert study.config.recordings
    assert study.rig.joints == (study.rig,)
    assert study.rig.motion == ("prismatic" if name == "emps" else "rotary")


@pytest.mark.parametrize("name", CARDS)
def test_a_card_is_read(name):
    table, card = json.loads((OLD / name).read_text(encoding="utf-8")), read(OLD / name)
    assert card.joint in ("joint", "")
    for found, written in zip(card.parameters, table["parameters"], strict=True):
        assert (found.name, found.unit) == (written["name"], written["unit"])
        assert np.array_equal(
            numbers([found.value, *found.interval]), numbers([written["value"], *written["interval"]]), True
        )
    assert np.array_equal(numbers(card.covariance), numbers(table["covariance"]), True)
    assert card.checksums == table["checksums"]


@pytest.mark.parametrize("name", STUDIES)
def test_results_are_read(name):
    written = json.loads((OLD / name / "results.json").read_text(encoding="utf-8"))["figures"]
    assert [(row.id, row.value, row.unit) for row in read_rows(OLD / name / "results.json")] == [
        (row["id"], row["value"], row["unit"]) for row in written
    ]


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("bench", {}),
        ("slider", {"controller": "transparent"}),
        ("slider", {"controller": "force_sensor"}),
    ],
)
def test_a_controller_is_exported_from_old_cards(old, name, asked, tmp_path):
    folder = pellucid.export(old(name), out=tmp_path / "controller", **asked)
    assert (folder / "Makefile").is_file()
    assert list(folder.glob("**/*.h"))


@pytest.mark.parametrize("name", ["bench", "emps", "slider"])
def test_old_cards_are_compared(name):
    same = pellucid.compare(OLD / name, OLD / name)
    assert same.rows
    assert not any(row.changed for row in same.rows)


@pytest.mark.parametrize("name", ["bench", "leg"])
def test_the_report_of_an_old_study_is_drawn(old, name):
    study = old(name)
    written = pellucid.report(study)
    assert "<svg" in written.read_text(encoding="utf-8")


class Understood(Exception):
    """Raised where a simulation begins to tell how far it is: its rig was read."""


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_is_understood(tmp_path, name):
    def stop(text, share):
        raise Understood

    (tmp_path / "lab").mkdir()
    shutil.copy(OLD / "rigs" / f"{name}.toml", tmp_path / "lab" / "rig.toml")
    with suppress(Understood):
        assert simulate(tmp_path, on_progress=stop).recordings > 0
