"""Batteries over the catalogues of laws, estimators, faults and defects: what is missing for an entry to be whole.

Each battery returns a sentence for each fault, and nothing if all entries are whole. They run on the installed package
and on copies of it in which an entry is half added.
"""

import ast
import re
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import numpy as np

import pellucid
from pellucid import _core
from pellucid.controllers import control_law
from pellucid.controllers.control_law import LAWS, ControlLaw, fuzz, step_times
from pellucid.controllers.export.c_folder import write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.controllers.supervisor_faults import SUPERVISOR_FAULTS, SUPERVISOR_FAULTS_BY_NAME
from pellucid.emg.estimators.families import ESTIMATOR_FAMILIES, find_family
from pellucid.emg.estimators.torque_trial import Features
from pellucid.emg.models.emg_estimator import ESTIMATOR_FAULTS
from pellucid.files import defects
from pellucid.study.drawing.style import COLOURS, colour
from pellucid.study.find_defects import KINDS
from pellucid_lab.safety.fault_table import FAULT_KINDS

PACKAGE = Path(pellucid.__file__).parent
NUMBERS = Path(__file__).parent / "core" / "law_numbers.hpp"
TYPICAL = {
    name: float(value) for name, value in re.findall(r'\{"(\w+)", ([-\d.]+)\}', NUMBERS.read_text(encoding="utf-8"))
}
FUZZED_CYCLES, TIMED_CYCLES = 5_000, 200
FEATURES = Features(np.zeros((1, 2)), ("emg", "angle"), (1,))


def built_laws() -> set[str]:
    """Return the names of the laws that some function of the package makes."""
    found = set()
    for path in (PACKAGE / "controllers").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("ControlLaw", "replace"):
                named = [word.value for word in node.keywords if word.arg == "kind"]
                kind = named[0] if named else node.args[0]
                if isinstance(kind, ast.Constant):
                    found.add(kind.value)
                elif isinstance(kind, ast.Attribute) and hasattr(control_law, ast.unparse(kind.value)):
                    found.add(getattr(control_law, ast.unparse(kind.value)).name)
    return found


def law_faults() -> list[str]:
    """Return what is missing for a control law: words, a builder, an export, a fuzzer's range and a time."""
    found, built = [], built_laws()
    for name, law in LAWS.items():
        if not law.title or not all(sensor.meaning for sensor in law.sensors):
            found.append(f"{name}: has no words")
        found += [f"{name}: {field.name} has no sentence" for field in law.fields if not field.sentence]
        if name not in built:
            found.append(f"{name}: no builder makes it of a card")
        if not (PACKAGE.parents[1] / "include" / "pellucid" / law.header).is_file():
            found.append(f"{name}: has no header of its type's name")
        made = ControlLaw(name, law.defaults | {key: TYPICAL[key] for key in law.defaults if key in TYPICAL})
        tried = fuzz(made, FUZZED_CYCLES)
        if tried.unsafe or not tried.moving:
            found.append(f"{name}: is not safe among nonsense, or gives no effort")
        if not (step_times(made, TIMED_CYCLES) > 0.0).all():
            found.append(f"{name}: its steps cannot be timed")
        with tempfile.TemporaryDirectory() as folder:
            out = write_c_folder("battery", ControllerValues(name, made.values, {}, ("a.json",), {}), Path(folder))
            header = (out / "pellucid_controller.h").read_text(encoding="utf-8")
            found += [f"{name}: {field} is not exported" for field in law.parameters if f"float {field};" not in header]
    return found


