// One thing that goes wrong while somebody wears a robot, and what comes of it.
#pragma once

#include "worn_arm.hpp"

#include <cstring>
#include <string>
#include <vector>

namespace bindings {

/// What can go wrong. `needs` names the optional sensor without which it is no fault.
struct FaultKind {
  const char* name;
  const char* group;
  const char* sentence;
  const char* needs;
  bool at_start;
  bool joint_encoder;  ///< whether the robot has a second encoder
  const char* hidden = "";  ///< why no sensor of the robot can show it
};
enum class Wrong {
  none, encoder_frozen, encoder_repeats, encoder_nan, encoder_jump, encoder_slip, encoder_drift, encoder_drift_two,
  encoder_flipped, encoder_flipped_two, encoder_far, encoder_noise, encoder_half, encoder_half_two, force_flipped, force_offset, force_triple, force_frozen,
  force_lost, force_rail, emg_rail, emg_lost, emg_crossed, drive_reversed_at_start, drive_triple_at_start,
  drive_reversed, drive_triple, drive_triple_unseen, drive_stuck, drive_holds, drive_dead, drive_late, current_zero,
  current_offset, wearer_spasm, wearer_faints, wearer_blocked, strap_opens, clock_ahead, clock_back, samples_late,
  cycle_overrun, task_hangs, law_memory, supervisor_memory, mode_memory, law_state
};
constexpr FaultKind fault_kinds[] = {
    {"none", "", "", "", false, false},
    {"encoder_frozen", "sensor", "the encoder freezes while sample numbers and times continue", "", false, false},
    {"encoder_repeats", "sensor", "the encoder repeats its last sample", "", false, false},
    {"encoder_nan", "sensor", "the encoder reads NaN", "", false, false},
    {"encoder_jump", "sensor", "the encoder jumps by 1 rad", "", false, false},
    {"encoder_slip", "sensor", "the encoder jumps by 0.1 rad", "", false, false},
    {"encoder_drift", "sensor", "the only encoder drifts by 0.02 rad/s", "", false, false,
     "a single encoder has no second measurement to compare with"},
    {"encoder_drift_two", "sensor", "the motor's encoder drifts by 0.02 rad/s; the joint has a second encoder", "", false, true},
    {"encoder_flipped", "sensor", "the only encoder changes its sign, mirrored at its present angle", "", false, false,
     "the mirrored motion from rest is also a possible motion of a wearer"},
    {"encoder_flipped_two", "sensor", "the motor's encoder changes its sign; the joint has a second encoder", "", false, true},
    {"encoder_far", "sensor", "the encoder reads 5 rad too much", "", false, false},
    {"encoder_noise", "sensor", "the encoder is noisy, 2 mrad", "", false, false},
    {"encoder_half", "sensor", "the only encoder loses every second count", "", false, false,
     "half of a motion is also a possible motion"},
    {"encoder_half_two", "sensor", "the motor's encoder loses every second count; the joint has a second encoder", "", false, true},
    {"force_flipped", "sensor", "the force sensor changes its sign", "interaction", false, false},
    {"force_offset", "sensor", "the force sensor reads 3 N m too much", "interaction", false, false},
    {"force_triple", "sensor", "the force sensor reads three times too much", "interaction", false, false},
    {"force_frozen", "sensor", "the force sensor freezes", "interaction", false, false},
    {"force_lost", "sensor", "the force sensor sends no value", "interaction", false, false},
    {"force_rail", "sensor", "the force sensor's amplifier goes to its rail, 30 N m", "interaction", false, false},
    {"emg_rail", "sensor", "EMG goes to its rail, 60 N m", "muscle", false, false},
    {"emg_lost", "sensor", "an electrode falls off: EMG sends no value", "muscle", false, false},
    {"emg_crossed", "sensor", "flexors and extensors are exchanged", "muscle", false, false},
    {"drive_reversed_at_start", "drive", "the motor's leads are exchanged, from the start", "", true, false},
    {"drive_triple_at_start", "drive", "the drive gives three times the effort and reports the commanded one, from the start", "", true, false},
    {"drive_reversed", "drive", "the drive gives the opposite effort and reports it", "", false, false},
    {"drive_triple", "drive", "the drive gives three times the effort and reports it", "", false, false},
    {"drive_triple_unseen", "drive", "the drive gives three times the effort and reports the commanded one: its current sensor reads a third", "", false, false,
     "the motion is also possible with a healthy drive: only a second measurement of current or force detects it"},
    {"drive_stuck", "drive", "the drive is stuck at 5 N m", "", false, false},
    {"drive_holds", "drive", "the drive is stuck at its present effort", "", false, false},
    {"drive_dead", "drive", "the drive gives no effort", "", false, false},
    {"drive_late", "drive", "the drive answers 20 ms late", "", false, false},
    {"current_zero", "drive", "the drive's measurement reads 0", "", false, false},
    {"current_offset", "drive", "the drive's measurement reads 3 N m too much", "", false, false},
    {"wearer_spasm", "wearer", "the wearer's arm jerks with 15 N m for 0.3 s", "", false, false},
    {"wearer_faints", "wearer", "the wearer's muscles go limp", "", false, false,
     "a limp arm moves like an arm that is deliberately relaxed"},
    {"wearer_blocked", "wearer", "the arm runs into something hard", "", false, false},
    {"strap_opens", "wearer", "the strap opens", "", false, false},
    {"clock_ahead", "clock", "the controller's clock jumps ahead by 1 s", "", false, false},
    {"clock_back", "clock", "the controller's clock jumps back by 1 s", "", false, false},
    {"samples_late", "clock", "samples arrive 20 ms late", "", false, false},
    {"cycle_overrun", "clock", "the control task is late by 30 ms, once", "", false, false},
    {"task_hangs", "software", "the control task hangs", "", false, false},
    {"law_memory", "software", "a bit of the controller's parameters flips", "", false, false},
    {"supervisor_memory", "software", "a bit of the supervisor's parameters flips", "", false, false},
    {"mode_memory", "software", "a bit of the mode word flips", "", false, false},
    {"law_state", "software", "the joint position in the controller's memory is off by 1 rad, or NaN", "", false, false},
};

inline nb::list single_faults() {
  nb::list list;
  for (const FaultKind& kind : fault_kinds) {
    if (kind.group[0] == '\0') continue;
    nb::dict one;
    one["name"] = kind.name;
    one["group"] = kind.group;
    one["sentence"] = kind.sentence;
    one["needs"] = kind.needs;
    one["at_start"] = kind.at_start;
    one["joint_encoder"] = kind.joint_encoder;
    one["hidden"] = kind.hidden;
    list.append(one);
  }
  return list;
}

/// One fault from its onset on: what a period of a `WornArm` passes through.
class SingleFault {
  using Sample = pellucid::Sample<double>;

