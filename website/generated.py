"""Reference pages that are made of the code: `python website/generated.py NAME` prints one in Markdown.

`python website/generated.py --out FOLDER` writes all of them. The site has each under the name of its file in `PAGES`;
nothing of them is kept in the repository.
"""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

import typer
from typer.core import TyperGroup

from pellucid.cli import app
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.session_state import SESSION_STATES
from pellucid.controllers.supervisor_faults import SUPERVISOR_FAULTS
from pellucid.files import readers
from pellucid.files.readers._unread_formats import UNREAD_FORMATS
from pellucid.live.setup import SESSION_TIMEOUT_S
from pellucid.models.fields import Field, model_fields
from pellucid.study.procedures.command import HELP_GROUPS
from pellucid.study.procedures.registry import study_model
from pellucid.study.study_fields import StudyTable
from pellucid.study.study_file import CHANNEL_UNITS, UNITS_BY_PART, json_schema
from pellucid_lab.ranking.transparency_indices import TRANSPARENCY_INDICES

MODELS = {
    "joint": "A joint",
    "presliding": "Friction below slip",
    "geared_joint": "A motor and a link behind a compliant transmission",
    "coupled_plant": "A series-elastic orthosis, its strap and the limb in it",
    "reaching": "A person who reaches",
    "postural": "A person who reaches and then holds",
    "optimal": "A person who reaches by optimal feedback",
    "link": "A link of a tree and its joint",
    "cuff": "A cuff between a robot's link and a limb's",
    "posture_servo": "Muscles that follow a motion, and their reflex",
    "muscle": "A muscle",
    "emg_channel": "A channel of EMG in the estimator of torque",
    "watched_channel": "Statistics of a channel in the calibration",
    "watched_angle": "Range of an angle in the calibration",
    "estimated_joint": "A joint of the estimator of torque",
    "short_range": "Short-range stiffness of a muscle",
    "strap_estimator": "Estimator of a worn strap",
    "tree_law_joint": "Each joint of a control law of several joints",
    "tree_law_whole": "Parameters shared by all joints of a control law",
    "tree_watch_joint": "Supervision of each joint",
    "tree_watch_whole": "Supervision of all joints together",
}
"""Models of the core that have tables of parameters, with their headings."""

TABLE_NAME = re.compile(r"``(\[.+?\])``")
"""Name of a table of study.toml, as the first sentence about it has it: `[rig.drive]`, `[[recordings]]`."""


ROTARY_UNITS = {"<coordinate>": "rad", "<motor>": "rad", "<reference>": "rad", "<velocity>": "rad/s",
                "<acceleration>": "rad/s^2", "<effort>": "N*m"}  # fmt: skip
"""Units of a rotary joint, by their marks in the table of channels."""

