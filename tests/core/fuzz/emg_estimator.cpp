// Calibrated muscles and maps from EMG and angles: whatever is heard, and whatever the numbers are, torques are finite
// and within their limits, and the fault says when they are worth nothing.
#include "watch.hpp"

#include <pellucid/emg_estimator.hpp>

namespace p = pellucid;

using Size = p::EmgSize<3, 2, 2, 2, 16, 8>;
constexpr std::uint32_t most_cells = 4;

/// An index that mostly is one.
std::uint32_t index(Bytes& bytes, std::uint32_t below) {
  const std::uint8_t kind = bytes.byte();
  if (kind < 8) return bytes.anything<std::uint32_t>();
  return kind % below;
}

/// A sensible number, its border, or anything.
template <class S> S number(Bytes& bytes, double sensible) {
  const std::uint8_t kind = bytes.byte();
  if (kind < 4) return nonsense<S>(bytes);
  if (kind < 8) return S(0);
  if (kind < 16) return S(-sensible);
  return kind < 32 ? S(sensible) * (S(1) + bytes.fraction<S>()) : S(sensible);
}

template <class S, std::size_t n> p::BiquadCoefficients<S, n> filter(Bytes& bytes) {
  p::BiquadCoefficients<S, n> made;
  made.count = bytes.byte() % 16 == 0 ? bytes.byte() : 1;
  made.section[0] = {number<S>(bytes, 0.1), S(0), S(0), number<S>(bytes, 0.9), S(0)};
  made.section[0].a1 = -made.section[0].a1;
  return made;
}

template <class S>
p::EmgEstimatorParams<S, Size> estimator(Bytes& bytes, S (&surface)[49], p::TorqueTerm<S> (&term)[3]) {
  p::EmgEstimatorParams<S, Size> e;
  e.channels = bytes.byte() % 16 == 0 ? bytes.byte() : 3;
  e.angles = bytes.byte() % 16 == 0 ? bytes.byte() : 2;
  e.joints = bytes.byte() % 16 == 0 ? bytes.byte() : 2;
  e.muscles = bytes.byte() % 4 == 0 ? bytes.byte() % 4 : 2;
  e.raw = bytes.byte() % 2 == 0;
  e.before = filter<S, 6>(bytes);
  e.after = filter<S, 4>(bytes);
  e.motion = filter<S, 1>(bytes);
  for (auto& channel : e.channel) channel = {number<S>(bytes, 1), number<S>(bytes, 0.01), number<S>(bytes, 1)};
  const S height = number<S>(bytes, 0.35), slope = number<S>(bytes, 0.002);
  for (std::size_t i = 0; i < 49; ++i) surface[i] = height + slope * static_cast<S>(i);
  surface[bytes.byte() % 49] = number<S>(bytes, 0.35);
  S sensible[p::muscle_parameter_count], numbers[p::muscle_parameter_count];
  p::EmgMuscleParams<S> usual;
  usual.delay = S(0.02);
  usual.activation = {S(-1), S(0.02), S(0.02), S(0)};
  usual.muscle.optimal_fibre_length = S(0.09);
  usual.muscle.tendon_slack_length = S(0.25);
  usual.muscle.max_isometric_force = S(1200);
  p::to_numbers(usual, sensible);
  e.period = number<S>(bytes, 0.005);
  for (auto& muscle : e.muscle) {
    change(bytes, sensible, numbers);
    muscle.muscle = p::emg_muscle_params(numbers, e.period);
    muscle.path.axes = bytes.byte() % 16 == 0 ? bytes.byte() : 1 + bytes.byte() % 2;
    for (auto& axis : muscle.path.axis) {
      axis = {index(bytes, 2), bytes.byte() % 2 == 0 ? S(-1) : S(1), number<S>(bytes, 0.1), number<S>(bytes, -0.5),
              number<S>(bytes, 0.3), 1 + bytes.byte() % most_cells};
      if (bytes.byte() % 16 == 0) axis.cells = bytes.byte() % 2 == 0 ? 0 : p::most_path_cells + 1 + bytes.byte();
    }
    muscle.path.coefficient = bytes.byte() % 32 == 0 ? nullptr : surface;
    for (S& share : muscle.share) share = number<S>(bytes, 0.5);
  }
  for (auto& one : term) one = {number<S>(bytes, 3), index(bytes, 12), index(bytes, 12)};
  for (auto& joint : e.joint) {
    joint.angle = index(bytes, 2);
    joint.stiffness = number<S>(bytes, 2);
    joint.limit = number<S>(bytes, 60);
    joint.terms = bytes.byte() % 4;
    joint.term = bytes.byte() % 16 == 0 ? nullptr : term;
  }
  e.lags = bytes.byte() % 16 == 0 ? bytes.byte() : bytes.byte() % 3;
  for (std::uint32_t& lag : e.lag) lag = index(bytes, 8);
  e.period_us = bytes.byte() % 16 == 0 ? bytes.anything<std::uint32_t>() : 5000;
  e.patience = bytes.byte() % 8;
  e.watch.on = bytes.byte() % 2 == 0;
  e.watch.forgetting = number<S>(bytes, 0.02);
  e.watch.max_loss = number<S>(bytes, 0.1);
  for (auto& channel : e.watch.channel)
    channel = {number<S>(bytes, 1), number<S>(bytes, 0.01), number<S>(bytes, 0.3), number<S>(bytes, 0.3),
               number<S>(bytes, 0.3), number<S>(bytes, 0.1), number<S>(bytes, 0.01), number<S>(bytes, 1),
               number<S>(bytes, 0.1), number<S>(bytes, 1)};
  e.watch.common_low = number<S>(bytes, 0.3);
  e.watch.common_high = number<S>(bytes, 3);
  for (auto& angle : e.watch.angle)
    angle = {-number<S>(bytes, 1), number<S>(bytes, 1), -number<S>(bytes, 20), number<S>(bytes, 20)};
  for (std::size_t i = 0; i < Size::channels; ++i) {
    e.pattern_terms[i] = bytes.byte() % 4;
    e.pattern[i] = bytes.byte() % 16 == 0 ? nullptr : term;
  }
  return e;
}

