"""What the three papers claim or want, beyond their equations, tables and figures: measured, each beside its rival.

- anticipation (KNEE, sections 1.4 and 1.5; HILL, section 1): by how much torque from EMG is told before motion tells it
  (`_lead`).
- loads and support (ABLE, sections 1 and 6): the load of the first lift, laws that carry it, a load that falls, and a
  law that carries part of the forearm (`_loads`).
- what the lead buys a controller in interaction torque (`_lead_control`).
- a walking wearer (KNEE, title and section 4.2): laws worn on a thigh that moves, at three speeds (`_walking_wearer`).
- orders in which muscles' parameters are released, and swings faster than those that were fitted (HILL, sections 3.3
  and 5; `_release_orders`).
- pointing with four joints under laws built from cards (ABLE, sections 4 and 6; `_arm_pointing`).
- people who were set without a robot (ABLE, section 5; `_people_kept`).
- drift of strap and friction while a knee orthosis is worn (KNEE, section 4.2): what following it can save (`_drift`).
- misaligned axes (ABLE, section 2.1): what a carriage saves, and where its travel says that the axis is
  (`_misaligned_axes`).
- filters as printed (ABLE, section 3.3): what they do to Table I (`_printed_filters`).
"""

from collections.abc import Iterator

from pellucid.study.results import ResultRow

from ._arm_pointing import arm_pointing_rows
from ._drift import drift_rows
from ._lead import lead_rows
from ._lead_control import lead_control_rows
from ._loads import load_rows
from ._misaligned_axes import misalignment_rows
from ._people_kept import people_rows
from ._printed_filters import filter_rows
from ._release_orders import release_rows
from ._walking_wearer import walking_rows


def rows() -> Iterator[ResultRow]:
    """Every figure."""
    yield from lead_rows()
    yield from lead_control_rows()
    yield from load_rows()
    yield from walking_rows()
    yield from drift_rows()
    yield from misalignment_rows()
    yield from filter_rows()
    yield from release_rows()
    yield from arm_pointing_rows()
    yield from people_rows()
