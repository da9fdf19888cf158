"""Motions of long recordings are in a temporary file, and give the samples that they would have in memory."""

import pickle
from dataclasses import replace

import numpy as np

from pellucid.files.recording import Channel
from pellucid.files.stored_channels import ChannelStore, StoredArrays
from pellucid.numerics.motion import Filtering, JudgedMotion, pieces
from pellucid.study import stored_motions
from pellucid.study.stored_motions import SIGNAL_NAMES, store_motions


def long_pieces(split):
    time = np.arange(400_000) / 1000.0
    position = np.sin(0.9 * time)
    return list(pieces(time, position, 2.0 * position, Filtering(20.0, 4, 10), fs=1000.0, split=split))


def test_motions_beyond_the_limit_are_read_when_they_are_used(monkeypatch):
    monkeypatch.setattr(stored_motions, "MAX_HELD_BYTES", 0)
    for split in ("fitted", "heldout"):
        plain = long_pieces(split)
        stored = list(store_motions(plain))
        assert len(stored) == len(plain) > 1
        for expected, found in zip(plain, stored, strict=True):
            assert not set(SIGNAL_NAMES) & set(vars(found))
            assert isinstance(found, JudgedMotion) == (split == "heldout")
            for name in SIGNAL_NAMES:
                np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
            np.testing.assert_array_equal(found.states, expected.states)
            held = found.velocity
            assert found.velocity is held  # models compare signals by identity
            assert type(replace(found, recording="other")) is type(expected)
            copied = pickle.loads(pickle.dumps(found))  # as a job in another process has it
            assert type(copied) is type(expected)
            np.testing.assert_array_equal(copied.states, expected.states)


def test_few_samples_stay_in_memory():
    plain = long_pieces("fitted")[:1]
    assert list(store_motions(plain)) == plain


def test_a_span_of_a_stored_channel_is_read_alone(monkeypatch):
    samples, store, read = np.arange(100_000.0), ChannelStore(), []
    arrays = store.store_all({"x": samples})
    assert isinstance(arrays, StoredArrays)
    channel = store._store(Channel("x", samples, "rad", "x"))
    whole = ChannelStore.read
    monkeypatch.setattr(ChannelStore, "read", lambda store, *at: read.append(at[1]) or whole(store, *at))
    for span in (slice(10, 20), slice(99_990, None), slice(5, 50, 3), slice(20, 10)):
        np.testing.assert_array_equal(channel.within(span).samples, samples[span])
    assert max(n for (n,) in read) < 100
