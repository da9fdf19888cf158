"""Recordings that each format's own library writes, read by Pellucid and compared with what that library reads."""

from __future__ import annotations

import importlib.util
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from pellucid.files.readers import read_columns
from pellucid.study.results import ResultRow
from research.evidence._healthy import WRITERS, swing

Found = Mapping[str, np.ndarray]
"""Columns by the name that Pellucid gives them."""


def _workbook(path: Path) -> Found:
    import openpyxl

    rows = list(openpyxl.load_workbook(path, read_only=True).active.values)
    columns = zip(rows[0], zip(*rows[1:], strict=True), strict=True)
    return {str(name): np.array(column, float) for name, column in columns}


def _ods(path: Path) -> Found:
    import pandas

    frame = pandas.read_excel(path, engine="odf")
    return {name: frame[name].to_numpy(float) for name in frame.columns}


def _csv(path: Path) -> Found:
    import pandas

    swing_frame = pandas.DataFrame(swing(400))
    swing_frame.to_csv(path, index=False, sep={".csv": ",", ".tsv": "\t", ".txt": ";"}[path.suffix])
    return {name: swing_frame[name].to_numpy() for name in swing_frame}


def _json(path: Path) -> Found:
    return {name: np.array(x, float) for name, x in json.loads(path.read_text()).items()}


def _mat(path: Path) -> Found:
    import scipy.io

    found = scipy.io.loadmat(path, simplify_cells=True)
    return {"t": found["t"], "q": found["q"], "i": found["i"], "log.q": found["log"]["q"]}


def _mat_tables(path: Path) -> Found:
    import matio
    import pandas

    known = pandas.DataFrame(swing(400))
    matio.save_to_mat(str(path), {"log": known, "run": {"deep": known}}, version="v7.3")
    found = matio.load_from_mat(str(path))["log"]
    return {f"{prefix}.{name}": found[name].to_numpy() for prefix in ("log", "run.deep") for name in found.columns}


def _hdf5(path: Path) -> Found:
    import h5py

    with h5py.File(path, "r") as file:
        return {name: np.asarray(file[name]) for name in file}


def _npz(path: Path) -> Found:
    with np.load(path) as found:
        return dict(found)


def _npy(path: Path) -> Found:
    found = np.load(path)
    return {f"{path.stem}.{name}": found[name] for name in found.dtype.names}


def _parquet(path: Path) -> Found:
    from pyarrow import parquet

    table = parquet.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def _feather(path: Path) -> Found:
    from pyarrow import feather

    table = feather.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def _c3d(path: Path) -> Found:
    import ezc3d

    found = ezc3d.c3d(str(path))
    points, analogs = found["data"]["points"], found["data"]["analogs"][0]
    markers = {f"wrist_{axis}": points[i, 0] for i, axis in enumerate("xyz")}
    return {**markers, "q": analogs[0], "i": analogs[1]}


def _edf(path: Path) -> Found:
    import edfio

    found = edfio.read_bdf(path) if path.suffix == ".bdf" else edfio.read_edf(path)
    return {signal.label: signal.data for signal in found.signals}


def _xdf(path: Path) -> Found:
    import pyxdf

    (stream,), _ = pyxdf.load_xdf(str(path))
    times = stream["time_stamps"]
    series = stream["time_series"]
    return {"rig.time": times - times[0], "rig.q": series[:, 0].astype(float), "rig.i": series[:, 1].astype(float)}


def _mcap(path: Path) -> Found:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        found = [(m.log_time, json.loads(m.data)) for _, _, m in make_reader(file).iter_messages()]
    times = np.array([(time - found[0][0]) / 1e9 for time, _ in found])
    return {"joint.time": times, **{f"joint.{k}": np.array([m[k] for _, m in found]) for k in "qi"}}


def _bag(path: Path) -> Found:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        found = [(time, bag.deserialize(content, c.msgtype)) for c, time, content in bag.messages()]
    times = np.array([(time - found[0][0]) / 1e9 for time, _ in found])
    return {"joint.time": times, **{f"joint.{k}": np.array([getattr(m, k) for _, m in found]) for k in "xyz"}}


