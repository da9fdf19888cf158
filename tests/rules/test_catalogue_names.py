"""Code asks an entry of a catalogue instead of comparing with its name, counted in the syntax tree.

The catalogues are those of indices, laws, faults, estimators, procedures and defects; `test_friction_names` counts
names of friction terms.
"""

import ast
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

import pellucid
import pellucid_lab
from pellucid import _core
from pellucid.controllers.control_law import LAWS
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES
from pellucid.people.indices import INDICES
from pellucid.study.find_defects import KINDS
from pellucid.study.procedures.registry import ALL_PROCEDURES
from pellucid_lab.pointing.predicted_indices import PREDICTED_INDICES_BY_NAME
from pellucid_lab.safety.fault_table import FAULT_KINDS

ROOTS = (Path(pellucid.__file__).parent, Path(pellucid_lab.__file__).parent)
OUTSIDE = ("study/datasets/", "pellucid_lab/papers/")
LOOK_UPS = {"get", "pop", "index", "count", "startswith", "endswith", "setdefault"}


@dataclass(frozen=True)
class Catalogue:
    """Names of the entries of a catalogue, and how a comparison with one of them is recognised."""

    home: tuple[str, ...]  # files or folders that may name entries
    names: frozenset[str]
    words: frozenset[str] = frozenset()  # names that are words for other things, too
    subject: str = "$^"  # pattern of what is compared or subscripted where such a word names an entry


CATALOGUES = {
    "indices": Catalogue(
        ("people/indices.py", "pellucid_lab/pointing/predicted_indices.py"),
        frozenset({*INDICES, *PREDICTED_INDICES_BY_NAME}),
        frozenset({"duration", "acceleration", "work", "antagonists"}),
        r"ind(ex|ices)|assessed|\bname\b",
    ),
    "laws": Catalogue(
        ("controllers/control_law.py",), frozenset(LAWS), frozenset({"joint", "rules", "directional", "worn"}),
        r"(?i)\blaws?\b|\bkind\b",
    ),
    "supervisor's faults": Catalogue(
        ("controllers/supervisor_faults.py",), frozenset(_core.FAULTS), frozenset(_core.FAULTS), r"fault|alarm|\.said\b"
    ),
    "estimator's faults": Catalogue(
        ("emg/models/estimator_faults.py",), frozenset(_core.EMG_FAULTS), frozenset(_core.EMG_FAULTS), r"fault"
    ),
    "single faults": Catalogue(("pellucid_lab/safety/fault_table.py",), frozenset(kind.name for kind in FAULT_KINDS)),
    "estimators": Catalogue(
        ("emg/estimators/families/",),
        frozenset({*ESTIMATOR_FAMILIES, *(alias for f in ESTIMATOR_FAMILIES.values() for alias in f.aliases)}),
        frozenset({"hill", "linear", "motion", "tree"}),
        r"estimator|\bname\b|\bfits\b|\bhow\b|famil|\bby\b",
    ),
    "procedures": Catalogue(
        (),
        frozenset(p.name for p in ALL_PROCEDURES),
        frozenset(p.name for p in ALL_PROCEDURES),
        r"(?i)procedure|command",
    ),
    "defects": Catalogue(("files/defects/",), frozenset(kind.KIND for kind in KINDS)),
}  # fmt: skip

# Comparisons and subscripts with an entry's name, by catalogue and file. The numbers may only fall.
ALLOWED: dict[str, dict[str, int]] = {}


def literals(node: ast.expr) -> list[str]:
    """Return the strings of a literal, or of a tuple, list or set of literals."""
    parts = node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]
    return [n.value for n in parts if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def counted_in(asked: str, found: list[str], catalogue: Catalogue) -> int:
    """Return how many of the strings `found` name an entry, where an expression `asked` is compared with them."""
    own = [name for name in found if name in catalogue.names]
    if any(name not in catalogue.words for name in own) or re.search(catalogue.subject, asked):
        return len(own)
    return 0


def questions(source: str) -> list[tuple[str, list[str]]]:
    """Return what a source compares with literals, subscripts or looks up by them, each with these strings."""
    found: list[tuple[list[ast.expr], ast.expr]] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            found += [([other for other in sides if other is not side], side) for side in sides]
        elif isinstance(node, ast.Subscript):
            found.append(([node.value], node.slice))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in LOOK_UPS:
            found += [([node.func.value], argument) for argument in node.args[:1]]
        elif isinstance(node, ast.Match):
            patterns = (case.pattern for case in node.cases)
            found += [([node.subject], pattern.value) for pattern in patterns if isinstance(pattern, ast.MatchValue)]
    return [(" ".join(map(ast.unparse, asked)), literals(by)) for asked, by in found if literals(by)]


def comparisons(asked: list[tuple[str, list[str]]], catalogue: Catalogue) -> int:
    """Return how many of the `questions` of a source are answered by a literal that is an entry's name."""
    return sum(counted_in(text, strings, catalogue) for text, strings in asked)


@cache
def asked_in_package(roots: tuple[Path, ...] = ROOTS) -> dict[str, list[tuple[str, list[str]]]]:
    """Return the questions of each file, by its path: below the package, or with the lab's name before it."""
    files = {f"{'' if root == ROOTS[0] else root.name + '/'}{path.relative_to(root).as_posix()}": path
             for root in roots for path in sorted(root.rglob("*.py"))}  # fmt: skip
    return {where: questions(path.read_text(encoding="utf-8")) for where, path in files.items()}


def counted(which: str) -> dict[str, int]:
    """Return the count of each file that has any, by its path below the package."""
    catalogue = CATALOGUES[which]
    files = {where: asked for where, asked in asked_in_package().items()
             if not where.startswith((*OUTSIDE, *catalogue.home))}  # fmt: skip
    found = {where: comparisons(asked, catalogue) for where, asked in files.items()}
    return {where: count for where, count in found.items() if count}


@pytest.mark.parametrize("which", CATALOGUES)
def test_no_file_compares_with_names_of_entries(which):
    assert counted(which) == ALLOWED.get(which, {}), f"ask {CATALOGUES[which].home} instead, or lower ALLOWED"


@pytest.mark.parametrize(
    ("which", "source", "count"),
    [
        ("indices", 'if index.name == "unsettled": pass', 1),
        ("indices", 'if name in ("duration_median", "duration", "unsettled"): pass', 3),
        ("indices", 'each = min(enough, key=lambda e: (e.index != "duration", e.change))', 1),
        ("indices", 'found.assessed.get("vmax")\nx = found.assessed["torque_rms"]', 2),
        ("indices", 'seconds = rig["protocol"]["duration"]', 0),
        ("laws", 'if law.kind == "transparent": pass', 1),
        ("laws", 'values = LAWS["joint"].defaults\nif self.law == "worn": pass', 2),
        ("laws", 'said = rig["joint"][name]\nif name in ("joint", "name"): pass', 0),
        ("supervisor's faults", 'if plant.fault != "none" or chain == "none": pass', 1),
        ("estimators", 'half = fit.half_width(trial) if name == "hill" else None', 1),
        ("estimators", 'chain: Literal["hill", "none"] = "hill"', 0),
        ("procedures", 'all(procedure.name != "joint" for procedure in procedures)', 1),
        ("defects", 'match cut.kind:\n    case "spike": pass', 1),
    ],
)
def test_a_comparison_is_found(which, source, count):
    assert comparisons(questions(source), CATALOGUES[which]) == count
