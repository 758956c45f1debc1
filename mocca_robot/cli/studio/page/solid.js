// Solid parts in WebGL 2: turn, zoom, pick, take apart, cut open; joints, forces, cones and motions over them.
import { state, changed, assembly, parts, showsResult, verdicts, currentCase, arrival, insertionOf, flatly } from "./state.js";
import { frameNow } from "./flat.js";

const MANY = 40;  // with more parts only the picked one is named: labels would hide the picture
const FORCE = 0.14, APPROACH = 0.45, CONE = 0.09;
const view = { azimuth: -1.05, elevation: 0.38, distance: 1, centre: [0, 0, 0], fitted: null };
let canvas = null, gl = null, shader = null, tags = null, labels = [];
const meshes = { input: null, result: null, inputFor: null, resultFor: null, joints: null, jointsFor: null };

const VERTEX = `in vec3 position; uniform mat4 camera; uniform vec3 low, grid, pivot, shift; uniform vec4 turn; uniform float bias;
 out vec3 world;
 void main() { vec3 arm = low + grid * position - pivot;
   world = pivot + shift + arm + 2.0 * cross(turn.xyz, cross(turn.xyz, arm) + turn.w * arm);
   gl_Position = camera * vec4(world, 1.0); gl_Position.z -= bias * gl_Position.w; }`;
const FRAGMENT = `in vec3 world; uniform vec3 eyePlane; uniform vec4 colour, plane; uniform float flat_; out vec4 painted;
 void main() { if (dot(plane.xyz, world) > plane.w) discard;
   vec3 n = normalize(cross(dFdx(world), dFdy(world)));
   if (dot(n, eyePlane) < 0.0) n = -n;
   float light = 0.52 + 0.34 * max(dot(n, normalize(vec3(0.3, -0.45, 0.85))), 0.0) + 0.2 * max(dot(n, eyePlane), 0.0);
   vec3 rgb = colour.rgb * mix(light, 1.0, flat_);
   if (!gl_FrontFacing && flat_ < 0.5 && plane.w < 1e8) rgb = colour.rgb * 0.62;
   painted = vec4(rgb, colour.a); }`;
const UNIFORMS = ["camera", "eyePlane", "low", "grid", "pivot", "shift", "turn", "colour", "flat_", "bias", "plane"];

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const compile = () => {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const s = gl.createShader(kind);
    gl.shaderSource(s, `#version 300 es\nprecision highp float;\n${text}`);
    gl.compileShader(s);
    if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
    gl.attachShader(program, s);
  }
  gl.bindAttribLocation(program, 0, "position");
  gl.linkProgram(program);
  return { program, at: Object.fromEntries(UNIFORMS.map((n) => [n, gl.getUniformLocation(program, n)])) };
};
const buffer = (data, target) => {
  const made = gl.createBuffer();
  gl.bindBuffer(target, made);
  gl.bufferData(target, data, gl.STATIC_DRAW);
  return made;
};
const geometry = (mesh) => {
  const kind = mesh.wide ? Uint32Array : Uint16Array;
  const vertices = buffer(new Uint16Array(bytes(mesh.vertices)), gl.ARRAY_BUFFER);
  const made = [vertices];
  const set = (indices) => {
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, vertices);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, false, 6, 0);
    const data = new kind(bytes(indices));
    made.push(buffer(data, gl.ELEMENT_ARRAY_BUFFER));
    gl.bindVertexArray(null);
    return { vao, count: data.length, type: mesh.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT };
  };
  return { low: mesh.low, step: mesh.step, faces: set(mesh.faces), edges: set(mesh.edges), made };
};
const points = (list) => {
  const data = new Float32Array(list.flat(Infinity));
  const vao = gl.createVertexArray();
  gl.bindVertexArray(vao);
  const made = [buffer(data, gl.ARRAY_BUFFER)];
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12, 0);
  gl.bindVertexArray(null);
  return { vao, count: data.length / 3, made };
};
const forget = (list) => {
  for (const one of list || []) {
    for (const b of one.made) gl.deleteBuffer(b);
    for (const v of [one.vao, one.faces?.vao, one.edges?.vao]) if (v) gl.deleteVertexArray(v);
  }
};

