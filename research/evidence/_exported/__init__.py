"""Controllers written by `pellucid export`, compiled and worn by simulated people on plants that are not the core's.

What the plant shares with the core: nothing but the exported interface. `foreign_wearer.cpp` includes
pellucid_controller.h and none of the core's headers; one generated file, which holds no plant, tells it where a flipped
bit may hit. The plant has other equations than every model of the core: friction on elasto-plastic bristles with
a rise towards rest and a part that grows with the joint's own load, a transmission with flexibility and backlash, a
drive with lag, dead time, ripple and saturation, two cuffs that harden and have slack, a limb with a muscle servo. Its
numbers are the card's, times a factor of 0.7 to 1.4 each. Instruments err as real ones do: gains by 5 %, offsets by 1 %
of the effort limit, lags of 0.3 to 2 ms, noise and quanta. The drive's test at start-up is commissioned on another
wearer wherever the drive is measured or probed, and the probe on that wearer, in another posture and with friction that
is another by a factor of 0.7 to 1.4. Rows that say so have a probe that was not commissioned.

Simulated wearers cannot prove that people move, tremble, cramp and resist a robot only in these ways. They cannot prove
that a machine has no other resonance, backlash or fault, or that two faults never occur together. They also cannot
prove that the supervisor distinguishes a fault from a voluntary movement with the same motion. A figure of this proof
is valid for the simulated cases.

Plants and wearers for choosing thresholds have seeds from `TUNING_SEED` on, those of the proof `JUDGED_SEED`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

from pellucid._errors import PellucidError
from pellucid.controllers.supervised import unheard_energies
from pellucid.study.results import ResultRow
from pellucid_lab.safety.fault_table import FAULT_KINDS
from pellucid_lab.safety.worn_robot import LAWS
from research.benchmarks._size import sized

from .._commissioned import commissioned_rows
from .._parts import run_parts
from .._supervisor_page import FaultFigure
from .._supervisor_page import fault_figures as figures_of_faults
from .exports import DATASET_EXPORTS, INSTRUMENT_SETS, RIG_EXPORTS, ExportedLaw, Exports
from .motion_bounds import BAR_J, measure_bounds
from .trials import (
    KINDS,
    MIN_EFFECT_J,
    SINE_AMPLITUDES_NM,
    ForeignLife,
    ForeignTrial,
    live,
    play_all,
    try_faults,
    try_starts,
)

TUNING_SEED = 20261101
"""First seed of plants on which thresholds may be chosen."""

JUDGED_SEED = 956858621
"""Seed of the plants of the proof, on which nothing was chosen."""

PLANT_COUNT = sized(20, smallest=1)
"""Number of foreign plants, each with a wearer, on which every fault is tried under every law."""

EXPORTED_LAWS: tuple[str, ...] = sized(LAWS, smallest=("force_sensor", "compensation"))
"""Controllers of the elbow that are exported."""

HEALTHY_HOURS = sized(48.5, smallest=0.02)
"""Healthy use of all laws and plants together, with a measured drive, and as much without [h].

