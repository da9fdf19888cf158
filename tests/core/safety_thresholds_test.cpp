// The gate of one joint: each limit just within and just beyond, in both signs, and its numbers from its parameters.
#include "check.hpp"

#include <pellucid/safety.hpp>

#include <cmath>
#include <initializer_list>
#include <limits>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> p::SafetyParams<S> limits() {
  return {S(8), S(512), S(4), S(-1), S(2), S(0.5), S(0.25), 3, S(0x1p-8)};
}

template <class S> void parameters() {
  const auto c = p::coefficients(limits<S>());
  check(c.valid && c.max_change == S(2) && c.inverse_margin == S(2), "rate and margin");
  check(c.rules.max_age == 250000 && c.rules.max_repeats == 3, "age in microseconds");
  auto params = limits<S>();
  params.stop_margin = S(0);
  check(p::coefficients(params).inverse_margin == std::numeric_limits<S>::infinity(), "no margin");
  params = limits<S>();
  params.position_min = params.position_max;
  check(!p::coefficients(params).valid, "stops apart from each other");
  params.position_min = S(-2);
  params.position_max = S(-1);
  check(p::coefficients(params).valid, "anywhere");
  params.position_min = S(1);
  params.position_max = S(1.25);
  check(p::coefficients(params).valid, "however near");
  params.position_min = S(1.25);
  params.position_max = S(1);
  check(!p::coefficients(params).valid, "in their order");
  params = limits<S>();
  params.effort_limit = S(0);
  check(!p::coefficients(params).valid, "sound numbers");
  const auto age = [](S seconds) {
    auto changed = limits<S>();
    changed.max_age = seconds;
    return p::coefficients(changed).rules.max_age;
  };
  check(age(S(1500)) == 1500000000 && age(S(1999)) / 1000 == 1999000, "ages that 32 bits hold");
  check(age(S(2000)) == std::numeric_limits<std::int64_t>::max(), "and those that they do not");
  check(age(S(2500)) == age(S(2000)) && age(S(3500)) == age(S(2000)) && age(S(0)) == age(S(2000)), "nor none");
}

/// A sample that is seen n times again is n periods old.
template <class S> void repeats() {
  const auto allowed = [](S age, S period, std::uint32_t stated) {
    auto params = limits<S>();
    params.max_age = age;
    params.period = period;
    params.max_repeats = stated;
    return p::coefficients(params).rules.max_repeats;
  };
  check(allowed(S(4), S(1), 9) == 4 && allowed(S(4), S(1), 4) == 4 && allowed(S(4), S(1), 3) == 3, "whole periods");
  check(allowed(S(4.5), S(1), 9) == 4 && allowed(S(0.5), S(1), 9) == 0, "and parts of one");
  check(allowed(S(4.5), S(1), 5) == 4, "just above");
  for (std::uint32_t n = 1; n <= 40; ++n) {
    for (const S period : {S(0.001), S(0.0007), S(0.003), S(0.1)}) {
      const S age = static_cast<S>(n) * period;
      const std::uint32_t most = allowed(age, period, 1000);
      check(static_cast<S>(most) * period <= age, "never older than allowed, however it is rounded");
      check(static_cast<S>(most + 1) * period > age, "and no less than that");
      const S less = std::nextafter(age, S(0));
      check(static_cast<S>(allowed(less, period, 1000)) * period <= less, "nor by a bit");
    }
  }
}

template <class S> struct Gate {
  p::SafetyCoefficients<S> c = p::coefficients(limits<S>());
  p::SafetyState<S> s{};
  std::uint32_t count = 0;
  S step(S command, S position = S(0.5), S velocity = S(0), bool valid = true) {
    ++count;
    return p::step(c, s, p::SafetyInput<S>{command, position, velocity, 1000 * std::int64_t(count), count, valid});
  }
};

template <class S> void effort() {
  for (const S way : {S(-1), S(1)}) {
    Gate<S> gate;
    check(gate.step(way * S(1)) == way * S(1), "within the rate");
    check(gate.step(way * S(9)) == way * S(3) && gate.step(way * S(9)) == way * S(5), "a change at a time");
    for (int k = 0; k < 9; ++k) gate.step(way * S(99));
    check(gate.s.output == way * S(8), "the limit");
    check(gate.step(way * S(-8)) == way * S(6) && gate.step(S(0)) == way * S(4), "down as fast");
    check(gate.s.fault == F::none, "no fault");
    gate.s.output = way * S(3);
    check(gate.step(way * S(8), S(0.5), S(0), false) == way * S(1) && gate.s.fault == F::not_finite, "a fault ramps");
    check(gate.step(way * S(8)) == S(0), "to nothing");
    check(gate.step(way * S(8)) == S(0) && gate.s.fault == F::not_finite, "and stays");
    p::reset(gate.s);
    check(gate.step(way * S(8)) == way * S(2) && gate.s.fault == F::none, "until it is opened");
  }
}

