// Every control law of the core's list for Python: stepped in double or float, fuzzed, timed, described.
#include "laws.hpp"
#include "random_bits.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* law_doc = R"(A control law behind the front that it has on a robot too: what may not be believed does not reach it.

What goes out has passed the safety gate: finite and within the limits, whatever comes in. A fault latches, and the
effort ramps to 0. Made by `law`.)";
constexpr const char* step_doc = R"(One control period: the effort for the drive [N m].

Parameters
----------
time : float
    When everything was measured [s].
*samples : float or None
    In the order of the law's sensors, SI; None, NaN or left out: the sensor says nothing.)";
constexpr const char* run_doc = R"(step, one period after another.

Parameters
----------
time, *samples : (n,)
    As `step` takes them.

Returns
-------
(n,)
    Efforts [N m].)";
constexpr const char* step_samples_doc = R"(One control period as on a robot, where each sample has its own age.

Parameters
----------
now : int
    The time of this step [us].
samples : sequence of (float, int, int, bool)
    Value, sequence number, time [us] and whether its sensor vouches for it; in the order of the law's sensors.

Returns
-------
float
    [N m].)";
constexpr const char* configure_doc = R"(Other numbers, from the next period on; what the law remembers stays.

Parameters
----------
parameters : (k,)
    As `law` takes them.)";
constexpr const char* make_doc = R"(A law of the list.

Parameters
----------
name : str
    Of `laws`.
parameters : (k,)
    Its numbers, SI, in the order of its fields.
single : bool
    In float32, as on a microcontroller.

Returns
-------
Law
    At rest; its fault is "configuration" where the numbers make no sense.)";
constexpr const char* laws_doc = R"(Every law.

Returns
-------
list of dict
    name, type (in C++), title; sensors: name, dimension, meaning, required, swing, noise of each; fields: name,
    dimension (powers of effort, coordinate, time; or a unit), default, lower, upper, above, below (an end is
    outside), infinite (infinity is allowed), count, sentence of each; storage [bytes] of it in float.)";
constexpr const char* fuzz_doc = R"(A law among nonsense: NaN, infinities, jumps, frozen and repeated samples, clock jumps.

Parameters
----------
law : str
parameters : (k,)
cycles, seed : int
single : bool
    In float32, as on a microcontroller.

Returns
-------
tuple
    Commands outside the limits (unsafe), faults, most cycles from a fault to a safe output, cycles with a torque.)";
constexpr const char* time_doc = R"(Nanoseconds of single control steps of a law on a smooth motion, each timed by itself.

Parameters
----------
law : str
parameters : (k,)
cycles : int
single : bool

Returns
-------
(cycles,)
    [ns], the clock's own cost taken off.)";

/// Python interface of any law.
class Law {
 public:
  Law() = default;
  Law(const Law&) = delete;
  virtual ~Law() = default;
  virtual const char* name() const = 0;
  virtual std::size_t sensors() const = 0;
  virtual void configure(nb::handle parameters) = 0;
  /// All read at `time` [s]; NaN says nothing.
  virtual double step_now(double time, const double* values) = 0;
  virtual double step_samples(std::int64_t now, const p::Sample<double>* samples) = 0;
  virtual void reset() = 0;
  virtual void stop() = 0;
  virtual p::SafetyFault fault() const = 0;
  virtual nb::dict estimates() const = 0;
};

template <class L, class S> class LawIn : public Law {
 public:
  explicit LawIn(nb::handle parameters) {
    p::configure(controller_, read_params<typename L::Params, S>("parameters", parameters));
  }
  const char* name() const override { return L::name; }
  std::size_t sensors() const override { return p::sensor_count<L>; }
  void configure(nb::handle parameters) override {
    controller_.law = p::coefficients(read_params<typename L::Params, S>("parameters", parameters));
  }
  double step_now(double time, const double* values) override {
    const bool sound = std::fabs(time) < 9e12;  // microseconds that 64 bits hold; false for NaN
    p::Samples<S> samples;
    for (std::size_t i = 0; i < p::sensor_count<L>; ++i)
      samples[L::sensors[i].quantity] = {static_cast<S>(values[i]), 0, 0, sound && !std::isnan(values[i])};
    return static_cast<double>(p::step_now(controller_, samples, sound ? std::llround(time * 1e6) : 0));
  }
  double step_samples(std::int64_t now, const p::Sample<double>* from) override {
    p::Samples<S> samples;
    for (std::size_t i = 0; i < p::sensor_count<L>; ++i)
      samples[L::sensors[i].quantity] = {static_cast<S>(from[i].value), from[i].time, from[i].sequence, from[i].valid};
    return static_cast<double>(p::step(controller_, samples, now));
  }
  void reset() override { p::reset(controller_); }
  void stop() override { p::stop(controller_); }
  p::SafetyFault fault() const override { return controller_.fault; }
  nb::dict estimates() const override {
    return estimates_of<L>(controller_.state);
  }

 private:
  p::Controller<L> controller_;
};

