// What the address says is what is shown: #/ the projects, #/p/PROJECT/log/LOG a log, and so on.

import { enter } from "./api.js";
import { complaint, fill, h } from "./dom.js";
import * as jobs from "./jobs.js";
import { link, open, store } from "./store.js";

const VIEWS = {
  "": () => import("./views/project.js"), log: () => import("./views/log.js"), model: () => import("./views/model.js"),
  setting: () => import("./views/setting.js"), study: () => import("./views/study.js"), compare: () => import("./views/compare.js"), workbench: () => import("./views/workbench.js"), rig: () => import("./views/rig.js"),
};
const TABS = [["", "Logs and results"], ["compare", "Compare"], ["workbench", "Workbench"], ["rig", "Rig"]];
const main = document.getElementById("main");
let leave = null;
let shown = "";

async function show() {
  const address = location.hash;
  const [, root, project, view = "", ...rest] = address.split("/");
  leave?.();
  leave = null;
  try {
    const module = root === "p" ? await (VIEWS[view] ?? VIEWS[""])() : await import("./views/start.js");
    await open(root === "p" ? project : "");
    if (location.hash !== address) return;
    navigation(view);
    const box = h("div", { class: `view ${view || root || "start"}` });
    leave = (await module.show(box, ...rest)) ?? null;
    if (location.hash !== address) return;
    fill(main, box);
    document.title = `${box.querySelector("h1")?.textContent ?? "stickslip"} · stickslip`;
    if (shown && shown !== address) main.focus({ preventScroll: true });
    if (shown !== address) scrollTo(0, 0);
    shown = address;
    document.body.dataset.ready = address || "#/";
  } catch (error) {
    navigation(view);
    fill(main, error.status === 401 ? locked() : [h("h1", {}, "This cannot be shown"), complaint(error),
      h("p", {}, h("a", { href: "#/" }, "All projects"))]);
    document.body.dataset.ready = "problem";
  }
}

function locked() {
  return [h("h1", {}, "Open the address with its token"),
    h("p", {}, "This page opens only with the full address that ", h("code", {}, "stickslip web"),
      " printed: the part after # is the key. Copy all of it from the terminal.")];
}

function navigation(view) {
  const nav = document.getElementById("nav");
  if (!store.project) return fill(nav);
  fill(nav, h("a", { href: "#/", class: "project" }, store.project.name),
    TABS.map(([name, text]) => h("a", { href: link(...(name ? [name] : [])), "aria-current": name === view ? "page" : undefined }, text)));
}

addEventListener("stickslip-show", show);
addEventListener("hashchange", show);
// A file dropped beside its place would leave the page.
for (const kind of ["dragover", "drop"]) addEventListener(kind, (event) => event.preventDefault());

jobs.start();
try {
  await enter();
  await show();
} catch (error) {
  fill(main, error.status === 401 ? locked() : complaint(error));
  document.body.dataset.ready = "problem";
}
