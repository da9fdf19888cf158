// Virtual rigs as devices: a robot and somebody who wears it, moved on in real time.
#pragma once

#include "device.hpp"

namespace engine {

constexpr std::uint32_t watchdog_patience = 10;  // periods that a drive goes on without a beat
constexpr std::uint32_t power_off_periods = 3;   // until a drive that is to have no power has none

std::unique_ptr<Device> make_virtual_elbow(const Settings& settings);
std::unique_ptr<Device> make_virtual_knee(const Settings& settings);

}  // namespace engine
