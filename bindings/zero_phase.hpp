// Filtering forwards and backwards as a Python function.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// zero_phase into the module.
void add_zero_phase(nanobind::module_& m);

}  // namespace bindings
