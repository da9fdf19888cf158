// Regression trees of least squares, grown on rows that are sorted once by every feature.
//
// The trees are scikit-learn's: the same draws, the same order of sums, so the same bits but where a feature has equal
// values. It sorts the rows of every node anew; here a node's rows are told apart in the order that is there.
#include "regression_trees.hpp"

#include "arrays.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

namespace bindings {
namespace {

constexpr const char* rows_doc = R"(Rows that trees are grown on, sorted by every feature.

Parameters
----------
x : (n, k)
    Features in single precision, finite.)";

constexpr const char* grown_doc = R"(One tree of least squares.

Parameters
----------
y : (n,)
    What it is to tell.
times : (n,)
    How often each row counts; 0 leaves it out.
seed : int
    Of the features drawn at each split, 0 to 2^32 - 1.
features : int
    Drawn at each split, 1 to k.
leaves : int
    At most, the best split first; 0: no limit.
per_leaf, per_split : int
    Rows at least in a leaf, and in what is split.

Returns
-------
(m, 4)
    A row per node, parents first: feature, left child, right child, threshold up to which a row goes left; of a
    leaf -1, -1, -1 and its answer.)";

constexpr const char* answers_doc = R"(What a tree answers.

Parameters
----------
nodes : (m, 4)
    As SortedRows.grown gave them.
x : (n, k)
    Features in single precision.

Returns
-------
(n,)
    In the unit of what it was grown for.)";

constexpr const char* drawn_doc = R"(Which rows are drawn without replacement, going through them once.

Parameters
----------
shares : (n,)
    Drawn evenly between 0 and 1.
inside : int
    Rows to be drawn, 0 to n.

Returns
-------
(n,)
    1 for a row that was drawn, 0 for another.)";

constexpr float apart = 1e-7f;       // Values no further apart are one
constexpr double epsilon = 2.220446049250313e-16;
constexpr double rounding = 1e-13;   // Share by which rounding may part two sums of positive terms
constexpr std::int32_t none = -1;

/// The draws of scikit-learn's splitter, of Marsaglia's xorshift.
class Draws {
 public:
  explicit Draws(std::uint32_t seed) : state_(seed) {}
  std::size_t between(std::size_t low, std::size_t high) {
    if (state_ == 0) state_ = 1;
    state_ ^= state_ << 13;
    state_ ^= state_ >> 17;
    state_ ^= state_ << 5;
    return low + (state_ & 0x7fffffffu) % (high - low);
  }

 private:
  std::uint32_t state_;
};

struct Node {
  std::int32_t feature = none, left = none, right = none;
  double number = 0.0;  // Answer, or threshold once it is split
};

struct Settings {
  std::size_t features, leaves, per_leaf, per_split;
};

struct Sorted {
  std::size_t n, k;
  std::vector<float> x;              // (k, n)
  std::vector<std::uint32_t> order;  // (k, n) Rows by each feature

  explicit Sorted(const BasicArray<float>& rows) : n(rows.shape[0]), k(rows.shape[1]), x(n * k), order(n * k) {
    for (std::size_t f = 0; f < k; ++f) {
      float* own = x.data() + f * n;
      std::uint32_t* by = order.data() + f * n;
      for (std::size_t i = 0; i < n; ++i) own[i] = rows.data[i * k + f];
      std::iota(by, by + n, 0u);
      std::stable_sort(by, by + n, [own](std::uint32_t a, std::uint32_t b) { return own[a] < own[b]; });
    }
  }
};

/// One tree while it grows.
class Growth {
 public:
  Growth(const Sorted& rows, const double* y, const double* times, const Settings& settings, std::uint32_t seed)
      : rows_(rows), settings_(settings), y_(y), draws_(seed), pairs_(rows.n), leftward_(rows.n),
        features_(rows.k), constants_(rows.k) {
    samples_.reserve(rows.n);
    for (std::size_t i = 0; i < rows.n; ++i) {
      pairs_[i] = {times[i] * y[i], times[i]};
      whole_ += times[i];
      if (times[i] != 0.0) samples_.push_back(static_cast<std::uint32_t>(i));
    }
    const std::size_t count = samples_.size();
    lists_.resize(rows.k * count + 1);  // what is written last may be no row that counts
    for (std::size_t f = 0; f < rows.k; ++f) {
      std::uint32_t* to = lists_.data() + f * count;
      for (std::size_t i = 0; i < rows.n; ++i) {
        const std::uint32_t row = rows.order[f * rows.n + i];
        *to = row;
        to += times[row] != 0.0;
      }
    }
    spare_.resize(count);
    for (std::vector<double>* each : {&sums_, &weights_, &gains_}) each->resize(count);
    at_.resize(count);
    std::iota(features_.begin(), features_.end(), std::size_t(0));
  }

