"""The demo: a whole story from one command, each chapter a study, and a page that leads to all of it."""

import json
import re
import socket
from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.controllers.elbow_controllers import BEST_SENSED_CONTROLLER
from pellucid.study.datasets.registry import info, shipped
from pellucid.study.pages.quantities import number, percent
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import read_rows
from pellucid_lab.demonstration import demo as module
from pellucid_lab.demonstration.story import chapter_sentences
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def shown():
    """What it said while it ran."""
    return []


@pytest.fixture(scope="module")
def made(tmp_path_factory, shown):
    """The demo with fewer repetitions of what counts intervals, and no network."""

    def nowhere(*_):
        raise OSError("no network")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "COVERAGE_REPETITIONS", 25)
        patch.setattr(socket, "socket", nowhere)
        patch.delenv("PELLUCID_DATA", raising=False)
        patch.setenv("PELLUCID_CACHE", str(tmp_path_factory.mktemp("nothing")))
        yield module.demo(tmp_path_factory.mktemp("demo"), on_progress=lambda *said: shown.append(said))


def test_progress_goes_forward_to_its_end(made, shown):
    shares = [share for _, share in shown]
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert np.all(np.diff(shares) >= 0.0)


def test_every_link_of_the_page_leads_to_a_file(made):
    text = made.page.read_text(encoding="utf-8")
    links = [to for to in re.findall(r'href="([^"]+)"', text) if not to.startswith(("#", "data:"))]
    assert {"elbow/report/index.html", "people/report/index.html", "elbow/controller/README.md"} <= set(links)
    assert [to for to in links if not (made.page.parent / to).is_file()] == []
    assert next(to for to in links if to.endswith("report/index.html")).startswith(f"{made.real.name}/")


def test_the_real_machine_comes_with_the_package_and_says_whose_it_is(made):
    assert made.notes == () or "Cortex" in made.notes[0]
    folder = shipped(made.real.name)
    names = {path.name for path in folder.iterdir()}
    assert {"LICENSE", "ATTRIBUTION.txt"} <= names
    assert sum(path.stat().st_size for path in folder.iterdir()) < 1_000_000
    assert info(made.real.name).licence in (folder / "ATTRIBUTION.txt").read_text(encoding="utf-8")
    assert "Apache License" in (folder / "LICENSE").read_text(encoding="utf-8")
    text = made.page.read_text(encoding="utf-8")
    assert text.index("1. A real machine") < text.index("2. ")
    assert "Duclusaud" in text


def test_the_page_says_what_few_people_cannot_show(made):
    text = made.page.read_text(encoding="utf-8")
    assert "3 people illustrate a study but prove nothing" in text
    smallest = min(one.p_value for each in made.findings.assessed.values() for one in each.comparison.against_control)
    assert smallest >= 0.25
    assert "cannot give less than p = 0.25" in text


def test_people_wear_what_the_cards_say_and_that_is_exported(made):
    assert made.findings.conditions == ("Ctrl", *module.WORN_CONTROLLERS)
    person, *_ = draw_people(module.few_people(able_elbow()), np.random.default_rng(3), count=3)
    law = module.worn_controllers(made.elbow)[BEST_SENSED_CONTROLLER](person, sum(made.fit.rail) / 2)
    constants = (made.controller / "pellucid_constants.h").read_text(encoding="utf-8")
    for name in ("gravity_sine", "coulomb_positive", "proportional"):
        line = next(line for line in constants.splitlines() if f"/* {name} [" in line)
        assert float(line.split("f,")[0]) == pytest.approx(law.values[name], rel=1e-6)


