/* picture.js -- the mechanism at a time: flat as SVG, or in space on a canvas below the SVG (space.js), which
 * then holds but the names of the forces and the axes. */

const ROWS = 120; // that the view is fitted to
const MARGIN = 16;
const AXES = 26; // CSS pixels: the axes of a picture in space
const LONGEST = 0.22; // of the view: the arrow of the largest force
const AZIMUTH = -1.05; // rad: from where a picture in space is seen at first
const ELEVATION = 0.42;

class Picture {
  constructor(root, facts) {
    this.root = root;
    this.inSpace = facts.dimensions === 3;
    this.scene = null; // of space.js, where there is WebGL
    this.azimuth = AZIMUTH;
    this.elevation = ELEVATION;
    this.shapes = facts.shapes
      .filter((s) => s.kind in SHAPES)
      .map((s) => {
        const kind = SHAPES[s.kind];
        const parts = kind.make(s);
        root.append(...parts);
        return { shape: compiledShape(s), kind, parts };
      });
    for (const { parts, shape } of this.shapes) if (shape.kind === "arrow") root.append(...parts);
    const named = facts.shapes.filter((s) => s.kind === "direction");
    this.axes = this.inSpace ? this.makeAxes(named.map(compiledShape)) : [];
    this.screen = this.screen.bind(this);
    this.flat = this.flat.bind(this);
    this.past = this.past.bind(this);
  }

  /* A vector of the world in the plane of the screen, y up. */
  flat(v) {
    if (!this.inSpace) return [v[0], v[1]];
    const [x, y, z] = v;
    const { azimuth: a, elevation: e } = this;
    const depth = x * Math.cos(a) + y * Math.sin(a);
    return [-x * Math.sin(a) + y * Math.cos(a), z * Math.cos(e) - depth * Math.sin(e)];
  }

  screen(p) {
    if (this.scene) return this.scene.screen(p);
    const [x, y] = this.flat(p);
    return [this.left + (x - this.low[0]) * this.scale, this.bottom - (y - this.low[1]) * this.scale];
  }

  /* Where the arrow of a force [N] at a point ends on the screen. */
  tip(at, force) {
    if (this.scene) return this.scene.screen(at.map((x, i) => x + force[i] * this.scene.perNewton));
    const [x, y] = this.screen(at);
    const [right, up] = this.flat(force).map((f) => (f * this.reach) / this.strongest);
    return [x + right, y - up];
  }

  look(place) {
    const { trajectory } = this;
    return (name) => trajectory.at(name, place);
  }

  /* Fits the view to the whole run, and the arrows to its largest force. */
  show(trajectory) {
    this.trajectory = trajectory;
    this.points = []; // what must be in view, in the world
    this.forces = []; // [foot, vector]
    const sizes = new Map();
    const stride = Math.max(1, Math.floor(trajectory.time.length / ROWS));
    for (let row = 0; row < trajectory.time.length; row += stride) {
      const look = this.look([row, 0]);
      for (const { shape, kind } of this.shapes) {
        if (shape.kind === "arrow") {
          const force = shape.vector(look);
          const size = Math.hypot(...force);
          if (size > 0) sizes.set(shape, [...(sizes.get(shape) || []), size]);
          this.forces.push([shape.at(look), force]);
        }
        if (shape.kind === "path" && row > 0 && !shape.moves) continue;
        this.points.push(...kind.points(shape, look).filter((p) => p.every(Number.isFinite)));
      }
    }
    let strongest = 0;
    for (const found of sizes.values()) {
      found.sort((a, b) => a - b);
      strongest = Math.max(strongest, found[Math.floor(0.98 * (found.length - 1))]); // not a spike
    }
    this.strongest = strongest || 1;
    this.fit();
  }

