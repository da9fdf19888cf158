// The observer of several joints' momentum: its step by numbers, and the momentum of coupled motors by the matrix.
#include "check.hpp"

#include <pellucid/momentum_observer.hpp>

namespace p = pellucid;

namespace {

template <class S> void one_step() {
  p::MomentumObserverState<S, 2> s;
  const S net[2] = {S(3), S(-3)}, weight[2] = {S(1), S(0.5)}, transported[2] = {S(0.25), S(-0.25)};
  const S p0[2] = {S(2), S(-4)}, p1[2] = {S(2.5), S(-4.5)};
  p::step(S(8), S(0.25), 2, s, net, weight, p0, transported);
  check(s.started && s.explained[0] == S(2) && s.explained[1] == S(-4) && s.residual[0] == S(0), "begins with p");
  s.residual[0] = S(0.5);
  s.residual[1] = S(-0.5);
  p::step(S(8), S(0.25), 2, s, net, weight, p1, transported);
  check(s.explained[0] == S(2.6875) && s.explained[1] == S(-5.0625), "what is accounted for");
  check(s.residual[0] == S(-1.5) && s.residual[1] == S(4.5), "w times the rest");
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S bad[2] = {S(2), nan};
  p::step(S(8), S(0.25), 2, s, net, weight, bad, transported);
  check(!s.started && s.residual[0] == S(0) && s.explained[0] == S(0), "what is no number begins anew, in all joints");
  const S other[2] = {nan, S(2)};
  p::step(S(8), S(0.25), 2, s, net, weight, p0, transported);
  p::step(S(8), S(0.25), 2, s, net, weight, other, transported);
  check(!s.started, "whichever joint it is of");
  p::step(S(8), S(0.25), 1, s, net, weight, p0, transported);
  check(s.explained[1] == S(0), "joints beyond are left alone");
}

}  // namespace

int main() {
  one_step<double>();
  one_step<float>();
  return failures();
}
