// One plant for every test: friction of every kind, a cascade loop, an encoder, ripple.
#pragma once

#include "check.hpp"

#include <pellucid/pellucid.hpp>

template <class S> pellucid::JointParams<S> example_joint() {
  return {S(0.05),
          S(1.5),
          S(-0.2),
          S(0.05),
          {S(0.3), S(0.25), S(0.1), S(0.15), S(0.12), S(0.1), S(0.08), S(0.15), S(0.05)}};
}
template <class S> pellucid::PlantParams<S> example_plant() {
  pellucid::PlantParams<S> params;
  params.joint = example_joint<S>();
  params.drive = {S(1.2), S(0.05), S(0.02), S(14), S(0.3)};
  params.loop = {pellucid::LoopKind::cascade, S(12), S(0.8), S(0), S(1.5), S(3), 2, S(1e-3)};
  params.encoder = {S(1e-4)};
  params.substeps = 5;
  return params;
}
/// Parameters drawn at random, as a joint of an exoskeleton may have them.
template <class S> pellucid::JointParams<S> random_joint(Random& random) {
  const auto in = [&random](double low, double high) { return S(random.uniform(low, high)); };
  return {in(0.01, 2),
          in(-20, 20),
          in(-5, 5),
          in(-1, 1),
          {in(0, 5), in(0, 5), in(0, 3), in(0, 3), in(0, 2), in(0.01, 0.5), in(0, 0.4), in(0, 0.6),
           random.uniform() < 0.5 ? S(0) : in(1e-3, 0.2)}};
}
inline double reference_at(std::size_t k) {
  const double t = 1e-3 * static_cast<double>(k);
  return 0.6 * std::sin(3 * t) + 0.2 * std::sin(17 * t);
}
