"""Finding: a recording contradicts the others, because a parameter estimated from it is far from theirs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import ndtri

from ....models.parameter import Verdict
from ....study.pages.quantities import number, parameter_label, unit_text
from ...fit.recording_agreement import BODY_PARAMETERS, Disagreement, find_disagreements
from ..joint_case import JointCase
from ..unstated_payload import PAYLOAD_ADVICE, estimate_without, unstated_payload

MIN_SCALE_DIFFERENCE = 0.1
"""A recording differs by a factor on the effort if that factor is farther than this from 1."""

MIN_ZERO_DIFFERENCE_RAD = np.radians(5.0)
"""A recording differs by its encoder zero if the zeros are farther apart than this [rad]."""

MIN_RECORDINGS_FOR_PAYLOADS = 3
"""Among at least this many fitted recordings each is tested for a payload, though its own estimate contradicts none: of
two, neither can be told to be the one without it."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report each contradicting recording, its parameters, and those of the others."""
    names = {m.recording for m in case.excerpt}
    if len(names) < 2:
        return
    found, fitted = _find_disagreements(case), {m.recording for m in case.excerpt if m.split == "fitted"}
    for i, each in enumerate(found):
        others = fitted - {each.recording}
        rest = next(iter(others)) if len(others) == 1 and (each.split == "fitted" or len(fitted) == 1) else ""
        payload = None
        if {"gravity", "inertia"} & set(each.own) and case.fit.model.effort_unit == "N*m":
            payload = unstated_payload(*estimate_without(case, [d.recording for d in found]), each.recording, case)
        yield _verdict(case, each, rest, 12.0 - 0.01 * i, payload)
    if not found and len(fitted) >= MIN_RECORDINGS_FOR_PAYLOADS:
        for name in sorted(fitted):
            payload = unstated_payload(*estimate_without(case, [name]), name, case)
            if payload is not None:
                yield Verdict("warning", f"Recording '{name}' differs. {payload}", PAYLOAD_ADVICE, weight=10.0)


def _find_disagreements(case: JointCase) -> tuple[Disagreement, ...]:
    """Find disagreements with the best family, or with families that fit better if it finds none in the body."""
    fits = sorted(case.fits.values(), key=lambda f: (f.family != case.best, f.fitted_effort_error))
    every = [find_disagreements(f.model, f.estimate.array, case.excerpt) for f in fits]
    bodily = [found for found in every if any(BODY_PARAMETERS & set(each.own) for each in found)]
    return (bodily or every)[0]


def _verdict(case: JointCase, each: Disagreement, rest: str, weight: float, payload: str | None) -> Verdict:
    times = float(ndtri(0.5 + 0.5 * case.level))

    def text(name: str, value: tuple[float, float]) -> str:
        unit = unit_text(case.fit.model.unit(name))
        return f"{number(*value)} ± {number(times * value[1], value[1])} {unit}".rstrip()

    others = f"from '{rest}'" if rest else "from the others"
    apart = "; ".join(
        f"{parameter_label(name)} is {text(name, each.own[name])} from it alone, "
        f"{text(name, each.others[name])} {others}, {number(each.together[name], digits=3)} from what was fitted"
        for name in each.own
    )
    sentence = f"Recording '{each.recording}' contradicts {repr(rest) if rest else 'the others'}: {apart}."
    which = f"'{each.recording}'" + (f" and in '{rest}'" if rest else "")
    if payload is not None:
        sentence += f" {payload}"
        return Verdict("wrong", sentence, PAYLOAD_ADVICE, weight=weight)
    if "gravity_cosine" in each.own and abs(each.turned) > MIN_ZERO_DIFFERENCE_RAD:
        sentence += f" By its weight, its angle reads {-np.degrees(each.turned):+.1f} deg against theirs."
        do = f"Check the encoder's zero in {which}: an offset of its own in that recording's channels puts it right"
    elif np.isfinite(each.scale) and abs(each.scale - 1.0) > MIN_SCALE_DIFFERENCE:
        sentence += f" Its effort is {each.scale:.3g} times what the others' model asks for."
        do = f"Check the drive's unit, scale and sign in {which}"
    else:
        do = f"Check what moved in {which}: a payload that is not stated, another machine, other settings"
    return Verdict("wrong", sentence, f"{do}; or leave it out.", weight=weight)
