// The main movement within a stretch of velocity: a study has thousands of short stretches under several rules.
#include "main_movement.hpp"

#include <nanobind/ndarray.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace bindings {
namespace {

namespace nb = nanobind;

constexpr const char* main_movement_doc =
    R"(Find the movement around the largest speed of a stretch, and the highest other peak of its velocity.

Samples move that are faster than the `threshold`, a share of the largest speed. The main movement ends where the
velocity reverses. Other peaks count above `least_peak` where the velocity falls below `deepest` in between; both are
shares of the largest speed.

Parameters
----------
velocity : (n,)
    n > 0, any unit.
threshold, least_peak, deepest : float

Returns
-------
tuple
    Sample of the largest speed; first sample of the main movement and the one behind its last; first and last sample
    that move; whether some move backwards; the other peak and the valley before it, 0 and 1 without one.)";

using Velocity = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

nb::tuple main_movement(const Velocity& velocity, double threshold, double least_peak, double deepest) {
  const double* const v = velocity.data();
  const std::size_t n = velocity.shape(0);
  if (n == 0) throw nb::value_error("velocity: found no sample, expected some");
  std::size_t peak = 0;
  for (std::size_t i = 1; i < n; ++i)
    if (std::fabs(v[i]) > std::fabs(v[peak])) peak = i;
  const double way = v[peak] > 0.0 ? 1.0 : -1.0, top = way * v[peak], slow = threshold * top;
  const auto moves = [&](std::size_t i) { return std::fabs(v[i]) > slow; };
  const auto advances = [&](std::size_t i) { return moves(i) && way * v[i] > 0.0; };
  std::size_t start = peak, stop = peak, first = 0, last = n - 1;
  while (start > 0 && advances(start - 1)) --start;
  while (stop < n && advances(stop)) ++stop;
  while (first < peak && !moves(first)) ++first;
  while (last > peak && !moves(last)) --last;
  bool is_backwards = false;
  for (std::size_t i = first; i <= last; ++i) is_backwards |= moves(i) && way * v[i] < 0.0;
  double other = 0.0, valley = 1.0;
  for (std::size_t i = 1; i + 1 < n; ++i) {
    if (i == peak || !(way * v[i] >= way * v[i - 1] && way * v[i + 1] < way * v[i])) continue;
    const double height = way * v[i] / top;
    if (!(height > least_peak)) continue;
    double lowest = top;
    for (std::size_t j = std::min(i, peak); j <= std::max(i, peak); ++j) lowest = std::min(lowest, way * v[j]);
    if (lowest / top < deepest && height > other) other = height, valley = lowest / top;
  }
  return nb::make_tuple(peak, start, stop, first, last, is_backwards, other, valley);
}

}  // namespace

void add_main_movement(nb::module_& m) {
  m.def("main_movement", main_movement, nb::arg("velocity"), nb::arg("threshold"), nb::arg("least_peak"),
        nb::arg("deepest"),
        nb::sig("def main_movement(velocity: NDArray[float64], threshold: float, least_peak: float, deepest: float) -> "
                "tuple[int, int, int, int, int, bool, float, float]"),
        main_movement_doc);
}

}  // namespace bindings
