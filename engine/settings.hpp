// What the engine is started with: a text file, a line for each thing, numbers as hexadecimal floats so that no bit is lost.
//
//   pellucid-engine 1
//   period_ns 1000000
//   late_ns 500000
//   session_timeout_s 0.5
//   device virtual-elbow
//   numbers person 25 0x1.8p+1 ...      a device's numbers, by name
//   condition FC directional 1          name, law, whether the robot is worn; its numbers follow
//   law 31 ...
//   supervisor 102 ...
#pragma once

#include "laws.hpp"

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace engine {

struct Settings {
  std::int64_t period_ns = 1000000;
  std::int64_t late_ns = 500000;      ///< a cycle that begins later than this after its deadline is late
  double session_timeout = 0.5;       ///< without a sign of life of the session for so long, the law stops [s]
  std::uint64_t seed = 1;             ///< seed of a simulated wearer
  std::string device, address;        ///< kind of the device; "host:port" of one behind a network
  std::map<std::string, std::vector<double>> numbers;  ///< parameters of the device
  std::vector<Condition> conditions;

  /// Numbers by name; an empty list where there are none.
  const std::vector<double>& of(const std::string& name) const;
  /// One number by name.
  double one(const std::string& name, double otherwise) const;
};

/// Reads the file; an empty text, or what is wrong, with the line.
std::string read_settings(const std::string& path, Settings& settings);

}  // namespace engine
