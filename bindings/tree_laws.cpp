// Laws of several joints for Python: stepped in double or float, by themselves and under their supervisor, and timed.
#include "fields.hpp"
#include "laws.hpp"
#include "tree.hpp"

#include <pellucid/commanded_tree.hpp>
#include <pellucid/tree_supervisor.hpp>

#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <chrono>
#include <cmath>
#include <memory>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr std::size_t most_law_links = 12;

template <class S> using Law = p::TreeCompensation<S, most_law_links>;

constexpr const char* law_doc = R"(A control law of several joints behind the front that it has on a robot too.

What goes out has passed every joint's gate and that of the whole: finite and within the limits, whatever comes in.
A fault latches, and all efforts go to 0 together.

Parameters
----------
links : (l, 22)
gravity : (3,)
joints : (m, k)
    As of DrivenTree; at most 12 links.
shares : (m, s)
    What is done at each joint, in the order of model_fields()["tree_law_joint"].
whole : (w,)
    What is done with all, in the order of model_fields()["tree_law_whole"].
turns : (m, m)
motors : (m, k)
    As of DrivenTree.
single : bool
    In float32, as on a microcontroller.)";
constexpr const char* init_sig =
    "def __init__(self, links: ArrayLike, gravity: ArrayLike, joints: ArrayLike, shares: ArrayLike, whole: ArrayLike, "
    "*, turns: ArrayLike | None = None, motors: ArrayLike | None = None, single: bool = False) -> None";
constexpr const char* step_sig =
    "def step(self, time: float, position: ArrayLike, interaction: ArrayLike | None = None, muscle: ArrayLike | None = "
    "None, wrench: ArrayLike | None = None) -> NDArray[float64]";
constexpr const char* step_doc = R"(One control period: the effort of each joint, (m,) [N m; N].

Parameters
----------
time : float
    When everything was measured [s].
position : (m,)
    Of each joint [rad; m]; NaN: its encoder says nothing.
interaction, muscle : (m,)
    The wearer's effort on each joint by sensors there, and at each by EMG [N m; N]; NaN or left out: nothing.
wrench : (6,)
    The wearer's force and moment on the link that bears the sensor, in its axes [N, N m].)";
constexpr const char* run_sig =
    "def run(self, time: ArrayLike, position: ArrayLike, interaction: ArrayLike | None = None, muscle: ArrayLike | "
    "None = None, wrench: ArrayLike | None = None) -> NDArray[float64]";
constexpr const char* run_doc = R"(step, one period after another.

Parameters
----------
time : (n,)
position, interaction, muscle : (n, m)
wrench : (n, 6)
    As `step` takes them.

Returns
-------
(n, m)
    Efforts of joints [N m; N].)";
constexpr const char* supervised_doc = R"(The same law under its supervisor: a fault of one joint stops all of them.

Parameters
----------
links, gravity, joints, shares, whole, turns, motors, single
    As of TreeLaw.
watches : (m, s)
    What is watched of each joint, in the order of model_fields()["tree_watch_joint"].
whole_watch : (w,)
    What is watched of all, in the order of model_fields()["tree_watch_whole"].
commanded : bool
    Efforts are those that `step` is told as its `command`, in place of the law's; the supervisor knows the robot by
    the law's numbers all the same.)";
constexpr const char* supervised_init_sig =
    "def __init__(self, links: ArrayLike, gravity: ArrayLike, joints: ArrayLike, shares: ArrayLike, whole: ArrayLike, "
    "watches: ArrayLike, whole_watch: ArrayLike, *, turns: ArrayLike | None = None, motors: ArrayLike | None = None, "
    "single: bool = False, commanded: bool = False) -> None";
constexpr const char* supervised_step_sig =
    "def step(self, time: float, position: ArrayLike, interaction: ArrayLike | None = None, muscle: ArrayLike | None = "
    "None, wrench: ArrayLike | None = None, *, drive: ArrayLike | None = None, joint: ArrayLike | None = None, token: int "
    "= 0, command: ArrayLike | None = None) -> NDArray[float64]";
