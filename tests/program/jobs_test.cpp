// A plan cut into jobs: the list, and that each job measures its part of the plan and nothing else.
#include <algorithm>
#include <map>
#include <set>
#include <thread>

#include "binary.hpp"
#include "complaint.hpp"
#include "core/contract/registry.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/results/results.hpp"
#include "experiments/run/jobs.hpp"

namespace kbvh::experiments::jobs_test {
namespace {

std::vector<Job> jobs_in(const json& plan, std::vector<std::string>* notes = nullptr) {
  std::vector<std::string> ignored;
  return jobs_of(read_plan(plan, "p.json", {}), notes == nullptr ? ignored : *notes);
}

std::set<std::string> ids(const std::vector<Job>& jobs) {
  std::set<std::string> set;
  for (const Job& job : jobs) set.insert(job.id);
  return set;
}

const json small{
    {"scenes", json::array({{{"builtin", "waving_sheet"}, {"triangles", {100, 200}}, {"keyframes", 3}}})},
    {"strategies", {"bottom_up", "rebuild"}},
    {"l", {1, 2}},
    {"scalars", {"float", "double"}},
    {"repetitions", 1}};

json with(json plan, const std::string& key, json value) {
  plan[key] = std::move(value);
  return plan;
}

TEST(Jobs, AreTheTablesOfThePlan) {
  const std::vector<Job> jobs = jobs_in(small);
  EXPECT_EQ(jobs.size(), 8u);
  EXPECT_EQ(ids(jobs).size(), 8u);
  std::set<std::string> scenes;
  for (const Job& job : jobs) {
    scenes.insert(job.scene);
    EXPECT_EQ(job.configurations, 2u);
    EXPECT_EQ(job.threads, 1u);
    EXPECT_EQ(job.id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-"), std::string::npos) << job.id;
  }
  EXPECT_EQ(scenes.size(), 2u);
  EXPECT_EQ(ids(jobs_in(small)), ids(jobs)) << "ids do not depend on the call";
}

TEST(Jobs, IdsChangeWithWhatIsMeasuredAndWithNothingElse) {
  const std::set<std::string> before = ids(jobs_in(small));
  const auto common = [&](const json& plan) {
    std::size_t count = 0;
    for (const std::string& id : ids(jobs_in(plan))) count += before.count(id);
    return count;
  };
  EXPECT_EQ(common(with(small, "name", "another")), 8u);
  EXPECT_EQ(common(with(small, "l", {2, 3})), 4u);
  EXPECT_EQ(common(with(small, "scalars", "double")), 4u);
  EXPECT_EQ(common(with(small, "repetitions", 2)), 0u);
  EXPECT_EQ(common(with(small, "oracle_every", 3)), 0u);
  EXPECT_EQ(common(with(small, "frames_limit", 3)), 0u);
  EXPECT_EQ(common(with(small, "changes", "pairs")), 0u);
  EXPECT_EQ(common(with(small, "rays", "coherent")), 0u);
  EXPECT_EQ(common(with(small, "strategies", "bottom_up")), 0u);
  EXPECT_EQ(common(with(small, "builder", {{"leaf_size", 2}})), 0u);
  EXPECT_EQ(common(with(small, "params", {{"bottom_up.threads", 1}})), 8u) << "the default, said aloud";
}

TEST(Jobs, OfSeveralStudiesEqualTablesAreOne) {
  json plan = small;
  plan["studies"] = {{{"name", "a"}}, {{"name", "b"}, {"l", {2, 3}}}};
  EXPECT_EQ(jobs_in(plan).size(), 12u);  // l = 2 twice: 4 tables fewer than 16
  plan["studies"][1]["repetitions"] = 2;
  EXPECT_EQ(jobs_in(plan).size(), 16u);
}

TEST(Jobs, WhereLDoesNotApplyThereIsOne) {
  EXPECT_EQ(jobs_in(with(small, "continuous", true)).size(), 4u);
  const json online = {{"builtin", "reversing_spheres"}, {"triangles", 40}, {"keyframes", 5}};
  EXPECT_EQ(jobs_in(with(small, "scenes", json::array({online}))).size(), 2u);
  json scripted = {{"builtin", "waving_sheet"}, {"triangles", 100}, {"keyframes", 3}};
  scripted["script"]["steps"] = json::array({{{"time", 0.01}, {"changes", json::array({{{"vertex", 0}}})}}});
  EXPECT_EQ(jobs_in(with(small, "scenes", json::array({scripted}))).size(), 4u);
  scripted["script"]["frames"] = 4;
  scripted["script"]["rate"] = 60;
  EXPECT_EQ(jobs_in(with(small, "scenes", json::array({scripted}))).size(), 2u);
}

TEST(Jobs, ThreadsAndMissingFiles) {
  const json threads = {{"id", "bottom_up"}, {"params", {{"threads", {1, 2}}}}};
  if (std::thread::hardware_concurrency() > 1) {
    EXPECT_EQ(jobs_in(with(small, "strategies", json::array({threads})))[0].threads, 2u);
  }
  const json missing = {{"name", "gone"}, {"optional", true}, {"bodies", {{{"file", "/nowhere/a.obj"}}}}};
  std::vector<std::string> notes;
  EXPECT_TRUE(jobs_in(with(small, "scenes", json::array({missing})), &notes).empty());
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("'gone' is skipped"), std::string::npos) << notes[0];
}

/// Returns the records of all files of a folder, by key, without times and members that depend on the
/// invocation.
std::map<std::string, json> records_below(const std::filesystem::path& folder) {
  std::map<std::string, json> found;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".jsonl") continue;
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line);) {
      json record = json::parse(line);
      for (const char* name : {"times", "run", "when"}) record.erase(name);
      found[record.at("key")] = record;
    }
  }
  return found;
}

