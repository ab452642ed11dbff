// Which column is which channel, in which unit: the guess is shown, and may be corrected.

import { complaint, field, fill, h, values } from "../dom.js";

const CHANNELS = ["time", "position", "position_reference", "velocity", "velocity_reference", "motor_torque", "current", "voltage", "supply",
  "friction_torque", "sensor_torque", "compensation_torque", "load", "temperature"];
const NUMBERS = [["sample_time", "Time between rows (s), if the file has no times"], ["counts_per_rev", "Counts per revolution"], ["rated_torque", "Rated torque (N·m)"],
  ["rated_current", "Rated current (A)"], ["torque_constant", "Torque constant (N·m/A)"], ["force_constant", "Force constant of a linear motor (N/A)"], ["gear_ratio", "Gear ratio"], ["pole_pairs", "Pole pairs, for speeds in eRPM"], ["lead", "Lead of the screw (m per revolution)"]];

export function mapping(log, again) {
  const state = h("div");
  const guess = new Map((log.chosen ?? []).map((c) => [c.channel, c]));
  const said = log.reading.map ?? {};
  const options = (channel) => [["", guess.has(channel) && !(channel in said) ? `as found: ${guess.get(channel).column}` : "as found: nothing"], ["none", "none of them"],
    ...log.columns.map(([name, unit]) => [name, unit ? `${name} (${unit})` : name])];
  const rows = CHANNELS.map((channel) => {
    const [column, unit] = parted(said[channel] ?? "", log.columns);
    return h("tr", {}, h("th", { scope: "row" }, channel.replaceAll("_", " ")),
      h("td", {}, field(`Column of ${channel}`, `column-${channel}`, { options: options(channel), value: column })),
      h("td", {}, field(`Unit of ${channel}`, `unit-${channel}`, { value: unit, maxLength: 30, placeholder: guess.get(channel)?.unit ?? "" })));
  });
  const numbers = NUMBERS.map(([name, label]) => field(label, name, { type: "number", step: "any", value: log.reading[name] ?? "" }));
  const form = h("form", { onsubmit: async (event) => {
    event.preventDefault();
    const given = values(form);
    const map = {};
    for (const channel of CHANNELS) {
      const column = given[`column-${channel}`] ?? (given[`unit-${channel}`] ? guess.get(channel)?.column : undefined);
      if (column) map[channel] = given[`unit-${channel}`] && column !== "none" ? `${column}:${given[`unit-${channel}`]}` : column;
    }
    const reading = { ...log.reading, map };
    for (const [name] of NUMBERS) reading[name] = given[name];
    reading.side = given.side;
    fill(state);
    try {
      await again(reading);
    } catch (error) {
      fill(state, complaint(error));
    }
  } },
  h("div", { class: "wide labelled", tabindex: 0, role: "region", "aria-label": "Column and unit of every channel" }, h("table", { class: "mapping" }, h("thead", {}, h("tr", {}, ["channel", "column", "unit (deg, mNm, counts, ...)"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, rows))),
  h("div", { class: "grid" }, numbers, field("Measured on the side of", "side", { options: [["", "motor, or as in the file"], ["load", "load"], ["motor", "motor"]], value: log.reading.side ?? "" })),
  h("button", { type: "submit" }, "Apply"), state);
  return h("details", { open: !log.readable }, h("summary", {}, "Correct columns, units or data sheet values"), form);
}

// "q_deg:deg" as column and unit; a column's own name may hold a colon.
function parted(text, columns) {
  if (!text || text === "none" || columns.some(([name]) => name === text)) return [text, ""];
  const at = text.lastIndexOf(":");
  return at > 0 ? [text.slice(0, at), text.slice(at + 1)] : [text, ""];
}
