"""Read bags of ROS 1 (.bag) and ROS 2 (.db3): every number of every topic, at the times of its messages.

A column is TOPIC.FIELD, at the times of TOPIC.time; joint states are named by their joints (`_messages`). Messages are
understood by the definitions in the bag; a bag of ROS 2 before Iron has none, and its messages are taken for those of
Humble; topics of other types are columns that say so.
"""

from __future__ import annotations

from pathlib import Path

from ..._errors import PellucidError, RecordingError, missing_package
from ._columns import Columns
from ._messages import Topics

ENDINGS = (".bag", ".db3")
APART = ("rosbags.highlevel",)


def read(path: Path) -> Columns:
    """Return columns by topic and dotted path, each shape (n,) float64 with the n of its topic."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise RecordingError(str(missing_package(f"{path.name}: a bag of ROS", "rosbags", "bags"))) from None
    topics = Topics(path)
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
            for connection, time, content in bag.messages():
                if topics.is_left_out(connection.topic):
                    continue
                if connection.msgtype not in bag.typestore.fielddefs:
                    topics.leave_out(
                        connection.topic,
                        f'holds messages of the type "{connection.msgtype}", which the bag does not define',
                    )
                    continue
                topics.add(connection.topic, time, bag.deserialize(content, connection.msgtype))
    except (PellucidError, MemoryError):
        raise
    except Exception as error:  # the library has errors of its own for damaged files
        raise RecordingError(f"{path.name}: not readable as a bag of ROS, truncated or damaged: {error!r}") from error
    return topics.columns()
