"use strict";
// Layer toggles, the load-case picker and the sequence player. Drawing is done by listeners of "sequence.draw".
const sequence = { value: 0, count: 0, poses: null, listeners: [], draw() { for (const f of this.listeners) f(this.value); } };
(() => {
  const all = (selector, root = document) => Array.from(root.querySelectorAll(selector));
  const byId = (id) => document.getElementById(id);

  for (const box of all(".toggle")) {
    box.addEventListener("change", () => byId("pictures").classList.toggle("off-" + box.dataset.layer, !box.checked));
  }
  const picker = byId("case");
  if (picker) {
    picker.addEventListener("change", () => {
      for (const el of all("#pictures [data-case]")) el.style.display = el.dataset.case === picker.value ? "" : "none";
    });
  }

  const data = byId("steps");
  if (!data) return;
  const steps = JSON.parse(data.textContent);
  const slider = byId("time"), play = byId("play"), panel = byId("verdict");
  sequence.count = steps.length - 1;
  sequence.value = sequence.count;
  const films = JSON.parse(byId("films").textContent), filmButton = byId("film");
  let target = null, playing = false, before = 0;

  const pieces = all("#stage2d .piece"), fails = all("#stage2d .fails");
  if (pieces.length) {
    sequence.listeners.push((value) => {
      for (const piece of pieces) {
        if (piece.dataset.step === undefined) continue;
        const done = Math.min(1, value - Number(piece.dataset.step));
        const far = done > 0 ? (1 - done) ** 2 : 1;
        piece.style.display = done > 0 ? "" : "none";
        const pose = sequence.poses && sequence.poses.get(Number(piece.dataset.part));
        const s = Number(byId("stage2d").dataset.scale);
        piece.setAttribute("transform", pose
          ? `translate(${pose[0] * s} ${-pose[1] * s}) rotate(${-pose[2] * 180 / Math.PI} ${piece.dataset.x} ${piece.dataset.y})`
          : `translate(${piece.dataset.dx * far} ${piece.dataset.dy * far})`);
      }
      for (const f of fails) f.style.display = Number(f.dataset.step) === value && !sequence.poses ? "" : "none";
    });
  }
  let shown = -1;
  sequence.listeners.push((value) => {
    const step = Math.ceil(value - 1e-9);
    slider.value = value;
    slider.setAttribute("aria-valuetext", steps[step].title);
    byId("count").textContent = `${step} of ${sequence.count}`;
    filmButton.hidden = !films[value];
    if (step === shown) return;
    shown = step;
    panel.replaceChildren();
    const head = document.createElement("h3");
    head.textContent = steps[step].title;
    const body = document.createElement("div");
    body.innerHTML = steps[step].html;  // markup made and escaped when the report was written
    panel.append(head, body);
    for (const row of all(".steps tbody tr")) {
      const mine = Number(row.querySelector(".step").dataset.step) === step;
      if (mine) row.setAttribute("aria-current", "step"); else row.removeAttribute("aria-current");
    }
  });

  // A film runs at half speed and stays at its last frame until the step changes.
  let run = 0;
  filmButton.addEventListener("click", () => {
    stop();
    const film = films[sequence.value], mine = ++run, start = performance.now();
    if (!film) return;
    const show = (now) => {
      if (mine !== run) return;
      const t = film.times[0] + (now - start) / 2000;
      let k = film.times.findIndex((at) => at > t);
      if (k < 0) k = film.times.length - 1;
      sequence.poses = new Map(film.parts.map((part, f) => [part, film.poses[k][f]]));
      sequence.draw();
      if (k < film.times.length - 1) requestAnimationFrame(show);
    };
    requestAnimationFrame(show);
  });

  const set = (value) => { run += 1; sequence.poses = null; sequence.value = Math.max(0, Math.min(sequence.count, value)); sequence.draw(); };
  const stop = () => { playing = false; target = null; play.textContent = "▶ Play"; };
  const frame = (now) => {
    const dt = Math.min(0.05, (now - before) / 1000);
    before = now;
    if (target === null) return;
    const next = Math.min(target, sequence.value + dt * 1.1);
    set(next);
    if (next < target) { requestAnimationFrame(frame); return; }
    if (playing && target < sequence.count) {
      const token = (target += 1);
      setTimeout(() => { if (playing && target === token) { before = performance.now(); requestAnimationFrame(frame); } }, 450);
    } else stop();
  };
  const moveTo = (value) => {
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) { set(value); stop(); return; }
    target = Math.min(sequence.count, value);
    before = performance.now();
    requestAnimationFrame(frame);
  };
  play.addEventListener("click", () => {
    if (playing) { stop(); return; }
    if (sequence.value >= sequence.count) set(0);
    playing = true;
    play.textContent = "❚❚ Pause";
    moveTo(Math.floor(sequence.value + 1e-9) + 1);
  });
  const forward = () => { const v = Math.floor(sequence.value + 1e-9) + 1; stop(); moveTo(v); };
  const back = () => { stop(); set(Math.ceil(sequence.value - 1e-9) - 1); };
  byId("forward").addEventListener("click", forward);
  byId("back").addEventListener("click", back);
  // Dragging is smooth; keys go from part to part.
  const keys = { ArrowRight: forward, ArrowUp: forward, ArrowLeft: back, ArrowDown: back };
  slider.addEventListener("keydown", (e) => { if (keys[e.key]) { e.preventDefault(); keys[e.key](); } });
  slider.addEventListener("input", () => { stop(); set(Number(slider.value)); });
  for (const button of all(".step")) {
    button.addEventListener("click", () => {
      stop();
      const v = Number(button.dataset.step);
      set(v - 1);
      moveTo(v);
      byId("sequence").scrollIntoView();
    });
  }
  // A link such as report.html#step=3 opens at that step.
  const asked = /^#step=([\d.]+)$/.exec(location.hash);
  set(asked ? Number(asked[1]) : sequence.count);
  if (asked) byId("sequence").scrollIntoView();
})();