WORDS_OF_TYPES = {"string": "text", "integer": "whole number", "boolean": "`true` or `false`", "object": "table"}
"""Types of JSON, as a person calls them."""


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown, in whose cells a bar divides nothing."""
    heads = tuple(heads)
    lines = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *lines))


# Parameters ----------------------------------------------------------------------------------------------------------


def parameter_table(fields: Iterable[Field]) -> str:
    """Return the table of parameters of a model."""
    rows = ((f"`{f.name}`", f.unit(), f"{f.default:g}", f.range, f.sentence) for f in fields)
    return table(("name", "unit", "default", "range", "meaning"), rows)


def parameters() -> Iterator[str]:
    """Parameters of all models of the core, as its headers describe them."""
    yield "# Parameters of all models"
    yield (
        "Units are those of a rotary joint whose efforts are torques: on a slide N m, rad and kg m^2 are N, m and kg. "
        "A default of 0 must often be set."
    )
    for name, title in MODELS.items():
        yield f"## {title}\n\n{parameter_table(model_fields(name))}"
    yield f"## Safety gate of every control law\n\n{parameter_table(model_fields('gate'))}"
    supervisor = parameter_table(model_fields("supervisor"))
    yield f"## Supervisor of every control law\n\n{supervisor}"
    gate = {field.name for field in model_fields("gate")}
    for law in LAWS.values():
        reads = ", ".join(f"`{s.name}` [{s.unit()}]{'' if s.required else ' (optional)'}" for s in law.sensors)
        own = parameter_table(field for field in law.fields if field.name not in gate)
        title = f"## `{law.name}`: {_sentence(law.title)}"
        yield f"{title}\n\nSensors: {reads}. Further parameters are those of the safety gate.\n\n{own}"


# Commands ------------------------------------------------------------------------------------------------------------


def commands() -> Iterator[str]:
    """Every command with its arguments and options, in the order of `pellucid -h`."""
    yield "# Commands"
    yield (
        "`pellucid -h` lists the commands, and `pellucid COMMAND -h` prints the options of one. "
        "[Run without a display or notebook](../how-to/run-without-a-display-or-notebook.md) explains the exit status."
    )
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    context = group.context_class(group, info_name="pellucid")
    named = [(name, group.get_command(context, name)) for name in group.list_commands(context)]
    found = [(name, each) for name, each in named if each is not None and not each.hidden]
    place = {heading: i for i, heading in enumerate(HELP_GROUPS)}
    for name, command in sorted(found, key=lambda each: place.get(each[1].rich_help_panel, len(place))):
        yield from _command(f"pellucid {name}", command, context)


def _command(name: str, command: Any, parent: Any) -> Iterator[str]:
    """Yield a command, and those below it."""
    context = command.context_class(command, info_name=name.rpartition(" ")[2], parent=parent)
    epilog = (command.epilog or "").partition("\n")[0].removeprefix("Example: ")
    called = f"\n\n```sh\n{epilog}\n```" if epilog else ""
    options = [row for each in command.get_params(context) if (row := each.get_help_record(context))]
    listed = table(("option", "meaning"), ((f"`{first}`", second) for first, second in options))
    usage = " ".join((name, *command.collect_usage_pieces(context)))
    yield f"## `{name}`\n\n{_sentence(command.help or '')}\n\n`{usage}`{called}\n\n{listed}"
    if isinstance(command, TyperGroup):
        for inner in command.list_commands(context):
            yield from _command(f"{name} {inner}", command.get_command(context, inner), context)


# Keys of study.toml --------------------------------------------------------------------------------------------------


def keys() -> Iterator[str]:
    """Every table of study.toml with its keys, as the schema for editors has them."""
    yield "# study.toml"
    yield (
        "[Write a study.toml](../how-to/write-a-study-toml.md) has an example. A quantity is a text with its "
        'unit, such as `"100 Hz"`; defaults are shown in SI. A list or a table without a default is empty.'
    )
    schema = json_schema(study_model())
    tables = {table.__name__: table for table in _tables(StudyTable)}
    named = {name: _heading(tables[name]) for name in schema["$defs"]}
    several = {heading for heading, count in Counter(named.values()).items() if count > 1}
    headings = {
        name: f"{heading}: {_kind(tables[name])}" if heading in several else heading for name, heading in named.items()
    }
    yield f"## Top level\n\n{_key_table(schema, keys_of(study_model()), headings)}"
    for name, each in schema["$defs"].items():
        title, rest = _paragraphs(tables[name])
        yield "\n\n".join((f"## {headings[name]}", title, *rest, _key_table(each, keys_of(tables[name]), headings)))


def _tables(base: type[StudyTable]) -> Iterator[type[StudyTable]]:
    """Yield every class of tables below a class."""
    for table in base.__subclasses__():
        yield table
        yield from _tables(table)


def _paragraphs(table: type[StudyTable]) -> tuple[str, list[str]]:
    """Return what a table's docstring says before and after its keys: the first sentence, and other paragraphs."""
    before, _, section = inspect.cleandoc(table.__doc__ or "").partition("Attributes\n----------\n")
    first, *others = (*before.split("\n\n"), section.partition("\n\n")[2])
    words = (" ".join(each.split()).replace("``", "`") for each in (first, *others) if each.strip())
    return next(words), list(words)


def _heading(table: type[StudyTable]) -> str:
    """Return the name of a table as study.toml has it, if the first sentence about it says so; else its class."""
    found = TABLE_NAME.search((table.__doc__ or "").partition("\n")[0])
    return f"`{found[1]}`" if found else f"`{table.__name__}`"


