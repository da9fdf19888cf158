"""Fit a transfer function to every recording of a study, and evaluate it on held-out data."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np

from ...._errors import IdentificationError, PellucidError, listed_names
from ....files.fault import Fault
from ....files.recording import Recording
from ....models.estimates import Verdict
from ....models.parameter_card import ParameterCard
from ....study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts, needed_of_parts
from ....study.pages.quantities import percent
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ...input_output import InputOutput, input_output
from ...transfer.fit_transfer_function import (
    MIN_SAMPLES_PER_UNKNOWN,
    Response,
    TransferFit,
    evaluate_transfer_function,
    fit_records,
)
from . import first_look
from .first_look import FirstLook, first_looks
from .transfer_function_table import TransferFunctionTable


@dataclass(frozen=True)
class TransferThresholds:
    """What is held out, and how verdicts and tables are decided."""

    # If no recording is held out, this last share of each recording tests coefficients fitted to the rest.
    held_out_share: float = 1.0 / 3.0
    # A verdict calls a fit of at least this good, and warns of any below. Chosen by judgement; no measurement is
    # recorded.
    good_fit_percent: float = 80.0
    # A warning appears if the fit falls by more percentage points than this from the fitted to the held-out part.
    # Chosen by judgement; no measurement is recorded.
    max_fit_drop_points: float = 10.0
    max_separate_tables: int = 3  # up to this many fits, each has its own table of parameters


TRANSFER_THRESHOLDS = TransferThresholds()


@dataclass(frozen=True, kw_only=True, repr=False)
class TransferResult(Result):
    """Transfer functions of a study's recordings."""

    # Fits by recording; several recordings fitted together stand under their names joined with "+"
    fits: Mapping[str, TransferFit]
    # Held-out responses by recording: the last part of a fitted recording, or all of one that is never fitted
    heldout: Mapping[str, Response]
    refused: Mapping[str, str]  # Reasons by recording that could not be fitted
    unevaluated: Mapping[str, str]  # Reasons by fitted recording of which no part could be held out
    notes: Mapping[str, tuple[str, ...]]  # What was left out of each recording
    units: tuple[str, str]  # Units of input and output
    channels: tuple[str, str]  # Channels of input and output
    looks: Mapping[str, FirstLook]  # First looks by name, made before any fit

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return transfer_answer(self)

    @property
    def single(self) -> dict[str, TransferFit]:
        """Fits of one recording alone, by its name."""
        return {name: fit for name, fit in self.fits.items() if len(fit.responses) == 1}

    def seen_with(self, look: FirstLook) -> TransferFit | None:
        """Return the transfer function fitted to the recordings of a `look`, or to the first that has one."""
        names = ("+".join(look.recordings), *look.recordings)
        return next((self.fits[name] for name in names if name in self.fits), None)


