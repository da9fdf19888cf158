// The participant's screen: targets and pointer, the angle's display, the EMG's bar, cues, rests, consent, instructions.
"use strict";
const $ = (id) => document.getElementById(id);
const canvas = $("screen"), pen = canvas.getContext("2d");
const DEGREES = 180 / Math.PI;
const FRAME_BATCH_MS = 1000;
let told = null, drawnCue = 0, cues = [], sentAt = 0, firstFrame = null, colours = null, connected = false;

const WORDS = {
  waiting: ["Please wait", "The next part begins in a moment."],
  saving: ["Thank you", "You may relax."],
  judging: ["Thank you", "You may relax."],
  judged: ["Thank you", "You may relax."],
  rest: ["Rest", ""],
  finishing: ["That was all. Thank you!", "The session is being evaluated."],
  finished: ["That was all. Thank you!", ""],
};

function readColours() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue("--" + name).trim();
  colours = Object.fromEntries(["ink", "muted", "rule", "fitted", "heldout", "good", "wrong", "panel", "faint"].map((c) => [c, colour(c)]));
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);

function resize() {
  const scale = window.devicePixelRatio || 1;
  canvas.width = Math.round(innerWidth * scale);
  canvas.height = Math.round(innerHeight * scale);
  pen.setTransform(scale, 0, 0, scale, 0, 0);
}
addEventListener("resize", resize);

session.onText = (message) => { if (message.type === "screen") told = message; };
session.onOpen = () => { connected = true; };
session.onClose = () => { connected = false; };

// Called once a frame by frames.js.
window.drawFrame = function (time) {
  if (!colours) { readColours(); resize(); }
  if (told) {
    if (told.cue !== drawnCue) {
      drawnCue = told.cue;
      cues.push([told.cue, Math.round(time * 10) / 10]);
      $("patch").style.background = told.cue % 2 ? "#fff" : "#000";
    }
    show(told);
  }
  if (firstFrame === null) firstFrame = time;
  if (time - sentAt >= FRAME_BATCH_MS) sendFrames(time);
};

function sendFrames(time) {
  sentAt = time;
  if (frameTimes.intervals.length) {
    session.send({
      type: "frames", first: firstFrame, offset: session.offset, rtt: session.roundTrip,
      intervals: frameTimes.intervals.map((x) => Math.round(x * 10) / 10), cues: cues,
    });
  }
  frameTimes.intervals = [];
  cues = [];
  firstFrame = null;
}

function show(state) {
  pen.clearRect(0, 0, innerWidth, innerHeight);
  const reading = state.phase === "consent" || state.phase === "instructions";
  $("text").hidden = !reading;
  if (reading) showText(state);
  const asked = !state.stopped && connected && (state.phase === "running" || state.phase === "preparing");
  let words = asked || reading ? null : WORDS[state.phase];
  if (state.stopped) words = ["Stopped", "The robot lets go of you. Please wait for the operator."];
  if (!connected && state.phase !== "finished") words = ["No connection", "Please wait for the operator."];
  if (words && state.phase === "rest" && connected && !state.stopped) words = ["Rest", clock(state.left)];
  $("message").hidden = !words;
  if (words) { $("message-heading").textContent = words[0]; $("message-text").textContent = words[1]; }
  document.body.classList.toggle("still", asked);
  $("progress").textContent = state.phase === "consent" ? "" : `${state.done} of ${state.all} parts done`;
  if (asked && state.task) (state.task === "contraction" ? drawContraction : state.task === "holding" ? drawHolding : drawPointing)(state);
}

function showText(state) {
  const key = state.phase + state.text.join("\n");
  if ($("text").dataset.key === key) return;
  $("text").dataset.key = key;
  $("heading").textContent = state.phase === "consent" ? "Consent" : "What to do";
  $("yes").textContent = state.phase === "consent" ? "I agree" : "I am ready";
  $("yes").onclick = () => session.act(state.phase === "consent" ? "consent" : "ready");
  $("paragraphs").replaceChildren(...state.text.map((text) => Object.assign(document.createElement("p"), { textContent: text })));
}

