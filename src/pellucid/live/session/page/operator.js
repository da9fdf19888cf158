// The operator's page: what comes next, what is measured, what is wrong, and the stop.
"use strict";
const $ = (id) => document.getElementById(id);
const DEGREES = 180 / Math.PI, WINDOW_S = 10, CAPACITY = 26000, COLUMNS = 500, DRAW_INTERVAL_MS = 125;
const ADVICE = {
  consent: "The participant reads the consent and agrees on their page.",
  instructions: "The participant reads what to do and says when they are ready.",
  preparing: "The controller changes, and the participant moves to the first angle.",
  running: "The trial runs.", saving: "The recording is being completed.", judging: "The recording is being checked.",
  finishing: "The session is being evaluated: this takes a while.", finished: "The session is over.",
};
let state = null, colours = {}, charts = [], dragging = 0;

const element = (tag, text = "", className = "") => Object.assign(document.createElement(tag), { textContent: text, className: className });
const number = (value, digits = 2) => (value === null || value === undefined ? "–" : fixed(value, digits));
const words = (name) => name.replace(/^emg\./, "").replaceAll("_", " ");

// Samples: one growing store for the robot's channels, one for the EMG's.
class Store {
  constructor() { this.n = 0; this.dropped = 0; this.time = new Float64Array(CAPACITY); this.values = {}; }
  take(time, names, values) {
    const n = time.length;
    if (n > CAPACITY / 2) return;
    if (this.n + n > CAPACITY) {
      const keep = Math.min(this.n, CAPACITY / 2);
      for (const each of [this.time, ...Object.values(this.values)]) each.copyWithin(0, this.n - keep, this.n);
      this.dropped += this.n - keep;
      this.n = keep;
    }
    this.time.set(time, this.n);
    names.forEach((name, i) => {
      this.values[name] ??= new Float32Array(CAPACITY);
      this.values[name].set(values.subarray(i * n, (i + 1) * n), this.n);
    });
    this.n += n;
  }
  // What lies in the window before the newest sample, as the smallest and the largest value of each of COLUMNS stretches:
  // times from -WINDOW_S to 0, and each channel times its factor.
  shown(lines) {
    const times = [], columns = lines.map(() => []);
    if (!this.n) return [times, ...columns];
    const end = this.time[this.n - 1];
    let first = this.n - 1;
    while (first > 0 && end - this.time[first - 1] <= WINDOW_S) first--;
    const step = Math.max(1, Math.ceil((this.n - first) / COLUMNS));
    // Stretches begin at multiples of their length, so that what is drawn does not flicker.
    for (let from = first - ((first + this.dropped) % step); from < this.n; from += step) {
      const to = Math.min(from + step, this.n);
      if (from < first) continue;
      times.push(this.time[from] - end, this.time[to - 1] - end);
      lines.forEach((line, i) => {
        const values = this.values[line.name];
        let low = Infinity, high = -Infinity;
        for (let j = from; values && j < to; j++) {
          const value = values[j];
          if (value < low) low = value;
          if (value > high) high = value;
        }
        if (low > high) columns[i].push(null, null);
        else columns[i].push(low * line.factor + line.shift, high * line.factor + line.shift);
      });
    }
    return [times, ...columns];
  }
}
const stores = [new Store(), new Store()];

session.onSamples = (buffer) => {
  const [kind, n, k, length] = new Uint32Array(buffer, 0, 4);
  const names = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 16, length)));
  const time = new Float64Array(buffer, 16 + length, n), values = new Float32Array(buffer, 16 + length + 8 * n, n * k);
  stores[kind].take(time, names, values);
  if (kind === 1 && !charts.some((chart) => chart.kind === 1)) addEmgChart(names);
};

function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ink", "muted", "rule", "measured", "fitted", "heldout", "good", "wrong", "directional", "load", "stribeck", "combined", "root", "symmetric"])
    colours[name] = style.getPropertyValue("--" + name).trim();
}

