"""Who may import whom, who may plot, who may open files: the house's rules, read from the source itself."""

import ast
import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

import pellucid

ROOT = Path(pellucid.__file__).parent

BASE = {"_atomic", "_domains", "_errors", "_given", "_plugins", "_printed_command", "_processes", "_tabular", "units"}
FOUNDATION = {"numerics", "files", "models", "study"}
DOMAINS = {"joint", "arm", "orthosis", "emg", "people", "controllers"}
# A room may import what its entry names, and itself: foundation, domains, then what joins domains.
ALLOWED = {
    "_atomic": set(),
    "_errors": set(),
    "_domains": {"_errors"},
    "_given": {"_errors"},
    "_plugins": {"_errors"},
    "_printed_command": set(),
    "_processes": set(),
    "_tabular": {"_errors"},
    "units": {"_errors"},
    "models": BASE | {"_core"},  # what several domains know of the core: joints, trees, friction, cards
    "numerics": BASE | {"_core", "models"},  # arrays
    "files": BASE | {"_core"},  # values and files; numbers of text come from the core; knows no study
    "study": BASE | {"numerics", "files", "models"},
    **dict.fromkeys(DOMAINS, BASE | FOUNDATION | {"_core"}),  # and the doors below
    "live": BASE | FOUNDATION | DOMAINS,
    "start": BASE | FOUNDATION | {"arm.urdf"},  # a robot's file names its joints
    "start_study": BASE | FOUNDATION | {"arm", "live", "start"},
    "cli": BASE | FOUNDATION | DOMAINS | {"live", "start", "start_study"},
    "__main__": {"cli", "study.drawn_report"},  # an up-to-date report is printed without loading the commands
}
DOORS = {
    ("people", "emg.signals.emg_chain"): "activity of muscles is an index of movement",
    ("people", "emg.signals.emg_quality"): "recordings of people contain EMG, which is checked in one place",
    ("emg", "controllers.export.c_folder"): "an estimator is exported from the templates of controllers",
    ("emg", "controllers.export.controller_exporter"): "an estimator runs with a period as a controller does",
    ("emg", "controllers.export.replay_vector"): "an exported estimator has a test vector as a controller has",
    ("arm", "joint.fit"): "causes at the joints of an arm are decided as those of a single joint",
    ("orthosis", "controllers.coupling"): "the law of a worn orthosis is designed for its coupling",
    ("orthosis", "controllers.export.controller_exporter"): "the law of a worn orthosis is exported",
    ("orthosis", "controllers.export.controller_values"): "the law of a worn orthosis is exported",
    ("orthosis", "controllers.control_law"): "the law of a worn orthosis keeps the study's limits",
    ("orthosis", "controllers.study.rig_instruments"): "the law of a worn orthosis is supervised",
    ("orthosis", "controllers.worn"): "the law of a worn orthosis is designed in one place",
    ("orthosis", "emg.estimators.causal_map"): "coupling: the wearer's torque is mapped from raw EMG",
    ("orthosis", "emg.estimators.condition_choice"): "loaded swings: estimators of torque are tested",
    ("orthosis", "emg.estimators.families"): "loaded swings: estimators of torque are fitted",
    ("orthosis", "emg.estimators.torque_trial"): "loaded swings: muscles of the seated leg",
    ("orthosis", "emg.estimators.torque_map"): "loaded swings: estimators of torque are fitted",
    ("orthosis", "emg.models.muscle_geometry"): "loaded swings: muscles of the seated leg",
    ("orthosis", "emg.signals.emg_chain"): "EMG tells whether a limb is relaxed, and gives the wearer's torque",
    ("orthosis", "emg.signals.emg_quality"): "EMG tells whether a limb is relaxed",
    ("orthosis", "emg.study.emg_torque.torque_findings"): "loaded swings are an evaluation of calibrate",
    ("orthosis", "emg.study.emg_torque.emg_torque_table"): "loaded swings are an evaluation of calibrate",
    ("orthosis", "emg.study.emg_torque.trial_sources"): "a strapped wearer's body is made of the same cards",
    ("orthosis", "emg.study.muscle_channels"): "loaded swings: the study's EMG chain",
    ("orthosis", "joint.fit.drive_delay"): "the actuator of an orthosis is a joint",
    ("orthosis", "joint.fit.discrepancy"): "intervals of a strap are enlarged as those of a joint",
}
"""Modules of a domain that another domain may import, each with the reason.

Orthosis may import EMG, never the reverse.
"""

MAX_IMPORTS_BETWEEN_DOMAINS = 57
"""Largest number of names that domains import from each other."""

ARRAYS_ONLY = ("numerics", "models", "joint/fit", "arm/fit", "orthosis/strap", "orthosis/swing", "orthosis/transfer",
               "orthosis/imu", "emg/estimators", "emg/fit", "emg/models", "emg/signals")  # fmt: skip
"""Folders that compute with arrays. They know no study, no table of study.toml and no page."""

PAGE_ROOMS = ("study/pages", "study/drawing")
"""Folders that draw; elsewhere only files of figures import Matplotlib."""

CORE_USERS = {"files", "models", "numerics", *DOMAINS}
def sources(root: Path = ROOT):
    return sorted(path for path in root.rglob("*.py") if "__pycache__" not in path.parts)


def layer_of(path: Path, root: Path = ROOT) -> str:
    return path.relative_to(root).with_suffix("").parts[0]


