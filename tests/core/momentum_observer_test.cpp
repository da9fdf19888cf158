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

/// Two hinges about one axis, 1 m apart, with a weld between them and motors that turn with both: p = (M + T'J T) v.
void coupled() {
  constexpr std::size_t room = 4;
  p::TreeParams<double, room> params;
  params.links = 3;
  for (std::uint32_t i = 0; i < 3; ++i) {
    params.link[i].parent = i;
    params.link[i].joint = i == 1 ? 0 : 1;
    params.link[i].axis_z = 1;
    params.link[i].x = i == 0 ? 0 : 0.5;
    params.link[i].body.mass = 1;
  }
  const auto c = p::coefficients(params);
  p::TreeDrivesParams<double, room> drives;
  drives.coupled = true;
  drives.turns[0][0] = 1, drives.turns[1][0] = 1, drives.turns[1][1] = 2;
  drives.motor[0].inertia = 0.5, drives.motor[1].inertia = 0.25;
  const double q[room] = {0, 0}, v[room] = {1, 2};
  p::TreePose<double, room> pose;
  p::place(c, q, pose);
  double got[room] = {}, over[room] = {};
  p::momentum(c, pose, v, got, over);
  // Masses at their links' origins: 0.5 m and 1 m from the first hinge, and at the second.
  check_close(got[0], 0.25 + 1, 1e-12, "p of the first hinge");
  check_close(got[1], 0.0, 1e-12, "p of the second");
  p::momentum(c, p::coefficients(drives, 2), pose, v, got, over);
  check_close(got[0], 0.25 + 1 + 0.5 * 1 + 0.25 * 5, 1e-12, "p with motors");
  check_close(got[1], 0.25 * 5 * 2, 1e-12, "p of the second with its own");
  drives.coupled = false;
  p::momentum(c, p::coefficients(drives, 2), pose, v, got, over);
  check_close(got[0], 0.25 + 1, 1e-12, "without coupling there are none");
}

}  // namespace

int main() {
  coupled();
  one_step<double>();
  one_step<float>();
  return failures();
}
