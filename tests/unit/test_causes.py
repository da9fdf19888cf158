"""Causes of what a joint's model misses: each is named where a recording has it, with its size, and no other one.

Motions are prescribed, and efforts follow from equations that are written here.
"""

from functools import cache

import numpy as np
import pytest

import pellucid as pl
from pellucid.joint.study.fit_joint import JointFit
from pellucid.models.causes import CAUSE_NAMES, Cause
from pellucid.study.cause_words import WORDS, cause_sentence

RATE = 200.0
INERTIA, GRAVITY, VISCOUS, COULOMB = 0.06, 2.2, 0.11, 0.22
STIFFNESS = 0.2


@cache
def motion(seed: int = 3, size: float = 0.8) -> tuple[np.ndarray, ...]:
    """Return time, angle, velocity and acceleration of a sum of five sines."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(60 * RATE)) / RATE
    w = 2.0 * np.pi * np.array([0.11, 0.29, 0.53, 0.97, 1.7]) * rng.uniform(0.9, 1.1, 5)
    a = size * np.array([0.7, 0.35, 0.2, 0.1, 0.05])
    phase = np.outer(t, w) + rng.uniform(0.0, 2.0 * np.pi, 5)
    return t, 0.1 + np.sin(phase) @ a, np.cos(phase) @ (a * w), -np.sin(phase) @ (a * w**2)


def effort(q, v, a, friction=COULOMB) -> np.ndarray:
    return INERTIA * a + GRAVITY * np.sin(q) + VISCOUS * v + friction * np.tanh(v / 0.005)


def noisy(u: np.ndarray, seed: int = 4) -> np.ndarray:
    return u + 0.01 * u.std() * np.random.default_rng(seed).standard_normal(len(u))


def fit(t, q, u, **options) -> JointFit:
    return pl.fit_joint(t, q, u, lowpass=10.0, decimate=5, thorough=False, **options)


def found(u: np.ndarray, position: np.ndarray | None = None) -> dict[str, Cause]:
    t, q, *_ = motion()
    return {cause.name: cause for cause in fit(t, q if position is None else position, u).causes}


def test_a_plain_joint_has_no_cause():
    assert found(noisy(effort(*motion()[1:]))) == {}


def test_a_parallel_spring_is_a_term_and_gravity_is_without_it():
    t, q, v, a = motion()
    u = effort(q, v, a) + STIFFNESS * (q - 0.2)
    joint = fit(t, q, noisy(u))
    (cause,) = joint.causes
    assert (cause.name, cause.unit) == ("parallel_spring", "N*m/rad")
    assert cause.size == pytest.approx(STIFFNESS, rel=0.15)
    assert 0.1 < cause.share <= 1.0
    for name, true in (("gravity", GRAVITY), ("parallel_stiffness", STIFFNESS)):
        low, high = joint[name].interval(0.95)
        assert low <= true <= high
    # What is predicted, simulated and compensated has the spring too.
    inner = slice(100, -100)
    assert np.median(np.abs((joint.predict(t, q) - u)[inner])) < 0.01 * u.std()
    assert joint.card().model().vector(joint.array)[-1] == joint["parallel_stiffness"].value
    law = pl.controller(joint, period=1e-3)
    assert law.values["parallel_stiffness"] == joint["parallel_stiffness"].value


@pytest.mark.parametrize(
    "shape",
    [
        lambda q: 0.05 * q**2,
        lambda q: 0.003 * q**3,  # a spring, without a least share that it has to save
        lambda q: 0.02 * np.sin(2.0 * q),  # a spring that pushes from its middle, and explains a third of the residual
    ],
)
def test_an_effort_of_another_shape_than_a_springs_is_none(shape):
    _, q, v, a = motion()
    assert "parallel_spring" not in found(noisy(effort(q, v, a) + shape(q)))


@pytest.mark.parametrize(("size", "twist"), [(0.5, 100.0), (0.8, 100.0), (0.8, 40.0), (1.2, 40.0)])
@pytest.mark.parametrize("seed", [3, 5])
def test_a_transmission_that_twists_is_no_clear_spring(size, twist, seed):
    """The encoder is on the motor's side: the load turns the body by load / stiffness, and gravity acts there."""
    t, q, v, a = motion(seed, size)
    load = INERTIA * a + GRAVITY * np.sin(q)
    turned = load / twist
    u = effort(q, v, a) - INERTIA * np.gradient(np.gradient(turned, t), t) - GRAVITY * np.cos(q) * turned
    joint = fit(t, q, noisy(u))
    springs = [cause for cause in joint.causes if cause.name == "parallel_spring"]
    assert all(spring.may_twist for spring in springs)
    low, high = joint["gravity"].interval(0.95)
    assert springs or low <= GRAVITY <= high


