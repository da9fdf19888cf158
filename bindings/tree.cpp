// A tree of rigid bodies over samples: KinematicTree of pellucid._core.
#include "tree.hpp"

#include "arrays.hpp"
#include "fields.hpp"
#include "tree_kernels.hpp"

#include <pellucid/kinematic_tree.hpp>

#include <cmath>
#include <memory>

namespace bindings {
namespace {

namespace p = pellucid;

const TreeKernels& kernels = best_tree_kernels();

constexpr const char* class_doc = R"(Rigid bodies joined in a tree by hinges, slides and welds.

Of n samples, with m coordinates: a number for each joint that moves, in the order of their links. A single sample
may be of shape (m,), and its result then is of one sample too.

Parameters
----------
links : (l, 22)
    The numbers of each link, in the order of LINK_PARAMETER_NAMES, after the link on which it hangs; at most 32.
gravity : (3,)
    In the base's frame [m/s^2].)";
constexpr const char* init_sig = "def __init__(self, links: ArrayLike, gravity: ArrayLike) -> None";
constexpr const char* inverse_dynamics_sig =
    "def inverse_dynamics(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> NDArray[float64]";
constexpr const char* inverse_dynamics_doc = R"(Effort without friction that moves it so, (n, m) [N m; N].)";
constexpr const char* gravity_sig = "def gravity(self, position: ArrayLike) -> NDArray[float64]";
constexpr const char* gravity_doc = R"(Effort that holds it where it is, (n, m) [N m; N].)";
constexpr const char* mass_matrix_sig = "def mass_matrix(self, position: ArrayLike) -> NDArray[float64]";
constexpr const char* mass_matrix_doc = R"(M(q) with rotors, (n, m, m).)";
constexpr const char* forward_dynamics_sig =
    "def forward_dynamics(self, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike, *, held: ArrayLike | None "
    "= None) -> NDArray[float64]";
constexpr const char* forward_dynamics_doc = R"(Acceleration that efforts give without friction, (n, m).

Parameters
----------
position, velocity, effort : (n, m)
held : (m,) of bool
    Joints that rest whatever the effort: their acceleration is 0.)";
constexpr const char* energy_sig =
    "def energy(self, position: ArrayLike, velocity: ArrayLike) -> tuple[NDArray[float64], NDArray[float64]]";
constexpr const char* energy_doc = R"(Kinetic and potential energy, (n,) each [J].)";
constexpr const char* placements_sig = "def placements(self, position: ArrayLike) -> NDArray[float64]";
constexpr const char* placements_doc =
    R"(Every link's frame in the base's, (n, l, 3, 4): three columns of a rotation and one of a place [m].)";
constexpr const char* jacobian_sig =
    "def jacobian(self, position: ArrayLike, link: int, point: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[float64]";
constexpr const char* jacobian_doc = R"(Velocity of a point of a link by each coordinate's, in the base's axes.

Parameters
----------
position : (n, m)
link : int
    From 0.
point : (3,)
    In the link's frame [m].

Returns
-------
(n, 6, m)
    Three rows of the point's velocity, three of the link's angular velocity.)";
constexpr const char* regressor_sig =
    "def regressor(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, *, own: ArrayLike | None = "
    "None, shared: ArrayLike | None = None, out: NDArray[float64] | None = None) -> NDArray[float64]";
constexpr const char* regressor_doc = R"(Y with effort = Y theta.

Parameters
----------
position, velocity, acceleration : (n, m)
own : (n, m, k)
    Columns of each joint that no other has: its rotor's acceleration, its friction's signs.
shared : (n, m, s)
    Columns that joints share: those of a motor that moves several.
out : (n, m, c), C-contiguous
    Where to write, instead of a new array.

Returns
-------
(n, m, c)
    c = 10 l + m k + s columns: m, m c_x, m c_y, m c_z, I_xx, I_xy, I_xz, I_yy, I_yz, I_zz of each link; then
    the own ones, joint after joint; then the shared ones.)";
constexpr const char* normal_equations_sig =
    "def normal_equations(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, effort: ArrayLike, "
    "*, weight: ArrayLike | None = None, own: ArrayLike | None = None, shared: ArrayLike | None = None) -> "
    "tuple[NDArray[float64], NDArray[float64], float]";
constexpr const char* normal_equations_doc = R"(What least squares needs of a regressor that is never stored.

Parameters
----------
position, velocity, acceleration, effort : (n, m)
weight : (n, m)
    Of squares; left out, 1. What has weight 0 is not read.
own, shared
    As of regressor.

