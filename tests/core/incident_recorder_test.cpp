// The recorder of incidents: what a record holds, when the ring stops, and that nothing depends on it.
#include "check.hpp"
#include "law_numbers.hpp"

#include <pellucid/incident_recorder.hpp>
#include <pellucid/joint_compensation.hpp>
#include <pellucid/transparent_compensation.hpp>

#include <string>
#include <vector>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using M = p::Mode;
template <class S> using Joint = p::JointCompensation<S>;
template <class S> using Transparent = p::TransparentCompensation<S>;
constexpr double never = std::numeric_limits<double>::infinity();
const double nan = std::numeric_limits<double>::quiet_NaN();

template <class S> p::SupervisorParams<S> watches() {
  p::SupervisorParams<S> w;
  w.encoder = {S(6), S(2000), S(-1), S(4), S(1e-4), S(0.5), 20};
  w.body.inertia = S(0.05);
  w.body.wearer_torque = S(20);
  w.body.wearer_push = S(40);
  w.body.force_tolerance = w.body.force_burst = w.body.force_excess = S(20);
  w.drive.expected = 1;
  w.drive.tolerance = S(0.5);
  w.drive.limit = S(10);
  w.drive.surplus = S(0.3);
  w.budget = {S(9), S(40), S(5), S(0.5)};
  w.ringing.limit = S(2);
  w.hold = {};
  w.hold.damping = S(1);
  w.hold.limit = S(5);
  w.reset_delay = S(0.05);
  w.rest_speed = S(2);
  w.healthy_samples = 10;
  return w;
}

/// A law that is worn by a smooth motion, and by what a test adds to it.
template <template <class> class L, class S> struct Life {
  p::Supervised<L<S>> law;
  p::IncidentState<S> recorder;
  std::vector<std::uint32_t> memory;
  std::int64_t now = 0;
  std::uint32_t sequence = 0;
  S position = S(1);
  p::SupervisorOutput<S> out;

  explicit Life(std::uint32_t places, std::uint32_t decimation = 1, std::uint32_t after = 5,
                const p::SupervisorParams<S>& w = watches<S>())
      : memory(places * p::record_words<L<S>>) {
    auto params = typical_params<typename L<S>::Params>();
    params.gate.position_min = S(-2);
    p::configure(law, params, w);
    p::start(recorder, decimation, after);
  }
  p::IncidentMemory words() { return {memory.empty() ? nullptr : memory.data(), memory.size()}; }
  template <class Change> p::SupervisorOutput<S> step(Change&& change) {
    now += 1000;
    ++sequence;
    position = static_cast<S>(1.0 + 0.3 * std::sin(2e-6 * static_cast<double>(now)));
    const p::Sample<S> still{static_cast<S>(1e-6 * sequence), now, sequence, true};
    p::Samples<S> read{{position, now, sequence, true}, still, still, still};
    p::Feedback<S> back{{law.state.output, now, sequence, true}, {position, now, sequence, true}, 0};
    change(read, back);
    out = p::step(law, read, back, now);
    p::note(recorder, words(), law, read, back, now, out);
    return out;
  }
  p::SupervisorOutput<S> step() {
    return step([](auto&, auto&) {});
  }
  void run(int periods) {
    for (int k = 0; k < periods; ++k) step();
  }
  std::uint32_t head(std::uint32_t place, std::size_t word) { return memory[place * p::record_words<L<S>> + word]; }
};

struct Named {
  std::size_t at = 0;
  const char* name;
  std::size_t found = ~std::size_t(0);
  p::Watch watch{};
  template <class... Shown> void operator()(const Shown&... shown) {
    ((std::strcmp(shown.watch.name, name) == 0 ? void((found = at, watch = shown.watch)) : void(), ++at), ...);
  }
};
template <class L> p::Watch watch_named(const L& life, const char* name, std::size_t* place = nullptr) {
  Named named{0, name};
  using S = p::scalar_of<typename decltype(life.law)::Law>;
  p::walk_watches(p::WatchedPeriod<S>{life.law.supervisor, life.law.controller.law.gate, life.law.state,
                                      life.recorder.before, {}, {}, 0},
                  life.recorder.before, named);
  check(named.found < p::watch_count, name);
  if (place != nullptr) *place = named.found;
  return named.watch;
}
template <template <class> class L, class S>
void shown(Life<L, S>& life, std::uint32_t place, const char* name, float& value, float& threshold) {
  std::size_t at;
  watch_named(life, name, &at);
  const std::size_t word = p::record_head_words + p::sample_words * p::record_samples<L<S>> + 2 * at;
  value = p::detail::word_float(life.head(place, word));
  threshold = p::detail::word_float(life.head(place, word + 1));
}

// --- the ring --------------------------------------------------------------------------------------------------------

void a_record_holds_its_period() {
  Life<Joint, double> life(4);
  life.run(2);
  check(life.recorder.whole == 2 && life.recorder.slot == 2 && life.recorder.filled == 0, "two records");
  check(life.head(1, 0) == 2000 && life.head(1, 1) == 0 && life.head(1, 2) == 2, "time and period");
  check((life.head(1, 3) & 0xff) == static_cast<std::uint32_t>(M::running), "mode");
  check((life.head(1, 3) >> 16 & 1) == 1, "power");
  check(p::detail::word_float(life.head(1, 4)) == static_cast<float>(life.out.effort), "effort");
  check(life.head(1, 5) == 7, "position, drive and joint are valid");
  check(p::detail::word_float(life.head(1, 6)) == static_cast<float>(life.position), "position");
  check(life.head(1, 7) == 0 && life.head(1, 8) == 2, "age and number");
  Life<Joint, double> old(4);  // a clock of six hours has more than 32 bits of microseconds
  old.now = (std::int64_t(5) << 32) + 6000;
  old.step();
  check(old.head(0, 0) == 7000 && old.head(0, 1) == 5, "both halves of its time");
  life.step([](auto& read, auto&) { read.position.time -= 700; });
  check(life.head(2, 7) == 700, "age");
  life.step([](auto& read, auto&) { read.position.valid = false; });
  check((life.head(3, 5) & 1) == 0, "what no sensor vouches for");
  life.run(1);
  check(life.recorder.whole == 4 && life.recorder.slot == 1 && life.head(0, 2) == 5, "round and round");
}

