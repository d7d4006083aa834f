#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace kbvh::lab {

/// The answer to a call from JavaScript: JSON text, in which {"array": k} stands for array k. Arrays are read
/// where they lie and stay valid until the next call.
class Answer {
 public:
  using Json = nlohmann::json;

  /// Keeps the numbers and returns what stands for them in the JSON text.
  Json add(std::vector<std::uint32_t> numbers) {
    words_.push_back(std::move(numbers));
    return listed(words_.back().data(), words_.back().size(), Kind::words);
  }
  Json add(std::vector<double> numbers) {
    doubles_.push_back(std::move(numbers));
    return listed(doubles_.back().data(), doubles_.back().size(), Kind::doubles);
  }
  void set(const Json& json) { text_ = json.dump(-1, ' ', false, Json::error_handler_t::replace); }
  void clear() {
    text_.clear();
    words_.clear();
    doubles_.clear();
    arrays_.clear();
  }

  /// Returns four words that JavaScript reads: address and size of the text, address and number of the
  /// arrays.
  const std::uint32_t* head() {
    head_[0] = address(text_.data());
    head_[1] = std::uint32_t(text_.size());
    head_[2] = address(arrays_.data());
    head_[3] = std::uint32_t(arrays_.size());
    return head_;
  }

 private:
  enum class Kind : std::uint32_t { words, doubles };
  struct Array {
    std::uint32_t address, count, kind;
  };
  static std::uint32_t address(const void* at) { return std::uint32_t(reinterpret_cast<std::uintptr_t>(at)); }
  Json listed(const void* at, std::size_t count, Kind kind) {
    arrays_.push_back({address(at), std::uint32_t(count), std::uint32_t(kind)});
    return {{"array", arrays_.size() - 1}};
  }

  std::string text_;
  std::vector<std::vector<std::uint32_t>> words_;  // moving the outer array leaves the numbers in place
  std::vector<std::vector<double>> doubles_;
  std::vector<Array> arrays_;
  std::uint32_t head_[4] = {};
};

}  // namespace kbvh::lab