 public:
  SingleFault(const std::string& name, double onset, std::uint64_t seed) { become(name, onset, seed); }
  /// What it is from now on; what was seen until now stays seen.
  void become(const std::string& name, double onset, std::uint64_t seed) {
    constexpr std::size_t count = sizeof fault_kinds / sizeof *fault_kinds;
    std::size_t i = 0;
    while (i < count && name != fault_kinds[i].name) ++i;
    if (i == count) {
      std::string known;
      for (const auto& kind : fault_kinds) known += (known.empty() ? "" : ", ") + std::string(kind.name);
      throw nb::value_error(("fault: found \"" + name + "\", expected one of " + known).c_str());
    }
    wrong_ = static_cast<Wrong>(i);
    onset_ = onset;
    seed_ = seed;
  }
  bool any() const { return wrong_ != Wrong::none; }
  /// Whether it is there, now.
  void at(double time, double period, double extra) {
    begins_ = on_ ? false : any() && time >= onset_ - 0.5 * period;
    on_ = on_ || begins_;
    since_ = on_ ? (begins_ ? 0 : since_ + period) : 0;
    extra_ = extra;
  }
  bool on() const { return on_; }
  double since() const { return since_; }

  template <class Law>
  void samples(Law& law, pellucid::Samples<double>& read, pellucid::Feedback<double>&, std::int64_t& clock) {
    const Sample late = past_[count_ % 20].valid ? past_[count_ % 20] : read.position;
    past_[count_++ % 20] = read.position;
    if (!on_) {
      last_ = read;
      return;
    }
    Sample &q = read.position, &f = read.interaction, &m = read.muscle;
    if (begins_) held_ = last_.position.valid ? last_ : read, flip_ = q.value, noise_ = seed_;
    switch (wrong_) {
      case Wrong::encoder_frozen: q.value = held_.position.value; break;
      case Wrong::encoder_repeats: q = held_.position; break;
      case Wrong::encoder_nan: q.value = std::nan(""); break;
      case Wrong::encoder_jump: q.value += seed_ % 2 == 0 ? 1.0 : -1.0; break;
      case Wrong::encoder_slip: q.value += seed_ % 2 == 0 ? 0.1 : -0.1; break;
      case Wrong::encoder_drift: case Wrong::encoder_drift_two: q.value += (seed_ % 2 == 0 ? 0.02 : -0.02) * since_; break;
      case Wrong::encoder_flipped: case Wrong::encoder_flipped_two: q.value = 2 * flip_ - q.value; break;
      case Wrong::encoder_far: q.value += 5; break;
      case Wrong::encoder_noise: q.value += 0.002 * 1.7320508 * (2 * uniform() - 1); break;
      case Wrong::encoder_half: case Wrong::encoder_half_two: q.value = 0.5 * (q.value + flip_); break;
      case Wrong::force_flipped: f.value = -f.value; break;
      case Wrong::force_offset: f.value += seed_ % 2 == 0 ? 3.0 : -3.0; break;
      case Wrong::force_triple: f.value *= 3; break;
      case Wrong::force_frozen: f.value = held_.interaction.value; break;
      case Wrong::force_lost: f.valid = false; break;
      case Wrong::force_rail: f.value = seed_ % 2 == 0 ? 30.0 : -30.0; break;
      case Wrong::emg_rail: m.value = seed_ % 2 == 0 ? 60.0 : -60.0; break;
      case Wrong::emg_lost: m.valid = false; break;
      case Wrong::emg_crossed: m.value = -m.value; break;
      case Wrong::clock_ahead: clock += 1000000; break;
      case Wrong::clock_back: clock -= 1000000; break;
      case Wrong::samples_late: q = late; break;
      case Wrong::law_memory: if (begins_) flip_bit(&law.controller.law, sizeof law.controller.law); break;
      case Wrong::supervisor_memory: if (begins_) flip_bit(&law.supervisor, sizeof law.supervisor); break;
      case Wrong::mode_memory: if (begins_) law.state.doing.word ^= 1u << (seed_ % 11); break;
      case Wrong::law_state: if (begins_) forget(law.controller.state); break;
      default: break;
    }
  }
  bool hangs() const {
    return on_ && (wrong_ == Wrong::task_hangs || (wrong_ == Wrong::cycle_overrun && since_ < 0.03));
  }
  double given(double asked) {
    const double then = asked_[given_ % 20];
    asked_[given_++ % 20] = asked;
    if (!on_) return holds_ = asked;
    switch (wrong_) {
      case Wrong::drive_reversed: case Wrong::drive_reversed_at_start: return -asked;
      case Wrong::drive_triple: case Wrong::drive_triple_unseen: case Wrong::drive_triple_at_start:
        return pellucid::clamp(3 * asked, -15.0, 15.0);
      case Wrong::drive_stuck: return seed_ % 2 == 0 ? 5.0 : -5.0;
      case Wrong::drive_holds: return holds_;
      case Wrong::drive_dead: return 0;
      case Wrong::drive_late: return then;
      default: return asked;
    }
  }
  double measured(double given) const {
    if (!on_) return given;
    switch (wrong_) {
      case Wrong::drive_reversed_at_start: return -given;
      case Wrong::drive_triple_at_start: case Wrong::drive_triple_unseen: return given / 3;
      case Wrong::current_zero: return 0;
      case Wrong::current_offset: return given + (seed_ % 2 == 0 ? 3.0 : -3.0);
      default: return given;
    }
  }
  double pushes(double muscles) const {
    if (on_ && wrong_ == Wrong::wearer_spasm && since_ < 0.3) return extra_ + (seed_ % 2 == 0 ? 15.0 : -15.0);
    if (on_ && wrong_ == Wrong::wearer_faints) return -muscles;
    return extra_;
  }
  void lean(double torque) { extra_ += torque; }
  bool blocks() const { return on_ && wrong_ == Wrong::wearer_blocked; }
  bool opens() const { return begins_ && wrong_ == Wrong::strap_opens; }