@cache
def imports(path: Path, root: Path = ROOT) -> tuple[tuple[int, tuple[str, ...]], ...]:
    """Line and target of every import, anywhere in a file: parts below the package, or ('', a top-level name)."""
    return tuple(_imports(path, root))


def _imports(path: Path, root: Path):
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


def is_allowed(layer: str, target: tuple[str, ...]) -> bool:
    """Whether a room may import a module, given by its parts below the package."""
    names = {".".join(target[:end]) for end in range(1, len(target) + 1)}
    own = {module for room, module in DOORS if room == layer}
    return bool(names & (ALLOWED[layer] | own | {layer, "__version__"}))


def violations(root: Path = ROOT):
    for path in sources(root):
        layer = layer_of(path, root)
        if layer == "__init__":
            continue
        where = path.relative_to(root).as_posix()
        if layer not in ALLOWED:
            yield f"{where}: the room '{layer}' has no entry in ALLOWED"
            continue
        for line, target in imports(path, root):
            if target[:1] == ("",):
                plots = where.startswith(PAGE_ROOMS) or path.stem.endswith(("figures", "page"))
                if target[1] in ("matplotlib", "pylab") and not plots:
                    yield f"{where}:{line}: only {', '.join(PAGE_ROOMS)} and files of pages may import matplotlib"
            elif target and not is_allowed(layer, target):
                yield f"{where}:{line}: {layer} may not import {'.'.join(target)}"
            elif where.startswith(ARRAYS_ONLY) and "study" in target[:2]:
                yield f"{where}:{line}: found {'.'.join(target)}, expected arrays: a fit knows no study"


def test_imports_follow_the_flow():
    found = list(violations())
    assert not found, "\n".join(found)


def test_domains_have_few_doors_and_use_each():
    crossings = [
        (layer_of(path), ".".join(target))
        for path in sources()
        for _, target in imports(path)
        if target[:1] != ("",) and target and {layer_of(path), target[0]} <= DOMAINS and layer_of(path) != target[0]
    ]
    assert len(crossings) <= MAX_IMPORTS_BETWEEN_DOMAINS
    used = {(of, to) for of, to in DOORS for room, name in crossings if room == of and f"{name}.".startswith(f"{to}.")}
    assert set(DOORS) == used


def test_no_domain_is_in_a_circle():
    reach = {room: {to.split(".")[0] for of, to in DOORS if of == room} for room in DOMAINS}
    for _ in DOMAINS:
        reach = {room: found | {far for near in found for far in reach[near]} for room, found in reach.items()}
    assert [room for room, found in reach.items() if room in found] == []


def test_identifying_a_joint_does_not_load_all_of_statistics():
    """scipy.stats, which scipy.signal loads too, takes longer to load than a joint to be fitted.

    Only a joint whose actuator's force was recorded beside its torque needs filters besides our own.
    """
    paths = [path for path in (ROOT / "joint").rglob("*.py") if "slider" not in path.parts]
    paths += [ROOT / "numerics" / name for name in ("filters.py", "low_pass.py", "motion.py", "sampled.py")]
    loads = re.compile(r"\s*(from|import) scipy(\.| import )(stats|signal)\b")
    lines = [(path.name, line) for path in paths for line in path.read_text(encoding="utf-8").splitlines()]
    assert {name for name, line in lines if loads.match(line)} == {"drive_delay.py"}


def test_the_base_distribution_does_not_know_the_lab():
    """What `pellucid-lab` brings is found by entry points; the base must work without it."""
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{line}"
        for path in sources()
        for line, target in imports(path)
        if target[:2] == ("", "pellucid_lab") and path != ROOT / "__init__.py"  # four of the public names
    ]
    assert not found, found
    lab = tomllib.loads((ROOT.parents[1] / "lab" / "pyproject.toml").read_text(encoding="utf-8"))
    assert lab["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == ["src/pellucid_lab"]


def test_only_the_layers_that_compute_reach_into_the_core():
    assert {layer for layer, allowed in ALLOWED.items() if "_core" in allowed} <= CORE_USERS


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("models/a.py", "from ..study.study import Study", "models may not import study.study.Study"),
        (
            "emg/a.py",
            "def f():\n    import matplotlib.pyplot",
            "only study/pages, study/drawing and files of pages may import matplotlib",
        ),
        ("study/a.py", "from .. import _core", "study may not import _core"),
        ("study/a.py", "from ..joint.fit.replay import replay", "study may not import joint.fit.replay"),
        ("emg/a.py", "from ..orthosis.strap.fit_strap import fit_strap", "emg may not import orthosis.strap.fit_strap"),
        ("joint/fit/a.py", "from ..study.joint_case import JointCase", "expected arrays"),
        ("helpful/a.py", "", "the room 'helpful' has no entry"),
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
    "_domains": "which domains are there",
    "_given": "what others gave, for whoever parses it",
    "models/card.py": "model cards",
    "models/cards": "cards that ship with the package",
    "emg/models/muscle_geometry.py": "tables that ship with the package",
    "live": "shared memory, its pages and templates, and the files of a running session",
    "controllers/export": "the core's headers, and checksums of cards",
    "orthosis/study/worn_values.py": "checksums of cards",
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
        if where.startswith(("files/", "study/", "emg/files/", "arm/urdf.py", *OWN_FILES)):
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if OPENERS.search(line.split("#")[0]) and "pellucid.open" not in line and ">>>" not in line:
                found.append(f"{where}:{number}: {line.strip()}")
    assert not found, "\n".join(found)