constexpr const char* supervised_step_doc = R"(One control period: the effort of each motor, (m,) [N m; N].

Parameters
----------
time, position, interaction, muscle, wrench
    As TreeLaw.step takes them.
drive : (m,)
    What each motor's drive measures of its effort; NaN or left out: nothing.
joint : (m,)
    What a second encoder of each joint says [rad; m]; NaN or left out: nothing.
token : int
    The challenge of a fault, from an operator who asks for a reset.
command : (m,)
    Effort that each joint is to have, of a law that is commanded [N m; N]; one that is no number stops it. Left
    out: as before.)";
constexpr const char* time_doc = R"(Nanoseconds of single control steps on a smooth motion, each timed by itself, (cycles,).)";

template <class S> S at(const Array* array, std::size_t i) {
  return array == nullptr ? std::numeric_limits<S>::quiet_NaN() : static_cast<S>(array->data[i]);
}

/// Numbers of each row, cast to S.
template <class P, class S> P row_of(const double* from) {
  S numbers[p::field_count<P>];
  for (std::size_t i = 0; i < p::field_count<P>; ++i) numbers[i] = static_cast<S>(from[i]);
  return p::from_numbers<P>(numbers);
}
template <class P, class S> void read_rows(const char* name, nb::handle value, std::size_t m, P* params) {
  constexpr std::size_t each = p::field_count<P>;
  const Array array = read_array(name, value);
  array.expect(text({m, each}), {m, each});
  for (std::size_t k = 0; k < m; ++k) params[k] = row_of<P, S>(array.data + k * each);
}

struct Numbers {
  nb::handle links, gravity, joints, shares, whole, turns, motors;
};

template <class S> typename Law<S>::Params params_of(const Numbers& from) {
  typename Law<S>::Params params;
  const Array links = read_array("links", from.links);
  const auto tree = read_tree(links, read_array("gravity", from.gravity));
  if (tree->links > most_law_links)
    throw nb::value_error(
        ("links: found " + std::to_string(tree->links) + ", expected at most " + std::to_string(most_law_links)).c_str());
  const std::size_t m = p::coefficients(*tree).coordinates;
  if (m == 0) throw nb::value_error("links: found no joint that moves, expected at least one");
  params.tree.links = tree->links;
  params.tree.gravity_x = static_cast<S>(tree->gravity_x);
  params.tree.gravity_y = static_cast<S>(tree->gravity_y);
  params.tree.gravity_z = static_cast<S>(tree->gravity_z);
  for (std::size_t i = 0; i < tree->links; ++i)
    params.tree.link[i] = row_of<p::LinkParams<S>, S>(links.data + i * p::link_parameter_count);
  read_rows<p::TreeJointParams<S>, S>("joints", from.joints, m, params.drives.joint);
  params.drives.coupled = !from.turns.is_none();
  if (params.drives.coupled) {
    const Array matrix = read_array("turns", from.turns);
    matrix.expect(text({m, m}), {m, m});
    for (std::size_t i = 0; i < m; ++i)
      for (std::size_t k = 0; k < m; ++k) params.drives.turns[i][k] = static_cast<S>(matrix.data[i * m + k]);
  }
  if (!from.motors.is_none()) read_rows<p::TreeMotorParams<S>, S>("motors", from.motors, m, params.drives.motor);
  read_rows<p::JointShareParams<S>, S>("shares", from.shares, m, params.joint);
  params.whole = read_params<p::WholeTreeParams<S>, S>("whole", from.whole);
  return params;
}

/// Readings of one period of n, or nothing.
struct Read {
  std::size_t m;
  Array position;
  std::vector<Array> others;
  const Array *interaction = nullptr, *muscle = nullptr, *wrench = nullptr, *drive = nullptr, *joint = nullptr;

