"use strict";
// A small WebGL 2 viewer: orbit, assembly sequence, exploded view, cones, contact forces, collapse motion.
(() => {
  const canvas = document.getElementById("view");
  if (!canvas) return;
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
  if (!gl) {
    const note = document.createElement("p");
    note.textContent = "This browser shows no WebGL 2; the pictures and tables on this page hold the same results.";
    canvas.replaceWith(note);
    return;
  }
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

  const compile = (vertex, fragment) => {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, "#version 300 es\nprecision highp float;\n" + text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "position");
    gl.linkProgram(program);
    const names = ["camera", "eyePlane", "low", "grid", "pivot", "shift", "turn", "colour", "flat_", "bias"];
    return { program, at: Object.fromEntries(names.map((n) => [n, gl.getUniformLocation(program, n)])) };
  };
  // Positions are low + grid × vertex, turned about the centroid by a unit quaternion (x, y, z, w), then shifted.
  const shader = compile(
    `in vec3 position; uniform mat4 camera; uniform vec3 low, grid, pivot, shift; uniform vec4 turn; uniform float bias;
     out vec3 world;
     void main() { vec3 arm = low + grid * position - pivot;
       world = pivot + shift + arm + 2.0 * cross(turn.xyz, cross(turn.xyz, arm) + turn.w * arm);
       gl_Position = camera * vec4(world, 1.0); gl_Position.z -= bias * gl_Position.w; }`,
    `in vec3 world; uniform vec3 eyePlane; uniform vec4 colour; uniform float flat_; out vec4 painted;
     void main() { vec3 n = normalize(cross(dFdx(world), dFdy(world)));
       if (dot(n, eyePlane) < 0.0) n = -n;
       float light = 0.52 + 0.34 * max(dot(n, normalize(vec3(0.3, -0.45, 0.85))), 0.0) + 0.2 * max(dot(n, eyePlane), 0.0);
       painted = vec4(colour.rgb * mix(light, 1.0, flat_), colour.a); }`);

  const arrayBuffer = (data, target) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(target, buffer);
    gl.bufferData(target, data, gl.STATIC_DRAW);
    return buffer;
  };
  const geometry = (mesh) => {
    const kind = mesh.wide ? Uint32Array : Uint16Array;
    const make = (indices) => {
      const vao = gl.createVertexArray();
      gl.bindVertexArray(vao);
      gl.bindBuffer(gl.ARRAY_BUFFER, vertices);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, false, 6, 0);
      const data = new kind(bytes(indices));
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, arrayBuffer(data, gl.ELEMENT_ARRAY_BUFFER));
      gl.bindVertexArray(null);
      return { vao, count: data.length, type: mesh.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT };
    };
    const vertices = arrayBuffer(new Uint16Array(bytes(mesh.vertices)), gl.ARRAY_BUFFER);
    return { low: mesh.low, step: mesh.step, faces: make(mesh.faces), edges: make(mesh.edges) };
  };
  const lineSet = (text) => {
    const data = new Float32Array(bytes(text));
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    arrayBuffer(data, gl.ARRAY_BUFFER);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12, 0);
    gl.bindVertexArray(null);
    return { vao, count: data.length / 3 };
  };
  const parts = scene.parts.map((p) => ({ ...p, result: geometry(p.result), input: geometry(p.input) }));
  const lines = { asked: lineSet(scene.cones.asked), free: lineSet(scene.cones.free), forces: lineSet(scene.forces) };

  const view = { azimuth: -1.05, elevation: 0.42, distance: 1.3 * scene.size, centre: [...scene.centre] };
  const show = { which: "result", explode: 0, names: false, cones: false, forces: false, collapse: false };
  const tags = document.getElementById("tags");
  const labels = parts.map((p) => {
    const tag = document.createElement("span");
    tag.textContent = p.name;
    tags.append(tag);
    return tag;
  });

  const hex = (name) => {
    const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    const full = text.length === 4 ? text.replace(/[^#]/g, "$&$&") : text;
    return [1, 3, 5].map((k) => parseInt(full.slice(k, k + 2), 16) / 255);
  };
  let colours = {};
  const readColours = () => {
    colours = { parts: [0, 1, 2, 3, 4, 5, 6, 7].map((k) => hex("--c" + k)), fixed: hex("--fixed"), edge: hex("--edge"),
      asked: hex("--statics"), free: hex("--mute"), forces: hex("--ink"), bad: hex("--bad") };
  };

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const axes = () => {
    const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
    return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], eye: [ce * ca, ce * sa, se] };
  };
  const cameraMatrix = () => {
    const { right, up, eye } = axes();
    const aspect = canvas.width / canvas.height, f = 2.6, near = view.distance * 0.02, far = 2 * view.distance + 5 * scene.size;
    const distance = view.distance * (1 + 0.9 * show.explode), lift = 0.45 * show.explode * (scene.centre[2] - lowest);
    const at = view.centre.map((c, k) => c + eye[k] * distance + (k === 2 ? 2 * lift : 0));
    const fx = f / Math.max(aspect, 1), fy = fx * aspect;
    const a = (far + near) / (near - far), b = (2 * far * near) / (near - far);
    const rows = [[...right.map((v) => fx * v), -fx * dot(right, at)], [...up.map((v) => fy * v), -fy * dot(up, at)],
      [...eye.map((v) => a * v), -a * dot(eye, at) + b], [...eye.map((v) => -v), dot(eye, at)]];
    return new Float32Array([0, 1, 2, 3].flatMap((c) => rows.map((r) => r[c])));
  };

  // Where a part is now: null = not placed yet.
  const placement = (part, index, value, wave) => {
    let shift = [0, 0, 0], turn = [0, 0, 0, 1];
    if (part.step >= 0) {
      const done = Math.min(1, value - part.step);
      if (done <= 0) return null;
      shift = part.travel.map((t) => t * (1 - done) ** 2);
    }
    if (show.explode > 0) {
      shift = shift.map((s, k) => s + 0.9 * show.explode * (part.centroid[k] - (k === 2 ? lowest : scene.centre[k])));
    }
    const motions = collapseNow(value);
    if (show.collapse && motions) {
      shift = shift.map((s, k) => s + wave * motions[index][k]);
      const half = motions[index].slice(3).map((w) => 0.5 * wave * w);
      const norm = Math.hypot(...half, 1);
      turn = [...half, 1].map((v) => v / norm);
    }
    const pose = sequence.poses && sequence.poses.get(index);
    if (pose) {
      shift = pose.slice(0, 3);
      turn = [pose[4], pose[5], pose[6], pose[3]];
    }
    return { shift, turn };
  };
  const lowest = Math.min(...parts.map((p) => p.centroid[2]));
  const collapseNow = (value) => {
    if (show.which === "input") return value >= sequence.count ? scene.collapse.input : null;
    return scene.states[String(Math.round(value))] || (value >= sequence.count ? scene.collapse.result : null);
  };

  const draw = () => {
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (!w || !h) return;
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    const wave = 0.5 - 0.5 * Math.cos(performance.now() / 450);
    const camera = cameraMatrix();
    gl.viewport(0, 0, w, h);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(shader.program);
    gl.uniformMatrix4fv(shader.at.camera, false, camera);
    gl.uniform3fv(shader.at.eyePlane, axes().eye);
    parts.forEach((part, index) => {
      const place = placement(part, index, sequence.value, wave), tag = labels[index];
      tag.style.display = place && show.names ? "" : "none";
      if (!place) return;
      const mesh = part[show.which];
      gl.uniform3fv(shader.at.low, mesh.low);
      gl.uniform3fv(shader.at.grid, mesh.step);
      gl.uniform3fv(shader.at.pivot, part.centroid);
      gl.uniform3fv(shader.at.shift, place.shift);
      gl.uniform4fv(shader.at.turn, place.turn);
      const fill = Array.isArray(part.colour) ? part.colour : part.colour < 0 ? colours.fixed : colours.parts[part.colour];
      for (const [set, mode, rgb, flat, bias] of [[mesh.faces, gl.TRIANGLES, fill, 0, 0], [mesh.edges, gl.LINES, colours.edge, 1, 2e-4]]) {
        gl.uniform4fv(shader.at.colour, [...rgb, 1]);
        gl.uniform1f(shader.at.flat_, flat);
        gl.uniform1f(shader.at.bias, bias);
        gl.bindVertexArray(set.vao);
        gl.drawElements(mode, set.count, set.type, 0);
      }
      if (show.names) {
        const p = part.centroid.map((c, k) => c + place.shift[k]);
        const clip = [0, 1, 3].map((r) => camera[r] * p[0] + camera[4 + r] * p[1] + camera[8 + r] * p[2] + camera[12 + r]);
        tag.style.left = `${(50 + 50 * clip[0] / clip[2]).toFixed(2)}%`;
        tag.style.top = `${(50 - 50 * clip[1] / clip[2]).toFixed(2)}%`;
      }
    });
    if (sequence.value >= sequence.count && show.explode === 0) {
      gl.disable(gl.DEPTH_TEST);
      gl.uniform3fv(shader.at.grid, [1, 1, 1]);
      for (const name of ["low", "shift", "pivot"]) gl.uniform3fv(shader.at[name], [0, 0, 0]);
      gl.uniform4fv(shader.at.turn, [0, 0, 0, 1]);
      gl.uniform1f(shader.at.flat_, 1);
      gl.uniform1f(shader.at.bias, 0);
      const sets = [...(show.cones ? ["free", "asked"] : []), ...(show.forces && show.which === "result" ? ["forces"] : [])];
      for (const name of sets) {
        gl.uniform4fv(shader.at.colour, [...colours[name], 1]);
        gl.bindVertexArray(lines[name].vao);
        gl.drawArrays(gl.LINES, 0, lines[name].count);
      }
    }
    gl.bindVertexArray(null);
    if (show.collapse && collapseNow(sequence.value) && !matchMedia("(prefers-reduced-motion: reduce)").matches) again();
  };
  let asked = false;
  const again = () => { if (!asked) { asked = true; requestAnimationFrame(() => { asked = false; draw(); }); } };

  const orbit = (dx, dy) => {
    view.azimuth -= dx;
    view.elevation = Math.max(-1.5, Math.min(1.5, view.elevation + dy));
    again();
  };
  const zoom = (factor) => {
    view.distance = Math.max(0.2 * scene.size, Math.min(6 * scene.size, view.distance * factor));
    again();
  };
  let held = null;
  canvas.addEventListener("pointerdown", (e) => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointerup", () => { held = null; });
  canvas.addEventListener("pointermove", (e) => {
    if (!held) return;
    const [dx, dy] = [e.clientX - held[0], e.clientY - held[1]];
    held = [e.clientX, e.clientY];
    if (e.shiftKey || e.buttons === 2) {
      const { right, up } = axes(), gain = view.distance / canvas.clientWidth / 1.3;
      view.centre = view.centre.map((c, k) => c - gain * (dx * right[k] - dy * up[k]));
      again();
    } else orbit(dx * 0.008, dy * 0.008);
  });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoom(Math.exp(e.deltaY * 0.001)); }, { passive: false });
  canvas.addEventListener("keydown", (e) => {
    const keys = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (keys[e.key]) { e.preventDefault(); orbit(...keys[e.key]); }
    if (e.key === "+" || e.key === "-") zoom(e.key === "+" ? 0.9 : 1.1);
  });
  for (const box of document.querySelectorAll(".scene-toggle")) {
    box.addEventListener("change", () => { show[box.dataset.show] = box.checked; again(); });
  }
  for (const radio of document.querySelectorAll("input[name=which]")) {
    radio.addEventListener("change", () => { show.which = radio.value; again(); });
  }
  document.getElementById("explode").addEventListener("input", (e) => { show.explode = Number(e.target.value); again(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); again(); });
  new ResizeObserver(again).observe(canvas);
  sequence.listeners.push(again);
  readColours();
  draw();
})();
