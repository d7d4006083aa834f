// No measurement and no finding is lost: full disks, damaged and shared files, interrupted runs, scenes of
// one name. (contestant_ends_test.cpp: contestants that run out of memory or end the program.)
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <set>

#include "binary.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/results/results.hpp"
#include "experiments/results/table.hpp"

namespace kbvh::experiments::loss_test {
namespace {

const std::string one = tiny + "--strategies bottom_up ";

TEST_F(Binary, ALimitOnTheSizeOfFilesIsAFullDisk) {
  const Outcome run = shell("ulimit -f 8; '" KBVH_PROGRAM "' run " + tiny +
                            "--strategies bottom_up,rebuild --l 1,2 --out out");
  EXPECT_TRUE(run.code == 2 || run.code == 3) << run.code << run.err;
  EXPECT_NE(run.err.find("File too large"), std::string::npos) << run.err;
}

TEST_F(Binary, FoldersThatCannotBeAreNamed) {
  std::filesystem::create_symlink("loop", folder_ / "loop");
  for (const std::string& name : {std::string("loop"), std::string(300, 'a')}) {
    for (const std::string& command : {"run " + one, std::string("stress --scenes 1 "), std::string("ccd "),
                                       std::string("theory --scenes waving_sheet --sizes 50 ")}) {
      const Outcome run = kbvh(command + "--out " + name);
      EXPECT_EQ(run.code, 2) << command << run.err;
      EXPECT_EQ(run.err.find("internal error"), std::string::npos) << run.err;
    }
    const Outcome read = kbvh("ccd " + name);
    EXPECT_EQ(read.code, 2) << read.err;
    EXPECT_EQ(read.err.find("internal error"), std::string::npos) << read.err;
  }
}

TEST_F(Binary, ParametersMayBeSubnormal) {
  const Outcome run = kbvh("run " + tiny + "--strategies inflated_lazy --param margin=1e-320");
  EXPECT_EQ(run.code, 0) << run.err;
}

TEST_F(Binary, RecordsThatCannotBeUsedAreNamedAndMeasuredAgain) {
  ASSERT_EQ(kbvh("run " + one + "--out whole").code, 0);
  const json whole = records("whole/results.jsonl").at(0);
  EXPECT_EQ(unusable(whole), "");
  const auto damaged = [&](const std::function<void(json&)>& work) {
    json record = whole;
    work(record);
    return record;
  };
  const std::vector<std::pair<json, std::string>> cases{
      {damaged([](json& r) { r["times"]["repetitions"] = json::array(); }), "times.repetitions has no entry"},
      {damaged([](json& r) { r["times"]["repetitions"][1].erase("update"); }),
       "the field times.repetitions.update is missing"},
      {damaged([](json& r) { r["times"]["repetitions"][0]["motion"] = nullptr; }),
       "times.repetitions.motion is not a finite number that is not negative"},
      {damaged([](json& r) { r["times"] = 3; }), "times is neither an object nor null"},
      {damaged([](json& r) { r.erase("times"); }), "the field times is missing"},
      {damaged([](json& r) { r.erase("verified"); }), "the field verified is missing"},
      {damaged([](json& r) { r["verified"].erase("holds"); }), "the field verified.holds is missing"},
      {damaged([](json& r) { r["verified"]["protrusion"] = nullptr; }),
       "verified.protrusion is not a finite number that is not negative"},
      {damaged([](json& r) { r["scene"]["frames"] = -1; }), "scene.frames is not a whole number"},
      {damaged([](json& r) { r["strategy"]["label"] = 7; }), "strategy.label is not a text"},
      {damaged([](json& r) { r["choice"] = 7; }), "choice is not a text"}};
  for (const auto& [record, why] : cases) {
    SCOPED_TRACE(why);
    EXPECT_EQ(unusable(record), why);
    std::filesystem::remove_all(folder_ / "out");
    std::filesystem::create_directories(folder_ / "out");
    write_text(folder_ / "out/results.jsonl", "\n" + record.dump() + "\n");
    const Outcome run = kbvh("run " + one + "--out out");
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.err.find("out/results.jsonl line 2: " + why + "; "), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("1 configuration measured"), std::string::npos) << run.err;
    EXPECT_EQ(kbvh("run " + one + "--out out").err.find("warning"), std::string::npos);
  }
}

TEST_F(Binary, RecordsOfAnOlderSchemaStayAndAreNeverUsed) {
  ASSERT_EQ(kbvh("run " + one + "--out out").code, 0);
  json old = records().at(0);
  old["schema"] = 1;
  write_text(folder_ / "out/results.jsonl", old.dump() + "\n");
  const Outcome run = kbvh("run " + one + "--out out");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("out/results.jsonl holds 1 record of another schema than 2"), std::string::npos)
      << run.err;
  EXPECT_NE(run.err.find("1 configuration measured, 0 were in"), std::string::npos) << run.err;
  ASSERT_EQ(records().size(), 2u);
  EXPECT_EQ(records().at(0), old);
  EXPECT_EQ(records().at(1).at("schema"), 2);
}

