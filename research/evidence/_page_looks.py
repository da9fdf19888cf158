"""Measure pages in a browser without a window: first screen, length, clipped text, contrast, distance of colours."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ._page_colours import colour_distance, contrast

WIDE_PX = 1280
"""Width of the window of a desktop."""

NARROW_PX = 420
"""Width of the window of a telephone."""

FIRST_SCREEN_PX = 700
"""Height of the first screen."""

NEUTRAL_ROLES = frozenset({"paper", "panel", "ink", "muted", "rule", "faint"})
"""Colour roles that are no series of a figure: text, grids, zero lines, lines between the points of one person."""

FIRST_SCREEN_SCRIPT = """limit => {
  const bottom = found => found ? found.getBoundingClientRect().bottom + scrollY : Infinity;
  const badge = document.querySelector('.badge'), lead = document.querySelector('.answer .lead');
  const figure = document.querySelector('.answer figure svg');
  return badge && badge.textContent.trim() && lead && /[0-9]/.test(lead.textContent)
    && [badge, lead, figure].every(one => bottom(one) <= limit);
}"""

OVERFLOW_SCRIPT = """() => {
  document.querySelectorAll('details').forEach(one => one.open = true);
  const found = [];
  if (document.documentElement.scrollWidth > innerWidth) found.push('the page scrolls sideways');
  for (const one of document.querySelectorAll('header *, nav *, main *, footer *')) {
    if (one.closest('.scroll') || one.closest('svg')) continue;
    const box = one.getBoundingClientRect();
    if (box.width && box.right > innerWidth + 1) found.push(`${one.tagName} ${one.textContent.trim().slice(0, 40)}`);
    if (one.scrollWidth > one.clientWidth + 1 && getComputedStyle(one).overflowX === 'hidden')
      found.push(`cut: ${one.textContent.trim().slice(0, 40)}`);
  }
  for (const svg of document.querySelectorAll('figure svg')) {
    const frame = svg.getBoundingClientRect();
    for (const text of svg.querySelectorAll('text')) {
      const box = text.getBoundingClientRect();
      if (!box.width) continue;
      if (box.left < frame.left - 2 || box.right > frame.right + 2 || box.top < frame.top - 2
          || box.bottom > frame.bottom + 2) found.push(`cut in a figure: ${text.textContent.trim().slice(0, 40)}`);
    }
  }
  return found;
}"""

TEXT_SCRIPT = """() => {
  document.querySelectorAll('details').forEach(one => one.open = true);
  const made = new Map();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const text = walker.currentNode.textContent.trim(), one = walker.currentNode.parentElement;
    if (!text || !one || one.closest('style, title, .rests')) continue;
    const style = getComputedStyle(one), inside = one.closest('svg');
    if (!one.getClientRects().length) continue;
    let behind = one, ground = 'rgba(0, 0, 0, 0)';
    while (behind && ground === 'rgba(0, 0, 0, 0)') {
      ground = getComputedStyle(behind).backgroundColor;
      behind = behind.parentElement;
    }
    made.set(`${inside ? style.fill : style.color}|${ground}`, text.slice(0, 40));
  }
  return [...made];
}"""

SERIES_SCRIPT = """() => {
  const made = [];
  for (const figure of document.querySelectorAll('figure')) {
    const marks = {};
    const add = (role, mark) => { (marks[role] = marks[role] || new Set()).add(mark); };
    for (const one of figure.querySelectorAll('svg path, svg use')) {
      if (one.closest('defs')) continue;
      const style = one.getAttribute('style') || '', stroke = /stroke: ?var\\(--(\\w+)\\)/.exec(style);
      const fill = /fill: ?var\\(--(\\w+)\\)/.exec(style), dash = /stroke-dasharray: ?([0-9. ,]+)/.exec(style);
      if (one.tagName === 'use') {
        const target = document.getElementById((one.getAttribute('xlink:href') || one.getAttribute('href')).slice(1));
        const role = fill || stroke;
        if (role) add(role[1], `marker ${target ? target.getAttribute('d') : ''}`);
      } else if (stroke) add(stroke[1], dash ? `dash ${dash[1]}` : 'line');
      else if (fill) add(fill[1], 'area');
    }
    made.push([figure.id, Object.entries(marks).map(([role, set]) => [role, [...set]])]);
  }
  return made;
}"""

MIN_LABEL_PX = 11.0
"""Smallest size of a letter in a figure, in a wide window."""

SMALL_LABELS_SCRIPT = """least => {
  const found = [];
  for (const svg of document.querySelectorAll('figure svg')) {
    let smallest = null;
    for (const text of svg.querySelectorAll('text')) {
      const matrix = text.getScreenCTM();
      if (!text.textContent.trim() || !text.getClientRects().length || !matrix) continue;
      const size = parseFloat(getComputedStyle(text).fontSize) * Math.hypot(matrix.a, matrix.b);
      if (size < least - 0.05 && (!smallest || size < smallest[0])) smallest = [size, text.textContent.trim()];
    }
    if (smallest) found.push(`${svg.closest('figure').id}: ${smallest[0].toFixed(1)} px, ${smallest[1].slice(0, 30)}`);
  }
  return found;
}"""

ROLE_SCRIPT = "role => getComputedStyle(document.documentElement).getPropertyValue(`--${role}`).trim()"

VALUES_SCRIPT = """() => {
  const html = [...document.querySelectorAll('data[data-id]')].map(one =>
    [one.dataset.id, one.textContent.trim(), Number(one.value)]);
  const drawn = [...document.querySelectorAll('svg g[data-id]')].map(one =>
    [one.getAttribute('data-id'), one.textContent.trim(), NaN]);
  return [...html, ...drawn];
}"""


@dataclass
class Looks:
    """What was measured of one page."""

    name: str
    answers: bool  # whether badge, sentence and figure end within the first screen of a wide window
    main_px: float  # height of the part below the head as it opens, in a wide window
    narrow_px: float  # the same in a narrow window
    overflows: list[str]  # what is cut or wider than the window, at both widths
    lowest_contrast: float
    lowest_contrast_text: str
    lowest_distance: float  # of two series of one figure that do not differ by dash or mark
    lowest_distance_figure: str
    small_labels: list[str] = field(default_factory=list)  # figures with letters below `MIN_LABEL_PX`
    values: list[tuple[str, str, float]] = field(default_factory=list)  # id, digits and number of each value


@contextmanager
def chromium() -> Iterator[Any]:
    """Open the system's Chromium without a window."""
    from playwright.sync_api import sync_playwright

    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)
    if path is None:
        raise RuntimeError("found no Chromium on this machine, expected one to look at pages with")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        try:
            yield opened
        finally:
            opened.close()


