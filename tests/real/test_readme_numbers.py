"""Every number in the README's table is what the commands print, to the last digit shown."""

import re
from pathlib import Path

import pytest

from pellucid.procedures.joint.joint_result import rows_of

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
TABLE = re.findall(r"^\| `([\w.]+)` \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", README, flags=re.MULTILINE)
UNITS = {"N·s/m": "N*s/m"}


@pytest.fixture(scope="module")
def rows(emps_fit):
    return {row.id: row for row in rows_of(emps_fit)}


def test_there_is_a_table():
    assert len(TABLE) >= 10


@pytest.mark.parametrize(("figure", "shown", "unit"), [(i, s, u) for i, _, s, u in TABLE], ids=[t[0] for t in TABLE])
def test_the_readme_shows_what_is_found(rows, figure, shown, unit):
    text = shown.strip().replace("−", "-")
    decimals = len(text.partition(".")[2])
    assert f"{rows[figure].value:.{decimals}f}" == text
    assert rows[figure].unit == UNITS.get(unit.strip(), unit.strip())
