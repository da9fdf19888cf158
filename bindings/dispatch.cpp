// The best kernels that this processor runs. PELLUCID_INSTRUCTIONS=baseline|avx2|avx512 in the environment lowers it.
#include "hill_kernels.hpp"
#include "kernels.hpp"
#include "tree_kernels.hpp"

#include <cstdlib>
#include <cstring>

namespace bindings {
namespace baseline {
extern const Kernels kernels;
extern const HillKernels hill_kernels;
extern const TreeKernels tree_kernels;
}  // namespace baseline
namespace avx2 {
extern const Kernels kernels;
extern const HillKernels hill_kernels;
extern const TreeKernels tree_kernels;
}  // namespace avx2
namespace avx512 {
extern const Kernels kernels;
extern const HillKernels hill_kernels;
extern const TreeKernels tree_kernels;
}  // namespace avx512

#if defined(__x86_64__)
namespace {
template <class K> const K& best(const K& baseline, const K& avx2, const K& avx512) {
  const char* wanted = std::getenv("PELLUCID_INSTRUCTIONS");
  const auto at_most = [wanted](const char* level) { return wanted == nullptr || std::strcmp(wanted, level) == 0; };
  const bool has_avx2 = __builtin_cpu_supports("avx2");
  const bool has_avx512 = has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                          __builtin_cpu_supports("avx512vl");
  if (has_avx512 && at_most("avx512")) return avx512;
  if (has_avx2 && (at_most("avx2") || at_most("avx512"))) return avx2;
  return baseline;
}
}  // namespace

const Kernels& best_kernels() { return best(baseline::kernels, avx2::kernels, avx512::kernels); }
const HillKernels& best_hill_kernels() {
  return best(baseline::hill_kernels, avx2::hill_kernels, avx512::hill_kernels);
}
const TreeKernels& best_tree_kernels() {
  return best(baseline::tree_kernels, avx2::tree_kernels, avx512::tree_kernels);
}
#else
const Kernels& best_kernels() { return baseline::kernels; }
const HillKernels& best_hill_kernels() { return baseline::hill_kernels; }
const TreeKernels& best_tree_kernels() { return baseline::tree_kernels; }
#endif

}  // namespace bindings
