"""A posterior beside intervals: asked for in study.toml, told in words, drawn, kept; refused without its package."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.models.estimates import Parameter
from pellucid.numerics.posterior.posterior import DrawnParameter, Posterior
from pellucid.study.procedures.posterior_beside import (
    ComparedPosterior,
    pair_with_posterior,
    posterior_table,
    posterior_verdicts,
)
from pellucid.study.procedures.result import FigureTable
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study


def drawn(name, centre, spread, **more):
    draws = centre + spread * np.random.default_rng(1).standard_normal(4000)
    return DrawnParameter(name, "N*m", centre, spread, draws=draws, **more)


def posterior(*parameters, **more):
    return Posterior(parameters=parameters, covariance=np.eye(len(parameters)), **more)


def said(compared, found):
    return [(v.kind, v.said) for v in posterior_verdicts(compared, found, 0.95)]


def test_widths_within_a_factor_of_two_agree():
    found = posterior(drawn("gravity", 1.0, 0.15))
    assert said(pair_with_posterior([Parameter("gravity", "N*m", 1.0, 0.1)], found), found) == [
        ("good", "The widths of intervals and posterior agree within a factor of 2.")
    ]


@pytest.mark.parametrize(("spread", "word"), [(0.3, "narrower"), (0.03, "wider")])
def test_widths_further_apart_are_told_with_both_intervals(spread, word):
    found = posterior(drawn("gravity", 1.0, spread))
    [one] = pair_with_posterior([Parameter("gravity", "N*m", 1.0, 0.1)], found)
    assert word in one.told(0.95)
    [(kind, text)] = said([one], found)
    assert kind == "warning"
    assert "0.80 to 1.20 from the fit" in text


def test_of_a_refused_interval_it_is_said_whether_the_data_or_the_prior_tell():
    refused = Parameter("gravity", "N*m", 1.0, 0.1, refused="effects that the model lacks may explain all of it")
    told = drawn("gravity", 1.0, 0.1)
    [(kind, text)] = said([ComparedPosterior(refused, told)], posterior(told))
    assert kind == "note"
    assert "its posterior, which the data determine, is 0.81 to 1.20 N·m" in text
    guessed = replace(told, prior_share=0.9)
    [(_, text)] = said([ComparedPosterior(refused, guessed)], posterior(guessed))
    assert "gravity is determined by the prior, not by the data" in text
    assert ComparedPosterior(refused, guessed).told(0.95) == "determined by the prior"


def test_of_draws_that_have_not_settled_nothing_is_read():
    one = drawn("gravity", 1.0, 0.1, refused="the posterior has not settled: R-hat 1.2")
    compared = [ComparedPosterior(Parameter("gravity", "N*m", 1.0, 0.1), one)]
    [(kind, text)] = said(compared, posterior(one, unsettled="R-hat 1.2"))
    assert kind == "warning"
    assert "is not used" in text
    assert posterior_table("", compared, 0.95).rows[0][4] == "not settled"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("few") / "study"
    write_study(folder, bench_joint().changed({"sampling.duration": 3.0}), name="few", seed=5, threads=1)
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text.replace("[model]", '[model]\nfamilies = ["symmetric"]\nposterior = true'))
    return pl.open(folder)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_joint_has_it_in_tables_rows_verdicts_and_on_the_page(study):
    result = pl.identify(study, thorough=False)
    [table] = [t for t in result.tables if isinstance(t, FigureTable) and "Posterior" in t.title]
    assert [row[0] for row in table.rows] == [p.name for p in result.families["symmetric"].estimate.parameters]
    assert any(v.finding == "posterior" for v in result.verdicts)
    rows = {row.id: row for row in result.rows}
    low, high = result.posterior["inertia"].interval()
    assert low < rows["few.symmetric.posterior.inertia"].value < high
    assert "R-hat" in rows["few.symmetric.posterior.inertia"].note
    assert low < bench_joint()["joint"]["inertia"] < high
    result.save(study)
    page = pl.report(study)
    assert "posterior-" in page.read_text(encoding="utf-8")
    assert (page.parent / "posterior.svg").is_file()


def test_without_its_package_it_is_refused_before_anything_is_read(study, monkeypatch):
    monkeypatch.setitem(sys.modules, "emcee", None)
    with pytest.raises(PellucidError, match=r'found no package emcee, expected it: pip install "emcee'):
        pl.identify(study, thorough=False)
