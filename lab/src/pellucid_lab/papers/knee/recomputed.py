"""The thesis's figures computed again from its own printed numbers, with contradictions (errata B2 to B12)."""

from __future__ import annotations

import math

import numpy as np

from pellucid.models.anthropometry import BODY_SHARES, rod, shank_length, winter
from pellucid.numerics.gravity_holds import accuracy, cosine_moment, line_of_best_fit

from ..figure import Reproduced, figure
from ..printed import Printed, PrintedPaper
from .two_poles import TwoPoles, chord_stiffness, lowpass_delay, output_sd, r_squared, sine_stiffness

GRAVITY_M_S2 = 9.81
"""Acceleration of gravity with which the thesis's products agree after rounding; it prints none."""

SUBJECT_KEYS = ("subject_1", "subject_2", "subject_3")
"""The thesis's subjects, as rows of its tables in ``printed.toml``."""


def recomputed(paper: PrintedPaper) -> list[Reproduced]:
    """Return every figure of the thesis that its other printed numbers determine."""
    return [
        *_gravity(paper),
        *_response(paper),
        *_accuracies(paper),
        *_shanks(paper),
        *_coupling(paper),
        *_delays(paper),
    ]


def published_response(paper: PrintedPaper) -> TwoPoles:
    """Return Table 3.2's experimental transfer function."""
    found = paper.tables["orthosis"]["experimental"]
    return TwoPoles(*(found[n].value for n in ("inertia", "damping", "stiffness")))


def published_coupling(paper: PrintedPaper, subject: str) -> TwoPoles:
    """Return Table 3.5's transfer function of one subject."""
    found = paper.tables["coupling"][subject]
    return TwoPoles(*(found[n].value for n in ("inertia", "damping", "stiffness")))


def _row(
    name: str, quantity: str, unit: str, ours: float, printed: Printed | None = None, note: str = "", ends: str = ""
) -> Reproduced:
    """Return one row, "cannot be" if ours does not round to the printed number and no reading (`ends`) explains it."""
    wrong = printed is not None and not printed.agrees(ours) and not ends
    whole_note = "; ".join(part for part in (note, ends) if part)
    verdict = "cannot be" if wrong else "recomputed"
    return figure("knee.recomputed", name, quantity, unit, ours, printed, whole_note, verdict=verdict)


def _gravity(paper: PrintedPaper) -> list[Reproduced]:
    angle = np.radians([a.value for a in paper.values["hold_angles"]])
    line = line_of_best_fit(angle, np.sin(angle))
    body = paper.tables["orthosis"]["theoretical"]
    return [
        _row("line.slope", "Slope of the trend line over the held angles, of m g l", "1/rad", line.slope, note="B2"),
        _row(
            "line.through_origin", "The same through the origin, of m g l", "1/rad", line.through_origin, note="B2",
        ),
        _row(
            "line.residual", "Largest distance of the torque from the line, of m g l", "1", line.largest_residual,
            note="B2",
        ),
        _row(
            "cosine", "m g l by eq. 2.3 from torques that follow the sine, of m g l", "1",
            cosine_moment(angle, np.sin(angle)), note="B2",
        ),
        _row(
            "mgl_e", "Theoretical gravity torque of the orthosis", "N*m",
            body["mass"].value * GRAVITY_M_S2 * body["length"].value, body["gravity"],
            "its centre 0.21 m from the knee",
        ),
        _row(
            "inertia_e", "Theoretical inertia of the orthosis, a rod of twice that length", "kg*m^2",
            rod(body["mass"].value, 2.0 * body["length"].value).inertia, body["inertia"], "B7",
        ),
        _row(
            "inertia_e.as_printed", "The same with the printed length", "kg*m^2",
            rod(body["mass"].value, body["length"].value).inertia, body["inertia"],
            "B7: one symbol for two lengths",
        ),
    ]  # fmt: skip


def _response(paper: PrintedPaper) -> list[Reproduced]:
    fitted, found = published_response(paper), paper.tables["orthosis"]["experimental"]
    amplitude, seconds = paper["sine_amplitude"], paper["sine_time"]
    theory = paper.tables["orthosis"]["theoretical"]["gravity"].value
    gravity = found["gravity"].value
    between = "the chord's, 1.28 to 1.33 with either gravity, holds what is printed (B4)"
    return [
        _row(
            "stiffness.sine", "Spring that the experimental gravity looks like over a sine of 1 rad", "N*m/rad",
            sine_stiffness(gravity, amplitude), found["stiffness"], ends=between,
        ),
        _row(
            "stiffness.chord", "The same at 1 rad itself", "N*m/rad", chord_stiffness(gravity, amplitude),
            found["stiffness"], ends=between,
        ),
        _row(
            "stiffness.chord.theoretical", "The same with the theoretical gravity", "N*m/rad",
            chord_stiffness(theory, amplitude), found["stiffness"], ends=between,
        ),
        _row("natural_frequency", "Natural frequency of Table 3.2", "Hz", fitted.natural_frequency, note="B5"),
        _row("damping_ratio", "Damping ratio of Table 3.2", "1", fitted.damping_ratio, note="B5"),
        _row("time_constant", "Time constant of Table 3.2", "s", fitted.time_constant, note="B5"),
        _row(
            "left_after_5_s", "Share of the transient left after the seconds a frequency lasts", "1",
            fitted.left_after(seconds), note="B5: called steady state",
        ),
    ]  # fmt: skip


