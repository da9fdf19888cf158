// A person and a robot that share nothing with the core, under the controller that `pellucid export` wrote.
//
// Semi-implicit integration: robot on elasto-plastic bristles behind a transmission with flexibility and backlash, two
// cuffs that harden and have slack, a limb with a muscle servo, reflexes, tremor and mishaps. Runs come as doubles on the
// standard input, results go as doubles to the standard output; see foreign_wearer.hpp.
#include "foreign_wearer.hpp"

#include "exported_law.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

namespace foreign {
namespace {

constexpr double pi = 3.14159265358979323846;
constexpr std::uint32_t watchdog_patience = 10;    // periods that the drive's watchdog waits
constexpr std::uint32_t off_periods = 3;           // periods until a drive without power gives nothing
constexpr double sample_age_s = 50e-6;             // age of a sample when the controller reads it
constexpr double brace_s = 0.15, brace_damping = 8.0, brace_limit = 25.0;             // s, N m s/rad, N m
constexpr double table_stiffness = 400.0, table_damping = 10.0, table_limit = 60.0;   // N m/rad, N m s/rad, N m
constexpr double stuck_torque = 5.0, wrong_offset = 3.0, rail_force = 30.0, rail_emg = 60.0, triple_limit = 15.0;  // N m
constexpr double fault_spasm_torque = 15.0, fault_spasm_s = 0.3, sine_frequency_hz = 2.5;
constexpr double learnt_limit = 15.0;               // of a lasting load [N m]
constexpr double table_s = 0.4, spasm_least_s = 0.1, spasm_most_s = 0.3;              // durations of mishaps
constexpr double rest_before_s = 1.5, rest_after_s = 4.0;  // of a wearer whose encoder freezes at rest
constexpr double felt_s = 0.1;                     // until a wearer reacts to what the arm has hit
constexpr double recent_s = 0.5;                   // what an alarm is told with
constexpr double lasting_rate = 5.0;               // of what lasts [1/s]
constexpr double settle_s = 0.8;                   // a wearer waits so long for the law before moving
constexpr double reset_after_s = 1.5;              // an operator answers a challenge after this time
constexpr double fastest_cycle_hz = 2.0;           // people go to and fro with the whole forearm hardly faster
constexpr double gear_width = 0.03;                 // speed over which a gear's friction before a spring turns [rad/s]
constexpr double gravity_m_s2 = 9.81;
constexpr std::size_t max_alarms = 400;            // of a life that are told one by one
constexpr std::size_t normal_count = 50021;        // numbers in the table of normal draws, a prime

std::vector<float> make_normals() {
  std::vector<float> made(normal_count);
  std::uint64_t s = 0x9e3779b97f4a7c15u;
  const auto uniform = [&s] {
    s = s * 6364136223846793005u + 1442695040888963407u;
    return (static_cast<double>(s >> 11) + 0.5) * 0x1p-53;
  };
  for (float& x : made) x = static_cast<float>(std::sqrt(-2.0 * std::log(uniform())) * std::cos(2.0 * pi * uniform()));
  return made;
}
const std::vector<float> normals = make_normals();

/// Random numbers of one purpose, so that a fault does not shift what else is drawn.
struct Random {
  std::uint64_t state;
  Random(double seed, std::uint64_t purpose)
      : state((static_cast<std::uint64_t>(seed) + 1) * 0x9e3779b97f4a7c15u ^ purpose * 0xd1342543de82ef95u) {
    for (int i = 0; i < 4; ++i) uniform();
  }
  double uniform() {
    state = state * 6364136223846793005u + 1442695040888963407u;
    std::uint64_t x = state ^ (state >> 29);
    x *= 0xbf58476d1ce4e5b9u;
    return static_cast<double>((x ^ (x >> 32)) >> 11) * 0x1p-53;
  }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double after(double mean) { return mean > 0.0 ? -mean * std::log(1.0 - uniform()) : 1e18; }
};

double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }
double round_to(double x, double quantum) { return quantum > 0.0 ? quantum * std::nearbyint(x / quantum) : x; }

/// Position, velocity and acceleration along a way of 1.
struct Along {
  double s, v, a;
};
Along minimum_jerk(double x) {
  if (x <= 0.0) return {0.0, 0.0, 0.0};
  if (x >= 1.0) return {1.0, 0.0, 0.0};
  const double x2 = x * x, x3 = x2 * x;
  return {x3 * (10.0 - 15.0 * x + 6.0 * x2), 30.0 * x2 * (1.0 - 2.0 * x + x2), 60.0 * x * (1.0 - 3.0 * x + 2.0 * x2)};
}

/// The shapes of a reach over its duration of 1: minimum jerk, half a cosine, a trapezoid of speed, an overshoot, two
/// submovements, and three cycles there and back.
constexpr int shape_count = 6;
Along along(int shape, double x) {
  if (x <= 0.0) return {0.0, 0.0, 0.0};
  if (x >= 1.0) return {shape == 5 ? 0.0 : 1.0, 0.0, 0.0};
  if (shape == 1) return {0.5 * (1.0 - std::cos(pi * x)), 0.5 * pi * std::sin(pi * x), 0.5 * pi * pi * std::cos(pi * x)};
  if (shape == 2) {
    constexpr double ramp = 0.25, top = 1.0 / (1.0 - ramp);
    if (x < ramp) return {0.5 * top * x * x / ramp, top * x / ramp, top / ramp};
    if (x <= 1.0 - ramp) return {top * (x - 0.5 * ramp), top, 0.0};
    const double left = 1.0 - x;
    return {1.0 - 0.5 * top * left * left / ramp, top * left / ramp, -top / ramp};
  }
  if (shape == 3) {
    const Along out = minimum_jerk(x / 0.65), back = minimum_jerk((x - 0.65) / 0.35);
    return {1.08 * out.s - 0.08 * back.s, 1.08 * out.v / 0.65 - 0.08 * back.v / 0.35,
            1.08 * out.a / (0.65 * 0.65) - 0.08 * back.a / (0.35 * 0.35)};
  }
  if (shape == 4) {
    const Along first = minimum_jerk(x / 0.6), second = minimum_jerk((x - 0.5) / 0.5);
    return {0.85 * first.s + 0.15 * second.s, 0.85 * first.v / 0.6 + 0.15 * second.v / 0.5,
            0.85 * first.a / 0.36 + 0.15 * second.a / 0.25};
  }
  if (shape == 5) {
    const double w = 6.0 * pi, fade = std::sin(pi * x), fade_v = pi * std::cos(pi * x);
    return {0.5 * fade * (1.0 - std::cos(w * x)), 0.5 * (fade_v * (1.0 - std::cos(w * x)) + fade * w * std::sin(w * x)),
            0.5 * (-pi * pi * fade * (1.0 - std::cos(w * x)) + 2.0 * fade_v * w * std::sin(w * x) + fade * w * w * std::cos(w * x))};
  }
  return minimum_jerk(x);
}
constexpr double fastest_of_shape[shape_count] = {1.875, 1.571, 1.334, 3.12, 2.66, 10.0};  // largest speed over mean

/// One way after another: where somebody wants to be.
struct Reference {
  double from = 0, way = 0, begin = 0, duration = 1;
  int shape = 0;
  double q = 0, v = 0, a = 0;
  void start(double to, double now, double lasts, int what) {
    from = q;
    way = to - q;
    begin = now;
    duration = lasts;
    shape = what;
  }
  void at(double now) {
    const Along one = along(shape, (now - begin) / duration);
    q = from + way * one.s;
    v = way * one.v / duration;
    a = way * one.a / (duration * duration);
  }
};

struct Memory {
  pellucid_context context;
  pellucid_watchdog watchdog;
};
Memory memory;

enum Event { reach, brace, impact, load, spasm, doffing };

class Simulation {
 public:
  Simulation(const Run& run, std::vector<float>& work, std::vector<float>& effort)
      : r(run), habits(run.seed, 1), noise(run.seed, 2), mishaps(run.seed, 3), jitters(run.seed, 4), reference_work(work), reference_effort(effort) {
    std::memset(&memory, 0, sizeof memory);
    switch_on();
    kind = static_cast<Fault>(static_cast<int>(std::max(r.kind, 0.0)));
    life = r.kind < 0.0;
    is_reference = r.kind == 0.0;
    link = motor = limb = geared = r.start_position;
    wanted.q = wanted.from = hand.q = hand.from = r.start_position;
    fault_state = static_cast<std::uint64_t>(r.fault_seed);
    odd = static_cast<std::uint64_t>(r.fault_seed) % 2 != 0;
    dt = r.period / r.substeps;
    const double moving = r.rotor_share > 0.0 ? r.rotor_share * r.inertia : r.inertia;
    bristle = std::max(r.bristle_stiffness, 1e-9);
    bristle_drag = 2.0 * r.bristle_damping * std::sqrt(bristle * moving);
    if (r.worn == 0.0) strapped = 0.0, held = rests_alone() ? 0.0 : 1.0;
    next_brace = 2.0 + mishaps.after(r.brace_interval);
    next_impact = 2.0 + mishaps.after(r.impact_interval);
    next_load = 2.0 + mishaps.after(r.load_interval);
    next_spasm = 2.0 + mishaps.after(r.spasm_interval);
    next_doff = 4.0 + mishaps.after(r.doff_interval);
    // Muscles hold what they must from the start: the limb, and what the law does not carry yet.
    muscle = r.worn != 0.0 ? r.limb_gravity * std::sin(limb) : 0.0;
    encoder = encoder_before = motor;
  }