const prepare = () => {
  for (const which of ["input", "result"]) {
    if (state[which] !== meshes[`${which}For`]) {
      forget(meshes[which]);
      meshes[which] = state[which]?.shapes.map(geometry) || null;
      meshes[`${which}For`] = state[which];
    }
  }
  if (state.result !== meshes.jointsFor) {
    forget(meshes.joints);
    meshes.joints = state.result?.joints.map((j) => points(j.facets.map((f) => f.map((v) => j.vertices[v])))) || null;
    meshes.jointsFor = state.result;
  }
  if (labels.length !== parts().length || labels.some((l, k) => l.textContent !== parts()[k].name)) {
    labels = parts().map((p) => { const tag = document.createElement("span"); tag.textContent = p.name; return tag; });
    tags.replaceChildren(...labels);
  }
};

export const fit = () => { view.fitted = null; changed("fit"); };
const place = () => {
  const key = `${state.doc.file}|${state.doc.name}`;
  if (view.fitted === key) return;
  const [low, high] = assembly().bounds;
  view.centre = low.map((v, a) => (v + high[a]) / 2);
  view.distance = 1.35 * assembly().size;
  view.fitted = key;
};

const hex = (name) => {
  const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const full = text.length === 4 ? text.replace(/[^#]/g, "$&$&") : text;
  return [1, 3, 5].map((k) => parseInt(full.slice(k, k + 2), 16) / 255);
};
let colours = null;
const readColours = () => {
  colours = { parts: [0, 1, 2, 3, 4, 5, 6, 7].map((k) => hex(`--c${k}`)), fixed: hex("--fixed"), edge: hex("--edge"),
    accent: hex("--accent"), bad: hex("--bad"), force: hex("--force"), mute: hex("--mute") };
};

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const axes = () => {
  const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
  return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], eye: [ce * ca, ce * sa, se] };
};
const lowest = () => assembly().bounds[0][2];
// Columns of the camera: projection × view × the lean of the ground.
const cameraMatrix = () => {
  const { right, up, eye } = axes(), size = assembly().size;
  const aspect = canvas.width / canvas.height, f = 2.6, distance = view.distance * (1 + 0.9 * state.apart);
  const near = distance * 0.02, far = 2 * distance + 6 * size;
  const at = view.centre.map((c, k) => c + eye[k] * distance + (k === 2 ? 0.9 * state.apart * (assembly().bounds[1][2] - lowest()) * 0.5 : 0));
  const fx = f / Math.max(aspect, 1), fy = fx * aspect;
  const a = (far + near) / (near - far), b = (2 * far * near) / (near - far);
  let rows = [[...right.map((v) => fx * v), -fx * dot(right, at)], [...up.map((v) => fy * v), -fy * dot(up, at)],
    [...eye.map((v) => a * v), -a * dot(eye, at) + b], [...eye.map((v) => -v), dot(eye, at)]];
  if (state.tilt.angle > 0) rows = leaning(rows);
  return new Float32Array([0, 1, 2, 3].flatMap((c) => rows.map((r) => r[c])));
};
const leaning = (rows) => {
  const angle = state.tilt.angle * Math.PI / 180, az = state.tilt.azimuth * Math.PI / 180;
  const k = [-Math.sin(az), Math.cos(az), 0], [c, s] = [Math.cos(angle), Math.sin(angle)];
  const turn = [0, 1, 2].map((i) => [0, 1, 2].map((j) => {
    const cross = [[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]][i][j];
    return c * (i === j) + s * cross + (1 - c) * k[i] * k[j];
  }));
  const foot = [view.centre[0], view.centre[1], lowest()];
  const shift = foot.map((v, i) => v - dot(turn[i], foot));
  return rows.map((r) => [0, 1, 2].map((j) => r[0] * turn[0][j] + r[1] * turn[1][j] + r[2] * turn[2][j]).concat(dot(r, shift) + r[3]));
};

