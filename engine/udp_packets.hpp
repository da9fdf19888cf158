// What travels between the engine and a device behind a network, little-endian, a datagram each (docs/design/live-engine.md).
#pragma once

#include "layout.hpp"

#include <cstring>

namespace engine {

constexpr std::uint32_t reading_magic = 0x31524c50u;  // "PLR1"
constexpr std::uint32_t asked_magic = 0x31414c50u;    // "PLA1"

/// Device to engine: everything that it measured at one time.
struct ReadingPacket {
  std::uint32_t magic = reading_magic, sequence = 0;
  std::uint32_t valid = 0;          ///< a bit for each value
  std::uint32_t reserved = 0;
  std::int64_t time_us = 0;         ///< on the device's own clock
  double value[value_count] = {};   ///< position, torque, interaction, muscle, drive, joint; SI
  std::uint64_t checksum = 0;       ///< FNV-1a over the 64-bit words before it
};
static_assert(sizeof(ReadingPacket) == 80, "packet");

/// Engine to device: what the drive is asked for.
struct AskedPacket {
  std::uint32_t magic = asked_magic, beat = 0;
  std::uint32_t enable = 0;         ///< 0: the drive must take its power off
  std::uint32_t answers = 0;        ///< sequence of the newest reading that the engine knows
  std::int64_t time_us = 0;         ///< since the engine's epoch
  double effort = 0;                ///< [N m]
  std::uint64_t checksum = 0;
};
static_assert(sizeof(AskedPacket) == 40, "packet");

template <class Packet> std::uint64_t packet_checksum(const Packet& packet) noexcept {
  std::uint64_t words[sizeof(Packet) / 8];
  std::memcpy(words, &packet, sizeof packet);
  std::uint64_t sum = checksum_start;
  for (std::size_t i = 0; i + 1 < sizeof(Packet) / 8; ++i) sum = (sum ^ words[i]) * 1099511628211u;
  return sum;
}

/// Whether the bytes are a whole packet of this kind; it is then in `packet`.
template <class Packet> bool unpack(const void* bytes, std::size_t size, Packet& packet) noexcept {
  if (size != sizeof packet) return false;
  Packet read;
  std::memcpy(&read, bytes, sizeof read);
  if (read.magic != packet.magic || read.checksum != packet_checksum(read)) return false;
  packet = read;
  return true;
}

}  // namespace engine
