"""What a command leaves is whole or as it was, whatever ends it; commands that run at once lose nothing."""

import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import pellucid
import pellucid_lab
from pellucid._errors import PellucidError
from pellucid.study import kept as lock
from pellucid.study.drawing.drawing import Drawing
from pellucid.study.pages.page import Page, Section, write_page
from pellucid.study.results import ResultRow, read_rows, write_rows

SOURCES = Path(pellucid.__file__).parent
LAB_SOURCES = Path(pellucid_lab.__file__).parent
WRITES = re.compile(
    r"""savefig\(|\.write_text\(|\.write_bytes\(|savetxt\(|open\([^)]*["'][wax]b?\+?["']"""
    r"""|os\.open\((?!os\.devnull)[^)]*O_(?:WRONLY|RDWR)"""
)


def drawn(word):
    """Small as SVG, larger as PDF, which holds the letters; a page is larger still."""
    figure = Figure(figsize=(3, 2))
    figure.text(0.1, 0.5, word)
    return Drawing("word", figure, "A word.")


@pytest.fixture
def full_disk():
    """No file may grow beyond so many bytes: as on a full disk, a write fails in its midst."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("last", ["word.svg", "word.pdf", "index.html"])
def test_a_full_disk_leaves_figures_and_pages_as_they_were(tmp_path, full_disk, last):
    def page(word):
        return Page("A", "B", "C", sections=(Section("s", "S", drawings=(drawn(word),)),))

    write_page(tmp_path, page("before"), with_pdf=True)
    before = content(tmp_path)
    assert {"index.html", "word.svg", "word.pdf"} == set(before)
    assert before["word.pdf"].rstrip().endswith(b"%%EOF")
    sizes = [len(before[name]) for name in ("word.svg", "word.pdf", "index.html")]
    assert sizes == sorted(sizes)
    full_disk(len(before[last]) * 9 // 10)
    with pytest.raises(OSError, match="File too large"):
        write_page(tmp_path, page("after "), with_pdf=True)
    after = content(tmp_path)
    assert set(after) == set(before)  # nothing half-written beside them either
    whole = {"word.svg": drawn("after ").svg.encode()}
    assert all(after[name] in (before[name], whole.get(name)) for name in ("index.html", "word.svg"))
    assert after["word.pdf"] == before["word.pdf"] or after["word.pdf"].rstrip().endswith(b"%%EOF")


def test_nothing_is_written_but_whole():
    """Only `_atomic.py` opens a file for writing; what goes into a scratch folder is nobody's result."""
    scratch = {"_atomic.py": 1, "study/exporter.py": 1, "study/datasets/init.py": 1, "controllers/export/fmu.py": 1,
               "pellucid_lab/ranking/foreign_cost.py": 1}  # fmt: skip
    # A live session's log is appended to while its process runs; its region and rings are memory that
    # processes share, of a fixed size and written in place. None is read as a result. A recording is appended to, and
    # readable whenever its writer ends.
    live = {"live/engine.py": 1, "live/shared_memory.py": 2, "files/xdf_writer.py": 2}
    found = {}
    for path in sorted([*SOURCES.rglob("*.py"), *LAB_SOURCES.rglob("*.py")]):
        text = re.sub(r"^\s*(>>>|\.\.\.) .*$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
        into_memory = len(re.findall(r"savefig\(\s*(buffer|printed)\b", text))
        count = len(WRITES.findall(text)) - into_memory
        if count:
            root = SOURCES if path.is_relative_to(SOURCES) else LAB_SOURCES.parent
            found[str(path.relative_to(root))] = count
    assert found == scratch | live


WRITER = """
import sys
from pellucid.study.results import ResultRow, write_rows
path, command = sys.argv[1:]
sys.stdin.readline()
for i in range(10):
    write_rows(path, command, [ResultRow(f"bench.{command}.{n}", i, "1", command, "fitted") for n in range(20)])
"""


def test_commands_at_once_lose_no_row(tmp_path):
    path, commands = tmp_path / "results.json", ("identify", "calibrate", "assess", "export")
    running = [
        subprocess.Popen([sys.executable, "-c", WRITER, str(path), c], stdin=subprocess.PIPE, text=True)
        for c in commands
    ]
    for process in running:
        process.stdin.write("go\n")
        process.stdin.flush()
    assert [process.wait(60) for process in running] == [0, 0, 0, 0]
    for process in running:
        process.stdin.close()
    rows = {(row.id, row.value) for row in read_rows(path)}
    assert rows == {(f"bench.{c}.{n}", 9) for c in commands for n in range(20)}


def test_who_waits_too_long_is_told_why(tmp_path, monkeypatch):
    path = tmp_path / "results.json"
    row = ResultRow("bench.a", 1, "1", "identify", "fitted")
    write_rows(path, "identify", [row])
    before = path.read_bytes()
    monkeypatch.setattr(lock, "MAX_WAIT_S", 0.05)
    with lock.hold_lock(path), pytest.raises(PellucidError, match=r"results\.json: found it being written by another"):
        write_rows(path, "export", [])
    assert path.read_bytes() == before
    write_rows(path, "identify", [row])


@pytest.mark.parametrize("there", [True, False])
def test_a_lock_that_is_a_link_is_refused_and_its_target_stays(tmp_path, there):
    path, target = tmp_path / "results.json", tmp_path / "precious.txt"
    if there:
        target.write_text("precious")
    (tmp_path / ".results.json.lock").symlink_to(target)
    with pytest.raises(PellucidError, match=r"\.results\.json\.lock: found a symbolic link, expected the lock file"):
        write_rows(path, "identify", [])
    assert target.exists() == there
    assert not there or target.read_text() == "precious"
    (tmp_path / ".results.json.lock").unlink()
    (tmp_path / ".results.json.lock").mkdir()
    with pytest.raises(PellucidError, match="found no regular file"):
        write_rows(path, "identify", [])


HOLDER = """
import sys, time
from pellucid.study.kept import hold_lock
with hold_lock(sys.argv[1]):
    print(1, flush=True)
    time.sleep(60)
"""


def test_who_is_killed_gives_the_lock_back(tmp_path):
    path = tmp_path / "results.json"
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "1\n"
    with pytest.raises(PellucidError, match="found it being written"), lock.hold_lock(path, patience=0.05):
        pass
    process.kill()
    process.wait()
    process.stdout.close()
    start = time.monotonic()
    write_rows(path, "identify", [ResultRow("bench.a", 1, "1", "identify", "fitted")])
    assert time.monotonic() - start < 5.0
    assert len(read_rows(path)) == 1