Starts and resets leave at least 48 h with the law in force.
"""

JITTER_HOURS = sized(24.5, smallest=0.02)
"""Healthy use with stamps that jitter, on a clock of 32 bits that turns over [h]."""

LEG_HOURS = sized(24.0, smallest=0.02)
"""Healthy use of the worn leg with a measured drive, and as much without [h]."""

STAMP_JITTER_S = 0.2e-3
"""Largest error of a stamp, either way."""

SOFT_ROBOT_COUNT = sized(600, smallest=2)
"""Number of robots, half of them with a soft transmission, whose law hears a force sensor."""

SOFT_LIFE_S = sized(20.0, smallest=10.0)
"""Duration of the life of one of them."""

SPIKED_WEARER_COUNT = sized(120, smallest=2)
"""Number of wearers whose drive has one wrong reading."""

RATE_KINDS = ("rate_half", "rate_quarter", "rate_double", "rate_twice")
"""Wrong rates of the control task."""

CLOCK_FAULTS = ("rate", "jump", "stale", "out_of_order", "overspeed", "velocity")
"""Faults that a wrong clock would raise."""

OSCILLATION_FAULTS = ("ringing", "shaking", "power", "energy", "velocity", "overspeed", "drive_effort")
"""Faults that a loop raises which swings by itself."""

HEALTHY_LIFE_S = sized(900.0, smallest=30.0)
"""Duration of one healthy life."""

START_WEARER_COUNT = sized(20, smallest=1)
"""Number of wearers, or of drawn plants of a machine that nobody wears, with whom each default export starts."""

START_POSTURE_COUNT = sized(7, smallest=2)
"""Number of postures, evenly over the range, in which each default export starts."""

DEFAULT_EXPORTS: tuple[str, ...] = sized((*RIG_EXPORTS, *DATASET_EXPORTS), smallest=("able-elbow",))
"""Rigs and data sets whose default export is started."""

PROBED_KINDS = ("drive_reversed", "drive_double", "drive_triple", "drive_stuck", "drive_dead", "encoder_flipped")
"""Faults that a probe is there to find: polarity, gain of two and three, stuck, dead, and the encoder's sign."""

QUIET_KINDS = ("encoder_frozen", "drive_late", "drive_holds")
"""Faults that a measured drive shows late or not at all, tried again where the supervisor probes as well."""

MAX_PROBED_EXCESS_J = 5.0
"""Energy that a fault which a probe is there to find should not exceed."""

SINE_SETS: Mapping[str, str] = {
    "drive_measured": "the drive's current",
    "force_sensor": "a force sensor, which the law hears",
    "encoder_alone": "encoder alone: no probe, no check for sustained oscillation",
    "unmeasured": "encoder, probe and check for sustained oscillation, as exported",
}
"""What there is to find an added sine with, in words, by the name that the rows have."""

TO_AND_FRO_SETS = ("to_and_fro", "drive_measured_to_and_fro")
"""Sets of instruments of studies whose wearers go back and forth."""

SPIKE_EFFECT_S = 0.1
"""A stop within this time of a wrong reading is its doing."""

FROZEN_PATIENCE_S = 2.0
"""Time within which an encoder that freezes at rest must be found."""

WORST_KINDS = ("drive_reversed", "drive_triple", "drive_stuck", "drive_dead")
"""Faults of which the first line of an export without a drive measurement warns."""


def row(name: str, value: float | None, unit: str, note: str = "") -> ResultRow:
    """Return a figure of this proof."""
    return ResultRow(name, value, unit, "evidence", "simulated", None, note)


@cache
def made_exports() -> Exports:
    """Return all exports of this process, made in a folder that the process removes at its end."""
    return Exports(Path(temporary_folder().name))


@cache
def temporary_folder() -> TemporaryDirectory:
    """Return the folder of all exports of this process."""
    return TemporaryDirectory(prefix="exported-")


@cache
def made_laws(instruments: str) -> tuple[ExportedLaw, ...]:
    """Return every law that `export` writes with a set of instruments by name.

    Laws with a force sensor have no check for oscillation that a study could switch off: sets without it omit them.
    Only a probe may be refused: where the waves that inertia and encoder need are too large for the effort limit.
    """
    made = []
    for name in EXPORTED_LAWS:
        try:
            law = made_exports().law(name, instruments)
            if not (instruments in TO_AND_FRO_SETS and "interaction" in law.uses):
                made.append(law)
        except PellucidError as error:
            has_probe = instruments == "unmeasured" or INSTRUMENT_SETS[instruments].probe
            if not has_probe or "probe: found" not in str(error):
                raise
    return tuple(made)


@cache
def fault_trials(instruments: str, seed: int = JUDGED_SEED) -> tuple[ForeignTrial, ...]:
    """Return every fault under every law on every plant, with a set of instruments by name."""
    some = {"drive_measured_and_probe": QUIET_KINDS, "blind": (*WORST_KINDS, "drive_sine")}
    kinds = some.get(instruments, tuple(KINDS))
    jobs = [
        partial(try_faults, law, index, seed, kinds) for law in made_laws(instruments) for index in range(PLANT_COUNT)
    ]
    return tuple(trial for trials in play_all(jobs) for trial in trials)


