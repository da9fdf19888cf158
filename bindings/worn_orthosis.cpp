// A series-elastic orthosis under a supervised law and with one single fault, a period at a time: its wearer is Python's.
#include "worn_orthosis.hpp"

#include "coupled_plant.hpp"
#include "drive_reading.hpp"
#include "single_fault.hpp"

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* class_doc = R"(The orthosis of `CoupledPlant` under a supervised law, healthy until a fault is told.

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
    the effort of a law "joint" in each period [N m], as `WornElbow.live` takes it; NaN stops the law.)";

constexpr const char* step_doc = R"(One control period.

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
    torque [N m], and the orthosis's velocity [rad/s].)";

class WornOrthosis {
 public:
  WornOrthosis(nb::handle parameters, double period, nb::handle substeps, nb::handle delay, nb::handle torque_span,
               double position0, const char* law, nb::handle law_parameters, nb::handle supervisor,
               nb::handle drive_reading, nb::handle command)
      : reading_(read_drive_reading(drive_reading, period)), period_(period) {
    auto params = read_coupled_plant(parameters, period, substeps, delay, torque_span);
    on_ = p::coefficients(params);
    state_ = p::balanced(on_, position0, 0.0);
    // Without power the motor has no torque; its friction stays.
    params.loop.kp = params.loop.ki = params.loop.kd = 0;
    off_ = p::coefficients(params);
    law_ = read_supervised<double>(law, law_parameters, supervisor);
    if (!command.is_none()) {
      const std::string commanded = pellucid::JointCompensation<double>::name;
      if (law != commanded)
        throw nb::value_error((std::string("command: found \"") + law + "\", expected \"" + commanded + "\"").c_str());
      command_.params = read_params<p::JointCompensationParams<double>, double>("law_parameters", law_parameters);
      command_.of_spring = true;
      command_.ask = [asked = nb::borrow(command)](double time, double position, double torque) {
        return nb::cast<double>(asked(time, position, torque));
      };
    }
    seal();
  }
  WornOrthosis(const WornOrthosis& other) = default;

  void begin(const std::string& fault, std::uint64_t seed) {
    fault_.become(fault, period_ * static_cast<double>(ticks_), seed);
    seal();
  }

  nb::object step(double muscle_torque, double emg, double reading_noise) {
    const double time = period_ * static_cast<double>(ticks_);
    const auto now = static_cast<std::int64_t>(std::llround(1e6 * time));
    fault_.at(time, period_, 0);
    const p::CoupledPlantOutput<double> seen = p::read(on_, state_);
    p::Samples<double> samples;
    samples.position = {seen.position, 0, 0, true};
    samples.torque = {seen.torque, 0, 0, true};
    samples.muscle = {emg, 0, 0, std::isfinite(emg)};
    const double measured = p::step(reading_, reading_state_, seen.torque, reading_noise);
    if (!fault_.hangs())
      step_worn_law(law_, samples, fault_.measured(measured), seen.motor_position, now, fault_, out,
                    command_.ask ? &command_ : nullptr);
    const bool power = p::step(watchdog_, out.beat, out.enable, DriveWatch::patience);
    off = power ? 0 : off + 1;
    const double asked = fault_.given(out.effort);
    const bool dead = off >= DriveWatch::off_periods;
    p::step(dead ? off_ : on_, state_, {dead ? 0.0 : asked, muscle_torque + fault_.pushes(muscle_torque), 0.0});
    if (dead) state_.loop = {};
    ++ticks_;
    const p::CoupledPlantOutput<double> then = p::read(on_, state_);
    return nb::make_tuple(state_.limb_position, state_.limb_velocity, then.limb_torque, then.spring_torque,
                          state_.orthosis_velocity);
  }

  p::SupervisorOutput<double> out{};
  std::uint32_t off = 0;

 private:
  void seal() {
    seal_law(law_);
  }
  p::CoupledPlantCoefficients<double> on_, off_;
  p::CoupledPlantState<double> state_;
  AnySupervised<double> law_;
  p::Watchdog watchdog_{};
  p::DriveReadingCoefficients<double> reading_;
  p::DriveReadingState<double> reading_state_{};
  SingleFault fault_{"none", 0, 0};
  LawCommand command_{};
  double period_;
  std::uint64_t ticks_ = 0;
};

}  // namespace

void add_worn_orthosis(nb::module_& m) {
  nb::class_<WornOrthosis>(m, "WornOrthosis", class_doc)
      .def(nb::init<nb::handle, double, nb::handle, nb::handle, nb::handle, double, const char*, nb::handle, nb::handle,
                    nb::handle, nb::handle>(),
           nb::arg("parameters"), nb::kw_only(), nb::arg("period"), nb::arg("substeps"), nb::arg("delay"),
           nb::arg("torque_span"), nb::arg("position0"), nb::arg("law"), nb::arg("law_parameters"), nb::arg("supervisor"),
           nb::arg("drive_reading").none() = nb::none(), nb::arg("command").none() = nb::none(),
           nb::sig("def __init__(self, parameters: ArrayLike, *, period: float, substeps: int, delay: int, torque_span: "
                   "int, position0: float, law: str, law_parameters: ArrayLike, supervisor: ArrayLike, drive_reading: "
                   "ArrayLike | None = None, command: Callable[[float, float, float], float] | None = None) -> None"))
      .def("step", &WornOrthosis::step, nb::arg("muscle_torque"), nb::arg("emg"), nb::arg("reading_noise") = 0.0,
           nb::sig("def step(self, muscle_torque: float, emg: float, reading_noise: float = 0.0) -> tuple[float, ...]"),
           step_doc)
      .def("begin", &WornOrthosis::begin, nb::arg("fault"), nb::arg("seed"),
           nb::sig("def begin(self, fault: str, seed: int) -> None"), "A fault of `single_faults` from the next period on.")
      .def("copy", [](const WornOrthosis& one) { return WornOrthosis(one); }, nb::sig("def copy(self) -> WornOrthosis"),
           "Another one in the same state.")
      .def_prop_ro("fault", [](const WornOrthosis& one) { return fault_name(one.out.fault); }, "As of its supervisor.")
      .def_prop_ro("mode", [](const WornOrthosis& one) { return p::mode_names[static_cast<std::size_t>(one.out.mode)]; },
                   "What its supervisor does.")
      .def_prop_ro("effort", [](const WornOrthosis& one) { return one.out.effort; }, "That the spring was asked for [N m].")
      .def_prop_ro("off", [](const WornOrthosis& one) { return one.off; }, "Periods without power, or on the way there.");
}

}  // namespace bindings
