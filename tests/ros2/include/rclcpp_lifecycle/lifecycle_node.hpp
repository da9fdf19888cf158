// Stand-in for rclcpp_lifecycle.
#pragma once

#include "rclcpp/logging.hpp"

namespace rclcpp_lifecycle {

class LifecycleNode {
 public:
  const char* get_name() const { return "controller"; }
  rclcpp::Logger get_logger() const { return {}; }
};

}  // namespace rclcpp_lifecycle
