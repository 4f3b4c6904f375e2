// The worker of a view: it is sent the compiled module first, and then what `limpid-viewer` asks.

import init, { work } from "./limpid_web.js";

const early = [];
self.onmessage = async ({ data }) => {
  self.onmessage = (event) => early.push(event);
  try {
    await init({ module_or_path: data.module });
    work();
  } catch (error) {
    // Where the page hears of it.
    setTimeout(() => { throw error; });
    return;
  }
  for (const event of early) self.onmessage(event);
};
