// Every checker accepts its solution and refuses its start scene and two wrong scenes, by the native walker.
// Run by tests/lessons/run, with the walker in $KBVH_WALKER.
import assert from "node:assert/strict";
import { test } from "node:test";
import { checkers } from "../../analysis/lessons/checkers/index.mjs";
import { walk } from "../../analysis/lessons/trace.mjs";

const walker = process.env.KBVH_WALKER;
const api = { trace: async (request) => walk(walker, [request])[0] };
const lab = (state) => ({ getState: () => structuredClone(state) });

test("there are checkers", () => assert.ok(Object.keys(checkers).length >= 18));
for (const [name, { title, start, check, solution, wrong }] of Object.entries(checkers))
  test(`${name}: ${title}`, async () => {
    const accepted = await check(lab(solution()), api);
    assert.equal(accepted.ok, true, `the solution: ${accepted.message}`);
    const scenes = [start(), ...wrong()];
    assert.ok(scenes.length >= 3);
    const messages = new Set();
    for (const scene of scenes) {
      const refused = await check(lab(scene), api);
      assert.equal(refused.ok, false, `${scene.scene.name}: ${refused.message}`);
      assert.ok(refused.message.length > 10);
      messages.add(refused.message);
    }
    if (process.env.SHOW) console.log(name, "|", accepted.message, "|", [...messages].join(" || "));
  });