 private:
  double uniform() {
    noise_ = noise_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(noise_ >> 11) * 0x1p-53;
  }
  /// What a law remembers first is where the joint is.
  template <class State> void forget(State& state) const {
    double first;
    std::memcpy(&first, &state, sizeof first);
    first = seed_ % 2 == 0 ? first + 1 : std::nan("");
    std::memcpy(static_cast<void*>(&state), &first, sizeof first);
  }
  /// The bits that matter most: of an exponent or a sign.
  void flip_bit(void* block, std::size_t size) {
    const std::size_t words = size / 8, word = static_cast<std::size_t>(seed_ % words);
    auto* bytes = static_cast<unsigned char*>(block) + 8 * word;
    bytes[7] = static_cast<unsigned char>(bytes[7] ^ (seed_ / 977 % 2 == 0 ? 0x80u : 0x40u));
  }
  Wrong wrong_ = Wrong::none;
  std::uint64_t seed_ = 0, noise_ = 0, count_ = 0, given_ = 0;
  double onset_ = 0, since_ = 0, flip_ = 0, holds_ = 0, extra_ = 0, asked_[20] = {};
  bool on_ = false, begins_ = false;
  pellucid::Samples<double> held_{}, last_{};
  Sample past_[20]{};
};

struct Doubles {
  const double* data;
  std::size_t count;
};

/// What somebody does all the while.
struct Life {
  Doubles tasks, noise;
  const double* sensor_error;
  bool emg;
  double tremor[2];
  Doubles stops, drive_noise;
  double onset, seconds;
  std::size_t longest;
};

/// How near a healthy life came to each threshold that follows from a model: largest so far.
struct Nearest {
  double lasting = 0, push = 0, contradiction = 0, burst = 0, excess = -1e9, spent = 0, ringing = 0, shaking = 0, answer = 0, surplus = 0, probe = 0, unexplained = 0;
  template <class S> void take(const pellucid::SupervisorState<S>& s) {
    if (pellucid::mode_of(s) == pellucid::Mode::start_up) return;
    const auto& body = s.body;
    lasting = std::max(lasting, std::fabs(body.lasting) - body.open);
    push = std::max(push, std::fabs(body.push) - body.level);
    contradiction = std::max(contradiction, std::fabs(body.contradiction) - body.open);
    burst = std::max(burst, std::fabs(body.burst) - body.level);
    excess = std::max(excess, body.excess);
    spent = std::max(spent, s.budget.spent);
    ringing = std::max(ringing, static_cast<double>(s.ringing.size));
    shaking = std::max(shaking, static_cast<double>(s.shaking.smallest));
    surplus = std::max(surplus, static_cast<double>(pellucid::least_surplus(s.drive)));
    unexplained = std::max(unexplained, static_cast<double>(s.unexplained.energy));
    for (const auto& sum : s.probe.sum) probe = std::max(probe, static_cast<double>(sum));
    if (answer == 0) answer = s.test.middle;
  }
};

struct Lived {
  Nearest nearest;
  long long found = -1, safe = -1, early = 0, periods = 0;
  pellucid::SafetyFault fault = pellucid::SafetyFault::none;
  pellucid::Mode mode = pellucid::Mode::running;
  std::vector<double> energy;
  double peak = 0, impulse = 0, speed = 0, onset_speed = 0;

