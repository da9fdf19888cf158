"""Identify one wearer's coupling to the orthosis from either body's balance and as published; evaluate on held-out
swings.

Arrays in, values out: recorded and simulated swings take the same path.

Every decision about one wearer's strap is made once (`StrapDecision`), so that no two verdicts can contradict each
other. Every verdict reads this object. A prediction is called good only if a strap model is accepted and none of its
parameters is rejected. A statement that two estimates agree always shows the compared numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import Parameter, Verdict
from ...numerics.posterior.posterior import Posterior
from ..transfer.fit_transfer_function import fit_percent
from .coupled_impedance import (
    CouplingFit,
    Instrument,
    PublishedCoupling,
    align,
    clock_shift,
    fit_coupling,
    fit_two_poles,
    limb_angle,
    mismatch,
    published_mismatch,
    seen_mismatch,
    solve_balance,
    torque_mismatch,
)
from .identified_strap import IdentifiedStrap, identify_strap
from .strap_model import (
    KELVIN_VOIGT,
    Limb,
    Orthosis,
    Slip,
    StrappedSwing,
    find_slip,
    from_limb,
    from_orthosis,
    regression_residual,
)
from .strap_posterior import strap_posterior

MIN_CEILING_SHARE = 0.8
"""A strap predicts well if it reaches this share of the fit that the IMU's error allows."""


@dataclass(frozen=True)
class StrapDecision:
    """Decisions about one strap."""

    holds: bool  # whether no neglected effect improves the model's prediction; a spring and damper alone count as held
    rejected: tuple[Parameter, ...]  # parameters of the spring and damper that were stopped at zero
    predicts: bool  # whether swings that were not fitted are predicted about as well as the IMU's error allows
    has_inertia: bool  # whether the spring and the damper seem to have an inertia
    sides_agree: bool | None  # whether spring and damper are alike from both bodies; None without the limb's

    @property
    def is_good(self) -> bool:
        """Whether the strap may be trusted: it holds, nothing of it is rejected, and it predicts."""
        return self.holds and not self.rejected and self.predicts


def decide_strap(
    fit: CouplingFit, other: CouplingFit | None, strap: IdentifiedStrap | None, *, reached: float, ceiling: float
) -> StrapDecision:
    """Decide what is held of a strap.

    `fit` and `other` are the spring and damper by the orthosis's and by the limb's balance. Of the mismatch in swings
    that were not fitted, `reached` is explained, and the IMU's error allows `ceiling` [%]; NaN where that is unknown.
    """
    low, high = fit.inertia.interval()
    agree = None
    if other is not None:
        apart = abs(other.stiffness.value - fit.stiffness.value)
        agree = bool(apart <= 1.96 * np.hypot(other.stiffness.standard_error, fit.stiffness.standard_error))
    return StrapDecision(
        holds=strap is None or strap.fits,
        rejected=tuple(p for p in (fit.stiffness, fit.damping) if p.at_bound),
        predicts=bool(reached > MIN_CEILING_SHARE * (ceiling if np.isfinite(ceiling) else 100.0)),
        has_inertia=not low <= 0.0 <= high,
        sides_agree=agree,
    )


SWING_EDGE_S = 1.0
"""Models are not evaluated for this time at either end of a swing, where the unknown initial state acts [s]."""

MODEL_NAMES = ("orthosis", "kelvin_voigt", "limb", "published")
"""Models that are evaluated: the chosen strap and a spring and damper alone, both by the orthosis's balance; a spring
and damper by the limb's balance; and the thesis's two poles."""


@dataclass(frozen=True, eq=False)
class EvaluatedSwing:
    """A swing with the measured mismatch and the models' predictions."""

    recording: str
    split: str  # ``"fitted"`` or ``"heldout"``
    time: np.ndarray  # (m,) times of the IMU within the trial, on the actuator's clock [s]
    seen: np.ndarray  # (m,) mismatch measured by the IMU [rad]
    simulated: Mapping[str, np.ndarray]  # predicted mismatch by model, as in `MODEL_NAMES`, each (m,) [rad]
    fit: Mapping[str, float]  # goodness of fit by model, normalised as MATLAB's ``compare`` does [%]
    # fit that a perfect model would reach, given the IMU's error [%]; NaN where that error is unknown
    ceiling: float
    instrument: Instrument  # clock and mounting of the IMU in this trial
    # (n,) mismatch predicted from the orthosis's balance, at the actuator's times [rad]
    predicted: np.ndarray = field(repr=False)
    published: np.ndarray | None = field(default=None, repr=False)  # (n,) mismatch by the thesis's two poles [rad]
    position: np.ndarray | None = field(default=None, repr=False)  # (m,) angle of the orthosis from hanging [rad]

    @property
    def rmse(self) -> float:
        """RMS error of the model by the orthosis's balance against the IMU [rad]."""
        return float(np.sqrt(np.mean((self.seen - self.simulated["orthosis"]) ** 2)))


