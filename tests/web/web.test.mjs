// The page in Debian's Chromium, with WebGPU on the processor: `scripts/web-test.sh` builds what this needs.
//
// Protected: every way to open something, playing, settings, pointer and touch, addresses, recovery, messages, and that
// pictures are those of the program.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdir, mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { promisify } from "node:util";
import { call, held, launch, open, root, save, serve, shows } from "./site.mjs";

const run = promisify(execFile);
/** What scripts/web-test.sh --core leaves out. */
const rare = process.env.LIMPID_WEB_CORE ? test.skip : test;
/** The program. */
const limpid = process.env.LIMPID ?? join(root, "target/debug/limpid");
const dam = "double_dam_break/ParticleData_Fluid_";
/** A page with a single frame of 4732 particles, which does not play. */
const still = "?scene=/sims/demo.toml";

let browser, site, work;

before(async () => {
  work = await mkdtemp(join(tmpdir(), "limpid-web-"));
  site = await serve({ data: join(root, "tests/data"), sims: join(root, "sims"), made: work, signed: work });
  browser = await launch();
});

after(async () => {
  await browser?.close();
  site?.close();
});

/** Opens the page with parameters, runs `act`, and fails if the console has shown an error. Pictures at rest have one ray a
 * pixel, as others: they are waited for often. */
async function visit(query, act, options) {
  const parameters = query.startsWith("/") ? query : `?${[query.slice(1), "refine=0"].filter(Boolean).join("&")}`;
  const page = await open(browser, site.url + parameters, options);
  try {
    await act(page);
    assert.deepEqual(page.complaints, [], "errors in the console");
  } finally {
    await page.context().close();
  }
}

const particles = (status) => status.atRest && status.particles;

/** The beginning of a NumPy file of `count` positions. */
function head(count) {
  const header = `{'descr': '<f4', 'fortran_order': False, 'shape': (${count}, 3), }`;
  const head = Buffer.alloc(128, " ");
  head.write("\x93NUMPY\x01\x00", "latin1");
  head.writeUInt16LE(118, 8);
  head.write(header, 10);
  head.write("\n", 127);
  return head;
}

/** As many particles on a grid, a little off it. */
function block(count, radius) {
  const side = Math.ceil(Math.cbrt(count));
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647 - 0.5;
  const positions = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    const place = [i % side, Math.floor(i / side) % side, Math.floor(i / side / side)];
    place.forEach((at, axis) => (positions[3 * i + axis] = 2 * radius * (at + 0.4 * random())));
  }
  return Buffer.concat([head(count), Buffer.from(positions.buffer)]);
}

/** Drops files of the site on the page, as a user does. */
function drop(page, ...paths) {
  return page.evaluate(async (paths) => {
    const dropped = new DataTransfer();
    for (const path of paths) {
      const bytes = await (await fetch(path)).arrayBuffer();
      dropped.items.add(new File([bytes], path.split("/").at(-1)));
    }
    const event = new DragEvent("drop", { dataTransfer: dropped, bubbles: true, cancelable: true, composed: true });
    const view = document.querySelector("limpid-view");
    view.shadowRoot.querySelector("canvas").dispatchEvent(event);
  }, paths);
}

test("opened without anything, the page plays a demo that fits its window, and asks for files", async (t) => {
  const begun = performance.now();
  let wide;
  await visit("", async (page) => {
    const { eye, invites, playing } = await shows(page, (status) => status.shown);
    t.diagnostic(`first picture after ${((performance.now() - begun) / 1000).toFixed(1)} s`);
    assert.deepEqual([invites, playing], [true, true]);
    wide = eye;
    const { frame, particles } = await shows(page, (status) => status.frame > 1 && status.particles);
    assert.equal(particles, 9000, `frame ${frame}`);
    t.diagnostic(await held(page));
    await drop(page, `/data/${dam}20.bgeo`);
    await shows(page, (status) => status.open.endsWith("_20.bgeo") && !status.invites);
  });
  // A window that is taller than wide looks along the tank. Who wants no motion gets the best frame.
  await visit("", async (page) => {
    const status = await shows(page, (status) => status.frame === 24 && status.shown?.frame === 24);
    assert.equal(status.playing, false);
    assert.notDeepEqual(status.eye, wide);
    await call(page, "play", true);
    await shows(page, (status) => status.playing && status.frame > 24);
  }, { viewport: { width: 200, height: 420 }, reducedMotion: "reduce" });
});