function addChart(kind, title, unit, lines, height, values) {
  const box = element("section", "", "trace"), heading = element("h2", `${title} [${unit}]`);
  for (const line of lines.filter((each) => each.words)) {
    const key = element("span", line.words, "key"), dash = element("i");
    dash.style.background = colours[line.colour];
    key.prepend(dash);
    heading.append(key);
  }
  box.append(heading);
  $("traces").append(box);
  const axis = { stroke: colours.muted, grid: { stroke: colours.rule, width: 1 }, ticks: { show: false }, font: "11px system-ui", size: 46 };
  const chart = new uPlot({
    width: box.clientWidth, height: height, legend: { show: false }, cursor: { show: false }, pxAlign: 0,
    scales: { x: { time: false, range: [-WINDOW_S, 0] }, y: values ? { range: values } : { range: (u, low, high) => spread(low, high) } },
    axes: [{ ...axis, size: 22 }, values ? { ...axis, values: () => [], size: 46 } : axis],
    series: [{}, ...lines.map((line) => ({ stroke: colours[line.colour], width: 1.3, dash: line.dash, points: { show: false }, spanGaps: false, alpha: line.isBound ? 0.45 : 1 }))],
  }, [[], ...lines.map(() => [])], box);
  charts.push({ kind: kind, chart: chart, lines: lines, box: box });
}

function spread(low, high) {
  if (low === null || high === null) return [-1, 1];
  const middle = (low + high) / 2, half = Math.max((high - low) / 2, 0.05 * Math.abs(middle), 0.5) * 1.1;
  return [middle - half, middle + half];
}

function buildCharts() {
  readColours();
  const line = (name, text, colour, factor = 1, dash) => ({ name: name, words: text, colour: colour, factor: factor, shift: 0, dash: dash });
  const bound = (name) => ({ ...line(name, "", "good"), isBound: true }); // an end of the interval, without a key
  addChart(0, "Angle", "°", [line("target", "target", "heldout", DEGREES, [6, 4]), line("limb", "limb", "good", DEGREES), line("position", "robot", "fitted", DEGREES)], 150);
  addChart(0, "Velocity", "°/s", [line("velocity", "measured", "fitted", DEGREES)], 96);
  addChart(0, "Torque", "N·m", [line("torque", "command", "ink"), line("drive", "drive", "symmetric", 1, [4, 3]), line("interaction", "on the person", "heldout"), line("estimate", "estimated from EMG, with 90 %", "good"), bound("estimate_low"), bound("estimate_high")], 150);
  addChart(0, "Delay of a cycle", "ms", [line("lateness", "", "measured", 1e3)], 84);
}

// Eight channels above one another, each with its own colour; a step is the largest of them.
function addEmgChart(names) {
  const palette = ["fitted", "heldout", "good", "load", "directional", "stribeck", "combined", "root"];
  const lines = names.map((name, i) => ({ name: name, words: words(name), colour: palette[i % palette.length], factor: 1, shift: 0 }));
  addChart(1, "EMG", "mV, one above another", lines, 40 + 30 * names.length, [-0.6, names.length - 0.4]);
}

function drawCharts() {
  for (const each of charts) {
    if (each.kind === 1) {
      let largest = 1e-5;
      for (const line of each.lines) {
        const values = stores[1].values[line.name];
        for (let i = Math.max(0, stores[1].n - 10000); values && i < stores[1].n; i += 7) largest = Math.max(largest, Math.abs(values[i]));
      }
      each.lines.forEach((line, i) => { line.factor = 0.5 / largest; line.shift = each.lines.length - 1 - i; });
    }
    each.chart.setData(stores[each.kind].shown(each.lines));
  }
}

addEventListener("resize", () => { for (const each of charts) each.chart.setSize({ width: each.box.clientWidth, height: each.chart.height }); });

