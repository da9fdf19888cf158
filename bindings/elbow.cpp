// A person who reaches with a robot strapped to the forearm: the whole loop in the core, movement by movement.
#include "elbow.hpp"

#include "drive_reading.hpp"
#include "single_fault.hpp"

#include <array>
#include <cctype>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* worn_elbow_doc = R"(A person's forearm, alone or strapped to a robot under a control law.

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
    How the drive measures its own effort, in the order of DRIVE_READING_NAMES, SI; left out: exactly.)";

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
command : callable, optional
    Gives the effort [N m] of a law "joint" each period, of the time [s], the encoder [rad] and the force sensor
    [N m]; NaN stops the law.

Returns
-------
tuple of (k,)
    Limb position [rad], velocity [rad/s], acceleration [rad/s^2]; the encoder [rad]; torque of the wearer on
    the robot [N m], the law's torque [N m], excitation of flexors and of extensors [1], link velocity
    [rad/s]; k <= longest.)";

constexpr const char* live_doc = R"(Minutes or hours of reaching, healthy or with one single fault, of a person who is "reaching".

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
    evidence) [1]; and the work of the test [J].)";

constexpr const char* drive_reading_doc = R"(What a drive's own measurement makes of the effort that it gives.

Parameters
----------
parameters : (4,)
    In the order of DRIVE_READING_NAMES, SI.
period : float
    [s].)";

template <class S> p::ExpectedLoad<S> read_load(nb::handle load) {
  const Array v = read_array("load", load);
  v.expect("(5,)", {5});
  return {v.data[0], v.data[1], v.data[2], v.data[3], v.data[4]};
}

/// What of a person outlasts a movement, and how the last one went: co-contraction and lost strengths [1], effort [s],
/// late error [rad], counts; of one by optimal feedback stiffness [N m/rad] and unexpected torque reckoned with [N m];
/// nothing, where a model has no such thing.
template <class State> void tell(nb::dict&, const State&) {}
void tell(nb::dict& d, const p::PosturalState<double>& s) {
  d["cocontraction"] = s.cocontraction;
  d["flexor_fatigue"] = s.fatigue[0];
  d["extensor_fatigue"] = s.fatigue[1];
  d["effort"] = s.effort;
  d["corrections"] = static_cast<int>(s.corrections);
  d["failures"] = static_cast<int>(s.failures);
  d["late"] = s.late;
  d["given_up"] = s.given_up > 0;
}
void tell(nb::dict& d, const p::OptimalReachingState<double>& s) {
  d["cocontraction"] = s.policy.cocontraction;
  d["stiffness"] = s.policy.stiffness;
  d["uncertainty"] = std::sqrt(s.variance);
}

template <class... Arms> constexpr auto models_of(const std::variant<Arms...>*) {
  return std::array<const char*, sizeof...(Arms)>{Arms::Model::model...};
}
/// Names of the models of a person, in the order of AnyWornArm.
constexpr auto person_models = models_of(static_cast<const AnyWornArm*>(nullptr));

/// f(i) with i the place of every model of a person, known when this is compiled.
template <class F, std::size_t... I> void for_each_person(F f, std::index_sequence<I...>) {
  (f(std::integral_constant<std::size_t, I>{}), ...);
}
template <class F> void for_each_person(F f) { for_each_person(f, std::make_index_sequence<person_models.size()>{}); }

class WornElbow {
 public:
  WornElbow(nb::handle parameters, nb::handle load, double position0, nb::handle robot, nb::handle strap,
            nb::handle drive, const char* law, nb::handle law_parameters, nb::handle emg_gains, nb::handle substeps,
            const std::string& person, nb::handle sensor_delay, nb::handle supervisor, nb::handle drive_reading) {
    bool known = false;
    for_each_person([&](auto i) {
      if (person != person_models[i]) return;
      known = true;
      strap_on(arm_.emplace<i>(), parameters, load, position0, robot, strap, drive, law, law_parameters, emg_gains,
               substeps, sensor_delay, supervisor, drive_reading);
    });
    if (std::string(law) == p::JointCompensation<double>::name)
      joint_ = read_params<p::JointCompensationParams<double>, double>("law_parameters", law_parameters);
    if (known) return;
    std::string names;
    for (const char* name : person_models) names += std::string(names.empty() ? "" : ", ") + name;
    throw nb::value_error(("person: found \"" + person + "\", expected one of " + names).c_str());
  }

