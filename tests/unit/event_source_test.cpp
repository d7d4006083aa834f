// Events stepped one by one through the contract have the same effect as `advance`, and are described
// correctly.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include "core/contract/registry.hpp"
#include "core/judge/follow_script.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::event_source_test {
namespace {

std::vector<const StrategyEntry*> sources() {
  std::vector<const StrategyEntry*> found;
  for (const StrategyEntry& entry : registry())
    if (entry.info.can.events) found.push_back(&entry);
  return found;
}

template <class S>
std::vector<Box<double>> boxes_of(Session<S>& session) {
  std::vector<Box<double>> all;
  session.playback().evaluate_all();
  for (std::uint32_t body = 0; body < session.scene().bodies.size(); ++body)
    if (const auto view = session.strategy().audit_view(body))
      all.insert(all.end(), view->boxes.begin(), view->boxes.end());
  return all;
}

/// Plays a scene twice, by frames and by events; all results must be equal.
template <class S>
void compare(const StrategyEntry& entry, const std::string& name,
             const std::map<std::string, std::string>& params) {
  SCOPED_TRACE(entry.info.id + " on " + name + (sizeof(S) == 4 ? " in float" : " in double"));
  const TestScene<S> test = synthetic_scene<S>(name, 3);
  if (has_self_pairs(test.scene.pairs) && !entry.info.can.self_pairs) return;
  const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 3) : test.frames;
  const Contestant contestant{&entry, params, entry.info.topology.preferred};
  Session<S> by_frames(test.scene, contestant);
  Session<S> by_events(test.scene, contestant);
  ScriptCursor<S> cursor_a(test.script.empty() ? nullptr : &test.script), cursor_b = cursor_a;
  PhaseTimes times;
  PairBuffer pairs_a, pairs_b;
  std::vector<BoundNotice<S>> log_a, log_b, described;
  by_frames.reset(frames[0]);
  by_events.reset(frames[0]);
  by_frames.strategy().events()->watch_bounds(&log_a);
  EventSource<S>& source = *by_events.strategy().events();
  source.watch_bounds(&log_b);
  EventDescription<S> done;
  std::vector<ScheduledEvent<S>> queue;
  std::uint64_t events = 0;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const double t = frames[f];
    if (f > 0) {
      by_frames.advance(t, times);
      for (;;) {
        const bool listed = events < 8 || events % 128 == 0;  // lists the whole queue, which takes time
        const auto next = source.next_event();
        ASSERT_EQ(source.next_event_time(), next ? next->time.time : std::numeric_limits<double>::infinity());
        if (listed) {
          source.scheduled_events(queue);
          ASSERT_EQ(next.has_value(), !queue.empty());
          if (next) {
            ASSERT_EQ(*next, queue.front());
          }
          for (std::size_t i = 1; i < queue.size(); ++i) {
            const auto &a = queue[i - 1], &b = queue[i];
            if (a.has_crossing && b.has_crossing) {
              ASSERT_LE(compare_crossings(a.crossing, b.crossing), 0) << "the queue is not in order";
            }
          }
        }
        const std::size_t logged = log_b.size();
        if (!by_events.step_event(t, done)) break;
        ++events;
        ASSERT_EQ(done.event, *next) << "another event than the first";
        if (done.event.has_crossing) {
          ASSERT_LE(compare_crossing_to(done.event.crossing, t), 0) << "not due yet";
        }
        ASSERT_TRUE(std::equal(done.touched.begin(), done.touched.end(),
                               log_b.begin() + std::ptrdiff_t(logged), log_b.end()));
        for (const BoundNotice<S>& notice : done.touched) {
          ASSERT_EQ(notice.crossing, done.event.crossing);
          ASSERT_EQ(source.realiser(notice.body, notice.node, notice.side), notice.new_vertex);
        }
        if (done.event.kind == EventKind::bound) {
          ASSERT_FALSE(done.touched.empty());
          ASSERT_EQ(done.touched[0].node, done.event.node);
          ASSERT_EQ(done.touched[0].old_vertex, done.event.winner);
          ASSERT_EQ(done.touched[0].new_vertex, done.event.loser);
        } else {
          ASSERT_TRUE(done.touched.empty());
        }
        if (listed) {
          source.scheduled_events(queue);
          for (const ScheduledEvent<S>& made : done.rescheduled)
            ASSERT_NE(std::find(queue.begin(), queue.end(), made), queue.end()) << "is not in the queue";
        }
        if (events % 32 == 1) {
          ASSERT_THROW(by_events.strategy().candidates_at(by_events.playback().time(), pairs_b, {}),
                       std::invalid_argument)
              << "answers between frames";
          ASSERT_THROW(by_events.strategy().advance(frames[f - 1]), std::invalid_argument);
        }
      }
      by_events.advance(t, times);
    }
    by_frames.query(pairs_a, times);
    by_events.query(pairs_b, times);
    ASSERT_EQ(pairs_a, pairs_b) << "t = " << t;
    ASSERT_EQ(boxes_of(by_frames), boxes_of(by_events)) << "t = " << t;
    follow(by_frames, cursor_a.at(t), times);
    follow(by_events, cursor_b.at(t), times);
    ASSERT_EQ(log_a, log_b) << "t = " << t;
  }
  const Counters a = by_frames.strategy().counters(), b = by_events.strategy().counters();
  for (std::size_t c = 0; c < a.values.size(); ++c)
    if (Counter(c) != Counter::bytes && Counter(c) != Counter::positions_fetched) {
      EXPECT_EQ(a.values[c], b.values[c]) << kbvh::name(Counter(c));
    }
  if (name == "soups") {
    EXPECT_GT(events, 20u);
    EXPECT_FALSE(log_a.empty());
  }
}

