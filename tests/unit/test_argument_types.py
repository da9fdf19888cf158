"""Every public function refuses arguments of other types with a PellucidError, never with an error from within."""

import inspect
import warnings

import numpy as np
import pytest

import pellucid as pl

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
