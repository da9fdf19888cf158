"""Small charts as SVG: axes with whole words, lines, bands, points and bars; readable on light and dark pages."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from pellucid.study.drawing.drawing import outline

WIDTH, HEIGHT = 720, 340
"""Size of a figure [px]."""
LEFT, RIGHT, TOP, BOTTOM = 74, 18, 34, 52
"""Margins of a panel for tick labels, title and axis labels [px]; a row of the legend adds `LEGEND_ROW` at the top."""
LEGEND_ROW = 20
"""Height of a row of the legend [px]."""
LEGEND_SYMBOL = 46
"""Width of a symbol of the legend and of the space around it [px]."""
PANEL_GAP = 20
"""Distance between two panels [px]."""
MAX_POINTS = 260
"""Points of a line; of a longer one the extremes of as many stretches are kept."""
CHARACTER_WIDTH = 7.6
"""Mean width of a character of a label [px]."""
STYLE = """
svg{background:#fff}text{font:14px system-ui,sans-serif;fill:#222}.title{font-weight:600}
.axis{stroke:#444;fill:none}.grid{stroke:#ddd;fill:none}.line{fill:none;stroke-width:2.2;stroke-linejoin:round}
.c0{stroke:#0b62a4;color:#0b62a4}.c1{stroke:#b3480a;color:#b3480a}.c2{stroke:#2c7a2c;color:#2c7a2c}
.c3{stroke:#7a3e9d;color:#7a3e9d}.c4{stroke:#6b6b6b;color:#6b6b6b}
.fill{fill:currentColor;stroke:none}.band{fill:currentColor;stroke:none;opacity:.22}.dash{stroke-dasharray:6 5}
@media (prefers-color-scheme:dark){svg{background:#1d2026}text{fill:#e8e8e8}.axis{stroke:#bbb}.grid{stroke:#3b404a}
.c0{stroke:#6cb4ee;color:#6cb4ee}.c1{stroke:#f0995b;color:#f0995b}.c2{stroke:#7fcf7f;color:#7fcf7f}
.c3{stroke:#c79be6;color:#c79be6}.c4{stroke:#b5b5b5;color:#b5b5b5}}
"""
"""Colours of light and dark pages."""


@dataclass
class Panel:
    """One pair of axes, with what is drawn on them."""

    x_label: str
    y_label: str
    title: str = ""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    x_log: bool = False
    y_log: bool = False
    x_names: Sequence[str] = ()  # names of categories at 0, 1, ... instead of numbers
    marks: list[tuple[str, np.ndarray, np.ndarray, int, str]] = field(default_factory=list)

    def line(self, x, y, label: str = "", colour: int = 0, *, dashed: bool = False) -> Panel:
        """Add a line."""
        return self._add("dash" if dashed else "line", x, y, colour, label)

    def band(self, x, low, high, colour: int = 0, label: str = "") -> Panel:
        """Add the area between two lines."""
        x, low, high = (thinned(np.asarray(each, float)) for each in (x, low, high))
        return self._add("band", np.r_[x, x[::-1]], np.r_[high, low[::-1]], colour, label)

    def points(self, x, y, label: str = "", colour: int = 0) -> Panel:
        """Add points."""
        return self._add("points", x, y, colour, label)

    def bars(self, x, y, label: str = "", colour: int = 0) -> Panel:
        """Add bars from 0."""
        return self._add("bars", x, y, colour, label)

    def _add(self, kind: str, x, y, colour: int, label: str) -> Panel:
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        self.marks.append((kind, x, y, colour, label))
        return self

    def limits(self) -> tuple[float, float, float, float]:
        """Return the ranges of both axes."""
        every = [self._range(np.concatenate([m[1] for m in self.marks]), self.x_range, self.x_log, 0.0)]
        ys = [m[2] for m in self.marks] + [np.zeros(1) for m in self.marks if m[0] == "bars"]
        every.append(self._range(np.concatenate(ys), self.y_range, self.y_log, 0.06))
        if self.x_names:
            every[0] = (-0.6, len(self.x_names) - 0.4)
        return (*every[0], *every[1])

    @staticmethod
    def _range(values: np.ndarray, stated: tuple[float, float] | None, log: bool, room: float) -> tuple[float, float]:
        if stated is not None:
            return stated
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        space = 0.0 if log else room * (high - low or 1.0)
        return low - space if low else 0.0, high + space


def thinned(values: np.ndarray) -> np.ndarray:
    """Return at most `MAX_POINTS` values, evenly spaced, the last one included."""
    return values[np.unique(np.linspace(0, len(values) - 1, min(len(values), MAX_POINTS)).astype(int))]


def ticks(low: float, high: float, *, log: bool = False) -> list[float]:
    """Return round numbers within a range."""
    if log:
        first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
        step = -(-(last - first + 1) // MAX_POWERS)
        within = (m * 10.0**power for power in range(first - 1, last + 1) for m in (1.0, 2.0, 5.0))
        fine = [value for value in within if low * (1.0 - 1e-9) <= value <= high * (1.0 + 1e-9)]
        return fine if last - first < 2 else [10.0**power for power in range(first, last + 1, step)]
    raw = (high - low) / 5.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(s * power for s in (1.0, 2.0, 2.5, 5.0, 10.0) if s * power >= raw)
    first = math.ceil(low / step - 1e-9)
    return [step * k for k in range(first, math.floor(high / step + 1e-9) + 1)]


MAX_POWERS = 8
"""Powers of ten on an axis."""


def number(value: float) -> str:
    """Return a tick's label, with a minus sign that a reader sees."""
    power = round(math.log10(abs(value))) if value else 0
    if not -4 < power < 5:
        return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{value:.10g}".replace("-", "−")


def figure(panels: Iterable[Panel], description: str) -> str:
    """Return an SVG of panels side by side; `description` is its title for readers who do not see it."""
    panels = list(panels)
    width = (WIDTH - PANEL_GAP * (len(panels) - 1)) / len(panels)
    body = "".join(drawn(panel, k * (width + PANEL_GAP), width) for k, panel in enumerate(panels))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">'
        f"<title>{escape(description)}</title><style>{STYLE}</style>{body}</svg>\n"
    )


def drawn(panel: Panel, left: float, width: float) -> str:
    """Return the parts of a panel, which begins `left` [px] and is `width` wide [px]."""
    low_x, high_x, low_y, high_y = panel.limits()
    x0, x1, y0 = left + LEFT, left + width - RIGHT, HEIGHT - BOTTOM
    legend, rows = legend_of(panel, x0, x1)
    y1 = TOP + LEGEND_ROW * rows

    def place(values, low: float, high: float, start: float, end: float, *, log: bool) -> np.ndarray:
        values = np.asarray(values, float)
        if log:
            values, low, high = np.log10(np.maximum(values, 1e-300)), math.log10(low), math.log10(high)
        return start + (values - low) / (high - low) * (end - start)

    def at_x(values) -> np.ndarray:
        return place(values, low_x, high_x, x0, x1, log=panel.x_log)

    def at_y(values) -> np.ndarray:
        return np.clip(place(values, low_y, high_y, y0, y1, log=panel.y_log), y1, y0)

    out = [f'<text class="title" x="{x0:.0f}" y="20">{escape(panel.title)}</text>']
    for value in ticks(low_y, high_y, log=panel.y_log):
        y = float(at_y(value))
        out.append(f'<path class="grid" d="M{x0:.0f} {y:.1f}H{x1:.0f}"/>')
        out.append(f'<text x="{x0 - 7:.0f}" y="{y + 5:.1f}" text-anchor="end">{number(value)}</text>')
    for value, name in (
        enumerate(panel.x_names) if panel.x_names else ((v, number(v)) for v in ticks(low_x, high_x, log=panel.x_log))
    ):
        x = float(at_x(value))
        out.append(f'<text x="{x:.1f}" y="{y0 + 19:.0f}" text-anchor="middle">{escape(str(name))}</text>')
        if not panel.x_names:
            out.append(f'<path class="axis" d="M{x:.1f} {y0}v4"/>')
    bars = [mark for mark in panel.marks if mark[0] == "bars"]
    for kind, x, y, colour, _ in panel.marks:
        out.append(mark_of(kind, at_x, at_y, x, y, colour, bars, max(low_y, 0.0)))
    out.append(f'<path class="axis" d="M{x0:.0f} {y1}V{y0}H{x1:.0f}"/>')
    middle = 0.5 * (x0 + x1)
    out.append(f'<text x="{middle:.0f}" y="{HEIGHT - 12}" text-anchor="middle">{escape(panel.x_label)}</text>')
    upright = f"rotate(-90 {left + 18:.0f} {0.5 * (y0 + y1):.0f})"
    out.append(f'<text x="{left + 18:.0f}" y="{0.5 * (y0 + y1):.0f}" text-anchor="middle" transform="{upright}">'
               f"{escape(panel.y_label)}</text>")  # fmt: skip
    out.append(legend)
    return "".join(out)


def mark_of(kind: str, at_x, at_y, x: np.ndarray, y: np.ndarray, colour: int, bars: list, base: float) -> str:
    """Return one mark."""
    if kind == "bars":
        own = next(k for k, bar in enumerate(bars) if bar[3] == colour and bar[1] is x)
        unit = float(at_x(1.0) - at_x(0.0)) * (0.8 if len(x) > 1 or len(bars) > 1 else 0.5)
        each = unit / len(bars)
        zero = float(at_y(base))
        boxes = ""
        for px, py in zip(at_x(x), at_y(y), strict=True):
            top, bottom = min(py, zero), max(py, zero)
            start = px - 0.5 * unit + own * each
            boxes += f"M{start:.1f} {bottom:.1f}V{top:.1f}h{0.92 * each:.1f}V{bottom:.1f}z"
        return f'<path class="c{colour} fill" d="{boxes}"/>'
    if kind == "points":
        dots = "".join(f"M{px:.1f} {py:.1f}m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0"
                       for px, py in zip(at_x(thinned(x)), at_y(thinned(y)), strict=True))  # fmt: skip
        return f'<path class="c{colour} fill" d="{dots}"/>'
    if kind != "band":
        x, y = outline(x, y, MAX_POINTS)
    path = "L".join(f"{px:.1f} {py:.1f}" for px, py in zip(at_x(x), at_y(y), strict=True))
    if kind == "band":
        return f'<path class="c{colour} band" d="M{path}z"/>'
    return f'<path class="line c{colour}{" dash" if kind == "dash" else ""}" d="M{path}"/>'


def legend_of(panel: Panel, x0: float, x1: float) -> tuple[str, int]:
    """Return the labels of marks between title and axes, and how many rows they take."""
    out, x, row = [], x0, 0
    labels = [(kind, colour, label) for kind, _, _, colour, label in panel.marks if label]
    for kind, colour, label in labels:
        width = LEGEND_SYMBOL + CHARACTER_WIDTH * len(label)
        if x > x0 and x + width > x1 + LEGEND_SYMBOL / 2:
            x, row = x0, row + 1
        y = TOP + LEGEND_ROW * row + 8
        symbol = {
            "points": f'<circle class="c{colour} fill" cx="{x + 12:.0f}" cy="{y - 5}" r="3.5"/>',
            "bars": f'<path class="c{colour} fill" d="M{x:.0f} {y - 10}h24v10h-24z"/>',
            "band": f'<path class="c{colour} band" d="M{x:.0f} {y - 10}h24v10h-24z"/>',
        }.get(kind, f'<path class="line c{colour}{" dash" if kind == "dash" else ""}" d="M{x:.0f} {y - 5}h24"/>')
        out.append(f'{symbol}<text x="{x + 29:.0f}" y="{y}">{escape(label)}</text>')
        x += width
    return "".join(out), row + 1 if labels else 0
