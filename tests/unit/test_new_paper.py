"""A paper is added by its folder alone: what it prints, and one file that computes it again."""

import json
import sys

import pytest

from pellucid._errors import PellucidError
from pellucid.study.results import read_rows
from pellucid_lab import papers as room
from pellucid_lab.papers.figure import Figures, figure
from pellucid_lab.papers.paper import Paper, paper
from pellucid_lab.papers.printed import papers
from pellucid_lab.papers.reproduce import reproduce

PRINTED = """
name = "tides"
title = "A pendulum of one metre"
authors = "N. N."
journal = "Nowhere"
year = 2024

[values]
period = { value = 2.01, unit = "s", where = "Section 1" }
length = { value = 1.0, unit = "m", where = "Section 1" }

[tables]
"""

COMPUTED = '''
"""A pendulum's period, again."""

import numpy as np

from pellucid_lab.papers.figure import figure
from pellucid_lab.papers.paper import Paper
from pellucid_lab.processes import ordered_results

SEEDS = range(4)


def period(seed, length):
    rng = np.random.default_rng(seed)
    return 2.0 * np.pi * np.sqrt(length * (1.0 + 0.01 * rng.standard_normal()) / 9.81)


class Tides(Paper):
    main = ("tides.",)
    splits = {"simulated": ("tides.",)}

    def figures(self, tell):
        jobs = [(period, seed, self.printed["length"]) for seed in SEEDS]
        drawn = ordered_results(jobs, 1, lambda n, of: tell("", n / of))
        yield figure("tides", "period", "Period", "s", drawn, self.printed["period"])
        yield figure("tides", "exact", "Period without noise", "s", 2.00607, self.printed.values["period"])
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    made = tmp_path / "papers" / "tides"
    made.mkdir(parents=True)
    (made / "printed.toml").write_text(PRINTED, encoding="utf-8")
    (made / "paper.py").write_text(COMPUTED, encoding="utf-8")
    monkeypatch.setattr(room, "__path__", [*room.__path__, str(made.parent)])
    yield made
    for name in [name for name in sys.modules if name.startswith("pellucid_lab.papers.tides")]:
        del sys.modules[name]


def test_two_files_are_all_that_a_paper_is(folder, tmp_path):
    assert "tides" in papers()
    assert len(list(folder.iterdir())) == 2
    shares = []
    made = reproduce("tides", tmp_path / "out", on_progress=lambda text, share: shares.append(share))
    assert shares == [0.25, 0.5, 0.75, 1.0]
    rows = {r.id: r for r in read_rows(tmp_path / "out" / "results.json")}
    assert rows["tides.exact"].value == 2.00607
    assert rows["tides.period"].split == "simulated"
    assert rows["tides.period"].command == "reproduce tides"
    written = json.loads((tmp_path / "out" / "reproduction.json").read_text(encoding="utf-8"))["rows"]
    verdicts = {row["id"]: row["verdict"] for row in written}
    assert verdicts == {"tides.period": "agrees", "tides.exact": "agrees"}
    assert made.lines[1] == "Period without noise: 2.006 s, published 2.01"
    page = made.page.read_text(encoding="utf-8")
    assert "A pendulum of one metre" in page
    assert "2.01" in page


def test_every_paper_of_the_package_is_found_in_its_folder():
    assert list(papers()) == ["able", "hill", "knee"]
    for name in papers():
        made = paper(name)()
        assert isinstance(made, Paper)
        assert made.name == name
        assert made.printed.name == name


def test_a_folder_without_a_paper_says_so(folder):
    (folder / "paper.py").write_text('"""Nothing."""\n', encoding="utf-8")
    with pytest.raises(PellucidError, match="found 0 subclasses of Paper, expected one"):
        paper("tides")
    with pytest.raises(PellucidError, match="known: able, hill, knee, tides"):
        paper("ebb")


def test_two_figures_of_one_id_are_refused():
    with pytest.raises(PellucidError, match=r"two figures have the id tides\.x"):
        Figures([figure("tides", "x", "", "1", 1.0), figure("tides", "x", "", "1", 2.0)])
