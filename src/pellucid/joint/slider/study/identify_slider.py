"""The staged identification of a joint with a carriage: where it stood, three steps, all at once, one coherent body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...._errors import IdentificationError, UnfitRecordingError
from ....files.recording import Recording
from ....models.estimates import Parameter, Verdict
from ....models.friction_terms import LOAD_FEATURE, features_of
from ....models.slider_joint import DirectionalSliderModel, SliderJointModel
from ....numerics.filters import zero_phase_lowpass
from ....numerics.protocols.excitation import REVERSALS_NAME
from ....study.procedures.dead_effort import require_live_effort
from ....study.procedures.procedure import Progress, quiet
from ....study.quality import require_sound
from ....study.recorded_motions import command_of, drive_model
from ....study.study import Study
from ....study.study_file import StudyFile
from ..axis_offset import FREE_CARRIAGE_NAME, AxisOffset, estimate_axis_offset
from ..markers import Geometry, slider_geometry
from ..slider_fit import (
    FIRST_LOAD_COEFFICIENT,
    SLIDER_METHODS,
    STEP_PROTOCOLS,
    TRAVEL_SEARCH,
    SliderEstimate,
    SliderFit,
    SliderMotion,
    TrialError,
    all_at_once,
    directional_columns,
    fit_coherent,
    presliding_travel,
    static_set,
    three_steps,
)
from .recorded_slider import examine, of_body, require_torques, slider_motions
from .slider_result import SliderResult, slider_result

FREE_CARRIAGE_CHANNELS = ("position", "length.carriage", "angle.limb")
"""Channels of a recording with a free carriage: the robot's angle, the carriage's distance from its axis, the limb's
angle."""

FREE_CARRIAGE_LOWPASS_HZ = 5.0
"""Low-pass of these where study.toml states none [Hz]."""

ALL_AT_ONCE_PROTOCOL = "fourier"
"""The protocol of one excitation that shows everything; without it, all at once fits what the steps fit."""


def identify_slider(study: Study, tell: Progress = quiet) -> SliderResult:
    """Every method on a study's joint with a carriage."""
    tell("reading recordings", 0.0)
    recordings = study.recordings()
    tell("looking for faults", 0.4)
    for recording in recordings:
        require_sound(recording, study)
    require_live_effort(study)
    examined = examine(study.config, recordings)
    refused = [fault.message for fault in examined.faults if fault.severity == "refuse"]
    if refused or examined.geometry is None:
        raise UnfitRecordingError("\n".join(refused))
    checksums = {r.name: r.checksum for r in recordings}
    travel = travel_of(study.config, recordings)
    fit = _fit(
        study.config, examined.geometry, examined.motions, travel, checksums, lambda t, s: tell(t, 0.7 + 0.3 * s)
    )
    offsets = axis_offsets_of(study.config, recordings)
    verdicts = tuple(Verdict("note", axis_in_words(name, found)) for name, found in offsets.items())
    return slider_result(study, replace(fit, axis_offsets=offsets, verdicts=(*fit.verdicts, *verdicts)))


def fit_slider(config: StudyFile, recordings: Sequence[Recording], *, on_progress: Progress | None = None) -> SliderFit:
    """The same from recordings already read."""
    tell = on_progress or (lambda text, share: None)
    rig = config.rig
    if rig.slider is None:
        raise IdentificationError("study.toml: no [rig.slider] found, expected one with the rail's ends")
    require_torques(config)
    tell("finding the carriage", 0.0)
    body = of_body(recordings)
    geometry = slider_geometry(body)
    tell("filtering", 0.4)
    motions = slider_motions(body, config, geometry)
    checksums = {r.name: r.checksum for r in recordings}
    travel = travel_of(config, recordings)
    return _fit(config, geometry, motions, travel, checksums, lambda text, share: tell(text, 0.5 + 0.5 * share))


def travel_of(config: StudyFile, recordings: Sequence[Recording]) -> Parameter | None:
    """The way over which friction builds up, of recordings that show it; None without any."""
    gain = drive_model(config.rig).gain
    shown = [
        (recording["position"][span], gain * command_of(recording, config.rig)[span], recording.fs)
        for recording in recordings
        if recording.protocol == REVERSALS_NAME and recording.use == "fit"
        for span in recording.spans
    ]
    return presliding_travel(shown) if shown else None


