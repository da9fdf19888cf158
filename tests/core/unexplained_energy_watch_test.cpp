// The watch for energy that neither command nor force sensor explains: every term of its balance alone, in both signs,
// its limit just met and just passed, what it forgets, and a worn joint whose model is as wrong as it may be.
#include "check.hpp"
#include "law_numbers.hpp"

#include <pellucid/supervisor.hpp>
#include <pellucid/transparent_compensation.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
constexpr double never = std::numeric_limits<double>::infinity();

/// A joint of 0.5 kg m² with what the momentum observer made of a period; a period is a quarter of a second.
template <class S> struct Balance {
  p::UnexplainedEnergyParams<S> params{S(4), S(0), S(0), S(0x1p-60)};
  p::BodyResidualCoefficients<S> of{};
  p::BodyResidualState<S> body{};
  p::UnexplainedEnergyState<S> s{};
  Balance() {
    of.params.inertia = S(0.5);
    of.inverse_width = S(8);
  }
  F step(S velocity, S effort, S felt) {
    return p::step(p::coefficients(params, S(0.25)), s, of, body, velocity, effort, felt);
  }
};

template <class S> void coefficients() {
  const p::UnexplainedEnergyParams<S> usual;
  check(usual.limit == S(never) && usual.gain == S(0) && usual.offset == S(0) && usual.memory == S(0.1), "off, ten seconds");
  const auto made = [](S limit, S gain, S offset, S memory) {
    return p::coefficients(p::UnexplainedEnergyParams<S>{limit, gain, offset, memory}, S(0.5));
  };
  check(made(S(1), S(0.25), S(2), S(0.5)).keeping == S(0.75) && made(S(1), S(0.25), S(2), S(0.5)).period == S(0.5), "once");
  check(made(S(1), S(1), S(0), S(1.75)).valid == 1 && made(S(1), S(0), S(0), S(2)).valid == 0, "slower than the period");
  check(made(S(0), S(0), S(0), S(1)).valid == 0 && made(S(1), S(-0.125), S(0), S(1)).valid == 0, "no limit, a negative gain");
  check(made(S(1), S(1.125), S(0), S(1)).valid == 0 && made(S(1), S(0), S(-1), S(1)).valid == 0, "more than all, an offset");
  check(made(S(1), S(0), S(0), S(0)).valid == 0 && made(S(1), S(0), S(0), S(-1)).valid == 0, "a memory without an end");
}

template <class S> void terms() {
  for (const S way : {S(-1), S(1)}) {
    {
      Balance<S> b;
      b.step(way * S(2), S(0), S(0));
      check(b.s.energy == S(0) && b.s.kinetic == S(1) && b.s.started, "the speed that it starts with is nobody's");
      b.step(way * S(4), S(0), S(0));
      check(b.s.energy == S(3) && b.s.kinetic == S(4), "half of inertia times the squared speed");
      b.step(way * S(-2), S(0), S(0));
      check(b.s.energy == S(0), "and what slows down gives it back");
    }
    {
      Balance<S> b;
      b.step(way * S(4), S(0), S(0));
      b.s.energy = S(2);
      b.body.at_stop = true;
      b.step(way * S(2), S(0), S(0));
      check(b.s.energy == S(0), "a stop takes energy");
      b.step(way * S(-4), S(0), S(0));
      check(b.s.energy == S(0) && b.s.kinetic == S(4), "and returns it");
      b.body.at_stop = false;
      b.step(way * S(-5), S(0), S(0));
      check(b.s.energy == S(2.25), "what comes after it is counted");
    }
    const auto power = [&](S weight, S effort, S felt, S gain = S(0), S offset = S(0)) {
      Balance<S> b;
      b.params.gain = gain;
      b.params.offset = offset;
      b.body.weight = weight;
      b.step(way * S(2), effort, felt);
      return b.s.energy;
    };
    // A period at 2 rad/s moves the joint by half a radian.
    check(power(way * S(3), S(0), S(0)) == S(1.5), "a weight that was lifted");
    check(power(way * S(-3), S(0), S(0)) == S(0), "and one that came down");
    check(power(way * S(5), way * S(2), S(0)) == S(1.5), "the command explains its share");
    check(power(way * S(5), S(0), way * S(2)) == S(1.5), "and the wearer theirs");
    check(power(S(0), way * S(-3), S(0)) == S(1.5) && power(S(0), S(0), way * S(-3)) == S(1.5), "whoever brakes in vain");
    check(power(way * S(8), S(0), way * S(4), S(0.25)) == S(1.5), "less a share of what the sensor says");
    check(power(S(0), S(0), way * S(-4), S(0.25)) == S(1.5), "whichever sign that has");
    check(power(way * S(8), way * S(2), way * S(2), S(0), S(1)) == S(1.5), "less the offset");
    const auto friction = [&](S speed, S level, S drag) {
      Balance<S> b;
      b.body.level = level;
      b.body.drag = drag;
      b.step(way * speed, S(0), S(0));
      return b.s.energy;
    };
    const S tolerance = S(1e-6);
    check_close(friction(S(2), S(4), S(4)), S(1.4), tolerance, "0.7 of the friction of a sliding joint");
    check_close(friction(S(2), S(4), S(6)), S(2.1), tolerance, "of all of it");
    check_close(friction(S(0.125), S(4), S(4)), S(0.0875), tolerance, "where it slides");
    check_close(friction(S(0.0625), S(4), S(4)), S(0.021875), tolerance, "half of its level at half of its width");
    check_close(friction(S(0.0625), S(4), S(5)), S(0.0328125), tolerance, "and all that grows with speed");
  }
}

