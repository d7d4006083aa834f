#include "experiments/theory/theory.hpp"

#include <algorithm>
#include <fstream>
#include <optional>

#include "experiments/common/machine.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/results/results.hpp"
#include "experiments/theory/judge.hpp"
#include "experiments/theory/measure_boxtree.hpp"
#include "experiments/theory/measure_counts.hpp"
#include "experiments/theory/measure_curves.hpp"
#include "experiments/theory/measure_exact.hpp"
#include "experiments/theory/measure_proposals.hpp"
#include "experiments/theory/measure_separation.hpp"
#include "experiments/theory/theory_scenes.hpp"

namespace kbvh::theory {

using nlohmann::json;

TheoryOptions quick_theory() {
  return {};
}

TheoryOptions full_theory() {
  TheoryOptions options;
  options.sizes = {250, 500, 1000, 2000, 4000, 8000, 16000, 32000, 65000, 130000, 260000, 580000};
  options.keyframes = 60;
  options.exact_limit = 16000;
  options.simulation_limit = 65000;
  options.boxtree_limit = 65000;
  options.separation_size = 2000;
  options.list_limit = 65000;
  options.list_audits = 100;
  options.sequence_keyframes = 0;
  return options;
}

MeasurementStore::MeasurementStore(std::filesystem::path file, std::string program)
    : file_(std::move(file)), program_(std::move(program)) {
  if (file_.empty()) return;
  std::ifstream in(file_);
  for (std::string line; std::getline(in, line);) {
    // The last line of an interrupted run may be incomplete.
    const json record = experiments::json_or_nothing(line);
    if (!record.is_object() || !record.contains("value")) continue;
    const auto made_by = record.find("program"), key = record.find("key");
    if (made_by != record.end() && key != record.end() && *made_by == json(program_) && key->is_string())
      kept_[key->get<std::string>()] = record["value"];
  }
  // Terminates an incomplete line before appending.
  std::ofstream out(file_, std::ios::app);
  out << "\n" << std::flush;
  if (!out) throw io::InputError("cannot write " + file_.string());
}

const json* MeasurementStore::find(const std::string& key) const {
  const auto at = kept_.find(key);
  return at == kept_.end() ? nullptr : &*at;
}

void MeasurementStore::keep(const std::string& key, const json& value) {
  kept_[key] = value;
  if (file_.empty()) return;
  std::ofstream out(file_, std::ios::app);
  out << json{{"program", program_}, {"key", key}, {"value", value}}.dump() << "\n" << std::flush;
  if (!out) throw io::InputError("cannot write " + file_.string());
}

namespace {

constexpr std::uint32_t ls[] = {1, 3, 10, 30, 100};

/// Makes a scene once, and only if a measurement needs it.
class LazyScene {
 public:
  explicit LazyScene(std::function<Scene<float>()> make) : make_(std::move(make)) {}
  const Scene<float>& operator()() {
    if (!scene_) scene_ = make_();
    return *scene_;
  }

 private:
  std::function<Scene<float>()> make_;
  std::optional<Scene<float>> scene_;
};

class Runner {
 public:
  Runner(const TheoryOptions& options, MeasurementStore& store, const TheoryProgress& progress)
      : options_(&options), store_(&store), progress_(&progress) {}

  TheoryReport run() {
    for (const std::string& family : options_->scenes) {
      bool too_large = false;
      for (std::size_t i = 0; i < options_->sizes.size(); ++i) {
        const std::uint32_t size = options_->sizes[i];
        if (family == "tablecloth" && size > options_->simulation_limit) {
          too_large = true;
          continue;
        }
        family_at(family, size);
      }
      if (too_large)
        report_.notes.push_back(family + " is simulated, and left out above " +
                                number(std::uint64_t(options_->simulation_limit)) + " triangles.");
    }
    for (const std::string& name : options_->sequences) sequence(name);
    for (const std::string family : {"thrown_shards", "thrown_cloth"}) curves(family);
    constructed();
    report_.fits = fit_growth(report_.counts, 6);
    judge();
    return std::move(report_);
  }

