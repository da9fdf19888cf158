// Sensible numbers of any law, by the names that its walk gives them: what fuzzers change from. What is not here keeps
// its default, so that a law whose numbers are known by name needs none of its own.
#pragma once

#include <pellucid/fields.hpp>

#include <cstring>

struct Typical {
  const char* name;
  double value;
};
constexpr Typical typical[] = {
    {"inertia", 0.05},           {"gravity_sine", 2},          {"gravity_cosine", 0.3},      {"offset", 0.1},
    {"coulomb_positive", 0.25},  {"coulomb_negative", 0.2},    {"viscous_positive", 0.05},   {"viscous_negative", 0.04},
    {"load_motoring", 0.13},     {"load_generating", 0.11},    {"velocity_width", 0.06},     {"coulomb", 0.02},
    {"stiffness", 400},          {"dead_band", 0.02},          {"speed_span", 8},            {"inertia_limit", 0.4},
    {"gravity_sine_up", 2.3},    {"gravity_cosine_up", 0.3},   {"coulomb_up", 0.3},          {"viscous_up", 0.06},
    {"inertia_up", 0.05},        {"exponent_up", -1},          {"gravity_sine_down", 1.8},   {"gravity_cosine_down", 0.3},
    {"coulomb_down", 0.25},      {"viscous_down", 0.04},       {"inertia_down", 0.05},       {"exponent_down", -1.9},
    {"friction_lead", 0.01},     {"energy_store", 0.2},        {"proportional", 1},          {"integral", 0.5},
    {"leak", 0.5},               {"sensor_lowpass", 300},      {"sensor_drift", 0.02},       {"feedback_limit", 3},
    {"limb_inertia", 0.33},      {"limb_gravity", 8.2},        {"limb_viscous", 0.2},        {"emg_limit", 25},
    {"emg_share", 0.5},          {"oscillator_share", 0.5},    {"oscillator_lead", 0.02},    {"disturbance_share", 0.5},
    {"disturbance_delay", 0.008}, {"disturbance_limit", 3},    {"dither", 0.5},              {"dither_frequency", 900},
    {"orthosis_inertia", 0.048}, {"orthosis_viscous", 0.008},  {"orthosis_gravity", 1.56},   {"strap_stiffness", 14},
    {"strap_damping", 0.4},      {"correct_position", 0.41},   {"correct_velocity", 52},     {"correct_mismatch", 4.5},
    {"correct_mismatch_rate", 144}, {"correct_disturbance", 1367}, {"actuator_inertia", 0.055}, {"actuator_viscous", 0.1},
    {"actuator_coulomb", 2.6},   {"actuator_leak", 1.7},       {"torque_gain", 0.3},         {"derivative", 0.01},
    {"preview", 0.01},           {"swing_angle", 0.3},         {"effort_limit", 10},         {"rate_limit", 500},
    {"velocity_limit", 8},       {"position_min", 0},          {"position_max", 2.6},        {"stop_margin", 0.1},
    {"max_age", 0.005},          {"max_repeats", 2},           {"period", 0.001},
    {"rule_1_2", 0.1},           {"rule_1_4", -0.1},           {"rule_2_3", 0.2},            {"rule_3_6", 0.4},
};

/// A Params of typical numbers.
template <class P> P typical_params() {
  P params{};
  pellucid::walk(params, [](auto& number, const pellucid::Field& f) {
    using T = std::remove_reference_t<decltype(number)>;
    char name[64] = {};
    std::strcat(std::strcat(std::strcat(name, f.before), f.name), f.after);
    for (const Typical& one : typical)
      if (std::strcmp(one.name, name) == 0) number = static_cast<T>(one.value);
  });
  return params;
}