TEST_F(Binary, JobsMeasureTogetherWhatThePlanDoes) {
  write_text(folder_ / "plan.json", small.dump());
  const Outcome listed = kbvh("run --plan plan.json --list-jobs");
  ASSERT_EQ(listed.code, 0) << listed.err;
  const json list = json::parse(listed.out);
  EXPECT_EQ(list.at("schema"), "kbvh-jobs-1");
  ASSERT_EQ(list.at("jobs").size(), 8u);
  ASSERT_EQ(list.at("scenes").size(), 2u);
  for (const json& scene : list.at("scenes"))
    EXPECT_EQ(kbvh("run --plan plan.json --out out --prepare " + scene.at("id").get<std::string>()).code, 0);
  std::map<std::string, std::string> cache;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "cache"))
    cache[entry.path().filename()] = text_of_file(entry.path());
  EXPECT_EQ(cache.size(), 4u) << "true pairs of two scenes in two scalars";
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/results.jsonl"));
  for (const json& job : list.at("jobs")) {
    const std::string run = "run --plan plan.json --out out --job " + job.at("id").get<std::string>();
    const Outcome first = kbvh(run);
    ASSERT_EQ(first.code, 0) << first.err;
    EXPECT_NE(first.err.find("2 configurations measured"), std::string::npos) << first.err;
    const Outcome second = kbvh(run);
    EXPECT_NE(second.err.find("0 configurations measured, 2 were in"), std::string::npos) << second.err;
    EXPECT_EQ(second.out, first.out);
  }
  for (const auto& [name, content] : cache)
    EXPECT_EQ(text_of_file(folder_ / "cache" / name), content)
        << name << ": the jobs have found no other pairs";
  ASSERT_EQ(kbvh("run --plan plan.json --out whole").code, 0);
  EXPECT_EQ(records_below(folder_ / "out"), records_below(folder_ / "whole"));
  EXPECT_EQ(records_below(folder_ / "whole").size(), 16u);
  // Results of a run of the whole plan are not measured again either.
  std::filesystem::remove_all(folder_ / "whole/jobs");
  const Outcome known =
      kbvh("run --plan plan.json --out whole --job " + list.at("jobs")[0].at("id").get<std::string>());
  EXPECT_NE(known.err.find("0 configurations measured"), std::string::npos) << known.err;
}

