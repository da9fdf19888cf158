"""The staged identification of one joint: filter once, fit every family, judge on what was not fitted, explain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...fit.joint.closed_loop import solve_didim, solve_instrumental, solve_output_error
from ...fit.joint.consistency import enforce_pseudo_inertia
from ...fit.joint.drive_constant import drive_constant
from ...fit.joint.evaluation import pooled, predict
from ...fit.joint.regression import Solution, Stack, solve, stack, with_known_stribeck_velocity
from ...fit.joint.replay import can_close, simulation_of
from ...fit.joint.reweighting import solve_robust, solve_weighted
from ...fit.parameter import Estimate, FamilyFit, JointFit, Parameter, Simulation
from ...fit.slider.slider_fit import SliderFit
from ...fit.uncertainty import block_bootstrap, memory, sandwich, whiteness
from ...models.joint import FAMILIES, JointModel, joint_model
from ...recordings.quality import drive_channel, require_sound
from ...recordings.study import Study
from ...signals.effort import drive_model
from ...signals.motion import SLOW_SHARE, Motion, motions
from ..result import Findings
from ..run import run_procedure
from ..slider.identify_slider import identify_slider
from .joint_verdicts import sign_error, verdicts

SEED = 20261121
PARSIMONY = 1.03
Progress = Callable[[str, float], None]


def identify(
    study: Study, *, families: Sequence[str] | None = None, on_progress: Progress | None = None, thorough: bool = True
) -> JointFit | SliderFit | Findings:
    """Identify the joint of a study, or what else its study.toml asks for.

    Parameters
    ----------
    study : Study
    families : sequence of str, optional
        Friction families; the study's own list if left out.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.
    thorough : bool
        Also weighted, robust, closed-loop and output-error estimates and simulations; False gives least squares,
        intervals and held-out errors only.

    Returns
    -------
    JointFit, SliderFit or Findings
        Of a joint with friction; of one with a carriage; of a transfer function, a hinge or a coupling. The latter
        have methods of their own: `families` must then be left out.

    Raises
    ------
    RecordingError
        If a recording is not fit to identify from.
    IdentificationError
        If the recordings cannot carry a model of any family.
    """
    own = study.config.procedure is not None or study.rig.drive is None
    if families and (own or study.rig.slider is not None):
        raise IdentificationError("this study is identified by methods of its own; leave out --family")
    if own:
        return run_procedure(study, on_progress=on_progress)
    if study.rig.slider is not None:
        return identify_slider(study, on_progress=on_progress)
    tell = on_progress or (lambda text, share: None)
    names = tuple(families or study.model.families)
    for name in names:
        if name not in FAMILIES:
            raise IdentificationError(f"unknown friction family '{name}'; known: {', '.join(FAMILIES)}")
    tell("reading recordings", 0.0)
    recordings = study.recordings()
    for recording in recordings:
        require_sound(recording, study)
    everything = motions(study)
    data = stack([m for m in everything if m.split == "fitted"])
    drive = drive_model(study.rig)

    payloads = {m.payload for m in everything if m.payload[0]}
    known_drive = drive.effort_unit in ("N*m", "N")

    def model_of(family: str, constant: Parameter | None = None) -> JointModel:
        plain = joint_model(
            family,
            motion=study.rig.motion,
            effort_unit=drive.effort_unit,
            gravity=study.model.gravity,
            known=study.model.known,
            separate_load="gravity" in study.model.known or "inertia" in study.model.known,
            velocity_range=max(float(np.abs(m.velocity[m.inner]).max()) for m in data.motions),
        )
        scale = 1.0 if known_drive else 0.0 if constant is None else 1.0 / constant.value
        return replace(plain, payload_scale=scale)

    sign_error(model_of("symmetric"), data, drive_channel(recordings[0], study))
    constant, no_constant = None, ""
    if payloads and not known_drive:
        try:
            constant = drive_constant(model_of("symmetric"), data)
        except IdentificationError as error:
            no_constant = str(error)
    fits: dict[str, FamilyFit] = {}
    failures: dict[str, str] = {}
    for i, name in enumerate(names):
        tell(f"fitting {name}", (i + 0.2) / (len(names) + 0.5))
        try:
            fits[name] = fit_family(model_of(name, constant), data, everything, study, thorough=thorough)
        except IdentificationError as error:
            if name in ("symmetric", names[0]):
                raise
            failures[name] = str(error)
    tell("verdicts", 1.0 - 0.3 / (len(names) + 0.5))
    best = best_family(fits)
    result = JointFit(
        study=study.name,
        motion=study.rig.motion,
        effort_unit=drive.effort_unit,
        lifts=study.rig.lifts,
        families=fits,
        best=best,
        verdicts=verdicts(study, fits, best, failures, data, constant, no_constant),
        filter_note=filter_note(study),
        checksums={r.name: r.checksum for r in recordings},
        drive_constant=constant,
    )
    tell("done", 1.0)
    return result


def best_family(fits: dict[str, FamilyFit]) -> str:
    """The simplest family whose held-out effort error is within `PARSIMONY` of the smallest (fitted effort where
    nothing is held out)."""

    def error(name: str) -> float:
        fit = fits[name]
        return fit.heldout_effort_error if np.isfinite(fit.heldout_effort_error) else fit.fitted_effort_error

    smallest = min(error(name) for name in fits)
    return min((n for n in fits if error(n) <= PARSIMONY * smallest), key=lambda n: len(fits[n].model.symbols))


def filter_note(study: Study) -> str:
    """The study's processing in one line."""
    p = study.processing
    unit = "rad/s" if study.rig.motion == "rotary" else "m/s"
    parts = []
    if p.resample:
        parts.append(f"resampled to {p.resample:g} Hz")
    parts.append(f"zero-phase Butterworth low-pass, order {p.order}, {p.lowpass:g} Hz" if p.lowpass else "no low-pass")
    parts.append("central differences")
    if p.lowpass:
        parts.append("friction low-passed as effort is")
    if p.trim:
        parts.append(f"{p.trim} samples dropped at either border")
    if p.decimate > 1:
        parts.append(f"both sides decimated by {p.decimate}")
    if p.dead_band:
        parts.append(f"samples left out that draw more than {SLOW_SHARE:.0%} from below {p.dead_band:g} {unit}")
    return "; ".join(parts)


