// Elements from JavaScript, without a library: h("button", {onclick: f}, "Text").

export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(props)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "class") element.className = value;
    else if (key in element && key !== "list" && key !== "form" && !key.startsWith("aria")) element[key] = value;
    else element.setAttribute(key, value === true ? "" : value);
  }
  add(element, children);
  return element;
}

export function add(element, children) {
  for (const child of [children].flat(9)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : String(child));
  }
  return element;
}

export function fill(element, ...children) {
  element.replaceChildren();
  return add(element, children);
}

// A sentence for a screen reader, wherever the eye is.
export function announce(text) {
  document.getElementById("said").textContent = text;
}

// Text whose `words` between backticks are code.
export const coded = (text) => text.split("`").map((part, i) => (i % 2 ? h("code", {}, part) : part));

// A number as people read it; what is not there is said so.
export function number(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "unknown";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(digits - 1).replace(/\.?0+e/, "e") : Number(value.toPrecision(digits)).toString();
  return text.replaceAll("-", "−").replace("e+", "e");
}

let copies = 0;

// A value with a button that copies it at full precision.
export function copyable(shown, value, what) {
  copies += 1;
  const button = h("button", { class: "copy", type: "button", title: `Copy ${what}`, "aria-label": `Copy ${what}`,
    onclick: async () => {
      try {
        await navigator.clipboard.writeText(String(value));
      } catch {
        const field = h("textarea", { value: String(value), class: "visually-hidden" });
        document.body.append(field);
        field.select();
        document.execCommand("copy");
        field.remove();
      }
      button.classList.add("done");
      announce(`${what} copied`);
      setTimeout(() => button.classList.remove("done"), 1200);
    } });
  return h("span", { class: "copyable" }, shown, button);
}

// A labelled field of a form; `more` are attributes of the input.
export function field(label, name, more = {}, hint = "") {
  const id = `f-${name}-${(copies += 1)}`;
  const input = more.options
    ? h("select", { id, name }, more.options.map(([value, text]) => h("option", { value, selected: value === more.value }, text)))
    : h("input", { id, name, ...more });
  if (hint) input.setAttribute("aria-describedby", `${id}-hint`);
  return h("div", { class: more.type === "checkbox" ? "field check" : "field" },
    h("label", { for: id, htmlFor: id }, label), input, hint && h("p", { class: "hint", id: `${id}-hint` }, hint));
}

// Named values of a form: numbers, texts, flags; nothing where a field is left empty.
export function values(form) {
  const out = {};
  for (const input of form.elements) {
    if (!input.name || input.disabled) continue;
    if (input.type === "checkbox") {
      if (input.checked) out[input.name] = true;
    } else if (input.value.trim() !== "") {
      out[input.name] = input.type === "number" || input.dataset.number ? Number(input.value.replace(",", ".")) : input.value.trim();
    }
  }
  return out;
}

export function complaint(error) {
  return h("p", { class: "problem", role: "alert" }, error.message || String(error));
}
