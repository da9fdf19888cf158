// The most that friction resists by: powers, one-way numbers of which the larger counts, and the order of sums.
#include "check.hpp"

#include <pellucid/resistance.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

template <class S> void powers() {
  check(p::power(S(3), 0.0f) == S(1) && p::power(S(3), 1.0f) == S(3) && p::power(S(3), 2.0f) == S(9), "whole powers");
  check(p::power(S(9), 0.5f) == S(3) && p::power(S(9), 1.5f) == S(27) && p::power(S(4), 2.5f) == S(32), "roots");
  for (const S x : {S(0.3), S(0.7), S(1.3), S(2.9), S(11.1), S(123.4)})
    check(p::power(x, 0.5f) == p::sqrt(x) && p::power(x, 1.5f) == x * p::sqrt(x), "roots to the bit");
  check(std::fabs(p::power(S(16), 0.25f) - S(2)) < S(1e-5), "others");
  check(std::fabs(p::power(S(16), 1.75f) - S(128)) < S(1e-3), "and between");
  check(p::power(S(0.25), 0.75f) < S(0.354) && p::power(S(0.25), 0.75f) > S(0.353), "below 1");
  check(p::power(S(0), 0.25f) == S(0) && p::power(S(0), 0.5f) == S(0) && p::power(S(0), 0.0f) == S(1), "of nothing");
  check(p::power(S(0), 1.0f) == S(0) && p::power(S(-1), 0.25f) == S(0), "never of less than nothing");
}

template <class S> void sums() {
  using p::Resists;
  p::ResistanceSums<S, 4> r;
  r.add(Resists{}, S(99));
  check(r.count == 0 && r.at(S(1), S(1)) == S(0), "what is no friction does not count");
  r.add(p::by::level, S(-0.5));
  r.add(p::by::level, S(0.25));
  check(r.count == 1 && r.coefficient(0) == S(0.75), "sizes add up");
  r.add(p::by::speed.only_one_way(), S(2));
  r.add(p::by::speed.only_one_way(), S(-3));
  r.add(p::by::speed.only_one_way(), S(2));
  check(r.count == 2 && r.coefficient(1) == S(3), "of one-way numbers the larger");
  r.add(p::by::load, S(0.5));
  check(r.count == 3 && r.coefficient(2) == S(0.5), "a power of the load is another");
  r.add(Resists{true, 1, 1}, S(0.125));
  r.add(p::by::root_of_speed, S(77));
  check(r.count == 4 && r.coefficient(3) == S(0.125), "no more powers than there is room for");
  r.add(p::by::level, S(0.25));
  check(r.coefficient(0) == S(1), "known powers go on");
  r.add(p::by::speed, S(1));
  check(r.coefficient(1) == S(4) && r.larger[1] == S(3) && r.both[1] == S(1), "both kinds together");
  check(r.at(S(2), S(8)) == S(1) + S(8) + S(4) + S(2), "all of them");
  check(r.at(S(0), S(0)) == S(1), "at rest");
  check(r.powers[1].one_way && !r.powers[0].one_way, "which is which");
  // One-way powers come first: a number so large that what is added to it by itself is lost.
  const S large = sizeof(S) == 8 ? S(0x1p53) : S(0x1p24);
  p::ResistanceSums<S, 4> order;
  order.add(p::by::level, S(1));
  order.add(p::by::load, S(1));
  order.add(p::by::speed.only_one_way(), large);
  check(order.at(S(1), S(1)) == large, "and the order of sums is fixed");
}

}  // namespace

int main() {
  powers<double>();
  powers<float>();
  sums<double>();
  sums<float>();
  return failures();
}
