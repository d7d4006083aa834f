#include "experiments/study/contestants.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

namespace {

bool has_parameter(const Info& info, const std::string& key) {
  return std::any_of(info.parameters.begin(), info.parameters.end(),
                     [&](const Parameter& parameter) { return parameter.name == key; });
}

constexpr std::string_view family_prefix = "family:";

/// Returns whether the word is the id of a single strategy, and not a word for several.
bool is_id(const std::string& id) {
  return id != "all" && id != "default" && !id.starts_with(family_prefix);
}

struct Selected {
  const StrategyEntry* entry;
  bool by_id;
};

std::vector<Selected> selected(const std::string& id) {
  std::vector<Selected> list;
  const bool by_family = id.starts_with(family_prefix);
  if (is_id(id)) return {{&strategy_named(id), true}};
  std::vector<std::string> known;
  for (const StrategyEntry& entry : registry()) {
    if (std::find(known.begin(), known.end(), entry.info.family) == known.end())
      known.push_back(entry.info.family);
    const bool wanted = id == "all" || (id == "default" && entry.info.guarantee != Guarantee::approximate) ||
                        (by_family && entry.info.family == id.substr(family_prefix.size()));
    if (wanted) list.push_back({&entry, false});
  }
  if (list.empty())
    throw ConfigError(
        no_such("family of strategies", id.substr(family_prefix.size()), known, "`kbvh list` shows them"));
  return list;
}

/// Selects the common parameters that apply to this strategy; removes used ones from `unused`.
Sweep params_for(const Info& info, const Sweep& common, std::set<std::string>& unused) {
  Sweep params;
  for (const auto& [name, values] : common) {
    const std::size_t dot = name.find('.');
    const bool named = dot != std::string::npos;
    if (named && name.substr(0, dot) != info.id) continue;
    const std::string key = named ? name.substr(dot + 1) : name;
    if (!named && !has_parameter(info, key)) continue;
    // "strategy.key" is more specific and wins in either order.
    if (named || !params.contains(key)) params[key] = values;
    unused.erase(name);
  }
  return params;
}

std::vector<std::map<std::string, std::string>> combinations(const Sweep& sweep) {
  std::vector<std::map<std::string, std::string>> all{{}};
  for (const auto& [key, values] : sweep) {
    std::vector<std::map<std::string, std::string>> longer;
    for (const auto& start : all)
      for (const std::string& value : values) {
        auto next = start;
        next[key] = value;
        longer.push_back(std::move(next));
      }
    all = std::move(longer);
  }
  return all;
}

template <class T>
std::vector<std::optional<T>> choices(const std::vector<T>& values) {
  if (values.empty()) return {std::nullopt};
  return {values.begin(), values.end()};
}

std::string label_of(const ContestantSpec& spec) {
  const Info& info = spec.entry->info;
  std::string extras;
  const auto add = [&](const std::string& text) { extras += (extras.empty() ? "" : " ") + text; };
  for (const Parameter& parameter : info.parameters)
    if (spec.params.at(parameter.name) != parameter.default_value)
      add(parameter.name + "=" + spec.params.at(parameter.name));
  if (!info.topology.own) {
    const BuilderConfig& usual = info.topology.preferred;
    if (spec.builder.method != usual.method) add(name(spec.builder.method));
    if (spec.builder.width != usual.width) add("width=" + std::to_string(spec.builder.width));
    if (spec.builder.leaf_size != usual.leaf_size) add("leaf=" + std::to_string(spec.builder.leaf_size));
  }
  return extras.empty() ? info.id : info.id + " [" + extras + "]";
}

[[noreturn]] void refuse_parameter(const Info& info, const std::string& key) {
  std::vector<std::string> known;
  for (const Parameter& parameter : info.parameters) known.push_back(parameter.name);
  throw ConfigError("'" + info.id + "' has no parameter " + io::printable(key) + "; it has " +
                    (known.empty() ? "none" : joined(known)) + suggestion(key, known));
}

/// Rejects a common parameter that no strategy in the list has.
[[noreturn]] void refuse_common_parameter(const std::vector<ContestantSpec>& list, const std::string& name) {
  const bool qualified = name.find('.') != std::string::npos;
  std::vector<std::string> known;
  for (const ContestantSpec& spec : list)
    for (const Parameter& parameter : spec.entry->info.parameters)
      known.push_back((qualified ? spec.entry->info.id + "." : "") + parameter.name);
  throw ConfigError("the parameter " + io::printable(name) + " belongs to none of the chosen strategies" +
                    suggestion(name, known));
}

/// Normalises the values for records: a number becomes its default's text, or the shortest text that reads
/// back as it, so that 2 and 2.0 are one configuration.
std::map<std::string, std::string> in_one_spelling(const Info& info,
                                                   std::map<std::string, std::string> given) {
  for (const Parameter& parameter : info.parameters) {
    const auto found = given.find(parameter.name);
    if (found == given.end() || !parameter.allowed.empty()) continue;
    const auto value = parse_number(found->second), usual = parse_number(parameter.default_value);
    if (!value) continue;  // Params reports the error
    char text[40];
    const bool whole = *value == std::trunc(*value) && std::abs(*value) < 1e15;
    const auto end = whole ? std::to_chars(text, text + sizeof text, std::int64_t(*value)).ptr
                           : std::to_chars(text, text + sizeof text, *value).ptr;
    found->second = usual && *usual == *value ? parameter.default_value : std::string(text, end);
  }
  return given;
}

void add_configurations(std::vector<ContestantSpec>& list, const Selected& choice, const Sweep& params,
                        const BuilderRequest& builder, std::vector<std::string>& notes) {
  const Info& info = choice.entry->info;
  const BuilderRequest none;
  const BuilderRequest& wanted = info.topology.own ? none : builder;
  for (const auto& method : choices(wanted.methods))
    for (const auto& width : choices(wanted.widths))
      for (const auto& leaf_size : choices(wanted.leaf_sizes)) {
        ContestantSpec spec;
        spec.entry = choice.entry;
        try {
          spec.builder = suitable_builder(info, method, width, leaf_size);
        } catch (const ConfigError& problem) {
          if (choice.by_id) throw;
          notes.push_back(std::string(problem.what()) + ": left out");
          continue;
        }
        for (const auto& [key, values] : params)
          if (!has_parameter(info, key)) refuse_parameter(info, key);
        for (const auto& given : combinations(params)) {
          spec.given = in_one_spelling(info, given);
          spec.params = Params(info.id, info.parameters, spec.given).values();
          spec.label = label_of(spec);
          const bool known = std::any_of(list.begin(), list.end(), [&](const ContestantSpec& other) {
            return other.entry == spec.entry && other.label == spec.label;
          });
          if (!known) list.push_back(spec);
        }
      }
}

}  // namespace

