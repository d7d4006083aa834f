#include "experiments/run/run_plan.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "experiments/common/environment.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/stopwatch.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/results.hpp"
#include "experiments/results/target_rows.hpp"
#include "experiments/run/in_progress.hpp"
#include "experiments/run/rounds.hpp"
#include "experiments/run/scene_pictures.hpp"
#include "experiments/run/time_left.hpp"
#include "experiments/study/contact_measurement.hpp"
#include "experiments/study/probe_measurement.hpp"
#include "experiments/study/targets.hpp"
#include "experiments/study/times_record.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Returns what identifies this invocation. Jobs run on several machines at the same time.
std::string invocation(const std::string& job) {
  return now_utc() + "-" + (job.empty() ? "" : host_name() + "-") + std::to_string(::getpid());
}

/// Opens the results: those of a job are appended to a file of this process alone, because appending from
/// several machines to one file of a network file system can lose lines.
std::unique_ptr<ResultStore> opened(const std::filesystem::path& out, const std::string& job,
                                    const std::string& run) {
  if (job.empty()) return std::make_unique<ResultStore>(out);
  const std::filesystem::path folder = out / "jobs" / job;
  prepare_folder(folder);
  std::vector<std::filesystem::path> others{out / "results.jsonl"};
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (entry.path().extension() == ".jsonl") others.push_back(entry.path());
  std::sort(others.begin() + 1, others.end());
  std::string name = run + ".jsonl";
  std::erase(name, ':');
  return std::make_unique<ResultStore>(out, std::filesystem::path("jobs") / job / name, others);
}

/// One run of a plan: the state shared by all its groups.
class Runner {
 public:
  Runner(const Plan& plan, const std::filesystem::path& out, const std::string& job, Shown shown,
         TimeLeft left)
      : plan_{{"name", plan.name}, {"description", plan.description}},
        machine_(machine()),
        run_(invocation(job)),
        shown_(shown),
        left_(std::move(left)) {
    if (!out.empty()) store_ = opened(out, job, run_);
    in_progress_.emplace(out.empty() || job.empty() ? out : out / "jobs" / job);
    for (const std::string& doing : in_progress_->killed())
      say("note: an earlier run was ended from outside while " + doing + "; it is measured again");
    if (out.empty()) return;
    std::error_code error;
    if (const auto file = out / "targets.json"; std::filesystem::is_directory(file, error))
      throw io::InputError(file.string() + ": is a folder, but a file must be written there");
    if (store_->other_schemas() > 0)
      say("note: " + (out / "results.jsonl").string() + " holds " +
          counted(store_->other_schemas(), "record") + " of another schema than " +
          std::to_string(results_schema) +
          ", left alone: their times have another meaning (those of schema 1 leave out the beginning of a "
          "clip)");
    if (store_->unreadable_lines() > 0)
      say("note: " + (job.empty() ? out / "results.jsonl" : out / "jobs" / job).string() + " has " +
          std::to_string(store_->unreadable_lines()) +
          " unreadable lines (of an interrupted run?); they stay unchanged");
  }

  void study(const Study& study, const std::vector<ContestantSpec>& contestants) {
    const KernelSet usual = active_kernel_set();
    const auto restore = [&] {
      use_kernel_set(usual);
      machine_["kernels"] = name(usual);
    };
    if (study.asks.kernels) {
      try {
        use_kernel_set(*study.asks.kernels);
      } catch (const std::invalid_argument& problem) {
        note("note: the study '" + study.name + "' is skipped: " + problem.what());
        for (std::size_t i = 0; i < study.scenes.size(); ++i) left_.begin_scene();
        return;
      }
      machine_["kernels"] = name(*study.asks.kernels);
    }
    try {
      scenes(study, contestants);
    } catch (...) {
      restore();
      throw;
    }
    restore();
  }

  /// Compares the measurements with the plan's targets.
  void targets(const Plan& plan) {
    if (plan.targets.empty()) return;
    const json rows = target_rows(plan, groups_);
    print(targets_table(rows) + "\n");
    if (store_) write_targets(store_->folder(), rows);
  }