@dataclass(frozen=True, eq=False)
class WearerCoupling:
    """The identified coupling of one wearer to the orthosis."""

    participant: str
    orthosis_side: CouplingFit  # spring and damper by the orthosis's balance
    limb_side: CouplingFit | None  # spring and damper by the limb's balance; None without the muscles' torque
    # published estimates: ``"balance"``, least squares of equation 2.2, and ``"two_poles"``, equation 2.7
    published: Mapping[str, PublishedCoupling]
    evaluated: tuple[EvaluatedSwing, ...]
    slips: tuple[Slip, ...]  # slips of the strap; these trials were not fitted
    verdicts: tuple[Verdict, ...]
    posterior: Posterior | None = None  # posterior of the strap by the orthosis's balance, if asked for
    no_posterior: str = ""  # reason why there is no posterior although it was asked for
    strap: IdentifiedStrap | None = None  # strap by the chosen model; None where no model could be fitted
    held: tuple[str, ...] = ()  # names of the trials with held torques that were used

    def parameter(self, name: str) -> Parameter:
        """Return a parameter of the chosen strap model, or of the spring and damper where there is no model."""
        of = self.orthosis_side if self.strap is None or name == "inertia" else self.strap
        return getattr(of, name)

    @property
    def core(self) -> np.ndarray:
        """The core's parameters of the chosen strap model, (p,); of the spring and damper where there is none or where
        it rubs or pulls through tissue, which the core's parameters leave out."""
        if self.strap is None or not self.strap.model.in_core:
            return self.plain
        return self.strap.model.core(self.strap.fit.values)

    @property
    def plain(self) -> np.ndarray:
        """The core's parameters of the spring and damper that fit the swings best, shape (p,)."""
        of = self.orthosis_side
        return KELVIN_VOIGT.core({"stiffness": of.stiffness.value, "damping": of.damping.value})

    @property
    def decision(self) -> StrapDecision:
        """What is held of the strap, which every verdict reads."""
        reached, ceiling = self.mean_fit(), self.mean_ceiling()
        return decide_strap(self.orthosis_side, self.limb_side, self.strap, reached=reached, ceiling=ceiling)

    def mean_fit(self, model: str = "orthosis", split: str = "heldout") -> float:
        """Return the mean fit of a `model` over the trials of a `split` [%]; NaN where there are none."""
        found = [j.fit[model] for j in self.evaluated if j.split == split and model in j.fit]
        return float(np.mean(found)) if found else float("nan")

    def mean_ceiling(self, split: str = "heldout") -> float:
        """Return the mean fit that a perfect model would reach given the IMU's error, over a `split` [%]."""
        found = [j.ceiling for j in self.evaluated if j.split == split]
        return float(np.mean(found)) if found else float("nan")


