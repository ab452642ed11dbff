// A closed loop in forms made from the descriptions of laws and references; what a slider changes is simulated at once.

import { get, post } from "../api.js";
import { add, complaint, fill, h, number } from "../dom.js";
import { metricName, unitOf } from "../metrics.js";
import { picture } from "../plot.js";
import { here } from "../store.js";

const START = {
  axis: { inertia: 3.8623e-4 }, friction: { law: "lugre", sigma0: 3.5e4, sigma1: 0.1, sigma2: 0.018, fs: 0.335, fc: 0.285, vs: 0.01 },
  reference: { kind: "sine", amplitude: 0.1, frequency: 0.4 }, duration: 2.5, believed: null,
  controller: { linear: "PD", bandwidth_hz: 20, damping: 1, compensator: "", gain: 1, sample_time: 0, encoder_counts: 0 },
};
const KINDS = { sine: { amplitude: 0.01, frequency: 0.4 }, plain_sine: { amplitude: 0.01, frequency: 0.4 }, step: { amplitude: 0.01 },
  ramp: { velocity: 0.05 }, scurve: { distance: 1, velocity: 2, acceleration: 20, jerk: 400 } };
const CONTROLLER = [["bandwidth_hz", "bandwidth", "Hz", true], ["damping", "damping of the poles", "", true], ["sample_time", "sample time (0: continuous)", "s", false],
  ["encoder_counts", "encoder, counts a revolution (0: exact)", "", false]];
const COMPENSATOR = [["gain", "gain of the compensator", "", true]];
const SHOWN = [["error", "Position error"], ["position", "Position"], ["motor_torque", "Motor torque"]];

function named(metric) {
  return unitOf(metric) ? `${metricName(metric)} (${unitOf(metric)})` : metricName(metric);
}

