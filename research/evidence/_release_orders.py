"""Calibration of muscles with parameters released in stated orders, on simulated people who swing, then swing faster.

The plant is the seated rig's: muscles with elastic tendons and fibres that differ from anatomy in every constant,
synergists with varying shares, EMG with noise, hum and cross-talk, and flexors without electrodes. The model that
is calibrated has rigid tendons and fixed shares. Every person has a held-out seed;
orders and quantities are the paper's or stated in `pellucid_lab.papers.hill.release_orders`.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pellucid.orthosis.swing.loaded_swing import corrected_form, fit_swings
from pellucid.study.results import ResultRow
from pellucid_lab.fourier import play
from pellucid_lab.papers.hill.release_orders import (
    ALL_AT_ONCE,
    DELAY_QUANTITY,
    RELEASE_METHODS,
    RELEASE_ORDERS,
    STRENGTH_ALONE,
    PersonalMuscles,
    calibrate_in_order,
    torque_error,
)
from pellucid_lab.papers.hill.training import TRAINED_QUANTITIES
from pellucid_lab.papers.hill.trials import active_swing, take_subject
from pellucid_lab.seated.protocol import SeatedTrial, rich_swing
from pellucid_lab.seated.rig import SeatedRig, load_seated_rig
from pellucid_lab.seated.subject import draw_subject
from pellucid_lab.seated.wearer import swing_path
from research.benchmarks._size import sized

from ._loads import mean_interval, ratio_interval

PEOPLE_SEED = 31007
"""Seed of the simulated people: it gives the rig's eight bodies other muscles, nerves and limbs."""

ADAM_STEPS = sized(600, smallest=60)
"""Iterations of Adam in each order, over all of its stages."""

NAMES = sized(tuple(f"S{i}" for i in range(1, 9)), smallest=("S1",))
"""Bodies of the rig file: sex, age, height, weight and pace."""

FASTER_FACTOR = 1.5
"""Pace of the faster swings over the person's own [1]."""

SCATTER_METHOD = "least_squares"
"""Method by which both halves of a swing are calibrated, whose difference says how sure the muscles are."""

SEED = 20261128
"""Seed of the resampling."""


def release_rows() -> Iterator[ResultRow]:
    """Every figure of the orders."""
    rig = load_seated_rig()
    rich = rich_swing(rig)
    people = [try_person(rig.changed({"difference.seed": PEOPLE_SEED}), rich, name) for name in NAMES]
    found = {key: np.array([one[key] for one in people]) for key in people[0]}
    orders = [name for name in RELEASE_ORDERS if name not in (ALL_AT_ONCE, STRENGTH_ALONE)]
    yield _row("mission.release_orders", len(orders), "1", f"orders compared with {ALL_AT_ONCE}: {', '.join(orders)}")
    for method in RELEASE_METHODS:
        whole = f"{method}.{ALL_AT_ONCE}"
        measures = {w: words for w, words in MEASURES.items() if w != "scatter" or method == SCATTER_METHOD}
        for what, words in measures.items():
            base = found[f"{whole}.{what}"]
            low, high = mean_interval(base, SEED)
            note = f"{words}, all at once by {method}; {len(base)} people, 95 % interval {low:.3g} to {high:.3g}"
            yield _row(f"mission.release.{whole}.{what}", base.mean(), UNITS[what], note)
        for name in (*orders, STRENGTH_ALONE):
            for what, words in measures.items():
                note = f"{words}, over that of all at once"
                key = f"{method}.{name}.{what}"
                yield _ratio(key, found[key], found[f"{whole}.{what}"], note)
    yield _ratio("delay_searched.heldout", found["delay.heldout"], found["fixed.heldout"], "delay searched over 20 ms")
    yield _ratio("delay_searched.faster", found["delay.faster"], found["fixed.faster"], "the same, faster swings")
    late = 1e3 * (found["delay.found"] - found["delay.true"])
    low, high = mean_interval(late, SEED)
    rms = np.sqrt(np.mean(late**2))
    note = f"delay found less the true one, mean; 95 % interval {low:.1f} to {high:.1f}; RMS {rms:.1f}"
    yield _row("mission.release.delay_error", late.mean(), "ms", note)
    anatomy = found["anatomy.heldout"].mean()
    yield _row("mission.release.anatomy.heldout", anatomy, "N*m", "muscles as in the anatomical model, not fitted")
    yield _row("mission.release.motion.torque", found["spread"].mean(), "N*m", "standard deviation of the true torque")


MEASURES = {
    "heldout": "error of the torque on the person's next swing",
    "faster": f"error of the torque on swings {FASTER_FACTOR:g} times as fast",
    "distance": "distance from the true shape, shift of the optimal length and fastest shortening",
    "scatter": "difference between muscles from the two halves of the swing",
}
"""Quantities compared with those of all parameters at once, in words."""

