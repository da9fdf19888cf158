// The residual of a body: its equations written a second time, and every threshold on it, in both signs.
#include "check.hpp"

#include <pellucid/body_residual.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> p::BodyResidualParams<S> body() {
  p::BodyResidualParams<S> params;
  params.inertia = S(0.05);
  params.gravity_sine = S(2);
  params.gravity_cosine = S(0.7);
  params.offset = S(0.3);
  params.coulomb = S(0.25);
  params.load = S(0.13);
  params.viscous = S(0.06);
  params.square_root = S(0.08);
  params.width = S(0.2);
  params.bandwidth = S(40);
  params.slow = S(5);
  return params;
}

template <class S> void parameters() {
  const p::BodyResidualParams<S> usual;
  check(usual.bandwidth == S(40) && usual.slow == S(5) && usual.width == S(0.1), "what the supervisor's rules leave");
  auto params = body<S>();
  const auto c = p::coefficients(params, S(0.002));
  check(c.valid && c.checks && c.period == S(0.002), "a body");
  check(std::fabs(c.following - S(0.08)) < S(1e-6) && std::fabs(c.smoothing - S(0.01)) < S(1e-6), "filters");
  check(std::fabs(c.inverse_width - S(5)) < S(1e-5), "inverse width");
  const auto valid = [&](S bandwidth, S slow) {
    params.bandwidth = bandwidth;
    params.slow = slow;
    return p::coefficients(params, S(0.5)).valid;
  };
  check(valid(S(1.75), S(1.75)) && !valid(S(2), S(1)) && !valid(S(1), S(2)), "filters slower than the period");
  check(!valid(S(2.5), S(1)) && !valid(S(1), S(2.5)) && !valid(S(-1), S(1)), "or no filters");
  params = body<S>();
  params.inertia = S(0);
  check(!p::coefficients(params, S(0.002)).checks && p::coefficients(params, S(0.002)).valid, "no model, no check");
}

/// The same equations in double, in another order, each from the text above the header.
struct Reference {
  double dt, momentum = 0, residual = 0, lasting = 0, felt = 0, burst = 0, contradiction = 0, excess = 0, open = 0;
  double level = 0, drag = 0, weight = 0;
  bool begun = false;

  void step(double q, double v, double u, double force, bool sensed) {
    const double weigh = 0.3 + 0.7 * std::cos(q) + 2 * std::sin(q);
    const double friction = 0.25 + 0.13 * std::fabs(weigh);
    const double slide = 0.06 * std::fabs(v) + 0.08 * std::sqrt(std::fabs(v));
    const double way = std::fmax(-1.0, std::fmin(1.0, v / 0.2));
    if (!begun) momentum = 0.05 * v, open = friction, begun = true;
    momentum += dt * (u + residual - weigh - friction * way - std::copysign(slide, v));
    residual = 40 * (0.05 * v - momentum);
    lasting += 5 * dt * (residual - lasting);
    open += 5 * dt * (friction - 0.7 * friction * std::fabs(way) - open);
    felt += 40 * dt * ((sensed ? force : 0) - felt);
    burst = sensed ? residual - felt : 0;
    contradiction += 5 * dt * (burst - contradiction);
    excess += 0.5 * dt * ((sensed ? std::fabs(felt) - 1.5 * std::fabs(residual) : 0) - excess);
    weight = weigh, level = friction, drag = friction + slide;
  }
};

template <class S> void equations(double tolerance) {
  const auto c = p::coefficients(body<S>(), S(0.002));
  p::BodyResidualState<S> s;
  Reference wanted{0.002};
  for (int k = 0; k < 3000; ++k) {
    const double t = 0.002 * k;
    const double q = -1.4 + 1.7 * std::sin(1.3 * t), v = 2.2 * std::cos(1.3 * t + 0.1) - 0.3, u = 3 * std::sin(2 * t);
    const double force = k < 1500 ? 0.4 * u : -3 * v;
    const bool sensed = k < 800 || k > 1100;
    wanted.step(q, v, u, force, sensed);
    p::step(c, s, S(q), S(v), S(u), S(force), sensed);
    const double pairs[][2] = {{double(s.momentum), wanted.momentum}, {double(s.residual), wanted.residual},
                               {double(s.lasting), wanted.lasting},   {double(s.felt), wanted.felt},
                               {double(s.burst), wanted.burst},       {double(s.contradiction), wanted.contradiction},
                               {double(s.excess), wanted.excess},     {double(s.open), wanted.open},
                               {double(s.level), wanted.level},       {double(s.drag), wanted.drag},
                               {double(s.weight), wanted.weight}};
    for (const auto& pair : pairs) check_close(pair[0], pair[1], tolerance, "state");
  }
}

