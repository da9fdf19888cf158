// The virtual elbow robot with a reaching wearer, in real time: as in the lab (bindings/worn_arm.hpp), a period a cycle.
#include "virtual_rig.hpp"
#include "virtual_rigs.hpp"

#include <pellucid/worn_geared_plant.hpp>

namespace engine {
namespace {

namespace p = pellucid;

class VirtualElbow : public VirtualRig {
 public:
  using VirtualRig::VirtualRig;

  std::string open() override {
    const std::string wrong =
        wrong_count("virtual-elbow", {{"person", p::field_count<p::ReachingParams<double>>},
                                      {"robot", p::field_count<p::GearedJointParams<double>>},
                                      {"strap", p::field_count<p::StrapParams<double>>},
                                      {"drive", 5},
                                      {"emg_gains", 2},
                                      {"noise", 5},
                                      {"reading", p::field_count<p::DriveReadingParams<double>>}});
    if (!wrong.empty()) return wrong;
    const double start = settings_.one("position0", 0.5);
    const auto person = configure_wearer(start);
    p::WornGearedPlantParams<double> plant;
    plant.limb = person.limb;
    plant.robot.joint = p::from_numbers<p::GearedJointParams<double>>(settings_.of("robot").data());
    plant.strap = p::from_numbers<p::StrapParams<double>>(settings_.of("strap").data());
    const std::vector<double>& drive = settings_.of("drive");
    plant.robot.drive = {drive[0], 0, drive[2], drive[3], 0};
    plant.robot.encoder = {drive[4]};
    plant.robot.loop.period = person.period;
    plant.robot.substeps = static_cast<std::uint32_t>(settings_.one("substeps", 10));
    gain_ = drive[0];
    limit_ = drive[1];
    sensor_delay_ = std::min<std::uint64_t>(static_cast<std::uint64_t>(settings_.one("sensor_delay", 0)), 63);
    std::copy_n(settings_.of("noise").data(), 5, noise_);
    std::copy_n(settings_.of("emg_gains").data(), 2, emg_gain_);
    plant_ = p::coefficients(plant);
    free_limb_ = plant_.limb;
    held_limb_ = plant_.limb;
    held_limb_.inverse_inertia = 1 / held_inertia;
    state_ = p::balanced(plant_, start);
    return "";
  }

  void wear(bool worn) noexcept override {
    if (worn == plant_.worn) return;
    const double velocity = state_.limb_velocity, position = state_.limb_position;
    plant_.worn = worn;
    state_ = p::balanced(plant_, position);
    state_.limb_velocity = velocity;
    drive_torque_ = 0;
  }

 private:
  void advance(double now) noexcept override {
    const double current = p::clamp(asked_.effort / gain_, -limit_, limit_);
    const bool power = step_power();
    drive_torque_ = power ? gain_ * current : 0.0;
    step_muscles(now, state_.limb_position, state_.limb_velocity);
    const bool held = wearer_.is_held();
    plant_.limb = held ? held_limb_ : free_limb_;
    if (held) state_.limb_velocity = 0;
    p::step(plant_, state_, power ? current : 0.0, muscles_.torque);
  }

  void sense(std::int64_t time, std::uint32_t sequence, Reading& reading) noexcept override {
    const double torque = p::interaction(plant_, state_).robot;
    sensor_[ticks_ % 64] = torque;
    const double late = sensor_[(ticks_ - std::min<std::uint64_t>(sensor_delay_, ticks_)) % 64];
    const double encoder = p::step(plant_.robot.encoder, state_.motor_position, noise_[0] * draws_.normal());
    reading.samples.position = {encoder, time, sequence, true};
    reading.samples.torque = {drive_torque_, time, sequence, true};
    reading.samples.interaction = {late + noise_[1] + noise_[2] * draws_.normal(), time, sequence, plant_.worn && noise_[4] > 0};
    reading.samples.muscle = {emg_gain_[0] * level_[0] - emg_gain_[1] * level_[1], time, sequence, true};
    reading.drive = {read_drive(drive_torque_, noise_[3]), time, sequence, true};
    reading.joint = {state_.link_position, time, sequence, true};
    reading.limb_position = state_.limb_position;
    reading.limb_velocity = state_.limb_velocity;
    reading.drive_torque = drive_torque_;
  }

  p::WornGearedPlantCoefficients<double> plant_{};
  p::LimbCoefficients<double> free_limb_{}, held_limb_{};
  p::WornGearedPlantState<double> state_{};
  double gain_ = 1, limit_ = 0, drive_torque_ = 0, sensor_[64] = {};
  double noise_[5] = {};  // of the encoder, offset and noise of the force sensor, noise of the drive; 1: there is a force sensor
  double emg_gain_[2] = {1, 1};
  std::uint64_t sensor_delay_ = 0;
};

}  // namespace

std::unique_ptr<Device> make_virtual_elbow(const Settings& settings) { return std::make_unique<VirtualElbow>(settings); }

}  // namespace engine
