"""Effects that set a virtual strap apart from a spring with a damper, and how a rig switches them off."""

from __future__ import annotations

from collections.abc import Mapping

STRAP_OPTIONS: Mapping[str, tuple[str, ...]] = {
    "hardening": ("hardening",),
    "slack": ("slack",),
    "relaxing": ("relaxing_stiffness",),
    "creeping": ("mobility",),
    "askew": ("across", "along", "askew_spread"),
}
"""The constants of a strap that produce each effect; the strap lacks the effect where all of them are 0."""


def without_strap_options(*options: str) -> dict[str, float]:
    """Return strap constants that switch the named `STRAP_OPTIONS` off, or all of them if none is named.

    A rig's method ``strapped`` takes the result.
    """
    return {name: 0.0 for option in options or STRAP_OPTIONS for name in STRAP_OPTIONS[option]}
