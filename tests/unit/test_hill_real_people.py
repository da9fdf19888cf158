"""The ranking of methods that `reproduce hill` shows is that of real people, and simulated people are a self-test."""

from pellucid_lab.papers.figure import Figures, figure
from pellucid_lab.papers.hill.paper import HillPaper
from pellucid_lab.papers.hill.real_people import (
    RANKING_FILE,
    ranked_methods,
    real_people_rows,
    real_people_section,
    write_ranking,
)


def test_every_method_has_an_interval_and_the_best_comes_first():
    ranked = ranked_methods()
    assert [each.common.ratio for each in ranked] == sorted(each.common.ratio for each in ranked)
    names = {each.name for each in ranked}
    assert {"named", "hill", "ridge", "boost", "motion", "nmco", "nmnc", "mbp", "plain_ridge_on_angles"} <= names
    # A method that is told the measured torque cannot be compared.
    assert "nmcoa" not in names
    shown = [own for each in ranked for own in (each.common, each.every) if own is not None]
    assert all(own.low <= own.ratio <= own.high and own.ratio >= 1.0 and own.cases > 1 for own in shown)
    # Muscles need a geometry, which some recordings lack.
    assert {each.name for each in ranked if each.every is None} >= {"hill", "nmco", "nmnc"}


def test_the_terminal_the_page_and_the_answer_show_the_same_ranking():
    rows = list(real_people_rows())
    assert [row.ours for row in rows] == [each.common.ratio for each in ranked_methods()]
    paper = HillPaper()
    paper.subjects = {}
    assert all(paper.is_main(row.id) and paper.split(row.id) == "heldout" for row in rows)
    (table,) = real_people_section().tables
    assert len(table.rows) == len(rows)
    others = ("rmse.truth.mean", "rmse.truth.recorded", "rmse.reference.eq12", "p.half_width.two_sines",
              "p.half_width.rich")  # fmt: skip
    figures = Figures([*rows, *(figure("hill", name, name, "1", 1.0) for name in others)])
    said = paper.answer(figures).said
    assert said.startswith("Tables 4 and 5 are a self-test on simulated people")
    assert str(ranked_methods()[0].common) in said


def test_a_ranking_is_read_as_it_was_written(tmp_path):
    write_ranking(ranked_methods(), tmp_path / "ranking.json")
    assert (tmp_path / "ranking.json").read_bytes() == RANKING_FILE.read_bytes()
