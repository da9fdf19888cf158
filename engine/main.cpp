// pellucid-engine: law, supervisor, recorder's ring and deadline in one process that nothing else can delay.
//
//   pellucid-engine SETTINGS REGION [--ordinary]   runs until the session ends it, or SIGTERM
//   pellucid-engine --bare PERIOD_NS SECONDS       sleeps and counts, and does nothing else: what the machine allows
//   pellucid-engine --board SETTINGS HOST:PORT [LOG]   the virtual rig of the settings as a device that an engine listens to
//   pellucid-engine --layout                       where each word of the region lies, as JSON
//
// Deadlines are absolute, nothing spins before them, and a late cycle leaves the next where it was. Where the system
// permits it, the process has the priority SCHED_FIFO 80 and its memory is locked; otherwise the status says why not.
#include "board.hpp"
#include "loop.hpp"

#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <type_traits>
#include <vector>

namespace {

using namespace engine;

constexpr int priority = 80;
constexpr std::int64_t orphan_ns = 2000000000;  // for which an engine goes on after its session's death

static_assert(std::is_same<std::sig_atomic_t, int>::value, "a signal's flag is shared with the board");
volatile std::sig_atomic_t ends = 0;
void end_soon(int) { ends = 1; }

std::int64_t now() noexcept {
  timespec at{};
  clock_gettime(CLOCK_MONOTONIC, &at);
  return std::int64_t(at.tv_sec) * 1000000000 + at.tv_nsec;
}

void sleep_until(std::int64_t deadline) noexcept {
  const timespec at{static_cast<time_t>(deadline / 1000000000), static_cast<long>(deadline % 1000000000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr) == EINTR && ends == 0) {
  }
}

/// Result of the system call: 0, or errno.
struct Permitted {
  int fifo = 0, lock = 0;
};
Permitted ask_for_priority(bool ordinary) {
  Permitted found;
  if (ordinary) return {ECANCELED, ECANCELED};
  const sched_param param{priority};
  if (sched_setscheduler(0, SCHED_FIFO, &param) != 0) found.fifo = errno;
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) found.lock = errno;
  return found;
}

int run_bare(std::int64_t period, double seconds, bool ordinary) {
  const Permitted permitted = ask_for_priority(ordinary);
  std::vector<std::int64_t> kept;
  kept.reserve(static_cast<std::size_t>(1e9 * seconds / static_cast<double>(period)) + 16);
  std::uint64_t late = 0, missed = 0;
  const std::int64_t start = now();
  std::int64_t deadline = start + 10 * period;
  while (ends == 0 && deadline < start + static_cast<std::int64_t>(1e9 * seconds)) {
    sleep_until(deadline);
    const std::int64_t lateness = now() - deadline;
    if (kept.size() < kept.capacity()) kept.push_back(lateness);
    late += lateness > period / 2;
    deadline += period;
    while (deadline <= now()) deadline += period, ++missed;
  }
  std::sort(kept.begin(), kept.end());
  const auto at = [&kept](double share) {
    return kept.empty() ? 0LL : static_cast<long long>(kept[static_cast<std::size_t>(share * static_cast<double>(kept.size() - 1))]);
  };
  std::printf("{\"cycles\": %zu, \"late\": %llu, \"missed\": %llu, \"median\": %lld, \"p99\": %lld, \"worst\": %lld, \"fifo_error\": %d, \"lock_error\": %d}\n",
              kept.size(), static_cast<unsigned long long>(late), static_cast<unsigned long long>(missed), at(0.5), at(0.99), at(1.0),
              permitted.fifo, permitted.lock);
  return 0;
}

int print_layout() {
  std::printf("{\"region_bytes\": %zu, \"blocks\": {\"status\": %zu, \"command\": %zu, \"recorder\": %zu, \"events\": %zu, \"records\": %zu},\n",
              region_bytes, status_offset, command_offset, recorder_offset, event_offset, record_offset);
  std::printf("\"sizes\": {\"header\": %zu, \"status\": %zu, \"command\": %zu, \"recorder\": %zu, \"event\": %zu, \"record\": %zu},\n",
              sizeof(Header), sizeof(Status), sizeof(Command), sizeof(RecorderStatus), sizeof(Event), sizeof(Record));
#define PLACE(type, field) std::printf("\"" #type "." #field "\": %zu,\n", offsetof(type, field))
  PLACE(Header, epoch), PLACE(Header, period), PLACE(Header, records), PLACE(Header, events);
  PLACE(Record, cycle), PLACE(Record, time), PLACE(Record, deadline), PLACE(Record, now_us), PLACE(Record, value);
  PLACE(Record, stamp_us), PLACE(Record, sequence), PLACE(Record, valid), PLACE(Record, flags), PLACE(Record, law);
  PLACE(Record, token), PLACE(Record, effort), PLACE(Record, fault), PLACE(Record, mode), PLACE(Record, enable);
  PLACE(Record, state), PLACE(Record, beat), PLACE(Record, challenge), PLACE(Record, task), PLACE(Record, target);
  PLACE(Record, limb_position), PLACE(Record, limb_velocity), PLACE(Record, muscle_torque), PLACE(Record, flexor);
  PLACE(Record, extensor), PLACE(Record, drive_torque), PLACE(Record, velocity), PLACE(Record, adjusted_value);
  PLACE(Record, torque_estimate), PLACE(Record, torque_half_width), PLACE(Command, torque_estimate), PLACE(Command, torque_half_width);
  PLACE(Record, adjusted_field), PLACE(Record, task_kind), PLACE(Record, compute), PLACE(Record, number_again);
  PLACE(Event, time), PLACE(Event, length), PLACE(Event, text), PLACE(Event, number_again);
  PLACE(Status, heartbeat), PLACE(Status, cycle), PLACE(Status, records), PLACE(Status, late), PLACE(Status, missed);
  PLACE(Status, worst_lateness), PLACE(Status, worst_compute), PLACE(Status, command_sequence), PLACE(Status, torn_commands);
  PLACE(Status, state), PLACE(Status, law), PLACE(Status, fault), PLACE(Status, mode), PLACE(Status, enable);
  PLACE(Status, challenge), PLACE(Status, ended), PLACE(Status, fifo), PLACE(Status, locked), PLACE(Status, fifo_error), PLACE(Status, lock_error);
  PLACE(Status, effort_limit), PLACE(Status, rate_limit), PLACE(Status, velocity_limit), PLACE(Status, position_min);
  PLACE(Status, position_max), PLACE(Status, started), PLACE(Status, device_silent), PLACE(Status, lateness);
  PLACE(Command, heartbeat), PLACE(Command, law), PLACE(Command, run), PLACE(Command, stops), PLACE(Command, token);
  PLACE(Command, end), PLACE(Command, adjusts), PLACE(Command, adjusted_field), PLACE(Command, adjusted_law);
  PLACE(Command, adjusted_value), PLACE(Command, task), PLACE(Command, task_kind), PLACE(Command, target);
  PLACE(Command, amplitude), PLACE(Command, duration), PLACE(Command, reaction), PLACE(Command, frequency);
  PLACE(Command, share), PLACE(Command, load), PLACE(Command, injections), PLACE(Command, injection);
  PLACE(Command, injected_for), PLACE(Command, checksum);
  PLACE(RecorderStatus, heartbeat), PLACE(RecorderStatus, records), PLACE(RecorderStatus, events);
  PLACE(RecorderStatus, sealed), PLACE(RecorderStatus, recording);
#undef PLACE
  std::printf("\"version\": %u}\n", region_version);
  return 0;
}

