// What to switch on, why, and its download for a machine or a simulator.

import { get, post } from "../api.js";
import { coded, complaint, copyable, field, fill, h, number, values } from "../dom.js";
import { run } from "../jobs.js";
import { here, link, store } from "../store.js";

export async function show(box, id) {
  const [setting, { targets }] = await Promise.all([get(here(`/settings/${id}`)), get("/targets")]);
  box.append(h("h1", {}, setting.name));
  const job = store.project.jobs.find((j) => j.item === id && ["waiting", "running"].includes(j.state));
  if (job && job.kind === "recommend") {
    box.append(h("p", {}, "Candidates are being simulated."));
    run(job.id, job.title).then(() => dispatchEvent(new Event("stickslip-show")));
    return;
  }
  const model = store.project.models.find((m) => m.id === setting.model);
  const back = h("p", {}, model ? h("a", { href: link("model", model.id) }, `For the model ${model.name}`) : "Its model has been deleted.");
  if (setting.state !== "done") {
    box.append(h("p", { class: "problem", role: "alert" }, setting.state === "running" ? "The server stopped during the simulation." : setting.problem || setting.state), back);
    return;
  }
  const found = setting.result;
  box.append(back, headline(found), found.chosen ? download(setting, targets) : "", candidates(found),
    h("section", {}, h("h2", {}, "Assumptions and caveats"), h("ul", {}, found.notes.map((n) => h("li", {}, n)))),
    h("details", {}, h("summary", {}, "Output of the command line"), h("pre", { tabindex: 0 }, found.text)));
}

// Units by name; a result of an earlier version has none.
const unitOf = (found, name) => (found.units?.[name] ?? "").replace(/^-$/, "");

function headline(found) {
  if (!found.chosen) {
    return h("section", { class: "verdict" }, h("h2", {}, "No compensator is recommended"), found.linear_alone_rings ? h("p", {}, found.linear_alone_rings) : "");
  }
  const c = found.chosen;
  const law = [["law", found.model.law, ""], ...Object.entries(found.model).filter(([k, v]) => k !== "law" && typeof v === "number").map(([k, v]) => [k, v, unitOf(found, k)]),
    ["gain", c.gain, ""], ["lead", c.lead, "s"], ["deadband", c.deadband, unitOf(found, "velocity")]];
  const numbers = [...(c.gain === 0 ? [] : law), ["inertia feedforward", c.inertia_feedforward, unitOf(found, "inertia")], ["offset", c.offset, unitOf(found, "torque")]].filter(([, v]) => v !== undefined);
  const [least, most] = found.reduction;
  const alone = c.gain === 0;
  const fed = found.inertia_alone && !alone && !found.inertia_alone.unsafe.length ? ` Of this, inertia feedforward alone gives ${Math.round(100 * Math.max(1 - found.inertia_alone.errors[0], 0))} % on the best estimate.` : "";
  return h("section", { class: "verdict" }, h("h2", {}, alone ? "Switch on: inertia feedforward alone, without friction compensation" : `Switch on: ${c.kind} of the law ${found.model.law}, gain ${number(c.gain)}`),
    h("p", { class: "big" }, `Expected error reduction ${Math.round(100 * least)} to ${Math.round(100 * most)} % (${Math.round(100 * found.reduction_confidence)} % interval).${fed}`),
    h("ul", { class: "numbers" }, numbers.map(([name, value, unit]) => h("li", {}, `${name} `, copyable(typeof value === "number" ? number(value, 5) : value, value, name), ` ${unit}`))),
    h("p", { class: "row" }, h("a", { class: "button", href: `/api${here(`/settings/${location.hash.split("/").pop()}/toml`)}`, download: "recommended.toml" }, "Download recommended.toml")));
}

