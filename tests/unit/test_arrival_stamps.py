"""Clocks as loggers stamp them: on arrival, with jitter of some samples, and in two columns."""

import numpy as np
import pytest

import pellucid as pl
from pellucid.files.name_evidence import read_name
from pellucid.start.inference.clocks import find_clock

RATE = 500.0


def samples(seconds=20.0):
    t = np.arange(0.0, seconds, 1.0 / RATE)
    q = 0.5 * np.sin(2 * np.pi * 0.31 * t) + 0.3 * np.sin(2 * np.pi * 0.73 * t + 1.0)
    v = np.gradient(q, t)
    return t, q, 0.05 * np.gradient(v, t) + 2.0 * np.sin(q) + 0.1 * v + 0.3 * np.tanh(v / 0.01)


def late(t, rng):
    return np.maximum.accumulate(t + rng.exponential(2.0 / RATE, t.size))


def early_or_late(t, rng):
    return t + rng.normal(0.0, 2.0 / RATE, t.size)


def in_bursts(t, rng):
    """Packets of eight samples with one stamp."""
    return np.repeat(t[::8], 8)[: t.size] + 0.0 * rng.random()


def found_in(stamp, q, name="time [s]"):
    columns = {name: stamp, "q [rad]": q}
    return find_clock(columns, [read_name(column) for column in columns])


@pytest.mark.parametrize("stamps", [late, early_or_late, in_bursts])
@pytest.mark.parametrize(("name", "factor"), [("time [s]", 1.0), ("t_ms", 1e3), ("timestamp", 1.0)])
def test_a_named_clock_with_jitter_of_two_samples_is_the_clock(stamps, name, factor):
    t, q, _ = samples()
    clock = found_in(factor * stamps(t, np.random.default_rng(9)), q, name)
    assert name in (clock.column, clock.coarse_column)
    assert clock.rate == pytest.approx(RATE, rel=1e-3)


def test_stamps_at_which_the_samples_were_taken_are_kept_although_they_jitter():
    t, q, _ = samples()
    taken = t + np.random.default_rng(9).uniform(0.0, 0.9 / RATE, t.size)
    clock = found_in(taken, np.interp(taken, t, q))
    assert clock.column == "time [s]"
    assert clock.rate == pytest.approx(RATE, rel=1e-2)


def test_even_steps_replace_stamps_of_arrival_that_increase():
    t, q, _ = samples()
    clock = found_in(t + np.random.default_rng(9).uniform(0.0, 0.9 / RATE, t.size), q)
    assert (clock.column, clock.coarse_column) == (None, "time [s]")
    assert clock.rate == pytest.approx(RATE, rel=1e-3)


def test_packets_that_came_twice_leave_the_column():
    t, q, _ = samples()
    twice = np.sort(np.r_[np.arange(t.size), np.arange(0, t.size, 7)])
    assert found_in(t[twice], q[twice]).column == "time [s]"


def test_stamps_with_pauses_have_no_mean_rate():
    t, q, _ = samples()
    stamp = late(t, np.random.default_rng(9)) + np.where(t > 9.0, 2.0, 0.0)
    assert found_in(stamp, q).column == "time [s]"


@pytest.mark.parametrize("unit", ["s", "ms", "min"])
def test_the_stated_unit_of_time_is_never_overruled(unit):
    t, q, _ = samples()
    clock = found_in(1e9 * t, q, f"time [{unit}]")
    assert (clock.column, clock.unit) == (f"time [{unit}]", unit)
    assert not clock.is_certain


def test_a_jittering_clock_is_proposed_with_its_rate_and_never_100_hz(tmp_path):
    t, q, tau = samples()
    path = tmp_path / "log.csv"
    rows = zip(late(t, np.random.default_rng(9)), q, tau, strict=True)
    path.write_text("time [s],q [rad],tau [N*m]\n" + "".join(f"{a:.7f},{b:.6f},{c:.5f}\n" for a, b, c in rows))
    text = pl.init(tmp_path / "study", files=[path]).study_file.read_text()
    line = next(line for line in text.splitlines() if line.startswith("time = "))
    assert float(line.split('"')[1].split()[0]) == pytest.approx(RATE, rel=1e-3)
    assert "stamps were taken on arrival" in line


@pytest.mark.parametrize(
    ("seconds", "rest", "ticks", "name"),
    [
        ("header.stamp.secs", "header.stamp.nsecs", 1e9, "header.stamp"),
        ("/joint_states/header/stamp/sec", "/joint_states/header/stamp/nanosec", 1e9, "/joint_states/header/stamp"),
        ("secs", "nsecs", 1e9, "stamp"), ("sec", "nanosec", 1e9, "stamp"), ("s", "ns", 1e9, "stamp"),
        ("stamp.sec", "stamp.nsec", 1e9, "stamp"), ("stampSec", "stampNanosec", 1e9, "stamp"),
        ("tv_sec", "tv_usec", 1e6, "tv"), ("seconds", "milliseconds", 1e3, "stamp"), ("t [s]", "t [ns]", 1e9, "t"),
    ],
)  # fmt: skip
def test_seconds_and_nanoseconds_are_one_stamp(tmp_path, seconds, rest, ticks, name):
    t, q, tau = samples(4.0)
    whole = np.round((t + 1_700_000_000.0) * 1e3).astype(np.int64)
    path = tmp_path / "log.csv"
    rows = zip(whole, q, tau, strict=True)
    path.write_text(
        f"{seconds},{rest},position,effort\n"
        + "".join(f"{a // 1000},{round(a % 1000 * ticks / 1000)},{b:.6f},{c:.5f}\n" for a, b, c in rows)
    )
    found = pl.read(path)
    assert found.names == (name, "position", "effort")
    assert found.units[name] == "s"
    assert found[name] == pytest.approx(whole / 1000.0, abs=1e-6)
    text = pl.init(tmp_path / "study", files=[path]).study_file.read_text()
    assert f'time = {{ column = "{name}", unit = "s" }}' in text


def test_two_clocks_in_two_units_are_no_stamp(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time_s,time_ms,q\n" + "".join(f"{i // 100},{10 * i},{i % 7}\n" for i in range(900)))
    assert pl.read(path).names == ("time_s", "time_ms", "q")
