// A cascade of second-order sections over whole recordings, forwards and backwards, several signals side by side.
#include "zero_phase.hpp"

#include "arrays.hpp"

#include <pellucid/biquad.hpp>

#include <algorithm>
#include <cstddef>
#include <string>
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

/// One section over `columns` signals that stand side by side, `from` row by row in steps of `stride`, in place.
template <int columns>
void run(const p::BiquadSection<double>& k, const double* settled, const double* level, double* from, std::size_t rows,
         std::ptrdiff_t stride) {
  double s1[columns], s2[columns];
  for (int c = 0; c < columns; ++c) {
    s1[c] = settled[0] * level[c];
    s2[c] = settled[1] * level[c];
  }
  for (; rows > 0; --rows, from += stride)
    for (int c = 0; c < columns; ++c) from[c] = p::pass(k, s1[c], s2[c], from[c]);
}

/// One pass of the whole cascade over all columns, in the direction that `stride` has.
void cascade(const Array& sos, const Array& settled, double* from, std::size_t rows, std::size_t columns,
             std::ptrdiff_t stride) {
  const std::vector<double> level(from, from + columns);
  for (std::size_t i = 0; i < sos.shape[0]; ++i) {
    const double* row = sos.data + 6 * i;
    const p::BiquadSection<double> k{row[0], row[1], row[2], row[4], row[5]};
    const double* start = settled.data + 2 * i;
    std::size_t c = 0;
    for (; c + 4 <= columns; c += 4) run<4>(k, start, level.data() + c, from + c, rows, stride);
    for (; c + 2 <= columns; c += 2) run<2>(k, start, level.data() + c, from + c, rows, stride);
    for (; c < columns; ++c) run<1>(k, start, level.data() + c, from + c, rows, stride);
  }
}

nb::object zero_phase(nb::handle sos_, nb::handle settled_, nb::handle samples_, std::size_t padding) {
  const Array sos = read_array("sos", sos_), settled = read_array("settled", settled_);
  const Array samples = read_array("samples", samples_);
  if (sos.shape.size() != 2 || sos.shape[1] != 6) sos.fail("(k, 6)");
  settled.expect(text({sos.shape[0], 2}), {sos.shape[0], 2});
  if (samples.shape.size() != 2 || samples.shape[0] <= padding)
    samples.fail("(n, m) with n above " + std::to_string(padding));
  const std::size_t rows = samples.shape[0], columns = samples.shape[1], all = rows + 2 * padding;
  Result filtered({rows, columns});
  {
    nb::gil_scoped_release release;
    std::vector<double> work(all * columns);
    const double *first = samples.data, *last = samples.data + (rows - 1) * columns;
    std::copy(first, last + columns, work.data() + padding * columns);
    for (std::size_t i = 0; i < padding; ++i)
      for (std::size_t c = 0; c < columns; ++c) {
        work[i * columns + c] = 2.0 * first[c] - first[(padding - i) * columns + c];
        work[(padding + rows + i) * columns + c] = 2.0 * last[c] - last[c - (i + 1) * columns];
      }
    const auto stride = static_cast<std::ptrdiff_t>(columns);
    if (columns > 0) {
      cascade(sos, settled, work.data(), all, columns, stride);
      cascade(sos, settled, work.data() + (all - 1) * columns, all, columns, -stride);
    }
    std::copy(work.data() + padding * columns, work.data() + (padding + rows) * columns, filtered.data);
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