test("every shader compiles in the browser, and one that is wrong does not", async () => {
  await visit(still, async (page) => {
    const { count, problems, caught } = await page.evaluate(async () => {
      const module = await import("./limpid_web.js");
      await module.default();
      const device = await (await navigator.gpu.requestAdapter()).requestDevice();
      const errors = async (code) => {
        device.pushErrorScope("validation");
        const { messages } = await device.createShaderModule({ code }).getCompilationInfo();
        await device.popErrorScope();
        return messages.filter(({ type }) => type === "error").map(({ message }) => message);
      };
      const problems = [];
      const shaders = module.shaders();
      for (const [name, text] of shaders) {
        for (const message of await errors(text)) problems.push(`${name}: ${message}`);
      }
      // naga passes over a barrier that not all threads may reach (wgpu #4369).
      const caught = await errors(`
        @group(0) @binding(0) var<storage, read_write> data: array<u32>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) i: u32) {
          if data[i] > 0u { workgroupBarrier(); }
        }`);
      return { count: shaders.length, problems, caught };
    });
    assert.ok(count > 60, `${count} shaders`);
    assert.deepEqual(problems, []);
    assert.equal(caught.length, 1);
  });
});

test("files of several formats are dropped, alone, as a sequence, and with their scene", async () => {
  await visit(still, async (page) => {
    await shows(page, (status) => status.open);
    await drop(page, `/data/${dam}20.bgeo`);
    let status = await shows(page, (status) => particles(status) && status.open.includes("_20"));
    assert.equal(status.frames, 1);

    await drop(page, "/data/formats/vtk_zlib_appended.vtu");
    await shows(page, (status) => particles(status) && status.open.endsWith(".vtu"));

    const points = Array.from({ length: 1000 }, (_, i) => [i % 10, (i / 10) % 10 | 0, (i / 100) | 0]);
    const vtk = `# vtk DataFile Version 3.0\nblock\nASCII\nDATASET POLYDATA\nPOINTS 1000 float\n${points
      .map((point) => point.map((at) => at * 0.05).join(" "))
      .join("\n")}\n`;
    await writeFile(join(work, "block.vtk"), vtk);
    await drop(page, "/made/block.vtk");
    status = await shows(page, (status) => particles(status) && status.open.endsWith(".vtk"));
    assert.equal(status.particles, 1000);

    await drop(page, ...[20, 21, 22].map((frame) => `/data/${dam}${frame}.bgeo`));
    status = await shows(page, (status) => particles(status) && status.frames === 3);
    assert.equal(status.frame, 20);

    await drop(page, "/sims/demo.toml", "/sims/demo.bgeo");
    status = await shows(page, (status) => particles(status) && status.open.endsWith("demo.toml"));
    assert.deepEqual(status.eye, [0.9, 1.5, 3.1]);

    // A folder with more than the particles, and a scene that names them from another folder.
    const text = `[particles]\nsource = "../frames/water_{}.bgeo"\n`;
    const give = (files) =>
      page.evaluate(async ([url, files]) => {
        const bytes = await (await fetch(url)).arrayBuffer();
        const { view } = document.querySelector("limpid-view");
        view.openFiles(files.map(([path, text]) => [path, new File([text ?? bytes], path.split("/").at(-1))]));
      }, ["/sims/demo.bgeo", files]);
    await give([["run/log/a.log", "a log"], ["run/frames/water_1.bgeo"], ["run/frames/water_2.bgeo"]]);
    status = await shows(page, (status) => particles(status) && status.open.endsWith("run/frames"));
    assert.equal(status.frames, 2);
    await give([["run/scenes/pool.toml", text], ["run/frames/water_1.bgeo"], ["run/frames/water_2.bgeo"]]);
    status = await shows(page, (status) => particles(status) && status.open.endsWith("pool.toml"));
    assert.equal(status.frames, 2);

    // The saved scene opens what it was saved from.
    await page.keyboard.press("Control+e");
    await page.waitForTimeout(500);
    await page.keyboard.press("Enter");
    const name = "pool_view.toml";
    await page.waitForFunction((name) => window.saved[name], name);
    const saved = await page.evaluate((name) => new TextDecoder().decode(window.saved[name]), name);
    await give([["view.toml", saved], ["run/frames/water_1.bgeo"], ["run/frames/water_2.bgeo"]]);
    status = await shows(page, (status) => particles(status) && status.open.endsWith("view.toml"));
    assert.equal(status.frames, 2);
  });
});

