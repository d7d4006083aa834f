// The policy of a choice, without geometry: its budget for trials against adversaries who set all costs, its
// return to a refit, and what it does where costs are steady.

#include "core/families/choice/choice_policy.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/support/random.hpp"

namespace kbvh::test::choice_policy_test {
namespace {

constexpr double share = ChoicePolicy::Settings{}.budget;
constexpr std::size_t candidates = 5;
constexpr std::size_t joins = 4;  ///< this candidate and those after it answer segments

/// Who sets the costs, with full knowledge of the policy.
enum class Adversary {
  random,    ///< costs of six orders of magnitude, new ones at every frame
  turncoat,  ///< cheap while it is tried, expensive once it is the incumbent
  usurer,    ///< a trial takes all that its limit allows
  tempter,   ///< the same, and all predictions and the incumbent's costs call for trials
  glutton,   ///< a trial takes more than its limit
  swindler,  ///< the refit's costs are low when they are counted, and high when they matter
};
constexpr Adversary adversaries[] = {Adversary::random,  Adversary::turncoat, Adversary::usurer,
                                     Adversary::tempter, Adversary::glutton,  Adversary::swindler};

/// Whether a candidate stops at its limit.
enum class Stops { yes, no };

/// Accounts that are kept apart from those of the policy.
struct Accounts {
  double work = 0, charges = 0, allowances = 0;
  double trial = 0, stay = 0, allowance = 0;  ///< of the current trial
  int answered = 0;
  bool tries = false;
  std::vector<bool> used = std::vector<bool>(candidates, false);

  double charge() const { return tries ? std::max(0.0, trial - stay * answered) : 0; }
  void end_trial(std::size_t candidate) {
    if (charge() > 0) {
      charges += charge();
      allowances += allowance;
      used[candidate] = true;
    }
    tries = false;
  }
  /// Returns by how much the charges exceed the bound, as a share of all work.
  double excess() const {
    const double bound = share * work + allowances + (charge() > 0 ? allowance : 0);
    return (charges + charge() - bound) / std::max(1.0, work);
  }
};

struct Result {
  double worst = -1;  ///< largest excess over the bound
  int trials = 0, stops = 0, switches = 0;
  std::vector<std::size_t> answers;
};

class Game {
 public:
  Game(Adversary adversary, std::uint64_t seed, const ChoicePolicy::Settings& settings, Stops stops)
      : adversary_(adversary),
        stops_(stops),
        random_(seed),
        policy_(candidates, settings),
        offers_(candidates) {
    policy_.start_over();
    policy_.worked(accounts_.work = 100, 50);
  }

  Result play(int frames) {
    for (int frame = 1; frame <= frames; ++frame) {
      offer();
      const std::size_t before = policy_.active(), incumbent = policy_.incumbent();
      const bool tried = accounts_.tries;
      const std::size_t active = policy_.next(offers_);
      result_.switches += policy_.incumbent() != incumbent;
      if (policy_.begins()) {
        if (tried) accounts_.end_trial(before);
        begin(active);
      }
      answer(active);
      --left_in_segment_;
      result_.answers.push_back(policy_.active());
      check(frame);
      if (::testing::Test::HasFailure()) break;
    }
    return result_;
  }

 private:
  /// Returns a number between 1 / 10^orders and 10^orders.
  double any(double orders) { return std::pow(10.0, orders * random_.unit()); }

  void offer() {
    if (left_in_segment_ <= 0) left_in_segment_ = segment_ = 1 + int(random_.below(40));
    for (std::size_t i = 0; i < candidates; ++i) {
      Offer& offer = offers_[i];
      offer.expected = adversary_ == Adversary::tempter ? 1 : 100 * any(2);
      offer.hoped = offer.expected * (0.5 + 0.5 * std::abs(random_.unit()));
      offer.fixed = adversary_ == Adversary::random ? 100 * std::abs(random_.unit()) : 0;
      offer.change = i == 2 ? 50 * any(1) : 0;
      offer.whole = i >= joins ? segment_ : i == 3 ? 8 : 1;
      offer.follows_prediction = i >= joins;
      offer.frames = i >= joins
                         ? (i == policy_.active() || left_in_segment_ == segment_ ? left_in_segment_ : 0)
                         : offer.whole;
      if (i != 0 && random_.below(50) == 0) offer.frames = 0;
    }
    if (random_.below(30) == 0) policy_.changed(std::abs(random_.unit()));
  }

