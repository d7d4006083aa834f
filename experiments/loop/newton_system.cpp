#include "experiments/loop/newton_system.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>

namespace kbvh::experiments::loop {

NewtonSystem::NewtonSystem(const SimulatedMesh& mesh) : block_of_(mesh.vertex_count(), -1) {
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v)
    if (mesh.fixed[v] == 0) block_of_[v] = blocks_++;
  gradient_ = Eigen::VectorXd::Zero(3 * blocks_);
  solution_ = Eigen::VectorXd::Zero(3 * blocks_);
  place_.resize(std::size_t(blocks_));
}

void NewtonSystem::clear() {
  gradient_.setZero();
  entries_.clear();
}

void NewtonSystem::add_block(std::uint32_t vertex, const Eigen::Matrix3d& block) {
  const std::int32_t at = block_of_[vertex];
  if (at >= 0) entries_.push_back({key_of(at, at), block});
}

void NewtonSystem::add_block(std::uint32_t row_vertex, std::uint32_t column_vertex,
                             const Eigen::Matrix3d& block) {
  const std::int32_t row = block_of_[row_vertex], column = block_of_[column_vertex];
  if (row < 0 || column < 0) return;
  if (row > column)
    entries_.push_back({key_of(row, column), block});
  else
    entries_.push_back({key_of(column, row), block.transpose()});
}

void NewtonSystem::sort_entries() {
  const auto count = entries_.size();
  order_.resize(count);
  spare_order_.resize(count);
  for (std::size_t i = 0; i < count; ++i) order_[i] = std::uint32_t(i);
  // Two stable counting sorts: by rows, then by columns.
  for (std::size_t (*const digit)(std::uint64_t) : {&row_of, &column_of}) {
    counts_.assign(std::size_t(blocks_) + 1, 0);
    for (const Entry& entry : entries_) ++counts_[digit(entry.key) + 1];
    for (std::size_t b = 0; b < std::size_t(blocks_); ++b) counts_[b + 1] += counts_[b];
    for (const std::uint32_t i : order_) spare_order_[counts_[digit(entries_[i].key)]++] = i;
    order_.swap(spare_order_);
  }
}

bool NewtonSystem::extend_pattern() {
  present_.clear();
  for (const std::uint32_t i : order_)
    if (present_.empty() || present_.back() != entries_[i].key) present_.push_back(entries_[i].key);
  if (std::includes(pattern_.begin(), pattern_.end(), present_.begin(), present_.end())) return false;
  spare_pattern_.clear();
  std::set_union(pattern_.begin(), pattern_.end(), present_.begin(), present_.end(),
                 std::back_inserter(spare_pattern_));
  pattern_.swap(spare_pattern_);
  return true;
}

void NewtonSystem::order_blocks() {
  Matrix pattern(blocks_, blocks_);
  pattern.resizeNonZeros(Eigen::Index(pattern_.size()));
  int* const columns = pattern.outerIndexPtr();
  std::fill(columns, columns + blocks_ + 1, 0);
  for (std::size_t i = 0; i < pattern_.size(); ++i) {
    ++columns[column_of(pattern_[i]) + 1];
    pattern.innerIndexPtr()[i] = int(row_of(pattern_[i]));
    pattern.valuePtr()[i] = 1;
  }
  for (std::int32_t b = 0; b < blocks_; ++b) columns[b + 1] += columns[b];
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern.selfadjointView<Eigen::Lower>(), order);
  for (int k = 0; k < blocks_; ++k) place_[std::size_t(order.indices()[k])] = k;
  ++orders_;
}

