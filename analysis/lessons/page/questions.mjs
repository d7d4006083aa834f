// Predictions, whose results stay hidden until an answer is committed, and questions with a number as the answer.
import { recall, remember } from "./memory.mjs";
import { unseal } from "./seal.mjs";

function setUpPrediction(form) {
  const name = form.dataset.predict, right = unseal(form.dataset.sealed, name), result = document.querySelector(`[data-result="${name}"]`);
  const inputs = [...form.querySelectorAll("input")], button = form.querySelector("button"), output = form.querySelector("output");
  // The result and the rest of its section wait for the answer.
  const held = [];
  for (let next = result; next && next.tagName !== "H2" && !next.matches(".predict"); next = next.nextElementSibling) held.push(next);
  for (const element of held) element.hidden = true;
  const commit = (choice) => {
    form.querySelector(".rest")?.remove();
    inputs.forEach((input, i) => {
      input.checked = i === choice;
      input.disabled = true;
    });
    inputs[right].closest("li").classList.add("right");
    button.disabled = true;
    output.textContent = choice === right ? "Your prediction agrees." : "Your prediction differs; read why.";
    form.classList.add(choice === right ? "agrees" : "differs");
    for (const element of held) element.hidden = false;
  };
  button.addEventListener("click", () => {
    const choice = inputs.findIndex((input) => input.checked);
    if (choice < 0) {
      output.textContent = "Choose an answer first. A guess is fine.";
      return;
    }
    remember(name, choice);
    commit(choice);
  });
  const kept = recall(name);
  if (kept !== null && inputs[Number(kept)]) commit(Number(kept));
}

/// Judges a number against an unsealed answer: [right?, HTML of what to say].
export function judge(given, { value, tolerance, known, less, more }) {
  const near = (wanted) => Math.abs(given - wanted) <= Math.max(tolerance, 1e-6 * Math.abs(wanted));
  if (near(value)) return [true, "Right."];
  return [false, known.find(([wrong]) => near(wrong))?.[1] ?? (given < value ? less : more)];
}

function setUpQuestion(form) {
  const key = form.dataset.answer, answer = unseal(form.dataset.sealed, key), input = form.querySelector("input"), output = form.querySelector("output");
  const say = (html, css) => {
    output.innerHTML = html;
    output.className = css;
  };
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const text = input.value.trim(), given = Number(text.replaceAll(",", "").replaceAll(" ", ""));
    if (text === "" || Number.isNaN(given)) return say("Enter a number.", "");
    const [right, html] = judge(given, answer);
    if (right) remember("answer " + key, text);
    say(html, right ? "right" : "wrong");
  });
  const kept = recall("answer " + key);
  if (kept === null) return;
  input.value = kept;
  say("Right.", "right");
}

export function setUpQuestions() {
  document.querySelectorAll(".predict").forEach(setUpPrediction);
  document.querySelectorAll(".answer").forEach(setUpQuestion);
}
