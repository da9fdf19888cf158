"""Examples in the docstrings of what is public run as they are written."""

import doctest
import inspect

import pytest

import pellucid

FOLDERS = {"assess", "calibrate", "check", "compare", "demo", "export", "identify", "init", "open", "report",
           "reproduce", "simulate"}  # fmt: skip
"""Verbs on a study's folder; the tutorials in docs/ run them."""
PARTS = [name for name in pellucid.__all__ if name not in FOLDERS | {"__version__", "datasets"}]


def examples_of(name: str) -> list[doctest.DocTest]:
    """Of a public function, or of a class and its public methods."""
    found = getattr(pellucid, name)
    every = [(name, found)]
    if inspect.isclass(found):
        every += [
            (f"{name}.{key}", member)
            for key, member in vars(found).items()
            if not key.startswith("_") and inspect.isfunction(member)
        ]
    parser = doctest.DocTestParser()
    return [
        parser.get_doctest(inspect.getdoc(member) or "", {}, key, inspect.getsourcefile(member), None)
        for key, member in every
    ]


@pytest.mark.parametrize("name", PARTS)
def test_examples_run(name):
    made = examples_of(name)
    assert made[0].examples, f"pellucid.{name} has no example"
    for each in made:
        said = []
        outcome = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(each, out=said.append)
        assert outcome.failed == 0, "".join(said)
