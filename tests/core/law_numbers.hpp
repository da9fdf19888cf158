// One sensible set of numbers for every control law, in the order of its array: what the fuzzer changes from.
#pragma once

#include <pellucid/directional_compensation.hpp>
#include <pellucid/joint_compensation.hpp>
#include <pellucid/position_prediction.hpp>
#include <pellucid/residual_compensator.hpp>
#include <pellucid/transparent_compensation.hpp>

template <class S> constexpr S position_prediction_numbers[pellucid::position_prediction_parameter_count] = {
    S(2), S(0.3), S(0.4), S(400), S(0.02), S(8),                                  // the law's own
    S(10), S(1000), S(8), S(0), S(2.6), S(0.1), S(0.005), S(2), S(0.001)};        // of the gate

template <class S> constexpr S directional_numbers[pellucid::directional_parameter_count] = {
    S(2.3), S(0.3), S(0.3), S(0.06), S(0.05), S(-1),                              // upwards
    S(1.8), S(0.3), S(0.25), S(0.04), S(0.05), S(-1.9),                           // downwards
    S(0.05), S(0.4), S(8),                                                        // rest, limit, speed
    S(10), S(1000), S(8), S(0), S(2.6), S(0.1), S(0.005), S(2), S(0.001)};        // of the gate

template <class S> constexpr S transparent_numbers[pellucid::transparent_parameter_count] = {
    S(0.05), S(2), S(0.3), S(0),                                                  // body
    S(0.25), S(0.2), S(0.05), S(0.04), S(0), S(0), S(0.13), S(0.11), S(0.06),     // friction
    S(1), S(0.9), S(0.3), S(200), S(0.02), S(20), S(25), S(0.2),                  // shares, estimator, observer
    S(1), S(5), S(0.5), S(300), S(0.02), S(3),                                    // force sensor
    S(0.08), S(2.4), S(0.1), S(0.5), S(25), S(0.5),                               // EMG
    S(4), S(1), S(16), S(8), S(8), S(2), S(0.02), S(0.5), S(0.02), S(0.01),       // oscillator, friction's lead
    S(0.5), S(20), S(0.008), S(3), S(0.5), S(900),                                // disturbance observer, dither
    S(10), S(1000), S(8), S(0), S(2.6), S(0.1), S(0.005), S(2), S(0.001)};        // of the gate

template <class S> constexpr S joint_compensation_numbers[pellucid::joint_compensation_parameter_count] = {
    S(0.05), S(1.5), S(0.2), S(0.1),                                              // body
    S(0.3), S(0.25), S(0.1), S(0.08), S(0), S(0), S(0.15), S(0.1), S(0.06),       // friction
    S(1), S(0.8), S(200),                                                         // shares, filter
    S(5), S(250), S(8), S(0), S(2.6), S(0.05), S(0.005), S(2), S(0.001)};         // of the gate

template <class S> constexpr S residual_numbers[pellucid::residual_parameter_count] = {
    S(0.048), S(0.008), S(1.56), S(0.02), S(0.05), S(0.33), S(0.2), S(8.2), S(14), S(0.4), S(0),  // bodies
    S(0.41), S(52), S(4.5), S(144), S(1367), S(0.05),                             // observer
    S(0.8), S(0.8), S(0.5), S(0.6), S(0.7), S(0.055), S(0.1), S(2.6), S(1.7),     // shares, actuator
    S(0.3), S(1), S(0.5), S(0.01), S(1), S(0.01), S(40), S(0.3), S(0.3), S(4.4),  // gains, EMG, swing
    S(1), S(1), S(1), S(1), S(1), S(1), S(1), S(1),                               // by phase
    S(10), S(300), S(15), S(-0.6), S(2.6), S(0.1), S(0.01), S(2), S(0.002)};      // of the gate
