"""What a reproduction computes, in as many processes as wanted: one subject, one seed or one map at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...lab.knee.rig import KneeRig
from ..processes import Job, finished
from .residual import ControllerRow, judge_wearer
from .torque import AS_PUBLISHED, PROTOCOLS, TorqueMap, TorqueSteps, judge_map, published_steps, torque_steps
from .wearers import Bench, Drawn, WearerFound, drawn_from, identify_straps, identify_subject


class KneeWork:
    """Jobs, and what they gave; a job can ask for others; published_time [s]."""

    def __init__(
        self,
        rig: KneeRig,
        bench: Bench,
        seeds: Sequence[int],
        estimators: Sequence[str],
        *,
        published_time: float,
        compared: Sequence[str],
    ):
        self.rig, self.bench, self.seeds, self.estimators = rig, bench, tuple(seeds), tuple(estimators)
        self.published_time = published_time
        # The other tool's defaults are of interest on its own protocol alone.
        self._maps = [(p, e) for p in PROTOCOLS for e in self.estimators if p == "published" or e not in AS_PUBLISHED]
        self.names, self.judged = tuple(rig.subjects), tuple(compared)
        self.wearers: dict[str, WearerFound] = {}
        self.steps: dict[tuple[str, str], TorqueSteps] = {}  # by subject and protocol
        self.maps: list[TorqueMap] = []
        self.drawn: list[Drawn] = []
        self.compared: list[ControllerRow] = []

    def run(self, workers: int | None, tell: Callable[[str, float], None]) -> None:
        """Do everything."""
        total = len(self.names) * (1 + len(self._maps)) + len(self.judged) + len(self.seeds) - 1
        jobs: list[Job] = [(_whole, self.rig, name, self.seeds[0], self.bench) for name in self.names]
        jobs += [(judge_wearer, self.rig, name) for name in self.judged]
        jobs += [(_drawn, self.rig, seed) for seed in self.seeds[1:]]
        for count, (_, result) in enumerate(finished(jobs, workers), 1):
            tell(f"{count} of {total} parts", 0.05 + 0.9 * count / total)
            jobs += self._keep(result)
        self._sort()

    def _keep(self, result) -> list[Job]:
        """Keep a result, and say what can be done next."""
        match result:
            case TorqueMap():
                self.maps.append(result)
            case (ControllerRow(), *_):
                self.compared += result
            case list():
                self.drawn += result
            case (found, steps):
                self.wearers[found.name] = found
                self.drawn.append(drawn_from(found))
                for made in (published_steps(steps, self.published_time), steps):
                    self.steps[found.name, made.protocol] = made
                return [(judge_map, self.steps[found.name, p], e) for p, e in self._maps]
        return []

    def _sort(self) -> None:
        """In the order of subjects, seeds and estimators, whichever came first."""
        place = {name: i for i, name in enumerate(self.names)}
        self.wearers = {n: self.wearers[n] for n in self.names}
        self.maps.sort(key=lambda m: (place[m.subject], self._maps.index((m.protocol, m.estimator))))
        self.compared.sort(key=lambda c: self.judged.index(c.subject))
        self.drawn.sort(key=lambda d: (self.seeds.index(d.seed), place[d.subject]))


def _whole(rig: KneeRig, name: str, seed: int, bench: Bench) -> tuple[WearerFound, TorqueSteps]:
    """Everything that one subject does."""
    found, taken = identify_subject(rig, name, seed)
    return found, torque_steps(rig, taken, bench.fit.orthosis, found)


def _drawn(rig: KneeRig, seed: int) -> list[Drawn]:
    """Straps and limbs of all subjects with other noise."""
    return [drawn_from(found) for found in identify_straps(rig, seed)]
