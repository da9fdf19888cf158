"""The published comparison on a virtual elbow: every model over the paper's trials and over held-out ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import ttest_rel

from pellucid.joint.slider.slider_fit import SLIDER_METHODS, SliderFit
from pellucid.joint.slider.study.identify_slider import directional_friction, fit_slider

from ...elbow.protocol import ElbowTrial, trials
from ...elbow.rig import ElbowRig
from ...processes import ordered_results
from ...study import record_in_memory

TRIAL_PREFIXES = {
    "published": ("constant_", "sweep_", "slow_"),
    "unseen": ("unseen_constant_", "unseen_sweep_", "unseen_slow_"),
}
"""Prefixes of the trials' names in each set: the paper's 18 trials, 12 of them fitted, and 18 that are held out."""

COMPARED_PROTOCOLS = ("constant_velocity", "swept_sine", "slow")
"""Protocols that enter the comparison; holds, and the excitation of all parameters at once, do not."""


@dataclass(frozen=True)
class ModelComparison:
    """Comparison of all models on the recordings of one rig with one seed."""

    rig: str
    seed: int
    recordings: dict[str, tuple[str, ...]]  # Names of the 18 trials of each set of `TRIAL_PREFIXES`
    # Mean absolute current error of each trial, shape (18,) [A], by set and then by method
    errors: dict[str, dict[str, np.ndarray]]
    torque_errors: dict[str, dict[str, np.ndarray]]  # Mean absolute torque error, shape (18,) [N*m], likewise
    # Largest gravity error over the workspace, over the largest gravity torque, for "consistent" and "load"
    gravity_error: dict[str, float]
    inertia_error: dict[str, float]  # Largest relative inertia error over the rail, for the same two
    slider_error: float  # Largest error of a carriage's position [m]
    implied_friction: tuple[float, float]  # Smallest and largest friction at rest of the dissociated model [N*m]
    least_inertia: float  # Smallest inertia of the dissociated model on the rail [kg*m^2]
    parameters: dict[str, dict[str, float]]  # Parameters by method and then by name, in SI units

    def mean(self, which: str, method: str) -> float:
        """Return the mean current error over the 18 trials of a set [A]."""
        return float(self.errors[which][method].mean())

    def ratio(self, which: str, over: str, under: str) -> float:
        """Return the mean error of method `over` divided by that of method `under`."""
        return self.mean(which, over) / self.mean(which, under)

    def p_value(self, which: str) -> float:
        """Return the two-sided p-value of the paired t-test between the pooled and the dissociated model."""
        return float(ttest_rel(self.errors[which]["pooled"], self.errors[which]["dissociated"]).pvalue)


def numbered_names(names: Sequence[str], prefixes: Sequence[str]) -> tuple[str, ...]:
    """Return the names that consist of one of `prefixes` and a number."""
    return tuple(n for prefix in prefixes for n in names if n.startswith(prefix) and n[len(prefix) :].isdigit())


def compare_models(rig: ElbowRig, seed: int, made: tuple[ElbowTrial, ...]) -> tuple[ModelComparison, SliderFit]:
    """Record the protocol on a rig, identify, and evaluate."""
    config, recordings, taken = record_in_memory(rig, made, seed=seed)
    fit = fit_slider(config, recordings)
    by_name = {m: {e.recording: e for e in fit.errors[m]} for m in SLIDER_METHODS}
    sets = {which: numbered_names(tuple(by_name["pooled"]), prefixes) for which, prefixes in TRIAL_PREFIXES.items()}
    x, q = np.linspace(*fit.rail, 7), np.linspace(rig["range"]["low"], rig["range"]["high"], 41)
    true_gravity = np.array([rig.gravity(s)[0] * np.sin(q) + rig.gravity(s)[1] * np.cos(q) for s in x])
    true_inertia = np.array([rig.inertia(s) for s in x])
    gravity_error, inertia_error = {}, {}
    for method in ("consistent", "load"):
        estimate = fit[method]
        gravity = estimate.model.gravity(estimate.values, x[:, None], q[None, :])
        gravity_error[method] = float(np.abs(gravity - true_gravity).max() / np.abs(true_gravity).max())
        inertia = estimate.model.inertia(estimate.values, x)
        inertia_error[method] = float(np.abs(inertia / true_inertia - 1.0).max())
    model = fit["dissociated"].model
    friction = directional_friction(model, x, q)
    true_place = {one.trial.name: one.trial.slider for one in taken}
    comparison = ModelComparison(
        rig=rig.name,
        seed=seed,
        recordings=sets,
        errors={
            w: {m: np.array([by_name[m][n].current for n in names]) for m in SLIDER_METHODS}
            for w, names in sets.items()
        },
        torque_errors={
            w: {m: np.array([by_name[m][n].torque for n in names]) for m in SLIDER_METHODS} for w, names in sets.items()
        },
        gravity_error=gravity_error,
        inertia_error=inertia_error,
        slider_error=max(abs(p.slider - true_place[p.recording]) for p in fit.geometry.placements),
        implied_friction=(float(friction.min()), float(friction.max())),
        least_inertia=min(float(model.inertia(d, x).min()) for d in ("up", "down")),
        parameters={m: {p.name: p.value for p in e.parameters} for m, e in fit.estimates.items()},
    )
    return comparison, fit


def _one(rig: ElbowRig, seed: int) -> ModelComparison:
    return compare_models(rig, seed, tuple(t for t in trials(rig) if t.protocol in COMPARED_PROTOCOLS))[0]


def compare_many(
    jobs: Sequence[tuple[ElbowRig, int]], workers: int | None, tell: Callable[[int, int], None]
) -> list[ModelComparison]:
    """Return `compare_models` of many rigs and seeds, computed in processes, in the order of the jobs."""
    return ordered_results([(_one, *job) for job in jobs], workers, tell)
