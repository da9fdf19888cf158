// Tables of numbers as text, as a Python function.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// number_rows into the module.
void add_number_text(nanobind::module_& m);

}  // namespace bindings
