"""The fenced blocks of a page, and a reader who runs them one after another in one folder.

What a block is, its fence says: `sh` commands, `python` statements (one notebook for a whole page), `toml` lines for a
file, `text` the output of the block before it, `c` a part of a program. Comments on lines above the fence say more:

    <!-- not run: needs a microcontroller -->    the block is left out, for this reason
    <!-- into: servo/study.toml -->              these lines belong into that file
    <!-- study: a part -->                       these lines must be valid in a study.toml, and belong into no file
    <!-- status: 1 -->                           the last command ends with this status
    <!-- needs: qemu-system-arm -->              the block is left out where a program is not installed

Files that a block needs come from the blocks above it.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

COMMENT = re.compile(r"<!-- (not run|into|study|status|needs): (.+) -->")
LANGUAGES = ("sh", "python", "toml", "text", "c")
TERMINAL_WIDTH = 80
PROGRESS_LINE = re.compile(
    r"pellucid: [0-9.]+ % .*, (?:about [0-9]+ (?:s|min) left|longer than predicted|[0-9]+ s so far)$"
)
NUMBER = re.compile(r"[-−+]?\d[\d,]*\.?\d*(?:e[-+]?\d+)?%?")
RELATIVE_TOLERANCE = 0.05
"""Shown numbers may differ from printed ones by this share: another BLAS kernel rounds otherwise."""


@dataclass(frozen=True)
class Block:
    """One fenced block of a page."""

    page: str
    line: int  # number of the fence's line in the page, from 1
    language: str
    text: str
    comment: dict[str, str]  # words of the comments above its fence

    @property
    def where(self) -> str:
        """Page and line, as an editor takes them."""
        return f"{self.page}:{self.line}"


def blocks_of(page: Path) -> list[Block]:
    """Return the fenced blocks of a page, in order."""
    found, comment, opened, lines = [], {}, None, []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        if opened is not None:
            if line == "```":
                found.append(Block(page.name, opened[0], opened[1], "".join(f"{each}\n" for each in lines), comment))
                opened, comment = None, {}
            else:
                lines.append(line)
        elif line.startswith("```"):
            opened, lines = (number, line.removeprefix("```").strip()), []
        elif said := COMMENT.fullmatch(line):
            comment = {**comment, said[1]: said[2]}
        elif line.strip():
            comment = {}
    assert opened is None, f"{page.name}:{opened[0]}: a fence that is not closed"
    return found


class PageFailed(AssertionError):
    """A block did not do what its page says."""


class Stale(PageFailed):
    """A page shows what is not printed any more."""

    def __init__(self, block: Block, missing: str, printed: str):
        super().__init__(f"{block.where}: shown, but not printed: {missing!r}\nprinted was:\n{printed}")
        self.block, self.printed = block, printed


def refresh(page: Path, stale: Stale) -> None:
    """Write what is printed now into a page, in place of the block that is stale."""
    lines = page.read_text(encoding="utf-8").splitlines(keepends=True)
    first = stale.block.line
    last = first + len(stale.block.text.splitlines())
    lines[first:last] = [f"{line}\n" for line in refreshed(stale.block.text, stale.printed)]
    page.write_text("".join(lines), encoding="utf-8")


def refreshed(shown: str, printed: str) -> list[str]:
    """Return the lines of a block with each number as it is printed now.

    A block with words that are not printed any more becomes the output between the first and the last of its lines that
    still are, for somebody to shorten.
    """
    lines, at, made = printed.splitlines(), 0, []
    for line in shown.splitlines():
        wanted = _words(line)
        if not wanted or wanted == ["..."]:
            made.append(line)
            continue
        alike = (i for i in range(at, len(lines)) if _reads_alike(wanted, _words(lines[i])))
        found = next(alike, None)
        if found is None:
            return _part_that_was_shown(shown.splitlines(), [each.rstrip() for each in lines])
        is_shortened = wanted[-1] == "..."
        words = lines[found].rstrip()
        made.append(line if is_shortened and _alike(wanted, _words(words)) else words)
        at = found + 1
    return made


def _part_that_was_shown(shown: list[str], printed: list[str]) -> list[str]:
    """Return the printed lines between the first and the last that read like one of those shown."""
    wanted = [words for line in shown if (words := _words(line)) and words != ["..."]]
    alike = [k for k, line in enumerate(printed) if any(_reads_alike(words, _words(line)) for words in wanted)]
    return printed[alike[0] : alike[-1] + 1] if alike else printed


def _reads_alike(wanted: list[str], found: list[str]) -> bool:
    """Whether two lines have the same words, whatever their numbers."""
    if wanted[-1] == "...":
        wanted, found = wanted[:-1], found[: len(wanted) - 1]
    return [NUMBER.sub("#", word) for word in wanted] == [NUMBER.sub("#", word) for word in found]


NOTEBOOK = """
import ast, json, sys, traceback

