// Bytes become parameters and a stream of samples: motion, and everything that can be wrong with a sample.
#pragma once

#include "../check.hpp"
#include "../law_numbers.hpp"

#include <pellucid/law.hpp>

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <cstring>
#include <limits>

/// What a fuzzer gave, byte by byte; 0 once there are none left.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  bool any() const { return at_ < size_; }
  std::uint8_t byte() { return at_ < size_ ? data_[at_++] : std::uint8_t(0); }
  /// Any bit pattern at all.
  template <class T> T anything() {
    std::uint8_t raw[sizeof(T)];
    for (std::uint8_t& b : raw) b = byte();
    T x;
    std::memcpy(&x, raw, sizeof x);
    return x;
  }
  /// A number of a few digits, -1 to 1.
  template <class S> S fraction() { return S(static_cast<std::int8_t>(byte())) / S(127); }

 private:
  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
};

/// No number, or one that nobody measures.
template <class S> S nonsense(Bytes& bytes) {
  const S infinity = std::numeric_limits<S>::infinity();
  switch (bytes.byte() % 6) {
    case 0: return std::numeric_limits<S>::quiet_NaN();
    case 1: return infinity;
    case 2: return -infinity;
    case 3: return std::numeric_limits<S>::max();
    case 4: return std::numeric_limits<S>::denorm_min();
    default: return bytes.anything<S>();
  }
}

/// Some of a law's numbers changed: a little, to the border of what they may be, or to anything.
template <class S, std::size_t n> void change(Bytes& bytes, const S (&sensible)[n], S (&numbers)[n]) {
  for (std::size_t i = 0; i < n; ++i) numbers[i] = sensible[i];
  const int changes = static_cast<int>(bytes.byte() % 8) - 4;
  for (int i = 0; i < changes; ++i) {
    S& number = numbers[bytes.byte() % n];
    switch (bytes.byte() % 8) {
      case 0: number = S(0); break;
      case 1: number = -number; break;
      case 2: number = S(1); break;
      case 3: number = nonsense<S>(bytes); break;
      default: number = number * pellucid::exp(S(6) * bytes.fraction<S>());
    }
  }
}

/// A Params of typical numbers, some of them changed.
template <class P> P changed(Bytes& bytes) {
  using S = decltype(P::gate.period);
  S sensible[pellucid::field_count<P>], numbers[pellucid::field_count<P>];
  pellucid::to_numbers(typical_params<P>(), sensible);
  change(bytes, sensible, numbers);
  return pellucid::from_numbers<P>(numbers);
}

/// Samples of a joint that moves, one a period.
template <class S> class Stream {
 public:
  explicit Stream(S period) : micros_(period > S(0) && period < S(1) ? static_cast<std::int64_t>(period * S(1e6)) : 1000) {
    in_.position.value = S(1.2);
    in_.torque.valid = in_.interaction.valid = in_.muscle.valid = true;
  }
  const pellucid::Samples<S>& sample() const { return in_; }
  bool resets() const { return resets_; }  ///< whether the law is to be reset before this sample

  /// The next sample; false when there are no more bytes.
  bool next(Bytes& bytes) {
    in_.position.valid = true;
    resets_ = false;
    in_.position.value = place_;
    if (run_ == 0 && !bytes.any()) return false;
    in_.position.time = clock_ += micros_;
    in_.position.sequence = ++count_;
    if (run_ > 0) {
      --run_;
      move();
    } else {
      strange(bytes);
    }
    in_.torque.value = in_.interaction.value;
    for (pellucid::Sample<S>* other : {&in_.torque, &in_.interaction, &in_.muscle}) {
      other->time = in_.position.time;
      other->sequence = in_.position.sequence;
    }
    return true;
  }

 private:
  void move() {
    place_ = place_ + speed_ * S(1e-6) * static_cast<S>(micros_);
    if (place_ > S(2.4) || place_ < S(0.2)) speed_ = -speed_;
    in_.position.value = place_;
  }
  void strange(Bytes& bytes) {
    move();
    switch (bytes.byte() % 28) {
      case 0: in_.position.value = nonsense<S>(bytes); break;
      case 1: place_ = place_ + bytes.fraction<S>(); break;              // the encoder slips
      case 2: speed_ = S(0), run_ = bytes.byte(); break;                 // frozen, with fresh numbers
      case 3: again(); break;                                            // seen again
      case 4: in_.position.sequence = --count_; break;                            // a number seen again
      case 5: in_.position.time = clock_ -= micros_; break;                       // a time seen again
      case 6: in_.position.time = clock_ = bytes.anything<std::int64_t>() / 4; break;
      case 7: in_.position.time = clock_ += 100 * bytes.anything<std::int16_t>(); break;
      case 8: in_.position.sequence = count_ = bytes.anything<std::uint32_t>(); break;
      case 9: in_.position.sequence = count_ -= 2; break;
      case 10: in_.position.valid = false; break;
      case 11: in_.interaction.value = nonsense<S>(bytes); break;
      case 12: in_.muscle.value = nonsense<S>(bytes); break;
      case 13: in_.interaction.valid = !in_.interaction.valid; break;
      case 14: in_.muscle.valid = !in_.muscle.valid; break;
      case 15: in_.interaction.value = S(5) * bytes.fraction<S>(); break;
      case 16: in_.muscle.value = S(20) * bytes.fraction<S>(); break;
      case 17: case 18: case 19: resets_ = true; break;
      case 20: place_ = bytes.fraction<S>() + S(1.2), in_.position.value = place_, resets_ = true; break;
      default: speed_ = S(9) * bytes.fraction<S>(), run_ = bytes.byte();
    }
  }
  void again() {
    clock_ -= micros_;
    --count_;
    in_.position.time = clock_;
    in_.position.sequence = count_;
  }

  pellucid::Samples<S> in_{};
  S place_ = S(1.2), speed_ = S(0);
  std::int64_t micros_, clock_ = 1000000;
  std::uint32_t count_ = 0xffffff00u;  // wraps around on the way
  int run_ = 0;
  bool resets_ = false;
};