void decimation_keeps_what_came_nearest() {
  Life<Joint, double> life(6, 10);
  life.run(1000);
  check(life.recorder.whole == 6 && life.recorder.filled == 0, "a hundred records of ten periods");
  for (int k = 0; k < 9; ++k) {
    life.step([&](auto&, auto& back) { back.drive.value += k == 4 ? 0.4 : 0.0; });
    check(life.recorder.filled == static_cast<std::uint32_t>(k) + 1 && life.recorder.whole == 5, "not yet whole");
  }
  life.run(1);
  check(life.recorder.filled == 0 && life.recorder.whole == 6, "whole");
  const std::uint32_t place = life.recorder.slot == 0 ? 5 : life.recorder.slot - 1;
  float value, threshold;
  shown(life, place, "drive_difference", value, threshold);
  check_close(value, 0.4f, 0.02f, "the fifth of ten periods");
  check(threshold > 0.4f && threshold < 3.0f, "its own threshold");
  check(life.head(place, 2) == life.out.beat, "the rest is of the last");
}

void no_memory_is_off() {
  Life<Joint, double> life(0), other(3);
  for (int k = 0; k < 300; ++k) {
    const auto a = life.step(), b = other.step();
    check(std::memcmp(&a.effort, &b.effort, sizeof a.effort) == 0 && a.fault == b.fault, "the same bits");
  }
  check(std::memcmp(&life.law.state.own_sum, &other.law.state.own_sum, sizeof life.law.state.own_sum) == 0, "checksums");
  check(life.recorder.whole == 0 && life.recorder.slot == 0, "nothing");
  const p::IncidentMemory small{other.memory.data(), p::record_words<Joint<double>> - 1};
  check(p::record_places<Joint<double>>(small) == 0, "one word too few");
  check(p::record_places<Joint<double>>({nullptr, 1000}) == 0, "nowhere");
}

void it_freezes_after_a_stop() {
  for (const std::uint32_t decimation : {1u, 7u}) {
    Life<Joint, double> life(20, decimation, 5);
    life.run(500);
    p::stop(life.law);
    life.step();
    check(p::is_stopped(life.out.mode) && !p::is_frozen(life.recorder), "it goes on");
    const std::uint32_t beat = life.out.beat, stop = life.recorder.stop_slot;
    check(life.head(stop, 2) == beat && life.recorder.filled == 0, "the stop ends a record");
    life.run(static_cast<int>(5 * decimation) - 1);
    check(!p::is_frozen(life.recorder), "not yet");
    life.run(1);
    check(p::is_frozen(life.recorder) && life.recorder.whole == 20, "five records later");
    const std::vector<std::uint32_t> kept = life.memory;
    life.run(200);
    check(kept == life.memory, "nothing more");
    p::release(life.recorder);
    life.run(3);
    check(!(kept == life.memory) && life.recorder.phase == 0, "when it was read");
  }
  Life<Joint, double> life(4, 1, 100);
  life.run(50);
  p::stop(life.law);
  life.run(40);
  check(p::is_frozen(life.recorder), "no more after it than there are places");
  check(life.head(life.recorder.stop_slot, 2) == 51, "so that the stop stays");
  Life<Joint, double> none(4, 1, 0);
  none.run(50);
  p::stop(none.law);
  none.step();
  check(p::is_frozen(none.recorder), "at once");
}

/// The ring as documented, kept as a list of records that never ends: what a file must hold after any history.
struct RingModel {
  std::uint32_t places, decimation, after;
  std::vector<std::uint32_t> records{};  // last period of each
  std::uint32_t filled = 0, follow = 0;
  std::size_t stop = ~std::size_t(0);
  bool was_stopped = true, following = false, frozen = false;

  void begin() {
    records.clear();
    filled = 0;
    stop = ~std::size_t(0);
    following = frozen = false;
  }
  void note(std::uint32_t beat, bool stopped) {
    if (!stopped && (following || frozen)) begin();
    const bool stops = stopped && !was_stopped;
    was_stopped = stopped;
    if (frozen) return;
    if (filled == 0) records.push_back(beat);
    records.back() = beat;
    ++filled;
    if (stops) {
      following = true;
      stop = records.size() - 1;
      follow = (after < places ? after : places - 1) + 1;
    }
    if (filled != decimation && !stops) return;
    filled = 0;
    if (following && --follow == 0) frozen = true;
  }
  std::vector<std::uint32_t> kept() const {
    const std::size_t n = records.size() < places ? records.size() : places;
    return {records.end() - static_cast<std::ptrdiff_t>(n), records.end()};
  }
  std::uint32_t stop_place() const {
    const std::size_t lost = records.size() - kept().size();
    return stop == ~std::size_t(0) || stop < lost ? p::no_slot : static_cast<std::uint32_t>(stop - lost);
  }
};

