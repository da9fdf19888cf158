"""The page of speed shows each ratio with its bound, the causes of a miss, and only what the stored results have."""

import subprocess
import sys
from pathlib import Path

from research.benchmarks._goals import COMPARISONS, GOALS, RESULTS_FILE, SPEED_PAGE, goal_table, speed_page, stored_page


def rows(share):
    """Rows whose ratios are `share` times the bound of each goal."""
    return [{"name": g.name, "value": share * g.bound, "unit": "1", "note": "a | b"} for g in GOALS]


def test_goals_that_are_held_and_missed_are_told_apart():
    for share in (0.5, 2.0):
        for line in goal_table(rows(share)).splitlines():
            assert line.endswith("yes" if (share < 1.0) == ("≤" in line) else "no"), line


def test_a_missed_goal_has_a_reason_and_a_missing_benchmark_is_said():
    page = speed_page(rows(2.0), "a machine")
    assert all(goal.profile in page for goal in GOALS if not goal.at_least)
    assert speed_page([], "a machine").count("not measured") == len(GOALS)


def test_the_page_is_written_from_the_stored_results():
    assert SPEED_PAGE.read_text(encoding="utf-8") == stored_page()
    assert "not measured" not in stored_page()
    assert [each.name for each in COMPARISONS if f"| {each.words} |" not in stored_page()] == []


def test_a_run_writes_into_the_repository_only_if_asked(tmp_path):
    before = (SPEED_PAGE.read_bytes(), RESULTS_FILE.read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "research.benchmarks", "--write", "plant", "--smallest"],
        cwd=Path(__file__).parents[2], capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 1
    assert "expected every one at full size" in done.stderr
    assert (SPEED_PAGE.read_bytes(), RESULTS_FILE.read_bytes()) == before
