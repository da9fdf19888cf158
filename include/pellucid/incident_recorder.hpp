// A recorder beside the supervisor: what was read, asked for and watched in the last seconds, kept when it stops.
//
// It is called after the supervisor's step and reads its state only, so that no bit of the supervisor depends on it. The
// memory for its records is the caller's. A record covers `decimation` periods: samples, effort and mode are those of
// its last period, and of each watch it keeps the period that came nearest to the threshold, so that nothing short is
// lost. The period in which the supervisor stops ends a record.
//
//   recording -> following -> frozen    where it stopped, `after` more records later
//        ^___________|___________|      when the record was read, or the supervisor was reset
//
// A call writes one record at most, whatever the memory holds: every index is compared with the memory's size first. No
// memory, or too little for one record, means that nothing is recorded. The recorder's own numbers are kept three times, so
// that no single bit that memory loses forgets a record.
#pragma once

#include "supervisor_watches.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// The caller's memory, in 32-bit words.
struct IncidentMemory {
  std::uint32_t* words = nullptr;  ///< where it begins
  std::size_t count = 0;           ///< how many there are
};

/// Mode of a recorder.
enum class IncidentPhase : std::uint8_t {
  recording,  ///< the ring goes round
  following,  ///< the supervisor has stopped; some records more
  frozen,     ///< nothing changes until the record was read or the supervisor was reset
};

constexpr std::uint32_t incident_alive = 0x1ec0bde5u;
constexpr std::uint32_t no_slot = 0xffffffffu;
constexpr std::uint32_t max_decimation = 1000000;

/// A recorder's own numbers.
struct IncidentRing {
  TwinWord alive{};              ///< word that says that it was started
  TwinWord decimation{};         ///< periods of a record
  TwinWord after{};              ///< records after the one in which the supervisor stopped
  std::uint32_t phase = 0;       ///< an IncidentPhase
  std::uint32_t slot = 0;        ///< place in the ring that is written now
  std::uint32_t whole = 0;       ///< records before it that are whole
  std::uint32_t filled = 0;      ///< periods that are in it so far
  std::uint32_t left = 0;        ///< records to go until it freezes
  std::uint32_t stop_slot = no_slot;  ///< place of the record in which the supervisor stopped
  std::uint32_t stopped = 1;     ///< 1: the supervisor had stopped in the period before
  std::uint32_t damages = 0;     ///< how often its own numbers were found damaged, and it began anew
};

/// The second and third copy of a recorder's own numbers, and what its watches remember.
template <class S> struct IncidentState : IncidentRing {
  IncidentRing copy[2]{};        ///< copies of its own numbers
  WatchedState<S> before{};      ///< values that the checks of the next period need
};
/// A recorder's own numbers, whatever single bit was lost.
template <class S> IncidentRing ring_of(const IncidentState<S>& r) noexcept {
  return voted(static_cast<const IncidentRing&>(r), r.copy[0], r.copy[1]);
}
template <class S> void put(IncidentState<S>& r, const IncidentRing& ring) noexcept {
  static_cast<IncidentRing&>(r) = r.copy[0] = r.copy[1] = ring;
}

/// Words of a record before its samples: time, period, what was said, effort, which samples are valid.
constexpr std::size_t record_head_words = 6;
constexpr std::size_t sample_words = 3;

/// Number of samples in a record of a law: its sensors, the drive and the second encoder.
template <class L> constexpr std::size_t record_samples = sensor_count<L> + 2;

/// Words of one record of a law.
template <class L>
constexpr std::size_t record_words = record_head_words + sample_words * record_samples<L> + 2 * watch_count;

/// Return the number of records that fit into a memory.
template <class L> constexpr std::uint32_t record_places(const IncidentMemory& memory) noexcept {
  const std::size_t places = memory.words == nullptr ? 0 : memory.count / record_words<L>;
  return places < 0x7fffffffu ? static_cast<std::uint32_t>(places) : 0x7fffffffu;
}

