"""The figures of the paper `hill` computed again from its own printed numbers (errata C2, C4, C7 and C13)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pellucid.models.anthropometry import BODY_SHARES, Segment, shank_length, winter

from ..figure import Reproduced, figure
from ..printed import PrintedPaper

GRAVITY_M_S2 = 9.81
"""Acceleration of gravity; the paper prints none."""

SUBJECT_KEYS = tuple(f"subject_{number}" for number in range(1, 9))
"""The paper's eight subjects, as rows of its tables in ``printed.toml``."""

FASTEST_SWING = ("subject_2", math.radians(30.0))
"""The subject who swings fastest, and an amplitude for the swing [rad]. The paper prints the frequency alone; the
amplitude is chosen by judgement."""


@dataclass(frozen=True)
class PointMass:
    """A point mass that has p = m d^2 and q = m d.

    No body with this p and q has less mass, by the Cauchy-Schwarz inequality, and none has its centre further out.
    """

    mass: float  # q^2 / p [kg]
    distance: float  # p / q [m]


def point_mass(p: float, q: float) -> PointMass:
    """Return the point mass with `p` [kg m^2] and `q` [kg m]."""
    return PointMass(q**2 / p, p / q)


def mean_shank(paper: PrintedPaper) -> Segment:
    """Return the shank and foot of the paper's mean subject, by Winter's shares of mass and height."""
    return winter(paper["mass"], shank_length(0.01 * paper["height"]))


def swing_frequency(paper: PrintedPaper, subject: int) -> float:
    """Return the frequency of a subject's swing, from the cycles that the paper counts [Hz]."""
    start, end = (t.value for t in paper.values["shown_time"])
    return paper[f"cycles_subject_{subject}"] / (end - start)


def inertia_error(paper: PrintedPaper, frequency: float, amplitude: float, subject: str) -> float:
    """Return the error of eq. 12 at the turn of a swing, which arises because p' - p is not the leg's inertia [N m].

    `frequency` [Hz], `amplitude` [rad].
    """
    table = paper.tables["swings"]
    printed = table[subject]["p"].value - table["empty"]["p"].value
    return abs(mean_shank(paper).inertia - printed) * (2.0 * math.pi * frequency) ** 2 * amplitude


def largest_activation(shape: float, ratio: float) -> float:
    """Return a(u) of eq. 18 at the largest u, with R = k_r u_max (eq. 19); 1 would be a maximal contraction."""
    return math.expm1(shape / ratio) / math.expm1(shape)


def half_activation(shape: float, ratio: float) -> float:
    """Return the share of the largest u at which eq. 18 reaches half of its largest activation."""
    return math.log1p(0.5 * math.expm1(shape / ratio)) * ratio / shape


def recomputed(paper: PrintedPaper) -> list[Reproduced]:
    """Return every figure of the paper that its other printed numbers determine."""
    return [*_bodies(paper), *_step_three(paper), *_activations(paper), *_means(paper), *_methods(paper)]


def _row(name: str, quantity: str, unit: str, ours: float, *, printed=None, wrong: bool = False, note: str = ""):
    verdict = "cannot be" if wrong else "recomputed"
    return figure("hill.recomputed", name, quantity, unit, ours, printed, note, verdict=verdict)


