// What fuzzers draw from.
#pragma once

#include <cstdint>
#include <cstring>

namespace bindings {

/// Numbers that look random and are the same everywhere (SplitMix64).
class Bits {
 public:
  explicit Bits(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  /// Any bit pattern at all.
  template <class S> S anything() {
    const std::uint64_t pattern = next();
    S x;
    std::memcpy(&x, &pattern, sizeof x);
    return x;
  }

 private:
  std::uint64_t state_;
};

}  // namespace bindings
