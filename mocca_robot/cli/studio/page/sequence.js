// The order of assembly: chips to drag, a slider to go through it, tilt, and what MuJoCo sees.
import { state, changed, parts, inputParts, freeParts, verdicts, post, newest, flatly, insertionOf } from "./state.js";
import { makeElement as el, change } from "./settings.js";

const $ = (id) => document.getElementById(id);
let playing = false, question = 0;

export const reorder = (names) => change(["sequence"], names);
const move = (name, to) => {
  const names = inputParts().filter((p) => !p.fixed).map((p) => p.name), from = names.indexOf(name);
  if (from < 0 || to < 0 || to >= names.length || to === from) return;
  names.splice(to, 0, names.splice(from, 1)[0]);
  reorder(names);
};

let last = "";
export const render = (root) => {
  if (!state.input) { root.replaceChildren(); last = ""; return; }
  const all = inputParts(), states = verdicts()?.states || [], at = (name) => parts().findIndex((p) => p.name === name);
  const falls = new Set(states.filter((c) => !c.stands).map((c) => c.case));
  const barred = new Set((verdicts()?.insertions || []).filter((i) => !i.assemblable).map((i) => parts()[i.part].name));
  const signature = JSON.stringify([all.map((p) => [p.name, p.fixed, p.colour]), [...falls], [...barred], parts()[state.picked?.part]?.name, Math.floor(state.step)]);
  if (signature === last || lifted) return;
  last = signature;
  const focused = document.activeElement?.dataset?.name;
  const chip = (part, place) => {
    const mark = place === null ? null : barred.has(part.name) ? el("span", { className: "falls", title: "cannot go in" }, "⊘") : falls.has(`state_${part.name}`) ? el("span", { className: "falls", title: "falls after this step" }, "✗") : null;
    const item = el("li", { className: place === null ? "fixed" : state.step <= place ? "coming" : "", tabIndex: 0, data: { name: part.name, place: place ?? "" }, title: place === null ? `${part.name} is fixed` : `${place + 1}. ${part.name}; drag, or Alt+← →` },
      el("span", { className: `swatch ${part.fixed ? "cf" : `c${part.colour}`}` }), el("b", {}, place === null ? part.name : `${place + 1} ${part.name}`), mark);
    item.setAttribute("aria-current", String(parts()[state.picked?.part]?.name === part.name));
    item.addEventListener("click", () => { state.picked = at(part.name) < 0 ? null : { part: at(part.name) }; changed("picked"); });
    item.addEventListener("keydown", (e) => {
      if (e.altKey && (e.key === "ArrowLeft" || e.key === "ArrowRight") && place !== null) { e.preventDefault(); e.stopPropagation(); move(part.name, place + (e.key === "ArrowLeft" ? -1 : 1)); }
      if (e.key === "Enter") item.click();
    });
    if (place !== null) item.addEventListener("pointerdown", (e) => lift(e, item, root));
    return item;
  };
  root.replaceChildren(...all.filter((p) => p.fixed).map((p) => chip(p, null)), ...all.filter((p) => !p.fixed).map((p, n) => chip(p, n)));
  if (focused) root.querySelector(`[data-name="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
};

let lifted = null;
const lift = (e, item, root) => {
  const from = { x: e.clientX, far: 0 };
  const chips = [...root.children].filter((c) => c.dataset.place !== "");
  let target = null;
  const over = (m) => {
    from.far = Math.max(from.far, Math.abs(m.clientX - from.x));
    if (from.far < 6) return;
    lifted = item;
    item.classList.add("lifted");
    for (const c of chips) c.classList.remove("before", "after");
    let place = chips.findIndex((c) => { const b = c.getBoundingClientRect(); return m.clientX < b.left + b.width / 2; });
    if (place < 0) { place = chips.length; chips.at(-1).classList.add("after"); } else chips[place].classList.add("before");
    target = place;
  };
  const done = () => {
    removeEventListener("pointermove", over);
    removeEventListener("pointerup", done);
    removeEventListener("pointercancel", done);
    item.classList.remove("lifted");
    for (const c of chips) c.classList.remove("before", "after");
    lifted = null;
    if (target === null) return;
    const place = Number(item.dataset.place);
    move(item.dataset.name, target > place ? target - 1 : target);
    last = "";
    changed("sequence");
  };
  addEventListener("pointermove", over);
  addEventListener("pointerup", done);
  addEventListener("pointercancel", done);
};

const askTilt = newest(() => post("ask", { do: "tilt", which: state.which, angle_deg: state.tilt.angle, azimuth_deg: state.tilt.azimuth, question: ++question }), 30);
export const tiltAgain = () => { if (state.tilt.angle > 0) askTilt(); };

export const controls = () => {
  if (!state.input) return;
  const count = freeParts().length;
  if (state.step > count) state.step = count;
  const time = $("time");
  time.max = count;
  time.step = 0.02;
  if (document.activeElement !== time || playing) time.value = state.step;
  $("steps").textContent = state.motion ? `${state.motionTime.toFixed(2)} s` : `${Math.floor(state.step + 1e-6)} of ${count}`;
  $("tilt").value = state.tilt.angle;
  $("tiltvalue").textContent = `${state.tilt.angle}°`;
  const sides = flatly() ? [[0, "right"], [180, "left"]] : [[0, "+x"], [45, "+x +y"], [90, "+y"], [135, "−x +y"], [180, "−x"], [225, "−x −y"], [270, "−y"], [315, "+x −y"]];
  const select = $("azimuth");
  if (select.options.length !== sides.length) select.replaceChildren(...sides.map(([v, words]) => el("option", { value: v }, words)));
  select.value = state.tilt.azimuth;
  $("play").textContent = playing ? "❚❚" : "▶";
};

export const play = () => {
  playing = !playing;
  if (playing) {
    const count = freeParts().length;
    state.motion = null;
    if (state.step >= count) state.step = 0;
    let before = performance.now();
    const tick = (now) => {
      if (!playing) return;
      state.step = Math.min(count, state.step + (now - before) / 1000 * Math.max(1, count / 14));
      before = now;
      if (state.step >= count) playing = false;
      changed("step");
      if (playing) requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  changed("step");
};

export const letGo = () => {
  state.motion = null;
  state.step = freeParts().length;
  state.apart = 0;
  post("ask", { do: "let_go", which: state.which, angle_deg: state.tilt.angle, azimuth_deg: state.tilt.azimuth, question: ++question });
  $("letgo").disabled = true;
  changed("step");
};
export const playMotion = () => {
  $("letgo").disabled = false;
  if (!state.motion) return;
  state.motionTime = 0;
  const begun = performance.now(), end = state.motion.times.at(-1), seen = state.motion;
  const tick = (now) => {
    if (state.motion !== seen) return;
    state.motionTime = Math.min(end, (now - begun) / 1000 * 0.5);
    changed("motionframe");
    if (state.motionTime < end) requestAnimationFrame(tick);
    else setTimeout(() => { if (state.motion === seen) { state.motion = null; changed("motionframe"); } }, 1500);
  };
  requestAnimationFrame(tick);
};

export const start = () => {
  $("time").addEventListener("input", (e) => { playing = false; state.motion = null; state.step = Number(e.target.value); changed("step"); });
  $("time").addEventListener("change", () => { state.step = Math.abs(state.step - Math.round(state.step)) < 0.3 ? Math.round(state.step) : state.step; changed("step"); });
  $("play").addEventListener("click", play);
  $("tilt").addEventListener("input", (e) => {
    state.tilt.angle = Number(e.target.value);
    state.step = freeParts().length;
    if (state.tilt.angle === 0) state.tilted = null;
    state.motion = null;
    tiltAgain();
    changed("case", "step");
  });
  $("azimuth").addEventListener("change", (e) => { state.tilt.azimuth = Number(e.target.value); tiltAgain(); changed("case"); });
  $("letgo").addEventListener("click", letGo);
};
