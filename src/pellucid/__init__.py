"""Pellucid: from recordings to a transparent exoskeleton.

>>> study = pellucid.open("my-elbow")                                   # doctest: +SKIP
>>> fit = pellucid.identify(study)                                      # doctest: +SKIP
>>> fit["inertia"].value, fit["inertia"].interval(0.95)                 # doctest: +SKIP
>>> pellucid.report(study, fit)                                         # doctest: +SKIP

Each name below is imported when it is first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import datasets, report
    from .assessment.assess import assess as assess
    from .demonstration.demo import demo as demo
    from .deployment.export import export as export
    from .estimators.calibrate import calibrate as calibrate
    from .identification.check import check as check
    from .identification.compare import compare as compare
    from .identification.identify import identify as identify
    from .lab.init import init as init
    from .lab.simulate import simulate as simulate
    from .published.reproduce import reproduce as reproduce
    from .recordings.study import open_study as open

_WHERE = {
    "open": ("recordings.study", "open_study"),
    "assess": ("assessment.assess", "assess"),
    "check": ("identification.check", "check"),
    "calibrate": ("estimators.calibrate", "calibrate"),
    "identify": ("identification.identify", "identify"),
    "compare": ("identification.compare", "compare"),
    "report": ("report", None),
    "init": ("lab.init", "init"),
    "simulate": ("lab.simulate", "simulate"),
    "reproduce": ("published.reproduce", "reproduce"),
    "datasets": ("datasets", None),
    "demo": ("demonstration.demo", "demo"),
    "export": ("deployment.export", "export"),
}

__all__ = [
    "__version__",
    "assess",
    "calibrate",
    "check",
    "compare",
    "datasets",
    "demo",
    "export",
    "identify",
    "init",
    "open",
    "report",
    "reproduce",
    "simulate",
]


def __getattr__(name: str):
    if name == "__version__":
        from importlib.metadata import version

        return version("pellucid")
    if name not in _WHERE:
        raise AttributeError(f"module 'pellucid' has no attribute {name!r}; it has {', '.join(__all__)}")
    from importlib import import_module

    module, attribute = _WHERE[name]
    found = import_module(f".{module}", __name__)
    return found if attribute is None else getattr(found, attribute)


def __dir__() -> list[str]:
    return __all__
