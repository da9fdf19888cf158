"""`propose`: arrays, data frames and files give one proposal, and the study that `init` writes."""

import builtins
import re
from pathlib import Path

import made_layouts
import numpy as np
import pytest

import pellucid as pl
from pellucid.start.given_columns import columns_of_arrays
from pellucid.start.inference.processing_choice import PROCESSING_LIMITS, choose_processing
from pellucid.start.log_proposal import LogProposal
from pellucid.start.proposal_page import spectrum_figure

UNITS = {"q": "rad", "tau": "N*m"}


def swung(n=3000, fs=200.0):
    made = made_layouts.swing(5, n=n, fs=fs)
    return {"t": made["t"], "q": made["q"], "tau": made["tau"]}


def lines(study):
    """Return the lines of study.toml that have a meaning, without comments."""
    text = (study.folder / "study.toml").read_text()
    return [re.sub(r"  # .*", "", line) for line in text.splitlines() if line and not line.startswith("#")]


def test_arrays_give_what_their_file_gives(tmp_path):
    columns = swung()
    path = tmp_path / "data.csv"
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header="t,q,tau", comments="", fmt="%.17g")
    of_arrays, of_file = pl.propose(columns), pl.propose(path)
    assert of_arrays.roles == of_file.roles
    assert of_arrays.clock == of_file.clock
    assert of_arrays.clock.rate == pytest.approx(200.0)
    studies = [proposal.study(tmp_path / name / "s") for proposal, name in ((of_arrays, "a"), (of_file, "f"))]
    assert lines(studies[0]) == lines(studies[1])
    pl.init(tmp_path / "i" / "s", files=[path])
    assert lines(pl.open(tmp_path / "i" / "s")) == lines(studies[1])
    (first, _) = studies[0].recordings()
    assert np.array_equal(first["position"], columns["q"][: len(first)])
    assert (studies[0].folder / "proposal" / "index.html").is_file()


def test_a_data_frame_a_mapping_and_a_structured_array_are_alike(tmp_path):
    pandas = pytest.importorskip("pandas")
    columns = swung(800)
    structured = np.empty(800, [(name, float) for name in columns])
    for name, x in columns.items():
        structured[name] = x
    found = [pl.propose(data, units=UNITS) for data in (columns, pandas.DataFrame(columns), structured)]
    assert found[0].roles == found[1].roles == found[2].roles
    frame = found[0].to_frame()
    assert list(frame.columns) == ["column", "role", "unit", "certain", "reason"]
    assert list(frame["column"]) == ["t", "q", "tau"]
    assert list(frame["role"]) == ["time", "position", "torque"]
    assert found[0].units == {"t": "s", "q": "rad", "tau": "N*m"}


def test_the_table_is_printed_and_shown(tmp_path):
    proposal = pl.propose(swung(800), units=UNITS)
    assert isinstance(proposal, LogProposal)
    text = repr(proposal)
    assert "Proposal for 2 columns at 200 Hz" in text
    assert re.search(r"^q +position +rad +yes +", text, re.MULTILINE)
    assert "question worn: " in text
    assert "Default: no." in text
    assert "<table>" in proposal._repr_html_()
    assert proposal["tau"].role == "torque"
    assert len(proposal) == len(list(proposal)) == 2
    assert proposal.reasons.keys() == {"t", "q", "tau"}
    with pytest.raises(KeyError, match="found here: q, tau"):
        proposal["gone"]


def test_a_stated_unit_and_a_rate_bind(tmp_path):
    columns = swung()
    del columns["t"]
    columns["q"] = np.degrees(columns["q"])
    proposal = pl.propose(columns, units={"q": "deg", "tau": "Nm"}, rate="200 Hz")
    assert (proposal.clock.column, proposal.clock.rate) == (None, 200.0)
    assert (proposal["q"].unit, proposal["tau"].unit) == ("deg", "N*m")
    study = proposal.study(tmp_path / "s")
    (first, _) = study.recordings()
    assert np.degrees(first["position"]) == pytest.approx(columns["q"][: len(first)])
    fit = pl.identify(study, families=["symmetric"], thorough=False)
    assert fit["gravity"].value == pytest.approx(1.6, rel=0.05)