template <class Law, class State> std::vector<std::uint32_t> file_of(const State& recorder, const p::IncidentMemory& memory, const Law& law) {
  std::vector<std::uint32_t> file;
  p::write(recorder, memory, law, false, [&](std::uint32_t word) {
    file.push_back(word);
    return true;
  });
  return file;
}

/// Any history of stops and resets, for any memory, decimation and number of records after the stop.
void any_history_of_stops() {
  using L = Joint<double>;
  Life<Joint, double> life(1);
  life.run(5);
  Random random(20261117);
  constexpr std::size_t words = p::record_words<L>;
  for (std::uint32_t places = 1; places <= 5; ++places)
    for (std::uint32_t decimation = 1; decimation <= 4; ++decimation)
      for (const std::uint32_t after : {0u, 1u, places - 1, places, 2 * places + 1}) {
        std::vector<std::uint32_t> memory(places * words + 1, 0);
        p::IncidentState<double> recorder;
        p::start(recorder, decimation, after);
        RingModel model{places, decimation, after};
        bool stopped = true;
        for (std::uint32_t beat = 1; beat <= 100; ++beat) {
          if (random.uniform() < (stopped ? 0.12 : 0.06)) stopped = !stopped;
          if (random.uniform() < 0.04) {
            p::release(recorder);
            model.begin();
          }
          p::SupervisorOutput<double> out{};
          out.mode = stopped ? M::zero : M::running;
          out.beat = beat;
          p::note(recorder, {memory.data(), memory.size()}, life.law, {}, {}, 1000 * beat, out);
          model.note(beat, stopped);
          check(p::is_frozen(recorder) == model.frozen && recorder.damages == 0, "frozen as the list says");
          if (beat % 3 != 0) continue;
          const auto file = file_of(recorder, {memory.data(), memory.size()}, life.law);
          const auto kept = model.kept();
          check(file[7] == kept.size() && file[8] == model.stop_place(), "records and the place of the stop");
          check(file[9] == decimation && file[10] == (model.frozen ? 2u : model.following ? 1u : 0u), "decimation and phase");
          const std::size_t first = 32 + file[4] + file[5];
          for (std::size_t i = 0; i < kept.size() && i < file[7]; ++i) check(file[first + i * words + 2] == kept[i], "the oldest first");
        }
        check(memory.back() == 0, "nothing beyond its memory");
      }
}

/// Whatever the recorder's own numbers are, the file has the records from the oldest, and the stop among them.
void any_place_of_the_ring() {
  constexpr std::uint32_t places = 4;
  constexpr std::size_t words = p::record_words<Joint<double>>;
  Life<Joint, double> life(places, 3);
  life.run(2);
  for (std::uint32_t place = 0; place < places; ++place) life.memory[place * words + 2] = 100 + place;
  for (std::uint32_t slot = 0; slot <= places; ++slot)
    for (std::uint32_t whole = 0; whole <= places + 1; ++whole)
      for (const std::uint32_t filled : {0u, 2u})
        for (std::uint32_t stop = 0; stop <= places; ++stop) {
          p::IncidentRing ring = p::ring_of(life.recorder);
          ring.slot = slot, ring.whole = whole, ring.filled = filled, ring.stop_slot = stop;
          p::put(life.recorder, ring);
          std::vector<std::uint32_t> kept;
          if (slot < places && whole <= places) {
            const std::uint32_t part = filled != 0 ? 1 : 0, left = whole + part > places ? places - part : whole;
            for (std::uint32_t i = 0; i < left + part; ++i) kept.push_back((slot + places - left + i) % places);
          }
          std::uint32_t found = p::no_slot;
          for (std::uint32_t i = 0; i < kept.size(); ++i)
            if (kept[i] == stop) found = i;
          const auto file = file_of(life.recorder, life.words(), life.law);
          check(file[7] == kept.size() && file[8] == found, "as many, and the stop");
          const std::size_t first = 32 + file[4] + file[5];
          for (std::size_t i = 0; i < kept.size() && i < file[7]; ++i) check(file[first + i * words + 2] == 100 + kept[i], "in their order");
        }
}

/// Every word of a record before its watches, of a law with several sensors, for samples of all kinds.
void every_word_of_a_record() {
  using L = Transparent<float>;
  constexpr std::size_t sensors = p::sensor_count<L>, words = p::record_words<L>;
  Life<Transparent, float> life(3);
  Random random(20261118);
  for (int k = 0; k < 200; ++k) {
    if (k > 100) p::release(life.recorder);
    const std::uint32_t place = life.recorder.slot;
    p::Samples<float> asked;
    p::Feedback<float> fed;
    life.step([&](auto& read, auto& back) {
      for (std::size_t i = 0; i < sensors; ++i) read[L::sensors[i].quantity].valid = random.uniform() < 0.7;
      for (std::size_t i = 0; i < sensors; ++i) read[L::sensors[i].quantity].time -= static_cast<std::int64_t>(random.uniform(-3000, 3000));
      back.drive.valid = random.uniform() < 0.5;
      back.joint.valid = random.uniform() < 0.5;
      back.joint.sequence += 7;
      if (k == 100) read.position.value = 1e30f;
      asked = read;
      fed = back;
    });
    const std::uint32_t* at = life.memory.data() + place * words;
    const std::uint32_t said = at[3];
    check(at[2] == life.out.beat && (said & 0xff) == static_cast<std::uint32_t>(life.out.mode) &&
              (said >> 8 & 0xff) == static_cast<std::uint32_t>(life.out.fault) && said >> 16 == (life.out.enable ? 1u : 0u),
          "what was said");
    for (std::size_t i = 0; i < sensors + 2; ++i) {
      const p::Sample<float>& one = i < sensors ? asked[L::sensors[i].quantity] : i == sensors ? fed.drive : fed.joint;
      float value;
      std::memcpy(&value, &at[6 + 3 * i], sizeof value);
      check(value == one.value && static_cast<std::int32_t>(at[7 + 3 * i]) == life.now - one.time && at[8 + 3 * i] == one.sequence, "a sample");
      check((at[5] >> i & 1) == (one.valid ? 1u : 0u), "whether it is valid");
    }
    check(at[5] >> (sensors + 2) == 0, "of no other sample");
  }
  check(p::fault_of(life.law.state) != F::none, "a fault, too");
  const auto file = file_of(life.recorder, life.words(), life.law);
  for (std::uint32_t i = 0; i < p::log_length; ++i) {
    const p::LoggedFault one = p::logged(life.law.state, i);
    check(file[16 + 2 * i] == one.step && (file[17 + 2 * i] & 0xff) == static_cast<std::uint32_t>(one.mode) &&
              file[17 + 2 * i] >> 8 == static_cast<std::uint32_t>(one.fault),
          "the log of faults");
  }
}