names = {"__name__": "__main__"}
for request in sys.stdin:
    path, where = json.loads(request)
    try:
        tree = ast.parse(open(path, encoding="utf-8").read(), where)
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, where, "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), where, "eval"), names)
            if value is not None:
                print(repr(value))
        status = 0
    except BaseException:
        traceback.print_exc(file=sys.stdout)
        status = 1
    sys.stdout.flush()
    print(json.dumps({"ended": status}), file=sys.stderr, flush=True)
"""
"""A notebook: each request is a file of statements; the value of a last expression is printed."""


SHELL = """\
keep() {{
  declare -px
  printf 'cd %q\\nset -euo pipefail\\n' "$PWD"
}}
source {state}
trap 'keep > {state}' EXIT
{text}"""
"""A block in the shell: it begins with the variables and in the folder with which the block before it ended."""


class Reader:
    """Somebody who types a page's blocks into one shell and one notebook, in a folder of their own.

    The folder begins with a link to this Python's environment as `.venv`, as a clone has it after `make demo`, and with
    one to the clone's `examples`.
    """

    def __init__(self, folder: Path, settings: Path):
        self.folder, self.settings = folder, settings
        self.outside = folder / ".reader"
        self.outside.mkdir()
        (folder / ".venv").symlink_to(sys.prefix)
        (folder / "examples").symlink_to(Path(__file__).parents[2] / "examples")
        self.state = self.outside / "state"
        kept = ("PELLUCID_DATA", "OPENBLAS_CORETYPE", "CMAKE_CXX_COMPILER_LAUNCHER")
        self.environment = {
            "PATH": "/usr/local/bin:/usr/bin:/bin",
            "HOME": str(settings),
            "LANG": "C.UTF-8",
            "COLUMNS": str(TERMINAL_WIDTH),
            "PELLUCID_SETTINGS": str(settings),
            "OPENBLAS_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
            **{name: os.environ[name] for name in kept if name in os.environ},
        }
        self.state.write_text(f"cd {folder}\nset -euo pipefail\n", encoding="utf-8")
        self.notebook: subprocess.Popen | None = None
        self.printed = ""

    def close(self) -> None:
        """End the notebook."""
        if self.notebook is not None:
            with contextlib.suppress(BrokenPipeError):
                self.notebook.stdin.close()
            self.notebook.wait(60)
            self.notebook.stderr.close()

    def run(self, block: Block, timeout: float) -> None:
        """Run one block; a PageFailed says what was otherwise than its page says."""
        if "not run" in block.comment:
            return
        if any(shutil.which(tool) is None for tool in block.comment.get("needs", "").split()):
            return
        if block.language == "sh":
            self._shell(block, timeout)
        elif block.language == "python":
            self._python(block)
        elif block.language == "toml":
            self._lines(block)
        elif block.language == "text":
            missing = first_difference(block.text, self.printed)
            if missing is not None:
                raise Stale(block, missing, self.printed)
        else:
            raise PageFailed(f"{block.where}: a block of {block.language!r} says neither `not run` nor can it be run")

    def _shell(self, block: Block, timeout: float) -> None:
        script = self.outside / "block.sh"
        script.write_text(SHELL.format(state=self.state, text=block.text), encoding="utf-8")
        try:
            ended = subprocess.run(
                ["bash", "--noprofile", "--norc", "-euo", "pipefail", str(script)],
                env=self.environment, cwd=self.folder, stdin=subprocess.DEVNULL, timeout=timeout,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", errors="replace",
            )  # fmt: skip
        except subprocess.TimeoutExpired as error:
            raise PageFailed(f"{block.where}: not at its end after {timeout:.0f} s\n{error.stdout}") from None
        self.printed = without_progress(ended.stdout)
        expected = int(block.comment.get("status", 0))
        if ended.returncode != expected:
            raise PageFailed(f"{block.where}: status {ended.returncode}, expected {expected}\n{ended.stdout}")

    def _python(self, block: Block) -> None:
        if self.notebook is None:
            program = self.outside / "notebook.py"
            program.write_text(NOTEBOOK, encoding="utf-8")
            command = f'source {self.state}; exec python -u "$0"'
            with (self.outside / "printed").open("w") as printed:
                self.notebook = subprocess.Popen(
                    ["bash", "--noprofile", "--norc", "-euo", "pipefail", "-c", command, str(program)],
                    env={**self.environment, "MPLBACKEND": "agg"}, cwd=self.folder, encoding="utf-8",
                    stdin=subprocess.PIPE, stdout=printed, stderr=subprocess.PIPE,
                )  # fmt: skip
        path, printed = self.outside / "block.py", self.outside / "printed"
        path.write_text(block.text, encoding="utf-8")
        before = printed.stat().st_size
        self.notebook.stdin.write(json.dumps([str(path), block.where]) + "\n")
        self.notebook.stdin.flush()
        status, said = None, []
        for line in self.notebook.stderr:
            if line.startswith('{"ended"'):
                status = json.loads(line)["ended"]
                break
            said.append(line)
        self.printed = printed.read_bytes()[before:].decode("utf-8") + "".join(said)
        if status != 0:
            raise PageFailed(f"{block.where}: the statements end with an error\n{self.printed}")

    def _lines(self, block: Block) -> None:
        told = tomllib.loads(block.text)
        if "study" in block.comment:
            return
        if "into" not in block.comment:
            raise PageFailed(f"{block.where}: lines of a file, and no comment above them says of which")
        path = self.folder / block.comment["into"]
        before = tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(toml_text(merged(before, told)), encoding="utf-8")


def without_progress(printed: str) -> str:
    """Return what was printed without the lines on progress, which depend on the speed of the machine."""
    return "".join(line for line in printed.splitlines(keepends=True) if not PROGRESS_LINE.match(line))


def merged(before: dict[str, Any], added: dict[str, Any]) -> dict[str, Any]:
    """Return a file's content with lines added: tables key by key, recordings by their name."""
    result = dict(before)
    for key, value in added.items():
        old = result.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            result[key] = merged(old, value)
        elif isinstance(old, list) and isinstance(value, list) and all(isinstance(e, dict) for e in (*old, *value)):
            named = {entry.get("name"): entry for entry in value}
            kept = [merged(entry, named.pop(entry.get("name"), {})) for entry in old]
            result[key] = [*kept, *named.values()]
        else:
            result[key] = value
    return result


