"""Examples in the docstrings of what is public run as they are written."""

import doctest
import inspect

import numpy as np
import pytest

import pellucid

NAMES = [name for name in dir(pellucid) if name not in ("__version__", "datasets")]
IN_TURN = ("open", "check", "identify", "report", "compare", "export")
"""Verbs on one study, in the order in which each finds what the one before it left."""
STUDY = """
name = "my-elbow"
[rig]
joint = "elbow"
motion = "rotary"
[rig.drive]
kind = "torque"
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "tau", unit = "N*m" }
[processing]
lowpass = "20 Hz"
[[recordings]]
name = "slow"
file = "recordings/slow.csv"
[[recordings]]
name = "fast"
file = "recordings/fast.csv"
use = "validate"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where examples run: a folder with a study ``my-elbow``."""
    made = tmp_path_factory.mktemp("examples")
    (made / "my-elbow" / "recordings").mkdir(parents=True)
    (made / "my-elbow" / "study.toml").write_text(STUDY, encoding="utf-8")
    rng, t = np.random.default_rng(5), np.arange(5000) / 250.0
    for name, scale in (("slow", 1.0), ("fast", 1.3)):
        parts = [(0.5, 0.13 * scale, 0.0), (0.3, 0.47 * scale, 1.0), (0.15, 1.1 * scale, 2.0)]
        q = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in parts)
        v = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + p) for a, f, p in parts)
        acc = -sum(a * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * t + p) for a, f, p in parts)
        tau = 0.2 * acc + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.1 * v + 0.02 * rng.standard_normal(len(t))
        path = made / "my-elbow" / "recordings" / f"{name}.csv"
        np.savetxt(path, np.c_[t, q, tau], delimiter=",", header="t,q,tau", comments="", fmt="%.9f")
    return made


def examples_of(name: str) -> list[doctest.DocTest]:
    """Of a public function, or of a class and its public methods."""
    found = getattr(pellucid, name)
    every = [(name, found)]
    if inspect.isclass(found):
        every += [
            (f"{name}.{key}", getattr(found, key))
            for key, member in vars(found).items()
            if not key.startswith("_") and (inspect.isfunction(member) or isinstance(member, staticmethod))
        ]
    parser = doctest.DocTestParser()
    return [
        parser.get_doctest(inspect.getdoc(member) or "", {}, key, inspect.getsourcefile(member), None)
        for key, member in every
    ]


def run(name: str) -> None:
    made = examples_of(name)
    assert made[0].examples, f"pellucid.{name} has no example"
    for each in made:
        said = []
        outcome = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(each, out=said.append)
        assert outcome.failed == 0, "".join(said)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in IN_TURN])
def test_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(name)


@pytest.mark.parametrize("name", IN_TURN)
def test_examples_on_a_study_run_in_turn(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    run(name)
