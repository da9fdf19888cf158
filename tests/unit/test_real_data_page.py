"""The page of real data shows what the stored results have, and names a command for everything else."""

import re
from pathlib import Path

from research.evidence import _real_data_page as page
from research.evidence.real_data import COMMANDS

from pellucid.study.datasets.registry import names


def test_the_page_is_written_from_the_stored_results():
    assert page.PAGE.read_text(encoding="utf-8") == page.real_data_page(page.read_results())


def test_every_figure_of_the_page_was_measured_on_a_data_set_that_has_a_command():
    results = page.read_results()
    assert set(results) == set(page.wanted_ids())
    assert {figure.partition(".")[0] for figure in results} == set(COMMANDS)
    assert all(row.value is not None and row.split in ("fitted", "heldout") for row in results.values())
    assert set(COMMANDS) <= set(names())


def test_results_without_a_file_name_proofs_that_exist():
    folder = Path(page.__file__).parent
    named = re.findall(r"research\.evidence (\w+)", page.OTHERS)
    assert [name for name in named if not (folder / f"{name}.py").exists()] == []


def test_a_minus_sign_is_shown_and_a_negative_zero_is_not():
    assert (page.shown(-0.013, 2), page.shown(-0.002, 2), page.shown(95.116, 2)) == ("−0.01", "0.00", "95.12")
