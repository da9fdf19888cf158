// A robot of many joints and the limb that wears it: WornTree of pellucid._core.
#include "fields.hpp"
#include "tree.hpp"

#include <pellucid/loops.hpp>
#include <pellucid/sensor.hpp>
#include <pellucid/worn_tree_plant.hpp>

#include <nanobind/stl/string.h>

#include <cmath>

namespace bindings {
namespace {

namespace p = pellucid;

/// Links of either tree.
constexpr std::size_t most_worn_links = 12;

constexpr const char* class_doc =
    R"(A robot of many joints and the limb that wears it, held together by cuffs; without a limb the robot alone.

Parameters
----------
links : (l, 22)
gravity : (3,)
joints : (m, 11)
    The robot's, as of DrivenTree; at most 12 links.
period : float
    In which commands are held [s].
substeps : int
    Steps of integration in a period; they must resolve the springs.
elastic : (m, 12)
    Of each motor behind a spring, in the order of SERIES_ELASTIC_PARAMETER_NAMES; a row of zeros: no spring.
drives : (m, 4)
    Effort per command, then amplitude, wave number and phase of a ripple at the motor; left out: efforts.
lag : float
    Time constant of the drives' torque [s].
limb_links : (k, 22)
    Of the limb, in the same base.
limb_joints : (j, 11)
    What loses effort at its joints; left out, nothing.
servos : (j, 5)
    Muscles of its joints, in the order of POSTURE_SERVO_PARAMETER_NAMES.
reflex_delay : int
    Of the late part [periods].
cuffs : (c, 16)
    In the order of CUFF_PARAMETER_NAMES; at most 4.)";
constexpr const char* init_sig =
    "def __init__(self, links: ArrayLike, gravity: ArrayLike, joints: ArrayLike, *, period: float, substeps: int = 4, "
    "elastic: ArrayLike | None = None, drives: ArrayLike | None = None, lag: float = 0.0, "
    "limb_links: ArrayLike | None = None, limb_joints: ArrayLike | None = None, servos: ArrayLike | None = None, "
    "reflex_delay: int = 0, cuffs: ArrayLike | None = None) -> None";
constexpr const char* reset_sig =
    "def reset(self, position: ArrayLike | None = None, limb_position: ArrayLike | None = None) -> None";
constexpr const char* run_sig =
    "def run(self, command: ArrayLike, wanted: ArrayLike | None = None, wanted_velocity: ArrayLike | None = None, "
    "learnt: ArrayLike | None = None) -> tuple[NDArray[float64], ...]";
constexpr const char* run_doc = R"(Go on for n periods.

Parameters
----------
command : (n, m)
    Of each drive, or (m,) for one period.
wanted, wanted_velocity, learnt : (n, j)
    Where the limb's joints are meant to be [rad], how fast [rad/s], the torque learnt for it [N m]; or 0.

Returns
-------
position, velocity, motor : (n, m)
limb_position, limb_velocity : (n, j)
on_robot : (n, m)
    What the cuffs do to the robot's joints [N m; N].
on_limb : (n, j)
    What they do to the limb's [N m].
pull : (n, c, 6)
    Force [N] and moment [N m] of each cuff on the robot, in the axes of the robot's link.
    All at the start of each period.)";
constexpr const char* follow_sig =
    "def follow(self, reference: ArrayLike, gains: ArrayLike, *, loop: str, velocity_span: int, quantum: ArrayLike, "
    "noise: ArrayLike) -> tuple[NDArray[float64], ...]";
constexpr const char* follow_doc = R"(The robot's own controllers for n periods, a loop at each motor.

Parameters
----------
reference : (n, m)
    [rad; m], of velocity_pi [rad/s; m/s].
gains : (m, 5)
    kp, ki, kd, kv and limit of each loop, as of `simulate`.
loop : str
    As of `simulate`.
velocity_span : int
    Samples that a measured velocity spans.
quantum : (m,)
    What each encoder, on the motor, resolves.
noise : (n, m)
    Added to what it reads.

Returns
-------
command, measured, position, velocity : (n, m)
    At the start of each period; position and velocity are those of the links.)";

class WornTree {
  static constexpr std::size_t most = most_worn_links;
  using Coefficients = p::WornTreePlantCoefficients<double, most>;
  using State = p::WornTreePlantState<double, most>;
  using Input = p::WornTreePlantInput<double, most>;

