// The core's controllers for Python: EMG to torque, the residual compensator, the strap estimated while it is worn.
#include "controllers.hpp"

#include "arrays.hpp"

#include <pellucid/emg_torque.hpp>
#include <pellucid/residual_compensator.hpp>
#include <pellucid/strap_estimator.hpp>

#include <algorithm>
#include <cmath>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* residual_compensator_doc =
    R"(Carries the orthosis for its wearer in zero-impedance mode, from encoder, spring and EMG torque.

What goes out has passed the safety gate: finite and within the limits, whatever comes in. A fault latches and the
command ramps to 0, which is plain zero-impedance mode. EMG that is not valid or not finite fades out instead.

Parameters
----------
parameters : (53,)
    In the order of RESIDUAL_PARAMETER_NAMES; see include/pellucid/residual_compensator.hpp for their units.)";
constexpr const char* residual_compensator_float_doc = "ResidualCompensator in float32, as on a microcontroller.";
constexpr const char* residual_step_doc = R"(One control period: the torque wanted from the spring [N m].

Parameters
----------
time : float
    When position and torque were measured [s].
position, torque : float
    Output encoder [rad] and measured spring torque [N m].
emg_torque : float
    Torque of the wearer's muscles, estimated from EMG [N m].
emg_valid : bool
    False: the electrodes say nothing.)";
constexpr const char* residual_run_doc = R"(step, one period after another.

Parameters
----------
time, position, torque, emg_torque : (n,)
    As `step` takes them; an EMG torque of NaN is not valid.

Returns
-------
(n,)
    The commands [N m].)";
constexpr const char* residual_estimate_doc =
    R"(Observed: orthosis angle [rad] and velocity [rad/s], mismatch [rad] and its rate [rad/s], torque that EMG misses
[N m], strap torque [N m], limb acceleration [rad/s^2], trust in EMG [1].)";
constexpr const char* strap_estimator_doc =
    R"(The strap's stiffness and damping while it is worn, by recursive least squares with forgetting.

Parameters
----------
bodies : (11,)
    The first eleven of RESIDUAL_PARAMETER_NAMES; strap_stiffness and strap_damping are where the estimate starts.
bandwidth, slowest : float
    The band in which is fitted [rad/s].
forgetting : float
    Time over which the past is forgotten [s].
prior_mismatch : float
    RMS mismatch that weighs as much as the start does [rad].
excitation : float
    RMS mismatch below which nothing is learnt [rad].
stiffness_min, stiffness_max, damping_min, damping_max : float
    Bounds [N m/rad, N m s/rad].
period : float
    [s].)";
constexpr const char* emg_torque_doc = R"(Raw EMG to a joint torque, causally.

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
    Of |torque| [N m], > 0.)";
constexpr const char* emg_listen_doc = R"(Raw samples of every muscle.

Parameters
----------
samples : (n, muscles)
    [V].)";

template <class S> class ResidualCompensator {
 public:
  explicit ResidualCompensator(nb::handle parameters) {
    const Array array = read_array("parameters", parameters);
    array.expect("(" + std::to_string(p::residual_parameter_count) + ",)", {p::residual_parameter_count});
    S values[p::residual_parameter_count];
    std::transform(array.data, array.data + p::residual_parameter_count, values,
                   [](double x) { return static_cast<S>(x); });
    coefficients_ = p::coefficients(p::residual_params(values));
    reset();
  }
  double step(double time, double position, double torque, double emg_torque, bool emg_valid) {
    const bool sound = std::fabs(time) < 9e12;  // microseconds that 64 bits hold; false for NaN
    const S angle = sound ? static_cast<S>(position) : std::numeric_limits<S>::quiet_NaN();
    const std::int64_t microseconds = sound ? std::llround(time * 1e6) : 0;
    return static_cast<double>(p::step(
        coefficients_, state_,
        p::ResidualInput<S>{angle, static_cast<S>(torque), static_cast<S>(emg_torque), emg_valid, microseconds}));
  }
  nb::object run(nb::handle time, nb::handle position, nb::handle torque, nb::handle emg_torque) {
    const Array t = read_array("time", time), q = read_array("position", position), u = read_array("torque", torque),
                e = read_array("emg_torque", emg_torque);
    if (t.shape.size() != 1) t.fail("(n,)");
    const std::size_t n = t.shape[0];
    for (const Array* array : {&q, &u, &e}) array->expect(same_length("time", n), {n});
    Result command({n});
    for (std::size_t i = 0; i < n; ++i)
      command.data[i] = step(t.data[i], q.data[i], u.data[i], e.data[i], !std::isnan(e.data[i]));
    return command.array();
  }
  nb::tuple estimate() const {
    const auto number = [](S x) { return static_cast<double>(x); };
    return nb::make_tuple(number(state_.position), number(state_.velocity), number(state_.mismatch),
                          number(state_.mismatch_rate), number(state_.disturbance), number(state_.strap_torque),
                          number(state_.limb_acceleration), number(state_.trust));
  }
  void set_strap(double stiffness, double damping) {
    p::ResidualParams<S> params = coefficients_.params;
    params.bodies.strap_stiffness = static_cast<S>(stiffness);
    params.bodies.strap_damping = static_cast<S>(damping);
    coefficients_ = p::coefficients(params);
  }
  const char* fault() const { return p::safety_fault_names[static_cast<std::size_t>(state_.gate.fault)]; }
  void reset() {
    p::reset(state_);
    if (!coefficients_.gate.valid) state_.gate.fault = p::SafetyFault::configuration;
  }

 private:
  p::ResidualCoefficients<S> coefficients_;
  p::ResidualState<S> state_;
};