template <class S> void run(Bytes& bytes) {
  S surface[49];
  p::TorqueTerm<S> term[3];
  const auto params = estimator<S>(bytes, surface, term);
  const auto c = p::coefficients(params);
  p::EmgEstimatorState<S, Size> state;
  p::EmgSamples<S, Size> in;
  S raw[Size::channels]{};
  std::uint32_t going = 0;
  while (going > 0 || bytes.any()) {
    in.time += 5000;
    if (going > 0) {
      --going;
      for (std::size_t i = 0; i < Size::channels; ++i) raw[i] = -raw[i];
    } else {
      switch (bytes.byte() % 8) {
        case 0: in.angle[bytes.byte() % 2] = nonsense<S>(bytes); break;
        case 1: in.envelope[bytes.byte() % 3] = raw[bytes.byte() % 3] = nonsense<S>(bytes); break;
        case 2: in.time = bytes.anything<std::int64_t>() / 4; break;
        case 3: in.time -= 5000 * bytes.byte(); break;
        case 4: in.time += 1000 * bytes.byte(); break;
        case 5: going = bytes.byte(); break;
        default:
          for (std::size_t i = 0; i < 3; ++i) in.envelope[i] = raw[i] = bytes.fraction<S>();
          for (std::size_t k = 0; k < 2; ++k) in.angle[k] = bytes.fraction<S>();
      }
    }
    for (int i = 0; i < 4; ++i) p::listen(c, state, raw);
    const auto out = p::step(c, state, in);
    const auto stiff = p::stiffness(c, state);
    ++tally().cycles;
    tally().faults += out.fault != p::EmgFault::none;
    for (std::size_t j = 0; j < Size::joints; ++j) {
      tally().moving += out.torque[j] != S(0);
      require(std::isfinite(out.torque[j]), "a torque is a number");
      require(out.torque[j] == S(0) || (c.valid && std::fabs(out.torque[j]) <= params.joint[j].limit), "within its limit");
      require(out.fault != p::EmgFault::unlike || out.torque[j] == S(0), "where nothing holds there is no torque");
      require(out.blind == 0 || out.torque[j] == S(0), "without an angle there is no torque");
      for (std::size_t i = 0; i < Size::joints; ++i)
        require(std::isfinite(stiff.short_range[j][i]) && std::isfinite(stiff.slope[j][i]), "stiffness is a number");
    }
    require(c.valid == (out.fault != p::EmgFault::configuration), "nonsense is said to be");
    require(out.fault != p::EmgFault::none || (out.lost | out.above | out.blind | out.changed) == 0, "what is lost is said");
  }
}
