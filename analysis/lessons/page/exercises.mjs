// The lab in a lesson's page, which is loaded when it is first opened, and the exercises that it checks.
import { addressOf, embedCode, encodeState } from "../../lab/src/state/permalink.js";
import { checkers } from "../checkers/index.mjs";
import { exerciseStates, states } from "../states.mjs";
import { player } from "./api.mjs";
import { recall, remember } from "./memory.mjs";

export const all = { ...states, ...exerciseStates() };
export const mounted = new Map();
let loading = null;

/// Loads the lab's script and style once. Both are ordinary files next to the lessons, so that pages work from a folder.
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

const labPage = "../index.html";

/// Fills the link of a lab's bar, and its button that copies what embeds the prepared state into another page.
async function setUpSharing(place) {
  const { state } = all[place.dataset.lab], text = await encodeState(state), button = place.querySelector(".copy-embed");
  place.querySelector(".lab-link").href = addressOf(labPage, text);
  button.dataset.code = embedCode(addressOf(labPage, text, { embed: true }), state.scene.name);
  button.addEventListener("click", async () => {
    const note = place.querySelector(".lab-note");
    try {
      await navigator.clipboard.writeText(button.dataset.code);
      note.textContent = "The code that embeds this lab is in the clipboard.";
    } catch {
      note.textContent = "The clipboard is closed to this page: the button Link inside the lab shows the code.";
    }
  });
}

/// Mounts the lab into its place, or gives the mounted one the state.
export async function open(place, state) {
  const bar = place.querySelector(".open-lab"), note = place.querySelector(".lab-note"), target = place.querySelector(".lab-place");
  bar.disabled = true;
  note.textContent = "Loading the lab …";
  try {
    const { mountLab } = await loadLab();
    target.hidden = false;
    const before = mounted.get(place);
    if (before) await before.setState(structuredClone(state));
    else mounted.set(place, await mountLab(target, structuredClone(state), { compact: true, page: labPage }));
    bar.textContent = "Back to the prepared state";
    note.textContent = all[place.dataset.lab].note;
  } catch (error) {
    note.textContent = `The lab could not start: ${error.message}`;
  }
  bar.disabled = false;
  return mounted.get(place);
}

let play = null;
/// The api of checkers, over an engine of the lab.
export async function api() {
  const { createEngine } = await loadLab();
  play ??= player(createEngine);
  return { createEngine, trace: play };
}

/// The parts that two states of the same work have in common: precision, frames, and the bodies without their names.
export function essence({ scene, precision = "float64" }) {
  return JSON.stringify([precision, scene.frames?.l ?? 1, scene.bodies.map(({ shape = "polygons", vertices, indices, offsets, times, positions }) => {
    const primitives = offsets ? Array.from(offsets) : Array.from({ length: indices.length / 3 + 1 }, (_, i) => 3 * i);
    return [shape, vertices, Array.from(indices), primitives, Array.from(times), Array.from(positions, (row) => Array.from(row))];
  })]);
}

function setUpExercise(section) {
  const name = section.dataset.exercise, checker = checkers[name], place = section.querySelector(".lab");
  const output = section.querySelector(".verdict-line"), check = section.querySelector(".check-scene");
  const say = (text, css) => {
    output.textContent = text;
    output.className = `verdict-line ${css}`;
  };
  const solved = () => section.classList.add("solved");
  check.addEventListener("click", async () => {
    check.disabled = true;
    say("Playing your scene …", "");
    try {
      const lab = mounted.get(place) ?? (await open(place, all[place.dataset.lab].state));
      if (!lab?.getState().scene?.bodies.length) throw new Error("it has no body");
      const { ok, message } = await checker.check(lab, await api());
      const loaded = ok && recall("solution " + name) && essence(lab.getState()) === essence(checker.solution());
      if (ok && !loaded) {
        remember("exercise " + name, "solved");
        solved();
      }
      say(loaded ? `${message} This is the solution that you loaded, so it does not count as solved. Build a scene of your own.` : message,
        loaded ? "" : ok ? "right" : "wrong");
    } catch (error) {
      say(`The scene could not be checked: ${error.message}`, "wrong");
    }
    check.disabled = false;
  });
  section.querySelector(".show-solution").addEventListener("click", () => {
    remember("solution " + name, "loaded");
    say("A solution. Look at it before you check it: why does it work?", "");
    open(place, checker.solution());
  });
  if (recall("exercise " + name) === null) return;
  solved();
  say("You have solved this exercise.", "right");
}

export function setUpExercises() {
  for (const place of document.querySelectorAll(".lab")) {
    place.querySelector(".open-lab").addEventListener("click", () => open(place, all[place.dataset.lab].state));
    setUpSharing(place);
  }
  document.querySelectorAll(".exercise").forEach(setUpExercise);
}
