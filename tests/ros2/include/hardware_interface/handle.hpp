// Stand-in for hardware_interface: handles of state and command interfaces, as in ros2_control 4.30.
#pragma once

#include <optional>
#include <string>

namespace hardware_interface {

class Handle {
 public:
  Handle(const std::string& prefix, const std::string& name, double* value)
      : name_(prefix + "/" + name), value_(value) {}
  const std::string& get_name() const { return name_; }
  template <typename T = double>
  [[nodiscard]] std::optional<T> get_optional() const {
    if (value_ == nullptr) return std::nullopt;
    return *value_;
  }

 protected:
  std::string name_;
  double* value_;
};

class StateInterface : public Handle {
 public:
  using Handle::Handle;
};

class CommandInterface : public Handle {
 public:
  using Handle::Handle;
  [[nodiscard]] bool set_value(double value) {
    if (value_ == nullptr) return false;
    *value_ = value;
    return true;
  }
};

using LoanedStateInterface = StateInterface;
using LoanedCommandInterface = CommandInterface;

}  // namespace hardware_interface
