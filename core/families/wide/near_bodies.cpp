#include "core/families/wide/near_bodies.hpp"

#include <algorithm>
#include <numeric>

#include "core/topology/builders.hpp"

namespace kbvh {

namespace {
/// Below this number of pairs, comparing all roots in a loop costs less than a search.
constexpr std::size_t few_pairs = 256;
constexpr std::uint32_t pairs_per_body = 4;
/// The tree is rebuilt when a search makes this many times the tests of the first search after the last
/// build.
constexpr double worn_out = 2;

bool by_bodies(const BodyPair& a, const BodyPair& b) {
  return a.first != b.first ? a.first < b.first : a.second < b.second;
}
bool is_within(const BodyPair& pair) {
  return pair.first == pair.second;
}
}  // namespace

NearBodies::NearBodies(std::span<const BodyPair> pairs, std::uint32_t body_count)
    : pairs_(pairs),
      bodies_(body_count),
      searches_(pairs.size() > few_pairs && pairs.size() / pairs_per_body > body_count) {
  if (!searches_) {
    near_.resize(pairs.size());
    std::iota(near_.begin(), near_.end(), 0U);
    return;
  }
  for (std::uint32_t i = 0; i < pairs.size(); ++i)
    if (is_within(pairs[i])) within_.push_back(i);
  const std::size_t between = pairs.size() - within_.size();
  const auto first_within = std::find_if(pairs.begin(), pairs.end(), is_within);
  const bool sorted = std::size_t(first_within - pairs.begin()) == between &&
                      std::is_sorted(pairs.begin(), first_within, by_bodies);
  if (!sorted) {
    order_.reserve(between);
    for (std::uint32_t i = 0; i < pairs.size(); ++i)
      if (!is_within(pairs[i])) order_.push_back(i);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return by_bodies(pairs[a], pairs[b]); });
  }
  begin_.assign(std::size_t(body_count) + 1, 0);
  for (const BodyPair& pair : pairs)
    if (!is_within(pair)) ++begin_[pair.first + 1];
  for (std::size_t body = 0; body < body_count; ++body) begin_[body + 1] += begin_[body];
  corners_.assign(std::size_t(6) * body_count + 1, 0);
  empty_.assign(body_count, 0);
  for (std::uint32_t body = 0; body < body_count; ++body)
    primitives_.add(std::vector<std::uint32_t>{2 * body, 2 * body + 1});
}

NearBodies::~NearBodies() = default;

/// An empty box becomes a point of the preceding body: pairs with an empty body never count.
void NearBodies::put(std::uint32_t body, const Box<double>& box) {
  double* const corners = corners_.data() + std::size_t(6) * body;
  empty_[body] = box.empty() ? 1 : 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double elsewhere = body == 0 ? 0 : corners_[std::size_t(6) * (body - 1) + axis];
    corners[axis] = empty_[body] != 0 ? elsewhere : box.lower[axis];
    corners[axis + 3] = empty_[body] != 0 ? elsewhere : box.upper[axis];
  }
}

void NearBodies::build() {
  tree_.assign(build_topology(primitives_, corners_.data(),
                              {.method = BuildMethod::median, .width = 8, .leaf_size = 8}),
               primitives_, active_kernel_set());
  build_due_ = false;
  learn_work_ = true;
}

void NearBodies::search(std::uint64_t& tests) {
  if (build_due_) build();
  tree_.positions_changed();
  tree_.refit(corners_.data());
  found_.clear();
  std::uint64_t made = 0;
  const WideSide<double> bodies{&tree_, 0, corners_.data()};
  query_.run(bodies, bodies, found_, made);
  tests += made;
  const double work = double(made) / double(found_.size() + bodies_);
  if (learn_work_) work_ = work;
  learn_work_ = false;
  build_due_ = work > worn_out * work_;
  keys_.clear();
  for (const PrimitivePair& pair : found_)
    if (empty_[pair.primitive_a] == 0 && empty_[pair.primitive_b] == 0)
      keys_.push_back((std::uint64_t(pair.primitive_a) << 32) | pair.primitive_b);
  std::sort(keys_.begin(), keys_.end());
  near_.clear();
  for (const std::uint64_t key : keys_) append_pairs(std::uint32_t(key >> 32), std::uint32_t(key));
  near_.insert(near_.end(), within_.begin(), within_.end());
  if (!order_.empty()) std::sort(near_.begin(), near_.end());
}

/// Appends every pair of the scene that consists of two given bodies; the first has the smaller number.
void NearBodies::append_pairs(std::uint32_t first, std::uint32_t second) {
  const auto index = [&](std::uint32_t place) { return order_.empty() ? place : order_[place]; };
  std::uint32_t low = begin_[first], high = begin_[first + 1];
  const std::uint32_t end = high;
  while (low < high) {
    const std::uint32_t middle = low + (high - low) / 2;
    if (pairs_[index(middle)].second < second)
      low = middle + 1;
    else
      high = middle;
  }
  for (; low < end && pairs_[index(low)].second == second; ++low) near_.push_back(index(low));
}

std::size_t NearBodies::bytes() const {
  return (near_.capacity() + order_.capacity() + begin_.capacity() + within_.capacity() +
          primitives_.offsets.size() + primitives_.vertices.size()) *
             sizeof(std::uint32_t) +
         corners_.capacity() * sizeof(double) + empty_.size() + (searches_ ? tree_.bytes() : 0) +
         found_.capacity() * sizeof(PrimitivePair) + keys_.capacity() * sizeof(std::uint64_t);
}

}  // namespace kbvh
