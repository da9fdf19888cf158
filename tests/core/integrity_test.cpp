// Memory: a word and its twin, and a checksum that finds every changed bit within one round.
#include "check.hpp"

#include <pellucid/integrity.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

void twins() {
  p::TwinWord word;
  check(p::is_whole(word) && word.word == 0, "nothing is whole");
  p::put(word, 0x5afe0001u);
  check(p::is_whole(word) && word.word == 0x5afe0001u && word.twin == 0xa501fffeu, "a word beside its complement");
  for (int bit = 0; bit < 32; ++bit) {
    p::TwinWord lost = word, twin = word;
    lost.word ^= 1u << bit;
    twin.twin ^= 1u << bit;
    check(!p::is_whole(lost) && !p::is_whole(twin), "every bit counts");
  }
}

/// A word is what was put where either of the two still says so.
void said_by_either() {
  p::TwinWord word;
  p::put(word, 0x5afe0001u);
  for (const bool lost : {false, true})
    for (const bool twin_lost : {false, true}) {
      p::TwinWord one = word;
      if (lost) one.word ^= 4u;
      if (twin_lost) one.twin ^= 8u;
      check(p::says(one, 0x5afe0001u) == !(lost && twin_lost), "one of the two is enough");
      check(!p::says(one, 0x5afe0002u), "no other word is said");
    }
}

template <std::size_t N> struct Words {
  std::uint32_t word[N];
};

/// What is kept three times is what two of three say, bit by bit; a seal is that of the same words.
void votes_and_seals() {
  Words<5> value, other;
  Random random(8);
  for (std::uint32_t& word : value.word) word = static_cast<std::uint32_t>(random.bits());
  for (std::uint32_t& word : other.word) word = static_cast<std::uint32_t>(random.bits());
  for (int lost = 0; lost < 3; ++lost) {
    p::Thrice<Words<5>> kept;
    p::put(kept, value);
    kept.copy[lost] = other;
    const Words<5> found = p::voted(kept);
    for (int i = 0; i < 5; ++i) check(found.word[i] == value.word[i], "every word of the two that agree");
  }
  const p::ChecksumState sealed{p::checksum(value), p::checksum_start, 0};
  check(p::is_sealed(sealed, value) && !p::is_sealed(sealed, other), "its own words and no others");
}

/// As many steps as a round over N words takes, and when a bit that was lost is found.
template <std::size_t N> void rounds() {
  Words<N> block;
  Random random(3);
  for (std::uint32_t& word : block.word) word = static_cast<std::uint32_t>(random.bits());
  std::uint32_t sum = 2166136261u;
  for (const std::uint32_t word : block.word) sum = (sum ^ word) * 16777619u;
  check(p::checksum(block) == sum, "FNV-1a of its words");
  constexpr int steps = static_cast<int>((N + 11) / 12);
  p::ChecksumState s{p::checksum(block), p::checksum_start, 0};
  for (int round = 0; round < 3; ++round)
    for (int k = 0; k < steps; ++k) {
      check(p::step(s, block), "what is whole passes");
      check(s.next == (k + 1 < steps ? 12u * static_cast<std::uint32_t>(k + 1) : 0u), "twelve words a step");
    }
  for (std::size_t i = 0; i < N; ++i) {
    Words<N> lost = block;
    lost.word[i] ^= 1u << (i % 32);
    p::ChecksumState found{p::checksum(block), p::checksum_start, 0};
    int failed = 0;
    for (int k = 0; k < steps; ++k) failed += !p::step(found, lost);
    check(failed == 1, "found at the end of the round, once");
    check(found.sum == p::checksum_start, "then it begins anew");
  }
  p::ChecksumState lost{p::checksum(block), p::checksum_start, static_cast<std::uint32_t>(N)};
  for (int k = 0; k < steps; ++k) check(p::step(lost, block), "a place at the end is the beginning");
  lost.next = 0xfffffff0u;
  for (int k = 0; k < steps; ++k) check(p::step(lost, block), "and so is one beyond");
}

/// A block that is gone through as a whole: no change of a word, and no exchange of two, leaves its sum.
template <std::size_t N> void quick_sums() {
  Words<N> block;
  Random random(5);
  for (std::uint32_t& word : block.word) word = static_cast<std::uint32_t>(random.bits());
  const std::uint32_t sum = p::quick_sum(block);
  std::uint32_t even = 2166136261u, odd = ~2166136261u;
  for (std::size_t i = 0; i < N; ++i) {
    std::uint32_t& lane = i % 2 == 0 ? even : odd;
    lane = ((lane << 1) | (lane >> 31)) ^ block.word[i];
  }
  check(sum == (even ^ ((odd << 13) | (odd >> 19))), "two lanes, turned and crossed");
  for (std::size_t i = 0; i < N; ++i) {
    for (int bit = 0; bit < 32; ++bit) {
      Words<N> lost = block;
      lost.word[i] ^= 1u << bit;
      check(p::quick_sum(lost) != sum, "every bit of every word");
      lost.word[i] = static_cast<std::uint32_t>(random.bits());
      check(lost.word[i] == block.word[i] || p::quick_sum(lost) != sum, "every other word");
    }
    Words<N> swapped = block;
    swapped.word[i] = block.word[(i + 1) % N], swapped.word[(i + 1) % N] = block.word[i];
    check(N == 1 || p::quick_sum(swapped) != sum, "words in another order");
  }
}

}  // namespace

int main() {
  quick_sums<1>();
  quick_sums<2>();
  quick_sums<31>();
  quick_sums<68>();
  twins();
  said_by_either();
  votes_and_seals();
  rounds<1>();
  rounds<7>();
  rounds<11>();
  rounds<12>();
  rounds<13>();
  rounds<24>();
  rounds<31>();
  return failures();
}
