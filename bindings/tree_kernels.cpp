// Eight samples of a tree at once, whatever the registers hold: the bits are the same for every instruction set.
#include "tree_kernels.hpp"

#include <pellucid/lanes.hpp>
#include <pellucid/mass_matrix.hpp>
#include <pellucid/torque_regressor.hpp>

#include <new>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr std::size_t width = 8;
using Block = p::Lanes<double, width>;
template <class S> using Tree = p::TreeCoefficients<S, most_links>;

template <class S> Tree<S> tree_of(const TreeNumbers& numbers) {
  p::TreeParams<S, most_links> params;
  params.links = static_cast<std::uint32_t>(numbers.links);
  params.gravity_x = S(numbers.gravity[0]);
  params.gravity_y = S(numbers.gravity[1]);
  params.gravity_z = S(numbers.gravity[2]);
  // Numbers that are counts are read as such; the others in every lane.
  for (std::size_t i = 0; i < numbers.links; ++i) {
    const double* at = numbers.link + i * p::link_parameter_count;
    p::LinkParams<double> link = p::from_numbers<p::LinkParams<double>>(at);
    p::LinkParams<S>& wide = params.link[i];
    S values[p::link_parameter_count];
    for (std::size_t k = 0; k < p::link_parameter_count; ++k) values[k] = S(at[k]);
    auto next = [&, k = std::size_t(0)](auto& number, const p::Field&) mutable {
      if constexpr (std::is_same<std::remove_reference_t<decltype(number)>, S>::value) number = values[k];
      ++k;
    };
    p::LinkParams<S>::walk(wide, next);
    wide.parent = link.parent;
    wide.joint = link.joint;
  }
  return p::coefficients(params);
}

/// For a sample alone, which is not worth the lanes, and for eight.
struct Prepared {
  Tree<Block> lanes;
  Tree<double> one;
};
void prepare(const TreeNumbers& numbers) {
  new (numbers.prepared) Prepared{tree_of<Block>(numbers), tree_of<double>(numbers)};
}
const Prepared& prepared(const TreeNumbers& numbers) { return *static_cast<const Prepared*>(numbers.prepared); }

/// Samples first... of an array, as lanes: the last again where there are no more.
template <class S> void load(const double* data, std::size_t n, std::size_t coordinates, std::size_t first, S* out) {
  if constexpr (std::is_same<S, double>::value) {
    for (std::size_t k = 0; k < coordinates; ++k) out[k] = data[first * coordinates + k];
  } else {
    const std::size_t count = n - first < width ? n - first : width;
    for (std::size_t k = 0; k < coordinates; ++k)
      for (std::size_t l = 0; l < width; ++l)
        out[k].set(l, data[(first + (l < count ? l : count - 1)) * coordinates + k]);
  }
}
template <class S> void store(const S* x, std::size_t numbers, std::size_t n, std::size_t first, double* out) {
  if constexpr (std::is_same<S, double>::value) {
    for (std::size_t k = 0; k < numbers; ++k) out[first * numbers + k] = x[k];
  } else {
    for (std::size_t l = 0; l < width && first + l < n; ++l)
      for (std::size_t k = 0; k < numbers; ++k) out[(first + l) * numbers + k] = x[k][l];
  }
}

/// f(tree, first) for every block of samples.
template <class F> void for_blocks(const TreeNumbers& numbers, std::size_t n, F f) {
  if (n == 1) return f(prepared(numbers).one, std::size_t(0));
  for (std::size_t first = 0; first < n; first += width) f(prepared(numbers).lanes, first);
}
template <class S, std::size_t N> S scalar_of(const p::TreeCoefficients<S, N>&);
template <class T> using Scalar = decltype(scalar_of(std::declval<T>()));

void inverse_dynamics(const TreeNumbers& numbers, const TreeSamples& s, double* effort) {
  const std::size_t m = numbers.coordinates;
  for_blocks(numbers, s.n, [&](const auto& tree, std::size_t first) {
    using S = Scalar<decltype(tree)>;
    S q[most_links]{}, v[most_links]{}, a[most_links]{}, result[most_links];
    load(s.position, s.n, m, first, q);
    load(s.velocity, s.n, m, first, v);
    load(s.acceleration, s.n, m, first, a);
    p::inverse_dynamics(tree, q, v, a, result);
    store(result, m, s.n, first, effort);
  });
}

