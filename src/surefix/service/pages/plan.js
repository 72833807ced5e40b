// Plan view: fixes, track, 2σ ellipse, north up, equal axes.

import { make, say } from "./build.js";
import { CONFIG, axis, colour, entry, fitted, fixes, layout, paint } from "./marks.js";
import { gapped, known } from "./rows.js";
import { figure } from "./words.js";

const CORNERS = 48;
const LEAST = 10; // m; narrower views are not taken by themselves
const plot = document.getElementById("plan");
const follow = document.getElementById("follow");

let following = true;
let turn = 0;
let drawing = false;

const setFollowing = (on) => {
  following = on;
  follow.setAttribute("aria-pressed", String(on));
};

/** Prepare the plan; `redraw()` is called when the view is to follow again. */
export const beginPlan = async (marks, redraw) => {
  const legend = document.getElementById("legend");
  for (const [verdict, { name, marker }] of Object.entries(marks.verdicts)) {
    legend.append(entry(name, { symbol: marker.symbol, paint: paint(verdict, marker.color) }));
  }
  legend.append(entry("track", { dash: "solid", paint: colour("--clean") }));
  const ring = make("span", "2σ");
  ring.prepend(make("i.ellipse"));
  legend.append(ring);
  await Plotly.newPlot(plot, [], frame([0, 1], [0, 1]), CONFIG);
  fitted(plot);
  plot.on("plotly_relayout", (change) => {
    if (drawing || change.autosize || !Object.keys(change).some((key) => key.includes("range"))) {
      return;
    }
    setFollowing(false);
  });
  follow.addEventListener("click", () => {
    setFollowing(!following);
    redraw();
  });
};

const frame = (x, y) =>
  layout({
    margin: { l: 56, r: 10, t: 8, b: 40 },
    dragmode: "pan",
    uirevision: turn,
    xaxis: axis("East, m", { range: x, tickformat: ",~r" }),
    yaxis: axis("North, m", { range: y, tickformat: ",~r", scaleanchor: "x", scaleratio: 1 }),
  });

const ellipse = ({ local, sigma }) => {
  const turns = Array.from({ length: CORNERS + 1 }, (_, i) => (2 * Math.PI * i) / CORNERS);
  return {
    type: "scatter",
    mode: "lines",
    name: "2σ",
    x: turns.map((a) => local[0] + 2 * sigma[0] * Math.cos(a)),
    y: turns.map((a) => local[1] + 2 * sigma[1] * Math.sin(a)),
    fill: "toself",
    fillcolor: colour("--band"),
    line: { color: colour("--clean"), width: 1.5, dash: "dot" },
    hoverinfo: "skip",
  };
};

const here = ({ local, dead_reckoned: dead }) => ({
  type: "scatter",
  mode: "markers",
  name: "here",
  x: [local[0]],
  y: [local[1]],
  marker: {
    symbol: dead ? "circle-open" : "circle",
    size: 13,
    color: colour("--clean"),
    line: { width: 2.5, color: colour(dead ? "--clean" : "--paper") },
  },
  hoverinfo: "skip",
});

/** From the last row that is cleaned for good to where the vehicle is by all that came since. */
const ahead = (rows, { local }) => {
  const last = rows.findLast(({ clean }) => known(clean[0]));
  return {
    type: "scatter",
    mode: "lines",
    name: "not yet for good",
    x: last ? [last.clean[0], local[0]] : [],
    y: last ? [last.clean[1], local[1]] : [],
    line: { color: colour("--clean"), width: 2, dash: "dot" },
    hoverinfo: "skip",
  };
};

const bounds = (values, spare) => {
  const finite = values.filter(known);
  if (!finite.length) return [0, 1];
  const low = Math.min(...finite);
  const high = Math.max(...finite);
  const pad = 0.06 * (high - low) + spare;
  return [low - pad, high + pad];
};

/** Draw rows, and where the vehicle is, or was: {local, sigma, dead_reckoned} or null. */
export const drawPlan = async (rows, position, marks) => {
  const sure = rows.filter((row) => row.verdict === "used" || row.verdict === "downweighted");
  const core = (i) => [
    ...sure.map((row) => row.raw[i]),
    ...rows.map((row) => row.clean[i]),
    ...(position ? [position.local[i] - 2 * position.sigma[i], position.local[i] + 2 * position.sigma[i]] : []),
  ];
  const spans = [0, 1].map((i) => bounds(core(i), 0));
  const wide = Math.max(...spans.map(([a, b]) => b - a));
  const spare = Math.max(0, (LEAST - wide) / 2);
  const [x, y] = spans.map(([a, b]) => [a - spare, b + spare]);
  if (following) turn += 1;
  const line = gapped(rows);
  const track = {
    type: "scatter",
    mode: "lines",
    name: "track",
    x: line.map((row) => row && row.clean[0]),
    y: line.map((row) => row && row.clean[1]),
    line: { color: colour("--clean"), width: 2 },
    connectgaps: false,
    hoverinfo: "skip",
  };
  const marked = fixes(rows, marks, (row) => row.raw);
  const data = position
    ? [marked[0], ellipse(position), track, ahead(rows, position), ...marked.slice(1), here(position)]
    : [marked[0], track, ...marked.slice(1)];
  drawing = true;
  try {
    await Plotly.react(plot, data, frame(x, y), CONFIG);
  } finally {
    drawing = false;
  }
  const [wx, wy] = [plot.layout.xaxis.range, plot.layout.yaxis.range];
  const inside = ({ raw }) => raw[0] >= wx[0] && raw[0] <= wx[1] && raw[1] >= wy[0] && raw[1] <= wy[1];
  const rejected = rows.filter((row) => row.verdict === "rejected");
  const out = rejected.filter((row) => known(row.raw[0]) && !inside(row)).length;
  const note = out ? `${out} rejected ${out === 1 ? "fix lies" : "fixes lie"} outside this view.` : "";
  say(document.getElementById("outside"), note);
  const sigma = position ? `, standard deviation ${figure(Math.max(...position.sigma.slice(0, 2)), 2, "m")}` : "";
  const label = `Plan view of ${rows.length} fixes, ${rejected.length} rejected${sigma}`;
  plot.setAttribute("aria-label", label);
};
