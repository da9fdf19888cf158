"""Drawing by the report's rules: a figure with its caption, how it becomes SVG and PDF, and the marks it is made of.

Figures are made with Matplotlib's objects alone: no pyplot, no global state, no window.

`broken` and `outline` choose a line's points: gaps where samples are missing, and outlines of long series.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import matplotlib
import numpy as np
from fontTools.subset import Options
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.text import Annotation
from matplotlib.ticker import FuncFormatter, LogFormatter, MaxNLocator, NullFormatter, ScalarFormatter

from ..._atomic import write_bytes_atomically, write_text_atomically
from ..pages.quantities import MINUS_SIGN, SUPERSCRIPT_DIGITS
from .style import COLOURS, FIGURE_WIDTH, MATPLOTLIB_SETTINGS, SANS_SERIF_FONTS, colour

LINE_POINTS = 900
"""A drawn line has at most about this many points: the extremes of every stretch, so that no peak is lost."""


SHADED_GAPS_WORDS = "Shaded stretches are not compared, mostly because the joint is near standstill there."
"""Sentence of a caption below a figure whose gaps are shaded."""


def _gaps(time: np.ndarray) -> np.ndarray:
    """Return the indices of the samples, of `time` (n,), that follow a gap."""
    steps = np.diff(time)
    known = steps[np.isfinite(steps)]
    return np.flatnonzero(steps > 3.5 * np.median(known)) + 1 if len(known) else np.empty(0, dtype=int)


def broken(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Insert NaN wherever samples are missing, so that no line bridges a gap; both arrays have shape (n,)."""
    gaps = _gaps(time)
    return np.insert(time, gaps, np.nan), np.insert(values, gaps, np.nan)


def shade_gaps(axis: Axes, time: np.ndarray) -> bool:
    """Shade the stretches of `time`, (n,), where samples are missing, so that a broken line is read as segments.

    Return whether there is one.
    """
    time = time[np.isfinite(time)]
    gaps = _gaps(time)
    for gap in gaps:
        axis.axvspan(time[gap - 1], time[gap], color=colour("rule"), alpha=0.6, linewidth=0, zorder=0)
    return bool(len(gaps))


