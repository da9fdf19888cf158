"""A joint and a transfer function from arrays: what is there is found, and what is wrong is named."""

import doctest
from importlib import import_module

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import IdentificationError, PellucidError
from pellucid.joint.fit import estimators
from pellucid.models.card import read_card, write_card

T = np.arange(0.0, 30.0, 0.005)
TRUTH = {"inertia": 0.05, "gravity": 1.5, "coulomb": 0.3, "viscous": 0.08}


@pytest.fixture(scope="module")
def recorded():
    rng = np.random.default_rng(3)
    angle = T[:, None] * (2.0 * np.pi * np.array([0.13, 0.47, 1.1])) + [0.0, 1.0, 2.0]
    w, a = 2.0 * np.pi * np.array([0.13, 0.47, 1.1]), np.array([0.5, 0.3, 0.15])
    q, v, acc = np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w**2)
    effort = 0.05 * acc + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v + 0.02 * rng.standard_normal(len(T))
    return q, effort


@pytest.fixture(scope="module")
def fit(recorded):
    return pl.fit_joint(T, *recorded, lowpass=10.0, decimate=5)


def test_the_joint_is_found_with_its_intervals(fit):
    for name, value in TRUTH.items():
        assert abs(fit[name].value - value) < 4.0 * fit[name].standard_error + 0.005 * value, name
    assert dict(fit) == {p.name: p for p in fit.parameters}
    assert fit.covariance.shape == (5, 5)
    assert fit.interval("gravity", 0.5)[1] < fit.interval("gravity")[1]
    assert fit.whiteness.effective_share < 1.0


def test_it_prints_as_a_table(fit):
    lines = str(fit).splitlines()
    assert lines[0] == "Joint with symmetric friction"
    assert lines[2].split()[0] == "inertia"
    assert lines[2].endswith("kg*m^2")
    assert "may be zero" in str(fit)
    assert fit._repr_html_().count("<tr>") == 6
    assert "a0" not in fit
    with pytest.raises(KeyError, match="inertia, gravity"):
        fit["damping"]


def test_it_predicts_at_full_rate(fit, recorded):
    q, effort = recorded
    assert np.std((fit.predict(T, q[:, None]) - effort)[100:-100]) < 0.06


def test_columns_of_one_joint_are_that_joint(fit, recorded):
    q, effort = recorded
    again = pl.fit_joint(T, q[:, None], effort[:, None], lowpass=10.0, decimate=5)
    assert np.array_equal(again.array, fit.array)


def test_a_report_that_is_read_later_is_that_of_the_arrays_as_they_were(fit, recorded):
    q, effort = (np.array(each) for each in recorded)
    later = pl.fit_joint(T, q, effort, lowpass=10.0, decimate=5)
    q[:], effort[:] = 0.0, 0.0
    assert later.verdicts == fit.verdicts
    assert [(row.id, row.value) for row in later.result.rows] == [(row.id, row.value) for row in fit.result.rows]
    assert later.result is later.result


def test_its_card_is_read_again(fit, tmp_path):
    write_card(tmp_path / "joint.json", fit.card(lifts="up"))
    card = read_card(tmp_path / "joint.json")
    assert card.values == pytest.approx(fit.array, rel=1e-15)
    assert card.model().vector(card.values) == pytest.approx(fit.model.vector(fit.array))
    assert card.processing.startswith("zero-phase Butterworth low-pass, order 4, 10 Hz")


def test_known_values(recorded):
    q, effort = recorded
    held = pl.fit_joint(T, q, effort, lowpass=10.0, decimate=5, known={"gravity": 1.5})
    assert "gravity" not in held
    assert held["inertia"].value == pytest.approx(0.05, rel=0.01)
    every = dict(inertia=0.05, gravity=1.5, viscous=0.08, coulomb=0.3, offset=0.0)
    with pytest.raises(IdentificationError, match="known: found every parameter of a joint with symmetric friction"):
        pl.fit_joint(T, q, effort, lowpass=10.0, decimate=5, known=every)


