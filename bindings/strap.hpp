// A strap along a motion, as Python functions.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// STRAP_PARAMETER_NAMES, strap_torque and strap_torque_jacobian into the module.
void add_strap(nanobind::module_& m);

}  // namespace bindings
