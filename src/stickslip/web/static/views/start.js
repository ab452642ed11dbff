// All projects, and where a new one begins: with a log.

import { get, post } from "../api.js";
import { h } from "../dom.js";
import { zone } from "../drop.js";

export async function show(box) {
  const { projects, folder } = await get("/projects");
  const name = h("input", { id: "new-name", name: "name", maxLength: 120, autocomplete: "off" });
  const form = h("form", { class: "row", onsubmit: async (event) => {
    event.preventDefault();
    location.hash = `#/p/${(await post("/projects", { name: name.value })).id}`;
  } }, h("label", { for: "new-name", htmlFor: "new-name" }, "New project name"), name, h("button", {}, "Create"));
  box.append(
    h("section", { class: "welcome" }, h("h1", {}, "From a log to a setting"),
      h("p", {}, "Drop the log of a servo axis here: time, position and torque are enough. You see its content and its problems, "
        + "the friction with its uncertainty, and a compensation that is safe to switch on, to download for your drive."), zone()),
    h("section", {}, h("h2", {}, "Projects"),
      projects.length
        ? h("ul", { class: "cards" }, projects.map((p) => h("li", {}, h("a", { href: `#/p/${p.id}` }, p.name),
          h("p", { class: "hint" }, `${p.id.slice(0, 10)}: ${count(p.logs, "log")}, ${count(p.models, "model")}, ${count(p.settings, "setting")}`))))
        : h("p", {}, "None yet."),
      form, h("p", { class: "hint" }, "Projects are folders in ", h("code", {}, folder))));
}

const count = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;
