// Virtual rigs as devices: a robot and somebody who wears it, moved on in real time.
#pragma once

#include "device.hpp"

namespace engine {

std::unique_ptr<Device> make_virtual_elbow(const Settings& settings);
std::unique_ptr<Device> make_virtual_knee(const Settings& settings);

}  // namespace engine
