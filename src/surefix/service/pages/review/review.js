// The review page: state of the page, tools, keys.

import { blob, get, post, unpacked } from "./calls.js";
import { plot } from "./drawing.js";
import { legend, listed, tabled } from "./words.js";

const $ = (id) => document.getElementById(id);
const page = { state: null, marks: null, parts: [], adding: false, at: null, ranges: {} };
const hidden = new Set();

const tell = (text, kind = "") => {
  $("status").textContent = text;
  $("status").className = kind;
};
const tried = (what) => async (...given) => {
  try {
    return await what(...given);
  } catch (error) {
    tell(error.message, "bad");
    return null;
  }
};
const plural = (n, what = "fix") => `${n.toLocaleString("en")} ${n === 1 ? what : `${what}es`}`;

// What is chosen

const shown = () =>
  Object.entries(page.marks.verdicts)
    .filter(([, mark]) => !hidden.has(mark.name))
    .map(([verdict]) => verdict);
const choice = () => ({ run: page.state.run, parts: page.parts, verdicts: shown() });

const choose = tried(async (part, add) => {
  page.parts = part === null ? [] : add || page.adding ? [...page.parts, part] : [part];
  const found = page.parts.length
    ? unpacked(await post("api/choose", choice()))
    : { total: 0, verdicts: {}, marks: null, text: "" };
  if (found.first !== undefined && found.total) page.at = found.first;
  const marks = found.marks;
  await plan.ring(() => (marks ? [{ x: marks.east, y: marks.north }] : []));
  await strips.ring((panels) =>
    panels.map((name, i) => ({
      x: marks ? marks.time : [],
      y: marks ? marks[name] : [],
      xaxis: "x",
      yaxis: i ? `y${i + 1}` : "y",
    })),
  );
  $("count").textContent = found.total ? plural(found.total) : "";
  const parts = Object.entries(found.verdicts).filter(([, n]) => n);
  $("said").textContent = found.total
    ? found.text || parts.map(([name, n]) => `${n.toLocaleString("en")} ${name}`).join(", ")
    : "Click a fix, or draw a box or a line around some.";
  for (const id of ["reject", "accept", "restore", "none"]) $(id).disabled = !found.total;
  return found;
});

const step = tried(async (by) => {
  const from = page.at === null ? "" : `&row=${page.at}`;
  const { row } = await get(`api/step?by=${by}${from}`);
  if (row === null) return tell("no other fix is doubted");
  const found = await choose({ panel: "", rows: [row] }, false);
  if (!found) return null;
  const { marks } = found;
  plan.reveal(marks.east[0], { y: marks.north[0] });
  strips.reveal(marks.time[0], {});
  await plan.draw();
  return strips.draw();
});

// What is decided

const settle = (state) => {
  page.state = { ...page.state, ...state };
  const { edits, waiting, undo, redo, busy, done, error, run } = page.state;
  $("undo").disabled = !undo;
  $("redo").disabled = !redo;
  $("run").disabled = Boolean(busy);
  $("run").classList.toggle("due", waiting > 0 && !busy);
  $("bar").hidden = !busy;
  $("bar").classList.toggle("unknown", busy === "cleaning");
  $("bar").firstElementChild.style.width = `${Math.round(100 * done)}%`;
  listed($("edits"), edits);
  $("edits-total").textContent = page.state.total ? page.state.total.toLocaleString("en") : "";
  if (busy) tell(busy === "reading" ? `reading, ${Math.round(100 * done)} %` : "cleaning …");
  else if (error) tell(error, "bad");
  else if (waiting) tell(`${plural(waiting)} decided since: clean again to see the track`, "due");
  else tell(run > 1 ? `run ${run}; the track has all edits` : "the track has all edits");
};

const decide = tried(async (action) => {
  if ($("reject").disabled) return;
  settle(await post("api/edit", { ...choice(), action }));
  await choose(null);
  await draw();
});
const turn = tried(async (action) => {
  settle(await post(`api/${action}`));
  await draw();
});
const again = tried(async () => {
  if (page.state.busy) return;
  settle(await post("api/run"));
  while (page.state.busy) {
    await new Promise((next) => setTimeout(next, 300));
    settle(await get("api/state"));
  }
  await choose(null);
  await draw();
  if (page.state.error) tell(page.state.error, "bad");
});
const exported = tried(async (suffix) => {
  const { name, content } = await blob(`api/export/${suffix}`);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  tell(`exported ${name}`);
});

// What is drawn

