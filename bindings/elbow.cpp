// A person who reaches with a robot strapped to the forearm: the whole loop in the core, movement by movement.
#include "elbow.hpp"

#include "arrays.hpp"

#include <pellucid/directional_compensation.hpp>
#include <pellucid/position_prediction.hpp>
#include <pellucid/reaching.hpp>
#include <pellucid/transparent_compensation.hpp>
#include <pellucid/worn_geared_plant.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <variant>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* worn_elbow_doc = R"(A person's forearm, alone or strapped to a robot under a control law.

Parameters
----------
person : (26,)
    In the order of REACHING_PARAMETER_NAMES, SI; its period is that of control.
load : (5,)
    What the person expects of the robot at first: inertia, viscous, coulomb, gravity_sine, gravity_cosine, SI.
position0 : float
    Where the forearm is held at first [rad].
robot : (21,), optional
    In the order of GEARED_PARAMETER_NAMES, SI; left out: the forearm alone.
strap : (2,)
    Stiffness [N m/rad] and damping [N m s/rad].
drive : (5,)
    Torque per ampere [N m/A], current limit [A], ripple amplitude [N m], its wave number [1/rad], and the encoder's
    quantum [rad].
law : str
    "none", "position_prediction", "directional" or "transparent".
law_parameters : (k,), optional
    In the order of the law's names, SI.
emg_gains : (2,)
    By which the law's EMG torques of flexors and extensors are too large [1].
substeps : int
    Of integration, per period.
sensor_delay : int
    Periods by which the force sensor is late, 0 to 63.)";

constexpr const char* move_doc = R"(One movement to a target, and holding it.

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

Returns
-------
tuple of (k,)
    Limb position [rad], velocity [rad/s], acceleration [rad/s^2]; the encoder [rad]; torque of the wearer on
    the robot [N m], the law's torque [N m], excitation of flexors and of extensors [1], link velocity
    [rad/s]; k <= longest.)";

constexpr const char* fuzz_doc = R"(A law among nonsense: NaN, infinities, jumps, frozen and repeated samples, clock jumps.

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
    Commands outside the limits (unsafe), faults, most cycles from a fault to a safe output, cycles with a torque.)";

constexpr const char* time_doc = R"(Nanoseconds of single control steps of a law on a smooth motion, each timed by itself.

Parameters
----------
law : str
parameters : (k,)
cycles : int
single : bool

Returns
-------
(cycles,)
    [ns], the clock's own cost taken off.)";

template <class C, class St> struct Law {
  C coefficients{};
  St state{};
};
template <class S>
using PositionPrediction = Law<p::PositionPredictionCoefficients<S>, p::PositionPredictionState<S>>;
template <class S>
using Directional = Law<p::DirectionalCompensationCoefficients<S>, p::DirectionalCompensationState<S>>;
template <class S>
using Transparent = Law<p::TransparentCompensationCoefficients<S>, p::TransparentCompensationState<S>>;
template <class S> using AnyLaw = std::variant<std::monostate, PositionPrediction<S>, Directional<S>, Transparent<S>>;

template <class S, class L, std::size_t n> L made(const Array& values) {
  values.expect("(" + std::to_string(n) + ",)", {n});
  S numbers[n];
  for (std::size_t i = 0; i < n; ++i) numbers[i] = static_cast<S>(values.data[i]);
  L law;
  law.coefficients = p::coefficients(p::law_params(numbers));
  if (!law.coefficients.gate.valid) law.state.gate.fault = p::SafetyFault::configuration;
  return law;
}

template <class S> AnyLaw<S> read_law(const std::string& name, nb::handle parameters) {
  if (name == "none") return std::monostate{};
  const Array values = read_array("law_parameters", parameters);
  if (name == "position_prediction")
    return made<S, PositionPrediction<S>, p::position_prediction_parameter_count>(values);
  if (name == "directional") return made<S, Directional<S>, p::directional_parameter_count>(values);
  if (name == "transparent") return made<S, Transparent<S>, p::transparent_parameter_count>(values);
  throw nb::value_error(
      "law: expected \"none\", \"position_prediction\", \"directional\" or \"transparent\"");
}

template <class S> p::ExpectedLoad<S> read_load(nb::handle load) {
  const Array v = read_array("load", load);
  v.expect("(5,)", {5});
  return {v.data[0], v.data[1], v.data[2], v.data[3], v.data[4]};
}