def toml_text(content: dict[str, Any]) -> str:
    """Return a mapping as TOML, each key of the first level in lines of its own."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in content.items())


def _key(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key, flags=re.ASCII) else json.dumps(key, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value)


def first_difference(shown: str, printed: str) -> str | None:
    """Return the first shown line that was not printed after those before it; None if all were.

    Spaces and rules of tables do not count, a line `...` stands for any lines, and `...` at a line's end for the rest
    of that line. Words must be the same; numbers may differ by 5 % or by one in the last place that is shown.
    """
    lines = [_words(line) for line in printed.splitlines()]
    at = 0
    for line in shown.splitlines():
        wanted = _words(line)
        if not wanted or wanted == ["..."]:
            continue
        while at < len(lines) and not _alike(wanted, lines[at]):
            at += 1
        if at == len(lines):
            return line
        at += 1
    return None


def _words(line: str) -> list[str]:
    return [word for word in line.split() if not re.fullmatch("[─━-]{3,}", word)]


def _alike(wanted: list[str], found: list[str]) -> bool:
    if wanted[-1] == "...":
        wanted = wanted[:-1]
        found = found[: len(wanted)]
    return len(wanted) == len(found) and all(map(_same, wanted, found))


def _same(wanted: str, found: str) -> bool:
    if NUMBER.sub("#", wanted) != NUMBER.sub("#", found):
        return False
    return all(map(_close, NUMBER.findall(wanted), NUMBER.findall(found)))


def _close(wanted: str, found: str) -> bool:
    a, b = (float(each.replace(",", "").replace("−", "-").rstrip("%")) for each in (wanted, found))
    places = len(wanted.rstrip("%").partition("e")[0].partition(".")[2])
    return abs(a - b) <= max(RELATIVE_TOLERANCE * abs(a), 1.001 * 10.0**-places)
