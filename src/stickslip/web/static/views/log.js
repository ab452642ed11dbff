// A log: what is in it, what the doctor found, which part is used, and the way to an identification.

import { get, numbers, put } from "../api.js";
import { complaint, field, fill, h, number, values } from "../dom.js";
import { run } from "../jobs.js";
import { picture, signals } from "../plot.js";
import { here, link, store } from "../store.js";
import { form as identifyForm } from "./identify_form.js";
import { mapping } from "./mapping_form.js";

const LEVELS = { error: "Error", warning: "Warning", note: "Note" };

export async function show(box, id) {
  const log = store.project.logs.find((l) => l.id === id);
  if (!log) {
    box.append(h("h1", {}, "This log has been deleted"), h("p", {}, h("a", { href: link() }, "Back to the project")));
    return undefined;
  }
  const heading = h("h1", {}, log.name);
  const job = store.project.jobs.find((j) => j.item === id && !["done", "failed", "cancelled"].includes(j.state));
  if (log.state === "looking" && job) return early(box, heading, log, job);
  if (["reading", "coming", "looking"].includes(log.state)) {
    box.append(heading, h("p", {}, job ? "This log is being read." : "The server stopped while it was reading this log; drop it again."));
    if (job) run(job.id, job.title).then(() => dispatchEvent(new Event("stickslip-show")));
    return undefined;
  }
  const again = async (reading) => {
    const { job } = await put(here(`/logs/${id}/reading`), reading);
    await run(job, `Reading ${log.name}`);
    dispatchEvent(new Event("stickslip-show"));
  };
  if (!log.readable) {
    box.append(heading, h("p", { class: "problem", role: "alert" }, log.problem),
      log.columns?.length ? h("section", {}, h("h2", {}, "Columns and units"), mapping(log, again)) : h("p", {}, h("a", { href: link() }, "Give another file")));
    return undefined;
  }
  box.append(heading, facts(log));
  const { planes } = (await get(here(`/logs/${id}`))).result;
  const plots = charts(log);
  if (seen.has(id)) plots.show(seen.get(id));
  seen.delete(id);
  box.append(findings(log, plots), identify(log), h("section", { class: "signals" }, h("h2", {}, "Signals"), plots.bar, plots.all.map((p) => p.figure)), cut(log, plots, again),
    torque(planes, plots), h("section", {}, h("h2", {}, "Columns and units"), chosen(log), mapping(log, again)));
  return () => plots.destroy();
}

function facts({ format, view }) {
  const span = view.ends[1] - view.ends[0];
  return h("p", { class: "facts" }, `${format}, ${view.rows} rows`
    + (view.by === "time" ? ` over ${number(span)} s${span > 0 ? `, ${number((view.rows - 1) / span)} Hz` : ""}` : "; times are not increasing, so rows are counted"));
}

// What was looked at of a log while the doctor was at work; it stays in sight when he has done.
const seen = new Map();

// A long log while the doctor looks at it: its signals, and nothing to decide yet.
async function early(box, heading, log, job) {
  const { planes } = (await get(here(`/logs/${log.id}`))).result;
  const plots = charts(log);
  box.append(heading, facts(log), h("p", { class: "hint" }, "The doctor is checking this log; its findings and the next step appear here."),
    h("section", { class: "signals" }, h("h2", {}, "Signals"), plots.bar, plots.all.map((p) => p.figure)), torque(planes, plots));
  run(job.id, job.title).then(() => {
    if (!box.isConnected) return;
    seen.set(log.id, plots.shown());
    dispatchEvent(new Event("stickslip-show"));
  });
  return () => plots.destroy();
}

// ---- plots ---------------------------------------------------------------------------------------------------------

function groups(channels) {
  const out = new Map();
  channels.forEach((channel, place) => {
    const kind = channel.name.replace(/_reference$/, "");
    const key = `${kind} ${channel.unit}`;
    if (!out.has(key)) out.set(key, { unit: channel.unit, kind, channels: [] });
    out.get(key).channels.push({ ...channel, place });
  });
  return [...out.values()];
}