  std::vector<Node> grown() {
    const Waiting root{0, samples_.size(), 0, false, 0.0, 0};
    if (settings_.leaves > 0)
      best_first(root);
    else
      depth_first(root);
    return std::move(nodes_);
  }

 private:
  /// Samples first to last, which are to be a node.
  struct Waiting {
    std::size_t first, last, parent;
    bool left;
    double impurity;
    std::size_t constant;  // Features that are known not to vary
  };

  /// A node, and where it is best split: before `at`, which is `last` where it is a leaf.
  struct Part {
    std::size_t node, first, last, at, constant;
    std::size_t feature = 0;
    double threshold = 0.0, impurity_left = 0.0, impurity_right = 0.0, improvement = 0.0;
  };

  void depth_first(const Waiting& root) {
    std::vector<Waiting> open{root};
    while (!open.empty()) {
      const Part part = placed(open.back());
      open.pop_back();
      if (part.at == part.last) continue;
      const auto [left, right] = split(part, part.constant);
      open.push_back(right);
      open.push_back(left);
    }
  }

  void best_first(const Waiting& root) {
    const auto worse = [](const Part& a, const Part& b) { return a.improvement < b.improvement; };
    std::vector<Part> open{placed(root)};
    for (std::size_t splits = settings_.leaves - 1; splits > 0 && !open.empty();) {
      std::pop_heap(open.begin(), open.end(), worse);
      const Part part = open.back();
      open.pop_back();
      if (part.at == part.last) continue;
      if (--splits == 0) is_last_ = true;  // nothing below is split
      const auto [left, right] = split(part, 0);
      const Part parts[] = {placed(left), placed(right)};
      for (const Part& each : parts) {
        open.push_back(each);
        std::push_heap(open.begin(), open.end(), worse);
      }
    }
  }

  /// The node of what waited, with its best split.
  Part placed(const Waiting& waiting) {
    Part part{nodes_.size(), waiting.first, waiting.last, waiting.last, waiting.constant};
    const std::size_t count = part.last - part.first;
    double sum = 0.0, squares = 0.0, weight = 0.0;
    for (std::size_t i = part.first; i < part.last; ++i) {
      const std::uint32_t row = samples_[i];
      sum += pairs_[row].wy;
      squares += pairs_[row].wy * y_[row];
      weight += pairs_[row].weight;
    }
    Node node;
    node.number = sum / weight;
    double impurity = waiting.impurity;
    if (nodes_.empty())
      impurity = squares / weight - node.number * node.number;
    else
      (waiting.left ? nodes_[waiting.parent].left : nodes_[waiting.parent].right) =
          static_cast<std::int32_t>(nodes_.size());
    nodes_.push_back(node);
    if (is_last_ || is_small(count) || impurity <= epsilon) return part;
    search(part, sum, weight);
    if (part.at == part.last) return part;
    gain(part, sum, squares, weight, impurity);
    if (part.improvement + epsilon < 0.0) {
      part.at = part.last;
      part.improvement = 0.0;
    }
    return part;
  }

  /// Whether a node has too few samples to be split.
  bool is_small(std::size_t count) const { return count < settings_.per_split || count < 2 * settings_.per_leaf; }