session.onText = (told) => {
  if (told.type === "state") { state = told; showState(); }
  if (told.type === "plan") showPlan(told.rows);
  if (told.type === "health") showHealth(told);
  if (told.type === "refused") refuse(told.why);
};
session.onClose = () => {
  const over = state && state.phase === "finished";
  $("kicker").textContent = over ? "The session is over and its program has ended. This page can be closed." : "No connection to the session. Switch off the robot's power.";
  if (over) $("report-line").hidden = true;
};

function refuse(why) {
  $("refused").textContent = why;
  $("refused").hidden = false;
  clearTimeout(refuse.timer);
  refuse.timer = setTimeout(() => { $("refused").hidden = true; }, 5000);
}

function showState() {
  const phase = state.phase, trial = state.trial, engine = state.engine, stopped = state.stopped;
  $("kicker").textContent = `${state.study} · ${state.participant} · ${words(state.device)} · ${clock(state.time)}`;
  $("headline").textContent = phase === "finished" ? "The session is over" : phase === "finishing" ? "Evaluating the session" : trial ? `Trial ${state.done + 1} of ${state.of}: ${words(trial.task)}, ${trial.condition}` : "";
  const lost = engine.state.is_lost;
  const lamp = stopped || lost ? "wrong" : engine.state.in_force ? "good" : "warning";
  const why = engine.state.needs_reset && engine.fault !== engine.state.name ? `: ${words(engine.fault || "by hand")}` : engine.state.in_force ? `: ${words(engine.condition)}` : "";
  $("robot").firstChild.className = "lamp " + lamp;
  $("robot").lastChild.textContent = (stopped && !engine.state.needs_reset && !lost ? "stopped: " : "") + engine.state.words + why;
  $("reset").hidden = !stopped;
  $("advice").textContent = lost ? "The engine does not respond. Switch off the robot's power." : state.recorder ? `Recording is not possible: the recorder ${state.recorder}.` : phase === "rest" ? `Rest for ${clock(state.rest)}.` : phase === "judged" ? judgedWords() : phase === "waiting" ? (state.missing_streams.length ? `Not received: ${state.missing_streams.join(", ")}.` : "Ready for the next trial.") : ADVICE[phase];
  for (const [id, when] of [["start", phase === "waiting"], ["accept", phase === "judged"], ["repeat", phase === "judged"], ["skip_rest", phase === "rest"], ["end_trial", phase === "running" || phase === "preparing"]]) $(id).hidden = !when;
  const again = phase === "judged" && state.judged && state.judged.reason !== "";
  $("accept").className = again ? "" : "main";
  $("repeat").className = again ? "main" : "";
  $("trial-bar").style.width = `${100 * state.progress}%`;
  $("plan-bar").style.width = `${(100 * state.done) / Math.max(state.of, 1)}%`;
  $("plan-count").textContent = `${state.done} of ${state.of} trials`;
  list("judged", phase === "judged" && state.judged ? [...(state.judged.reason ? [["wrong", state.judged.reason]] : [["good", `Checked in ${number(state.judged.seconds)} s.`]]), ...state.judged.faults.filter((f) => f.text !== state.judged.reason).map((f) => [f.severity === "refuse" ? "wrong" : f.severity === "warn" ? "warning" : "note", f.text])] : []);
  $("slider-panel").hidden = !state.holding;
  if (performance.now() - dragging > 1500) $("torque").value = state.slider.value;
  $("torque").min = -state.slider.limit;
  $("torque").max = state.slider.limit;
  $("torque-low").textContent = `${number(-state.slider.limit, 0)} N·m`;
  $("torque-high").textContent = `${number(state.slider.limit, 0)} N·m`;
  $("torque-now").textContent = `${number(state.slider.value, 1)} N·m`;
  const operators = state.pages.operator > 1 ? ` ${state.pages.operator} operator's pages are open: each of them controls the session.` : "";
  $("pages").textContent = (state.pages.participant ? "The participant's page is open." : "The participant's page is not open.") + operators;
  $("finish").disabled = !["waiting", "rest", "instructions"].includes(phase);
  $("report-line").hidden = !state.report;
  list("notes", state.notes.map((note) => ["note", note]));
  list("faults", state.faults.length ? state.faults.slice().reverse().map((f) => ["warning", `${clock(f.time)}  ${f.text}`]) : [["good", "none"]]);
  showFigures();
  showLevels();
  showIndices();
}

