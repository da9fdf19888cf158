"""The paper's experiment predicted: drawn studies on drawn robots, effects with intervals beside what is printed.

Scored are nine effects: changes of duration and of peak velocity under three laws, and EMG/Acc, of which the paper
prints no size, only what settles every person's order: its rank sums.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from scipy.stats import rankdata

from ...assessment.friedman import nemenyi_from_rank_sums
from ...lab.elbow.rig import ElbowRig
from ...lab.pointing.prediction import INDICES, STUDY_INTERVAL_SHARE, DrawnStudies, Prediction, predict_effects
from ...lab.pointing.rig import PointingRig, elbow_people
from ...lab.pointing.sensitivity import Sensitivity
from ..figure import Reproduced, figure
from ..printed import PrintedPaper
from .statistics import RANK_SUMS
from .transparency import LAWS
from .transparency_rows import printed_change

PRINTED = {"duration": "duration", "vmax": "velocity"}
"""Which printed table has an index."""

EMG_ORDER = "emg_order"
"""Rank sum of a law's EMG/Acc over a study's people: printed are statistics that leave one set of them."""

SCORED = (*PRINTED, EMG_ORDER)

WORDS = {
    "duration": "Duration",
    "duration_median": "Median duration",
    "vmax": "Peak velocity",
    "emg_per_acc": "EMG/Acc",
    "antagonists": "Antagonists' EMG",
    "unsettled": "Movements that never settle",
    EMG_ORDER: "Rank sum of EMG/Acc",
}

NO_CHANGE = {"duration": 0.0, "vmax": 0.0, EMG_ORDER: 12.0}
"""The simplest rival: no law changes anything, and ranks are as chance has them."""

_row = partial(figure, "able.predicted")


@dataclass(frozen=True)
class Drawn:
    """How much is drawn to predict the experiment."""

    robots: int = 8
    people: int = 8
    movements: int = 20  # Of a person in a condition; the paper's made 100
    trajectories: int = 4  # To see what decides
    rigs: Sequence[PointingRig] = ()  # Whose people; `models_of_people` if there is none


@dataclass(frozen=True)
class Effect:
    """One effect as predicted, beside what the paper found."""

    index: str
    law: str
    low: float  # low, middle, high: Of the middle 80 % of drawn studies [%], of EMG/Acc [1]
    middle: float
    high: float
    printed: float

    @property
    def inside(self) -> bool:
        """Whether the interval holds what the paper found."""
        return bool(self.low <= self.printed <= self.high)

    @property
    def interval_score(self) -> float:
        """Width, and ten times what the printed value lies outside: Gneiting and Raftery's, small is good."""
        beyond = max(self.low - self.printed, self.printed - self.high, 0.0)
        return self.high - self.low + 2.0 / (1.0 - STUDY_INTERVAL_SHARE) * beyond


@dataclass(frozen=True)
class Finding:
    """Something that the paper found, and how often it is predicted."""

    name: str
    words: str
    pairs: float  # Share of pairs of a person and a robot; NaN where it takes several people
    studies: float  # Share of drawn studies


def models_of_people(robot: ElbowRig | None = None) -> tuple[PointingRig, ...]:
    """The lab's people by each model of them, wearing a robot like one."""
    people = elbow_people(robot)
    return people, people.modelled("optimal")


def printed_exponents(paper: PrintedPaper) -> tuple[float, float]:
    """k of equation 8 as the paper's people chose it, upwards and downwards."""
    return tuple(paper[f"inertia_exponent_{way}"] for way in ("up", "down"))


def friction_drawn(rig: PointingRig, paper: PrintedPaper) -> tuple[float, float]:
    """Between what shares of the rig's own friction robots are drawn: from what is printed to itself."""
    table, transmission = paper.tables["elbow"], rig.robot["transmission"]
    printed = np.mean([table[way]["coulomb"].value for way in ("up", "down")])
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
) -> Scored:
    """The experiment of the paper with people of `rigs`, on robots from its friction to the rig's; on half of them five
    people choose k, on the others it is as printed."""
    made = predict_effects(
        rigs, people=people, robots=robots, movements=movements, friction=friction_drawn(rigs[0], paper), seed=seed,
        exponents=(None, printed_exponents(paper)), workers=workers, executor=executor, on_progress=on_progress,
    )  # fmt: skip
    return Scored(made, made.studies(size=int(paper["participants"])), paper)


