"""What the pages say is so: links, commands, files, modules, the example study, and names."""

import ast
import importlib
import re
import shlex
import tomllib
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
from test_layers import ALLOWED

import pellucid
from pellucid.study.procedures.run import check, identify

ROOT = Path(__file__).parents[2]
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")))
}
README, ARCHITECTURE, REAL_DATA = (
    PAGES[p] for p in ("README.md", "docs/architecture.md", "docs/validation/real-data.md")
)
WRITE_A_STUDY = "docs/how-to/write-a-study-toml.md"
BASES = (ROOT, ROOT / "src", ROOT / "src" / "pellucid", ROOT / "lab" / "src")
EXPLANATION = tuple(page for page in PAGES if page.startswith("docs/explanation/"))
FIRST_PAGES = ("README.md", "CONTRIBUTING.md", "docs/architecture.md", *EXPLANATION, "docs/errata.md")


def blocks(language: str, text: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Of its headings, as a browser of repositories makes them."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    missing = []
    for target in re.findall(r"\]\(([^)\s]+)\)", PAGES[page]):
        file, _, anchor = target.partition("#")
        if file.startswith("http"):
            continue
        path = (ROOT / page).parent / file if file else ROOT / page
        if not path.exists() or (anchor and anchor not in anchors(path)):
            missing.append(target)
    assert not missing, missing


def test_the_errors_of_the_arm_are_the_same_on_every_page():
    """The code had improved: the tutorial showed what it printed, README and validation an earlier figure."""
    rows = {model: found for model, found in re.findall(r"^\| ([^|]+) \| ([\d.]+ %) \|", REAL_DATA, re.MULTILINE)}
    published, found = rows["stated bodies, published friction"], rows["friction chosen for each joint"]
    assert f"| {published} (published model) | {found} | a real arm |" in README
    assert f"mean effort error is {found}" in PAGES["docs/tutorials/identify-an-arm.md"]


def test_every_page_is_linked_from_another():
    linked = {
        ((ROOT / page).parent / target.partition("#")[0]).resolve()
        for page, text in PAGES.items()
        for target in re.findall(r"\]\(([^)\s#]+)", text)
        if (ROOT / page).name != target.partition("#")[0]
    }
    assert not [page for page in PAGES if page != "README.md" and (ROOT / page).resolve() not in linked]


def test_each_chapter_of_the_explanation_keeps_to_its_size():
    assert len(EXPLANATION) >= 12
    assert not [page for page in EXPLANATION if len(PAGES[page].split()) > 2000]


@pytest.mark.parametrize("page", FIRST_PAGES)
def test_files_and_folders_it_names_exist(page):
    rooms = [path.name for path in (ROOT / "src" / "pellucid").iterdir() if path.is_dir()]
    top = "|".join(("lab", "tests", "docs", "include", "src", "bindings", "research", "pellucid", *rooms))
    named = re.findall(rf"`((?:{top})/[\w./-]*)`", PAGES[page])
    missing = [n for n in named if not any((base / n).exists() for base in BASES)]
    assert not missing, missing


@pytest.mark.parametrize("page", PAGES)
def test_sources_it_names_exist(page):
    """A header of the core may go by its name alone; `<...>` stands for any."""
    named = re.findall(r"`([\w./-]+\.(?:py|hpp|cpp))`", PAGES[page])
    bases = (*BASES, ROOT / "include" / "pellucid")
    assert not [n for n in named if "/" in n or n.endswith("pp") if not any((base / n).exists() for base in bases)]


@pytest.mark.parametrize("page", PAGES)
def test_names_in_the_package_that_it_names_exist(page):
    named = set(re.findall(r"`pellucid((?:\.\w+)+)`", PAGES[page])) - {".json"}  # a file, which `export` writes
    for block in blocks("python", PAGES[page]):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] == "pellucid":
                named |= {f"{node.module.removeprefix('pellucid')}.{alias.name}" for alias in node.names}
    assert not [name for name in sorted(named) if not is_there(name.strip("."))]


def is_there(name: str) -> bool:
    """Whether something of the package has this dotted name."""
    parts = name.split(".")
    for end in range(len(parts), -1, -1):
        try:
            found = importlib.import_module(".".join(["pellucid", *parts[:end]]))
        except ImportError:
            continue
        try:
            reduce(getattr, parts[end:], found)
        except AttributeError:
            continue
        return True
    return False


