#include "arrays.hpp"

#include <csignal>
#include <cstddef>
#include <limits>

#include "core/facade/world.hpp"

namespace kbvh::python {

namespace {

struct Field {
  const char* name;
  py::object format;
  std::size_t offset;
};

py::dtype structured(const std::vector<Field>& fields, std::size_t size) {
  py::list names, formats, offsets;
  for (const Field& field : fields) {
    names.append(field.name);
    formats.append(field.format);
    offsets.append(field.offset);
  }
  return py::dtype(std::move(names), std::move(formats), std::move(offsets), py::ssize_t(size));
}

/// Keeps a type for the lifetime of the process: the interpreter may end before static objects do.
const py::dtype& kept(py::dtype type) {
  return *new py::dtype(std::move(type));
}

py::object u1() {
  return py::dtype("u1");
}
py::object u4() {
  return py::dtype("u4");
}
py::object f8() {
  return py::dtype("f8");
}
py::object truth() {
  return py::dtype("?");
}
py::object vector3() {
  return py::dtype::from_args(py::make_tuple("f8", py::make_tuple(3)));
}

std::string in_words(const py::handle& given) {
  return py::str(py::type::handle_of(given).attr("__name__"));
}

/// Returns what a caller gave as an array of whole or real numbers: neither text, dates nor complex numbers,
/// which numpy would convert and partly lose.
py::array real_array(const py::object& given, const std::string& what) {
  py::array array = py::array::ensure(given);
  if (!array) {
    PyErr_Clear();
    throw std::invalid_argument(what + " is no array of numbers, but " + in_words(given));
  }
  const char kind = array.dtype().kind();
  if (array.size() == 0 || kind == 'f' || kind == 'i' || kind == 'u') return array;
  if (array.ndim() == 0)
    throw std::invalid_argument(what + " is no array of numbers, but " + in_words(given));
  throw std::invalid_argument(what + ": real numbers are needed, not " + std::string(py::str(array.dtype())));
}

// The work that an interruption is to end.
std::atomic<bool> interrupted{false};
int interruptible_calls = 0;  // guarded by the interpreter's lock
struct sigaction former_action;

extern "C" void note_interruption(int signal) {
  interrupted = true;
  if (former_action.sa_handler != SIG_DFL && former_action.sa_handler != SIG_IGN)
    former_action.sa_handler(signal);
}

bool in_main_thread() {
  static const auto main =
      py::module_::import("threading").attr("main_thread")().attr("ident").cast<unsigned long>();
  return PyThread_get_thread_ident() == main;
}

}  // namespace

Numbers::Numbers(const py::object& given, const std::string& what) {
  if (py::isinstance<py::array>(given)) {
    const auto array = py::reinterpret_borrow<py::array>(given);
    const bool in_order = (array.flags() & py::array::c_style) != 0;
    if (in_order && py::isinstance<py::array_t<float>>(array)) {
      array_ = array;
      single_ = true;
      return;
    }
    if (in_order && py::isinstance<py::array_t<double>>(array)) {
      array_ = array;
      return;
    }
  }
  array_ = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(real_array(given, what));
  if (!array_) throw py::error_already_set();
}

void Numbers::check_points(const std::string& what) const {
  if (array_.ndim() > 1 && array_.shape(array_.ndim() - 1) != 3)
    throw std::invalid_argument(what + ": points have 3 coordinates, not " +
                                std::to_string(array_.shape(array_.ndim() - 1)));
}

std::vector<double> doubles_of(const py::object& given, const std::string& what) {
  const Numbers numbers(given, what);
  if (numbers.single()) return {numbers.floats().begin(), numbers.floats().end()};
  return {numbers.doubles().begin(), numbers.doubles().end()};
}

std::vector<double> points_of(const py::object& given, const std::string& what) {
  const Numbers numbers(given, what);
  numbers.check_points(what);
  if (numbers.size() % 3 != 0)
    throw std::invalid_argument(what + ": " + std::to_string(numbers.size()) + " coordinates are no points");
  if (numbers.single()) return {numbers.floats().begin(), numbers.floats().end()};
  return {numbers.doubles().begin(), numbers.doubles().end()};
}

std::uint64_t whole_number(const py::handle& given, const std::string& what, std::uint64_t most) {
  const auto index = py::reinterpret_steal<py::object>(PyNumber_Index(given.ptr()));
  if (!index) {
    PyErr_Clear();
    const bool shown = PyFloat_Check(given.ptr()) != 0;
    throw py::type_error(what + " is a whole number, not " +
                         (shown ? std::string(py::str(given)) : in_words(given)));
  }
  const unsigned long long value = PyLong_AsUnsignedLongLong(index.ptr());
  const bool beyond = PyErr_Occurred() != nullptr;
  PyErr_Clear();
  if (beyond || value > most)
    throw std::invalid_argument(what + " is a whole number from 0 to " + std::to_string(most) + ", not " +
                                std::string(py::str(index)));
  return value;
}

EndsOnInterrupt::EndsOnInterrupt() {
  if (!in_main_thread()) return;
  if (interruptible_calls++ == 0) {
    interrupted = false;
    struct sigaction action {};
    action.sa_handler = &note_interruption;
    ::sigaction(SIGINT, &action, &former_action);
  }
  interruptible_.emplace(interrupted);
}
EndsOnInterrupt::~EndsOnInterrupt() {
  if (!interruptible_) return;
  interruptible_.reset();
  if (--interruptible_calls == 0) ::sigaction(SIGINT, &former_action, nullptr);
}

Ids::Ids(const py::object& given, const std::string& what) {
  py::array array;
  if (py::isinstance<py::array>(given)) {
    array = py::reinterpret_borrow<py::array>(given);
  } else {
    array = py::array::ensure(given);
    if (!array) {
      PyErr_Clear();
      throw std::invalid_argument(what + " are no ids, but " + in_words(given));
    }
  }
  axes_ = int(array.ndim());
  if (py::isinstance<py::array_t<std::uint32_t>>(array) && (array.flags() & py::array::c_style) != 0) {
    keep_ = array;
    data_ = static_cast<const std::uint32_t*>(array.data());
    size_ = std::size_t(array.size());
    return;
  }
  const char kind = array.dtype().kind();
  if (array.size() > 0 && kind != 'i' && kind != 'u')
    throw std::invalid_argument(what + " are no whole numbers, but " + std::string(py::str(array.dtype())));
  const auto take = [&](const auto& wide) {
    copy_.reserve(std::size_t(wide.size()));
    for (py::ssize_t i = 0; i < wide.size(); ++i) {
      const auto id = wide.data()[i];
      if (id < 0 || id > std::numeric_limits<std::uint32_t>::max())
        throw std::invalid_argument(what + ": " + std::to_string(id) + " cannot be an id");
      copy_.push_back(std::uint32_t(id));
    }
  };
  if (kind == 'u')
    take(py::array_t<std::uint64_t, py::array::c_style | py::array::forcecast>::ensure(array));
  else
    take(py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array));
  data_ = copy_.data();
  size_ = copy_.size();
}

