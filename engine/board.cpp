// A virtual rig behind a network.
#include "board.hpp"

#include "device.hpp"
#include "udp_packets.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace engine {
namespace {

constexpr std::int64_t foreign_clock_us = 86400000000;  // this board has been on for a day: its clock is not the engine's

std::int64_t now_ns() noexcept {
  timespec at{};
  clock_gettime(CLOCK_MONOTONIC, &at);
  return std::int64_t(at.tv_sec) * 1000000000 + at.tv_nsec;
}

}  // namespace

std::string run_board(const std::string& settings_path, const std::string& address, const std::string& log_path,
                      const volatile int& ends) {
  Settings settings;
  std::string wrong = read_settings(settings_path, settings);
  if (!wrong.empty()) return wrong;
  const std::unique_ptr<Device> device = make_device(settings, wrong);
  if (!device) return wrong;
  sockaddr_in to{};
  to.sin_family = AF_INET;
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || inet_pton(AF_INET, address.substr(0, colon).c_str(), &to.sin_addr) != 1)
    return "found the address \"" + address + "\", expected one like 127.0.0.1:5005";
  to.sin_port = htons(static_cast<std::uint16_t>(std::strtoul(address.c_str() + colon + 1, nullptr, 10)));
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket < 0) return std::strerror(errno);

  std::FILE* log = log_path.empty() ? nullptr : std::fopen(log_path.c_str(), "wb");
  if (!log_path.empty() && log == nullptr) return log_path + ": " + std::strerror(errno);

  // Whoever wears it follows a slow sine, so that there is a motion without a session.
  Task task;
  task.kind = TaskKind::track;
  task.target = 1.2;
  task.amplitude = 0.3;
  task.frequency = 0.3;
  device->give(task, 0.0);
  const std::int64_t epoch = now_ns(), period = settings.period_ns;
  AskedPacket last;
  std::uint32_t sequence = 0;
  for (std::uint64_t cycle = 1; ends == 0; ++cycle) {
    const std::int64_t deadline = epoch + static_cast<std::int64_t>(cycle) * period;
    const timespec at{static_cast<time_t>(deadline / 1000000000), static_cast<long>(deadline % 1000000000)};
    if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr) == EINTR) continue;
    unsigned char bytes[256];
    for (;;) {
      const ssize_t size = ::recv(socket, bytes, sizeof bytes, 0);
      if (size < 0) break;
      if (unpack(bytes, static_cast<std::size_t>(size), last) && log != nullptr) (void)!std::fwrite(&last, sizeof last, 1, log);
    }
    device->write({last.effort, last.beat, last.enable != 0});
    const std::int64_t now_us = (now_ns() - epoch) / 1000;
    Reading reading;
    device->read(cycle, now_us, reading);
    ReadingPacket packet;
    packet.sequence = ++sequence;
    packet.time_us = foreign_clock_us + static_cast<std::int64_t>(cycle) * (period / 1000);
    const pellucid::Sample<double> samples[value_count] = {reading.samples.position, reading.samples.torque,
                                                           reading.samples.interaction, reading.samples.muscle,
                                                           reading.drive, reading.joint};
    for (std::size_t i = 0; i < value_count; ++i) {
      packet.value[i] = samples[i].value;
      packet.valid |= samples[i].valid ? 1u << i : 0u;
    }
    packet.checksum = packet_checksum(packet);
    (void)!::sendto(socket, &packet, sizeof packet, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  device->close();
  if (log != nullptr) std::fclose(log);
  ::close(socket);
  return "";
}

}  // namespace engine
