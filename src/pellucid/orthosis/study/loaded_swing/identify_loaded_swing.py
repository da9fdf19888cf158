"""Steps 1 and 2 for an exoskeleton that swings empty and with relaxed legs: bodies, and legs as their difference.

One regression for each body fits all its recordings of protocol "empty_swing" or "loaded_swing" that are marked to
fit. The swing that identifies inertia best determines it. The result of the paper's swing alone is reported too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version

import numpy as np

from ...._errors import IdentificationError, PellucidError
from ....files.fault import Fault, warn_if_held_out
from ....files.recording import Recording, channels_within
from ....models.anthropometry import BODY_SHARES, shank_length, winter
from ....models.estimates import Parameter, Verdict
from ....models.friction_terms import is_friction
from ....models.joint import GRAVITY
from ....models.parameter_card import ParameterCard
from ....study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow, combined_checksum
from ....study.study import Study
from ....study.study_file import Participant, StudyFile
from ...swing.loaded_swing import Swing, SwingFit, corrected_form, fit_swings, leg_alone, swing
from .loaded_swing_table import LoadedSwingTable

EMPTY_PROTOCOL = "empty_swing"
"""Protocol of recordings in which the exoskeleton swings alone."""

LOADED_PROTOCOL = "loaded_swing"
"""Protocol of recordings in which it swings with a relaxed leg in it."""

KEPT_RATE_HZ = 25.0
"""Swings are thinned to this rate, or to five times the low-pass if that is more; nothing in them is faster."""

MAX_RELATIVE_HALF_WIDTH = 0.25
"""A warning names a leg whose inertia has an interval of more than this share of its value, to each side.

Chosen by judgement; no measurement is recorded.
"""


@dataclass(frozen=True)
class LegAlone:
    """One participant's leg."""

    loaded: SwingFit  # Fit of the leg together with the exoskeleton
    inertia: Parameter  # p' - p [kg m^2]
    weight_moment: Parameter  # q' - q [kg m]
    usual: tuple[float, float] | None  # Inertia and weight moment of such a leg by Winter's tables; None if unknown


@dataclass(frozen=True, kw_only=True, repr=False)
class LoadedSwingResult(Result):
    """Exoskeleton and legs as their swings show them."""

    empty: SwingFit
    legs: Mapping[str, LegAlone]  # Legs by participant
    swings: Mapping[str, Swing] = field(repr=False)  # Fitted swings by recording
    wearers: Mapping[str, str | None]  # Participant in the exoskeleton by recording; None where it was empty

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return swing_answer(self)


def identify_loaded_swing(study: Study, tell: Progress = quiet) -> LoadedSwingResult:
    """Identify the exoskeleton and every participant's leg. `study` [loaded_swing]."""
    tell("reading recordings", 0.0)
    return identify_swings(study.config, study.recordings(), tell=lambda text, s: tell(text, 0.5 + 0.5 * s))


def identify_swings(
    config: StudyFile, recordings: Sequence[Recording], *, tell: Progress = quiet
) -> LoadedSwingResult:
    """Identify the exoskeleton and every leg from recordings that are already read. `config` [loaded_swing]."""
    asked = config.table(LoadedSwingTable)
    used = [r for r in recordings if r.use == "fit" and r.protocol in (EMPTY_PROTOCOL, LOADED_PROTOCOL)]
    alone = [r for r in used if r.protocol == EMPTY_PROTOCOL]
    people = list(dict.fromkeys(r.participant for r in used if r.protocol == LOADED_PROTOCOL and r.participant))
    if not alone or not people:
        lacking = EMPTY_PROTOCOL if not alone else f"{LOADED_PROTOCOL} with a participant"
        raise IdentificationError(
            f"found {len(alone)} recordings of the exoskeleton alone and {len(people)} participants, expected at least "
            f"one of each: none is of protocol {lacking}"
        )
    parts = {r.name: swings_of(r, asked.lowpass) for r in used}
    form = corrected_form(0.0)
    tell("the exoskeleton alone", 0.0)
    empty = fit_swings([s for r in alone for s in parts[r.name]], form)
    legs = {}
    for i, who in enumerate(people):
        tell(who, 0.2 + 0.8 * i / len(people))
        own = [s for r in used if r.protocol == LOADED_PROTOCOL and r.participant == who for s in parts[r.name]]
        loaded = fit_swings(own, form)
        legs[who] = LegAlone(loaded, *leg_alone(empty, loaded), _usual(config.participants.get(who)))
    wearers = {r.name: r.participant if r.protocol == LOADED_PROTOCOL else None for r in used}
    swings = {s.recording: s for own in parts.values() for s in own}
    wearers |= {s.recording: wearers[name] for name, own in parts.items() for s in own}
    return _findings(config, asked.confidence, empty, legs, swings, wearers, {r.name: r.checksum for r in used})


