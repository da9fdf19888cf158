"""A new study whose recordings a session will make: its study.toml, from a template."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ..._atomic import write_text_atomically
from ..._errors import StudyError
from ..._given import require_empty_folder
from ...study.study import STUDY_FILE

KNEE_MUSCLES = (
    "rectus_femoris", "vastus_lateralis", "vastus_medialis", "biceps_femoris", "semitendinosus",
    "gastrocnemius_medial", "gastrocnemius_lateral", "tibialis_anterior",
)  # fmt: skip

_PARTICIPANT_NAMES = [f"P{i + 1}" for i in range(6)]
_SHORT_ELBOW = {
    "participants": _PARTICIPANT_NAMES, "published": False, "pause": "5 s", "trials": 1, "repetitions": 1,
    "hold": "1 s", "amplitudes": '"12 deg", "36 deg", "60 deg"',
}  # fmt: skip
_SHORT_KNEE = {
    "participants": _PARTICIPANT_NAMES, "muscles": KNEE_MUSCLES, "pause": "3 s", "pause_every": 2, "contraction": "2 s",
    "contraction_rest": "1 s", "trials": 2, "angles": '"30 deg", "60 deg"', "hold": "2 s", "ramp": "0.5 s",
    "followed": "10 s",
}  # fmt: skip

SHIPPED_SESSIONS: Mapping[str, tuple[str, Mapping[str, Any]]] = MappingProxyType(
    {
        "elbow": ("elbow.toml.j2", _SHORT_ELBOW),
        "knee": ("knee.toml.j2", _SHORT_KNEE),
        "able-elbow": (
            "elbow.toml.j2",
            {**_SHORT_ELBOW, "published": True, "pause": "2 min", "trials": 2, "repetitions": 5, "hold": "2 s",
             "amplitudes": '"12 deg", "24 deg", "36 deg", "48 deg", "60 deg"'},
        ),
        "knee-orthosis": (
            "knee.toml.j2",
            {**_SHORT_KNEE, "pause": "1 min", "pause_every": 6, "contraction": "3 s", "contraction_rest": "3 s",
             "trials": 3, "angles": '"0 deg", "15 deg", "30 deg", "45 deg", "60 deg", "90 deg"', "hold": "5 s",
             "ramp": "2 s", "followed": "40 s"},
        ),
    }
)  # fmt: skip
"""Template and numbers of each session: a short one of each kind, and the protocol of each published study."""


def session_text(session: str, name: str) -> str:
    """Return the study.toml of a session, for a study of this name."""
    import jinja2

    if session not in SHIPPED_SESSIONS:
        raise StudyError(f"init: found the session {session!r}, expected one of {', '.join(SHIPPED_SESSIONS)}")
    template, numbers = SHIPPED_SESSIONS[session]
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(__package__, "templates"), undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    return environment.get_template(template).render(name=name, **numbers)


def start_session_study(folder: str | os.PathLike, session: str, name: str) -> Path:
    """Make a folder with the study.toml of a session; return its path."""
    folder, text = Path(folder), session_text(session, name)
    require_empty_folder(folder)
    return write_text_atomically(folder / STUDY_FILE, text)