def axis_offsets_of(config: StudyFile, recordings: Sequence[Recording]) -> dict[str, AxisOffset]:
    """Return the offset of the wearer's axis from the robot's, by recording with a free carriage."""
    found = {}
    for recording in recordings:
        if recording.protocol != FREE_CARRIAGE_NAME:
            continue
        missing = [name for name in FREE_CARRIAGE_CHANNELS if name not in recording.channels]
        if missing:
            raise IdentificationError(
                f"{recording.name}: found no channel {', '.join(missing)}, expected "
                f"{', '.join(FREE_CARRIAGE_CHANNELS)}: "
                f'a recording with protocol = "{FREE_CARRIAGE_NAME}" needs them'
            )
        processing = config.processing_of(recording.name)
        cutoff = processing.lowpass or FREE_CARRIAGE_LOWPASS_HZ
        signals = np.column_stack([recording[name] for name in FREE_CARRIAGE_CHANNELS])
        longest = max(recording.spans, key=lambda span: span.stop - span.start)
        smooth = zero_phase_lowpass(signals[longest], cutoff, processing.order, recording.fs)
        position, carriage, limb = smooth.T
        try:
            found[recording.name] = estimate_axis_offset(position, carriage, limb, recording.fs)
        except IdentificationError as error:
            raise IdentificationError(f"{recording.name}: {error}") from error
    return found


def axis_in_words(recording: str, found: AxisOffset) -> str:
    """Return a sentence on where the wearer's axis lies."""
    (low, high), (under, over) = ([1e3 * end for end in ends] for ends in found.interval)
    return (
        f"In {recording} the wearer's axis lies {1e3 * found.along:.1f} mm ({low:.1f} to {high:.1f}) from the robot's "
        f"along the link at the robot's zero, and {1e3 * found.across:.1f} mm ({under:.1f} to {over:.1f}) across it; "
        f"the cuff is {1e3 * found.length:.0f} mm from the wearer's axis."
    )


def _fit(
    config: StudyFile,
    geometry: Geometry,
    motions: tuple[SliderMotion, ...],
    travel: Parameter | None,
    checksums: dict[str, str],
    tell: Progress,
) -> SliderFit:
    """Fit every method to the fitted motions and test it on all motions."""
    rig = config.rig
    assert rig.slider is not None  # the procedure is asked for a joint with a carriage alone
    fitted = [m for m in motions if m.split == "fitted"]
    steps = [m for m in fitted if m.protocol in STEP_PROTOCOLS]
    at_once = [m for m in fitted if m.protocol == ALL_AT_ONCE_PROTOCOL] or steps
    tell("three steps", 0.0)
    estimates: dict[str, SliderEstimate] = {
        "pooled": three_steps(steps, dissociated=False, method="pooled"),
        "dissociated": three_steps(steps, dissociated=True, method="dissociated"),
        "pooled_at_once": all_at_once(at_once, dissociated=False, method="pooled_at_once"),
        "dissociated_at_once": all_at_once(at_once, dissociated=True, method="dissociated_at_once"),
    }
    tell("one coherent body", 0.4)
    rail, mass = (rig.slider.low, rig.slider.high), rig.moving_mass
    consistent = SliderJointModel("consistent")
    estimates["consistent"] = fit_coherent(consistent, steps, rail=rail, mass=mass)
    known = {} if rig.slider.mass is None else {"carriage_mass": rig.slider.mass}
    load = SliderJointModel("load", known)
    found = dict(zip(consistent.names, estimates["consistent"].values, strict=True))
    start = np.array([found.get(n, FIRST_LOAD_COEFFICIENT) for n in load.names])
    estimates["load"] = fit_coherent(load, steps, rail=rail, mass=mass, start=start)
    static = [m for m in fitted if m.protocol == "static"]
    tell("judging", 0.8)
    gain = drive_model(rig).gain
    moving = [m for m in motions if m.protocol != "static"]
    errors = {name: trial_errors(estimate, moving, gain) for name, estimate in estimates.items()}
    fit = SliderFit(
        study=config.name,
        lifts=rig.lifts,
        gain=gain,
        rail=rail,
        geometry=geometry,
        static=static_set(static) if static else (),
        estimates=estimates,
        errors=errors,
        motions=motions,
        verdicts=(),
        filter_note=filter_note(config),
        checksums=checksums,
        travel=travel,
    )
    return replace(fit, verdicts=slider_verdicts(fit))


def predicted(estimate: SliderEstimate, motion: SliderMotion) -> np.ndarray:
    """An estimate's torque for a motion, filtered as the measured one was, shape (n,) [N*m]. Gives (n,)."""
    if isinstance(estimate.model, DirectionalSliderModel):
        return directional_columns(motion) @ np.concatenate([estimate.model.up, estimate.model.down])
    return estimate.model.effort(estimate.values, motion)


