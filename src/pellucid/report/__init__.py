"""The report of a study, and the only code that plots.

The command ``pellucid report`` and this folder share a name, so the module can be called: ``pellucid.report(study)``
is `document.write_report`.
"""

from __future__ import annotations

import sys
from types import ModuleType


class _Report(ModuleType):
    def __call__(self, study, fit=None, *, on_progress=None):
        """See `pellucid.report.document.write_report`."""
        from .document import write_report

        return write_report(study, fit, on_progress=on_progress)


sys.modules[__name__].__class__ = _Report
