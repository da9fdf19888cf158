// Stand-in for rclcpp: what an exported controller uses of it, with the documented signatures.
#pragma once

#include <cstdint>

namespace rclcpp {

class Time {
 public:
  explicit Time(std::int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
  std::int64_t nanoseconds() const { return nanoseconds_; }

 private:
  std::int64_t nanoseconds_;
};

}  // namespace rclcpp