/// Numbers of a start that make no sense are brought to those that do.
void any_decimation() {
  for (const std::uint32_t asked : {0u, 1u, 2u, p::max_decimation - 1, p::max_decimation, p::max_decimation + 1, 0xffffffffu}) {
    p::IncidentState<double> recorder;
    p::start(recorder, asked, 3);
    const std::uint32_t wanted = asked == 0 ? 1 : asked > 1000000 ? 1000000 : asked;
    check(recorder.decimation.word == wanted && recorder.after.word == 3 && recorder.stopped == 1, "from 1 to a million periods");
  }
  std::uint32_t word = 0;
  using L = Joint<double>;
  check(p::record_places<L>({&word, std::numeric_limits<std::size_t>::max()}) == 0x7fffffffu, "as many as 31 bits count");
  for (std::size_t n = 1; n < 5; ++n)
    check(p::record_places<L>({&word, n * p::record_words<L>}) == n && p::record_places<L>({&word, (n + 1) * p::record_words<L> - 1}) == n, "whole records");
}

/// A recorder of which one word says that it was started records on; one of which neither does never was.
void words_of_a_start() {
  for (const bool word : {false, true})
    for (const bool twin : {false, true}) {
      Life<Joint, double> life(4);
      life.run(10);
      for (p::IncidentRing* one : {static_cast<p::IncidentRing*>(&life.recorder), &life.recorder.copy[0]}) {
        if (word) one->alive.word ^= 1u;
        if (twin) one->alive.twin ^= 1u;
      }
      const auto memory = life.memory;
      life.step();
      check(life.recorder.damages == (word != twin ? 1u : 0u), "one that was started is found damaged");
      check((life.memory == memory) == (word && twin), "one that never was records nothing");
      check(life.recorder.whole == (word == twin ? 4u : 1u), "damage begins anew");
    }
}

void a_reset_begins_anew() {
  Life<Joint, double> life(8, 1, 2);
  life.run(100);
  p::stop(life.law);
  life.run(20);
  check(p::is_frozen(life.recorder), "frozen");
  for (int k = 0; k < 200 && p::is_stopped(life.out.mode); ++k)
    life.step([&](auto&, auto& back) { back.token = life.out.challenge; });
  check(!p::is_stopped(life.out.mode) && !p::is_frozen(life.recorder) && life.recorder.whole == 1, "reset");
  life.run(20);
  p::stop(life.law);
  life.run(20);
  check(p::is_frozen(life.recorder), "the next stop is recorded");
}

// --- what the watches show ---------------------------------------------------------------------------------------------

/// The largest of value over threshold among the watches of a fault, in one record.
template <template <class> class L, class S> struct Share {
  Life<L, S>& life;
  std::uint32_t place;
  F fault;
  std::size_t at = 0;
  float share = -1;
  void look(const p::Watch& w) {
    const std::size_t word = p::record_head_words + p::sample_words * p::record_samples<L<S>> + 2 * at++;
    const float value = p::detail::word_float(life.head(place, word));
    const float threshold = p::detail::word_float(life.head(place, word + 1));
    if (w.fault != fault || !p::is_finite(threshold)) return;
    float one = (w.bound == p::WatchBound::size ? std::fabs(value) : value) / threshold;
    if (w.bound == p::WatchBound::below) one = value < threshold ? 1.5f : 0.5f;
    if (!(one <= share)) share = one;
  }
  template <class... Shown> void operator()(const Shown&... all) { (look(all.watch), ...); }
};