template <class S> std::unique_ptr<Law> make(const std::string& name, nb::handle parameters) {
  std::unique_ptr<Law> made;
  std::string known;
  p::Laws::for_each([&](auto of) {
    using L = typename decltype(of)::template law<S>;
    known += (known.empty() ? "\"" : ", \"") + std::string(L::name) + "\"";
    if (name == L::name) made = std::make_unique<LawIn<L, S>>(parameters);
  });
  if (!made) throw nb::value_error(("law: found \"" + name + "\", expected one of " + known).c_str());
  return made;
}

double step(Law& law, double time, const nb::args& samples) {
  if (samples.size() > law.sensors())
    throw nb::type_error(("step: found " + std::to_string(samples.size()) + " samples, expected at most " +
                          std::to_string(law.sensors()) + ", one for each sensor")
                             .c_str());
  double values[p::quantity_count];
  for (std::size_t i = 0; i < law.sensors(); ++i) {
    const bool given = i < samples.size() && !samples[i].is_none();
    values[i] = given ? nb::cast<double>(samples[i]) : std::numeric_limits<double>::quiet_NaN();
  }
  return law.step_now(time, values);
}

nb::object run(Law& law, nb::handle time, const nb::args& samples) {
  if (samples.size() > law.sensors())
    throw nb::type_error(("run: found " + std::to_string(samples.size()) + " arrays of samples, expected at most " +
                          std::to_string(law.sensors()) + ", one for each sensor")
                             .c_str());
  const Array t = read_array("time", time);
  if (t.shape.size() != 1) t.fail("(n,)");
  const std::size_t n = t.shape[0];
  std::vector<Array> arrays;
  for (const nb::handle one : samples) {
    arrays.push_back(read_array("samples", one));
    arrays.back().expect(same_length("time", n), {n});
  }
  Result efforts({n});
  double values[p::quantity_count];
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t i = 0; i < law.sensors(); ++i)
      values[i] = i < arrays.size() ? arrays[i].data[k] : std::numeric_limits<double>::quiet_NaN();
    efforts.data[k] = law.step_now(t.data[k], values);
  }
  return efforts.array();
}

double step_samples(Law& law, std::int64_t now, const nb::sequence& samples) {
  p::Sample<double> read[p::quantity_count];
  std::size_t i = 0;
  for (const nb::handle sample : samples) {
    if (i == law.sensors()) break;
    read[i++] = {nb::cast<double>(sample[0]), nb::cast<std::int64_t>(sample[2]), nb::cast<std::uint32_t>(sample[1]),
                 nb::cast<bool>(sample[3])};
  }
  if (i != law.sensors()) throw nb::value_error("step_samples: expected one sample for each of the law's sensors");
  return law.step_samples(now, read);
}

nb::list laws() {
  nb::list list;
  p::Laws::for_each([&list](auto of) {
    using L = typename decltype(of)::template law<double>;
    nb::list sensors;
    for (const p::SensorUse& use : L::sensors) {
      const p::QuantityText& text = p::quantities[static_cast<std::size_t>(use.quantity)];
      nb::dict one;
      one["name"] = text.name;
      one["dimension"] = dimension_of(text.unit);
      one["meaning"] = text.meaning;
      one["required"] = use.required;
      one["swing"] = use.swing;
      one["noise"] = use.noise;
      sensors.append(one);
    }
    nb::dict law;
    law["name"] = L::name;
    law["type"] = L::type;
    law["title"] = L::title;
    law["sensors"] = sensors;
    law["fields"] = fields_of<typename L::Params>();
    law["storage"] = (sizeof(p::Controller<typename decltype(of)::template law<float>>) + 7) / 8 * 8;
    list.append(law);
  });
  return list;
}

struct Fuzzed {
  long long unsafe = 0, faults = 0, slowest = 0, moving = 0;
};

