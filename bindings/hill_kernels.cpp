// Torque of several muscles with its derivatives, over arrays: delays and lags sample by sample, everything after them a
// register of samples at a time, summed in the same order whatever the instruction set.
#include "hill_kernels.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/hill_torque.hpp>
#include <pellucid/lanes.hpp>
#include <pellucid/muscle_slopes.hpp>

namespace bindings {
namespace {

namespace p = pellucid;

// One register of samples; eight where registers hold only two, so that they need not wait for each other.
constexpr std::size_t width = p::detail::register_bytes > 16 ? p::detail::register_bytes / sizeof(double) : 8;
constexpr std::size_t block = hill_block;
constexpr std::size_t free_count = p::muscle_free_count;
using Lane = p::Lanes<double, width>;
enum Quantity : std::size_t { shape, time_constant_1, time_constant_2, delay, first_of_force };

Lane load(const double* x) {
  Lane result;
  __builtin_memcpy(&result, x, sizeof result);
  return result;
}
void store(double* out, const Lane& x) { __builtin_memcpy(out, &x, sizeof x); }
/// The same, of the `count` samples there are; the last one stands in for those that are not.
Lane load(const double* x, std::size_t count) {
  if (count >= width) return load(x);
  Lane result;
  for (std::size_t i = 0; i < width; ++i) result.set(i, x[i < count ? i : count - 1]);
  return result;
}

template <class S> p::EmgMuscleParams<S> params_of(const double* numbers, double period) {
  S values[p::muscle_parameter_count];
  for (std::size_t i = 0; i < p::muscle_parameter_count; ++i) values[i] = S(numbers[i]);
  return p::emg_muscle_params(values, S(period));
}

/// One muscle: what follows from its parameters, and what it remembers from block to block.
struct Muscle {
  p::DelayCoefficients<double> delay;
  p::ActivationCoefficients<double> lags;
  p::ActivationCoefficients<Lane> activation;
  p::MuscleCoefficients<Lane> muscle;
  double gain_slope[2];  // d gain / d time constant
  double period;
  const double *excitation, *length, *velocity, *moment_arm;
  const std::int64_t* column;
  const double* chain;
  p::ActivationState<double> state;
  p::ActivationState<double> by_lag_1, by_lag_2, by_delay;  // derivatives of the lags; by_lag_2 uses its second alone
  bool lag_1, lag_2, delayed, any;                          // which of them are free