/// A watch that has found something is beyond its threshold in the record of the stop, and the others are not.
template <template <class> class L, class S> int watches_say_what_was_found(std::uint64_t seed) {
  Random random(seed);
  int stops = 0;
  for (int life_number = 0; life_number < 40; ++life_number) {
    auto w = watches<S>();
    w.force.expected = life_number % 2 == 0 ? 1 : 0;
    w.force.range = S(25);
    w.joint_expected = life_number % 3 == 0 ? 1 : 0;
    w.joint_tolerance = S(0.02);
    if (life_number % 4 == 3) w.body.wearer_torque = S(2), w.body.wearer_push = S(4);
    if (life_number % 4 == 2) w.unexplained.limit = S(2);
    if (life_number % 5 == 2) w.budget = {S(0.5), S(1), S(0.05), S(0)};
    if (life_number % 5 == 4) w.budget.steady = S(0), w.budget.store = S(1e-3);
    Life<L, S> life(30, 1, 0, w);
    life.run(400);
    const int kind = static_cast<int>(random.uniform(0, 10));
    const S size = static_cast<S>(random.uniform(0.05, 8));
    S held = life.position, drift = 0;
    for (int k = 0; k < 600 && !p::is_frozen(life.recorder); ++k)
      life.step([&](auto& read, auto& back) {
        switch (kind) {
          case 0: read.position.value += size; break;
          case 1: read.position.value = held; break;
          case 2: read.position.value += (drift += static_cast<S>(1e-4) * size); break;
          case 3: back.drive.value = -back.drive.value; break;
          case 4: back.drive.value += size; break;
          case 5: back.drive.valid = false; break;
          case 6: back.joint.value += (drift += static_cast<S>(1e-4) * size); break;
          case 7: read.interaction.value = 20 * size; break;
          case 8: read.position.time -= 20000; break;
          default: break;
        }
      });
    if (!p::is_frozen(life.recorder)) continue;
    ++stops;
    F said = p::fault_of(life.law.state);
    if (said == F::drive_sign || said == F::drive_stuck) said = F::drive_effort;
    if (said == F::out_of_order || said == F::not_finite || said == F::velocity) continue;
    Share<L, S> share{life, life.recorder.stop_slot, said};
    p::walk_watches(p::WatchedPeriod<S>{life.law.supervisor, life.law.controller.law.gate, life.law.state,
                                        life.recorder.before, {}, {}, 0},
                    life.recorder.before, share);
    if (!(share.share >= 1)) std::printf("life %d kind %d: %s shows %g\n", life_number, kind,
                                         p::safety_fault_names[static_cast<int>(said)], static_cast<double>(share.share));
    check(share.share >= 1, "beyond its threshold");
    // In the records before, no watch was.
    for (std::uint32_t place = 0; place < life.recorder.whole; ++place) {
      if (place == life.recorder.stop_slot) continue;
      for (int fault = 0; fault < static_cast<int>(p::safety_fault_count); ++fault) {
        if (fault == static_cast<int>(F::force_sensor) || fault == static_cast<int>(F::lost)) continue;  // they have turns
        Share<L, S> before{life, place, static_cast<F>(fault)};
        p::walk_watches(p::WatchedPeriod<S>{life.law.supervisor, life.law.controller.law.gate, life.law.state,
                                            life.recorder.before, {}, {}, 0},
                        life.recorder.before, before);
        const bool slow = fault == static_cast<int>(F::drive_effort);  // a difference may last for some periods
        if (!slow && !(before.share <= 1.0001f))
          std::printf("life %d kind %d said %s, place %u: %s %g\n", life_number, kind,
                      p::safety_fault_names[static_cast<int>(said)], place, p::safety_fault_names[fault],
                      static_cast<double>(before.share));
        check(slow || before.share <= 1.0001f, "not before");
      }
    }
  }
  return stops;
}

void numbers_that_are_none() {
  Life<Transparent, float> life(6, 3, 2);
  life.run(50);
  life.step([](auto& read, auto& back) {
    read.position.value = std::numeric_limits<float>::quiet_NaN();
    back.drive.value = std::numeric_limits<float>::infinity();
    read.interaction.value = -std::numeric_limits<float>::infinity();
  });
  check(life.out.fault == F::not_finite, "found");
  const std::uint32_t stop = life.recorder.stop_slot;
  check(stop < 6 && !(p::detail::word_float(life.head(stop, 6)) == p::detail::word_float(life.head(stop, 6))), "NaN stays");
  check(p::detail::word_float(p::detail::float_word(1e300)) == std::numeric_limits<float>::max(), "larger than a float");
  const double just_above = 1.5 * static_cast<double>(std::numeric_limits<float>::max());
  check(p::detail::word_float(p::detail::float_word(just_above)) == std::numeric_limits<float>::max(), "just above a float");
  check(p::detail::word_float(p::detail::float_word(-1e300)) == -std::numeric_limits<float>::max(), "smaller");
  for (const double share : {0.25, 0.75, 1.0, 1.25, 1.75, 2.5, 1e9})
    for (const double way : {-1.0, 1.0}) {
      const double most = static_cast<double>(std::numeric_limits<float>::max());
      const float wanted = static_cast<float>(way * (share < 1 ? share * most : most));
      check(p::detail::word_float(p::detail::float_word(way * share * most)) == wanted, "at most the largest float");
    }
  check(p::detail::word_float(p::detail::float_word(never)) == std::numeric_limits<float>::infinity(), "infinite upwards");
  check(p::detail::word_float(p::detail::float_word(-never)) == -std::numeric_limits<float>::infinity(), "infinite");
  const float nothing = p::detail::word_float(p::detail::float_word(nan));
  check(!(nothing == nothing), "none");
  using B = p::WatchBound;
  const float none = std::numeric_limits<float>::quiet_NaN(), far = std::numeric_limits<float>::infinity();
  check(p::detail::is_nearer(-3, 4, 1, 4, B::size) && !p::detail::is_nearer(-3, 4, 1, 4, B::above), "size");
  check(!p::detail::is_nearer(1, 4, -3, 4, B::size) && p::detail::is_nearer(1, 4, -3, 4, B::above), "size of the other");
  check(p::detail::is_nearer(1, 2, 3, 8, B::above) && !p::detail::is_nearer(3, 8, 1, 2, B::above), "by share");
  check(p::detail::is_nearer(1, 2, 3, 2, B::below) && !p::detail::is_nearer(3, 2, 1, 2, B::below), "below");
  check(!p::detail::is_nearer(1, 2, 2, 4, B::above) && !p::detail::is_nearer(2, 4, 1, 2, B::above), "the first of two that are as near");
  check(!p::detail::is_nearer(1, 2, 3, 4, B::below) && !p::detail::is_nearer(3, 4, 1, 2, B::below), "below, too");
  check(p::detail::is_nearer(1, 3, 1, 2, B::below) && !p::detail::is_nearer(1, 2, 1, 3, B::below), "by each one's threshold");
  check(p::detail::is_nearer(0.5f, 2, 3, 4, B::below) && !p::detail::is_nearer(3, 4, 0.5f, 2, B::below), "further beyond");
  check(p::detail::is_nearer(5, 4, 4, 2, B::below) && !p::detail::is_nearer(4, 2, 5, 4, B::below), "nearer on this side");
  for (const B bound : {B::size, B::above, B::below}) {
    p::Watch watch{};
    watch.bound = bound;
    std::uint32_t kept[2];
    const auto keep = [&](bool begins, float value, float threshold) {
      p::detail::KeepNearest<float>{kept, begins}.keep({value, threshold, watch});
      return p::detail::word_float(kept[0]);
    };
    check(keep(true, -7, far) == -7 && keep(false, -3, 4) == -3, "the first that watches takes the place of one that does not");
    check(keep(false, -9, far) == -3 && keep(true, 1, 4) == 1, "one that does not watch takes no place; the first one does");
  }
  check(!p::detail::is_nearer(0, 1, 0, 1, B::size) && !p::detail::is_nearer(-2, 4, 1, 2, B::size), "sizes that are as near");
  check(p::detail::is_nearer(none, 1, 5, 1, B::above) && !p::detail::is_nearer(5, 1, none, 1, B::above), "NaN is beyond");
  check(!p::detail::is_nearer(9, far, 0, 1, B::above), "does not watch");
  check(p::age_of(5, 3) == 2 && p::age_of(3, 5) == -2, "ages");
  const std::int64_t first = std::numeric_limits<std::int64_t>::min(), last = std::numeric_limits<std::int64_t>::max();
  check(p::age_of(last, 0) == 0x7fffffff && p::age_of(0, last) == -0x7fffffff, "as far as 32 bits");
  check(p::age_of(last, first) == -1 && p::age_of(0, 0) == 0, "around");
}

