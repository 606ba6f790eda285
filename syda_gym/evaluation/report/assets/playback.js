"use strict";
// The 3D playback: a small WebGL renderer of spheres, cylinders and boxes. z is up, x towards the viewer, y to the right.
(() => {
  const LENGTH = 1 / 4000, TURN = 1 / 32767; // steps of the 16-bit numbers, as in playback.py
  const SPACING = 1.45; // metres between figures

  // --- 4x4 matrices, column by column -------------------------------------------------------------------------
  const multiply = (a, b) => {
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) {
      out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
    }
    return out;
  };
  const placed = (p, q, s) => { // position, quaternion (scalar last), scale along each axis
    const [x, y, z, w] = q, [a, b, c] = s;
    return new Float32Array([
      a * (1 - 2 * (y * y + z * z)), a * 2 * (x * y + z * w), a * 2 * (x * z - y * w), 0,
      b * 2 * (x * y - z * w), b * (1 - 2 * (x * x + z * z)), b * 2 * (y * z + x * w), 0,
      c * 2 * (x * z + y * w), c * 2 * (y * z - x * w), c * (1 - 2 * (x * x + y * y)), 0,
      p[0], p[1], p[2], 1]);
  };
  const projection = (fov, aspect, near, far) => {
    const f = 1 / Math.tan(fov / 2), d = near - far;
    return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / d, -1, 0, 0, 2 * near * far / d, 0]);
  };
  const looking = (eye, at) => {
    const norm = (v) => { const l = Math.hypot(...v); return v.map((x) => x / l); };
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const z = norm(eye.map((v, i) => v - at[i])), x = norm(cross([0, 0, 1], z)), y = cross(z, x);
    const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, dot(x), dot(y), dot(z), 1]);
  };
  const between = (a, b, radius) => { // the unit cylinder laid from a to b
    const d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]], l = Math.hypot(...d) || 1e-9, u = d.map((v) => v / l);
    // Shortest turn from the z axis to u.
    let q = [-u[1], u[0], 0, 1 + u[2]];
    const n = Math.hypot(...q);
    q = n < 1e-6 ? [1, 0, 0, 0] : q.map((v) => v / n);
    return placed([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2], q, [radius, radius, l]);
  };

  // --- unit solids as triangles: position and normal ------------------------------------------------------------
  const sphere = (rows, columns) => {
    const at = (i, j) => {
      const t = Math.PI * i / rows, f = 2 * Math.PI * j / columns;
      return [Math.sin(t) * Math.cos(f), Math.sin(t) * Math.sin(f), Math.cos(t)];
    };
    const out = [];
    for (let i = 0; i < rows; i++) for (let j = 0; j < columns; j++) {
      const [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
      for (const v of [a, b, c, a, c, d]) out.push(...v, ...v);
    }
    return out;
  };
  const cylinder = (columns) => {
    const out = [];
    for (let j = 0; j < columns; j++) {
      const f = 2 * Math.PI * j / columns, g = 2 * Math.PI * (j + 1) / columns;
      const a = [Math.cos(f), Math.sin(f)], b = [Math.cos(g), Math.sin(g)], h = 0.5;
      for (const [v, z] of [[a, -h], [b, -h], [b, h], [a, -h], [b, h], [a, h]]) out.push(...v, z, ...v, 0);
      for (const z of [h, -h]) for (const v of [[0, 0], z > 0 ? a : b, z > 0 ? b : a]) out.push(...v, z, 0, 0, Math.sign(z));
    }
    return out;
  };
  const box = () => {
    const out = [];
    for (let axis = 0; axis < 3; axis++) for (const side of [-1, 1]) {
      const n = [0, 0, 0]; n[axis] = side;
      const corner = (s, t) => { const v = [0, 0, 0]; v[axis] = side / 2; v[(axis + 1) % 3] = s / 2 * side; v[(axis + 2) % 3] = t / 2; return v; };
      for (const [s, t] of [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]) out.push(...corner(s, t), ...n);
    }
    return out;
  };

  const VERTEX = `attribute vec3 p; attribute vec3 n; uniform mat4 view, model, flat_; varying vec3 normal; varying vec3 where;
    void main() { vec4 w = flat_ * model * vec4(p, 1.0); where = w.xyz;
      // Scaled axes: dividing by the squared scale turns the normal as the inverse transpose would.
      vec3 s = vec3(dot(model[0].xyz, model[0].xyz), dot(model[1].xyz, model[1].xyz), dot(model[2].xyz, model[2].xyz));
      normal = mat3(model) * (n / s); gl_Position = view * w; }`;
  const FRAGMENT = `precision mediump float; uniform vec4 colour; uniform float lit; uniform vec3 eye; varying vec3 normal; varying vec3 where;
    void main() { vec3 n = normalize(normal), to = normalize(eye - where); vec3 sun = normalize(vec3(1.5, 0.9, 2.2));
      float light = 0.52 + 0.14 * n.z + 0.42 * max(dot(n, sun), 0.0);
      float shine = 0.16 * pow(max(dot(n, normalize(sun + to)), 0.0), 28.0);
      gl_FragColor = vec4(mix(colour.rgb, colour.rgb * light + shine, lit), colour.a); }`;

  const SAME = placed([0, 0, 0], [0, 0, 0, 1], [1, 1, 1]);
  // Projects along the sun's rays onto the floor.
  const SHADOW = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, -1.5 / 2.2, -0.9 / 2.2, 0, 0, 0, 0, 0.004, 1]);

  class Renderer {
    constructor(canvas) {
      const gl = canvas.getContext("webgl", {antialias: true, stencil: true, preserveDrawingBuffer: true});
      if (!gl) throw new Error("no WebGL");
      this.gl = gl;
      const program = gl.createProgram();
      for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(program, shader);
      }
      gl.bindAttribLocation(program, 0, "p"); gl.bindAttribLocation(program, 1, "n");
      gl.linkProgram(program); gl.useProgram(program);
      this.at = Object.fromEntries(["view", "model", "flat_", "colour", "lit", "eye"].map((n) => [n, gl.getUniformLocation(program, n)]));
      const solids = {sphere: sphere(12, 20), cylinder: cylinder(26), box: box()};
      this.solids = {};
      const numbers = [];
      for (const [name, data] of Object.entries(solids)) {
        this.solids[name] = [numbers.length / 6, data.length / 6];
        for (const value of data) numbers.push(value);
      }
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 24, 0);
      gl.enableVertexAttribArray(1); gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 24, 12);
      gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    }
    begin(view, eye, paper, floor, width) {
      const gl = this.gl;
      gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
      gl.clearColor(...paper, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
      gl.uniformMatrix4fv(this.at.view, false, view); gl.uniform3fv(this.at.eye, eye);
      gl.uniformMatrix4fv(this.at.flat_, false, SAME); gl.uniform1f(this.at.lit, 0);
      this.one("cylinder", placed([0, 0, -0.01], [0, 0, 0, 1], [width * 0.42 + 0.8, width * 0.5 + 0.75, 0.02]), [...floor, 1]);
    }
    one(solid, model, colour) {
      const gl = this.gl, [first, count] = this.solids[solid];
      gl.uniformMatrix4fv(this.at.model, false, model); gl.uniform4fv(this.at.colour, colour);
      gl.drawArrays(gl.TRIANGLES, first, count);
    }
    shadows(items) {
      const gl = this.gl;
      gl.uniformMatrix4fv(this.at.flat_, false, SHADOW); gl.uniform1f(this.at.lit, 0);
      gl.enable(gl.BLEND); gl.enable(gl.STENCIL_TEST); gl.stencilFunc(gl.EQUAL, 0, 255); gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR); gl.depthMask(false);
      for (const [solid, model] of items) this.one(solid, model, [0, 0, 0, 0.16]);
      gl.depthMask(true); gl.disable(gl.STENCIL_TEST); gl.disable(gl.BLEND);
    }
    solid(items) {
      const gl = this.gl;
      gl.uniformMatrix4fv(this.at.flat_, false, SAME); gl.uniform1f(this.at.lit, 1);
      for (const [solid, model, colour] of items) this.one(solid, model, [...colour, 1]);
    }
    ghost(items, colour) { // depth first, so that only its nearest surface is blended
      const gl = this.gl;
      gl.uniformMatrix4fv(this.at.flat_, false, SAME); gl.uniform1f(this.at.lit, 1);
      gl.colorMask(false, false, false, false);
      for (const [solid, model] of items) this.one(solid, model, [0, 0, 0, 1]);
      gl.colorMask(true, true, true, true); gl.enable(gl.BLEND);
      for (const [solid, model] of items) this.one(solid, model, [...colour, 0.45]);
      gl.disable(gl.BLEND);
    }
  }

  // Where a browser has no WebGL, the same solids are drawn as flat strokes and discs.
  class FlatRenderer {
    constructor(canvas) { this.canvas = canvas; this.context = canvas.getContext("2d"); }
    begin(view, eye, paper) {
      this.view = view; this.items = [];
      this.context.fillStyle = css(paper); this.context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    }
    shadows() {}
    solid(items) { this.stroke(items, null, 1); }
    ghost(items, colour) { this.stroke(items, colour, 0.35); }
    stroke(items, colour, alpha) {
      const c = this.context, W = this.canvas.width, H = this.canvas.height, drawn = [];
      for (const [solid, m, own] of items) {
        const ends = [-0.5, 0.5].map((h) => project(this.view, solid === "cylinder" ? [m[12] + h * m[8], m[13] + h * m[9], m[14] + h * m[10]] : [m[12], m[13], m[14]], W, H));
        const radius = solid === "box" ? Math.hypot(m[4], m[5], m[6]) / 2 : Math.hypot(m[0], m[1], m[2]);
        drawn.push([ends[0][2] + ends[1][2], ends, radius * H * 1.2 / ((ends[0][2] + ends[1][2]) / 2), colour || own]);
      }
      drawn.sort((a, b) => b[0] - a[0]);
      c.lineCap = "round"; c.globalAlpha = alpha;
      for (const [, [a, b], radius, shade] of drawn) {
        c.strokeStyle = css(shade); c.lineWidth = 2 * radius;
        c.beginPath(); c.moveTo(a[0], a[1]); c.lineTo(b[0] + 0.01, b[1]); c.stroke();
      }
      c.globalAlpha = 1;
    }
  }
  const css = (rgb) => `rgb(${rgb.map((v) => Math.round(255 * v)).join(" ")})`;
  const project = (view, p, width, height) => {
    const v = [0, 1, 2, 3].map((r) => view[r] * p[0] + view[4 + r] * p[1] + view[8 + r] * p[2] + view[12 + r]);
    return [(v[0] / v[3] + 1) / 2 * width, (1 - v[1] / v[3]) / 2 * height, v[3]];
  };
  const variable = (name) => {
    const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim().slice(1);
    return [0, 2, 4].map((i) => parseInt(text.slice(i, i + 2), 16) / 255);
  };

  // --- tracks -----------------------------------------------------------------------------------------------------
  const numbers = (text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Int16Array(bytes.buffer);
  };
  const unpacked = new Map();
  const track = (content, key) => {
    if (!unpacked.has(key)) {
      const t = content.tracks[key], model = content.models[t.model];
      const points = numbers(t.points), positions = numbers(t.positions), turns = numbers(t.turns);
      unpacked.set(key, {model, frames: t.frames, points, positions, turns, perPoint: points.length / t.frames, perPose: positions.length / t.frames});
      if (unpacked.size > 60) unpacked.delete(unpacked.keys().next().value);
    }
    return unpacked.get(key);
  };
  // Solids of one figure at a fractional frame, moved sideways by `shift`: [solid, matrix, colour].
  const solids = (figure, time, shift, movingOnly = false) => {
    const last = figure.frames - 1, i = Math.min(last, Math.floor(time)), j = Math.min(last, i + 1), t = time - i;
    const mix = (data, per, index) => data[i * per + index] * (1 - t) + data[j * per + index] * t;
    const offset = placed([0, shift, 0], [0, 0, 0, 1], [1, 1, 1]);
    const point = (k) => [0, 1, 2].map((a) => mix(figure.points, figure.perPoint, 3 * k + a) * LENGTH);
    const poses = [];
    for (let k = 0; k < figure.perPose / 3; k++) {
      const p = [0, 1, 2].map((a) => mix(figure.positions, figure.perPose, 3 * k + a) * LENGTH);
      const per = figure.perPose / 3 * 4, a = [], b = [];
      for (let n = 0; n < 4; n++) { a.push(figure.turns[i * per + 4 * k + n]); b.push(figure.turns[j * per + 4 * k + n]); }
      const sign = a.reduce((s, v, n) => s + v * b[n], 0) < 0 ? -1 : 1;
      let q = a.map((v, n) => TURN * (v * (1 - t) + sign * b[n] * t));
      const l = Math.hypot(...q) || 1;
      poses.push(placed(p, q.map((v) => v / l), [1, 1, 1]));
    }
    const out = [];
    for (const s of figure.model.shapes) {
      if (s.kind === "bone") {
        const [a, b] = s.points.map(point), r = s.size[0];
        out.push(["sphere", multiply(offset, placed(a, [0, 0, 0, 1], [r, r, r])), s.colour]);
        if (s.points[0] !== s.points[1]) {
          out.push(["sphere", multiply(offset, placed(b, [0, 0, 0, 1], [r, r, r])), s.colour]);
          out.push(["cylinder", multiply(offset, between(a, b, r)), s.colour]);
        }
      } else if (!movingOnly || s.pose >= 0) {
        const size = s.kind === "sphere" ? [s.size[0], s.size[0], s.size[0]] : s.kind === "cylinder" ? [s.size[0], s.size[0], s.size[1]] : s.size;
        const local = placed(s.position, s.rotation, size);
        out.push([s.kind, multiply(offset, s.pose >= 0 ? multiply(poses[s.pose], local) : local), s.colour]);
      }
    }
    return out;
  };

  // --- the player -------------------------------------------------------------------------------------------------
  class Player {
    constructor(element) {
      const find = (name) => element.querySelector("." + name);
      this.content = JSON.parse(element.querySelector("script").textContent);
      this.canvas = find("view"); this.strip = find("strip"); this.slider = find("time"); this.button = find("play");
      this.names = find("names"); this.readout = find("readout"); this.chainPick = find("chain"); this.clipPick = find("clip");
      this.ghost = find("ghost"); this.speed = find("speed");
      try { this.renderer = new Renderer(this.canvas); } catch { this.renderer = new FlatRenderer(this.canvas); }
      this.time = 0; this.playing = false;
      const chains = [...new Set(this.content.chains.map((c) => c.name))];
      this.chainPick.append(...chains.map((name) => new Option(name, name)));
      this.chainPick.addEventListener("change", () => this.fillClips());
      this.clipPick.addEventListener("change", () => this.choose());
      this.slider.addEventListener("input", () => { this.stop(); this.seek(Number(this.slider.value)); });
      this.button.addEventListener("click", () => this.playing ? this.stop() : this.start());
      this.ghost.addEventListener("change", () => this.draw());
      find("reset").addEventListener("click", () => { this.resetView(); this.draw(); });
      this.listen();
      new ResizeObserver(() => this.draw()).observe(this.canvas.parentElement);
      addEventListener("themechange", () => this.draw());
      this.resetView(); this.fillClips();
    }
    fillClips() {
      const before = this.clipPick.value;
      const clips = this.content.chains.filter((c) => c.name === this.chainPick.value).map((c) => c.clip);
      this.clipPick.replaceChildren(...clips.map((name) => new Option(name, name)));
      if (clips.includes(before)) this.clipPick.value = before;
      this.clipPick.parentElement.hidden = clips.length < 2 && !clips[0];
      this.choose();
    }
    choose() {
      this.chain = this.content.chains.find((c) => c.name === this.chainPick.value && c.clip === this.clipPick.value);
      this.figures = this.chain.figures.map((key) => track(this.content, key));
      this.reference = this.chain.reference && track(this.content, this.chain.reference);
      this.ghost.parentElement.hidden = !this.reference;
      this.slider.max = this.figures[0].frames - 1;
      this.names.replaceChildren(...this.figures.map((figure, i) => {
        const span = document.createElement("span"), role = document.createElement("small");
        span.textContent = figure.model.name;
        role.textContent = i === 0 ? "operator" : i === this.figures.length - 1 ? figure.model.kind : "intermediate";
        span.append(role);
        return span;
      }));
      this.seek(Math.min(this.time, this.figures[0].frames - 1));
    }
    resetView() { this.yaw = 0.22; this.pitch = 0.13; this.zoom = 1; }
    seek(time) { this.time = time; this.slider.value = Math.round(time); this.draw(); }
    start() {
      if (this.time >= this.figures[0].frames - 1) this.time = 0;
      this.playing = true; this.button.textContent = "❚❚";
      let before = performance.now();
      const tick = (now) => {
        if (!this.playing) return;
        const last = this.figures[0].frames - 1;
        let time = this.time + (now - before) / 1000 * this.chain.fps * Number(this.speed.value);
        before = now;
        if (time > last) time = last > 0 ? time % last : 0;
        this.seek(time);
        requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }
    stop() { this.playing = false; this.button.textContent = "▶"; }
    listen() {
      const fingers = new Map();
      let spread = 0;
      this.canvas.addEventListener("pointerdown", (e) => { fingers.set(e.pointerId, e); this.canvas.setPointerCapture(e.pointerId); spread = 0; });
      for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, (e) => { fingers.delete(e.pointerId); spread = 0; });
      this.canvas.addEventListener("pointermove", (e) => {
        const before = fingers.get(e.pointerId);
        if (!before) return;
        fingers.set(e.pointerId, e);
        if (fingers.size === 2) {
          const [a, b] = [...fingers.values()], now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
          if (spread) this.zoomBy(spread / now);
          spread = now;
        } else {
          this.yaw -= (e.clientX - before.clientX) * 0.008;
          if (e.pointerType === "mouse") this.pitch = Math.max(-0.05, Math.min(1.5, this.pitch + (e.clientY - before.clientY) * 0.008));
        }
        this.draw();
      });
      this.canvas.addEventListener("wheel", (e) => { e.preventDefault(); this.zoomBy(Math.exp(e.deltaY * 0.001)); this.draw(); }, {passive: false});
      this.canvas.addEventListener("keydown", (e) => {
        const turn = {ArrowLeft: -0.1, ArrowRight: 0.1}[e.key];
        if (turn) { this.yaw += turn; this.draw(); e.preventDefault(); }
        if (e.key === " ") { this.playing ? this.stop() : this.start(); e.preventDefault(); }
      });
      const jump = (e) => {
        const box = this.strip.getBoundingClientRect();
        this.stop(); this.seek(Math.max(0, Math.min(1, (e.clientX - box.left) / box.width)) * (this.figures[0].frames - 1));
      };
      this.strip.addEventListener("pointerdown", (e) => { this.strip.setPointerCapture(e.pointerId); jump(e); });
      this.strip.addEventListener("pointermove", (e) => { if (e.buttons) jump(e); });
    }
    zoomBy(factor) { this.zoom = Math.max(0.3, Math.min(2.5, this.zoom * factor)); }
    fit(canvas) {
      const ratio = Math.min(2, devicePixelRatio || 1), w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
      if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
      return ratio;
    }
    draw() {
      if (!this.figures || !this.canvas.clientWidth) return;
      const ratio = this.fit(this.canvas), W = this.canvas.width, H = this.canvas.height;
      const shift = this.figures.map((_, i) => (i - (this.figures.length - 1) / 2) * SPACING), width = SPACING * this.figures.length;
      const tall = Math.max(...this.figures.map((f) => f.model.height)) + 0.25;
      const fov = 0.5, wide = Math.max(tall * 0.62, width * 0.54 * H / W);
      const distance = this.zoom * (wide / Math.tan(fov / 2) + 0.6), middle = tall * 0.46;
      const eye = [distance * Math.cos(this.pitch) * Math.cos(this.yaw), distance * Math.cos(this.pitch) * Math.sin(this.yaw), middle + distance * Math.sin(this.pitch)];
      const view = multiply(projection(fov, W / H, 0.1, 60), looking(eye, [0, 0, middle]));
      this.renderer.begin(view, eye, variable("--paper"), variable("--floor"), width);
      const all = this.figures.flatMap((figure, i) => solids(figure, this.time, shift[i]));
      this.renderer.shadows(all); this.renderer.solid(all);
      if (this.reference && this.ghost.checked) {
        this.renderer.ghost(solids(this.reference, this.time, shift[shift.length - 1], true), variable("--ghost"));
      }
      [...this.names.children].forEach((span, i) => {
        const [x, y] = project(view, [0.25, shift[i], 0], W, H);
        span.style.left = x / ratio + "px"; span.style.top = Math.min(H / ratio - 40, y / ratio + 6) + "px";
      });
      this.drawStrip();
    }
    drawStrip() {
      const error = this.chain.error, ratio = this.fit(this.strip), c = this.strip.getContext("2d"), W = this.strip.width, H = this.strip.height;
      const seconds = this.time / this.chain.fps, now = error.length ? error[Math.min(error.length - 1, Math.round(this.time))] : null;
      this.readout.textContent = `${seconds.toFixed(2)} s` + (now === null ? "" : ` · error ${(now / 100).toFixed(1)} cm`);
      c.fillStyle = css(variable("--paper")); c.fillRect(0, 0, W, H);
      if (error.length) {
        const top = 1.1 * Math.max(400, ...error, this.chain.bound || 0), band = 18 * ratio, y = (e) => H - e / top * (H - band), x = (i) => error.length > 1 ? i / (error.length - 1) * W : W / 2;
        c.beginPath(); c.moveTo(0, H);
        error.forEach((e, i) => c.lineTo(x(i), y(e)));
        c.lineTo(W, H); c.closePath(); c.globalAlpha = 0.35; c.fillStyle = css(variable("--s0")); c.fill(); c.globalAlpha = 1;
        c.beginPath(); error.forEach((e, i) => i ? c.lineTo(x(i), y(e)) : c.moveTo(x(i), y(e)));
        c.strokeStyle = css(variable("--s0")); c.lineWidth = 1.5 * ratio; c.stroke();
        c.font = `${11 * ratio}px system-ui, sans-serif`; c.fillStyle = css(variable("--soft"));
        // The words have a band of their own above the curve, so that the line of the bound strikes none of them through.
        c.fillText(`landmark error, up to ${(Math.max(...error) / 100).toFixed(1)} cm`, 6 * ratio, 13 * ratio);
        if (this.chain.bound !== null) {
          const at = y(this.chain.bound);
          c.setLineDash([6 * ratio, 4 * ratio]); c.strokeStyle = css(variable("--warn")); c.beginPath(); c.moveTo(0, at); c.lineTo(W, at); c.stroke(); c.setLineDash([]);
          c.textAlign = "right"; c.fillStyle = css(variable("--warn")); c.fillText(`bound ${(this.chain.bound / 100).toFixed(1)} cm`, W - 6 * ratio, 13 * ratio); c.textAlign = "left";
        }
      }
      const at = this.time / Math.max(1, this.figures[0].frames - 1) * W;
      c.fillStyle = css(variable("--accent")); c.fillRect(at - ratio, 0, 2 * ratio, H);
    }
  }
  for (const element of document.querySelectorAll("figure.playback")) new Player(element);
})();