  /// The best split over features drawn; those found not to vary are not drawn again below.
  void search(Part& part, double sum, double weight) {
    const std::size_t known = part.constant, k = rows_.k;
    std::size_t left = k, visited = 0, found = 0, drawn = 0;
    const std::uint32_t* last = nullptr;
    double best = -std::numeric_limits<double>::infinity();
    while (left > known + found && (visited < settings_.features || visited <= found + drawn)) {
      ++visited;
      std::size_t j = draws_.between(drawn, left - found);
      if (j < known) {
        std::swap(features_[drawn++], features_[j]);
        continue;
      }
      j += found;
      const std::size_t feature = features_[j];
      const float* x = rows_.x.data() + feature * rows_.n;
      last = list(feature) + part.first;
      if (x[last[part.last - part.first - 1]] <= x[last[0]] + apart) {
        std::swap(features_[j], features_[known + found++]);
        continue;
      }
      std::swap(features_[--left], features_[j]);
      along(part, x, last, sum, weight, feature, best);
    }
    // Samples stand as they were sorted last: sums over them are in that order.
    if (last != nullptr) std::copy(last, last + (part.last - part.first), samples_.begin() + offset(part.first));
    std::copy_n(constants_.begin(), known, features_.begin());
    std::copy_n(features_.begin() + offset(known), found, constants_.begin() + offset(known));
    part.constant = known + found;
  }

  /// Whether one feature splits a node better than `best` does.
  void along(Part& part, const float* x, const std::uint32_t* rows, double sum, double weight, std::size_t feature,
             double& best) {
    const std::size_t count = part.last - part.first, least = settings_.per_leaf;
    std::size_t before = 0, places = 0;
    double sums = 0.0, weights = 0.0;
    for (std::size_t i = 1; i < count; ++i) {
      if (i < least || count - i < least || x[rows[i]] <= x[rows[i - 1]] + apart) continue;
      if (i - before <= count - i) {
        for (; before < i; ++before) {
          sums += pairs_[rows[before]].wy;
          weights += pairs_[rows[before]].weight;
        }
      } else {  // from the nearer end
        sums = sum;
        weights = weight;
        for (before = count; before > i;) {
          --before;
          sums -= pairs_[rows[before]].wy;
          weights -= pairs_[rows[before]].weight;
        }
      }
      sums_[places] = sums;
      weights_[places] = weights;
      at_[places++] = i;
    }
    // One division in place of two finds the few places that may be the best; these are then compared exactly.
    double near = 0.0;
    for (std::size_t i = 0; i < places; ++i) {
      const double other = sum - sums_[i], rest = weight - weights_[i];
      gains_[i] = (sums_[i] * sums_[i] * rest + other * other * weights_[i]) / (weights_[i] * rest);
    }
    for (std::size_t i = 0; i < places; ++i) near = gains_[i] > near ? gains_[i] : near;
    near *= 1.0 - rounding;
    if (!(near * (1.0 + 3.0 * rounding) > best)) return;
    double most = best;
    std::size_t place = places;  // the first of equals
    for (std::size_t i = 0; i < places; ++i) {
      if (gains_[i] < near) continue;
      const double other = sum - sums_[i];
      const double gain = sums_[i] * sums_[i] / weights_[i] + other * other / (weight - weights_[i]);
      if (gain > most) {
        most = gain;
        place = i;
      }
    }
    if (place == places) return;
    best = most;
    const std::size_t at = at_[place];
    part.at = part.first + at;
    part.feature = feature;
    part.threshold = static_cast<double>(x[rows[at - 1]]) / 2.0 + static_cast<double>(x[rows[at]]) / 2.0;
  }

  /// What a split gains, its samples brought to either side.
  void gain(Part& part, double sum, double squares, double weight, double impurity) {
    const float* x = rows_.x.data() + part.feature * rows_.n;
    for (std::size_t i = part.first, end = part.last; i < end;) {
      if (static_cast<double>(x[samples_[i]]) <= part.threshold)
        ++i;
      else
        std::swap(samples_[i], samples_[--end]);
    }
    double left = 0.0, left_weight = 0.0, left_squares = 0.0;
    if (part.at - part.first <= part.last - part.at) {
      for (std::size_t i = part.first; i < part.at; ++i) {
        left += pairs_[samples_[i]].wy;
        left_weight += pairs_[samples_[i]].weight;
      }
    } else {
      left = sum;
      left_weight = weight;
      for (std::size_t i = part.last; i > part.at; --i) {
        left -= pairs_[samples_[i - 1]].wy;
        left_weight -= pairs_[samples_[i - 1]].weight;
      }
    }
    for (std::size_t i = part.first; i < part.at; ++i) left_squares += pairs_[samples_[i]].wy * y_[samples_[i]];
    const double right = sum - left, right_weight = weight - left_weight;
    const double left_mean = left / left_weight, right_mean = right / right_weight;
    part.impurity_left = left_squares / left_weight - left_mean * left_mean;
    part.impurity_right = (squares - left_squares) / right_weight - right_mean * right_mean;
    part.improvement = weight / whole_ * (impurity - right_weight / weight * part.impurity_right -
                                          left_weight / weight * part.impurity_left);
  }

