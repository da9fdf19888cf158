"""What an exported controller costs: instructions and bytes on a Cortex-M4F in QEMU.

Instructions are counted, not timed: QEMU runs one a nanosecond of its own clock (-icount shift=0), SysTick counts that
clock, and the loop around the step is taken off. On hardware a step takes more cycles than instructions.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

from pellucid.controllers.control_law import LAWS
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.export.c_folder import write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.controllers.export.microcontroller import measure, missing_tools
from pellucid.controllers.residual_compensator import design
from pellucid.models.anthropometry import forearm
from pellucid.models.card import CardParameter
from pellucid.models.slider_joint import SliderCard

from ._size import sized

MEASURED_COUNT = sized(None, smallest=1)
"""Number of controllers that are measured, the first of all; None for every one."""

JOINT_LAW_VALUES = {
    "inertia": 0.05, "gravity_sine": 1.5, "gravity_cosine": 0.2, "offset": 0.1, "coulomb_positive": 0.3,
    "coulomb_negative": 0.25, "viscous_positive": 0.1, "viscous_negative": 0.08, "stribeck": 0.0,
    "stribeck_velocity": 0.0, "load_motoring": 0.15, "load_generating": 0.1, "square_root": 0.0,
    "velocity_width": 0.06,
    "gravity_share": 1.0, "friction_share": 0.8, "bandwidth": 200.0, "effort_limit": 5.0, "rate_limit": 250.0,
    "velocity_limit": 8.0, "position_min": -0.5, "position_max": 2.2, "stop_margin": 0.05, "max_age": 0.005,
    "max_repeats": 2.0, "period": 0.001,
}  # fmt: skip
"""Parameters and limits of the laws of one joint."""

WORN_COUPLING = Coupling(0.05, 0.02, 1.6, 0.05, 0.3, 0.1, 8.0, 14.0, 0.5, actuator_frequency=60.0, delay=0.002)
"""Coupling of limb and orthosis for which the worn law is designed."""

LOAD_CARD_VALUES = {
    "inertia": 0.032, "carriage_moment": -0.0045, "gravity": 1.15, "gravity_cosine": 0.26, "coulomb_positive": 0.26,
    "coulomb_negative": 0.21, "viscous_positive": 0.05, "viscous_negative": 0.04, "load_motoring": 0.13,
    "load_generating": 0.11,
}  # fmt: skip
"""Parameters of the elbow's card with friction by load."""

DIRECTION_CARD_VALUES = {
    "moment_slope": 0.48, "moment": 0.12, "cross_moment": 0.026, "coulomb": 0.25, "viscous": 0.05, "a0": 0.032,
    "a1": -0.009, "a2": 0.48,
}  # fmt: skip
"""Parameters of one direction of the elbow's card with two directions."""


def elbow_card(family: str) -> SliderCard:
    """An elbow with a carriage as `identify` would write it."""
    values = {
        "pooled": DIRECTION_CARD_VALUES,
        "dissociated": {f"{n}_{way}": x for way in ("up", "down") for n, x in DIRECTION_CARD_VALUES.items()},
        "load": LOAD_CARD_VALUES,
    }[family]
    return SliderCard(
        study="benchmark", family=family, method="", motion="rotary", effort_unit="N*m", lifts="flexion",
        parameters=tuple(CardParameter(n, "1", x, 0.0, (x, x)) for n, x in values.items()), covariance=(),
        known={"carriage_mass": 0.48} if family == "load" else {}, rail=(0.12, 0.27), drive={"gain": 1.0},
        heldout_error=None, residual_sd=0.0, processing="", confidence=0.95, notes=(), checksums={}, pellucid="",
        presliding_travel=CardParameter("presliding_travel", "rad", 3e-4, 3e-5, (2.4e-4, 3.6e-4)),
    )  # fmt: skip


def controllers() -> dict[str, ControllerValues]:
    """Every controller that can be exported, by its name."""
    worn = design(WORN_COUPLING, 0.002).control_law().values
    made = {
        law: ControllerValues(law, numbers, {}, (), {})
        for law, numbers in (("joint", LAWS["joint"].defaults | JOINT_LAW_VALUES), ("worn", worn))
    }
    for name, controller in ELBOW_CONTROLLERS.items():
        limb = {"limb": forearm(70.0, 1.75)} if controller.wearer else {}
        law = controller.build(elbow_card(controller.method), 0.2, **limb)
        made[name] = ControllerValues(law.kind, law.values, {}, (), {})
    return made


def run() -> list[dict]:
    """Rows for benchmarks.json; none, said so, where a tool is not installed."""
    absent = missing_tools()
    if absent:
        print(f"export: not measured, {', '.join(absent)} not installed")
        return []
    rows = []
    for name, values in islice(controllers().items(), MEASURED_COUNT):
        with TemporaryDirectory() as folder:
            found = measure(write_c_folder("benchmark", values, Path(folder)))
        note = f"Cortex-M4F in QEMU, {LAWS[values.law].title}; the costliest step {found.most}"
        code = f"code {found.code}, configuration {found.constants}; -O2"
        rows += [
            _row(name, "instructions_per_step", found.instructions, "1", note),
            _row(name, "bytes", found.bytes, "B", code),
            _row(name, "memory", found.memory, "B", "one context"),
            _row(name, "wrong", found.wrong, "1", f"steps of {found.steps} with a bit that differs from here"),
        ]
    return rows


def _row(law: str, name: str, value: float, unit: str, note: str) -> dict:
    return {"name": f"export.m4.{law}.{name}", "value": value, "unit": unit, "note": note}
