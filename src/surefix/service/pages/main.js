// The dashboard: it shows what the service says, and decides nothing.

import { showAlarms, showThen } from "./alarms.js";
import { say, terms } from "./build.js";
import { showLines, showSensors } from "./cards.js";
import { ask, listen, track } from "./link.js";
import { beginPlan, drawPlan } from "./plan.js";
import { from, known, merged, unpack } from "./rows.js";
import { beginStrips, drawStrips } from "./strips.js";
import { angle, clock, figure, instant } from "./words.js";

const MOST = 4000; // rows in the page; more are asked for anew, thinned
const PACE = 1000; // ms between two drawings
const LEAST = 60; // s that the series show at least
const SETTLE = 150; // ms that the slider rests before the past is asked for

const at = (id) => document.getElementById(id);
const page = {
  role: "nobody", // who looks: viewer, operator or nobody
  tokens: false, // whether one can sign in
  signed: false, // whether one has
  record: null, // the last one heard
  heard: true, // whether the stream is heard now
  first: null, // s, oldest row that is kept
  live: [], // rows of the window that ends now
  past: null, // {moment, rows, sensors, alarms} looked at; null: live
  marks: null,
};

const span = () => Number(at("span").value);
const newest = () => page.record?.position?.time ?? page.live.at(-1)?.time ?? null;

// What is said

const showStatus = () => {
  const status = at("status");
  const { record, past } = page;
  const position = record?.position;
  let [kind, text] = ["waiting", "No position yet"];
  if (page.role === "nobody") [kind, text] = ["waiting", "Not signed in"];
  else if (!page.heard) [kind, text] = ["lost", `Not connected; last heard ${clock(record?.time)}`];
  else if (past) [kind, text] = ["past", `Looking back at ${clock(past.moment)}`];
  else if (position?.dead_reckoned) [kind, text] = ["dead", "Dead reckoning"];
  else if (position) [kind, text] = ["live", "Live"];
  status.dataset.kind = kind;
  say(status, text);
};

const shownPosition = () => {
  if (!page.past) return page.record?.position ?? null;
  const row = page.past.rows.findLast(({ clean }) => known(clean[0]));
  if (!row) return null;
  const [latitude, longitude, height] = row.geodetic;
  const { time, clean: local, sigma, velocity } = row;
  return { time, latitude, longitude, height, local, sigma, velocity };
};

const showPosition = () => {
  const position = shownPosition();
  if (!position) return terms(at("position"), [["Position", "–"]]);
  const { local, sigma, velocity } = position;
  const flat = known(velocity[0]) && known(velocity[1]);
  const course = (Math.atan2(velocity[0], velocity[1]) * 180) / Math.PI;
  const turned = flat ? `${String(Math.round((course + 360) % 360) % 360).padStart(3, "0")}°` : "–";
  const where = known(position.latitude)
    ? [["Latitude", angle(position.latitude, "NS", 2)], ["Longitude", angle(position.longitude, "EW", 3)]]
    : [["East", figure(local[0], 2, "m")], ["North", figure(local[1], 2, "m")]];
  return terms(at("position"), [
    ["Time", instant(position.time)],
    ...where,
    ["Height", figure(position.height ?? local[2], 2, "m")],
    ["σ east, north", `${figure(sigma[0], 2)}, ${figure(sigma[1], 2, "m")}`],
    ["Speed", figure(flat ? Math.hypot(velocity[0], velocity[1]) : null, 2, "m/s")],
    ["Course", turned],
  ]);
};

const showRole = () => {
  const sign = at("sign");
  say(at("role"), page.role === "nobody" ? "" : page.role);
  sign.hidden = !page.tokens;
  say(sign, page.signed ? "Sign out" : "Sign in");
};

const showRecord = () => {
  const { record } = page;
  showStatus();
  showPosition();
  if (!record) return;
  showAlarms(record.alarms, page.role);
  const then = page.past?.sensors ? page.past : null; // there once it was answered
  showThen(then?.alarms ?? null, then?.answered);
  if (then) showSensors(then.sensors, null);
  else showSensors(record.sensors, record.present);
  say(at("sensors-when"), then ? `at ${clock(then.answered)}` : "");
  showLines(record);
};

// What is drawn

let waiting = 0;
let drawn = -Infinity;
let busy = false;

