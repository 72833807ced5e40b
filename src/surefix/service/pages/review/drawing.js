// The plan view and the strips: what is drawn, zoomed into, clicked and drawn around.

const Plotly = globalThis.Plotly;
const ring = (n) => ({
  symbol: "circle-open", size: n > 12 ? 9 : 14, color: "#1c2733", line: { width: n > 12 ? 1.3 : 2.2 },
});
const CONFIG = {
  displaylogo: false,
  displayModeBar: false,
  responsive: false,
  scrollZoom: true,
  doubleClick: false,
  showTips: false,
  showSendToCloud: false,
  plotlyServerURL: "",
};

const seconds = (moment) => {
  if (typeof moment === "number") return moment;
  const [day, time] = String(moment).split(" ");
  return Date.parse(`${day}T${time || "00:00:00"}Z`) / 1000;
};
const numbers = (values) => values.map(seconds);
const axes = (figure) => figure.panels.map((_, i) => `y${i ? i + 1 : ""}`);

// One plot. `on` has chosen({panel, line}), clicked(row), looked(ranges) and cleared().
export const plot = (place, on) => {
  let figure = null;
  let rings = [];
  let drag = "lasso";
  let hidden = new Set();
  let looked = null; // ranges that were zoomed into
  let quiet = false;
  let drawn = 0;

  const plain = (trace) => ({
    ...trace,
    visible: !hidden.has(trace.name),
    selectedpoints: null,
    unselected: { marker: { opacity: 1 } },
  });
  const around = () =>
    rings.map((place) => ({
      type: "scatter", mode: "markers", name: "chosen", hoverinfo: "skip",
      marker: ring(place.x.length), ...place,
    }));
  const ranges = () => {
    const full = place._fullLayout;
    const out = { x: full.xaxis.range.slice() };
    for (const key of Object.keys(full)) {
      if (/^yaxis\d*$/.test(key)) out[key.replace("axis", "")] = full[key].range.slice();
    }
    return out;
  };
  const layout = () => {
    const given = structuredClone(figure.layout);
    const width = place.clientWidth;
    given.dragmode = drag;
    given.width = width;
    given.height = place.clientHeight;
    given.margin = { l: width < 520 ? 50 : 60, r: 10, t: 8, b: 42, pad: 0 };
    given.newselection = { line: { color: "#1c2733", width: 1.5, dash: "dot" } };
    given.selections = [];
    given.selectionrevision = ++drawn; // what was drawn around is ringed, its line goes
    for (const [axis, range] of Object.entries(looked || {})) {
      const key = axis.replace(/^([xy])/, "$1axis");
      if (given[key]) Object.assign(given[key], { range: range.slice(), autorange: false });
    }
    return given;
  };
  let queue = Promise.resolve(); // one drawing at a time, and the last is of the newest
  const draw = () => (queue = queue.then(drawNow, drawNow));
  const drawNow = async () => {
    if (!figure || !place.clientWidth) return;
    quiet = true;
    try {
      await Plotly.react(place, [...figure.data.map(plain), ...around()], layout(), CONFIG);
    } finally {
      quiet = false;
    }
    if (place.dataset.ready) return;
    place.dataset.ready = "true";
    place.on("plotly_click", ({ points, event }) => {
      const [point] = points.filter((p) => (figure.rows[p.curveNumber] || []).length);
      if (point) on.clicked(figure.rows[point.curveNumber][point.pointNumber], event);
    });
    place.on("plotly_selected", (event) => {
      if (!event || quiet) return;
      const drawn = event.lassoPoints || event.range;
      if (!drawn) return;
      const up = Object.keys(drawn).find((key) => key.startsWith("y"));
      const panel = figure.panels[axes(figure).indexOf(up)];
      const x = numbers(drawn.x), y = drawn[up];
      const line = event.lassoPoints
        ? x.map((value, i) => [value, y[i]])
        : [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]];
      if (panel) on.chosen({ panel, line });
      draw().then(() => place.querySelector(".hoverlayer").replaceChildren()); // hides what is chosen
    });
    place.on("plotly_relayout", (change) => {
      if (quiet || !Object.keys(change).some((key) => key.includes("axis"))) return;
      looked = ranges();
      on.looked({ x: numbers(looked.x), y: looked.y });
    });
  };

  return {
    draw,
    show: (given) => { figure = given; return draw(); },
    ring: (given) => { rings = given(figure ? figure.panels : []); return draw(); },
    hide: (names) => { hidden = names; return draw(); },
    dragging: (kind) => { drag = kind; return draw(); },
    whole: () => { looked = null; return draw(); },
    // Brings a place into view if it is not; y by axis.
    reveal: (x, y) => {
      if (!looked || x === null) return;
      const now = ranges();
      for (const [axis, value] of Object.entries({ x, ...y })) {
        if (value === null || !now[axis]) continue;
        const [low, high] = numbers(now[axis]);
        const at = seconds(value);
        if (at >= Math.min(low, high) && at <= Math.max(low, high)) continue;
        const half = (high - low) / 2;
        const back = typeof now[axis][0] === "string"
          ? (s) => new Date(s * 1000).toISOString().replace("T", " ").slice(0, -1)
          : (s) => s;
        looked = { ...now, ...looked, [axis]: [back(at - half), back(at + half)] };
      }
    },
    figure: () => figure,
  };
};
