// Hill's muscles: torque over arrays with exact derivatives, and sample by sample as a robot runs it.
#include "hill.hpp"

#include "fields.hpp"
#include "hill_kernels.hpp"

#include <pellucid/elastic_muscle.hpp>
#include <pellucid/hill_torque.hpp>

#include <cmath>
#include <memory>
#include <string_view>

namespace bindings {
namespace {

namespace p = pellucid;

const HillKernels& kernels = best_hill_kernels();
constexpr std::size_t delay_capacity = 1024;

constexpr const char* torque_sig =
    "def hill_torque(parameters: ArrayLike, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, moment_arm: "
    "ArrayLike, *, period: float, starts: ArrayLike | None = None) -> NDArray[float64]";
constexpr const char* torque_doc = R"(Torque of several muscles from their EMG envelopes, at one joint or at j of them.

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
    [N m].)";

constexpr const char* jacobian_sig =
    "def hill_jacobian(parameters: ArrayLike, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, "
    "moment_arm: ArrayLike, column: ArrayLike, gain: ArrayLike, *, period: float, starts: ArrayLike | None = None) -> "
    "tuple[NDArray[float64], NDArray[float64]]";
constexpr const char* jacobian_doc = R"(hill_torque and its exact derivatives by k free parameters.

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
    A row per free parameter.)";

constexpr const char* normal_sig =
    "def hill_normal(parameters: ArrayLike, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, moment_arm: "
    "ArrayLike, column: ArrayLike, gain: ArrayLike, measured: ArrayLike, *, period: float, starts: ArrayLike | None = "
    "None, weight: ArrayLike | None = None) -> tuple[float, NDArray[float64], NDArray[float64]]";
constexpr const char* normal_doc = R"(What a least-squares step needs, in one pass and without storing a Jacobian.

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
    J' J.)";

constexpr const char* states_sig =
    "def hill_states(parameters: ArrayLike, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, *, period: "
    "float, starts: ArrayLike | None = None) -> tuple[NDArray[float64], NDArray[float64], NDArray[float64], "
    "NDArray[float64]]";
constexpr const char* states_doc = R"(What each muscle does.

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
    In v_max l_o, lengthening positive [1].)";

constexpr const char* estimator_doc = R"(hill_torque sample by sample, causal, as a robot runs it.

Parameters
----------
parameters : (m, 18)
    A row per muscle in the order of MUSCLE_PARAMETER_NAMES; at most 32.
period : float
    From one sample to the next [s], > 0. No delay may be longer than 1021 periods.)";

constexpr const char* estimator_step_doc = R"(Torque at one sample more [N m].

Parameters
----------
excitation, length, velocity, moment_arm : (m,)
    As of hill_torque. A sample that is not finite makes the torque so, and does not stay.)";

constexpr const char* elastic_doc = R"(One muscle on an elastic tendon, sample by sample.

Parameters
----------
parameters : (18,)
    In the order of MUSCLE_PARAMETER_NAMES; those of envelope and activation are not used.
tendon_strain : float
    Of the tendon under F_0 [1], > 0.
period : float
    From one sample to the next [s], > 0.)";

constexpr const char* dynamics_sig =
    "def activation_dynamics(excitation: ArrayLike, *, period: float, activation_time: float = 0.01, "
    "deactivation_time: float = 0.04, start: float = 0.0) -> NDArray[float64]";
constexpr const char* dynamics_doc = R"(Activation from excitation by a first-order lag, quicker while activation rises.

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
    At the end of each period [1].)";

double positive(const char* name, double value) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw nb::value_error((std::string(name) + ": expected a finite number above 0").c_str());
  return value;
}

/// The arguments that all functions of several muscles share.
struct HillArguments {
  std::vector<Array> arrays;
  std::vector<std::size_t> starts;
  HillData data;
  bool several = false;  // whether moment arms, and thus torques, are those of several joints