/// A body at rest under its own weight with a wearer's push: the residual is the push, whatever its sign.
template <class S> void follows() {
  auto params = body<S>();
  params.coulomb = params.load = params.viscous = params.square_root = S(0);
  const auto c = p::coefficients(params, S(0.002));
  for (const S pushed : {S(-3), S(3)}) {
    p::BodyResidualState<S> s;
    for (int k = 0; k < 2000; ++k) p::step(c, s, S(0.4), S(0), S(2) * p::sin(S(0.4)) + S(0.7) * p::cos(S(0.4)) + S(0.3) - pushed, S(0), false);
    check(std::fabs(s.residual - pushed) < S(1e-3) && std::fabs(s.lasting - pushed) < S(1e-3), "what somebody pushes");
    check(s.burst == S(0) && s.contradiction == S(0), "no sensor contradicts");
  }
}

/// An end stop beyond the range may hold the joint against whatever moves it there: it contradicts no force sensor, and no
/// wearer pushes that hard. What pushes the joint further is judged, and so is everything within the range, where the stop's
/// part fades as it does from the residual.
template <class S> void stops() {
  auto params = body<S>();
  params.gravity_sine = params.gravity_cosine = params.offset = S(0);
  params.coulomb = params.load = params.viscous = params.square_root = S(0);
  auto c = p::coefficients(params, S(0.002));
  c.lowest = S(-1);
  c.highest = S(2);
  for (const S way : {S(-1), S(1)}) {
    const S beyond = way > S(0) ? S(2.125) : S(-1.125), within = way > S(0) ? S(2) : S(-1);
    p::BodyResidualState<S> s;
    const auto go_on = [&](int periods, S position, S effort, S felt, bool sensed) {
      for (int k = 0; k < periods; ++k) p::step(c, s, position, S(0), way * effort, way * felt, sensed);
    };
    go_on(200, beyond, S(3), S(12), true);
    check(s.at_stop && std::fabs(s.residual + way * S(3)) < S(1e-3), "the stop holds effort and wearer");
    check(s.push == S(0) && s.burst == S(0) && s.lasting == S(0) && s.contradiction == S(0), "neither is contradicted");
    check(s.excess < S(0), "nor is the sensor too loud");
    go_on(100, within, S(0), S(0), true);
    check(!s.at_stop && std::fabs(s.push) < S(0.01) && std::fabs(s.burst) < S(0.01), "what is over leaves nothing");
    check(std::fabs(s.contradiction) < S(0.01) && std::fabs(s.lasting) < S(0.01), "not even slowly");
    go_on(200, within, S(3), S(12), true);
    check(std::fabs(s.push + way * S(3)) < S(0.01) && std::fabs(s.burst + way * S(15)) < S(0.01), "within the range both are");
    s = {};
    go_on(200, beyond, S(-3), S(0), true);
    check(std::fabs(s.push - way * S(3)) < S(0.01) && std::fabs(s.burst - way * S(3)) < S(0.01), "no stop pushes outwards");
    s = {};
    go_on(200, beyond, S(3), S(0), false);
    check(s.push == S(0) && s.burst == S(0) && s.stop_beside_felt == S(0), "without a sensor");
  }
}

template <class S> void thresholds() {
  auto params = body<S>();
  params.wearer_torque = S(1);
  params.wearer_push = S(4);
  params.force_tolerance = S(0.5);
  params.force_burst = S(2);
  params.force_excess = S(0.25);
  const auto c = p::coefficients(params, S(0.002));
  const S more = S(0x1p-10);
  p::BodyResidualState<S> calm;
  calm.open = S(0.125);
  calm.level = S(0.375);
  using State = p::BodyResidualState<S>;
  const auto limit = [&](S State::*number, S bound, F fault, bool signed_one) {
    for (const S way : {S(-1), S(1)}) {
      State s = calm;
      s.*number = way * bound;
      check(p::shown(c, s) == F::none, "at the limit");
      s.*number = way * (bound + more);
      const bool beyond = !signed_one || way > S(0);
      check(p::shown(c, s) == (beyond ? fault : F::none), "beyond");
    }
    State s = calm;
    s.*number = std::numeric_limits<S>::quiet_NaN();
    check(p::shown(c, s) == fault, "no number is beyond");
  };
  limit(&State::lasting, S(1.125), F::unexplained, false);
  limit(&State::push, S(4.375), F::unexplained, false);
  limit(&State::contradiction, S(0.625), F::force_sensor, false);
  limit(&State::burst, S(2.375), F::force_sensor, false);
  limit(&State::excess, S(0.25), F::force_sensor, true);
  State both = calm;
  both.lasting = both.contradiction = S(9);
  check(p::shown(c, both) == F::unexplained, "what nobody can push comes first");
}

template <class S> void nonsense() {
  const auto c = p::coefficients(body<S>(), S(0.002));
  p::BodyResidualState<S> s;
  p::step(c, s, S(0), S(1), S(0), S(0), true);
  p::step(c, s, S(0), std::numeric_limits<S>::infinity(), S(0), S(0), true);
  check(!s.started && s.momentum == S(0) && s.open == S(0), "what is no number begins anew");
}

template <class S> void all(double tolerance) {
  parameters<S>();
  equations<S>(tolerance);
  follows<S>();
  stops<S>();
  thresholds<S>();
  nonsense<S>();
}

}  // namespace

int main() {
  all<double>(1e-10);
  all<float>(2e-3);
  return failures();
}
