// Rows of numbers from text, with the bits that Python reads, and ten times as fast.
#include "read_rows.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

namespace bindings {
namespace {

namespace nb = nanobind;

constexpr const char* read_rows_doc =
    R"(Write the numbers of a table's text into columns, and return the row behind the last one.

Blank lines are no rows. None if a line is not one number or missing sample for each column.

Parameters
----------
text : bytes
    Whole lines.
columns : list of ndarray, shape (n,)
    Columns of float64, long enough for a row from each line.
first : int
    Row of the first line.
delimiter, decimal : str
    One character between the cells, and one before the decimals.
missing : list of str
    Words that mean a missing sample, in lower case.

Returns
-------
int or None)";

constexpr int most_exact_power = 22;
constexpr double powers[most_exact_power + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                 1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                                 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

constexpr std::ptrdiff_t most_digits = 19;  // as many as 64 bits hold
constexpr std::uint64_t most_exact_whole = std::uint64_t(1) << 53;
constexpr int most_exponent_digits = 4;

using Column = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_line_end(char c) { return c == '\n' || c == '\r'; }

/// A table's text, which ends with a NUL that belongs to no cell.
class Cells {
 public:
  Cells(const char* begin, const char* end, char delimiter, char decimal, const std::vector<std::string>& missing)
      : at_(begin), end_(end), delimiter_(delimiter), decimal_(decimal), missing_(missing) {}

  /// Goes to the next line that is not blank; false at the end of the text.
  bool next_row() {
    for (const char* c = at_; c < end_; ++c) {
      if (*c == '\n' || *c == '\r') at_ = c + 1;
      else if (*c != ' ' && *c != '\t') return true;
    }
    return false;
  }

  /// Reads a cell; false where it is no number.
  bool read(double& value) { return read_plain(value) || read_any(value); }

  /// Goes over what follows a cell; false where that is not the delimiter or, after the `last` one, the line's end.
  bool pass(bool last) {
    if (last) return at_ == end_ || is_line_end(*at_);
    return at_ < end_ && *at_++ == delimiter_;
  }

 private:
  bool is_blank(char c) const { return (c == ' ' || c == '\t') && c != delimiter_; }
  bool is_over(const char* c) const { return c == end_ || *c == delimiter_ || is_line_end(*c); }

  /// A number whose digits and power of ten are exact in double precision: one rounding gives the nearest.
  bool read_plain(double& value) {
    const char* c = at_;
    while (is_blank(*c)) ++c;
    const bool is_negative = *c == '-';
    if (is_negative || *c == '+') ++c;
    std::uint64_t whole = 0;
    const char* const begin = c;
    for (; is_digit(*c); ++c) whole = 10 * whole + static_cast<std::uint64_t>(*c - '0');
    std::ptrdiff_t digits = c - begin, power = 0;
    if (*c == decimal_) {
      const char* const decimals = ++c;
      for (; is_digit(*c); ++c) whole = 10 * whole + static_cast<std::uint64_t>(*c - '0');
      power = decimals - c;
      digits -= power;
    }
    if (digits == 0 || digits > most_digits || whole > most_exact_whole) return false;
    if (*c == 'e' || *c == 'E') {
      const bool is_small = *++c == '-';
      if (is_small || *c == '+') ++c;
      const char* const exponent = c;
      std::ptrdiff_t size = 0;
      for (; is_digit(*c); ++c) size = c - exponent < most_exponent_digits ? 10 * size + (*c - '0') : size;
      if (c == exponent || c - exponent > most_exponent_digits) return false;
      power += is_small ? -size : size;
    }
    while (is_blank(*c)) ++c;
    if (!is_over(c) || power < -most_exact_power || power > most_exact_power) return false;
    const double size = static_cast<double>(whole);
    value = power < 0 ? size / powers[-power] : size * powers[power];
    if (is_negative) value = -value;
    at_ = c;
    return true;
  }

  /// A missing sample, or a number as Python reads it.
  bool read_any(double& value) {
    const char* stop = at_;
    while (!is_over(stop)) ++stop;
    const char *first = at_, *last = stop;
    while (first < last && is_blank(*first)) ++first;
    while (last > first && is_blank(last[-1])) --last;
    cell_.assign(first, last);
    std::string word = cell_;
    for (char& c : word) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    at_ = stop;
    if (std::find(missing_.begin(), missing_.end(), word) != missing_.end()) {
      value = std::numeric_limits<double>::quiet_NaN();
      return true;
    }
    if (decimal_ != '.') {
      if (cell_.find('.') != std::string::npos) return false;
      std::replace(cell_.begin(), cell_.end(), decimal_, '.');
    }
    if (cell_.find('\0') != std::string::npos) return false;
    char* after = nullptr;
    value = PyOS_string_to_double(cell_.c_str(), &after, nullptr);
    if (PyErr_Occurred() != nullptr) {
      PyErr_Clear();
      return false;
    }
    return after == cell_.c_str() + cell_.size();
  }

  const char* at_;
  const char* const end_;
  const char delimiter_, decimal_;
  const std::vector<std::string>& missing_;
  std::string cell_;
};

nb::object read_rows(const nb::bytes& text, const std::vector<Column>& columns, std::size_t first,
                     const std::string& delimiter, const std::string& decimal,
                     const std::vector<std::string>& missing) {
  if (columns.empty() || delimiter.size() != 1 || decimal.size() != 1)
    throw nb::value_error("read_rows: expected a column, and one character for delimiter and decimal");
  std::size_t room = columns.front().shape(0);
  for (const Column& column : columns) room = std::min(room, column.shape(0));
  std::vector<double*> to;
  for (const Column& column : columns) to.push_back(column.data());
  Cells cells(text.c_str(), text.c_str() + text.size(), delimiter[0], decimal[0], missing);
  std::size_t row = first;
  for (; cells.next_row(); ++row) {
    if (row >= room)
      throw nb::value_error(("columns: found room for " + std::to_string(room) + " rows, expected more").c_str());
    for (std::size_t i = 0; i < to.size(); ++i)
      if (!cells.read(to[i][row]) || !cells.pass(i + 1 == to.size())) return nb::none();
  }
  return nb::int_(row);
}

}  // namespace

void add_read_rows(nb::module_& m) {
  m.def("read_rows", read_rows, nb::arg("text"), nb::arg("columns").noconvert(), nb::arg("first"), nb::arg("delimiter"),
        nb::arg("decimal"), nb::arg("missing"),
        nb::sig("def read_rows(text: bytes, columns: list[NDArray[float64]], first: int, delimiter: str, "
                "decimal: str, missing: list[str]) -> int | None"),
        read_rows_doc);
}

}  // namespace bindings