TEST(EventSource, TheStructuresOfThePaperHaveEvents) {
  std::vector<std::string> ids;
  for (const StrategyEntry* entry : sources()) ids.push_back(entry->info.id);
  for (const char* id : {"kinetic_aabb", "kinetic_boxtree", "kinetic_separation_list"})
    EXPECT_NE(std::find(ids.begin(), ids.end(), id), ids.end()) << id;
}

TEST(EventSource, SteppingIsAdvancing) {
  for (const StrategyEntry* entry : sources()) {
    for (const char* scene : {"soups", "plan_changes", "geometry_changes_shared"})
      compare<float>(*entry, scene, {});
    compare<double>(*entry, "soups", {});
    for (const Parameter& parameter : entry->info.parameters)
      if (parameter.name == "queue")
        for (const std::string& word : parameter.allowed)
          if (word != parameter.default_value) compare<float>(*entry, "soups", {{"queue", word}});
  }
}

/// Plays a scene event by event with one queue. Returns the events that change anything, in order, and the
/// answers of all frames.
template <class S>
std::vector<ScheduledEvent<S>> log_of(const StrategyEntry& entry, const TestScene<S>& test,
                                      const std::string& queue, std::vector<PairBuffer>& answers) {
  const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 2) : test.frames;
  Session<S> session(
      test.scene,
      {&entry, {{"queue", queue}}, BuilderConfig{.method = BuildMethod::median, .width = 2, .leaf_size = 1}});
  ScriptCursor<S> cursor(test.script.empty() ? nullptr : &test.script);
  PhaseTimes times;
  std::vector<ScheduledEvent<S>> log;
  EventDescription<S> done;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (f == 0) {
      session.reset(frames[0]);
    } else {
      while (session.step_event(frames[f], done))
        if (done.event.kind != EventKind::review && done.event.kind != EventKind::window)
          log.push_back(done.event);
      session.advance(frames[f], times);
    }
    session.query(answers.emplace_back(), times);
    std::sort(answers.back().begin(), answers.back().end());
    follow(session, cursor.at(frames[f]), times);
  }
  return log;
}

/// The effect and the exact time of an event; estimates of the time may differ.
template <class S>
bool same_event(const ScheduledEvent<S>& a, const ScheduledEvent<S>& b) {
  return a.kind == b.kind && a.body == b.body && a.node == b.node && a.side == b.side &&
         a.winner == b.winner && a.loser == b.loser && a.other_body == b.other_body &&
         a.other_node == b.other_node && a.crossing == b.crossing;
}

