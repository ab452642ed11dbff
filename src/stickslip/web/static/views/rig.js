// A rig: which one, with what procedure; its plan before anything moves, arming as a step of its own, and then its run.

import { get, post } from "../api.js";
import { add, complaint, field, fill, h, values } from "../dom.js";
import { run } from "../jobs.js";
import { here, link, store } from "../store.js";
import { ask } from "./ask.js";
import { planned } from "./rig_plan.js";
import { begin } from "./rig_run.js";

export async function show(box, id) {
  const sent = store.project.rigs;
  const chosen = sent.find((r) => r.id === id);
  if (id && chosen?.state !== "ready") return unready(box, chosen);
  const { machines, procedures } = await get("/rigs");
  const rigs = [...machines.map((m) => ({ key: m.name, what: `virtual machine, ${m.title}`, name: m.name, asked: { machine: m.name }, facts: [] })),
    ...sent.filter((r) => r.state === "ready").map((r) => ({ key: r.id, what: r.facts.slice(0, -1).join(", "), name: r.name, asked: { rig: r.id }, facts: r.facts }))];
  const plan = h("div");
  const live = h("section", { class: "live", "aria-label": "Running rig" });
  const form = choice(rigs, procedures, id, plan, async (what) => {
    try {
      const { job } = await post(here("/rig/plan"), what);
      const line = await run(job, "Planning");
      if (line.end !== "done") throw new Error(line.error || line.end);
      // The sentence is the file's own now, not what the project keeps of it.
      fill(plan, planned(line.result, () => { fill(plan); one = begin(live, { ...what, understood: line.result.sentence }); }));
      plan.querySelector("input")?.focus();
    } catch (error) {
      fill(plan, complaint(error));
    }
  });
  let one = null;
  add(box, [h("h1", {}, "Rig"), h("p", { class: "hint" }, "The machines of the library are virtual, with the imperfections of real ones. A rig or machine of your own (", h("code", {}, "rig.toml"), " and what it names) is dropped ",
    h("a", { href: link() }, "into the project"), "."), waiting(sent), h("section", {}, form), plan, live]);
  return () => one?.leave();
}

// Rig, procedure and its options; whatever is changed makes the plan void.
function choice(rigs, procedures, id, plan, makePlan) {
  const options = h("div", { class: "grid" });
  const facts = h("ul", { class: "facts", "aria-label": "The rig" });
  const form = h("form", { onsubmit: (event) => { event.preventDefault(); makePlan(asked()); } },
    h("div", { class: "grid broad" }, field("Rig", "rig", { options: rigs.map((r) => [r.key, `${r.name}: ${r.what}`]), value: id }),
      field("Procedure", "procedure", { options: procedures.map((p) => [p.name, `${p.name}: ${p.title}`]), value: "stickslip" })), facts,
    h("details", {}, h("summary", {}, "Options of the procedure"), options), h("button", { type: "submit", class: "main" }, "Show the plan"));
  const rigOf = () => rigs.find((r) => r.key === form.elements.rig.value);
  const describe = () => {
    const shown = procedures.find((p) => p.name === form.elements.procedure.value);
    fill(options, shown.options.filter((o) => !["controller", "model"].includes(o.name)).map((o) => field(o.name.replaceAll("_", " "), `o-${o.name}`, { value: o.default })));
  };
  const tell = () => { fill(facts, rigOf().facts.map((f) => h("li", {}, f))); facts.hidden = !rigOf().facts.length; };
  const asked = () => {
    const given = values(form);
    const texts = Object.fromEntries(Object.entries(given).filter(([k]) => k.startsWith("o-")).map(([k, v]) => [k.slice(2), String(v)]));
    return { ...rigOf().asked, procedure: given.procedure, options: texts };
  };
  form.addEventListener("change", () => fill(plan));
  form.elements.procedure.addEventListener("change", describe);
  form.elements.rig.addEventListener("change", tell);
  describe();
  tell();
  return form;
}

// Rigs that were sent and cannot be run yet.
function waiting(sent) {
  const names = sent.filter((r) => r.state !== "ready");
  return names.length ? h("p", { class: "hint" }, "Not ready: ", names.map((r, n) => [n ? ", " : "", h("a", { href: link("rig", r.id) }, r.name)])) : null;
}

// A rig of the project that is being looked at, asks to run code, or is none that can be run.
function unready(box, rig) {
  if (!rig) throw new Error("no such rig in this project; it may have been deleted");
  box.append(h("h1", {}, rig.name), h("p", { class: "facts" }, `Sent: ${rig.sent.join(", ")}`));
  const job = store.project.jobs.find((j) => j.item === rig.id && ["waiting", "running"].includes(j.state));
  if (job) {
    box.append(h("p", {}, "It is being looked at."));
    run(job.id, job.title).then(() => dispatchEvent(new Event("stickslip-show")));
  } else if (rig.state === "asks") {
    box.append(ask("rigs", rig));
  } else {
    box.append(h("p", { class: "problem", role: "alert" }, rig.problem || "The server was ended while it looked at this file; drop it again."));
  }
  box.append(h("p", {}, h("a", { href: link("rig") }, "All rigs")));
}
