// Opening, saving, background jobs, help.
import { state, changed, post, drop, flatly } from "./state.js";
import { makeElement as el } from "./settings.js";

const $ = (id) => document.getElementById(id);
let beginning = { examples: [], beside: [] };

export const toast = (text) => {
  const box = $("toast");
  box.textContent = text;
  box.hidden = false;
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => { box.hidden = true; }, 8000);
};

export const load = async () => {
  const answer = await fetch("/api/start");
  beginning = await answer.json();
  state.keys = beginning.keys;
  const entry = (name, about, path, example = false) => el("li", {}, el("button", { type: "button", onclick: () => open(path, example) }, el("b", {}, name), el("span", {}, about)));
  $("beside").replaceChildren(...beginning.beside.slice(0, 24).map((f) => entry(f.name, "", f.path)));
  if (!beginning.beside.length) $("beside").append(el("li", { className: "mute" }, `Nothing to open in ${beginning.folder}.`));
  $("examples").replaceChildren(...beginning.examples.map((e) => entry(e.name, e.about, e.path, true)));
  changed("settings");
};

const settle = (answer) => {
  const box = $("welcomeproblem");
  box.hidden = answer.ok;
  box.textContent = answer.ok ? "" : answer.error;
  if (!answer.ok && state.doc.open && !$("welcome").hidden === false) toast(answer.error);
  if (answer.ok) { showWelcome = false; changed("document"); }
};
const open = async (path, example) => settle(await post("open", { path, example, units: $("units").value || null }));
export const take = async (files) => {
  if (!files.length) return;
  settle(await drop(files, $("units").value || null));
};

export let showWelcome = false;
export const welcome = () => { showWelcome = !showWelcome || !state.doc.open; load(); changed("document"); };

const dialog = () => $("dialog");
const show = (...children) => {
  dialog().replaceChildren(...children);
  if (!dialog().open) dialog().showModal();
};
const close = () => dialog().close();
const ending = (...buttons) => el("div", { className: "row end" }, ...buttons);
const button = (text, onclick, primary = false) => el("button", { type: "button", className: primary ? "primary" : "", onclick }, text);

export const save = async () => {
  if (!state.doc.open) return;
  if (state.doc.file) {
    const answer = await post("save", { path: state.doc.file });
    if (answer.ok) toast(`Saved ${answer.path}`); else saveAs(answer.error, true);
  } else saveAs("", false);
};
const saveAs = (problem, exists) => {
  const path = el("input", { type: "text", value: state.doc.file || state.doc.suggested, ariaLabel: "File" });
  const error = el("p", { className: "problem", hidden: !problem }, problem);
  const go = async (overwrite) => {
    const answer = await post("save", { path: path.value, overwrite });
    if (answer.ok) { close(); toast(`Saved ${answer.path}`); return; }
    saveAs.last = path.value;
    error.textContent = answer.error;
    error.hidden = false;
    replace.hidden = false;
  };
  const replace = button("Replace it", () => go(true));
  replace.hidden = !exists;
  path.addEventListener("keydown", (e) => { if (e.key === "Enter") go(false); });
  show(el("h2", {}, "Save as"), el("p", { className: "mute" }, "A YAML file that every other command takes: mocca-robot run FILE."), el("div", { className: "row" }, path), error,
    ending(el("a", { href: `/api/${state.window}/text`, download: "" }, "Download instead"), button("Cancel", close), replace, button("Save", () => go(false), true)));
  path.focus();
};