  /// Both sides of a node that is split now, every feature's order kept.
  std::pair<Waiting, Waiting> split(const Part& part, std::size_t constant) {
    Node& node = nodes_[part.node];
    node.feature = static_cast<std::int32_t>(part.feature);
    node.number = part.threshold;
    const bool is_searched = !is_last_ && !(is_small(part.at - part.first) && is_small(part.last - part.at));
    for (std::size_t i = part.first; i < part.last; ++i) leftward_[samples_[i]] = i < part.at;
    for (std::size_t f = 0; is_searched && f < rows_.k; ++f) {
      std::uint32_t *from = list(f) + part.first, *const end = list(f) + part.last, *to = from, *aside = spare_.data();
      for (; from < end; ++from) {
        const std::uint32_t row = *from, is_left = leftward_[row];
        *to = *aside = row;
        to += is_left;
        aside += 1 - is_left;
      }
      std::copy(spare_.data(), aside, to);
    }
    return {{part.first, part.at, part.node, true, part.impurity_left, constant},
            {part.at, part.last, part.node, false, part.impurity_right, constant}};
  }

  std::uint32_t* list(std::size_t feature) { return lists_.data() + feature * samples_.size(); }
  static std::ptrdiff_t offset(std::size_t i) { return static_cast<std::ptrdiff_t>(i); }

  const Sorted& rows_;
  const Settings& settings_;
  const double* y_;
  Draws draws_;
  double whole_ = 0.0;
  bool is_last_ = false;
  struct Pair {
    double wy, weight;
  };
  std::vector<Pair> pairs_;  // Side by side, as searches read them
  std::vector<std::uint8_t> leftward_;
  std::vector<std::size_t> features_, constants_, at_;
  std::vector<std::uint32_t> samples_, lists_, spare_;
  std::vector<double> sums_, weights_, gains_;  // Of the places where a feature may split
  std::vector<Node> nodes_;
};

class SortedRows {
 public:
  explicit SortedRows(nb::handle x) : rows_(checked(x)) {}

  nb::object grown(nb::handle y_, nb::handle times_, nb::handle seed_, nb::handle features, nb::handle leaves,
                   nb::handle per_leaf, nb::handle per_split) const {
    const Array y = read_array("y", y_), times = read_array("times", times_);
    y.expect(same_length("x", rows_.n), {rows_.n});
    times.expect(same_length("x", rows_.n), {rows_.n});
    const auto seed = static_cast<std::uint32_t>(read_integer("seed", seed_, 0, 0xffffffff));
    const auto many = [](const char* name, nb::handle value, long long least, long long most) {
      return static_cast<std::size_t>(read_integer(name, value, least, most));
    };
    constexpr long long most = std::numeric_limits<std::int32_t>::max();
    const Settings settings{many("features", features, 1, static_cast<long long>(rows_.k)),
                            many("leaves", leaves, 0, most), many("per_leaf", per_leaf, 1, most),
                            many("per_split", per_split, 2, most)};
    if (std::all_of(times.data, times.data + rows_.n, [](double w) { return w == 0.0; }))
      throw nb::value_error("times: found 0 for every row, expected a row that counts");
    std::vector<Node> nodes;
    {
      nb::gil_scoped_release release;
      nodes = Growth(rows_, y.data, times.data, settings, seed).grown();
    }
    Result result({nodes.size(), 4});
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Node& node = nodes[i];
      const double row[] = {static_cast<double>(node.feature), static_cast<double>(node.left),
                            static_cast<double>(node.right), node.number};
      std::copy(row, row + 4, result.data + 4 * i);
    }
    return result.array();
  }

 private:
  static Sorted checked(nb::handle x) {
    const BasicArray<float> rows = read_array_of<float>("x", x);
    if (rows.shape.size() != 2 || rows.size() == 0 || rows.shape[0] > std::numeric_limits<std::int32_t>::max())
      rows.fail("(n, k), both above 0");
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (!std::isfinite(rows.data[i])) throw nb::value_error("x: expected finite numbers");
    return Sorted(rows);
  }
  Sorted rows_;
};

