// Ratios, intervals and profiles. experiments/study/raw_times.cpp and analysis/ratios/profiles.py define them; a test compares both.

/** The phases of each measure that has repetitions. */
export const SCOPES = {
  with_motion: ["motion", "update", "traversal", "triangle_tests", "plan_changes"],
  without_motion: ["update", "traversal", "triangle_tests", "plan_changes"],
  update: ["update", "plan_changes"],
  query: ["traversal", "triangle_tests"],
};

export function median(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

export function geometricMean(values) {
  return Math.exp(values.reduce((sum, value) => sum + Math.log(value), 0) / values.length);
}

/** Returns the value below which a share of the sorted values lies. */
export function quantile(sorted, share) {
  const at = share * (sorted.length - 1);
  const below = Math.floor(at);
  return sorted[below] + (at - below) * ((sorted[below + 1] ?? sorted[below]) - sorted[below]);
}

/** Fewer repetitions have a range and no interval. */
export const FEWEST_OF_AN_INTERVAL = 5;
export const DRAWS = 200;
const LEFT_OUT = DRAWS / 40;
const drawn = new Map();

/** Above this the times of a contestant are disturbed: the work of its repetitions is the same. */
export const MOST_VARIATION = 1.25;

/** Returns why times are disturbed, or "": the recorded reasons, and repetitions that differ (experiments/study/raw_times.hpp). */
export function doubts(repetitions, recorded) {
  const n = repetitions.length;
  if (n < FEWEST_OF_AN_INTERVAL) return recorded;
  const total = (one) => [...(one.totals ?? []), ...(one.motions ?? [])].reduce((sum, value) => sum + value, 0);
  const clips = repetitions.map((one) => (one.totals ? total(one) : PARTS_OF_A_CLIP.reduce((sum, part) => sum + (one[part] ?? 0), 0)));
  clips.sort((a, b) => a - b);
  const [lower, upper] = [clips[n >> 2], clips[n - 1 - (n >> 2)]];
  if (!(lower > 0 && upper / lower > MOST_VARIATION)) return recorded;
  return [recorded, `its repetitions differ by a factor of ${(upper / lower).toFixed(2)}`].filter(Boolean).join(", ");
}
const PARTS_OF_A_CLIP = [...SCOPES.with_motion, "geometry_changes"];

/** Returns the resampled rounds, the same as in experiments/study/raw_times.cpp (Steele, Lea and Flood 2014). */
export function resamples(repetitions) {
  if (drawn.has(repetitions)) return drawn.get(repetitions);
  const mask = (1n << 64n) - 1n;
  let state = 1n;
  const found = Array.from({ length: DRAWS }, () =>
    Array.from({ length: repetitions }, () => {
      let x = (state = (state + 0x9e3779b97f4a7c15n) & mask);
      x = ((x ^ (x >> 30n)) * 0xbf58476d1ce4e5b9n) & mask;
      x = ((x ^ (x >> 27n)) * 0x94d049bb133111ebn) & mask;
      return Number((((x ^ (x >> 31n)) >> 32n) * BigInt(repetitions)) >> 32n);
    }),
  );
  drawn.set(repetitions, found);
  return found;
}

/** Returns the time of a scope by clips, over drawn repetitions: medians of sums, of which phases are scaled to the total. */
function byClips(run, place, scope, draw) {
  const at = (r, phase) => run.times[r][place[phase]];
  const parts = SCOPES.without_motion;
  const total = median(draw.map((r) => parts.reduce((sum, phase) => sum + at(r, phase), 0)));
  const motion = SCOPES[scope].includes("motion") ? median(draw.map((r) => at(r, "motion"))) : 0;
  const inner = SCOPES[scope].filter((phase) => phase !== "motion");
  if (inner.length === parts.length) return total + motion;
  const middle = parts.map((phase) => median(draw.map((r) => at(r, phase))));
  const whole = middle.reduce((a, b) => a + b, 0);
  const part = inner.reduce((sum, phase) => sum + middle[parts.indexOf(phase)], 0);
  return motion + (whole > 0 ? (total * part) / whole : 0);
}

const every = (run) => run.times.map((_, r) => r);

/** Returns the time of a run over a scope in ms per frame; `place` numbers the phases. */
export function timeOf(run, place, scope, clips = run.clips) {
  if (clips) return byClips(run, place, scope, every(run));
  return SCOPES[scope].reduce((sum, phase) => sum + run.middle[place[phase]], 0);
}

/** Returns the middle of `ratio`, without its ends. */
export function quotient(own, other, place, scope) {
  const clips = own.clips || other.clips;
  return timeOf(other, place, scope, clips) / timeOf(own, place, scope, clips);
}

/** Returns that time over resampled rounds. */
function replicates(run, place, scope, clips) {
  if (clips || !run.draws.length) return resamples(run.times.length).map((draw) => byClips(run, place, scope, draw));
  const [motion, update, query] = run.draws;
  const of = {
    with_motion: (i) => motion[i] + update[i] + query[i],
    without_motion: (i) => update[i] + query[i],
    update: (i) => update[i],
    query: (i) => query[i],
  }[scope];
  return motion.map((_, i) => of(i));
}

/**
 * Returns the time of a run in ms per frame with its ends, as `ratio` has them: of the 95 % interval or, with fewer than five repetitions, of
 * their range.
 */
export function span(run, place, scope) {
  const middle = timeOf(run, place, scope);
  const isInterval = run.times.length >= FEWEST_OF_AN_INTERVAL;
  const times = (isInterval ? [...replicates(run, place, scope, run.clips)] : every(run).map((r) => byClips(run, place, scope, [r]))).sort((a, b) => a - b);
  const [low, high] = isInterval ? [times[LEFT_OUT], times[DRAWS - 1 - LEFT_OUT]] : [times[0], times.at(-1)];
  return { middle, low: Math.min(low, middle), high: Math.max(high, middle), isInterval };
}

/**
 * Returns how many times faster a run is than another: the middle, and the ends of the 95 % interval (a bootstrap over whole
 * rounds) or, with fewer than five repetitions, of their range; null without times. If one counts by clips, both do. Paired
 * repetitions ran next to each other.
 */
export function ratio(own, other, place, scope) {
  if (!own.times.length || !other.times.length) return null;
  const clips = own.clips || other.clips;
  const [bottom, top] = [own, other].map((run) => timeOf(run, place, scope, clips));
  if (!(bottom > 0 && top > 0)) return null;
  const [n, m] = [own.times.length, other.times.length];
  const paired = n === m && own.session === other.session;
  const middle = top / bottom;
  const disturbed = Boolean(own.disturbed || other.disturbed);
  const found = (low, high, isInterval) => ({
    middle,
    low: Math.min(low, middle),
    high: Math.max(high, middle),
    paired,
    isInterval,
    disturbed,
  });
  if (Math.min(n, m) >= FEWEST_OF_AN_INTERVAL) {
    const above = replicates(other, place, scope, clips);
    const below = replicates(own, place, scope, clips);
    if (!paired) above.reverse();
    const ends = above.map((value, i) => value / below[i]).sort((a, b) => a - b);
    return found(ends[LEFT_OUT], ends[DRAWS - 1 - LEFT_OUT], true);
  }
  if (Math.min(n, m) < 2) return found(middle, middle, false);
  const each = [own, other].map((run) => every(run).map((r) => byClips(run, place, scope, [r])));
  const quotients = paired ? each[1].map((value, i) => value / each[0][i]) : each[1].flatMap((v) => each[0].map((w) => v / w));
  return found(Math.min(...quotients), Math.max(...quotients), false);
}

/**
 * Returns the profiles of series over cells: for each series the ascending factors by which it is slower than the best of
 * each cell, and `at`, the places of these cells in the list. `cells` is a list of maps from series to value. Cells with fewer
 * than two series are left out.
 */
export function profiles(cells, which) {
  let counted = cells.map((cell, at) => [cell, at]).filter(([cell]) => cell.size >= 2);
  const names = [...new Set(counted.flatMap(([cell]) => [...cell.keys()]))];
  if (which === "common") counted = counted.filter(([cell]) => cell.size === names.length);
  const pairs = new Map(names.map((name) => [name, []]));
  for (const [cell, at] of counted) {
    const best = Math.min(...cell.values());
    for (const [name, value] of cell) pairs.get(name).push([value / best, at]);
  }
  const found = [];
  for (const [name, own] of pairs) {
    if (!own.length) continue;
    own.sort((a, b) => a[0] - b[0]);
    const factors = own.map(([factor]) => factor);
    const of = which === "all" ? counted.length : own.length;
    const score = factors.reduce((sum, factor) => sum + 1 / factor, 0) / of;
    found.push({ name, factors, at: own.map(([, at]) => at), of, cells: counted.length, score });
  }
  return found.sort((a, b) => b.score - a.score || (a.name < b.name ? -1 : 1));
}

/** Returns the share of a profile within a factor of the best. */
export function within(profile, factor) {
  return profile.factors.filter((one) => one <= factor).length / profile.of;
}
