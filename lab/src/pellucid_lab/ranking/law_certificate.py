"""Certificate of one controller: comparison of simulated people's movement with it and without a robot.

The test is that of `pellucid assess`, for the simulated people of a ranking, each with their own robot. No study
states the margins; they are those of the virtual rigs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pellucid.people.analysis import Analysis
from pellucid.people.certificate import CANNOT_SAY, FAIL, PASS, Certificate, PeoplesChanges, decide
from pellucid.people.share_of_people import MIN_PEOPLE, TOO_FEW

from .tried import ControllerTrial

LAW_ANALYSIS = Analysis(margins={"duration": 0.10, "peak_velocity": 0.10}, where="rank")
"""Analysis of a ranking: the attributes of `ControllerTrial` that are tested, as ratios to movements without a robot.

The same person's durations differ by 7 % from movement to movement."""

CERTIFICATE_VALUES = {PASS: 1.0, CANNOT_SAY: 0.5, FAIL: 0.0}
"""Value in results.json of each verdict."""


def certify_controller(tried: Sequence[ControllerTrial]) -> Certificate | None:
    """Return the certificate of a controller from its trials on several people, the mean being tested.

    None where the changes are not known of everybody: a task without them, or a person who never arrived; and of one
    person alone, of whom no test knows how people differ.
    """
    if len(tried) < 2:
        return None
    seen = {name: [getattr(one, name) for one in tried] for name in LAW_ANALYSIS.margins}
    if not all(value is not None and np.isfinite(value) for values in seen.values() for value in values):
        return None
    points = LAW_ANALYSIS.end_points()
    return decide(
        LAW_ANALYSIS,
        {name: PeoplesChanges(point.margin, np.log1p(np.array(seen[name], float) / 100.0))
         for name, point in points.items()},
    )  # fmt: skip


def certificate_note(found: Certificate, people: int) -> str:
    """Return what a certificate says of each end point of a number of `people`."""
    changes = (f"{name} {100.0 * np.expm1(one.estimate):+.1f} %" for name, one in found.end_points.items())
    return f"{found.verdict}; means of {people} people: {', '.join(changes)}; margins 10 %"


def certificate_words(tried: Sequence[ControllerTrial]) -> str:
    """Return a certificate's verdict in words, and why it cannot say anything where people are too few."""
    found = certify_controller(tried)
    if found is None:
        return f"{CANNOT_SAY}: one person" if len(tried) == 1 else CANNOT_SAY
    few = found.verdict == CANNOT_SAY and any(found.people_answer(name) == TOO_FEW for name in found.end_points)
    return f"{found.verdict}: too few, {len(tried)} of {MIN_PEOPLE} people" if few else found.verdict
