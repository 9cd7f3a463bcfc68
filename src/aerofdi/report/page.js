// Draws the flights of this page: curves on canvases with one common time window a flight. Data: see report/page.py.
(() => {
"use strict";
const LEFT = 84, RIGHT = 14, HEIGHT = 118, ROW = 17, NONE = -32768;
const COLOURS = ["1", "2", "3", "4", "5", "6", "7", "8"];
const WASH = { trained: 0.12, unjudged: 0.22 };
const DASHED = { reference: [4, 3], truth: [6, 3] };
let theme = null;

const colour = (name) => {
  if (!theme) { theme = {}; }
  if (!(name in theme)) {
    const key = COLOURS.includes(name) || /^\d+$/.test(name) ? "c" + (((+name - 1) % 8) + 1) : name;
    theme[name] = getComputedStyle(document.documentElement).getPropertyValue("--" + key).trim();
  }
  return theme[name];
};
const make = (tag, parent, cls, text) => {
  const e = document.createElement(tag);
  if (cls) e.className = cls;
  if (text !== undefined) e.textContent = text;
  if (parent) parent.appendChild(e);
  return e;
};
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const curve = (trace, clocks) => {
  const back = (text) => Float32Array.from(new Int16Array(bytes(text)), (q) => (q === NONE ? NaN : trace.zero + trace.unit * q));
  const low = back(trace.low);
  return { ...trace, t: clocks[trace.clock], low, high: trace.high ? back(trace.high) : low, shown: true };
};
// First index with t[i] >= x.
const find = (t, x) => { let a = 0, b = t.length; while (a < b) { const m = (a + b) >> 1; if (t[m] < x) a = m + 1; else b = m; } return a; };
const niceStep = (span, count) => {
  const raw = span / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(raw)), f = raw / power;
  return (f < 1.5 ? 1 : f < 3.5 ? 2 : f < 7.5 ? 5 : 10) * power;
};
const ticks = (a, b, count) => {
  const step = niceStep(b - a, count), out = [];
  for (let k = Math.ceil(a / step - 1e-9); k * step <= b + 1e-9 * step; k++) out.push(k * step);
  return [out, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
};
const say = (x, unit) => (Number.isFinite(x) ? x.toFixed(Math.abs(x) < 9.95 ? 2 : Math.abs(x) < 99.5 ? 1 : 0) + (unit ? " " + unit : "") : "–");

function prepare(canvas, height) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth || 800;
  canvas.style.height = height + "px";
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, width, height);
  g.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  return [g, width];
}

