"""Words of others are words, in LaTeX, a spreadsheet, a figure, a page and a terminal; a muscle of a file is one."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure
from research.evidence._mutations import damaged
from research.evidence.files import MUSCLE_FILES

from pellucid._errors import PellucidError, RecordingError
from pellucid._given import csv_cell, visible_text
from pellucid.emg.study.emg_torque.study_muscles import read_muscle_constants
from pellucid.files import Channel, write_csv
from pellucid.people.study.paper import csv_text, latex
from pellucid.study.drawing.drawing import Drawing, draw
from pellucid.study.pages.page import Page, Section, write_page
from pellucid.study.procedures.result import FigureTable

EACH = int(os.environ.get("FUZZ", "300"))
HOSTILE = (
    "^^5cinput{/etc/passwd}",
    r"\write18{ls}",
    "$\\frac{",
    "{}",
    "a~b",
    "=cmd|' /C calc'!A0",
    "+1+1",
    "@SUM(A1)",
    "-2+3",
)


@pytest.mark.parametrize("word", HOSTILE)
def test_a_table_for_latex_holds_no_command(word):
    made = latex(FigureTable(word, ("condition", "n"), ((word, 3),)))
    (row,) = [line for line in made.splitlines() if line.endswith(r" & 3 \\")]
    cell = row.removesuffix(r" & 3 \\")
    for known in (r"\textbackslash{}", r"\textasciicircum{}", r"\textasciitilde{}", r"\$", r"\{", r"\}", r"\_"):
        cell = cell.replace(known, "")
    assert not set(cell) & set("\\^~${}")


@pytest.mark.parametrize("word", HOSTILE)
def test_a_cell_of_a_table_is_no_formula(word):
    cell = csv_text((word,), [(word,)]).splitlines()[1].strip('"')
    assert cell[0] not in "=+@"
    assert word in cell


@pytest.mark.parametrize("figure", ["-0.31", "-0.31 to 0.22", "-1e-5", "+3", "−3", "12 %", ""])
def test_a_figure_in_a_table_stays_one(figure):
    assert csv_cell(figure) == figure


def test_a_dollar_in_a_name_is_a_dollar(tmp_path):
    def make():
        figure = Figure(figsize=(3, 2), layout="constrained")
        figure.subplots().set_title(r"$\frac{1}{$ <script>alert(1)</script> $x^2$")
        return Drawing("word", figure, '"><script>alert(1)</script>')

    page = write_page(tmp_path, Page("A", "B", "<script>", sections=(Section("s", "S", drawings=(draw(make),)),)))
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"<script>\s*alert", text)
    assert "$x^2$" in text


def test_a_channel_that_would_be_a_formula_is_not_written(tmp_path):
    time = Channel("time", np.arange(3.0), "s", "t")
    with pytest.raises(RecordingError, match="found the channel '=1', expected a name that a table can hold"):
        write_csv(tmp_path / "a.csv", {"time": time, "=1": Channel("=1", np.arange(3.0), "1", "a")})


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_a_terminal_says_what_it_can(tmp_path, encoding):
    code = (
        "from pellucid import cli\nfrom pellucid.study import terminal\nfrom rich.console import Console\n"
        "terminal.replace_unprintable_characters()\nConsole().print('0.05 ± 0.01 kg·m² 1.3×10⁻¹² Ж')\ncli.main()"
    )
    environment = os.environ | {"PYTHONIOENCODING": encoding, "COLUMNS": "80"}
    run = subprocess.run(
        [sys.executable, "-c", code, "check", tmp_path / "µ\u202e\x1b[2J"], capture_output=True, env=environment
    )
    assert run.returncode == 2
    assert b"Traceback" not in run.stderr
    assert b"\x1b[2J" not in run.stderr
    assert b"no such file" in run.stderr
    said = run.stdout.decode(encoding).strip()
    known = {"ascii": "0.05 +- 0.01 kg*m^2 1.3x10^-12 ?", "cp1252": "0.05 ± 0.01 kg·m² 1.3×10^-12 ?"}
    assert said == known.get(encoding, "0.05 ± 0.01 kg·m² 1.3×10⁻¹² Ж")


def test_what_cannot_be_seen_is_shown():
    assert visible_text("a\x1b[2J\u202eb\tc\n") == "a\ufffd[2J\ufffdb\tc\n"


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("leg.osim", ">5148.7<", ">-5148.7<", "vaslat_l, largest_force: found -5148.7, expected 0.001 to 100000"),
        ("leg.osim", ">0.0946<", ">-0.1<", "optimal_fibre_length: found -0.1"),
        ("leg.osim", ">0.21<", ">1e30<", "tendon_slack_length: found 1e\\+30"),
        ("leg.osim", ">0.25<", ">-0.25<", "pennation: found -0.25"),
        ("leg.osim", '"vaslat_l"', '"../vaslat"', "found the muscle '../vaslat', expected letters"),
        ("leg.xml", ">1871<", ">-1<", "vaslat_r, largest_force: found -1"),
        ("leg.xml", ">1.3<", ">-1.3<", "strengthCoefficient: found -1.3"),
        ("leg.xml", ">0.5 1 1.5<", ">0.5 1 0.5<", "<xPoints> that increase"),
        ("leg.xml", "<subject>", '<!DOCTYPE a [<!ENTITY b "c">]><subject>', "found a document type, expected none"),
        ("leg.xml", "<mtuSet>", "<a>" * 200 + "<mtuSet>", "within each other, expected at most"),
    ],
)
def test_a_muscle_is_one(tmp_path, file, old, new, message):
    path = tmp_path / file
    assert old in MUSCLE_FILES[file]
    path.write_text(MUSCLE_FILES[file])
    assert read_muscle_constants(path)
    path.write_text(MUSCLE_FILES[file].replace(old, new))
    with pytest.raises(RecordingError, match=message):
        read_muscle_constants(path)


@pytest.mark.parametrize("file", MUSCLE_FILES)
def test_every_model_of_muscles_is_answered(tmp_path, file):
    path, read = tmp_path / file, 0
    for seed in range(EACH // 2):
        path.write_bytes(damaged(MUSCLE_FILES[file].encode(), np.random.default_rng([seed, 5])))
        try:
            read += all(m.largest_force > 0.0 for m in read_muscle_constants(path).values())
        except PellucidError:
            continue
    assert 0 < read < EACH // 2