@pytest.mark.parametrize(("size", "may_twist"), [(0.5, True), (1.2, False)])
def test_a_spring_over_a_small_range_may_be_a_transmission_that_twists(size, may_twist):
    t, q, v, a = motion(3, size)
    (cause,) = fit(t, q, noisy(effort(q, v, a) + STIFFNESS * (q - 0.2))).causes
    assert (cause.name, cause.may_twist) == ("parallel_spring", may_twist)
    assert cause_sentence(cause).endswith(", or a transmission that twists?") == may_twist


def test_parts_that_rattle_across_a_gap_are_backlash():
    """Each turn of the load rattles with a phase of its own: no column predicts it."""
    t, q, v, a = motion()
    load, rng = INERTIA * a + GRAVITY * np.sin(q), np.random.default_rng(5)
    u = effort(q, v, a)
    for start in t[1:][np.diff(np.sign(load)) != 0.0]:
        since = np.maximum(t - start, 0.0)
        rattle = np.sin(2.0 * np.pi * 7.0 * since + rng.uniform(0.0, 2.0 * np.pi)) * np.exp(-since / 0.08)
        u += 0.3 * COULOMB * (t >= start) * rattle
    causes = found(noisy(u))
    assert list(causes) == ["backlash"]
    # Rattling shows that there is a gap. Its width acts on no column, and none is stated.
    assert np.isnan(causes["backlash"].size)
    assert cause_sentence(causes["backlash"]).startswith("Backlash, whose width is unknown, explains ")


def test_the_core_moves_a_joint_with_its_spring():
    from pellucid.models.joint import joint_model
    from pellucid.models.simulate import LoopSetting, simulate

    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="none", parallel_spring=True)
    values = [{"inertia": 0.5, "parallel_stiffness": 2.0}.get(name, 0.0) for name in model.names]
    t = np.arange(4000) * 1e-3
    trace = simulate(model.vector(np.array(values)), np.zeros(4000), 1e-3, loop=LoopSetting(), position0=0.3)
    np.testing.assert_allclose(trace.position, 0.3 * np.cos(2.0 * t), atol=1e-3)


def test_over_a_small_range_gravitys_interval_has_room_for_a_spring():
    t, q, v, a = motion(size=0.12)
    plain, sprung = (fit(t, q, noisy(u)) for u in (effort(q, v, a), effort(q, v, a) + STIFFNESS * (q - 0.2)))
    assert sprung.causes == plain.causes == ()
    for joint in (plain, sprung):
        low, high = joint["gravity"].interval(0.95)
        assert low <= GRAVITY <= high
        assert 0.1 < 0.5 * (high - low) / GRAVITY < 0.4
    assert any("spring" in verdict.text and "range" in verdict.do for verdict in sprung.verdicts)


def test_gravitys_interval_has_room_for_a_transmission_that_twists():
    """The encoder is on the motor, and gravity acts at the angle of the link, which the load turns by up to 1.3 deg."""
    t, q, v, a = motion(size=1.2)
    load, stiffness = INERTIA * a + GRAVITY * np.sin(q), 100.0
    twist = load / stiffness
    u = effort(q, v, a) - INERTIA * np.gradient(np.gradient(twist, t), t) - GRAVITY * np.cos(q) * twist
    low, high = fit(t, q, noisy(u))["gravity"].interval(0.95)
    assert low <= GRAVITY <= high


def test_a_gain_that_drifts_is_a_drift():
    t, *states = motion()
    drifting = found(noisy(effort(*states) * (1.0 + 0.12 * t / t[-1])))
    assert list(drifting) == ["drift"]
    assert drifting["drift"].size == pytest.approx(12.0, rel=0.2)
    assert drifting["drift"].unit == "%"


def test_friction_that_falls_is_a_warm_up():
    t, *states = motion()
    warming = found(noisy(effort(*states, friction=COULOMB * (1.3 - 0.6 * t / t[-1]))))
    assert list(warming) == ["warm_up"]
    assert warming["warm_up"].size == pytest.approx(-0.6 * COULOMB, rel=0.35)


def test_friction_that_rises_is_no_warm_up():
    t, *states = motion()
    assert list(found(noisy(effort(*states, friction=COULOMB * (0.7 + 0.6 * t / t[-1]))))) == ["drift"]


def soft_friction(q, v, a, load_share: float) -> np.ndarray:
    """Return friction that grows with the load and builds up over a travel, as that of a gear does."""
    level = COULOMB + load_share * np.abs(INERTIA * a + GRAVITY * np.sin(q))
    way = np.exp(-60.0 * np.abs(v) / RATE / level)
    friction, made = 0.0, np.empty(len(v))
    for i, kept in enumerate(way):
        end = np.sign(v[i]) * level[i]
        made[i] = friction = end + (friction - end) * kept
    return made


@pytest.mark.parametrize("seed", [109, 138, 157])
def test_friction_of_a_gear_that_grows_with_its_load_has_no_other_cause(seed):
    """A model without load friction misses much, and inertia and weight are wrong: every column explains some of it."""
    t, q, v, a = (x[: int(30 * RATE)] for x in motion(seed))
    u = effort(q, v, a, friction=0.0) + soft_friction(q, v, a, 0.25)
    noise = 0.002 * u.std() * np.random.default_rng(seed + 1).standard_normal(len(u))
    assert fit(t, q, u + noise).causes == ()


