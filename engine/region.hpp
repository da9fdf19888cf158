// The mapped file of shared memory, as the engine sees it.
#pragma once

#include "layout.hpp"

#include <string>

namespace engine {

class Region {
 public:
  Region() = default;
  Region(const Region&) = delete;
  ~Region();
  /// Maps a file that the session has made; an empty text, or what is wrong.
  std::string open(const std::string& path);
  /// Uses memory of the caller, of `region_bytes`, for tests.
  void use(void* memory) noexcept { memory_ = static_cast<unsigned char*>(memory); }

  Header& header() noexcept { return *reinterpret_cast<Header*>(memory_); }
  Status& status() noexcept { return *reinterpret_cast<Status*>(memory_ + status_offset); }
  /// The place of the record with that number.
  Record& record(std::uint64_t number) noexcept {
    return reinterpret_cast<Record*>(memory_ + record_offset)[(number - 1) % record_capacity];
  }
  /// The command block as it is now; false where it is torn.
  bool read_command(Command& command) const noexcept;

 private:
  unsigned char* memory_ = nullptr;
  bool mapped_ = false;
};

constexpr std::size_t region_bytes = record_offset + sizeof(Record) * std::size_t(record_capacity);

}  // namespace engine
