"""
The core: every physical model once, in C++ (include/pellucid). SI units throughout.
"""

from collections.abc import Callable, Sequence

import numpy
from numpy import float32, float64
from numpy.typing import ArrayLike, NDArray

PARAMETER_NAMES: tuple[str, ...]

GEARED_PARAMETER_NAMES: tuple[str, ...]

def model_fields() -> dict[str, list[dict]]:
    """
    What the core says of the parameters of its models: the fields of each, as in `laws`, in the order of its arrays.
    """

instructions: str

def inverse_dynamics(
    parameters: ArrayLike, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike
) -> NDArray[float64]:
    """
    Effort that moves a joint so: y + friction(v, y) + offset, y = J a + g_s sin q + g_c cos q.

    Parameters
    ----------
    parameters : (k,)
        In the order of PARAMETER_NAMES.
    position, velocity, acceleration : (n,)
        q [rad], v [rad/s], a [rad/s^2]; metres on a prismatic joint.

    Returns
    -------
    (n,)
        Effort [N m]; N on a prismatic joint.
    """

def inverse_dynamics_jacobian(
    parameters: ArrayLike, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, active: ArrayLike
) -> tuple[NDArray[float64], NDArray[float64]]:
    """
    inverse_dynamics and its exact derivatives by some parameters.

    Parameters
    ----------
    parameters : (k,)
        In the order of PARAMETER_NAMES.
    position, velocity, acceleration : (n,)
        q [rad], v [rad/s], a [rad/s^2].
    active : (k,) of int
        Which parameters, as indices into PARAMETER_NAMES.

    Returns
    -------
    effort : (n,)
        [N m].
    jacobian : (n, k)
        d effort / d parameters[active].
    """

def forward_dynamics(
    parameters: ArrayLike, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike
) -> NDArray[float64]:
    """
    Acceleration that an effort gives; the inverse of inverse_dynamics, in closed form.

    Parameters
    ----------
    parameters : (k,)
        In the order of PARAMETER_NAMES.
    position, velocity, effort : (n,)
        q [rad], v [rad/s], effort [N m].

    Returns
    -------
    (n,)
        Acceleration [rad/s^2].
    """

def friction(parameters: ArrayLike, velocity: ArrayLike, load: ArrayLike) -> NDArray[float64]:
    """
    Friction level(v) s + F_v v + alpha |y| s, with s = tanh(v / w), or sign(v) where w is 0.

    Parameters
    ----------
    parameters : (k,)
        In the order of PARAMETER_NAMES.
    velocity, load : (n,)
        v [rad/s] and the load y that passes through the drive [N m].

    Returns
    -------
    (n,)
        Friction effort [N m], along +v.
    """

def resistance_coefficients(roles: ArrayLike, coefficients: ArrayLike) -> list[tuple[float, float, float]]:
    """
    Sums of friction coefficients by the powers of speed and load that they multiply.

    Of coefficients that act in one direction each the larger counts; all others add up.

    Parameters
    ----------
    roles : (k, 3)
        Powers of speed and load, and whether the coefficient acts in one direction; at most 16 pairs of powers.
    coefficients : (k,)
        SI.

    Returns
    -------
    list of (power of the speed, power of the load, sum)
    """

def max_resistance(roles: ArrayLike, coefficients: ArrayLike, speed: ArrayLike, load: ArrayLike) -> NDArray[float64]:
    """
    The most that friction resists by, of n joints.

    Parameters
    ----------
    roles : (k, 3)
        As in resistance_coefficients.
    coefficients : (k, n)
        SI.
    speed, load : (n,)
        |v| [rad/s] and |y| [N m].

    Returns
    -------
    (n,)
        Effort [N m].
    """

def load(parameters: ArrayLike, position: ArrayLike, acceleration: ArrayLike) -> NDArray[float64]:
    """
    Load y = J a + g_s sin q + g_c cos q that passes through the drive [N m].

    Parameters
    ----------
    parameters : (k,)
        In the order of PARAMETER_NAMES.
    position, acceleration : (n,)
        q [rad], a [rad/s^2].
    """

def presliding(travel: float, position: ArrayLike) -> NDArray[float64]:
    """
    What takes the place of the sign of velocity while friction gives before it slips.

    Depends on the way alone, not on time; starts without strain.

    Parameters
    ----------
    travel : float
        Way from rest over which friction builds up to its level [rad].
    position : (n,)
        The way gone [rad]. A step from or to NaN is none.

    Returns
    -------
    direction : (n,)
        s, -1 to 1; 0 throughout where the travel is 0.
    """

def simulate(
    parameters: ArrayLike,
    *,
    reference: ArrayLike,
    period: float,
    substeps: int = 4,
    loop: str = "none",
    kp: float = 0,
    ki: float = 0,
    kd: float = 0,
    kv: float = 0,
    limit: float = 0,
    velocity_span: int = 0,
    gain: float = 1,
    back_emf: float = 0,
    injected: ArrayLike | None = None,
    disturbance: ArrayLike | None = None,
    encoder_quantum: float = 0,
    encoder_noise: ArrayLike | None = None,
    ripple_amplitude: float = 0,
    ripple_wave_number: float = 0,
    ripple_phase: float = 0,
    position0: float = 0,
    velocity0: float = 0,
    integral0: float = 0,
    presliding_travel: float = 0,
    stiction: bool = False,
) -> tuple[NDArray[float64], ...]:
    """
    A joint under its own controller, sample by sample.

    Every period the loop reads the encoder once and holds its command; the joint moves in `substeps` of semi-implicit
    Euler. A simulation that diverges returns values that are not finite.

    Parameters
    ----------
    parameters : (k,)
        In the order of PARAMETER_NAMES.
    reference : (n,)
        Of the loop [rad]; a velocity [rad/s] for "velocity_pi"; the command itself for "none".
    period : float
        Control period [s].
    substeps : int
        Integration steps per period, 1 to 1000000. Default 4.
    loop : str
        "none", "p" u = kp (r - q), "pi" with ki integral(r - q), "pd" with kd (r' - v), "cascade"
        u = kv e + ki integral(e), e = kp (r - q) - v, or "velocity_pi" u = kp e + ki integral(e), e = r - v.
    kp, ki, kd, kv : float
        Its gains. Default 0.
    limit : float
        Of |u| before `injected` is added; 0: none. The integral waits while it would push further. Default 0.
    velocity_span : int
        Samples that the loop's velocity, a difference of measured positions, spans; 0: the true velocity. Default 0.
    gain, back_emf : float
        Effort per command, default 1, and effort lost per velocity, default 0.
    injected, disturbance, encoder_noise : (n,)
        Added to the command after the limit; effort on the joint from outside [N m]; added to the measured position
        [rad]. Default: none.
    encoder_quantum : float
        Smallest step of the encoder [rad]; 0: none. Default 0.
    ripple_amplitude, ripple_wave_number, ripple_phase : float
        Effort on the joint A sin(n q + phi), which no current shows. Default 0.
    position0, velocity0 : float
        Where the joint starts [rad, rad/s]. Default 0.
    integral0 : float
        What the loop's integral of e starts from. Default 0.
    presliding_travel : float
        Way over which friction builds up to its level before the joint slips [rad]; then neither velocity_width nor
        stiction counts. Default 0: it slips at once.
    stiction : bool
        True stiction: the true sign whatever velocity_width is, and a joint at rest under less than the breakaway
        effort stays there to the bit. Default: smooth friction.

    Returns
    -------
    position, velocity, acceleration, command, effort, measured_position : (n,) each
        At the sample instants k period, before the k-th period; the command (limited, with what was injected), the
        effort gain command - back_emf v (as a current sensor sees it: without ripple and disturbance) and the
        acceleration are those at the start of that period.
    """

def simulate_batch(
    parameters: ArrayLike,
    *,
    reference: ArrayLike,
    period: float,
    substeps: int = 4,
    loop: str = "none",
    kp: ArrayLike = 0,
    ki: ArrayLike = 0,
    kd: ArrayLike = 0,
    kv: ArrayLike = 0,
    limit: ArrayLike = 0,
    velocity_span: int = 0,
    gain: ArrayLike = 1,
    back_emf: ArrayLike = 0,
    injected: ArrayLike | None = None,
    disturbance: ArrayLike | None = None,
    encoder_quantum: ArrayLike = 0,
    encoder_noise: ArrayLike | None = None,
    ripple_amplitude: ArrayLike = 0,
    ripple_wave_number: ArrayLike = 0,
    ripple_phase: ArrayLike = 0,
    position0: ArrayLike = 0,
    velocity0: ArrayLike = 0,
    integral0: ArrayLike = 0,
    presliding_travel: ArrayLike = 0,
    stiction: bool = False,
    threads: int = 1,
) -> tuple[NDArray[float64], ...]:
    """
    Many joints at once, in the lanes of the processor; the same bits as `simulate` gives one by one.

    Parameters
    ----------
    parameters : (m, k)
        A joint a row.
    reference, injected, disturbance, encoder_noise : (n,) or (m, n)
        Shared, or one a row.
    kp, ..., presliding_travel : float or (m,)
        Shared, or one a row. period, substeps, loop, velocity_span and stiction are shared.
    threads : int
        How many threads share the rows. Default 1.

    Returns
    -------
    position, velocity, acceleration, command, effort, measured_position : (m, n) each
        As `simulate` returns them.
    """

