"""What holds for the core's sources: flags, symbols, forbidden words, documented fields, a stub that says the same."""

import ast
import inspect
import re
import shutil
import subprocess
from pathlib import Path

import pytest

import pellucid
from pellucid import _core

ROOT = Path(__file__).parents[2]
HEADERS = sorted((ROOT / "include" / "pellucid").glob("*.hpp"))
# What a compiler may call on its own, and the one square root.
ALLOWED = {"sqrtf", "memcpy", "memmove", "memset", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
AEABI = (
    "memcpy", "memcpy4", "memcpy8", "memmove", "memset", "memset4", "memclr", "memclr4", "memclr8",
    "unwind_cpp_pr0", "unwind_cpp_pr1",
)  # fmt: skip
ALLOWED_ON_ARM = ALLOWED | {f"__aeabi_{name}" for name in AEABI}
FREESTANDING = [
    "-std=c++17", "-O2", "-ffp-contract=off", "-ffreestanding", "-fno-exceptions", "-fno-rtti",
    "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror",
]  # fmt: skip


def build_files():
    suffixes = {".txt", ".toml", ".cmake", ".cpp", ".hpp", ".yml", ".yaml", ".sh", ".ini", ".cfg"}
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
    names = (
        listed.stdout.split("\n")
        if listed.returncode == 0
        else [str(path.relative_to(ROOT)) for path in ROOT.rglob("*")]
    )
    return [
        ROOT / n
        for n in names
        if n and (Path(n).suffix in suffixes or Path(n).name == "Makefile") and (ROOT / n).is_file()
    ]


def test_no_fast_math_in_any_build_file():
    """Under it GCC removes NaN checks: a gate compiled so let infinity through."""
    files = build_files()
    assert ROOT / "CMakeLists.txt" in files
    assert ROOT / "Makefile" in files
    forbidden = re.compile(
        r"-ffast-math|-Ofast|-funsafe-math|-ffinite-math|-fassociative-math|-freciprocal-math|-ffp-contract=fast|/fp:fast|fast-math\""
    )
    assert [path for path in files if forbidden.search(path.read_text(encoding="utf-8", errors="replace"))] == []


@pytest.mark.parametrize("path", HEADERS, ids=lambda path: path.name)
def test_header_is_freestanding(path):
    text = path.read_text(encoding="utf-8")
    code = re.sub(r"//[^\n]*", "", text)
    allowed = {"cstddef", "cstdint", "limits", "type_traits", "utility"}
    assert set(re.findall(r"#include <([^>]+)>", code)) <= allowed
    words = r"\b(new|delete|throw|try|catch|virtual|dynamic_cast|typeid|malloc|free|printf|mutex|atomic|goto)\b"
    assert re.findall(words, code.replace("= delete", "")) == []
    assert set(re.findall(r"#define (\w+)", code)) <= {"PELLUCID_ABI"}
    assert text.count("#pragma once") == 1


@pytest.mark.parametrize("path", HEADERS, ids=lambda path: path.name)
def test_every_public_field_says_what_it_is(path):
    """Beside it, or, of a number of a Params, in the walk."""
    text = path.read_text(encoding="utf-8")
    undocumented = []
    for struct in re.finditer(
        r"^(?:template .*> )?struct \w*(?:Params|Coefficients|State|Input|Output|Section|Resistance|SinCos)\b[^;]*?\{$"
        r"(.*?)^\};",
        text,
        re.M | re.S,
    ):
        fields, _, walk = struct[1].partition("template <class P, class V>")
        said = re.sub(r"[^\n]*///[^\n]*", "", fields)
        for statement in re.sub(r"//[^\n]*", "", said).split(";"):
            names = re.findall(
                r"(\w+)(?:\[\w+\])?\s*(?:=|\{|,|$)", re.sub(r"\([^)]*\)|\{[^}]*\}", "", statement.strip())
            )
            if statement.strip() and not statement.strip().startswith(("using", "static")):
                undocumented += [name for name in names if not re.search(rf"\bp\.{name}\b", walk)]
    assert undocumented == []


def undefined_symbols(compiler, flags, tmp_path):
    target = tmp_path / "target.o"
    source = ROOT / "tests" / "core" / "target.cpp"
    subprocess.run(
        [compiler, *FREESTANDING, *flags, f"-I{ROOT / 'include'}", "-c", str(source), "-o", str(target)], check=True
    )
    nm = compiler.replace("g++", "nm") if compiler != "g++" else "nm"
    listed = subprocess.run([nm, "-u", str(target)], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1] for line in listed.splitlines() if line.split()}


@pytest.mark.skipif(shutil.which("g++") is None or shutil.which("nm") is None, reason="g++ and nm are not installed")
def test_a_float_controller_needs_nothing(tmp_path):
    """No allocation, no exception, no libm but sqrtf."""
    assert undefined_symbols("g++", [], tmp_path) <= ALLOWED


@pytest.mark.skipif(shutil.which("arm-none-eabi-g++") is None, reason="arm-none-eabi-g++ is not installed")
def test_a_float_controller_on_cortex_m4_has_no_double(tmp_path):
    flags = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
    symbols = undefined_symbols("arm-none-eabi-g++", flags, tmp_path)
    assert not [name for name in symbols if name.startswith("__aeabi_d")]
    assert symbols <= ALLOWED_ON_ARM


def stub_file():
    """The stub that the build wrote: into the checkout of an editable install, else beside the module."""
    places = (Path(pellucid.__file__).parent, Path(_core.__file__).parent)
    return next(place / "_core.pyi" for place in places if (place / "_core.pyi").is_file())


def test_stub_says_what_the_module_has():
    tree = ast.parse(stub_file().read_text(encoding="utf-8"))
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    public = {name for name in dir(_core) if not name.startswith("_")}
    values = {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)}
    assert public == set(functions) | set(classes) | values
    for name, node in functions.items():
        assert ast.get_docstring(node), name
        text = getattr(_core, name).__nb_signature__[0][0]
        module = ast.parse(text + ": ...")
        assert ast.unparse(module.body[0].args) == ast.unparse(node.args), name
        assert inspect.cleandoc(getattr(_core, name).__doc__.split("\n", 2)[2]) == ast.get_docstring(node), name
    shown = {node.name for node in classes["math"].body if isinstance(node, ast.FunctionDef)}
    assert shown == {name for name in dir(_core.math) if not name.startswith("_")}
