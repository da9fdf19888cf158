// Efforts of several joints that somebody else computes, behind the gate and the supervisor of a compensation.
//
// The coefficients are a compensation's: its tree and its friction are what the momentum's observer and the supervisor's
// watches know of the robot, its gate is the last step. Its shares have no effect. A command that is no number shuts the
// gate.
#pragma once

#include "tree_compensation.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S, std::size_t N> struct CommandedTreeState : TreeCompensationState<S, N> {
  S command[N]{};  ///< effort that each joint is to have from the next step on [N m; N]
};

/// One control period: the commanded efforts, within the limits of the gate.
template <class S, std::size_t N>
TreeCommand<S, N> step(const TreeCompensationCoefficients<S, N>& c, CommandedTreeState<S, N>& s,
                       const TreeSamples<S, N>& samples) noexcept {
  S wanted[N]{}, v[N]{};
  if (detail::follow(c, s, samples, wanted, v))
    for (std::size_t k = 0; k < c.gate.joints; ++k) wanted[k] = s.command[k];
  return detail::pass_gate(c, s, samples, wanted, v);
}

template <class S, std::size_t N> void reset(CommandedTreeState<S, N>& state) noexcept {
  reset(static_cast<TreeCompensationState<S, N>&>(state));
  for (S& command : state.command) command = S(0);
}

template <class S, std::size_t N> struct CommandedTree : TreeCompensation<S, N> {
  using State = CommandedTreeState<S, N>;
  static constexpr const char* name = "commanded_tree";
  static constexpr const char* type = "CommandedTree";
  static constexpr const char* title = "commanded efforts of all joints of a robot";
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
