// Stand-in for rclcpp: a log that is written to the standard error.
#pragma once

#include <cstdio>

namespace rclcpp {

class Logger {};

}  // namespace rclcpp

#define RCLCPP_LOG_AS(LEVEL, LOGGER, ...) \
  do {                                    \
    (void)(LOGGER);                       \
    std::fprintf(stderr, LEVEL ": ");     \
    std::fprintf(stderr, __VA_ARGS__);    \
    std::fprintf(stderr, "\n");           \
  } while (0)
#define RCLCPP_INFO(LOGGER, ...) RCLCPP_LOG_AS("info", LOGGER, __VA_ARGS__)
#define RCLCPP_WARN(LOGGER, ...) RCLCPP_LOG_AS("warning", LOGGER, __VA_ARGS__)
#define RCLCPP_ERROR(LOGGER, ...) RCLCPP_LOG_AS("error", LOGGER, __VA_ARGS__)
