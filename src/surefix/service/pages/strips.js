// Series over time, one above the other: σ, speed, height, innovation.

import { AXES, CONFIG, axis, colour, entry, fitted, fixes, layout, told } from "./marks.js";
import { gapped, known } from "./rows.js";
import { dated, figure, place } from "./words.js";

const GAP = 0.05; // of the height, between two strips
const BAND = 3; // σ, where innovations are expected
const plot = document.getElementById("strips");

/** Prepare the strips. */
export const beginStrips = async () => {
  const legend = document.getElementById("axes");
  for (const { name, dash, symbol, colour: paint } of AXES) {
    const both = entry(name, { dash, paint: colour(paint) });
    both.prepend(entry("", { symbol, paint: colour(paint) }).firstElementChild);
    both.dataset.axis = name;
    legend.append(both);
  }
  const empty = { visible: false };
  await Plotly.newPlot(plot, [], layout({ xaxis: empty, yaxis: empty }), CONFIG);
  fitted(plot);
};

const line = (rows, value, more) => ({
  type: "scatter",
  mode: "lines",
  x: rows.map((row) => row && place(row.time)),
  y: rows.map((row) => row && value(row)),
  connectgaps: false,
  hoverinfo: "skip",
  ...more,
});

const sigmas = (rows, yaxis) =>
  AXES.map(({ name, dash, colour: paint }, i) =>
    line(rows, (row) => row.sigma[i], {
      name,
      yaxis,
      line: { color: colour(paint), width: 1.8, dash },
    }),
  );

const speed = (rows, yaxis) => [
  line(rows, ({ velocity: [x, y] }) => (known(x) && known(y) ? Math.hypot(x, y) : null), {
    yaxis,
    line: { color: colour("--clean"), width: 1.8 },
  }),
];

const height = (rows, yaxis, marks, lines) => {
  const edge = (sign) => (row) => (known(row.clean[2]) ? row.clean[2] + sign * 2 * row.sigma[2] : null);
  const plain = { yaxis, line: { width: 0, color: colour("--clean") } };
  return [
    line(lines, edge(-1), plain),
    line(lines, edge(1), { ...plain, fill: "tonexty", fillcolor: colour("--band") }),
    ...fixes(rows.filter((row) => known(row.raw[2])), marks, (row) => [place(row.time), row.raw[2]], { yaxis }),
    line(lines, (row) => row.clean[2], { yaxis, line: { color: colour("--clean"), width: 1.8 } }),
  ];
};

const innovations = (rows, yaxis, marks, most) =>
  AXES.flatMap(({ name, symbol, colour: paint }, i) => {
    const mine = rows.filter((row) => known(row.innovation[i]));
    const outside = (row) => Math.abs(row.innovation[i]) > most;
    const trace = (some, y, marker) => ({
      type: "scatter",
      mode: "markers",
      name,
      yaxis,
      x: some.map((row) => place(row.time)),
      y: some.map(y),
      text: some.map((row) => `${name} ${figure(row.innovation[i], 1, "σ")}<br>${told(row, marks)}`),
      hovertemplate: "%{text}<extra></extra>",
      marker: { line: { color: marker.color, width: 1 }, ...marker },
    });
    const far = mine.filter(outside);
    const side = (row) => Math.sign(row.innovation[i]);
    return [
      trace(mine.filter((row) => !outside(row)), (row) => row.innovation[i], {
        symbol,
        size: 5,
        color: colour(paint),
      }),
      trace(far, (row) => side(row) * most * 1.06, {
        symbol: far.map((row) => (side(row) > 0 ? "triangle-up-open" : "triangle-down-open")),
        size: 8,
        color: colour("--rejected"),
      }),
    ];
  });

const wide = { type: "rect", xref: "paper", x0: 0, x1: 1, layer: "below" };

const band = (yref) => ({
  ...wide,
  yref,
  y0: -BAND,
  y1: BAND,
  line: { width: 1, color: colour("--frame"), dash: "dot" },
  fillcolor: colour("--faint"),
});

const frame = ([y0, y1]) => ({
  ...wide,
  yref: "paper",
  y0,
  y1,
  line: { width: 1, color: colour("--frame") },
});

const reach = (rows) => {
  const used = rows.filter(({ verdict }) => verdict === "used" || verdict === "downweighted");
  return Math.max(4, ...used.flatMap((row) => row.innovation.filter(known).map(Math.abs)));
};

/** Draw rows from `since` until `until`, s. */
export const drawStrips = async (rows, since, until, marks) => {
  const lines = gapped(rows);
  const most = reach(rows);
  const heights = rows.some((row) => known(row.clean[2]));
  const wanted = [
    ["σ, m", (y) => sigmas(lines, y), { rangemode: "tozero" }],
    ["Speed, m/s", (y) => speed(lines, y), { rangemode: "tozero" }],
    ...(heights ? [["Height, m", (y) => height(rows, y, marks, lines), {}]] : []),
    [
      "Innovation, σ",
      (y) => innovations(rows, y, marks, most),
      { range: [-1.15 * most, 1.15 * most] },
    ],
  ];
  const tall = (1 - GAP * (wanted.length - 1)) / wanted.length;
  const data = [];
  const settings = {};
  const shapes = [band(`y${wanted.length}`)];
  wanted.forEach(([title, traces, more], i) => {
    const end = i ? i + 1 : "";
    const top = 1 - i * (tall + GAP);
    const domain = [Math.max(0, top - tall), Math.min(1, top)];
    data.push(...traces(`y${end}`));
    shapes.push(frame(domain));
    settings[`yaxis${end}`] = axis(title, {
      domain,
      nticks: 5,
      showline: false,
      fixedrange: true,
      ...more,
    });
  });
  const last = wanted.length;
  const kind = dated(until) ? { type: "date", tickformat: "%H:%M:%S" } : { type: "linear" };
  const drawn = layout({
    margin: { l: 56, r: 10, t: 8, b: 40 },
    dragmode: "pan",
    uirevision: `${since} ${until}`,
    xaxis: axis(dated(until) ? "Time, UTC" : "Time, s", {
      ...kind,
      range: [place(since), place(until)],
      anchor: `y${last}`,
      nticks: 6,
      showline: false,
    }),
    shapes,
    ...settings,
  });
  await Plotly.react(plot, data, drawn, CONFIG);
  document.querySelector('#axes [data-axis="up"]').hidden = !heights;
  const kinds = wanted.map(([title]) => title.split(",")[0]).join(", ");
  plot.setAttribute("aria-label", `Series over time: ${kinds}; innovations with a band of ±3 σ`);
};