def test_masked_samples_are_missing(tmp_path):
    columns = swung()
    columns["tau"] = np.ma.array(columns["tau"], mask=False)
    columns["tau"].mask[100:110] = True
    columns["tau"].data[100:110] = 1e6
    study = pl.propose(columns, units=UNITS).study(tmp_path / "s")
    (first, _) = study.recordings()
    assert not (np.abs(first["torque"]) > 100.0).any()


@pytest.mark.parametrize("kind", ["column", "index", "zoned"])
def test_stamps_of_datetime64_are_time(tmp_path, kind):
    columns = swung(800)
    stamps = np.datetime64("2026-05-03T14:10:00") + (1e9 * columns.pop("t")).round().astype("timedelta64[ns]")
    if kind == "column":
        data = {"stamp": stamps, **columns}
    else:
        pandas = pytest.importorskip("pandas")
        index = pandas.DatetimeIndex(stamps, name="stamp")
        index = index.tz_localize("Europe/Berlin") if kind == "zoned" else index
        data = pandas.DataFrame(columns, index=index)
    proposal = pl.propose(data, units=UNITS)
    assert (proposal.clock.column, proposal.clock.unit) == ("stamp", "s")
    assert proposal.clock.rate == pytest.approx(200.0)
    study = proposal.study(tmp_path / "s")
    (first, _) = study.recordings()
    assert first.time[1] - first.time[0] == pytest.approx(0.005)


def test_missing_and_mixed_values_of_objects():
    import datetime

    made = columns_of_arrays(
        {
            "a": np.array([1, None, 3.5, np.nan], object),
            "b": ["x", "y", "z", "z"],
            "c": [datetime.datetime(2026, 1, 1, 0, 0, k) for k in range(4)],
            "d": np.array(["2026-01-01", "NaT", "2026-01-02", "2026-01-02"], "datetime64[D]"),
            "e": np.array([[1, 2], [3, 4], [5, 6], [7, 8]]),
            "f": np.array([1, 2, 3, 4], "timedelta64[ms]"),
            "g": [True, False, True, True],
        },
        "data",
        "propose",
    )
    assert made.path.name == "data.csv"
    assert np.array_equal(made["a"], [1.0, np.nan, 3.5, np.nan], equal_nan=True)
    assert 'found text, such as "x"' in made.values["b"]
    assert np.array_equal(made["c"], [0, 1, 2, 3])
    assert np.array_equal(made["d"], [0, np.nan, 86400, 86400], equal_nan=True)
    assert made["f"] == pytest.approx([1e-3, 2e-3, 3e-3, 4e-3])
    assert np.array_equal(made["e.1"], [2, 4, 6, 8])
    assert np.array_equal(made["g"], [1, 0, 1, 1])
    assert made.units == {"c": "s", "d": "s", "f": "s"}


def test_strange_names_and_two_lengths_are_written_as_they_are(tmp_path):
    columns = swung()
    made = {'t, "s"': columns["t"], "q": columns["q"], "tau #1": columns["tau"]}
    study = pl.propose(made, units={"q": "rad", "tau #1": "N*m", 't, "s"': "s"}).study(tmp_path / "s")
    assert len(study.recordings()[0]["position"]) > 1000
    uneven = {**columns, "gain": np.ones(40)}
    study = pl.propose(uneven, units=UNITS).study(tmp_path / "u")
    assert [path.name for path in (study.folder / "recordings").iterdir()] == ["data.npz"]
    assert len(study.recordings()[0]["position"]) > 1000


def test_several_tables_are_several_recordings(tmp_path):
    parts = []
    for seed in (5, 6, 7, 8):
        made = made_layouts.swing(seed)
        parts.append({"t": made["t"], "q": made["q"], "tau": made["tau"]})
    study = pl.propose(parts, units=UNITS).study(tmp_path / "s")
    assert [r.use for r in study.recordings()].count("fit") == 3