  Result live() {
    Result result{};
    result.early = result.found = result.safe = result.started = -1.0;
    result.energy_start = energy();
    const bool trial = !life && !is_reference;
    const double longest = trial ? r.onset + r.seconds : r.seconds;
    const std::size_t count = static_cast<std::size_t>(std::llround(longest / r.period));
    const std::size_t begins = static_cast<std::size_t>(std::llround(r.onset / r.period));
    if (is_reference) reference_work.assign(count + 1, 0.0f), reference_effort.assign(count + 1, 0.0f);
    double work = 0, work_begin = 0, distance = 0, before_command = 0;
    std::size_t pauses = 0, compared = 0, k = 0;
    out.mode = PELLUCID_MODE_START_UP;
    for (; k < count; ++k) {
      now = r.period * static_cast<double>(k);
      on = trial && k >= begins;
      begins_now = trial && k == begins;
      since = on ? now - r.onset : 0.0;
      if (begins_now) work_begin = work;
      act(distance, pauses);
      sense_and_step();
      integrate();
      work += r.period * std::max(-pull * limb_velocity, 0.0);
      if (is_reference) reference_work[k] = static_cast<float>(work), reference_effort[k] = static_cast<float>(drive_effort);
      const bool acted = out.fault != 0;
      const bool in_force = out.mode == PELLUCID_MODE_RUNNING || out.mode == PELLUCID_MODE_DEGRADED;
      if (in_force) {
        result.running += r.period;
        result.ringing += std::fabs(out.effort - before_command);
        if (result.started < 0.0) result.started = now;
      }
      if (r.traced != 0.0 && k % 2 == 0)
        trace.push_back({encoder, 0.5 * (asked_last + asked_earlier), in_force ? 1.0 : 0.0,
                         on ? since : -1.0, on ? surplus_at(k, work - work_begin, begins) : 0.0});
      asked_earlier = asked_last;
      asked_last = out.effort;
      before_command = out.effort;
      remember();
      if (life) {
        tell_alarm(acted, result);
        continue;
      }
      if (acted && !on) {
        result.early = now;
        result.fault = out.fault;
        result.mode = out.mode;
        break;
      }
      if (!on) continue;
      result.peak = std::max(result.peak, std::fabs(pull));
      if (k < reference_effort.size()) {
        const double surplus = surplus_at(k, work - work_begin, begins);
        if (result.safe < 0.0) result.excess = std::max(result.excess, surplus);
        result.deviation += std::fabs(drive_effort - static_cast<double>(reference_effort[k]));
        ++compared;
      }
      const bool hung = off > 0 && !acted;
      if ((acted || hung) && result.found < 0.0) {
        result.found = since;
        result.fault = acted ? out.fault : -1.0;
        result.mode = out.mode;
      }
      const bool held_back = out.mode == PELLUCID_MODE_DAMPED_STOP || out.mode == PELLUCID_MODE_DEGRADED;
      if (result.found >= 0.0 && (held_back || drive_effort == 0.0)) {
        result.safe = since;
        result.mode = out.mode;
        break;
      }
    }
    result.lived = r.period * static_cast<double>(k);
    if (result.early < 0.0 && result.found < 0.0) result.mode = out.mode;
    result.reached = pauses > 0 ? distance / static_cast<double>(pauses) : -1.0;
    result.ringing = result.running > 0.0 ? result.ringing * r.period / result.running : 0.0;
    result.deviation = compared > 0 ? result.deviation / static_cast<double>(compared) : 0.0;
    float answer;
    std::memcpy(&answer, reinterpret_cast<const unsigned char*>(memory.context.storage) + memory_map().test_middle, sizeof answer);
    result.answer = static_cast<double>(answer);
    float said[6] = {};
    result.probe_windows = static_cast<double>(pellucid_probe_answer(&memory.context, said));
    double* const seen[] = {&result.seen_probe_answer_low_real,    &result.seen_probe_answer_low_imaginary,
                            &result.seen_probe_answer_middle_real, &result.seen_probe_answer_middle_imaginary,
                            &result.seen_probe_answer_high_real,   &result.seen_probe_answer_high_imaginary};
    for (int i = 0; i < 6; ++i) *seen[i] = static_cast<double>(said[i]);
    result.energy_end = energy();
    return result;
  }

