r"""One muscle, fully active, whose free end is moved: how well Hill's model on an elastic tendon tells its force.

The model rests where its fibre is at l_o and its tendon at its slack length; the recording's rest lies an unknown
offset from there, which is fitted on the recordings that may be fitted and on nothing else:

.. math::
   l_{mt}(t) = l_o\cos\varphi_o + l_{ts} + \Delta + x(t), \qquad
   e = \frac{100}{n F_{iso}} \sum_t |F(t) - \hat F(t)|
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ...._errors import IdentificationError, RecordingError
from ....files.fault import Fault
from ....files.recording import Recording
from ....models.estimates import Parameter, Verdict
from ....numerics.posterior.ensemble import require_sampler
from ....numerics.posterior.posterior import Posterior
from ....numerics.searches.scalar_search import minimise_on_interval
from ....study.answer import PAPER_STEP, Answer, AnswerNumber, Basis, Step
from ....study.procedures.posterior_beside import (
    pair_with_posterior,
    posterior_rows,
    posterior_table,
    posterior_verdicts,
)
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ...fit.muscle_posterior import ForceGrid, offset_interval, offset_posterior
from ...models.muscle import Muscle
from .isolated_muscle_table import IsolatedMuscleTable

SIMULATION_PERIOD_S = 1e-3
"""Sample period of the muscle's simulation."""

OFFSET_SEARCH_SHARE = 0.4
"""The offset is searched this far in both directions, as a share of the optimal fibre length."""

UNCERTAIN_CONSTANTS = (
    "max_isometric_force", "optimal_fibre_length", "tendon_slack_length", "max_velocity", "damping", "tendon_strain",
)  # fmt: skip
"""Constants of Hill's model that a posterior treats as uncertain."""

POSTERIOR_GRID_SIZE = 129
"""Number of offsets at which a posterior computes the force: 0.1 mm apart on a muscle of 17 mm."""

RELATIVE_DIFFERENCE_STEP = 1e-3
"""The force's derivative by a constant is a forward difference over this relative step."""


@dataclass(frozen=True, eq=False)
class MuscleTrial:
    """Force of one recording, measured and predicted."""

    name: str  # Name of the recording
    use: str  # ``"fit"`` or ``"validate"``
    amplitude: float  # Amplitude of the displacement [m]
    time: np.ndarray  # (n,) Times of the recording's samples [s]
    measured: np.ndarray  # (n,) Measured force [N]
    predicted: np.ndarray  # (n,) Predicted force [N]
    mae_percent: float  # Mean absolute error from ``score_from`` on, in percent of the isometric force


@dataclass(frozen=True, eq=False)
class IsolatedMuscleFit:
    """Result of `isolated_muscle`."""

    offset: float  # Rest length less l_o cos(phi_o) + l_ts [m]
    trials: tuple[MuscleTrial, ...]
    rigid_mae_percent: float  # Mean over all trials with a rigid tendon, its own offset fitted the same way
    # The same over the held-out trials alone; NaN without one
    rigid_heldout_percent: float = float("nan")
    interval: Parameter | None = None  # The offset's, and its posterior, if one is asked for
    posterior: Posterior | None = None

    @property
    def mae_percent(self) -> float:
        """Mean over all trials."""
        return float(np.mean([t.mae_percent for t in self.trials]))

    @property
    def heldout_percent(self) -> float:
        """Mean over the held-out trials alone; NaN without one."""
        held = [t.mae_percent for t in self.trials if t.use == "validate"]
        return float(np.mean(held)) if held else float("nan")

    def rows(self, study: Study) -> Iterator[ResultRow]:
        """Figures for results.json."""
        checksum = study.recordings()[0].checksum
        fitted = ", ".join(t.name for t in self.trials if t.use == "fit")

        def row(name: str, value: float, note: str, split: str = "heldout") -> ResultRow:
            return ResultRow(f"{study.name}.{name}", value, "%", "calibrate", split, checksum, note)

        note = f"mean over all amplitudes; offset {1e3 * self.offset:.2f} mm, fitted on {fitted} alone"
        yield row("mae_percent", self.mae_percent, note)
        for t in self.trials:
            split = "fitted" if t.use == "fit" else "heldout"
            yield row(f"{t.name}.mae_percent", t.mae_percent, f"amplitude {1e3 * t.amplitude:g} mm", split)
        for name, value in (("heldout", self.heldout_percent), ("rigid.heldout", self.rigid_heldout_percent)):
            if np.isfinite(value):
                yield row(f"{name}.mae_percent", value, "mean over the held-out amplitudes")
        yield row("rigid.mae_percent", self.rigid_mae_percent, "rigid tendon, with its own fitted offset")
        if self.posterior is not None:
            level = study.table(IsolatedMuscleTable).confidence
            plain = ResultRow("", None, "m", "calibrate", "fitted", checksum, self.posterior.settled)
            note = f"{self.interval.sentence(level)}; model constants assumed exact"
            yield replace(plain, id=f"{study.name}.offset", value=self.offset, note=note)
            compared = pair_with_posterior((self.interval,), self.posterior)
            yield from posterior_rows(study.name, compared, level, plain)


