"""The report of activations: first the scores of removed electrodes, then torques and activations."""

from __future__ import annotations

from ....study.drawing.drawing import draw
from ....study.pages.page import Page, Section
from ....study.pages.quantities import typeset_sentence
from ....study.procedures.study_page import figure_tables, paper_step, study_page
from ....study.study import Study
from . import activations_figures as figures
from .find_activations import ActivationsResult

MAX_DRAWN_RECORDINGS = 4
"""Largest number of recordings that are drawn."""


def page(study: Study, found: ActivationsResult) -> Page:
    """Return the page with the scores of removed electrodes, and torques and activations of the first recordings."""
    judged, shown = [], []
    for i, joint in enumerate(dict.fromkeys(joint for joint, _ in found.left_out), start=1):
        own = [each for j, each in found.left_out if j == joint]
        judged.append(
            draw(
                figures.filling_methods_compared, own, f"ways_{i}",
                f"{typeset_sentence(joint)}: each electrode of the test recordings removed in turn, and its muscle's "
                "activation filled in. Lines are medians; orange methods see the measured torque. Marks at the left "
                "edge lie beyond it.",
            )
        )  # fmt: skip
        first = next(each for each in found.recordings if each.what == joint)
        fs = (len(first.time) - 1) / (first.time[-1] - first.time[0])
        judged.append(
            draw(
                figures.removed_electrodes, [each for each in own if each.recording == first.recording], fs,
                f"taken_away_{i}",
                f"{typeset_sentence(joint)}, {first.recording.replace('_', ' ')}: activation by the removed electrode "
                "(grey), and filled in.",
            )
        )  # fmt: skip
    for i, each in enumerate(found.recordings[:MAX_DRAWN_RECORDINGS], start=1):
        shown.append(
            draw(
                figures.torque_and_activations, each, f"activations_{i}",
                f"{typeset_sentence(each.what)}, {each.recording.replace('_', ' ')}: the torque, and the muscles' "
                "activations by EMG (blue) and EMG-assisted, so that they reproduce the torque (orange).",
            )
        )  # fmt: skip
    sections = []
    if judged:
        method_text = (
            "Assisted muscles are found from the measured torque, so reproducing it is no evidence for them. Removing "
            "a recorded electrode and predicting its activation is. For methods that see EMG and angles alone, the "
            "resulting torque is scored as well."
        )
        tables = figure_tables(found, "taken away")
        sections.append(Section("taken_away", "An electrode taken away", (method_text,), tables, tuple(judged)))
    tables = figure_tables(found, "Torque by EMG")
    sections.append(Section("activations", "Torque and activations", (), tables, tuple(shown)))
    return study_page(
        title=f"{found.study}: activations",
        headline=typeset_sentence(found.headline),
        tiles=(),
        sections=sections,
        verdicts=found.verdicts,
        following=(paper_step(study),),
    )
