"""A fit made up from a seed, with every part a real one may have: what the report and the command line are tried on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pellucid import _core
from pellucid.joint.fit.friction_family import FamilyFit
from pellucid.joint.fit.headline_choice import HeadlineChoice
from pellucid.joint.fit.joint_estimate import JointEstimate
from pellucid.joint.fit.replay import Prediction, Simulation
from pellucid.joint.study.joint_result import JointResult, Trace
from pellucid.models.estimates import Parameter, Verdict, Whiteness
from pellucid.models.joint import joint_model
from pellucid.numerics.motion import Filtering
from pellucid.study.procedures.registry import open_study
from pellucid.study.study import Study

TRUTH = {
    "prismatic": {
        "inertia": 95.1, "offset": -3.2, "viscous": 203.0, "viscous_positive": 167.0, "viscous_negative": 240.0,
        "coulomb": 20.4, "coulomb_positive": 20.1, "coulomb_negative": 20.6, "stribeck": 4.0,
        "stribeck_velocity": 0.006, "load_friction": 0.04,
    },
    "rotary": {
        "inertia": 0.0076, "gravity": 0.55, "offset": 0.004, "viscous": 0.0033, "viscous_positive": 0.0026,
        "viscous_negative": 0.0041, "coulomb": 0.031, "coulomb_positive": 0.030, "coulomb_negative": 0.033,
        "stribeck": 0.012, "stribeck_velocity": 0.15, "load_friction": 0.11, "load_motoring": 0.14,
        "load_generating": 0.07,
    },
}  # fmt: skip
METHODS = ("wls", "irls", "iv", "didim", "output_error")


def study(folder: Path, made: JointResult) -> Study:
    """A study on disk that could have led to a fit: study.toml, and a CSV for every recording it predicts."""
    folder = Path(folder)
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    unit, channel = {"prismatic": ("m", "force"), "rotary": ("rad", "torque")}[made.motion]
    effort = {"prismatic": "N", "rotary": "N*m"}[made.motion]
    lines = [
        f'name = "{made.study}"', "[rig]", 'joint = "bench"', f'motion = "{made.motion}"', f'lifts = "{made.lifts}"',
        "[rig.drive]", 'kind = "torque"', "[channels]", 'time = { column = "t", unit = "s" }',
        f'position = {{ column = "q", unit = "{unit}" }}', f'{channel} = {{ column = "u", unit = "{effort}" }}',
        "[processing]", 'lowpass = "20 Hz"',
    ]  # fmt: skip
    for p in made.families[made.best].predictions:
        table = np.c_[p.time, p.position, p.effort]
        np.savetxt(
            folder / "recordings" / f"{p.recording}.csv", table, delimiter=",", header="t,q,u", comments="", fmt="%.9g"
        )
        use = {"fitted": "fit", "heldout": "validate"}[p.split]
        lines += [
            "[[recordings]]", f'name = "{p.recording}"', f'file = "recordings/{p.recording}.csv"', f'use = "{use}"',
        ]  # fmt: skip
    (folder / "study.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return open_study(folder)


def fit(
    *,
    name: str = "bench",
    motion: str = "prismatic",
    families: tuple[str, ...] = ("symmetric", "directional", "load", "stribeck"),
    fitted: int = 1,
    heldout: int = 1,
    samples: int = 1200,
    seed: int = 7,
    others: bool = True,
    simulated: bool = True,
    effort_unit: str | None = None,
) -> JointResult:
    """A fit of a made-up joint: consistent signals, predictions off by coloured noise."""
    rng = np.random.default_rng(seed)
    effort_unit = effort_unit or {"prismatic": "N", "rotary": "N*m"}[motion]
    gravity = "none" if motion == "prismatic" else "sine"
    truth = TRUTH[motion]
    plans = [("fitted", i) for i in range(fitted)] + [("heldout", i) for i in range(heldout)]
    signals = [_signals(motion, samples, rng) for _ in plans]
    richest = joint_model("combined", motion=motion, effort_unit=effort_unit, gravity=gravity)
    found = {}
    for k, family in enumerate(families):
        model = joint_model(family, motion=motion, effort_unit=effort_unit, gravity=gravity)
        estimate = _estimate(model, truth, "ls", rng, samples)
        predictions = []
        for (split, i), (time, q, v, a) in zip(plans, signals, strict=True):
            y = truth["inertia"] * a + truth.get("gravity", 0.0) * np.sin(q)
            true = y + truth["offset"] + _core.friction(richest.vector([truth[n] for n in richest.names]), v, y)
            effort = true + 0.02 * np.abs(true).max() * _coloured(rng, len(time))
            y_hat = estimate["inertia"].value * a
            if gravity == "sine":
                y_hat = y_hat + estimate["gravity"].value * np.sin(q)
            offset = estimate["offset"].value if "offset" in model.names else 0.0
            predicted = y_hat + offset + _core.friction(model.vector(estimate.array), v, y_hat)
            error = 100.0 * np.linalg.norm(effort - predicted) / np.linalg.norm(effort)
            half = 1.96 * float(np.std(effort - predicted))
            predictions.append(
                Prediction(
                    f"{'fit' if split == 'fitted' else 'trial'}_{i + 1}", split, time, q, v, a, y_hat, effort,
                    predicted, error, 1.0 - (error / 100.0) ** 2, half,
                    float(np.mean(np.abs(effort - predicted) < half)),
                )
            )  # fmt: skip
        pools = {
            s: [p.effort_error for p in predictions if p.split == s] or [float("nan")] for s in ("fitted", "heldout")
        }
        found[family] = FamilyFit(
            model,
            estimate,
            {m: _estimate(model, truth, m, rng, samples) for m in METHODS} if others and k < 2 else {},
            tuple(predictions),
            {m: tuple(_simulations(predictions, motion, rng, s)) for m, s in (("ls", 1.0), ("output_error", 0.6))}
            if simulated and k < 2
            else {},
            float(np.mean(pools["fitted"])),
            0.998,
            float(np.mean(pools["heldout"])),
            0.996 if heldout else float("nan"),
        )
    score = {f: g.heldout_effort_error if heldout else g.fitted_effort_error for f, g in found.items()}
    return JointResult(
        study=name,
        headline=f"{name} was made up",
        tables=(),
        verdicts=(
            Verdict("good", "Inertia is known to better than 1 %."),
            Verdict("note", "Residuals are not white: intervals allow for it."),
            Verdict("warning", "The Stribeck velocity is not identifiable: it hardly moves slower than 5 mm/s <b>."),
        ),
        rows=(),
        cards={},
        checksums={p.recording: "ab" * 32 for p in predictions},
        procedure="joint",
        motion=motion,
        effort_unit=effort_unit,
        lifts="outward",
        families=found,
        choice=HeadlineChoice(min(score, key=score.get), "ls"),
        filter_note="zero-phase Butterworth, order 4, 100 Hz on both sides; 1 sample in 10",
        drive_constant=Parameter("drive_constant", f"{effort_unit}/V", 35.15, 0.21)
        if effort_unit in ("N", "N*m")
        else None,
        traces=tuple(Trace(p.recording, p.split, p.time, p.position, p.velocity, p.effort) for p in predictions),
    )


def _signals(motion: str, n: int, rng: np.random.Generator):
    time = np.arange(n) * 0.01
    scale = {"prismatic": 0.1, "rotary": 1.2}[motion]
    w = 2.0 * np.pi * np.array([0.31, 0.83])
    phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    amplitude = scale * np.array([0.9, 0.25])[:, None]
    angle = w[:, None] * time + phase[:, None]
    w = w[:, None]
    q = (amplitude * np.sin(angle)).sum(0)
    return time, q, (amplitude * w * np.cos(angle)).sum(0), -(amplitude * w**2 * np.sin(angle)).sum(0)


def _coloured(rng: np.random.Generator, n: int) -> np.ndarray:
    white = rng.standard_normal(n)
    out = np.empty(n)
    state = 0.0
    for i, e in enumerate(white):
        state = 0.6 * state + 0.8 * e
        out[i] = state
    return out


def _estimate(model, truth, method: str, rng: np.random.Generator, samples: int) -> JointEstimate:
    parameters = []
    for j, symbol in enumerate(model.symbols):
        error = 0.006 * abs(truth[symbol.name]) * (1.0 + j)
        value = truth[symbol.name] + 0.5 * error * rng.standard_normal()
        parameters.append(
            Parameter(
                symbol.name, model.unit(symbol.name), value, error,
                at_bound=symbol.name == "load_friction" and method == "ls",
                identifiable=symbol.name != "stribeck_velocity",
                bootstrap=(value - 2.1 * error, value + 2.0 * error) if method == "ls" else None,
            )
        )  # fmt: skip
    errors = np.array([p.standard_error for p in parameters])
    correlation = 0.3 + 0.7 * np.eye(len(errors))
    return JointEstimate(
        model=model, method=method, parameters=tuple(parameters), covariance=correlation * np.outer(errors, errors),
        filtering=Filtering(10.0),
        condition_number=26.0, scaled_condition_number=3.4, residual_sd=1.9, samples=samples,
        iterations=1 if method == "ls" else 6,
        whiteness=Whiteness(0.61, 812.0, 0.0, 40, 0.24),
        notes=("The lower bound of load_friction is active.",) if "load_friction" in model.names else (),
    )  # fmt: skip


def _simulations(predictions, motion: str, rng: np.random.Generator, size: float):
    for p in predictions:
        measured = {
            "position": p.position, "velocity": p.velocity, "acceleration": p.acceleration, "effort": p.effort,
        }  # fmt: skip
        for mode, share in (("closed_loop", 2e-4), ("openloop", 2e-2)):
            simulated = {n: x + size * share * np.abs(x).max() * _coloured(rng, len(x)) for n, x in measured.items()}
            errors = {
                n: 100.0 * float(np.linalg.norm(measured[n] - simulated[n]) / np.linalg.norm(measured[n]))
                for n in measured
            }
            off = measured["position"] - simulated["position"]
            yield Simulation(
                p.recording, p.split, mode, p.time, measured, simulated, errors, float(np.sqrt(np.mean(off**2))),
                float(np.mean(np.abs(off))),
            )  # fmt: skip
