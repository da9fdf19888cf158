r"""What decides a prediction: elementary effects of people, robot and law, by Morris's method [1]_.

From a random point of a grid one factor after another takes a step; what an effect of a law changes by, over the step,
is that factor's elementary effect there. Their mean size over such trajectories, :math:`\mu^*`, is how much it matters
[2]_, their scatter, :math:`\sigma`, how much that hangs on all the others. A trajectory takes one run more than there
are factors, where variances shared out after Sobol would take some hundred times as many. One factor is chance alone,
the seed of all noise: what does not exceed it shows nothing.

.. [1] M. D. Morris, "Factorial sampling plans for preliminary computational experiments", Technometrics 33(2), 1991.
.. [2] F. Campolongo, J. Cariboni, A. Saltelli, "An effective screening design for sensitivity analysis of large
   models", Environmental Modelling & Software 22, 2007; T. Iwanaga, W. Usher, J. Herman, "Toward SALib 2.0",
   Socio-Environmental Systems Modelling 4, 2022.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from importlib.util import find_spec
from types import ModuleType

import numpy as np

from ..._errors import missing_package
from ..._processes import ordered_results
from .conditions import EXPONENT_CANDIDATES, Cards, identify_cards
from .people import draw_people
from .prediction import (
    FRICTION_SCALE_RANGE,
    INDICES,
    PUBLISHED_CONTROLLERS,
    build_law,
    scale_friction,
    simulate_indices,
)
from .rig import PointingRig
from .session import CONTROL_CONDITION

GRID_LEVEL_COUNT = 4
"""Of the grid, in each factor; friction has a robot of its own at each, which is identified there."""

MIDDLE_80_PERCENT_Z = 1.2816
"""Standard deviations either way that hold 80 % of people."""

CHANCE_FACTOR = "chance"
FRICTION_FACTOR, UPWARD_EXPONENT_FACTOR, DOWNWARD_EXPONENT_FACTOR = "friction", "k upwards", "k downwards"

SCREENED_INDICES = ("duration_median", "vmax", "emg_per_acc")
"""Of `INDICES`, whose changes are looked at; means of durations that were cut off would show where."""

PEOPLE_FACTORS = (
    ("stiffness", "muscles.stiffness"),
    ("posture stiffness", "impedance.posture_stiffness"),
    ("movement stiffness", "impedance.movement_stiffness"),
    ("damping", "muscles.damping"),
    ("posture damping", "impedance.posture_damping_ratio"),
    ("co-contraction", "muscles.cocontraction"),
    ("co-contraction", "cocontraction.cocontraction"),
    ("co-contraction's rise", "cocontraction.cocontraction_rise"),
    ("reflex stiffness", "muscles.reflex_stiffness"),
    ("visual delay", "vision.delay"),
    ("tolerance", "vision.tolerance"),
    ("tolerance", "vision.tolerance_share"),
    ("strap", "robot.strap_stiffness"),
)
"""What may decide, and where a rig's file says it; each model of people has some of them."""


@dataclass(frozen=True)
class Factor:
    """Something that may decide, and between what it lies."""

    name: str
    low: float  # low, high: In the unit of the rig's file
    high: float
    path: str = ""  # Of the constant in the rig's file
    spread: bool = False  # Whether people differ in it, by the file: not while it is moved
    logarithmic: bool = False

    def at(self, level: float) -> float:
        """Its value at a level from 0 to 1."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** level)
        return float(self.low + level * (self.high - self.low))


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How much each factor matters to each effect: 100 ln(worn over control), over the factor's whole range."""

    factors: tuple[Factor, ...]
    laws: tuple[str, ...]
    indices: tuple[str, ...]
    strength: np.ndarray  # (laws, indices, factors) Mean size of elementary effects, mu*
    half_width: np.ndarray  # (laws, indices, factors) Of its 95 % interval, bootstrapped over trajectories
    direction: np.ndarray  # (laws, indices, factors) Mean of elementary effects, mu
    scatter: np.ndarray  # (laws, indices, factors) Their standard deviation, sigma
    complete: np.ndarray  # (laws, indices) Trajectories that count: movements came to an end on their every point
    runs: int

    def of(self, law: str, index: str) -> dict[str, float]:
        """mu* by factor, largest first."""
        found = self.strength[self.laws.index(law), self.indices.index(index)]
        return {self.factors[i].name: float(found[i]) for i in np.argsort(-found)}


def list_factors(rig: PointingRig, friction: tuple[float, float] = FRICTION_SCALE_RANGE) -> tuple[Factor, ...]:
    """What may decide in a rig: its people's constants, where 80 % of people lie or from half to double, the robot's
    friction over its own, k of equation 8, and chance."""
    found = []
    for name, path in PEOPLE_FACTORS:
        table, key = path.split(".")
        value = rig.tables.get(table, {}).get(key)
        if not value:
            continue
        spread = rig[table].get(f"{key}_spread")
        factor = 2.0 if spread is None else float(np.exp(MIDDLE_80_PERCENT_Z * spread))
        found.append(Factor(name, value / factor, value * factor, path, spread is not None, logarithmic=True))
    return (
        *found,
        Factor(FRICTION_FACTOR, *friction, logarithmic=True),
        Factor(UPWARD_EXPONENT_FACTOR, EXPONENT_CANDIDATES[0], EXPONENT_CANDIDATES[-1]),
        Factor(DOWNWARD_EXPONENT_FACTOR, EXPONENT_CANDIDATES[0], EXPONENT_CANDIDATES[-1]),
        Factor(CHANCE_FACTOR, 0.0, GRID_LEVEL_COUNT - 1.0),
    )


