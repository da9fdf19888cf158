"""People on robots spread over a Dask cluster: `pellucid predict --scheduler`, with one worker and with two.

A tenth of 100 people x 100 robots x 12 movements each way: as many pairs as a lab would look at, on a cluster of this
machine's own processors. Beside the time stands what processors spent, since a machine that does other things as well
tells little by its clock; the same seed gives the same figures, which is checked.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from pellucid.people.design_columns import cluster
from pellucid.study.results import ResultRow
from pellucid_lab.pointing.prediction import Prediction, predict_effects
from pellucid_lab.pointing.rig import elbow_participants
from research.benchmarks._size import sized

PEOPLE_COUNT = sized(10, smallest=1)
"""Number of people of the prediction."""

ROBOT_COUNT = sized(10, smallest=2)
"""Number of robots of the prediction."""

MOVEMENT_COUNT = sized(12, smallest=4)
"""Number of movements of a person in a condition."""

CONTROLLER = {"CLPC": "clpc"}
"""The one controller that is predicted, by the name of its condition."""

WORKER_COUNTS = (1, 2)
"""Numbers of workers of the cluster that are compared."""

ESTIMATED_WORKER_COUNT = 100
"""Number of workers for which the throughput is estimated, with as many robots."""


def predicted(workers: int) -> tuple[Prediction, float, float]:
    """The prediction on so many workers, its time once they were there, and processor time of the host [s]."""
    from distributed import LocalCluster

    local = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=50)
    with local, cluster(local.scheduler_address) as executor:
        # Libraries are loaded before the clock runs.
        list(executor.map(_loaded, range(4 * workers)))
        begun, spent = time.perf_counter(), time.process_time()
        made = predict_effects(
            [elbow_participants()], people=PEOPLE_COUNT, robots=ROBOT_COUNT, movements=MOVEMENT_COUNT,
            controllers=CONTROLLER,
            executor=executor,
        )  # fmt: skip
        return made, time.perf_counter() - begun, time.process_time() - spent


def _loaded(i: int) -> int:
    elbow_participants()
    time.sleep(0.2)
    return i


def rows() -> Iterator[ResultRow]:
    """Time and processor time of the same prediction on one worker and on two."""
    made = {workers: predicted(workers) for workers in WORKER_COUNTS}
    one, two = (made[workers][0] for workers in WORKER_COUNTS)
    note = f"{ROBOT_COUNT} robots x {PEOPLE_COUNT} people, {two.movements} movements under {', '.join(CONTROLLER)}"
    seconds = {workers: found[1] for workers, found in made.items()}
    spent = {workers: found[0].cpu + sum(w.cpu_before for w in found[0].worn) for workers, found in made.items()}
    for workers in WORKER_COUNTS:
        yield _row(f"wall_{workers}", seconds[workers], "s", f"{workers} workers; {note}")
        yield _row(f"cpu_{workers}", spent[workers], "s", f"{workers} workers, identifications too")
        yield _row(f"used_{workers}", spent[workers] / seconds[workers], "1", "processors that were used, of all")
    for workers in WORKER_COUNTS:
        yield _row(f"throughput_{workers}", two.movements / seconds[workers], "1/s", f"movements on {workers} workers")
    estimate, bottleneck = estimated_throughput(
        two.movements / ROBOT_COUNT, made[1][2] / ROBOT_COUNT, spent[1] / ROBOT_COUNT
    )
    yield _row(f"throughput_{ESTIMATED_WORKER_COUNT}", estimate, "1/s", f"estimated; first bottleneck: {bottleneck}")
    yield _row("speed_up", seconds[1] / seconds[2], "1", "two workers over one, by the clock; 2 on an idle machine")
    yield _row("movements_per_cpu_second", two.movements / two.cpu, "1/s", "without identifications")
    yield _row("identification", sum(w.cpu_before for w in two.worn) / len(two.worn), "s", "processor time of a robot")
    same = np.array_equal(one.values, two.values)
    yield _row("same", float(same), "1", "1: both gave the same to the bit")


def estimated_throughput(movements: float, shared: float, job: float) -> tuple[float, str]:
    """Return the movements per second on `ESTIMATED_WORKER_COUNT` free workers and the first bottleneck, in words.

    For each robot there are so many `movements`, and processor time of the scheduler and of the process that asks
    (`shared`) and of its `job` [s]. Each robot is one job, so that no more workers than robots have work.
    """
    serial = ESTIMATED_WORKER_COUNT * shared
    bottleneck = (
        "the scheduler and the process that asks" if serial > job else "the job of one robot, which is not divided"
    )
    return ESTIMATED_WORKER_COUNT * movements / (serial + job), bottleneck


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"cluster.prediction.{name}", value, unit, "evidence", "simulated", note=note)