  Read(std::size_t joints, nb::handle at, std::initializer_list<std::pair<const char*, nb::handle>> named,
       const std::size_t* n)
      : m(joints), position(read_array("position", at)) {
    const auto shape = [n](std::size_t each) { return n == nullptr ? Shape{each} : Shape{*n, each}; };
    position.expect(text(shape(m)), shape(m));
    others.reserve(5);
    const Array** place[] = {&interaction, &muscle, &wrench, &drive, &joint};
    std::size_t i = 0;
    for (const auto& [name, value] : named) {
      const Array** to = place[i++];
      if (value.is_none()) continue;
      others.push_back(read_array(name, value));
      const std::size_t each = to == &wrench ? 6 : m;
      others.back().expect(text(shape(each)), shape(each));
      *to = &others.back();
    }
  }

  template <class S> p::TreeSamples<S, most_law_links> samples(std::size_t row, bool sound) const {
    p::TreeSamples<S, most_law_links> in;
    for (std::size_t k = 0; k < m; ++k) {
      const auto sample = [sound](S value) { return p::Sample<S>{value, 0, 0, sound && !std::isnan(value)}; };
      in.position[k] = sample(at<S>(&position, row * m + k));
      in.interaction[k] = sample(at<S>(interaction, row * m + k));
      in.muscle[k] = sample(at<S>(muscle, row * m + k));
    }
    if (wrench == nullptr) return in;
    S six[6];
    in.wrench.valid = sound;
    for (std::size_t i = 0; i < 6; ++i) {
      six[i] = at<S>(wrench, 6 * row + i);
      in.wrench.valid = in.wrench.valid && !std::isnan(six[i]);
    }
    in.wrench.force = {six[0], six[1], six[2]};
    in.wrench.moment = {six[3], six[4], six[5]};
    return in;
  }
};

std::int64_t micros(double time, bool& sound) {
  sound = std::fabs(time) < 9e12;  // microseconds that 64 bits hold; false for NaN
  return sound ? std::llround(time * 1e6) : 0;
}

template <class S> nb::object array_of(const S* numbers, std::size_t m) {
  const Result result({m});
  for (std::size_t k = 0; k < m; ++k) result.data[k] = static_cast<double>(numbers[k]);
  return result.array();
}

/// Python interface of a law of several joints in either scalar.
class AnyTreeLaw {
 public:
  AnyTreeLaw() = default;
  AnyTreeLaw(const AnyTreeLaw&) = delete;
  virtual ~AnyTreeLaw() = default;
  virtual std::size_t joints() const = 0;
  virtual void step(double time, const Read& read, std::size_t row, double* efforts) = 0;
  virtual void reset() = 0;
  virtual void stop() = 0;
  virtual p::TreeFault fault() const = 0;
  virtual nb::object drive() const = 0;
  virtual nb::object outside() const = 0;
  virtual nb::object weight() const = 0;
  virtual double end_speed() const = 0;
  virtual nb::object time(std::size_t cycles) = 0;
};

