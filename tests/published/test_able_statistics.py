"""The tests between conditions that the paper prints follow from its rank sums within rounding, but for three slips."""

import re
from pathlib import Path

import pytest

from pellucid_lab.papers.able.statistics import PRINT_ERRORS, RANK_SUMS, statistics_rows
from pellucid_lab.papers.printed import printed

PAPER = printed("able")
ROWS = {row.id.removeprefix("able.statistics."): row for row in statistics_rows(PAPER)}


def test_every_printed_statistic_is_among_them():
    names = {n for n in PAPER.values if re.fullmatch(r"(duration|velocity|emg_acc)_(chi2|p|p_\w+)", n)}
    assert names == {name for name in ROWS if not name.endswith("_p_exact")}
    assert len(names) == 15


def test_all_but_three_agree_within_rounding_and_those_are_named():
    differing = {name for name, row in ROWS.items() if row.verdict == "cannot be"}
    assert differing == set(PRINT_ERRORS)
    assert all(ROWS[name].note == PRINT_ERRORS[name] for name in differing)
    for name, row in ROWS.items():
        if row.verdict == "agrees":
            low, high = PAPER.values[name].interval
            assert low <= row.ours <= high


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("duration_p_ctrl_pcfr", 0.0366),
        ("velocity_p", 0.0015),
        ("velocity_p_ctrl_fc", 0.8078),
        ("velocity_p_ctrl_clpc", 0.0044),
        ("emg_acc_p_fc_clpc", 0.00154),
        ("duration_p_exact", 2.37e-4),
        ("velocity_p_exact", 4.65e-5),
        ("emg_acc_p_exact", 1.29e-4),
    ],
)
def test_values(name, value):
    assert ROWS[name].ours == pytest.approx(value, rel=0.02)


def test_the_slips_are_single_strokes():
    assert PAPER.values["velocity_p"].agrees(10.0 * ROWS["velocity_p"].ours)
    assert PAPER.values["duration_p_fc_others"].agrees(10.0 * ROWS["duration_p_fc_others"].ours)
    assert int(1000.0 * ROWS["emg_acc_p_fc_clpc"].ours) == 1000.0 * PAPER["emg_acc_p_fc_clpc"]


def test_rank_sums_are_those_of_six_rankings():
    for sums in RANK_SUMS.values():
        assert sum(sums.values()) == 6 * len(sums) * (len(sums) + 1) // 2
    page = (Path(__file__).parents[2] / "docs" / "errata.md").read_text(encoding="utf-8")
    assert "### A1:" in page
    assert "### A2:" in page
