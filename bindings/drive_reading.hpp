// How well a virtual robot's drive measures its own effort, from numbers of Python.
#pragma once

#include "fields.hpp"

#include <pellucid/drive_reading.hpp>

#include <cmath>

namespace bindings {

/// Coefficients of a reading whose four numbers are in the order of DRIVE_READING_NAMES; None: exact.
inline pellucid::DriveReadingCoefficients<double> read_drive_reading(nb::handle numbers, double period) {
  pellucid::DriveReadingParams<double> params;
  if (!numbers.is_none()) params = read_params<pellucid::DriveReadingParams<double>, double>("drive_reading", numbers);
  if (!pellucid::is_sound(params))
    throw nb::value_error("drive_reading: expected a gain above 0, a finite offset, a lag and a quantum of at least 0");
  return pellucid::coefficients(params, period);
}

}  // namespace bindings
