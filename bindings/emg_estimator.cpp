// The calibrated estimator of torque, stepped from Python as a robot runs it, in double and in float.
#include "emg_estimator.hpp"

#include "fields.hpp"

#include <pellucid/emg_estimator.hpp>

#include <cmath>
#include <memory>

namespace bindings {
namespace {

namespace p = pellucid;

using Room = p::EmgSize<32, 16, 64, 8, 512, 512>;

constexpr const char* estimator_doc = R"(Torque of joints from EMG and angles as they arrive, by muscles or by a map.

Parameters
----------
channels : (c, 3)
    Scale, rest and ceiling of each channel of EMG; at most 32.
angles : int
    How many angles are given, 1 to 16.
muscles : (m, 18)
    A row per muscle in the order of MUSCLE_PARAMETER_NAMES; at most 64.
shares : (m, c)
    Of each channel's envelope in each muscle's excitation.
axes : (m, 2, 6)
    Of each muscle's path: index of the angle (below 0: none), sign, offset, start, step, cells (0: no axis).
surfaces : sequence of (k,)
    Coefficients of each path [m], the last axis fastest.
joints : (j, 5)
    Index of the angle, offset, stiffness, damping and limit of each joint; at most 8.
terms : sequence of (k, 3)
    Weight and features of each joint's map; -1 is no feature.
lags : (l,) of int
    How much earlier the map sees envelopes too, in samples; at most 4, below 512.
motion : (1, 6)
    Second-order section on angles before they are differentiated.
before, after : (k, 6)
    Sections before and after raw EMG is rectified, at most 6 and 4; None: envelopes are given.
gamma, tendon_strain : float
    Of short-range stiffness [1].
period : float
    From one step to the next [s], > 0.
patience : int
    Periods that what is silent keeps its last value.
watch : (c, 10)
    Numbers of the core's WatchedChannelParams of each channel, in its order; None: none is watched.
patterns : sequence of (k, 3)
    Weight and features of each channel's pattern, of angles alone; -1 is no feature.
ranges : (a, 4)
    Smallest and largest of each angle [rad] and of its rate [rad/s] in the calibration, with margins.
forgetting, max_loss : float
    Share of a mean that a step replaces; share of the torque's variance at which a channel has changed.
residual : float
    Share of the torque's variance that the calibration leaves unexplained; 0: not known.
common : (2,)
    Common scale of all channels below and above which no torque holds.)";

constexpr const char* step_doc = R"(One period.

Parameters
----------
time : int
    On any clock that only goes on [us].
envelope : (c,)
    Of each channel; NaN where it was not heard. Without meaning where raw EMG goes through listen.
angle : (a,)
    [rad]; NaN where it was not heard.

Returns
-------
torque : (j,)
    [N m], finite and within each limit.
fault : int
    Index into EMG_FAULTS of the gravest, 0 for none.
lost, above, blind : int
    Channels lost, channels above their ceiling, angles lost: a bit each.)";

constexpr const char* run_doc = R"(Periods one after another, going on from the state.

Parameters
----------
time : (n,) of int
    [us].
envelope : (c, n)
angle : (a, n)
    As of step.

Returns
-------
torque : (j, n)
    [N m].
fault : (n,)
    As of step.
short_range, slope : (j, j, n)
    Stiffness of the joints [N m/rad], row by the torque, column by the angle.)";

constexpr const char* path_doc = R"(Lengths of one muscle with its tendon, and their derivatives by the angles given.

Parameters
----------
axes : (2, 6)
    As of EmgEstimator.
surface : (k,)
    Coefficients [m].
angle : (a, n)
    [rad].

Returns
-------
length : (n,)
    [m].
slope : (2, n)
    By the angle of each axis [m/rad]; the moment arm is its negative.
bend : (2, 2, n)
    Second derivatives [m/rad^2].)";

