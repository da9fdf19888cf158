"""Read a laboratory's recordings into SI. Only this package opens data files."""

from __future__ import annotations

from .._atomic import write_text_atomically as write_text_atomically
from .fault import Fault as Fault
from .optical import OpticalRecording as OpticalRecording
from .recording import Channel as Channel
from .recording import Payload as Payload
from .recording import Recording as Recording
from .writers import channels_toml as channels_toml
from .writers import write_csv as write_csv
