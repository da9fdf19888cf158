"""Files as loggers of labs write them, each with what its columns are: joints swung in plain NumPy, not by the core."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class MadeLayout:
    """Files of one layout and their truth: role and SI factor of each column that is judged."""

    name: str
    files: tuple[Path, ...]
    channels: dict[str, tuple[str, float | None]]  # by column: role, and SI per number; None if it is not judged
    rate: float | None = None  # rate that study.toml has to state, if no column is time [Hz]
    rate_is_unknowable: bool = False


def swing(seed: int, n: int = 3000, fs: float = 200.0) -> dict[str, np.ndarray]:
    """Return a pendulum that motor torques swing, with friction: t, q [rad], dq, tau [N m], each shape (n,)."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / fs
    phases, rates = rng.uniform(0.0, 6.28, 4), np.array([0.23, 0.61, 1.13, 1.9]) * rng.uniform(0.9, 1.1)
    sizes = np.array([0.7, 0.4, 0.2, 0.08]) * rng.uniform(0.8, 1.2)
    angle = 2.0 * np.pi * np.outer(t, rates) + phases
    q = np.sin(angle) @ sizes
    dq = (np.cos(angle) * 2.0 * np.pi * rates) @ sizes
    ddq = -(np.sin(angle) * (2.0 * np.pi * rates) ** 2) @ sizes
    tau = 0.05 * ddq + 0.12 * dq + 0.35 * np.tanh(dq / 0.02) + 1.6 * np.sin(q) + 0.02 * rng.standard_normal(n)
    return {"t": t, "q": q, "dq": dq + 0.01 * rng.standard_normal(n), "tau": tau, "ref": q}


def emg(seed: int, n: int, fs: float) -> np.ndarray:
    """Return a burst-like noise in the band of surface EMG, shape (n,) [V]."""
    rng = np.random.default_rng(seed)
    noise = np.fft.rfft(rng.standard_normal(n))
    frequency = np.fft.rfftfreq(n, 1.0 / fs)
    shaped = noise * (frequency / (frequency + 60.0)) / (1.0 + (frequency / 180.0) ** 2)
    wave = np.fft.irfft(shaped, n)
    bursts = 0.05 + np.clip(np.sin(2.0 * np.pi * 0.4 * np.arange(n) / fs), 0.0, None)
    return 2e-4 * bursts * wave / np.std(wave)


def _rows(*columns: np.ndarray, delimiter: str = ",", form: str = "{:.6g}") -> str:
    return "\n".join(delimiter.join(form.format(x) for x in row) for row in zip(*columns, strict=True)) + "\n"


def numbered_columns(folder: Path) -> MadeLayout:
    """Columns named 0 to 12: time, four joints' angles, speeds and torques."""
    parts = [swing(seed) for seed in range(4)]
    columns = [parts[0]["t"], *(p["q"] for p in parts), *(p["dq"] for p in parts), *(p["tau"] for p in parts)]
    path = folder / "log.csv"
    path.write_text(",".join(map(str, range(13))) + "\n" + _rows(*columns))
    roles = {"0": ("time", 1.0)}
    roles |= {str(1 + i): ("position", 1.0) for i in range(4)} | {str(5 + i): ("velocity", 1.0) for i in range(4)}
    roles |= {str(9 + i): ("torque", 1.0) for i in range(4)}
    return MadeLayout("numbered_columns", (path,), roles)


def flat_files(folder: Path) -> MadeLayout:
    """One number a line, a file for each quantity of three joints, row after row; no time."""
    parts = [swing(10 + seed) for seed in range(3)]
    files = []
    for key, name in (("q", "positions"), ("dq", "velocities"), ("tau", "torques")):
        flat = np.column_stack([p[key] for p in parts]).ravel()
        files.append(folder / f"{name}.txt")
        files[-1].write_text("\n".join(f"{x:.6f}" for x in flat) + "\n")
    return MadeLayout("flat_files", tuple(files), {}, rate=200.0, rate_is_unknowable=True)