TEST_F(Binary, TruePairsOfScenesWhosePlansChangeArePreparedAsWell) {
  json plan = small;
  plan["scalars"] = "float";
  plan["strategies"] = {"bottom_up", "kinetic_aabb"};
  plan["scenes"] = json::array({{{"builtin", "reversing_spheres"}, {"triangles", 80}, {"keyframes", 30}}});
  write_text(folder_ / "plan.json", plan.dump());
  const json list = json::parse(kbvh("run --plan plan.json --list-jobs").out);
  ASSERT_EQ(list.at("jobs").size(), 1u);
  const std::string common = "run --plan plan.json --out out ";
  ASSERT_EQ(kbvh(common + "--prepare " + list.at("scenes")[0].at("id").get<std::string>()).code, 0);
  std::map<std::string, std::string> cache;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "cache"))
    cache[entry.path().filename()] = text_of_file(entry.path());
  EXPECT_EQ(cache.size(), 2u) << "the script, and the true pairs";
  const Outcome job = kbvh(common + "--job " + list.at("jobs")[0].at("id").get<std::string>());
  EXPECT_EQ(job.code, 0) << job.err;
  for (const auto& [name, content] : cache)
    EXPECT_EQ(text_of_file(folder_ / "cache" / name), content) << name;
}

TEST_F(Binary, UnknownJobsAreRefused) {
  write_text(folder_ / "plan.json", small.dump());
  const Outcome job = kbvh("run --plan plan.json --out out --job waving-sheet");
  EXPECT_EQ(job.code, 2);
  EXPECT_NE(job.err.find("there is no job 'waving-sheet'"), std::string::npos) << job.err;
  const Outcome scene = kbvh("run --plan plan.json --out out --prepare waving-sheet");
  EXPECT_EQ(scene.code, 2);
  EXPECT_NE(scene.err.find("there is no scene 'waving-sheet'"), std::string::npos) << scene.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  EXPECT_EQ(kbvh("run --plan plan.json --job a").code, 2) << "without --out";
  EXPECT_EQ(kbvh("run --out out --job a").code, 2) << "without --plan";
  EXPECT_EQ(kbvh("run --plan plan.json --out out --job a --prepare b").code, 2);
  EXPECT_EQ(kbvh("run --plan plan.json --list-jobs --print-plan").code, 2);
}

TEST(ResultStore, KnowsOtherFilesAndWritesItsOwn) {
  TemporaryFolder folder;
  const json a{{"key", "a"}, {"value", 1}}, b{{"key", "b"}, {"value", 2}}, newer{{"key", "b"}, {"value", 3}};
  write_text(folder / "results.jsonl", a.dump() + "\n");
  write_text(folder / "other.jsonl", b.dump() + "\n" + R"({"key": "c)");
  const std::vector<std::filesystem::path> others{folder / "results.jsonl", folder / "other.jsonl",
                                                  folder / "none.jsonl"};
  {
    ResultStore store(folder.path(), "own.jsonl", others);
    ASSERT_NE(store.find("a"), nullptr);
    ASSERT_NE(store.find("b"), nullptr);
    EXPECT_EQ(store.unreadable_lines(), 1u);
    EXPECT_EQ(store.place("b"), (folder / "other.jsonl").string() + " line 1");
    store.append(newer);
    EXPECT_EQ(store.find("b")->at("value"), 3);
    EXPECT_EQ(store.place("b"), (folder / "own.jsonl").string());
  }
  EXPECT_EQ(text_of_file(folder / "own.jsonl"), newer.dump() + "\n");
  EXPECT_EQ(text_of_file(folder / "other.jsonl"), b.dump() + "\n" + R"({"key": "c)");
  EXPECT_EQ(ResultStore(folder.path(), "own.jsonl", others).find("b")->at("value"), 3) << "its own counts";
}

}  // namespace
}  // namespace kbvh::experiments::jobs_test
