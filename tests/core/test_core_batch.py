"""Joints in lanes: the bits of one by one, on every instruction set this machine has."""

import os
import subprocess
import sys

import numpy as np
import numpy_reference as reference
import pytest

from pellucid import _core


def settings(rng, m, n):
    t = 1e-3 * np.arange(n)
    return dict(
        reference=np.sin(4 * t) + 0.1 * rng.standard_normal((m, 1)) * np.sin(20 * t),
        injected=0.2 * np.sin(11 * t),
        encoder_noise=1e-5 * rng.standard_normal((m, n)),
        period=1e-3, substeps=3, loop="cascade", kp=rng.uniform(5, 15, m), kv=1.0, ki=2.0, limit=3.0, velocity_span=2,
        encoder_quantum=1e-4, ripple_amplitude=rng.uniform(0, 0.1, m), ripple_wave_number=12.0,
        position0=rng.uniform(-1, 1, m), velocity0=0.1,
    )  # fmt: skip


def row(settings, i):
    def one(value):
        return (
            value[i]
            if isinstance(value, np.ndarray) and (value.ndim == 2 or value.size != settings["reference"].shape[-1])
            else value
        )

    return {name: one(value) for name, value in settings.items()}


@pytest.mark.parametrize("stiction", [False, True])
@pytest.mark.parametrize("m", [0, 1, 2, 7, 33, 70])
def test_batch_has_the_bits_of_single_runs(m, stiction, rng):
    p = np.array([reference.random_parameters(rng) for _ in range(m)]).reshape(m, len(reference.NAMES))
    p[1::4, 8] = 0  # some rows without some terms: shortcuts for all lanes may not change a bit
    p[2::4, 10:14] = 0
    p[3::4, 1:3] = 0
    s = settings(rng, m, 300)
    batch = _core.simulate_batch(p, stiction=stiction, **s)
    assert all(out.shape == (m, 300) for out in batch)
    for i in range(m):
        for one, many in zip(_core.simulate(p[i], stiction=stiction, **row(s, i)), batch, strict=True):
            np.testing.assert_array_equal(one, many[i])


def test_threads_change_nothing(rng):
    p = np.array([reference.random_parameters(rng) for _ in range(150)])
    s = settings(rng, 150, 200)
    for one, two in zip(_core.simulate_batch(p, **s), _core.simulate_batch(p, threads=2, **s), strict=True):
        np.testing.assert_array_equal(one, two)


PROGRAM = """
import sys
import numpy as np
sys.path.insert(0, {folder!r})
import numpy_reference as reference
import test_core_batch
from pellucid import _core
rng = np.random.default_rng(1)
p = np.array([reference.random_parameters(rng) for _ in range(40)])
s = test_core_batch.settings(rng, 40, 200)
out = [*_core.simulate_batch(p, **s), *_core.simulate(p[0], **test_core_batch.row(s, 0))]
out += _core.simulate_jacobian(p[0], active=range(len(reference.NAMES)), **test_core_batch.row(s, 0))
out += _core.inverse_dynamics_jacobian(p[0], *rng.uniform(-3, 3, (3, 500)), np.arange(len(reference.NAMES)))
import hashlib
print(_core.instructions, hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in out)).hexdigest())
"""


def test_instruction_sets_give_the_same_bits():
    seen = {}
    for wanted in ("baseline", "avx2", "avx512"):
        environment = os.environ | {"PELLUCID_INSTRUCTIONS": wanted}
        program = PROGRAM.format(folder=os.path.dirname(__file__))
        answer = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
        )
        instructions, digest = answer.stdout.split()
        seen[instructions] = digest
    assert "baseline" in seen
    assert len(set(seen.values())) == 1, seen
