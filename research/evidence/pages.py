"""Checks of pages made as a user makes them: the answer comes first, and each number has one value.

The demo is run by its command, and its seconds are its clock's. Further pages are reports of public data sets whose
identification takes seconds, an audit, a proposal and a trial of the same files, and two recorded stops. Chromium opens
each at 1,280 and 420 pixels, in light and in dark, with every folded part opened for what is counted but lengths. A
value's id on a page is that of a row of results.json: its digits must be the same wherever it stands, on every page,
and must be that row's, rounded. Numbers without an id are
not compared.

Answers are compared too: of generated results (`_answers`), and of every study whose page is looked at, the page
with results.json. Output blocks of pages that a reader types along are compared with what is printed now.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pellucid import audit, incident, init, supervised
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.study.incident_page import write_incident_page
from pellucid.start.try_log import try_log
from pellucid.study.procedures.audit_page import write_audit_page
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.result import Result
from pellucid.study.procedures.run import report, run
from pellucid.study.results import ResultRow, read_rows
from research.benchmarks._size import sized

from ._answers import compare_answers, contradictions, page_contradictions, write_joint
from ._page_looks import Looks, chromium, look_at

DATA_SETS = sized(
    ("emps", "sydney_pendulum", "bam_xl330", "modexo_joint", "dfjimu_two_imu_joint", "rat_soleus_hill",
     "elderly_isometric", "lumbar_lifting", "ur10e", "human_pointing"),
    smallest=("rat_soleus_hill",),
)  # fmt: skip
"""Public data sets whose reports are looked at."""

DEMO_FOLDERS = ("bam_servo", "elbow", "people")
"""Studies of the demo, each with a report."""

BLOCK_TIMEOUT_S = 900.0
"""Longest time of one block of such a page [s]."""

PICTURES = Path("build/pages")
"""Folder of pictures of every page, at both widths."""


GENERATED_ANSWERS = sized(200, smallest=3)
"""Number of generated results whose answers are compared."""

GENERATED_PAGES = sized(4, smallest=0)
"""Number of them whose pages are drawn."""

GENERATED_COMMANDS = sized(6, smallest=0)
"""Number of them that are identified by the command, and whose next commands are run."""

JOINT_SEEDS = sized((0, 1, 2, 3), smallest=())
"""Seeds of the simulated joints whose reports are looked at."""

PERIOD_S = 1e-3
"""Period of the law whose stop is drawn [s]."""

TYPED_PAGES = sized(
    ("README.md", "docs/how-to/identify-a-log-in-one-command.md", "docs/tutorials/identify-a-joint.md"), smallest=()
)
"""Pages whose output blocks are compared; the nightly tests compare every page's."""

ROOT = Path(__file__).parents[2]
"""Root of the repository."""


@dataclass(frozen=True)
class Made:
    """A page, and the results.json files of what it shows."""

    name: str
    page: Path
    results: tuple[Path, ...]
    found: Result | None = None  # the result that it draws, where it is at hand


