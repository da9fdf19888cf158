"""Where an isolated muscle was held, as draws: its rest length beside constants of the model that may be wrong.

The force along a recording is computed on a grid of offsets of the length, with its derivative by the logarithm of each
constant: what a constant off by so much would make is physics that the model lacks, as in ``marginal_likelihood``. A
muscle has the same force on both sides of its optimal length: walkers begin wherever the grid says that it may be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..parameter import Parameter
from ..uncertainty import sandwich
from .ensemble import drawn
from .marginal_likelihood import MarginalLikelihood, Noise, Prior
from .posterior import Posterior, summary

WRONG = 0.3
"""Share by which every constant may be off, at one standard deviation, where s is 1."""

UNIT = "m"
NAME = "offset"


@dataclass(frozen=True, eq=False)
class ForceGrid:
    """Force of a muscle at every offset of a grid, where it is judged."""

    offsets: np.ndarray  # (g,) Ascending [m]
    forces: np.ndarray  # (g, m) [N]
    slopes: np.ndarray  # (g, m, c) By the logarithm of each constant [N]
    measured: np.ndarray  # (m,) [N]
    lengths: tuple[int, ...]  # Samples of each recording

    def slope(self, offset: float) -> np.ndarray:
        """Of the force by the offset there, (m,) [N/m]."""
        i = int(np.clip(np.searchsorted(self.offsets, offset), 1, len(self.offsets) - 1))
        return (self.forces[i] - self.forces[i - 1]) / (self.offsets[i] - self.offsets[i - 1])

    def residual(self, offset: float) -> np.ndarray:
        """Measured less modelled force, (m,) [N], straight between the grid's offsets."""
        i = int(np.clip(np.searchsorted(self.offsets, offset), 1, len(self.offsets) - 1))
        share = (offset - self.offsets[i - 1]) / (self.offsets[i] - self.offsets[i - 1])
        return self.measured - (1.0 - share) * self.forces[i - 1] - share * self.forces[i]

    @property
    def best(self) -> float:
        """The offset of least squares, among the grid's."""
        return float(self.offsets[np.argmin(np.sum((self.measured - self.forces) ** 2, axis=1))])


def offset_interval(grid: ForceGrid, offset: float) -> Parameter:
    """An offset with its interval, as least squares about it has it: coloured residuals, constants taken for known."""
    covariance = sandwich(grid.slope(offset)[:, None], grid.residual(offset), grid.lengths)
    return Parameter(NAME, UNIT, offset, float(np.sqrt(covariance[0, 0])))


def offset_likelihood(grid: ForceGrid) -> MarginalLikelihood:
    """Of the offset, the model's constants being wrong by any share."""
    left = (grid.measured - grid.forces)[:, :, None]
    both = np.concatenate([left, WRONG * grid.slopes], axis=2)
    products = np.einsum("gmi,gmj->gij", both, both)
    across = np.einsum("gmi,gmj->gij", both[:-1], both[1:])
    across = across + np.swapaxes(across, 1, 2)
    step = grid.offsets[1] - grid.offsets[0]

    def misfit(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        # What is straight between two offsets has products that are not, and may not be taken for straight: v would
        # fall to nothing where a part of them is less than the whole allows.
        place = np.clip((values[:, 0] - grid.offsets[0]) / step, 0.0, len(grid.offsets) - 1.0)
        low = np.minimum(place.astype(int), len(grid.offsets) - 2)
        share = (place - low)[:, None, None]
        rest = 1.0 - share
        found = rest**2 * products[low] + rest * share * across[low] + share**2 * products[low + 1]
        return found[:, 0, 0], found[:, 1:, 0], found[:, 1:, 1:]

    at = int(np.argmin(products[:, 0, 0]))
    # The least that any offset and constants leave, wherever that is.
    solved = [x[0, 0] - x[0, 1:] @ np.linalg.lstsq(x[1:, 1:], x[1:, 0], rcond=None)[0] for x in products]
    least = float(min(solved))
    noise = Noise.of(grid.slope(grid.best)[:, None], left[at, :, 0], list(grid.lengths))
    # Of what the residual is, misfit of the constants is no noise.
    noise = Noise(noise.variance * min(1.0, least / products[at, 0, 0]), noise.freedom)
    half = 0.5 * (grid.offsets[-1] - grid.offsets[0])
    prior = Prior(grid.offsets[:1], grid.offsets[-1:], np.zeros(1), np.array([half]))
    count = grid.slopes.shape[2]
    return MarginalLikelihood(misfit, prior, noise, least, 1 + count, np.ones(count), np.zeros(count))


def offset_posterior(grid: ForceGrid, *, level: float = 0.95, **sampling) -> Posterior:
    """Draws of the offset; `sampling` is what `drawn` takes."""
    likelihood = offset_likelihood(grid)
    log_v = np.log(likelihood.noise.variance)
    known = np.column_stack([grid.offsets, np.full(len(grid.offsets), log_v), np.full(len(grid.offsets), np.log(0.1))])
    logs = likelihood(known)
    shares = np.exp(logs - logs.max())
    step = grid.offsets[1] - grid.offsets[0]

    def begin(rng: np.random.Generator, walkers: int) -> np.ndarray:
        offsets = rng.choice(grid.offsets, walkers, p=shares / shares.sum()) + step * rng.uniform(-0.5, 0.5, walkers)
        inside = np.clip(offsets, grid.offsets[0] + 1e-6 * step, grid.offsets[-1] - 1e-6 * step)
        return np.column_stack(
            [inside, log_v + 0.3 * rng.standard_normal(walkers), np.log(0.1) + 0.3 * rng.standard_normal(walkers)]
        )

    return summary([NAME], [UNIT], drawn(likelihood, begin, **sampling), likelihood.prior, level=level)
