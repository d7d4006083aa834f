#include "experiments/theory/claim.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "experiments/common/text.hpp"

namespace kbvh::theory {

using nlohmann::json;

namespace {

constexpr std::size_t columns = 120;

const char* symbol(Relation relation) {
  return relation == Relation::at_most ? "<=" : relation == Relation::equal ? "==" : ">=";
}

/// Formats a label and a text next to it, in lines of at most `columns` characters; continuation lines are
/// indented to the text.
std::string labelled(const std::string& label, const std::string& text) {
  constexpr std::size_t indent = 15;
  std::string result, line = "     " + label;
  line.resize(indent, ' ');
  for (const std::string& word : experiments::split(text, ' ')) {
    if (line.size() > indent && line.size() + 1 + word.size() > columns) {
      result += line + "\n";
      line.assign(indent, ' ');
    }
    if (line.size() > indent) line += ' ';
    line += word;
  }
  return result + line + "\n";
}

}  // namespace

const char* name(Verdict verdict) {
  switch (verdict) {
    case Verdict::holds:
      return "holds";
    case Verdict::with_condition:
      return "holds with a condition";
    case Verdict::does_not_hold:
      return "does not hold";
    case Verdict::not_decided:
      break;
  }
  return "not decided here";
}

bool Criterion::met() const {
  const double room = tolerance * std::abs(bound);
  switch (relation) {
    case Relation::at_most:
      return measured <= bound + room;
    case Relation::at_least:
      return measured >= bound - room;
    case Relation::equal:
      break;
  }
  return std::abs(measured - bound) <= room;
}

Verdict verdict(const std::vector<Criterion>& criteria) {
  if (criteria.empty()) return Verdict::not_decided;
  Verdict result = Verdict::holds;
  for (const Criterion& criterion : criteria) {
    if (criterion.met()) continue;
    if (criterion.role == Role::always) return Verdict::does_not_hold;
    result = Verdict::with_condition;
  }
  return result;
}

void Claim::expect_at_most(std::string what, double value, double limit, Role role, double tolerance) {
  criteria.push_back({std::move(what), value, Relation::at_most, limit, tolerance, role});
}
void Claim::expect_at_least(std::string what, double value, double limit, Role role) {
  criteria.push_back({std::move(what), value, Relation::at_least, limit, 0, role});
}
void Claim::expect_equal(std::string what, double value, double limit, Role role) {
  criteria.push_back({std::move(what), value, Relation::equal, limit, 0, role});
}
void Claim::expect_none(std::string what, double value, Role role) {
  expect_equal(std::move(what), value, 0, role);
}

json to_json(const Claim& claim) {
  json criteria = json::array();
  for (const Criterion& c : claim.criteria)
    criteria.push_back({{"what", c.what},
                        {"measured", c.measured},
                        {"relation", symbol(c.relation)},
                        {"bound", c.bound},
                        {"tolerance", c.tolerance},
                        {"role", c.role == Role::always ? "always" : "as stated"},
                        {"met", c.met()}});
  return {{"id", claim.id},
          {"claim", claim.title},
          {"statement", claim.statement},
          {"citation", claim.citation},
          {"counter", claim.counter},
          {"bound", claim.bound},
          {"measured", claim.measured},
          {"verdict", name(claim.verdict())},
          {"condition", claim.verdict() == Verdict::with_condition ? claim.condition : ""},
          {"why", claim.why},
          {"criteria", criteria},
          {"data", claim.data}};
}

std::string claims_table(const std::vector<Claim>& claims) {
  std::string text;
  for (const Claim& claim : claims) {
    const std::string says = name(claim.verdict());
    const std::size_t room = columns - 5 - says.size() - 2;
    text += fmt::format("{:<4} {:<{}}  {}\n", claim.id, claim.title.substr(0, room), room, says);
    if (!claim.bound.empty()) text += labelled("bound", claim.bound);
    if (!claim.measured.empty()) text += labelled("measured", claim.measured);
    if (claim.verdict() == Verdict::with_condition && !claim.condition.empty())
      text += labelled("holds if", claim.condition);
    text += labelled("why", claim.why);
    text += "\n";
  }
  return text;
}

std::string number(std::uint64_t value) {
  std::string digits = std::to_string(value);
  for (std::size_t at = digits.size(); at > 3; at -= 3) digits.insert(at - 3, ",");
  return digits;
}

std::string number(double value) {
  if (value == std::floor(value) && std::abs(value) < 1e15)
    return (value < 0 ? "-" : "") + number(std::uint64_t(std::abs(value)));
  if (std::abs(value) >= 1000 && std::abs(value) < 1e15) return number(std::round(value));
  return fmt::format("{:.3g}", value);
}

}  // namespace kbvh::theory
