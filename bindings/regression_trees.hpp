// Regression trees, grown on rows that are sorted once.
#pragma once

#include <nanobind/nanobind.h>

namespace bindings {

/// SortedRows, drawn_rows and tree_answers into the module.
void add_regression_trees(nanobind::module_& m);

}  // namespace bindings
