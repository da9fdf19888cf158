"""An arm as a stick figure: links as lines, joints as circles with their axes, drawn from the tree alone."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ...drawing.style import colour
from ...models.kinematic_tree import Tree
from ...pages.moving import Way, strokes

FRAMES, LONGEST = 120, 20.0
"""Of the movement, and seconds of a recording that are shown."""

GHOSTS = 6
"""Poses that stand faintly behind the one that moves."""

AZIMUTHS, ELEVATION = 24, np.radians(20.0)
"""Directions to look from that are tried, and how far from above."""

STUB = 0.1
"""How far a last link goes on along its axis, and how long a joint's axis is drawn, of the arm's reach."""


def stick_figure(
    axis: Axes, tree: Tree, time: np.ndarray, position: np.ndarray, *, worst: str = "", name: str = "arm"
) -> tuple[dict[str, Way], float]:
    """Draw the arm along a recording, `time` (n,) [s], `position` (n, m) [rad; m]; the joint `worst` stands out. Gives
    what moves, and for how long [s]."""
    shown = np.flatnonzero(time - time[0] <= LONGEST)
    dense = np.unique(np.linspace(shown[0], shown[-1], 4 * FRAMES).astype(int))
    frames = dense[::4]
    links, pins = _lines(tree, position[dense])
    up = -np.asarray(tree.gravity, float)
    view = _view(links, up / np.linalg.norm(up) if np.any(up) else np.array([0.0, 0.0, 1.0]))
    links, pins = links @ view.T, pins @ view.T
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_axis_off()
    everywhere = np.concatenate([links.reshape(-1, 2), pins.reshape(-1, 2)])
    axis.update_datalim(everywhere)
    axis.margins(0.06)
    axis.autoscale_view()
    axis.plot(*links[:, -1].T, color=colour("fitted"), linewidth=0.8, alpha=0.45)
    base, reach = links[0, 0], float(np.ptp(everywhere, axis=0).max())
    axis.plot(base[0] + np.array([-0.09, 0.09]) * reach, [base[1], base[1]], color=colour("muted"), linewidth=3.0)
    links, pins = links[::4], pins[::4]
    for i in np.linspace(0, len(links) - 1, GHOSTS + 1).astype(int)[1:]:
        strokes(axis, links[i], f"{name}-ghost-{i}", edgecolor=colour("rule"), linewidth=3.0, zorder=1)
    joints = links[:, 1::2][:, _moves(tree)]
    parts = {
        f"{name}-links": (links, {"edgecolor": colour("measured"), "linewidth": 6.0, "zorder": 4}),
        f"{name}-axes": (pins, {"edgecolor": colour("fitted"), "linewidth": 2.0, "zorder": 5}),
        f"{name}-joints": (_dots(joints), {"edgecolor": colour("fitted"), "linewidth": 11.0, "zorder": 6}),
        f"{name}-centres": (_dots(joints), {"edgecolor": colour("paper"), "linewidth": 5.0, "zorder": 7}),
    }
    marked = [k for k, joint in enumerate(tree.moving) if joint.name == worst]
    if marked:
        style = {"edgecolor": colour("heldout"), "linewidth": 5.0, "zorder": 8}
        parts[f"{name}-worst"] = (_dots(joints[:, marked]), style)
    for gid, (points, style) in parts.items():
        strokes(axis, points[0], gid, **style)
    return {gid: Way(axis, points) for gid, (points, _) in parts.items()}, float(time[frames[-1]] - time[frames[0]])


def _moves(tree: Tree) -> np.ndarray:
    return np.flatnonzero([joint.kind != "fixed" for joint in tree.order])


def _lines(tree: Tree, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the strokes of links and of joints' axes, (n, 2 links + 2, 3) and (n, 2 m, 3) [m]; the last pair is of
    the link that is furthest out."""
    number = {tree.base: -1} | {joint.child: i for i, joint in enumerate(tree.order)}
    frames = tree.core.placements(position)
    places = np.concatenate([frames[..., 3], np.zeros((len(frames), 1, 3))], axis=1)  # the base is the last, number -1
    pairs = [index for joint in tree.order for index in (number[joint.parent], number[joint.child])]
    links = places[:, pairs]
    reach = float(np.linalg.norm(links[:, 0::2] - links[:, 1::2], axis=2).sum(axis=1).max())
    pins = []
    for i in _moves(tree):
        turned = frames[:, i, :, :3] @ np.asarray(tree.order[i].axis, float)
        pins += [places[:, i] - 0.4 * STUB * reach * turned, places[:, i] + 0.4 * STUB * reach * turned]
    last = _moves(tree)[-1]
    end = places[:, len(tree.order) - 1]
    stub = end + STUB * reach * frames[:, last, :, :3] @ np.asarray(tree.order[last].axis, float)
    links = np.concatenate([links, end[:, None], stub[:, None]], axis=1)
    return links, np.stack(pins, axis=1)


def _view(points: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Two directions, (2, 3), onto which `points` (n, p, 3) are drawn: from where most of the movement shows."""
    first = np.cross(up, [1.0, 0.0, 0.0] if abs(up[0]) < 0.9 else [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    moved = points.reshape(-1, 3) - points.reshape(-1, 3).mean(axis=0)
    turns = 2.0 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    rights = [np.cos(turn) * first + np.sin(turn) * second for turn in turns]
    right = max(rights, key=lambda direction: round(float(np.var(moved @ direction)), 9))
    towards = np.cross(right, up)
    return np.stack([right, np.cos(ELEVATION) * up - np.sin(ELEVATION) * towards])


def _dots(points: np.ndarray) -> np.ndarray:
    """Strokes of next to no length, (n, 2 p, 2), whose round ends are dots."""
    tiny = np.array([1e-4, 0.0]) * np.ptp(points)
    return np.stack([points, points + tiny], axis=2).reshape(len(points), -1, 2)