def _accuracies(paper: PrintedPaper) -> list[Reproduced]:
    table, shank = paper.tables["orthosis"], paper.tables["shank"]
    of_body = {
        name: accuracy(table["experimental"][name].value, table["theoretical"][name].value)
        for name in ("gravity", "inertia")
    }
    of_shanks = np.mean(
        [accuracy(shank[s]["gravity_found"].value, shank[s]["gravity"].value) for s in SUBJECT_KEYS], axis=0
    )
    rows = []
    for name, quantity, (of_found, of_theory), printed in (
        ("gravity", "the orthosis's gravity", of_body["gravity"], paper.values["gravity_accuracy"]),
        ("shank", "the shanks' gravity", of_shanks, paper.values["shank_accuracy"]),
        ("inertia", "the orthosis's inertia", of_body["inertia"], paper.values["inertia_accuracy"]),
    ):
        rows.append(
            _row(f"accuracy.{name}.of_experimental", f"Accuracy of {quantity}, relative to the experimental", "%",
                 float(of_found), printed, "B8: what was computed")
        )  # fmt: skip
        rows.append(
            _row(f"accuracy.{name}", f"Accuracy of {quantity}, relative to the theoretical", "%", float(of_theory),
                 printed, "B8: stated in the text")
        )  # fmt: skip
    return rows


def _shanks(paper: PrintedPaper) -> list[Reproduced]:
    rows = []
    for number, subject in enumerate(SUBJECT_KEYS, 1):
        person, printed = paper.tables["subjects"][subject], paper.tables["shank"][subject]
        mass, height, heel = (person[n].value for n in ("mass", "height", "shank_length"))
        taped, ankle = winter(mass, heel), winter(mass, shank_length(height))
        rounded = "" if printed["inertia"].agrees(taped.inertia) else _by_rounded_centre(printed, heel)
        rows += [
            _row(f"subject_{number}.mass", f"Mass of the shank, subject {number}", "kg", taped.mass, printed["mass"]),
            _row(f"subject_{number}.centre", f"Its centre, subject {number}", "m", taped.centre,
                 printed["centre"]),
            _row(f"subject_{number}.mgl_sh", f"Its gravity torque, subject {number}", "N*m",
                 taped.gravity(GRAVITY_M_S2), printed["gravity"]),
            _row(f"subject_{number}.inertia", f"Its inertia, subject {number}", "kg*m^2", taped.inertia,
                 printed["inertia"],
                 "B9" if number > 1 else "B9: the printed value follows from 0.44 m, or has 0.476 for 0.416", rounded),
            _row(f"subject_{number}.mgl_sh.to_ankle", f"Gravity torque by Winter's own length, subject {number}",
                 "N*m", ankle.gravity(GRAVITY_M_S2), note="B10: knee to ankle, 0.246 of the height"),
            _row(f"subject_{number}.inertia.to_ankle", f"Inertia by Winter's own length, subject {number}", "kg*m^2",
                 ankle.inertia, note="B10"),
            _row(f"subject_{number}.heel", f"Knee to heel, subject {number}, over Winter's share of the height", "1",
                 heel / shank_length(height, to="sole"), note="B10"),
        ]  # fmt: skip
    return rows


def _by_rounded_centre(printed: dict[str, Printed], heel: float) -> str:
    """Return whether the printed inertia follows from the printed, rounded, mass and centre."""
    mass, centre = printed["mass"].value, printed["centre"].value
    return (
        "as printed with the rounded centre"
        if printed["inertia"].agrees(mass * ((BODY_SHARES.shank_gyration * heel) ** 2 + centre**2))
        else ""
    )


def _coupling(paper: PrintedPaper) -> list[Reproduced]:
    table = paper.tables["coupling"]
    fits, errors = ([table[s][n].value for s in SUBJECT_KEYS] for n in ("fit", "rmse"))
    rows = [
        _row("coupled.fit", "Mean fit of Table 3.5", "%", float(np.mean(fits)), paper.values["mean_fit"], "B11"),
        _row("coupled.rmse", "Mean error of Table 3.5", "rad", float(np.mean(errors)), paper.values["mean_rmse"]),
    ]
    for number, subject in enumerate(SUBJECT_KEYS, 1):
        poles = published_coupling(paper, subject)
        spread = output_sd(errors[number - 1], fits[number - 1])
        person, found = paper.tables["subjects"][subject], paper.tables["shank"][subject]["gravity_found"].value
        inertia = winter(person["mass"].value, person["shank_length"].value).inertia
        pendulum = math.sqrt(found / inertia) / (2.0 * math.pi)
        rows += [
            _row(f"subject_{number}.natural_frequency", f"Natural frequency of Table 3.5, subject {number}", "Hz",
                 poles.natural_frequency, note="B11"),
            _row(f"subject_{number}.damping_ratio", f"Damping ratio of Table 3.5, subject {number}", "1",
                 poles.damping_ratio, note="B11"),
            _row(f"subject_{number}.pendulum", f"Frequency at which the shank swings by Table 3.3, subject {number}",
                 "Hz", pendulum, note="B11"),
            _row(f"subject_{number}.r2", f"R² of the printed fit, subject {number}", "1", r_squared(fits[number - 1]),
                 note="B11"),
            _row(f"subject_{number}.sd", f"Standard deviation of the mismatch, subject {number}", "rad", spread,
                 note=f"B11: a sine of {math.degrees(math.sqrt(2.0) * spread):.0f}°"),
        ]  # fmt: skip
    return rows


def _delays(paper: PrintedPaper) -> list[Reproduced]:
    cutoff = paper["emg_envelope_cutoff"]
    return [
        _row(f"delay.order_{order}", f"Delay of the envelope's filter, causal, order {order}", "ms",
             1e3 * lowpass_delay(order, cutoff), note="B12")
        for order in (1, 2, 4)
    ]  # fmt: skip