template <class S, std::size_t most> p::BiquadCoefficients<S, most> sections(const char* name, nb::handle sos) {
  const Array array = read_array(name, sos);
  if (array.shape.size() != 2 || array.shape[1] != 6 || array.shape[0] > most)
    array.fail("(k, 6) with k at most " + std::to_string(most));
  p::BiquadCoefficients<S, most> c;
  c.count = array.shape[0];
  for (std::size_t i = 0; i < c.count; ++i) {
    const double* row = array.data + 6 * i;
    if (row[3] != 1.0) throw nb::value_error((std::string(name) + ": expected every a0 (column 3) to be 1").c_str());
    c.section[i] = {static_cast<S>(row[0]), static_cast<S>(row[1]), static_cast<S>(row[2]), static_cast<S>(row[4]),
                    static_cast<S>(row[5])};
  }
  return c;
}

template <class S> std::vector<S> copied(const char* name, nb::handle values) {
  const Array array = read_array(name, values);
  if (array.shape.size() != 1) array.fail("(k,)");
  std::vector<S> made;
  for (std::size_t i = 0; i < array.size(); ++i) made.push_back(static_cast<S>(array.data[i]));
  return made;
}

std::uint32_t whole(const char* name, double x, double most) {
  if (!(x >= 0.0 && x <= most) || x != std::floor(x))
    throw nb::value_error((std::string(name) + ": expected whole numbers from 0").c_str());
  return static_cast<std::uint32_t>(x);
}

/// Axes of one path, from rows of six numbers, and whether its surface is as large as they say.
template <class S>
p::MusclePathParams<S> path_of(const double* rows, const std::vector<S>& surface) {
  p::MusclePathParams<S> path;
  path.axes = 0;
  std::size_t wanted = 1;
  for (std::size_t k = 0; k < p::path_axes; ++k) {
    const double* row = rows + 6 * k;
    const std::uint32_t cells = whole("axes, cells", row[5], p::most_path_cells);
    if (cells == 0) break;
    path.axis[k] = {row[0] < 0.0 ? p::no_factor : whole("axes, angle", row[0], 1e6), static_cast<S>(row[1]),
                    static_cast<S>(row[2]), static_cast<S>(row[3]), static_cast<S>(row[4]), cells};
    wanted *= cells + 3;
    ++path.axes;
  }
  if (path.axes == 0 || surface.size() != wanted)
    throw nb::value_error(("surfaces: got " + std::to_string(surface.size()) + " coefficients, expected " +
                           std::to_string(wanted) + " as axes say")
                              .c_str());
  path.coefficient = surface.data();
  if (!p::coefficients(path).valid) throw nb::value_error("axes: expected finite numbers and steps above 0");
  return path;
}

