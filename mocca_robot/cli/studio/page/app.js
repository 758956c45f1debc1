// Puts the page together: what changed is drawn again, keys and buttons do what they say.
import { state, listen, changed, connect, post, flatly, stale, showsResult, currentCase, freeParts, keepPicked } from "./state.js";
import * as flat from "./flat.js";
import * as solid from "./solid.js";
import * as settings from "./settings.js";
import * as verdicts from "./verdicts.js";
import * as sequence from "./sequence.js";
import * as dialogs from "./dialogs.js";

const $ = (id) => document.getElementById(id);
flat.start($("flat"));
const webgl = solid.start($("solid"), $("tags"));
sequence.start();

const header = () => {
  const doc = state.doc;
  $("name").textContent = doc.open ? doc.name : "mocca-robot studio";
  document.title = doc.open ? `${doc.saved ? "" : "• "}${doc.name}, mocca-robot studio` : "mocca-robot studio";
  $("file").textContent = doc.open ? `${doc.file || "not saved yet"}${doc.file && !doc.saved ? ", changed" : ""}` : "";
  for (const [id, what] of [["undo", doc.undo], ["redo", doc.redo]]) {
    $(id).disabled = what === null || what === undefined;
    $(id).title = what === null || what === undefined ? "" : `${id === "undo" ? "Undo" : "Redo"} ${what}`;
  }
  $("save").disabled = $("jobs").disabled = !doc.open;
  $("save").classList.toggle("primary", doc.open && !doc.saved);
  const front = !doc.open || dialogs.showWelcome;
  $("welcome").hidden = !front;
  $("desk").hidden = front;
  $("offline").hidden = state.online;
  $("offline").textContent = "The studio does not answer. Your last state is kept there; the page goes on as soon as it is back.";
};

const stage = () => {
  const two = flatly();
  $("flat").toggleAttribute("hidden", !state.input || !two);
  $("solid").hidden = !state.input || two || !webgl;
  $("tags").hidden = two;
  $("cutlabel").hidden = two;
  $("corners").hidden = !two;
  $("stage").classList.toggle("stale", stale() && Boolean(state.input));
  for (const b of document.querySelectorAll("[data-which]")) b.setAttribute("aria-pressed", String(b.dataset.which === (showsResult() ? "result" : state.which)));
  for (const b of document.querySelectorAll("[data-layer]")) b.setAttribute("aria-pressed", String(state.layers[b.dataset.layer]));
  $("apart").value = state.apart;
  $("cut").value = state.cut;
  const busy = state.doc.busy && !state.problem, p = state.progress;
  $("progress").hidden = !busy;
  if (busy) {
    const worst = p?.worst === null || p?.worst === undefined ? "" : `, E/|w|² ${p.worst.toExponential(1)}`;
    $("progress").lastElementChild.textContent = p ? `${p.what}${worst}${p.seconds > 1 ? `, ${p.seconds.toFixed(0)} s` : ""}` : "reading";
  }
  $("problem").hidden = !state.problem;
  $("problem").textContent = state.problem?.text || "";
  const shown = currentCase();
  let hint = "";
  if (state.motion) hint = `MuJoCo: ${state.motion.words}`;
  else if (state.tilt.angle > 0 && shown) hint = `tilted by ${state.tilt.angle}°: ${shown.stands ? "stands" : "falls"}`;
  else if (shown && state.input) hint = `${shown.words}: ${shown.stands ? "stands" : "falls"}`;
  if (!two && !webgl) hint = "This browser shows no WebGL 2; figures and verdicts are beside.";
  $("hint").textContent = hint;
};

listen((what) => {
  if (what.has("opened")) { settings.forget(); flat.fit(); solid.fit(); }
  if (what.has("motion")) sequence.playMotion();
  if (what.has("refused")) { $("letgo").disabled = false; dialogs.toast(state.refused); }
  if (what.has("result") || what.has("before")) sequence.tiltAgain();
  const still = [...what].every((w) => w === "view" || w === "motionframe" || w === "drag");
  if (!still) {
    header();
    settings.render($("settings"));
    verdicts.render($("verdicts"));
    sequence.render($("sequence"));
  }
  stage();
  sequence.controls();
  dialogs.renderJobs();
  flat.draw();
  solid.draw();
});

