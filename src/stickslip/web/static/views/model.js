// What was identified: the verdict first, then the curve, the fit, every number, and the way to a setting.

import { get } from "../api.js";
import { copyable, h, number } from "../dom.js";
import { run } from "../jobs.js";
import { picture } from "../plot.js";
import { here, link, store } from "../store.js";
import { ask } from "./ask.js";
import { form as settingForm } from "./setting_form.js";

export async function show(box, id) {
  const model = await get(here(`/models/${id}`));
  box.append(h("h1", {}, model.name));
  const job = store.project.jobs.find((j) => j.item === id && ["waiting", "running"].includes(j.state));
  if (job) {
    box.append(h("p", {}, model.sent ? "It is being read." : "This is being identified."));
    run(job.id, job.title).then(() => dispatchEvent(new Event("stickslip-show")));
    return undefined;
  }
  if (model.state === "asks") {
    box.append(ask("models", model));
    return undefined;
  }
  if (model.state !== "done") {
    const why = ["running", "looking"].includes(model.state) ? "the server stopped meanwhile; start again" : model.problem || model.state;
    box.append(h("p", { class: "problem", role: "alert" }, model.sent ? `It cannot be used: ${why}` : `Nothing was identified: ${why}`),
      h("p", {}, model.logs?.length ? h("a", { href: link("log", model.logs[0]) }, "Back to the log") : ""));
    return undefined;
  }
  const found = model.result;
  if (model.sent) {
    box.append(...sent(model));
    return undefined;
  }
  const plots = [];
  box.append(verdicts(found), h("p", { class: "row" },
    h("a", { class: "button", href: `/api${here(`/models/${id}/report?show=1`)}`, target: "_blank", rel: "noopener" }, "Open the report"),
    h("a", { class: "button", href: `/api${here(`/models/${id}/report`)}`, download: "report.html" }, "Download the report"),
    model.has_model && h("a", { class: "button", href: `/api${here(`/models/${id}/toml`)}`, download: "model.toml" }, "Download model.toml"),
    model.has_model && found.axis && h("a", { class: "button", href: link("workbench", id) }, "Try it in the workbench")));
  if (model.has_model) box.append(next(model, found));
  const [first, rest] = sorted(found.pictures);
  const drawn = (p, height) => { const made = picture({ ...p, height }); plots.push(made); return made.figure; };
  if (first.length) box.append(h("section", {}, h("h2", {}, "The friction and the fit"), h("div", { class: "pair" }, first.map((p) => drawn(p, 320)))));
  box.append(numbers(found));
  if (rest.length) box.append(h("section", {}, h("h2", {}, "Residuals"), h("div", { class: "pair" }, rest.map((p) => drawn(p, 300)))));
  box.append(notes(found, model));
  return () => plots.forEach((p) => p.destroy());
}

// The way to a setting; where no number is known, another record comes first.
function next(model, found) {
  const form = settingForm(model, true, found.axis);
  const known = found.estimates.some((e) => e.identified);
  return h("section", { class: "next" }, h("h2", {}, "Recommend a compensation"), known ? form
    : [h("p", {}, "This log determines none of the numbers, so a setting would be a guess. First record:"),
      h("ul", {}, (found.measure_next.length ? found.measure_next : ["A record with sliding in both directions at several speeds."]).map((t) => h("li", {}, t))),
      h("details", {}, h("summary", {}, "Try it anyway"), form)]);
}

// A model from a file: what it says, and the way to a setting.
function sent(model) {
  const found = model.result;
  const estimate = new Map(found.estimates.map((e) => [e.name, e]));
  const interval = (name) => {
    const e = estimate.get(name);
    return e && e.lower !== null && e.upper !== null ? `${number(e.lower, 5)} to ${number(e.upper, 5)}` : "unknown";
  };
  const several = (v) => (Array.isArray(v) ? v.map((x) => number(x, 5)).join(", ") : number(v, 5));
  const parameters = Object.entries(found.model).filter(([k]) => k in found.units).map(([k, v]) => [k, found.meanings[k], v, found.units[k]]);
  const { inertia } = found;
  if (inertia.value) parameters.unshift(["inertia", "inertia of the axis", inertia.value, inertia.unit]);
  return [h("p", { class: "facts" }, `From the file ${model.sent.join(", ")}: ${found.title}`),
    h("p", { class: "row" }, h("a", { class: "button", href: `/api${here(`/models/${model.id}/toml`)}`, download: "model.toml" }, "Download model.toml"),
      found.axis && found.registered && h("a", { class: "button", href: link("workbench", model.id) }, "Try it in the workbench")),
    h("section", { class: "next" }, h("h2", {}, "Recommend a compensation"), settingForm(model, found.trajectory, found.axis)),
    h("section", {}, h("h2", {}, "Numbers"), h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Parameters" }, h("table", {},
      h("thead", {}, h("tr", {}, ["parameter", "meaning", "value", "95 % interval", "unit"].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, parameters.map(([name, meaning, value, unit]) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, meaning), h("td", {}, copyable(several(value), value, name)), h("td", {}, interval(name)), h("td", {}, unit === "-" ? "" : unit)))))))];
}

