// An engine on memory of its own and a device that is played, stepped by hand on a clock that the test makes.
#pragma once

#include "check.hpp"
#include "law_numbers.hpp"

#include "../../engine/loop.hpp"

#include <cstring>
#include <limits>
#include <memory>

namespace bench {

namespace p = pellucid;
using engine::State;

constexpr std::int64_t period = 1000000;

/// A joint that moves as the test says.
class Played : public engine::Device {
 public:
  std::string open() override { return ""; }
  void read(std::uint64_t cycle, std::int64_t, engine::Reading& reading) noexcept override {
    const auto time = static_cast<std::int64_t>(cycle) * 1000;
    const auto sequence = static_cast<std::uint32_t>(cycle);
    reading.samples.position = {position, time, sequence, heard};
    reading.samples.torque = reading.samples.interaction = reading.samples.muscle = {0.0, time, sequence, true};
    reading.drive = {asked.effort, time, sequence, true};
    reading.joint = {position, time, sequence, true};
    reading.is_new = true;
  }
  void write(const engine::Asked& what) noexcept override { asked = what; }
  void close() noexcept override { closed = true; }
  void wear(bool on) noexcept override { worn = on; }
  void give(const engine::Task& task, double) noexcept override { target = task.target; }
  double position = 0.5, target = 0;
  bool heard = true, closed = false, worn = true;
  engine::Asked asked{};
};

inline engine::Condition condition(const char* name, bool powered) {
  engine::Condition made;
  made.name = name;
  if (!powered) {
    made.worn = false;
    return made;
  }
  made.kind = "joint";
  const auto params = typical_params<p::JointCompensationParams<double>>();
  made.numbers.resize(p::field_count<p::JointCompensationParams<double>>);
  p::to_numbers(params, made.numbers.data());
  p::SupervisorParams<double> rules;
  rules.healthy_samples = 10;
  rules.reset_delay = 0.01;
  made.supervisor.resize(p::field_count<p::SupervisorParams<double>>);
  p::to_numbers(rules, made.supervisor.data());
  const std::string wrong = made.make();
  check(wrong.empty(), wrong.c_str());
  return made;
}

/// An engine on memory of its own, stepped by hand.
struct Bench {
  std::unique_ptr<unsigned char[]> own;
  unsigned char* memory;
  engine::Settings settings;
  engine::Region region;
  Played device;
  engine::Command command{};
  std::unique_ptr<engine::Loop> loop;
  std::uint64_t cycle = 0;
  std::int64_t silent_from = std::numeric_limits<std::int64_t>::max();

  /// On `given` memory of a region, whose blocks before its events must be 0; none: on its own.
  explicit Bench(std::uint32_t run_before = 0, unsigned char* given = nullptr)
      : own(given != nullptr ? nullptr : new unsigned char[engine::region_bytes]()), memory(given != nullptr ? given : own.get()) {
    settings.conditions = {condition("a", true), condition("b", true), condition("free", false)};
    region.use(memory);
    region.header().period = period;
    command.run = run_before;
    send();
    loop = std::make_unique<engine::Loop>(settings, device, region);
  }
  void send() {
    ++command.sequence;
    command.heartbeat = static_cast<std::int64_t>(cycle) * period;
    std::uint64_t words[sizeof command / 8];
    std::memcpy(words, &command, sizeof command);
    command.checksum = words[sizeof command / 8 - 1] = engine::checksum(words);
    std::memcpy(memory + engine::command_offset, words, sizeof words);
  }
  void step(int cycles = 1) {
    for (int i = 0; i < cycles; ++i) {
      ++cycle;
      const std::int64_t deadline = static_cast<std::int64_t>(cycle) * period;
      if (deadline < silent_from) send();
      loop->cycle(cycle, deadline + 20000, deadline);
    }
  }
  engine::Record& last() { return region.record(region.header().records.load()); }
  void arm() {
    command.run = 0;
    step(2);
    command.run = 1;
    step(2);
  }
};

}  // namespace bench