rare("what is opened in vain changes nothing", async () => {
  await writeFile(join(work, "few.npy"), block(1000, 0.05));
  await visit("?scene=/made/none.bgeo", async (page) => {
    await shows(page, (status) => status.notices.length === 1);
    // Of two at once, the first is read and never shown, and the second is not there.
    await call(page, "openFiles", []);
    await page.evaluate(async (url) => {
      const { view } = document.querySelector("limpid-view");
      const file = new File([await (await fetch(url)).arrayBuffer()], "few.npy");
      view.open("/sims/demo.toml");
      while (JSON.parse(view.status()).particles !== 4732) await new Promise((done) => setTimeout(done, 100));
      view.openFiles([["few.npy", file]]);
      view.open("/made/none.bgeo");
    }, "/made/few.npy");
    // Repeated notices are shown once, the newest last.
    const isTold = ({ notices }) => notices.length === 2 && notices[1].text.includes("none.bgeo");
    await shows(page, (status) => isTold(status) && !status.opening);
    await call(page, "set", ["classify.smoothing=0.5"]);
    const status = await shows(page, particles);
    assert.ok(status.open.endsWith("/sims/demo.toml"), status.open);
    assert.equal(status.particles, 4732);
  });
});

test("a sequence plays, round and round, and is scrubbed", async () => {
  await visit(`?scene=/data/${dam}{}.bgeo&frames=20-22&frame=21`, async (page) => {
    let status = await shows(page, particles);
    assert.deepEqual([status.frame, status.frames], [21, 3]);
    await call(page, "play", true);
    const seen = new Set();
    await shows(page, (status) => status.playing && status.shown);
    while (seen.size < 3) seen.add((await shows(page, (status) => status.shown)).frame);
    await call(page, "play", false);
    await call(page, "seek", 0);
    status = await shows(page, (status) => particles(status) && status.frame === 20);
    assert.equal(status.particles, 4732);
  });
});

