// The element <limpid-view>: limpid's viewer in any page.
//
//   <script type="module" src="https://example.org/limpid/limpid.js"></script>
//   <limpid-view src="frames/water_{}.bgeo" frames="1-79" play></limpid-view>
//
// Attributes are those of an address (docs/web.md), with `src` for `scene`. `controls` shows the toolbar and the
// panels; `address` takes the parameters of the page's own address. The property `view` is the viewer, once the event
// `limpid-ready` has been sent; `limpid-save` is sent for each file that is saved, and can be cancelled.

import init, { View } from "./limpid_web.js";

const here = new URL(".", import.meta.url);

/** The compiled module, which all views and their workers share. */
let compiled;

/** Compiles the module, and tells the share that has been loaded. */
async function compile(told) {
  const answer = await fetch(new URL("limpid_web_bg.wasm", here));
  if (!answer.ok) throw new Error(`${answer.url}: the server answers ${answer.status}`);
  const whole = Number(answer.headers.get("content-length")) || 0;
  const parts = [];
  let length = 0;
  const reader = answer.body.getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    length += value.length;
    // A compressed answer is longer than it says.
    told(whole >= length ? length / whole : undefined);
  }
  return WebAssembly.compile(await new Blob(parts).arrayBuffer());
}

/** Why this browser cannot show limpid; nothing if it can. */
async function obstacle() {
  if (!window.isSecureContext) {
    return "limpid needs a secure page: https, or localhost.";
  }
  if (!navigator.gpu) {
    return "This browser has no WebGPU, which limpid draws with.";
  }
  const adapter = await navigator.gpu.requestAdapter().catch(() => null);
  if (!adapter) {
    return "This browser has WebGPU, but no graphics adapter for it.";
  }
  return undefined;
}

/** What this browser needs to draw. */
function remedy() {
  const { userAgent } = navigator;
  const linux = userAgent.includes("Linux") && !userAgent.includes("Android");
  if (userAgent.includes("Firefox")) {
    return `Firefox has WebGPU since version 141 on Windows and 145 on Macs.${linux ? " On Linux, Chrome has it." : ""}`;
  }
  if (/Chrom|Edg/.test(userAgent)) {
    return linux
      ? "Chrome on Linux has WebGPU with some graphics cards, with others once chrome://flags/#enable-unsafe-webgpu is " +
          "switched on."
      : "Chrome and Edge have WebGPU since version 113, if they may use the graphics card: chrome://gpu tells.";
  }
  if (userAgent.includes("Safari")) return "Safari has WebGPU since version 26.";
  return "Chrome and Edge have WebGPU since version 113, Safari since 26, Firefox since 141.";
}

