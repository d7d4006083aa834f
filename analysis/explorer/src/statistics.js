// Ratios, intervals and profiles. analysis/ratios.py and analysis/profiles.py define them; a test compares both.

/** The phases of each measure that has repetitions. */
export const SCOPES = {
  with_motion: ["motion", "update", "traversal", "triangle_tests", "plan_changes"],
  without_motion: ["update", "traversal", "triangle_tests", "plan_changes"],
  update: ["update", "plan_changes"],
  query: ["traversal", "triangle_tests"],
};

const CONFIDENCE = 0.95;

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

/**
 * Returns how many times faster a run is than another, from their times by repetition: the middle, the extremes over
 * repetitions and the bootstrap's interval; null without times. Paired repetitions ran next to each other.
 */
export function ratio(own, other, sameSession) {
  if (!own.length || !other.length || Math.min(...own) <= 0) return null;
  const paired = sameSession && own.length === other.length;
  const within = interval(own, other, paired);
  if (paired) {
    const quotients = other.map((value, i) => value / own[i]);
    return { middle: median(quotients), low: Math.min(...quotients), high: Math.max(...quotients), paired, within };
  }
  return {
    middle: median(other) / median(own),
    low: Math.min(...other) / Math.max(...own),
    high: Math.max(...other) / Math.min(...own),
    paired,
    within,
  };
}

/** Returns the ends of the exact percentile bootstrap's 95 % interval; null for a single repetition. */
export function interval(own, other, paired) {
  if (own.length < 2 || other.length < 2) return null;
  if (paired) return percentiles(medians(other.map((value, i) => value / own[i])));
  const mine = medians(own);
  return percentiles(medians(other).flatMap(([m, p]) => mine.map(([n, q]) => [m / n, p * q])));
}

function choose(n, k) {
  let result = 1;
  for (let i = 1; i <= k; ++i) result = (result * (n - k + i)) / i;
  return result;
}

/** Returns the medians of all resamples, each with its probability. */
function medians(values) {
  const x = [...values].sort((a, b) => a - b);
  const n = x.length;
  const half = (n + 1) >> 1;
  const atLeast = (k, i) => {
    let sum = 0;
    for (let j = k; j <= n; ++j) sum += choose(n, j) * (i / n) ** j * (1 - i / n) ** (n - j);
    return sum;
  };
  const lower = x.map((_, i) => atLeast(half, i + 1) - atLeast(half, i));
  if (n % 2) return x.map((value, i) => [value, lower[i]]);
  const result = [];
  for (let i = 0; i < n; ++i) {
    let alone = lower[i];
    for (let j = i + 1; j < n; ++j) {
      const share =
        (((i + 1) / n) ** half - (i / n) ** half) *
        (((n - j) / n) ** half - ((n - j - 1) / n) ** half) *
        choose(n, half);
      alone -= share;
      result.push([(x[i] + x[j]) / 2, share]);
    }
    result.push([x[i], alone]);
  }
  return result;
}

function percentiles(weighted) {
  const outside = (1 - CONFIDENCE) / 2;
  weighted.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  let below = 0;
  let low = weighted[0][0];
  let high = weighted.at(-1)[0];
  for (const [value, share] of weighted) {
    if (below <= outside) low = value;
    below += share;
    if (below >= 1 - outside) {
      high = value;
      break;
    }
  }
  return [low, high];
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
