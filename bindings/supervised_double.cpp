// Supervised laws in double.
#include "supervised_in.hpp"

namespace bindings {

template std::unique_ptr<Supervised> make_supervised<double>(const std::string&, nb::handle, nb::handle);

}  // namespace bindings
