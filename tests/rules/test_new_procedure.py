"""A new procedure is one folder: a copy of the package with it checks, runs, prints, saves and reports its result."""

import inspect
import json
from importlib import import_module

import numpy as np
import pytest
from copied_package import copied_package, run_copied

from pellucid.study.procedures import registry
from pellucid.study.procedures.procedure import ProcedureEntry, procedure_commands
from pellucid.study.procedures.result import Result
from pellucid.study.study_fields import ProcedureTable

ENTRIES = tuple(each for each in registry.ALL_PROCEDURES if isinstance(each, ProcedureEntry))
ENTRY = '''    ProcedureEntry(
        package=f"{__package__}.peak",
        name="peak",
        command="peak",
        order=126,
        table_class="peak:PeakTable",
        find_faults="peak:faults",
        find="peak:find_peaks",
        draw="peak:page",
        brings=Command("peak", "The largest torque of every recording."),
    ),
'''
PROCEDURE = '''"""Find the largest torque of every recording."""

from __future__ import annotations

import numpy as np

from ...files.fault import Fault
from ...study.pages.page import Page, Section
from ...study.procedures.procedure import Progress, quiet
from ...study.procedures.result import FigureTable, Result
from ...study.procedures.study_page import figure_tables, study_page
from ...study.results import ResultRow
from ...study.study import Study
from ...study.study_fields import ProcedureTable, Word


class PeakTable(ProcedureTable):
    """Settings of the largest torque: ``[peak]``.

    Attributes
    ----------
    channel : str
        Channel whose largest absolute value is found.
    """

    channel: Word = "torque"


def faults(study: Study) -> list[Fault]:
    """Return no faults."""
    return []


def find_peaks(study: Study, tell: Progress = quiet) -> Result:
    """Find the largest torque of every recording."""
    recordings = study.recordings()
    peaks = {r.name: float(np.max(np.abs(r[study.table(PeakTable).channel]))) for r in recordings}
    tell("peaks", 0.5)
    return Result(
        study=study.name,
        headline=f"The largest torque is {max(peaks.values()):.3g} N m.",
        tables=(FigureTable("Peaks", ("Recording", "torque [N m]"), tuple(peaks.items())),),
        verdicts=(),
        rows=tuple(
            ResultRow(f"{study.name}.{r.name}.peak", peaks[r.name], "N*m", "peak", "fitted", r.checksum)
            for r in recordings
        ),
        cards={},
        checksums={r.name: r.checksum for r in recordings},
    )


def page(study: Study, found: Result) -> Page:
    """Return the part of the report."""
    section = Section("peak", "Peaks", (), figure_tables(found))
    return study_page(f"{found.study}: peaks", found.headline, (), (section,), found.verdicts)
'''
STUDY = """
name = "arm"
[rig]
joint = "elbow"
motion = "rotary"
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "tau", unit = "N*m" }
[peak]
channel = "torque"
[[recordings]]
name = "one"
file = "one.csv"
"""
SCRIPT = """
import json, sys
from typer.testing import CliRunner
import pellucid as pl
from pellucid.cli import app
from pellucid.study.procedures.run import run
folder = sys.argv[1]
for arguments in (["--help"], ["check", folder], ["peak", folder], ["report", folder]):
    done = CliRunner().invoke(app, arguments)
    if done.exit_code:
        raise done.exception
    said = done.output if arguments == ["--help"] else said
study = pl.open(folder)
print(json.dumps({
    "listed": "The largest torque of every recording." in said,
    "named": run(study, "peak").rows[0].value,
    "all": run(study).procedure,
}))
"""


@pytest.mark.slow
def test_a_procedure_is_one_folder(tmp_path):
    package = copied_package(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in package.rglob("*") if path.is_file()}
    own = package / "people" / "peak"
    own.mkdir()
    (own / "__init__.py").write_text('"""The largest torque of every recording."""\n', encoding="utf-8")
    (own / "peak.py").write_text(PROCEDURE, encoding="utf-8")
    domain = package / "people" / "domain.py"
    text = domain.read_text(encoding="utf-8").replace("\nPROCEDURE_ENTRIES = (\n", f"\nPROCEDURE_ENTRIES = (\n{ENTRY}")
    importing = "from ..study.procedures.command import Command\n"
    domain.write_text(text.replace("from ..study", f"{importing}from ..study", 1), encoding="utf-8")
    touched = [path for path in package.rglob("*") if path.is_file() and before.get(path) != path.stat().st_mtime_ns]
    assert sorted(path.name for path in touched) == ["__init__.py", "domain.py", "peak.py"]
    assert {path.parent for path in touched} == {own, domain.parent}
    folder = tmp_path / "arm"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    t = np.arange(0.0, 10.0, 0.01)
    columns = np.column_stack([t, np.sin(t), 2.5 * np.sin(0.7 * t)])
    np.savetxt(folder / "one.csv", columns, delimiter=",", header="t,q,tau", comments="")
    done = run_copied(package.parent, SCRIPT, folder)
    assert done.returncode == 0, done.stdout + done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said == {"listed": True, "named": pytest.approx(2.5, rel=1e-3), "all": "peak"}
    (row,) = json.loads((folder / "results.json").read_text(encoding="utf-8"))["figures"]
    assert (row["id"], row["command"]) == ("arm.one.peak", "peak")
    assert "The largest torque is 2.5" in (folder / "report" / "index.html").read_text(encoding="utf-8")


def test_every_procedure_has_a_name_and_an_order_of_its_own():
    assert len({each.name for each in registry.ALL_PROCEDURES}) == len(registry.ALL_PROCEDURES)
    assert len({each.order for each in ENTRIES}) == len(ENTRIES)


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_every_entry_names_functions_that_take_what_they_are_given(entry):
    assert entry.table is None or issubclass(entry.table, ProcedureTable)
    assert entry.table is not None or entry.is_asked is not None
    arguments = {"find": 2, "draw": 2, "find_faults": 1, "is_asked": 1, "find_inputs": 1, "find_notes": 1}
    for field, count in arguments.items():
        if getattr(entry, field) is not None:
            inspect.signature(entry._load(getattr(entry, field))).bind(*range(count))
    results = inspect.signature(entry._load(entry.find)).return_annotation
    module = import_module(entry._load(entry.find).__module__)
    for name in results.split(" | "):
        found = getattr(module, name, None)
        assert found is None or (issubclass(found, Result) and found is not Result), name


def test_every_command_has_a_procedure_and_every_procedure_a_command():
    from pellucid.cli import app

    named = {each.name or each.callback.__name__ for each in app.registered_commands}
    brought = {each.name for each in procedure_commands()}
    asked = {procedure.command for procedure in registry.ALL_PROCEDURES}
    assert brought <= asked <= named
    assert asked - brought == {"identify", "assess"}  # they have options of their own, and stand in cli.py