  void begin(std::size_t active) {
    accounts_.trial = 0;
    accounts_.answered = 0;
    accounts_.tries = policy_.state() == ChoiceState::tries;
    accounts_.stay = policy_.stay_estimate();
    const double cap = offers_[active].frames * policy_.estimate(ChoicePolicy::refit);
    accounts_.allowance = accounts_.used[active] ? 0 : cap;
    result_.trials += accounts_.tries;
    if (policy_.state() == ChoiceState::stays && active != ChoicePolicy::refit) {
      EXPECT_LE(policy_.estimate(active), policy_.estimate(ChoicePolicy::refit))
          << "it stays with what costs more than a refit";
    }
  }

  double cost(std::size_t active) {
    const bool tries = policy_.state() == ChoiceState::tries;
    switch (adversary_) {
      case Adversary::random:
        return 100 * any(3);
      case Adversary::turncoat:
        return active == 0 ? 100 : tries ? 1 : 1e4;
      case Adversary::usurer:
      case Adversary::tempter:
        if (tries) return std::min(policy_.limit(), 1e9);
        return active == 0 ? 100 * any(adversary_ == Adversary::tempter ? 2 : 0.2) : 50;
      case Adversary::glutton:
        return tries ? 1e3 + 2 * std::min(policy_.limit(), 1e9) : 100 * any(1);
      case Adversary::swindler:
        return active == 0 ? (random_.below(3) == 0 ? 1e4 : 1) : 100 * any(1);
    }
    return 1;
  }

  void answer(std::size_t active) {
    const double contacts = adversary_ == Adversary::swindler ? double(random_.below(2) * 5000) : 50 * any(1);
    double work = cost(active);
    if (stops_ == Stops::yes && work > policy_.limit()) {
      work = std::max(0.0, policy_.limit());
      accounts_.work += work;
      accounts_.trial += work;
      const std::size_t other = policy_.stopped(work);
      ++result_.stops;
      const bool tried = accounts_.tries;
      if (tried) {
        accounts_.end_trial(active);
        EXPECT_LE(accounts_.excess(), 1e-12);
      }
      EXPECT_TRUE(other != active || active == ChoicePolicy::refit) << "it goes on with what it stopped";
      work = 100 * any(1);
    }
    accounts_.work += work;
    accounts_.trial += work;
    ++accounts_.answered;
    policy_.worked(work, contacts);
  }

  void check(int frame) {
    result_.worst = std::max(result_.worst, accounts_.excess());
    EXPECT_NEAR(policy_.all_work(), accounts_.work, 1e-9 * accounts_.work) << "frame " << frame;
    // The policy books a trial when it ends, the accounts when the next unit begins: the sums agree.
    EXPECT_NEAR(policy_.charges(), accounts_.charges + accounts_.charge(), 1e-9 * accounts_.work + 1e-9)
        << "frame " << frame;
  }

