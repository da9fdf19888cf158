"""The table of changes never says of a row what its interval denies."""

from math import nan
from types import SimpleNamespace

import pytest

from pellucid.people.study.assessment_tables import _test_text
from pellucid.people.study.primary_change import PrimaryChange


@pytest.mark.parametrize(
    ("interval", "differs", "said"),
    [
        ((2.0, 9.0), True, "differs"),
        ((-2.0, 9.0), False, "not shown"),
        ((nan, nan), True, "differs"),
        ((-13.8, 63.7), True, "ranks differ"),
        ((2.0, 9.0), False, "not in ranks"),
        ((2.0, 9.0), None, None),
    ],
)
def test_a_test_of_ranks_is_named_where_the_interval_does_not_agree(interval, differs, said):
    """It said "differs" of +24.9 (-13.8 to +63.7) %."""
    found = SimpleNamespace(said_of=lambda name, condition: None, control="Ctrl", confidence=0.95)
    each = SimpleNamespace(name="unsettled", differs=lambda condition, control, alpha: differs)
    assert _test_text(found, each, PrimaryChange(5.0, *interval, "%"), "FC") == said
