"""Figures that mean something on every machine: the chosen family's agree, and those left to chance say so."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pellucid as pl
from pellucid.joint.fit.friction_family import _perturb, find_undetermined, mark_undetermined
from pellucid.joint.fit.friction_solver import solve_family
from pellucid.joint.study.aligned_motions import aligned_motions
from pellucid.models.joint import joint_model
from pellucid.numerics.regression import stack
from pellucid.study.pages.quantities import parameter_note
from pellucid.study.results import read_rows

KERNELS = {"Haswell": "avx2", "SkylakeX": "avx512f", "Nehalem": "sse4_2"}
"""Kernels of OpenBLAS, and the processor's feature that each needs: without it the process dies."""

IDENTIFY = """
import json, sys
import pellucid as pl
found = pl.identify(pl.open(sys.argv[1]), families=["symmetric", "directional"])
print(json.dumps({row.id: row.value for row in found.rows if not row.undetermined}))
"""


def with_friction_that_grows(columns):
    """Friction that only grows with speed, seen from above: no more of it at rest, so that a Stribeck level is 0."""
    v = np.gradient(columns["q"], columns["t"])
    columns["i"] = (
        columns["i"] - 0.2 * np.tanh(v / 0.05) / 2.0 + (0.2 - 0.1 * np.exp(-np.abs(v) / 0.5)) * np.sign(v) / 2.0
    )
    return columns


@pytest.fixture
def data(make_study):
    return stack(aligned_motions(make_study(), "fit"))


def test_what_the_recordings_carry_is_determined(data):
    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")
    found = solve_family(model, data)
    assert find_undetermined(model, data, found, np.full(len(found.values), 1e-6)) == frozenset()


def test_two_columns_that_are_one_are_left_to_chance(data):
    """An interval that is given narrower than what rounding moves is not one."""
    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")
    found = solve_family(model, data)
    moved = found.values.copy()
    moved[1] += 1e-3
    wrong = replace(found, values=moved)
    assert find_undetermined(model, data, wrong, np.full(len(moved), 1e-4)) == {model.names[1]}
    changed = _perturb(data, np.random.default_rng(1))
    assert 0.0 < np.abs(changed.target - data.target).max() < 1e-10 * np.abs(data.target).max()


def test_without_a_stribeck_level_rounding_moves_no_interval(make_study):
    """All Stribeck velocities are alike then: which of them stays must not be left to the last digits of a cost."""
    recorded = stack(aligned_motions(make_study(with_friction_that_grows(make_study.swing())), "fit"))
    model = joint_model("combined", motion="rotary", effort_unit="N*m", gravity="sine")
    at = model.names.index("stribeck")
    met = set()
    for seed in range(6):
        found = solve_family(model, _perturb(recorded, np.random.default_rng(seed)))
        assert found.values[at] == 0.0
        met.add(round(float(found.values[model.names.index("stribeck_velocity")]), 9))
    assert len(met) == 1


@pytest.mark.slow
def test_what_has_no_effect_is_undetermined_in_rows_and_on_pages(make_study):
    study = make_study(with_friction_that_grows(make_study.swing()))
    found = pl.identify(study, families=["symmetric", "stribeck"])
    found.save(study)
    family = found.families["stribeck"].estimate
    velocity = family["stribeck_velocity"]
    assert family["stribeck"].value == 0.0
    assert velocity.undetermined
    assert parameter_note(velocity, 0.95) == "undetermined"
    rows = {row.id: row for row in read_rows(study.results_path)}
    assert rows["bench.stribeck.stribeck_velocity"].undetermined
    assert rows["bench.stribeck.wls.stribeck"].undetermined
    assert not any(row.undetermined for id, row in rows.items() if ".symmetric." in id)
    told = json.loads(study.results_path.read_text())["figures"]
    assert [f["undetermined"] for f in told if f["id"] == "bench.stribeck.stribeck_velocity"] == [True]
    assert not any("undetermined" in f for f in told if f["id"].startswith("bench.symmetric"))
    assert "undetermined" in pl.report(study, found).read_text(encoding="utf-8")
    assert not any(p.undetermined for p in mark_undetermined(family.parameters[:1], frozenset()))


def runnable_kernels():
    """Return the kernels whose instructions this processor has; all of them where it does not say what it has."""
    cpuinfo = Path("/proc/cpuinfo")
    text = cpuinfo.read_text(encoding="utf-8") if cpuinfo.is_file() else ""
    features = next((set(line.split()) for line in text.splitlines() if line.startswith("flags")), None)
    return [kernel for kernel, feature in KERNELS.items() if features is None or feature in features]


@pytest.mark.nightly
@pytest.mark.slow
def test_the_chosen_familys_figures_agree_on_every_kernel(make_study):
    kernels = runnable_kernels()
    if len(kernels) < 2:
        pytest.skip(f"this processor runs {len(kernels)} of the kernels {', '.join(KERNELS)}: nothing to compare")
    study, told = make_study(make_study.swing(1000)), {}
    for kernel in kernels:
        environment = os.environ | {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
        run = subprocess.run(
            [sys.executable, "-c", IDENTIFY, str(study.folder)], capture_output=True, text=True, env=environment
        )
        assert run.returncode == 0, run.stderr
        told[kernel] = json.loads(run.stdout)
    first = told[kernels[0]]
    chosen = [id for id in first if ".headline." in id or id.startswith("bench.symmetric.")]
    assert len(chosen) > 20
    for id in chosen:
        values = [told[kernel][id] for kernel in kernels]
        assert values == pytest.approx([first[id]] * len(kernels), rel=1e-6, abs=1e-12, nan_ok=True), id
