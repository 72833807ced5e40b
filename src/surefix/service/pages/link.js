// What the service says: questions and answers, and the stream of records.

const SILENT = 4000; // ms; the service speaks at least once a second
const AGAIN = [500, 5000]; // ms between attempts to connect

/** An answer that is not what was asked for; `status` is that of HTTP, 0 without an answer. */
export class Refused extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
  }
}

/** Ask for a path; gives what the answer's JSON says. */
export const ask = async (path, options = {}) => {
  let answer;
  try {
    answer = await fetch(path, { credentials: "same-origin", ...options });
  } catch {
    throw new Refused(0, "The service does not answer.");
  }
  const said = answer.status === 204 ? {} : await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refused(answer.status, String(said.detail ?? answer.statusText));
  return said;
};

/** The past from `since` until `until`, in s. */
export const track = (since, until, most = 2000) =>
  ask(`/api/track?since=${since}&until=${until}&most=${most}`);

/**
 * Hear the records for ever; connect again when the stream breaks or falls silent.
 * `heard(record)`, `lost()`: no longer heard; `closed()`: one has to sign in.
 */
export const listen = (heard, lost, closed) => {
  let wait = AGAIN[0];
  let socket = null;
  let silence = 0;
  const connect = () => {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const mine = new WebSocket(`${scheme}://${location.host}/api/live`);
    socket = mine;
    const broken = async () => {
      if (socket !== mine) return;
      socket = null;
      clearTimeout(silence);
      mine.close();
      lost();
      const refused = await ask("/api/session").then(() => null, (error) => error);
      if (refused && refused.status === 401) return closed();
      setTimeout(connect, wait);
      wait = Math.min(2 * wait, AGAIN[1]);
    };
    const alive = () => {
      clearTimeout(silence);
      silence = setTimeout(broken, SILENT);
    };
    alive();
    mine.addEventListener("message", ({ data }) => {
      if (socket !== mine) return;
      alive();
      wait = AGAIN[0];
      heard(JSON.parse(data));
    });
    mine.addEventListener("close", broken);
  };
  connect();
};
