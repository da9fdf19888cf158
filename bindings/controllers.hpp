// Controllers as Python classes; controllers.cpp adds them to the module.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

void add_controllers(nanobind::module_& m);

}  // namespace bindings