namespace detail {
inline void start_ring(IncidentRing& r) noexcept {
  r.phase = static_cast<std::uint32_t>(IncidentPhase::recording);
  r.slot = r.whole = r.filled = r.left = 0;
  r.stop_slot = no_slot;
}

/// A number as a float's bits; one that a float cannot hold becomes its largest.
template <class S> std::uint32_t float_word(S x) noexcept {
  constexpr float most = std::numeric_limits<float>::max();
  const float single = !is_finite(x)          ? (x > S(0)   ? std::numeric_limits<float>::infinity()
                                                 : x < S(0) ? -std::numeric_limits<float>::infinity()
                                                            : std::numeric_limits<float>::quiet_NaN())
                       : x > S(most)          ? most
                       : x < S(-most)         ? -most
                                              : static_cast<float>(x);
  std::uint32_t word;
  __builtin_memcpy(&word, &single, sizeof word);
  return word;
}
inline float word_float(std::uint32_t word) noexcept {
  float x;
  __builtin_memcpy(&x, &word, sizeof x);
  return x;
}

/// Whether a value is nearer to its threshold, or further beyond it, than another; what does not watch is never nearer.
inline bool is_nearer(float value, float threshold, float other, float others_threshold, WatchBound bound) noexcept {
  if (!is_finite(threshold) || !(other == other)) return false;
  const float a = bound == WatchBound::size && value < 0.0f ? -value : value;
  const float b = bound == WatchBound::size && other < 0.0f ? -other : other;
  if (bound == WatchBound::below) return !(a - threshold >= b - others_threshold);
  return !(a * others_threshold <= b * threshold);
}

/// Writes pairs of value and threshold, or keeps those of a period before that came nearer.
template <class S> struct KeepNearest {
  std::uint32_t* at;
  bool first;
  void keep(const ShownWatch<S>& shown) noexcept {
    const std::uint32_t value = float_word(shown.value), threshold = float_word(shown.threshold);
    if (first || !is_finite(word_float(at[1])) ||
        is_nearer(word_float(value), word_float(threshold), word_float(at[0]), word_float(at[1]), shown.watch.bound)) {
      at[0] = value;
      at[1] = threshold;
    }
    at += 2;
  }
  template <class... Shown> void operator()(const Shown&... shown) noexcept { (keep(shown), ...); }
};
}  // namespace detail

/// Begins with nothing recorded. `decimation` periods are a record; `after` records follow the one in which the
/// supervisor stops.
template <class S> void start(IncidentState<S>& r, std::uint32_t decimation, std::uint32_t after) noexcept {
  const IncidentState<S> fresh;
  r = fresh;
  IncidentRing ring;
  put(ring.decimation, decimation < 1 ? 1 : decimation > max_decimation ? max_decimation : decimation);
  put(ring.after, after);
  put(ring.alive, incident_alive);
  put(r, ring);
}

/// The record was read: it begins anew.
template <class S> void release(IncidentState<S>& r) noexcept {
  IncidentRing ring = ring_of(r);
  detail::start_ring(ring);
  put(r, ring);
}

/// Whether the supervisor stopped and all that was to follow is there.
constexpr bool is_frozen(const IncidentRing& r) noexcept {
  return r.phase == static_cast<std::uint32_t>(IncidentPhase::frozen);
}
template <class S> bool is_frozen(const IncidentState<S>& r) noexcept { return is_frozen(ring_of(r)); }

