"""Bounds behind the badges of answers: what "yes" and "no" mean where no test decides, and where each bound comes from.

They are conventions, not measurements. A question on a page therefore states its bound, so that a reader who needs
another one can see it beside the number. Badges without a bound here follow a test or a comparison: the certificate
(margins of study.toml), `rank` (a test against every simple rival), EMG beside angles and beside force (an interval
against what the study stated), Hill's muscle (the error of a rigid tendon), papers (every printed figure).
"""

from __future__ import annotations

MAX_GOOD_ERROR = 20.0
"""Largest held-out error of a good prediction [% of the RMS effort].

The bound leaves 4 % of the power of the effort unexplained. A controller that compensates the model leaves at most a
fifth of the joint's own effort to the wearer. The public data sets of single joints lie between 5 and 12 %.
"""

SOUND_R2 = 0.8
"""A model explains the effort if its R2 is above this: a constant effort makes the RMS effort large, and R2 does not
count it."""

MAX_BODY_ERROR_RATIO = 1.1
"""One body predicts as well as two directions if its error is at most this many times theirs: it has ten parameters in
place of sixteen."""

MIN_EXPLAINED_PERCENT = 50.0
"""A strap explains the angle between limb and orthosis if it explains at least this share of it held out: more than is
left unexplained."""