@dataclass(frozen=True, eq=False)
class Scored:
    """A prediction beside the paper."""

    prediction: Prediction
    studies: DrawnStudies
    paper: PrintedPaper

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The nine that are scored, by index and law."""
        found = [
            Effect(index, law, *self.studies.interval(index, law), printed_change(self.paper.tables[table], law))
            for index, table in PRINTED.items()
            for law in LAWS
        ]
        sums = rank_sums(self.studies)
        for i, law in enumerate(LAWS):
            low, middle, high = np.nanquantile(
                sums[:, i], [0.5 - 0.5 * STUDY_INTERVAL_SHARE, 0.5, 0.5 + 0.5 * STUDY_INTERVAL_SHARE]
            )
            printed = float(RANK_SUMS["emg_acc"][law.lower()])
            found.append(Effect(EMG_ORDER, law, float(low), float(middle), float(high), printed))
        return tuple(found)

    @property
    def inside(self) -> float:
        """Share of effects that lie inside their intervals."""
        return float(np.mean([e.inside for e in self.effects]))

    @property
    def order(self) -> float:
        """Share of the nine orders of two laws, three of each index, that medians over studies predict."""
        return float(np.mean([same for index in SCORED for same in _orders(self._of(index))]))

    @property
    def whole_orders(self) -> tuple[str, ...]:
        """Indices whose three laws are all in the paper's order."""
        return tuple(index for index in SCORED if all(_orders(self._of(index))))

    def interval_score(self, *, no_change: bool = False) -> float:
        """Mean over the changes of duration and peak velocity [%]; of the rival that says no change, with certainty, if
        asked."""
        found = [e for e in self.effects if e.index in PRINTED]
        if no_change:
            found = [Effect(e.index, e.law, 0.0, 0.0, 0.0, e.printed) for e in found]
        return float(np.mean([e.interval_score for e in found]))

    @cached_property
    def of_models(self) -> dict[str, Scored]:
        """What people of each model predict alone, where there are several."""
        p = self.prediction
        if len(p.models) < 2:
            return {}
        alone = {name: p.of_model(i) for i, name in enumerate(p.models)}
        size = self.studies.control.shape[1]
        return {name: Scored(one, one.studies(size=size), self.paper) for name, one in alone.items()}

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What the paper found, by how many pairs and studies it is predicted."""
        of_pairs = {i: np.array([self.prediction.pairs(i, law) for law in LAWS]) for i in INDICES}
        of_studies = {i: np.array([self.studies.effect(i, law) for law in LAWS]) for i in INDICES}
        made = [
            Finding(name, words, float(np.mean(holds(of_pairs))), float(np.mean(holds(of_studies))))
            for name, (words, holds) in FINDINGS.items()
        ]
        tested = float(np.mean(_slower_as_tested(self.studies)))
        words = "By the paper's tests PCFr and CLPC last longer than control, FC does not"
        return (*made, Finding("duration_as_tested", words, float("nan"), tested))

    def _of(self, index: str) -> list[Effect]:
        return [e for e in self.effects if e.index == index]


FC, PCFR, CLPC = range(3)

FINDINGS: Mapping[str, tuple[str, Callable[[Mapping[str, np.ndarray]], np.ndarray]]] = {
    "pcfr_longer": ("Movements last longer under PCFr", lambda x: x["duration"][PCFR] > 0.0),
    "clpc_longer": ("Movements last longer under CLPC", lambda x: x["duration"][CLPC] > 0.0),
    "fc_longer_least": ("FC lengthens movements least", lambda x: np.argmin(x["duration"], axis=0) == FC),
    "fc_longer_least_median": (
        "FC lengthens the median movement least", lambda x: np.argmin(x["duration_median"], axis=0) == FC,
    ),
    "pcfr_slower": ("Peak velocity is lower under PCFr", lambda x: x["vmax"][PCFR] < 0.0),
    "clpc_slower": ("Peak velocity is lower under CLPC", lambda x: x["vmax"][CLPC] < 0.0),
    "fc_slower_least": ("FC lowers peak velocity least", lambda x: np.argmax(x["vmax"], axis=0) == FC),
    "duration_order": ("Duration: FC < CLPC < PCFr", lambda x: _rising(x["duration"], (FC, CLPC, PCFR))),
    "velocity_order": ("Peak velocity: FC > PCFr > CLPC", lambda x: _rising(-x["vmax"], (FC, PCFR, CLPC))),
    "emg_order": ("EMG/Acc: FC < PCFr < CLPC", lambda x: _rising(x["emg_per_acc"], (FC, PCFR, CLPC))),
}  # fmt: skip
"""Of changes by index, laws first: whether each shows what the paper found."""


def _rising(changes: np.ndarray, laws: tuple[int, ...]) -> np.ndarray:
    return np.all(np.diff(changes[list(laws)], axis=0) > 0.0, axis=0)


def _orders(effects: Sequence[Effect]) -> list[bool]:
    """Whether each two laws are in the paper's order."""
    return [np.sign(a.middle - b.middle) == np.sign(a.printed - b.printed) for a, b in combinations(effects, 2)]