def test_a_moving_mass_that_the_recordings_contradict_is_refused(recorded):
    """With 1.5 N m and 0.05 kg m^2, no body is lighter than 0.47 kg. Enforced, 0.2 kg would falsify gravity."""
    q, effort = recorded
    with pytest.raises(IdentificationError, match=r"found 0\.2 kg, expected at least 0\.46\d kg: .*correct"):
        pl.fit_joint(T, q, effort, lowpass=10.0, decimate=5, thorough=False, moving_mass=0.2)
    sound = pl.fit_joint(T, q, effort, lowpass=10.0, decimate=5, thorough=False, moving_mass=0.5)
    low, high = sound["gravity"].interval(0.95)
    assert low <= 1.5 <= high


def test_a_moving_mass_bounds_an_inertia_that_noise_leaves_open(recorded):
    q, effort = recorded
    mass, noise = 0.45, 3.0 * np.random.default_rng(2).standard_normal(len(T))
    free, light = (
        pl.fit_joint(T, q, effort + noise, lowpass=10.0, decimate=5, thorough=False, **limit)
        for limit in ({}, {"moving_mass": mass})
    )
    assert free["inertia"].value < free["gravity"].value ** 2 / (mass * 9.80665**2)
    assert light["inertia"].at_bound
    assert "0.45 kg" in str(light)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"position": np.zeros(7)}, "position: found 7 samples, expected 6000"),
        ({"position": np.zeros((6000, 2))}, r"position: found shape \(6000, 2\), expected \(n,\) or \(n, 1\)"),
        ({"effort": np.where(T > 1.0, np.nan, 0.0)}, r"5799 missing samples \(NaN\) in effort from sample 201"),
        ({"time": T[::-1]}, r"channel time: found time running back at index 1 \(29.995 s, then 29.99 s\)"),
        ({"time": T[:30], "position": T[:30], "effort": T[:30]}, "time: found 30 samples, expected at least"),
        ({"position": ["a"] * 6000}, "position: found text, expected an array of real numbers"),
        ({"lowpass": 200.0}, "lowpass: found 200 Hz, expected above 0 and below 100 Hz"),
        ({"friction": "viscid"}, "unknown friction family 'viscid'; known: symmetric"),
        ({"gravity": "cosine"}, "gravity is 'cosine'; expected one of none, sine"),
        ({"motion": "helical"}, "motion: found 'helical', expected one of rotary, prismatic"),
        ({"effort_unit": "N"}, r"effort_unit: found 'N', expected one of N\*m, A, V"),
        ({"known": {"mass": 1.0}}, "known: found 'mass', expected any of inertia"),
        ({"decimate": 0}, "decimate: found 0, expected an integer of 1 or more"),
        ({"confidence": 95.0}, "confidence: found 95, expected between 0 and 1"),
        ({"dead_band": 100.0}, "none is faster than the dead band, and the fastest moves at"),
        ({"position": np.zeros(6000)}, "a frozen encoder, the one value 0 in every sample in position"),
    ],
)
def test_what_is_wrong_is_named(recorded, changes, said):
    given = {"time": T, "position": recorded[0], "effort": recorded[1], "lowpass": 10.0, "decimate": 5} | changes
    with pytest.raises(PellucidError, match=said):
        pl.fit_joint(given.pop("time"), given.pop("position"), given.pop("effort"), **given)


def test_the_low_pass_has_no_default(recorded):
    with pytest.raises(TypeError, match="lowpass"):
        pl.fit_joint(T, *recorded)