def identify_wearer(
    participant: str,
    swings: Sequence[StrappedSwing],
    orthosis: Orthosis,
    *,
    limb: Limb | None = None,
    gain: Parameter | None = None,
    imu_sd: float = float("nan"),
    steps: Sequence[StrappedSwing] = (),
    posterior: bool = False,
    level: float = 0.95,
) -> WearerCoupling:
    """Identify one wearer's strap and evaluate all models on every swing.

    Only swings of the split ``"fitted"`` are fitted, from both bodies' balances and as published. `steps` are trials
    with held torques, which help to choose the model. `imu_sd` is the IMU's error [rad]. If `posterior`, the strap is
    also sampled, with intervals at `level`.
    """
    fitted = [s for s in swings if s.split == "fitted"]
    if not fitted:
        raise IdentificationError(f"{participant}: found no swing to fit, expected one or more")
    torques = {s.name: from_orthosis(s, orthosis) for s in swings}
    slips = [
        slip for s in swings if (slip := find_slip(s.name, *regression_residual(s, torques[s.name], clock_shift(s))))
    ]
    used = [s for s in fitted if s.name not in {slip.recording for slip in slips}]
    if not used:
        names = {s.name for s in fitted}
        where = ", ".join(
            f"{s.recording} at {s.time:.1f} s by {np.degrees(s.step):+.1f} deg" for s in slips if s.recording in names
        )
        raise IdentificationError(
            f"{participant}: the strap slipped in every fitted swing ({where}), expected one mounting throughout a "
            "trial; tighten it, or cut the trials there with a window"
        )
    fit = fit_coupling(used, [torques[s.name] for s in used], gain=gain)
    instruments = dict(zip([s.name for s in used], fit.instruments, strict=True))
    for swing in swings:
        if swing.name not in instruments:
            instruments[swing.name] = align(swing, torques[swing.name], fit)
    angles, published = {}, {}
    other, failure = None, "no torque of the muscles is known"
    if limb is not None and all(s.knee_torque is not None for s in swings):
        angles = {s.name: limb_angle(s, instruments[s.name]) for s in swings}
        other, failure = _limb_side(used, limb, angles, gain)
        published = _published(used, angles, orthosis, limb)
    strap = _strap(used, torques, fit, steps, orthosis)
    evaluated = tuple(
        _judge(s, torques[s.name], instruments[s.name], fit, strap, other, published, angles, orthosis, limb, imu_sd)
        for s in swings
    )
    held = tuple(s.name for s in steps) if strap is not None else ()
    made = WearerCoupling(participant, fit, other, published, evaluated, tuple(slips), (), strap=strap, held=held)
    if posterior:
        try:
            drawn = strap_posterior(used, [torques[s.name] for s in used], fit, gain=gain, level=level)
            made = replace(made, posterior=drawn)
        except IdentificationError as error:
            made = replace(made, no_posterior=str(error))
    return replace(made, verdicts=tuple(coupling_verdicts(made, failure)))


def coupling_verdicts(found: WearerCoupling, no_limb: str = "") -> Iterator[Verdict]:
    """Yield the verdicts on one wearer's coupling; `no_limb` says why there is no estimate by the limb's balance."""
    who, fit, decision = found.participant, found.orthosis_side, found.decision
    for s in found.slips:
        yield Verdict(
            "warning",
            f"{who}: the strap slipped by {np.degrees(s.step):+.1f} deg {s.time:.1f} s into {s.recording}. The trial "
            "is not fitted, and errors on it include both positions of the strap.",
        )
    if any(j.split == "heldout" for j in found.evaluated):
        reached, ceiling = found.mean_fit(), found.mean_ceiling()
        limit = f" (the IMU's own error allows {ceiling:.1f} %)" if np.isfinite(ceiling) else ""
        kind = "good" if decision.is_good else "note" if decision.predicts else "warning"
        k, b = found.parameter("stiffness"), found.parameter("damping")
        text = f"{who}: a strap of {_read(k)} and {_read(b)} explains {reached:.1f} % of the "
        text += f"mismatch in held-out swings{limit}"
        if decision.predicts and not decision.is_good:
            text += ", although " + ("no model is accepted" if not decision.holds else "its parameters are rejected")
        yield Verdict(kind, f"{text}.")
    else:
        yield Verdict("warning", f"{who}: no swing is held out, so that the prediction of new swings is not tested.")
    for parameter in (fit.stiffness, fit.damping):
        if parameter in decision.rejected:
            yield Verdict(
                "warning",
                f"{who}: the {parameter.name} is on its bound of zero and is rejected: the torque of the strap does "
                "not explain the mismatch, or an error of the IMU's clock does instead.",
            )
        elif not parameter.identifiable:
            text = f"{who}: the {parameter.name} does not differ significantly from zero ({_interval(parameter)})."
            yield Verdict("warning", text)
    yield from _strap_verdicts(found, decision)
    yield _inertia_verdict(who, fit, found.strap, decision)
    yield _side_verdict(found, no_limb, decision)
    if found.published:
        yield _published_verdict(found)