  /// Writes the keys of everything that a job requested, whether measured now or before, in one step: with
  /// them experiments/sweep sees whether records of a finished job were lost.
  void write_keys(const std::filesystem::path& file) const {
    std::set<std::string> keys;
    for (const TargetGroup& group : groups_)
      for (const json& record : group.records) keys.insert(record.at("key").get<std::string>());
    std::string text;
    for (const std::string& key : keys) text += key + "\n";
    io::write_file_atomically(file, text);
  }

  StudyOutcome outcome() const { return outcome_; }

 private:
  void scenes(const Study& study, const std::vector<ContestantSpec>& contestants) {
    for (const SceneSpec& spec : study.scenes) {
      left_.begin_scene();
      if (spec.optional) {
        if (const std::string missing = missing_file(spec); !missing.empty()) {
          note("note: the scene '" + spec.name + "' is skipped: there is no " + missing);
          continue;
        }
      }
      const LoadedScene loaded = load(spec, making_);
      for (const std::string& text : loaded.notes) note("note: " + text);
      card_ = store_ ? write_pictures(loaded, store_->folder(), making_,
                                      [this](const std::string& text) { note(text); })
                     : "";
      progress_.clear();
      scene_object_ = spec.object;
      for (const std::string& scalar : study.scalars) {
        if (scalar == "float")
          scene<float>(study, contestants, loaded);
        else
          scene<double>(study, contestants, loaded);
      }
    }
  }

  void show(const std::string& doing) { progress_.show(left_.said() + doing); }

  void note(const std::string& text) {
    progress_.clear();
    if (said_.insert(text).second) say(text);
  }

  /// Warns of a scene of one body: it has times, but its query has nothing to find, which is seldom intended.
  /// Rays and points meet a body alone.
  template <class S>
  void warn_of_no_pairs(const Scene<S>& scene, const Study& study) {
    if (!scene.pairs.empty() || study.asks.probes) return;
    note("warning: " + scene.name +
         " has one body, so there are no pairs of bodies, and nothing is found or compared; --self (in a "
         "plan: \"self\": true) asks for pairs within it");
  }

  template <class S>
  void scene(const Study& study, const std::vector<ContestantSpec>& contestants, const LoadedScene& loaded) {
    const Scene<S> scene = assemble<S>(loaded);
    warn_of_no_pairs(scene, study);
    const PlanScript<S> script = script_of(scene, loaded, making_);
    if (study.asks.continuous) {
      contact_group(study, contestants, loaded, scene, script);
      return;
    }
    if (study.asks.probes) {
      for_each_l(study, loaded, scene, script, [&](std::uint32_t l, const std::vector<double>& frames) {
        probe_group(study, contestants, loaded, scene, script, l, frames);
      });
      return;
    }
    Oracle<S> oracle(scene, cache_folder(), hash(script));
    if (!oracle.problem().empty()) note("warning: " + oracle.problem());
    for_each_l(study, loaded, scene, script, [&](std::uint32_t l, const std::vector<double>& frames) {
      group(study, contestants, loaded, scene, script, oracle, l, frames);
    });
    const std::string before = oracle.problem();
    oracle.keep();
    if (oracle.problem() != before) note("warning: " + oracle.problem());
  }

  /// Calls work(l, frames) for each l of the study; once for a scene with frame times of its own.
  template <class S, class Work>
  void for_each_l(const Study& study, const LoadedScene& loaded, const Scene<S>& scene,
                  const PlanScript<S>& script, const Work& work) {
    std::vector<std::uint32_t> per_keyframe = study.per_keyframe;
    if (has_own_frames(loaded)) {
      if (per_keyframe != std::vector<std::uint32_t>{1})
        note("note: " + scene.name + " defines its own frame times: l does not apply and counts as 1");
      per_keyframe = {1};
    }
    const std::size_t most = study.frames_limit > 0 ? study.frames_limit : SIZE_MAX;
    for (const std::uint32_t l : per_keyframe) work(l, frames_of(scene, loaded, script, l, most));
  }