  std::vector<Alarm> alarms;
  std::vector<Traced> trace;

 private:
  /// Whether a machine that nobody wears stays where it is: nobody holds it while its drive is tested.
  bool rests_alone() const { return r.gravity_sine == 0.0 && r.gravity_cosine == 0.0; }

  /// Starts the controller: with its test's bounds and the probe's answers where the robot was commissioned.
  void switch_on() const {
    pellucid_config config = exported_config();
    if (r.test_most > 0.0) config.test_least = static_cast<float>(r.test_least), config.test_most = static_cast<float>(r.test_most);
    if (r.probe_answer_error > 0.0) {
      config.probe_answer_error = static_cast<float>(r.probe_answer_error);
      config.probe_answer_low_real = static_cast<float>(r.probe_answer_low_real);
      config.probe_answer_low_imaginary = static_cast<float>(r.probe_answer_low_imaginary);
      config.probe_answer_middle_real = static_cast<float>(r.probe_answer_middle_real);
      config.probe_answer_middle_imaginary = static_cast<float>(r.probe_answer_middle_imaginary);
      config.probe_answer_high_real = static_cast<float>(r.probe_answer_high_real);
      config.probe_answer_high_imaginary = static_cast<float>(r.probe_answer_high_imaginary);
    }
    if (r.probe_travel > 0.0) config.probe_travel = static_cast<float>(r.probe_travel);
    if (r.probe_scale > 0.0) config.probe_effort *= static_cast<float>(r.probe_scale);
    pellucid_init(&memory.context, &config);
  }

  double reference_at(std::size_t k) const { return k > 0 && k <= reference_work.size() ? static_cast<double>(reference_work[k - 1]) : 0.0; }

  /// By how much positive work since the onset is more than that of the reference [J].
  double surplus_at(std::size_t k, double work, std::size_t begins) const {
    return k < reference_work.size() ? work - (static_cast<double>(reference_work[k]) - reference_at(begins)) : 0.0;
  }

  /// What the wearer, the operator and mishaps do in this period.
  void act(double& distance, std::size_t& pauses) {
    const bool in_force = out.mode == PELLUCID_MODE_RUNNING || out.mode == PELLUCID_MODE_DEGRADED;
    if (!in_force) law_since = -1.0;
    else if (law_since < 0.0) law_since = now;
    if (r.worn == 0.0 && rests_alone()) {
      if (held == 0.0 && in_force) hand.q = link, hand.start(link, now, 1.0, 0);
      held = in_force ? 1.0 : 0.0;
    }
    token = 0;
    // A law that goes on without a sensor is switched off and on again: it asks for no answer.
    if (life && out.mode == PELLUCID_MODE_DEGRADED && now - alarm_at > 5.0) {
      std::memset(&memory, 0, sizeof memory);
      switch_on();
    }
    if (life && out.challenge != 0 && now - alarm_at > reset_after_s) token = out.challenge;
    Reference& mover = strapped > 0.0 || r.worn == 0.0 ? (r.worn != 0.0 ? wanted : hand) : hand;
    const bool ready = r.passive == 0.0 && law_since >= 0.0 && now - law_since > settle_s && !(life && out.fault != 0);
    const bool pauses_for_fault = kind == Fault::encoder_frozen_at_rest && now > r.onset - rest_before_s && now < r.onset + rest_after_s;
    if (ready && !pauses_for_fault && now >= next_task && now >= doff_until) {
      if (tasks > 0) {
        distance += std::fabs((r.worn != 0.0 ? limb : link) - mover.q);
        ++pauses;
      }
      ++tasks;
      plan(mover);
    }
    // Draws are made even where they are not used, so that a fault does not shift what comes later.
    wanted.at(now);
    hand.at(now);
    mishap(ready);
  }

