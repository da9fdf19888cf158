"""Find and download public recordings, and make studies of them."""

from __future__ import annotations

from .fetch import Dataset as Dataset
from .fetch import fetch as fetch
from .fetch import info as info
from .fetch import motion_names as motion_names
from .fetch import names as names
from .fetch import notes as notes
from .fetch import path as path
from .fetch import template as template
from .init import init as init
from .motions import RecordedMotion as RecordedMotion
from .motions import recorded_motions as recorded_motions
from .motions import recorded_walking as recorded_walking