@dataclass(frozen=True, kw_only=True, repr=False)
class IsolatedMuscleResult(Result):
    """Result of `calibrate` for an isolated muscle."""

    fit: IsolatedMuscleFit = field(repr=False)
    interval: Parameter | None = None
    posterior: Posterior | None = None

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return isolated_answer(self.fit, self.study)


def isolated_answer(fit: IsolatedMuscleFit, study: str = "") -> Answer:
    """Return whether an elastic tendon predicts the force of held-out amplitudes better than a rigid one."""
    elastic, rigid = fit.heldout_percent, fit.rigid_heldout_percent
    held = sum(t.use == "validate" for t in fit.trials)
    question = "Does Hill's model predict this muscle's force better with an elastic tendon than with a rigid one?"
    basis = Basis(len(fit.trials), len(fit.trials), judged=f"{held} held-out amplitudes" if held else "")
    if not held:
        said = f"No amplitude is held out; the mean error is {fit.mae_percent:.2f} % of the isometric force."
        step = Step('Hold out some amplitudes (write `use = "validate"` in study.toml)')
        return Answer(question, "cannot say", said, "no amplitude is held out", basis=basis, next=(step,))
    errors = sorted(trial.mae_percent for trial in fit.trials if trial.use == "validate")
    ranged = f" ({errors[0]:.2f} to {errors[-1]:.2f} % by amplitude)" if held > 1 else ""
    said = (
        f"The mean error over {held} held-out amplitudes is {elastic:.2f} % of the isometric force{ranged}; with a "
        f"rigid tendon and its own fitted offset it is {rigid:.2f} %."
    )
    reason = "" if elastic < rigid else "the error with a rigid tendon is no larger"
    numbers = tuple(
        AnswerNumber(f"mean absolute error, {name} tendon", value, "%", id=f"{study}.{row}" if study else "")
        for name, value, row in (
            ("elastic", elastic, "heldout.mae_percent"), ("rigid", rigid, "rigid.heldout.mae_percent"),
        )
    )  # fmt: skip
    step = STRETCH_STEP if reason else PAPER_STEP
    return Answer(question, "no" if reason else "yes", said, reason, (), numbers, basis, next=(step,))


STRETCH_STEP = Step("Record larger amplitudes and higher forces: the stretch of the tendon shows there")
"""Next step where an elastic tendon predicts no better than a rigid one."""