function judgedWords() {
  if (!state.judged) return "";
  if (state.judged.reason) return "This trial will not be used as it is. Repeat it, for the reason below.";
  const by = state.judged.used_by;
  return by.length ? `This trial will be used by ${by.join(" and ")}.` : "No command of this study uses this trial.";
}

function list(id, rows) {
  const key = JSON.stringify(rows);
  if ($(id).dataset.key === key) return;
  $(id).dataset.key = key;
  $(id).replaceChildren(...rows.map(([kind, text]) => element("li", text, kind)));
}

function showFigures() {
  const now = state.now, engine = state.engine, estimate = state.estimate;
  const rows = [
    ["Angle", now.pointer === null ? "–" : number(now.pointer * DEGREES, 1), "°", engine.position_limits.length === 2 && engine.position_limits[0] !== null ? `limits ${number(engine.position_limits[0] * DEGREES, 0)}° to ${number(engine.position_limits[1] * DEGREES, 0)}°` : "no limits known"],
    ["Command", number(now.torque, 1), "N·m", engine.effort_limit === null ? "no limit known" : `limit ${number(engine.effort_limit, 1)} N·m`],
    ["On the person", number(now.interaction, 1), "N·m", "interaction, measured"],
    ["Estimated from EMG", estimate ? number(estimate.torque, 1) : "–", estimate ? `± ${number(estimate.half_width, 1)} N·m` : "", estimate ? (estimateFault() || `90 %; error ${number(estimate.error, 1)}, of the mean ${number(estimate.error_of_mean, 1)}`) : withoutEstimate()],
  ];
  $("figures").replaceChildren(...rows.map(([what, figure, unit, more]) => {
    const box = element("div"), value = element("span", figure + " ", "figure");
    value.append(element("small", unit));
    box.append(element("span", what, "what"), value, element("span", more, "more"));
    return box;
  }));
}

function estimateFault() {
  const changed = state.changed_channels.map(words).join(", ");
  return [state.estimate_fault, changed && `changed: ${changed}`].filter(Boolean).join("; ");
}

function withoutEstimate() {
  const [error, ofMean] = state.estimate_errors;
  if (error === null) return "after two trials with EMG";
  return state.is_estimate_useful ? estimateFault() || "a sample is missing" : `not shown: error ${number(error, 1)} N·m, of the mean ${number(ofMean, 1)}`;
}

function showLevels() {
  const rows = Object.entries(state.levels);
  $("levels").replaceChildren(...(rows.length ? rows.map(([muscle, level]) => {
    const row = element("div", "", "row"), bar = element("div", "", "bar"), fill = element("div");
    fill.style.width = `${Math.min(100 * level, 100)}%`;
    bar.append(fill);
    row.append(element("span", words(muscle)), bar, element("span", `${fixed(100 * level, 0)} %`));
    return row;
  }) : [element("p", "No EMG yet.", "muted")]));
}

function showPlan(rows) {
  $("plan").replaceChildren(...rows.map((row) => {
    const item = element("li", "", row.state);
    item.append(element("span", row.number), element("span", words(row.task) + (row.angle === null ? "" : ` ${fixed(row.angle * DEGREES, 0)}°`)), element("span", row.condition));
    return item;
  }));
  const now = $("plan").querySelector(".now");
  if (now) $("plan").scrollTop = now.offsetTop - $("plan").offsetTop - 60;
}

