"""Find what a recording's file says about who was recorded: names, birth dates, addresses, numbers of patients.

Such a field is reported by its label and its place. Its value is never kept, so that no page, study or message repeats
it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_STAFF_WORDS = (
    "operator", "examiner", "therapist", "physician", "doctor", "clinician", "experimenter", "tester", "untersucher",
    "arzt", "recorded by",
)  # fmt: skip
"""Labels of those who made a recording, folded."""

_WORDS_BY_KIND = {
    "birth date": (
        "birth date", "birthdate", "birthday", "date of birth", "dob", "born", "geburtsdatum", "geburtstag", "geboren",
        "geb", "date de naissance", "naissance", "fecha de nacimiento", "nacimiento", "data di nascita", "nascita",
        "data de nascimento", "nascimento", "geboortedatum", "birth year", "year of birth", "birth",
    ),
    "contact": (
        "address", "street", "zip code", "postcode", "postal code", "city of residence", "phone", "telephone", "mobile",
        "email", "e mail", "mail", "adresse", "anschrift", "strasse", "straße", "telefon", "telefono", "teléfono",
        "direccion", "dirección", "indirizzo", "endereço", "correo",
    ),
    "number of a person": (
        "patient id", "patient no", "patient nr", "patient number", "patientid", "patienten id", "patientennummer",
        "medical record number", "mrn", "ssn", "social security number", "insurance number", "versichertennummer",
        "passport", "national id", "fiscal code", "codice fiscale", "ahv", "nhs number", "case number",
    ),
    "name": (
        "first name", "last name", "surname", "given name", "family name", "full name", "forename", "firstname",
        "lastname", "middle name", "patient", "patient name", "patientname", "subject name", "subjectname",
        "participant name", "person name", "client name", "athlete name", "athlete", "proband name", "vorname",
        "nachname", "familienname", "nom", "nom de famille", "prénom", "prenom", "nombre", "apellido", "apellidos",
        "nome", "cognome", "sobrenome", "voornaam", "achternaam", "patientin", *_STAFF_WORDS,
    ),
}  # fmt: skip
"""Labels of fields that tell who a person is, by the kind of what they tell, folded as `_folded` does."""

_PERSON_WORDS = frozenset(
    {
        "patient", "patients", "subject", "participant", "person", "client", "athlete", "proband", "pilot", "wearer",
        "volunteer", "user", "operator", "examiner", "therapist", "physician", "doctor", "experimenter",
    }
)  # fmt: skip
"""Words that stand for a person. Beside the word "name" they make a label one of a person's name."""

_THING_WORDS = frozenset(
    {
        "file", "channel", "signal", "test", "trial", "column", "variable", "protocol", "device", "sensor", "muscle",
        "study", "project", "scope", "measurement", "recording", "session", "configuration", "view", "chart", "drive",
        "motor", "axis", "controller",
    }
)  # fmt: skip
"""Words that stand for a thing. Beside the word "name" they make a label one of a thing's name; a value with one under
the bare label "name" is no person's either."""

MAX_SEARCHED_CHARACTERS = 1000
"""Only this many characters of a line are searched for a label and its value."""

_BLANK_RUN = re.compile(r"\s{2,}")

_EMAIL_ADDRESS = re.compile(r"[\w.+-]+@[\w-]+\.[\w.-]+\w")

_PERSON_NAME = re.compile(r"[^\W\d_][^\W\d_'’-]+(?:[ ,]+[^\W\d_][^\W\d_.'’-]*)+\.?")
"""Two or more words of letters alone, as a person's name is written."""

_LABEL_AND_VALUE = re.compile(
    r"\s*[\"'#%/!\s]*([^:=;,\t\"]{1,60}?)\s*[\"']?\s*(?::|=|;|,|\t)\s*[\"']?\s*(.*?)\s*[\"']?\s*"
)


@dataclass(frozen=True)
class PersonalField:
    """A field of a file that tells who was recorded. Its value is not kept."""

    kind: str  # "name", "birth date", "contact" or "number of a person"
    label: str  # label of the field, as the file writes it
    place: str  # place of the field in the file, such as "line 4" or "column subject.name"

    @property
    def is_of_staff(self) -> bool:
        """Whether the label is that of somebody who made the recording, and not of whom was recorded."""
        folded = set(_folded(self.label).split())
        return any(set(words.split()) <= folded for words in _STAFF_WORDS)

    def __str__(self) -> str:
        return f'{self.place}, "{self.label}": {self.kind}'


def personal_kind(label: str, value: str = "") -> str | None:
    """Return the kind of what a labelled field tells about a person, None if it tells nothing of who that is.

    Age, sex, mass and height are no such fields: a study may state them without saying who it is.

    Parameters
    ----------
    label : str
        Label of the field, a column's name, or a dotted path such as ``"subject.name"``.
    value : str
        Text of the field. A bare label "name" tells a person's name only if the value looks like one.
    """
    parts = re.split(r"\.(?=\w)", label)
    folded, last = _folded(" ".join(parts[-2:])), _folded(parts[-1])
    for kind, words in _WORDS_BY_KIND.items():
        if (folded in words or last in words) and (kind != "name" or _may_be_name(value)):
            return kind
    words_of = set(folded.split())
    names_something = words_of & {"name", "names"} and not words_of & _THING_WORDS
    is_like_name = _PERSON_NAME.fullmatch(value.strip()) and not set(_folded(value).split()) & _THING_WORDS
    if names_something and (words_of & _PERSON_WORDS or is_like_name):
        return "name"
    if _EMAIL_ADDRESS.search(value[:MAX_SEARCHED_CHARACTERS]):
        return "contact"
    return None


def searched_part(line: str) -> str:
    """Return the beginning of a line with single blanks, in which patterns are searched in bounded time."""
    return _BLANK_RUN.sub(lambda match: "\t" if "\t" in match[0] else " ", line[:MAX_SEARCHED_CHARACTERS])


def find_personal_lines(lines: Iterable[str]) -> list[PersonalField]:
    """Return the personal fields among lines of text, each of a label and a value, as above a table of numbers."""
    found = []
    for number, whole in enumerate(lines, 1):
        line = searched_part(whole)
        match = _LABEL_AND_VALUE.fullmatch(line)
        label, value = (match[1], match[2]) if match else ("", line)
        kind = personal_kind(label, value)
        # A row of names of columns begins with a name, too; what follows it are no personal values.
        if kind is not None and value:
            found.append(PersonalField(kind, label.strip() or "a line", f"line {number}"))
    return found


def find_personal_columns(columns: Iterable[tuple[str, str]]) -> list[PersonalField]:
    """Return the personal fields among columns or entries of a structure, given as pairs of name and first text."""
    found = []
    for name, text in columns:
        kind = personal_kind(name, text)
        if kind is not None:
            found.append(PersonalField(kind, name, f"column {name}"))
    return found


def _folded(label: str) -> str:
    """Return a label in lower case, with blanks instead of all marks and between its words."""
    spaced = re.sub(r"(?<=[a-zà-ÿ])(?=[A-Z])", " ", label)
    return " ".join(re.sub(r"[\W_]+", " ", spaced).casefold().split())


def _may_be_name(value: str) -> bool:
    """Whether a value under a label such as "patient" may be a name: a code such as P07 names nobody."""
    text = value.strip()
    if not text:
        return True
    return re.fullmatch(r"[A-Za-z]{0,8}[ _-]?\d+[A-Za-z]?|\d[\d.,: /-]*", text) is None
