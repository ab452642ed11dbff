// What a recommendation needs to know of the drive.

import { post } from "../api.js";
import { complaint, field, fill, h, values } from "../dom.js";
import { run } from "../jobs.js";
import { here, link } from "../store.js";

// A motion to try the settings along, and an inertia, must be given where the model has none.
export function form(model, moves = true, inertia = true) {
  const state = h("div");
  const button = h("button", { class: "main", type: "submit" }, "Recommend a setting");
  const element = h("form", { onsubmit: async (event) => {
    event.preventDefault();
    const given = values(element);
    if (given.sample_ms) given.sample_time = given.sample_ms / 1000;
    delete given.sample_ms;
    button.disabled = true;
    fill(state);
    try {
      const made = await post(here("/settings"), { ...given, model: model.id });
      const target = link("setting", made.id);
      const from = location.hash;
      await run(made.job, "Simulating settings");
      if (location.hash === from) location.hash = target;
    } catch (error) {
      fill(state, complaint(error));
    }
    button.disabled = false;
  } },
  h("div", { class: "grid" },
    field("Bandwidth of the position loop (Hz)", "bandwidth", { type: "number", step: "any", min: 0.01, value: 10 }),
    field("Sample time of the drive (ms)", "sample_ms", { type: "number", step: "any", min: 0.001, value: 1 }),
    field("Encoder counts per revolution", "counts_per_rev", { type: "number", step: "any", min: 0, placeholder: "from the log" }, "Default without one in the log: exact."),
    field("Torque limit (N·m)", "torque_limit", { type: "number", step: "any", min: 0, placeholder: "none" })),
  h("div", { class: "row" }, button, h("p", { class: "hint" }, "Simulates candidates on axes sampled from the intervals: about half a minute.")), state,
  moves ? "" : h("p", { class: "hint" }, "The model contains no motion: enter amplitude and frequency of a slow sinusoid that is typical of your axis below."),
  inertia ? "" : h("p", { class: "hint" }, "The model contains no inertia: enter that of your axis below."),
  h("details", { open: !moves || !inertia }, h("summary", {}, "Options"), h("div", { class: "grid" },
    field("Linear controller", "linear", { options: [["PD", "PD"], ["PID", "PID"], ["PR", "PR"]], value: "PD" }),
    field("Damping of its poles", "damping", { type: "number", step: "any", min: 0.05, value: 1 }),
    field("The drive's own loop instead", "loop", { maxLength: 500, placeholder: "kv=40,kvp=0.8,kvi=25,feed=1" }, "Then clear the bandwidth."),
    field("The drive's reference velocity", "reference_velocity", { options: [["", "unknown: both are simulated"], ["difference", "difference of two reference positions"], ["instant", "that of the trajectory at the sample"]], value: "" }),
    field("Inertia, if the model has none (kg·m² or kg)", "inertia", { type: "number", step: "any", min: 0 }),
    field("A slow sinusoid as the motion: amplitude (rad or m)", "amplitude", { type: "number", step: "any", min: 0 }),
    field("and its frequency (Hz)", "frequency", { type: "number", step: "any", min: 0 }),
    field("Axes for confirmation", "confirm", { type: "number", step: 1, min: 0, max: 1000, value: 39 }, "39 give a 95 % interval."))));
  return element;
}