test("settings, keys, the pointer, fingers and the window's size change the picture", async () => {
  await visit(still, async (page) => {
    let status = await shows(page, particles);
    assert.equal(status.particles, 4732);
    assert.ok(status.passes.some(([name, ms]) => name === "refract" && ms > 0), "times of passes");
    const eye = status.eye;

    const before = await save(page, "before.png", [96, 72], 1);
    await call(page, "set", ["refract.interfaces=1"]);
    await shows(page, particles);
    assert.notDeepEqual(await save(page, "after.png", [96, 72], 1), before, "a setting");
    await call(page, "set", ["refract.interfaces=4"]);
    await shows(page, particles);
    assert.deepEqual(await save(page, "again.png", [96, 72], 1), before, "the same pixels again");
    await assert.rejects(call(page, "set", ["refract.interfacs=4"]), /interfaces/);
    await call(page, "set", ["liquid.ior=1.2"]);
    await shows(page, particles);
    assert.notDeepEqual(await save(page, "ior.png", [96, 72], 1), before, "the liquid");

    // Notices of saved pictures lie over the picture.
    await page.keyboard.press("Escape");
    await shows(page, (status) => particles(status) && status.notices.length === 0);
    await page.mouse.move(180, 150);
    await page.mouse.down();
    await page.mouse.move(220, 140, { steps: 4 });
    await page.mouse.up();
    // A drag orbits.
    status = await shows(page, (status) => particles(status) && String(status.eye) !== String(eye));
    const orbited = status.eye;
    const distance = (of) => Math.hypot(...of);
    await page.mouse.wheel(0, -200);
    status = await shows(page, (status) => particles(status) && String(status.eye) !== String(orbited));
    assert.ok(distance(status.eye) < distance(orbited), "the wheel zooms");

    await page.keyboard.press("h");
    status = await shows(page, (status) => particles(status) && String(status.eye) === String(eye));
    await page.keyboard.press("v");
    status = await shows(page, (status) => particles(status) && status.view !== "Picture");
    await page.keyboard.press("p");
    await shows(page, (status) => particles(status) && status.view === "Picture");

    await page.setViewportSize({ width: 320, height: 260 });
    status = await shows(page, (status) => particles(status) && status.size[0] === 320);
    assert.deepEqual(status.shown.size, status.size);
  });
  await visit(still, async (page) => {
    const { eye } = await shows(page, particles);
    const client = await page.context().newCDPSession(page);
    const touch = (type, ...points) =>
      client.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    await touch("touchStart", [180, 150]);
    for (const x of [190, 210, 230]) {
      await touch("touchMove", [x, 150]);
      await page.waitForTimeout(50);
    }
    await touch("touchEnd");
    let status = await shows(page, (status) => particles(status) && String(status.eye) !== String(eye));
    const length = (eye) => Math.hypot(...eye);
    const near = length(status.eye);
    await touch("touchStart", [160, 150], [200, 150]);
    for (const far of [30, 40, 60, 80]) {
      await touch("touchMove", [180 - far, 150], [180 + far, 150]);
      await page.waitForTimeout(100);
    }
    await touch("touchEnd");
    status = await shows(page, (status) => particles(status) && length(status.eye) < 0.95 * near);
  }, { hasTouch: true });
});

rare("an address opens what a link was made of", async () => {
  let link;
  const query = `?scene=/data/${dam}{}.bgeo&frames=20-22&frame=22&set=refract.samples%3D2&look=night&missing=error`;
  await visit(query, async (page) => {
      await shows(page, particles);
      await page.mouse.move(180, 150);
      await page.mouse.down();
      await page.mouse.move(220, 140, { steps: 3 });
      await page.mouse.up();
      await call(page, "set", ["refract.interfaces=2"]);
      const { eye } = await shows(page, particles);
      await page.keyboard.press("Control+l");
      const { notices } = await shows(page, (status) => status.notices.length > 0);
      const query = await call(page, "query");
      assert.equal(notices[0].text, `copied: ${site.url}/?${query}`);
      link = { eye, query };
  });
  assert.match(link.query, /frame=22/);
  assert.match(link.query, /look=night/);
  await visit(`?${link.query}`, async (page) => {
    const status = await shows(page, particles);
    assert.deepEqual([status.frame, status.frames, status.eye], [22, 3, link.eye]);
    assert.equal(await call(page, "query"), link.query);
  });
  await visit("?demo=nowhere", async (page) => {
    const status = await shows(page, (status) => status.notices.length > 0);
    assert.match(status.notices[0].text, /demo in the address: expected one of dam_break/);
  });
});

rare("a simulation runs in the page while it plays, and its settings change meanwhile", async () => {
  await visit("?demo=dam_break", async (page) => {
    await shows(page, (status) => status.playing && status.frames >= 3 && status.shown, 180_000);
    await call(page, "set", ["refract.interfaces=2", "caustics.resolution=128"]);
    const { pictures } = await shows(page, (status) => status.frames >= 4, 180_000);
    await shows(page, (status) => status.pictures > pictures, 180_000);
    // Another document ends it.
    await drop(page, `/data/${dam}20.bgeo`);
    await shows(page, (status) => particles(status) && status.open.endsWith("_20.bgeo"), 180_000);
  });
});

