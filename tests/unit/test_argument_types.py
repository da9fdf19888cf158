"""Every public function refuses arguments of other types with a PellucidError, never with an error from within."""

import inspect
import warnings

import numpy as np
import pytest

import pellucid as pl
from pellucid.models.estimates import Parameter

ODD = {
    "None": None, "integer": 3, "float": 2.5, "text": "x", "bytes": b"x", "truth value": True, "list": [],
    "texts": ["a", "b"], "mapping": {}, "object": object(), "column": np.zeros(3), "complex": np.zeros(3, complex),
    "objects": np.array([object()] * 3), "not a number": float("nan"), "set": {1}, "function": len, "type": int,
    "dates": np.array(["2020-01-01"] * 3, "M8[D]"), "masked": np.ma.masked_all(3),
}  # fmt: skip
OWN_CHECKS = ("datasets", "demo", "predict", "reproduce", "simulate")
"""Names of the lab, which write folders, and a module."""
FUNCTIONS = [name for name in dir(pl) if inspect.isfunction(getattr(pl, name)) and name not in OWN_CHECKS]


@pytest.mark.parametrize("kind", ODD)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_wrong_type_is_a_pellucid_error(name, kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function = getattr(pl, name)
    every = inspect.signature(function).parameters.values()
    needed = [p for p in every if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    given = {p.name: ODD[kind] for p in needed}
    if not given:
        return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            function(**given)
    except pl.PellucidError:
        pass

@pytest.mark.parametrize(
    ("options", "told"),
    [({"lowpas": 10.0}, 'is "lowpass" meant?'), ({}, "lowpass"), ({"lowpass": 10.0, "frictoin": "auto"}, '"friction"')],
)
def test_a_missing_or_misspelt_argument_is_named(options, told):
    with pytest.raises(pl.PellucidError, match=f"fit_joint: .*{told}".replace("?", r"\?")):
        pl.fit_joint(np.arange(9.0), np.zeros(9), np.zeros(9), **options)


def test_a_sequence_may_hold_arrays_of_different_lengths():
    parts = [np.full((length, 2), 1e-4) * np.cos(np.arange(length))[:, None] for length in (6000, 5000)]
    assert np.isfinite(pl.maximal_envelope(parts, rate=2000.0, chain="hill")).all()


@pytest.mark.parametrize("level", [95, 0.0, 1.0, -0.5, float("nan")])
def test_a_level_of_an_interval_is_a_share(level):
    with pytest.raises(pl.PellucidError, match="between 0 and 1"):
        Parameter("inertia", "kg*m^2", 0.1, 0.01).interval(level)