function clock(seconds) {
  const whole = Math.ceil(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function toY(state) {
  const top = 0.06 * innerHeight, height = 0.86 * innerHeight, [low, high] = state.range;
  return (angle) => top + height * (1 - (angle - low) / (high - low));
}

// The pointer goes up when the joint flexes, as the forearm's line does on a screen in front of the person.
function drawPointing(state) {
  const y = toY(state), x = innerWidth / 2, size = Math.min(innerWidth, innerHeight);
  pen.strokeStyle = colours.rule;
  pen.lineWidth = 2;
  line(x, y(state.range[0]), x, y(state.range[1]));
  const radius = state.tolerance ? Math.max(Math.abs(y(0) - y(state.tolerance)), 0.02 * size) : 0.035 * size;
  const on = state.pointer !== null && Math.abs(state.pointer - state.target) <= (state.tolerance || 0.09);
  if (state.phase === "running") {
    disc(x, y(state.target), radius, colours.panel, on ? colours.good : colours.heldout, 5);
    if (state.held > 0) {
      pen.beginPath();
      pen.strokeStyle = colours.good;
      pen.lineWidth = 0.014 * size;
      pen.arc(x, y(state.target), radius + 0.016 * size, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * state.held);
      pen.stroke();
    }
  } else {
    disc(x, y(state.target), radius, "transparent", colours.faint, 3);
    word("Go to the circle", x, 0.98 * innerHeight, 0.032 * size, colours.muted);
  }
  if (state.pointer !== null) {
    pen.strokeStyle = colours.fitted;
    pen.lineWidth = 3;
    line(x - 0.16 * size, y(state.pointer), x + 0.16 * size, y(state.pointer));
    disc(x, y(state.pointer), 0.011 * size, colours.fitted, colours.fitted, 0);
  }
}

// The angle as a number and on a dial, beside the angle that is asked for.
function drawHolding(state) {
  const size = Math.min(innerWidth, innerHeight), x = innerWidth / 2, y = 0.56 * innerHeight, radius = 0.36 * size;
  const [low, high] = state.range;
  const turn = (angle) => Math.PI * (0.8 + 1.4 * Math.min(Math.max((angle - low) / (high - low), 0), 1));
  arc(x, y, radius, turn(low), turn(high), colours.rule, 0.03 * size);
  const on = state.pointer !== null && Math.abs(state.pointer - state.target) <= state.tolerance;
  arc(x, y, radius, turn(state.target - state.tolerance), turn(state.target + state.tolerance), on ? colours.good : colours.heldout, 0.03 * size);
  if (state.pointer !== null) {
    const at = turn(state.pointer);
    pen.strokeStyle = colours.fitted;
    pen.lineWidth = 0.012 * size;
    line(x + 0.72 * radius * Math.cos(at), y + 0.72 * radius * Math.sin(at), x + 1.12 * radius * Math.cos(at), y + 1.12 * radius * Math.sin(at));
  }
  word(state.pointer === null ? "–" : `${fixed(state.pointer * DEGREES, 0)}°`, x, y + 0.07 * size, 0.2 * size, colours.ink, 660);
  word(`hold ${fixed(state.target * DEGREES, 0)}°`, x, y + 0.17 * size, 0.05 * size, on ? colours.good : colours.heldout, 560);
  if (state.phase === "running") word(clock(state.left), x, y + 0.3 * size, 0.04 * size, colours.muted);
}

// A bar that follows the EMG, and the band to which it is asked.
function drawContraction(state) {
  const size = Math.min(innerWidth, innerHeight), width = 0.18 * size, x = innerWidth / 2 - width / 2;
  const bottom = 0.86 * innerHeight, height = 0.66 * innerHeight, top = 1.2;
  const y = (level) => bottom - height * Math.min(Math.max(level / top, 0), 1);
  pen.fillStyle = colours.panel;
  pen.fillRect(x, y(top), width, height);
  const [low, high] = state.target >= 1 ? [0.9, top] : [state.target - state.tolerance, state.target + state.tolerance];
  if (!state.resting && state.phase === "running") {
    pen.fillStyle = colours.heldout;
    pen.globalAlpha = 0.28;
    pen.fillRect(x - 0.25 * width, y(high), 1.5 * width, y(Math.max(low, 0)) - y(high));
    pen.globalAlpha = 1;
  }
  if (state.level !== null) {
    pen.fillStyle = !state.resting && state.level >= low && state.level <= high ? colours.good : colours.fitted;
    pen.fillRect(x, y(state.level), width, bottom - y(state.level));
    word(`${fixed(100 * state.level, 0)} %`, x + 1.4 * width, y(state.level) + 0.02 * size, 0.045 * size, colours.ink, 560, "left");
  }
  const what = state.phase !== "running" ? "Get ready" : state.resting ? "Relax" : state.target >= 1 ? `Pull as hard as you can: ${state.direction}` : `Pull to the band: ${state.direction}`;
  word(what, innerWidth / 2, 0.13 * innerHeight, 0.07 * size, colours.ink, 660);
  word(`EMG of ${state.muscles.join(", ").replaceAll("_", " ")}`, innerWidth / 2, 0.93 * innerHeight, 0.028 * size, colours.muted);
}

function line(x0, y0, x1, y1) { pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke(); }

function arc(x, y, radius, from, to, colour, width) {
  pen.beginPath();
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.arc(x, y, radius, from, to);
  pen.stroke();
}

function disc(x, y, radius, fill, stroke, width) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill !== "transparent") { pen.fillStyle = fill; pen.fill(); }
  if (width) { pen.strokeStyle = stroke; pen.lineWidth = width; pen.stroke(); }
}

function word(text, x, y, size, colour, weight = 450, align = "center") {
  pen.font = `${weight} ${size}px ${getComputedStyle(document.body).fontFamily}`;
  pen.fillStyle = colour;
  pen.textAlign = align;
  pen.fillText(text, x, y);
}

function goFull() { if (document.fullscreenElement) document.exitFullscreen(); else document.documentElement.requestFullscreen().catch(() => {}); }
$("full").onclick = goFull;
addEventListener("keydown", (event) => {
  if (event.key === "f" || event.key === "F") goFull();
  if (event.code === "Space" && document.activeElement.tagName !== "BUTTON") { event.preventDefault(); session.act("stop"); }
});
session.connect("participant");
