#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "core/contract/about.hpp"
#include "core/motion/admissible.hpp"
#include "experiments/cli/commands.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/text.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/table.hpp"
#include "experiments/scenes/shape_bodies.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

constexpr const char* list_examples = R"(Examples:
  kbvh list
  kbvh list --json | python3 -c 'import json,sys; print([s["id"] for s in json.load(sys.stdin)["strategies"]])')";

std::vector<std::string> scalars_of(const Info& info) {
  std::vector<std::string> scalars;
  if (info.has_float) scalars.push_back("float");
  if (info.has_double) scalars.push_back("double");
  return scalars;
}

std::vector<std::string> primitives_of(const Info& info) {
  std::vector<std::string> words;
  for (const PrimitiveKind kind : info.primitives) words.push_back(name(kind));
  return words;
}

json strategy_json(const Info& info) {
  json parameters = json::array();
  for (const Parameter& parameter : info.parameters) {
    json one{{"name", parameter.name}, {"default", parameter.default_value}, {"meaning", parameter.meaning}};
    if (parameter.allowed.empty()) {
      one["minimum"] = parameter.least;
      if (std::isfinite(parameter.most)) one["maximum"] = parameter.most;
      one["whole"] = parameter.numbers == Numbers::whole;
    } else {
      one["allowed"] = parameter.allowed;
    }
    parameters.push_back(std::move(one));
  }
  json topology;
  if (!info.topology.own)
    topology = {{"widths", info.topology.widths},
                {"min_leaf_size", info.topology.min_leaf_size},
                {"max_leaf_size", info.topology.max_leaf_size},
                {"preferred", in_words(info.topology.preferred)}};
  json strategy = about_strategy(info);
  strategy.update(
      {{"rays_guarantee", name(info.rays_guarantee)},
       {"positions", info.positions == PositionUse::all       ? "all"
                     : info.positions == PositionUse::fetched ? "fetched"
                                                              : "varying"},
       {"scalars", scalars_of(info)},
       {"capabilities", names(info.can)},
       {"primitives", primitives_of(info)},
       {"parameters", parameters},
       {"topology", topology},
       {"max_primitive_pairs", info.max_primitive_pairs},
       {"max_coordinate", std::isfinite(info.max_coordinate) ? json(info.max_coordinate) : json(nullptr)}});
  return strategy;
}

void print_json() {
  json strategies = json::array(), scenes = json::array(), shapes = json::array(), counters = json::array();
  for (const StrategyEntry& entry : registry()) strategies.push_back(strategy_json(entry.info));
  for (const BuiltinScene& scene : builtin_scenes())
    scenes.push_back({{"name", scene.name}, {"meaning", scene.meaning}});
  for (const ShapeKind& shape : shape_kinds())
    shapes.push_back({{"name", shape.name}, {"meaning", shape.meaning}});
  for (std::size_t c = 0; c < std::size_t(Counter::count); ++c)
    counters.push_back({{"name", name(Counter(c))}, {"meaning", meaning(Counter(c))}});
  const json all{{"strategies", strategies}, {"scenes", scenes}, {"shapes", shapes}, {"counters", counters}};
  print(all.dump(2) + "\n");
}

/// Returns a text in lines of at most 100 characters, indented.
std::string wrapped(std::string_view text, const std::string& indent) {
  std::string lines;
  for (const std::string& paragraph : split(text, '\n')) {
    std::string line = indent;
    for (const std::string& word : split(paragraph, ' ')) {
      if (line.size() > indent.size() && line.size() + 1 + word.size() > 100) {
        lines += line + "\n";
        line = indent;
      }
      line += (line.size() > indent.size() ? " " : "") + word;
    }
    if (line.size() > indent.size()) lines += line + "\n";
  }
  return lines;
}

void print_strategy(const Info& info) {
  std::string text = fmt::format("{}: {} ({})\n", info.id, info.title, info.citation);
  text += wrapped(about(info.id), "    ");
  text +=
      fmt::format("    family {}, foresight {}, {}, guarantee {}, {}{}\n", info.family, name(info.foresight),
                  info.tightness == Tightness::none ? "bounds of no declared tightness"
                                                    : std::string(name(info.tightness)) + " bounds",
                  name(info.guarantee), joined(scalars_of(info), " and "),
                  info.own_scalar.empty() ? "" : ", keeps bounds in " + info.own_scalar);
  if (!info.version.empty()) text += "    " + info.version + ", instructions " + info.instructions + "\n";
  if (!info.remark.empty()) text += wrapped(info.remark, "    ");
  if (info.topology.own)
    text += "    builds its own hierarchy\n";
  else
    text += fmt::format("    at its best: {}, width {}, {} primitives per leaf\n",
                        name(info.topology.preferred.method), info.topology.preferred.width,
                        info.topology.preferred.leaf_size);
  if (const auto words = names(info.can); !words.empty()) text += "    can: " + joined(words) + "\n";
  if (info.baseline) text += "    a baseline: ratios are against the one with the shortest clip\n";
  if (const auto words = primitives_of(info); words.size() < 3)
    text += "    takes only " + joined(words, " and ") + "\n";
  if (info.max_primitive_pairs > 0)
    text += fmt::format("    only up to {} primitive pairs of two bodies\n", info.max_primitive_pairs);
  if (std::isfinite(info.max_coordinate))
    text += fmt::format("    takes coordinates up to {}, and no scene that reaches beyond\n",
                        number_text(info.max_coordinate));
  else if (info.topology.own)
    text += "    takes every admissible coordinate\n";
  for (const Parameter& parameter : info.parameters) {
    text += fmt::format("    {}={} ({}): {}\n", parameter.name, parameter.default_value,
                        admissible(parameter), parameter.meaning);
  }
  print(text);
}

void print_text() {
  print("Strategies\n");
  for (const StrategyEntry& entry : registry()) print_strategy(entry.info);
  print("\nBuilt-in scenes (--scene)\n");
  for (const BuiltinScene& scene : builtin_scenes())
    print(fmt::format("{:<17} {}\n", scene.name, scene.meaning));
  print(
      "\nShapes (--body shape:key=value,...); those at rest also take keyframes, rate, and step or turns\n");
  for (const ShapeKind& shape : shape_kinds()) print(fmt::format("{:<17} {}\n", shape.name, shape.meaning));
}

}  // namespace

void add_list(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("list", "list strategies, built-in scenes and shapes");
  command->footer(list_examples);
  auto as_json = std::make_shared<bool>(false);
  command->add_flag("--json", *as_json, "print everything as JSON");
  command->callback([&action, as_json] {
    action = [as_json] {
      *as_json ? print_json() : print_text();
      return int(success);
    };
  });
}

}  // namespace kbvh::experiments
