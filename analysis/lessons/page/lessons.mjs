// The script of the course's pages.
import { checkers } from "../checkers/index.mjs";
import { all, api, mounted, open, setUpExercises } from "./exercises.mjs";
import { solvedOn } from "./memory.mjs";
import { setUpQuestions } from "./questions.mjs";
import { markScrolling } from "./scrolling.mjs";
import { unseal } from "./seal.mjs";

setUpQuestions();
setUpExercises();
markScrolling();

// The course's first page tells how far a student has come.
for (const row of document.querySelectorAll("[data-lesson]")) {
  const done = solvedOn(row.dataset.lesson);
  if (done > 0) row.querySelector(".progress").textContent = `${done} of ${row.dataset.tasks} solved`;
}

// For tests: the same functions that the buttons use.
globalThis.kbvhLessons = { checkers, states: all, mounted, open, api, unseal };
