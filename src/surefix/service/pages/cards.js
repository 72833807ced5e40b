// One card a sensor, and one line for each input and output.

import { keyed, make, say, terms } from "./build.js";
import { known } from "./rows.js";
import { ago, clock, figure, share, size } from "./words.js";

const SIGNS = { valid: "✓", doubtful: "?", invalid: "✕" };

const begin = () => {
  const card = make("li.card");
  const head = make("h3");
  head.append(make("span.name"), make("span.quantity"));
  const judged = make("p.validity");
  judged.append(make("b.sign", "", { "aria-hidden": "true" }), make("b.word"));
  judged.append(make("span.reason"), " ", make("small"));
  card.append(head, judged, make("dl"));
  return card;
};

const fill = (card, sensor, now) => {
  card.dataset.validity = sensor.validity;
  say(card.querySelector(".name"), sensor.name);
  say(card.querySelector(".quantity"), sensor.quantity);
  say(card.querySelector(".sign"), SIGNS[sensor.validity] ?? "");
  say(card.querySelector(".word"), sensor.validity);
  say(card.querySelector(".reason"), sensor.reason);
  const judged = known(sensor.since) && sensor.validity !== "valid";
  say(card.querySelector("small"), judged ? `since ${clock(sensor.since)}` : "");
  terms(card.querySelector("dl"), [
    ["Rate", figure(sensor.rate, 2, "Hz")],
    ["Latency", figure(sensor.latency, 2, "s")],
    ["Rejected", share(sensor.rejected)],
    ["Innovation", figure(sensor.innovation, 2, "σ")],
    ["Last", known(now) && known(sensor.observed) ? ago(now - sensor.observed) : "–"],
    ["Input", sensor.input],
  ]);
};

/** Show the sensors of a record. `now` is the time that ages count to, s; null: it is not known. */
export const showSensors = (sensors, now) => {
  document.getElementById("no-sensors").hidden = sensors.length > 0;
  const list = document.getElementById("sensors");
  const key = (sensor) => `${sensor.name}\n${sensor.quantity}\n${sensor.input}`;
  keyed(list, sensors, key, begin, (card, sensor) => fill(card, sensor, now));
};

const inward = (line) => {
  const refused = line.refused ? `, ${line.refused} refused, last from ${line.refused_from}` : "";
  const how = line.ended ? "ended" : line.connected ? "open" : line.trouble || "not open";
  return [`${line.name} ← ${line.address}`, `${how}, ${size(line.size)}${refused}`];
};

const outward = (exit) => {
  const lost = exit.dropped ? `, ${exit.dropped} dropped` : "";
  const refused = exit.refused ? `, ${exit.refused} refused` : "";
  const clients = exit.address.startsWith("tcp") ? `${exit.clients} clients, ` : "";
  const trouble = exit.trouble ? `, ${exit.trouble}` : "";
  return [`→ ${exit.address}`, `${clients}${size(exit.size)}${lost}${refused}${trouble}`];
};

/** Show the inputs, the outputs and the journal of a record. */
export const showLines = (record) => {
  const journal = record.unwritten ? `${size(record.unwritten)} wait to be written` : "written";
  const lines = [...record.inputs.map(inward), ...record.outputs.map(outward)];
  lines.push(["journal", journal]);
  const blank = () => {
    const item = make("li");
    item.append(make("b"), make("span"));
    return item;
  };
  keyed(document.getElementById("lines"), lines, ([name]) => name, blank, (item, [name, text]) => {
    say(item.children[0], name);
    say(item.children[1], text);
  });
};
