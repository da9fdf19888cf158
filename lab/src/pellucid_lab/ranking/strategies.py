"""The strategies that are ranked, with their names in reviews and their controllers at either joint."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Strategy:
    """One strategy of transparent control."""

    name: str  # name in the literature
    reviewed: str  # papers that review it: "elbow", "knee" or both, as the papers of these robots; "" for none
    elbow: str | None  # controller at the elbow; None if there is none
    knee: str | None  # controller at the knee; None if there is none
    senses: tuple[str, str]  # sensors that it reads, at the elbow and at the knee
    arm: str | None = None  # controller at the arm of four joints; None if there is none
    arm_senses: str = ""  # sensors that it reads there


WITH_ENCODER = "encoder"
"""Sensors of a strategy with an encoder."""

WITH_FORCE = "encoder, force sensor"
"""Sensors of a strategy with an encoder and a force sensor."""

WITH_SPRING = "encoder, spring"
"""Sensors of a strategy with an encoder and the torque of a spring."""

EMG_SUFFIX = ", EMG"
"""Text that is appended for a strategy that also reads EMG."""

RANKED_STRATEGIES: tuple[Strategy, ...] = (
    Strategy("no power", "", "unpowered", "no_control", ("nothing", "nothing"), "unpowered", "nothing"),
    Strategy("torque loop alone (zero impedance)", "knee", "zero_impedance", "zero_impedance", (WITH_FORCE, "spring")),
    Strategy("position control (CLPC)", "elbow", "clpc", None, (WITH_ENCODER, "")),
    Strategy("model by direction, no friction (PCFr)", "elbow", "pcfr", None, (WITH_ENCODER, "")),
    Strategy("model by direction, friction (FC)", "elbow", "fc", None, (WITH_ENCODER, "")),
    Strategy("model of all bodies, friction (FC)", "", None, None, ("", ""), "fc", WITH_ENCODER),
    Strategy("model of all bodies, four fifths of friction", "", None, None, ("", ""), "carried", WITH_ENCODER),
    Strategy(
        "model of one body, or of all",
        "elbow, knee",
        "transparent",
        "body",
        (WITH_ENCODER, WITH_ENCODER),
        "transparent",
        WITH_ENCODER,
    ),
    Strategy("model, kept from sticking by dither", "", "dithered", None, (WITH_ENCODER, "")),
    Strategy("model led by EMG", "elbow, knee", "emg", None, (WITH_ENCODER + EMG_SUFFIX, "")),
    Strategy(
        "model led by an adaptive oscillator", "elbow, knee", "oscillator", "oscillator", (WITH_ENCODER, WITH_ENCODER)
    ),
    Strategy("model, fuzzy rules learnt beyond it", "knee", "fuzzy", "body_fuzzy", (WITH_ENCODER, WITH_ENCODER)),
    Strategy("model, network learnt beyond it", "knee", "neural", "body_neural", (WITH_ENCODER, WITH_ENCODER)),
    Strategy("nine fuzzy rules on the strap's torque", "knee", None, "fuzzy", ("", WITH_SPRING)),
    Strategy("network that learns while worn (RBF)", "knee", None, "rbf", ("", WITH_SPRING)),
    Strategy("model, part of the limb's weight carried", "", "support", None, (WITH_ENCODER, "")),
    Strategy("sensitivity amplification", "knee", "amplification", "amplification", (WITH_ENCODER, WITH_ENCODER)),
    Strategy("disturbance observer", "", "disturbance_observer", "disturbance_observer", (WITH_FORCE, WITH_SPRING)),
    Strategy("PID on the strap's torque", "", None, "pid", ("", WITH_SPRING + EMG_SUFFIX)),
    Strategy(
        "model, strap's torque driven to zero",
        "elbow",
        "force_sensor",
        "residual_no_emg",
        (WITH_FORCE, WITH_SPRING),
        "force_sensors",
        WITH_FORCE,
    ),
    Strategy(
        "model led by EMG, torque to zero",
        "elbow, knee",
        "residual",
        "residual",
        (WITH_FORCE + EMG_SUFFIX, WITH_SPRING + EMG_SUFFIX),
    ),
    Strategy("residual, gain by phase of a swing", "", None, "residual_by_phase", ("", WITH_SPRING + EMG_SUFFIX)),
    Strategy("residual, strap learnt while worn", "", None, "residual_strap_learnt", ("", WITH_SPRING + EMG_SUFFIX)),
)
"""All strategies of the ranking."""

POINTING_TASK = "elbow pointing"
"""Task of pointing with the elbow."""

SWING_TASK = "knee swings"
"""Task of swinging the shank."""

WALKING_TASK = "knee walking"
"""Task of walking with the knee orthosis."""

REACHING_TASK = "arm reaching"
"""Task of reaching with an arm of four joints."""

CONTROLLER_FIELDS: dict[str, str] = {
    POINTING_TASK: "elbow", SWING_TASK: "knee", WALKING_TASK: "knee", REACHING_TASK: "arm"
}  # fmt: skip
"""Tasks in the order of the page, each with the attribute of `Strategy` that holds its controller."""

SIMPLE_RIVALS: dict[str, tuple[str, ...]] = {
    POINTING_TASK: ("unpowered", "fc", "pcfr"),
    SWING_TASK: ("no_control", "zero_impedance"),
    WALKING_TASK: ("no_control", "zero_impedance"),
    REACHING_TASK: ("unpowered", "fc"),
}
"""Reference controllers of each task. Every controller's torque is also given relative to theirs."""


def strategies_of_task(task: str) -> dict[str, Strategy]:
    """Return the strategies of a task by their controllers."""
    return {name: one for one in RANKED_STRATEGIES if (name := getattr(one, CONTROLLER_FIELDS[task]))}


def controller_words(task: str, controller: str) -> str:
    """Return a controller's name in a ranking: its strategy's, or the file of a foreign law."""
    known = strategies_of_task(task)
    return known[controller].name if controller in known else f"{controller.removeprefix('law:')} (foreign law)"


def sensors_read(task: str, controller: str) -> str:
    """Return the sensors that a controller reads in a task."""
    robot, known = CONTROLLER_FIELDS[task], strategies_of_task(task)
    if controller not in known:
        return WITH_SPRING if robot == "knee" else WITH_FORCE
    one = known[controller]
    return one.arm_senses if robot == "arm" else one.senses[0 if robot == "elbow" else 1]