def _kind(table: type[StudyTable]) -> str:
    """Return what a table is, of several with one name: what its first sentence says before the name."""
    words = _paragraphs(table)[0].partition(":")[0]
    return words[:1].lower() + words[1:]


def keys_of(table: type[StudyTable]) -> dict[str, str]:
    """Return what a table's docstring, and those of its bases, say of each key; else what the key's own table is."""
    inner = {name: found for name, field in table.model_fields.items() if (found := _inner_table(field.annotation))}
    said = {name: _paragraphs(each)[0] for name, each in inner.items()}
    for each in reversed(table.__mro__):
        said |= {name: words for name, words in described_keys(each.__dict__.get("__doc__") or "").items() if words}
    return said


def _inner_table(annotation: Any) -> type[StudyTable] | None:
    """Return the table that a key holds, if it holds one."""
    if isinstance(annotation, type) and issubclass(annotation, StudyTable):
        return annotation
    return next((found for each in get_args(annotation) if (found := _inner_table(each))), None)


def described_keys(text: str) -> dict[str, str]:
    """Return what the section "Attributes" of a class's docstring says of each key."""
    section = inspect.cleandoc(text).partition("Attributes\n----------\n")[2].partition("\n\n")[0]
    said = {}
    for entry in re.split(r"\n(?=\S)", section):
        first, _, rest = entry.partition("\n")
        words = " ".join(rest.split()).replace("``", "`")
        said |= dict.fromkeys((name.strip() for name in first.partition(" : ")[0].split(",")), words)
    return said


def _key_table(schema: Mapping[str, Any], said: Mapping[str, str], headings: Mapping[str, str]) -> str:
    required = schema.get("required", ())
    rows = (
        (f"`{key}`", _type(each, headings), "required" if key in required else _default(each), said.get(key, ""))
        for key, each in schema["properties"].items()
    )
    return table(("key", "type", "default", "meaning"), rows)


def _type(schema: Mapping[str, Any], headings: Mapping[str, str]) -> str:
    """Return the type of a key in words: "number and unit (Hz)", "list of text", "table [rig.drive]"."""
    if "$ref" in schema:
        return f"table {headings[schema['$ref'].rpartition('/')[2]]}"
    if several := schema.get("anyOf") or schema.get("oneOf"):
        kinds = (_type(each, headings) for each in several if each.get("type") != "null")
        return " or ".join(dict.fromkeys(kinds))
    if values := schema.get("enum") or ([schema["const"]] if "const" in schema else []):
        return " or ".join(f"`{json.dumps(each)}`" for each in values)
    if "description" in schema:
        return schema["description"].replace("<", "").replace(">", "")
    kind = schema.get("type", "any")
    if kind == "array":
        inner = schema.get("items") or next(iter(schema.get("prefixItems", ())), {})
        return f"list of {_type(inner, headings)}"
    if kind == "object" and isinstance(schema.get("additionalProperties"), Mapping):
        return f"table of {_type(schema['additionalProperties'], headings)}"
    return WORDS_OF_TYPES.get(kind, kind)


def _default(schema: Mapping[str, Any]) -> str:
    value = schema.get("default")
    return "" if value in (None, "", [], {}) or isinstance(value, dict) else f"`{json.dumps(value)}`"


# Files and channels --------------------------------------------------------------------------------------------------


def files() -> Iterator[str]:
    """File formats with the names of their columns, channels with their units, and defects that are excluded."""
    yield "# Files, channels and excluded samples"
    yield "## File formats\n\nA reader names the columns of a file; `column` in study.toml refers to these names."
    yield table(("endings", "contents", "names of columns"), map(_format_row, reader_modules()))
    rows = ((f"`{ending}`", f"{what[:1].upper()}{what[1:]}", do) for ending, (what, do) in UNREAD_FORMATS.items())
    yield "## Files that are not read\n\n" + table(("ending", "contents", "export instead"), rows)
    yield (
        "## Channels\n\nA channel with one of these names must have a unit of this dimension; any other name may have "
        "any unit. On a slide rad and N m are m and N. If a machine has several joints, the channels of a joint end in "
        "its name: `position.elbow`."
    )
    yield table(("channel", "unit"), channel_rows())


