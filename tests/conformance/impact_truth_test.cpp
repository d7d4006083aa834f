// Continuous collision detection against independent ground truth: exact verdicts by computer algebra (Wang
// et al. 2021).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <set>
#include <tuple>
#include <vector>

#include "core/continuous/contacts.hpp"
#include "core/continuous/impact_batch.hpp"
#include "core/judge/session.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/study/impact_queries.hpp"
#include "tests/program/temporary_folder.hpp"

namespace kbvh::experiments::impact_truth_test {
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

// Batches give the verdicts and enclosures of single tests to the last bit, with every kernel set.
TEST(ImpactTruth, BatchesDecideAsSingleTests) {
  const std::filesystem::path folder = data_folder() / "ccd";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no queries at " << folder << " (set KBVH_DATA)";
  std::uint64_t queries = 0, filtered = 0;
  for (const ImpactQueries& file : find_impact_queries(folder)) {
    std::vector<Impact> single;
    ImpactStats single_stats;
    for (const ImpactQuery& query : file.queries)
      single.push_back(find_impact(query.kind, query.moving(), &single_stats));
    queries += file.queries.size();
    std::vector<std::uint64_t> exact;
    for (const KernelSet set : supported_kernel_sets()) {
      ImpactStats stats;
      std::uint64_t differing = 0;
      ImpactBatch batches[2]{ImpactBatch(Contact::Kind::vertex_face, set),
                             ImpactBatch(Contact::Kind::edge_edge, set)};
      for (std::size_t i = 0, first = 0; i < file.queries.size(); ++i) {
        ImpactBatch& batch = batches[std::size_t(file.queries[i].kind)];
        ASSERT_EQ(file.queries[i].kind, file.queries[0].kind);
        batch.add(file.queries[i].moving());
        if (!batch.full() && i + 1 < file.queries.size()) continue;
        batch.decide(&stats);
        for (std::size_t k = 0; k < batch.size(); ++k) {
          const Impact &found = batch.impact(k), &expected = single[first + k];
          differing +=
              found.touches != expected.touches || found.begin != expected.begin || found.end != expected.end
                  ? 1
                  : 0;
        }
        first = i + 1;
        batch.clear();
      }
      EXPECT_EQ(differing, 0u) << file.name << ", " << name(set);
      EXPECT_EQ(stats.tests, file.queries.size());
      EXPECT_LE(stats.exact, single_stats.exact) << file.name << ", " << name(set);
      exact.push_back(stats.exact);
      filtered += set == KernelSet::portable ? stats.filtered : 0;
    }
    EXPECT_EQ(std::adjacent_find(exact.begin(), exact.end(), std::not_equal_to<>()), exact.end())
        << file.name;
  }
  EXPECT_GT(queries, 100000u);
  EXPECT_GT(filtered, queries / 2);
}

// Does the same without the filter, where that takes only seconds.
TEST(ImpactTruth, ExactArithmeticAloneIsRight) {
  const std::filesystem::path folder = data_folder() / "ccd" / "queries";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no queries at " << folder << " (set KBVH_DATA)";
  for (const ImpactQueries& file : find_impact_queries(folder))
    for (const ImpactQuery& query : file.queries)
      ASSERT_EQ(find_impact_exact(query.kind, query.moving()).touches, *query.truth) << file.name;
}

// Both pairs of frames as scenes of one body: broad and narrow phase of every strategy together.
class FramePairs : public testing::TestWithParam<std::string> {};

TEST_P(FramePairs, ListedPairsAreFoundOrFree) {
  const std::filesystem::path folder = data_folder() / "ccd" / "frames" / GetParam();
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no frames at " << folder << " (set KBVH_DATA)";
  const FramePair pair = read_frame_pair(folder);
  Scene<double> scene;
  Body<double> body;
  body.name = pair.name;
  for (const auto& face : pair.faces) body.primitives.add(face);
  std::vector<double> positions = pair.positions[0];
  positions.insert(positions.end(), pair.positions[1].begin(), pair.positions[1].end());
  const std::vector<double> times{0, 1};
  body.plans = FlightPlans<double>(std::uint32_t(pair.positions[0].size() / 3), times, std::move(positions));
  scene.bodies.push_back(std::move(body));
  scene.pairs = {{0, 0}};
  const Features features(scene.bodies[0].primitives);
  ASSERT_EQ(features.edges().size(), pair.edges.size());
  for (std::size_t i = 0; i < pair.edges.size(); ++i) {
    ASSERT_EQ(features.edges()[i].vertices[0], pair.edges[i][0]);
    ASSERT_EQ(features.edges()[i].vertices[1], pair.edges[i][1]);
  }
  int strategies = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts || !entry.info.can.self_pairs || entry.info.max_primitive_pairs != 0)
      continue;
    ++strategies;
    Session<double> session(scene, {&entry, {}, entry.info.topology.preferred});
    session.reset(0);
    ContactBuffer contacts;
    PhaseTimes times_taken;
    session.contacts(1, contacts, times_taken);
    using Key = std::tuple<Contact::Kind, std::uint32_t, std::uint32_t>;
    std::set<Key> found;
    for (const Contact& contact : contacts)
      EXPECT_TRUE(found.insert({contact.kind, contact.feature_a, contact.feature_b}).second) << "twice";
    std::uint64_t missed = 0, extra = 0, touching = 0;
    for (const FramePair::Listed& listed : pair.listed) {
      std::uint32_t a = listed.first, b = listed.second;
      if (listed.kind == Contact::Kind::edge_edge && a > b) std::swap(a, b);
      const bool reported = found.contains({listed.kind, a, b});
      touching += listed.touches ? 1 : 0;
      missed += listed.touches && !reported ? 1 : 0;
      extra += !listed.touches && reported ? 1 : 0;
    }
    EXPECT_EQ(missed, 0u) << entry.info.id;
    EXPECT_EQ(extra, 0u) << entry.info.id;
    EXPECT_GT(touching, 4000u);
    EXPECT_GE(contacts.size(), touching);
  }
  EXPECT_GE(strategies, 1);
}

INSTANTIATE_TEST_SUITE_P(Data, FramePairs, testing::Values("cloth-ball", "rod-twist"), [](const auto& test) {
  return test.param == "rod-twist" ? "rod_twist" : "cloth_ball";
});

TEST(ImpactQueries, ComplainWithTheLine) {
  const TemporaryFolder place;
  const std::filesystem::path folder = place / "queries";
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
  EXPECT_NE(message("vf.csv", "x,2,0,1,0,1\n").find("not a double"), std::string::npos);
}

}  // namespace
}  // namespace kbvh::experiments::impact_truth_test
