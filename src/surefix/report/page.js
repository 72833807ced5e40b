"use strict";
(() => {
  const page = JSON.parse(document.getElementById("figures").textContent);
  const NARROW = 600; // px; below, figures leave more room to the data
  const PRINT = 690; // px; width of a printed page
  const TOUCH = matchMedia("(pointer: coarse)").matches;

  const unpacked = (text, Kind) =>
    new Kind(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const finite = (values, convert) =>
    Array.from(values, (v) => (Number.isFinite(v) ? convert(v) : null));
  const calendar = (ms) => new Date(ms).toISOString().replace("T", " ").slice(0, -1);
  const arrays = page.arrays.map((a) => {
    if (a.time !== undefined) return finite(unpacked(a.time, Float64Array), calendar);
    if (a.text !== undefined) return Array.from(unpacked(a.text, Int32Array), (i) => a.table[i]);
    return finite(unpacked(a.number, Float32Array), (v) => v + a.offset);
  });

  const filled = (value) => {
    if (Array.isArray(value)) return value.map(filled);
    if (value === null || typeof value !== "object") return value;
    if (value.array !== undefined) return arrays[value.array];
    return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, filled(v)]));
  };

  const shapes = {
    "circle": '<circle cx="9" cy="6" r="3.2"/>',
    "triangle-up": '<path d="M9 1.5 13.5 10h-9z"/>',
    "x-thin": '<path d="M5.5 2.5l7 7m0-7l-7 7" fill="none" stroke-width="1.8"/>',
    "diamond": '<path d="M9 1l5 5-5 5-5-5z"/>',
    "circle-open": '<circle cx="9" cy="6" r="3.2" fill="none" stroke-width="1.4"/>',
    "square-open": '<path d="M5.8 2.8h6.4v6.4h-6.4z" fill="none" stroke-width="1.4"/>',
    "diamond-open": '<path d="M9 1.5l4.5 4.5-4.5 4.5-4.5-4.5z" fill="none" stroke-width="1.4"/>',
  };
  const swatch = (trace) => {
    const lined = trace.mode && trace.mode.startsWith("lines");
    const colour = trace.fillcolor || (lined ? trace.line.color : trace.marker.color);
    const dash = trace.line && trace.line.dash ? ' stroke-dasharray="4 3"' : "";
    let body = '<path d="M2 1h14v10h-14z"/>';
    if (lined && !trace.fillcolor) {
      body = `<path d="M0 6h18" stroke-width="2"${dash}/>`;
    } else if (trace.mode === "markers") {
      body = shapes[trace.marker.symbol] || shapes.circle;
    }
    const edge = trace.fillcolor || trace.type === "bar" ? "none" : colour;
    return `<svg class="swatch" viewBox="0 0 18 12" fill="${colour}" stroke="${edge}" aria-hidden="true">${body}</svg>`;
  };

  const legend = (place, plot, data) => {
    for (const name of new Set(data.map((trace) => trace.name))) {
      const traces = data.flatMap((trace, i) => (trace.name === name ? [i] : []));
      if (data[traces[0]].mode === "markers+text") continue;
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("aria-pressed", "true");
      button.title = "Show or hide";
      button.innerHTML = swatch(data[traces[0]]);
      button.append(name);
      button.addEventListener("click", () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(on));
        Plotly.restyle(plot, { visible: on }, traces);
      });
      place.append(button);
    }
  };

  const round = (length) => {
    const power = 10 ** Math.floor(Math.log10(length));
    return [5, 2, 1].find((k) => k * power <= length) * power;
  };
  const metres = (m) => {
    if (m >= 1000) return `${m / 1000} km`;
    return m < 1 ? `${+(m * 100).toPrecision(3)} cm` : `${m} m`;
  };
  const scale = (place, plot) => {
    const box = document.createElement("div");
    box.className = "scale";
    box.innerHTML =
      '<span><span></span><b></b></span><svg viewBox="0 0 16 30" aria-label="north">' +
      '<path d="M8 0l5 14-5-3-5 3z" fill="#1c2733"/>' +
      '<text x="8" y="28" text-anchor="middle" font-size="12" fill="#1c2733">N</text></svg>';
    place.append(box);
    const update = () => {
      const axis = plot._fullLayout.xaxis;
      const perMetre = axis._length / Math.abs(axis.range[1] - axis.range[0]);
      const length = round(Math.min(140, axis._length / 4) / perMetre);
      box.querySelector("b").style.width = `${length * perMetre}px`;
      box.querySelector("span span").textContent = metres(length);
    };
    plot.on("plotly_afterplot", update);
    update();
  };

  const height = (figure, width) => {
    if (!figure.aspect) return figure.height;
    const tallest = Math.max(360, Math.min(760, window.innerHeight * 0.85));
    return Math.round(Math.max(width < NARROW ? 320 : 400, Math.min(tallest, width * figure.aspect + 60)));
  };
  const sized = (figure, width) => {
    const narrow = width < NARROW;
    const margin = { ...figure.layout.margin, l: narrow ? 46 : 62, r: narrow ? 6 : 14 };
    return { ...figure.layout, margin, width, height: height(figure, width) };
  };

  const everything = (button, plot, layout) => {
    const axes = Object.keys(layout).filter((key) => /^[xy]axis/.test(key));
    let wide = false;
    button.addEventListener("click", () => {
      wide = !wide;
      button.textContent = wide ? "Back to the track" : "Show everything";
      const change = {};
      for (const key of axes) {
        const range = layout[key].range;
        if (wide || !range) change[`${key}.autorange`] = layout[key].range && layout[key].range[0] > layout[key].range[1] ? "reversed" : true;
        else change[`${key}.range`] = range.slice();
      }
      Plotly.relayout(plot, change);
    });
  };

  const config = {
    displaylogo: false,
    responsive: false,
    displayModeBar: TOUCH ? false : "hover",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
    showSendToCloud: false, // a client's positions stay in this file
    plotlyServerURL: "",
  };

  const drawn = [];
  const draw = async (packed) => {
    const figure = filled(packed);
    const place = document.getElementById(figure.id);
    const plot = place.querySelector(".plot");
    if (TOUCH) figure.layout.dragmode = false;
    const first = structuredClone(figure.layout);
    if (plot.clientWidth < NARROW) {
      for (const { marker } of figure.data) if (marker && marker.size) marker.size *= 0.75;
    }
    await Plotly.newPlot(plot, figure.data, sized(figure, plot.clientWidth), {
      ...config,
      toImageButtonOptions: { format: "svg", filename: figure.id },
    });
    legend(place.querySelector(".legend"), plot, figure.data);
    if (figure.plan) scale(place.querySelector(".legend"), plot);
    const button = place.querySelector(".note button");
    if (button) everything(button, plot, first);
    drawn.push({ figure, plot, width: plot.clientWidth });
  };

  const fit = (entry, width) => {
    if (width === entry.width) return;
    entry.width = width;
    const { margin, height: tall } = sized(entry.figure, width);
    Plotly.relayout(entry.plot, { width, height: tall, margin });
  };
  const fitAll = () => drawn.forEach((entry) => fit(entry, entry.plot.clientWidth));
  let waiting = 0;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(fitAll, 120);
  });
  addEventListener("beforeprint", () => {
    for (const entry of drawn) fit(entry, entry.plot.closest(".pair") ? PRINT / 2 - 12 : PRINT);
  });
  addEventListener("afterprint", fitAll);

  (async () => {
    for (const figure of page.figures) {
      await draw(figure);
      await new Promise((next) => setTimeout(next)); // let the page answer between figures
    }
    document.documentElement.dataset.ready = "true";
  })();
})();
