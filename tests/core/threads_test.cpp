// Threads that share what is constant, as the bindings do: under ThreadSanitizer, and the same bits as one thread.
#include "check.hpp"
#include "law_numbers.hpp"

#include "../../bindings/kernels.hpp"

#include <pellucid/pellucid.hpp>
#include <pellucid/supervisor.hpp>

#include <thread>
#include <vector>

namespace bindings {
namespace PELLUCID_ABI {
extern const Kernels kernels;
}
}  // namespace bindings

namespace {

namespace b = bindings;
namespace p = pellucid;

constexpr std::size_t rows = 96, samples = 50;

std::vector<double> simulated(const double* parameters, std::size_t threads) {
  const auto run = b::PELLUCID_ABI::kernels.simulate;
  double settings[b::setting_count] = {};
  settings[b::kp] = 20, settings[b::kd] = 1, settings[b::limit] = 10, settings[b::gain] = 1;
  std::vector<double> reference(samples), outputs(b::max_output_count * rows * samples);
  for (std::size_t i = 0; i < samples; ++i) reference[i] = 0.01 * static_cast<double>(i);
  b::Simulation s;
  s.rows = rows, s.samples = samples, s.parameters = {parameters, 0}, s.reference = {reference.data(), 0};
  for (std::size_t i = 0; i < b::setting_count; ++i) s.settings[i] = {settings + i, 0};
  s.period = 1e-3, s.substeps = 4, s.velocity_span = 1;
  for (std::size_t i = 0; i < b::max_output_count; ++i) s.output[i] = outputs.data() + i * rows * samples;
  std::vector<std::thread> others;
  for (std::size_t t = 1; t < threads; ++t)
    others.emplace_back([&s, run, t, threads] { run(s, t * rows / threads, (t + 1) * rows / threads); });
  run(s, 0, rows / threads);
  for (std::thread& other : others) other.join();
  return outputs;
}

bool same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) == 0;
}

void joints() {
  const double joint[p::parameter_count] = {0.05, 1.5,  -0.2, 0.05, 0.3,  0.25, 0.1,
                                             0.15, 0.12, 0.1,  0.08, 0.15, 0.02, 0.05};
  const auto one = simulated(joint, 1);
  double fastest = 0;
  for (std::size_t i = 0; i < samples; ++i) fastest = std::fmax(fastest, std::fabs(one[rows * samples + i]));
  check(fastest > 0.1, "it moves");
  check(same(one, simulated(joint, 3)), "three threads give one thread's bits");
}

/// Every law under its supervisor, twice at once from the same numbers.
void laws() {
  p::Laws::for_each([](auto of) {
    using L = typename decltype(of)::template law<double>;
    const auto params = typical_params<typename L::Params>();
    const p::SupervisorParams<double> rules;
    double sums[2] = {0, 0};
    const auto work = [&params, &rules](double& sum) {
      p::Supervised<L> law;
      p::configure(law, params, rules);
      for (std::uint32_t k = 1; k < 2000; ++k) {
        const std::int64_t now = 1000 * static_cast<std::int64_t>(k);
        const p::Sample<double> felt{0.1, now, k, true};
        sum += p::step(law, p::Samples<double>{{1.2 + 1e-4 * k, now, k, true}, felt, felt, felt}, {}, now).effort;
      }
    };
    std::thread other([&] { work(sums[1]); });
    work(sums[0]);
    other.join();
    check(sums[0] == sums[1] && sums[0] != 0, L::name);
  });
}

}  // namespace

int main() {
  joints();
  laws();
  return failures();
}
