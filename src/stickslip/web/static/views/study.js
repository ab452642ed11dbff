// A study or a simulation that was sent: what it would run, and what came of it.

import { get, post } from "../api.js";
import { complaint, fill, h, number } from "../dom.js";
import { run } from "../jobs.js";
import { metricName, unitOf } from "../metrics.js";
import { picture } from "../plot.js";
import { here, link, store } from "../store.js";
import { ask } from "./ask.js";

export async function show(box, id) {
  const study = await get(here(`/studies/${id}`));
  box.append(h("h1", {}, study.name), h("p", { class: "facts" }, `Sent: ${study.sent.join(", ")}`));
  const job = store.project.jobs.find((j) => j.item === id && ["waiting", "running"].includes(j.state));
  if (job) {
    box.append(h("p", {}, job.kind === "look" ? "It is being read." : "It is running."));
    run(job.id, job.title).then(() => dispatchEvent(new Event("stickslip-show")));
    return undefined;
  }
  if (study.state === "asks") {
    box.append(ask("studies", study));
    return undefined;
  }
  if (["failed", "cancelled", "looking", "running"].includes(study.state)) {
    const why = { cancelled: "It was cancelled; finished runs are kept.", failed: study.problem }[study.state] ?? "The server stopped meanwhile.";
    box.append(h("p", { class: "problem", role: "alert" }, why));
  }
  const plots = [];
  box.append(begin(study));
  if (study.result.simulation) box.append(simulation(study.result.simulation, plots));
  if (study.result.study) box.append(table(study));
  box.append(h("p", {}, h("a", { href: link() }, "Back to the project")));
  return () => plots.forEach((p) => p.destroy());
}

function begin(study) {
  const state = h("div");
  const button = h("button", { type: "button", class: "main", onclick: async () => {
    button.disabled = true;
    try {
      const { job } = await post(here(`/studies/${study.id}/run`));
      await run(job, `Running ${study.name}`);
      dispatchEvent(new Event("stickslip-show"));
    } catch (error) {
      fill(state, complaint(error));
      button.disabled = false;
    }
  } }, study.state === "done" ? "Run again" : "Run");
  const size = study.runs === undefined ? "" : `${study.runs} run${study.runs === 1 ? "" : "s"}, ${number(study.runs_for)} s simulated in all.`;
  return h("section", { class: "next" }, h("div", { class: "row" }, button, h("p", { class: "hint" }, size)), state);
}

function simulation(found, plots) {
  const drawn = ["error", "position", "motor_torque"].filter((name) => found.channels[name]).map((name) => {
    const title = name.replaceAll("_", " ");
    const made = picture({ title, x_label: "time (s)", y_label: `${title} (${found.units[name]})`, height: 220,
      traces: [{ label: "", kind: "line", x: found.time, y: found.channels[name] }] });
    plots.push(made);
    return made.figure;
  });
  const names = Object.keys(found.metrics).filter((k) => found.metrics[k] !== null);
  return h("section", {}, h("h2", {}, "Results"), h("div", { class: "pair" }, drawn),
    h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Metrics" }, h("table", {}, h("thead", {}, h("tr", {}, ["metric", "value", "unit"].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, names.map((k) => h("tr", {}, h("th", { scope: "row" }, metricName(k)), h("td", {}, number(found.metrics[k])), h("td", {}, unitOf(k))))))));
}

function table(study) {
  const { metrics, runs } = study.result.study;
  const base = `/api${here(`/studies/${study.id}/report`)}`;
  return h("section", {}, h("h2", {}, "Results"),
    h("p", { class: "row" }, h("a", { class: "button", href: `${base}?show=1`, target: "_blank", rel: "noopener" }, "Open the report"), h("a", { class: "button", href: base, download: "report.html" }, "Download the report")),
    h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Runs" }, h("table", {},
      h("thead", {}, h("tr", {}, ["run", ...metrics.map((m) => `${metricName(m)}${unitOf(m) ? ` (${unitOf(m)})` : ""}`)].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, runs.map((r) => h("tr", {}, h("th", { scope: "row" }, r.key), r.failure ? h("td", { class: "bad text", colSpan: metrics.length }, r.failure) : r.metrics.map((v) => h("td", {}, number(v)))))))));
}