const FORMATS = () => (flatly() ? ["svg", "dxf", "stl", "obj", "mjcf", "figures"] : ["stl", "3mf", "obj", "glb", "mjcf", "urdf", "figures"]);
const time = (s) => (s < 90 ? `${Math.max(1, Math.round(s))} s` : `${Math.round(s / 60)} min`);
let jobList = null;
export const jobs = () => {
  const error = el("p", { className: "problem", hidden: true });
  const begin = async (body) => {
    const answer = await post("job", body);
    error.hidden = answer.ok;
    error.textContent = answer.ok ? "" : answer.error;
  };
  const format = el("select", { ariaLabel: "Format" }, ...FORMATS().map((f) => el("option", {}, f)));
  const key = el("select", { ariaLabel: "Key" }, ...["alpha_deg", "joints.max_slope_deg", "joints.max_height", "joints.margin", "density"].map((k) => el("option", {}, k)));
  const values = el("input", { type: "text", value: "2, 5, 8", ariaLabel: "Values" });
  jobList = el("div", {});
  show(el("h2", {}, "Jobs"), el("p", { className: "mute" }, "They run beside the page on what is in hand now; you can go on working."),
    el("div", { className: "row" }, button("Design files and report", () => begin({ kind: "design" })), button("Full simulation", () => begin({ kind: "run" }))),
    el("div", { className: "row" }, "Export the design files as", format, button("Export", () => begin({ kind: "export", format: format.value }))),
    el("div", { className: "row" }, "Study of", key, "at", values, button("Start", () => begin({ kind: "study", key: key.value, values: values.value.split(/[,;\s]+/).filter(Boolean).map(Number).filter((v) => !Number.isNaN(v)) }))),
    error, jobList, ending(button("Close", close)));
  renderJobs();
};
export const renderJobs = () => {
  const running = state.jobs.filter((j) => j.state === "running" || j.state === "stopping").length;
  $("jobcount").hidden = !running;
  $("jobcount").textContent = running;
  if (!jobList?.isConnected) return;
  const WORDS = { running: "running", stopping: "stopping", done: "✓ done", negative: "✗ negative verdict", failed: "✗ not done", cancelled: "cancelled" };
  jobList.replaceChildren(...state.jobs.map((job) => {
    const live = job.state === "running" || job.state === "stopping";
    const meter = el("div", { className: `meter ${job.share === null ? "unknown" : ""}` }, el("i", {}));
    if (job.share !== null) meter.firstChild.style.width = `${Math.round(100 * job.share)}%`;
    const left = job.left_s ? `, about ${time(job.left_s)} left` : "";
    const links = job.files.map((f) => { const n = f.split(/[\\/]/).pop(); return el("a", { href: `/api/${state.window}/jobs/${job.number}/${encodeURIComponent(n)}`, target: "_blank", rel: "noopener" }, n); });
    return el("div", { className: "job", data: { job: job.number } },
      el("div", { className: "row" }, el("b", {}, job.title), el("span", { className: "mute" }, `${WORDS[job.state]}${live ? left : `, ${time(job.seconds)}`}`), live ? button("Cancel", () => post("cancel", { job: job.number })) : null),
      live ? meter : null, el("div", { className: "words" }, live ? job.doing : job.words),
      links.length ? el("div", { className: "words" }, ...links.flatMap((l, n) => [n ? ", " : "", l])) : null,
      live ? null : el("div", { className: "words mute" }, job.folder));
  }));
};

export const help = () => {
  const keys = [["1 / 2", "input / result"], ["E", "drag corners of flat parts (Shift: straight; arrows: step)"], ["F", "fix or free the picked part"], ["Space", "play the sequence"], ["G", "let everything go in MuJoCo"],
    ["Alt+← →", "move the picked part in the sequence"], ["N C J M", "names, cones, joints, motion"], ["0", "show everything"], ["Ctrl+Z, Ctrl+Y", "undo, redo"], ["Ctrl+S", "save"], ["O", "open"], ["Esc", "let go of what is picked"]];
  show(el("h2", {}, "Keys"), el("dl", { className: "facts" }, ...keys.flatMap(([k, w]) => [el("dt", {}, el("kbd", {}, k)), el("dd", {}, w)])),
    el("p", { className: "mute" }, "In the picture: drag to move or turn, wheel to zoom, click to pick. Greyed results belong to an earlier state; new ones are on their way."), ending(button("Close", close, true)));
};