const StrategyEntry* known_strategy(const std::string& id) {
  for (const StrategyEntry& entry : registry())
    if (entry.info.id == id) return &entry;
  return nullptr;
}

const StrategyEntry& strategy_named(const std::string& id) {
  if (const StrategyEntry* entry = known_strategy(id)) return *entry;
  std::vector<std::string> known;
  for (const StrategyEntry& entry : registry()) known.push_back(entry.info.id);
  throw ConfigError(no_such("strategy", id, known, "`kbvh list` shows them"));
}

std::vector<ContestantSpec> expand(const std::vector<StrategyRequest>& requests, const Sweep& common,
                                   const BuilderRequest& builder, std::vector<std::string>& notes) {
  std::vector<ContestantSpec> list;
  std::set<std::string> unused;
  for (const auto& [name, values] : common) unused.insert(name);
  std::set<const StrategyEntry*> excluded;
  for (const StrategyRequest& request : requests)
    if (request.id.starts_with('!'))
      for (const Selected& choice : selected(request.id.substr(1))) excluded.insert(choice.entry);
  for (const StrategyRequest& request : requests) {
    if (request.id.starts_with('!')) continue;
    if (request.optional && is_id(request.id) && known_strategy(request.id) == nullptr) {
      notes.push_back("this program was built without the strategy '" + request.id + "': left out");
      continue;
    }
    for (const Selected& choice : selected(request.id)) {
      if (excluded.contains(choice.entry)) continue;
      Sweep params = params_for(choice.entry->info, common, unused);
      for (const auto& [key, values] : request.params) params[key] = values;
      add_configurations(list, choice, params, request.builder.empty() ? builder : request.builder, notes);
    }
  }
  if (!unused.empty()) refuse_common_parameter(list, *unused.begin());
  if (list.empty()) throw ConfigError("no strategy is left: " + (notes.empty() ? "none chosen" : notes[0]));
  return list;
}

template <class S>
std::string unsuitable(const Info& info, const Scene<S>& scene, const PlanScript<S>& script,
                       std::span<const double> frames) {
  if (!(sizeof(S) == 4 ? info.has_float : info.has_double))
    return std::string("has no ") + (sizeof(S) == 4 ? "float" : "double") + " version";
  if (script.changes_plans() && !info.can.plan_changes) return "cannot take changes of plans";
  if (script.changes_geometry() && !info.can.geometry_changes) return "cannot take changes of geometry";
  if (std::string why = unsuitable_bodies(info, scene); !why.empty()) return why;
  if (std::string why = out_of_range(info, scene, script, frames); !why.empty()) return why;
  if (info.max_primitive_pairs == 0) return {};
  for (const BodyPair& pair : scene.pairs) {
    const std::uint64_t pairs = std::uint64_t(scene.bodies[pair.first].primitives.count()) *
                                scene.bodies[pair.second].primitives.count();
    if (pairs > info.max_primitive_pairs)
      return "is offered at most " + std::to_string(info.max_primitive_pairs) +
             " primitive pairs of two bodies, here are " + std::to_string(pairs);
  }
  return {};
}

template std::string unsuitable(const Info&, const Scene<float>&, const PlanScript<float>&,
                                std::span<const double>);
template std::string unsuitable(const Info&, const Scene<double>&, const PlanScript<double>&,
                                std::span<const double>);

}  // namespace kbvh::experiments