def prepared(recording: Recording, lowpass: float) -> Swing:
    """Return a recording's position and torque through the same zero-phase low-pass [Hz], thinned."""
    every = max(1, round(recording.fs / max(KEPT_RATE_HZ, 5.0 * lowpass)))
    r = recording
    return swing(r.time, r["position"], r["torque"], lowpass=lowpass, every=every, recording=r.name)


def swings_of(recording: Recording, lowpass: float) -> list[Swing]:
    """Return the low-passed [Hz] swings between a recording's cuts; stretches that are too short are excluded."""
    if not recording.cuts:
        return [prepared(recording, lowpass)]
    found: list[Swing] = []
    short = None
    for span in recording.spans:
        channels = channels_within(recording, span)
        name = f"{recording.name} ({len(found) + 1})" if found else recording.name
        try:
            found.append(prepared(replace(recording, name=name, channels=channels, cuts=()), lowpass))
        except PellucidError as error:
            short = error
    if not found:
        raise short or IdentificationError(f"{recording.path.name} (recording {recording.name}): all samples were cut")
    return found


def faults(study: Study) -> list[Fault]:
    """Return the faults for which swings cannot be used. `study` [loaded_swing]."""
    found = []
    for r in study.recordings():
        if r.protocol not in (EMPTY_PROTOCOL, LOADED_PROTOCOL):
            continue
        text = ""
        reach = float(np.nanmax(np.abs(r["position"][r.sound]), initial=0.0))
        if reach > np.pi:
            text = f"found {reach:.3g} rad from hanging, expected less than half a turn: is it in degrees?"
        else:
            try:
                fit_swings(swings_of(r, study.table(LoadedSwingTable).lowpass), corrected_form(0.0))
            except PellucidError as error:
                text = str(error)
        if text:
            message = f"{r.path.name} (recording {r.name}), channel position: {text}"
            fault = Fault("refuse", "swing", r.path.name, "position", text, "a swing about hanging", message)
            found.append(warn_if_held_out(fault, r.use))
    return found


def _usual(person: Participant | None) -> tuple[float, float] | None:
    """Return a leg's inertia [kg m^2] and weight moment [kg m] by Winter's tables; None without mass and height."""
    if person is None or person.mass is None or person.height is None:
        return None
    leg = winter(person.mass, shank_length(person.height))
    return leg.inertia, leg.mass * leg.centre


def _findings(config, confidence, empty, legs, swings, wearers, checksums) -> LoadedSwingResult:
    study = config.name

    def files(*whose: str | None) -> dict[str, str]:
        return {name: digest for name, digest in checksums.items() if wearers[name] in whose}

    def half(p: Parameter) -> str:
        return f"+- {p.interval(confidence)[1] - p.value:.3g}"

    tables = [ParameterTable("Exoskeleton alone", empty.parameters)]
    heads = ("Participant", "p' - p (kg*m^2)", "Winter's", "q' - q (kg*m)", "Winter's", "Residual (N*m)")
    rows, results = [], []

    def add(name: str, value: float, unit: str, note: str, *whose: str | None) -> None:
        checksum = combined_checksum(files(*whose).values())
        results.append(ResultRow(f"{study}.{name}", value, unit, "identify", "fitted", checksum, note))

    for who, leg in legs.items():
        p, q, residual = leg.inertia, leg.weight_moment, leg.loaded.residual_rms
        tables.append(ParameterTable(f"{who}: leg", (replace(p, name="p' - p"), replace(q, name="q' - q"))))
        usual_p, usual_q = leg.usual or (None, None)
        rows.append((who, p.value, usual_p, q.value, usual_q, residual))
        add(f"{who}.p", p.value, "kg*m^2", half(p), None, who)
        add(f"{who}.q", q.value, "kg*m", half(q), None, who)
        add(f"{who}.residual", residual, "N*m", "", who)
    for name, each in (("p", empty.inertia), ("q", empty.weight_moment)):
        add(f"exoskeleton.{name}", each.value, each.unit, "", None)
    mean_p, mean_q = np.mean([(leg.inertia.value, leg.weight_moment.value) for leg in legs.values()], axis=0)
    headline = f"{len(legs)} legs by difference: in the mean {mean_p:.3g} kg*m^2 about the knee, "
    return LoadedSwingResult(
        study=study,
        headline=f"{headline}and {mean_q:.3g} kg*m of weight and tissue.",
        tables=(*tables, FigureTable("Legs", heads, tuple(rows))),
        verdicts=tuple(_verdicts(config, legs, confidence)),
        rows=tuple(results),
        cards=_cards(study, empty, legs, files, confidence),
        checksums=checksums,
        confidence=confidence,
        empty=empty,
        legs=legs,
        swings=swings,
        wearers=wearers,
    )


