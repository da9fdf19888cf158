"""Pages of the site that are made of the code: `python website/generated.py NAME` prints one in Markdown.

The site has each under the name of its file in `PAGES`; nothing of them is kept in the repository.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import typer
from typer.core import TyperGroup

from pellucid.cli import app
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.session_state import SESSION_STATES
from pellucid.controllers.supervisor_faults import SUPERVISOR_FAULTS
from pellucid.live.setup import SESSION_TIMEOUT_S
from pellucid.models.fields import Field, model_fields
from pellucid.study.procedures.command import HELP_GROUPS
from pellucid.study.procedures.registry import study_model
from pellucid.study.study_file import json_schema
from pellucid_lab.ranking.transparency_indices import TRANSPARENCY_INDICES

MODELS = {
    "joint": "A joint, as identification finds it",
    "presliding": "Friction below slip",
    "geared_joint": "A motor and a link behind a compliant transmission",
    "coupled_plant": "A series-elastic orthosis, its strap and the limb in it",
    "reaching": "A person who reaches",
    "postural": "A person who reaches and then holds",
    "optimal": "A person who reaches by optimal feedback",
    "link": "A link of a tree, and the joint by which it hangs",
    "cuff": "A cuff between a robot's link and a limb's",
    "posture_servo": "Muscles that follow a motion, and their reflex",
    "muscle": "A muscle from its EMG envelope on",
    "emg_channel": "A channel of EMG of the estimator of torque",
    "watched_channel": "A channel as it was in the calibration",
    "watched_angle": "Range of an angle in the calibration",
    "estimated_joint": "A joint that it gives a torque of, beside its muscles",
    "short_range": "Stiffness of a muscle at once",
    "strap_estimator": "A strap learnt while it is worn",
    "tree_law_joint": "What a law of several joints does at each",
    "tree_law_whole": "Parameters shared by all joints of a law of several joints",
    "tree_watch_joint": "What its supervisor watches of each joint",
    "tree_watch_whole": "What its supervisor watches of all joints together",
}
"""Models of the core that have tables of parameters, with their headings."""

TABLE_NAME = re.compile(r"``(\[.+?\])``")
"""Name of a table of study.toml, as the first sentence about it has it: `[rig.drive]`, `[[recordings]]`."""


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
    return table(("name", "unit", "default", "range", ""), rows)


def parameters() -> Iterator[str]:
    """Parameters of all models of the core, as its headers describe them."""
    yield "# Parameters of all models"
    yield (
        "Units are those of a rotary joint whose efforts are torques: on a slide N m, rad and kg m^2 are N, m and kg. "
        "A default of 0 must often be set."
    )
    for name, title in MODELS.items():
        yield f"## {title}\n\n{parameter_table(model_fields(name))}"
    yield f"## The safety gate, with which every law ends\n\n{parameter_table(model_fields('gate'))}"
    supervisor = parameter_table(model_fields("supervisor"))
    yield f"## The supervisor, which the lab and exports put around every law\n\n{supervisor}"
    gate = {field.name for field in model_fields("gate")}
    for law in LAWS.values():
        reads = ", ".join(f"`{s.name}` [{s.unit()}]{'' if s.required else ' (optional)'}" for s in law.sensors)
        own = parameter_table(field for field in law.fields if field.name not in gate)
        yield f"## `{law.name}`: {_sentence(law.title)}\n\nReads {reads}. Then the gate's.\n\n{own}"


# Commands ------------------------------------------------------------------------------------------------------------


def commands() -> Iterator[str]:
    """Every command with its arguments and options, in the order of `pellucid -h`."""
    yield "# Every command and its options"
    yield "The guide to [commands](commands.md) explains them. `pellucid COMMAND -h` prints the same for one command."
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
    listed = table(("option", ""), ((f"`{first}`", second) for first, second in options))
    usage = " ".join((name, *command.collect_usage_pieces(context)))
    yield f"## `{name}`\n\n{_sentence(command.help or '')}\n\n`{usage}`{called}\n\n{listed}"
    if isinstance(command, TyperGroup):
        for inner in command.list_commands(context):
            yield from _command(f"{name} {inner}", command.get_command(context, inner), context)


# Keys of study.toml --------------------------------------------------------------------------------------------------


def keys() -> Iterator[str]:
    """Every table of study.toml with its keys, as the schema for editors has them."""
    yield "# Every key of study.toml"
    yield (
        "The guide to [study.toml](study-file.md) explains them, with examples. Defaults of quantities are in SI. "
        "A list or a table without a default is empty."
    )
    schema = json_schema(study_model())
    described = {name: each.get("description", "") for name, each in schema["$defs"].items()}
    headings = {name: _heading(name, text.partition("\n")[0]) for name, text in described.items()}
    yield f"## At the top\n\n{_key_table(schema, described_keys(study_model().__doc__ or ''), headings)}"
    for name, each in schema["$defs"].items():
        title = described[name].partition("\n")[0].replace("``", "`")
        yield f"## {headings[name]}\n\n{title}\n\n{_key_table(each, described_keys(described[name]), headings)}"


def _heading(name: str, title: str) -> str:
    """Return the name of a table as study.toml has it, if the first sentence about it says so; else its class."""
    found = TABLE_NAME.search(title)
    return f"`{found[1]}`" if found else f"`{name}`"


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
    return table(("key", "type", "default", ""), rows)


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


# Faults and indices --------------------------------------------------------------------------------------------------


def faults() -> Iterator[str]:
    """Faults of the supervisor: when each is found, what it then does, and what to do."""
    yield "# Faults of the supervisor"
    yield "A stopped controller and its log name one of these."
    yield "[The validation](validation/supervisor.md) has detection rates and times."
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
    yield "[Indices of transparency](transparency-indices.md) shows how far they agree, and which one to choose."
    rows = ((f"`{i.name}`", i.kind, _sentence(i.words), i.unit, i.source) for i in TRANSPARENCY_INDICES)
    yield table(("index", "kind", "what it is", "unit", "source"), rows)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


PAGES: Mapping[str, tuple[str, Callable[[], Iterator[str]]]] = {
    "parameters": ("parameters.md", parameters),
    "commands": ("every-command.md", commands),
    "keys": ("every-key.md", keys),
    "faults": ("faults.md", faults),
    "states": ("session-states.md", states),
    "indices": ("index-definitions.md", indices),
}
"""Pages by the name that prints them: the file on the site, and the function that makes their parts."""


def page(name: str) -> str:
    """Return a page in Markdown."""
    return "\n\n".join(PAGES[name][1]()) + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in PAGES:
        sys.exit(f"usage: python website/generated.py {'|'.join(PAGES)}")
    sys.stdout.write(page(sys.argv[1]))
