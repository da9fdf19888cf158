// The gate: a million cycles of anything at all, and each fault by itself.
#include "example.hpp"

namespace p = pellucid;

template <class T> p::SafetyParams<T> sensible() {
  return {T(10), T(500), T(20), T(-1), T(1.5), T(0.2), T(0.01), 3, T(1e-3)};
}

template <class T> void fuzz() {
  const auto params = sensible<T>();
  const auto c = p::coefficients(params);
  p::SafetyState<T> state;
  Random random(11);
  long unsafe = 0, faults = 0, moved = 0;
  std::int64_t time = 0;
  std::uint32_t sequence = 0;
  const T step = c.max_change * (1 + 4 * std::numeric_limits<T>::epsilon()) +
                 10 * std::numeric_limits<T>::epsilon() * params.effort_limit;
  for (int k = 0; k < 1000000; ++k) {
    const T before = state.output;
    const double kind = random.uniform();
    p::SafetyInput<T> input{static_cast<T>(random.uniform(-30, 30)),
                            static_cast<T>(random.uniform(-1.2, 1.7)),
                            static_cast<T>(random.uniform(-15, 15)),
                            time += 1000,
                            ++sequence,
                            true};
    if (kind < 0.002)
      input.command = random.anything<T>();
    else if (kind < 0.004)
      input.position = random.anything<T>();
    else if (kind < 0.006)
      input.velocity = random.anything<T>();
    else if (kind < 0.007)
      input.time = static_cast<std::int64_t>(random.bits());
    else if (kind < 0.008)
      input.sequence = static_cast<std::uint32_t>(random.bits());
    else if (kind < 0.018)
      input.sequence -= 1;
    else if (kind < 0.020)
      input.valid = false;
    else if (kind < 0.022)
      input.velocity = std::numeric_limits<T>::denorm_min();
    const T out = p::step(c, state, input);

    bool safe = std::isfinite(out) && std::fabs(out) <= params.effort_limit;
    const bool away_from_zero = std::fabs(out) > std::fabs(before) && !(out * before < 0);
    if (away_from_zero || out * before < 0) safe = safe && std::fabs(out - before) <= step;
    if (std::isfinite(input.position))
      safe = safe && !(out > 0 && input.position >= params.position_max) &&
             !(out < 0 && input.position <= params.position_min);
    if (state.fault != p::SafetyFault::none) safe = safe && std::fabs(out) <= std::fabs(before);
    unsafe += !safe;
    moved += out != 0;
    if (state.fault != p::SafetyFault::none && random.uniform() < 0.05) {
      ++faults;
      p::reset(state);
    }
  }
  std::printf("fuzz: 1000000 cycles, %ld faults, %ld unsafe outputs, %ld not zero\n", faults, unsafe, moved);
  check(unsafe == 0, "no unsafe output");
  check(faults > 1000 && moved > 100000, "the fuzz reaches both sides of the gate");
}

template <class T> void anything() {
  // Parameters may be anything too: the output stays a number within the limit, if there is one.
  Random random(12);
  for (int k = 0; k < 200000; ++k) {
    const auto any = [&random] { return random.anything<T>(); };
    const p::SafetyParams<T> params{
        any(), any(), any(), any(), any(), any(), any(), static_cast<std::uint32_t>(random.bits()), any()};
    const auto c = p::coefficients(params);
    p::SafetyState<T> state;
    for (int i = 0; i < 3; ++i) {
      const T out = p::step(c, state,
                            p::SafetyInput<T>{any(), any(), any(), static_cast<std::int64_t>(random.bits()),
                                              static_cast<std::uint32_t>(random.bits()), true});
      check(std::isfinite(out) && (out == 0 || std::fabs(out) <= params.effort_limit),
            "a number, whatever the parameters");
    }
  }
}

template <class T> class Gate {
 public:
  p::SafetyState<T> state;
  T step(T command, T position = 0, T velocity = 0) {
    time_ += 1000;
    ++sequence_;
    return repeat(command, position, velocity);
  }
  T repeat(T command, T position = 0, T velocity = 0) {
    return p::step(c_, state, p::SafetyInput<T>{command, position, velocity, time_, sequence_, true});
  }
  T settle(T command, T position = 0) {
    T out = 0;
    for (int k = 0; k < 100; ++k) out = step(command, position);
    return out;
  }
  void skip(std::int64_t time, std::uint32_t sequence) {
    time_ += time;
    sequence_ += sequence;
  }

 private:
  p::SafetyCoefficients<T> c_ = p::coefficients(sensible<T>());
  std::int64_t time_ = 5000000;
  std::uint32_t sequence_ = 0xfffffff0u;  // wraps around on the way
};

