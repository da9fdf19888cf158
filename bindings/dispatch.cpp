// The best kernels that this processor runs. PELLUCID_INSTRUCTIONS=baseline|avx2|avx512 in the environment lowers it.
#include "kernels.hpp"

#include <cstdlib>
#include <cstring>

namespace bindings {
namespace baseline {
extern const Kernels kernels;
}
namespace avx2 {
extern const Kernels kernels;
}
namespace avx512 {
extern const Kernels kernels;
}

const Kernels& best_kernels() {
#if defined(__x86_64__)
  const char* wanted = std::getenv("PELLUCID_INSTRUCTIONS");
  const auto at_most = [wanted](const char* level) { return wanted == nullptr || std::strcmp(wanted, level) == 0; };
  const bool has_avx2 = __builtin_cpu_supports("avx2");
  const bool has_avx512 = has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                          __builtin_cpu_supports("avx512vl");
  if (has_avx512 && at_most("avx512")) return avx512::kernels;
  if (has_avx2 && (at_most("avx2") || at_most("avx512"))) return avx2::kernels;
#endif
  return baseline::kernels;
}

}  // namespace bindings
