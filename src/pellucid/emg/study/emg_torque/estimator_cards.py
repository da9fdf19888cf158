"""Cards of estimators that run sample by sample: causal maps made of muscles or by ridge regression.

The card of a torque map that a robot can run: an offset, and a coefficient for every feature or product of two.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from math import nan

import numpy as np

from ...._errors import PellucidError
from ....files.recording import Recording
from ....models.card import CardParameter
from ....models.estimates import Verdict
from ....models.parameter_card import ParameterCard
from ....study.results import ResultRow
from ....study.study import Study
from ...estimators.emg_session import add_channel_watch
from ...estimators.hill import HillMap
from ...estimators.torque_map import TorqueMap, fit_torque_map
from ...estimators.torque_trial import (
    CAUSAL_MOTION_LOWPASS_HZ,
    MOTION_LOWPASS_HZ,
    TorqueTrial,
    compute_features,
)
from ...models.emg_estimator import (
    EmgEstimatorCard,
    EstimatorChannel,
    EstimatorJoint,
    EstimatorMuscle,
    EstimatorTerm,
    unwatched_words,
)
from ...models.hill import MUSCLE_QUANTITIES
from ...models.muscle import CalibratedMuscles
from ...models.muscle_geometry import (
    MuscleSurface,
    fit_muscle_surface,
    muscle_table,
    sampled_surface,
    surface_from_geometry,
)
from ...signals.emg_chain import FILTER_STAGES, EmgChain
from ..muscle_channels import study_chain
from .emg_torque_table import EmgTorqueTable
from .live_scores import score_live
from .relative_envelopes import find_maxima, is_relative
from .together import TogetherFindings
from .torque_findings import BASELINE_ESTIMATOR, CalibrationFindings
from .trial_sources import moment_trials

PRODUCT_SEPARATOR = " * "
"""Separator of the two factors in a term's name."""

_MOTION_UNITS = {"angle": "rad", "velocity": "rad/s", "acceleration": "rad/s^2"}
"""Unit of each feature of motion, by the first part of its name."""


def torque_card(study: Study, found: TorqueMap, trials: Sequence[TorqueTrial], name: str) -> ParameterCard:
    """Return the card of a map by ridge regression."""
    if not hasattr(found.regressor, "unscaled_coefficients"):
        raise PellucidError(f"card {name}: found a map by {found.name}, expected one by ridge regression")
    seen = compute_features(trials[0], found.choice.features, causal=found.causal)
    chain = study.table(EmgTorqueTable).chain
    envelope, torque = "1" if is_relative(study) else "V", trials[0].unit

    def unit(term: str) -> str:
        factors = [_MOTION_UNITS.get(factor.split(".")[0], envelope) for factor in term.split(PRODUCT_SEPARATOR)]
        below = PRODUCT_SEPARATOR.strip().join(factor for factor in factors if factor != "1")
        return f"{torque}/({below})" if below and term != "offset" else torque

    lowpass = CAUSAL_MOTION_LOWPASS_HZ if found.causal else MOTION_LOWPASS_HZ
    return ParameterCard(
        kind="torque_map",
        study=study.name,
        name=name,
        parameters=tuple(
            CardParameter(term, unit(term), value, nan, (nan, nan), False, True)
            for term, value in found.regressor.unscaled_coefficients(seen.names).items()
        ),
        settings={
            "joint": trials[0].joint,
            "participant": trials[0].participant or "",
            "chain": chain,
            "causal": found.causal,
            "motion_lowpass": lowpass,
            "motion_order": 2 if found.causal else 4,
            "penalty": float(found.regressor.alpha),
        },
        processing=f"inputs: {found.choice.words}; angles low-pass filtered at {lowpass:g} Hz before differentiation",
        checksums={trial.name: trial.checksum for trial in trials},
        pellucid=version("pellucid"),
    )


@dataclass(frozen=True)
class CardLimits:
    """Limits that a card states, as its estimator takes them from the fitted trials.

    All were chosen by judgement; no measurement is recorded.
    """

    # Largest valid envelope of a channel, as a multiple of the largest fitted one. A larger one is not from a muscle.
    # Chosen by judgement.
    max_envelope_ratio: float = 2.0
    # Quantile of a channel's fitted envelope that is taken for its value at rest. Chosen by judgement.
    rest_quantile: float = 0.01
    # Limit of an estimator's torque, as a multiple of the largest fitted torque. Chosen by judgement.
    max_torque_ratio: float = 1.5
    # The card notes a muscle's surface if the RMS error of its moment arms exceeds this [m]. Chosen by judgement.
    max_unnoted_arm_error_m: float = 2e-3


CARD_LIMITS = CardLimits()


ACROSS_JOINTS_NOTES = (
    "Muscles were fitted with zero-phase filtered angles; in real time, the angular velocities have a delay of 19 ms.",
)
"""Notes on a card of muscles over all joints, which are fitted with zero-phase filters."""