def outline(time: np.ndarray, values: np.ndarray, points: int = LINE_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Keep the smallest and the largest sample of each of `points` / 2 stretches, and all gaps."""
    if len(time) <= points:
        return time, values
    keep = {0, len(time) - 1, *np.flatnonzero(~np.isfinite(time) | ~np.isfinite(values)).tolist()}
    for part in np.array_split(np.arange(len(time)), points // 2):
        good = part[np.isfinite(values[part])]
        if len(good):
            keep.update((int(good[np.argmin(values[good])]), int(good[np.argmax(values[good])])))
    index = np.array(sorted(keep))
    return time[index], values[index]


def every(points: int, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    """Keep about `points` evenly spaced samples of each array, and the gaps of the first one."""
    step = max(1, len(arrays[0]) // points)
    keep = np.zeros(len(arrays[0]), bool)
    keep[::step] = True
    keep |= ~np.isfinite(arrays[0])
    return tuple(a[keep] for a in arrays)


DOT_POINTS = 1400
"""A cloud of dots keeps at most so many."""

VALUE_GID_PREFIX = "value:"
"""Beginning of the gid of a text that shows a number of results.json; the rest is the id of its row."""

_LONG_NUMBER_PATTERN = re.compile(r"-?\d+\.\d{3,}")


@dataclass(frozen=True)
class Drawing:
    """A figure and what is said of it."""

    name: str  # File name without suffix, and prefix of every id in the inline SVG
    figure: Figure
    caption: str  # Plain text below the figure: what is drawn, and how to read it

    @cached_property
    def svg(self) -> str:
        """The figure as an SVG file's text: the same for the same figure."""
        return self.still_svg()

    def still_svg(self) -> str:
        """Return the figure as an SVG file's text, in which nothing moves."""
        buffer = io.StringIO()
        with matplotlib.rc_context(dict(MATPLOTLIB_SETTINGS)), warnings.catch_warnings():
            # Text stays text, so that the reader's browser has the letters that this machine's font lacks.
            warnings.filterwarnings("ignore", r"Glyph .* missing from font")
            self.figure.savefig(buffer, format="svg", metadata={"Date": None})
        return _rounded(buffer.getvalue())

    def inline(self) -> str:
        """Return the figure as an ``<svg>`` element that shares one HTML page with others.

        Every id gets the figure's name as prefix, and every colour of the style becomes its CSS variable, so that the
        page's light and dark values apply.
        """
        text = self.svg[self.svg.index("<svg") :]
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        text = re.sub(rf'<g id="{VALUE_GID_PREFIX}([^"]+)"', rf'<g data-id="\1" id="{VALUE_GID_PREFIX}\1"', text)
        text = re.sub(r'(?<!data-)\bid="([^"]+)"', rf'id="{self.name}-\1"', text)
        text = re.sub(r"url\(#([^)]+)\)", rf"url(#{self.name}-\1)", text)
        text = re.sub(r'href="#([^"]+)"', rf'href="#{self.name}-\1"', text)
        for attribute in ("width", "height"):
            text = re.sub(rf'(<svg[^>]*?) {attribute}="[^"]*"', r"\1", text, count=1)
        for role, (light, _) in COLOURS.items():
            text = text.replace(light, f"var(--{role})")
        text = re.sub(r"font: ([^;\"]*?)'DejaVu Sans'[^;\"]*", rf"font: \1{SANS_SERIF_FONTS}".replace('"', "'"), text)
        return text.strip()

    def save(self, folder: Path, *, with_pdf: bool = False) -> tuple[Path, ...]:
        """Write ``<name>.svg`` and, `with_pdf`, ``<name>.pdf`` into `folder`; return their paths."""
        folder = Path(folder)
        drawn = write_text_atomically(folder / f"{self.name}.svg", self.svg)
        if not with_pdf:
            return (drawn,)
        printed = io.BytesIO()
        with matplotlib.rc_context(dict(MATPLOTLIB_SETTINGS)), _outlines_alone():
            self.figure.savefig(
                printed, format="pdf", metadata={"CreationDate": None, "ModDate": None}, facecolor=colour("paper")
            )
        return drawn, write_bytes_atomically(folder / f"{self.name}.pdf", printed.getbuffer())


@contextmanager
def _outlines_alone() -> Iterator[None]:
    """Fonts go into a PDF without their rules of layout, which no viewer reads: to cut them down to a figure's letters
    takes longer than to draw the figure."""
    before = Options._drop_tables_default
    Options._drop_tables_default = [*before, "GDEF", "GPOS", "GSUB"]
    try:
        yield
    finally:
        Options._drop_tables_default = before


def _rounded(svg: str) -> str:
    """Coordinates with two decimals: a hundredth of a point is below what any screen or printer shows."""
    for attribute in (r'\bd="[^"]*"', r'\b(?:points|x|y|transform)="[^"]*"'):
        svg = re.sub(attribute, lambda m: _LONG_NUMBER_PATTERN.sub(lambda n: f"{float(n[0]):.2f}", m[0]), svg)
    return re.sub(r" \n", " ", svg)


def draw(make: Callable[..., Drawing], *args, **options) -> Drawing:
    """Call a figure's function under the report's style."""
    with matplotlib.rc_context(dict(MATPLOTLIB_SETTINGS)):
        drawing = make(*args, **options)
        _name_powers_of_ten(drawing.figure)
        _write_out_powers(drawing.figure)
        # Once, so that every later output has the same layout. None takes the engine away; "none" leaves a stand-in,
        # for which every output draws the figure twice.
        _lay_out(drawing.figure)
        return drawing


def _lay_out(figure: Figure) -> None:
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
    figure.set_layout_engine(None)


def set_height(figure: Figure, height: float) -> None:
    """Give a figure that was drawn another `height` [in], and lay it out anew."""
    with matplotlib.rc_context(dict(MATPLOTLIB_SETTINGS)):
        figure.set_size_inches(figure.get_figwidth(), height)
        figure.set_layout_engine("constrained")
        _lay_out(figure)


def _name_powers_of_ten(figure: Figure) -> None:
    """Let logarithmic axes label their powers of ten in plain characters: Matplotlib's own labels are formulas, which
    the report's style prints as they are written."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), LogFormatter):
                axis.set_major_formatter(FuncFormatter(lambda value, _: _plain_power(value)))
            if isinstance(axis.get_minor_formatter(), LogFormatter):
                axis.set_minor_formatter(NullFormatter())


class _WrittenOut(ScalarFormatter):
    """Tick labels of very large or small numbers with their power of ten: 4×10⁹. Matplotlib writes it once, above the
    axis, where it lies on the panel's head."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        text, _, exponent = f"{super().__call__(x, pos)}{super().get_offset()[1:]}".partition("e")
        if not exponent or not x:
            return text
        return f"{text}×10{exponent.replace(MINUS_SIGN, '-').translate(SUPERSCRIPT_DIGITS)}"

    def get_offset(self) -> str:
        return ""


def _write_out_powers(figure: Figure) -> None:
    """Let linear axes with Matplotlib's own labels write powers of ten with each number."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(_WrittenOut(useOffset=False))


def _plain_power(value: float) -> str:
    """Return the label of a tick on a logarithmic axis: .01, 10, or 10⁶."""
    if not value > 0.0:
        return ""
    exponent = round(np.log10(value))
    if -3 <= exponent <= 4 or not np.isclose(value, 10.0**exponent, rtol=1e-6, atol=0.0):
        return f"{value:g}"
    return f"10{str(exponent).translate(SUPERSCRIPT_DIGITS)}"


def one_panel(height: float) -> tuple[Figure, Axes]:
    """A figure of full width with one panel, `height` in inches."""
    figure = Figure(figsize=(FIGURE_WIDTH, height), layout="constrained")
    return figure, figure.subplots()


def tidy(axis: Axes, *, first: bool, text: str = "", ticks: int = 6) -> None:
    """Ticks and label by the report's rules."""
    axis.tick_params(length=3, width=0.7, pad=3)
    axis.margins(x=0.01)
    axis.yaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 2.5, 5, 10]))
    if first:
        axis.set_ylabel(text)
    else:
        axis.tick_params(axis="y", labelleft=False)