def long_preamble(folder: Path) -> MadeLayout:
    """A preamble of 13 lines, names and units in two rows, semicolons, decimal commas, ms and mA."""
    p = swing(20)
    facts = [
        "Drive logger 4.2", "Date: 2026-03-02", "Operator station: 3", "Device: EC-i 40", "Torque constant: 60,3 mNm/A",
        "Gear ratio: 100:1", "Sampling period: 5 ms", "Filter: none", "Trigger: manual", "Channels: 4",
            "Mode: position",
        "Remarks: none", "Data follow",
    ]  # fmt: skip
    current = p["tau"] / (0.0603 * 100.0) * 1000.0
    path = folder / "export.asc"
    body = _rows(1000.0 * p["t"], np.degrees(p["q"]), np.degrees(p["dq"]), current, delimiter=";").replace(".", ",")
    path.write_text("\n".join(facts) + "\nTime;Actual position;Actual velocity;Motor current\nms;deg;deg/s;mA\n" + body)
    deg = np.pi / 180.0
    roles = {"Time": ("time", 1e-3), "Actual position": ("position", deg), "Actual velocity": ("velocity", deg)}
    return MadeLayout("long_preamble", (path,), roles | {"Motor current": ("current", 1e-3)})


def nanosecond_topic(folder: Path) -> MadeLayout:
    """Topics written as text, each with %time in nanoseconds since 1970 and one bare column."""
    p = swing(30)
    stamps = 1_767_225_600_000_000_000 + np.round(p["t"] * 1e9).astype(np.int64)
    files = []
    for key, name in (("q", "joint_position"), ("tau", "joint_torque")):
        files.append(folder / f"{name}.txt")
        rows = "\n".join(f"{s},{x:.6f}" for s, x in zip(stamps, p[key], strict=True))
        files[-1].write_text(f"%time,field.data\n{rows}\n")
    return MadeLayout("nanosecond_topic", tuple(files), {"time": ("time", 1e-9)})


def wall_clock(folder: Path) -> MadeLayout:
    """Stamps of a wall clock of one second at 50 rows a second."""
    p = swing(40, n=2000, fs=50.0)
    stamps = [f"2026-05-03 14:{10 + int(t) // 60:02d}:{int(t) % 60:02d}" for t in p["t"]]
    path = folder / "session.csv"
    rows = "\n".join(f"{s},{q:.3f},{tau:.4f}" for s, q, tau in zip(stamps, np.degrees(p["q"]), p["tau"], strict=True))
    path.write_text(f"timestamp,knee_angle_deg,torque_Nm\n{rows}\n")
    roles = {"knee_angle_deg": ("position", np.pi / 180.0), "torque_Nm": ("torque", 1.0)}
    return MadeLayout("wall_clock", (path,), roles, rate=50.0)


def struct_file(folder: Path) -> MadeLayout:
    """A MAT struct with angle in degrees, speed in rad/s and current, and settings beside them."""
    from scipy.io import savemat

    p = swing(50)
    log = {
        "time": p["t"], "angle": np.degrees(p["q"]), "speed": p["dq"], "current": p["tau"] / 6.0,
        "subject": {"name": "Jane Doe", "mass": 70.0}, "kt": 0.06,
    }  # fmt: skip
    path = folder / "trial.mat"
    savemat(path, {"log": log})
    roles = {"log.time": ("time", 1.0), "log.angle": ("position", np.pi / 180.0), "log.speed": ("velocity", 1.0)}
    return MadeLayout("struct_file", (path,), roles | {"log.current": ("current", 1.0)})


