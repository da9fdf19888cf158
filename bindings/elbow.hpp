// A person, a robot on the forearm and its control law as a Python class.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// WornElbow and REACHING_PARAMETER_NAMES into the module.
void add_elbow(nanobind::module_& m);

}  // namespace bindings
