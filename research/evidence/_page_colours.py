"""Distances between colours as people see them who lack one kind of cone, and contrast of text."""

from __future__ import annotations

import numpy as np

DEFICIENT_SIGHT = {
    "none": np.eye(3),
    "protan": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deutan": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritan": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""Matrices on linear RGB of full deficiency, by Machado, Oliveira and Fernandes (2009)."""

_RGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
_WHITE_XYZ = np.array([0.95047, 1.0, 1.08883])


def rgb(text: str) -> np.ndarray:
    """Return the components, (3,), of a colour such as #1c2126, from 0 to 1."""
    return np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0


def linear(components: np.ndarray) -> np.ndarray:
    """Return linear RGB of sRGB components."""
    return np.where(components <= 0.04045, components / 12.92, ((components + 0.055) / 1.055) ** 2.4)


def srgb_to_lab(components: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* of sRGB components, (..., 3)."""
    return _linear_to_lab(linear(np.asarray(components, float)))


def simulated_lab(components: np.ndarray, sight: str) -> np.ndarray:
    """Return CIE L*a*b* of sRGB components, (..., 3), as a kind of `DEFICIENT_SIGHT` sees them."""
    return _linear_to_lab(np.clip(linear(np.asarray(components, float)) @ DEFICIENT_SIGHT[sight].T, 0.0, 1.0))


def _linear_to_lab(values: np.ndarray) -> np.ndarray:
    share = values @ _RGB_TO_XYZ.T / _WHITE_XYZ
    root = np.where(share > 216.0 / 24389.0, np.cbrt(share), (24389.0 / 27.0 * share + 16.0) / 116.0)
    x, y, z = np.moveaxis(root, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def delta_e(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return CIEDE2000 between L*a*b* colours, (..., 3)."""
    (l1, a1, b1), (l2, a2, b2) = np.moveaxis(np.asarray(first), -1, 0), np.moveaxis(np.asarray(second), -1, 0)
    mean_c = 0.5 * (np.hypot(a1, b1) + np.hypot(a2, b2))
    g = 0.5 * (1.0 - np.sqrt(mean_c**7 / (mean_c**7 + 25.0**7)))
    a1, a2 = (1.0 + g) * a1, (1.0 + g) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360.0, np.degrees(np.arctan2(b2, a2)) % 360.0
    turn = (h2 - h1 + 180.0) % 360.0 - 180.0
    turn = np.where(c1 * c2 == 0.0, 0.0, turn)
    dl, dc, dh = l2 - l1, c2 - c1, 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(0.5 * turn))
    lightness, c = 0.5 * (l1 + l2), 0.5 * (c1 + c2)
    h = np.where(c1 * c2 == 0.0, h1 + h2, h1 + 0.5 * turn) % 360.0
    t = 1.0 - 0.17 * np.cos(np.radians(h - 30.0)) + 0.24 * np.cos(np.radians(2.0 * h))
    t += 0.32 * np.cos(np.radians(3.0 * h + 6.0)) - 0.20 * np.cos(np.radians(4.0 * h - 63.0))
    s_l = 1.0 + 0.015 * (lightness - 50.0) ** 2 / np.sqrt(20.0 + (lightness - 50.0) ** 2)
    s_c, s_h = 1.0 + 0.045 * c, 1.0 + 0.015 * c * t
    bend = 60.0 * np.exp(-(((h - 275.0) / 25.0) ** 2))
    r_t = -2.0 * np.sqrt(c**7 / (c**7 + 25.0**7)) * np.sin(np.radians(bend))
    return np.sqrt((dl / s_l) ** 2 + (dc / s_c) ** 2 + (dh / s_h) ** 2 + r_t * (dc / s_c) * (dh / s_h))


def colour_distance(first: str, second: str) -> float:
    """Return the smallest CIEDE2000 between two colours in protan, deutan and tritan sight."""
    pair = np.stack([rgb(first), rgb(second)])
    kinds = (kind for kind in DEFICIENT_SIGHT if kind != "none")
    return min(float(delta_e(*simulated_lab(pair, kind))) for kind in kinds)


def contrast(first: str, second: str) -> float:
    """Return the contrast of two colours by WCAG: 1 for the same, 21 for black on white."""
    dark, light = sorted(float(linear(rgb(text)) @ [0.2126, 0.7152, 0.0722]) for text in (first, second))
    return (light + 0.05) / (dark + 0.05)