Returns
-------
normal : (c, c)
    Y' W Y.
projected : (c,)
    Y' W effort.
square : float
    effort' W effort.)";

class KinematicTree {
 public:
  KinematicTree(nb::handle links, nb::handle gravity) : links_(read_array("links", links)) {
    const Array down = read_array("gravity", gravity);
    const auto params = read_tree(links_, down);
    numbers_.assign(links_.data, links_.data + links_.size());
    std::copy(down.data, down.data + 3, gravity_);
    coordinates_ = p::coefficients(*params).coordinates;
    prepared_.reset(std::aligned_alloc(64, (kernels.bytes + 63) / 64 * 64));
    if (prepared_ == nullptr) throw std::bad_alloc();
    kernels.prepare(numbers());
  }

  std::size_t count() const { return links_.shape[0]; }
  std::size_t coordinates() const { return coordinates_; }

  nb::object inverse_dynamics(nb::handle position, nb::handle velocity, nb::handle acceleration) const {
    // A sample alone, as loops give it, takes less time than asking whether it is something else.
    const OneSample q(position, coordinates_), v(velocity, coordinates_), a(acceleration, coordinates_);
    if (q.data != nullptr && v.data != nullptr && a.data != nullptr) {
      const Result effort({coordinates_});
      kernels.inverse_dynamics(numbers(), {1, q.data, v.data, a.data}, effort.data);
      return effort.array();
    }
    const TreeArguments in(coordinates_,
                           {{"position", position}, {"velocity", velocity}, {"acceleration", acceleration}});
    const Result effort(in.shape({coordinates_}));
    run([&] { kernels.inverse_dynamics(numbers(), in.samples, effort.data); });
    return effort.array();
  }
  nb::object gravity(nb::handle position) const {
    const TreeArguments in(coordinates_, {{"position", position}});
    const Result effort(in.shape({coordinates_}));
    run([&] { kernels.gravity(numbers(), in.samples, effort.data); });
    return effort.array();
  }
  nb::object mass_matrix(nb::handle position) const {
    const TreeArguments in(coordinates_, {{"position", position}});
    const Result matrix(in.shape({coordinates_, coordinates_}));
    run([&] { kernels.mass_matrix(numbers(), in.samples, matrix.data); });
    return matrix.array();
  }
  nb::object forward_dynamics(nb::handle position, nb::handle velocity, nb::handle effort, nb::handle held) const {
    const TreeArguments in(coordinates_, {{"position", position}, {"velocity", velocity}, {"effort", effort}});
    bool rests[most_links] = {};
    if (!held.is_none()) {
      const Array array = read_array("held", held);
      array.expect(text({coordinates_}), {coordinates_});
      for (std::size_t k = 0; k < coordinates_; ++k) rests[k] = array.data[k] != 0.0;
    }
    const Result acceleration(in.shape({coordinates_}));
    run([&] { kernels.forward_dynamics(numbers(), in.samples, rests, acceleration.data); });
    return acceleration.array();
  }
  nb::object energy(nb::handle position, nb::handle velocity) const {
    const TreeArguments in(coordinates_, {{"position", position}, {"velocity", velocity}});
    const Result kinetic(in.shape({})), potential(in.shape({}));
    run([&] { kernels.energy(numbers(), in.samples, kinetic.data, potential.data); });
    return nb::make_tuple(kinetic.array(), potential.array());
  }
  nb::object placements(nb::handle position) const {
    const TreeArguments in(coordinates_, {{"position", position}});
    const Result placements(in.shape({count(), 3, 4}));
    run([&] { kernels.placements(numbers(), in.samples, placements.data); });
    return placements.array();
  }
  nb::object jacobian(nb::handle position, nb::handle link, nb::handle point) const {
    const TreeArguments in(coordinates_, {{"position", position}});
    const auto which = static_cast<std::size_t>(read_integer("link", link, 0, static_cast<long long>(count()) - 1));
    const Array at = read_array("point", point);
    at.expect(text({3}), {3});
    const Result jacobian(in.shape({6, coordinates_}));
    run([&] { kernels.jacobian(numbers(), in.samples, which, at.data, jacobian.data); });
    return jacobian.array();
  }
  nb::object regressor(nb::handle position, nb::handle velocity, nb::handle acceleration, nb::handle own,
                       nb::handle shared, nb::handle out) const {
    const TreeArguments in(coordinates_,
                           {{"position", position}, {"velocity", velocity}, {"acceleration", acceleration}});
    const Columns more(*this, in, own, shared);
    const Shape shape = in.shape({coordinates_, more.count});
    if (out.is_none()) {
      const Result rows(shape);
      run([&] { kernels.regressor(numbers(), in.samples, more.columns, rows.data); });
      return rows.array();
    }
    nb::ndarray<double, nb::c_contig, nb::device::cpu> into;
    if (!nb::try_cast(out, into, false))
      throw nb::value_error("out: expected a writable, C-contiguous array of float64");
    Shape got;
    for (std::size_t i = 0; i < into.ndim(); ++i) got.push_back(into.shape(i));
    if (got != shape) throw nb::value_error(("out: got shape " + text(got) + ", expected " + text(shape)).c_str());
    run([&] { kernels.regressor(numbers(), in.samples, more.columns, into.data()); });
    return nb::borrow(out);
  }
  nb::object normal_equations(nb::handle position, nb::handle velocity, nb::handle acceleration, nb::handle effort,
                              nb::handle weight, nb::handle own, nb::handle shared) const {
    const TreeArguments in(
        coordinates_,
        {{"position", position}, {"velocity", velocity}, {"acceleration", acceleration}, {"effort", effort}});
    const Columns more(*this, in, own, shared);
    TreeGram gram;
    gram.effort = in.arrays[3].data;
    std::vector<Array> kept;
    if (!weight.is_none()) {
      kept.push_back(read_array("weight", weight));
      kept[0].expect(text(in.arrays[0].shape) + ", as position", in.arrays[0].shape);
      gram.weight = kept[0].data;
    }
    const std::size_t n = more.count;
    const auto whole = std::make_unique<double[]>((n + 1) * (n + 1));
    const auto work = std::make_unique<double[]>(gram_work(count(), coordinates_, more.columns));
    gram.gram = whole.get();
    gram.work = work.get();
    run([&] { kernels.gram(numbers(), in.samples, more.columns, gram); });
    const Result normal({n, n}), projected({n});
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) normal.data[i * n + j] = whole[i * (n + 1) + j];
      projected.data[i] = whole[i * (n + 1) + n];
    }
    return nb::make_tuple(normal.array(), projected.array(), whole[(n + 1) * (n + 1) - 1]);
  }

 private:
  /// What columns there are beside the bodies'.
  struct Columns {
    std::vector<Array> kept;
    MoreColumns columns;
    std::size_t count;

    Columns(const KinematicTree& tree, const TreeArguments& in, nb::handle own, nb::handle shared) {
      columns.own_data = read(tree, in, "own", own, columns.own);
      columns.shared_data = read(tree, in, "shared", shared, columns.shared);
      count = 10 * tree.count() + tree.coordinates_ * columns.own + columns.shared;
    }
    const double* read(const KinematicTree& tree, const TreeArguments& in, const char* name, nb::handle value,
                       std::size_t& each) {
      if (value.is_none()) return nullptr;
      kept.push_back(read_array(name, value));
      const Array& array = kept.back();
      if (array.shape.empty()) array.fail("(n, m, k)");
      each = array.shape.back();
      const Shape wanted = in.shape({tree.coordinates_, each});
      array.expect(text(wanted), wanted);
      return array.data;
    }
  };

  TreeNumbers numbers() const { return {count(), coordinates_, numbers_.data(), gravity_, prepared_.get()}; }
  template <class F> static void run(F f) {
    nb::gil_scoped_release release;
    f();
  }

  Array links_;
  std::vector<double> numbers_;
  double gravity_[3];
  std::size_t coordinates_ = 0;
  struct Free {
    void operator()(void* memory) const { std::free(memory); }
  };
  std::unique_ptr<void, Free> prepared_;
};

}  // namespace