export async function show(box, model) {
  const forms = await get("/forms");
  const state = structuredClone(START);
  if (model) adopt(state, (await get(here(`/models/${model}`))).result);
  const status = h("p", { class: "hint", role: "status" });
  const plots = new Map();
  const pictures = h("div", { class: "pictures" });
  const table = h("div");
  const problem = h("div");
  const controls = h("div", { class: "controls" });
  const links = h("p", { class: "row" });
  let kept = [];
  let last = null;
  let busy = false;
  let again = false;

  async function simulate() {
    if (busy) { again = true; return; }
    busy = true;
    do {
      again = false;
      const began = performance.now();
      status.textContent = last ? status.textContent : "The first simulation of a law compiles it, which takes up to half a minute.";
      try {
        const found = await post("/simulations", state);
        last = { ...found, label: "now" };
        fill(problem);
        const took = performance.now() - began;
        status.textContent = took < 2000 ? `Simulated in ${Math.round(took)} ms.` : `Simulated in ${(took / 1000).toFixed(0)} s, including compilation of its law.`;
        status.dataset.ms = String(Math.round(performance.now() - began));
        draw();
      } catch (error) {
        fill(problem, complaint(error));
      }
    } while (again);
    busy = false;
  }

  function draw() {
    const runs = [...kept, last];
    for (const [name, title] of SHOWN) {
      const traces = runs.filter((r) => r.channels[name]).map((r) => ({ label: r.label, kind: "line", x: r.time, y: r.channels[name] }));
      if (!traces.length) continue;
      if (plots.has(name)) plots.get(name).update(traces);
      else {
        const made = picture({ title, x_label: "time (s)", y_label: `${title.toLowerCase()} (${last.units[name]})`, traces, height: 160 });
        plots.set(name, made);
        pictures.append(made.figure);
      }
    }
    const names = Object.keys(last.metrics).filter((k) => last.metrics[k] !== null);
    fill(table, h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Metrics" }, h("table", {}, h("thead", {}, h("tr", {}, ["metric", ...runs.map((r) => r.label)].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, names.map((k) => h("tr", {}, h("th", { scope: "row" }, named(k)), runs.map((r) => h("td", {}, number(r.metrics[k])))))))));
    const query = encodeURIComponent(JSON.stringify(state));
    fill(links, h("a", { class: "button", href: `/api/simulations/toml?case=${query}`, download: "case.toml" }, "Export as TOML"),
      h("a", { class: "button", href: `/api/simulations/python?case=${query}`, download: "case.py" }, "Export as Python"),
      h("button", { type: "button", onclick: () => { kept.push({ ...last, label: `run ${kept.length + 1}` }); kept = kept.slice(-3); draw(); } }, "Pin run"),
      kept.length ? h("button", { type: "button", onclick: () => { kept = []; draw(); } }, "Clear pinned runs") : "");
  }

  function forms_() {
    const law = forms.laws.find((l) => l.name === state.friction.law);
    const kind = forms.references.find((r) => r.name === state.reference.kind);
    const choose = (label, value, options, change) => {
      const id = `w-${label.replaceAll(" ", "-")}`;
      return h("div", { class: "field" }, h("label", { htmlFor: id, for: id }, label), h("select", { id, onchange: (e) => { change(e.target.value); forms_(); simulate(); } }, options.map(([v, t]) => h("option", { value: v, selected: v === value }, t))));
    };
    const fields = (target, list) => list.map((f) => f.list ? several(target, f, simulate) : slider(target, f, simulate));
    const plain = (list, target) => fields(target, list.map(([name, meaning, unit, positive]) => ({ name, meaning, unit, positive, lower: positive ? undefined : 0, default: 0 })));
    fill(controls,
      group("Axis", slider(state.axis, { name: "inertia", meaning: "inertia", unit: "kg·m²", positive: true }, simulate)),
      group("Friction", choose("Law", law.name, forms.laws.map((l) => [l.name, l.title]), (name) => { state.friction = { law: name, ...plainExample(forms.laws.find((l) => l.name === name)) }; state.believed = null; }), fields(state.friction, law.fields)),
      group("Reference", choose("Motion", kind.name, forms.references.filter((r) => KINDS[r.name]).map((r) => [r.name, r.title]), (name) => { state.reference = { kind: name, ...KINDS[name] }; }), fields(state.reference, kind.fields),
        slider(state, { name: "duration", meaning: "duration", unit: "s", positive: true, upper: 20 }, simulate)),
      group("Controller", choose("Linear part", state.controller.linear, [["PD", "PD"], ["PID", "PID"], ["PR", "PR"]], (v) => { state.controller.linear = v; }), plain(CONTROLLER, state.controller),
        choose("Compensator", state.controller.compensator, [["", "none"], ["feedforward", "feedforward"], ["feedback", "feedback"]], (v) => { state.controller.compensator = v; }),
        state.controller.compensator ? [plain(COMPENSATOR, state.controller), h("p", { class: "hint" }, "The compensator uses the friction above unless you freeze its model:"),
          h("button", { type: "button", onclick: () => { state.believed = state.believed ? null : structuredClone(state.friction); forms_(); simulate(); } }, state.believed ? "Use the friction above again" : "Freeze its model")] : ""));
  }

  forms_();
  box.append(h("h1", {}, "Workbench"), h("div", { class: "bench" }, controls, h("div", { class: "seen" }, status, problem, links, pictures, h("h2", {}, "Metrics"), table)));
  simulate();
  return () => plots.forEach((p) => p.destroy());
}

function adopt(state, found) {
  const { law, ...rest } = found.model;
  state.friction = { law, ...Object.fromEntries(Object.entries(rest).filter(([, v]) => typeof v === "number" || Array.isArray(v))) };
  const inertia = found.estimates.find((e) => e.name === "inertia")?.value;
  if (inertia) state.axis.inertia = inertia;
  state.reference.amplitude = 0.5;
  state.controller.compensator = "feedforward";
}

const plainExample = (law) => Object.fromEntries(law.fields.map((f) => [f.name, law.example[f.name] ?? f.default]).filter(([, v]) => v !== undefined && v !== null));

function group(title, ...children) {
  return add(h("fieldset", {}, h("legend", {}, title)), children);
}

// A number with a slider: over two decades around it where it must be positive, else over its size.
function slider(target, f, changed) {
  const id = `s-${f.name}`;
  const value = target[f.name] ?? f.default ?? 0;
  const log = f.positive && value > 0;
  const least = log ? Math.log10(value) - 1 : Math.max(f.lower ?? -Infinity, value - 2 * (Math.abs(value) || 1));
  const most = log ? Math.min(Math.log10(f.upper ?? Infinity), Math.log10(value) + 1) : Math.min(f.upper ?? Infinity, value + 2 * (Math.abs(value) || 1));
  const name = f.meaning || f.name;
  const number_ = h("input", { id, type: "number", step: "any", value, oninput: () => {
    const v = Number(number_.value);
    if (number_.value === "" || Number.isNaN(v)) return;
    target[f.name] = v;
    range.value = log && v > 0 ? Math.log10(v) : v;
    changed();
  } });
  const range = h("input", { type: "range", min: least, max: most, step: (most - least) / 400, value: log ? Math.log10(value) : value, "aria-label": `${name}, slider`, oninput: () => {
    const v = Number((log ? 10 ** range.value : Number(range.value)).toPrecision(4));
    target[f.name] = v;
    number_.value = v;
    range.setAttribute("aria-valuetext", `${number(v)} ${f.unit}`);
    changed();
  } });
  range.value = log ? Math.log10(value) : value; // after its ends are known
  return h("div", { class: "field slider" }, h("label", { htmlFor: id, for: id }, `${name}${f.unit && f.unit !== "-" ? ` (${f.unit})` : ""}`), number_, range);
}

function several(target, f, changed) {
  const id = `s-${f.name}`;
  const input = h("input", { id, value: (target[f.name] ?? []).join(", "), oninput: () => {
    const all = input.value.split(/[,;\s]+/).filter(Boolean).map(Number);
    if (!all.length || all.some(Number.isNaN)) return;
    target[f.name] = all;
    changed();
  } });
  return h("div", { class: "field" }, h("label", { htmlFor: id, for: id }, `${f.meaning} (${f.unit}), one each`), input);
}