  nb::object move(double target, double amplitude, double duration, double reaction, nb::handle load, double tolerance,
                  double hold, nb::handle noise, nb::handle longest, nb::handle sensor_error, bool emg,
                  nb::handle command) {
    const Array z = read_array("noise", noise);
    if (z.shape.size() != 2 || z.shape[1] != 5) z.fail("(n, 5)");
    const std::size_t n = z.shape[0];
    if (n == 0) z.fail("(n, 5) with n above 0");
    const auto most = static_cast<std::size_t>(read_integer("longest", longest, 1, 10000000));
    if (!(duration > 0 && std::isfinite(duration))) throw nb::value_error("duration: expected seconds above 0");
    const bool sensed = !sensor_error.is_none();
    const Array error = sensed ? read_array("sensor_error", sensor_error) : z;
    if (sensed) error.expect(same_length("noise", n), {n});
    const p::ReachingTask<double> task{target, amplitude, duration, reaction, read_load<double>(load)};
    std::vector<double> rows;
    const Commanded commanded(*this, command);
    {
      nb::gil_scoped_release release;
      rows.reserve(columns * n);
      const Course course{z, sensed ? &error : nullptr, emg, tolerance, hold, most};
      std::visit([&](auto& arm) { reach(arm, task, course, rows); }, arm_);
    }
    const std::size_t k = rows.size() / columns;
    std::vector<Result> results;
    for (std::size_t c = 0; c < columns; ++c) {
      results.emplace_back(Shape{k});
      for (std::size_t i = 0; i < k; ++i) results[c].data[i] = rows[columns * i + c];
    }
    return tuple_of(results);
  }

  const char* fault() const {
    const auto says = [](const auto& one) { return fault_name(pellucid::fault_of(one.state)); };
    return std::visit([&](const auto& arm) { return of_law(arm.law, "none", says); }, arm_);
  }

  nb::dict lasting() const {
    nb::dict d;
    std::visit([&d](const auto& arm) { tell(d, arm.reach); }, arm_);
    return d;
  }

  nb::dict live(nb::handle tasks, nb::handle noise, nb::handle sensor_error, bool emg, nb::handle tremor,
                nb::handle stops, const std::string& fault, double onset, double seconds, nb::handle longest,
                std::uint64_t seed, nb::handle drive_noise, nb::handle command) {
    if (!std::holds_alternative<Reaching>(arm_)) throw nb::value_error("person: expected \"reaching\" where faults are");
    const Array t = read_array("tasks", tasks), z = read_array("noise", noise), shake = read_array("tremor", tremor),
                halts = read_array("stops", stops);
    if (t.shape.size() != 2 || t.shape[1] != 5) t.fail("(k, 5)");
    if (z.shape.size() != 2 || z.shape[1] != 5 || z.shape[0] == 0) z.fail("(n, 5) with n above 0");
    shake.expect("(2,)", {2});
    if (halts.shape.size() != 1) halts.fail("(m,)");
    const bool sensed = !sensor_error.is_none();
    const Array error = sensed ? read_array("sensor_error", sensor_error) : z;
    if (sensed) error.expect(same_length("noise", z.shape[0]), {z.shape[0]});
    const bool noisy = !drive_noise.is_none();
    const Array disturbed = noisy ? read_array("drive_noise", drive_noise) : halts;
    if (disturbed.shape.size() != 1) disturbed.fail("(n,)");
    const auto most = static_cast<std::size_t>(read_integer("longest", longest, 1, 1000000000));
    const Life life{{t.data, t.shape[0]}, {z.data, z.shape[0]}, sensed ? error.data : nullptr, emg, {shake.data[0], shake.data[1]},
                    {halts.data, halts.shape[0]}, {disturbed.data, noisy ? disturbed.shape[0] : 0}, onset, seconds, most};
    Lived lived;
    SingleFault wrong(fault, onset, seed);
    const Commanded commanded(*this, command);
    {
      nb::gil_scoped_release release;
      lived = live_with(std::get<Reaching>(arm_), life, wrong);
    }
    return lived.told();
  }

