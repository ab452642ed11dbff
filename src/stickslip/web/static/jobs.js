// Running work, at the foot of every view: what it does, for how long, and a way to end it.

import { follow, remove } from "./api.js";
import { announce, fill, h } from "./dom.js";
import { here, refresh, store, watch } from "./store.js";

const followed = new Map();

export function start() {
  watch(() => {
    for (const job of store.project?.jobs ?? []) {
      if (!["done", "failed", "cancelled"].includes(job.state) && job.kind !== "rig") run(job.id, job.title);
    }
    for (const [id, one] of followed) if (one.project !== store.project?.id) drop(id);
  });
}

function drop(id) {
  followed.get(id)?.stop();
  followed.get(id)?.element.remove();
  followed.delete(id);
}

// Follow a job; resolves with its last line.
export function run(id, title) {
  if (followed.has(id)) return followed.get(id).promise;
  const base = here(`/jobs/${id}`);
  const words = h("span", { class: "what" }, title);
  const said = h("span", { class: "said" }, "waiting");
  const clock = h("span", { class: "clock" }, "0 s");
  const bar = h("progress", { "aria-label": title, max: 1 });
  const cancel = h("button", { type: "button", class: "quiet",
    onclick: () => { cancel.disabled = true; remove(`${base}/run`).catch((e) => announce(e.message)); } }, "Cancel");
  const element = h("div", { class: "job" }, words, said, bar, clock, cancel);
  document.getElementById("jobs").append(element);
  const began = performance.now();
  const tick = setInterval(() => fill(clock, `${Math.round((performance.now() - began) / 1000)} s`), 500);
  const one = { project: store.project.id, element, stop: () => {} };
  one.promise = new Promise((resolve) => {
    one.stop = follow(`${base}/events`, async (line) => {
      if (line.shown && store.project) {
        await refresh();
        dispatchEvent(new CustomEvent("stickslip-shown", { detail: id }));
      }
      if (line.tell) fill(said, line.tell);
      if (line.part !== undefined) bar.value = line.part;
      if (!line.end) return;
      clearInterval(tick);
      drop(id);
      announce(`${title}: ${line.end}${line.error ? `: ${line.error}` : ""}`);
      if (store.project) await refresh();
      resolve(line);
    });
  });
  followed.set(id, one);
  announce(`${title} began`);
  return one.promise;
}
