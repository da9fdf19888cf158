// The calibrated estimator of torque for Python.
#pragma once

#include "arrays.hpp"

namespace bindings {

void add_emg_estimator(nb::module_& m);

}  // namespace bindings