 private:
  static constexpr std::size_t columns = std::variant_alternative_t<0, AnyWornArm>::columns;
  /// Faults are laid on people of this model only.
  using Reaching = WornArm<p::ReachingParams<double>>;
  AnyWornArm arm_;
  p::JointCompensationParams<double> joint_{};  // a law "joint" without its offset

  /// While it lives, a Python function gives the law's effort.
  class Commanded {
   public:
    Commanded(WornElbow& elbow, nb::handle command) : elbow_(elbow) {
      if (command.is_none()) return;
      command_.params = elbow.joint_;
      command_.ask = [command](double time, double position, double interaction) {
        nb::gil_scoped_acquire acquire;
        return nb::cast<double>(command(time, position, interaction));
      };
      set(&command_);
    }
    Commanded(const Commanded&) = delete;
    ~Commanded() { set(nullptr); }

   private:
    void set(LawCommand* command) { std::visit([&](auto& arm) { arm.command = command; }, elbow_.arm_); }
    WornElbow& elbow_;
    LawCommand command_;
  };

  /// What surrounds one movement.
  struct Course {
    const Array& noise;
    const Array* sensor_error;
    bool emg;
    double tolerance, hold;
    std::size_t most;
  };

  template <class Arm>
  static void reach(Arm& arm, const p::ReachingTask<double>& task, const Course& course, std::vector<double>& rows) {
    p::aim(arm.person, arm.reach, task);
    const std::size_t n = course.noise.shape[0];
    const double* error = course.sensor_error != nullptr ? course.sensor_error->data : nullptr;
    double held = 0;
    Healthy healthy;
    for (std::size_t k = 0; k < course.most && held < course.hold; ++k) {
      rows.resize(columns * (k + 1));
      arm.period(course.noise.data + 5 * (k % n), error != nullptr ? error + k % n : nullptr, course.emg,
                 rows.data() + columns * k, healthy);
      // Someone who has just arrived is not holding yet.
      const bool there =
          arm.reach.time > task.reaction && std::fabs(arm.state.limb_position - task.target) <= course.tolerance;
      held = there ? held + arm.person.params.period : 0;
    }
  }

  template <class Arm>
  static void strap_on(Arm& arm, nb::handle parameters, nb::handle load, double position0, nb::handle robot,
                       nb::handle strap, nb::handle drive, const char* law, nb::handle law_parameters,
                       nb::handle emg_gains, nb::handle substeps, nb::handle sensor_delay, nb::handle supervisor,
                       nb::handle drive_reading) {
    const auto params = read_params<typename Arm::Model, double>("parameters", parameters);
    if (!(params.period > 0 && std::isfinite(params.period)))
      throw nb::value_error("parameters: expected a period above 0");
    arm.person = p::coefficients(params);
    arm.smoothing = 1 - std::exp(-params.period * 25.0);  // 4 Hz

    p::WornGearedPlantParams<double> plant;
    plant.limb = params.limb;
    plant.worn = !robot.is_none();
    plant.robot.joint.motor_inertia = 1;
    plant.robot.joint.link.inertia = 1;
    plant.robot.joint.transmission.stiffness = 1;
    const Array d = read_array("drive", drive), g = read_array("emg_gains", emg_gains);
    d.expect("(5,)", {5});
    g.expect("(2,)", {2});
    if (plant.worn) {
      plant.robot.joint = read_params<p::GearedJointParams<double>, double>("robot", robot);
    }
    plant.strap = read_params<p::StrapParams<double>, double>("strap", strap);
    plant.robot.drive = {d.data[0], 0, d.data[2], d.data[3], 0};
    plant.robot.encoder = {d.data[4]};
    plant.robot.loop.period = params.period;
    plant.robot.substeps = static_cast<std::uint32_t>(read_integer("substeps", substeps, 1, 1000));
    arm.gain = d.data[0];
    arm.limit = d.data[1];
    arm.emg_gain[0] = g.data[0];
    arm.emg_gain[1] = g.data[1];
    arm.sensor_delay = static_cast<std::uint32_t>(read_integer("sensor_delay", sensor_delay, 0, 63));
    arm.reading = read_drive_reading(drive_reading, params.period);
    arm.plant = p::coefficients(plant);
    arm.state = p::balanced(arm.plant, position0);
    arm.reach = p::holding(arm.person, position0, read_load<double>(load));
    arm.law = read_supervised<double>(law, law_parameters, supervisor);
    seal_law(arm.law);
    arm.level[0] = arm.reach.torque > 0 ? arm.reach.torque : 0;
    arm.level[1] = arm.reach.torque < 0 ? -arm.reach.torque : 0;
  }
};