/// One period, after `step(s, read, back, now)` gave `out`.
template <class L, class S>
void note(IncidentState<S>& state, const IncidentMemory& memory, const Supervised<L>& s, const Samples<S>& read,
          const Feedback<S>& back, std::int64_t now, const SupervisorOutput<S>& out) noexcept {
  const std::uint32_t places = record_places<L>(memory);
  IncidentRing r = ring_of(state);
  if (places == 0 || (r.alive.word != incident_alive && r.alive.twin != ~incident_alive)) return;
  const bool sound = is_whole(r.alive) && is_whole(r.decimation) && is_whole(r.after) &&
                     r.slot < places && r.whole <= places && r.filled < r.decimation.word && r.left < places &&
                     r.phase <= static_cast<std::uint32_t>(IncidentPhase::frozen) &&
                     (r.stop_slot < places || r.stop_slot == no_slot);
  if (!sound) {
    const std::uint32_t damages = r.damages < 0xffffffffu ? r.damages + 1 : r.damages;
    const bool known = is_whole(r.decimation) && is_whole(r.after);
    start(state, known ? r.decimation.word : 1, known ? r.after.word : places / 2);
    r = ring_of(state);
    r.damages = damages;
  }

  const bool stopped = is_stopped(out.mode);
  const bool stops = stopped && r.stopped == 0;
  if (!stopped && r.phase != static_cast<std::uint32_t>(IncidentPhase::recording)) detail::start_ring(r);
  r.stopped = stopped ? 1 : 0;

  const WatchedPeriod<S> period{s.supervisor, s.controller.law.gate, s.state, state.before, read, back, now};
  WatchedState<S> next = state.before;
  note_before(period, next);
  if (!is_frozen(r)) {
    if (r.filled == 0 && r.whole == places) --r.whole;  // the oldest record makes room
    std::uint32_t* at = memory.words + r.slot * record_words<L>;
    at[0] = static_cast<std::uint32_t>(static_cast<std::uint64_t>(now));
    at[1] = static_cast<std::uint32_t>(static_cast<std::uint64_t>(now) >> 32);
    at[2] = out.beat;
    at[3] = static_cast<std::uint32_t>(out.mode) | static_cast<std::uint32_t>(out.fault) << 8 |
            static_cast<std::uint32_t>(out.enable ? 1 : 0) << 16;
    at[4] = detail::float_word(out.effort);
    std::uint32_t valid = 0;
    Samples<S> samples = read;
    for (std::size_t i = 0; i < record_samples<L>; ++i) {
      const Sample<S>& one = i < sensor_count<L> ? samples[L::sensors[i < sensor_count<L> ? i : 0].quantity]
                             : i == sensor_count<L> ? back.drive
                                                    : back.joint;
      std::uint32_t* to = at + record_head_words + sample_words * i;
      to[0] = detail::float_word(one.value);
      to[1] = static_cast<std::uint32_t>(age_of(now, one.time));
      to[2] = one.sequence;
      if (one.valid) valid |= 1u << i;
    }
    at[5] = valid;
    detail::KeepNearest<S> keep{at + record_head_words + sample_words * record_samples<L>, r.filled == 0};
    walk_watches(period, next, keep);

    if (stops) {
      r.phase = static_cast<std::uint32_t>(IncidentPhase::following);
      r.stop_slot = r.slot;
      r.left = (r.after.word < places ? r.after.word : places - 1) + 1;
    }
    if (++r.filled >= r.decimation.word || stops) {
      r.filled = 0;
      ++r.whole;
      r.slot = r.slot + 1 < places ? r.slot + 1 : 0;
      if (r.phase == static_cast<std::uint32_t>(IncidentPhase::following) && (r.left == 0 || --r.left == 0))
        r.phase = static_cast<std::uint32_t>(IncidentPhase::frozen);
    }
  }
  state.before = next;
  put(state, r);
}

constexpr std::uint32_t incident_version = 1;
/// "PELLINCI" in memory of a machine that writes its lowest byte first.
constexpr std::uint32_t incident_magic[] = {0x4c4c4550u, 0x49434e49u};

