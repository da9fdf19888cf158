// The engine's devices by name.
#include "device.hpp"

#include "virtual_rigs.hpp"

namespace engine {

std::unique_ptr<Device> make_udp_device(const Settings& settings);

std::unique_ptr<Device> make_device(const Settings& settings, std::string& wrong) {
  std::unique_ptr<Device> device;
  if (settings.device == "virtual-elbow") device = make_virtual_elbow(settings);
  else if (settings.device == "virtual-knee") device = make_virtual_knee(settings);
  else if (settings.device == "udp") device = make_udp_device(settings);
  else wrong = "device: found \"" + settings.device + "\", expected virtual-elbow, virtual-knee or udp";
  if (device) wrong = device->open();
  return wrong.empty() ? std::move(device) : nullptr;
}

}  // namespace engine
