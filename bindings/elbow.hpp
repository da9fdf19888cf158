// A person, a robot on the forearm and its control law as a Python class.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// WornElbow, fuzz_law and the names of their parameters into the module.
void add_elbow(nanobind::module_& m);

}  // namespace bindings
