// The script of a lesson's page: predictions, questions, and the lab, which is loaded when it is first opened.
import { checkers } from "../checkers/index.mjs";
import { exerciseStates, states } from "../states.mjs";
import { trace } from "./api.mjs";

const all = { ...states, ...exerciseStates() };

/// Remembers answers in this browser, where that is allowed.
const memory = {
  key: (name) => `kbvh-lessons ${location.pathname.split("/").pop()} ${name}`,
  get(name) {
    try {
      return localStorage.getItem(this.key(name));
    } catch {
      return null;
    }
  },
  set(name, value) {
    try {
      localStorage.setItem(this.key(name), value);
    } catch {
      // A page from a file may have no storage: answers last until it is closed.
    }
  },
};

// ---- Predictions: the result stays hidden until an answer is committed.

for (const form of document.querySelectorAll(".predict")) {
  const name = form.dataset.predict, result = document.querySelector(`[data-result="${name}"]`);
  const inputs = [...form.querySelectorAll("input")], button = form.querySelector("button"), output = form.querySelector("output");
  const commit = (choice) => {
    const right = "right" in inputs[choice].dataset;
    form.querySelector(".rest")?.remove();
    inputs.forEach((input, i) => {
      input.checked = i === choice;
      input.disabled = true;
      if ("right" in input.dataset) input.closest("li").classList.add("right");
    });
    button.disabled = true;
    output.textContent = right ? "Your prediction agrees." : "Your prediction differs; read why.";
    form.classList.add(right ? "agrees" : "differs");
    for (const element of held) element.hidden = false;
  };
  // The result and the rest of its section wait for the answer.
  const held = [];
  for (let next = result; next && next.tagName !== "H2" && !next.matches(".predict"); next = next.nextElementSibling) held.push(next);
  for (const element of held) element.hidden = true;
  button.addEventListener("click", () => {
    const choice = inputs.findIndex((input) => input.checked);
    if (choice < 0) {
      output.textContent = "Choose an answer first. A guess is fine.";
      return;
    }
    memory.set(name, choice);
    commit(choice);
  });
  const kept = memory.get(name);
  if (kept !== null && inputs[Number(kept)]) commit(Number(kept));
}

// ---- Questions with a number as the answer.

for (const form of document.querySelectorAll(".answer")) {
  const input = form.querySelector("input"), output = form.querySelector("output");
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const given = Number(input.value.trim().replaceAll(",", "").replaceAll(" ", "")), value = Number(form.dataset.value);
    const blank = input.value.trim() === "" || Number.isNaN(given);
    const right = !blank && Math.abs(given - value) <= Number(form.dataset.tolerance) + 1e-9;
    output.textContent = blank ? "Enter a number." : right ? "Right." : "Not this number. Try again.";
    output.className = blank ? "" : right ? "right" : "wrong";
  });
}

// ---- The lab.

let loading = null;

/// Loads the lab's script and style once. Both are ordinary files beside the lessons, so that pages work from a folder.
function loadLab() {
  loading ??= new Promise((resolve, reject) => {
    const style = document.createElement("link");
    style.rel = "stylesheet";
    style.href = "../lab.css";
    document.head.append(style);
    const script = document.createElement("script");
    script.src = "../lab.js";
    script.onload = () => resolve(globalThis.kbvhLab);
    script.onerror = () => {
      loading = null;
      reject(new Error("the file ../lab.js is missing: keep the folder of the lab together"));
    };
    document.head.append(script);
  });
  return loading;
}

const mounted = new Map();

/// Mounts the lab into its place, or gives the mounted one the state.
async function open(place, state) {
  const bar = place.querySelector(".open-lab"), note = place.querySelector(".lab-note"), target = place.querySelector(".lab-place");
  bar.disabled = true;
  note.textContent = "Loading the lab …";
  try {
    const { mountLab } = await loadLab();
    target.hidden = false;
    const before = mounted.get(place);
    if (before) await before.setState(structuredClone(state));
    else mounted.set(place, await mountLab(target, structuredClone(state), { compact: true }));
    bar.textContent = "Back to the prepared state";
    note.textContent = all[place.dataset.lab].note;
  } catch (error) {
    note.textContent = `The lab could not start: ${error.message}`;
  }
  bar.disabled = false;
  return mounted.get(place);
}

for (const place of document.querySelectorAll(".lab"))
  place.querySelector(".open-lab").addEventListener("click", () => open(place, all[place.dataset.lab].state));

/// The api of checkers, over engines of the lab.
async function api() {
  const { createEngine } = await loadLab();
  return { createEngine, trace: (request) => trace(createEngine, request) };
}

for (const section of document.querySelectorAll(".exercise")) {
  const checker = checkers[section.dataset.exercise], place = section.querySelector(".lab");
  const output = section.querySelector(".verdict-line"), check = section.querySelector(".check-scene");
  const say = (text, css) => {
    output.textContent = text;
    output.className = `verdict-line ${css}`;
  };
  check.addEventListener("click", async () => {
    check.disabled = true;
    say("Playing your scene …", "");
    try {
      const lab = mounted.get(place) ?? (await open(place, all[place.dataset.lab].state));
      if (!lab?.getState().scene?.bodies.length) throw new Error("it has no body");
      const { ok, message } = await checker.check(lab, await api());
      say(message, ok ? "right" : "wrong");
    } catch (error) {
      say(`The scene could not be checked: ${error.message}`, "wrong");
    }
    check.disabled = false;
  });
  section.querySelector(".show-solution").addEventListener("click", () => {
    say("A solution. Look at it before you check it: why does it work?", "");
    open(place, checker.solution());
  });
}

// For tests: the same functions that the buttons use.
globalThis.kbvhLessons = { checkers, states: all, mounted, open, api };
