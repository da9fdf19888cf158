// What a program for one exported folder is given beside the folder: its numbers, and where its memory lies.
#pragma once

#include "pellucid_controller.h"

#include <cstddef>

namespace foreign {

/// The numbers that the export wrote into pellucid_constants.h.
const pellucid_config& exported_config();

/// Where parts of the controller lie in pellucid_context.storage, in bytes: what a flipped bit may hit, and
/// the work of the test at start-up.
struct MemoryMap {
  std::size_t law, law_size, supervisor, supervisor_size, mode, law_state, test_middle;
};
MemoryMap memory_map();

}  // namespace foreign
