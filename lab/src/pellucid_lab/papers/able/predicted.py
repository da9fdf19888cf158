"""Predict the paper's experiment: simulated studies and robots, effects with intervals and the printed effects.

Nine effects are scored: changes of duration and peak velocity, and the rank sum of EMG/Acc, each under three laws.
The paper prints no size of EMG/Acc, but its tests determine the rank sums.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations

import numpy as np

from pellucid.numerics.tied_ranks import tied_ranks
from pellucid.people.comparison import nemenyi_from_rank_sums

from ...elbow.rig import ElbowRig
from ...pointing.prediction import INDICES, STUDY_INTERVAL_SHARE, DrawnStudies, Prediction, predict_effects
from ...pointing.rig import PointingRig, elbow_people
from ...pointing.sensitivity import Sensitivity
from ..figure import Reproduced, figure
from ..printed import PrintedPaper
from .statistics import RANK_SUMS
from .transparency import LAWS
from .transparency_rows import printed_change

PRINTED_TABLE_OF_INDEX = {"duration": "duration", "vmax": "velocity"}
"""The paper's table of each scored index."""

EMG_RANK_SUM = "emg_order"
"""Name of the third scored effect: the rank sum of a law's EMG/Acc over a study's people.

The paper prints test statistics; only one set of rank sums agrees with them (`statistics.RANK_SUMS`).
"""

SCORED_EFFECTS = (*PRINTED_TABLE_OF_INDEX, EMG_RANK_SUM)
"""Names of the effects that are scored, each under three laws."""

EFFECT_WORDS = {
    "duration": "Duration",
    "duration_median": "Median duration",
    "vmax": "Peak velocity",
    "emg_per_acc": "EMG/Acc",
    "antagonists": "Antagonists' EMG",
    "unsettled": "Movements that never settle",
    EMG_RANK_SUM: "Rank sum of EMG/Acc",
}
"""Words for every predicted effect."""

_row = partial(figure, "able.predicted")


@dataclass(frozen=True)
class PredictionSize:
    """Size of the prediction of the experiment."""

    robots: int = 8
    people: int = 8
    movements: int = 20  # Number of movements of a person in a condition; the paper's people made 100
    trajectories: int = 4  # Number of Morris trajectories that screen the factors
    rigs: Sequence[PointingRig] = ()  # Rigs whose people are drawn; `models_of_people` if empty


@dataclass(frozen=True)
class Effect:
    """One predicted effect, and the paper's.

    Values are changes from control [%]; those of `EMG_RANK_SUM` are rank sums [1].
    """

    index: str
    law: str
    low: float  # Lower end of the middle 80 % of simulated studies
    middle: float  # Median of simulated studies
    high: float  # Upper end of the middle 80 % of simulated studies
    printed: float  # The paper's value

    @property
    def inside(self) -> bool:
        """Whether the interval contains the paper's value."""
        return bool(self.low <= self.printed <= self.high)

    @property
    def interval_score(self) -> float:
        """Gneiting and Raftery's interval score: the width, and ten times the printed value's distance outside.

        Small is good.
        """
        beyond = max(self.low - self.printed, self.printed - self.high, 0.0)
        return self.high - self.low + 2.0 / (1.0 - STUDY_INTERVAL_SHARE) * beyond


@dataclass(frozen=True)
class Finding:
    """A qualitative finding of the paper, and how often the prediction has it."""

    name: str
    words: str
    pairs: float  # Share of pairs of a person and a robot that show it; NaN if the finding needs several people
    studies: float  # Share of drawn studies that show it


def models_of_people(robot: ElbowRig | None = None) -> tuple[PointingRig, ...]:
    """Return the lab's people, once for each model of how they control their arm, wearing `robot` or one like it."""
    people = elbow_people(robot)
    return people, people.modelled("optimal")


def printed_exponents(paper: PrintedPaper) -> tuple[float, float]:
    """Return k of equation 8 as the paper's people chose it, upwards and downwards."""
    return tuple(paper[f"inertia_exponent_{direction}"] for direction in ("up", "down"))