def test_the_story_is_told_with_its_figures(made):
    said = dict(chapter_sentences(made))
    assert list(said) == ["Real", "Identified", "Worn", "Exported"]
    best = made.real_fit.headlined
    assert f"{percent(best.heldout_effort_error)} %" in said["Real"]
    assert 0.0 < best.heldout_effort_error < 40.0
    torque = made.findings.assessed["torque_rms"].table
    for condition in module.WORN_CONTROLLERS:
        assert f"{number(torque.column(condition).mean(), digits=3)} under {condition}" in said["Worn"]
    assert torque.column(BEST_SENSED_CONTROLLER).mean() < torque.column("clpc").mean()
    if made.played is not None:
        assert made.played[0] > 500
        assert made.played[1] == 0
    if made.cost is not None:
        assert made.cost.wrong == 0
        assert "the same bits" in said["Exported"]
    none = SimpleNamespace(**{**vars(made), "cost": None, "played": None})
    assert "no compiler" in dict(chapter_sentences(none))["Exported"]


def test_every_number_of_the_story_is_that_of_a_report_and_of_its_results(made):
    value = re.compile(r'<data value="[^"]+" data-id="([^"]+)">([^<]+)</data>')
    folders = (made.real.folder, made.elbow.folder, made.people.folder)
    pages = [made.page, *(folder / "report" / "index.html" for folder in folders)]
    stored = {row.id: row.value for folder in folders for row in read_rows(folder / "results.json")}
    found = {}
    for page in pages:
        for name, text in value.findall(page.read_text(encoding="utf-8")):
            found.setdefault(name, set()).add(text)
    assert len(found) > 20
    assert {name: texts for name, texts in found.items() if len(texts) > 1} == {}
    assert set(found) <= set(stored)


def test_arms_move_on_the_demo(made):
    text = made.page.read_text(encoding="utf-8")
    assert text.index('class="badge"') < text.index("<animate") < text.index("1. A real machine")
    assert 'id="fig-wearers"' in text


def test_a_session_is_recorded_and_every_bit_computed_again(made):
    assert made.replayed is not None, made.notes
    assert made.replayed.law == module.SESSION_CONTROLLER
    assert made.replayed.replay.is_equal
    assert made.replayed.replay.compared > 1000
    text = made.page.read_text(encoding="utf-8")
    assert f"computed its {made.replayed.replay.compared} commands again: every bit is equal" in text


def test_chapters_are_studies_with_figures(made):
    for folder, command in ((made.elbow.folder, "identify"), (made.people.folder, "assess")):
        figures = json.loads((folder / "results.json").read_text(encoding="utf-8"))["figures"]
        assert command in {row["command"] for row in figures}
        assert open_study(folder).recordings()
    rows = json.loads((made.page.parent / "results.json").read_text(encoding="utf-8"))["figures"]
    assert [row["id"] for row in rows] == [f"virtual.symmetric.coverage.{c}" for c in ("white", "coloured")]


def test_what_judges_the_robot_was_never_fitted(made):
    fitted = {round(m.slider, 3) for m in made.fit.motions if m.split == "fitted"}
    held = {round(m.slider, 3) for m in made.fit.motions if m.split == "heldout"}
    assert len(fitted) == 6
    assert len(held) == module.HELD_OUT_PLACE_COUNT
    assert not fitted & held


def test_fewer_people_are_no_other_people():
    few, whole = module.few_people(able_elbow()), elbow_participants()
    same = {name for name in whole.tables if few.tables[name] == whole.tables[name]}
    assert same == set(whole.tables) - {"people", "pointing"}
    drawn = (draw_people(rig, np.random.default_rng(3), count=3) for rig in (few, whole))
    assert len({json.dumps([asdict(p) for p in people]) for people in drawn}) == 1


def test_what_is_no_demo_is_not_deleted(tmp_path):
    (tmp_path / "elbow").mkdir()
    (tmp_path / "elbow" / "study.toml").write_text("", encoding="utf-8")
    (tmp_path / "people").mkdir()
    (tmp_path / "people" / "thesis.tex").write_text("years of work", encoding="utf-8")
    with pytest.raises(PellucidError, match="found something that no demo made"):
        module.demo(tmp_path)
    assert (tmp_path / "people" / "thesis.tex").is_file()
    assert (tmp_path / "elbow" / "study.toml").is_file()