std::unique_ptr<ReadTree> read_tree(const Array& links, const Array& gravity) {
  constexpr std::size_t each = p::link_parameter_count;
  gravity.expect(text({3}), {3});
  if (links.shape.size() != 2 || links.shape[1] != each || links.shape[0] < 1 || links.shape[0] > most_links)
    links.fail("(l, " + std::to_string(each) + ") with l from 1 to " + std::to_string(most_links));
  auto params = std::make_unique<ReadTree>();
  params->links = static_cast<std::uint32_t>(links.shape[0]);
  params->gravity_x = gravity.data[0];
  params->gravity_y = gravity.data[1];
  params->gravity_z = gravity.data[2];
  for (std::size_t i = 0; i < links.shape[0]; ++i) {
    const double* at = links.data + i * each;
    const auto fail = [i](const char* what) {
      throw nb::value_error(("links: link " + std::to_string(i + 1) + ": " + what).c_str());
    };
    for (std::size_t k = 0; k < each; ++k)
      if (!std::isfinite(at[k])) fail("expected finite numbers");
    if (at[0] < 0 || at[0] > static_cast<double>(i) || at[0] != std::floor(at[0]))
      fail("parent: expected 0 for the base or the number of an earlier link");
    if (at[1] != 0 && at[1] != 1 && at[1] != 2) fail("joint: expected 0 (fixed), 1 (revolute) or 2 (prismatic)");
    params->link[i] = p::from_numbers<p::LinkParams<double>>(at);
  }
  if (!p::coefficients(*params).valid)
    throw nb::value_error("links: expected an axis of a length above 0 for every joint that moves");
  return params;
}

