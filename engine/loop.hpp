// One cycle of the engine: read everything, step the law under its supervisor, ask the drive, write the record.
//
// Its states and the changes between them are those of `pellucid/session_state.hpp`.
//
// No heap, no lock, no wait. Whatever is lost, the drive ends without power: a session that is not heard stops the law,
// an engine that is gone beats no more, and a condition changes only after the effort has ramped to 0.
#pragma once

#include "device.hpp"
#include "layout.hpp"
#include "region.hpp"

namespace engine {

class Loop {
 public:
  Loop(const Settings& settings, Device& device, Region& region);

  /// The cycle with this number, which began at `time` and should have at `deadline` [ns]. False: the session ended it.
  bool cycle(std::uint64_t number, std::int64_t time, std::int64_t deadline) noexcept;
  /// Takes the power off and closes the device.
  void end() noexcept;
  /// Deadlines that no cycle began at.
  void missed(std::uint64_t count) noexcept { status().missed += count; }
  State state() const noexcept { return state_; }

 private:
  Status& status() noexcept { return region_.status(); }
  void listen(std::int64_t time, std::uint32_t& flags) noexcept;
  void inject(Reading& reading, std::int64_t time) noexcept;
  void choose(std::uint32_t law) noexcept;
  Asked decide(const Reading& reading, std::int64_t now_us, std::uint32_t& flags, Record& record) noexcept;

  const Settings& settings_;
  Device& device_;
  Region& region_;
  std::vector<AnyLaw> law_;              // one: the law that runs, allocated once
  std::vector<double> numbers_;          // the numbers of that law, as adjusted
  Command command_{};
  enum class Doing { nothing, law, ramp };
  Doing doing_ = Doing::nothing;
  State state_ = State::disarmed;
  std::uint32_t chosen_ = 0, stops_seen_ = 0, adjusts_seen_ = 0, injections_seen_ = 0, beat_ = 0;
  bool armed_ = true;                    // false: nothing was armed since an operator's stop or reset; run must first be taken back
  bool session_was_heard_ = false;
  bool stop_is_due_ = false;
  std::uint32_t void_token_ = 0;         // token that came with the last stop: a stop voids it until another one is sent
  double effort_ = 0;
  pellucid::SupervisorOutput<double> out_{};
  Injection injection_ = Injection::none;
  std::int64_t injected_until_ = 0;
  Reading held_{};
  bool holds_ = false;
};

}  // namespace engine
