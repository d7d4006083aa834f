#include <algorithm>
#include <filesystem>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/run/jobs.hpp"
#include "experiments/study/plan.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

constexpr const char* run_examples = R"(Examples:
  kbvh run --scene tablecloth --triangles 2000 --l 10
  kbvh run --body cloth.obj,motion=cloth.pc2 --body sphere:triangles=2000,centre=0:0:1,radius=0.4 --out results
  kbvh run --scene waving_sheet --strategies bottom_up,rebuild --leaf-size 1,4 --scalar float,double
A body is a file (.obj .ply .gltf .glb, or a folder of numbered frames) or a shape, followed by key=value pairs
separated by commas: motion clip fps weld=false (files), name scale rotate=axis:degrees translate=x:y:z as=triangles|points
curves=smooth|lines (all; cubics or lines through the keyframes); `kbvh list` shows the shapes. elements=edges,of=NAME is a body
of the vertices, edges or faces of another one, over the same vertices. Polygons of more than three corners are cut into triangles once, at the first keyframe,
whatever their first corner; from then on a polygon is the union of these triangles.
Vertex-face and edge-edge candidates of a cloth within a centimetre, as a simulator asks for them:
  kbvh run --body cloth.obj,motion=cloth.pc2,name=cloth --body elements=vertices,of=cloth,name=points \
    --body elements=edges,of=cloth,name=edges --pairs points:cloth,edges:edges --radius 0.01
A clip is timed from its first frame on: positions, the strategy's reset and its first answer count. Every contestant
is verified, replayed, and then played in rounds, each in an order of its own, until the intervals of all ratios are
narrow enough or the time is used up. The fastest stand first; --names shows all. RESULTS.md explains the table.
Exit codes: 0 all guarantees hold, 1 one is broken, 2 wrong use or input, 3 other error.)";

/// The largest radius on a command line; a plan may hold any that the scene's numbers admit.
constexpr double largest_radius = 1e9;

/// Converts parameters to the form of a plan: "key=a,b" becomes {"key": ["a", "b"]}.
json params_of(const std::vector<std::string>& assignments) {
  json params = json::object();
  for (const std::string& text : assignments) {
    const auto assignment = parse_assignment(text);
    if (!assignment)
      throw io::InputError("--param: expected key=value or strategy.key=value, got '" + text + "'");
    if (params.contains(assignment->first))
      throw io::InputError("--param: '" + assignment->first + "' is given twice; separate values by commas");
    params[assignment->first] = split(assignment->second, ',');
  }
  return params;
}

/// Converts "points:cloth" to the form of a plan: ["points", "cloth"].
json body_pairs_of(const std::vector<std::string>& pairs) {
  json list = json::array();
  for (const std::string& text : pairs) {
    const std::vector<std::string> names = split(text, ':');
    if (names.size() != 2 || names[0].empty() || names[1].empty())
      throw io::InputError("--pairs: expected the names of two bodies, as in points:cloth, got " +
                           io::printable(text));
    list.push_back(json::array({names[0], names[1]}));
  }
  return list;
}

/// Applies --clip to every glTF body without a clip of its own.
void choose_clip(json& scene, const std::string& clip) {
  bool used = false;
  for (json& body : scene["bodies"]) {
    const std::string extension = std::filesystem::path(body.value("file", "")).extension().string();
    if ((extension != ".gltf" && extension != ".glb") || body.contains("clip")) continue;
    body["clip"] = clip;
    used = true;
  }
  if (!used)
    throw io::InputError("--clip: " + io::printable(clip) +
                         " is for glTF files without a clip of their own, and no --body is one");
}

json scene_of(const StudyOptions& options) {
  json scene = json::object();
  if (options.bodies.empty()) {
    scene["builtin"] = options.scene.empty() ? "tablecloth" : options.scene;
  } else {
    if (!options.scene.empty()) throw io::InputError("--scene and --body exclude each other");
    for (const std::string& body : options.bodies) scene["bodies"].push_back(body_from_text(body));
  }
  if (!options.clip.empty()) choose_clip(scene, options.clip);
  if (!options.triangles.empty()) scene["triangles"] = options.triangles;
  if (!options.seeds.empty()) scene["seed"] = options.seeds;
  if (options.keyframes > 0) scene["keyframes"] = options.keyframes;
  if (options.obstacle > 0) scene["obstacle"] = options.obstacle;
  if (!options.name.empty()) scene["name"] = options.name;
  if (!options.script.empty()) scene["script"] = options.script;
  if (options.self) scene["self"] = true;
  if (!options.pairs.empty()) scene["pairs"] = body_pairs_of(options.pairs);
  if (options.radius >= 0) scene["radius"] = options.radius;
  if (!options.orders.empty()) scene["order"] = options.orders;
  return scene;
}

