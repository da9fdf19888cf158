"""Animated drawings: lines whose points move on a page without a script.

The movement is SVG's own (``<animate>``), so that the figure's own file is animated too. The
drawing is still on paper, in PDF and for readers whose settings reduce motion.

`over_time` draws signals that stand still, one panel beneath another.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from ..drawing.drawing import Drawing, Head, heads, key, line, tidy
from ..drawing.style import FIGURE_WIDTH, colour

MOTION_STYLE = (
    "<style>.rests { display: none } @media (prefers-reduced-motion: reduce), print "
    "{ .rests { display: inline } .moves { display: none } }</style>"
)


@dataclass(frozen=True)
class Way:
    """Positions of a line's points over time, (frames, p, 2) in the coordinates of `axis`; two points make a stroke."""

    axis: Axes
    points: np.ndarray


@dataclass(frozen=True)
class MovingDrawing(Drawing):
    """A figure with moving lines. `ways` holds their motion by gid, which lasts `seconds` and is repeated."""

    ways: Mapping[str, Way]
    seconds: float

    @cached_property
    def svg(self) -> str:
        """Return the figure as an SVG file's text, which moves in a browser."""
        text = self.still_svg()
        for name, way in self.ways.items():
            text = self._moved(text, name, way)
        return text.replace("</svg>", f"{MOTION_STYLE}</svg>")

    def _moved(self, text: str, name: str, way: Way) -> str:
        """Return the text with a moving copy of a line on top of the one that stands still."""
        height = 72.0 * self.figure.get_figheight()
        at = way.axis.transData.transform(way.points.reshape(-1, 2)) * 72.0 / self.figure.dpi
        at = np.column_stack([at[:, 0], height - at[:, 1]]).reshape(way.points.shape)
        values = ";".join(map(_strokes, at))
        found = re.search(rf'<g id="{re.escape(name)}">\s*<path d="[^"]*"([^>]*?)/>\s*</g>', text)
        if found is None:
            raise ValueError(f"{name}: found no line of that name in the figure")
        clip = re.sub(r'\s*clip-path="[^"]*"', "", found[1])
        moving = (
            f'<g class="moves"><path d="{_strokes(at[0])}"{clip}><animate attributeName="d" dur="{self.seconds:.2f}s" '
            f'repeatCount="indefinite" values="{values}"/></path></g>'
        )
        still = found[0].replace("<g ", '<g class="rests" ', 1)
        return text[: found.start()] + still + moving + text[found.end() :]


def strokes(axis: Axes, points: np.ndarray, name: str, **style) -> Artist:
    """Draw strokes between pairs of `points`, (p, 2), as one line with the gid `name`; `style` is Matplotlib's."""
    codes = np.tile([Outline.MOVETO, Outline.LINETO], len(points) // 2)
    patch = PathPatch(Outline(points, codes), fill=False, capstyle="round", joinstyle="round", **style)
    patch.set_gid(name)
    return axis.add_artist(patch)


def cursor(axis: Axes, times: np.ndarray, name: str = "cursor") -> Way:
    """Draw a vertical line that moves over a panel to each of `times`, (frames,); the panel keeps its limits."""
    low, high = axis.get_ylim()
    points = np.stack([np.column_stack([times, np.full(len(times), end)]) for end in (low, high)], axis=1)
    strokes(axis, points[0], name, edgecolor=colour("muted"), linewidth=1.2, zorder=6)
    axis.set_ylim(low, high)
    return Way(axis, points)


def _strokes(points: np.ndarray) -> str:
    return "".join(f"{'ML'[i % 2]}{x:.1f} {y:.1f}" for i, (x, y) in enumerate(points))


@dataclass(frozen=True)
class Traces:
    """One panel of `over_time`."""

    head: str  # name of the panel
    rest: str  # further text above the panel
    time: np.ndarray  # times, shape (n,) [s]
    lines: Mapping[str, np.ndarray]  # signals by label, shape (n,) each
    unit: str  # label of the vertical axis, with its unit


def over_time(
    panels: Sequence[Traces], name: str, *, roles: Mapping[str, str], caption: str, height: float = 2.6
) -> Drawing:
    """Draw signals over time, one panel beneath another."""
    figure = Figure(figsize=(FIGURE_WIDTH, height * len(panels) + 0.3), layout="constrained")
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for axis, panel in zip(axes, panels, strict=True):
        for i, (label, values) in enumerate(panel.lines.items()):
            line(axis, panel.time, values, color=colour(roles[label]), linewidth=2.6 if i == 0 else 1.3)
        axis.axhline(0.0, color=colour("faint"), linewidth=0.8, zorder=1)
        tidy(axis, first=True, text=panel.unit, ticks=5)
        heads([axis], [Head(panel.head, panel.rest, colour("muted"))])
        key(axis, [(label, colour(roles[label])) for label in panel.lines])
    axes[-1].set_xlabel("Time (s)")
    return Drawing(name, figure, caption)
