// Colours and markers of contestants that the page was not made with, as analysis/figures/colours.py chooses them.

const channels = (colour) => [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));

function mix(colour, shade) {
  const towards = shade > 0 ? 255 : 0;
  const half = (value) => (value % 1 === 0.5 ? 2 * Math.round(value / 2) : Math.round(value)); // as Python rounds
  return `#${channels(colour).map((c) => half(c + (towards - c) * Math.abs(shade)).toString(16).padStart(2, "0")).join("").toUpperCase()}`;
}

function luminance(colour) {
  const [r, g, b] = channels(colour).map((c) => (c / 255 <= 0.03928 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

function onDark(colour, dark, contrast) {
  const ground = luminance(dark) + 0.05;
  for (let share = 0; share <= 20; share += 1) {
    const shade = mix(colour, share / 20);
    const own = luminance(shade) + 0.05;
    if (Math.max(own, ground) / Math.min(own, ground) >= contrast) return shade;
  }
  return "#FFFFFF";
}

/**
 * Returns contestants of which the first, the recommended one, is at least as bright on the dark page as each of the others: its colour there
 * is mixed with as much white (`--strong` of style.css, which the light page does not have) as that takes.
 */
export function leading(contestants) {
  const [first, ...others] = contestants;
  if (!first) return [];
  const wanted = Math.max(0, ...others.map((one) => luminance(one.look.dark)));
  let share = 0;
  while (share < 20 && luminance(mix(first.look.dark, share / 20)) < wanted) share += 1;
  if (!share) return contestants;
  const own = `var(--contestant-${first.index})`;
  return [{ ...first, paint: `color-mix(in srgb, ${own} ${100 - 5 * share}%, var(--strong, ${own}))` }, ...others];
}

/** Returns the looks of rows' contestants. Families that the palette does not know take its free ones in turn. */
export function looks(rows, palette) {
  const unique = [...new Map(rows.map((row) => [row.contestant, row])).values()];
  const unknown = [...new Set(unique.map((row) => row.family))].filter((family) => !(family in palette.families)).sort();
  const of = (family) => palette.families[family] ?? palette.free[unknown.indexOf(family) % palette.free.length];
  const members = new Map();
  const variants = new Map();
  const push = (map, key, value) => {
    if (!map.has(key)) map.set(key, []);
    if (!map.get(key).includes(value)) map.get(key).push(value);
  };
  for (const row of unique.toSorted((a, b) => (a.contestant < b.contestant ? -1 : 1))) {
    push(members, row.family, row.strategy.id);
    push(variants, row.strategy.id, row.contestant);
  }
  // A strategy takes the shade that fewest have so far. All that share one, up to ten, differ by dashes or by a filled marker.
  const shades = new Map();
  const steps = new Map();
  for (const ids of members.values()) {
    const sharing = palette.shades.map(() => 0);
    for (const id of ids) {
      const shade = sharing.indexOf(Math.min(...sharing));
      shades.set(id, palette.shades[shade]);
      for (const contestant of variants.get(id)) steps.set(contestant, shade + sharing[shade]++);
    }
  }
  return new Map(
    unique.map((row) => {
      const [colour, marker] = of(row.family);
      const step = steps.get(row.contestant);
      const shade = shades.get(row.strategy.id);
      return [
        row.contestant,
        {
          light: mix(colour, shade),
          dark: onDark(mix(onDark(colour, palette.dark, palette.family_contrast), -shade), palette.dark, palette.contrast),
          corners: palette.corners[marker] ?? [],
          dashes: palette.dashes[step % palette.dashes.length],
          filled: step % 2 === 0,
        },
      ];
    }),
  );
}