void set_common(json& plan, const StudyOptions& options) {
  if (options.repetitions > 0) plan["repetitions"] = options.repetitions;
  if (options.frames_limit > 0) plan["frames_limit"] = options.frames_limit;
  if (options.oracle_every > 0) plan["oracle_every"] = options.oracle_every;
  if (options.interval_width >= 0) plan["interval_width"] = options.interval_width;
  if (options.seconds >= 0) plan["seconds"] = options.seconds;
}

int list_jobs(const Plan& plan) {
  std::vector<std::string> notes;
  const std::vector<Job> jobs = jobs_of(plan, notes);
  for (const std::string& text : notes) say("note: " + text);
  print(jobs_json(plan, jobs).dump(2) + "\n");
  return success;
}

int run_study(const StudyOptions& options) {
  Plan plan;
  if (options.plan_file.empty()) {
    const json said = plan_of(options);
    if (options.print_plan) {
      read_plan(said, "command line", {});
      print(said.dump(2) + "\n");
      return success;
    }
    plan = read_plan(said, "command line", {});
  } else {
    const std::string text = io::read_file(options.plan_file);
    json said = parse_json(text, options.plan_file);
    if (said.is_object()) {
      set_common(said, options);
      if (said.contains("studies") && said["studies"].is_array())
        for (json& study : said["studies"])
          if (study.is_object()) set_common(study, options);
      if (!options.studies.empty()) keep_studies(said, options.studies, options.plan_file);
    }
    if (options.print_plan) {
      print(said.dump(2) + "\n");
      return success;
    }
    plan = read_plan(said, options.plan_file, std::filesystem::path(options.plan_file).parent_path());
  }
  if (options.list_jobs) return list_jobs(plan);
  if (!options.prepare.empty()) {
    prepare_scene(plan, options.prepare, options.out);
    return success;
  }
  if (!options.job.empty()) plan = plan_of_job(plan, options.job);
  const StudyOutcome outcome =
      run_plan(plan, options.out, options.job, options.names ? Shown::all : Shown::fastest);
  if (!options.out.empty())
    say(counted(outcome.measured, "configuration") + " measured, " + std::to_string(outcome.skipped) +
        (outcome.skipped == 1 ? " was in " : " were in ") +
        (std::filesystem::path(options.out) / (options.job.empty() ? "results.jsonl" : "jobs")).string() +
        " already");
  if (outcome.tables > 1 && outcome.timed > 0)  // a single table says it itself
    say(outcome.disturbed == 0
            ? "the machine was quiet: none of " + counted(outcome.timed, "timed configuration") +
                  " was disturbed"
            : std::to_string(outcome.disturbed) + " of " + counted(outcome.timed, "timed configuration") +
                  (outcome.disturbed == 1 ? " was" : " were") + " disturbed by other work (? in the tables)");
  if (outcome.unfinished > 0)
    say(counted(outcome.unfinished, "configuration") + " without enough memory; the next run measures " +
        (outcome.unfinished == 1 ? "it" : "them") + " again");
  if (outcome.refused == 0) return outcome.unfinished == 0 ? success : internal_error;
  say(counted(outcome.refused, "configuration") + " in which a strategy breaks its guarantee");
  return guarantee_broken;
}

