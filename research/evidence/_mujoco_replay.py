"""Held-out recordings of a public servo, replayed in MuJoCo with the model that Pellucid exports, and with others.

The servo swings a pendulum (data set bam_xl330). Each recording is simulated from the measured state at the beginning
of each stretch in which the drive is on: in open loop from the recorded voltage alone, and in closed loop from the
recorded goal, with the servo's own proportional controller, as in policy training. Three reference models are simulated
in the same way:
the models that the recordings' authors identified (M1 with constant friction, M6 with load-dependent friction), and
MuJoCo's own armature, damping and frictionloss with the gravity torque, fitted to the simulated motion of the same
four recordings that Pellucid fits, in open and in closed loop apart. No number is chosen on the four held-out
recordings.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from pellucid.files.readers import read_columns
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized
from research.evidence._exports_read import program_beside

if TYPE_CHECKING:
    from mujoco import MjModel

DATA = Path(os.environ.get("PELLUCID_DATA", "")) / "bam_xl330_pendulum"

FIT = ("2026-01-15_10h28m10", "2026-01-15_10h29m14", "2026-01-15_10h28m32", "2026-01-15_10h29m37")
"""Recordings that models are fitted to: two trajectories at two gains."""

HELD_OUT = ("2026-01-15_10h28m17", "2026-01-15_10h29m21", "2026-01-15_10h28m24", "2026-01-15_10h29m29")
"""Recordings of two other trajectories."""

SUPPLY_V, FULL_DUTY, K, R = 7.4, 885.0, 0.3867, 4.017
"""Supply [V], the number that means 100 %, torque constant [N m/A] and resistance [ohm], as the study states them."""

TIMESTEP_S = 0.001
"""Step of every simulation [s]."""

MIN_STRETCH_S = 0.5
"""A stretch with the drive on is replayed if it lasts at least this long [s]."""

COUNTS_PER_GAIN = 4096.0 / (2.0 * math.pi) / 256.0
"""Counts of the bridge per position error and unit of the servo's gain [1/rad]. On the fitted recordings, this and the
limit of 885 explain more than 99.9 % of the recorded duty's variance."""

MAX_FIT_STEPS = sized(30, smallest=3)
"""Steps of a search for MuJoCo's own friction, from each start and with each loss."""

START_SAMPLES = 8
"""The initial position and velocity of a stretch are those of a line through this many samples."""

MASS_KG, LENGTH_M, GRAVITY = 0.49, 0.10, 9.81
"""The pendulum as its makers state it, and their gravity, for the models that they identified [kg, m, m/s^2]."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of a recording in which the drive is on."""

    time: np.ndarray  # of the samples, from 0 [s]
    position: np.ndarray  # [rad]
    command: np.ndarray  # recorded voltage at each step of the simulation [V]
    goal: np.ndarray  # position that the servo is to reach at each step [rad]
    stiffness: float  # voltage per position error; 0 in open loop [V/rad]
    start: tuple[float, float]  # initial position and velocity


Simulate = Callable[[Stretch], np.ndarray]
"""Returns the position at every step of a stretch [rad]."""


def stretches(name: str, *, closed: bool) -> list[Stretch]:
    """The stretches of a recording, to be simulated in `closed` loop or from its voltage."""
    columns = read_columns(DATA / f"{name}.json")
    time, position = columns["entries.timestamp"], columns["entries.position"]
    load, on = columns["entries.load"], columns["entries.torque_enable"] > 0.5
    load = np.where(load > 32767.0, load - 65536.0, load)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], on.astype(int), [0]))))
    found = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        t = time[first:last] - time[first]
        if t[-1] < MIN_STRETCH_S:
            continue
        slope, level = np.polyfit(t[:START_SAMPLES], position[first : first + START_SAMPLES], 1)
        steps = np.arange(0.0, t[-1], TIMESTEP_S)
        held = np.clip(np.searchsorted(t, steps, side="right") - 1, 0, len(t) - 1)
        command = SUPPLY_V * load[first:last][held] / FULL_DUTY
        goal = columns["entries.goal_position"][first:last][held]
        stiffness = SUPPLY_V / FULL_DUTY * COUNTS_PER_GAIN * float(columns["kp"][0]) if closed else 0.0
        found.append(Stretch(t, position[first:last], command, goal, stiffness, (float(level), float(slope))))
    return found


def rms_error_deg(simulate: Simulate, names: tuple[str, ...], *, closed: bool) -> float:
    """RMS of the position error over all samples of recordings [deg]."""
    known = [stretch for name in names for stretch in stretches(name, closed=closed)]
    errors = np.concatenate([position_errors(simulate, stretch) for stretch in known])
    return math.degrees(float(np.sqrt(np.mean(np.square(errors)))))


def position_errors(simulate: Simulate, stretch: Stretch) -> np.ndarray:
    """Simulated less measured positions at the samples [rad]."""
    made = simulate(stretch)
    return np.interp(stretch.time, TIMESTEP_S * np.arange(len(made)), made) - stretch.position


