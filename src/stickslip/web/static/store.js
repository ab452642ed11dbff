// The project that is open, and who wants to know when it changes.

import { get, post } from "./api.js";

export const store = { project: null };
const listeners = new Set();

export function watch(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export async function open(id) {
  if (!id) {
    store.project = null;
  } else {
    store.project = await get(`/projects/${id}`);
    try {
      localStorage.setItem("stickslip-last", id);
    } catch { /* a browser that keeps nothing */ }
  }
  for (const listener of listeners) listener(store.project);
  return store.project;
}

export const refresh = () => open(store.project?.id);

export const here = (rest = "") => `/projects/${store.project.id}${rest}`;

// A place in the open project, as the address says it.
export const link = (...parts) => `#/p/${[store.project.id, ...parts].join("/")}`;

export async function ensured(name) {
  if (!store.project) {
    const made = await post("/projects", { name });
    await open(made.id);
  }
  return store.project;
}