@cache
def special_trials(instruments: str, kinds: tuple[str, ...], seed: int = JUDGED_SEED) -> tuple[ForeignTrial, ...]:
    """Return trials of faults that only rows of their own try, under every law on every plant."""
    jobs = [
        partial(try_faults, law, index, seed, kinds) for law in made_laws(instruments) for index in range(PLANT_COUNT)
    ]
    return tuple(trial for trials in play_all(jobs) for trial in trials if not trial.early)


@cache
def uncommissioned_probe_trials(seed: int = JUDGED_SEED) -> tuple[ForeignTrial, ...]:
    """Return what a probe is there to find, by a probe that must first learn what its robot answers."""
    jobs = [
        partial(try_faults, law, index, seed, PROBED_KINDS, commissioned=False)
        for law in made_laws("unmeasured")
        for index in range(PLANT_COUNT)
    ]
    return tuple(trial for trials in play_all(jobs) for trial in trials)


def unsensed_laws() -> tuple[ExportedLaw, ...]:
    """Return the laws without a force sensor, as `export` writes them without a probe."""
    return tuple(law for law in made_laws("blind") if "interaction" not in law.uses)


@cache
def sines_by_instruments(seed: int = JUDGED_SEED) -> dict[str, tuple[ForeignTrial, ...]]:
    """Return the trials of an added sine by the names of `SINE_SETS`."""
    unsensed = {law.name for law in unsensed_laws()}

    def sines(instruments: str) -> list[ForeignTrial]:
        return [t for t in fault_trials(instruments, seed) if t.kind == "drive_sine" and not t.early]

    return {
        "drive_measured": tuple(sines("drive_measured")),
        "force_sensor": tuple(trial for trial in sines("blind") if trial.law not in unsensed),
        "encoder_alone": tuple(trial for trial in sines("blind") if trial.law in unsensed),
        "unmeasured": tuple(trial for trial in sines("unmeasured") if trial.law in unsensed),
    }


@cache
def healthy_lives(
    instruments: str,
    seed: int = JUDGED_SEED,
    hours: float = HEALTHY_HOURS,
    jitter: bool = False,
) -> tuple[ForeignLife, ...]:
    """Return healthy use of all laws with every disturbance, `hours` in total [h], each on its own plant.

    Wearers of an export that checks for oscillation reach and rest; others also go back and forth. With `jitter`, time
    stamps jitter on a 32-bit clock that overflows.
    """
    changed = {}
    if jitter:
        changed = {"clock_jitter": STAMP_JITTER_S, "clock_bits": 32.0, "clock_start": 2.0**32 - 20e6}
    made = made_laws(instruments)
    count = max(round(3600.0 * hours / HEALTHY_LIFE_S), len(made))
    jobs = [partial(live, made[i % len(made)], i, seed, HEALTHY_LIFE_S, **changed) for i in range(count)]
    return tuple(play_all(jobs))


@cache
def starts(seed: int = JUDGED_SEED) -> dict[str, list[ForeignLife]]:
    """Return all starts of every default export by the study's name."""
    made = {name: made_exports().default(name) for name in DEFAULT_EXPORTS}
    jobs = [partial(try_starts, law, START_WEARER_COUNT, START_POSTURE_COUNT, seed) for law in made.values()]
    return dict(zip(made, play_all(jobs), strict=True))