def simulate_geared(
    parameters: ArrayLike,
    *,
    reference: ArrayLike,
    period: float,
    substeps: int = 4,
    loop: str = "none",
    kp: ArrayLike = 0,
    ki: ArrayLike = 0,
    kd: ArrayLike = 0,
    kv: ArrayLike = 0,
    limit: ArrayLike = 0,
    velocity_span: int = 0,
    gain: ArrayLike = 1,
    back_emf: ArrayLike = 0,
    injected: ArrayLike | None = None,
    disturbance: ArrayLike | None = None,
    encoder_quantum: ArrayLike = 0,
    encoder_noise: ArrayLike | None = None,
    ripple_amplitude: ArrayLike = 0,
    ripple_wave_number: ArrayLike = 0,
    ripple_phase: ArrayLike = 0,
    position0: ArrayLike = 0,
    velocity0: ArrayLike = 0,
    integral0: ArrayLike = 0,
    threads: int = 1,
) -> tuple[NDArray[float64], ...]:
    """
    Many motors, each with a link behind a compliant transmission with backlash, in the lanes of the processor.

    A plant richer than what is identified from it, everything on the joint's side of the gear:

        J_m dv_m = gain u - back_emf v_m + ripple(q_m) - tau - friction(q_m, v_m, tau)
        J dv = tau + disturbance - g_s sin q - g_c cos q - bearing friction

    tau = K e + D (v_m - v), where e is how far q_m - q lies beyond +-backlash/2; 0 in the gap, and never against e. The
    motor's friction is the joint's, and besides: load_rise rho multiplies the load coefficients by
    1 + rho exp(-(v/v_s)^2); friction_swing eps the Coulomb level by 1 + eps sin(friction_wave_number q_m);
    viscous_decline v_d (0: none) divides the viscous torque by 1 + |v|/v_d. Stiction is true, at motor and link: a body
    at rest under less than its breakaway torque stays there to the bit. A row's numbers, while they are finite, do not
    depend on the other rows, on threads or on the instruction set. A simulation that diverges returns values that are
    not finite, and NaN neither hangs nor raises.

    Parameters
    ----------
    parameters : (m, 22)
        A row a plant, in the order of GEARED_PARAMETER_NAMES.
    reference, injected, disturbance, encoder_noise : (n,) or (m, n)
        Shared, or one a row. The disturbance acts on the link; the loop and the encoder are the motor's.
    period, substeps, loop, velocity_span
        As `simulate` takes them, shared. The substep period/substeps must resolve the transmission: sqrt(K/J) times it
        below about 1 for the smaller inertia.
    kp, ..., ripple_phase, integral0 : float or (m,)
        As `simulate` takes them, shared or one a row.
    position0, velocity0 : float or (m,)
        Where the link starts [rad] and how fast both bodies move [rad/s]; the motor starts where the transmission's
        spring carries gravity. Default 0.
    threads : int
        How many threads share the rows. Default 1.

    Returns
    -------
    motor_position, motor_velocity, link_position, link_velocity : (m, n) each
    command, measured_position, transmission_torque : (m, n) each
        At the sample instants k period, before the k-th period; the command is limited, with what was injected.
    """

def simulate_jacobian(
    parameters: ArrayLike,
    *,
    active: ArrayLike,
    reference: ArrayLike,
    period: float,
    substeps: int = 4,
    loop: str = "none",
    kp: float = 0,
    ki: float = 0,
    kd: float = 0,
    kv: float = 0,
    limit: float = 0,
    velocity_span: int = 0,
    gain: float = 1,
    back_emf: float = 0,
    injected: ArrayLike | None = None,
    disturbance: ArrayLike | None = None,
    encoder_quantum: float = 0,
    encoder_noise: ArrayLike | None = None,
    ripple_amplitude: float = 0,
    ripple_wave_number: float = 0,
    ripple_phase: float = 0,
    position0: float = 0,
    velocity0: float = 0,
    integral0: float = 0,
    presliding_travel: float = 0,
    stiction: bool = False,
) -> tuple[NDArray[float64], ...]:
    """
    simulate, and the exact derivatives of its trajectory by some parameters of the joint.

    The initial state is a constant. An encoder's staircase is differentiated as its mean slope. Smooth friction only.

    Parameters
    ----------
    active : (k,) of int
        Which parameters, as indices into PARAMETER_NAMES.

    Returns
    -------
    position, velocity, acceleration, command, effort, measured_position : (n,) each
        As `simulate` returns them.
    d_position, d_velocity, d_acceleration, d_effort : (n, k) each
        Derivatives by parameters[active].
    """

class Biquads:
    """
    A cascade of second-order sections (direct form II transposed) in float64, one sample at a time.

    Parameters
    ----------
    sos : (k, 6)
        Rows b0, b1, b2, a0 = 1, a1, a2, as scipy.signal designs them; k at most 16.

    Notes
    -----
    A sample that is not finite passes through, and the state starts again at zeros.
    """

    def __init__(self, sos: ArrayLike) -> None: ...
    def step(self, x: float) -> float:
        """One sample."""

    def filter(self, x: ArrayLike) -> NDArray[float64]:
        """Samples one after another, going on from the state."""

    def reset(self) -> None:
        """Back to a state of zeros."""

class BiquadsFloat:
    """Biquads in float32, as on a microcontroller."""

    def __init__(self, sos: ArrayLike) -> None: ...
    def step(self, x: float) -> float:
        """One sample."""

    def filter(self, x: ArrayLike) -> NDArray[float32]:
        """Samples one after another, going on from the state."""

    def reset(self) -> None:
        """Back to a state of zeros."""

class SafetyGate:
    """
    The last step of every controller: what goes out is finite and within the limits, whatever comes in.

    A fault latches: the output ramps to 0 within the rate limit and stays there until reset(). Parameters that make no
    sense give 0 and the fault "configuration".

    Parameters
    ----------
    effort_limit, rate_limit : float
        Of |effort| [N m] and of its rate [N m/s], > 0.
    velocity_limit : float
        Of |velocity| [rad/s]; beyond is a fault; infinite: none.
    position_min, position_max, stop_margin : float
        The stops [rad], infinite: none, and the distance over which the effort into them falls to 0 [rad].
    max_age : float
        Of a sample, and of a gap between two [s]; infinite: none.
    max_repeats : int
        How often one sample may be seen again.
    period : float
        Between two steps [s], > 0.
    """

    def __init__(
        self,
        *,
        effort_limit: float,
        rate_limit: float,
        velocity_limit: float,
        position_min: float,
        position_max: float,
        stop_margin: float,
        max_age: float,
        max_repeats: int,
        period: float,
    ) -> None: ...
    def step(self, command: float, position: float, velocity: float, time: float, sequence: int) -> float:
        """
        One control period: the effort that may go to the motor [N m].

        Parameters
        ----------
        command, position, velocity : float
            Effort wanted [N m], and the joint's measured position [rad] and velocity [rad/s].
        time, sequence : float, int
            When they were measured [s], and the number of that sample.
        """

    @property
    def fault(self) -> str:
        """
        'none' while it is open, else 'configuration', 'not_finite', 'stale', 'out_of_order' or 'velocity'.
        """

    def reset(self) -> None:
        """
        Open the gate again; the output goes on from where it is, within the rate limit.
        """

STRAP_ESTIMATOR_PARAMETER_NAMES: tuple[str, ...]

class StrapEstimator:
    """
    The strap's stiffness and damping while it is worn, by recursive least squares with forgetting.

    Parameters
    ----------
    parameters : (21,)
        In the order of STRAP_ESTIMATOR_PARAMETER_NAMES, SI; strap_stiffness and strap_damping are where it starts.
    """

    def __init__(self, parameters: ArrayLike) -> None: ...
    def step(
        self, position: float, torque: float, emg_torque: float, emg_valid: bool = True
    ) -> tuple[float, float, bool]:
        """
        One control period: stiffness [N m/rad], damping [N m s/rad], and whether it taught anything.
        """

class EmgTorque:
    """
    Raw EMG to a joint torque, causally.

    Parameters
    ----------
    band, envelope : (k, 6)
        Second-order sections before and after rectification, as scipy.signal designs them; k at most 4 and 2.
    weights : (muscles + 1, powers)
        Of the angle's powers 0, 1, ...: row 0 without EMG [N m/rad^p], then by muscle [N m/(V rad^p)]; at most (5, 4).
    floor, ceiling : (muscles,)
        Envelopes outside are no muscle's [V].
    patience : int
        Samples in a row outside before EMG is not valid.
    torque_limit : float
        Of |torque| [N m], > 0.
    """

    def __init__(
        self,
        *,
        band: ArrayLike,
        envelope: ArrayLike,
        weights: ArrayLike,
        floor: ArrayLike,
        ceiling: ArrayLike,
        patience: int,
        torque_limit: float,
    ) -> None: ...
    def listen(self, samples: ArrayLike) -> None:
        """
        Raw samples of every muscle.

        Parameters
        ----------
        samples : (n, muscles)
            [V].
        """

    def torque(self, position: float) -> float:
        """Torque at this joint angle [rad], finite and within its limit [N m]."""

    @property
    def valid(self) -> bool:
        """Whether what the electrodes say can be a muscle."""

    @property
    def levels(self, /) -> tuple[float, ...]:
        """The envelopes [V]."""

    def reset(self) -> None:
        """Forget all samples."""

class Law:
    """
    A control law behind the front that it has on a robot too: what may not be believed does not reach it.

    What goes out has passed the safety gate: finite and within the limits, whatever comes in. A fault latches, and the
    effort ramps to 0. Made by `law`.
    """

    @property
    def name(self) -> str:
        """Of `laws`."""

    def step(self, time: float, *samples: float | None) -> float:
        """
        One control period: the effort for the drive [N m].

        Parameters
        ----------
        time : float
            When everything was measured [s].
        *samples : float or None
            In the order of the law's sensors, SI; None, NaN or left out: the sensor says nothing.
        """

    def run(self, time: ArrayLike, *samples: ArrayLike) -> NDArray[float64]:
        """
        step, one period after another.

        Parameters
        ----------
        time, *samples : (n,)
            As `step` takes them.

        Returns
        -------
        (n,)
            Efforts [N m].
        """

    def step_samples(self, now: int, samples: Sequence[tuple[float, int, int, bool]]) -> float:
        """
        One control period as on a robot, where each sample has its own age.

        Parameters
        ----------
        now : int
            The time of this step [us].
        samples : sequence of (float, int, int, bool)
            Value, sequence number, time [us] and whether its sensor vouches for it; in the order of the law's sensors.

        Returns
        -------
        float
            [N m].
        """

    def configure(self, parameters: ArrayLike) -> None:
        """
        Other numbers, from the next period on; what the law remembers stays.

        Parameters
        ----------
        parameters : (k,)
            As `law` takes them.
        """

    def reset(self) -> None:
        """
        Open the gate again and start from the next sample; the effort goes on from where it is.
        """

    def stop(self) -> None:
        """
        From the next step on the effort ramps to 0, and stays there until reset.
        """

    @property
    def fault(self) -> str:
        """
        Why the effort is 0, or on its way there; 'none' while the gate is open.
        """

    @property
    def estimates(self, /) -> dict[str, float]:
        """What the law observes, by name, SI; empty where it observes nothing."""