TEST_F(Binary, EveryFieldThatIsTakenOutIsNoticedOrNotNeeded) {
  ASSERT_EQ(kbvh("run " + one + "--out out").code, 0);
  const json whole = records().at(0);
  std::size_t taken_out = 0;
  const std::function<void(json&, json&)> visit = [&](json& root, json& at) {
    if (!at.is_structured()) return;
    std::vector<std::string> keys;
    if (at.is_object())
      for (const auto& [key, value] : at.items()) keys.push_back(key);
    for (std::size_t i = 0; i < (at.is_object() ? keys.size() : at.size()); ++i) {
      json& member = at.is_object() ? at[keys[i]] : at[i];
      visit(root, member);
      for (const json& other : {json(), json("text"), json(-1.5), json::array(), json::object()}) {
        const json kept = member;
        member = other;
        ++taken_out;
        // Every record that passes can be shown.
        if (unusable(root).empty()) {
          EXPECT_NO_THROW(results_table({root})) << root.dump();
        }
        (at.is_object() ? at[keys[i]] : at[i]) = kept;
      }
    }
  };
  json root = whole;
  visit(root, root);
  EXPECT_EQ(root, whole);
  EXPECT_GT(taken_out, 300u);
}

TEST_F(Binary, TablesArePrintedWhereResultsCannotBeWritten) {
  // A disk with space for the first record, but not for the fourth.
  ASSERT_EQ(kbvh("run " + one + "--out whole").code, 0);
  const auto size = std::filesystem::file_size(folder_ / "whole/results.jsonl");
  const std::string room =
      "bash -c 'trap \"\" XFSZ; ulimit -f " + std::to_string(1 + 2 * size / 1024) + "; exec \"$0\" \"$@\"' ";
  const std::string contestants = "--strategies bottom_up,bottom_up_period,rebuild,top_down ";
  const Outcome run = shell(room + "'" + KBVH_PROGRAM + "' run " + tiny + contestants + "--out out");
  EXPECT_EQ(run.code, 2) << run.err;
  EXPECT_NE(run.err.find("results.jsonl: cannot be written"), std::string::npos) << run.err;
  for (const char* id : {"bottom_up ", "bottom_up_period ", "rebuild ", "top_down "})
    EXPECT_NE(run.out.find(std::string("\n") + id), std::string::npos) << run.out;
}