const pose = (k, wave) => {
  const part = parts()[k], size = assembly().size, there = arrival(k);
  if (there <= 0) return null;
  let shift = [0, 0, 0], turn = [0, 0, 0, 1];
  if (there < 1) shift = (insertionOf(k)?.out || [0, 0, 1]).map((v) => v * APPROACH * size * (1 - there) ** 2);
  if (state.apart > 0) {
    shift = shift.map((s, a) => s + 0.9 * state.apart * (part.centroid[a] - (a === 2 ? lowest() : view.middle[a])));
  }
  const shown = state.layers.collapse ? currentCase() : null;
  if (shown?.motions && !state.motion && state.apart === 0) {
    shift = shift.map((s, a) => s + wave * shown.motions[k][a]);
    const half = shown.motions[k].slice(3).map((w) => 0.5 * wave * w), norm = Math.hypot(...half, 1);
    turn = [...half, 1].map((v) => v / norm);
  }
  if (state.motion) {
    const at = state.motion.parts.indexOf(k);
    if (at >= 0) {
      const p = frameNow()[at];
      shift = p.slice(0, 3).map((v, a) => v - part.centroid[a]);
      turn = [p[4], p[5], p[6], p[3]];
    }
  }
  return { shift, turn };
};

const paint = (set, mode, colour, flat, bias, indexed) => {
  gl.uniform4fv(shader.at.colour, colour);
  gl.uniform1f(shader.at.flat_, flat);
  gl.uniform1f(shader.at.bias, bias);
  gl.bindVertexArray(set.vao);
  if (indexed) gl.drawElements(mode, set.count, set.type, 0);
  else gl.drawArrays(mode, 0, set.count);
};
const putMesh = (mesh, part, where) => {
  gl.uniform3fv(shader.at.low, mesh ? mesh.low : [0, 0, 0]);
  gl.uniform3fv(shader.at.grid, mesh ? mesh.step : [1, 1, 1]);
  gl.uniform3fv(shader.at.pivot, part ? part.centroid : [0, 0, 0]);
  gl.uniform3fv(shader.at.shift, where ? where.shift : [0, 0, 0]);
  gl.uniform4fv(shader.at.turn, where ? where.turn : [0, 0, 0, 1]);
};

let poses = [];
const begin = () => {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const [w, h] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  if (!w || !h) return null;
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const [low, high] = assembly().bounds;
  view.middle = low.map((v, a) => (v + high[a]) / 2);
  gl.viewport(0, 0, w, h);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.useProgram(shader.program);
  const camera = cameraMatrix();
  gl.uniformMatrix4fv(shader.at.camera, false, camera);
  gl.uniform3fv(shader.at.eyePlane, axes().eye);
  const { eye } = axes(), flatEye = Math.hypot(eye[0], eye[1]) || 1, n = [eye[0] / flatEye, eye[1] / flatEye, 0];
  const reach = 0.5 * assembly().size;
  gl.uniform4fv(shader.at.plane, state.cut > 0 ? [...n, dot(n, view.middle) + reach * (1 - 2 * state.cut)] : [0, 0, 0, 1e9]);
  return camera;
};
const meshesNow = () => (showsResult() && meshes.result ? meshes.result : meshes.input);

