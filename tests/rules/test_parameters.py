"""The tables of parameters in docs/ are what the core says."""

import runpy
from pathlib import Path

WRITER = Path(__file__).parents[2] / "bindings" / "write_parameters.py"


def test_the_tables_are_up_to_date():
    written = runpy.run_path(str(WRITER))
    assert written["OUT"].read_text(encoding="utf-8") == written["text"]()
