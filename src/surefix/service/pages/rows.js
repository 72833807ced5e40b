// Fixes and the track, in the order of time; a window of them, bounded.

const GAP = 10; // median steps, after which a line is not drawn on

/** One object a row, from the columns of a record. */
export const unpack = (columns) =>
  columns.number.map((number, i) => ({
    number,
    time: columns.time[i],
    sensor: columns.sensors[columns.sensor[i]] ?? "",
    raw: columns.raw[i],
    clean: columns.clean[i],
    geodetic: columns.geodetic[i],
    velocity: columns.velocity[i],
    sigma: columns.sigma[i],
    innovation: columns.innovation[i],
    verdict: columns.verdict[i],
    reason: columns.reason[i],
  }));

/** Rows of both, each once, by number. */
export const merged = (rows, more) => {
  const last = rows.length ? rows[rows.length - 1].number : -1;
  return [...rows, ...more.filter((row) => row.number > last)];
};

/** Rows from a time on, in s. */
export const from = (rows, since) => {
  const first = rows.findIndex((row) => row.time >= since);
  return first < 0 ? [] : rows.slice(first);
};

/** Rows with a null where a line must not be drawn on. */
export const gapped = (rows) => {
  const steps = [];
  for (let i = 1; i < rows.length; i++) {
    const step = rows[i].time - rows[i - 1].time;
    if (step > 0) steps.push(step);
  }
  steps.sort((a, b) => a - b);
  const most = GAP * (steps[steps.length >> 1] ?? Infinity);
  return rows.flatMap((row, i) =>
    i && row.time - rows[i - 1].time > most ? [null, row] : [row],
  );
};

/** Whether a number is there. */
export const known = (value) => value !== null && value !== undefined && Number.isFinite(value);