/** All files of what was dropped, with their paths. */
async function filesOf(items) {
  const files = [];
  const walk = async (entry) => {
    if (entry.isFile) {
      const file = await new Promise((done, failed) => entry.file(done, failed));
      files.push([entry.fullPath.replace(/^\//, ""), file]);
    } else {
      const reader = entry.createReader();
      for (;;) {
        // A reader gives at most a hundred at a time.
        const some = await new Promise((done, failed) => reader.readEntries(done, failed));
        if (some.length === 0) break;
        for (const inner of some) await walk(inner);
      }
    }
  };
  // Items are gone once this function waits.
  const entries = [...items].map((item) => item.webkitGetAsEntry?.() ?? item.getAsFile());
  for (const entry of entries) {
    if (entry instanceof File) files.push([entry.name, entry]);
    else if (entry) await walk(entry);
  }
  return files;
}

const STYLE = `
  :host { display: block; position: relative; min-width: 160px; min-height: 120px; background: #0c0c0c; }
  canvas { position: absolute; inset: 0; width: 100%; height: 100%; outline: none; touch-action: none; }
  img { position: absolute; width: 100%; height: 100%; object-fit: cover; opacity: 0.3; }
  p { position: absolute; inset: 0; display: grid; place-content: center; margin: 0; padding: 2em;
      font: 15px/1.5 system-ui, sans-serif; color: #bbb; text-align: center; }
  p small { display: block; max-width: 40em; color: #888; }
`;

class LimpidView extends HTMLElement {
  /** The viewer; `undefined` before the event `limpid-ready`. */
  view;

  #root = this.attachShadow({ mode: "open" });
  #canvas;
  #worker;
  /** Number of times that it was put into a page or taken from it: what was begun before the last time is void. */
  #moves = 0;

  constructor() {
    super();
    // Before the canvas, which would take single files alone.
    const capture = { capture: true };
    const takes = () => this.view && this.hasAttribute("controls");
    this.addEventListener("dragover", (event) => takes() && event.preventDefault(), capture);
    this.addEventListener("drop", async (event) => {
      if (!takes()) return;
      event.preventDefault();
      event.stopPropagation();
      const files = await filesOf(event.dataTransfer.items).catch(() => []);
      this.view?.openFiles(files);
    }, capture);
  }

  async connectedCallback() {
    const move = ++this.#moves;
    const gone = () => move !== this.#moves;
    const style = document.createElement("style");
    style.textContent = STYLE;
    const note = document.createElement("p");
    this.#root.append(style, note);
    const say = (text, detail = "") => {
      const small = document.createElement("small");
      small.textContent = detail;
      note.replaceChildren(text, small);
    };
    say("Loading limpid…");
    try {
      const problem = await obstacle();
      if (gone()) return;
      if (problem) {
        say(problem, window.isSecureContext ? remedy() : "");
        const still = document.createElement("img");
        still.src = new URL("still.jpg", here);
        still.alt = "A lagoon, as limpid draws it";
        note.before(still);
        this.dispatchEvent(new CustomEvent("limpid-unsupported", { detail: problem, bubbles: true }));
        return;
      }
      compiled ??= compile((share) => {
        if (share !== undefined) say(`Loading limpid… ${Math.round(100 * share)} %`);
      });
      // The next view tries again.
      const module = await compiled.catch((error) => {
        compiled = undefined;
        throw error;
      });
      await init({ module_or_path: module });
      if (gone()) return;
      const plain = !this.hasAttribute("controls");
      this.view = new View(this.#host(module), this.#query(), plain, this.clientWidth, this.clientHeight);
      await this.#show();
      if (gone()) return;
      note.remove();
      this.dispatchEvent(new CustomEvent("limpid-ready", { bubbles: true }));
    } catch (error) {
      if (gone()) return;
      say("limpid could not be started.", String(error?.message ?? error));
      throw error;
    }
    // A failure of the viewer itself, which can say nothing any more.
    const watch = setInterval(() => {
      const failure = gone() ? undefined : this.view.failure();
      if (failure) {
        this.#root.append(note);
        say("limpid has failed. Please report this, and load the page again.", failure);
        this.#canvas.remove();
      }
      if (failure || gone()) clearInterval(watch);
    }, 1000);
  }

  /** An element that is taken from its page ends its worker; put back, it begins anew. */
  disconnectedCallback() {
    this.#moves++;
    this.#worker?.terminate();
    this.view?.leave();
    this.view = undefined;
    this.#root.replaceChildren();
  }

  /** Names and values of the attributes, then of the address, which replaces them. */
  #query() {
    const given = [];
    for (const { name, value } of this.attributes) {
      if (name === "src") given.push(["scene", value]);
      // An attribute can be there only once.
      else if (name === "set") given.push(...value.split(";").map((one) => ["set", one.trim()]));
      else if (!["controls", "address", "class", "id", "style"].includes(name)) given.push([name, value]);
    }
    return this.hasAttribute("address") ? [...given, ...new URLSearchParams(location.search)] : given;
  }

  #host(module) {
    return {
      worker: () => {
        const url = new URL("worker.js", here);
        // A worker's own file must be of the page's server; what it imports need not.
        const own = url.origin === location.origin;
        const text = new Blob([`import ${JSON.stringify(url.href)};`], { type: "text/javascript" });
        const worker = new Worker(own ? url : URL.createObjectURL(text), { type: "module" });
        worker.postMessage({ module });
        this.#worker = worker;
        return worker;
      },
      pick: (folder) => {
        const input = document.createElement("input");
        input.type = "file";
        input.multiple = true;
        input.webkitdirectory = folder;
        input.onchange = () => {
          const path = (file) => file.webkitRelativePath || file.name;
          this.view?.openFiles([...input.files].map((file) => [path(file), file]));
        };
        input.click();
      },
      // Later: whoever listens may call the view, which is at work.
      save: (name, bytes) => setTimeout(() => {
        const detail = { name, bytes };
        const event = new CustomEvent("limpid-save", { detail, bubbles: true, cancelable: true });
        if (!this.dispatchEvent(event)) return;
        const anchor = document.createElement("a");
        anchor.href = URL.createObjectURL(new Blob([bytes]));
        anchor.download = name;
        anchor.click();
        setTimeout(() => URL.revokeObjectURL(anchor.href), 60_000);
      }),
      // Relative to the page, as everywhere; placeholders in braces stay, and so does a signature in the query.
      absolute: (url) => {
        const { href } = new URL(url, document.baseURI);
        const [path] = href.split("?", 1);
        try {
          return decodeURI(path) + href.slice(path.length);
        } catch {
          return href;
        }
      },
      // To this page, if it reads its address, and else to limpid's own.
      link: (query) => {
        const page = this.hasAttribute("address") ? `${location.origin}${location.pathname}` : here.href;
        return query ? `${page}?${query}` : page;
      },
      still: () => matchMedia("(prefers-reduced-motion: reduce)").matches,
    };
  }

  /** Shows the viewer in a canvas, and in another one if that loses its context. */
  async #show() {
    this.#canvas?.remove();
    this.#canvas = document.createElement("canvas");
    this.#root.append(this.#canvas);
    const canvas = this.#canvas;
    canvas.addEventListener("webglcontextlost", () => {
      if (!this.view || canvas !== this.#canvas) return;
      this.view.leave();
      this.#show();
    });
    await this.view.show(canvas);
  }
}

customElements.define("limpid-view", LimpidView);