template <class S> class TreeLawIn : public AnyTreeLaw {
 public:
  explicit TreeLawIn(const Numbers& numbers) { p::configure(law_, params_of<S>(numbers)); }
  std::size_t joints() const override { return law_.law.gate.joints; }
  void step(double time, const Read& read, std::size_t row, double* efforts) override {
    bool sound;
    const std::int64_t now = micros(time, sound);
    command_ = p::step(law_, p::stamped(law_, read.samples<S>(row, sound), now, law_.steps), now);
    for (std::size_t k = 0; k < joints(); ++k) efforts[k] = static_cast<double>(command_.effort[k]);
  }
  void reset() override { p::reset(law_); }
  void stop() override { p::stop(law_); }
  p::TreeFault fault() const override { return law_.fault; }
  nb::object drive() const override { return array_of(command_.drive, joints()); }
  nb::object outside() const override { return array_of(law_.state.observer.residual, joints()); }
  nb::object weight() const override { return array_of(law_.state.weight, joints()); }
  double end_speed() const override { return static_cast<double>(law_.state.end_speed); }
  nb::object time(std::size_t cycles) override {
    using Clock = std::chrono::steady_clock;
    const Result result({cycles});
    const double period = static_cast<double>(law_.law.gate.joint[0].params.period);
    double empty = 1e9;
    for (int i = 0; i < 1000; ++i) {
      const auto start = Clock::now();
      empty = std::fmin(empty, std::chrono::duration<double, std::nano>(Clock::now() - start).count());
    }
    volatile double sink = 0;
    p::TreeSamples<S, most_law_links> in;
    for (std::size_t cycle = 0; cycle < cycles; ++cycle) {
      const std::int64_t now = std::llround(1e6 * period * static_cast<double>(cycle));
      for (std::size_t k = 0; k < joints(); ++k) {
        const double angle = std::fmod((2.0 + 0.3 * static_cast<double>(k)) * period * static_cast<double>(cycle), 6.283185307179586);
        in.position[k] = {static_cast<S>(0.5 * p::sin(angle)), now, static_cast<std::uint32_t>(cycle), true};
      }
      const auto start = Clock::now();
      const auto out = p::step(law_.law, law_.state, in);
      const auto end = Clock::now();
      sink = sink + static_cast<double>(out.effort[0]);
      result.data[cycle] = std::chrono::duration<double, std::nano>(end - start).count() - empty;
    }
    return result.array();
  }

 private:
  p::TreeController<Law<S>> law_;
  p::TreeCommand<S, most_law_links> command_;
};

struct TreeLaw {
  std::unique_ptr<AnyTreeLaw> law;
  TreeLaw(nb::handle links, nb::handle gravity, nb::handle joints, nb::handle shares, nb::handle whole,
          nb::handle turns, nb::handle motors, bool single) {
    const Numbers numbers{links, gravity, joints, shares, whole, turns, motors};
    if (single) law = std::make_unique<TreeLawIn<float>>(numbers);
    else law = std::make_unique<TreeLawIn<double>>(numbers);
  }
  nb::object step(double time, nb::handle position, nb::handle interaction, nb::handle muscle, nb::handle wrench) {
    const Read read(law->joints(), position, {{"interaction", interaction}, {"muscle", muscle}, {"wrench", wrench}},
                    nullptr);
    const Result efforts({law->joints()});
    law->step(time, read, 0, efforts.data);
    return efforts.array();
  }
  nb::object run(nb::handle time, nb::handle position, nb::handle interaction, nb::handle muscle, nb::handle wrench) {
    const Array t = read_array("time", time);
    if (t.shape.size() != 1) t.fail("(n,)");
    const std::size_t n = t.shape[0], m = law->joints();
    const Read read(m, position, {{"interaction", interaction}, {"muscle", muscle}, {"wrench", wrench}}, &n);
    const Result efforts({n, m});
    for (std::size_t i = 0; i < n; ++i) law->step(t.data[i], read, i, efforts.data + i * m);
    return efforts.array();
  }
};

/// The same under its supervisor.
class AnySupervisedTree {
 public:
  AnySupervisedTree() = default;
  AnySupervisedTree(const AnySupervisedTree&) = delete;
  virtual ~AnySupervisedTree() = default;
  virtual std::size_t joints() const = 0;
  virtual void step(double time, const Read& read, std::uint32_t token, double* drives) = 0;
  virtual void stop() = 0;
  virtual p::TreeFault fault() const = 0;
  virtual p::Mode mode() const = 0;
  virtual std::uint32_t challenge() const = 0;
  virtual nb::object enable() const = 0;
  virtual nb::object effort() const = 0;
  virtual nb::list log() const = 0;
  virtual void flip(std::size_t bit) = 0;
  virtual void command(const double*) {
    throw nb::value_error("command: found a law that takes no command, expected one that is commanded");
  }
};