def rows(seed: int = JUDGED_SEED) -> Iterator[ResultRow]:
    """Yield every figure."""
    yield from run_parts("safety, exported", {
        "faults, drive measured": lambda: fault_rows("drive_measured", fault_trials("drive_measured", seed)),
        "faults, unmeasured": lambda: fault_rows("unmeasured", fault_trials("unmeasured", seed)),
        "probe, not commissioned": lambda: probe_rows(uncommissioned_probe_trials(seed), "probe_uncommissioned"),
        "quiet faults": lambda: quiet_rows(fault_trials("drive_measured_and_probe", seed)),
        "faults, blind": lambda: blind_rows(fault_trials("blind", seed)),
        "shaking": lambda: shaking_rows(fault_trials("unmeasured", seed)),
        "sines": lambda: sine_set_rows(sines_by_instruments(seed)),
        "lives, unmeasured": lambda: life_rows("safety.exported.unmeasured", healthy_lives("unmeasured", seed)),
        "lives back and forth, unmeasured": lambda: life_rows(
            "safety.exported.unmeasured.to_and_fro", healthy_lives("to_and_fro", seed)
        ),
        "lives, drive measured": lambda: life_rows("safety", healthy_lives("drive_measured", seed)),
        "lives back and forth, drive measured": lambda: life_rows(
            "safety.to_and_fro", healthy_lives("drive_measured_to_and_fro", seed)
        ),
        "rates": lambda: rate_rows(seed),
        "spikes, frozen encoders, drives that lie": lambda: special_rows(seed),
        "soft robots": lambda: soft_rows(seed),
        "commissioning": commissioned_rows,
        "starts": lambda: start_rows(starts(seed)),
        "springs": lambda: spring_rows(spring_trials(seed)),
        "legs": lambda: leg_rows(seed),
        "bounds of motion": bound_rows,
    })  # fmt: skip


@cache
def spring_trials(seed: int = JUDGED_SEED) -> tuple[ForeignTrial, ...]:
    """Return every fault under the default export of the knee orthosis, on every foreign drive before a spring."""
    law = made_exports().default("knee-orthosis")
    jobs = [partial(try_faults, law, index, seed, tuple(KINDS)) for index in range(PLANT_COUNT)]
    return tuple(trial for trials in play_all(jobs) for trial in trials)


def spring_rows(trials: Sequence[ForeignTrial]) -> Iterator[ResultRow]:
    """Yield what became of each fault of an exported knee orthosis on foreign drives."""
    name = "safety.exported.knee-orthosis"
    seen = [trial for trial in shown(trials) if trial.did_something]
    yield row(f"{name}.found", found_share(seen), "%", f"of {len(seen)} runs; missed: {missed_words(seen)}")
    yield worst_row(f"{name}.worst_excess_energy", seen)
    for kind in dict.fromkeys(trial.kind for trial in trials):
        own = [trial for trial in trials if trial.kind == kind and not trial.early]
        yield row(f"{name}.{kind}.found", found_share(own), "%", f"{sum(t.is_found for t in own)} of {len(own)}")
        yield worst_row(f"{name}.{kind}.worst_excess_energy", own)


@cache
def leg_trials(instruments: str, seed: int = JUDGED_SEED) -> tuple[ForeignTrial, ...]:
    """Return every fault under the default export of a heavy leg on every foreign plant, with a set of instruments."""
    law = made_exports().leg(instruments)
    jobs = [partial(try_faults, law, index, seed, tuple(KINDS)) for index in range(PLANT_COUNT)]
    return tuple(trial for trials in play_all(jobs) for trial in trials)


