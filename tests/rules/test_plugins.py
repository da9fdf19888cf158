"""Another package adds readers, estimators, procedures, papers and commands by entry points; faults of it are named."""

import re
import shutil
import sys
import tomllib
from pathlib import Path

import pytest
from copied_package import ROOT, copied_package, run_copied
from test_new_rig import CONSTANTS, PENDULUM

from pellucid._errors import PluginError
from pellucid._plugins import PLUGIN_GROUPS, load_plugins

READER = '''"""Lines of the angle and the torque, one sample each, after the rate in the first."""

import numpy as np

from pellucid.files.readers import Columns

ENDINGS = (".acme",)


def read(path):
    """Columns t, q and tau, each shape (n,)."""
    rate, *rows = path.read_text(encoding="utf-8").splitlines()
    values = np.array([row.split(";") for row in rows], float)
    return Columns(path, {"t": np.arange(len(values)) / float(rate), "q": values[:, 0], "tau": values[:, 1]})
'''
READER_APART = READER.replace('".acme"', '".acmez"') + '\n\nAPART = ("json",)\n'
ESTIMATOR = '''"""The mean torque, as scikit-learn's own baseline has it."""

from pellucid.emg.estimators.families.family import Family


def mean_torque(settings, seen):
    """The mean of the torques that were seen."""
    from sklearn.dummy import DummyRegressor

    return DummyRegressor()


FAMILIES = {"acme_mean": Family("the mean torque", mean_torque)}
'''
PROCEDURE_ENTRY = '''"""What this package adds to the procedures."""

from pellucid.study.procedures.command import Command
from pellucid.study.procedures.procedure import ProcedureEntry

PEAK = ProcedureEntry(
    package=__package__,
    name="peak",
    command="peak",
    order=126,
    table_class="peak:PeakTable",
    find_faults="peak:faults",
    find="peak:find_peaks",
    draw="peak:page",
    brings=Command("peak", "The largest torque of every recording."),
)
'''
PROCEDURE = '''"""Find the largest torque of every recording."""

import numpy as np

from pellucid.study.procedures.procedure import quiet
from pellucid.study.procedures.result import FigureTable, Result
from pellucid.study.results import ResultRow
from pellucid.study.study_fields import ProcedureTable


class PeakTable(ProcedureTable):
    """Settings of the largest torque: ``[peak]``, which has none."""


def faults(study):
    return []


def find_peaks(study, tell=quiet):
    peaks = {r.name: float(np.max(np.abs(r["torque"]))) for r in study.recordings()}
    rows = tuple(ResultRow(f"{study.name}.{k}.peak", v, "N*m", "peak", "fitted", None) for k, v in peaks.items())
    tables = (FigureTable("Peaks", ("Recording", "torque [N m]"), tuple(peaks.items())),)
    return Result(study=study.name, headline="Peaks.", tables=tables, verdicts=(), rows=rows, cards={}, checksums={})


def page(study, found):
    from pellucid.study.procedures.study_page import study_page

    return study_page(f"{found.study}: peaks", found.headline, (), (), found.verdicts)
'''
CLASS_FOLDER = '''"""The number of recordings, by a subclass of `Procedure`."""

from pellucid.study.procedures.command import Command

PROCEDURE_ORDER = 127
PROCEDURE_COMMAND = Command("count", "The number of recordings.")
'''
CLASS = '''"""Count recordings."""

from pellucid.study.procedures.procedure import Procedure, quiet
from pellucid.study.procedures.result import Result
from pellucid.study.study_fields import ProcedureTable


class CountTable(ProcedureTable):
    """Settings of the number of recordings: ``[count]``, which has none."""


class CountProcedure(Procedure[CountTable, Result]):
    """The number of recordings."""

    name, command = "count", "count"
    table = CountTable

    def faults(self, study, table):
        return []

    def run(self, study, table, tell=quiet):
        headline = f"{len(study.recordings())} recording."
        return Result(study=study.name, headline=headline, tables=(), verdicts=(), rows=(), cards={}, checksums={})

    def page(self, study, found):
        from pellucid.study.procedures.study_page import study_page

        return study_page(f"{found.study}: count", found.headline, (), (), found.verdicts)
'''
PRINTED = """
name = "tides"
title = "A pendulum of one metre"
authors = "N. N."
journal = "Nowhere"
year = 2024
[values]
period = { value = 2.01, unit = "s", where = "Section 1" }
[tables]
"""
PAPER = '''"""A pendulum's period, again."""

from pellucid_lab.papers.figure import figure
from pellucid_lab.papers.paper import Paper


class Tides(Paper):
    """A pendulum of one metre."""

    main = ("tides.",)

    def figures(self, tell):
        yield figure("tides", "period", "Period", "s", 2.006, self.printed.values["period"])
'''
COMMANDS = '''"""A command of this package."""

import typer


def greet() -> None:
    """Say where this comes from."""
    typer.echo("from another package")


def add_commands(app):
    """Add the command."""
    app.command("greet")(greet)
'''
RIG = (
    PENDULUM.replace("from ... import", "from pellucid import")
    .replace("from ...", "from pellucid.")
    .replace("from ..", "from pellucid_lab.")
)
FILES = {
    "acme/__init__.py": "",
    "acme/log.py": READER,
    "acme/log_apart.py": READER_APART,
    "acme/mean.py": ESTIMATOR,
    "acme/peak_entry.py": PROCEDURE_ENTRY,
    "acme/peak.py": PROCEDURE,
    "acme/count/__init__.py": CLASS_FOLDER,
    "acme/count/procedure.py": CLASS,
    "acme/papers/__init__.py": "",
    "acme/papers/tides/printed.toml": PRINTED,
    "acme/papers/tides/paper.py": PAPER,
    "acme/commands.py": COMMANDS,
    "acme/lab/__init__.py": "",
    "acme/lab/pendulum/__init__.py": "",
    "acme/lab/pendulum/rig.py": RIG,
    "acme/lab/rigs/pendulum.toml": CONSTANTS,
}
ENTRIES = {
    "pellucid.readers": "acme = acme.log\nacmez = acme.log_apart",
    "pellucid.estimators": "acme = acme.mean",
    "pellucid.procedures": "acme = acme.peak_entry:PEAK\nacme_count = acme.count",
    "pellucid.papers": "acme = acme.papers",
    "pellucid.commands": "acme = acme.commands:add_commands",
    "pellucid.rigs": "acme = acme.lab",
}
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
[count]
[[recordings]]
name = "one"
file = "one.acme"
"""
SCRIPT = """
import sys
from pathlib import Path
import numpy as np
from typer.testing import CliRunner
import pellucid as pl
from pellucid.cli import app
from pellucid.study.procedures.run import run

