// pellucid._core: the core for Python. Checks what comes in, releases the interpreter's lock, runs the kernels.
#include "controllers.hpp"
#include "coupled_plant.hpp"
#include "docs.hpp"
#include "elbow.hpp"
#include "emg_estimator.hpp"
#include "fields.hpp"
#include "hill.hpp"
#include "kernels.hpp"
#include "laws.hpp"
#include "number_text.hpp"
#include "main_movement.hpp"
#include "read_rows.hpp"
#include "regression_trees.hpp"
#include "strap.hpp"
#include "strap_response.hpp"
#include "supervision.hpp"
#include "tree.hpp"
#include "worn_orthosis.hpp"
#include "zero_phase.hpp"

#include <pellucid/pellucid.hpp>
#include <pellucid/resistance.hpp>

#include <nanobind/stl/string.h>

#include <cmath>
#include <thread>
#include <vector>

namespace nb = nanobind;

namespace bindings {
namespace {

namespace p = pellucid;

const Kernels& kernels = best_kernels();

constexpr const char* loop_names[] = {"none", "p", "pi", "pd", "cascade", "velocity_pi"};
constexpr const char* setting_names[setting_count] = {"kp",
                                                      "ki",
                                                      "kd",
                                                      "kv",
                                                      "limit",
                                                      "gain",
                                                      "back_emf",
                                                      "encoder_quantum",
                                                      "ripple_amplitude",
                                                      "ripple_wave_number",
                                                      "ripple_phase",
                                                      "position0",
                                                      "velocity0",
                                                      "integral0",
                                                      "presliding_travel"};

/// Inputs and outputs of a simulation of a kind of plant.
struct Model {
  const char* function;
  std::size_t parameters;
  std::size_t outputs;
  bool has_modes;  // of friction
};
constexpr Model one_joint = {"simulate", p::parameter_count, output_count, true};
constexpr Model joints = {"simulate_batch", p::parameter_count, output_count, true};
constexpr Model one_joint_jacobian = {"simulate_jacobian", p::parameter_count, output_count, true};
constexpr Model geared_joints = {"simulate_geared", p::geared_parameter_count, geared_output_count, false};

// ---- the joint ----

/// The parameters of one joint, and arrays as long as the first of them.
struct JointArguments {
  Array parameters;
  std::vector<Array> arrays;
  std::size_t n;

