"""Findings: a file each, told worst first, and none where there is nothing to tell."""

import importlib
import re
import sys
from pathlib import Path

import pytest

from pellucid.arm.study import findings as of_a_robot
from pellucid.joint.study import findings
from pellucid.models.parameter import VERDICT_KINDS, Verdict, rank_verdicts
from pellucid.study.procedures.findings import collect_findings, finders

FILE = '''"""A joint that is cold."""

from pellucid.models.parameter import Verdict


def find(case):
    """How cold it is."""
    yield Verdict("warning", f"It is {case} degrees cold.", "Warm it up.", weight=2.0)
    yield Verdict("good", "It turns.")
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    package = tmp_path / "told_of_the_cold"
    package.mkdir()
    (package / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    yield package
    for name in [n for n in sys.modules if n.startswith(package.name)]:
        del sys.modules[name]


def test_a_finding_is_one_file(folder):
    (folder / "cold.py").write_text(FILE)
    (folder / "not_one.py").write_text("shared = 1\n")
    told = collect_findings(importlib.import_module(folder.name), -3)
    assert [(v.finding, v.kind) for v in told] == [("cold", "warning"), ("cold", "good")]
    assert told[0].said == "It is -3 degrees cold. Warm it up."
    assert told[1].said == "It turns."


def test_worst_comes_first_and_praise_last():
    told = [Verdict("good", "a"), Verdict("note", "b"), Verdict("warning", "c"), Verdict("warning", "d", weight=1.0)]
    told += [Verdict("wrong", "e"), Verdict("note", "f")]
    assert [v.text for v in rank_verdicts(told)] == ["e", "d", "c", "b", "f", "a"]
    assert [v.kind for v in rank_verdicts(told)] == sorted((v.kind for v in told), key=VERDICT_KINDS.index)


def test_every_file_of_the_joints_findings_finds():
    names = {name for name, _ in finders(findings)}
    assert {"prediction", "weak_parameter", "estimators_disagree"} <= names


@pytest.mark.parametrize(("heading", "folder"), [("Of a joint", findings), ("Of a robot", of_a_robot)])
def test_the_docs_explain_every_finding(heading, folder):
    page = (Path(__file__).parents[2] / "docs" / "verdicts.md").read_text(encoding="utf-8")
    section = page.split(f"## {heading}\n")[1].split("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)) == {name for name, _ in finders(folder)}
