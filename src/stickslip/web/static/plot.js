// Plots: signals over time from the server's extremes, and pictures of a result. Each has a summary in words.

import uPlot from "./vendor/uplot/uPlot.esm.js";
import { h, number } from "./dom.js";

const dark = matchMedia("(prefers-color-scheme: dark)");
const living = new Set();
dark.addEventListener("change", () => living.forEach((one) => one.recolour()));

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

const LINES = ["line-1", "line-2", "line-3", "line-4", "line-5"];
const HELP = "Arrow keys move, plus and minus zoom, Home shows all.";
let counted = 0;

const tick = (value) => number(value, 6);

function axes(xLabel, yLabel) {
  const common = { stroke: () => colour("ink"), grid: { stroke: () => colour("rule"), width: 1 }, ticks: { stroke: () => colour("rule") },
    font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 18, values: (u, ticks) => ticks.map((v) => (v === null ? "" : tick(v))) };
  return [{ ...common, label: xLabel, size: 34, space: 72 }, { ...common, label: yLabel, size: (u, values) => 18 + 7 * Math.max(6, ...(values ?? []).map((v) => String(v).length)) }];
}

// The frame of a plot: title, canvas that can be focussed, summary, legend.
function frame(title, labels, height) {
  const id = `plot-${(counted += 1)}`;
  const canvas = h("div", { class: "canvas", tabindex: 0, role: "group", "aria-label": title, "aria-describedby": `${id}-s ${id}-h` });
  const summary = h("p", { class: "summary", id: `${id}-s` });
  const legend = h("ul", { class: "legend" }, labels.filter((l) => l.label).map((l) => h("li", {}, swatch(l), l.label)));
  const figure = h("figure", { class: "plot" }, h("figcaption", {}, title), legend, canvas, summary,
    h("p", { class: "visually-hidden", id: `${id}-h` }, HELP));
  figure.dataset.height = height;
  return { figure, canvas, summary };
}

function swatch({ colour: name, kind }) {
  const shape = ["points", "cloud", "open points"].includes(kind) ? "dot" : ["band", "own band"].includes(kind) ? "fill" : "";
  return h("span", { class: `swatch ${name} ${shape}`, "aria-hidden": "true" });
}

// Zoom and pan of the x axis by wheel, touch and keyboard; `limits` are the widest view.
function navigable(canvas, view, limits, changed) {
  const clamp = ([low, high]) => {
    const [least, most] = limits();
    const width = Math.min(high - low, most - least);
    const from = Math.max(least, Math.min(low, most - width));
    return [from, from + width];
  };
  const set = (range) => changed(clamp(range));
  const zoom = (factor, at = 0.5) => {
    const [low, high] = view();
    const centre = low + at * (high - low);
    set([centre - (centre - low) * factor, centre + (high - centre) * factor]);
  };
  const pan = (part) => {
    const [low, high] = view();
    const by = part * (high - low);
    set([low + by, high + by]);
  };
  canvas.addEventListener("keydown", (event) => {
    const keys = { ArrowLeft: () => pan(-0.15), ArrowRight: () => pan(0.15), "+": () => zoom(0.6), "=": () => zoom(0.6), "-": () => zoom(1.7), Home: () => set(limits()) };
    const key = keys[event.key];
    if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    key();
  });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== canvas) return; // the page scrolls until the plot is chosen
    event.preventDefault();
    const over = canvas.querySelector(".u-over").getBoundingClientRect();
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) pan(event.deltaX / over.width);
    else zoom(event.deltaY > 0 ? 1.2 : 1 / 1.2, (event.clientX - over.left) / over.width);
  }, { passive: false });
  canvas.addEventListener("dblclick", () => set(limits()));
  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => event.pointerType === "touch" && fingers.set(event.pointerId, event.clientX));
  for (const end of ["pointerup", "pointercancel"]) addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()];
    const was = fingers.get(event.pointerId);
    fingers.set(event.pointerId, event.clientX);
    const width = canvas.clientWidth;
    if (fingers.size === 1) pan((was - event.clientX) / width);
    else {
      const now = [...fingers.values()];
      const spread = (xs) => Math.max(20, Math.max(...xs) - Math.min(...xs));
      zoom(spread(before) / spread(now));
    }
  });
  return { set, zoom, pan };
}

