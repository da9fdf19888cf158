"""Every number of EMPS in the findings and in the README is what the commands print, to the last digit shown."""

import re
from pathlib import Path

import pytest

from pellucid.joint.study.joint_result import rows_of

ROOT = Path(__file__).parents[2]
FINDINGS = (ROOT / "docs" / "validation" / "real-data.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
TABLE = re.findall(r"^\| `([\w.]+)` \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", FINDINGS, flags=re.MULTILINE)
UNITS = {"N·s/m": "N*s/m"}
IN_README = {
    "emps.symmetric.inertia": "moving mass of EMPS",
    "emps.symmetric.effort_error.pulses": "error of its effort on a held-out recording",
}


@pytest.fixture(scope="module")
def rows(emps_fit):
    return {row.id: row for row in rows_of(emps_fit)}


def test_there_is_a_table():
    assert len(TABLE) >= 9


@pytest.mark.parametrize(("figure", "shown", "unit"), [(i, s, u) for i, _, s, u in TABLE], ids=[t[0] for t in TABLE])
def test_the_findings_are_what_is_found(rows, figure, shown, unit):
    text = shown.strip().replace("−", "-")
    decimals = len(text.partition(".")[2])
    assert f"{rows[figure].value:.{decimals}f}" == text
    assert rows[figure].unit == UNITS.get(unit.strip(), unit.strip())


@pytest.mark.parametrize("figure", IN_README)
def test_the_readme_shows_the_same(figure):
    published, shown, unit = next((p, s, u) for i, p, s, u in TABLE if i == figure)
    assert f"| {IN_README[figure]} | {published} {unit} | {shown} {unit} | a real machine |" in README