def leg_rows(seed: int) -> Iterator[ResultRow]:
    """Yield the figures of a worn leg of 44 N m: faults, by the energies that its export prints, lives and starts."""
    for instruments in ("unmeasured", "drive_measured"):
        law, name = made_exports().leg(instruments), f"safety.leg.{instruments}"
        trials = leg_trials(instruments, seed)
        seen = [trial for trial in shown(trials) if trial.did_something]
        yield row(f"{name}.found", found_share(seen), "%", f"of {len(seen)} runs; missed: {missed_words(seen)}")
        for kind in (*PROBED_KINDS, "drive_sine"):
            own = [trial for trial in trials if trial.kind == kind and not trial.early]
            yield row(f"{name}.{kind}.found", found_share(own), "%", f"of {len(own)} runs")
            yield worst_row(f"{name}.{kind}.worst_excess_energy", own)
        if law.numbers["probe_effort"] > 0.0:
            stuck, wrong, dead = unheard_energies(law.numbers)
            printed = {"drive_stuck": stuck, "drive_reversed": wrong, "drive_triple": wrong, "drive_dead": dead}
            shares = [t.excess / printed[t.kind] for t in trials if t.kind in printed and not t.early]
            yield row(f"{name}.energy_over_printed", max(shares, default=None), "1", "largest of four drive faults")
        count = max(round(3600.0 * LEG_HOURS / HEALTHY_LIFE_S), 2)
        jobs = [partial(live, law, index, seed, HEALTHY_LIFE_S) for index in range(count)]
        yield from life_rows(name, list(play_all(jobs)))
    started = try_starts(made_exports().leg("unmeasured"), START_WEARER_COUNT, START_POSTURE_COUNT, seed)
    refused = Counter(f"{a.fault} in {a.before}" for life in started if is_refused(life) for a in life.alarms[:1])
    words = ", ".join(f"{why} {n}" for why, n in refused.most_common()) or "none"
    yield row("safety.leg.starts_refused", sum(map(is_refused, started)), "1", f"of {len(started)}: {words}")


def shown(trials: Sequence[ForeignTrial]) -> list[ForeignTrial]:
    """Return the trials of robots' faults that count as visible: neither hidden, nor a wearer's.

    A spasm, a table or an open strap is no fault of the robot, and what the wearer makes of it differs; each has its
    rows.
    """
    kinds = {kind.name for kind in FAULT_KINDS if not kind.hidden and kind.group != "wearer"}
    return [trial for trial in trials if trial.kind in kinds and not trial.early]


def found_share(trials: Sequence[ForeignTrial]) -> float | None:
    """Return the share of trials in which the fault was found [%]."""
    return 100.0 * sum(trial.is_found for trial in trials) / len(trials) if trials else None


def missed_words(trials: Sequence[ForeignTrial]) -> str:
    """Return which faults were not found how often."""
    missed = Counter(trial.kind for trial in trials if not trial.is_found)
    return ", ".join(f"{kind} {count}" for kind, count in missed.most_common()) or "none"


def worst_row(name: str, trials: Sequence[ForeignTrial], note: str = "") -> ResultRow:
    """Return the largest excess of trials [J]."""
    if not trials:
        return row(name, None, "J", "no run")
    worst = max(trials, key=lambda trial: trial.excess)
    what = f"{worst.kind}, {worst.law}, plant {worst.plant}, {'found' if worst.is_found else 'not found'}"
    return row(name, worst.excess, "J", f"{note}; {what}" if note else what)


def fault_rows(instruments: str, trials: Sequence[ForeignTrial]) -> Iterator[ResultRow]:
    """Yield the figures of all faults with a set of instruments."""
    name, seen = f"safety.exported.{instruments}", shown(trials)
    note = f"{len(seen)} runs, {len({t.law for t in seen})} laws, {len({t.plant for t in seen})} foreign plants"
    effective = [trial for trial in seen if trial.did_something]
    words = f"of {len(effective)} of {len(seen)} runs, in which the fault did something"
    yield row(f"{name}.found", found_share(effective), "%", f"{words}; missed: {missed_words(effective)}")
    harmless = sum(trial.is_found or trial.excess < MIN_EFFECT_J for trial in seen)
    yield row(f"{name}.found_or_harmless", 100.0 * harmless / len(seen) if seen else None, "%",
              f"of {len(seen)} runs; harmless: below {MIN_EFFECT_J} J in 10 s")  # fmt: skip
    yield row(f"{name}.found_of_all", found_share(seen), "%", f"{note}; missed: {missed_words(seen)}")
    yield worst_row(f"{name}.worst_excess_energy", seen, note)
    lost = sum(trial.early for trial in trials)
    yield row(f"{name}.stopped_before", lost, "1", f"of {len(trials)} runs; the supervisor acted before the onset")
    for kind in KINDS:
        own = [trial for trial in trials if trial.kind == kind and not trial.early]
        if own:
            did = sum(trial.did_something for trial in own)
            found = sum(trial.is_found for trial in own)
            yield row(f"{name}.{kind}.found", found_share(own), "%", f"{found} of {len(own)}; {did} did something")
            yield worst_row(f"{name}.{kind}.worst_excess_energy", own)