def friction_drawn(rig: PointingRig, paper: PrintedPaper) -> tuple[float, float]:
    """Return the range of Coulomb friction in which robots are drawn, over the rig's: from the printed value to 1."""
    table, transmission = paper.tables["elbow"], rig.robot["transmission"]
    printed = np.mean([table[direction]["coulomb"].value for direction in ("up", "down")])
    own = (
        np.mean([transmission[f"coulomb_{way}"] for way in ("positive", "negative")]) + rig.robot["bearing"]["coulomb"]
    )
    return float(printed / own), 1.0


def predict_paper(
    rigs: Sequence[PointingRig],
    paper: PrintedPaper,
    *,
    people: int = 12,
    robots: int = 12,
    movements: int = 100,
    seed: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> ScoredPrediction:
    """Predict the paper's experiment with people of `rigs`, on robots with friction between the paper's and the rig's.

    On half of the robots five people choose k of equation 8; on the others it is as printed.
    """
    made = predict_effects(
        rigs, people=people, robots=robots, movements=movements, friction=friction_drawn(rigs[0], paper), seed=seed,
        exponents=(None, printed_exponents(paper)), workers=workers, executor=executor, on_progress=on_progress,
    )  # fmt: skip
    return ScoredPrediction(made, made.studies(size=int(paper["participants"])), paper)


@dataclass(frozen=True, eq=False)
class ScoredPrediction:
    """A prediction compared with the paper."""

    prediction: Prediction
    studies: DrawnStudies
    paper: PrintedPaper

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The nine scored effects, by index and law."""
        found = [
            Effect(index, law, *self.studies.interval(index, law), printed_change(self.paper.tables[table], law))
            for index, table in PRINTED_TABLE_OF_INDEX.items()
            for law in LAWS
        ]
        sums = rank_sums(self.studies)
        for i, law in enumerate(LAWS):
            low, middle, high = np.nanquantile(
                sums[:, i], [0.5 - 0.5 * STUDY_INTERVAL_SHARE, 0.5, 0.5 + 0.5 * STUDY_INTERVAL_SHARE]
            )
            printed = float(RANK_SUMS["emg_acc"][law.lower()])
            found.append(Effect(EMG_RANK_SUM, law, float(low), float(middle), float(high), printed))
        return tuple(found)

    @property
    def inside(self) -> float:
        """Share of effects that lie inside their intervals."""
        return float(np.mean([e.inside for e in self.effects]))

    @property
    def order(self) -> float:
        """Share of the nine orders of two laws, three of each index, that medians over studies predict."""
        return float(np.mean([same for index in SCORED_EFFECTS for same in _order_matches(self._of(index))]))

    @property
    def whole_orders(self) -> tuple[str, ...]:
        """Indices whose three laws are all in the paper's order."""
        return tuple(index for index in SCORED_EFFECTS if all(_order_matches(self._of(index))))

    def interval_score(self, *, no_change: bool = False) -> float:
        """Return the mean interval score of the changes of duration and peak velocity [%].

        With `no_change` it is that of the baseline which predicts no change with certainty.
        """
        found = [e for e in self.effects if e.index in PRINTED_TABLE_OF_INDEX]
        if no_change:
            found = [Effect(e.index, e.law, 0.0, 0.0, 0.0, e.printed) for e in found]
        return float(np.mean([e.interval_score for e in found]))

    @cached_property
    def of_models(self) -> dict[str, ScoredPrediction]:
        """The prediction by people of each model alone, if there are several models."""
        p = self.prediction
        if len(p.models) < 2:
            return {}
        alone = {name: p.of_model(i) for i, name in enumerate(p.models)}
        size = self.studies.control.shape[1]
        return {name: ScoredPrediction(one, one.studies(size=size), self.paper) for name, one in alone.items()}

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """The paper's findings, each with the share of pairs and of studies that show it."""
        pair_changes = {i: np.array([self.prediction.pairs(i, law) for law in LAWS]) for i in INDICES}
        study_changes = {i: np.array([self.studies.effect(i, law) for law in LAWS]) for i in INDICES}
        findings = [
            Finding(name, words, float(np.mean(holds(pair_changes))), float(np.mean(holds(study_changes))))
            for name, (words, holds) in PRINTED_FINDINGS.items()
        ]
        tested = float(np.mean(_longer_by_published_tests(self.studies)))
        words = "By the paper's tests PCFr and CLPC last longer than control, FC does not"
        return (*findings, Finding("duration_as_tested", words, float("nan"), tested))

    def _of(self, index: str) -> list[Effect]:
        return [e for e in self.effects if e.index == index]


FC_ROW = 0
"""First row of an array of changes by law: full compensation."""

PCFR_ROW = 1
"""Second row: the paper's PCFr, which compensates gravity and an inertia term."""

CLPC_ROW = 2
"""Third row: the paper's CLPC, position control with a few compensations."""

PRINTED_FINDINGS: Mapping[str, tuple[str, Callable[[Mapping[str, np.ndarray]], np.ndarray]]] = {
    "pcfr_longer": ("Movements last longer under PCFr", lambda x: x["duration"][PCFR_ROW] > 0.0),
    "clpc_longer": ("Movements last longer under CLPC", lambda x: x["duration"][CLPC_ROW] > 0.0),
    "fc_longer_least": ("FC lengthens movements least", lambda x: np.argmin(x["duration"], axis=0) == FC_ROW),
    "fc_longer_least_median": (
        "FC lengthens the median movement least", lambda x: np.argmin(x["duration_median"], axis=0) == FC_ROW,
    ),
    "pcfr_slower": ("Peak velocity is lower under PCFr", lambda x: x["vmax"][PCFR_ROW] < 0.0),
    "clpc_slower": ("Peak velocity is lower under CLPC", lambda x: x["vmax"][CLPC_ROW] < 0.0),
    "fc_slower_least": ("FC lowers peak velocity least", lambda x: np.argmax(x["vmax"], axis=0) == FC_ROW),
    "duration_order": (
        "Duration: FC < CLPC < PCFr", lambda x: _is_rising(x["duration"], (FC_ROW, CLPC_ROW, PCFR_ROW)),
    ),
    "velocity_order": (
        "Peak velocity: FC > PCFr > CLPC", lambda x: _is_rising(-x["vmax"], (FC_ROW, PCFR_ROW, CLPC_ROW)),
    ),
    "emg_order": (
        "EMG/Acc: FC < PCFr < CLPC", lambda x: _is_rising(x["emg_per_acc"], (FC_ROW, PCFR_ROW, CLPC_ROW)),
    ),
}  # fmt: skip
"""Qualitative findings of the paper: words, and a test of changes by index, each with laws along its first axis."""


def _is_rising(changes: np.ndarray, laws: tuple[int, ...]) -> np.ndarray:
    """Return whether changes grow from law to law, in the order of `laws`."""
    return np.all(np.diff(changes[list(laws)], axis=0) > 0.0, axis=0)


def _order_matches(effects: Sequence[Effect]) -> list[bool]:
    """Return for each pair of laws whether the predicted order is the paper's."""
    return [np.sign(a.middle - b.middle) == np.sign(a.printed - b.printed) for a, b in combinations(effects, 2)]


def rank_sums(studies: DrawnStudies) -> np.ndarray:
    """Return each law's rank sum of EMG/Acc, over the people of each simulated study, shape (n, laws)."""
    i = INDICES.index("emg_per_acc")
    return tied_ranks(studies.worn[:, :, :, i] / studies.control[:, None, :, i], axis=1).sum(axis=2)


def _longer_by_published_tests(studies: DrawnStudies) -> np.ndarray:
    """Return the studies in which Nemenyi's test finds PCFr and CLPC longer than control, and FC not, shape (n,)."""
    i = INDICES.index("duration")
    of_all = np.concatenate([studies.control[:, None, :, i], studies.worn[:, :, :, i]], axis=1)
    sums = tied_ranks(of_all, axis=1).sum(axis=2)
    people, k = of_all.shape[2], of_all.shape[1]
    # Nemenyi's p depends on the difference of rank sums alone, so the smallest significant one is found once.
    centre = people * (k + 1) / 2.0
    needed = next(
        d for d in np.arange(0.0, people * (k - 1) + 1.0, 0.5)
        if nemenyi_from_rank_sums((centre - d / 2, centre + d / 2, *[centre] * (k - 2)), people)[0, 1] < 0.05
    )  # fmt: skip
    longer = sums[:, 1:] - sums[:, :1] >= needed
    return longer[:, PCFR_ROW] & longer[:, CLPC_ROW] & (np.abs(sums[:, 1 + FC_ROW] - sums[:, 0]) < needed)


def predicted_rows(made: ScoredPrediction, screened: Sensitivity | None) -> list[Reproduced]:
    """Return rows of every predicted effect and finding, and of the factors' sensitivities."""
    p, rows = made.prediction, []
    drawn = (
        f"{len(p.worn)} robots x {p.people} people of {' and '.join(p.models)}, {p.repetitions} movements in each "
        "condition"
    )
    for e in made.effects:
        unit = "1" if e.index == EMG_RANK_SUM else "%"
        what = f"{EFFECT_WORDS[e.index]} under {e.law}" + (", change from control" if unit == "%" else "")
        note = f"median and middle {100.0 * STUDY_INTERVAL_SHARE:.0f} % of simulated studies; {drawn}"
        name = f"{e.index}.{e.law.lower()}"
        rows.append(_row(name, what, unit, e.middle, e.printed, note, between=(e.low, e.high)))
    for index in ("duration_median", "emg_per_acc", "antagonists", "unsettled"):
        for law in LAWS:
            low, middle, high = made.studies.interval(index, law)
            what = f"{EFFECT_WORDS[index]} under {law}" + ("" if index == "unsettled" else ", change from control")
            note = "the paper prints none"
            rows.append(_row(f"{index}.{law.lower()}", what, "%", middle, None, note, between=(low, high)))
    whole = ", ".join(EFFECT_WORDS[index].lower() for index in made.whole_orders) or "none"
    rows += [
        _row("inside", f"Effects of nine inside their {100.0 * STUDY_INTERVAL_SHARE:.0f} % intervals", "1", made.inside,
             None, drawn),
        _row("order", "Orders of two laws, of nine, as predicted", "1", made.order, None,
             f"one half by chance; of all three laws: {whole}"),
        _row("interval_score", "Interval score of duration and peak velocity", "%", made.interval_score(), None,
             "width and ten times what lies outside: small is good"),
        _row("interval_score.no_change", "The same of saying that no law changes anything", "%",
             made.interval_score(no_change=True), None, "the simplest rival"),
    ]  # fmt: skip
    for name, one in made.of_models.items():
        people_words = f"people of {name} alone"
        rows += [
            _row(f"inside.{name}", f"Effects of nine inside: {people_words}", "1", one.inside),
            _row(f"order.{name}", f"Orders as predicted: {people_words}", "1", one.order),
            _row(f"interval_score.{name}", f"Interval score: {people_words}", "%", one.interval_score()),
        ]
    for f in made.findings:
        if np.isfinite(f.pairs):
            note = "of a person and a robot"
            rows.append(_row(f"pairs.{f.name}", f"{f.words}: pairs", "%", 100.0 * f.pairs, None, note))
        rows.append(_row(f"studies.{f.name}", f"{f.words}: studies", "%", 100.0 * f.studies, None, "of six people"))
    if screened is not None:
        for law in screened.laws:
            for factor, value in screened.strengths_of(law, "duration_median").items():
                name = f"decides.{law.lower()}.{factor.replace(' ', '_')}"
                note = "mean elementary effect, 100 ln(worn over control), Morris's method"
                rows.append(
                    _row(name, f"Median duration under {law}: {factor}, over its range", "%", value, None, note)
                )
    return rows
