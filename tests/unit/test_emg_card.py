"""The card of a wearer's causal EMG map, from what they do on the virtual orthosis."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid.emg.estimators.causal_map import CausalMap
from pellucid.orthosis.strap.strap_model import KELVIN_VOIGT, Limb, Orthosis
from pellucid.orthosis.study.coupling.cards import emg_card, emg_cards
from pellucid_lab.knee.protocol import torque_trial
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.strap_options import without_strap_options
from pellucid_lab.study import record_in_memory

RIG = knee_orthosis().strapped(without_strap_options())
"""Whose straps are what is fitted: springs with dampers. What straps as they are do to it, others test."""
S1 = RIG.subjects["S1"]
STEPS = [torque_trial(RIG, f"S1_torque_{a}_{i}", S1, float(np.radians(a))) for i in (1, 2) for a in (30, 60)]


@pytest.fixture(scope="module")
def steps():
    return record_in_memory(RIG, STEPS, seed=5)[1]


@pytest.fixture(scope="module")
def known():
    """Orthosis, limb and strap as they are."""
    strap = KELVIN_VOIGT.core({name: S1.strap[name] for name in ("stiffness", "damping")})
    gravity = float(np.hypot(*RIG.orthosis_gravity))
    return {
        "orthosis": Orthosis(RIG["orthosis"]["inertia"], RIG["orthosis"]["bearing_viscous"], gravity),
        "limb": Limb(S1.inertia, S1.gravity),
        "coupling": SimpleNamespace(plain=strap),
    }


def test_two_repetitions_give_a_card_that_the_core_runs(steps, known):
    card = emg_card("virtual", "S1", steps, "emg", **known)
    assert card.name == "S1.emg"
    assert card.settings["participant"] == "S1"
    assert set(card.checksums) == {r.name for r in steps}
    found = CausalMap.from_card(card)
    assert found.muscles == tuple(RIG["emg"]["muscles"])
    assert found.rmse < 2.5
    core = found.build()
    core.listen(np.column_stack([steps[0].streams["emg"][f"emg.{m}"] for m in found.muscles])[:20_000])
    assert np.isfinite(core.torque(0.5))


def test_without_a_limb_or_a_second_repetition_there_is_none(steps, known):
    assert emg_card("virtual", "S1", steps[:2], "emg", **known) is None
    assert emg_card("virtual", "S1", steps, "emg", **{**known, "limb": None}) is None
    assert emg_card("virtual", "S1", [replace(r, streams={}) for r in steps], "emg", **known) is None


def test_everybody_who_has_one_gets_a_card_of_their_own(steps, known):
    study = SimpleNamespace(name="virtual", table=lambda kind: kind(emg="emg"))
    found = SimpleNamespace(limb=SimpleNamespace(limb=known["limb"]), coupling=known["coupling"])
    nobody = SimpleNamespace(limb=None, coupling=known["coupling"])
    made = emg_cards(study, steps, known["orthosis"], {"S1": found, "S2": nobody})
    assert list(made) == ["S1.emg"]
