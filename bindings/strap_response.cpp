// A strap along a motion of the robot and the torque on it: where the limb must be, and its derivatives.
#include "strap_response.hpp"

#include "fields.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/strap_response.hpp>

#include <algorithm>
#include <cmath>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* response_doc = R"(Where a limb must be for its strap to pull at the robot as was measured.

At first the strap has settled. In its gap no torque tells where the limb is: it is then left on the flank that
pulled last.

Parameters
----------
parameters : (11,)
    In the order of STRAP_PARAMETER_NAMES, SI.
robot_position, torque : (n,)
    Angle of the robot [rad], and the strap's torque on it [N m].
period : float
    Between two samples [s], > 0.
still : float
    Torque up to which nothing pulls where there is a gap [N m].
active : (k,) of int
    Which parameters are derived by, as indices into STRAP_PARAMETER_NAMES followed by STRAP_CONTACT_NAMES.
contact : (4,)
    In the order of STRAP_CONTACT_NAMES, SI: what rubs beside the strap and gives in series with it.

Returns
-------
tuple
    The limb's angle (n,) [rad], its stretch (n,) [rad], the strap's torque against it (n,) [N m], and derivatives
    of the angle (n, k).)";

constexpr std::size_t numbers_of_strap = p::field_count<p::StrapParams<double>>;
constexpr std::size_t numbers_of_contact = p::field_count<p::StrapContactParams<double>>;
constexpr std::size_t block = 8;

template <class S, class Out>
void along(const p::StrapParams<S>& params, const p::StrapContactParams<S>& contact, const Array& robot,
           const Array& torque, double still, double period, const Out& out) {
  const auto c = p::coefficients(params);
  p::StrapResponseState<S> state;
  for (std::size_t i = 0; i < robot.shape[0]; ++i) {
    const S q(robot.data[i]), pull(torque.data[i]);
    if (i == 0)
      state = p::settled_under(c, q, pull);
    else
      p::respond(c, state, q, pull, S(still), S(period), contact.friction, contact.friction_way);
    const S against = p::limb_torque(c, q, pull);
    out(i, p::limb_position(c, state, q) + p::compression(contact, against), state.stretch, against);
  }
}

nb::object strap_response(nb::handle parameters, nb::handle robot_position, nb::handle torque, double period,
                          double still, nb::handle active, nb::handle contact) {
  if (!(period > 0 && std::isfinite(period))) throw nb::value_error("period: expected a number of seconds above 0");
  if (!(still >= 0 && std::isfinite(still))) throw nb::value_error("still: expected a torque of at least 0");
  const Array values = read_array("parameters", parameters);
  values.expect(text({numbers_of_strap}), {numbers_of_strap});
  const Array beside = read_array("contact", contact);
  beside.expect(text({numbers_of_contact}), {numbers_of_contact});
  const Array robot = read_array("robot_position", robot_position), pull = read_array("torque", torque);
  if (robot.shape.size() != 1) robot.fail("(n,)");
  const std::size_t n = robot.shape[0];
  pull.expect(same_length("robot_position", n), {n});
  const std::vector<std::size_t> which = read_indices("active", active, numbers_of_strap + numbers_of_contact);
  const std::size_t k = which.size();
  std::vector<Result> results;
  for (int i = 0; i < 3; ++i) results.emplace_back(Shape{n});
  results.emplace_back(Shape{n, k});
  if (k == 0) {
    along(read_params<p::StrapParams<double>, double>("parameters", parameters),
          read_params<p::StrapContactParams<double>, double>("contact", contact), robot, pull, still, period,
          [&](std::size_t i, double limb, double stretch, double against) {
            results[0].data[i] = limb;
            results[1].data[i] = stretch;
            results[2].data[i] = against;
          });
    return tuple_of(results);
  }
  using Dual = p::Dual<double, block>;
  for (std::size_t first = 0; first < k; first += block) {
    Dual numbers[numbers_of_strap + numbers_of_contact];
    for (std::size_t i = 0; i < numbers_of_strap; ++i) numbers[i] = Dual(values.data[i]);
    for (std::size_t i = 0; i < numbers_of_contact; ++i) numbers[numbers_of_strap + i] = Dual(beside.data[i]);
    const std::size_t count = std::min(block, k - first);
    for (std::size_t i = 0; i < count; ++i)
      numbers[which[first + i]] = Dual::parameter(numbers[which[first + i]].value, i);
    along(p::from_numbers<p::StrapParams<Dual>>(numbers),
          p::from_numbers<p::StrapContactParams<Dual>>(numbers + numbers_of_strap), robot, pull, still, period,
          [&](std::size_t i, const Dual& limb, const Dual& stretch, const Dual& against) {
            results[0].data[i] = limb.value;
            results[1].data[i] = stretch.value;
            results[2].data[i] = against.value;
            for (std::size_t j = 0; j < count; ++j) results[3].data[i * k + first + j] = limb.derivative[j];
          });
  }
  return tuple_of(results);
}

constexpr const char* response_sig =
    "def strap_response(parameters: ArrayLike, robot_position: ArrayLike, torque: ArrayLike, *, period: float, still: "
    "float, active: ArrayLike, contact: ArrayLike = (0.0, 0.0, 0.0, 0.0)) -> tuple[NDArray[numpy.float64], ...]";

}  // namespace

void add_strap_response(nb::module_& m) {
  m.attr("STRAP_CONTACT_NAMES") = names_of<p::StrapContactParams<double>>();
  m.def("strap_response", &strap_response, nb::arg("parameters"), nb::arg("robot_position"), nb::arg("torque"),
        nb::kw_only(), nb::arg("period"), nb::arg("still"), nb::arg("active"),
        nb::arg("contact") = nb::make_tuple(0.0, 0.0, 0.0, 0.0), nb::sig(response_sig), response_doc);
}

}  // namespace bindings