def rank_sums(studies: DrawnStudies) -> np.ndarray:
    """Of each law's EMG/Acc among the laws, over the people of each drawn study, shape (n, laws)."""
    i = INDICES.index("emg_per_acc")
    return rankdata(studies.worn[:, :, :, i] / studies.control[:, None, :, i], axis=1).sum(axis=2)


def _slower_as_tested(studies: DrawnStudies) -> np.ndarray:
    """Whether Nemenyi's test tells PCFr's and CLPC's durations from control, longer, and FC's not, shape (n,)."""
    i = INDICES.index("duration")
    of_all = np.concatenate([studies.control[:, None, :, i], studies.worn[:, :, :, i]], axis=1)
    sums = rankdata(of_all, axis=1).sum(axis=2)
    people, k = of_all.shape[2], of_all.shape[1]
    # p hangs on the difference alone: the least that is significant, once.
    centre = people * (k + 1) / 2.0
    needed = next(
        d for d in np.arange(0.0, people * (k - 1) + 1.0, 0.5)
        if nemenyi_from_rank_sums((centre - d / 2, centre + d / 2, *[centre] * (k - 2)), people)[0, 1] < 0.05
    )  # fmt: skip
    longer = sums[:, 1:] - sums[:, :1] >= needed
    return longer[:, PCFR] & longer[:, CLPC] & (np.abs(sums[:, 1 + FC] - sums[:, 0]) < needed)


def predicted_rows(made: Scored, screened: Sensitivity | None) -> list[Reproduced]:
    """Every predicted effect and finding, and what decides."""
    p, rows = made.prediction, []
    drawn = (
        f"{len(p.worn)} robots x {p.people} people of {' and '.join(p.models)}, {p.repetitions} movements in each "
        "condition"
    )
    for e in made.effects:
        unit = "1" if e.index == EMG_ORDER else "%"
        what = f"{WORDS[e.index]} under {e.law}" + (", change from control" if unit == "%" else "")
        note = f"median and middle {100.0 * STUDY_INTERVAL_SHARE:.0f} % of drawn studies; {drawn}"
        name = f"{e.index}.{e.law.lower()}"
        rows.append(_row(name, what, unit, e.middle, e.printed, note, between=(e.low, e.high)))
    for index in ("duration_median", "emg_per_acc", "antagonists", "unsettled"):
        for law in LAWS:
            low, middle, high = made.studies.interval(index, law)
            what = f"{WORDS[index]} under {law}" + ("" if index == "unsettled" else ", change from control")
            note = "the paper prints none"
            rows.append(_row(f"{index}.{law.lower()}", what, "%", middle, None, note, between=(low, high)))
    whole = ", ".join(WORDS[index].lower() for index in made.whole_orders) or "none"
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
        said = f"people of {name} alone"
        rows += [
            _row(f"inside.{name}", f"Effects of nine inside: {said}", "1", one.inside),
            _row(f"order.{name}", f"Orders as predicted: {said}", "1", one.order),
            _row(f"interval_score.{name}", f"Interval score: {said}", "%", one.interval_score()),
        ]
    for f in made.findings:
        if np.isfinite(f.pairs):
            note = "of a person and a robot"
            rows.append(_row(f"pairs.{f.name}", f"{f.words}: pairs", "%", 100.0 * f.pairs, None, note))
        rows.append(_row(f"studies.{f.name}", f"{f.words}: studies", "%", 100.0 * f.studies, None, "of six people"))
    if screened is not None:
        for law in screened.laws:
            for factor, value in screened.of(law, "duration_median").items():
                name = f"decides.{law.lower()}.{factor.replace(' ', '_')}"
                note = "mean elementary effect, 100 ln(worn over control), Morris's method"
                rows.append(
                    _row(name, f"Median duration under {law}: {factor}, over its range", "%", value, None, note)
                )
    return rows
