// A strap along a motion of robot and limb: its torques on both, and their derivatives by its parameters.
#include "strap.hpp"

#include "fields.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/strap.hpp>

#include <algorithm>
#include <cmath>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* torque_doc = R"(What a strap does along a motion that is known; at first it has settled.

Parameters
----------
parameters : (11,)
    In the order of STRAP_PARAMETER_NAMES, SI.
robot_position, robot_velocity, limb_position, limb_velocity : (n,)
    Angles [rad] and their rates [rad/s].
period : float
    Between two samples [s], > 0.

Returns
-------
tuple of (n,)
    Torque against the limb and on the robot [N m], and by how much it has slipped [rad].)";

constexpr const char* jacobian_doc = R"(`strap_torque` against the limb, and its derivatives.

Parameters
----------
parameters, robot_position, robot_velocity, limb_position, limb_velocity, period
    As of `strap_torque`.
active : (k,) of int
    Which parameters, as indices into STRAP_PARAMETER_NAMES.

Returns
-------
tuple
    Torque against the limb (n,) [N m], and its derivatives (n, k).)";

constexpr std::size_t numbers_of_strap = p::field_count<p::StrapParams<double>>;
constexpr std::size_t block = 8;

struct Motion {
  Array robot, robot_rate, limb, limb_rate;
  double period;
  std::size_t n;

  Motion(nb::handle q_e, nb::handle v_e, nb::handle q_k, nb::handle v_k, double seconds)
      : robot(read_array("robot_position", q_e)),
        robot_rate(read_array("robot_velocity", v_e)),
        limb(read_array("limb_position", q_k)),
        limb_rate(read_array("limb_velocity", v_k)),
        period(seconds) {
    if (!(period > 0 && std::isfinite(period))) throw nb::value_error("period: expected a number of seconds above 0");
    if (robot.shape.size() != 1) robot.fail("(n,)");
    n = robot.shape[0];
    for (const Array* other : {&robot_rate, &limb, &limb_rate})
      other->expect(same_length("robot_position", n), {n});
  }
};

template <class S, class Out> void along(const p::StrapParams<S>& params, const Motion& m, const Out& out) {
  const auto c = p::coefficients(params);
  p::StrapState<S> state;
  if (m.n > 0) state = p::settled(c, p::stretch(c, S(m.limb.data[0]) - p::alignment(c, S(m.robot.data[0])).limb));
  for (std::size_t i = 0; i < m.n; ++i) {
    const auto pull = p::pull(c, state, S(m.robot.data[i]), S(m.robot_rate.data[i]), S(m.limb.data[i]),
                              S(m.limb_rate.data[i]));
    out(i, pull, state);
    p::advance(c, state, pull, S(m.period));
  }
}

nb::object strap_torque(nb::handle parameters, nb::handle robot_position, nb::handle robot_velocity,
                        nb::handle limb_position, nb::handle limb_velocity, double period) {
  const auto params = read_params<p::StrapParams<double>, double>("parameters", parameters);
  const Motion m(robot_position, robot_velocity, limb_position, limb_velocity, period);
  std::vector<Result> results;
  for (int i = 0; i < 3; ++i) results.emplace_back(Shape{m.n});
  along(params, m, [&](std::size_t i, const p::StrapPull<double>& pull, const p::StrapState<double>& state) {
    results[0].data[i] = pull.limb;
    results[1].data[i] = pull.robot;
    results[2].data[i] = state.slip;
  });
  return tuple_of(results);
}

nb::object strap_torque_jacobian(nb::handle parameters, nb::handle robot_position, nb::handle robot_velocity,
                                 nb::handle limb_position, nb::handle limb_velocity, double period, nb::handle active) {
  using Dual = p::Dual<double, block>;
  const Array values = read_array("parameters", parameters);
  values.expect(text({numbers_of_strap}), {numbers_of_strap});
  const Motion m(robot_position, robot_velocity, limb_position, limb_velocity, period);
  const std::vector<std::size_t> which = read_indices("active", active, numbers_of_strap);
  const std::size_t k = which.size();
  std::vector<Result> results;
  results.emplace_back(Shape{m.n});
  results.emplace_back(Shape{m.n, k});
  for (std::size_t first = 0; first == 0 || first < k; first += block) {
    Dual numbers[numbers_of_strap];
    for (std::size_t i = 0; i < numbers_of_strap; ++i) numbers[i] = Dual(values.data[i]);
    const std::size_t count = std::min(block, k - first);
    for (std::size_t i = 0; i < count; ++i)
      numbers[which[first + i]] = Dual::parameter(values.data[which[first + i]], i);
    along(p::from_numbers<p::StrapParams<Dual>>(numbers), m,
          [&](std::size_t i, const p::StrapPull<Dual>& pull, const p::StrapState<Dual>&) {
            results[0].data[i] = pull.limb.value;
            for (std::size_t j = 0; j < count; ++j) results[1].data[i * k + first + j] = pull.limb.derivative[j];
          });
  }
  return tuple_of(results);
}

constexpr const char* torque_sig =
    "def strap_torque(parameters: ArrayLike, robot_position: ArrayLike, robot_velocity: ArrayLike, limb_position: "
    "ArrayLike, limb_velocity: ArrayLike, *, period: float) -> tuple[NDArray[float64], ...]";
constexpr const char* jacobian_sig =
    "def strap_torque_jacobian(parameters: ArrayLike, robot_position: ArrayLike, robot_velocity: ArrayLike, "
    "limb_position: ArrayLike, limb_velocity: ArrayLike, *, period: float, active: ArrayLike) -> "
    "tuple[NDArray[float64], NDArray[float64]]";

}  // namespace

void add_strap(nb::module_& m) {
  m.attr("STRAP_PARAMETER_NAMES") = names_of<p::StrapParams<double>>();
  m.def("strap_torque", &strap_torque, nb::arg("parameters"), nb::arg("robot_position"), nb::arg("robot_velocity"),
        nb::arg("limb_position"), nb::arg("limb_velocity"), nb::kw_only(), nb::arg("period"), nb::sig(torque_sig),
        torque_doc);
  m.def("strap_torque_jacobian", &strap_torque_jacobian, nb::arg("parameters"), nb::arg("robot_position"),
        nb::arg("robot_velocity"), nb::arg("limb_position"), nb::arg("limb_velocity"), nb::kw_only(),
        nb::arg("period"), nb::arg("active"), nb::sig(jacobian_sig), jacobian_doc);
}

}  // namespace bindings