def rows() -> Iterator[ResultRow]:
    """Yield what is measured of all pages."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        seconds, made = _demo_pages(place / "demo")
        made += [page for name in DATA_SETS for page in _data_set_pages(place, name)]
        made += [page for seed in JOINT_SEEDS for page in _joint_pages(place / "joints", seed)]
        made += _file_pages(place, place / "demo" / "bam_servo")
        with chromium() as browser:
            looks = [look_at(browser, one.name, one.page, PICTURES) for one in made]
        contradictions = _contradictions(made, looks)
        shown = [f"{one.name}: {said}" for one in made for said in _shown_otherwise(one)]
        compared, failing = compare_answers(GENERATED_ANSWERS, GENERATED_PAGES, GENERATED_COMMANDS)
        stale = [said for name in TYPED_PAGES for said in stale_blocks(ROOT / name, place)]
    yield _row("pages.count", len(made), ", ".join(one.name for one in made))
    yield _row("pages.values", sum(len(look.values) for look in looks), "marked with the id of their row")
    against = [*shown, *(f"{one.name}: {said}" for one in compared for said in one.contradictions)]
    verdicts = Counter(one.answer.verdict for one in compared)
    told = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())
    yield _row("pages.contradictions", len(against), "; ".join(against)[:900])
    answered = sum(one.found is not None for one in made)
    yield _row("pages.answers_compared", len(compared) + answered, f"{len(compared)} generated: {told}")
    yield _row("pages.next_commands_failing", len(failing), "; ".join(failing)[:900])
    yield _row("pages.stale_blocks", len(stale), "; ".join(stale)[:900])
    yield _row("pages.ids_with_two_values", len(contradictions), "; ".join(contradictions)[:900])
    silent = [look.name for look in looks if not look.answers]
    yield _row("pages.first_screen.without_answer", len(silent), ", ".join(silent))
    longest = max(looks, key=lambda look: look.main_px)
    yield _row("pages.longest_main_part", round(longest.main_px), f"px at 1,280: {longest.name}")
    narrow = max(looks, key=lambda look: look.narrow_px)
    yield _row("pages.longest_main_part_narrow", round(narrow.narrow_px), f"px at 420: {narrow.name}")
    cut = [f"{look.name}: {one}" for look in looks for one in look.overflows]
    yield _row("pages.overflows", len(cut), "; ".join(cut)[:900])
    small = [f"{look.name}: {one}" for look in looks for one in look.small_labels]
    yield _row("pages.labels_below_11_px", len(small), "; ".join(small)[:900])
    least = min(looks, key=lambda look: look.lowest_contrast)
    yield _row("pages.contrast.lowest", least.lowest_contrast, f"{least.name}, {least.lowest_contrast_text}")
    near = min(looks, key=lambda look: look.lowest_distance)
    note = f"CIEDE2000: {near.name}, {near.lowest_distance_figure}"
    yield _row("pages.colour_distance.lowest", near.lowest_distance, note)
    lacking = commands_without_example()
    yield _row("pages.commands.without_example", len(lacking), ", ".join(lacking))
    yield _row("demo.seconds", seconds, "pellucid demo, by the clock", unit="s")


def _row(name: str, value: float, note: str, *, unit: str = "1") -> ResultRow:
    return ResultRow(name, value, unit, "evidence", "simulated", note=note)


def _demo_pages(place: Path) -> tuple[float, list[Made]]:
    """Run the demo as a user does; return its seconds and its pages."""
    started = time.monotonic()
    command = [sys.executable, "-m", "pellucid", "demo", "--out", str(place), "-q"]
    subprocess.run(command, check=True, capture_output=True)
    seconds = time.monotonic() - started
    results = tuple(place / name / "results.json" for name in DEMO_FOLDERS)
    made = [Made("demo", place / "index.html", (place / "results.json", *results))]
    made += [
        Made(f"demo-{name}", place / name / "report" / "index.html", (own,))
        for name, own in zip(DEMO_FOLDERS, results, strict=True)
    ]
    return seconds, made


def _data_set_pages(place: Path, name: str) -> list[Made]:
    """Return the report of a public data set, made by the functions of the commands."""
    study = init(place / name, dataset=name)
    found = run(study)
    found.save(study)
    return [Made(name, report(study, found), (study.results_path,), found)]


def _joint_pages(place: Path, seed: int) -> Iterator[Made]:
    """Yield the report of a simulated joint, unless `check` refuses its recordings."""
    study = open_study(write_joint(place / f"joint{seed}", seed))
    try:
        found = run(study, "identify", joint={"thorough": False})
    except PellucidError:
        return
    found.save(study)
    yield Made(study.name, report(study, found), (study.results_path,), found)


def _file_pages(place: Path, recordings: Path) -> list[Made]:
    """Return the pages of an audit and of a proposal for files that were never described."""
    files = sorted(recordings.rglob("*.csv"))[:2]
    audited = write_audit_page(audit(files), place / "audit")
    init(place / "proposed", files=files)
    tried = try_log(files, out=place / "tried")
    return [
        Made("audit", audited, ()),
        Made("proposal", place / "proposed" / "proposal" / "index.html", ()),
        Made("try", tried.page, (tried.study.results_path,)),
        *(Made(f"incident-{kind}", _incident_page(place / kind, kind), ()) for kind in ("jump", "silent")),
    ]


def _incident_page(folder: Path, kind: str) -> Path:
    """Return the page of a stop that a supervised law recorded: its encoder jumps, or gives no number."""
    stated = {"inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0}
    stated |= {"velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": PERIOD_S}
    law = ControlLaw("joint", LAWS["joint"].defaults | stated)
    safe = supervised(law, instruments=Instruments(drive=True), start_up=False)
    safe.record(600, 1, 80)
    effort = 0.0
    for k in range(900):
        position = 0.5 + 0.3 * np.sin(6.0 * k * PERIOD_S)
        if k >= 400:
            position += 1.0 if kind == "jump" else np.nan
        effort = safe.step(k * PERIOD_S, position, drive=effort)
    folder.mkdir()
    path = folder / "incident.bin"
    path.write_bytes(safe.incident())
    return write_incident_page(incident(path), folder / "page")


def _shown_otherwise(one: Made) -> Iterator[str]:
    """Yield what a study's terminal, notebook, results.json and page say against its answer."""
    if one.found is not None:
        yield from contradictions(one.found)
        yield from page_contradictions(one.found, one.page.read_text(encoding="utf-8"))


