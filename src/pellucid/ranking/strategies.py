"""The strategies that are ranked: what reviews call them, and which controller each is at either joint."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Strategy:
    """One way of not being in a wearer's way."""

    name: str  # In the field's words
    reviewed: str  # Who reviews it: "elbow" and "knee" are the papers of these robots, "" neither
    elbow: str | None  # The controller at the elbow; None where there is none
    knee: str | None  # The controller at the knee
    senses: tuple[str, str]  # What it reads beside a clock, at the elbow and at the knee


ENCODER, FORCE, SPRING, EMG = "encoder", "encoder, force sensor", "encoder, spring", ", EMG"

STRATEGIES: tuple[Strategy, ...] = (
    Strategy("no power", "", "unpowered", "no_control", ("nothing", "nothing")),
    Strategy("torque loop alone (zero impedance)", "knee", "zero_impedance", "zero_impedance", (FORCE, "spring")),
    Strategy("position control (CLPC)", "elbow", "clpc", None, (ENCODER, "")),
    Strategy("model by direction, no friction (PCFr)", "elbow", "pcfr", None, (ENCODER, "")),
    Strategy("model by direction, friction (FC)", "elbow", "fc", None, (ENCODER, "")),
    Strategy("model of one body", "elbow, knee", "transparent", "body", (ENCODER, ENCODER)),
    Strategy("model, kept from sticking by dither", "", "dithered", None, (ENCODER, "")),
    Strategy("model led by EMG", "elbow, knee", "emg", None, (ENCODER + EMG, "")),
    Strategy("model led by an adaptive oscillator", "elbow, knee", "oscillator", "oscillator", (ENCODER, ENCODER)),
    Strategy("model, fuzzy rules learnt beyond it", "knee", "fuzzy", "body_fuzzy", (ENCODER, ENCODER)),
    Strategy("model, network learnt beyond it", "knee", "neural", "body_neural", (ENCODER, ENCODER)),
    Strategy("nine fuzzy rules on the strap's torque", "knee", None, "fuzzy", ("", SPRING)),
    Strategy("network that learns while worn (RBF)", "knee", None, "rbf", ("", SPRING)),
    Strategy("sensitivity amplification", "knee", "amplification", "amplification", (ENCODER, ENCODER)),
    Strategy("disturbance observer", "", "disturbance_observer", "disturbance_observer", (FORCE, SPRING)),
    Strategy("PID on the strap's torque", "", None, "pid", ("", SPRING + EMG)),
    Strategy("model, strap's torque driven to zero", "elbow", "force_sensor", "residual_no_emg", (FORCE, SPRING)),
    Strategy("model led by EMG, torque to zero", "elbow, knee", "residual", "residual", (FORCE + EMG, SPRING + EMG)),
    Strategy("residual, gain by phase of a swing", "", None, "residual_by_phase", ("", SPRING + EMG)),
    Strategy("residual, strap learnt while worn", "", None, "residual_strap_learnt", ("", SPRING + EMG)),
)  # fmt: skip

ELBOW, SWINGS, WALKING = "elbow pointing", "knee swings", "knee walking"
"""What is done, in the order of the page."""

TASKS: dict[str, str] = {ELBOW: "elbow", SWINGS: "knee", WALKING: "knee"}
"""By task: whose controllers do it, an attribute of `Strategy`."""

RIVALS: dict[str, tuple[str, ...]] = {ELBOW: ("unpowered", "fc", "pcfr"), SWINGS: ("no_control", "zero_impedance"),
                                      WALKING: ("no_control", "zero_impedance")}  # fmt: skip
"""The simplest rivals, against which every controller's torque is also given."""


def of_task(task: str) -> dict[str, Strategy]:
    """The strategies of a task by their controllers."""
    return {name: one for one in STRATEGIES if (name := getattr(one, TASKS[task]))}


def senses(task: str, controller: str) -> str:
    """What a controller reads in a task."""
    return of_task(task)[controller].senses[0 if TASKS[task] == "elbow" else 1]
