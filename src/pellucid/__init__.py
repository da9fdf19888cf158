"""Pellucid: from recordings to a transparent exoskeleton.

>>> study = pellucid.open("my-elbow")                                   # doctest: +SKIP
>>> fit = pellucid.identify(study)                                      # doctest: +SKIP
>>> fit["inertia"].value, fit["inertia"].interval(0.95)                 # doctest: +SKIP
>>> pellucid.report(study, fit)                                         # doctest: +SKIP

Each name below is imported when it is first used, so that importing the package costs nothing.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pellucid_lab.demonstration.demo import demo as demo
    from pellucid_lab.papers.reproduce import reproduce as reproduce
    from pellucid_lab.predict import predict as predict
    from pellucid_lab.simulate import simulate as simulate

    from ._errors import PellucidError as PellucidError
    from .arm.fit.fit_robot import fit_robot as fit_robot
    from .arm.urdf import read_robot as read_robot
    from .controllers.control_law import Limits
    from .controllers.controller import controller as controller
    from .controllers.controller import controllers as controllers
    from .controllers.export.export import export as export
    from .controllers.instruments import Instruments as Instruments
    from .controllers.study.incident import incident as incident
    from .controllers.supervised import supervised as supervised
    from .emg.estimators.calibrate_muscles import calibrate_muscles as calibrate_muscles
    from .emg.estimators.torque_regressor import TorqueRegressor as TorqueRegressor
    from .emg.models.muscle import Muscle as Muscle
    from .emg.signals.electromechanical_delay import electromechanical_delay as electromechanical_delay
    from .emg.signals.envelope import envelope as envelope
    from .emg.signals.envelope import maximal_envelope
    from .emg.signals.fatigue import median_frequency_trend as median_frequency_trend
    from .emg.signals.repetitions import stride_ensemble
    from .files.raw_emg import RawEmg as RawEmg
    from .files.readers import read as read
    from .joint.fit.fit_joint import fit_joint as fit_joint
    from .orthosis.imu.hinge import fit_hinge
    from .orthosis.strap.identified_strap import fit_strap
    from .orthosis.transfer.fit_transfer_function import fit_transfer_function as fit_transfer_function
    from .people.certificate import certify
    from .people.comparison import compare_conditions as compare_conditions
    from .people.movement_indices import movement_indices as movement_indices
    from .people.power import power_curve as power_curve
    from .start_study import init as init
    from .study import datasets
    from .study.procedures.audit import audit as audit
    from .study.procedures.compare import compare as compare
    from .study.procedures.registry import open_study as open  # noqa: F401 - an attribute that __all__ leaves to the builtin
    from .study.procedures.run import activations as activations
    from .study.procedures.run import assess as assess
    from .study.procedures.run import calibrate as calibrate
    from .study.procedures.run import check as check
    from .study.procedures.run import cocontraction as cocontraction
    from .study.procedures.run import identify as identify
    from .study.procedures.run import onset as onset
    from .study.procedures.run import report as report
    from .study.procedures.run import synergies as synergies

# Module and attribute of each public name; the attribute is None for a module.
# Those in `_LAB_NAMES` come with the distribution `pellucid-lab`.
_PUBLIC_SOURCES = {
    "PellucidError": ("_errors", "PellucidError"),
    "calibrate_muscles": ("emg.estimators.calibrate_muscles", "calibrate_muscles"),
    "certify": ("people.certificate", "certify"),
    "electromechanical_delay": ("emg.signals.electromechanical_delay", "electromechanical_delay"),
    "fit_hinge": ("orthosis.imu.hinge", "fit_hinge"),
    "maximal_envelope": ("emg.signals.envelope", "maximal_envelope"),
    "median_frequency_trend": ("emg.signals.fatigue", "median_frequency_trend"),
    "stride_ensemble": ("emg.signals.repetitions", "stride_ensemble"),
    "fit_robot": ("arm.fit.fit_robot", "fit_robot"),
    "fit_strap": ("orthosis.strap.identified_strap", "fit_strap"),
    "open": ("study.procedures.registry", "open_study"),
    "assess": ("study.procedures.run", "assess"),
    "audit": ("study.procedures.audit", "audit"),
    "check": ("study.procedures.run", "check"),
    "calibrate": ("study.procedures.run", "calibrate"),
    "identify": ("study.procedures.run", "identify"),
    "onset": ("study.procedures.run", "onset"),
    "activations": ("study.procedures.run", "activations"),
    "cocontraction": ("study.procedures.run", "cocontraction"),
    "synergies": ("study.procedures.run", "synergies"),
    "controller": ("controllers.controller", "controller"),
    "controllers": ("controllers.controller", "controllers"),
    "Instruments": ("controllers.instruments", "Instruments"),
    "Limits": ("controllers.control_law", "Limits"),
    "supervised": ("controllers.supervised", "supervised"),
    "compare": ("study.procedures.compare", "compare"),
    "incident": ("controllers.study.incident", "incident"),
    "report": ("study.procedures.run", "report"),
    "fit_joint": ("joint.fit.fit_joint", "fit_joint"),
    "fit_transfer_function": ("orthosis.transfer.fit_transfer_function", "fit_transfer_function"),
    "init": ("start_study", "init"),
    "predict": ("pellucid_lab.predict", "predict"),
    "simulate": ("pellucid_lab.simulate", "simulate"),
    "reproduce": ("pellucid_lab.papers.reproduce", "reproduce"),
    "datasets": ("study.datasets", None),
    "demo": ("pellucid_lab.demonstration.demo", "demo"),
    "export": ("controllers.export.export", "export"),
    "Muscle": ("emg.models.muscle", "Muscle"),
    "RawEmg": ("files.raw_emg", "RawEmg"),
    "TorqueRegressor": ("emg.estimators.torque_regressor", "TorqueRegressor"),
    "compare_conditions": ("people.comparison", "compare_conditions"),
    "envelope": ("emg.signals.envelope", "envelope"),
    "movement_indices": ("people.movement_indices", "movement_indices"),
    "power_curve": ("people.power", "power_curve"),
    "read_robot": ("arm.urdf", "read_robot"),
    "read": ("files.readers", "read"),
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


class _Package(ModuleType):
    """This package, whose `controllers` is the function of this name, although a folder has the name too."""

    @property
    def controllers(self):
        """Function that lists the controllers of a card."""
        return __getattr__("controllers")

    @controllers.setter
    def controllers(self, module: ModuleType) -> None:
        # The import system sets the folder's module here when one of its files is imported; sys.modules keeps it.
        pass


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str):
    if name == "__version__":
        from importlib.metadata import version

        return version("pellucid")
    if name not in _PUBLIC_SOURCES:
        raise AttributeError(f"module 'pellucid' has no attribute {name!r}; it has {', '.join(__dir__())}")
    from importlib import import_module

    module, attribute = _PUBLIC_SOURCES[name]
    module = module if name in _LAB_NAMES else f"{__name__}.{module}"
    try:
        found = import_module(module)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if not f"{module}.".startswith(f"{missing}."):
            raise
        if name in _LAB_NAMES:
            from ._errors import missing_lab

            raise missing_lab(f"pellucid.{name}") from None
        text = f"pellucid.{name} needs {missing}, which this installation lacks"
        raise ModuleNotFoundError(text, name=missing) from None
    return found if attribute is None else getattr(found, attribute)


def __dir__() -> list[str]:
    return sorted({*__all__, *_PUBLIC_SOURCES})