  /* To the size of its element, and where it is flat to the direction from which it is seen. */
  fit() {
    const { width, height } = this.root.getBoundingClientRect();
    this.width = Math.max(width, 100);
    this.height = Math.max(height, 100);
    this.root.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    if (this.scene) {
      this.scene.fit(this);
      return;
    }
    [this.low, this.high] = extent(this.points.map(this.flat), 2);
    this.reach = LONGEST * Math.min(this.width, this.height);
    const [w, h] = [this.high[0] - this.low[0], this.high[1] - this.low[1]];
    const pushes = this.forces.map(([foot, vector]) => [this.flat(foot), this.flat(vector)]);
    const room = [0, 0, 0, 0]; // that arrows need besides: left, right, below, above
    for (let turn = 0; turn < 3; turn++) {
      const across = (this.width - 2 * MARGIN - room[0] - room[1]) / (w || 1e-9);
      const up = (this.height - 2 * MARGIN - room[2] - room[3]) / (h || 1e-9);
      this.scale = w === 0 && h === 0 ? 1 : Math.min(across, up, 1e9);
      this.makeRoom(pushes, room, [w * this.scale, h * this.scale]);
    }
    this.left = (this.width - w * this.scale + room[0] - room[1]) / 2;
    this.bottom = (this.height + h * this.scale - room[2] + room[3]) / 2;
  }

  /* How far arrows reach beyond the bodies [CSS pixels]; one that is longer than it should be is a spike. */
  makeRoom(pushes, room, size) {
    for (const [foot, vector] of pushes) {
      const long = Math.min(1, this.strongest / Math.hypot(...vector)) * (this.reach / this.strongest);
      for (const i of [0, 1]) {
        const tip = (foot[i] - this.low[i]) * this.scale + vector[i] * long;
        if (!Number.isFinite(tip)) continue;
        room[2 * i] = Math.max(room[2 * i], -tip);
        room[2 * i + 1] = Math.max(room[2 * i + 1], tip - size[i]);
      }
    }
  }

  /* The directions of x, y and z and others, in the corner below on the left. */
  makeAxes(others) {
    const own = ["x", "y", "z"].map((name, k) => ({ name, vector: () => [0, 1, 2].map((i) => Number(i === k)) }));
    return [...own, ...others].map(({ name, vector }, k) => {
      const line = svg("line", { class: k < 3 ? "axis" : "axis other" });
      const label = svg("text", { class: "axis-name" });
      label.textContent = name;
      this.root.append(line, label);
      return { line, label, vector };
    });
  }

  drawAxes(look) {
    const from = [AXES + 12, this.height - AXES - (this.axes.length > 3 ? 14 : 4)];
    for (const { line, label, vector } of this.axes) {
      const way = vector(look);
      const size = Math.hypot(...way) || 1;
      const [x, y] = this.flat(way).map((c) => c / size);
      setLine(line, from, [from[0] + AXES * x, from[1] - AXES * y]);
      label.setAttribute("x", from[0] + (AXES + 8) * x);
      label.setAttribute("y", from[1] - (AXES + 8) * y + 4);
    }
  }

  past(center) {
    const found = [];
    const last = this.placed[0];
    const stride = Math.max(1, Math.floor(last / (4 * ROWS)));
    for (let row = 0; row <= last; row += stride) found.push(center(this.look([row, 0])));
    found.push(center(this.look(this.placed)));
    return found;
  }

  now(t) {
    this.placed = this.trajectory.place(t);
    this.arrows = [];
    const look = this.look(this.placed);
    if (this.scene) this.scene.draw(look, this);
    const bodies = this.shapes.flatMap(({ shape, kind, parts }) =>
      this.scene && shape.kind !== "arrow"
        ? covered(kind.points(shape, look).map(this.screen))
        : kind.draw(parts, shape, look, this)
    );
    this.drawAxes(look);
    placeLabels(this.arrows, bodies, this.width, this.height);
  }
}

/* The least and the largest of each of n coordinates; 0 and 1 of no points. */
function extent(points, n) {
  if (!points.length) return [Array(n).fill(0), Array(n).fill(1)];
  const low = Array(n).fill(Infinity);
  const high = Array(n).fill(-Infinity);
  for (const p of points) {
    for (let i = 0; i < n; i++) {
      low[i] = Math.min(low[i], p[i]);
      high[i] = Math.max(high[i], p[i]);
    }
  }
  return [low, high];
}