 private:
  /// Returns whether this size is used when one suffices: the smallest from `wanted` on, else the largest.
  bool chosen(std::uint32_t size, std::uint32_t wanted) const {
    std::uint32_t best = 0, largest = 0;
    for (const std::uint32_t s : options_->sizes) {
      largest = std::max(largest, s);
      if (s >= wanted && (best == 0 || s < best)) best = s;
    }
    return size == (best == 0 ? largest : best);
  }

  template <class Measurement, class Make>
  Measurement get(const std::string& what, const std::string& scene, const std::string& parameters,
                  Make make) {
    if (*progress_) (*progress_)(what + ": " + scene + " " + parameters);
    return store_->get<Measurement>(what + "|" + scene + "|" + parameters, make);
  }

  void family_at(const std::string& family, std::uint32_t size) {
    const std::string parameters = std::to_string(size) + "x" + std::to_string(options_->keyframes);
    LazyScene scene([&] { return moving_scene(family, size, options_->keyframes); });
    LazyScene colliding([&] { return colliding_scene(family, size, options_->keyframes); });
    report_.counts.push_back(
        get<CountRun>("counts", family, parameters, [&] { return measure_counts(scene()); }));
    if (size <= options_->boxtree_limit) boxtree(family, parameters, scene, size == exact_size());
    if (size == exact_size())
      exact_.push_back(get<ExactRun>("exact envelopes", family,
                                     parameters + "+" + std::to_string(options_->instants),
                                     [&] { return measure_exact(scene(), options_->instants); }));
    if (size <= options_->list_limit) separation(family, size, parameters, colliding);
    if (chosen(size, 500)) proposals(family, size, parameters, colliding);
    if (chosen(size, 250)) plan_changes(family, parameters, scene);
    if (!chosen(size, 500)) return;
    const auto frames =
        get<std::vector<FrameRun>>("frames", family, parameters, [&] { return measure_frames(scene(), ls); });
    report_.frames.insert(report_.frames.end(), frames.begin(), frames.end());
    loose_.push_back(
        get<LooseRun>("loose boxes", family, parameters, [&] { return measure_loose(scene(), 10); }));
  }

  /// Thrown bodies, in segments and in one that holds the whole flight.
  void curves(const std::string& family) {
    for (const std::uint32_t size : options_->sizes) {
      if (!chosen(size, 500)) continue;
      for (const std::uint32_t keyframes : {2U, options_->keyframes}) {
        const std::string parameters = std::to_string(size) + "x" + std::to_string(keyframes);
        curves_.push_back(get<CurveRun>("curves", family, parameters, [&] {
          return measure_curves(moving_scene(family, size, keyframes));
        }));
        motions_.push_back(get<MotionRun>("motion", family, parameters, [&] {
          return measure_motion(colliding_scene(family, size, keyframes));
        }));
      }
    }
  }

  void plan_changes(const std::string& family, const std::string& parameters, LazyScene& scene) {
    if (report_.counts.back().events > 0)
      plans_.push_back(get<PlanRun>("plan changes", family, parameters, [&] {
        return measure_plan_changes(scene(), velocity_script(scene(), 10, 20), 10);
      }));
  }

  void boxtree(const std::string& name, const std::string& parameters, LazyScene& scene, bool exact) {
    const CountRun& counts = report_.counts.back();
    boxtrees_.push_back(get<BoxTreeRun>(exact ? "BoxTree and envelopes" : "BoxTree", name, parameters, [&] {
      return measure_boxtree(scene(), counts, exact ? Proof::exact_envelopes : Proof::none);
    }));
  }