class WornElbow {
 public:
  WornElbow(nb::handle person, nb::handle load, double position0, nb::handle robot, nb::handle strap, nb::handle drive,
            const char* law, nb::handle law_parameters, nb::handle emg_gains, nb::handle substeps,
            nb::handle sensor_delay) {
    const Array who = read_array("person", person);
    who.expect("(" + std::to_string(p::reaching_parameter_count) + ",)", {p::reaching_parameter_count});
    double numbers[p::reaching_parameter_count];
    for (std::size_t i = 0; i < p::reaching_parameter_count; ++i) numbers[i] = who.data[i];
    const p::ReachingParams<double> params = p::reaching_params(numbers);
    if (!(params.period > 0 && std::isfinite(params.period)))
      throw nb::value_error("person: expected a period above 0");
    person_ = p::coefficients(params);
    smoothing_ = 1 - std::exp(-params.period * 25.0);  // 4 Hz

    p::WornGearedPlantParams<double> plant;
    plant.limb = params.limb;
    plant.worn = !robot.is_none();
    plant.robot.joint.motor_inertia = 1;
    plant.robot.joint.link.inertia = 1;
    plant.robot.joint.transmission.stiffness = 1;
    const Array d = read_array("drive", drive), s = read_array("strap", strap), g = read_array("emg_gains", emg_gains);
    d.expect("(5,)", {5});
    s.expect("(2,)", {2});
    g.expect("(2,)", {2});
    if (plant.worn) {
      const Array r = read_array("robot", robot);
      r.expect("(" + std::to_string(p::geared_parameter_count) + ",)", {p::geared_parameter_count});
      double joint[p::geared_parameter_count];
      for (std::size_t i = 0; i < p::geared_parameter_count; ++i) joint[i] = r.data[i];
      plant.robot.joint = p::geared_joint_params(joint);
    }
    plant.strap = {s.data[0], s.data[1], 0, 0, 0};
    plant.robot.drive = {d.data[0], 0, d.data[2], d.data[3], 0};
    plant.robot.encoder = {d.data[4]};
    plant.robot.loop.period = params.period;
    plant.robot.substeps = static_cast<std::uint32_t>(read_integer("substeps", substeps, 1, 1000));
    gain_ = d.data[0];
    limit_ = d.data[1];
    emg_gain_[0] = g.data[0];
    emg_gain_[1] = g.data[1];
    sensor_delay_ = static_cast<std::uint32_t>(read_integer("sensor_delay", sensor_delay, 0, 63));
    plant_ = p::coefficients(plant);
    state_ = p::balanced(plant_, position0);
    reach_ = p::holding(person_, position0, read_load<double>(load));
    law_ = read_law<double>(law, law_parameters);
    level_[0] = reach_.torque > 0 ? reach_.torque : 0;
    level_[1] = reach_.torque < 0 ? -reach_.torque : 0;
  }

  nb::object move(double target, double amplitude, double duration, double reaction, nb::handle load, double tolerance,
                  double hold, nb::handle noise, nb::handle longest, nb::handle sensor_error, bool emg) {
    const Array z = read_array("noise", noise);
    if (z.shape.size() != 2 || z.shape[1] != 5) z.fail("(n, 5)");
    const std::size_t n = z.shape[0];
    if (n == 0) z.fail("(n, 5) with n above 0");
    const auto most = static_cast<std::size_t>(read_integer("longest", longest, 1, 10000000));
    if (!(duration > 0 && std::isfinite(duration))) throw nb::value_error("duration: expected seconds above 0");
    const bool sensed = !sensor_error.is_none();
    const Array error = sensed ? read_array("sensor_error", sensor_error) : z;
    if (sensed) error.expect(same_length("noise", n), {n});
    p::aim(person_, reach_, {target, amplitude, duration, reaction, read_load<double>(load)});
    std::vector<double> rows;
    std::size_t k = 0;
    {
      nb::gil_scoped_release release;
      rows.reserve(columns * n);
      const double period = person_.params.period;
      double held = 0;
      while (k < most && held < hold) {
        rows.resize(columns * (k + 1));
        period_of(z.data + 5 * (k % n), sensed ? error.data + k % n : nullptr, emg, rows.data() + columns * k);
        // Someone who has just arrived is not holding yet.
        const bool there = reach_.time > reaction && std::fabs(state_.limb_position - target) <= tolerance;
        held = there ? held + period : 0;
        ++k;
      }
    }
    std::vector<Result> results;
    for (std::size_t c = 0; c < columns; ++c) {
      results.emplace_back(Shape{k});
      for (std::size_t i = 0; i < k; ++i) results[c].data[i] = rows[columns * i + c];
    }
    return tuple_of(results);
  }