def law(name: str, parameters: ArrayLike, single: bool = False) -> Law:
    """
    A law of the list.

    Parameters
    ----------
    name : str
        Of `laws`.
    parameters : (k,)
        Its numbers, SI, in the order of its fields.
    single : bool
        In float32, as on a microcontroller.

    Returns
    -------
    Law
        At rest; its fault is "configuration" where the numbers make no sense.
    """

def laws() -> list[dict]:
    """
    Every law.

    Returns
    -------
    list of dict
        name, type (in C++), title; sensors: name, dimension, meaning, required, swing, noise of each; fields: name,
        dimension (powers of effort, coordinate, time; or a unit), default, lower, upper, above, below (an end is
        outside), infinite (infinity is allowed), count, sentence of each; storage [bytes] of it in float.
    """

def fuzz_law(
    law: str, parameters: ArrayLike, cycles: int, seed: int, single: bool = False
) -> tuple[int, int, int, int]:
    """
    A law among nonsense: NaN, infinities, jumps, frozen and repeated samples, clock jumps.

    Parameters
    ----------
    law : str
    parameters : (k,)
    cycles, seed : int
    single : bool
        In float32, as on a microcontroller.

    Returns
    -------
    tuple
        Commands outside the limits (unsafe), faults, most cycles from a fault to a safe output, cycles with a torque.
    """

def time_law(law: str, parameters: ArrayLike, cycles: int, single: bool = False) -> NDArray[float64]:
    """
    Nanoseconds of single control steps of a law on a smooth motion, each timed by itself.

    Parameters
    ----------
    law : str
    parameters : (k,)
    cycles : int
    single : bool

    Returns
    -------
    (cycles,)
        [ns], the clock's own cost taken off.
    """

FAULTS: tuple = ...

MODES: tuple = ...

class Supervised:
    """
    A control law under its supervisor, as on a robot. Made by `supervised`.
    """

    def step(
        self,
        time: float,
        *samples: float | None,
        drive: float | None = None,
        joint: float | None = None,
        token: int = 0,
    ) -> float:
        """
        One control period: the effort for the drive [N m].

        Parameters
        ----------
        time : float
            When everything was measured [s].
        *samples : float or None
            In the order of the law's sensors, SI; None, NaN or left out: the sensor says nothing.
        drive, joint : float or None
            The effort that the drive measures [N m], and a second encoder [rad].
        token : int
            The challenge, sent back by an operator who asks for a reset; 0: nobody asks.
        """

    def step_samples(self, now: int, samples: Sequence[tuple[float, int, int, bool]], token: int = 0) -> float:
        """
        One control period as on a robot, where each sample has its own age.

        Parameters
        ----------
        now : int
            The time of this step [us].
        samples : sequence of (float, int, int, bool)
            Value, sequence number, time [us] and whether its sensor vouches for it; in the order of the law's sensors,
            then of the drive's measurement and of a second encoder.
        token : int
            As `step` takes it.

        Returns
        -------
        float
            [N m].
        """

    def configure(self, parameters: ArrayLike, supervisor: ArrayLike) -> bool:
        """Starts again with other numbers; a fault that is latched stays so."""

    def adjust(self, parameters: ArrayLike) -> None:
        """
        Other numbers of the law, from the next period on; what it remembers stays.
        """

    def record(self, records: int, decimation: int = 1, after: int = 0) -> None:
        """
        From the next period on, keeps the last periods; where the supervisor stops, what went before and after stays.

        Parameters
        ----------
        records : int
            How many are kept; 0: none.
        decimation : int
            Periods of one record.
        after : int
            Records after the one in which the supervisor stops.
        """

    def incident(self, slides: bool = False) -> bytes:
        """
        What was recorded, as the bytes of a file that `pellucid.incident` reads; it then begins anew.

        Parameters
        ----------
        slides : bool
            The joint is prismatic.

        Returns
        -------
        bytes
        """

    @property
    def is_recorded(self) -> bool:
        """Whether it has stopped and what followed is recorded too."""

    def stop(self) -> None:
        """From the next step on it stops, and stays stopped until reset."""

    @property
    def effort(self) -> float:
        """The last [N m]."""

    @property
    def fault(self) -> str:
        """The first, latched; 'none'."""

    @property
    def mode(self) -> str:
        """
        What it does: start_up, running, degraded, damped_stop, zero or latched.
        """

    @property
    def enable(self) -> bool:
        """False: the drive must take its power off."""

    @property
    def challenge(self) -> int:
        """What a reset needs as its token; 0 while all is well."""

    @property
    def estimates(self, /) -> dict[str, float]:
        """What the law estimates beside its effort, by name."""

    @property
    def probe_answer(self, /) -> tuple[tuple[float, ...], int]:
        """
        What the robot has answered the probe's three waves so far, real and imaginary parts, and from how many windows.
        """

    @property
    def beat(self) -> int:
        """Counts periods, for the drive's watchdog."""

    @property
    def log(self, /) -> list[tuple[int, str, str]]:
        """
        The last faults, the latest first: period, fault, and what was then done.
        """

def supervised(name: str, parameters: ArrayLike, supervisor: ArrayLike, single: bool = False) -> Supervised:
    """
    A law of the list under its supervisor.

    Parameters
    ----------
    name : str
        Of `laws`.
    parameters : (k,)
        The law's numbers, SI.
    supervisor : (m,)
        In the order of model_fields()["supervisor"].
    single : bool
        In float32, as on a microcontroller.

    Returns
    -------
    Supervised
    """

def supervised_storage(name: str) -> int:
    """Bytes of a supervised law in float."""

def fuzz_supervised(
    name: str, parameters: ArrayLike, supervisor: ArrayLike, cycles: int, seed: int, single: bool = False
) -> tuple[int, int, int, int]:
    """
    A supervised law among nonsense: numbers, clocks, drives, tokens and memory that go wrong.

    Parameters
    ----------
    name : str
    parameters : (k,)
    supervisor : (m,)
    cycles, seed : int
    single : bool

    Returns
    -------
    tuple
        Efforts beyond the limits or that are no number, or power while latched (unsafe); faults; cycles with an effort;
        resets that were granted.
    """

def time_supervisor(name: str, parameters: ArrayLike, supervisor: ArrayLike, cycles: int, turns: int) -> float:
    """
    Nanoseconds that a supervisor adds to a step of a law on a smooth motion, mean over `cycles`, least of `turns`.
    """

COUPLED_PARAMETER_NAMES: tuple[str, ...]