def person_export(folder: Path) -> MadeLayout:
    """A text export of an amplifier with a person's name, EMG in microvolts and a goniometer, at a stated rate."""
    n, fs = 8000, 1000.0
    channels = [1e6 * emg(60 + k, n, fs) for k in range(3)]
    knee = 30.0 + 25.0 * np.sin(2.0 * np.pi * 0.4 * np.arange(n) / fs)
    path = folder / "export.txt"
    head = "Patient name:\tDoe, Jane\nDate of birth:\t1970-01-02\nSampling rate:\t1000 Hz\n"
    names = "\t".join(["VL [uV]", "BF [uV]", "TA [uV]", "Knee angle [deg]"])
    path.write_text(head + names + "\n" + _rows(*channels, knee, delimiter="\t", form="{:.3f}"))
    roles: dict[str, tuple[str, float | None]] = {f"{m} [uV]": ("emg", 1e-6) for m in ("VL", "BF", "TA")}
    return MadeLayout("person_export", (path,), roles | {"Knee angle [deg]": ("angle", np.pi / 180.0)}, rate=fs)


def commanded_motor(folder: Path) -> MadeLayout:
    """A motor's log without ending: milliseconds since start, a reference, a 12-bit encoder, and a constant column."""
    p = swing(70)
    quantum = 2.0 * np.pi / 4096.0
    measured = np.round(np.roll(p["q"], 3) / quantum) * quantum
    path = folder / "motorlog"
    names = "millis,setpoint,measured,i_q,spare"
    body = _rows(np.round(1000.0 * p["t"]) + 733.0, p["ref"], measured, p["tau"] / 2.0, np.full(len(measured), 7.0))
    path.write_text(names + "\n" + body)
    roles = {"millis": ("time", 1e-3), "setpoint": ("reference", 1.0), "measured": ("position", 1.0)}
    return MadeLayout("commanded_motor", (path,), roles | {"i_q": ("current", 1.0)})


def late_packets(folder: Path) -> MadeLayout:
    """Packets stamped when they arrive, some of them twice, degrees and volts, a last row cut."""
    p = swing(80)
    rng = np.random.default_rng(81)
    stamps = p["t"] + 0.002 * rng.random(len(p["t"]))
    rows = [f"{t:.6f}\t{q:.3f}\t{u:.4f}" for t, q, u in zip(stamps, np.degrees(p["q"]), 2.0 * p["tau"], strict=True)]
    for at in sorted(rng.choice(len(rows), 40, replace=False))[::-1]:
        rows.insert(at, rows[at])
    path = folder / "udp.log"
    path.write_text("time (s)\tangle (deg)\tvoltage (V)\n" + "\n".join(rows) + "\n14.99")
    roles = {"time (s)": ("time", 1.0), "angle (deg)": ("position", np.pi / 180.0), "voltage (V)": ("voltage", 1.0)}
    return MadeLayout("late_packets", (path,), roles)


def worn_trials(folder: Path) -> MadeLayout:
    """Two people in two conditions: German names, a rolling encoder in degrees, and a cuff's torque."""
    files = []
    for person in ("P1", "P2"):
        for condition in ("free", "robot"):
            p = swing(90 + len(files))
            path = folder / condition / person / "lauf_1.csv"
            path.parent.mkdir(parents=True)
            rolling = np.mod(np.degrees(3.0 * p["q"]), 360.0)
            body = _rows(p["t"], rolling, p["tau"], 0.1 * p["dq"], delimiter=";").replace(".", ",")
            path.write_text("Zeit [s];Winkel [°];Drehmoment [Nm];Cuff torque [Nm]\n" + body)
            files.append(path)
    roles = {"Zeit [s]": ("time", 1.0), "Winkel [°]": ("position", np.pi / 180.0), "Drehmoment [Nm]": ("torque", 1.0)}
    return MadeLayout("worn_trials", tuple(files), roles | {"Cuff torque [Nm]": ("interaction", 1.0)})


LAYOUTS: tuple[Callable[[Path], MadeLayout], ...] = (
    numbered_columns, flat_files, long_preamble, nanosecond_topic, wall_clock, struct_file, person_export,
    commanded_motor, late_packets, worn_trials,
)  # fmt: skip
"""Makers of all layouts; each writes into an empty folder."""
