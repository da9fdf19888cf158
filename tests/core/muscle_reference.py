"""Several Hill muscles in plain NumPy, written from the equations: what the core is held against."""

import numpy as np

NAMES = (
    "shape", "time_constant_1", "time_constant_2", "delay", "optimal_fibre_length", "tendon_slack_length", "strength",
    "optimal_length_shift", "max_velocity", "force_length_width", "passive_scale", "max_isometric_force", "pennation",
    "damping", "curvature", "eccentric_force", "passive_strain", "passive_shape",
)  # fmt: skip


def random_muscles(rng, count=3):
    low = [-3, 0.005, 0.005, 0.0, 0.05, 0.1, 0.5, 0.0, 5, 0.3, 0, 500, 0, 0, 0.15, 1.2, 0.4, 2]
    high = [-0.1, 0.05, 0.05, 0.08, 0.15, 0.4, 2.0, 0.25, 15, 0.7, 2, 2000, 0.4, 0.2, 0.4, 1.8, 0.8, 5]
    return rng.uniform(low, high, (count, 18))


def random_motion(rng, muscles, samples, period):
    """Envelopes, lengths, rates and moment arms that stay clear of corners such as a slack tendon."""
    t = period * np.arange(samples)
    phase = rng.uniform(0, 6, (len(muscles), 1))
    excitation = 0.5 + 0.4 * np.sin(7.0 * t + phase) + 0.05 * np.sin(31.0 * t + 2.0 * phase)
    optimal, slack = muscles[:, 4:5], muscles[:, 5:6]
    length = slack + optimal * (1.0 + 0.35 * np.sin(5.0 * t + 3.0 * phase))
    rate = optimal * 0.35 * 5.0 * np.cos(5.0 * t + 3.0 * phase)
    return excitation, length, rate, 0.04 + 0.01 * np.sin(t + phase)


def delayed(x, samples):
    """Cubic Hermite interpolation with central slopes, the first sample standing for all before it."""
    whole = int(np.floor(samples))
    s = samples - whole
    padded = np.concatenate([np.full(whole + 3, x[0]), x])
    now = np.arange(len(x)) + whole + 3
    newer, older = padded[now - whole], padded[now - whole - 1]
    newest = padded[now - whole + 1] if whole else newer
    slope_newer = (older - newest) / (2.0 if whole else 1.0)
    slope_older = (padded[now - whole - 2] - newer) / 2.0
    return (
        (2 * s**3 - 3 * s**2 + 1) * newer
        + (s**3 - 2 * s**2 + s) * slope_newer
        + (3 * s**2 - 2 * s**3) * older
        + (s**3 - s**2) * slope_older
    )


def activation(row, excitation, period):
    p = dict(zip(NAMES, row, strict=True))
    e = np.clip(delayed(excitation, p["delay"] / period), 0.0, 1.0)
    c1, c2 = (-np.exp(-period / p[f"time_constant_{i}"]) for i in (1, 2))
    b1, b2 = c1 + c2, c1 * c2
    u = np.empty_like(e)
    before = [e[0], e[0]]
    for k, x in enumerate(e):
        u[k] = (1 + b1 + b2) * x - b1 * before[0] - b2 * before[1]
        before = [u[k], before[0]]
    return np.expm1(p["shape"] * u) / np.expm1(p["shape"])


def force(row, a, length, rate):
    p = dict(zip(NAMES, row, strict=True))
    lo = p["optimal_fibre_length"]
    along = np.maximum(length - p["tendon_slack_length"], 0.1 * lo)
    fibre = np.hypot(along, lo * np.sin(p["pennation"]))
    cosine = along / fibre
    v = rate * cosine / (p["max_velocity"] * lo)
    g, curve = p["eccentric_force"], p["curvature"]
    c = curve * (g - 1) / (curve + 1)
    slow, fast = np.clip(v, -1, 0), np.maximum(v, 0)
    f_v = np.where(v <= 0, (1 + slow) / (1 - slow / curve), (g * fast + c) / (fast + c))
    f_l = np.exp(-((fibre / (lo * (p["optimal_length_shift"] * (1 - a) + 1)) - 1) ** 2) / p["force_length_width"])
    k, e0 = p["passive_shape"], p["passive_strain"]
    strain = np.clip(fibre / lo - 1, 0, e0)
    over = np.maximum(fibre / lo - 1 - e0, 0)
    f_p = (np.exp(k * strain / e0) - 1 + over * k / e0 * np.exp(k)) / (np.exp(k) - 1)
    n = a * f_l * f_v + p["passive_scale"] * f_p + p["damping"] * v
    return p["strength"] * p["max_isometric_force"] * np.maximum(n, 0) * cosine


def torque(muscles, excitation, length, rate, moment_arm, period):
    return sum(
        arm * force(row, activation(row, e, period), at, v)
        for row, e, at, v, arm in zip(muscles, excitation, length, rate, moment_arm, strict=True)
    )