  void plan(Reference& mover) {
    const double target = habits.between(r.target_low, r.target_high);
    const double drawn = habits.between(r.fastest_duration, r.slowest_duration);
    const int drawn_shape = std::min(static_cast<int>(habits.uniform() * shape_count), shape_count - 1);
    const int shape = r.reaching != 0.0 && drawn_shape == 5 ? 0 : drawn_shape;
    const double pause = habits.between(0.2, r.longest_pause);
    const double way = std::fabs(target - mover.q);
    double least = fastest_of_shape[shape] * way / (r.speed_share * r.velocity_limit);
    if (shape == 5) least = std::max(least, 3.0 / fastest_cycle_hz);
    const double lasts = std::max(drawn, least);
    mover.start(target, now, lasts, shape);
    next_task = now + lasts + pause;
  }

  void mishap(bool ready) {
    extra = 0.0;
    if (r.worn == 0.0) return;
    if (r.passive == 0.0) extra += r.tremor_amplitude * std::sin(2.0 * pi * std::fmod(r.tremor_frequency * now, 1.0));
    const bool free = ready && event == reach;
    if (free && now >= next_brace) begin(brace, brace_s, next_brace, r.brace_interval);
    else if (free && now >= next_impact && std::fabs(limb_velocity) > 0.5) {
      begin(impact, table_s, next_impact, r.impact_interval);
      table_at = limb;
      table_way = limb_velocity < 0.0 ? -1.0 : 1.0;
      felt_at = now + felt_s;
    } else if (free && now >= next_load) {
      begin(load, mishaps.between(3.0, 8.0), next_load, r.load_interval);
    } else if (free && now >= next_spasm) {
      begin(spasm, mishaps.between(spasm_least_s, spasm_most_s), next_spasm, r.spasm_interval);
      spasm_torque = (mishaps.uniform() < 0.5 ? -1.0 : 1.0) * mishaps.between(0.3, 1.0) * r.spasm_torque;
    } else if (free && now >= next_doff) {
      begin(doffing, mishaps.between(6.0, 14.0), next_doff, r.doff_interval);
      doff_until = event_end + 1.0;
      hand.q = link;
      hand.start(mishaps.between(r.target_low, r.target_high), now + 1.0, 3.0, 0);
      next_task = now + 1.5;
    }
    if (event != reach && now >= event_end) {
      if (event == load) carried = 0.0;
      if (event == doffing) next_task = now + 1.2;
      last_event = event;
      last_event_end = now;
      event = reach;
    }
    // Whoever stops, or hits something and feels it, goes on from there.
    if (event == brace && now < event_end - brace_s + 0.5 * r.period) stay(event_end + 0.3);
    if (event == impact && felt_at > 0.0 && now >= felt_at) {
      felt_at = 0.0;
      stay(event_end + 0.3);
    }
    if (event == brace) extra -= r.strength * clamp(brace_damping * limb_velocity, -brace_limit, brace_limit);
    if (event == impact) extra -= table_way * table(table_way * (limb - table_at), table_way * limb_velocity);
    if (event == load) carried = r.load_mass;
    if (event == spasm) extra += spasm_torque;
    // Taken off within 0.3 s, put on again within 0.5 s, by a hand that holds the robot meanwhile.
    const bool away = event == doffing && now < event_end - 1.0;
    if (event == doffing && !away && !aligning) {
      aligning = true;
      wanted.start(hand.q, now, 0.8, 0);
    }
    if (event != doffing) aligning = false;
    const double step = r.period / (away ? 0.3 : 0.5);
    const bool closing = event != doffing && !away;
    if (away) strapped = std::max(strapped - step, 0.0), held = std::min(held + step, 1.0);
    else if (closing && (strapped < 1.0 || held > 0.0)) {
      // Whoever puts it on closes the cuffs where the limb lies.
      if (strapped == 0.0) askew = limb - link;
      strapped = std::min(strapped + step, 1.0);
      held = std::max(held - step, 0.0);
      askew -= askew * r.period / 0.5;
    }
    if (on) {
      if (kind == Fault::wearer_spasm && since < fault_spasm_s) extra = r.strength * (odd ? -fault_spasm_torque : fault_spasm_torque);
      if (kind == Fault::wearer_blocked) {
        if (begins_now) table_at = limb, table_way = limb_velocity < 0.0 ? -1.0 : 1.0;
        extra -= table_way * table(table_way * (limb - table_at), table_way * limb_velocity);
      }
      if (kind == Fault::strap_opens) strapped = 0.0;
    }
  }

  void stay(double until) {
    wanted.q = limb;
    wanted.start(clamp(limb, r.target_low, r.target_high), now, 0.4, 0);
    next_task = std::max(next_task, until);
  }

  double table(double depth, double speed) const {
    return depth > 0.0 ? r.strength * clamp(table_stiffness * depth + table_damping * speed, 0.0, table_limit) : 0.0;
  }

  void begin(Event what, double lasts, double& next, double mean) {
    event = what;
    event_end = now + lasts;
    next = event_end + mishaps.after(mean);
  }

  double normal() { return static_cast<double>(normals[static_cast<std::size_t>(noise.uniform() * normal_count)]); }

