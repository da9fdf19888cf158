"""Findings: a function each, told worst first, and none where there is nothing to tell."""

import importlib
import re
import sys
from dataclasses import replace
from pathlib import Path

import fabricate
import pytest

from pellucid.arm.study import tree_findings
from pellucid.joint.fit.estimator_agreement import DISAGREEMENT_DOUBT, names_outside
from pellucid.joint.study import joint_findings
from pellucid.models.estimates import VERDICT_KINDS, Verdict, rank_verdicts
from pellucid.study.pages.quantities import parameter_note
from pellucid.study.procedures.findings import collect_findings, finders

FINDINGS = '''"""A joint that is cold."""

from pellucid.models.estimates import Verdict


def report_cold(case):
    """How cold it is."""
    yield Verdict("warning", f"It is {case} degrees cold.", "Warm it up.", weight=2.0)
    yield Verdict("good", "It turns.")


def shared():
    """Report nothing: no name of a finding."""
'''


def test_a_finding_is_one_function(tmp_path, monkeypatch):
    (tmp_path / "told_of_the_cold.py").write_text(FINDINGS)
    monkeypatch.syspath_prepend(tmp_path)
    told = collect_findings(importlib.import_module("told_of_the_cold"), -3)
    del sys.modules["told_of_the_cold"]
    assert [(v.finding, v.kind) for v in told] == [("cold", "warning"), ("cold", "good")]
    assert told[0].said == "It is -3 degrees cold. Warm it up."
    assert told[1].said == "It turns."


def test_worst_comes_first_and_praise_last():
    told = [Verdict("good", "a"), Verdict("note", "b"), Verdict("warning", "c"), Verdict("warning", "d", weight=1.0)]
    told += [Verdict("wrong", "e"), Verdict("note", "f")]
    assert [v.text for v in rank_verdicts(told)] == ["e", "d", "c", "b", "f", "a"]
    assert [v.kind for v in rank_verdicts(told)] == sorted((v.kind for v in told), key=VERDICT_KINDS.index)


def test_the_joints_findings_are_found():
    names = {name for name, _ in finders(joint_findings)}
    assert {"prediction", "weak_parameter", "estimators_disagree"} <= names


def test_an_interval_that_excludes_another_estimate_is_marked():
    """A finding said that the headline's intervals contain the other estimates, which were outside."""
    fit = next(iter(fabricate.fit(samples=400).families.values()))
    own = fit.estimate["inertia"]
    plain = {m: replace(e, parameters=fit.estimate.parameters) for m, e in fit.others.items()}
    assert names_outside(replace(fit, others=plain), 0.95) == []
    apart = replace(own, value=own.value + 6.0 * own.standard_error, influence=1.0)
    parameters = tuple(apart if p.name == "inertia" else p for p in fit.estimate.parameters)
    held = tuple(replace(p, influence=10.0) for p in fit.estimate.parameters)
    fit = replace(
        fit,
        estimate=replace(fit.estimate, parameters=held),
        others={"output_error": replace(fit.others["output_error"], parameters=parameters)},
    )
    outside = names_outside(fit, 0.95)
    assert outside == ["inertia"]
    marked = fit.with_doubt(outside, DISAGREEMENT_DOUBT).headline.estimate
    assert parameter_note(marked["inertia"], 0.95) == "estimators disagree"
    assert parameter_note(marked["viscous"], 0.95) == ""


@pytest.mark.parametrize(
    ("heading", "module"), [("Findings about a joint", joint_findings), ("Findings about a robot", tree_findings)]
)
def test_the_docs_explain_every_finding(heading, module):
    page = (Path(__file__).parents[2] / "docs" / "verdicts.md").read_text(encoding="utf-8")
    section = page.split(f"## {heading}\n")[1].split("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)) == {name for name, _ in finders(module)}
