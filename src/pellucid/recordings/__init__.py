"""Read a laboratory's recordings into SI. Only this package opens data files."""

from __future__ import annotations

from .._atomic import write_text_atomically as write_text_atomically
from .drive_channel import drive_channel as drive_channel
from .fault import Fault as Fault
from .optical import OpticalRecording as OpticalRecording
from .quality import inspect as inspect
from .quality import require_sound as require_sound
from .recording import Channel as Channel
from .recording import Payload as Payload
from .recording import Recording as Recording
from .results import ResultRow as ResultRow
from .results import read_rows as read_rows
from .results import write_rows as write_rows
from .study import Study as Study
from .writers import channels_toml as channels_toml
from .writers import write_csv as write_csv
