// Compensation of one coherent body, and of what rules learnt beyond it.
//
//   u = as transparent_compensation.hpp, with sum_ij w_ij A_i(q) B_j(v) added to what drives
//
// A_i and B_j are triangles that sum to one, over evenly spaced angles and over speeds evenly spaced in v/(|v| + w), so
// that they lie close where friction turns. This is a Takagi-Sugeno system of order zero, after T. Takagi and M. Sugeno,
// IEEE Transactions on Systems, Man, and Cybernetics 15(1), 1985; a network of angle and velocity is carried by its
// values at the places of the rules.
#pragma once

#include "transparent_compensation.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::size_t rule_angles = 5, rule_speeds = 7;

template <class S> struct RuleTableParams {
  S low{}, high = S(2.6), speed = S(0.3);
  S torque[rule_angles][rule_speeds]{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    constexpr const char* angles[rule_angles] = {"rule_0", "rule_1", "rule_2", "rule_3", "rule_4"};
    constexpr const char* speeds[rule_speeds] = {"_0", "_1", "_2", "_3", "_4", "_5", "_6"};
    visit(p.low, {"rule_low", unit::coordinate, any_number(), "angle of the first rule"});
    visit(p.high, {"rule_high", unit::coordinate, any_number(), "angle of the last rule"});
    visit(p.speed, {"rule_speed", unit::velocity, above(0), "w, half of the rules of either direction lie below it"});
    for (std::size_t i = 0; i < rule_angles; ++i)
      for (std::size_t j = 0; j < rule_speeds; ++j)
        visit(p.torque[i][j], {angles[i], unit::effort, any_number(), "that this rule says, from fast down to fast up",
                               {}, "", speeds[j]});
  }
};

/// Coefficients computed once from RuleTableParams.
template <class S> struct RuleTableCoefficients {
  RuleTableParams<S> params{};  ///< as they are
  S per_angle{};                ///< rules a radian
  bool valid = false;           ///< whether they make sense
};

template <class S> RuleTableCoefficients<S> coefficients(const RuleTableParams<S>& p) noexcept {
  const bool valid = is_sound(p) && p.high > p.low;
  return {p, valid ? S(static_cast<value_t<S>>(rule_angles - 1)) / (p.high - p.low) : S(0), valid};
}

/// Between which two of `count` rules a place is, and how far on the way to the second.
template <class S> struct RulePlace {
  std::size_t first = 0;  ///< the lower one
  S share{};              ///< share of the second rule
};
template <class S> RulePlace<S> rule_place(const S& along, std::size_t count) noexcept {
  RulePlace<S> at;
  while (at.first + 2 < count && along >= S(static_cast<value_t<S>>(at.first + 1))) ++at.first;
  at.share = clamp(along - S(static_cast<value_t<S>>(at.first)), S(0), S(1));
  return at;
}

/// Effort of the rules at an angle and a velocity, both finite [N m].
template <class S> S torque(const RuleTableCoefficients<S>& c, const S& position, const S& velocity) noexcept {
  const RuleTableParams<S>& p = c.params;
  const S half = S(static_cast<value_t<S>>(rule_speeds - 1) / 2);
  const RulePlace<S> a = rule_place((position - p.low) * c.per_angle, rule_angles);
  const RulePlace<S> b = rule_place(half * (S(1) + velocity / (abs(velocity) + p.speed)), rule_speeds);
  const S lower = p.torque[a.first][b.first] + b.share * (p.torque[a.first][b.first + 1] - p.torque[a.first][b.first]);
  const S upper = p.torque[a.first + 1][b.first] +
                  b.share * (p.torque[a.first + 1][b.first + 1] - p.torque[a.first + 1][b.first]);
  return lower + a.share * (upper - lower);
}

template <class S> struct RuleCompensationParams : TransparentCompensationParams<S> {
  RuleTableParams<S> rules{};  ///< rules for what the body's model leaves

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.rules, visit);
    TransparentCompensationParams<S>::walk(p, visit);
  }
};

/// Coefficients computed once from RuleCompensationParams.
template <class S> struct RuleCompensationCoefficients : TransparentCompensationCoefficients<S> {
  RuleTableCoefficients<S> rules{};  ///< rules for what the body's model leaves
};

template <class S> RuleCompensationCoefficients<S> coefficients(const RuleCompensationParams<S>& p) noexcept {
  RuleCompensationCoefficients<S> c;
  const TransparentCompensationParams<S>& body = p;
  static_cast<TransparentCompensationCoefficients<S>&>(c) = coefficients(body);
  c.rules = coefficients(p.rules);
  c.gate.valid = c.gate.valid && c.rules.valid;
  return c;
}

/// One control period: the torque at the joint [N m].
template <class S> S step(const RuleCompensationCoefficients<S>& c, TransparentCompensationState<S>& state,
                          const Samples<S>& samples) noexcept {
  return compensate(c, state, samples, [&c](const S& position, const S& velocity) {
    return torque(c.rules, position, velocity);
  });
}

template <class S> struct RuleCompensation {
  using Params = RuleCompensationParams<S>;
  using Coefficients = RuleCompensationCoefficients<S>;
  using State = TransparentCompensationState<S>;
  static constexpr const char* name = "rules";
  static constexpr const char* type = "RuleCompensation";
  static constexpr const char* title = "compensation of a worn elbow's body, and of what rules learnt beyond it";
  static constexpr SensorUse sensors[] = {
      {Quantity::position, true, 0.8, 4e-4}, {Quantity::interaction, false, 1.0, 1e-2}, {Quantity::muscle, false, 2.0, 0.05}};
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