def _bodies(paper: PrintedPaper) -> list[Reproduced]:
    table, shank = paper.tables["swings"], mean_shank(paper)
    people, share = shank.mass, BODY_SHARES.shank_mass
    bare = table["empty"]
    alone = point_mass(bare["p"].value, bare["q"].value)
    rows = [
        _row("empty.mass", "Least mass of the exoskeleton by Table 2", "kg", alone.mass, note="C2"),
        _row("empty.distance", "Largest distance of its centre by Table 2", "m", alone.distance,
             wrong=alone.distance < 0.9 * paper["empty_distance"], note="C2: 0.15 m in the text"),
        _row("shank.mass", f"Mass of the mean subject's shank, {share:g} of the body", "kg", people, note="C2"),
        _row("shank.q", "Its q by Winter", "kg*m", shank.mass * shank.centre, note="C2"),
        _row("shank.p", "Its p by Winter", "kg*m^2", shank.inertia, note="C2"),
    ]  # fmt: skip
    for number, subject in enumerate(SUBJECT_KEYS, 1):
        both = table[subject]
        found = point_mass(both["p"].value, both["q"].value)
        leg_p, leg_q = (both[n].value - bare[n].value for n in ("p", "q"))
        most = alone.mass + people
        # Three standard deviations above the mean subject.
        heaviest = alone.mass + share * (paper["mass"] + 3.0 * paper["mass_sd"])
        torque = both["q"].value * GRAVITY_M_S2
        rows += [
            _row(f"{subject}.mass", f"Least mass of leg and exoskeleton by Table 2, subject {number}", "kg", found.mass,
                 wrong=found.mass > heaviest, note=f"C2: {heaviest:.1f} kg with a heavy leg"),
            _row(f"{subject}.distance", f"Largest distance of its centre, subject {number}", "m", found.distance,
                 note="C2: below 0.2 m in the text, which takes it for agreement"),
            _row(f"{subject}.leg.p", f"p' - p, subject {number}", "kg*m^2", leg_p, wrong=leg_p < 0.0, note="C2"),
            _row(f"{subject}.leg.q", f"q' - q, subject {number}", "kg*m", leg_q, note="C2"),
            _row(f"{subject}.leg.p.least", f"Least p' - p of a mean shank with this q' - q, subject {number}",
                 "kg*m^2", leg_q**2 / people, wrong=leg_p < leg_q**2 / people, note="C2: Cauchy-Schwarz"),
            _row(f"{subject}.p.least", f"Least p' of a mean shank and the exoskeleton, subject {number}", "kg*m^2",
                 both["q"].value ** 2 / most, wrong=both["p"].value < both["q"].value ** 2 / most,
                 note="C2: Cauchy-Schwarz"),
            _row(f"{subject}.level_torque", f"Torque that holds leg and exoskeleton level, subject {number}", "N*m",
                 torque, wrong=torque > paper["motor_torque"], note="C2: the motor has 17 N*m"),
        ]  # fmt: skip
    return rows


def _step_three(paper: PrintedPaper) -> list[Reproduced]:
    subject, amplitude = FASTEST_SWING
    frequency = swing_frequency(paper, 2)
    error = inertia_error(paper, frequency, amplitude, subject)
    rmse = paper.tables["errors"][subject]["rmse"].value
    return [
        _row("subject_2.frequency", "Swings of subject 2", "Hz", frequency, note="C4: 20 cycles in 30 s"),
        _row("subject_4.frequency", "Swings of subject 4", "Hz", swing_frequency(paper, 4), note="12 cycles in 30 s"),
        _row("subject_2.inertia_error", "Error of eq. 12 at the turns of subject 2's swing, +-30 deg", "N*m", error,
             wrong=error > rmse, note=f"C4: the printed RMSE against eq. 12 is {rmse:.4g} N*m"),
    ]  # fmt: skip


def _activations(paper: PrintedPaper) -> list[Reproduced]:
    rows = []
    for number, subject in enumerate(SUBJECT_KEYS, 1):
        shape, ratio = (paper.tables["muscles"][subject][n].value for n in ("A", "k_r"))
        most = largest_activation(shape, ratio)
        rows += [
            _row(f"{subject}.largest_activation", f"Largest activation by Table 3, subject {number}", "1", most,
                 wrong=most > 1.0, note="C7: 1 is a maximal contraction"),
            _row(f"{subject}.half_activation", f"Share of the largest EMG that gives half of it, subject {number}",
                 "1", half_activation(shape, ratio), note="C7"),
        ]  # fmt: skip
    return rows


def _means(paper: PrintedPaper) -> list[Reproduced]:
    table = paper.tables["errors"]
    words = {"rmse": "RMSE", "maxe": "MAXE", "mae": "MAE"}
    rows = []
    for name, word in words.items():
        mean, printed = float(np.mean([table[s][name].value for s in SUBJECT_KEYS])), table["mean"][name]
        # The mean of unrounded errors may differ from that of the rounded ones by as much as one of them was rounded.
        off = abs(mean - printed.value) > 2.0 * printed.half_unit
        rows.append(
            _row(f"mean.{name}", f"Mean {word} of Table 4", "N*m", mean, printed=printed, wrong=off, note="C13")
        )
    others = max(table[s]["maxe"].value for s in SUBJECT_KEYS if s != "subject_3")
    rows.append(
        _row("others.maxe", "Largest MAXE of all subjects but the third", "N*m", others,
             wrong=others >= paper["others_below"], note="C13: said to be below 8")
    )  # fmt: skip
    return rows


def _methods(paper: PrintedPaper) -> list[Reproduced]:
    table = paper.tables["methods"]
    return [
        _row(f"over_nm_coa.{name}", f"The paper's {word} over NM-COA's, less 1", "%",
             100.0 * (table["ours"][name].value / table["nm_coa"][name].value - 1.0), note="C13: called comparable")
        for name, word in (("rmse", "RMSE"), ("maxe", "MAXE"))
    ]  # fmt: skip