  /// Measures all contestants on one scene, in one scalar, at one l: the content of one table.
  template <class S>
  void group(const Study& study, const std::vector<ContestantSpec>& contestants, const LoadedScene& loaded,
             const Scene<S>& scene, const PlanScript<S>& script, Oracle<S>& oracle, std::uint32_t l,
             const std::vector<double>& frames) {
    json about_scene = scene_record(scene, loaded, l, frames, script);
    about_scene.update(asked_of(study.asks));
    about_scene["name"] = scene.name + suffix_of(study.asks);
    const std::string title = about_scene["name"].get<std::string>() + ", l = " + std::to_string(l);
    if (l > 1 && study.oracle_every % l == 0)
      note("warning: with oracle_every " + std::to_string(study.oracle_every) +
           " and l = " + std::to_string(l) +
           " only keyframes are compared with the truth; take a number without common factors");
    Measurement<S> measurement(scene, frames, oracle, script.empty() ? nullptr : &script, study.asks.changes);
    measure_all(study, contestants, loaded, about_scene, title, measurement,
                [&](const Info& info) -> std::string {
                  const auto& kinds = info.primitives;
                  if (loaded.radius &&
                      std::find(kinds.begin(), kinds.end(), PrimitiveKind::control_nets) == kinds.end())
                    return "takes no radius, because it takes no control nets";
                  return unsuitable(info, scene, script, frames);
                });
  }

  /// Does the same for rays and points.
  template <class S>
  void probe_group(const Study& study, const std::vector<ContestantSpec>& contestants,
                   const LoadedScene& loaded, const Scene<S>& scene, const PlanScript<S>& script,
                   std::uint32_t l, const std::vector<double>& frames) {
    json about_scene = scene_record(scene, loaded, l, frames, script);
    about_scene.update(asked_of(study.asks));
    about_scene["name"] = scene.name + suffix_of(study.asks);
    ProbeMeasurement<S> measurement(scene, frames, *study.asks.probes, script.empty() ? nullptr : &script);
    measure_all(study, contestants, loaded, about_scene,
                scene.name + ", l = " + std::to_string(l) + suffix_of(study.asks), measurement,
                [&](const Info& info) -> std::string {
                  if (!answers(info, *study.asks.probes))
                    return std::string("answers no ") +
                           (key_of(*study.asks.probes) == std::string("rays") ? "rays" : "points");
                  if (std::string why = unsuitable(info, scene, script, frames); !why.empty()) return why;
                  return measurement.beyond_range(info);
                });
  }

  /// Does the same for contacts from each keyframe to the next.
  template <class S>
  void contact_group(const Study& study, const std::vector<ContestantSpec>& contestants,
                     const LoadedScene& loaded, const Scene<S>& scene, const PlanScript<S>& script) {
    if (script.changes_geometry()) {
      note("note: " + scene.name +
           " is skipped: contacts between keyframes do not support changes of geometry");
      return;
    }
    std::vector<double> knots = script.empty()
                                    ? overlaid_keyframes(scene)
                                    : contact_times(scene, frames_of(scene, loaded, script, 1), script);
    if (study.frames_limit > 0 && knots.size() > study.frames_limit + 1) knots.resize(study.frames_limit + 1);
    if (knots.size() < 2) {
      note("note: " + scene.name + " is skipped: nothing moves, so there are no contacts between keyframes");
      return;
    }
    progress_.show(scene.name + ": finding the true contacts");
    ContactMeasurement<S> measurement(scene, knots, script.empty() ? nullptr : &script);
    json about_scene = scene_record(scene, loaded, 1, std::span<const double>(knots), script);
    about_scene["frames"] = knots.size() - 1;
    about_scene.update(asked_of(study.asks));
    about_scene["name"] = scene.name + suffix_of(study.asks);
    measure_all(study, contestants, loaded, about_scene, scene.name + ", contacts", measurement,
                [&](const Info& info) -> std::string {
                  if (!info.can.contacts) return "finds no contacts between keyframes";
                  return unsuitable(info, scene, script, knots);
                });
  }

