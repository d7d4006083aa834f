#include "experiments/scenes/cloth_parts.hpp"

#include <algorithm>
#include <cstdio>
#include <numeric>

#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::scenes::cloth {

bool LayerContacts::stale(const std::vector<Vec>& x) const {
  if (listed_at_.size() != x.size()) return true;
  // The list holds all pairs that can be in contact until a vertex has moved by more than half of the list's
  // margin.
  const double slack = 0.25 * distance_;
  for (std::size_t p = 0; p < x.size(); ++p) {
    const Vec d = x[p] - listed_at_[p];
    if (dot(d, d) > slack * slack) return true;
  }
  return false;
}

void LayerContacts::sort_into_cells(const std::vector<Vec>& x) {
  // Hashed cells, filled by counting: each cell holds its vertices in rising order.
  cells_ = std::bit_ceil(std::uint32_t(2 * x.size()));
  cell_start_.assign(cells_ + 1, 0);
  cell_of_.resize(x.size());
  sorted_.resize(x.size());
  for (std::size_t p = 0; p < x.size(); ++p) {
    cell_of_[p] = cell(lattice(x[p].x), lattice(x[p].y), lattice(x[p].z));
    ++cell_start_[cell_of_[p] + 1];
  }
  std::partial_sum(cell_start_.begin(), cell_start_.end(), cell_start_.begin());
  next_.assign(cell_start_.begin(), cell_start_.end() - 1);
  for (std::size_t p = 0; p < x.size(); ++p) sorted_[next_[cell_of_[p]]++] = std::uint32_t(p);
}

void LayerContacts::push_apart(std::vector<Vec>& x, const std::vector<Vec>& previous, double friction) const {
  for (const auto& [a, b] : pairs_) {
    const Vec d = x[b] - x[a];
    const double square = dot(d, d);
    if (!(square < distance_ * distance_) || !(square > 0.0)) continue;
    const double now = std::sqrt(square);
    const Vec n = d * (1.0 / now);
    const double push = 0.5 * (distance_ - now);
    x[a] -= n * push;
    x[b] += n * push;
    Vec slide = (x[b] - previous[b]) - (x[a] - previous[a]);
    slide -= n * dot(slide, n);
    const double amount = length(slide);
    if (!(amount > 0.0)) continue;
    const Vec hold = slide * (0.5 * std::min(1.0, friction * 2.0 * push / amount));
    x[a] += hold;
    x[b] -= hold;
  }
}

std::string ConfigHash::digits() const {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash_));
  return text;
}

void check_range(const char* scene, double value, double lowest, double highest, const char* what) {
  if (!(value >= lowest) || !(value <= highest))
    throw io::InputError(std::string(scene) + ": " + what + " is " + io::text_of(value) + ", must be from " +
                         io::text_of(lowest) + " to " + io::text_of(highest));
}

}  // namespace kbvh::scenes::cloth