def swing_answer(found: LoadedSwingResult) -> Answer:
    """Return whether the swings tell the inertia of each leg."""
    parts, numbers = [], []
    for who, leg in found.legs.items():
        low, high = leg.inertia.interval(found.confidence)
        share = 50.0 * (high - low) / abs(leg.inertia.value)
        told = share <= 100.0 * MAX_RELATIVE_HALF_WIDTH
        numbers.append(AnswerNumber(f"inertia of the leg of {who}", leg.inertia.value, "kg*m^2", (low, high)))
        text = f"{leg.inertia.value:.3g} kg*m^2, ± {share:.0f} %"
        parts.append(AnswerPart(who, "yes" if told else "cannot say", text))
    count = len(found.checksums)
    return answer_of_parts(
        f"Do the swings determine each leg's inertia to ± {100.0 * MAX_RELATIVE_HALF_WIDTH:g} %?",
        found.headline,
        parts,
        numbers,
        Basis(count, count, judged="swings that were fitted"),
        improve=(Step("Record faster swings within the same angles: inertia shows in accelerations alone"),),
    )


def _verdicts(config: StudyFile, legs: Mapping[str, LegAlone], confidence: float) -> list[Verdict]:
    verdicts = []
    for who, leg in legs.items():
        half = leg.inertia.interval(confidence)[1] - leg.inertia.value
        if half > MAX_RELATIVE_HALF_WIDTH * abs(leg.inertia.value):
            text = f"{who}: the swings do not determine the leg's inertia, {leg.inertia.value:.3g} ± {half:.2g} "
            text += f"kg*m^2; inertia and weight have a correlation of {leg.loaded.correlation:.2f}."
            verdicts.append(Verdict("warning", text, "Record faster swings within the same angles."))
        mass = getattr(config.participants.get(who), "mass", None)
        # A leg of mass m has at least the inertia (q' - q)^2 / m, and nobody's is twice as heavy as Winter's shank.
        if mass and leg.inertia.value < leg.weight_moment.value**2 / (2.0 * BODY_SHARES.shank_mass * mass):
            text = f"{who}: found p' - p below (q' - q)^2 / m for any leg of {mass:g} kg of body weight"
            verdicts.append(Verdict("warning", text))
    more = {who: 100.0 * (leg.weight_moment.value / leg.usual[1] - 1.0) for who, leg in legs.items() if leg.usual}
    beyond = {who: share for who, share in more.items() if share > 10.0}
    if beyond:
        named = ", ".join(f"{who} by {share:.0f} %" for who, share in beyond.items())
        text = f"The weight moment q' - q exceeds Winter's value for such a leg ({named}): tissue acts on a relaxed "
        verdicts.append(Verdict("note", f"{text}leg like its weight; these swings do not separate the two."))
    if not verdicts:
        verdicts.append(Verdict("good", "Inertia and weight of every leg are identified separately."))
    return verdicts


def _cards(study, empty, legs, files, confidence) -> dict[str, ParameterCard]:
    def card(kind: str, name: str, parts: Sequence[Parameter], covariance: np.ndarray, *whose) -> ParameterCard:
        settings = {} if whose == (None,) else {"participant": whose[-1]}
        return ParameterCard(
            kind, study, name, tuple(p.on_card(confidence) for p in parts), tuple(map(tuple, covariance.tolist())),
            settings, "swings by least squares; a leg is the difference of two bodies", confidence, files(*whose),
            version("pellucid"),
        )  # fmt: skip

    def body(p: Parameter, q: Parameter) -> list[Parameter]:
        weight = replace(
            q, name="gravity", unit="N*m", value=GRAVITY * q.value, standard_error=GRAVITY * q.standard_error
        )
        return [weight, replace(p, name="inertia")]

    def card_covariance(parts: Sequence[Parameter], covariance: np.ndarray) -> np.ndarray:
        """Return the covariance (k, k) of a card's parameters from that of the regression's terms."""
        terms = [empty.form.terms.index({"gravity": "weight_moment"}.get(p.name, p.name)) for p in parts]
        gain = np.array([GRAVITY if p.name == "gravity" else 1.0 for p in parts])
        return covariance[np.ix_(terms, terms)] * np.outer(gain, gain)

    orthosis = [
        *body(empty.inertia, empty.weight_moment),
        *(p for p in empty.others if is_friction(p.name) or p.name == "offset"),
    ]
    made = {"orthosis": card("orthosis", "orthosis", orthosis, card_covariance(orthosis, empty.covariance), None)}
    for who, leg in legs.items():
        limb = body(leg.inertia, leg.weight_moment)
        # The two bodies come from different recordings, so their errors are independent and covariances add.
        both = card_covariance(limb, empty.covariance + leg.loaded.covariance)
        made[f"{who}.limb"] = card("limb", f"{who}.limb", limb, both, None, who)
    return made