const draw = async () => {
  waiting = 0;
  if (busy) return redraw();
  busy = true;
  try {
    const until = page.past ? page.past.moment : (newest() ?? span());
    const rows = page.past ? page.past.rows : page.live;
    if (!rows.length && !page.past) return;
    await drawPlan(rows, shownPosition(), page.marks);
    const since = Math.max(until - span(), Math.min(page.first ?? until, until - LEAST));
    await drawStrips(rows, since, until, page.marks);
    document.documentElement.dataset.drawn = String(rows.length);
  } finally {
    busy = false;
    drawn = performance.now();
  }
};

const redraw = (soon = false) => {
  if (waiting && !soon) return;
  clearTimeout(waiting);
  waiting = setTimeout(draw, soon ? 0 : Math.max(0, drawn + PACE - performance.now()));
};

// The past

const reload = async () => {
  const end = newest();
  if (end === null) return;
  const said = await track(end - span(), end + 3600);
  page.first = said.first;
  page.live = merged(unpack(said.rows), page.live.filter(({ time }) => time > end));
};

const showTravel = () => {
  const slider = at("travel");
  const last = newest();
  if (last === null || !known(page.first)) return;
  slider.min = String(Math.floor(page.first));
  slider.max = String(Math.ceil(last));
  if (!page.past) slider.value = slider.max;
  const moment = page.past ? page.past.moment : last;
  slider.setAttribute("aria-valuetext", page.past ? instant(moment) : "live");
  say(at("moment"), clock(moment));
  at("live").setAttribute("aria-pressed", String(!page.past));
};

let settling = 0;
const look = async (moment) => {
  const said = await track(moment - span(), moment);
  if (page.past?.moment !== moment) return; // moved on meanwhile
  const { sensors, alarms } = said;
  Object.assign(page.past, { rows: unpack(said.rows), sensors, alarms, answered: moment });
  page.first = said.first;
  showRecord();
  redraw(true);
};

const travelTo = (moment) => {
  page.past = { rows: page.live, ...page.past, moment };
  showTravel();
  showStatus();
  clearTimeout(settling);
  settling = setTimeout(() => look(moment).catch(failed), SETTLE);
};

const backToLive = () => {
  page.past = null;
  clearTimeout(settling);
  showTravel();
  showRecord();
  redraw(true);
};

// The stream

const heard = (record) => {
  const again = !page.heard || !page.record;
  page.record = record;
  page.heard = true;
  page.live = merged(page.live, unpack(record.rows));
  const end = newest();
  if (end !== null) page.live = from(page.live, end - span());
  if (again || page.live.length > MOST || !known(page.first)) {
    if (again) page.live = [];
    reload().then(() => redraw(), failed);
  }
  showRecord();
  showTravel();
  if (!page.past) redraw();
};

const lost = () => {
  page.heard = false;
  showStatus();
};

const failed = (error) => {
  if (error.status === 401) return askForToken();
  console.warn(error.message);
  return undefined;
};

// Who looks

const askForToken = () => {
  Object.assign(page, { role: "nobody", tokens: true, signed: false });
  page.record = null;
  page.live = [];
  lost();
  showRole();
  showPosition();
  at("dialog").showModal();
};

const enter = async () => {
  const { role, tokens, signed_in: signed } = await ask("/api/session");
  Object.assign(page, { role, tokens, signed });
  showRole();
  listen(heard, lost, askForToken);
};

const signIn = async (event) => {
  event.preventDefault();
  try {
    const headers = { Authorization: `Bearer ${at("token").value}` };
    await ask("/api/session", { method: "POST", headers });
    location.reload();
  } catch (error) {
    say(at("refused"), error.message);
  }
};

const signOut = async () => {
  if (!page.signed) return at("dialog").showModal();
  await ask("/api/session", { method: "DELETE" });
  return location.reload();
};

const begin = async () => {
  page.marks = await ask("/pages/marks.json");
  at("form").addEventListener("submit", signIn);
  at("sign").addEventListener("click", () => signOut().catch(failed));
  at("travel").addEventListener("input", (event) => travelTo(Number(event.target.value)));
  at("live").addEventListener("click", backToLive);
  at("span").addEventListener("change", () => {
    const done = page.past ? look(page.past.moment) : reload();
    done.then(() => redraw(true), failed);
  });
  const dark = matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", () => redraw(true));
  await beginPlan(page.marks, () => redraw(true));
  await beginStrips();
  document.documentElement.dataset.ready = "true";
  await enter();
};

begin().catch(failed);