  /// Verifies and times the contestants of one table. `M` is a Measurement, or a measurement of contacts.
  template <class M, class Unsuitable>
  void measure_all(const Study& study, const std::vector<ContestantSpec>& contestants,
                   const LoadedScene& loaded, json about_scene, const std::string& title, M& measurement,
                   const Unsuitable& why_not) {
    if (!card_.empty()) about_scene["card"] = card_;
    const std::string scalar = about_scene.at("scalar");
    // Another order for every table, the same whenever it is measured.
    const std::uint64_t seed = hash_of(title + "/" + scalar) & 0xffffffffu;
    std::vector<json> records;           // in the order of the contestants
    std::vector<std::size_t> record_of;  // of each measured contestant
    std::size_t skipped = 0;
    std::string failed;  // the first file that could not be written
    const auto keep = [&failed](const auto& work) {
      try {
        work();
      } catch (const io::InputError& problem) {
        if (failed.empty()) failed = problem.what();
      }
    };
    const auto finish = [&](std::size_t i) {
      json& record = records[record_of[i]];
      complete(record, measurement[i]);
      record.update(measurement.extras(i));
      ++outcome_.measured;
      if (measurement[i].unfinished)
        ++outcome_.unfinished;
      else if (!measurement[i].refused.empty())
        ++outcome_.refused;
      if (store_)
        keep([&] { store_->append(record); });
      else
        of_this_run_.insert_or_assign(record.at("key").get<std::string>(), record);
    };
    left_.begin_table(contestants.size() * (verification_steps + study.repetitions));
    for (const ContestantSpec& spec : contestants) {
      if (const std::string why = why_not(spec.entry->info); !why.empty()) {
        note("note: " + spec.entry->info.id + " is left out of " + about_scene.at("name").get<std::string>() +
             ": it " + why);
        continue;
      }
      json record{{"schema", results_schema},
                  {"kind", "run"},
                  {"shuffle", seed},
                  {"run", run_},
                  {"plan", plan_},
                  {"study", study.name},
                  {"commit", commit()},
                  {"dirty", dirty()},
                  {"machine", machine_},
                  {"seed", loaded.seed},
                  {"scene", about_scene},
                  {"strategy", strategy_record(spec)}};
      record["again"] = again_record(scene_object_, about_scene, record["strategy"], study);
      record["key"] = configuration_key(program_identity(), about_scene, record["strategy"], study, machine_);
      if (const json* known = known_record(record["key"], title + ": " + spec.label)) {
        if (!known->at("verified").at("holds").template get<bool>()) ++outcome_.refused;
        records.push_back(*known);
        if (store_) ++skipped;
        continue;
      }
      const std::string key = record["key"];
      record_of.push_back(records.size());
      records.push_back(std::move(record));
      if (const InProgress::Earlier* end = in_progress_->earlier(key)) {
        note("note: " + spec.label + " is left out of " + title + ": " + end->doing +
             ", an earlier run ended " + end->how);
        refuse_for(measurement.add_refused(spec), *end);
        finish(measurement.size() - 1);
        in_progress_->settle(key);
        continue;
      }
      show(title + ": verifying " + spec.label);
      in_progress_->begin(key, "verifying " + spec.label + " on " + title + ", " + scalar);
      measurement.add(spec, study.oracle_every);
      left_.made(verification_steps);
    }
    if (skipped > 0)
      note(title + ", " + scalar + ": " + std::to_string(skipped) + " of " +
           counted(records.size(), "configuration") + " in the results already, not measured again");
    play_rounds(measurement, study, seed, [&](std::size_t i, std::uint32_t round) {
      left_.made(1);
      show(title + ": round " + std::to_string(round + 1) + ", " + measurement[i].spec->label);
      in_progress_->begin(records[record_of[i]]["key"],
                          "timing " + measurement[i].spec->label + " on " + title + ", " + scalar);
    });
    in_progress_->end();
    for (std::size_t i = 0; i < measurement.size(); ++i)
      if (!records[record_of[i]].contains("when")) finish(i);
    outcome_.skipped += skipped;
    groups_.push_back({about_scene, records});
    progress_.clear();
    for (const json& record : records) {
      if (!has_times(record) || !record.at("times").contains("disturbed")) continue;
      ++outcome_.timed;
      if (!disturbed(record).empty()) ++outcome_.disturbed;
    }
    ++outcome_.tables;
    print(results_table(records, shown_) + "\n");
    if (!failed.empty()) throw io::InputError(failed);
  }

