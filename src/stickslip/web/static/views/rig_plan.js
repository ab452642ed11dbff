// What a rig will do, and its arming: a step of its own, and for a rig that is not simulated a sentence before it.

import { h, number } from "../dom.js";

export function planned(found, begin) {
  const { facts, sentence } = found;
  const start = h("button", { type: "button", class: "main", disabled: true, onclick: begin }, "Start");
  const ready = () => {
    arm.disabled = Boolean(understood) && !understood.checked;
    if (arm.disabled) arm.checked = false;
    start.disabled = !arm.checked;
  };
  const understood = sentence ? h("input", { type: "checkbox", id: "understood", onchange: ready }) : null;
  const arm = h("input", { type: "checkbox", id: "arm", onchange: ready });
  ready();
  const speed = found.speed ? `speed up to ${number(found.speed)} rad/s of ${number(found.limits.speed)}` : `no speed is asked for, and above ${number(found.limits.speed)} rad/s it stops`;
  return h("section", { class: "verdict" }, h("h2", {}, `What ${found.rig} will do`), facts.length ? h("p", { class: "facts" }, facts.join(", ")) : null, h("ul", {}, found.text.map((t) => h("li", {}, t))),
    h("p", {}, `Travel up to ${number(found.travel)} rad; ${speed}; torque up to ${number(found.torque)} N·m of ${number(found.limits.torque)}; up to ${number(found.duration, 3)} s, and ${number(found.pauses, 3)} s at rest.`),
    understood && h("p", { class: "row tick" }, understood, h("label", { for: "understood", htmlFor: "understood" }, h("strong", {}, sentence))),
    h("p", { class: "row tick" }, arm, h("label", { for: "arm", htmlFor: "arm" }, "Arm the rig: I have read the plan and the machine is clear")), start);
}