void gravity(const TreeNumbers& numbers, const TreeSamples& s, double* effort) {
  const std::size_t m = numbers.coordinates;
  for_blocks(numbers, s.n, [&](const auto& tree, std::size_t first) {
    using S = Scalar<decltype(tree)>;
    S q[most_links]{}, result[most_links];
    load(s.position, s.n, m, first, q);
    p::gravity(tree, q, result);
    store(result, m, s.n, first, effort);
  });
}

void mass_matrix(const TreeNumbers& numbers, const TreeSamples& s, double* matrix) {
  const std::size_t m = numbers.coordinates;
  for_blocks(numbers, s.n, [&](const auto& tree, std::size_t first) {
    using S = Scalar<decltype(tree)>;
    S q[most_links]{}, result[most_links * most_links];
    p::SquareMatrix<S, most_links> square;
    load(s.position, s.n, m, first, q);
    p::mass_matrix(tree, q, square);
    for (std::size_t k = 0; k < m; ++k)
      for (std::size_t l = 0; l < m; ++l) result[k * m + l] = square.at[k][l];
    store(result, m * m, s.n, first, matrix);
  });
}

void forward_dynamics(const TreeNumbers& numbers, const TreeSamples& s, const bool* held, double* acceleration) {
  const std::size_t m = numbers.coordinates;
  for_blocks(numbers, s.n, [&](const auto& tree, std::size_t first) {
    using S = Scalar<decltype(tree)>;
    S q[most_links]{}, v[most_links]{}, effort[most_links]{}, result[most_links];
    p::mask_t<S> rests[most_links];
    for (std::size_t k = 0; k < m; ++k) rests[k] = S(held != nullptr && held[k] ? 1.0 : 0.0) > S(0);
    load(s.position, s.n, m, first, q);
    load(s.velocity, s.n, m, first, v);
    load(s.acceleration, s.n, m, first, effort);
    p::forward_dynamics(tree, q, v, effort, rests, result);
    store(result, m, s.n, first, acceleration);
  });
}

void energy(const TreeNumbers& numbers, const TreeSamples& s, double* kinetic, double* potential) {
  const std::size_t m = numbers.coordinates;
  for_blocks(numbers, s.n, [&](const auto& tree, std::size_t first) {
    using S = Scalar<decltype(tree)>;
    S q[most_links]{}, v[most_links]{};
    load(s.position, s.n, m, first, q);
    load(s.velocity, s.n, m, first, v);
    const auto sum = p::energy(tree, q, v);
    store(&sum.kinetic, 1, s.n, first, kinetic);
    store(&sum.potential, 1, s.n, first, potential);
  });
}

void placements(const TreeNumbers& numbers, const TreeSamples& s, double* out) {
  for_blocks(numbers, s.n, [&](const auto& tree, std::size_t first) {
    using S = Scalar<decltype(tree)>;
    S q[most_links]{}, result[12 * most_links];
    p::Placement<S> in_base[most_links];
    load(s.position, s.n, numbers.coordinates, first, q);
    p::forward_kinematics(tree, q, in_base);
    for (std::size_t i = 0; i < numbers.links; ++i) {
      const p::Matrix3<S>& r = in_base[i].rotation;
      const p::Vector3<S>& x = in_base[i].position;
      const S rows[12] = {r.xx, r.xy, r.xz, x.x, r.yx, r.yy, r.yz, x.y, r.zx, r.zy, r.zz, x.z};
      for (std::size_t k = 0; k < 12; ++k) result[12 * i + k] = rows[k];
    }
    store(result, 12 * numbers.links, s.n, first, out);
  });
}

void jacobian(const TreeNumbers& numbers, const TreeSamples& s, std::size_t link, const double* point, double* out) {
  const std::size_t m = numbers.coordinates;
  for_blocks(numbers, s.n, [&](const auto& tree, std::size_t first) {
    using S = Scalar<decltype(tree)>;
    S q[most_links]{}, result[6 * most_links];
    p::JacobianColumn<S> columns[most_links];
    load(s.position, s.n, m, first, q);
    p::jacobian(tree, q, link, {S(point[0]), S(point[1]), S(point[2])}, columns);
    for (std::size_t k = 0; k < m; ++k) {
      const S six[6] = {columns[k].linear.x,  columns[k].linear.y,  columns[k].linear.z,
                        columns[k].angular.x, columns[k].angular.y, columns[k].angular.z};
      for (std::size_t i = 0; i < 6; ++i) result[i * m + k] = six[i];
    }
    store(result, 6 * m, s.n, first, out);
  });
}

