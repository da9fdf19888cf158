"""Motions whose samples are in a temporary file, so that memory does not grow with the length of a recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from weakref import ref

import numpy as np

from ..files.stored_channels import MAX_HELD_BYTES, ChannelStore
from ..numerics.motion import JudgedMotion, Motion

SIGNAL_NAMES = ("time", "position", "velocity", "acceleration", "effort")
"""Fields of a motion that are stored."""


def _stored_signal(name: str) -> property:
    def read(motion: Motion) -> np.ndarray:
        fields = vars(motion)
        last = fields["_read"].get(name)
        samples = last() if last is not None else None
        if samples is None:
            samples = fields["_stored"][name]
            fields["_read"][name] = ref(samples)
        return samples

    return property(read, doc=f"The {name}, (n,), read from the file unless somebody still holds what was read.")


class _StoredSignals:
    """Signals of a motion that are read from the file."""

    time, position, velocity, acceleration, effort = map(_stored_signal, SIGNAL_NAMES)

    def __reduce__(self):
        # Another process has its own copy, because it does not share the temporary file.
        plain: Motion = replace(self)  # type: ignore[assignment, type-var]
        return type(plain), tuple(getattr(plain, field.name) for field in fields(plain))


class StoredMotion(_StoredSignals, Motion):  # type: ignore[misc]
    """A motion that is made by `store_motions`; a copy of it is a plain motion."""

    def __new__(cls, **values) -> Motion:  # type: ignore[misc]
        return Motion(**values)


class StoredJudgedMotion(_StoredSignals, JudgedMotion):  # type: ignore[misc]
    """The same of a held-out motion."""

    def __new__(cls, **values) -> JudgedMotion:  # type: ignore[misc]
        return JudgedMotion(**values)


def store_motions(motions: Iterable[Motion]) -> Iterator[Motion]:
    """Yield motions in memory and, beyond `MAX_HELD_BYTES`, with their samples in a temporary file."""
    store, held = ChannelStore(), 0
    for motion in motions:
        signals = {name: getattr(motion, name) for name in SIGNAL_NAMES}
        held += sum(samples.nbytes for samples in signals.values())
        if held <= MAX_HELD_BYTES or motion.raw_position is not None:
            yield motion
            continue
        made = object.__new__(StoredJudgedMotion if isinstance(motion, JudgedMotion) else StoredMotion)
        vars(made).update(vars(motion), _stored=store.store_all(signals), _read={})
        for name in SIGNAL_NAMES:
            del vars(made)[name]
        yield made