template <class S> class EmgEstimator {
 public:
  EmgEstimator(nb::handle channels, long long angles, nb::handle muscles, nb::handle shares, nb::handle axes,
               nb::sequence surfaces, nb::handle joints, nb::sequence terms, nb::handle lags, nb::handle motion,
               nb::handle before, nb::handle after, double gamma, double tendon_strain, double period,
               std::uint32_t patience, nb::handle watch, nb::sequence patterns, nb::handle ranges, double forgetting,
               double max_loss, double residual, nb::handle common)
      : own_(std::make_unique<Own>()) {
    auto made = std::make_unique<p::EmgEstimatorParams<S, Room>>();
    p::EmgEstimatorParams<S, Room>& params = *made;
    const Array channel = read_array("channels", channels);
    if (channel.shape.size() != 2 || channel.shape[1] != 3 || channel.shape[0] > Room::channels)
      channel.fail("(c, 3) with c at most " + std::to_string(Room::channels));
    params.channels = static_cast<std::uint32_t>(channel.shape[0]);
    for (std::size_t i = 0; i < params.channels; ++i) {
      const double* row = channel.data + 3 * i;
      params.channel[i] = {static_cast<S>(row[0]), static_cast<S>(row[1]), static_cast<S>(row[2])};
    }
    if (angles < 1 || angles > static_cast<long long>(Room::angles))
      throw nb::value_error(("angles: expected 1 to " + std::to_string(Room::angles)).c_str());
    params.angles = static_cast<std::uint32_t>(angles);

    const Array muscle = read_array("muscles", muscles), share = read_array("shares", shares),
                axis = read_array("axes", axes);
    const std::size_t width = p::muscle_parameter_count;
    if (muscle.shape.size() != 2 || muscle.shape[1] != width || muscle.shape[0] > Room::muscles)
      muscle.fail("(m, " + std::to_string(width) + ") with m at most " + std::to_string(Room::muscles));
    const std::size_t count = muscle.shape[0];
    share.expect(text({count, params.channels}), {count, params.channels});
    axis.expect(text({count, p::path_axes, 6}), {count, p::path_axes, 6});
    if (nb::len(surfaces) != count) throw nb::value_error("surfaces: expected one for each muscle");
    params.muscles = static_cast<std::uint32_t>(count);
    own_->surface.reserve(count);
    for (std::size_t m = 0; m < count; ++m) {
      S numbers[p::muscle_parameter_count];
      for (std::size_t i = 0; i < width; ++i) numbers[i] = static_cast<S>(muscle.data[m * width + i]);
      params.muscle[m].muscle = p::emg_muscle_params(numbers, static_cast<S>(period));
      if (muscle.data[m * width + delay_at()] > period * static_cast<double>(Room::delay - 3))
        throw nb::value_error("muscles: a delay is longer than 509 periods");
      for (std::size_t i = 0; i < params.channels; ++i)
        params.muscle[m].share[i] = static_cast<S>(share.data[m * params.channels + i]);
      own_->surface.push_back(copied<S>("surfaces", surfaces[m]));
      params.muscle[m].path = path_of(axis.data + m * p::path_axes * 6, own_->surface.back());
    }

    const Array joint = read_array("joints", joints);
    if (joint.shape.size() != 2 || joint.shape[1] != 5 || joint.shape[0] < 1 || joint.shape[0] > Room::joints)
      joint.fail("(j, 5) with j from 1 to " + std::to_string(Room::joints));
    params.joints = static_cast<std::uint32_t>(joint.shape[0]);
    if (nb::len(terms) != params.joints) throw nb::value_error("terms: expected those of each joint");
    own_->term.resize(params.joints);
    for (std::size_t j = 0; j < params.joints; ++j) {
      const double* row = joint.data + 5 * j;
      p::EstimatedJointParams<S>& one = params.joint[j];
      one.angle = whole("joints, angle", row[0], 1e6);
      one.offset = static_cast<S>(row[1]);
      one.stiffness = static_cast<S>(row[2]);
      one.damping = static_cast<S>(row[3]);
      one.limit = static_cast<S>(row[4]);
      const Array term = read_array("terms", terms[j]);
      if (term.size() != 0 && (term.shape.size() != 2 || term.shape[1] != 3)) term.fail("(k, 3)");
      own_->term[j] = terms_of(term);
      one.term = own_->term[j].data();
      one.terms = static_cast<std::uint32_t>(own_->term[j].size());
    }
    const Array lag = read_array("lags", lags);
    if (lag.shape.size() != 1 || lag.size() > p::most_emg_lags) lag.fail("(l,) with l at most 4");
    params.lags = static_cast<std::uint32_t>(lag.size());
    for (std::size_t i = 0; i < params.lags; ++i) params.lag[i] = whole("lags", lag.data[i], Room::lag - 1);
    params.motion = sections<S, 1>("motion", motion);
    params.raw = !before.is_none() || !after.is_none();
    if (!before.is_none()) params.before = sections<S, 6>("before", before);
    if (!after.is_none()) params.after = sections<S, 4>("after", after);
    params.short_range = {static_cast<S>(gamma), static_cast<S>(tendon_strain)};
    if (!(period > 0.0) || !(period < 1e3)) throw nb::value_error("period: expected a number above 0, in seconds");
    params.period = static_cast<S>(period);
    params.period_us = static_cast<std::uint32_t>(std::lround(1e6 * period));
    params.patience = patience;
    if (!watch.is_none()) {
      const Array watched = read_array("watch", watch), range = read_array("ranges", ranges);
      watched.expect(text({params.channels, 10}), {params.channels, 10});
      range.expect(text({params.angles, 4}), {params.angles, 4});
      if (nb::len(patterns) != params.channels) throw nb::value_error("patterns: expected one for each channel");
      params.watch.on = true;
      params.watch.forgetting = static_cast<S>(forgetting);
      params.watch.max_loss = static_cast<S>(max_loss);
      params.watch.residual = static_cast<S>(residual);
      params.watch.period = params.period;
      const Array scale = read_array("common", common);
      scale.expect(text({2}), {2});
      params.watch.common_low = static_cast<S>(scale.data[0]);
      params.watch.common_high = static_cast<S>(scale.data[1]);
      own_->pattern.resize(params.channels);
      for (std::size_t i = 0; i < params.channels; ++i) {
        const double* row = watched.data + 10 * i;
        params.watch.channel[i] = {static_cast<S>(row[0]), static_cast<S>(row[1]), static_cast<S>(row[2]),
                                   static_cast<S>(row[3]), static_cast<S>(row[4]), static_cast<S>(row[5]),
                                   static_cast<S>(row[6]), static_cast<S>(row[7]), static_cast<S>(row[8]),
                                   static_cast<S>(row[9])};
        const Array term = read_array("patterns", patterns[i]);
        if (term.size() != 0 && (term.shape.size() != 2 || term.shape[1] != 3)) term.fail("(k, 3)");
        own_->pattern[i] = terms_of(term);
        params.pattern[i] = own_->pattern[i].data();
        params.pattern_terms[i] = static_cast<std::uint32_t>(own_->pattern[i].size());
      }
      for (std::size_t k = 0; k < params.angles; ++k) {
        const double* row = range.data + 4 * k;
        params.watch.angle[k] = {static_cast<S>(row[0]), static_cast<S>(row[1]), static_cast<S>(row[2]),
                                 static_cast<S>(row[3])};
      }
    }
    own_->coefficients = p::coefficients(params);
    if (!own_->coefficients.valid)
      throw nb::value_error("EmgEstimator: expected finite numbers within their bounds, features and angles that exist, "
                            "ceilings above rest, a period of at least 1 us");
  }

  void listen(nb::handle samples) {
    const Array x = read_array("samples", samples);
    const std::size_t channels = own_->coefficients.channels;
    if (x.shape.size() != 2 || x.shape[1] != channels) x.fail("(n, " + std::to_string(channels) + ")");
    for (std::size_t i = 0; i < x.shape[0]; ++i) {
      S raw[Room::channels] = {};
      for (std::size_t k = 0; k < channels; ++k) raw[k] = static_cast<S>(x.data[i * channels + k]);
      p::listen(own_->coefficients, own_->state, raw);
    }
  }

  nb::tuple step(std::int64_t time, nb::handle envelope, nb::handle angle) {
    const Array e = read_array("envelope", envelope), q = read_array("angle", angle);
    const std::size_t channels = own_->coefficients.channels, angles = own_->coefficients.angles;
    e.expect(text({channels}) + ", a number per channel", {channels});
    q.expect(text({angles}) + ", a number per angle", {angles});
    const p::EmgEstimate<S, Room> found = at(time, e.data, 1, q.data, 1);
    Result torque({own_->coefficients.joints});
    for (std::size_t j = 0; j < own_->coefficients.joints; ++j) torque.data[j] = static_cast<double>(found.torque[j]);
    return nb::make_tuple(torque.array(), static_cast<int>(found.fault), found.lost, found.above, found.blind);
  }

  nb::tuple run(nb::handle time, nb::handle envelope, nb::handle angle) {
    const Array t = read_array("time", time), e = read_array("envelope", envelope), q = read_array("angle", angle);
    const std::size_t channels = own_->coefficients.channels, angles = own_->coefficients.angles,
                      joints = own_->coefficients.joints;
    if (t.shape.size() != 1) t.fail("(n,)");
    const std::size_t n = t.shape[0];
    e.expect(text({channels, n}) + ", a row per channel", {channels, n});
    q.expect(text({angles, n}) + ", a row per angle", {angles, n});
    Result torque({joints, n}), fault({n}), short_range({joints, joints, n}), slope({joints, joints, n});
    for (std::size_t k = 0; k < n; ++k) {
      if (!(std::fabs(t.data[k]) < 9e15)) throw nb::value_error("time: expected whole microseconds");
      const auto found = at(static_cast<std::int64_t>(t.data[k]), e.data + k, n, q.data + k, n);
      const auto stiff = p::stiffness(own_->coefficients, own_->state);
      fault.data[k] = static_cast<double>(found.fault);
      for (std::size_t i = 0; i < joints; ++i) {
        torque.data[i * n + k] = static_cast<double>(found.torque[i]);
        for (std::size_t j = 0; j < joints; ++j) {
          short_range.data[(i * joints + j) * n + k] = static_cast<double>(stiff.short_range[i][j]);
          slope.data[(i * joints + j) * n + k] = static_cast<double>(stiff.slope[i][j]);
        }
      }
    }
    return nb::make_tuple(torque.array(), fault.array(), short_range.array(), slope.array());
  }

  nb::tuple stiffness() const {
    const auto found = p::stiffness(own_->coefficients, own_->state);
    const std::size_t joints = own_->coefficients.joints;
    Result short_range({joints, joints}), slope({joints, joints});
    for (std::size_t i = 0; i < joints; ++i)
      for (std::size_t j = 0; j < joints; ++j) {
        short_range.data[i * joints + j] = static_cast<double>(found.short_range[i][j]);
        slope.data[i * joints + j] = static_cast<double>(found.slope[i][j]);
      }
    return nb::make_tuple(short_range.array(), slope.array());
  }

  nb::object forces() const {
    return per_muscle([this](std::size_t m) { return own_->state.muscle[m].force; });
  }
  nb::object activations() const {
    return per_muscle([this](std::size_t m) { return own_->state.muscle[m].activation; });
  }
  nb::object levels() const {
    Result result({own_->coefficients.channels});
    for (std::size_t i = 0; i < own_->coefficients.channels; ++i)
      result.data[i] = static_cast<double>(own_->state.channel[i].heard);
    return result.array();
  }
  std::uint32_t changed() const { return own_->state.estimate.changed; }
  double widening() const { return static_cast<double>(own_->state.estimate.widening); }
  nb::object losses() const {
    Result result({own_->coefficients.channels});
    for (std::size_t i = 0; i < own_->coefficients.channels; ++i)
      result.data[i] = static_cast<double>(own_->state.watch.loss[i]);
    return result.array();
  }
  void reset() { own_->state = {}; }

 private:
  static std::vector<p::TorqueTerm<S>> terms_of(const Array& term) {
    const auto factor = [](double x) { return x < 0.0 ? p::no_factor : whole("terms", x, 1e6); };
    std::vector<p::TorqueTerm<S>> made;
    for (std::size_t i = 0; i + 2 < term.size(); i += 3)
      made.push_back({static_cast<S>(term.data[i]), factor(term.data[i + 1]), factor(term.data[i + 2])});
    return made;
  }
  static std::size_t delay_at() {
    std::size_t at = 0, i = 0;
    const p::EmgMuscleParams<S> params{};
    p::walk(params, [&at, &i](const auto&, const p::Field& f) {
      if (std::string(f.name) == "delay") at = i;
      ++i;
    });
    return at;
  }
  p::EmgEstimate<S, Room> at(std::int64_t time, const double* envelope, std::size_t every, const double* angle,
                             std::size_t each) {
    p::EmgSamples<S, Room> in;
    in.time = time;
    for (std::size_t i = 0; i < own_->coefficients.channels; ++i) in.envelope[i] = static_cast<S>(envelope[i * every]);
    for (std::size_t i = 0; i < own_->coefficients.angles; ++i) in.angle[i] = static_cast<S>(angle[i * each]);
    return p::step(own_->coefficients, own_->state, in);
  }
  template <class F> nb::object per_muscle(F f) const {
    Result result({own_->coefficients.muscles});
    for (std::size_t m = 0; m < own_->coefficients.muscles; ++m) result.data[m] = static_cast<double>(f(m));
    return result.array();
  }

  struct Own {
    std::vector<std::vector<S>> surface;
    std::vector<std::vector<p::TorqueTerm<S>>> term, pattern;
    p::EmgEstimatorCoefficients<S, Room> coefficients;
    p::EmgEstimatorState<S, Room> state;
  };
  std::unique_ptr<Own> own_;
};

