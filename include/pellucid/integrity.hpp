// Whether memory still holds what was put there: a checksum that is gone through a little each period, a word kept twice,
// a value kept three times.
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
/// Whether a word was put there, whatever single bit was lost since.
constexpr bool says(const TwinWord& t, std::uint32_t word) noexcept { return t.word == word || t.twin == ~word; }

/// FNV-1a over 32-bit words.
constexpr std::uint32_t checksum_start = 2166136261u;
constexpr std::uint32_t checksum_of(std::uint32_t sum, std::uint32_t word) noexcept { return (sum ^ word) * 16777619u; }

constexpr std::uint32_t words_a_step = 12;

/// Progress of a checksum.
struct ChecksumState {
  std::uint32_t sealed = 0;               ///< expected value
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

/// A value that is kept three times, so that one bit that a memory loses is outvoted.
template <class T> struct Thrice {
  T copy[3]{};
};
template <class T> void put(Thrice<T>& kept, const T& value) noexcept {
  for (T& one : kept.copy) one = value;
}
/// The value that each bit has in at least two of three copies.
template <class T> T voted(const T& first, const T& second, const T& third) noexcept {
  T value{};
  for (std::uint32_t i = 0; i < sizeof(T) / 4; ++i) {
    const std::uint32_t a = word_at(first, i), b = word_at(second, i), c = word_at(third, i);
    const std::uint32_t word = (a & b) | (a & c) | (b & c);
    __builtin_memcpy(reinterpret_cast<unsigned char*>(&value) + 4 * i, &word, sizeof word);
  }
  return value;
}
template <class T> T voted(const Thrice<T>& kept) noexcept { return voted(kept.copy[0], kept.copy[1], kept.copy[2]); }

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

/// Whether the whole block is as it was sealed.
template <class T> bool is_sealed(const ChecksumState& s, const T& block) noexcept { return checksum(block) == s.sealed; }

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
