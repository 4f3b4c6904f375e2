// Times of pictures in the page, for docs/web.md: `node tests/web/measure.mjs [--plain] [WIDTHxHEIGHT ...]`, after
// scripts/web.sh. `--plain` measures the last case alone: the work of renderers with one layer.
//
// The 39,460 particles of sims/cascade.toml, with and without its solids, seen from 11 places of which the first is not
// counted. A time is from the page's request until the picture is in its memory; `passes` are the device's alone. Medians.

import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { loadavg, tmpdir } from "node:os";
import { join } from "node:path";
import { call, launch, open, root, serve, shows } from "./site.mjs";

const given = process.argv.slice(2);
const isPlain = given.includes("--plain");
const named = given.filter((argument) => argument !== "--plain");
const sizes = named.length > 0 ? named : ["320x240", "640x480"];
const fewer = ["layers.intervals=1", "refract.interfaces=2"];
const cases = [
  ["defaults", "cascade.toml", []],
  ["one interval, two interfaces", "cascade.toml", fewer],
  ["without solids", "bare.toml", []],
  ["without solids, one interval, two interfaces", "bare.toml", fewer],
];

const work = await mkdtemp(join(tmpdir(), "limpid-measure-"));
const scene = await readFile(join(root, "sims/cascade.toml"), "utf8");
await writeFile(join(work, "cascade.toml"), scene);
const tables = scene.split(/^(?=\[)/m).filter((table) => !table.startsWith("[[solid]]"));
await writeFile(join(work, "bare.toml"), tables.join(""));

const site = await serve({ sims: work });
const browser = await launch();
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];
for (const size of sizes) {
  const [width, height] = size.split("x").map(Number);
  for (const [name, file, set] of isPlain ? cases.slice(-1) : cases) {
    const query = new URLSearchParams([["scene", `/sims/${file}`], ["refine", "0"], ["set", "refract.samples=1"]]);
    for (const value of set) query.append("set", value);
    // A view without toolbar and timeline has the size of the window but for the timeline.
    const page = await open(browser, `${site.url}?${query}`, { viewport: { width, height: height + 73 } });
    let status = await shows(page, (status) => status.atRest && status.shown);
    const eye = status.eye;
    const times = [];
    for (let i = 0; i <= 10; i++) {
      const { pictures } = status;
      const at = [eye[0] + 0.02 * (i + 1), eye[1], eye[2]];
      await call(page, "camera", `eye=${at} target=0,0.3,0 fov_y=40`);
      status = await shows(page, (status) => status.atRest && status.pictures > pictures);
      const passes = status.passes.reduce((sum, [, ms]) => sum + ms, 0);
      if (i > 0) times.push({ ms: status.shown.ms, passes, ...Object.fromEntries(status.passes) });
    }
    const shown = status.shown.size.join("x");
    const of = (time) => Math.round(median(times.map((row) => row[time])));
    const each = Object.fromEntries(status.passes.map(([name]) => [name, of(name)]));
    const row = { name, shown, particles: status.particles, ms: of("ms"), passes: of("passes"), each };
    console.log(JSON.stringify({ ...row, longest: await page.evaluate("window.longest"), load: loadavg()[0] }));
    await page.context().close();
  }
}
await browser.close();
site.close();
await rm(work, { recursive: true });