  /// Returns the record of a configuration that need not be measured again, or nullptr.
  const json* known_record(const std::string& key, const std::string& what) {
    if (!store_) {
      const auto found = of_this_run_.find(key);
      return found == of_this_run_.end() || found->second.value("unfinished", false) ? nullptr
                                                                                     : &found->second;
    }
    const json* known = store_->find(key);
    if (known == nullptr) return nullptr;
    if (const std::string why = unusable(*known); !why.empty()) {
      note("warning: " + store_->place(key) + ": " + why + "; " + what + " is measured again");
      return nullptr;
    }
    if (const auto unfinished = known->find("unfinished");
        unfinished != known->end() && *unfinished == json(true)) {
      note("note: " + what + " ran out of memory in an earlier run, and is measured again");
      return nullptr;
    }
    return known;
  }

  /// Refuses a time to the configuration in which an earlier run ended. If memory may have run out, that is
  /// no verdict, as always.
  static void refuse_for(Measured& measured, const InProgress::Earlier& end) {
    measured.refused = end.doing + ", the program ended " + end.how;
    measured.unfinished = end.cause == InProgress::Earlier::Cause::terminated;
    if (!measured.unfinished) measured.verification.first_violation = measured.refused;
  }

  static void complete(json& record, const Measured& measured) {
    record["when"] = now_utc();
    record["verified"] = verified_record(measured);
    record["counters"] = counters_record(measured.counters);
    record["events_at_depth"] = depths_record(measured.counters);
    record["bytes"] = measured.counters[Counter::bytes];
    if (!measured.choice.empty()) record["choice"] = measured.choice;
    record["times"] = nullptr;
    if (measured.refused.empty())
      record["times"] = times_record(measured);
    else
      record["refused"] = measured.refused;
    if (measured.unfinished) record["unfinished"] = true;
  }

  json plan_;  // its name and description
  json machine_;
  std::string run_;
  Shown shown_;
  TimeLeft left_;
  std::unique_ptr<ResultStore> store_;
  std::map<std::string, json> of_this_run_;  // by key, where there is no store
  std::string card_;                         // of the current scene
  json scene_object_;                        // the current scene in a plan
  Progress progress_;
  std::optional<InProgress> in_progress_;
  const MakeProgress making_ = [this](const std::string& what, double fraction) {
    progress_.show(what + (fraction > 0 ? ": " + std::to_string(int(100 * fraction)) + " %" : ""));
  };
  std::set<std::string> said_;
  StudyOutcome outcome_;
  std::vector<TargetGroup> groups_;  // everything that the plan requested, for its targets
};

}  // namespace

StudyOutcome run_plan(const Plan& plan, const std::filesystem::path& out, const std::string& job,
                      Shown shown) {
  // All errors of the contestants are found before the first measurement.
  std::vector<std::vector<ContestantSpec>> contestants;
  std::vector<std::string> notes;
  for (const Study& study : plan.studies)
    contestants.push_back(expand(study.strategies, study.params, study.builder, notes));
  check_target_contestants(plan, contestants);
  for (const std::string& text : std::set<std::string>(notes.begin(), notes.end())) say("note: " + text);
  std::vector<std::size_t> sizes;
  for (const auto& list : contestants) sizes.push_back(list.size());
  const auto now = [begin = std::chrono::steady_clock::now()] { return seconds_since(begin); };
  Runner runner(plan, out, job, shown, TimeLeft(plan, sizes, now));
  for (std::size_t i = 0; i < plan.studies.size(); ++i) runner.study(plan.studies[i], contestants[i]);
  runner.targets(plan);
  if (!job.empty()) runner.write_keys(out / "jobs" / job / "keys");
  return runner.outcome();
}

}  // namespace kbvh::experiments
