// What was found: the verdict in a line, why not, figures, and everything about what is picked.
import { state, changed, parts, inputParts, verdicts, fresh, stale, showsResult, currentCase, insertionOf, freeParts, post } from "./state.js";
import { makeElement as el, change } from "./settings.js";

const degrees = (v) => `${v.toFixed(1)}°`;
const sig = (v, n = 3) => Number(v.toPrecision(n)).toString();
const mass = (kg) => (kg >= 1000 ? `${sig(kg / 1000)} t` : kg >= 1 ? `${sig(kg)} kg` : `${sig(kg * 1000)} g`);
const length = (m) => (m >= 1 ? `${sig(m)} m` : `${sig(m * 1000)} mm`);
const named = (list) => list.map((k) => parts()[k].name).join(", ");

const headline = () => {
  const stages = ["input", "before", "result"], found = verdicts();
  if (state.problem) return ["bad", "✗", "Not usable as it is", "The picture shows the last state that could be computed."];
  if (!found) return ["none", "…", "Looking at it", state.input ? "Contacts are found; forces come next." : "Reading the parts."];
  if (state.which === "input" || !state.result) {
    const falls = state.before?.cases.filter((c) => !c.stands).length;
    if (!state.before) return ["none", "…", "Looking at it", ""];
    return falls ? ["bad", "✗", "Falls without joints", `${falls} of ${state.before.cases.length} load cases do not stand on flat contacts.`]
      : ["ok", "✓", "Stands without joints", "Flat contacts carry every load case."];
  }
  const falls = state.result.cases.filter((c) => !c.stands).length, curved = state.result.joints.filter((j) => !j.planar).length;
  const joints = `${curved} of ${state.result.joints.length} joints curved`;
  if (falls) return ["bad", "✗", "Falls", `${falls} of ${state.result.cases.length} load cases do not stand; ${joints}.`];
  if (state.result.findings.length) return ["bad", "✗", "Not as asked", `It stands, but see below; ${joints}.`];
  return ["ok", "✓", "Stands", `${state.result.closing[0].toUpperCase()}${state.result.closing.slice(1)}; ${joints}.`];
};

const fact = (term, ...value) => [el("dt", {}, term), el("dd", {}, ...value)];

const facts = () => {
  const found = verdicts(), rows = [];
  const ins = found.insertions;
  if (ins.length) {
    const worst = ins.reduce((a, b) => (a.alpha_deg < b.alpha_deg ? a : b)), ok = ins.filter((i) => i.assemblable).length;
    rows.push(...fact("Insertion", `${ok} of ${ins.length} parts go in; tightest `, link(parts()[worst.part].name, { part: worst.part }), worst.alpha_deg < 0 ? " has no way" : ` ±${degrees(worst.alpha_deg)}`));
  }
  if (found.reserve) rows.push(...fact("Reserve", found.reserve.words + (found.reserve.limit && !found.reserve.reached ? `; ${found.reserve.limit}` : "")));
  if (found.supports?.length) rows.push(...fact("Support", `needed after placing ${named(found.supports)}`));
  for (const words of found.loads || []) rows.push(...fact("Load", words));
  if (found.friction) rows.push(...fact("Friction", found.friction));
  const total = parts().reduce((sum, p) => sum + p.mass, 0);
  rows.push(...fact("Parts", `${parts().length}, ${parts().filter((p) => p.fixed).length} fixed; ${mass(total)}; ${state.input.contacts.length} contacts`));
  if (found.seconds) rows.push(...fact("Computed in", `${found.seconds.toFixed(2)} s`));
  return el("dl", { className: "facts" }, ...rows);
};

const pick = (what) => { state.picked = what; changed("picked"); };
const link = (text, what) => el("button", { type: "button", className: "link", onclick: () => pick(what) }, text);

const selected = () => {
  if (state.picked?.part !== undefined && parts()[state.picked.part]) return partCard(state.picked.part);
  if (state.picked?.joint) return jointCard(state.picked.joint);
  return null;
};

const partCard = (k) => {
  const part = parts()[k], way = insertionOf(k), rows = [];
  rows.push(...fact("Size", part.extent.map(length).join(" × ")), ...fact("Mass", mass(part.mass)));
  if (way) {
    rows.push(...fact("Goes in", way.alpha_deg < 0 ? "no direction is free" : `within ±${degrees(way.alpha_deg)}${way.required_deg === null ? "" : `; asked for ±${degrees(way.required_deg)}`}`));
    if (way.blockers.length) rows.push(...fact("Barred by", ...way.blockers.flatMap((b, n) => [n ? ", " : "", link(parts()[b].name, { part: b })])));
  }
  rows.push(...fact("Touches", ...part.neighbours.flatMap((b, n) => [n ? ", " : "", link(parts()[b].name, { part: b })])));
  const shown = currentCase();
  if (shown?.stands) {
    const mine = shown.forces.filter((f) => f.parts.includes(k)).map((f) => Math.hypot(...f.vector));
    if (mine.length) rows.push(...fact("Carries", `up to ${sig(Math.max(...mine))} N at a contact point`));
  } else if (shown?.moving.includes(k)) rows.push(...fact("Moves", shown.words));
  const density = el("input", { type: "text", value: state.doc.data?.parts?.[part.name]?.density ?? "", placeholder: sig(part.density, 4), ariaLabel: "Density of this part" });
  density.onchange = () => change(["parts", part.name, "density"], density.value);
  const fixed = inputParts().filter((p) => p.fixed).map((p) => p.name), isFixed = fixed.includes(part.name);
  const toggle = el("button", { type: "button", id: "fixfree", onclick: () => change(["fixed"], isFixed ? fixed.filter((n) => n !== part.name) : [...fixed, part.name]) }, isFixed ? "Free it (F)" : "Fix it (F)");
  return el("div", { className: "selected" },
    el("div", { className: "row" }, el("h3", {}, part.name + (part.fixed ? ", fixed" : "")), closer()),
    el("dl", { className: "facts" }, ...rows),
    el("div", { className: "field" }, el("div", { className: "top" }, el("label", {}, "Own density"), el("span", { className: "value" }, density, el("span", { className: "unit" }, "kg/m³")))),
    el("div", { className: "actions" }, toggle, ...jointsOf(k)));
};
const jointsOf = (k) => {
  const list = showsResult() ? state.result.joints : state.input.contacts;
  return list.filter((j) => j.parts.includes(k)).slice(0, 8).map((j) => el("button", { type: "button", onclick: () => pick({ joint: { parts: j.parts, k: j.k } }) }, `joint with ${parts()[j.parts[0] === k ? j.parts[1] : j.parts[0]].name}`));
};
const closer = () => el("button", { type: "button", className: "link", ariaLabel: "Close", onclick: () => pick(null) }, "✕");

