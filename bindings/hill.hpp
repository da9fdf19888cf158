// Muscles as Python functions and classes.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// MUSCLE_PARAMETER_NAMES, the hill_ functions, HillTorque, ElasticMuscle and activation_dynamics into the module.
void add_hill(nanobind::module_& m);

}  // namespace bindings