def test_commands_exist():
    from pellucid.cli import app
    from pellucid.study.procedures.procedure import procedure_commands

    aliases = {c.name for c in procedure_commands() if len(c.words) > 1} | {"help"}
    known = {c.name or c.callback.__name__ for c in app.registered_commands} - aliases | {"datasets", "emg"}
    used = {
        page: set(re.findall(r"pellucid ([a-z][\w-]*)", "\n".join([*told, *blocks("sh", text)])))
        for page, text in PAGES.items()
        for told in [re.findall(r"`[^`\n]+`", text)]
    }
    assert used[WRITE_A_STUDY] >= {"init", "check", "identify", "report"}
    assert set().union(*used.values()) <= known
    assert known <= set().union(*used.values())
    targets = set(re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    named = re.findall(r"\bmake (demo|test|nightly|bench|fuzz|reference|site)\b", "".join(PAGES.values()))
    assert set(named) <= targets


def test_the_apt_line_installs_what_is_needed():
    line = next(b for b in blocks("sh", README) if "apt install" in b)
    assert set(shlex.split(line)[3:]) == {"git", "make", "g++", "python3", "python3-venv", "python3-dev"}


def moving(t: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Angle, velocity and acceleration of three sines, each shape (n,)."""
    w = 2.0 * np.pi * np.array([0.23, 0.61, 1.3])[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, 3)[:, None]
    a = np.array([0.5, 0.25, 0.08])[:, None]
    motions = (np.sin(w * t + phase), w * np.cos(w * t + phase), -(w**2) * np.sin(w * t + phase))
    return tuple((a * each).sum(0) for each in motions)


def test_the_example_study_works(tmp_path):
    """The page's study.toml, with recordings of a made-up elbow in the columns and units it names."""
    folder = tmp_path / "my-joint"
    (folder / "recordings").mkdir(parents=True)
    (folder / "study.toml").write_text(blocks("toml", PAGES[WRITE_A_STUDY])[0], encoding="utf-8")
    rng = np.random.default_rng(5)
    for name in ("sweep", "another_day"):
        t = np.arange(6000) / 200.0
        q, v, acc = moving(t, rng)
        torque = 0.08 * acc + 3.0 * np.sin(q) + 0.2 * v + 0.4 * np.tanh(v / 0.02) + 0.02 * rng.standard_normal(len(t))
        path, heads = folder / "recordings" / f"{name}.csv", "time,position,current"
        table = np.c_[t, q, torque / (0.060 * 28.0)]
        np.savetxt(path, table, delimiter=",", header=heads, comments="", fmt="%.9g")
    study = pellucid.open(folder)
    assert [f for f in check(study) if f.severity == "refuse"] == []
    fit = identify(study, families=["symmetric"])
    assert fit["inertia"].value == pytest.approx(0.08, rel=0.1)
    assert fit["gravity"].value == pytest.approx(3.0, rel=0.02)
    assert fit.families["symmetric"].heldout_effort_error < 5.0


def test_the_python_examples_use_public_names():
    for page in ("README.md", "docs/how-to/identify-a-joint-from-arrays.md"):
        code = "".join(blocks("python", PAGES[page]))
        used = set(re.findall(r"\b(?:pellucid|pl)\.(\w+)", code))
        assert used
        assert used <= set(dir(pellucid))
        compile(code, page, "exec")


def rooms() -> dict[str, int]:
    """Every room of the drawing in the architecture, and its line from the bottom."""
    drawn = next(b for b in blocks("", ARCHITECTURE) if "orthosis" in b).splitlines()
    return {room: height for height, line in enumerate(reversed(drawn)) for room in line.split()}


def test_the_flow_is_drawn_as_it_is():
    heights = rooms()
    assert set(heights) == set(ALLOWED) | {"_core"}
    upwards = [(a, b) for a, below in ALLOWED.items() for b in below if heights[b.split(".")[0]] >= heights[a]]
    assert not upwards, upwards


def test_every_room_is_described():
    named = set(
        re.findall(r"`(\w+)(?:/|\.py)`(?=[^|]*\|)", "\n".join(re.findall(r"^\| `.*", ARCHITECTURE, re.MULTILINE)))
    )
    assert set(ALLOWED) <= named


def test_every_dependency_is_accounted_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    asked = [*project["build-system"]["requires"], *project["project"]["dependencies"]]
    asked += [each for extra in project["project"]["optional-dependencies"].values() for each in extra]
    libraries = {re.match(r"[\w-]+", each)[0].lower() for each in asked} - {"pellucid"}
    table = ARCHITECTURE.partition("## Dependencies")[2].lower()
    assert not [name for name in sorted(libraries) if name not in table]
