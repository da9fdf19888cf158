// A fuzz target without a fuzzer: bytes that look random and are the same everywhere, and the files that are named.
#include "../check.hpp"

#include <cstdlib>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int count, char** files) {
  for (int i = 1; i < count; ++i) {
    std::FILE* file = std::fopen(files[i], "rb");
    if (file == nullptr) return std::printf("%s: cannot be read\n", files[i]), 1;
    std::vector<std::uint8_t> bytes;
    for (int c = std::fgetc(file); c != EOF; c = std::fgetc(file)) bytes.push_back(static_cast<std::uint8_t>(c));
    std::fclose(file);
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
  Random random(71);
  for (int run = 0; run < 3000; ++run) {
    std::vector<std::uint8_t> bytes(1 + random.bits() % 200);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.bits() >> 32);
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
  return 0;
}
