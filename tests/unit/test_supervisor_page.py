"""The supervisor's results and their pages: every fault was measured and bounded, and the pages show the results."""

import pytest
from research.evidence import _supervisor_page as page
from research.evidence._supervisor_page import (
    FaultFigure,
    Results,
    fault_figures,
    quoted_figures,
    read_results,
    write_results,
)

from pellucid.controllers import supervisor_faults
from pellucid.study.results import ResultRow
from pellucid_lab.safety.fault_table import FAULT_KINDS, FaultTrial

NEVER = float("nan")
KINDS = {kind.name: kind for kind in FAULT_KINDS}
MEASURED = read_results()

UNCERTAIN = frozenset({"encoder_frozen", "force_flipped", "force_triple", "emg_crossed", "drive_holds", "drive_late",
                       "wearer_blocked", "strap_opens", "wearer_spasm"})  # fmt: skip
"""Faults of the elbow that need not be detected in every run, because a bounded energy is all that they give."""

MAX_EXCESS_J = 1.5
"""Largest energy of a fault that is not among the following ones."""

ELBOW_EXCESS = {"wearer_spasm": 3.6}
"""Larger bounds of the virtual lab's elbow [J]: a quarter more than was measured."""

KNEE_EXCESS = {"emg_lost": 2.6, "drive_triple": 4.3, "drive_late": 4.8, "wearer_spasm": 4.2}
"""Larger bounds of the virtual lab's knee [J]: a quarter more than was measured."""

ELBOW_LATEST_S = 4.51
"""Longest time to detection on the elbow: a quarter more than was measured."""


def trial(kind: str, found: float = 0.004, excess: float = 0.1, early: bool = False) -> FaultTrial:
    return FaultTrial(kind, "fc", 0, early, found, 2.0 * found, "jump", "zero", excess, 2.0, 0.0, 0.0)


def figures(*trials: FaultTrial) -> tuple[FaultFigure, ...]:
    return tuple(fault_figures("lab_elbow", trials, KINDS))


def test_a_fault_is_counted_over_its_valid_runs():
    found = (trial("drive_dead"), trial("drive_dead", NEVER, 0.7), trial("drive_dead", excess=9.0, early=True))
    dead, drift = figures(trial("encoder_drift", NEVER), *found)[::-1]
    assert (dead.runs, dead.detected, dead.rate, dead.excess) == (2, 1, 50.0, 0.7)
    assert (dead.median, dead.latest) == (0.004, 0.004)
    assert (drift.hidden, drift.detected, drift.median, drift.latest) == (True, 0, None, None)


def test_every_fault_has_a_sentence_of_its_own():
    faults = {(each.robot, each.sentence, each.fault) for each in MEASURED.faults}
    assert len({(robot, sentence) for robot, sentence, _ in faults}) == len(faults)


def test_results_are_read_as_they_were_written(tmp_path):
    row = ResultRow("safety.unsafe", 0.0, "1", "evidence", "simulated", None, "a note")
    results = Results((row,), figures(trial("drive_dead"), trial("encoder_drift", NEVER)))
    path = tmp_path / "results" / "supervisor.json"
    write_results(results, path)
    assert read_results(path) == results
    assert results.value("safety.unsafe") == 0.0
    assert results.value("safety.absent") is None


@pytest.mark.parametrize(
    ("detected", "runs", "words"),
    [(0, 10, "0.0 % (0.0 to 30.8 %)"), (10, 10, "100.0 % (69.2 to 100.0 %)"), (5, 10, "50.0 % (18.7 to 81.3 %)"),
     (0, 0, "")],
)  # fmt: skip
def test_a_rate_has_its_exact_interval(detected, runs, words):
    """Numbers of a table of Clopper and Pearson's interval."""
    assert page.rate_words(detected, runs) == words


def test_the_explanation_keeps_what_stands_around_its_table():
    made = [FaultFigure(robot, "drive_dead", "the drive gives no effort", False, 0.0, 10, 8, 8, 0.005, 0.9, 0.06)
            for robot in ("drive_measured", "unmeasured")]  # fmt: skip
    text = f"before\n{page.BEGIN_MARK}\nold\n{page.END_MARK}\nafter\n"
    written = page.with_table(text, Results((), tuple(made)))
    assert written.startswith("before\n")
    assert written.endswith("\nafter\n")
    assert "old" not in written
    assert "| the drive gives no effort | 5 ms, 0.06 J | 5 ms, 0.06 J |" in written


def test_the_pages_show_the_results():
    """`python -m research.evidence.safety --page` writes them."""
    assert page.VALIDATION_PAGE.read_text(encoding="utf-8") == page.validation_page(MEASURED)
    text = page.EXPLANATION_PAGE.read_text(encoding="utf-8")
    assert text == page.with_table(text, MEASURED)
    assert "is not certified" in text


def test_every_fault_was_measured():
    elbow = {fault.fault: fault for fault in MEASURED.of("lab_elbow")}
    assert set(elbow) == set(KINDS)
    assert all(fault.runs >= 20 and fault.hidden == bool(KINDS[name].hidden) for name, fault in elbow.items())
    assert len({fault.fault for fault in MEASURED.of("lab_knee")}) > 20
    assert {fault.robot for fault in MEASURED.faults} <= set(page.INSTRUMENT_TITLES)


@pytest.mark.parametrize(("robot", "bounds"), [("lab_elbow", ELBOW_EXCESS), ("lab_knee", KNEE_EXCESS)])
def test_every_fault_that_a_sensor_shows_has_a_bounded_energy(robot, bounds):
    shown = [fault for fault in MEASURED.of(robot) if not fault.hidden]
    assert [f.fault for f in shown if f.excess > bounds.get(f.fault, MAX_EXCESS_J)] == []


def test_certain_faults_of_the_elbow_are_always_detected_in_time():
    shown = [fault for fault in MEASURED.of("lab_elbow") if not fault.hidden and fault.fault not in UNCERTAIN]
    assert [fault.fault for fault in shown if fault.detected < fault.runs] == []
    assert [fault.fault for fault in shown if fault.latest > ELBOW_LATEST_S] == []


def test_exports_quote_the_stored_results():
    results = read_results()
    assert quoted_figures(results, "blind") == supervisor_faults.UNMEASURED_FAULTS
    assert quoted_figures(results, "unmeasured") == supervisor_faults.PROBED_FAULTS
    assert quoted_figures(results, "drive_measured") == supervisor_faults.MEASURED_FAULTS
    assert quoted_figures(results, "drive_measured", ("drive_triple_unseen",)) == supervisor_faults.UNSEEN_FAULTS
