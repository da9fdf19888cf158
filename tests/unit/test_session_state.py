"""States of a session's engine and the changes between them, as the core has them."""

import pytest

from pellucid.controllers.session_state import ENDED, SESSION_STATES, SILENT, UNPOWERED

BY_NAME = {state.name: state for state in SESSION_STATES}


def before(name):
    """Return the names of the states that lead to another one."""
    return {state.name for state in SESSION_STATES if name in state.next} - {name}


def test_there_are_six_states_in_the_order_of_their_codes():
    assert list(BY_NAME) == ["disarmed", "armed", "running", "stopping", "stopped", "faulted"]
    assert BY_NAME["disarmed"] == UNPOWERED
    assert [state.name for state in SESSION_STATES if state.in_force] == ["running"]
    assert [state.name for state in SESSION_STATES if state.needs_reset] == ["stopped", "faulted"]
    assert not any(state.is_lost for state in SESSION_STATES)
    assert SILENT.is_lost
    assert ENDED.is_lost


def test_a_law_begins_from_armed_alone():
    assert before("running") == {"armed"}
    assert "running" not in BY_NAME["disarmed"].next


@pytest.mark.parametrize("name", ["stopped", "faulted"])
def test_what_has_stopped_is_disarmed_by_a_reset_and_nothing_else(name):
    assert set(BY_NAME[name].next) == {"disarmed", "stopped", "faulted"}
    assert before(name) <= {"armed", "running", "stopped", "faulted"}


def test_a_law_in_force_loses_its_power_by_a_ramp_or_a_stop():
    assert set(BY_NAME["running"].next) == {"running", "stopping", "stopped", "faulted"}
    assert set(BY_NAME["stopping"].next) == {"stopping", "disarmed", "armed"}


def test_every_state_lasts_and_has_words():
    assert all(state.name in state.next and state.words for state in SESSION_STATES)