study = pl.open(sys.argv[1])
print(len(pl.read(study.folder / "one.acme")["tau"]), len(pl.read(study.folder / "one.acmez")["tau"]))
print(run(study, "peak").rows[0].value)
X = np.linspace(0.0, 1.0, 50)[:, None]
print(pl.TorqueRegressor("acme_mean").fit(X, X[:, 0]).predict(X)[0])
print(pl.reproduce("tides", sys.argv[2]).lines[0])
rig = sys.argv[2] + "-rig"
ran = (["peak", sys.argv[1]], ["count", sys.argv[1]])
for command in (["greet"], *ran, ["init", rig, "--rig", "pendulum"], ["simulate", rig]):
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, repr(result.exception)
    print(result.stdout.strip().splitlines()[command in ran])
"""


def write_distribution(folder: Path, entries: dict[str, str], files: dict[str, str]) -> Path:
    """An installed distribution: modules, and the metadata that names its entry points."""
    for file, text in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8")
    metadata = folder / "acme-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n", encoding="utf-8")
    text = "\n".join(f"[{group}]\n{lines}" for group, lines in entries.items())
    (metadata / "entry_points.txt").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def fresh_plugins():
    """Entry points are looked up again, before and after."""
    load_plugins.cache_clear()
    yield
    load_plugins.cache_clear()


@pytest.mark.slow
def test_a_package_adds_one_of_each_without_touching_pellucid(tmp_path):
    write_distribution(tmp_path / "site", ENTRIES, FILES)
    study = tmp_path / "arm"
    study.mkdir()
    (study / "study.toml").write_text(STUDY, encoding="utf-8")
    rows = "\n".join(f"{0.01 * i};{-0.1 * i}" for i in range(200))
    for ending in (".acme", ".acmez"):
        (study / f"one{ending}").write_text(f"100\n{rows}", encoding="utf-8")
    package = copied_package(tmp_path)
    path = f"{package.parent}:{tmp_path / 'site'}"
    done = run_copied(path, SCRIPT, study, tmp_path / "out")
    assert done.returncode == 0, done.stderr
    numbers, peak, mean, paper, greeting, table, count, started, simulated = done.stdout.splitlines()
    assert numbers == "200 200"
    assert float(peak) == pytest.approx(19.9)
    assert float(mean) == pytest.approx(0.5)
    assert paper == "Period: 2.006 s, published 2.01"
    assert greeting == "from another package"
    assert table == "Yes. Peaks."
    assert count == "Yes. 1 recording."
    assert "the rig pendulum" in started
    assert "2 recordings" in simulated


@pytest.mark.parametrize(
    ("reader", "said"),
    [
        (None, "plug-in acme of acme (pellucid.readers): found ModuleNotFound"),
        ("1 / 0", "found ZeroDivisionError"),
        ("ENDINGS = ('.x',)", "found no read, expected a module"),
        (
            "ENDINGS = ('.csv',)\ndef read(path): ...",
            'acme.bad: found the ending ".csv", which pellucid.files.readers.csv reads too',
        ),
    ],
)
def test_a_package_that_cannot_be_used_is_named(tmp_path, monkeypatch, fresh_plugins, reader, said):
    from pellucid.files.readers.read import readers_by_ending

    files = {"acme/__init__.py": ""} | ({} if reader is None else {"acme/bad.py": reader})
    site = write_distribution(tmp_path, {"pellucid.readers": "acme = acme.bad"}, files)
    monkeypatch.syspath_prepend(site)
    readers_by_ending.cache_clear()
    try:
        with pytest.raises(PluginError, match=re.escape(said)):
            readers_by_ending()
    finally:
        readers_by_ending.cache_clear()
        for name in ("acme.bad", "acme"):
            sys.modules.pop(name, None)


WITHOUT_LAB = """
import pellucid._plugins as plugins
original = plugins._entries
plugins._entries = lambda path: [entry for entry in original(path) if entry.distribution != "pellucid-lab"]
"""
BASE_ALONE = (
    WITHOUT_LAB
    + """