export const draw = () => {
  if (!state.input || flatly() || !gl) return;
  if (!colours) readColours();
  prepare();
  place();
  const camera = begin();
  if (!camera) return;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const wave = still ? 1 : 0.5 - 0.5 * Math.cos(performance.now() / 450);
  const now = meshesNow(), picked = state.picked;
  const blockers = new Set(picked?.part === undefined ? [] : insertionOf(picked.part)?.blockers || []);
  const jointView = state.layers.joints && showsResult() && (state.apart > 0 || state.cut > 0 || picked?.joint);
  poses = parts().map((_, k) => pose(k, wave));
  parts().forEach((part, k) => {
    const where = poses[k], tag = labels[k];
    tag.style.display = where && state.layers.names && (picked?.part === k || (!part.fixed && parts().length <= MANY)) ? "" : "none";
    if (!where) return;
    putMesh(now[k], part, where);
    let rgb = part.fixed ? colours.fixed : colours.parts[part.colour];
    if (blockers.has(k)) rgb = rgb.map((v, c) => 0.45 * v + 0.55 * colours.bad[c]);
    paint(now[k].faces, gl.TRIANGLES, [...rgb, 1], 0, 0, true);
    const edge = picked?.part === k ? colours.accent : colours.edge;
    paint(now[k].edges, gl.LINES, [...edge, 1], 1, picked?.part === k ? 6e-4 : 2e-4, true);
    if (state.layers.names) {
      const p = part.centroid.map((c, a) => c + where.shift[a]);
      const clip = [0, 1, 3].map((r) => camera[r] * p[0] + camera[4 + r] * p[1] + camera[8 + r] * p[2] + camera[12 + r]);
      tag.style.left = `${(50 + 50 * clip[0] / clip[2]).toFixed(2)}%`;
      tag.style.top = `${(50 - 50 * clip[1] / clip[2]).toFixed(2)}%`;
    }
  });
  if (state.layers.names) apart();
  if (jointView) joints();
  overlays();
  gl.bindVertexArray(null);
  const shown = state.layers.collapse ? currentCase() : null;
  if (shown?.motions && !state.motion && !still && !document.hidden) changed("view");
};
// Labels that would lie over another one are left out, nearest to the middle first.
const apart = () => {
  const kept = [];
  labels.forEach((tag) => {
    if (tag.style.display === "none") return;
    const [x, y] = [parseFloat(tag.style.left) / 100 * canvas.clientWidth, parseFloat(tag.style.top) / 100 * canvas.clientHeight];
    const half = 3.6 * tag.textContent.length + 4;
    if (kept.some((k) => Math.abs(k.x - x) < k.half + half && Math.abs(k.y - y) < 16)) tag.style.display = "none";
    else kept.push({ x, y, half });
  });
};

const joints = () => {
  state.result.joints.forEach((joint, n) => {
    const chosen = state.picked?.joint && joint.parts.join() === state.picked.joint.parts.join() && joint.k === state.picked.joint.k;
    if (joint.planar && !chosen) return;
    for (const k of joint.parts) {
      if (!poses[k]) continue;
      putMesh(null, null, null);
      gl.uniform3fv(shader.at.pivot, parts()[k].centroid);
      gl.uniform3fv(shader.at.shift, poses[k].shift);
      gl.uniform4fv(shader.at.turn, poses[k].turn);
      if (chosen) gl.disable(gl.DEPTH_TEST);
      paint(meshes.joints[n], gl.TRIANGLES, [...(chosen ? colours.bad : colours.accent), 1], 0.25, 4e-4, false);
      if (chosen) gl.enable(gl.DEPTH_TEST);
    }
  });
};