template <class S> void limits() {
  for (const S way : {S(-1), S(1)}) {
    Balance<S> b;
    b.body.weight = way * S(4);
    for (int k = 1; k <= 2; ++k) check(b.step(way * S(2), S(0), S(0)) == F::none, "up to the limit");
    check(b.s.energy == S(4), "at the limit");
    Balance<S> beyond = b;
    b.body.weight = S(0);
    check(b.step(way * S(2), S(0), S(0)) == F::none, "where it may stay");
    beyond.body.weight = way * S(0.125);
    check(beyond.step(way * S(2), S(0), S(0)) == F::unexplained_energy && beyond.s.energy == S(4.0625), "and not beyond");
    check(beyond.step(way * S(2), way * S(1), S(0)) == F::none, "until it is given back");
    b.params.memory = S(1);
    b.step(way * S(2), S(0), S(0));
    check(b.s.energy == S(3), "a quarter is forgotten");
    b.step(way * S(2), way * S(4), S(0));
    check(b.s.energy == S(0.25), "and given back");
    b.step(way * S(2), way * S(1), S(0));
    check(b.s.energy == S(0), "down to none");
  }
}

template <class S> void no_numbers() {
  const S nan = std::numeric_limits<S>::quiet_NaN(), huge = std::numeric_limits<S>::infinity();
  const auto all = {nan, huge, -huge};
  for (const S wrong : all) {
    for (int what = 0; what < 4; ++what) {
      Balance<S> b;
      b.step(S(1), S(0), S(0));
      if (what == 3) b.body.weight = wrong;
      check(b.step(what == 0 ? wrong : S(1), what == 1 ? wrong : S(0), what == 2 ? wrong : S(0)) == F::unexplained_energy,
            "no number is a fault");
      check(!(b.s.energy <= S(4)), "and stays one");
      Balance<S> off;
      off.params.limit = huge;
      check(off.step(what == 0 ? wrong : S(1), what == 1 ? wrong : S(0), what == 2 ? wrong : S(0)) == F::none &&
                off.s.energy == S(0) && !off.s.started, "but where nothing is watched");
    }
  }
  Balance<S> b;
  check(b.step(std::numeric_limits<S>::max(), S(0), S(0)) == F::unexplained_energy, "nor one that is too large to square");
}

// --- under the supervisor --------------------------------------------------------------------------------------------

using Law = p::TransparentCompensation<double>;
constexpr double period = 1e-3, inertia = 0.05, gravity = 2.0, coulomb = 0.3;

p::SupervisorParams<double> watches(double limit) {
  p::SupervisorParams<double> w;
  w.body.inertia = inertia;
  w.body.gravity_sine = gravity;
  w.body.coulomb = coulomb;
  w.force.expected = 1;
  w.force.range = 25;
  w.degrades = 1;
  w.unexplained = {limit, 0, 0.1, 0.1};
  return w;
}

struct Outcome {
  F fault = F::none;
  double found = never;  // after the onset [s]
  double largest = 0;    // of what nobody accounts for, before [J]
};

