#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace kbvh::python {

namespace py = pybind11;

/// Hands a vector's memory to numpy, without a copy.
template <class T>
py::array array_of(std::vector<T>&& numbers, const py::dtype& type, std::vector<py::ssize_t> shape) {
  auto owned = std::make_unique<std::vector<T>>(std::move(numbers));
  const void* const data = owned->data();
  py::capsule owner(owned.get(), [](void* memory) { delete static_cast<std::vector<T>*>(memory); });
  owned.release();
  return py::array(type, std::move(shape), data, owner);
}
template <class T>
py::array records_of(std::vector<T>&& records, const py::dtype& type) {
  const auto size = py::ssize_t(records.size());
  return array_of(std::move(records), type, {size});
}
template <class T>
py::array numbers_of(std::vector<T>&& numbers, std::vector<py::ssize_t> shape) {
  return array_of(std::move(numbers), py::dtype::of<T>(), std::move(shape));
}

/// Numbers of a caller: an array of float32 or float64 in C order as it lies, anything else as a copy in
/// float64. `what` begins the message about values that are no numbers.
class Numbers {
 public:
  Numbers(const py::object& given, const std::string& what);
  bool single() const { return single_; }
  std::size_t size() const { return std::size_t(array_.size()); }
  const void* data() const { return array_.data(); }
  const py::array& array() const { return array_; }
  std::span<const float> floats() const { return {static_cast<const float*>(data()), size()}; }
  std::span<const double> doubles() const { return {static_cast<const double*>(data()), size()}; }
  /// Throws std::invalid_argument unless the last axis has 3 entries, or the array is flat.
  void check_points(const std::string& what) const;

 private:
  py::array array_;
  bool single_ = false;
};

/// Numbers as float64.
std::vector<double> doubles_of(const py::object& given, const std::string& what);

/// Ids of a caller: an array of uint32 in C order as it lies, other whole numbers as a checked copy.
class Ids {
 public:
  Ids(const py::object& given, const std::string& what);
  std::span<const std::uint32_t> span() const { return {data_, size_}; }

 private:
  py::object keep_;
  std::vector<std::uint32_t> copy_;
  const std::uint32_t* data_ = nullptr;
  std::size_t size_ = 0;
};

/// The structured types of the arrays that answers are returned in.
const py::dtype& pair_type();
const py::dtype& span_type();
const py::dtype& contact_type();
const py::dtype& hit_type();
const py::dtype& node_type();
const py::dtype& watch_type();
const py::dtype& event_type();
const py::dtype& bound_change_type();

/// The number of calls that run without the interpreter's lock. The registry must not change meanwhile.
std::atomic<int>& unlocked_calls();

/// Releases the interpreter's lock for its lifetime.
class Unlocked {
  struct Counted {
    Counted() { ++unlocked_calls(); }
    ~Counted() { --unlocked_calls(); }
  } counted_;  // counted while the lock is held
  py::gil_scoped_release released_;
};

/// Thrown where a user interrupts a strategy in Python. It is no std::exception, so that a study ends instead
/// of recording that the strategy failed.
struct Interrupted {};

// The parts of the module.
void bind_world(py::module_& module);
void bind_scenes(py::module_& module);
void bind_studies(py::module_& module);
void bind_strategies(py::module_& module);

}  // namespace kbvh::python