nb::object muscle_path(nb::handle axes, nb::handle surface, nb::handle angle) {
  const Array axis = read_array("axes", axes), q = read_array("angle", angle);
  axis.expect(text({p::path_axes, 6}), {p::path_axes, 6});
  if (q.shape.size() != 2 || q.shape[0] > Room::angles) q.fail("(a, n)");
  const std::vector<double> numbers = copied<double>("surface", surface);
  const auto c = p::coefficients(path_of(axis.data, numbers));
  const std::size_t angles = q.shape[0], n = q.shape[1];
  Result length({n}), slope({p::path_axes, n}), bend({p::path_axes, p::path_axes, n});
  for (std::size_t k = 0; k < n; ++k) {
    double at[Room::angles] = {};
    for (std::size_t a = 0; a < angles; ++a) at[a] = q.data[a * n + k];
    const p::MusclePath<double> path = p::muscle_path(c, at, angles);
    length.data[k] = path.length;
    for (std::size_t i = 0; i < p::path_axes; ++i) {
      slope.data[i * n + k] = path.slope[i];
      for (std::size_t j = 0; j < p::path_axes; ++j) bend.data[(i * p::path_axes + j) * n + k] = path.bend[i][j];
    }
  }
  return nb::make_tuple(length.array(), slope.array(), bend.array());
}