// Signals over time. `load(from, to, bins)` gives {x, series: [[low, high], ...]}; `marks` are stretches with a reason.
export function signals({ title, xLabel, unit, channels, ends, load, marks = [], onrange, onselect, height = 190 }) {
  const labels = channels.map((c, i) => ({ label: c.name.replaceAll("_", " "), colour: LINES[i % LINES.length], kind: "line" }));
  const { figure, canvas, summary } = frame(title, labels, height);
  let view = [...ends];
  let plot = null;
  let loading = false;
  let again = false;
  let selection = null;
  let left = [];
  const series = [{}, ...channels.map((c, i) => ({ stroke: () => colour(labels[i].colour), width: 1.25, points: { show: false }, spanGaps: false }))];

  function paint(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const stretch = (from, to, fill) => {
      const a = u.valToPos(from, "x", true);
      const b = u.valToPos(to, "x", true);
      ctx.fillStyle = fill;
      ctx.fillRect(Math.min(a, b) - 1, bbox.top, Math.max(2, Math.abs(b - a) + 2), bbox.height);
    };
    for (const part of left) stretch(part[0], part[1], colour("left-out"));
    for (const mark of marks) stretch(mark.from, mark.to, colour(`mark-${mark.level}`));
    if (selection) stretch(selection[0], selection[1], colour("selected"));
    ctx.restore();
  }

  const size = () => Math.max(160, canvas.clientWidth);
  const visible = () => figure.isConnected && canvas.clientWidth > 0;

  function draw(data) {
    const { x, y } = interleaved(data, channels.length);
    if (!plot) {
      plot = new uPlot({ width: size(), height, series, legend: { show: false }, axes: axes(xLabel, unit), scales: { x: { time: false, auto: false, range: () => view }, y: {} },
        cursor: { drag: { x: true, y: false, setScale: false }, points: { show: false } },
        hooks: { drawClear: [paint], setSelect: [(u) => {
          if (u.select.width < 3) return;
          const range = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
          u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          onselect?.(range);
        }] } }, [x, ...y], canvas);
    } else {
      plot.batch(() => {
        plot.setData([x, ...y], false);
        plot.setScale("x", { min: view[0], max: view[1] });
      });
    }
  }

  // What is at hand is moved at once; the samples of the new stretch follow, one request after the other, the last one wins.
  async function redraw() {
    if (!visible()) return;
    plot?.setScale("x", { min: view[0], max: view[1] });
    again = true;
    if (loading) return;
    loading = true;
    try {
      while (again && visible()) {
        again = false;
        const range = [...view];
        const data = await load(range[0], range[1], Math.round((size() - 70) * Math.min(2, devicePixelRatio)));
        if (!visible()) return;
        draw(data);
        if (again) continue;
        canvas.dataset.drawn = String(data.count);
        summary.textContent = told(channels, data, range, unit, xLabel);
      }
    } finally {
      loading = false;
    }
  }

  const controls = navigable(canvas, () => view, () => ends, (range) => (onrange ?? api.show)(range));
  const api = {
    figure, canvas,
    show(range) { view = [...range]; return redraw(); },
    select(range) { selection = range; plot?.redraw(); },
    leftOut(parts) { left = parts; plot?.redraw(); },
    zoom: controls.zoom,
    pan: controls.pan,
    recolour: () => plot?.redraw(),
    destroy() { living.delete(api); observer.disconnect(); plot?.destroy(); },
    redraw,
  };
  const observer = new ResizeObserver(() => {
    if (plot) plot.setSize({ width: Math.max(160, canvas.clientWidth), height });
    redraw();
  });
  observer.observe(canvas);
  living.add(api);
  return api;
}

// Least and greatest of every block as one line: every spike reaches its height.
function interleaved(data, count) {
  if (data.whole) return { x: data.x, y: data.series.map(([low]) => gaps(low)) };
  const n = data.x.length;
  const x = new Float64Array(2 * n);
  const y = Array.from({ length: count }, () => new Array(2 * n));
  for (let i = 0; i < n; i += 1) {
    x[2 * i] = x[2 * i + 1] = data.x[i];
    for (let c = 0; c < count; c += 1) {
      const [low, high] = data.series[c];
      y[c][2 * i] = Number.isNaN(low[i]) ? null : low[i];
      y[c][2 * i + 1] = Number.isNaN(high[i]) ? null : high[i];
    }
  }
  return { x, y };
}

const gaps = (values) => Array.from(values, (v) => (Number.isNaN(v) ? null : v));