class CoupledPlant:
    """
    A motor, a series spring, an orthosis, a strap and a limb, under the actuator's own torque loop.

    Parameters
    ----------
    parameters : (n,)
        In the order of COUPLED_PARAMETER_NAMES, SI.
    period : float
        Of control [s], > 0.
    substeps : int
        Of integration, per period.
    delay : int
        Periods from the encoders' reading to the motor, 0 to 7.
    torque_span : int
        Periods that the torque loop's difference spans, 1 to 7.
    position0, torque0 : float
        The orthosis at first [rad], and the spring's torque [N m]; everything rests, and the limb is where the strap
        carries what is left of the orthosis's weight.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        *,
        period: float,
        substeps: int = 10,
        delay: int = 0,
        torque_span: int = 1,
        position0: float = 0.0,
        torque0: float = 0.0,
    ) -> None: ...
    def step(
        self, desired_torque: float, muscle_torque: float, slip_jump: float = 0.0, base_torque: float = 0.0
    ) -> tuple[float, ...]:
        """
        One control period.

        Parameters
        ----------
        desired_torque : float
            Of the spring [N m]; 0 is zero-impedance mode.
        muscle_torque : float
            On the limb, held over the period [N m].
        slip_jump : float
            By which the strap slips at once [rad].
        base_torque : float
            Of a thigh that moves, on the orthosis, held over the period [N m].

        Returns
        -------
        tuple of float
            At the period's end: position, motor_position [rad] and torque [N m] as the encoders say; orthosis_position
            [rad], orthosis_velocity [rad/s], limb_position [rad], limb_velocity [rad/s], strap_torque on the orthosis
            and spring_torque [N m] as they are; the motor_torque of the period; and limb_torque, of the strap against
            the limb, the same but where it sits askew [N m].
        """

    def read(self) -> tuple[float, ...]:
        """
        What holds now, as `step` returns it, with a motor_torque of 0: no period ends here.
        """

    @property
    def slip(self) -> float:
        """Of the strap, so far [rad]."""

REACHING_PARAMETER_NAMES: tuple[str, ...]

POSTURAL_PARAMETER_NAMES: tuple[str, ...]

OPTIMAL_PARAMETER_NAMES: tuple[str, ...]

PERSON_MODELS: tuple = ("reaching", "postural", "optimal")

class WornElbow:
    """
    A person's forearm, alone or strapped to a robot under a control law.

    Parameters
    ----------
    parameters : (k,)
        Of the person, in the order of the model's names (REACHING_PARAMETER_NAMES), SI; its period is that of control.
    load : (5,)
        What the person expects of the robot at first: inertia, viscous, coulomb, gravity_sine, gravity_cosine, SI.
    position0 : float
        Where the forearm is held at first [rad].
    robot : (22,), optional
        In the order of GEARED_PARAMETER_NAMES, SI; left out: the forearm alone.
    strap : (11,)
        In the order of STRAP_PARAMETER_NAMES, SI.
    drive : (5,)
        Torque per ampere [N m/A], current limit [A], ripple amplitude [N m], its wave number [1/rad], and the encoder's
        quantum [rad].
    law : str
        "none", or a name of `laws`.
    law_parameters : (k,), optional
        In the order of the law's names, SI.
    emg_gains : (2,)
        By which the law's EMG torques of flexors and extensors are too large [1].
    substeps : int
        Of integration, per period.
    person : str
        Model of the person, one of PERSON_MODELS.
    sensor_delay : int
        Periods by which the force sensor is late, 0 to 63.
    supervisor : (m,), optional
        In the order of SUPERVISOR_FIELDS, SI; left out: a supervisor that holds nothing against anybody.
    drive_reading : (4,), optional
        How the drive measures its own effort, in the order of DRIVE_READING_NAMES, SI; left out: exactly.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        load: ArrayLike,
        *,
        position0: float,
        robot: ArrayLike | None = None,
        strap: ArrayLike,
        drive: ArrayLike,
        law: str = "none",
        law_parameters: ArrayLike | None = None,
        emg_gains: ArrayLike,
        substeps: int,
        person: str = "reaching",
        sensor_delay: int = 0,
        supervisor: ArrayLike | None = None,
        drive_reading: ArrayLike | None = None,
    ) -> None: ...
    def move(
        self,
        *,
        target: float,
        amplitude: float,
        duration: float,
        reaction: float,
        load: ArrayLike,
        tolerance: float,
        hold: float,
        noise: ArrayLike,
        longest: int,
        sensor_error: ArrayLike | None = None,
        emg: bool = False,
        command: Callable[[float, float, float], float] | None = None,
    ) -> tuple[NDArray[float64], ...]:
        """
        One movement to a target, and holding it.

        Parameters
        ----------
        target, amplitude, duration, reaction : float
            Where to [rad], the primary movement's amplitude [rad] and duration [s], and when it starts [s].
        load : (5,)
            What is expected of the robot, SI.
        tolerance, hold : float
            The movement ends when the target has been held this closely [rad] for so long [s].
        noise : (n, 5)
            Standard normal: flexors, extensors, the encoder (already in rad), EMG of flexors and of extensors; after n
            periods it begins again.
        longest : int
            The most periods that it may take.
        sensor_error : (n,), optional
            Noise and offset of the force sensor [N m]; left out: there is none, and the law gets none.
        emg : bool
            Whether the law gets EMG.
        command : callable, optional
            Gives the effort [N m] of a law "joint" each period, of the time [s], the encoder [rad] and the force sensor
            [N m]; NaN stops the law.

        Returns
        -------
        tuple of (k,)
            Limb position [rad], velocity [rad/s], acceleration [rad/s^2]; the encoder [rad]; torque of the wearer on
            the robot [N m], the law's torque [N m], excitation of flexors and of extensors [1], link velocity
            [rad/s]; k <= longest.
        """

    def live(
        self,
        *,
        tasks: ArrayLike,
        noise: ArrayLike,
        sensor_error: ArrayLike | None,
        emg: bool,
        tremor: ArrayLike,
        stops: ArrayLike,
        fault: str,
        onset: float,
        seconds: float,
        longest: int,
        seed: int,
        drive_noise: ArrayLike | None = None,
        command: Callable[[float, float, float], float] | None = None,
    ) -> dict:
        """
        Minutes or hours of reaching, healthy or with one single fault, of a person who is "reaching".

        Parameters
        ----------
        tasks : (k, 5)
            Target [rad], amplitude [rad], duration [s], reaction [s] and the whole time [s] of each movement; after the
            last the first comes again.
        noise : (n, 5)
            As `move` takes it.
        sensor_error : (n,) or None
            As `move` takes it.
        emg : bool
            Whether the law gets EMG.
        tremor : (2,)
            Amplitude [N m] and angular frequency [rad/s] of the wearer's tremor.
        stops : (m,)
            When the wearer stops the arm suddenly [s], in order.
        fault : str
            "none", or a name of `single_faults`.
        onset, seconds : float
            When it begins, and how long it is watched if nothing finds it [s].
        longest : int
            The most periods.
        seed : int
            Of what the fault draws.
        drive_noise : (n,), optional
            Noise of the drive's own measurement [N m]; after n periods it begins again.
        command : callable, optional
            As `move` takes it.

        Returns
        -------
        dict
            found, safe: periods after the onset until the supervisor acted, and until the output was safe, -1
            for never; fault, mode: what it found and did; early: periods with a fault before the onset; energy:
            positive work on the limb since the onset, every 5 periods [J]; peak: largest torque of the strap on
            the limb from onset to safe [N m]; impulse: of the drive from the onset to safe [N m s]; speed:
            largest of the limb from onset to safe [rad/s]; onset_speed: least of the motor in the 5 periods
            before the onset [rad/s]; periods; how near it came to a fault before there was one: lasting, push,
            contradiction, burst, excess [N m], spent [J], ringing [N m], surplus of the drive [J], probe (its
            evidence) [1]; and the work of the test [J].
        """

    @property
    def lasting(self) -> dict:
        """
        What of a person outlasts a movement, and how the last went; empty where the model has nothing.
        """

    @property
    def fault(self) -> str:
        """Why its supervisor has stopped; 'none' while all is well."""

DRIVE_READING_NAMES: tuple = ("gain", "offset", "lag", "quantum")

class DriveReading:
    """
    What a drive's own measurement makes of the effort that it gives.

    Parameters
    ----------
    parameters : (4,)
        In the order of DRIVE_READING_NAMES, SI.
    period : float
        [s].
    """

    def __init__(self, parameters: ArrayLike | None, period: float) -> None: ...
    def step(self, effort: float, noise: float = 0.0) -> float:
        """
        The reading [N m] at the end of a period in which the drive gave `effort` [N m]; `noise` [N m].
        """

def optimal_policy(
    parameters: ArrayLike, load: ArrayLike, *, amplitude: float, target: float, duration: float, variance: float
) -> dict:
    """
    What a person who reaches by optimal feedback settles before a movement.

    Parameters
    ----------
    parameters : (k,)
        In the order of OPTIMAL_PARAMETER_NAMES, SI.
    load : (5,)
        What is expected of the robot, SI.
    amplitude, target, duration : float
        How far [rad], where to [rad], and how long a movement of minimum jerk would be [s].
    variance : float
        Of unexpected torque, as reckoned with [N^2 m^2].

    Returns
    -------
    dict
        unit_time [s]; moving, holding: gains of error, speed, torque and torque rate, shape (4,), SI; cocontraction
        [1]; stiffness [N m/rad], damping [N m s/rad]; transition, shape (3, 3), of position, velocity and unexpected
        torque, over a period; belief and now, shape (3, 2): what a felt position and velocity change of them, as of
        then and as of now.
    """

def single_faults() -> list[dict]:
    """
    Faults of `WornElbow.live`: name, group, sentence, needs (a sensor), at_start, joint_encoder, hidden (why).
    """

EMG_FAULTS: tuple = ...

class EmgEstimator:
    """
    Torque of joints from EMG and angles as they arrive, by muscles or by a map.

    Parameters
    ----------
    channels : (c, 3)
        Scale, rest and ceiling of each channel of EMG; at most 32.
    angles : int
        How many angles are given, 1 to 16.
    muscles : (m, 18)
        A row per muscle in the order of MUSCLE_PARAMETER_NAMES; at most 64.
    shares : (m, c)
        Of each channel's envelope in each muscle's excitation.
    axes : (m, 2, 6)
        Of each muscle's path: index of the angle (below 0: none), sign, offset, start, step, cells (0: no axis).
    surfaces : sequence of (k,)
        Coefficients of each path [m], the last axis fastest.
    joints : (j, 5)
        Index of the angle, offset, stiffness, damping and limit of each joint; at most 8.
    terms : sequence of (k, 3)
        Weight and features of each joint's map; -1 is no feature.
    lags : (l,) of int
        How much earlier the map sees envelopes too, in samples; at most 4, below 512.
    motion : (1, 6)
        Second-order section on angles before they are differentiated.
    before, after : (k, 6)
        Sections before and after raw EMG is rectified, at most 6 and 4; None: envelopes are given.
    gamma, tendon_strain : float
        Of short-range stiffness [1].
    period : float
        From one step to the next [s], > 0.
    patience : int
        Periods that what is silent keeps its last value.
    watch : (c, 5)
        Consequence, usual error, square, product and square of the pattern of each channel; None: none is watched.
    patterns : sequence of (k, 3)
        Weight and features of each channel's pattern, of angles alone; -1 is no feature.
    ranges : (a, 4)
        Smallest and largest of each angle [rad] and of its rate [rad/s] in the calibration, with margins.
    forgetting, max_loss : float
        Share of a mean that a step replaces; share of the torque's variance at which a channel has changed.
    """

    def __init__(
        self,
        *,
        channels: ArrayLike,
        angles: int,
        muscles: ArrayLike,
        shares: ArrayLike,
        axes: ArrayLike,
        surfaces: Sequence[ArrayLike],
        joints: ArrayLike,
        terms: Sequence[ArrayLike],
        lags: ArrayLike,
        motion: ArrayLike,
        before: ArrayLike | None = None,
        after: ArrayLike | None = None,
        gamma: float = 23.4,
        tendon_strain: float = 0.033,
        period: float,
        patience: int,
        watch: ArrayLike | None = None,
        patterns: Sequence[ArrayLike] = (),
        ranges: ArrayLike | None = None,
        forgetting: float = 0.0,
        max_loss: float = 0.0,
    ) -> None: ...
    def listen(self, samples: ArrayLike) -> None:
        """
        Raw EMG of every channel, (n, c), at the rate that the filters are made for.
        """

    def step(self, time: int, envelope: ArrayLike, angle: ArrayLike) -> tuple[NDArray[float64], int, int, int, int]:
        """
        One period.

        Parameters
        ----------
        time : int
            On any clock that only goes on [us].
        envelope : (c,)
            Of each channel; NaN where it was not heard. Without meaning where raw EMG goes through listen.
        angle : (a,)
            [rad]; NaN where it was not heard.

        Returns
        -------
        torque : (j,)
            [N m], finite and within each limit.
        fault : int
            Index into EMG_FAULTS of the gravest, 0 for none.
        lost, above, blind : int
            Channels lost, channels above their ceiling, angles lost: a bit each.
        """

    def run(
        self, time: ArrayLike, envelope: ArrayLike, angle: ArrayLike
    ) -> tuple[NDArray[float64], NDArray[float64], NDArray[float64], NDArray[float64]]:
        """
        Periods one after another, going on from the state.

        Parameters
        ----------
        time : (n,) of int
            [us].
        envelope : (c, n)
        angle : (a, n)
            As of step.

        Returns
        -------
        torque : (j, n)
            [N m].
        fault : (n,)
            As of step.
        short_range, slope : (j, j, n)
            Stiffness of the joints [N m/rad], row by the torque, column by the angle.
        """

    def stiffness(self) -> tuple[NDArray[float64], NDArray[float64]]:
        """
        Of the joints at the last step, at once and by Hill's slope, (j, j) each [N m/rad].
        """

    @property
    def forces(self) -> NDArray[float64]:
        """In each tendon at the last step, (m,) [N]."""

    @property
    def activations(self) -> NDArray[float64]:
        """Of each muscle at the last step, (m,) [1]."""

    @property
    def levels(self) -> NDArray[float64]:
        """Envelope of each channel as it was last heard, (c,)."""

    @property
    def changed(self) -> int:
        """
        Channels that changed since the calibration, at the last step, a bit each.
        """

    @property
    def losses(self) -> NDArray[float64]:
        """
        Share of the torque's variance that each channel may cost at the last step, (c,).
        """

    def reset(self) -> None:
        """Forget every sample."""