  Adversary adversary_;
  Stops stops_;
  Random random_;
  ChoicePolicy policy_;
  std::vector<Offer> offers_;
  Accounts accounts_;
  Result result_;
  int segment_ = 1, left_in_segment_ = 0;
};

Result play(Adversary adversary, std::uint64_t seed, const ChoicePolicy::Settings& settings = {},
            Stops stops = Stops::yes, int frames = 3000) {
  return Game(adversary, seed, settings, stops).play(frames);
}

TEST(ChoicePolicy, TrialsKeepToTheBudgetAtEveryStep) {
  for (const Adversary adversary : adversaries) {
    int trials = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(testing::Message() << "adversary " << int(adversary) << ", seed " << seed);
      const Result result = play(adversary, seed);
      EXPECT_LE(result.worst, 1e-12);
      trials += result.trials;
      if (HasFailure()) return;
    }
    EXPECT_GT(trials, 20) << "adversary " << int(adversary) << " is not worth the name";
  }
}

// Seeded faults: the check above notices a larger budget, and candidates that do not stop.
TEST(ChoicePolicy, ABrokenBudgetIsNoticed) {
  double worst = -1;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    worst = std::max(worst, play(Adversary::tempter, seed, {.budget = 0.1}).worst);
  EXPECT_GT(worst, 1e-3);
  worst = -1;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    worst = std::max(worst, play(Adversary::glutton, seed, {}, Stops::no).worst);
  EXPECT_GT(worst, 1e-6);
}

TEST(ChoicePolicy, IsDeterministic) {
  for (const Adversary adversary : adversaries)
    EXPECT_EQ(play(adversary, 7).answers, play(adversary, 7).answers);
}

/// A policy with a refit, a candidate that answers frames, and one that answers segments.
struct Steady {
  explicit Steady(int frames) : l(frames), offers(3) {
    for (Offer& offer : offers) offer = {.expected = 100, .hoped = 50};
    policy.start_over();
    policy.worked(100, 50);
  }
  /// Plays frames of given costs; a segment's first frame costs `search` more.
  void play(int frames, double refit, double other, double join, double search, double contacts = 50) {
    for (int f = 0; f < frames; ++f, ++frame) {
      const int left = l - frame % l;
      offers[2].whole = l;
      offers[2].frames = policy.active() == 2 || left >= l - 1 ? left : 0;
      const std::size_t active = policy.next(offers);
      double work = active == 0 ? refit : active == 1 ? other : join + (policy.begins() ? search : 0);
      if (work > policy.limit()) {
        policy.stopped(policy.limit());
        ++stops;
        work = policy.active() == 0 ? refit : policy.active() == 1 ? other : join + search;
      }
      policy.worked(work, contacts);
      ++answered[policy.active()];
    }
  }
  int l, frame = 0, stops = 0;
  std::vector<Offer> offers;
  ChoicePolicy policy{3, {}};
  int answered[3] = {};
};

TEST(ChoicePolicy, FindsTheBestOfSteadyCandidates) {
  for (const int best : {0, 1, 2}) {
    Steady steady(10);
    steady.play(1000, best == 0 ? 100 : 200, best == 1 ? 100 : 250, best == 2 ? 50 : 250,
                best == 2 ? 500 : 1000);
    EXPECT_GT(steady.answered[best], 900) << best;
    EXPECT_LE(steady.policy.charges(), share * steady.policy.all_work() + 10 * 200 + 250);
  }
}

TEST(ChoicePolicy, FollowsCostsThatDrift) {
  Steady steady(10);
  steady.play(500, 100, 300, 10, 200);
  EXPECT_EQ(steady.policy.incumbent(), 2u);
  steady.play(500, 100, 300, 500, 5000);
  EXPECT_EQ(steady.policy.incumbent(), 0u) << "a join that has become expensive is left";
  EXPECT_LT(steady.answered[2], 600);
  steady.play(2000, 100, 20, 500, 5000, 400);
  EXPECT_EQ(steady.policy.incumbent(), 1u);
}

// The limit of a trial is on its charge: each frame that it answers saves the work of staying.
TEST(ChoicePolicy, ATrialWithAnExpensiveFirstFrameMayFinish) {
  ChoicePolicy policy(2, {});
  policy.start_over();
  policy.worked(100, 50);
  std::vector<Offer> offers{{.expected = 100, .hoped = 50},
                            {.expected = 10, .hoped = 5, .frames = 10, .whole = 10}};
  for (int frame = 0; frame < 10; ++frame) {
    EXPECT_EQ(policy.next(offers), 1u) << "frame " << frame;
    const double work = frame == 0 ? 950 : 10;
    EXPECT_GE(policy.limit(), work);
    policy.worked(work, 50);
  }
  EXPECT_EQ(policy.charges(), 950 + 9 * 10 - 10 * 100);
}

TEST(ChoicePolicy, StopsAJoinAtTheRefitOfItsFrames) {
  Steady steady(10);
  steady.play(10, 100, 300, 10, 1e9);
  EXPECT_GE(steady.stops, 1);
  EXPECT_EQ(steady.answered[2], 0);
  EXPECT_LE(steady.policy.charges(), 10 * 100 + 300 + share * steady.policy.all_work());
  // It is not tried again before the budget allows it.
  steady.play(50, 100, 300, 10, 1e9);
  EXPECT_LE(steady.policy.charges() - steady.policy.allowances(), share * steady.policy.all_work());
}

// What a refit would take rises with contacts, and with it what the incumbent may take.
TEST(ChoicePolicy, AJoinIsNotStoppedBecauseContactsRiseWithinASegment) {
  Steady steady(20);
  steady.play(40, 100, 1e6, 30, 100);
  ASSERT_EQ(steady.policy.incumbent(), 2u);
  const int joined = steady.answered[2];
  double contacts = 50;
  for (int frame = 0; frame < 20; ++frame) {
    contacts *= 1.15;
    steady.play(1, 2 * contacts, 1e6, 1.5 * contacts, 100, contacts);
  }
  EXPECT_EQ(steady.answered[2] - joined, 20);
  steady.play(20, 2 * contacts, 1e6, 3 * contacts, 100, contacts);
  EXPECT_EQ(steady.policy.incumbent(), 0u) << "one that costs more is left all the same";
}

// A trial that was cheap says nothing once other observations have changed as much as contacts may.
TEST(ChoicePolicy, AnOldCountIsNotBelievedAfterTheTreesHaveAged) {
  for (const double aged : {0.0, 20.0}) {
    ChoicePolicy policy(2, {});
    policy.start_over();
    policy.worked(100, 50);
    std::vector<Offer> offers{{.expected = 100, .hoped = 50}, {.expected = 90, .hoped = 45}};
    ASSERT_EQ(policy.next(offers), 1u);
    policy.worked(105, 50);
    ASSERT_EQ(policy.incumbent(), 0u);
    policy.changed(aged);
    offers[1] = {.expected = 5000, .hoped = 4000};
    int trials = 0;
    for (int frame = 0; frame < 200; ++frame) {
      trials += policy.next(offers) == 1 ? 1 : 0;
      policy.worked(policy.active() == 0 ? 1000 : 900, 50);
    }
    EXPECT_EQ(trials > 0, aged == 0) << aged;
  }
}

// A join that was lost while its segments listed many pairs returns when the refit finds few.
TEST(ChoicePolicy, AJoinReturnsWhenItsPredictionFalls) {
  int frames_of_join[2];
  for (const bool follows : {false, true}) {
    Steady steady(10);
    steady.offers[2].follows_prediction = follows;
    steady.play(50, 100, 1e6, 10, 200);
    EXPECT_EQ(steady.policy.incumbent(), 2u);
    steady.play(100, 100, 1e6, 150, 500);
    EXPECT_EQ(steady.policy.incumbent(), 0u);
    const int before = steady.answered[2];
    steady.offers[2].expected = 20;
    steady.offers[2].hoped = 10;
    steady.play(100, 100, 1e6, 10, 200);
    frames_of_join[follows] = steady.answered[2] - before;
  }
  EXPECT_GT(frames_of_join[1], 80);
  EXPECT_LT(frames_of_join[0], 40) << "without it, the count of a dear segment keeps it away";
}

TEST(ChoicePolicy, GoesBackToARefitThatCostsLessWhateverTheBudget) {
  Steady steady(1);
  steady.play(50, 100, 50, 1e9, 1e9);
  ASSERT_EQ(steady.policy.incumbent(), 1u);
  steady.play(2, 100, 1000, 1e9, 1e9);
  EXPECT_EQ(steady.policy.incumbent(), 0u);
}

// Whatever was predicted of a join, and whatever it has cost so far, it is left at the end of a segment in
// which it cost more than a refit, and found again when it costs less.
TEST(ChoicePolicy, AJoinThatCostsMoreThanARefitIsLeftForAWhile) {
  for (const int l : {2, 10, 30, 100})
    for (const double times : {1.2, 3.0, 40.0, 1e5}) {
      SCOPED_TRACE(testing::Message() << l << " frames per segment, " << times << " times a refit");
      Steady steady(l);
      steady.play(10 * l, 100, 1e6, 10, 20 * l);
      ASSERT_EQ(steady.policy.incumbent(), 2u);
      steady.play(l + 1, 100, 1e6, 100 * times, 0);
      EXPECT_EQ(steady.policy.incumbent(), 0u);
      const int joined = steady.answered[2];
      steady.play(20 * l, 100, 1e6, 100 * times, 0);
      EXPECT_EQ(steady.policy.incumbent(), 0u);
      EXPECT_LE(steady.answered[2] - joined, 5 * l);
      steady.play(std::max(100 * l, 2000), 100, 1e6, 10, 20 * l);
      EXPECT_EQ(steady.policy.incumbent(), 2u);
    }
}

// Each trial in a row that a candidate loses doubles the frames until the next one.
TEST(ChoicePolicy, TriesALoserEverMoreSeldom) {
  Steady steady(1);
  steady.offers[1] = {.expected = 90, .hoped = 50};
  steady.offers[2] = {.expected = 1e9, .hoped = 1e9};
  int last = 0;
  std::vector<int> waits;
  for (int frame = 1; frame <= 4000; ++frame) {
    const int before = steady.answered[1] + steady.stops;
    steady.play(1, 100, 130, 1e9, 1e9);
    if (steady.answered[1] + steady.stops == before) continue;
    waits.push_back(frame - last);
    last = frame;
  }
  ASSERT_GE(waits.size(), 5u);
  EXPECT_LE(waits.size(), 12u);
  // The first trial is stopped, because nothing has been saved for it yet; its estimate is twice its limit.
  for (std::size_t i = 3; i < waits.size(); ++i) EXPECT_GT(waits[i], 1.5 * waits[i - 1]) << i;
}

// A change is paid by what the candidate may have saved.
TEST(ChoicePolicy, AnExpensiveChangeIsDelayed) {
  int first[2] = {};
  for (const bool expensive : {false, true}) {
    Steady steady(1);
    steady.offers[1] = {.expected = 60, .hoped = 60, .change = expensive ? 4000.0 : 0.0};
    steady.offers[2] = {.expected = 1e9, .hoped = 1e9};
    while (steady.answered[1] == 0 && steady.frame < 1000) {
      steady.play(1, 100, 60, 1e9, 1e9);
      ++first[expensive];
    }
  }
  EXPECT_LE(first[0], 2);
  EXPECT_GT(first[1], 4000 / 40 - 40);
  EXPECT_LT(first[1], 4000 / 40 + 5);
}

TEST(ChoicePolicy, EstimatesFollowContactsButForTheFixedPart) {
  ChoicePolicy policy(2, {});
  policy.start_over();
  policy.worked(100, 84);
  std::vector<Offer> offers(2);
  offers[0].fixed = 40;
  offers[1] = {.expected = 1, .hoped = 1, .fixed = 10};
  policy.next(offers);
  ASSERT_EQ(policy.active(), 1u);
  policy.worked(30, 84);
  policy.next(offers);
  policy.worked(50, 184);  // twice as many, with the 16 that stand for few
  EXPECT_DOUBLE_EQ(policy.estimate(0), 40 + 60 * 2);
  EXPECT_DOUBLE_EQ(policy.estimate(1), 50);
}

// The first frame of a unit searches for all of it.
TEST(ChoicePolicy, TheFramesOfAUnitShareItsSearch) {
  ChoicePolicy policy(2, {});
  policy.start_over();
  policy.worked(100, 50);
  std::vector<Offer> offers(2);
  offers[1] = {.expected = 60, .hoped = 60, .frames = 10, .whole = 10};
  for (int frame = 0; frame < 10; ++frame) {
    policy.next(offers);
    ASSERT_EQ(policy.active(), 1u);
    policy.worked(frame == 0 ? 510 : 10, 50);
  }
  for (const int frames : {10, 50, 5}) {
    offers[1].frames = offers[1].whole = frames;
    policy.next(offers);
    EXPECT_EQ(policy.active(), 1u);
    EXPECT_NEAR(policy.estimate(1), 10 + 500.0 / frames, 1e-9) << frames;
  }
}

TEST(ChoicePolicy, APredictionReplacesACountOfOtherContacts) {
  ChoicePolicy policy(2, {});
  policy.start_over();
  policy.worked(100, 0);
  std::vector<Offer> offers(2);
  offers[1] = {.expected = 150, .hoped = 60};
  policy.next(offers);
  ASSERT_EQ(policy.active(), 1u);
  policy.worked(104, 0);  // a trial that is lost
  for (int frame = 0; frame < 30; ++frame) {
    policy.next(offers);
    ASSERT_EQ(policy.active(), 0u) << frame;
    policy.worked(100, 0);
  }
  // Had its work grown like the contacts, it would take sixty times as much.
  offers[1] = {.expected = 700, .hoped = 400};
  int waited = 0;
  for (; waited < 100 && policy.next(offers) == 0; ++waited) policy.worked(1000, 984);
  EXPECT_LT(waited, 30);
}

}  // namespace
}  // namespace kbvh::test::choice_policy_test