function candidates(found) {
  const percent = (v) => (v === null || v === undefined ? "unknown" : `${(100 * v).toFixed(1)} %`);
  const same = (c) => found.chosen && ["law", "kind", "gain", "lead", "deadband"].every((k) => c[k] === found.chosen[k]);
  return h("section", {}, h("h2", {}, "All candidates"), h("p", { class: "hint" }, `On up to ${found.axes} axes within the intervals; errors relative to the linear controller alone.`),
    h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Candidates" }, h("table", {}, h("thead", {}, h("tr", {}, ["law", "structure", "gain", `deadband (${unitOf(found, "velocity") || "rad/s"})`, "remaining error", "worst", "safe"].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, found.candidates.map((c) => h("tr", { class: same(c) ? "chosen" : "" }, h("th", { scope: "row" }, (c.gain === 0 ? "inertia alone" : c.law) + (same(c) ? " (recommended)" : "")), h("td", {}, c.kind), h("td", {}, number(c.gain)), h("td", {}, number(c.deadband)),
        h("td", {}, percent(c.errors[0])), h("td", {}, c.finished === false ? "–" : percent(Math.max(...c.errors))), h("td", { class: c.unsafe.length ? "bad text" : c.finished === false ? "" : "good" }, c.finished === false ? "stopped: another one has a smaller error" : c.unsafe.length ? `no: ${c.unsafe.join(", ")}` : c.useless ? `yes, but ${c.useless}` : "yes")))))));
}

function download(setting, targets) {
  const state = h("div");
  const explained = h("div", { class: "hint" });
  const extra = h("div", { class: "grid" });
  const button = h("button", { class: "main", type: "submit" }, "Download (.zip)");
  const form = h("form", { onsubmit: async (event) => {
    event.preventDefault();
    button.disabled = true;
    fill(state);
    try {
      const given = values(form);
      const target = targets.find((t) => t.name === given.to);
      const settings = Object.fromEntries(Object.entries(given).filter(([k]) => k.startsWith("set-")).map(([k, v]) => [k.slice(4), v]));
      const { job } = await post(here("/exports"), { setting: setting.id, to: given.to, compensator: target.compensator, nearest: given.nearest, settings });
      const line = await run(job, `Exporting for ${target.title}`);
      if (line.end !== "done") throw new Error(line.error || line.end);
      const link = h("a", { class: "button main", href: `/api${here(`/exports/${job}`)}`, download: line.result.file }, `Download ${line.result.file}`);
      fill(state, h("p", {}, link), h("p", { class: "hint" }, `In it: ${line.result.files.join(", ")}`), h("ul", {}, line.result.notes.map((n) => h("li", {}, n))));
      link.focus();
    } catch (error) {
      fill(state, complaint(error));
    }
    button.disabled = false;
  } });
  const choice = field("For", "to", { options: targets.map((t) => [t.name, t.title]), value: "c99" });
  const explain = () => {
    const t = targets.find((x) => x.name === form.elements.to.value);
    fill(explained, h("p", {}, coded(`Exports ${t.carries}.`), `${t.compensator ? " The whole compensator is included." : " Only the law is included: gain, lead, deadband and additional torques are lost."}${t.tried ? ` Tested with ${t.tried}.` : ""}`));
    fill(extra, t.settings.map((s) => field(s.meaning, `set-${s.name}`, { placeholder: s.default === null ? "must be given" : String(s.default) })),
      t.any_law ? "" : field("Take the nearest that it can hold, and say the error", "nearest", { type: "checkbox", checked: true }));
  };
  form.append(choice, explained, extra, h("div", { class: "row" }, button), state);
  form.elements.to.addEventListener("change", explain);
  explain();
  return h("section", { class: "next" }, h("h2", {}, "Export for your machine"), form,
    h("details", {}, h("summary", {}, "Compare targets"), h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Targets" }, h("table", {}, h("thead", {}, h("tr", {}, ["target", "law", "compensator"].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, targets.map((t) => h("tr", {}, h("th", { scope: "row" }, t.title), h("td", { class: "text" }, coded(t.carries)), h("td", {}, t.compensator ? "included" : "only the law"))))))));
}
