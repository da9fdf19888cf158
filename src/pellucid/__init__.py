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
    from . import datasets
    from ._errors import PellucidError as PellucidError
    from .assessment.certify import certify as certify
    from .assessment.comparison import compare_conditions as compare_conditions
    from .assessment.movement_indices import movement_indices as movement_indices
    from .assessment.power import power_curve as power_curve
    from .control.controller import controller as controller
    from .control.controller import controllers as controllers
    from .control.instruments import Instruments as Instruments
    from .control.limits import Limits as Limits
    from .control.supervised import supervised as supervised
    from .demonstration.demo import demo as demo
    from .deployment.export import export as export
    from .estimators.calibrate_muscles import calibrate_muscles as calibrate_muscles
    from .estimators.torque_regressor import TorqueRegressor as TorqueRegressor
    from .fit.joint.fit_joint import fit_joint as fit_joint
    from .fit.strap.fit_strap import fit_strap as fit_strap
    from .fit.transfer.fit_transfer_function import fit_transfer_function as fit_transfer_function
    from .fit.tree.fit_robot import fit_robot as fit_robot
    from .lab.predict import predict as predict
    from .lab.simulate import simulate as simulate
    from .models.muscle import Muscle as Muscle
    from .papers.reproduce import reproduce as reproduce
    from .procedures.audit import audit as audit
    from .procedures.compare import compare as compare
    from .procedures.incident import incident as incident
    from .procedures.registry import open_study as open  # noqa: F401 - an attribute that __all__ leaves to the builtin
    from .procedures.run import activations as activations
    from .procedures.run import assess as assess
    from .procedures.run import calibrate as calibrate
    from .procedures.run import check as check
    from .procedures.run import cocontraction as cocontraction
    from .procedures.run import identify as identify
    from .procedures.run import onset as onset
    from .procedures.run import report as report
    from .procedures.run import synergies as synergies
    from .recordings.raw_emg import RawEmg as RawEmg
    from .recordings.readers import read as read
    from .recordings.readers.urdf import read_robot as read_robot
    from .signals.electromechanical_delay import electromechanical_delay as electromechanical_delay
    from .signals.envelope import envelope as envelope
    from .signals.fatigue import median_frequency_trend as median_frequency_trend
    from .signals.fit_hinge import fit_hinge as fit_hinge
    from .signals.maximal_envelope import maximal_envelope as maximal_envelope
    from .signals.stride_ensemble import stride_ensemble as stride_ensemble
    from .start_study import init as init

# Module and attribute of each public name; the attribute is None for a module.
# Those in `_LAB_NAMES` come with the distribution `pellucid-lab`.
_PUBLIC_SOURCES = {
    "PellucidError": ("_errors", "PellucidError"),
    "calibrate_muscles": ("estimators.calibrate_muscles", "calibrate_muscles"),
    "certify": ("assessment.certify", "certify"),
    "electromechanical_delay": ("signals.electromechanical_delay", "electromechanical_delay"),
    "fit_hinge": ("signals.fit_hinge", "fit_hinge"),
    "maximal_envelope": ("signals.maximal_envelope", "maximal_envelope"),
    "median_frequency_trend": ("signals.fatigue", "median_frequency_trend"),
    "stride_ensemble": ("signals.stride_ensemble", "stride_ensemble"),
    "fit_robot": ("fit.tree.fit_robot", "fit_robot"),
    "fit_strap": ("fit.strap.fit_strap", "fit_strap"),
    "open": ("procedures.registry", "open_study"),
    "assess": ("procedures.run", "assess"),
    "audit": ("procedures.audit", "audit"),
    "check": ("procedures.run", "check"),
    "calibrate": ("procedures.run", "calibrate"),
    "identify": ("procedures.run", "identify"),
    "onset": ("procedures.run", "onset"),
    "activations": ("procedures.run", "activations"),
    "cocontraction": ("procedures.run", "cocontraction"),
    "synergies": ("procedures.run", "synergies"),
    "controller": ("control.controller", "controller"),
    "controllers": ("control.controller", "controllers"),
    "Instruments": ("control.instruments", "Instruments"),
    "Limits": ("control.limits", "Limits"),
    "supervised": ("control.supervised", "supervised"),
    "compare": ("procedures.compare", "compare"),
    "incident": ("procedures.incident", "incident"),
    "report": ("procedures.run", "report"),
    "fit_joint": ("fit.joint.fit_joint", "fit_joint"),
    "fit_transfer_function": ("fit.transfer.fit_transfer_function", "fit_transfer_function"),
    "init": ("start_study", "init"),
    "predict": ("lab.predict", "predict"),
    "simulate": ("lab.simulate", "simulate"),
    "reproduce": ("papers.reproduce", "reproduce"),
    "datasets": ("datasets", None),
    "demo": ("demonstration.demo", "demo"),
    "export": ("deployment.export", "export"),
    "Muscle": ("models.muscle", "Muscle"),
    "RawEmg": ("recordings.raw_emg", "RawEmg"),
    "TorqueRegressor": ("estimators.torque_regressor", "TorqueRegressor"),
    "compare_conditions": ("assessment.comparison", "compare_conditions"),
    "envelope": ("signals.envelope", "envelope"),
    "movement_indices": ("assessment.movement_indices", "movement_indices"),
    "power_curve": ("assessment.power", "power_curve"),
    "read_robot": ("recordings.readers.urdf", "read_robot"),
    "read": ("recordings.readers", "read"),
}

_LAB_NAMES = frozenset({"demo", "predict", "reproduce", "simulate"})

__all__ = [
    "Instruments",
    "Limits",
    "Muscle",
    "PellucidError",
    "RawEmg",
    "TorqueRegressor",
    "__version__",
    "activations",
    "assess",
    "audit",
    "calibrate",
    "calibrate_muscles",
    "certify",
    "check",
    "cocontraction",
    "compare",
    "compare_conditions",
    "controller",
    "controllers",
    "datasets",
    "demo",
    "electromechanical_delay",
    "envelope",
    "export",
    "fit_hinge",
    "fit_joint",
    "fit_robot",
    "fit_strap",
    "fit_transfer_function",
    "identify",
    "incident",
    "init",
    "maximal_envelope",
    "median_frequency_trend",
    "movement_indices",
    "onset",
    "power_curve",
    "predict",
    "read",
    "read_robot",
    "report",
    "reproduce",
    "simulate",
    "stride_ensemble",
    "supervised",
    "synergies",
]
# ``pellucid.open`` is public too. It is not listed: ``from pellucid import *`` would replace Python's own open.


def __getattr__(name: str):
    if name == "__version__":
        from importlib.metadata import version

        return version("pellucid")
    if name not in _PUBLIC_SOURCES:
        raise AttributeError(f"module 'pellucid' has no attribute {name!r}; it has {', '.join(__dir__())}")
    from importlib import import_module

    module, attribute = _PUBLIC_SOURCES[name]
    try:
        found = import_module(f".{module}", __name__)
    except ModuleNotFoundError as error:
        if name in _LAB_NAMES and error.name in (f"{__name__}.{module}", f"{__name__}.{module.partition('.')[0]}"):
            from ._errors import missing_lab

            raise missing_lab(f"pellucid.{name}") from None
        raise
    return found if attribute is None else getattr(found, attribute)


def __dir__() -> list[str]:
    return sorted({*__all__, *_PUBLIC_SOURCES})
