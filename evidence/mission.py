"""What the three papers claim or want, beyond their equations, tables and figures: measured, each beside its rival.

- anticipation (KNEE, sections 1.4 and 1.5; HILL, section 1): by how much torque from EMG is told before motion tells it
  (`_lead`).
- loads and support (ABLE, sections 1 and 6): the load of the first lift, laws that carry it, a load that falls, and a
  law that carries part of the forearm (`_loads`).
- drift of strap and friction while a knee orthosis is worn (KNEE, section 4.2): what following it can save (`_drift`).
- misaligned axes (ABLE, section 2.1): what a carriage saves, and where its travel says that the axis is
  (`_misaligned_axes`).
- filters as printed (ABLE, section 3.3): what they do to Table I (`_printed_filters`).
"""

from collections.abc import Iterator

from pellucid.studies.results import ResultRow

from ._drift import drift_rows
from ._lead import lead_rows
from ._loads import load_rows
from ._misaligned_axes import misalignment_rows
from ._printed_filters import filter_rows


def rows() -> Iterator[ResultRow]:
    """Every figure."""
    yield from lead_rows()
    yield from load_rows()
    yield from drift_rows()
    yield from misalignment_rows()
    yield from filter_rows()