def fit_family(
    model: JointModel, data: Stack, everything: Sequence[Motion], study: Study, *, thorough: bool
) -> FamilyFit:
    """Fit one family by every method its data allow, predict and simulate every recording.

    Parameters
    ----------
    model : JointModel
    data : Stack
        Fitted motions.
    everything : sequence of Motion
        All motions of the study.
    study : Study
    thorough : bool

    Returns
    -------
    FamilyFit

    Raises
    ------
    IdentificationError
        If the regression is singular.
    """
    first, note = _consistent(model, data, solve(model, data), study)
    estimate = estimated(model, data, first, "ls", note, level=study.model.confidence)
    half_width = float(np.quantile(np.abs(first.residual), study.model.confidence))
    predictions = predict(model, first.values, everything, half_width)
    fitted, heldout = pooled(predictions, "fitted"), pooled(predictions, "heldout")
    more = _thorough(model, data, first, everything, study) if thorough else ({}, {}, {})
    return FamilyFit(model, estimate, more[0], predictions, more[1], more[2], *fitted, *heldout)


def _consistent(model: JointModel, data: Stack, found: Solution, study: Study) -> tuple[Solution, tuple[str, ...]]:
    mass = study.rig.moving_mass
    if mass is None or model.motion != "rotary" or model.effort_unit != "N*m":
        return found, ()
    found, active = enforce_pseudo_inertia(model, data, found, mass)
    if not active:
        return found, ()
    return found, (f"inertia is held at the least that {mass:g} kg with this gravity torque can have",)


