"""Prediction of the ABLE paper's experiment by people with parameters from movement without a robot.

The prediction is that of `pellucid reproduce able`. Robots have friction from the paper's value to the elbow's own,
each model of people has half of them, and people make few movements, as beginners. Rows report coverage, widths, and
the score of both. The paper's six people are the reference.
"""

from __future__ import annotations

from collections.abc import Iterator

from pellucid.study.results import ResultRow
from pellucid_lab.papers.able.predicted import EMG_RANK_SUM, PredictionSize, models_of_people, predict_paper
from pellucid_lab.papers.printed import printed


def able_rows(drawn: PredictionSize | None = None) -> Iterator[ResultRow]:
    """Nine effects in their intervals, their order, and what saying that nothing changes would score."""
    drawn = drawn or PredictionSize()
    made = predict_paper(
        drawn.rigs or models_of_people(), printed("able"), people=drawn.people, robots=drawn.robots,
        movements=drawn.movements,
    )  # fmt: skip
    p = made.prediction
    note = f"{len(p.worn)} robots x {p.people} people of {' and '.join(p.models)}, {p.repetitions} movements each"
    yield _row("effects_in_80_percent", made.inside, "1", f"of nine; {note}")
    whole = ", ".join(made.whole_orders) or "none"
    yield _row("order_as_predicted", made.order, "1", f"of nine orders of two laws, half by chance; of three: {whole}")
    yield _row("interval_score", made.interval_score(), "%", "duration and peak velocity; small is good")
    yield _row("interval_score_no_change", made.interval_score(no_change=True), "%", "of saying that nothing changes")
    for e in made.effects:
        unit = "1" if e.index == EMG_RANK_SUM else "%"
        said = f"{e.low:.1f} to {e.high:.1f}, the paper {e.printed:.1f}: {'inside' if e.inside else 'outside'}"
        yield _row(f"{e.index}.{e.law.lower()}", e.middle, unit, said)
        yield _row(f"{e.index}.{e.law.lower()}.width", e.high - e.low, unit, "of the 80 % interval")
    for f in made.findings:
        yield _row(f"predicted.{f.name}", f.studies, "1", f"of drawn studies: {f.words}")


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"people.able.{name}", float(value), unit, "evidence", "simulated", note=note)