def test_a_transfer_function_with_its_meaning():
    u = np.sin(T) + np.sign(np.sin(0.7 * T))
    fit = pl.fit_transfer_function(T, u, pl_response(u), poles=2, units=("N*m", "rad"))
    assert fit.numerator == pytest.approx([2.0], rel=1e-3)
    assert fit.denominator == pytest.approx([1.0, 0.8, 9.0], rel=1e-3)
    assert list(fit) == ["a1", "a0", "b0", "inertia", "damping", "stiffness"]
    assert fit["stiffness"].value == pytest.approx(4.5, rel=1e-3)
    assert fit.predict(T, u) == pytest.approx(pl_response(u), abs=1e-3)
    assert "stiffness" in str(fit)


def pl_response(u):
    from scipy.signal import lsim

    return lsim(([2.0], [1.0, 0.8, 9.0]), u, T)[1]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"output": T[:-1]}, "output: found 5999 samples, expected 6000"),
        ({"poles": 0}, "found 0 poles and 0 zeros"),
        ({"hold": "second"}, "hold: found 'second', expected one of zero, first"),
        ({"input": np.zeros(6000)}, "input"),
    ],
)
def test_what_a_transfer_function_cannot_come_from(changes, said):
    given = {"input": np.sin(T), "output": np.cos(T), "poles": 1} | changes
    with pytest.raises(PellucidError, match=said):
        pl.fit_transfer_function(T, given.pop("input"), given.pop("output"), **given)


@pytest.mark.parametrize("module", ["joint.study.fit_joint", "orthosis.transfer.fit_transfer_function"])
def test_examples_run(module):
    found = doctest.testmod(import_module(f"pellucid.{module}"))
    assert found.attempted
    assert not found.failed


def sines(hertz, inertia, gravity):
    """Position of slow or fast sines, and the effort of a joint with dry and viscous friction."""
    w, size = 2.0 * np.pi * np.array(hertz), np.array([0.5, 0.3, 0.15])
    phase = T[:, None] * w + [0.0, 1.0, 2.0]
    q, v, a = np.sin(phase) @ size, np.cos(phase) @ (size * w), -np.sin(phase) @ (size * w**2)
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(T))
    return q, inertia * a + gravity * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v + noise


@pytest.mark.parametrize(
    ("hertz", "inertia", "gravity", "named"),
    [
        ((0.13, 0.47, 1.1), 0.05, 1.5, "estimated inertia is negative"),
        ((0.05, 0.11, 0.17), 0.001, 1.5, "estimated coulomb is negative"),
        ((0.05, 0.11, 0.17), 0.001, 0.0, "estimated coulomb is negative"),
    ],
)
@pytest.mark.parametrize("reversed_position", [False, True])
def test_an_effort_of_the_opposite_sign_is_named(hertz, inertia, gravity, named, reversed_position):
    q, effort = sines(hertz, inertia, gravity)
    assert pl.fit_joint(T, q, effort, lowpass=10.0, decimate=5)["coulomb"].value == pytest.approx(0.3, rel=0.05)
    q, effort = (-q, effort) if reversed_position else (q, -effort)
    with pytest.raises(PellucidError, match=rf"effort: .*{named}.* the effort has the opposite sign of the position"):
        pl.fit_joint(T, q, effort, lowpass=10.0, decimate=5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"lowpass": "10"}, 'lowpass: found "10" without a unit, expected e.g. "10 Hz"'),
        ({"lowpass": "10 s"}, 'lowpass: found the unit "s", expected "Hz"'),
        ({"position": "degrees"}, r"position: found a magnitude of 54.* rad, which looks like deg taken for rad"),
        ({"units": {"position": "m"}}, "units: position: found 'm', expected a unit of rad"),
        ({"units": {"angle": "deg"}}, "units: found 'angle', expected any of time, position, velocity, effort"),
        ({"effort": "complex"}, "effort: found complex numbers, expected an array of real numbers"),
        ({"effort": None}, "effort: found None, expected an array of real numbers"),
        ({"time": [], "position": [], "effort": []}, "time: found 0 samples, expected at least"),
        ({"held_out": 1.5}, "held_out: found 1.5, expected a share above 0 and below 1"),
        ({"held_out": 4}, "held_out: found 4, expected a number from 0 to 0 or one of recording_1"),
        ({"held_out": 0}, "held_out: found all recordings, expected at least one that is fitted"),
        ({"known": {"gravity": "1 A"}}, 'known: gravity: found the unit "A"'),
    ],
)
def test_wrong_units_and_types_are_named(recorded, changes, said):
    q, effort = recorded
    odd = {"degrees": np.degrees(q), "complex": effort + 1j}
    given = {"time": T, "position": q, "effort": effort, "lowpass": 10.0, "decimate": 5} | changes
    given = {n: odd.get(x, x) if isinstance(x, str) else x for n, x in given.items()}
    with pytest.raises(PellucidError, match=said):
        pl.fit_joint(given.pop("time"), given.pop("position"), given.pop("effort"), **given)


