"""Raw EMG on its way from and to other tools: MNE's `Raw` and folders in the form of BIDS-EMG."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import write_bytes_atomically, write_text_atomically
from .._errors import RecordingError, missing_package
from ..units import to_si_factor
from .readers._bids import NOT_KNOWN, channel_muscles, read_channel_rows, sidecar_files

BIDS_VERSION = "1.11.1"
"""Version of the Brain Imaging Data Structure in which EMG is written."""

RATE_TOLERANCE_SHARE = 1e-3
"""Share by which the sampling rate of a BIDS sidecar may differ from that of the file."""

RECORD_DURATIONS_S = (1.0, 0.5, 0.25, 0.2, 0.1, 0.05, 0.04, 0.02, 0.01)
"""Durations of a BDF file's records, of which the longest is taken that leaves nothing to pad."""

MAX_LABEL_LENGTH = 16
"""Largest number of characters of a channel's name in EDF and BDF files."""


@dataclass(frozen=True, eq=False)
class RawEmg:
    """Raw EMG of several muscles with one clock.

    Attributes
    ----------
    samples : ndarray, shape (n, muscles)
        Raw EMG [V].
    rate : float
        Sampling rate [Hz].
    muscles : tuple of str
        Name of each column.
    mains : float or None
        Frequency of the mains where it was recorded [Hz], if that is known.
    bad : frozenset of str
        Muscles whose channels were marked as bad.

    Raises
    ------
    RecordingError
        If names and columns differ in number, a name stands twice, or the rate is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> emg = pl.RawEmg(1e-5 * np.random.default_rng(0).standard_normal((4000, 2)), 2000.0, ("soleus", "tibialis"))
    >>> envelopes = pl.envelope(emg.samples, rate=emg.rate, chain="knee")
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = emg.to_bids(folder, subject="01", task="walking", reference="bipolar", placement="SENIAM")
    ...     again = pl.RawEmg.from_bids(file)
    >>> again.muscles, again.rate, bool(np.abs(again.samples - emg.samples).max() < 1e-10)
    (('soleus', 'tibialis'), 2000.0, True)
    """

    samples: np.ndarray = field(repr=False)
    rate: float
    muscles: tuple[str, ...]
    mains: float | None = None
    bad: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        samples = np.asarray(self.samples, dtype=np.float64)
        names = tuple(str(name) for name in self.muscles)
        if samples.ndim != 2 or samples.shape[1] != len(names) or not len(samples):
            raise RecordingError(
                f"RawEmg: found samples of shape {samples.shape} for {len(names)} muscles, expected (n, {len(names)})"
            )
        if len(set(names)) < len(names):
            raise RecordingError(f"RawEmg: found the muscles {', '.join(names)}, expected each name once")
        if not (np.isfinite(self.rate) and self.rate > 0.0):
            raise RecordingError(f"RawEmg: found a rate of {self.rate:g} Hz, expected more than 0")
        object.__setattr__(self, "samples", samples)
        object.__setattr__(self, "muscles", names)

    @classmethod
    def from_mne(cls, raw: Any) -> RawEmg:
        """Return the EMG channels of an `mne.io.Raw`, with the mains and the bad channels that it knows.

        Parameters
        ----------
        raw : mne.io.BaseRaw
            Recording with channels of the type ``"emg"``, in V as MNE has them.

        Returns
        -------
        RawEmg

        Raises
        ------
        RecordingError
            If it is no such object, or has no channel of the type ``"emg"``.
        """
        if not (hasattr(raw, "get_channel_types") and hasattr(raw, "get_data") and hasattr(raw, "info")):
            raise RecordingError(f"RawEmg.from_mne: found {type(raw).__name__}, expected an mne.io.Raw")
        types = raw.get_channel_types()
        names = [name for name, kind in zip(raw.ch_names, types, strict=True) if kind == "emg"]
        if not names:
            found = ", ".join(dict.fromkeys(types)) or "no channel"
            raise RecordingError(
                f'RawEmg.from_mne: found channels of the types {found}, expected "emg"; raw.set_channel_types sets them'
            )
        mains, bad = raw.info.get("line_freq"), frozenset(raw.info["bads"]) & set(names)
        samples = np.asarray(raw.get_data(picks=names)).T
        return cls(samples, float(raw.info["sfreq"]), tuple(names), None if mains is None else float(mains), bad)

    def to_mne(self) -> Any:
        """Return an `mne.io.RawArray` with these channels, of the type ``"emg"``.

        Raises
        ------
        PellucidError
            If MNE is not installed.
        """
        try:
            import mne
        except ModuleNotFoundError:
            raise missing_package("EMG as an MNE Raw", "mne", "mne") from None
        raw = mne.io.RawArray(self.samples.T, mne.create_info(list(self.muscles), self.rate, "emg"), verbose="error")
        raw.info["line_freq"] = self.mains
        raw.info["bads"] = [name for name in self.muscles if name in self.bad]
        return raw

    @classmethod
    def from_bids(cls, path: str | Path) -> RawEmg:
        """Return the EMG of one recording of a BIDS data set.

        Channels are those of the type EMG in its ``channels.tsv``, named after their ``target_muscle`` where every
        channel has its own. Without that file they are all that are in a unit of volts. The mains are those of its
        ``emg.json``. Both files may stand in folders above, as BIDS allows.

        Parameters
        ----------
        path : path
            File whose name ends in ``_emg.edf`` or ``_emg.bdf``.

        Returns
        -------
        RawEmg

        Raises
        ------
        RecordingError
            If the file is not readable, or contradicts its sidecars.
        """
        from .readers.read import read_columns

        path = Path(path)
        if path.suffix.lower() not in (".edf", ".bdf") or not path.stem.endswith("_emg"):
            raise RecordingError(f"{path.name}: found this name, expected one that ends in _emg.edf or _emg.bdf")
        columns, sidecar, listed = read_columns(path), _read_sidecar(path), read_channel_rows(path)
        wanted = [row["name"] for row in listed if row.get("type") == "EMG"]
        if not listed:
            wanted = [name for name in columns.names if columns.units.get(name, "").endswith("V")]
        if not wanted:
            raise RecordingError(f"{path.name}: found no channel of the type EMG, expected one")
        clocks = {f"{name}.time" if f"{name}.time" in columns else "time" for name in wanted}
        times = [columns.column(clock, "time") for clock in sorted(clocks)]
        rates = sorted({round(float(1.0 / (time[1] - time[0])), 6) for time in times if len(time) > 1})
        if len(rates) != 1:
            raise RecordingError(f"{path.name}: found EMG at {rates} Hz, expected one rate for all its channels")
        stated = sidecar.get("SamplingFrequency")
        if isinstance(stated, int | float) and abs(stated - rates[0]) > RATE_TOLERANCE_SHARE * rates[0]:
            raise RecordingError(
                f"{path.name}: found a rate of {rates[0]:g} Hz, expected {stated:g} Hz as in its emg.json"
            )
        duration, mains = sidecar.get("RecordingDuration"), sidecar.get("PowerLineFrequency")
        length = len(times[0])
        if isinstance(duration, int | float) and 0.0 < duration * rates[0] < length:
            length = round(duration * rates[0])  # The rest is what the last record was padded with
        units = {row["name"]: row.get("units", "") for row in listed}
        samples = np.column_stack(
            [
                _to_volts(path, name, columns.units.get(name) or units.get(name, ""))
                * columns.column(name, name)[:length]
                for name in wanted
            ]
        )
        names, bad = _muscle_names(wanted, listed), {r["name"] for r in listed if r.get("status") == "bad"}
        return cls(
            samples, rates[0], tuple(names), float(mains) if isinstance(mains, int | float) else None,
            frozenset(name for name, channel in zip(names, wanted, strict=True) if channel in bad),
        )  # fmt: skip

    def to_bids(
        self,
        folder: str | Path,
        *,
        subject: str,
        task: str,
        reference: str,
        placement: str,
        more: Mapping[str, Any] | None = None,
    ) -> Path:
        """Write one recording of a BIDS data set: a BDF file with its ``channels.tsv`` and ``emg.json``.

        Parameters
        ----------
        folder : path
            Folder of the data set. Without a ``dataset_description.json`` it gets one.
        subject, task : str
            Labels, of letters and digits alone.
        reference : str
            How channels were referenced, such as ``"bipolar"``.
        placement : str
            How electrodes were placed, such as ``"SENIAM"``.
        more : mapping, optional
            Further keys of ``emg.json``, such as ``Manufacturer``; they replace Pellucid's.

        Returns
        -------
        Path
            The BDF file.

        Raises
        ------
        RecordingError
            If a label has other characters, or a sample is missing (NaN).

        Notes
        -----
        Samples are stored with 24 bits over each channel's range. Where the duration is no multiple of 10 ms, zeros
        fill the last record; ``RecordingDuration`` says where the recording ends, and `from_bids` leaves the rest out.
        """
        for what, label in (("subject", subject), ("task", task)):
            if not (label.isascii() and label.isalnum()):
                raise RecordingError(f"RawEmg.to_bids: found the {what} {label!r}, expected letters and digits alone")
        if not np.isfinite(self.samples).all():
            raise RecordingError("RawEmg.to_bids: found missing samples (NaN), expected a number in every sample")
        root = Path(folder)
        place, stem = root / f"sub-{subject}" / "emg", f"sub-{subject}_task-{task}"
        place.mkdir(parents=True, exist_ok=True)
        description = root / "dataset_description.json"
        if not description.exists():
            text = {"Name": root.resolve().name, "BIDSVersion": BIDS_VERSION, "DatasetType": "raw"}
            write_text_atomically(description, json.dumps(text, indent=2) + "\n")
        sidecar = {
            "TaskName": task,
            "SamplingFrequency": self.rate,
            "PowerLineFrequency": NOT_KNOWN if self.mains is None else self.mains,
            "EMGChannelCount": len(self.muscles),
            "EMGReference": reference,
            "EMGPlacementScheme": "Other",
            "EMGPlacementSchemeDescription": placement,
            "RecordingDuration": len(self.samples) / self.rate,
            "RecordingType": "continuous",
            "SoftwareFilters": NOT_KNOWN,
            **(more or {}),
        }
        write_text_atomically(place / f"{stem}_emg.json", json.dumps(sidecar, indent=2) + "\n")
        table = io.StringIO()
        out = csv.writer(table, delimiter="\t", lineterminator="\n")
        out.writerow(("name", "type", "units", "target_muscle", "sampling_frequency", "status"))
        for label, muscle in zip(self._labels(), self.muscles, strict=True):
            out.writerow((label, "EMG", "uV", muscle, f"{self.rate:g}", "bad" if muscle in self.bad else "good"))
        write_text_atomically(place / f"{stem}_channels.tsv", table.getvalue())
        return write_bytes_atomically(place / f"{stem}_emg.bdf", self._bdf_bytes())

    def _labels(self) -> list[str]:
        """Return the channels' names in a BDF file, of at most `MAX_LABEL_LENGTH` characters each."""
        short = [muscle[:MAX_LABEL_LENGTH] for muscle in self.muscles]
        fit = len(set(short)) == len(short) and all(name.isascii() and name.strip() == name != "" for name in short)
        return short if fit else [f"EMG{i}" for i in range(1, len(short) + 1)]

    def _bdf_bytes(self) -> bytes:
        """Return the samples as the bytes of a BDF file, in microvolts."""
        import edfio

        whole = [t for t in RECORD_DURATIONS_S if _is_whole(self.rate * t)] or [1.0 / self.rate]
        n = len(self.samples)
        fits = [t for t in whole if _is_whole(n / round(self.rate * t))]
        record = fits[0] if fits else whole[-1]
        size = round(self.rate * record)
        padded = np.vstack([1e6 * self.samples, np.zeros((-n % size, len(self.muscles)))])
        signals = []
        for label, x in zip(self._labels(), padded.T, strict=True):
            top = float(np.ceil(max(np.abs(x).max(), 1.0)))  # The header has eight characters for a bound
            signals.append(
                edfio.BdfSignal(x, self.rate, label=label, physical_dimension="uV", physical_range=(-top, top))
            )
        into = io.BytesIO()
        edfio.Bdf(signals, data_record_duration=record).write(into)
        return into.getvalue()


def _is_whole(x: float) -> bool:
    """Return whether a number is a whole one of at least 1."""
    return round(x) >= 1 and abs(x - round(x)) < 1e-9


def _to_volts(path: Path, name: str, unit: str) -> float:
    """Return the factor from a channel's unit to V."""
    factor, _ = to_si_factor(unit, "V", f"{path.name}, channel {name}")
    return factor


def _muscle_names(channels: list[str], listed: list[dict[str, str]]) -> list[str]:
    """Return the muscle of each channel, or the channels' own names if two have the same or one has none."""
    muscles = channel_muscles(listed)
    names = [muscles[channel] for channel in channels if channel in muscles]
    return names if len(set(names)) == len(channels) else channels


def _read_sidecar(path: Path) -> dict[str, Any]:
    """Return all keys of a recording's ``emg.json``; those of nearer folders replace those of folders above."""
    made: dict[str, Any] = {}
    for file in reversed(sidecar_files(path, "_emg.json")):
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise RecordingError(f"{file.name}: not readable as JSON: {error}") from None
        if not isinstance(content, dict):
            raise RecordingError(f"{file.name}: found {type(content).__name__}, expected an object")
        made |= content
    return made
