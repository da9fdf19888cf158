"""List the instruments that an exported supervisor was built for, in words, with units and sources."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..instruments import CompleteInstruments, Instruments
from ..worn import completed_by_spring


@dataclass(frozen=True)
class ListedInstrument:
    """One line of the list."""

    words: str  # what is measured, or how well
    value: str  # number with its unit
    stated: bool  # whether study.toml states another value than the usual one, which is assumed


def list_instruments(
    instruments: Instruments, effort_limit: float, *, coordinate: str, effort: str, spring: bool
) -> tuple[ListedInstrument, ...]:
    """Return the list for a law with an `effort_limit`, in the units `coordinate` and `effort`.

    `spring` tells whether the law drives a series spring, whose usual accuracy is another.
    """

    def complete(given: Instruments) -> CompleteInstruments:
        return completed_by_spring(given, effort_limit) if spring else given.completed(effort_limit)

    used, usual = complete(instruments), complete(Instruments())
    lines: list[ListedInstrument] = []

    def add(words: str, name: str, unit: str) -> None:
        value = getattr(used, name)
        shown = "not known" if not math.isfinite(value) else f"{value:.4g} {unit}".rstrip()
        lines.append(ListedInstrument(words, shown, value != getattr(usual, name)))

    def add_switch(words: str, name: str) -> None:
        value = getattr(used, name)
        lines.append(ListedInstrument(words, "yes" if value else "no", value))

    add("error of one encoder reading", "encoder_resolution", coordinate)
    add_switch("second encoder behind the transmission", "joint_encoder")
    if used.joint_encoder:
        add("largest difference of both encoders", "joint_tolerance", coordinate)
    if used.spring_stiffness is not None:
        value = f"{used.spring_stiffness:.4g} {effort}/{coordinate}"
        lines.append(ListedInstrument("stiffness of the spring", value, True))
    add_switch("measurement of the drive's effort", "drive")
    if used.drive:
        add("its relative error", "drive_gain_error", "")
        add("its offset", "drive_offset", effort)
        add("its noise, standard deviation", "drive_noise", effort)
        add("its lag", "drive_lag", "s")
    if used.drive or used.probe:
        add("largest effort of the drive", "drive_limit", effort)
    add("range of the force sensor", "force_range", effort)
    add("relative error of the force sensor", "force_gain_error", "")
    add("offset of the force sensor", "force_offset", effort)
    add("largest torque in the EMG calibration", "emg_range", effort)
    answer = "not measured" if used.start_up_answer is None else f"{used.start_up_answer:.4g} J"
    lines.append(
        ListedInstrument("work of the start-up wave at commissioning", answer, used.start_up_answer is not None)
    )
    add_switch("probe of encoder and drive while the law runs", "probe")
    if used.probe:
        answered = used.probe_answer is not None
        value = "stated" if answered else "not measured"
        lines.append(ListedInstrument("answer to the probe at commissioning", value, answered))
    if not spring:
        watched = "yes" if used.shaking else "no"
        lines.append(ListedInstrument("check for sustained oscillation (shaking)", watched, not used.shaking))
    return tuple(lines)
