"""From the card of a joint with a carriage to the numbers of a law of a worn elbow robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from hashlib import sha256

from .._errors import PellucidError
from ..controllers.elbow_laws import (
    ELBOW_LIMITS,
    ElbowLaw,
    full_compensation,
    partial_compensation,
    position_control,
    sensitivity_amplification,
    transparent,
    with_force_sensor,
    with_oscillator,
)
from ..models.slider_card import read_slider_card
from ..recordings.study import Study
from .controller_values import ControllerValues
from .joint_values import PERIOD, SLIDER_SPEED
from .study_limits import limits_of

ELBOW_CONTROLLERS: Mapping[str, tuple[str, Callable[..., ElbowLaw]]] = {
    "clpc": ("slider.pooled.json", position_control),
    "pcfr": ("slider.dissociated.json", partial_compensation),
    "fc": ("slider.dissociated.json", full_compensation),
    "transparent": ("slider.load.json", transparent),
    "force_sensor": ("slider.load.json", lambda *card, **settings: with_force_sensor(transparent(*card, **settings))),
    "oscillator": ("slider.load.json", lambda *card, **settings: with_oscillator(transparent(*card, **settings))),
    "amplification": ("slider.load.json", sensitivity_amplification),
}
"""By the name that `--controller` takes: the card that it needs, and what makes it of that card."""


def elbow_values(
    study: Study, controller: str, *, slider: float | None = None, period: float | None = None
) -> ControllerValues:
    """A law of a worn elbow robot for one study.

    Parameters
    ----------
    study : Study
        Identified, of a joint with a carriage.
    controller : str
        A name of `ELBOW_CONTROLLERS`.
    slider : float or None
        Where the carriage is [m]; None: the middle of its rail.
    period : float or None
        Of the controller [s]; None: 1 ms.

    Returns
    -------
    ControllerValues

    Raises
    ------
    PellucidError
        If there is no such controller or card, or the carriage is off its rail.
    """
    if controller not in ELBOW_CONTROLLERS:
        known = ", ".join(ELBOW_CONTROLLERS)
        raise PellucidError(f'export of {study.name}: found the controller "{controller}", expected one of {known}')
    name, build = ELBOW_CONTROLLERS[controller]
    path = study.models_dir / name
    card = read_slider_card(path)
    low, high = card.rail
    place = 0.5 * (low + high) if slider is None else slider
    if not low <= place <= high:
        raise PellucidError(f"{name}: found the carriage at {place:g} m, expected {low:g} to {high:g} m")
    limits, notes = limits_of(study, ELBOW_LIMITS)
    law = build(card, place, limits=limits, period=PERIOD if period is None else period)
    return ControllerValues(
        law=law.kind,
        numbers={key: float(value) for key, value in law.values.items()},
        remarks=dict.fromkeys(law.values, f"by the law {controller} from {name}"),
        cards=(name,),
        checksums={name: sha256(path.read_bytes()).hexdigest()},
        speed=SLIDER_SPEED,
        notes=(*notes, f"The carriage is at {place:.4g} m: inertia and gravity hold there only."),
    )
