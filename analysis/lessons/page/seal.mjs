// Answers in a page are sealed, so that its source does not tell them to a reader by accident. This is no secret: the page has all that it
// takes to open them.

/// Bytes that depend on a key.
function* mask(key) {
  let state = 2166136261;
  for (const letter of key) state = Math.imul(state ^ letter.codePointAt(0), 16777619);
  for (;;) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    yield state >>> 24;
  }
}

const masked = (bytes, key) => {
  const more = mask(key);
  return Uint8Array.from(bytes, (byte) => byte ^ more.next().value);
};

/// Returns a value of JSON as a text in base64, masked by a key.
export const seal = (value, key) => btoa(String.fromCharCode(...masked(new TextEncoder().encode(JSON.stringify(value)), key)));

/// Returns the value that was sealed with this key.
export const unseal = (text, key) => JSON.parse(new TextDecoder().decode(masked(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)), key)));
