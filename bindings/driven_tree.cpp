// A tree under its motors, with friction and true stiction: DrivenTree of pellucid._core.
#include "fields.hpp"
#include "tree.hpp"

#include <pellucid/tree_plant.hpp>

#include <cmath>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* class_doc =
    R"(A tree under its motors, with friction, and true stiction of several joints at once.

Parameters
----------
links : (l, 22)
gravity : (3,)
    As of KinematicTree.
joints : (m, 12)
    What loses effort at each joint that moves, in the order of TREE_JOINT_PARAMETER_NAMES.
period : float
    In which efforts are held [s].
substeps : int
    Steps of integration in a period.
turns : (m, m)
    How fast each motor (row) turns by each joint's velocity; left out, each motor turns with its own joint.
motors : (m, 11)
    Of motors, where turns are given, in the order of TREE_MOTOR_PARAMETER_NAMES; left out, zeros.
elastic : (m, 13)
    Of each motor behind a spring, in the order of SERIES_ELASTIC_PARAMETER_NAMES; a row of zeros: no spring.)";
constexpr const char* init_sig =
    "def __init__(self, links: ArrayLike, gravity: ArrayLike, joints: ArrayLike, *, period: float, substeps: int = 4, "
    "turns: ArrayLike | None = None, motors: ArrayLike | None = None, elastic: ArrayLike | None = None) -> None";
constexpr const char* motor_effort_sig =
    "def motor_effort(self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> NDArray[float64]";
constexpr const char* motor_effort_doc = R"(Effort of each motor that moves it so, friction with it, (n, m) [N m; N].)";
constexpr const char* run_sig =
    "def run(self, effort: ArrayLike, outside: ArrayLike | None = None) -> tuple[NDArray[float64], NDArray[float64]]";
constexpr const char* run_doc = R"(Go on for n periods.

Parameters
----------
effort : (n, m)
    Of each motor, or (m,) for one period [N m; N].
outside : (n, m)
    On each joint, from people and payloads; left out, 0.

Returns
-------
position, velocity : (n, m)
    At the start of each period; a velocity that is 0 to the bit belongs to a joint that rests.)";
constexpr const char* reset_sig =
    "def reset(self, position: ArrayLike | None = None, velocity: ArrayLike | None = None) -> None";
constexpr const char* reset_doc =
    "Where it is and how it moves, (m,) each; left out, 0. Springs then carry the weight.";

class DrivenTree {
  using Coefficients = p::TreePlantCoefficients<double, most_links>;
  using State = p::TreePlantState<double, most_links>;
  using Input = p::TreePlantInput<double, most_links>;

 public:
  DrivenTree(nb::handle links, nb::handle gravity, nb::handle joints, double period, nb::handle substeps,
             nb::handle turns, nb::handle motors, nb::handle elastic) {
    p::TreePlantParams<double, most_links> params;
    params.tree = *read_tree(read_array("links", links), read_array("gravity", gravity));
    m_ = p::coefficients(params.tree).coordinates;
    if (!(period > 0 && std::isfinite(period))) throw nb::value_error("period: expected a number above 0 [s]");
    params.period = period;
    params.substeps = static_cast<std::uint32_t>(read_integer("substeps", substeps, 1, 100000));
    read_rows("joints", joints, params.drives.joint);
    params.drives.coupled = !turns.is_none();
    if (!params.drives.coupled && !motors.is_none())
      throw nb::value_error("motors: found motors without turns, expected both");
    if (params.drives.coupled) {
      const Array matrix = read_array("turns", turns);
      matrix.expect(text({m_, m_}), {m_, m_});
      for (std::size_t i = 0; i < m_; ++i)
        for (std::size_t k = 0; k < m_; ++k) params.drives.turns[i][k] = matrix.data[i * m_ + k];
      if (!motors.is_none()) read_rows("motors", motors, params.drives.motor);
    }
    if (!elastic.is_none()) read_rows("elastic", elastic, params.elastic);
    c_ = std::make_unique<Coefficients>(p::coefficients(params));
    if (!c_->valid) throw nb::value_error("turns: found a matrix without an inverse, expected one that has it");
    state_ = std::make_unique<State>();
    reset(nb::none(), nb::none());
  }

  nb::object motor_effort(nb::handle position, nb::handle velocity, nb::handle acceleration) const {
    const TreeArguments in(m_, {{"position", position}, {"velocity", velocity}, {"acceleration", acceleration}});
    const Result effort(in.shape({m_}));
    for (std::size_t i = 0; i < in.samples.n; ++i) {
      const std::size_t at = i * m_;
      p::inverse_dynamics(c_->tree, c_->drives, in.samples.position + at, in.samples.velocity + at,
                          in.samples.acceleration + at, effort.data + at);
    }
    return effort.array();
  }