def isolated_result(study: Study, tell: Progress = quiet) -> IsolatedMuscleResult:
    """Predict one muscle's force with a rigid and an elastic tendon; return tables, rows and verdicts."""
    fit = isolated_muscle(study)
    heads = ("Trial", "amplitude [mm]", "mean absolute error [% of F_iso]", "")
    shown = ((t.name, 1e3 * t.amplitude, t.mae_percent, "fitted" if t.use == "fit" else "held out") for t in fit.trials)
    summary = (
        f"Over all {len(fit.trials)} amplitudes, the fitted ones included, the mean error is {fit.mae_percent:.1f} %, "
        f"and {fit.rigid_mae_percent:.1f} % with a rigid tendon; the length's offset is {1e3 * fit.offset:.2f} mm."
    )
    level, tables, posterior_notes = study.table(IsolatedMuscleTable).confidence, [], []
    if fit.posterior is not None:
        compared = pair_with_posterior((fit.interval,), fit.posterior)
        title = "Posterior and least squares, which assumes exact model constants"
        tables = [ParameterTable("Length at rest", (fit.interval,)), posterior_table(title, compared, level)]
        posterior_notes = list(posterior_verdicts(compared, fit.posterior, level))
    return IsolatedMuscleResult(
        study=study.name,
        headline=isolated_answer(fit).sentence,
        tables=(FigureTable("Force over imposed length", heads, tuple(shown)), *tables),
        verdicts=(Verdict("note", summary), *posterior_notes),
        confidence=level,
        fit=fit,
        interval=fit.interval,
        posterior=fit.posterior,
        rows=tuple(fit.rows(study)),
        cards={},
        checksums={recording.name: recording.checksum for recording in study.recordings()},
    )


def faults(study: Study) -> list[Fault]:
    """Return no faults of its own: reading the recordings refuses a missing or too short force or displacement."""
    study.recordings()
    return []


def isolated_muscle(study: Study) -> IsolatedMuscleFit:
    """Fit the offset of an isolated muscle's length, and predict the force of every recording. `study`
    [isolated_muscle]."""
    table = study.table(IsolatedMuscleTable)
    if table.posterior:
        require_sampler()
    taken = [(recording, *_imposed(recording, study)) for recording in study.recordings()]
    fitted = [t for t in taken if t[0].use == "fit"]
    if not fitted:
        raise IdentificationError(f'{study.name}: found no recording with use = "fit", expected one for the offset')

    def error(offset: float, elastic: bool) -> float:
        return float(np.mean([_trial(t, study, offset, elastic).mae_percent for t in fitted]))

    offsets = [_search(error, table.optimal_fibre_length, elastic) for elastic in (True, False)]
    trials = tuple(_trial(t, study, offsets[0], True) for t in taken)
    stiff = [_trial(t, study, offsets[1], False) for t in taken]
    rigid = float(np.mean([t.mae_percent for t in stiff]))
    held = [t.mae_percent for t in stiff if t.use == "validate"]
    rigid_held = float(np.mean(held)) if held else float("nan")
    if not table.posterior:
        return IsolatedMuscleFit(offsets[0], trials, rigid, rigid_held)
    grid = force_grid(study, fitted)
    interval = offset_interval(grid, offsets[0])
    posterior = offset_posterior(grid, level=table.confidence)
    return IsolatedMuscleFit(offsets[0], trials, rigid, rigid_held, interval, posterior)


def force_grid(study: Study, fitted: list) -> ForceGrid:
    """Return the force of the `fitted` recordings at every offset, and its derivative by each uncertain constant."""
    table = study.table(IsolatedMuscleTable)
    offsets = OFFSET_SEARCH_SHARE * table.optimal_fibre_length * np.linspace(-1.0, 1.0, POSTERIOR_GRID_SIZE)
    scored = [_scored(t[0], table) for t in fitted]

    def forces(**changed: float) -> np.ndarray:
        return np.array([
            np.concatenate([_predicted(t, table, x, True, **changed)[s] for t, s in zip(fitted, scored, strict=True)])
            for x in offsets
        ])  # fmt: skip

    plain = forces()
    slopes = [
        (forces(**{name: (1.0 + RELATIVE_DIFFERENCE_STEP) * getattr(table, name)}) - plain) / RELATIVE_DIFFERENCE_STEP
        for name in UNCERTAIN_CONSTANTS
        if getattr(table, name) > 0.0
    ]
    measured = np.concatenate([t[0][table.force][s] for t, s in zip(fitted, scored, strict=True)])
    return ForceGrid(offsets, plain, np.stack(slopes, axis=2), measured, tuple(int(s.sum()) for s in scored))


