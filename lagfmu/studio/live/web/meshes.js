/* meshes.js -- the shapes of a picture in space as meshes and lines of three.js.
 *
 * A mesh is of unit size; its matrix has the directions of its sides as columns, and where its middle is. */

const THICK = 0.011; // of the mechanism's size: a rod without a radius, others by it
const SPAN = 0.1; // of the size: an axis of a frame

/* Of joints, of that thickness: across their axis and along it. */
const PIVOTS = { ball: [1.8, 1.8], pin: [1.4, 7], sleeve: [4, 7], plate: [5, 0.6], weld: [3, 3], motor: [4, 2.5], torsion: [3, 1.2], gear: [6, 0.8] };

const sub = (a, b) => a.map((x, i) => x - b[i]);
const scaled = (a, f) => a.map((x) => x * f);
const unitOf = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
const UPRIGHT = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

/* Each kind: `make` gives its objects, `place` puts them where the shape is. */
const SOLIDS = {
  box: {
    make: (kit) => [kit.solid("box")],
    place([box], s, look) {
      const size = s.size(look);
      put(box, s.center(look), s.axes.map((axis, k) => scaled(axis(look), size[k])));
    },
  },
  rod: {
    make: (kit, s) => (s.radius ? [kit.solid("rod")] : [kit.mesh("rod", "metal"), kit.mesh("ball", "metal"), kit.mesh("ball", "metal")]),
    place([rod, ...ends], s, look, size) {
      const [a, b] = s.points.map((p) => p(look));
      const r = s.radius ? Math.abs(s.radius(look)) : THICK * size;
      stick(rod, a, b, r);
      ends.forEach((end, k) => put(end, [a, b][k], UPRIGHT.map((e) => scaled(e, r))));
    },
  },
  disk: {
    make: (kit, s) => [kit.mesh("ball", s.radius ? "body" : "accent"), ...(s.trace ? [kit.line("accent", 1.5)] : [])],
    place([ball, trace], s, look, size, picture) {
      const r = s.radius ? Math.abs(s.radius(look)) : 2 * THICK * size;
      put(ball, s.center(look), UPRIGHT.map((e) => scaled(e, r)));
      if (trace) bend(trace, picture.past(s.center));
    },
  },
  line: {
    make: (kit) => [kit.line("metal", 2)],
    place: ([line], s, look) => bend(line, linePoints(s, look)),
  },
  ground: {
    make: (kit) => [kit.line("metal", 2.5)],
    place: ([line], s, look) => bend(line, s.points.map((p) => p(look))),
  },
  path: {
    make: (kit) => [kit.line("metal", 2)],
    place: ([line], s, look) => bend(line, pathPoints(s, look)),
  },
  spring: {
    make: (kit) => [kit.line("metal", 2.5)],
    place([line], s, look, size) {
      const [a, b] = s.points.map((p) => p(look));
      const way = sub(b, a);
      const [u, v] = squareTo(unitOf(way));
      const r = 2 * THICK * size;
      if (!s.coils) return bend(line, [a, ...DASHPOT.map(([part, side]) => along(a, [way, u], part, r * side)), b]);
      const count = 16 * s.coils;
      const coil = Array.from({ length: count + 1 }, (_, k) => {
        const angle = (2 * Math.PI * s.coils * k) / count;
        return along(a, [way, u, v], 0.1 + (0.8 * k) / count, r * Math.cos(angle), r * Math.sin(angle));
      });
      bend(line, [a, ...coil, b]);
    },
  },
  pivot: {
    make: (kit, s) => kit.veiled({ ball: "ball", sleeve: "box", weld: "box" }[s.of] || "rod", "accent"),
    place(marks, s, look, size) {
      const at = s.at(look);
      const axis = s.axis ? unitOf(s.axis(look)) : [0, 0, 1];
      const [across, half] = PIVOTS[s.of];
      const [u, v] = squareTo(axis);
      const sides = [scaled(u, across * THICK * size), scaled(v, across * THICK * size), scaled(axis, half * THICK * size)];
      for (const mark of marks) put(mark, at, sides);
    },
  },
  frame: {
    make: (kit) => ["curve1", "curve2", "curve0"].map((colour) => kit.veiled("rod", colour)).flat(),
    place(parts, s, look, size) {
      const at = s.at(look);
      const axes = s.axes.map((axis) => axis(look));
      parts.forEach((part, k) => stick(part, at, along(at, [axes[k >> 1]], SPAN * size), 0.4 * THICK * size));
    },
  },
  arrow: {
    make: (kit) => ["rod", "cone"].flatMap((part) => kit.veiled(part, "force")),
    place(parts, s, look, size, picture) {
      const at = s.at(look);
      const force = scaled(s.vector(look), picture.scene.perNewton);
      const length = Math.hypot(...force);
      const seen = Number.isFinite(length) && length > 0.004 * size;
      for (const part of parts) part.visible = seen;
      if (!seen) return;
      const long = Math.min(6 * THICK * size, 0.6 * length); // the head
      const neck = along(at, [unitOf(force)], length - long);
      const thick = long / 6;
      const tip = along(at, [force], 1);
      const [shaft, head] = [parts.slice(0, 2), parts.slice(2)];
      for (const part of shaft) stick(part, at, neck, 0.7 * thick);
      for (const part of head) stick(part, neck, tip, 2 * thick);
    },
  },
};

