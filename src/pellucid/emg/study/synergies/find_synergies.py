"""Find the synergies of every participant and condition, their number, and their similarity."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from ...._errors import IdentificationError, RecordingError
from ....files.fault import Fault
from ....models.estimates import Verdict
from ....study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, Result
from ....study.results import ResultRow, combined_checksum
from ....study.study import Study
from ...estimators.synergies import (
    SYNERGY_FIT,
    CommonNumber,
    Synergies,
    SynergyCount,
    chance_similarity,
    common_number,
    count_synergies,
    find_synergies,
    largest_envelopes,
    require_envelopes,
    similarity,
    vaf,
)
from ..muscle_channels import MuscleEnvelopes, emg_faults, envelope_faults, raise_refusals, relative_envelopes
from .synergies_table import SynergiesTable

DRAWN_STRETCH_S = 6.0
"""Duration of the drawn stretch of a recording [s]."""


@dataclass(frozen=True, eq=False)
class GroupSynergies:
    """Synergies of one group: a participant under one condition."""

    name: str  # Participant and condition in words
    synergies: Synergies
    count: SynergyCount  # Variance that each number of synergies explains, of held-out samples
    within: SynergyCount  # The same, of blocks of the fitted recordings left out in turn; it chooses the number
    judged_on: str  # Held-out samples, in words
    time: np.ndarray = field(repr=False)  # Time of the drawn stretch of one recording, shape (k,) [s]
    envelopes: np.ndarray = field(repr=False)  # Envelopes in the stretch, shape (k, m)
    activations: np.ndarray = field(repr=False)  # Activations of the synergies in the stretch, shape (k, s)


@dataclass(frozen=True)
class GroupSimilarity:
    """Similarity of the synergies of two groups."""

    one: str  # Name of the first group
    other: str  # Name of the second group
    cosine: float  # Mean cosine of matched synergies
    chance: float  # Cosine that randomly permuted weights exceed once in twenty
    crossed: float  # VAF of the second group's envelopes by the first group's weights


@dataclass(frozen=True, kw_only=True, repr=False)
class SynergiesResult(Result):
    """Result of `synergies`."""

    groups: tuple[GroupSynergies, ...] = field(default=(), repr=False)
    alike: tuple[GroupSimilarity, ...] = ()

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return synergies_answer(self)

    def written(self, study: Study) -> str:
        return "Weights and variances of each group are rows"


def faults(study: Study) -> list[Fault]:
    """Return faults of EMG that is unfit for use, or of too few muscles."""
    table = study.table(SynergiesTable)
    return envelope_faults(study, table, lambda made: _group_recordings(study, made), "muscles")


def run(study: Study, tell: Progress = quiet) -> SynergiesResult:
    """Find the synergies of every group, and the similarity of groups. `study` [synergies]."""
    table = study.table(SynergiesTable)
    raise_refusals(emg_faults(study, table))
    tell("envelopes", 0.05)
    grouped = _group_recordings(study, divide_by_own_maximum(relative_envelopes(study, table)))
    muscles = tuple(next(iter(grouped.values()))[0].envelopes)
    if table.number is not None and table.number > len(muscles):
        raise IdentificationError(
            f"{study.folder}: [synergies] number: found {table.number}, expected at most {len(muscles)}, of as many "
            "muscles"
        )
    counts, chosen, parts = {}, {}, {}
    for i, (name, members) in enumerate(grouped.items()):
        tell(f"synergies of {name}" if name else "synergies", 0.1 + 0.8 * i / len(grouped))
        fitted = [each for each in members if not each.heldout] or members
        heldout = [each for each in members if each.heldout] if any(not each.heldout for each in members) else []
        parts[name] = fitted, heldout
        known = np.concatenate([each.matrix for each in fitted]), _joined_time(fitted), muscles
        # Held-out recordings judge every number, and choose none.
        chosen[name] = counts[name] = count_synergies(*known, None, table.most)
        if heldout:
            counts[name] = count_synergies(*known, np.concatenate([each.matrix for each in heldout]), table.most)
    by_person: dict[str | None, list[SynergyCount]] = {}
    for name, count in chosen.items():
        by_person.setdefault(grouped[name][0].participant, []).append(count)
    # Groups are compared synergy by synergy. All therefore have the median of the groups' numbers.
    common = common_number([*by_person.values()])
    usual = table.number or common.number
    groups = []
    for name, (fitted, heldout) in parts.items():
        found = find_synergies(np.concatenate([each.matrix for each in fitted]), muscles, usual)
        drawn = (heldout or fitted)[0]
        middle = 0.5 * (drawn.time[0] + drawn.time[-1])
        shown = np.abs(drawn.time - middle) <= 0.5 * DRAWN_STRETCH_S
        judged = ", ".join(each.name for each in heldout) or "cross-validation over blocks of time"
        envelopes = drawn.matrix[shown]
        active = found.activations(envelopes)
        drawn_parts = drawn.time[shown], envelopes, active
        groups.append(GroupSynergies(name, found, counts[name], chosen[name], judged, *drawn_parts))
    alike = tuple(_compare_groups(one, other, parts) for one, other in combinations(groups, 2))
    checksum = combined_checksum(each.checksum for members in grouped.values() for each in members)
    return SynergiesResult(
        study=study.name,
        headline=_headline(groups, alike, common),
        tables=(*_tables(groups), *_similarity_table(alike)),
        verdicts=tuple(_verdicts(groups)),
        rows=tuple((*_rows(study.name, groups, alike, checksum), *_common_rows(study.name, common, checksum))),
        cards={},
        checksums={each.name: each.checksum for members in grouped.values() for each in members},
        groups=tuple(groups),
        alike=alike,
    )


MIN_HELDOUT_VARIANCE = 0.9
"""Smallest share of the held-out variance for which synergies count as enough.