/// The push that is shown: effort beyond the weight that a law carries, and beyond friction.
void a_push_is_beyond_weight_and_friction() {
  Life<Joint, double> life(2);
  life.run(10);
  auto& s = life.law.state;
  s.steps = 1;
  s.body.weight = 1;
  s.body.drag = 0.25;
  p::WatchedState<double> before = life.recorder.before, next = before;
  const auto pushed = [&](M mode, double effort) {
    before.mode = static_cast<decltype(before.mode)>(mode);
    before.drive.asked = before.drive.asked_before = effort;
    p::note_before(p::WatchedPeriod<double>{life.law.supervisor, life.law.controller.law.gate, s, before, {}, {}, 0}, next);
    return next.pushed;
  };
  check_close(pushed(M::running, 3), 1.75, 1e-12, "with the weight");
  check_close(pushed(M::degraded, -3), 3.75, 1e-12, "against the weight");
  check_close(pushed(M::zero, 3), 2.75, 1e-12, "a stop carries no weight");
}

/// A sample that comes again lends the speed's threshold no more than a new one does.
void a_repeated_sample_keeps_the_threshold() {
  Life<Joint, double> life(8);
  life.run(20);
  std::size_t at;
  watch_named(life, "raw_speed", &at);
  const auto threshold = [&] {
    const std::uint32_t place = life.recorder.slot == 0 ? 7 : life.recorder.slot - 1;
    const std::size_t word = p::record_head_words + p::sample_words * p::record_samples<Joint<double>> + 2 * at;
    return p::detail::word_float(life.head(place, word + 1));
  };
  const float usual = threshold();
  check(p::is_finite(usual) && usual > 0, "it watches");
  p::Sample<double> last;
  life.step([&](auto& read, auto&) { last = read.position; });
  life.step([&](auto& read, auto&) { read.position = last; });
  check_close(threshold(), usual, 1e-6f, "as of any other sample");
}

/// Damages a number of a recorder in more copies than one, which no vote mends.
void damage(p::IncidentRing& r, p::IncidentRing* copy, std::uint32_t p::IncidentRing::*number, std::uint32_t value) {
  r.*number = copy[0].*number = value;
}

/// A place of the stop that damage put just beyond the memory is no stop in the file.
void a_stop_beyond_the_memory() {
  Life<Joint, double> life(4);
  life.run(6);  // around once, so that the place would be one of a sample that is kept
  damage(life.recorder, life.recorder.copy, &p::IncidentRing::stop_slot, 4);
  std::vector<std::uint32_t> file;
  p::write(life.recorder, life.words(), life.law, false, [&](std::uint32_t word) {
    file.push_back(word);
    return true;
  });
  check(file[8] == p::no_slot, "no stop");
}

/// A place of the next record that damage put just beyond the memory leaves no record in the file.
void a_place_beyond_the_memory() {
  Life<Joint, double> life(4);
  life.run(6);
  damage(life.recorder, life.recorder.copy, &p::IncidentRing::slot, 4);
  std::vector<std::uint32_t> file;
  p::write(life.recorder, life.words(), life.law, false, [&](std::uint32_t word) {
    file.push_back(word);
    return true;
  });
  check(file[7] == 0, "no record");
}