  /// Sensors, the exported controller, the drive's watchdog and the drive.
  void sense_and_step() {
    const double noises[] = {normal(), normal(), normal(), normal()};
    encoder = round_to(motor + r.encoder_noise * noises[0], r.encoder_quantum);
    double force = round_to(r.force_gain * force_filter + r.force_offset + r.force_noise * noises[1], r.force_quantum);
    double current = round_to(r.current_gain * measured(current_filter) + r.current_offset + r.current_noise * noises[2],
                              r.current_quantum);
    if (begins_now && kind == Fault::current_spike) {
      const double size = (0.2 + 5.0 * static_cast<double>(fault_state / 7 % 1000) / 1000.0) * r.drive_limit;
      current += odd ? -size : size;
    }
    const double muscles = muscle_now >= 0.0 ? r.emg_flexor_gain * muscle_now : r.emg_extensor_gain * muscle_now;
    emg += r.period / (r.emg_lag + r.period) * (muscles * (1.0 + r.emg_noise * noises[3]) - emg);
    double muscle_reading = round_to(emg + r.emg_offset, r.emg_quantum);
    // Behind a spring the second encoder is the motor's.
    double joint = round_to(r.spring_stiffness > 0.0 ? geared : link, r.encoder_quantum);
    ++ticks;
    std::int64_t clock = static_cast<std::int64_t>(std::llround(1e6 * (now + 1.0) + r.clock_start + 1e6 * r.clock_jitter * (2.0 * jitters.uniform() - 1.0)));
    if (r.clock_bits == 32.0) clock = static_cast<std::int64_t>(static_cast<std::uint32_t>(clock));
    pellucid_input input{};
    input.token = token;
    sample(input.position, encoder, clock);
    sample(input.drive, current, clock);
    sample(input.joint, joint, clock);
    pellucid_sample interaction{}, emg_sample{};
    sample(interaction, force, clock);
    sample(emg_sample, muscle_reading, clock);
    const pellucid_sample late = past[ticks % 20];
    past[ticks % 20] = input.position;
    input.now_us = clock;
    if (on) spoil(input, interaction, emg_sample, late.sequence != 0 ? late : input.position);
    else last_position = input.position, last_force = interaction;
#ifdef FOREIGN_HAS_INTERACTION
    input.interaction = interaction;
#endif
#ifdef FOREIGN_HAS_MUSCLE
    input.muscle = emg_sample;
#endif
#ifdef FOREIGN_HAS_TORQUE
    // A spring shows its own torque: the sensor that its torque loop regulates on.
    sample(input.torque, round_to(r.current_gain * drive_effort + r.current_offset, r.current_quantum), clock);
#endif
    const bool hangs = on && (kind == Fault::task_hangs || (kind == Fault::cycle_overrun && since < 0.03) ||
                              (kind == Fault::rate_half && ticks % 2 != 0) || (kind == Fault::rate_quarter && ticks % 4 != 0));
    if (!hangs) pellucid_step(&memory.context, &input, &out);
    if (on && kind == Fault::rate_twice) pellucid_step(&memory.context, &input, &out);
    if (on && kind == Fault::rate_double) {
      // Half a period later, with samples of their own.
      const std::int64_t half = static_cast<std::int64_t>(0.5e6 * r.period);
      pellucid_sample* const read[] = {&input.position, &input.drive, &input.joint};
      for (pellucid_sample* one : read) one->time_us += half, one->sequence += 1;
      input.now_us += half;
      pellucid_step(&memory.context, &input, &out);
    }
    const bool power = pellucid_watchdog_step(&memory.watchdog, out.steps, out.enable, watchdog_patience) != 0;
    off = power ? 0 : off + 1;
    const double asked_now = r.passive != 0.0 ? 0.0 : clamp(static_cast<double>(out.effort), -r.drive_limit, r.drive_limit);
    commands[ticks % 4] = asked_now;
    const double asked = commands[(ticks + 4 - static_cast<std::size_t>(r.dead_cycles)) % 4];
    target_effort = given(asked);
    if (off >= off_periods) {
      target_effort = drive_effort = loop_integral = 0.0;
      geared = link;
      geared_velocity = link_velocity;
    }
  }

  void sample(pellucid_sample& into, double value, std::int64_t clock) const {
    into.value = static_cast<float>(value);
    into.sequence = 2 * ticks;
    into.time_us = clock - static_cast<std::int64_t>(1e6 * sample_age_s);
    into.valid = 1;
  }

