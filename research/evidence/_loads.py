"""Loads and support on virtual robots: load estimated from one lift, residual torque of a law that carries it, falling
load.

Robots and wearers are held out. The plant has a motor behind an elastic transmission, friction that rises
towards rest and varies along the travel, a strap, and a wearer who reaches; laws and estimates have one rigid body from
an identification. Plant and model share gravity, so that the result is a test of robustness to friction, strap, drive,
sensors and wearer.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.joint_compensation import identified_body
from pellucid.controllers.supervised import supervised
from pellucid.controllers.transparent_laws import expecting_load
from pellucid.joint.fit.drive_constant import Lift, estimate_load
from pellucid.models.anthropometry import point_mass
from pellucid.models.joint import GRAVITY
from pellucid.study.results import ResultRow
from pellucid_lab.elbow.rig import able_elbow, drawn_rigs, with_fastened_load
from pellucid_lab.pointing.conditions import identify_cards, interaction_rms
from pellucid_lab.pointing.people import Person, draw_people
from pellucid_lab.pointing.rig import PointingRig, elbow_participants
from pellucid_lab.pointing.session import PointingSession, simulate_session
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

SEED = 20261127
"""Held-out seed of the simulated robots, wearers and loads."""

PAIR_COUNT = sized(8, smallest=1)
"""Number of robots, each with a wearer of its own."""

LOADS_KG = sized((0.5, 1.0, 1.5), smallest=(1.0,))
"""Masses that are fastened to each robot [kg]."""

EMPTY_LIFTS_DEG = (24.0, 36.0, 48.0, 60.0, 36.0)
"""Amplitudes of the lifts without a load [deg]."""

FIRST_LIFT_DEG = 48.0
"""Amplitude of the first lift with the load [deg]."""

JUDGED_LIFTS_DEG = (24.0, 60.0, 36.0)
"""Amplitudes of the movements on which laws are compared [deg]."""

LOAD_DISTANCE_M = 0.3
"""Distance of every load from the joint's axis [m]: the grip of a hand."""

SENSOR_GAIN_SD = 0.02
"""Standard deviation of the force sensor's gain, which the virtual sensor of the laws does not have [1]."""

MAX_LOAD_KG = 2.0
"""Largest load that the supervisor of the first lift expects [kg]."""

CARRYING_LAW = "force_sensor"
"""Controller that carries the loads."""

DROP_LOADS_KG = sized((0.3, 0.5, 0.75, 1.0, 1.5, 2.0), smallest=(1.5,))
"""Masses that fall off [kg]."""


@dataclass(frozen=True)
class LoadTrial:
    """One load on one robot and wearer."""

    mass: float  # [kg]
    found: float  # mass as the first lift tells it [kg]
    covered: bool  # whether the interval contains the mass
    width: float  # half the interval's width over the mass [1]
    static: float  # mass as two held postures tell it, one without and one with the load [kg]
    without: float  # interaction torque of a law that expects a load and carries none [N*m]; NaN where it stopped
    carried: float  # interaction torque of the law with the estimated load [N*m]
    weighed: float  # interaction torque of the law with the true load [N*m]
    empty: float  # interaction torque of the law on the robot without a load [N*m]
    # Whether the supervisor stopped the law that expects no load, and the law with the load
    stopped: tuple[bool, bool]


@dataclass(frozen=True)
class SupportTrial:
    """One wearer whose forearm is supported."""

    meant: float  # interaction torque that the law means to give, RMS over movements [N*m]
    error: float  # RMS deviation of the interaction torque from it [N*m]
    transparent: float  # the same deviation of a law that supports nothing [N*m]
    effort: float  # mean excitation of the flexors over that under the law that supports nothing [1]
    stopped: bool


