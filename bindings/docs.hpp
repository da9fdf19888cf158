// Signatures and docstrings of pellucid._core; the build makes _core.pyi of them.
#pragma once

namespace bindings::docs {

constexpr const char* inverse_dynamics_sig =
    "def inverse_dynamics(parameters: ArrayLike, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> "
    "NDArray[float64]";
constexpr const char* inverse_dynamics =
    R"(Effort that moves a joint so: y + friction(v, y) + offset, y = J a + g_s sin q + g_c cos q.

Parameters
----------
parameters : (k,)
    In the order of PARAMETER_NAMES.
position, velocity, acceleration : (n,)
    q [rad], v [rad/s], a [rad/s^2]; metres on a prismatic joint.

Returns
-------
(n,)
    Effort [N m]; N on a prismatic joint.)";

constexpr const char* inverse_dynamics_jacobian_sig =
    "def inverse_dynamics_jacobian(parameters: ArrayLike, position: ArrayLike, velocity: ArrayLike, acceleration: "
    "ArrayLike, "
    "active: ArrayLike) -> tuple[NDArray[float64], NDArray[float64]]";
constexpr const char* inverse_dynamics_jacobian = R"(inverse_dynamics and its exact derivatives by some parameters.

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
    d effort / d parameters[active].)";

constexpr const char* forward_dynamics_sig =
    "def forward_dynamics(parameters: ArrayLike, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike) -> "
    "NDArray[float64]";
constexpr const char* forward_dynamics =
    R"(Acceleration that an effort gives; the inverse of inverse_dynamics, in closed form.

Parameters
----------
parameters : (k,)
    In the order of PARAMETER_NAMES.
position, velocity, effort : (n,)
    q [rad], v [rad/s], effort [N m].

Returns
-------
(n,)
    Acceleration [rad/s^2].)";

constexpr const char* friction_sig =
    "def friction(parameters: ArrayLike, velocity: ArrayLike, load: ArrayLike) -> NDArray[float64]";
constexpr const char* friction =
    R"(Friction level(v) s + F_v v + alpha |y| s, with s = tanh(v / w), or sign(v) where w is 0.

Parameters
----------
parameters : (k,)
    In the order of PARAMETER_NAMES.
velocity, load : (n,)
    v [rad/s] and the load y that passes through the drive [N m].

Returns
-------
(n,)
    Friction effort [N m], along +v.)";

constexpr const char* resistance_coefficients_sig =
    "def resistance_coefficients(roles: ArrayLike, coefficients: ArrayLike) -> list[tuple[float, float, float]]";
constexpr const char* resistance_coefficients =
    R"(Sums of friction coefficients by the powers of speed and load that they multiply.

Of coefficients that act in one direction each the larger counts; all others add up.

Parameters
----------
roles : (k, 3)
    Powers of speed and load, and whether the coefficient acts in one direction; at most 16 pairs of powers.
coefficients : (k,)
    SI.

Returns
-------
list of (power of the speed, power of the load, sum))";
constexpr const char* max_resistance_sig =
    "def max_resistance(roles: ArrayLike, coefficients: ArrayLike, speed: ArrayLike, load: ArrayLike) "
    "-> NDArray[float64]";
constexpr const char* max_resistance = R"(The most that friction resists by, of n joints.

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
    Effort [N m].)";

constexpr const char* load_sig =
    "def load(parameters: ArrayLike, position: ArrayLike, acceleration: ArrayLike) -> NDArray[float64]";
constexpr const char* load = R"(Load y = J a + g_s sin q + g_c cos q that passes through the drive [N m].

Parameters
----------
parameters : (k,)
    In the order of PARAMETER_NAMES.
position, acceleration : (n,)
    q [rad], a [rad/s^2].)";

constexpr const char* presliding_sig = "def presliding(travel: float, position: ArrayLike) -> NDArray[float64]";
constexpr const char* presliding = R"(What takes the place of the sign of velocity while friction gives before it slips.

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
    s, -1 to 1; 0 throughout where the travel is 0.)";

constexpr const char* simulate_sig =
    "def simulate(parameters: ArrayLike, *, reference: ArrayLike, period: float, substeps: int = 4, loop: str = "
    "\"none\", "
    "kp: float = 0, ki: float = 0, kd: float = 0, kv: float = 0, limit: float = 0, velocity_span: int = 0, gain: float "
    "= 1, "
    "back_emf: float = 0, injected: ArrayLike | None = None, disturbance: ArrayLike | None = None, encoder_quantum: "
    "float = 0, "
    "encoder_noise: ArrayLike | None = None, ripple_amplitude: float = 0, ripple_wave_number: float = 0, ripple_phase: "
    "float = 0, "
    "position0: float = 0, velocity0: float = 0, integral0: float = 0, presliding_travel: float = 0, stiction: bool = "
    "False) -> "
    "tuple[NDArray[float64], ...]";
