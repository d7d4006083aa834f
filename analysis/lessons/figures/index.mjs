// All pictures by name: (data, numbers) => SVG.
import * as first from "./lessons1to3.mjs";
import * as second from "./lessons4to6.mjs";
import * as third from "./lessons7to9.mjs";

const kebab = (name) => name.replace(/([a-z0-9])([A-Z])/g, "$1-$2").toLowerCase();

export const figures = Object.fromEntries([first, second, third].flatMap((pictures) =>
  Object.entries(pictures).map(([name, make]) => [kebab(name), make])));
