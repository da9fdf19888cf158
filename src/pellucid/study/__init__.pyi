"""Names of this package, each imported when it is first used."""

from . import datasets as datasets
from .quality import inspect as inspect
from .quality import require_sound as require_sound
from .results import ResultRow as ResultRow
from .results import read_rows as read_rows
from .results import write_rows as write_rows
from .study import Study as Study
from .study import drive_channel as drive_channel
