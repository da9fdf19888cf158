"""Coverage of posteriors and of least-squares intervals with few data, and correctness of the sampler.

- The sampler: 80 truths are drawn from a prior, data from the equations of the likelihood itself, bound, neglected
  physics and unknown noise included, and each truth's rank among its posterior's draws is counted [1]_. Plant and model
  are the same here: this says that draws are the posterior's, and nothing of a machine.
- 24 drawn benches with the physics of `research/evidence/coverage.py` that no model has, recorded for 4 s, not 20,
  identified as their studies ask: inertia, gravity and the mean share of the load that is lost.
- 24 drawn muscles, recorded for a second each on one amplitude: where each was held. Its constants are off by 5 %
  (lengths) and 10 % (others) from those the model has, its force sinks by up to 10 % a second, which no model has.

- 12 simulated wearers of the knee orthosis, their strap fitted on one swing: six have the spring and damper that is
  identified, six a strap whose tangent doubles at 0.2 to 0.4 rad; the target is the tangent where it begins to pull.
  Orthosis, instruments and wearers are the rig's, with the friction and the errors that it has.

Beside each figure of the posterior stands the interval's of the same parameter. Seeds are not those that the likelihood
was written on (777 of benches, 5 of muscles, 777 to 781 of wearers); that of muscles was mended once after they were
seen, because two posteriors had not settled.

.. [1] S. Talts, M. Betancourt, D. Simpson, A. Vehtari, A. Gelman, "Validating Bayesian inference algorithms with
   simulation-based calibration", 2018.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.special import chdtrc

import pellucid as pl
from pellucid.emg.fit.muscle_posterior import ForceGrid, offset_interval, offset_posterior
from pellucid.emg.models.muscle import Muscle
from pellucid.models.estimates import Parameter
from pellucid.numerics.posterior.ensemble import drawn
from pellucid.numerics.posterior.posterior import DrawnParameter, LinearisedModel, MarginalLikelihood, Noise, Prior
from pellucid.orthosis.study.coupling.identify_coupling import identify_worn
from pellucid.study.results import ResultRow
from pellucid_lab.bench.rig import BenchRig
from pellucid_lab.knee.drawn import drawn_rig
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.processes import ordered_results
from pellucid_lab.study import record_in_memory, write_study
from research.benchmarks._size import sized

from .coverage import bench_targets, drawn_benches

TRUTH_COUNT = sized(80, smallest=2)
"""Number of drawn truths of the calibration."""

BENCH_COUNT = sized(24, smallest=1)
"""Number of drawn benches."""

MUSCLE_COUNT = sized(24, smallest=1)
"""Number of drawn isolated muscles."""

WEARER_COUNT = sized(12, smallest=1)
"""Number of simulated wearers of the knee."""

SEED = 20261122
"""Seed of every random draw."""

RECORDING_DURATION_S = 4.0
"""Duration of each recording of a bench, of which two are fitted [s]."""

CONFIDENCE_LEVEL = 0.95
"""Confidence level of the intervals whose coverage is counted."""

RANK_BIN_COUNT = 8
"""Number of bins of the histogram of ranks."""

MUSCLE_CONSTANTS = {
    "max_isometric_force": (30.0, 0.10),
    "optimal_fibre_length": (0.05, 0.05),
    "tendon_slack_length": (0.05, 0.05),
    "max_velocity": (8.0, 0.10),
    "damping": (0.1, 0.10),
    "tendon_strain": (0.05, 0.10),
}
"""Median of each constant of the drawn muscles, and the standard deviation of its logarithm."""

UNUSED_TRIALS = ("mvc", "torque", "brief", "swing_2")
"""Words in the names of those trials of a wearer that the identification of a strap does not need."""

STRAP_EFFECTS = ("slack", "mobility", "hardening", "relaxing_stiffness", "relaxation_time", "across", "along")
"""Constants of a strap that are 0 for a spring and a damper."""

Both = tuple[Parameter, DrawnParameter, float]
"""A parameter by least squares, by a posterior, and its target."""


def rows(
    truths: int = TRUTH_COUNT, benches: int = BENCH_COUNT, muscles: int = MUSCLE_COUNT, wearers: int = WEARER_COUNT
) -> Iterator[ResultRow]:
    """Every figure."""
    seeds = np.random.default_rng(SEED).integers(2**31, size=truths)
    yield from calibration_rows(ordered_results([(ranks, int(seed)) for seed in seeds]))
    jobs = [(bench, rig, i + 1) for i, rig in enumerate(drawn_benches(benches, SEED))]
    found = ordered_results(jobs)
    for name in ("inertia", "gravity", "load_friction"):
        said = f"{len(found)} drawn benches, recordings of {RECORDING_DURATION_S:g} s, the best of five families"
        yield from coverage_rows(f"bench.{name}", [one[name] for one in found if name in one], said)
    found = ordered_results([(muscle, SEED + i) for i in range(muscles)])
    yield from coverage_rows("muscle.offset", found, f"{len(found)} drawn muscles, constants and fatigue unmodelled")
    found = ordered_results([(strap, SEED + i, i % 2 == 1) for i in range(wearers)])
    for kind, some in (("as_modelled", found[::2]), ("hardening", found[1::2])):
        for name in ("stiffness", "damping"):
            pairs = [one[name] for one in some if name in one]
            if pairs:
                yield from coverage_rows(f"strap.{kind}.{name}", pairs, f"{len(some)} simulated wearers, one swing")


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"posterior.{name}", float(value), unit, "evidence", "simulated", None, note)


# --- the sampler ----------------------------------------------------------------------------------------------------


def ranks(seed: int) -> list[float]:
    """Shares of the draws below the truth: of two parameters, one of them bounded, of log v, and of log s."""
    rng = np.random.default_rng(seed)
    prior = Prior(np.array([0.0, -np.inf]), np.full(2, np.inf), np.zeros(2), np.ones(2))
    truth = np.array([abs(rng.standard_normal()), rng.standard_normal()])
    log_v, log_s = 0.5 * rng.standard_normal(), rng.uniform(np.log(0.01), 0.0)
    w, columns = rng.standard_normal((16, 2)), 2.0 * rng.standard_normal((16, 3))
    y = w @ truth + columns @ (np.exp(log_s) * rng.standard_normal(3)) + np.exp(0.5 * log_v) * rng.standard_normal(16)
    x = np.hstack([w, columns])
    left = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    noise = Noise(float(left @ left) / 11.0, 11.0)
    at = np.array([0.5, 0.0])
    straight = LinearisedModel(at, w, y - w @ at, columns, np.ones(3), np.zeros(3))
    likelihood: MarginalLikelihood = replace(straight.likelihood(prior, noise), scale_prior=(0.0, 0.5))
    found = drawn(likelihood, likelihood.start(at, np.eye(2)), seed=seed, most=1000)
    return [float(np.mean(found.values[:, i] < t)) for i, t in enumerate((*truth, log_v, log_s))]


def calibration_rows(found: Sequence[Sequence[float]]) -> Iterator[ResultRow]:
    """Yield the unevenness of ranks and the coverage of 95 % intervals of each quantity."""
    every = np.array(found)
    note = f"{len(every)} truths from the prior; plant and model share their equations"
    p_values = []
    for name, shares in zip(("bounded", "free", "noise", "neglected"), every.T, strict=True):
        counts = np.histogram(shares, RANK_BIN_COUNT, (0.0, 1.0))[0]
        statistic = float(np.sum((counts - len(every) / RANK_BIN_COUNT) ** 2) / (len(every) / RANK_BIN_COUNT))
        p_values.append(float(chdtrc(RANK_BIN_COUNT - 1, statistic)))
        yield _row(
            f"calibration.{name}.p_value",
            p_values[-1],
            "1",
            f"ranks are even (chi square, {RANK_BIN_COUNT} bins); {note}",
        )
        held = 100.0 * float(np.mean((shares > 0.025) & (shares < 0.975)))
        yield _row(f"calibration.{name}.held", held, "%", f"coverage of the true value by 95 % intervals; {note}")
    yield _row("calibration.lowest_p_value", min(p_values), "1", f"of four: 1 in 20 would be below 0.013; {note}")


# --- drawn benches --------------------------------------------------------------------------------------------------


def bench(rig: BenchRig, seed: int, seconds: float = RECORDING_DURATION_S) -> dict[str, Both]:
    """Parameters of a bench's best family by least squares and by a posterior, each with its target."""
    rig = rig.changed({"sampling.duration": seconds}, rig.name)
    with tempfile.TemporaryDirectory() as folder:
        study = write_study(Path(folder) / "study", rig, name=rig.name, seed=seed, threads=1)
        model = study.config.model.model_copy(update={"posterior": True})
        study = replace(study, config=study.config.model_copy(update={"model": model}))
        result = pl.identify(study, thorough=False)
    fitted, posterior = result.families[result.best].estimate, result.posterior
    return {n: (fitted[n], posterior[n], t) for n, t in bench_targets(rig).items() if n in posterior}


