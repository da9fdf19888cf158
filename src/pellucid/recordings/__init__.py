"""Recordings as a lab has them, read into SI; the only code that opens data files."""

from __future__ import annotations

from .atomic import write_text_atomically as write_text_atomically
from .recording import Channel as Channel
from .recording import Payload as Payload
from .recording import Recording as Recording
from .study import Study as Study
from .study import open_study as open_study
