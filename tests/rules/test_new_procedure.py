"""A new procedure is one folder: a copy of the package with it checks, runs, prints, saves and reports its result."""

import json

import numpy as np
import pytest
from copied_package import copied_package, run_copied

from pellucid.study.procedures import command, registry
from pellucid.study.procedures.procedure import Procedure
from pellucid.study.procedures.result import Result
from pellucid.study.study_fields import ProcedureTable

FOLDER = '''"""The largest torque of every recording."""

from ...study.procedures.command import Command

PROCEDURE_ORDER = 125
PROCEDURE_COMMAND = Command("peak", "The largest torque of every recording.")
'''
PROCEDURE = '''"""Find the largest torque of every recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...study.results import ResultRow
from ...study.study_fields import ProcedureTable, Word
from ...study.procedures.procedure import Procedure, Progress, quiet
from ...study.procedures.result import FigureTable, Result

if TYPE_CHECKING:
    from ...study.pages.page import Page
    from ...files.fault import Fault
    from ...study.study import Study


class PeakTable(ProcedureTable):
    """Settings of the largest torque: ``[peak]``.

    Attributes
    ----------
    channel : str
        Channel whose largest absolute value is found.
    """

    channel: Word = "torque"


class PeakProcedure(Procedure[PeakTable, Result]):
    """The largest torque of every recording."""

    name, command = "peak", "peak"
    table = PeakTable

    def faults(self, study: Study, table: PeakTable) -> list[Fault]:
        return []

    def run(self, study: Study, table: PeakTable, tell: Progress = quiet) -> Result:
        recordings = study.recordings()
        peaks = {r.name: float(np.max(np.abs(r[table.channel]))) for r in recordings}
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

    def page(self, study: Study, found: Result) -> Page:
        from ...study.pages.page import Section
        from ...study.procedures.study_page import figure_tables, study_page

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
    (own / "__init__.py").write_text(FOLDER, encoding="utf-8")
    (own / "procedure.py").write_text(PROCEDURE, encoding="utf-8")
    domain = package / "people" / "domain.py"
    text = domain.read_text(encoding="utf-8")
    domain.write_text(text.replace('"study",', '"study", "peak",'), encoding="utf-8")
    touched = [path for path in package.rglob("*") if path.is_file() and before.get(path) != path.stat().st_mtime_ns]
    assert sorted(path.name for path in touched) == ["__init__.py", "domain.py", "procedure.py"]
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


def test_every_folder_has_one_procedure_and_an_order_of_its_own():
    folders = command.procedure_folders()
    assert [type(p).__module__.rpartition(".")[0] for p in registry.ALL_PROCEDURES] == [f.__name__ for f in folders]
    assert len({p.name for p in registry.ALL_PROCEDURES}) == len(folders)
    assert len({each.PROCEDURE_ORDER for each in folders}) == len(folders)


def test_every_procedure_is_typed_by_its_table_and_its_result():
    for procedure in registry.ALL_PROCEDURES:
        (base,) = type(procedure).__orig_bases__
        table, found = base.__args__
        assert base.__origin__ is Procedure
        assert procedure.table is (None if table is type(None) else table), procedure.name
        assert procedure.table is None or issubclass(procedure.table, ProcedureTable)
        assert found is not Result, procedure.name


def test_every_command_has_a_procedure_and_every_procedure_a_command():
    from pellucid.cli import app

    named = {each.name or each.callback.__name__ for each in app.registered_commands}
    brought = {each.name for each in command.procedure_commands()}
    asked = {procedure.command for procedure in registry.ALL_PROCEDURES}
    assert brought <= asked <= named
    assert asked - brought == {"identify", "assess"}  # they have options of their own, and stand in cli.py
