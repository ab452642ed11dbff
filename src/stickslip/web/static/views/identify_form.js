// Options of an identification: few at first, more for who wants them.

import { get, post } from "../api.js";
import { complaint, field, fill, h, values } from "../dom.js";
import { run } from "../jobs.js";
import { here, link, store } from "../store.js";

const METHODS = [["axis", "axis: inertia and friction, from any motion"], ["sliding", "sliding: constant velocities"], ["breakaway", "breakaway: torque ramps"],
  ["presliding", "presliding: stiffness at rest (GMS)"], ["hysteresis", "hysteresis: friction measured along a motion"], ["inertia", "inertia: frequency response"]];

// `open`: whether the options are needed, since the log has no torque.
export function form(logs, open = false) {
  const state = h("div");
  const others = store.project.logs.filter((l) => l.readable && !l.errors && !logs.includes(l.id));
  const laws = h("fieldset", { class: "laws" }, h("legend", {}, "Laws to choose among (none: the usual ones)"));
  get("/laws").then(({ laws: all }) => laws.append(...all.map((law) => field(law.title, `law-${law.name}`, { type: "checkbox" })))).catch((e) => laws.append(complaint(e)));
  const button = h("button", { class: "main", type: "submit" }, "Identify");
  const element = h("form", { onsubmit: async (event) => {
    event.preventDefault();
    const given = values(element);
    const ticked = (start) => Object.keys(given).filter((k) => k.startsWith(start)).map((k) => k.slice(start.length));
    button.disabled = true;
    fill(state);
    try {
      const made = await post(here("/models"), { logs: [...logs, ...ticked("log+")], laws: ticked("law-"), method: given.method, loop: given.loop, inertia: given.inertia, drive_gain: given.drive_gain,
        per_direction: given.per_direction, pendulum: given.pendulum, robust: given.robust, name: given.name });
      const target = link("model", made.id);
      const from = location.hash;
      await run(made.job, "Identifying");
      // Who has gone elsewhere meanwhile is not fetched back.
      if (location.hash === from) location.hash = target;
    } catch (error) {
      fill(state, complaint(error));
    }
    button.disabled = false;
  } },
  h("div", { class: "row" }, button, h("p", { class: "hint" }, "Takes about ten seconds, the first time after an installation a minute; you may reload or leave the page meanwhile.")), state,
  h("details", { open }, h("summary", {}, "Options"),
    h("div", { class: "grid" },
      field("Method", "method", { options: METHODS, value: "axis" }), field("Name of the result", "name", { maxLength: 120 }),
      field("Inertia, if you know it (kg·m² or kg)", "inertia", { type: "number", step: "any", min: 0 }),
      field("Torque for each unit of the drive's signal", "drive_gain", { type: "number", step: "any" }, "If the log has a voltage or another command instead of a torque: N·m (or N) per V."),
      field("The drive's loop, if you know it", "loop", { placeholder: "kp=8,kd=0.08,limit=3", maxLength: 500 }, "Gains of the position loop during the log; with them a closed-loop record determines more."),
      field("Friction of its own in each direction", "per_direction", { type: "checkbox" }), field("Gravity of a pendulum", "pendulum", { type: "checkbox" }),
      field("Robust fit", "robust", { type: "checkbox" })),
    laws,
    others.length ? h("fieldset", {}, h("legend", {}, "Together with"), others.map((l) => field(l.name, `log+${l.id}`, { type: "checkbox" }))) : ""));
  return element;
}
