"""Mark files that Pellucid stores beside a study, so that a stranger's files are not mistaken for the user's own.

The mark is a keyed hash. The key is drawn once, lies in the user's own folder of settings, and serves no other purpose.
"""

from __future__ import annotations

import os
from functools import cache
from hashlib import blake2b
from hmac import compare_digest
from pathlib import Path
from secrets import token_bytes

from .._atomic import write_bytes_atomically

MARK_BYTES = 32
"""Length of a mark, and of the key."""

SETTINGS_VARIABLE = "PELLUCID_SETTINGS"
"""Environment variable that names another folder of settings."""


def mark(content: bytes | memoryview) -> bytes:
    """Return the mark of a content, `MARK_BYTES` bytes, which nobody can make without the key."""
    return blake2b(content, key=_key(settings_folder()), digest_size=MARK_BYTES).digest()


SEAL_LENGTH = 8 + 2 * MARK_BYTES
"""Length of a seal in bytes: a content's size, its checksum, and the mark of both."""


def seal(content: bytes | memoryview, context: bytes = b"") -> bytes:
    """Return the seal of a content, `SEAL_LENGTH` bytes; its mark includes a `context`, such as a file's name.

    A seal can be checked before the content is read, so that a reader never reads more bytes than were stored.
    """
    note = len(content).to_bytes(8, "little") + blake2b(content, digest_size=MARK_BYTES).digest()
    return note + mark(context + note)


def sealed_size(found: bytes, context: bytes = b"") -> int | None:
    """Return the size of the content that a `found` seal belongs to [bytes]; None if it is not this user's seal."""
    note, marked = found[:-MARK_BYTES], found[-MARK_BYTES:]
    own = len(found) == SEAL_LENGTH and is_own_mark(context + note, marked)
    return int.from_bytes(note[:8], "little") if own else None


def is_sealed(content: bytes | memoryview, found: bytes) -> bool:
    """Return whether a content is the one of a `found` seal, which `sealed_size` has accepted."""
    return found[8:-MARK_BYTES] == blake2b(content, digest_size=MARK_BYTES).digest()


def is_own_mark(content: bytes | memoryview, found: bytes) -> bool:
    """Return whether a `found` mark is this user's mark of the content."""
    return compare_digest(mark(content), found)


def settings_folder() -> Path:
    """Return the user's own folder of settings."""
    named = os.environ.get(SETTINGS_VARIABLE)
    if named:
        return Path(named)
    parent = os.environ.get("APPDATA") if os.name == "nt" else os.environ.get("XDG_CONFIG_HOME")
    return (Path(parent) if parent else Path.home() / ".config") / "pellucid"


@cache
def _key(folder: Path) -> bytes:
    """Return the key; draw it if the folder has none. If the folder cannot be written, the key is this process's
    own."""
    path = folder / "kept.key"
    try:
        if not path.is_file() or path.stat().st_size != MARK_BYTES:
            write_bytes_atomically(path, token_bytes(MARK_BYTES), private=True)
        return path.read_bytes()  # if two processes drew a key at once, both use the later one
    except OSError:
        return token_bytes(MARK_BYTES)
