"""Pages that are made of the code: each is made, and names everything that there is of its kind."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from pellucid import _core
from pellucid.cli import app
from pellucid.controllers.control_law import LAWS
from pellucid.models.fields import model_fields
from pellucid.study.procedures.registry import study_model
from pellucid.study.study_file import json_schema
from pellucid_lab.ranking.transparency_indices import TRANSPARENCY_INDICES

ROOT = Path(__file__).parents[2]
WRITER = ROOT / "website" / "generated.py"
MADE = runpy.run_path(str(WRITER))


def names_of(kind: str) -> set[str]:
    """Return the names that a page has to have in its first columns and headings."""
    if kind == "parameters":
        fields = [*model_fields("gate"), *model_fields("supervisor"), *(f for law in LAWS.values() for f in law.fields)]
        return {*LAWS, *(field.name for field in fields)}
    if kind == "commands":
        shown = (each for each in app.registered_commands if not each.hidden)
        return {f"pellucid {each.name or each.callback.__name__}" for each in shown}
    if kind == "keys":
        schema = json_schema(study_model())
        return {key for each in (schema, *schema["$defs"].values()) for key in each["properties"]}
    if kind == "files":
        readers = MADE["reader_modules"]()
        return {*(ending for reader in readers for ending in reader.ENDINGS), *MADE["CHANNEL_UNITS"]}
    if kind == "faults":
        return set(_core.FAULTS) - {"none"}
    if kind == "states":
        return {state["name"] for state in _core.session_states()}
    return {index.name for index in TRANSPARENCY_INDICES}


@pytest.mark.parametrize("kind", MADE["PAGES"])
def test_a_page_names_everything_of_its_kind(kind):
    page = MADE["page"](kind)
    assert page.startswith("# ")
    assert [name for name in sorted(names_of(kind)) if f"`{name}`" not in page] == []
    for line in page.splitlines():
        if line.startswith("|"):
            assert line.endswith("|"), line


def test_every_model_of_the_core_has_a_table_of_parameters():
    page = MADE["page"]("parameters")
    assert [title for title in MADE["MODELS"].values() if f"## {title}\n\n| name | unit |" not in page] == []


def test_descriptions_of_keys_are_read():
    text = "A table.\n\nAttributes\n----------\na, b : float\n    Both\n    of ``x``.\nc : str\n    C."
    assert MADE["described_keys"](text) == {"a": "Both of `x`.", "b": "Both of `x`.", "c": "C."}


def test_pages_are_printed_by_their_names_and_written_together(tmp_path):
    done = subprocess.run([sys.executable, str(WRITER), "faults"], capture_output=True, text=True, check=True)
    assert done.stdout == MADE["page"]("faults")
    subprocess.run([sys.executable, str(WRITER), "--out", str(tmp_path / "reference")], check=True)
    written = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "reference").iterdir()}
    assert written == {Path(file).name: MADE["page"](kind) for kind, (file, _) in MADE["PAGES"].items()}
    unknown = subprocess.run([sys.executable, str(WRITER), "colours"], capture_output=True, text=True)
    assert unknown.returncode == 1
    assert "commands|keys|files" in unknown.stderr


def test_every_option_of_every_command_is_listed():
    page = MADE["page"]("commands")
    group = typer.main.get_command(app)
    for name, command in group.commands.items():
        options = [option for each in command.params if not each.hidden for option in each.opts if option[0] == "-"]
        assert command.hidden or [option for option in options if option not in page] == [], name


def test_links_of_generated_pages_lead_to_pages():
    for kind, (file, _) in MADE["PAGES"].items():
        for target in re.findall(r"\]\(([^)#]+)", MADE["page"](kind)):
            path = ROOT / "docs" / Path(file).parent / target
            assert path.exists() or target.startswith("http"), (kind, target)


def test_the_overview_of_the_reference_names_every_page_and_the_site_leads_there():
    overview = (ROOT / "docs" / "reference" / "index.md").read_text(encoding="utf-8")
    assert [kind for kind in MADE["PAGES"] if f"`python website/generated.py {kind}`" not in overview] == []
    linked = {
        target
        for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))
        for target in re.findall(r"reference/index\.md#([\w-]+)\)", path.read_text(encoding="utf-8"))
    }
    hook = (ROOT / "website" / "pages.py").read_text(encoding="utf-8")
    assert [target for target in sorted(linked) if f'"{target}": "' not in hook] == []


def test_pages_of_docs_name_commands_that_print_something():
    for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        for name in path.read_text(encoding="utf-8").split("website/generated.py ")[1:]:
            assert name.partition("`")[0] in MADE["PAGES"], path.name
