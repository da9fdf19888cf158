// The virtual knee orthosis on a wearer who reaches with the shank, in real time.
//
// The law asks the series spring for its torque, and the same spring measures it; the second encoder is the motor's.
#include "virtual_rigs.hpp"
#include "wearer.hpp"

#include <pellucid/coupled_plant.hpp>
#include <pellucid/drive_reading.hpp>
#include <pellucid/watchdog.hpp>

#include <algorithm>

namespace engine {
namespace {

namespace p = pellucid;

constexpr double emg_smoothing_rad_s = 25.0;           // 4 Hz
constexpr double rectified_mean = 1.2533141373155001;  // sqrt(pi / 2)

class VirtualKnee : public Device {
 public:
  explicit VirtualKnee(const Settings& settings) : settings_(settings), draws_(settings.seed) {}

  std::string open() override {
    const auto expect = [&](const char* name, std::size_t count) {
      const std::size_t found = settings_.of(name).size();
      return found == count ? std::string()
                            : std::string("virtual-knee: found ") + std::to_string(found) + " numbers of \"" + name +
                                  "\", expected " + std::to_string(count);
    };
    for (const std::string& wrong :
         {expect("person", p::field_count<p::ReachingParams<double>>), expect("plant", p::field_count<p::CoupledPlantParams<double>>),
          expect("loop", 3), expect("noise", 1), expect("reading", p::field_count<p::DriveReadingParams<double>>)})
      if (!wrong.empty()) return wrong;
    const auto person = p::from_numbers<p::ReachingParams<double>>(settings_.of("person").data());
    const double start = settings_.one("position0", 0.8);
    auto plant = p::from_numbers<p::CoupledPlantParams<double>>(settings_.of("plant").data());
    const std::vector<double>& loop = settings_.of("loop");
    plant.loop.period = person.period;
    plant.loop.delay = static_cast<std::uint32_t>(std::clamp(loop[0], 0.0, double(p::max_torque_span - 1)));
    plant.loop.torque_span = static_cast<std::uint32_t>(std::clamp(loop[1], 1.0, double(p::max_torque_span - 1)));
    plant.substeps = static_cast<std::uint32_t>(std::clamp(loop[2], 1.0, 1000.0));
    period_ = person.period;
    smoothing_ = 1 - std::exp(-period_ * emg_smoothing_rad_s);
    noise_ = settings_.of("noise")[0];
    on_ = p::coefficients(plant);
    free_limb_ = on_.limb;
    held_limb_ = on_.limb;
    held_limb_.inverse_inertia = 1 / held_inertia;
    state_ = p::balanced(on_, start, 0.0);
    plant.loop.kp = plant.loop.ki = plant.loop.kd = 0;
    off_plant_ = p::coefficients(plant);
    wearer_.configure(person, state_.limb_position);
    reading_ = p::coefficients(p::from_numbers<p::DriveReadingParams<double>>(settings_.of("reading").data()), period_);
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
    const std::int64_t time = static_cast<std::int64_t>(cycle) * micros - static_cast<std::int64_t>(due - moved) * micros;
    const auto sequence = static_cast<std::uint32_t>(ticks_);
    const p::CoupledPlantOutput<double> seen = p::read(on_, state_);
    reading.samples.position = {seen.position, time, sequence, true};
    reading.samples.torque = {seen.torque, time, sequence, true};
    reading.samples.interaction = {seen.strap_torque, time, sequence, false};  // no force sensor: it is only recorded
    reading.samples.muscle = {level_[0] - level_[1], time, sequence, true};
    reading.drive = {p::step(reading_, reading_state_, seen.torque, noise_ * draws_.normal()), time, sequence, true};
    reading.joint = {seen.motor_position, time, sequence, true};
    reading.limb_position = state_.limb_position;
    reading.limb_velocity = state_.limb_velocity;
    reading.muscle_torque = muscles_.torque;
    reading.flexor = muscles_.flexor;
    reading.extensor = muscles_.extensor;
    reading.drive_torque = seen.spring_torque;
    reading.target = wearer_.target(now);
    reading.is_new = true;
  }

  void write(const Asked& asked) noexcept override { asked_ = asked; }
  void close() noexcept override { asked_ = {}; }
  void give(const Task& task, double start) noexcept override { wearer_.give(task, start); }

 private:
  static constexpr std::uint64_t max_catch_up = 100;  // periods

  void advance(double now) noexcept {
    const bool power = p::step(watchdog_, asked_.beat, asked_.enable, watchdog_patience);
    off_ = power ? 0 : off_ + 1;
    const bool dead = off_ >= power_off_periods;
    muscles_ = wearer_.step(now, state_.limb_position, state_.limb_velocity, draws_);
    const auto& who = wearer_.person().params;
    const double excitation[2] = {muscles_.flexor, muscles_.extensor}, most[2] = {who.flexion_max, who.extension_max};
    for (int i = 0; i < 2; ++i) {
      const double rectified = std::fabs(excitation[i] * draws_.normal()) * rectified_mean;
      level_[i] += smoothing_ * ((rectified - who.cocontraction) * most[i] - level_[i]);
    }
    const bool held = wearer_.is_held();
    on_.limb = off_plant_.limb = held ? held_limb_ : free_limb_;
    if (held) state_.limb_velocity = 0;
    p::step(dead ? off_plant_ : on_, state_, {dead ? 0.0 : asked_.effort, muscles_.torque, 0.0});
    if (dead) state_.loop = {};
  }

  Settings settings_;
  Draws draws_;
  Wearer wearer_;
  p::CoupledPlantCoefficients<double> on_{}, off_plant_{};
  p::LimbCoefficients<double> free_limb_{}, held_limb_{};
  p::CoupledPlantState<double> state_{};
  p::DriveReadingCoefficients<double> reading_{};
  p::DriveReadingState<double> reading_state_{};
  p::Watchdog watchdog_{};
  p::ReachingOutput<double> muscles_{};
  Asked asked_{};
  double period_ = 1e-3, smoothing_ = 0, noise_ = 0, level_[2] = {0, 0};
  std::uint64_t last_ = 0, ticks_ = 0;
  std::uint32_t off_ = power_off_periods;
};

}  // namespace

std::unique_ptr<Device> make_virtual_knee(const Settings& settings) { return std::make_unique<VirtualKnee>(settings); }

}  // namespace engine
