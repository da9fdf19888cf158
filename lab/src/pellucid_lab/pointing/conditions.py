"""Conditions of the pointing experiment: control laws that are built from an identification of the robot alone.

The exponents k of the published compensation [1]_, equation 8, are chosen by five people who take no other part. The
paper asked its testers for resistance and shaking; virtual testers choose the smallest interaction torque, which
contains both.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
transparency
   of a robotic upper limb exoskeleton", Robotica 39, 2021.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pellucid._errors import PellucidError, StudyError
from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, ELBOW_CONTROLLERS, UNDITHERED_CONTROLLER
from pellucid.controllers.elbow_laws import full_compensation
from pellucid.controllers.transparent_laws import known_travel
from pellucid.joint.slider.slider_fit import SliderFit
from pellucid.joint.slider.study.identify_slider import fit_slider
from pellucid.joint.slider.study.slider_result import slider_card
from pellucid.models.slider_joint import SliderCard
from pellucid.people.movements import MovementRule, movements

from ..elbow.protocol import trials
from ..elbow.rig import ElbowRig
from ..processes import tell_job_share
from ..study import record_in_memory
from .people import Person, draw_people
from .session import CONTROL_CONDITION, Conditions, PointingSession, simulate_sessions, true_motion

if TYPE_CHECKING:
    from .plant import PointingPlant

EXPONENT_CANDIDATES = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0)
"""Exponents k of equation 8 [1]_ from which one is chosen for each direction."""

TUNER_COUNT = 5
"""Number of people who choose the exponents, as in the paper; they take no other part."""

TUNING_SEED = 900
"""Seed that draws these people and their noise; the experiment draws its people with other seeds."""

Cards = Mapping[str, SliderCard]
"""Identified cards of a robot, by the method that identified them."""


def identify_robot(robot: ElbowRig, *, seed: int = 1) -> tuple[SliderFit, Cards]:
    """Record and identify a robot; return the fit, and its cards by method.

    `seed` draws the noise of the recordings.
    """
    protocols = ("constant_velocity", "swept_sine", "slow", "reversals")
    identification = tuple(trial for trial in trials(robot) if trial.protocol in protocols)
    config, recordings, _ = record_in_memory(robot, identification, seed=seed, keep=lambda taken: None)
    fit = fit_slider(config, recordings)
    return fit, {method: slider_card(config, fit, estimate) for method, estimate in fit.estimates.items()}


def identify_cards(robot: ElbowRig, *, seed: int = 1) -> Cards:
    """Return the cards of `identify_robot`."""
    return identify_robot(robot, seed=seed)[1]


def controller_builder(
    cards: Cards, controller: str, *, exponents: tuple[float, float] | None = None, **settings
) -> Callable[[Person, float], ControlLaw]:
    """Return a function that builds a controller for a person and the place of the carriage [m].

    Parameters
    ----------
    cards : mapping
        Cards of the robot by method.
    controller : str
        Name of a controller of `ELBOW_CONTROLLERS`.
    exponents : tuple of float, optional
        Exponents k of equation 8, upwards and downwards; ignored by controllers without them.
    **settings
        Further settings of the control law.
    """
    entry = ELBOW_CONTROLLERS[controller]
    if exponents is not None and entry.exponents:
        settings["exponents"] = exponents

    def build(person: Person, place: float) -> ControlLaw:
        limb = {"limb": person.forearm} if entry.wearer else {}
        return entry.build(cards[entry.method], place, **limb, **settings)

    return build


def offered_controller(cards: Cards, controller: str) -> str:
    """Return the name of a controller, or of its form without dither if the robot's card does not permit dither."""
    if controller != BEST_CONTROLLER:
        return controller
    try:
        known_travel(cards[ELBOW_CONTROLLERS[controller].method])
    except PellucidError:
        return UNDITHERED_CONTROLLER
    return controller


