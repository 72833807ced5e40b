// How things are drawn: marks as in the report, colours of the theme, the frame of a figure.

import { make } from "./build.js";
import { place, plain } from "./words.js";

const SHAPES = {
  "circle": '<circle cx="9" cy="6" r="3.2"/>',
  "triangle-up": '<path d="M9 1.5 13.5 10h-9z"/>',
  "x-thin": '<path d="M5.5 2.5l7 7m0-7l-7 7" fill="none" stroke-width="1.8"/>',
  "diamond": '<path d="M9 1l5 5-5 5-5-5z"/>',
  "square-open": '<path d="M5.8 2.8h6.4v6.4h-6.4z" fill="none" stroke-width="1.4"/>',
};

/** Lines of the three axes: told apart by dash and shape as well as by colour. */
export const AXES = [
  { name: "east", dash: "solid", symbol: "circle", colour: "--east" },
  { name: "north", dash: "dash", symbol: "square-open", colour: "--north" },
  { name: "up", dash: "dot", symbol: "triangle-up", colour: "--up" },
];

/** A colour of the theme. */
export const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** An entry of a legend: a mark, or a line with a dash, and what it is. */
export const entry = (name, { symbol, dash, paint }) => {
  const item = make("span", name);
  const body = symbol
    ? SHAPES[symbol]
    : `<path d="M0 6h18" fill="none" stroke-width="2"${dashes(dash)}/>`;
  const picture = `<svg class="swatch" viewBox="0 0 18 12" aria-hidden="true">${body}</svg>`;
  item.insertAdjacentHTML("afterbegin", picture);
  const drawn = item.firstElementChild;
  drawn.setAttribute("fill", paint);
  drawn.setAttribute("stroke", paint);
  return item;
};

const dashes = (dash) => {
  if (dash === "dash") return ' stroke-dasharray="5 3"';
  return dash === "dot" ? ' stroke-dasharray="2 3"' : "";
};

/** An axis as the report has it, in the colours of the theme. */
export const axis = (title, more = {}) => ({
  title: { text: title, standoff: 6, font: { size: 12, color: colour("--muted") } },
  gridcolor: colour("--grid"),
  zeroline: false,
  showline: true,
  mirror: true,
  linecolor: colour("--frame"),
  ticks: "outside",
  ticklen: 4,
  tickcolor: colour("--frame"),
  tickfont: { size: 11, color: colour("--muted") },
  ...more,
});

/** Settings of a whole figure. */
export const layout = (more) => ({
  font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("--ink") },
  paper_bgcolor: "rgba(0,0,0,0)",
  plot_bgcolor: colour("--paper"),
  showlegend: false,
  hovermode: "closest",
  hoverlabel: {
    bgcolor: colour("--paper"),
    bordercolor: colour("--frame"),
    font: { size: 12, color: colour("--ink") },
    align: "left",
  },
  ...more,
});

/** Let a figure have the size of its place, whenever that changes. */
export const fitted = (plot) => {
  new ResizeObserver(() => Plotly.Plots.resize(plot)).observe(plot);
};

/** Plotly's settings: nothing leaves the page. */
export const CONFIG = {
  displaylogo: false,
  displayModeBar: false,
  showSendToCloud: false,
  plotlyServerURL: "",
  scrollZoom: true,
};

/** Text of a fix under the pointer. */
export const told = (row, marks) => {
  const name = marks.verdicts[row.verdict]?.name ?? row.verdict;
  return `${plain(row.sensor)}<br><b>${plain(name)}</b>: ${plain(row.reason)}`;
};

/** Traces of fixes, one for each verdict that occurs; `at(row)` gives x and y. */
export const fixes = (rows, marks, at, more = {}) =>
  Object.entries(marks.verdicts).map(([verdict, { name, marker }]) => {
    const mine = rows.filter((row) => row.verdict === verdict);
    const line = { ...marker.line, color: paint(verdict, marker.color) };
    return {
      type: "scatter",
      mode: "markers",
      name,
      x: mine.map((row) => at(row)[0]),
      y: mine.map((row) => at(row)[1]),
      customdata: mine.map((row) => place(row.time)),
      text: mine.map((row) => told(row, marks)),
      marker: { ...marker, color: paint(verdict, marker.color), line },
      hovertemplate: "%{text}<extra></extra>",
      ...more,
    };
  });

/** Colour of a verdict: the report's, but for what would not be seen on the dark theme. */
export const paint = (verdict, usual) => colour(`--${verdict}`) || usual;
