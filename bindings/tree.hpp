// KinematicTree, DrivenTree and WornTree of pellucid._core.
#pragma once

#include "arrays.hpp"
#include "tree_kernels.hpp"

#include <pellucid/kinematic_tree.hpp>

#include <memory>

namespace bindings {

using ReadTree = pellucid::TreeParams<double, most_links>;

/// Links and gravity as numbers, or a ValueError that names the link and what was expected.
std::unique_ptr<ReadTree> read_tree(const Array& links, const Array& gravity);

/// n samples of m numbers each, or one.
struct TreeArguments {
  std::vector<Array> arrays;
  bool single;
  TreeSamples samples;

  TreeArguments(std::size_t m, std::initializer_list<std::pair<const char*, nb::handle>> named);
  Shape shape(std::initializer_list<std::size_t> of_each) const;
};

void add_tree(nb::module_& m);
void add_driven_tree(nb::module_& m);
void add_worn_tree(nb::module_& m);
void add_tree_laws(nb::module_& m);

}  // namespace bindings
