// Worn laws of a robot on which one thing goes wrong.
#include "single_fault.hpp"
#include "worn_laws.hpp"

namespace bindings {

template void step_worn_law(AnySupervised<double>&, const pellucid::Samples<double>&, double, double, std::int64_t,
                            SingleFault&, pellucid::SupervisorOutput<double>&, LawCommand*);

}  // namespace bindings
