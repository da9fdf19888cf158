// The engine's cycle on a device that is played: who may arm it, what stops it, what a stop survives, and that nothing
// in it asks for memory. Beside it the clock and the packets of a device behind a network.
#include "engine_bench.hpp"

#include "../../engine/host_clock.hpp"
#include "../../engine/udp_packets.hpp"

#include <cstdlib>
#include <limits>
#include <memory>
#include <new>

// Whatever is asked for is counted, and given.
static long allocations = 0;
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  void* memory = std::malloc(size);
  if (memory == nullptr) std::abort();
  return memory;
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace {

namespace p = pellucid;
using engine::State;

using bench::Bench;
using bench::condition;
using bench::period;
using bench::Played;

bool is_safe(Bench& bench) { return p::meaning_of(bench.loop->state()).needs_reset || bench.loop->state() == State::disarmed; }

void arming() {
  Bench bench;
  bench.step(5);
  check(bench.loop->state() == State::disarmed && !bench.device.asked.enable, "an engine begins without a law");
  check(bench.last().number == 5 && bench.last().number_again == 5, "each cycle has its record");
  bench.arm();
  check(bench.loop->state() == State::running, "run after not run arms");
  check((bench.region.record(9).flags & engine::flag::began) != 0, "the record says where a law began");
  bench.step(200);
  check(std::fabs(bench.device.asked.effort) > 0.1 && bench.device.asked.enable, "the law carries the joint");
  check(bench.last().effort == bench.device.asked.effort, "the record has what was asked");

  Bench stale(1);
  stale.step(50);
  check(stale.loop->state() == State::disarmed, "a run that was asked before the engine began arms nothing");
}

void stops_by(const char* what, void (*spoil)(Bench&), std::uint64_t within) {
  Bench bench;
  bench.arm();
  bench.step(200);
  const std::uint64_t before = bench.cycle;
  spoil(bench);
  while (bench.loop->state() == State::running && bench.cycle < before + 3000) bench.step();
  check(p::meaning_of(bench.loop->state()).needs_reset && bench.cycle - before <= within, what);
  double effort = std::fabs(bench.device.asked.effort);
  // Nothing but the operator's token brings it back: not disarming, not arming, not another condition.
  for (int i = 0; i < 400; ++i) {
    bench.command.run = static_cast<std::uint32_t>(i / 7 % 2);
    bench.command.law = static_cast<std::uint32_t>(i / 11 % 3);
    bench.step();
    check(is_safe(bench) && std::fabs(bench.device.asked.effort) <= effort + 1e-12, "what has stopped only ever gives less");
    effort = std::fabs(bench.device.asked.effort);
  }
  check(effort == 0 && !bench.device.asked.enable, "what has stopped ends without effort and power");
}

void stops() {
  stops_by("a number that is none stops at once", [](Bench& b) { b.device.position = std::numeric_limits<double>::quiet_NaN(); }, 2);
  stops_by("a silent encoder stops at once", [](Bench& b) { b.device.heard = false; }, 2);
  stops_by("an operator stops at once", [](Bench& b) { ++b.command.stops; }, 2);
  stops_by("cycles that were missed stop the law", [](Bench& b) { b.cycle += 20; }, 22);
  stops_by("a silent session stops the law after its second",
           [](Bench& b) { b.silent_from = static_cast<std::int64_t>(b.cycle) * period; }, 1002);
}

void reset() {
  Bench bench;
  bench.arm();
  bench.step(100);
  ++bench.command.stops;
  bench.step(200);
  check(bench.loop->state() == State::stopped && bench.last().challenge != 0, "stopped, with a challenge");
  bench.command.token = bench.last().challenge ^ 1u;
  bench.step(300);
  check(bench.loop->state() == State::stopped, "a wrong token resets nothing");
  bench.command.token = bench.last().challenge;
  bench.command.run = 0;
  bench.step(300);
  check(bench.loop->state() == State::disarmed && !bench.device.asked.enable, "after a reset nothing runs until it is armed");
  bench.command.token = 0;
  bench.arm();
  check(bench.loop->state() == State::running, "and then it does");
}

void stop_during_a_reset() {
  Bench bench;
  bench.arm();
  bench.step(100);
  ++bench.command.stops;
  bench.step(3);
  bench.command.token = bench.last().challenge;
  bench.command.run = 0;
  bench.step(3);
  check(bench.loop->state() == State::stopped, "a reset waits for its delay");
  ++bench.command.stops;
  bench.step(2000);
  check(bench.loop->state() == State::stopped && bench.last().token == 0, "a stop voids a reset that waits");
  bench.command.token = 0;
  bench.step(2);
  bench.command.token = bench.last().challenge;
  bench.step(300);
  check(bench.loop->state() == State::disarmed, "a reset that is requested after the stop is granted");

  Bench silent;
  silent.arm();
  silent.step(100);
  ++silent.command.stops;
  silent.step(200);
  silent.silent_from = static_cast<std::int64_t>(silent.cycle) * period;
  silent.step(1100);
  silent.command.token = silent.last().challenge;
  silent.send();
  silent.cycle += 1500;  // the command is old when the engine reads it
  silent.step(300);
  check(silent.loop->state() == State::stopped, "a session that is silent resets nothing");
}

void stop_during_a_change() {
  Bench bench;
  bench.arm();
  bench.step(300);
  bench.command.law = 1;
  bench.step();
  check(bench.loop->state() == State::stopping, "the effort ramps down before another law begins");
  ++bench.command.stops;
  bench.step(2000);
  check(bench.loop->state() == State::disarmed && !bench.device.asked.enable, "a stop during a change holds the next law");
  bench.arm();
  check(bench.loop->state() == State::running, "until it is disarmed and armed again");
}

void conditions() {
  Bench bench;
  bench.arm();
  bench.step(300);
  const double full = std::fabs(bench.device.asked.effort);
  const double change = bench.settings.conditions[0].rate_limit * 1e-3;
  bench.command.law = 1;
  double before = full;
  int ramp = 0;
  while (bench.last().law == 0 && ramp < 1000) {
    bench.step();
    ++ramp;
    const double now = std::fabs(bench.device.asked.effort);
    if (bench.last().law == 0) check(now <= before && before - now <= change + 1e-12, "another condition waits until the effort has ramped to 0");
    before = now;
  }
  check(ramp >= static_cast<int>(full / change) && bench.last().law == 1, "the ramp has the law's rate");
  bench.step(3);
  check(bench.loop->state() == State::running, "the next law begins by itself");
  bench.command.law = 2;
  bench.step(200);
  check(bench.loop->state() == State::disarmed && !bench.device.worn && !bench.device.asked.enable, "a robot that is not worn has no power");
  bench.command.law = 99;
  bench.step(3);
  check(bench.last().law == 2, "a condition that does not exist is not chosen");

  Bench idle;
  idle.step(3);
  ++idle.command.stops;
  idle.command.run = 1;
  idle.step(20);
  check(idle.loop->state() == State::disarmed, "a stop while nothing runs holds what is armed with it");
  idle.arm();
  check(idle.loop->state() == State::running, "until it is disarmed and armed again");
}

void adjusting() {
  Bench bench;
  bench.arm();
  bench.step(300);
  std::uint32_t offset = 0;  // the first number of the law that is typically 0.1
  while (bench.settings.conditions[0].numbers[offset] != 0.1) ++offset;
  const double before = bench.device.asked.effort;
  bench.command.adjusted_field = offset;
  bench.command.adjusted_value = 1.1;
  ++bench.command.adjusts;
  bench.step();
  check((bench.last().flags & engine::flag::adjusted) != 0 && bench.last().adjusted_value == 1.1, "the record has the change");
  bench.step(100);
  check_close(bench.device.asked.effort - before, 1.0, 1e-3, "the offset is added");
  bench.command.run = 0;
  bench.step(1000);
  check(bench.loop->state() == State::disarmed, "a law is disarmed with a changed number");
  bench.arm();
  check(bench.last().adjusted_value != 1.1 || (bench.last().flags & engine::flag::adjusted) == 0, "a law that begins anew has its own numbers");
  bench.step(300);
  check_close(bench.device.asked.effort, before, 1e-3, "and not the change of its last run");
  bench.command.adjusted_value = std::numeric_limits<double>::quiet_NaN();
  ++bench.command.adjusts;
  bench.step(10);
  check(bench.loop->state() == State::running && (bench.last().flags & engine::flag::adjusted) == 0, "a number that is none changes nothing");
}

void torn_commands() {
  Bench bench;
  bench.arm();
  bench.step(50);
  bench.memory[engine::command_offset + 20] = 0x7f;  // half of another command
  for (int i = 0; i < 20; ++i) {
    ++bench.cycle;
    const std::int64_t deadline = static_cast<std::int64_t>(bench.cycle) * period;
    bench.loop->cycle(bench.cycle, deadline, deadline);
  }
  check(bench.loop->state() == State::running, "the last whole command holds");
  check(bench.region.status().torn_commands == 20 && (bench.last().flags & engine::flag::torn) != 0, "and it is said");
}

void late() {
  Bench bench;
  bench.loop->cycle(1, period + 600000, period);
  check(bench.region.status().late == 1 && (bench.last().flags & engine::flag::late) != 0, "late cycles are counted");
  bench.loop->cycle(2, 2 * period + 400000, 2 * period);
  check(bench.region.status().late == 1, "others are not");
  check(bench.region.status().worst_lateness == 600000, "the worst is kept");
}

void memory() {
  Bench bench;
  bench.arm();
  const long before = allocations;
  for (int i = 0; i < 2000; ++i) {
    bench.command.law = static_cast<std::uint32_t>(i / 500 % 3);
    bench.command.run = static_cast<std::uint32_t>(i % 300 > 3);
    bench.command.task = static_cast<std::uint32_t>(i / 100);
    if (i == 700) ++bench.command.stops;
    if (i > 900) bench.command.token = bench.last().challenge;
    bench.step();
  }
  check(allocations == before, "the loop asks for no memory");
  bench.loop->end();
  check(bench.device.closed && !bench.device.asked.enable, "at the end there is no power");
}

void injections() {
  Bench bench;
  bench.arm();
  bench.step(100);
  bench.command.injection = static_cast<std::uint32_t>(engine::Injection::clock_ahead);
  bench.command.injected_for = 0.05;
  ++bench.command.injections;
  bench.step();
  check(bench.loop->state() == State::faulted && (bench.last().flags & engine::flag::injected) != 0, "a clock that jumps ahead stops at once");
  check(bench.last().stamp_us[0] == static_cast<std::int64_t>(bench.cycle) * 1000 + 500000, "the record has what was put in");
  bench.step(100);
  check((bench.last().flags & engine::flag::injected) == 0, "and it ends");
}

void clocks() {
  engine::HostClock clock;
  Random random(1);
  std::int64_t worst = 0;
  for (int i = 0; i < 3000; ++i) {  // a device 1 h ahead, with delays of 100 to 400 us, whose clock gains 50 us a second
    const std::int64_t host = 1000 * i;
    const auto delay = static_cast<std::int64_t>(100 + random.bits() % 300);
    const std::int64_t device = host + 3600000000 + host / 20000;
    const std::int64_t told = clock.host_time(device, host + delay);
    check(told <= host + delay, "nothing is measured after it has arrived");
    if (i > 500) worst = std::max<std::int64_t>(worst, std::llabs(told - host));
  }
  check(worst <= 400, "the host's time of a sample is right within the delays");
  const std::int64_t jumped = clock.host_time(3000000 + 3600000000 + 500000, 3000000 + 200);
  check(jumped > 3000000 + 400000, "a clock that jumps ahead gives samples from the future");
  check(clock.jumps() == 0, "until it has agreed with nothing for a second");
  for (int i = 1; i < 1500; ++i) {
    const std::int64_t host = 3000000 + 1000 * i;
    (void)clock.host_time(host + 3600000000 + 500000, host + 200);
  }
  check(clock.jumps() == 1, "then it is learnt anew, and counted");
  check(std::llabs(clock.host_time(4500000 + 3600000000 + 500000, 4500000 + 200) - 4500200) <= 400, "and right again");
}

void packets() {
  engine::ReadingPacket packet;
  packet.sequence = 7;
  packet.value[0] = 0.5;
  packet.checksum = engine::packet_checksum(packet);
  engine::ReadingPacket read;
  check(engine::unpack(&packet, sizeof packet, read) && read.value[0] == 0.5, "a whole packet is read");
  unsigned char bytes[sizeof packet];
  for (std::size_t i = 0; i < sizeof packet; ++i) {
    std::memcpy(bytes, &packet, sizeof packet);
    bytes[i] = static_cast<unsigned char>(bytes[i] ^ 0x10);
    check(!engine::unpack(bytes, sizeof bytes, read), "a damaged one is not, whichever byte it is");
  }
  check(!engine::unpack(&packet, sizeof packet - 1, read), "nor a short one");
  engine::AskedPacket other;
  check(!engine::unpack(&packet, sizeof packet, other), "nor one of the other kind");
}

void bins() {
  std::size_t before = 0;
  for (std::int64_t ns = 1; ns < 4000000000; ns += 1 + ns / 7) {
    const std::size_t bin = engine::lateness_bin(ns);
    check(bin >= before && bin < engine::lateness_bins, "bins of lateness go up");
    before = bin;
  }
  check(engine::lateness_bin(-5) == 0 && engine::lateness_bin(1023) == 0 && engine::lateness_bin(1024) == 1, "the first ends at 1,024 ns");
  check(engine::lateness_bin(2047) == 4 && engine::lateness_bin(2048) == 5, "four an octave");
}

}  // namespace

int main() {
  arming();
  stops();
  reset();
  stop_during_a_reset();
  stop_during_a_change();
  conditions();
  adjusting();
  torn_commands();
  late();
  memory();
  injections();
  clocks();
  packets();
  bins();
  return failures() == 0 ? 0 : 1;
}