  void separation(const std::string& family, std::uint32_t size, const std::string& parameters,
                  LazyScene& scene) {
    list_sizes_.push_back(
        get<ListSizeRun>("list size", family, parameters, [&] { return measure_list_size(scene()); }));
    if (chosen(size, options_->separation_size))
      separations_.push_back(get<SeparationRun>(
          "separation list", family, parameters + "+" + std::to_string(options_->list_audits),
          [&] { return measure_separation(scene(), options_->list_audits); }));
  }

  /// What the paper proposes in its last section.
  void proposals(const std::string& family, std::uint32_t size, const std::string& parameters,
                 LazyScene& scene) {
    for (const std::uint32_t width : {2U, 4U, 8U})
      orders_.push_back(get<OrderRun>("order " + std::to_string(width), family, parameters,
                                      [&] { return measure_order(scene(), width); }));
    for (const std::string rebuild : {"never", "median", "sah"})
      rebuilds_.push_back(get<RebuildRun>("rebuild " + rebuild, family, parameters,
                                          [&] { return measure_rebuild(scene(), rebuild); }));
    const std::uint32_t small = std::min<std::uint32_t>(size, options_->separation_size);
    sweeps_.push_back(get<SweepRun>("sweeps of " + std::to_string(small), family, parameters, [&] {
      return measure_sweeps(colliding_scene(family, small, options_->keyframes));
    }));
  }

  /// Returns the largest size that is checked against exact envelopes.
  std::uint32_t exact_size() const {
    std::uint32_t largest = 0;
    for (const std::uint32_t s : options_->sizes)
      if (s <= options_->exact_limit) largest = std::max(largest, s);
    return largest;
  }

  void sequence(const std::string& name) {
    const std::string parameters = std::to_string(options_->sequence_keyframes) + " keyframes";
    auto loaded = data_scene(name, options_->sequence_keyframes);
    if (!loaded) {
      report_.notes.push_back("There is no sequence " + name + " in the data folder; it is left out.");
      return;
    }
    LazyScene lazy([&] { return *loaded; });
    const Scene<float>& scene = *loaded;
    report_.counts.push_back(
        get<CountRun>("counts", name, parameters, [&] { return measure_counts(scene); }));
    boxtree(name, parameters, lazy, true);
    exact_.push_back(get<ExactRun>("exact envelopes", name,
                                   parameters + "+" + std::to_string(options_->instants),
                                   [&] { return measure_exact(scene, options_->instants); }));
    const std::uint32_t l = 10;
    const auto frames = get<std::vector<FrameRun>>("frames", name, parameters, [&] {
      return measure_frames(scene, std::vector<std::uint32_t>{1, l});
    });
    report_.frames.insert(report_.frames.end(), frames.begin(), frames.end());
    loose_.push_back(get<LooseRun>("loose boxes", name, parameters, [&] { return measure_loose(scene, l); }));
  }

  void constructed() {
    for (const std::uint32_t triangles : {1000u, 4000u})
      fans_.push_back(get<CountRun>("counts", "fan", std::to_string(triangles),
                                    [&] { return measure_counts(fan_scene(triangles)); }));
    for (const std::uint32_t n : {8U, 32U, 128U})
      curves_.push_back(get<CurveRun>("curves", "parabolas", std::to_string(n), [&] {
        CurveRun run = measure_curves(parabolas_scene(n));
        run.built = 2 * n - 2;
        return run;
      }));
    for (const std::uint32_t n : {2U, 8U})
      curves_.push_back(get<CurveRun>("curves", "cubics", std::to_string(n), [&] {
        CurveRun run = measure_curves(cubics_scene(n));
        run.built = 3 * n - 3;
        return run;
      }));
    constructed_ = get<std::vector<FrameRun>>("frames", "tangents", "16", [&] {
      return measure_frames(tangents_scene(16), std::vector<std::uint32_t>{1});
    });
    for (const char* tree : {"one axis", "root x, else y", "mixed"})
      for (const std::uint32_t leaves : {64u, 256u, 1024u, 4096u})
        searches_.push_back(get<SearchRun>("searches", tree, std::to_string(leaves),
                                           [&] { return measure_searches(tree, leaves); }));
    const std::string parameters = "5000x" + std::to_string(options_->keyframes);
    translations_.push_back(get<TranslationRun>("translation", "near", parameters, [&] {
      const Translation near = near_translation(5000, options_->keyframes);
      return measure_translation(near.scene, near.rounded);
    }));
    translations_.push_back(get<TranslationRun>("translation", "far", parameters, [&] {
      const Translation far = far_translation(5000, options_->keyframes);
      return measure_translation(far.scene, far.rounded);
    }));
  }

