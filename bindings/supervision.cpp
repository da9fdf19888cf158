// A law of the list under its supervisor, for Python: stepped in double or float, fuzzed, timed.
#include "supervision.hpp"

#include "random_bits.hpp"
#include "supervised.hpp"

#include <pellucid/session_state.hpp>

#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* class_doc = R"(A control law under its supervisor, as on a robot. Made by `supervised`.)";
constexpr const char* step_doc = R"(One control period: the effort for the drive [N m].

Parameters
----------
time : float
    When everything was measured [s].
*samples : float or None
    In the order of the law's sensors, SI; None, NaN or left out: the sensor says nothing.
drive, joint : float or None
    The effort that the drive measures [N m], and a second encoder [rad].
token : int
    The challenge, sent back by an operator who asks for a reset; 0: nobody asks.)";
constexpr const char* samples_doc = R"(One control period as on a robot, where each sample has its own age.

Parameters
----------
now : int
    The time of this step [us].
samples : sequence of (float, int, int, bool)
    Value, sequence number, time [us] and whether its sensor vouches for it; in the order of the law's sensors,
    then of the drive's measurement and of a second encoder.
token : int
    As `step` takes it.

Returns
-------
float
    [N m].)";
constexpr const char* record_doc = R"(From the next period on, keeps the last periods; where the supervisor stops, what went before and after stays.

Parameters
----------
records : int
    How many are kept; 0: none.
decimation : int
    Periods of one record.
after : int
    Records after the one in which the supervisor stops.)";
constexpr const char* incident_doc = R"(What was recorded, as the bytes of a file that `pellucid.incident` reads; it then begins anew.

Parameters
----------
slides : bool
    The joint is prismatic.

Returns
-------
bytes)";
constexpr const char* make_doc = R"(A law of the list under its supervisor.

Parameters
----------
name : str
    Of `laws`.
parameters : (k,)
    The law's numbers, SI.
supervisor : (m,)
    In the order of model_fields()["supervisor"].
single : bool
    In float32, as on a microcontroller.

Returns
-------
Supervised)";
constexpr const char* fuzz_doc = R"(A supervised law among nonsense: numbers, clocks, drives, tokens and memory that go wrong.

Parameters
----------
name : str
parameters : (k,)
supervisor : (m,)
cycles, seed : int
single : bool

Returns
-------
tuple
    Efforts beyond the limits or that are no number, or power while latched (unsafe); faults; cycles with an effort;
    resets that were granted.)";
constexpr const char* time_doc = R"(Nanoseconds that a supervisor adds to a step of a law on a smooth motion, mean over `cycles`, least of `turns`.)";

double step(Supervised& law, double time, const nb::args& samples, nb::handle drive, nb::handle joint, std::uint32_t token) {
  if (samples.size() > law.sensors())
    throw nb::type_error(("step: found " + std::to_string(samples.size()) + " samples, expected at most " +
                          std::to_string(law.sensors()) + ", one for each sensor")
                             .c_str());
  const auto number = [](nb::handle x) {
    return x.is_none() ? std::numeric_limits<double>::quiet_NaN() : nb::cast<double>(x);
  };
  double values[p::quantity_count];
  for (std::size_t i = 0; i < law.sensors(); ++i)
    values[i] = i < samples.size() ? number(samples[i]) : std::numeric_limits<double>::quiet_NaN();
  return law.step_now(time, values, number(drive), number(joint), token);
}

double step_samples(Supervised& law, std::int64_t now, const nb::sequence& samples, std::uint32_t token) {
  p::Sample<double> read[p::quantity_count + 2];
  std::size_t i = 0;
  for (const nb::handle sample : samples) {
    if (i == law.sensors() + 2) break;
    read[i++] = {nb::cast<double>(sample[0]), nb::cast<std::int64_t>(sample[2]), nb::cast<std::uint32_t>(sample[1]),
                 nb::cast<bool>(sample[3])};
  }
  return law.step_samples(now, read, i, token);
}

struct Fuzzed {
  long long unsafe = 0, faults = 0, moving = 0, resets = 0;
};

