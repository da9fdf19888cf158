// Which joints stick: against every one of the 3^n ways that n joints may rest or slip.
#include "check.hpp"

#include <pellucid/lanes.hpp>
#include <pellucid/rest.hpp>

namespace p = pellucid;

constexpr std::size_t most = 12;
using Matrix = p::SquareMatrix<double, most>;

struct Problem {
  std::size_t n;
  Matrix a;
  double free[most], low[most], high[most];
};

/// Inverse inertias of bodies that differ by up to `spread` powers of ten, coupled at random.
Problem drawn(Random& random, std::size_t n, double spread) {
  Problem made{};
  made.n = n;
  double b[most][most], scale[most];
  for (std::size_t i = 0; i < n; ++i) {
    scale[i] = std::pow(10.0, random.uniform(-spread / 2, spread / 2));
    for (std::size_t k = 0; k < n; ++k) b[i][k] = random.uniform(-1, 1);
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < n; ++k) {
      double sum = i == k ? 0.05 : 0.0;
      for (std::size_t l = 0; l < n; ++l) sum += b[i][l] * b[k][l];
      made.a.at[i][k] = sum * scale[i] * scale[k];
    }
  for (std::size_t i = 0; i < n; ++i) {
    made.free[i] = scale[i] * random.uniform(-2, 2);
    made.low[i] = -random.uniform(0, 2) / scale[i];
    made.high[i] = random.uniform(0, 2) / scale[i];
  }
  return made;
}

template <class S> auto bounds(const Problem& made) {
  return [&made](std::size_t i, const S*, S& low, S& high) { low = S(made.low[i]), high = S(made.high[i]); };
}

/// The one way of 3^n in which every joint does what its force says.
bool by_brute_force(const Problem& made, double* forces, bool* rests) {
  std::size_t ways = 1;
  for (std::size_t i = 0; i < made.n; ++i) ways *= 3;
  for (std::size_t way = 0; way < ways; ++way) {
    Matrix stopped = made.a;
    double r[most], step[most], given[most];
    bool stops[most];
    for (std::size_t i = 0, rest = way; i < made.n; ++i, rest /= 3) {
      stops[i] = rest % 3 == 0;
      given[i] = stops[i] ? 0 : rest % 3 == 1 ? made.low[i] : made.high[i];
    }
    for (std::size_t i = 0; i < made.n; ++i) {
      r[i] = made.free[i];
      for (std::size_t k = 0; k < made.n; ++k) r[i] += made.a.at[i][k] * given[k];
      step[i] = stops[i] ? -r[i] : 0;
      for (std::size_t k = 0; k < made.n; ++k)
        if (!stops[i] || !stops[k]) stopped.at[i][k] = i == k ? 1 : 0;
    }
    p::factorise(stopped, made.n);
    p::solve(stopped, made.n, step);
    bool holds = true;
    for (std::size_t i = 0; i < made.n; ++i) {
      for (std::size_t k = 0; k < made.n; ++k) r[i] += made.a.at[i][k] * step[k];
      given[i] += step[i];
      holds = holds && (stops[i]                  ? given[i] > made.low[i] && given[i] < made.high[i]
                        : given[i] == made.low[i] ? r[i] >= 0
                                                  : r[i] <= 0);
    }
    if (!holds) continue;
    for (std::size_t i = 0; i < made.n; ++i) forces[i] = given[i], rests[i] = stops[i];
    return true;
  }
  return false;
}

void against_every_way() {
  Random random(3);
  int resting = 0, slipping = 0;
  for (int run = 0; run < 20000; ++run) {
    const std::size_t n = 1 + random.bits() % 4;
    const Problem made = drawn(random, n, run % 2 == 0 ? 0.0 : 4.0);
    double wanted[most] = {}, found[most] = {};
    bool stops[most] = {}, rests[most] = {};
    check(by_brute_force(made, wanted, stops), "there is an answer");
    p::find_rest(made.a, n, made.free, bounds<double>(made), found, rests);
    for (std::size_t i = 0; i < n; ++i) {
      check(rests[i] == stops[i], "rests where it must");
      check_close(found[i], wanted[i], 1e-9 * (made.high[i] - made.low[i]), "force");
      (stops[i] ? resting : slipping) += 1;
    }
  }
  check(resting > 10000 && slipping > 10000, "both are common");
}

