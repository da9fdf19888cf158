"""A new index is one entry of one file: a copy of the package with it shows it in table, page, rows and certificate."""

import json
from pathlib import Path

import pytest
from copied_package import copied_package, run_copied

TESTS = Path(__file__).parents[1]
ENTRY = """ACCELERATION_SIZE = Index(
    name="acceleration_size", words="Average acceleration", short="Acc. size", unit="rad/s^2",
    worse=Worse.IF_MORE, percent_of=PercentOf.THE_CONTROL, of="acceleration_size",
    of_movement=lambda motion, movement: float(abs(motion.acceleration[movement.first : movement.last + 1]).mean()),
    paragraph_place=8, panel_place=14, tile=Tile("Acceleration"), has_table=True, tries_rules=True, is_planned=True,
)  # fmt: skip

# A new index comes last"""
LAST = "NORMALISED_JERK,\n    )"
SCRIPT = """
import json, sys
from pathlib import Path
sys.path += [f"{sys.argv[1]}", f"{sys.argv[1]}/unit"]
import made_pointing
from index_battery import faults
from typer.testing import CliRunner
from pellucid.cli import app
more = '[assessment.margins]\\nacceleration_size = "200 %"\\nvmax = "60 %"'
study = made_pointing.study(Path(sys.argv[2]), participants=5, conditions=("Ctrl", "FC"), more=more)
said = {}
for command, *more in (["assess", "-v"], ["report"]):
    done = CliRunner().invoke(app, [command, str(study.folder), *more])
    if done.exit_code and not (command == "assess" and "cannot say" in done.output):  # of five people nobody can say
        raise done.exception
    said[command] = done.output
print(json.dumps({"terminal": said["assess"], "faults": faults()}))
"""


@pytest.mark.slow
def test_an_index_is_one_entry(tmp_path):
    package = copied_package(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in package.rglob("*") if path.is_file()}
    catalogue = package / "people" / "indices.py"
    text = catalogue.read_text(encoding="utf-8")
    for old, new in (("# A new index comes last", ENTRY), (LAST, LAST.replace(",", ", ACCELERATION_SIZE,"))):
        assert text.count(old) == 1
        text = text.replace(old, new)
    catalogue.write_text(text, encoding="utf-8")
    touched = [path for path in package.rglob("*") if path.is_file() and before.get(path) != path.stat().st_mtime_ns]
    assert touched == [catalogue]
    folder = tmp_path / "study"
    done = run_copied(package.parent, SCRIPT, TESTS, folder)
    assert done.returncode == 0, done.stdout + done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["faults"] == []
    figures = json.loads((folder / "results.json").read_text(encoding="utf-8"))["figures"]
    rows = {row["id"].partition(".")[2]: row for row in figures}
    assert rows["assess.acceleration_size.ctrl.mean"]["value"] > 0.0
    assert rows["transparency.acceleration_size.fc"]["unit"] == "%"
    assert "assess.needed.acceleration_size.10_percent" in rows
    assert "assess.sensitivity.3hz.acceleration_size.fc" in rows
    assert rows["certificate.fc.acceleration_size.high"]["value"] < 200.0
    assert "Average acceleration" in said["terminal"]
    page = (folder / "report" / "index.html").read_text(encoding="utf-8")
    for shown in ("Acceleration, FC", "Average acceleration", "Mean average acceleration was", "Acc. size"):
        assert shown in page, shown
    for table, line in (("participants.csv", -1), ("movements.csv", 0)):
        assert "acceleration_size" in (folder / "tables" / table).read_text(encoding="utf-8").splitlines()[line]
