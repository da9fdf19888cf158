// Whether memory still holds what was put there: a checksum that is gone through a little each period, a word kept twice.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// A word beside its complement.
struct TwinWord {
  std::uint32_t word = 0;
  std::uint32_t twin = ~std::uint32_t(0);
};
constexpr void put(TwinWord& t, std::uint32_t word) noexcept {
  t.word = word;
  t.twin = ~word;
}
constexpr bool is_whole(const TwinWord& t) noexcept { return t.word == ~t.twin; }

/// FNV-1a over 32-bit words.
constexpr std::uint32_t checksum_start = 2166136261u;
constexpr std::uint32_t checksum_of(std::uint32_t sum, std::uint32_t word) noexcept { return (sum ^ word) * 16777619u; }

constexpr std::uint32_t words_a_step = 12;

/// How far a checksum has come.
struct ChecksumState {
  std::uint32_t sealed = 0;               ///< what it must be
  std::uint32_t sum = checksum_start;     ///< checksum of the words so far
  std::uint32_t next = 0;                 ///< the word that comes next
};

/// The word of a block of memory at a place.
template <class T> std::uint32_t word_at(const T& block, std::uint32_t at) noexcept {
  static_assert(std::is_trivially_copyable<T>::value && sizeof(T) % 4 == 0, "words of plain numbers");
  std::uint32_t word;
  __builtin_memcpy(&word, reinterpret_cast<const unsigned char*>(&block) + 4 * at, sizeof word);
  return word;
}

/// The checksum of a block where it lies.
template <class T> std::uint32_t checksum(const T& block) noexcept {
  std::uint32_t sum = checksum_start;
  for (std::uint32_t i = 0; i < sizeof(T) / 4; ++i) sum = checksum_of(sum, word_at(block, i));
  return sum;
}

constexpr std::uint32_t turned(std::uint32_t word, int bits) noexcept { return word << bits | word >> (32 - bits); }

/// A quick sum of a block that is gone through as a whole each period: every change of a single word changes it.
template <class T> std::uint32_t quick_sum(const T& block) noexcept {
  constexpr std::uint32_t words = sizeof(T) / 4;
  std::uint32_t even = checksum_start, odd = ~checksum_start;
  for (std::uint32_t i = 0; i + 1 < words; i += 2) {
    even = turned(even, 1) ^ word_at(block, i);
    odd = turned(odd, 1) ^ word_at(block, i + 1);
  }
  if (words % 2 != 0) even = turned(even, 1) ^ word_at(block, words - 1);
  return even ^ turned(odd, 13);
}

/// Some words further; false where the whole block came out otherwise than sealed.
template <class T> bool step(ChecksumState& s, const T& block) noexcept {
  constexpr std::uint32_t words = sizeof(T) / 4;
  std::uint32_t at = s.next < words ? s.next : 0;
  const std::uint32_t end = words - at < words_a_step ? words : at + words_a_step;
  std::uint32_t sum = s.sum;
  for (; at < end; ++at) sum = checksum_of(sum, word_at(block, at));
  const bool whole = at < words || sum == s.sealed;
  s.next = at < words ? at : 0;
  s.sum = at < words ? sum : checksum_start;
  return whole;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