@dataclass(frozen=True)
class Head:
    """What stands above a panel: a name in bold ink, and the rest in `tone`."""

    name: str
    rest: str
    tone: str


HEAD_CHARACTER_POINTS = (6.6, 5.3)
"""Width of a character of a head's name and of its rest, in points."""

KEY_CHARACTER_POINTS = 6.2
"""Width of a character of a key, in points."""

KEY_GAP_POINTS = 12.0
"""Distance between two names of a key, in points."""

LINE_POINTS_ABOVE = 13.0
"""Distance between the lines of text above a panel, in points."""


def heads(axes: Sequence[Axes], texts: Sequence[Head]) -> None:
    """Heads of a row of panels: on one line where every panel has room, else on two; a name too long is cut."""
    rooms = [_room(axis) for axis in axes]
    name_width, rest_width = HEAD_CHARACTER_POINTS
    one_line = all(
        name_width * len(t.name) + rest_width * len(t.rest) + 10.0 <= r for t, r in zip(texts, rooms, strict=True)
    )
    for axis, text, room in zip(axes, texts, rooms, strict=True):
        assert not axis.get_title(loc="right")  # its key would stand on the head
        most = max(int(room / name_width), 6)
        name = text.name
        if not one_line and len(name) > most:
            # Recordings tend to differ at their ends.
            name = f"{name[: most // 2 - 1]}…{name[-(most - most // 2) :]}"
        # A blank title keeps the height; the texts themselves must not widen the layout.
        axis.set_title(" " if one_line else " \n ", fontsize=9.5 if one_line else 9.0)
        head = axis.annotate(
            name, (0.0, 1.0), xytext=(0, 6 if one_line else 19), xycoords="axes fraction", textcoords="offset points",
            fontweight="bold", fontsize=9.5, va="bottom",
        )  # fmt: skip
        at, shift, frame = ((1.0, 0.0), (8, 0.4), head) if one_line else ((0.0, 1.0), (0, 6), "axes fraction")
        rest = axis.annotate(
            text.rest, at, xytext=shift, xycoords=frame, textcoords="offset points", color=text.tone, fontsize=8.5,
            va="bottom",
        )  # fmt: skip
        for artist, width in ((head, name_width), (rest, rest_width)):
            artist.set_in_layout(False)
            artist.set_label(f"{HEAD_LABEL}{width * len(artist.get_text())}")


HEAD_LABEL = "head:"
"""Beginning of the label of a head's text; the rest is its width in points."""


def _room(axis: Axes) -> float:
    """Return the width of a panel, in points: its share of the figure's width, less the gaps."""
    place = axis.get_subplotspec()
    if place is None:
        return 72.0 * FIGURE_WIDTH - 84.0
    ratios = np.array(place.get_gridspec().get_width_ratios() or [1.0], float)
    share = ratios[place.colspan.start : place.colspan.stop].sum() / ratios.sum()
    return float(share * (72.0 * FIGURE_WIDTH - 70.0) - 14.0)


