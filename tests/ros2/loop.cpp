// A simulated hardware loop: plays the exported test vector through the controller as a controller manager would, and
// compares commands and states with the recorded outputs of the C export.
//
// PACKAGE is the name of the package, and SENSORS the law's sensors. For each fault it says whether it reached the
// lifecycle: `update` returned ERROR, or the law went on degraded.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "controller.hpp"
#include "replay.h"
#include "vector_outputs.h"

namespace {

using controller_interface::CallbackReturn;
using controller_interface::return_type;

const rclcpp_lifecycle::State state{};
const rclcpp::Duration period{0, 1'000'000};

class Open : public PACKAGE::Controller {
 public:
  void flip() { context_.storage[1] ^= std::uint64_t{1} << 40; }  // as `before` of replay.h does
  double added() const { return static_cast<double>(added_); }
  void init_again() { (void)on_configure(state); }
};

/// The controller, its hardware and its parameters from power-on.
class Loop {
 public:
  explicit Loop(const pellucid_config& config) {
    PACKAGE::Params& params = PACKAGE::given;
    params = {};
    PACKAGE::take(params, config);
    params.encoder_interface = "encoder";
#define NAME_SENSOR(SENSOR)                                       \
  params.sensors.SENSOR.interface = #SENSOR;                      \
  params.sensors.SENSOR.time_interface = #SENSOR "_time";         \
  params.sensors.SENSOR.sequence_interface = #SENSOR "_sequence"; \
  params.sensors.SENSOR.valid_interface = #SENSOR "_valid";
    SENSORS(NAME_SENSOR)
    if (controller.on_init() != CallbackReturn::SUCCESS) std::printf("no init\n");
    is_configured = controller.on_configure(state) == CallbackReturn::SUCCESS;
    told = controller.export_state_interfaces();
    references = controller.export_reference_interfaces();
    std::vector<hardware_interface::LoanedStateInterface> states;
    for (const std::string& name : controller.state_interface_configuration().names)
      states.emplace_back(name.substr(0, name.find('/')), name.substr(name.find('/') + 1), &values[name]);
    std::vector<hardware_interface::LoanedCommandInterface> commands;
    for (const std::string& name : controller.command_interface_configuration().names)
      commands.emplace_back(name.substr(0, name.find('/')), name.substr(name.find('/') + 1), &command);
    controller.assign_interfaces(std::move(commands), std::move(states));
    if (controller.on_activate(state) != CallbackReturn::SUCCESS) std::printf("no activation\n");
  }

  double& of(const std::string& name) { return values[PACKAGE::given.joint + "/" + name]; }

  return_type step(std::int64_t now_us) { return controller.update(rclcpp::Time{1000 * now_us}, period); }

  /// The exported state with this name; `fault`, `mode`, `enable`, `steps`, `challenge`.
  std::uint32_t state_of(std::size_t i) const { return static_cast<std::uint32_t>(told[i].get_optional().value()); }
  std::uint32_t said() const { return state_of(0) | state_of(1) << 8 | state_of(2) << 16; }