def reader_modules() -> list[ModuleType]:
    """Return the readers that come with Pellucid, in the order of their endings."""
    names = [each.name for each in pkgutil.iter_modules(readers.__path__) if not each.name.startswith("_")]
    modules = (importlib.import_module(f"{readers.__name__}.{name}") for name in names)
    return sorted((each for each in modules if hasattr(each, "ENDINGS")), key=lambda each: each.ENDINGS)


def _format_row(reader: ModuleType) -> tuple[str, str, str]:
    first, *others = inspect.cleandoc(reader.__doc__ or "").split("\n\n")
    words = " ".join(" ".join(others[:1]).split()).replace("``", "`")
    contents = " ".join(first.split()).replace("``", "`").removeprefix("Read ").rstrip(".")
    return ", ".join(f"`{ending}`" for ending in reader.ENDINGS), _sentence(contents), words


def channel_rows() -> Iterator[tuple[str, str]]:
    """Yield each channel that study.toml knows by its name, and its SI unit on a rotary joint."""
    yield from ((f"`{name}`", ROTARY_UNITS.get(unit, unit)) for name, unit in CHANNEL_UNITS.items())
    yield from ((f"`{name}.<name>`", unit) for name, unit in UNITS_BY_PART.items())
    yield "`emg.<muscle>`", "V, or 1 for a relative envelope"


# Faults and indices --------------------------------------------------------------------------------------------------


def faults() -> Iterator[str]:
    """Faults of the supervisor: when each is found, what it then does, and what to do."""
    yield "# Faults of the supervisor"
    yield "A stopped controller and its log name one of these."
    yield "[The validation](../validation/supervisor.md) has detection rates and times."
    rows = (
        (
            ", ".join(f"`{name}`" for name in fault.names),
            _sentence(fault.when.format(sample="a required sample is", max_repeats="`max_repeats`")),
            fault.response,
            fault.advice,
        )
        for fault in SUPERVISOR_FAULTS
    )
    yield table(("fault", "detected when", "response", "what to do"), rows)


def states() -> Iterator[str]:
    """States of a live session, and the changes between them."""
    yield "# States of a live session"
    yield (
        "The engine holds one of these states. An operator arms and disarms; a reset needs the token of the stop. "
        f"A session without a sign of life for {SESSION_TIMEOUT_S:g} s loses its power."
    )
    rows = (
        (f"`{state.name}`", _sentence(state.words), "yes" if state.in_force else "no",
         "yes" if state.needs_reset else "no", ", ".join(f"`{name}`" for name in state.next if name != state.name))
        for state in SESSION_STATES
    )  # fmt: skip
    yield table(("state", "words on the page", "controller in force", "needs a reset", "next states"), rows)


def indices() -> Iterator[str]:
    """Definitions of the indices of transparency that `pellucid rank` computes."""
    yield "# Definitions of the indices"
    yield "[Indices of transparency](../transparency-indices.md) shows how far they agree, and which one to choose."
    rows = ((f"`{i.name}`", i.kind, _sentence(i.words), i.unit, i.source) for i in TRANSPARENCY_INDICES)
    yield table(("index", "kind", "what it is", "unit", "source"), rows)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


PAGES: Mapping[str, tuple[str, Callable[[], Iterator[str]]]] = {
    "commands": ("reference/commands.md", commands),
    "keys": ("reference/study-toml.md", keys),
    "files": ("reference/files.md", files),
    "parameters": ("reference/parameters.md", parameters),
    "faults": ("reference/faults.md", faults),
    "states": ("reference/session-states.md", states),
    "indices": ("reference/index-definitions.md", indices),
}
"""Pages by the name that prints them: the file on the site, and the function that makes their parts."""


@cache
def page(name: str) -> str:
    """Return a page in Markdown."""
    return "\n\n".join(PAGES[name][1]()) + "\n"


def write_pages(folder: Path) -> None:
    """Write every page into a folder, under the last part of its name on the site."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (file, _) in PAGES.items():
        (folder / Path(file).name).write_text(page(name), encoding="utf-8")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--out", folder]:
            write_pages(Path(folder))
        case [name] if name in PAGES:
            sys.stdout.write(page(name))
        case _:
            sys.exit(f"usage: python website/generated.py {'|'.join(PAGES)}, or --out FOLDER")