TreeArguments::TreeArguments(std::size_t m, std::initializer_list<std::pair<const char*, nb::handle>> named) {
  const double* data[3] = {};
  for (const auto& [name, value] : named) {
    arrays.push_back(read_array(name, value));
    const Array& array = arrays.back();
    if (arrays.size() == 1) {
      single = array.shape.size() == 1 && array.shape[0] == m;
      if (!single && (array.shape.size() != 2 || array.shape[1] != m))
        array.fail("(n, " + std::to_string(m) + ") or " + text({m}) + ": a number for each joint that moves");
      samples.n = single ? 1 : array.shape[0];
    } else if (array.shape != arrays[0].shape) {
      array.fail(text(arrays[0].shape) + ", as " + named.begin()->first);
    }
    if (arrays.size() <= 3) data[arrays.size() - 1] = array.data;
  }
  samples.position = data[0];
  samples.velocity = data[1];
  samples.acceleration = data[2];
}

Shape TreeArguments::shape(std::initializer_list<std::size_t> of_each) const {
  Shape result;
  if (!single) result.push_back(samples.n);
  result.insert(result.end(), of_each);
  return result;
}

void add_tree(nb::module_& m) {
  m.attr("LINK_PARAMETER_NAMES") = names_of<p::LinkParams<double>>();
  nb::class_<KinematicTree>(m, "KinematicTree", class_doc)
      .def(nb::init<nb::handle, nb::handle>(), nb::arg("links").none(), nb::arg("gravity").none(), nb::sig(init_sig))
      .def_prop_ro("links", &KinematicTree::count, "How many links there are.")
      .def_prop_ro("coordinates", &KinematicTree::coordinates, "How many joints move.")
      .def("inverse_dynamics", &KinematicTree::inverse_dynamics, nb::arg("position").none(), nb::arg("velocity").none(),
           nb::arg("acceleration").none(), nb::sig(inverse_dynamics_sig), inverse_dynamics_doc)
      .def("gravity", &KinematicTree::gravity, nb::arg("position").none(), nb::sig(gravity_sig), gravity_doc)
      .def("mass_matrix", &KinematicTree::mass_matrix, nb::arg("position").none(), nb::sig(mass_matrix_sig),
           mass_matrix_doc)
      .def("forward_dynamics", &KinematicTree::forward_dynamics, nb::arg("position").none(), nb::arg("velocity").none(),
           nb::arg("effort").none(), nb::kw_only(), nb::arg("held") = nb::none(), nb::sig(forward_dynamics_sig),
           forward_dynamics_doc)
      .def("energy", &KinematicTree::energy, nb::arg("position").none(), nb::arg("velocity").none(),
           nb::sig(energy_sig), energy_doc)
      .def("placements", &KinematicTree::placements, nb::arg("position").none(), nb::sig(placements_sig),
           placements_doc)
      .def("jacobian", &KinematicTree::jacobian, nb::arg("position").none(), nb::arg("link"),
           nb::arg("point") = nb::make_tuple(0.0, 0.0, 0.0), nb::sig(jacobian_sig), jacobian_doc)
      .def("regressor", &KinematicTree::regressor, nb::arg("position").none(), nb::arg("velocity").none(),
           nb::arg("acceleration").none(), nb::kw_only(), nb::arg("own") = nb::none(), nb::arg("shared") = nb::none(),
           nb::arg("out") = nb::none(), nb::sig(regressor_sig), regressor_doc)
      .def("normal_equations", &KinematicTree::normal_equations, nb::arg("position").none(), nb::arg("velocity").none(),
           nb::arg("acceleration").none(), nb::arg("effort").none(), nb::kw_only(), nb::arg("weight") = nb::none(),
           nb::arg("own") = nb::none(), nb::arg("shared") = nb::none(), nb::sig(normal_equations_sig),
           normal_equations_doc);
}

}  // namespace bindings
