// What a drive runs by itself: power only while a controller that counts its periods says so.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

struct Watchdog {
  std::uint32_t beat = 0;    ///< the last one heard
  std::uint32_t silent = 0;  ///< periods since it last changed
};

/// One period of the drive: whether it may give power, at the most so many periods after the last beat.
inline bool step(Watchdog& w, std::uint32_t beat, bool enable, std::uint32_t patience) noexcept {
  w.silent = beat != w.beat ? 0 : w.silent < 0xffffffffu ? w.silent + 1 : w.silent;
  w.beat = beat;
  return enable && w.silent <= patience;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