  const char* fault() const {
    return std::visit(
        [](const auto& law) -> const char* {
          if constexpr (std::is_same<std::decay_t<decltype(law)>, std::monostate>::value) return "none";
          else return p::safety_fault_names[static_cast<std::size_t>(law.state.gate.fault)];
        },
        law_);
  }

 private:
  static constexpr std::size_t columns = 9;

  // Everything inlined: a quarter of a study's time goes into calls between functions of a line or two.
  [[gnu::flatten]] void period_of(const double* noise, const double* sensor_error, bool emg, double* row) {
    const double torque_now = p::interaction(plant_, state_);
    sensor_[ticks_ % 64] = torque_now;
    const double late = sensor_[(ticks_ - std::min<std::uint64_t>(sensor_delay_, ticks_)) % 64];
    const double measured = p::step(plant_.robot.encoder, state_.motor_position, noise[2]);
    p::LawInput<double> input;
    input.position = measured;
    input.has_interaction = sensor_error != nullptr;
    input.interaction = input.has_interaction ? late + *sensor_error : 0.0;
    input.has_muscle = emg;
    input.muscle = emg_gain_[0] * level_[0] - emg_gain_[1] * level_[1];
    input.sequence = static_cast<std::uint32_t>(ticks_);
    input.time = static_cast<std::int64_t>(std::llround(1e6 * person_.params.period * static_cast<double>(ticks_)));
    const double wanted = std::visit(
        [&](auto& law) -> double {
          if constexpr (std::is_same<std::decay_t<decltype(law)>, std::monostate>::value) return 0.0;
          else return p::step(law.coefficients, law.state, input);
        },
        law_);
    const double current = p::clamp(wanted / gain_, -limit_, limit_);
    const p::ReachingOutput<double> muscles =
        p::step(person_, reach_, state_.limb_position, state_.limb_velocity, noise[0], noise[1]);
    listen(muscles, noise + 3);
    row[0] = state_.limb_position;
    row[1] = state_.limb_velocity;
    row[3] = measured;
    row[4] = torque_now;
    row[5] = gain_ * current;
    row[6] = muscles.flexor;
    row[7] = muscles.extensor;
    row[8] = state_.link_velocity;
    p::step(plant_, state_, current, muscles.torque);
    row[2] = state_.limb_acceleration;
    ++ticks_;
  }

  /// The torque that rectified, smoothed EMG shows of either muscle group, its resting level taken off [N m].
  void listen(const p::ReachingOutput<double>& muscles, const double* noise) {
    const auto& who = person_.params;
    const double excitation[2] = {muscles.flexor, muscles.extensor}, most[2] = {who.flexion_max, who.extension_max};
    for (int i = 0; i < 2; ++i) {
      const double rectified = std::fabs(excitation[i] * noise[i]) * 1.2533141373155001;
      level_[i] += smoothing_ * ((rectified - who.cocontraction) * most[i] - level_[i]);
    }
  }

  p::ReachingCoefficients<double> person_;
  p::ReachingState<double> reach_;
  p::WornGearedPlantCoefficients<double> plant_;
  p::WornGearedPlantState<double> state_;
  AnyLaw<double> law_;
  double gain_ = 1, limit_ = 0, smoothing_ = 0, emg_gain_[2] = {1, 1}, level_[2] = {0, 0}, sensor_[64] = {};
  std::uint64_t ticks_ = 0;
  std::uint32_t sensor_delay_ = 0;
};