const jointCard = (chosen) => {
  const same = (j) => j.parts.join() === chosen.parts.join() && j.k === chosen.k;
  const joint = showsResult() ? state.result.joints.find(same) : null, contact = state.input.contacts.find(same);
  if (!joint && !contact) return null;
  const [a, b] = chosen.parts, rows = [...fact("Between", link(parts()[a].name, { part: a }), " and ", link(parts()[b].name, { part: b }))];
  const flat = state.input.assembly.dimension === 2;
  if (contact) rows.push(...fact("Contact", flat ? length(contact.measure) : `${sig(contact.measure * 1e4)} cm²`));
  if (joint) {
    rows.push(...fact("Joint", joint.planar ? "flat" : joint.kind));
    if (!joint.planar) rows.push(...fact("Steepest", degrees(joint.slope_deg)), ...fact("Height", length(joint.height)), ...(joint.radius ? fact("Radius", `at least ${length(joint.radius)}`) : []));
  }
  const shown = currentCase();
  if (shown?.stands) {
    const mine = shown.forces.filter((f) => f.parts[0] === a && f.parts[1] === b);
    if (mine.length) {
      const sum = mine.reduce((t, f) => t.map((v, i) => v + f.vector[i]), mine[0].vector.map(() => 0));
      rows.push(...fact("Force", `${sig(Math.hypot(...sum))} N on ${parts()[b].name}`));
    } else rows.push(...fact("Force", "none"));
  }
  return el("div", { className: "selected" }, el("div", { className: "row" }, el("h3", {}, "Joint"), closer()), el("dl", { className: "facts" }, ...rows));
};

const cases = () => {
  const found = verdicts(), now = currentCase();
  const rows = found.cases.map((c) => el("li", {}, el("button", { type: "button", ariaPressed: String(now?.case === c.case), onclick: () => {
    state.shownCase = c.case;
    state.step = freeParts().length;
    state.tilt = { ...state.tilt, angle: 0 };
    changed("case", "step");
  } }, el("span", { className: c.stands ? "ok-ink" : "bad-ink" }, c.stands ? "✓" : "✗"), el("span", {}, c.words))));
  return [el("h2", {}, "Load cases"), el("ul", { className: "cases" }, ...rows)];
};

let last = "";
export const render = (root) => {
  if (!state.doc.open) return;
  root.classList.toggle("stale", stale() && Boolean(verdicts()));
  const signature = JSON.stringify([headline(), state.picked, state.which, verdicts()?.revision, verdicts()?.stage, state.input?.revision, state.before?.revision, currentCase()?.case, currentCase()?.revision, currentCase()?.question, state.problem?.text]);
  if (signature === last || root.contains(document.activeElement) && document.activeElement.tagName === "INPUT") return;
  last = signature;
  const [kind, mark, words, more] = headline(), found = verdicts();
  const judged = el("div", { className: "judged" });
  judged.append(el("div", { className: `headline ${kind}` }, el("div", { className: "mark" }, mark), el("div", {}, el("h1", {}, words), el("p", {}, more))));
  if (found) {
    for (const f of found.findings) {
      judged.append(el("p", { className: "finding", onclick: () => {
        const part = parts().findIndex((p) => p.name === f.parts[0]);
        if (part >= 0) state.picked = { part };
        if (f.case) state.shownCase = f.case;
        changed("picked", "case");
      } }, f.text));
    }
  }
  const card = state.input ? selected() : null;
  if (card) judged.append(card);
  if (found && state.input) judged.append(el("h2", {}, "Figures"), facts(), ...cases());
  const notes = [...new Set([...(state.input?.notes || []), ...(showsResult() ? state.result.notes : [])])];
  if (notes.length) judged.append(el("h2", {}, "Notes"), ...notes.slice(0, 12).map((n) => el("p", { className: "note" }, n)));
  if (state.input) judged.append(el("details", {}, el("summary", {}, "What was understood"), ...state.input.understood.map((line) => el("p", { className: "about" }, line))));
  root.replaceChildren(judged);
};
export const fixPicked = () => document.getElementById("fixfree")?.click();
