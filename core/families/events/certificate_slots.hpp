#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

namespace kbvh {

/// Maps the certificates of one tree to slots of a shared event queue. A tree numbers its certificates by
/// places. The initial places have consecutive slots. Later places get slots in chunks at the queue's end, so
/// that no slot ever moves. place -> slot is O(1), slot -> place O(log chunks).
class CertificateSlots {
 public:
  /// Assigns the slots from `first` on to places 0 .. places - 1.
  CertificateSlots(std::uint32_t first, std::uint32_t places) : first_(first), packed_(places) {}

  std::uint32_t slot(std::uint32_t place) const {
    if (place < packed_) return first_ + place;
    const std::uint32_t late = place - packed_;
    return chunks_[late / chunk] + late % chunk;
  }
  /// Returns the place of a slot of this tree.
  std::uint32_t place(std::uint32_t slot) const {
    const std::uint32_t at = slot - first_;
    if (at < packed_) return at;
    const auto above = std::upper_bound(chunks_.begin(), chunks_.end(), slot);
    const auto index = std::uint32_t(above - chunks_.begin()) - 1;
    return packed_ + index * chunk + (slot - chunks_[index]);
  }
  /// Makes room for `places` places, here and in the queue. Throws std::length_error if the queue cannot
  /// number them.
  template <class Queue>
  void grow(std::uint32_t places, Queue& queue) {
    while (packed_ + chunks_.size() * chunk < places) {
      const std::uint32_t first = queue.slots();
      if (first > std::numeric_limits<std::uint32_t>::max() - chunk)
        throw std::length_error("more certificates than a queue can number");
      chunks_.push_back(first);
      queue.grow(first + chunk);
    }
  }
  std::size_t bytes() const { return chunks_.capacity() * sizeof(std::uint32_t); }

 private:
  static constexpr std::uint32_t chunk = 384;  ///< 64 nodes of an AABB tree
  std::uint32_t first_, packed_;
  std::vector<std::uint32_t> chunks_;  ///< first slots; ascending
};

}  // namespace kbvh