rare("particles are classified on the device too", async () => {
  await visit(`${still}&set=classify.on%3Dgpu`, async (page) => {
    const status = await shows(page, particles);
    assert.deepEqual([status.particles, status.notices], [4732, []]);
  });
});

rare("a liquid is simulated and drawn on the device, and a wrong address is told", async () => {
  const frame = (page, number) => page.waitForFunction((number) => {
    const note = document.querySelector("p");
    return note.dataset.frame >= number || !/^(Loading|[0-9])/.test(note.textContent);
  }, number, { timeout: 180_000 });
  const pixels = (page) => page.evaluate(() => {
    const { width, height } = document.querySelector("canvas");
    return Array.from(document.querySelector("canvas").getContext("2d").getImageData(0, 0, width, height).data);
  });
  await visit("/live.html?particles=4000&scale=0.3", async (page) => {
    await frame(page, 2);
    const early = await pixels(page);
    assert.match(await page.textContent("p"), /^4,000 particles, \d+ ms$/);
    await frame(page, 12);
    const late = await pixels(page);
    assert.equal(late.length, 4 * 108 * 84);
    const changed = early.filter((value, i) => Math.abs(value - late[i]) > 8).length;
    assert.ok(changed > early.length / 100, `${changed} of ${early.length} values differ after ten frames`);
  });
  await visit("/live.html?particles=many", async (page) => {
    await frame(page, 1);
    assert.equal(await page.textContent("p"), "particles=many: a number from 1000 to 1000000 expected");
  });
});

rare("a lost device, a worker that ends and a lost canvas are replaced", async () => {
  const watched = () => {
    const Native = Worker;
    window.Worker = class extends Native {
      constructor(...given) {
        super(...given);
        window.worker = this;
      }
    };
  };
  await visit(still, async (page) => {
    const { pictures } = await shows(page, particles);
    await call(page, "loseDevice");
    await call(page, "set", ["refract.interfaces=2"]);
    let status = await shows(page, (status) => particles(status) && status.pictures > pictures);
    assert.ok(status.notices.some(({ text }) => text.includes("another one takes over")), "a notice");

    await page.evaluate(() => window.worker.dispatchEvent(new ErrorEvent("error", { message: "for a test" })));
    status = await shows(page, (status) => particles(status) && status.notices.length > 1);
    assert.ok(status.notices.some(({ text }) => text === "the worker failed (for a test)"));
    await call(page, "set", ["refract.interfaces=4"]);
    await shows(page, (status) => particles(status));
    // A trap that no panic has explained is an allocation that failed.
    await page.evaluate(() => window.worker.dispatchEvent(new ErrorEvent("error", { message: "RuntimeError: unreachable" })));
    status = await shows(page, (status) => particles(status) && status.notices.length > 2);
    assert.match(status.notices[2].text, /^memory ran out/);

    await page.evaluate(() => {
      const canvas = document.querySelector("limpid-view").shadowRoot.querySelector("canvas");
      canvas.getContext("webgl2").getExtension("WEBGL_lose_context").loseContext();
    });
    await page.waitForTimeout(1000);
    status = await shows(page, particles);
    assert.equal(await page.evaluate(() => document.querySelector("limpid-view").shadowRoot.querySelectorAll("canvas").length), 1);

    // The viewer itself can say nothing any more.
    await page.evaluate(() => (document.querySelector("limpid-view").view.failure = () => "for a test"));
    await page.waitForFunction(() => /limpid has failed[^]*for a test/.test(document.querySelector("limpid-view").shadowRoot.textContent));
  }, { before: watched });
});