def key(axis: Axes, entries: Sequence[tuple[str, str]]) -> None:
    """Write names in their colours above a panel's right end, where they hide nothing and nothing crosses them: on the
    line of its head if there is room, else on as many lines above it as they need. A panel's head comes first.
    """
    room = _room(axis)
    rows: list[list[tuple[str, str]]] = [[]]
    used = 0.0
    for text, tone in entries:
        width = KEY_CHARACTER_POINTS * len(text) + KEY_GAP_POINTS
        if rows[-1] and used + width > room:
            rows.append([])
            used = 0.0
        rows[-1].append((text, tone))
        used += width
    title = axis.get_title(loc="left")
    written = sum(
        float(each.get_label().removeprefix(HEAD_LABEL))
        for each in axis.texts
        if str(each.get_label()).startswith(HEAD_LABEL)
    ) or HEAD_CHARACTER_POINTS[0] * len(title)
    below = title.count("\n") + 1 if title else 0
    if len(rows) == 1 and below == 1 and written + used + 2.0 * KEY_GAP_POINTS <= room:
        below = 0
    # A blank title keeps the height; the texts themselves must not widen the layout.
    axis.set_title(" \n" * (below + len(rows) - 1) + " ", loc="right", fontsize=9.0, linespacing=1.45)
    for line_above, row in enumerate(reversed(rows), start=below):
        beside: Annotation | None = None
        for text, tone in reversed(row):
            beside = axis.annotate(
                text, (1.0 if beside is None else 0.0, 1.0), xycoords=(beside or "axes fraction", "axes fraction"),
                xytext=(0.0 if beside is None else -KEY_GAP_POINTS, 8.0 + LINE_POINTS_ABOVE * line_above),
                textcoords="offset points", ha="right", va="baseline", color=tone, fontsize=8.5, fontweight="bold",
                annotation_clip=False,
            )  # fmt: skip
            beside.set_in_layout(False)


def measured_and_predicted(
    axis: Axes, time: np.ndarray, measured: np.ndarray, predicted: np.ndarray, tone: str
) -> None:
    """Draw a prediction, dashed in `tone`, over a wider line of what was measured, so that both are seen where they
    agree. `time`, `measured`, `predicted` (n,)."""
    line(axis, time, measured, color=colour("measured"), linewidth=3.0)
    line(axis, time, predicted, color=tone, linewidth=1.5, linestyle=(0, (4, 2.5)), dash_capstyle="butt")


def origin(axis: Axes) -> None:
    """Lines through zero, below the data."""
    axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
    axis.axvline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)


def label_ends(axis: Axes, ends: Sequence[tuple[float, str, str]]) -> None:
    """Names at the right ends of curves, moved apart where they would overlap."""
    low, high = axis.get_ylim()
    ends = sorted(ends)
    for at, (_, text, tone) in zip(_apart([y for y, *_ in ends], 0.06 * (high - low)), ends, strict=True):
        axis.annotate(
            text, (1.0, at), xytext=(5, 0), xycoords=("axes fraction", "data"), textcoords="offset points",
            va="center", color=tone, fontsize=8.5, annotation_clip=False,
        )  # fmt: skip


def _apart(heights: Sequence[float], gap: float) -> list[float]:
    """Ascending heights at least `gap` apart, each group centred on where its members wanted to be."""
    groups: list[list[float]] = []
    for y in heights:
        groups.append([y])
        while len(groups) > 1 and _centre(groups[-1]) - _centre(groups[-2]) < gap * (
            0.5 * (len(groups[-1]) + len(groups[-2]))
        ):
            last = groups.pop()
            groups[-1] += last
    return [_centre(g) + gap * (i - 0.5 * (len(g) - 1)) for g in groups for i in range(len(g))]


def _centre(group: Sequence[float]) -> float:
    return sum(group) / len(group)


def line(axis: Axes, time: np.ndarray, values: np.ndarray, **style) -> None:
    """A curve of `values`, shape (n,), over `time`, shape (n,), on an `axis`: broken where samples are missing, its
    outline alone where there are many; `style` is Matplotlib's."""
    time, values = broken(np.asarray(time, float), np.asarray(values, float))
    axis.plot(*outline(time, values), **style)


def dots(axis: Axes, x: np.ndarray, y: np.ndarray, tone: str, *, alpha: float, size: float) -> None:
    """Many dots as a few paths (round-capped strokes of no length): a hundredth of the markup of markers. `x`, `y`
    (n,)."""
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = x[keep], y[keep]
    if len(x) > DOT_POINTS:
        chosen = np.sort(np.random.default_rng(0).choice(len(x), DOT_POINTS, replace=False))
        x, y = x[chosen], y[chosen]
    if not len(x):
        return
    tiny = 1e-4 * np.ptp(x) or 1e-3 * abs(x[0]) or 1e-4
    for part in np.array_split(np.arange(len(x)), 4):
        if not len(part):
            continue
        vertices = np.empty((2 * len(part), 2))
        vertices[0::2], vertices[1::2] = np.c_[x[part], y[part]], np.c_[x[part] + tiny, y[part]]
        codes = np.tile([Outline.MOVETO, Outline.LINETO], len(part))
        # add_patch would walk every stroke for the limits, which follow from its ends.
        axis.add_artist(
            PathPatch(
                Outline(vertices, codes), fill=False, edgecolor=tone, alpha=alpha, linewidth=size, capstyle="round",
                zorder=2,
            )
        )  # fmt: skip
        axis.update_datalim(vertices)
    axis.autoscale_view()
