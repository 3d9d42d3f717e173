/* flat.js -- the shapes of a picture as SVG. */

const SVG = "http://www.w3.org/2000/svg";
const SAMPLES = 120; // points of a path
const HANGING = 24; // pieces of a slack string
const HALVINGS = 20; // until its length is found, to a millionth
const FRAME = 18; // CSS pixels: an axis
const PIVOT = 7; // half the length of a joint's axis
// a damper: parts of its length, and to its side (so in studio/live/view.py)
const DASHPOT = [[0.3, 0], [0.3, 1], [0.7, 1], [0.7, -1], [0.3, -1], [0.3, 1], [0.5, 1], [0.5, -1], [0.5, 1], [0.7, 1], [0.7, 0]];

function svg(tag, attributes = {}) {
  const made = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

const pointsOf = (list) => list.map(([x, y]) => `${x.toFixed(2)},${y.toFixed(2)}`).join(" ");

/* Each kind: `points` gives what must be in view, in the world; `draw` sets its elements on the screen, and
 * returns circles that cover it, where no label shall stand. */
const SHAPES = {
  line: {
    make: () => [svg("polyline", { class: "line" })],
    points: (s, look) => [...s.points.map((p) => p(look)), ...lowest(s, look)],
    draw: ([line], s, look, view) => drawn(line, linePoints(s, look).map(view.screen)),
  },
  rod: {
    make: (s) =>
      s.radius
        ? [svg("path", { class: "solid" })]
        : [
            svg("line", { class: "rod" }),
            svg("circle", { class: "joint", r: 3.5 }),
            svg("circle", { class: "joint", r: 3.5 }),
          ],
    points(s, look) {
      const ends = s.points.map((p) => p(look));
      const r = s.radius ? Math.abs(s.radius(look)) : 0;
      return ends.flatMap((p) => [p.map((x) => x - r), p.map((x) => x + r)]);
    },
    draw([bar, ...joints], s, look, view) {
      if (s.radius) return drawnSolid(bar, rodFaces(s, look), view);
      const ends = s.points.map((p) => view.screen(p(look)));
      setLine(bar, ends[0], ends[1]);
      joints.forEach((joint, k) => setCenter(joint, ends[k]));
      return covered(ends, 5);
    },
  },
  spring: {
    make: () => [svg("polyline", { class: "spring" })],
    points: (s, look) => s.points.map((p) => p(look)),
    draw([line], s, look, view) {
      const [a, b] = s.points.map((p) => view.screen(p(look)));
      const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
      const length = Math.hypot(dx, dy) || 1;
      const [nx, ny] = [(-dy / length) * 6, (dx / length) * 6];
      const turns = 2 * s.coils;
      const found = [a];
      for (const [part, side] of turns ? [] : DASHPOT) found.push([a[0] + part * dx + side * nx, a[1] + part * dy + side * ny]);
      for (let k = 0; turns && k <= turns; k++) {
        const part = 0.12 + (0.76 * k) / turns;
        const side = k === 0 || k === turns ? 0 : k % 2 ? 1 : -1;
        found.push([a[0] + part * dx + side * nx, a[1] + part * dy + side * ny]);
      }
      drawn(line, [...found, b]);
      return covered([a, b], 8);
    },
  },
  disk: {
    make: (s) => [
      svg("polyline", { class: "trace" }),
      svg("circle", { class: s.radius ? "disk" : "particle", r: 6 }),
      svg("line", { class: "spoke" }),
    ],
    points(s, look) {
      const c = s.center(look);
      const r = s.radius ? s.radius(look) : 0;
      return [c.map((x) => x - r), c.map((x) => x + r)];
    },
    draw([trace, circle, spoke], s, look, view) {
      const c = view.screen(s.center(look));
      setCenter(circle, c);
      const r = s.radius ? Math.abs(s.radius(look)) * view.scale : 6;
      circle.setAttribute("r", r);
      if (s.angle && s.radius) {
        const a = s.angle(look);
        setLine(spoke, c, [c[0] + r * Math.cos(a), c[1] - r * Math.sin(a)]);
      }
      if (s.trace) drawn(trace, view.past(s.center).map(view.screen));
      return [[...c, r + 1]];
    },
  },
  box: {
    make: () => [svg("path", { class: "solid" })],
    points: (s, look) => boxFaces(s, look).flat(),
    draw: ([path], s, look, view) => drawnSolid(path, boxFaces(s, look), view),
  },
  pivot: {
    make: (s) => [
      s.strokes
        ? svg("path", { class: "mark" })
        : isLong(s)
          ? svg("line", { class: "pivot" })
          : svg("circle", { class: "joint", r: 4 }),
    ],
    points: (s, look) => [s.at(look)],
    draw([mark], s, look, view) {
      const at = view.screen(s.at(look));
      if (s.strokes) {
        const axis = s.axis(look);
        const [x, y] = axis.map((c) => (c * PIVOT) / (Math.hypot(...axis) || 1));
        const place = ([u, v]) => [at[0] + u * x - v * y, at[1] - u * y - v * x];
        mark.setAttribute("d", s.strokes.map((line) => `M${pointsOf(line.map(place))}`).join(""));
      } else if (isLong(s)) {
        const [x, y] = view.flat(s.axis(look)).map((c) => c * PIVOT);
        setLine(mark, [at[0] - x, at[1] + y], [at[0] + x, at[1] - y]);
      } else setCenter(mark, at);
      return [[...at, PIVOT]];
    },
  },
  frame: {
    make: (s) => s.axes.map((_, k) => svg("line", { class: `frame frame${k}` })),
    points: (s, look) => [s.at(look)],
    draw(lines, s, look, view) {
      const at = view.screen(s.at(look));
      lines.forEach((line, k) => {
        const [x, y] = view.flat(s.axes[k](look)).map((c) => c * FRAME);
        setLine(line, at, [at[0] + x, at[1] - y]);
      });
      return [];
    },
  },
  ground: {
    make: () => [svg("line", { class: "ground" }), svg("path", { class: "hatch" })],
    points: (s, look) => s.points.map((p) => p(look)),
    draw([line, hatch], s, look, view) {
      const [a, b] = s.points.map((p) => view.screen(p(look)));
      setLine(line, a, b);
      const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
      const [tx, ty] = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
      const strokes = [];
      for (let d = 4; d < length; d += 9) {
        const [x, y] = [a[0] + d * tx, a[1] + d * ty];
        const [ex, ey] = [x - 7 * tx - 7 * ty, y - 7 * ty + 7 * tx];
        strokes.push(`M${x.toFixed(1)} ${y.toFixed(1)}L${ex.toFixed(1)} ${ey.toFixed(1)}`);
      }
      hatch.setAttribute("d", strokes.join(""));
      return covered([a, b], 5);
    },
  },
  path: {
    make: () => [svg("polyline", { class: "path" })],
    points: (s, look) => pathPoints(s, look),
    draw: ([line], s, look, view) => drawn(line, pathPoints(s, look).map(view.screen)),
  },
  arrow: {
    make: () => [
      svg("line", { class: "arrow" }),
      svg("polygon", { class: "head" }),
      svg("text", { class: "force" }),
    ],
    points: (s, look) => [s.at(look)],
    draw([shaft, head, label], s, look, view) {
      const force = s.vector(look);
      const size = Math.hypot(...force);
      const at = s.at(look);
      const from = view.screen(at);
      const to = view.tip(at, force);
      const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
      const seen = Number.isFinite(length) && length > 1.5;
      for (const part of [shaft, head, label]) part.style.display = seen ? "" : "none";
      if (!seen) return [];
      const [tx, ty] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
      const tip = Math.min(9, length);
      const base = [to[0] - tip * tx, to[1] - tip * ty];
      setLine(shaft, from, base);
      const side = tip * 0.45;
      drawn(head, [to, [base[0] - side * ty, base[1] + side * tx], [base[0] + side * ty, base[1] - side * tx]]);
      label.textContent = `${s.name} ${withUnit(size, "N", 3)}`;
      view.arrows.push({ from, to, label });
      return [];
    },
  },
};

/* Draws a way of points on the screen. */
function drawn(line, points) {
  line.setAttribute("points", pointsOf(points));
  return covered(points);
}

function drawnSolid(path, faces, view) {
  const seen = faces.map((face) => face.map(view.screen));
  path.setAttribute("d", solidPath(seen));
  return [];
}

const isLong = (pivot) => Boolean(pivot.axis) && pivot.of !== "plate";

function setLine(line, [x1, y1], [x2, y2]) {
  for (const [key, value] of Object.entries({ x1, y1, x2, y2 })) line.setAttribute(key, value);
}

function setCenter(circle, [cx, cy]) {
  circle.setAttribute("cx", cx);
  circle.setAttribute("cy", cy);
}

/* Points from a to b that hang by `sag` in the middle: a parabola. */
function hanging(a, b, sag) {
  const up = a.length - 1;
  return Array.from({ length: HANGING + 1 }, (_, k) => {
    const part = k / HANGING;
    const drop = 4 * sag * part * (1 - part);
    return a.map((x, i) => x + part * (b[i] - x) - (i === up ? drop : 0));
  });
}

const between = (a, b) => Math.hypot(...a.map((x, i) => b[i] - x));

/* A point that no string of that length between its ends hangs below: the tip of two straight halves. */
function lowest(s, look) {
  if (!s.length) return [];
  const [a, b] = s.points.map((p) => p(look));
  const slack = s.length(look) ** 2 - between(a, b) ** 2;
  return slack > 0 ? hanging(a, b, Math.sqrt(slack) / 2).slice(HANGING / 2, HANGING / 2 + 1) : [];
}

/* A string that is longer than the way between its ends hangs, and keeps its length (so in studio/film.py). */
function linePoints(s, look) {
  const ends = s.points.map((p) => p(look));
  if (!s.length) return ends;
  const [a, b] = ends;
  const length = s.length(look);
  if (!(length > between(a, b))) return ends;
  let [low, high] = [0, length];
  for (let k = 0; k < HALVINGS; k++) {
    const sag = (low + high) / 2;
    const found = hanging(a, b, sag);
    const long = found.reduce((sum, p, i) => (i ? sum + between(found[i - 1], p) : 0), 0);
    if (long < length) low = sag;
    else high = sag;
  }
  return hanging(a, b, low);
}

function pathPoints(s, look) {
  const [low, high] = s.range.map((f) => f(look));
  const found = [];
  for (let k = 0; k <= SAMPLES; k++) {
    const value = low + ((high - low) * k) / SAMPLES;
    found.push(s.point((name) => (name === s.over ? value : look(name))));
  }
  return found;
}

const compiledPoint = (point) => {
  const parts = point.map(compiled);
  return (look) => parts.map((f) => f(look));
};

function compiledShape(s) {
  const found = { ...s };
  if (s.points) found.points = s.points.map(compiledPoint);
  if (s.axes) found.axes = s.axes.map(compiledPoint);
  for (const key of ["center", "size", "at", "axis", "point", "vector"]) if (s[key]) found[key] = compiledPoint(s[key]);
  for (const key of ["radius", "angle", "length"]) if (s[key] !== undefined) found[key] = compiled(s[key]);
  if (s.range) found.range = s.range.map(compiled);
  return found;
}