  /// What a fault does to samples, clock and memory.
  void spoil(pellucid_input& input, pellucid_sample& f, pellucid_sample& m, const pellucid_sample& late) {
    pellucid_sample& q = input.position;
    if (begins_now) held_position = last_position.sequence != 0 ? last_position : q, held_force = last_force, mirror = q.value;
    const float sign = odd ? -1.0f : 1.0f;
    const auto at = [](std::size_t byte) { return reinterpret_cast<unsigned char*>(memory.context.storage) + byte; };
    static const MemoryMap map = memory_map();
    switch (kind) {
      case Fault::encoder_frozen: case Fault::encoder_frozen_at_rest: q.value = held_position.value; break;
      case Fault::encoder_repeats: q = held_position; break;
      case Fault::encoder_nan: q.value = std::nanf(""); break;
      case Fault::encoder_jump: q.value += sign; break;
      case Fault::encoder_slip: q.value += 0.1f * sign; break;
      case Fault::encoder_drift: case Fault::encoder_drift_two: q.value += 0.02f * sign * static_cast<float>(since); break;
      case Fault::encoder_flipped: case Fault::encoder_flipped_two: q.value = 2.0f * mirror - q.value; break;
      case Fault::encoder_far: q.value += 5.0f; break;
      case Fault::encoder_noise: q.value += 0.002f * 1.7320508f * static_cast<float>(2.0 * drawn() - 1.0); break;
      case Fault::encoder_half: case Fault::encoder_half_two: q.value = 0.5f * (q.value + mirror); break;
      case Fault::force_flipped: f.value = -f.value; break;
      case Fault::force_offset: f.value += static_cast<float>(wrong_offset) * sign; break;
      case Fault::force_triple: f.value *= 3.0f; break;
      case Fault::force_frozen: f.value = held_force.value; break;
      case Fault::force_lost: f.valid = 0; break;
      case Fault::force_rail: f.value = static_cast<float>(rail_force) * sign; break;
      case Fault::emg_rail: m.value = static_cast<float>(rail_emg) * sign; break;
      case Fault::emg_lost: m.valid = 0; break;
      case Fault::emg_crossed: m.value = -m.value; break;
      case Fault::clock_ahead: input.now_us += 1000000; break;
      case Fault::clock_back: input.now_us -= 1000000; break;
      case Fault::samples_late: q = late; break;
      case Fault::law_memory: if (begins_now) flip(at(map.law), map.law_size); break;
      case Fault::supervisor_memory: if (begins_now) flip(at(map.supervisor), map.supervisor_size); break;
      case Fault::mode_memory:
        if (begins_now) {
          std::uint32_t word;
          std::memcpy(&word, at(map.mode), sizeof word);
          word ^= 1u << (fault_state % 11);
          std::memcpy(at(map.mode), &word, sizeof word);
        }
        break;
      case Fault::law_state:
        if (begins_now) {
          float first;
          std::memcpy(&first, at(map.law_state), sizeof first);
          first = odd ? std::nanf("") : first + 1.0f;
          std::memcpy(at(map.law_state), &first, sizeof first);
        }
        break;
      default: break;
    }
  }

  /// The bits of a word that matter most: of an exponent or a sign.
  void flip(unsigned char* block, std::size_t size) const {
    unsigned char* word = block + 4 * (fault_state % (size / 4));
    word[3] = static_cast<unsigned char>(word[3] ^ (fault_state / 977 % 2 == 0 ? 0x80u : 0x40u));
  }

  double drawn() {
    fault_state = fault_state * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(fault_state >> 11) * 0x1p-53;
  }

  double given(double asked) {
    const double then = asked_before[ticks % 20];
    asked_before[ticks % 20] = asked;
    if (!on) return holds = asked;
    switch (kind) {
      case Fault::drive_reversed: case Fault::drive_reversed_at_start: return -asked;
      case Fault::drive_triple: case Fault::drive_triple_unseen: case Fault::drive_triple_at_start:
        return clamp(3.0 * asked, -r.drive_strength * triple_limit, r.drive_strength * triple_limit);
      case Fault::drive_double: return clamp(2.0 * asked, -r.drive_strength * triple_limit, r.drive_strength * triple_limit);
      case Fault::drive_sine: case Fault::drive_lies: return asked + r.amplitude * std::sin(2.0 * pi * sine_frequency_hz * since);
      case Fault::drive_stuck: return r.drive_strength * (odd ? -stuck_torque : stuck_torque);
      case Fault::drive_holds: return holds;
      case Fault::drive_dead: return 0.0;
      case Fault::drive_late: return then;
      default: return asked;
    }
  }

  double measured(double effort) const {
    if (!on) return effort;
    switch (kind) {
      case Fault::drive_reversed_at_start: return -effort;
      case Fault::drive_triple_at_start: case Fault::drive_triple_unseen: return effort / 3.0;
      case Fault::drive_lies: return effort - r.amplitude * std::sin(2.0 * pi * sine_frequency_hz * since);
      case Fault::current_zero: return 0.0;
      case Fault::current_offset: return effort + r.drive_strength * (odd ? -wrong_offset : wrong_offset);
      default: return effort;
    }
  }

  struct Bent {
    double torque;
    double stored;
  };
  Bent cuff(double apart, double rate, double stiffness, double slack, double askew_by) const {
    const double deflected = apart - askew_by, half = 0.5 * slack;
    const double taut = deflected > half ? deflected - half : deflected < -half ? deflected + half : 0.0;
    if (taut == 0.0) return {0.0, 0.0};
    const double ratio = taut / r.cuff_hardening, square = ratio * ratio;
    const double spring = stiffness * taut * (1.0 + square / 3.0);
    const double both = spring + (r.passive != 0.0 ? 0.0 : r.cuff_damping * stiffness * rate);
    // It never pulls where it only pushes.
    const double torque = taut > 0.0 ? std::max(both, 0.0) : std::min(both, 0.0);
    return {torque, stiffness * taut * taut * (0.5 + square / 12.0)};
  }

