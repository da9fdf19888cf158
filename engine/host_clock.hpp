// Brings the times of a device's clock onto the engine's: the smallest delay that any packet had says the offset.
//
// A clock that drifts is followed at 100 us a second. One that jumps is not: its samples then come from the future or
// are too old, which the supervisor answers; only after a second without agreement the offset is learnt anew.
#pragma once

#include <cstdint>

namespace engine {

class HostClock {
 public:
  static constexpr std::int64_t learning_us = 200000;  ///< the offset may fall freely for so long
  static constexpr std::int64_t jump_us = 20000;       ///< a difference by more is no drift and no queue
  static constexpr std::int64_t patience_us = 1000000;
  static constexpr std::int64_t drift_divisor = 10000;  ///< 100 us a second

  /// The host's time of a sample that was measured at `device_us` and arrived at `host_us`.
  std::int64_t host_time(std::int64_t device_us, std::int64_t host_us) noexcept {
    const std::int64_t apart = host_us - device_us;
    if (!started_) {
      started_ = true;
      offset_ = apart;
      begun_ = agreed_ = leaked_ = host_us;
    }
    const bool learns = host_us - begun_ < learning_us;
    const std::int64_t change = apart - offset_;
    if (change > -jump_us && change < jump_us) agreed_ = host_us;
    if (change < 0 && (learns || change > -jump_us)) offset_ = apart;
    if (change > 0 && host_us - leaked_ >= drift_divisor) {
      offset_ += (host_us - leaked_) / drift_divisor;
      leaked_ = host_us;
    } else if (change <= 0) {
      leaked_ = host_us;
    }
    if (host_us - agreed_ > patience_us) {
      ++jumps_;
      offset_ = apart;
      begun_ = agreed_ = leaked_ = host_us;
    }
    return device_us + offset_;
  }
  std::int64_t offset_us() const noexcept { return offset_; }
  std::uint32_t jumps() const noexcept { return jumps_; }

 private:
  std::int64_t offset_ = 0, begun_ = 0, agreed_ = 0, leaked_ = 0;
  std::uint32_t jumps_ = 0;
  bool started_ = false;
};

}  // namespace engine