def test_a_share_leaves_out_what_load_friction_explains():
    t, q, v, a = motion()
    warming = COULOMB * (1.3 - 0.6 * t / t[-1]) + 0.3 * np.abs(INERTIA * a + GRAVITY * np.sin(q))
    (cause,) = found(noisy(effort(q, v, a, friction=warming))).values()
    assert cause.name == "warm_up"
    assert cause.size == pytest.approx(-0.6 * COULOMB, rel=0.35)
    assert 0.05 < cause.share < 0.15


def test_a_clipped_effort_is_a_saturation():
    u = effort(*motion()[1:])
    limit = float(np.quantile(np.abs(u), 0.93))
    clipped = found(noisy(np.clip(u, -limit, limit)))
    assert list(clipped) == ["saturation"]
    assert abs(clipped["saturation"].size) == pytest.approx(limit, rel=0.05)


def test_friction_along_the_travel_is_named_with_its_range():
    _, q, v, a = motion()
    along = found(noisy(effort(q, v, a, friction=COULOMB * (1.0 + 0.6 * q))))
    assert list(along) == ["position_friction"]
    change = 0.6 * COULOMB * np.ptp(np.quantile(q, [0.05, 0.95]))
    assert along["position_friction"].size == pytest.approx(change, rel=0.3)


def test_an_encoder_off_centre_is_a_misaligned_axis():
    t, q, v, a = motion(size=1.6)
    u = effort(q, v, a)
    told = {c.name: c for c in fit(t, q + 0.03 * np.cos(q), noisy(u)).causes}
    assert list(told) == ["misaligned_axis"]
    assert told["misaligned_axis"].unit == "rad"


def test_a_gap_is_named():
    """A link behind a gap takes the load up late: its pulses are those of the load's reversals."""
    _, q, v, a = motion()
    load = 0.05 * a + GRAVITY * np.sin(q)
    width = int(0.06 * RATE)
    side = np.convolve(np.sign(load), np.hanning(width) / np.hanning(width).sum(), mode="same")
    gap = 0.02 * 0.5 * side
    u = effort(q, v, a) - 0.05 * np.gradient(np.gradient(gap)) * RATE**2 - GRAVITY * np.cos(q) * gap
    assert "backlash" in found(noisy(u))


def test_a_late_effort_is_a_delay():
    t, *states = motion()
    late = found(noisy(np.interp(t - 0.03, t, effort(*states))))
    assert list(late) == ["delay"]
    assert late["delay"].size == pytest.approx(0.03, abs=0.004)


def test_every_cause_has_words_and_a_finding():
    assert set(WORDS) == set(CAUSE_NAMES)
    sentence = cause_sentence(Cause("parallel_spring", 0.21, "N*m/rad", 0.34))
    assert sentence == "A parallel spring of 0.21 N·m/rad explains 34 % of the residual: hose or cable?"
    small = cause_sentence(Cause("parallel_spring", 0.21, "N*m/rad", 0.004))
    assert "explains less than 1 % of the residual" in small
    sure = cause_sentence(Cause("parallel_spring", 0.21, "N*m/rad", 0.34, 0.05))
    assert sure.startswith("A parallel spring of 0.21 ± 0.050 N·m/rad explains")
    open_ = cause_sentence(Cause("parallel_spring", 0.02, "N*m/rad", 0.34, 0.2))
    assert open_.startswith("A parallel spring of −0.18 to 0.22 N·m/rad explains")
    assert cause_sentence(Cause("delay", 0.0052, "s", 0.8)).startswith("An effort that is 5.2 ms late explains")
    assert cause_sentence(Cause("delay", -0.0052, "s", 0.8)).startswith("An effort that is 5.2 ms early explains")


def test_results_and_verdicts_have_the_cause():
    t, q, v, a = motion()
    joint = fit(t, q, noisy(effort(q, v, a) + STIFFNESS * q))
    rows = {row.id: row for row in joint.result.rows}
    row = rows["fit_joint.cause.parallel_spring"]
    assert (row.value, row.unit) == (joint.causes[0].size, "N*m/rad")
    low, high = joint["parallel_stiffness"].interval(joint.confidence)
    assert 2.0 * joint.causes[0].half_width == pytest.approx(high - low)
    assert rows["fit_joint.cause.parallel_spring.share"].value == joint.causes[0].share
    said = [verdict.text for verdict in joint.verdicts if verdict.finding == "causes"]
    assert said == [cause_sentence(joint.causes[0])]


def test_causes_come_from_fitted_recordings_alone():
    t, q, v, a = motion()
    u = noisy(effort(q, v, a))
    held = tuple(x.copy() for x in (t, q, u + STIFFNESS * q))
    assert fit(t, q, u, held_out=held).causes == fit(t, q, u).causes == ()
