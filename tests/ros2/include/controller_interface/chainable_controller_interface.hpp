// Stand-in for controller_interface, as in ROS 2 Jazzy: what the controller manager calls, and what a controller overrides.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hardware_interface/handle.hpp"
#include "rclcpp/duration.hpp"
#include "rclcpp/time.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"
#include "rclcpp_lifecycle/state.hpp"

namespace controller_interface {

enum class return_type : unsigned char { OK = 0, ERROR = 1 };
enum class CallbackReturn : unsigned char { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
enum class interface_configuration_type : unsigned char { ALL = 0, INDIVIDUAL = 1, NONE = 2 };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names = {};
};

class ControllerInterfaceBase {
 public:
  virtual ~ControllerInterfaceBase() = default;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_init() = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State&) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State&) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State&) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_error(const rclcpp_lifecycle::State&) { return CallbackReturn::SUCCESS; }

  void assign_interfaces(std::vector<hardware_interface::LoanedCommandInterface>&& commands,
                         std::vector<hardware_interface::LoanedStateInterface>&& states) {
    command_interfaces_ = std::move(commands);
    state_interfaces_ = std::move(states);
  }
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }

 protected:
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

 private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};

class ChainableControllerInterface : public ControllerInterfaceBase {
 public:
  std::vector<hardware_interface::CommandInterface> export_reference_interfaces() {
    return on_export_reference_interfaces();
  }
  std::vector<hardware_interface::StateInterface> export_state_interfaces() { return on_export_state_interfaces(); }
  bool set_chained_mode(bool chained) {
    chained_ = chained;
    return on_set_chained_mode(chained);
  }
  return_type update(const rclcpp::Time& time, const rclcpp::Duration& period) {
    if (!chained_ && update_reference_from_subscribers(time, period) != return_type::OK) return return_type::ERROR;
    return update_and_write_commands(time, period);
  }

 protected:
  virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() = 0;
  virtual std::vector<hardware_interface::StateInterface> on_export_state_interfaces() = 0;
  virtual bool on_set_chained_mode(bool) { return true; }
  virtual return_type update_reference_from_subscribers(const rclcpp::Time&, const rclcpp::Duration&) = 0;
  virtual return_type update_and_write_commands(const rclcpp::Time&, const rclcpp::Duration&) = 0;

  std::vector<double> reference_interfaces_;

 private:
  bool chained_ = false;
};

}  // namespace controller_interface
