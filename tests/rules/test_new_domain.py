"""A new domain is one folder, and a new exporter one file and its line in a domain: copies of the package have one."""

import json
from pathlib import Path

import numpy as np
import pytest
from copied_package import copied_package, run_copied
from test_new_procedure import ENTRY, PROCEDURE, STUDY

EXPORTER = '''"""The largest torques as a file of JSON."""

import json
from pathlib import Path

from ..study.exporter import Exporter, ExportRequest


class PeaksExporter(Exporter):
    """A file of the largest torques."""

    kinds = ("peaks",)
    order = 90
    unused = ("period",)
    why_unused = "a file has no period"

    def export(self, request: ExportRequest) -> Path:
        path = request.out or request.study.place("peaks.json")
        peaks = {r.name: float(abs(r["torque"]).max()) for r in request.study.recordings()}
        path.write_text(json.dumps(peaks), encoding="utf-8")
        return path
'''
DOMAIN = f'''"""The grip of a hand: what it offers to the rest of Pellucid, as `_domains.py` describes."""

from ..study.procedures.command import Command
from ..study.procedures.procedure import ProcedureEntry

PROCEDURE_ENTRIES = (
{ENTRY})
EXPORTER_CLASSES = ("peaks_file:PeaksExporter",)
'''
EXPORTED = """
import sys
import pellucid as pl
study = pl.open(sys.argv[1])
print(pl.export(study, to="peaks").read_text())
try:
    pl.export(study, to="peaks", period=0.001)
except pl.PellucidError as error:
    assert "a file has no period" in str(error), error
"""
RUN = """
import sys
from typer.testing import CliRunner
from pellucid.cli import app
for command in ("check", "peak", "report"):
    done = CliRunner().invoke(app, [command, sys.argv[1]])
    assert done.exit_code == 0, repr(done.exception)
"""


@pytest.fixture
def study(tmp_path) -> Path:
    """A folder with one recording, whose largest torque is 2.5 N m."""
    folder = tmp_path / "arm"
    folder.mkdir()
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    t = np.arange(0.0, 10.0, 0.01)
    columns = np.column_stack([t, np.sin(t), 2.5 * np.sin(0.7 * t)])
    np.savetxt(folder / "one.csv", columns, delimiter=",", header="t,q,tau", comments="")
    return folder


def changed_files(package: Path, before: dict[Path, int]) -> set[str]:
    """Return the files of a package that are new or written again."""
    files = (path for path in package.rglob("*") if path.is_file())
    return {path.relative_to(package).as_posix() for path in files if before.get(path) != path.stat().st_mtime_ns}


@pytest.mark.slow
def test_a_domain_is_one_folder(tmp_path, study):
    package = copied_package(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in package.rglob("*") if path.is_file()}
    own = {"__init__.py": '"""The grip of a hand."""\n', "domain.py": DOMAIN, "peaks_file.py": EXPORTER,
           "peak/__init__.py": "", "peak/peak.py": PROCEDURE}  # fmt: skip
    for name, text in own.items():
        path = package / "grip" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert changed_files(package, before) == {f"grip/{name}" for name in own}
    done = run_copied(package.parent, RUN + EXPORTED, study)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["one"] == pytest.approx(2.5, rel=1e-3)
    assert "The largest torque is 2.5" in (study / "report" / "index.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_an_exporter_is_one_file_and_a_line_of_its_domain(tmp_path, study):
    package = copied_package(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in package.rglob("*") if path.is_file()}
    (package / "people" / "peaks_file.py").write_text(EXPORTER, encoding="utf-8")
    domain = package / "people" / "domain.py"
    line = 'EXPORTER_CLASSES = ("peaks_file:PeaksExporter",)\n'
    domain.write_text(domain.read_text(encoding="utf-8") + line, encoding="utf-8")
    assert changed_files(package, before) == {"people/peaks_file.py", "people/domain.py"}
    text = (study / "study.toml").read_text(encoding="utf-8")
    text = text.replace('[peak]\nchannel = "torque"', '[rig.drive]\nkind = "torque"')
    (study / "study.toml").write_text(text, encoding="utf-8")
    done = run_copied(package.parent, EXPORTED, study)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["one"] == pytest.approx(2.5, rel=1e-3)