def load_rows(pairs: int = PAIR_COUNT) -> Iterator[ResultRow]:
    """Every figure of loads and support."""
    found = ordered_results([(try_pair, index) for index in range(pairs)])
    loads = [trial for trials, _, _ in found for trial in trials]
    supports = [support for _, support, _ in found]
    errors = np.array([abs(t.found / t.mass - 1.0) for t in loads])
    held = np.array([abs(t.static / t.mass - 1.0) for t in loads])
    n = len(loads)
    yield row(
        "load.error", 100.0 * np.median(errors), "%",
        f"median of {n} loads; 90 % quantile {100.0 * np.quantile(errors, 0.9):.2g} %, largest "
        f"{100.0 * errors.max():.2g} %; two held postures (reference method): {100.0 * np.median(held):.2g} % and "
        f"{100.0 * np.quantile(held, 0.9):.2g} %",
    )  # fmt: skip
    yield row("load.within_5_percent", np.mean(errors <= 0.05), "1", f"share of {n} loads")
    covered = np.mean([t.covered for t in loads])
    yield row("load.coverage", covered, "1", "share of intervals of 95 % with the true mass")
    yield row("load.interval", 100.0 * np.median([t.width for t in loads]), "%", "half the interval's width, median")
    kept = [t for t in loads if np.isfinite(t.without + t.carried)]
    ratio, low, high = ratio_interval([t.carried for t in kept], [t.without for t in kept])
    yield row(
        "load.interaction_over_without", ratio, "1",
        f"law with the estimated load over law without it, {len(kept)} of {n} loads, 95 % interval {low:.3f} to "
        f"{high:.3f} over resampled loads; {np.mean([t.without for t in kept]):.2f} to "
        f"{np.mean([t.carried for t in kept]):.2f} N*m",
    )  # fmt: skip
    yield row("load.interaction", np.nanmean([t.carried for t in loads]), "N*m", "law with the estimated load")
    yield row("load.interaction_weighed", np.nanmean([t.weighed for t in loads]), "N*m", "law with the true load")
    yield row("load.interaction_empty", np.nanmean([t.empty for t in loads]), "N*m", "no load on the robot")
    stopped = [sum(t.stopped[i] for t in loads) for i in (0, 1)]
    yield row("load.stopped", stopped[1], "1", f"sessions of {n} with the load carried that stopped")
    yield row("load.stopped_without", stopped[0], "1", f"of {n} sessions of a law that expects no load")
    yield row(
        "support.interaction", np.mean([s.error for s in supports]), "N*m",
        f"RMS deviation from the weight that is to be carried, {np.mean([s.meant for s in supports]):.2f} N*m RMS; "
        f"a law that supports nothing deviates by {np.mean([s.transparent for s in supports]):.2f} N*m; "
        f"{len(supports)} wearers",
    )  # fmt: skip
    yield row(
        "support.flexor_excitation", np.mean([s.effort for s in supports]), "1",
        f"mean over that without support, {min(s.effort for s in supports):.2f} to "
        f"{max(s.effort for s in supports):.2f}; "
        f"{sum(s.stopped for s in supports)} sessions stopped",
    )  # fmt: skip
    drops = [drop for _, _, fallen in found for drop in fallen]
    for mass in DROP_LOADS_KG:
        times = [time for at, time in drops if at == mass]
        seen, early = [time for time in times if np.isfinite(time)], sum(map(np.isnan, times))
        yield row(
            f"load.drop_found.{1e3 * mass:.0f}g", len(seen) / len(times), "1",
            f"share of {len(times)} loads that fell off while held, found within 2 s; {early} stopped before the fall"
            + (f", after {1e3 * np.median(seen):.0f} ms in the median" if seen else ""),
        )  # fmt: skip


def row(name: str, value: float, unit: str, note: str, split: str = "simulated") -> ResultRow:
    """Return one figure of this proof."""
    return ResultRow(f"mission.{name}", float(value), unit, "evidence", split, None, note)


def mean_interval(values: np.ndarray, seed: int, *, draws: int = 2000) -> tuple[float, float]:
    """Return the 95 % interval of a mean over resampled values, shape (n,)."""
    picks = np.random.default_rng(seed).integers(0, len(values), (draws, len(values)))
    low, high = np.quantile(values[picks].mean(axis=1), (0.025, 0.975))
    return float(low), float(high)