  JointArguments(nb::handle parameters_, std::initializer_list<std::pair<const char*, nb::handle>> named)
      : parameters(read_array("parameters", parameters_)), n(0) {
    parameters.expect(text({p::parameter_count}), {p::parameter_count});
    for (const auto& [name, value] : named) {
      arrays.push_back(read_array(name, value));
      if (arrays.size() == 1) {
        if (arrays[0].shape.size() != 1) arrays[0].fail("(n,)");
        n = arrays[0].shape[0];
      }
      arrays.back().expect(same_length(named.begin()->first, n), {n});
    }
  }
  const double* operator[](std::size_t i) const { return arrays[i].data; }
};

nb::object inverse_dynamics(nb::handle parameters, nb::handle position, nb::handle velocity, nb::handle acceleration) {
  const JointArguments in(parameters, {{"position", position}, {"velocity", velocity}, {"acceleration", acceleration}});
  Result effort({in.n});
  {
    nb::gil_scoped_release release;
    kernels.inverse_dynamics(in.parameters.data, in.n, in[0], in[1], in[2], effort.data);
  }
  return effort.array();
}

nb::object inverse_dynamics_jacobian(nb::handle parameters, nb::handle position, nb::handle velocity,
                                     nb::handle acceleration, nb::handle active) {
  const JointArguments in(parameters, {{"position", position}, {"velocity", velocity}, {"acceleration", acceleration}});
  const std::vector<std::size_t> indices = read_indices("active", active, p::parameter_count);
  Result effort({in.n});
  Result jacobian({in.n, indices.size()});
  {
    nb::gil_scoped_release release;
    kernels.inverse_dynamics_jacobian(in.parameters.data, in.n, in[0], in[1], in[2], indices.data(), indices.size(),
                                      effort.data, jacobian.data);
  }
  return nb::make_tuple(effort.array(), jacobian.array());
}

nb::object forward_dynamics(nb::handle parameters, nb::handle position, nb::handle velocity, nb::handle effort) {
  const JointArguments in(parameters, {{"position", position}, {"velocity", velocity}, {"effort", effort}});
  Result acceleration({in.n});
  {
    nb::gil_scoped_release release;
    kernels.forward_dynamics(in.parameters.data, in.n, in[0], in[1], in[2], acceleration.data);
  }
  return acceleration.array();
}

nb::object friction(nb::handle parameters, nb::handle velocity, nb::handle load) {
  const JointArguments in(parameters, {{"velocity", velocity}, {"load", load}});
  Result effort({in.n});
  {
    nb::gil_scoped_release release;
    kernels.friction(in.parameters.data, in.n, in[0], in[1], effort.data);
  }
  return effort.array();
}

nb::object load(nb::handle parameters, nb::handle position, nb::handle acceleration) {
  const JointArguments in(parameters, {{"position", position}, {"acceleration", acceleration}});
  Result effort({in.n});
  {
    nb::gil_scoped_release release;
    kernels.load(in.parameters.data, in.n, in[0], in[1], effort.data);
  }
  return effort.array();
}

nb::object presliding(nb::handle travel, nb::handle position) {
  const Array way = read_array("position", position);
  if (way.shape.size() != 1) way.fail("(n,)");
  const double over = read_number("travel", travel);
  Result result({way.shape[0]});
  {
    nb::gil_scoped_release release;
    kernels.presliding(over, way.shape[0], way.data, result.data);
  }
  return result.array();
}

// ---- the plant ----

/// The keywords of a call, each taken once.
class Keywords {
 public:
  Keywords(const char* function, const nb::kwargs& kwargs)
      : function_(function), left_(nb::steal(PyDict_Copy(kwargs.ptr()))) {}

  nb::object take(const char* name) {
    nb::object value = nb::borrow(PyDict_GetItemString(left_.ptr(), name));
    if (value.is_valid()) PyDict_DelItemString(left_.ptr(), name);
    return value.is_valid() ? value : nb::none();
  }
  nb::object require(const char* name) {
    nb::object value = take(name);
    if (value.is_none()) throw nb::type_error((function_ + "() needs the keyword '" + name + "'").c_str());
    return value;
  }
  double number(const char* name, double otherwise) {
    nb::object value = take(name);
    return value.is_none() ? otherwise : read_number(name, value);
  }
  std::uint32_t count(const char* name, std::uint32_t otherwise, std::uint32_t least, std::uint32_t most) {
    nb::object value = take(name);
    return value.is_none() ? otherwise : static_cast<std::uint32_t>(read_integer(name, value, least, most));
  }
  void finish() const {
    if (PyDict_Size(left_.ptr()) == 0) return;
    nb::object first = nb::borrow<nb::dict>(left_).keys()[0];
    throw nb::type_error((function_ + "() does not know the keyword '" + nb::str(first).c_str() + "'").c_str());
  }

 private:
  std::string function_;
  nb::object left_;
};

/// A simulation with what keeps its pointers alive.
struct SimulationArguments {
  Simulation simulation;
  std::vector<Array> held;
  std::vector<Result> outputs;

