// Code that came with a model, study or rig: it is shown, and runs only after an explicit step.

import { post, remove } from "../api.js";
import { complaint, fill, h } from "../dom.js";
import { run } from "../jobs.js";
import { here, link, refresh } from "../store.js";

// Characters that print nothing or turn the direction of a line could hide what runs.
const HIDDEN = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]/gu;
const visible = (text) => text.replace(/\r\n/g, "\n").replace(HIDDEN, (c) => `⟨U+${c.codePointAt(0).toString(16).toUpperCase().padStart(4, "0")}⟩`);

export function ask(kind, item) {
  const { name, text, sha256 } = item.asks;
  const state = h("div");
  const allow = h("button", { type: "button", disabled: true, onclick: async () => {
    allow.disabled = true;
    try {
      const { job } = await post(here(`/${kind}/${item.id}/approval`), { sha256 });
      await run(job, `Running ${name}`);
      dispatchEvent(new Event("stickslip-show"));
    } catch (error) {
      fill(state, complaint(error));
    }
  } }, "Run this code");
  const read = h("input", { type: "checkbox", id: "code-read", onchange: () => { allow.disabled = !read.checked; } });
  const refuse = h("button", { type: "button", onclick: async () => {
    try {
      await remove(here(`/${kind}/${item.id}`));
      await refresh();
      location.hash = link();
    } catch (error) {
      fill(state, complaint(error));
    }
  } }, "Delete it, run nothing");
  return h("section", { class: "ask" }, h("h2", {}, "It requires Python code"),
    h("p", {}, h("strong", {}, name), ` (${text.split("\n").length} lines) came with it and has not run yet. Code has all your rights on this machine: it can read and change your files, and reach the network. `
      + "Review it, or ask the sender, before you allow it."),
    h("pre", { tabindex: 0, "aria-label": `Code of ${name}` }, visible(text)),
    h("p", { class: "hint" }, "SHA-256 ", h("code", {}, sha256), ". Your approval is valid until the code changes, for every file that names it, also on the command line."),
    h("p", { class: "row tick" }, read, h("label", { for: "code-read", htmlFor: "code-read" }, "I have reviewed it and trust the sender")),
    h("div", { class: "row" }, refuse, allow), state);
}
