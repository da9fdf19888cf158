"""Say from the record of an incident why a supervised law stopped: which watch acted, and how far each one was."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..._printed_command import printed_command
from ...numerics.arguments import with_checked_arguments
from ...study.answer import Answer, AnswerNumber, AnswerVerdict, Basis, Step
from ...study.pages.quantities import MINUS_SIGN, MOTION_READINGS, number, unit_text
from ..incident import Incident, read_incident
from ..supervisor_faults import NO_FAULT, SUPERVISOR_FAULTS_BY_NAME

if TYPE_CHECKING:
    import pandas

POWERLESS_MODES = ("zero", "latched")
"""Modes of the supervisor in which nothing is asked of the drive."""

FEEDBACK_NAMES = ("drive", "joint")
"""Names of samples that are no sensor of the law: the drive's measurement and a second encoder."""

STOPPED_MODES = ("damped_stop", *POWERLESS_MODES)
"""Modes of the supervisor in which the law no longer acts."""

NEAREST_WATCH_COUNT = 8
"""Number of watches that are printed, those nearest to their thresholds first."""

STOP_QUESTION = "Does the record show why the supervisor stopped the controller?"
"""Question that the account of an incident answers."""

LARGE_SHARE = 10.0
"""Smallest share of a threshold that is reported as a multiple, not in percent [1]."""

SHOWN_DIGITS = 3
"""Significant digits of printed values."""


@dataclass(frozen=True)
class WatchDistance:
    """Largest value of one monitor relative to its threshold, up to the stop."""

    name: str
    share: float  # largest value over threshold; 1 or more is a fault [1]
    value: float  # value then, SI
    threshold: float  # threshold then, SI
    unit: str  # SI unit of both as plain text, "1" for none
    time: float  # time since the stop, which is negative before it [s]
    sentence: str  # what the value is


