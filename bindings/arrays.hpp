// NumPy arrays at the door: checked once, with the argument's name, the shape got and the shape expected.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <limits>
#include <new>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace bindings {

namespace nb = nanobind;

using Shape = std::vector<std::size_t>;

inline std::string text(const Shape& shape) {
  std::string result = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) result += (i > 0 ? ", " : "") + std::to_string(shape[i]);
  return result + (shape.size() == 1 ? ",)" : ")");
}
inline std::string same_length(const char* as, std::size_t n) {
  return "(" + std::to_string(n) + ",), as long as " + as;
}

/// A contiguous array of T that came in, and the object that owns it.
template <class T> struct BasicArray {
  std::string name;
  nb::object owner;
  const T* data = nullptr;
  Shape shape;

  std::size_t size() const {
    std::size_t n = 1;
    for (const std::size_t extent : shape) n *= extent;
    return n;
  }
  [[noreturn]] void fail(const std::string& expected) const {
    throw nb::value_error((name + ": got shape " + text(shape) + ", expected " + expected).c_str());
  }
  void expect(const std::string& expected, const Shape& wanted) const {
    if (shape != wanted) fail(expected);
  }
};
using Array = BasicArray<double>;

/// Memory for a result, not zeroed: whoever asks writes all of it. Large results take large pages where the system has
/// them; a fresh page for every 4 KiB costs as much time as simulating what is written there.
inline void* allocate(std::size_t bytes) {
#if defined(__linux__)
  constexpr std::size_t large_page = std::size_t(1) << 21;
  if (bytes >= large_page) {
    const std::size_t whole = (bytes + large_page - 1) / large_page * large_page;
    void* pages = std::aligned_alloc(large_page, whole);
    if (pages == nullptr) throw std::bad_alloc();
    madvise(pages, bytes / large_page * large_page, MADV_HUGEPAGE);  // not the last, which is used only in part
    return pages;
  }
#endif
  void* memory = std::malloc(bytes > 0 ? bytes : 1);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

/// Lets the process keep the pages of large arrays that it frees: glibc keeps as much as the largest block that was ever
/// given back, and to give back and fetch again what every step of a fit needs takes longer than its arithmetic.
inline void keep_pages() {
  void* volatile block = std::malloc(std::size_t(31) << 20);  // never touched, so it costs nothing
  std::free(block);
}

/// An array of T that goes out.
template <class T> struct BasicResult {
  T* data;
  Shape shape;
  nb::capsule owner;

  explicit BasicResult(Shape extents)
      : data(static_cast<T*>(allocate(count(extents) * sizeof(T)))),
        shape(std::move(extents)),
        owner(data, [](void* p) noexcept { std::free(p); }) {}
  static std::size_t count(const Shape& extents) {
    std::size_t n = 1;
    for (const std::size_t extent : extents) n *= extent;
    return n;
  }
  nb::object array() const { return nb::cast(nb::ndarray<nb::numpy, T>(data, shape.size(), shape.data(), owner)); }
};
using Result = BasicResult<double>;

inline nb::object tuple_of(const std::vector<Result>& results) {
  nb::object tuple = nb::steal(PyTuple_New(static_cast<Py_ssize_t>(results.size())));
  for (std::size_t i = 0; i < results.size(); ++i)
    PyTuple_SetItem(tuple.ptr(), static_cast<Py_ssize_t>(i), results[i].array().release().ptr());
  return tuple;
}

/// Whatever NumPy makes of a value: any array, list or number of booleans, integers or floating-point numbers.
inline nb::object numbers(const char* name, nb::handle value) {
  nb::object array;
  std::string kind;
  try {
    array = nb::module_::import_("numpy").attr("asarray")(value);
    kind = nb::cast<std::string>(array.attr("dtype").attr("kind"));
  } catch (nb::python_error& error) {
    throw nb::value_error((std::string(name) + ": expected an array of numbers; " + error.what()).c_str());
  }
  if (kind != "f" && kind != "i" && kind != "u" && kind != "b")
    throw nb::value_error(
        (std::string(name) + ": expected real numbers, got " + nb::cast<std::string>(array.attr("dtype").attr("name")))
            .c_str());
  return array;
}

template <class T> BasicArray<T> read_array_of(const char* name, nb::handle value) {
  nb::ndarray<const T, nb::c_contig, nb::device::cpu> view;
  nb::object owner = nb::borrow(value);
  if (!nb::try_cast(value, view, false)) {
    owner = numbers(name, value)
                .attr("astype")(std::is_same<T, float>::value ? "float32" : "float64", nb::arg("order") = "C");
    view = nb::cast<nb::ndarray<const T, nb::c_contig, nb::device::cpu>>(owner);
  }
  BasicArray<T> array{name, std::move(owner), view.data(), {}};
  for (std::size_t i = 0; i < view.ndim(); ++i) array.shape.push_back(view.shape(i));
  return array;
}
inline Array read_array(const char* name, nb::handle value) { return read_array_of<double>(name, value); }

/// A sample of `n` numbers alone, as loops give it: `data`, or none where it is anything else. The buffer protocol takes
/// a fraction of what DLPack does, which is most of the time of a small call.
class OneSample {
 public:
  OneSample(nb::handle value, std::size_t n) noexcept {
    if (!PyObject_CheckBuffer(value.ptr())) return;
    held_ = PyObject_GetBuffer(value.ptr(), &view_, PyBUF_STRIDED_RO | PyBUF_FORMAT) == 0;
    if (!held_) {
      PyErr_Clear();
      return;
    }
    const bool doubles = view_.format != nullptr && view_.format[0] == 'd' && view_.format[1] == 0;
    if (doubles && view_.ndim == 1 && view_.shape[0] == static_cast<Py_ssize_t>(n) &&
        view_.strides[0] == static_cast<Py_ssize_t>(sizeof(double)))
      data = static_cast<const double*>(view_.buf);
  }
  ~OneSample() {
    if (held_) PyBuffer_Release(&view_);
  }
  OneSample(const OneSample&) = delete;
  OneSample& operator=(const OneSample&) = delete;

  const double* data = nullptr;

 private:
  Py_buffer view_;
  bool held_ = false;
};

inline bool is_float32(nb::handle value) {
  nb::ndarray<const float, nb::device::cpu> view;
  return nb::try_cast(value, view, false);
}

inline double read_number(const char* name, nb::handle value) {
  const Array array = read_array(name, value);
  if (!array.shape.empty()) array.fail("a number");
  return *array.data;
}

inline long long read_integer(const char* name, nb::handle value, long long least, long long most) {
  const std::string expected =
      std::string(name) + ": expected a whole number from " + std::to_string(least) + " to " + std::to_string(most);
  const nb::object index = nb::steal(PyNumber_Index(value.ptr()));
  int overflow = 0;
  const long long number = index.is_valid() ? PyLong_AsLongLongAndOverflow(index.ptr(), &overflow) : 0;
  PyErr_Clear();
  if (!index.is_valid() || overflow != 0 || number < least || number > most) throw nb::value_error(expected.c_str());
  return number;
}

/// Indices below `end`, in any order.
inline std::vector<std::size_t> read_indices(const char* name, nb::handle value, std::size_t end) {
  const nb::object array = numbers(name, value);
  const std::string kind = nb::cast<std::string>(array.attr("dtype").attr("kind"));
  const Array indices = read_array(name, array);
  if (indices.shape.size() != 1) indices.fail("(k,)");
  if (indices.size() > 0 && kind != "i" && kind != "u")
    throw nb::value_error(
        (std::string(name) + ": expected integers, got " + nb::cast<std::string>(array.attr("dtype").attr("name")))
            .c_str());
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (!(indices.data[i] >= 0 && indices.data[i] < static_cast<double>(end)))
      throw nb::value_error((std::string(name) + ": expected indices from 0 to " + std::to_string(end - 1)).c_str());
    result.push_back(static_cast<std::size_t>(indices.data[i]));
  }
  return result;
}

}  // namespace bindings