nb::object tree_answers(nb::handle nodes_, nb::handle x_) {
  const Array rows = read_array("nodes", nodes_);
  const BasicArray<float> x = read_array_of<float>("x", x_);
  if (rows.shape.size() != 2 || rows.shape[1] != 4 || rows.shape[0] == 0) rows.fail("(m, 4), m above 0");
  if (x.shape.size() != 2) x.fail("(n, k)");
  const std::size_t n = x.shape[0], k = x.shape[1];
  std::vector<Node> nodes(rows.shape[0]);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const double* row = rows.data + 4 * i;
    const auto whole = [row](std::size_t column, double least, std::size_t end) {
      if (!(row[column] >= least && row[column] < static_cast<double>(end)))
        throw nb::value_error("nodes: expected features of x, and children further on");
      return static_cast<std::int32_t>(row[column]);
    };
    nodes[i].number = row[3];
    if (row[0] < 0.0) continue;
    nodes[i].feature = whole(0, 0.0, k);
    // Children come after their parents, so whoever goes down arrives.
    nodes[i].left = whole(1, static_cast<double>(i + 1), nodes.size());
    nodes[i].right = whole(2, static_cast<double>(i + 1), nodes.size());
  }
  Result answers({n});
  {
    nb::gil_scoped_release release;
    for (std::size_t row = 0; row < n; ++row) {
      const float* values = x.data + row * k;
      const Node* node = nodes.data();
      while (node->feature >= 0)
        node = nodes.data() + (static_cast<double>(values[node->feature]) <= node->number ? node->left : node->right);
      answers.data[row] = node->number;
    }
  }
  return answers.array();
}

nb::object drawn_rows(nb::handle shares_, nb::handle inside_) {
  const Array shares = read_array("shares", shares_);
  if (shares.shape.size() != 1) shares.fail("(n,)");
  const std::size_t n = shares.size();
  const auto inside = static_cast<std::size_t>(read_integer("inside", inside_, 0, static_cast<long long>(n)));
  Result drawn({n});
  for (std::size_t i = 0, kept = 0; i < n; ++i) {
    const bool is_drawn = shares.data[i] * static_cast<double>(n - i) < static_cast<double>(inside - kept);
    drawn.data[i] = is_drawn ? 1.0 : 0.0;
    kept += is_drawn;
  }
  return drawn.array();
}

}  // namespace

void add_regression_trees(nb::module_& m) {
  nb::class_<SortedRows>(m, "SortedRows", rows_doc)
      .def(nb::init<nb::handle>(), nb::arg("x").none(), nb::sig("def __init__(self, x: ArrayLike) -> None"))
      .def("grown", &SortedRows::grown, nb::arg("y").none(), nb::arg("times").none(), nb::arg("seed").none(),
           nb::arg("features").none(), nb::arg("leaves").none(), nb::arg("per_leaf").none(),
           nb::arg("per_split").none(),
           nb::sig("def grown(self, y: ArrayLike, times: ArrayLike, seed: int, features: int, leaves: int, "
                   "per_leaf: int, per_split: int) -> NDArray[float64]"),
           grown_doc);
  m.def("tree_answers", tree_answers, nb::arg("nodes").none(), nb::arg("x").none(),
        nb::sig("def tree_answers(nodes: ArrayLike, x: ArrayLike) -> NDArray[float64]"), answers_doc);
  m.def("drawn_rows", drawn_rows, nb::arg("shares").none(), nb::arg("inside").none(),
        nb::sig("def drawn_rows(shares: ArrayLike, inside: int) -> NDArray[float64]"), drawn_doc);
}

}  // namespace bindings