UNITS = {"heldout": "N*m", "faster": "N*m", "distance": "1", "scatter": "1"}
"""Units of `MEASURES`; the last two are RMS values in standard deviations among people."""


def try_person(rig: SeatedRig, rich, name: str) -> dict[str, float]:
    """Return every measure of one person by method and order, and what a searched delay gives."""
    subject = draw_subject(rig, name)
    faster = replace(subject, frequency=FASTER_FACTOR * subject.frequency)
    fs, seed = rig.constants.instruments.rate, rig.constants.difference.seed
    peaks = rich.peaks()
    driven = play(rich, rig.constants.loaded.duration, fs, 2.0, velocity=2.0 * peaks[-2], acceleration=4.0 * peaks[-1])

    def trial(what: str, protocol: str, reference: np.ndarray, task: str) -> SeatedTrial:
        return SeatedTrial(f"{name}_{what}", protocol, "fit", None, None, reference, task, subject)

    def swinging(what: str, who, duration: float, number: int) -> SeatedTrial:
        rng = np.random.default_rng([seed, number, *name.encode()])
        return trial(what, "seated_swing", swing_path(rig, who, round(duration * fs), rng), "swinging")

    first, second = rig.constants.swing.duration
    made = [
        trial("rich", "loaded_swing", driven, "driven"),
        trial("mvc", "mvc", np.full(round(rig.constants.mvc.duration * fs), rig.constants.mvc.angle), "maximal"),
        swinging("swing_1", subject, first, 1),
        swinging("swing_2", subject, second, 2),
        swinging("swing_3", faster, second, 3),
    ]
    taken = take_subject(rig, made, subject, seed)
    loaded = fit_swings([taken.driven("rich")], corrected_form(0.0))
    swings = {what: active_swing(taken, f"swing_{i}", loaded, flexors=True) for i, what in enumerate(
        ("fitted", "heldout", "faster"), 1)}  # fmt: skip
    person = PersonalMuscles.from_swing(swings["fitted"])
    problem, halves = person.problem(), [person.half(0), person.half(1)]
    truth = {"shape": subject.shape, "optimal_length_shift": subject.muscles[0].constants.optimal_length_shift}
    truth["max_velocity"] = float(np.mean([m.constants.max_velocity for m in subject.extensors]))
    known = [problem.names.index(quantity) for quantity in truth]
    expected = problem.expected.copy()
    expected[known] = list(truth.values())
    true_z = problem.deviations(expected)[known]
    muscles = np.arange(len(problem.priors))
    made_by: dict[str, float] = {"spread": float(np.std(swings["heldout"].active))}
    for method in RELEASE_METHODS:
        for order, stages in RELEASE_ORDERS.items():
            z = calibrate_in_order(problem, stages, method, ADAM_STEPS).z
            made_by |= {
                f"{method}.{order}.heldout": torque_error(problem, z, swings["heldout"]),
                f"{method}.{order}.faster": torque_error(problem, z, swings["faster"]),
                f"{method}.{order}.distance": float(np.sqrt(np.mean((z[known] - true_z) ** 2))),
            }
            if method == SCATTER_METHOD:
                parts = [calibrate_in_order(half, stages, method).z for half in halves]
                made_by[f"{method}.{order}.scatter"] = float(np.sqrt(np.mean((parts[0] - parts[1])[muscles] ** 2)))
    for key, quantities in (("fixed", ()), ("delay", (DELAY_QUANTITY,))):
        own = person.problem((*TRAINED_QUANTITIES, *quantities))
        z = calibrate_in_order(own, [own_quantities(own)], "least_squares").z
        made_by |= {f"{key}.{what}": torque_error(own, z, swings[what]) for what in ("heldout", "faster")}
        if quantities:
            made_by |= {"delay.found": float(own.values(z)[own.names.index("delay")]), "delay.true": subject.delay}
    start = np.clip(np.zeros(len(problem.names)), problem.lower, problem.upper)
    return {**made_by, "anatomy.heldout": torque_error(problem, start, swings["heldout"])}


def own_quantities(problem) -> tuple[str, ...]:
    """Return the quantities that a calibration frees."""
    return tuple(dict.fromkeys(p.free.quantity for p in problem.priors))


def _ratio(name: str, over: np.ndarray, under: np.ndarray, words: str) -> ResultRow:
    ratio, low, high = ratio_interval(over, under)
    smaller = int(np.sum(over < under))
    note = f"{words}; {len(over)} people, 95 % interval {low:.3f} to {high:.3f}; smaller for {smaller}"
    return _row(f"mission.release.{name}", ratio, "1", note)


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(name, float(value), unit, "evidence", "simulated", None, note)
