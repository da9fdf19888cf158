"""A command whose recordings are refused cannot say, and says why in results.json and on its page."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from pellucid._errors import UnfitRecordingError
from pellucid.cli import app
from pellucid.study.results import read_answers


@pytest.fixture
def dead(make_study):
    """A study whose current is 0 in every sample."""
    swing = make_study.swing()
    return make_study(swing | {"i": np.zeros(len(swing["i"]))}).folder


def test_refused_recordings_leave_an_answer_in_every_form(dead):
    """Nothing was written: a script found the results of earlier recordings."""
    done = CliRunner().invoke(app, ["identify", str(dead), "-q"])
    assert isinstance(done.exception, UnfitRecordingError)  # `main` prints it, and ends with status 1
    (told,) = read_answers(dead / "results.json")
    assert (told["command"], told["verdict"]) == ("identify", "cannot say")
    assert "the one value 0" in told["reason"]
    assert told["based_on"]["sentence"] == "Based on 0 of 1 recording, measured or simulated (not stated)."
    assert [step["command"] for step in told["next"]] == [""]  # `check` would end with status 1
    assert f"Cannot say. {told['said'][:40]}" in done.stdout
    page = (dead / "report" / "index.html").read_text(encoding="utf-8")
    assert 'class="badge">Cannot say<' in page
    assert "the one value 0" in page
    printed = CliRunner().invoke(app, ["identify", str(dead), "-q", "--json"])
    assert json.loads(printed.stdout)["answers"] == [told]


def test_a_check_says_why_recordings_are_not_fit(dead):
    done = CliRunner().invoke(app, ["check", str(dead), "-q"])
    question, said, *_ = done.stdout.splitlines()
    assert done.exit_code == 1
    assert question == "Are these recordings fit to be used by identify?"
    assert said.startswith("No. 1 fault prevents their use: current of sweep.csv (the one value 0 A")
    assert "\nBased on 0 of 1 recording, measured or simulated (not stated).\n" in done.stdout
    table = json.loads(CliRunner().invoke(app, ["check", str(dead), "-q", "--json"]).stdout)
    assert table["answer"]["verdict"] == "no"
    assert [fault["severity"] for fault in table["faults"]] == ["refuse"]
