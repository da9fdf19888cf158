"""One method's estimate of one friction family: parameters with intervals, what it predicts, and its model card."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.card import ModelCard
from ...models.joint import UNITS, JointModel
from ...signals.motion import Filtering, motion_of
from ...signals.sampled import sampled
from ..discrepancy import Discrepancy, States, discrepancy_of, states_of
from ..estimates import Estimates
from ..parameter import Whiteness
from ..regression import Solution, Stack, parameters_of, predicted
from ..uncertainty import block_bootstrap, correlation_time, sandwich, whiteness

SEED = 20261121  # of the bootstrap


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class JointEstimate(Estimates):
    """An identified joint.

    Attributes
    ----------
    model : JointModel
        Of one friction family; its names are the parameters'.
    method : str
        "ls" (ordinary, on filtered data: the reference), "wls", "irls", "iv", "didim", "output_error".
    condition_number : float
        Of the regressor with columns as they are (the literature's figure).
    scaled_condition_number : float
        Of the regressor with columns scaled to unit norm: what collinearity is left.
    residual_sd : float
        In the effort's unit.
    samples : int
        Rows of the regression.
    filtering : Filtering
        What was done to both sides.
    effort_error : float
        100 ||effort - model|| / ||effort|| over the samples that were fitted [%].
    iterations : int
    converged : bool
    whiteness : Whiteness or None
        Of the residuals.
    discrepancy : Discrepancy or None
        What of the covariance stands for what the model leaves out.
    notes : tuple of str
        What the method has to say (active bounds, samples left out, weights).
    """

    model: JointModel
    method: str
    condition_number: float
    scaled_condition_number: float
    residual_sd: float
    samples: int
    filtering: Filtering | None = None
    effort_error: float = float("nan")
    iterations: int = 1
    converged: bool = True
    whiteness: Whiteness | None = None
    discrepancy: Discrepancy | None = None
    notes: tuple[str, ...] = ()

    @property
    def statistical(self) -> np.ndarray:
        """What of the covariance coloured residuals alone make, shape (p, p), SI."""
        if self.discrepancy is None:
            return self.covariance
        return self.covariance - self.discrepancy.of(self.model.names)[0]

    def predict(self, time: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Effort that a motion takes, filtered as the fitted effort was.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Evenly sampled [s].
        position : ndarray, shape (n,) or (n, 1)
            [rad or m].

        Returns
        -------
        ndarray, shape (n,)
            In the model's effort unit.

        Raises
        ------
        RecordingError
            If the arrays do not fit together, a number is missing, or there are too few for the filter.
        """
        time, position = sampled("predict", time, position=position)
        motion = motion_of(time, position, np.zeros(len(time)), self.filtering)
        return predicted(self.model, self.array, [motion])[0]

    def card(self, name: str = "joint", lifts: str = "") -> ModelCard:
        """The model card that `pellucid export` and `pellucid.controller` take.

        Parameters
        ----------
        name : str
            Stands on the card where a study's name would.
        lifts : str
            What positive motion does, in words.

        Returns
        -------
        ModelCard
        """
        from importlib.metadata import version

        return ModelCard(
            study=name,
            family=self.model.family,
            method=self.method,
            motion=self.model.motion,
            effort_unit=self.model.effort_unit,
            lifts=lifts,
            parameters=tuple(p.on_card(self.confidence) for p in self.parameters),
            covariance=tuple(map(tuple, self.covariance.tolist())),
            statistical=tuple(map(tuple, self.statistical.tolist())),
            known=dict(self.model.known),
            velocity_range=float(self.model.velocity_range),
            drive={"gain": 1.0, "back_emf": 0.0},
            heldout_effort_error=None,
            processing=self.filtering.sentence(UNITS[self.model.motion]["velocity"]),
            confidence=self.confidence,
            checksums={},
            pellucid=version("pellucid"),
        )

    def _facts(self) -> tuple[str, ...]:
        unit = self.model.effort_unit
        colour = "" if self.whiteness is None else f"; lag-1 autocorrelation {self.whiteness.lag1:.2f}"
        return (
            f"residual {self.residual_sd:.3g} {unit} (SD) over {self.samples} samples{colour}",
            *self.notes,
        )


def joint_states(model: JointModel, data: Stack, values: np.ndarray) -> States:
    """Where a joint is in the rows of a stack, its load that of a `model` with `values`, (p,)."""
    bare = model.vector(values)
    return states_of(
        data,
        model.motion == "rotary",
        lambda m, q, a: _core.load(model.loaded(bare, *m.payload), q.copy(), a.copy()),
        data.motions[0].filtering.dead_band,
    )


def estimated(
    model: JointModel,
    data: Stack,
    found: Solution,
    method: str,
    notes: tuple[str, ...] = (),
    *,
    instruments: np.ndarray | None = None,
    lengths: Sequence[int] | None = None,
    level: float = 0.95,
    discrepancy: Discrepancy | None = None,
) -> JointEstimate:
    """Covariance, intervals at `level` and diagnostics of what a `method` `found` for a `model` on `data`, with its
    `notes`; `instruments`, (m, p), of an instrumental-variable estimate; `lengths` of stretches, if not the stack's;
    `discrepancy` of least squares, whose own is estimated here."""
    lengths = data.lengths if lengths is None else lengths
    size = np.linalg.norm(data.target)
    if not size > 0.0:
        raise IdentificationError("found an effort of 0 in every row, expected one that changes as the joint moves")
    w, rho = found.jacobian * found.weights[:, None], found.residual * found.weights
    norms = np.linalg.norm(found.jacobian, axis=0)
    # A Stribeck velocity without a Stribeck level has no effect at all: no interval can be given.
    idle = norms <= 1e-12 * norms.max()
    free = ~idle
    # Values on a bound stay in: the others' intervals must not take them for known.
    memory = correlation_time(rho, lengths)
    statistical = sandwich(w, rho, lengths, instruments, free, memory)
    if discrepancy is None:
        states = joint_states(model, data, found.values)
        discrepancy = discrepancy_of(model.names, found.values, found.jacobian, found.residual, states, statistical)
    beside, causes = discrepancy.of(model.names)
    covariance = statistical + beside
    held = np.flatnonzero(found.at_bound)
    boot = None
    if method == "ls":
        boot = np.full((len(free), 2), np.nan)
        boot[free] = block_bootstrap(
            w[:, free], rho, found.values[free], lengths, rng=np.random.default_rng(SEED), level=level, memory=memory
        )
    names = model.names
    notes = notes + tuple(
        f"{names[i]} is held at its physical bound, {found.values[i]:.3g} {model.unit(names[i])}"
        for i in held
        if not any(note.startswith(names[i]) for note in notes)
    )
    plain = parameters_of(
        names, [model.unit(n) for n in names], found.values, covariance, found.at_bound, idle, statistical, causes
    )
    parameters = tuple(
        replace(
            p,
            influence=float(norms[i] / size),
            carried=discrepancy.carried.get(p.name),
            bootstrap=None if boot is None or not free[i] else (float(boot[i, 0]), float(boot[i, 1])),
        )
        for i, p in enumerate(plain)
    )
    shown = np.linalg.qr(found.jacobian[:, ~idle], mode="r")
    return JointEstimate(
        title=f"Joint with {model.family} friction",
        confidence=level,
        model=model,
        method=method,
        parameters=parameters,
        covariance=covariance,
        condition_number=float(np.linalg.cond(shown)),
        scaled_condition_number=float(np.linalg.cond(shown / norms[~idle])),
        residual_sd=float(np.sqrt(np.sum(found.residual**2) / max(len(rho) - len(names), 1))),
        samples=len(rho),
        filtering=data.motions[0].filtering,
        effort_error=float(100.0 * np.linalg.norm(found.residual) / size),
        iterations=found.iterations,
        converged=found.converged,
        whiteness=whiteness(found.residual, lengths),
        discrepancy=discrepancy,
        notes=notes,
    )