def test_arrays_of_other_kinds_are_taken(recorded, fit):
    q, effort = recorded
    options = {"lowpass": "0.01 kHz", "decimate": 5}
    stamps = np.datetime64("2026-01-01T12:00:00", "us") + (T * 1e6).round().astype("timedelta64[us]")
    for given in (
        (list(T), q.tolist(), tuple(effort)),
        (stamps, q, effort),
        (1e3 * T, np.degrees(q), 1e3 * effort),
        (T.astype(object), q[:, None], effort.astype(object)),
        (np.ma.masked_array(T), np.ma.masked_array(q), np.ma.masked_array(effort)),
    ):
        units = {"time": "ms", "position": "deg", "effort": "mN*m"} if given[0][1] == 5.0 else None
        assert pl.fit_joint(*given, units=units, **options).array == pytest.approx(fit.array, rel=1e-6, abs=1e-6)


def test_masked_samples_are_missing_and_cut_out(recorded, fit):
    q, effort = recorded
    gone = np.zeros(len(T), bool)
    gone[1000:1100] = True
    wild = np.where(gone, 1e6, effort)
    found = pl.fit_joint(T, q, np.ma.masked_array(wild, gone), lowpass=10.0, decimate=5)
    assert found["gravity"].value == pytest.approx(fit["gravity"].value, rel=0.01)
    assert any("missing samples (NaN)" in v.text for v in found.verdicts)
    again = pl.fit_joint(T, q, np.where(gone, np.nan, effort), lowpass=10.0, decimate=5)
    assert np.array_equal(again.array, found.array)


@pytest.mark.parametrize(("size", "rate_hz", "stiffness"), [(2e-3, 0.05, 200.0), (0.02, 0.05, 200.0)])
def test_a_spring_on_a_bench_is_advised_in_words_of_arrays(size, rate_hz, stiffness):
    t = np.arange(0.0, 30.0, 0.005)
    q = size * np.sin(2.0 * np.pi * rate_hz * t)
    effort = stiffness * (q + 0.01 * size * np.random.default_rng(1).standard_normal(t.size))
    with pytest.raises(PellucidError) as told:
        pl.fit_joint(t, q, effort, lowpass=10.0, decimate=5, thorough=False)
    assert str(told.value).endswith(
        "; if one end of a spring is locked, pellucid.propose writes a study of it from the same columns"
    )
    assert not [word for word in ("study.toml", "[[recordings]]", "protocol", "sign = ") if word in str(told.value)]


def test_no_response_is_simulated_twice(monkeypatch, recorded):
    asked, plain = [], estimators.replay

    def replay(model, values, *arguments, differentiate=None, **options):
        if differentiate:
            asked.append(values.copy())
        return plain(model, values, *arguments, differentiate=differentiate, **options)

    monkeypatch.setattr(estimators, "replay", replay)
    pl.fit_joint(T, *recorded, lowpass=10.0, decimate=5)
    assert len(asked) > 2
    for i, values in enumerate(asked):
        assert not [other for other in asked[:i] if np.allclose(values, other, rtol=1e-12, atol=0.0)]