def ratio_interval(
    over: Sequence[float] | np.ndarray, under: Sequence[float] | np.ndarray, *, draws: int = 2000
) -> tuple[float, float, float]:
    """Return the ratio of two means and its 95 % interval over resampled pairs."""
    a, b = np.array(over), np.array(under)
    picks = np.random.default_rng(SEED).integers(0, len(a), (draws, len(a)))
    low, high = np.quantile(a[picks].mean(axis=1) / b[picks].mean(axis=1), (0.025, 0.975))
    return float(a.mean() / b.mean()), float(low), float(high)


def try_pair(index: int) -> tuple[list[LoadTrial], SupportTrial, list[tuple[float, float]]]:
    """Return the trials of all loads, of support, and of falling loads on robot and wearer `index`."""
    robot = drawn_rigs(able_elbow(), index + 1, seed=SEED)[index]
    rig = elbow_participants(robot)
    person = draw_people(rig, np.random.default_rng([SEED, 1]), count=max(PAIR_COUNT, 6))[index]
    card = identify_cards(robot)["load"]
    place = person.slider(rig)
    build = partial(ELBOW_CONTROLLERS[CARRYING_LAW].build, card, place)
    body = identified_body(card, place)
    rng = np.random.default_rng([SEED, 2, index])
    measure = _Sensor(rig, 1.0 + SENSOR_GAIN_SD * rng.standard_normal(), rng)
    empty = _session(rig, person, build(), EMPTY_LIFTS_DEG, [index, 3])
    lifts = [measure.lift(empty, i) for i in range(0, len(empty.movements), 2)]
    settings = {
        "distance": LOAD_DISTANCE_M, "sensor_delay": rig["force_sensor"]["delay"], "gain_error": SENSOR_GAIN_SD
    }  # fmt: skip
    plain = interaction_rms(_session(rig, person, build(), JUDGED_LIFTS_DEG, [index, 4]))
    made = []
    for i, mass in enumerate(LOADS_KG):
        load = point_mass(mass, LOAD_DISTANCE_M)
        loaded = elbow_participants(with_fastened_load(robot, load))
        blind = expecting_load(build(), point_mass(MAX_LOAD_KG, LOAD_DISTANCE_M))
        first = _session(loaded, person, blind, (FIRST_LIFT_DEG,), [index, 5, i])
        estimate = estimate_load(body, lifts, measure.lift(first, 0), **settings)
        low, high = estimate.interval
        static = (measure.held_weight(first, body) - measure.held_weight(empty, body)) / (GRAVITY * LOAD_DISTANCE_M)
        tried = {}
        laws = {"without": blind, "carried": build(load=estimate.load), "weighed": build(load=load), "plain": build()}
        for name, law in laws.items():
            tried[name] = _session(loaded, person, law, JUDGED_LIFTS_DEG, [index, 6, i])
        torques = {name: _torque(tried[name]) for name in ("without", "carried", "weighed")}
        stopped = (tried["plain"].fault != "none", tried["carried"].fault != "none")
        width = 0.5 * (high - low) / mass
        covered = low <= mass <= high
        made.append(LoadTrial(mass, estimate.mass, covered, width, static, **torques, empty=plain, stopped=stopped))
    drops = [(mass, fall(build, rig, mass, [index, 8, i])) for i, mass in enumerate(DROP_LOADS_KG)]
    return made, _support(rig, person, card, place, index), drops


@dataclass(frozen=True)
class _Sensor:
    """A force sensor with gain, offset, noise and delay, as the controller's log has it."""

    rig: PointingRig
    gain: float
    rng: np.random.Generator

    def lift(self, session: PointingSession, number: int) -> Lift:
        """Return the log of a movement of a session."""
        movement = session.movements[number]
        part = slice(movement.begin, movement.end)
        position, effort = (session.signals[name][part] for name in ("encoder", "command"))
        return Lift(position, effort, self.felt(session)[part], session.fs)

    def felt(self, session: PointingSession) -> np.ndarray:
        """Return the sensor's torque over a session, (n,) [N*m]."""
        sensor, true = self.rig["force_sensor"], session.signals["interaction"]
        late = round(sensor["delay"] * session.fs)
        delayed = np.concatenate([np.repeat(true[0], late), true[: len(true) - late]])
        noise = sensor["noise"] * self.rng.standard_normal(len(true))
        return self.gain * delayed + sensor["offset"] + noise

    def held_weight(self, session: PointingSession, body: dict[str, float]) -> float:
        """Return the weight beyond the robot's own in the first held target, held out horizontally [N*m]."""
        movement = session.movements[0]
        part = slice(movement.end - round(0.5 * session.fs), movement.end)
        q = float(np.mean(session.signals["encoder"][part]))
        given = float(np.mean(session.signals["command"][part] + self.felt(session)[part]))
        weight = body["gravity_sine"] * np.sin(q) + body["gravity_cosine"] * np.cos(q) + body["offset"]
        return (given - weight) / np.sin(q)