  /// One plant, or (batch) as many as `parameters` has rows. Takes its keywords; the caller may take more.
  SimulationArguments(const Model& model, nb::handle parameters, Keywords& keywords, bool batch) {
    held.reserve(setting_count + 5);
    const Array& p0 = held.emplace_back(read_array("parameters", parameters));
    if (batch) {
      if (p0.shape.size() != 2 || p0.shape[1] != model.parameters)
        p0.fail("(m, " + std::to_string(model.parameters) + ")");
      simulation.rows = p0.shape[0];
    } else {
      p0.expect(text({model.parameters}), {model.parameters});
      simulation.rows = 1;
    }
    simulation.parameters = {p0.data, model.parameters};

    const Array& reference = held.emplace_back(read_array("reference", keywords.require("reference")));
    const std::size_t dimensions = reference.shape.size();
    if (dimensions != 1 && !(batch && dimensions == 2)) reference.fail(batch ? "(n,) or (m, n)" : "(n,)");
    simulation.samples = reference.shape.back();
    simulation.reference = series(reference, batch);
    simulation.injected = series("injected", keywords, batch);
    simulation.disturbance = series("disturbance", keywords, batch);
    simulation.encoder_noise = series("encoder_noise", keywords, batch);

    simulation.period = read_number("period", keywords.require("period"));
    if (!(simulation.period > 0 && std::isfinite(simulation.period)))
      throw nb::value_error("period: expected a number of seconds above 0");
    simulation.substeps = keywords.count("substeps", 4, 1, 1000000);
    simulation.velocity_span = keywords.count("velocity_span", 0, 0, p::max_velocity_span);
    simulation.loop = loop(keywords.take("loop"));
    if (model.has_modes) simulation.stiction = truth(keywords.take("stiction"));
    const std::size_t settings = model.has_modes ? setting_count : presliding_travel;
    for (std::size_t i = 0; i < settings; ++i)
      simulation.settings[i] = setting(i, keywords.take(setting_names[i]), batch);

    for (std::size_t i = 0; i < model.outputs; ++i) {
      outputs.push_back(batch ? Result({simulation.rows, simulation.samples}) : Result({simulation.samples}));
      simulation.output[i] = outputs.back().data;
    }
  }
  SimulationArguments(const SimulationArguments&) = delete;

