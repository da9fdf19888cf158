// Steps the engine by one cycle.
#include "loop.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>

namespace engine {

namespace p = pellucid;

namespace {

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t clock_jump_us = 500000;
constexpr double max_injection_s = 5;

/// The samples of a reading in the order of a record.
template <class R, class F> void for_each_sample(R& reading, F f) {
  f(0, reading.samples.position);
  f(1, reading.samples.torque);
  f(2, reading.samples.interaction);
  f(3, reading.samples.muscle);
  f(4, reading.drive);
  f(5, reading.joint);
}

/// The state of a law that is stepped.
State state_of(const p::SupervisorOutput<double>& out) noexcept {
  if (!p::is_stopped(out.mode)) return out.mode == p::Mode::start_up ? State::armed : State::running;
  return out.fault == p::SafetyFault::stopped ? State::stopped : State::faulted;
}

}  // namespace

Loop::Loop(const Settings& settings, Device& device, Region& region)
    : settings_(settings), device_(device), region_(region), law_(1) {
  std::size_t most = 0;
  for (const Condition& condition : settings.conditions) most = std::max(most, condition.numbers.size());
  numbers_.reserve(most);
  status().ended = 0;
  // What an earlier session asked for is over: an engine begins without a law, whatever it finds.
  if (region_.read_command(command_)) {
    stops_seen_ = command_.stops;
    adjusts_seen_ = 0;
    injections_seen_ = command_.injections;
    armed_ = command_.run == 0;
  }
  choose(std::min<std::uint32_t>(command_.law, static_cast<std::uint32_t>(settings.conditions.size()) - 1));
}

void Loop::choose(std::uint32_t law) noexcept {
  chosen_ = law;
  const Condition& condition = settings_.conditions[law];
  device_.wear(condition.worn);
  Status& s = status();
  s.effort_limit = condition.effort_limit;
  s.rate_limit = condition.rate_limit;
  s.velocity_limit = condition.velocity_limit;
  s.position_min = condition.position_min;
  s.position_max = condition.position_max;
}

void Loop::listen(std::int64_t time, std::uint32_t& flags) noexcept {
  Command command;
  if (!region_.read_command(command)) {
    flags |= flag::torn;
    ++status().torn_commands;
  } else if (command.sequence != command_.sequence) {
    const bool other_task = command.task != command_.task;
    command_ = command;
    if (command_.law >= settings_.conditions.size()) command_.law = chosen_;
    if (command_.run == 0) adjusts_seen_ = command_.adjusts;  // a law that is armed later begins with its own numbers
    if (other_task) {
      Task task;
      task.number = command.task;
      task.kind = command.task_kind <= static_cast<std::uint32_t>(TaskKind::relax) ? static_cast<TaskKind>(command.task_kind) : TaskKind::hold;
      task.target = command.target;
      task.amplitude = command.amplitude;
      task.duration = std::max(command.duration, 0.05);
      task.reaction = std::max(command.reaction, 0.0);
      task.frequency = command.frequency;
      task.share = command.share;
      std::copy_n(command.load, 5, task.load);
      const bool sound = std::isfinite(task.target) && std::isfinite(task.amplitude) && std::isfinite(task.duration) &&
                         std::isfinite(task.frequency) && std::isfinite(task.share);
      if (sound) device_.give(task, 1e-9 * static_cast<double>(time - region_.header().epoch));
    }
    if (command.stops != stops_seen_) {
      stops_seen_ = command.stops;
      stop_is_due_ = true;
      void_token_ = command.token;
    } else if (command.token != void_token_) {
      void_token_ = 0;
    }
    if (command.injections != injections_seen_) {
      injections_seen_ = command.injections;
      const double seconds = std::clamp(command.injected_for, 0.0, max_injection_s);
      injection_ = static_cast<Injection>(command.injection);
      injected_until_ = time + static_cast<std::int64_t>(1e9 * seconds);
      holds_ = false;
      if (injection_ == Injection::starved) {
        const timespec pause{static_cast<time_t>(seconds), static_cast<long>(1e9 * (seconds - std::floor(seconds)))};
        nanosleep(&pause, nullptr);
        injection_ = Injection::none;
      }
    }
  }
  status().command_sequence = command_.sequence;
  // A session that has spoken and is silent: nobody is there who could stop.
  const bool heard = static_cast<double>(time - command_.heartbeat) < 1e9 * settings_.session_timeout;
  if (session_was_heard_ && !heard) stop_is_due_ = true;
  session_was_heard_ = heard;
  if (command_.run == 0) armed_ = heard;
  if (!heard) armed_ = false;
}

void Loop::inject(Reading& reading, std::int64_t time) noexcept {
  if (injection_ == Injection::none) return;
  if (time >= injected_until_) {
    injection_ = Injection::none;
    return;
  }
  if (injection_ == Injection::frozen) {
    if (!holds_) held_ = reading;
    holds_ = true;
    for_each_sample(reading, [this](std::size_t i, p::Sample<double>& sample) {
      for_each_sample(held_, [&](std::size_t j, const p::Sample<double>& old) {
        if (i == j) sample.value = old.value;
      });
    });
    return;
  }
  for_each_sample(reading, [this](std::size_t, p::Sample<double>& sample) {
    if (injection_ == Injection::not_a_number) sample.value = nan_value;
    if (injection_ == Injection::clock_ahead) sample.time += clock_jump_us;
    if (injection_ == Injection::clock_back) sample.time -= clock_jump_us;
    if (injection_ == Injection::silent) sample.valid = false;
  });
}

Asked Loop::decide(const Reading& reading, std::int64_t now_us, std::uint32_t& flags, Record& record) noexcept {
  AnyLaw& law = law_[0];
  const Condition& condition = settings_.conditions[chosen_];
  const bool wants = command_.run != 0 && armed_ && condition.kind != "none";

  if (doing_ == Doing::nothing) {
    if (stop_is_due_) {
      armed_ = false;
      stop_is_due_ = false;
    } else if (command_.law != chosen_) {
      choose(command_.law);
    } else if (wants && state_ == State::armed) {
      begin(law, condition);
      numbers_.assign(condition.numbers.begin(), condition.numbers.end());
      doing_ = Doing::law;
      flags |= flag::began;
    }
  }
  const bool needs_reset = p::meaning_of(state_).needs_reset;
  const bool leaves = command_.run == 0 || command_.law != chosen_ || !armed_;
  if (doing_ == Doing::law && !needs_reset && leaves && !stop_is_due_) doing_ = Doing::ramp;

  Asked asked;
  asked.beat = ++beat_;
  // A stop wins over a reset that was requested before it, and a silent session resets nothing.
  const bool resets = needs_reset && !stop_is_due_ && session_was_heard_;
  record.token = resets && command_.token != void_token_ ? command_.token : 0;
  if (doing_ == Doing::law) {
    if (stop_is_due_) {
      of_law(law, 0, [](auto& one) { return p::stop(one), 0; });
      flags |= flag::stop_asked;
      stop_is_due_ = false;
    }
    if (command_.adjusts != adjusts_seen_ && command_.adjusted_law == chosen_) {
      adjusts_seen_ = command_.adjusts;
      if (adjust(law, numbers_, command_.adjusted_field, command_.adjusted_value)) {
        flags |= flag::adjusted;
        record.adjusted_field = command_.adjusted_field;
        record.adjusted_value = command_.adjusted_value;
      }
    }
    p::Feedback<double> back;
    back.drive = reading.drive;
    back.joint = reading.joint;
    back.token = record.token;
    out_ = step(law, reading.samples, back, now_us);
    flags |= flag::stepped;
    effort_ = out_.effort;
    asked.enable = out_.enable;
    if (needs_reset && !p::is_stopped(out_.mode)) {
      // After a reset nothing runs until it is armed again.
      doing_ = Doing::nothing;
      armed_ = false;
      flags &= ~flag::stepped;  // nothing of this step is asked for
    } else {
      state_ = state_of(out_);
    }
  } else if (doing_ == Doing::ramp) {
    const double change = condition.rate_limit * 1e-9 * static_cast<double>(settings_.period_ns);
    effort_ = effort_ > 0 ? std::max(effort_ - change, 0.0) : std::min(effort_ + change, 0.0);
    if (!std::isfinite(effort_)) effort_ = 0;
    asked.enable = true;
    // The law that ramps down ends anyway; no other begins before the session has taken `run` back.
    if (stop_is_due_) armed_ = false;
    stop_is_due_ = false;
    if (effort_ == 0 && state_ == State::stopping) doing_ = Doing::nothing;
    state_ = State::stopping;
  }
  if (doing_ == Doing::nothing) {
    const bool may_begin = command_.run != 0 && armed_ && command_.law == chosen_ && settings_.conditions[chosen_].kind != "none";
    state_ = may_begin ? State::armed : State::disarmed;
    effort_ = 0;
    asked.enable = false;
    out_ = {};
    out_.mode = p::Mode::latched;
  }
  asked.effort = effort_;
  return asked;
}

bool Loop::cycle(std::uint64_t number, std::int64_t time, std::int64_t deadline) noexcept {
  Header& header = region_.header();
  Status& s = status();
  std::uint32_t flags = 0;
  const std::int64_t lateness = time - deadline;
  if (lateness > settings_.late_ns) {
    flags |= flag::late;
    ++s.late;
  }
  ++s.lateness[lateness_bin(lateness)];
  s.worst_lateness = std::max(s.worst_lateness, lateness);

  listen(time, flags);
  const std::int64_t now_us = (time - header.epoch) / 1000;
  Reading reading;
  reading.limb_position = reading.limb_velocity = reading.muscle_torque = reading.flexor = reading.extensor = nan_value;
  reading.drive_torque = reading.target = nan_value;
  device_.read(number, now_us, reading);
  if (!reading.is_new) ++s.device_silent;
  if (injection_ != Injection::none) flags |= flag::injected;
  inject(reading, time);

  const std::uint64_t count = header.records.load(std::memory_order_relaxed) + 1;
  Record& record = region_.record(count);
  record.number_again = 0;
  std::atomic_thread_fence(std::memory_order_release);
  record.number = count;
  const Asked asked = decide(reading, now_us, flags, record);
  device_.write(asked);

  record.cycle = number;
  record.time = time;
  record.deadline = deadline;
  record.now_us = now_us;
  record.valid = 0;
  for_each_sample(reading, [&record](std::size_t i, const p::Sample<double>& sample) {
    record.value[i] = sample.value;
    record.stamp_us[i] = sample.time;
    record.sequence[i] = sample.sequence;
    record.valid |= sample.valid ? 1u << i : 0u;
  });
  record.flags = flags;
  record.law = chosen_;
  record.effort = asked.effort;
  record.fault = static_cast<std::uint8_t>(out_.fault);
  record.mode = static_cast<std::uint8_t>(out_.mode);
  record.enable = asked.enable ? 1 : 0;
  record.state = static_cast<std::uint8_t>(state_);
  record.beat = asked.beat;
  record.challenge = out_.challenge;
  record.task = command_.task;
  record.task_kind = command_.task_kind;
  record.target = std::isfinite(reading.target) ? reading.target : command_.target;
  record.limb_position = reading.limb_position;
  record.limb_velocity = reading.limb_velocity;
  record.muscle_torque = reading.muscle_torque;
  record.flexor = reading.flexor;
  record.extensor = reading.extensor;
  record.drive_torque = reading.drive_torque;
  record.torque_estimate = command_.torque_estimate;
  record.torque_half_width = command_.torque_half_width;
  record.velocity = doing_ == Doing::nothing ? nan_value : velocity(law_[0]);
  timespec at{};
  clock_gettime(CLOCK_MONOTONIC, &at);
  const std::int64_t compute = at.tv_sec * 1000000000 + at.tv_nsec - time;
  record.compute = static_cast<std::uint32_t>(std::clamp<std::int64_t>(compute, 0, 0xffffffff));
  record.number_again = count;
  header.records.store(count, std::memory_order_release);

  s.worst_compute = std::max(s.worst_compute, compute);
  s.cycle = number;
  s.records = count;
  s.state = static_cast<std::uint32_t>(state_);
  s.law = chosen_;
  s.fault = record.fault;
  s.mode = record.mode;
  s.enable = record.enable;
  s.challenge = record.challenge;
  s.heartbeat = time;
  return command_.end == 0;
}

void Loop::end() noexcept {
  device_.write({0.0, ++beat_, false});
  device_.close();
  doing_ = Doing::nothing;
  state_ = State::disarmed;
  status().state = static_cast<std::uint32_t>(state_);
  status().ended = 1;
  status().enable = 0;
}

}  // namespace engine
