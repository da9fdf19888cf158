"""What a user calls says what it takes, gives and refuses, in sections for a program; all else in a sentence."""

import ast
import inspect
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

import pellucid
import pellucid_lab

ROOTS = (Path(pellucid.__file__).parent, Path(pellucid_lab.__file__).parent)
SECTIONS = ("Parameters", "Attributes", "Returns", "Yields", "Raises", "Notes", "Examples", "References", "See Also")
ARRAY = re.compile(r"\b(ndarray|array)\b")
SHAPE = re.compile(r"shape \(|[Ss]hape|same shape|of the same length|\(n,|n samples|length n")


@dataclass(frozen=True)
class Documented:
    """A public definition: where it is, its node, and its docstring's sections."""

    where: str
    node: ast.FunctionDef | ast.ClassDef
    text: str
    sections: dict[str, str]

    @property
    def file(self) -> str:
        return self.where.partition(":")[0]

    @property
    def within(self) -> str:
        """The class that it is a method of, if any."""
        return self.where.split(":")[1] if self.where.count(":") > 1 else ""

    @property
    def parameters(self) -> list[str]:
        args = self.node.args
        every = (*args.posonlyargs, *args.args, args.vararg, *args.kwonlyargs, args.kwarg)
        names = [a.arg for a in every if a is not None]
        return [n for n in names if n not in ("self", "cls") and not n.startswith("_")]


def sections_of(text: str) -> dict[str, str]:
    """Section name to its text; numpydoc's underlined headings."""
    parts = re.split(r"^(" + "|".join(SECTIONS) + r")\n-{3,}\n", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def described(section: str) -> set[str]:
    """Names a section's entries describe: ``a, b : type`` stands for both."""
    names = set()
    for line in section.splitlines():
        if line and not line[0].isspace():
            names |= {n.strip().lstrip("*") for n in line.split(" : ")[0].split(",")}
    return names


def _api() -> set[tuple[str, str]]:
    """File and name of everything that a user calls, and of the classes of what a user is given."""
    found = set()
    for thing in (getattr(pellucid, name) for name in dir(pellucid)):
        if callable(thing):
            module = sys.modules[thing.__module__]
            is_error = isinstance(thing, type) and issubclass(thing, Exception)
            returned = [] if is_error else re.findall(r"\w+", str(inspect.signature(thing).return_annotation))
            given = [getattr(module, name, None) for name in returned]
            for each in (thing, *(g for g in given if isinstance(g, type))):
                if each.__module__.startswith("pellucid."):
                    found.add((each.__module__.replace(".", "/").removeprefix("pellucid/") + ".py", each.__name__))
    return found


def named(path: Path) -> str:
    """Return a file's path: below the package, or with the lab's name before it."""
    own = path.is_relative_to(ROOTS[0])
    return path.relative_to(ROOTS[0] if own else ROOTS[1].parent).as_posix()


def definitions():
    for path in sorted(path for root in ROOTS for path in root.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        where = named(path)
        for node in tree.body:
            yield from _public(where, node)
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                for inner in node.body:
                    yield from _public(f"{where}:{node.name}", inner)


def _public(where, node):
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
        text = ast.get_docstring(node) or ""
        yield Documented(f"{where}:{node.lineno} {node.name}", node, text, sections_of(text))


ALL = list(definitions())
API = _api()
CALLED = [d for d in ALL if (d.file, d.within or d.node.name) in API]
"""What a user calls says everything in sections; for all else a sentence is enough, but a section is whole."""
FUNCTIONS = [d for d in ALL if isinstance(d.node, ast.FunctionDef)]


def test_every_module_says_what_it_is_for():
    paths = [path for root in ROOTS for path in root.rglob("*.py")]
    silent = [path for path in paths if not ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))]
    assert [named(p) for p in silent] == []


def test_every_public_name_is_documented():
    silent = [d.where for d in ALL if not d.text and not _is_override(d)]
    assert not silent, "\n".join(silent)


def test_parameters_are_described():
    """What a user calls describes each of more than two parameters; a section that is there is complete."""
    found = []
    for d in FUNCTIONS:
        names = set(d.parameters)
        said = described(d.sections.get("Parameters", ""))
        if said - names:
            found.append(f"{d.where}: describes {sorted(said - names)}, which it does not take")
        if "Parameters" in d.sections or (d in CALLED and len(names) > 2):
            missing = {n for n in names - said if f"`{n}`" not in d.text}
            if missing and not _is_command(d.node):
                found.append(f"{d.where}: does not describe {sorted(missing)}")
    assert not found, "\n".join(found)


def test_what_is_raised_is_said():
    """What a user calls and raises an error itself has a Raises section that names it, or the base of all."""
    found = []
    for d in (d for d in FUNCTIONS if d in CALLED or "Raises" in d.sections):
        raised = {
            n.exc.func.id
            for n in ast.walk(d.node)
            if isinstance(n, ast.Raise) and isinstance(n.exc, ast.Call) and isinstance(n.exc.func, ast.Name)
        }
        raised = {r for r in raised if r.endswith("Error")}
        said = d.sections.get("Raises", "")
        missing = {r for r in raised if r not in said}
        if missing and "PellucidError" not in said and not _is_command(d.node):
            found.append(f"{d.where}: raises {sorted(missing)}, which Raises does not say")
    assert not found, "\n".join(found)


def test_arrays_have_a_shape():
    """Where a section says that something is an array, it says of which shape."""
    found = []
    for d in CALLED:
        for name in ("Parameters", "Attributes", "Returns"):
            for entry in _entries(d.sections.get(name, "")):
                if ARRAY.search(entry.splitlines()[0]) and not SHAPE.search(entry):
                    found.append(f"{d.where}: {name}: {entry.splitlines()[0]}")
    assert not found, "\n".join(found)


def _entries(section: str) -> list[str]:
    return [e for e in re.split(r"\n(?=\S)", section.strip("\n")) if e]


def _is_command(node) -> bool:
    """A command's parameters are described by its options' help."""
    return any("command" in ast.unparse(d) for d in node.decorator_list)


GRAMMAR = {"asked", "faults", "run", "page", "inputs", "written", "prose", "save_more", "for_page"}
"""Methods of a grammar (`Procedure`, `Result`) that say what they are where they are first defined."""


def _is_override(d: Documented) -> bool:
    """A setter says nothing that its getter did not; a variant of a grammar nothing that the grammar did not."""
    setter = any(ast.unparse(each).endswith(".setter") for each in getattr(d.node, "decorator_list", ()))
    return setter or (bool(d.within) and d.node.name in GRAMMAR)


@pytest.mark.parametrize(
    ("section", "names"),
    [
        ("a : float\n    [m].\nb, c : int, optional\n", {"a", "b", "c"}),
        ("*args, **options\n    Any.\n", {"args", "options"}),
    ],
)
def test_sections_are_understood(section, names):
    assert described(section) == names