def estimator_faults() -> list[str]:
    """Return what is missing for a family of estimators: words, colour, place, and a way to make it."""
    found, ranks = [], [family.rank for family in ESTIMATOR_FAMILIES.values()]
    for name, family in ESTIMATOR_FAMILIES.items():
        if not family.description:
            found.append(f"{name}: has no words")
        if family.colour not in COLOURS or not colour(family.colour):
            found.append(f"{name}: has no colour of a report")
        if ranks.count(family.rank) > 1:
            found.append(f"{name}: another has its place in tables")
        if any(find_family(each)[0] != name for each in (name, *family.aliases)):
            found.append(f"{name}: cannot be asked for by all its names")
        if not family.candidates(neighbours=True) or not family.settings:
            found.append(f"{name}: has nothing to choose from")
        if family.fit_trials is None and not all(hasattr(family.make(s, FEATURES), "fit") for s in family.settings):
            found.append(f"{name}: cannot be made")
    shown = [family.short or family.description for family in ESTIMATOR_FAMILIES.values()]
    return found + [f"{text}: two estimators are called so in legends" for text in {*shown} if shown.count(text) > 1]


def supervisor_faults() -> list[str]:
    """Return what is missing for a fault of the supervisor, of the estimator, or of the lab's list."""
    found = []
    for name in _core.FAULTS[1:]:
        fault = SUPERVISOR_FAULTS_BY_NAME.get(name)
        if fault is None:
            found.append(f"{name}: has no entry in the catalogue")
        elif not fault.when_of_law(1, 2.0) or not fault.response or not fault.advice.endswith("."):
            found.append(f"{name}: has no words, or does not say what to do")
    names = [name for fault in SUPERVISOR_FAULTS for name in fault.names]
    found += [f"{name}: the core has no such fault, or the catalogue has it twice" for name in names
              if name not in _core.FAULTS or names.count(name) > 1]  # fmt: skip
    if tuple(fault.name for fault in ESTIMATOR_FAULTS) != tuple(_core.EMG_FAULTS):
        found.append("the estimator's faults are not the core's, in its order")
    found += [f"{fault.name}: has no words" for fault in ESTIMATOR_FAULTS if not fault.words]
    found += [f"{kind.name}: has no words or group" for kind in FAULT_KINDS if not kind.sentence or not kind.group]
    return found


OTHER_SEARCHERS = {
    "another_clock": "pellucid.files.log",
    "dead": "pellucid.study.procedures.dead_effort",
    "echoed": "pellucid.joint.study.joint_case",
    "garbage": "pellucid.study.recording_steps",
    "saturated": "pellucid.files.log",
    "worn": "pellucid.joint.study.joint_case",
}
"""Modules that search for a kind of defect which is no stretch of one channel, so that `find_defects` cannot cut it."""


def _uses(user: str, module: ModuleType) -> bool:
    """Return whether the module named `user` imports a defect's module, or a function of it."""
    values = vars(import_module(user)).values()
    return any(value is module or getattr(value, "__module__", None) == module.__name__ for value in values)


def defect_faults() -> list[str]:
    """Return what is missing for a defect of recordings: a kind, a sentence, and a place in a search."""
    modules = [import_module(f"{defects.__name__}.{each.name}") for each in iter_modules(defects.__path__)]
    kinds = [module for module in modules if hasattr(module, "KIND")]
    others = [module for module in kinds if module not in KINDS]
    found = [f"{module.KIND}: no study searches for it" for module in others if module.KIND not in OTHER_SEARCHERS]
    for module in others:
        user = OTHER_SEARCHERS.get(module.KIND)
        if user is not None and not _uses(user, module):
            found.append(f"{module.KIND}: {user} does not search for it")
        if not (module.__doc__ or "").startswith("Find "):
            found.append(f"{module.KIND}: does not say how it is found")
    known = {module.KIND for module in others}
    found += [f"{kind}: is listed for {user}, but `find_defects` searches for it, or it is no defect"
              for kind, user in OTHER_SEARCHERS.items() if kind not in known]  # fmt: skip
    for module in KINDS:
        if not module.KIND.isidentifier() or [each.KIND for each in kinds].count(module.KIND) != 1:
            found.append(f"{module.__name__}: has no kind of its own")
        if not (module.__doc__ or "").startswith("Find ") or not callable(getattr(module, "find", None)):
            found.append(f"{module.KIND}: does not say how it is found")
    return found


BATTERIES: dict[str, Callable[[], list[str]]] = {
    "laws": law_faults,
    "estimators": estimator_faults,
    "faults": supervisor_faults,
    "defects": defect_faults,
}
"""Battery of each catalogue."""
