// A person who reaches with a robot strapped to the forearm: the whole loop in the core, movement by movement.
#include "elbow.hpp"

#include "laws.hpp"

#include <pellucid/reaching.hpp>
#include <pellucid/worn_geared_plant.hpp>

#include <algorithm>
#include <cmath>

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
    "none", or a name of `laws`.
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
    const auto params = read_params<p::ReachingParams<double>, double>("person", person);
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
      plant.robot.joint = read_params<p::GearedJointParams<double>, double>("robot", robot);
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
    return of_law(law_, "none", [](const auto& law) { return fault_name(law.fault); });
  }

 private:
  static constexpr std::size_t columns = 9;

  // Everything inlined: a quarter of a study's time goes into calls between functions of a line or two.
  [[gnu::flatten]] void period_of(const double* noise, const double* sensor_error, bool emg, double* row) {
    const double torque_now = p::interaction(plant_, state_);
    sensor_[ticks_ % 64] = torque_now;
    const double late = sensor_[(ticks_ - std::min<std::uint64_t>(sensor_delay_, ticks_)) % 64];
    const double measured = p::step(plant_.robot.encoder, state_.motor_position, noise[2]);
    p::Samples<double> samples;
    samples.position = {measured, 0, 0, true};
    samples.torque = {drive_torque_, 0, 0, true};
    samples.interaction = {sensor_error != nullptr ? late + *sensor_error : 0.0, 0, 0, sensor_error != nullptr};
    samples.muscle = {emg_gain_[0] * level_[0] - emg_gain_[1] * level_[1], 0, 0, emg};
    const std::int64_t now = std::llround(1e6 * person_.params.period * static_cast<double>(ticks_));
    const double wanted = of_law(law_, 0.0, [&](auto& law) { return p::step_now(law, samples, now); });
    const double current = p::clamp(wanted / gain_, -limit_, limit_);
    const p::ReachingOutput<double> muscles =
        p::step(person_, reach_, state_.limb_position, state_.limb_velocity, noise[0], noise[1]);
    listen(muscles, noise + 3);
    row[0] = state_.limb_position;
    row[1] = state_.limb_velocity;
    row[3] = measured;
    row[4] = torque_now;
    row[5] = drive_torque_ = gain_ * current;
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
  double drive_torque_ = 0, gain_ = 1, limit_ = 0, smoothing_ = 0, emg_gain_[2] = {1, 1}, level_[2] = {0, 0}, sensor_[64] = {};
  std::uint64_t ticks_ = 0;
  std::uint32_t sensor_delay_ = 0;
};

}  // namespace

void add_elbow(nb::module_& m) {
  m.attr("REACHING_PARAMETER_NAMES") = names_of<p::ReachingParams<double>>();
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
}

}  // namespace bindings
