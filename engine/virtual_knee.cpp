// The virtual knee orthosis on a wearer who reaches with the shank, in real time.
//
// The law asks the series spring for its torque, and the same spring measures it; the second encoder is the motor's.
#include "virtual_rig.hpp"
#include "virtual_rigs.hpp"

#include <pellucid/coupled_plant.hpp>

namespace engine {
namespace {

namespace p = pellucid;

class VirtualKnee : public VirtualRig {
 public:
  using VirtualRig::VirtualRig;

  std::string open() override {
    const std::string wrong =
        wrong_count("virtual-knee", {{"person", p::field_count<p::ReachingParams<double>>},
                                     {"plant", p::field_count<p::CoupledPlantParams<double>>},
                                     {"loop", 3},
                                     {"noise", 1},
                                     {"reading", p::field_count<p::DriveReadingParams<double>>}});
    if (!wrong.empty()) return wrong;
    auto plant = p::from_numbers<p::CoupledPlantParams<double>>(settings_.of("plant").data());
    const std::vector<double>& loop = settings_.of("loop");
    const double start = settings_.one("position0", 0.8);
    const auto person = configure_wearer(start);
    plant.loop.period = person.period;
    plant.loop.delay = static_cast<std::uint32_t>(std::clamp(loop[0], 0.0, double(p::max_torque_span - 1)));
    plant.loop.torque_span = static_cast<std::uint32_t>(std::clamp(loop[1], 1.0, double(p::max_torque_span - 1)));
    plant.substeps = static_cast<std::uint32_t>(std::clamp(loop[2], 1.0, 1000.0));
    noise_ = settings_.of("noise")[0];
    on_ = p::coefficients(plant);
    free_limb_ = on_.limb;
    held_limb_ = on_.limb;
    held_limb_.inverse_inertia = 1 / held_inertia;
    state_ = p::balanced(on_, start, 0.0);
    wearer_.configure(person, state_.limb_position);
    plant.loop.kp = plant.loop.ki = plant.loop.kd = 0;
    off_plant_ = p::coefficients(plant);
    return "";
  }

 private:
  void advance(double now) noexcept override {
    const bool dead = !step_power();
    step_muscles(now, state_.limb_position, state_.limb_velocity);
    const bool held = wearer_.is_held();
    on_.limb = off_plant_.limb = held ? held_limb_ : free_limb_;
    if (held) state_.limb_velocity = 0;
    p::step(dead ? off_plant_ : on_, state_, {dead ? 0.0 : asked_.effort, muscles_.torque, 0.0});
    if (dead) state_.loop = {};
  }

  void sense(std::int64_t time, std::uint32_t sequence, Reading& reading) noexcept override {
    const p::CoupledPlantOutput<double> seen = p::read(on_, state_);
    reading.samples.position = {seen.position, time, sequence, true};
    reading.samples.torque = {seen.torque, time, sequence, true};
    reading.samples.interaction = {seen.strap_torque, time, sequence, false};  // no force sensor: it is only recorded
    reading.samples.muscle = {level_[0] - level_[1], time, sequence, true};
    reading.drive = {read_drive(seen.torque, noise_), time, sequence, true};
    reading.joint = {seen.motor_position, time, sequence, true};
    reading.limb_position = state_.limb_position;
    reading.limb_velocity = state_.limb_velocity;
    reading.drive_torque = seen.spring_torque;
  }

  p::CoupledPlantCoefficients<double> on_{}, off_plant_{};
  p::LimbCoefficients<double> free_limb_{}, held_limb_{};
  p::CoupledPlantState<double> state_{};
  double noise_ = 0;
};

}  // namespace

std::unique_ptr<Device> make_virtual_knee(const Settings& settings) { return std::make_unique<VirtualKnee>(settings); }

}  // namespace engine
