#pragma once
#include <cstdint>
#include <cstring>
#include <vector>

namespace kbvh {

/// Hashes with FNV-1a over 8-byte words and a final avalanche: fast enough for gigabytes, good enough for a
/// cache key.
class Hasher {
 public:
  void bytes(const void* data, std::size_t size) {
    const auto* at = static_cast<const unsigned char*>(data);
    for (; size >= 8; size -= 8, at += 8) {
      std::uint64_t word;
      std::memcpy(&word, at, 8);
      mix(word);
    }
    std::uint64_t tail = 0;
    if (size > 0) std::memcpy(&tail, at, size);
    mix(tail ^ (std::uint64_t(size) << 56));
  }
  template <class T>
  void list(const std::vector<T>& values) {
    mix(values.size());
    bytes(values.data(), values.size() * sizeof(T));
  }
  void mix(std::uint64_t word) {
    state_ = (state_ ^ word) * 0x100000001b3ull;
    state_ ^= state_ >> 29;
  }
  std::uint64_t value() const { return state_ * 0x9e3779b97f4a7c15ull; }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325ull;
};

}  // namespace kbvh