/// A record shows how far the position is from the middle of its range, or the position itself where one end is open.
void the_range_of_positions() {
  for (const bool open : {false, true}) {
    auto w = watches<double>();
    w.encoder.range_min = open ? -std::numeric_limits<double>::infinity() : 0.2;
    w.encoder.range_max = 2.2;
    Life<Joint, double> life(4, 1, 0, w);
    life.run(2);
    float value, threshold;
    shown(life, 1, "range", value, threshold);
    check_close(value, static_cast<float>(open ? life.position : life.position - 1.2), 1e-5f, "from the middle");
    check(open ? !p::is_finite(threshold) : std::fabs(threshold - 1.0f) < 1e-6f, "half of the range");
  }
}

/// What damage left just beyond its bound is found, and the recording begins anew.
void damage_at_each_bound() {
  for (int field = 0; field < 6; ++field) {
    Life<Joint, double> life(4, 3);
    life.run(30);
    using R = p::IncidentRing;
    std::uint32_t R::*const numbers[] = {&R::slot, &R::whole, &R::filled, &R::left, &R::phase, &R::stop_slot};
    const std::uint32_t beyond[] = {4, 5, 3, 4, 3, 4};
    damage(life.recorder, life.recorder.copy, numbers[field], beyond[field]);
    life.step();
    check(life.recorder.damages == 1, "found");
  }
  for (p::TwinWord p::IncidentRing::*const pair : {&p::IncidentRing::decimation, &p::IncidentRing::after}) {
    Life<Joint, double> life(4, 3);
    life.run(30);
    (life.recorder.*pair).twin ^= 4u;
    (life.recorder.copy[0].*pair).twin ^= 4u;
    life.step();
    check(life.recorder.damages == 1, "a pair that differs is found, too");
  }
}

/// What is not known any more is the shortest record, and half of the memory after a stop; a stop that was found stays.
void what_damage_leaves() {
  for (const auto pair : {&p::IncidentRing::decimation, &p::IncidentRing::after}) {
    Life<Joint, double> life(6, 3, 5);
    life.run(30);
    for (p::IncidentRing* one : {static_cast<p::IncidentRing*>(&life.recorder), &life.recorder.copy[0]}) (one->*pair).word ^= 8u;
    life.step();
    check(life.recorder.damages == 1 && life.recorder.decimation.word == 1 && life.recorder.after.word == 3, "begins with what is safe");
  }
  Life<Joint, double> known(6, 3, 5);
  known.run(30);
  damage(known.recorder, known.recorder.copy, &p::IncidentRing::slot, 9);
  known.step();
  check(known.recorder.damages == 1 && known.recorder.decimation.word == 3 && known.recorder.after.word == 5, "with what is known");
  damage(known.recorder, known.recorder.copy, &p::IncidentRing::slot, 9);
  known.step();
  check(known.recorder.damages == 2, "each is counted");
  Life<Joint, double> following(6, 1, 4);
  following.run(30);
  p::stop(following.law);
  following.run(2);
  damage(following.recorder, following.recorder.copy, &p::IncidentRing::left, 0);
  following.step();
  check(p::is_frozen(following.recorder) && following.recorder.damages == 0, "none left to follow: frozen");
}

/// No single bit of a recorder's own numbers that is lost forgets the record of a stop.
void every_bit_of_a_frozen_recorder() {
  Life<Joint, double> life(8, 2, 3);
  life.run(40);
  p::stop(life.law);
  life.run(20);
  check(p::is_frozen(life.recorder), "frozen");
  const auto frozen = life.recorder;
  const auto memory = life.memory;
  constexpr std::size_t bits = 8 * (sizeof(p::IncidentState<double>) - sizeof(p::WatchedState<double>));
  for (std::size_t bit = 0; bit < bits; ++bit) {
    life.recorder = frozen;
    reinterpret_cast<unsigned char*>(&life.recorder)[bit / 8] ^= static_cast<unsigned char>(1u << bit % 8);
    check(p::is_frozen(life.recorder), "still frozen");
    life.run(3);
    check(p::is_frozen(life.recorder) && life.recorder.damages == 0 && life.memory == memory, "and kept");
  }
}

// --- memory that is damaged --------------------------------------------------------------------------------------------

void damaged_memory() {
  constexpr std::uint32_t fence = 0xfe9ce000u;
  Random random(20261111);
  long damages = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const auto places = static_cast<std::uint32_t>(random.uniform(1, 9));
    Life<Joint, float> life(places + 1, 1 + static_cast<std::uint32_t>(random.uniform(0, 5)),
                            static_cast<std::uint32_t>(random.uniform(0, 12)));
    const std::size_t words = places * p::record_words<Joint<float>>;
    for (std::size_t i = words; i < life.memory.size(); ++i) life.memory[i] = fence;
    const p::IncidentMemory memory{life.memory.data(), words};
    for (int k = 0; k < 200; ++k) {
      if (random.uniform() < 0.1) {
        unsigned char* bytes = reinterpret_cast<unsigned char*>(&life.recorder);
        const auto at = static_cast<std::size_t>(random.uniform() * sizeof life.recorder);
        const auto value = static_cast<unsigned char>(random.bits());
        bytes[at] = value;
        // In two copies at once, which no vote mends.
        if (at < sizeof(p::IncidentRing)) bytes[at + sizeof(p::IncidentRing)] = value;
      }
      if (random.uniform() < 0.1)
        life.memory[static_cast<std::size_t>(random.uniform() * static_cast<double>(words))] =
            static_cast<std::uint32_t>(random.bits());
      if (random.uniform() < 0.02) p::stop(life.law);
      life.now += 1000;
      ++life.sequence;
      p::Samples<float> read = p::position_only(1.0f, life.now, life.sequence);
      const p::Feedback<float> back{{life.law.state.output, life.now, life.sequence, true}, {}, life.out.challenge};
      life.out = p::step(life.law, read, back, life.now);
      p::note(life.recorder, memory, life.law, read, back, life.now, life.out);
      std::uint32_t written = 0;
      if (k % 20 == 0)
        p::write(life.recorder, memory, life.law, false, [&](std::uint32_t) {
          ++written;
          return true;
        });
    }
    damages += life.recorder.damages;
    for (std::size_t i = words; i < life.memory.size(); ++i) check(life.memory[i] == fence, "beyond the memory");
  }
  check(damages > 0, "found and begun anew");
}