rare("an element that is moved or taken away leaves no worker behind", async () => {
  const counted = () => {
    const Native = Worker;
    window.workers = 0;
    window.Worker = class extends Native {
      constructor(...given) {
        super(...given);
        window.workers++;
      }
      terminate() {
        window.workers--;
        super.terminate();
      }
    };
  };
  await visit(still, async (page) => {
    const workers = () => page.evaluate(() => window.workers);
    // Moved while it starts, and again while it runs.
    await page.evaluate(() => document.body.append(document.querySelector("limpid-view")));
    await shows(page, particles);
    assert.equal(await workers(), 1);
    await page.evaluate(() => document.body.append(document.querySelector("limpid-view")));
    await shows(page, particles);
    assert.equal(await workers(), 1);
    await drop(page, "/sims/demo.bgeo");
    await shows(page, (status) => particles(status) && status.open === "files/demo.bgeo");
    await page.evaluate(() => document.querySelector("limpid-view").remove());
    assert.equal(await workers(), 0);
  }, { before: counted });
});

rare("particles that memory cannot take are told, and what was open is opened again", async (t) => {
  await visit(still, async (page) => {
    await shows(page, particles);
    await page.evaluate((head) => {
      // 300 million particles in 3.6 GB, of one block that is stored once.
      const block = new Blob([new Uint8Array(12 << 20)]);
      const many = new Blob(Array(300).fill(block));
      const { view } = document.querySelector("limpid-view");
      view.openFiles([["many.npy", new File([Uint8Array.from(head), many], "many.npy")]]);
    }, [...head(300 << 20)]);
    const status = await shows(page, (status) => !status.opening && status.notices.some(({ error }) => error), 300_000);
    const { text } = status.notices.find(({ error }) => error);
    t.diagnostic(text);
    assert.match(text, /^files\/many\.npy: .*memory/);
    const { open } = await shows(page, particles);
    assert.ok(open.endsWith("/sims/demo.toml"), open);
  });
});