 public:
  WornTree(nb::handle links, nb::handle gravity, nb::handle joints, double period, nb::handle substeps,
           nb::handle elastic, nb::handle drives, double lag, nb::handle limb_links, nb::handle limb_joints,
           nb::handle servos, nb::handle reflex_delay, nb::handle cuffs) {
    auto params = std::make_unique<p::WornTreePlantParams<double, most>>();
    if (!(period > 0 && std::isfinite(period))) throw nb::value_error("period: expected a number above 0 [s]");
    if (!(lag >= 0 && std::isfinite(lag))) throw nb::value_error("lag: expected a number of at least 0 [s]");
    params->lag = lag;
    params->robot.period = period;
    params->robot.substeps = static_cast<std::uint32_t>(read_integer("substeps", substeps, 1, 100000));
    m_ = read_bodies("links", links, gravity, params->robot.tree);
    read_rows("joints", joints, m_, params->robot.drives.joint);
    if (!elastic.is_none()) read_rows("elastic", elastic, m_, params->robot.elastic);
    if (!drives.is_none()) {
      const Array array = read_array("drives", drives);
      array.expect(text({m_, 4}), {m_, 4});
      for (std::size_t k = 0; k < m_; ++k) {
        const double* at = array.data + 4 * k;
        params->drive[k] = {at[0], 0.0, at[1], at[2], at[3]};
      }
    }
    if (!limb_links.is_none()) {
      j_ = read_bodies("limb_links", limb_links, gravity, params->limb.tree);
      if (!limb_joints.is_none()) read_rows("limb_joints", limb_joints, j_, params->limb.drives.joint);
      if (!servos.is_none()) read_rows("servos", servos, j_, params->servo);
      params->reflex_delay =
          static_cast<std::uint32_t>(read_integer("reflex_delay", reflex_delay, 0, p::reflex_periods - 1));
      if (!cuffs.is_none()) {
        const Array array = read_array("cuffs", cuffs);
        constexpr std::size_t each = p::field_count<p::CuffParams<double>>;
        if (array.shape.size() != 2 || array.shape[1] != each || array.shape[0] > p::most_cuffs)
          array.fail("(c, " + std::to_string(each) + ") with c up to " + std::to_string(p::most_cuffs));
        params->cuffs = static_cast<std::uint32_t>(array.shape[0]);
        read_rows("cuffs", cuffs, params->cuffs, params->cuff);
      }
    } else if (!limb_joints.is_none() || !servos.is_none() || !cuffs.is_none()) {
      throw nb::value_error("limb_links: found limb_joints, servos or cuffs without it, expected limb_links too");
    }
    c_ = std::make_unique<Coefficients>(p::coefficients(*params));
    if (!c_->valid) throw nb::value_error("cuffs: found a link that robot or limb lacks, expected links of both");
    state_ = std::make_unique<State>();
    reset(nb::none(), nb::none());
  }

  void reset(nb::handle position, nb::handle limb_position) {
    double q[most] = {}, limb[most] = {};
    read_state("position", position, m_, q);
    read_state("limb_position", limb_position, j_, limb);
    p::balance(*c_, q, limb, *state_);
  }

