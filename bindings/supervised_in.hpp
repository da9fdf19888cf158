// Every law of the list under its supervisor, in one scalar: what supervised_double.cpp and supervised_float.cpp compile.
#pragma once

#include "supervised.hpp"

#include <pellucid/incident_recorder.hpp>

#include <cmath>
#include <vector>

namespace bindings {
namespace {

/// Takes the words of a file, lowest byte first. One type and one function, for it is called at some hundred places.
struct FileBytes {
  std::vector<unsigned char>& file;
  [[gnu::noinline]] bool operator()(std::uint32_t word) {
    for (int i = 0; i < 4; ++i) file.push_back(static_cast<unsigned char>(word >> (8 * i)));
    return true;
  }
};

template <class L, class S> class SupervisedIn : public Supervised {
 public:
  SupervisedIn(nb::handle parameters, nb::handle supervisor) { configure(parameters, supervisor); }
  std::size_t sensors() const override { return pellucid::sensor_count<L>; }
  bool configure(nb::handle parameters, nb::handle supervisor) override {
    const bool sound = pellucid::configure(law_, read_params<typename L::Params, S>("parameters", parameters),
                                           read_params<pellucid::SupervisorParams<S>, S>("supervisor", supervisor));
    out.mode = pellucid::mode_of(law_.state);
    out.fault = pellucid::fault_of(law_.state);
    return sound;
  }
  void adjust(nb::handle parameters) override {
    pellucid::adjust(law_, read_params<typename L::Params, S>("parameters", parameters));
  }
  double step_now(double time, const double* values, double drive, double joint, std::uint32_t token) override {
    const bool sound = std::fabs(time) < 9e12;  // microseconds that 64 bits hold; false for NaN
    const std::int64_t now = sound ? std::llround(time * 1e6) : 0;
    pellucid::Samples<S> samples;
    for (std::size_t i = 0; i < pellucid::sensor_count<L>; ++i)
      samples[L::sensors[i].quantity] = {static_cast<S>(values[i]), 0, 0, sound && !std::isnan(values[i])};
    pellucid::Feedback<S> back;
    const auto sequence = law_.state.steps;
    back.drive = {static_cast<S>(drive), now, sequence, sound && !std::isnan(drive)};
    back.joint = {static_cast<S>(joint), now, sequence, sound && !std::isnan(joint)};
    back.token = token;
    return run(pellucid::stamped(law_, samples, now), back, now);
  }
  double step_samples(std::int64_t now, const pellucid::Sample<double>* from, std::size_t count, std::uint32_t token) override {
    const auto sample = [&](std::size_t i) {
      return i < count ? pellucid::Sample<S>{static_cast<S>(from[i].value), from[i].time, from[i].sequence, from[i].valid}
                       : pellucid::Sample<S>{};
    };
    constexpr std::size_t n = pellucid::sensor_count<L>;
    pellucid::Samples<S> samples;
    for (std::size_t i = 0; i < n; ++i) samples[L::sensors[i].quantity] = sample(i);
    return run(samples, pellucid::Feedback<S>{sample(n), sample(n + 1), token}, now);
  }
  void stop() override { pellucid::stop(law_); }
  nb::tuple probe_answer() const override {
    const auto& s = law_.state.probe;
    const auto wave = [&s](int i) {
      return nb::make_tuple(static_cast<double>(s.known[i].real), static_cast<double>(s.known[i].imaginary));
    };
    return nb::make_tuple(wave(0) + wave(1) + wave(2), s.learnt);
  }
  nb::dict estimates() const override { return estimates_of<L>(law_.controller.state); }
  nb::list log() const override {
    nb::list list;
    for (std::uint32_t i = 0; i < pellucid::log_length && i < pellucid::faults_of(law_.state); ++i) {
      const pellucid::LoggedFault one = pellucid::logged(law_.state, i);
      list.append(nb::make_tuple(one.step, fault_name(one.fault), pellucid::mode_names[static_cast<std::size_t>(one.mode)]));
    }
    return list;
  }

  void record(std::uint32_t records, std::uint32_t decimation, std::uint32_t after) override {
    words_.assign(std::size_t(records) * pellucid::record_words<L>, 0);
    pellucid::start(recorder_, decimation, after);
  }
  bool is_recorded() const override { return pellucid::is_frozen(recorder_); }
  nb::bytes incident(bool slides) override {
    std::vector<unsigned char> file;
    FileBytes sink{file};
    pellucid::write(recorder_, memory(), law_, slides, sink);
    pellucid::release(recorder_);
    return nb::bytes(reinterpret_cast<const char*>(file.data()), file.size());
  }

 private:
  pellucid::IncidentMemory memory() { return {words_.empty() ? nullptr : words_.data(), words_.size()}; }
  double run(const pellucid::Samples<S>& samples, const pellucid::Feedback<S>& back, std::int64_t now) {
    const pellucid::SupervisorOutput<S> o = pellucid::step(law_, samples, back, now);
    pellucid::note(recorder_, memory(), law_, samples, back, now, o);
    out = {static_cast<double>(o.effort), o.beat, o.challenge, o.fault, o.mode, o.enable};
    return out.effort;
  }
  pellucid::Supervised<L> law_;
  pellucid::IncidentState<S> recorder_;
  std::vector<std::uint32_t> words_;
};

}  // namespace

template <class S>
std::unique_ptr<Supervised> make_supervised(const std::string& name, nb::handle parameters, nb::handle supervisor) {
  std::unique_ptr<Supervised> made;
  with_law(name, [&](auto of) {
    made = std::make_unique<SupervisedIn<typename decltype(of)::template law<S>, S>>(parameters, supervisor);
  });
  return made;
}

}  // namespace bindings