template <class T> void faults() {
  using F = p::SafetyFault;
  const T nan = std::numeric_limits<T>::quiet_NaN();
  const T tolerance = 20 * std::numeric_limits<T>::epsilon();
  Gate<T> gate;
  check_close(gate.step(4), T(0.5), tolerance, "rate limit");
  check(gate.settle(4) == 4, "the command gets through");
  check(gate.settle(99) == 10 && gate.settle(-99) == -10, "saturation");
  check_close(gate.settle(99, T(1.4)), T(5), 100 * tolerance, "half the limit, half a margin from the stop");
  check(gate.settle(99, T(1.5)) == 0 && gate.settle(99, T(9)) == 0 && gate.settle(-99, T(9)) == -10,
        "into a stop no effort, out of it all");
  check(gate.settle(-99, T(-1)) == 0, "the lower stop");

  const auto latches = [&](F wanted, auto&& cause) {
    Gate<T> g;
    g.settle(8);
    cause(g);
    check(g.state.fault == wanted, "fault");
    const T first = g.state.output;
    check(first >= T(7.4) && first < 8, "ramps, not jumps");
    for (int k = 0; k < 20; ++k) g.step(8);
    check(g.state.output == 0 && g.state.fault == wanted, "stays shut");
    p::reset(g.state);
    check(g.settle(8) == 8 && g.state.fault == F::none, "opens on reset");
  };
  latches(F::not_finite, [&](Gate<T>& g) { g.step(nan); });
  latches(F::not_finite, [&](Gate<T>& g) { g.step(8, nan); });
  latches(F::not_finite, [&](Gate<T>& g) { g.step(8, 0, std::numeric_limits<T>::infinity()); });
  // Faster than 20 rad/s for so long that counts and noise of an encoder cannot be why.
  latches(F::velocity, [&](Gate<T>& g) {
    for (int k = 1; g.state.fault == F::none && k <= 40; ++k) g.step(8, T(-0.021) * static_cast<T>(k), T(-20.1));
  });
  latches(F::out_of_order, [&](Gate<T>& g) {
    g.skip(-2000, 0);
    g.step(8);
    g.skip(1000, 0);
  });
  latches(F::out_of_order, [&](Gate<T>& g) {
    g.skip(0, 0xfffffffeu);
    g.step(8);
  });
  latches(F::stale, [&](Gate<T>& g) {
    g.skip(10000, 0);
    g.step(8);
  });
  latches(F::stale, [&](Gate<T>& g) {
    for (int k = 0; k < 3; ++k) g.repeat(8);
    check(g.state.fault == F::none, "three repeats are allowed");
    g.repeat(8);
  });
  Gate<T> lossy;
  for (int k = 0; k < 1000; ++k) {
    lossy.skip(k % 3 == 0 ? 4000 : 0, k % 3 == 0 ? 4 : 0);
    lossy.step(1);
  }
  check(lossy.state.fault == F::none, "lost samples within max_age are no fault");

  for (int which = 0; which < 9; ++which)
    for (const T bad : {nan, T(-1)}) {
      auto params = sensible<T>();
      T* const fields[] = {&params.effort_limit, &params.rate_limit, &params.velocity_limit,
                           &params.stop_margin,  &params.max_age,    &params.period};
      if (which < 6) *fields[which] = bad;
      if (which == 6) params.position_min = nan;
      if (which == 7) params.position_max = nan;
      if (which == 8) params.position_max = params.position_min - 1;
      p::SafetyState<T> state;
      check(p::step(p::coefficients(params), state, p::SafetyInput<T>{5, 0, 0, 1, 1, true}) == 0 &&
                state.fault == F::configuration,
            "configuration");
    }
}

int main() {
  fuzz<double>();
  fuzz<float>();
  anything<double>();
  anything<float>();
  faults<double>();
  faults<float>();
  return failures();
}
