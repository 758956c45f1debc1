"use strict";
// Plays what happened in the simulated cell; viewer3d.js draws it.
const sequence = { value: 0, count: 0, poses: new Map(), listeners: [], draw() { for (const f of this.listeners) f(this.value); } };
(() => {
  const byId = (id) => document.getElementById(id);
  const film = JSON.parse(byId("motion").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const times = new Float32Array(bytes(film.times));
  const tracks = film.tracks.map((t) => ({ frames: new Uint16Array(bytes(t.frames)), poses: new Float32Array(bytes(t.poses)) }));
  const slider = byId("time"), play = byId("play"), rate = byId("rate"), clock = byId("clock"), now = byId("now");
  const last = times.length - 1;
  let at = 0, playing = false, before = 0;

  // Each body keeps the frames in which it moved; between them it stays.
  const latest = (frames, frame) => {
    let [low, high] = [0, frames.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (frames[middle] <= frame) low = middle; else high = middle - 1;
    }
    return low;
  };
  const frameAt = (t) => {
    let [low, high] = [0, last];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= t) low = middle; else high = middle - 1;
    }
    return low;
  };
  const show = (t) => {
    at = Math.max(times[0], Math.min(times[last], t));
    const frame = frameAt(at);
    tracks.forEach((track, k) => {
      const n = 7 * latest(track.frames, frame);
      sequence.poses.set(k, Array.from(track.poses.subarray(n, n + 7)));
    });
    slider.value = at;
    clock.textContent = `${at.toFixed(1)} of ${times[last].toFixed(1)} s`;
    const chapter = film.chapters.filter((c) => c.t <= at + 1e-6).pop();
    now.textContent = chapter ? chapter.title : "";
    sequence.draw();
  };
  const stop = () => { playing = false; play.textContent = "▶ Play"; };
  const tick = (moment) => {
    if (!playing) return;
    show(at + Math.min(0.1, (moment - before) / 1000) * Number(rate.value));
    before = moment;
    if (at >= times[last]) { stop(); return; }
    requestAnimationFrame(tick);
  };
  play.addEventListener("click", () => {
    if (playing) { stop(); return; }
    if (at >= times[last]) show(times[0]);
    playing = true;
    play.textContent = "❚❚ Pause";
    before = performance.now();
    requestAnimationFrame(tick);
  });
  slider.min = times[0];
  slider.max = times[last];
  slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
  for (const button of document.querySelectorAll(".step")) {
    button.addEventListener("click", () => { stop(); show(Number(button.dataset.time)); byId("player").scrollIntoView(); });
  }
  const asked = /^#t=([\d.]+)$/.exec(location.hash);
  show(asked ? Number(asked[1]) : times[last]);
})();
