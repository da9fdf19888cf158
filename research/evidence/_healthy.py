"""A healthy recording in every format that there is a reader for: what damage is done to."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path

import numpy as np

Swing = Mapping[str, np.ndarray]

BENCH_STUDY_TEXT = """name = "bench"
notes = ["a bench"]

[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"

[rig.drive]
kind = "current"
torque_constant = "2 N*m/A"
limit = "5 A"

[rig.limits]
position_min = "-2 rad"
position_max = "2 rad"
velocity = "10 rad/s"
effort = "20 N*m"

[channels]
time = {{ column = "{time}", unit = "s" }}
position = {{ column = "{position}", unit = "rad" }}
current = {{ column = "{current}", unit = "A" }}

[processing]
lowpass = "20 Hz"
decimate = 5
trim = 20
dead_band = "0.01 rad/s"

[model]
families = ["symmetric"]
gravity = "sine"

[[recordings]]
name = "sweep"
file = "recordings/sweep{ending}"
protocol = "multisine"
use = "fit"
"""
"""Text of the study.toml of a healthy study of a bench."""


def swing(n: int = 2000, fs: float = 200.0) -> Swing:
    """A pendulum of 0.05 kg*m^2 and 1.5 N*m, driven through three sines: t, q, i, each shape (n,)."""
    t = np.arange(n) / fs
    parts = [(0.5, 0.4, 0.0), (0.3, 1.1, 0.7), (0.1, 2.3, 1.9)]
    q, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
    for amplitude, frequency, phase in parts:
        w = 2 * np.pi * frequency
        q += amplitude * np.sin(w * t + phase)
        v += amplitude * w * np.cos(w * t + phase)
        a -= amplitude * w**2 * np.sin(w * t + phase)
    return {"t": t, "q": q, "i": (0.05 * a + 1.5 * np.sin(q) + 0.1 * v + 0.2 * np.tanh(v / 0.05)) / 2.0}


def _table(between: str) -> Callable[[Path, Swing], None]:
    def write(path: Path, swing: Swing) -> None:
        rows = [between.join(f"{x:.6g}" for x in row) for row in zip(*swing.values(), strict=True)]
        path.write_text("\n".join((between.join(swing), *rows)) + "\n", encoding="utf-8")

    return write


def _json(path: Path, swing: Swing) -> None:
    path.write_text(json.dumps({name: np.round(x, 6).tolist() for name, x in swing.items()}), encoding="utf-8")


def _json_lines(path: Path, swing: Swing) -> None:
    rows = zip(*(np.round(x, 6).tolist() for x in swing.values()), strict=True)
    path.write_text("".join(json.dumps(dict(zip(swing, row, strict=True))) + "\n" for row in rows), encoding="utf-8")


def _labview(path: Path, swing: Swing) -> None:
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
    channels = (
        "Channels\t2\t\t\nSamples\t2000\t2000\t\nY_Unit_Label\trad\tA\t\nDelta_X\t0.005\t0.005\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tq\ti\tComment\n"
    )
    rows = ["\t".join(f"{x:.6g}" for x in row) for row in zip(*swing.values(), strict=True)]
    path.write_text(head + channels + "\n".join(rows) + "\n", encoding="utf-8")


def _nexus(path: Path, swing: Swing) -> None:
    head = "Devices\n200\n,,bench,\nFrame,Sub Frame,q,i\n,,rad,A\n"
    rows = [f"{k},0,{q:.6g},{i:.6g}" for k, (_, q, i) in enumerate(zip(*swing.values(), strict=True), 1)]
    path.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


def _mat(path: Path, swing: Swing) -> None:
    import scipy.io

    scipy.io.savemat(path, {**swing, "log": {"q": swing["q"][:9], "who": "me"}}, do_compression=True)


def _mat_hdf5(path: Path, swing: Swing) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, x in swing.items():
            file.create_dataset(name, data=x[None], chunks=(1, 200), compression="gzip")
        file.create_dataset("log/q", data=swing["q"][:9])
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def _storage(path: Path, swing: Swing) -> None:
    rows = ["\t".join(f"{x:.6g}" for x in row) for row in zip(*swing.values(), strict=True)]
    head = f"Swing\nversion=1\nnRows={len(rows)}\nnColumns=3\ninDegrees=no\nendheader"
    path.write_text("\n".join((head, "\t".join(swing), *rows)) + "\n", encoding="utf-8")


def _c3d(path: Path, swing: Swing) -> None:
    import ezc3d

    made, n = ezc3d.c3d(), len(swing["t"])
    made["parameters"]["POINT"]["RATE"]["value"] = [200.0]
    made["parameters"]["POINT"]["LABELS"]["value"] = ("wrist",)
    made["data"]["points"] = np.ones((4, 1, n))
    made["parameters"]["ANALOG"]["RATE"]["value"] = [200.0]
    made["parameters"]["ANALOG"]["LABELS"]["value"] = ("q", "i")
    made["data"]["analogs"] = np.array([swing["q"], swing["i"]])[None]
    made.write(str(path))


def _edf(path: Path, swing: Swing) -> None:
    import edfio

    one, file = (edfio.BdfSignal, edfio.Bdf) if path.suffix == ".bdf" else (edfio.EdfSignal, edfio.Edf)
    units = {"q": "rad", "i": "A"}
    file([one(swing[c], 200, label=c, physical_dimension=u, physical_range=(-5, 5)) for c, u in units.items()]).write(
        path
    )


def _xdf(path: Path, swing: Swing) -> None:
    def chunk(tag: int, content: bytes) -> bytes:
        return struct.pack("<BIH", 4, len(content) + 2, tag) + content

    head, t = struct.pack("<I", 1), swing["t"] + 50.0
    labels = "".join(f"<channel><label>{c}</label></channel>" for c in "qi")
    info = (
        "<info><name>rig</name><type>x</type><channel_count>2</channel_count><nominal_srate>200</nominal_srate>"
        f"<channel_format>float32</channel_format><desc><channels>{labels}</channels></desc></info>"
    )
    made = (
        b"XDF:" + chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>") + chunk(2, head + info.encode())
    )
    made += b"".join(chunk(4, head + struct.pack("<dd", at, 0.0)) for at in (t[0], t[-1]))
    rows = (struct.pack("<Bdff", 8, *row) for row in zip(t, swing["q"], swing["i"], strict=True))
    made += chunk(3, head + struct.pack("<BI", 4, len(t)) + b"".join(rows))
    foot = f"<info><first_timestamp>{t[0]}</first_timestamp><sample_count>{len(t)}</sample_count></info>"
    path.write_bytes(made + chunk(6, head + foot.encode()))


def _workbook(path: Path, swing: Swing) -> None:
    if path.suffix in (".xlsx", ".xlsm"):
        from openpyxl import Workbook

        book = Workbook(write_only=True)
        sheet = book.create_sheet("swing")
        for row in (list(swing), *zip(*(x.tolist() for x in swing.values()), strict=True)):
            sheet.append(row)
        book.save(path)
        return
    from odf.opendocument import OpenDocumentSpreadsheet
    from odf.table import Table, TableCell, TableRow
    from odf.text import P

    book, sheet = OpenDocumentSpreadsheet(), Table(name="swing")
    book.spreadsheet.addElement(sheet)
    for row in (list(swing), *zip(*(x.tolist() for x in swing.values()), strict=True)):
        line = TableRow()
        for cell in row:
            made = TableCell(valuetype="string") if isinstance(cell, str) else TableCell(valuetype="float", value=cell)
            if isinstance(cell, str):
                made.addElement(P(text=cell))
            line.addElement(made)
        sheet.addElement(line)
    book.save(str(path))


def _hdf5(path: Path, swing: Swing) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, x in swing.items():
            file.create_dataset(name, data=x, chunks=(200,), compression="gzip")


def _arrays(path: Path, swing: Swing) -> None:
    if path.suffix == ".npz":
        np.savez_compressed(path, **swing)
    else:
        rows = np.array(list(zip(*swing.values(), strict=True)), dtype=[(name, "f8") for name in swing])
        np.save(path, rows)


def _arrow(path: Path, swing: Swing) -> None:
    import pyarrow
    from pyarrow import ipc, parquet

    table = pyarrow.table({name: x.tolist() for name, x in swing.items()})
    if path.suffix == ".parquet":
        parquet.write_table(table, str(path))
    else:
        with ipc.new_file(str(path), table.schema) as file:
            file.write_table(table)


def _trc(path: Path, swing: Swing) -> None:
    head = "PathFileType\t4\t(X/Y/Z)\tswing.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t"
    head += f"OrigDataStartFrame\tOrigNumFrames\n200\t200\t{len(swing['t'])}\t1\tm\t200\t1\t{len(swing['t'])}\n"
    head += "Frame#\tTime\tm\t\t\t\n\t\tX1\tY1\tZ1\t\n\n"
    rows = [f"{k}\t{t:.6g}\t{q:.6g}\t{i:.6g}\t0" for k, (t, q, i) in enumerate(zip(*swing.values(), strict=True), 1)]
    path.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


def _delsys(path: Path, swing: Swing) -> None:
    rows = [f"{t:.6g},{q:.6g},{t:.6g},{i:.6g}" for t, q, i in zip(*swing.values(), strict=True)]
    path.write_text("\n".join(("X[s],q,X[s],i", *rows)) + "\n", encoding="utf-8")


def _mcap(path: Path, swing: Swing) -> None:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("joint", "jsonschema", b"{}")
        channel = writer.register_channel("/joint", "json", schema)
        for t, q, i in zip(*swing.values(), strict=True):
            writer.add_message(channel, round(1e9 * t), json.dumps({"q": q, "i": i}).encode(), round(1e9 * t))
        writer.finish()


def _bag(path: Path, swing: Swing) -> None:
    from rosbags.rosbag1 import Writer as OldWriter
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    old = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    vector = store.types["geometry_msgs/msg/Vector3"]
    folder = path.parent / "bag"
    writer = OldWriter(path) if old else Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3)
    with writer:
        joint = writer.add_connection("/joint", vector.__msgtype__, typestore=store)
        serialize = store.serialize_ros1 if old else store.serialize_cdr
        for t, q, i in zip(*swing.values(), strict=True):
            writer.write(joint, round(1e9 * t), serialize(vector(x=q, y=i, z=0.0), vector.__msgtype__))
    if not old:
        next(folder.glob("*.db3")).rename(path)
        shutil.rmtree(folder)


PLAIN_COLUMNS = ("t", "q", "i")
"""Names of the columns of time, position and current in formats without units."""

WRITERS: Mapping[str, tuple[tuple[Callable[[Path, Swing], None], tuple[str, str, str]], ...]] = {
    ".csv": (
        (_table(","), PLAIN_COLUMNS),
        (_delsys, ("q.time", "q", "i")),
        (_nexus, ("Devices.time", "bench.q", "bench.i")),
    ),
    ".tsv": ((_table("\t"), PLAIN_COLUMNS),),
    ".asc": ((_table("\t"), PLAIN_COLUMNS),),
    ".log": ((_table(","), PLAIN_COLUMNS),),
    ".txt": ((_table(" "), PLAIN_COLUMNS), (_delsys, ("q.time", "q", "i"))),
    ".dat": ((_table(";"), PLAIN_COLUMNS), (_storage, PLAIN_COLUMNS)),
    ".json": ((_json, PLAIN_COLUMNS), (_json_lines, PLAIN_COLUMNS)),
    ".jsonl": ((_json_lines, PLAIN_COLUMNS),),
    ".ndjson": ((_json_lines, PLAIN_COLUMNS),),
    ".lvm": ((_labview, ("X_Value", "q", "i")),),
    ".mat": ((_mat, PLAIN_COLUMNS), (_mat_hdf5, PLAIN_COLUMNS)),
    ".sto": ((_storage, PLAIN_COLUMNS),),
    ".mot": ((_storage, PLAIN_COLUMNS),),
    ".c3d": ((_c3d, ("analog.time", "q", "i")),),
    ".edf": ((_edf, ("time", "q", "i")),),
    ".bdf": ((_edf, ("time", "q", "i")),),
    ".xdf": ((_xdf, ("rig.time", "rig.q", "rig.i")),),
    ".xlsx": ((_workbook, PLAIN_COLUMNS),),
    ".xlsm": ((_workbook, PLAIN_COLUMNS),),
    ".ods": ((_workbook, PLAIN_COLUMNS),),
    ".h5": ((_hdf5, PLAIN_COLUMNS),),
    ".hdf5": ((_hdf5, PLAIN_COLUMNS),),
    ".hdf": ((_hdf5, PLAIN_COLUMNS),),
    ".npz": ((_arrays, PLAIN_COLUMNS),),
    ".npy": ((_arrays, ("sweep.t", "sweep.q", "sweep.i")),),
    ".parquet": ((_arrow, PLAIN_COLUMNS),),
    ".feather": ((_arrow, PLAIN_COLUMNS),),
    ".trc": ((_trc, ("point.time", "m_x", "m_y")),),
    ".mcap": ((_mcap, ("joint.time", "joint.q", "joint.i")),),
    ".bag": ((_bag, ("joint.time", "joint.x", "joint.y")),),
    ".db3": ((_bag, ("joint.time", "joint.x", "joint.y")),),
}
"""By ending: what writes a recording, and the names that its columns of time, position and current then have."""


def healthy(folder: Path, n: int = 2000, *, endings: Collection[str] | None = None) -> Iterator[Path]:
    """Studies, each in a folder of its own with a recording in one format: every ending, or these, that has a reader.

    An ending that nothing here writes gets every other format's files: a new reader is tried too.
    """
    from pellucid.files.readers.read import readers_by_ending

    known = swing(n)
    others = tuple(each for many in WRITERS.values() for each in many)
    for ending in sorted(readers_by_ending()):
        if endings is not None and ending not in endings:
            continue
        for number, (write, (time, position, current)) in enumerate(WRITERS.get(ending, others)):
            study = folder / f"{ending[1:]}-{number}"
            (study / "recordings").mkdir(parents=True)
            write(study / "recordings" / f"sweep{ending}", known)
            said = BENCH_STUDY_TEXT.format(ending=ending, time=time, position=position, current=current)
            (study / "study.toml").write_text(said, encoding="utf-8")
            yield study


MUSCLE_STUDY_TEXT = """name = "muscle"

[rig]
joint = "muscle"
motion = "prismatic"

[channels]
time = { column = "t", unit = "s" }
force = { column = "f", unit = "N" }

[streams.displacement.channels]
time = { column = "t", unit = "s" }
displacement = { column = "x", unit = "1" }

[isolated_muscle]
isometric_force = "1.17 N"
max_isometric_force = "1.28 N"
optimal_fibre_length = "17 mm"
tendon_slack_length = "17 mm"
pennation = "6 deg"
"""
"""Text of the study.toml of a healthy study of an isolated muscle."""


def muscle_study(folder: Path) -> None:
    """A muscle whose length is imposed, in two recordings: what `calibrate` can be asked without EMG."""
    (folder / "recordings").mkdir(parents=True)
    t, said = np.arange(800) / 200.0, MUSCLE_STUDY_TEXT
    x = np.sin(2 * np.pi * 1.3 * t)
    _table(",")(folder / "recordings" / "x.csv", {"t": t, "x": x})
    for name, use, amplitude in (("small", "fit", 0.1), ("large", "validate", 0.5)):
        _table(",")(folder / "recordings" / f"{name}.csv", {"t": t, "f": 1.17 + 0.3 * amplitude * x})
        said += f'[[recordings]]\nname = "{name}"\nfile = "recordings/{name}.csv"\nuse = "{use}"\n'
        said += f'streams = {{ displacement = "recordings/x.csv" }}\namplitude = "{amplitude} mm"\n'
        said += 'protocol = "imposed_length"\n'
    (folder / "study.toml").write_text(said, encoding="utf-8")


def pointing_study(folder: Path) -> None:
    """Six people who point under two conditions, as few as a difference can be shown of."""
    rng, fs = np.random.default_rng(5), 100.0
    (folder / "recordings").mkdir(parents=True)
    said = 'name = "pointing"\n[rig]\njoint = "elbow"\nmotion = "rotary"\n[channels]\n'
    said += 'time = { column = "t", unit = "s" }\ntarget = { column = "g", unit = "deg" }\n'
    said += 'position = { column = "q", unit = "deg" }\n[assessment]\ncontrol = "Ctrl"\n'
    people = [f"P{i}" for i in range(6)]
    for person in people:
        said += f'[participants.{person}]\nmass = "63 kg"\n'
    for person in people:
        for condition, slower in (("Ctrl", 1.0), ("FC", 1.2)):
            angle, target, at = [np.full(100, 60.0)], [np.full(100, 60.0)], 60.0
            for step in np.tile([12.0, -12.0, 36.0, -36.0, 60.0, -60.0], 2):
                n = int(fs * slower * (0.4 + 0.008 * abs(step)) * np.exp(0.05 * rng.standard_normal()))
                s = np.clip((np.arange(n + 150) - 30) / n, 0.0, 1.0)
                angle.append(at + step * (10 * s**3 - 15 * s**4 + 6 * s**5))
                target.append(np.full(n + 150, at + step))
                at += step
            q = np.concatenate(angle)
            name = f"{person}_{condition}"
            columns = {"t": np.arange(len(q)) / fs, "g": np.concatenate(target), "q": q}
            _table(",")(folder / "recordings" / f"{name}.csv", columns)
            said += f'[[recordings]]\nname = "{name}"\nfile = "recordings/{name}.csv"\nprotocol = "pointing"\n'
            said += f'participant = "{person}"\ncondition = "{condition}"\n'
    (folder / "study.toml").write_text(said, encoding="utf-8")
