"""Mutants of source text by rule: comparisons, signs, bounds, factors and operands, in C++ and in Python.

A mutant is a text patch: a place in a file and its replacement. Comments, strings, messages, descriptions of fields
and headers of loops are excluded. So are counters that stop at the largest 32-bit number, because no test runs long
enough to reach it.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

FACTORS = ("1.5", "2", "0.5")
"""Factors by which a constant or a threshold is changed."""

FLIPPED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "!=", "!=": "=="}
"""Each comparison and its opposite direction."""

CLOSED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
"""Each inequality and the one that treats equality the other way."""

SATURATED = re.compile(r"0xffff[0-9a-f]{4}u")
"""Largest value of a counter."""


@dataclass(frozen=True)
class Mutant:
    """A text patch of a file."""

    file: str  # path from the root of the repository
    start: int  # first character that is replaced
    end: int  # character after the last that is replaced
    text: str  # what stands there instead
    rule: str  # rule that made it

    def applied(self, source: str) -> str:
        """Return the mutated source."""
        return source[: self.start] + self.text + source[self.end :]

    def line(self, source: str) -> str:
        """Return the line of the source at which the patch begins, without blanks at its ends."""
        begin = source.rfind("\n", 0, self.start) + 1
        end = source.find("\n", self.start)
        return source[begin : len(source) if end < 0 else end].strip()

    def described(self, source: str) -> str:
        """Return file, line and change in one line."""
        number = source.count("\n", 0, self.start) + 1
        was = " ".join(source[self.start : self.end].split())
        return f"{self.file}:{number} [{self.rule}] {was!r} -> {' '.join(self.text.split())!r} in: {self.line(source)}"


def mutants_of(file: str, source: str, functions: frozenset[str] | None = None) -> list[Mutant]:
    """Return every mutant of a file, in the order of places; of Python only those in `functions` and constants."""
    made = cpp_mutants(file, source) if file.endswith(".hpp") else python_mutants(file, source, functions)
    unique = {(m.start, m.end, m.text): m for m in made if source[m.start : m.end] != m.text}
    return sorted(unique.values(), key=lambda m: (m.start, m.end, m.text))


# --- C++ ------------------------------------------------------------------------------------------------------------


def masked(source: str) -> str:
    """Return C++ source of the same length in which everything that is no code of a function is blank."""

    def blank(match: re.Match) -> str:
        return re.sub(r"[^\n]", " ", match.group())

    text = re.sub(r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])'", blank, source, flags=re.DOTALL)
    text = re.sub(r"^\s*#[^\n]*|\btemplate <[^\n]*?>(?= )|\bstatic_assert\([^;]*;", blank, text, flags=re.MULTILINE)
    for opening, bracket in ((r"static constexpr void walk\(", "{"), (r"\bfor \(", "("), (r"enum class [^{]*", "{")):
        for match in re.finditer(opening, text):
            begin = text.index(bracket, match.start())
            end = _closing(text, begin)
            text = text[: begin + 1] + blank(re.compile(r".*", re.DOTALL).match(text[begin + 1 : end])) + text[end:]
    return text


def _closing(text: str, begin: int) -> int:
    depth = 0
    for i in range(begin, len(text)):
        depth += text[i] in "([{"
        depth -= text[i] in ")]}"
        if depth == 0:
            return i
    return len(text)


BREAK = re.compile(r"&&|\|\||[?,;]|(?<!:):(?!:)|(?<![=!<>+\-*/])=(?!=)|\breturn\b")
"""What ends an operand of a comparison."""


def _operand(text: str, at: int, step: int, stops: re.Pattern = BREAK) -> int:
    """Return where the operand that begins or ends at a place ends or begins."""
    depth, i = 0, at if step > 0 else at - 1
    while 0 <= i < len(text):
        if text[i] in ("([{" if step > 0 else ")]}"):
            depth += 1
        elif text[i] in (")]}" if step > 0 else "([{"):
            if depth == 0:
                break
            depth -= 1
        elif depth == 0 and (found := _stop_at(text, i, stops)):
            return found.start() if step > 0 else found.end()
        i += step
    return i if step > 0 else i + 1


def _stop_at(text: str, i: int, stops: re.Pattern) -> re.Match | None:
    for begin in range(max(i - 5, 0), i + 1):
        found = stops.match(text, begin)
        if found and found.start() <= i < found.end():
            return found
    return None


def _trimmed(text: str, start: int, end: int) -> tuple[int, int]:
    while start < end and text[start].isspace():
        start += 1
    while end > start and text[end - 1].isspace():
        end -= 1
    return start, end


def _arguments(text: str, opening: int) -> list[tuple[int, int]]:
    """Return the places of a call's arguments."""
    end, depth, begin, places = _closing(text, opening), 0, opening + 1, []
    for i in range(opening + 1, end):
        depth += text[i] in "([{"
        depth -= text[i] in ")]}"
        if text[i] == "," and depth == 0:
            places.append(_trimmed(text, begin, i))
            begin = i + 1
    return [*places, _trimmed(text, begin, end)]


