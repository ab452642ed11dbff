// Requests to this page's own server.

export class Refusal extends Error {
  constructor(status, message) {
    super(message);
    this.status = status;
  }
}

async function answer(response) {
  if (response.ok) return response;
  let said = `the server answered ${response.status}`;
  try {
    said = (await response.json()).error || said;
  } catch { /* no JSON: the status tells */ }
  throw new Refusal(response.status, said);
}

async function ask(path, options) {
  try {
    return await answer(await fetch(`/api${path}`, { credentials: "same-origin", ...options }));
  } catch (error) {
    if (error instanceof Refusal) throw error;
    throw new Refusal(0, "the server does not answer; is `stickslip web` still running in its terminal?");
  }
}

export const get = async (path) => (await ask(path)).json();

const sending = (method) => async (path, data = {}) =>
  (await ask(path, { method, headers: { "content-type": "application/json" }, body: JSON.stringify(data) })).json();

export const post = sending("POST");
export const put = sending("PUT");
export const remove = async (path) => (await ask(path, { method: "DELETE" })).json();

export const numbers = async (path, signal) => new Float64Array(await (await ask(path, { signal })).arrayBuffer());

// A file as it is; `progress` is told what part has gone.
export function upload(path, file, progress) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `/api${path}?name=${encodeURIComponent(file.name)}`);
    request.setRequestHeader("content-type", "application/octet-stream");
    request.upload.onprogress = (event) => event.lengthComputable && progress(event.loaded / event.total);
    request.onerror = () => reject(new Refusal(0, "the file did not arrive; is the server still running?"));
    request.onload = () => {
      let data = {};
      try {
        data = JSON.parse(request.responseText);
      } catch { /* the status tells */ }
      if (request.status < 300) resolve(data);
      else reject(new Refusal(request.status, data.error || `the server answered ${request.status}`));
    };
    request.send(file);
  });
}

// The token of the address becomes a cookie, and leaves the address.
export async function enter() {
  const match = /token=([\w-]+)/.exec(location.hash);
  if (!match) return;
  history.replaceState(null, "", location.pathname + "#/");
  await post("/session", { token: match[1] });
}

// What a job says, from its begin, also after a reload; returns a function that stops listening.
export function follow(path, heard) {
  const source = new EventSource(`/api${path}`);
  source.onmessage = (event) => {
    const line = JSON.parse(event.data);
    if (line.end) source.close();
    heard(line);
  };
  source.onerror = () => {
    // The browser asks again by itself, with the number of the last line; a job that is unknown now stays so.
    if (source.readyState === EventSource.CLOSED) heard({ end: "failed", error: "the server has forgotten this job" });
  };
  return () => source.close();
}
