// What a drive runs by itself: power only while a controller that counts its periods says so.
#pragma once

#include "integrity.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

struct Watchdog {
  std::uint32_t beat = 0;    ///< the last one heard
  std::uint32_t silent = 0;  ///< periods since it last changed
  std::uint32_t check = 0;   ///< checksum of both; a difference shows corrupted memory
};
/// Expected checksum of a watchdog.
constexpr std::uint32_t check_of(const Watchdog& w) noexcept { return turned(w.beat, 7) ^ w.silent; }

/// One period of the drive: whether it may give power, at the most so many periods after the last beat. Where memory
/// lost a bit there is none until the next beat.
inline bool step(Watchdog& w, std::uint32_t beat, bool enable, std::uint32_t patience) noexcept {
  const bool whole = w.check == check_of(w);
  w.silent = !whole ? 0xffffffffu : beat != w.beat ? 0 : w.silent < 0xffffffffu ? w.silent + 1 : w.silent;
  w.beat = beat;
  w.check = check_of(w);
  if (!whole) return false;
  return enable && w.silent <= patience;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