def exported(folder: Path, *, callback: bool = True) -> Simulate:
    """The simulation with an exported folder, its friction program used or not."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    model.opt.timestep = TIMESTEP_S
    friction = program_beside(folder).Friction(model) if callback else None

    def simulate(stretch: Stretch) -> np.ndarray:
        return stepped(mujoco, model, stretch, friction.update if friction else None)

    return simulate


def stepped(mujoco, model, stretch: Stretch, update: Callable | None) -> np.ndarray:
    """Positions of a model that is stepped through a stretch; `update` sets its friction before each step."""
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = stretch.start
    mujoco.mj_forward(model, data)
    position = np.empty(len(stretch.command))
    for i, volts in enumerate(stretch.command):
        position[i] = data.qpos[0]
        if stretch.stiffness:
            volts = max(-SUPPLY_V, min(SUPPLY_V, stretch.stiffness * (stretch.goal[i] - data.qpos[0])))
        data.ctrl[0] = volts
        if update is not None:
            update(model, data)
        mujoco.mj_step(model, data)
    return position


PENDULUM = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" integrator="implicitfast" gravity="0 0 -{g}"><flag contact="disable"/></option>
  <worldbody><body>
    <joint name="j" type="hinge" axis="0 1 0" armature="{armature!r}" damping="{damping!r}" frictionloss="{loss!r}"
           solreffriction="0.002 1" solimpfriction="0.99 0.999 0.001 0.5 2"/>
    <inertial pos="{x!r} 0 {z!r}" mass="{mass!r}" diaginertia="1e-7 1e-7 1e-7"/>
  </body></worldbody>
  <actuator>
    <general joint="j" gainprm="{gain!r}" biastype="affine" biasprm="0 {bias!r} 0" forcerange="-{most!r} {most!r}"/>
    <general joint="j" gainprm="0" biastype="affine" biasprm="0 0 {brake!r}"/>
  </actuator>
</mujoco>
"""


def pendulum(
    *,
    armature: float,
    damping: float,
    loss: float,
    mass: float,
    offset: float = 0.0,
    k: float = K,
    r: float = R,
    stiffness: float = 0.0,
) -> MjModel:
    """A pendulum of a mass at the stated length behind a motor, in MuJoCo; `offset` is where its angle is not 0 [rad].

    Its command is a voltage, or with a `stiffness` [V/rad] the position that its controller is to reach.
    """
    import mujoco

    gain = k / r * (stiffness or 1.0)
    text = PENDULUM.format(
        step=TIMESTEP_S, g=GRAVITY, armature=armature, damping=damping, loss=max(loss, 1e-9), mass=mass,
        x=-LENGTH_M * math.sin(offset), z=-LENGTH_M * math.cos(offset), gain=gain, bias=-gain if stiffness else 0.0,
        most=k / r * SUPPLY_V, brake=-k * k / r,
    )  # fmt: skip
    return mujoco.MjModel.from_xml_string(text)


def plain_mujoco(values: np.ndarray) -> Simulate:
    """MuJoCo's own friction: `values` are armature, mass, damping and frictionloss, each as a logarithm."""
    import mujoco
    from mujoco import rollout

    armature, mass, damping, loss = np.exp(values).tolist()
    models: dict[float, MjModel] = {}

    def simulate(stretch: Stretch) -> np.ndarray:
        if stretch.stiffness not in models:
            models[stretch.stiffness] = pendulum(
                armature=armature, damping=damping, loss=loss, mass=mass, stiffness=stretch.stiffness
            )
        model = models[stretch.stiffness]
        control = np.zeros((1, len(stretch.command), model.nu))
        control[0, :, 0] = stretch.goal if stretch.stiffness else stretch.command
        # Time, position and velocity are the whole state.
        states, _ = rollout.rollout(model, mujoco.MjData(model), np.array([[0.0, *stretch.start]]), control)
        return np.concatenate([[stretch.start[0]], states[0, :-1, 1]])

    return simulate


def fit_plain_mujoco(*, closed: bool) -> np.ndarray:
    """Values of `plain_mujoco` with the smallest squared position error on the fitted recordings, from two starts."""
    known = [stretch for name in FIT for stretch in stretches(name, closed=closed)]

    def errors(values: np.ndarray) -> np.ndarray:
        simulate = plain_mujoco(values)
        found = np.concatenate([position_errors(simulate, stretch) for stretch in known])
        return np.nan_to_num(found, nan=10.0)

    options = {"diff_step": 1e-3, "x_scale": 0.3, "ftol": 1e-5, "xtol": 1e-4, "max_nfev": MAX_FIT_STEPS}
    starts = np.log([[0.002, MASS_KG, 0.005, loss] for loss in (0.02, 0.08)])
    found = [least_squares(errors, start, loss="soft_l1", f_scale=0.5, **options) for start in starts]
    # The robust loss leads out of motions that go over the top; plain squares decide and end the search.
    ended = [least_squares(errors, one.x, **options) for one in found]
    return min(ended, key=lambda one: one.cost).x