def stale_blocks(page: Path, place: Path) -> list[str]:
    """Type a page's blocks in a folder of their own, and return those that are not what is printed now."""
    from importlib.util import module_from_spec, spec_from_file_location

    spec = spec_from_file_location("page_blocks", ROOT / "tests" / "rules" / "page_blocks.py")
    assert spec is not None  # the file is in this repository
    assert spec.loader is not None
    blocks = module_from_spec(spec)
    sys.modules[spec.name] = blocks  # its dataclasses look for their module there
    spec.loader.exec_module(blocks)
    folder, settings = place / f"typed-{page.stem}", place / f"settings-{page.stem}"
    folder.mkdir()
    settings.mkdir()
    reader, found = blocks.Reader(folder, settings), []
    try:
        for block in blocks.blocks_of(page):
            try:
                reader.run(block, BLOCK_TIMEOUT_S)
            except blocks.Stale as stale:
                found.append(str(stale).splitlines()[0])
    except blocks.PageFailed as failed:
        found.append(str(failed).splitlines()[0])
    finally:
        reader.close()
    return found


def _contradictions(made: list[Made], looks: list[Looks]) -> list[str]:
    """Return each id that stands with different digits, or with digits that its row of results.json does not have."""
    texts: dict[str, dict[str, str]] = {}
    stored: dict[str, float] = {}
    for one, look in zip(made, looks, strict=True):
        for path in one.results:
            if path.is_file():
                stored |= {row.id: float(row.value) for row in read_rows(path) if row.value is not None}
        for name, text, _ in look.values:
            texts.setdefault(name, {}).setdefault(_number_text(text), one.name)
    found = [
        f"{name}: {', '.join(f'{text} ({page})' for text, page in said.items())}"
        for name, said in texts.items()
        if len(said) > 1
    ]
    found += [
        f"{name}: {text} on a page, {stored.get(name, 'nothing')} in results.json"
        for name, said in texts.items()
        for text in said
        if not _is_rounded(text, stored.get(name))
    ]
    return found


def _number_text(text: str) -> str:
    """Return the digits of a number without its unit, sign of plus and typography."""
    found = re.search(r"[−-]?\d[\d.]*(?:×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?", text)
    return found[0].replace("−", "-") if found else text


def _is_rounded(text: str, value: float | None) -> bool:
    """Return whether digits are those of a value, rounded to as many."""
    if value is None:
        return False
    powers = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    digits, _, power = text.partition("×10")
    try:
        scale = 10.0 ** int(power.translate(powers)) if power else 1.0
        told = float(digits) * scale
    except ValueError:
        return False
    places = len(digits.partition(".")[2])
    # 20400 for 20393 has been rounded before the point.
    unit = 10.0**-places if places else 10.0 ** (len(digits) - len(digits.rstrip("0")))
    return abs(told - value) <= 0.5000001 * unit * scale


def commands_without_example() -> list[str]:
    """Return the commands whose help has no example, or a line of more than 80 columns."""
    import typer

    from pellucid.cli import app

    lacking = []
    for name in typer.main.get_command(app).commands:
        shown = subprocess.run(
            [sys.executable, "-m", "pellucid", name, "--help"], capture_output=True, text=True, env={"COLUMNS": "80"},
        ).stdout  # fmt: skip
        if "xample" not in shown or any(len(line) > 80 for line in shown.splitlines()):
            lacking.append(name)
    return lacking
