// Maps the region, and reads what the session asks.
#include "region.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace engine {

static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "counts are shared between processes");

Region::~Region() {
  if (mapped_) ::munmap(memory_, region_bytes);
}

std::string Region::open(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (file < 0) return path + ": " + std::strerror(errno);
  struct stat found {};
  const bool whole = ::fstat(file, &found) == 0 && static_cast<std::size_t>(found.st_size) == region_bytes;
  void* memory = whole ? ::mmap(nullptr, region_bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, file, 0) : MAP_FAILED;
  ::close(file);
  if (!whole) return path + ": found " + std::to_string(found.st_size) + " bytes, expected " + std::to_string(region_bytes);
  if (memory == MAP_FAILED) return path + ": " + std::strerror(errno);
  memory_ = static_cast<unsigned char*>(memory);
  mapped_ = true;
  const Header& h = header();
  if (std::memcmp(h.magic, region_magic, sizeof region_magic) != 0 || h.version != region_version ||
      h.record_bytes != sizeof(Record) || h.record_capacity != record_capacity || h.event_bytes != event_bytes ||
      h.event_capacity != event_capacity)
    return path + ": found no region of version " + std::to_string(region_version) + ", which this engine expects";
  // Pages are made now, and not in the loop. Sums of what was there: nothing is changed.
  volatile unsigned char sum = 0;
  for (std::size_t i = 0; i < region_bytes; i += 4096) sum = static_cast<unsigned char>(sum + memory_[i]);
  return "";
}

bool Region::read_command(Command& command) const noexcept {
  std::uint64_t words[sizeof(Command) / 8];
  const auto* from = reinterpret_cast<const std::uint64_t*>(memory_ + command_offset);
  for (int tries = 0; tries < 4; ++tries) {
    for (std::size_t i = 0; i < sizeof(Command) / 8; ++i) words[i] = __atomic_load_n(from + i, __ATOMIC_RELAXED);
    std::memcpy(&command, words, sizeof command);
    if (command.checksum == checksum(words)) return true;
  }
  return false;
}

}  // namespace engine
