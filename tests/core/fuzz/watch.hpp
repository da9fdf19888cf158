// What every command of a gated controller is held to, found out anew: nothing here is taken from the gate but its limits.
#pragma once

#include "stream.hpp"

#include <cstdio>
#include <cstdlib>

/// Counted over a whole run, said at its end.
struct Tally {
  long long cycles = 0, faults = 0, moving = 0;
  ~Tally() {
    std::printf("%lld cycles, %lld faults, %lld with a command, none unsafe\n", cycles, faults, moving);
  }
};
inline Tally& tally() {
  static Tally all;
  return all;
}

/// Ends the run where something is not as it must be: a fuzzer then keeps the bytes that did it.
inline void require(bool holds, const char* what, int line = __builtin_LINE(), const char* file = __builtin_FILE()) {
  if (holds) return;
  std::fprintf(stderr, "%s:%d: not so: %s\n", file, line, what);
  std::abort();
}

/// Whether a stream of samples may be believed, by the words of the gate's parameters.
template <class S> class Believed {
 public:
  explicit Believed(const pellucid::SafetyParams<S>& rules) : rules_(rules) {}
  void reset() { started_ = false; }

  /// False where a sample must shut the gate.
  bool operator()(const pellucid::Sample<S>& in) {
    if (!pellucid::is_heard(in)) return false;
    const std::int64_t gap = in.time - time_;  // times are a quarter of what 64 bits hold
    const auto ahead = static_cast<std::int32_t>(in.sequence - sequence_);
    const double oldest = static_cast<double>(rules_.max_age);
    if (started_ && (ahead < 0 || gap < 0)) return false;
    const bool again = started_ && (ahead == 0 || gap == 0);
    repeats_ = again ? repeats_ + 1 : 0;
    if (again && (repeats_ > static_cast<long>(rules_.max_repeats) ||
                  static_cast<double>(repeats_) * static_cast<double>(rules_.period) > oldest * 1.000001))
      return false;
    if (started_ && !again && oldest < 2000 && 1e-6 * static_cast<double>(gap) > oldest * 1.000001 + 1e-6) return false;
    sequence_ = in.sequence;
    if (!again) time_ = in.time;
    started_ = true;
    return true;
  }

 private:
  pellucid::SafetyParams<S> rules_;
  std::int64_t time_ = 0;
  std::uint32_t sequence_ = 0;
  long repeats_ = 0;
  bool started_ = false;
};

/// Follows one controller, command by command.
template <class S> class Watch {
  using Fault = pellucid::SafetyFault;

 public:
  Watch(const pellucid::SafetyParams<S>& limits, bool sound) : limits_(limits), believed_(limits), sound_(sound) {}
  void reset() {
    believed_.reset();
    fault_ = Fault::none;
  }

  void operator()(const pellucid::Samples<S>& in, S out, Fault fault, bool may_be_believed = true) {
    ++tally().cycles;
    tally().moving += out != S(0);
    require(std::isfinite(out), "the command is a number");
    if (!sound_) {
      require(out == S(0) && fault == Fault::configuration, "nonsense is not run");
      return;
    }
    if (std::isfinite(in.position.value)) place_ = in.position.value;
    const S most = limits_.rate_limit * limits_.period;
    const S slack = S(4) * std::numeric_limits<S>::epsilon() * (limits_.effort_limit + std::fabs(most));
    require(std::fabs(out) <= limits_.effort_limit, "within the limit");
    require(!(out > S(0) && place_ >= limits_.position_max), "no push into the upper stop");
    require(!(out < S(0) && place_ <= limits_.position_min), "no push into the lower stop");
    // Near a stop a push into it may be taken back faster than the rate.
    const bool taken_back =
        std::fabs(out) < std::fabs(before_) && !(out * before_ < S(0)) &&
        (before_ > S(0) ? limits_.position_max - place_ < limits_.stop_margin * S(1.0001) + slack
                        : place_ - limits_.position_min < limits_.stop_margin * S(1.0001) + slack);
    require(taken_back || std::fabs(out - before_) <= most + slack, "within the rate");

    if (!(may_be_believed && (fault_ != Fault::none || believed_(in.position))))
      require(fault != Fault::none, "what may not be believed shuts the gate in its own cycle");
    if (fault_ != Fault::none) require(fault == fault_, "a fault latches");
    if (fault != Fault::none) {
      const S left = std::fabs(before_) - most;
      require(std::fabs(out) <= (left > S(0) ? left : S(0)) + slack, "from the fault's own cycle on, it ramps to 0");
      tally().faults += fault_ == Fault::none;
    }
    fault_ = fault;
    before_ = out;
  }

 private:
  pellucid::SafetyParams<S> limits_;
  Believed<S> believed_;
  bool sound_;
  Fault fault_ = Fault::none;
  S before_{}, place_{};
};

/// What a target is: a controller, its numbers and its samples from bytes, every command watched.
template <class S> void run(Bytes& bytes);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  if (bytes.byte() % 2 == 0) run<double>(bytes);
  else run<float>(bytes);
  return 0;
}
