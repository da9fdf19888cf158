// Numbers of a text table, as a Python function.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// read_rows into the module.
void add_read_rows(nanobind::module_& m);

}  // namespace bindings