It is the usual convention: Torres-Oviedo, Macpherson and Ting, J. Neurophysiology 96, 2006.
"""


def synergies_answer(result: SynergiesResult) -> Answer:
    """Return whether fewer synergies than muscles account for the held-out variance in each group."""
    parts, numbers = [], []
    for group in result.groups:
        number, count = len(group.synergies), group.count
        share = float(count.heldout[list(count.numbers).index(number)]) if number in count.numbers else float("nan")
        fewer = number < group.synergies.weights.shape[1]
        name = group.name or "all recordings"
        text = f"{number} for {100.0 * share:.0f} % of the held-out variance"
        enough = share >= MIN_HELDOUT_VARIANCE and fewer
        parts.append(AnswerPart(name, "yes" if enough else "no" if np.isfinite(share) else "cannot say", text))
        numbers.append(AnswerNumber(f"held-out variance, {name}", 100.0 * share, "%"))
    recordings = len(result.checksums)
    judged = dict.fromkeys(name for group in result.groups for name in group.judged_on.split(", "))
    held = ", ".join(judged) if len(judged) == 1 else f"{len(judged)} held-out recordings"
    return answer_of_parts(
        f"Do fewer synergies than muscles account for {100.0 * MIN_HELDOUT_VARIANCE:g} % of the held-out variance?",
        result.headline,
        parts,
        numbers,
        Basis(recordings, recordings, judged=held, held_out=len(judged) if len(judged) > 1 else 0),
        improve=(
            Step("Fit more movements like the held-out ones, at the same speed and load: synergies of too few do not "
                 "account for others"),
            Step("Allow more synergies (`most` in [synergies]), and record more muscles"),
        ),
    )


def divide_by_own_maximum(recordings: list[MuscleEnvelopes]) -> list[MuscleEnvelopes]:
    """Return recordings whose envelopes are relative to each muscle's largest in the same person's movements.

    A muscle that hardly works in them would otherwise hardly count, where maximal contractions are the scale. Held-out
    recordings set no scale, unless a person has no others.
    """
    top: dict[tuple[str | None, str], float] = {}
    for person in dict.fromkeys(each.participant for each in recordings):
        own = [each for each in recordings if each.participant == person]
        for each in [each for each in own if not each.heldout] or own:
            for muscle, largest in zip(each.envelopes, largest_envelopes(each.matrix), strict=True):
                top[person, muscle] = max(top.get((person, muscle), 0.0), float(largest))
    return [
        replace(
            each, envelopes={m: x / (top.get((each.participant, m), 0.0) or 1.0) for m, x in each.envelopes.items()}
        )
        for each in recordings
    ]


def _group_recordings(study: Study, recordings: list[MuscleEnvelopes]) -> dict[str, list[MuscleEnvelopes]]:
    """Return recordings by participant and condition; refuse those that cannot be factored."""
    grouped: dict[str, list[MuscleEnvelopes]] = {}
    for each in recordings:
        if list(each.envelopes) != list(recordings[0].envelopes):
            raise RecordingError(
                f"{study.folder}: [synergies], recording {each.name}: found EMG of {', '.join(each.envelopes)}, "
                f"expected {', '.join(recordings[0].envelopes)} as in {recordings[0].name}"
            )
        try:
            require_envelopes(each.matrix, list(each.envelopes))
        except IdentificationError as error:
            raise IdentificationError(f"recording {each.name}, {error}") from None
        grouped.setdefault(each.group, []).append(each)
    return grouped


def _joined_time(members: list[MuscleEnvelopes]) -> np.ndarray:
    """Return the times of recordings one after another, shape (n,) [s]."""
    times, at = [], 0.0
    for each in members:
        times.append(at + each.time - each.time[0])
        at = float(times[-1][-1]) + 1.0
    return np.concatenate(times)


def _compare_groups(one: GroupSynergies, other: GroupSynergies, parts: dict) -> GroupSimilarity:
    """Compare the synergies of two groups."""
    envelopes = np.concatenate([each.matrix for group in parts[other.name] for each in group])
    return GroupSimilarity(
        one.name, other.name, similarity(one.synergies, other.synergies)[0],
        chance_similarity(one.synergies, other.synergies), vaf(envelopes, one.synergies.reconstruct(envelopes)),
    )  # fmt: skip


def _headline(groups: list[GroupSynergies], alike: tuple[GroupSimilarity, ...], common: CommonNumber) -> str:
    """Return the headline: number of synergies, held-out variance, and similarity of groups."""
    count, number = groups[0].count, len(groups[0].synergies)
    if len(groups) == 1:
        return f"{replace(count, errors=groups[0].within.errors).sentence(number)}."
    several = "y accounts" if number == 1 else "ies account"
    where = list(count.numbers).index(number) if number in count.numbers else -1
    least = min(100 * g.count.heldout[where] for g in groups)
    above = sum(each.cosine > each.chance for each in alike)
    own = [g.within.best for g in groups]
    low, high = common.interval if common.people > 1 else (min(own), max(own))
    often = f"{low}" if low == high else f"{low} to {high}"
    over = f", over {common.people} participants" if common.people > 1 else ""
    return (
        f"{number} synerg{several} for at least {least:.0f} % of the held-out variance in {len(groups)} groups "
        f"({often} by bi-cross-validation{over}); "
        f"{above} of {len(alike)} pairs of groups are more similar than expected by chance."
    )


def _tables(groups: list[GroupSynergies]) -> list[FigureTable]:
    """Return a table of explained variance by number of synergies for each group."""
    heads = ("Synergies", "VAF fitted", "VAF held out", "VAF worst muscle", "VAF by chance", "R² of a held-out muscle")
    made = []
    for g in groups:
        c = g.count
        rows = zip(c.numbers, c.fitted, c.heldout, c.least, c.shuffled, c.left_out, strict=True)
        title = "Number of synergies" + (f": {g.name}" if g.name else "")
        made.append(FigureTable(title, heads, tuple((int(r[0]), *(round(float(x), 3) for x in r[1:])) for r in rows)))
    return made


def _similarity_table(alike: tuple[GroupSimilarity, ...]) -> tuple[FigureTable, ...]:
    """Return the table of similarities; empty for a single group."""
    if not alike:
        return ()
    rows = tuple((a.one, a.other, a.cosine, a.chance, a.crossed) for a in alike)
    heads = ("Synergies of", "and of", "cosine", "by chance", "VAF across")
    return (FigureTable("Similarity of synergies", heads, rows),)


def _verdicts(groups: list[GroupSynergies]) -> Iterator[Verdict]:
    """Yield verdicts on the synergies of each group."""
    for g in groups:
        name, c, threshold = f"{g.name}: " if g.name else "", g.count, 100 * SYNERGY_FIT.min_vaf
        if c.heldout.max() < SYNERGY_FIT.min_vaf:
            yield Verdict(
                "warning",
                f"{name}{c.numbers[-1]} synergies account for {100 * c.heldout[-1]:.0f} % of the held-out "
                f"variance, less than {threshold:g} %: the fitted synergies do not generalize, or `most` in "
                "[synergies] is too small.",
            )
        number = len(g.synergies) if len(g.synergies) in c.numbers else c.best
        chance = float(c.shuffled[list(c.numbers).index(number)])
        if chance > SYNERGY_FIT.min_vaf - 0.05 and c.heldout.max() >= SYNERGY_FIT.min_vaf:
            yield Verdict(
                "warning",
                f"{name}{number} synergies also account for {100 * chance:.0f} % of the variance of envelopes with "
                "independent time shifts. With so few muscles, any activity can be factored into synergies.",
            )
        if c.left_out.max() <= 0.0:
            yield Verdict(
                "warning",
                f"{name}no number of synergies predicts a held-out muscle from the others (R² below 0). Do not use "
                "synergies to fill in unrecorded muscles.",
            )


def _common_rows(study: str, common: CommonNumber, checksum: str) -> Iterator[ResultRow]:
    """Yield the number of synergies of all participants and its interval, where there are several."""
    if common.people < 2:
        return
    over = f"{100 * SYNERGY_FIT.interval:g} % interval over {common.people} participants and blocks of time"
    values = (
        ("", common.number, f"median of {common.people} participants"),
        (".low", common.interval[0], f"lower end of the {over}"),
        (".high", common.interval[1], f"upper end of the {over}"),
    )
    for ending, value, note in values:
        yield ResultRow(f"{study}.synergies.number{ending}", value, "1", "synergies", "fitted", checksum, note)


def _rows(
    study: str, groups: list[GroupSynergies], alike: tuple[GroupSimilarity, ...], checksum: str
) -> Iterator[ResultRow]:
    """Yield all result rows."""

    def row(name: str, value: float, split: str, note: str = "") -> ResultRow:
        return ResultRow(name, value, "1", "synergies", split, checksum, note)

    def part(name: str) -> str:
        return name.replace(", ", ".").replace(" ", "_")

    for g in groups:
        base = f"{study}.{part(g.name)}.synergies" if g.name else f"{study}.synergies"
        c = g.count
        words = "smallest number that predicts held-out muscles as well as any, within one standard error"
        yield row(f"{base}.number", g.within.best, "fitted", words)
        for ending, bound in zip(("low", "high"), g.within.interval, strict=True):
            note = f"{ending} end of the {100 * SYNERGY_FIT.interval:g} % interval, over blocks of time"
            yield row(f"{base}.number.{ending}", bound, "fitted", note)
        yield row(f"{base}.predicting", c.predicting, "heldout", "number that predicts a held-out muscle best")
        for i, number in enumerate(c.numbers):
            yield row(f"{base}.{number}.vaf", c.heldout[i], "heldout")
            yield row(f"{base}.{number}.vaf.fitted", c.fitted[i], "fitted")
            yield row(f"{base}.{number}.vaf.shifted", c.shuffled[i], "heldout", "independent time shifts")
            yield row(f"{base}.{number}.left_out.r2", c.left_out[i], "heldout", "each muscle held out in turn")
        for i, weights in enumerate(g.synergies.weights, start=1):
            for muscle, weight in zip(g.synergies.muscles, weights, strict=True):
                yield row(f"{base}.weight.{i}.{muscle}", float(weight), "fitted")
    for a in alike:
        base = f"{study}.synergies.alike.{part(a.one)}.{part(a.other)}"
        yield row(f"{base}.cosine", a.cosine, "fitted", f"5 % of random permutations exceed {a.chance:.3f}")
        yield row(f"{base}.vaf", a.crossed, "heldout", "envelopes of the second group by weights of the first")
