// The drive's watchdog: power while the controller counts, and a stated number of periods longer.
#include "check.hpp"

#include <pellucid/watchdog.hpp>

namespace p = pellucid;

int main() {
  p::Watchdog w;
  check(p::step(w, 7, true, 3) && w.silent == 0, "a beat gives power");
  for (int k = 1; k <= 3; ++k) check(p::step(w, 7, true, 3), "silence is borne for so many periods");
  check(!p::step(w, 7, true, 3) && !p::step(w, 7, true, 3), "and no longer");
  check(p::step(w, 8, true, 3) && w.silent == 0, "the next beat gives power again");
  check(!p::step(w, 9, false, 3), "not without the controller's word");
  check(!p::step(w, 9, false, 3) && w.silent == 1, "silence is counted all the same");
  check(p::step(w, 0, true, 0) && !p::step(w, 0, true, 0), "no patience, no period more");
  check(p::step(w, 0xffffffffu, true, 3) && p::step(w, 0, true, 3), "a count may wrap around");
  // No single bit that its memory loses gives the power back.
  p::Watchdog off;
  for (int k = 0; k < 6; ++k) p::step(off, 7, true, 3);
  for (std::uint32_t bit = 0; bit < 96; ++bit) {
    p::Watchdog one = off;
    (bit < 32 ? one.beat : bit < 64 ? one.silent : one.check) ^= 1u << bit % 32;
    for (int k = 0; k < 6; ++k) check(!p::step(one, 7, true, 3), "a lost bit");
    check(p::step(one, 8, true, 3), "the next beat");
  }
  return failures();
}