class Flight {
  constructor(section, data) {
    Object.assign(this, { section, data, a: data.t0, b: data.t1, cursor: NaN, ready: false, pending: false });
    this.figures = section.querySelector(".figures");
  }
  open() {
    if (this.ready) return;
    this.ready = true;
    const clocks = this.data.clocks.map((c) => Float64Array.from(new Float32Array(bytes(c)), (t) => t + this.data.t0));
    const nav = make("div", this.figures, "navigator");
    this.tools(nav);
    this.overview = make("canvas", nav);
    this.panels = this.data.panels.map((p) => this.panel(p, clocks));
    this.steer(this.overview, true);
    if (this.data.track) this.track = this.data.track.map((x) => curve(x, clocks));
    this.shades = [].concat(...this.data.rows.filter((r) => r.name === "use").map((r) => r.stretches)).filter((s) => s[2] in WASH);
    this.draw();
  }
  tools(nav) {
    const bar = make("div", nav, "tools");
    const button = (text, a, b) => { make("button", bar, "", text).onclick = () => this.window(a, b); };
    button("Whole flight", this.data.t0, this.data.t1);
    const alarms = this.data.marks.filter((m) => m.kind === "alarm");
    if (alarms.length) button("Around the alarm", alarms[0].t - 8, alarms[0].t + 12);
    const used = this.data.rows.filter((r) => r.name === "use").flatMap((r) => r.stretches.filter((s) => s[2] === "judged"));
    if (used.length) button("Judged part", used[0][0], used[used.length - 1][1]);
    if (alarms.length) make("span", bar, "mark", "alarm");
    if (this.data.marks.length > alarms.length) make("span", bar, "mark truth", "truth");
    make("span", bar, "hint", "drag: zoom, shift+drag or arrows: move, ctrl+wheel: zoom, double click: whole flight");
    this.at = make("span", bar, "at", "");
  }
  panel(p, clocks) {
    const box = make("div", this.figures, "panel"), head = make("div", box);
    make("b", head, "", p.title);
    if (p.unit) make("span", head, "unit", p.unit);
    const panel = { ...p, traces: p.traces.map((t) => curve(t, clocks)) };
    for (const t of panel.traces) {
      const key = make("button", head, "key" + (t.role in DASHED ? " dashed" : t.role === "band" ? " wash" : ""), t.name);
      key.style.setProperty("--k", `var(--${/^\d+$/.test(t.role) ? "c" + (((+t.role - 1) % 8) + 1) : t.role})`);
      t.value = make("output", key);
      key.onclick = () => { t.shown = !t.shown; key.classList.toggle("off", !t.shown); this.draw(); };
    }
    if (p.note) make("span", head, "note", p.note);
    panel.canvas = make("canvas", box);
    panel.canvas.tabIndex = 0;
    panel.canvas.setAttribute("role", "img");
    panel.canvas.setAttribute("aria-label", p.title + ": " + p.traces.map((t) => t.name).join(", "));
    this.steer(panel.canvas, false);
    return panel;
  }
  window(a, b) {
    const { t0, t1 } = this.data, least = Math.min(0.2, t1 - t0);
    let w = Math.min(Math.max(b - a, least), t1 - t0);
    a = Math.min(Math.max(a, t0), t1 - w);
    this.a = a; this.b = a + w;
    this.draw();
  }
  draw() {
    if (!this.ready || this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }
  paint() {
    this.paintOverview();
    this.panels.forEach((p, i) => this.paintPanel(p, i === this.panels.length - 1));
    if (this.track) this.paintTrack();
    this.at.textContent = Number.isFinite(this.cursor) ? this.cursor.toFixed(2) + " s" : `${this.a.toFixed(1)} – ${this.b.toFixed(1)} s`;
  }
  // Time <-> pixels; the overview always shows the whole flight.
  scale(width, whole) {
    const a = whole ? this.data.t0 : this.a, b = whole ? this.data.t1 : this.b, w = width - LEFT - RIGHT;
    return { a, b, x: (t) => LEFT + ((t - a) / (b - a)) * w, t: (x) => a + ((x - LEFT) / w) * (b - a) };
  }
  timeAxis(g, s, width, top, bottom, labels) {
    const [at, places] = ticks(s.a, s.b, width / 110);
    for (const t of at) {
      g.strokeStyle = colour("grid"); g.lineWidth = 1;
      g.beginPath(); g.moveTo(s.x(t), top); g.lineTo(s.x(t), bottom); g.stroke();
      if (labels) { g.fillStyle = colour("soft"); g.textAlign = "center"; g.textBaseline = "top"; g.fillText(t.toFixed(places) + " s", s.x(t), bottom + 4); }
    }
  }
  paintOverview() {
    const rows = this.data.rows, bottom = rows.length * (ROW + 3) + 2;
    const [g, width] = prepare(this.overview, bottom + 20), s = this.scale(width, true);
    this.timeAxis(g, s, width, 0, bottom, true);
    rows.forEach((row, i) => {
      const y = i * (ROW + 3) + 1;
      g.fillStyle = colour("soft"); g.textAlign = "right"; g.textBaseline = "middle";
      g.fillText(row.name.length > 14 ? row.name.slice(0, 13) + "…" : row.name, LEFT - 6, y + ROW / 2);
      for (const [a, b, state, text] of row.stretches) {
        const x = s.x(a), w = Math.max(s.x(b) - x, 1);
        g.fillStyle = colour(state); g.fillRect(x, y, w > 3 ? w - 1 : w, ROW);
        if (w > 34) {
          g.save(); g.beginPath(); g.rect(x, y, w - 4, ROW); g.clip();
          g.fillStyle = state === "named" ? "#fff" : colour("ink"); g.textAlign = "left";
          g.fillText(row.name === "use" || row.name === "mode" || state === "named" ? (row.name === "use" ? state : text) : state, x + 5, y + ROW / 2 + 0.5);
          g.restore();
        }
      }
    });
    for (const m of this.data.marks) this.mark(g, m, s, 0, bottom);
    if (this.a > this.data.t0 || this.b < this.data.t1) {
      g.fillStyle = colour("paper"); g.globalAlpha = 0.6;
      g.fillRect(LEFT, 0, s.x(this.a) - LEFT, bottom); g.fillRect(s.x(this.b), 0, width - RIGHT - s.x(this.b), bottom);
      g.globalAlpha = 1; g.strokeStyle = colour("ink"); g.lineWidth = 1.5; g.strokeRect(s.x(this.a), 0.75, s.x(this.b) - s.x(this.a), bottom - 1.5);
    }
    this.crosshair(g, s, 0, bottom);
  }
  mark(g, m, s, top, bottom) {
    if (m.t < s.a || m.t > s.b) return;
    g.strokeStyle = colour(m.kind === "alarm" ? "fault" : "truth"); g.lineWidth = 1.2; g.setLineDash(m.kind === "alarm" ? [] : [5, 3]);
    g.beginPath(); g.moveTo(s.x(m.t), top); g.lineTo(s.x(m.t), bottom); g.stroke(); g.setLineDash([]);
  }
  crosshair(g, s, top, bottom) {
    if (!(this.cursor >= s.a && this.cursor <= s.b)) return;
    g.strokeStyle = colour("soft"); g.lineWidth = 0.8; g.beginPath(); g.moveTo(s.x(this.cursor), top); g.lineTo(s.x(this.cursor), bottom); g.stroke();
  }
  range(p) {
    let low = p.low ?? Infinity, high = p.high ?? -Infinity;
    for (const t of p.traces) {
      if (!t.shown) continue;
      const i = Math.max(find(t.t, this.a) - 1, 0), j = Math.min(find(t.t, this.b) + 1, t.t.length);
      for (let k = i; k < j; k++) { if (t.low[k] < low) low = t.low[k]; if (t.high[k] > high) high = t.high[k]; }
    }
    if (!(high >= low)) return [-1, 1];
    const pad = 0.06 * (high - low) || 0.5 + 0.01 * Math.abs(high);
    return [low - pad, high + pad];
  }
  paintPanel(p, last) {
    const top = 4, bottom = HEIGHT - 4, [g, width] = prepare(p.canvas, HEIGHT + (last ? 18 : 0)), s = this.scale(width, false);
    const [low, high] = this.range(p), y = (v) => bottom - ((v - low) / (high - low)) * (bottom - top);
    for (const [a, b, state] of this.shades) {
      if (b < s.a || a > s.b) continue;
      g.fillStyle = colour(state); g.globalAlpha = WASH[state];
      g.fillRect(s.x(Math.max(a, s.a)), top, s.x(Math.min(b, s.b)) - s.x(Math.max(a, s.a)), bottom - top); g.globalAlpha = 1;
    }
    this.timeAxis(g, s, width, top, bottom, last);
    const [at, places] = ticks(low, high, 4);
    for (const v of at) {
      g.strokeStyle = colour("grid"); g.beginPath(); g.moveTo(LEFT, y(v)); g.lineTo(width - RIGHT, y(v)); g.stroke();
      g.fillStyle = colour("soft"); g.textAlign = "right"; g.textBaseline = "middle"; g.fillText(v.toFixed(places), LEFT - 6, y(v));
    }
    g.save(); g.beginPath(); g.rect(LEFT, top - 3, width - LEFT - RIGHT, bottom - top + 6); g.clip();
    for (const t of p.traces) if (t.shown) this.paintTrace(g, t, s, y);
    for (const [v, text] of p.levels) {
      g.strokeStyle = colour("fault"); g.lineWidth = 1.1; g.setLineDash([5, 4]);
      g.beginPath(); g.moveTo(LEFT, y(v)); g.lineTo(width - RIGHT, y(v)); g.stroke(); g.setLineDash([]);
      g.fillStyle = colour("fault"); const under = y(v) < top + 14;
      g.textAlign = "right"; g.textBaseline = under ? "top" : "bottom"; g.fillText(text, width - RIGHT - 4, y(v) + (under ? 3 : -2));
    }
    for (const m of this.data.marks) this.mark(g, m, s, top, bottom);
    if (this.drag) { g.fillStyle = colour("c1"); g.globalAlpha = 0.15; g.fillRect(s.x(this.drag[0]), top, s.x(this.drag[1]) - s.x(this.drag[0]), bottom - top); g.globalAlpha = 1; }
    this.crosshair(g, s, top, bottom);
    g.restore();
    g.strokeStyle = colour("line"); g.lineWidth = 1; g.strokeRect(LEFT + 0.5, top + 0.5, width - LEFT - RIGHT - 1, bottom - top - 1);
    for (const t of p.traces) this.readout(t);
  }
  readout(t) {
    const k = find(t.t, this.cursor + 1e-9) - 1;
    if (!Number.isFinite(this.cursor) || k < 0) { t.value.textContent = ""; return; }
    t.value.textContent = t.low[k] === t.high[k] || !Number.isFinite(t.low[k]) ? say(t.low[k]) : `${say(t.low[k])}…${say(t.high[k])}`;
  }
  // One pass: samples of one pixel column become its least and largest value, so no spike is lost at any zoom.
  columns(t, s) {
    const i = Math.max(find(t.t, s.a) - 1, 0), j = Math.min(find(t.t, s.b) + 1, t.t.length), out = [];
    let c = null;
    for (let k = i; k < j; k++) {
      if (!(t.low[k] === t.low[k])) { c = null; out.push(null); continue; }
      const x = s.x(t.t[k]), column = Math.round(x);
      if (c && c.column === column) { c.low = Math.min(c.low, t.low[k]); c.high = Math.max(c.high, t.high[k]); c.last = 0.5 * (t.low[k] + t.high[k]); c.many = true; }
      else { const middle = 0.5 * (t.low[k] + t.high[k]); c = { column, x, low: t.low[k], high: t.high[k], first: middle, last: middle, many: t.low[k] !== t.high[k] }; out.push(c); }
    }
    return out;
  }
  paintTrace(g, t, s, y) {
    const cols = this.columns(t, s);
    g.strokeStyle = g.fillStyle = colour(t.role);
    if (t.role === "band") return this.paintBand(g, cols, y);
    g.lineWidth = t.role === "measured" || t.role === "reference" ? 1 : 1.5;
    g.lineJoin = "round"; g.setLineDash(DASHED[t.role] || []);
    g.beginPath();
    let before = null;
    for (const c of cols) {
      if (!c) { before = null; continue; }
      if (!before) g.moveTo(c.x, y(c.first));
      else { if (t.step) g.lineTo(c.x, y(before.last)); g.lineTo(c.x, y(c.first)); }
      if (c.many) { g.lineTo(c.x, y(c.low)); g.lineTo(c.x, y(c.high)); g.lineTo(c.x, y(c.last)); }
      before = c;
    }
    g.stroke(); g.setLineDash([]);
  }
  paintBand(g, cols, y) {
    g.globalAlpha = 0.2;
    for (let i = 0; i < cols.length; ) {
      while (i < cols.length && !cols[i]) i++;
      let j = i;
      while (j < cols.length && cols[j]) j++;
      if (j > i) {
        g.beginPath();
        for (let k = i; k < j; k++) g.lineTo(cols[k].x, y(cols[k].high));
        for (let k = j - 1; k >= i; k--) g.lineTo(cols[k].x, y(cols[k].low));
        g.closePath(); g.fill();
      }
      i = j;
    }
    g.globalAlpha = 1;
  }
  // The state of the flight at an instant, for the colours of its track: the loudest of all diagnosers.
  stateAt(t) {
    let found = "unjudged";
    for (const row of this.data.rows) {
      if (row.name === "mode") continue;
      for (const [a, b, state] of row.stretches) if (t >= a && t < b && Flight.LOUD.indexOf(state) > Flight.LOUD.indexOf(found)) found = state;
    }
    return found;
  }
  paintTrack() {
    const canvas = this.section.querySelector("canvas.track"), [east, north] = this.track;
    canvas.hidden = false;
    const [g, width] = prepare(canvas, 150);
    const limits = (v) => [v.reduce((a, b) => Math.min(a, b), Infinity), v.reduce((a, b) => Math.max(a, b), -Infinity)];
    const [e0, e1] = limits(east.low), [n0, n1] = limits(north.low), k = Math.min((width - 16) / (e1 - e0 || 1), 134 / (n1 - n0 || 1));
    const x = (e) => width / 2 + (e - (e0 + e1) / 2) * k, y = (n) => 75 - (n - (n0 + n1) / 2) * k;
    g.lineWidth = 2; g.lineCap = "round";
    for (let i = 1; i < east.t.length; i++) {
      g.strokeStyle = colour(this.stateAt(east.t[i])); g.globalAlpha = east.t[i] >= this.a && east.t[i] <= this.b ? 1 : 0.25;
      g.beginPath(); g.moveTo(x(east.low[i - 1]), y(north.low[i - 1])); g.lineTo(x(east.low[i]), y(north.low[i])); g.stroke();
    }
    g.globalAlpha = 1;
    const dot = (t, name, r) => { const i = Math.min(find(east.t, t), east.t.length - 1); g.fillStyle = colour(name); g.beginPath(); g.arc(x(east.low[i]), y(north.low[i]), r, 0, 7); g.fill(); };
    dot(this.data.t0, "soft", 3);
    for (const m of this.data.marks) if (m.kind === "alarm") dot(m.t, "fault", 4);
    if (Number.isFinite(this.cursor)) dot(this.cursor, "ink", 4);
    const step = niceStep((e1 - e0) || 1, 2);
    g.strokeStyle = g.fillStyle = colour("soft"); g.lineWidth = 1; g.beginPath(); g.moveTo(8, 146); g.lineTo(8 + step * k, 146); g.stroke();
    g.textAlign = "left"; g.textBaseline = "bottom"; g.fillText(step + " m", 8, 144);
  }
  steer(canvas, whole) {
    const at = (e) => this.scale(canvas.clientWidth, whole).t(e.clientX - canvas.getBoundingClientRect().left);
    let start = null;
    canvas.addEventListener("pointerdown", (e) => {
      if (e.button) return;
      const moves = e.shiftKey || e.pointerType === "touch" || (whole && at(e) > this.a && at(e) < this.b && (this.a > this.data.t0 || this.b < this.data.t1));
      start = { t: at(e), a: this.a, b: this.b, x: e.clientX, moves };
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      if (start && start.moves) {
        const shown = whole ? this.data.t1 - this.data.t0 : start.b - start.a, moved = ((e.clientX - start.x) / (canvas.clientWidth - LEFT - RIGHT)) * shown;
        return this.window(start.a + (whole ? moved : -moved), start.b + (whole ? moved : -moved));
      }
      this.cursor = at(e);
      this.drag = start ? [start.t, this.cursor] : null;
      this.draw();
    });
    canvas.addEventListener("pointerup", (e) => {
      if (start && !start.moves && Math.abs(e.clientX - start.x) > 4) this.window(Math.min(start.t, at(e)), Math.max(start.t, at(e)));
      start = this.drag = null;
      this.draw();
    });
    canvas.addEventListener("pointercancel", () => { start = this.drag = null; this.draw(); });
    canvas.addEventListener("pointerleave", () => { this.cursor = NaN; this.draw(); });
    canvas.addEventListener("dblclick", () => this.window(this.data.t0, this.data.t1));
    canvas.addEventListener("wheel", (e) => {
      const sideways = Math.abs(e.deltaX) > Math.abs(e.deltaY);
      if (!(e.ctrlKey || e.metaKey) && !sideways) return;
      e.preventDefault();
      const w = this.b - this.a;
      if (sideways) return this.window(this.a + (e.deltaX / 600) * w, this.b + (e.deltaX / 600) * w);
      const k = Math.exp(e.deltaY / 300), t = at(e);
      this.window(t - (t - this.a) * k, t + (this.b - t) * k);
    }, { passive: false });
    canvas.addEventListener("keydown", (e) => {
      const w = this.b - this.a, keys = { ArrowLeft: [-0.2, -0.2], ArrowRight: [0.2, 0.2], "+": [0.15, -0.15], "=": [0.15, -0.15], "-": [-0.2, 0.2] }[e.key];
      if (keys) { e.preventDefault(); this.window(this.a + keys[0] * w, this.b + keys[1] * w); }
      if (e.key === "Escape" || e.key === "0") this.window(this.data.t0, this.data.t1);
    });
  }
}
Flight.LOUD = ["unjudged", "judged", "waiting", "trained", "silent", "alarm", "named"];

const flights = JSON.parse(document.getElementById("flights").textContent);
const all = [...document.querySelectorAll("section.flight")].map((section) => new Flight(section, flights[+section.dataset.flight]));
// Flights are drawn as they come near, so that a page of many opens at once.
const watch = new IntersectionObserver((entries) => { for (const e of entries) if (e.isIntersecting) { all[+e.target.dataset.flight].open(); watch.unobserve(e.target); } }, { rootMargin: "600px" });
for (const f of all) watch.observe(f.section);
all[0].open();
const again = () => { theme = null; for (const f of all) f.draw(); };
window.addEventListener("resize", again);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
const printing = (on) => { document.documentElement.classList.toggle("print", on); theme = null; for (const f of all) { if (on) f.open(); if (f.ready) f.paint(); } };
window.addEventListener("beforeprint", () => printing(true));
window.addEventListener("afterprint", () => printing(false));
})();