def estimator_cards(
    study: Study, found: CalibrationFindings, together: TogetherFindings | None = None
) -> dict[str, EmgEstimatorCard]:
    """Return cards of the fitted causal maps, by joint and estimator, and of muscles over all joints.

    `study` [emg_torque].
    """
    cards: dict[str, EmgEstimatorCard] = {}
    alone = {
        (e.what, e.recording): e.score.r2 for e in found.evaluated if e.causal and e.estimator == BASELINE_ESTIMATOR
    }
    chain = study.table(EmgTorqueTable).chain
    asked = study_chain(study, study.table(EmgTorqueTable))
    # The core delays no EMG, and its chains are made of second-order sections.
    if asked is not None and any(stage.kind in ("advance", "rms") for stage in asked.stages):
        return cards
    for (joint, estimator), fit in list(found.causal.items()):
        every = moment_trials(study, joint, causal=True)
        trials = [t for t in every if not t.heldout]
        if trials[0].unit != "N*m":
            continue
        if chain != "none":
            # The scored maps saw zero-phase envelopes, which are not available live. Maps for cards are fitted anew.
            found.causal[joint, estimator] = fit = fit_torque_map(trials, estimator, causal=True)
        name = f"emg_{joint}_{estimator}"
        if isinstance(fit, HillMap):
            muscles = CalibratedMuscles(fit.fit.muscles, fit.driven, {joint: fit.fit.passive}, fit.effort)
            card = muscle_estimator(study, name, muscles, {joint: trials})
        else:
            card = map_estimator(study, name, fit, trials)
        if card.misfit:
            found.without_card[name] = _misfit_words(card)
            continue
        tested = fit.choice.score
        left_out = fit.residual_sd if isinstance(fit, HillMap) else tested.rmse
        card = add_channel_watch(card, {joint: trials}, {joint: left_out})
        cards[name] = replace(card, cross_validated_rmse=None if tested is None else float(tested.rmse))
        found.live[name] = score_live(cards[name], {joint: [t for t in every if t.heldout]}, alone, fit.predict)
    # With raw EMG, muscles over all joints were fitted to zero-phase envelopes. They then get no card.
    if together is not None and chain == "none":
        fitted = {joint: [t for t in own if not t.heldout] for joint, own in found.across.items()}
        name = "emg_together_hill"
        card = muscle_estimator(study, name, together.fit.card_content(), fitted, ACROSS_JOINTS_NOTES)
        left_out = {joint: found.rmse for joint, found in together.fit.choice.scores.items()}
        if card.misfit:
            found.without_card[name] = _misfit_words(card)
        else:
            cards[name] = add_channel_watch(card, fitted, left_out)
            held = {joint: [t for t in moment_trials(study, joint, causal=True) if t.heldout] for joint in fitted}
            found.live[name] = score_live(cards[name], held, alone)
    return cards


def _misfit_words(card: EmgEstimatorCard) -> str:
    """Return why a card cannot be stepped, and the size of its inputs."""
    return f"{card.misfit}; found {len(card.channels)} EMG channels and {len(card.angles)} angles"


def misfit_verdicts(found: CalibrationFindings) -> list[Verdict]:
    """Return a warning that names the estimators without a card; none if each has one."""
    if not found.without_card:
        return []
    reasons = "; ".join(dict.fromkeys(found.without_card.values()))
    return [
        Verdict(
            "warning",
            f"No model card of {', '.join(found.without_card)} was written, because a live estimator has room for "
            f"fewer inputs ({reasons}).",
            "Delete the channels angle.<joint> and emg.<muscle> that the joint does not need from study.toml, then "
            "calibrate again.",
            finding="inputs_beyond_live",
        )
    ]


def watch_verdicts(cards: Mapping[str, EmgEstimatorCard]) -> list[Verdict]:
    """Return a warning for the estimators of each set of joints whose watch would miss an exchange of channels."""
    pairs: dict[str, dict[tuple[str, str], None]] = {}
    for card in cards.values():
        if card.watch is not None and card.watch.alike:
            where = " and ".join(joint.name for joint in card.joints)
            pairs.setdefault(where, {}).update(dict.fromkeys(card.watch.alike))
    return [
        Verdict(
            "warning",
            f"Live estimate of {where}: not watched for an exchange of {unwatched_words(tuple(own))}, because the "
            "movement does not tell these channels apart.",
            "Check these cables before each session.",
            finding="unwatched_exchange",
        )
        for where, own in pairs.items()
    ]