  Rows series(const Array& array, bool batch) const {
    if (batch && array.shape.size() == 2) {
      array.expect("(" + std::to_string(simulation.rows) + ", " + std::to_string(simulation.samples) + ")",
                   {simulation.rows, simulation.samples});
      return {array.data, simulation.samples};
    }
    array.expect(same_length("reference", simulation.samples), {simulation.samples});
    return {array.data, 0};
  }
  Rows series(const char* name, Keywords& keywords, bool batch) {
    const nb::object value = keywords.take(name);
    if (value.is_none()) return {};
    return series(held.emplace_back(read_array(name, value)), batch);
  }
  Rows setting(std::size_t i, const nb::object& value, bool batch) {
    static constexpr double zero = 0, one = 1;
    if (value.is_none()) return {i == gain ? &one : &zero, 0};
    const Array& array = held.emplace_back(read_array(setting_names[i], value));
    if (array.shape.empty()) return {array.data, 0};
    if (!batch) array.fail("a number");
    array.expect("a number or (" + std::to_string(simulation.rows) + ",)", {simulation.rows});
    return {array.data, 1};
  }
  static bool truth(const nb::object& value) { return !value.is_none() && nb::cast<bool>(value); }
  static std::uint8_t loop(const nb::object& value) {
    if (value.is_none()) return 0;
    const std::string name = nb::str(value).c_str();
    for (std::uint8_t i = 0; i < 6; ++i)
      if (name == loop_names[i]) return i;
    throw nb::value_error(("loop: got '" + name + "', expected none, p, pi, pd, cascade or velocity_pi").c_str());
  }
};

nb::object simulate(nb::handle parameters, const nb::kwargs& kwargs) {
  Keywords keywords(one_joint.function, kwargs);
  SimulationArguments in(one_joint, parameters, keywords, false);
  keywords.finish();
  {
    nb::gil_scoped_release release;
    kernels.simulate(in.simulation, 0, 1);
  }
  return tuple_of(in.outputs);
}

/// Many rows, shared between threads.
nb::object simulate_rows(const Model& model, void (*run)(const Simulation&, std::size_t, std::size_t),
                         nb::handle parameters, const nb::kwargs& kwargs) {
  Keywords keywords(model.function, kwargs);
  SimulationArguments in(model, parameters, keywords, true);
  const std::size_t threads = keywords.count("threads", 1, 1, 1024);
  keywords.finish();
  {
    nb::gil_scoped_release release;
    const std::size_t rows = in.simulation.rows;
    // Whole blocks of lanes for every thread; a row's numbers do not depend on its neighbours.
    const std::size_t share = ((rows + threads - 1) / threads + 31) / 32 * 32;
    std::vector<std::thread> others;
    for (std::size_t first = share; first < rows; first += share)
      others.emplace_back(
          [&in, run, first, last = first + share < rows ? first + share : rows] { run(in.simulation, first, last); });
    run(in.simulation, 0, share < rows ? share : rows);
    for (std::thread& other : others) other.join();
  }
  return tuple_of(in.outputs);
}

nb::object simulate_batch(nb::handle parameters, const nb::kwargs& kwargs) {
  return simulate_rows(joints, kernels.simulate, parameters, kwargs);
}

nb::object simulate_geared(nb::handle parameters, const nb::kwargs& kwargs) {
  return simulate_rows(geared_joints, kernels.simulate_geared, parameters, kwargs);
}

nb::object simulate_jacobian(nb::handle parameters, const nb::kwargs& kwargs) {
  Keywords keywords(one_joint_jacobian.function, kwargs);
  SimulationArguments in(one_joint_jacobian, parameters, keywords, false);
  const std::vector<std::size_t> indices = read_indices("active", keywords.require("active"), p::parameter_count);
  keywords.finish();
  if (in.simulation.stiction)
    throw nb::value_error("stiction: not differentiable; expected False (smooth friction, with a velocity_width)");
  double* derivative[differentiated_count];
  for (double*& pointer : derivative) {
    in.outputs.push_back(Result({in.simulation.samples, indices.size()}));
    pointer = in.outputs.back().data;
  }
  {
    nb::gil_scoped_release release;
    kernels.simulate_jacobian(in.simulation, indices.data(), indices.size(), derivative);
  }
  return tuple_of(in.outputs);
}

// ---- filters and the gate ----

constexpr std::size_t max_sections = 16;

template <class S> class Biquads {
 public:
  explicit Biquads(nb::handle sos) {
    const Array array = read_array("sos", sos);
    if (array.shape.size() != 2 || array.shape[1] != 6) array.fail("(k, 6)");
    if (array.shape[0] > max_sections) array.fail("(k, 6) with k at most " + std::to_string(max_sections));
    coefficients_.count = array.shape[0];
    for (std::size_t i = 0; i < array.shape[0]; ++i) {
      const double* row = array.data + 6 * i;
      if (row[3] != 1.0) throw nb::value_error("sos: expected every a0 (column 3) to be 1");
      coefficients_.section[i] = {static_cast<S>(row[0]), static_cast<S>(row[1]), static_cast<S>(row[2]),
                                  static_cast<S>(row[4]), static_cast<S>(row[5])};
    }
  }
  S step(S x) { return p::step(coefficients_, state_, x); }
  nb::object filter(nb::handle samples) {
    const Array x = read_array("x", samples);
    if (x.shape.size() != 1) x.fail("(n,)");
    BasicResult<S> y({x.shape[0]});
    for (std::size_t i = 0; i < x.shape[0]; ++i) y.data[i] = step(static_cast<S>(x.data[i]));
    return y.array();
  }
  void reset() { state_ = {}; }

 private:
  p::BiquadCoefficients<S, max_sections> coefficients_;
  p::BiquadState<S, max_sections> state_;
};

class SafetyGate {
 public:
  SafetyGate(double effort_limit, double rate_limit, double velocity_limit, double position_min, double position_max,
             double stop_margin, double max_age, std::uint32_t max_repeats, double period)
      : coefficients_(
            p::coefficients(p::SafetyParams<double>{effort_limit, rate_limit, velocity_limit, position_min,
                                                    position_max, stop_margin, max_age, max_repeats, period})) {
    reset();
  }
  double step(double command, double position, double velocity, double time, std::int64_t sequence) {
    const bool valid = std::fabs(time) < 9e12;  // microseconds that 64 bits hold; false for NaN
    const std::int64_t microseconds = valid ? std::llround(time * 1e6) : 0;
    return p::step(coefficients_, state_,
                   {command, position, velocity, microseconds, static_cast<std::uint32_t>(sequence), valid});
  }
  const char* fault() const { return p::safety_fault_names[static_cast<std::size_t>(state_.fault)]; }
  void reset() {
    p::reset(state_);
    if (!coefficients_.valid) state_.fault = p::SafetyFault::configuration;
  }

