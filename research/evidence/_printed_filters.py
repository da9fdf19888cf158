"""Table I of ABLE with its printed filters, and with one filter on both sides.

The paper's sliding means are over 100 samples of current at 1 kHz and 40 of optical position at 179 Hz (section 3.3).
It does not state whether they are centred, or which filter the encoder's angle had. Both are taken as centred; the
angle is filtered once with 40 of its own samples (40 ms) and once with as much time as 40 optical frames take (223 ms).
Erratum A12 has the bias of trailing means. Robots are sampled around the committed rig.
"""

from collections.abc import Iterator

import numpy as np

from pellucid.joint.slider.slider_fit import SLIDER_METHODS
from pellucid.joint.slider.study.identify_slider import fit_slider
from pellucid.study.results import ResultRow
from pellucid_lab.elbow.protocol import trials
from pellucid_lab.elbow.rig import able_elbow, drawn_rigs
from pellucid_lab.papers.able.trials import COMPARED_PROTOCOLS, TRIAL_PREFIXES, numbered_names
from pellucid_lab.processes import ordered_results
from pellucid_lab.study import record_in_memory
from research.benchmarks._size import sized

SEED = 20261128
"""Seed of the simulated robots and of the recordings."""

ROBOT_COUNT = sized(3, smallest=1)
"""Number of drawn robots."""

PRINTED_MEANS = {"printed": (100, 40), "printed_frames": (100, 223)}
"""Samples of the sliding means at 1 kHz, of current and of position, by how the paper is read."""


def filter_rows(count: int = ROBOT_COUNT) -> Iterator[ResultRow]:
    """Every figure of the printed filters."""
    tried = ordered_results([(try_robot, i) for i in range(count)])
    for key, unit, words in (
        ("table1.ratio", "1", "mean current error without over with dissociation, the paper's 18 trials"),
        ("unseen.ratio", "1", "the same on 18 trials that were never fitted"),
        ("table1.with", "A", "mean current error with dissociation, the paper's 18 trials"),
        ("table1.without", "A", "mean current error without dissociation, the paper's 18 trials"),
        ("inertia_error", "%", "largest relative inertia error of one coherent body over the rail"),
        ("gravity_error", "%", "largest gravity error of one coherent body, of the largest gravity"),
    ):
        printed, frames, ours = (np.array([one[f][key] for one in tried]) for f in (*PRINTED_MEANS, "ours"))
        moved = printed - ours
        note = (
            f"{words}; sliding means as printed, mean of {count} robots ({printed.min():.3g} to {printed.max():.3g}); "
            f"with 40 optical frames of position {frames.mean():.3g} ({frames.min():.3g} to {frames.max():.3g}); one "
            f"low-pass on both sides {ours.mean():.3g} ({ours.min():.3g} to {ours.max():.3g}); printed less ours by "
            f"robot {moved.min():.3g} to {moved.max():.3g}"
        )
        name = f"mission.printed_filters.{key}"
        yield ResultRow(name, float(printed.mean()), unit, "evidence", "simulated", None, note)


def try_robot(index: int) -> dict[str, dict[str, float]]:
    """Return Table I and the errors of the body of simulated robot `index`, with the printed filters and with ours."""
    rig = drawn_rigs(able_elbow(), index + 1, seed=SEED)[index]
    made = tuple(t for t in trials(rig) if t.protocol in COMPARED_PROTOCOLS)
    config, recordings, _ = record_in_memory(rig, made, seed=SEED + index)
    tried = {"ours": config.processing}
    tried |= {n: config.processing.model_copy(update={"sliding_means": m}) for n, m in PRINTED_MEANS.items()}
    found = {}
    for name, processing in tried.items():
        fit = fit_slider(config.model_copy(update={"processing": processing}), recordings)
        errors = {
            method: {e.recording: e.current for e in fit.errors[method]} for method in SLIDER_METHODS
        }  # by recording [A]
        means = {}
        for which, prefixes in TRIAL_PREFIXES.items():
            names = numbered_names(tuple(errors["pooled"]), prefixes)
            means[which] = {m: float(np.mean([errors[m][n] for n in names])) for m in ("pooled", "dissociated")}
        x, q = np.linspace(*fit.rail, 7), np.linspace(rig["range"]["low"], rig["range"]["high"], 41)
        body = fit["consistent"]
        true = np.array([rig.gravity(s)[0] * np.sin(q) + rig.gravity(s)[1] * np.cos(q) for s in x])
        gravity = body.model.gravity(body.values, x[:, None], q[None, :])
        inertia = body.model.inertia(body.values, x) / np.array([rig.inertia(s) for s in x])
        found[name] = {
            "table1.ratio": means["published"]["pooled"] / means["published"]["dissociated"],
            "unseen.ratio": means["unseen"]["pooled"] / means["unseen"]["dissociated"],
            "table1.with": means["published"]["dissociated"],
            "table1.without": means["published"]["pooled"],
            "inertia_error": 100.0 * float(np.abs(inertia - 1.0).max()),
            "gravity_error": 100.0 * float(np.abs(gravity - true).max() / np.abs(true).max()),
        }
    return found
