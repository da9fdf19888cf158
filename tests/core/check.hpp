// The smallest test frame: check() prints what failed and where; main returns failures(). With END_AT_FIRST_FAILURE the
// first one ends the test, where only whether there is one counts.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

inline int& failures() {
  static int count = 0;
  return count;
}
/// Whether one more failure is to be printed.
inline bool fails() {
#ifdef END_AT_FIRST_FAILURE
  std::_Exit(1);
#endif
  return ++failures() <= 20;
}
inline void check(bool holds, const char* what, int line = __builtin_LINE(), const char* file = __builtin_FILE()) {
  if (holds) return;
  if (fails()) std::printf("%s:%d: %s\n", file, line, what);
}
template <class T> void check_close(T got, T wanted, T tolerance, const char* what, int line = __builtin_LINE(),
                                    const char* file = __builtin_FILE()) {
  if (std::fabs(got - wanted) <= tolerance) return;
  if (fails())
    std::printf("%s:%d: %s: got %.17g, wanted %.17g\n", file, line, what, static_cast<double>(got),
                static_cast<double>(wanted));
}

/// Numbers that look random and are the same everywhere (SplitMix64).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  /// In [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Any bit pattern at all: infinities, NaN and subnormal numbers too.
  template <class T> T anything() {
    const std::uint64_t pattern = bits();
    T x;
    std::memcpy(&x, &pattern, sizeof x);
    return x;
  }

 private:
  std::uint64_t state_;
};