constexpr const char* simulate = R"(A joint under its own controller, sample by sample.

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
    acceleration are those at the start of that period.)";

constexpr const char* simulate_batch_sig =
    "def simulate_batch(parameters: ArrayLike, *, reference: ArrayLike, period: float, substeps: int = 4, loop: str = "
    "\"none\", "
    "kp: ArrayLike = 0, ki: ArrayLike = 0, kd: ArrayLike = 0, kv: ArrayLike = 0, limit: ArrayLike = 0, velocity_span: "
    "int = 0, "
    "gain: ArrayLike = 1, back_emf: ArrayLike = 0, injected: ArrayLike | None = None, disturbance: ArrayLike | None = "
    "None, "
    "encoder_quantum: ArrayLike = 0, encoder_noise: ArrayLike | None = None, ripple_amplitude: ArrayLike = 0, "
    "ripple_wave_number: ArrayLike = 0, ripple_phase: ArrayLike = 0, position0: ArrayLike = 0, velocity0: ArrayLike = "
    "0, integral0: ArrayLike = 0, presliding_travel: ArrayLike = 0, "
    "stiction: bool = False, threads: int = 1) -> tuple[NDArray[float64], ...]";
constexpr const char* simulate_batch =
    R"(Many joints at once, in the lanes of the processor; the same bits as `simulate` gives one by one.

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
    As `simulate` returns them.)";

constexpr const char* simulate_geared_sig =
    "def simulate_geared(parameters: ArrayLike, *, reference: ArrayLike, period: float, substeps: int = 4, loop: str = "
    "\"none\", kp: ArrayLike = 0, ki: ArrayLike = 0, kd: ArrayLike = 0, kv: ArrayLike = 0, limit: ArrayLike = 0, "
    "velocity_span: int = 0, gain: ArrayLike = 1, back_emf: ArrayLike = 0, injected: ArrayLike | None = None, "
    "disturbance: ArrayLike | None = None, encoder_quantum: ArrayLike = 0, encoder_noise: ArrayLike | None = None, "
    "ripple_amplitude: ArrayLike = 0, ripple_wave_number: ArrayLike = 0, ripple_phase: ArrayLike = 0, "
    "position0: ArrayLike = 0, velocity0: ArrayLike = 0, integral0: ArrayLike = 0, threads: int = 1) -> "
    "tuple[NDArray[float64], ...]";
constexpr const char* simulate_geared =
    R"(Many motors, each with a link behind a compliant transmission with backlash, in the lanes of the processor.

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
    At the sample instants k period, before the k-th period; the command is limited, with what was injected.)";

constexpr const char* simulate_jacobian_sig =
    "def simulate_jacobian(parameters: ArrayLike, *, active: ArrayLike, reference: ArrayLike, period: float, substeps: "
    "int = 4, "
    "loop: str = \"none\", kp: float = 0, ki: float = 0, kd: float = 0, kv: float = 0, limit: float = 0, "
    "velocity_span: int = 0, "
    "gain: float = 1, back_emf: float = 0, injected: ArrayLike | None = None, disturbance: ArrayLike | None = None, "
    "encoder_quantum: float = 0, encoder_noise: ArrayLike | None = None, ripple_amplitude: float = 0, "
    "ripple_wave_number: float = 0, "
    "ripple_phase: float = 0, position0: float = 0, velocity0: float = 0, integral0: float = 0, "
    "presliding_travel: float = 0, stiction: bool = False) -> tuple[NDArray[float64], ...]";
constexpr const char* simulate_jacobian =
    R"(simulate, and the exact derivatives of its trajectory by some parameters of the joint.

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
    Derivatives by parameters[active].)";

constexpr const char* biquads =
    R"(A cascade of second-order sections (direct form II transposed) in float64, one sample at a time.

Parameters
----------
sos : (k, 6)
    Rows b0, b1, b2, a0 = 1, a1, a2, as scipy.signal designs them; k at most 16.

Notes
-----
A sample that is not finite passes through, and the state starts again at zeros.)";
constexpr const char* biquads_float = "Biquads in float32, as on a microcontroller.";

constexpr const char* model_fields =
    R"(What the core says of the parameters of its models: the fields of each, as in `laws`, in the order of its arrays.)";
constexpr const char* safety_gate =
    R"(The last step of every controller: what goes out is finite and within the limits, whatever comes in.

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
    Between two steps [s], > 0.)";
constexpr const char* safety_gate_step = R"(One control period: the effort that may go to the motor [N m].

Parameters
----------
command, position, velocity : float
    Effort wanted [N m], and the joint's measured position [rad] and velocity [rad/s].
time, sequence : float, int
    When they were measured [s], and the number of that sample.)";
constexpr const char* safety_gate_fault =
    "'none' while it is open, else 'configuration', 'not_finite', 'stale', 'out_of_order' or 'velocity'.";

}  // namespace bindings::docs
