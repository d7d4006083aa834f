/**
 * The upper (or lower) envelope of polylines, for drawing: which line leads from when to when. The engine's events are the
 * truth; this is the picture of what they must add up to.
 */

/**
 * @param lines   array of {id, times, values}
 * @param upper   true: the largest value leads; false: the smallest
 * @returns pieces [{id, begin, end}] in order of time, between `begin` and `end`
 */
export function envelope(lines, upper, begin, end) {
  if (!lines.length) return [];
  const sign = upper ? 1 : -1;
  const knots = new Set([begin, end]);
  for (const line of lines) for (const t of line.times) if (t > begin && t < end) knots.add(t);
  const times = [...knots].sort((a, b) => a - b);
  const pieces = [];
  let leader = null;
  for (let k = 0; k + 1 < times.length; ++k) {
    const t0 = times[k], t1 = times[k + 1];
    const cut = lines.map((line) => segment(line, t0, t1, sign));
    let now = t0;
    leader = first(cut, leader);
    for (;;) {
      const next = overtaker(cut, leader, now, t0, t1);
      const until = next ? next.time : t1;
      push(pieces, lines[leader].id, now, until);
      if (!next) break;
      leader = next.index;
      now = until;
    }
  }
  return pieces;
}

/** Values of a line at the two ends of a segment in which it is straight. */
function segment(line, t0, t1, sign) {
  return {a: sign * at(line, t0), b: sign * at(line, t1)};
}

function at({times, values}, t) {
  const last = times.length - 1;
  if (t <= times[0]) return values[0];
  if (t >= times[last]) return values[last];
  let low = 0, high = last;
  while (high - low > 1) { const mid = (low + high) >> 1; if (times[mid] <= t) low = mid; else high = mid; }
  if (times[low] === t) return values[low];
  return values[low] + ((t - times[low]) / (times[high] - times[low])) * (values[high] - values[low]);
}

/** The leader at a segment's begin: the previous one unless another is strictly ahead. */
function first(cut, previous) {
  let best = previous ?? 0;
  for (let i = 0; i < cut.length; ++i) if (cut[i].a > cut[best].a) best = i;
  return best;
}

/** The earliest line that is strictly ahead at the segment's end and crosses the leader after `now`. */
function overtaker(cut, leader, now, t0, t1) {
  let found = null;
  const l = cut[leader];
  for (let i = 0; i < cut.length; ++i) {
    if (i === leader || !(cut[i].b > l.b)) continue;
    const behind = l.a - cut[i].a, ahead = cut[i].b - l.b;
    const time = Math.max(now, t0 + (t1 - t0) * (behind / (behind + ahead)));
    if (!found || time < found.time || (time === found.time && cut[i].b > cut[found.index].b)) found = {index: i, time};
  }
  return found;
}

function push(pieces, id, begin, end) {
  const last = pieces[pieces.length - 1];
  if (last && last.id === id) last.end = end;
  else if (end > begin || !pieces.length) pieces.push({id, begin, end});
}