void NewtonSystem::place_blocks() {
  placed_.clear();
  slots_.resize(pattern_.size());
  for (std::size_t i = 0; i < pattern_.size(); ++i) {
    const int row = place_[row_of(pattern_[i])], column = place_[column_of(pattern_[i])];
    placed_.push_back({key_of(std::min(row, column), std::max(row, column)), std::uint32_t(i)});
    // An entry has the rows of the vertex with the larger number, which may come first or second here.
    slots_[i].shape = row == column  ? Slot::Shape::diagonal
                      : row < column ? Slot::Shape::straight
                                     : Slot::Shape::transposed;
  }
  std::sort(placed_.begin(), placed_.end(), [](const Placed& a, const Placed& b) { return a.key < b.key; });
  hessian_.resize(3 * blocks_, 3 * blocks_);
  hessian_.resizeNonZeros(Eigen::Index(9 * pattern_.size()) - 3 * Eigen::Index(blocks_));
  int *const columns = hessian_.outerIndexPtr(), *const rows = hessian_.innerIndexPtr();
  int base = 0;
  for (std::size_t begin = 0, end = 0; begin < placed_.size(); begin = end) {
    const std::size_t column = column_of(placed_[begin].key);
    while (end < placed_.size() && column_of(placed_[end].key) == column) ++end;
    // The diagonal block is the last one of its column; only its upper triangle is stored.
    const int above = 3 * int(end - begin - 1);
    for (std::size_t b = begin; b < end; ++b) {
      Slot& slot = slots_[placed_[b].index];
      slot.first = base + 3 * int(b - begin);
      slot.stride = above;
      const int row = 3 * int(row_of(placed_[b].key));
      for (int j = 0; j < 3; ++j) {
        const int last = slot.shape == Slot::Shape::diagonal ? j : 2;
        for (int i = 0; i <= last; ++i) rows[slot.first + j * above + j * (j + 1) / 2 + i] = row + i;
      }
    }
    for (int j = 0; j < 3; ++j) columns[3 * column + std::size_t(j)] = base + j * above + j * (j + 1) / 2;
    base += 3 * above + 6;
  }
  columns[3 * std::size_t(blocks_)] = base;
  solver_.analyzePattern(hessian_);
}

void NewtonSystem::sum_entries() {
  double* const values = hessian_.valuePtr();
  std::fill(values, values + hessian_.nonZeros(), 0.0);
  std::size_t at = 0;
  for (const std::uint32_t index : order_) {
    const Entry& entry = entries_[index];
    while (pattern_[at] != entry.key) ++at;
    const Slot& slot = slots_[at];
    for (int j = 0; j < 3; ++j) {
      double* const column = values + slot.first + j * slot.stride + j * (j + 1) / 2;
      const int last = slot.shape == Slot::Shape::diagonal ? j : 2;
      for (int i = 0; i <= last; ++i)
        column[i] += slot.shape == Slot::Shape::transposed ? entry.block(j, i) : entry.block(i, j);
    }
  }
}

void NewtonSystem::solve(Positions& direction) {
  direction.setZero(Eigen::Index(block_of_.size()), 3);
  if (blocks_ == 0) return;
  sort_entries();
  if (extend_pattern()) {
    order_blocks();
    place_blocks();
  }
  sum_entries();
  solver_.factorize(hessian_);
  const bool factorised = solver_.info() == Eigen::Success;
  if (factorised) {
    for (std::int32_t b = 0; b < blocks_; ++b)
      solution_.segment<3>(3 * place_[std::size_t(b)]) = gradient_.segment<3>(3 * b);
    solver_.matrixL().solveInPlace(solution_);
    solver_.matrixU().solveInPlace(solution_);
  }
  if (!factorised || !solution_.allFinite())
    throw std::runtime_error("the Hessian of a step is not positive definite");
  for (std::size_t v = 0; v < block_of_.size(); ++v)
    if (const std::int32_t block = block_of_[v]; block >= 0)
      direction.row(Eigen::Index(v)) = -solution_.segment<3>(3 * place_[std::size_t(block)]).transpose();
}

double NewtonSystem::slope(const Positions& direction) const {
  double sum = 0;
  for (std::size_t v = 0; v < block_of_.size(); ++v)
    if (const std::int32_t block = block_of_[v]; block >= 0)
      sum += direction.row(Eigen::Index(v)).dot(gradient_.segment<3>(3 * block).transpose());
  return sum;
}

std::size_t NewtonSystem::bytes() const {
  constexpr std::size_t a_value = sizeof(double) + sizeof(int);
  std::size_t sum = sizeof(double) * std::size_t(2 * gradient_.size());
  sum += entries_.capacity() * sizeof(Entry);
  sum += (order_.capacity() + spare_order_.capacity() + counts_.capacity()) * sizeof(std::uint32_t);
  sum += (present_.capacity() + pattern_.capacity() + spare_pattern_.capacity()) * sizeof(std::uint64_t);
  sum += slots_.capacity() * sizeof(Slot) + placed_.capacity() * sizeof(Placed);
  sum += std::size_t(hessian_.nonZeros()) * a_value;
  if (orders_ > 0) sum += std::size_t(solver_.matrixL().nestedExpression().nonZeros()) * a_value;
  return sum;
}

}  // namespace kbvh::experiments::loop
