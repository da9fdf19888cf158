"""Find and download public recordings, and make studies of them."""

from __future__ import annotations

from .init import init as init
from .motions import RecordedMotion as RecordedMotion
from .motions import recorded_motions as recorded_motions
from .motions import recorded_walking as recorded_walking
from .registry import Dataset as Dataset
from .registry import fetch as fetch
from .registry import info as info
from .registry import motion_names as motion_names
from .registry import names as names
from .registry import notes as notes
from .registry import path as path
from .registry import template as template
