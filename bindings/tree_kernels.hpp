// Trees of bodies over arrays, as the bindings run them with the interpreter's lock released.
//
// tree_kernels.cpp is compiled once for each instruction set; `best_tree_kernels` picks one, with the same bits.
#pragma once

#include <cstddef>

namespace bindings {

constexpr std::size_t most_links = 32;

/// A tree's numbers as they came in, and what follows from them: `bytes` of memory that `prepare` fills.
struct TreeNumbers {
  std::size_t links = 0;
  std::size_t coordinates = 0;
  const double* link = nullptr;     // links rows of pellucid::link_parameter_count
  const double* gravity = nullptr;  // 3
  void* prepared = nullptr;         // aligned to 64
};

/// Samples, row by row: a number for each coordinate in each.
struct TreeSamples {
  std::size_t n = 0;
  const double* position = nullptr;
  const double* velocity = nullptr;
  const double* acceleration = nullptr;  // or effort, where accelerations are asked for
};

/// Columns beside those of the bodies: `own` ones of each joint, and those that joints share.
struct MoreColumns {
  std::size_t own = 0, shared = 0;
  const double* own_data = nullptr;     // n rows of coordinates rows of own
  const double* shared_data = nullptr;  // n rows of coordinates rows of shared
};

/// The Gram matrix of weighted rows: columns of bodies, own ones joint after joint, shared ones, and the effort last.
struct TreeGram {
  const double* effort = nullptr;  // n rows of coordinates
  const double* weight = nullptr;  // the same, of squares; null: 1. A row of weight 0 is not read
  double* gram = nullptr;          // (columns + 1) rows of as many
  double* work = nullptr;          // gram_work(...) numbers
};
constexpr std::size_t gram_block = 64;  // samples, of which one joint's rows stay in the nearest cache
constexpr std::size_t gram_width(std::size_t columns) { return (columns + 15) / 16 * 16; }
constexpr std::size_t gram_work(std::size_t links, std::size_t coordinates, const MoreColumns& more) {
  const std::size_t width = gram_width(10 * links + more.own + more.shared + 1);
  return coordinates * width * (width + gram_block) + gram_block * width;
}

struct TreeKernels {
  std::size_t bytes;
  void (*prepare)(const TreeNumbers&);
  void (*inverse_dynamics)(const TreeNumbers&, const TreeSamples&, double* effort);
  void (*gravity)(const TreeNumbers&, const TreeSamples&, double* effort);
  void (*mass_matrix)(const TreeNumbers&, const TreeSamples&, double* matrix);
  void (*forward_dynamics)(const TreeNumbers&, const TreeSamples&, const bool* held, double* acceleration);
  void (*energy)(const TreeNumbers&, const TreeSamples&, double* kinetic, double* potential);
  void (*placements)(const TreeNumbers&, const TreeSamples&, double* placements);
  void (*jacobian)(const TreeNumbers&, const TreeSamples&, std::size_t link, const double* point, double* jacobian);
  void (*regressor)(const TreeNumbers&, const TreeSamples&, const MoreColumns&, double* rows);
  void (*gram)(const TreeNumbers&, const TreeSamples&, const MoreColumns&, const TreeGram&);
};

const TreeKernels& best_tree_kernels();

}  // namespace bindings
