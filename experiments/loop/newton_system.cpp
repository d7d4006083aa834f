#include "experiments/loop/newton_system.hpp"

#include <algorithm>
#include <stdexcept>

namespace kbvh::experiments::loop {

NewtonSystem::NewtonSystem(const SimulatedMesh& mesh) : first_(mesh.vertex_count(), -1) {
  std::int32_t free = 0;
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v)
    if (mesh.fixed[v] == 0) {
      first_[v] = free;
      free += 3;
    }
  gradient_ = Eigen::VectorXd::Zero(free);
  solution_ = Eigen::VectorXd::Zero(free);
  hessian_.resize(free, free);
}

void NewtonSystem::clear() {
  gradient_.setZero();
  entries_.clear();
}

void NewtonSystem::add_block(std::uint32_t vertex, const Eigen::Matrix3d& block) {
  const std::int32_t at = first_[vertex];
  if (at < 0) return;
  for (int column = 0; column < 3; ++column)
    for (int row = column; row < 3; ++row) entries_.emplace_back(at + row, at + column, block(row, column));
}

void NewtonSystem::add_block(std::uint32_t row_vertex, std::uint32_t column_vertex,
                             const Eigen::Matrix3d& block) {
  const std::int32_t row_at = first_[row_vertex], column_at = first_[column_vertex];
  if (row_at < 0 || column_at < 0) return;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) {
      if (row_at > column_at)
        entries_.emplace_back(row_at + row, column_at + column, block(row, column));
      else
        entries_.emplace_back(column_at + column, row_at + row, block(row, column));
    }
}

void NewtonSystem::solve(Positions& direction) {
  direction.setZero(Eigen::Index(first_.size()), 3);
  if (gradient_.size() == 0) return;
  hessian_.setFromTriplets(entries_.begin(), entries_.end());
  const int *columns = hessian_.outerIndexPtr(), *rows = hessian_.innerIndexPtr();
  const auto column_count = std::size_t(hessian_.outerSize()) + 1,
             entry_count = std::size_t(hessian_.nonZeros());
  if (columns_.size() != column_count || rows_.size() != entry_count ||
      !std::equal(columns_.begin(), columns_.end(), columns) ||
      !std::equal(rows_.begin(), rows_.end(), rows)) {
    columns_.assign(columns, columns + column_count);
    rows_.assign(rows, rows + entry_count);
    solver_.analyzePattern(hessian_);
    ++orders_;
  }
  solver_.factorize(hessian_);
  if (solver_.info() == Eigen::Success) solution_ = solver_.solve(gradient_);
  if (solver_.info() != Eigen::Success || !solution_.allFinite())
    throw std::runtime_error("the Hessian of a step is not positive definite");
  for (std::size_t v = 0; v < first_.size(); ++v)
    if (first_[v] >= 0) direction.row(Eigen::Index(v)) = -solution_.segment<3>(first_[v]).transpose();
}

double NewtonSystem::slope(const Positions& direction) const {
  double sum = 0;
  for (std::size_t v = 0; v < first_.size(); ++v)
    if (first_[v] >= 0)
      sum += direction.row(Eigen::Index(v)).dot(gradient_.segment<3>(first_[v]).transpose());
  return sum;
}

std::size_t NewtonSystem::bytes() const {
  return sizeof(double) * std::size_t(2 * gradient_.size()) + entries_.capacity() * sizeof(entries_[0]) +
         (columns_.capacity() + rows_.capacity()) * sizeof(int) +
         std::size_t(hessian_.nonZeros()) * (sizeof(double) + sizeof(int));
}

}  // namespace kbvh::experiments::loop
