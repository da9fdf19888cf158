"""A test in real time is run again where the machine paused its engine, and for no other reason."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from real_time import MAX_RUNS

TESTS = Path(__file__).parents[1]

ENGINE_TESTS = """
import os, signal, time
import pytest
from real_time import held
from test_live_engine import elbow, rest, run_law

pytestmark = pytest.mark.real_time
runs = {}

def pause(engine):
    process = engine.processes["engine"]
    os.kill(process, signal.SIGSTOP)
    time.sleep(0.15)
    os.kill(process, signal.SIGCONT)

def hold(engine):
    with held(engine.processes["engine"]):
        time.sleep(0.15)

@pytest.mark.parametrize("name, disturb, count", [
    ("paused once", pause, 1), ("paused always", pause, 9), ("held", hold, 9), ("wrong", None, 0), ("right", None, 0),
])
def test_law(elbow, tmp_path, name, disturb, count):
    from pellucid.live.engine import LiveEngine
    assert not list(tmp_path.iterdir())
    runs[name] = runs.get(name, 0) + 1
    with LiveEngine.start(elbow, tmp_path, streams=False, recorder=False, ordinary=True) as engine:
        run_law(engine)
        if runs[name] <= count:
            disturb(engine)
        rest(engine, 0.1)
        print(f"<{name}: run {runs[name]}>")
        assert engine.status().state.name == "running"
        assert name != "wrong"
"""


@pytest.mark.real_time
def test_only_a_test_whose_law_a_pause_stopped_is_run_again(tmp_path):
    (tmp_path / "test_engine.py").write_text(ENGINE_TESTS, encoding="utf-8")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = real_time\n", encoding="utf-8")
    words = [sys.executable, "-m", "pytest", "-rA", "-p", "no:cacheprovider", "-p", "real_time", "test_engine.py"]
    path = os.pathsep.join([str(TESTS), str(TESTS / "unit")])
    found = subprocess.run(words, cwd=tmp_path, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)
    said = found.stdout
    runs = {name: int(run) for name, run in re.findall(r"<([a-z ]+): run (\d)>", said)}
    assert runs == {"paused once": 2, "paused always": MAX_RUNS, "held": 1, "wrong": 1, "right": 1}, said
    passed = re.findall(r"^PASSED .*\[([a-z ]+)-", said, flags=re.MULTILINE)
    failed = re.findall(r"^FAILED .*\[([a-z ]+)-", said, flags=re.MULTILINE)
    assert (sorted(passed), sorted(failed)) == (["paused once", "right"], ["held", "paused always", "wrong"]), said
    told = re.findall(r"\[([a-z ]+)-.*\] (.*): the machine paused its engine \((.*)\)$", said, flags=re.MULTILINE)
    assert {name: (ended, pauses.count(" ms")) for name, ended, pauses in told} == {
        "paused once": ("passed in another run", 1), "paused always": (f"failed in {MAX_RUNS} runs", MAX_RUNS),
    }  # fmt: skip


def test_files_that_start_an_engine_are_marked():
    starts = re.compile(r"\b(LiveEngine\.start|live_rig|run_session\.live)\(")
    texts = {path: path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py")}
    found = {path.name for path, text in texts.items() if starts.search(text)}
    assert found >= {"test_live_engine.py", "test_live_faults.py", "test_live_pages.py"}
    assert found == {path.name for path, text in texts.items() if "mark.real_time" in text}
