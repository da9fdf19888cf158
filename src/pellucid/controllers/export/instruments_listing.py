"""List the instruments that an exported supervisor was built for, in words, with units and sources."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from ..instruments import CompleteInstruments, Instruments
from ..worn import completed_by_spring

STATED_SOURCE = "from study.toml"
"""Source of what study.toml states."""

ASSUMED_SOURCE = "assumed, a typical value"
"""Source of a value with which the thresholds were chosen."""

UNKNOWN_SOURCE = "not stated"
"""Source of what has no typical value."""

CHOSEN_SOURCE = "chosen by the export"
"""Source of a probe that study.toml leaves open."""


@dataclass(frozen=True)
class ListedInstrument:
    """One line of the list."""

    words: str  # what is measured, or how well
    value: str  # number with its unit
    source: str  # where the value is from


def list_instruments(
    instruments: Instruments,
    effort_limit: float,
    *,
    coordinate: str,
    effort: str,
    spring: bool,
    sensors: Collection[str],
    start_up_wave: float,
    probe_window: float,
) -> tuple[ListedInstrument, ...]:
    """Return the list for a law with an `effort_limit`, in the units `coordinate` and `effort`.

    `spring` tells whether the law drives a series spring, whose usual accuracy is another. `sensors` are the optional
    sensors that the law uses, by name; others are not listed. `start_up_wave` is the amplitude of the export's own
    start-up wave, and `probe_window` the duration of the windows of its probe [s].
    """

    def complete(given: Instruments) -> CompleteInstruments:
        return completed_by_spring(given, effort_limit) if spring else given.completed(effort_limit)

    used = complete(instruments)
    lines: list[ListedInstrument] = []

    def list_value(words: str, name: str, value: str, otherwise: str = ASSUMED_SOURCE) -> None:
        lines.append(ListedInstrument(words, value, STATED_SOURCE if name in instruments.stated else otherwise))

    def add(words: str, name: str, unit: str) -> None:
        number = getattr(used, name)
        if math.isfinite(number):
            list_value(words, name, f"{number:.4g} {unit}".rstrip())
        else:
            list_value(words, name, "not known", UNKNOWN_SOURCE)

    def add_switch(words: str, name: str, otherwise: str = ASSUMED_SOURCE) -> None:
        list_value(words, name, "yes" if getattr(used, name) else "no", otherwise)

    add("error of one encoder reading", "encoder_resolution", coordinate)
    add_switch("second encoder behind the transmission", "joint_encoder")
    if used.joint_encoder:
        add("largest difference of both encoders", "joint_tolerance", coordinate)
    if used.spring_stiffness is not None:
        add("stiffness of the spring", "spring_stiffness", f"{effort}/{coordinate}")
    add_switch("measurement of the drive's effort", "drive")
    if used.drive:
        add("its relative error", "drive_gain_error", "")
        add("its offset", "drive_offset", effort)
        add("its noise, standard deviation", "drive_noise", effort)
        add("its lag", "drive_lag", "s")
        add("its reading per commanded effort", "drive_answer", "")
    if used.drive or used.probe:
        add("largest effort of the drive", "drive_limit", effort)
    if "interaction" in sensors:
        add("range of the force sensor", "force_range", effort)
        add("relative error of the force sensor", "force_gain_error", "")
        add("offset of the force sensor", "force_offset", effort)
    if "muscle" in sensors:
        add("largest torque in the EMG calibration", "emg_range", effort)
    answer = "not measured" if used.start_up_answer is None else f"{used.start_up_answer:.4g} J"
    if used.start_up_answer is not None and start_up_wave > 0.0 and instruments.answer_to(start_up_wave) is None:
        answer += f", not used: this export's wave has {start_up_wave:.4g} {effort}; run pellucid commission again"
    list_value("work of the start-up wave at commissioning", "start_up_answer", answer, UNKNOWN_SOURCE)
    if used.start_up_wave is not None:
        add("amplitude of that wave", "start_up_wave", effort)
    add_switch("probe of encoder and drive while the law runs", "probe", CHOSEN_SOURCE)
    if used.probe:
        answer = "not measured" if used.probe_answer is None else "used"
        if used.probe_answer is not None and instruments.answer_to_probe(probe_window) is None:
            answer = f"not used: the windows of this export last {probe_window:.4g} s; run pellucid commission again"
        list_value("answer to the probe at commissioning", "probe_answer", answer, UNKNOWN_SOURCE)
        if used.probe_window is not None:
            add("duration of the windows at commissioning", "probe_window", "s")
    if not spring:
        add_switch("check for sustained oscillation (shaking)", "shaking", CHOSEN_SOURCE)
    return tuple(lines)
