"""Claims and aims of the three papers beyond their equations, tables and figures, measured and compared with a
reference.

- anticipation (KNEE, sections 1.4 and 1.5; HILL, section 1): lead of torque estimates from EMG over those from
  motion (`_lead`).
- loads and support (ABLE, sections 1 and 6): the load of the first lift, laws that carry it, a load that falls, and a
  law that carries part of the forearm (`_loads`).
- reduction of interaction torque by that lead (`_lead_control`).
- a walking wearer (KNEE, title and section 4.2): laws worn on a thigh that moves, at three speeds (`_walking_wearer`).
- orders in which muscles' parameters are released, and swings faster than those that were fitted (HILL, sections 3.3
  and 5; `_release_orders`).
- pointing with four joints under laws built from cards (ABLE, sections 4 and 6; `_arm_pointing`).
- people who were set without a robot (ABLE, section 5; `_people_kept`).
- drift of strap and friction while a knee orthosis is worn (KNEE, section 4.2): benefit of online estimation
(`_drift`).
- misaligned axes (ABLE, section 2.1): benefit of a carriage, and the axis estimated from its travel
  (`_misaligned_axes`).
- filters as printed (ABLE, section 3.3): their effect on Table I (`_printed_filters`).
"""

from collections.abc import Iterator

from pellucid.study.results import ResultRow

from ._arm_pointing import arm_pointing_rows
from ._drift import drift_rows
from ._lead import lead_rows
from ._lead_control import lead_control_rows
from ._loads import load_rows
from ._misaligned_axes import misalignment_rows
from ._parts import run_parts
from ._people_kept import people_rows
from ._printed_filters import filter_rows
from ._release_orders import release_rows
from ._walking_wearer import walking_rows


def rows() -> Iterator[ResultRow]:
    """Every figure."""
    yield from run_parts("mission", {
        "lead": lead_rows,
        "control of lead": lead_control_rows,
        "loads": load_rows,
        "walking": walking_rows,
        "drift": drift_rows,
        "misaligned axes": misalignment_rows,
        "printed filters": filter_rows,
        "orders of release": release_rows,
        "pointing with an arm": arm_pointing_rows,
        "people": people_rows,
    })  # fmt: skip
