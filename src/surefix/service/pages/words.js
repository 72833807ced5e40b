// Figures and times as they are read.

import { known } from "./rows.js";

const CALENDAR = 1e8; // s; smaller times have no date

/** Whether a time has a date. */
export const dated = (time) => known(time) && Math.abs(time) >= CALENDAR;

/** Time of day, UTC, or seconds. */
export const clock = (time) => {
  if (!known(time)) return "–";
  if (!dated(time)) return `${time.toFixed(1)} s`;
  return new Date(time * 1000).toISOString().slice(11, 19);
};

/** Day and time of day, UTC. */
export const instant = (time) => {
  if (!dated(time)) return clock(time);
  return `${new Date(time * 1000).toISOString().slice(0, 19).replace("T", " ")} UTC`;
};

/** A time on an axis. */
export const place = (time) => (dated(time) ? time * 1000 : time);

/** A number with its unit; a dash where it is missing. */
export const figure = (value, digits, unit = "") =>
  known(value) ? `${value.toFixed(digits).replace("-", "−")}${unit && ` ${unit}`}` : "–";

/** A share in per cent. */
export const share = (value) => figure(known(value) ? 100 * value : null, 1, "%");

/** How long ago, in s, min or h. */
export const ago = (seconds) => {
  if (!known(seconds)) return "–";
  const s = Math.max(0, seconds);
  if (s < 90) return `${s.toFixed(s < 10 ? 1 : 0)} s ago`;
  return s < 5400 ? `${Math.round(s / 60)} min ago` : `${(s / 3600).toFixed(1)} h ago`;
};

/** Degrees and minutes, with the side. */
export const angle = (value, sides, width) => {
  if (!known(value)) return "–";
  const minutes = Math.round(Math.abs(value) * 600000); // of 1e-4
  const whole = String(Math.floor(minutes / 600000)).padStart(width, "0");
  const rest = ((minutes % 600000) / 10000).toFixed(4).padStart(7, "0");
  return `${whole}° ${rest}′ ${sides[value < 0 ? 1 : 0]}`;
};

/** Bytes. */
export const size = (bytes) => {
  if (bytes < 1e3) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
};

/** Text that Plotly must not take for markup. */
export const plain = (text) =>
  text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
