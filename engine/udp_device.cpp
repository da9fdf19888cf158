// A device behind a network: Simulink, a ros2_control node or a board, which send readings and get what is asked.
#include "device.hpp"
#include "host_clock.hpp"
#include "udp_packets.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <ctime>
#include <limits>

namespace engine {
namespace {

constexpr int max_packets = 64;  // that are read in a cycle

/// Listens at the port of "host:port" and answers whoever sent the last good packet; nobody else is heard from then on.
class UdpDevice : public Device {
 public:
  explicit UdpDevice(const Settings& settings) : address_(settings.address) {}
  ~UdpDevice() override { close(); }

  std::string open() override {
    const std::size_t colon = address_.rfind(':');
    const std::string host = address_.substr(0, colon), port = colon == std::string::npos ? "" : address_.substr(colon + 1);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(static_cast<std::uint16_t>(std::strtoul(port.c_str(), nullptr, 10)));
    if (colon == std::string::npos || at.sin_port == 0 || inet_pton(AF_INET, host.c_str(), &at.sin_addr) != 1)
      return "udp: found the address \"" + address_ + "\", expected one like 127.0.0.1:5005 to listen at";
    socket_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (socket_ < 0 || ::bind(socket_, reinterpret_cast<sockaddr*>(&at), sizeof at) != 0)
      return "udp: not able to listen at " + address_ + ": " + std::strerror(errno);
    return "";
  }

  void read(std::uint64_t, std::int64_t now_us, Reading& reading) noexcept override {
    unsigned char bytes[256];
    for (int i = 0; i < max_packets; ++i) {
      sockaddr_in from{};
      socklen_t length = sizeof from;
      const ssize_t size = ::recvfrom(socket_, bytes, sizeof bytes, 0, reinterpret_cast<sockaddr*>(&from), &length);
      if (size < 0) break;
      if (peered_ && (from.sin_addr.s_addr != peer_.sin_addr.s_addr || from.sin_port != peer_.sin_port) &&
          now_us - heard_us_ < peer_timeout_us)
        continue;
      ReadingPacket packet;
      if (!unpack(bytes, static_cast<std::size_t>(size), packet)) continue;
      // Out of order: an older one says nothing new. A device that was started again begins at a low number.
      if (peered_ && packet.sequence - last_.sequence > 0x7fffffffu && now_us - heard_us_ < peer_timeout_us) continue;
      peer_ = from;
      peered_ = true;
      heard_us_ = now_us;
      last_ = packet;
      stamp_us_ = clock_.host_time(packet.time_us, now_us);
      reading.is_new = true;
    }
    const auto sample = [this](std::size_t i) {
      return pellucid::Sample<double>{last_.value[i], stamp_us_, last_.sequence, peered_ && (last_.valid >> i & 1u) != 0};
    };
    reading.samples.position = sample(0);
    reading.samples.torque = sample(1);
    reading.samples.interaction = sample(2);
    reading.samples.muscle = sample(3);
    reading.drive = sample(4);
    reading.joint = sample(5);
    now_us_ = now_us;
  }

  void write(const Asked& asked) noexcept override {
    if (!peered_) return;
    AskedPacket packet;
    packet.beat = asked.beat;
    packet.enable = asked.enable ? 1 : 0;
    packet.answers = last_.sequence;
    packet.time_us = now_us_;
    packet.effort = asked.effort;
    packet.checksum = packet_checksum(packet);
    // What cannot be sent is lost; the device's watchdog then takes its power off.
    (void)!::sendto(socket_, &packet, sizeof packet, MSG_DONTWAIT, reinterpret_cast<sockaddr*>(&peer_), sizeof peer_);
  }

  void close() noexcept override {
    if (socket_ < 0) return;
    write({});
    ::close(socket_);
    socket_ = -1;
  }

 private:
  static constexpr std::int64_t peer_timeout_us = 500000;
  std::string address_;
  int socket_ = -1;
  sockaddr_in peer_{};
  bool peered_ = false;
  HostClock clock_;
  ReadingPacket last_{};
  std::int64_t stamp_us_ = 0, heard_us_ = 0, now_us_ = 0;
};

}  // namespace

std::unique_ptr<Device> make_udp_device(const Settings& settings) { return std::make_unique<UdpDevice>(settings); }

}  // namespace engine
