#pragma once

#include "arrays.hpp"

namespace bindings {

/// Supervised, supervised, supervised_storage, fuzz_supervised and time_supervisor into the module.
void add_supervision(nb::module_& m);

}  // namespace bindings