/// One drive's measurement, a period at a time.
class DriveReading {
 public:
  DriveReading(nb::handle parameters, double period) : reading_(read_drive_reading(parameters, period)) {}
  double step(double effort, double noise) { return p::step(reading_, state_, effort, noise); }

 private:
  p::DriveReadingCoefficients<double> reading_;
  p::DriveReadingState<double> state_{};
};

constexpr const char* optimal_policy_doc = R"(What a person who reaches by optimal feedback settles before a movement.

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
    then and as of now.)";

nb::dict optimal_policy(nb::handle parameters, nb::handle load, double amplitude, double target, double duration,
                        double variance) {
  const auto params = read_params<p::OptimalReachingParams<double>, double>("parameters", parameters);
  const auto found = p::policy(p::coefficients(params), read_load<double>(load), amplitude, target, duration, variance);
  nb::dict told;
  const auto tell = [&told](const char* name, const double* numbers, Shape shape) {
    Result result(shape);
    std::copy_n(numbers, shape.size() == 1 ? shape[0] : shape[0] * shape[1], result.data);
    told[name] = result.array();
  };
  told["unit_time"] = found.moving_time;
  tell("moving", found.moving, {4});
  tell("holding", found.holding, {4});
  told["cocontraction"] = found.cocontraction;
  told["stiffness"] = found.stiffness;
  told["damping"] = found.damping;
  tell("transition", &found.transition.at[0][0], {3, 3});
  tell("belief", &found.belief[0][0], {3, 2});
  tell("now", &found.now[0][0], {3, 2});
  return told;
}

}  // namespace

