"""What the README and CONTRIBUTING say is so: commands, files, the example study, and names."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import pellucid
from pellucid.procedures.run import check, identify

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {name: (ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "CONTRIBUTING.md")}


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    targets = re.findall(r"\]\(([^)#]+)\)", PAGES[page])
    assert targets
    missing = [t for t in targets if not t.startswith("http") and not (ROOT / t).exists()]
    assert not missing, missing


@pytest.mark.parametrize("page", PAGES)
def test_files_and_folders_it_names_exist(page):
    named = re.findall(
        r"`((?:tests|docs|include|src|datasets|recordings|report|models|pellucid)/[\w./]*)`", PAGES[page]
    )
    found = [n for n in named if not n.endswith("my-joint/")]
    missing = [
        n for n in found if not any((base / n).exists() for base in (ROOT, ROOT / "src", ROOT / "src" / "pellucid"))
    ]
    assert not missing, missing


def test_commands_exist():
    from pellucid.cli import app

    known = {c.name or c.callback.__name__ for c in app.registered_commands} | {"datasets"}
    used = set(
        re.findall(r"pellucid (\w+)", "\n".join(re.findall(r"`[^`\n]+`|^\.venv.*$", README, flags=re.MULTILINE)))
    )
    assert used >= {"init", "check", "identify", "report", "compare"}
    assert used <= known
    targets = set(re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert set(re.findall(r"\bmake (demo|test|bench)\b", "".join(PAGES.values()))) <= targets


def test_the_apt_line_installs_what_is_needed():
    line = next(b for b in blocks("") if "apt install" in b)
    assert set(shlex.split(line)[3:]) == {"git", "make", "g++", "python3", "python3-venv", "python3-dev"}


def test_the_example_study_works(tmp_path):
    """The README's study.toml, with recordings of a made-up elbow in the columns and units it names."""
    folder = tmp_path / "my-joint"
    (folder / "recordings").mkdir(parents=True)
    (folder / "study.toml").write_text(blocks("toml")[0], encoding="utf-8")
    rng = np.random.default_rng(5)
    for name in ("sweep", "another_day"):
        t = np.arange(6000) / 200.0
        w = 2.0 * np.pi * np.array([0.23, 0.61, 1.3])[:, None]
        phase = rng.uniform(0.0, 2.0 * np.pi, 3)[:, None]
        a = np.array([0.5, 0.25, 0.08])[:, None]
        q, v, acc = (
            (a * s).sum(0) for s in (np.sin(w * t + phase), w * np.cos(w * t + phase), -(w**2) * np.sin(w * t + phase))
        )
        torque = 0.08 * acc + 3.0 * np.sin(q) + 0.2 * v + 0.4 * np.tanh(v / 0.02) + 0.02 * rng.standard_normal(len(t))
        table = np.c_[t, np.degrees(q), 1000.0 * torque / (0.060 * 28.0)]
        np.savetxt(
            folder / "recordings" / f"{name}.csv", table, delimiter=",", header="t,enc,i", comments="", fmt="%.7g"
        )
    study = pellucid.open(folder)
    assert [f for f in check(study) if f.severity == "refuse"] == []
    fit = identify(study, families=["symmetric"])
    assert fit["inertia"].value == pytest.approx(0.08, rel=0.1)
    assert fit["gravity"].value == pytest.approx(3.0, rel=0.02)
    assert fit.families["symmetric"].heldout_effort_error < 5.0


def test_the_python_example_uses_public_names():
    code = blocks("python")[0]
    used = set(re.findall(r"pellucid\.(\w+)", code))
    assert used <= set(pellucid.__all__)
    compile(code, "README.md", "exec")