template <class L, class S> Fuzzed fuzz(p::Supervised<L>& law, std::uint64_t cycles, std::uint64_t seed) {
  Bits bits(seed);
  Fuzzed found;
  const auto gate = law.controller.law.gate;
  const auto settings = law.supervisor;
  const S limit = gate.params.effort_limit, change = gate.max_change * (S(1) + S(1e-5));
  const double period = static_cast<double>(gate.params.period);
  const auto micros = static_cast<std::int64_t>(1e6 * period + 0.5);
  std::int64_t now = 0;
  std::uint32_t sequence = 0, token = 0;
  S before = 0;
  double phase = 0, rate = 2, offset = 0, frozen = 0, stuck = 0;
  int freeze = 0, drive = 0;
  p::Mode mode = p::mode_of(law.state);
  const p::Supervised<L> fresh = law;
  long long stopped = 0;
  for (std::uint64_t k = 0; k < cycles; ++k) {
    if (k % 8192 == 0) rate = 0.2 + 2 * bits.uniform();
    phase += rate * period;
    if (phase > 6.283185307179586) phase -= 6.283185307179586;
    const std::uint64_t dice = bits.next();
    double q = 1.4 + 0.5 * p::sin(phase) + offset;
    if (freeze > 0) q = frozen, --freeze;
    frozen = q;
    now += micros;
    ++sequence;
    const double wobble = static_cast<double>(dice >> 40) * 0x1p-24 - 0.5;
    const p::Sample<S> felt{static_cast<S>(0.4 * wobble), now, sequence, true};
    p::Samples<S> in{{static_cast<S>(q), now, sequence, true}, felt, felt, felt};
    p::Feedback<S> back{{law.state.output, now, sequence, true}, {static_cast<S>(q), now, sequence, true}, token};
    if (drive > 0) back.drive.value = static_cast<S>(stuck), --drive;
    if (dice % 1024 == 7) {
      switch (static_cast<int>(24 * bits.uniform())) {
        case 0: in.position.value = std::numeric_limits<S>::quiet_NaN(); break;
        case 1: in.position.value = -std::numeric_limits<S>::infinity(); break;
        case 2: in.position.value = bits.anything<S>(); break;
        case 3: in.interaction.value = bits.anything<S>(); break;
        case 4: in.muscle.value = bits.anything<S>(); break;
        case 5: now += static_cast<std::int64_t>(4e6 * (bits.uniform() - 0.5)); break;
        case 6: sequence += static_cast<std::uint32_t>(bits.next()); break;
        case 7: in.position.sequence = --sequence; break;
        case 8: in.position.valid = false; break;
        case 9: in.interaction.valid = in.muscle.valid = false; break;
        case 10: back.drive.value = bits.anything<S>(); break;
        case 11: back.drive.valid = back.joint.valid = false; break;
        case 12: back.joint.value = bits.anything<S>(); break;
        case 13: back.token = static_cast<std::uint32_t>(bits.next()); break;
        case 14: freeze = static_cast<int>(60 * bits.uniform()); break;
        case 15: offset = bits.uniform() - 0.5; break;
        case 16: drive = 30, stuck = 20 * bits.uniform() - 10; break;
        case 17: law.state.doing.word ^= 1u << (bits.next() % 32); break;
        case 18: law.state.doing = {static_cast<std::uint32_t>(bits.next()), static_cast<std::uint32_t>(bits.next())}; break;
        case 19: law.state.output = bits.anything<S>(); break;
        case 20: law.state.body.momentum = law.state.hold.taken = law.state.budget.spent = bits.anything<S>(); break;
        case 21: law.state.test.work = law.state.encoder.velocity = bits.anything<S>(); break;
        case 22: law.state.law_sum.next = static_cast<std::uint32_t>(bits.next()); break;
        default: p::stop(law);
      }
    }
    const bool lost = !(std::fabs(law.state.output) <= limit);  // a bit fell over there: what came before says nothing
    const p::SupervisorOutput<S> out = p::step(law, in, back, now);
    const bool inside = out.effort >= -limit && out.effort <= limit;
    const bool slow = lost || std::fabs(out.effort) <= std::fabs(before) + change;
    const bool still = out.mode != p::Mode::latched || (out.effort == S(0) && !out.enable);
    found.unsafe += !(inside && slow && still && (out.mode < p::Mode::zero || !out.enable));
    found.moving += out.effort != S(0);
    const bool now_stopped = p::is_stopped(out.mode), was = p::is_stopped(mode);
    found.faults += now_stopped && !was;
    found.resets += was && !now_stopped;
    stopped = now_stopped ? stopped + 1 : 0;
    token = stopped > 30 ? out.challenge : 0;
    if (stopped > 200000) law = fresh, p::seal(law), stopped = 0;
    mode = p::mode_of(law.state);
    before = out.effort;
  }
  (void)settings;
  return found;
}