template <class L> class SupervisedTreeIn : public AnySupervisedTree {
  using S = typename L::Scalar;

 public:
  SupervisedTreeIn(const Numbers& numbers, nb::handle watches, nb::handle whole) {
    const auto params = params_of<S>(numbers);
    p::TreeSupervisorParams<S, most_law_links> rules;
    const std::size_t m = p::coefficients(params.tree).coordinates;
    read_rows<p::JointWatchParams<S>, S>("watches", watches, m, rules.joint);
    rules.whole = read_params<p::WholeWatchParams<S>, S>("whole_watch", whole);
    p::configure(law_, params, rules);
  }
  std::size_t joints() const override { return law_.controller.law.gate.joints; }
  void step(double time, const Read& read, std::uint32_t token, double* drives) override {
    bool sound;
    const std::int64_t now = micros(time, sound);
    p::TreeFeedback<S, most_law_links> back;
    back.token = token;
    for (std::size_t k = 0; k < joints(); ++k) {
      const S given = at<S>(read.drive, k);
      back.drive[k] = {given, now, law_.state.steps, !std::isnan(given)};
      const S second = at<S>(read.joint, k);
      back.joint[k] = {second, now, law_.state.steps, !std::isnan(second)};
    }
    out_ = p::step(law_, p::stamped(law_, read.samples<S>(0, sound), now), back, now);
    for (std::size_t k = 0; k < joints(); ++k) drives[k] = static_cast<double>(out_.command.drive[k]);
  }
  void stop() override { p::stop(law_); }
  p::TreeFault fault() const override { return p::fault_of(law_.state); }
  p::Mode mode() const override { return p::mode_of(law_.state); }
  std::uint32_t challenge() const override { return out_.challenge; }
  nb::object enable() const override {
    nb::list all;
    for (std::size_t k = 0; k < joints(); ++k) all.append(out_.enable[k]);
    return nb::tuple(all);
  }
  nb::object effort() const override { return array_of(out_.command.effort, joints()); }
  nb::list log() const override {
    nb::list all;
    for (std::uint32_t ago = 0; ago < p::log_length; ++ago) {
      const p::LoggedTreeFault one = p::logged(law_.state, ago);
      if (one.fault.fault == p::SafetyFault::none) break;
      all.append(nb::make_tuple(one.step, fault_name(one.fault.fault), one.fault.joint,
                                p::mode_names[static_cast<std::size_t>(one.mode)]));
    }
    return all;
  }
  void flip(std::size_t bit) override {
    auto* bytes = reinterpret_cast<unsigned char*>(&law_.controller.law);
    const std::size_t byte = bit / 8 % sizeof law_.controller.law;
    bytes[byte] = static_cast<unsigned char>(bytes[byte] ^ (1u << bit % 8));
  }

 protected:
  p::TreeSupervised<L> law_;
  p::TreeSupervisorOutput<S, most_law_links> out_;
};

template <class S> class CommandedTreeIn : public SupervisedTreeIn<p::CommandedTree<S, most_law_links>> {
 public:
  using SupervisedTreeIn<p::CommandedTree<S, most_law_links>>::SupervisedTreeIn;
  void command(const double* efforts) override {
    for (std::size_t k = 0; k < this->joints(); ++k)
      if (!std::isfinite(efforts[k])) return this->stop();
    p::change_memory(this->law_, [&](auto& state) {
      for (std::size_t k = 0; k < this->joints(); ++k) state.command[k] = static_cast<S>(efforts[k]);
    });
  }
};

template <class T> struct Type {
  using type = T;
};

