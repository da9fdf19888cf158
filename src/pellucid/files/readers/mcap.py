"""Read MCAP files: every number of every topic, at the times of its messages.

A column is TOPIC.FIELD, at the times of TOPIC.time; joint states are named by their joints (`_messages`). Messages may
be JSON, or of ROS 1 or ROS 2 with their definitions, for which rosbags is needed. Topics with other messages, such as
Protobuf, are columns that say so.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..._errors import PellucidError, RecordingError, missing_package
from ._columns import Columns
from ._messages import Topics

ENDINGS = (".mcap",)
APART = ("mcap.reader", "rosbags.typesys")


def read(path: Path) -> Columns:
    """Return columns by topic and dotted path, each shape (n,) float64 with the n of its topic."""
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise RecordingError(str(missing_package(f"{path.name}: an MCAP file", "mcap", "bags"))) from None
    topics = Topics(path)
    decoders: dict[int, Callable[[bytes], Any] | str] = {}
    try:
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
                if topics.is_left_out(channel.topic):
                    continue
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(path, schema, channel)
                decode = decoders[channel.id]
                if isinstance(decode, str):
                    topics.leave_out(channel.topic, decode)
                else:
                    topics.add(channel.topic, message.log_time, decode(message.data))
    except (PellucidError, MemoryError):
        raise
    except Exception as error:  # the library has errors of its own for damaged files
        raise RecordingError(f"{path.name}: not readable as MCAP, truncated or damaged: {error!r}") from error
    return topics.columns()


def _decoder(path: Path, schema: Any, channel: Any) -> Callable[[bytes], Any] | str:
    """Return what turns a channel's bytes into a message, or words that say why nothing does."""
    if channel.message_encoding == "json":
        return json.loads
    of_ros = channel.message_encoding in ("ros1", "cdr") and schema is not None
    if not of_ros or schema.encoding not in ("ros1msg", "ros2msg"):
        return f'holds messages in "{channel.message_encoding}", expected JSON or those of ROS with their definitions'
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise RecordingError(str(missing_package(f"{path.name}: messages of ROS", "rosbags", "bags"))) from None
    kind = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema.data.decode(), kind))
    deserialize = store.deserialize_ros1 if channel.message_encoding == "ros1" else store.deserialize_cdr
    return lambda content: deserialize(content, kind)
