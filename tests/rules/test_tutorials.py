"""Every block of the pages that a reader types along is run as it is written, page by page, in a folder of its own."""

import os
import re
import sys
import tomllib
from pathlib import Path

import pytest
from page_blocks import (
    LANGUAGES,
    PageFailed,
    Reader,
    Stale,
    blocks_of,
    first_difference,
    refresh,
    toml_text,
    without_progress,
)

from pellucid.study.datasets.registry import shipped
from pellucid.study.procedures.registry import study_model
from pellucid.study.study_file import parse_study_file
from pellucid_lab.papers.printed import printed

ROOT = Path(__file__).parents[2]
TUTORIALS = tuple(sorted((ROOT / "docs" / "tutorials").glob("*.md")))
GUIDES = tuple(page for page in sorted((ROOT / "docs" / "how-to").glob("*.md")) if page.name != "index.md")
PAGES = (ROOT / "README.md", *TUTORIALS, *GUIDES)
MIN_TUTORIALS = 6
MIN_GUIDES = 25
MAX_TUTORIAL_WORDS = 1000
MAX_GUIDE_WORDS = 400
MARKS = {
    "README.md": (),
    **dict.fromkeys(
        (
            "anonymise-recordings.md",
            "audit-a-log.md",
            "carry-a-known-load.md",
            "compare-conditions-in-python.md",
            "identify-a-joint-from-arrays.md",
            "identify-a-log-in-one-command.md",
            "import-mvc-recordings.md",
            "process-emg-in-python.md",
            "read-a-report-page.md",
            "read-an-incident.md",
            "register-an-analysis-before-the-data.md",
            "repair-an-interrupted-recording.md",
            "write-a-study-toml.md",
        ),
        (pytest.mark.slow,),
    ),
}
"""Marks of pages that take seconds; the others take minutes."""
LONG = (pytest.mark.nightly, pytest.mark.slow)
MAX_LINE_OF_FIRST_OUTPUT = 25
"""Last line of a tutorial at which what its first command prints may begin: it then stands on the first screen."""
BLOCK_TIMEOUT_S = 3600.0
NOT_RUN = {
    "README.md": ["installs packages of the system", "sets up the clone in which this page is read"],
    "deploy-a-controller.md": ["a part of the program of a microcontroller"],
    "identify-a-joint.md": ["needs recordings of your own"],
    "identify-an-orthosis.md": ["takes a quarter of an hour"],
    "run-a-live-session.md": ["needs a person at two pages"],
    "bring-your-own-controller.md": ["takes an hour"],
    "connect-a-device-to-a-live-session.md": 2 * ["a part of a package of your own"],
    "install-from-a-wheel.md": ["compiles the core four times", *2 * ["the name depends on the system"]],
    "integrate-the-supervisor.md": 2 * ["needs a robot of your own"],
    "put-the-controller-on-an-stm32.md": [
        "flags of a compiler for a microcontroller",
        "a part of the program of a microcontroller",
    ],
    "register-an-analysis-before-the-data.md": ["needs a study of your own"],
    "run-an-emg-estimator-on-a-microcontroller.md": ["a part of the program of a microcontroller"],
    "use-a-controller-in-ros2-control.md": ["needs ROS 2"],
    "use-a-recording-with-a-known-payload.md": ["a part of a study of a robot"],
    "use-it-from-matlab.md": 2 * ["needs MATLAB"],
}
"""Why blocks are left out, page by page and in order. One more is added here on purpose."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_says_what_it_is(page):
    for block in blocks_of(page):
        assert block.language in LANGUAGES, f"{block.where}: expected one of {LANGUAGES} after the fence"
        if block.language == "toml" and "not run" not in block.comment:
            assert {"into", "study"} & set(block.comment), f"{block.where}: no comment says into which file"


def test_blocks_that_are_left_out_are_few_and_listed():
    found = {
        page.name: [block.comment["not run"] for block in blocks_of(page) if "not run" in block.comment]
        for page in PAGES
    }
    assert {page: reasons for page, reasons in found.items() if reasons} == NOT_RUN


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda p: p.name)
def test_the_first_screen_of_a_tutorial_is_a_command_and_its_output(page):
    first, second, *_ = blocks_of(page)
    assert (first.language, second.language) == ("sh", "text")
    assert not {"not run"} & (set(first.comment) | set(second.comment))
    assert second.line <= MAX_LINE_OF_FIRST_OUTPUT


@pytest.mark.parametrize("page", [*TUTORIALS, *GUIDES], ids=lambda p: p.name)
def test_a_page_begins_with_how_to_reach_the_command(page):
    run = [b for b in blocks_of(page) if b.language in ("sh", "python") and "not run" not in b.comment]
    assert not run or run[0].text.splitlines()[0] == "source .venv/bin/activate", run[0].where


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda p: p.name)
def test_a_tutorial_has_a_command_that_is_run(page):
    assert any(block.language == "sh" and "not run" not in block.comment for block in blocks_of(page))


def test_tutorials_and_guides_are_many_and_short():
    assert len(TUTORIALS) >= MIN_TUTORIALS
    assert len(GUIDES) >= MIN_GUIDES
    limits = {**dict.fromkeys(TUTORIALS, MAX_TUTORIAL_WORDS), **dict.fromkeys(GUIDES, MAX_GUIDE_WORDS)}
    words = {page: len(prose_of(page).split()) for page in limits}
    assert {page.name: n for page, n in words.items() if n > limits[page]} == {}


def prose_of(page: Path) -> str:
    """Return a page's text without its blocks and its comments, a piece of code as one word."""
    text = re.sub(r"```.*?```|<!--.*?-->", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"`[^`\n]*`", "x", text)