  Muscle() = default;
  Muscle(const HillData& data, const HillFree& free, std::size_t m) {
    const double* numbers = data.parameters + m * p::muscle_parameter_count;
    const p::EmgMuscleParams<double> params = params_of<double>(numbers, data.period);
    delay = p::delay_coefficients(params.delay / data.period, data.samples);
    lags = p::coefficients(params.activation);
    activation = p::coefficients(params_of<Lane>(numbers, data.period).activation);
    muscle = p::coefficients(params_of<Lane>(numbers, data.period).muscle);
    using Dual = p::Dual<double, 1>;
    gain_slope[0] = p::lag_gain(Dual::parameter(numbers[time_constant_1], 0), Dual(data.period)).derivative[0];
    gain_slope[1] = p::lag_gain(Dual::parameter(numbers[time_constant_2], 0), Dual(data.period)).derivative[0];
    period = data.period;
    excitation = data.excitation + m * data.samples;
    length = data.length + m * data.samples;
    velocity = data.velocity + m * data.samples;
    moment_arm = data.moment_arm + m * data.samples;
    column = free.column == nullptr ? nullptr : free.column + m * free_count;
    chain = free.gain == nullptr ? nullptr : free.gain + m * free_count;
    const auto is_free = [this](std::size_t q) { return column != nullptr && column[q] >= 0; };
    lag_1 = is_free(time_constant_1);
    lag_2 = is_free(time_constant_2);
    delayed = is_free(Quantity::delay);
    any = false;
    for (std::size_t q = 0; q < free_count; ++q) any = any || is_free(q);
  }
};

/// Samples of one muscle and one block: neural activation, and its derivatives by lags and delay.
struct Neural {
  double u[block], by_lag_1[block], by_lag_2[block], by_delay[block];
};

/// The delayed envelope of samples first ... of a recording that begins at `start`, and its derivative by the delay.
template <bool with_slope>
void delayed(const Muscle& m, std::size_t start, std::size_t first, std::size_t count, double* e, double* slope) {
  const double* x = m.excitation;
  const double* w = m.delay.weight;
  const double* s = m.delay.slope;
  const double rate = 1.0 / m.period;
  const std::size_t whole = m.delay.whole;
  const auto at = [x, start](std::size_t k, std::size_t age) { return x[k >= start + age ? k - age : start]; };
  const std::size_t newest = whole == 0 ? 0 : whole - 1;
  std::size_t i = 0;
  for (; i < count && first + i < start + whole + 2; ++i) {
    const std::size_t k = first + i;
    const double a = at(k, newest), b = at(k, whole), c = at(k, whole + 1), d = at(k, whole + 2);
    e[i] = w[0] * a + w[1] * b + w[2] * c + w[3] * d;
    if (with_slope) slope[i] = (s[0] * a + s[1] * b + s[2] * c + s[3] * d) * rate;
  }
  const double* now = x + first;
  for (; i < count; ++i) {
    const double a = now[i - newest], b = now[i - whole], c = now[i - whole - 1], d = now[i - whole - 2];
    e[i] = w[0] * a + w[1] * b + w[2] * c + w[3] * d;
    if (with_slope) slope[i] = (s[0] * a + s[1] * b + s[2] * c + s[3] * d) * rate;
  }
}

/// Lags over one block. Each derivative runs through the same two lags as what it is a derivative of.
template <bool by_lag_1, bool by_lag_2, bool by_delay>
void lag(Muscle& m, const double* e, const double* slope, std::size_t count, Neural& out) {
  const double g1 = m.lags.gain_1, g2 = m.lags.gain_2, dg1 = m.gain_slope[0], dg2 = m.gain_slope[1];
  p::ActivationState<double> s = m.state, d1 = m.by_lag_1, d2 = m.by_lag_2, dd = m.by_delay;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = p::clamp(e[i], 0.0, 1.0);
    const double in_1 = x - s.lag_1;
    const double first = s.lag_1 + g1 * in_1;
    const double in_2 = first - s.lag_2;
    const double second = s.lag_2 + g2 * in_2;
    if (by_lag_1) {
      d1.lag_1 += g1 * (0.0 - d1.lag_1) + dg1 * in_1;
      d1.lag_2 += g2 * (d1.lag_1 - d1.lag_2);
      out.by_lag_1[i] = d1.lag_2;
    }
    if (by_lag_2) {
      d2.lag_2 += g2 * (0.0 - d2.lag_2) + dg2 * in_2;
      out.by_lag_2[i] = d2.lag_2;
    }
    if (by_delay) {
      const double dx = e[i] > 0.0 && e[i] < 1.0 ? slope[i] : 0.0;
      dd.lag_1 += g1 * (dx - dd.lag_1);
      dd.lag_2 += g2 * (dd.lag_1 - dd.lag_2);
      out.by_delay[i] = dd.lag_2;
    }
    s.lag_1 = first;
    s.lag_2 = second;
    out.u[i] = second;
  }
  m.state = s;
  m.by_lag_1 = d1;
  m.by_lag_2 = d2;
  m.by_delay = dd;
}

void neural(Muscle& m, std::size_t start, std::size_t first, std::size_t count, Neural& out) {
  double e[block], slope[block];
  if (m.delayed)
    delayed<true>(m, start, first, count, e, slope);
  else
    delayed<false>(m, start, first, count, e, slope);
  if (first == start) {
    m.by_lag_1 = m.by_lag_2 = m.by_delay = {};
    p::settle(m.state, e[0]);
    if (m.delayed) m.by_delay.lag_1 = m.by_delay.lag_2 = e[0] > 0.0 && e[0] < 1.0 ? slope[0] : 0.0;
  }
  using Run = void (*)(Muscle&, const double*, const double*, std::size_t, Neural&);
  constexpr Run runs[8] = {lag<false, false, false>, lag<true, false, false>, lag<false, true, false>,
                           lag<true, true, false>,   lag<false, false, true>, lag<true, false, true>,
                           lag<false, true, true>,   lag<true, true, true>};
  runs[(m.lag_1 ? 1 : 0) + (m.lag_2 ? 2 : 0) + (m.delayed ? 4 : 0)](m, e, slope, count, out);
}

/// Adds a muscle's torque to each joint, and its derivatives to the columns, over one block: `torque` is a row of `block`
/// for each joint, `columns` is `k` rows of `block` for each. The force is worked out once, whatever it turns.
void add(const HillData& data, const Muscle& m, const Neural& n, std::size_t first, std::size_t count, std::size_t k,
         double* torque, double* columns) {
  const std::size_t joint = data.muscles * data.samples;
  for (std::size_t i = 0; i < count; i += width) {
    const std::size_t here = count - i;
    const Lane u = load(n.u + i, here), l = load(m.length + first + i, here), v = load(m.velocity + first + i, here);
    const auto arm = [&](std::size_t j) { return load(m.moment_arm + j * joint + first + i, here); };
    if (!m.any) {
      const Lane force = p::tendon_force(m.muscle, p::shaped(m.activation, u), p::fibre(m.muscle, l, v));
      for (std::size_t j = 0; j < data.joints; ++j) {
        double* to = torque + j * block + i;
        store(to, load(to) + arm(j) * force);
      }
      continue;
    }
    const p::MuscleSlopes<Lane> d = p::slopes(m.activation, m.muscle, u, l, v);
    for (std::size_t j = 0; j < data.joints; ++j) {
      const Lane r = arm(j);
      double* to = torque + j * block + i;
      store(to, load(to) + r * d.force);
      const auto put = [&](std::size_t quantity, const Lane& slope) {
        if (m.column[quantity] < 0) return;
        double* at = columns + (j * k + static_cast<std::size_t>(m.column[quantity])) * block + i;
        store(at, load(at) + (r * m.chain[quantity]) * slope);
      };
      put(shape, d.shape);
      if (m.lag_1) put(time_constant_1, d.neural * load(n.by_lag_1 + i, here));
      if (m.lag_2) put(time_constant_2, d.neural * load(n.by_lag_2 + i, here));
      if (m.delayed) put(delay, d.neural * load(n.by_delay + i, here));
      put(4, d.optimal_fibre_length);
      put(5, d.tendon_slack_length);
      put(6, d.strength);
      put(7, d.optimal_length_shift);
      put(8, d.max_velocity);
      put(9, d.force_length_width);
      put(10, d.passive_scale);
    }
  }
}

/// In eight sums, whatever a register holds: the same bits with every instruction set.
double dot(const double* a, const double* b) {
  constexpr std::size_t parts = 8 / width;
  Lane total[parts];
  for (Lane& part : total) part = Lane(0);
  for (std::size_t i = 0; i < block; i += 8)
    for (std::size_t part = 0; part < parts; ++part)
      total[part] = total[part] + load(a + i + part * width) * load(b + i + part * width);
  const auto at = [&total](std::size_t i) { return total[i / width][i % width]; };
  return ((at(0) + at(4)) + (at(2) + at(6))) + ((at(1) + at(5)) + (at(3) + at(7)));
}

/// What one block of one joint, whose rows begin at `first`, adds to cost, gradient and normal matrix. Beyond its samples,
/// columns and residual are 0.
void accumulate(const HillFit& fit, std::size_t k, std::size_t first, std::size_t count, double* residual,
                double* columns, double& cost) {
  for (std::size_t i = 0; i < count; ++i) {
    const double w = fit.weight == nullptr ? 1.0 : fit.weight[first + i];
    residual[i] = w * (residual[i] - fit.measured[first + i]);
  }
  if (fit.weight != nullptr)
    for (std::size_t j = 0; j < k; ++j)
      for (std::size_t i = 0; i < count; ++i) columns[j * block + i] *= fit.weight[first + i];
  for (std::size_t i = count; i < block; ++i) residual[i] = 0;
  for (std::size_t j = 0; j < k; ++j)
    for (std::size_t i = count; i < block; ++i) columns[j * block + i] = 0;
  cost += 0.5 * dot(residual, residual);
  for (std::size_t j = 0; j < k; ++j) {
    if (fit.gradient != nullptr) fit.gradient[j] += dot(columns + j * block, residual);
    if (fit.normal != nullptr)
      for (std::size_t i = 0; i <= j; ++i) fit.normal[j * k + i] += dot(columns + j * block, columns + i * block);
  }
}

void fit(const HillData& data, const HillFree& free, HillFit& fit) {
  const std::size_t k = free.columns;
  Muscle muscles[most_muscles];
  for (std::size_t m = 0; m < data.muscles; ++m) muscles[m] = Muscle(data, free, m);
  double* columns = fit.work;
  double torque[most_joints * block];
  const std::size_t rows = data.joints;
  Neural n;
  if (fit.gradient != nullptr)
    for (std::size_t j = 0; j < k; ++j) fit.gradient[j] = 0;
  if (fit.normal != nullptr)
    for (std::size_t j = 0; j < k * k; ++j) fit.normal[j] = 0;
  fit.cost = 0;
  for (std::size_t r = 0; r < data.recordings; ++r) {
    const std::size_t start = data.starts[r], end = r + 1 < data.recordings ? data.starts[r + 1] : data.samples;
    for (std::size_t first = start; first < end; first += block) {
      const std::size_t count = end - first < block ? end - first : block;
      for (std::size_t i = 0; i < rows * block; ++i) torque[i] = 0;
      for (std::size_t i = 0; i < rows * k * block; ++i) columns[i] = 0;
      for (std::size_t m = 0; m < data.muscles; ++m) {
        neural(muscles[m], start, first, count, n);
        add(data, muscles[m], n, first, count, k, torque, columns);
      }
      for (std::size_t row = 0; row < rows; ++row) {
        double *own = torque + row * block, *slopes = columns + row * k * block;
        if (fit.torque != nullptr)
          for (std::size_t i = 0; i < count; ++i) fit.torque[row * data.samples + first + i] = own[i];
        if (fit.jacobian != nullptr)
          for (std::size_t j = 0; j < k; ++j)
            for (std::size_t i = 0; i < count; ++i)
              fit.jacobian[(j * rows + row) * data.samples + first + i] = slopes[j * block + i];
        if (fit.measured != nullptr) accumulate(fit, k, row * data.samples + first, count, own, slopes, fit.cost);
      }
    }
  }
  if (fit.normal != nullptr)
    for (std::size_t j = 0; j < k; ++j)
      for (std::size_t i = 0; i < j; ++i) fit.normal[i * k + j] = fit.normal[j * k + i];
}

void states(const HillData& data, const HillStates& out) {
  Neural n;
  for (std::size_t i = 0; i < data.muscles; ++i) {
    Muscle m(data, {}, i);
    for (std::size_t r = 0; r < data.recordings; ++r) {
      const std::size_t start = data.starts[r], end = r + 1 < data.recordings ? data.starts[r + 1] : data.samples;
      for (std::size_t first = start; first < end; first += block) {
        const std::size_t count = end - first < block ? end - first : block;
        neural(m, start, first, count, n);
        for (std::size_t k = 0; k < count; k += width) {
          const std::size_t here = count - k, at = first + k;
          const Lane a = p::shaped(m.activation, load(n.u + k, here));
          const p::Fibre<Lane> fibre = p::fibre(m.muscle, load(m.length + at, here), load(m.velocity + at, here));
          const Lane force = p::tendon_force(m.muscle, a, fibre);
          for (std::size_t lane = 0; lane < width && lane < here; ++lane) {
            const std::size_t to = i * data.samples + at + lane;
            out.activation[to] = a[lane];
            out.force[to] = force[lane];
            out.fibre_length[to] = fibre.length[lane];
            out.fibre_velocity[to] = fibre.velocity[lane];
          }
        }
      }
    }
  }
}

}  // namespace

namespace PELLUCID_ABI {
extern const HillKernels hill_kernels;
const HillKernels hill_kernels = {fit, states};
}  // namespace PELLUCID_ABI

}  // namespace bindings