/* An object with its middle at p, and the vectors along its sides. */
function put(object, p, [x, y, z]) {
  object.matrix.set(x[0], y[0], z[0], p[0], x[1], y[1], z[1], p[1], x[2], y[2], z[2], p[2], 0, 0, 0, 1);
  object.matrixWorldNeedsUpdate = true;
}

/* A rod or a cone from a to b. */
function stick(object, a, b, radius) {
  const way = sub(b, a);
  const [u, v] = squareTo(unitOf(way));
  put(object, along(a, [way], 0.5), [scaled(u, radius), scaled(v, radius), way]);
}

/* A line through points. */
function bend(line, points) {
  const pairs = points.slice(1).flatMap((p, k) => [...points[k], ...p]);
  const held = line.geometry.attributes.instanceStart?.data;
  line.visible = pairs.length > 0 && pairs.every(Number.isFinite);
  if (!line.visible) return;
  if (held && held.array.length === pairs.length) {
    held.array.set(pairs);
    held.needsUpdate = true;
  } else {
    line.geometry.dispose();
    line.geometry = new THREE.LineSegmentsGeometry().setPositions(pairs);
  }
}

/* Geometries of unit size and materials in the colours of the page. */
class Kit {
  constructor(root) {
    this.root = root;
    const cylinder = (top) => new THREE.CylinderGeometry(top, 1, 1, 32).rotateX(Math.PI / 2);
    this.geometries = {
      box: new THREE.BoxGeometry(1, 1, 1),
      rod: cylinder(1),
      cone: cylinder(0),
      ball: new THREE.SphereGeometry(1, 32, 16),
    };
    this.edges = {};
    for (const name of ["box", "rod"]) this.edges[name] = new THREE.EdgesGeometry(this.geometries[name], 30);
    this.materials = new Map();
  }

  /* One for each colour and use; `colour` is a variable of page.css. */
  material(colour, use, make) {
    const key = `${colour} ${use}`;
    if (!this.materials.has(key)) this.materials.set(key, { colour, made: make() });
    return this.materials.get(key).made;
  }

  matt(colour) {
    return this.material(colour, "matt", () => new THREE.MeshStandardMaterial({ roughness: 0.55, metalness: 0.1 }));
  }

  held(object) {
    object.matrixAutoUpdate = false;
    object.frustumCulled = false;
    return object;
  }

  mesh(geometry, colour) {
    const found = this.held(new THREE.Mesh(this.geometries[geometry], this.matt(colour)));
    found.castShadow = true;
    found.receiveShadow = true;
    return found;
  }

  /* With its edges drawn. */
  solid(geometry) {
    const found = this.mesh(geometry, "body");
    const thin = () => new THREE.LineBasicMaterial({ transparent: true, opacity: 0.55 });
    const edges = new THREE.LineSegments(this.edges[geometry], this.material("metal", "edge", thin));
    edges.frustumCulled = false;
    found.add(edges);
    return found;
  }

  line(colour, width) {
    const material = this.material(colour, `line ${width}`, () => new THREE.LineMaterial({ linewidth: width }));
    const found = new THREE.LineSegments2(new THREE.LineSegmentsGeometry(), material);
    found.frustumCulled = false;
    return found;
  }

  /* Twice: the second is a veil that shows through bodies.  It casts no shadow. */
  veiled(geometry, colour) {
    const clear = { transparent: true, opacity: 0.3, depthTest: false, depthWrite: false };
    const made = this.material(colour, "veil", () => new THREE.MeshStandardMaterial(clear));
    const veil = this.held(new THREE.Mesh(this.geometries[geometry], made));
    veil.renderOrder = 1;
    const found = this.mesh(geometry, colour);
    found.castShadow = false;
    return [found, veil];
  }

  /* The reader's theme. */
  paint() {
    const style = getComputedStyle(this.root);
    for (const { colour, made } of this.materials.values()) {
      made.color.setStyle(style.getPropertyValue(`--${colour}`).trim());
      if (made.emissive && colour !== "body") made.emissive.copy(made.color).multiplyScalar(0.35);
    }
  }
}