def probe_rows(trials: Sequence[ForeignTrial], name: str = "probe") -> Iterator[ResultRow]:
    """Yield the figures of faults that a probe is there to find, under a `name`."""
    valid = [trial for trial in trials if trial.kind in PROBED_KINDS and not trial.early]
    note = f"{len(valid)} runs, {len({trial.law for trial in valid})} laws; missed: {missed_words(valid)}"
    yield row(f"safety.exported.{name}.found", found_share(valid), "%", note)
    yield worst_row(f"safety.exported.{name}.worst_excess_energy", valid)
    beyond = Counter(trial.kind for trial in valid if trial.excess > MAX_PROBED_EXCESS_J)
    words = ", ".join(f"{kind} {count}" for kind, count in beyond.most_common()) or "none"
    yield row(f"safety.exported.{name}.beyond", sum(beyond.values()), "1",
              f"of {len(valid)} runs, above {MAX_PROBED_EXCESS_J:g} J: {words}")  # fmt: skip
    for kind in PROBED_KINDS:
        own = [trial for trial in valid if trial.kind == kind]
        yield row(f"safety.exported.{name}.{kind}.found", found_share(own), "%", f"{len(own)} runs")
        yield worst_row(f"safety.exported.{name}.{kind}.worst_excess_energy", own)


def quiet_rows(trials: Sequence[ForeignTrial]) -> Iterator[ResultRow]:
    """Yield the figures of faults that a measured drive shows late or not at all, where the supervisor probes, too."""
    for kind in QUIET_KINDS:
        own = [trial for trial in trials if trial.kind == kind and not trial.early]
        effective = [trial for trial in own if trial.did_something]
        name = f"safety.exported.drive_measured_and_probe.{kind}"
        note = f"of {len(effective)} of {len(own)} runs, in which the fault did something"
        yield row(f"{name}.found", found_share(effective), "%", note)
        yield worst_row(f"{name}.worst_excess_energy", own)


def blind_rows(trials: Sequence[ForeignTrial]) -> Iterator[ResultRow]:
    """Yield what an export finds with neither a measurement of the drive nor a probe: what `--unmeasured` accepts."""
    for kind in WORST_KINDS:
        own = [trial for trial in trials if trial.kind == kind and not trial.early]
        yield row(f"safety.exported.blind.{kind}.found", found_share(own), "%", f"of {len(own)}")
        yield worst_row(f"safety.exported.blind.{kind}.worst_excess_energy", own)


def shaking_rows(trials: Sequence[ForeignTrial]) -> Iterator[ResultRow]:
    """Yield the figures of a sine of 2.5 Hz that a drive adds which measures nothing, as exported by default."""
    own = [trial for trial in trials if trial.kind == "drive_sine" and not trial.early]
    largest = [trial for trial in own if trial.amplitude == max(SINE_AMPLITUDES_NM)]
    name, note = "safety.exported.unmeasured.shaking", f"a sine of {max(SINE_AMPLITUDES_NM):g} N m at 2.5 Hz"
    yield row(f"{name}.found", found_share(largest), "%", f"{note}; {len(largest)} runs")
    yield worst_row(f"{name}.worst_excess_energy", largest, note)
    for amplitude in sorted({trial.amplitude for trial in own}):
        some = [trial for trial in own if trial.amplitude == amplitude]
        yield row(f"{name}.of_{amplitude:g}_newton_metres.found", found_share(some), "%", f"of {len(some)}")
        yield worst_row(f"{name}.of_{amplitude:g}_newton_metres.worst_excess_energy", some)