def _strap_verdicts(found: WearerCoupling, decision: StrapDecision) -> Iterator[Verdict]:
    """Yield the verdicts on the strap: its features, its stiffness over the range seen, and the test of the model."""
    who, strap = found.participant, found.strap
    if strap is None:
        yield Verdict("warning", f"{who}: only a spring and a damper could be fitted to the strap.")
        return
    low, high = (np.degrees(v) for v in strap.range)
    at_low, at_high = (p.value for p in strap.ends)
    what = strap.model.words if strap.model.features else "a spring and a damper predict it best"
    what += " (stiffness and tangents are those of the strap without tissue)" if strap.model.has("tissue") else ""
    yield Verdict(
        "note",
        f"{who}: {what}. It was recorded from {low:+.1f} to {high:+.1f} deg. The tangent stiffness is {at_low:.3g} "
        f"and {at_high:.3g} N*m/rad at these ends and {strap.stiffness.value:.3g} at the onset of tension. The best "
        f"spring and damper alone have a stiffness of {_read(found.orthosis_side.stiffness)}.",
    )
    if strap.stiffness.refused:
        yield Verdict("warning", f"{who}: the stiffness has no interval: {strap.stiffness.refused}.")
    if not found.held:
        text = "relaxation of the strap over longer than a swing is not identifiable: record held torques."
        yield Verdict("note", f"{who}: {text}")
    if not strap.model.in_core:
        text = "controllers, and torques computed through the strap, use the best-fitting spring and damper, "
        yield Verdict("note", f"{who}: {text}without friction and tissue of the strap.")
    if not decision.holds:
        text = "no strap model is accepted: additional effects improve the prediction of held-out blocks"
        yield Verdict("warning", f"{who}: {text} (p {strap.holds:.2g}).")


# --- steps ----------------------------------------------------------------------------------------------------------


def _strap(used, torques, fit, steps, orthosis) -> IdentifiedStrap | None:
    try:
        held = [from_orthosis(s, orthosis) for s in steps]
        return identify_strap(used, [torques[s.name] for s in used], fit, steps, held)
    except (IdentificationError, np.linalg.LinAlgError):
        return None


def _seen(swing: StrappedSwing, instrument: Instrument) -> tuple[np.ndarray, np.ndarray]:
    """Return times and the measured mismatch at the IMU's samples within the trial."""
    time, seen = seen_mismatch(swing, instrument)
    inside = np.isfinite(seen) & (time >= swing.time[0] + SWING_EDGE_S) & (time <= swing.time[-1] - SWING_EDGE_S)
    return time[inside], seen[inside]


def _limb_side(
    used: Sequence[StrappedSwing], limb: Limb, angles: Mapping[str, np.ndarray], gain: Parameter | None
) -> tuple[CouplingFit | None, str]:
    try:
        torques = [from_limb(s, limb, angles[s.name]) for s in used]
        return fit_coupling(used, torques, side="limb", gain=gain, free_gain=False), ""
    except IdentificationError as error:
        return None, str(error)


def _published(used, angles, orthosis, limb) -> dict[str, PublishedCoupling]:
    fs = used[0].fs
    torques = [torque_mismatch(s, angles[s.name], orthosis, limb) for s in used]
    seen = [angles[s.name] - s.position for s in used]
    return {"balance": solve_balance(torques, seen, fs), "two_poles": fit_two_poles(torques, seen, fs)}


def _judge(swing, torque, instrument, fit, strap, other, published, angles, orthosis, limb, imu_sd) -> EvaluatedSwing:
    def responds(of: np.ndarray, by: CouplingFit) -> np.ndarray:
        return mismatch(of, swing.fs, stiffness=by.stiffness.value, damping=by.damping.value)

    time, seen = _seen(swing, instrument)
    predicted = responds(torque.torque, fit)
    model = np.interp(time, swing.time, predicted)
    simulated = {"orthosis": model}
    if other is not None:
        by_limb = responds(from_limb(swing, limb, angles[swing.name]).torque, other)
        simulated["limb"] = np.interp(time, swing.time, by_limb)
    literal = None
    if published:
        rhs = torque_mismatch(swing, angles[swing.name], orthosis, limb)
        literal = published_mismatch(published["two_poles"], rhs, angles[swing.name] - swing.position, swing.fs)
        simulated["published"] = np.interp(time, swing.time, literal)
    fits = {name: fit_percent(seen, values) for name, values in simulated.items()}
    if strap is not None:
        # Each strap model is evaluated with its own estimate of clock and mounting.
        simulated["kelvin_voigt"], fits["kelvin_voigt"] = model, fits["orthosis"]
        instrument = strap.instrument(swing, torque, instrument.shift)
        before, (time, seen) = time, _seen(swing, instrument)
        simulated = {name: np.interp(time, before, values) for name, values in simulated.items()}
        predicted = strap.mismatch(swing, torque)
        simulated["orthosis"] = np.interp(time, swing.time, predicted)
        fits["orthosis"] = fit_percent(seen, simulated["orthosis"])
    ceiling = 100.0 * (1.0 - imu_sd / float(np.std(seen)))
    position = np.interp(time, swing.time, swing.position)
    return EvaluatedSwing(
        swing.name, swing.split, time, seen, simulated, fits, ceiling, instrument, predicted, literal, position
    )