  HillArguments(nb::handle parameters, std::initializer_list<std::pair<const char*, nb::handle>> named, double period,
                nb::handle starts_) {
    arrays.push_back(read_array("parameters", parameters));
    const Array& values = arrays[0];
    const std::size_t width = p::muscle_parameter_count;
    if (values.shape.size() != 2 || values.shape[1] != width || values.shape[0] == 0 || values.shape[0] > most_muscles)
      values.fail("(m, " + std::to_string(width) + ") with m from 1 to " + std::to_string(most_muscles));
    data.muscles = values.shape[0];
    for (const auto& [name, value] : named) {
      arrays.push_back(read_array(name, value));
      const Array& array = arrays.back();
      if (arrays.size() == 2) {
        if (array.shape.size() != 2 || array.shape[0] != data.muscles)
          array.fail("(" + std::to_string(data.muscles) + ", n), a row per muscle");
        data.samples = array.shape[1];
      }
      if (std::string_view(name) == "moment_arm" && array.shape.size() == 3) {
        data.joints = array.shape[0];
        several = true;
        if (data.joints == 0 || data.joints > most_joints)
          array.fail("(j, m, n) with j from 1 to " + std::to_string(most_joints));
        array.expect(text({data.joints, data.muscles, data.samples}) + ", as excitation for each joint",
                     {data.joints, data.muscles, data.samples});
        continue;
      }
      array.expect("(" + std::to_string(data.muscles) + ", " + std::to_string(data.samples) + "), as excitation",
                   {data.muscles, data.samples});
    }
    data.period = positive("period", period);
    starts = starts_.is_none() ? std::vector<std::size_t>{0} : read_indices("starts", starts_, data.samples);
    for (std::size_t i = 0; i < starts.size(); ++i)
      if (i == 0 ? starts[i] != 0 : starts[i] <= starts[i - 1])
        throw nb::value_error("starts: expected 0, then ascending indices");
    if (starts.empty()) throw nb::value_error("starts: expected 0, then ascending indices");
    data.parameters = arrays[0].data;
    data.excitation = arrays[1].data;
    data.length = arrays[2].data;
    data.velocity = arrays[3].data;
    data.moment_arm = arrays.size() > 4 ? arrays[4].data : nullptr;
    data.starts = starts.data();
    data.recordings = data.samples == 0 ? 0 : starts.size();
  }

  /// Of an array with a row of samples for each joint, below whatever comes before it.
  Shape rows(Shape before = {}) const {
    if (several) before.push_back(data.joints);
    before.push_back(data.samples);
    return before;
  }
};

/// Which parameters are free, and the memory that a pass needs.
struct Free {
  std::vector<std::int64_t> column;
  Array gain;
  HillFree free;
  std::vector<double> work;

  Free(std::size_t muscles, std::size_t joints, nb::handle column_, nb::handle gain_) : gain(read_array("gain", gain_)) {
    const Array columns = read_array("column", column_);
    const Shape shape{muscles, p::muscle_free_count};
    const std::string expected = text(shape) + ", a row per muscle";
    columns.expect(expected, shape);
    gain.expect(expected, shape);
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const double c = columns.data[i];
      if (!(c >= -1.0 && c < static_cast<double>(muscles * p::muscle_free_count)) || c != std::floor(c))
        throw nb::value_error("column: expected whole numbers, -1 or the number of a free parameter");
      column.push_back(static_cast<std::int64_t>(c));
      const auto needed = static_cast<std::size_t>(column.back() + 1);
      free.columns = needed > free.columns ? needed : free.columns;
    }
    free.column = column.data();
    free.gain = gain.data;
    work.resize((free.columns + 1) * joints * hill_block);
  }
};

nb::object hill_torque(nb::handle parameters, nb::handle excitation, nb::handle length, nb::handle velocity,
                       nb::handle moment_arm, double period, nb::handle starts) {
  const HillArguments in(
      parameters, {{"excitation", excitation}, {"length", length}, {"velocity", velocity}, {"moment_arm", moment_arm}},
      period, starts);
  Result torque(in.rows());
  std::vector<double> work(hill_block);
  HillFit fit;
  fit.torque = torque.data;
  fit.work = work.data();
  {
    nb::gil_scoped_release release;
    kernels.fit(in.data, {}, fit);
  }
  return torque.array();
}

nb::object hill_jacobian(nb::handle parameters, nb::handle excitation, nb::handle length, nb::handle velocity,
                         nb::handle moment_arm, nb::handle column, nb::handle gain, double period, nb::handle starts) {
  const HillArguments in(
      parameters, {{"excitation", excitation}, {"length", length}, {"velocity", velocity}, {"moment_arm", moment_arm}},
      period, starts);
  Free free(in.data.muscles, in.data.joints, column, gain);
  Result torque(in.rows()), jacobian(in.rows({free.free.columns}));
  HillFit fit;
  fit.torque = torque.data;
  fit.jacobian = jacobian.data;
  fit.work = free.work.data();
  {
    nb::gil_scoped_release release;
    kernels.fit(in.data, free.free, fit);
  }
  return nb::make_tuple(torque.array(), jacobian.array());
}