def identify_transfer(study: Study, tell: Progress = quiet) -> TransferResult:
    """Identify a transfer function from every recording of a study with ``[transfer_function]``.

    A fitted recording is also validated: its last third is held out, with coefficients from the rest. A recording that
    is never fitted is evaluated with coefficients from all fitted ones of its participant and condition. Held out means
    that coefficients are frozen and only the initial state is estimated, because no other data contain it.
    """
    asked = study.table(TransferFunctionTable)
    channels = (asked.input, asked.output)
    tell("reading recordings", 0.0)
    recordings = study.recordings()
    units = _units(recordings, channels)
    ready, fits, heldout = dict[str, InputOutput](), dict[str, TransferFit](), dict[str, Response]()
    refused, unevaluated = dict[str, str](), dict[str, str]()
    tell("looking before any model", 0.1)
    looks, unseen = first_looks(recordings, asked)

    def fit(*records: InputOutput) -> TransferFit:
        return fit_records(records, asked.poles, asked.zeros, hold=asked.hold, units=units)

    for k, recording in enumerate(recordings):
        tell(f"fitting {recording.name}", 0.2 + 0.7 * k / len(recordings))
        name = recording.name
        try:
            ready[name] = input_output(recording, channels)
            if recording.use == "fit":
                fits[name] = fit(ready[name])
        except PellucidError as error:
            refused[name] = str(error)
            continue
        if recording.use == "fit":
            try:
                heldout[name] = _last_part(ready[name], fit, asked.hold)
            except PellucidError as error:
                unevaluated[name] = str(error)
    tell("judging", 0.9)
    for recording in (r for r in recordings if r.use == "validate" and r.name in ready):
        group = [r.name for r in recordings if r.name in fits and _same(r, recording)]
        try:
            if not group:
                raise IdentificationError(
                    f"recording '{recording.name}': found no fitted recording of its participant and condition, "
                    "expected one"
                )
            joined = "+".join(group)
            if joined not in fits:
                fits[joined] = fit(*(ready[n] for n in group))
            heldout[recording.name] = evaluate_transfer_function(
                fits[joined].transfer_function, ready[recording.name], hold=asked.hold
            )
        except PellucidError as error:
            refused[recording.name] = str(error)
    if not fits:
        raise IdentificationError("no recording can be fitted:\n" + "\n".join(refused.values()))
    made = TransferResult(
        study=study.name, headline="", tables=(), verdicts=(), rows=(), cards={},
        checksums={r.name: r.checksum for r in recordings}, confidence=asked.confidence,
        fits=fits, heldout=heldout, refused=refused, unevaluated=unevaluated,
        notes={name: record.notes for name, record in ready.items()},
        units=units, channels=channels, looks=looks,
    )  # fmt: skip
    return replace(
        made,
        headline=transfer_answer(made).sentence,
        tables=(*first_look.tables(looks), *_tables(made, recordings)),
        verdicts=(*first_look.verdicts(looks, unseen, channels), *_verdicts(made)),
        rows=tuple(_rows(made, recordings)),
        cards=_cards(made),
    )


def faults(study: Study) -> list[Fault]:
    """Return the faults that keep recordings from being fitted, and the excluded samples.

    `study` [transfer_function].
    """
    asked = study.table(TransferFunctionTable)
    found = []
    for recording in study.recordings():
        file = recording.path.name
        try:
            record = input_output(recording, (asked.input, asked.output))
        except PellucidError as error:
            found.append(
                Fault("refuse", "time_order", file, asked.input, str(error), "a recorded movement", str(error))
            )
            continue
        where = f"{file} (recording {recording.name})"
        for note in record.notes:
            found.append(Fault("note", "gap", file, "time", note, "a sample at every step", f"{where}: {note}"))
        least = MIN_SAMPLES_PER_UNKNOWN * (2 * asked.poles + asked.zeros + 1)
        if len(record) < least:
            text, wanted = f"{len(record)} samples", f"at least {least}"
            message = f"{where}, channel {asked.output}: found {text}, expected {wanted}"
            found.append(Fault("refuse", "too_few_samples", file, asked.output, text, wanted, message))
            continue
        for channel, values in ((asked.input, record.input), (asked.output, record.output)):
            if np.ptp(values) == 0.0:
                text = f"one value, {values[0]:.6g}, in all {len(values)} samples"
                message = f"{where}, channel {channel}: found {text}, expected one that moves"
                found.append(Fault("refuse", "frozen_encoder", file, channel, text, "one that moves", message))
    return found


def _units(recordings: tuple[Recording, ...], channels: tuple[str, str]) -> tuple[str, str]:
    for recording in recordings:
        if all(name in recording for name in channels):
            return recording.channels[channels[0]].unit, recording.channels[channels[1]].unit
    raise IdentificationError(
        f"found no recording with both channels {channels[0]} and {channels[1]}, expected one or more"
    )


def _same(one: Recording, other: Recording) -> bool:
    return (one.participant, one.condition) == (other.participant, other.condition)


def _last_part(record: InputOutput, fit: Callable[..., TransferFit], hold: str) -> Response:
    cut = round((1.0 - TRANSFER_THRESHOLDS.held_out_share) * len(record))
    found = fit(record.part(0, cut, "fitted"))
    return evaluate_transfer_function(found.transfer_function, record.part(cut, len(record), "heldout"), hold=hold)