  nb::dict told() const {
    nb::dict d;
    d["found"] = found;
    d["safe"] = safe;
    d["early"] = early;
    d["periods"] = periods;
    d["fault"] = fault == pellucid::SafetyFault::not_started ? "watchdog" : fault_name(fault);
    d["mode"] = pellucid::mode_names[static_cast<std::size_t>(mode)];
    d["peak"] = peak;
    d["impulse"] = impulse;
    d["speed"] = speed;
    d["onset_speed"] = onset_speed;
    d["lasting"] = nearest.lasting;
    d["push"] = nearest.push;
    d["contradiction"] = nearest.contradiction;
    d["burst"] = nearest.burst;
    d["excess"] = nearest.excess;
    d["spent"] = nearest.spent;
    d["ringing"] = nearest.ringing;
    d["shaking"] = nearest.shaking;
    d["surplus"] = nearest.surplus;
    d["probe"] = nearest.probe;
    d["unexplained"] = nearest.unexplained;
    d["answer"] = nearest.answer;
    Result result({energy.size()});
    std::copy(energy.begin(), energy.end(), result.data);
    d["energy"] = result.array();
    return d;
  }
};

constexpr std::size_t energy_every = 5;
constexpr double stop_lasts = 0.15, brace = 8.0, brace_most = 25.0, settles = 1.0;  // s, N m s/rad, N m, s

/// A life, until its fault has been made safe or was watched for long enough.
template <class Params> Lived live_with(WornArm<Params>& arm, const Life& life, SingleFault& fault) {
  namespace p = pellucid;
  Lived lived;
  const double period = arm.person.params.period;
  seal_law(arm.law);
  std::size_t task = 0, stop = 0;
  double left = settles, work = 0, row[WornArm<Params>::columns], blocked_at = 0, blocked_way = 1, speeds[5] = {};
  for (std::size_t k = 0; k < life.longest; ++k) {
    const double time = period * static_cast<double>(k);
    if (left <= 0.5 * period && life.tasks.count > 0) {
      const double* t = life.tasks.data + 5 * (task++ % life.tasks.count);
      p::aim(arm.person, arm.reach, {t[0], t[1], t[2], t[3], {}});
      left = t[4];
    }
    left -= period;
    double extra = life.tremor[0] * p::sin(std::fmod(life.tremor[1] * time, 6.283185307179586));
    while (stop < life.stops.count && time > life.stops.data[stop] + stop_lasts) ++stop;
    if (stop < life.stops.count && time >= life.stops.data[stop])
      extra -= p::clamp(brace * arm.state.limb_velocity, -brace_most, brace_most);
    fault.at(time, period, extra);
    speeds[k % 5] = std::fabs(arm.state.motor_velocity);
    if (fault.on() && fault.since() == 0) lived.onset_speed = *std::min_element(speeds, speeds + 5);
    if (fault.opens()) arm.plant.strap = {};
    if (fault.blocks()) {
      if (fault.since() == 0) blocked_at = arm.state.limb_position;
      if (fault.since() == 0) blocked_way = arm.state.limb_velocity < 0 ? -1 : 1;
      // A table: 400 N m/rad, and as much damping as stops without a bounce; it only pushes.
      const double deep = blocked_way * (arm.state.limb_position - blocked_at);
      const double onto = 400.0 * deep + 10.0 * blocked_way * arm.state.limb_velocity;
      if (deep > 0) fault.lean(-blocked_way * p::clamp(onto, 0.0, 60.0));
    }
    const std::size_t at = k % life.noise.count;
    arm.period(life.noise.data + 5 * at, life.sensor_error != nullptr ? life.sensor_error + at : nullptr, life.emg, row, fault,
               life.drive_noise.count > 0 ? life.drive_noise.data[k % life.drive_noise.count] : 0);
    ++lived.periods;
    if (arm.out.fault == p::SafetyFault::none) of_law(arm.law, 0, [&](auto& one) { return lived.nearest.take(one.state), 0; });
    const bool acted = arm.out.fault != p::SafetyFault::none;
    if (!fault.on()) {
      if (acted) {
        if (lived.early++ == 0) lived.fault = arm.out.fault, lived.mode = arm.out.mode;
        if (!fault.any()) return lived.found = static_cast<long long>(k), lived;
        return lived;
      }
      if (time < life.onset) continue;
    }
    const double torque = arm.limb_torque;
    work += period * std::max(torque * row[1], 0.0);
    const auto after = static_cast<std::size_t>(std::llround((time - life.onset) / period));
    if (after % energy_every == 0) lived.energy.push_back(work);
    if (!fault.on()) {
      if (acted) return lived;
      if (time - life.onset >= life.seconds) return lived;
      continue;
    }
    lived.peak = std::max(lived.peak, std::fabs(torque));
    lived.speed = std::max(lived.speed, std::fabs(row[1]));
    lived.impulse += period * std::fabs(row[5]);
    const bool hung = arm.off > 0 && !acted;
    if ((acted || hung) && lived.found < 0) {
      lived.found = static_cast<long long>(after);
      lived.fault = acted ? arm.out.fault : p::SafetyFault::not_started;
      lived.mode = arm.out.mode;
    }
    const bool held = arm.out.mode == p::Mode::damped_stop || (arm.out.mode == p::Mode::degraded);
    if (lived.found >= 0 && (held || arm.drive_torque == 0)) {
      lived.safe = static_cast<long long>(after);
      lived.mode = arm.out.mode;
      lived.energy.push_back(work);
      return lived;
    }
    if (time - life.onset >= life.seconds) return lived;
  }
  return lived;
}

}  // namespace bindings
