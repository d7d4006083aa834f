#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "experiments/common/ranges.hpp"
#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

/// Reads the members of one JSON object. Throws io::InputError with the place and the key for wrong types,
/// missing members, and, in `finish`, members that were never requested.
class JsonReader {
 public:
  /// `place` is the beginning of messages, for example "plan.json: scenes[0]". Throws if `value` is not an
  /// object.
  JsonReader(const nlohmann::json& value, std::string place);

  bool has(const std::string& key) const { return value_->contains(key); }
  /// Returns the member, or nullptr; marks it as requested.
  const nlohmann::json* find(const std::string& key);
  std::optional<std::string> word(const std::string& key);
  std::optional<double> number(const std::string& key);
  /// Reads a whole number within [least, most].
  std::optional<std::uint64_t> whole(const std::string& key, std::uint64_t least, std::uint64_t most);
  std::optional<std::uint64_t> whole(const std::string& key, const WholeRange& range) {
    return whole(key, range.least, range.most);
  }
  std::optional<bool> truth(const std::string& key);
  /// Reads the elements of a list; a value that is not a list counts as a list of one; empty if there is no
  /// such member. An empty list is an error.
  std::vector<nlohmann::json> list(const std::string& key);
  std::vector<std::string> words(const std::string& key);
  std::vector<std::uint64_t> wholes(const std::string& key, std::uint64_t least, std::uint64_t most);
  std::vector<std::uint64_t> wholes(const std::string& key, const WholeRange& range) {
    return wholes(key, range.least, range.most);
  }
  /// Reads exactly `size` numbers.
  std::optional<std::vector<double>> numbers(const std::string& key, std::size_t size);

  /// Throws if there is a member that was never requested; names it and the known members.
  void finish() const;
  /// Throws "place: key: what".
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;
  const std::string& place() const { return place_; }

 private:
  std::uint64_t whole_of(const nlohmann::json& value, const std::string& key, std::uint64_t least,
                         std::uint64_t most) const;
  const nlohmann::json* value_;
  std::string place_;
  std::set<std::string> known_;
};

/// Parses a text like io::parse_json_text; throws io::InputError with `name`, line and column.
nlohmann::json parse_json(const std::string& text, const std::string& name);

}  // namespace kbvh::experiments