@dataclass(frozen=True)
class IncidentAccount:
    """What the record of an incident says; `str` of it are its sentences.

    Attributes
    ----------
    record : Incident
        The whole record: samples, efforts, watches and thresholds.
    path : str
        File of the record as it was given; "" without one.
    """

    record: Incident
    path: str = ""

    @property
    def answer(self) -> Answer:
        """Whether the record shows why the supervisor stopped the law, in the words of `sentences`."""
        record, acting = self.record, self.acting
        count = len(record.time)
        _, said = self.sentences[1 if record.damages else 0]  # damages of the record are told before
        verdict: AnswerVerdict = "yes"
        reason = ""
        numbers: tuple[AnswerNumber, ...] = ()
        if record.stop is None:
            verdict, reason = "no", "the record contains no stop"
        elif acting is None and self._has_watch_of(self.fault):
            verdict, reason = "cannot say", "no check of this fault exceeded its threshold in the record of the stop"
        nearest = acting or (self.watches[0] if self.watches else None)
        if nearest is not None:
            numbers = (AnswerNumber(f"value over threshold of the watch {nearest.name}", nearest.share, "1"),)
        known = SUPERVISOR_FAULTS_BY_NAME.get(self.fault)
        steps = [Step(known.advice)] if known and record.stop is not None else []
        if self.path:
            listing = printed_command("incident", self.path, "--json")
            steps.append(Step("Print every watch with its value and its threshold", line=listing))
        basis = Basis(count, count, "record")
        return Answer(STOP_QUESTION, verdict, said, reason, numbers=numbers, basis=basis, next=tuple(steps))

    @property
    def fault(self) -> str:
        """Fault of the stop; "none" where the record has no stop."""
        return NO_FAULT if self.record.stop is None else self.record.fault[self.record.stop]

    @cached_property
    def time(self) -> np.ndarray:
        """Times of the records since the stop, or before the last record without one, shape (n,) [s]."""
        last = len(self.record.time) - 1 if self.record.stop is None else self.record.stop
        return self.record.time - self.record.time[last] if len(self.record.time) else self.record.time

    @cached_property
    def watches(self) -> tuple[WatchDistance, ...]:
        """Every watch that watched up to the stop, the one nearest to its threshold first."""
        end = len(self.record.time) if self.record.stop is None else self.record.stop + 1
        made = []
        for name, watch in self.record.watches.items():
            share = watch.share[:end]
            if not np.any(share == share):
                continue
            i = int(np.nanargmax(share))
            value, threshold = float(watch.value[i]), float(watch.threshold[i])
            made.append(
                WatchDistance(name, float(share[i]), value, threshold, watch.unit, self.time[i], watch.sentence)
            )
        return tuple(sorted(made, key=lambda one: -one.share))

    @cached_property
    def beyond(self) -> tuple[WatchDistance, ...]:
        """The watches of the fault that were beyond their thresholds in the record of the stop, the acting one first.

        The acting one is the one that was not beyond its threshold in the record before.
        """
        stop = self.record.stop
        if stop is None:
            return ()
        alike: tuple[str, ...] = (self.fault,)
        if self.fault in SUPERVISOR_FAULTS_BY_NAME and not self._has_watch_of(self.fault):
            alike = SUPERVISOR_FAULTS_BY_NAME[self.fault].names
        made = []
        for name, watch in self.record.watches.items():
            share = float(watch.share[stop])
            if watch.fault in alike and share >= 1.0:
                earlier = stop > 0 and bool(watch.share[stop - 1] >= 1.0)
                value, threshold = float(watch.value[stop]), float(watch.threshold[stop])
                made.append(
                    (earlier, -share, WatchDistance(name, share, value, threshold, watch.unit, 0.0, watch.sentence))
                )
        return tuple(one for *_, one in sorted(made, key=lambda entry: entry[:2]))

    @property
    def acting(self) -> WatchDistance | None:
        """The watch that stopped the law, as it was in that record; None if the fault has no value to watch."""
        return self.beyond[0] if self.beyond else None

    def _has_watch_of(self, fault: str) -> bool:
        return any(watch.fault == fault for watch in self.record.watches.values())

    @property
    def seconds_until_powerless(self) -> float:
        """Time from the stop until the drive had no power; NaN if the record ends before [s]."""
        stop = self.record.stop
        if stop is None:
            return math.nan
        mode, enable = self.record.mode, self.record.enable
        off = [i for i in range(stop, len(mode)) if mode[i] in POWERLESS_MODES or not enable[i]]
        return float(self.time[off[0]]) if off else math.nan

    @property
    def effort_before(self) -> float:
        """Last effort before the record of the stop; NaN without one [N m or N]."""
        stop = self.record.stop
        return math.nan if not stop else float(self.record.effort[stop - 1])

    @property
    def power_before(self) -> float:
        """Power of that effort on the moving joint, negative where it braked; NaN without one [W]."""
        speed = self.record.watches.get("raw_speed")
        if not self.record.stop or speed is None:
            return math.nan
        return self.effort_before * float(speed.value[self.record.stop - 1])

    @cached_property
    def sentences(self) -> tuple[tuple[str, str], ...]:
        """The account as sentences, each with its kind: "good", "note" or "warning"."""
        record = self.record
        said: list[tuple[str, str]] = []
        if record.damages:
            times = "once" if record.damages == 1 else f"{record.damages} times"
            said.append(("warning", f"The recorder detected damaged memory {times} and restarted its record."))
        if record.stop is None:
            nearest = f" {_nearest_text(self.watches[0])}" if self.watches else ""
            length = float(np.ptp(record.time)) if len(record.time) else 0.0
            return (*said, ("good", f"The supervisor did not stop within these {length:.3g} s.{nearest}"))
        return (
            *said,
            ("warning", f"{self._fault_text}{self._position_text}"),
            *self._watch_sentences,
            ("note", self._response_text(record.mode[record.stop])),
            *([("note", self._otherwise_text)] if math.isfinite(self.effort_before) else []),
            *([("note", known.advice)] if (known := SUPERVISOR_FAULTS_BY_NAME.get(self.fault)) else []),
        )

    @property
    def _fault_text(self) -> str:
        known, record = SUPERVISOR_FAULTS_BY_NAME.get(self.fault), self.record
        sensors = len(record.samples) - len(FEEDBACK_NAMES)
        # The file does not state how often the law accepts the same sample.
        why = f": {known.when_of_law(sensors, math.nan)}".replace(" nan times", " N times") if known else ""
        return f'The supervisor stopped the controller "{record.law}" for the fault "{self.fault}"{why}.'

    @property
    def _position_text(self) -> str:
        position, stop = self.record.samples.get("position"), self.record.stop
        said = " The encoder gave no valid position then"
        if position is None or stop is None:
            return f"{said}."
        valid = np.flatnonzero(np.isfinite(position[: stop + 1])).tolist()
        if not valid:
            return f"{said}."
        reading = MOTION_READINGS["prismatic" if self.record.prismatic else "rotary"]
        there = f"{number(reading.scale * float(position[valid[-1]]), digits=SHOWN_DIGITS)} {reading.position}"
        if valid[-1] == stop:
            return f" The joint was at {there}."
        return f"{said}; the last one was {there}, {-1e3 * float(self.time[valid[-1]]):.3g} ms before."

    @property
    def _watch_sentences(self) -> list[tuple[str, str]]:
        acting, others = self.acting, list(self.watches)
        if acting is None:
            said = "This fault is detected in a single period and has no value that approaches a threshold."
        else:
            value, threshold = quantity(acting.value, acting.unit), quantity(acting.threshold, acting.unit)
            said = (
                f'The check "{acting.name}" ({acting.sentence}) caused the stop: its value was {value}, '
                f"{share_text(acting.share)} its threshold of {threshold}."
            )
            others = [one for one in others if one.name != acting.name]
        return [("note", f"{said} {_nearest_text(others[0], other=True)}" if others else said)]

    def _response_text(self, then: str) -> str:
        seconds, power_off = self.seconds_until_powerless, "the drive had no power"
        if then in POWERLESS_MODES or seconds == 0.0:
            return f"Then {power_off}: it was switched off in the period in which the fault was detected."
        if math.isfinite(seconds):
            return f"A damped stop followed; {seconds:.3g} s later {power_off}."
        left = float(self.time[-1])
        return f"A damped stop followed; the record ends {left:.3g} s later, while the drive still had power."

    @property
    def _otherwise_text(self) -> str:
        effort = quantity(self.effort_before, "N" if self.record.prismatic else "N*m")
        power = self.power_before
        size = quantity(abs(power), "W")
        gave = f", which gave {size} to the joint" if power >= 0.0 else f", which took {size} from the joint"
        said = f"Just before, the controller commanded {effort}{gave if math.isfinite(power) else ''}."
        return f"{said} Without the supervisor it would have continued."

    def __str__(self) -> str:
        return " ".join(text for _, text in self.sentences)

    def watch_table(self, most: int | None = None) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return heads and rows of the table of watches.

        Parameters
        ----------
        most : int, optional
            Number of rows at most; all by default.

        Returns
        -------
        tuple
            Heads, and rows of text, the watch nearest to its threshold first.
        """
        rows: list[tuple[str, ...]] = [
            (
                one.name,
                share_text(one.share).removesuffix(" of"),
                quantity(one.value, one.unit),
                quantity(one.threshold, one.unit),
                f"{1e3 * one.time:.4g} ms".replace("-", MINUS_SIGN),
            )
            for one in self.watches[:most]
        ]
        return ("watch", ">of its threshold", ">value", ">threshold", ">after the stop"), rows

    def to_frame(self) -> pandas.DataFrame:
        """Return the records as a data frame; the same as ``record.to_frame()``.

        Returns
        -------
        pandas.DataFrame
            One row for each record, SI.

        Raises
        ------
        PellucidError
            If pandas is not installed.
        """
        return self.record.to_frame()


@with_checked_arguments
def incident(path: str | Path) -> IncidentAccount:
    """Read the file that a controller's recorder wrote, and say why the supervisor stopped.

    Parameters
    ----------
    path : path
        File, such as `SupervisedLaw.incident` gives or an exported controller writes.

    Returns
    -------
    IncidentAccount
        Its sentences (``print`` shows them), its watches by their distance from the threshold, and the record.

    Raises
    ------
    PellucidError
        If the file is missing, truncated, damaged, or no record of an incident.

    Examples
    --------
    >>> import pellucid as pl
    >>> print(pl.incident("incident.bin"))                                    # doctest: +SKIP
    """
    return IncidentAccount(read_incident(path), str(path))


def account_table(account: IncidentAccount) -> dict[str, object]:
    """Return what an account says as a table for JSON, SI; None stands for what is not finite or not there."""

    def finite(x: float) -> float | None:
        return float(x) if math.isfinite(x) else None

    def distance(one: WatchDistance) -> dict[str, object]:
        return {
            "name": one.name,
            "share": finite(one.share),
            "value": finite(one.value),
            "threshold": finite(one.threshold),
            "unit": one.unit,
            "seconds_after_stop": finite(one.time),
        }

    return {
        "answer": account.answer.table(),
        "law": account.record.law,
        "fault": account.fault,
        "stop_time": None if account.record.stop is None else finite(account.record.time[account.record.stop]),
        "acting_watch": None if account.acting is None else distance(account.acting),
        "seconds_until_powerless": finite(account.seconds_until_powerless),
        "effort_before": finite(account.effort_before),
        "power_before": finite(account.power_before),
        "watches": [distance(one) for one in account.watches],
        "sentences": [text for _, text in account.sentences],
    }


def quantity(value: float, unit: str) -> str:
    """Return a value with its unit for readers."""
    if not math.isfinite(value):
        return "not a number" if value != value else "infinite"
    if unit == "1":
        return f"{value:g}"
    return f"{number(value, digits=SHOWN_DIGITS)} {unit_text(unit)}"


def share_text(share: float) -> str:
    """Return a share of a threshold for readers, to stand before the threshold: "83 % of", "12 times"."""
    if not math.isfinite(share):
        return "far beyond"
    return f"{100.0 * share:.0f} % of" if share < LARGE_SHARE else f"{share:.3g} times"


def _nearest_text(one: WatchDistance, other: bool = False) -> str:
    which = "Of the other checks" if other else "Of all checks"
    far = "exceeded its threshold most" if one.share > 1.0 else "came nearest to its threshold"
    return f'{which}, "{one.name}" {far}: {share_text(one.share)} it.'
