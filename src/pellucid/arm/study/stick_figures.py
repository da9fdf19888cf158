"""Draw an arm as a stick figure: links as lines, joints as circles with their axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ...models.kinematic_tree import Tree
from ...study.drawing.style import colour
from ...study.pages.moving import Way, strokes

FRAME_COUNT = 120
"""Number of frames of the moving figure."""

MAX_SHOWN_S = 20.0
"""Longest part of a recording that is shown [s]."""

GHOST_COUNT = 6
"""Number of poses that are drawn faintly behind the moving figure."""

VIEW_COUNT = 24
"""Number of viewing directions that are tried."""

VIEW_ELEVATION_RAD = np.radians(20.0)
"""Elevation of the viewing directions [rad]."""

STUB_LENGTH_SHARE = 0.1
"""Length of a last link beyond its joint, and of a joint's drawn axis, as a share of the arm's reach."""


def stick_figure(
    axis: Axes, tree: Tree, time: np.ndarray, position: np.ndarray, *, worst: str = "", name: str = "arm"
) -> tuple[dict[str, Way], float]:
    """Draw the arm along a recording with `time`, (n,) [s], and `position`, (n, m) [rad; m].

    The joint `worst` is highlighted. Returns the moving parts, and the duration [s].
    """
    shown = np.flatnonzero(time - time[0] <= MAX_SHOWN_S)
    dense = np.unique(np.linspace(shown[0], shown[-1], 4 * FRAME_COUNT).astype(int))
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
    for i in np.linspace(0, len(links) - 1, GHOST_COUNT + 1).astype(int)[1:]:
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
    """Return the ends of the strokes of links, (n, 2 links + 2, 3) [m], and of joint axes, (n, 2 m, 3) [m].

    The last pair of the links belongs to the end of the outermost link.
    """
    number = {tree.base: -1} | {joint.child: i for i, joint in enumerate(tree.order)}
    frames = tree.core.placements(position)
    places = np.concatenate([frames[..., 3], np.zeros((len(frames), 1, 3))], axis=1)  # the base is the last, number -1
    pairs = [index for joint in tree.order for index in (number[joint.parent], number[joint.child])]
    links = places[:, pairs]
    reach = float(np.linalg.norm(links[:, 0::2] - links[:, 1::2], axis=2).sum(axis=1).max())
    pins = []
    for i in _moves(tree):
        turned = frames[:, i, :, :3] @ np.asarray(tree.order[i].axis, float)
        pins += [
            places[:, i] - 0.4 * STUB_LENGTH_SHARE * reach * turned,
            places[:, i] + 0.4 * STUB_LENGTH_SHARE * reach * turned,
        ]
    last = _moves(tree)[-1]
    end = places[:, len(tree.order) - 1]
    stub = end + STUB_LENGTH_SHARE * reach * frames[:, last, :, :3] @ np.asarray(tree.order[last].axis, float)
    links = np.concatenate([links, end[:, None], stub[:, None]], axis=1)
    return links, np.stack(pins, axis=1)


def _view(points: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the two directions, (2, 3), onto which `points`, (n, p, 3), are projected, in the view that shows the most
    movement."""
    first = np.cross(up, [1.0, 0.0, 0.0] if abs(up[0]) < 0.9 else [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    moved = points.reshape(-1, 3) - points.reshape(-1, 3).mean(axis=0)
    turns = 2.0 * np.pi * np.arange(VIEW_COUNT) / VIEW_COUNT
    rights = [np.cos(turn) * first + np.sin(turn) * second for turn in turns]
    right = max(rights, key=lambda direction: round(float(np.var(moved @ direction)), 9))
    towards = np.cross(right, up)
    return np.stack([right, np.cos(VIEW_ELEVATION_RAD) * up - np.sin(VIEW_ELEVATION_RAD) * towards])


def _dots(points: np.ndarray) -> np.ndarray:
    """Return strokes of almost no length, (n, 2 p, 2); their round ends appear as dots."""
    tiny = np.array([1e-4, 0.0]) * np.ptp(points)
    return np.stack([points, points + tiny], axis=2).reshape(len(points), -1, 2)