  nb::object run(nb::handle command, nb::handle wanted, nb::handle wanted_velocity, nb::handle learnt) {
    const Array commands = read_array("command", command);
    const bool single = commands.shape.size() == 1;
    const std::size_t n = single ? 1 : commands.shape[0];
    if (commands.shape.size() > 2 || commands.shape.empty() || commands.shape.back() != m_)
      commands.fail("(n, " + std::to_string(m_) + ") or " + text({m_}));
    const Shape of_limb = single ? Shape{j_} : Shape{n, j_};
    std::vector<Array> kept;
    const double* given[3] = {};
    const nb::handle asked[3] = {wanted, wanted_velocity, learnt};
    const char* names[3] = {"wanted", "wanted_velocity", "learnt"};
    kept.reserve(3);
    for (std::size_t i = 0; i < 3; ++i) {
      if (asked[i].is_none()) continue;
      kept.push_back(read_array(names[i], asked[i]));
      kept.back().expect(text(of_limb), of_limb);
      given[i] = kept.back().data;
    }
    const auto shape = [&](std::initializer_list<std::size_t> each) {
      Shape all(each);
      if (!single) all.insert(all.begin(), n);
      return all;
    };
    const Result position(shape({m_})), velocity(shape({m_})), motor(shape({m_}));
    const Result limb_position(shape({j_})), limb_velocity(shape({j_}));
    const Result on_robot(shape({m_})), on_limb(shape({j_})), pulls(shape({c_->cuffs, 6}));
    {
      nb::gil_scoped_release release;
      Input input;
      p::CuffAction<double, most> action;
      for (std::size_t i = 0; i < n; ++i) {
        p::act(*c_, *state_, action);
        for (std::size_t k = 0; k < m_; ++k) {
          const std::size_t at = i * m_ + k;
          position.data[at] = state_->robot.position[k];
          velocity.data[at] = state_->robot.velocity[k];
          motor.data[at] = of_motor(k);
          on_robot.data[at] = action.robot[k];
          input.effort[k] = commands.data[at];
        }
        for (std::size_t k = 0; k < j_; ++k) {
          const std::size_t at = i * j_ + k;
          limb_position.data[at] = state_->limb.position[k];
          limb_velocity.data[at] = state_->limb.velocity[k];
          on_limb.data[at] = action.limb[k];
          input.wanted[k] = given[0] != nullptr ? given[0][at] : 0;
          input.wanted_velocity[k] = given[1] != nullptr ? given[1][at] : 0;
          input.learnt[k] = given[2] != nullptr ? given[2][at] : 0;
        }
        for (std::size_t k = 0; k < c_->cuffs; ++k) {
          double* at = pulls.data + 6 * (i * c_->cuffs + k);
          const p::CuffPull<double>& pull = action.pull[k];
          at[0] = pull.force.x, at[1] = pull.force.y, at[2] = pull.force.z;
          at[3] = pull.moment.x, at[4] = pull.moment.y, at[5] = pull.moment.z;
        }
        p::step(*c_, *state_, input);
      }
    }
    return nb::make_tuple(position.array(), velocity.array(), motor.array(), limb_position.array(),
                          limb_velocity.array(), on_robot.array(), on_limb.array(), pulls.array());
  }

  nb::object follow(nb::handle reference, nb::handle gains, const std::string& loop, nb::handle velocity_span,
                    nb::handle quantum, nb::handle noise) {
    static constexpr const char* kinds[] = {"none", "p", "pi", "pd", "cascade", "velocity_pi"};
    std::size_t kind = 0;
    while (kind < 6 && loop != kinds[kind]) ++kind;
    if (kind == 6)
      throw nb::value_error(("loop: got '" + loop + "', expected none, p, pi, pd, cascade or velocity_pi").c_str());
    const Array wanted = read_array("reference", reference), own = read_array("gains", gains);
    const Array steps = read_array("quantum", quantum), errors = read_array("noise", noise);
    if (wanted.shape.size() != 2 || wanted.shape[1] != m_) wanted.fail("(n, " + std::to_string(m_) + ")");
    own.expect(text({m_, 5}), {m_, 5});
    steps.expect(text({m_}), {m_});
    errors.expect(text(wanted.shape) + ", as reference", wanted.shape);
    p::LoopCoefficients<double> loops[most];
    p::LoopState<double> states[most];
    p::EncoderCoefficients<double> encoders[most];
    for (std::size_t k = 0; k < m_; ++k) {
      const double* at = own.data + 5 * k;
      p::LoopParams<double> params{static_cast<p::LoopKind>(kind), at[0], at[1], at[2], at[3], at[4]};
      params.velocity_span =
          static_cast<std::uint32_t>(read_integer("velocity_span", velocity_span, 0, p::max_velocity_span));
      params.period = c_->substep * static_cast<double>(c_->substeps);
      loops[k] = p::coefficients(params);
      encoders[k] = p::coefficients(p::EncoderParams<double>{steps.data[k]});
    }
    const Shape shape{wanted.shape[0], m_};
    const Result command(shape), measured(shape), position(shape), velocity(shape);
    {
      nb::gil_scoped_release release;
      Input input;
      for (std::size_t i = 0; i < wanted.shape[0]; ++i) {
        for (std::size_t k = 0; k < m_; ++k) {
          const std::size_t at = i * m_ + k;
          measured.data[at] = p::step(encoders[k], of_motor(k), errors.data[at]);
          input.effort[k] =
              p::step(loops[k], states[k], {wanted.data[at], measured.data[at], state_->robot.velocity[k]});
          command.data[at] = input.effort[k];
          position.data[at] = state_->robot.position[k];
          velocity.data[at] = state_->robot.velocity[k];
        }
        p::step(*c_, *state_, input);
      }
    }
    return nb::make_tuple(command.array(), measured.array(), position.array(), velocity.array());
  }
  double energy() const { return p::worn_energy(*c_, *state_); }