def _session(rig: PointingRig, person: Person, law, lifts_deg: tuple[float, ...], seed: list[int]) -> PointingSession:
    rng = np.random.default_rng([SEED, *seed])
    return simulate_session(rig, person, "worn", law, rng, np.deg2rad(lifts_deg))


def _torque(session: PointingSession) -> float:
    """Return the interaction torque of a session, RMS over movements [N*m]; NaN where the supervisor stopped it."""
    return interaction_rms(session) if session.fault == "none" else float("nan")


def _support(rig: PointingRig, person: Person, card, place: float, index: int) -> SupportTrial:
    supporting = ELBOW_CONTROLLERS["support"].build(card, place, limb=person.forearm)
    plain = ELBOW_CONTROLLERS["support"].build(card, place, limb=person.forearm, share=0.0)
    sessions = [_session(rig, person, law, JUDGED_LIFTS_DEG, [index, 7]) for law in (supporting, plain)]

    def deviation(session: PointingSession) -> float:
        meant = -supporting.supported * np.sin(session.signals["position"])
        return float(np.sqrt(np.mean((session.signals["interaction"] - meant) ** 2)))

    meant = float(np.sqrt(np.mean((supporting.supported * np.sin(sessions[0].signals["position"])) ** 2)))
    effort = np.mean(sessions[0].signals["flexor"]) / np.mean(sessions[1].signals["flexor"])
    return SupportTrial(meant, *map(deviation, sessions), float(effort), sessions[0].fault != "none")


def fall(build, rig: PointingRig, mass: float, seed: list[int]) -> float:
    """Return the time until a supervised law finds that its load fell off a held robot [s].

    It is infinite if the fall is not found within 2 s, and NaN if the supervisor stopped the law before.

    The plant is a rigid body with smooth dry friction that nobody identified, on a wearer who holds the angle as a
    spring with a damper: written here, and without an equation of the core.
    """
    rng = np.random.default_rng([SEED, *seed])
    law = build(load=point_mass(mass, LOAD_DISTANCE_M))
    safe = supervised(law, instruments=rig.robot.instruments, start_up=False)
    values = build().values
    inertia, sine = values["inertia"], values["gravity_sine"] * rng.uniform(0.95, 1.05)
    cosine, dry = values["gravity_cosine"], rng.uniform(0.2, 0.4)
    stiffness, damping = rng.uniform(10.0, 30.0), rng.uniform(0.5, 1.5)
    held = rng.uniform(1.0, 1.8)
    sensor, dt, parts = rig["force_sensor"], 1e-3, 10
    late = round(sensor["delay"] / dt)
    q, v, effort, felt = held, 0.0, 0.0, [0.0] * (late + 1)
    fallen_at = 2.0
    for k in range(4000):
        time = k * dt
        gone = time >= fallen_at
        carried = 0.0 if gone else mass
        reading = q + rig.robot.quantum * (rng.random() - 0.5)
        effort = safe.step(time, reading, felt[0] + sensor["noise"] * rng.standard_normal(), None, drive=effort)
        if safe.fault != "none":
            return time - fallen_at if gone else float("nan")
        for _ in range(parts):
            wearer = stiffness * (held - q) - damping * v
            weight = (sine + carried * GRAVITY * LOAD_DISTANCE_M) * np.sin(q) + cosine * np.cos(q)
            total = inertia + carried * LOAD_DISTANCE_M**2
            v += dt / parts * (effort + wearer - weight - dry * np.tanh(v / 0.02)) / total
            q += dt / parts * v
        felt = [*felt[1:], wearer]
    return float("inf")