def _imposed(recording: Recording, study: Study) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the simulation's times [s], the displacement at them [m], and its amplitude [m]."""
    table = study.table(IsolatedMuscleTable)
    amplitude = next(e.amplitude for e in study.config.recordings if e.name == recording.name)
    source = recording.stream_or_self(table.stream)
    bad = [cut for cut in source.cuts if cut.channel in (table.displacement, "time")]
    if bad:
        raise RecordingError(
            f"{source.path.name} (recording {recording.name}), channel {bad[0].channel}: found {bad[0].found} at "
            f"{bad[0].start:.6g} s, expected a displacement without gaps: the muscle is simulated over all of it"
        )
    if table.displacement not in source:
        raise IdentificationError(
            f"{recording.name}: found no channel {table.displacement}, expected the displacement of the free end"
        )
    unit, moved = source.channels[table.displacement].unit, source[table.displacement]
    largest = float(np.max(np.abs(moved)))
    if amplitude is None and unit != "m":
        raise IdentificationError(
            f"{recording.name}, channel {table.displacement}: found the unit {unit} and no amplitude, expected a "
            "length, or the amplitude of the displacement in [[recordings]]"
        )
    scale = 1.0 if amplitude is None or not largest else amplitude / largest
    time = np.arange(source.time[0], recording.time[-1] + SIMULATION_PERIOD_S, SIMULATION_PERIOD_S)
    return time, scale * np.interp(time, source.time, moved), largest if amplitude is None else amplitude


def _predicted(
    taken: tuple[Recording, np.ndarray, np.ndarray, float],
    table: IsolatedMuscleTable,
    offset: float,
    elastic: bool,
    **changed: float,
) -> np.ndarray:
    """Return the predicted force at the recording's samples, (n,) [N], with an `elastic` or a rigid tendon.

    `changed` replaces constants of the table. The length at rest stays that of the table's constants.
    """
    recording, time, displacement, _ = taken
    constants = {name: getattr(table, name) for name in ("pennation", *UNCERTAIN_CONSTANTS)} | changed
    muscle = Muscle(**constants if elastic else {**constants, "tendon_strain": None})
    rest = table.optimal_fibre_length * np.cos(table.pennation) + table.tendon_slack_length
    active = np.ones_like(time)
    active = muscle.activation(active, period=SIMULATION_PERIOD_S) if elastic else active
    force, _ = muscle.simulate(active, rest + offset + displacement, period=SIMULATION_PERIOD_S)
    return np.interp(recording.time, time, force)


def _scored(recording: Recording, table: IsolatedMuscleTable) -> np.ndarray:
    """Return which samples are scored, shape (n,)."""
    return (recording.time > table.score_from) & recording.sound


def _trial(
    taken: tuple[Recording, np.ndarray, np.ndarray, float], study: Study, offset: float, elastic: bool
) -> MuscleTrial:
    recording, amplitude = taken[0], taken[3]
    table = study.table(IsolatedMuscleTable)
    measured, predicted = recording[table.force], _predicted(taken, table, offset, elastic)
    scored = _scored(recording, table)
    error = 100.0 * float(np.mean(np.abs(predicted - measured)[scored])) / table.isometric_force
    return MuscleTrial(recording.name, recording.use, amplitude, recording.time, measured, predicted, error)


def _search(error, fibre_length: float, elastic: bool) -> float:
    """Return the offset of least `error` [m]: the best of a grid, then refined.

    The grid is necessary because a muscle has the same force on both sides of l_o.
    """
    grid = OFFSET_SEARCH_SHARE * fibre_length * np.linspace(-1.0, 1.0, 33)
    found = [error(offset, elastic) for offset in grid]
    best = int(np.argmin(found))
    around = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    return minimise_on_interval(lambda x: error(x, elastic), *around)
