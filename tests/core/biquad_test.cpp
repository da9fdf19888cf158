// Second-order sections: a known filter, one non-finite sample, a resumed run, float beside double.
#include "example.hpp"

namespace p = pellucid;

/// Butterworth low-pass, order 4, 3 Hz at 2 kHz: where direct form I in float diverges.
template <class T> p::BiquadCoefficients<T, 4> low_pass() {
  p::BiquadCoefficients<T, 4> c;
  c.section[0] = {T(4.8727896e-10), T(9.7455792e-10), T(4.8727896e-10), T(-1.98267377), T(0.98276197)};
  c.section[1] = {T(1), T(2), T(1), T(-1.99269909), T(0.99278773)};
  c.count = 2;
  return c;
}

template <class T> void recovers() {
  const auto c = low_pass<T>();
  p::BiquadState<T, 4> state;
  Random random(10);
  for (const T bad :
       {std::numeric_limits<T>::quiet_NaN(), std::numeric_limits<T>::infinity(), -std::numeric_limits<T>::infinity()}) {
    p::step(c, state, T(1));
    check(!p::is_finite(p::step(c, state, bad)), "a sample that is not finite passes through");
    check(p::step(c, state, T(0)) == 0, "and does not stay");
  }
  for (int i = 0; i < 20000; ++i) {
    p::step(c, state, random.anything<T>());
    p::step(c, state, T(1));
    p::step(c, state, std::numeric_limits<T>::quiet_NaN());
    check(p::step(c, state, T(0)) == 0, "starts again from zeros");
  }
}

template <class T> void overflows() {
  // The output is finite, but what the section would remember is not.
  p::BiquadCoefficients<T, 4> c;
  c.section[0] = {T(1), T(4), T(4), T(0), T(0)};
  c.count = 1;
  p::BiquadState<T, 4> state;
  const T largest = std::numeric_limits<T>::max();
  check(p::step(c, state, largest) == largest, "the largest number passes");
  check(p::step(c, state, T(1)) == 1 && p::is_finite(p::step(c, state, T(0))), "what would overflow is forgotten");
}

void gain_in_float() {
  const auto c = low_pass<float>();
  const auto d = low_pass<double>();
  p::BiquadState<float, 4> single;
  p::BiquadState<double, 4> exact;
  float y = 0;
  double z = 0;
  for (int k = 0; k < 20000; ++k) {
    y = p::step(c, single, 1.0f);
    z = p::step(d, exact, 1.0);
  }
  std::printf("low-pass of order 4 at 3 Hz of 2 kHz, gain in float %.5f, in double %.5f\n", static_cast<double>(y), z);
  check(std::fabs(static_cast<double>(y) - z) < 0.02 * z, "float stays near double");
}

void resumes() {
  const auto c = low_pass<double>();
  p::BiquadState<double, 4> whole;
  p::BiquadState<double, 4> part;
  for (int k = 0; k < 100; ++k) {
    const p::BiquadState<double, 4> saved = part;
    p::BiquadState<double, 4> copy = saved;
    check(p::step(c, whole, std::sin(0.1 * k)) == p::step(c, copy, std::sin(0.1 * k)), "goes on from a saved state");
    part = copy;
  }
}

int main() {
  recovers<double>();
  recovers<float>();
  overflows<double>();
  overflows<float>();
  gain_in_float();
  resumes();
  return failures();
}
