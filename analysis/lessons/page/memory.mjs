// What a browser remembers of a student's work, where storage is allowed.

const prefix = (page) => `kbvh-lessons ${page} `;
const here = () => location.pathname.split("/").pop() || "index.html";

/// Returns what was remembered under a name on this page, or null.
export function recall(name) {
  try {
    return localStorage.getItem(prefix(here()) + name);
  } catch {
    return null;
  }
}

/// Remembers a text under a name on this page.
export function remember(name, value) {
  try {
    localStorage.setItem(prefix(here()) + name, value);
  } catch {
    // A page from a file may have no storage: answers last until it is closed.
  }
}

/// Returns how many questions and exercises of a page are solved.
export function solvedOn(page) {
  try {
    return Object.keys(localStorage).filter((key) => key.startsWith(prefix(page) + "answer ") || key.startsWith(prefix(page) + "exercise ")).length;
  } catch {
    return 0;
  }
}
