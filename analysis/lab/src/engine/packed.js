// Operations on the engine's arrays.

/** The pairs of the sorted list `a` that are not in the sorted list `b`. */
export function difference(a, b) {
  const order = [0, 2, 1, 3]; // bodies first
  const compare = (i, j) => {
    for (const k of order) if (a[i + k] !== b[j + k]) return a[i + k] - b[j + k];
    return 0;
  };
  const out = [];
  let j = 0;
  for (let i = 0; i < a.length; i += 4) {
    while (j < b.length && compare(i, j) > 0) j += 4;
    if (j >= b.length || compare(i, j) !== 0) out.push(a[i], a[i + 1], a[i + 2], a[i + 3]);
  }
  return Uint32Array.from(out);
}

/** One log of several. */
export function merged(logs) {
  if (logs.length === 0) return null;
  const joined = (parts) => {
    const out = new parts[0].constructor(parts.reduce((sum, part) => sum + part.length, 0));
    let at = 0;
    for (const part of parts) {
      out.set(part, at);
      at += part.length;
    }
    return out;
  };
  const ends = (of) => {
    let before = 0;
    return joined(of.map((part) => {
      const moved = part.map((end) => end + before);
      before += part.length === 0 ? 0 : part[part.length - 1];
      return moved;
    }));
  };
  const events = (of) => ({ words: joined(of.map((part) => part.words)), numbers: joined(of.map((part) => part.numbers)) });
  return {
    events: events(logs.map((log) => log.events)),
    touchedEnds: ends(logs.map((log) => log.touchedEnds)),
    touched: joined(logs.map((log) => log.touched)),
    rescheduledEnds: ends(logs.map((log) => log.rescheduledEnds)),
    rescheduled: events(logs.map((log) => log.rescheduled)),
  };
}

/** FNV-1a over the bits of every number and the text of everything else, in two lanes of 32 bits. */
export function hashOf(value) {
  let a = 0x811c9dc5, b = 0xcbf29ce4;
  const mix = (word) => {
    a = Math.imul(a ^ word, 0x01000193);
    b = Math.imul(b ^ word ^ (a >>> 15), 0x85ebca6b);
  };
  const text = (string) => {
    for (let i = 0; i < string.length; ++i) mix(string.charCodeAt(i));
  };
  const visit = (part) => {
    if (ArrayBuffer.isView(part)) {
      const words = new Uint32Array(part.buffer, part.byteOffset, part.byteLength >> 2);
      mix(words.length);
      for (let i = 0; i < words.length; ++i) mix(words[i]);
    } else if (part !== null && typeof part === 'object') {
      for (const key of Object.keys(part).sort()) {
        text(key);
        visit(part[key]);
      }
    } else {
      text(`${typeof part}:${String(part)};`);
    }
  };
  visit(value);
  return (a >>> 0).toString(16).padStart(8, '0') + (b >>> 0).toString(16).padStart(8, '0');
}
