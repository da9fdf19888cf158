"""Unit quaternions, w first: products, and the turn about an axis that is in them.

Products are written out. SciPy's `Rotation`, which takes seven times as long, rounds them otherwise, and a fit of two
poles to a strap multiplies that difference by 10^10.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def multiply(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Hamilton's product. `left`, `right` (..., 4); gives (..., 4)."""
    a, b, c, d = np.moveaxis(np.asarray(left, float), -1, 0)
    w, x, y, z = np.moveaxis(np.asarray(right, float), -1, 0)
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )


def conjugate(quaternions: np.ndarray) -> np.ndarray:
    """The opposite turns, shape (..., 4)."""
    return np.asarray(quaternions, float) * np.array([1.0, -1.0, -1.0, -1.0])


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """The same turns, shape (n, 4), each with the sign that is nearer to the one before it."""
    dots = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    return quaternions * np.cumprod(np.concatenate(([1.0], np.where(dots < 0.0, -1.0, 1.0))))[:, None]


def angular_steps(quaternions: np.ndarray) -> np.ndarray:
    """Turn from each sample to the next, in the frame that the quaternions lead to. `quaternions` (n, 4); gives (n -
    1, 3) [rad]."""
    turns = Rotation.from_quat(quaternions, scalar_first=True)
    return (turns[1:] * turns[:-1].inv()).as_rotvec()


def twist(quaternions: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Angle of the part of each turn that is about `axis`, unwrapped. `quaternions` (n, 4); `axis` (3,); gives (n,)
    [rad]."""
    near = continuous(quaternions)
    return np.unwrap(2.0 * np.arctan2(near[:, 1:] @ axis, near[:, 0]))
