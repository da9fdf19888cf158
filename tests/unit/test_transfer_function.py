"""Transfer functions: exact between samples, exact derivatives, refusals; the grey box against the core's joint."""

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from pellucid._errors import IdentificationError, RecordingError
from pellucid.files.recording import Channel, Recording
from pellucid.models.joint import joint_model
from pellucid.models.simulate import LoopSetting, simulate
from pellucid.orthosis.input_output import InputOutput, input_output
from pellucid.orthosis.linear_recursion import march
from pellucid.orthosis.transfer.fit_transfer_function import (
    coefficient_units,
    evaluate_transfer_function,
    fit_percent,
    fit_records,
)
from pellucid.orthosis.transfer.pendulum_fit import (
    NAMES,
    evaluate_pendulum,
    fit_pendulum,
    pendulum_drive,
    simulate_pendulum,
)
from pellucid.orthosis.transfer_function import TransferFunction, response_basis

SYSTEMS = [
    ([2.0], [1.0, 0.3, 20.0]),
    ([1.0, 2.0], [1.0, 3.0, 20.0, 7.0]),
    ([0.5, 1.0, 3.0], [1.0, 2.0, 5.0]),
    ([3], [1, 5]),
]


def irregular(n: int = 300) -> tuple[np.ndarray, np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(1)
    return np.cumsum(rng.uniform(0.005, 0.06, n)), rng.normal(size=n), rng


def stepped(num, den, time, u, hold, initial):
    """Sample by sample: `lsim` between two samples, and a matrix exponential for the free response."""
    a, b, c, d = (np.atleast_2d(m) for m in signal.tf2ss(num, den))
    companion = np.asarray(den, float) / den[0]
    observer = np.column_stack([-companion[1:], np.eye(len(companion) - 1)[:, :-1]])
    x, free, out = np.zeros(len(a)), np.array(initial, float), []
    for k in range(len(time)):
        out.append((c @ x)[0] + d[0, 0] * u[k] + free[0])
        if k + 1 == len(time):
            break
        h = time[k + 1] - time[k]
        ends = [u[k], u[k + 1] if hold == "first" else u[k]]
        x = np.atleast_2d(signal.lsim((a, b, c, d), ends, [0.0, h], X0=x)[2])
        x = x[-1] if x.shape[1] == len(a) else x.T[-1]
        free = expm(observer * h) @ free
    return np.array(out)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize(("num", "den"), SYSTEMS)
def test_simulation_is_exact_on_an_uneven_grid(num, den, hold):
    time, u, rng = irregular()
    made = TransferFunction(num, den)
    initial = rng.normal(size=made.order)
    expected = stepped(num, den, time, u, hold, initial)
    assert made.simulate(time, u, hold=hold, initial=initial) == pytest.approx(
        expected, abs=1e-7 * np.abs(expected).max()
    )


def test_simulation_agrees_with_lsim_on_an_even_grid():
    time = np.arange(2000) / 100.0
    u = np.random.default_rng(0).normal(size=2000)
    expected = signal.lsim(([2.0], [1.0, 0.3, 20.0]), u, time)[1]
    found = TransferFunction([2.0], [1.0, 0.3, 20.0]).simulate(time, u, hold="first")
    assert found == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize(("num", "den"), SYSTEMS)
def test_derivatives_are_exact(num, den, hold):
    time, u, rng = irregular(120)
    made = TransferFunction(num, den)
    initial = rng.normal(size=made.order)
    numerator = np.array(made.numerator)
    found = response_basis(made.denominator, len(numerator) - 1, time, u, hold=hold)
    output = found.numerator @ numerator + found.initial @ initial
    assert output == pytest.approx(made.simulate(time, u, hold=hold, initial=initial), abs=1e-12)
    given = [np.array(made.denominator[1:]), np.array(made.numerator), initial]
    for part, jacobian in enumerate((found.by_denominator(numerator, initial), found.numerator, found.initial)):
        for i in range(len(given[part])):
            step = 1e-5 * max(1.0, abs(given[part][i]))
            ends = []
            for sign in (1.0, -1.0):
                moved = [g.copy() for g in given]
                moved[part][i] += sign * step
                tf = TransferFunction(moved[1], np.concatenate([[1.0], moved[0]]))
                ends.append(tf.simulate(time, u, hold=hold, initial=moved[2]))
            expected = (ends[0] - ends[1]) / (2.0 * step)
            assert jacobian[:, i] == pytest.approx(expected, abs=1e-6 * np.abs(expected).max() + 1e-9)


def test_what_a_transfer_function_says_of_itself():
    made = TransferFunction([4.0], [2.0, 2.0, 10.0])
    assert (made.numerator, made.denominator) == ((2.0,), (1.0, 1.0, 5.0))
    assert made.static_gain == pytest.approx(0.4)
    assert made.poles == pytest.approx(np.roots([1, 1, 5]))
    assert made.stable
    assert not TransferFunction([1.0], [1.0, -1.0]).stable
    frequency = np.array([0.1, 1.0])
    expected = signal.freqs([4.0], [2.0, 2.0, 10.0], 2 * np.pi * frequency)[1]
    assert made.frequency_response(frequency) == pytest.approx(expected)
    assert TransferFunction([1.0], np.poly([0.5, -2.0])).reflected().poles.real.max() == pytest.approx(-0.5)
    assert np.isinf(TransferFunction([1.0], [1.0, 2.0, 0.0]).static_gain)


@pytest.mark.parametrize(
    ("num", "den", "said"),
    [
        ([1.0, 2.0, 3.0], [1.0, 2.0], "2 zeros and 1 poles"),
        ([1.0], [0.0, 2.0], "does not start with 0"),
        ([np.nan], [1.0, 2.0], "finite"),
        ([1.0], [1.0], "at least 1 over 2"),
    ],
)
def test_no_transfer_function_is_made_of_nonsense(num, den, said):
    with pytest.raises(IdentificationError, match=said):
        TransferFunction(num, den)


def test_a_recursion_is_what_its_steps_are():
    rng = np.random.default_rng(2)
    phi, v, x = rng.normal(size=(9, 3, 3)), rng.normal(size=(9, 3, 2)), rng.normal(size=(3, 2))
    found = march(phi, v, x)
    for k in range(9):
        x = phi[k] @ x + v[k]
        assert found[k + 1] == pytest.approx(x)


def record(n: int = 600, **changes) -> InputOutput:
    rng = np.random.default_rng(3)
    time = np.arange(n) / 50.0
    u = np.repeat(rng.normal(size=n // 30), 30)
    y = TransferFunction([20.0], [1.0, 2.0, 30.0]).simulate(time, u, hold="zero", initial=[0.3, 1.0])
    given = {"time": time, "input": u, "output": y + 0.01 * rng.normal(size=n)} | changes
    return InputOutput("r", "fitted", **given)


def test_a_fit_finds_coefficients_inertia_and_initial_state():
    found = fit_records([record()], 2, hold="zero", units=("N*m", "rad"))
    for name, value in {"a1": 2.0, "a0": 30.0, "b0": 20.0, "inertia": 1 / 20, "damping": 0.1, "stiffness": 1.5}.items():
        assert abs(found[name].value - value) < 4.0 * found[name].standard_error
        assert found[name].standard_error < 0.02 * value
    assert found.responses[0].initial[0] == pytest.approx(0.3, abs=0.02)
    assert [found[n].unit for n in ("a1", "b0", "inertia")] == ["1/s", "rad/(N*m*s^2)", "kg*m^2"]
    assert found.converged


def test_records_of_one_system_are_fitted_together_and_one_is_held_out():
    whole = record(1200)
    parts = [whole.part(0, 400, "fitted"), whole.part(400, 800, "fitted")]
    found = fit_records(parts, 2, hold="zero")
    alone = fit_records(parts[:1], 2, hold="zero")
    assert found["a0"].standard_error < alone["a0"].standard_error
    assert [r.recording for r in found.responses] == ["r", "r"]
    out = evaluate_transfer_function(found.transfer_function, whole.part(800, 1200, "heldout"), hold="zero")
    assert out.split == "heldout"
    assert out.fit > 90.0
    assert out.fit == pytest.approx(fit_percent(out.measured, out.simulated))


def test_an_offset_of_the_output_is_found():
    plain = record()
    found = fit_records([record(output=plain.output + 0.7)], 2, hold="zero", offset=True)
    assert found.responses[0].offset == pytest.approx(0.7, abs=0.02)
    assert abs(found["a0"].value - 30.0) < 4.0 * found["a0"].standard_error


def test_the_fit_percentage_is_the_one_of_compare():
    y = np.array([0.0, 1.0, 2.0, 3.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(4, 1.5)) == pytest.approx(0.0)
    assert fit_percent(y, y + 1.0) == pytest.approx(100.0 * (1.0 - 2.0 / np.sqrt(5.0)))


@pytest.mark.parametrize(
    ("changes", "options", "said"),
    [
        ({"input": np.zeros(600)}, {}, "found an input that stays at 0 in all 600 samples"),
        ({"output": np.full(600, 2.0)}, {}, "found an output that stays at 2"),
        ({"time": np.arange(600)[::-1] / 50.0}, {}, "expected time that increases"),
        ({"output": np.full(600, np.nan)}, {}, "missing samples"),
        ({}, {"hold": "cubic"}, "expected one of zero, first"),
        ({}, {"poles": 1, "zeros": 2}, "expected at least 1 pole"),
    ],
)
def test_a_record_that_carries_no_fit_is_refused(changes, options, said):
    given = {"poles": 2, "zeros": 0, "hold": "zero"} | options
    with pytest.raises(IdentificationError, match=said):
        fit_records([record(**changes)], given["poles"], given["zeros"], hold=given["hold"])


def test_a_record_too_short_is_refused():
    with pytest.raises(IdentificationError, match="found 20 samples, expected at least 25"):
        fit_records([record().part(0, 20, "fitted")], 2, hold="zero")


def test_poles_that_the_input_cannot_tell_apart_are_refused_or_told():
    plain = record()
    clean = TransferFunction([2.0], [1.0, 2.0]).simulate(plain.time, plain.input, hold="zero")
    with pytest.raises(IdentificationError, match=r"not identifiable separately|singular"):
        fit_records([record(output=clean)], 4, 3, hold="zero")


def test_units_of_coefficients():
    assert coefficient_units(2, 0, ("N*m", "rad")) == ("1/s", "1/s^2", "rad/(N*m*s^2)")
    assert coefficient_units(2, 1, ("V", "m")) == ("1/s", "1/s^2", "m/(V*s)", "m/(V*s^2)")
    assert coefficient_units(1, 1, ("1", "1")) == ("1/s", "1", "1/s")


# --- recordings made ready ------------------------------------------------------------------------------------------


def recording(tmp_path, time, u, y) -> Recording:
    units = {"time": "s", "torque": "N*m", "position": "rad"}
    channels = {n: Channel(n, np.asarray(v, float), units[n], n) for n, v in zip(units, (time, u, y), strict=True)}
    return Recording("trial", tmp_path / "trial.csv", "0" * 64, "fit", channels)


def test_stale_samples_repeats_and_missing_numbers_are_left_out_and_counted(tmp_path):
    time = [99.9, 99.95, 0.0, 0.1, 0.1, 0.2, 0.3, 0.4, 1.4]
    y = [9.0, 9.0, 0.0, 1.0, 8.0, 2.0, np.nan, 4.0, 5.0]
    made = input_output(recording(tmp_path, time, np.ones(9), y), ("torque", "position"))
    assert made.time.tolist() == [0.0, 0.1, 0.2, 0.4, 1.4]
    assert made.output.tolist() == [0.0, 1.0, 2.0, 4.0, 5.0]
    assert "1 sample with a missing number excluded" in made.notes
    assert "time runs backwards once; the longest stretch is kept, 2 samples of the others excluded" in made.notes
    assert "1 sample with a repeated time excluded" in made.notes
    assert any("gap" in note for note in made.notes)


def test_a_recording_without_two_samples_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"trial\.csv.*found 1 sample"):
        input_output(recording(tmp_path, [1.0, 0.5], [0.0, 0.0], [0.0, np.nan]), ("torque", "position"))


# --- the grey box ---------------------------------------------------------------------------------------------------

VALUES = np.array([0.057, 0.02, 0.06, 1.51, 0.3, 0.02])


def swing(values=VALUES, n: int = 3000, width: float = 0.1, hold: str = "first", frequency: float = 0.5):
    time = np.arange(n) / 250.0
    torque = 0.5 * np.sin(2 * np.pi * frequency * time) + 0.2 * np.sin(2 * np.pi * 1.3 * time)
    drive = pendulum_drive(time, torque, hold=hold, width=width)
    return time, torque, drive


def test_a_pendulum_is_integrated_exactly_enough():
    time, torque, drive = swing(n=1000)
    found = simulate_pendulum(VALUES, np.array([0.2, -0.5]), drive, np.zeros((1000, 2)))

    def rate(t, x):
        i, b, c, m, k, o = VALUES
        u = np.interp(t, time, torque)
        return [x[1], (u - b * x[1] - c * np.tanh(x[1] / 0.1) - m * np.sin(x[0]) - k * x[0] - o) / i]

    expected = solve_ivp(rate, (0, time[-1]), [0.2, -0.5], t_eval=time, rtol=1e-10, atol=1e-10, max_step=0.004).y
    assert found.position == pytest.approx(expected[0], abs=2e-5)
    assert found.velocity == pytest.approx(expected[1], abs=2e-4)


def test_derivatives_of_a_pendulum_are_exact():
    _, _, drive = swing(n=500)
    start = np.array([0.2, -0.5])
    found = simulate_pendulum(VALUES, start, drive, np.zeros((500, 2)))
    both = np.concatenate([VALUES, start])
    for i in range(8):
        step = np.zeros(8)
        step[i] = 1e-6
        ends = [
            simulate_pendulum((both + s * step)[:6], (both + s * step)[6:], drive, found.states).position
            for s in (1, -1)
        ]
        expected = (ends[0] - ends[1]) / 2e-6
        assert found.jacobian[:, i] == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


def test_a_pendulum_without_a_guess_is_the_same_motion():
    _, _, drive = swing(n=1500)
    start = np.array([0.2, -0.5])
    near = simulate_pendulum(VALUES, start, drive, np.zeros((1500, 2)))
    far = np.random.default_rng(0).normal(scale=1e2, size=(1500, 2))
    assert simulate_pendulum(VALUES, start, drive, far).position == pytest.approx(near.position, abs=1e-8)


def test_a_motion_over_the_top_is_refused_in_time():
    values = VALUES * [1, 0.1, 0.1, 1, 0, 1]
    time = np.arange(5000) / 250.0
    drive = pendulum_drive(time, 3.0 * np.sin(3.0 * time), hold="first", width=0.1)
    with pytest.raises(IdentificationError, match="diverges"):
        simulate_pendulum(values, np.zeros(2), drive, np.zeros((5000, 2)))


def test_the_core_s_joint_moves_alike():
    """The equation is written twice; without a spring both must give one motion."""
    values = VALUES.copy()
    values[4] = 0.0
    _, torque, drive = swing(hold="zero")
    found = simulate_pendulum(values, np.array([0.1, 0.0]), drive, np.zeros((3000, 2)))
    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")
    named = {"inertia": 0.057, "viscous": 0.02, "coulomb": 0.06, "gravity": 1.51, "offset": 0.02}
    vector = model.vector(np.array([named[n] for n in model.names]), velocity_width=0.1)
    core = simulate(vector, torque, 1 / 250.0, loop=LoopSetting(), position0=0.1, stiction=False)
    assert core.position == pytest.approx(found.position, abs=5e-3 * np.ptp(found.position))


def swings(values=VALUES, noise: float = 1e-3, width: float = 0.1) -> list[InputOutput]:
    rng = np.random.default_rng(5)
    made = []
    for frequency in (0.4, 0.9):
        time, torque, drive = swing(frequency=frequency)
        motion = simulate_pendulum(values, np.array([0.1, 0.2]), drive, np.zeros((len(time), 2)))
        measured = motion.position + noise * rng.normal(size=len(time))
        made.append(InputOutput(f"f{frequency}", "fitted", time, torque, measured))
    return made


def test_the_grey_box_finds_every_parameter():
    records = swings()
    found = fit_pendulum(records, hold="first", width=0.1)
    for name, value in zip(NAMES, VALUES, strict=True):
        assert abs(found[name].value - value) < 4.0 * found[name].standard_error, name
    assert found["inertia"].value == pytest.approx(VALUES[0], rel=0.01)
    assert found.reasons == {}
    assert found.converged
    out = evaluate_pendulum(found, records[0].part(1000, 3000, "heldout"))
    assert out.fit > 98.0


def test_a_known_gravity_is_held():
    found = fit_pendulum(swings(), hold="first", known={"gravity": 1.51}, width=0.1)
    assert "gravity" not in [p.name for p in found.parameters]
    assert found.complete[3] == 1.51
    assert found["stiffness"].value == pytest.approx(0.3, abs=4.0 * found["stiffness"].standard_error)


def test_a_parameter_at_its_bound_says_why():
    values = VALUES.copy()
    values[4] = -0.2
    found = fit_pendulum(swings(values), hold="first", known={"gravity": 1.51}, width=0.1)
    assert found["stiffness"].at_bound
    assert found["stiffness"].value == 0.0
    assert "lies below the bound" in found.reasons["stiffness"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"free": ("mass",)}, "found parameters mass"),
        ({"free": ("damping",)}, "found no inertia"),
        ({"bounds": {"damping": (1.0, 0.0)}}, "expected the lower first"),
    ],
)
def test_a_grey_box_of_nonsense_is_refused(options, said):
    with pytest.raises(IdentificationError, match=said):
        fit_pendulum(swings(), hold="first", **options)


def test_a_grey_box_needs_a_motion():
    still = InputOutput("still", "fitted", np.arange(500) / 100.0, np.sin(np.arange(500) / 10.0), np.zeros(500))
    with pytest.raises(IdentificationError, match="stays at 0 rad"):
        fit_pendulum([still], hold="first")
