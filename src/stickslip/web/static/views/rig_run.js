// A running rig: live signals, and a stop that the button, two keys, leaving and losing the page reach.

import { post, remove } from "../api.js";
import { add, announce, complaint, fill, h } from "../dom.js";
import { picture } from "../plot.js";
import { here, link, refresh } from "../store.js";

const WINDOW = 8; // s that are seen
const SHOWN = [["position", "Position", ["position", "position_reference"]], ["torque", "Torque", ["torque_command", "motor_torque"]]];
const LOST = "The connection is lost: the rig stops, with its torque ramped to zero.";

// Start it; returns how the view is left. A stop that is asked for before the server has answered is kept, and sent then.
export function begin(live, asked) {
  const one = { live, asked, home: here(), job: "", wanted: false, over: false, ended: [] };
  one.state = h("p", { class: "big", role: "status" }, "Starting");
  one.halt = h("button", { type: "button", class: "stop", onclick: () => stop(one) }, "Stop");
  one.signals = signals();
  const keys = (event) => {
    if (event.key !== "Escape" && event.key !== " ") return;
    event.preventDefault();
    stop(one);
  };
  addEventListener("keydown", keys, true);
  one.ended.push(() => removeEventListener("keydown", keys, true));
  fill(live, h("div", { class: "row" }, one.halt, h("p", { class: "hint" }, "The keys Escape and space also stop it, and so does leaving this page.")), one.state, one.signals.figures);
  one.halt.focus();
  start(one);
  return { leave: () => { if (!one.over) { stop(one); over(one, "Left"); } one.signals.destroy(); } };
}

async function start(one) {
  let made;
  try {
    made = await post(`${one.home}/rig/run`, { ...one.asked, armed: true });
  } catch (error) {
    over(one, "It did not start.");
    fill(one.live, complaint(error));
    return;
  }
  one.job = made.job;
  const base = `${one.home}/rig/${one.job}`;
  if (one.wanted) stop(one);
  if (one.over) return;
  // A sign of life that does not arrive says that no stop would, either: the server then stops the rig by itself.
  const beat = setInterval(() => post(`${base}/alive`).catch((error) => error.status === 0 && over(one, LOST)), 500);
  const source = new EventSource(`/api${base}/live`);
  one.ended.push(() => clearInterval(beat), () => source.close());
  source.onerror = () => over(one, LOST);
  source.onmessage = (event) => heard(one, JSON.parse(event.data), made.log);
}

function stop(one) {
  one.wanted = true;
  one.state.textContent = "Stopping";
  if (one.job) remove(`${one.home}/jobs/${one.job}/run`).catch((error) => { if (!one.over) one.state.textContent = error.message; });
}

function over(one, words) {
  if (one.over) return;
  one.over = true;
  one.ended.splice(0).forEach((end) => end());
  one.halt.disabled = true;
  one.state.textContent = words;
  announce(words);
}

async function heard(one, frame, log) {
  if (!frame.end) {
    if (frame.tell && !one.wanted) one.state.textContent = `Now: ${frame.tell}`;
    if (frame.time) one.signals.take(frame);
    return;
  }
  over(one, last(frame));
  add(one.live, h("p", {}, h("a", { href: link("log", log), class: "button" }, "Show the record")));
  await refresh();
}

function last(frame) {
  if (frame.killed) return "It did not end in time and was killed: the rig's own watchdog removes the torque. Check that it stands still.";
  if (frame.end === "done") return `Done: ${frame.result.checks.filter((c) => c.passed).length} of ${frame.result.checks.length} checks passed.`;
  return frame.end === "cancelled" ? "Stopped: the torque is zero." : `Ended: ${frame.error}`;
}

// Plots of the last seconds, drawn as often as the screen can; no frame waits for one before it.
function signals() {
  const figures = h("div");
  const plots = new Map();
  const traces = new Map();
  let frames = 0;
  let drawing = false;
  const later = () => {
    if (drawing) return;
    drawing = true;
    requestAnimationFrame(() => {
      for (const [name, one] of plots) one.update(traces.get(name));
      setTimeout(() => { drawing = false; }, 30);
    });
  };
  const take = (frame) => {
    frames += 1;
    figures.dataset.frames = String(frames);
    for (const [name, title, channels] of SHOWN) {
      const present = channels.filter((c) => frame.channels[c]);
      if (!traces.has(name)) traces.set(name, present.map((c) => ({ label: c.replaceAll("_", " "), kind: "line", x: [], y: [] })));
      traces.get(name).forEach((t, i) => longer(t, frame.time, frame.channels[present[i]]));
      if (plots.has(name)) later();
      else {
        const one = picture({ title, x_label: "time (s)", y_label: `${title.toLowerCase()} (${frame.units[present[0]]})`, traces: traces.get(name), height: 190 });
        plots.set(name, one);
        figures.append(one.figure);
      }
    }
  };
  return { figures, take, destroy: () => plots.forEach((p) => p.destroy()) };
}

function longer(trace, time, values) {
  trace.x.push(...time);
  trace.y.push(...values);
  while (trace.x.length && trace.x[0] < time.at(-1) - WINDOW) { trace.x.shift(); trace.y.shift(); }
}