def test_the_index_lists_every_guide():
    index = (ROOT / "docs" / "how-to" / "index.md").read_text(encoding="utf-8")
    listed = re.findall(r"^- \[.+\]\(([\w-]+\.md)\)$", index, flags=re.MULTILINE)
    assert sorted(listed) == [page.name for page in GUIDES]


@pytest.mark.parametrize("page", [*PAGES, ROOT / "docs" / "validation" / "simulation.md"], ids=lambda page: page.name)
def test_a_paper_that_is_reproduced_is_named_in_full_and_said_to_be_re_enacted(page):
    text = " ".join(page.read_text(encoding="utf-8").split())
    for name in dict.fromkeys(re.findall(r"pellucid reproduce (\w+) --out", text)):
        paper = printed(name)
        surnames = [author.split()[-1] for author in paper.authors.split(", ")] if paper.authors != "not named" else []
        year = [f"({paper.year})"] if surnames else []
        known = [*surnames, *year, *([f"https://doi.org/{paper.doi}"] if paper.doi else ["no DOI of it is known"])]
        assert [part for part in (*known, paper.title) if part not in text] == [], name
        assert re.search("re-enact(s|ed) on a virtual rig", text), name


def test_what_is_to_be_installed_can_be():
    """Pellucid is on no package index: what it can do beside is installed from its clone."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    folders = (ROOT / "src", ROOT / "lab" / "src", ROOT / "docs", ROOT / "tests", ROOT / "examples")
    texts = [path for folder in folders for path in folder.rglob("*") if path.suffix in (".py", ".md", ".toml")]
    for path in (*texts, ROOT / "README.md", ROOT / "CONTRIBUTING.md"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"install ['\"]?pellucid\b", text), path
        for names in re.findall(r"install (?:-e )?['\"]?\.\[([\w,]+)\]", text):
            assert set(names.split(",")) <= set(extras), path


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_parts_of_a_study_are_valid(page, tmp_path):
    whole = tomllib.loads(WHOLE_STUDY)
    for block in blocks_of(page):
        if block.language == "toml" and "study" in block.comment:
            (tmp_path / "study.toml").write_text(toml_text({**whole, **tomllib.loads(block.text)}), encoding="utf-8")
            parse_study_file(tmp_path / "study.toml", study_model)


@pytest.mark.parametrize("page", [pytest.param(page, marks=MARKS.get(page.name, LONG), id=page.name) for page in PAGES])
def test_blocks_run_as_written(page, tmp_path, request):
    if not (Path(sys.prefix) / "bin" / "activate").is_file():
        pytest.skip("this Python is in no virtual environment")
    named = re.findall(r"--dataset (\w+)", "".join(block.text for block in blocks_of(page)))
    if any(shipped(name) is None for name in named):
        request.getfixturevalue("data_folder")
    reader = Reader(tmp_path, Path(os.environ["PELLUCID_SETTINGS"]))
    try:
        for k in range(len(blocks_of(page))):
            try:
                # A page that is refreshed has other lines below.
                reader.run(blocks_of(page)[k], BLOCK_TIMEOUT_S)
            except Stale as stale:
                if "PELLUCID_REFRESH_PAGES" not in os.environ:
                    raise
                refresh(page, stale)
    finally:
        reader.close()


WHOLE_STUDY = """
name = "some"
[rig]
joint = "knee"
motion = "rotary"
[rig.drive]
kind = "torque"
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "tau", unit = "N*m" }
[[recordings]]
name = "one"
file = "recordings/one.csv"
"""


@pytest.fixture
def reader(tmp_path):
    """Read a page that is given as text, and say at which line it stops."""

    def read(text: str) -> None:
        page = tmp_path / "page.md"
        page.write_text(text, encoding="utf-8")
        (tmp_path / "folder").mkdir()
        (tmp_path / "settings").mkdir()
        made = Reader(tmp_path / "folder", tmp_path / "settings")
        try:
            for block in blocks_of(page):
                made.run(block, 60.0)
        finally:
            made.close()

    return read


def test_a_session_goes_on_from_block_to_block(reader):
    reader(
        "```sh\nsource .venv/bin/activate\nmkdir sub\nexport SAID=5.0\ncd sub\n```\n"
        "```sh\npwd | grep /sub$ | wc -l\necho $SAID volts and more\n```\n"
        "```text\n1\n5.01 volts ...\n```\n"
        "<!-- status: 3 -->\n```sh\nexit 3\n```\n"
        "<!-- into: some/file.toml -->\n```toml\n[a]\nb = 1\n```\n"
        "```sh\ngrep -q b ../some/file.toml\n```\n"
        "```python\nx = 1\nx\n```\n```text\n1\n```\n```python\nprint(x + 1)\n```\n```text\n2\n```\n"
        "<!-- not run: needs a microcontroller -->\n```c\nx;\n```\n"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("```sh\nfalse\ntrue\n```\n", r"page.md:1: status 1, expected 0"),
        ("```sh\npellucid no-command\n```\n", "page.md:1: status 127"),
        ("```sh\nfalse | true\n```\n", "page.md:1: status 1"),
        (
            "```sh\nsource .venv/bin/activate\n```\n```python\nopen('swing.csv')\n```\n",
            "page.md:4: the statements end with an error",
        ),
        ("```sh\necho 4.2\n```\n```text\n4.8\n```\n", "page.md:4: shown, but not printed: '4.8'"),
        ("```c\nx;\n```\n", "page.md:1: a block of 'c'"),
        ("```toml\nx = 1\n```\n", "page.md:1: lines of a file"),
    ],
)
def test_what_does_not_run_is_found(reader, text, said):
    with pytest.raises(PageFailed, match=said):
        reader(text)


@pytest.mark.parametrize(
    ("shown", "printed", "missing"),
    [
        (" a   1.00\n ─────\n b 2\n", "a 1.04\nc 5\nb 2", None),
        ("b 2\na 1\n", "a 1\nb 2\n", "a 1"),
        ("p < 0.001 and ...\n", "p < 0.001 and so on", None),
        ("−3.7 to +7.0 %\n", "-3.7 to +7.0 %\n", None),
        ("10 %", "12 %", "10 %"),
        ("11.2 %,", "11.3 %,", None),
        ("...\nend", "x\nend", None),
    ],
)
def test_shown_lines_are_looked_for_in_order(shown, printed, missing):
    assert first_difference(shown, printed) == missing


def test_lines_on_progress_are_no_part_of_what_is_printed():
    """A refreshed block held hundreds of them: their number is that of seconds."""
    told = "pellucid: 3 % reading P2, 4 s so far\nIs it transparent?\npellucid: 70 % indices, P1, about 5 s left\n"
    assert without_progress(f"{told}pellucid: cannot say: no margin.\n") == (
        "Is it transparent?\npellucid: cannot say: no margin.\n"
    )


def test_a_stale_block_is_refreshed_and_keeps_what_is_shortened(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("text\n```sh\ntrue\n```\n```text\ninertia 0.5 kg\n...\nerror 2 % ...\n```\nend\n", encoding="utf-8")
    block = blocks_of(page)[1]
    refresh(page, Stale(block, "inertia 0.5 kg", "inertia  0.75 kg\nmore\nerror 2 % of the torque\n"))
    assert "```text\ninertia  0.75 kg\n...\nerror 2 % ...\n```\nend" in page.read_text(encoding="utf-8")
    refresh(page, Stale(blocks_of(page)[1], "inertia", "mass 1 kg\nerror 3 %\nmore\n"))
    assert "```text\nerror 3 %\n```\nend" in page.read_text(encoding="utf-8")
