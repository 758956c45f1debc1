// Fields and sliders: what is asked, bounds on joints, material, loads. What is typed stays, also where it is refused.
import { state, changed, post, newest, parts, inputParts, flatly } from "./state.js";

const el = (tag, props = {}, ...children) => {
  const { data, ...rest } = props;
  const made = Object.assign(document.createElement(tag), rest);
  if (data) Object.assign(made.dataset, data);
  made.append(...children.filter((c) => c !== null && c !== undefined));
  return made;
};
const WORDS = {
  alpha_deg: "Insertion cone α", "joints.max_slope_deg": "Steepest slope", "joints.max_height": "Largest height",
  "joints.margin": "Distance to edges", "joints.min_radius": "Smallest radius", "joints.tilt_margin_deg": "Tilt reserve",
  "joints.alpha_margin_deg": "α reserve", "joints.inset": "Inset", "joints.min_contact": "Shortest contact",
  "joints.min_distance": "Least distance", "joints.friction": "Friction the design counts on",
  "joints.friction_safety": "Safety on friction", density: "Density", thickness: "Thickness", friction: "Friction for analysis",
  gravity: "Gravity", material: "Material", "simulate.friction": "Friction in physics", "simulate.azimuths": "Tilt directions",
  "joints.piecewise_planar": "Flat flanks only", loads: "Loads in hand",
};
// Where a slider begins and ends; a value beyond can still be typed.
const RANGE = {
  alpha_deg: [0, 30, 0.5], "joints.max_slope_deg": [5, 85, 1], "joints.max_height": [0.05, 1, 0.01], "joints.margin": [0, 0.4, 0.01],
  "joints.tilt_margin_deg": [0, 15, 0.25], density: [50, 3000, 10], friction: [0, 1, 0.01], "joints.friction": [0, 1, 0.01],
};
const errors = new Map();
const drafts = new Map();
const updates = [];

const told = (name) => name.split(".").reduce((inside, key) => (inside && typeof inside === "object" ? inside[key] : undefined), state.doc.data || {});
const key = (name) => state.keys.find((k) => k.name === name) || { name, about: "", kind: "text", unit: "", default: null };
const written = (value) => (value === undefined || value === null ? "" : typeof value === "object" ? JSON.stringify(value) : String(value));
const fallback = (name) => { const v = state.input?.values?.[name]; return v ?? key(name).default; };

export const change = async (path, value, merge = false) => {
  const name = path.join(".");
  const answer = await post("change", { path, value, merge });
  if (answer.ok) { errors.delete(name); drafts.delete(name); } else errors.set(name, answer.error);
  changed("settings");
  return answer.ok;
};
const sliding = newest((path, value) => change(path, value, true), 40);

const field = (name, { wide = false, multiline = false, shown = null } = {}) => {
  const k = key(name), path = name.split("."), id = `f-${name.replaceAll(".", "-")}`, range = RANGE[name];
  const input = el(multiline ? "textarea" : "input", { id, spellcheck: false, autocomplete: "off" });
  if (!multiline) input.type = "text";
  const unit = { deg: "°", units: state.input?.unit || "", "": "" }[k.unit] ?? k.unit;
  const reset = el("button", { type: "button", className: "reset", title: "Back to the default", ariaLabel: `Default for ${WORDS[name] || name}`, onclick: () => { drafts.delete(name); change(path, null); } }, "×");
  const slider = range ? el("input", { type: "range", min: range[0], max: range[1], step: range[2], tabIndex: 0, ariaLabel: WORDS[name] || name }) : null;
  const error = el("div", { className: "error", role: "alert" });
  const box = el("div", { className: `field ${wide ? "wide" : ""}`, data: { key: name } },
    el("div", { className: "top" }, el("label", { htmlFor: id, title: `${name}: ${k.about}` }, WORDS[name] || name),
      wide ? reset : el("span", { className: "value" }, input, el("span", { className: "unit" }, unit), reset)),
    wide ? input : null, slider, error);
  const send = () => { drafts.set(name, input.value); change(path, input.value); };
  input.addEventListener("change", send);
  input.addEventListener("input", () => drafts.set(name, input.value));
  if (!multiline) input.addEventListener("keydown", (e) => { if (e.key === "Escape") { drafts.delete(name); errors.delete(name); changed("settings"); } });
  slider?.addEventListener("input", () => { input.value = slider.value; drafts.delete(name); sliding(path, Number(slider.value)); });
  updates.push(() => {
    const value = told(name), effective = value === undefined ? fallback(name) : value;
    const text = drafts.has(name) ? drafts.get(name) : shown ? shown(effective) : written(effective);
    if (document.activeElement !== input || !drafts.has(name)) input.value = text;
    if (slider && document.activeElement !== slider) slider.value = Number.parseFloat(written(effective)) || 0;
    const wrong = errors.get(name) || (state.problem?.path === name ? state.problem.text : "");
    error.textContent = wrong;
    box.classList.toggle("wrong", Boolean(wrong));
    box.classList.toggle("set", value !== undefined);
    reset.hidden = value === undefined;
  });
  return box;
};

