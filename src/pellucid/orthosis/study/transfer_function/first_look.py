"""Check before any fit how far a linear model can hold: frequency response, noise and, with periods, distortion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...._errors import IdentificationError, PellucidError
from ....files.recording import Recording
from ....models.estimates import Verdict
from ....numerics.protocols.excitation import MULTISINE_NAME as PROTOCOL
from ....study.procedures.result import FigureTable
from ....study.results import ResultRow
from ...transfer.best_linear_approximation import (
    BestLinearApproximation,
    LocalResponse,
    best_linear_approximation,
    local_response,
)
from .transfer_function_table import TransferFunctionTable


@dataclass(frozen=True)
class LookThresholds:
    """Thresholds of the look at recordings before any model."""

    # A warning appears if the best fit that a linear model can reach has its upper confidence limit below this.
    linear_fit_warning_percent: float = 90.0
    distortion_test_level: float = 0.05  # level of the test for distortion; below this p-value distortion is reported
    # A recording counts as evenly sampled if no sample is further than this off an even grid, in steps of the grid.
    max_grid_deviation_steps: float = 0.5
    # A reference is periodic if it differs from itself a period later by at most this share of its standard deviation.
    repetition_tolerance: float = 1e-3


LOOK_THRESHOLDS = LookThresholds()


@dataclass(frozen=True, eq=False)
class FirstLook:
    """A frequency response of one recording, or of the realisations of a multisine."""

    name: str
    recordings: tuple[str, ...]
    found: BestLinearApproximation | LocalResponse
    notes: tuple[str, ...] = ()

    @property
    def periodic(self) -> bool:
        """Whether the excitation was periodic, so that noise and distortion can be separated."""
        return isinstance(self.found, BestLinearApproximation)


def first_looks(
    recordings: Sequence[Recording], asked: TransferFunctionTable
) -> tuple[dict[str, FirstLook], dict[str, str]]:
    """Return the first look at every fitted recording by name, and for those that allow none the reason.

    The multisines of one participant and condition are realisations of one look; every other recording has its own.
    """
    found: dict[str, FirstLook] = {}
    unseen: dict[str, str] = {}
    fitted = [r for r in recordings if r.use == "fit"]
    periodic = [r for r in fitted if r.protocol == PROTOCOL and asked.period is not None]
    for who in dict.fromkeys((r.participant, r.condition) for r in periodic):
        members = [r for r in periodic if (r.participant, r.condition) == who]
        name = ".".join((PROTOCOL, *filter(None, who)))
        try:
            found[name] = _of_periods(name, members, asked)
        except PellucidError as error:
            unseen[name] = str(error)
    for r in fitted:
        if any(r.name in look.recordings for look in found.values()):
            continue
        try:
            rate, signals = _even(r, asked)
            found[r.name] = FirstLook(r.name, (r.name,), local_response(*signals[:2], rate, reference=signals[2]))
        except PellucidError as error:
            unseen[r.name] = str(error)
    return found, unseen


def _even(recording: Recording, asked: TransferFunctionTable) -> tuple[float, list[np.ndarray | None]]:
    """Return the rate [Hz], then input, output and reference; refuse gaps and uneven sampling."""
    time = recording.time
    names = [asked.input, asked.output, asked.reference]
    signals = [None if n is None or n not in recording else np.asarray(recording[n]) for n in names]
    where = f"recording '{recording.name}'"
    present = [time, *(x for x in signals if x is not None)]
    bad = ~np.isfinite(np.column_stack(present)).all(axis=1) | ~np.broadcast_to(recording.sound, time.shape)
    if bad.any():
        raise IdentificationError(f"{where}: found {int(bad.sum())} bad samples, expected a number in each")
    if len(time) < 3:
        raise IdentificationError(f"{where}: found {len(time)} samples, expected a recorded movement")
    step = float(time[-1] - time[0]) / (len(time) - 1)
    off = float(np.abs(time - np.linspace(time[0], time[-1], len(time))).max())
    if not (step > 0.0 and off <= LOOK_THRESHOLDS.max_grid_deviation_steps * step):
        raise IdentificationError(
            f"{where}: found samples up to {off:.3g} s off an even grid of {step:.3g} s, expected an even grid; "
            "resample"
        )
    return 1.0 / step, signals


def _of_periods(name: str, members: Sequence[Recording], asked: TransferFunctionTable) -> FirstLook:
    parts, rates, notes = [], [], []
    for recording in members:
        rate, signals = _even(recording, asked)
        samples = round(asked.period * rate)
        if abs(asked.period * rate - samples) > 0.01 * samples**0.5 or samples < 8:
            raise IdentificationError(
                f"recording '{recording.name}': found {asked.period * rate:.6g} samples a period, expected a whole "
                "number"
            )
        begin, end = _repeating(recording, signals, samples)
        if signals[2] is None and not notes:
            notes.append(f"no channel '{asked.reference or 'reference'}': the first period is excluded as unsettled")
        parts.append([None if x is None else x[begin:end] for x in signals])
        rates.append(rate)
    length = min(len(part[0]) for part in parts)
    if any(round(asked.period * rate) != samples for rate in rates):
        raise IdentificationError(f"{name}: found rates of {min(rates):.6g} to {max(rates):.6g} Hz, expected the same")
    if len({part[2] is None for part in parts}) > 1:
        raise IdentificationError(f"{name}: found '{asked.reference}' in some recordings, expected it in all or none")
    inputs, outputs, references = zip(*([None if x is None else x[-length:] for x in p] for p in parts), strict=True)
    found = best_linear_approximation(
        inputs, outputs, float(np.mean(rates)), samples=samples,
        references=None if references[0] is None else references,
    )  # fmt: skip
    if len(members) == 1:
        notes.append(
            "one realisation: distortion at excited lines is estimated from the neighbouring odd lines without "
            "excitation"
        )
    return FirstLook(name, tuple(r.name for r in members), found, tuple(notes))


def _repeating(recording: Recording, signals: Sequence[np.ndarray | None], samples: int) -> tuple[int, int]:
    """Return first and last sample of the longest stretch of whole periods in which the reference repeats.

    Without a reference that is everything but the first period, which counts as unsettled.
    """
    given, n = signals[2], len(signals[0])
    where = f"recording '{recording.name}'"
    if given is None:
        begin, end = samples, n
    else:
        size = float(np.std(given))
        off = np.abs(given[samples:] - given[:-samples]) if n > samples else np.zeros(0)
        same = off <= LOOK_THRESHOLDS.repetition_tolerance * size
        edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
        runs = edges.reshape(-1, 2)
        if not len(runs):
            raise IdentificationError(
                f"{where}: found no period of {samples} samples in the reference, expected the stated one: check "
                "`period`"
            )
        begin, end = (int(x) for x in runs[np.argmax(runs[:, 1] - runs[:, 0])])
        end += samples
    periods = (end - begin) // samples
    if periods < 2:
        raise IdentificationError(
            f"{where}: found {(end - begin) / samples:.2g} settled periods of {samples} samples, expected 2 at least"
        )
    return end - periods * samples, end


# --- verdicts, tables and rows --------------------------------------------------------------------------------------


def verdicts(looks: Mapping[str, FirstLook], unseen: Mapping[str, str], channels: tuple[str, str]) -> Iterator[Verdict]:
    """Yield verdicts on the best fit that a linear model can reach, before one is fitted."""
    path = f"from {channels[0]} to {channels[1]}"
    for look in (each for each in looks.values() if each.periodic):
        found = look.found
        if not found.p_value < LOOK_THRESHOLDS.distortion_test_level:
            yield Verdict(
                "good",
                f"Before any model ({look.name}): {_many(look)} show no distortion beyond noise (p = "
                f"{found.p_value:.2g}); a linear model {path} can fit by {found.highest_fit_noise:.1f} %.",
            )
            continue
        by = ""
        if np.isfinite(found.even_share):
            side = "even" if found.even_share > 0.5 else "odd"
            share = max(found.even_share, 1.0 - found.even_share)
            by = f"; {100.0 * share:.0f} % of the distortion is of {side} order"
        yield Verdict(
            "warning" if found.highest_fit_limit < LOOK_THRESHOLDS.linear_fit_warning_percent else "note",
            f"Before any model ({look.name}): the best possible fit of a linear model {path} is "
            f"{found.highest_fit:.0f} % over {_many(look)} (below {found.highest_fit_limit:.0f} % with 95 % "
            f"confidence); with noise alone it would be {found.highest_fit_noise:.1f} %. The variance of the "
            f"non-linear distortion is {_times(found.nonlinear_to_noise)} times that of the noise{by}.",
        )
    fits = [each.found.fit for each in looks.values() if not each.periodic]
    if fits:
        span = f"{fits[0]:.0f} %" if len(fits) == 1 else f"{min(fits):.0f} to {max(fits):.0f} %"
        yield Verdict(
            "note",
            f"Before any model: a response that is smooth over a few frequencies explains {span} of the output where "
            f"the input excites it ({len(fits)} recording{'s' * (len(fits) != 1)} without periods). The rest is noise "
            f"and distortion together; record {PROTOCOL} to separate them.",
        )
    for look in looks.values():
        for note in look.notes:
            yield Verdict("note", f"Before any model ({look.name}): {note}.")
    for name, reason in unseen.items():
        if name.startswith(PROTOCOL):
            yield Verdict("warning", f"Before any model ({name}): noise and distortion are not separated. {reason}.")


def _times(ratio: float) -> str:
    return f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:,.0f}"


def _many(look: FirstLook) -> str:
    return f"{look.found.realisations} realisation{'s' * (look.found.realisations != 1)}"


def tables(looks: Mapping[str, FirstLook]) -> Iterator[FigureTable]:
    """Yield a table of periodic excitations with the limits of a linear model, and one of all others."""
    periodic = [look for look in looks.values() if look.periodic]
    if periodic:
        heads = ("Realisations of", "Linear at best [%]", "Noise alone [%]", "Distortion / noise", "p")
        each = tuple(
            (n, f.highest_fit, f.highest_fit_noise, f.nonlinear_to_noise, f.p_value if f.p_value >= 1e-3 else "< 0.001")
            for n, f in ((look.name, look.found) for look in periodic)
        )
        yield FigureTable("Before any model: best linear approximation", heads, each)
    others = [look for look in looks.values() if not look.periodic]
    if others:
        each = tuple((look.name, look.found.fit) for look in others)
        yield FigureTable("Before any model: any excitation", ("Recording", "Explained [%]"), each)


def rows(head: str, looks: Mapping[str, FirstLook], checksums: Mapping[str, str]) -> Iterator[ResultRow]:
    """Yield the figures of every look as rows whose ids begin with `head`."""
    for look in looks.values():
        found, own = look.found, checksums[look.recordings[0]] if len(look.recordings) == 1 else None
        if not look.periodic:
            note = "local polynomials, where the input excites; noise and distortion are not separated"
            yield ResultRow(f"{head}.local_response.{look.name}", found.fit, "%", "identify", "fitted", own, note)
            continue
        note = (
            f"best linear approximation of {', '.join(look.recordings)}; {found.periods} periods, "
            f"{len(found.line)} lines, {len(found.left_out.line)} not excited"
        )
        for name, value, unit in (
            ("linear_at_best", found.highest_fit, "%"),
            ("linear_below", found.highest_fit_limit, "%"),
            ("noise_alone", found.highest_fit_noise, "%"),
            ("distortion_to_noise", found.nonlinear_to_noise, "1"),
            ("distortion_p", found.p_value, "1"),
        ):
            yield ResultRow(f"{head}.{name}.{look.name}", value, unit, "identify", "fitted", own, note)