/// A joint that a wearer leads by a strap, with a model that is wrong by shares of inertia, weight and friction, while
/// its drive adds a sine from 3 s on; `sensor` is what the force sensor says of the strap's torque.
template <class Sensor> Outcome worn(double limit, double shares, double added, Sensor&& sensor, bool expected = true) {
  p::Supervised<Law> law;
  auto params = typical_params<Law::Params>();
  params.gate.effort_limit = 10;
  params.gate.rate_limit = 1000;
  params.gate.velocity_limit = never;
  params.gate.position_min = -never;
  params.gate.position_max = never;
  params.gate.period = period;
  auto w = watches(limit);
  if (!expected) w.force.expected = 0;
  p::configure(law, params, w);
  Outcome made;
  double q = 0.7, v = 0, felt = 0;
  for (int k = 0; k < 9000; ++k) {
    const double t = period * k, since = t - 3;
    const std::int64_t now = 1000 * (k + 1);
    const auto number = static_cast<std::uint32_t>(k + 1);
    p::Samples<double> read;
    read.position = {q, now, number, true};
    read.interaction = {sensor(felt, t), now, number, true};
    const auto out = p::step(law, read, p::Feedback<double>{}, now);
    if (since < 0) made.largest = std::fmax(made.largest, law.state.unexplained.energy);
    if (out.fault != F::none && made.fault == F::none) made.fault = out.fault, made.found = since;
    const double effort = (out.enable ? out.effort : 0) + (since >= 0 && out.enable ? added * std::sin(15.7 * since) : 0);
    for (int i = 0; i < 4; ++i) {
      const double aim = 0.9 + 0.6 * std::sin(4 * t);
      felt = 25 * (aim - q) + 1.5 * (2.4 * std::cos(4 * t) - v);
      const double friction = (1 - shares) * coulomb * std::tanh(v / 0.02);
      const double pull = effort + felt - (1 + shares) * gravity * std::sin(q) - friction;
      v += 0.25 * period * pull / ((1 + shares) * inertia);
      q += 0.25 * period * v;
    }
  }
  return made;
}

void supervised() {
  const auto right = [](double felt, double) { return felt; };
  // The weight's error over the way there and back, and that of the inertia's speed: 0.3 · 2 · (cos 0.3 - cos 1.5), and
  // half of 0.015 · 2.4².
  const double needed = 0.3 * gravity * (std::cos(0.3) - std::cos(1.5)) + 0.5 * 0.015 * 2.4 * 2.4;
  for (const double shares : {-0.3, 0.0, 0.3}) {
    const Outcome healthy = worn(1.3 * needed, shares, 0, right);
    check(healthy.fault == F::none, "a model that is wrong by 0.3 is no fault");
    check(healthy.largest <= 1.3 * needed && (shares == 0 || healthy.largest > 0.3 * needed), "and uses what it needs");
    for (const double added : {-3.0, 3.0}) {
      const Outcome found = worn(1.3 * needed, shares, added, right);
      check(found.fault == F::unexplained_energy && found.found > 0 && found.found < 4, "what a drive adds is found");
      check(worn(never, shares, added, right).fault == F::none, "by no other watch");
      check(worn(1.3 * needed, shares, added, right, false).fault == F::none, "nor without a force sensor");
    }
  }
  const auto lying = [](double felt, double t) { return t < 3 ? felt : -felt; };
  check(worn(1.3 * needed, 0, 0, lying).fault == F::unexplained_energy, "a sensor with the wrong sign is found, too");
  const auto lost = [](double felt, double t) { return t < 3 ? felt : std::nan(""); };
  const Outcome without = worn(1.3 * needed, 0, 3, lost);
  check(without.fault == F::lost, "a sensor that says nothing is left out, and what it would have shown with it");
  const auto at_rail = [](double felt, double t) { return t < 3 ? felt : 30.0; };
  check(worn(1.3 * needed, 0, 0, at_rail).fault == F::force_sensor, "and so is one at its rail");
}

void modes() {
  p::SupervisorParams<double> r = watches(1);
  auto limits = typical_params<Law::Params>().gate;
  limits.period = 0x1p-10;
  auto c = p::coefficients(r, p::coefficients(limits));
  check(c.unexplained.period == 0x1p-9 && c.unexplained.params.limit == 1, "every second period");
  r.unexplained.memory = 600;
  check(c.valid == 1 && p::coefficients(r, p::coefficients(limits)).valid == 0, "no supervisor without a memory");
  for (const p::Mode mode : {p::Mode::start_up, p::Mode::running, p::Mode::degraded, p::Mode::damped_stop, p::Mode::zero}) {
    for (const bool heard : {false, true}) {
      p::SupervisorState<double> s;
      p::go(s, mode, F::none);
      s.encoder.heard = 3;
      s.steps = 1;
      s.unexplained.energy = 0.5;
      s.unexplained.started = true;
      p::Samples<double> read;
      read.position = {0.0, 1000, 1, true};
      read.interaction = {0.0, 1000, 1, heard};
      p::observe(c, s, read, p::Feedback<double>{});
      const bool counts = mode == p::Mode::running && heard;
      check(s.unexplained.started == counts && (s.unexplained.energy > 0.4) == counts, "while the law runs and it is heard");
    }
  }
}

template <class S> void all() {
  coefficients<S>();
  terms<S>();
  limits<S>();
  no_numbers<S>();
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  supervised();
  modes();
  return failures();
}
