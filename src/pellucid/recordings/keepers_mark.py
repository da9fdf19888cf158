"""The mark of whoever keeps something beside a study: what a stranger put there does not bear it.

A keyed hash. The key is drawn once, lies in the user's own folder of settings, and is of use for nothing else.
"""

from __future__ import annotations

import os
from functools import cache
from hashlib import blake2b
from hmac import compare_digest
from pathlib import Path
from secrets import token_bytes

from .._atomic import write_bytes_atomically

LENGTH = 32  # bytes of a mark, and of the key

ENVIRONMENT = "PELLUCID_SETTINGS"
"""Names another folder of settings."""


def mark(content: bytes | memoryview) -> bytes:
    """Of a content, `LENGTH` bytes: nobody without the key can make it."""
    return blake2b(content, key=_key(settings()), digest_size=LENGTH).digest()


SEAL_LENGTH = 8 + 2 * LENGTH
"""Bytes of a seal: a content's size, its checksum, and the mark of both."""


def seal(content: bytes | memoryview, context: bytes = b"") -> bytes:
    """Return the seal of a content, `SEAL_LENGTH` bytes; a `context`, such as a file's name, is part of what it marks.

    A seal is believed before the content is read: whoever reads asks for no more bytes than the keeper wrote.
    """
    note = len(content).to_bytes(8, "little") + blake2b(content, digest_size=LENGTH).digest()
    return note + mark(context + note)


def sealed_size(found: bytes, context: bytes = b"") -> int | None:
    """Return how many bytes a seal that was `found` is of; None if it is not this user's own."""
    note, marked = found[:-LENGTH], found[-LENGTH:]
    own = len(found) == SEAL_LENGTH and bears(context + note, marked)
    return int.from_bytes(note[:8], "little") if own else None


def is_sealed(content: bytes | memoryview, found: bytes) -> bool:
    """Return whether a content is the one that a seal, whose `sealed_size` is known, was made of."""
    return found[8:-LENGTH] == blake2b(content, digest_size=LENGTH).digest()


def bears(content: bytes | memoryview, found: bytes) -> bool:
    """Whether a mark that was `found` is this user's own of the content."""
    return compare_digest(mark(content), found)


def settings() -> Path:
    """The user's own folder of settings."""
    named = os.environ.get(ENVIRONMENT)
    if named:
        return Path(named)
    of_all = os.environ.get("APPDATA") if os.name == "nt" else os.environ.get("XDG_CONFIG_HOME")
    return (Path(of_all) if of_all else Path.home() / ".config") / "pellucid"


@cache
def _key(folder: Path) -> bytes:
    """Drawn where there is none; of this process alone where the folder cannot be written."""
    path = folder / "kept.key"
    try:
        if not path.is_file() or path.stat().st_size != LENGTH:
            write_bytes_atomically(path, token_bytes(LENGTH), private=True)
        return path.read_bytes()  # of two processes that drew one at once, the later's
    except OSError:
        return token_bytes(LENGTH)
