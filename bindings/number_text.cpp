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
#include <string>
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
constexpr std::size_t held_characters = 1 << 14;

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
  if (std::signbit(value) && (decimals > 0 || whole > 0)) *at++ = '-';
  std::ptrdiff_t digits = decimals + 1;
  while (digits <= most_decimals && whole >= tens[digits]) ++digits;
  char* const end = at + digits + (decimals > 0 ? 1 : 0);
  char* back = end;
  for (int k = 0; k < decimals; ++k, whole /= 10) *--back = static_cast<char>('0' + whole % 10);
  if (decimals > 0) *--back = '.';
  for (; back > at; whole /= 10) *--back = static_cast<char>('0' + whole % 10);
  return end;
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
  std::string text;
  {
    nb::gil_scoped_release release;
    text.reserve(8 * rows * columns);
    char held[held_characters + most_characters];
    char* at = held;
    const double* value = values.data;
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t c = 0; c < columns; ++c) {
        at = put_number(at, *value++, after[c]);
        *at++ = c + 1 < columns ? ',' : '\n';
        if (at < held + held_characters) continue;
        text.append(held, static_cast<std::size_t>(at - held));
        at = held;
      }
    text.append(held, static_cast<std::size_t>(at - held));
  }
  return nb::bytes(text.data(), text.size());
}

}  // namespace

void add_number_text(nb::module_& m) {
  m.def("number_rows", number_rows, nb::arg("values").none(), nb::arg("decimals").none(),
        nb::sig("def number_rows(values: ArrayLike, decimals: ArrayLike) -> bytes"), number_rows_doc);
}

}  // namespace bindings
