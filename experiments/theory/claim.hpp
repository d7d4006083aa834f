#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

/// The paper's theory as checks: data in, verdict out, never a clock.
namespace kbvh::theory {

enum class Verdict : std::uint8_t { holds, with_condition, does_not_hold, not_decided };
/// "holds", "holds with a condition", "does not hold" or "not decided here".
const char* name(Verdict verdict);

enum class Relation : std::uint8_t { at_most, equal, at_least };

/// What a failed criterion means for its claim.
enum class Role : std::uint8_t {
  always,    ///< the claim is wrong, whatever one adds to it
  as_stated  ///< the claim is wrong as it stands, but its condition saves it
};

/// One number against another. `tolerance` is relative to the bound.
struct Criterion {
  std::string what;  ///< of which counter, where
  double measured = 0;
  Relation relation = Relation::at_most;
  double bound = 0;
  double tolerance = 0;
  Role role = Role::always;

  bool met() const;
};

/// Not decided without any criterion; does not hold if one of role `always` is not met; holds with a
/// condition if one of role `as_stated` is not; else holds.
Verdict verdict(const std::vector<Criterion>& criteria);

/// One row of the report.
struct Claim {
  std::string id;         ///< "T1"
  std::string title;      ///< short, for the table
  std::string statement;  ///< as the paper has it, in a sentence
  std::string citation;   ///< theorem and section
  std::string counter;    ///< what is counted
  std::string bound;      ///< what it is held against, with numbers
  std::string measured;   ///< with numbers
  std::string condition;  ///< under which it holds, if one is needed
  std::string why;        ///< a sentence or two that the numbers support
  std::vector<Criterion> criteria;
  nlohmann::json data;  ///< the measurements that it was judged by

  Verdict verdict() const { return theory::verdict(criteria); }
};

/// The claim as theory.json holds it.
nlohmann::json to_json(const Claim& claim);

/// The table for a console: one line per claim, its reason wrapped below, at most 120 columns.
std::string claims_table(const std::vector<Claim>& claims);

/// "12,345" for whole numbers, three significant digits for others.
std::string number(double value);
std::string number(std::uint64_t value);

}  // namespace kbvh::theory