 private:
  p::SafetyCoefficients<double> coefficients_;
  p::SafetyState<double> state_;
};

// ---- what is said of parameters ----

nb::dict model_fields() {
  nb::dict models;
  models["joint"] = fields_of<p::JointParams<double>>();
  models["presliding"] = fields_of<p::PreslidingParams<double>>();
  models["geared_joint"] = fields_of<p::GearedJointParams<double>>();
  models["coupled_plant"] = fields_of<p::CoupledPlantParams<double>>();
  models["reaching"] = fields_of<p::ReachingParams<double>>();
  models["postural"] = fields_of<p::PosturalParams<double>>();
  models["optimal"] = fields_of<p::OptimalReachingParams<double>>();
  models["link"] = fields_of<p::LinkParams<double>>();
  models["cuff"] = fields_of<p::CuffParams<double>>();
  models["posture_servo"] = fields_of<p::PostureServoParams<double>>();
  models["muscle"] = fields_of<p::EmgMuscleParams<double>>();
  models["emg_channel"] = fields_of<p::EmgChannelParams<double>>();
  models["watched_channel"] = fields_of<p::WatchedChannelParams<double>>();
  models["watched_angle"] = fields_of<p::WatchedAngleParams<double>>();
  models["estimated_joint"] = fields_of<p::EstimatedJointParams<double>>();
  models["short_range"] = fields_of<p::ShortRangeParams<double>>();
  models["strap_estimator"] = fields_of<p::StrapEstimatorParams<double>>();
  models["gate"] = fields_of<p::SafetyParams<double>>();
  models["supervisor"] = fields_of<p::SupervisorParams<double>>();
  models["tree_joint"] = fields_of<p::TreeJointParams<double>>();
  models["tree_motor"] = fields_of<p::TreeMotorParams<double>>();
  models["tree_law_joint"] = fields_of<p::JointShareParams<double>>();
  models["tree_law_whole"] = fields_of<p::WholeTreeParams<double>>();
  models["tree_watch_joint"] = fields_of<p::JointWatchParams<double>>();
  models["tree_watch_whole"] = fields_of<p::WholeWatchParams<double>>();
  return models;
}

// ---- sums of what resists ----

constexpr std::size_t most_powers = 16;

p::ResistanceSums<double, most_powers> resistance_sums(const Array& roles, const double* coefficients,
                                                       std::size_t step) {
  p::ResistanceSums<double, most_powers> sums;
  for (std::size_t i = 0; i < roles.shape[0]; ++i) {
    const double* role = roles.data + 3 * i;
    sums.add({true, static_cast<float>(role[0]), static_cast<float>(role[1]), role[2] != 0.0}, coefficients[i * step]);
  }
  return sums;
}

Array read_roles(nb::handle roles) {
  Array array = read_array("roles", roles);
  if (array.shape.size() != 2 || array.shape[1] != 3) array.fail("(k, 3)");
  return array;
}

nb::list resistance_coefficients(nb::handle roles, nb::handle coefficients) {
  const Array role = read_roles(roles), values = read_array("coefficients", coefficients);
  values.expect("(k,)", {role.shape[0]});
  const auto sums = resistance_sums(role, values.data, 1);
  nb::list list;
  for (std::size_t i = 0; i < sums.count; ++i)
    list.append(nb::make_tuple(sums.powers[i].speed, sums.powers[i].load, sums.coefficient(i)));
  return list;
}

nb::object max_resistance(nb::handle roles, nb::handle coefficients, nb::handle speed, nb::handle load) {
  const Array role = read_roles(roles), v = read_array("speed", speed), y = read_array("load", load);
  if (v.shape.size() != 1) v.fail("(n,)");
  const std::size_t n = v.shape[0];
  y.expect("(n,)", {n});
  const Array values = read_array("coefficients", coefficients);
  values.expect("(k, n)", {role.shape[0], n});
  Result effort({n});
  for (std::size_t i = 0; i < n; ++i)
    effort.data[i] = resistance_sums(role, values.data + i, n).at(v.data[i], y.data[i]);
  return effort.array();
}

// ---- elementary functions ----

template <class S> S call_exp(S x) { return p::exp(x); }
template <class S> S call_log(S x) { return p::log(x); }
template <class S> S call_sin(S x) { return p::sin(x); }
template <class S> S call_cos(S x) { return p::cos(x); }
template <class S> S call_tanh(S x) { return p::tanh(x); }

template <class S> nb::object map(S (*f)(S), const BasicArray<S>& x) {
  BasicResult<S> y(x.shape);
  for (std::size_t i = 0; i < x.size(); ++i) y.data[i] = f(x.data[i]);
  return y.array();
}
nb::object elementwise(double (*in_double)(double), float (*in_float)(float), nb::handle x) {
  if (is_float32(x)) return map(in_float, read_array_of<float>("x", x));
  return map(in_double, read_array("x", x));
}

}  // namespace
}  // namespace bindings

