#include <algorithm>
#include <set>

#include "core/judge/oracle.hpp"
#include "core/judge/plan_script.hpp"
#include "core/scene/playback.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/results/results.hpp"
#include "experiments/run/jobs.hpp"
#include "experiments/run/scene_pictures.hpp"

namespace kbvh::experiments {

namespace {

/// Finds the true pairs at the frames that `verify` compares: every n-th and the last.
template <class S>
void find_truth(const Scene<S>& scene, const PlanScript<S>& script, const std::vector<double>& frames,
                std::uint64_t every, Oracle<S>& oracle, const MakeProgress& progress) {
  Playback<S> playback(scene);
  ScriptCursor<S> cursor(&script);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    playback.seek(frames[f]);
    if (f % every == 0 || f + 1 == frames.size()) {
      progress("finding the true pairs of " + scene.name, double(f) / double(frames.size()));
      playback.evaluate_all();
      oracle.pairs(playback);
    }
    if (const auto* step = cursor.at(frames[f]); step != nullptr)
      playback.change_plans(frames[f], step->changes);
  }
}

template <class S>
void prepare(const std::vector<const Study*>& studies, const LoadedScene& loaded,
             const MakeProgress& progress) {
  const Scene<S> scene = assemble<S>(loaded);
  const PlanScript<S> script = script_of(scene, loaded, progress);
  // Where the geometry changes, no truth is cached.
  if (script.changes_geometry()) return;
  Oracle<S> oracle(scene, cache_folder(), hash(script));
  for (const Study* study : studies) {
    const std::size_t most = study->frames_limit > 0 ? study->frames_limit : SIZE_MAX;
    for (const std::uint32_t l : has_own_frames(loaded) ? std::vector<std::uint32_t>{1} : study->per_keyframe)
      find_truth(scene, script, frames_of(scene, loaded, script, l, most), study->oracle_every, oracle,
                 progress);
  }
  oracle.keep();
  if (!oracle.problem().empty()) say("warning: " + oracle.problem());
}

}  // namespace

void prepare_scene(const Plan& plan, const std::string& id, const std::filesystem::path& out) {
  std::vector<std::string> notes;
  const SceneSpec* spec = nullptr;
  std::set<std::string> known;
  std::set<std::size_t> places;
  for (const Job& job : jobs_of(plan, notes)) {
    known.insert(job.scene);
    if (job.scene != id) continue;
    spec = &plan.studies[job.study_at].scenes[job.scene_at];
    places.insert(job.study_at);
  }
  if (spec == nullptr)
    throw io::InputError(no_such("scene", id, {known.begin(), known.end()}) +
                         " (ids change with the plan and the program)");
  prepare_folder(out);
  Progress line;
  const MakeProgress progress = [&line](const std::string& what, double fraction) {
    line.show(what + (fraction > 0 ? ": " + std::to_string(int(100 * fraction)) + " %" : ""));
  };
  const LoadedScene loaded = load(*spec, progress);
  write_pictures(loaded, out, progress, [&line](const std::string& text) {
    line.clear();
    say(text);
  });
  for (const char* scalar : {"float", "double"}) {
    std::vector<const Study*> studies;
    for (const std::size_t place : places) {
      const Study& study = plan.studies[place];
      const bool plays = std::find(study.scalars.begin(), study.scalars.end(), scalar) != study.scalars.end();
      if (plays && study.asks.of_pairs()) studies.push_back(&study);
    }
    if (studies.empty()) continue;
    if (std::string(scalar) == "float")
      prepare<float>(studies, loaded, progress);
    else
      prepare<double>(studies, loaded, progress);
  }
  line.clear();
}

}  // namespace kbvh::experiments
