// The main movement within a stretch of velocity, as a Python function.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// main_movement into the module.
void add_main_movement(nanobind::module_& m);

}  // namespace bindings
