// Has the friction changed between two models?

import { post } from "../api.js";
import { complaint, field, fill, h, number, values } from "../dom.js";
import { run } from "../jobs.js";
import { picture } from "../plot.js";
import { here, store } from "../store.js";

export async function show(box) {
  const models = store.project.models.filter((m) => m.has_model);
  box.append(h("h1", {}, "Has the friction changed?"));
  if (models.length < 2) {
    const coming = store.project.jobs.filter((j) => ["waiting", "running"].includes(j.state) && store.project.models.some((m) => m.id === j.item));
    const said = h("p", {}, `You need two complete models; this project has ${models.length === 1 ? "one" : "none"}. ${coming.length ? "Running identifications are added when they finish." : "Identify another log, or the rest of this one."}`);
    box.append(said);
    // Once, and only where this is still what is looked at: a view shown since keeps what was typed and compared there.
    Promise.race(coming.map((job) => run(job.id, job.title))).then(() => said.isConnected && dispatchEvent(new Event("stickslip-show")));
    return undefined;
  }
  let plot = null;
  const result = h("div");
  const options = models.map((m) => [m.id, `${m.name}: ${m.law}, ${new Date(m.made).toLocaleString()}`]);
  const button = h("button", { class: "main", type: "submit" }, "Compare");
  const form = h("form", { onsubmit: async (event) => {
    event.preventDefault();
    button.disabled = true;
    try {
      const { job } = await post(here("/comparisons"), values(form));
      const line = await run(job, "Comparing");
      if (line.end !== "done") throw new Error(line.error || line.end);
      plot?.destroy();
      plot = picture({ ...line.result.picture, height: 320 });
      fill(result, told(line.result), h("section", {}, plot.figure));
    } catch (error) {
      fill(result, complaint(error));
    }
    button.disabled = false;
  } }, h("div", { class: "grid broad" }, field("Before", "first", { options, value: models[0].id }), field("After", "second", { options, value: models.at(-1).id })), button);
  box.append(h("section", {}, form), result);
  return () => plot?.destroy();
}

function told(found) {
  const row = (c) => h("tr", {}, h("th", { scope: "row" }, c.name), h("td", {}, number(c.first)), h("td", {}, number(c.second)), h("td", {}, c.unit),
    h("td", {}, c.percent === null ? `${number(c.second - c.first)} ${c.unit}` : `${c.percent.toFixed(1).replace("-", "−")} %`), h("td", { class: c.changed ? "bad" : "good" }, c.changed ? "changed" : "no significant change"));
  const table = (title, rows) => rows.length ? [h("h3", {}, title), h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": title }, h("table", {}, h("thead", {}, h("tr", {}, ["quantity", "before", "after", "unit", "change", "verdict"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, rows.map(row))))] : [];
  return h("section", { class: "verdict" }, h("h2", {}, found.changed ? "Yes, it has changed" : "No significant change"), h("p", { class: "big" }, found.summary), table("Parameters", found.parameters), table("Torques", found.levels),
    h("ul", {}, found.notes.map((n) => h("li", {}, n))));
}
