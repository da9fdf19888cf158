"""Commas and full stops in numbers: decided for a file, or the column is refused with both readings."""

import pytest

import pellucid as pl
from pellucid.files.file_facts import find_drive_facts, find_rate


def written(folder, text, name="log.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def table(fields, delimiter=";", head=("t", "tau")):
    return "\n".join([delimiter.join(head), *(delimiter.join(row) for row in fields)]) + "\n"


@pytest.mark.parametrize("rows", [12, 60_000])
def test_a_comma_between_thousands_is_none_beside_decimal_points(tmp_path, rows):
    fields = [(f"{i / 100:.2f}", f'"{900 + i % 400:,}"') for i in range(rows)]
    found = pl.read(written(tmp_path, table(fields, ",")))
    assert found["tau"].tolist() == [900 + i % 400 for i in range(rows)]


@pytest.mark.parametrize("rows", [12, 60_000])
def test_a_decimal_comma_in_one_column_decides_for_the_file(tmp_path, rows):
    fields = [(f"{i / 1000:.3f}".replace(".", ","), f"{1 + (i % 5) / 1000:.3f}".replace(".", ",")) for i in range(rows)]
    found = pl.read(written(tmp_path, table(fields)))
    assert found["tau"].tolist() == pytest.approx([1 + (i % 5) / 1000 for i in range(rows)])


@pytest.mark.parametrize("rows", [200, 60_000])
@pytest.mark.parametrize("delimiter", [",", ";"])
def test_a_column_with_two_readings_is_refused_with_both(tmp_path, rows, delimiter):
    quote = '"' if delimiter == "," else ""
    torques = [(998, 1012, 1019)[i % 3] for i in range(rows)]
    fields = [(f"{i + 200}", f"{quote}{x:,}{quote}" if x > 999 else f"{x}") for i, x in enumerate(torques)]
    path = written(tmp_path, table(fields, delimiter))
    found = pl.read(path)
    assert len(found["t"]) == rows
    with pytest.raises(pl.PellucidError, match=r'a comma with two readings: "1,\d+" is 1\.\d+ .* and 1\d+ '):
        found["tau"]
    with pytest.raises(pl.PellucidError, match=r'log\.csv: column "tau": line \d+ holds a comma with two readings'):
        pl.init(tmp_path / "study", files=[path])


@pytest.mark.parametrize("rows", [1200, 40_000])
@pytest.mark.parametrize(("mark", "quote", "delimiter"), [(".", "", ";"), (".", "", "\t"), (",", '"', ",")])
def test_whole_numbers_beside_kept_zeros_show_a_mark_between_thousands(tmp_path, rows, mark, quote, delimiter):
    """998 beside 1.010 is 1010: with a decimal mark, 998 would have three decimals, too."""
    numbers = [(5 * i, -3 * i if i % 20 else None) for i in range(rows)]
    texts = [["" if x is None else quote + f"{x:,}".replace(",", mark) + quote for x in row] for row in numbers]
    found = pl.read(written(tmp_path, table(texts, delimiter)))
    assert found["t"].tolist() == [t for t, _ in numbers]
    assert found["tau"].tolist() == pytest.approx([float("nan") if x is None else x for _, x in numbers], nan_ok=True)


@pytest.mark.parametrize("rows", [300, 60_000])
def test_decimals_of_one_length_keep_their_point(tmp_path, rows):
    """A column of three decimals each, beside a counter and beside one with smaller numbers."""
    fields = [(f"{i % 900}", f"{24 + i % 99 / 1000:.3f}") for i in range(rows)]
    assert max(pl.read(written(tmp_path, table(fields)))["tau"]) == 24.098
    fields = [(f"{i / 200:.3f}", "998" if i % 7 else "1.010") for i in range(rows)]
    assert min(pl.read(written(tmp_path, table(fields)))["tau"]) == 1.01


def test_points_with_two_readings_are_refused_with_both(tmp_path):
    fields = [(f"{i}", "1.012" if i % 2 else "998") for i in range(300)]
    with pytest.raises(pl.PellucidError, match=r'a full stop with two readings: "1\.012" is 1\.012 .* and 1012 with'):
        pl.read(written(tmp_path, table(fields)))["tau"]


@pytest.mark.parametrize("blank", ["'", "\u2019", "\u00a0", "\u202f", " "])
def test_apostrophes_and_blanks_stand_between_thousands(tmp_path, blank):
    texts = [[f"{x:,.2f}".replace(",", blank) for x in (995.0 * i, -1250.5 * i)] for i in range(40)]
    commas = [[text.replace(".", ",") for text in row] for row in texts]
    for fields in (texts, commas):
        assert pl.read(written(tmp_path, table(fields)))["tau"].tolist() == [-1250.5 * i for i in range(40)]


def test_a_file_without_numbers_is_refused_with_what_stands_in_it(tmp_path):
    path = written(tmp_path, table([("5", "6"), *[("1~000", "2~000")] * 20]))
    with pytest.raises(pl.PellucidError, match=r'1 file: log\.csv: found no numeric column; column "t": .*"1~000"'):
        pl.init(tmp_path / "study", files=[path])


def test_a_column_with_both_marks_is_refused(tmp_path):
    fields = [(f"{i}", "1,5" if i % 2 else "0.7") for i in range(12)]
    with pytest.raises(pl.PellucidError, match=r'"1,5" has a decimal comma and "0\.7" a decimal point'):
        pl.read(written(tmp_path, table(fields)))["tau"]


def test_full_stops_stand_between_thousands_beside_decimal_commas(tmp_path):
    fields = [(f"1.{i:03d},25", f"-12.{i:03d}") for i in range(12)]
    found = pl.read(written(tmp_path, table(fields)))
    assert found["t"].tolist() == [1000.25 + i for i in range(12)]
    assert found["tau"].tolist() == [-12000.0 - i for i in range(12)]


@pytest.mark.parametrize(
    ("text", "value"), [("1,234,567", 1234567.0), ("1,234.5", 1234.5), ("1234,5", 1234.5), (",5", 0.5)]
)
def test_a_number_that_has_one_reading_has_it(tmp_path, text, value):
    assert pl.read(written(tmp_path, table([(f"{i}", text) for i in range(9)])))["tau"][0] == value


def test_a_setting_whose_comma_has_two_readings_is_not_used():
    assert find_rate({"Sampling rate": "1,000 Hz"}) is None
    assert find_rate({"Sampling rate": "1,5 kHz"}).value == 1500.0
    assert find_drive_facts({"supply voltage": "24,000"}) == {}
    assert find_drive_facts({"supply voltage": "24 foo"}) == {}