/// Rows of eight samples, each written whole.
void regressor(const TreeNumbers& numbers, const TreeSamples& s, const MoreColumns& more, double* rows) {
  const std::size_t m = numbers.coordinates;
  const std::size_t rigid = 10 * numbers.links, columns = rigid + m * more.own + more.shared;
  const Tree<Block>& tree = prepared(numbers).lanes;
  for (std::size_t first = 0; first < s.n; first += width) {
    const std::size_t count = s.n - first < width ? s.n - first : width;
    Block q[most_links], v[most_links], a[most_links];
    load(s.position, s.n, m, first, q);
    load(s.velocity, s.n, m, first, v);
    load(s.acceleration, s.n, m, first, a);
    double* block = rows + first * m * columns;
    std::size_t written[most_links] = {};  // columns of each joint's row that are filled
    const auto zeros = [&](std::size_t k, std::size_t upto) {
      if (written[k] == upto) return;
      for (std::size_t l = 0; l < count; ++l)
        for (std::size_t i = written[k]; i < upto; ++i) block[(l * m + k) * columns + i] = 0.0;
      written[k] = upto;
    };
    p::torque_regressor(tree, q, v, a, [&](std::size_t k, std::size_t link, const Block* column) {
      zeros(k, 10 * link);
      double* to = block + k * columns + 10 * link;
      for (std::size_t l = 0; l < count; ++l)
        for (std::size_t i = 0; i < 10; ++i) to[l * m * columns + i] = column[i][l];
      written[k] = 10 * link + 10;
    });
    for (std::size_t k = 0; k < m; ++k) {
      zeros(k, columns);
      for (std::size_t l = 0; l < count; ++l) {
        double* row = block + (l * m + k) * columns;
        const std::size_t at = (first + l) * m + k;
        for (std::size_t i = 0; i < more.own; ++i) row[rigid + k * more.own + i] = more.own_data[at * more.own + i];
        for (std::size_t i = 0; i < more.shared; ++i)
          row[rigid + m * more.own + i] = more.shared_data[at * more.shared + i];
      }
    }
  }
}

/// g += sum over rows of weighted' row, its upper triangle in tiles of 4 by 16. Each number is summed row after row.
void add_gram(const double* rows, const double* weighted, std::size_t n, std::size_t columns, double* g) {
  for (std::size_t i = 0; i < columns; i += 4)
    for (std::size_t j = i / 16 * 16; j < columns; j += 16) {
      Block sum[4][2];
      for (auto& pair : sum)
        for (Block& x : pair) x = Block(0);
      for (std::size_t r = 0; r < n; ++r) {
        Block right[2];
        __builtin_memcpy(right, rows + r * columns + j, sizeof right);
        for (std::size_t k = 0; k < 4; ++k) {
          const double left = weighted[r * columns + i + k];
          sum[k][0] = sum[k][0] + right[0] * left;
          sum[k][1] = sum[k][1] + right[1] * left;
        }
      }
      for (std::size_t k = 0; k < 4; ++k) {
        Block old[2];
        __builtin_memcpy(old, g + (i + k) * columns + j, sizeof old);
        old[0] = old[0] + sum[k][0];
        old[1] = old[1] + sum[k][1];
        __builtin_memcpy(g + (i + k) * columns + j, old, sizeof old);
      }
    }
}