NB_MODULE(_core, m) {
  namespace b = bindings;
  namespace p = pellucid;
  b::keep_pages();
  m.doc() = "The core: every physical model once, in C++ (include/pellucid). SI units throughout.";

  m.attr("PARAMETER_NAMES") = b::names_of<p::JointParams<double>>();
  m.attr("GEARED_PARAMETER_NAMES") = b::names_of<p::GearedJointParams<double>>();
  m.def("model_fields", b::model_fields, nb::sig("def model_fields() -> dict[str, list[dict]]"), b::docs::model_fields);
  m.attr("instructions") = b::kernels.instructions;

  m.def("inverse_dynamics", b::inverse_dynamics, nb::arg("parameters").none(), nb::arg("position").none(),
        nb::arg("velocity").none(), nb::arg("acceleration").none(), nb::sig(b::docs::inverse_dynamics_sig),
        b::docs::inverse_dynamics);
  m.def("inverse_dynamics_jacobian", b::inverse_dynamics_jacobian, nb::arg("parameters").none(),
        nb::arg("position").none(), nb::arg("velocity").none(), nb::arg("acceleration").none(),
        nb::arg("active").none(), nb::sig(b::docs::inverse_dynamics_jacobian_sig), b::docs::inverse_dynamics_jacobian);
  m.def("forward_dynamics", b::forward_dynamics, nb::arg("parameters").none(), nb::arg("position").none(),
        nb::arg("velocity").none(), nb::arg("effort").none(), nb::sig(b::docs::forward_dynamics_sig),
        b::docs::forward_dynamics);
  m.def("friction", b::friction, nb::arg("parameters").none(), nb::arg("velocity").none(), nb::arg("load").none(),
        nb::sig(b::docs::friction_sig), b::docs::friction);
  m.def("resistance_coefficients", b::resistance_coefficients, nb::arg("roles").none(), nb::arg("coefficients").none(),
        nb::sig(b::docs::resistance_coefficients_sig), b::docs::resistance_coefficients);
  m.def("max_resistance", b::max_resistance, nb::arg("roles").none(), nb::arg("coefficients").none(),
        nb::arg("speed").none(), nb::arg("load").none(), nb::sig(b::docs::max_resistance_sig),
        b::docs::max_resistance);
  m.def("load", b::load, nb::arg("parameters").none(), nb::arg("position").none(), nb::arg("acceleration").none(),
        nb::sig(b::docs::load_sig), b::docs::load);
  m.def("presliding", b::presliding, nb::arg("travel"), nb::arg("position"), nb::sig(b::docs::presliding_sig),
        b::docs::presliding);
  m.def("simulate", b::simulate, nb::arg("parameters").none(), nb::arg("kwargs"), nb::sig(b::docs::simulate_sig),
        b::docs::simulate);
  m.def("simulate_batch", b::simulate_batch, nb::arg("parameters").none(), nb::arg("kwargs"),
        nb::sig(b::docs::simulate_batch_sig), b::docs::simulate_batch);
  m.def("simulate_geared", b::simulate_geared, nb::arg("parameters").none(), nb::arg("kwargs"),
        nb::sig(b::docs::simulate_geared_sig), b::docs::simulate_geared);
  m.def("simulate_jacobian", b::simulate_jacobian, nb::arg("parameters").none(), nb::arg("kwargs"),
        nb::sig(b::docs::simulate_jacobian_sig), b::docs::simulate_jacobian);

  nb::class_<b::Biquads<double>>(m, "Biquads", b::docs::biquads)
      .def(nb::init<nb::handle>(), nb::arg("sos").none(), nb::sig("def __init__(self, sos: ArrayLike) -> None"))
      .def("step", &b::Biquads<double>::step, nb::arg("x"), "One sample.")
      .def("filter", &b::Biquads<double>::filter, nb::arg("x").none(),
           nb::sig("def filter(self, x: ArrayLike) -> NDArray[float64]"),
           "Samples one after another, going on from the state.")
      .def("reset", &b::Biquads<double>::reset, "Back to a state of zeros.");
  nb::class_<b::Biquads<float>>(m, "BiquadsFloat", b::docs::biquads_float)
      .def(nb::init<nb::handle>(), nb::arg("sos").none(), nb::sig("def __init__(self, sos: ArrayLike) -> None"))
      .def("step", &b::Biquads<float>::step, nb::arg("x"), "One sample.")
      .def("filter", &b::Biquads<float>::filter, nb::arg("x").none(),
           nb::sig("def filter(self, x: ArrayLike) -> NDArray[float32]"),
           "Samples one after another, going on from the state.")
      .def("reset", &b::Biquads<float>::reset, "Back to a state of zeros.");

  nb::class_<b::SafetyGate>(m, "SafetyGate", b::docs::safety_gate)
      .def(nb::init<double, double, double, double, double, double, double, std::uint32_t, double>(), nb::kw_only(),
           nb::arg("effort_limit"), nb::arg("rate_limit"), nb::arg("velocity_limit"), nb::arg("position_min"),
           nb::arg("position_max"), nb::arg("stop_margin"), nb::arg("max_age"), nb::arg("max_repeats"),
           nb::arg("period"))
      .def("step", &b::SafetyGate::step, nb::arg("command"), nb::arg("position"), nb::arg("velocity"), nb::arg("time"),
           nb::arg("sequence"), b::docs::safety_gate_step)
      .def_prop_ro("fault", &b::SafetyGate::fault, b::docs::safety_gate_fault)
      .def("reset", &b::SafetyGate::reset,
           "Open the gate again; the output goes on from where it is, within the rate limit.");

  b::add_controllers(m);
  b::add_laws(m);
  b::add_supervision(m);
  b::add_coupled_plant(m);
  b::add_elbow(m);
  b::add_emg_estimator(m);
  b::add_worn_orthosis(m);
  b::add_hill(m);
  b::add_strap(m);
  b::add_strap_response(m);
  b::add_tree(m);
  b::add_driven_tree(m);
  b::add_worn_tree(m);
  b::add_tree_laws(m);
  b::add_regression_trees(m);
  b::add_zero_phase(m);
  b::add_number_text(m);
  b::add_read_rows(m);
  b::add_main_movement(m);

  nb::module_ math = m.def_submodule("math", "The core's elementary functions, on float64 or float32 arrays.");
  const auto elementary = [&math](const char* name, double (*in_double)(double), float (*in_float)(float),
                                  const char* signature) {
    math.def(
        name, [in_double, in_float](nb::handle x) { return b::elementwise(in_double, in_float, x); },
        nb::arg("x").none(), nb::sig(signature));
  };
  elementary("exp", b::call_exp<double>, b::call_exp<float>, "def exp(x: ArrayLike) -> NDArray");
  elementary("log", b::call_log<double>, b::call_log<float>, "def log(x: ArrayLike) -> NDArray");
  elementary("sin", b::call_sin<double>, b::call_sin<float>, "def sin(x: ArrayLike) -> NDArray");
  elementary("cos", b::call_cos<double>, b::call_cos<float>, "def cos(x: ArrayLike) -> NDArray");
  elementary("tanh", b::call_tanh<double>, b::call_tanh<float>, "def tanh(x: ArrayLike) -> NDArray");
}
