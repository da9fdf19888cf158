"""The card of a torque map that a robot can run: an offset, and a coefficient for every feature or product of two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from math import nan, prod

from ...._errors import PellucidError
from ....models.card import CardParameter
from ....models.parameter_card import ParameterCard
from ....study.study import Study
from ...estimators.features import CAUSAL_MOTION_LOWPASS_HZ, MOTION_LOWPASS_HZ, compute_features
from ...estimators.torque_map import TorqueMap
from ...estimators.torque_trial import TorqueTrial
from .emg_torque_table import EmgTorqueTable
from .relative_envelopes import is_relative

PRODUCT_SEPARATOR = " * "
"""Separator of the two factors in a term's name."""

_MOTION_UNITS = {"angle": "rad", "velocity": "rad/s", "acceleration": "rad/s^2"}
"""Unit of each feature of motion, by the first part of its name."""


def torque_card(study: Study, found: TorqueMap, trials: Sequence[TorqueTrial], name: str) -> ParameterCard:
    """Return the card of a map by ridge regression."""
    if not hasattr(found.regressor, "unscaled_coefficients"):
        raise PellucidError(f"card {name}: found a map by {found.name}, expected one by ridge regression")
    seen = compute_features(trials[0], found.choice.features, causal=found.causal)
    chain = study.table(EmgTorqueTable).chain
    envelope, torque = "1" if is_relative(study) else "V", trials[0].unit

    def unit(term: str) -> str:
        factors = [_MOTION_UNITS.get(factor.split(".")[0], envelope) for factor in term.split(PRODUCT_SEPARATOR)]
        below = PRODUCT_SEPARATOR.strip().join(factor for factor in factors if factor != "1")
        return f"{torque}/({below})" if below and term != "offset" else torque

    lowpass = CAUSAL_MOTION_LOWPASS_HZ if found.causal else MOTION_LOWPASS_HZ
    return ParameterCard(
        kind="torque_map",
        study=study.name,
        name=name,
        parameters=tuple(
            CardParameter(term, unit(term), value, nan, (nan, nan), False, True)
            for term, value in found.regressor.unscaled_coefficients(seen.names).items()
        ),
        settings={
            "joint": trials[0].joint,
            "participant": trials[0].participant or "",
            "chain": chain,
            "causal": found.causal,
            "motion_lowpass": lowpass,
            "motion_order": 2 if found.causal else 4,
            "penalty": float(found.regressor.alpha),
        },
        processing=f"sees {found.choice.words}; angles low-passed at {lowpass:g} Hz before they are differentiated",
        checksums={trial.name: trial.checksum for trial in trials},
        pellucid=version("pellucid"),
    )


def predict_by_card(card: ParameterCard, values: Mapping[str, float]) -> float:
    """Return the torque that a card predicts from `values` of its features by name [N m]."""
    terms = {name: name.split(PRODUCT_SEPARATOR) for name in card.values if name != "offset"}
    missing = sorted({factor for factors in terms.values() for factor in factors} - set(values))
    if missing:
        raise PellucidError(f"the card {card.name} needs {', '.join(missing)}; found {', '.join(sorted(values))}")
    return card.values["offset"] + sum(
        card.values[name] * prod(values[factor] for factor in factors) for name, factors in terms.items()
    )
