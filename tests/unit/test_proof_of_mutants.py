"""The proof that tests notice broken safety code: its rules, a mutant that is told from none, and a dozen a night."""

import subprocess
from pathlib import Path

import pytest
from research.evidence import mutants
from research.evidence._source_mutants import Mutant, mutants_of

HEADER = """
// a < b in a comment
template <class S> S step(const S& p, S x) noexcept {
  static_assert(sizeof(S) < 9, "short");
  for (int k = 0; k < 3; ++k) x = x + p;
  if (!(abs(x) <= p.limit) && x > S(0)) return S(0.5) * clamp(x, -p.low, p.high);
  return x - p < S(2) ? "a < b" : x;
}
"""

MODULE = '''
"""A docstring with 3 numbers."""
SHARE = 0.5
"""Share of 2 things."""


def limit(x: float) -> float:
    """Return 1 limit."""
    if x < 0.0 or not x:
        raise ValueError(f"found {x + 1}")
    return max(abs(x), SHARE - 1.0)


def other():
    return 7
'''


def changes(file, source, functions=None):
    return {m.applied(source) for m in mutants_of(file, source, functions)}


@pytest.mark.parametrize(
    "mutated",
    [
        HEADER.replace("abs(x) <= p.limit", "abs(x) < p.limit"),
        HEADER.replace("abs(x) <= p.limit", "abs(x) >= p.limit"),
        HEADER.replace("abs(x) <= p.limit", "true"),
        HEADER.replace("abs(x) <= p.limit", "abs(x) <= (2 * (p.limit))"),
        HEADER.replace("abs(x)", "(x)"),
        HEADER.replace("!(abs", "(abs"),
        HEADER.replace(" && x > S(0)", " "),
        HEADER.replace("S(0.5)", "S(0.5 * 1.5)"),
        HEADER.replace("clamp(x, -p.low, p.high)", "min<S>(x, p.high)"),
        HEADER.replace("clamp(x, -p.low, p.high)", "max<S>(x, -p.low)"),
        HEADER.replace("-p.low", "p.low"),
        HEADER.replace("x = x + p", "x = x - p"),
        HEADER.replace("x - p < S(2)", "false"),
    ],
)
def test_what_is_mutated_in_a_header(mutated):
    assert mutated in changes("one.hpp", HEADER)


def test_what_is_left_alone_in_a_header():
    made = changes("one.hpp", HEADER)
    assert all("// a < b in a comment" in text and '"a < b"' in text for text in made)
    assert all("sizeof(S) < 9" in text and "k < 3; ++k" in text for text in made)


def test_what_is_mutated_in_a_module():
    made = changes("one.py", MODULE, frozenset({"limit"}))
    for old, new in (("SHARE = 0.5", "SHARE = (0.75)"), ("x < 0.0", "(x <= 0.0)"), ("not x", "(x)"),
                     ("x < 0.0 or not x", "(not x)"), ("max(abs(x), SHARE - 1.0)", "(abs(x))"), ("abs(x)", "(x)"),
                     ("SHARE - 1.0", "(SHARE + (1.0))"), ("- 1.0", "- (2.0)")):  # fmt: skip
        assert MODULE.replace(old, new) in made, new
    assert all("return 7" in text and "{x + 1}" in text and "Share of 2" in text for text in made)


def test_a_mutant_that_a_test_sees_is_told_from_one_that_changes_nothing(tmp_path):
    file = "include/pellucid/watchdog.hpp"
    source = mutants.source_of(file)
    at = source.index("w.silent <= patience")
    broken = Mutant(file, at, at + len("w.silent <= patience"), "true", "comparison constant")
    same = Mutant(file, at, at, " ", "blank")
    wrong = Mutant(file, at, at, "no such name ", "does not compile")
    assert [mutants.judge(one, tmp_path).killed_by for one in (broken, same, wrong)] == ["watchdog", "", "invalid"]


def test_every_file_has_mutants_and_tests_that_judge_it():
    files = {Path(m.file).stem for m in mutants.all_mutants()}
    assert files == set(mutants.JUDGES) | set(mutants.PYTHON_JUDGES)
    core, unit = mutants.ROOT / "tests" / "core", mutants.ROOT / "tests" / "unit"
    assert all((core / f"{test}_test.cpp").is_file() for tests in mutants.JUDGES.values() for test in tests)
    assert all((unit / f"{test}.py").is_file() for _, tests in mutants.PYTHON_JUDGES.values() for test in tests)


@pytest.mark.nightly
def test_a_dozen_mutants_that_the_commit_draws_are_killed():
    """At most one of twelve survives without a stated reason, and every reason is of a mutant that there is."""
    for each in mutants.EQUIVALENT:
        assert any(mutants.is_one_of(mutant, each) for mutant in mutants.all_mutants()), each
    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=mutants.ROOT, capture_output=True, text=True, check=False)
    seed = int(commit.stdout.strip() or "0", 16)
    verdicts = mutants.judged(mutants.all_mutants(), 12, seed)
    survivors = [v.mutant for v in verdicts if not v.killed_by and not mutants.reason_of(v.mutant)]
    assert len(verdicts) == 12
    assert len(survivors) <= 1, "\n".join(map(mutants.described, survivors))