/// Adds the options by which an engine for many machines runs a plan (experiments/sweep).
void add_jobs(CLI::App& command, const std::shared_ptr<StudyOptions>& o) {
  CLI::Option *plan = command.get_option("--plan"), *out = command.get_option("--out");
  CLI::Option* list = command.add_flag("--list-jobs", o->list_jobs,
                                       "print the jobs into which experiments/sweep cuts the plan, and stop");
  list->needs(plan)->excludes(command.get_option("--print-plan"));
  CLI::Option* prepare = add_text(command, "--prepare", o->prepare,
                                  "only make the scene of this id and its true pairs, for its jobs");
  CLI::Option* job =
      add_text(command, "--job", o->job, "run only the job of this id; records go to DIR/jobs");
  for (CLI::Option* option : {prepare, job}) option->needs(plan)->needs(out)->excludes(list);
  prepare->excludes(job);
}

void add_study(CLI::App& command, const std::shared_ptr<StudyOptions>& o) {
  std::vector<CLI::Option*> said_by_plan{
      add_text(command, "--scene", o->scene, "built-in scene (default: tablecloth); `kbvh list` shows all"),
      add_texts(command, "--body", o->bodies, "a body from a file or by formula; repeatable, see below"),
      add_text(command, "--clip", o->clip,
               "animation of glTF bodies: its name or index; also as clip= in --body"),
      add_text(command, "--name", o->name, "name of the scene in results"),
      add_wholes(command, "--triangles", o->triangles, ranges::triangles,
                 "triangles of the built-in scene's moving body (2000); a list sweeps"),
      add_whole(command, "--obstacle", o->obstacle, ranges::triangles,
                "triangles of the other body (a table: 2048; else as many, up to 20000)"),
      add_whole(command, "--keyframes", o->keyframes, ranges::keyframes,
                "keyframes of a built-in scene (60)"),
      add_wholes(command, "--seed", o->seeds, ranges::any, "seed of random choices (1); a list sweeps"),
      add_text(command, "--script", o->script, "file with changes of plans at run time, see RESULTS.md"),
      command.add_flag(
          "--continuous", o->continuous,
          "find contacts of vertices and faces, and of edges, between keyframes: exact, l does not apply"),
      add_text(command, "--changes", o->changes,
               "ask each frame what began and ended since the last one, of: candidates, pairs"),
      add_text(command, "--rays", o->rays,
               "ask for rays instead of pairs: coherent or incoherent, then :count and :any, as in "
               "incoherent:10000:any"),
      add_text(
          command, "--within", o->within,
          "ask for the primitives near random points instead of pairs: COUNT:RADIUS, the radius as a share "
          "of the diagonal of the scene's box, as in 1000:0.01"),
      add_text(command, "--kernels", o->kernels,
               "hold kbvh to an instruction set: portable, sse, avx2, avx512 (the widest that runs here)"),
      command.add_flag(
          "--self", o->self,
          "also find pairs within every body, of primitives that share no vertex (vertices with the same "
          "positions at every keyframe are one: weld=false keeps them apart); of one body: self=true"),
      add_words(
          command, "--pairs", o->pairs,
          "only the pairs of these bodies, by their names: NAME:NAME, with commas between pairs; one name "
          "twice: pairs within it (all pairs with a moving body)"),
      add_number(
          command, "--radius", o->radius, 0, largest_radius,
          "find pairs of boxes that are grown by half of this on each side, as a broad phase does, in the "
          "scene's unit of length; 0: overlaps of boxes (none: exact intersections)"),
      add_words(command, "--order", o->orders, "vertex order: given, shuffled, renumbered; a list sweeps"),
      add_words(command, "--strategies", o->strategies,
                "ids, family:NAME, default (all with a guarantee) or all; !x: without x"),
      add_texts(command, "--param", o->params, "key=value or strategy.key=value; a list of values sweeps"),
      add_words(command, "--builder", o->builders, "median, sah, morton (each strategy's own best)"),
      add_wholes(command, "--width", o->widths, ranges::width, "children per node: 2, 4, 8"),
      add_wholes(command, "--leaf-size", o->leaf_sizes, ranges::leaf_size,
                 "most primitives per leaf: 1 to 16"),
      add_wholes(command, "--l", o->l, ranges::frames_per_keyframe,
                 "frames for each keyframe interval (10); a list sweeps"),
      add_words(command, "--scalar", o->scalars, "float, double (float)")};
  add_whole(
      command, "--repetitions", o->repetitions, ranges::repetitions,
      "least number of timed clips of each contestant (5); with fewer than five: exactly so many, and ranges "
      "instead of intervals");
  add_number(command, "--interval-width", o->interval_width, 0, 10,
             "repeat until the 95 % interval of each ratio is narrower, relative to the ratio (0.05)");
  add_number(command, "--seconds", o->seconds, 0, 1e6,
             "longest time for further rounds of one table after the least number (10); 0: none");
  add_whole(command, "--frames-limit", o->frames_limit, ranges::positive,
            "play only this many first frames (intervals with --continuous)");
  add_whole(command, "--oracle-every", o->oracle_every, ranges::positive,
            "compare only every n-th frame or interval (and the last) with the truth (1)");
  add_text(command, "--out", o->out, "folder for results, which are appended (none: print the table only)");
  CLI::Option* plan = add_text(command, "--plan", o->plan_file, "file with a study, see RESULTS.md");
  add_texts(command, "--study", o->studies,
            "run only the studies of this name, without the plan's targets; repeatable")
      ->needs(plan);
  command.add_flag("--print-plan", o->print_plan, "print the equivalent plan file, and stop");
  command.add_flag(
      "--names", o->names,
      "show every contestant of a table by name, with all columns; otherwise, of more than twelve, the "
      "fastest of each family");
  for (CLI::Option* option : said_by_plan) plan->excludes(option);
}

