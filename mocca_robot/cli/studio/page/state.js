// What the page knows, and who wants to hear when it changes. Requests to the server go out from here.

const windowName = () => {
  let name = location.hash.slice(1);
  if (!/^[A-Za-z0-9_-]{4,40}$/.test(name)) {
    name = Array.from(crypto.getRandomValues(new Uint8Array(9)), (b) => (b % 36).toString(36)).join("");
    history.replaceState(null, "", `#${name}`);
  }
  return name;
};

export const state = {
  window: windowName(),
  online: true,
  doc: { open: false, revision: 0 },
  keys: [],
  input: null, before: null, result: null, problem: null, progress: null, jobs: [],
  which: "result",
  layers: { joints: true, forces: true, collapse: true, cones: false, names: true, corners: false },
  apart: 0, cut: 0,
  step: Infinity,
  tilt: { angle: 0, azimuth: 0 }, tilted: null,
  motion: null, motionTime: 0,
  picked: null, refused: "",
  shownCase: null,
};

const listeners = new Set();
let asked = false;
export const listen = (what) => { listeners.add(what); };
// All that changed within one frame is drawn once.
export const changed = (...what) => {
  for (const w of what.length ? what : ["all"]) pending.add(w);
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    const now = new Set(pending);
    pending.clear();
    for (const hear of listeners) hear(now);
  });
};
const pending = new Set();

export const post = async (what, body = {}) => {
  try {
    const answer = await fetch(`/api/${state.window}/${what}`, {
      method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
    });
    return await answer.json();
  } catch {
    return { ok: false, error: "The studio does not answer; is it still running?" };
  }
};

export const drop = async (files, units) => {
  const listed = files.map((f) => ({ name: f.webkitRelativePath || f.path || f.name, size: f.size }));
  const head = `${JSON.stringify({ files: listed, units })}\n`;
  try {
    const answer = await fetch(`/api/${state.window}/drop`, { method: "POST", body: new Blob([head, ...files]) });
    return await answer.json();
  } catch {
    return { ok: false, error: "The studio does not answer; is it still running?" };
  }
};

// Of many requests in a row only the last one counts: sliders.
export const newest = (send, gap = 60) => {
  let waiting = null, timer = null;
  const go = async () => {
    const next = waiting;
    waiting = null;
    await send(...next);
    timer = setTimeout(() => { timer = null; if (waiting) { timer = true; go(); } }, gap);
  };
  return (...values) => {
    waiting = values;
    if (!timer) { timer = true; go(); }
  };
};

export const flatly = () => !state.input || state.input.assembly.dimension === 2;
export const fresh = (stage) => Boolean(state[stage]) && state[stage].revision === state.doc.revision;
// What is shown: the result where it was asked for and is there, else the input.
export const showsResult = () => state.which === "result" && Boolean(state.result) && Boolean(state.input);
// Its parts in the order that its indices mean: a change of the sequence, or of what is fixed, reorders them.
export const assembly = () => (showsResult() ? state.result.assembly : state.input?.assembly);
export const parts = () => assembly()?.parts || [];
export const inputParts = () => state.input?.assembly.parts || [];
export const stale = () => !fresh(showsResult() ? "result" : "input");
export const verdicts = () => (showsResult() ? state.result : state.before?.revision === state.input?.revision ? state.before : null);
// What is picked stays picked while `change` exchanges what is shown.
export const keepPicked = (change) => {
  const names = parts().map((p) => p.name), picked = state.picked;
  change();
  const now = parts().map((p) => p.name), place = (k) => now.indexOf(names[k]);
  if (picked?.part !== undefined) state.picked = place(picked.part) < 0 ? null : { part: place(picked.part) };
  if (picked?.joint) {
    const pair = picked.joint.parts.map(place).sort((a, b) => a - b);
    state.picked = pair[0] < 0 ? null : { joint: { ...picked.joint, parts: pair } };
  }
};
export const freeParts = () => parts().map((p, k) => ({ ...p, index: k })).filter((p) => !p.fixed);
export const insertionOf = (k) => (verdicts()?.insertions || []).find((i) => i.part === k);

// The load case whose forces or motion are drawn.
export const currentCase = () => {
  if (state.tilt.angle > 0) return state.tilted;
  const found = verdicts();
  if (!found) return null;
  const count = freeParts().length;
  if (state.step < count) {
    const name = Math.abs(state.step - Math.round(state.step)) < 1e-6 && state.step >= 1
      ? `state_${freeParts()[Math.round(state.step) - 1].name}` : null;
    return (found.states || []).find((c) => c.case === name) || null;
  }
  const chosen = found.cases.find((c) => c.case === state.shownCase);
  return chosen || found.cases.find((c) => !c.stands) || found.cases[0] || null;
};

// How far a part is on its way at the present step: 0 not there, 1 in place.
export const arrival = (k) => {
  const order = freeParts().findIndex((p) => p.index === k);
  return order < 0 ? 1 : Math.max(0, Math.min(1, state.step - order));
};

let events = null, lost = null;
export const connect = () => {
  events = new EventSource(`/api/${state.window}/events`);
  events.onopen = () => { clearTimeout(lost); state.online = true; changed("online"); };
  events.onerror = () => {
    clearTimeout(lost);
    lost = setTimeout(() => { state.online = false; changed("online"); }, 600);
    if (events.readyState === EventSource.CLOSED) setTimeout(connect, 1500);
  };
  events.onmessage = (e) => hear(JSON.parse(e.data));
};

const hear = (event) => {
  const stage = event.stage;
  if (stage === "opened") {
    Object.assign(state, { input: null, before: null, result: null, problem: null, progress: null, picked: null,
      step: Infinity, tilted: null, motion: null, shownCase: null, apart: 0, cut: 0 });
    state.tilt = { angle: 0, azimuth: 0 };
    changed("opened");
  } else if (stage === "document") {
    state.doc = event;
    if (event.busy) state.problem = null;
    changed("document");
  } else if (stage === "progress") {
    state.progress = event;
    changed("progress");
  } else if (stage === "problem") {
    state.problem = event;
    state.progress = null;
    state.doc.busy = false;
    changed("problem", "document");
  } else if (stage === "tilt") {
    if (state.tilt.angle > 0) { state.tilted = event; changed("case"); }
  } else if (stage === "let_go") {
    state.motion = event;
    changed("motion");
  } else if (stage === "jobs") {
    state.jobs = event.jobs;
    changed("jobs");
  } else if (stage === "refused") {
    state.motion = null;
    state.refused = event.text;
    changed("refused");
  } else {
    keepPicked(() => { state[stage] = event; });
    if (stage === "input") state.motion = null;
    if (stage === "result") { state.progress = null; state.doc.busy = false; state.problem = null; }
    changed(stage);
  }
};