def rate_rows(seed: int) -> Iterator[ResultRow]:
    """Yield the figures of control tasks at a wrong rate, and of healthy ones whose stamps jitter."""
    trials = special_trials("drive_measured", RATE_KINDS, seed)
    yield row("safety.rate.found", found_share(trials), "%", f"of {len(trials)} runs; {', '.join(RATE_KINDS)}")
    late = max((trial.found for trial in trials if trial.is_found), default=None)
    yield row("safety.rate.detected_after", late, "s", "at the latest")
    lives = healthy_lives("drive_measured", seed, JITTER_HOURS, jitter=True)
    false = Counter(a.fault for life in lives for a in life.alarms if not a.wanted and a.fault in CLOCK_FAULTS)
    words = ", ".join(f"{fault} {count}" for fault, count in false.most_common()) or "none"
    yield row("safety.rate.false", sum(false.values()), "1",
              f"{words}; stamps off by up to {1e3 * STAMP_JITTER_S:g} ms, a clock of 32 bits turns over")  # fmt: skip
    yield row("safety.rate.healthy_hours", sum(life.running for life in lives), "h", f"{len(lives)} lives")


def special_rows(seed: int) -> Iterator[ResultRow]:
    """Yield the figures of a spike in the drive's reading, of an encoder that freezes at rest, of a drive that lies."""
    laws = made_laws("drive_measured")
    spikes = [
        trial
        for index in range(SPIKED_WEARER_COUNT)
        for trial in try_faults(laws[index % len(laws)], index, seed, ("current_spike",))
        if not trial.early
    ]
    near = [trial for trial in spikes if trial.is_found and trial.found < SPIKE_EFFECT_S]
    words = ", ".join(f"{fault} {count}" for fault, count in Counter(t.fault for t in near).most_common()) or "none"
    yield row("safety.spike.stopped", len(near), "1",
              f"of {len(spikes)} wearers within {SPIKE_EFFECT_S:g} s of one wrong reading: {words}")  # fmt: skip
    for instruments in ("unmeasured", "drive_measured"):
        frozen = special_trials(instruments, ("encoder_frozen_at_rest",), seed)
        late = max((trial.found for trial in frozen if trial.is_found), default=None)
        name = "safety.frozen_encoder" if instruments == "unmeasured" else "safety.frozen_encoder.drive_measured"
        found = sum(trial.is_found and trial.found <= FROZEN_PATIENCE_S for trial in frozen)
        yield row(f"{name}.detected_or_unarmed", 100.0 * found / len(frozen) if frozen else None, "%",
                  f"of {len(frozen)} wearers who rest; found within {FROZEN_PATIENCE_S:g} s")  # fmt: skip
        yield row(f"{name}.detected_after", late, "s", "at the latest")
    lies = special_trials("drive_measured", ("drive_lies",), seed)
    yield row("safety.drive_lies.found", found_share(lies), "%", f"of {len(lies)} runs; a sine of 5 N m at 2.5 Hz")
    yield worst_row("safety.drive_lies.worst_excess_energy", lies)


def soft_rows(seed: int) -> Iterator[ResultRow]:
    """Yield on how many robots the loop about a force sensor swings by itself."""
    laws = [law for law in made_laws("drive_measured") if "interaction" in law.uses]
    jobs = [
        partial(live, laws[index % len(laws)], index, seed, SOFT_LIFE_S, mishaps=False, reaching=1.0)
        for index in range(SOFT_ROBOT_COUNT)
    ]
    lives = list(play_all(jobs))
    swings = [life for life in lives if any(not a.wanted and a.fault in OSCILLATION_FAULTS for a in life.alarms)]
    words = ", ".join(f"{life.law} plant {life.plant}" for life in swings[:6]) or "none"
    yield row("safety.soft.oscillating", len(swings), "1", words)
    yield row("safety.soft.robots", len(lives), "1", f"{len(laws)} laws that hear a force sensor, wearers who reach")