const overlays = () => {
  if (state.apart > 0 || state.motion) return;
  gl.disable(gl.DEPTH_TEST);
  gl.uniform4fv(shader.at.plane, [0, 0, 0, 1e9]);
  putMesh(null, null, null);
  const sets = [], shown = currentCase(), size = assembly().size;
  if (state.layers.forces && shown?.stands) sets.push([arrows(shown, size), colours.force]);
  if (verdicts() && (state.layers.cones || state.picked?.part !== undefined)) {
    sets.push([coneLines(size, false), colours.accent], [coneLines(size, true), colours.bad]);
  }
  for (const [lines, colour] of sets) {
    if (!lines.length) continue;
    const set = points(lines);
    paint(set, gl.LINES, [...colour, 1], 1, 0, false);
    forget([set]);
  }
};
const arrows = (shown, size) => {
  const lines = [], largest = Math.max(...shown.forces.map((f) => Math.hypot(...f.vector)), 1e-12);
  for (const force of shown.forces) {
    const picked = state.picked?.part;
    if (picked !== undefined && !force.parts.includes(picked)) continue;
    if (force.parts.some((k) => arrival(k) < 1)) continue;
    const strength = Math.hypot(...force.vector), length = FORCE * size * Math.sqrt(strength / largest);
    const along = force.vector.map((v) => v / strength), tip = force.at.map((v, a) => v + along[a] * length);
    const { eye } = axes();
    const side = [along[1] * eye[2] - along[2] * eye[1], along[2] * eye[0] - along[0] * eye[2], along[0] * eye[1] - along[1] * eye[0]];
    lines.push(force.at, tip);
    for (const sign of [1, -1]) lines.push(tip, tip.map((v, a) => v - length * (0.2 * along[a] + sign * 0.1 * side[a])));
  }
  return lines;
};
const coneLines = (size, asked) => {
  const lines = [], alpha = (assembly().alpha_deg || 0) * Math.PI / 180;
  for (const item of verdicts().insertions) {
    if (arrival(item.part) < 1 || (!state.layers.cones && state.picked?.part !== item.part)) continue;
    const apex = parts()[item.part].centroid, length = (asked ? 1.5 : 1.1) * CONE * size;
    let rim = item.cone;
    if (asked) {
      const [u, v] = frame(item.out);
      rim = Array.from({ length: 20 }, (_, s) => {
        const t = 2 * Math.PI * s / 20;
        return item.out.map((o, a) => Math.cos(alpha) * o + Math.sin(alpha) * (Math.cos(t) * u[a] + Math.sin(t) * v[a]));
      });
    }
    if (!rim) continue;
    const ends = rim.map((r) => apex.map((c, a) => c + length * r[a]));
    ends.forEach((p, s) => { lines.push(p, ends[(s + 1) % ends.length]); if (s % 3 === 0) lines.push(apex, p); });
  }
  return lines;
};
const frame = (n) => {
  const seed = Math.abs(n[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const u = [n[1] * seed[2] - n[2] * seed[1], n[2] * seed[0] - n[0] * seed[2], n[0] * seed[1] - n[1] * seed[0]];
  const l = Math.hypot(...u), e = u.map((v) => v / l);
  return [e, [n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]]];
};

// Every part in a colour of its own, read back under the pointer.
const pick = (x, y) => {
  if (!begin()) return null;
  const now = meshesNow();
  parts().forEach((part, k) => {
    if (!poses[k]) return;
    putMesh(now[k], part, poses[k]);
    const id = k + 1;
    paint(now[k].faces, gl.TRIANGLES, [(id & 255) / 255, (id >> 8) / 255, 0, 1], 1, 0, true);
  });
  const ratio = canvas.width / canvas.clientWidth, found = new Uint8Array(4);
  gl.readPixels(Math.round(x * ratio), Math.round(canvas.height - y * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, found);
  const id = found[0] + 256 * found[1];
  return found[3] === 255 && id > 0 && id <= parts().length ? id - 1 : null;
};

export const start = (element, tagBox) => {
  canvas = element;
  tags = tagBox;
  gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
  if (!gl) return false;
  shader = compile();
  let held = null;
  canvas.addEventListener("pointerdown", (e) => { held = { x: e.clientX, y: e.clientY, far: 0 }; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointerup", (e) => {
    const click = held && held.far < 4;
    held = null;
    if (!click) return;
    const box = canvas.getBoundingClientRect(), part = pick(e.clientX - box.left, e.clientY - box.top);
    state.picked = part === null ? null : { part };
    changed("picked");
  });
  canvas.addEventListener("pointermove", (e) => {
    if (!held) return;
    const [dx, dy] = [e.clientX - held.x, e.clientY - held.y];
    held = { x: e.clientX, y: e.clientY, far: held.far + Math.hypot(dx, dy) };
    if (e.shiftKey || e.buttons === 2) {
      const { right, up } = axes(), gain = view.distance / canvas.clientWidth / 1.3;
      view.centre = view.centre.map((c, k) => c - gain * (dx * right[k] - dy * up[k]));
      changed("view");
    } else turn(dx * 0.008, dy * 0.008);
  });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoom(Math.exp(e.deltaY * 0.001)); }, { passive: false });
  canvas.addEventListener("keydown", (e) => {
    const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
    if (by) { e.preventDefault(); turn(...by); }
    if (e.key === "+" || e.key === "-") zoom(e.key === "+" ? 0.9 : 1.1);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); changed("view"); });
  new ResizeObserver(() => changed("view")).observe(canvas);
  return true;
};
const turn = (dx, dy) => {
  view.azimuth -= dx;
  view.elevation = Math.max(-1.5, Math.min(1.5, view.elevation + dy));
  changed("view");
};
const zoom = (factor) => {
  const size = assembly()?.size || 1;
  view.distance = Math.max(0.15 * size, Math.min(6 * size, view.distance * factor));
  changed("view");
};
