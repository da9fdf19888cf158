// What a whole command, gravity and offset included, may give: a limit of its push and of its power, and over time a
// store of energy.
//
// What is left of an effort beyond weight and friction reaches a wearer who holds still. An effort within its limit that
// goes the way the robot's weight does pushes harder than the limit.
//
// Lifting its own weight is no gift: that work comes back. What friction is known to take refills the store, and so does
// a small steady power. What is left went into speed, or into the wearer.
//
// Power counts as its mean over some 20 ms: what an encoder's counts and noise make of one period is nothing that a
// drive gives.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct EnergyBudgetParams {
  S push_limit = S(std::numeric_limits<S>::infinity()), power_limit = push_limit, store = push_limit, steady{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.push_limit, {"push_limit", unit::effort, above(0).or_infinite(),
                         "limit of the effort beyond gravity and friction; infinite: none"});
    visit(p.power_limit, {"power_limit", Unit{1, 1, -1}, above(0).or_infinite(),
                          "limit of effort times velocity, smoothed; infinite: none"});
    visit(p.store, {"budget_store", unit::energy, above(0).or_infinite(),
                    "energy that may be given beyond weight and friction; infinite: any"});
    visit(p.steady, {"budget_power", Unit{1, 1, -1}, at_least(0), "power that refills the budget"});
  }
};

/// Rate at which power is smoothed [1/s].
constexpr double power_rate = 50.0;

template <class S> struct EnergyBudgetState {
  S spent{};  ///< energy taken from the store [J]
  S power{};  ///< effort times velocity, smoothed [W]
};

/// One period of an effort at a velocity, of a body whose `weight` the effort carries and whose friction takes up to
/// `drag` [N m].
template <class S> SafetyFault step(const EnergyBudgetParams<S>& p, EnergyBudgetState<S>& s, const S& period,
                                    const S& effort, const S& velocity, const S& weight, const S& drag) noexcept {
  const S pushed = effort - weight, share = S(power_rate) * period;
  const S power = s.power + (share < S(1) ? share : S(1)) * (effort * velocity - s.power);
  s.power = is_finite(power) ? power : S(0);
  s.spent = max(s.spent + period * (pushed * velocity - drag * abs(velocity) - p.steady), S(0));
  if (!(abs(pushed) - drag <= p.push_limit)) return SafetyFault::push;
  if (!(s.spent <= p.store)) return SafetyFault::energy;
  return abs(power) <= p.power_limit ? SafetyFault::none : SafetyFault::power;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