def published_conditions(cards: Cards, exponents: tuple[float, float]) -> Conditions:
    """Return the paper's four conditions; `exponents` are k of equation 8, upwards and downwards."""
    return {
        CONTROL_CONDITION: None,
        "FC": controller_builder(cards, "fc", exponents=exponents),
        "PCFr": controller_builder(cards, "pcfr", exponents=exponents),
        "CLPC": controller_builder(cards, "clpc"),
    }


def interaction_rms(session: PointingSession, direction: int = 0) -> float:
    """Return the RMS interaction torque of a movement, averaged over the movements of a session [N*m].

    `direction` selects movements upwards (1), downwards (-1) or all (0). The result is NaN where no movement ended.
    """
    torques = []
    rule = MovementRule()
    for movement in movements(*true_motion(session, rule), rule)[0]:
        if direction in (0, movement.direction):
            part = slice(movement.first, movement.last + 1)
            torques.append(np.sqrt(np.mean(session.signals["interaction"][part] ** 2)))
    return float(np.mean(torques)) if torques else float("nan")


def _interaction_both_ways(session: PointingSession) -> tuple[float, float]:
    """Return the RMS interaction torque of the movements of a session upwards and downwards [N*m]."""
    return interaction_rms(session, 1), interaction_rms(session, -1)


def choose_exponents(
    rig: PointingPlant, cards: Cards, *, seed: int = TUNING_SEED, threads: int = 1
) -> tuple[tuple[float, float], dict[float, tuple[float, float]]]:
    """Choose k of equation 8 upwards and downwards: the candidates with the smallest interaction torque.

    Returns
    -------
    exponents : tuple of float
        The chosen exponents, upwards and downwards.
    torques : dict
        For each candidate the interaction torque upwards and downwards, mean over `TUNER_COUNT` people [N*m]; infinite
        where no movement of a person ended.
    """
    people = draw_people(rig, np.random.default_rng(seed), count=TUNER_COUNT)
    lifts = np.deg2rad(rig["pointing"]["amplitudes"])
    torques = {}
    for k in EXPONENT_CANDIDATES:
        jobs = []
        for person, rng in zip(people, np.random.default_rng(seed).spawn(TUNER_COUNT), strict=True):
            law = full_compensation(cards["dissociated"], person.slider(rig), exponents=(k, k))
            jobs.append((rig, person, "FC", law, rng, lifts))
        found = simulate_sessions(jobs, threads=threads, then=_interaction_both_ways)
        mean = (float(np.mean(torque)) for torque in zip(*found, strict=True))
        torques[k] = tuple(np.inf if np.isnan(torque) else torque for torque in mean)
        tell_job_share(len(torques) / len(EXPONENT_CANDIDATES))
    return tuple(min(EXPONENT_CANDIDATES, key=lambda k: torques[k][i]) for i in (0, 1)), torques


def build_study_conditions(rig: PointingPlant, names: Sequence[str] | None = None, *, seed: int = 1) -> Conditions:
    """Identify the rig's robot and return the conditions: those of the controllers `names`, or the paper's four.

    Raises
    ------
    StudyError
        If a controller is not known, or is named twice.
    """
    unknown = [name for name in names or () if name not in ELBOW_CONTROLLERS]
    if unknown or len(set(names or ())) < len(names or ()):
        found = f'found no controller "{unknown[0]}"' if unknown else "found a controller twice"
        raise StudyError(f"conditions: {found}, expected some of {', '.join(ELBOW_CONTROLLERS)}")
    cards = identify_cards(rig.robot, seed=seed)
    if BEST_CONTROLLER in (names or ()):
        known_travel(
            cards[ELBOW_CONTROLLERS[BEST_CONTROLLER].method]
        )  # refuse now rather than after an hour of simulation
    has_exponents = not names or any(ELBOW_CONTROLLERS[name].exponents for name in names)
    exponents = choose_exponents(rig, cards, threads=2)[0] if has_exponents else None
    if not names:
        return published_conditions(cards, exponents)
    return {CONTROL_CONDITION: None, **{name: controller_builder(cards, name, exponents=exponents) for name in names}}