def _thorough(
    model: JointModel, data: Stack, first: Solution, everything: Sequence[Motion], study: Study
) -> tuple[dict[str, Estimate], dict[str, tuple[Simulation, ...]], dict[str, str]]:
    """Estimates by the other methods, simulations, and what came to nothing."""
    rig, processing, level = study.rig, study.processing, study.model.confidence
    if "stribeck_velocity" in model.names:
        # Only least squares profiles over it; the others take its value.
        at = model.names.index("stribeck_velocity")
        model = with_known_stribeck_velocity(model, float(first.values[at]))
        first = replace(
            first,
            values=np.delete(first.values, at),
            jacobian=np.delete(first.jacobian, at, axis=1),
            at_bound=np.delete(first.at_bound, at),
        )
    weighted, robust = solve_weighted(model, data, first), solve_robust(model, data, first)
    others = {
        "wls": estimated(model, data, weighted, "wls", level=level),
        "irls": estimated(model, data, robust, "irls", level=level),
    }
    closed = all(can_close(rig, m) for m in data.motions)
    stretches = [len(scored) for scored in data.scored]
    failures: dict[str, str] = {}

    def attempt(name: str, run: Callable[[], Estimate]) -> None:
        try:
            others[name] = run()
        except (IdentificationError, np.linalg.LinAlgError) as error:
            failures[name] = str(error)

    if closed:

        def instrumental() -> Estimate:
            solution, z = solve_instrumental(model, data, rig, processing, first)
            return estimated(model, data, solution, "iv", instruments=z, level=level)

        attempt("iv", instrumental)
        attempt(
            "didim",
            lambda: estimated(model, data, solve_didim(model, data, rig, processing, first), "didim", level=level),
        )
    attempt(
        "output_error",
        lambda: estimated(
            model, data, solve_output_error(model, data, rig, first), "output_error", lengths=stretches, level=level
        ),
    )
    simulations: dict[str, tuple[Simulation, ...]] = {}
    solved = {"ls": first.values} | (
        {"output_error": others["output_error"].values} if "output_error" in others else {}
    )
    for method, values in solved.items():
        made = []
        for motion in everything:
            for is_closed in (True, False) if can_close(rig, motion) else (False,):
                try:
                    made.append(simulation_of(model, values, motion, rig, processing, closed=is_closed))
                except IdentificationError as error:
                    failures[f"simulation of {motion.recording}"] = str(error)
        simulations[method] = tuple(made)
    return others, simulations, failures


def estimated(
    model: JointModel,
    data: Stack,
    found: Solution,
    method: str,
    notes: tuple[str, ...] = (),
    *,
    instruments: np.ndarray | None = None,
    lengths: Sequence[int] | None = None,
    level: float = 0.95,
) -> Estimate:
    """Covariance, intervals and diagnostics of a solution.

    Parameters
    ----------
    model : JointModel
    data : Stack
    found : Solution
    method : str
    notes : tuple of str
    instruments : ndarray, shape (m, p), optional
        Z of an instrumental-variable estimate.
    lengths : sequence of int, optional
        Samples of each stretch, where they are not the stack's scored ones.
    level : float
        Of the bootstrap's interval.

    Returns
    -------
    Estimate
    """
    lengths = data.lengths if lengths is None else lengths
    w, rho = found.jacobian * found.weights[:, None], found.residual * found.weights
    norms = np.linalg.norm(found.jacobian, axis=0)
    # A Stribeck velocity without a Stribeck level has no effect at all: no interval can be given.
    idle = norms <= 1e-12 * norms.max()
    free = ~idle
    # Values on a bound stay in: the others' intervals must not take them for known.
    covariance = sandwich(w, rho, lengths, instruments, free)
    held = np.flatnonzero(found.at_bound)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    boot = None
    if method == "ls":
        block = int(np.clip(4 * memory(rho), 10, max(10, len(rho) // 20)))
        boot = np.full((len(free), 2), np.nan)
        boot[free] = block_bootstrap(
            w[:, free], rho, found.values[free], block=block, rng=np.random.default_rng(SEED), level=level
        )
    names = model.names
    notes = notes + tuple(
        f"{names[i]} is held at its physical bound, {found.values[i]:.3g} {model.unit(names[i])}"
        for i in held
        if not any(note.startswith(names[i]) for note in notes)
    )
    parameters = tuple(
        Parameter(
            name=name,
            unit=model.unit(name),
            value=float(found.values[i]),
            standard_error=float(sd[i]),
            at_bound=bool(found.at_bound[i]),
            identifiable=bool(free[i] and not found.at_bound[i] and abs(found.values[i]) > 2.0 * sd[i]),
            influence=float(norms[i] / np.linalg.norm(data.target)),
            bootstrap=None if boot is None or not free[i] else (float(boot[i, 0]), float(boot[i, 1])),
        )
        for i, name in enumerate(names)
    )
    shown = found.jacobian[:, ~idle]
    return Estimate(
        model=model,
        method=method,
        parameters=parameters,
        covariance=covariance,
        condition_number=float(np.linalg.cond(shown)),
        scaled_condition_number=float(np.linalg.cond(shown / norms[~idle])),
        residual_sd=float(np.sqrt(np.sum(found.residual**2) / max(len(rho) - len(names), 1))),
        samples=len(rho),
        iterations=found.iterations,
        converged=found.converged,
        whiteness=whiteness(found.residual, lengths),
        notes=notes,
    )
