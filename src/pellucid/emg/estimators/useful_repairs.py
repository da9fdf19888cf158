"""Repair only the channels whose change costs an estimator's torque, so that it gets no worse by a repair.

A repair by the first seconds of a recording is itself uncertain: it scales a channel to the range that it had in other
strides. An estimator that hardly uses the channel has nothing to gain by it. A channel is therefore repaired for an
estimator only if its repair moves the estimated torque by more than `MAX_WATCHED_LOSS` of the fitted torque's variance,
the same share at which a running estimator replaces a channel. The measured torque of the recording is not used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..models.emg_estimator import MAX_WATCHED_LOSS
from .torque_trial import TorqueTrial


def apply_useful_repairs(
    predict: Callable[[TorqueTrial], np.ndarray],
    fitted: Sequence[TorqueTrial],
    recorded: TorqueTrial,
    repaired: TorqueTrial,
) -> tuple[TorqueTrial, tuple[str, ...]]:
    """Return the trial with those channels repaired that matter to an estimator, and their names.

    Parameters
    ----------
    predict : callable
        Estimated torque of a trial, shape (n,) [N m].
    fitted : sequence of TorqueTrial
        Trials that the estimator was fitted to.
    recorded, repaired : TorqueTrial
        The trial as it was recorded, and with all its changed channels repaired.

    Returns
    -------
    trial : TorqueTrial
        The recorded trial itself if no repair matters.
    muscles : tuple of str
        Muscles whose channels are repaired in it.
    """
    moved = [m for m, x in recorded.envelopes.items() if not np.array_equal(x, repaired.envelopes[m])]
    if not moved:
        return recorded, ()
    variance = float(np.var(np.concatenate([t.torque for t in fitted])))
    usual, kept = predict(replace(recorded, lead={})), []
    for muscle in moved:
        one = replace(recorded, envelopes={**recorded.envelopes, muscle: repaired.envelopes[muscle]}, lead={})
        if float(np.mean((predict(one) - usual) ** 2)) > MAX_WATCHED_LOSS * variance:
            kept.append(muscle)
    if not kept:
        return recorded, ()
    envelopes = {m: (repaired if m in kept else recorded).envelopes[m] for m in recorded.envelopes}
    return replace(recorded, envelopes=envelopes, lead={}), tuple(kept)