def _opensim_storage(path: Path) -> Found:
    import opensim

    known, table = swing(400), opensim.TimeSeriesTable()
    table.setColumnLabels(["q", "i"])
    for t, q, i in zip(known["t"], known["q"], known["i"], strict=True):
        table.appendRow(float(t), opensim.RowVector([float(q), float(i)]))
    table.addTableMetaDataString("inDegrees", "no")
    opensim.STOFileAdapter.write(table, str(path))
    found = opensim.TimeSeriesTable(str(path))
    columns = {name: found.getDependentColumn(name).to_numpy() for name in found.getColumnLabels()}
    return {"time": np.array(found.getIndependentColumn()), **columns}


def _opensim_trc(path: Path) -> Found:
    import opensim

    known, table = swing(400), opensim.TimeSeriesTableVec3()
    table.setColumnLabels(["wrist"])
    for t, q, i in zip(known["t"], known["q"], known["i"], strict=True):
        table.appendRow(float(t), opensim.RowVectorVec3([opensim.Vec3(float(q), float(i), 0.0)]))
    table.addTableMetaDataString("DataRate", "200.0")
    table.addTableMetaDataString("Units", "m")
    opensim.TRCFileAdapter.write(table, str(path))
    found = opensim.TimeSeriesTableVec3(str(path)).flatten(["_x", "_y", "_z"])
    columns = {name: found.getDependentColumn(name).to_numpy() for name in found.getColumnLabels()}
    return {"point.time": np.array(found.getIndependentColumn()), **columns}


ReadByItsLibrary = Callable[[Path], Found]
"""Reads a file, or writes and reads it, with a format's own library."""

FORMATS: Mapping[str, tuple[str, ReadByItsLibrary, bool]] = {
    "CSV by pandas": (".csv", _csv, False),
    "TSV by pandas": (".tsv", _csv, False),
    "text with semicolons by pandas": (".txt", _csv, False),
    "JSON": (".json", _json, True),
    "workbook by openpyxl": (".xlsx", _workbook, True),
    "OpenDocument sheet by odfpy": (".ods", _ods, True),
    "MAT 5 by SciPy": (".mat", _mat, True),
    "MAT 7.3 with tables by mat-io": (".mat", _mat_tables, False),
    "HDF5 by h5py": (".h5", _hdf5, True),
    "NPZ by NumPy": (".npz", _npz, True),
    "NPY by NumPy": (".npy", _npy, True),
    "Parquet by PyArrow": (".parquet", _parquet, True),
    "Feather by PyArrow": (".feather", _feather, True),
    "C3D by ezc3d": (".c3d", _c3d, True),
    "EDF by edfio": (".edf", _edf, True),
    "BDF by edfio": (".bdf", _edf, True),
    "XDF, written here, by pyxdf": (".xdf", _xdf, True),
    "MCAP by mcap": (".mcap", _mcap, True),
    "ROS 1 bag by rosbags": (".bag", _bag, True),
    "ROS 2 bag by rosbags": (".db3", _bag, True),
}
"""By format: its ending, what reads it with its own library, and whether `WRITERS` wrote it before."""

FORMATS_OF_OPENSIM: Mapping[str, tuple[str, ReadByItsLibrary, bool]] = {
    "STO by OpenSim": (".sto", _opensim_storage, False),
    "MOT by OpenSim": (".mot", _opensim_storage, False),
    "TRC by OpenSim": (".trc", _opensim_trc, False),
}
"""The same, where OpenSim is installed."""


def comparisons(scratch: Path) -> Iterator[tuple[str, bool]]:
    """Each format, and whether every number is read back equal, to the last bit."""
    with_opensim = importlib.util.find_spec("opensim") is not None
    for name, (ending, read, written) in (FORMATS | (FORMATS_OF_OPENSIM if with_opensim else {})).items():
        path = scratch / f"sweep{ending}"
        if written:
            WRITERS[ending][0][0](path, swing(400))
        expected = read(path)
        found = read_columns(path)
        equal = [np.array_equal(found[key], x, equal_nan=True) for key, x in expected.items()]
        yield name, len(equal) > 1 and all(equal)
        path.unlink()


def rows() -> Iterator[ResultRow]:
    """How many formats there are, and in how many a number differs."""
    with tempfile.TemporaryDirectory() as scratch:
        found = dict(comparisons(Path(scratch)))
    unequal = [name for name, equal in found.items() if not equal]
    yield ResultRow("formats.read_back.count", len(found), "1", "evidence", "heldout", None, ", ".join(found))
    yield ResultRow("formats.read_back.unequal", len(unequal), "1", "evidence", "heldout", None, ", ".join(unequal))