class EmgEstimatorFloat:
    """
    Torque of joints from EMG and angles as they arrive, by muscles or by a map.

    Parameters
    ----------
    channels : (c, 3)
        Scale, rest and ceiling of each channel of EMG; at most 32.
    angles : int
        How many angles are given, 1 to 16.
    muscles : (m, 18)
        A row per muscle in the order of MUSCLE_PARAMETER_NAMES; at most 64.
    shares : (m, c)
        Of each channel's envelope in each muscle's excitation.
    axes : (m, 2, 6)
        Of each muscle's path: index of the angle (below 0: none), sign, offset, start, step, cells (0: no axis).
    surfaces : sequence of (k,)
        Coefficients of each path [m], the last axis fastest.
    joints : (j, 5)
        Index of the angle, offset, stiffness, damping and limit of each joint; at most 8.
    terms : sequence of (k, 3)
        Weight and features of each joint's map; -1 is no feature.
    lags : (l,) of int
        How much earlier the map sees envelopes too, in samples; at most 4, below 512.
    motion : (1, 6)
        Second-order section on angles before they are differentiated.
    before, after : (k, 6)
        Sections before and after raw EMG is rectified, at most 6 and 4; None: envelopes are given.
    gamma, tendon_strain : float
        Of short-range stiffness [1].
    period : float
        From one step to the next [s], > 0.
    patience : int
        Periods that what is silent keeps its last value.
    watch : (c, 5)
        Consequence, usual error, square, product and square of the pattern of each channel; None: none is watched.
    patterns : sequence of (k, 3)
        Weight and features of each channel's pattern, of angles alone; -1 is no feature.
    ranges : (a, 4)
        Smallest and largest of each angle [rad] and of its rate [rad/s] in the calibration, with margins.
    forgetting, max_loss : float
        Share of a mean that a step replaces; share of the torque's variance at which a channel has changed.
    """

    def __init__(
        self,
        *,
        channels: ArrayLike,
        angles: int,
        muscles: ArrayLike,
        shares: ArrayLike,
        axes: ArrayLike,
        surfaces: Sequence[ArrayLike],
        joints: ArrayLike,
        terms: Sequence[ArrayLike],
        lags: ArrayLike,
        motion: ArrayLike,
        before: ArrayLike | None = None,
        after: ArrayLike | None = None,
        gamma: float = 23.4,
        tendon_strain: float = 0.033,
        period: float,
        patience: int,
        watch: ArrayLike | None = None,
        patterns: Sequence[ArrayLike] = (),
        ranges: ArrayLike | None = None,
        forgetting: float = 0.0,
        max_loss: float = 0.0,
    ) -> None: ...
    def listen(self, samples: ArrayLike) -> None:
        """
        Raw EMG of every channel, (n, c), at the rate that the filters are made for.
        """

    def step(self, time: int, envelope: ArrayLike, angle: ArrayLike) -> tuple[NDArray[float64], int, int, int, int]:
        """
        One period.

        Parameters
        ----------
        time : int
            On any clock that only goes on [us].
        envelope : (c,)
            Of each channel; NaN where it was not heard. Without meaning where raw EMG goes through listen.
        angle : (a,)
            [rad]; NaN where it was not heard.

        Returns
        -------
        torque : (j,)
            [N m], finite and within each limit.
        fault : int
            Index into EMG_FAULTS of the gravest, 0 for none.
        lost, above, blind : int
            Channels lost, channels above their ceiling, angles lost: a bit each.
        """

    def run(
        self, time: ArrayLike, envelope: ArrayLike, angle: ArrayLike
    ) -> tuple[NDArray[float64], NDArray[float64], NDArray[float64], NDArray[float64]]:
        """
        Periods one after another, going on from the state.

        Parameters
        ----------
        time : (n,) of int
            [us].
        envelope : (c, n)
        angle : (a, n)
            As of step.

        Returns
        -------
        torque : (j, n)
            [N m].
        fault : (n,)
            As of step.
        short_range, slope : (j, j, n)
            Stiffness of the joints [N m/rad], row by the torque, column by the angle.
        """

    def stiffness(self) -> tuple[NDArray[float64], NDArray[float64]]:
        """
        Of the joints at the last step, at once and by Hill's slope, (j, j) each [N m/rad].
        """

    @property
    def forces(self) -> NDArray[float64]:
        """In each tendon at the last step, (m,) [N]."""

    @property
    def activations(self) -> NDArray[float64]:
        """Of each muscle at the last step, (m,) [1]."""

    @property
    def levels(self) -> NDArray[float64]:
        """Envelope of each channel as it was last heard, (c,)."""

    @property
    def changed(self) -> int:
        """
        Channels that changed since the calibration, at the last step, a bit each.
        """

    @property
    def losses(self) -> NDArray[float64]:
        """
        Share of the torque's variance that each channel may cost at the last step, (c,).
        """

    def reset(self) -> None:
        """Forget every sample."""

def muscle_path(
    axes: ArrayLike, surface: ArrayLike, angle: ArrayLike
) -> tuple[NDArray[float64], NDArray[float64], NDArray[float64]]:
    """
    Lengths of one muscle with its tendon, and their derivatives by the angles given.

    Parameters
    ----------
    axes : (2, 6)
        As of EmgEstimator.
    surface : (k,)
        Coefficients [m].
    angle : (a, n)
        [rad].

    Returns
    -------
    length : (n,)
        [m].
    slope : (2, n)
        By the angle of each axis [m/rad]; the moment arm is its negative.
    bend : (2, 2, n)
        Second derivatives [m/rad^2].
    """