template <class S> nb::tuple fuzz_any(const std::string& name, nb::handle parameters, nb::handle supervisor,
                                      std::uint64_t cycles, std::uint64_t seed) {
  AnySupervised<S> any = read_supervised<S>(name, parameters, supervisor);
  Fuzzed found;
  {
    nb::gil_scoped_release release;
    found = of_law(any, Fuzzed(), [&](auto& law) {
      p::seal(law);
      return fuzz<typename std::decay_t<decltype(law)>::Law, S>(law, cycles, seed);
    });
  }
  return nb::make_tuple(found.unsafe, found.faults, found.moving, found.resets);
}

double time_added(const std::string& name, nb::handle parameters, nb::handle supervisor, std::size_t cycles, int turns) {
  using Clock = std::chrono::steady_clock;
  AnySupervised<double> any = read_supervised<double>(name, parameters, supervisor);
  return of_law(any, 0.0, [&](auto& law) {
    p::seal(law);
    auto alone = law.controller;
    std::vector<double> places(cycles);
    for (std::size_t k = 0; k < cycles; ++k)
      places[k] = 1.4 + 0.5 * p::sin(std::fmod(4e-3 * static_cast<double>(k), 6.283185307179586));
    volatile double sink = 0;
    const auto timed = [&](auto&& one) {
      const auto start = Clock::now();
      for (std::size_t k = 0; k < cycles; ++k) {
        const std::int64_t now = 1000 * static_cast<std::int64_t>(k + 1);
        const auto sequence = static_cast<std::uint32_t>(k + 1);
        // The torque changes, as a sensor's does.
        const p::Sample<double> torque{1e-9 * static_cast<double>(k), now, sequence, true};
        sink = sink + one(p::Samples<double>{{places[k], now, sequence, true}, torque, torque, torque}, torque, now);
      }
      return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / static_cast<double>(cycles);
    };
    double least = 1e9, bare = 1e9;
    const auto law_at_rest = law;
    const auto alone_at_rest = alone;
    for (int turn = 0; turn < turns; ++turn) {
      law = law_at_rest;
      alone = alone_at_rest;
      p::seal(law);
      least = std::fmin(least, timed([&](const p::Samples<double>& in, p::Sample<double> felt, std::int64_t now) {
        felt.value = law.state.output;
        return p::step(law, in, p::Feedback<double>{felt, {}, 0}, now).effort;
      }));
      bare = std::fmin(bare, timed([&](const p::Samples<double>& in, const p::Sample<double>&, std::int64_t now) {
        return p::step(alone, in, now);
      }));
    }
    if (p::faults_of(law.state) != 0)
      throw nb::value_error("time_supervisor: found a fault in the timed motion, expected none; check the numbers");
    return least - bare;
  });
}

nb::list session_states() {
  nb::list states;
  for (std::size_t i = 0; i < p::session_state_count; ++i) {
    const p::SessionStateMeaning& state = p::session_states[i];
    nb::list next;
    for (std::size_t k = 0; k < p::session_state_count; ++k)
      if (p::session_transitions[i][k]) next.append(p::session_states[k].name);
    nb::dict one;
    one["name"] = state.name;
    one["words"] = state.words;
    one["in_force"] = state.in_force;
    one["needs_reset"] = state.needs_reset;
    one["next"] = nb::tuple(next);
    states.append(one);
  }
  return states;
}

}  // namespace