template <class S> void velocity() {
  for (const S way : {S(-1), S(1)}) {
    Gate<S> gate;
    check(gate.c.max_way == S(4) * gate.c.params.period, "way of a period");
    const S whole = gate.c.max_way, share = gate.c.smoothing;
    check(share > S(0) && share < S(0.5) && std::fabs(share - S(125) * gate.c.params.period) < S(1e-6), "125 a second");
    auto slow = limits<S>();
    slow.period = S(0.25);
    check(p::coefficients(slow).smoothing == S(1), "a slow loop has nothing to smooth");
    S at = S(0.5);
    // Moves from a position with a smooth way before.
    const auto moved = [&](S by, S velocity, S before) {
      at = at + way * by;
      gate.s.way = way * before;
      gate.step(S(1), at, way * velocity);
      return gate.s.fault;
    };
    gate.step(S(1), at, S(9));
    check(gate.s.fault == F::none && gate.s.way == S(0), "the first position is no way");
    const S more = S(1.0078125) * whole, less = S(0.9921875) * whole;
    check(moved(more, S(4), more) == F::none, "at the limit by the estimate");
    check(moved(less, S(9), less) == F::none && moved(-less, S(9), -less) == F::none, "an estimate that overshoots");
    check(moved(S(2) * whole, S(9), S(0)) == F::none, "one reading that is far off");
    check(std::fabs(gate.s.way - way * share * S(2) * whole) < S(1e-5) * whole, "counts by its share");
    check(moved(more, S(4.015625), more) == F::velocity, "beyond by both");
    p::reset(gate.s);
    check(moved(-more, S(4.015625), -more) == F::none, "after a reset the first reading is no way");
    check(moved(-more, S(4.015625), -more) == F::velocity, "either way");
    p::reset(gate.s);
    moved(more, S(0), more);
    check(moved(more, S(-4.015625), more) == F::velocity, "whatever the sign of the estimate");
    p::reset(gate.s);
    const S kept = gate.s.way;
    gate.step(S(1), std::numeric_limits<S>::quiet_NaN(), S(0));
    check(gate.s.fault == F::not_finite && gate.s.way == kept && gate.s.position == at, "what is no number is no way");
  }
}

/// The first fault is the one that is said, however fast the joint is then.
template <class S> void first_fault() {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  Gate<S> gate;
  gate.step(S(1), S(0));
  gate.step(S(1), S(1), nan);
  check(gate.s.fault == F::not_finite, "an estimate that is no number");
  gate.step(S(1), S(-1), S(99));
  check(gate.s.fault == F::not_finite, "stays the fault");
  p::reset(gate.s);
  gate.step(S(1), S(0), S(0));
  gate.step(S(1), S(1), S(99), false);
  check(gate.s.fault == F::not_finite, "a sample that is none says nothing of the speed");
}

template <class S> void stops() {
  const auto settled = [](S command, S position) {
    Gate<S> gate;
    for (int k = 0; k < 9; ++k) gate.step(command, position);
    return gate.s.output;
  };
  check(settled(S(8), S(1.5)) == S(8) && settled(S(-8), S(-0.5)) == S(-8), "a margin away from a stop");
  check(settled(S(8), S(1.75)) == S(4) && settled(S(-8), S(-0.75)) == S(-4), "half a margin away");
  check(settled(S(8), S(2)) == S(0) && settled(S(-8), S(-1)) == S(0), "at a stop");
  check(settled(S(8), S(3)) == S(0) && settled(S(-8), S(-2)) == S(0), "beyond a stop");
  check(settled(S(-8), S(3)) == S(-8) && settled(S(8), S(-2)) == S(8), "away from a stop");
  check(settled(S(8), S(0)) == S(8) && settled(S(-8), S(1)) == S(-8), "between them");
  const auto c = p::coefficients(limits<S>());
  check(p::stop_taper(c, S(0)) == S(0) && p::stop_taper(c, S(0.25)) == S(0.5) && p::stop_taper(c, S(0.5)) == S(1), "taper");
  check(p::stop_taper(c, S(0.75)) == S(1) && p::stop_taper(c, S(0.625)) == S(1) && p::stop_taper(c, S(-1)) == S(0), "from 0 to 1");
  auto hard = limits<S>();
  hard.stop_margin = S(0);
  check(p::stop_taper(p::coefficients(hard), S(0)) == S(0), "without a margin, too");
  // Where a position is no number, the last one counts.
  Gate<S> gate;
  gate.step(S(0), S(1.75));
  gate.s.output = S(8);
  check(gate.step(S(8), std::numeric_limits<S>::quiet_NaN()) == S(4) && gate.s.fault == F::not_finite, "the last position");
}

/// Whatever memory did to the last output, none leaves that is not within the limit.
template <class S> void broken() {
  for (const S wrong : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(), S(-1e30), S(1e30)}) {
    Gate<S> gate;
    gate.c.params.position_max = std::numeric_limits<S>::infinity();
    gate.c.params.position_min = -std::numeric_limits<S>::infinity();
    gate.s.output = wrong;
    const S out = gate.step(S(1));
    check(out >= S(-8) && out <= S(8), "within the limit");
  }
  for (const S wrong : {std::numeric_limits<S>::quiet_NaN(), S(9), S(-9)}) {
    Gate<S> gate;
    gate.c.params.position_max = std::numeric_limits<S>::quiet_NaN();
    gate.s.output = wrong;
    const S out = gate.step(wrong);
    check(out >= S(-8) && out <= S(8), "within the limit");
  }
  Gate<S> shut;
  shut.c.valid = false;
  shut.s.output = S(5);
  check(shut.step(S(5)) == S(0) && shut.s.fault == F::configuration, "without sense at once nothing");
}

template <class S> void all() {
  parameters<S>();
  repeats<S>();
  effort<S>();
  velocity<S>();
  first_fault<S>();
  stops<S>();
  broken<S>();
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
