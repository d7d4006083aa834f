// The blocks of a lesson: what `::: name rest` becomes.
import { seal } from "../page/seal.mjs";
import { escape } from "./text.mjs";

const titled = (kind, title) => (rest, opening) =>
  opening ? `<section class="${kind}"><h3 class="kind">${title}${rest ? ": " + escape(rest) : ""}</h3>\n` : "</section>\n";

/// The words of a block's first line: `name key=value key=value`.
function words(rest) {
  const [first = "", ...others] = rest.match(/(?:[^\s"]+|"[^"]*")+/g) ?? [];
  return [first, Object.fromEntries(others.map((word) => {
    const at = word.indexOf("=");
    return [word.slice(0, at), word.slice(at + 1).replace(/^"|"$/g, "")];
  }))];
}

/// Makes the blocks. `figures` maps names to SVG texts, `states` to prepared states of the lab, `checkers` to the
/// modules of the exercises, `numbers` to the numbers of the course.
export function blocks({ figures, states, checkers, numbers }) {
  const lab = (name, label) => {
    if (!(name in states)) throw new Error(`no lab state '${name}' in states.mjs`);
    return `<div class="lab" data-lab="${name}"><p class="lab-bar"><button type="button" class="open-lab">${label}</button>
<a class="lab-link" href="../index.html" target="_blank" rel="noopener">In a tab of its own</a>
<button type="button" class="copy-embed" title="Copies the element that shows this lab in another page">Copy the code to embed it</button>
<span class="lab-note">${escape(states[name].note ?? "")}</span></p><div class="lab-place" hidden></div></div>\n`;
  };
  /// The buttons of the open exercise, once: before its solution, or at its end.
  const bars = (env) => {
    const html = env.bars ?? "";
    env.bars = "";
    return html;
  };
  return {
    goals: titled("goals", "After this lesson you can"),
    theorem: titled("theorem", "Theorem"),
    lemma: titled("theorem", "Lemma"),
    definition: titled("theorem", "Definition"),
    proof: (_, opening) => (opening ? '<section class="proof"><h3 class="kind">Proof</h3>\n' : '<p class="qed">∎</p></section>\n'),
    verdict: titled("verdict", "What the checks say"),
    task: titled("task", "In the lab"),
    programming: titled("programming", "Programming exercise"),
    warning: titled("warning", "Mind"),
    solution: (_, opening, env) => (opening ? bars(env) + '<details class="solution"><summary>Solution</summary>\n' : "</details>\n"),
    teacher: (_, opening, env, tokens, i) => (opening ? "<!--teacher-->" : "<!--/teacher-->"),
    predict: (rest, opening, env) => {
      if (!opening) return '<p class="commit"><button type="button">Commit to this answer</button> <output></output></p><p class="rest">The rest of this section appears when you have committed.</p></form>\n';
      env.predictions.push(rest);
      return `<form class="predict" data-predict="${rest}"><h3 class="kind">Predict before you read on</h3>\n`;
    },
    result: (rest, opening, env) => {
      if (opening && !env.predictions.includes(rest)) throw new Error(`result '${rest}' comes before its prediction`);
      return opening ? `<section class="result" data-result="${rest}">\n` : "</section>\n";
    },
    figure: (rest, opening, env) => {
      if (!opening) return "</figcaption></figure>\n";
      const [name] = words(rest);
      if (!(name in figures)) throw new Error(`no figure '${name}'`);
      env.figures.push(name);
      return `<figure id="figure-${name}"><div class="scroll" tabindex="0" role="group" aria-label="picture ${name}">${figures[name]}</div><figcaption>\n`;
    },
    lab: (rest, opening) => (opening ? lab(words(rest)[0], "Open the lab here") + '<div class="under-lab">' : "</div>\n"),
    exercise: (rest, opening, env) => {
      if (!opening) return bars(env) + "</section>\n";
      const [name] = words(rest);
      if (!(name in checkers)) throw new Error(`no checker '${name}' in checkers/`);
      env.exercises.push(name);
      env.bars = `${lab("exercise-" + name, "Open the lab with the start scene")}<p class="check-bar"><button type="button" class="check-scene">Check my scene</button> <button type="button" class="show-solution">Load a solution into the lab</button> <output class="verdict-line"></output></p>\n`;
      return `<section class="exercise" data-exercise="${name}"><h3 class="kind">Exercise: ${escape(checkers[name].title)}</h3>\n`;
    },
    answer: (rest, opening, env) => {
      if (!opening) return '<p class="answer-bar"><label>Your number: <input type="text" inputmode="decimal" size="10" autocomplete="off"></label> <button type="submit">Check</button> <output></output></p></form>\n';
      const [key, options] = words(rest);
      if (!(key in numbers)) throw new Error(`no number '${key}' for an answer`);
      env.answers.push(key);
      return `<form class="answer" data-answer="${key}" data-tolerance="${options.tolerance ?? 0}">
<h3 class="kind">Question</h3>\n`;
    },
  };
}

/// Turns the lists of tasks in a prediction into radio buttons: `- [x]` marks the right answer.
export function options(html) {
  let question = 0;
  return html.replace(/<form class="predict"[\s\S]*?<\/form>/g, (form) => {
    const id = ++question;
    const name = /data-predict="([^"]*)"/.exec(form)[1], marks = [];
    const shown = form.replace(/<li>(?:<p>)?\s*\[( |x)\] ([\s\S]*?)(?:<\/p>\s*)?<\/li>/g, (_, mark, text) => {
      marks.push(mark);
      return `<li><label><input type="radio" name="predict-${id}"> <span>${text}</span></label></li>`;
    }).replace("<ul>", '<ul class="options">');
    if (marks.filter((mark) => mark === "x").length !== 1) throw new Error(`prediction '${name}': mark one answer as [x]`);
    return shown.replace("<form ", `<form data-sealed="${seal(marks.indexOf("x"), name)}" `);
  });
}