void add_supervision(nb::module_& m) {
  nb::list faults, modes;
  for (const char* name : p::safety_fault_names) faults.append(name);
  for (const char* name : p::mode_names) modes.append(name);
  m.attr("FAULTS") = nb::tuple(faults);
  m.attr("MODES") = nb::tuple(modes);
  m.def("session_states", session_states, nb::sig("def session_states() -> list[dict]"),
        "States of a session's engine, in order: name, words for a page, in_force, needs_reset, and next: the names of the\n"
        "states that may follow within a cycle.");
  nb::class_<Supervised>(m, "Supervised", class_doc)
      .def("step", step, nb::arg("time"), nb::arg("samples"), nb::kw_only(), nb::arg("drive").none() = nb::none(),
           nb::arg("joint").none() = nb::none(), nb::arg("token") = 0,
           nb::sig("def step(self, time: float, *samples: float | None, drive: float | None = None, joint: float | None "
                   "= None, token: int = 0) -> float"),
           step_doc)
      .def("step_samples", step_samples, nb::arg("now"), nb::arg("samples"), nb::arg("token") = 0,
           nb::sig("def step_samples(self, now: int, samples: Sequence[tuple[float, int, int, bool]], token: int = 0) -> "
                   "float"),
           samples_doc)
      .def("configure", &Supervised::configure, nb::arg("parameters").none(), nb::arg("supervisor").none(),
           nb::sig("def configure(self, parameters: ArrayLike, supervisor: ArrayLike) -> bool"),
           "Starts again with other numbers; a fault that is latched stays so.")
      .def("adjust", &Supervised::adjust, nb::arg("parameters").none(),
           nb::sig("def adjust(self, parameters: ArrayLike) -> None"),
           "Other numbers of the law, from the next period on; what it remembers stays.")
      .def("record", &Supervised::record, nb::arg("records"), nb::arg("decimation") = 1, nb::arg("after") = 0, record_doc)
      .def("incident", &Supervised::incident, nb::arg("slides") = false, incident_doc)
      .def_prop_ro("is_recorded", &Supervised::is_recorded, "Whether it has stopped and what followed is recorded too.")
      .def("stop", &Supervised::stop, "From the next step on it stops, and stays stopped until reset.")
      .def_prop_ro("effort", [](const Supervised& s) { return s.out.effort; }, "The last [N m].")
      .def_prop_ro("fault", [](const Supervised& s) { return fault_name(s.out.fault); }, "The first, latched; 'none'.")
      .def_prop_ro("mode", [](const Supervised& s) { return p::mode_names[static_cast<std::size_t>(s.out.mode)]; },
                   "What it does: start_up, running, degraded, damped_stop, zero or latched.")
      .def_prop_ro("enable", [](const Supervised& s) { return s.out.enable; }, "False: the drive must take its power off.")
      .def_prop_ro("challenge", [](const Supervised& s) { return s.out.challenge; },
                   "What a reset needs as its token; 0 while all is well.")
      .def_prop_ro("estimates", &Supervised::estimates, nb::sig("def estimates(self, /) -> dict[str, float]"),
                   "What the law estimates beside its effort, by name.")
      .def_prop_ro("probe_answer", &Supervised::probe_answer,
                   nb::sig("def probe_answer(self, /) -> tuple[tuple[float, ...], int]"),
                   "What the robot has answered the probe's three waves so far, real and imaginary parts, and from how many windows.")
      .def_prop_ro("beat", [](const Supervised& s) { return s.out.beat; }, "Counts periods, for the drive's watchdog.")
      .def_prop_ro("log", &Supervised::log, nb::sig("def log(self, /) -> list[tuple[int, str, str]]"),
                   "The last faults, the latest first: period, fault, and what was then done.");
  m.def(
      "supervised",
      [](const std::string& name, nb::handle parameters, nb::handle supervisor, bool single) {
        return single ? make_supervised<float>(name, parameters, supervisor) : make_supervised<double>(name, parameters, supervisor);
      },
      nb::arg("name"), nb::arg("parameters").none(), nb::arg("supervisor").none(), nb::arg("single") = false,
      nb::sig("def supervised(name: str, parameters: ArrayLike, supervisor: ArrayLike, single: bool = False) -> Supervised"),
      make_doc);
  m.def("supervised_storage", [](const std::string& name) {
    std::size_t storage = 0;
    with_law(name, [&](auto of) {
      storage = (sizeof(p::Supervised<typename decltype(of)::template law<float>>) + 7) / 8 * 8;
    });
    return storage;
  }, nb::arg("name"), nb::sig("def supervised_storage(name: str) -> int"), "Bytes of a supervised law in float.");
  m.def(
      "fuzz_supervised",
      [](const std::string& name, nb::handle parameters, nb::handle supervisor, std::uint64_t cycles, std::uint64_t seed,
         bool single) {
        return single ? fuzz_any<float>(name, parameters, supervisor, cycles, seed)
                      : fuzz_any<double>(name, parameters, supervisor, cycles, seed);
      },
      nb::arg("name"), nb::arg("parameters"), nb::arg("supervisor"), nb::arg("cycles"), nb::arg("seed"),
      nb::arg("single") = false,
      nb::sig("def fuzz_supervised(name: str, parameters: ArrayLike, supervisor: ArrayLike, cycles: int, seed: int, single: "
              "bool = False) -> tuple[int, int, int, int]"),
      fuzz_doc);
  m.def("time_supervisor", time_added, nb::arg("name"), nb::arg("parameters"), nb::arg("supervisor"), nb::arg("cycles"),
        nb::arg("turns"),
        nb::sig("def time_supervisor(name: str, parameters: ArrayLike, supervisor: ArrayLike, cycles: int, turns: int) -> "
                "float"),
        time_doc);
}

}  // namespace bindings
