"""The gate, from Python: a million cycles of nonsense, and each of its promises."""

import math

import numpy as np
import pytest

from pellucid import _core

PARAMETERS = dict(
    effort_limit=10.0, rate_limit=500.0, velocity_limit=20.0, position_min=-1.0, position_max=1.5, stop_margin=0.2,
    max_age=0.01, max_repeats=3, period=1e-3,
)  # fmt: skip


def test_a_million_cycles_of_nonsense(rng):
    n = 1_000_000
    command, position, velocity = rng.uniform(-30, 30, n), rng.uniform(-1.2, 1.7, n), rng.uniform(-15, 15, n)
    time, sequence = 1e-3 * np.arange(n), np.arange(n)
    nonsense = np.array([np.nan, np.inf, -np.inf, 5e-324, -5e-324, 1e308, -1e308, 0.0])
    for column in (command, position, velocity, time):
        where = rng.random(n) < 1e-3
        column[where] = rng.choice(nonsense, where.sum())
    stale = np.flatnonzero(rng.random(n) < 2e-3)
    sequence[stale] -= rng.integers(1, 9, stale.size)
    gate = _core.SafetyGate(**PARAMETERS)
    step = 500.0 * 1e-3 * (1 + 1e-12)
    before, unsafe, shut, moving = 0.0, 0, 0, 0
    columns = (column.tolist() for column in (command, position, velocity, time, sequence, rng.random(n)))
    for u, q, v, t, k, chance in zip(*columns, strict=True):
        out = gate.step(u, q, v, t, k)
        ok = -10.0 <= out <= 10.0  # false for NaN
        if abs(out) > abs(before) or out * before < 0:
            ok = ok and abs(out - before) <= step
        if gate.fault != "none":
            ok = ok and abs(out) <= abs(before)
            shut += 1
            if chance < 0.05:
                gate.reset()
        if math.isfinite(q):
            ok = ok and not (out > 0 and q >= 1.5) and not (out < 0 and q <= -1.0)
        unsafe += not ok
        moving += out != 0
        before = out
    assert unsafe == 0
    assert shut > 10_000
    assert moving > 500_000


class Rig:
    """A gate and the clock of the loop around it."""

    def __init__(self, **changes):
        self.gate = _core.SafetyGate(**PARAMETERS | changes)
        self.k = 0

    def step(self, command, position=0.0, velocity=0.0, time=None, sequence=None):
        self.k += 1
        return self.gate.step(
            command,
            position,
            velocity,
            self.k * 1e-3 if time is None else time,
            self.k if sequence is None else sequence,
        )

    def settle(self, command, **at):
        return [self.step(command, **at) for _ in range(100)][-1]


def test_what_is_allowed_passes():
    rig = Rig()
    assert [rig.step(4.0) for _ in range(9)] == pytest.approx([0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4, 4])
    assert rig.settle(99.0) == 10.0
    assert rig.gate.fault == "none"


@pytest.mark.parametrize(
    ("fault", "sample"),
    [
        ("not_finite", dict(command=np.nan)),
        ("not_finite", dict(command=8.0, position=np.inf)),
        ("not_finite", dict(command=8.0, velocity=np.nan)),
        ("not_finite", dict(command=8.0, time=np.nan)),
        ("not_finite", dict(command=8.0, time=1e300)),
        ("velocity", dict(command=8.0, position=-0.17, velocity=-20.1)),
        ("out_of_order", dict(command=8.0, time=0.05)),
        ("out_of_order", dict(command=8.0, sequence=50)),
        ("stale", dict(command=8.0, time=0.112)),
    ],
)
def test_fault_latches_and_ramps_to_zero(fault, sample):
    rig = Rig()
    assert rig.settle(8.0) == 8.0
    assert rig.step(**sample) == pytest.approx(7.5)
    assert rig.gate.fault == fault
    rig.k += 1
    ramp = [rig.step(8.0) for _ in range(30)]
    assert ramp[:3] == pytest.approx([7.0, 6.5, 6.0])
    assert ramp[-1] == 0.0
    assert rig.gate.fault == fault
    rig.gate.reset()
    assert rig.gate.fault == "none"
    assert rig.settle(8.0) == 8.0


def test_repeated_samples():
    rig = Rig()
    rig.settle(8.0)
    for _ in range(3):
        rig.step(8.0, time=0.1, sequence=100)
        assert rig.gate.fault == "none"
    rig.step(8.0, time=0.1, sequence=100)
    assert rig.gate.fault == "stale"


def test_sequence_may_wrap_around():
    gate = _core.SafetyGate(**PARAMETERS)
    for k in range(2**32 - 50, 2**32 + 50):
        gate.step(1.0, 0.0, 0.0, 1e-3 * (k - 2**32 + 60), k % 2**32)
    assert gate.fault == "none"


def test_effort_into_a_stop_falls_to_zero():
    out = [Rig().settle(99.0, position=q) for q in (1.2, 1.3, 1.35, 1.4, 1.45, 1.5, 2.0)]
    assert out == pytest.approx([10, 10, 7.5, 5, 2.5, 0, 0])
    assert Rig().settle(-99.0, position=2.0) == -10.0
    assert Rig().settle(-99.0, position=-0.9) == pytest.approx(-5)


@pytest.mark.parametrize("name", sorted(set(PARAMETERS) - {"max_repeats", "position_min", "position_max"}))
@pytest.mark.parametrize("value", [np.nan, -1.0])
def test_parameters_that_make_no_sense(name, value):
    rig = Rig(**{name: value})
    assert rig.gate.fault == "configuration"
    assert rig.settle(5.0) == 0.0
    rig.gate.reset()
    assert rig.gate.fault == "configuration"


def test_stops_the_wrong_way_round():
    assert Rig(position_min=2.0).gate.fault == "configuration"
    assert Rig(position_max=np.nan).gate.fault == "configuration"


def test_no_limit_is_infinite():
    rig = Rig(velocity_limit=np.inf, position_min=-np.inf, position_max=np.inf, max_age=np.inf, max_repeats=2**32 - 1)
    assert rig.settle(10.0, position=1e9, velocity=1e9) == 10.0