  nb::object run(nb::handle effort, nb::handle outside) {
    const TreeArguments in(m_, {{"effort", effort}});
    std::vector<Array> kept;
    if (!outside.is_none()) {
      kept.push_back(read_array("outside", outside));
      kept[0].expect(text(in.arrays[0].shape) + ", as effort", in.arrays[0].shape);
    }
    const Result position(in.shape({m_})), velocity(in.shape({m_}));
    Input input;
    for (std::size_t i = 0; i < in.samples.n; ++i) {
      for (std::size_t k = 0; k < m_; ++k) {
        position.data[i * m_ + k] = state_->position[k];
        velocity.data[i * m_ + k] = state_->velocity[k];
        input.effort[k] = in.samples.position[i * m_ + k];
        if (!kept.empty()) input.outside[k] = kept[0].data[i * m_ + k];
      }
      p::step(*c_, *state_, input);
    }
    return nb::make_tuple(position.array(), velocity.array());
  }

  void reset(nb::handle position, nb::handle velocity) {
    double q[most_links] = {}, v[most_links] = {};
    read_state("position", position, q);
    read_state("velocity", velocity, v);
    *state_ = p::balanced(*c_, q, v);
  }
  nb::object position() const { return array_of(state_->position); }
  nb::object motor_position() const {
    double place[most_links] = {};
    p::motor_motion(c_->drives, m_, state_->position, place);
    for (std::size_t k = 0; k < m_; ++k)
      if (c_->elastic[k].any_gives) place[k] = state_->motor[k].position;
    return array_of(place);
  }
  nb::object velocity() const { return array_of(state_->velocity); }

 private:
  template <class P> void read_rows(const char* name, nb::handle value, P* params) const {
    constexpr std::size_t each = p::field_count<P>;
    const Array array = read_array(name, value);
    array.expect(text({m_, each}), {m_, each});
    for (std::size_t k = 0; k < m_; ++k) params[k] = p::from_numbers<P>(array.data + k * each);
  }
  void read_state(const char* name, nb::handle value, double* numbers) const {
    if (value.is_none()) return;
    const Array array = read_array(name, value);
    array.expect(text({m_}), {m_});
    for (std::size_t k = 0; k < m_; ++k) numbers[k] = array.data[k];
  }
  nb::object array_of(const double* numbers) const {
    const Result result({m_});
    for (std::size_t k = 0; k < m_; ++k) result.data[k] = numbers[k];
    return result.array();
  }

  std::size_t m_ = 0;
  std::unique_ptr<Coefficients> c_;
  std::unique_ptr<State> state_;
};

}  // namespace

void add_driven_tree(nb::module_& m) {
  m.attr("TREE_JOINT_PARAMETER_NAMES") = names_of<p::TreeJointParams<double>>();
  m.attr("TREE_MOTOR_PARAMETER_NAMES") = names_of<p::TreeMotorParams<double>>();
  m.attr("SERIES_ELASTIC_PARAMETER_NAMES") = names_of<p::SeriesElasticParams<double>>();
  nb::class_<DrivenTree>(m, "DrivenTree", class_doc)
      .def(nb::init<nb::handle, nb::handle, nb::handle, double, nb::handle, nb::handle, nb::handle, nb::handle>(),
           nb::arg("links").none(), nb::arg("gravity").none(), nb::arg("joints").none(), nb::kw_only(),
           nb::arg("period"), nb::arg("substeps") = 4, nb::arg("turns") = nb::none(), nb::arg("motors") = nb::none(),
           nb::arg("elastic") = nb::none(), nb::sig(init_sig))
      .def("motor_effort", &DrivenTree::motor_effort, nb::arg("position").none(), nb::arg("velocity").none(),
           nb::arg("acceleration").none(), nb::sig(motor_effort_sig), motor_effort_doc)
      .def("run", &DrivenTree::run, nb::arg("effort").none(), nb::arg("outside") = nb::none(), nb::sig(run_sig),
           run_doc)
      .def("reset", &DrivenTree::reset, nb::arg("position") = nb::none(), nb::arg("velocity") = nb::none(),
           nb::sig(reset_sig), reset_doc)
      .def_prop_ro("position", &DrivenTree::position, nb::sig("def position(self) -> NDArray[float64]"),
                   "Of each joint that moves, now [rad; m].")
      .def_prop_ro("motor_position", &DrivenTree::motor_position,
                   nb::sig("def motor_position(self) -> NDArray[float64]"), "Of each motor, now [rad; m].")
      .def_prop_ro("velocity", &DrivenTree::velocity, nb::sig("def velocity(self) -> NDArray[float64]"),
                   "Of each joint that moves, now [rad/s; m/s].");
}

}  // namespace bindings
