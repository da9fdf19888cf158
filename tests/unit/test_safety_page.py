"""The page of docs/safety.md that a proof writes: every measured fault has its row, and what stood around it stays."""

from research.evidence import _safety_page
from research.evidence._safety_page import BEGIN_MARK, END_MARK, table, write_page

from pellucid.study.results import ResultRow
from pellucid_lab.safety.fault_table import FAULT_KINDS, FaultTable, FaultTrial

NEVER = float("nan")


def trial(kind: str, found: float = 0.004, excess: float = 0.1) -> FaultTrial:
    return FaultTrial(kind, "fc", 0, False, found, 2.0 * found, "jump", "zero", excess, 2.0, 0.0, 0.0)


MEASURED = FaultTable((trial("drive_dead"), trial("drive_dead", NEVER, 0.7), trial("encoder_drift", NEVER)), ())


def test_every_measured_fault_has_a_row_and_no_other():
    written = table(MEASURED)
    assert "| 1 of 2 | 4 ms | 4 ms | 8 ms | 0.70 J | 2.0 N m |" in written
    assert "| `encoder_drift` * |" in written
    assert "| 0 of 1 |  |  |  | 0.10 J |" in written
    assert sum(f"`{kind.name}`" in written for kind in FAULT_KINDS) == 2


def test_what_stands_around_the_marks_stays(tmp_path, monkeypatch):
    page = tmp_path / "safety.md"
    page.write_text(f"before\n{BEGIN_MARK}\nold\n{END_MARK}\nafter\n", encoding="utf-8")
    monkeypatch.setattr(_safety_page, "PAGE_FILE", page)
    write_page(MEASURED, MEASURED, [ResultRow("safety.x", 1.0, "J", "evidence", "simulated", None, "a note")])
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    assert "| `safety.x` | 1 J | a note |" in text