$("open").onclick = dialogs.welcome;
$("save").onclick = dialogs.save;
$("undo").onclick = () => post("undo");
$("redo").onclick = () => post("redo");
$("jobs").onclick = dialogs.jobs;
$("help").onclick = dialogs.help;
$("fit").onclick = () => { flat.fit(); solid.fit(); };
const look = (which) => { keepPicked(() => { state.which = which; }); state.motion = null; if (which === "result") state.layers.corners = false; sequence.tiltAgain(); changed("which"); };
for (const b of document.querySelectorAll("[data-which]")) b.onclick = () => look(b.dataset.which);
const toggle = (layer) => {
  state.layers[layer] = !state.layers[layer];
  if (layer === "corners" && state.layers.corners) { keepPicked(() => { state.which = "input"; }); state.step = freeParts().length; state.apart = 0; }
  changed("layers");
};
for (const b of document.querySelectorAll("[data-layer]")) b.onclick = () => toggle(b.dataset.layer);
$("apart").oninput = (e) => { state.apart = Number(e.target.value); state.layers.corners = false; changed("view"); };
$("cut").oninput = (e) => { state.cut = Number(e.target.value); changed("view"); };
for (const b of document.querySelectorAll("[data-tab]")) {
  b.onclick = () => {
    $("desk").dataset.tab = b.dataset.tab;
    for (const other of document.querySelectorAll("[data-tab]")) if (other !== $("desk")) other.setAttribute("aria-pressed", String(other === b));
  };
}
$("desk").dataset.tab = "verdicts";

addEventListener("keydown", (e) => {
  const typing = ["INPUT", "TEXTAREA", "SELECT"].includes(e.target.tagName) && e.target.type !== "range" && e.target.type !== "checkbox";
  const command = e.ctrlKey || e.metaKey, key = e.key.toLowerCase();
  if (command && key === "s") { e.preventDefault(); dialogs.save(); return; }
  if (typing || $("dialog").open || !state.doc.open) return;
  if (command && key === "z") { e.preventDefault(); post(e.shiftKey ? "redo" : "undo"); return; }
  if (command && key === "y") { e.preventDefault(); post("redo"); return; }
  if (command || e.altKey) return;
  const does = { "1": () => look("input"), "2": () => look("result"), e: () => flatly() && toggle("corners"), f: verdicts.fixPicked, g: sequence.letGo, n: () => toggle("names"), c: () => toggle("cones"),
    j: () => toggle("joints"), m: () => toggle("collapse"), "0": () => { flat.fit(); solid.fit(); }, o: dialogs.welcome, "?": dialogs.help,
    escape: () => { state.picked = null; state.layers.corners = false; changed("picked"); } }[key];
  if (does) { e.preventDefault(); does(); return; }
  if (key === " " && e.target.tagName !== "BUTTON") { e.preventDefault(); sequence.play(); }
});

// --- dropping

const filesOf = async (items) => {
  const found = [];
  const walk = async (entry, path) => {
    if (entry.isFile) {
      const file = await new Promise((ok, no) => { entry.file(ok, no); });
      Object.defineProperty(file, "path", { value: path + entry.name, configurable: true });
      found.push(file);
    } else if (entry.isDirectory) {
      const reader = entry.createReader();
      for (;;) {
        const inside = await new Promise((ok, no) => { reader.readEntries(ok, no); });
        if (!inside.length) break;
        for (const e of inside) await walk(e, `${path}${entry.name}/`);
      }
    }
  };
  const entries = [...items].map((i) => i.webkitGetAsEntry?.()).filter(Boolean);
  for (const e of entries) await walk(e, "");
  return found;
};
let depth = 0;
addEventListener("dragenter", (e) => { if (e.dataTransfer?.types.includes("Files")) { depth++; document.body.classList.add("over"); } });
addEventListener("dragleave", () => { depth = Math.max(0, depth - 1); if (!depth) document.body.classList.remove("over"); });
addEventListener("dragover", (e) => e.preventDefault());
addEventListener("drop", async (e) => {
  e.preventDefault();
  depth = 0;
  document.body.classList.remove("over");
  const answer = await dialogs.take(await filesOf(e.dataTransfer.items));
  return answer;
});
$("dropzone").onclick = (e) => { if (!["SELECT", "OPTION", "LABEL"].includes(e.target.tagName)) $("picker").click(); };
$("dropzone").onkeydown = (e) => { if (e.key === "Enter" && e.target === $("dropzone")) $("picker").click(); };
$("picker").onchange = (e) => { dialogs.take([...e.target.files]); e.target.value = ""; };

dialogs.load().catch(() => changed("online"));
connect();
changed();
