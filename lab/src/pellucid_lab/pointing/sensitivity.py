r"""Sensitivity of a prediction to people, robot and law: elementary effects by Morris's method [1]_.

A trajectory begins at a random point of a grid, and one factor after another takes a step. The change of a law's
effect, over the size of the step, is the factor's elementary effect at that point. The mean size of elementary effects
over trajectories, :math:`\mu^*`, measures the importance of a factor [2]_; their standard deviation, :math:`\sigma`,
measures interactions with other factors and nonlinearity. A trajectory needs one run more than there are factors;
Sobol's decomposition of variance would need some hundred times as many. One factor is chance: the seed of all noise. A
factor whose :math:`\mu^*` does not exceed that of chance has no visible effect.

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

from pellucid._errors import missing_package

from ..processes import ordered_results
from .conditions import EXPONENT_CANDIDATES, Cards, identify_cards
from .people import draw_people
from .predicted_indices import PREDICTED_INDICES
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
"""Number of levels of each factor on the grid; a robot is identified for each level of friction."""

MIDDLE_80_PERCENT_Z = 1.2816
"""Normal quantile z for which the interval of plus and minus z standard deviations contains 80 % of people."""

CHANCE_FACTOR = "chance"
"""Name of the factor that changes nothing but the seed of all noise."""

FRICTION_FACTOR = "friction"
"""Name of the factor that multiplies the robot's friction."""

UPWARD_EXPONENT_FACTOR = "k upwards"
"""Name of the factor that is the exponent of equation 8 for upward movements."""

DOWNWARD_EXPONENT_FACTOR = "k downwards"
"""Name of the factor that is the exponent of equation 8 for downward movements."""

SCREENED_INDICES = tuple(index.name for index in PREDICTED_INDICES if index.is_screened)
"""Indices of `INDICES` that are screened.

The mean duration is not among them: where movements are cut off, it would depend on the time of the cut."""

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
"""Factors of people: name, and dotted path of the constant in a rig's file.

Each model of people has some of these constants."""


@dataclass(frozen=True)
class Factor:
    """A factor of the screening and its range."""

    name: str
    low: float  # lower end of the range, in the unit of the rig's file
    high: float  # upper end of the range, in the unit of the rig's file
    path: str = ""  # dotted path of the constant in the rig's file; "" for a factor that is no constant
    spread: bool = False  # whether people differ in it by the file; during the screening they do not
    logarithmic: bool = False  # whether levels are spaced evenly in the logarithm

    def at(self, level: float) -> float:
        """Return the factor's value at a level from 0 to 1."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** level)
        return float(self.low + level * (self.high - self.low))


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Elementary effects of each factor on each effect, 100 ln(worn / control), over the factor's whole range."""

    factors: tuple[Factor, ...]
    laws: tuple[str, ...]
    indices: tuple[str, ...]
    strength: np.ndarray  # (laws, indices, factors) mean size of elementary effects, mu*
    half_width: np.ndarray  # (laws, indices, factors) half width of its 95 % interval, bootstrapped over trajectories
    direction: np.ndarray  # (laws, indices, factors) mean of elementary effects, mu
    scatter: np.ndarray  # (laws, indices, factors) standard deviation of elementary effects, sigma
    complete: np.ndarray  # (laws, indices) number of trajectories with movements that ended at every point
    runs: int  # number of simulated points

    def strengths_of(self, law: str, index: str) -> dict[str, float]:
        """Return mu* by factor, largest first."""
        found = self.strength[self.laws.index(law), self.indices.index(index)]
        return {self.factors[i].name: float(found[i]) for i in np.argsort(-found)}


