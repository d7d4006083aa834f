// From the raw times of repetitions to the numbers of the page, as experiments/study/raw_times.cpp.
import { DRAWS, FEWEST_OF_AN_INTERVAL, median, resamples } from "./statistics.js";

const PARTS = 4; // phases without the motion, which comes first

/** Returns the times of frames of each repetition, [repetition][frame]; older records know means only, which are one frame. */
function framesOf({ schema, repetitions, listed }, name) {
  if (schema === 2) return listed.map((one) => one[name]);
  return repetitions.map((times) => [name === "motions" ? times[0] : times.slice(1).reduce((a, b) => a + b, 0)]);
}

/** Returns the medians of parts over drawn repetitions, as shares of their sum. */
function shares(repetitions, draw) {
  const middle = Array.from({ length: PARTS }, (_, part) => median(draw.map((r) => repetitions[r][part + 1])));
  const whole = middle.reduce((a, b) => a + b, 0);
  return middle.map((one) => (whole > 0 ? one / whole : 0));
}

/** Returns, for each draw of repetitions, the mean over frames of each frame's median: by walking once through sorted values. */
function means(frames, draws) {
  const n = frames.length;
  const counts = draws.map((draw) => {
    const count = new Uint16Array(n);
    for (const r of draw) count[r] += 1;
    return count;
  });
  const sums = new Float64Array(draws.length);
  const length = frames[0].length;
  const [low, high] = [(n - 1) >> 1, n >> 1]; // the places of the middle, of which there are two if n is even
  const order = Array.from({ length: n }, (_, r) => r);
  for (let f = 0; f < length; f += 1) {
    order.sort((a, b) => frames[a][f] - frames[b][f]);
    for (let d = 0; d < draws.length; d += 1) {
      let seen = 0;
      let at = 0;
      while ((seen += counts[d][order[at]]) <= low) at += 1;
      const below = frames[order[at]][f];
      while (seen <= high) seen += counts[d][order[(at += 1)]];
      sums[d] += (below + frames[order[at]][f]) / 2;
    }
  }
  return Array.from(sums, (sum) => sum / length);
}

/** Returns the time of each phase, by frames. */
export function middles(raw) {
  const every = [raw.repetitions.map((_, r) => r)];
  const [motion] = means(framesOf(raw, "motions"), every);
  const [total] = means(framesOf(raw, "totals"), every);
  return [motion, ...shares(raw.repetitions, every[0]).map((share) => total * share)];
}

/** Returns a function that makes the resampled sums of motion, update and query when they are first asked for. */
export function lazyDraws(raw) {
  return () => {
    const n = raw.repetitions.length;
    if (n < FEWEST_OF_AN_INTERVAL) return [];
    const draws = resamples(n).slice(0, DRAWS);
    const motion = means(framesOf(raw, "motions"), draws);
    const total = means(framesOf(raw, "totals"), draws);
    const parts = draws.map((draw) => shares(raw.repetitions, draw));
    const five = (list) => list.map((value) => Number(value.toPrecision(5)));
    return [
      five(motion),
      five(total.map((value, d) => value * (parts[d][0] + parts[d][3]))),
      five(total.map((value, d) => value * (parts[d][1] + parts[d][2]))),
    ];
  };
}