class WornOrthosis:
    """
    The orthosis of `CoupledPlant` under a supervised law, healthy until a fault is told.

    Parameters
    ----------
    parameters, period, substeps, delay, torque_span, position0
        As `CoupledPlant` takes them; the spring has no torque at first.
    law : str
        A name of `laws`, of those that read position, spring torque and EMG.
    law_parameters : (k,)
        In the order of the law's names, SI.
    supervisor : (m,)
        In the order of SUPERVISOR_FIELDS, SI.
    drive_reading : (4,), optional
        How the torque of the spring is measured for the supervisor, in the order of DRIVE_READING_NAMES, SI; left out:
        exactly. The law reads it exactly.
    command : callable, optional
        Function of the time [s], the encoder [rad] and the spring's torque [N m], NaN where it says nothing, that gives
        the effort of a law "joint" in each period [N m], as `WornElbow.live` takes it; NaN stops the law.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        *,
        period: float,
        substeps: int,
        delay: int,
        torque_span: int,
        position0: float,
        law: str,
        law_parameters: ArrayLike,
        supervisor: ArrayLike,
        drive_reading: ArrayLike | None = None,
        command: Callable[[float, float, float], float] | None = None,
    ) -> None: ...
    def step(self, muscle_torque: float, emg: float, reading_noise: float = 0.0) -> tuple[float, ...]:
        """
        One control period.

        Parameters
        ----------
        muscle_torque : float
            On the limb, held over the period [N m].
        emg : float
            What the law's EMG chain makes of it [N m]; NaN: nothing.
        reading_noise : float
            Noise of the measurement that the supervisor reads [N m].

        Returns
        -------
        tuple of float
            At the period's end: limb position [rad] and velocity [rad/s], strap torque against the limb [N m], spring
            torque [N m], and the orthosis's velocity [rad/s].
        """

    def begin(self, fault: str, seed: int) -> None:
        """A fault of `single_faults` from the next period on."""

    def copy(self) -> WornOrthosis:
        """Another one in the same state."""

    @property
    def fault(self) -> str:
        """As of its supervisor."""

    @property
    def mode(self) -> str:
        """What its supervisor does."""

    @property
    def effort(self) -> float:
        """That the spring was asked for [N m]."""

    @property
    def off(self) -> int:
        """Periods without power, or on the way there."""

MUSCLE_PARAMETER_NAMES: tuple[str, ...]

def hill_torque(
    parameters: ArrayLike,
    excitation: ArrayLike,
    length: ArrayLike,
    velocity: ArrayLike,
    moment_arm: ArrayLike,
    *,
    period: float,
    starts: ArrayLike | None = None,
) -> NDArray[float64]:
    """
    Torque of several muscles from their EMG envelopes, at one joint or at j of them.

    Parameters
    ----------
    parameters : (m, 18)
        A row per muscle in the order of MUSCLE_PARAMETER_NAMES, SI.
    excitation, length, velocity, moment_arm : (m, n)
        Envelopes relative to maximal effort [1], musculotendon lengths [m] and their rates [m/s], moment arms about the
        joint, positive where the muscle pulls along +q [m]; moment_arm (j, m, n) for several joints, at most 8.
    period : float
        From one sample to the next [s], > 0.
    starts : (r,) of int
        First sample of each recording, ascending from 0; left out, all samples are one. Lags begin settled.

    Returns
    -------
    (n,) or (j, n)
        [N m].
    """

def hill_jacobian(
    parameters: ArrayLike,
    excitation: ArrayLike,
    length: ArrayLike,
    velocity: ArrayLike,
    moment_arm: ArrayLike,
    column: ArrayLike,
    gain: ArrayLike,
    *,
    period: float,
    starts: ArrayLike | None = None,
) -> tuple[NDArray[float64], NDArray[float64]]:
    """
    hill_torque and its exact derivatives by k free parameters.

    Parameters
    ----------
    parameters : (m, 18)
    excitation, length, velocity, moment_arm : (m, n)
        As of hill_torque.
    column : (m, 11) of int
        Which free parameter drives each of the first 11 quantities of each muscle; -1: none. One may drive several.
    gain : (m, 11)
        d quantity / d parameter.
    period : float
    starts : (r,) of int
        As of hill_torque.

    Returns
    -------
    torque : (n,) or (j, n)
        [N m].
    jacobian : (k, n) or (k, j, n)
        A row per free parameter.
    """

def hill_normal(
    parameters: ArrayLike,
    excitation: ArrayLike,
    length: ArrayLike,
    velocity: ArrayLike,
    moment_arm: ArrayLike,
    column: ArrayLike,
    gain: ArrayLike,
    measured: ArrayLike,
    *,
    period: float,
    starts: ArrayLike | None = None,
    weight: ArrayLike | None = None,
) -> tuple[float, NDArray[float64], NDArray[float64]]:
    """
    What a least-squares step needs, in one pass and without storing a Jacobian.

    Parameters
    ----------
    parameters : (m, 18)
    excitation, length, velocity, moment_arm : (m, n)
    column : (m, 11) of int
    gain : (m, 11)
        As of hill_jacobian.
    measured : (n,) or (j, n)
        Torque to be met [N m].
    period : float
    starts : (r,) of int
        As of hill_torque.
    weight : (n,) or (j, n)
        By which every residual is multiplied; left out, 1.

    Returns
    -------
    cost : float
        Half the sum of the squares of r = weight (torque - measured).
    gradient : (k,)
        J' r.
    normal : (k, k)
        J' J.
    """

def hill_states(
    parameters: ArrayLike,
    excitation: ArrayLike,
    length: ArrayLike,
    velocity: ArrayLike,
    *,
    period: float,
    starts: ArrayLike | None = None,
) -> tuple[NDArray[float64], NDArray[float64], NDArray[float64], NDArray[float64]]:
    """
    What each muscle does.

    Parameters
    ----------
    parameters : (m, 18)
    excitation, length, velocity : (m, n)
    period : float
    starts : (r,) of int
        As of hill_torque.

    Returns
    -------
    activation : (m, n)
        [1].
    force : (m, n)
        In the tendon [N].
    fibre_length : (m, n)
        [m].
    fibre_velocity : (m, n)
        In v_max l_o, lengthening positive [1].
    """

def activation_dynamics(
    excitation: ArrayLike,
    *,
    period: float,
    activation_time: float = 0.01,
    deactivation_time: float = 0.04,
    start: float = 0.0,
) -> NDArray[float64]:
    """
    Activation from excitation by a first-order lag, quicker while activation rises.

    Parameters
    ----------
    excitation : (n,)
        [1], held over each period; clipped to [0, 1].
    period : float
        [s], > 0.
    activation_time, deactivation_time : float
        [s], > 0.
    start : float
        Activation before the first sample [1].

    Returns
    -------
    (n,)
        At the end of each period [1].
    """

class HillTorque:
    """
    hill_torque sample by sample, causal, as a robot runs it.

    Parameters
    ----------
    parameters : (m, 18)
        A row per muscle in the order of MUSCLE_PARAMETER_NAMES; at most 32.
    period : float
        From one sample to the next [s], > 0. No delay may be longer than 1021 periods.
    """

    def __init__(self, parameters: ArrayLike, *, period: float) -> None: ...
    def step(self, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, moment_arm: ArrayLike) -> float:
        """
        Torque at one sample more [N m].

        Parameters
        ----------
        excitation, length, velocity, moment_arm : (m,)
            As of hill_torque. A sample that is not finite makes the torque so, and does not stay.
        """

    def run(
        self, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, moment_arm: ArrayLike
    ) -> NDArray[float64]:
        """
        Samples one after another, each argument (m, n), going on from the state: torque, (n,) [N m].
        """

    @property
    def forces(self) -> NDArray[float64]:
        """In each tendon at the last sample, (m,) [N]."""

    @property
    def delays(self) -> NDArray[float64]:
        """
        How late slow envelopes arrive in each muscle's activation, delay and lags together, (m,) [s].
        """

    def reset(self) -> None:
        """Forget every sample."""

class ElasticMuscle:
    """
    One muscle on an elastic tendon, sample by sample.

    Parameters
    ----------
    parameters : (18,)
        In the order of MUSCLE_PARAMETER_NAMES; those of envelope and activation are not used.
    tendon_strain : float
        Of the tendon under F_0 [1], > 0.
    period : float
        From one sample to the next [s], > 0.
    """

    def __init__(self, parameters: ArrayLike, *, tendon_strain: float, period: float) -> None: ...
    def rest(self, activation: float, length: float) -> float:
        """
        Fibre and tendon at rest at an activation [1] and a musculotendon length [m]: force [N].
        """

    def step(self, activation: float, length: float) -> float:
        """
        Force in the tendon one period on [N], at an activation [1] and a musculotendon length [m].
        """

    def run(self, activation: ArrayLike, length: ArrayLike) -> tuple[NDArray[float64], NDArray[float64]]:
        """
        Samples one after another, each argument (n,): force [N] and fibre length [m], each (n,).
        """

    @property
    def fibre_length(self) -> float:
        """At the last sample [m]."""

STRAP_PARAMETER_NAMES: tuple[str, ...]

def strap_torque(
    parameters: ArrayLike,
    robot_position: ArrayLike,
    robot_velocity: ArrayLike,
    limb_position: ArrayLike,
    limb_velocity: ArrayLike,
    *,
    period: float,
) -> tuple[NDArray[float64], ...]:
    """
    What a strap does along a motion that is known; at first it has settled.

    Parameters
    ----------
    parameters : (11,)
        In the order of STRAP_PARAMETER_NAMES, SI.
    robot_position, robot_velocity, limb_position, limb_velocity : (n,)
        Angles [rad] and their rates [rad/s].
    period : float
        Between two samples [s], > 0.

    Returns
    -------
    tuple of (n,)
        Torque against the limb and on the robot [N m], and by how much it has slipped [rad].
    """

def strap_torque_jacobian(
    parameters: ArrayLike,
    robot_position: ArrayLike,
    robot_velocity: ArrayLike,
    limb_position: ArrayLike,
    limb_velocity: ArrayLike,
    *,
    period: float,
    active: ArrayLike,
) -> tuple[NDArray[float64], NDArray[float64]]:
    """
    `strap_torque` against the limb, and its derivatives.

    Parameters
    ----------
    parameters, robot_position, robot_velocity, limb_position, limb_velocity, period
        As of `strap_torque`.
    active : (k,) of int
        Which parameters, as indices into STRAP_PARAMETER_NAMES.

    Returns
    -------
    tuple
        Torque against the limb (n,) [N m], and its derivatives (n, k).
    """

STRAP_CONTACT_NAMES: tuple = ...

def strap_response(
    parameters: ArrayLike,
    robot_position: ArrayLike,
    torque: ArrayLike,
    *,
    period: float,
    still: float,
    active: ArrayLike,
    contact: ArrayLike = (0.0, 0.0, 0.0, 0.0),
) -> tuple[NDArray[numpy.float64], ...]:
    """
    Where a limb must be for its strap to pull at the robot as was measured.

    At first the strap has settled. In its gap no torque tells where the limb is: it is then left on the flank that
    pulled last.

    Parameters
    ----------
    parameters : (11,)
        In the order of STRAP_PARAMETER_NAMES, SI.
    robot_position, torque : (n,)
        Angle of the robot [rad], and the strap's torque on it [N m].
    period : float
        Between two samples [s], > 0.
    still : float
        Torque up to which nothing pulls where there is a gap [N m].
    active : (k,) of int
        Which parameters are derived by, as indices into STRAP_PARAMETER_NAMES followed by STRAP_CONTACT_NAMES.
    contact : (4,)
        In the order of STRAP_CONTACT_NAMES, SI: what rubs beside the strap and gives in series with it.

    Returns
    -------
    tuple
        The limb's angle (n,) [rad], its stretch (n,) [rad], the strap's torque against it (n,) [N m], and derivatives
        of the angle (n, k).
    """

LINK_PARAMETER_NAMES: tuple[str, ...]

class KinematicTree:
    """
    Rigid bodies joined in a tree by hinges, slides and welds.

    Of n samples, with m coordinates: a number for each joint that moves, in the order of their links. A single sample
    may be of shape (m,), and its result then is of one sample too.

    Parameters
    ----------
    links : (l, 22)
        The numbers of each link, in the order of LINK_PARAMETER_NAMES, after the link on which it hangs; at most 32.
    gravity : (3,)
        In the base's frame [m/s^2].
    """

    def __init__(self, links: ArrayLike, gravity: ArrayLike) -> None: ...
    @property
    def links(self) -> int:
        """How many links there are."""

    @property
    def coordinates(self) -> int:
        """How many joints move."""

    def inverse_dynamics(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> NDArray[float64]:
        """Effort without friction that moves it so, (n, m) [N m; N]."""

    def gravity(self, position: ArrayLike) -> NDArray[float64]:
        """Effort that holds it where it is, (n, m) [N m; N]."""

    def mass_matrix(self, position: ArrayLike) -> NDArray[float64]:
        """M(q) with rotors, (n, m, m)."""

    def forward_dynamics(
        self, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike, *, held: ArrayLike | None = None
    ) -> NDArray[float64]:
        """
        Acceleration that efforts give without friction, (n, m).

        Parameters
        ----------
        position, velocity, effort : (n, m)
        held : (m,) of bool
            Joints that rest whatever the effort: their acceleration is 0.
        """

    def energy(self, position: ArrayLike, velocity: ArrayLike) -> tuple[NDArray[float64], NDArray[float64]]:
        """Kinetic and potential energy, (n,) each [J]."""

    def placements(self, position: ArrayLike) -> NDArray[float64]:
        """
        Every link's frame in the base's, (n, l, 3, 4): three columns of a rotation and one of a place [m].
        """

    def jacobian(self, position: ArrayLike, link: int, point: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[float64]:
        """
        Velocity of a point of a link by each coordinate's, in the base's axes.

        Parameters
        ----------
        position : (n, m)
        link : int
            From 0.
        point : (3,)
            In the link's frame [m].

        Returns
        -------
        (n, 6, m)
            Three rows of the point's velocity, three of the link's angular velocity.
        """

    def regressor(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        own: ArrayLike | None = None,
        shared: ArrayLike | None = None,
        out: NDArray[float64] | None = None,
    ) -> NDArray[float64]:
        """
        Y with effort = Y theta.

        Parameters
        ----------
        position, velocity, acceleration : (n, m)
        own : (n, m, k)
            Columns of each joint that no other has: its rotor's acceleration, its friction's signs.
        shared : (n, m, s)
            Columns that joints share: those of a motor that moves several.
        out : (n, m, c), C-contiguous
            Where to write, instead of a new array.

        Returns
        -------
        (n, m, c)
            c = 10 l + m k + s columns: m, m c_x, m c_y, m c_z, I_xx, I_xy, I_xz, I_yy, I_yz, I_zz of each link; then
            the own ones, joint after joint; then the shared ones.
        """

    def normal_equations(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        effort: ArrayLike,
        *,
        weight: ArrayLike | None = None,
        own: ArrayLike | None = None,
        shared: ArrayLike | None = None,
    ) -> tuple[NDArray[float64], NDArray[float64], float]:
        """
        What least squares needs of a regressor that is never stored.

        Parameters
        ----------
        position, velocity, acceleration, effort : (n, m)
        weight : (n, m)
            Of squares; left out, 1. What has weight 0 is not read.
        own, shared
            As of regressor.

        Returns
        -------
        normal : (c, c)
            Y' W Y.
        projected : (c,)
            Y' W effort.
        square : float
            effort' W effort.
        """

TREE_JOINT_PARAMETER_NAMES: tuple[str, ...]

TREE_MOTOR_PARAMETER_NAMES: tuple[str, ...]

SERIES_ELASTIC_PARAMETER_NAMES: tuple[str, ...]

class DrivenTree:
    """
    A tree under its motors, with friction, and true stiction of several joints at once.

    Parameters
    ----------
    links : (l, 22)
    gravity : (3,)
        As of KinematicTree.
    joints : (m, 12)
        What loses effort at each joint that moves, in the order of TREE_JOINT_PARAMETER_NAMES.
    period : float
        In which efforts are held [s].
    substeps : int
        Steps of integration in a period.
    turns : (m, m)
        How fast each motor (row) turns by each joint's velocity; left out, each motor turns with its own joint.
    motors : (m, 11)
        Of motors, where turns are given, in the order of TREE_MOTOR_PARAMETER_NAMES; left out, zeros.
    elastic : (m, 13)
        Of each motor behind a spring, in the order of SERIES_ELASTIC_PARAMETER_NAMES; a row of zeros: no spring.
    """

    def __init__(
        self,
        links: ArrayLike,
        gravity: ArrayLike,
        joints: ArrayLike,
        *,
        period: float,
        substeps: int = 4,
        turns: ArrayLike | None = None,
        motors: ArrayLike | None = None,
        elastic: ArrayLike | None = None,
    ) -> None: ...
    def motor_effort(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> NDArray[float64]:
        """
        Effort of each motor that moves it so, friction with it, (n, m) [N m; N].
        """

    def run(self, effort: ArrayLike, outside: ArrayLike | None = None) -> tuple[NDArray[float64], NDArray[float64]]:
        """
        Go on for n periods.

        Parameters
        ----------
        effort : (n, m)
            Of each motor, or (m,) for one period [N m; N].
        outside : (n, m)
            On each joint, from people and payloads; left out, 0.

        Returns
        -------
        position, velocity : (n, m)
            At the start of each period; a velocity that is 0 to the bit belongs to a joint that rests.
        """

    def reset(self, position: ArrayLike | None = None, velocity: ArrayLike | None = None) -> None:
        """
        Where it is and how it moves, (m,) each; left out, 0. Springs then carry the weight.
        """

    @property
    def position(self) -> NDArray[float64]:
        """Of each joint that moves, now [rad; m]."""

    @property
    def motor_position(self) -> NDArray[float64]:
        """Of each motor, now [rad; m]."""

    @property
    def velocity(self) -> NDArray[float64]:
        """Of each joint that moves, now [rad/s; m/s]."""

CUFF_PARAMETER_NAMES: tuple[str, ...]

POSTURE_SERVO_PARAMETER_NAMES: tuple[str, ...]

class WornTree:
    """
    A robot of many joints and the limb that wears it, held together by cuffs; without a limb the robot alone.

    Parameters
    ----------
    links : (l, 22)
    gravity : (3,)
    joints : (m, 11)
        The robot's, as of DrivenTree; at most 12 links.
    period : float
        In which commands are held [s].
    substeps : int
        Steps of integration in a period; they must resolve the springs.
    elastic : (m, 12)
        Of each motor behind a spring, in the order of SERIES_ELASTIC_PARAMETER_NAMES; a row of zeros: no spring.
    drives : (m, 4)
        Effort per command, then amplitude, wave number and phase of a ripple at the motor; left out: efforts.
    lag : float
        Time constant of the drives' torque [s].
    limb_links : (k, 22)
        Of the limb, in the same base.
    limb_joints : (j, 11)
        What loses effort at its joints; left out, nothing.
    servos : (j, 5)
        Muscles of its joints, in the order of POSTURE_SERVO_PARAMETER_NAMES.
    reflex_delay : int
        Of the late part [periods].
    cuffs : (c, 16)
        In the order of CUFF_PARAMETER_NAMES; at most 4.
    """

    def __init__(
        self,
        links: ArrayLike,
        gravity: ArrayLike,
        joints: ArrayLike,
        *,
        period: float,
        substeps: int = 4,
        elastic: ArrayLike | None = None,
        drives: ArrayLike | None = None,
        lag: float = 0.0,
        limb_links: ArrayLike | None = None,
        limb_joints: ArrayLike | None = None,
        servos: ArrayLike | None = None,
        reflex_delay: int = 0,
        cuffs: ArrayLike | None = None,
    ) -> None: ...
    def reset(self, position: ArrayLike | None = None, limb_position: ArrayLike | None = None) -> None:
        """
        Both at rest there; left out, 0. Drives and springs then carry the robot's weight.
        """

    def run(
        self,
        command: ArrayLike,
        wanted: ArrayLike | None = None,
        wanted_velocity: ArrayLike | None = None,
        learnt: ArrayLike | None = None,
    ) -> tuple[NDArray[float64], ...]:
        """
        Go on for n periods.

        Parameters
        ----------
        command : (n, m)
            Of each drive, or (m,) for one period.
        wanted, wanted_velocity, learnt : (n, j)
            Where the limb's joints are meant to be [rad], how fast [rad/s], the torque learnt for it [N m]; or 0.

        Returns
        -------
        position, velocity, motor : (n, m)
        limb_position, limb_velocity : (n, j)
        on_robot : (n, m)
            What the cuffs do to the robot's joints [N m; N].
        on_limb : (n, j)
            What they do to the limb's [N m].
        pull : (n, c, 6)
            Force [N] and moment [N m] of each cuff on the robot, in the axes of the robot's link.
            All at the start of each period.
        """

    def follow(
        self,
        reference: ArrayLike,
        gains: ArrayLike,
        *,
        loop: str,
        velocity_span: int,
        quantum: ArrayLike,
        noise: ArrayLike,
    ) -> tuple[NDArray[float64], ...]:
        """
        The robot's own controllers for n periods, a loop at each motor.

        Parameters
        ----------
        reference : (n, m)
            [rad; m], of velocity_pi [rad/s; m/s].
        gains : (m, 5)
            kp, ki, kd, kv and limit of each loop, as of `simulate`.
        loop : str
            As of `simulate`.
        velocity_span : int
            Samples that a measured velocity spans.
        quantum : (m,)
            What each encoder, on the motor, resolves.
        noise : (n, m)
            Added to what it reads.

        Returns
        -------
        command, measured, position, velocity : (n, m)
            At the start of each period; position and velocity are those of the links.
        """

    @property
    def energy(self) -> float:
        """
        Of both trees and the cuffs, without what springs of the transmission store [J].
        """

def tree_law_storage(links: int) -> int:
    """
    Bytes of a supervised law of several joints in float, of a robot of so many links, on any machine.
    """

class TreeLaw:
    """
    A control law of several joints behind the front that it has on a robot too.

    What goes out has passed every joint's gate and that of the whole: finite and within the limits, whatever comes in.
    A fault latches, and all efforts go to 0 together.

    Parameters
    ----------
    links : (l, 22)
    gravity : (3,)
    joints : (m, k)
        As of DrivenTree; at most 12 links.
    shares : (m, s)
        What is done at each joint, in the order of model_fields()["tree_law_joint"].
    whole : (w,)
        What is done with all, in the order of model_fields()["tree_law_whole"].
    turns : (m, m)
    motors : (m, k)
        As of DrivenTree.
    single : bool
        In float32, as on a microcontroller.
    """

    def __init__(
        self,
        links: ArrayLike,
        gravity: ArrayLike,
        joints: ArrayLike,
        shares: ArrayLike,
        whole: ArrayLike,
        *,
        turns: ArrayLike | None = None,
        motors: ArrayLike | None = None,
        single: bool = False,
    ) -> None: ...
    def step(
        self,
        time: float,
        position: ArrayLike,
        interaction: ArrayLike | None = None,
        muscle: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> NDArray[float64]:
        """
        One control period: the effort of each joint, (m,) [N m; N].

        Parameters
        ----------
        time : float
            When everything was measured [s].
        position : (m,)
            Of each joint [rad; m]; NaN: its encoder says nothing.
        interaction, muscle : (m,)
            The wearer's effort on each joint by sensors there, and at each by EMG [N m; N]; NaN or left out: nothing.
        wrench : (6,)
            The wearer's force and moment on the link that bears the sensor, in its axes [N, N m].
        """

    def run(
        self,
        time: ArrayLike,
        position: ArrayLike,
        interaction: ArrayLike | None = None,
        muscle: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> NDArray[float64]:
        """
        step, one period after another.

        Parameters
        ----------
        time : (n,)
        position, interaction, muscle : (n, m)
        wrench : (n, 6)
            As `step` takes them.

        Returns
        -------
        (n, m)
            Efforts of joints [N m; N].
        """

    def reset(self) -> None:
        """Open the gate again; efforts go on from where they are."""

    def stop(self) -> None:
        """From the next step on all efforts go to 0, and stay there."""

    @property
    def joints(self) -> int:
        """How many move."""

    @property
    def fault(self) -> str:
        """
        Why efforts are 0, or on their way there; 'none' while the gate is open.
        """

    @property
    def fault_joint(self) -> int:
        """
        Of which joint the fault is, from 0; their number where it is of the whole.
        """

    @property
    def drive(self, /) -> NDArray[float64]:
        """The last efforts at motors, (m,) [N m; N]."""

    @property
    def outside(self, /) -> NDArray[float64]:
        """
        What people and obstacles do to each joint, as the momentum's observer has it, (m,) [N m; N].
        """

    @property
    def weight(self, /) -> NDArray[float64]:
        """Gravity of each joint, now, (m,) [N m; N]."""

    @property
    def end_speed(self) -> float:
        """Of the end point, as the law has it [m/s]."""

    def time(self, cycles: int) -> NDArray[float64]:
        """
        Nanoseconds of single control steps on a smooth motion, each timed by itself, (cycles,).
        """

class SupervisedTreeLaw:
    """
    The same law under its supervisor: a fault of one joint stops all of them.

    Parameters
    ----------
    links, gravity, joints, shares, whole, turns, motors, single
        As of TreeLaw.
    watches : (m, s)
        What is watched of each joint, in the order of model_fields()["tree_watch_joint"].
    whole_watch : (w,)
        What is watched of all, in the order of model_fields()["tree_watch_whole"].
    commanded : bool
        Efforts are those that `step` is told as its `command`, in place of the law's; the supervisor knows the robot by
        the law's numbers all the same.
    """

    def __init__(
        self,
        links: ArrayLike,
        gravity: ArrayLike,
        joints: ArrayLike,
        shares: ArrayLike,
        whole: ArrayLike,
        watches: ArrayLike,
        whole_watch: ArrayLike,
        *,
        turns: ArrayLike | None = None,
        motors: ArrayLike | None = None,
        single: bool = False,
        commanded: bool = False,
    ) -> None: ...
    def step(
        self,
        time: float,
        position: ArrayLike,
        interaction: ArrayLike | None = None,
        muscle: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
        *,
        drive: ArrayLike | None = None,
        joint: ArrayLike | None = None,
        token: int = 0,
        command: ArrayLike | None = None,
    ) -> NDArray[float64]:
        """
        One control period: the effort of each motor, (m,) [N m; N].

        Parameters
        ----------
        time, position, interaction, muscle, wrench
            As TreeLaw.step takes them.
        drive : (m,)
            What each motor's drive measures of its effort; NaN or left out: nothing.
        joint : (m,)
            What a second encoder of each joint says [rad; m]; NaN or left out: nothing.
        token : int
            The challenge of a fault, from an operator who asks for a reset.
        command : (m,)
            Effort that each joint is to have, of a law that is commanded [N m; N]; one that is no number stops it. Left
            out: as before.
        """

    def stop(self) -> None:
        """From the next step on it stops."""

    @property
    def fault(self) -> str:
        """The first one, latched; 'none' while all is well."""

    @property
    def fault_joint(self) -> int:
        """Of which joint it is, from 0; their number where it is of the whole."""

    @property
    def mode(self) -> str:
        """What is being done."""

    @property
    def challenge(self) -> int:
        """What a reset needs as its token; 0 while all is well."""

    @property
    def enable(self, /) -> tuple[bool, ...]:
        """Of each motor whether its power may be on."""

    @property
    def effort(self, /) -> NDArray[float64]:
        """The last efforts at joints, (m,) [N m; N]."""

    @property
    def log(self, /) -> list[tuple[int, str, int, str]]:
        """Step, fault, joint and mode of the latest faults, the last first."""

    def flip(self, bit: int) -> None:
        """
        Lose a bit of the law's numbers in memory, to test that it is found out.
        """

class SortedRows:
    """
    Rows that trees are grown on, sorted by every feature.

    Parameters
    ----------
    x : (n, k)
        Features in single precision, finite.
    """

    def __init__(self, x: ArrayLike) -> None: ...
    def grown(
        self, y: ArrayLike, times: ArrayLike, seed: int, features: int, leaves: int, per_leaf: int, per_split: int
    ) -> NDArray[float64]:
        """
        One tree of least squares.

        Parameters
        ----------
        y : (n,)
            What it is to tell.
        times : (n,)
            How often each row counts; 0 leaves it out.
        seed : int
            Of the features drawn at each split, 0 to 2^32 - 1.
        features : int
            Drawn at each split, 1 to k.
        leaves : int
            At most, the best split first; 0: no limit.
        per_leaf, per_split : int
            Rows at least in a leaf, and in what is split.

        Returns
        -------
        (m, 4)
            A row per node, parents first: feature, left child, right child, threshold up to which a row goes left; of a
            leaf -1, -1, -1 and its answer.
        """

def tree_answers(nodes: ArrayLike, x: ArrayLike) -> NDArray[float64]:
    """
    What a tree answers.

    Parameters
    ----------
    nodes : (m, 4)
        As SortedRows.grown gave them.
    x : (n, k)
        Features in single precision.

    Returns
    -------
    (n,)
        In the unit of what it was grown for.
    """

def drawn_rows(shares: ArrayLike, inside: int) -> NDArray[float64]:
    """
    Which rows are drawn without replacement, going through them once.

    Parameters
    ----------
    shares : (n,)
        Drawn evenly between 0 and 1.
    inside : int
        Rows to be drawn, 0 to n.

    Returns
    -------
    (n,)
        1 for a row that was drawn, 0 for another.
    """

def zero_phase(sos: ArrayLike, settled: ArrayLike, samples: ArrayLike, padding: int) -> NDArray[float64]:
    """
    A cascade of second-order sections run forwards and backwards over each column: no delay.

    Each pass starts settled on its first sample. The signals are continued at both borders by their point reflection.

    Parameters
    ----------
    sos : (k, 6)
        Rows b0, b1, b2, a0 = 1, a1, a2.
    settled : (k, 2)
        The state of each section in which a constant input of 1 leaves it.
    samples : (n, m)
        Signals, any unit.
    padding : int
        Samples that are added at each border, below n.

    Returns
    -------
    (n, m)
        In the signals' units.
    """

def number_rows(values: ArrayLike, decimals: ArrayLike) -> bytes:
    """
    Text of rows of numbers, separated by commas, each row with its line end.

    Every number is rounded as the format ``%.kf`` of C rounds it. A column without decimals has no
    sign of a zero. NaN, a missing sample, becomes an empty cell.

    Parameters
    ----------
    values : (n, m)
        Numbers, any unit.
    decimals : (m,)
        Decimals of each column, 0 to 15.

    Returns
    -------
    bytes
        ASCII.
    """

class math:
    """The core's elementary functions, on float64 or float32 arrays."""

    @staticmethod
    def exp(x: ArrayLike) -> NDArray: ...
    @staticmethod
    def log(x: ArrayLike) -> NDArray: ...
    @staticmethod
    def sin(x: ArrayLike) -> NDArray: ...
    @staticmethod
    def cos(x: ArrayLike) -> NDArray: ...
    @staticmethod
    def tanh(x: ArrayLike) -> NDArray: ...