rare("damaged and foreign files get the program's one line, and what was open stays open", async () => {
  const whole = await readFile(join(root, `tests/data/${dam}20.bgeo`));
  const wrong = Buffer.from(whole);
  wrong.writeUInt32BE(0x7fffffff, 9);
  await writeFile(join(work, "short.bgeo"), whole.subarray(0, 5000));
  await writeFile(join(work, "many.bgeo"), wrong);
  await writeFile(join(work, "text.vtu"), "not a file of VTK");
  await writeFile(join(work, "wrong.toml"), "[liquid]\nior = 'much'\n");
  await writeFile(join(work, "empty.ply"), "");
  await visit(still, async (page) => {
    await shows(page, particles);
    for (const name of ["short.bgeo", "many.bgeo", "text.vtu", "wrong.toml", "empty.ply"]) {
      const told = await run(limpid, ["info", name], { cwd: work }).then(
        () => assert.fail(`${name} is read`),
        ({ stderr }) => stderr.trim(),
      );
      await drop(page, `/made/${name}`);
      const last = (status) => status.notices.at(-1)?.text ?? "";
      const status = await shows(page, (status) => !status.opening && status.notices.at(-1)?.error);
      await shows(page, (status) => (status.notices.at(-1)?.text ?? "").includes("files"));
      const line = last(await shows(page, (status) => !status.opening)).replace(/^files\d*\//, "");
      // The program adds a remedy in terms of its options.
      assert.ok(told.includes(line), `${name}: the page says "${line}", the program "${told}"`);
      assert.equal(status.particles > 0, true);
      await page.keyboard.press("Escape");
      await shows(page, (status) => status.notices.length === 0);
    }
    const status = await shows(page, particles);
    assert.ok(status.open.endsWith("demo.toml"));
  });
});

rare("what a server lacks, forbids or does not list is told", async () => {
  for (const [query, told] of [
    ["?scene=/made/none.bgeo", /none\.bgeo/],
    ["?scene=/nowhere/water_{}.bgeo", /the server lists no files here; put files\.txt beside them/],
    ["?scene=/signed/water_1.bgeo", /the server answers 403/],
    ["?scene=http://localhost:9/water.bgeo", /the server cannot be reached, or does not let other sites read this/],
  ]) {
    const page = await open(browser, site.url + query);
    const status = await shows(page, (status) => status.notices.length > 0);
    assert.match(status.notices[0].text, told);
    await page.context().close();
  }
  // A list of names, where the server shows none.
  await writeFile(join(work, "files.txt"), "water_1.bgeo\nwater_2.bgeo\n");
  for (const frame of [1, 2]) await writeFile(join(work, `water_${frame}.bgeo`), await readFile(join(root, "sims/demo.bgeo")));
  await visit("?scene=/made/water_{}.bgeo", async (page) => {
    const status = await shows(page, particles);
    assert.equal(status.frames, 2);
  });
  // A signature is part of all requests in its folder, and of the link.
  const query = `scene=${encodeURIComponent(`${site.url}/signed/water_{}.bgeo?key=a/b`)}`;
  await visit(`?${query}`, async (page) => {
    const status = await shows(page, particles);
    assert.equal(status.frames, 2);
    assert.ok((await call(page, "query")).startsWith(query));
  });
});

rare("a browser without WebGPU gets a still picture, and is told what it needs", async () => {
  const without = () => Object.defineProperty(Navigator.prototype, "gpu", { get: () => undefined });
  await visit("", async (page) => {
    const text = () => page.evaluate(() => document.querySelector("limpid-view").shadowRoot.querySelector("p").innerText);
    while (!(await text()).includes("WebGPU")) await page.waitForTimeout(50);
    assert.match(await text(), /This browser has no WebGPU[^]*Chrome on Linux[^]*enable-unsafe-webgpu/);
    const width = () => page.evaluate(() => document.querySelector("limpid-view").shadowRoot.querySelector("img").naturalWidth);
    while (!(await width())) await page.waitForTimeout(50);
  }, { before: without });
});

rare("three lines of HTML put a view into another page", async () => {
  const page = `<!doctype html>
<script type="module" src="/limpid.js"></script>
<limpid-view src="/data/${dam}{}.bgeo" frames="20-22" frame="21" set="refract.interfaces=2; refract.samples=1" style="width: 320px; height: 200px"></limpid-view>`;
  await writeFile(join(work, "embed.html"), page);
  await visit("/made/embed.html", async (page) => {
    const status = await shows(page, particles);
    assert.deepEqual([status.frame, status.frames], [21, 3]);
    const query = await call(page, "query");
    assert.match(query, /set=refract.interfaces%3D2&set=refract.samples%3D1/);
    // A picture alone has no panels to show, and nothing to save.
    await page.keyboard.press("Tab");
    await page.keyboard.press("Control+s");
    assert.deepEqual((await shows(page, particles)).size, status.size);
  });
});

test("a folder of frames becomes a site that opens with them", async () => {
  const folder = join(work, "some");
  await mkdir(folder);
  for (const frame of [20, 21, 22]) {
    const name = `ParticleData_Fluid_${frame}.bgeo`;
    await writeFile(join(folder, name), await readFile(join(root, "tests/data/double_dam_break", name)));
  }
  await run(limpid, ["web", "some", "-o", "site", "--page", join(root, "web/dist"), "--set", "refract.samples=1"], { cwd: work });
  await visit("/made/site/index.html", async (page) => {
    const { frames, open, particles } = await shows(page, (status) => status.shown && status.playing);
    assert.deepEqual([frames, particles], [3, 4732]);
    assert.ok(open.endsWith("/made/site/scene.toml"), open);
  });
});

/** Checks pictures that the page drew of scenes (paths by name) against the program's. */
async function alike(t, folder, scenes, samples, size) {
  // The page's pictures are the expected ones of a suite that the program draws. Its tolerances for adapters that it does
  // not know: mean FLIP 0.01, the 99th percentile 0.2.
  const suite = (name, frames) => {
    const frame = ([name, input]) => `[[frame]]\nname = "${name}"\ninput = ${JSON.stringify(input)}\n`;
    return writeFile(join(work, `${name}.toml`), `size = [${size}]\n${frames.map(frame).join("")}`);
  };
  const check = (name) => run(limpid, ["check", `${name}.toml`, "--out", `${name}-check`], { cwd: work });
  await mkdir(join(work, folder));
  const names = Object.keys(scenes);
  for (const name of names) {
    await visit(`?scene=${scenes[name].url}`, async (page) => {
      await shows(page, particles);
      await writeFile(join(work, folder, `${name}.png`), await save(page, "picture.png", size, samples(name)));
      // As wide as the picture at least: a camera that is fitted is for the window.
    }, { viewport: { width: 400, height: 280 } });
  }
  await suite(folder, names.map((name) => [name, scenes[name].path]));
  const { stdout } = await check(folder);
  stdout.split("\n").forEach((line) => t.diagnostic(line));
  // A picture of another scene is not within them.
  const [first, second] = names;
  const other = `${folder}-other`;
  await mkdir(join(work, other));
  await writeFile(join(work, other, `${first}.png`), await readFile(join(work, folder, `${second}.png`)));
  await suite(other, [[first, scenes[first].path]]);
  await assert.rejects(check(other), ({ stdout }) => stdout.includes(`FAILED  ${first}`));
}

test("pictures are those of the program, within the tolerances of limpid check", async (t) => {
  const samples = { demo: 4, drop: 1, slab: 1, vase: 4, glass_ball: 1 };
  const scene = (name) => [name, { url: `/sims/${name}.toml`, path: join(root, `sims/${name}.toml`) }];
  const scenes = Object.fromEntries(Object.keys(samples).map(scene));
  await alike(t, "alike", scenes, (name) => samples[name], [160, 120]);
});

rare("colours of data, opaque bodies and milk are those of the program", async (t) => {
  const file = "ParticleData_Fluid_40.bgeo";
  await writeFile(join(work, file), await readFile(join(root, "tests/data/double_dam_break", file)));
  const liquids = {
    speed: 'color_by = "velocity"\ncolormap = "turbo"\ncolor_range = [0.0, 3.0]',
    paint: 'kind = "opaque"\ncolor = [0.8, 0.2, 0.1]\nroughness = 0.2',
    milk: "scattering = [60.0, 70.0, 80.0]\nabsorption = [0.1, 0.2, 0.5]",
  };
  const scenes = {};
  for (const [name, liquid] of Object.entries(liquids)) {
    const path = join(work, `${name}.toml`);
    await writeFile(path, `[particles]\nsource = "${file}"\n[liquid]\n${liquid}\n`);
    scenes[name] = { url: `/made/${name}.toml`, path };
  }
  await alike(t, "kinds", scenes, () => 1, [160, 120]);
});

rare("40,000 particles play, and 1,000,000 open", async (t) => {
  for (const frame of [1, 2, 3]) await writeFile(join(work, `many_${frame}.npy`), block(40_000 + frame, 0.01));
  await visit("?scene=/made/many_{}.npy&frames=1-3&radius=0.01&play=1&set=refract.interfaces%3D2", async (page) => {
    const seen = new Set();
    const begun = performance.now();
    let pictures = 0;
    while (seen.size < 3) {
      const status = await shows(page, (status) => status.shown, 300_000);
      seen.add(status.frame);
      pictures = status.pictures;
    }
    t.diagnostic(`40,000: ${pictures} pictures in ${((performance.now() - begun) / 1000).toFixed(1)} s from opening`);
  }, { viewport: { width: 320, height: 320 } });
  await writeFile(join(work, "million.npy"), block(1_000_000, 0.01));
  await visit("?scene=/made/million.npy&radius=0.01&set=refract.interfaces%3D2", async (page) => {
    const begun = performance.now();
    const status = await shows(page, (status) => status.shown || status.notices.some(({ error }) => error), 600_000);
    t.diagnostic(`1,000,000: ${((performance.now() - begun) / 1000).toFixed(1)} s; ${await held(page)}`);
    assert.ok(status.shown, JSON.stringify(status.notices));
    assert.equal(status.particles, 1_000_000);
  }, { viewport: { width: 320, height: 320 } });
});
