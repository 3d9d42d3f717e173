/* orbit.js -- turns, tilts, moves and enlarges the view of a picture in space: by dragging, wheel, fingers,
 * keys, sliders and buttons. */

const TURN = 0.008; // rad a pixel
const STEP = Math.PI / 36; // of an arrow key
const STEEPEST = 1.5; // rad
const [NEAREST, FARTHEST] = [10, 0.2]; // zoom

class Orbit {
  constructor(picture, changed) {
    this.picture = picture;
    this.changed = changed;
    this.fingers = new Map();
    this.turn = byId("turn");
    this.tilt = byId("tilt");
    this.turn.addEventListener("input", () => this.set(rad(this.turn.valueAsNumber), picture.elevation));
    this.tilt.addEventListener("input", () => this.set(picture.azimuth, rad(this.tilt.valueAsNumber)));
    byId("nearer").addEventListener("click", () => this.zoom(1.25));
    byId("farther").addEventListener("click", () => this.zoom(0.8));
    byId("reset-view").addEventListener("click", () => this.reset());
    const { root } = picture;
    root.addEventListener("pointerdown", (event) => this.down(event));
    root.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) {
      root.addEventListener(end, (event) => this.fingers.delete(event.pointerId));
    }
    root.addEventListener("contextmenu", (event) => event.preventDefault());
    root.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    root.addEventListener("keydown", (event) => this.key(event));
  }

  set(azimuth, elevation) {
    const { picture } = this;
    picture.azimuth = Math.atan2(Math.sin(azimuth), Math.cos(azimuth));
    picture.elevation = Math.min(Math.max(elevation, -STEEPEST), STEEPEST);
    this.turn.value = Math.round(deg(picture.azimuth));
    this.tilt.value = Math.round(deg(picture.elevation));
    this.changed();
  }

  by(turn, tilt) {
    this.set(this.picture.azimuth + turn, this.picture.elevation + tilt);
  }

  /* Whether there was something to zoom. */
  zoom(factor) {
    const { scene } = this.picture;
    if (!scene) return false;
    const found = Math.min(Math.max(scene.zoom * factor, FARTHEST), NEAREST);
    if (found === scene.zoom) return false;
    scene.zoom = found;
    this.changed();
    return true;
  }

  shift(right, up) {
    const { scene } = this.picture;
    if (!scene) return;
    scene.shift(right, up);
    this.changed();
  }

  reset() {
    const { scene } = this.picture;
    if (scene) scene.reset();
    this.set(AZIMUTH, ELEVATION);
  }

  down(event) {
    this.picture.root.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    const other = [...this.fingers].find(([id]) => id !== event.pointerId);
    this.fingers.set(event.pointerId, now);
    if (other) {
      const apart = ([x, y]) => Math.hypot(x - other[1][0], y - other[1][1]) || 1;
      this.zoom(apart(now) / apart(before));
      this.shift(dx / 2, -dy / 2);
    } else if (event.shiftKey || event.buttons & 2) this.shift(dx, -dy);
    else this.by(-dx * TURN, dy * TURN);
  }

  wheel(event) {
    if (this.zoom(Math.exp(-0.0015 * event.deltaY))) event.preventDefault();
  }

  key(event) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (way && event.shiftKey) this.shift(20 * way[0], 20 * way[1]);
    else if (way) this.by(STEP * way[0], STEP * way[1]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.25);
    else if (event.key === "-") this.zoom(0.8);
    else if (event.key === "0" || event.key === "Home") this.reset();
    else return;
    event.preventDefault();
  }
}

const rad = (degrees) => (degrees * Math.PI) / 180;
const deg = (radians) => (radians * 180) / Math.PI;