const check = (name, words) => {
  const box = el("input", { type: "checkbox", id: `f-${name.replaceAll(".", "-")}` });
  box.addEventListener("change", () => change(name.split("."), box.checked));
  updates.push(() => { box.checked = Boolean(told(name) ?? fallback(name)); });
  return el("label", { className: "check", title: key(name).about }, box, words);
};

// --- goals

const goals = () => {
  const told_ = told("goal") ?? fallback("goal") ?? "equilibrium";
  const list = Array.isArray(told_) ? told_ : [told_];
  return list.map((g) => (typeof g === "string" ? { kind: g } : g));
};
const setGoals = (list, merge = false) => change(["goal"], list.length ? list : [{ kind: "equilibrium" }], merge);
const without = (kind) => goals().filter((g) => g.kind !== kind);
const goalPanel = () => {
  const free = el("input", { type: "checkbox", id: "goal-free" }), lateral = el("input", { type: "checkbox", id: "goal-lateral" });
  const locked = el("input", { type: "checkbox", id: "goal-locked" }), keyPart = el("select", { ariaLabel: "Key part" });
  const angle = el("input", { type: "range", min: 1, max: 45, step: 0.5, ariaLabel: "Angle of the ground" }), angleText = el("input", { type: "text", ariaLabel: "Angle of the ground in degrees" });
  const error = el("div", { className: "error", role: "alert" });
  free.onchange = () => setGoals(free.checked ? [...goals(), { kind: "support_free" }] : without("support_free"));
  lateral.onchange = () => setGoals(lateral.checked ? [...without("equilibrium"), { kind: "lateral", angle_deg: 10 }] : without("lateral"));
  locked.onchange = () => setGoals(locked.checked ? [...goals(), { kind: "interlocking", key: keyPart.value || parts().at(-1).name }] : without("interlocking"));
  keyPart.onchange = () => setGoals([...without("interlocking"), { kind: "interlocking", key: keyPart.value }]);
  const lean = (value, merge) => setGoals(goals().map((g) => (g.kind === "lateral" ? { ...g, angle_deg: value } : g)), merge);
  const slide = newest((v) => lean(v, true), 40);
  angle.oninput = () => { angleText.value = angle.value; slide(Number(angle.value)); };
  angleText.onchange = () => lean(Number.isNaN(Number(angleText.value)) ? angleText.value : Number(angleText.value), false);
  const angleBox = el("div", { className: "field" }, el("div", { className: "top" }, el("span", {}, "Ground tilts by"),
    el("span", { className: "value" }, angleText, el("span", { className: "unit" }, "°"))), angle);
  const keyBox = el("div", { className: "field wide" }, keyPart);
  updates.push(() => {
    const list = goals(), side = list.find((g) => g.kind === "lateral"), lock = list.find((g) => g.kind === "interlocking");
    free.checked = list.some((g) => g.kind === "support_free");
    lateral.checked = Boolean(side);
    locked.checked = Boolean(lock);
    angleBox.hidden = !side;
    keyBox.hidden = !lock;
    if (side && document.activeElement !== angleText) angleText.value = side.angle_deg;
    if (side && document.activeElement !== angle) angle.value = side.angle_deg;
    const names = inputParts().filter((p) => !p.fixed).map((p) => p.name);
    if (keyPart.options.length !== names.length) keyPart.replaceChildren(...names.map((n) => el("option", {}, n)));
    if (lock) keyPart.value = lock.key;
    error.textContent = errors.get("goal") || (state.problem?.path === "goal" ? state.problem.text : "");
  });
  return el("div", { data: { key: "goal" } }, el("div", { className: "check mute" }, "✓ stands under its own weight"),
    el("label", { className: "check" }, free, "stands after every step"), el("label", { className: "check" }, lateral, "stands on tilted ground"), angleBox,
    el("label", { className: "check" }, locked, "interlocks with a key held"), keyBox, error);
};