def screen_factors(
    rig: PointingRig,
    *,
    trajectories: int = 10,
    people: int = 2,
    movements: int = 20,
    controllers: Mapping[str, str] | None = None,
    factors: Sequence[Factor] | None = None,
    seed: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Sensitivity:
    """Elementary effects of `factors` on what each law changes, of so many `people` who make so many `movements`.

    Raises
    ------
    PellucidError
        If SALib is not installed.
    """
    sample, analyze = _salib()
    tell = on_progress or (lambda text, share: None)
    factors = tuple(factors or list_factors(rig))
    named = dict(controllers or PUBLISHED_CONTROLLERS)
    problem = {"num_vars": len(factors), "names": [f.name for f in factors], "bounds": [[0.0, 1.0]] * len(factors)}
    points = sample.sample(problem, trajectories, num_levels=GRID_LEVEL_COUNT, seed=seed)
    scales = [_value(factors, point, FRICTION_FACTOR, 1.0) for point in points]
    ladder = sorted(set(scales))
    tell(f"{len(ladder)} robots are identified", 0.0)
    robots = [scale_friction(rig.robot, scale) for scale in ladder]
    cards = dict(
        zip(ladder, ordered_results([(identify_cards, r) for r in robots], workers, executor=executor), strict=True)
    )
    jobs = [
        (_effects, rig, factors, point, cards[scale], people, movements, named, seed)
        for point, scale in zip(points, scales, strict=True)
    ]
    found = np.array(
        ordered_results(jobs, workers, lambda done, of: tell(f"{done} of {of} points", 0.1 + 0.9 * done / of), executor)
    )
    shape = (len(named), len(SCREENED_INDICES), len(factors))
    strength, half, direction, scatter = (np.full(shape, np.nan) for _ in range(4))
    complete = np.zeros(shape[:2], int)
    for i, j in np.ndindex(shape[:2]):
        ended = np.isfinite(found[:, i, j]).reshape(trajectories, -1).all(axis=1)
        complete[i, j] = ended.sum()
        if not ended.any():
            continue
        kept = np.repeat(ended, len(factors) + 1)
        told = analyze.analyze(problem, points[kept], found[kept, i, j], num_levels=GRID_LEVEL_COUNT, seed=seed)
        for into, name in ((strength, "mu_star"), (half, "mu_star_conf"), (direction, "mu"), (scatter, "sigma")):
            into[i, j] = told[name]
    return Sensitivity(
        factors, tuple(named), SCREENED_INDICES, strength, half, direction, scatter, complete, len(points)
    )


def _value(factors: Sequence[Factor], point: np.ndarray, name: str, otherwise: float) -> float:
    return next((f.at(u) for f, u in zip(factors, point, strict=True) if f.name == name), otherwise)


def _effects(
    rig: PointingRig,
    factors: Sequence[Factor],
    point: np.ndarray,
    cards: Cards,
    people: int,
    movements: int,
    controllers: Mapping[str, str],
    seed: int,
) -> np.ndarray:
    """100 ln(worn over control), shape (laws, indices), at one point of the grid; of people, movements and noise that
    are the same at every other but for chance."""
    set_to = {f.path: f.at(u) for f, u in zip(factors, point, strict=True) if f.path}
    set_to |= {f"{f.path}_spread": 0.0 for f in factors if f.spread}
    robot = scale_friction(rig.robot, _value(factors, point, FRICTION_FACTOR, 1.0))
    rig = replace(rig.changed(set_to, rig.name), robot=robot)
    k = (_value(factors, point, UPWARD_EXPONENT_FACTOR, -1.0), _value(factors, point, DOWNWARD_EXPONENT_FACTOR, -1.0))
    noise = round(_value(factors, point, CHANCE_FACTOR, 0.0))
    who = draw_people(rig, np.random.default_rng([seed, 0x9E]), count=people)
    keep = [INDICES.index(name) for name in SCREENED_INDICES]
    found = np.empty((1 + len(controllers), people, len(SCREENED_INDICES)))
    for j, person in enumerate(who):
        found[0, j] = simulate_indices(rig, person, CONTROL_CONDITION, None, movements, (seed, noise, j))[keep]
        for i, (condition, name) in enumerate(controllers.items(), 1):
            law = build_law(cards, name, k, rig, person)
            found[i, j] = simulate_indices(rig, person, condition, law, movements, (seed, noise, j, i))[keep]
    return 100.0 * np.mean(np.log(found[1:] / found[0]), axis=1)


def is_salib_installed() -> bool:
    """Whether the package that draws trajectories is there."""
    return find_spec("SALib") is not None


def _salib() -> tuple[ModuleType, ModuleType]:
    try:
        from SALib.analyze import morris as analyze
        from SALib.sample import morris as sample
    except ImportError:
        raise missing_package("sensitivity", "SALib", "sensitivity") from None
    return sample, analyze