# --- drawn muscles --------------------------------------------------------------------------------------------------


def muscle(seed: int) -> Both:
    """Where a drawn muscle was held, by least squares, by a posterior, and in truth."""
    rng = np.random.default_rng([seed, 0x3])
    period, n = 1e-3, 1000
    time = period * np.arange(n)
    waves = 2.0 * np.pi * np.array([2.0, 3.1, 5.3])
    displacement = 1e-3 * np.sin(time[:, None] * waves + rng.uniform(0.0, 6.28, 3)).sum(axis=1)
    told = {name: value for name, (value, _) in MUSCLE_CONSTANTS.items()}
    true = {name: value * np.exp(share * rng.standard_normal()) for name, (value, share) in MUSCLE_CONSTANTS.items()}
    rest = told["optimal_fibre_length"] + told["tendon_slack_length"]
    offset = rng.uniform(-0.2, 0.2) * told["optimal_fibre_length"]
    active = Muscle(**told).activation(np.ones(n), period=period)
    scored = time > 0.2

    def force(at: float, constants: dict[str, float]) -> np.ndarray:
        return Muscle(**constants).simulate(active, rest + at + displacement, period=period)[0][scored]

    fatigue = 1.0 - rng.uniform(0.0, 0.1) * time[scored]
    noise = np.convolve(rng.standard_normal(n + 20), np.full(21, 1.0 / np.sqrt(21.0)), "valid")[scored]
    measured = fatigue * force(offset, true) + 0.01 * told["max_isometric_force"] * noise
    offsets = 0.4 * told["optimal_fibre_length"] * np.linspace(-1.0, 1.0, 65)
    plain = np.array([force(x, told) for x in offsets])
    slopes = [
        (np.array([force(x, {**told, name: 1.001 * value}) for x in offsets]) - plain) / 1e-3
        for name, value in told.items()
    ]
    grid = ForceGrid(offsets, plain, np.stack(slopes, axis=2), measured, (int(scored.sum()),))
    return offset_interval(grid, grid.best), offset_posterior(grid)["offset"], offset


