"""What the operator sees while a session runs is what its report will say of the same trials."""

import made_pointing
import numpy as np
import pytest

from pellucid.live.session.running_indices import SHOWN_INDEX_NAMES, RunningIndices
from pellucid.people.indices import INDICES
from pellucid.people.movement_indices import IndexTable
from pellucid.people.study.primary_change import change_of_table
from pellucid.study.pages.quantities import cell_text, number, typeset_quantities, without_negative_zero
from pellucid.study.procedures.run import assess


def shorter(person, condition, time, angle, target, emg_time):
    """Lose the end of a trial, so that conditions do not have the same movements."""
    if condition == "FC":
        kept = time < 0.6 * time[-1]
        return time[kept], angle[kept], target[kept], emg_time
    return time, angle, target, emg_time


@pytest.mark.parametrize("change", [None, shorter])
def test_running_indices_are_those_of_the_report(tmp_path, change):
    study = made_pointing.study(tmp_path / "people", participants=2, change=change)
    running = RunningIndices(study.config.assessment)
    for recording in study.recordings():
        assert running.add(recording) > 0
    found = assess(study)
    for place, person in enumerate(found.participants):
        shown = {each.words: each for each in running.shown(person)}
        assert len(shown) >= 4
        for name in SHOWN_INDEX_NAMES:
            reported = found.assessed.get(name)
            if reported is None:
                assert INDICES[name].words not in shown
                continue
            factor, unit = reported.table.index.shown
            told = shown[reported.table.index.words]
            assert told.unit == unit
            expected = dict(zip(reported.table.conditions, factor * reported.table.values[place], strict=True))
            assert told.values == pytest.approx(expected, nan_ok=True)


def test_an_interaction_is_no_percentage_of_a_sensor_s_noise():
    table = IndexTable("torque_rms", "rad", ("P1",), ("Ctrl", "FC"), np.array([[0.2, 1.392]]))
    change = change_of_table(table, "FC", "Ctrl", "mean")
    assert (change.unit, change.value) == ("N*m", pytest.approx(1.192))
    assert change_of_table(
        IndexTable("vmax", "rad", ("P1",), ("Ctrl", "FC"), np.array([[1.0, 1.1]])), "FC", "Ctrl", "mean"
    ).unit == "%"  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-0.0", "0.0"), ("−0.00 N·m", "0.00 N·m"), ("it is -0.", "it is 0."), ("(-0.0 to 0.1)", "(0.0 to 0.1)"),
        ("-0.05", "-0.05"), ("−0.003", "−0.003"), ("1-0", "1-0"), ("10^-0", "10^-0"), ("--0", "--0"), ("a-0", "a-0"),
    ],
)  # fmt: skip
def test_no_number_that_rounds_to_zero_has_a_sign(text, expected):
    assert without_negative_zero(text) == expected
    assert cell_text(text) == expected


def test_numbers_of_sentences_and_cells_have_no_negative_zero():
    assert typeset_quantities(f"a gain of {-0.004:+.2f}, {-0.04:.1f} to {-0.3:.1f}") == "a gain of 0.00, 0.0 to −0.3"
    assert number(-1e-9, 0.01) == "0.0000"[: len(number(1e-9, 0.01))]