def watch_rows(study: str, cards: Mapping[str, EmgEstimatorCard]) -> Iterator[ResultRow]:
    """Yield the number of pairs of channels whose exchange the watch of each estimator would miss."""
    for name, card in cards.items():
        if card.watch is not None:
            said = unwatched_words(card.watch.alike) or "every exchange that costs torque is watched"
            yield ResultRow(
                f"{study}.{name}.unwatched_exchanges", len(card.watch.alike), "1", "calibrate", "fitted", None, said
            )


def muscle_estimator(
    study: Study,
    name: str,
    muscles: CalibratedMuscles,
    trials: Mapping[str, Sequence[TorqueTrial]],
    known: Sequence[str] = (),
) -> EmgEstimatorCard:
    """Return the card of calibrated muscles of one or several joints.

    `trials` are the fitted ones by joint; `known` are notes for the card. `study` [emg_torque].
    """
    surfaces, notes = {}, [*known]
    for muscle in muscles.muscles:
        surfaces[muscle.name], surface_notes = _muscle_surface(muscle.name, trials)
        notes += surface_notes
    made = [
        EstimatorMuscle(
            m.name,
            dict(zip(MUSCLE_QUANTITIES, map(float, m.vector()), strict=True)),
            {channel: muscles.effort / len(muscles.driven[m.name]) for channel in muscles.driven[m.name]},
            surfaces[m.name],
        )
        for m in muscles.muscles
    ]
    used = {channel for m in made for channel in m.shares}
    needed = {a.angle for m in made for a in m.surface.axes} | set(muscles.joints)
    joints = tuple(
        EstimatorJoint(joint, *map(float, tissue), _torque_limit(trials[joint]))
        for joint, tissue in muscles.tissue.items()
    )
    own = next(iter(trials.values()))
    card = _envelope_card(study.name, name, own, tuple(made), joints, used, needed, _largest_envelopes(study, own))
    return _with_chain(study, card, own, notes)


def map_estimator(study: Study, name: str, found: TorqueMap, trials: Sequence[TorqueTrial]) -> EmgEstimatorCard:
    """Return the card of a map by ridge regression. `study` [emg_torque]."""
    card = envelope_map_card(study.name, name, found, trials, _largest_envelopes(study, trials))
    return _with_chain(study, card, trials)


def envelope_map_card(
    study: str, name: str, found: TorqueMap, trials: Sequence[TorqueTrial], largest: Mapping[str, float]
) -> EmgEstimatorCard:
    """Return the card of a map by ridge regression that is stepped with envelopes.

    The trials hold shares of the `largest` envelope of each channel.
    """
    chosen, joint = found.choice.features, trials[0].joint
    if chosen.lags:
        raise PellucidError(f"card {name}: found earlier envelopes, expected a map of present ones")
    joints = [joint, *(j for j in trials[0].angles if j != joint)] if chosen.neighbours else [joint]
    names = [f"emg.{muscle}" for muscle in trials[0].envelopes]
    for each in joints:
        names += [f"angle.{each}", *([f"velocity.{each}"] if chosen.velocities else [])]
        names += [f"acceleration.{each}"] if chosen.accelerations else []
    terms = []
    for term, weight in found.regressor.unscaled_coefficients(names).items():
        first, _, second = ("", "", "") if term == "offset" else term.partition(PRODUCT_SEPARATOR)
        terms.append(EstimatorTerm(weight, first, second))
    one = EstimatorJoint(joint, 0.0, 0.0, 0.0, _torque_limit(trials), tuple(terms))
    return _envelope_card(study, name, trials, (), (one,), set(trials[0].envelopes), set(joints), largest)


def _fitted_recordings(study: Study, participant: str | None) -> list[Recording]:
    """Return the fitted recordings of a participant."""
    return [r for r in study.recordings() if r.use == "fit" and r.participant == participant]


def _largest_envelopes(study: Study, trials: Sequence[TorqueTrial]) -> Mapping[str, float]:
    """Return the largest envelope of each channel, whose shares the trials hold."""
    names, participant = {t.name for t in trials}, trials[0].participant
    return find_maxima(study, participant, [r for r in _fitted_recordings(study, participant) if r.name in names])


def _with_chain(
    study: Study, card: EmgEstimatorCard, trials: Sequence[TorqueTrial], notes: Sequence[str] = ()
) -> EmgEstimatorCard:
    """Return a card of envelopes with the study's chain, which makes them of raw EMG, and with notes."""
    spec = study.table(EmgTorqueTable)
    chain = study_chain(study, spec)
    if chain is None:
        return replace(card, notes=tuple(notes))
    rate = _fitted_recordings(study, trials[0].participant)[0].stream_or_self(spec.emg).fs
    late, sections = 1e3 * chain.delay(rate).filters, chain_sections(chain, rate)
    note = f"The chain {spec.chain} delays envelopes by {late:.0f} ms; muscles were fitted with this."
    return replace(
        card, notes=(*notes, note), chain=spec.chain, emg_rate=rate, before=sections["before"], after=sections["after"]
    )