/// The law without its front, which would keep most of the nonsense from it.
template <class L, class S> Fuzzed fuzz(p::Controller<L>& controller, std::uint64_t cycles, std::uint64_t seed) {
  Bits bits(seed);
  Fuzzed found;
  const auto& gate = controller.law.gate;
  const S limit = gate.params.effort_limit, change = gate.max_change * (S(1) + S(1e-5));
  const double period = static_cast<double>(gate.params.period);
  std::int64_t time = 0;
  std::uint32_t sequence = 0;
  S before = 0;
  double phase = 0, rate = 6, frozen = 0, offset = 0;
  int freeze = 0;
  long long since = 0;
  bool shut = false;
  for (std::uint64_t k = 0; k < cycles; ++k) {
    if (k % 4096 == 0) rate = 1 + 12 * bits.uniform();
    phase += rate * period;
    double q = 1.4 + 0.5 * p::sin(std::fmod(phase, 6.283185307179586)) + offset;
    const double chance = bits.uniform();
    if (chance < 2e-5) freeze = 1 + static_cast<int>(40 * bits.uniform());
    if (chance > 0.99998) offset = bits.uniform() - 0.5;  // the encoder slips
    if (freeze > 0) q = frozen, --freeze;
    frozen = q;
    p::Samples<S> in;
    in.position = {static_cast<S>(q), 0, 0, true};
    in.interaction = {static_cast<S>(2 * bits.uniform() - 1), 0, 0, true};
    in.muscle = {static_cast<S>(20 * bits.uniform() - 10), 0, 0, true};
    time += static_cast<std::int64_t>(1e6 * period + 0.5);
    ++sequence;
    const double kind = bits.uniform();
    if (kind < 1e-3) {
      const int what = static_cast<int>(10 * bits.uniform());
      const S nan = std::numeric_limits<S>::quiet_NaN(), infinity = std::numeric_limits<S>::infinity();
      if (what == 0) in.position.value = nan;
      if (what == 1) in.position.value = bits.uniform() < 0.5 ? infinity : -infinity;
      if (what == 2) in.position.value = bits.anything<S>();
      if (what == 3) in.interaction.value = bits.uniform() < 0.5 ? nan : bits.anything<S>();
      if (what == 4) in.muscle.value = bits.uniform() < 0.5 ? infinity : bits.anything<S>();
      if (what == 5) time += static_cast<std::int64_t>(4e6 * (bits.uniform() - 0.5));
      if (what == 6) sequence += static_cast<std::uint32_t>(bits.next());
      if (what == 7) --sequence;
      if (what == 8) in.position.valid = false;
      if (what == 9) in.interaction.valid = in.muscle.valid = false;
    }
    in.torque = in.interaction;
    in.torque.valid = true;
    for (const p::SensorUse& use : L::sensors) in[use.quantity].time = time, in[use.quantity].sequence = sequence;
    const S out = p::step(controller.law, controller.state, in);
    const bool fault = controller.state.gate.fault != p::SafetyFault::none;
    const bool inside = out >= -limit && out <= limit;
    const bool slow = std::fabs(out) <= std::fabs(before) + change || !(std::fabs(before) <= limit);
    const bool retreats = !fault || std::fabs(out) <= std::fabs(before);
    // From the first cycle of a fault on, the torque may only fall.
    if (fault && !shut) ++found.faults, since = 0;
    shut = fault;
    if (fault) {
      ++since;
      if (!(inside && retreats)) found.slowest = since > found.slowest ? since : found.slowest;
    }
    found.unsafe += !(inside && slow && retreats);
    found.moving += out != S(0);
    before = out;
    if (fault && bits.uniform() < 0.02) p::reset(controller.state);
  }
  if (found.faults > 0) ++found.slowest;  // the cycle of the fault itself counts as one
  return found;
}

template <class S> nb::tuple fuzz_any(const std::string& name, nb::handle parameters, std::uint64_t cycles,
                                      std::uint64_t seed) {
  AnyLaw<S> law = read_law<S>(name, parameters);
  Fuzzed found;
  {
    nb::gil_scoped_release release;
    found = of_law(law, Fuzzed(), [&](auto& one) { return fuzz<typename std::decay_t<decltype(one)>::Law, S>(one, cycles, seed); });
  }
  return nb::make_tuple(found.unsafe, found.faults, found.slowest, found.moving);
}