namespace detail {
/// Words one after another into a sink, with their checksum.
template <class Sink> struct WordStream {
  Sink& sink;
  std::uint32_t sum = checksum_start;
  std::uint32_t count = 0;
  bool good = true;
  std::uint32_t text = 0, letters = 0;
  void word(std::uint32_t w) noexcept {
    sum = checksum_of(sum, w);
    ++count;
    if (good) good = sink(w);
  }
  void letter(char c) noexcept {
    text |= static_cast<std::uint32_t>(static_cast<unsigned char>(c)) << (8 * (letters & 3u));
    if ((++letters & 3u) != 0) return;
    word(text);
    text = 0;
  }
  void say(const char* what) noexcept {
    for (; *what != '\0'; ++what) letter(*what);
  }
  void end_text() noexcept {
    while ((letters & 3u) != 0) letter('\n');
  }
  /// Powers of a unit, doubled so that those of a root are whole.
  void say(const Unit& unit) noexcept {
    const float powers[] = {unit.effort, unit.coordinate, unit.time};
    for (const float power : powers) {
      const int twice = static_cast<int>(2.0f * power);
      say(twice < 0 ? " -" : " ");
      letter(static_cast<char>('0' + (twice < 0 ? -twice : twice) % 10));
    }
  }
};
struct CountWords {
  bool operator()(std::uint32_t) const noexcept { return true; }
};
template <class Stream> struct SayWatches {
  Stream& to;
  template <class S> void say(const ShownWatch<S>& shown) noexcept {
    const Watch& w = shown.watch;
    to.say("watch ");
    to.say(w.name);
    to.say(" ");
    to.say(watch_bound_names[static_cast<std::size_t>(w.bound)]);
    to.say(" ");
    to.say(safety_fault_names[static_cast<std::size_t>(w.fault)]);
    to.say(w.unit);
    to.say(" ");
    to.say(w.sentence);
    to.say("\n");
  }
  template <class... Shown> void operator()(const Shown&... shown) noexcept { (say(shown), ...); }
};
template <class Stream> struct SayFields {
  Stream& to;
  template <class T> void operator()(const T&, const Field& f) noexcept {
    to.say("number ");
    to.say(f.before);
    to.say(f.name);
    to.say(f.after);
    to.say(f.unit);
    to.say("\n");
  }
};
template <class Stream> struct PutFields {
  Stream& to;
  template <class S> void operator()(const S& x, const Field&) noexcept { to.word(float_word(x)); }
  void operator()(const std::uint32_t& x, const Field&) noexcept { to.word(float_word(static_cast<float>(x))); }
};

/// Write the supervisor's part of the file, which is the same for every law: the rest of the text, and the numbers.
template <class S, class Stream>
void put_supervisor(const WatchedPeriod<S>& period, Stream& to) noexcept {
  for (const char* name : mode_names) {
    to.say("mode ");
    to.say(name);
    to.say("\n");
  }
  for (const char* name : safety_fault_names) {
    to.say("fault ");
    to.say(name);
    to.say("\n");
  }
  walk_watches(period, period.before, SayWatches<Stream>{to});
  SayFields<Stream> fields{to};
  walk(period.c.params, fields);
  to.end_text();
  PutFields<Stream> numbers{to};
  walk(period.c.params, numbers);
}

/// Everything of the file but its last word. `total` is how many words the file has.
template <class L, class S, class Stream>
void put_incident(const IncidentState<S>& state, const IncidentMemory& memory, const Supervised<L>& s, bool slides,
                  std::uint32_t text_words, std::uint32_t total, Stream& to) noexcept {
  const IncidentRing r = ring_of(state);
  const std::uint32_t places = record_places<L>(memory);
  const bool sound = r.slot < places && r.whole <= places;
  const std::uint32_t part = sound && r.filled != 0 ? 1 : 0;  // the record that is being written
  std::uint32_t whole = sound ? r.whole : 0;
  if (whole + part > places) whole = places - part;
  const std::uint32_t first = sound ? (r.slot + places - whole) % places : 0;
  const bool has_stop = sound && r.stop_slot < places;
  const std::uint32_t stop = has_stop ? (r.stop_slot + places - first) % places : no_slot;

  to.word(incident_magic[0]);
  to.word(incident_magic[1]);
  to.word(incident_version);
  to.word(total);
  to.word(text_words);
  to.word(static_cast<std::uint32_t>(field_count<SupervisorParams<double>>));
  to.word(static_cast<std::uint32_t>(record_words<L>));
  to.word(whole + part);
  to.word(stop < whole + part ? stop : no_slot);
  to.word(r.decimation.word);
  to.word(r.phase);
  to.word(r.damages);
  to.word(slides ? 1 : 0);
  to.word(float_word(s.supervisor.period));
  to.word(float_word(s.supervisor.effort_limit));
  to.word(faults_of(s.state));
  for (std::uint32_t i = 0; i < log_length; ++i) {
    const LoggedFault one = logged(s.state, i);
    to.word(one.step);
    to.word(static_cast<std::uint32_t>(one.mode) | static_cast<std::uint32_t>(one.fault) << 8);
  }
  to.say("law ");
  to.say(L::name);
  to.say("\n");
  for (std::size_t i = 0; i < sensor_count<L>; ++i) {
    const QuantityText& text = quantities[static_cast<std::size_t>(L::sensors[i].quantity)];
    to.say("sensor ");
    to.say(text.name);
    to.say(text.unit);
    to.say("\n");
  }
  to.say("sensor drive");
  to.say(unit::effort);
  to.say("\nsensor joint");
  to.say(unit::coordinate);
  to.say("\n");
  const Samples<S> nothing{};
  put_supervisor(WatchedPeriod<S>{s.supervisor, s.controller.law.gate, s.state, state.before, nothing, {}, 0}, to);
  for (std::uint32_t k = 0; k < whole + part; ++k) {
    const std::uint32_t place = (first + k) % places;
    for (std::size_t i = 0; i < record_words<L>; ++i) to.word(memory.words[place * record_words<L> + i]);
  }
}
}  // namespace detail

/// Writes the record as a file: calls sink(word) for each of its 32-bit words, which are to be written lowest byte
/// first, until it says false. `slides`: the joint is prismatic. Returns how many words were written, 0 where the sink
/// refused one. Nothing may call `note` meanwhile.
template <class L, class S, class Sink>
std::uint32_t write(const IncidentState<S>& r, const IncidentMemory& memory, const Supervised<L>& s, bool slides,
                    Sink&& sink) noexcept {
  detail::CountWords nowhere;
  detail::WordStream<detail::CountWords> counted{nowhere};
  detail::put_incident(r, memory, s, slides, 0, 0, counted);
  detail::WordStream<std::remove_reference_t<Sink>> to{sink};
  detail::put_incident(r, memory, s, slides, counted.letters / 4, counted.count + 1, to);
  to.word(to.sum);
  return to.good ? to.count : 0;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
