"""Fields that tell who was recorded are found by their labels, and their values are repeated nowhere."""

import pytest

from pellucid.files.personal_fields import find_personal_columns, find_personal_lines, personal_kind


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        ("Patient Name: Jane Q. Doe", "name"),
        ("Last name\tDoe", "name"),
        ("Name: Doe, Jane", "name"),
        ('"Nachname";"Muster"', "name"),
        ("# Subject name = Jane Doe", "name"),
        ("Patient: Doe, Jane", "name"),
        ("DateOfBirth,1970-01-02", "birth date"),
        ("Geburtsdatum: 02.01.1970", "birth date"),
        ("Recorded by: jane@example.org", "name"),
        ("remark: ask jane@example.org", "contact"),
        ("MRN: 0012345", "number of a person"),
    ],
)
def test_a_field_about_a_person_is_found_by_its_label(line, kind):
    (found,) = find_personal_lines(["Sampling rate: 1000 Hz", line])
    assert (found.kind, found.place) == (kind, "line 2")
    value = line.replace('"', "").replace(";", ":").replace("\t", ":").replace(",", ":", 1).partition(":")[2].strip()
    assert not value or value not in str(found)


@pytest.mark.parametrize(
    "line",
    [
        "File Name: 8Nsen.log",
        "Name: left_knee_07.csv",
        "Channel name: Vastus Lateralis",
        "Patient: P07",
        "Subject: S01",
        "Age: 31",
        "mass [kg]: 68",
        "time,position,current",
        "0.1\t0.2\t0.3",
        "Time (in s);X screen corrected (mm)",
        "Channel 1: 'RF', 24161 values, engineering units: mV, no filters.",
        "Force produced by a maximally-activated rat soleus muscle in vivo when subjected",
        "Published: J. Biomech, 30(1), 27-33",
    ],
)
def test_a_field_that_tells_nobody_is_left_alone(line):
    assert find_personal_lines([line]) == []


def test_fields_of_structures_and_columns_are_found_by_their_path():
    columns = [("trial.subject.name", "Jane Doe"), ("trial.q", ""), ("birthDate", ""), ("emg1", "")]
    found = find_personal_columns(columns)
    assert [(each.kind, each.label) for each in found] == [("name", "trial.subject.name"), ("birth date", "birthDate")]
    assert personal_kind("trial.subject.age") is None