template <class S>
void compare_queues(const std::string& id, const std::string& scene) {
  SCOPED_TRACE(id + " on " + scene + (sizeof(S) == 4 ? " in float" : " in double"));
  const StrategyEntry& entry = find_strategy(id);
  const TestScene<S> test = synthetic_scene<S>(scene, 2);
  std::vector<PairBuffer> answers_a, answers_b;
  const auto a = log_of<S>(entry, test, "avl", answers_a),
             b = log_of<S>(entry, test, "segment_heap", answers_b);
  EXPECT_GT(a.size(), 100u);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_TRUE(same_event(a[i], b[i])) << "event " << i;
  EXPECT_EQ(answers_a, answers_b);
}

// With segments the separation list decides pairs by the signs of their gaps; with the AVL tree, piece by
// piece.
TEST(EventSource, QueuesDoNotChangeTheEventsOfTheSeparationList) {
  for (const char* scene : {"soups", "sheets", "static_obstacle", "four_bodies_own_keyframes", "integer_ties",
                            "all_cross_at_once", "keyframes_a_millionth_apart", "coincident_intervals",
                            "plan_changes", "geometry_changes_shared", "self_polygons"})
    compare_queues<float>("kinetic_separation_list", scene);
  for (const char* scene : {"soups", "integer_ties", "coincident_intervals", "plan_changes"})
    compare_queues<double>("kinetic_separation_list", scene);
}

// ---- The pairs that a separation list watches -------------------------------------------------------------

/// Compares the watched pairs with boxes, trees and answers at the session's time: they form trees of pairs
/// whose roots are pairs of roots. Each leaf has one primitive, and no body is paired with itself. Returns
/// the number of pairs.
template <class S>
std::size_t check_watched_pairs(Session<S>& session) {
  using Nodes = std::array<std::uint32_t, 4>;
  const EventSource<S>& source = *session.strategy().events();
  std::vector<WatchedPair> watched(3);  // old content, to be replaced
  source.watched_pairs(watched);
  std::map<Nodes, WatchedPair> pairs;
  std::vector<WatchedPair> open;
  for (const WatchedPair& pair : watched) {
    EXPECT_TRUE(pairs.emplace(Nodes{pair.body, pair.node, pair.other_body, pair.other_node}, pair).second)
        << "a pair twice";
    if (pair.node == 0 && pair.other_node == 0) open.push_back(pair);
  }
  PairBuffer expected, found;
  session.strategy().candidates_at(session.playback().time(), found, {});
  session.playback().evaluate_all();
  std::vector<AuditView> views;
  for (std::uint32_t body = 0; body < session.scene().bodies.size(); ++body)
    views.push_back(*session.strategy().audit_view(body));
  std::size_t reached = 0;
  while (!open.empty()) {
    const WatchedPair pair = open.back();
    open.pop_back();
    ++reached;
    const AuditView &a = views[pair.body], &b = views[pair.other_body];
    const TopologyNode na = a.topology.nodes[pair.node], nb = b.topology.nodes[pair.other_node];
    if (!pair.overlapping) {
      EXPECT_FALSE(overlap(a.boxes[pair.node], b.boxes[pair.other_node])) << "said to be apart";
    }
    if (na.is_leaf() && nb.is_leaf()) {
      EXPECT_TRUE(pair.listed);
      if (pair.overlapping)
        expected.push_back({pair.body, a.topology.primitives[na.first()], pair.other_body,
                            b.topology.primitives[nb.first()]});
      continue;
    }
    EXPECT_EQ(pair.listed, !pair.overlapping);
    if (pair.listed) continue;
    const std::uint32_t first_a = na.is_leaf() ? pair.node : na.first(),
                        end_a = na.is_leaf() ? first_a + 1 : first_a + na.count();
    const std::uint32_t first_b = nb.is_leaf() ? pair.other_node : nb.first(),
                        end_b = nb.is_leaf() ? first_b + 1 : first_b + nb.count();
    for (std::uint32_t i = first_a; i < end_a; ++i)
      for (std::uint32_t j = first_b; j < end_b; ++j) {
        const auto child = pairs.find({pair.body, i, pair.other_body, j});
        EXPECT_NE(child, pairs.end()) << "a pair without all of its children";
        if (child != pairs.end()) open.push_back(child->second);
      }
  }
  EXPECT_EQ(reached, watched.size()) << "pairs that belong to no tree of pairs";
  std::sort(expected.begin(), expected.end());
  std::sort(found.begin(), found.end());
  EXPECT_EQ(expected, found) << "the query reads other leaves";
  return watched.size();
}

