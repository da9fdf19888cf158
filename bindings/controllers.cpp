// What stands beside the core's laws, for Python: EMG to torque, the strap estimated while it is worn.
#include "controllers.hpp"

#include "fields.hpp"

#include <pellucid/emg_torque.hpp>
#include <pellucid/strap_estimator.hpp>

#include <cmath>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* strap_estimator_doc =
    R"(The strap's stiffness and damping while it is worn, by recursive least squares with forgetting.

Parameters
----------
parameters : (21,)
    In the order of STRAP_ESTIMATOR_PARAMETER_NAMES, SI; strap_stiffness and strap_damping are where it starts.)";
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

class StrapEstimator {
 public:
  explicit StrapEstimator(nb::handle parameters)
      : coefficients_(p::coefficients(read_params<p::StrapEstimatorParams<double>, double>("parameters", parameters))) {
    if (!coefficients_.valid)
      throw nb::value_error("StrapEstimator: found parameters outside their bounds, expected finite ones within them");
  }
  nb::tuple step(double position, double torque, double emg_torque, bool emg_valid) {
    p::Samples<double> samples;
    samples.position = {position, 0, 0, true};
    samples.torque = {torque, 0, 0, true};
    samples.muscle = {emg_torque, 0, 0, emg_valid};
    p::step(coefficients_, state_, samples);
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

}  // namespace

void add_controllers(nb::module_& m) {
  m.attr("STRAP_ESTIMATOR_PARAMETER_NAMES") = names_of<p::StrapEstimatorParams<double>>();
  nb::class_<StrapEstimator>(m, "StrapEstimator", strap_estimator_doc)
      .def(nb::init<nb::handle>(), nb::arg("parameters").none(),
           nb::sig("def __init__(self, parameters: ArrayLike) -> None"))
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