  void judge() {
    std::vector<Claim>& claims = report_.claims;
    claims.push_back(judge_valid_at_all_times(exact_));
    claims.push_back(judge_compact(report_.counts));
    claims.push_back(judge_responsive(report_.counts));
    claims.push_back(judge_local(report_.counts, fans_));
    claims.push_back(judge_efficient(report_.counts, exact_));
    claims.push_back(judge_number_of_events(report_.counts, exact_, report_.fits, curves_));
    claims.push_back(judge_independent_of_frames(report_.frames));
    claims.push_back(judge_optimal(exact_, loose_));
    claims.push_back(judge_never_more_updates(report_.frames, constructed_));
    claims.push_back(judge_translation(translations_));
    claims.push_back(judge_boxtree_size(boxtrees_));
    claims.push_back(judge_boxtree_qualities(boxtrees_, searches_));
    claims.push_back(judge_separation_list(separations_));
    claims.push_back(judge_list_size(list_sizes_));
    claims.push_back(judge_plan_changes(plans_));
    claims.push_back(judge_lower_bound(loose_));
    claims.push_back(judge_order(orders_));
    claims.push_back(judge_rebuild(rebuilds_));
    claims.push_back(judge_sweeps(sweeps_));
    claims.push_back(judge_motion(motions_));
  }

  const TheoryOptions* options_;
  MeasurementStore* store_;
  const TheoryProgress* progress_;
  TheoryReport report_;
  std::vector<CountRun> fans_;
  std::vector<ExactRun> exact_;
  std::vector<CurveRun> curves_;
  std::vector<FrameRun> constructed_;
  std::vector<LooseRun> loose_;
  std::vector<PlanRun> plans_;
  std::vector<BoxTreeRun> boxtrees_;
  std::vector<SearchRun> searches_;
  std::vector<SeparationRun> separations_;
  std::vector<ListSizeRun> list_sizes_;
  std::vector<TranslationRun> translations_;
  std::vector<OrderRun> orders_;
  std::vector<RebuildRun> rebuilds_;
  std::vector<SweepRun> sweeps_;
  std::vector<MotionRun> motions_;
};

}  // namespace

TheoryReport run_theory(const TheoryOptions& options, MeasurementStore& store,
                        const TheoryProgress& progress) {
  return Runner(options, store, progress).run();
}

json options_record(const TheoryOptions& options) {
  return {{"scenes", options.scenes},
          {"sizes", options.sizes},
          {"keyframes", options.keyframes},
          {"exact_limit", options.exact_limit},
          {"simulation_limit", options.simulation_limit},
          {"instants", options.instants},
          {"sequences", options.sequences},
          {"sequence_keyframes", options.sequence_keyframes}};
}

json to_json(const TheoryReport& report, const TheoryOptions& options) {
  json claims = json::array();
  for (const Claim& claim : report.claims) claims.push_back(to_json(claim));
  json counts = report.counts;
  for (std::size_t i = 0; i < report.counts.size(); ++i)
    counts[i]["queue_steps_bound"] = queue_steps_bound(report.counts[i]);
  return {{"schema", "kbvh-theory-1"},
          {"commit", experiments::commit()},
          {"dirty", experiments::dirty()},
          {"scalar", "float"},
          {"options", options_record(options)},
          {"claims", claims},
          {"counts", counts},
          {"fits", report.fits},
          {"frames", report.frames},
          {"notes", report.notes}};
}

}  // namespace kbvh::theory