ARGUMENTS = {
    "data": ((7,), {}, "propose: data: found int, expected a data frame"),
    "nothing": (([],), {}, "propose: data: found list, expected"),
    "mixed": ((["log.csv", {"a": [1.0]}],), {}, "propose: data: found str, expected"),
    "plain array": ((np.zeros((50, 3)),), {}, "propose: data: found ndarray, expected"),
    "short": (({"a": [1.0, 2.0]},), {}, "propose: data: found no column with at least 8 numbers"),
    "complex": (({"a": 1j * np.arange(50)},), {}, 'propose: data: column "a": found complex128'),
    "cube": (({"a": np.zeros((9, 9, 9))},), {}, 'propose: data: column "a": found an array of shape'),
    "units": ((swung(800),), {"units": ["rad"]}, "propose: units: found list, expected a mapping"),
    "unit": ((swung(800),), {"units": {"q": 1}}, "propose: units: found 'q': 1, expected a mapping of str to str"),
    "unknown unit": ((swung(800),), {"units": {"q": "degg"}}, 'units: column "q": found the unknown unit "degg"'),
    "unknown column": ((swung(800),), {"units": {"p": "deg"}}, "units: found the column 'p', expected one of q, t"),
    "rate": ((swung(800),), {"rate": "fast"}, "propose: rate: found 'fast', expected a sampling rate in Hz"),
    "no rate": ((swung(800),), {"rate": -1.0}, "propose: rate: found -1.0, expected a sampling rate"),
    "other rate": ((swung(800),), {"rate": 100}, 'found 100 Hz, but the column "t" gives 200 Hz, expected'),
    "answers": ((swung(800),), {"answers": "worn"}, "propose: answers: found str, expected a mapping"),
    "urdf": ((swung(800),), {"urdf": 3}, "propose: urdf: found int, expected a path"),
}


@pytest.mark.parametrize("case", ARGUMENTS)
def test_a_wrong_argument_is_named(case):
    given, options, expected = ARGUMENTS[case]
    with pytest.raises(pl.PellucidError, match=re.escape(expected)):
        pl.propose(*given, **options)


def test_columns_of_one_name_are_named():
    pandas = pytest.importorskip("pandas")
    with pytest.raises(pl.PellucidError, match='data: column "a": found two columns of this name'):
        pl.propose(pandas.DataFrame(np.zeros((50, 2)), columns=["a", "a"]))


def test_without_pandas_a_frame_says_what_to_install(monkeypatch):
    proposal = pl.propose(swung(800), units=UNITS)
    whole = builtins.__import__

    def lacking(name, *rest, **more):
        if name.partition(".")[0] == "pandas":
            raise ModuleNotFoundError(name="pandas")
        return whole(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", lacking)
    with pytest.raises(pl.PellucidError, match="found no package pandas"):
        proposal.to_frame()


def test_a_study_that_cannot_be_made_names_a_page(tmp_path):
    proposal = pl.propose({"t": swung()["t"], "q": swung()["q"]})
    with pytest.raises(pl.PellucidError, match="no effort was recorded") as raised:
        proposal.study(tmp_path / "s")
    assert not (tmp_path / "s").exists()
    *questions, note = raised.value.__notes__
    assert all(line.startswith("question ") for line in questions)
    page = note.removeprefix("What was understood: ")
    assert "No effort was recorded" in Path(page).read_text(encoding="utf-8")


def test_the_low_pass_its_remark_and_its_picture_agree():
    """The line stood at 8.8 Hz, the minimum of the picture near 20 Hz, and the remark said that both were one."""
    rate = 500.0
    time = np.arange(20_000) / rate
    rng = np.random.default_rng(3)
    moved = 0.5 * np.sin(2.0 * np.pi * 0.8 * time) + sum(
        0.02 / f**2 * np.sin(2.0 * np.pi * f * time + f) for f in np.arange(1.0, 20.0, 0.5)
    )
    choice = choose_processing(moved + 1e-5 * rng.standard_normal(time.size), rate)
    level = PROCESSING_LIMITS.floor_margin * choice.smoothed_power[choice.floor]
    at = int(np.flatnonzero(choice.frequency == choice.cut)[0])
    assert choice.smoothed_power[choice.floor] == choice.smoothed_power[at:].min()
    assert choice.smoothed_power[at - 1] > level >= choice.smoothed_power[at : choice.floor + 1].max()
    assert choice.frequency[choice.floor] > 1.2 * choice.cut
    drawn = spectrum_figure(choice, rate, "spectrum")
    (axis,) = drawn.figure.axes
    lines = [line.get_xdata()[0] for line in axis.lines if len(set(line.get_xdata())) == 1]
    assert choice.lowpass in lines
    assert level in [line.get_ydata()[0] for line in axis.lines if len(set(line.get_ydata())) == 1]
    assert f"at {choice.frequency[choice.floor]:.3g} Hz. From {choice.cut:.3g} Hz" in drawn.caption
    assert choice.why in drawn.caption
    assert f"4 times its noise floor at {choice.cut:.3g} Hz" in choice.why
