// The core, run over arrays. Compiled several times, with -m flags and PELLUCID_ABI naming the instruction set; the
// bits of the results are the same in all of them, so nothing here may use what another translation unit shares.
#include "kernels.hpp"

#include <pellucid/pellucid.hpp>

namespace bindings {
namespace {

namespace p = pellucid;

// One register of doubles, and four: the others work while the first waits for its own results.
using Block = p::Lanes<double, p::detail::register_bytes / sizeof(double)>;
using Blocks = p::Lanes<double, 4 * p::detail::register_bytes / sizeof(double)>;
using Dual = p::Dual<double, 8>;
template <class S> constexpr std::size_t width_of = 1;
template <std::size_t W> constexpr std::size_t width_of<p::Lanes<double, W>> = W;

template <class S> p::JointCoefficients<S> joint(const double* parameters) {
  S values[p::parameter_count];
  for (std::size_t i = 0; i < p::parameter_count; ++i) values[i] = S(parameters[i]);
  return p::coefficients(p::from_numbers<p::JointParams<S>>(values));
}

/// f(Block...) over n samples of the inputs.
template <class F, class... In> void for_each(std::size_t n, double* out, F f, const In*... in) {
  constexpr std::size_t width = width_of<Block>;
  for (std::size_t first = 0; first < n; first += width) {
    const std::size_t count = n - first < width ? n - first : width;
    const auto load = [first, count](const double* x) {
      Block block;
      for (std::size_t i = 0; i < width; ++i) block.set(i, x[first + (i < count ? i : count - 1)]);
      return block;
    };
    const Block result = f(load(in)...);
    for (std::size_t i = 0; i < count; ++i) out[first + i] = result[i];
  }
}

void inverse_dynamics(const double* parameters, std::size_t n, const double* position, const double* velocity,
                      const double* acceleration, double* effort) {
  const auto c = joint<Block>(parameters);
  for_each(
      n, effort, [&c](Block q, Block v, Block a) { return p::inverse_dynamics(c, q, v, a); }, position, velocity,
      acceleration);
}

/// Parameters with derivatives by those of active[first...].
void seed(const double* parameters, const std::size_t* active, std::size_t first, std::size_t k,
          Dual (&values)[p::parameter_count]) {
  for (std::size_t i = 0; i < p::parameter_count; ++i) values[i] = Dual(parameters[i]);
  for (std::size_t j = first; j < k && j < first + 8; ++j) values[active[j]].derivative.set(j - first, 1.0);
}

void store(const Dual& x, double* derivative, std::size_t first, std::size_t k) {
  for (std::size_t j = first; j < k && j < first + 8; ++j) derivative[j] = x.derivative[j - first];
}

void inverse_dynamics_jacobian(const double* parameters, std::size_t n, const double* position, const double* velocity,
                               const double* acceleration, const std::size_t* active, std::size_t k, double* effort,
                               double* jacobian) {
  if (k == 0) return inverse_dynamics(parameters, n, position, velocity, acceleration, effort);
  for (std::size_t first = 0; first < k; first += 8) {
    Dual values[p::parameter_count];
    seed(parameters, active, first, k, values);
    const auto c = p::coefficients(p::from_numbers<p::JointParams<Dual>>(values));
    for (std::size_t i = 0; i < n; ++i) {
      const Dual result = p::inverse_dynamics(c, position[i], velocity[i], acceleration[i]);
      effort[i] = result.value;
      store(result, jacobian + i * k, first, k);
    }
  }
}

void forward_dynamics(const double* parameters, std::size_t n, const double* position, const double* velocity,
                      const double* effort, double* acceleration) {
  const auto c = joint<Block>(parameters);
  for_each(
      n, acceleration, [&c](Block q, Block v, Block t) { return p::forward_dynamics(c, q, v, t); }, position, velocity,
      effort);
}

void friction(const double* parameters, std::size_t n, const double* velocity, const double* load, double* effort) {
  const auto c = joint<Block>(parameters).friction;
  for_each(n, effort, [&c](Block v, Block y) { return p::friction(c, v, y); }, velocity, load);
}

void load(const double* parameters, std::size_t n, const double* position, const double* acceleration, double* effort) {
  const auto c = joint<Block>(parameters);
  for_each(n, effort, [&c](Block q, Block a) { return p::load(c, q, a); }, position, acceleration);
}

void presliding(double travel, std::size_t n, const double* position, double* direction) {
  const auto c = p::coefficients(p::PreslidingParams<double>{travel});
  p::PreslidingState<double> state;
  for (std::size_t i = 0; i < n; ++i) direction[i] = p::step(c, state, position[i] - position[i > 0 ? i - 1 : 0]);
}

/// Reads rows first... of a simulation as one S, and writes it back.
template <class S> struct Row {
  std::size_t first;

  S read(const Rows& rows, std::size_t i) const {
    return rows.data == nullptr ? S(0) : S(rows.data[first * rows.stride + i]);
  }
  void write(double* out, std::size_t samples, std::size_t i, const S* x, std::size_t n) const {
    for (std::size_t k = 0; k < n; ++k) out[first * samples + i + k] = p::value_of(x[k]);
  }
};
template <std::size_t width> struct Row<p::Lanes<double, width>> {
  using Block = p::Lanes<double, width>;
  std::size_t first, last;

  std::size_t lane(std::size_t i) const { return first + i < last ? first + i : last - 1; }
  Block read(const Rows& rows, std::size_t i) const {
    if (rows.data == nullptr) return Block(0);
    if (rows.stride == 0) return Block(rows.data[i]);
    Block block;
    for (std::size_t l = 0; l < width; ++l) block.set(l, rows.data[lane(l) * rows.stride + i]);
    return block;
  }
  void write(double* out, std::size_t samples, std::size_t i, const Block* x, std::size_t n) const {
    for (std::size_t l = 0; l < width && first + l < last; ++l)
      for (std::size_t k = 0; k < n; ++k) out[(first + l) * samples + i + k] = x[k][l];
  }
};

/// The joint of plant.hpp, as a simulation runs it.
template <p::Friction mode> struct Rigid {
  static constexpr std::size_t parameter_count = p::parameter_count;
  static constexpr std::size_t output_count = bindings::output_count;
  static constexpr bool gives = true;  // before it slips
  template <class S> using Params = p::PlantParams<S>;

  template <class S> static p::JointParams<S> joint(const S (&parameters)[parameter_count]) {
    return p::from_numbers<p::JointParams<S>>(parameters);
  }
  template <class S>
  static p::PlantState<S> start(const p::PlantCoefficients<S>&, const S& position, const S& velocity) {
    p::PlantState<S> state;
    state.position = position;
    state.velocity = velocity;
    return state;
  }
  template <class S> static p::PlantOutput<S> step(const p::PlantCoefficients<S>& c, p::PlantState<S>& state,
                                                   const p::PlantInput<S>& input) {
    return p::step<mode>(c, state, input);
  }
  template <class S> static const S& member(const p::PlantOutput<S>& out, std::size_t i) {
    switch (i) {
      case 0:
        return out.position;
      case 1:
        return out.velocity;
      case 2:
        return out.acceleration;
      case 3:
        return out.command;
      case 4:
        return out.effort;
      default:
        return out.measured_position;
    }
  }
};

/// The motor and link of geared_plant.hpp.
struct Geared {
  static constexpr std::size_t parameter_count = p::geared_parameter_count;
  static constexpr std::size_t output_count = geared_output_count;
  static constexpr bool gives = false;
  template <class S> using Params = p::GearedPlantParams<S>;

