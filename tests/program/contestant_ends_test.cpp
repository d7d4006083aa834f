// A contestant that runs out of memory or ends the program takes no measurement of another one with it, and
// gets the verdict that it deserves.
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "binary.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments::contestant_ends_test {
namespace {

TEST_F(Binary, OutOfMemoryIsNoBrokenGuaranteeAndIsMeasuredAgain) {
  // At the first frame, during verification; and during the timed clip, after the guarantee has held.
  for (const std::string memory : {"0", "4"})
    for (const std::string command : {"run "}) {
      SCOPED_TRACE(command + memory);
      const std::string out = command.substr(0, 1) + memory;
      const std::string arguments = command + tiny + "--strategies honest,needs_memory --out " + out;
      const Outcome first = kbvh(arguments, "KBVH_TEST_MEMORY=" + memory, KBVH_FAULTY_PROGRAM);
      EXPECT_EQ(first.code, 3) << first.err;
      EXPECT_EQ(first.err.find("breaks its guarantee"), std::string::npos) << first.err;
      EXPECT_NE(first.err.find("1 configuration without enough memory"), std::string::npos) << first.err;
      EXPECT_NE(first.out.find("needs_memory is refused a time: out of memory"), std::string::npos)
          << first.out;
      const auto list = records(out + "/results.jsonl");
      ASSERT_EQ(list.size(), 2u);
      EXPECT_TRUE(list[0].at("times").is_object());
      EXPECT_EQ(list[1].at("refused"), "out of memory");
      EXPECT_EQ(list[1].at("unfinished"), true);
      EXPECT_TRUE(list[1].at("times").is_null());
      const Outcome second = kbvh(arguments, "KBVH_TEST_MEMORY=1000", KBVH_FAULTY_PROGRAM);
      EXPECT_EQ(second.code, 0) << second.err;
      EXPECT_NE(second.err.find("1 configuration measured, 1 was in"), std::string::npos) << second.err;
      const auto all = records(out + "/results.jsonl");
      ASSERT_EQ(all.size(), 3u);
      EXPECT_EQ(all[2].at("key"), list[1].at("key"));
      EXPECT_TRUE(all[2].at("times").is_object());
      EXPECT_EQ(kbvh(arguments, "", KBVH_FAULTY_PROGRAM).code, 0) << "a good result is not measured again";
    }
}

TEST_F(Binary, AContestantThatTerminatesTheProgramIsNamed) {
  const Outcome first = kbvh("run " + tiny + "--strategies honest --out out", "", KBVH_FAULTY_PROGRAM);
  ASSERT_EQ(first.code, 0) << first.err;
  const Outcome second = kbvh("run " + tiny + "--strategies honest,needs_memory --out out",
                              "KBVH_TEST_MEMORY=-1", KBVH_FAULTY_PROGRAM);
  EXPECT_EQ(second.code, 3) << second.err;
  EXPECT_NE(second.err.find("terminated by a library, without an exception, during"), std::string::npos)
      << second.err;
  EXPECT_NE(second.err.find("verifying needs_memory"), std::string::npos) << second.err;
  EXPECT_EQ(records("out/results.jsonl").size(), 1u) << "what was measured before is kept";
  EXPECT_EQ(kbvh("run " + tiny + "--strategies honest --out out", "", KBVH_FAULTY_PROGRAM).code, 0);
}

// An assertion in a library ends the program: earlier measurements are kept, and the next run continues
// without the contestant.
TEST_F(Binary, AContestantThatAbortsIsReportedAndLeftOut) {
  ASSERT_EQ(kbvh("run " + tiny + "--strategies honest --seed 2 --out out", "", KBVH_FAULTY_PROGRAM).code, 0);
  // At the first frame, during verification; and during the timed clip, after the guarantee has held.
  for (const auto& [advances, doing] : {std::pair{"0", "verifying"}, std::pair{"5", "timing"}})
    for (const std::string command : {"run ", "bench "}) {
      SCOPED_TRACE(command + doing);
      const std::string out = command.substr(0, 1) + advances;
      std::filesystem::copy(folder_ / "out", folder_ / out, std::filesystem::copy_options::recursive);
      const std::string arguments = command + tiny + "--strategies honest,aborts,admits_to_lose --out " + out;
      const Outcome first = kbvh(arguments, std::string("KBVH_TEST_ABORT=") + advances, KBVH_FAULTY_PROGRAM);
      EXPECT_EQ(first.code, 128 + 6) << first.err;
      EXPECT_NE(first.err.find(std::string("aborted (SIGABRT) while ") + doing + " aborts on waving_sheet"),
                std::string::npos)
          << first.err;
      EXPECT_EQ(records(out + "/results.jsonl").size(), 1u) << "what was measured before is kept";

      const Outcome second = kbvh(arguments, std::string("KBVH_TEST_ABORT=") + advances, KBVH_FAULTY_PROGRAM);
      EXPECT_EQ(second.code, 1) << second.err;
      EXPECT_NE(second.err.find("aborts is left out of "), std::string::npos) << second.err;
      const auto list = records(out + "/results.jsonl");
      ASSERT_EQ(list.size(), 4u);
      for (const json& record : list) {
        const bool aborts = record.at("strategy").at("id") == "aborts";
        EXPECT_EQ(record.at("times").is_null(), aborts) << record.dump();
        EXPECT_EQ(record.at("verified").at("holds"), !aborts) << record.dump();
        if (!aborts) continue;
        const std::string why = record.at("refused");
        EXPECT_TRUE(why.starts_with(doing) && why.ends_with(", the program ended by SIGABRT (aborted)"))
            << why;
      }
      const Outcome third = kbvh(arguments, "", KBVH_FAULTY_PROGRAM);
      EXPECT_EQ(third.code, 1) << "the verdict stays";
      EXPECT_EQ(records(out + "/results.jsonl").size(), 4u);
      for (const auto& entry : std::filesystem::directory_iterator(folder_ / out))
        EXPECT_NE(entry.path().extension(), ".measuring") << entry.path();
    }
  // Without a folder, the program at least reports what it was doing.
  const Outcome alone =
      kbvh("run " + tiny + "--strategies honest,aborts", "KBVH_TEST_ABORT=0", KBVH_FAULTY_PROGRAM);
  EXPECT_EQ(alone.code, 128 + 6);
  EXPECT_NE(alone.err.find("while verifying aborts on waving_sheet"), std::string::npos) << alone.err;
}

TEST_F(Binary, AnEmptyNoteOfAKilledRunIsRemoved) {
  std::filesystem::create_directories(folder_ / "out");
  char host[256] = {};
  ASSERT_EQ(::gethostname(host, sizeof host - 1), 0);
  // No process has this number: a run that was killed before it began to measure has left this file.
  const std::filesystem::path left = folder_ / "out" / (std::string(host) + "-2147483647.measuring");
  std::ofstream(left).close();
  const Outcome run = kbvh("run " + tiny + "--strategies bottom_up --out out");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_FALSE(std::filesystem::exists(left));
}

// Lack of memory is the usual reason: no verdict, and the next run measures the others of the table.
TEST_F(Binary, AContestantThatTerminatesTheProgramIsTriedOnceMoreAfterTheOthers) {
  const std::string arguments = "run " + tiny + "--strategies honest,needs_memory --out out";
  EXPECT_EQ(kbvh(arguments, "KBVH_TEST_MEMORY=-1", KBVH_FAULTY_PROGRAM).code, 3);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/results.jsonl"));
  const Outcome second = kbvh(arguments, "KBVH_TEST_MEMORY=-1", KBVH_FAULTY_PROGRAM);
  EXPECT_EQ(second.code, 3) << second.err;
  EXPECT_NE(second.err.find("1 configuration without enough memory; the next run measures it again"),
            std::string::npos)
      << second.err;
  const auto list = records("out/results.jsonl");
  ASSERT_EQ(list.size(), 2u);
  for (const json& record : list)
    EXPECT_EQ(record.value("unfinished", false), record.at("strategy").at("id") == "needs_memory");
  const Outcome third = kbvh(arguments, "KBVH_TEST_MEMORY=1000", KBVH_FAULTY_PROGRAM);
  EXPECT_EQ(third.code, 0) << third.err;
  EXPECT_EQ(records("out/results.jsonl").size(), 3u);
}

// Running out of memory is never a contestant's fault, at any point.
TEST_F(Binary, WantOfMemoryIsNeverABrokenGuarantee) {
  if (known_strategy("embree_refit") == nullptr) GTEST_SKIP() << "built without Embree";
  for (const std::string kilobytes : {"120000", "180000", "200000", "250000"}) {
    const Outcome run = shell("ulimit -v " + kilobytes + "; '" KBVH_PROGRAM "' run " + tiny +
                              "--strategies embree_refit,bottom_up --out m" + kilobytes);
    EXPECT_NE(run.code, 1) << kilobytes << ": " << run.err;
    EXPECT_EQ(run.err.find("breaks its guarantee"), std::string::npos) << run.err;
  }
}

}  // namespace
}  // namespace kbvh::experiments::contestant_ends_test