def list_factors(rig: PointingRig, friction: tuple[float, float] = FRICTION_SCALE_RANGE) -> tuple[Factor, ...]:
    """Return the factors of a rig: constants of its people, friction of the robot, exponents of equation 8, and chance.

    The range of a constant contains 80 % of people; where people do not differ, it is from half to double.
    """
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
    """Return the elementary effects of factors on the effect of each law.

    Parameters
    ----------
    rig : PointingRig
    trajectories : int
        Number of trajectories; the runs of each are the number of factors plus one.
    people : int
        Number of people in each run.
    movements : int
        Number of movements of a person in each condition; even.
    controllers : mapping, optional
        Names of controllers by the name of their condition; by default `PUBLISHED_CONTROLLERS`.
    factors : sequence of Factor, optional
        Factors, by default those of `list_factors`.
    seed : int
        Seed of every random draw.
    workers : int, optional
        Number of processes; by default one for each processor.
    executor : concurrent.futures.Executor, optional
        Executor that runs the jobs instead of these processes.
    on_progress : callable, optional
        Function that is called with a text and the share of the work that is done, 0 to 1.

    Returns
    -------
    Sensitivity

    Raises
    ------
    PellucidError
        If SALib is not installed.
    """
    sample, analyze = _salib()
    tell = on_progress or (lambda text, share: None)
    factors = tuple(factors or list_factors(rig))
    controllers = dict(controllers or PUBLISHED_CONTROLLERS)
    problem = {"num_vars": len(factors), "names": [f.name for f in factors], "bounds": [[0.0, 1.0]] * len(factors)}
    points = sample.sample(problem, trajectories, num_levels=GRID_LEVEL_COUNT, seed=seed)
    scales = [_value(factors, point, FRICTION_FACTOR, 1.0) for point in points]
    friction_scales = sorted(set(scales))
    tell(f"{len(friction_scales)} robots are identified", 0.0)
    robots = [scale_friction(rig.robot, scale) for scale in friction_scales]
    cards = dict(
        zip(
            friction_scales,
            ordered_results([(identify_cards, r) for r in robots], workers, executor=executor),
            strict=True,
        )
    )
    jobs = [
        (_effects, rig, factors, point, cards[scale], people, movements, controllers, seed)
        for point, scale in zip(points, scales, strict=True)
    ]
    found = np.array(
        ordered_results(jobs, workers, lambda done, of: tell(f"{done} of {of} points", 0.1 + 0.9 * done / of), executor)
    )
    shape = (len(controllers), len(SCREENED_INDICES), len(factors))
    strength, half, direction, scatter = (np.full(shape, np.nan) for _ in range(4))
    complete = np.zeros(shape[:2], int)
    for i, j in np.ndindex(shape[:2]):
        ended = np.isfinite(found[:, i, j]).reshape(trajectories, -1).all(axis=1)
        complete[i, j] = ended.sum()
        if not ended.any():
            continue
        kept = np.repeat(ended, len(factors) + 1)
        effects = analyze.analyze(problem, points[kept], found[kept, i, j], num_levels=GRID_LEVEL_COUNT, seed=seed)
        for into, name in ((strength, "mu_star"), (half, "mu_star_conf"), (direction, "mu"), (scatter, "sigma")):
            into[i, j] = effects[name]
    return Sensitivity(
        factors, tuple(controllers), SCREENED_INDICES, strength, half, direction, scatter, complete, len(points)
    )


def _value(factors: Sequence[Factor], point: np.ndarray, name: str, otherwise: float) -> float:
    """Return the value of a factor at a point of the grid, or `otherwise` if there is no factor of that name."""
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
    """Return 100 ln(worn / control) at one point of the grid, shape (laws, indices).

    People, movements and noise are the same at every point, except that the factor of chance changes the noise.
    """
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
    """Return whether SALib, which draws trajectories, is installed."""
    return find_spec("SALib") is not None


def _salib() -> tuple[ModuleType, ModuleType]:
    """Return SALib's modules that draw and analyse trajectories; raise a PellucidError if SALib is not installed."""
    try:
        from SALib.analyze import morris as analyze
        from SALib.sample import morris as sample
    except ImportError:
        raise missing_package("sensitivity", "SALib", "sensitivity") from None
    return sample, analyze
