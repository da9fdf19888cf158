"""Solve a joint in stages: filter once, fit every family, and choose a family and an estimator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..._errors import IdentificationError
from ...files.recording import Recording
from ...models.causes import ParallelSpring
from ...models.estimates import Parameter
from ...models.joint import FAMILIES, JointModel, joint_model
from ...models.simulate import LoopSetting
from ...numerics.motion import Motion
from ...numerics.regression import Stack, stack
from ...study.drive_channel import drive_channel
from ...study.procedures.dead_effort import require_live_effort
from ...study.procedures.procedure import CostedSteps, Progress, quiet
from ...study.quality import require_sound
from ...study.recorded_motions import (
    Excerpt,
    carries_unknown_payload,
    drive_model,
    motions_of,
    take_excerpt,
)
from ...study.study import Study
from ...study.study_file import JointTable, SeveralJoints
from ..fit.causes import find_parallel_spring
from ..fit.drive_constant import LoadShares, decide_load_shares, estimate_drive_constant
from ..fit.estimator_agreement import DISAGREEMENT_DOUBT, names_outside
from ..fit.friction_family import FamilyFit, SolvedFamily, fit_family
from ..fit.headline_choice import HeadlineChoice, choose_headline
from ..fit.replay import Machine, joint_posterior
from ..fit.slip_direction import choose_direction
from .aligned_motions import align_recordings, require_clocks, simple_model
from .joint_faults import require_sign, require_velocity

if TYPE_CHECKING:
    from ...numerics.posterior.posterior import Posterior

# Costs of steps are processor times measured on three public data sets, relative to a fit of symmetric friction.

FAMILY_COSTS = {"symmetric": 1.0, "directional": 1.0, "load": 4.0, "stribeck": 2.0, "combined": 6.0}
"""Cost of fitting each friction family."""

OTHER_FAMILY_COST = 2.0
"""Cost of fitting another family."""

LOOKING_COST = 0.3
"""Cost of looking for faults before the fits."""

FILTERING_COST = 4.5
"""Cost of filtering, and of deciding on directions, springs and shares of load."""

CHOICE_COST = 2.0
"""Cost of choosing family and estimator."""

POSTERIOR_COST = 10.0
"""Cost of drawing a posterior."""

VERDICT_COST = 1.5
"""Cost of verdicts and tables."""


@dataclass(frozen=True)
class SolvedJoint:
    """A joint with its chosen model, before it is reported."""

    study: Study
    motions: tuple[Motion, ...]  # motions of every recording without an unknown payload, fitted and held out
    data: Stack[Motion]  # fitted motions
    excerpt: Excerpt  # all motions, or parts of each if there are hours
    searched: Stack[Motion]  # fitted motions of the excerpt
    carried: tuple[Recording, ...]  # recordings with an unknown payload
    fits: Mapping[str, FamilyFit]
    choice: HeadlineChoice
    machine: Machine
    failures: Mapping[str, str]  # reasons, by family, why it could not be fitted
    constant: Parameter | None  # drive constant from payloads, divided by the stated one if that is known
    no_constant: str  # reason why the payloads give no drive constant
    posterior: Posterior | None
    no_posterior: str  # reason why a requested posterior is missing
    shares: LoadShares
    spring: ParallelSpring

    @property
    def headlined(self) -> FamilyFit:
        """Chosen family with the values of the chosen estimator."""
        return self.fits[self.choice.family].headline


def solve_joint(
    study: Study, tell: Progress = quiet, *, families: Sequence[str] | None = None, thorough: bool = True
) -> SolvedJoint:
    """Fit a study's joint with all friction families, and choose one, as `identify_joint` does."""
    names = tuple(families or study.model.families)
    for name in names:
        if name not in FAMILIES:
            raise IdentificationError(f"unknown friction family '{name}'; known: {', '.join(FAMILIES)}")
    if study.model.posterior:
        from ...numerics.posterior.ensemble import require_sampler

        require_sampler()
    posterior_cost = {"drawing a posterior": POSTERIOR_COST} if study.model.posterior else {}
    steps = CostedSteps(
        tell,
        {
            "looking at recordings": LOOKING_COST,
            "filtering": FILTERING_COST,
            **{f"fitting {name}": FAMILY_COSTS.get(name, OTHER_FAMILY_COST) for name in names},
            "choosing the model": CHOICE_COST,
            **posterior_cost,
            "verdicts": VERDICT_COST,
        },
    )
    steps.begin("looking at recordings")
    recordings = study.recordings()
    for recording in recordings:
        require_sound(recording, study)
    require_live_effort(study)
    require_velocity(study)
    simple_model(study)  # requires something to estimate
    require_clocks(study)
    steps.begin("filtering")
    every_one = align_recordings(study)
    carried = [r for r in every_one if carries_unknown_payload(r)]
    aligned_ones = [r for r in every_one if not carries_unknown_payload(r)]
    if carried and not any(r.use == "fit" for r in aligned_ones):
        raise IdentificationError(
            f'{study.name}: found no recording with use = "fit" and without an unknown payload, expected one: the '
            f"payloads ({', '.join(r.name for r in carried)}) are estimated relative to the joint without payload"
        )
    everything = motions_of(aligned_ones, study)
    part = take_excerpt(aligned_ones, study, everything)
    data = stack([m for m in everything if m.split == "fitted"])
    drive = drive_model(study.rig)

    payloads = {m.payload for m in data.motions if m.payload[0]}
    known_drive = drive.effort_unit in ("N*m", "N")
    fastest = max(float(np.abs(m.velocity[m.inner]).max()) for m in data.motions)

    spring = ParallelSpring()

    def model_of(family: str, constant: Parameter | None = None, *, separate_load: bool = False) -> JointModel:
        plain = joint_model(
            family,
            motion=study.rig.motion,
            effort_unit=drive.effort_unit,
            gravity=study.model.gravity,
            known=study.model.known,
            separate_load=separate_load,
            velocity_range=fastest,
            parallel_spring=spring.is_found,
        )
        scale = 1.0 if known_drive else 0.0 if constant is None else 1.0 / constant.value
        return replace(plain, payload_scale=scale)

    plain = [model_of(name) for name in ("symmetric", "load") if name == "symmetric" or name in names]
    direction = choose_direction(plain, data.motions, study.model.min_improvement)
    everything = tuple(map(direction.apply, everything))
    part = replace(part, motions=tuple(map(direction.apply, part.motions)) if part.said else everything)
    data = stack([m for m in everything if m.split == "fitted"])
    require_sign(model_of("symmetric"), data, drive_channel(recordings[0], study))
    searched = stack([m for m in part.motions if m.split == "fitted"]) if part.said else data
    spring = find_parallel_spring(model_of("symmetric"), searched)
    constant, no_constant = None, ""
    if payloads:
        try:
            constant = estimate_drive_constant(model_of("load"), data)
        except IdentificationError as error:
            no_constant = str(error)
    shares = LoadShares(True)
    if not {"gravity", "inertia"} & set(study.model.known) and any("load" in FAMILIES[name] for name in names):
        shares = decide_load_shares(model_of("load", separate_load=True), searched)
    solved: dict[str, SolvedFamily] = {}
    machine = machine_of(study.rig)
    failures: dict[str, str] = {}
    for name in names:
        steps.begin(f"fitting {name}")
        try:
            solved[name] = fit_family(
                model_of(name, constant, separate_load=shares.separate),
                data,
                everything,
                machine,
                level=study.model.confidence,
                moving_mass=study.rig.moving_mass,
                thorough=thorough,
                excerpt=part.motions,
                said=part.said,
            )
        except IdentificationError as error:
            if name in ("symmetric", names[0]):
                raise
            failures[name] = str(error)
    fits: dict[str, FamilyFit] = {name: each.fit for name, each in solved.items()}
    steps.begin("choosing the model")
    candidates = {name: each.candidates for name, each in solved.items()}
    searched = next(iter(solved.values())).data
    choice = choose_headline(candidates, searched, machine, study.model.purpose, study.model.min_improvement)
    choice = replace(choice, direction=direction)
    best = choice.family
    as_good = [solved[c.family].estimate_by(c.method) for c in choice.as_good if c.name != (best, choice.method)]
    fits[best] = solved[best].with_choice(choice, everything, as_good)
    doubted = names_outside(fits[best], study.model.confidence)
    fits[best] = fits[best].with_doubt(doubted, DISAGREEMENT_DOUBT)
    del solved  # its regressors are large
    posterior, no_posterior = None, ""
    if study.model.posterior:
        steps.begin("drawing a posterior")
        try:
            posterior = joint_posterior(fits[best].estimate, data)
        except IdentificationError as error:
            no_posterior = str(error)
    steps.begin("verdicts")
    return SolvedJoint(
        study, everything, data, part, searched, tuple(carried), fits, choice, machine, failures, constant,
        no_constant, posterior, no_posterior, shares, spring,
    )  # fmt: skip


def machine_of(rig: JointTable | SeveralJoints) -> Machine:
    """Return a rig's drive, with its controller if the rig states one."""
    drive, loop = drive_model(rig), rig.loop
    if loop is None:
        return Machine(drive.gain, drive.back_emf)
    gains = (loop.kp or 0.0, loop.ki or 0.0, loop.kd or 0.0, loop.kv or 0.0)
    return Machine(drive.gain, drive.back_emf, LoopSetting(loop.kind, *gains, loop.limit or 0.0, loop.velocity_span))