 private:
  static std::size_t read_bodies(const char* name, nb::handle links, nb::handle gravity,
                                 p::TreeParams<double, most>& params) {
    const Array array = read_array(name, links);
    const auto read = read_tree(array, read_array("gravity", gravity));
    if (read->links > most) array.fail("at most " + std::to_string(most) + " links");
    params.links = read->links;
    params.gravity_x = read->gravity_x, params.gravity_y = read->gravity_y, params.gravity_z = read->gravity_z;
    for (std::size_t i = 0; i < read->links; ++i) params.link[i] = read->link[i];
    return p::coefficients(params).coordinates;
  }
  template <class P> static void read_rows(const char* name, nb::handle value, std::size_t rows, P* params) {
    constexpr std::size_t each = p::field_count<P>;
    const Array array = read_array(name, value);
    array.expect(text({rows, each}), {rows, each});
    for (std::size_t k = 0; k < rows; ++k) params[k] = p::from_numbers<P>(array.data + k * each);
  }
  static void read_state(const char* name, nb::handle value, std::size_t count, double* numbers) {
    if (value.is_none()) return;
    const Array array = read_array(name, value);
    array.expect(text({count}), {count});
    for (std::size_t k = 0; k < count; ++k) numbers[k] = array.data[k];
  }
  double of_motor(std::size_t k) const {
    return c_->robot.elastic[k].any_gives ? state_->robot.motor[k].position : state_->robot.position[k];
  }

  std::size_t m_ = 0, j_ = 0;
  std::unique_ptr<Coefficients> c_;
  std::unique_ptr<State> state_;
};

}  // namespace

void add_worn_tree(nb::module_& m) {
  m.attr("CUFF_PARAMETER_NAMES") = names_of<p::CuffParams<double>>();
  m.attr("POSTURE_SERVO_PARAMETER_NAMES") = names_of<p::PostureServoParams<double>>();
  nb::class_<WornTree>(m, "WornTree", class_doc)
      .def(nb::init<nb::handle, nb::handle, nb::handle, double, nb::handle, nb::handle, nb::handle, double, nb::handle,
                    nb::handle, nb::handle, nb::handle, nb::handle>(),
           nb::arg("links").none(), nb::arg("gravity").none(), nb::arg("joints").none(), nb::kw_only(),
           nb::arg("period"), nb::arg("substeps") = 4, nb::arg("elastic") = nb::none(),
           nb::arg("drives") = nb::none(), nb::arg("lag") = 0.0, nb::arg("limb_links") = nb::none(),
           nb::arg("limb_joints") = nb::none(), nb::arg("servos") = nb::none(), nb::arg("reflex_delay") = 0,
           nb::arg("cuffs") = nb::none(), nb::sig(init_sig))
      .def("reset", &WornTree::reset, nb::arg("position") = nb::none(), nb::arg("limb_position") = nb::none(),
           nb::sig(reset_sig),
           "Both at rest there; left out, 0. Drives and springs then carry the robot's weight.")
      .def("run", &WornTree::run, nb::arg("command").none(), nb::arg("wanted") = nb::none(),
           nb::arg("wanted_velocity") = nb::none(), nb::arg("learnt") = nb::none(), nb::sig(run_sig), run_doc)
      .def("follow", &WornTree::follow, nb::arg("reference").none(), nb::arg("gains").none(), nb::kw_only(),
           nb::arg("loop"), nb::arg("velocity_span"), nb::arg("quantum").none(), nb::arg("noise").none(),
           nb::sig(follow_sig), follow_doc)
      .def_prop_ro("energy", &WornTree::energy, nb::sig("def energy(self) -> float"),
                   "Of both trees and the cuffs, without what springs of the transmission store [J].");
}

}  // namespace bindings