struct SupervisedTreeLaw {
  std::unique_ptr<AnySupervisedTree> law;
  SupervisedTreeLaw(nb::handle links, nb::handle gravity, nb::handle joints, nb::handle shares, nb::handle whole,
                    nb::handle watches, nb::handle whole_watch, nb::handle turns, nb::handle motors, bool single,
                    bool commanded) {
    const Numbers numbers{links, gravity, joints, shares, whole, turns, motors};
    const auto made = [&](auto of) { law = std::make_unique<typename decltype(of)::type>(numbers, watches, whole_watch); };
    if (commanded && single) made(Type<CommandedTreeIn<float>>{});
    else if (commanded) made(Type<CommandedTreeIn<double>>{});
    else if (single) made(Type<SupervisedTreeIn<Law<float>>>{});
    else made(Type<SupervisedTreeIn<Law<double>>>{});
  }
  nb::object step(double time, nb::handle position, nb::handle interaction, nb::handle muscle, nb::handle wrench,
                  nb::handle drive, nb::handle joint, std::uint32_t token, nb::handle command) {
    if (!command.is_none()) {
      const Array efforts = read_array("command", command);
      efforts.expect(text({law->joints()}), {law->joints()});
      law->command(efforts.data);
    }
    const Read read(law->joints(), position,
                    {{"interaction", interaction}, {"muscle", muscle}, {"wrench", wrench}, {"drive", drive}, {"joint", joint}},
                    nullptr);
    const Result drives({law->joints()});
    law->step(time, read, token, drives.data);
    return drives.array();
  }
};

/// In float, with as many links as it has.
template <std::size_t... N> std::size_t storage_of(std::size_t links, std::index_sequence<N...>) {
  constexpr std::size_t bytes[] = {sizeof(p::TreeSupervised<p::TreeCompensation<float, N + 1>>)...};
  return (bytes[links - 1] + 7) / 8 * 8;
}
std::size_t storage(nb::handle links) {
  const auto n = static_cast<std::size_t>(read_integer("links", links, 1, most_law_links));
  return storage_of(n, std::make_index_sequence<most_law_links>());
}

}  // namespace