function charts(log) {
  const { view } = log;
  const xLabel = view.by === "time" ? "time (s)" : "row";
  const all = [];
  const marks = log.findings.map((f) => ({ ...stretch(f.where, view), level: f.level })).filter((m) => m.from !== undefined);
  const listeners = [];
  let shown = [...view.ends];
  const show = (range) => {
    shown = range;
    all.forEach((p) => p.show(range));
  };
  const select = (range) => {
    all.forEach((p) => p.select(range));
    listeners.forEach((f) => f(range));
  };
  // All plots show the same stretch: it is asked for once, every channel in it.
  let asked = ["", null];
  const stretchOf = (from, to, bins) => {
    const query = `from=${from}&to=${to}&bins=${bins}`;
    if (asked[0] !== query) asked = [query, numbers(here(`/logs/${log.id}/samples?${query}`))];
    return asked[1];
  };
  for (const group of groups(view.channels)) {
    all.push(signals({
      title: group.kind.replaceAll("_", " "), xLabel, unit: group.unit, channels: group.channels, ends: view.ends, marks,
      onrange: show, onselect: select, height: group.kind.includes("position") || group.kind.includes("torque") ? 210 : 150,
      load: async (from, to, bins) => unpacked(await stretchOf(from, to, bins), group.channels.map((c) => c.place)),
    }));
  }
  const first = all[0];
  const bar = h("div", { class: "row tools" },
    h("button", { type: "button", onclick: () => first?.zoom(0.5) }, "Zoom in"), h("button", { type: "button", onclick: () => first?.zoom(2) }, "Zoom out"),
    h("button", { type: "button", onclick: () => first?.pan(-0.3) }, "Earlier"), h("button", { type: "button", onclick: () => first?.pan(0.3) }, "Later"),
    h("button", { type: "button", onclick: () => show(view.ends) }, "All"),
    h("p", { class: "hint" }, "Drag across a plot to select a part. Click a plot, then use the wheel or the keys + − ← →."));
  const extra = [];
  return { all, bar, show, select, view, xLabel, extra, shown: () => shown, onselect: (f) => listeners.push(f),
    destroy() { [...all, ...extra].forEach((p) => p.destroy()); } };
}

function unpacked(data, places) {
  const [n, , samples, whole] = data;
  const part = (i) => data.subarray(4 + i * n, 4 + (i + 1) * n);
  return { x: part(0), count: samples, whole: whole === 1, series: places.map((c) => [part(1 + 2 * c), part(2 + 2 * c)]) };
}

// Where a finding is, on the plot's axis: from its time, or its rows.
function stretch(where, view) {
  const time = /t = (-?[\d.]+(?:e[+-]?\d+)?)(?: (?:to|s to) (-?[\d.]+(?:e[+-]?\d+)?))? s/.exec(where);
  if (time && view.by === "time") return { from: Number(time[1]), to: Number(time[2] ?? time[1]) };
  const rows = /rows? (\d+)(?:(?::| to )(\d+))?/.exec(where);
  if (!rows) return {};
  const place = (row) => view.by === "row" ? row : view.ends[0] + ((row - 1) / Math.max(1, view.rows - 1)) * (view.ends[1] - view.ends[0]);
  return { from: place(Number(rows[1])), to: place(Number(rows[2] ?? rows[1])) };
}

// The form of columns and units, open and in view.
function showMapping() {
  const form = document.querySelector(".mapping").closest("details");
  form.open = true;
  form.scrollIntoView({ block: "start" });
  form.querySelector("select").focus({ preventScroll: true });
}

function findings(log, plots) {
  const items = log.findings.map((f) => {
    const place = stretch(f.where, log.view);
    const look = place.from !== undefined && h("button", { type: "button", class: "quiet", onclick: () => {
      const room = Math.max(0.02 * (log.view.ends[1] - log.view.ends[0]), 1.5 * (place.to - place.from));
      plots.show([Math.max(log.view.ends[0], place.from - room), Math.min(log.view.ends[1], place.to + room)]);
      plots.all[0]?.canvas.scrollIntoView({ block: "center" });
    } }, "Show");
    const correct = (f.level === "error" || f.remedy.includes("Columns and units")) && h("button", { type: "button", class: "quiet", onclick: showMapping }, "Correct it");
    return h("li", { class: f.level }, h("strong", {}, `${LEVELS[f.level]}: `), f.message, f.where ? ` (${f.where})` : "", f.remedy ? h("span", { class: "remedy" }, ` – ${f.remedy}`) : "", " ", look, correct);
  });
  const count = (level) => log.findings.filter((f) => f.level === level).length;
  const words = log.errors ? `${log.errors} error${log.errors > 1 ? "s" : ""}: this log cannot be used yet.`
    : count("warning") ? `No error, ${count("warning")} warning${count("warning") > 1 ? "s" : ""}.` : "No problems found in this log.";
  return h("section", { class: "findings" }, h("h2", {}, "Findings of the doctor"), h("p", { class: log.errors ? "bad" : count("warning") ? "fair" : "good" }, words),
    items.length ? h("ul", {}, items) : "");
}

// ---- which part is used ----------------------------------------------------------------------------------------------