# --- drawn straps ---------------------------------------------------------------------------------------------------


def strap(seed: int, hardens: bool) -> dict[str, Both]:
    """Return least-squares and posterior estimates and true values of stiffness and damping of a simulated wearer's
    strap.

    The result is empty if either method fails.
    """
    rig = drawn_rig(knee_orthosis(), seed)
    [(who, subject)] = rig["subjects"].items()
    own = {name: subject["strap"][name] for name in ("stiffness", "damping")} | dict.fromkeys(STRAP_EFFECTS, 0.0)
    if hardens:
        own["hardening"] = float(np.random.default_rng([seed, 0x6]).uniform(0.2, 0.4))
    rig = rig.changed({f"subjects.{who}.strap": own}, rig.name)
    made = [t for t in rig.trials(1) if not any(word in t.name for word in UNUSED_TRIALS)]
    config, recordings, _ = record_in_memory(rig, made, seed=1)
    config = config.model_copy(update={"coupling": config.coupling.model_copy(update={"posterior": True})})
    found = identify_worn(config, recordings).wearers[who].coupling
    fitted = {p.name: p for p in found.orthosis_side.parameters}
    names = ("stiffness", "damping") if found.posterior is not None else ()
    return {name: (fitted[name], found.posterior[name], own[name]) for name in names}


# --- coverage -------------------------------------------------------------------------------------------------------


def coverage_rows(name: str, found: Sequence[Both], said: str) -> Iterator[ResultRow]:
    """How often either holds its target, how wide it is over its error, and what the posterior does where the interval
    is refused. Errors and widths over the target's typical size."""
    size = float(np.sqrt(np.mean([t**2 for _, _, t in found])))
    read = [(p, d, t) for p, d, t in found if p.trusted]
    refused = [(p, d, t) for p, d, t in found if not p.trusted]
    settled = [(d, t) for _, d, t in found if d.trusted]
    yield _row(f"{name}.interval.held", _held([(p, t) for p, _, t in read]), "%", f"of those not refused; {said}")
    yield _row(f"{name}.held", _held(settled), "%", f"95 % posteriors that hold the target; {said}")
    both = [(d, t) for p, d, t in read if d.trusted]
    yield _row(f"{name}.held_where_interval_read", _held(both), "%", f"posteriors of the same ones; {said}")
    for key, pairs in (("interval.", [(p, t) for p, _, t in read]), ("", settled)):
        error = float(np.sqrt(np.mean([(p.value - t) ** 2 for p, t in pairs])))
        half = float(np.median([0.5 * np.ptp(p.interval(CONFIDENCE_LEVEL)) for p, _ in pairs]))
        yield _row(f"{name}.{key}rmse", 100.0 * error / size, "%", f"of the value, over the targets' size; {said}")
        yield _row(f"{name}.{key}width_over_rmse", half / error, "1", f"median half-width; {said}")
    yield _row(f"{name}.interval.refused", 100.0 * len(refused) / len(found), "%", f"intervals refused; {said}")
    share = 100.0 * (1.0 - len(settled) / len(found))
    yield _row(f"{name}.refused", share, "%", f"posteriors refused because they have not settled; {said}")
    prior = 100.0 * float(np.mean([d.told_by_prior for _, d, _ in found]))
    yield _row(f"{name}.told_by_prior", prior, "%", f"posteriors half as wide as the prior, or wider; {said}")
    where = [(d, t) for _, d, t in refused if d.trusted]
    if where:
        yield _row(f"{name}.held_where_interval_refused", _held(where), "%", f"{len(where)} posteriors; {said}")


def _held(pairs: Sequence[tuple[Parameter, float]]) -> float:
    inside = [low <= t <= high for (low, high), t in ((p.interval(CONFIDENCE_LEVEL), t) for p, t in pairs)]
    return 100.0 * float(np.mean(inside)) if inside else float("nan")