void add_tree_laws(nb::module_& m) {
  m.def("tree_law_storage", storage, nb::arg("links"), nb::sig("def tree_law_storage(links: int) -> int"),
        "Bytes of a supervised law of several joints in float, of a robot of so many links, on any machine.");
  nb::class_<TreeLaw>(m, "TreeLaw", law_doc)
      .def(nb::init<nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, bool>(),
           nb::arg("links").none(), nb::arg("gravity").none(), nb::arg("joints").none(), nb::arg("shares").none(),
           nb::arg("whole").none(), nb::kw_only(), nb::arg("turns") = nb::none(), nb::arg("motors") = nb::none(),
           nb::arg("single") = false, nb::sig(init_sig))
      .def("step", &TreeLaw::step, nb::arg("time"), nb::arg("position").none(), nb::arg("interaction") = nb::none(),
           nb::arg("muscle") = nb::none(), nb::arg("wrench") = nb::none(), nb::sig(step_sig), step_doc)
      .def("run", &TreeLaw::run, nb::arg("time").none(), nb::arg("position").none(),
           nb::arg("interaction") = nb::none(), nb::arg("muscle") = nb::none(), nb::arg("wrench") = nb::none(),
           nb::sig(run_sig), run_doc)
      .def("reset", [](TreeLaw& l) { l.law->reset(); }, "Open the gate again; efforts go on from where they are.")
      .def("stop", [](TreeLaw& l) { l.law->stop(); }, "From the next step on all efforts go to 0, and stay there.")
      .def_prop_ro("joints", [](const TreeLaw& l) { return l.law->joints(); }, "How many move.")
      .def_prop_ro("fault", [](const TreeLaw& l) { return fault_name(l.law->fault().fault); },
                   "Why efforts are 0, or on their way there; 'none' while the gate is open.")
      .def_prop_ro("fault_joint", [](const TreeLaw& l) { return l.law->fault().joint; },
                   "Of which joint the fault is, from 0; their number where it is of the whole.")
      .def_prop_ro("drive", [](const TreeLaw& l) { return l.law->drive(); },
                   nb::sig("def drive(self, /) -> NDArray[float64]"), "The last efforts at motors, (m,) [N m; N].")
      .def_prop_ro("outside", [](const TreeLaw& l) { return l.law->outside(); },
                   nb::sig("def outside(self, /) -> NDArray[float64]"),
                   "What people and obstacles do to each joint, as the momentum's observer has it, (m,) [N m; N].")
      .def_prop_ro("weight", [](const TreeLaw& l) { return l.law->weight(); },
                   nb::sig("def weight(self, /) -> NDArray[float64]"), "Gravity of each joint, now, (m,) [N m; N].")
      .def_prop_ro("end_speed", [](const TreeLaw& l) { return l.law->end_speed(); },
                   "Of the end point, as the law has it [m/s].")
      .def("time", [](TreeLaw& l, std::size_t cycles) { return l.law->time(cycles); }, nb::arg("cycles"),
           nb::sig("def time(self, cycles: int) -> NDArray[float64]"), time_doc);
  nb::class_<SupervisedTreeLaw>(m, "SupervisedTreeLaw", supervised_doc)
      .def(nb::init<nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, nb::handle, nb::handle,
                    nb::handle, bool, bool>(),
           nb::arg("links").none(), nb::arg("gravity").none(), nb::arg("joints").none(), nb::arg("shares").none(),
           nb::arg("whole").none(), nb::arg("watches").none(), nb::arg("whole_watch").none(), nb::kw_only(),
           nb::arg("turns") = nb::none(), nb::arg("motors") = nb::none(), nb::arg("single") = false,
           nb::arg("commanded") = false, nb::sig(supervised_init_sig))
      .def("step", &SupervisedTreeLaw::step, nb::arg("time"), nb::arg("position").none(),
           nb::arg("interaction") = nb::none(), nb::arg("muscle") = nb::none(), nb::arg("wrench") = nb::none(),
           nb::kw_only(), nb::arg("drive") = nb::none(), nb::arg("joint") = nb::none(), nb::arg("token") = 0,
           nb::arg("command") = nb::none(), nb::sig(supervised_step_sig), supervised_step_doc)
      .def("stop", [](SupervisedTreeLaw& l) { l.law->stop(); }, "From the next step on it stops.")
      .def_prop_ro("fault", [](const SupervisedTreeLaw& l) { return fault_name(l.law->fault().fault); },
                   "The first one, latched; 'none' while all is well.")
      .def_prop_ro("fault_joint", [](const SupervisedTreeLaw& l) { return l.law->fault().joint; },
                   "Of which joint it is, from 0; their number where it is of the whole.")
      .def_prop_ro("mode", [](const SupervisedTreeLaw& l) { return p::mode_names[static_cast<std::size_t>(l.law->mode())]; },
                   "What is being done.")
      .def_prop_ro("challenge", [](const SupervisedTreeLaw& l) { return l.law->challenge(); },
                   "What a reset needs as its token; 0 while all is well.")
      .def_prop_ro("enable", [](const SupervisedTreeLaw& l) { return l.law->enable(); },
                   nb::sig("def enable(self, /) -> tuple[bool, ...]"), "Of each motor whether its power may be on.")
      .def_prop_ro("effort", [](const SupervisedTreeLaw& l) { return l.law->effort(); },
                   nb::sig("def effort(self, /) -> NDArray[float64]"), "The last efforts at joints, (m,) [N m; N].")
      .def_prop_ro("log", [](const SupervisedTreeLaw& l) { return l.law->log(); },
                   nb::sig("def log(self, /) -> list[tuple[int, str, int, str]]"),
                   "Step, fault, joint and mode of the latest faults, the last first.")
      .def("flip", [](SupervisedTreeLaw& l, std::size_t bit) { l.law->flip(bit); }, nb::arg("bit"),
           "Lose a bit of the law's numbers in memory, to test that it is found out.");
}

}  // namespace bindings
