"""Who may import whom, who may plot, who may open files: the house's rules, read from the source itself."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

import pellucid

ROOT = Path(pellucid.__file__).parent

BASE = {"_atomic", "_errors", "_given", "_plugins", "_printed_command", "_processes", "_tabular", "units"}
PHYSICS = BASE | {"models", "_core"}
UP_TO_SIGNALS = BASE | {"recordings", "signals", "protocols", "studies"}
JUDGING = {"fit", "control", "estimators", "assessment", "pages", "procedures"}
LIBRARY_AND_STUDIES = UP_TO_SIGNALS | PHYSICS - {"_core"} | JUDGING | {"drawing", "datasets"}
EVERYTHING = LIBRARY_AND_STUDIES | {"lab"}
LAB_DISTRIBUTION = {"lab", "papers", "demonstration", "ranking", "lab_cli"}
# The order of the flow; a layer may import what its entry names, and itself.
ALLOWED = {
    "_atomic": set(),
    "_errors": set(),
    "_given": {"_errors"},
    "_plugins": {"_errors"},
    "_printed_command": set(),
    "_processes": set(),
    "_tabular": {"_errors"},
    "units": {"_errors"},
    "recordings": BASE | {"models"},  # values and files; readers of models give models
    "studies": BASE | {"recordings", "models"},  # study.toml names friction families
    "datasets": BASE | {"recordings", "studies", "procedures"},
    "signals": BASE | {"recordings", "_core"},
    "protocols": BASE | {"recordings", "signals"},
    "inference": BASE | {"recordings.name_evidence", "signals"},  # arrays and names; proposals read files
    "models": BASE | {"_core"},  # physics knows no data
    "fit": BASE | PHYSICS | {"drawing", "recordings.recording", "signals", "protocols"},  # arrays alone
    "control": PHYSICS,
    "estimators": BASE | PHYSICS | {"signals", "fit"},  # arrays; procedures read studies
    "assessment": BASE | {"signals"},  # arrays; procedures read studies
    "drawing": BASE,  # figures' common shapes
    "pages": BASE | {"models", "fit", "drawing"},  # words, tables, drawings: of nobody's procedure
    "procedures": UP_TO_SIGNALS | PHYSICS | {"drawing", "fit", "control", "estimators", "assessment", "pages"},
    "live": BASE | {"models", "recordings", "control"},  # processes and shared memory: of nobody's study
    "lab": UP_TO_SIGNALS | PHYSICS | JUDGING - {"pages"} | {"drawing", "datasets", "live"},
    "deployment": UP_TO_SIGNALS | PHYSICS | {"fit", "control", "procedures"},
    "papers": EVERYTHING,
    "demonstration": EVERYTHING | {"deployment", "live", "session"},
    "ranking": EVERYTHING | {"papers", "deployment.microcontroller"},
    "proposals": BASE | {"drawing", "inference", "pages", "recordings", "studies"},  # of a lab's own files
    "session": UP_TO_SIGNALS | {"control", "live", "estimators", "assessment", "procedures", "pages", "drawing"},
    # Rigs come as plug-ins.
    "start_study": BASE | {"session", "datasets", "procedures", "proposals", "recordings", "studies"},
    "terminal": BASE | {"procedures", "studies"},  # printing and progress
    "command_group": {"_errors", "procedures.command", "terminal"},  # the help, for the commands of every distribution
    "cli": LIBRARY_AND_STUDIES | {"command_group", "deployment", "proposals", "session", "start_study", "terminal"},
    "lab_cli": EVERYTHING | {"command_group", "deployment", "papers", "demonstration", "ranking", "terminal"},
    "__main__": {"cli"},
}  # fmt: skip
PLOTTING = {"drawing", "pages"}
CORE_USERS = {"models", "signals", "fit", "estimators", "procedures", "control", "lab", "deployment"}
DRAWER = re.compile(r"utils?|helpers?|misc|common|tools|stuff")


def sources(root: Path = ROOT):
    return sorted(path for path in root.rglob("*.py") if "__pycache__" not in path.parts)


def layer_of(path: Path, root: Path = ROOT) -> str:
    return path.relative_to(root).with_suffix("").parts[0]


def imports(path: Path, root: Path = ROOT):
    """Line and target of every import, anywhere in a file: parts below the package, or ('', a top-level name)."""
    here = path.relative_to(root).with_suffix("").parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = here[: len(here) - node.level]
            tail = tuple(node.module.split(".")) if node.module else ()
            for alias in node.names:
                yield node.lineno, (*base, *tail, alias.name)
        elif isinstance(node, ast.ImportFrom):
            parts = node.module.split(".")
            for alias in node.names:
                yield node.lineno, (*parts[1:], alias.name) if parts[0] == root.name else ("", parts[0])
        elif isinstance(node, ast.Import):
            for alias in node.names:
                parts = alias.name.split(".")
                yield node.lineno, tuple(parts[1:]) if parts[0] == root.name else ("", parts[0])


def violations(root: Path = ROOT):
    for path in sources(root):
        layer = layer_of(path, root)
        if layer == "__init__":
            continue
        where = path.relative_to(root).as_posix()
        if layer not in ALLOWED:
            yield f"{where}: the layer '{layer}' has no entry in ALLOWED"
            continue
        for line, target in imports(path, root):
            if target[:1] == ("",):
                if target[1] in ("matplotlib", "pylab") and layer not in PLOTTING and not path.stem.endswith("figures"):
                    yield f"{where}:{line}: only {sorted(PLOTTING)} and files of figures may import matplotlib"
            elif (
                target
                and target[0] not in {layer, "__version__"}
                and target[0] not in ALLOWED[layer]
                and ".".join(target[:2]) not in ALLOWED[layer]
            ):
                yield f"{where}:{line}: {layer} may not import {'.'.join(target)}"


def test_imports_follow_the_flow():
    found = list(violations())
    assert not found, "\n".join(found)


def test_identifying_a_joint_does_not_load_all_of_statistics():
    """scipy.stats, which scipy.signal loads too, takes longer to load than a joint to be fitted.

    Only a joint whose actuator's force was recorded beside its torque needs filters besides our own.
    """
    paths = [*(ROOT / "fit" / "joint").rglob("*.py"), *(ROOT / "procedures" / "joint").rglob("*.py")]
    paths += [ROOT / "signals" / name for name in ("filters.py", "low_pass.py", "motion.py", "sampled.py")]
    loads = re.compile(r"\s*(from|import) scipy(\.| import )(stats|signal)\b")
    lines = [(path.name, line) for path in paths for line in path.read_text(encoding="utf-8").splitlines()]
    assert {name for name, line in lines if loads.match(line)} == {"actuator_residual.py"}


def test_the_base_distribution_does_not_know_the_lab():
    """What `pellucid-lab` brings is found by entry points; the base must work without it."""
    base = {layer: allowed for layer, allowed in ALLOWED.items() if layer not in LAB_DISTRIBUTION}
    assert {layer for layer, allowed in base.items() if allowed & LAB_DISTRIBUTION} == set()
    excluded = {
        pattern.split("/")[1].removesuffix(".py")
        for pattern in tomllib.loads((ROOT.parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
            "scikit-build"
        ]["wheel"]["exclude"]
    }
    brought = tomllib.loads((ROOT.parents[1] / "lab" / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]
    for target in ("wheel", "sdist"):
        paths = brought["build"]["targets"][target]["only-include"]
        assert {Path(path).stem for path in paths if path.startswith("src/")} == LAB_DISTRIBUTION
    assert excluded == LAB_DISTRIBUTION


def test_only_the_layers_that_compute_reach_into_the_core():
    assert {layer for layer, allowed in ALLOWED.items() if "_core" in allowed} <= CORE_USERS


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("models/a.py", "from ..studies.study import Study", "models may not import studies.study.Study"),
        (
            "signals/a.py",
            "def f():\n    import matplotlib.pyplot",
            "only ['drawing', 'pages'] and files of figures may import matplotlib",
        ),
        ("pages/a.py", "from .. import _core", "pages may not import _core"),
        ("helpful/a.py", "", "the layer 'helpful' has no entry"),
    ],
)
def test_a_wrong_import_is_found(tmp_path, file, text, said):
    path = tmp_path / "pellucid" / file
    path.parent.mkdir(parents=True)
    path.write_text(text, encoding="utf-8")
    assert [v for v in violations(tmp_path / "pellucid") if said in v]


def test_no_import_goes_in_a_circle():
    """Module by module: imports at the top, within functions, and for a type checker alone."""
    names = {".".join(p.relative_to(ROOT).with_suffix("").parts): p for p in sources()}

    def module(parts: tuple[str, ...]) -> str | None:
        for end in (len(parts), len(parts) - 1):
            for name in (".".join(parts[:end]), ".".join((*parts[:end], "__init__"))):
                if name in names:
                    return name
        return None

    edges = {}
    for name, path in names.items():
        found = {module(target) for _, target in imports(path) if target[:1] != ("",)}
        edges[name] = {other for other in found if other and other not in (name, "__init__")}
    done, trail = set(), []

    def visit(name: str):
        if name in trail:
            pytest.fail("imports in a circle: " + " -> ".join([*trail[trail.index(name) :], name]))
        if name in done:
            return
        trail.append(name)
        for other in sorted(edges[name]):
            visit(other)
        trail.pop()
        done.add(name)

    for name in edges:
        visit(name)


# Where a file of the package's own is read or written, and why that is not opening data.
OWN_FILES = {
    "_given": "what others gave, for whoever parses it",
    "models/card.py": "model cards",
    "emg/models/muscle_geometry.py": "tables that ship with the package",
    "lab": "the virtual lab writes recordings and reads its own rigs",
    "papers": "printed numbers",
    "session": "its own pages and templates, and the report that it shows",
    "deployment": "the core's headers, and checksums of cards",
    "live": "shared memory, and the files of a running session",
    "_plugins.py": "what installed distributions say they add",
}
OPENERS = re.compile(
    r"\b(?:open|np\.load|np\.loadtxt|np\.genfromtxt|numpy\.load|loadmat|json\.load|csv\.reader|read_csv)\s*\("
    r"|\.(?:read_text|read_bytes|open)\(|\b(?:scipy\.io|h5py|ezc3d|pyxdf|edfio|python_calamine|matio|mcap|rosbags)\b"
)


def test_only_readers_open_data_files():
    found = []
    for path in sources():
        where = path.relative_to(ROOT).as_posix()
        if layer_of(path) in {"recordings", "studies", "datasets"} or where in OWN_FILES or layer_of(path) in OWN_FILES:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if OPENERS.search(line.split("#")[0]) and "pellucid.open" not in line and ">>>" not in line:
                found.append(f"{where}:{number}: {line.strip()}")
    assert not found, "\n".join(found)


def test_one_concept_one_file():
    names = [p for p in sources() if p.stem != "__init__"]
    assert [p.name for p in names if DRAWER.fullmatch(p.stem)] == []
    assert [p.name for p in ROOT.rglob("*") if p.is_dir() and DRAWER.fullmatch(p.name)] == []


def test_no_data_set_is_named_in_code():
    """A lab's recording and a public one take the same way: names of data sets are data."""
    from pellucid.study import datasets

    # The first part of a name would do, were it not an English word, or the beginning of many, in some of them.
    parts = {n.split("_")[0] for n in datasets.names()} - {"human", "lower", "lumbar", "rat"}
    # Not in the middle of a word: the house's own name ends in that of a collection.
    words = re.compile(f"(?<![a-z])(?:{'|'.join(sorted({*datasets.names(), *parts}))})", re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{number}: {line.strip()}"
        for path in sources()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if words.search(line)
    ]
    assert not found, "\n".join(found)
