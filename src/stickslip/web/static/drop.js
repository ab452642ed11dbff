// Files from a drop or a dialogue, each read by a job of its own.

import { post, upload } from "./api.js";
import { announce, complaint, fill, h } from "./dom.js";
import { run } from "./jobs.js";
import { ensured, here, link } from "./store.js";

const OTHER = [[/\.(xlsx?|xlsm|ods|numbers)$/i, "a spreadsheet: save its sheet as CSV and drop that"], [/\.(zip|7z|rar|tar|tgz)$/i, "an archive: unpack it and drop the logs in it"],
  [/\.(png|jpe?g|gif|bmp|svg|pdf|html?|docx?|pptx?)$/i, "not a log: drop the file with the underlying numbers"]];
const CODE = /\.(toml|py)$/i;
const FORMATS = "CSV, MAT, HDF5, Parquet, NumPy, TDMS, MDF, ROS bags, JSON";

export function zone() {
  const state = h("div", { class: "sent" });
  const input = h("input", { type: "file", multiple: true, class: "visually-hidden", id: "files",
    onchange: () => { take([...input.files], state); input.value = ""; } });
  const box = h("div", { class: "drop" },
    h("p", { class: "big" }, "Drop logs here"),
    h("p", {}, "or ", h("label", { for: "files", htmlFor: "files", class: "button" }, "choose files"), input, " or ",
      h("button", { type: "button", onclick: () => example(state) }, "try the example log")),
    h("p", { class: "hint" }, `${FORMATS}; or a model, study or rig (TOML, with the files that it names). They stay on this machine.`), state);
  for (const kind of ["dragenter", "dragover"]) box.addEventListener(kind, () => box.classList.add("over"));
  for (const kind of ["dragleave", "drop"]) box.addEventListener(kind, () => box.classList.remove("over"));
  box.addEventListener("drop", (event) => take([...event.dataTransfer.files], state));
  return box;
}

async function take(files, state) {
  if (files.some((f) => CODE.test(f.name))) return sent(files, state);
  for (const file of files) {
    const bar = h("progress", { max: 1, value: 0, "aria-label": `Sending ${file.name}` });
    const line = h("p", {}, `${file.name} `, bar);
    state.append(line);
    try {
      const other = OTHER.find(([ending]) => ending.test(file.name));
      if (other) throw new Error(`${file.name} is ${other[1]}.`);
      const log = await unzipped(file);
      await ensured(log.name);
      const made = await upload(here("/logs"), log, (part) => { bar.value = part; });
      fill(line, `${file.name}: being read`);
      await finished(made, log.name, files.length === 1);
      line.remove();
    } catch (error) {
      fill(line, complaint(error));
    }
  }
}

// What was compressed with gzip as it was before; the server counts its bytes.
async function unzipped(file) {
  if (!/.\.gz$/i.test(file.name)) return file;
  try {
    const whole = await new Response(file.stream().pipeThrough(new DecompressionStream("gzip"))).blob();
    return new File([whole], file.name.slice(0, -3));
  } catch {
    throw new Error(`${file.name} ends in .gz but cannot be unpacked; drop it again, or unpacked.`);
  }
}

// A model, study or rig with what it names: its code is shown before any of it runs.
async function sent(files, state) {
  const line = h("p");
  state.append(line);
  try {
    const main = files.find((f) => /\.toml$/i.test(f.name));
    if (!main) throw new Error(`${files[0].name} is Python code, which the page runs only for a model, study or rig that names it: drop both together.`);
    await ensured(main.name);
    const texts = await Promise.all(files.map(async (f) => ({ name: f.name, text: await f.text() })));
    const made = await post(here("/sent"), { files: texts });
    const target = link({ models: "model", studies: "study", rigs: "rig" }[made.kind], made.id);
    await run(made.job, `Reading ${main.name}`);
    line.remove();
    location.hash = target;
  } catch (error) {
    fill(line, complaint(error));
  }
  return undefined;
}

async function example(state) {
  try {
    await ensured("Example");
    await finished(await post(here("/example")), "demo.csv", true);
  } catch (error) {
    fill(state, complaint(error));
  }
}

async function finished(made, name, alone) {
  const target = link("log", made.id);
  // A long log can be seen before the doctor has looked at it.
  const early = new Promise((resolve) => {
    addEventListener("stickslip-shown", function heard(event) {
      if (event.detail !== made.job) return;
      removeEventListener("stickslip-shown", heard);
      resolve();
    });
  });
  await Promise.race([run(made.job, `Reading ${name}`), early]);
  announce(`${name} was read`);
  if (alone) location.hash = target;
  else dispatchEvent(new Event("stickslip-show"));
}
