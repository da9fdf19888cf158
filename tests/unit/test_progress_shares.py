"""Shares of progress follow the measured cost of the steps, and no share is told twice for different work."""

import time

import pytest

from pellucid.study.procedures.procedure import CostedSteps
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import run
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study

MAX_LEAD = 0.25
"""Largest distance of a share from the share of processor time on another joint than those that were measured."""


def test_a_step_begins_at_the_share_of_the_costs_before_it():
    told = []
    steps = CostedSteps(lambda text, share: told.append((text, share)), {"reading": 1.0, "fitting": 3.0, "none": 0.0})
    steps.begin("reading")
    steps.part("fitting")("fitting load", 0.5)
    steps.begin("none")
    assert told == [("reading", 0.0), ("fitting load", 0.625), ("none", 1.0)]


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """What progress was told of a joint: text, share, and share of the processor time."""
    rig = bench_joint().changed({"sampling.duration": 8.0})
    folder = tmp_path_factory.mktemp("shares") / "joint"
    write_study(folder, rig, name="joint", seed=50, trials=rig.trials(50)[:2], threads=1)
    run(open_study(folder))  # what is imported once takes no part
    steps, began = [], time.process_time()
    run(open_study(folder), on_progress=lambda text, share: steps.append((text, share, time.process_time() - began)))
    whole = steps[-1][2]
    return [(text, share, seconds / whole) for text, share, seconds in steps]


def test_shares_follow_the_processor_time(told):
    """A combined fit took half of the time and an eighth of the shares."""
    apart = {text: abs(share - spent) for text, share, spent in told}
    assert max(apart.values()) < MAX_LEAD, apart


def test_shares_never_fall_and_end_at_one(told):
    shares = [share for _, share, _ in told]
    assert shares == sorted(shares)
    assert told[-1][:2] == ("done", pytest.approx(1.0))
