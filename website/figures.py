"""Figures of the explanation, one for each chapter, computed by the functions that the chapters explain.

`python website/figures.py` writes all into docs/images/explanation, `python website/figures.py NAME...` some of them.
"""

from __future__ import annotations

import json
import sys
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.signal import lsim
from svg import Panel, figure

import pellucid as pl
from pellucid import _core
from pellucid.arm.fit.consistent_inertias import scaled_pseudo_inertia
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.residual_compensator import Law, design
from pellucid.controllers.stability import LinearSystem, closed_loop, radius, sampled, worn_orthosis
from pellucid.controllers.tree_stability import (
    DRAWN_LIMBS,
    LinearShares,
    TreeCoupling,
    closed_tree,
    linear_law,
    sampled_each,
    with_limb,
    worn_tree,
)  # fmt: skip
from pellucid.models.joint import FAMILIES, joint_model
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.slider_joint import UNITS, DirectionalSliderModel
from pellucid.numerics.filters import zero_phase_lowpass
from pellucid.orthosis.strap.strap_model import StrapModel
from pellucid_lab.pointing.movement_choice import preferred_duration

FOLDER = Path(__file__).parents[1] / "docs" / "images" / "explanation"
"""Folder of the figures; each has the name of its chapter."""

G = 9.81
"""Gravitational acceleration [m/s^2]."""

SUPERVISOR_RESULTS = FOLDER.parents[2] / "research" / "evidence" / "results" / "supervisor.json"
"""Results of the validation of the supervisor."""

RIG = Path(pl.__file__).parents[2] / "lab" / "src" / "pellucid_lab" / "rigs" / "elbow-participants.toml"
"""Constants of simulated participants."""


def joint_motion(duration: float = 40.0, rate: float = 100.0) -> tuple[np.ndarray, ...]:
    """Return time, angle, velocity and acceleration of a joint that moves through a wide range."""
    t = np.arange(0.0, duration, 1.0 / rate)
    amplitude, speed = np.array([[0.7], [0.3], [0.1]]), np.array([[1.3], [4.1], [7.3]])
    q, v = (amplitude * np.sin(speed * t)).sum(0), (amplitude * speed * np.cos(speed * t)).sum(0)
    return t, q, v, -(amplitude * speed**2 * np.sin(speed * t)).sum(0)


def joint_effort(q, v, a, *, load_friction: float = 0.0) -> np.ndarray:
    """Return the torque of a joint: inertia 0.05 kg m^2, gravity 1.5 N m, Coulomb and viscous friction."""
    load = 0.05 * a + 1.5 * np.sin(q)
    return load + (0.1 + load_friction * np.abs(load)) * np.sign(v) + 0.05 * v


def checks_of_recordings() -> str:
    """Excluded samples of a torque with a spike and a dropout."""
    t, q, v, a = joint_motion(20.0, 200.0)
    effort = joint_effort(q, v, a) + 0.02 * np.random.default_rng(1).standard_normal(t.size)
    effort[1700:1702] += 4.0
    effort[2150:2260] = effort[2150]
    proposal = pl.propose({"t": t, "angle": q, "torque": effort}, units={"angle": "rad", "torque": "N*m"})
    panel = Panel("time [s]", "torque [N·m]", "Recorded torque and excluded samples", x_range=(8.0, 12.0))
    shown = (t > 8.0) & (t < 12.0)
    with tempfile.TemporaryDirectory() as folder:
        recordings = proposal.study(Path(folder) / "study").recordings()
    cuts = [cut for recording in recordings for cut in (recording.uncut or recording).cuts]
    for k, (start, stop) in enumerate(sorted({(round(c.start, 3), round(c.stop, 3)) for c in cuts})):
        edges = np.array([start - 0.03, stop + 0.03])
        panel.band(edges, np.full(2, -2.0), np.full(2, 4.5), 1, "" if k else "excluded")
    return figure([panel.line(t[shown], effort[shown], "torque")], "A torque with a spike and a dropout")


