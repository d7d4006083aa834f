#include "experiments/study/targets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "experiments/common/json_reader.hpp"
#include "experiments/common/text.hpp"
#include "experiments/study/plan.hpp"
#include "experiments/study/strategy_record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

// --- from the plan --------------------------------------------------------------------------------------

namespace {

const std::vector<std::string> phases{
    "motion", "update",           "traversal",          "triangle_tests",   "query", "candidates", "total",
    "upkeep", "update_per_event", "upkeep_with_motion", "total_with_motion"};

template <class T>
bool has(const std::vector<T>& list, const T& value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

template <class T>
T needed(const JsonReader& keys, const std::string& key, const std::optional<T>& value) {
  if (!value) keys.fail(key, "is missing");
  return *value;
}

std::string needed_word(JsonReader& keys, const std::string& key) {
  const std::string text = needed(keys, key, keys.word(key));
  if (text.empty()) keys.fail(key, "is empty");
  return text;
}

TargetSelector read_selector(JsonReader& target, const std::string& key) {
  const json* value = target.find(key);
  if (value == nullptr) target.fail(key, "is missing");
  const std::string place = target.place() + ": " + key;
  JsonReader keys(*value, place);
  TargetSelector selector;
  selector.strategy = needed_word(keys, "strategy");
  selector.or_else = keys.words("or");
  selector.phase = needed_word(keys, "phase");
  if (!has(phases, selector.phase))
    keys.fail("phase", "expected one of " + joined(phases) + ", got '" + selector.phase + "'");
  if (const auto scene = keys.word("scene")) {
    if (scene->empty()) keys.fail("scene", "is empty");
    selector.scene = *scene;
  }
  if (const json* params = keys.find("params")) selector.params = read_params(*params, place + ": params");
  if (const json* builder = keys.find("builder"))
    selector.builder = read_builder(*builder, place + ": builder");
  keys.finish();
  return selector;
}

Target read_target(const json& value, const std::string& place) {
  JsonReader keys(value, place);
  Target target;
  target.place = place;
  target.what = needed_word(keys, "what");
  target.note = keys.word("note").value_or("");
  target.numerator = read_selector(keys, "numerator");
  target.denominator = read_selector(keys, "denominator");
  target.scenes = keys.words("scenes");
  if (target.scenes.empty()) keys.fail("scenes", "is missing");
  const std::string over = keys.word("over").value_or("worst");
  if (over != "worst" && over != "geometric_mean")
    keys.fail("over", "expected worst or geometric_mean, got '" + over + "'");
  target.mean = over == "geometric_mean";
  target.scalar = needed_word(keys, "scalar");
  if (target.scalar != "float" && target.scalar != "double")
    keys.fail("scalar", "expected float or double, got '" + target.scalar + "'");
  target.changes = keys.word("changes").value_or("");
  if (!target.changes.empty() && target.changes != answer_word(Answer::candidates) &&
      target.changes != answer_word(Answer::pairs))
    keys.fail("changes", "expected candidates or pairs, got '" + target.changes + "'");
  target.per_keyframe = std::uint32_t(needed(keys, "l", keys.whole("l", ranges::frames_per_keyframe)));
  target.at_least = needed(keys, "at_least", keys.number("at_least"));
  target.aim = needed(keys, "aim", keys.number("aim"));
  if (target.at_least <= 0) keys.fail("at_least", fmt::format("must be above 0, got {}", target.at_least));
  if (target.at_least > target.aim)
    keys.fail("at_least",
              fmt::format("must not be above the aim, {} is above {}", target.at_least, target.aim));
  keys.finish();
  return target;
}

/// Returns whether the study measures in this scalar and l, and the same kind of answer.
bool measures(const Study& study, const Target& target) {
  return has(study.scalars, target.scalar) && has(study.per_keyframe, target.per_keyframe) &&
         target.changes == (study.asks.changes ? answer_word(*study.asks.changes) : "");
}

/// Returns the name of a scene in a study's tables and targets; empty if it has none.
std::string name_in(const Study& study, const SceneSpec& spec) {
  const std::string name = given_name(spec);
  return name.empty() ? name : name + target_suffix(study.asks);
}

std::string conditions(const Target& target) {
  const std::string as = target.changes.empty() ? "" : " as changes of " + target.changes;
  return fmt::format("in {} at l = {}{}", target.scalar, target.per_keyframe, as);
}

}  // namespace

std::vector<Target> read_targets(const std::vector<json>& list, const std::string& place) {
  std::vector<Target> targets;
  for (std::size_t i = 0; i < list.size(); ++i)
    targets.push_back(read_target(list[i], place + ": targets[" + std::to_string(i) + "]"));
  return targets;
}

void check_target_scenes(const Plan& plan) {
  for (const Target& target : plan.targets) {
    std::vector<std::string> known;
    std::set<std::string> meanings;
    const auto fail = [&](const std::string& what) {
      throw io::InputError(target.place + ": scenes: " + what);
    };
    std::vector<std::string> scenes = target.scenes;
    for (const TargetSelector* side : {&target.numerator, &target.denominator})
      if (!side->scene.empty()) scenes.push_back(side->scene);
    for (const std::string& scene : scenes) {
      meanings.clear();
      for (const Study& study : plan.studies) {
        if (!measures(study, target)) continue;
        for (const SceneSpec& spec : study.scenes) {
          const std::string name = name_in(study, spec);
          if (!name.empty() && !has(known, name)) known.push_back(name);
          if (name == scene) meanings.insert(spec.said);
        }
      }
      if (meanings.empty())
        fail("no study has a scene of the name '" + scene + "' " + conditions(target) +
             (known.empty() ? "; there are none with a name" : "; there are " + joined(known)));
      if (meanings.size() > 1) fail("'" + scene + "' is the name of several scenes");
    }
  }
}

// --- which contestants ----------------------------------------------------------------------------------

bool is_known(const TargetSelector& selector) {
  return selector.strategy == best_refit_word || known_strategy(selector.strategy) != nullptr;
}

bool matches(const TargetSelector& selector, const json& strategy) {
  const std::string id = strategy.at("id").get<std::string>();
  const bool any_baseline = selector.strategy == best_refit_word;
  if (any_baseline ? !strategy.value("baseline", strategy.value("family", "") == "refit")
                   : id != selector.strategy && !has(selector.or_else, id))
    return false;
  for (const auto& [key, values] : selector.params)
    if (!has(values, strategy.at("params").value(key, any_baseline ? values.front() : std::string())))
      return false;
  if (selector.builder.empty()) return true;
  const json& builder = strategy.at("builder");
  if (!builder.is_object()) return false;
  const BuilderRequest& wanted = selector.builder;
  const auto allowed = [](const auto& list, const auto& value) { return list.empty() || has(list, value); };
  return allowed(wanted.methods, build_method(builder.at("method").get<std::string>())) &&
         allowed(wanted.widths, builder.at("width").get<std::uint32_t>()) &&
         allowed(wanted.leaf_sizes, builder.at("leaf_size").get<std::uint32_t>());
}

std::string described(const TargetSelector& selector) {
  std::vector<std::string> facts;
  const auto add = [&](const std::string& key, const std::vector<std::string>& values) {
    if (!values.empty()) facts.push_back(key + " " + joined(values, " or "));
  };
  std::vector<std::string> methods, widths, sizes;
  for (const BuildMethod method : selector.builder.methods) methods.push_back(name(method));
  for (const std::uint32_t width : selector.builder.widths) widths.push_back(std::to_string(width));
  for (const std::uint32_t size : selector.builder.leaf_sizes) sizes.push_back(std::to_string(size));
  add("method", methods);
  add("width", widths);
  add("leaf_size", sizes);
  for (const auto& [key, values] : selector.params) add(key, values);
  std::string who = selector.strategy == best_refit_word ? "the best refit" : selector.strategy;
  for (const std::string& other : selector.or_else) who += " or " + other;
  return who + (facts.empty() ? "" : " with " + joined(facts));
}

namespace {

bool asked_for_if_there(const Plan& plan, const std::string& id) {
  for (const Study& study : plan.studies)
    for (const StrategyRequest& request : study.strategies)
      if (request.optional && request.id == id) return true;
  return false;
}

void check_selector(const Plan& plan, const TargetSelector& selector, const std::string& place) {
  if (selector.strategy == best_refit_word) {
    if (!selector.or_else.empty()) throw io::InputError(place + ": or: the best refit has no alternatives");
    return;
  }
  for (const std::string& other : selector.or_else) {
    TargetSelector one = selector;
    one.strategy = other;
    one.or_else.clear();
    check_selector(plan, one, place);
  }
  const StrategyEntry* entry = known_strategy(selector.strategy);
  if (entry == nullptr) {
    if (asked_for_if_there(plan, selector.strategy)) return;
    try {
      strategy_named(selector.strategy);
    } catch (const ConfigError& problem) {
      throw io::InputError(place + ": strategy: " + problem.what());
    }
  }
  try {
    for (const auto& [key, values] : selector.params)
      for (const std::string& value : values) Params(entry->info.id, entry->info.parameters, {{key, value}});
  } catch (const ConfigError& problem) {
    throw io::InputError(place + ": params: " + problem.what());
  }
  if (entry->info.topology.own && !selector.builder.empty())
    throw io::InputError(place + ": builder: " + selector.strategy + " builds its own hierarchy");
}

}  // namespace

void check_target_contestants(const Plan& plan, const std::vector<std::vector<ContestantSpec>>& contestants) {
  for (const Target& target : plan.targets) {
    const TargetSelector* sides[] = {&target.numerator, &target.denominator};
    bool all_here = true;
    for (const TargetSelector* side : sides) {
      check_selector(plan, *side, target.place + (side == sides[0] ? ": numerator" : ": denominator"));
      all_here = all_here && is_known(*side);
    }
    if (!all_here) continue;
    /// Whether a study of the plan measures the sides on one scene.
    const auto measured_on = [&](const std::string& scene, const std::vector<const TargetSelector*>& wanted) {
      for (std::size_t s = 0; s < plan.studies.size(); ++s) {
        const Study& study = plan.studies[s];
        const bool has_scene =
            std::any_of(study.scenes.begin(), study.scenes.end(),
                        [&](const SceneSpec& spec) { return name_in(study, spec) == scene; });
        if (has_scene && measures(study, target) &&
            std::all_of(wanted.begin(), wanted.end(), [&](const TargetSelector* side) {
              return std::any_of(
                  contestants[s].begin(), contestants[s].end(),
                  [&](const ContestantSpec& spec) { return matches(*side, strategy_record(spec)); });
            }))
          return true;
      }
      return false;
    };
    std::vector<const TargetSelector*> anywhere;
    for (const TargetSelector* side : sides) {
      if (side->scene.empty())
        anywhere.push_back(side);
      else if (!measured_on(side->scene, {side}))
        throw io::InputError(target.place + ": no study has " + described(*side) + " on '" + side->scene +
                             "' " + conditions(target));
    }
    for (const std::string& scene : target.scenes) {
      if (!measured_on(scene, anywhere))
        throw io::InputError(target.place + ": no study has both " + described(target.numerator) + " and " +
                             described(target.denominator) + " on '" + scene + "' " + conditions(target));
    }
  }
}

}  // namespace kbvh::experiments
