"""Recordings of a series-elastic bench: the output is locked, and the motor is pushed against the spring.

The deflection is prescribed: torque levels that are held, then a sine whose frequency rises. The torque follows from
the spring, a damper, a Dahl bristle and a gap. Encoders and torque sensor have noise, an offset and quanta.
"""

import numpy as np

RATE_HZ = 250.0


def bench(
    seed,
    *,
    stiffness=2500.0,
    largest=40.0,
    seconds=24.0,
    hysteresis=0.0,
    backlash=0.0,
    damping_share=0.002,
    quantum=2.0 * np.pi / 2**17,
    torque_noise=0.05,
    torque_quantum=0.01,
    torque_offset=0.3,
    lock=0.4,
    lock_stiffness=np.inf,
):
    """Return time [s], motor's and output's angle [rad], and torque [N*m], each (n,)."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    half = n // 2
    levels = rng.permutation([0.3, -0.3, 0.6, -0.6, 1.0, -1.0, 0.8, -0.8]) * largest
    wanted = np.repeat(levels, half // 8 + 1)[:half]
    rest = t[: n - half]
    growth = np.log(3.0 / 0.1)
    turn = 2.0 * np.pi * 0.1 * rest[-1] / growth * (np.exp(rest / rest[-1] * growth) - 1.0)
    wanted = np.concatenate([wanted, 0.8 * largest * np.sin(turn)])
    smooth = np.exp(-0.5 * (np.arange(-30, 31) / 8.0) ** 2)
    wanted = np.convolve(np.pad(wanted, 30, "edge"), smooth / smooth.sum(), "valid")
    # The motor crosses the gap where the torque changes its sign.
    q = wanted / stiffness + 0.5 * backlash * np.tanh(wanted / (0.02 * largest))
    v = np.gradient(q, t)
    bend = np.zeros(n)
    if hysteresis:
        for i in range(1, n):
            step = q[i] - q[i - 1]
            bend[i] = np.sign(step) - (np.sign(step) - bend[i - 1]) * np.exp(-abs(step) * stiffness / (0.02 * largest))
    past = q - np.clip(q, -0.5 * backlash, 0.5 * backlash)
    torque = stiffness * past + damping_share * stiffness * v + hysteresis * bend
    output = lock + torque / lock_stiffness
    motor = output + q

    def read(x, step, noise):
        return np.round((x + noise * rng.standard_normal(n)) / step) * step

    return (
        t,
        read(motor, quantum, 0.5 * quantum),
        read(output, quantum, 0.5 * quantum),
        read(torque + torque_offset, torque_quantum, torque_noise),
    )


def write_bench(folder, columns, *, seeds=(1, 2, 3), **options):
    """Write a file for each seed with the given columns: header by "time", "motor", "output" or "torque"."""
    files = []
    for seed in seeds:
        made = dict(zip(("time", "motor", "output", "torque"), bench(seed, **options), strict=True))
        path = folder / f"bench_{seed}.csv"
        rows = np.column_stack([made[source] for source in columns.values()])
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
        files.append(path)
    return files