nb::object hill_normal(nb::handle parameters, nb::handle excitation, nb::handle length, nb::handle velocity,
                       nb::handle moment_arm, nb::handle column, nb::handle gain, nb::handle measured, double period,
                       nb::handle starts, nb::handle weight) {
  const HillArguments in(
      parameters, {{"excitation", excitation}, {"length", length}, {"velocity", velocity}, {"moment_arm", moment_arm}},
      period, starts);
  Free free(in.data.muscles, in.data.joints, column, gain);
  const std::size_t k = free.free.columns;
  const Array target = read_array("measured", measured);
  target.expect(text(in.rows()) + ", a sample for each of moment_arm's", in.rows());
  std::unique_ptr<Array> weights;
  if (!weight.is_none()) {
    weights = std::make_unique<Array>(read_array("weight", weight));
    weights->expect(text(in.rows()) + ", as measured", in.rows());
  }
  Result gradient({k}), normal({k, k});
  HillFit fit;
  fit.measured = target.data;
  fit.weight = weights ? weights->data : nullptr;
  fit.gradient = gradient.data;
  fit.normal = normal.data;
  fit.work = free.work.data();
  {
    nb::gil_scoped_release release;
    kernels.fit(in.data, free.free, fit);
  }
  return nb::make_tuple(fit.cost, gradient.array(), normal.array());
}

nb::object hill_states(nb::handle parameters, nb::handle excitation, nb::handle length, nb::handle velocity,
                       double period, nb::handle starts) {
  const HillArguments in(parameters, {{"excitation", excitation}, {"length", length}, {"velocity", velocity}}, period,
                         starts);
  std::vector<Result> out;
  for (int i = 0; i < 4; ++i) out.push_back(Result({in.data.muscles, in.data.samples}));
  {
    nb::gil_scoped_release release;
    kernels.states(in.data, {out[0].data, out[1].data, out[2].data, out[3].data});
  }
  return tuple_of(out);
}

p::EmgMuscleParams<double> muscle_params(const double* numbers, double period) {
  return p::emg_muscle_params(numbers, period);
}

class HillTorque {
 public:
  HillTorque(nb::handle parameters, double period) : own_(std::make_unique<Own>()) {
    const Array values = read_array("parameters", parameters);
    const std::size_t width = p::muscle_parameter_count;
    if (values.shape.size() != 2 || values.shape[1] != width || values.shape[0] == 0 || values.shape[0] > most_muscles)
      values.fail("(m, " + std::to_string(width) + ") with m from 1 to " + std::to_string(most_muscles));
    p::HillTorqueParams<double, most_muscles> params;
    params.count = values.shape[0];
    for (std::size_t m = 0; m < params.count; ++m) {
      params.muscle[m] = muscle_params(values.data + m * width, positive("period", period));
      if (params.muscle[m].delay > period * static_cast<double>(delay_capacity - 3))
        throw nb::value_error("parameters: a delay is longer than 1021 periods");
      own_->delay[m] = p::max(params.muscle[m].delay, 0.0);
    }
    own_->coefficients = p::coefficients<delay_capacity>(params);
    period_ = period;
  }

  double step(nb::handle excitation, nb::handle length, nb::handle velocity, nb::handle moment_arm) {
    Input input;
    read("excitation", excitation, input.excitation);
    read("length", length, input.length);
    read("velocity", velocity, input.velocity);
    read("moment_arm", moment_arm, input.moment_arm);
    return p::step(own_->coefficients, own_->state, input);
  }

