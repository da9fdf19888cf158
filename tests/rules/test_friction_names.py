"""Code asks the catalogue of friction terms instead of comparing with a term's name, counted in the syntax tree."""

import ast
from functools import cache
from pathlib import Path

import pytest

import pellucid
import pellucid_lab
from pellucid.models.fields import model_fields
from pellucid.models.friction_terms import TERMS

ROOTS = (Path(pellucid.__file__).parent, Path(pellucid_lab.__file__).parent)
CATALOGUE = "models/friction_terms.py"
OUTSIDE = ("study/datasets/", "pellucid_lab/papers/")
MODELS = ("joint", "geared_joint", "coupled_plant", "tree_joint", "tree_motor")
NAMES = {term.name for term in TERMS} | {
    field.name for model in MODELS for field in model_fields(model) if field.resists is not None
}
LOOK_UPS = {"get", "pop", "index", "count", "startswith", "endswith", "setdefault"}

# Comparisons and subscripts with a term's name, by file. The numbers may only fall.
ALLOWED: dict[str, int] = {}


def named(node: ast.expr) -> int:
    """Return how many literals in an expression are a friction term's name."""
    return sum(isinstance(n, ast.Constant) and isinstance(n.value, str) and n.value in NAMES for n in ast.walk(node))


def comparisons(source: str) -> int:
    """Return how often a source compares with, looks up or indexes by a literal that is a friction term's name."""
    found = 0
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare):
            sides = (node.left, *node.comparators)
            found += sum(
                named(side) for side in sides if isinstance(side, ast.Constant | ast.Tuple | ast.List | ast.Set)
            )
        elif isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant | ast.Tuple | ast.List):
            found += named(node.slice)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in LOOK_UPS:
            found += sum(named(argument) for argument in node.args[:1])
        elif isinstance(node, ast.MatchValue):
            found += named(node.value)
    return found


@cache
def counted(roots: tuple[Path, ...] = ROOTS) -> dict[str, int]:
    """Return the count of each file that has any, by its path below the package."""
    found = {}
    for root, path in [(folder, path) for folder in roots for path in sorted(folder.rglob("*.py"))]:
        where = f"{'' if root == ROOTS[0] else root.name + '/'}{path.relative_to(root).as_posix()}"
        if where != CATALOGUE and not where.startswith(OUTSIDE):
            found[where] = comparisons(path.read_text(encoding="utf-8"))
    return {where: count for where, count in found.items() if count}


def test_no_file_compares_with_more_names_of_terms():
    found = counted()
    more = [f"{where}: {n}, allowed {ALLOWED.get(where, 0)}" for where, n in found.items() if n > ALLOWED.get(where, 0)]
    assert not more, "ask models/friction_terms.py instead:\n" + "\n".join(more)


def test_the_allowed_counts_are_those_found():
    found = counted()
    fallen = [f"{where}: {found.get(where, 0)} of {n}" for where, n in ALLOWED.items() if found.get(where, 0) < n]
    assert not fallen, "lower ALLOWED:\n" + "\n".join(fallen)


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ('if name == "coulomb": pass', 1),
        ('if name in ("viscous", "coulomb", "offset"): pass', 2),
        ('x = body["stribeck"] + body.get("square_root", 0.0)', 2),
        ('if name.startswith("load_motoring"): pass', 1),
        ('match name:\n    case "viscous": pass', 1),
        ('x = {"coulomb": 1.0}\nf(coulomb=2.0)\nif name == "inertia": pass', 0),
    ],
)
def test_a_comparison_is_found(source, count):
    assert comparisons(source) == count