TEST_F(Binary, FullDisksAndFoldersInTheWayAreNoticedBeforeAnythingIsMeasured) {
  const std::string no_room = "bash -c 'trap \"\" XFSZ; ulimit -f 1; exec \"$0\" \"$@\"' ";
  for (const std::string& arguments : {"run " + one + "--out out", std::string("stress --scenes 1 --out out"),
                                       std::string("theory --sizes 100 --out out")}) {
    const Outcome run = shell(no_room + "'" + KBVH_PROGRAM + "' " + arguments);
    EXPECT_EQ(run.code, 2) << arguments << run.err;
    EXPECT_EQ(run.out, "") << arguments;
    EXPECT_NE(run.err.find("cannot be written"), std::string::npos) << run.err;
  }
  for (const std::string file : {"targets.json", "results.jsonl"}) {
    std::filesystem::create_directories(folder_ / "taken" / file);
    const Outcome run = kbvh("run " + one + "--out taken");
    EXPECT_EQ(run.code, 2) << file;
    EXPECT_EQ(run.out, "") << file;
    EXPECT_NE(run.err.find(file), std::string::npos) << run.err;
    std::filesystem::remove_all(folder_ / "taken");
  }
  // The check leaves nothing behind.
  EXPECT_EQ(kbvh("run " + one + "--out out").code, 0);
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "out"))
    names.insert(entry.path().filename());
  EXPECT_EQ(names, (std::set<std::string>{"results.jsonl", "scenes"}));
}

TEST_F(Binary, AStressRunThatIsEndedLeavesWhatItFound) {
  // Interrupted as soon as there is a failure and a table; the suite itself would run for minutes.
  const Outcome ended =
      shell("'" KBVH_FAULTY_PROGRAM
            "' stress --strategies loses,honest --families unit,near_tangent,spikes "
            "--scenes 100000 --out out >/dev/null 2>&1 & pid=$!; "
            "for i in $(seq 6000); do if grep -q repro- out/stress.json 2>/dev/null; then break; "
            "fi; sleep 0.1; done; kill -9 $pid; wait $pid 2>/dev/null; true");
  EXPECT_EQ(ended.code, 0) << ended.err;
  const json table = json::parse(text_of_file(folder_ / "out/stress.json"));
  EXPECT_LT(table.at("played"), table.at("options").at("scenes"));
  ASSERT_GE(table.at("failures").size(), 1u);
  const std::string file = table.at("failures")[0].at("file");
  const Outcome again = kbvh("stress --repro out/" + file, "", KBVH_FAULTY_PROGRAM);
  EXPECT_EQ(again.code, 1) << again.err;
  EXPECT_NE(again.out.find("loses, "), std::string::npos) << again.out;
}

TEST_F(Binary, OneProcessAtATimeWritesATable) {
  const auto folder = folder_ / "out";
  const ResultFile mine(folder, "stress.json", {{"seed", 1}});
  for (const std::string command :
       {"stress --scenes 1 --strategies bottom_up --families spikes --out out", "stress --list"}) {
    const Outcome run = kbvh(command);
    const bool writes = command.find("--out") != std::string::npos;
    EXPECT_EQ(run.code, writes ? 2 : 0) << run.err;
    EXPECT_EQ(run.err.find("stress.json: another process is writing it") != std::string::npos, writes)
        << run.err;
  }
  EXPECT_THROW(ResultFile(folder, "stress.json", {}), io::InputError);
  { const ResultFile other(folder, "theory.json", {}); }
  const ResultFile again(folder, "theory.json", {});
}

TEST_F(Binary, ATableOfOtherOptionsIsRenamed) {
  const auto stress = [&](const std::string& options) {
    const Outcome run =
        kbvh("stress --strategies bottom_up --families spikes --l 1 --scalars float --out out " + options);
    EXPECT_EQ(run.code, 0) << run.err;
    return run.err;
  };
  const auto scenes = [&](const std::string& name) {
    return json::parse(text_of_file(folder_ / "out" / name)).at("options").at("scenes").get<int>();
  };
  stress("--scenes 3");
  EXPECT_NE(stress("--scenes 2").find("it is now stress-2.json"), std::string::npos);
  EXPECT_EQ(stress("--scenes 2").find("it is now"), std::string::npos) << "the same again";
  EXPECT_EQ(scenes("stress.json"), 2);
  EXPECT_EQ(scenes("stress-2.json"), 3);
  stress("--scenes 1");
  EXPECT_EQ(scenes("stress-3.json"), 2);
  EXPECT_EQ(scenes("stress.json"), 1);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/.stress.json.lock"));
}