void add_elbow(nb::module_& m) {
  for_each_person([&m](auto i) {
    using Model = typename std::variant_alternative_t<i, AnyWornArm>::Model;
    std::string name = Model::model;
    for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    m.attr((name + "_PARAMETER_NAMES").c_str()) = names_of<Model>();
  });
  nb::list models;
  for (const char* name : person_models) models.append(name);
  m.attr("PERSON_MODELS") = nb::tuple(models);
  nb::class_<WornElbow>(m, "WornElbow", worn_elbow_doc)
      .def(nb::init<nb::handle, nb::handle, double, nb::handle, nb::handle, nb::handle, const char*, nb::handle,
                    nb::handle, nb::handle, const std::string&, nb::handle, nb::handle, nb::handle>(),
           nb::arg("parameters"), nb::arg("load"), nb::kw_only(), nb::arg("position0"), nb::arg("robot").none() = nb::none(),
           nb::arg("strap"), nb::arg("drive"), nb::arg("law") = "none", nb::arg("law_parameters").none() = nb::none(),
           nb::arg("emg_gains"), nb::arg("substeps"), nb::arg("person") = "reaching", nb::arg("sensor_delay") = 0,
           nb::arg("supervisor").none() = nb::none(), nb::arg("drive_reading").none() = nb::none(),
           nb::sig("def __init__(self, parameters: ArrayLike, load: ArrayLike, *, position0: float, robot: ArrayLike | "
                   "None = None, strap: ArrayLike, drive: ArrayLike, law: str = 'none', law_parameters: ArrayLike | "
                   "None = None, emg_gains: ArrayLike, substeps: int, person: str = 'reaching', sensor_delay: int = 0, "
                   "supervisor: ArrayLike | None = None, drive_reading: ArrayLike | None = None) -> None"))
      .def("move", &WornElbow::move, nb::kw_only(), nb::arg("target"), nb::arg("amplitude"), nb::arg("duration"),
           nb::arg("reaction"), nb::arg("load"), nb::arg("tolerance"), nb::arg("hold"), nb::arg("noise"), nb::arg("longest"),
           nb::arg("sensor_error").none() = nb::none(), nb::arg("emg") = false, nb::arg("command").none() = nb::none(),
           nb::sig("def move(self, *, target: float, amplitude: float, duration: float, reaction: float, load: "
                   "ArrayLike, tolerance: float, hold: float, noise: ArrayLike, longest: int, sensor_error: ArrayLike | None "
                   "= None, emg: bool = False, command: Callable[[float, float, float], float] | None = None) -> "
                   "tuple[NDArray[float64], ...]"),
           move_doc)
      .def("live", &WornElbow::live, nb::kw_only(), nb::arg("tasks"), nb::arg("noise"), nb::arg("sensor_error").none(),
           nb::arg("emg"), nb::arg("tremor"), nb::arg("stops"), nb::arg("fault"), nb::arg("onset"), nb::arg("seconds"),
           nb::arg("longest"), nb::arg("seed"), nb::arg("drive_noise").none() = nb::none(),
           nb::arg("command").none() = nb::none(),
           nb::sig("def live(self, *, tasks: ArrayLike, noise: ArrayLike, sensor_error: ArrayLike | None, emg: bool, "
                   "tremor: ArrayLike, stops: ArrayLike, fault: str, onset: float, seconds: float, longest: int, seed: "
                   "int, drive_noise: ArrayLike | None = None, command: Callable[[float, float, float], float] | None = "
                   "None) -> dict"),
           live_doc)
      .def_prop_ro("lasting", &WornElbow::lasting, nb::sig("def lasting(self) -> dict"),
                   "What of a person outlasts a movement, and how the last went; empty where the model has nothing.")
      .def_prop_ro("fault", &WornElbow::fault, "Why its supervisor has stopped; 'none' while all is well.");
  m.attr("DRIVE_READING_NAMES") = names_of<p::DriveReadingParams<double>>();
  nb::class_<DriveReading>(m, "DriveReading", drive_reading_doc)
      .def(nb::init<nb::handle, double>(), nb::arg("parameters").none(), nb::arg("period"),
           nb::sig("def __init__(self, parameters: ArrayLike | None, period: float) -> None"))
      .def("step", &DriveReading::step, nb::arg("effort"), nb::arg("noise") = 0.0,
           nb::sig("def step(self, effort: float, noise: float = 0.0) -> float"),
           "The reading [N m] at the end of a period in which the drive gave `effort` [N m]; `noise` [N m].");
  m.def("optimal_policy", optimal_policy, nb::arg("parameters"), nb::arg("load"), nb::kw_only(), nb::arg("amplitude"),
        nb::arg("target"), nb::arg("duration"), nb::arg("variance"),
        nb::sig("def optimal_policy(parameters: ArrayLike, load: ArrayLike, *, amplitude: float, target: float, duration: "
                "float, variance: float) -> dict"),
        optimal_policy_doc);
  m.def("single_faults", single_faults, nb::sig("def single_faults() -> list[dict]"),
        "Faults of `WornElbow.live`: name, group, sentence, needs (a sensor), at_start, joint_encoder, hidden (why).");
}

}  // namespace bindings
