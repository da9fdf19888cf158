"""A study of an arm of two joints, played by the core under its motors: friction with load, a known payload at will."""

from pathlib import Path

import numpy as np

from pellucid import _core

RATE, SECONDS = 500.0, 14.0
VISCOUS, COULOMB, LOAD = (0.9, 0.4), (1.1, 0.5), (0.12, 0.0)
BODIES = ((3.0, -0.16), (1.8, -0.12))  # mass [kg], centre along z [m]

TOML = """\
name = "arm"

[tree]
velocity_width = "0.005 rad/s"
segments = 7
ripple = false
families = ["load"]

[rig]
[[rig.joints]]
name = "shoulder"
motion = "rotary"
place = ["0 m", "0 m", "0.3 m"]
axis = [0, 1, 0]
body = {{ mass = "3 kg", centre = ["0 m", "0 m", "-0.16 m"], inertia = {inertia} }}
[rig.joints.drive]
kind = {kind}
{constant}
[[rig.joints]]
name = "elbow"
motion = "rotary"
place = ["0 m", "0 m", "-0.3 m"]
axis = [0, 1, 0]
body = {{ mass = "1.8 kg", centre = ["0 m", "0 m", "-0.12 m"], inertia = {inertia} }}
[rig.joints.drive]
kind = {kind}
{constant}
[channels]
time = {{ column = "t", unit = "s" }}
position.shoulder = {{ column = "q1", unit = "rad" }}
position.elbow = {{ column = "q2", unit = "rad" }}
{channel}.shoulder = {{ column = "u1", unit = "{unit}" }}
{channel}.elbow = {{ column = "u2", unit = "{unit}" }}

[processing]
lowpass = "20 Hz"
decimate = 5
trim = 50
dead_band = "0.05 rad/s"
"""
INERTIA = ["0.02 kg*m^2", "0 kg*m^2", "0 kg*m^2", "0.02 kg*m^2", "0 kg*m^2", "0.01 kg*m^2"]


def links(payload: float = 0.0) -> np.ndarray:
    """Of the core, (2, 22); what is carried hangs 0.2 m below the elbow [kg]."""
    names = list(_core.LINK_PARAMETER_NAMES)
    rows = np.zeros((2, len(names)))
    for i, (row, (mass, z)) in enumerate(zip(rows, BODIES, strict=True)):
        extra = payload * i
        row[names.index("parent")], row[names.index("joint")] = i, 1.0
        row[names.index("z")], row[names.index("axis_y")] = (0.3, -0.3)[i], 1.0
        row[names.index("mass")], row[names.index("moment_z")] = mass + extra, mass * z - 0.2 * extra
        about = mass * z**2 + extra * 0.2**2
        for name, own in (("inertia_xx", 0.02 + about), ("inertia_yy", 0.02 + about), ("inertia_zz", 0.01)):
            row[names.index(name)] = own
    return rows


def played(seed: int, payload: float = 0.0) -> np.ndarray:
    """Time, positions and efforts (n, 5) along a smooth reference that a loop follows."""
    rng = np.random.default_rng(seed)
    joints = np.zeros((2, len(_core.TREE_JOINT_PARAMETER_NAMES)))
    for name, values in (("coulomb", COULOMB), ("viscous", VISCOUS), ("load", LOAD)):
        for end in ("motoring", "generating") if name == "load" else ("positive", "negative"):
            joints[:, _core.TREE_JOINT_PARAMETER_NAMES.index(f"{name}_{end}")] = values
    plant = _core.DrivenTree(links(payload), [0.0, 0.0, -9.81], joints, period=1.0 / RATE, substeps=4)
    n = int(SECONDS * RATE)
    t = np.arange(n) / RATE
    waves = rng.uniform(0.25, 1.1, (2, 3)), rng.uniform(0.0, 2.0 * np.pi, (2, 3)), rng.uniform(0.25, 0.5, (2, 3))
    wanted = np.stack(
        [(a * np.sin(2.0 * np.pi * np.outer(t, f) + p)).sum(axis=1) for f, p, a in zip(*waves, strict=True)]
    )
    made = np.zeros((n, 5))
    plant.reset(wanted[:, 0])
    gains = np.array([260.0, 90.0]), np.array([14.0, 5.0])
    for i in range(n):
        q, v = plant.position, plant.velocity
        rate = (wanted[:, min(i + 1, n - 1)] - wanted[:, i]) * RATE
        effort = gains[0] * (wanted[:, i] - q) + gains[1] * (rate - v)
        made[i] = [t[i], *q, *effort]
        plant.run(effort)
    made[:, 1:3] += 2e-5 * rng.standard_normal((n, 2))
    made[:, 3:] += 0.02 * rng.standard_normal((n, 2))
    return made


def arm_study(
    folder: Path,
    *,
    validate: bool = True,
    payload: float | None = None,
    gain: float | None = None,
    spring: float = 0.0,
) -> Path:
    """A study's folder: one recording to be fitted, one to be judged by, and one with a payload [kg]; with a `gain`
    efforts are recorded as currents, and nobody says it [N m/A]. A `spring` acts at the elbow [N m/rad]."""
    (folder / "recordings").mkdir(parents=True)
    recordings = [("sweep", "fit", 1, 0.0)]
    recordings += [("check", "validate", 2, 0.0)] if validate else []
    recordings += [("carried", "validate", 3, payload)] if payload else []
    kind, constant, channel, unit = (
        ('"torque"', "", "torque", "N*m") if gain is None else ('"current"', "", "current", "A")
    )
    text = TOML.format(inertia=str(INERTIA).replace("'", '"'), kind=kind, constant=constant, channel=channel, unit=unit)
    for name, use, seed, carried in recordings:
        samples = played(seed, carried)
        samples[:, 4] += spring * samples[:, 2]
        samples[:, 3:] /= gain or 1.0
        np.savetxt(
            folder / f"recordings/{name}.csv", samples, delimiter=",", header="t,q1,q2,u1,u2", comments="", fmt="%.9g"
        )
        text += f'\n[[recordings]]\nname = "{name}"\nfile = "recordings/{name}.csv"\nuse = "{use}"\n'
        text += f'payload = {{ mass = "{carried} kg" }}\n' if carried else ""
    (folder / "study.toml").write_text(text)
    return folder