function showIndices() {
  $("indices-panel").hidden = !state.indices.length;
  if (state.indices.length) {
    const conditions = [...new Set(state.indices.flatMap((index) => Object.keys(index.values)))];
    const head = element("tr"), body = state.indices.map((index) => {
      const row = element("tr");
      row.append(element("td", `${index.words} [${index.unit}]`), ...conditions.map((c) => element("td", c in index.values ? number(index.values[c]) : "–", "n")));
      return row;
    });
    head.append(element("th", ""), ...conditions.map((c) => element("th", c, "n")));
    $("indices").replaceChildren(head, ...body);
  }
  $("verdicts-panel").hidden = !state.verdicts.length;
  const kinds = { yes: "good", no: "wrong", "cannot say": "note" };
  list("verdicts", state.verdicts.map((v) => [kinds[v.verdict], v.said]));
}

function showHealth(health) {
  const largest = Math.max(...health.counts, 1);
  $("histogram").replaceChildren(...health.counts.map((count, i) => {
    const bar = element("div", "", health.edges[i] >= 1e-3 ? "late" : "");
    // The square root shows single late cycles beside thousands of punctual ones.
    bar.style.height = `${100 * Math.sqrt(count / largest)}%`;
    const end = i + 1 < health.edges.length ? `to ${time(health.edges[i + 1])}` : "or more";
    bar.title = `${time(health.edges[i])} ${end}: ${count}`;
    return bar;
  }));
  $("histogram-start").textContent = health.edges.length ? time(health.edges[0]) : "";
  $("histogram-end").textContent = health.edges.length ? `${time(health.edges[health.edges.length - 1])} or more` : "";
  const rights = health.fifo && health.locked ? "The engine has real-time priority and locked memory." : `The engine lacks ${[health.fifo ? "" : "real-time priority", health.locked ? "" : "locked memory"].filter(Boolean).join(" and ")}${health.why_not ? `: ${health.why_not}` : ""}.`;
  $("cycles").textContent = `${health.late} of ${health.cycles} cycles late, worst ${health.worst === null ? "–" : (1e3 * health.worst).toFixed(2)} ms, 99 % within ${health.p99 === null ? "–" : (1e6 * health.p99).toFixed(0)} µs. ${rights}`;
  $("clocks").replaceChildren(...Object.entries(health.clocks).map(([name, c]) => {
    const row = element("tr");
    row.append(element("td", name + (c.jumps ? `, ${c.jumps} jumps` : "") + (c.batches ? `, ${c.batches} batches` : "")), element("td", c.offset === null ? "–" : `${fixed(1e3 * c.offset, 2)} ms`, "n"), element("td", c.drift === null ? "–" : `${fixed(1e6 * c.drift, 0)} ppm`, "n"), element("td", c.lost === null ? "–" : c.lost, "n"));
    return row;
  }));
}

function time(seconds) { return seconds < 1e-3 ? `${(1e6 * seconds).toFixed(0)} µs` : `${(1e3 * seconds).toFixed(1)} ms`; }

function clock(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

for (const id of ["start", "accept", "repeat", "skip_rest", "end_trial", "finish", "stop", "reset"]) $(id).onclick = () => { session.act(id); $(id).blur(); };
$("torque").oninput = () => { dragging = performance.now(); session.act("torque", Number($("torque").value)); };
addEventListener("keydown", (event) => { if (event.code === "Space") { event.preventDefault(); session.act("stop"); } }, true);
$("participant-link").href = `/participant?token=${encodeURIComponent(session.token)}`;
$("report").href = `/report?token=${encodeURIComponent(session.token)}`;
buildCharts();
setInterval(drawCharts, DRAW_INTERVAL_MS);
session.connect("operator");
// The lease: a law keeps its power only while this page renews it.
setInterval(() => session.send({ type: "alive" }), 100);