const kinds = () => {
  const box = el("div", { className: "field" }), all = flatly() ? ["n", "z"] : ["n", "frustum"];
  const words = { n: "bump", z: "bump and dent", frustum: "block (frustum)" };
  const inputs = all.map((kind) => {
    const input = el("input", { type: "checkbox", id: `kind-${kind}` });
    input.onchange = () => {
      const now = all.filter((_, i) => inputs[i].checked);
      if (!now.length) { input.checked = true; return; }
      change(["joints", "kinds"], now);
    };
    box.append(el("label", { className: "check" }, input, words[kind]));
    return input;
  });
  updates.push(() => {
    const now = told("joints.kinds") ?? fallback("joints.kinds") ?? all;
    inputs.forEach((input, i) => { input.checked = [now].flat().includes(all[i]); });
  });
  return box;
};

// --- loads

const EXAMPLES = {
  force: (p) => `{name: force, kind: force, part: ${p}, force: 10 N, direction: down}`,
  mass: (p) => `{name: mass, kind: mass, part: ${p}, mass: 1 kg}`,
  pressure: () => "{name: snow, kind: pressure, facing: up, pressure: 1 kN/m²}",
  wind: () => "{name: wind, kind: wind, pressure: 0.5 kN/m², towards: +x}",
  worker: () => "{name: worker, kind: worker, mass: 80 kg}",
  acceleration: () => "{name: quake, kind: acceleration, acceleration: 0.1 g, direction: +x}",
};
const asLines = (value) => {
  if (!value || !value.length) return "";
  const one = (v) => (v === null || typeof v !== "object" ? String(v) : Array.isArray(v) ? `[${v.map(one).join(", ")}]`
    : `{${Object.entries(v).map(([k, x]) => `${k}: ${one(x)}`).join(", ")}}`);
  return value.map((v) => `- ${one(v)}`).join("\n");
};
const loads = () => {
  const add = el("select", { ariaLabel: "Add a load" }, el("option", { value: "" }, "Add a load …"), ...Object.keys(EXAMPLES).map((k) => el("option", {}, k)));
  add.onchange = () => {
    if (!add.value) return;
    const part = state.picked?.part ?? parts().findLastIndex((p) => !p.fixed);
    const text = [asLines(told("loads") || []), `- ${EXAMPLES[add.value](parts()[part]?.name ?? "PART")}`].filter(Boolean).join("\n");
    add.value = "";
    drafts.set("loads", text);
    change(["loads"], text);
  };
  return el("div", {}, el("div", { className: "field wide" }, add), field("loads", { wide: true, multiline: true, shown: asLines }),
    el("p", { className: "about" }, "One load a line, as in the YAML file. Each acts alone beside gravity."));
};

let madeFor = null;
export const render = (root) => {
  if (!state.doc.open || !state.keys.length || !state.input) return;
  const shape = `${state.input.assembly.dimension}|${state.input.unit}`;
  if (madeFor !== shape) {
    madeFor = shape;
    updates.length = 0;
    const flat = flatly();
    root.replaceChildren(
      el("h2", {}, "What is asked"), goalPanel(), field("alpha_deg"),
      el("h2", {}, "Bounds on joints"), kinds(), field("joints.max_slope_deg"), field("joints.max_height"), field("joints.margin"), field("joints.tilt_margin_deg"),
      el("details", {}, el("summary", {}, "More about joints"), ...["joints.min_radius", "joints.min_contact", "joints.min_distance", "joints.inset", "joints.alpha_margin_deg"].map((n) => field(n)), check("joints.piecewise_planar", "flat flanks, for saws and wires")),
      el("h2", {}, "Material"), field("density"), ...(flat ? [field("thickness")] : []), field("friction"), field("joints.friction"),
      el("details", {}, el("summary", {}, "More about material and physics"), ...["joints.friction_safety", "material", "gravity", "simulate.friction", "simulate.azimuths"].map((n) => field(n))),
      el("h2", {}, "Loads"), loads(),
    );
  }
  for (const update of updates) update();
};
export const forget = () => { errors.clear(); drafts.clear(); madeFor = null; };
export const makeElement = el;