import os, sys
copied = os.environ["PYTHONPATH"]
sys.path[:] = [p for p in sys.path if p == copied or not os.path.isdir(os.path.join(p, "pellucid_lab"))]
import pellucid as pl
from pellucid import cli
for name in ("demo", "predict", "reproduce", "simulate"):
    try:
        getattr(pl, name)
    except pl.PellucidError as error:
        print(error)
for arguments in (["demo"], ["init", "x", "--rig", "bench-joint"], ["--help"], ["--version"]):
    sys.argv = ["pellucid", *arguments]
    try:
        cli.main()
    except SystemExit as stop:
        print(arguments[0], stop.code)
"""
)


@pytest.mark.slow
def test_the_base_alone_says_how_to_get_the_lab(tmp_path):
    package = copied_package(tmp_path)
    shutil.rmtree(package.parent / "pellucid_lab")
    done = run_copied(package.parent, BASE_ALONE)
    assert done.returncode == 0, done.stderr
    told = [line for line in (done.stdout + done.stderr).splitlines() if "pellucid-lab" in line]
    assert len(told) == 6, done.stdout + done.stderr
    assert all("pip install ./lab" in line and "pellucid_lab-*.whl" in line for line in told)
    for line in ("demo 2", "init 2", "--help 0", "version 0"):
        assert line in done.stdout
    assert "simulate" not in done.stdout.partition("Commands:")[2]


def test_every_group_that_the_lab_brings_is_a_group():
    text = (ROOT / "lab" / "pyproject.toml").read_text(encoding="utf-8")
    assert set(tomllib.loads(text)["project"]["entry-points"]) <= set(PLUGIN_GROUPS)
