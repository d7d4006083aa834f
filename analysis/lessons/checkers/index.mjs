// All checkers by name.
import * as lesson1 from "./lesson1.mjs";
import * as lesson2 from "./lesson2.mjs";
import * as lesson3 from "./lesson3.mjs";
import * as lesson4 from "./lesson4.mjs";
import * as lesson5 from "./lesson5.mjs";
import * as lesson6 from "./lesson6.mjs";
import * as lesson7 from "./lesson7.mjs";
import * as lesson8 from "./lesson8.mjs";
import * as lesson9 from "./lesson9.mjs";

const kebab = (name) => name.replace(/([a-z])([A-Z0-9])/g, "$1-$2").toLowerCase();

export const checkers = Object.fromEntries(
  [lesson1, lesson2, lesson3, lesson4, lesson5, lesson6, lesson7, lesson8, lesson9].flatMap((lesson) =>
    Object.entries(lesson).map(([name, checker]) => [kebab(name), checker])));