def joint_and_friction() -> str:
    """Friction of each family against velocity."""
    v = np.linspace(-2.0, 2.0, 401)
    values = {
        "coulomb": 0.4, "viscous": 0.15, "coulomb_positive": 0.5, "coulomb_negative": 0.3, "viscous_positive": 0.2,
        "viscous_negative": 0.1, "load": 0.15, "stribeck": 0.25, "stribeck_velocity": 0.2,
    }  # fmt: skip
    panel = Panel("velocity [rad/s]", "friction torque [N·m]", "Friction families at a load of 2 N·m")
    for colour, family in enumerate(("symmetric", "directional", "load", "stribeck")):
        model = joint_model(family, motion="rotary", effort_unit="N*m", gravity="sine")
        at = np.array([values.get(name, next((n for k, n in values.items() if name.startswith(k)), 0.0))
                       for name in model.names])  # fmt: skip
        panel.line(v, _core.friction(model.vector(at), v, np.full_like(v, 2.0)), family, colour)
    assert set(FAMILIES) >= {"symmetric", "directional", "load", "stribeck"}
    return figure([panel], "Friction torque against velocity for four friction families")


def filtering_and_derivatives() -> str:
    """Gain of the zero-phase low-pass, and of the acceleration that is computed with it."""
    fs, cutoff, n = 1000.0, 10.0, 8192
    pulse = np.zeros(n)
    pulse[n // 2] = 1.0
    frequency = np.fft.rfftfreq(n, 1.0 / fs)
    gain = np.abs(np.fft.rfft(zero_phase_lowpass(pulse, cutoff, 4, fs)))
    shown = (frequency >= 0.5) & (frequency <= 60.0)
    frequency, gain = frequency[shown], gain[shown]
    square, kept = (2.0 * np.pi * frequency) ** 2, gain > 1e-4
    left = Panel("frequency [Hz]", "gain of the position", "Low-pass, cut-off 10 Hz", x_log=True, y_log=True,
                 y_range=(1e-4, 3.0), x_range=(0.5, 60.0)).line(frequency[kept], gain[kept])  # fmt: skip
    right = Panel("frequency [Hz]", "gain of the acceleration [1/s²]", "Second derivative", x_log=True, y_log=True,
                  x_range=(0.5, 60.0), y_range=(1.0, 3e5))  # fmt: skip
    right.line(frequency, square, "unfiltered", 4, dashed=True)
    right.line(frequency[kept], (square * gain)[kept], "filtered")
    return figure([left, right], "Gain of the low-pass filter for a position and for its second derivative")


def least_squares_and_model_selection() -> str:
    """Errors of friction families on fitted and held-out data of a joint with load friction."""
    t, q, v, a = joint_motion()
    effort = joint_effort(q, v, a, load_friction=0.25) + 0.05 * np.random.default_rng(2).standard_normal(t.size)
    names = ("symmetric", "directional", "load", "stribeck")
    fit = pl.fit_joint(t, q, effort, lowpass=10.0, decimate=4, held_out=0.25, friction=list(names))
    places = np.arange(len(names), dtype=float)
    panel = Panel("friction family", "error of the torque [%]", "A joint with load friction", x_names=names)
    panel.bars(places, [fit.families[n].fitted_effort_error for n in names], "fitted")
    panel.bars(places.copy(), [fit.families[n].heldout_effort_error for n in names], "held out", 1)
    return figure([panel], "Torque error of four friction families on fitted and held-out data")


def uncertainty() -> str:
    """Intervals of the inertia from repeated recordings, by Pellucid and by ordinary least squares."""
    t, q, v, a = joint_motion(20.0)
    clean = joint_effort(q, v, a, load_friction=0.03)
    panels = [Panel("recording", "inertia [g·m²]", title, x_range=(-1.0, 24.0), y_range=(45.0, 57.0))
              for title in ("Ordinary least squares", "Pellucid")]  # fmt: skip
    for seed in range(24):
        rng = np.random.default_rng(seed)
        noise = np.convolve(rng.standard_normal(t.size + 40), np.ones(40) / 40.0, "valid")[: t.size]
        fit = pl.fit_joint(t, q, clean + 0.3 * noise, lowpass=10.0, decimate=4)
        columns = np.c_[a, np.sin(q), v, np.sign(v), np.ones(t.size)]
        found, squares, *_ = np.linalg.lstsq(columns, clean + 0.3 * noise, rcond=None)
        sd = np.sqrt(squares[0] / (t.size - 5) * np.linalg.inv(columns.T @ columns)[0, 0])
        for panel, value, (low, high) in (
            (panels[0], found[0], (found[0] - 1.96 * sd, found[0] + 1.96 * sd)),
            (panels[1], fit["inertia"].value, fit["inertia"].interval(0.95)),
        ):
            panel.line([seed, seed], 1e3 * np.array([low, high]), "95 % interval" if seed == 0 else "", 0)
            panel.points([seed], [1e3 * value], "estimate" if seed == 0 else "", 0)
    for panel in panels:
        panel.line([-1.0, 24.0], [50.0, 50.0], "true value", 1, dashed=True)
    return figure(panels, "Confidence intervals of the inertia from 24 simulated recordings")


def figures_of_merit() -> str:
    """Residual against load, with and without the term that causes it."""
    t, q, v, a = joint_motion()
    effort = joint_effort(q, v, a, load_friction=0.25) + 0.03 * np.random.default_rng(3).standard_normal(t.size)
    load = 0.05 * a + 1.5 * np.sin(q)
    chosen = np.random.default_rng(0).permutation(t.size)[:220]
    panels = []
    for family, title in (("symmetric", "Symmetric friction"), ("load", "Load friction")):
        fit = pl.fit_joint(t, q, effort, lowpass=10.0, decimate=4, friction=family)
        words = f"{title}: error {fit.effort_error:.1f} %"
        panel = Panel("load in the direction of motion [N·m]", "residual [N·m]", words, y_range=(-0.4, 0.4))
        panels.append(panel.points((np.abs(load) * np.sign(v))[chosen], (effort - fit.predict(t, q))[chosen]))
    return figure(panels, "Residual of the torque against the load for two friction models")


def free_carriage() -> str:
    """Inertia and gravity of an elbow robot against the position of its carriage."""
    values = {"moment_slope": 0.48, "moment": 0.22, "a0": 0.06, "a2": 0.48}
    one = np.array([values.get(name, 0.0) for name in UNITS])
    model, x = DirectionalSliderModel(one, one), np.linspace(0.08, 0.24, 60)
    left = Panel("carriage position [m]", "inertia [kg·m²]", "Inertia").line(x, model.inertia("up", x))
    right = Panel("carriage position [m]", "gravity torque at 90° [N·m]", "Gravity")
    right.line(x, model.gravity("up", x, np.full_like(x, 0.5 * np.pi)))
    return figure([left, right], "Inertia and gravity torque against the position of the carriage")


def rotations(axis: int, angle: np.ndarray) -> np.ndarray:
    """Return rotations about an axis, shape (n, 3, 3)."""
    made = np.zeros((angle.size, 3, 3))
    made[:, axis, axis] = 1.0
    i, j = (axis + 1) % 3, (axis + 2) % 3
    made[:, i, i] = made[:, j, j] = np.cos(angle)
    made[:, j, i], made[:, i, j] = np.sin(angle), -np.sin(angle)
    return made


def inertial_sensors() -> str:
    """Angle of a hinge by integrated angular rates and by the fitted hinge."""
    rate, t = 100.0, np.arange(0.0, 60.0, 0.01)
    lean, hinge = 0.4 * np.sin(0.9 * t), 0.7 * np.sin(1.7 * t) + 0.3 * np.sin(4.3 * t)
    tilt = 0.3 * np.sin(0.5 * t)
    rng = np.random.default_rng(4)
    sensors = []
    for angle, place in ((lean, np.array([0.0, 0.15, 0.02])), (lean + hinge, np.array([0.0, -0.12, 0.01]))):
        turn = rotations(0, tilt) @ rotations(2, angle)
        change = np.gradient(turn, t, axis=0)
        skew = np.swapaxes(turn, 1, 2) @ change
        omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1)
        alpha = np.gradient(omega, t, axis=0)
        force = np.cross(alpha, place) + np.cross(omega, np.cross(omega, place))
        force += np.einsum("nji,j->ni", turn, np.array([0.0, G, 0.0]))
        bias = np.array([0.004, -0.003, 0.012])
        sensors.append((omega + bias * len(sensors) + 0.005 * rng.standard_normal(omega.shape),
                        force + 0.05 * rng.standard_normal(force.shape)))  # fmt: skip
    fit = pl.fit_hinge(t, *sensors)
    integrated = np.cumsum(sensors[1][0][:, 2] - sensors[0][0][:, 2]) / rate
    sign = 1.0 if np.corrcoef(fit.angle.angle, hinge)[0, 1] > 0 else -1.0
    found = sign * fit.angle.angle
    panel = Panel("time [s]", "error of the angle [deg]", "Angle of a hinge from two inertial sensors")
    panel.line(t, np.degrees(integrated - integrated[0] - hinge), "integrated angular rates", 1)
    panel.line(t, np.degrees(found - np.mean(found - hinge) - hinge), "fitted hinge")
    return figure([panel], "Error of a hinge angle by integration and by the fitted hinge")