def _envelope_card(
    study: str,
    name: str,
    trials: Sequence[TorqueTrial],
    muscles: tuple[EstimatorMuscle, ...],
    joints: tuple[EstimatorJoint, ...],
    used: set[str],
    needed: set[str],
    top: Mapping[str, float],
) -> EmgEstimatorCard:
    """Return the card of an estimator of envelopes, which are divided by the channels' largest ones, `top`."""
    channels = []
    for channel in trials[0].envelopes:
        if channel in used:
            seen = np.concatenate([t.envelopes[channel] for t in trials])
            rest, ceiling = (
                float(np.quantile(seen, CARD_LIMITS.rest_quantile)),
                CARD_LIMITS.max_envelope_ratio * float(seen.max()),
            )
            channels.append(EstimatorChannel(channel, 1.0 / top.get(channel, 1.0), rest, max(ceiling, rest + 1e-9)))
    return EmgEstimatorCard(
        study,
        name,
        tuple(channels),
        tuple(angle for angle in trials[0].angles if angle in needed),
        muscles,
        joints,
        1.0 / float(np.mean([t.fs for t in trials])),
        CAUSAL_MOTION_LOWPASS_HZ,
        checksums={t.name: t.checksum for t in trials},
        pellucid=version("pellucid"),
    )


def _muscle_surface(muscle: str, trials: Mapping[str, Sequence[TorqueTrial]]) -> tuple[MuscleSurface, list[str]]:
    """Return a muscle's length as a function of the trials' angles, and notes on its errors.

    The function is the leg model's, is sampled from the study's own model, or is fitted to recorded lengths and arms.
    """
    across = {joint: own for joint, own in trials.items() if own[0].muscles.driven(joint, own[0].envelopes).get(muscle)}
    first = next(iter(across.values()))
    source, angles = first[0].muscles, first[0].angles
    moved = {a: np.concatenate([np.asarray(t.angles[a], float) for t in first]) for a in angles}
    if muscle not in source.recorded and not source.polynomials:
        geometry = muscle_table().geometry[muscle]
        surface = surface_from_geometry(geometry, {"knee": source.sign})
        return surface.held({a: source.posture.get(a, 0.0) for a in geometry.angles if a not in angles}), []
    if muscle not in source.recorded:
        path = source.polynomials[muscle]
        own = {a: moved.get(a, np.full(len(moved[first[0].joint]), source.posture.get(a, 0.0))) for a in path.angles}
        arms = {a: path.moment_arm(a, own) for a in path.angles}
        # The joints themselves come first, then the angles that change the muscle's length most.
        ranked = sorted(own, key=lambda a: (a not in across, -float(np.std(own[a]) * np.mean(np.abs(arms[a])))))
        kept = [a for a in ranked if a in moved][:2]
        surface = sampled_surface(path, kept, {a: float(np.mean(q)) for a, q in own.items()})
        length, slope, _ = surface.path({a: own[a] for a in kept})
        missed = float(np.sqrt(np.mean((length - path.length(own)) ** 2)))
        arm = float(np.sqrt(np.mean([(slope[j] + arms[j]) ** 2 for j in across])))
        return surface, _surface_error_notes(muscle, surface, missed, arm)
    length = np.concatenate([t.muscles.recorded[muscle][0] for t in first])
    arms = {joint: np.concatenate([t.muscles.recorded[muscle][2] for t in own]) for joint, own in across.items()}
    surface, missed, arm = fit_muscle_surface(length, moved, arms)
    return surface, _surface_error_notes(muscle, surface, missed, arm)


def _surface_error_notes(muscle: str, surface: MuscleSurface, missed: float, arm: float) -> list[str]:
    """Return a note if a muscle's surface is inaccurate, given its RMS errors of length and arm [m]."""
    if arm <= CARD_LIMITS.max_unnoted_arm_error_m:
        return []
    return [
        f"{muscle}: as a function of {' and '.join(a.angle for a in surface.axes)}, length and moment arm have errors "
        f"of {1e3 * missed:.2g} and {1e3 * arm:.2g} mm, because they depend on other angles too."
    ]


def _torque_limit(trials: Sequence[TorqueTrial]) -> float:
    """Return the limit of the estimator's torque [N m]."""
    return CARD_LIMITS.max_torque_ratio * max(float(np.max(np.abs(t.torque))) for t in trials)


def chain_sections(chain: EmgChain, rate: float) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Return a chain's second-order sections at a `rate` [Hz], before and after rectification."""
    parts: dict[str, list] = {"before": [], "after": []}
    where = "before"
    for stage in chain.stages:
        if stage.kind == "rectify":
            where = "after"
        if stage.kind in FILTER_STAGES:
            parts[where] += map(tuple, stage.sections(rate).tolist())
    return {key: tuple(rows) for key, rows in parts.items()}
