// The virtual elbow robot with a reaching wearer, in real time: as in the lab (bindings/worn_arm.hpp), a period a cycle.
//
// The plant stands for a body that time does not wait for: where cycles were missed, it has moved on under the last
// command, and the drive's own watchdog has taken the power off after ten periods.
#include "virtual_rigs.hpp"
#include "wearer.hpp"

#include <pellucid/drive_reading.hpp>
#include <pellucid/watchdog.hpp>
#include <pellucid/worn_geared_plant.hpp>

#include <algorithm>

namespace engine {
namespace {

namespace p = pellucid;

constexpr double rectified_mean = 1.2533141373155001;  // sqrt(pi / 2): rectified noise has a mean of 1
constexpr double emg_smoothing_rad_s = 25.0;           // 4 Hz

class VirtualElbow : public Device {
 public:
  explicit VirtualElbow(const Settings& settings) : settings_(settings), draws_(settings.seed) {}

  std::string open() override {
    const auto expect = [&](const char* name, std::size_t count) {
      const std::size_t found = settings_.of(name).size();
      return found == count ? std::string()
                            : std::string("virtual-elbow: found ") + std::to_string(found) + " numbers of \"" + name +
                                  "\", expected " + std::to_string(count);
    };
    for (const std::string& wrong :
         {expect("person", p::field_count<p::ReachingParams<double>>), expect("robot", p::field_count<p::GearedJointParams<double>>),
          expect("strap", p::field_count<p::StrapParams<double>>), expect("drive", 5), expect("emg_gains", 2),
          expect("noise", 5), expect("reading", p::field_count<p::DriveReadingParams<double>>)})
      if (!wrong.empty()) return wrong;
    const auto person = p::from_numbers<p::ReachingParams<double>>(settings_.of("person").data());
    const double start = settings_.one("position0", 0.5);
    wearer_.configure(person, start);
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
    period_ = person.period;
    smoothing_ = 1 - std::exp(-period_ * emg_smoothing_rad_s);
    sensor_delay_ = std::min<std::uint64_t>(static_cast<std::uint64_t>(settings_.one("sensor_delay", 0)), 63);
    reading_ = p::coefficients(p::from_numbers<p::DriveReadingParams<double>>(settings_.of("reading").data()), period_);
    std::copy_n(settings_.of("noise").data(), 5, noise_);
    std::copy_n(settings_.of("emg_gains").data(), 2, emg_gain_);
    plant_ = p::coefficients(plant);
    free_limb_ = plant_.limb;
    held_limb_ = plant_.limb;
    held_limb_.inverse_inertia = 1 / held_inertia;
    state_ = p::balanced(plant_, start);
    return "";
  }

  void read(std::uint64_t cycle, std::int64_t now_us, Reading& reading) noexcept override {
    const std::uint64_t first = ticks_ == 0 ? cycle : last_;
    const std::uint64_t due = cycle > first ? cycle - first : 0;
    const std::uint64_t moved = std::min(due, max_catch_up);
    const std::int64_t micros = settings_.period_ns / 1000;
    const double now = 1e-6 * static_cast<double>(now_us);
    for (std::uint64_t i = moved; i > 0; --i) advance(now - period_ * static_cast<double>(i - 1));
    last_ = cycle;
    ++ticks_;
    // What it did not catch up with is lost: the samples are then as old as they say, for one cycle.
    const std::int64_t time = static_cast<std::int64_t>(cycle) * micros - static_cast<std::int64_t>(due - moved) * micros;
    const auto sequence = static_cast<std::uint32_t>(ticks_);
    const bool worn = plant_.worn;
    const double torque = p::interaction(plant_, state_).robot;
    sensor_[ticks_ % 64] = torque;
    const double late = sensor_[(ticks_ - std::min<std::uint64_t>(sensor_delay_, ticks_)) % 64];
    const double encoder = p::step(plant_.robot.encoder, state_.motor_position, noise_[0] * draws_.normal());
    reading.samples.position = {encoder, time, sequence, true};
    reading.samples.torque = {drive_torque_, time, sequence, true};
    reading.samples.interaction = {late + noise_[1] + noise_[2] * draws_.normal(), time, sequence, worn && noise_[4] > 0};
    reading.samples.muscle = {emg_gain_[0] * level_[0] - emg_gain_[1] * level_[1], time, sequence, true};
    reading.drive = {p::step(reading_, reading_state_, drive_torque_, noise_[3] * draws_.normal()), time, sequence, true};
    reading.joint = {state_.link_position, time, sequence, true};
    reading.limb_position = state_.limb_position;
    reading.limb_velocity = state_.limb_velocity;
    reading.muscle_torque = muscles_.torque;
    reading.flexor = muscles_.flexor;
    reading.extensor = muscles_.extensor;
    reading.drive_torque = drive_torque_;
    reading.target = wearer_.target(now);
    reading.is_new = true;
  }

