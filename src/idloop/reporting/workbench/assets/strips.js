// The strips: every output with its model, its residual below, and the command, on one canvas with one axis of time.
// They ask the server for what they lack, draw it, and ask again: a slow browser sees fewer pictures, nothing queues up.
// The canvas covers what is in sight, not all strips: a browser copies the whole of it for every picture.
"use strict";
const Strips = (() => {
  const PERIOD = 33; // milliseconds between two pictures that follow
  const AHEAD = 25; // before a picture is due, the question for it is sent
  const FRAME = 5; // milliseconds by which a frame of the browser may come before a picture is due, and draw it
  const BEHIND = 100; // milliseconds that pictures which were late are caught up with
  const MARGIN = 120; // pixels beyond what is in sight that the canvas covers, so that it need not move at once
  const IDLE = 400; // between two questions when nothing moves
  const TALL = [176, 100], LOW = [136, 80]; // heights of an output and of its residual: up to two outputs, and more
  const COMMAND = 112, FOOT = 40, GAP = 12, LEFT = 78, RIGHT = 14;
  const SETTLE = 2500; // milliseconds for which a range has to be far too wide before it becomes narrower
  const ROOM = 0.08; // of a range about what is drawn
  const PAPER = 760, SHARP = 2; // width of the strips on paper, and pixels of theirs for one of the page
  const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";
  const COLOURS = ["surface", "text", "muted", "grid", "measured", "model", "command", "reference", "band", "accent"];
  // A line is drawn as hairlines beside each other: without a graphics processor one that is wider than a pixel costs
  // forty times as much as one that is not. Offsets in pixels.
  const PENS = {
    measured: [[-0.55, -0.55], [0.55, -0.55], [-0.55, 0.55], [0.55, 0.55]],
    model: [[0, -0.45], [0.4, 0.3], [-0.4, 0.3]],
    residual: [[-0.2, -0.2], [0.2, 0.2]],
    command: [[-0.3, -0.3], [0.3, 0.3]],
    reference: [[-0.2, -0.2], [0.2, 0.2]],
  };
  const DASH = 5; // pixels
  const LEAST = 3; // numbers on an axis: a single one says nothing about the scale

  // Points of one stream, kept between two pictures: what comes replaces what is not older.
  class Points {
    constructor() { this.count = 0; this.time = new Float64Array(0); this.values = []; }

    take(time, values, whole, before) {
      let keep = whole ? 0 : this.count;
      while (time.length && keep > 0 && this.time[keep - 1] >= time[0]) keep -= 1;
      let drop = 0; // points that have left the picture; one more holds the line's beginning
      while (drop + 1 < keep && this.time[drop + 1] < before) drop += 1;
      const count = keep - drop + time.length;
      if (count > this.time.length || values.length !== this.values.length) {
        const room = Math.ceil(1.5 * count) + 64;
        const grown = (old, Kind) => { const one = new Kind(room); if (old) one.set(old.subarray(drop, keep)); return one; };
        this.time = grown(this.time, Float64Array);
        this.values = values.map((_, i) => grown(this.values[i], Float32Array));
      } else if (drop) {
        this.time.copyWithin(0, drop, keep);
        for (let i = 0; i < this.values.length; i += 1) this.values[i].copyWithin(0, drop, keep);
      }
      this.time.set(time, keep - drop);
      for (let i = 0; i < values.length; i += 1) this.values[i].set(values[i], keep - drop);
      this.count = count;
    }

    // Index of the last point that is not after an instant; -1 where there is none.
    at(instant) {
      let [low, high] = [-1, this.count - 1];
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (this.time[middle] <= instant) low = middle; else high = middle - 1;
      }
      return low;
    }
  }

  // Range of an axis that moves in steps: it grows when it must, and shrinks when it has long been far too wide.
  class Range {
    constructor() { this.low = -1; this.high = 1; this.wide = 0; this.empty = true; }

    fit(low, high, now, calm) {
      if (!(low <= high)) { [this.low, this.high, this.empty] = [-1, 1, true]; return; }
      calm &&= !this.empty;
      this.empty = false;
      const room = ROOM * (high - low) || 0.1 * Math.abs(high) || 1e-9;
      if (calm && this.low <= low && high <= this.high) {
        if (high - low + 2 * room > 0.6 * (this.high - this.low)) { this.wide = now; return; }
        if (now - this.wide < SETTLE) return;
      }
      this.wide = now;
      // More room on the side to which it grows, so that it need not grow at once again.
      const step = calm ? 0.1 * (high - low) : 0;
      const [up, down] = [calm && high > this.high ? step : 0, calm && low < this.low ? step : 0];
      this.low = low - room - down;
      this.high = high + room + up;
    }
  }

  function ticks(low, high, wanted) {
    const raw = (high - low) / wanted;
    const power = 10 ** Math.floor(Math.log10(raw));
    const steps = [0.5, 1, 2, 5, 10].map((m) => m * power);
    const places = (step) => {
      const found = [];
      for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(k * step);
      return found;
    };
    let index = steps.findIndex((one) => one >= raw * 0.999);
    if (places(steps[index]).length < LEAST) index -= 1;
    const step = steps[index], at = places(step);
    const largest = Math.max(Math.abs(low), Math.abs(high));
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const write = largest >= 1e6 || step < 1e-5
      ? (v) => (v === 0 ? "0" : v.toExponential(Math.max(0, Math.ceil(Math.log10(largest / step)) - 1)))
      : (v) => (Math.abs(v) < step / 2 ? 0 : v).toFixed(digits).replace("-", "−");
    return { at, write };
  }

  // Widen two ends until they hold some of the values. By itself, for the numbers of a loop with closures about it are
  // objects of their own.
  function extent(values, from, to, ends) {
    let low = Infinity, high = -Infinity;
    for (let i = from; i <= to; i += 1) {
      const value = values[i];
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (low < ends[0]) ends[0] = low;
    if (high > ends[1]) ends[1] = high;
  }

  class Strips {
    // place: element; base: address of the server; moved: called when the reader moves or zooms.
    constructor(place, base, moved) {
      this.moved = moved;
      this.place = place;
      this.places = new Float64Array(0);
      this.ends = [0, 0];
      this.visible = [];
      this.decoder = new TextDecoder();
      this.rest = 0; // until then nothing is drawn
      this.top = this.tall = 0; // the stretch of the strips that the canvas covers
      this.pieces = []; // pictures of the strips while they are printed
      this.look = null; // { follow: seconds | null, stretch: [start, stop] | null, shown }
      this.pictures = 0;
      this.start = 0;
      this.stop = 10;
      this.streams = {};
      this.newest = {};
      this.epoch = "";
      this.strips = [];
      this.colours = {};
      this.cursor = null; // [x, y] of the mouse
      this.canvas = document.createElement("canvas");
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "img");
      this.box = document.createElement("div");
      this.box.className = "box";
      this.box.hidden = true;
      place.replaceChildren(this.canvas, this.box);
      this.context = this.canvas.getContext("2d", { alpha: false });
      new ResizeObserver(() => this.resize()).observe(place);
      this.listen();
      this.asked = null; // when the question was sent that is not answered yet
      this.again = false;
      const address = new URL("strips", base);
      address.protocol = address.protocol.replace("http", "ws");
      this.wire = new Wire(address, (data) => this.answered(data), () => { this.asked = null; this.pull(); });
    }

    // -- what is shown ----------------------------------------------------------------------

    arrange(outputs, input, followed) {
      this.shown = { outputs, input, followed };
      this.lay();
      this.canvas.setAttribute("aria-label",
        `Over time: ${outputs.map((o) => o.name).join(", ")}, each measured and of the model, with its residual; ${input.name}`);
      this.resize();
    }

    // One below the other. On paper each part that a page may begin with ends with the axis of time.
    lay(paper = false) {
      const { outputs, input, followed } = this.shown;
      const [high, low] = outputs.length <= 2 ? TALL : LOW;
      let top = 4;
      this.strips = [];
      const add = (height, given) => {
        this.strips.push({ top, height, range: new Range(), ...given });
        top += height + (given.foot ? FOOT : 0) + GAP;
      };
      outputs.forEach(({ name, unit }, column) => {
        const lines = [["measured", column], ["model", column]];
        if (column === followed) lines.unshift(["reference", 0]);
        add(high, { name, unit, lines });
        add(low, { name: "residual", unit, lines: [["residual", column]], band: column, foot: paper });
      });
      add(COMMAND, { name: input.name, unit: input.unit, lines: [["command", 0]], foot: true });
      this.height = top - GAP;
    }

    show(look) {
      const text = JSON.stringify(look);
      if (text === JSON.stringify(this.look)) return;
      this.look = look;
      this.calm = 0; // the next ranges fit at once
      this.pull();
    }

    paintIn(body) {
      const style = getComputedStyle(body);
      this.colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
      this.tall = 0; // everything is drawn anew
      this.repaint();
    }

    // Every value that a line shows, for all outputs.
    values(name) {
      const one = this.streams[name];
      return one ? one.values.flatMap((v) => Array.from(v.subarray(0, one.count))) : [];
    }

    times(name) { const one = this.streams[name]; return one ? Array.from(one.time.subarray(0, one.count)) : []; }

    get bytes() {
      return Object.values(this.streams).reduce((sum, one) => sum + [one.time, ...one.values].reduce((s, a) => s + a.byteLength, 0), 0);
    }

    // -- the server -------------------------------------------------------------------------

    question() {
      const { follow, stretch, shown } = this.look;
      const query = new URLSearchParams({ shown, epoch: this.epoch, buckets: Math.max(100, Math.round((this.width - LEFT - RIGHT) / 2)) });
      if (follow) query.set("follow", follow);
      else if (stretch) { query.set("start", stretch[0]); query.set("stop", stretch[1]); }
      query.set("have", Object.entries(this.newest).map(([name, seconds]) => `${name}:${seconds}`).join(","));
      return String(query);
    }

    // One question at a time: who wants something else meanwhile asks anew when the answer to the last one is there.
    pull() {
      clearTimeout(this.due);
      if (!this.look || !this.width) return;
      if (this.asked !== null) { this.again = true; return; }
      this.again = false;
      if (this.wire.ask(this.question())) this.asked = performance.now();
    }

    // When the next picture is due, of one that was due at `rest` and drawn from `drawing` to `now`. On a small computer the
    // control loop needs the processor too: at most half of the time is spent on drawing, a picture that came late and the
    // one that catches up with it taken together.
    static due(rest, drawing, now) { return Math.max(rest + Math.max(PERIOD, 2 * (now - drawing)), drawing - BEHIND); }

    // Drawn with a frame of the browser; a page in the background gets none and asks for nothing until it can be seen.
    answered(data) {
      requestAnimationFrame(() => {
        const drawing = performance.now();
        if (this.again || drawing >= this.rest - FRAME) this.draw(data, drawing);
        else this.answered(data); // it has come early
      });
    }

    draw(data, drawing) {
      this.asked = null;
      if (this.again) { this.pull(); return; }
      if (this.take(data)) {
        this.paint(drawing);
        this.pictures += 1;
        if (this.pictures === 1) performance.mark("idloop-first-picture");
      }
      // The next question is sent long before, so that a server that is busy for some milliseconds delays nothing.
      setTimeout(() => {
        if (this.asked !== null) return;
        const now = performance.now();
        this.rest = Strips.due(this.rest, drawing, now);
        clearTimeout(this.due);
        this.due = setTimeout(() => this.pull(), this.look.follow ? Math.max(this.rest - AHEAD - now, 0) : IDLE);
      });
    }

    take(data) {
      const length = new DataView(data).getUint32(0, true);
      const head = JSON.parse(this.decoder.decode(new Uint8Array(data, 4, length)));
      let offset = 4 + length, came = head.whole;
      const before = head.start - (head.stop - head.start) / 50;
      for (const { name, count, columns, newest } of head.streams) {
        const time = new Float64Array(data, offset, count);
        offset += 8 * count;
        const values = Array.from({ length: columns }, (_, i) => new Float32Array(data, offset + 4 * count * i, count));
        offset += 4 * count * columns;
        offset += -offset & 7;
        (this.streams[name] ??= new Points()).take(time, values, head.whole, before);
        if (newest != null) { came ||= newest !== this.newest[name]; this.newest[name] = newest; }
        else if (head.whole) delete this.newest[name];
      }
      this.epoch = head.epoch;
      this.band = head.band;
      [this.start, this.stop] = [head.start, head.stop];
      return came;
    }

    // -- drawing ----------------------------------------------------------------------------

    resize() {
      const width = this.place.clientWidth;
      if (!width || !this.height || this.pieces.length) return; // of paper
      const wider = Math.abs(width - (this.width ?? 0)) > 2;
      this.width = width;
      this.place.style.height = `${this.height}px`;
      this.tall = 0;
      this.paint(performance.now(), true);
      if (wider) this.pull();
    }

    // Lay the canvas over a stretch of the strips.
    cover(top, tall, scale = Math.min(devicePixelRatio || 1, 2)) {
      this.scale = scale;
      [this.top, this.tall] = [top, tall];
      const [width, height] = [Math.round(this.width * scale), Math.round(tall * scale)];
      if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
      this.canvas.style.height = `${tall}px`;
      this.canvas.style.top = `${top}px`;
    }

    // Let it cover what is in sight; whether it had to move, and everything on it is to be drawn.
    follow(seen) {
      const low = Math.max(-seen.top, 0), high = Math.min(innerHeight - seen.top, this.height);
      if (this.tall && (low >= high || (this.top <= low && high <= this.top + this.tall))) return false;
      const tall = Math.min(Math.ceil(innerHeight) + 2 * MARGIN, this.height);
      this.cover(Math.min(Math.max(Math.floor(low) - MARGIN, 0), this.height - tall), tall);
      return true;
    }

    // All strips on one canvas, until the next `paint` after `part`: to save them.
    whole() {
      this.cover(0, this.height);
      this.paint(performance.now(), true);
    }

    part() {
      this.tall = 0;
      this.repaint();
    }

    // One picture for each output and one for the command, so that a page may end between them: a canvas is not parted.
    paper() {
      if (!this.shown || this.pieces.length) return;
      this.lay(true);
      this.width = PAPER;
      this.cover(0, this.height, SHARP);
      this.context.fillStyle = this.colours.surface;
      this.context.fillRect(0, 0, this.canvas.width, this.canvas.height);
      this.paint(performance.now(), true);
      let from = 0;
      for (const { top, height, foot } of this.strips) {
        if (!foot) continue;
        const piece = document.createElement("canvas"), to = top + height + FOOT;
        [piece.width, piece.height] = [this.canvas.width, Math.round((to - from) * SHARP)];
        piece.className = "piece";
        piece.getContext("2d").drawImage(this.canvas, 0, -from * SHARP);
        this.pieces.push(piece);
        from = to;
      }
      this.place.append(...this.pieces);
    }

    screen() {
      for (const piece of this.pieces.splice(0)) piece.remove();
      if (!this.shown) return;
      this.lay();
      this.resize();
    }

    repaint() {
      this.frame ??= requestAnimationFrame(() => { this.frame = null; this.paint(); });
    }

    get right() { return this.width - RIGHT; }
    x(instant) { return LEFT + ((instant - this.start) / (this.stop - this.start)) * (this.right - LEFT); }
    instant(x) { return this.start + ((x - LEFT) / (this.right - LEFT)) * (this.stop - this.start); }

    // everywhere: out of sight as well, as far as the canvas reaches.
    paint(now = performance.now(), everywhere = false) {
      if (!this.colours.surface || !this.strips.length || !this.width) return;
      const g = this.context;
      const seen = this.place.getBoundingClientRect();
      const calm = Boolean(this.look?.follow && this.calm);
      const whole = this.follow(seen) || everywhere || !calm;
      this.upright(g);
      const along = ticks(this.start, this.stop, Math.max(3, (this.right - LEFT) / 110));
      const visible = this.visible;
      visible.length = 0;
      for (const strip of this.strips) {
        // What is scrolled out of sight is not drawn again and again.
        const from = seen.top + strip.top;
        if (strip.top > this.top + this.tall || strip.top + strip.height + FOOT < this.top) continue;
        if (!whole && (from > innerHeight || from + strip.height + (strip.foot ? FOOT : GAP) < 0)) continue;
        visible.push(strip);
        this.fit(strip, now, calm);
        this.axes(g, strip, along, whole);
      }
      // One clip for all of them: every saved state is garbage of five kilobytes.
      g.save();
      g.beginPath();
      g.rect(LEFT, this.top, this.right - LEFT, this.tall);
      g.clip();
      for (const strip of visible) this.lines(g, strip);
      g.restore();
      if (this.cursor) for (const strip of visible) this.read(g, strip);
      if (!this.streams.measured?.count) this.say("No measurements yet");
      this.calm = 1;
    }

    // Pixels of the page, after a turn as well.
    upright(g) { g.setTransform(this.scale, 0, 0, this.scale, 0, -this.top * this.scale); }

    say(text) {
      const g = this.context, { top, height } = this.strips[0];
      g.font = `15px ${FONT}`;
      g.fillStyle = this.colours.muted;
      g.textAlign = "center";
      g.textBaseline = "middle";
      g.fillText(text, (LEFT + this.right) / 2, top + height / 2);
    }

    // Its range, and where values lie: `strip.zero - strip.by * value`.
    fit(strip, now, calm) {
      const { top, height, range, lines } = strip, ends = this.ends;
      [ends[0], ends[1]] = [Infinity, -Infinity];
      for (let i = 0; i < lines.length; i += 1) {
        const one = this.streams[lines[i][0]];
        const values = one?.values[lines[i][1]];
        if (values) extent(values, Math.max(one.at(this.start), 0), one.at(this.stop), ends);
      }
      let [low, high] = ends;
      if (strip.band != null) {
        // About zero, so that one sees at once to which side it lies.
        const half = Math.max(this.band?.[strip.band] ?? 0, -low, high, 0);
        [low, high] = half > 0 ? [-half, half] : [low, high];
      }
      range.fit(low, high, now, calm);
      strip.by = height / (range.high - range.low);
      strip.zero = top + height + range.low * strip.by;
    }

    // Grid and axes on what was cleared: the picture of the strip, and its numbers and its name only where they have changed.
    axes(g, strip, along, anew) {
      const { top, height, range, foot } = strip;
      const fresh = anew || strip.low !== range.low || strip.high !== range.high;
      if (fresh) {
        strip.ticks = ticks(range.low, range.high, Math.max(height / 36, 3));
        [strip.low, strip.high] = [range.low, range.high];
      }
      const { at, write } = strip.ticks;
      g.fillStyle = this.colours.surface;
      g.fillRect(fresh ? 0 : LEFT, top - GAP / 2, fresh ? this.width : this.width - LEFT, height + GAP);
      if (foot) g.fillRect(0, top + height, this.width, FOOT);
      g.lineWidth = 1;
      g.strokeStyle = this.colours.grid;
      g.beginPath();
      for (let i = 0; i < at.length; i += 1) { const p = Math.round(strip.zero - at[i] * strip.by) + 0.5; g.moveTo(LEFT, p); g.lineTo(this.right, p); }
      for (let i = 0; i < along.at.length; i += 1) { const p = Math.round(this.x(along.at[i])) + 0.5; g.moveTo(p, top); g.lineTo(p, top + height); }
      g.stroke();
      g.strokeStyle = this.colours.muted;
      g.beginPath();
      g.moveTo(LEFT + 0.5, top);
      g.lineTo(LEFT + 0.5, top + height);
      if (foot) { g.moveTo(LEFT, top + height + 0.5); g.lineTo(this.right, top + height + 0.5); }
      g.stroke();
      g.textBaseline = "middle";
      g.textAlign = "center";
      if (foot) {
        g.fillStyle = this.colours.muted;
        g.font = `11px ${FONT}`;
        for (const value of along.at) g.fillText(along.write(value), this.x(value), top + height + 12);
        g.fillStyle = this.colours.text;
        g.font = `12px ${FONT}`;
        g.fillText("time [s]", (LEFT + this.right) / 2, top + height + 30);
      }
      if (!fresh) return;
      g.fillStyle = this.colours.text;
      g.font = `12px ${FONT}`;
      g.translate(14, top + height / 2);
      g.rotate(-Math.PI / 2);
      g.fillText(`${strip.name} [${strip.unit}]`, 0, 0, height + GAP);
      this.upright(g);
      g.fillStyle = this.colours.muted;
      g.font = `11px ${FONT}`;
      g.textAlign = "right";
      for (const value of at) g.fillText(write(value), LEFT - 6, strip.zero - value * strip.by);
    }

    lines(g, strip) {
      const half = strip.band == null ? null : this.band?.[strip.band];
      if (strip.band != null) {
        if (half) {
          g.globalAlpha = 0.3;
          g.fillStyle = this.colours.band;
          const above = Math.max(strip.zero - half * strip.by, strip.top);
          g.fillRect(LEFT, above, this.right - LEFT, Math.min(strip.zero + half * strip.by, strip.top + strip.height) - above);
          g.globalAlpha = 1;
        }
        g.strokeStyle = this.colours.muted;
        g.lineWidth = 0.8;
        g.beginPath();
        g.moveTo(LEFT, strip.zero);
        g.lineTo(this.right, strip.zero);
        g.stroke();
      }
      for (let i = 0; i < strip.lines.length; i += 1) this.line(g, strip, strip.lines[i][0], strip.lines[i][1]);
    }

    line(g, strip, name, column) {
      const one = this.streams[name];
      const values = one?.values[column];
      if (!values) return;
      const { time } = one, { zero: level, by: step } = strip;
      const above = strip.top, below = strip.top + strip.height;
      const from = Math.max(one.at(this.start) - 1, 0), to = Math.min(one.at(this.stop) + 2, one.count);
      const by = (this.right - LEFT) / (this.stop - this.start), zero = LEFT - this.start * by;
      const held = name === "command", dashed = name === "reference";
      // Places of the line, NaN where it is interrupted; kept, and traced for each hairline: a browser holds every
      // Path2D until it collects its garbage, which is some MB a second.
      const places = this.places.length >= 4 * (to - from) ? this.places : (this.places = new Float64Array(6 * (to - from)));
      let count = 0, down = false, before = 0;
      for (let i = from; i < to; i += 1) {
        const value = values[i];
        // Dashes belong to the time: they must not run along the line while it moves.
        if (value !== value || (dashed && Math.floor((time[i] * by) / DASH) % 2)) {
          if (down) { places[count] = NaN; count += 2; }
          down = false;
          continue;
        }
        // One point beside what is shown may lie outside of the strip.
        const x = zero + time[i] * by, p = Math.min(Math.max(level - value * step, above), below);
        if (down && held) { places[count] = x; places[count + 1] = before; count += 2; }
        places[count] = x;
        places[count + 1] = p;
        count += 2;
        down = true;
        before = p;
      }
      g.strokeStyle = this.colours[name === "residual" ? "model" : name];
      g.lineWidth = 1 / this.scale;
      const pens = PENS[name];
      for (let pen = 0; pen < pens.length; pen += 1) {
        const right = pens[pen][0], under = pens[pen][1];
        g.beginPath();
        let drawing = false;
        for (let k = 0; k < count; k += 2) {
          const x = places[k] + right;
          if (x !== x) drawing = false;
          else if (drawing) g.lineTo(x, places[k + 1] + under);
          else { g.moveTo(x, places[k + 1] + under); drawing = true; }
        }
        g.stroke();
      }
    }

    // The values under the mouse, and a line through all strips: events are compared across signals.
    read(g, strip) {
      const x = this.cursor[0];
      if (x < LEFT || x > this.right) return;
      g.strokeStyle = this.colours.muted;
      g.lineWidth = 1;
      g.setLineDash([2, 3]);
      g.beginPath();
      g.moveTo(x, strip.top);
      g.lineTo(x, strip.top + strip.height);
      g.stroke();
      g.setLineDash([]);
      const texts = strip.lines.map(([name, column]) => {
        const one = this.streams[name];
        const value = one?.values[column]?.[one.at(this.instant(x))];
        return value == null || value !== value ? null : `${strip.lines.length > 1 ? `${name} ` : ""}${Number(value.toPrecision(4))}`;
      }).filter(Boolean);
      if (strip === this.strips[0]) texts.unshift(`at ${this.instant(x).toFixed(3)} s`);
      if (!texts.length) return;
      const text = `${texts.join("   ")} ${strip.unit}`.replaceAll("-", "−");
      g.font = `11px ${FONT}`;
      g.textAlign = "right";
      g.textBaseline = "middle";
      const wide = g.measureText(text).width;
      g.globalAlpha = 0.88;
      g.fillStyle = this.colours.surface;
      g.fillRect(this.right - wide - 8, strip.top, wide + 8, 17);
      g.globalAlpha = 1;
      g.fillStyle = this.colours.text;
      g.fillText(text, this.right - 4, strip.top + 9);
    }

    // A picture for somebody else: the strips below their title and what the lines are.
    save(name, title, legend) {
      this.whole();
      const head = 44, scale = this.scale;
      const sheet = document.createElement("canvas");
      [sheet.width, sheet.height] = [this.canvas.width, this.canvas.height + head * scale];
      const g = sheet.getContext("2d");
      g.fillStyle = this.colours.surface;
      g.fillRect(0, 0, sheet.width, sheet.height);
      g.drawImage(this.canvas, 0, head * scale);
      g.scale(scale, scale);
      g.textBaseline = "middle";
      g.fillStyle = this.colours.text;
      g.font = `600 14px ${FONT}`;
      g.fillText(title, LEFT, 12, this.right - LEFT);
      g.font = `12px ${FONT}`;
      let x = LEFT;
      for (const [key, words] of legend) {
        g.fillStyle = this.colours[key];
        g.globalAlpha = key === "band" ? 0.4 : 1;
        g.fillRect(x, key === "band" ? 27 : 31, 24, key === "band" ? 11 : 2.5);
        g.globalAlpha = 1;
        g.fillStyle = this.colours.text;
        g.fillText(words, x + 30, 33);
        x += 48 + g.measureText(words).width;
      }
      sheet.toBlob((blob) => {
        const link = document.createElement("a");
        link.href = URL.createObjectURL(blob);
        link.download = name;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
        this.part();
      });
    }

    // -- the reader -------------------------------------------------------------------------

    go(start, stop) {
      if (!(stop - start > 1e-5)) return;
      [this.start, this.stop] = [start, stop];
      this.moved([start, stop]);
      this.repaint();
    }

    // Zoom by a factor about an instant.
    zoom(by, about = (this.start + this.stop) / 2) { this.go(about - (about - this.start) * by, about + (this.stop - about) * by); }

    move(share) { const by = share * (this.stop - this.start); this.go(this.start + by, this.stop + by); }

    listen() {
      const canvas = this.canvas;
      const place = (event) => { const r = canvas.getBoundingClientRect(); return [event.clientX - r.left, event.clientY - r.top]; };
      const inside = (x) => Math.min(Math.max(x, LEFT), this.right);
      let from = null, pan = null;
      canvas.addEventListener("pointerdown", (event) => {
        const [x] = place(event);
        if (event.button > 1 || x < LEFT) return;
        canvas.setPointerCapture(event.pointerId);
        from = x;
        pan = event.shiftKey || event.button === 1 ? [this.start, this.stop] : null;
      });
      canvas.addEventListener("pointermove", (event) => {
        this.cursor = event.pointerType === "mouse" ? place(event) : null;
        const [x] = place(event);
        if (from !== null && pan) {
          const by = ((from - x) / (this.right - LEFT)) * (pan[1] - pan[0]);
          this.go(pan[0] + by, pan[1] + by);
        } else if (from !== null) {
          this.box.hidden = Math.abs(x - from) < 5;
          this.box.style.left = `${Math.min(from, inside(x))}px`;
          this.box.style.width = `${Math.abs(inside(x) - from)}px`;
        }
        this.repaint();
      });
      canvas.addEventListener("pointerup", (event) => {
        const [x] = place(event);
        if (from !== null && !pan && Math.abs(x - from) >= 5) {
          const ends = [this.instant(from), this.instant(inside(x))].sort((a, b) => a - b);
          this.go(...ends);
        }
        from = null;
        this.box.hidden = true;
      });
      canvas.addEventListener("pointercancel", () => { from = null; this.box.hidden = true; });
      canvas.addEventListener("pointerleave", () => { this.cursor = null; this.repaint(); });
      canvas.addEventListener("dblclick", () => this.zoom(2));
      // With Ctrl, and by two fingers on a touchpad; the wheel alone scrolls the page.
      canvas.addEventListener("wheel", (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        this.zoom(1.002 ** event.deltaY, this.instant(inside(place(event)[0])));
      }, { passive: false });
      canvas.addEventListener("keydown", (event) => {
        const does = { ArrowLeft: () => this.move(-0.2), ArrowRight: () => this.move(0.2), "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2) }[event.key];
        if (!does || event.ctrlKey || event.metaKey) return;
        event.preventDefault();
        does();
      });
      addEventListener("scroll", () => this.repaint(), { passive: true });
      addEventListener("resize", () => this.part());
      addEventListener("afterprint", () => this.screen());
    }
  }

  return Strips;
})();