def look_at(browser: Any, name: str, path: Path, pictures: Path | None = None) -> Looks:
    """Measure a page at both widths, in light and in dark; write pictures into a folder, if one is given."""
    wide = browser.new_page(viewport={"width": WIDE_PX, "height": FIRST_SCREEN_PX})
    wide.goto(path.resolve().as_uri())
    answers = bool(wide.evaluate(FIRST_SCREEN_SCRIPT, FIRST_SCREEN_PX))
    height = "document.querySelector('main').getBoundingClientRect().height"
    main_px = float(wide.evaluate(height))
    narrow = browser.new_page(viewport={"width": NARROW_PX, "height": FIRST_SCREEN_PX})
    narrow.goto(path.resolve().as_uri())
    narrow_px = float(narrow.evaluate(height))
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        for page, width in ((wide, WIDE_PX), (narrow, NARROW_PX)):
            page.screenshot(path=pictures / f"{name}-{width}.png", full_page=True)
    opened = ((WIDE_PX, wide), (NARROW_PX, narrow))
    overflows = [f"{width} px: {one}" for width, page in opened for one in page.evaluate(OVERFLOW_SCRIPT)]
    lowest = (21.0, "")
    series: list[tuple[float, str]] = []
    for scheme in ("light", "dark"):
        wide.emulate_media(color_scheme=scheme)
        for pair, text in wide.evaluate(TEXT_SCRIPT):
            tone, ground = (_hex(colour) for colour in pair.split("|"))
            if tone and ground:
                lowest = min(lowest, (contrast(tone, ground), f"{scheme}: {text}"))
        series += _closest(wide, scheme)
    small = wide.evaluate(SMALL_LABELS_SCRIPT, MIN_LABEL_PX)
    values = [(row, text, float(number)) for row, text, number in wide.evaluate(VALUES_SCRIPT)]
    wide.close()
    narrow.close()
    near = min(series, default=(100.0, ""))
    return Looks(name, answers, main_px, narrow_px, overflows, *lowest, *near, small, values)


def _closest(page: Any, scheme: str) -> list[tuple[float, str]]:
    """Return the distance of each two series of a figure that do not differ by dash or mark."""
    made = []
    for figure, marks in page.evaluate(SERIES_SCRIPT):
        shown = [(role, set(kinds)) for role, kinds in marks if role not in NEUTRAL_ROLES]
        for (one, first), (other, second) in itertools.combinations(shown, 2):
            if first & second:
                tones = (page.evaluate(ROLE_SCRIPT, role) for role in (one, other))
                made.append((colour_distance(*tones), f"{scheme}, {figure}: {one} and {other}"))
    return made


def _hex(colour: str) -> str:
    """Return a computed colour such as rgb(28, 33, 38) as #1c2126; "" for none or a transparent one."""
    if not colour.startswith("rgb") or colour.endswith(", 0)"):
        return ""
    parts = colour[colour.index("(") + 1 : -1].split(",")[:3]
    return "#" + "".join(f"{round(float(part)):02x}" for part in parts)
