// The coupled plant as a Python class.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// CoupledPlant and COUPLED_PARAMETER_NAMES into the module.
void add_coupled_plant(nanobind::module_& m);

}  // namespace bindings