def cpp_mutants(file: str, source: str) -> Iterator[Mutant]:
    """Yield the mutants of a header."""
    text = masked(source)

    def patch(start: int, end: int, new: str, rule: str) -> Iterator[Mutant]:
        mutant = Mutant(file, start, end, new, rule)
        if not SATURATED.search(mutant.line(source)):
            yield mutant

    for match in re.finditer(r" (<=|>=|==|!=|<|>) ", text):
        operator, start, end = match.group(1), match.start(1), match.end(1)
        yield from patch(start, end, FLIPPED[operator], "comparison flipped")
        if operator in CLOSED:
            yield from patch(start, end, CLOSED[operator], "equality")
        left, right = _operand(text, match.start(), -1), _operand(text, match.end(), 1)
        left, right = _trimmed(text, left, right)
        for constant in ("true", "false"):
            yield from patch(left, right, constant, "comparison constant")
        begin, stop = _trimmed(text, match.end(), right)
        threshold = source[begin:stop]
        if operator in CLOSED and not re.fullmatch(r"S\([0-9.e-]+\)|[0-9.]+[fu]?|0[xX]\w+|Mode::\w+", threshold):
            for new in (f"(3 * ({threshold}) / 2)", f"(2 * ({threshold}))", f"(({threshold}) / 2)"):
                yield from patch(begin, stop, new, "threshold")
    for match in re.finditer(r" ([+-]) ", text):
        yield from patch(match.start(1), match.end(1), "-" if match.group(1) == "+" else "+", "sign")
    for match in re.finditer(r"(?<=[(,=?:] )-(?=[\w(])|(?<=[(])-(?=[\w(])|(?<=return )-(?=[\w(])", text):
        yield from patch(match.start(), match.end(), "", "negation")
    for match in re.finditer(r"(?<![\w:])abs\(", text):
        yield from patch(match.start(), match.end(), "(", "size to signed")
    for match in re.finditer(r"!(?=[(\w])", text):
        yield from patch(match.start(), match.end(), "", "negation")
    for match in re.finditer(r"\bS\(([0-9][0-9.e-]*)\)", text):
        if float(match.group(1)):
            for factor in FACTORS:
                yield from patch(match.start(), match.end(), f"S({match.group(1)} * {factor})", "factor")
    for match in re.finditer(r"(?<=[=<>] )([0-9]+(?:\.[0-9]+)?)(?=[,; )])", text):
        number = float(match.group(1))
        if number > 1.0 or "." in match.group(1):
            for factor in FACTORS:
                value = number * float(factor)
                yield from patch(*match.span(1), f"{value:g}" if "." in match.group(1) else f"{int(value)}", "factor")
    for match in re.finditer(r"(?<![\w:])(clamp|min|max)\(", text):
        places = _arguments(text, match.end() - 1)
        words = [source[a:b] for a, b in places]
        end = _closing(text, match.end() - 1) + 1
        if match.group(1) == "clamp" and len(words) == 3:
            yield from patch(match.start(), end, f"min<S>({words[0]}, {words[2]})", "bound dropped")
            yield from patch(match.start(), end, f"max<S>({words[0]}, {words[1]})", "bound dropped")
        elif len(words) == 2 and text[match.start() - 2 : match.start()] != "::":
            for word in words:
                yield from patch(match.start(), end, f"({word})", "bound dropped")
    for match in re.finditer(r"&&|\|\|", text):
        stops = BREAK if match.group() == "&&" else re.compile(BREAK.pattern.replace(r"&&|", "", 1))
        start = _trimmed(text, _operand(text, match.start(), -1, stops), match.start())[0]
        end = _trimmed(text, match.end(), _operand(text, match.end(), 1, stops))[1]
        yield from patch(match.start(), end, "", "operand dropped")
        yield from patch(start, match.end(), "", "operand dropped")


