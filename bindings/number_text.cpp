// Rows of numbers with so many decimals each, as a C library writes them, and several times as fast.
#include "number_text.hpp"

#include "arrays.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace bindings {
namespace {

constexpr const char* number_rows_doc =
    R"(Text of rows of numbers, separated by commas, each row with its line end.

Every number is rounded as the format ``%.kf`` of C rounds it. A column without decimals has no
sign of a zero. NaN, a missing sample, becomes an empty cell.

Parameters
----------
values : (n, m)
    Numbers, any unit.
decimals : (m,)
    Decimals of each column, 0 to 15.

Returns
-------
bytes
    ASCII.)";

constexpr int most_decimals = 15;
constexpr double powers[most_decimals + 1] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                              1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};

constexpr std::uint64_t tens[most_decimals + 1] = {
    1,         10,         100,         1000,         10000,         100000,         1000000,         10000000,
    100000000, 1000000000, 10000000000, 100000000000, 1000000000000, 10000000000000, 100000000000000, 1000000000000000};

/// Room for one number and what follows it: the largest has 309 digits before the point.
constexpr std::size_t most_characters = 340;

/// Four digits of every number below ten thousand, and room to read four from the last digit on.
struct FourDigits {
  char text[4 * 10000 + 4];
};

constexpr FourDigits four_digits() {
  FourDigits made{};
  for (int i = 0; i < 10000; ++i)
    for (int k = 3, rest = i; k >= 0; --k, rest /= 10) made.text[4 * i + k] = static_cast<char>('0' + rest % 10);
  return made;
}

constexpr FourDigits digits_of = four_digits();

/// The last decimal that is needed, as a whole number; false where rounding of the product could change it.
bool scaled(double size, int decimals, std::uint64_t& whole) {
  const double product = size * powers[decimals];
  if (!(product < 1e15)) return false;
  const std::int64_t down = static_cast<std::int64_t>(product);
  const double rest = product - static_cast<double>(down);
  // The product is off by half a unit in its last place; a number so close to the middle of two is left to the library.
  if (std::abs(rest - 0.5) <= product * std::numeric_limits<double>::epsilon()) return false;
  whole = static_cast<std::uint64_t>(down) + (rest > 0.5 ? 1 : 0);
  return true;
}

/// Writes a whole number without leading zeros, and returns the end of its text; up to three characters after it change.
char* put_whole(char* at, std::uint64_t whole) {
  if (whole >= 10000) {
    at = put_whole(at, whole / 10000);
    std::memcpy(at, digits_of.text + 4 * (whole % 10000), 4);
    return at + 4;
  }
  const int digits = 1 + (whole >= 10) + (whole >= 100) + (whole >= 1000);
  std::memcpy(at, digits_of.text + 4 * whole + (4 - digits), 4);
  return at + digits;
}

/// Writes so many decimals of `part`, which is below the power of ten of their number, and returns the end of their text.
char* put_decimals(char* at, std::uint64_t part, int decimals) {
  int behind = decimals;
  for (; behind > 4; behind -= 4) {
    std::memcpy(at + behind - 4, digits_of.text + 4 * (part % 10000), 4);
    part /= 10000;
  }
  // The first ones, of which there are one to four, move to the front of four digits; those behind stay.
  char first[4];
  std::memcpy(first, digits_of.text + 4 * (part * tens[4 - behind]), 4);
  for (int k = 0; k < behind; ++k) at[k] = first[k];
  return at + decimals;
}

/// Writes a number to `at`, which has room for it, and returns the end of its text.
char* put_number(char* at, double value, int decimals) {
  if (std::isnan(value)) return at;
  std::uint64_t whole;
  if (!scaled(std::abs(value), decimals, whole)) {
    std::snprintf(at, most_characters, "%.*f", decimals, value);
    const std::size_t size = std::strlen(at);
    std::replace(at, at + size, ',', '.');  // the decimal point of some places
    if (std::strcmp(at, "-0") != 0) return at + size;
    *at = '0';
    return at + 1;
  }
  *at = '-';
  at += std::signbit(value) && (decimals > 0 || whole > 0);
  if (decimals == 0) return put_whole(at, whole);
  const std::uint64_t before = whole / tens[decimals];
  at = put_whole(at, before);
  *at = '.';
  return put_decimals(at + 1, whole - before * tens[decimals], decimals);
}

nb::object number_rows(nb::handle values_, nb::handle decimals_) {
  const Array values = read_array("values", values_), decimals = read_array("decimals", decimals_);
  if (values.shape.size() != 2) values.fail("(n, m)");
  const std::size_t rows = values.shape[0], columns = values.shape[1];
  decimals.expect("(" + std::to_string(columns) + ",), one for each column", {columns});
  std::vector<int> after(columns);
  for (std::size_t c = 0; c < columns; ++c) {
    const double k = decimals.data[c];
    if (!(k >= 0 && k <= most_decimals && k == std::floor(k)))
      throw nb::value_error(("decimals: found " + std::to_string(k) + ", expected a whole number from 0 to 15").c_str());
    after[c] = static_cast<int>(k);
  }
  std::unique_ptr<char[]> text;
  std::size_t size = 0;
  {
    nb::gil_scoped_release release;
    std::size_t room = 0;
    const double* value = values.data;
    for (std::size_t r = 0; r < rows; ++r) {
      if (room - size < columns * most_characters) {
        room = std::max(2 * room, 8 * rows * columns + columns * most_characters);
        std::unique_ptr<char[]> longer(new char[room]);
        std::copy(text.get(), text.get() + size, longer.get());
        text = std::move(longer);
      }
      char* at = text.get() + size;
      for (std::size_t c = 0; c < columns; ++c) {
        at = put_number(at, *value++, after[c]);
        *at++ = c + 1 < columns ? ',' : '\n';
      }
      size = static_cast<std::size_t>(at - text.get());
    }
  }
  return nb::bytes(text.get(), size);
}

}  // namespace

void add_number_text(nb::module_& m) {
  m.def("number_rows", number_rows, nb::arg("values").none(), nb::arg("decimals").none(),
        nb::sig("def number_rows(values: ArrayLike, decimals: ArrayLike) -> bytes"), number_rows_doc);
}

}  // namespace bindings
