#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

/// The paper's theory as checks: data in, verdict out, no clock.
namespace kbvh::theory {

enum class Verdict : std::uint8_t { holds, with_condition, does_not_hold, not_decided };
/// Returns "holds", "holds with a condition", "does not hold" or "not decided here".
const char* name(Verdict verdict);

enum class Relation : std::uint8_t { at_most, equal, at_least };

/// The effect of a failed criterion on its claim.
enum class Role : std::uint8_t {
  always,    ///< the claim is wrong under any condition
  as_stated  ///< the claim is wrong as stated, but holds with its condition
};

/// A comparison of two numbers. `tolerance` is relative to the bound.
struct Criterion {
  std::string what;  ///< the counter and its place
  double measured = 0;
  Relation relation = Relation::at_most;
  double bound = 0;
  double tolerance = 0;
  Role role = Role::always;

  bool met() const;
};

/// Decides: not decided without any criterion; does not hold if one of role `always` is not met; holds with a
/// condition if one of role `as_stated` is not met; else holds.
Verdict verdict(const std::vector<Criterion>& criteria);

/// One row of the report.
struct Claim {
  std::string id;         ///< "T1"
  std::string title;      ///< short, for the table
  std::string statement;  ///< the paper's claim, in one sentence
  std::string citation;   ///< theorem and section
  std::string counter;    ///< the counted quantity
  std::string bound;      ///< the bound, with numbers
  std::string measured;   ///< with numbers
  std::string condition;  ///< under which the claim holds, if one is needed
  std::string why;        ///< one or two sentences supported by the numbers
  std::vector<Criterion> criteria;
  nlohmann::json data;  ///< the deciding measurements

  Verdict verdict() const { return theory::verdict(criteria); }

  /// Add a criterion: the value of a counter must be at most, at least or exactly `limit`, or 0.
  void expect_at_most(std::string what, double value, double limit, Role role = Role::always,
                      double tolerance = 0);
  void expect_at_least(std::string what, double value, double limit, Role role = Role::always);
  void expect_equal(std::string what, double value, double limit, Role role = Role::always);
  void expect_none(std::string what, double value, Role role = Role::always);
};

/// Makes the claim of theory.json.
nlohmann::json to_json(const Claim& claim);

/// Formats the table for a console: one line per claim, its reason wrapped below, at most 120 columns.
std::string claims_table(const std::vector<Claim>& claims);

/// Formats "12,345" for whole numbers, three significant digits for others.
std::string number(double value);
std::string number(std::uint64_t value);

}  // namespace kbvh::theory