# --- Python ---------------------------------------------------------------------------------------------------------


def python_mutants(file: str, source: str, functions: frozenset[str] | None) -> Iterator[Mutant]:
    """Yield the mutants of a module: of its constants, of fields of its classes, and of `functions`."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    lines = source.splitlines(keepends=True)

    def place(line: int, column: int) -> int:
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    def span(node: ast.AST) -> tuple[int, int]:
        return place(node.lineno, node.col_offset), place(node.end_lineno, node.end_col_offset)

    def said(node: ast.AST) -> str:
        return source[slice(*span(node))]

    def patch(node: ast.AST, new: str, rule: str) -> Mutant:
        return Mutant(file, *span(node), f"({new})", rule)

    def walked(node: ast.AST) -> Iterator[ast.AST]:
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Subscript) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        ):
            return
        if isinstance(node, ast.keyword) and node.arg == "strict":
            return
        yield node
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from walked(child)

    def of(node: ast.AST) -> Iterator[Mutant]:
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            left, right = said(node.left), said(node.comparators[0])
            words = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
            operator = words.get(type(node.ops[0]))
            if operator is None:
                return
            yield patch(node, f"{left} {FLIPPED[operator]} {right}", "comparison flipped")
            if operator in CLOSED:
                yield patch(node, f"{left} {CLOSED[operator]} {right}", "equality")
                if right not in ("0", "0.0"):
                    for factor in FACTORS:
                        yield patch(node.comparators[0], f"{factor} * ({right})", "threshold")
            for constant in ("True", "False"):
                yield patch(node, constant, "comparison constant")
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            sign = "-" if isinstance(node.op, ast.Add) else "+"
            yield patch(node, f"{said(node.left)} {sign} ({said(node.right)})", "sign")
        elif isinstance(node, ast.UnaryOp):
            yield patch(node, said(node.operand), "negation")
        elif isinstance(node, ast.BoolOp):
            for value in node.values:
                yield patch(node, said(value), "operand dropped")
        elif isinstance(node, ast.Call) and said(node.func) in ("min", "max", "abs", "np.abs", "np.maximum"):
            rule = "size to signed" if len(node.args) == 1 else "bound dropped"
            for argument in node.args:
                yield patch(node, said(argument), rule)
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value:
            for factor in FACTORS:
                value = type(node.value)(node.value * float(factor))
                if value != node.value:
                    yield patch(node, repr(value), "factor")
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            yield patch(node, str(not node.value), "constant")
        elif isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                measures = isinstance(value, ast.Name | ast.Attribute | ast.Subscript | ast.BinOp)
                if key is not None and measures and said(value) != "math.inf":
                    for factor in FACTORS:
                        yield patch(value, f"{factor} * ({said(value)})", "factor")

    for statement in ast.parse(source).body:
        is_code = isinstance(statement, ast.FunctionDef)
        if is_code and functions is not None and statement.name not in functions:
            continue
        if isinstance(statement, ast.ClassDef):
            nodes = [part for part in statement.body if isinstance(part, ast.AnnAssign)]
        elif isinstance(statement, ast.FunctionDef | ast.Assign | ast.AnnAssign):
            nodes = [statement]
        else:
            continue
        if isinstance(statement, ast.ClassDef) and functions is not None and statement.name not in functions:
            continue
        for node in nodes:
            for part in walked(node):
                yield from of(part)
