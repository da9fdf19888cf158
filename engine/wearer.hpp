// A virtual person at one joint: the core's reaching person, who is given tasks while the engine runs.
//
// A reach is the core's movement to a target. To follow a sine, the person aims again and again at where it will be; to
// contract, pulls more, behind the lag of a muscle, against a frame that holds the limb; one who lets go has no muscle torque but that of the passive tissue.
#pragma once

#include "device.hpp"

#include <pellucid/reaching.hpp>

#include <cmath>

namespace engine {

constexpr double aim_interval_s = 0.2;      // between two aims at a target that moves
constexpr double aim_duration_s = 0.45;     // of each of those movements
constexpr double faded_share = 0.01;        // of the strength, below which a contraction is over
constexpr double held_inertia = 1e9;        // of a limb that is clamped to a frame [kg m^2]
constexpr double contraction_lag_s = 0.08;  // of a contraction behind its task

/// Numbers that look random, and standard normal ones; the same everywhere.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : state_(seed) {}
  double uniform() noexcept {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (static_cast<double>((z ^ (z >> 31)) >> 11) + 0.5) * 0x1p-53;
  }
  double normal() noexcept {
    if (has_) return has_ = false, other_;
    const double size = std::sqrt(-2 * std::log(uniform())), angle = 6.283185307179586 * uniform();
    other_ = size * std::sin(angle);
    has_ = true;
    return size * std::cos(angle);
  }

 private:
  std::uint64_t state_;
  double other_ = 0;
  bool has_ = false;
};

class Wearer {
 public:
  void configure(const pellucid::ReachingParams<double>& params, double position) noexcept {
    person_ = pellucid::coefficients(params);
    state_ = pellucid::holding(person_, position, pellucid::ExpectedLoad<double>{});
    task_ = {};
    task_.target = position;
    lag_ = 1 - std::exp(-params.period / contraction_lag_s);
  }
  const pellucid::ReachingCoefficients<double>& person() const noexcept { return person_; }

  void give(const Task& task, double start) noexcept {
    const double held = task_.kind == TaskKind::track ? target(start) : task_.target;
    task_ = task;
    start_ = start;
    next_aim_ = start;
    if (task.kind == TaskKind::reach) {
      pellucid::aim(person_, state_, {task.target, task.amplitude, task.duration, task.reaction, load()});
    } else if (task.kind == TaskKind::contract) {
      task_.target = held;
      state_.load = load();
    }
  }

  /// Where the task's target is at a time [rad].
  double target(double now) const noexcept {
    if (task_.kind != TaskKind::track) return task_.target;
    return task_.target + task_.amplitude * std::sin(6.283185307179586 * task_.frequency * (now - start_));
  }
  /// Whether the limb is held in a frame: while a contraction is asked for, and until it has faded.
  bool is_held() const noexcept {
    return (task_.kind == TaskKind::contract && task_.share != 0) || std::fabs(contraction_) > faded_share;
  }

  /// One period of an arm at a position and velocity: the torque of its muscles and their excitations.
  pellucid::ReachingOutput<double> step(double now, double position, double velocity, Draws& draws) noexcept {
    if (task_.kind == TaskKind::track && now >= next_aim_) {
      next_aim_ = now + aim_interval_s;
      const double end = pellucid::planned(state_, 1e9).position;
      const double wanted = target(now + aim_duration_s);
      pellucid::aim(person_, state_, {wanted, wanted - end, aim_duration_s, 0.0, load()});
      state_.next_check = 1e9;
    }
    pellucid::ReachingOutput<double> out =
        pellucid::step(person_, state_, position, velocity, draws.normal(), draws.normal());
    const auto& p = person_.params;
    const double share = task_.kind == TaskKind::contract ? pellucid::clamp(task_.share, -1.0, 1.0) : 0.0;
    contraction_ += lag_ * (share - contraction_);
    relaxed_ += lag_ * ((task_.kind == TaskKind::relax ? 1.0 : 0.0) - relaxed_);
    out.torque = (1 - relaxed_) * out.torque + contraction_ * (contraction_ > 0 ? p.flexion_max : p.extension_max);
    out.flexor = pellucid::min((1 - relaxed_) * out.flexor + pellucid::max(contraction_, 0.0), 1.0);
    out.extensor = pellucid::min((1 - relaxed_) * out.extensor + pellucid::max(-contraction_, 0.0), 1.0);
    return out;
  }

 private:
  pellucid::ExpectedLoad<double> load() const noexcept {
    return {task_.load[0], task_.load[1], task_.load[2], task_.load[3], task_.load[4]};
  }
  pellucid::ReachingCoefficients<double> person_{};
  pellucid::ReachingState<double> state_{};
  Task task_{};
  double start_ = 0, next_aim_ = 0, lag_ = 0, contraction_ = 0, relaxed_ = 0;
};

}  // namespace engine