TEST(EventSource, WatchedPairsAreThoseOfTheSeparationList) {
  for (const char* scene : {"soups", "sheets", "four_bodies_own_keyframes", "plan_changes"}) {
    SCOPED_TRACE(scene);
    const TestScene<float> test = synthetic_scene<float>(scene, 3);
    const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 3) : test.frames;
    Session<float> session(test.scene,
                           {&find_strategy("kinetic_separation_list"),
                            {},
                            BuilderConfig{.method = BuildMethod::median, .width = 2, .leaf_size = 1}});
    ScriptCursor<float> cursor(test.script.empty() ? nullptr : &test.script);
    PhaseTimes times;
    std::size_t most = 0;
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (f == 0)
        session.reset(frames[0]);
      else
        session.advance(frames[f], times);
      most = std::max(most, check_watched_pairs(session));
      follow(session, cursor.at(frames[f]), times);
    }
    EXPECT_GT(most, 50u);
  }
}

TEST(EventSource, OtherStrategiesWatchNoPairs) {
  const TestScene<float> test = synthetic_scene<float>("soups", 1);
  for (const StrategyEntry* entry : sources()) {
    if (entry->info.id == "kinetic_separation_list") continue;
    Session<float> session(test.scene, {entry, {}, entry->info.topology.preferred});
    session.reset(frame_times(test.scene, 1).front());
    std::vector<WatchedPair> watched(3);
    session.strategy().events()->watched_pairs(watched);
    EXPECT_TRUE(watched.empty()) << entry->info.id;
  }
}

// ---- Counters of the BoxTree's searches -------------------------------------------------------------------

TEST(BoxTreeCounters, CountSearchesSinceTheReset) {
  const TestScene<float> test = synthetic_scene<float>("soups", 1);
  const std::vector<double> frames = frame_times(test.scene, 1);
  const Contestant contestant{&find_strategy("kinetic_boxtree"),
                              {{"candidates", "searched"}},
                              BuilderConfig{.method = BuildMethod::median, .width = 2, .leaf_size = 1}};
  Session<float> session(test.scene, contestant);
  const auto named = [&] {
    std::map<std::string, std::uint64_t> values;
    for (const Counters::Named& counter : session.strategy().counters().named)
      values[std::string(counter.name)] = counter.value;
    return values;
  };
  using Values = std::map<std::string, std::uint64_t>;
  const Values none{{"certificate_searches", 0}, {"most_nodes_searched", 0}, {"nodes_searched", 0}};
  session.reset(frames.front());
  EXPECT_EQ(named(), none);
  EventDescription<float> done;
  std::uint64_t events = 0;
  Values before = named();
  for (; session.step_event(frames.back(), done); ++events) {
    const Values after = named();
    // An event searches the candidates of each bound that changes; further searches may follow above.
    EXPECT_GE(after.at("certificate_searches"), before.at("certificate_searches") + done.touched.size());
    EXPECT_LE(after.at("most_nodes_searched"), after.at("nodes_searched"));
    EXPECT_GE(after.at("most_nodes_searched") * after.at("certificate_searches"), after.at("nodes_searched"));
    before = after;
  }
  EXPECT_GT(events, 100u);
  const std::uint32_t largest =
      std::max(session.strategy().events()->tree(0).size(), session.strategy().events()->tree(1).size());
  EXPECT_GT(before.at("most_nodes_searched"), 4u);
  EXPECT_LE(before.at("most_nodes_searched"), 2 * largest);
  session.reset(frames.front());
  EXPECT_EQ(named(), none);
}

}  // namespace
}  // namespace kbvh::test::event_source_test
