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
  return p::coefficients(p::joint_params(values));
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
    const auto c = p::coefficients(p::joint_params(values));
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

/// Reads rows first... of a simulation as one S, and writes it back.
template <class S> struct Row {
  std::size_t first;

  S read(const Rows& rows, std::size_t i) const {
    return rows.data == nullptr ? S(0) : S(rows.data[first * rows.stride + i]);
  }
  void write(double* out, std::size_t samples, std::size_t i, const S& x) const {
    out[first * samples + i] = p::value_of(x);
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
  void write(double* out, std::size_t samples, std::size_t i, const Block& x) const {
    for (std::size_t l = 0; l < width && first + l < last; ++l) out[(first + l) * samples + i] = x[l];
  }
};

template <class S>
p::PlantParams<S> plant(const Simulation& s, const Row<S>& row, const S (&parameters)[p::parameter_count]) {
  const auto setting = [&](Setting which) { return row.read(s.settings[which], 0); };
  p::PlantParams<S> params;
  params.joint = p::joint_params(parameters);
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
  return params;
}

/// Runs one plant; use(i, output) takes what each sample gives.
template <p::Friction mode, class S, class Use>
void run(const Simulation& s, const Row<S>& row, const S (&parameters)[p::parameter_count], Use use) {
  const auto c = p::coefficients(plant(s, row, parameters));
  p::PlantState<S> state;
  state.position = row.read(s.settings[position0], 0);
  state.velocity = row.read(s.settings[velocity0], 0);
  for (std::size_t i = 0; i < s.samples; ++i) {
    const p::PlantInput<S> input{row.read(s.reference, i), row.read(s.injected, i), row.read(s.disturbance, i),
                                 row.read(s.encoder_noise, i)};
    use(i, p::step<mode>(c, state, input));
  }
}

template <class S> const S& member(const p::PlantOutput<S>& out, std::size_t i) {
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

template <p::Friction mode, class S> void simulate_row(const Simulation& s, const Row<S>& row) {
  S parameters[p::parameter_count];
  for (std::size_t i = 0; i < p::parameter_count; ++i) parameters[i] = row.read(s.parameters, i);
  run<mode>(s, row, parameters, [&](std::size_t i, const p::PlantOutput<S>& out) {
    for (std::size_t j = 0; j < output_count; ++j) row.write(s.output[j], s.samples, i, member(out, j));
  });
}

template <p::Friction mode> void simulate_rows(const Simulation& s, std::size_t first, std::size_t last) {
  for (; last - first >= width_of<Blocks>; first += width_of<Blocks>)
    simulate_row<mode>(s, Row<Blocks>{first, first + width_of<Blocks>});
  while (last - first > 1) {
    const std::size_t end = last - first < width_of<Block> ? last : first + width_of<Block>;
    simulate_row<mode>(s, Row<Block>{first, end});
    first = end;
  }
  if (first < last) simulate_row<mode>(s, Row<double>{first});
}

void simulate(const Simulation& s, std::size_t first, std::size_t last) {
  if (s.stiction) return simulate_rows<p::Friction::stiction>(s, first, last);
  simulate_rows<p::Friction::smooth>(s, first, last);
}

void simulate_jacobian(const Simulation& s, const std::size_t* active, std::size_t k,
                       double* const (&derivative)[differentiated_count]) {
  if (k == 0) return simulate(s, 0, 1);
  const Row<Dual> row{0};
  for (std::size_t first = 0; first < k; first += 8) {
    Dual parameters[p::parameter_count];
    seed(s.parameters.data, active, first, k, parameters);
    run<p::Friction::smooth>(s, row, parameters, [&](std::size_t i, const p::PlantOutput<Dual>& out) {
      for (std::size_t j = 0; j < output_count; ++j) row.write(s.output[j], s.samples, i, member(out, j));
      for (std::size_t j = 0; j < differentiated_count; ++j)
        store(member(out, differentiated[j]), derivative[j] + i * k, first, k);
    });
  }
}

}  // namespace

namespace PELLUCID_ABI {
extern const Kernels kernels;
const Kernels kernels = {
    PELLUCID_INSTRUCTIONS, inverse_dynamics, inverse_dynamics_jacobian, forward_dynamics, friction, load, simulate,
    simulate_jacobian};
}  // namespace PELLUCID_ABI

}  // namespace bindings
