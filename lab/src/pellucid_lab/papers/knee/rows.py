"""Every figure of the reproduction with its printed number: orthosis, limbs, torque from EMG, strap, compensator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from pellucid.models.estimates import Parameter

from ...knee.rig import KneeRig
from ..figure import Reproduced, figure
from ..printed import Printed, PrintedPaper
from .recomputed import SUBJECT_KEYS
from .torque import ScoredMap, TorqueSteps
from .wearers import Bench, WearerErrors, WearerIdentification, mean_fit, tape_measure

IMU_AXES_WORDS = {9: "nine", 6: "six"}
"""Word in ids for an IMU with this number of axes, with and without its magnetometer."""

_row = partial(figure, "knee")


def _interval(name: str, quantity: str, parameter: Parameter, published: Printed | None, note: str) -> Reproduced:
    """Return a parameter with its 95 % interval, and the published value of another device."""
    value = None if published is None else published.value
    return _row(name, quantity, parameter.unit, parameter.value, value, note, between=parameter.interval())


def orthosis_rows(bench: Bench, paper: PrintedPaper) -> list[Reproduced]:
    """Return the rows on Table 3.2 and Figs. 3.1 and 3.2: the orthosis alone."""
    table, fit = paper.tables["orthosis"]["experimental"], bench.fit
    theory = paper.tables["orthosis"]["theoretical"]
    found = {p.name: p for p in (*fit.parameters, fit.linear["stiffness"])}
    off = {n: 100.0 * abs(table[n].value / theory[n].value - 1.0) for n in ("gravity", "inertia")}
    another = "Table 3.2; the rig is not the thesis's orthosis"
    rows = [
        _row("mgl_e.error", "Error of the orthosis's gravity torque", "%",
             100.0 * abs(found["gravity"].value / bench.gravity - 1.0), off["gravity"],
             "the thesis's is a difference from an estimate"),
        *(
            _row(f"mgl_e.error.{name}", f"The same by the thesis's {words}", "%",
                 100.0 * abs(bench.as_published[name] / bench.gravity - 1.0), note="B2")
            for name, words in (("line", "line of best fit"), ("cosine", "cosine"))
        ),
        _row("orthosis.inertia.error", "Error of the orthosis's inertia", "%",
             100.0 * abs(found["inertia"].value / bench.inertia - 1.0), off["inertia"],
             "the thesis's is a difference from an estimate"),
        *(
            _interval(f"orthosis.{name}", f"{words} of the orthosis", found[name], table[name], f"{another}{more}")
            for name, words, more in (
                ("gravity", "Gravity torque", ""), ("inertia", "Inertia", ""), ("damping", "Damping", ""),
                ("stiffness", "Apparent stiffness", "; the published form, weight taken for a spring (B4)"),
            )
        ),
        _row("tf.fit.published_form", "Fit of two poles to the thesis's 5 s of each frequency, in sample", "%",
             float(np.mean([r.fit for r in bench.brief.responses])), paper["response_fit"], "mean of four frequencies"),
        _row("tf.fit.published_form.long", "The same over 40 s of each, in sample", "%",
             fit.mean_fit("fitted", linear=True), paper["response_fit"]),
        _row("tf.fit.published_form.heldout", "Its fit at 0.6 rad", "%", fit.mean_fit(linear=True)),
        _row("tf.fit", "Fit of a pendulum with friction at 0.6 rad", "%", fit.mean_fit(),
             note="fitted at 1 rad; each frequency from its own initial state"),
    ]  # fmt: skip
    for name, response in fit.checks.items():
        tag = name.rsplit("_", 1)[-1]
        rows.append(_row(f"tf.fit.{tag}", f"The same, {int(tag) / 10.0:g} Hz alone", "%", response.fit))
    return rows


def limbs_rows(
    rig: KneeRig, wearers: Mapping[str, WearerIdentification], drawn: Sequence[WearerErrors], paper: PrintedPaper
) -> list[Reproduced]:
    """Return rows on Table 3.3 and Fig. 3.3."""
    shank = paper.tables["shank"]
    off = [100.0 * abs(shank[s]["gravity_found"].value / shank[s]["gravity"].value - 1.0) for s in SUBJECT_KEYS]
    difference_note = "the thesis's is a difference from an estimate"
    rows = [
        _row("mgl_sh.error", "Error of the shank's gravity torque, mean of the subjects", "%",
             _by_seed(drawn, lambda d: abs(d.gravity_error)), float(np.mean(off)), difference_note)
    ]  # fmt: skip
    for (name, found), printed_, difference in zip(wearers.items(), SUBJECT_KEYS, off, strict=True):
        own = [abs(d.gravity_error) for d in drawn if d.subject == name]
        tables = tape_measure(rig.subjects[name])
        rows += [
            _row(f"mgl_sh.error.{name}", f"The same, {name}", "%", own, difference, difference_note),
            _interval(f"mgl_sh.{name}", f"Gravity torque of the shank, {name}", found.stages.limb.gravity,
                      shank[printed_]["gravity_found"], "Table 3.3; the virtual subject's limb is not Winter's"),
            *(
                _row(f"mgl_sh.tables.{table}.{name}", f"What {words} expect of {name}", "N*m", tables[table],
                     note=f"truth {found.subject.gravity:.4g} N·m")
                for table, words in (("winter", "Winter's shares"), ("de_leva", "de Leva's shares"),
                                     ("published", "Winter's shares of knee to heel"))
            ),
        ]  # fmt: skip
    return rows


def _by_seed(drawn: Sequence[WearerErrors], of: Callable[[WearerErrors], float]) -> list[float]:
    """Return the mean over the subjects, seed by seed."""
    return [float(np.mean([of(d) for d in drawn if d.seed == s])) for s in dict.fromkeys(d.seed for d in drawn)]


def torques_rows(
    steps: Mapping[tuple[str, str], TorqueSteps], maps: Sequence[ScoredMap], paper: PrintedPaper
) -> list[Reproduced]:
    """Return rows on Table 3.4 and Fig. 3.4."""
    table, rows = paper.tables["regression"], []
    for protocol, estimator in dict.fromkeys((m.protocol, m.estimator) for m in maps):
        mine = [m for m in maps if (m.protocol, m.estimator) == (protocol, estimator)]
        kind = estimator.removesuffix("_published")
        own = protocol == "published"
        value = table[kind]["rmse"].value if own and kind in table.rows else None
        defaults = kind != estimator
        how = "the defaults of the thesis's tool" if defaults else "settings chosen within"
        named = f"{kind} with its tool's defaults" if defaults else kind
        head, what = ("emg", "0, 5, 10 N·m") if own else ("emg.both_ways", "0 to 10 N·m either way")
        rows += [
            _row(f"{head}.rmse.{estimator}", f"Torque error of {named}, {what}, mean of the subjects", "N*m",
                 float(np.mean([m.score.rmse for m in mine])), value, f"each repetition held out; {how}"),
            _row(f"{head}.true_rmse.{estimator}", "The same against the knee's true torque", "N*m",
                 float(np.mean([steps[m.subject, protocol].true_error(m.predicted) for m in mine]))),
            *(_row(f"{head}.rmse.{estimator}.{m.subject}", f"Torque error of {named}, {what}, {m.subject}", "N*m",
                   m.score.rmse, note=f"R² {m.score.r2:.3f}; {m.words}") for m in mine),
        ]  # fmt: skip
    for name, of, words in (
        ("target", lambda s: s.targets, "Error of the torque that maps are fitted to"),
        ("target.kelvin_voigt", lambda s: s.plain, "The same through a spring and a damper"),
        ("target.as_one", lambda s: s.as_one, "The same if the strap did not yield"),
    ):
        errors = [s.true_error(of(s)) for (_, protocol), s in steps.items() if protocol == "published"]
        rows.append(
            _row(f"emg.{name}.rmse", words, "N*m", float(np.mean(errors)), note="against the knee's true torque")
        )
    return rows


def coupling_rows(
    wearers: Mapping[str, WearerIdentification], drawn: Sequence[WearerErrors], paper: PrintedPaper
) -> list[Reproduced]:
    """Return rows on Table 3.5 and Figs. 3.5 to 3.7."""
    table = paper.tables["coupling"]

    def mean(of: Callable[[WearerIdentification], float]) -> float:
        return float(np.mean([of(w) for w in wearers.values()]))

    rows = [
        _row("coupled.fit", "Fit of the mismatch in held-out swings, mean of the subjects", "%",
             _by_seed(drawn, lambda d: d.fit), paper["mean_fit"], "against the true mismatch; the thesis's in sample"),
        _row("coupled.rmse", "Its error", "rad", _by_seed(drawn, lambda d: d.rmse), paper["mean_rmse"]),
        _row("coupled.fit.published_form", "Fit of the thesis's form in held-out swings", "%",
             mean(lambda w: mean_fit(w.swings, "published")), paper["mean_fit"], "against the true mismatch (B1)"),
        _row("coupled.fit.published_form.fitted", "The same, in sample", "%",
             mean(lambda w: mean_fit(w.swings, "published", "fitted")), paper["mean_fit"]),
        _row("coupled.fit.published_form.true_torque.fitted", "The same, given the muscles' true torque", "%",
             mean(lambda w: mean_fit(w.best_published, "published", "fitted")),
             paper["mean_fit"], "so that no error of EMG is in it"),
        *(
            _row(f"coupled.coverage.{letter}", f"Share of intervals that cover the strap's {words}", "1",
                 float(np.mean([d.holds[words] for d in drawn])), note=f"{len(drawn)} subjects and seeds, 95 %")
            for letter, words in (("k", "stiffness"), ("b", "damping"))
        ),
        _row("coupled.coverage.inertia", "Share of intervals that cover an inertia of zero", "1",
             float(np.mean([d.holds["inertia"] for d in drawn])), note=f"{len(drawn)} subjects and seeds, 95 %"),
    ]  # fmt: skip
    for axes, words in IMU_AXES_WORDS.items():
        rows += [
            _row(f"coupled.fit.{words}_axes", f"Fit with a {words}-axis IMU", "%",
                 mean(lambda w, n=axes: mean_fit(w.of(n)[1])), note="first seed"),
            _row(f"coupled.fit.imu.{words}_axes", f"Fit against the mismatch that a {words}-axis IMU saw", "%",
                 mean(lambda w, n=axes: w.of(n)[0].coupling.mean_fit())),
            _row(f"coupled.ceiling.{words}_axes", "What the IMU's own error, as calibrated, allows", "%",
                 mean(lambda w, n=axes: w.of(n)[0].coupling.mean_ceiling())),
            _row(f"coupled.ceiling.true.{words}_axes", "What the IMU's true error allows", "%",
                 mean(lambda w, n=axes: mean_fit(w.of(n)[1], "seen"))),
            _row(f"imu.error.{words}_axes", f"Error of the {words}-axis IMU's angle against the encoder", "deg",
                 float(np.degrees(mean(lambda w, n=axes: w.of(n)[0].calibration.sd)))),
            _row(f"imu.error.madgwick.{words}_axes", "The same by Madgwick's filter, as in the thesis", "deg",
                 float(np.degrees(mean(lambda w, n=axes: _filter_error(w, "madgwick", n))))),
        ]  # fmt: skip
    for (name, found), printed_ in zip(wearers.items(), SUBJECT_KEYS, strict=True):
        coupling = found.stages.coupling
        literal = coupling.published["two_poles"]
        own = [d.fit for d in drawn if d.subject == name]
        rows += [
            _row(f"coupled.fit.{name}", f"Fit of the mismatch in held-out swings, {name}", "%", own,
                 table[printed_]["fit"].value),
            _interval(f"coupled.stiffness.{name}", f"Stiffness of the strap, {name}", coupling.parameter("stiffness"),
                      table[printed_]["stiffness"], f"truth {found.subject.strap['stiffness']:.4g}"),
            _interval(f"coupled.damping.{name}", f"Damping of the strap, {name}", coupling.parameter("damping"),
                      table[printed_]["damping"], f"truth {found.subject.strap['damping']:.4g}"),
            _interval(f"coupled.inertia.{name}", f"Inertia of the strap, {name}", coupling.parameter("inertia"),
                      table[printed_]["inertia"], "truth 0"),
            *(
                _row(f"coupled.published_form.{what}.{name}", f"{what.capitalize()} by the thesis's form, {name}",
                     unit, getattr(literal, what), table[printed_][what].value,
                     "at a bound of zero" if what in literal.at_bound else "")
                for what, unit in (("stiffness", "N*m/rad"), ("damping", "N*m*s/rad"), ("inertia", "kg*m^2"))
            ),
        ]  # fmt: skip
    return rows


def _filter_error(found: WearerIdentification, method: str, axes: int) -> float:
    """Return the held-out error of an orientation filter's regressed outputs against the encoder [rad]."""
    every = found.stages.calibration.filters
    return next(e.heldout for e in every if (e.method, e.axes, e.inputs) == (method, axes, "outputs"))
