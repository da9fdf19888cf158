"""EMG in the layouts of vendors' exports and of common formats, written from the vendors' manuals and public files.

Nothing here uses the package's readers or their libraries' writers: text is written by hand, EDF, BDF and XDF byte by
byte, C3D by ezc3d and MATLAB files by SciPy.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ._emg_signals import EmgRecording

VOLTS = {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6, "1": 1.0, "%": 0.01}
"""Size of a stated unit."""

Labelled = Sequence[str]
"""Labels of a recording's channels."""

Labels = Callable[[str, str], str]
"""Function of a muscle and a side, "left", "right" or "", that returns a label."""

SHORT = {
    "vastus_lateralis": "VL", "rectus_femoris": "RF", "biceps_femoris": "BF", "semitendinosus": "ST",
    "tibialis_anterior": "TA", "gastrocnemius_medialis": "GM", "soleus": "SOL", "vastus_medialis": "VM",
}  # fmt: skip
NORAXON = {
    "vastus_lateralis": "VLO", "rectus_femoris": "RECTUS FEM.", "biceps_femoris": "BICEPS FEM.",
    "semitendinosus": "SEMITEND.", "tibialis_anterior": "TIB.ANT.", "gastrocnemius_medialis": "MED. GASTRO",
    "soleus": "SOLEUS", "vastus_medialis": "VMO",
}  # fmt: skip
LETTER = {"left": "L", "right": "R", "": ""}


def _words(muscle: str) -> str:
    return muscle.replace("_", " ")


def short_label(muscle: str, side: str) -> str:
    """VL, or R VL."""
    return f"{LETTER[side]} {SHORT[muscle]}".strip()


def joined_label(muscle: str, side: str) -> str:
    """RVL."""
    return f"{LETTER[side]}{SHORT[muscle]}"


def under_label(muscle: str, side: str) -> str:
    """VL_R."""
    return f"{SHORT[muscle]}_{LETTER[side]}".strip("_")


def noraxon_label(muscle: str, side: str) -> str:
    """RT VLO."""
    return f"{ {'left': 'LT', 'right': 'RT', '': ''}[side] } {NORAXON[muscle]}".strip()


def full_label(muscle: str, side: str) -> str:
    """Right Vastus Lateralis."""
    return f"{side} {_words(muscle)}".strip().title()


def emg_label(muscle: str, side: str) -> str:
    """EMG_VL_R."""
    return f"EMG_{under_label(muscle, side)}"


@dataclass(frozen=True)
class EmgLayout:
    """A layout of files of EMG.

    Attributes
    ----------
    name : str
        Vendor or format.
    write : callable
        Function of a folder, a stem, a recording, its labels and its stated unit; it returns the path.
    label : callable
        Labels of muscles.
    sides : tuple of str
        Sides of the muscles, repeated in turn.
    unit : str
        Unit that the file states.
    holds_times : bool
        Whether a gap of the clock is in the file.
    holds_missing : bool
        Whether a sample may be missing.
    states_unit : bool
        Whether the file states a unit.
    """

    name: str
    write: Callable[[Path, str, EmgRecording, Sequence[str], str], Path]
    label: Labels
    sides: tuple[str, ...] = ("right",)
    unit: str = "uV"
    holds_times: bool = True
    holds_missing: bool = True
    states_unit: bool = True

    def muscles(self, recording: EmgRecording) -> tuple[tuple[str, str], ...]:
        """Return the muscle and the side of every channel."""
        return tuple((m, self.sides[i % len(self.sides)]) for i, m in enumerate(recording.muscles))

    def written(self, folder: Path, stem: str, recording: EmgRecording) -> Path:
        """Write a recording in this layout, and return its path."""
        labels = [self.label(m, side) for m, side in self.muscles(recording)]
        unit = {"1": "%"}.get(recording.unit, self.unit)
        scaled = replace(recording, emg=recording.emg * recording.stated_factor / VOLTS[unit])
        folder.mkdir(parents=True, exist_ok=True)
        return self.write(folder, stem, scaled, labels, unit)

    def fits(self, kind: str, variant: int) -> bool:
        """Return whether files of this layout can have a spoiling."""
        if kind == "clock":
            return self.holds_times
        if kind == "unit":
            return self.states_unit
        if kind == "normalised_per_trial":
            return self.states_unit
        return not (kind == "dropout" and variant % 3 == 2) or self.holds_missing


