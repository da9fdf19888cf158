"""What the lead of EMG buys a controller: interaction torque at the virtual knee, with EMG on time, late, and without.

The law is the residual compensator with the person's own map from EMG to torque. What arrives late is what EMG tells,
by so much that nothing of its lead is left, and more. Wearers and orthoses are drawn with seeds on which nothing was
chosen; the plant has what the law does not know (`_drift`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np

from pellucid.study.results import ResultRow
from pellucid_lab.knee.chosen_constants import chosen
from pellucid_lab.knee.drawn import drawn_rig
from pellucid_lab.knee.identified_wearer import identify_wearer_of
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.knee.trial import Controller
from pellucid_lab.papers.knee.controllers import controllers
from pellucid_lab.papers.knee.swings import rms_mismatch_and_torque, swing
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

from ._loads import ratio_interval

SEED = 8200
"""First seed of the simulated wearers; constants were chosen on wearers 101 to 106."""

WEARER_COUNT = sized(3, smallest=1)
"""Number of wearers, each with an orthosis of their own."""

DURATION_S = sized(20.0, smallest=6.0)
"""Duration of every swing [s]."""

DELAYS_MS = (0, 50, 100, 200)
"""Delays of what EMG tells [ms]."""

PACES_HZ = (None, 1.4)
"""Pace of the swings: the rig's own, and a fast one [Hz]."""


class LateEmg:
    """A controller that hears EMG `late` periods later than it is recorded."""

    reads_motor_encoder = False

    def __init__(self, controller: Controller, late: int):
        self._controller, self._waiting = controller, deque([()] * late)

    @property
    def fault(self) -> str:
        """Fault that the controller's safety gate has latched."""
        return self._controller.fault

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """Return the command of one period, as every controller does."""
        self._waiting.append(tuple(emg))
        return self._controller.step(time, position, torque, list(self._waiting.popleft()))


def lead_control_rows(count: int = WEARER_COUNT) -> Iterator[ResultRow]:
    """Every figure of what a lead buys."""
    tried = ordered_results([(try_wearer, SEED + i) for i in range(count)])
    found = {key: np.array([one[key] for one in tried]) for key in tried[0]}
    for pace in ("own", "fast"):
        none, base = found[f"{pace}.none"], found[f"{pace}.zero"]
        yield _ratio(f"{pace}.without_emg", none, base, "residual law without EMG over zero impedance")
        yield _ratio(f"{pace}.with_emg", found[f"{pace}.0"], none, "residual law with EMG on time over it without EMG")
        for late in DELAYS_MS[1:]:
            words = f"the same with EMG {late} ms late over EMG on time"
            yield _ratio(f"{pace}.late_{late}ms", found[f"{pace}.{late}"], found[f"{pace}.0"], words)


def try_wearer(seed: int) -> dict[str, float]:
    """Return RMS strap torques [N*m] of one wearer, by pace and delay of EMG."""
    rig, name, constants, made = drawn_rig(knee_orthosis(), seed), f"D{seed}", chosen(), {}
    card = identify_wearer_of(rig, name, seed).card(constants.emg)
    built = controllers(card, rig.period, (0.0, 4.4), constants, only=("zero_impedance", "residual", "residual_no_emg"))
    for pace, frequency in zip(("own", "fast"), PACES_HZ, strict=True):
        swung = rig if frequency is None else rig.changed({"swing.frequency": [frequency, frequency]})
        laws = {"zero": None, "none": built["residual_no_emg"].build()}
        for late in DELAYS_MS:
            laws[str(late)] = LateEmg(built["residual"].build(), round(1e-3 * late / rig.period))
        for law, controller in laws.items():
            taken = swing(swung, name, seed, controller, duration=DURATION_S)
            made[f"{pace}.{law}"] = rms_mismatch_and_torque(taken)[1]
    return made


def _ratio(name: str, over: np.ndarray, under: np.ndarray, words: str) -> ResultRow:
    ratio, low, high = ratio_interval(over, under)
    note = f"{words}; {len(over)} wearers, 95 % interval {low:.3f} to {high:.3f}; {over.mean():.3f} N*m"
    return ResultRow(f"mission.lead.control.{name}", ratio, "1", "evidence", "simulated", None, note)
