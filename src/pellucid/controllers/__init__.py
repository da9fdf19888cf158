"""Control laws built from what was identified; called, it says the names that `pellucid.controller` makes laws of.

>>> import pellucid as pl
>>> "compensation" in pl.controllers()
True
"""

from __future__ import annotations

import sys
from types import ModuleType


class _Named(ModuleType):
    """The package is public under the name of the function that lists what is in it, so it is that function."""

    def __call__(self) -> tuple[str, ...]:
        from .controller import controllers

        return controllers()


sys.modules[__name__].__class__ = _Named
