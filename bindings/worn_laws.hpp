// One control period of every supervised law on a robot that somebody wears, for all models of a person: what
// healthy_laws.cpp and faulty_laws.cpp compile.
#pragma once

#include "worn_arm.hpp"

namespace bindings {
namespace {

/// The same for one law. Everything inlined: a quarter of a study's time goes into calls between functions of a line or two.
template <class Law, class Fault>
[[gnu::flatten]] pellucid::SupervisorOutput<double> step_one(Law& law, const pellucid::Samples<double>& samples, double drive,
                                                             double joint, std::int64_t now, Fault& fault,
                                                             LawCommand* command) {
  pellucid::Samples<double> read = pellucid::stamped(law, samples, now);
  const pellucid::Sample<double> stamp = read.position;
  pellucid::Feedback<double> back;
  back.drive = {drive, stamp.time, stamp.sequence, true};
  back.joint = {joint, stamp.time, stamp.sequence, true};
  std::int64_t clock = now;
  fault.samples(law, read, back, clock);
  if (command != nullptr) command->tell(law, read, clock);
  return pellucid::step(law, read, back, clock);
}

}  // namespace

template <class Fault>
void step_worn_law(AnySupervised<double>& law, const pellucid::Samples<double>& samples, double drive, double joint,
                   std::int64_t now, Fault& fault, pellucid::SupervisorOutput<double>& out, LawCommand* command) {
  of_law(law, 0, [&](auto& one) { return out = step_one(one, samples, drive, joint, now, fault, command), 0; });
}

}  // namespace bindings
