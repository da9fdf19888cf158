"""Prediction of people's movements in a robot by models without one: the ABLE study, compared with "nothing changes".

The figures are those of `python -m research.evidence people`, as a smaller study. The people are frozen
(docs/design/frozen-participants.md): no parameter depends on movement in a robot.
"""

from collections.abc import Iterator

from pellucid.study.results import ResultRow
from pellucid_lab.papers.able.predicted import PredictionSize
from research.benchmarks._size import sized

from ._able_predicted import able_rows

STUDY_SIZE = sized(
    PredictionSize(robots=4, people=6, movements=12), smallest=PredictionSize(robots=1, people=2, movements=2)
)
"""Robots, people of each model, and movements of a person in a condition."""


def people_rows() -> Iterator[ResultRow]:
    """Effects inside their intervals, score over that of no change, and the error of times without a robot."""
    from .people import data, pointing_rows

    able = {row.id: row for row in able_rows(STUDY_SIZE)}
    inside = able["people.able.effects_in_80_percent"]
    yield _row("effects_in_80_percent", inside.value, "1", inside.note, "simulated")
    order = able["people.able.order_as_predicted"]
    yield _row("order_as_predicted", order.value, "1", order.note, "simulated")
    score, kept = (able[f"people.able.interval_score{end}"].value for end in ("", "_no_change"))
    note = f"{score:.0f} over {kept:.0f} %, the score of saying that nothing changes; below 1 would be better than it"
    yield _row("score_over_nothing_changes", score / kept, "1", note, "simulated")
    folder = data() / "human_pointing"
    if not folder.is_dir():
        print("mission.people.time_error: not measured, for human_pointing is not on this machine")
        return
    pointing = {row.id: row for row in pointing_rows(folder)}
    for name, source in (("time_error", "time_error"), ("time_error.rival", "time_error.rival")):
        row = pointing[f"people.pointing.{source}"]
        yield _row(name, row.value, "1", row.note, "heldout")


def _row(name: str, value: float, unit: str, note: str, split: str) -> ResultRow:
    return ResultRow(f"mission.people.{name}", float(value), unit, "evidence", split, None, note)
