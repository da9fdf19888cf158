// What the bindings run with the interpreter's lock released: plain pointers in, plain pointers out.
//
// kernels.cpp is compiled once for each instruction set; `best_kernels` picks one when the module is imported.
#pragma once

#include <cstddef>
#include <cstdint>

namespace bindings {

/// Row r of an array starts at data + r stride; a stride of 0 is one row for all. No data: zeros.
struct Rows {
  const double* data = nullptr;
  std::size_t stride = 0;
};

/// Settings of a simulation that are one number per row.
enum Setting : std::size_t {
  kp,
  ki,
  kd,
  kv,
  limit,
  gain,
  back_emf,
  encoder_quantum,
  ripple_amplitude,
  ripple_wave_number,
  ripple_phase,
  position0,
  velocity0,
  integral0,
  presliding_travel,
  setting_count
};

constexpr std::size_t output_count = 6;         // position, velocity, acceleration, command, effort, measured_position
constexpr std::size_t geared_output_count = 7;  // the fields of pellucid::GearedPlantOutput, in their order
constexpr std::size_t max_output_count = 7;
constexpr std::size_t differentiated_count = 4;
constexpr std::size_t differentiated[differentiated_count] = {0, 1, 2, 4};  // position, velocity, acceleration, effort

struct Simulation {
  std::size_t rows = 0;
  std::size_t samples = 0;
  Rows parameters;  // parameter_count numbers each, or geared_parameter_count
  Rows settings[setting_count];
  Rows reference, injected, disturbance, encoder_noise;  // one number per sample
  double period = 0;
  std::uint32_t substeps = 1;
  std::uint32_t velocity_span = 0;
  std::uint8_t loop = 0;  // a pellucid::LoopKind
  bool stiction = false;
  double* output[max_output_count] = {};  // rows of samples
};

struct Kernels {
  const char* instructions;
  void (*inverse_dynamics)(const double* parameters, std::size_t n, const double* position, const double* velocity,
                           const double* acceleration, double* effort);
  void (*inverse_dynamics_jacobian)(const double* parameters, std::size_t n, const double* position,
                                    const double* velocity, const double* acceleration, const std::size_t* active,
                                    std::size_t k, double* effort, double* jacobian);
  void (*forward_dynamics)(const double* parameters, std::size_t n, const double* position, const double* velocity,
                           const double* effort, double* acceleration);
  void (*friction)(const double* parameters, std::size_t n, const double* velocity, const double* load, double* effort);
  void (*load)(const double* parameters, std::size_t n, const double* position, const double* acceleration,
               double* effort);
  void (*presliding)(double travel, std::size_t n, const double* position, double* direction);
  /// Rows first to last - 1.
  void (*simulate)(const Simulation&, std::size_t first, std::size_t last);
  /// The same of geared plants; always with stiction.
  void (*simulate_geared)(const Simulation&, std::size_t first, std::size_t last);
  /// The one row, and its derivatives by parameters[active], each of samples rows of k.
  void (*simulate_jacobian)(const Simulation&, const std::size_t* active, std::size_t k,
                            double* const (&derivative)[differentiated_count]);
};

const Kernels& best_kernels();

}  // namespace bindings