def authors_model(path: Path) -> Simulate:
    """The model that the recordings' authors identified, with their rule for friction before each step."""
    import mujoco

    said = json.loads(path.read_text(encoding="utf-8"))
    k, r = said["kt"], said["R"]
    model = pendulum(armature=said["armature"], damping=said["friction_viscous"], loss=said["friction_base"],
                     mass=MASS_KG, offset=said["q_offset"], k=k, r=r)  # fmt: skip
    if "load_friction_motor" not in said:
        return lambda stretch: stepped(mujoco, model, stretch, None)

    def update(model, data) -> None:
        v = float(data.qvel[0])
        # The command of a pendulum without a stiffness is the voltage, in closed loop too.
        motor = k / r * float(data.ctrl[0]) - k * k / r * v
        outside = -float(data.qfrc_bias[0])
        rise = math.exp(-(abs(v / said["dtheta_stribeck"]) ** said["alpha"]))
        loss = said["friction_base"] + rise * said["friction_stribeck"]
        for part, share in (("", 1.0), ("_stribeck", rise)):
            from_outside = outside * said[f"load_friction_external{part}"]
            loss += share * abs(from_outside - motor * said[f"load_friction_motor{part}"])
        if motor * outside < 0.0:
            square = said["load_friction_external_quad"] * outside**2
            loss += rise * (square if abs(outside) < abs(motor) else said["load_friction_motor_quad"] * motor**2)
        model.dof_frictionloss[0] = max(loss, 1e-9)

    return lambda stretch: stepped(mujoco, model, stretch, update)


def exported_folder(scratch: Path, purpose: str) -> Path:
    """The folder that the commands write for the data set, with the study's default or another [model] purpose."""
    folder = scratch / f"servo_{purpose or 'default'}"
    run = [sys.executable, "-m", "pellucid.cli"]
    subprocess.run([*run, "init", folder, "--dataset", "bam_xl330"], check=True, stdout=subprocess.DEVNULL)
    if purpose:
        text = (folder / "study.toml").read_text(encoding="utf-8")
        said = text.replace("[model]\n", f'[model]\npurpose = "{purpose}"\n', 1)
        (folder / "study.toml").write_text(said, encoding="utf-8")
    for arguments in (["identify", folder], ["export", folder, "--to", "mjcf"]):
        subprocess.run([*run, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return folder / "mjcf"


def rows() -> Iterator[ResultRow]:
    """Errors of every model on what was fitted and on what was held out, in open and in closed loop."""
    with tempfile.TemporaryDirectory() as scratch:
        simulation = exported_folder(Path(scratch), "simulation")
        torque = exported_folder(Path(scratch), "")
        said = 'exported with [model] purpose = "simulation"'
        models: dict[str, tuple[Simulate, str]] = {
            "exported": (exported(simulation), f"{said}; model.xml with friction.py"),
            "exported_xml_alone": (exported(simulation, callback=False), f"{said}; without friction.py"),
            "exported_for_torque": (exported(torque), "exported with the default purpose, torque"),
        }
        for name in ("m1", "m6"):
            path = DATA / f"REFERENCE_params_{name}.json"
            note = "identified by the authors, who may have seen these recordings"
            models[f"authors_{name}"] = authors_model(path), note
        for loop, closed in (("open", False), ("closed", True)):
            own = plain_mujoco(fit_plain_mujoco(closed=closed))
            note = "armature, mass, damping and frictionloss fitted to the motion"
            yield from _loop_rows(loop, {**models, "own_fit": (own, note)}, closed=closed)


def _loop_rows(loop: str, models: dict[str, tuple[Simulate, str]], *, closed: bool) -> Iterator[ResultRow]:
    """Rows of one way to replay."""
    held = {name: rms_error_deg(simulate, HELD_OUT, closed=closed) for name, (simulate, _) in models.items()}
    fitted = {name: rms_error_deg(simulate, FIT, closed=closed) for name, (simulate, _) in models.items()}

    def row(name: str, value: float, unit: str, note: str) -> ResultRow:
        return ResultRow(f"formats.mujoco.{name}", value, unit, "evidence", "heldout", None, note)

    # The row without a suffix is that of the open loop, in which nothing but the model holds the motion.
    end = "" if not closed else "_closed_loop"
    note = f"RMS position error of held-out recordings in {loop} loop, over that of MuJoCo's own friction"
    yield row(f"heldout_error_over_own_fit{end}", held["exported"] / held["own_fit"], "1", note)
    yield row(f"default_purpose_error_over_own_fit{end}", held["exported_for_torque"] / held["own_fit"], "1", note)
    for name, (_, note) in models.items():
        yield row(f"{loop}_loop.{name}.heldout_error", held[name], "deg", note)
        yield row(f"{loop}_loop.{name}.fitted_error", fitted[name], "deg", note)
