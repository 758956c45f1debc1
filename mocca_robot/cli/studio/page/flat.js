// Flat parts as an SVG picture that can be picked, dragged and moved about.
import { state, changed, assembly, parts, showsResult, verdicts, currentCase, arrival, freeParts, insertionOf, post, flatly } from "./state.js";

const SVG = "http://www.w3.org/2000/svg";
const CORNER = 0.3;  // radians by which an outline turns at a corner; less is a curve drawn with straight edges
const FORCE = 0.12, WEDGE = 0.075, APPROACH = 0.35;
const view = { scale: 0, x: 0, y: 0, fitted: null };
let svg = null, dragging = null;

const make = (tag, attributes = {}, ...children) => {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) if (value !== null) element.setAttribute(name, value);
  element.append(...children.filter(Boolean));
  return element;
};
const title = (text) => { const t = make("title"); t.textContent = text; return t; };
const px = ([x, y]) => [view.x + view.scale * x, view.y - view.scale * y];
const world = (x, y) => [(x - view.x) / view.scale, (view.y - y) / view.scale];
const d = (rings) => rings.map((ring) => `M${ring.map((p) => px(p).map((v) => v.toFixed(1)).join(",")).join("L")}Z`).join(" ");

export const fit = () => { view.fitted = null; changed("fit"); };
const place = () => {
  const { width, height } = svg.getBoundingClientRect();
  const key = `${state.doc.file}|${state.doc.name}|${Math.round(width)}x${Math.round(height)}`;
  if (view.fitted === key || !width) return;
  const [low, high] = assembly().bounds;
  const pad = 0.12 * assembly().size;
  const wide = high[0] - low[0] + 2 * pad, tall = high[1] - low[1] + 2 * pad;
  view.scale = Math.min(width / wide, height / tall);
  view.x = width / 2 - view.scale * (low[0] + high[0]) / 2;
  view.y = height / 2 + view.scale * (low[1] + high[1]) / 2;
  view.fitted = key;
};

const shapesNow = () => {
  const built = showsResult() && !state.layers.corners;
  const shapes = built ? state.result.shapes : state.input.shapes;
  if (!dragging?.to) return shapes;
  const near = 1e-4 * assembly().size;
  return shapes.map((rings) => rings.map((ring) => ring.map((p) =>
    Math.hypot(p[0] - dragging.corner[0], p[1] - dragging.corner[1]) <= near ? dragging.to : p)));
};

// Shift (m) and turn (rad, about the centroid) of a part now: on its way in, apart, or as MuJoCo saw it.
const pose = (k) => {
  const part = parts()[k], size = assembly().size;
  let shift = [0, 0], turn = 0;
  const there = arrival(k);
  if (there <= 0) return null;
  if (there < 1) {
    const out = insertionOf(k)?.out || [0, 1];
    shift = out.map((v) => v * APPROACH * size * (1 - there) ** 2);
  }
  if (state.apart > 0) {
    const [low, high] = assembly().bounds;
    const middle = [(low[0] + high[0]) / 2, low[1]];
    shift = shift.map((s, a) => s + 0.8 * state.apart * (part.centroid[a] - middle[a]));
  }
  if (state.motion) {
    const at = state.motion.parts.indexOf(k);
    if (at >= 0) {
      const frame = frameNow();
      shift = frame[at].slice(0, 2);
      turn = frame[at][2];
    }
  }
  return { shift, turn };
};
export const frameNow = () => {
  const { times, poses } = state.motion;
  let f = times.findIndex((t) => t >= state.motionTime);
  if (f < 0) f = times.length - 1;
  return poses[f];
};

const arrow = (from, to, cls, words) => {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]], length = Math.hypot(dx, dy);
  if (length < 1.5) return null;
  const [ux, uy] = [dx / length, dy / length], head = Math.min(8, 0.5 * length);
  const base = [to[0] - head * ux, to[1] - head * uy];
  const tip = [to, [base[0] - 0.42 * head * uy, base[1] + 0.42 * head * ux], [base[0] + 0.42 * head * uy, base[1] - 0.42 * head * ux]];
  return make("g", { class: cls }, make("line", { x1: from[0].toFixed(1), y1: from[1].toFixed(1), x2: base[0].toFixed(1), y2: base[1].toFixed(1) }),
    make("polygon", { points: tip.map((p) => p.map((v) => v.toFixed(1)).join(",")).join(" ") }), words ? title(words) : null);
};

const settled = () => state.apart === 0 && !state.motion && !dragging;