function cut(log, plots, again) {
  const reading = log.reading;
  const state = h("div");
  const form = h("form", { class: "row", onsubmit: (event) => event.preventDefault() },
    field("From", "start", { type: "number", step: "any", value: "" }), field("to", "end", { type: "number", step: "any", value: "" }));
  const range = () => {
    const { start, end } = values(form);
    return start === undefined || end === undefined ? null : [Math.min(start, end), Math.max(start, end)];
  };
  form.addEventListener("input", () => plots.all.forEach((p) => p.select(range())));
  plots.onselect((r) => {
    form.elements.start.value = r[0].toPrecision(7);
    form.elements.end.value = r[1].toPrecision(7);
  });
  const act = (change) => async () => {
    const chosen = range();
    if (!chosen) return fill(state, h("p", { class: "problem", role: "alert" }, "Drag across a plot, or give both numbers."));
    try {
      await again(change(chosen));
    } catch (error) {
      fill(state, complaint(error));
    }
    return undefined;
  };
  const unit = log.view.by === "time" ? "s" : "rows";
  const rows = (r) => log.view.by === "row" ? r.map(Math.round) : r.map((t) => Math.max(1, Math.round(1 + ((t - log.view.ends[0]) / (log.view.ends[1] - log.view.ends[0])) * (log.view.rows - 1))));
  // Rows count those of the file: where a part was left out already, they cannot be distinguished from the times.
  const partial = (reading.leave_out ?? []).length > 0 || reading.start !== undefined;
  const parts = [];
  if (reading.start !== undefined) parts.push(`from ${number(reading.start, 6)} to ${number(reading.end, 6)} s is used`);
  for (const r of reading.leave_out ?? []) parts.push(r === "spikes" ? "spikes are left out" : `rows ${r} are left out`);
  if (reading.unwrap) parts.push("the position is unwrapped at jumps");
  const spikes = log.findings.some((f) => f.code === "spikes" || f.message.includes("spikes"));
  const jumps = log.findings.some((f) => f.code === "position-wrap" || f.code === "position-jump");
  return h("section", { class: "cut" }, h("h2", {}, "Part of the log in use"),
    h("p", {}, parts.length ? `${parts.join("; ")}.` : "The whole log."), form, h("p", { class: "hint" }, `In ${unit}. Nothing is left out automatically.`),
    h("div", { class: "row" },
      h("button", { type: "button", onclick: () => range() && plots.show(range()) }, "Zoom to it"),
      log.view.by === "time" && h("button", { type: "button", onclick: act((r) => ({ ...reading, start: r[0], end: r[1] })) }, "Use only this part"),
      !partial && h("button", { type: "button", onclick: act((r) => ({ ...reading, leave_out: [rows(r).join(":")] })) }, "Leave this part out"),
      spikes && h("button", { type: "button", onclick: () => again({ ...reading, leave_out: [...(reading.leave_out ?? []), "spikes"] }) }, "Leave spikes out"),
      jumps && h("button", { type: "button", onclick: () => again({ ...reading, unwrap: true }) }, "Count the position on"),
      parts.length > 0 && h("button", { type: "button", onclick: () => again({ ...reading, start: undefined, end: undefined, leave_out: [], unwrap: false }) }, "Use the whole log again")),
    state);
}

// ---- beside the signals ----------------------------------------------------------------------------------------------

function torque(planes, plots) {
  const made = planes.filter((p) => p.x.length).map((p) => picture({
    title: `${p.y_name.replaceAll("_", " ")} against ${p.x_name}`, x_label: `${p.x_name} (${p.x_unit})`, y_label: `${p.y_name.replaceAll("_", " ")} (${p.y_unit})`,
    message: "All samples", traces: [{ label: "", kind: "cloud", x: p.x, y: p.y }], height: 260,
  }));
  plots.extra.push(...made);
  return made.length ? h("section", {}, h("h2", {}, "Torque"), h("div", { class: "pair" }, made.map((p) => p.figure))) : "";
}

function chosen(log) {
  const BY = { map: "you", profile: "profile", file: "the file's unit", name: "the column's name", drive: "a number of the drive", assumed: "assumed" };
  return h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Columns and units" }, h("table", {}, h("thead", {}, h("tr", {}, ["channel", "column", "unit", "source of the unit"].map((t) => h("th", { scope: "col" }, t)))),
    h("tbody", {}, log.chosen.map((c) => h("tr", {}, h("td", {}, c.channel.replaceAll("_", " ")), h("td", {}, c.column), h("td", {}, c.unit), h("td", { class: c.source === "assumed" ? "fair" : "" }, BY[c.source] ?? c.source))))));
}

const FORCES = ["motor_torque", "friction_torque", "sensor_torque", "current"];

function identify(log) {
  if (!log.errors && !log.view.channels.some((c) => FORCES.includes(c.name))) {
    const drive = log.view.channels.some((c) => c.name === "voltage");
    const reference = log.view.channels.some((c) => c.name === "position_reference");
    return h("section", { class: "next" }, h("h2", {}, "Identify its friction"), h("p", {}, "This log has no torque, force or current, which identification requires. If one of its columns contains it, select it."),
      h("button", { type: "button", class: "main", onclick: showMapping }, "Choose the column"),
      drive || reference ? h("details", {}, h("summary", {}, "Without one"),
        h("p", {}, drive ? "From the drive's voltage, with the torque per unit of the signal. " : "", reference ? "From the reference of the position, with the gains of the drive's loop (kp=8,kd=0.08)." : ""),
        identifyForm([log.id], true)) : "");
  }
  return h("section", { class: "next" }, h("h2", {}, "Identify its friction"),
    log.errors ? h("p", {}, "Fix the error below first, or use another log.") : identifyForm([log.id]));
}