# --- answer, tables and verdicts ----------------------------------------------------------------------------------


def transfer_answer(found: TransferResult) -> Answer:
    """Return whether the transfer functions predict held-out data."""
    least = TRANSFER_THRESHOLDS.good_fit_percent
    parts = [
        AnswerPart(name, "yes" if r.fit >= least else "no", f"a fit of {r.fit:.1f} % on held-out data")
        for name, r in found.heldout.items()
    ]
    parts += [AnswerPart(name, "cannot say", "not fitted") for name in found.refused]
    inside, outside = [f.responses[0].fit for f in found.single.values()], [r.fit for r in found.heldout.values()]
    good = sum(part.verdict == "yes" for part in parts)
    where = f"has a fit of {min(inside):.1f} to {max(inside):.1f} % on its own data"
    said = f"No data could be held out; each transfer function {where}"
    if outside:
        said = (
            f"On held-out data, the fit is {least:g} % or more for {good} of {len(outside)} recordings "
            f"({min(outside):.1f} to {max(outside):.1f} %, median {np.median(outside):.1f} %){needed_of_parts(parts)}; "
            f"each transfer function {where}"
        )
    count = len(found.checksums)
    judged = "held-out data" if outside else ""
    unfitted = set(found.heldout) - set(found.single)
    if outside and not unfitted:
        judged = f"held-out data: the last {percent(100.0 * TRANSFER_THRESHOLDS.held_out_share)} % of each recording"
    given, response = map(_channel_words, found.channels, found.units)
    return answer_of_parts(
        f"Do transfer functions from the {given} (input) to the {response} (output) predict the {response} of "
        f"held-out data with a fit of {least:g} % or more?",
        f"{said}.",
        parts,
        [AnswerNumber(f"fit of {name} on held-out data", r.fit, "%") for name, r in found.heldout.items()],
        Basis(count - len(found.refused), count, judged=judged, held_out=len(unfitted)),
        improve=_improving(found, [part.name for part in parts if part.verdict == "no"]),
        without_parts="no data could be held out",
        is_relative=True,
    )


def _channel_words(channel: str, unit: str) -> str:
    """Return a channel in plain words: a position in rad is an angle."""
    return "angle" if (channel, unit) == ("position", "rad") else channel.replace("_", " ")


def _improving(found: TransferResult, poor: Sequence[str]) -> tuple[Step, ...]:
    """Return what improves recordings with a `poor` fit: another order or input, or alike excitation throughout.

    Where most recordings fit with this order, the poor ones are to be examined before another order is tried.
    """
    dropped = [name for name in poor if _drops(found, name)]
    steps = []
    lacking = [name for name in poor if name not in dropped]
    if lacking and (sound := _sound_of_this_order(found)):
        best = max(found.heldout[name].fit for name in sound)
        cut = [f"{name}: {note}" for name in lacking for note in found.notes.get(name, ())]
        steps.append(Step(
            f"Look at {_listed(lacking)} first: {len(sound)} of {len(found.heldout)} recordings fit with the same "
            f"order, up to {best:.0f} %. Search those that do not fit for outliers, changed settings and other inputs"
            f"{f' (excluded so far: {_listed(cut)})' if cut else ''}, and record them again"
        ))  # fmt: skip
    elif lacking:
        steps.append(Step(
            f"Try more poles or zeros in [transfer_function], or record the other inputs, in {_listed(lacking)}: a "
            "linear model of this order does not follow the output"
        ))  # fmt: skip
    if dropped:
        steps.append(Step(
            f"Record {_listed(dropped)} longer and with the same excitation throughout: the last "
            f"{percent(100.0 * TRANSFER_THRESHOLDS.held_out_share)} % differs from the rest"
        ))  # fmt: skip
    if found.refused or not poor:
        names = _listed([*found.refused, *found.unevaluated] or list(found.fits))
        steps.append(Step(f"Record {names} again and longer, so that a part can be held out"))
    return tuple(steps)


