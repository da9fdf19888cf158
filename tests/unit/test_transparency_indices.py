"""Indices of transparency: each defined once, 0 of a session against itself where it is a change, and comparable."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.pointing.session import Unpowered
from pellucid_lab.ranking.elbow import point
from pellucid_lab.ranking.transparency_indices import (
    ELBOW_PAPER,
    TRANSPARENCY_INDICES,
    IndexComparison,
    index_values,
    see,
)


def test_there_are_twenty_of_every_kind_with_sources():
    assert len({index.name for index in TRANSPARENCY_INDICES}) == len(TRANSPARENCY_INDICES) >= 20
    kinds = {index.kind for index in TRANSPARENCY_INDICES}
    assert kinds == {"kinematic", "smoothness", "interaction", "energy", "EMG", "statistical"}
    assert all(index.source and index.words and index.unit for index in TRANSPARENCY_INDICES)


def test_a_change_is_none_against_itself_and_grows_with_a_heavy_robot():
    rig = elbow_participants(able_elbow())
    person = draw_people(rig, np.random.default_rng(2), count=1)[0]
    free, worn = point(rig, person, None, [1, 0]), point(rig, person, Unpowered(), [1, 0])
    same, heavy = index_values(free, free), index_values(worn, free)
    against = [i.name for i in TRANSPARENCY_INDICES if i.kind in ("kinematic", "smoothness", "EMG", "statistical")]
    assert all(same[name] == pytest.approx(0.0, abs=1e-9) for name in against)
    assert all(heavy[name] > 0.0 for name in ("duration", "peak_velocity", "torque_rms", "taken", "emg_per_acc_up"))


@pytest.fixture(scope="module")
def free():
    rig = elbow_participants(able_elbow())
    person = draw_people(rig, np.random.default_rng(2), count=1)[0]
    return point(rig, person, None, [1, 0])


@pytest.mark.parametrize("gravity", [0.0, 0.5, -0.5])
@pytest.mark.parametrize("phase", [0.0, 0.7])
@pytest.mark.parametrize("stiffness", [0.0, 0.8])
@pytest.mark.parametrize("inertia", [0.0, 0.03])
def test_apparent_inertia_is_inertia_whatever_depends_on_the_angle(free, gravity, phase, stiffness, inertia):
    """A massless robot with residual gravity, or a spring, has no inertia; 0.03 kg*m^2 more are 0.03 more."""
    s = free.signals
    felt = gravity * np.sin(s["position"] + phase) + stiffness * (s["position"] - 1.5) + inertia * s["acceleration"]
    felt = felt + 0.04 * s["velocity"] + 0.2 * np.tanh(s["velocity"] / 0.05)
    found = index_values(replace(free, signals={**s, "interaction": felt}), free)
    assert found["apparent_inertia"] == pytest.approx(inertia, abs=5e-4)
    assert found["apparent_viscosity"] == pytest.approx(0.04, abs=1e-3)
    assert found["apparent_friction"] == pytest.approx(0.2, abs=1e-3)


def test_only_what_the_paper_tests_is_attributed_to_it():
    assert {i.name for i in TRANSPARENCY_INDICES if i.source == ELBOW_PAPER} == {
        "duration", "peak_velocity", "isochrony", "emg_per_acc_up",
    }  # fmt: skip


def test_smoothness_is_that_of_an_assessment(free):
    from pellucid.people.indices import smoothness

    seen = see(free)
    reversed_motion = replace(seen.motion, velocity=0.5 * seen.motion.velocity)
    other = replace(seen, motion=reversed_motion)
    for name in ("sparc", "ldlj"):
        index = next(i for i in TRANSPARENCY_INDICES if i.name == name)
        mean = np.mean([smoothness(seen.motion, m)[name] for m in seen.found])
        assert index.value(seen, other) == pytest.approx(0.0, abs=1e-9)  # whatever the size
        assert seen.mean(lambda m, name=name: smoothness(seen.motion, m)[name]) == pytest.approx(mean)


def test_agreement_is_kendalls_tau_as_scipy_has_it():
    rng = np.random.default_rng(4)
    values = {i.name: rng.standard_normal((1, 9)) for i in TRANSPARENCY_INDICES}
    found = IndexComparison(tuple("abcdefghi"), values)
    expected = stats.kendalltau(values["torque_rms"][0], values["taken"][0]).statistic
    assert found.agreement("torque_rms", "taken") == pytest.approx(expected)


def test_agreement_is_of_ranks_and_a_missing_value_is_last():
    values = {i.name: np.array([[1.0, 2.0, 3.0], [1.5, 2.0, 4.0]]) for i in TRANSPARENCY_INDICES}
    values["duration"] = np.array([[3.0, 2.0, np.nan], [3.0, 2.0, np.nan]])
    found = IndexComparison(("a", "b", "c"), values)
    assert found.ranks("duration").tolist() == [2.0, 1.0, 3.0]
    assert found.agreement("torque_rms", "taken") == pytest.approx(1.0)
    assert found.agreement("torque_rms", "duration") == pytest.approx(1.0 / 3.0)
    assert found.order("duration") == ("b", "a", "c")
    assert found.concordance("torque_rms") == pytest.approx(1.0)


def test_the_page_of_docs_has_what_was_measured_of_every_index_once():
    page = (Path(__file__).parents[2] / "docs" / "transparency-indices.md").read_text(encoding="utf-8")
    for index in TRANSPARENCY_INDICES:
        assert page.count(f"| `{index.name}` | {index.kind} |") == 1, index.name