export const draw = () => {
  if (!state.input || !flatly()) return;
  place();
  const all = parts();
  const picture = make("g", { class: "picture" });
  const shapes = shapesNow();
  const picked = state.picked, blockers = new Set(picked?.part === undefined ? [] : insertionOf(picked.part)?.blockers || []);
  const poses = all.map((_, k) => pose(k));
  const moved = (k, inner) => {
    const { shift, turn } = poses[k];
    if (!shift[0] && !shift[1] && !turn) return inner;
    const [x, y] = px(all[k].centroid);
    inner.setAttribute("transform", `translate(${(shift[0] * view.scale).toFixed(1)} ${(-shift[1] * view.scale).toFixed(1)}) rotate(${(-turn * 180 / Math.PI).toFixed(2)} ${x.toFixed(1)} ${y.toFixed(1)})`);
    return inner;
  };
  all.forEach((part, k) => {
    if (!poses[k]) return;
    const cls = ["part", part.fixed ? "cf" : `c${part.colour}`, picked?.part === k ? "picked" : "", blockers.has(k) ? "blocker" : ""].join(" ");
    picture.append(moved(k, make("path", { class: cls, "data-part": k, d: d(shapes[k]), "fill-rule": "evenodd" }, title(part.name + (part.fixed ? " (fixed)" : "")))));
  });
  if (settled()) {
    if (state.layers.joints) picture.append(joints());
    if (state.layers.cones || picked?.part !== undefined) picture.append(cones());
    const shown = currentCase();
    if (shown?.stands && state.layers.forces) picture.append(forces(shown));
    if (shown && !shown.stands && state.layers.collapse && !state.layers.corners) picture.append(collapse(shown, shapes));
  }
  if (state.layers.names) all.forEach((part, k) => poses[k] && picture.append(moved(k, name(part, k, shapes[k]))));
  if (state.layers.corners) picture.append(corners(shapes));
  const [gx, gy] = px([(assembly().bounds[0][0] + assembly().bounds[1][0]) / 2, assembly().bounds[0][1]]);
  const reach = 0.6 * view.scale * assembly().size;
  const ground = make("line", { class: "ground", x1: gx - reach, y1: gy, x2: gx + reach, y2: gy });
  const world_ = make("g", {}, ground, picture);
  const lean = state.tilt.angle * (state.tilt.azimuth === 180 ? -1 : 1);
  if (lean) world_.setAttribute("transform", `rotate(${lean} ${gx.toFixed(1)} ${gy.toFixed(1)})`);
  const hatch = make("pattern", { id: "hatch", width: 6, height: 6, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
    make("rect", { class: "hatch-bg", width: 6, height: 6 }), make("line", { class: "hatch-line", x1: 0, y1: 0, x2: 0, y2: 6 }));
  const focused = document.activeElement?.dataset?.corner;
  svg.replaceChildren(make("defs", {}, hatch), world_);
  if (focused !== undefined) svg.querySelector(`[data-corner="${focused}"]`)?.focus({ preventScroll: true });
};

const name = (part, k, rings) => {
  let [x, y] = px(part.centroid);
  const xs = rings[0].map((p) => p[0]), room = (Math.max(...xs) - Math.min(...xs)) * view.scale;
  const size = Math.max(7, Math.min(13, 1.55 * room / Math.max(part.name.length, 1)));
  const text = make("text", { class: "name", x: x.toFixed(1), y: (y + 0.35 * size).toFixed(1), "font-size": size.toFixed(1) });
  text.style.fontSize = `${size.toFixed(1)}px`;
  text.textContent = part.name;
  return text;
};

const isThere = ([i, j]) => arrival(i) >= 1 && arrival(j) >= 1;

const joints = () => {
  const group = make("g");
  const built = showsResult();
  const listed = built ? state.result.joints : state.input.contacts.map((c) => ({ ...c, vertices: c.outline, planar: true, kind: "contact" }));
  for (const joint of listed) {
    if (!isThere(joint.parts)) continue;
    const points = joint.vertices.map((p) => px(p).map((v) => v.toFixed(1)).join(",")).join(" ");
    const chosen = state.picked?.joint && same(state.picked.joint, joint);
    const key = JSON.stringify([...joint.parts, joint.k]);
    group.append(make("polyline", { class: `joint ${joint.planar ? "planar" : ""} ${chosen ? "picked" : ""}`, points }));
    group.append(make("polyline", { class: "joint-hit", points, "data-joint": key }, title(joint.parts.map((p) => parts()[p].name).join(" – "))));
  }
  return group;
};
const same = (a, b) => a.parts[0] === b.parts[0] && a.parts[1] === b.parts[1] && a.k === b.k;

const forces = (shown) => {
  const group = make("g"), size = assembly().size;
  const largest = Math.max(...shown.forces.map((f) => Math.hypot(...f.vector)), 1e-12);
  for (const force of shown.forces) {
    const strength = Math.hypot(...force.vector), length = FORCE * size * Math.sqrt(strength / largest);
    const to = force.at.map((v, a) => v + force.vector[a] / strength * length);
    const [i, j] = force.parts;
    const mine = state.picked?.part === i || state.picked?.part === j || (state.picked?.joint && state.picked.joint.parts[0] === i && state.picked.joint.parts[1] === j);
    if (state.picked && !mine) continue;
    const drawn = arrow(px(force.at), px(to), `force ${mine ? "of-picked" : ""}`, `${strength.toPrecision(3)} N on ${parts()[j].name} from ${parts()[i].name}`);
    if (drawn) group.append(drawn);
  }
  return group;
};

const collapse = (shown, shapes) => {
  const group = make("g");
  for (const k of shown.moving) {
    const [dx, dy, turn] = shown.motions[k], centre = parts()[k].centroid, [x, y] = px(centre);
    const transform = `translate(${(dx * view.scale).toFixed(1)} ${(-dy * view.scale).toFixed(1)}) rotate(${(-turn * 180 / Math.PI).toFixed(2)} ${x.toFixed(1)} ${y.toFixed(1)})`;
    group.append(make("path", { class: "ghost", d: d(shapes[k]), transform }));
    const drawn = arrow([x, y], px([centre[0] + dx, centre[1] + dy]), "moves", `${parts()[k].name} moves this way`);
    if (drawn) group.append(drawn);
  }
  return group;
};

const wedge = (centre, angle, low, high, radius, cls, words) => {
  const steps = Math.max(3, Math.ceil((high - low) / 0.15)), points = high - low < 2 * Math.PI - 1e-6 ? [centre] : [];
  for (let s = 0; s <= steps; s++) {
    const a = angle + low + (high - low) * s / steps;
    points.push([centre[0] + radius * Math.cos(a), centre[1] - radius * Math.sin(a)]);
  }
  return make("polygon", { class: cls, points: points.map((p) => p.map((v) => v.toFixed(1)).join(",")).join(" ") }, title(words));
};

const cones = () => {
  const group = make("g"), found = verdicts();
  if (!found) return group;
  const alpha = (assembly().alpha_deg || 0) * Math.PI / 180;
  const radius = WEDGE * Math.min(1, Math.sqrt(8 / found.insertions.length) + 0.4) * assembly().size * view.scale;
  for (const item of found.insertions) {
    if (arrival(item.part) < 1 || (!state.layers.cones && state.picked?.part !== item.part)) continue;
    const centre = px(parts()[item.part].centroid), angle = Math.atan2(item.out[1], item.out[0]), name = parts()[item.part].name;
    if (item.cone) group.append(wedge(centre, angle, item.cone[0] * Math.PI / 180, item.cone[1] * Math.PI / 180, radius, "cone", `${name} can leave within this cone`));
    if (alpha) group.append(wedge(centre, angle, -alpha, alpha, radius, "asked", `${name}: asked for`));
    const far = [centre[0] + 1.35 * radius * item.out[0], centre[1] - 1.35 * radius * item.out[1]];
    const drawn = arrow(far, centre, item.assemblable ? "way" : "way blocked", `${name} goes in this way`);
    if (drawn) group.append(drawn);
  }
  return group;
};

const corners = (shapes) => {
  const group = make("g"), seen = new Map(), near = 1e-4 * assembly().size;
  // Points along a curve are no corners, except where another part has the same one.
  const key = (p) => p.map((v) => Math.round(v / near)).join(","), owners = new Map();
  shapes.forEach((rings, k) => rings.forEach((ring) => ring.forEach((p) => owners.set(key(p), (owners.get(key(p)) || new Set()).add(k)))));
  shapes.forEach((rings) => rings.forEach((ring) => ring.forEach((p, n) => {
    if (turning(ring, n) > CORNER || owners.get(key(p)).size > 1) seen.set(key(p), p);
  })));
  let number = 0;
  for (const p of seen.values()) {
    const [x, y] = px(p);
    group.append(make("circle", { class: "handle", cx: x.toFixed(1), cy: y.toFixed(1), r: 5, tabindex: 0, "data-corner": number++,
      "data-x": p[0], "data-y": p[1], role: "button", "aria-label": `Corner at ${words(p)}` }, title(words(p))));
  }
  return group;
};
const turning = (ring, n) => {
  const [a, b, c] = [ring.at(n - 1), ring[n], ring[(n + 1) % ring.length]];
  const by = Math.atan2(c[1] - b[1], c[0] - b[0]) - Math.atan2(b[1] - a[1], b[0] - a[0]);
  return Math.abs(Math.atan2(Math.sin(by), Math.cos(by)));
};
const words = (p) => `${p.map((v) => (v / state.input.unit_m).toPrecision(5) * 1).join(", ")} ${state.input.unit}`;

const move = async (corner, to) => {
  if (Math.hypot(corner[0] - to[0], corner[1] - to[1]) < 1e-9) return;
  const answer = await post("corner", { corner, to });
  dragging = null;
  if (!answer.ok) { state.refused = answer.error; changed("refused"); }
  changed("drag");
};

export const start = (element) => {
  svg = element;
  let held = null;
  svg.addEventListener("pointerdown", (e) => {
    svg.setPointerCapture(e.pointerId);
    const data = e.target.dataset || {};
    held = { x: e.clientX, y: e.clientY, far: 0, data };
    if (data.corner !== undefined) dragging = { corner: [Number(data.x), Number(data.y)], to: null };
  });
  svg.addEventListener("pointermove", (e) => {
    if (!held) return;
    const [dx, dy] = [e.clientX - held.x, e.clientY - held.y];
    held.far = Math.max(held.far, Math.hypot(dx, dy));
    if (dragging) {
      const box = svg.getBoundingClientRect(), to = world(e.clientX - box.left, e.clientY - box.top);
      if (e.shiftKey) {
        const side = Math.abs(to[0] - dragging.corner[0]) > Math.abs(to[1] - dragging.corner[1]) ? 1 : 0;
        to[side] = dragging.corner[side];
      }
      const grid = 10 ** Math.floor(Math.log10(4 / view.scale));
      dragging.to = held.far > 2 ? to.map((v, a) => (v === dragging.corner[a] ? v : Math.round(v / grid) * grid)) : null;
      changed("drag");
    } else if (held.far > 3) {
      view.x += e.clientX - (held.lastX ?? held.x);
      view.y += e.clientY - (held.lastY ?? held.y);
      changed("view");
    }
    held.lastX = e.clientX; held.lastY = e.clientY;
  });
  const release = () => {
    if (!held) return;
    const { data, far } = held;
    held = null;
    if (dragging) {
      const { corner, to } = dragging;
      if (to) move(corner, to); else { dragging = null; changed("drag"); }
      return;
    }
    if (far > 3) return;
    if (data.joint) { const [i, j, k] = JSON.parse(data.joint); state.picked = { joint: { parts: [i, j], k } }; }
    else state.picked = data.part === undefined ? null : { part: Number(data.part) };
    changed("picked");
  };
  svg.addEventListener("pointerup", release);
  svg.addEventListener("pointercancel", () => { held = null; dragging = null; changed("drag"); });
  svg.addEventListener("wheel", (e) => {
    e.preventDefault();
    const box = svg.getBoundingClientRect();
    zoom(Math.exp(-e.deltaY * 0.0012), e.clientX - box.left, e.clientY - box.top);
  }, { passive: false });
  svg.addEventListener("keydown", (e) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    const data = e.target.dataset || {};
    if (step && data.corner !== undefined) {
      e.preventDefault();
      const grid = (e.shiftKey ? 10 : 1) * 10 ** Math.round(Math.log10(0.002 * assembly().size));
      const corner = [Number(data.x), Number(data.y)];
      move(corner, corner.map((v, a) => v + step[a] * grid));
    } else if (step) {
      e.preventDefault();
      view.x -= 30 * step[0]; view.y += 30 * step[1];
      changed("view");
    }
    if (e.key === "+" || e.key === "-") { const b = svg.getBoundingClientRect(); zoom(e.key === "+" ? 1.15 : 0.87, b.width / 2, b.height / 2); }
  });
  new ResizeObserver(() => changed("view")).observe(svg);
};
const zoom = (factor, x, y) => {
  view.x = x + factor * (view.x - x);
  view.y = y + factor * (view.y - y);
  view.scale *= factor;
  changed("view");
};