void gram(const TreeNumbers& numbers, const TreeSamples& s, const MoreColumns& more, const TreeGram& out) {
  const std::size_t m = numbers.coordinates;
  const std::size_t rigid = 10 * numbers.links, columns = rigid + m * more.own + more.shared + 1;
  const Tree<Block>& tree = prepared(numbers).lanes;
  // Each joint has only the columns of links that it carries, from `low` to `high`, and its own: that is its width.
  std::size_t low[most_links], high[most_links], wide[most_links];
  for (std::size_t k = 0; k < m; ++k) low[k] = numbers.links, high[k] = 0;
  for (std::size_t i = 0; i < numbers.links; ++i)
    for (std::size_t j = i;; j = tree.link[j].parent) {
      const auto& joint = tree.link[j];
      if (joint.joint != p::JointKind::fixed) {
        if (i < low[joint.coordinate]) low[joint.coordinate] = i;
        high[joint.coordinate] = i + 1;
      }
      if (joint.on_base) break;
    }
  const std::size_t most = gram_width(rigid + more.own + more.shared + 1);
  for (std::size_t k = 0; k < m; ++k) wide[k] = gram_width(10 * (high[k] - low[k]) + more.own + more.shared + 1);
  double* const rows = out.work;                      // of each joint: gram_block rows
  double* const sums = rows + m * most * gram_block;  // of each joint
  double* const weighted = sums + m * most * most;    // of one joint: gram_block rows
  for (std::size_t i = 0; i < m * most * most; ++i) sums[i] = 0.0;
  for (std::size_t begin = 0; begin < s.n; begin += gram_block) {
    const std::size_t end = s.n - begin < gram_block ? s.n : begin + gram_block;
    for (std::size_t i = 0; i < m * most * gram_block; ++i) rows[i] = 0.0;
    for (std::size_t first = begin; first < end; first += width) {
      const std::size_t count = end - first < width ? end - first : width;
      Block q[most_links], v[most_links], a[most_links];
      load(s.position, s.n, m, first, q);
      load(s.velocity, s.n, m, first, v);
      load(s.acceleration, s.n, m, first, a);
      p::torque_regressor(tree, q, v, a, [&](std::size_t k, std::size_t link, const Block* column) {
        double* to = rows + k * gram_block * most + (first - begin) * wide[k] + 10 * (link - low[k]);
        for (std::size_t l = 0; l < count; ++l)
          for (std::size_t i = 0; i < 10; ++i) to[l * wide[k] + i] = column[i][l];
      });
    }
    for (std::size_t k = 0; k < m; ++k) {
      double* const mine = rows + k * gram_block * most;
      const std::size_t after = 10 * (high[k] - low[k]);
      for (std::size_t r = 0; r < end - begin; ++r) {
        double* row = mine + r * wide[k];
        const std::size_t at = (begin + r) * m + k;
        const double weight = out.weight == nullptr ? 1.0 : out.weight[at];
        if (weight == 0.0) {
          for (std::size_t i = 0; i < wide[k]; ++i) row[i] = weighted[r * wide[k] + i] = 0.0;
          continue;
        }
        for (std::size_t i = 0; i < more.own; ++i) row[after + i] = more.own_data[at * more.own + i];
        for (std::size_t i = 0; i < more.shared; ++i)
          row[after + more.own + i] = more.shared_data[at * more.shared + i];
        row[after + more.own + more.shared] = out.effort[at];
        for (std::size_t i = 0; i < wide[k]; ++i) weighted[r * wide[k] + i] = weight * row[i];
      }
      add_gram(mine, weighted, end - begin, wide[k], sums + k * most * most);
    }
  }
  for (std::size_t i = 0; i < columns * columns; ++i) out.gram[i] = 0.0;
  for (std::size_t k = 0; k < m; ++k) {
    const std::size_t after = 10 * (high[k] - low[k]);
    const auto column = [&](std::size_t i) {
      if (i < after) return 10 * low[k] + i;
      i -= after;
      if (i < more.own) return rigid + k * more.own + i;
      return rigid + m * more.own + (i - more.own);
    };
    const std::size_t used = after + more.own + more.shared + 1;
    for (std::size_t i = 0; i < used; ++i)
      for (std::size_t j = i; j < used; ++j) {
        double& upper = out.gram[column(i) * columns + column(j)];
        upper = upper + sums[k * most * most + i * wide[k] + j];
      }
  }
  for (std::size_t i = 0; i < columns; ++i)
    for (std::size_t j = 0; j < i; ++j) out.gram[i * columns + j] = out.gram[j * columns + i];
}

}  // namespace

namespace PELLUCID_ABI {
extern const TreeKernels tree_kernels;
const TreeKernels tree_kernels = {
    sizeof(Prepared), prepare,    inverse_dynamics, gravity,   mass_matrix, forward_dynamics,
    energy,           placements, jacobian,         regressor, gram};
}  // namespace PELLUCID_ABI

}  // namespace bindings
