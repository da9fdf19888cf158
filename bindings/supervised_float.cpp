// Supervised laws in float.
#include "supervised_in.hpp"

namespace bindings {

template std::unique_ptr<Supervised> make_supervised<float>(const std::string&, nb::handle, nb::handle);

}  // namespace bindings
