#pragma once

#include "arrays.hpp"

namespace bindings {

/// WornOrthosis into the module.
void add_worn_orthosis(nb::module_& m);

}  // namespace bindings
