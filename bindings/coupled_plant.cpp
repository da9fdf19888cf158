// A series-elastic orthosis and its wearer, one control period at a time: for controllers that are written in Python.
#include "coupled_plant.hpp"

#include "fields.hpp"

#include <cmath>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* plant_doc =
    R"(A motor, a series spring, an orthosis, a strap and a limb, under the actuator's own torque loop.

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
    carries what is left of the orthosis's weight.)";

constexpr const char* step_doc = R"(One control period.

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
    the limb, the same but where it sits askew [N m].)";

constexpr const char* step_sig =
    "def step(self, desired_torque: float, muscle_torque: float, slip_jump: float = 0.0, "
    "base_torque: float = 0.0) -> tuple[float, ...]";

class CoupledPlant {
 public:
  CoupledPlant(nb::handle parameters, double period, nb::handle substeps, nb::handle delay, nb::handle torque_span,
               double position0, double torque0) {
    const auto params = read_coupled_plant(parameters, period, substeps, delay, torque_span);
    coefficients_ = p::coefficients(params);
    state_ = p::balanced(coefficients_, position0, torque0);
  }

  nb::object step(double desired_torque, double muscle_torque, double slip_jump, double base_torque) {
    return tuple(p::step(coefficients_, state_, {desired_torque, muscle_torque, slip_jump, base_torque}));
  }
  nb::object read() const { return tuple(p::read(coefficients_, state_)); }
  double slip() const { return state_.strap.slip; }

 private:
  nb::object tuple(const p::CoupledPlantOutput<double>& out) const {
    const double values[] = {out.position,
                             out.motor_position,
                             out.torque,
                             state_.orthosis_position,
                             state_.orthosis_velocity,
                             state_.limb_position,
                             state_.limb_velocity,
                             out.strap_torque,
                             out.spring_torque,
                             out.motor_torque,
                             out.limb_torque};
    constexpr std::size_t n = sizeof values / sizeof values[0];
    nb::object result = nb::steal(PyTuple_New(n));
    for (std::size_t i = 0; i < n; ++i)
      PyTuple_SetItem(result.ptr(), static_cast<Py_ssize_t>(i), PyFloat_FromDouble(values[i]));
    return result;
  }

  p::CoupledPlantCoefficients<double> coefficients_;
  p::CoupledPlantState<double> state_;
};

}  // namespace

p::CoupledPlantParams<double> read_coupled_plant(nb::handle parameters, double period, nb::handle substeps,
                                                 nb::handle delay, nb::handle torque_span) {
  if (!(period > 0 && std::isfinite(period))) throw nb::value_error("period: expected a number of seconds above 0");
  auto params = read_params<p::CoupledPlantParams<double>, double>("parameters", parameters);
  const auto count = [](const char* name, nb::handle value, long long least, long long most) {
    return static_cast<std::uint32_t>(read_integer(name, value, least, most));
  };
  params.loop.period = period;
  params.loop.delay = count("delay", delay, 0, p::max_torque_span - 1);
  params.loop.torque_span = count("torque_span", torque_span, 1, p::max_torque_span - 1);
  params.substeps = count("substeps", substeps, 1, 1000000);
  return params;
}

void add_coupled_plant(nb::module_& m) {
  m.attr("COUPLED_PARAMETER_NAMES") = names_of<p::CoupledPlantParams<double>>();
  nb::class_<CoupledPlant>(m, "CoupledPlant", plant_doc)
      .def(nb::init<nb::handle, double, nb::handle, nb::handle, nb::handle, double, double>(), nb::arg("parameters"),
           nb::kw_only(), nb::arg("period"), nb::arg("substeps") = 10, nb::arg("delay") = 0, nb::arg("torque_span") = 1,
           nb::arg("position0") = 0.0, nb::arg("torque0") = 0.0,
           nb::sig("def __init__(self, parameters: ArrayLike, *, period: float, substeps: int = 10, delay: int = 0, "
                   "torque_span: int = 1, position0: float = 0.0, torque0: float = 0.0) -> None"))
      .def("step", &CoupledPlant::step, nb::arg("desired_torque"), nb::arg("muscle_torque"), nb::arg("slip_jump") = 0.0,
           nb::arg("base_torque") = 0.0, nb::sig(step_sig), step_doc)
      .def("read", &CoupledPlant::read, nb::sig("def read(self) -> tuple[float, ...]"),
           "What holds now, as `step` returns it, with a motor_torque of 0: no period ends here.")
      .def_prop_ro("slip", &CoupledPlant::slip, "Of the strap, so far [rad].");
}

}  // namespace bindings