TEST_F(Binary, ATableSaysHowFarItHasCome) {
  // Long before the first scene is finished there is an empty table.
  const Outcome ended =
      shell("'" KBVH_PROGRAM
            "' stress --strategies bottom_up --families many_keyframes --scenes 1 --out out "
            ">/dev/null 2>&1 & pid=$!; for i in $(seq 600); do if [ -e out/stress.json ]; then "
            "break; fi; sleep 0.05; done; kill -9 $pid; wait $pid 2>/dev/null; true");
  EXPECT_EQ(ended.code, 0) << ended.err;
  const json table = json::parse(text_of_file(folder_ / "out/stress.json"));
  EXPECT_LE(table.at("played"), 1);
  EXPECT_EQ(kbvh("stress --strategies bottom_up --families spikes --scenes 1 --l 1 --out out").code, 0)
      << "the lock of a process that was killed binds nobody";
}

TEST_F(Binary, WhatKilledProcessesLeftIsRemoved) {
  std::filesystem::create_directory(folder_ / "out");
  const auto old = std::filesystem::file_time_type::clock::now() - std::chrono::hours(2);
  const auto left = [&](const std::string& name, bool is_old) {
    write_text(folder_ / "out" / name, "half");
    if (is_old) std::filesystem::last_write_time(folder_ / "out" / name, old);
  };
  const std::string nobody = ".tmp-2147483647-0";  // above the largest process id
  left("stress.json" + nobody, true);
  left("targets.json" + nobody, false);
  left("stress.json.tmp-" + std::to_string(getpid()) + "-0", true);
  left("notes.tmp-mine", true);
  EXPECT_EQ(kbvh("run " + one + "--out out").code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / ("out/stress.json" + nobody)));
  EXPECT_TRUE(std::filesystem::exists(folder_ / ("out/targets.json" + nobody)))
      << "it may be of another machine";
  EXPECT_TRUE(std::filesystem::exists(folder_ / ("out/stress.json.tmp-" + std::to_string(getpid()) + "-0")));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/notes.tmp-mine"));
}

TEST_F(Binary, ASceneUnderAnotherNameHasATableOfItsOwn) {
  for (const std::string name : {"first", "second", "first"}) {
    const Outcome run = kbvh("run " + one + "--name " + name + " --out out");
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.out.find(name + ","), std::string::npos) << run.out;
  }
  const auto list = records();
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].at("scene").at("name"), "first");
  EXPECT_EQ(list[1].at("scene").at("name"), "second");
  EXPECT_EQ(list[0].at("scene").at("hash"), list[1].at("scene").at("hash"));
}

TEST_F(Binary, FailuresOfAnotherStressRunStay) {
  const auto files = [&] {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "out"))
      if (entry.path().filename().string().starts_with("repro-")) names.insert(entry.path().filename());
    return names;
  };
  const auto stress = [&](const std::string& seed) {
    const Outcome run = kbvh(
        "stress --strategies loses --families unit --scenes 1 --l 1 --scalars float --out out --seed " + seed,
        "", KBVH_FAULTY_PROGRAM);
    EXPECT_EQ(run.code, 1) << run.err;
    EXPECT_EQ(json::parse(text_of_file(folder_ / "out/stress.json")).at("played"), 1);
  };
  stress("1");
  const std::string first = text_of_file(folder_ / "out/repro-unit-loses-float.json");
  EXPECT_EQ(files().size(), 1u);
  stress("1");
  EXPECT_EQ(files().size(), 1u) << "the same failure twice";
  for (const char* seed : {"2", "3", "4"}) stress(seed);
  EXPECT_EQ(text_of_file(folder_ / "out/repro-unit-loses-float.json"), first);
}