  nb::object run(nb::handle excitation, nb::handle length, nb::handle velocity, nb::handle moment_arm) {
    const std::size_t count = own_->coefficients.count;
    const Array arrays[] = {read_array("excitation", excitation), read_array("length", length),
                            read_array("velocity", velocity), read_array("moment_arm", moment_arm)};
    if (arrays[0].shape.size() != 2) arrays[0].fail("(m, n)");
    const std::size_t n = arrays[0].shape[1];
    for (const Array& array : arrays) array.expect(text({count, n}) + ", a row per muscle", {count, n});
    Result torque({n});
    Input input;
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t m = 0; m < count; ++m) {
        input.excitation[m] = arrays[0].data[m * n + k];
        input.length[m] = arrays[1].data[m * n + k];
        input.velocity[m] = arrays[2].data[m * n + k];
        input.moment_arm[m] = arrays[3].data[m * n + k];
      }
      torque.data[k] = p::step(own_->coefficients, own_->state, input);
    }
    return torque.array();
  }

  nb::object forces() const {
    return per_muscle([this](std::size_t m) { return own_->state.muscle[m].force; });
  }
  nb::object delays() const {
    return per_muscle([this](std::size_t m) {
      return own_->delay[m] + p::lag_delay(own_->coefficients.muscle[m].activation, period_);
    });
  }
  void reset() { own_->state = {}; }

 private:
  using Input = p::HillTorqueInput<double, most_muscles>;
  struct Own {
    p::HillTorqueCoefficients<double, most_muscles> coefficients;
    double delay[most_muscles] = {};  // [s]
    p::HillTorqueState<double, most_muscles, delay_capacity> state;
  };
  void read(const char* name, nb::handle value, double (&out)[most_muscles]) const {
    const std::size_t count = own_->coefficients.count;
    const Array array = read_array(name, value);
    array.expect(text({count}) + ", a number per muscle", {count});
    for (std::size_t m = 0; m < count; ++m) out[m] = array.data[m];
  }
  template <class F> nb::object per_muscle(F f) const {
    Result result({own_->coefficients.count});
    for (std::size_t m = 0; m < own_->coefficients.count; ++m) result.data[m] = f(m);
    return result.array();
  }

  std::unique_ptr<Own> own_;
  double period_ = 0;
};

class ElasticMuscle {
 public:
  ElasticMuscle(nb::handle parameters, double tendon_strain, double period) {
    const Array values = read_array("parameters", parameters);
    values.expect("(" + std::to_string(p::muscle_parameter_count) + ",)", {p::muscle_parameter_count});
    coefficients_ = p::coefficients(p::ElasticMuscleParams<double>{
        muscle_params(values.data, 1.0).muscle, positive("tendon_strain", tendon_strain), positive("period", period)});
    rest(0.0, coefficients_.muscle.slack + coefficients_.muscle.optimal_length);
  }
  double rest(double activation, double length) {
    state_ = p::balanced(coefficients_, activation, length);
    return coefficients_.muscle.force * p::tendon_pull(coefficients_, length - state_.along).value;
  }
  double step(double activation, double length) { return p::step(coefficients_, state_, activation, length); }
  nb::object run(nb::handle activation, nb::handle length) {
    const Array a = read_array("activation", activation), l = read_array("length", length);
    if (a.shape.size() != 1) a.fail("(n,)");
    l.expect(same_length("activation", a.shape[0]), a.shape);
    std::vector<Result> out;
    for (int i = 0; i < 2; ++i) out.push_back(Result({a.shape[0]}));
    for (std::size_t k = 0; k < a.shape[0]; ++k) {
      out[0].data[k] = step(a.data[k], l.data[k]);
      out[1].data[k] = state_.length;
    }
    return tuple_of(out);
  }
  double fibre_length() const { return state_.length; }

 private:
  p::ElasticMuscleCoefficients<double> coefficients_;
  p::ElasticMuscleState<double> state_;
};

nb::object activation_dynamics(nb::handle excitation, double period, double activation_time, double deactivation_time,
                               double start) {
  const Array u = read_array("excitation", excitation);
  if (u.shape.size() != 1) u.fail("(n,)");
  const p::ActivationDynamicsParams<double> c{positive("activation_time", activation_time),
                                              positive("deactivation_time", deactivation_time),
                                              positive("period", period)};
  Result a(u.shape);
  double state = p::clamp(start, 0.0, 1.0);
  for (std::size_t k = 0; k < u.shape[0]; ++k) a.data[k] = p::step(c, state, u.data[k]);
  return a.array();
}

}  // namespace