  template <class S> static p::GearedJointParams<S> joint(const S (&parameters)[parameter_count]) {
    return p::from_numbers<p::GearedJointParams<S>>(parameters);
  }
  template <class S>
  static p::GearedPlantState<S> start(const p::GearedPlantCoefficients<S>& c, const S& position, const S& velocity) {
    return p::balanced(c, position, velocity);
  }
  template <class S> static p::GearedPlantOutput<S> step(const p::GearedPlantCoefficients<S>& c,
                                                         p::GearedPlantState<S>& state, const p::PlantInput<S>& input) {
    return p::step(c, state, input);
  }
  template <class S> static const S& member(const p::GearedPlantOutput<S>& out, std::size_t i) {
    switch (i) {
      case 0:
        return out.motor_position;
      case 1:
        return out.motor_velocity;
      case 2:
        return out.link_position;
      case 3:
        return out.link_velocity;
      case 4:
        return out.command;
      case 5:
        return out.measured_position;
      default:
        return out.transmission_torque;
    }
  }
};

/// Runs one plant; use(i, output) takes what each sample gives.
template <class Model, class S, class Use>
void run(const Simulation& s, const Row<S>& row, const S (&parameters)[Model::parameter_count], Use use) {
  const auto setting = [&](Setting which) { return row.read(s.settings[which], 0); };
  typename Model::template Params<S> params;
  params.joint = Model::joint(parameters);
  params.drive = {setting(gain), setting(back_emf), setting(ripple_amplitude), setting(ripple_wave_number),
                  setting(ripple_phase)};
  params.loop = {static_cast<p::LoopKind>(s.loop),
                 setting(kp),
                 setting(ki),
                 setting(kd),
                 setting(kv),
                 setting(limit),
                 s.velocity_span,
                 S(s.period)};
  params.encoder = {setting(encoder_quantum)};
  params.substeps = s.substeps;
  if constexpr (Model::gives) params.presliding = {setting(presliding_travel)};
  const auto c = p::coefficients(params);
  auto state = Model::start(c, setting(position0), setting(velocity0));
  state.loop.integral = setting(integral0);
  for (std::size_t i = 0; i < s.samples; ++i) {
    const p::PlantInput<S> input{row.read(s.reference, i), row.read(s.injected, i), row.read(s.disturbance, i),
                                 row.read(s.encoder_noise, i)};
    use(i, Model::step(c, state, input));
  }
}

template <class Model, class S> void simulate_row(const Simulation& s, const Row<S>& row) {
  S parameters[Model::parameter_count];
  for (std::size_t i = 0; i < Model::parameter_count; ++i) parameters[i] = row.read(s.parameters, i);
  // The rows of an output lie far apart in memory: a cache line's worth of samples is written to each at once.
  constexpr std::size_t kept = 8;
  S tile[Model::output_count][kept];
  run<Model>(s, row, parameters, [&](std::size_t i, const auto& out) {
    const std::size_t k = i % kept;
    for (std::size_t j = 0; j < Model::output_count; ++j) tile[j][k] = Model::member(out, j);
    if (k + 1 < kept && i + 1 < s.samples) return;
    for (std::size_t j = 0; j < Model::output_count; ++j) row.write(s.output[j], s.samples, i - k, tile[j], k + 1);
  });
}

template <class Model> void simulate_rows(const Simulation& s, std::size_t first, std::size_t last) {
  while (last - first > width_of<Blocks> / 2) {  // idle lanes cost less than three registers one after another
    const std::size_t end = last - first < width_of<Blocks> ? last : first + width_of<Blocks>;
    simulate_row<Model>(s, Row<Blocks>{first, end});
    first = end;
  }
  while (last - first > 1) {
    const std::size_t end = last - first < width_of<Block> ? last : first + width_of<Block>;
    simulate_row<Model>(s, Row<Block>{first, end});
    first = end;
  }
  if (first < last) simulate_row<Model>(s, Row<double>{first});
}

void simulate(const Simulation& s, std::size_t first, std::size_t last) {
  if (s.stiction) return simulate_rows<Rigid<p::Friction::stiction>>(s, first, last);
  simulate_rows<Rigid<p::Friction::smooth>>(s, first, last);
}

void simulate_jacobian(const Simulation& s, const std::size_t* active, std::size_t k,
                       double* const (&derivative)[differentiated_count]) {
  using Model = Rigid<p::Friction::smooth>;
  if (k == 0) return simulate(s, 0, 1);
  const Row<Dual> row{0};
  for (std::size_t first = 0; first < k; first += 8) {
    Dual parameters[p::parameter_count];
    seed(s.parameters.data, active, first, k, parameters);
    run<Model>(s, row, parameters, [&](std::size_t i, const p::PlantOutput<Dual>& out) {
      for (std::size_t j = 0; j < output_count; ++j) row.write(s.output[j], s.samples, i, &Model::member(out, j), 1);
      for (std::size_t j = 0; j < differentiated_count; ++j)
        store(Model::member(out, differentiated[j]), derivative[j] + i * k, first, k);
    });
  }
}

}  // namespace

namespace PELLUCID_ABI {
extern const Kernels kernels;
const Kernels kernels = {
    PELLUCID_INSTRUCTIONS, inverse_dynamics, inverse_dynamics_jacobian, forward_dynamics, friction, load, presliding,
    simulate, simulate_rows<Geared>, simulate_jacobian};
}  // namespace PELLUCID_ABI

}  // namespace bindings