/// More joints than ways can be gone through: what must hold of the answer, holds.
void of_many() {
  Random random(4);
  for (int run = 0; run < 3000; ++run) {
    const std::size_t n = 5 + random.bits() % 8;
    const Problem made = drawn(random, n, run % 2 == 0 ? 0.0 : 4.0);
    double force[most] = {};
    bool rests[most] = {};
    p::find_rest(made.a, n, made.free, bounds<double>(made), force, rests);
    for (std::size_t i = 0; i < n; ++i) {
      double r = made.free[i], size = std::fabs(r);
      for (std::size_t k = 0; k < n; ++k) {
        r += made.a.at[i][k] * force[k];
        size += std::fabs(made.a.at[i][k] * force[k]);
      }
      check(force[i] >= made.low[i] && force[i] <= made.high[i], "no more than friction can give");
      if (rests[i]) check(std::fabs(r) <= 1e-9 * size, "what rests, rests");
      if (!rests[i]) check(force[i] == (r > 0 ? made.low[i] : made.high[i]), "what slips is resisted in full");
    }
  }
}

/// One friction acts on the sum of two others: three forces on two joints, and the motion is unique all the same.
void dependent() {
  Random random(5);
  for (int run = 0; run < 2000; ++run) {
    const double a = random.uniform(0.5, 2), b = random.uniform(0.5, 2), c = random.uniform(-0.4, 0.4);
    Problem made{};
    made.n = 3;
    const double w[3][2] = {{1, 0}, {0, 1}, {1, 1}}, m[2][2] = {{a, c}, {c, b}};
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        double sum = 0;
        for (int x = 0; x < 2; ++x)
          for (int y = 0; y < 2; ++y) sum += w[i][x] * m[x][y] * w[k][y];
        made.a.at[i][k] = sum;
      }
    const double v[2] = {random.uniform(-2, 2), random.uniform(-2, 2)};
    for (int i = 0; i < 3; ++i) {
      made.free[i] = w[i][0] * v[0] + w[i][1] * v[1];
      made.high[i] = random.uniform(0, 1);
      made.low[i] = -made.high[i];
    }
    double force[most] = {};
    bool rests[most] = {};
    p::find_rest(made.a, 3, made.free, bounds<double>(made), force, rests);
    for (std::size_t i = 0; i < 3; ++i) {
      double r = made.free[i];
      for (std::size_t k = 0; k < 3; ++k) r += made.a.at[i][k] * force[k];
      if (rests[i]) check(std::fabs(r) < 1e-8, "what rests, rests");
      if (!rests[i])
        check(std::fabs(r) < 1e-8 || force[i] == (r > 0 ? made.low[i] : made.high[i]), "what slips is resisted");
    }
  }
}

/// A lane has the bits of the scalar run, though its neighbours take more rounds.
void lanes() {
  using L = p::Lanes<double, 8>;
  Random random(6);
  for (int run = 0; run < 300; ++run) {
    Problem made[8];
    p::SquareMatrix<L, most> a;
    L free[most], low[most], high[most], force[most];
    for (std::size_t l = 0; l < 8; ++l) {
      made[l] = drawn(random, 5, 2.0);
      for (std::size_t i = 0; i < 5; ++i) {
        for (std::size_t k = 0; k < 5; ++k) a.at[i][k].set(l, made[l].a.at[i][k]);
        free[i].set(l, made[l].free[i]), low[i].set(l, made[l].low[i]), high[i].set(l, made[l].high[i]);
        force[i].set(l, 0);
      }
    }
    p::mask_t<L> rests[most];
    p::find_rest(
        a, 5, free, [&](std::size_t i, const L*, L& from, L& to) { from = low[i], to = high[i]; }, force, rests);
    for (std::size_t l = 0; l < 8; ++l) {
      double alone[most] = {};
      bool stops[most];
      p::find_rest(made[l].a, 5, made[l].free, bounds<double>(made[l]), alone, stops);
      for (std::size_t i = 0; i < 5; ++i) check(force[i][l] == alone[i] && rests[i][l] == stops[i], "bits of a lane");
    }
  }
}

void nonsense() {
  Random random(7);
  for (int run = 0; run < 2000; ++run) {
    Problem made = drawn(random, 6, 1.0);
    for (int bad = 0; bad < 5; ++bad) {
      made.free[random.bits() % 6] = random.anything<double>();
      made.a.at[random.bits() % 6][random.bits() % 6] = random.anything<double>();
    }
    double force[most];
    bool rests[most];
    for (double& x : force) x = random.anything<double>();
    p::find_rest(made.a, 6, made.free, bounds<double>(made), force, rests);
    for (std::size_t i = 0; i < 6; ++i)
      check(force[i] >= made.low[i] && force[i] <= made.high[i], "no more than friction can give");
  }
}

int main() {
  against_every_way();
  of_many();
  dependent();
  lanes();
  nonsense();
  return failures() != 0;
}
