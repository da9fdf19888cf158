// Memory: a word and its twin, and a checksum that finds every changed bit within one round.
#include "check.hpp"

#include <pellucid/integrity.hpp>

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

template <std::size_t N> struct Words {
  std::uint32_t word[N];
};

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

}  // namespace

int main() {
  twins();
  rounds<1>();
  rounds<7>();
  rounds<11>();
  rounds<12>();
  rounds<13>();
  rounds<24>();
  rounds<31>();
  return failures();
}