/// Numbers that look random and are the same everywhere (SplitMix64).
class Bits {
 public:
  explicit Bits(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  /// Any bit pattern at all.
  template <class S> S anything() {
    const std::uint64_t pattern = next();
    S x;
    std::memcpy(&x, &pattern, sizeof x);
    return x;
  }

 private:
  std::uint64_t state_;
};

struct Fuzzed {
  long long unsafe = 0, faults = 0, slowest = 0, moving = 0;
};

template <class S, class L> Fuzzed fuzz(L& law, std::uint64_t cycles, std::uint64_t seed) {
  Bits bits(seed);
  Fuzzed found;
  const auto& gate = law.coefficients.gate;
  const S limit = gate.params.effort_limit, change = gate.max_change * (S(1) + S(1e-5));
  const double period = static_cast<double>(gate.params.period);
  std::int64_t time = 0;
  std::uint32_t sequence = 0;
  S before = 0;
  double phase = 0, rate = 6, frozen = 0, offset = 0;
  int freeze = 0;
  long long since = 0;
  bool shut = false;
  for (std::uint64_t k = 0; k < cycles; ++k) {
    if (k % 4096 == 0) rate = 1 + 12 * bits.uniform();
    phase += rate * period;
    double q = 1.4 + 0.5 * p::sin(std::fmod(phase, 6.283185307179586)) + offset;
    const double chance = bits.uniform();
    if (chance < 2e-5) freeze = 1 + static_cast<int>(40 * bits.uniform());
    if (chance > 0.99998) offset = bits.uniform() - 0.5;  // the encoder slips
    if (freeze > 0) q = frozen, --freeze;
    frozen = q;
    p::LawInput<S> in;
    in.position = static_cast<S>(q);
    in.interaction = static_cast<S>(2 * bits.uniform() - 1);
    in.muscle = static_cast<S>(20 * bits.uniform() - 10);
    in.has_interaction = in.has_muscle = true;
    time += static_cast<std::int64_t>(1e6 * period + 0.5);
    ++sequence;
    const double kind = bits.uniform();
    if (kind < 1e-3) {
      const int what = static_cast<int>(10 * bits.uniform());
      const S nan = std::numeric_limits<S>::quiet_NaN(), infinity = std::numeric_limits<S>::infinity();
      if (what == 0) in.position = nan;
      if (what == 1) in.position = bits.uniform() < 0.5 ? infinity : -infinity;
      if (what == 2) in.position = bits.anything<S>();
      if (what == 3) in.interaction = bits.uniform() < 0.5 ? nan : bits.anything<S>();
      if (what == 4) in.muscle = bits.uniform() < 0.5 ? infinity : bits.anything<S>();
      if (what == 5) time += static_cast<std::int64_t>(4e6 * (bits.uniform() - 0.5));
      if (what == 6) sequence += static_cast<std::uint32_t>(bits.next());
      if (what == 7) --sequence;
      if (what == 8) in.valid = false;
      if (what == 9) in.has_interaction = in.has_muscle = false;
    }
    in.time = time;
    in.sequence = sequence;
    const S out = p::step(law.coefficients, law.state, in);
    const bool fault = law.state.gate.fault != p::SafetyFault::none;
    const bool inside = out >= -limit && out <= limit;
    const bool slow = std::fabs(out) <= std::fabs(before) + change || !(std::fabs(before) <= limit);
    const bool retreats = !fault || std::fabs(out) <= std::fabs(before);
    // From the first cycle of a fault on, the torque may only fall.
    if (fault && !shut) ++found.faults, since = 0;
    shut = fault;
    if (fault) {
      ++since;
      if (!(inside && retreats)) found.slowest = since > found.slowest ? since : found.slowest;
    }
    found.unsafe += !(inside && slow && retreats);
    found.moving += out != S(0);
    before = out;
    if (fault && bits.uniform() < 0.02) p::reset(law.state);
  }
  if (found.faults > 0) ++found.slowest;  // the cycle of the fault itself counts as one
  return found;
}

template <class S> nb::tuple fuzz_any(const std::string& name, nb::handle parameters, std::uint64_t cycles,
                                      std::uint64_t seed) {
  AnyLaw<S> law = read_law<S>(name, parameters);
  Fuzzed found;
  {
    nb::gil_scoped_release release;
    found = std::visit(
        [&](auto& one) -> Fuzzed {
          if constexpr (std::is_same<std::decay_t<decltype(one)>, std::monostate>::value) return {};
          else return fuzz<S>(one, cycles, seed);
        },
        law);
  }
  return nb::make_tuple(found.unsafe, found.faults, found.slowest, found.moving);
}

template <class S> nb::object time_any(const std::string& name, nb::handle parameters, std::size_t cycles) {
  using Clock = std::chrono::steady_clock;
  AnyLaw<S> law = read_law<S>(name, parameters);
  Result result({cycles});
  volatile double sink = 0;
  std::visit(
      [&](auto& one) {
        if constexpr (!std::is_same<std::decay_t<decltype(one)>, std::monostate>::value) {
          const double period = static_cast<double>(one.coefficients.gate.params.period);
          double empty = 1e9;
          for (int i = 0; i < 1000; ++i) {
            const auto start = Clock::now();
            empty = std::fmin(empty, std::chrono::duration<double, std::nano>(Clock::now() - start).count());
          }
          for (std::size_t k = 0; k < cycles; ++k) {
            p::LawInput<S> in;
            in.position = static_cast<S>(1.4 + 0.5 * p::sin(std::fmod(4 * period * static_cast<double>(k), 6.283185307179586)));
            in.sequence = static_cast<std::uint32_t>(k);
            in.time = std::llround(1e6 * period * static_cast<double>(k));
            in.has_interaction = in.has_muscle = true;
            const auto start = Clock::now();
            const S out = p::step(one.coefficients, one.state, in);
            const auto end = Clock::now();
            sink = sink + static_cast<double>(out);
            result.data[k] = std::chrono::duration<double, std::nano>(end - start).count() - empty;
          }
        }
      },
      law);
  return result.array();
}

template <std::size_t n> nb::tuple names_of(const char* const (&names)[n]) {
  nb::list list;
  for (const char* name : names) list.append(name);
  return nb::tuple(list);
}

}  // namespace

