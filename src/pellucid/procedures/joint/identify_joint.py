"""The staged identification of one joint: filter once, fit every family, judge on what was not fitted, explain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...fit.joint.drive_constant import drive_constant
from ...fit.joint.friction_family import FamilyFit, best_family, fit_family
from ...fit.joint.regression import stack
from ...fit.joint.replay import Machine
from ...fit.parameter import Parameter
from ...fit.slider.slider_fit import SliderFit
from ...models.joint import FAMILIES, JointModel, joint_model
from ...models.simulate import LoopSetting
from ...recordings.quality import drive_channel, require_sound
from ...recordings.study import Study
from ...recordings.study_file import JointTable
from ...signals.effort import drive_model
from ...signals.motion import filtering_of, motions
from ..result import Findings
from ..run import run_procedure
from ..slider.identify_slider import identify_slider
from .joint_fit import JointFit
from .joint_verdicts import sign_error, verdicts

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
        If the recordings cannot carry a model of any family, or the machine has several joints.
    """
    if len(study.rig.joints) > 1:
        raise IdentificationError(study.rig.refusal)
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
    machine = machine_of(study.rig)
    failures: dict[str, str] = {}
    for i, name in enumerate(names):
        tell(f"fitting {name}", (i + 0.2) / (len(names) + 0.5))
        try:
            fits[name] = fit_family(
                model_of(name, constant),
                data,
                everything,
                machine,
                level=study.model.confidence,
                moving_mass=study.rig.moving_mass,
                thorough=thorough,
            )
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


def filter_note(study: Study) -> str:
    """The study's processing in one line."""
    resample = study.processing.resample
    said = filtering_of(study.processing).sentence("rad/s" if study.rig.motion == "rotary" else "m/s")
    return f"resampled to {resample:g} Hz; {said}" if resample else said


def machine_of(rig: JointTable) -> Machine:
    """A rig's drive, and its controller where it states one."""
    drive, loop = drive_model(rig), rig.loop
    if loop is None:
        return Machine(drive.gain, drive.back_emf)
    gains = (loop.kp or 0.0, loop.ki or 0.0, loop.kd or 0.0, loop.kv or 0.0)
    return Machine(drive.gain, drive.back_emf, LoopSetting(loop.kind, *gains, loop.limit or 0.0, loop.velocity_span))
