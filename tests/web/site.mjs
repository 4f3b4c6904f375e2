// A server of the built page and of files to open, and a browser to look at it: for tests and measurements.

import { createReadStream } from "node:fs";
import { readdir, stat } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const root = fileURLToPath(new URL("../../", import.meta.url));

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".wasm": "application/wasm", ".json": "application/json" };

/** Serves `web/dist`, and folders by the first part of a path; lists folders as common servers do. Requests in `signed`
 * need a signature. */
export async function serve(folders = {}) {
  const server = createServer(async (request, response) => {
    const { pathname, searchParams } = new URL(request.url, "http://localhost");
    const path = decodeURIComponent(pathname);
    if (path === "/favicon.ico") return response.writeHead(204).end();
    const [, first, ...rest] = normalize(path).split("/");
    if (first === "signed" && searchParams.get("key") !== "a/b") return response.writeHead(403).end();
    const file = first in folders ? join(folders[first], ...rest) : join(root, "web/dist", path);
    try {
      const found = await stat(file);
      if (found.isDirectory() && path !== "/") {
        const names = await readdir(file);
        response.writeHead(200, { "content-type": "text/html" });
        response.end(names.map((name) => `<a href="${encodeURIComponent(name)}">${name}</a>`).join("\n"));
        return;
      }
      const whole = found.isDirectory() ? join(file, "index.html") : file;
      const { size } = await stat(whole);
      const type = TYPES[extname(whole)] ?? "application/octet-stream";
      response.writeHead(200, { "content-type": type, "content-length": size, "cache-control": "no-store" });
      createReadStream(whole).pipe(response);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((done) => server.listen(0, "localhost", done));
  return { url: `http://localhost:${server.address().port}`, close: () => server.close() };
}

/** Starts Chromium with WebGPU on the processor. */
export function launch() {
  return chromium.launch({
    executablePath: process.env.LIMPID_CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--headless",
      "--no-sandbox",
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--enable-unsafe-webgpu",
      "--use-webgpu-adapter=swiftshader",
    ],
  });
}

/** Opens a page, and collects what its console and its errors say. */
export async function open(browser, url, { viewport = { width: 360, height: 280 }, before, ...context } = {}) {
  const page = await (await browser.newContext({ viewport, ...context })).newPage();
  page.complaints = [];
  page.on("console", (message) => {
    if (message.type() === "error") page.complaints.push(message.text());
  });
  page.on("pageerror", (error) => page.complaints.push(String(error)));
  // Files that are saved, by name, and tasks that held the page up.
  await page.addInitScript(() => {
    window.saved = {};
    // Any task, also the browser's own: without a GPU it waits for the canvas while shaders compile.
    window.longest = 0;
    // The page's own: its frames, and the messages of its worker.
    window.own = 0;
    const timed = (work) => function (...given) {
      const begun = performance.now();
      work.apply(this, given);
      window.own = Math.max(window.own, performance.now() - begun);
    };
    const request = window.requestAnimationFrame;
    window.requestAnimationFrame = (work) => request(timed(work));
    const { get, set } = Object.getOwnPropertyDescriptor(Worker.prototype, "onmessage");
    Object.defineProperty(Worker.prototype, "onmessage", {
      get,
      set(work) {
        set.call(this, work && timed(work));
      },
    });
    addEventListener("limpid-save", (event) => {
      event.preventDefault();
      window.saved[event.detail.name] = event.detail.bytes;
    });
    new PerformanceObserver((list) => {
      for (const { duration } of list.getEntries()) window.longest = Math.max(window.longest, duration);
    }).observe({ type: "longtask", buffered: true });
  });
  if (before) await page.addInitScript(before);
  await page.goto(url);
  return page;
}

/** What a page shows, once `wanted` holds for it; fails with what it shows instead. */
export async function shows(page, wanted, timeout = 120_000) {
  const begun = performance.now();
  for (;;) {
    const status = await page.evaluate(() => {
      const view = document.querySelector("limpid-view").view;
      return view && JSON.parse(view.status());
    });
    if (status && wanted(status)) return status;
    if (performance.now() - begun > timeout) {
      throw new Error(`${wanted}: after ${timeout} ms: ${JSON.stringify(status)}; ${page.complaints.join("; ")}`);
    }
    await page.waitForTimeout(100);
  }
}

/** The longest work that has held the page up, ms: its own, and any. */
export async function held(page) {
  const [own, any] = await page.evaluate(() => [window.own, window.longest]);
  return `the page's own longest work took ${Math.round(own)} ms, any ${Math.round(any)} ms`;
}

/** Calls a function of the page's view. */
export function call(page, name, ...values) {
  return page.evaluate(
    ([name, values]) => document.querySelector("limpid-view").view[name](...values),
    [name, values],
  );
}

/** Has the page draw a picture and returns its file. */
export async function save(page, name, [width, height], samples) {
  await page.evaluate((name) => delete window.saved[name], name);
  await call(page, "save", name, width, height, samples);
  await page.waitForFunction((name) => window.saved[name], name, { timeout: 180_000 });
  const bytes = await page.evaluate((name) => Array.from(window.saved[name]), name);
  return Buffer.from(bytes);
}
