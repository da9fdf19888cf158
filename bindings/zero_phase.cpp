// A cascade of second-order sections over whole recordings, forwards and backwards, several signals side by side.
#include "zero_phase.hpp"

#include "arrays.hpp"

#include <pellucid/biquad.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

namespace bindings {
namespace {

namespace p = pellucid;

constexpr const char* zero_phase_doc =
    R"(A cascade of second-order sections run forwards and backwards over each column: no delay.

Each pass starts settled on its first sample. The signals are continued at both borders by their point reflection.

Parameters
----------
sos : (k, 6)
    Rows b0, b1, b2, a0 = 1, a1, a2.
settled : (k, 2)
    The state of each section in which a constant input of 1 leaves it.
samples : (n, m)
    Signals, any unit.
padding : int
    Samples that are added at each border, below n.

Returns
-------
(n, m)
    In the signals' units.)";

// The same bits with wider registers, where the compiler can choose between them when the module is loaded.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__gnu_linux__)
#define PELLUCID_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define PELLUCID_WIDEST
#endif

/// Sections `k`, so many as `sections`, over `columns` signals that stand side by side, `from` row by row in steps of
/// `stride`, in place. While one section waits for its own last result, the others and the other columns go on.
template <int columns, int sections>
PELLUCID_WIDEST void run(const p::BiquadSection<double>* k, const double* settled, const double* level, double* from, std::size_t rows,
         std::ptrdiff_t stride) {
  double s1[sections][columns], s2[sections][columns];
  for (int i = 0; i < sections; ++i)
    for (int c = 0; c < columns; ++c) {
      s1[i][c] = settled[2 * i] * level[c];
      s2[i][c] = settled[2 * i + 1] * level[c];
    }
  for (; rows > 0; --rows, from += stride) {
    double x[columns];
    for (int c = 0; c < columns; ++c) x[c] = from[c];
    for (int i = 0; i < sections; ++i)
      for (int c = 0; c < columns; ++c) x[c] = p::pass(k[i], s1[i][c], s2[i][c], x[c]);
    for (int c = 0; c < columns; ++c) from[c] = x[c];
  }
}

/// One pass of the whole cascade over all columns, in the direction that `stride` has.
void cascade(const std::vector<p::BiquadSection<double>>& sections, const double* settled, double* from,
             std::size_t rows, std::size_t columns, std::ptrdiff_t stride) {
  const std::vector<double> level(from, from + columns);
  const auto some = [&](auto width, auto many, std::size_t i, std::size_t c) {
    run<width, many>(sections.data() + i, settled + 2 * i, level.data() + c, from + c, rows, stride);
  };
  const auto all = [&](auto width, std::size_t c) {
    std::size_t i = 0;
    if constexpr (decltype(width)::value < 8)  // eight signals' states of four sections are too many for registers
      for (; i + 4 <= sections.size(); i += 4) some(width, std::integral_constant<int, 4>(), i, c);
    for (; i + 2 <= sections.size(); i += 2) some(width, std::integral_constant<int, 2>(), i, c);
    if (i < sections.size()) some(width, std::integral_constant<int, 1>(), i, c);
  };
  std::size_t c = 0;
  for (; c + 8 <= columns; c += 8) all(std::integral_constant<int, 8>(), c);
  for (; c + 4 <= columns; c += 4) all(std::integral_constant<int, 4>(), c);
  for (; c + 2 <= columns; c += 2) all(std::integral_constant<int, 2>(), c);
  for (; c < columns; ++c) all(std::integral_constant<int, 1>(), c);
}

/// Columns that are run for so many signals: three or seven take as long alone as four or eight side by side, or longer.
std::size_t columns_to_run(std::size_t signals) {
  const std::size_t last = signals % 8;
  return signals + (last > 4 ? 8 - last : last == 3 ? 1 : 0);
}

/// Copies the columns that both have; columns that only `to` has become 0.
void copy_columns(const double* from, std::size_t has, double* to, std::size_t takes, std::size_t rows) {
  if (has == takes) {
    std::copy(from, from + rows * has, to);
    return;
  }
  const std::size_t both = std::min(has, takes);
  for (; rows > 0; --rows, from += has, to += takes) {
    std::size_t c = 0;
    for (; c + 2 <= both; c += 2) to[c] = from[c], to[c + 1] = from[c + 1];
    if (c < both) to[c] = from[c], ++c;
    for (; c < takes; ++c) to[c] = 0.0;
  }
}

nb::object zero_phase(nb::handle sos_, nb::handle settled_, nb::handle samples_, std::size_t padding) {
  const Array sos = read_array("sos", sos_), settled = read_array("settled", settled_);
  const Array samples = read_array("samples", samples_);
  if (sos.shape.size() != 2 || sos.shape[1] != 6) sos.fail("(k, 6)");
  settled.expect(text({sos.shape[0], 2}), {sos.shape[0], 2});
  if (samples.shape.size() != 2 || samples.shape[0] <= padding)
    samples.fail("(n, m) with n above " + std::to_string(padding));
  const std::size_t rows = samples.shape[0], signals = samples.shape[1], all = rows + 2 * padding;
  const std::size_t columns = columns_to_run(signals);
  Result filtered({rows, signals});
  {
    nb::gil_scoped_release release;
    std::vector<p::BiquadSection<double>> sections;
    for (std::size_t i = 0; i < sos.shape[0]; ++i) {
      const double* row = sos.data + 6 * i;
      sections.push_back({row[0], row[1], row[2], row[4], row[5]});
    }
    const std::unique_ptr<double[]> memory(new double[all * columns]);  // not zeros, which would cost as a pass does
    double *work = memory.get(), *inner = work + padding * columns;
    copy_columns(samples.data, signals, inner, columns, rows);
    const double *first = inner, *last = inner + (rows - 1) * columns;
    for (std::size_t i = 0; i < padding; ++i)
      for (std::size_t c = 0; c < columns; ++c) {
        work[i * columns + c] = 2.0 * first[c] - first[(padding - i) * columns + c];
        work[(padding + rows + i) * columns + c] = 2.0 * last[c] - last[c - (i + 1) * columns];
      }
    const auto stride = static_cast<std::ptrdiff_t>(columns);
    if (columns > 0) {
      cascade(sections, settled.data, work, all, columns, stride);
      cascade(sections, settled.data, work + (all - 1) * columns, all, columns, -stride);
    }
    copy_columns(inner, columns, filtered.data, signals, rows);
  }
  return filtered.array();
}

}  // namespace

void add_zero_phase(nb::module_& m) {
  m.def("zero_phase", zero_phase, nb::arg("sos").none(), nb::arg("settled").none(), nb::arg("samples").none(),
        nb::arg("padding"),
        nb::sig("def zero_phase(sos: ArrayLike, settled: ArrayLike, samples: ArrayLike, padding: int) -> "
                "NDArray[float64]"),
        zero_phase_doc);
}

}  // namespace bindings