int run(const char* settings_path, const char* region_path, bool ordinary) {
  Settings settings;
  std::string wrong = read_settings(settings_path, settings);
  Region region;
  if (wrong.empty()) wrong = region.open(region_path);
  std::unique_ptr<Device> device;
  if (wrong.empty()) device = make_device(settings, wrong);
  if (wrong.empty() && region.header().period != settings.period_ns)
    wrong = std::string(region_path) + ": found another period, expected that of the settings";
  if (!wrong.empty()) {
    std::fprintf(stderr, "pellucid-engine: %s\n", wrong.c_str());
    return 2;
  }
  Status& status = region.status();
  Loop loop(settings, *device, region);
  const Permitted permitted = ask_for_priority(ordinary);
  status.fifo = permitted.fifo == 0;
  status.locked = permitted.lock == 0;
  status.fifo_error = permitted.fifo;
  status.lock_error = permitted.lock;
  status.started = now();
  status.process = static_cast<std::uint64_t>(getpid());

  // An engine whose session died has nobody who could stop it or start it again: its law is stopped after the session's
  // silence, and it ends. The system gives such a process another parent (src/pellucid/live/setup.py).
  const char* const said = std::getenv("PELLUCID_SESSION_PROCESS");
  const long session = said == nullptr ? 0 : std::strtol(said, nullptr, 10);
  std::int64_t orphaned = 0;

  const std::int64_t epoch = region.header().epoch, period = settings.period_ns;
  std::uint64_t number = static_cast<std::uint64_t>((now() - epoch) / period) + 2;
  while (ends == 0) {
    const std::int64_t deadline = epoch + static_cast<std::int64_t>(number) * period;
    sleep_until(deadline);
    if (!loop.cycle(number, now(), deadline)) break;
    // The next begins at its own deadline; those that have passed are missed.
    const auto passed = static_cast<std::uint64_t>((now() - epoch) / period);
    const std::uint64_t next = passed + 1 > number + 1 ? passed + 1 : number + 1;
    loop.missed(next - number - 1);
    number = next;
    if (session == 0 || getppid() == session) continue;
    if (orphaned == 0) orphaned = now();
    if (now() - orphaned > orphan_ns) break;
  }
  loop.end();
  if (orphaned != 0) unlink(region_path);
  return 0;
}

}  // namespace

int main(int count, char** words) {
  std::signal(SIGTERM, end_soon);
  std::signal(SIGINT, SIG_IGN);  // of the terminal's group: the session ends its engine itself
  const bool ordinary = count > 2 && std::strcmp(words[count - 1], "--ordinary") == 0;
  if (ordinary) --count;
  if (count == 2 && std::strcmp(words[1], "--layout") == 0) return print_layout();
  if (count == 4 && std::strcmp(words[1], "--bare") == 0)
    return run_bare(std::max<std::int64_t>(std::strtoll(words[2], nullptr, 10), 100000), std::strtod(words[3], nullptr), ordinary);
  if ((count == 4 || count == 5) && std::strcmp(words[1], "--board") == 0) {
    (void)ask_for_priority(ordinary);
    const std::string wrong = run_board(words[2], words[3], count == 5 ? words[4] : "", ends);
    if (!wrong.empty()) std::fprintf(stderr, "pellucid-engine: %s\n", wrong.c_str());
    return wrong.empty() ? 0 : 2;
  }
  if (count == 3) return run(words[1], words[2], ordinary);
  std::fprintf(stderr, "usage: pellucid-engine SETTINGS REGION [--ordinary] | --bare PERIOD_NS SECONDS [--ordinary] | --board SETTINGS HOST:PORT [LOG] | --layout\n");
  return 2;
}