const HEAD = ["sliding-curve", "torque-stretch", "torque-velocity"];

function sorted(pictures) {
  const head = pictures.filter((p) => HEAD.includes(p.name));
  const first = head.length ? head : pictures.slice(0, 1);
  return [first, pictures.filter((p) => !first.includes(p))];
}

function verdicts(found) {
  const known = found.estimates.filter((e) => e.identified);
  const open = found.estimates.filter((e) => !e.identified);
  const interval = (e) => (e.lower === null || e.upper === null ? "interval unknown" : `${number(e.lower)} to ${number(e.upper)}`);
  return h("section", { class: "verdicts" },
    h("div", { class: "verdict" }, h("h2", {}, "Can it be trusted?"), h("p", { class: "big" }, found.answers.trust), h("ul", {}, found.answers.evidence.map((t) => h("li", {}, t)))),
    h("div", { class: "verdict" }, h("h2", {}, "Identified"), found.answers.friction.map((t) => h("p", {}, t)),
      known.length ? h("ul", {}, known.map((e) => h("li", {}, `${e.name} = ${number(e.value)} ${e.unit} (${interval(e)})`))) : h("p", {}, "Nothing is identified.")),
    h("div", { class: "verdict" }, h("h2", {}, "Not identified"),
      open.length ? h("ul", {}, open.map((e) => h("li", {}, `${e.name}: ${e.verdict || "the data do not determine it"}`))) : h("p", {}, found.held?.length ? "Every other number is identified." : "Every number is identified.")),
    h("div", { class: "verdict" }, h("h2", {}, "Next measurement"),
      found.measure_next.length ? h("ul", {}, found.measure_next.map((t) => h("li", {}, t))) : h("p", {}, "Nothing more is needed for this law.")));
}

function numbers(found) {
  const row = (e) => h("tr", {}, h("th", { scope: "row" }, e.name), h("td", {}, copyable(number(e.value, 5), e.value, e.name)),
    h("td", {}, e.lower === null || e.upper === null ? "unknown" : copyable(`${number(e.lower, 5)} to ${number(e.upper, 5)}`, `${e.lower} ${e.upper}`, `interval of ${e.name}`)),
    h("td", {}, e.unit), h("td", { class: e.identified ? "good" : "fair" }, e.identified ? "identified" : "not identified"));
  const given = (e) => h("tr", {}, h("th", { scope: "row" }, e.name), h("td", {}, copyable(number(e.value, 5), e.value, e.name)), h("td", {}), h("td", {}, e.unit), h("td", {}, "given"));
  const misfit = Object.entries(found.misfit).filter(([, v]) => v !== null);
  return h("section", {}, h("h2", {}, "Numbers"),
    h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Parameters" }, h("table", {}, h("thead", {}, h("tr", {}, ["parameter", "value", "95 % interval", "unit", "verdict"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, found.estimates.map(row), (found.held ?? []).map(given)))),
    h("details", {}, h("summary", {}, "Misfit in numbers"), h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Misfit" }, h("table", {}, h("tbody", {}, misfit.map(([k, v]) => h("tr", {}, h("th", { scope: "row" }, k.replaceAll("_", " ")), h("td", {}, copyable(number(v, 5), v, k)))))))));
}

function notes(found, model) {
  const told = found.notes.filter((n) => !found.answers.told.includes(n));
  return h("section", {}, h("h2", {}, "Notes"), told.length ? h("ul", {}, told.map((n) => h("li", {}, n))) : h("p", {}, "None."),
    h("details", {}, h("summary", {}, "Output of the command line"), h("pre", { tabindex: 0 }, found.text)),
    h("p", {}, "From ", (model.logs ?? []).map((l, i) => [i ? ", " : "", h("a", { href: link("log", l) }, store.project.logs.find((x) => x.id === l)?.name ?? "a deleted log")])));
}