void add_hill(nb::module_& m) {
  m.attr("MUSCLE_PARAMETER_NAMES") = names_of<p::EmgMuscleParams<double>>();

  m.def("hill_torque", hill_torque, nb::arg("parameters").none(), nb::arg("excitation").none(),
        nb::arg("length").none(), nb::arg("velocity").none(), nb::arg("moment_arm").none(), nb::kw_only(),
        nb::arg("period"), nb::arg("starts") = nb::none(), nb::sig(torque_sig), torque_doc);
  m.def("hill_jacobian", hill_jacobian, nb::arg("parameters").none(), nb::arg("excitation").none(),
        nb::arg("length").none(), nb::arg("velocity").none(), nb::arg("moment_arm").none(), nb::arg("column").none(),
        nb::arg("gain").none(), nb::kw_only(), nb::arg("period"), nb::arg("starts") = nb::none(), nb::sig(jacobian_sig),
        jacobian_doc);
  m.def("hill_normal", hill_normal, nb::arg("parameters").none(), nb::arg("excitation").none(),
        nb::arg("length").none(), nb::arg("velocity").none(), nb::arg("moment_arm").none(), nb::arg("column").none(),
        nb::arg("gain").none(), nb::arg("measured").none(), nb::kw_only(), nb::arg("period"),
        nb::arg("starts") = nb::none(), nb::arg("weight") = nb::none(), nb::sig(normal_sig), normal_doc);
  m.def("hill_states", hill_states, nb::arg("parameters").none(), nb::arg("excitation").none(),
        nb::arg("length").none(), nb::arg("velocity").none(), nb::kw_only(), nb::arg("period"),
        nb::arg("starts") = nb::none(), nb::sig(states_sig), states_doc);
  m.def("activation_dynamics", activation_dynamics, nb::arg("excitation").none(), nb::kw_only(), nb::arg("period"),
        nb::arg("activation_time") = 0.01, nb::arg("deactivation_time") = 0.04, nb::arg("start") = 0.0,
        nb::sig(dynamics_sig), dynamics_doc);

  nb::class_<HillTorque>(m, "HillTorque", estimator_doc)
      .def(nb::init<nb::handle, double>(), nb::arg("parameters").none(), nb::kw_only(), nb::arg("period"),
           nb::sig("def __init__(self, parameters: ArrayLike, *, period: float) -> None"))
      .def("step", &HillTorque::step, nb::arg("excitation").none(), nb::arg("length").none(),
           nb::arg("velocity").none(), nb::arg("moment_arm").none(),
           nb::sig("def step(self, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, moment_arm: "
                   "ArrayLike) -> float"),
           estimator_step_doc)
      .def("run", &HillTorque::run, nb::arg("excitation").none(), nb::arg("length").none(), nb::arg("velocity").none(),
           nb::arg("moment_arm").none(),
           nb::sig("def run(self, excitation: ArrayLike, length: ArrayLike, velocity: ArrayLike, moment_arm: "
                   "ArrayLike) -> NDArray[float64]"),
           "Samples one after another, each argument (m, n), going on from the state: torque, (n,) [N m].")
      .def_prop_ro("forces", &HillTorque::forces, nb::sig("def forces(self) -> NDArray[float64]"),
                   "In each tendon at the last sample, (m,) [N].")
      .def_prop_ro("delays", &HillTorque::delays, nb::sig("def delays(self) -> NDArray[float64]"),
                   "How late slow envelopes arrive in each muscle's activation, delay and lags together, (m,) [s].")
      .def("reset", &HillTorque::reset, "Forget every sample.");

  nb::class_<ElasticMuscle>(m, "ElasticMuscle", elastic_doc)
      .def(nb::init<nb::handle, double, double>(), nb::arg("parameters").none(), nb::kw_only(),
           nb::arg("tendon_strain"), nb::arg("period"),
           nb::sig("def __init__(self, parameters: ArrayLike, *, tendon_strain: float, period: float) -> None"))
      .def("rest", &ElasticMuscle::rest, nb::arg("activation"), nb::arg("length"),
           "Fibre and tendon at rest at an activation [1] and a musculotendon length [m]: force [N].")
      .def("step", &ElasticMuscle::step, nb::arg("activation"), nb::arg("length"),
           "Force in the tendon one period on [N], at an activation [1] and a musculotendon length [m].")
      .def("run", &ElasticMuscle::run, nb::arg("activation").none(), nb::arg("length").none(),
           nb::sig("def run(self, activation: ArrayLike, length: ArrayLike) -> tuple[NDArray[float64], "
                   "NDArray[float64]]"),
           "Samples one after another, each argument (n,): force [N] and fibre length [m], each (n,).")
      .def_prop_ro("fibre_length", &ElasticMuscle::fibre_length, "At the last sample [m].");
}

}  // namespace bindings