# --- verdicts -------------------------------------------------------------------------------------------------------


def _read(parameter: Parameter) -> str:
    if parameter.refused:
        return f"{parameter.value:.3g} {parameter.unit} (not identifiable)"
    return f"{parameter.value:.3g} ± {1.96 * parameter.standard_error:.2g} {parameter.unit}"


def _interval(parameter: Parameter) -> str:
    low, high = parameter.interval()
    return f"{low:.3g} to {high:.3g} {parameter.unit}"


def _inertia_verdict(who: str, fit: CouplingFit, strap: IdentifiedStrap | None, decision: StrapDecision) -> Verdict:
    if not decision.has_inertia:
        kind = "good" if decision.holds and not decision.rejected else "note"
        text = f"the strap shows no inertia ({_interval(fit.inertia)}), as expected."
        return Verdict(kind, f"{who}: {text}")
    if strap is not None and strap.model.features:
        return Verdict(
            "note",
            f"{who}: with a spring and a damper alone, the strap would show an inertia ({_interval(fit.inertia)}), "
            "which confirms that its model needs more.",
        )
    return Verdict(
        "warning",
        f"{who}: the strap shows an inertia ({_interval(fit.inertia)}), which is impossible. The cause is probably an "
        "error of the IMU or of the orthosis's inertia.",
    )


def _side_verdict(found: WearerCoupling, no_limb: str, decision: StrapDecision) -> Verdict:
    who, fit, other = found.participant, found.orthosis_side, found.limb_side
    if other is None:
        return Verdict("note", f"{who}: the strap is identified from the orthosis's torque balance alone; {no_limb}.")
    split = "heldout" if np.isfinite(found.mean_fit()) else "fitted"
    ours, theirs = found.mean_fit("orthosis", split), found.mean_fit("limb", split)
    use = "held-out" if split == "heldout" else "fitted"
    if ours >= theirs:
        said = f"prefer the orthosis's torque balance, which explains {ours:.1f} % of the mismatch in {use} swings; "
        said += f"the limb's explains {theirs:.1f} %. The orthosis's torque comes from a spring and two encoders, the "
        said += "limb's from EMG and the twice differentiated IMU"
    else:
        said = f"the limb's torque balance explains more of the mismatch in {use} swings ({theirs:.1f} against "
        said += f"{ours:.1f} %): the orthosis's own parameters or its friction are probably wrong"
    # Errors of the limb's torque are in the model's input: they bias the estimate without showing in the residual.
    said += f". As a spring and a damper, the limb's torque balance gives {_read(other.stiffness)} and "
    said += f"{_read(other.damping)}, the orthosis's {_read(fit.stiffness)} and {_read(fit.damping)}: "
    said += (
        "stiffnesses agree."
        if decision.sides_agree
        else "the intervals of the stiffnesses do not overlap; the limb's omits the error of its torque."
    )
    return Verdict("note" if ours >= theirs else "warning", f"{who}: {said}")


def _published_verdict(found: WearerCoupling) -> Verdict:
    literal = found.published["two_poles"]
    split = "heldout" if np.isfinite(found.mean_fit()) else "fitted"
    stopped = f", {' and '.join(literal.at_bound)} at a bound of zero" if literal.at_bound else ""
    stopped += ", a negative stiffness" if literal.stiffness < 0.0 else ""
    return Verdict(
        "note",
        f"{found.participant}: the published form, in which the strap's torque cancels, gives {literal.stiffness:.3g} "
        f"N*m/rad, {literal.damping:.3g} N*m*s/rad and {literal.inertia:.3g} kg*m^2{stopped}, and explains "
        f"{found.mean_fit('published', split):.1f} % of the mismatch.",
    )