def trial_errors(estimate: SliderEstimate, motions: Sequence[SliderMotion], gain: float) -> tuple[TrialError, ...]:
    """Equation 6 for every motion, over the samples in which the joint moves. `gain` [N*m/A]."""
    made = []
    for m in motions:
        off = (predicted(estimate, m) - m.effort)[m.scored]
        if not len(off):
            off = np.array([np.nan])
        mean, rms, bias = float(np.mean(np.abs(off))), float(np.sqrt(np.mean(off**2))), float(np.mean(off))
        made.append(TrialError(m.recording, m.protocol, m.split, m.slider, mean / gain, mean, rms, bias))
    return tuple(made)


def filter_note(config: StudyFile) -> str:
    """The processing in one line."""
    p = config.processing
    if p.sliding_means is not None:
        parts = ["centred means over {} samples of current and {} of position".format(*p.sliding_means)]
    else:
        parts = [f"zero-phase Butterworth low-pass, order {p.order}, {p.lowpass:g} Hz, on position and current alike"]
    parts.append("derivatives by central differences; friction low-passed as current is")
    if p.dead_band:
        parts.append(f"samples slower than {p.dead_band:g} rad/s excluded")
    return "; ".join(parts)


def slider_verdicts(fit: SliderFit) -> tuple[Verdict, ...]:
    """What the figures say, in sentences."""
    error = {name: fit.evaluated_error(name) for name in fit.estimates}
    split = "held-out trials" if fit.evaluated_split == "heldout" else "fitted trials (nothing is held out)"
    best = min(("consistent", "load"), key=lambda name: error[name])
    verdicts = [
        Verdict(
            "good" if error["dissociated"] < error["pooled"] else "warning",
            f"Separate parameters for each direction reduce the mean current error on {split} from "
            f"{error['pooled']:.4f} to {error['dissociated']:.4f} A, by a factor of "
            f"{error['pooled'] / error['dissociated']:.2f}.",
        ),
        Verdict(
            "good" if error[best] <= 1.05 * error["dissociated"] else "note",
            f"One rigid body with {SLIDER_METHODS[best].split(', ')[1]} has an error of {error[best]:.4f} A with "
            f"{len(fit[best].values)} parameters; the model with separate directions has "
            f"{len(fit['dissociated'].values)}.",
        ),
    ]
    model = fit.sets
    x = np.linspace(*fit.rail, 9)
    worst = min(float(model.inertia(d, x).min()) for d in ("up", "down"))
    if worst < 0.0:
        text = f"The dissociated model's inertia is negative on the rail ({worst:.3g} kg*m^2)."
        verdicts.append(Verdict("warning", text))
    q = np.linspace(min(m.position.min() for m in fit.motions), max(m.position.max() for m in fit.motions), 60)
    friction = directional_friction(model, x, q)
    if friction.min() < 0.0:
        text = (
            f"The friction at rest of the dissociated model is {friction.min():.3g} to {friction.max():.3g} N*m. A "
            "negative value is impossible: the joint would drive itself."
        )
        verdicts.append(Verdict("warning", text))
    notes = [*(note for name in ("consistent", "load") for note in fit[name].notes), travel_in_words(fit.travel)]
    if LOAD_FEATURE in features_of(fit.body("load").names):
        notes.append(
            "The mass of the carriage is unknown, so that friction while motoring and while generating share one "
            'coefficient: weigh the carriage and write [rig.slider] mass = "... kg".'
        )
    return (*verdicts, *(Verdict("note", note) for note in notes))


def travel_in_words(travel: Parameter | None) -> str:
    """Return sentences on the presliding travel, or on what to record to find it."""
    if travel is None:
        return (
            "The presliding displacement is unknown, so that controllers with dither are not offered. Record slow "
            f'reversals of protocol = "{REVERSALS_NAME}" (at least {TRAVEL_SEARCH.min_turn_count} reversals).'
        )
    low, high = (1e3 * max(x, 0.0) for x in travel.interval())
    if travel.at_bound:
        return f"Presliding displacement: below {high:.2g} mrad, about the smallest that is tested."
    return (
        f"Before the joint slips its friction builds up over {1e3 * travel.value:.2g} mrad ({low:.2g} to {high:.2g}) "
        "from rest."
    )


def directional_friction(model: DirectionalSliderModel, slider: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Half the torque between the up and the down set at vanishing speed, shape (len(slider), len(position)) [N*m].

    It is the friction that the model implies; a passive joint's is nowhere negative.

    `slider` (k,) [m]; `position` (n,) [rad]; gives (k, n).
    """
    x, q = slider[:, None], position[None, :]
    up = model.gravity("up", x, q) + model.up[3]
    down = model.gravity("down", x, q) - model.down[3]
    return 0.5 * (up - down)