def _cell(x: float) -> str:
    text = f"{x:.7g}"
    return "" if text == "nan" else text


_raw_cell = "{:.7g}".format
"""Text of a value whose missing samples are "nan"."""


def _table(rows: Iterable[Sequence[str]], delimiter: str) -> str:
    return _text([delimiter.join(row) for row in rows])


def _samples(r: EmgRecording, time: str = ".6f", cell: Callable[[float], str] = _cell) -> Iterator[list[str]]:
    """Yield the cells of each sample: its time in a format, and every channel."""
    for t, row in zip(r.time.tolist(), r.emg.tolist(), strict=True):
        yield [format(t, time), *map(cell, row)]


def _numbered_samples(r: EmgRecording) -> Iterator[list[str]]:
    """Yield the cells of each sample behind its number, from 1."""
    return ([f"{i}", *row] for i, row in enumerate(_samples(r, cell=_raw_cell), start=1))


def _text(lines: Sequence[str]) -> str:
    return "\n".join(lines) + "\n"


def _write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


# --- text of vendors -------------------------------------------------------------------------------------------------


def delsys_emgworks(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """EMGworks File Utility: a column of times for every signal, accelerometers at a lower rate than the EMG."""
    heads, columns = [], []
    slow = np.arange(r.time[0], r.time[-1], 1.0 / 148.148)
    for k, label in enumerate(labels):
        heads += ["X[s]", f"{label}: EMG {k + 1}[{unit}]"]
        columns += [[f"{x:.7f}" for x in r.time.tolist()], [_cell(x) for x in r.emg[:, k].tolist()]]
        for axis, phase in zip("XYZ", (0.0, 1.0, 2.0), strict=True):
            heads += ["X[s]", f"{label}: ACC {axis} {k + 1}[g]"]
            columns += [[f"{x:.7f}" for x in slow], [f"{0.5 + 0.2 * np.sin(5.7 * x + phase):.6f}" for x in slow]]
    height = max(map(len, columns))
    filled = [column + [""] * (height - len(column)) for column in columns]
    return _write(folder / f"{stem}.csv", _table([heads, *zip(*filled, strict=True)], ","))


def trigno_discover(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """Trigno Discover: a header of the application, then "Time Series (s)" before every signal."""
    heads: list[str] = []
    for k, label in enumerate(labels):
        heads += [f"{label} EMG {k + 1} Time Series (s)", f"{label} EMG {k + 1} ({unit})"]
    lines = [
        "Application:,Trigno Discover", "Version:,1.7.1", "Date/Time:,5/12/2024 10:21:33 AM",
        f"Collection Length (seconds):,{r.time[-1]:.3f}", "", ",".join(heads),
    ]  # fmt: skip
    lines += [",".join(f"{t},{x}" for x in row) for t, *row in _samples(r, ".7f")]
    return _write(folder / f"{stem}.csv", _text(lines))


def noraxon_mr3(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """MyoResearch 3: three lines about the record, then times, activity, marker and channels with their unit."""
    lines = [
        f"Record name,{stem},",
        "Measurement date,2024-05-12 10:21,",
        "",
        ",".join(['"time,s"', "Activity", "Marker", *(f'"Ultium EMG.{label},{unit}"' for label in labels)]),
    ]
    table = _table(([t, "Activity", "", *row] for t, *row in _samples(r)), ",")
    return _write(folder / f"{stem}.csv", _text(lines) + table)


def noraxon_plain(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """MyoResearch, exported for a spreadsheet: one line of names with units in brackets, semicolons."""
    heads = ["Time (s)", *(f"{label} ({unit})" for label in labels)]
    return _write(folder / f"{stem}.csv", _table([heads, *_samples(r)], ";"))


def cometa_text(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """Cometa's EMG and Motion Tools: facts above a table with tabulators."""
    lines = [
        "EMG and Motion Tools\t8.7.6", f"Frequency [Hz]\t{r.rate:g}", f"Samples\t{len(r.time)}", "",
        "\t".join(["Time [s]", *(f"{label} [{unit}]" for label in labels)]),
    ]  # fmt: skip
    return _write(folder / f"{stem}.txt", _text(lines) + _table(_samples(r), "\t"))


def labchart_text(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """LabChart: interval, date, titles and ranges above a table whose first column is the time."""
    tops = [f"{float(np.nanmax(np.abs(x))) * 1.2:.3f} {unit}" for x in r.emg.T]
    lines = [
        f"Interval=\t{1.0 / r.rate:.9g} s", "ExcelDateTime=\t4.5424432E4\t05/12/24 10:21:33.000",
        "TimeFormat=\tStartOfBlock",
        "DateFormat=\t", "\t".join(["ChannelTitle=", *labels]), "\t".join(["Range=", *tops]),
    ]  # fmt: skip
    table = _table(_samples(r, cell=lambda x: _cell(x) or "NaN"), "\t")
    return _write(folder / f"{stem}.txt", _text(lines) + table)


def biopac_text(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """AcqKnowledge: name, interval, number of channels, a name and a unit for each, then times."""
    lines = [f"{stem}.acq", f"{1e3 / r.rate:.7g} msec/sample", f"{len(labels)} channels"]
    for label in labels:
        lines += [label, {"uV": "microvolts", "mV": "mV", "V": "Volts", "%": "%"}[unit]]
    heads = [["sec", *(f"CH{k + 1}" for k in range(len(labels)))], ["", *(f"{len(r.time)}" for _ in labels)]]
    table = _table(([*row, ""] for row in (*heads, *_samples(r))), ",")
    return _write(folder / f"{stem}.txt", _text(lines) + table)


def bts_emt(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """BTS: facts in lines with a colon, a line of names, a line for each frame with its number."""
    lines = [
        "BTS ASCII format", "", "Type:\tEmg tracks", f"Measure unit:\t{unit}", "", f"Tracks:\t{len(labels)}",
        f"Frequency:\t{r.rate:g} Hz", f"Frames:\t{len(r.time)}", f"Start time:\t{r.time[0]:.3f}", "",
        "\t".join(["Frame", "Time", *labels]), "",
    ]  # fmt: skip
    return _write(folder / f"{stem}.emt", _text(lines) + _table(_numbered_samples(r), "\t"))


def vicon_devices(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """Vicon Nexus: the block "Devices" with frames, sub frames, and a line of names above that of units."""
    lines = [
        "Devices", f"{r.rate:g}", ",,Imported Delsys EMG - Voltage" + "," * (len(labels) - 1),
        ",".join(["Frame", "Sub Frame", *labels]), ",".join(["", "", *(unit for _ in labels)]),
    ]  # fmt: skip
    per = 10
    rows = ([f"{i // per + 1}", f"{i % per}", *row] for i, (_, *row) in enumerate(_samples(r, cell=_raw_cell)))
    return _write(folder / f"{stem}.csv", _text(lines) + _table(rows, ","))


def qualisys_tsv(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """Qualisys: analog data in a TSV of their own, with facts by name above and the channels' names in one of them."""
    lines = [
        f"NO_OF_SAMPLES\t{len(r.time)}", f"TOT_NO_OF_CHAN\t{len(labels)}", f"NO_OF_CALC\t{len(r.time)}",
        f"SAMPLE_RATE\t{r.rate:g}", "TIME_STAMP\t2024-05-12, 10:21:33.000", "DESCRIPTION\t--",
        "DATA_INCLUDED\tANALOG", "\t".join(["CHANNEL_NAMES", *labels]), "\t".join(["UNITS", *(unit for _ in labels)]),
        "\t".join(["SAMPLE", "TIME", *labels]),
    ]  # fmt: skip
    return _write(folder / f"{stem}.tsv", _text(lines) + _table(_numbered_samples(r), "\t"))


def opensignals_text(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """OpenSignals: facts as JSON in a comment, a sequence number, and converted samples."""
    facts = {
        "00:07:80:3B:46:61": {
            "sensor": ["EMG"] * len(labels), "device name": "00:07:80:3B:46:61", "column": ["nSeq", *labels],
            "sampling rate": round(r.rate), "resolution": [16] * len(labels), "label": list(labels),
            "units": [unit] * len(labels),
        }
    }  # fmt: skip
    lines = ["# OpenSignals Text File Format", f"# {json.dumps(facts)}", "# EndOfHeader"]
    rows = ([f"{i}", *row] for i, (_, *row) in enumerate(_samples(r, cell=_raw_cell)))
    return _write(folder / f"{stem}.txt", _text(lines) + _table(rows, "\t"))


def motion_lab_text(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """Motion Lab Systems: a title, the rate, names and units in lines of their own."""
    lines = [
        "Motion Lab Systems EMG Graphing export", f"Sample rate: {r.rate:g} Hz", "",
        "\t".join(["Time", *labels]), "\t".join(["(s)", *(f"({unit})" for _ in labels)]),
    ]  # fmt: skip
    return _write(folder / f"{stem}.txt", _text(lines) + _table(_samples(r), "\t"))


def plain_csv(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """time_s, VL_mV, ..."""
    heads = ["time_s", *(f"{label.replace(' ', '_')}_{'percent' if unit == '%' else unit}" for label in labels)]
    return _write(folder / f"{stem}.csv", _table([heads, *_samples(r, ".7g")], ","))


def comma_csv(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """A European spreadsheet: semicolons, and commas in numbers."""
    heads = ["Time [ms]", *(f"{label} [{unit}]" for label in labels)]
    samples = _table(_samples(replace(r, time=1e3 * r.time), ".7g"), ";").replace(".", ",")
    return _write(folder / f"{stem}.csv", _table([heads], ";") + samples)


def indexed_csv(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """A script's export: wall-clock stamps in seconds since 1970 and a line of units."""
    rows = [["timestamp", *labels], ["s", *(unit for _ in labels)], *_samples(replace(r, time=1715500000.0 + r.time))]
    return _write(folder / f"{stem}.csv", _table(rows, ","))


def opensim_sto(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """A storage file, as CEINMS and OpenSim use it; it states no unit, and holds raw EMG in volts."""
    lines = [
        stem, "version=1", f"nRows={len(r.time)}", f"nColumns={len(labels) + 1}", "inDegrees=no", "endheader",
        "\t".join(["time", *labels]),
    ]  # fmt: skip
    return _write(folder / f"{stem}.sto", _text(lines) + _table(_samples(r, ".7g", "{:.8g}".format), "\t"))


# --- MATLAB ----------------------------------------------------------------------------------------------------------


def otb_mat(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """OTBioLab+: Data, Time and Description in cells."""
    from scipy.io import savemat

    def cell(x: object) -> np.ndarray:
        made = np.empty((1, 1), dtype=object)
        made[0, 0] = x
        return made

    said = np.array([[f"{label} - MULTIPLE IN {k + 1} ({k + 1})[{unit}]"] for k, label in enumerate(labels)], object)
    path = folder / f"{stem}.mat"
    content = {"Data": cell(r.emg), "Time": cell(r.time[:, None]), "Description": said, "SamplingFrequency": r.rate,
               "OTBFile": f"{stem}.otb+"}  # fmt: skip
    savemat(path, content)
    return path


def struct_mat(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """A struct of a laboratory: emg.data, emg.labels, emg.fs, emg.unit."""
    from scipy.io import savemat

    path = folder / f"{stem}.mat"
    own = {"data": r.emg, "labels": np.array(labels, object), "fs": float(r.rate), "unit": unit}
    savemat(path, {"emg": own})
    return path


def fields_mat(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """A struct with a field for the time and one for every muscle."""
    from scipy.io import savemat

    path = folder / f"{stem}.mat"
    fields = {label.replace(" ", "_"): x[:, None] for label, x in zip(labels, r.emg.T, strict=True)}
    savemat(path, {"time": r.time[:, None], f"EMG_{'percent' if unit == '%' else unit}": fields})
    return path


# --- EDF, BDF, BIDS --------------------------------------------------------------------------------------------------


def _field(text: str, width: int) -> bytes:
    return text.encode("latin-1", "replace")[:width].ljust(width)


def edf_bytes(
    signals: Sequence[tuple[str, str, float, np.ndarray]], starts: np.ndarray, width: int, seconds: float
) -> bytes:
    """Return a file of records of `seconds`, which begin at `starts`, with annotations that say when.

    `signals`: label, unit, rate and samples of each; `width`: 2 bytes a sample in EDF+, 3 in BDF+.
    """
    top = 2 ** (8 * width - 1)
    even = np.allclose(np.diff(starts), seconds)
    heads, ranges, counts = [], [], []
    for label, unit, rate, x in signals:
        # A bound has eight characters.
        top_value = max(1.05 * float(np.abs(x).max()), 1e-12)
        step = 10.0 ** (np.floor(np.log10(top_value)) - 1)
        most = float(f"{np.ceil(top_value / step) * step:.3g}")
        ranges.append(most)
        counts.append(round(rate * seconds))
        heads.append((label, unit, f"{-most:g}"[:8], f"{most:g}"[:8], str(-top), str(top - 1)))
    kind = "EDF" if width == 2 else "BDF"
    heads.append((f"{kind} Annotations", "", "-1", "1", str(-top), str(top - 1)))
    counts.append(24)
    n = len(heads)
    version = b"0".ljust(8) if width == 2 else b"\xffBIOSEMI"
    begin = version + _field("X X X X", 80) + _field("Startdate 12-MAY-2024 X X X", 80)
    begin += b"12.05.24" + b"10.21.33" + _field(str(256 * (n + 1)), 8)
    begin += _field(f"{kind}+{'C' if even else 'D'}", 44) + _field(str(len(starts)), 8) + _field(f"{seconds:g}", 8)
    begin += _field(str(n), 4)
    for width_of, column in (
        (16, [h[0] for h in heads]), (80, ["AgAgCl electrodes"] * (n - 1) + [""]), (8, [h[1] for h in heads]),
        (8, [h[2] for h in heads]), (8, [h[3] for h in heads]), (8, [h[4] for h in heads]), (8, [h[5] for h in heads]),
        (80, ["HP:10Hz LP:500Hz"] * (n - 1) + [""]), (8, [str(c) for c in counts]), (32, [""] * n),
    ):  # fmt: skip
        begin += b"".join(_field(text, width_of) for text in column)
    body = [begin]
    digital = []
    for (_, _, _, x), most in zip(signals, ranges, strict=True):
        scaled = np.round((x + most) / (2.0 * most) * (2 * top - 1) - top)
        digital.append(np.clip(scaled, -top, top - 1).astype("<i4"))
    for i, start in enumerate(starts):
        for x, count in zip(digital, counts[:-1], strict=True):
            part = x[i * count : (i + 1) * count]
            body.append(
                part.astype("<i2").tobytes() if width == 2 else part.view(np.uint8).reshape(-1, 4)[:, :3].tobytes()
            )
        body.append(f"+{start:.6f}".encode() + b"\x14\x14\x00".ljust(24 * width - len(f"+{start:.6f}"), b"\x00"))
    return b"".join(body)


def _edf(folder: Path, stem: str, r: EmgRecording, labels: Sequence[str], unit: str, width: int, slow: bool) -> Path:
    rate = round(r.rate)
    seconds = 0.1
    each = round(rate * seconds)
    # Whole records stay: a lost packet is a record.
    n = len(r.time) // each * each
    starts = r.time[:n:each]
    signals = [(label, unit, float(rate), x[:n]) for label, x in zip(labels, r.emg.T, strict=True)]
    if slow:
        t = (starts[:, None] + np.arange(10) / 100.0).ravel()
        signals.append(("knee_angle", "deg", 100.0, 30.0 + 25.0 * np.sin(5.7 * t)))
    path = folder / f"{stem}.{'edf' if width == 2 else 'bdf'}"
    path.write_bytes(edf_bytes(signals, starts, width, seconds))
    return path


def edf(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """EDF+ of EMG alone."""
    return _edf(folder, stem, r, [f"EMG {label}" for label in labels], unit, 2, False)


def edf_two_rates(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """EDF+ with a goniometer at 100 Hz."""
    return _edf(folder, stem, r, labels, unit, 2, True)


def bdf(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """BDF+ of EMG alone."""
    return _edf(folder, stem, r, labels, unit, 3, False)


def bdf_two_rates(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """BDF+ with a goniometer at 100 Hz."""
    return _edf(folder, stem, r, [f"EMG {label}" for label in labels], unit, 3, True)


def bids(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """A BIDS data set of one recording: BDF with channels.tsv and a sidecar."""
    root = folder / stem
    place = root / "sub-01" / "emg"
    place.mkdir(parents=True, exist_ok=True)
    (root / "dataset_description.json").write_text(json.dumps({"Name": stem, "BIDSVersion": "1.11.0"}), "utf-8")
    base = "sub-01_task-walking"
    sidecar = {"TaskName": "walking", "SamplingFrequency": round(r.rate), "PowerLineFrequency": 50, "EMGReference": "x"}
    (place / f"{base}_emg.json").write_text(json.dumps(sidecar), "utf-8")
    rows = [["name", "type", "units", "target_muscle"]]
    rows += [[f"EMG{k + 1}", "EMG", unit, label] for k, label in enumerate(labels)]
    (place / f"{base}_channels.tsv").write_text(_table(rows, "\t"), "utf-8")
    return _edf(place, f"{base}_emg", r, [f"EMG{k + 1}" for k in range(len(labels))], unit, 3, False)


# --- C3D and XDF -----------------------------------------------------------------------------------------------------


def _c3d(folder: Path, stem: str, r: EmgRecording, labels: Sequence[str], unit: str, markers: bool) -> Path:
    import ezc3d

    per = 10
    frames = len(r.time) // per
    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"] = [r.rate / per]
    names = ["RKNE", "RANK", "RTOE"] if markers else []
    made["parameters"]["POINT"]["LABELS"]["value"] = names
    made["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, len(names), frames))
    swing = np.sin(5.7 * np.arange(frames) * per / r.rate)
    for k in range(len(names)):
        points[:3, k] = np.vstack([400.0 * swing + 30 * k, 100.0 + 0.0 * swing, 500.0 - 150.0 * k + 40.0 * swing**2])
    made["data"]["points"] = points
    made["parameters"]["ANALOG"]["RATE"]["value"] = [r.rate]
    made["parameters"]["ANALOG"]["LABELS"]["value"] = list(labels)
    made["parameters"]["ANALOG"]["UNITS"]["value"] = [unit] * len(labels)
    made["data"]["analogs"] = r.emg[: frames * per].T[None]
    path = folder / f"{stem}.c3d"
    made.write(str(path))
    return path


def c3d_markers(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """C3D of a gait laboratory: markers, and EMG as analog channels."""
    return _c3d(folder, stem, r, labels, unit, True)


def c3d_analog(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """C3D of an amplifier alone, as Cometa and Motion Lab write it."""
    return _c3d(folder, stem, r, labels, unit, False)


def xdf(folder: Path, stem: str, r: EmgRecording, labels: Labelled, unit: str) -> Path:
    """XDF of the lab streaming layer: EMG in chunks with jittering stamps, and a goniometer of 100 Hz."""
    rng = np.random.default_rng(len(r.time))

    def chunk(tag: int, content: bytes, stream: int | None = None) -> bytes:
        body = struct.pack("<H", tag) + (b"" if stream is None else struct.pack("<I", stream)) + content
        length = b"\x01" + bytes([len(body)]) if len(body) < 256 else b"\x04" + struct.pack("<I", len(body))
        return length + body

    said = {"uV": "microvolts", "mV": "millivolts", "V": "volts", "%": "%", "deg": "degrees"}
    parts = [b"XDF:", chunk(1, b'<?xml version="1.0"?><info><version>1.0</version></info>')]
    angle_time = np.arange(r.time[0], r.time[-1], 0.01)
    angle = 30.0 + 25.0 * np.sin(5.7 * angle_time)
    streams = [
        (1, "Trigno", "EMG", r.rate, labels, unit, r.emg, r.time), (2, "Gonio", "MoCap", 100.0, ["knee_angle"], "deg",
                                                                  angle[:, None], angle_time),
    ]  # fmt: skip
    for number, name, kind, rate, own, u, _, _ in streams:
        channels = "".join(
            f"<channel><label>{label}</label><unit>{said[u]}</unit><type>{kind}</type></channel>" for label in own
        )
        info = (
            f'<?xml version="1.0"?><info><name>{name}</name><type>{kind}</type><channel_count>{len(own)}'
            f"</channel_count><nominal_srate>{rate:g}</nominal_srate><channel_format>double64</channel_format>"
            f"<source_id>{name}1</source_id><desc><channels>{channels}</channels></desc></info>"
        )
        parts.append(chunk(2, info.encode(), number))
    for number, _, _, _, _, _, x, t in streams:
        stamps = 1000.0 + t + np.repeat(np.abs(rng.normal(0.0, 0.003, len(t) // 32 + 1)), 32)[: len(t)]
        for at in range(0, len(t), 256):
            rows = range(at, min(at + 256, len(t)))
            content = b"\x04" + struct.pack("<I", len(rows))
            content += b"".join(b"\x08" + struct.pack("<d", stamps[i]) + x[i].astype("<f8").tobytes() for i in rows)
            parts.append(chunk(3, content, number))
        for at in np.arange(0.0, t[-1], 5.0):
            parts.append(chunk(4, struct.pack("<dd", 1000.0 + at, 0.0), number))
        foot = (
            f'<?xml version="1.0"?><info><first_timestamp>{stamps[0]}</first_timestamp><last_timestamp>{stamps[-1]}'
            f"</last_timestamp><sample_count>{len(t)}</sample_count></info>"
        )
        parts.append(chunk(6, foot.encode(), number))
    path = folder / f"{stem}.xdf"
    path.write_bytes(b"".join(parts))
    return path


BOTH = ("left", "right")
LAYOUTS = (
    EmgLayout("delsys_emgworks", delsys_emgworks, short_label, BOTH, "V"),
    EmgLayout("trigno_discover", trigno_discover, short_label, ("right",), "mV"),
    EmgLayout("noraxon_mr3", noraxon_mr3, noraxon_label, BOTH),
    EmgLayout("noraxon_spreadsheet", noraxon_plain, noraxon_label, ("left",)),
    EmgLayout("cometa_text", cometa_text, full_label, ("right",)),
    EmgLayout("cometa_c3d", c3d_analog, joined_label, ("left",), "uV", holds_times=False, holds_missing=False),
    EmgLayout("labchart", labchart_text, emg_label, ("",), "mV"),
    EmgLayout("biopac", biopac_text, full_label, ("",), "mV"),
    EmgLayout("bts_emt", bts_emt, full_label, BOTH, "V"),
    EmgLayout("vicon_devices", vicon_devices, joined_label, BOTH, "V", holds_times=False),
    EmgLayout("qualisys_tsv", qualisys_tsv, under_label, ("right",), "V"),
    EmgLayout("opensignals", opensignals_text, emg_label, ("right",), "mV", holds_times=False),
    EmgLayout("motion_lab", motion_lab_text, full_label, ("left",), "uV"),
    EmgLayout("csv_mv", plain_csv, under_label, ("",), "mV"),
    EmgLayout("csv_uv", plain_csv, joined_label, BOTH, "uV"),
    EmgLayout("csv_v", plain_csv, full_label, ("right",), "V"),
    EmgLayout("csv_comma", comma_csv, short_label, ("",), "uV"),
    EmgLayout("csv_stamps", indexed_csv, emg_label, BOTH, "uV"),
    EmgLayout("sto", opensim_sto, emg_label, ("right",), "V", states_unit=False),
    EmgLayout("otb_mat", otb_mat, full_label, ("right",), "uV"),
    EmgLayout("struct_mat", struct_mat, short_label, ("",), "mV", holds_times=False),
    EmgLayout("fields_mat", fields_mat, under_label, BOTH, "uV"),
    EmgLayout("edf", edf, short_label, ("right",), "uV", holds_missing=False),
    EmgLayout("edf_two_rates", edf_two_rates, noraxon_label, BOTH, "uV", holds_missing=False),
    EmgLayout("bdf", bdf, full_label, ("",), "uV", holds_missing=False),
    EmgLayout("bdf_two_rates", bdf_two_rates, joined_label, BOTH, "uV", holds_missing=False),
    EmgLayout("bids", bids, full_label, ("right",), "uV", holds_missing=False),
    EmgLayout("c3d_markers", c3d_markers, joined_label, BOTH, "V", holds_times=False, holds_missing=False),
    EmgLayout("c3d_emg_labels", c3d_markers, emg_label, ("right",), "V", holds_times=False, holds_missing=False),
    EmgLayout("xdf", xdf, short_label, ("right",), "uV"),
)
"""Layouts of files."""