  void write(const Asked& asked) noexcept override { asked_ = asked; }
  void close() noexcept override { asked_ = {}; }
  void wear(bool worn) noexcept override {
    if (worn == plant_.worn) return;
    const double velocity = state_.limb_velocity, position = state_.limb_position;
    plant_.worn = worn;
    state_ = p::balanced(plant_, position);
    state_.limb_velocity = velocity;
    drive_torque_ = 0;
  }
  void give(const Task& task, double start) noexcept override { wearer_.give(task, start); }

 private:
  static constexpr std::uint64_t max_catch_up = 100;  // periods

  /// One period under the last command, of which the drive's watchdog thinks its own.
  void advance(double now) noexcept {
    const double current = p::clamp(asked_.effort / gain_, -limit_, limit_);
    const bool power = p::step(watchdog_, asked_.beat, asked_.enable, watchdog_patience);
    off_ = power ? 0 : off_ + 1;
    drive_torque_ = off_ >= power_off_periods ? 0.0 : gain_ * current;
    muscles_ = wearer_.step(now, state_.limb_position, state_.limb_velocity, draws_);
    const auto& who = wearer_.person().params;
    const double excitation[2] = {muscles_.flexor, muscles_.extensor}, most[2] = {who.flexion_max, who.extension_max};
    for (int i = 0; i < 2; ++i) {
      const double rectified = std::fabs(excitation[i] * draws_.normal()) * rectified_mean;
      level_[i] += smoothing_ * ((rectified - who.cocontraction) * most[i] - level_[i]);
    }
    const bool held = wearer_.is_held();
    plant_.limb = held ? held_limb_ : free_limb_;
    if (held) state_.limb_velocity = 0;
    p::step(plant_, state_, off_ >= power_off_periods ? 0.0 : current, muscles_.torque);
  }

  Settings settings_;
  Draws draws_;
  Wearer wearer_;
  p::WornGearedPlantCoefficients<double> plant_{};
  p::LimbCoefficients<double> free_limb_{}, held_limb_{};
  p::WornGearedPlantState<double> state_{};
  p::DriveReadingCoefficients<double> reading_{};
  p::DriveReadingState<double> reading_state_{};
  p::Watchdog watchdog_{};
  p::ReachingOutput<double> muscles_{};
  Asked asked_{};
  double gain_ = 1, limit_ = 0, period_ = 1e-3, smoothing_ = 0, drive_torque_ = 0, level_[2] = {0, 0}, sensor_[64] = {};
  double noise_[5] = {};  // of the encoder, offset and noise of the force sensor, noise of the drive; 1: there is a force sensor
  double emg_gain_[2] = {1, 1};
  std::uint64_t last_ = 0, ticks_ = 0, sensor_delay_ = 0;
  std::uint32_t off_ = power_off_periods;
};

}  // namespace

std::unique_ptr<Device> make_virtual_elbow(const Settings& settings) { return std::make_unique<VirtualElbow>(settings); }

}  // namespace engine