function told(channels, data, view, unit, xLabel) {
  const parts = channels.map((c, i) => {
    const [low, high] = data.series[i];
    let least = Infinity;
    let most = -Infinity;
    for (let k = 0; k < low.length; k += 1) {
      if (low[k] < least) least = low[k];
      if (high[k] > most) most = high[k];
    }
    return least > most ? `${c.name.replaceAll("_", " ")}: no values` : `${c.name.replaceAll("_", " ")}: ${number(least)} to ${number(most)} ${unit}`;
  });
  return `${parts.join("; ")}. ${xLabel}: ${number(view[0], 5)} to ${number(view[1], 5)}, ${data.count} samples.`;
}

// A picture of a result: lines, points, bands over any x, as the report draws them.
export function picture({ title, message = "", x_label, y_label, x_scale = "linear", traces, height = 300 }) {
  let { colours, labels } = coloured(traces);
  const { figure, canvas, summary } = frame(title, labels, height);
  const reach = () => ({ x: extent(traces.filter((t) => t.kind !== "vertical"), ["x"]), y: extent(traces.filter((t) => !["vertical", "rug"].includes(t.kind)), ["y", "y2"], 0.04) });
  let full = reach();
  if (x_scale === "linear") full.x = padded(full.x, 0.02);
  let view = [...full.x];
  let plot = null;
  const data = () => [null, ...traces.map((t) => [t.x, t.y])];
  const series = () => [{}, ...traces.map((t, i) => ({ stroke: () => colour(colours[i]), facets: [{ scale: "x", auto: false }, { scale: "y", auto: false }],
    paths: (u) => { draw(u, traces[i], colour(colours[i])); return null; } }))];
  const build = () => {
    if (!canvas.clientWidth) return;
    const size = { width: Math.max(160, canvas.clientWidth), height };
    if (plot) return plot.setSize(size);
    plot = new uPlot({ mode: 2, ...size, legend: { show: false }, axes: axes(x_label, y_label), series: series(),
      scales: { x: { time: false, auto: false, distr: x_scale === "log" ? 3 : 1, range: () => view }, y: { auto: false, range: () => full.y } },
      cursor: { drag: { x: true, y: false, setScale: false }, points: { show: false } },
      hooks: { setSelect: [(u) => {
        if (u.select.width < 3) return;
        const range = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
        u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        controls.set(range);
      }] } }, data(), canvas);
    canvas.dataset.drawn = "1";
  };
  const show = (range) => { view = [...range]; plot?.setScale("x", { min: view[0], max: view[1] }); plot?.redraw(true, true); };
  const controls = navigable(canvas, () => view, () => full.x, show);
  summary.textContent = `${message ? `${sentence(message)} ` : ""}${described(traces, x_label, y_label)}`;
  const observer = new ResizeObserver(build);
  observer.observe(canvas);
  // Other traces in the same frame: what is looked at stays, unless it lies outside now.
  const update = (now) => {
    const whole = view[0] === full.x[0] && view[1] === full.x[1];
    traces = now;
    ({ colours, labels } = coloured(traces));
    full = reach();
    if (whole || view[0] < full.x[0] || view[1] > full.x[1]) view = [...full.x];
    if (plot && plot.series.length === traces.length + 1) {
      plot.batch(() => {
        plot.setData(data(), false);
        plot.setScale("x", { min: view[0], max: view[1] });
        plot.setScale("y", { min: full.y[0], max: full.y[1] });
      });
      plot.redraw(true, true);
      summary.textContent = described(traces, x_label, y_label);
      return;
    }
    plot?.destroy();
    plot = null;
    build();
    figure.querySelector(".legend").replaceChildren(...labels.map((l) => h("li", {}, swatch(l), l.label)));
    summary.textContent = described(traces, x_label, y_label);
  };
  const api = { figure, update, recolour: () => plot?.redraw(), destroy() { living.delete(api); observer.disconnect(); plot?.destroy(); } };
  living.add(api);
  return api;
}

const sentence = (text) => (/[.!?]$/.test(text) ? text : `${text}.`);