// --- the file ----------------------------------------------------------------------------------------------------------

void a_file() {
  Life<Transparent, float> life(8, 2, 3);
  life.run(101);
  p::stop(life.law);
  life.run(40);
  std::vector<std::uint32_t> file;
  const auto sink = [&](std::uint32_t word) {
    file.push_back(word);
    return true;
  };
  const std::uint32_t written = p::write(life.recorder, life.words(), life.law, true, sink);
  check(written == file.size() && file[3] == written, "its length");
  check(file[0] == p::incident_magic[0] && file[1] == p::incident_magic[1] && file[2] == 1, "magic and version");
  check(std::memcmp(file.data(), "PELLINCI", 8) == 0, "as text");
  check(file[6] == p::record_words<Transparent<float>> && file[7] == 8 && file[8] == 4, "records; the stop is before three");
  check(file[9] == 2 && file[10] == 2 && file[11] == 0 && file[12] == 1, "decimation, phase, damages, prismatic");
  check(p::detail::word_float(file[13]) == 1e-3f && p::detail::word_float(file[14]) == 10.0f, "period and limit");
  std::uint32_t sum = p::checksum_start;
  for (std::size_t i = 0; i + 1 < file.size(); ++i) sum = p::checksum_of(sum, file[i]);
  check(sum == file.back(), "checksum");
  const std::string text(reinterpret_cast<const char*>(file.data() + 32), 4 * file[4]);
  check(text.find("law transparent\nsensor position 0 2 0\n") == 0, "law and sensors");
  check(text.find("watch ringing above ringing 2 0 0 ") != std::string::npos, "watches");
  check(text.find("number force_expected 0 0 0\n") != std::string::npos, "numbers with their first names");
  check(text.find("number body_square_root 2 -1 1\n") != std::string::npos, "powers of a root");
  const std::size_t numbers = 32 + file[4];
  check(numbers + file[5] + file[6] * file[7] + 1 == file.size(), "text, numbers, records and checksum are all");
  check(p::detail::word_float(file[numbers]) == 6.0f, "the first number is raw_speed_limit");
  std::uint32_t beat = 0;
  for (std::uint32_t i = 0; i < file[7]; ++i) {
    const std::uint32_t next = file[numbers + file[5] + i * file[6] + 2];
    check(next > beat, "oldest first");
    beat = next;
  }
  check(file[numbers + file[5] + file[8] * file[6] + 2] == 102, "the stop");
  int words = 0;
  check(p::write(life.recorder, life.words(), life.law, true, [&](std::uint32_t) { return ++words < 10; }) == 0, "refused");
  check(words == 10, "and not asked again");
  file.clear();
  Life<Joint, double> none(0);
  none.run(3);
  check(p::write(none.recorder, none.words(), none.law, false, sink) == file.size() && file[7] == 0, "without records");
  file.clear();
  Life<Joint, double> part(5, 10);
  part.run(23);
  p::write(part.recorder, part.words(), part.law, false, sink);
  check(file[7] == 3 && file[8] == p::no_slot, "the record that is not whole is the last");
  check(file[file.size() - 1 - p::record_words<Joint<double>> + 2] == 23, "with its last period");
}

/// A text of any length ends on a whole word, filled up with line feeds, so that what follows begins where it is expected.
void texts_end_on_words() {
  for (std::uint32_t letters = 0; letters <= 8; ++letters) {
    std::uint32_t last = 0, words = 0;
    const auto sink = [&last, &words](std::uint32_t word) {
      last = word;
      ++words;
      return true;
    };
    p::detail::WordStream<decltype(sink)> stream{sink};
    for (std::uint32_t k = 0; k < letters; ++k) stream.letter('a');
    stream.end_text();
    check(words == (letters + 3) / 4 && words == stream.count, "whole words");
    const std::uint32_t filled = letters % 4;
    const std::uint32_t wanted[] = {0x61616161u, 0x0a0a0a61u, 0x0a0a6161u, 0x0a616161u};
    check(letters == 0 || last == wanted[filled], "filled up with line feeds");
  }
}

}  // namespace

int main() {
  texts_end_on_words();
  a_record_holds_its_period();
  any_history_of_stops();
  any_place_of_the_ring();
  every_word_of_a_record();
  any_decimation();
  words_of_a_start();
  decimation_keeps_what_came_nearest();
  no_memory_is_off();
  it_freezes_after_a_stop();
  a_reset_begins_anew();
  int stops = 0;
  for (const std::uint64_t seed : {20261101u, 20261102u, 20261103u}) {
    stops += watches_say_what_was_found<Joint, double>(seed);
    stops += watches_say_what_was_found<Transparent, float>(seed);
  }
  check(stops > 100, "faults enough");
  numbers_that_are_none();
  a_push_is_beyond_weight_and_friction();
  a_repeated_sample_keeps_the_threshold();
  a_stop_beyond_the_memory();
  a_place_beyond_the_memory();
  the_range_of_positions();
  damage_at_each_bound();
  what_damage_leaves();
  every_bit_of_a_frozen_recorder();
  damaged_memory();
  a_file();
  return failures();
}
