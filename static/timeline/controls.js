// The elements of the timeline: its track, its buttons and its lists.
import { element, t, write } from "../dom.js";
import { button, drawing, html, svg } from "../instruments/shape.js";
import { clock, locale } from "../page/words.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const EXPORTS = [["csv", "CSV table"], ["rosbag2", "ROS 2 bag"], ["mp4", "MP4 film"]];
export const OUTCOMES = [["success", "Success"], ["failure", "Failure"], ["unjudged", "Not judged"]];
/** The words of each kind of mark. @type {Record<string, string>} */
const KINDS = { stop: "Stop", clear_stop: "Stop cleared", driver: "Driver", program: "Script", step: "Motion", restore: "Continuation", contact: "Contact", limit: "Limit", episode: "Episode" };
const ICONS = { play: "M5.5 3.2v13.6L16.5 10z", pause: "M5 3.5h3.4v13H5zM11.6 3.5H15v13h-3.4z" };

/** @param {keyof typeof ICONS} name */
const icon = (name) => drawing("0 0 20 20", svg("path", { d: ICONS[name] }));

/** @param {string} name @param {string} label */
const range = (name, label) => html("input", { type: "range", class: name, min: "0", max: "1", step: "any", "aria-label": label });

/** @param {string} label @param {() => void} act @param {(Node | string)[]} content */
const titled = (label, act, ...content) => button(content.length ? content : label, act, { title: label, "aria-label": label });

/** What the buttons do. @typedef {Record<"play" | "again" | "live" | "restore" | "fold" | "save" | "verify" | "tree", () => void>} Acts */

export class Controls {
  work = html("div", { class: "work", hidden: "" });
  tree = html("section", { class: "tree", "aria-label": "Attempts", hidden: "" });
  exports = html("select", { "aria-label": "Export the selection" }, new Option("Export…", ""), ...EXPORTS.map(([name, words]) => new Option(words, name)));
  keep = html("select", { title: "Without what was rewound", "aria-label": "Keep the selection as an episode" }, new Option("Keep as episode…", ""), ...OUTCOMES.map(([name, words]) => new Option(words, name)));
  clock = html("output", { class: "clock" }, "Live");
  marks = html("div", { class: "marks" });
  begin = range("end", "Start of the selection");
  end = range("end", "End of the selection");
  now = range("now", "Moment that is shown");
  speed = html("select", { "aria-label": "Speed of playing back" }, ...SPEEDS.map((speed) => new Option(`${speed}×`, String(speed))));
  of = html("select", { "aria-label": "Recording" });
  second = html("select", { "aria-label": "Second run" });
  events = html("select", { "aria-label": "Events" });
  file = html("input", { type: "file", accept: ".mcap", hidden: "", "aria-label": "File of a recording" });
  moment = html("time", { "aria-live": "off" });
  pastWords = html("span", {}, "Shown as it was at ");
  legend = html("p", { class: "legend" }, ...Object.entries(KINDS).map(([kind, words]) => html("span", { "data-kind": kind }, html("i", { class: kind }), words)));
  #note = html("p", { role: "status" });
  #words = [this.pastWords, this.moment, html("span", {}, ", the arm is now elsewhere")];
  past = html("div", { id: "past", hidden: "" });

  /** @param {HTMLElement} box @param {Acts} acts */
  constructor(box, acts) {
    this.play = titled("Play", acts.play, icon("play"));
    this.again = titled("Run again the selected motion", acts.again, "Run again");
    this.attempts = titled("Attempts, and what they continued from", acts.tree, "Attempts");
    this.speed.value = "1";
    const back = button("Back to live", acts.live, { class: "main" });
    const restore = titled("Continue from here: the arm, the objects and the water are set back to this moment", acts.restore, "Continue from here");
    this.past.append(this.#note, restore, back);
    const fold = titled("Fold the timeline away", acts.fold, "×");
    fold.className = "fold";
    const track = html("div", { class: "track" }, this.marks, this.now, this.begin, this.end);
    const row = html("div", { class: "row" }, this.play, this.clock, this.speed, this.events, this.of, this.second,
        titled("Save selection", acts.save, "Save", html("span", {}, " selection")),
        this.exports, this.keep, this.attempts,
        this.again,
        titled("Verify the selection: simulate it again and compare every tick", acts.verify, "Verify"),
        this.legend, fold, this.file);
    // From below: the track stays where it is when the rest is shown.
    const body = html("div", { class: "body" }, track, row, this.tree, this.work);
    box.replaceChildren(body);
    new ResizeObserver(() => element("stage", HTMLElement).style.setProperty("--raise", `${box.offsetHeight - body.offsetHeight}px`)).observe(body);
  }

  /** Show or hide the note over the scene, which is empty while hidden. @param {boolean} shown */
  showPast(shown) {
    if (this.past.hidden !== shown) return;
    this.past.hidden = !shown;
    this.#note.replaceChildren(...(shown ? this.#words : []));
    // Bar, instruments and viser's panel say that they show the present.
    for (const { documentElement } of [document, element("scene", HTMLIFrameElement).contentDocument ?? document])
      documentElement.style.setProperty("--now", shown ? JSON.stringify(t("Now")) : null);
  }

  /** Show whether the recording plays. @param {boolean} plays */
  showPlaying(plays) {
    this.play.replaceChildren(icon(plays ? "pause" : "play"));
    write(this.pastWords, plays ? "Playing back " : "Shown as it was at ");
    for (const name of ["title", "aria-label"]) this.play.setAttribute(name, plays ? "Pause" : "Play");
  }
}

/** Return a time [s since the epoch] in words, with the date if it is not today. @param {number} t */
export function timeInWords(t) {
  /** @type {Intl.DateTimeFormatOptions} */
  const style = { hour: "2-digit", minute: "2-digit", second: "2-digit" };
  const time = new Date(1000 * t);
  const today = time.toDateString() === new Date().toDateString();
  return today ? clock(time, style) : time.toLocaleString(locale, { day: "numeric", month: "short", ...style });
}
