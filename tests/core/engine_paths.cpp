// Every sequence of actions of a stated length on the engine's own code, on a simulated clock: `engine_paths LENGTH`.
//
// Who acts are the session (arms, disarms, stops, resets, chooses, adjusts, dies and comes back), the device (is silent,
// comes back) and whatever tears a command. Held after every cycle:
//
//   lease         no power later than 0.6 s after the last sign of life of the session
//   stop          no law that was told to stop runs again before a token that was sent after the stop, or a disarming
//   table         every change of state is one of the table of transitions
//   finite        an effort is a number within its limit, and none without power
//   whole         records are complete, and the state that they say is that of the engine
//
// It prints how many paths it tried, how many of these did not hold, the longest power after a last sign of life, and the
// longest time from a stop to the end of the law's own effort.
#include "engine_bench.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace {

using bench::Bench;
using bench::period;
using engine::State;

enum Action { arm, disarm, stop, reset, old_token, choose, adjust, die, live, deaf, hear, tear, action_count };
constexpr int block = 40;        // cycles after an action
constexpr int long_block = 700;  // after the session died

struct Found {
  long paths = 0, violations = 0;
  double powered_s = 0, stop_ms = 0;
};

void violate(Found& found, const char* what, const int* path, int length) {
  if (found.violations++ > 5) return;
  std::printf("violated: %s after", what);
  for (int i = 0; i < length; ++i) std::printf(" %d", path[i]);
  std::printf("\n");
}

void play(const int* path, int length, Found& found) {
  // Records of an earlier path are older than any of this one.
  static const std::unique_ptr<unsigned char[]> memory{new unsigned char[engine::region_bytes]()};
  std::memset(memory.get(), 0, engine::event_offset);
  Bench engine(0, memory.get());
  engine.settings.session_timeout = 0.5;
  bool alive = true, heard_stop = false, was_disarmed = true;
  std::uint32_t token_of_stop = 0;
  std::uint64_t heartbeat = 0, stopped_at = 0;
  State before = engine.loop->state();
  ++found.paths;
  const auto cycles = [&](int count) {
    for (int i = 0; i < count; ++i) {
      if (alive) heartbeat = engine.cycle + 1;
      engine.silent_from = alive ? std::numeric_limits<std::int64_t>::max() : 0;
      engine.device.position = 0.5 + 0.02 * std::sin(0.01 * static_cast<double>(engine.cycle));
      engine.step();
      const State now = engine.loop->state();
      const engine::Record& record = engine.last();
      const engine::Asked& asked = engine.device.asked;
      const double since = 1e-3 * static_cast<double>(engine.cycle - heartbeat);
      if (asked.enable && asked.effort != 0 && since > found.powered_s) found.powered_s = since;
      if (asked.enable && since > 0.6) violate(found, "power without a sign of life", path, length);
      if (!pellucid::may_follow(before, now)) violate(found, "a change that the table does not have", path, length);
      if (!std::isfinite(asked.effort) || std::fabs(asked.effort) > 1e3) violate(found, "no effort", path, length);
      if (!asked.enable && asked.effort != 0 && now == State::disarmed) violate(found, "an effort without power", path, length);
      if (record.number != record.number_again || record.state != static_cast<std::uint8_t>(now))
        violate(found, "a record that is not whole", path, length);
      if (heard_stop && now == State::running && engine.command.token == token_of_stop && !was_disarmed)
        violate(found, "a stop that was forgotten", path, length);
      if (stopped_at != 0 && now != State::running) {
        const double late = static_cast<double>(engine.cycle - stopped_at);
        if (late > found.stop_ms) found.stop_ms = late;
        stopped_at = 0;
      }
      if (now == State::running && engine.command.token != token_of_stop) heard_stop = false;
      before = now;
    }
  };
  cycles(3);
  for (int i = 0; i < length; ++i) {
    switch (path[i]) {
      case arm: engine.command.run = 1; break;
      case disarm: engine.command.run = 0; was_disarmed = true; break;
      case stop:
        ++engine.command.stops;
        heard_stop = true;
        was_disarmed = engine.command.run == 0;  // whoever arms after that has seen it
        token_of_stop = engine.command.token;
        if (alive && engine.loop->state() == State::running) stopped_at = engine.cycle;
        break;
      case reset: engine.command.token = engine.last().challenge; break;
      case old_token: engine.command.token = 12345; break;
      case choose: engine.command.law = engine.command.law == 0 ? 1u : engine.command.law == 1 ? 2u : 0u; break;
      case adjust: ++engine.command.adjusts; engine.command.adjusted_value = 0.5; break;
      case die: alive = false; break;
      case live: alive = true; break;
      case deaf: engine.device.heard = false; break;
      case hear: engine.device.heard = true; break;
      case tear: engine.memory[engine::command_offset + 40] ^= 0xff; break;
      default: break;
    }
    cycles(path[i] == die ? long_block : block);
  }
  engine.loop->end();
  if (engine.device.asked.enable || !engine.device.closed) violate(found, "an end with power", path, length);
}

}  // namespace

int main(int argc, char** argv) {
  const int length = argc > 1 ? std::atoi(argv[1]) : 3;
  if (length < 1 || length > 6) return 2;
  Found found;
  int path[7] = {arm};
  long count = 1;
  for (int i = 0; i < length; ++i) count *= action_count;
  // From power-on, and from a law that runs.
  for (int begun = 0; begun < 2; ++begun) {
    for (long k = 0; k < count; ++k) {
      long rest = k;
      for (int i = 0; i < length; ++i, rest /= action_count) path[begun + i] = static_cast<int>(rest % action_count);
      play(path, length + begun, found);
    }
    path[0] = arm;
  }
  std::printf("paths %ld\nviolations %ld\npowered_s %.3f\nstop_ms %.1f\n", found.paths, found.violations, found.powered_s, found.stop_ms);
  return found.violations == 0 && failures() == 0 ? 0 : 1;
}
