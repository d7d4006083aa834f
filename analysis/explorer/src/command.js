// The commands that measure a configuration again.

/** Quotes a word for a shell, if it needs it. */
function quoted(word) {
  const text = String(word);
  return /^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

/** Returns {text, why}: the command, or why there is none. */
export function command(run) {
  const { cell, contestant } = run;
  const lines = [
    `# kbvh at commit ${cell.commit.commit || "unknown"}${cell.commit.dirty ? ", with uncommitted changes" : ""}`,
  ];
  const { options, scene, why } = cell.again;
  // How many rounds were asked for; older records say only how many were played.
  const rounds = { repetitions: Math.max(run.repetitions, 1), ...run.rounds };
  if (why) return { text: "", why };
  if (options) {
    const words = ["kbvh", "run", options, "--strategies", quoted(contestant.id)];
    for (const [key, value] of Object.entries(contestant.params)) words.push("--param", quoted(`${key}=${value}`));
    const { builder } = contestant;
    if (builder) words.push("--builder", builder.method, "--width", builder.width, "--leaf-size", builder.leaf_size);
    words.push("--scalar", cell.scalar);
    if (!cell.continuous) words.push("--l", cell.l);
    for (const [key, value] of Object.entries(cell.asked)) words.push(`--${key.replaceAll("_", "-")}`, ...(value === true ? [] : [quoted(value)]));
    for (const [key, value] of Object.entries(rounds)) words.push(`--${key.replaceAll("_", "-")}`, value);
    words.push("--oracle-every", run.every ?? 1);
    if (run.limit) words.push("--frames-limit", run.limit);
    lines.push(`${words.join(" ")} --out again`);
  } else {
    const plan = {
      scenes: [scene],
      strategies: [
        { id: contestant.id, params: contestant.params, ...(contestant.builder && { builder: contestant.builder }) },
      ],
      scalars: [cell.scalar],
      l: [cell.l],
      ...rounds,
      oracle_every: run.every ?? 1,
      ...(run.limit && { frames_limit: run.limit }),
      ...cell.asked,
    };
    lines.push("cat > again.json <<'PLAN'", JSON.stringify(plan, null, 1), "PLAN");
    lines.push("kbvh run --plan again.json --out again");
  }
  return { text: lines.join("\n"), why: "" };
}
