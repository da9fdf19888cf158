"""The names people may rely on, and what importing them costs: nothing until they are used."""

import builtins
import subprocess
import sys

import pytest

import pellucid

NAMES = [
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
    "cards",
    "certify",
    "check",
    "cocontraction",
    "commission",
    "compare",
    "compare_conditions",
    "controller",
    "controllers",
    "datasets",
    "demo",
    "electromechanical_delay",
    "emg_quality",
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
    "open",
    "plan",
    "power_curve",
    "predict",
    "propose",
    "read",
    "read_robot",
    "report",
    "reproduce",
    "simulate",
    "stride_ensemble",
    "supervised",
    "synergies",
]
COMMANDS = [
    "init",
    "simulate",
    "predict",
    "protocol",
    "check",
    "identify",
    "calibrate",
    "assess",
    "certificate",
    "onset",
    "cocontraction",
    "emg",
    "emg-force",
    "help",
    "synergies",
    "activations",
    "report",
    "compare",
    "demo",
    "reproduce",
    "rank",
    "export",
    "commission",
    "incident",
    "repair",
    "audit",
    "live",
    "paper",
    "datasets",
    "plan",
    "try",
]
HEAVY = ("numpy", "scipy", "matplotlib", "pydantic", "pint", "rich", "jinja2", "pooch", "importlib.metadata")


def test_public_names_are_frozen():
    """A name leaves or joins this list on purpose, with a line in the documentation."""
    assert dir(pellucid) == NAMES
    assert sorted(pellucid.__all__) == [name for name in NAMES if name != "open"]


def test_importing_every_name_replaces_no_builtin():
    assert not set(pellucid.__all__) & set(dir(builtins))
    names = {}
    exec("from pellucid import *", names)
    assert names["identify"] is pellucid.identify
    assert "open" not in names


def test_every_public_name_is_there():
    for name in NAMES:
        assert getattr(pellucid, name) is not None
    assert all(callable(getattr(pellucid, n)) for n in NAMES if n not in ("__version__", "cards", "datasets"))


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(AttributeError, match="identify"):
        _ = pellucid.identity


def test_commands_are_frozen():
    from pellucid.cli import app

    named = [c.name or c.callback.__name__ for c in app.registered_commands]
    named += [g.typer_instance.info.name for g in app.registered_groups]
    assert sorted(named) == sorted(COMMANDS)


def _loaded_by(code: str) -> set[str]:
    script = f"import sys\n{code}\nprint('\\n'.join(m for m in sys.modules))"
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(run.stdout.splitlines())


def test_importing_costs_nothing():
    assert not _loaded_by("import pellucid") & set(HEAVY)


def test_help_loads_nothing_heavy():
    """Told by what is loaded, not by the clock."""
    code = (
        "from pellucid.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit as stop:\n    assert not stop.code\n"
    )
    assert not _loaded_by(code) & set(HEAVY)


def test_checking_a_study_loads_what_it_needs(make_study):
    study = make_study()
    code = (
        "from pellucid.cli import app\n"
        f"try:\n    app(['check', {str(study.folder)!r}])\nexcept SystemExit as stop:\n    assert not stop.code\n"
    )
    loaded = _loaded_by(code)
    assert "pellucid.study.procedures.run" in loaded
    assert not loaded & {"scipy.stats", "scipy.signal", "scipy.optimize", "scipy.special", "matplotlib", "sklearn"}