  Open controller;
  std::map<std::string, double> values;
  std::vector<hardware_interface::StateInterface> told;
  std::vector<hardware_interface::CommandInterface> references;
  double command = 0.0;
  bool is_configured = false;
};

void put(Loop& loop, const std::string& name, const vector_sample& sample) {
  loop.of(name) = static_cast<double>(float_of(sample.value_bits));
  loop.of(name + "_time") = static_cast<double>(sample.time_us) * 1e-6;
  loop.of(name + "_sequence") = static_cast<double>(sample.sequence);
  loop.of(name + "_valid") = sample.valid != 0 ? 1.0 : 0.0;
}

std::set<std::uint32_t> seen, reached;

/// A fault reaches the lifecycle where `update` returns ERROR within two seconds, or where the law goes on with less.
void follow(Loop& loop, std::int64_t now, std::uint32_t sequence, return_type answer) {
  const std::uint32_t fault = loop.state_of(0);
  if (fault == PELLUCID_NO_FAULT) return;
  seen.insert(fault);
  for (int i = 0; i < 2000 && answer == return_type::OK && loop.state_of(1) != PELLUCID_MODE_DEGRADED; ++i) {
    now += 1000;
    ++sequence;
#define FRESHEN(SENSOR)                                         \
  loop.of(#SENSOR "_time") = static_cast<double>(now) * 1e-6;   \
  loop.of(#SENSOR "_sequence") = static_cast<double>(sequence);
    SENSORS(FRESHEN)
    answer = loop.step(now);
  }
  if (answer == return_type::ERROR || loop.state_of(1) == PELLUCID_MODE_DEGRADED) reached.insert(fault);
}

}  // namespace

int main() {
  std::unique_ptr<Loop> loop;
  unsigned wrong = 0;
  std::uint32_t challenge = 0;
  const char* names[] = {
#define NAME(SENSOR) #SENSOR,
      SENSORS(NAME)};
  for (int i = 0; i < vector_length; ++i) {
    const vector_row& row = vector_inputs[i];
    if (row.before >= 16) {
      loop = std::make_unique<Loop>(variant_of(row.before));
      challenge = 0;
    }
    if (row.before == 2) loop->controller.init_again();
    if (row.before == 3) loop->controller.flip();
    PACKAGE::given.stop = row.before == 1;
    PACKAGE::given.reset_token = row.token != 0 ? static_cast<std::int64_t>(challenge) : 0;
    for (int s = 0; s < vector_sensors; ++s) put(*loop, names[s], row.sample[s]);
    loop->of("effort") = static_cast<double>(static_cast<float>(loop->command) + float_of(row.drive_bits));
    loop->of("encoder") = 0.0;
    const return_type answer = loop->step(row.now_us);
    challenge = loop->state_of(4);
    if (bits_of(static_cast<float>(loop->command)) != vector_outputs[i].effort_bits ||
        loop->said() != vector_outputs[i].said)
      ++wrong;
    if (i + 1 == vector_length || vector_inputs[i + 1].before >= 16)
      follow(*loop, row.now_us, row.sample[0].sequence, answer);
  }

  // Numbers that the supervisor refuses fail the configuration; a latched fault the activation without its token.
  pellucid_config odd = pellucid_identified;
  odd.period = -1.0f;
  const bool is_refused = !Loop{odd}.is_configured;
  Loop stopped{variant_of(16)};
  PACKAGE::given.stop = true;
  (void)stopped.step(1'000'000);
  PACKAGE::given.stop = false;
  const bool kept = stopped.controller.on_activate(state) == CallbackReturn::FAILURE;
  PACKAGE::given.reset_token = stopped.state_of(4);
  const bool let = stopped.controller.on_activate(state) == CallbackReturn::SUCCESS;

  for (std::uint32_t fault : seen)
    if (reached.count(fault) == 0) std::printf("not reached: %u\n", static_cast<unsigned>(fault));

  // With the token the law runs again after its delay, in which no update fails.
  bool is_reset = true;
  for (int i = 0; i < 100; ++i) {
    put(stopped, names[0], {0u, static_cast<std::uint32_t>(i), 3'000'000 + 1000 * i, 1u});
    is_reset = is_reset && stopped.step(3'000'000 + 1000 * i) == return_type::OK;
  }
  is_reset = is_reset && stopped.state_of(0) == PELLUCID_NO_FAULT && stopped.state_of(1) == PELLUCID_MODE_RUNNING;

  // The reference of a preceding controller is added within its limit, where one is set.
  (void)stopped.controller.set_chained_mode(true);
  const auto with = [&stopped](double limit, double reference) {
    static std::int64_t now = 3'100'000;
    PACKAGE::given.reference_limit = limit;
    now += 1000;
    (void)stopped.references[0].set_value(reference);
    stopped.of("position_sequence") += 1.0;
    stopped.of("position_time") = static_cast<double>(now) * 1e-6;
    (void)stopped.step(now);
    return stopped.controller.added();
  };
  const double alone = with(0.0, 0.5), added = with(1.0, 0.5), limited = with(1.0, 5.0);
  const bool is_added = alone == 0.0 && std::abs(added - 0.5) < 1e-6 && std::abs(limited - 1.0) < 1e-6;

  std::printf(
      "steps %d\nwrong %u\nfaults %zu\nreached %zu\nrefused %d\nactivation %d\nreset %d\nreference %d\n", vector_length,
      wrong, seen.size(), reached.size(), is_refused && stopped.is_configured ? 1 : 0, kept && let ? 1 : 0,
      is_reset ? 1 : 0, is_added ? 1 : 0);
  return 0;
}