def _sound_of_this_order(found: TransferResult) -> list[str]:
    """Return the recordings that this order predicts, if they are most: the fault then lies in the other recordings.

    An order that is too low, or an input that is lacking everywhere, shows in most recordings.
    """
    sound = [name for name, r in found.heldout.items() if r.fit >= TRANSFER_THRESHOLDS.good_fit_percent]
    return sound if 2 * len(sound) > len(found.heldout) else []


def _listed(names: Sequence[str]) -> str:
    return listed_names(names, MAX_NAMED_RECORDINGS)


MAX_NAMED_RECORDINGS = 3
"""Largest number of recordings that a step names."""


def _drops(found: TransferResult, name: str) -> bool:
    """Return whether a recording's held-out part is fitted far worse than the whole."""
    made, out = found.fits.get(name), found.heldout.get(name)
    return bool(made and out and out.fit < made.responses[0].fit - TRANSFER_THRESHOLDS.max_fit_drop_points)


def _tables(found: TransferResult, recordings: Sequence[Recording]) -> Iterator[ParameterTable | FigureTable]:
    fits = found.fits
    shown = next(iter(fits.values()))
    inside = {name: f.responses[0].fit for name, f in found.single.items()}
    outside = {name: r.fit for name, r in found.heldout.items()}
    rows = tuple((r.name, inside.get(r.name), outside.get(r.name)) for r in recordings)
    yield FigureTable("Fit of the simulated output", ("Recording", "Fit [%]", "Held out [%]"), rows)
    for title, each in (("Coefficients", shown.parameters), ("Inertia, damping, stiffness", shown.physical)):
        if each:
            heads = ("Recording", *(f"{p.name} [{p.unit}]" for p in each))
            yield FigureTable(title, heads, tuple((n, *(f[p.name].value for p in each)) for n, f in fits.items()))
    if len(fits) <= TRANSFER_THRESHOLDS.max_separate_tables:
        yield from (ParameterTable(name, f.every) for name, f in fits.items())
    if found.refused:
        yield FigureTable("Refused", ("Recording", "Why"), tuple(found.refused.items()))


def _verdicts(result: TransferResult) -> Iterator[Verdict]:
    fits = result.fits
    good = {n: f for n, f in fits.items() if min(r.fit for r in f.responses) >= TRANSFER_THRESHOLDS.good_fit_percent}
    if good:
        yield Verdict(
            "good",
            f"{len(good)} of {len(fits)} transfer functions fit by {TRANSFER_THRESHOLDS.good_fit_percent:g} % or more.",
        )
    worst = {n: min(r.fit for r in f.responses) for n, f in fits.items() if n not in good}
    if worst:
        low, high = f"{min(worst.values()):.1f}", f"{max(worst.values()):.1f}"
        one, by = len(worst) == 1, low if low == high else f"{low} to {high}"
        cause = "The system is nonlinear, has more poles, or has other inputs."
        if sound := _sound_of_this_order(result):
            cause = (
                f"{len(sound)} of {len(result.heldout)} recordings fit with the same order: these differ by outliers, "
                "settings, or other inputs."
            )
        yield Verdict(
            "warning",
            f"Recording{'s' * (not one)} {', '.join(worst)}: the fit of the transfer function is only {by} %. "
            f"{cause}",
        )
    for name, made in fits.items():
        weak = [p.name for p in made.parameters if not p.identifiable]
        if weak:
            clause = "interval of {} contains" if len(weak) == 1 else "intervals of {} contain"
            yield Verdict("warning", f"Recording {name}: the {clause.format(', '.join(weak))} zero.")
        if _drops(result, name):
            out = result.heldout[name]
            yield Verdict(
                "warning",
                f"Recording {name}: coefficients from its first part have a fit of {out.fit:.1f} % on the last part, "
                f"against {made.responses[0].fit:.1f} % overall: the system or its excitation changes.",
            )
        for note in made.notes:
            yield Verdict("note", f"Recording {name}: {note}.")
    for name, notes in result.notes.items():
        for note in notes:
            yield Verdict("note", f"Recording {name}: {note}.")
    for name, reason in result.refused.items():
        yield Verdict("warning", f"Recording {name}: not fitted. {reason}.")
    for name, reason in result.unevaluated.items():
        yield Verdict("note", f"Recording {name}: not validated. {reason}.")


