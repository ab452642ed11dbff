// A project: its logs, models, settings, studies and rigs.

import { remove } from "../api.js";
import { complaint, h } from "../dom.js";
import { zone } from "../drop.js";
import { here, link, refresh, store } from "../store.js";

const ASKS = "asks to run Python code: open it and read it";
const KINDS = [
  ["logs", "Logs", "log", "No log yet.", (x) => ["reading", "looking"].includes(x.state) ? "is being read" : x.readable ? `${x.view.rows} rows${x.errors ? `, ${x.errors} errors` : ""}` : x.problem],
  ["models", "Models", "model", "None yet: open a log and identify.", (x) => ({ running: "is being identified", looking: "is being looked at", asks: ASKS, done: `${x.law ? `law ${x.law}: ` : ""}${x.verdict}` }[x.state] ?? (x.problem || x.state))],
  ["settings", "Settings", "setting", "None yet: open a model and ask for a setting.", (x) => x.state === "running" ? "is being simulated" : x.state === "done" ? (x.chosen ? x.words : "no compensator is recommended") : x.problem || x.state],
  ["studies", "Studies", "study", "", (x) => ({ running: "runs", looking: "is being looked at", asks: ASKS, ready: "has not run yet", done: "has run" }[x.state] ?? (x.problem || x.state))],
  ["rigs", "Rigs", "rig", "", (x) => ({ looking: "is being looked at", asks: ASKS, ready: (x.facts ?? []).slice(0, -1).join(", ") }[x.state] ?? (x.problem || x.state))],
];

export async function show(box) {
  const project = store.project;
  box.append(h("h1", {}, project.name), zone());
  for (const [kind, title, view, none, words] of KINDS) {
    const items = project[kind];
    if (!items.length && !none) continue;
    box.append(h("section", {}, h("h2", {}, title), items.length
      ? h("ul", { class: "cards" }, items.map((item) => card(kind, view, item, words(item))))
      : h("p", { class: "hint" }, none)));
  }
  box.append(h("p", { class: "hint" }, "This project is the folder ", h("code", {}, project.folder)));
}

function card(kind, view, item, words) {
  const line = h("li", {}, h("a", { href: link(view, item.id) }, item.name), h("p", {}, words),
    h("p", { class: "hint" }, new Date(item.made).toLocaleString()),
    h("button", { type: "button", class: "quiet", "aria-label": `Delete ${item.name}`, onclick: async () => {
      if (!confirm(`Delete ${item.name} and its files?`)) return;
      try {
        await remove(here(`/${kind}/${item.id}`));
        await refresh();
        dispatchEvent(new Event("stickslip-show"));
      } catch (error) {
        line.append(complaint(error));
      }
    } }, "Delete"));
  return line;
}