  /// One period of robot, strap and limb.
  void integrate() {
    const bool passive = r.passive != 0.0;
    const double robot_sine = std::sin(link), robot_cosine = std::cos(link), at = link;
    const double limb_sine = std::sin(limb), limb_cosine = std::cos(limb), limb_at = limb;
    const double ripple_sine = std::sin(r.ripple_waves * motor), ripple_cosine = std::cos(r.ripple_waves * motor);
    const double motor_at = motor;
    // The wearer expects the limb's weight and most of the load, and what lasts is learnt.
    const double load_gravity = carried * gravity_m_s2 * r.load_lever, load_inertia = carried * r.load_lever * r.load_lever;
    const double late_error = delayed(wanted.q - limb, 0), late_rate = delayed(wanted.v - limb_velocity, 1);
    const double expected = r.anticipation * ((r.limb_gravity + load_gravity) * std::sin(wanted.q) +
                                              (r.limb_inertia + load_inertia) * wanted.a);
    if (strapped > 0.0 || r.worn != 0.0)
      learnt = clamp(learnt + r.period / r.learning_time * r.servo_stiffness * (wanted.q - limb), -r.strength * learnt_limit, r.strength * learnt_limit);
    const double excitation = expected + learnt + r.reflex_stiffness * late_error + r.reflex_damping * late_rate;
    muscle += r.period / (r.activation_lag + r.period) * (excitation - muscle);
    const bool limp = passive || (on && kind == Fault::wearer_faints);
    const double limb_inertia = r.limb_inertia + load_inertia, limb_gravity = r.limb_gravity + load_gravity;
    const double motor_inertia = r.rotor_share * r.inertia, link_inertia = (1.0 - r.rotor_share) * r.inertia;
    const double drive_share = dt / (r.drive_lag + dt), force_share = dt / (r.force_lag + dt),
                 current_share = dt / (r.current_lag + dt);
    const int steps = static_cast<int>(r.substeps);
    for (int i = 0; i < steps; ++i) {
      if (r.spring_stiffness > 0.0 && off < off_periods) {
        // A torque loop about the spring, against the friction of motor and gear.
        const double rate = r.spring_stiffness * (geared_velocity - link_velocity);
        const double error = target_effort - drive_effort;
        loop_integral += dt * r.spring_integral * error;
        const double motor_torque = clamp(target_effort + r.spring_gain * error + loop_integral - r.spring_rate_gain * rate,
                                          -r.drive_limit, r.drive_limit);
        const double resisted = r.spring_friction * clamp(geared_velocity / gear_width, -1.0, 1.0) + r.spring_viscous * geared_velocity;
        geared_velocity += dt * (motor_torque - drive_effort - resisted) / r.spring_inertia;
        geared += dt * geared_velocity;
        drive_effort = r.spring_stiffness * (geared - link);
      } else if (off < off_periods) {
        drive_effort += drive_share * (target_effort - drive_effort);
      }
      const double ripple = passive || drive_effort == 0.0 ? 0.0 : r.ripple * (ripple_sine + ripple_cosine * r.ripple_waves * (motor - motor_at));
      const double moved = link - at, limb_moved = limb - limb_at;
      const double weight = r.gravity_sine * (robot_sine + robot_cosine * moved) + r.gravity_cosine * (robot_cosine - robot_sine * moved) + r.offset;
      pull = 0.0;
      double on_limb = 0.0;
      if (strapped > 0.0) {
        const double apart = limb - link - askew, rate = limb_velocity - link_velocity;
        pull = strapped * (cuff(apart, rate, r.upper_cuff_stiffness, r.upper_cuff_slack, r.upper_cuff_offset).torque +
                           cuff(apart, rate, r.lower_cuff_stiffness, r.lower_cuff_slack, r.lower_cuff_offset).torque);
        on_limb = -pull;
      }
      double hold = 0.0;
      if (held > 0.0 && !passive)
        hold = held * (r.hand_stiffness * (hand.q - link) + r.hand_damping * (hand.v - link_velocity) + r.anticipation * r.inertia * hand.a);
      pushed = pull + hold;
      double stop = 0.0;
      if (link < r.stop_low) stop = std::max(r.stop_stiffness * (r.stop_low - link) - r.stop_damping * link_velocity, 0.0);
      if (link > r.stop_high) stop = std::min(r.stop_stiffness * (r.stop_high - link) - r.stop_damping * link_velocity, 0.0);
      const double outside = pushed + stop - weight;
      // Friction on elasto-plastic bristles: they bend up to where they slip, which falls with speed and grows with load.
      double& v = r.rotor_share > 0.0 ? motor_velocity : link_velocity;
      double resist = 0.0;
      if (!passive) {
        const double level = (v >= 0.0 ? r.friction_positive : r.friction_negative) + r.load_friction * std::fabs(outside);
        const double ratio = v / r.stribeck_velocity;
        const double slip = level * (1.0 + (r.static_ratio - 1.0) / (1.0 + ratio * ratio)) / bristle;
        const double bent = (bristles + dt * v) / (1.0 + dt * std::fabs(v) / std::max(slip, 1e-12));
        const double bending = (bent - bristles) / dt;
        bristles = bent;
        resist = bristle * bristles + bristle_drag * bending + r.viscous * v / (1.0 + std::fabs(v) / r.thinning_velocity);
      }
      if (r.rotor_share > 0.0) {
        const double twist = motor - link, half = 0.5 * r.backlash;
        const double taut = twist > half ? twist - half : twist < -half ? twist + half : 0.0;
        const double carried_on = taut == 0.0 ? 0.0
                                  : r.transmission_stiffness * taut + (passive ? 0.0 : r.transmission_damping * (motor_velocity - link_velocity));
        motor_velocity += dt * (drive_effort + ripple - resist - carried_on) / motor_inertia;
        link_velocity += dt * (outside + carried_on) / link_inertia;
        motor += dt * motor_velocity;
        link += dt * link_velocity;
      } else {
        link_velocity += dt * (drive_effort + ripple - resist + outside) / link_inertia;
        link += dt * link_velocity;
        motor = link;
        motor_velocity = link_velocity;
      }
      muscle_now = limp ? 0.0
                        : clamp(muscle + r.servo_stiffness * (wanted.q - limb) + r.servo_damping * (wanted.v - limb_velocity),
                                -r.muscle_limit, r.muscle_limit);
      const double limb_weight = limb_gravity * (limb_sine + limb_cosine * limb_moved);
      const double damping = passive ? 0.0 : r.limb_damping;
      limb_velocity += dt * (muscle_now + extra + on_limb - limb_weight - damping * limb_velocity) / limb_inertia;
      limb += dt * limb_velocity;
      force_filter += force_share * (pushed - force_filter);
      current_filter += current_share * (drive_effort - current_filter);
    }
  }

