/** Times of whole clips. */

/** The clip whose total is the median of all totals (the lower one of two). Browsers round times to a tenth of a millisecond, so single frames have no median. */
export function medianClip(clips) {
  const total = (times) => times.reduce((sum, value) => sum + value, 0);
  return [...clips].sort((a, b) => total(a) - total(b))[(clips.length - 1) >> 1];
}
