// The legend, the table of figures, and the list of edits.

const SHAPES = {
  "circle": '<circle cx="9" cy="6" r="3.2"/>',
  "triangle-up": '<path d="M9 1.5 13.5 10h-9z"/>',
  "x-thin": '<path d="M5.5 2.5l7 7m0-7l-7 7" fill="none" stroke-width="1.8"/>',
  "diamond": '<path d="M9 1l5 5-5 5-5-5z"/>',
  "diamond-open": '<path d="M9 1.5l4.5 4.5-4.5 4.5-4.5-4.5z" fill="none" stroke-width="1.6"/>',
};
const swatch = (trace) => {
  const lined = trace.mode.startsWith("lines");
  const colour = trace.fillcolor || (lined ? trace.line.color : trace.marker.color);
  const dash = trace.line && trace.line.dash ? ' stroke-dasharray="2 3"' : "";
  let body = '<path d="M2 1h14v10h-14z"/>';
  if (lined && !trace.fillcolor) body = `<path d="M0 6h18" stroke-width="2"${dash}/>`;
  else if (!lined) body = SHAPES[trace.marker.symbol] || SHAPES.circle;
  const edge = trace.fillcolor ? "none" : colour;
  return `<svg viewBox="0 0 18 12" fill="${colour}" stroke="${edge}" aria-hidden="true">${body}</svg>`;
};

// A button per kind of mark and line, which shows or hides it in all plots.
export const legend = (place, found, marks, hidden, changed) => {
  const traces = new Map();
  for (const figure of [found.plan, found.strips]) {
    for (const trace of figure ? figure.data : []) {
      const none = trace.name === "waits for a run" && !trace.x.length;
      if (trace.name === "difference") continue; // its strip says what it is
      if (!none && trace.mode !== "markers+text" && !traces.has(trace.name)) {
        traces.set(trace.name, trace);
      }
    }
  }
  const totals = Object.fromEntries(
    Object.entries(marks.verdicts).map(([key, mark]) => [mark.name, found.told.verdicts[key]]),
  );
  const focused = place.contains(document.activeElement) && document.activeElement.dataset.name;
  place.replaceChildren();
  const last = ["before", "waits for a run"];
  const sorted = [...traces].sort((a, b) => last.indexOf(a[0]) - last.indexOf(b[0]));
  for (const [name, trace] of sorted) {
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.name = name;
    button.title = "Show or hide; what is hidden is not chosen";
    button.setAttribute("aria-pressed", String(!hidden.has(name)));
    button.innerHTML = swatch(trace);
    button.append(totals[name] ? `${name} ${totals[name].toLocaleString("en")}` : name);
    button.addEventListener("click", () => {
      if (!hidden.delete(name)) hidden.add(name);
      button.setAttribute("aria-pressed", String(!hidden.has(name)));
      changed();
    });
    place.append(button);
    if (name === focused) button.focus();
  }
};

const figure = (value, digits, unit) =>
  value === null || value === undefined
    ? "–"
    : `${value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits })} ${unit}`.trim();

// Figures of this run, beside those of the one it is compared with.
export const tabled = (place, told, compared) => {
  const counts = Object.keys(told.verdicts)
    .filter((key) => told.verdicts[key] || (compared && compared.verdicts[key]))
    .map((key) => [key, (t) => t.verdicts[key], 0, ""]);
  const figures = [
    ["track", (t) => t.distance_m, 1, "m"],
    ["fastest, clean", (t) => t.speed_mps.clean.max, 2, "m/s"],
    ["2σ horizontal", (t) => t.two_sigma_m.horizontal, 2, "m"],
    ["2σ vertical", (t) => t.two_sigma_m.vertical, 2, "m"],
  ];
  const apart = compared && [
    ["tracks apart, rms", figure(compared.rms_m, 3, "m")],
    ["most", figure(compared.most_m, 2, "m")],
  ];
  place.replaceChildren(table(counts, told, compared), table(figures, told, compared, apart || []));
};

const table = (rows, told, compared, more = []) => {
  const made = document.createElement("table");
  const line = (kind, [name, ...texts], span = 1) => {
    const row = document.createElement("tr");
    const cells = [["th", name], ...texts.map((text) => [kind, text])];
    row.append(
      ...cells.map(([what, text], i) => {
        const cell = document.createElement(what);
        cell.textContent = text;
        if (i) cell.colSpan = span;
        return cell;
      }),
    );
    return row;
  };
  if (compared) made.createTHead().append(line("th", ["", "before", "now"]));
  const body = made.createTBody();
  for (const [name, of, ...how] of rows) {
    const shown = compared ? [of(compared), of(told)] : [of(told)];
    body.append(line("td", [name, ...shown.map((value) => figure(value, ...how))]));
  }
  for (const cells of more) body.append(line("td", cells, 2));
  return made;
};

// The newest edits first; those that are undone struck out.
export const listed = (place, edits) => {
  place.replaceChildren();
  for (const edit of edits) {
    const row = document.createElement("li");
    row.className = edit.undone ? "undone" : "";
    const when = document.createElement("time");
    when.dateTime = edit.time;
    when.textContent = `${edit.time.slice(11, 19)} `;
    const by = document.createElement("span");
    by.className = "by";
    by.textContent = ` ${edit.by}`;
    const many = edit.total === 1 ? "1 fix" : `${edit.total.toLocaleString("en")} fixes`;
    const what = edit.total ? `${edit.action} ${many} of ${edit.sensors.join(", ")}` : edit.action;
    row.append(when, what, by);
    place.append(row);
  }
};