class StrapEstimator {
 public:
  StrapEstimator(nb::handle bodies, double bandwidth, double slowest, double forgetting, double prior_mismatch,
                 double excitation, double stiffness_min, double stiffness_max, double damping_min, double damping_max,
                 double period) {
    const Array array = read_array("bodies", bodies);
    array.expect("(11,)", {11});
    const double* v = array.data;
    coefficients_ = p::coefficients(
        p::StrapEstimatorParams<double>{{v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9], v[10]},
                                        bandwidth,
                                        slowest,
                                        forgetting,
                                        prior_mismatch,
                                        excitation,
                                        stiffness_min,
                                        stiffness_max,
                                        damping_min,
                                        damping_max,
                                        period});
    if (!coefficients_.valid) throw nb::value_error("StrapEstimator: its parameters make no sense together");
  }
  nb::tuple step(double position, double torque, double emg_torque, bool emg_valid) {
    p::step(coefficients_, state_, p::ResidualInput<double>{position, torque, emg_torque, emg_valid, 0});
    return nb::make_tuple(state_.stiffness, state_.damping, state_.learns);
  }

 private:
  p::StrapEstimatorCoefficients<double> coefficients_;
  p::StrapEstimatorState<double> state_;
};

template <std::size_t most> p::BiquadCoefficients<double, most> read_sections(const char* name, nb::handle sos) {
  const Array array = read_array(name, sos);
  if (array.shape.size() != 2 || array.shape[1] != 6 || array.shape[0] > most)
    array.fail("(k, 6) with k at most " + std::to_string(most));
  p::BiquadCoefficients<double, most> c;
  c.count = array.shape[0];
  for (std::size_t i = 0; i < c.count; ++i) {
    const double* row = array.data + 6 * i;
    if (row[3] != 1.0) throw nb::value_error((std::string(name) + ": expected every a0 (column 3) to be 1").c_str());
    c.section[i] = {row[0], row[1], row[2], row[4], row[5]};
  }
  return c;
}

class EmgTorque {
 public:
  EmgTorque(nb::handle band, nb::handle envelope, nb::handle weights, nb::handle floor, nb::handle ceiling,
            std::uint32_t patience, double torque_limit) {
    p::EmgTorqueParams<double> params;
    params.band = read_sections<4>("band", band);
    params.envelope = read_sections<2>("envelope", envelope);
    const Array w = read_array("weights", weights), low = read_array("floor", floor),
                high = read_array("ceiling", ceiling);
    if (w.shape.size() != 2 || w.shape[0] < 2 || w.shape[0] > p::max_muscles + 1 || w.shape[1] < 1 ||
        w.shape[1] > p::max_angle_powers)
      w.fail("(muscles + 1, powers), at most (5, 4)");
    params.muscles = w.shape[0] - 1;
    params.powers = w.shape[1];
    for (const Array* array : {&low, &high}) array->expect("(muscles,), as weights has rows but one", {params.muscles});
    for (std::size_t i = 0; i <= params.muscles; ++i)
      for (std::size_t k = 0; k < params.powers; ++k) params.weight[i][k] = w.data[i * params.powers + k];
    for (std::size_t i = 0; i < params.muscles; ++i) {
      params.floor[i] = low.data[i];
      params.ceiling[i] = high.data[i];
    }
    params.patience = patience;
    params.torque_limit = torque_limit;
    coefficients_ = p::coefficients(params);
    if (!coefficients_.valid)
      throw nb::value_error("EmgTorque: expected floor >= 0, ceiling > floor and a torque limit > 0");
  }
  void listen(nb::handle samples) {
    const Array x = read_array("samples", samples);
    const std::size_t muscles = coefficients_.params.muscles;
    if (x.shape.size() != 2 || x.shape[1] != muscles) {
      if (x.size() == 0) return;
      x.fail("(n, " + std::to_string(muscles) + ")");
    }
    for (std::size_t i = 0; i < x.shape[0]; ++i) {
      double raw[p::max_muscles] = {};
      for (std::size_t m = 0; m < muscles; ++m) raw[m] = x.data[i * muscles + m];
      p::listen(coefficients_, state_, raw);
    }
  }
  double torque(double position) const { return p::emg_torque(coefficients_, state_, position); }
  bool valid() const { return p::is_heard(coefficients_, state_); }
  nb::tuple levels() const {
    nb::list result;
    for (std::size_t m = 0; m < coefficients_.params.muscles; ++m) result.append(state_.level[m]);
    return nb::tuple(result);
  }
  void reset() { state_ = {}; }

