"""Every parser takes time and memory in proportion to its file, whatever stands in it.

FUZZ_BYTES=N says how large the files are. `tests/property/test_damaged_recordings.py` looks for crashes.
"""

import json
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from time import process_time

import pytest

from pellucid._errors import PellucidError, StudyError
from pellucid._given import MAX_KEY_PARTS, parse_toml
from pellucid.files.readers.read import read_columns

FILE_BYTES = int(os.environ.get("FUZZ_BYTES", "40000"))

MAX_SECONDS = 3.0
"""Processor time for one file. Without bounds, files of 40 kB took from 10 s to hours."""

MAX_GROWN_MB = 300.0
"""Memory for one file, of which the first one needs some for libraries."""

MAX_MESSAGE_LENGTH = 5000
"""Characters of a message, which names what was found and does not repeat it."""


@pytest.mark.parametrize(
    ("head", "cell"), [("t,q", " " * 30_000 + "x"), ("t,q", "\t" * 30_000 + "x"), ("# " + "a" * 30_000 + "\nt,q", "1")]
)
def test_a_long_cell_or_comment_takes_little_time(tmp_path, head, cell):
    rows = [f"{0.01 * i:.2f},{i}" for i in range(30)]
    (tmp_path / "one.csv").write_text("\n".join([head, *rows[:20], f"0.2,{cell}", *rows[20:], ""]), encoding="utf-8")
    began = process_time()
    with suppress(PellucidError):
        read_columns(tmp_path / "one.csv")
    assert process_time() - began < MAX_SECONDS


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
def test_small_files_take_little_time_and_memory():
    program = Path(__file__).with_name("bounded_run.py")
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, str(program), str(FILE_BYTES)], capture_output=True, text=True, env=environment, timeout=1200
    )
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    last = rows[-1][0] if rows else "the first file"
    assert done.returncode == 0, f"ended after {last}: {done.stderr[-2000:]}"
    assert len(rows) > 1000
    wrong = [
        row for row in rows
        if row[1] > MAX_SECONDS or row[2] > MAX_GROWN_MB or row[3] > MAX_MESSAGE_LENGTH or row[4]
    ]  # fmt: skip
    assert not wrong


KEY = ".".join(["a"] * (MAX_KEY_PARTS + 1))
QUOTED = ".".join(['"="'] * (MAX_KEY_PARTS + 1))


@pytest.mark.parametrize(
    "text",
    [
        f"{KEY} = 1",
        f"[{KEY}]",
        f"[[{KEY}]]",
        f"b = {{ {KEY} = 1 }}",
        f"{QUOTED} = 1",
        KEY.replace(".", " . ") + " = 1",
        KEY.replace("a.", "'a'.", 20) + " = 1",
        f'b = {{ c = """\n\' """, {KEY} = \'\' }}',
    ],
)
def test_a_key_of_many_parts_is_refused_in_every_spelling(text):
    with pytest.raises(StudyError, match=r"here, line \d: found a dotted key of more than 40 parts"):
        parse_toml(text, "here")


@pytest.mark.parametrize(
    "text",
    [
        "a = [" + ", ".join(["0.125"] * 500) + "]",
        "a = '" + "One sentence after another. " * 100 + "'",
        "# " + "." * 300,
        "a = ['" + "', '".join(f"recordings/file_{i}.csv" for i in range(100)) + "']",
        f"{KEY[:-2]} = 1",
    ],
)
def test_other_lines_with_many_dots_are_read(text):
    assert isinstance(parse_toml(text, "here"), dict)
