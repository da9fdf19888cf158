// KinematicTree of pellucid._core.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

void add_tree(nanobind::module_& m);

}  // namespace bindings