TEST_F(Binary, ScenesOfOneNameHaveCardsOfTheirOwn) {
  write_text(folder_ / "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const auto run = [&](const std::string& file, const std::string& scalar) {
    const Outcome outcome =
        kbvh("run --name mine --body " + file +
             " --body sphere:triangles=80,keyframes=2,step=0.1:0:0 --l 1 --repetitions 1 --strategies "
             "bottom_up --out out --scalar " +
             scalar);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return records().back().at("scene").at("card").get<std::string>();
  };
  const auto card = [&](const std::string& hash) {
    const json read = json::parse(text_of_file(folder_ / ("out/scenes/mine-" + hash) / "card.json"));
    EXPECT_EQ(read.at("hash"), hash);
    return read;
  };
  const std::string first = run("a.obj", "float");
  EXPECT_EQ(run("a.obj", "double"), first) << "a scalar makes no other scene";
  // Corrected, under the old name.
  write_text(folder_ / "a.obj", "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n");
  const std::string second = run("a.obj", "float");
  EXPECT_NE(second, first);
  EXPECT_EQ(card(first).at("bodies")[0].at("primitives"), 1);
  EXPECT_EQ(card(second).at("bodies")[0].at("primitives"), 2);
  // A damaged card is made again.
  write_text(folder_ / ("out/scenes/mine-" + first) / "card.json", "{");
  write_text(folder_ / ("out/scenes/mine-" + second) / "card.json", "");
  EXPECT_EQ(run("a.obj", "double"), second);
  EXPECT_EQ(card(second).at("bodies")[0].at("primitives"), 2);
}

TEST_F(Binary, LongNamesOfScenesAreShortenedInFolders) {
  std::string name;
  for (int i = 0; i < 100; ++i) name += "\xc3\xa4\xe6\xbc\xa2";
  const Outcome run = kbvh("run " + one + "--name " + name + " --out out");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(run.err.find("warning"), std::string::npos) << run.err;
  EXPECT_EQ(records().at(0).at("scene").at("name"), name);
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "out/scenes"))
    EXPECT_TRUE(json(entry.path().filename().string()).dump().size() > 20) << "valid UTF-8";
  EXPECT_EQ(kbvh("run " + one + "--name .. --out out").code, 2);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/card.json"));
}

TEST_F(Binary, ScriptsThatDifferInTheirRateAreMeasuredBoth) {
  for (const std::string rate : {"20", "40"}) {
    write_text(folder_ / "script.json",
               R"({"frames": 10, "rate": )" + rate +
                   R"(, "steps": [{"time": 0, "changes": [{"vertex": 3, "velocity": [0, 0, 1]}]}]})");
    const Outcome run = kbvh(
        "run --body waving_sheet:triangles=50,keyframes=4 --body sphere:triangles=80 --script script.json "
        "--strategies bottom_up --repetitions 1 --out out");
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.err.find("1 configuration measured, 0 were in"), std::string::npos) << run.err;
  }
}

TEST_F(Binary, NothingIsMeasuredTwiceInOneRun) {
  // 50 and 51 triangles are the same sheet, which the numbers do not show.
  const std::string twice =
      "--scene waving_sheet --triangles 50,51,50 --obstacle 80 --keyframes 2 --l 2,2 --scalar float,float "
      "--repetitions 1 --strategies bottom_up,bottom_up ";
  const Outcome kept = kbvh("run " + twice + "--out out");
  EXPECT_EQ(kept.code, 0) << kept.err;
  EXPECT_EQ(records().size(), 1u);
  const Outcome run = kbvh("run " + twice);
  EXPECT_EQ(run.code, 0) << run.err;
  const auto first = run.out.find("\nbottom_up"), second = run.out.find("\nbottom_up", first + 1);
  ASSERT_NE(second, std::string::npos) << run.out;
  EXPECT_EQ(run.out.find("\nbottom_up", second + 1), std::string::npos) << run.out;
  EXPECT_EQ(run.out.substr(first, run.out.find('\n', first + 1) - first),
            run.out.substr(second, run.out.find('\n', second + 1) - second))
      << "the second table shows what was measured";
}

TEST_F(Binary, ThreadsThatTheMachineHasNotAreRefused) {
  const Outcome run = kbvh("run " + one + "--param threads=1000 --out out");
  EXPECT_EQ(run.code, 2) << run.err;
  EXPECT_EQ(run.out, "");
  EXPECT_NE(run.err.find("parameter 'threads' of 'bottom_up' cannot be '1000'"), std::string::npos)
      << run.err;
  EXPECT_TRUE(records().empty());
}

}  // namespace
}  // namespace kbvh::experiments::loss_test