/// Says what the alias is for.
constexpr const char* bench_note =
    "note: `kbvh bench` is `kbvh run` now, and will go with the next release; micro-benchmarks are "
    "kbvh_microbench";

void add_command(CLI::App& program, Action& action, const char* name, const char* meaning, const char* note) {
  CLI::App* command = program.add_subcommand(name, meaning);
  command->footer(run_examples);
  auto options = std::make_shared<StudyOptions>();
  add_study(*command, options);
  add_jobs(*command, options);
  command->callback([&action, options, note] {
    action = [options, note] {
      const int code = run_study(*options);
      if (note != nullptr) say(note);
      return code;
    };
  });
}

}  // namespace

void keep_studies(json& plan, const std::vector<std::string>& names, const std::string& place) {
  const auto name_of = [](const json& object, const std::string& otherwise) {
    const auto found = object.is_object() ? object.find("name") : object.end();
    return found != object.end() && found->is_string() ? found->get<std::string>() : otherwise;
  };
  const std::string plan_name = name_of(plan, "");
  const bool several = plan.contains("studies") && plan["studies"].is_array();
  std::vector<std::string> known;
  json kept = json::array();
  for (const json& study : several ? plan["studies"] : json::array({plan})) {
    const std::string name = name_of(study, plan_name);
    if (std::find(known.begin(), known.end(), name) == known.end()) known.push_back(name);
    if (std::find(names.begin(), names.end(), name) != names.end()) kept.push_back(study);
  }
  for (const std::string& name : names)
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw io::InputError(place + ": " + no_such("study", name, known));
  if (several) plan["studies"] = kept;
  plan.erase("targets");
}

json plan_of(const StudyOptions& options) {
  json plan = json::object();
  plan["scenes"] = json::array({scene_of(options)});
  if (!options.strategies.empty()) plan["strategies"] = options.strategies;
  if (!options.params.empty()) plan["params"] = params_of(options.params);
  if (!options.builders.empty()) plan["builder"]["method"] = options.builders;
  if (!options.widths.empty()) plan["builder"]["width"] = options.widths;
  if (!options.leaf_sizes.empty()) plan["builder"]["leaf_size"] = options.leaf_sizes;
  if (!options.l.empty()) plan["l"] = options.l;
  if (!options.scalars.empty()) plan["scalars"] = options.scalars;
  if (options.continuous) plan["continuous"] = true;
  if (!options.changes.empty()) plan["changes"] = options.changes;
  if (!options.rays.empty()) plan["rays"] = options.rays;
  if (!options.within.empty()) plan["within"] = options.within;
  if (!options.kernels.empty()) plan["kernels"] = options.kernels;
  set_common(plan, options);
  return plan;
}

void add_run(CLI::App& program, Action& action) {
  add_command(program, action, "run", "verify and time contestants on scenes, and print tables", nullptr);
}

void add_bench(CLI::App& program, Action& action) {
  add_command(program, action, "bench", "another name of run, for one more release", bench_note);
}

}  // namespace kbvh::experiments
