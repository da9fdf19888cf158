// Stand-in for rclcpp: what an exported controller uses of it, with the documented signatures.
#pragma once

#include <cstdint>

namespace rclcpp {

class Duration {
 public:
  Duration(std::int32_t seconds, std::uint32_t nanoseconds) : nanoseconds_(1'000'000'000LL * seconds + nanoseconds) {}
  std::int64_t nanoseconds() const { return nanoseconds_; }

 private:
  std::int64_t nanoseconds_;
};

}  // namespace rclcpp