void add_elbow(nb::module_& m) {
  m.attr("REACHING_PARAMETER_NAMES") = names_of(p::reaching_parameter_names);
  m.attr("POSITION_PREDICTION_PARAMETER_NAMES") = names_of(p::position_prediction_parameter_names);
  m.attr("DIRECTIONAL_PARAMETER_NAMES") = names_of(p::directional_parameter_names);
  m.attr("TRANSPARENT_PARAMETER_NAMES") = names_of(p::transparent_parameter_names);
  nb::class_<WornElbow>(m, "WornElbow", worn_elbow_doc)
      .def(nb::init<nb::handle, nb::handle, double, nb::handle, nb::handle, nb::handle, const char*, nb::handle,
                    nb::handle, nb::handle, nb::handle>(),
           nb::arg("person"), nb::arg("load"), nb::kw_only(), nb::arg("position0"), nb::arg("robot").none() = nb::none(),
           nb::arg("strap"), nb::arg("drive"), nb::arg("law") = "none", nb::arg("law_parameters").none() = nb::none(),
           nb::arg("emg_gains"), nb::arg("substeps"), nb::arg("sensor_delay") = 0,
           nb::sig("def __init__(self, person: ArrayLike, load: ArrayLike, *, position0: float, robot: ArrayLike | "
                   "None = None, strap: ArrayLike, drive: ArrayLike, law: str = 'none', law_parameters: ArrayLike | "
                   "None = None, emg_gains: ArrayLike, substeps: int, sensor_delay: int = 0) -> None"))
      .def("move", &WornElbow::move, nb::kw_only(), nb::arg("target"), nb::arg("amplitude"), nb::arg("duration"),
           nb::arg("reaction"), nb::arg("load"), nb::arg("tolerance"), nb::arg("hold"), nb::arg("noise"), nb::arg("longest"),
           nb::arg("sensor_error").none() = nb::none(), nb::arg("emg") = false,
           nb::sig("def move(self, *, target: float, amplitude: float, duration: float, reaction: float, load: "
                   "ArrayLike, tolerance: float, hold: float, noise: ArrayLike, longest: int, sensor_error: ArrayLike | None "
                   "= None, emg: bool = False) -> tuple[NDArray[float64], ...]"),
           move_doc)
      .def_prop_ro("fault", &WornElbow::fault, "Of the law's gate, as of SafetyGate: 'none' while it is open.");
  m.def(
      "fuzz_law",
      [](const char* law, nb::handle parameters, std::uint64_t cycles, std::uint64_t seed, bool single) {
        return single ? fuzz_any<float>(law, parameters, cycles, seed)
                      : fuzz_any<double>(law, parameters, cycles, seed);
      },
      nb::arg("law"), nb::arg("parameters"), nb::arg("cycles"), nb::arg("seed"), nb::arg("single") = false,
      nb::sig("def fuzz_law(law: str, parameters: ArrayLike, cycles: int, seed: int, single: bool = False) -> "
              "tuple[int, int, int, int]"),
      fuzz_doc);
  m.def(
      "time_law",
      [](const char* law, nb::handle parameters, std::size_t cycles, bool single) {
        return single ? time_any<float>(law, parameters, cycles) : time_any<double>(law, parameters, cycles);
      },
      nb::arg("law"), nb::arg("parameters"), nb::arg("cycles"), nb::arg("single") = false,
      nb::sig("def time_law(law: str, parameters: ArrayLike, cycles: int, single: bool = False) -> NDArray[float64]"),
      time_doc);
}

}  // namespace bindings