template <class S> void add_one(nb::module_& m, const char* name) {
  using Class = EmgEstimator<S>;
  nb::class_<Class>(m, name, estimator_doc)
      .def(nb::init<nb::handle, long long, nb::handle, nb::handle, nb::handle, nb::sequence, nb::handle, nb::sequence,
                    nb::handle, nb::handle, nb::handle, nb::handle, double, double, double, std::uint32_t, nb::handle,
                    nb::sequence, nb::handle, double, double, double, nb::handle>(),
           nb::kw_only(), nb::arg("channels").none(), nb::arg("angles"), nb::arg("muscles").none(),
           nb::arg("shares").none(), nb::arg("axes").none(), nb::arg("surfaces"), nb::arg("joints").none(),
           nb::arg("terms"), nb::arg("lags").none(), nb::arg("motion").none(), nb::arg("before") = nb::none(),
           nb::arg("after") = nb::none(), nb::arg("gamma") = 23.4, nb::arg("tendon_strain") = 0.033, nb::arg("period"),
           nb::arg("patience"), nb::arg("watch") = nb::none(), nb::arg("patterns") = nb::tuple(),
           nb::arg("ranges") = nb::none(), nb::arg("forgetting") = 0.0, nb::arg("max_loss") = 0.0,
           nb::arg("residual") = 0.0, nb::arg("common") = nb::none(),
           nb::sig("def __init__(self, *, channels: ArrayLike, angles: int, muscles: ArrayLike, shares: ArrayLike, "
                   "axes: ArrayLike, surfaces: Sequence[ArrayLike], joints: ArrayLike, terms: Sequence[ArrayLike], "
                   "lags: ArrayLike, motion: ArrayLike, before: ArrayLike | None = None, after: ArrayLike | None = "
                   "None, gamma: float = 23.4, tendon_strain: float = 0.033, period: float, patience: int, watch: ArrayLike | None = None, "
                   "patterns: Sequence[ArrayLike] = (), ranges: ArrayLike | None = None, forgetting: float = 0.0, "
                   "max_loss: float = 0.0, residual: float = 0.0, common: ArrayLike | None = None) -> None"))
      .def("listen", &Class::listen, nb::arg("samples").none(),
           nb::sig("def listen(self, samples: ArrayLike) -> None"),
           "Raw EMG of every channel, (n, c), at the rate that the filters are made for.")
      .def("step", &Class::step, nb::arg("time"), nb::arg("envelope").none(), nb::arg("angle").none(),
           nb::sig("def step(self, time: int, envelope: ArrayLike, angle: ArrayLike) -> tuple[NDArray[float64], int, "
                   "int, int, int]"),
           step_doc)
      .def("run", &Class::run, nb::arg("time").none(), nb::arg("envelope").none(), nb::arg("angle").none(),
           nb::sig("def run(self, time: ArrayLike, envelope: ArrayLike, angle: ArrayLike) -> tuple[NDArray[float64], "
                   "NDArray[float64], NDArray[float64], NDArray[float64]]"),
           run_doc)
      .def("stiffness", &Class::stiffness,
           nb::sig("def stiffness(self) -> tuple[NDArray[float64], NDArray[float64]]"),
           "Of the joints at the last step, at once and by Hill's slope, (j, j) each [N m/rad].")
      .def_prop_ro("forces", &Class::forces, nb::sig("def forces(self) -> NDArray[float64]"),
                   "In each tendon at the last step, (m,) [N].")
      .def_prop_ro("activations", &Class::activations, nb::sig("def activations(self) -> NDArray[float64]"),
                   "Of each muscle at the last step, (m,) [1].")
      .def_prop_ro("levels", &Class::levels, nb::sig("def levels(self) -> NDArray[float64]"),
                   "Envelope of each channel as it was last heard, (c,).")
      .def_prop_ro("changed", &Class::changed, nb::sig("def changed(self) -> int"),
                   "Channels that changed since the calibration, at the last step, a bit each.")
      .def_prop_ro("losses", &Class::losses, nb::sig("def losses(self) -> NDArray[float64]"),
                   "Share of the torque's variance that each channel may cost at the last step, (c,).")
      .def_prop_ro("widening", &Class::widening, nb::sig("def widening(self) -> float"),
                   "Error of the torque over its calibrated error, at the last step.")
      .def("reset", &Class::reset, "Forget every sample.");
}

}  // namespace

void add_emg_estimator(nb::module_& m) {
  nb::list faults;
  for (const char* name : p::emg_fault_names) faults.append(name);
  m.attr("EMG_FAULTS") = nb::tuple(faults);
  add_one<double>(m, "EmgEstimator");
  add_one<float>(m, "EmgEstimatorFloat");
  m.def("muscle_path", muscle_path, nb::arg("axes").none(), nb::arg("surface").none(), nb::arg("angle").none(),
        nb::sig("def muscle_path(axes: ArrayLike, surface: ArrayLike, angle: ArrayLike) -> tuple[NDArray[float64], "
                "NDArray[float64], NDArray[float64]]"),
        path_doc);
}

}  // namespace bindings
