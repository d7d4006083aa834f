// Continuous collision detection against ground truth that nobody here made: exact verdicts by computer
// algebra (Wang et al. 2021).
#include <gtest/gtest.h>

#include <cstdlib>

#include "experiments/environment.hpp"
#include "experiments/impact_queries.hpp"
#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {
namespace {

TEST(ImpactTruth, EveryVerdictIsRight) {
  const std::filesystem::path folder = data_folder() / "ccd";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no queries at " << folder << " (set KBVH_DATA)";
  std::uint64_t queries = 0, touching = 0;
  ImpactStats stats;
  for (const ImpactQueries& file : find_impact_queries(folder)) {
    std::uint64_t missed = 0, extra = 0, inexact = 0;
    for (const ImpactQuery& query : file.queries) {
      ASSERT_TRUE(query.truth.has_value()) << file.name;
      const Impact impact = find_impact(query.kind, query.moving(), &stats);
      if (*query.truth && !impact.touches) ++missed;
      if (!*query.truth && impact.touches) ++extra;
      if (impact.touches && !(impact.end - impact.begin <= impact_width)) ++inexact;
      touching += impact.touches ? 1 : 0;
    }
    EXPECT_EQ(missed, 0u) << file.name;
    EXPECT_EQ(extra, 0u) << file.name;
    EXPECT_EQ(inexact, 0u) << file.name;
    queries += file.queries.size();
  }
  EXPECT_GT(queries, 100000u);
  EXPECT_GT(touching, 100000u);
  EXPECT_EQ(stats.filtered + stats.exact, queries);
}

// The same without the filter, where that is a matter of seconds.
TEST(ImpactTruth, ExactArithmeticAloneIsRight) {
  const std::filesystem::path folder = data_folder() / "ccd" / "queries";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no queries at " << folder << " (set KBVH_DATA)";
  for (const ImpactQueries& file : find_impact_queries(folder))
    for (const ImpactQuery& query : file.queries)
      ASSERT_EQ(find_impact_exact(query.kind, query.moving()).touches, *query.truth) << file.name;
}

TEST(ImpactQueries, ComplainWithTheLine) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "impact_queries";
  std::filesystem::create_directories(folder);
  const auto message = [&](const std::string& name, const std::string& text) -> std::string {
    const std::filesystem::path file = folder / name;
    std::FILE* out = std::fopen(file.c_str(), "w");
    std::fputs(text.c_str(), out);
    std::fclose(out);
    try {
      read_impact_queries(file);
    } catch (const io::InputError& problem) {
      return problem.what();
    }
    return "";
  };
  const std::string row = "1,2,0,1,-3,4,1\n";
  std::string query;
  for (int i = 0; i < 8; ++i) query += row;
  EXPECT_EQ(message("vf.csv", query), "");
  EXPECT_NE(message("what.csv", query).find("vertex-face"), std::string::npos);
  EXPECT_NE(message("vf.csv", query + row).find("9 rows"), std::string::npos);
  EXPECT_NE(message("vf.csv", "1,3,0,1,0,1,0\n").find("line 1"), std::string::npos);  // 1/3 is no double
  EXPECT_NE(message("vf.csv", row + "1,0,0,1,0,1,0\n").find("line 2"), std::string::npos);
  EXPECT_NE(message("vf.csv", row + "1,2,0,1,0,1,0\n").find("verdict differs"), std::string::npos);
  EXPECT_NE(message("vf.csv", "1,2,3\n").find("columns"), std::string::npos);
  EXPECT_NE(message("vf.csv", "x,2,0,1,0,1\n").find("no double"), std::string::npos);
}

}  // namespace
}  // namespace kbvh::experiments