 private:
  p::EmgTorqueCoefficients<double> coefficients_;
  p::EmgTorqueState<double> state_;
};

template <class S> void add_residual_compensator(nb::module_& m, const char* name, const char* doc) {
  using Class = ResidualCompensator<S>;
  nb::class_<Class>(m, name, doc)
      .def(nb::init<nb::handle>(), nb::arg("parameters").none(),
           nb::sig("def __init__(self, parameters: ArrayLike) -> None"))
      .def("step", &Class::step, nb::arg("time"), nb::arg("position"), nb::arg("torque"), nb::arg("emg_torque"),
           nb::arg("emg_valid") = true, residual_step_doc)
      .def("run", &Class::run, nb::arg("time").none(), nb::arg("position").none(), nb::arg("torque").none(),
           nb::arg("emg_torque").none(),
           nb::sig("def run(self, time: ArrayLike, position: ArrayLike, torque: ArrayLike, emg_torque: ArrayLike) -> "
                   "NDArray[float64]"),
           residual_run_doc)
      .def_prop_ro("estimate", &Class::estimate,
                   nb::sig("def estimate(self, /) -> tuple[float, float, float, float, float, float, float, float]"),
                   residual_estimate_doc)
      .def("set_strap", &Class::set_strap, nb::arg("stiffness"), nb::arg("damping"),
           "Another strap [N m/rad, N m s/rad], from the next period on.")
      .def_prop_ro("fault", &Class::fault, "As of SafetyGate: 'none' while it is open.")
      .def("reset", &Class::reset, "Open the gate again and start the observer from the next sample.");
}

}  // namespace

void add_controllers(nb::module_& m) {
  nb::list names;
  for (const char* name : p::residual_parameter_names) names.append(name);
  m.attr("RESIDUAL_PARAMETER_NAMES") = nb::tuple(names);
  add_residual_compensator<double>(m, "ResidualCompensator", residual_compensator_doc);
  add_residual_compensator<float>(m, "ResidualCompensatorFloat", residual_compensator_float_doc);

  nb::class_<StrapEstimator>(m, "StrapEstimator", strap_estimator_doc)
      .def(nb::init<nb::handle, double, double, double, double, double, double, double, double, double, double>(),
           nb::kw_only(), nb::arg("bodies").none(), nb::arg("bandwidth"), nb::arg("slowest"), nb::arg("forgetting"),
           nb::arg("prior_mismatch"), nb::arg("excitation"), nb::arg("stiffness_min"), nb::arg("stiffness_max"),
           nb::arg("damping_min"), nb::arg("damping_max"), nb::arg("period"),
           nb::sig("def __init__(self, *, bodies: ArrayLike, bandwidth: float, slowest: float, forgetting: float, "
                   "prior_mismatch: float, excitation: float, stiffness_min: float, stiffness_max: float, "
                   "damping_min: float, damping_max: float, period: float) -> None"))
      .def("step", &StrapEstimator::step, nb::arg("position"), nb::arg("torque"), nb::arg("emg_torque"),
           nb::arg("emg_valid") = true,
           nb::sig("def step(self, position: float, torque: float, emg_torque: float, emg_valid: bool = True) -> "
                   "tuple[float, float, bool]"),
           "One control period: stiffness [N m/rad], damping [N m s/rad], and whether it taught anything.");

  nb::class_<EmgTorque>(m, "EmgTorque", emg_torque_doc)
      .def(nb::init<nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, std::uint32_t, double>(), nb::kw_only(),
           nb::arg("band").none(), nb::arg("envelope").none(), nb::arg("weights").none(), nb::arg("floor").none(),
           nb::arg("ceiling").none(), nb::arg("patience"), nb::arg("torque_limit"),
           nb::sig("def __init__(self, *, band: ArrayLike, envelope: ArrayLike, weights: ArrayLike, floor: ArrayLike, "
                   "ceiling: ArrayLike, patience: int, torque_limit: float) -> None"))
      .def("listen", &EmgTorque::listen, nb::arg("samples").none(),
           nb::sig("def listen(self, samples: ArrayLike) -> None"), emg_listen_doc)
      .def("torque", &EmgTorque::torque, nb::arg("position"),
           "Torque at this joint angle [rad], finite and within its limit [N m].")
      .def_prop_ro("valid", &EmgTorque::valid, "Whether what the electrodes say can be a muscle.")
      .def_prop_ro("levels", &EmgTorque::levels, nb::sig("def levels(self, /) -> tuple[float, ...]"),
                   "The envelopes [V].")
      .def("reset", &EmgTorque::reset, "Forget all samples.");
}

}  // namespace bindings
