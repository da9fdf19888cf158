"""The page of speed tells of every goal whether it is held, and why not."""

from research.benchmarks._goals import GOALS, goal_table, speed_page


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
    assert "| a / b |" in page
    assert speed_page([], "a machine").count("not measured") == len(GOALS)
