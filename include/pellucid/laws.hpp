// All control laws: Python's classes, the virtual lab, C for a microcontroller, fuzzers and benchmarks take them from here.
#pragma once

#include "directional_compensation.hpp"
#include "joint_compensation.hpp"
#include "position_prediction.hpp"
#include "residual_compensator.hpp"
#include "rule_compensation.hpp"
#include "transparent_compensation.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// A law without its scalar.
template <template <class> class L> struct LawOf {
  template <class S> using law = L<S>;
};
template <template <class> class... L> struct LawList {
  /// Calls f with each law, as a LawOf.
  template <class F> static constexpr void for_each(F&& f) { (f(LawOf<L>{}), ...); }
  /// One of a law in scalar S, each wrapped in W: a variant's alternatives.
  template <template <class...> class Variant, template <class> class W, class S> using any = Variant<W<L<S>>...>;
};

using Laws = LawList<JointCompensation, ResidualCompensator, PositionPrediction, DirectionalCompensation, RuleCompensation,
                     TransparentCompensation>;

}  // namespace PELLUCID_ABI
}  // namespace pellucid
