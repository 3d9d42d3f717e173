/* space.js -- a picture in space, drawn by three.js on a canvas; names and axes stay in the SVG above it. */

const FIELD = 0.5; // rad, of the camera's height
const SQUARES = 8; // of the grid, about, along the mechanism
const REACH = 0.3; // of the size: the arrow of the largest force, about

/* 1, 2 or 5 times a power of ten, about as large as x. */
function round125(x) {
  const ten = 10 ** Math.floor(Math.log10(x));
  return ten * [1, 2, 5, 10].reduce((best, k) => (Math.abs(Math.log(k * ten / x)) < Math.abs(Math.log(best * ten / x)) ? k : best));
}

class Space {
  constructor(canvas, context, picture) {
    this.renderer = new THREE.WebGLRenderer({ canvas, context });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.camera = new THREE.PerspectiveCamera((FIELD * 180) / Math.PI, 1, 0.1, 10);
    this.camera.up.set(0, 0, 1);
    this.scene = new THREE.Scene();
    this.kit = new Kit(picture.root);
    this.sun = new THREE.DirectionalLight(0xffffff, 2.4);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sky = new THREE.HemisphereLight(0xffffff, 0x8890a0, 1.7);
    this.scene.add(this.sun, this.sun.target, this.sky);
    this.solids = picture.shapes.map(({ shape }) => {
      const parts = SOLIDS[shape.kind].make(this.kit, shape);
      this.scene.add(...parts);
      return { shape, parts, place: SOLIDS[shape.kind].place };
    });
    const floor = new THREE.ShadowMaterial({ opacity: 0.16 });
    this.floor = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), floor);
    this.floor.receiveShadow = true;
    const thin = () => new THREE.LineBasicMaterial({ transparent: true, opacity: 0.8 });
    this.grid = new THREE.LineSegments(new THREE.BufferGeometry(), this.kit.material("line", "grid", thin));
    this.scene.add(this.floor, this.grid);
    this.legend = svg("text", { class: "legend" });
    picture.root.append(this.legend);
    this.kit.paint();
    this.reset();
  }

  reset() {
    this.zoom = 1;
    this.shifted = [0, 0]; // of the middle of the view, in heights of it
  }

  shift(right, up) {
    this.shifted = [this.shifted[0] - right / this.height, this.shifted[1] - up / this.height];
  }

  /* The camera's distance, the grid and the scale of arrows, by all points of a run. */
  fit(picture) {
    const { width, height, points, forces, strongest } = picture;
    this.width = width;
    this.height = height;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    const [low, high] = extent(points, 3);
    this.size = Math.hypot(...sub(high, low)) || 1;
    this.square = round125(this.size / SQUARES);
    this.perSquare = round125((strongest * this.square) / (REACH * this.size));
    this.perNewton = this.square / this.perSquare;
    const tips = forces.map(([foot, force]) => {
      const long = Math.min(1, strongest / Math.hypot(...force)) * this.perNewton;
      return foot.map((x, i) => x + long * (force[i] || 0));
    });
    const all = [...points, ...tips.filter((p) => p.every(Number.isFinite))];
    const [least, most] = extent(all, 3);
    this.middle = scaled(least.map((x, i) => x + most[i]), 0.5);
    this.distance = this.far(all, picture);
    this.lay(low, high);
    const unit = (x) => shown(x, 3);
    const arrows = forces.length ? `, arrows ${unit(this.perSquare)} N a square` : "";
    this.legend.textContent = `grid ${unit(this.square)} m${arrows}`;
    this.legend.setAttribute("x", width - 10);
    this.legend.setAttribute("y", 16);
  }

  /* From how far all points are in view from the direction of the start. */
  far(points, picture) {
    const up = Math.tan(FIELD / 2) * 0.88;
    const right = up * this.camera.aspect;
    const towards = this.towards(picture);
    return points.reduce((most, p) => {
      const d = sub(p, this.middle);
      const [x, y] = picture.flat(d);
      const near = d.reduce((sum, c, i) => sum + c * towards[i], 0);
      return Math.max(most, near + Math.abs(x) / right, near + Math.abs(y) / up);
    }, 0.6 * this.size);
  }

  towards({ azimuth: a, elevation: e }) {
    return [Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e)];
  }

  /* The floor: at z = 0 if the mechanism stands above it, else a square's height below. */
  lay(low, high) {
    const step = this.square;
    const stands = low[2] >= -1e-9 * this.size && low[2] < 0.5 * this.size;
    const z = stands ? 0 : step * Math.floor(low[2] / step - 1e-9);
    const from = [0, 1].map((i) => Math.floor(low[i] / step - 1));
    const to = [0, 1].map((i) => Math.ceil(high[i] / step + 1));
    const lines = [];
    for (let k = from[0]; k <= to[0]; k++) lines.push(k * step, from[1] * step, z, k * step, to[1] * step, z);
    for (let k = from[1]; k <= to[1]; k++) lines.push(from[0] * step, k * step, z, to[0] * step, k * step, z);
    this.grid.geometry.dispose();
    this.grid.geometry = new THREE.BufferGeometry();
    this.grid.geometry.setAttribute("position", new THREE.Float32BufferAttribute(lines, 3));
    this.floor.scale.set((to[0] - from[0]) * step, (to[1] - from[1]) * step, 1);
    this.floor.position.set(((from[0] + to[0]) * step) / 2, ((from[1] + to[1]) * step) / 2, z - 1e-4 * this.size);
    const shade = this.sun.shadow;
    const half = 0.75 * this.size;
    Object.assign(shade.camera, { left: -half, right: half, bottom: -half, top: half, near: 0.1 * this.size, far: 6 * this.size });
    shade.camera.updateProjectionMatrix();
    shade.normalBias = 0.004 * this.size;
    const middle = scaled(low.map((x, i) => x + high[i]), 0.5);
    this.sun.target.position.set(...middle);
    this.sun.position.set(...along(middle, [[0.55, -0.5, 1.4]], 2 * this.size));
  }

  aim(picture) {
    const { camera } = this;
    const towards = this.towards(picture);
    const away = this.distance / this.zoom;
    const { azimuth: a, elevation: e } = picture;
    const right = [-Math.sin(a), Math.cos(a), 0];
    const up = [-Math.cos(a) * Math.sin(e), -Math.sin(a) * Math.sin(e), Math.cos(e)];
    const height = 2 * away * Math.tan(FIELD / 2);
    const target = along(this.middle, [right, up], this.shifted[0] * height, this.shifted[1] * height);
    camera.position.set(...along(target, [towards], away));
    camera.lookAt(...target);
    camera.near = Math.max(away - 3 * this.size, 0.01 * away);
    camera.far = away + 6 * this.size;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  /* A point of the world on the screen [CSS pixels]. */
  screen(p) {
    const { x, y } = new THREE.Vector3(...p).project(this.camera);
    return [((x + 1) * this.width) / 2, ((1 - y) * this.height) / 2];
  }

  /* For scripts: the matrices of each shape's meshes, column by column. */
  drawn() {
    return this.solids.map(({ shape, parts }) => ({
      kind: shape.kind,
      name: shape.name || "",
      meshes: parts.filter((part) => part.visible).map((part) => part.matrix.toArray()),
    }));
  }

  draw(look, picture) {
    this.aim(picture);
    for (const { shape, parts, place } of this.solids) place(parts, shape, look, this.size, picture);
    this.renderer.render(this.scene, this.camera);
  }
}

/* Draws the picture in space from now on; false, in words on the page, where that cannot be. */
async function openSpace(picture, redraw) {
  const canvas = byId("space");
  const fail = () => {
    picture.scene = null;
    picture.root.classList.remove("above");
    for (const element of [canvas, byId("nearer"), byId("farther")]) element.hidden = true;
    byId("flat-note").hidden = false;
    redraw();
  };
  const context = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!context) {
    fail();
    return false;
  }
  const text = new TextDecoder().decode(await inflated(byId("three")));
  document.head.append(element("script", {}, text)); // its hash is in the page's policy
  picture.scene = new Space(canvas, context, picture);
  picture.root.classList.add("above");
  canvas.addEventListener("webglcontextlost", fail);
  onColors(() => {
    picture.scene?.kit.paint();
    redraw();
  });
  redraw();
  return true;
}
