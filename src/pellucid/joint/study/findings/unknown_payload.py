"""Finding: the payload of a recording that study.toml says to carry an unknown one."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ....study.pages.quantities import interval_text
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Report each unknown payload with its interval, or why it was not found."""
    for name, payload in case.payloads.items():
        if payload is None:
            yield Verdict(
                "warning",
                f"The payload of recording '{name}' cannot be found: that needs a rotary joint with free inertia and "
                "gravity, and efforts in N*m.",
                "State its mass and distance, or remove gravity and inertia from [model] known.",
            )
            continue
        share = f"It explains {100.0 * max(payload.explained, 0.0):.0f} % of what the joint without it misses there."
        mass, distance, weight, inertia = (
            interval_text(p, case.level) for p in (payload.mass, payload.distance, payload.weight, payload.inertia)
        )
        if not payload.is_told:
            text = f"No payload is certain in recording '{name}': its weight is {weight}, its inertia {inertia}."
            yield Verdict("warning", f"{text} {share}", "Look what else differs in it; or delete payload = {} there.")
            continue
        said, do = f"Recording '{name}' carries {weight} of weight and {inertia} of inertia", ""
        if payload.mass.trusted:
            said += f", as a point of {mass} at {distance} would"
            do = f'To fit it with the others, write payload = {{ mass = "{payload.mass.value:.4g} kg", '
            do += f'distance = "{payload.distance.value:.4g} m" }} there.'
        yield Verdict("note", f"{said}. {share}", do)
