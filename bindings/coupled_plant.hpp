// The coupled plant as a Python class.
#pragma once

#include <pellucid/coupled_plant.hpp>

#include <nanobind/nanobind.h>

namespace bindings {

/// Parameters of a coupled plant as Python gives them; ValueError where they cannot be.
pellucid::CoupledPlantParams<double> read_coupled_plant(nanobind::handle parameters, double period,
                                                        nanobind::handle substeps, nanobind::handle delay,
                                                        nanobind::handle torque_span);

/// CoupledPlant and COUPLED_PARAMETER_NAMES into the module.
void add_coupled_plant(nanobind::module_& m);

}  // namespace bindings
