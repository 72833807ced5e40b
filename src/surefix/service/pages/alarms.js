// Alarms: what is wrong, and the button that tells the service it was seen.

import { keyed, make, say } from "./build.js";
import { ask } from "./link.js";
import { known } from "./rows.js";
import { clock } from "./words.js";

const SIGNS = { alarm: "▲", warning: "◆", caution: "●" };

const acknowledge = async (number, button) => {
  const note = document.getElementById("alarm-note");
  if (button.getAttribute("aria-busy") === "true") return;
  button.setAttribute("aria-busy", "true");
  try {
    await ask(`/api/alarms/${number}/acknowledge`, { method: "POST" });
    say(note, "");
  } catch (error) {
    say(note, error.message);
  }
  button.removeAttribute("aria-busy");
};

const blank = () => {
  const item = make("li.alarm");
  const words = make("div");
  words.append(make("b.priority"), make("span.text"), make("small"));
  item.append(make("span.sign", "", { "aria-hidden": "true" }), words);
  return item;
};

const begin = (alarm) => {
  const item = blank();
  const button = make("button", "Acknowledge", { type: "button" });
  button.addEventListener("click", () => acknowledge(alarm.number, button));
  item.append(button);
  return item;
};

const describe = (item, alarm) => {
  const seen = known(alarm.seen);
  const gone = known(alarm.gone);
  item.dataset.priority = alarm.priority;
  item.dataset.seen = String(seen);
  say(item.querySelector(".sign"), SIGNS[alarm.priority] ?? "");
  say(item.querySelector(".priority"), alarm.priority);
  say(item.querySelector(".text"), `${alarm.concerns}: ${alarm.text}`);
  const ended = gone ? `over since ${clock(alarm.gone)}` : "lasts";
  const by = seen ? `, acknowledged ${clock(alarm.seen)} by ${alarm.by}` : "";
  say(item.querySelector("small"), `since ${clock(alarm.since)}, ${ended}${by}`);
};

const fill = (item, alarm, role) => {
  describe(item, alarm);
  const button = item.querySelector("button");
  button.setAttribute("aria-label", `Acknowledge ${alarm.concerns}: ${alarm.text}`);
  button.title = role === "operator" ? "" : "Only operators may";
  button.disabled = role !== "operator";
  button.hidden = known(alarm.seen);
};

/** Show the alarms of a record; `role` is who looks. */
export const showAlarms = (alarms, role) => {
  const open = alarms.filter((alarm) => !known(alarm.seen)).length;
  document.getElementById("no-alarms").hidden = alarms.length > 0;
  const section = document.getElementById("alarms");
  section.dataset.open = String(open);
  document.title = open ? `(${open}) surefix live` : "surefix live";
  const list = document.getElementById("alarm-list");
  const focused = list.contains(document.activeElement);
  keyed(list, alarms, (alarm) => alarm.number, begin, (item, alarm) => fill(item, alarm, role));
  const still = document.activeElement;
  if (!focused || (list.contains(still) && still.checkVisibility())) return;
  const next = [...list.querySelectorAll("button:enabled")].find((button) => !button.hidden);
  (next ?? section).focus();
};

/** Show which alarms there were at a moment that is looked back to, s; null: none is. */
export const showThen = (alarms, moment) => {
  document.getElementById("then").hidden = alarms === null;
  if (alarms === null) return;
  say(document.getElementById("then-when"), clock(moment));
  document.getElementById("no-then").hidden = alarms.length > 0;
  keyed(document.getElementById("then-list"), alarms, (alarm) => alarm.number, blank, describe);
};
