// The loops: their laws by hand, the velocity a real controller computes, and the integral that waits at the limit.
#include "example.hpp"

namespace p = pellucid;
using p::LoopKind;

template <class T> void laws() {
  const T tolerance = 40 * std::numeric_limits<T>::epsilon();
  const auto first = [](p::LoopParams<T> params, T r, T q, T v) {
    p::LoopState<T> state;
    return p::step(p::coefficients(params), state, p::LoopInput<T>{r, q, v});
  };
  const T h = T(1e-3);
  check_close(first({LoopKind::none, 9, 9, 9, 9, 0, 0, h}, T(0.7), 2, 3), T(0.7), tolerance, "none");
  check_close(first({LoopKind::p, 5, 9, 9, 9, 0, 0, h}, T(0.7), T(0.2), 3), T(2.5), tolerance, "p");
  check_close(first({LoopKind::pi, 5, 100, 9, 9, 0, 0, h}, T(0.7), T(0.2), 3), T(2.5) + 100 * h * T(0.5), tolerance,
              "pi");
  check_close(first({LoopKind::pd, 5, 9, 2, 9, 0, 0, h}, T(0.7), T(0.2), 3), T(2.5) - 2 * 3, tolerance, "pd");
  check_close(first({LoopKind::cascade, 5, 0, 9, 2, 0, 0, h}, T(0.7), T(0.2), 3), 2 * (T(2.5) - 3), tolerance,
              "cascade");
  check_close(first({LoopKind::cascade, 5, 100, 9, 2, 0, 0, h}, T(0.7), T(0.2), 3),
              2 * (T(2.5) - 3) + 100 * h * (T(2.5) - 3), tolerance, "cascade with integral");
  check_close(first({LoopKind::velocity_pi, 5, 100, 9, 9, 0, 0, h}, T(0.7), T(0.2), 3), (5 + 100 * h) * (T(0.7) - 3),
              tolerance, "velocity_pi");
  check(first({LoopKind::p, 5, 0, 0, 0, 1, 0, h}, T(0.7), T(0.2), 3) == 1 &&
            first({LoopKind::p, 5, 0, 0, 0, 1, 0, h}, T(-0.7), T(0.2), 3) == -1,
        "limit");

  // The velocity spans `span` samples and is 0 at the start, whatever the true velocity is.
  for (std::uint32_t span = 1; span <= 8; ++span) {
    const auto c = p::coefficients(p::LoopParams<T>{LoopKind::pd, 0, 0, 1, 0, 0, span, h});
    p::LoopState<T> state;
    for (std::uint32_t k = 0; k < 30; ++k) {
      const auto position = [](std::uint32_t i) { return static_cast<T>(i * i) / T(1024); };
      const T u = p::step(c, state, p::LoopInput<T>{0, position(k), 99});
      const std::uint32_t past = k < span ? 0 : k - span;
      check_close(u, -(position(k) - position(past)) / (static_cast<T>(span) * h), 2000 * tolerance,
                  "velocity over a span");
    }
  }
}

template <class T> void waits() {
  const auto c = p::coefficients(p::LoopParams<T>{LoopKind::pi, 1, 10, 0, 0, 1, 0, T(1e-3)});
  p::LoopState<T> state;
  for (int k = 0; k < 100000; ++k) check(p::step(c, state, p::LoopInput<T>{5, 0, 0}) == 1, "saturated");
  check(state.integral < T(0.2), "the integral waits");
  check(p::step(c, state, p::LoopInput<T>{T(-0.5), 0, 0}) < 0, "and lets go at once");
}

int main() {
  laws<double>();
  laws<float>();
  waits<double>();
  waits<float>();
  return failures();
}
