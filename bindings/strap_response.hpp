// The limb's angle under a strap's torque, as a Python function.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// strap_response into the module.
void add_strap_response(nanobind::module_& m);

}  // namespace bindings
