"""Pellucid: from recordings to a transparent exoskeleton.

>>> study = pellucid.open("my-elbow")                                   # doctest: +SKIP
>>> fit = pellucid.identify(study)                                      # doctest: +SKIP
>>> fit["inertia"].value, fit["inertia"].interval(0.95)                 # doctest: +SKIP
>>> pellucid.report(study, fit)                                         # doctest: +SKIP

The public names are listed in ``__init__.pyi``. Each is imported when it is first used, so that importing the package
costs nothing.
"""

from __future__ import annotations

import gc

import lazy_loader

_LAB_NAMES = ("demo", "predict", "reproduce", "simulate")
"""Public names that come with the distribution `pellucid-lab`."""

_load, _, _listed = lazy_loader.attach_stub(__name__, __file__)

# ``pellucid.open`` is public too. It is not listed: ``from pellucid import *`` would replace Python's own open.
__all__ = sorted({*_listed, *_LAB_NAMES, "__version__"} - {"open_study"})


def __getattr__(name: str):
    if name == "__version__":
        from importlib.metadata import version

        return version("pellucid")
    if name == "open":
        return _load("open_study")
    if name not in __all__:
        near = ""
        if not name.startswith("_"):  # Python asks for each private module before it imports it
            from difflib import get_close_matches

            near = "".join(f"; did you mean {each!r}?" for each in get_close_matches(name, __dir__(), 1))
        raise AttributeError(f"module 'pellucid' has no attribute {name!r}{near}; it has {', '.join(__dir__())}")
    is_collecting = gc.isenabled()
    gc.disable()  # an import makes many objects and no garbage
    try:
        return _lab_name(name) if name in _LAB_NAMES else _load(name)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if not missing.startswith(f"{__name__}."):
            raise
        text = f"pellucid.{name} needs {missing}, which this installation lacks"
        raise ModuleNotFoundError(text, name=missing) from None
    finally:
        if is_collecting:
            gc.enable()


def _lab_name(name: str):
    """Return what the distribution `pellucid-lab` has under a public name."""
    from importlib.util import find_spec

    if find_spec("pellucid_lab") is None:
        from ._errors import missing_lab

        raise missing_lab(f"pellucid.{name}")
    import pellucid_lab

    return getattr(pellucid_lab, name)


def __dir__() -> list[str]:
    return sorted([*__all__, "open"])