function described(traces, xLabel, yLabel) {
  const named = traces.filter((t) => t.label && t.y?.length && t.kind !== "rug" && t.kind !== "vertical");
  const parts = named.slice(0, 6).map((t) => {
    const [low, high] = ends([t], ["y"]);
    return low > high ? `${t.label}: no values` : `${t.label}: ${low === high ? "" : `${number(low)} to `}${number(high)}`;
  });
  if (!named.length) {
    const [low, high] = ends(traces, ["y"]);
    if (low <= high) parts.push(low === high ? number(high) : `${number(low)} to ${number(high)}`);
  }
  const [from, to] = ends(traces.filter((t) => t.kind !== "vertical"), ["x"]);
  return `${parts.length ? `${yLabel}: ${parts.join("; ")}. ` : ""}${xLabel}: ${number(from)} to ${number(to)}.`;
}

function coloured(traces) {
  const colours = [];
  const labels = [];
  const lines = traces.some((t) => t.kind === "line" || t.kind === "wide");
  let next = 0;
  traces.forEach((t, i) => {
    const alone = ["faint", "vertical", "rug", "cloud"].includes(t.kind);
    if (alone) colours.push(t.kind === "cloud" ? (lines ? "line-2" : "cloud") : "faint");
    else if (t.kind === "band") colours.push("band");
    else if (t.kind === "own band") colours.push(LINES[next % LINES.length]);
    else { colours.push(LINES[next % LINES.length]); next += 1; }
    if (t.label) labels.push({ label: t.label, colour: colours[i], kind: t.kind });
  });
  return { colours, labels };
}

// Least and greatest of all that is finite; the greater first where there is nothing.
function ends(traces, keys) {
  let low = Infinity;
  let high = -Infinity;
  for (const t of traces) for (const key of keys) for (const v of t[key] ?? []) {
    if (v === null || !Number.isFinite(v)) continue;
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return [low, high];
}

function extent(traces, keys, room = 0) {
  const [low, high] = ends(traces, keys);
  if (low > high) return [0, 1];
  if (low === high) return [low - 0.5 * (Math.abs(low) || 1), high + 0.5 * (Math.abs(high) || 1)];
  return padded([low, high], room);
}

const padded = ([low, high], room) => [low - room * (high - low), high + room * (high - low)];

function draw(u, trace, ink) {
  const { ctx, bbox } = u;
  const scale = devicePixelRatio;
  const X = (v) => u.valToPos(v, "x", true);
  const Y = (v) => u.valToPos(v, "y", true);
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.strokeStyle = ctx.fillStyle = ink;
  ctx.lineWidth = (trace.kind === "wide" ? 4 : trace.kind === "faint" ? 0.7 : 1.6) * scale;
  ctx.lineJoin = "round";
  if (trace.kind === "wide") ctx.globalAlpha = 0.45; // another line lies on it
  if (trace.kind === "band" || trace.kind === "own band") {
    ctx.globalAlpha = 0.22;
    ctx.beginPath();
    trace.x.forEach((x, i) => ctx.lineTo(X(x), Y(trace.y[i])));
    for (let i = trace.x.length - 1; i >= 0; i -= 1) ctx.lineTo(X(trace.x[i]), Y(trace.y2[i]));
    ctx.fill();
  } else if (["points", "open points", "cloud"].includes(trace.kind)) {
    const size = (trace.kind === "cloud" ? 1.5 : 5) * scale;
    ctx.globalAlpha = trace.kind === "cloud" ? 0.55 : 1;
    trace.x.forEach((x, i) => {
      if (x === null || trace.y[i] === null) return;
      if (trace.kind === "cloud") return ctx.fillRect(X(x) - size / 2, Y(trace.y[i]) - size / 2, size, size);
      ctx.beginPath();
      ctx.arc(X(x), Y(trace.y[i]), size / 2, 0, 7);
      if (trace.kind === "points") ctx.fill();
      else ctx.stroke();
    });
  } else if (trace.kind === "vertical" || trace.kind === "rug") {
    const top = trace.kind === "rug" ? bbox.top + bbox.height - 8 * scale : bbox.top;
    ctx.beginPath();
    for (const x of trace.x) { ctx.moveTo(X(x), top); ctx.lineTo(X(x), bbox.top + bbox.height); }
    ctx.stroke();
  } else {
    ctx.beginPath();
    let pen = false;
    trace.x.forEach((x, i) => {
      if (x === null || trace.y[i] === null) { pen = false; return; }
      if (pen) ctx.lineTo(X(x), Y(trace.y[i]));
      else ctx.moveTo(X(x), Y(trace.y[i]));
      pen = true;
    });
    ctx.stroke();
  }
  ctx.restore();
}