const py::dtype& pair_type() {
  static const py::dtype& type = kept(structured({{"body_a", u4(), offsetof(WorldPair, body_a)},
                                                  {"primitive_a", u4(), offsetof(WorldPair, primitive_a)},
                                                  {"body_b", u4(), offsetof(WorldPair, body_b)},
                                                  {"primitive_b", u4(), offsetof(WorldPair, primitive_b)}},
                                                 sizeof(WorldPair)));
  return type;
}
const py::dtype& span_type() {
  static const py::dtype& type =
      kept(structured({{"body_a", u4(), offsetof(WorldSpan, pair.body_a)},
                       {"primitive_a", u4(), offsetof(WorldSpan, pair.primitive_a)},
                       {"body_b", u4(), offsetof(WorldSpan, pair.body_b)},
                       {"primitive_b", u4(), offsetof(WorldSpan, pair.primitive_b)},
                       {"begin", f8(), offsetof(WorldSpan, begin)},
                       {"end", f8(), offsetof(WorldSpan, end)}},
                      sizeof(WorldSpan)));
  return type;
}
const py::dtype& contact_type() {
  static const py::dtype& type = kept(structured({{"kind", u1(), offsetof(WorldContact, kind)},
                                                  {"body_a", u4(), offsetof(WorldContact, body_a)},
                                                  {"feature_a", u4(), offsetof(WorldContact, feature_a)},
                                                  {"body_b", u4(), offsetof(WorldContact, body_b)},
                                                  {"feature_b", u4(), offsetof(WorldContact, feature_b)},
                                                  {"begin", f8(), offsetof(WorldContact, begin)},
                                                  {"end", f8(), offsetof(WorldContact, end)}},
                                                 sizeof(WorldContact)));
  return type;
}
const py::dtype& hit_type() {
  static const py::dtype& type = kept(structured({{"body", u4(), offsetof(WorldHit, body)},
                                                  {"primitive", u4(), offsetof(WorldHit, primitive)},
                                                  {"parameter", f8(), offsetof(WorldHit, parameter)}},
                                                 sizeof(WorldHit)));
  return type;
}
const py::dtype& ball_hit_type() {
  static const py::dtype& type = kept(structured({{"point", u4(), offsetof(WorldBallHit, ball)},
                                                  {"body", u4(), offsetof(WorldBallHit, body)},
                                                  {"primitive", u4(), offsetof(WorldBallHit, primitive)}},
                                                 sizeof(WorldBallHit)));
  return type;
}
const py::dtype& node_type() {
  static const py::dtype& type = kept(structured({{"parent", u4(), offsetof(WorldNode, parent)},
                                                  {"first", u4(), offsetof(WorldNode, first)},
                                                  {"count", u4(), offsetof(WorldNode, count)},
                                                  {"leaf", truth(), offsetof(WorldNode, leaf)},
                                                  {"stale", truth(), offsetof(WorldNode, stale)},
                                                  {"lower", vector3(), offsetof(WorldNode, lower)},
                                                  {"upper", vector3(), offsetof(WorldNode, upper)},
                                                  {"event_node", u4(), offsetof(WorldNode, event_node)}},
                                                 sizeof(WorldNode)));
  return type;
}
const py::dtype& watch_type() {
  static const py::dtype& type = kept(structured({{"body", u4(), offsetof(WorldWatch, body)},
                                                  {"node", u4(), offsetof(WorldWatch, node)},
                                                  {"other_body", u4(), offsetof(WorldWatch, other_body)},
                                                  {"other_node", u4(), offsetof(WorldWatch, other_node)},
                                                  {"overlapping", truth(), offsetof(WorldWatch, overlapping)},
                                                  {"listed", truth(), offsetof(WorldWatch, listed)}},
                                                 sizeof(WorldWatch)));
  return type;
}
const py::dtype& event_type() {
  static const py::dtype& type = [&]() -> const py::dtype& {
    const py::dtype piece = structured({{"t0", f8(), offsetof(WorldPiece, t0)},
                                        {"t1", f8(), offsetof(WorldPiece, t1)},
                                        {"x0", f8(), offsetof(WorldPiece, x0)},
                                        {"x1", f8(), offsetof(WorldPiece, x1)},
                                        {"ray", truth(), offsetof(WorldPiece, ray)}},
                                       sizeof(WorldPiece));
    return kept(structured({{"kind", u1(), offsetof(WorldEvent, kind)},
                            {"body", u4(), offsetof(WorldEvent, body)},
                            {"node", u4(), offsetof(WorldEvent, node)},
                            {"side", u4(), offsetof(WorldEvent, side)},
                            {"winner", u4(), offsetof(WorldEvent, winner)},
                            {"loser", u4(), offsetof(WorldEvent, loser)},
                            {"other_body", u4(), offsetof(WorldEvent, other_body)},
                            {"other_node", u4(), offsetof(WorldEvent, other_node)},
                            {"time", f8(), offsetof(WorldEvent, time)},
                            {"error", f8(), offsetof(WorldEvent, error)},
                            {"exact", truth(), offsetof(WorldEvent, exact)},
                            {"winner_piece", piece, offsetof(WorldEvent, winner_piece)},
                            {"loser_piece", piece, offsetof(WorldEvent, loser_piece)}},
                           sizeof(WorldEvent)));
  }();
  return type;
}
const py::dtype& bound_change_type() {
  static const py::dtype& type =
      kept(structured({{"body", u4(), offsetof(WorldBoundChange, body)},
                       {"node", u4(), offsetof(WorldBoundChange, node)},
                       {"side", u4(), offsetof(WorldBoundChange, side)},
                       {"old_vertex", u4(), offsetof(WorldBoundChange, old_vertex)},
                       {"new_vertex", u4(), offsetof(WorldBoundChange, new_vertex)}},
                      sizeof(WorldBoundChange)));
  return type;
}

std::atomic<int>& unlocked_calls() {
  static std::atomic<int> calls{0};
  return calls;
}

}  // namespace kbvh::python
