"""What sets a strap apart from a spring and a damper, and how a rig does without."""

from __future__ import annotations

from collections.abc import Mapping

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "hardening": ("hardening",),
    "slack": ("slack",),
    "relaxing": ("relaxing_stiffness",),
    "creeping": ("mobility",),
    "askew": ("across", "along", "askew_spread"),
}
"""Constants of a strap by what they make of it; it is not there where they are 0."""


def without(*options: str) -> dict[str, float]:
    """Constants of a strap without these `OPTIONS`, or without any if none is named: what rigs take as `strapped`."""
    return {name: 0.0 for option in options or OPTIONS for name in OPTIONS[option]}