def raw_emg(seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Return time and simulated raw EMG of two contractions [mV]."""
    t = np.arange(0.0, 6.0, 5e-4)
    active = np.where((t > 1.2) & (t < 2.4), 1.0, 0.0) + np.where((t > 3.8) & (t < 5.0), 0.6, 0.0)
    return t, 0.25 * (0.04 + active) * np.random.default_rng(seed).standard_normal(t.size)


def emg_processing() -> str:
    """Raw EMG, its envelope and detected onsets."""
    t, emg = raw_emg()
    envelope = pl.envelope(emg, rate=2000.0, chain="hill")
    bursts = pl.onset(emg, rate=2000.0).bursts
    panel = Panel("time [s]", "EMG [mV]", "Raw EMG, envelope and detected bursts", y_range=(-1.1, 1.1))
    edges = np.linspace(t[0], t[-1], 261)
    slots = [emg[(t >= low) & (t < high)] for low, high in pairwise(edges)]
    panel.band(edges[:-1], [s.min() for s in slots], [s.max() for s in slots], 4, "raw EMG")
    panel.line(t, envelope, "envelope, relative to its largest")
    for k, burst in enumerate(bursts):
        panel.line([burst.onset.time, burst.end.time], [-0.9, -0.9], "" if k else "burst", 1)
    return figure([panel], "Raw EMG with its envelope and the detected bursts")


def torque_from_emg() -> str:
    """Torque of a joint from EMG on held-out data, with the error band of the estimator."""
    rng = np.random.default_rng(6)
    t = np.arange(0.0, 60.0, 0.02)
    flexor, extensor = (np.clip(np.sin(0.9 * t + p), 0.0, None) ** 1.5 for p in (0.0, np.pi))
    angle = 0.6 * np.sin(0.35 * t)
    torque = 28.0 * flexor - 20.0 * extensor + 4.0 * np.sin(angle) + rng.normal(0.0, 0.8, t.size)
    rows = np.c_[flexor + 0.04 * rng.standard_normal(t.size), extensor + 0.04 * rng.standard_normal(t.size), angle]
    fitted = t < 40.0
    estimator = pl.TorqueRegressor("ridge").fit(rows[fitted], torque[fitted], groups=(t[fitted] // 5.0).astype(int))
    found = estimator.predict(rows[~fitted])
    error = float(np.std(torque[fitted] - estimator.predict(rows[fitted])))
    shown = slice(0, 700)
    time = t[~fitted][shown]
    panel = Panel("time [s]", "torque [N·m]", "Held-out torque and its estimate from EMG", y_range=(-32.0, 38.0))
    panel.band(time, (found - 1.64 * error)[shown], (found + 1.64 * error)[shown], 0, "90 % band")
    panel.line(time, torque[~fitted][shown], "measured", 4).line(time, found[shown], "estimate from EMG")
    return figure([panel], "Measured and estimated torque of a joint on held-out data")


def muscles() -> str:
    """Force of a muscle against length and velocity."""
    muscle = pl.Muscle(max_isometric_force=1000.0, optimal_fibre_length=0.10, tendon_slack_length=0.20)
    length = np.linspace(0.06, 0.16, 200)
    total = muscle.force(activation=1.0, length=0.20 + length)
    passive = muscle.force(activation=0.0, length=0.20 + length)
    left = Panel("fibre length [m]", "force [N]", "Length", y_range=(0.0, 1600.0))
    left.line(length, total, "fully active").line(length, muscle.force(activation=0.5, length=0.20 + length),
                                                  "half active", 2)  # fmt: skip
    left.line(length, passive, "passive", 1, dashed=True)
    v = np.linspace(-1.0, 1.0, 200)
    right = Panel("lengthening velocity [m/s]", "force [N]", "Velocity")
    right.line(v, muscle.force(activation=1.0, length=0.30, velocity=v))
    return figure([left, right], "Force of a muscle against its length and its velocity")


def muscle_calibration() -> str:
    """Torque of calibrated muscles on a held-out part of a movement."""
    rng = np.random.default_rng(7)
    t = np.arange(0.0, 30.0, 0.01)
    knee = 0.8 + 0.5 * np.sin(1.4 * t)
    active = {"vastus_lateralis": 0.35 * np.clip(np.sin(1.1 * t), 0.0, None),
              "semitendinosus": 0.35 * np.clip(-np.sin(1.1 * t), 0.0, None)}  # fmt: skip
    wanted = 60.0 * active["vastus_lateralis"] - 40.0 * active["semitendinosus"]
    true = pl.calibrate_muscles(t, active, {"knee": knee}, wanted, joint="knee")
    measured = true.predict(t, active, {"knee": knee}) + 0.3 * rng.standard_normal(t.size)
    noisy = {name: np.clip(each + 0.005 * rng.standard_normal(t.size), 0.0, 1.0) for name, each in active.items()}
    part = t < 15.0
    fitted = {name: each[part] for name, each in noisy.items()}
    fit = pl.calibrate_muscles(t[part], fitted, {"knee": knee[part]}, measured[part], joint="knee")
    found = fit.predict(t, noisy, {"knee": knee})
    panel = Panel(
        "time [s]", "knee torque [N·m]", "Calibrated on 15 s, compared with the next 15 s", x_range=(8.0, 30.0)
    )
    shown = t > 8.0
    panel.line(t[shown], measured[shown], "measured", 4).line(t[shown], found[shown], "calibrated muscles")
    panel.line([15.0, 15.0], [measured.min(), measured.max()], "end of calibration", 1, dashed=True)
    return figure([panel], "Measured torque and torque of calibrated muscles")


def transfer_functions() -> str:
    """Gain of a fitted transfer function and of the true one."""
    t = np.arange(0.0, 40.0, 0.01)
    rng = np.random.default_rng(8)
    u = np.repeat(rng.standard_normal(200), 20)
    true = ([20.0], [1.0, 0.8, 9.0])
    y = lsim(true, u, t)[1] + 0.25 * rng.standard_normal(t.size)
    fit = pl.fit_transfer_function(t, u, y, poles=2, hold="zero")
    w = np.geomspace(0.3, 30.0, 200)
    spectrum = np.abs(np.fft.rfft(y)) / np.maximum(np.abs(np.fft.rfft(u)), 1e-9)
    frequency = 2.0 * np.pi * np.fft.rfftfreq(t.size, 0.01)
    kept = (frequency > 0.3) & (frequency < 30.0)
    edges = pairwise(w[::6])
    groups = [np.flatnonzero(kept & (frequency >= low) & (frequency < high)) for low, high in edges]
    groups = [group for group in groups if group.size]
    panel = Panel("frequency [rad/s]", "gain", "Gain of a pendulum with noise on the output", x_log=True, y_log=True,
                  x_range=(0.3, 30.0), y_range=(0.01, 30.0))  # fmt: skip
    panel.points([frequency[g].mean() for g in groups], [np.median(spectrum[g]) for g in groups], "spectra divided", 4)
    panel.line(w, np.abs(np.polyval(true[0], 1j * w) / np.polyval(true[1], 1j * w)), "true", 1, dashed=True)
    panel.line(w, np.abs(np.polyval(fit.numerator, 1j * w) / np.polyval(fit.denominator, 1j * w)), "fitted, two poles")
    return figure([panel], "Gain of a fitted transfer function against frequency")


def coupling() -> str:
    """Torque of straps against the angle between limb and robot."""
    t = np.arange(0.0, 8.0, 0.002)
    angle, rate = 0.12 * np.sin(2.0 * t), 0.24 * np.cos(2.0 * t)
    still = np.zeros_like(t)
    kinds = {
        "spring and damper": ((), {}),
        "hardening": (("hardening",), {"hardening": 60.0}),
        "slack": (("slack",), {"slack": 0.06}),
        "relaxing": (("relaxing",), {"relaxing_stiffness": 12.0, "relaxation_time": 0.6}),
    }
    panel = Panel("angle between limb and orthosis [rad]", "strap torque [N·m]", "Straps with one feature each")
    last = t > 8.0 - np.pi - 0.03
    for colour, (name, (features, values)) in enumerate(kinds.items()):
        core = StrapModel(features).core({"stiffness": 14.0, "damping": 0.3, **values})
        torque = np.asarray(_core.strap_torque(core, still, still, angle, rate, period=0.002)[1])
        panel.line(angle[last], torque[last], name, colour)
    return figure([panel], "Strap torque against the angle between limb and orthosis for four straps")


KNEE = Coupling(
    orthosis_inertia=0.048, orthosis_viscous=0.008, orthosis_gravity=1.56, coulomb=0.015, limb_inertia=0.33,
    limb_viscous=0.15, limb_gravity=8.0, strap_stiffness=14.0, strap_damping=0.42, actuator_frequency=55.0,
    actuator_damping=0.2, delay=0.0033, actuator_inertia=0.055, actuator_viscous=0.1, actuator_coulomb=2.6,
    actuator_leak=1.7,
)  # fmt: skip
"""A series-elastic knee orthosis and its wearer."""
PERIOD = 0.002
"""Control period of the orthosis [s]."""


def strap_response(plant: LinearSystem, controller: LinearSystem, w: np.ndarray) -> np.ndarray:
    """Return the gain from the wearer's torque to the strap's torque in closed loop, shape (n,)."""
    a = closed_loop(plant, controller)
    b = np.r_[plant.b[:, 1:2], np.zeros((a.shape[0] - plant.b.shape[0], 1))]
    c = np.c_[plant.c[2:3], np.zeros((1, a.shape[0] - plant.c.shape[1]))]
    z = np.exp(1j * w * PERIOD)
    return np.abs([(c @ np.linalg.solve(each * np.eye(len(a)) - a, b)).item() for each in z])


def residual_compensation() -> str:
    """Strap torque per torque of the wearer, with the torque loop alone and with the compensator."""
    plant = sampled(worn_orthosis(KNEE, 1.5), PERIOD, KNEE.delay)
    hz = np.geomspace(0.3, 8.0, 120)
    panel = Panel("frequency of the movement [Hz]", "strap torque per wearer's torque", "Coupled knee orthosis",
                  x_log=True, y_log=True, x_range=(0.3, 8.0), y_range=(0.01, 3.0))  # fmt: skip
    alone = Law(0.0, 0.0, 0.0, 0.0, proportional=0.0, torque_gain=0.3)
    laws = {"torque loop alone": alone, "residual compensator": Law()}
    for colour, (name, law) in zip((4, 0), laws.items(), strict=True):
        controller = design(KNEE, PERIOD, law=law).linear(1.5)
        assert radius(closed_loop(plant, controller)) < 1.0, name
        panel.line(hz, strap_response(plant, controller, 2.0 * np.pi * hz), name, colour)
    return figure([panel], "Gain from the wearer's torque to the strap torque against frequency")


def transparency_assessment() -> str:
    """Changes of the duration between conditions, with intervals."""
    rng = np.random.default_rng(9)
    names = ["none", "compensation", "friction too", "position"]
    duration = rng.normal(1.0, 0.1, (12, 1)) + rng.normal(0.0, 0.05, (12, 4)) + np.array([0.0, 0.02, 0.08, 0.2])
    found = pl.compare_conditions(duration, names, control="none")
    panel = Panel("controller", "change of the duration [s]", "Twelve simulated participants", x_names=names[1:],
                  y_range=(-0.15, 0.4))  # fmt: skip
    for k, name in enumerate(names[1:]):
        own = duration[:, k + 1] - duration[:, 0]
        panel.points(k + 0.12 * np.linspace(-1.0, 1.0, own.size), own, "" if k else "one participant", 4)
        panel.line([k + 0.25] * 2, found.pairwise[name].interval, "" if k else "95 % interval", 0)
    panel.line([-0.5, 2.5], [0.0, 0.0], "no change", 1, dashed=True)
    return figure([panel], "Change of the movement duration under three controllers")


def certificate() -> str:
    """Probability of the verdict "transparent" against the number of participants."""
    people = (6, 8, 10, 12, 16, 20, 24)
    panel = Panel("number of participants", "probability of “transparent” [%]", "Margin 10 %, no true change",
                  y_range=(0.0, 105.0))  # fmt: skip
    for colour, spread in enumerate((3, 4, 6)):
        stated = {"margins": {"duration": "10 %"}, "design": "AB/BA"}
        power = pl.plan(stated, people=people, sd=f"{spread} %", studies=400)
        panel.line(people, 100.0 * np.asarray(list(power)), f"standard deviation {spread} %", colour)
    return figure([panel], "Probability of the verdict transparent against the number of participants")


def elbow_controllers() -> str:
    """Effort of a joint along a movement, and how much of it the controller delivers."""
    t, q, v, a = joint_motion()
    effort = joint_effort(q, v, a)
    fit = pl.fit_joint(
        t, q, effort + 0.02 * np.random.default_rng(10).standard_normal(t.size), lowpass=10.0, decimate=4
    )
    limits = pl.Limits(effort=5.0, rate=500.0, velocity=10.0, position=(-2.0, 2.0))
    law = pl.controller(fit, "compensation", period=1e-3, limits=limits)
    time = np.arange(0.0, 3.0, 1e-3)
    angle = 0.3 + 0.5 * np.sin(2.2 * time)
    speed, change = 1.1 * np.cos(2.2 * time), -2.42 * np.sin(2.2 * time)
    given = np.array([law.step(float(k), float(x)) for k, x in zip(time, angle, strict=True)])
    needed = joint_effort(angle, speed, change)
    panel = Panel("time [s]", "torque [N·m]", "Compensation of gravity and friction", y_range=(-0.6, 1.4))
    panel.line(time, needed, "torque that the robot needs", 4).line(time, given, "torque of the controller")
    panel.line(time, needed - given, "rest, left to the wearer", 1)
    return figure([panel], "Torque that a joint needs, torque of the controller, and the rest")


def simulated_participants() -> str:
    """Preferred duration of a movement against its amplitude, free and with a robot's inertia and friction."""
    choice = tomllib.loads(RIG.read_text(encoding="utf-8"))["choice"]
    amplitude = np.radians(np.linspace(6.0, 70.0, 30))
    panel = Panel("amplitude [deg]", "preferred duration [s]", "Choice of the duration by a simulated participant")
    for colour, (name, dynamics) in enumerate({
        "free arm": (0.07, 0.2, 0.0), "robot without power": (0.22, 0.6, 1.5), "transparent robot": (0.09, 0.25, 0.15),
    }.items()):  # fmt: skip
        chosen = [preferred_duration(float(x), dynamics, choice["reward"], choice, 0.05) for x in amplitude]
        panel.line(np.degrees(amplitude), chosen, name, colour)
    return figure([panel], "Preferred duration of a movement against its amplitude")


def robots_of_many_joints() -> str:
    """Singular values of the regressor of a planar arm: base parameters, and combinations without effect."""
    links = tuple(Link(name, 2.0, (0.0, 0.0, -0.3), (0.07, 0.0, 0.0, 0.07, 0.0, 0.002)) for name in ("upper", "fore"))
    joints = (
        TreeJoint("shoulder", "base", "upper", axis=(0.0, 1.0, 0.0), place=(0.0, 0.0, 0.3)),
        TreeJoint("elbow", "upper", "fore", axis=(0.0, 1.0, 0.0), place=(0.0, 0.0, -0.3)),
    )
    tree = Tree(joints, links).core
    t = np.arange(0.0, 20.0, 0.02)
    panel = Panel("combination of inertial parameters", "singular value", "Two joints, 20 inertial parameters",
                  y_log=True, y_range=(1e-16, 100.0))  # fmt: skip
    for colour, (name, speed) in enumerate({"fast motion of both joints": 4.0, "slow motion": 0.4}.items()):
        phase = np.array([[1.0], [1.7]]) * speed * t
        q, v, a = np.sin(phase), np.array([[1.0], [1.7]]) * speed, -((np.array([[1.0], [1.7]]) * speed) ** 2)
        rows = np.asarray(tree.regressor(q.T, (v * np.cos(phase)).T, (a * np.sin(phase)).T)).reshape(-1, 20)
        values = np.linalg.svd(rows / np.sqrt(len(rows)), compute_uv=False)
        panel.points(np.arange(1, 21), np.maximum(values, 3e-16), name, colour)
    return figure([panel], "Singular values of the regressor of a planar arm")


def consistent_bodies() -> str:
    """Smallest eigenvalue of the pseudo-inertia of a body against a stated moment of inertia."""
    mass, centre = 2.0, 0.15
    moment = np.linspace(0.02, 0.09, 200)
    bodies = np.array([[mass, 0.0, 0.0, -mass * centre, j, 0.0, 0.0, j, 0.0, 0.004] for j in moment])
    values = 1e3 * np.linalg.eigvalsh(scaled_pseudo_inertia(bodies))[:, 0]
    panel = Panel("stated moment of inertia about the joint [kg·m²]", "smallest eigenvalue [g·m²]",
                  "A body of 2 kg, centre of mass at 0.15 m")  # fmt: skip
    panel.line(moment, values, "pseudo-inertia").line(moment, 0.0 * moment, "limit: no body lies below", 1, dashed=True)
    panel.line([mass * centre**2] * 2, [values.min(), values.max()], "mass times distance squared", 4, dashed=True)
    return figure([panel], "Smallest eigenvalue of the pseudo-inertia against a stated moment of inertia")


def arm_control() -> str:
    """Stability of two joints with force feedback on limbs that are limp, at ease and stiff."""
    robot = TreeCoupling(
        np.array([[0.048, 0.02], [0.02, 0.06]]), 0.008, 1.56, 0.015, np.array([[0.33, 0.1], [0.1, 0.25]]), 0.15, 8.0,
        np.diag([14.0, 20.0]), np.diag([0.42, 0.6]), [55.0, 70.0], 0.4, 0.002,
    )  # fmt: skip
    gains = np.linspace(0.1, 3.0, 60)
    panel = Panel(
        "gain of the force feedback", "growth per control period [1/1000]", "Two joints with force sensors in the cuffs"
    )
    for colour, limb in enumerate(each for each in DRAWN_LIMBS if each.name in ("limp", "at ease", "stiff")):
        worn = worn_tree(with_limb(robot, limb), 1.0)
        driven = LinearSystem(worn.a, worn.b[:, :2], worn.c, worn.d[:, :2])
        plant = sampled_each(driven, PERIOD, [0.002, 0.002])
        growth = [
            1e3 * (radius(closed_tree(plant, linear_law(
                robot, LinearShares(proportional=float(gain), lowpass=300.0), PERIOD, width=0.1))) - 1.0)
            for gain in gains
        ]  # fmt: skip
        panel.line(gains, growth, f"limb {limb.name}", colour)
    panel.line(gains, 0.0 * gains, "limit of stability", 4, dashed=True)
    return figure([panel], "Growth of oscillations of two joints against the gain of force feedback")


def supervision() -> str:
    """Largest excess energy of faults of the drive, by the sensors of the robot."""
    results = json.loads(SUPERVISOR_RESULTS.read_text(encoding="utf-8"))
    names = {"drive_reversed": "reversed", "drive_triple": "three times", "drive_stuck": "stuck", "drive_dead": "dead"}
    panel = Panel(
        "fault of the drive", "largest excess energy [J]", "Simulated faults", y_log=True, y_range=(0.001, 100.0)
    )
    panel.x_names = list(names.values())
    for colour, (robot, words) in enumerate({"blind": "no measurement, no probe", "unmeasured": "default export",
                                             "drive_measured": "measured drive"}.items()):  # fmt: skip
        energy = {f["fault"]: f["excess"] for f in results["faults"] if f["robot"] == robot}
        panel.bars(np.arange(len(names), dtype=float), [max(energy[n], 0.001) for n in names], words, colour)
    return figure([panel], "Largest excess energy of four drive faults for three kinds of instruments")


FIGURES: Mapping[str, Callable[[], str]] = {
    function.__name__.replace("_", "-"): function
    for function in (
        checks_of_recordings, joint_and_friction, filtering_and_derivatives, least_squares_and_model_selection,
        uncertainty, figures_of_merit, free_carriage, inertial_sensors, emg_processing, torque_from_emg, muscles,
        muscle_calibration, transfer_functions, coupling, residual_compensation, transparency_assessment, certificate,
        elbow_controllers, simulated_participants, robots_of_many_joints, consistent_bodies, arm_control, supervision,
    )
}  # fmt: skip
"""The function that draws the figure of each chapter, by the chapter's name."""


def main() -> None:
    names = sys.argv[1:] or list(FIGURES)
    if unknown := sorted(set(names) - set(FIGURES)):
        sys.exit(f"found {', '.join(unknown)}, expected some of {', '.join(FIGURES)}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names:
        (FOLDER / f"{name}.svg").write_text(FIGURES[name](), encoding="utf-8")
        print(f"{name}: {(FOLDER / f'{name}.svg').stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
