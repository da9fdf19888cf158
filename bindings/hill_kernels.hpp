// Several muscles over arrays, as the bindings run them with the interpreter's lock released.
//
// hill_kernels.cpp is compiled once for each instruction set; `best_hill_kernels` picks one, with the same bits.
#pragma once

#include <cstddef>
#include <cstdint>

namespace bindings {

constexpr std::size_t most_muscles = 32;
constexpr std::size_t most_joints = 8;
constexpr std::size_t hill_block = 512;  // samples that stay in the nearest cache while muscles add to them

/// Muscles on samples: every array is muscle-major, `muscles` rows of `samples`; moment arms are that for each joint.
struct HillData {
  std::size_t joints = 1;
  std::size_t muscles = 0;
  std::size_t samples = 0;
  const double* parameters = nullptr;  // muscles rows of pellucid::muscle_parameter_count
  double period = 0;
  const double* excitation = nullptr;
  const double* length = nullptr;
  const double* velocity = nullptr;
  const double* moment_arm = nullptr;
  const std::size_t* starts = nullptr;  // first sample of each recording, ascending, the first 0
  std::size_t recordings = 0;
};

/// Which quantity of which muscle a free parameter drives, and how steeply.
struct HillFree {
  std::size_t columns = 0;
  const std::int64_t* column = nullptr;  // muscles rows of pellucid::muscle_free_count; -1: not free
  const double* gain = nullptr;          // the same: d quantity / d parameter
};

/// Residual weight (torque - measured) and what a solver asks of it; what is null is not computed. Rows of samples are
/// one for each joint, those of the Jacobian joint by joint for each column.
struct HillFit {
  const double* measured = nullptr;
  const double* weight = nullptr;
  double* torque = nullptr;    // joints rows of samples
  double* jacobian = nullptr;  // columns rows of joints rows of samples, d torque, not weighed
  double* gradient = nullptr;  // columns: J' residual
  double* normal = nullptr;    // columns rows of columns: J'J
  double cost = 0;             // half the sum of squares
  double* work = nullptr;      // joints times columns rows of hill_block, at least 1
};

/// Outputs of each muscle: one row of samples per muscle.
struct HillStates {
  double *activation, *force, *fibre_length, *fibre_velocity;
};

struct HillKernels {
  void (*fit)(const HillData&, const HillFree&, HillFit&);
  void (*states)(const HillData&, const HillStates&);
};

const HillKernels& best_hill_kernels();

}  // namespace bindings
