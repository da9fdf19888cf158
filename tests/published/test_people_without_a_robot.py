"""People who hold as well as reach, without a robot: as quick as the control condition's, over five drawn studies."""

import numpy as np
import pytest

from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_people
from pellucid_lab.pointing.session import simulate_sessions
from pellucid_lab.pointing.session_indices import PUBLISHED_RULE, session_indices


def test_they_are_as_quick_as_those_of_the_paper():
    rig, found = elbow_people(), []
    lifts = np.deg2rad([12, 24, 36, 48, 60] * 2)
    for seed in range(1, 6):
        rng = np.random.default_rng(seed)
        people = draw_people(rig, rng)
        made = simulate_sessions([(rig, p, "Ctrl", None, g, lifts) for p, g in zip(people, rng.spawn(6), strict=True)])
        means = [session_indices(s).means[PUBLISHED_RULE] for s in made]
        found.append([[m.duration, m.vmax] for m in means])
    # Tables III and IV.
    assert np.mean(found, axis=(0, 1)) == pytest.approx([0.957, 1.416], rel=0.05)
    between = np.std(found, axis=1, ddof=1).mean(axis=0)
    assert between == pytest.approx([0.199, 0.326], rel=0.25)