  double delayed(double value, int which) {
    const std::size_t behind = std::min<std::size_t>(static_cast<std::size_t>(r.reflex_delay / r.period), 127);
    errors[which][ticks % 128] = value;
    return errors[which][(ticks + 128 - behind) % 128];
  }

  double energy() const {
    const double rotor = r.rotor_share * r.inertia, rest = r.inertia - rotor;
    double sum = 0.5 * rotor * motor_velocity * motor_velocity + 0.5 * rest * link_velocity * link_velocity;
    sum += -r.gravity_sine * std::cos(link) + r.gravity_cosine * std::sin(link) + r.offset * link;
    if (r.rotor_share > 0.0) {
      const double twist = std::max(std::fabs(motor - link) - 0.5 * r.backlash, 0.0);
      sum += 0.5 * r.transmission_stiffness * twist * twist;
    }
    if (r.worn == 0.0) return sum;
    sum += 0.5 * r.limb_inertia * limb_velocity * limb_velocity - r.limb_gravity * std::cos(limb);
    const double apart = limb - link - askew;
    return sum + cuff(apart, 0.0, r.upper_cuff_stiffness, r.upper_cuff_slack, r.upper_cuff_offset).stored +
           cuff(apart, 0.0, r.lower_cuff_stiffness, r.lower_cuff_slack, r.lower_cuff_offset).stored;
  }

  /// What happened in the last half second, in two halves that take turns.
  struct Recent {
    double speed = 0, lowest = 1e9, highest = -1e9, push = 0, lasting = 0;
  };
  void remember() {
    if (!life) return;
    if (now - turned > 0.5 * recent_s) older = newer, newer = Recent{}, turned = now;
    newer.speed = std::max(newer.speed, std::fabs(motor - encoder_before) / r.period);
    newer.lowest = std::min(newer.lowest, motor);
    newer.highest = std::max(newer.highest, motor);
    newer.push = std::max(newer.push, std::fabs(pushed));
    lasts += lasting_rate * r.period * (pushed - lasts);
    newer.lasting = std::max(newer.lasting, std::fabs(lasts));
    encoder_before = motor;
  }

  void tell_alarm(bool acted, Result& result) {
    if (acted && !alarmed) {
      result.alarms += 1.0;
      alarm_at = now;
      const bool lately = now - last_event_end < recent_s;
      const Event doing = event != reach ? event : lately ? last_event : reach;
      if (alarms.size() < max_alarms)
        alarms.push_back({now, static_cast<double>(out.fault), static_cast<double>(mode_before), static_cast<double>(doing),
                          std::max(older.speed, newer.speed), std::min(older.lowest, newer.lowest),
                          std::max(older.highest, newer.highest), std::max(older.push, newer.push),
                          std::max(older.lasting, newer.lasting)});
      // The wearer stays where the arm is until the law is in force again.
      Reference& mover = r.worn != 0.0 && strapped > 0.0 ? wanted : hand;
      mover.start(clamp(mover.q, r.target_low, r.target_high), now, 1.0, 0);
      next_task = now + 2.0;
    }
    alarmed = acted;
    mode_before = out.mode;
  }

  const Run r;
  Random habits, noise, mishaps, jitters;
  std::vector<float>&reference_work, &reference_effort;
  Fault kind = Fault::none;
  bool life = false, is_reference = false, on = false, begins_now = false, odd = false, alarmed = false, aligning = false;
  double now = 0, since = 0, dt = 0, bristle = 1, bristle_drag = 0;
  double motor = 0, motor_velocity = 0, link = 0, link_velocity = 0, limb = 0, limb_velocity = 0, bristles = 0;
  double drive_effort = 0, target_effort = 0, geared = 0, geared_velocity = 0, loop_integral = 0, pull = 0, pushed = 0, muscle = 0, muscle_now = 0, learnt = 0,
         extra = 0, carried = 0, strapped = 1, held = 0, askew = 0;
  double encoder = 0, encoder_before = 0, force_filter = 0, current_filter = 0, emg = 0, holds = 0, table_at = 0, table_way = 1,
         spasm_torque = 0;
  double next_task = 0, next_brace = 0, next_impact = 0, next_load = 0, next_spasm = 0, next_doff = 0, doff_until = 0,
         law_since = -1, alarm_at = 0, event_end = 0, last_event_end = -10, felt_at = 0, lasts = 0, turned = 0;
  Event event = reach, last_event = reach;
  std::size_t tasks = 0;
  std::uint64_t fault_state = 0;
  std::uint32_t ticks = 0, off = 0, token = 0, mode_before = 0;
  double asked_last = 0, asked_earlier = 0;
  double commands[4] = {}, asked_before[20] = {}, errors[2][128] = {};
  pellucid_sample past[20] = {}, last_position{}, last_force{}, held_position{}, held_force{};
  float mirror = 0;
  Reference wanted, hand;
  Recent older, newer;
  pellucid_output out{};
};

}  // namespace
}  // namespace foreign

int main() {
  foreign::Run run;
  std::vector<float> work, effort;
  while (std::fread(&run, sizeof run, 1, stdin) == 1) {
    foreign::Simulation simulation(run, work, effort);
    foreign::Result result = simulation.live();
    const double count = static_cast<double>(simulation.alarms.size());
    std::fwrite(&result, sizeof result, 1, stdout);
    std::fwrite(&count, sizeof count, 1, stdout);
    std::fwrite(simulation.alarms.data(), sizeof(foreign::Alarm), simulation.alarms.size(), stdout);
    const double rows = static_cast<double>(simulation.trace.size());
    std::fwrite(&rows, sizeof rows, 1, stdout);
    std::fwrite(simulation.trace.data(), sizeof(foreign::Traced), simulation.trace.size(), stdout);
  }
  return 0;
}