/// The value of an expression in numbers of the course: keys, digits, + - * / and parentheses.
function evaluate(expression, numbers) {
  const filled = expression.replace(/[a-z]\w*(?:\.\w+)+/gi, (key) => {
    if (!(key in numbers)) throw new Error(`no number '${key}' in the reasons of an answer`);
    return `(${numbers[key].value})`;
  });
  if (!/^[\d\s.+*/()e-]+$/.test(filled)) throw new Error(`the reasons of an answer: '${expression}' is no expression`);
  return Function(`return ${filled}`)();
}

/// Takes the list of reasons out of each question, and seals them with the answer: `- [expression] why this number is wrong`, `- [<] why a
/// smaller one is`, `- [>] why a larger one is`. The last two are required.
export function reasons(html, numbers) {
  return html.replace(/<form class="answer" data-answer="([^"]*)" data-tolerance="([^"]*)">([\s\S]*?)<\/form>/g, (_, key, tolerance, inside) => {
    const value = numbers[key].value, sealed = { value, tolerance: Number(tolerance), known: [] };
    const rest = inside.replace(/<ul>([\s\S]*?)<\/ul>/, (list, items) => {
      for (const [, mark, text] of items.matchAll(/<li>(?:<p>)?\s*\[([^\]]*)\] ([\s\S]*?)(?:<\/p>\s*)?<\/li>/g))
        if (mark === "&lt;") sealed.less = text;
        else if (mark === "&gt;") sealed.more = text;
        else sealed.known.push([evaluate(mark, numbers), text]);
      return "";
    });
    if (!sealed.less || !sealed.more) throw new Error(`the question '${key}' needs a reason for smaller [<] and for larger [>] numbers`);
    for (const [wrong, text] of sealed.known)
      if (Math.abs(wrong - value) <= sealed.tolerance) throw new Error(`the question '${key}' calls its answer wrong: ${text}`);
    return `<form class="answer" data-answer="${key}" data-sealed="${seal(sealed, key)}">${rest}</form>`;
  });
}