def sine_set_rows(by_set: Mapping[str, Sequence[ForeignTrial]]) -> Iterator[ResultRow]:
    """Yield the figures of an added sine by what there is to find it with."""
    for name, trials in by_set.items():
        laws = len({trial.law for trial in trials})
        note = f"{len(trials)} runs, {laws} laws; {SINE_SETS[name]}"
        yield row(f"safety.exported.added_sine.{name}.found", found_share(trials), "%", note)
        yield worst_row(f"safety.exported.added_sine.{name}.worst_excess_energy", trials, SINE_SETS[name])


def life_rows(name: str, lives: Sequence[ForeignLife]) -> Iterator[ResultRow]:
    """Yield the figures of healthy lives under a `name`; every alarm that a person would want has its line."""
    false = [alarm for life in lives for alarm in life.alarms if not alarm.wanted]
    wanted = [alarm for life in lives for alarm in life.alarms if alarm.wanted]
    most = Counter((alarm.fault, alarm.law) for alarm in false).most_common(6)
    words = "; ".join(f"{fault} {law} {count}" for (fault, law), count in most) or "none"
    hours = sum(life.running for life in lives)
    yield row(f"{name}.false_alarms", len(false), "1", words)
    what = "sudden stops, impacts, loads, spasms, donning and doffing"
    yield row(f"{name}.healthy_hours", hours, "h", f"with the law in force, {len(lives)} lives; {what}")
    reasons = Counter(alarm.wanted for alarm in wanted).most_common()
    yield row(f"{name}.wanted_alarms", len(wanted), "1", "; ".join(f"{why} {count}" for why, count in reasons))


def start_rows(started: dict[str, list[ForeignLife]]) -> Iterator[ResultRow]:
    """Yield the figures of the starts of default exports."""
    yield row("safety.default_exports.tried", len(started), "1", ", ".join(started))
    refused = {name: [life for life in lives if is_refused(life)] for name, lives in started.items()}
    yield row("safety.default_exports.starts_refused", sum(map(len, refused.values())), "1",
              f"of {sum(map(len, started.values()))}: "
              + (", ".join(f"{name} {len(lives)}" for name, lives in refused.items() if lives) or "none"))  # fmt: skip
    for name, lives in refused.items():
        causes = Counter(f"{a.fault} in {a.before}" for life in lives for a in life.alarms[:1])
        words = ", ".join(f"{why} {count}" for why, count in causes.most_common()) or "none"
        yield row(f"safety.default_exports.{name}.starts_refused", len(lives), "1", f"of {len(started[name])}: {words}")


def is_refused(life: ForeignLife) -> bool:
    """Return whether a law did not come into force, or stopped within its first seconds without a reason."""
    return life.started != life.started or life.false_alarms > 0


def fault_figures(seed: int = JUDGED_SEED) -> Iterator[FaultFigure]:
    """Yield what became of every fault under exported controllers, by the instruments that they assume."""
    for instruments in ("drive_measured", "unmeasured", "drive_measured_and_probe", "blind"):
        trials = fault_trials(instruments, seed)
        yield from figures_of_faults(instruments, trials, KINDS)
    yield from figures_of_faults("knee-orthosis", spring_trials(seed), KINDS)
    for instruments in ("drive_measured", "unmeasured"):
        yield from figures_of_faults(f"worn-leg_{instruments}", leg_trials(instruments, seed), KINDS)


def bound_rows() -> Iterator[ResultRow]:
    """Yield what bounds of motion would need and leave, where no force sensor tells a drive from a wearer."""
    for bound in measure_bounds(unsensed_laws(), TUNING_SEED):
        name = f"safety.motion_bounds.{bound.name.split(' (')[0].replace(' ', '_')}"
        stopped = f"{100.0 * bound.stopped:.0f} % of healthy lives stopped by a bound that leaves {BAR_J:g} J"
        yield row(f"{name}.least_threshold", bound.needed, "1", f"{bound.unit}, memory {bound.memory:g} s")
        yield row(f"{name}.worst_excess_energy", float(bound.left.max()), "J", stopped if bound.bar > 0.0 else "")
