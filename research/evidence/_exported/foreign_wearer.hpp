// What one run of a foreign plant is told and what it tells: names in an order that the Python side reads from here.
//
// The plant shares nothing with the core: neither its equations nor its numbers nor its headers. The controller is known
// by the exported pellucid_controller.h alone. Everything is SI; angles stand for metres where a machine slides.
#pragma once

#include <cstddef>

namespace foreign {

/// Every number of a run: X(name, unit, meaning).
#define FOREIGN_FIELDS(X)                                                                                              \
  X(period, "s", "period of the controller")                                                                           \
  X(substeps, "1", "steps of the integration in a period")                                                             \
  X(effort_limit, "N*m", "effort limit of the exported controller")                                                    \
  X(velocity_limit, "rad/s", "velocity limit of the exported controller")                                              \
  X(range_low, "rad", "lowest position that the exported controller accepts")                                          \
  X(range_high, "rad", "highest position that the exported controller accepts")                                        \
  X(wearer_push, "N*m", "largest momentary torque of a wearer that the exported controller expects")                   \
  X(wearer_torque, "N*m", "largest lasting torque of a wearer that the exported controller expects")                   \
  X(inertia, "kg*m^2", "inertia of the robot")                                                                         \
  X(rotor_share, "1", "share of the inertia in front of the flexible transmission; 0: a rigid one")                    \
  X(transmission_stiffness, "N*m/rad", "stiffness of the transmission")                                                \
  X(transmission_damping, "N*m*s/rad", "damping of the transmission")                                                  \
  X(backlash, "rad", "whole gap of the transmission")                                                                  \
  X(gravity_sine, "N*m", "gravity torque per sine of the angle")                                                       \
  X(gravity_cosine, "N*m", "gravity torque per cosine of the angle")                                                   \
  X(offset, "N*m", "torque that is always there")                                                                      \
  X(friction_positive, "N*m", "dry friction of sliding forwards")                                                      \
  X(friction_negative, "N*m", "dry friction of sliding backwards")                                                     \
  X(static_ratio, "1", "friction at rest over sliding friction")                                                       \
  X(stribeck_velocity, "rad/s", "speed at which the rise towards rest has halved")                                     \
  X(bristle_stiffness, "N*m/rad", "stiffness of the bristles")                                                         \
  X(bristle_damping, "1", "damping ratio of the robot on its bristles")                                                \
  X(load_friction, "1", "dry friction per load")                                                                       \
  X(viscous, "N*m*s/rad", "viscous friction at rest")                                                                  \
  X(thinning_velocity, "rad/s", "speed at which viscous friction's coefficient has halved")                            \
  X(stop_low, "rad", "lower mechanical stop")                                                                          \
  X(stop_high, "rad", "upper mechanical stop")                                                                         \
  X(stop_stiffness, "N*m/rad", "stiffness of the mechanical stops")                                                    \
  X(stop_damping, "N*m*s/rad", "damping of the mechanical stops")                                                      \
  X(drive_lag, "s", "time constant of the current loop")                                                               \
  X(dead_cycles, "1", "periods by which the drive answers late, 0 to 3")                                               \
  X(drive_limit, "N*m", "largest effort of the drive")                                                                 \
  X(ripple, "N*m", "amplitude of the torque ripple")                                                                   \
  X(ripple_waves, "1/rad", "wave number of the torque ripple")                                                         \
  X(spring_stiffness, "N*m/rad", "stiffness of a spring that the drive acts through; 0: there is none")                \
  X(spring_inertia, "kg*m^2", "inertia of motor and gear before the spring")                                           \
  X(spring_friction, "N*m", "dry friction of motor and gear")                                                          \
  X(spring_viscous, "N*m*s/rad", "viscous friction of motor and gear")                                                 \
  X(spring_gain, "1", "proportional gain of the torque loop")                                                          \
  X(spring_integral, "1/s", "integral gain of the torque loop")                                                        \
  X(spring_rate_gain, "s", "gain of the torque loop on the torque's rate")                                             \
  X(encoder_quantum, "rad", "quantum of the encoder")                                                                  \
  X(encoder_noise, "rad", "standard deviation of the encoder's noise")                                                 \
  X(force_gain, "1", "reading of the force sensor per torque")                                                         \
  X(force_offset, "N*m", "offset of the force sensor")                                                                 \
  X(force_lag, "s", "time constant of the force sensor")                                                               \
  X(force_noise, "N*m", "standard deviation of the force sensor's noise")                                              \
  X(force_quantum, "N*m", "quantum of the force sensor")                                                               \
  X(current_gain, "1", "reading of the drive's measurement per effort")                                                \
  X(current_offset, "N*m", "offset of the drive's measurement")                                                        \
  X(current_lag, "s", "time constant of the drive's measurement")                                                      \
  X(current_noise, "N*m", "standard deviation of its noise")                                                           \
  X(current_quantum, "N*m", "quantum of the drive's measurement")                                                      \
  X(emg_flexor_gain, "1", "reading of EMG per torque of the flexors")                                                  \
  X(emg_extensor_gain, "1", "reading of EMG per torque of the extensors")                                              \
  X(emg_offset, "N*m", "offset of EMG")                                                                                \
  X(emg_lag, "s", "time constant of EMG's envelope")                                                                   \
  X(emg_noise, "1", "standard deviation of EMG's multiplicative noise before the envelope")                            \
  X(emg_quantum, "N*m", "quantum of EMG")                                                                              \
  X(strength, "1", "strength of the wearer and of what hits the limb, relative to an elbow's")                         \
  X(drive_strength, "1", "strength of the drive, relative to an elbow's")                                              \
  X(worn, "1", "1: a limb is strapped on; 0: a hand guides the machine")                                               \
  X(upper_cuff_stiffness, "N*m/rad", "stiffness of the upper cuff at its slack's end")                                 \
  X(upper_cuff_slack, "rad", "whole slack of the upper cuff")                                                          \
  X(upper_cuff_offset, "rad", "angle by which the upper cuff sits askew")                                              \
  X(lower_cuff_stiffness, "N*m/rad", "stiffness of the lower cuff at its slack's end")                                 \
  X(lower_cuff_slack, "rad", "whole slack of the lower cuff")                                                          \
  X(lower_cuff_offset, "rad", "angle by which the lower cuff sits askew")                                              \
  X(cuff_hardening, "rad", "deflection at which a cuff's stiffness has doubled")                                       \
  X(cuff_damping, "s", "damping of a cuff per stiffness, where it is taut")                                            \
  X(limb_inertia, "kg*m^2", "inertia of the limb")                                                                     \
  X(limb_gravity, "N*m", "gravity torque of the limb per sine of the angle")                                           \
  X(limb_damping, "N*m*s/rad", "passive damping of the limb")                                                          \
  X(servo_stiffness, "N*m/rad", "stiffness of the wearer's muscles without delay")                                     \
  X(servo_damping, "N*m*s/rad", "damping of the wearer's muscles without delay")                                       \
  X(reflex_stiffness, "N*m/rad", "stiffness of the wearer's reflexes")                                                 \
  X(reflex_damping, "N*m*s/rad", "damping of the wearer's reflexes")                                                   \
  X(reflex_delay, "s", "delay of the reflexes, up to 0.12 s")                                                          \
  X(activation_lag, "s", "time constant of a muscle's force")                                                          \
  X(learning_time, "s", "time in which a wearer learns a lasting load")                                                \
  X(anticipation, "1", "share of the limb's and robot's load that the wearer anticipates")                             \
  X(muscle_limit, "N*m", "largest torque of the wearer")                                                               \
  X(tremor_amplitude, "N*m", "amplitude of the tremor")                                                                \
  X(tremor_frequency, "Hz", "frequency of the tremor")                                                                 \
  X(target_low, "rad", "lowest target")                                                                                \
  X(target_high, "rad", "highest target")                                                                              \
  X(fastest_duration, "s", "shortest duration of a reach")                                                             \
  X(slowest_duration, "s", "longest duration of a reach")                                                              \
  X(longest_pause, "s", "longest pause between two reaches")                                                           \
  X(speed_share, "1", "share of the velocity limit that a reach plans at most")                                        \
  X(brace_interval, "s", "mean time between two sudden stops; 0: never")                                               \
  X(impact_interval, "s", "mean time between two impacts on something hard; 0: never")                                 \
  X(load_interval, "s", "mean time between two loads picked up; 0: never")                                             \
  X(load_mass, "kg", "mass of the load")                                                                               \
  X(load_lever, "m", "distance of the load from the joint")                                                            \
  X(spasm_interval, "s", "mean time between two spasms; 0: never")                                                     \
  X(spasm_torque, "N*m", "largest torque of a spasm")                                                                  \
  X(doff_interval, "s", "mean time between two times at which the robot is taken off; 0: never")                       \
  X(hand_stiffness, "N*m/rad", "stiffness of the hand that holds a robot nobody wears")                                \
  X(hand_damping, "N*m*s/rad", "damping of that hand")                                                                 \
  X(start_position, "rad", "posture at the start")                                                                     \
  X(seconds, "s", "duration of the run, or of the watch after a fault's onset")                                        \
  X(seed, "1", "seed of everything that is drawn within the run")                                                      \
  X(kind, "1", "-1: a healthy life with resets; 0: the reference of faults; above: a fault's number")                  \
  X(onset, "s", "onset of the fault")                                                                                  \
  X(fault_seed, "1", "seed of what the fault draws")                                                                   \
  X(amplitude, "N*m", "amplitude of an added sine")                                                                    \
  X(test_least, "J", "least work of the test at start-up, of a robot that was commissioned")                            \
  X(test_most, "J", "largest work of that test; 0: both as exported")                                                  \
  X(probe_answer_error, "1", "mean square error of the answers below; 0: as exported")                                 \
  X(probe_answer_low_real, "1", "part of an answer to the probe at commissioning")                                     \
  X(probe_answer_low_imaginary, "1", "part of an answer to the probe at commissioning")                                \
  X(probe_answer_middle_real, "1", "part of an answer to the probe at commissioning")                                  \
  X(probe_answer_middle_imaginary, "1", "part of an answer to the probe at commissioning")                             \
  X(probe_answer_high_real, "1", "part of an answer to the probe at commissioning")                                    \
  X(probe_answer_high_imaginary, "1", "part of an answer to the probe at commissioning")                               \
  X(probe_travel, "rad", "way that the joint may go while its drive is not heard; 0: as exported")                   \
  X(probe_scale, "1", "effort of the probe over the exported one; 0: as exported")                                  \
  X(reaching, "1", "1: the wearer never goes to and fro, but reaches and rests")                                        \
  X(clock_jitter, "s", "largest error of each time stamp, either way")                                                \
  X(clock_start, "us", "time of the controller's clock at the start")                                                  \
  X(clock_bits, "1", "32: the controller's clock wraps after so many bits; 0: it does not")                             \
  X(traced, "1", "1: tell what the controller sees in every second period")                                            \
  X(passive, "1", "1: no power and limp muscles, to check the plant's energy")

/// The faults, in the order of their numbers; those of the core and, below the line, further ones.
#define FOREIGN_FAULTS(X)                                                                                              \
  X(none) X(encoder_frozen) X(encoder_repeats) X(encoder_nan) X(encoder_jump) X(encoder_slip) X(encoder_drift)         \
  X(encoder_drift_two) X(encoder_flipped) X(encoder_flipped_two) X(encoder_far) X(encoder_noise) X(encoder_half)       \
  X(encoder_half_two) X(force_flipped) X(force_offset) X(force_triple) X(force_frozen) X(force_lost) X(force_rail)     \
  X(emg_rail) X(emg_lost) X(emg_crossed) X(drive_reversed_at_start) X(drive_triple_at_start) X(drive_reversed)         \
  X(drive_triple) X(drive_triple_unseen) X(drive_stuck) X(drive_holds) X(drive_dead) X(drive_late) X(current_zero)     \
  X(current_offset) X(wearer_spasm) X(wearer_faints) X(wearer_blocked) X(strap_opens) X(clock_ahead) X(clock_back)     \
  X(samples_late) X(cycle_overrun) X(task_hangs) X(law_memory) X(supervisor_memory) X(mode_memory) X(law_state)        \
  /* ---- */                                                                                                           \
  X(drive_double) X(drive_sine)                                                                                       \
  /* ---- faults that only rows of their own try */                                                                   \
  X(drive_lies) X(current_spike) X(encoder_frozen_at_rest) X(rate_half) X(rate_quarter) X(rate_double) X(rate_twice)

/// What a run tells: X(name, unit, meaning).
#define FOREIGN_RESULTS(X)                                                                                             \
  X(early, "s", "time at which the supervisor acted before the onset; negative: it did not")                           \
  X(found, "s", "time from the onset until the supervisor or the watchdog acted; negative: never")                     \
  X(safe, "s", "time from the onset until the output was safe; negative: never")                                       \
  X(fault, "1", "number of the fault that the supervisor named; -1: the watchdog acted")                               \
  X(mode, "1", "number of the mode at the end")                                                                        \
  X(excess, "J", "largest surplus of positive work on the limb over that of the reference")                            \
  X(peak, "N*m", "largest torque of the strap from the onset on")                                                      \
  X(deviation, "N*m", "mean difference of the drive's effort from that of the reference, until safe")                  \
  X(answer, "J", "work of the test at start-up by the middle of its wave")                                             \
  X(probe_windows, "1", "windows from which the answers to the probe were learnt")                                     \
  X(seen_probe_answer_low_real, "1", "part of an answer to the probe so far")                                          \
  X(seen_probe_answer_low_imaginary, "1", "part of an answer to the probe so far")                                     \
  X(seen_probe_answer_middle_real, "1", "part of an answer to the probe so far")                                       \
  X(seen_probe_answer_middle_imaginary, "1", "part of an answer to the probe so far")                                  \
  X(seen_probe_answer_high_real, "1", "part of an answer to the probe so far")                                         \
  X(seen_probe_answer_high_imaginary, "1", "part of an answer to the probe so far")                                    \
  X(lived, "s", "duration of the run")                                                                                 \
  X(running, "s", "time with the law in force")                                                                        \
  X(started, "s", "time at which the law was first in force; negative: never")                                         \
  X(alarms, "1", "number of times that the supervisor acted in a healthy life")                                        \
  X(reached, "rad", "mean distance from the target at the end of a pause")                                             \
  X(energy_start, "J", "mechanical energy of robot, strap and limb at the start")                                      \
  X(energy_end, "J", "mechanical energy at the end")                                                                   \
  X(ringing, "N*m", "mean size of the effort's change in a period while the law is in force")

/// An alarm of a healthy life: X(name, unit, meaning).
#define FOREIGN_ALARMS(X)                                                                                              \
  X(time, "s", "time of the alarm")                                                                                    \
  X(fault, "1", "number of the fault that the supervisor named")                                                       \
  X(before, "1", "mode before the alarm: 0 where the test at start-up failed")                                         \
  X(event, "1", "what the wearer did in the last half second: 0 reach, 1 brace, 2 impact, 3 load, 4 spasm, 5 doffing") \
  X(speed, "rad/s", "largest true speed of the encoder's side in the last half second")                                \
  X(lowest, "rad", "lowest true position in the last half second")                                                     \
  X(highest, "rad", "highest true position in the last half second")                                                   \
  X(push, "N*m", "largest true torque of the wearer on the robot in the last half second")                             \
  X(lasting, "N*m", "largest true torque that lasts, smoothed with 5/s, in the last half second")

/// What a traced run tells of every second period: X(name, unit, meaning).
#define FOREIGN_TRACE(X)                                                                                               \
  X(position, "rad", "reading of the encoder")                                                                         \
  X(effort, "N*m", "mean command of the last two periods")                                                             \
  X(in_force, "1", "1: the law is in force")                                                                           \
  X(since, "s", "time since the onset of the fault; negative: before it")                                              \
  X(surplus, "J", "surplus of positive work on the limb over that of the reference since the onset")

struct Run {
#define X(name, unit, meaning) double name;
  FOREIGN_FIELDS(X)
#undef X
};

struct Result {
#define X(name, unit, meaning) double name;
  FOREIGN_RESULTS(X)
#undef X
};

struct Alarm {
#define X(name, unit, meaning) double name;
  FOREIGN_ALARMS(X)
#undef X
};

struct Traced {
#define X(name, unit, meaning) double name;
  FOREIGN_TRACE(X)
#undef X
};

enum class Fault {
#define X(name) name,
  FOREIGN_FAULTS(X)
#undef X
};

}  // namespace foreign
