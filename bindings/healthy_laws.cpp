// Worn laws of a robot on which nothing is wrong.
#include "worn_laws.hpp"

namespace bindings {

template void step_worn_law(AnySupervised<double>&, const pellucid::Samples<double>&, double, double, std::int64_t,
                            Healthy&, pellucid::SupervisorOutput<double>&, LawCommand*);

}  // namespace bindings