template <class S> nb::object time_any(const std::string& name, nb::handle parameters, std::size_t cycles) {
  using Clock = std::chrono::steady_clock;
  AnyLaw<S> law = read_law<S>(name, parameters);
  Result result({cycles});
  volatile double sink = 0;
  of_law(law, 0, [&](auto& one) {
    const double period = static_cast<double>(one.law.gate.params.period);
    double empty = 1e9;
    for (int i = 0; i < 1000; ++i) {
      const auto start = Clock::now();
      empty = std::fmin(empty, std::chrono::duration<double, std::nano>(Clock::now() - start).count());
    }
    for (std::size_t k = 0; k < cycles; ++k) {
      const double angle = std::fmod(4 * period * static_cast<double>(k), 6.283185307179586);
      const std::int64_t time = std::llround(1e6 * period * static_cast<double>(k));
      const p::Sample<S> torque{S(0), time, static_cast<std::uint32_t>(k), true};
      p::Samples<S> in{torque, torque, torque, torque};
      in.position.value = static_cast<S>(1.4 + 0.5 * p::sin(angle));
      const auto start = Clock::now();
      const S out = p::step(one.law, one.state, in);
      const auto end = Clock::now();
      sink = sink + static_cast<double>(out);
      result.data[k] = std::chrono::duration<double, std::nano>(end - start).count() - empty;
    }
    return 0;
  });
  return result.array();
}

}  // namespace

void add_laws(nb::module_& m) {
  nb::class_<Law>(m, "Law", law_doc)
      .def_prop_ro("name", &Law::name, "Of `laws`.")
      .def("step", step, nb::arg("time"), nb::arg("samples"),
           nb::sig("def step(self, time: float, *samples: float | None) -> float"), step_doc)
      .def("run", run, nb::arg("time"), nb::arg("samples"),
           nb::sig("def run(self, time: ArrayLike, *samples: ArrayLike) -> NDArray[float64]"), run_doc)
      .def("step_samples", step_samples, nb::arg("now"), nb::arg("samples"),
           nb::sig("def step_samples(self, now: int, samples: Sequence[tuple[float, int, int, bool]]) -> float"),
           step_samples_doc)
      .def("configure", &Law::configure, nb::arg("parameters").none(),
           nb::sig("def configure(self, parameters: ArrayLike) -> None"), configure_doc)
      .def("reset", &Law::reset, "Open the gate again and start from the next sample; the effort goes on from where it is.")
      .def("stop", &Law::stop, "From the next step on the effort ramps to 0, and stays there until reset.")
      .def_prop_ro(
          "fault", [](const Law& law) { return fault_name(law.fault()); },
          "Why the effort is 0, or on its way there; 'none' while the gate is open.")
      .def_prop_ro("estimates", &Law::estimates, nb::sig("def estimates(self, /) -> dict[str, float]"),
                   "What the law observes, by name, SI; empty where it observes nothing.");
  m.def(
      "law",
      [](const std::string& name, nb::handle parameters, bool single) {
        return single ? make<float>(name, parameters) : make<double>(name, parameters);
      },
      nb::arg("name"), nb::arg("parameters").none(), nb::arg("single") = false,
      nb::sig("def law(name: str, parameters: ArrayLike, single: bool = False) -> Law"), make_doc);
  m.def("laws", laws, nb::sig("def laws() -> list[dict]"), laws_doc);
  m.def(
      "fuzz_law",
      [](const char* law, nb::handle parameters, std::uint64_t cycles, std::uint64_t seed, bool single) {
        return single ? fuzz_any<float>(law, parameters, cycles, seed)
                      : fuzz_any<double>(law, parameters, cycles, seed);
      },
      nb::arg("law"), nb::arg("parameters"), nb::arg("cycles"), nb::arg("seed"), nb::arg("single") = false,
      nb::sig("def fuzz_law(law: str, parameters: ArrayLike, cycles: int, seed: int, single: bool = False) -> "
              "tuple[int, int, int, int]"),
      fuzz_doc);
  m.def(
      "time_law",
      [](const char* law, nb::handle parameters, std::size_t cycles, bool single) {
        return single ? time_any<float>(law, parameters, cycles) : time_any<double>(law, parameters, cycles);
      },
      nb::arg("law"), nb::arg("parameters"), nb::arg("cycles"), nb::arg("single") = false,
      nb::sig("def time_law(law: str, parameters: ArrayLike, cycles: int, single: bool = False) -> NDArray[float64]"),
      time_doc);
}

}  // namespace bindings