# --- rows and cards -------------------------------------------------------------------------------------------------


def _rows(made: TransferResult, recordings: Sequence[Recording]) -> Iterator[ResultRow]:
    head = f"{made.study}.transfer_function"
    yield from first_look.rows(head, made.looks, made.checksums)
    for r in recordings:
        left = "; ".join(made.notes.get(r.name, ()))
        split = "fitted" if r.use == "fit" else "heldout"
        own = ResultRow("", None, "%", "identify", split, r.checksum, left)
        if r.name in made.refused:
            yield replace(own, id=f"{head}.fit.{r.name}", note=f"not fitted: {made.refused[r.name]}")
            continue
        out = made.heldout.get(r.name)
        if r.use != "fit":
            note = _joined("coefficients from fitted recordings, initial state estimated", left)
            yield replace(own, id=f"{head}.fit.{r.name}", value=out.fit, note=note)
            continue
        found = made.fits[r.name]
        response = found.responses[0]
        about = _joined(_method(found), left, *found.notes)
        yield replace(own, id=f"{head}.fit.{r.name}", value=response.fit, note=about)
        last = replace(own, id=f"{head}.heldout_fit.{r.name}", split="heldout")
        if out is None:
            yield replace(last, note=made.unevaluated.get(r.name, "not judged"))
        else:
            yield replace(last, value=out.fit, note="last third; coefficients from the rest, initial state estimated")
        yield replace(own, id=f"{head}.rmse.{r.name}", value=response.rmse, unit=made.units[1])
        gain = found.transfer_function.static_gain
        unit = found.physical[-1].unit if found.physical else None
        note = "stiffness is one over it" if unit else ""
        yield replace(own, id=f"{head}.static_gain.{r.name}", value=gain, unit=ratio(made.units), note=note)
        for p in found.every:
            low, high = p.interval(made.confidence)
            note = f"{100.0 * made.confidence:.4g} % interval {low:.6g} to {high:.6g}"
            note += "" if p.identifiable else "; contains zero"
            yield replace(own, id=f"{head}.{p.name}.{r.name}", value=p.value, unit=p.unit, note=note)


def ratio(units: tuple[str, str]) -> str:
    """Return the unit of output over input, from the `units` of input and output."""
    given, made = units
    return f"{made}/({given})" if "*" in given or "/" in given else f"{made}/{given}"


def _joined(*parts: str) -> str:
    return "; ".join(p for p in parts if p)


def _method(found: TransferFit) -> str:
    words = {"zero": "input held from sample to sample", "first": "input straight from sample to sample"}
    return f"100 (1 - |y - ys|/|y - mean y|); output error, initial state estimated, {words[found.hold]}"


def _cards(made: TransferResult) -> dict[str, ParameterCard]:
    cards = {}
    for name, found in made.fits.items():
        file = f"transfer_function.{name}"
        members = name.split("+")
        out = [made.heldout[n].fit for n in members if n in made.heldout]
        cards[file] = ParameterCard(
            kind="transfer_function",
            study=made.study,
            name=file,
            parameters=tuple(p.on_card(made.confidence) for p in found.parameters),
            covariance=tuple(tuple(float(x) for x in row) for row in found.covariance),
            settings={
                "input": made.channels[0],
                "output": made.channels[1],
                "input_unit": made.units[0],
                "output_unit": made.units[1],
                "poles": found.transfer_function.order,
                "zeros": len(found.transfer_function.numerator) - 1,
                "hold": found.hold,
                "fit": min(r.fit for r in found.responses),
                "residual_sd": found.residual_sd,
            }
            | ({"heldout_fit": min(out)} if out else {}),
            processing=_method(found),
            confidence=made.confidence,
            checksums={n: made.checksums[n] for n in members},
            pellucid=version("pellucid"),
        )
    return cards
