"""A new rig is two files, its class and its constants, or a class in one's own session; commands take it from there."""

import json

import pytest
from copied_package import copied_package, run_copied

import pellucid
from pellucid._errors import StudyError
from pellucid.models.card import read_card

PENDULUM = '''\
"""A pendulum on a torque motor."""

from dataclasses import dataclass

import numpy as np

from pellucid import _core
from pellucid.models.joint import NAMES
from pellucid.numerics.protocols.excitation import multisine
from ..constants import Gain, Quantum, Rate, RigConstants, RigTable, Torque, Viscosity
from ..recorded_table import MAIN_STREAM, Column, StoredTable
from ..rig import Rig, Taken, Trial


class JointTable(RigTable):
    """``[joint]``: the pendulum; names are those of the core's joint."""

    inertia: float  # [kg*m^2]
    gravity_sine: Torque  # [N*m]
    coulomb_positive: Torque  # [N*m]
    coulomb_negative: Torque  # [N*m]
    viscous_positive: Viscosity  # [N*m*s/rad]
    viscous_negative: Viscosity  # [N*m*s/rad]


class EncoderTable(RigTable):
    """``[encoder]``."""

    quantum: Quantum  # [rad]


class LoopTable(RigTable):
    """``[loop]``."""

    kp: Gain  # [1/s]
    kv: Gain  # [N*m*s/rad]


class SamplingTable(RigTable):
    """``[sampling]``."""

    rate: Rate  # [Hz]


class PendulumConstants(RigConstants):
    """The tables of its file."""

    joint: JointTable
    encoder: EncoderTable
    loop: LoopTable
    sampling: SamplingTable


@dataclass(frozen=True)
class PendulumRig(Rig):
    """A pendulum on a torque motor."""

    constants: PendulumConstants

    kind = "pendulum"
    constants_type = PendulumConstants

    def streams(self):
        position = Column("position", "counts", "rad", self.constants.encoder.quantum)
        return {MAIN_STREAM: (Column("time", "time", "ms"), position, Column("torque", "torque", "N*m", 1e-4))}

    def trials(self, seed=1):
        rate, made = self.constants.sampling.rate, []
        for i, use in enumerate(("fit", "validate")):
            shape = {"fundamental": 0.2, "harmonics": 8, "amplitude": 0.8, "centre": 0.3}
            path = multisine(10.0, rate, rng=np.random.default_rng([seed, i]), **shape)
            made.append(Trial(f"wave_{i + 1}", use=use, reference=path))
        return made

    def record(self, trial, rng, controller=None):
        period, n = 1.0 / self.constants.sampling.rate, len(trial.reference)
        joint, loop = self.constants.joint.model_dump(), self.constants.loop.model_dump()
        rows = np.array([[joint.get(name, 0.0) for name in NAMES]])
        quantum = self.constants.encoder.quantum
        _, _, _, torque, _, measured = _core.simulate_batch(
            rows, reference=trial.reference, period=period, substeps=10, limit=9.0, gain=1.0,
            encoder_quantum=quantum, encoder_noise=1e-5 * rng.standard_normal((1, n)),
            position0=float(trial.reference[0]), stiction=True, loop="cascade", velocity_span=4, **loop,
        )
        sensed = 0.5 * (torque[0] + np.concatenate([torque[0, :1], torque[0, :-1]])) + 0.01 * rng.standard_normal(n)
        counts = (1e3 * period * np.arange(n), np.round(measured[0] / quantum), np.round(sensed / 1e-4))
        return Taken(trial, {trial.name: {MAIN_STREAM: StoredTable.of(self.streams()[MAIN_STREAM], *counts)}})

    def study(self, made):
        drive = {"kind": "torque", "limit": "9 N*m"}
        loop = {"kind": "cascade", "velocity_span": 4, "limit": "9 N*m", **self.constants.loop.model_dump()}
        processing = {"lowpass": "40 Hz", "decimate": 10, "dead_band": "0.1 rad/s", "trim": 100}
        rig = {"joint": "pendulum", "motion": "rotary", "lifts": "extension", "drive": drive, "loop": loop}
        return {**super().study(made), "rig": rig, "processing": processing, "model": {"gravity": "sine"}}

    def truth(self, seed=1):
        return self.constants.joint.model_dump()
'''

CONSTANTS = """\
kind = "pendulum"

[joint]
inertia = 0.12
gravity_sine = 2.0
coulomb_positive = 0.3
coulomb_negative = 0.3
viscous_positive = 0.15
viscous_negative = 0.15

[encoder]
quantum = 2e-5

[loop]
kp = 12.0
kv = 3.0

[sampling]
rate = 1000.0
"""

COMMANDS = """
import sys
from typer.testing import CliRunner
from pellucid.cli import app
folder = sys.argv[1]
for command in (
    ["init", folder, "--rig", "pendulum"], ["simulate", folder, "--seed", "3"], ["check", folder],
    ["identify", folder], ["export", folder],
):
    result = CliRunner().invoke(app, command)
    print(" ".join(command), result.exit_code, result.output[-2000:])
    if result.exit_code:
        raise result.exception
"""


@pytest.mark.slow
def test_a_new_rig_is_two_files_and_goes_from_init_to_export(tmp_path):
    package = copied_package(tmp_path)
    own = {"pellucid_lab/pendulum/rig.py": PENDULUM, "pellucid_lab/rigs/pendulum.toml": CONSTANTS}
    for file, text in own.items():
        (package.parent / file).parent.mkdir(exist_ok=True)
        (package.parent / file).write_text(text, encoding="utf-8")
    assert len(own) == 2
    study = tmp_path / "study"
    done = run_copied(package.parent, COMMANDS, study)
    assert done.returncode == 0, done.stdout + done.stderr
    found = {p.name: p.value for p in read_card(study / "models" / "joint.json").parameters}
    truth = json.loads((study / "lab" / "truth.json").read_text(encoding="utf-8"))
    assert found["inertia"] == pytest.approx(truth["inertia"], rel=0.05)
    assert found["gravity"] == pytest.approx(truth["gravity_sine"], rel=0.05)
    assert list((study / "controller").glob("*.h"))


def test_a_rig_that_a_session_defines_is_found_by_its_kind(tmp_path):
    """Without touching the package: a class in a notebook, and a file of one's own."""
    from pellucid_lab.known_rigs import load_rig
    from pellucid_lab.rig import KINDS, Rig

    class Nothing(Rig):
        kind = "nothing"

        def streams(self):
            return {"main": ()}

        def trials(self, seed=1):
            return ()

        def record(self, trial, rng, controller=None):
            raise NotImplementedError

        def truth(self, seed=1):
            return {}

    try:
        (tmp_path / "mine.toml").write_text('kind = "nothing"\n', encoding="utf-8")
        rig = load_rig(tmp_path / "mine.toml")
        assert type(rig) is Nothing
        (tmp_path / "other.toml").write_text('kind = "nothing"\nmass = 1\n', encoding="utf-8")
        with pytest.raises(StudyError, match="rig other, line 2: found mass, expected some of kind"):
            load_rig(tmp_path / "other.toml")
        assert rig.name == "mine"
        assert pellucid.init(tmp_path / "study", rig=str(tmp_path / "mine.toml")).read_text() == 'kind = "nothing"\n'
    finally:
        del KINDS["nothing"]