const query = (of) => {
  const words = { compare: $("compare").value, of };
  const { x, y } = page.ranges[of] || {};
  if (of === "plan" && x) Object.assign(words, { x0: x[0], x1: x[1], y0: y[0], y1: y[1] });
  if (of === "strips" && x) Object.assign(words, { t0: x[0], t1: x[1] });
  return `api/figures?${new URLSearchParams(words)}`;
};
const drawOne = async (of) => {
  const found = unpacked(await get(query(of)));
  const figure = found[of];
  $(`${of}-note`).textContent = figure ? figure.note : "";
  if (figure) await { plan, strips }[of].show(figure);
  return found;
};
const draw = tried(async () => {
  const found = { ...(await drawOne("plan")), ...(await drawOne("strips")) };
  $("plan").parentElement.classList.toggle("none", !found.plan);
  legend($("legend"), found, page.marks, hidden, () => {
    plan.hide(hidden);
    strips.hide(hidden);
  });
  if ($("strips-note").textContent === $("plan-note").textContent) $("strips-note").textContent = "";
  tabled($("told"), found.told, found.compared);
  document.documentElement.dataset.drawn = String(found.number);
});
const looked = (of) => {
  let waits = 0;
  return (ranges) => {
    page.ranges[of] = ranges;
    const { figure } = { plan, strips }[of];
    if (!figure() || !(figure().note || page.thinned)) return;
    page.thinned = true; // a part of the fixes is drawn: more of them, now that fewer are in view
    clearTimeout(waits);
    waits = setTimeout(tried(() => drawOne(of)), 350);
  };
};
const clicked = (row, event) => choose({ panel: "", rows: [row] }, event && event.shiftKey);
const plan = plot($("plan"), { chosen: (p) => choose(p, false), clicked, looked: looked("plan") });
const strips = plot($("strips"), {
  chosen: (p) => choose(p, false), clicked, looked: looked("strips"),
});

// Tools and keys

const dragging = (kind) => {
  for (const each of document.querySelectorAll("[data-drag]")) {
    each.setAttribute("aria-checked", String(each.dataset.drag === kind));
    each.tabIndex = each.dataset.drag === kind ? 0 : -1;
  }
  plan.dragging(kind);
  strips.dragging(kind);
};
const adding = (on) => {
  page.adding = on;
  $("adding").setAttribute("aria-pressed", String(on));
};
const whole = () => {
  page.ranges = {};
  plan.whole();
  strips.whole();
  return draw();
};

const KEYS = {
  a: () => decide("accept"), x: () => decide("reject"), u: () => decide("restore"),
  delete: () => decide("reject"),
  r: () => again(), escape: () => choose(null), ",": () => step(-1), ".": () => step(1),
  m: () => dragging("pan"), z: () => dragging("zoom"), b: () => dragging("select"),
  l: () => dragging("lasso"), 0: () => whole(),
};
addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if (event.ctrlKey || event.metaKey) {
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    const action = key === "y" || event.shiftKey ? "redo" : "undo";
    if (page.state && page.state[action]) turn(action);
    return;
  }
  if (event.altKey || event.target.matches("select") || !KEYS[key] || !page.state) return;
  event.preventDefault();
  KEYS[key]();
});
const radios = [...document.querySelectorAll("[data-drag]")];
for (const [i, each] of radios.entries()) {
  each.addEventListener("click", () => dragging(each.dataset.drag));
  each.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!by) return;
    const other = radios[(i + by + radios.length) % radios.length];
    dragging(other.dataset.drag);
    other.focus();
  });
}
$("adding").addEventListener("click", () => adding(!page.adding));
for (const id of ["accept", "reject", "restore"]) $(id).addEventListener("click", () => decide(id));
for (const id of ["undo", "redo"]) $(id).addEventListener("click", () => turn(id));
$("run").addEventListener("click", again);
$("whole").addEventListener("click", whole);
$("none").addEventListener("click", () => choose(null));
$("previous").addEventListener("click", () => step(-1));
$("next").addEventListener("click", () => step(1));
$("compare").addEventListener("change", draw);
$("export").addEventListener("change", ({ target }) => {
  if (target.value) exported(target.value);
  target.value = "";
});
let resized = 0;
addEventListener("resize", () => {
  clearTimeout(resized);
  resized = setTimeout(() => { plan.draw(); strips.draw(); }, 120);
});

tried(async () => {
  page.marks = await get("pages/marks.json");
  const state = await get("api/state");
  $("sources").textContent = state.sources.join(", ");
  document.title = `Review of ${state.sources.join(", ")}`;
  $("command").textContent = state.command;
  for (const suffix of state.formats) {
    const text = suffix === "html" ? "report (HTML)" : suffix;
    $("export").append(new Option(text, suffix));
  }
  dragging("lasso");
  settle(state);
  await draw();
  if (state.torn) tell(`left out, cut off in a crash: ${state.torn}`, "bad");
  document.documentElement.dataset.ready = "true";
  if (state.busy) again();
  setInterval(async () => {
    if (document.hidden || page.state.busy) return;
    const ended = (error) => (error instanceof TypeError ? "surefix review has ended" : error.message);
    const fresh = await get("api/state").catch((error) => void tell(ended(error), "bad"));
    if (!fresh) return;
    const { total, run } = page.state;
    if (fresh.total === total && fresh.run === run) return;
    settle(fresh); // edited by another page, or on the command line
    await draw();
  }, 3000);
})();
